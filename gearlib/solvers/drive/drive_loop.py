"""The main loop of all runs: steps, samples, events. Written in the small language, compiled once per machine.

It calls the functions of a stepper by their addresses, with the address of the run's record::

    int32 step(address, stop)               one step from t, by no means beyond ``stop``; says in ``reached`` how far, and in
                                            ``fired`` which event functions crossed zero there. STEPPED, FOUND, RETRY or a failure
    int32 interpolate(address, t, out)      the states at a time within that step
    int32 motion(address, t)                the same into ``within``, and their derivatives into ``rates_within``, if there are ``parts``
    int32 accept(address)                   ``x`` becomes the states at ``reached``
    int32 restart(address, changed, why)    begin anew at ``x``. ``changed`` is what the event iteration did; ``why`` is ROOT, TIMED
                                            or START. How many event functions crossed zero by it (``fired`` says which), or a failure

The loop keeps its state in the record and returns after a given number of steps, so that Python can handle interrupts, grow the event
log and call again.
"""

from __future__ import annotations

import math

from gearlib.compiler.small_language import Prototype, floats_at, int32, int32s_at, ints_at, native
from gearlib.native.layout import MODEL
from gearlib.solvers.drive.drive_record import DriveRecord

STEPPED, FOUND, RETRY = 0, 1, 2  # results of a step
ROOT, TIMED, START = 0, 1, 2  # reasons for a restart
DONE, MORE, LOG_FULL, STIFF = 0, 1, 2, 3  # results of ``advance``, besides failure codes:
RHS_FAILED, UPDATE_FAILED, UNSETTLED, CHATTER, STEP_LIMIT, ROOTS_FAILED = -101, -102, -103, -104, -105, -106
EVALUATED = {RHS_FAILED: "the right-hand side", ROOTS_FAILED: "the event functions"}

STEP = Prototype("int32", ("int", "float"))
INTERPOLATE = Prototype("int32", ("int", "float", "int"))
MOTION = Prototype("int32", ("int", "float"))
ACCEPT = Prototype("int32", ("int",))
RESTART = Prototype("int32", ("int", "int", "int"))

BURST = 1000  # number of instants with events within ``window`` that means a chattering model rather than a rattling gear
ROUNDING = 8.9e-16  # relative to time: four spacings of doubles (4 * 2.2e-16)
SMALLEST = 1e-300  # s, before a stop at zero
MARGIN = 8  # rows that a step may add to the trace
PASSES = 100  # of event iteration and restart at one instant


@native
def look_between_stops(s: DriveRecord, last: bool) -> None:
    """Inputs are looked up between the last stop and the next one: a step up to a jump does not see what follows it."""
    if s.interval != 0:
        interval, stops = floats_at(s.interval), floats_at(s.stops)
        interval[0], interval[1] = -math.inf, math.inf
        if s.stop > 0:
            before = s.origin + stops[s.stop - 1]
            interval[0] = before + ROUNDING * abs(before)
        if not last and stops[s.stop] > s.t:  # not in a run without length
            after = s.origin + stops[s.stop]
            interval[1] = max(after - ROUNDING * abs(after) - SMALLEST, interval[0])  # two stops may differ by rounding


@native
def store(s: DriveRecord, t: float, interpolated: bool) -> int:
    """Record the next sample: states and discrete state."""
    i = s.sample
    target = s.out + 8 * i * s.n
    if interpolated:
        code = INTERPOLATE(s.interpolate, s.address, t, target)
        if code < 0:
            return code
    else:
        x, out = floats_at(s.x), floats_at(target)
        for j in range(s.n):
            out[j] = x[j]
    held, discrete = floats_at(s.data + 8 * s.first_discrete), floats_at(s.discrete + 8 * i * s.n_discrete)
    for j in range(s.n_discrete):
        discrete[j] = held[j]
    s.sample = i + 1
    return 0


@native
def add_row(s: DriveRecord, t: float, x_at: int, rates_at: int) -> None:
    """Add a row to the trace: time, some states, their derivatives, and the discrete state. Two rows of one time: an event."""
    n, n_discrete = s.n_traced, s.n_discrete
    row, traced = floats_at(s.trace + 8 * s.trace_rows * (1 + 2 * n + n_discrete)), ints_at(s.traced)
    x, rates, discrete = floats_at(x_at), floats_at(rates_at), floats_at(s.data + 8 * s.first_discrete)
    row[0] = t
    for j in range(n):
        row[1 + j] = x[traced[j]]
        row[1 + n + j] = rates[traced[j]]
    for j in range(n_discrete):
        row[1 + 2 * n + j] = discrete[j]
    s.trace_rows += 1


@native
def trace(s: DriveRecord) -> None:
    """Add a row for the current time to the trace."""
    add_row(s, s.t, s.x, s.rates)


