"""What is done within and at the end of a step, whatever method took it: dense output, acceptance, signs of the event functions.

Compiled with the ``dense_output``, ``interpolate`` and ``last_stage`` of each method, like ``root_finding``.
"""

from __future__ import annotations

from gearlib.compiler.small_language import floats_at, int32, int32s_at, native
from gearlib.solvers.drive.drive_loop import ROUNDING
from gearlib.solvers.rungekutta.record import LoopRecord
from gearlib.solvers.rungekutta.root_finding import AT_ONCE, NEW, OLD, SLOPE_NEW, SLOPE_OLD, has_left, just_beyond, row
from gearlib.solvers.rungekutta.stages import dense_output, interpolate, last_stage
from gearlib.solvers.rungekutta.vectors import move

__all__ = ["LOCATED", "ROUNDING", "end_of_step", "establish_sides"]

LOCATED = 2.2e-14  # relative to time, a hundred spacings of doubles: accuracy of event location


@native
def rk_interpolate(address: int, t: float, out: int) -> int32:
    """States at a time within the step."""
    s = LoopRecord(address)
    dense_output(s, s.t, s.h_step)
    interpolate(s, (t - s.t) / s.h_step, s.h_step, s.y)
    source, target = floats_at(s.y), floats_at(out)
    for j in range(s.n):
        target[j] = source[j]
    return 0


@native
def rk_accept(address: int) -> int32:
    """Make the end of a step the start of the next one."""
    s = LoopRecord(address)
    move(s.x_new, s.x, s.size)
    move(last_stage(s), s.k, s.size)
    old, new = floats_at(row(s, OLD)), floats_at(row(s, NEW))
    slope_old, slope_new = floats_at(row(s, SLOPE_OLD)), floats_at(row(s, SLOPE_NEW))
    for i in range(s.n_roots):
        old[i] = new[i]
        slope_old[i] = slope_new[i]
    return 0


@native
def end_of_step(s: LoopRecord, stop: float, t_new: float, h: float, found: int) -> int:
    """Set where a step ends, and record its event, if there is one; returns 1 for an event."""
    reached = t_new >= stop - ROUNDING * abs(stop)
    s.reached, s.h_step = stop if reached else t_new, h
    if found == 0 and reached and s.n_roots > 0 and s.stop == s.n_stops - 1:
        if just_beyond(s, stop, LOCATED * max(abs(s.origin + stop), s.span)):
            found = 1
    if found == 1:
        fire(s)
    return found


@native
def fire(s: LoopRecord) -> None:
    """Record which event functions changed sign, and in which direction."""
    side, fired, g = int32s_at(s.side), int32s_at(s.fired), floats_at(row(s, NEW))
    s.from_zero = 1
    for i in range(s.n_roots):
        fired[i] = 0
        if has_left(s, side[i], g[i]):
            fired[i] = 1 if g[i] > 0.0 else -1
            if side[i] != 0:
                s.from_zero = 0


@native
def establish_sides(s: LoopRecord) -> int:
    """Sides of the event functions, as determined by the event iteration (unaffected by rounding), else by row OLD of ``g``.

    Returns how many have jumped across zero: what compares discrete variables may, even where it has just been crossed. That is an event
    of the same instant, and ``fired`` says which.
    """
    side, fired, g, slope = int32s_at(s.side), int32s_at(s.fired), floats_at(row(s, OLD)), floats_at(row(s, SLOPE_OLD))
    jumped, rounding = 0, LOCATED * max(abs(s.origin + s.t), s.span)
    ahead = max(AT_ONCE * min(s.h, s.h_max), rounding)  # what has come over by then, `root_finding` takes for rounding
    for i in range(s.n_roots):
        held = fired[i]
        side[i] = held // 2 if abs(held) == 2 else sign(g[i])
        fired[i] = 0
        if abs(held) == 2 and g[i] * held < 0.0 and (g[i] + ahead * slope[i]) * held < 0.0:
            fired[i] = sign(g[i])
            jumped += 1
    return jumped


@native
def sign(x: float) -> int:
    """-1, 0 or 1."""
    return int(x > 0.0) - int(x < 0.0)
