"""The integration loop of the explicit Runge-Kutta methods: one compiled function for all models.

It is compiled when this module is first imported on a machine (and found in the cache afterwards), so import it late. The
loop keeps its state in arrays and returns after a given number of steps, so that Python can look after interrupts, grow the
event log and call again.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numba import types

from gearlib.solve.kept import keep
from gearlib.solve.native_call import call_native, inner
from gearlib.solve.rk_events import crossing, slopes
from gearlib.solve.rk_stages import error5, error8, interpolate, interpolation_weights
from gearlib.solve.rk_steps import caution, dense_stages, first_step, is_damped, is_stiff, note, take_step

__all__ = ["advance"]

# what ``advance`` returns
DONE, MORE, STIFF, RHS_FAILED, UNDERFLOW, CHATTERING, UPDATE_FAILED = 0, 1, 2, -1, -2, -3, -4
# elements of clock and of count
T, H, LOG_ERROR, H_HELD, SPAN, H_MAX, LAST, MEAN = *range(7), 9
CLOCK_SIZE = 12  # LAST and MEAN are of three elements: see ``note``
SAMPLE, STOP, STEPS, REJECTED, RHS, EVENTS, STIFF_STEPS, CALM_STEPS, STARTED, RETRY, PATIENCE = range(11)

CHATTER_EVENTS = 1000  # that many events within CHATTER_SPAN of the time span are a chattering model, not a rattling gear
CHATTER_SPAN = 1e-10
# A stiff run that needs fewer steps than this to its end is finished all the same. Fast vibrations, though they have died away,
# keep an implicit method at low orders, so that it pays later than where fast motions are decays.
STIFF_LEFT, VIBRATING_LEFT = 500, 20_000
ROUNDING = 8.9e-16
TINY = 1e-250


@inner()
def _restart(
    order: int, native: Any, clock: Any, count: Any, x: Any, k: Any, y: Any, g: Any, side: Any, fired: Any
) -> int:  # fmt: skip
    """Begin anew at ``x``: the right-hand side, the sides of the event functions and their slopes."""
    code: int = call_native(native[0], clock[T], x.ctypes.data, k.ctypes.data, native[3], native[4])
    count[RHS] += 1
    clock[LOG_ERROR] = math.log(1e-4)
    clock[MEAN:] = 0.0
    if side.size > 0 and code == 0:
        call_native(native[1], clock[T], x.ctypes.data, g.ctypes.data, native[3], native[4])
        slopes(native, clock[T], max(clock[H], 1e-6 * clock[H_MAX]), x, k[0], g[0], y, g[2])
        for i in range(side.size):  # what the event iteration says, which rounding cannot make wrong
            side[i] = fired[i] // 2 if abs(fired[i]) == 2 else np.sign(g[0, i])
    return code


@inner()
def _start(
    order: int, native: Any, clock: Any, count: Any, x: Any, k: Any, y: Any, g: Any, side: Any, fired: Any, atol: Any,
    rtol: float,
) -> int:  # fmt: skip
    count[STARTED] = 1
    for i in range(fired.size):
        fired[i] = 0
    if native[2] != 0:
        if call_native(native[2], clock[T], x.ctypes.data, fired.ctypes.data, native[3], native[4]) < 0:
            return UPDATE_FAILED
    if _restart(order, native, clock, count, x, k, y, g, side, fired) != 0:
        return RHS_FAILED
    if clock[H] == 0.0:
        clock[H] = first_step(order, native, clock[T], x, k, y, atol, rtol, clock[H_MAX])
        count[RHS] += 1
    clock[H_HELD] = clock[H_MAX]
    return DONE


@inner()
def _emit(
    order: int, t: float, t_new: float, h: float, x: Any, k: Any, b: Any, count: Any, times: Any, out_x: Any, out_modes: Any,
    data: Any, first_mode: int,
) -> None:  # fmt: skip
    """Store the samples before ``t_new``."""
    i = count[SAMPLE]
    while i < times.size and times[i] < t_new:
        interpolation_weights(order, (times[i] - t) / h, b)
        interpolate(order, x, h, k, b, out_x[i])
        for j in range(out_modes.shape[1]):
            out_modes[i, j] = data[first_mode + j]
        i += 1
    count[SAMPLE] = i


@inner()
def _emit_here(t: float, x: Any, count: Any, times: Any, out_x: Any, out_modes: Any, data: Any, first_mode: int) -> None:
    """Store the samples at ``t`` itself."""
    i = count[SAMPLE]
    while i < times.size and times[i] <= t:
        for j in range(x.size):
            out_x[i, j] = x[j]
        for j in range(out_modes.shape[1]):
            out_modes[i, j] = data[first_mode + j]
        i += 1
    count[SAMPLE] = i


@inner()
def _handle(
    order: int, native: Any, clock: Any, count: Any, x: Any, k: Any, y: Any, g: Any, side: Any, fired: Any, log_t: Any,
    log_root: Any, found: int, timed: bool,
) -> int:  # fmt: skip
    """Call ``update`` for the roots that flipped (``found``) or a time event, write the log, begin anew."""
    t = clock[T]
    from_zero = True
    for i in range(side.size):
        fired[i] = 0
        if found == 1 and (g[1, i] * side[i] < 0.0 or (side[i] == 0 and g[1, i] != 0.0)):
            fired[i] = np.sign(g[1, i])
            from_zero = from_zero and side[i] == 0
    if timed:
        log_t[count[EVENTS]] = t
        log_root[count[EVENTS]] = -1
        count[EVENTS] += 1
    logged = count[EVENTS]
    for i in range(side.size):  # before the update, which may forget what fired
        if fired[i] != 0:
            log_t[count[EVENTS]] = t
            log_root[count[EVENTS]] = i
            count[EVENTS] += 1
    changed = 0
    if native[2] != 0:
        changed = call_native(native[2], t, x.ctypes.data, fired.ctypes.data, native[3], native[4])
        if changed < 0:
            return UPDATE_FAILED
    if changed == 0 and from_zero:  # a function that merely starts from zero is not worth an entry
        count[EVENTS] = logged
    # the step that suits the next phase is not known: that of the phase before this one is a good guess where two alternate
    held = clock[H_HELD]
    clock[H_HELD] = clock[H]
    clock[H] = min(clock[H], held)
    if _restart(order, native, clock, count, x, k, y, g, side, fired) != 0:
        return RHS_FAILED
    recent = count[EVENTS] - CHATTER_EVENTS
    if recent >= 0 and t - log_t[recent] < CHATTER_SPAN * clock[SPAN]:
        return CHATTERING
    return DONE


@inner()
def _is_stiff(order: int, left: float, clock: Any, count: Any) -> bool:
    """Count steps that look stiff, as Hairer's codes do: 15 of them, without 6 others in a row, and with many still ``left``."""
    note(clock[MEAN:], clock[LAST:MEAN])
    if is_stiff(order, clock[MEAN:]):
        count[STIFF_STEPS] += 1
        count[CALM_STEPS] = 0
        return bool(count[STIFF_STEPS] >= 15 and left > (STIFF_LEFT if is_damped(clock[MEAN:]) else VIBRATING_LEFT))
    count[CALM_STEPS] += 1
    if count[CALM_STEPS] >= 6:
        count[STIFF_STEPS] = 0
    return False


