"""The integration loop of the explicit Runge-Kutta methods: one compiled function for all models.

It is written in the small language, and compiled once per machine (`MODULES`). The loop keeps its state in a record and returns
after a given number of steps, so that Python can look after interrupts, grow the event log and call again.
"""

from __future__ import annotations

import math

from gearlib.compiler.small_language import floats_at, int32, int32s_at, ints_at, native
from gearlib.solvers.problem import MODEL
from gearlib.solvers.rungekutta.first_step import first_step, is_stiff, note, sign
from gearlib.solvers.rungekutta.record import LoopRecord
from gearlib.solvers.rungekutta.root_finding import NEW, OLD, SLOPE_NEW, SLOPE_OLD, crossing, just_beyond, row, slopes
from gearlib.solvers.rungekutta.stages import dense_output, interpolate, last_stage, move, step_error, take_step
from gearlib.solvers.rungekutta.step_size import adapt, begin_phase

__all__ = ["MODULES", "advance"]

MODULES = tuple(  # compiled together
    f"gearlib.solvers.rungekutta.{name}" for name in ("loop", "root_finding", "step_size", "stages", "first_step")
)

# what ``advance`` returns
DONE, MORE, STIFF, RHS_FAILED, UNDERFLOW, CHATTERING, UPDATE_FAILED = 0, 1, 2, -1, -2, -3, -4

CHATTER_EVENTS = 1000  # that many events within CHATTER_SPAN of the time span are a chattering model, not a rattling gear
CHATTER_SPAN = 1e-10
SURE, CALM = 15, 6
ROUNDING = 8.9e-16
LOCATED = 2.2e-14  # samples no further before an event are on the event: they hold the right-hand limit
AT_START = 1e-16  # of the run: as near to the start as that, an event is at the start


@native
def _restart(s: LoopRecord) -> int:
    """Begin anew at ``x``: the right-hand side, the sides of the event functions and their slopes."""
    code: int = MODEL(s.rhs, s.origin + s.t, s.x, s.k, s.data, s.index)
    s.evaluations += 1
    s.slopes = s.moves = s.products = s.ratios = s.roughest = 0.0
    if s.n_roots > 0 and code == 0:
        MODEL(s.roots, s.origin + s.t, s.x, row(s, OLD), s.data, s.index)
        slopes(s, s.t, max(s.h, 1e-6 * s.h_max), s.x, s.k, OLD, SLOPE_OLD)
        side, fired, g = int32s_at(s.side), int32s_at(s.fired), floats_at(row(s, OLD))
        for i in range(s.n_roots):  # what the event iteration says, which rounding cannot make wrong
            side[i] = fired[i] // 2 if abs(fired[i]) == 2 else sign(g[i])
    return code


@native
def _start(s: LoopRecord) -> int:
    s.started = 1
    if s.update != 0 and MODEL(s.update, s.origin + s.t, s.x, s.fired, s.data, s.index) < 0:
        return UPDATE_FAILED
    if _restart(s) != 0:
        return RHS_FAILED
    if s.h == 0.0:
        s.h = first_step(s)
    s.h_before_event, s.fresh = s.h_max, 1
    return DONE


@native
def _store(s: LoopRecord, i: int, x: int) -> None:
    """A sample: states and modes."""
    state, out = floats_at(x), floats_at(s.out + 8 * i * s.n)
    for j in range(s.n):
        out[j] = state[j]
    held, modes = floats_at(s.data + 8 * s.first_mode), floats_at(s.modes + 8 * i * s.n_modes)
    for j in range(s.n_modes):
        modes[j] = held[j]


@native
def _emit(s: LoopRecord, t: float, before: float, h: float) -> None:
    """Store the samples before a time within the step."""
    times, i = floats_at(s.times), s.sample
    if i < s.n_times and times[i] < before:
        dense_output(s, t, h)
        while i < s.n_times and times[i] < before:
            interpolate(s, (times[i] - t) / h, h, s.y)
            _store(s, i, s.y)
            i += 1
        s.sample = i


@native
def _emit_here(s: LoopRecord) -> None:
    """Store the samples at ``t`` itself."""
    times, i = floats_at(s.times), s.sample
    while i < s.n_times and times[i] <= s.t:
        _store(s, i, s.x)
        i += 1
    s.sample = i


@native
def _log(s: LoopRecord, root: int) -> None:
    floats_at(s.log_t)[s.events] = s.t
    ints_at(s.log_root)[s.events] = root
    s.events += 1


