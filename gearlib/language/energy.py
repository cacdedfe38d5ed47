"""`Energy`: the energy declaration of a component, besides its equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearlib.arguments import shown
from gearlib.errors import DeclarationError
from gearlib.language.expressions import value_of


@dataclass(frozen=True)
class Energy:
    """Energy stored, dissipated and supplied; returned by ``energies``.

    The power that flows in through the connectors must equal ``der(stored) + heat - supplied``, which `Result.energy_balance` checks.
    Simulation does not use it.

    Parameters
    ----------
    stored : expression
        Stored energy, J.
    heat : expression
        Dissipated power, W, whether into a heat port or not.
    supplied : expression
        Power supplied other than through the connectors, W, such as that of a transmission error.
    source : bool
        Whether it is a source or a support: power out of its connectors counts as work put in from outside.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Flywheel(gl.Component):
    ...     flange = gp.Flange("shaft")
    ...     J = gl.Parameter("kg.m2", "moment of inertia")
    ...     d = gl.Parameter("N.m.s/rad", "drag of the air")
    ...     w = gl.Variable("rad/s", "speed")
    ...     def equations(self):
    ...         return [
    ...             gl.Eq(self.w, gl.der(self.flange.phi)),
    ...             gl.Eq(self.J * gl.der(self.w), self.flange.tau - self.d * self.w),
    ...         ]
    ...     def energies(self):
    ...         return gl.Energy(stored=self.J * self.w**2 / 2, heat=self.d * self.w**2)
    """

    stored: Any = 0
    heat: Any = 0
    supplied: Any = 0
    source: bool = False

    def __post_init__(self) -> None:
        for name in ("stored", "heat", "supplied"):
            object.__setattr__(self, name, value_of(getattr(self, name), f"Energy({name}=)"))
        if not isinstance(self.source, (bool, np.bool_)):
            raise DeclarationError(f"Energy: source is {shown(self.source)}; expected True or False")
