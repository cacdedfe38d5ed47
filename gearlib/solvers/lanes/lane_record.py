"""State record of runs in lanes, filled in by Python."""

from __future__ import annotations

import ctypes

from gearlib.compiler.small_language import record
from gearlib.compiler.translate import Prototype

__all__ = ["LANE_MODEL", "LaneRecord"]

# The right-hand side of `LANES` runs: ``int32 f(lanes *time, lanes *x, lanes *dx, lanes *data)``
LANE_MODEL = Prototype("int32", ("int", "int", "int", "int"))


@record
class LaneRecord(ctypes.Structure):
    """State of some runs; every field is zero at first."""

    rhs: int
    # addresses of what all runs have: output times, states that are kept, absolute tolerances
    times: int
    columns: int
    atol: int
    # addresses of the corners of its inputs, which steps end at, and the numbers of the right-hand side that change there; of each run,
    # or where ``cornered`` is zero, of all runs
    corners: int
    pieces: int
    # addresses of what each run has, row by row: start, numbers of the right-hand side, samples, how it ended, steps tried, rejected
    starts: int
    numbers: int
    out: int
    status: int
    tried: int
    rejected: int
    # addresses of vectors of lanes: states, stages (7 rows), the argument of a stage, the end of a step, numbers, samples
    x: int
    k: int
    y: int
    x_new: int
    data: int
    kept: int
    # addresses of single lanes: times, sizes of steps, ...
    t: int
    now: int  # the time at which the right-hand side is evaluated
    h: int
    sample_t: int  # of the next sample, infinite where there is none
    stop: int  # the next corner, or the end
    before: int  # sixteenth root of the error of the step before
    retry: int  # 1 after a step that was rejected
    active: int  # 1 where a run is on its way
    ended: int  # 1 or -1 where it has just come to its end, or failed
    steps: int
    failures: int
    # whole numbers, a lane each: which run, its next sample and corner, whether it has just been filled
    run: int
    sample: int
    corner: int
    fresh: int
    n: int  # states
    n_numbers: int
    n_times: int
    n_columns: int
    n_corners: int  # of a run
    n_pieces: int  # numbers that change at corners: the first ones of ``data``
    cornered: int
    n_runs: int
    next: int  # the run that the next free lane takes
    running: int  # lanes that are active
    done: int  # runs that are
    budget: int  # steps to take before returning
    evaluations: int  # of all lanes
    rtol: float
    origin: float  # s; all other times count from here
    end: float
    h_max: float
    most_steps: float  # of a run, which fails beyond
