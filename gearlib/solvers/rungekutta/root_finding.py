"""Event location on the dense output of a step; inlined into the loops of the methods.

Each method compiles it with its own ``dense_output``, ``interpolate`` and ``last_stage``: the Runge-Kutta methods with those of
``stages``, the Taylor method with those of `gearlib.solvers.taylor.polynomial`.

``side[k]`` is the established sign of event function k: the one that agrees with its relation or, where the event iteration does not
determine it, its sign at the start, 0 where that was exactly zero. A function has flipped when its sign differs. A function that leaves
zero has flipped, too: a relation such as ``w > 0`` changes there. A value of exactly zero has not flipped, unless a positive function
comes to rest there in the step (`rests`): then zero counts as negative, as in the relations.

Rows of ``s.g``: the event functions at the beginning and end of a step, their slopes there, and three rows for a bracket.
"""

from __future__ import annotations

import math

from gearlib.compiler.small_language import floats_at, int32s_at, native
from gearlib.native.layout import MODEL
from gearlib.solvers.rungekutta.record import LoopRecord
from gearlib.solvers.rungekutta.stages import dense_output, interpolate, last_stage
from gearlib.solvers.rungekutta.vectors import add_slope, move

__all__ = ["crossing", "flipped", "has_left", "just_beyond", "look", "row", "slopes"]

OLD, NEW, SLOPE_OLD, SLOPE_NEW, LOW, HIGH, FREE = range(7)
_ROUNDING = 4.4e-16  # two spacings of doubles at 1: accuracy to which a fraction of a step is determined
AT_ONCE = 1e-9  # fraction of a step after which a function on the wrong side from the start counts as an event
CLOCK = 64 * 2.2e-16  # relative to time: a difference quotient over less would be dominated by rounding of time
SLOPE_OVER = 1e-6  # fraction of a step over which a slope is taken: a minimum is located to half of it
LOOKS = 8  # evaluations per minimum, at most
NEAR_START, NEAR_END = 0.05, 0.98  # within this part of a step the dense output is as accurate as the step


@native
def row(s: LoopRecord, i: int) -> int:
    """Address of row i of ``g``."""
    return s.g + 8 * i * s.n_roots


@native
def _copy(s: LoopRecord, i: int, j: int) -> None:
    """Copy row i of ``g`` to row j."""
    a, b = floats_at(row(s, i)), floats_at(row(s, j))
    for k in range(s.n_roots):
        b[k] = a[k]


@native
def flipped(s: LoopRecord, i: int) -> bool:
    """Whether any event function has flipped, according to row i of ``g``."""
    g, side = floats_at(row(s, i)), int32s_at(s.side)
    for k in range(s.n_roots):  # noqa: SIM110  (no generators in the small language)
        if has_left(s, side[k], g[k]):
            return True
    return False


@native
def has_left(s: LoopRecord, side: int, g: float) -> bool:
    """Whether an event function of this value is no longer on its side."""
    return g * side < 0.0 or (side == 0 and g != 0.0) or (s.resting != 0 and side > 0 and g == 0.0)


@native
def rests(s: LoopRecord, i: int, j: int) -> bool:
    """Whether a positive event function has come to rest at zero, by its value in row i of ``g`` and its slope in row j."""
    g, slope, side = floats_at(row(s, i)), floats_at(row(s, j)), int32s_at(s.side)
    for k in range(s.n_roots):  # noqa: SIM110
        if side[k] > 0 and g[k] == 0.0 and slope[k] == 0.0:
            return True
    return False


@native
def slopes(s: LoopRecord, t: float, h: float, x: int, f: int, i: int, j: int) -> None:
    """Row j of ``g`` = time derivative of the event functions of row i, by a difference quotient along the solution."""
    dt = max(SLOPE_OVER * h, CLOCK * abs(s.origin))
    add_slope(x, dt, f, s.y, s.size)
    look(s, t + dt, s.y, j)
    g, slope = floats_at(row(s, i)), floats_at(row(s, j))
    for k in range(s.n_roots):
        slope[k] = (slope[k] - g[k]) / dt


