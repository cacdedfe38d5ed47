"""One step of the Taylor method: compiled functions for all models, called by `gearlib.solvers.drive.drive_loop`."""

from __future__ import annotations

import math

from gearlib.compiler.small_language import floats_at, int32, native
from gearlib.native.layout import MODEL
from gearlib.native.series_source import ROW, SERIES
from gearlib.solvers.drive.drive_loop import FOUND, RHS_FAILED, ROOTS_FAILED, STEPPED, STIFF
from gearlib.solvers.rungekutta.record import LoopRecord
from gearlib.solvers.rungekutta.root_finding import OLD, SLOPE_OLD, crossing, look, slopes
from gearlib.solvers.rungekutta.vectors import move
from gearlib.solvers.rungekutta.within_step import LOCATED, ROUNDING, end_of_step, establish_sides
from gearlib.solvers.taylor.polynomial import defect, evaluate, norm, product, reach, weigh
from gearlib.solvers.taylor.series_record import SeriesRecord

__all__ = ["FIRST", "LOCATED", "MODULES", "NOT_FINITE", "SEARCHED", "UNDERFLOW"]

MODULES = (  # compiled as one unit
    "gearlib.solvers.taylor.taylor_loop", "gearlib.solvers.taylor.polynomial", "gearlib.solvers.rungekutta.root_finding",
    "gearlib.solvers.rungekutta.within_step", "gearlib.solvers.rungekutta.vectors",
)  # fmt: skip
UNDERFLOW, NOT_FINITE = -2, -3  # results of a step, besides the driver's codes
FIRST, LOWEST = 20, 4  # order of the first step, and the lowest one
AGAIN = 20  # steps after which the order is chosen anew
WORTH = 1.05  # gain in speed that a change of order is made for
# Highest order where events are searched for, or expressions chosen: longer steps hide more than the one dip that the search between
# their ends can find, and short visits to another expression
SEARCHED = 10
SURE = 3  # choices of the order in a row at which stability limits the steps
UNSEEN = 10.0  # amplitude of the fastest motion, in tolerances, below which it does not matter
# Rows of the trace within a step. The polynomials in it are of degree 11, so one part is enough up to order 10, and each further part for
# eight orders more; before and after an event, where they pass through fewer ends of steps, one more is needed
ENOUGH, ORDERS, AFTER = 3, 8, 4
# Of the longest step: shorter ones end within the radius of convergence. Beside a branch point all terms lie below the tolerance
SMALL = 1e-3
CERTAIN = 2.0  # factor on the terms of a difference that bound its change over a step, for those left out
VISITS = 64  # parts of a step, whose ends show a visit to another expression
CAUTION = 0.9  # factor on a step that is repeated


@native
def taylor_restart(address: int, changed: int, why: int) -> int32:
    """Restart at ``x``: evaluate the right-hand side, and the sides and slopes of the event functions."""
    s, r = SeriesRecord(address), LoopRecord(address)
    s.evaluations += 1
    s.looked, s.ready, s.since = AGAIN, 0, 0
    if MODEL(s.rhs, s.origin + s.t, s.x, s.k, s.data, s.index) != 0:
        return RHS_FAILED
    if s.n_roots > 0:
        r.unknown = 0
        look(r, s.t, s.x, OLD)
        if r.unknown != 0:
            return ROOTS_FAILED
        slopes(r, s.t, 1e-6 * s.h_max, s.x, s.k, OLD, SLOPE_OLD)
        return establish_sides(r)
    return 0


@native
def _expand(s: SeriesRecord, t: float, x: int, c: int) -> int:
    """Compute the Taylor coefficients at some states, of order ``next_order``; returns the code of the model's function."""
    move(x, c, s.size)
    s.expansions += s.next_order
    code: int = SERIES(s.series, s.origin + t, c, s.work, s.data, s.index, s.next_order, s.size)
    return code


