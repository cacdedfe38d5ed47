"""State record of the Runge-Kutta loop, filled in by Python.

Passing an array to compiled code takes a microsecond, and a run of a small model takes fifty: the loop gets one address instead.
"""

from __future__ import annotations

import ctypes

from gearlib.compiler.small_language import record

__all__ = ["LoopRecord"]


@record
class LoopRecord(ctypes.Structure):
    """State of the loop; every field is zero at first."""

    # addresses of the model's functions (0: none) and of its numbers
    rhs: int
    roots: int
    update: int
    data: int
    index: int
    # addresses of states; rows: stages, coefficients of the dense output
    x: int
    x_new: int
    y: int
    atol: int
    k: int
    c: int
    # addresses of what event functions need, see ``root_finding``
    phases: int
    g: int
    side: int
    fired: int
    # addresses of output times, of times to stop at, of the samples and of the event log
    times: int
    stops: int
    out: int
    modes: int
    log_t: int
    log_root: int
    order: int
    n: int  # states
    size: int  # the same in whole blocks
    n_roots: int
    n_times: int
    n_stops: int
    n_timed: int  # the first stops are time events, a last one may be an end
    n_modes: int
    first_mode: int
    capacity: int  # of the event log
    budget: int  # steps to take before returning
    detect: int  # whether to look for stiffness, and
    detect_from: int  # after so many steps
    stiff_first: int  # the step with which the present stiffness began, the number of events and (`stiff_t`) the time there
    stiff_events: int
    started: int
    sample: int
    stop: int
    steps: int
    rejected: int
    evaluations: int
    events: int
    stiff_steps: int
    calm_steps: int
    retry: int
    patience: int
    dense: int  # whether ``c`` is that of the step
    fresh: int  # no step accepted since the last restart
    known: int  # see ``step_size``
    next_phase: int
    rtol: float
    span: float
    h_max: float
    origin: float  # s; all other times count from here, so that a late start takes no digits from them
    t: float
    h: float
    h_before_event: float
    h_cut: float
    log_error: float
    # of the step, and the largest of the last ones: see ``stages.step_error``
    ratio: float
    ratios: float
    rough: float
    roughest: float
    # what the last two stages of the step say, and their means: see ``first_step.note``
    slope: float
    move: float
    product: float
    slopes: float
    moves: float
    products: float
    stiff_t: float