@native
def look(s: LoopRecord, t: float, x: int, i: int) -> None:
    """Row i of ``g`` = event functions at some states."""
    if MODEL(s.roots, s.origin + t, x, row(s, i), s.data, s.index) != 0:
        s.unknown = 1


@native
def _look_within(s: LoopRecord, t: float, h: float, theta: float, i: int) -> None:
    """``y`` and row i of ``g`` = state and event functions at ``t + theta h``, from the dense output."""
    interpolate(s, theta, h, s.y)
    look(s, t + theta * h, s.y, i)


@native
def _dip(s: LoopRecord, t: float, h: float) -> float:
    """First position within the step where a function that keeps its side at both ends has left it in between; 2 if there is none.

    A function that falls at the beginning and rises at the end has a minimum. The cubic through value and slope at both ends locates
    it; the dense output is evaluated there and refines the cubic on the remaining part, until the function has flipped, or its minimum
    is clearly positive relative to its slope. Row HIGH of ``g`` is evaluated at the returned position.
    """
    n = s.n_roots
    side, old, new = int32s_at(s.side), floats_at(row(s, OLD)), floats_at(row(s, NEW))
    slope_old, slope_new = floats_at(row(s, SLOPE_OLD)), floats_at(row(s, SLOPE_NEW))
    free, high, first = floats_at(row(s, FREE)), floats_at(row(s, HIGH)), 2.0
    for k in range(n):
        sign, left, right, last = side[k], 0.0, 1.0, -1.0
        a, b, da, db = sign * old[k], sign * new[k], sign * slope_old[k] * h, sign * slope_new[k] * h
        for _ in range(LOOKS):
            if not (da < 0.0 and db > 0.0 and b > 0.0):
                break
            width = right - left
            fall, rise = da * width, db * width
            c2, c3 = 3.0 * (b - a) - 2.0 * fall - rise, 2.0 * (a - b) + fall + rise
            # the minimum is the root of fall + 2 c2 u + 3 c3 u^2 at which that rises through zero
            u = -fall / (c2 + math.sqrt(max(c2 * c2 - 3.0 * c3 * fall, 0.0)))
            if not (0.0 < u < 1.0 and a + u * (fall + u * (c2 + u * c3)) < 0.1 * (rise - fall)):
                break
            theta = left + u * width
            if abs(theta - last) < _ROUNDING or theta >= first:
                break
            last = theta
            dense_output(s, t, h)
            _look_within(s, t, h, theta, FREE)
            if flipped(s, FREE):
                first = theta
                break
            over = max(SLOPE_OVER * width, CLOCK * abs(s.origin) / h)
            _look_within(s, t, h, theta + over, HIGH)
            slope = sign * (high[k] - free[k]) / over
            if sign > 0 and free[k] == 0.0 and slope == 0.0:
                s.resting, first = 1, theta
                break
            if slope < 0.0:
                left, a, da = theta, sign * free[k], slope
            else:
                right, b, db = theta, sign * free[k], slope
    if first < 1.0:
        _look_within(s, t, h, first, HIGH)
    return first


@native
def _locate(s: LoopRecord, t: float, h: float, low: float, high: float, tolerance: float) -> float:
    """Right end of a bracket, no wider than ``tolerance``, of the first flip between ``low`` and ``high``.

    The Illinois method on the event function that seems to cross first, as in SUNDIALS, with bisection where it converges slowly. The
    rows LOW and HIGH of ``g`` hold the event functions at both ends initially, and HIGH those at the right end finally.
    """
    lo, hi, free = LOW, HIGH, FREE
    side = int32s_at(s.side)
    alpha, last_moved = 1.0, 0
    for trial in range(200):
        if high - low <= tolerance:
            break
        fraction = 0.0
        below, above = floats_at(row(s, lo)), floats_at(row(s, hi))
        for i in range(s.n_roots):
            if has_left(s, side[i], above[i]):
                fraction = max(fraction, above[i] / (above[i] - alpha * below[i]) if above[i] != 0.0 else 0.5)
        # at least half a tolerance inside, and not so close to an end of a wide bracket that it never shrinks
        margin = max(0.5 * tolerance / (high - low), 1e-12)
        if trial > 15 and trial % 2 == 0:  # discontinuous, as an input may be: secants give no information
            fraction = 0.5
        theta = high - (high - low) * min(max(fraction, margin), 1.0 - margin)
        _look_within(s, t, h, theta, free)
        if flipped(s, free):
            high, hi, free = theta, free, hi
            alpha = 0.5 * alpha if last_moved == 1 else 1.0
            last_moved = 1
        else:
            low, lo, free = theta, free, lo
            alpha = 2.0 * alpha if last_moved == 2 else 1.0
            last_moved = 2
    if hi != HIGH:
        _copy(s, hi, HIGH)
    return high