@native
def _begin(s: SeriesRecord) -> bool:
    """Take over the coefficients at the end of the last step, or compute them; returns whether that was possible."""
    if s.ready == 1:
        s.ready = 0
        s.c, s.ahead, s.order = s.ahead, s.c, s.order_ahead
        return True
    s.order = s.next_order
    return _expand(s, s.t, s.x, s.c) == 0


@native
def _choose_order(s: SeriesRecord) -> int:
    """The order that makes most progress per cost, by the decay of the coefficients: up to two more than there are."""
    norms, order = floats_at(s.norms), s.order
    for k in range(order + 1):
        norms[k] = norm(s, k)
    best, fastest, own = order, 0.0, 0.0
    for k in range(LOWEST, order + 1):
        h = min(reach(norms[k], norms[k - 1], k), s.h_max)
        speed = h / (s.cost_step + k * (s.cost_order + k * s.cost_product))
        if speed >= fastest:
            best, fastest = k, speed
        own = speed
    if best == order:
        return min(order + 2, s.highest)
    return best if fastest > WORTH * own else order


@native
def _watch(s: SeriesRecord) -> bool:
    """Whether stability limits the steps: the fastest motion, as the last coefficients show it, is smaller than the tolerance.

    A vibration of rate w and amplitude a has the coefficients c_k of size a w^k / k!, less a phase that changes by a quarter turn from
    one to the next: those of either parity are in the ratio w^2 / (k (k - 1)), and the larger ones show a. So it is with a decay.
    Confirmed when the order is chosen `SURE` times.
    """
    k = s.order
    last, before, third, fourth = norm(s, k), norm(s, k - 1), norm(s, k - 2), norm(s, k - 3)
    amplitude = math.inf
    if last > 0.0 and before > 0.0 and third > 0.0 and fourth > 0.0:
        rate = math.sqrt(max(k * last / third, (k - 2) * before / fourth) * (k - 1))
        amplitude = max(before, last * k / rate)
        for j in range(1, k):
            amplitude *= j / rate
        s.cosine = product(s) / last / before
    if not amplitude < UNSEEN:
        s.stiff_steps = 0
        return False
    if s.stiff_steps == 0:
        s.stiff_t, s.stiff_first, s.stiff_events = s.t, s.steps, s.events
    s.stiff_steps += 1
    return s.stiff_steps >= SURE and s.steps >= s.detect_from


@native
def _radius(s: SeriesRecord) -> float:
    """Radius of convergence, from the ratios of the last coefficients of either parity."""
    k, found = s.order, math.inf
    for j in range(k - 1, k + 1):
        last, before = norm(s, j), norm(s, j - 2)
        if last > 0.0 and before > 0.0:
            found = min(found, math.sqrt(before / last))
    return found


@native
def _look_ahead(s: SeriesRecord, t: float, h: float) -> int:
    """``x_new``, and the coefficients there, of which the first one is the right-hand side; returns the code of the model's functions."""
    evaluate(s, h, s.x_new, s.y)
    code = _expand(s, t, s.x_new, s.ahead)
    s.order_ahead = s.next_order
    if code == 0 and s.guarded == 1:
        s.evaluations += 1
        code = MODEL(s.rhs, s.origin + t, s.x_new, s.k, s.data, s.index)
    return code


@native
def _difference(s: SeriesRecord, i: int, u: float) -> float:
    """A difference whose sign chooses between expressions, at a time from the start of the step, by its coefficients there."""
    work, at, value = floats_at(s.work), s.compared_at + i * ROW, 0.0
    for k in range(s.order - 1, -1, -1):
        value = value * u + work[at + k]
    return value


@native
def _may_change(s: SeriesRecord, i: int, h: float) -> bool:
    """Whether a difference may change sign within a step, which the sum of its terms bounds."""
    work, at, change = floats_at(s.work), s.compared_at + i * ROW, 0.0
    for k in range(s.order - 1, 0, -1):
        change = (change + abs(work[at + k])) * h
    return not CERTAIN * change <= abs(work[at])


