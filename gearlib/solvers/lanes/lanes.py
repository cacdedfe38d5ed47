"""`LaneProblem` and `LaneRuns`: integration of many runs of one scene in vector lanes, from numbers and a native function."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.instructions import LANES
from gearlib.compiler.native_module import native_functions
from gearlib.solvers.lanes import lane_loop
from gearlib.solvers.lanes.lane_record import LaneRecord
from gearlib.solvers.problem import Floats, Integers, Native, late_start

__all__ = ["LaneProblem", "LaneRuns"]

STEPS_PER_CALL = 1000  # of all lanes; Python handles interrupts in between
CACHE_LINE = 8  # numbers (64 bytes): an aligned vector of lanes lies in one cache line
_SINGLE = ("t", "now", "h", "sample_t", "stop", "before", "h_max", "retry", "active", "ended", "steps", "failures")
_WHOLE = ("run", "sample", "corner", "fresh")


@dataclass(frozen=True, eq=False)
class LaneProblem:
    """Runs of a scene as arrays.

    Attributes
    ----------
    rhs : Native
        A right-hand side for lanes: ``int32 f(lanes *time, lanes *x, lanes *dx, lanes *data)``.
    starts : array, shape (runs, states)
    numbers : array, shape (runs, numbers)
        Contents of ``data``, from which the right-hand side reads parameters and inputs.
    times : array
        Sample times, s; the first is the start.
    columns : array of int
        Indices of the states to store.
    atol : array, shape (states,)
    rtol : float
    longest_step : float or array, shape (runs,)
        s.
    corners : array, shape (runs or 1, corners)
        Ascending times of the corners of inputs, s, for each run or for all of them; rows are padded with infinity.
    pieces : array, shape (runs or 1, corners + 1, changing)
        The leading numbers of ``data`` up to each corner, and after the last one.
    most_steps : float
        Limit for a run, which fails beyond it.
    """

    rhs: Native
    starts: Floats
    numbers: Floats
    times: Floats
    columns: Integers
    atol: Floats
    rtol: float
    longest_step: float | Floats = float("inf")
    corners: Floats = field(default_factory=lambda: np.empty((1, 0)))
    pieces: Floats = field(default_factory=lambda: np.empty((1, 1, 0)))
    most_steps: float = float("inf")


class LaneRuns:
    """Integration in progress.

    Attributes
    ----------
    out : array, shape (runs, samples, columns)
    status : array of int, shape (runs,)
        1 for a completed run, -1 for a failed one, 0 for one in progress or not begun.
    steps, rejected : arrays of int, shape (runs,)
    """

    def __init__(self, problem: LaneProblem) -> None:
        runs, n = problem.starts.shape
        m, times, columns = problem.numbers.shape[1], problem.times, problem.columns
        self.record = record = LaneRecord()
        self.out = np.empty((runs, len(times), len(columns)))
        self.status, self.steps, self.rejected = (np.zeros(runs, np.int64) for _ in range(3))
        origin, span = late_start(float(times[0]), float(times[-1])), float(times[-1] - times[0])
        given: dict[str, NDArray[Any]] = {
            "times": times - origin, "columns": columns, "atol": problem.atol, "starts": problem.starts, "numbers": problem.numbers,
            "corners": problem.corners - origin, "pieces": problem.pieces,
            "longest": np.minimum(0.1 * span, np.broadcast_to(problem.longest_step, runs)),
        }  # fmt: skip
        self._arrays = {name: np.ascontiguousarray(array) for name, array in given.items()}
        self._arrays |= {"out": self.out, "status": self.status, "tried": self.steps, "rejected": self.rejected}
        vectors = {"x": n, "k": 7 * n, "y": n, "x_new": n, "data": m, "kept": len(columns)}
        vectors |= dict.fromkeys((*_SINGLE, *_WHOLE), 1)
        whole = np.zeros(LANES * sum(vectors.values()) + CACHE_LINE)
        place = -whole.ctypes.data // 8 % CACHE_LINE
        for name, size in vectors.items():
            self._arrays[name] = whole[place : place + LANES * size]
            place += LANES * size
        for name, array in self._arrays.items():
            setattr(record, name, array.ctypes.data)
        if runs:  # a lane without a run computes the first one, and its results are ignored
            self._arrays["x"].reshape(n, LANES)[:] = problem.starts[0][:, None]
            self._arrays["data"].reshape(m, LANES)[:] = problem.numbers[0][:, None]
        record.rhs, record.n, record.n_numbers = problem.rhs.address, n, m
        record.n_times, record.n_columns = len(times), len(columns)
        record.n_corners, record.n_pieces = problem.corners.shape[1], problem.pieces.shape[2]
        record.cornered, record.most_steps = int(len(problem.pieces) > 1), problem.most_steps
        record.n_runs, record.rtol, record.origin, record.end = runs, problem.rtol, origin, float(times[-1]) - origin

    @property
    def done(self) -> int:
        """Number of completed or failed runs."""
        return self.record.done

    def advance(self, steps: int = STEPS_PER_CALL) -> bool:
        """Advance by a number of steps at most; returns whether any run remains."""
        self.record.budget = steps
        if self.record.n_runs == self.record.done:
            return False
        return bool(native_functions(lane_loop.__name__).loop("advance_lanes")(ctypes.addressof(self.record)))
