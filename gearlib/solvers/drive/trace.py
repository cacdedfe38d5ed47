"""`Trace`: states and their derivatives at the ends of all steps of a run, and the motion between them.

In each step the polynomial through values and slopes at the ends of up to five steps is taken:
of degree 11, as accurate as the steps of any method here, and without evaluating a right-hand side.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.native_module import native_functions
from gearlib.compiler.small_language import floats_at, int32, ints_at, native, record

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST = 100_000  # numbers in a trace (0.8 MB, so that results do not grow with the length of a run); a longer one is dropped
FIRST, GROWTH = 4096, 4  # numbers in the first piece; by how much each further one is longer
POINTS = 6  # ends of steps that a polynomial passes through, at most
QUARTERS = np.array([0.5, 0.25, 0.75])  # of a step: where samples help
CLOSE, FAR = 0.5, 20.0  # of the step's length: least distance of another end from the next, and largest one from the step

NODES = 12  # of a polynomial, at most: six ends in pairs
FEW = 7  # nodes


def width(n: int, n_discrete: int) -> int:
    """Numbers in a row, see ``drive_loop.trace``."""
    return 1 + 2 * n + n_discrete


@dataclass(frozen=True, eq=False)
class Trace:
    """Ends of steps; two with the same time where something may have changed in between.

    Attributes
    ----------
    pieces : sequence of array
        Rows as ``drive_loop.trace`` writes them.
    columns : array
        Indices of the states that were kept.
    origin : float
        s, from which the times in the rows count.
    """

    pieces: Sequence[Floats]
    columns: Integers
    origin: float

    @cached_property
    def _rows(self) -> Floats:
        return np.concatenate(self.pieces)

    @cached_property
    def times(self) -> Floats:
        """In s."""
        return self.origin + self._rows[:, 0]

    @cached_property
    def states(self) -> Floats:
        """Shape (ends, columns)."""
        return np.ascontiguousarray(self._rows[:, 1 : 1 + len(self.columns)])

    @cached_property
    def rates(self) -> Floats:
        """Shape (ends, columns)."""
        return np.ascontiguousarray(self._rows[:, 1 + len(self.columns) : 1 + 2 * len(self.columns)])

    @property
    def discrete(self) -> Floats:
        """The discrete state from there on."""
        return self._rows[:, 1 + 2 * len(self.columns) :]

    def at(self, times: Floats, steps: Integers, sample_times: Floats, samples: Floats) -> tuple[Floats, Floats]:
        """The traced states, and the same minus the estimated interpolation error; shapes (times, columns).

        ``steps``: the end where the step of each time begins, not decreasing. Samples help where there are few ends between two events.
        """
        which, first = np.unique(steps, return_index=True)
        n, s = len(self.columns), Between()
        ends, found = self._ends(which), np.empty((2, len(times), n))
        inner = np.where(ends[:, 3:4] < 0, self._inner(which, sample_times), -1)
        arrays = {
            "times": self.times, "states": self.states, "rates": self.rates, "sample_times": sample_times, "samples": samples,
            "ends": ends, "inner": inner, "first": np.append(first, len(times)),
            "wanted": times, "out": found[0], "coarse": found[1], "nodes": np.empty(NODES), "table": np.empty(NODES * n),
        }  # fmt: skip
        arrays = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        for name, array in arrays.items():
            setattr(s, name, array.ctypes.data)
        s.n_columns, s.n_steps, s.n_ends, s.n_inner = n, len(which), POINTS, len(QUARTERS)
        native_functions(__name__).loop("motion_between")(ctypes.addressof(s))
        return found[0], found[1]

    def _ends(self, steps: Integers) -> Integers:
        """Ends that the polynomials of some steps pass through, the step's own first, shape (steps, `POINTS`); -1: fewer.

        Within the same smooth motion, not so close together that rounding would dominate differences, and not far away.
        """
        t, (first, last) = self.times, self._phases
        h = t[steps + 1] - t[steps]
        before = np.searchsorted(t, t[steps] - CLOSE * h, side="right") - 1
        after = np.searchsorted(t, t[steps + 1] + CLOSE * h)
        earlier = np.searchsorted(t, t[np.maximum(before, 0)] - CLOSE * h, side="right") - 1
        later = np.searchsorted(t, t[np.minimum(after, len(t) - 1)] + CLOSE * h)
        others = np.stack([before, after, earlier, later], axis=1)
        near = (others >= first[steps][:, None]) & (others <= last[steps][:, None])
        distinct = [before < steps, after > steps + 1, earlier < before, later > after]  # where a step is not below rounding
        near &= np.stack(distinct, axis=1)
        near &= np.abs(t[np.clip(others, 0, len(t) - 1)] - t[steps][:, None]) <= FAR * h[:, None]
        chosen = np.where(near, others, -1)
        chosen = np.take_along_axis(chosen, np.argsort(~near, axis=1, kind="stable"), 1)
        return np.concatenate([steps[:, None], steps[:, None] + 1, chosen], axis=1)

    def _inner(self, steps: Integers, samples: Floats) -> Integers:
        """Samples within some steps, near their quarters; -1: fewer."""
        if not len(samples):
            return np.full((len(steps), len(QUARTERS)), -1)
        a, h = self.times[steps][:, None], np.diff(self.times)[steps][:, None]
        wanted = a + h * QUARTERS
        near = np.searchsorted(0.5 * (samples[1:] + samples[:-1]), wanted)
        apart = (np.abs(samples[near] - wanted) < 0.1 * h) & (samples[near] > a) & (samples[near] < a + h)
        return np.take_along_axis(np.where(apart, near, -1), np.argsort(~apart, axis=1, kind="stable"), 1)

    @cached_property
    def _phases(self) -> tuple[Integers, Integers]:
        """First and last end of the smooth motion that each end belongs to."""
        breaks = np.flatnonzero(np.diff(self.times) <= 0.0)
        first, last = np.concatenate([[0], breaks + 1]), np.concatenate([breaks, [len(self.times) - 1]])
        lengths = last - first + 1
        return np.repeat(first, lengths), np.repeat(last, lengths)


@record
class Between(ctypes.Structure):
    """What `motion_between` works on: addresses of arrays, and their sizes."""

    times: int
    states: int
    rates: int
    sample_times: int
    samples: int
    ends: int  # (steps, n_ends), -1: none
    inner: int  # samples, (steps, n_inner), -1: none
    first: int  # of the wanted times, that lies in each step
    wanted: int
    out: int
    coarse: int
    nodes: int
    table: int
    n_columns: int
    n_steps: int
    n_ends: int
    n_inner: int


@native
def gathered(s: Between, k: int) -> int:
    """Nodes and values of the polynomials of a step; returns how many."""
    n, count = s.n_columns, 0
    nodes, table, times, states = floats_at(s.nodes), floats_at(s.table), floats_at(s.times), floats_at(s.states)
    ends, inner = ints_at(s.ends + 8 * k * s.n_ends), ints_at(s.inner + 8 * k * s.n_inner)
    sample_times, samples = floats_at(s.sample_times), floats_at(s.samples)
    for i in range(s.n_ends):
        e = ends[i]
        if e >= 0:
            for _ in range(2):
                nodes[count] = times[e]
                for j in range(n):
                    table[count * n + j] = states[e * n + j]
                count += 1
    for i in range(s.n_inner):
        e = inner[i]
        if e >= 0:
            nodes[count] = sample_times[e]
            for j in range(n):
                table[count * n + j] = samples[e * n + j]
            count += 1
    return count


@native
def differences(s: Between, k: int, count: int) -> None:
    """Newton's coefficients in place of the values; slopes where two nodes are the same."""
    n = s.n_columns
    nodes, table, rates, ends = floats_at(s.nodes), floats_at(s.table), floats_at(s.rates), ints_at(s.ends + 8 * k * s.n_ends)
    for order in range(1, count):
        for back in range(count - order):
            i = count - 1 - back
            gap = nodes[i] - nodes[i - order]
            for j in range(n):
                if order == 1 and gap == 0.0:
                    table[i * n + j] = rates[ends[i // 2] * n + j]
                else:
                    table[i * n + j] = (table[i * n + j] - table[(i - 1) * n + j]) / gap


@native
def left_out(s: Between, j: int, count: int) -> float:
    """Share of the last two terms that the error is estimated to be.

    Newton's terms fall by about the same factor from one pair to the next: what follows the last pair is that much less again. With few
    nodes that is not relied on. The first term is the value itself.
    """
    nodes, table, n = floats_at(s.nodes), floats_at(s.table), s.n_columns
    middle, product, last, before = 0.5 * (nodes[0] + nodes[2]), 1.0, 0.0, 0.0
    for i in range(1, count):
        product *= abs(middle - nodes[i - 1])
        term = abs(table[i * n + j]) * product
        if i >= count - 2:
            last += term
        elif i >= count - 4:
            before += term
    share = last / before if last < before else 1.0
    return share if count > FEW else math.sqrt(share)


@native
def motion_between(address: int) -> int32:
    """The states between the ends of steps."""
    s = Between(address)
    n = s.n_columns
    nodes, table, first, wanted = floats_at(s.nodes), floats_at(s.table), ints_at(s.first), floats_at(s.wanted)
    out, coarse = floats_at(s.out), floats_at(s.coarse)
    for k in range(s.n_steps):
        count = gathered(s, k)
        differences(s, k, count)
        for j in range(n):
            share = left_out(s, j, count)
            for w in range(first[k], first[k + 1]):
                value, product, tail = table[j], 1.0, 0.0
                for i in range(1, count):
                    product *= wanted[w] - nodes[i - 1]
                    term = table[i * n + j] * product
                    value += term
                    if i >= count - 2:
                        tail += term
                out[w * n + j] = value
                coarse[w * n + j] = value - share * tail
    return 0