@inner()
def _attempt(
    order: int, native: Any, t: float, h: float, x: Any, x_new: Any, k: Any, y: Any, atol: Any, rtol: float, clock: Any,
    count: Any,
) -> float:  # fmt: skip
    """Try a step; its error over the tolerance, infinite where it cannot be evaluated, -1 where the model stops the run."""
    count[STEPS] += 1
    count[RHS] += 6 if order == 5 else 12
    code = take_step(order, native, t, h, x, x_new, k, y)
    if code < 0:
        return -1.0
    if code > 0:
        count[PATIENCE] -= 1
    error, last = math.inf, clock[LAST:MEAN]
    if code == 0:
        error = error5(x, x_new, h, k, y, atol, rtol, last) if order == 5 else error8(x, x_new, h, k, y, atol, rtol, last)
    return error if error < math.inf else math.inf


@inner()
def _adapt(order: int, h: float, error: float, clock: Any, count: Any) -> bool:
    """Choose the next step size; whether the step is accepted.

    PI control (Gustafsson): h grows with error^-alpha, damped by the error of the step before. These constants leave hardly a
    step to be rejected, and make steps at the limit of stability much more accurate than alpha = 1 / order, beta = 0.
    """
    if not error <= 1.0:
        count[REJECTED] += 1
        count[RETRY] = 1
        clock[H] = h * (max(0.2, 0.9 * error ** (-1.0 / order)) if error < math.inf else 0.25)
        return False
    alpha, beta = (0.14, 0.08) if order == 5 else (0.0875, 0.05)
    log_error = math.log(max(error * caution(order, clock[LAST:MEAN]), 1e-10))
    growth = min(10.0, max(0.2, 0.9 * math.exp(beta * clock[LOG_ERROR] - alpha * log_error)))
    if count[RETRY] == 1:
        growth = min(growth, 1.0)
    # a step that was cut short to meet a stop says nothing against the size wanted before
    clock[H] = max(h * growth, clock[H]) if h < clock[H] else h * growth
    clock[LOG_ERROR] = log_error
    count[RETRY] = 0
    return True


