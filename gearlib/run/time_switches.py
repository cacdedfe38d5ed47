"""Switching times of a scene's time-dependent relations: symbolic once per scene, numeric per parameter set.

Most conditions compare time with a function of the parameters: g = a + b t vanishes at -a / b, with a and b as functions of the
parameters. The others are passed to `times_of_breakpoints` whenever their parameters or the interval change.

Sinusoids of time do not switch; the frequency of the fastest one limits the steps of a run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.equations.kernel import array_function
from gearlib.equations.quasipolynomials import TIME
from gearlib.equations.switch_times import distinct, is_exact, past_rounding, times_of_breakpoints, with_error
from gearlib.equations.time_rates import time_rates
from gearlib.language.expressions import SquareWave, real_symbol
from gearlib.program.program import Batch, Newton, Program
from gearlib.program.relations import Relations
from gearlib.recent import recent

Floats = NDArray[np.float64]
_T: Any = sympy.Symbol("t", real=True)  # name of time in kernels
Switch = tuple[float, int]  # time (s), number of the relation


@dataclass(frozen=True)
class Timed:
    """Time relations of one kernel: their numbers, and the indices of their parameters."""

    expression: Any
    symbols: tuple[Any, ...]
    numbers: NDArray[np.int64]
    parameters: NDArray[np.int64]  # (relations, parameters)
    terms: tuple[Any, Any] | None  # a and b of a + b t, if g has that form

    @cached_property
    def line(self) -> Callable[..., tuple[Any, Any]] | None:
        """a and b as functions of the parameters."""
        return None if self.terms is None else array_function(self.symbols, *self.terms)

    @cached_property
    def condition(self) -> Any:
        """That the function is above zero."""
        return sympy.Gt(self.expression.xreplace({_T: TIME}), 0, evaluate=False)

    @property
    def error(self) -> Any:
        """Bound of the rounding error of the function, in units of 2**-53, in its symbols; None where it hides no sign."""
        return None if is_exact(self.expression) else with_error(self.expression, {s: s for s in (_T, *self.symbols)})[1]

    @property
    def wave(self) -> tuple[Any, Any] | None:
        """Period and offset, for periodic switching."""
        return tuple(self.expression.args[1:]) if isinstance(self.expression, SquareWave) else None

    def times(self, parameters: Floats, t0: float, t_end: float) -> list[Switch]:
        """Switches inside (t0, t_end)."""
        numbers = parameters[self.parameters]
        if self.line is None:
            return [
                (t, int(number))
                for number, row in zip(self.numbers, numbers, strict=True)
                for t in times_of_breakpoints(
                    self.condition, t0, t_end, dict(zip(self.symbols, row.tolist(), strict=True))
                ).tolist()
            ]
        with np.errstate(all="ignore"):
            a, b = self.line(*numbers.T)
            roots = np.broadcast_to(-np.asarray(a, float) / b, len(numbers))
        roots = np.where(np.isfinite(roots), roots, t0)  # g = a never switches
        roots = past_rounding(self.condition.lhs, roots, dict(zip(self.symbols, numbers.T, strict=True)))
        return [
            (t, int(k)) for k, root in zip(self.numbers, roots, strict=True) for t in distinct(root[None], t0, t_end).tolist()
        ]


@dataclass(frozen=True, eq=False)
class TimeSwitches:
    """The time relations that a scene uses."""

    timed: tuple[Timed, ...]
    _last: dict[bytes, list[Switch]] = field(default_factory=dict)

    def __call__(self, parameters: Floats, t0: float, t_end: float) -> list[Switch]:
        """Switching times in an interval, with their relations; cached for the most recent parameters and interval.

        Raises
        ------
        ArgumentError
            A condition depends on time alone, but its switching times have no closed form.
        """
        if not self.timed:
            return []
        parts = [parameters[t.parameters].tobytes() for t in self.timed]
        key = b"".join([*parts, np.array([t0, t_end]).tobytes()])
        return recent(self._last, key, lambda: [s for timed in self.timed for s in timed.times(parameters, t0, t_end)])


def time_switches(relations: Relations | None) -> TimeSwitches:
    """The time relations that a scene uses, prepared for evaluation."""
    if relations is None or not len(relations.timed):
        return TimeSwitches(())
    found = ((batch, np.flatnonzero(np.isin(batch.targets, relations.timed))) for batch in relations.batches)
    return TimeSwitches(tuple(_timed(batch, rows) for batch, rows in found if len(rows)))


def _timed(batch: Batch, rows: NDArray[np.int64]) -> Timed:
    kernel = batch.kernel
    symbols = tuple(real_symbol(f"p{p}") for p in kernel.parameters)
    # the variables in these rows are identically zero, or the condition would depend on more than time
    expression = sympy.sympify(kernel.expression).xreplace({real_symbol(f"x{c}"): sympy.S.Zero for c in kernel.columns})
    return Timed(expression, symbols, batch.targets[rows], batch.parameters[rows], _line(expression))


def _line(expression: Any) -> tuple[Any, Any] | None:
    """a and b of a + b t, if an expression has that form."""
    slope = sympy.diff(expression, _T)
    if slope.has(_T) or slope.has(sympy.Derivative) or expression.has(*_BRANCHES):
        return None
    return expression.subs(_T, 0), slope


_BRANCHES = (
    SquareWave,
    sympy.Piecewise,
    sympy.Abs,
    sympy.sign,
    sympy.Heaviside,
    sympy.Max,
    sympy.Min,
    sympy.floor,
    sympy.ceiling,
)


@dataclass(frozen=True, eq=False)
class FastestDrive:
    """Rates at which time drives a scene.

    Attributes
    ----------
    known : bool
        Whether all rates are known; an expression of time other than a sinusoid may have none.
    constant : float
        The largest rate that does not depend on parameters, rad/s.
    varying : tuple
        The other rates: a function of parameters, and the indices of these in the parameter table, a row per instance.
    """

    known: bool
    constant: float
    varying: tuple[tuple[Callable[..., Any], NDArray[np.int64]], ...]
    _last: dict[bytes, float] = field(default_factory=dict)

    def __call__(self, parameters: Floats) -> float:
        """The largest rate with these parameters, rad/s; 0 where there is none."""
        if not self.varying:
            return self.constant
        return recent(self._last, parameters[self._decisive].tobytes(), lambda: self._fastest(parameters))

    @cached_property
    def _decisive(self) -> NDArray[np.int64]:
        """The parameters that rates depend on; most runs change others."""
        return np.unique(np.concatenate([places.ravel() for _, places in self.varying]))

    def _fastest(self, parameters: Floats) -> float:
        rates = [np.abs(rate(*parameters[places.T])).max() for rate, places in self.varying]
        return max(self.constant, float(np.nan_to_num(np.array(rates), posinf=0.0).max()))


def fastest_drive(program: Program, relations: Relations | None) -> FastestDrive:
    """The fastest explicit functions of time in the equations of a scene and in its event functions."""
    known, constant = True, 0.0
    varying: list[tuple[Callable[..., Any], NDArray[np.int64]]] = []
    for batch in driven(program, relations):
        rates = time_rates(batch.kernel)
        known &= rates is not None
        symbols = rate_symbols(batch)
        for rate in rates or ():
            if rate.is_number:
                constant = max(constant, abs(float(rate)))
            else:
                varying.append((array_function(symbols, rate), batch.parameters))
    return FastestDrive(known, constant, tuple(varying))


def rate_symbols(batch: Batch) -> list[Any]:
    """The symbols in the rates of a batch, one for each of its columns of parameters."""
    return [real_symbol(f"p{p}") for p in batch.kernel.parameters]


def driven(program: Program, relations: Relations | None) -> Iterable[Batch]:
    """Batches that contain time, except conditions on time alone: steps end exactly at their switches."""
    programs = [program] if relations is None else [program, relations.program]
    for step in (step for p in programs for step in p.steps):
        for batch in [step] if isinstance(step, Batch) else step.residuals if isinstance(step, Newton) else ():
            if batch.kernel.on_time:
                yield batch
    if relations is not None:
        for batch in relations.batches:
            if batch.kernel.on_time and not relations.on_time[np.isin(relations.used, batch.targets)].all():
                yield batch
