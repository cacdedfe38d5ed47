"""The fastest of what time drives in a scene: symbolic once per scene, numeric per parameter set."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.equations.time_rates import time_rates
from gearlib.program.program import Batch, Newton, Program
from gearlib.program.relations import Relations

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FastestDrive:
    """Rates at which time drives a scene.

    Attributes
    ----------
    known : bool
        Whether all of them are; time may drive a scene by an expression that has no such rate.
    constant : float
        The largest of those that are numbers, rad/s.
    varying : tuple
        Of the others: a function of the parameters, and which entries of the parameter table these are for each instance.
    """

    known: bool
    constant: float
    varying: tuple[tuple[Callable[..., Any], NDArray[np.int64]], ...]
    _last: dict[bytes, float] = field(default_factory=dict)

    def __call__(self, parameters: Floats) -> float:
        """The largest rate with these parameters, rad/s; 0 where there is none."""
        if not self.varying:
            return self.constant
        key = parameters.tobytes()
        if key not in self._last:
            rates = [np.abs(rate(*parameters[places.T])).max() for rate, places in self.varying]
            self._last.clear()
            self._last[key] = max(self.constant, float(np.nan_to_num(np.array(rates), posinf=0.0).max()))
        return self._last[key]


def fastest_drive(program: Program, relations: Relations | None) -> FastestDrive:
    """What time drives in the equations of a scene and in what its events compare with variables."""
    known, constant = True, 0.0
    varying: list[tuple[Callable[..., Any], NDArray[np.int64]]] = []
    for batch in _driven(program, relations):
        rates = time_rates(batch.kernel)
        if rates is None:
            known = False
            continue
        symbols = [sympy.Symbol(f"p{p}", real=True) for p in batch.kernel.parameters]
        for rate in rates:
            if rate.is_number:
                constant = max(constant, abs(float(rate)))
            else:
                varying.append((sympy.lambdify(symbols, rate, "numpy"), batch.parameters))
    return FastestDrive(known, constant, tuple(varying))


def _driven(program: Program, relations: Relations | None) -> Iterable[Batch]:
    """Batches that hold time; not conditions on time alone, whose switches are stepped to."""
    programs = [program] if relations is None else [program, relations.program]
    for step in (step for p in programs for step in p.steps):
        for batch in [step] if isinstance(step, Batch) else step.residuals if isinstance(step, Newton) else ():
            if batch.kernel.on_time:
                yield batch
    if relations is not None:
        for batch in relations.batches:
            if batch.kernel.on_time and not relations.on_time[np.isin(relations.used, batch.targets)].all():
                yield batch