@inner()
def _move(last: int, x: Any, x_new: Any, k: Any, g: Any) -> None:
    """Make the end of a step the start of the next one."""
    for i in range(x.size):  # numbers near underflow, as far from a load as nothing has arrived yet, are slow: they become zero
        x[i] = x_new[i] if abs(x_new[i]) > TINY else 0.0
        k[0, i] = k[last, i] if abs(k[last, i]) > TINY else 0.0
    for i in range(g.shape[1]):
        g[0, i] = g[1, i]
        g[2, i] = g[3, i]


@inner()
def _advance(
    order: int, native: Any, clock: Any, count: Any, x: Any, x_new: Any, y: Any, k: Any, b: Any, atol: Any, rtol: float,
    times: Any, out_x: Any, out_modes: Any, data: Any, first_mode: int, stops: Any, timed: Any, g: Any, side: Any, fired: Any,
    log_t: Any, log_root: Any, budget: int, detect: bool,
) -> int:  # fmt: skip
    """Integrate for ``budget`` steps, or until something happens that Python must see to."""
    if count[STARTED] == 0:
        code = _start(order, native, clock, count, x, k, y, g, side, fired, atol, rtol)
        if code != DONE:
            return code
    for _ in range(budget):
        t, stop = clock[T], stops[count[STOP]]
        _emit_here(t, x, count, times, out_x, out_modes, data, first_mode)
        if t >= stops[stops.size - 1]:
            return DONE
        if log_t.size - count[EVENTS] < side.size + 2:
            return MORE
        h = min(clock[H], clock[H_MAX])
        if h < 10.0 * ROUNDING * abs(t) + 1e-25 * clock[SPAN]:
            return UNDERFLOW
        last_of_span = t + 1.0001 * h >= stop
        if last_of_span:
            h = stop - t
        error = _attempt(order, native, t, h, x, x_new, k, y, atol, rtol, clock, count)
        if error < 0.0:
            return RHS_FAILED
        if count[PATIENCE] == 0:
            return UNDERFLOW
        if not _adapt(order, h, error, clock, count):
            continue
        if detect and _is_stiff(order, (stops[stops.size - 1] - t) / h, clock, count):
            return STIFF
        found, taken, theta, extra = 0, h, 1.0, 0
        if side.size > 0:
            found, taken, theta, extra = crossing(order, native, t, h, x, x_new, k, b, y, g, side)
            count[RHS] += extra
            if found < 0:
                clock[H] = 0.5 * taken
                continue
        t_new = stop if last_of_span and found == 0 and taken == h else t + theta * taken
        before = t_new - ROUNDING * abs(t_new)
        if count[SAMPLE] < times.size and times[count[SAMPLE]] < before:
            if extra == 0:
                count[RHS] += dense_stages(order, native, t, taken, x, k, y)
            _emit(order, t, before, taken, x, k, b, count, times, out_x, out_modes, data, first_mode)
        reached = t_new >= stop - ROUNDING * abs(stop)
        clock[T] = stop if reached else t_new
        _move(6 if order == 5 else 12, x, x_new, k, g)
        if found == 1 or (reached and timed[count[STOP]]):
            at_time = reached and timed[count[STOP]]
            code = _handle(order, native, clock, count, x, k, y, g, side, fired, log_t, log_root, found, at_time)
            if code != DONE:
                return code
        if reached and count[STOP] < stops.size - 1:
            count[STOP] += 1
    return MORE


_types: Any = types
_floats, _rows = _types.Array(types.float64, 1, "C"), _types.Array(types.float64, 2, "C")
_integers, _signs, _flags = (_types.Array(t, 1, "C") for t in (types.int64, types.int32, types.boolean))
_njit: Any = numba.njit
advance: Any = keep(_advance, _njit(
    types.int64(
        types.int64, _types.UniTuple(types.int64, 5), _floats, _integers, _floats, _floats, _floats, _rows, _floats, _floats,
        types.float64, _floats, _rows, _rows, _floats, types.int64, _floats, _flags, _rows, _signs, _signs, _floats, _integers,
        types.int64, types.boolean,
    ),
    cache=True, nogil=True, error_model="numpy", _nrt=False,
))  # fmt: skip