@native
def trace_within(s: DriveRecord) -> None:
    """Rows within a step that ends at ``reached``, where the method takes steps too long for the polynomials between two rows."""
    h = (s.reached - s.t) / s.parts
    if h > 100.0 * ROUNDING * abs(s.reached):
        for i in range(1, s.parts):
            MOTION(s.motion, s.address, s.t + i * h)
            add_row(s, s.t + i * h, s.within, s.rates_within)


@native
def log(s: DriveRecord, root: int) -> None:
    floats_at(s.log_t)[s.events] = s.t
    ints_at(s.log_root)[s.events] = root
    s.events += 1


@native
def settle(s: DriveRecord, why: int) -> int:
    """Alternate event iteration and restart until no event function crosses zero; returns what changed, or a failure."""
    changed = 0
    for _ in range(PASSES):
        did = 0
        if s.update != 0:
            did = MODEL(s.update, s.origin + s.t, s.x, s.fired, s.data, s.index)
            if did < 0:
                return UPDATE_FAILED
        if did > changed:
            changed = did
        crossed = RESTART(s.restart, s.address, did, why)
        if crossed < 0:
            return crossed
        if crossed == 0:
            return changed
        why = ROOT
    return UNSETTLED


@native
def on_event(s: DriveRecord, timed: bool) -> float:
    """Time from which on a sample counts as on an event at ``t``; where its time is known, up to the rounding of absolute time."""
    late = ROUNDING * abs(s.origin + s.reached) if timed else 0.0
    return s.reached - max(s.slack, s.slack_share * abs(s.reached), late)


@native
def handle(s: DriveRecord, found: bool, timed: bool) -> int:
    """Log the events at ``t``, and restart there."""
    if s.t - s.burst_start > s.window:
        s.burst_start, s.burst = s.t, 0
    s.burst += 1
    before = s.events
    fired = int32s_at(s.fired)
    if timed:
        log(s, -1)
    logged = s.events
    for k in range(s.n_roots):  # before the update, which may overwrite what fired
        if not found:
            fired[k] = 0
        elif fired[k] != 0:
            log(s, k)
    if s.burst > BURST:
        return CHATTER
    changed = settle(s, TIMED if timed else ROOT)
    if changed < 0:
        return changed
    if changed == 0 and s.from_zero != 0:
        s.events = logged
    s.from_zero = 0
    if s.events > before:
        times, on = floats_at(s.times), on_event(s, timed)
        while s.sample > 0 and times[s.sample - 1] >= on:  # a sample on an event holds the right-hand limit
            s.sample -= 1
    return 0


@native
def one_step(s: DriveRecord) -> int:
    """One step, with its samples and the events at its end."""
    stop = floats_at(s.stops)[s.stop]
    s.steps += 1
    code = STEP(s.step, s.address, stop)
    if code < 0:
        return code
    if code == RETRY:
        return 0
    times, found, reached = floats_at(s.times), code == FOUND, s.reached >= stop
    timed = reached and s.stop < s.n_timed
    before = on_event(s, timed) if found or timed else s.reached - ROUNDING * abs(s.reached)
    while s.sample < s.n_times and times[s.sample] < before:
        code = store(s, times[s.sample], True)
        if code < 0:
            return code
    if s.trace != 0 and s.parts > 1:
        trace_within(s)
    s.t = s.reached
    code = ACCEPT(s.accept, s.address)
    if code < 0:
        return code
    if s.trace != 0:
        if found:  # within a step, whose end the stepper's derivatives belong to
            MODEL(s.rhs, s.origin + s.t, s.x, s.rates, s.data, s.index)
        trace(s)
    if reached:
        last = s.stop == s.n_stops - 1
        if not last:
            s.stop += 1
        look_between_stops(s, last)
    if not (found or timed):
        return 0
    code = handle(s, found, timed)
    if code >= 0 and s.trace != 0:
        trace(s)
    return code


@native
def advance(address: int) -> int32:
    """Integrate for ``budget`` steps, or until Python must intervene."""
    s = DriveRecord(address)
    times, end = floats_at(s.times), floats_at(s.stops)[s.n_stops - 1]
    look_between_stops(s, False)
    if s.started == 0:
        s.started = 1
        code = settle(s, START)
        if code < 0:
            return code
        if s.trace != 0:
            trace(s)
    for _ in range(s.budget):
        while s.sample < s.n_times and times[s.sample] <= s.t:
            store(s, s.t, False)
        if s.t >= end:
            return DONE
        if s.capacity - s.events < s.n_roots + 2 or (s.trace != 0 and s.trace_capacity - s.trace_rows < MARGIN):
            return LOG_FULL
        code = one_step(s)
        if code < 0:
            return code
        if s.pause != 0:
            code, s.pause = s.pause, 0
            return code
    return MORE
