"""State record of a run, shared by the driver's compiled loop and its stepper.

A stepper that needs more fields declares a record that extends this one: one address serves both.
"""

from __future__ import annotations

import ctypes

from gearlib.compiler.small_language import record

__all__ = ["DriveRecord"]


@record
class DriveRecord(ctypes.Structure):
    """State of a run; all fields are initially zero."""

    address: int  # of the record itself
    # addresses of the stepper's functions, see ``drive_loop``
    step: int
    interpolate: int
    accept: int
    restart: int
    motion: int
    # addresses of the model's functions (0: none) and of its numbers
    rhs: int
    roots: int
    update: int
    data: int
    index: int
    interval: int  # two times, s, between which the inputs are looked up; 0: there are none that jump
    # addresses: states at ``t`` in the model's order, and directions of the zero crossings of event functions
    x: int
    fired: int
    # addresses of output times, stop times, samples and event log
    times: int
    stops: int
    out: int
    discrete: int
    log_t: int
    log_root: int
    rates: int  # x' at ``t``, in the model's order; 0: the stepper does not tell
    trace: int  # rows of the steps' ends, see ``drive_loop.trace``; 0: not kept
    traced: int  # indices of the states in them
    within: int  # states within a step, and their derivatives
    rates_within: int
    # integers
    n: int  # states
    n_roots: int
    n_times: int
    n_stops: int
    n_timed: int  # the first stops are time events; the last one may be the end of the run
    n_discrete: int
    first_discrete: int
    capacity: int  # of the event log
    n_traced: int
    parts: int  # of the last step, each of which ends with a row; at most ``drive_loop.MARGIN - 1``
    trace_rows: int
    trace_capacity: int
    budget: int  # steps to take before returning
    started: int
    sample: int
    stop: int
    steps: int  # attempted steps
    events: int
    from_zero: int  # whether the event function that fired merely leaves zero: logged only if that changes something
    pause: int  # status that the stepper requests the loop to return after the step
    burst: int  # instants with events since ``burst_start``
    # floating-point numbers
    origin: float  # s; all other times count from here, so that a late start costs no digits
    t: float
    reached: float  # end of the step
    slack: float  # s; samples at most that long before an event, or at most
    slack_share: float  # this fraction of time before it, count as on the event: they hold the right-hand limit
    window: float  # s; interval in which too many instants with events count as chattering
    burst_start: float