@native
def _without_visits(s: SeriesRecord, h: float) -> float:
    """The longest step, up to ``h``, that does not pass over a visit to another expression: it ends before that or within it.

    The differences that choose between expressions show them. The work space holds their coefficients at the start of the step.
    """
    for i in range(s.compared):
        if _may_change(s, i, h):
            begin, first = _difference(s, i, 0.0) > 0.0, 0.0
            for j in range(1, VISITS + 1):
                u = j * h / VISITS
                elsewhere = (_difference(s, i, u) > 0.0) != begin
                if elsewhere and first == 0.0:
                    first = u
                if not elsewhere and first > 0.0:
                    h = first
                    break
    return h


@native
def _departs(s: SeriesRecord, t: float, h: float) -> float:
    """How far the series holds within a step whose end agrees: to where the right-hand side first differs, as in a short visit."""
    count = s.looks * max(s.order, SEARCHED)
    for i in range(1, count):
        u = i * h / count
        evaluate(s, u, s.within, s.y)
        s.evaluations += 1
        if MODEL(s.rhs, s.origin + t + u, s.within, s.k, s.data, s.index) != 0 or not defect(s, h, s.k) <= 1.0:
            return u
    return h


@native
def taylor_motion(address: int, t: float) -> int32:
    """States at a time within the step, and their derivatives."""
    s = SeriesRecord(address)
    evaluate(s, t - s.t, s.within, s.rates_within)
    return 0


@native
def taylor_step(address: int, stop: float) -> int32:
    """One step toward ``stop``, up to an event within it."""
    s, r = SeriesRecord(address), LoopRecord(address)
    t = s.t
    if not _begin(s):
        return RHS_FAILED
    weigh(s)
    while s.order > LOWEST and not norm(s, s.order) < math.inf:  # rates of 1e7 /s to the power of 30 overflow
        s.order -= 1
        s.next_order = s.order
    if s.looked >= AGAIN:
        s.looked = 0
        s.next_order = _choose_order(s)
        if s.detect == 1 and _watch(s):
            s.pause = STIFF
        if s.next_order < s.order:
            s.order = s.next_order
    s.looked += 1
    s.h = reach(norm(s, s.order), norm(s, s.order - 1), s.order)
    if not s.h > 0.0:
        return NOT_FINITE
    if s.h < SMALL * s.h_max:
        s.h = min(s.h, _radius(s))
    h = _without_visits(s, min(s.h, s.h_max))
    last_of_span = t + 1.0001 * h >= stop
    if last_of_span:
        h = stop - t
    elif s.n_roots > 0:  # the exact increment of time
        h = (t + h) - t
    while True:
        if not last_of_span and h < 10.0 * ROUNDING * abs(t) + 1e-25 * s.span:
            return UNDERFLOW
        code = _look_ahead(s, t + h, h)
        if code < 0:
            return RHS_FAILED
        error = defect(s, h, s.ahead + 8 * s.size) if code == 0 else math.inf
        until = h
        if error <= 1.0:
            until = _departs(s, t, h)
            if until == h:
                break
        s.rejected += 1
        last_of_span = False
        if until < h:
            h = until
            continue
        h = h * (max(0.2, min(0.8, CAUTION * error ** (-1.0 / (s.order + 1)))) if error < math.inf else 0.25)
        if error == math.inf:
            s.patience -= 1
            if s.patience == 0:
                return UNDERFLOW
    found, theta = 0, 1.0
    move(s.ahead + 8 * s.size, s.k + 8 * s.size, s.size)
    if s.n_roots > 0:
        if s.since == 0:  # those of the restart are over a time that rounding of large states may hide
            slopes(r, t, h, s.x, s.c + 8 * s.size, OLD, SLOPE_OLD)
        found, theta = crossing(r, t, h, 0.0)
        if found < 0:
            return ROOTS_FAILED
    found = end_of_step(r, stop, stop if last_of_span and found == 0 else t + theta * h, h, found)
    s.ready = 1 - found
    s.since += 1
    s.parts = 1 + (s.order if found == 1 or s.since < AFTER else s.order - ENOUGH) // ORDERS
    return FOUND if found == 1 else STEPPED
