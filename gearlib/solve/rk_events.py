"""Root finding on the steps of a Runge-Kutta method, compiled as part of the loop in ``rk_loop``.

``side[k]`` is the established sign of event function k, which goes with what its relation holds, or, where the event iteration does
not say so, its sign at the start, 0 where it was exactly zero. A root has flipped where the function has another sign; a value of
exactly zero has not. A function that leaves zero has flipped, too: a relation such as ``w > 0`` changes there.
"""

from __future__ import annotations

import math
from typing import Any

from gearlib.solve.native_call import call_native, inner
from gearlib.solve.rk_stages import interpolate, interpolation_weights
from gearlib.solve.rk_steps import dense_stages, take_step

__all__ = ["crossing", "flipped", "slopes"]

_ROUNDING = 4.4e-16


@inner()
def _copy(a: Any, b: Any) -> None:
    for i in range(a.size):  # numba takes a second to compile the checks of a slice assignment
        b[i] = a[i]


@inner()
def flipped(g: Any, side: Any) -> bool:
    """Whether any event function has left its side."""
    for k in range(side.size):  # noqa: SIM110  (numba)
        if g[k] * side[k] < 0.0 or (side[k] == 0 and g[k] != 0.0):
            return True
    return False


@inner()
def slopes(native: Any, t: float, h: float, x: Any, f: Any, g: Any, y: Any, slope: Any) -> None:
    """``slope`` = time derivative of the event functions ``g`` along the solution, by a difference over a part of ``h``."""
    dt = 1e-4 * h
    for i in range(x.size):
        y[i] = x[i] + dt * f[i]
    call_native(native[1], t + dt, y.ctypes.data, slope.ctypes.data, native[3], native[4])
    for k in range(slope.size):
        slope[k] = (slope[k] - g[k]) / dt


@inner()
def _look(order: int, native: Any, t: float, h: float, x: Any, k: Any, b: Any, y: Any, theta: float, g: Any) -> None:
    """``y``, ``g`` = state and event functions at ``t + theta h``, from the dense output."""
    interpolation_weights(order, theta, b)
    interpolate(order, x, h, k, b, y)
    call_native(native[1], t + theta * h, y.ctypes.data, g.ctypes.data, native[3], native[4])


@inner()
def _dip(h: float, g_old: Any, g_new: Any, slope_old: Any, slope_new: Any, side: Any) -> float:
    """Where within the step a function that keeps its side at both ends may have crossed zero twice; 2 where none may.

    Its cubic through both ends has a minimum, not far above zero compared with how steeply it gets there.
    """
    first = 2.0
    for k in range(side.size):
        sign = side[k]
        a, b, da, db = sign * g_old[k], sign * g_new[k], sign * slope_old[k] * h, sign * slope_new[k] * h
        if not (da < 0.0 and db > 0.0):
            continue
        c2, c3 = 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db
        # the minimum is the root of da + 2 c2 theta + 3 c3 theta^2 where that rises through zero
        theta = -da / (c2 + math.sqrt(max(c2 * c2 - 3.0 * c3 * da, 0.0)))
        if 0.0 < theta < first and a + theta * (da + theta * (c2 + theta * c3)) < 0.1 * (db - da):
            first = theta
    return first


@inner()
def _locate(
    order: int, native: Any, t: float, h: float, x: Any, k: Any, b: Any, y: Any, low: float, high: float, tolerance: float,
    g: Any, side: Any,
) -> float:  # fmt: skip
    """Right end of a bracket, no wider than ``tolerance``, of the first flip between ``low`` and ``high``.

    The Illinois method on the event function that seems to cross first, as in SUNDIALS, with bisections where it lasts. The
    rows of ``g`` (low, high, free) hold the event functions at both ends at the start.
    """
    lo, hi, free = 0, 1, 2
    alpha, last_moved = 1.0, 0
    for trial in range(200):
        if high - low <= tolerance:
            break
        fraction = 0.0
        for i in range(side.size):
            if g[hi, i] * side[i] < 0.0 or (side[i] == 0 and g[hi, i] != 0.0):
                fraction = max(fraction, g[hi, i] / (g[hi, i] - alpha * g[lo, i]))
        # at least half a tolerance inside, and not so near an end of a wide bracket that it never shrinks
        margin = max(0.5 * tolerance / (high - low), 1e-12)
        if trial > 15 and trial % 2 == 0:  # it jumps, as an input may: no line through both ends says where
            fraction = 0.5
        theta = high - (high - low) * min(max(fraction, margin), 1.0 - margin)
        _look(order, native, t, h, x, k, b, y, theta, g[free])
        if flipped(g[free], side):
            high, hi, free = theta, free, hi
            alpha = 0.5 * alpha if last_moved == 1 else 1.0
            last_moved = 1
        else:
            low, lo, free = theta, free, lo
            alpha = 2.0 * alpha if last_moved == 2 else 1.0
            last_moved = 2
    if hi != 1:
        _copy(g[hi], g[1])
    return high


