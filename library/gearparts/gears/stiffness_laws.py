"""Mesh stiffness as a function of the mesh phase: one class per law, and the base of meshes that use one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from math import pi
from typing import Any

import numpy as np

import gearlib as gl
from gearlib.arguments import shown
from gearlib.errors import BindingError
from gearparts.gears.mesh_phase import (
    MeshMotion,
    checked_period,
    checked_terms,
    contact_intervals,
    period_spline,
    periodic,
    wrapped,
)
from gearparts.tables import Rows

SAMPLES = 2001  # of a period, in which a negative stiffness is looked for
PERIODS, OF_A_WAVE = 1000, 64  # the most periods, and samples of the shortest wave where there are several
EVEN: Rows = ((0.0, 1.0), (2.0, 1.0), (4.0, 1.0))


class StiffnessLaw:
    """Interface of stiffness laws (and the constant law): stiffness relative to its mean ``mesh.c``, as a function of the mesh phase.

    A law receives the mesh, whose parameters and structural choices it may use; its own attributes must be hashable, as in a frozen
    dataclass. ``phase`` is the mesh phase advanced by ``mesh.c_phase``. Pass a user-defined law as ``stiffness_law`` of a mesh.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class SquaredCosine(gp.StiffnessLaw):
    ...     depth: float
    ...     def value(self, mesh, phase):
    ...         return 1 + self.depth * (gl.cos(phase) ** 2 - 0.5)
    ...     def slope(self, mesh, phase):
    ...         return -self.depth * gl.sin(2 * phase)
    >>> mesh = gp.DetailedExternalMesh(stiffness_law=SquaredCosine(0.2), r_a=0.03, r_b=0.06, c=1e8, d=10.0)
    """

    def value(self, mesh: Any, phase: Any) -> Any:
        """Stiffness relative to its mean."""
        return 1

    def slope(self, mesh: Any, phase: Any) -> Any:
        """Its derivative with respect to the phase, apart from jumps."""
        return 0

    def phase_in_table(self, mesh: Any, phase: Any) -> Any:
        """The phase wrapped to the period of the law's table, if it has one: ``mesh.phase_in_stiffness``."""
        return 0


class SinusoidalStiffness(StiffnessLaw):
    """``1 + c_amplitude cos(phase)``."""

    def value(self, mesh: Any, phase: Any) -> Any:
        return 1 + mesh.c_amplitude * gl.cos(phase)

    def slope(self, mesh: Any, phase: Any) -> Any:
        return -mesh.c_amplitude * gl.sin(phase)


class FourierStiffness(StiffnessLaw):
    """``1 + sum(A_k cos(k phase + p_k))``."""

    def value(self, mesh: Any, phase: Any) -> Any:
        return 1 + sum(amplitude * gl.cos(order * phase + shift) for order, amplitude, shift in self._terms(mesh))

    def slope(self, mesh: Any, phase: Any) -> Any:
        return -sum(order * amplitude * gl.sin(order * phase + shift) for order, amplitude, shift in self._terms(mesh))

    def _terms(self, mesh: Any) -> Rows:
        rows = checked_terms(mesh, "stiffness_terms")
        if any(order == 0 for order, _, _ in rows):
            raise BindingError(f"{type(mesh).__name__}.stiffness_terms has the order 0; expected others, since the mean is c")
        phase = _phases([order for order, _, _ in rows])
        _refuse_negative(mesh, "stiffness_terms", 1 + sum(a * np.cos(k * phase + p) for k, a, p in rows))
        return rows


class TabulatedStiffness(StiffnessLaw):
    """Periodic cubic spline through the rows of a table."""

    def value(self, mesh: Any, phase: Any) -> Any:
        return periodic(self._table(mesh), mesh.phase_in_stiffness)[0]

    def slope(self, mesh: Any, phase: Any) -> Any:
        return periodic(self._table(mesh), mesh.phase_in_stiffness)[1]

    def phase_in_table(self, mesh: Any, phase: Any) -> Any:
        return wrapped(phase, self._table(mesh)[0][0] + pi)

    def _table(self, mesh: Any) -> Rows:
        rows = checked_period(f"{type(mesh).__name__}.stiffness_table", mesh.stiffness_table)
        _refuse_negative(mesh, "stiffness_table", period_spline(rows)(np.linspace(0, 2 * pi, SAMPLES)))
        return rows


