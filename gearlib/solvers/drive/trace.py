"""`Trace`: states and their derivatives at the ends of all steps of a run, and the motion between them.

Between two events the motion is smooth. In each step the polynomial through values and slopes at the ends of up to five steps is taken:
of degree 11, as accurate as the steps of any method here, and without evaluating a right-hand side.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.native_module import native_functions
from gearlib.solvers.drive import between_ends
from gearlib.solvers.drive.between_ends import NODES, Between

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST = 2_000_000  # numbers in a trace (16 MB); a longer one is dropped
FIRST, GROWTH = 4096, 4  # numbers in the first piece; by how much each further one is longer
POINTS = 6  # ends of steps that a polynomial passes through, at most
QUARTERS = np.array([0.5, 0.25, 0.75])  # of a step: where samples help
CLOSE, FAR = 0.5, 20.0  # of the step's length: least distance of another end from the next, and largest one from the step


def width(n: int, n_modes: int) -> int:
    """Numbers in a row, see ``drive_loop.trace``."""
    return 1 + 2 * n + n_modes


@dataclass(frozen=True, eq=False)
class Trace:
    """Ends of steps; two with the same time where something may have changed in between.

    Attributes
    ----------
    pieces : sequence of array, shape (ends, 1 + 2 columns + modes)
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
        """Shape (ends,), s."""
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
    def modes(self) -> Floats:
        """The discrete state from there on, shape (ends, modes)."""
        return self._rows[:, 1 + 2 * len(self.columns) :]

    def at(self, times: Floats, steps: Integers, sample_times: Floats, samples: Floats) -> tuple[Floats, Floats]:
        """The states that were kept, between the ends of steps.

        Parameters
        ----------
        times : array, shape (times,)
            s.
        steps : array, shape (times,)
            The step in which each time lies: the index of the end where it begins; not decreasing.
        sample_times, samples : arrays, shapes (samples,), (samples, columns)
            Samples of the same states, used in steps that contain some where there are few ends between two events.

        Returns
        -------
        arrays, shape (times, columns)
            The states, and the same less the estimated error of the polynomials.
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
        native_functions(between_ends.__name__).loop("motion_between")(ctypes.addressof(s))
        return found[0], found[1]

    def _ends(self, steps: Integers) -> Integers:
        """Ends that the polynomials of some steps pass through, the step's own first, shape (steps, `POINTS`); -1: fewer.

        Others are within the same smooth motion, and neither so close to the last one that differences would be dominated by rounding
        and by the tolerance, nor far away.
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
        chosen = np.take_along_axis(chosen, np.argsort(~near, axis=1, kind="stable"), 1)[:, : POINTS - 2]
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