@native
def _handle(s: LoopRecord, found: int, timed: bool) -> int:
    """Call ``update`` for the roots that flipped (``found``) or a time event, write the log, begin anew."""
    side, fired, g = int32s_at(s.side), int32s_at(s.fired), floats_at(row(s, NEW))
    from_zero = True
    for i in range(s.n_roots):
        fired[i] = 0
        if found == 1 and (g[i] * side[i] < 0.0 or (side[i] == 0 and g[i] != 0.0)):
            fired[i] = sign(g[i])
            from_zero = from_zero and side[i] == 0
    before = s.events
    if timed:
        _log(s, -1)
    logged = s.events
    for i in range(s.n_roots):  # before the update, which may forget what fired
        if fired[i] != 0:
            _log(s, i)
    changed = 0
    if s.update != 0:
        changed = MODEL(s.update, s.origin + s.t, s.x, s.fired, s.data, s.index)
        if changed < 0:
            return UPDATE_FAILED
    if changed == 0 and from_zero:  # a function that merely starts from zero is not worth an entry
        s.events = logged
    times = floats_at(s.times)
    while s.events > before and s.sample > 0 and times[s.sample - 1] >= s.t - max(LOCATED * abs(s.t), AT_START * s.span):
        s.sample -= 1  # a sample on an event holds the right-hand limit
    if changed != 0 or timed:  # or else the solution goes on as before
        begin_phase(s, changed != 0)
    if _restart(s) != 0:
        return RHS_FAILED
    recent = s.events - CHATTER_EVENTS
    if recent >= 0 and s.t - floats_at(s.log_t)[recent] < CHATTER_SPAN * s.span:
        return CHATTERING
    return DONE


@native
def _is_stiff(s: LoopRecord, t: float) -> bool:
    """Count steps that look stiff, as Hairer's codes do: `SURE` of them, without `CALM` others in a row."""
    note(s)
    if is_stiff(s):
        if s.stiff_steps == 0:
            s.stiff_t, s.stiff_first, s.stiff_events = t, s.steps, s.events
        s.stiff_steps += 1
        s.calm_steps = 0
        return s.stiff_steps >= SURE and s.steps >= s.detect_from
    s.calm_steps += 1
    if s.calm_steps >= CALM:
        s.stiff_steps = 0
    return False


@native
def _attempt(s: LoopRecord, t: float, h: float) -> float:
    """Try a step; its error over the tolerance, infinite where it cannot be evaluated, -1 where the model stops the run."""
    s.steps += 1
    code = take_step(s, t, h)
    if code < 0:
        return -1.0
    if code > 0:
        s.patience -= 1
        return math.inf
    error = step_error(s, h)
    return error if error < math.inf else math.inf


@native
def _go_on(s: LoopRecord) -> None:
    """Make the end of a step the start of the next one."""
    move(s.x_new, s.x, s.size)
    move(last_stage(s), s.k, s.size)
    old, new = floats_at(row(s, OLD)), floats_at(row(s, NEW))
    slope_old, slope_new = floats_at(row(s, SLOPE_OLD)), floats_at(row(s, SLOPE_NEW))
    for i in range(s.n_roots):
        old[i] = new[i]
        slope_old[i] = slope_new[i]


@native
def _step(s: LoopRecord, stop: float, end: float) -> int:
    """One step toward ``stop``, up to an event in it; DONE where it went well or is to be tried again."""
    t, h = s.t, min(s.h, s.h_max)
    if s.h_cut > 0.0:
        h, s.h_cut = min(h, s.h_cut), 0.0
    if h < 10.0 * ROUNDING * abs(t) + 1e-25 * s.span:
        return UNDERFLOW
    last_of_span = t + 1.0001 * h >= stop
    if last_of_span:
        h = stop - t
    elif s.n_roots > 0:  # what is added to the time in truth: thousands of events would feel a clock that rounds at every step
        added = (t + h) - t
        if h == s.h:
            s.h = added
        h = added
    error = _attempt(s, t, h)
    if error < 0.0:
        return RHS_FAILED
    if s.patience == 0:
        return UNDERFLOW
    if not adapt(s, h, error):
        return DONE
    stiff = s.detect != 0 and _is_stiff(s, t + h)
    found, theta = 0, 1.0
    if s.n_roots > 0:
        found, theta = crossing(s, t, h, error)
        if found < 0:
            s.h_cut = (1.0 + 1e-4) * theta * h
            s.rejected += 1
            return DONE
    t_new = stop if last_of_span and found == 0 else t + theta * h
    reached = t_new >= stop - ROUNDING * abs(stop)
    timed = reached and s.stop < s.n_timed
    if (
        found == 0
        and reached
        and s.n_roots > 0
        and stop == end
        and just_beyond(s, stop, LOCATED * max(abs(s.origin + stop), s.span))
    ):
        found = 1
    _emit(s, t, t_new - (LOCATED if found == 1 or timed else ROUNDING) * abs(t_new), h)
    s.t = stop if reached else t_new
    _go_on(s)
    if found == 1 or timed:
        code = _handle(s, found, timed)
        if code != DONE:
            return code
    if reached and s.stop < s.n_stops - 1:
        s.stop += 1
    return STIFF if stiff else DONE


@native
def advance(address: int) -> int32:
    """Integrate for ``budget`` steps, or until something happens that Python must see to."""
    s = LoopRecord(address)
    if s.started == 0:
        code = _start(s)
        if code != DONE:
            return code
    stops = floats_at(s.stops)
    end = stops[s.n_stops - 1]
    for _ in range(s.budget):
        _emit_here(s)
        if s.t >= end:
            return DONE
        if s.capacity - s.events < s.n_roots + 2:
            return MORE
        code = _step(s, stops[s.stop], end)
        if code != DONE:
            return code
    return MORE