def _phases(orders: Sequence[float]) -> Any:
    """Phases at which a sum of cosines of some orders is tried, over its period: several teeth where orders are fractions."""
    periods = min(math.lcm(*(Fraction(order).limit_denominator(PERIODS).denominator for order in orders)), PERIODS)
    each = SAMPLES - 1 if periods == 1 else OF_A_WAVE * math.ceil(max(1.0, *(abs(order) for order in orders)))
    return np.linspace(0.0, 2 * pi * periods, periods * min(each, SAMPLES - 1) + 1)


def _refuse_negative(mesh: Any, name: str, values: Any) -> None:
    """Refuse a law that falls below zero, where a mesh would drive its gears: one in N/m, for instance, instead of relative."""
    if np.min(values) < -1e-9:
        raise BindingError(
            f"{type(mesh).__name__}.{name}: the stiffness falls to {np.min(values):.4g} times c; expected 0 or more, in values over c"
        )


class RectangularStiffness(StiffnessLaw):
    """Rectangular variation, proportional to the number of tooth pairs in contact."""

    def value(self, mesh: Any, phase: Any) -> Any:
        first, second = contact_intervals(type(mesh).__name__, mesh.contact_ratio)
        if first.pairs == second.pairs:
            return 1
        more, fewer = (stretch.pairs / mesh.contact_ratio for stretch in (first, second))
        return gl.Piecewise((more, first.within(phase)), (fewer, True))


LAWS: dict[str, StiffnessLaw] = {
    "constant": StiffnessLaw(),
    "sinusoidal": SinusoidalStiffness(),
    "rectangular": RectangularStiffness(),
    "fourier": FourierStiffness(),
    "table": TabulatedStiffness(),
}


class VaryingStiffness(MeshMotion):
    """Base of meshes with phase-dependent stiffness."""

    icon = "mesh"

    stiffness = gl.Structural("constant", "how the stiffness varies over the mesh phase", choices=tuple(LAWS))
    stiffness_law = gl.Structural(None, "a StiffnessLaw of one's own, in the place of stiffness")
    stiffness_terms = gl.Structural((), "fourier: rows of order, relative amplitude, phase (rad) of cosines")
    stiffness_table = gl.Structural(EVEN, "table: rows of mesh phase (rad), stiffness over c")
    c = gl.Parameter("N/m", "mean mesh stiffness along the line of action", min=0)
    c_amplitude = gl.Parameter("1", "sinusoidal: amplitude of the stiffness over its mean", default=0.0, min=-1, max=1)
    c_phase = gl.Parameter("rad", "phase of the stiffness, ahead of the mesh phase", default=0.0)
    c_now = gl.Variable("N/m", "stiffness")
    phase_in_stiffness = gl.Variable("rad", "table: phase within the period of stiffness_table", state="never")

    def law(self) -> StiffnessLaw:
        """The stiffness law."""
        own = self.stiffness_law
        if own is None:
            return LAWS[self.stiffness]
        if not isinstance(own, StiffnessLaw):
            where = f"{type(self).__name__}.stiffness_law"
            raise BindingError(f"{where} is {shown(own)}; expected an instance of a class derived from gearparts.StiffnessLaw")
        return own

    def equations(self) -> list[gl.Eq]:
        phase = self.phase + self.c_phase
        return [
            gl.Eq(self.phase_in_stiffness, self.law().phase_in_table(self, phase)),
            gl.Eq(self.c_now, self.c * self.law().value(self, phase)),
        ]

    def stiffness_slope(self) -> Any:
        """Derivative of the stiffness with respect to the mesh phase, apart from jumps."""
        return self.c * self.law().slope(self, self.phase + self.c_phase)
