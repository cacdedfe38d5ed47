"""State record of runs in lanes, filled in by Python."""

from __future__ import annotations

import ctypes

from gearlib.compiler.small_language import Prototype, record

__all__ = ["LANE_MODEL", "LaneRecord"]

# The right-hand side of `LANES` runs: ``int32 f(lanes *time, lanes *x, lanes *dx, lanes *data)``
LANE_MODEL = Prototype("int32", ("int", "int", "int", "int"))


@record
class LaneRecord(ctypes.Structure):
    """State of some runs; every field is zero at first."""

    rhs: int
    # addresses of data common to all runs: output times, indices of the states to store, absolute tolerances
    times: int
    columns: int
    atol: int
    # addresses of the corners of the inputs, at which steps end, and of the input values that change there: one row per run or, if
    # ``cornered`` is zero, one row for all runs
    corners: int
    pieces: int
    # addresses of data with one row per run: longest step, start values, parameters of the right-hand side, samples, status, steps
    # tried, rejected
    longest: int
    starts: int
    numbers: int
    out: int
    status: int
    tried: int
    rejected: int
    # addresses of vectors of lanes: states, stages (7 rows), argument of a stage, states at the end of the step, parameters, samples
    x: int
    k: int
    y: int
    x_new: int
    data: int
    kept: int
    # addresses of one number per lane
    t: int
    now: int  # the time at which the right-hand side is evaluated
    h: int
    sample_t: int  # time of the next sample, infinite if there is none
    stop: int  # the next corner, or the end
    before: int  # sixteenth root of the error of the step before
    h_max: int  # longest step
    retry: int  # 1 after a step that was rejected
    active: int  # 1 while a run is integrated
    ended: int  # 1 for a run that has just been completed, -1 for one that has just failed
    steps: int
    failures: int
    # addresses of one integer per lane: index of the run, of its next sample and corner; whether it has just been loaded
    run: int
    sample: int
    corner: int
    fresh: int
    n: int  # states
    n_numbers: int
    n_times: int
    n_columns: int
    n_corners: int  # of a run
    n_pieces: int  # parameters that change at corners: the first ones of ``data``
    cornered: int
    n_runs: int
    next: int  # index of the run that is loaded next
    running: int  # lanes that are active
    done: int  # completed or failed runs
    budget: int  # steps to take before returning
    evaluations: int  # of all lanes
    rtol: float
    origin: float  # s; all other times count from here
    end: float
    most_steps: float  # limit for a run, which fails beyond it