@native
def crossing(s: LoopRecord, t: float, h: float, error: float) -> tuple[int, float]:
    """Look for the first event in the step from ``x`` to ``x_new``, see `_search`; half the step is to be repeated if one cannot look."""
    s.unknown = 0
    found, theta = _search(s, t, h, error)
    if s.unknown != 0:
        return -1, 0.5
    return found, theta


@native
def _search(s: LoopRecord, t: float, h: float, error: float) -> tuple[int, float]:
    """Look for the first event.

    Returns ``(found, theta)``. Without an event the step stands (found = 0). With one, ``x_new`` becomes the state just after the flip,
    at ``t + theta h``, and row NEW of ``g`` is evaluated there (found = 1). Where the dense output is not accurate enough for the
    tolerance, the step is to be repeated up to there (found = -1).
    """
    look(s, t + h, s.x_new, NEW)
    slopes(s, t + h, h, s.x_new, last_stage(s), NEW, SLOPE_NEW)
    s.resting = int(rests(s, NEW, SLOPE_NEW))
    low, high = 0.0, 1.0
    if flipped(s, OLD):  # on the wrong side from the start
        dense_output(s, t, h)
        _look_within(s, t, h, AT_ONCE, HIGH)
        if flipped(s, HIGH):
            _take(s, h, AT_ONCE)
            return 1, AT_ONCE
        low = AT_ONCE
        _copy(s, HIGH, LOW)
    else:
        _copy(s, OLD, LOW)
    dip = _dip(s, t, h)
    if dip < 1.0:
        high = dip
    elif flipped(s, NEW):
        _copy(s, NEW, HIGH)
    else:
        return 0, 1.0
    dense_output(s, t, h)
    theta = _locate(s, t, h, low, high, _ROUNDING * (1.0 + abs(t) / h))
    if NEAR_START < theta < NEAR_END and error > (0.3 if s.order == 5 else 0.1):
        return -1, theta
    theta = _on_the_clock(s, t, h, theta)
    _take(s, h, theta)
    return 1, theta


@native
def just_beyond(s: LoopRecord, t: float, dt: float) -> bool:
    """Whether an event function flips within ``dt`` after the end of the step, as one that is meant to do so at ``t`` does.

    The states and row NEW of ``g`` are then those there, so that a run that goes on from here does not meet the event again.
    """
    add_slope(s.x_new, dt, last_stage(s), s.y, s.size)
    s.unknown = 0
    look(s, t + dt, s.y, HIGH)
    if s.unknown != 0 or not flipped(s, HIGH):
        return False
    move(s.y, s.x_new, s.size)
    _copy(s, HIGH, NEW)
    return True


@native
def _on_the_clock(s: LoopRecord, t: float, h: float, theta: float) -> float:
    """Move the event to a representable floating-point time, so that the state belongs to the logged time."""
    at = t + theta * h
    if (at - t) / h < theta:
        at = math.nextafter(at, math.inf)
    later = min((at - t) / h, 1.0)
    if theta < later:
        _look_within(s, t, h, later, FREE)
        if flipped(s, FREE):
            _copy(s, FREE, HIGH)
            return later
    return theta


@native
def _take(s: LoopRecord, h: float, theta: float) -> None:
    """Let the step end at ``theta``, where row HIGH of ``g`` was evaluated."""
    if theta < 1.0:
        interpolate(s, theta, h, s.x_new)
    _copy(s, HIGH, NEW)  # a new evaluation may differ by rounding, and may not have flipped
