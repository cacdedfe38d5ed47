"""State record of a run, shared by the driver's compiled loop and the stepper that it calls.

A stepper that needs more fields declares a record that begins with these: one address serves both.
"""

from __future__ import annotations

import ctypes

from gearlib.compiler.small_language import record

__all__ = ["DriveRecord"]


@record
class DriveRecord(ctypes.Structure):
    """State of a run; every field is zero at first."""

    address: int  # of the record itself
    # addresses of the stepper's functions, see ``drive_loop``
    step: int
    interpolate: int
    accept: int
    restart: int
    # addresses of the model's functions (0: none) and of its numbers
    rhs: int
    roots: int
    update: int
    data: int
    index: int
    # addresses: states at ``t`` in the model's order, and the directions in which event functions crossed zero
    x: int
    fired: int
    # addresses of output times, of times to stop at, of the samples and of the event log
    times: int
    stops: int
    out: int
    modes: int
    log_t: int
    log_root: int
    # whole numbers
    n: int  # states
    n_roots: int
    n_times: int
    n_stops: int
    n_timed: int  # the first stops are time events, a last one may be an end
    n_modes: int
    first_mode: int
    capacity: int  # of the event log
    budget: int  # steps to take before returning
    started: int
    sample: int
    stop: int
    steps: int  # steps tried
    events: int
    from_zero: int  # whether what fired merely leaves zero: not worth an entry unless it changes something
    pause: int  # what the stepper has the loop return after the step
    burst: int  # instants with events since ``burst_start``
    # reals
    origin: float  # s; all other times count from here, so that a late start takes no digits from them
    t: float
    reached: float  # the end of the step
    slack: float  # s; samples no further before an event than that, or than
    slack_share: float  # this part of the time, are on the event: they hold the right-hand limit
    window: float  # s, in which so many instants with events are chattering
    burst_start: float
