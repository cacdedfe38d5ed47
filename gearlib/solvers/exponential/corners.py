"""Linear time-invariant scenes driven by tables, solved to rounding error from corner to corner.

Between two corners x' = A x + B (u + v t): one exponential of the matrix

    A B 0
    0 0 1
    0 0 0

propagates (x, u, v) over the interval. Where few interval lengths differ, it is computed once per length, see `dense_exponential`;
where many do, a Taylor series is applied to (x, u, v) itself. Corners and samples are rounded to integer multiples of the time
resolution, so that equal intervals are recognised and rounding of intervals does not accumulate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.switch_times import rounding
from gearlib.errors import SolverError
from gearlib.solvers.exponential.dense import REACH, balanced_norm, deviation
from gearlib.solvers.inputs.table import Table

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
SERIES = 12  # terms of the Taylor series
# Measured, s: one exponential, a step with it, a term of the Taylor series; each in addition to the cost per matrix entry
EXPONENTIAL, STEP, TERM, ENTRY = 5e-5, 1e-7, 2e-8, 1e-9


@dataclass(frozen=True)
class Intervals:
    """Intervals between consecutive corners or samples."""

    unit: float  # s
    ticks: Integers  # interval boundaries, in units
    rows: Integers  # index of each sample among them

    @classmethod
    def of(cls, times: Floats, tables: Sequence[Table]) -> Intervals:
        """Intervals of a run whose first sample is its start."""
        t0, t_end = float(times[0]), float(times[-1])
        unit = rounding(t0, t_end)
        inner = [table.t[(table.t > t0) & (table.t < t_end)] for table in tables]
        samples = np.rint(times / unit).astype(np.int64)
        corners = np.rint(np.concatenate([np.empty(0), *inner]) / unit).astype(np.int64)
        ticks = _different(np.concatenate([samples, corners]))
        return cls(unit, ticks, np.searchsorted(ticks, samples))

    @cached_property
    def lengths(self) -> Integers:
        return np.diff(self.ticks)

    @cached_property
    def kinds(self) -> Integers:
        """The distinct interval lengths."""
        return _different(self.lengths)

    def costs(self, n: int, inputs: int, rate: float) -> tuple[float, float]:
        """Estimated run times of `solve`: with an exponential per length, and with Taylor series.

        Parameters
        ----------
        n, inputs : int
            Numbers of states and inputs.
        rate : float
            Rate of the fastest motion, 1/s.
        """
        lengths, entries = self.lengths, (n + 2 * inputs) ** 2
        matrices = len(self.kinds) * (EXPONENTIAL + 20.0 * ENTRY * entries**1.5)
        terms = SERIES * np.ceil(np.maximum(lengths * (self.unit * rate), 0.1) / REACH).sum()
        return matrices + len(lengths) * (STEP + ENTRY * entries), float(terms) * (TERM + ENTRY * entries)


def solve(A: Floats, B: Floats, signals: Sequence[Table | float], x0: Floats, times: Floats, cuts: Intervals) -> Floats:
    """The solution of x' = A x + B u(t), x(times[0]) = x0, at ``times``.

    Parameters
    ----------
    A, B : ndarray
        (n, n) and (n, m), dense.
    signals : sequence
        The m inputs: tables and numbers.
    x0 : ndarray
        (n,).
    times : ndarray
        Increasing; the first one is the start.
    cuts : Intervals
        For these times and tables.

    Returns
    -------
    ndarray
        (times, n).

    Raises
    ------
    SolverError
        The solution overflows.

    Examples
    --------
    >>> ramp, times = Table([0.0, 1.0, 2.0], [0.0, 1.0, 0.0]), np.array([0.0, 1.5, 2.0])
    >>> solve(np.zeros((1, 1)), np.ones((1, 1)), [ramp], np.zeros(1), times, Intervals.of(times, [ramp]))
    array([[0.   ],
           [0.875],
           [1.   ]])
    """
    from gearlib.compiler.native_module import native_functions
    from gearlib.solvers.exponential import corner_loops

    n, m = B.shape
    lengths = cuts.lengths
    G = np.zeros((n + 2 * m, n + 2 * m))
    G[:n, :n], G[:n, n : n + m], G[n : n + m, n + m :] = A, B, np.eye(m)
    rate = max(balanced_norm(G), 1e-300)
    seconds: Floats = np.asarray(lengths * cuts.unit, np.float64)
    starts: Floats = np.asarray(cuts.ticks[:-1] * cuts.unit, np.float64)
    drive = _drive(signals, starts, seconds)
    out = np.empty((len(cuts.ticks), n))
    out[0] = x = np.array(x0, float)
    matrices, series = cuts.costs(n, m, rate)
    name, E, which = "by_series", np.empty(0), np.empty(0, np.int64)
    if matrices <= series:
        name, which = "by_matrices", np.searchsorted(cuts.kinds, lengths).astype(np.int64)
        E = np.array([deviation(G, float(h))[:n] for h in cuts.kinds * cuts.unit])
    work = np.zeros((3, len(G)))
    record = corner_loops.Corners(n=n, inputs=m, count=len(lengths), rate=rate, reach=REACH)
    arrays = {"matrices": E, "which": which, "G": G, "lengths": seconds, "drive": drive, "x": x, "out": out[1:],
              "z": work[0], "term": work[1], "following": work[2]}  # fmt: skip
    native_functions(corner_loops.__name__).call(name, record, **arrays)
    states = out[cuts.rows]
    if not np.isfinite(states).all():
        t = times[int(np.argmin(np.isfinite(states).all(axis=1)))]
        raise SolverError(f"the solution leaves the range of floating-point numbers before t = {t:g} s")
    return states


def _different(values: Integers) -> Integers:
    """The distinct values, sorted; many times faster than ``np.unique`` where most are distinct."""
    ordered = np.sort(values)
    different: Integers = ordered[np.diff(ordered, prepend=ordered[:1] - 1) != 0]
    return different


def _drive(signals: Sequence[Table | float], starts: Floats, lengths: Floats) -> Floats:
    """Values at the start of each interval and slopes within it, (intervals, 2 inputs)."""
    m = len(signals)
    drive = np.zeros((len(starts), 2 * m))
    for j, signal in enumerate(signals):
        if isinstance(signal, Table):
            drive[:, j], drive[:, m + j] = signal.lines(starts, 0.5 * lengths)
        else:
            drive[:, j] = signal
    return drive