@inner()
def crossing(
    order: int, native: Any, t: float, h: float, x: Any, x_new: Any, k: Any, b: Any, y: Any, g: Any, side: Any
) -> tuple[int, float, float, int]:
    """Look for the first event in the step from ``x`` to ``x_new``.

    Returns ``(found, h, theta, rhs)``. Without an event the step stands, or was cut to a shorter ``h`` (found = 0). With one,
    the step was repeated up to the event, so that its full accuracy holds there, and ``x_new`` is the state at ``t + theta h``,
    ``theta`` close to 1, just after the flip; row 1 of ``g`` is taken there (found = 1). found = -1: the repeated step failed.
    Rows of ``g``: old and new values, old and new slopes, three for the bracket.
    """
    call_native(native[1], t + h, x_new.ctypes.data, g[1].ctypes.data, native[3], native[4])
    slopes(native, t + h, h, x_new, k[6 if order == 5 else 12], g[1], y, g[3])
    bracket = g[4:7]
    high = 1.0
    if flipped(g[1], side):
        _copy(g[1], bracket[1])
        extra = dense_stages(order, native, t, h, x, k, y)
    else:
        high = _dip(h, g[0], g[1], g[2], g[3], side)
        if high >= 1.0:
            return 0, h, 1.0, 0
        extra = dense_stages(order, native, t, h, x, k, y)
        _look(order, native, t, h, x, k, b, y, high, bracket[1])
        if not flipped(bracket[1], side):
            return 0, h, 1.0, extra
    _copy(g[0], bracket[0])
    if flipped(g[0], side):  # on the wrong side from the start
        h_event = 1e-9 * h
    else:
        h_event = h * _locate(order, native, t, h, x, k, b, y, 0.0, high, 1e-6, bracket, side)
    if take_step(order, native, t, h_event, x, x_new, k, y) != 0:
        return -1, h_event, 1.0, extra
    extra += dense_stages(order, native, t, h_event, x, k, y) + (6 if order == 5 else 12)
    low, high = 1.0, 1.0
    width = 4e-6
    call_native(native[1], t + h_event, x_new.ctypes.data, g[1].ctypes.data, native[3], native[4])
    if flipped(g[1], side):
        _copy(g[1], bracket[1])
        while low > 0.0:
            low = 1.0 - width if width < 0.5 else 0.0
            _look(order, native, t, h_event, x, k, b, y, low, bracket[0])
            if low == 0.0 or not flipped(bracket[0], side):
                break
            width *= 16.0
        if low == 0.0:
            _copy(g[0], bracket[0])
    else:
        _copy(g[1], bracket[0])
        while True:
            high = 1.0 + width
            _look(order, native, t, h_event, x, k, b, y, high, bracket[1])
            if flipped(bracket[1], side):
                break
            width *= 16.0
            if width > 0.1:  # the event is further on than the first step said: leave it to the next step
                slopes(native, t + h_event, h_event, x_new, k[6 if order == 5 else 12], g[1], y, g[3])
                return 0, h_event, 1.0, extra
    rounding = _ROUNDING * (1.0 + abs(t) / h_event)
    theta = _locate(order, native, t, h_event, x, k, b, y, low, high, rounding, bracket, side)
    if theta != 1.0:
        _look(order, native, t, h_event, x, k, b, y, theta, g[1])
        _copy(y, x_new)
    _copy(bracket[1], g[1])  # what is evaluated anew may differ by rounding, and may not have flipped
    return 1, h_event, theta, extra
