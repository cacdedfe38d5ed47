"""Delays of a compiled model: the histories of their signals, by the method of steps.

A run with delays is cut into pieces no longer than the shortest delay. In each piece the delayed signals are known functions of time:
cubic splines through the history of earlier pieces, between the times at which it may jump or have a kink.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.switch_times import rounding
from gearlib.errors import SolverError
from gearlib.solvers.inputs.table import Table, concatenated

Floats = NDArray[np.float64]
FEWEST, MOST = 32, 16384  # points of a history in a piece
SHARE = 0.3  # of the relative tolerance: admissible error of the interpolation
APART = 1e-10  # of a piece: how far from a jump the history is read, on both sides
# Steps of a signal, and of its slope times the length of a table, relative to its largest value: below these it counts as smooth
JUMP, KINK = 1e-8, 1e-3


@dataclass(frozen=True, eq=False)
class Delay:
    """A delay of a compiled model: the variable that it reads, the index of the input that it provides, the parameter with its length."""

    path: str
    reads: tuple[str, ...]
    gives: tuple[int, ...]
    parameter: int

    def instants(self, t0: float, t1: float) -> list[float]:
        """None: it acts all the time."""
        return []


@dataclass
class DelayHistory:
    """The delayed signal, as far as it is known.

    Attributes
    ----------
    delay : float
        s.
    begins, tables : list
        When each stretch begins, s, and the signal from then on.
    bends : list of float
        Times at which it may jump or bend.
    largest : float
        Largest magnitude of the signal so far.
    """

    delay: float
    begins: list[float]
    tables: list[Table]
    bends: list[float]
    largest: float = 0.0

    @classmethod
    def going_on(cls, delay: float, signal: Any, t: float) -> DelayHistory:
        """The history at the start of a run: constant, or that of the run which it continues."""
        known = signal if isinstance(signal, Table) else Table([t], [float(signal)])
        ahead = [b for b in known.corners.tolist() if t < b < t + delay]
        return cls(delay, [-math.inf], [known], [*ahead, t + delay], float(np.abs(known.y).max()))

    def window(self, t: float, end: float) -> Table:
        """The signal from one time to another, and what begins after that by rounding only."""
        end += rounding(end)
        first, last = (bisect_right(self.begins, at) - 1 for at in (t, end))
        parts = [
            self.tables[k].between(max(self.begins[k], t), self.begins[k + 1] if k < last else end)
            for k in range(first, last + 1)
        ]
        return concatenated(parts, [b for b in self.bends if t <= b <= end])

    def inside(self, t: float, end: float) -> list[float]:
        """When the signal may jump or bend between two times."""
        return [b for b in self.bends if t < b < end]

    def add(self, times: Sequence[float], read: Sequence[tuple[Floats, Floats]]) -> None:
        """Append the history of a piece: points on the intervals between some times."""
        self.bends = [b for b in self.bends if b >= times[0]]
        for begin, (t, u) in zip(times, read, strict=True):
            self.largest = max(self.largest, float(np.abs(u).max()))
            table = Table(t + self.delay, u, "cubic" if len(t) > 3 else "linear")
            if not _smooth(self.tables[-1], table, self.largest):
                self.bends.append(begin + self.delay)
            self.begins.append(begin + self.delay)
            self.tables.append(table)

    def error(self, read: Sequence[tuple[Floats, Floats]]) -> float:
        """Estimated error of the splines through some points, relative to the largest value: of order 4, by halving the points."""
        worst = 0.0
        for t, u in read:
            if len(t) > 8:
                worst = max(worst, float(np.abs(Table(t[::2], u[::2], "cubic")(t) - u).max()) / 16.0)
        return worst / max(self.largest, *(float(np.abs(u).max()) for _, u in read), 1e-300)

    def whole(self, t0: float) -> Table:
        """All of it from a time on."""
        until = [*self.begins[1:], math.inf]
        parts = [table.between(max(a, t0), b) for a, b, table in zip(self.begins, until, self.tables, strict=True) if b > t0]
        return concatenated(parts, self.bends)


def _smooth(before: Table, after: Table, largest: float) -> bool:
    """Whether a signal continues from one table to the next without a jump or a kink."""
    c = before.coefficients
    value, slope = c[0, -1], 0.0
    if c.shape[1] > 1:  # the last column begins at the end
        h = before.t[-1] - before.t[-2]
        slope = c[1, -2] + h * (2 * c[2, -2] + 3 * h * c[3, -2])
    step, turn = abs(after.coefficients[0, 0] - value), abs(after.coefficients[1, 0] - slope) * (after.t[-1] - after.t[0])
    return bool(step <= JUMP * largest and turn <= KINK * largest)


def points(times: Sequence[float], end: float, length: float, count: int) -> list[Floats]:
    """Times at which to read a history: ``count`` per ``length``, in the intervals between some times, at which it may jump."""
    found = []
    for a, b in zip(times, [*times[1:], end], strict=True):
        n = max(math.ceil(count * (b - a) / length), 8)
        inner = np.linspace(a, b, n + n % 2 + 1)
        gap = min(APART * length, 0.1 * (inner[1] - inner[0]))
        inner[0], inner[-1] = a + gap, b - gap
        found.append(inner)
    return found


def separate(times: Sequence[float], begin: float, end: float) -> list[float]:
    """The start of a piece and the times in it; of times that lie too close together only the first."""
    found = [begin]
    least = 1e-7 * (end - begin)
    for t in sorted(times):
        if t - found[-1] > least and end - t > least:
            found.append(t)
    return found


def more_points(count: int, path: str, t: float) -> int:
    """Twice the number of points.

    Raises
    ------
    SolverError
        There are too many already.
    """
    if count >= MOST:
        raise SolverError(
            f"the history of {path} before t = {t:.9g} s is not known to the tolerance with {MOST} points in a piece; the signal is too "
            "rough, or delay_time is too long: allow a larger rtol"
        )
    return 2 * count
