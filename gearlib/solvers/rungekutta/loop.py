"""One step of the explicit Runge-Kutta methods, including event location: compiled functions for all models.

Written in the small language, and compiled once per machine (`MODULES`). `gearlib.solvers.drive.drive_loop` calls them.
"""

from __future__ import annotations

import math

from gearlib.compiler.small_language import int32, native
from gearlib.native.layout import MODEL
from gearlib.solvers.drive.drive_loop import FOUND, RETRY, RHS_FAILED, ROOTS_FAILED, START, STEPPED, STIFF, TIMED
from gearlib.solvers.rungekutta.first_step import first_step, is_stiff, note
from gearlib.solvers.rungekutta.record import LoopRecord
from gearlib.solvers.rungekutta.root_finding import OLD, SLOPE_OLD, crossing, look, slopes
from gearlib.solvers.rungekutta.stages import step_error, take_step
from gearlib.solvers.rungekutta.step_size import adapt, begin_phase
from gearlib.solvers.rungekutta.within_step import LOCATED, ROUNDING, end_of_step, establish_sides

__all__ = ["LOCATED", "MODULES", "UNDERFLOW"]

MODULES = tuple(  # compiled as one unit
    f"gearlib.solvers.rungekutta.{name}"
    for name in ("loop", "root_finding", "within_step", "vectors", "step_size", "stages", "first_step")
)

UNDERFLOW = -2  # result of a step, besides the driver's codes

SURE, CALM = 15, 6  # steps; the numbers of Hairer's dopri5 and dop853


@native
def rk_restart(address: int, changed: int, why: int) -> int32:
    """Restart at ``x``: evaluate the right-hand side, and the sides and slopes of the event functions."""
    s, jumped = LoopRecord(address), 0
    if why != START and (changed != 0 or why == TIMED):  # otherwise the solution continues smoothly
        begin_phase(s, changed != 0)
    s.evaluations += 1
    s.slopes = s.moves = s.products = s.ratios = s.roughest = 0.0
    if MODEL(s.rhs, s.origin + s.t, s.x, s.k, s.data, s.index) != 0:
        return RHS_FAILED
    if s.n_roots > 0:
        s.unknown = 0
        look(s, s.t, s.x, OLD)
        if s.unknown != 0:
            return ROOTS_FAILED
        slopes(s, s.t, max(s.h, 1e-6 * s.h_max), s.x, s.k, OLD, SLOPE_OLD)
        jumped = establish_sides(s)
    if why == START:
        if s.h == 0.0:
            s.h = first_step(s)
        s.h_before_event, s.fresh = s.h_max, 1
    return jumped


@native
def _is_stiff(s: LoopRecord, t: float) -> bool:
    """Stiffness detection by counting, as in Hairer's codes: `SURE` suspicious steps without `CALM` others in a row."""
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
    """Attempt a step; returns its error over the tolerance, infinite where it cannot be evaluated, -1 where the model stops the run."""
    code = take_step(s, t, h)
    if code < 0:
        return -1.0
    if code > 0:
        s.patience -= 1
        return math.inf
    error = step_error(s, h)
    return error if error < math.inf else math.inf


@native
def rk_step(address: int, stop: float) -> int32:
    """One step toward ``stop``, up to an event within it."""
    s = LoopRecord(address)
    t, h = s.t, min(s.h, s.h_max)
    if s.h_cut > 0.0:
        h, s.h_cut = min(h, s.h_cut), 0.0
    if h < 10.0 * ROUNDING * abs(t) + 1e-25 * s.span:
        return UNDERFLOW
    last_of_span = t + 1.0001 * h >= stop
    if last_of_span:
        h = stop - t
    # The exact increment of time: with thousands of events, rounding of the clock at every step would matter
    elif s.n_roots > 0:
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
        return RETRY
    stiff = s.detect != 0 and _is_stiff(s, t + h)
    found, theta = 0, 1.0
    if s.n_roots > 0:
        found, theta = crossing(s, t, h, error)
        if found < 0:
            s.h_cut = (1.0 + 1e-4) * theta * h
            s.rejected += 1
            return RETRY
    found = end_of_step(s, stop, stop if last_of_span and found == 0 else t + theta * h, h, found)
    if stiff:
        s.pause = STIFF
    return FOUND if found == 1 else STEPPED
