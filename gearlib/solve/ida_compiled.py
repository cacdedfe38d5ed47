"""The compiled half of the IDA road: the callbacks that SUNDIALS calls, and the loop that calls SUNDIALS.

All of it is generic. A model enters by the addresses of its native functions, written into a ``FRAME`` that SUNDIALS hands
back to every callback as its user data; hence this module is compiled once per machine and read from the cache afterwards.
Importing it imports numba: only `gearlib.solve.ida` does, when it integrates.

IDA's unknowns may be ordered otherwise than the model's, so that the Jacobian has a narrow band: component i of an ``N_Vector``
is then state ``order[i]`` of the model.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np

from gearlib.solve.ida_frame import FRAME
from gearlib.solve.ida_pointers import call, call_for_address, doubles, ints, longs
from gearlib.solve.ida_request import (
    CHATTER,
    CHUNK,
    PROBES,
    REACH,
    RHS_FAILED,
    ROOTS_FAILED,
    SLOPE_OVER,
    STALLED,
    START_FAILED,
    STEP_LIMIT,
    UNSETTLED,
    UPDATE_FAILED,
)  # fmt: skip
from gearlib.solve.kept import keep

# How `drive` ends, beside the failures of `ida_request`: all samples taken, back for a breath, event log full.
DONE, PAUSE, LOG_FULL = 0, 1, 2
IDA_NORMAL, IDA_ROOT_RETURN, IDA_TOO_MUCH_WORK, IDA_YA_YDP_INIT = 1, 2, -1, 1
NEGATIVE_ZERO = -1e-300  # what an event function that is exactly zero is taken for: zero belongs to the negative side

_numba: Any = numba  # some of its versions declare types, and not those that its functions take
carray, types = _numba.carray, _numba.types

_frame = types.CPointer(_numba.from_dtype(FRAME))
_int, _long, _double = types.int32, types.int64, types.float64
EPS = float(np.finfo(np.float64).eps)
_Function = TypeVar("_Function", bound=Callable[..., Any])


def _inner(function: _Function) -> _Function:
    """Compile a function that the callbacks call."""
    return cast(_Function, _numba.njit(error_model="numpy")(function))  # an exception could not leave a callback


def _reassociating(function: _Function) -> _Function:
    """The same for one whose sums may be reordered, so that they use vectors."""
    return cast(_Function, _numba.njit(error_model="numpy", fastmath={"reassoc"})(function))


def _callback(*arguments: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a C function of these arguments that returns an int, and keep it on disk."""
    return lambda function: keep(
        _numba.njit(error_model="numpy")(function), _numba.cfunc(_int(*arguments), cache=True, error_model="numpy")
    )


@_reassociating
def all_finite(values: Any, n: int) -> bool:
    total = 0.0  # not-a-number and infinity survive a sum of zero times each
    for i in range(n):
        total += values[i] * 0.0
    return bool(total == 0.0)


@_inner
def refuse(s: Any, t: float, values: Any, n: int) -> Any:
    """Note where the right-hand side (or Jacobian) could not be evaluated, and ask for a smaller step."""
    s.refused += 1
    s.bad_time = t
    s.bad_state = -1
    for i in range(n):
        if not np.isfinite(values[i]):
            s.bad_state = i
            break
    return -1 if s.refused == s.patience else 1


@_inner
def natural(s: Any, y: int) -> Any:
    """The address of the states in the model's order, from a vector in IDA's order."""
    if s.order == 0:
        return y
    source, target, order = doubles(y, s.n), doubles(s.x, s.n), longs(s.order, s.n)
    for i in range(s.n):
        target[order[i]] = source[i]
    return s.x


@_callback(_double, _long, _long, _long, _frame)
def residual(t: float, yy: int, yp: int, rr: int, user: Any) -> Any:
    """r = diag(differential) x' - f(t, x), an ``IDAResFn``."""
    s = carray(user, 1)[0]
    s.n_rhs += 1
    if t != s.attempt_time:
        s.attempt_time = t
        s.attempts += 1
    n = s.n
    r_address = call_for_address(s.array_pointer, rr)
    f_address = r_address if s.order == 0 else s.f
    x = natural(s, call_for_address(s.array_pointer, yy))
    status = call(s.rhs, (s.origin + t, x, f_address, s.data, s.index))
    f = doubles(f_address, n)
    if status < 0:
        refuse(s, s.origin + t, f, 0)
        return -1
    if status > 0 or not all_finite(f, n):
        return refuse(s, s.origin + t, f, n)
    r, dy, d = doubles(r_address, n), doubles(call_for_address(s.array_pointer, yp), n), doubles(s.differential, n)
    if s.order == 0:
        for i in range(n):
            r[i] = d[i] * dy[i] - f[i]
    else:
        order = longs(s.order, n)
        for i in range(n):
            r[i] = d[i] * dy[i] - f[order[i]]
    return 0


@_callback(_double, _double, _long, _long, _long, _long, _frame, _long, _long, _long)
def jacobian(t: float, cj: float, yy: int, yp: int, rr: int, jj: int, user: Any, t1: int, t2: int, t3: int) -> Any:
    """cj diag(differential) - df/dx, an ``IDALsJacFn``: SUNDIALS hands the matrix over cleared."""
    s = carray(user, 1)[0]
    s.n_jac += 1
    x = natural(s, call_for_address(s.array_pointer, yy))
    status = call(s.jac, (s.origin + t, x, s.values, s.data, s.index))
    values = doubles(s.values, s.nnz)
    if status < 0:
        return -1
    if status > 0 or not all_finite(values, s.nnz):
        return refuse(s, s.origin + t, values, 0)
    position, diagonal = longs(s.position, s.nnz), longs(s.diagonal, s.n_diagonal)
    matrix = doubles(s.matrix, 1)  # the bound is not looked at
    for k in range(s.nnz):
        matrix[position[k]] = -values[k]
    for k in range(s.n_diagonal):
        matrix[diagonal[k]] += cj
    source, target = ints(s.pattern_source, s.n_pattern), ints(s.pattern, s.n_pattern)
    starts_source, starts = ints(s.starts_source, s.n + 1), ints(s.starts, s.n + 1)
    for k in range(s.n + 1 if s.n_pattern > 0 else 0):  # a sparse matrix comes with its pattern cleared as well
        starts[k] = starts_source[k]
    for k in range(s.n_pattern):
        target[k] = source[k]
    return 0


@_inner
def event_values(s: Any, t: float, y: int, g: int) -> Any:
    status = call(s.roots, (t, natural(s, y), g, s.data, s.index))
    values = doubles(g, s.n_roots)
    for k in range(s.n_roots):
        if values[k] == 0.0:
            values[k] = NEGATIVE_ZERO
    return -1 if status != 0 else 0


@_inner
def take_sides(s: Any, t: float) -> Any:
    """Take the signs of the event functions at (t, y) for their sides."""
    if s.n_roots > 0:
        if event_values(s, t, s.y, s.g) != 0:
            return ROOTS_FAILED
        g, sides = doubles(s.g, s.n_roots), ints(s.sides, s.n_roots)
        for k in range(s.n_roots):
            sides[k] = 1 if g[k] > 0.0 else -1
    return 0


@_inner
def turning(s: Any, t: float, y: int, dy: int, g: int) -> None:
    """The second half of the event functions: positive where one of the first half turns away from zero.

    One that keeps its side at both ends of a step, but has left it in between, has an extremum there, at which its slope changes
    sign. IDA locates that, and on the way there the crossing before it. Where the function cannot have left its side, its slope is
    left out: its extrema would cost evaluations.
    """
    if s.attempt_time > s.step_end:
        s.step_begin, s.step_end = s.step_end, s.attempt_time
    h = s.step_end - s.step_begin if s.step_end > s.step_begin else 1e-3 * s.first_guess
    dt = SLOPE_OVER * h
    values, sides, later = doubles(g, 2 * s.n_roots), ints(s.sides, s.n_roots), doubles(s.later, s.n_roots)
    for k in range(s.n_roots):
        values[s.n_roots + k] = NEGATIVE_ZERO
    if t + dt <= t:
        return
    here, slope, ahead = doubles(y, s.n), doubles(dy, s.n), doubles(s.probe, s.n)
    for i in range(s.n):
        ahead[i] = here[i] + dt * slope[i]
    if event_values(s, t + dt, s.probe, s.later) != 0:
        return
    for k in range(s.n_roots):
        rise = sides[k] * (later[k] - values[k]) / dt
        if rise < 0.0 or rise * REACH * h > sides[k] * values[k]:
            values[s.n_roots + k] = rise if rise != 0.0 else NEGATIVE_ZERO


@_callback(_double, _long, _long, _long, _frame)
def roots(t: float, yy: int, yp: int, g: int, user: Any) -> Any:
    """The event functions and what finds pairs of their roots, an ``IDARootFn``.

    None is ever exactly zero, which IDA would set aside until it moves.
    """
    s = carray(user, 1)[0]
    y = call_for_address(s.array_pointer, yy)
    status = event_values(s, s.origin + t, y, g)
    if status == 0:
        turning(s, s.origin + t, y, call_for_address(s.array_pointer, yp), g)
    return status


@_inner
def steps_so_far(s: Any) -> Any:
    call(s.get_steps, (s.mem, s.counter))
    return s.steps + longs(s.counter, 1)[0]


@_inner
def restart(s: Any, t: float) -> Any:
    """Start IDA anew at (t, x) with consistent x' and algebraic unknowns.

    IDA's time begins at zero there. It adds up its steps, and what rounding takes from the sum acts on the solution as if the clock
    were wrong: with t = 0.2 s and 500 000 steps by 1e-13 s. It locates roots to a hundred roundings of its time.
    """
    n = s.n
    s.steps = steps_so_far(s)
    s.restarts += 1
    s.n_rhs += 1
    status = call(s.rhs, (t, natural(s, s.y), s.f, s.data, s.index))
    f, dy, d = doubles(s.f, n), doubles(s.dy, n), doubles(s.differential, n)
    if status != 0 or not all_finite(f, n):
        refuse(s, t, f, n)
        return RHS_FAILED
    order = longs(s.order, n)
    for i in range(n):
        dy[i] = d[i] * f[i if s.order == 0 else order[i]]
    s.origin, s.attempt_time, s.step_begin, s.step_end = t, 0.0, 0.0, 0.0
    s.flag = call(s.reinit, (s.mem, 0.0, s.yy, s.yp))
    if s.flag < 0:
        return s.flag
    if s.n_algebraic > 0:
        s.flag = call(s.calc_ic, (s.mem, _int(IDA_YA_YDP_INIT), s.ic_span))
        s.attempt_time = 0.0
        if s.flag < 0:
            return START_FAILED
        call(s.get_ic, (s.mem, s.yy, s.yp))
    s.first_reach = s.first_guess = 1000.0 * first_step(s, t)  # of which IDA takes a thousandth
    return take_sides(s, t)


@_inner
def next_stop(s: Any) -> Any:
    """The next time event, or the end."""
    if s.next_event < s.n_time_events:
        return min(doubles(s.time_events, s.n_time_events)[s.next_event], s.t_end)
    return s.t_end


@_inner
def first_step(s: Any, t: float) -> Any:
    """A first step after which what the excitation does to x'' is half the tolerance.

    IDA's own first step knows x' only. A model at rest has none, and is stepped over its whole excitation: a sine whose period
    divides the step is never seen.
    """
    n, span = s.n, next_stop(s) - t
    f, probe, d, y, atol = doubles(s.f, n), doubles(s.probe, n), doubles(s.differential, n), doubles(s.y, n), doubles(s.atol, n)
    order = longs(s.order, n)
    x = natural(s, s.y)
    step = span * PROBES[0]
    s.n_rhs += 1 + len(PROBES)
    if call(s.rhs, (t, x, s.f, s.data, s.index)) != 0:
        return step
    for share in PROBES:
        delta = share * span
        if t + delta > t and call(s.rhs, (t + delta, x, s.probe, s.data, s.index)) == 0:
            total = 0.0
            for i in range(n):
                k = i if s.order == 0 else order[i]
                change = probe[k] - f[k]
                if d[i] != 0.0:
                    total += (change / (s.rtol * abs(y[i]) + atol[i])) ** 2
                elif change != 0.0:  # in units unknown
                    step = min(step, span * PROBES[1])
            if total > 0.0 and np.isfinite(total):
                step = min(step, np.sqrt(delta / np.sqrt(total / n)))
    return step


@_inner
def settle(s: Any, t: float, forced: bool) -> Any:
    """Event iteration at t and, where something changed or it is forced, a consistent restart."""
    fired, sides, before = ints(s.fired, s.n_roots), ints(s.sides, s.n_roots), ints(s.before, s.n_roots)
    for _ in range(100):
        if s.update != 0:
            outcome = call(s.update, (t, natural(s, s.y), s.fired, s.data, s.index))
            if outcome < 0:
                return UPDATE_FAILED
            if outcome == 2 and s.order != 0:
                x, y, order = doubles(s.x, s.n), doubles(s.y, s.n), longs(s.order, s.n)
                for i in range(s.n):
                    y[i] = x[order[i]]
            if outcome == 0 and not forced:
                return 0
        elif not forced:
            return 0
        watch = s.n_algebraic > 0 and s.n_roots > 0 and s.update != 0
        if watch:
            if take_sides(s, t) != 0:
                return ROOTS_FAILED
            for k in range(s.n_roots):
                before[k] = sides[k]
        status = restart(s, t)
        if status < 0 or not watch:
            return status
        # The algebraic unknowns jump at an event; what they carry across zero is an event of the same instant.
        flips = 0
        for k in range(s.n_roots):
            fired[k] = sides[k] if sides[k] != before[k] else 0
            flips += sides[k] != before[k]
        if flips == 0:
            return 0
        forced = False
    return UNSETTLED


@_inner
def log_event(s: Any, t: float, root: int) -> None:
    longs(s.event_roots, s.event_capacity)[s.events] = root
    doubles(s.event_times, s.event_capacity)[s.events] = t
    s.events += 1
    times = doubles(s.times, s.n_times)
    while s.sample > 0 and times[s.sample - 1] >= t - s.slack:  # a sample on an event holds the right-hand limit
        s.sample -= 1


@_inner
def happened(s: Any, t: float) -> Any:
    """Handle the events at t: of the event functions that ``fired``."""
    if t - s.burst_start > s.window:
        s.burst_start, s.burst = t, 0
    s.burst += 1
    fired, sides = ints(s.fired, s.n_roots), ints(s.sides, s.n_roots)
    for k in range(s.n_roots):
        if fired[k] != 0:
            sides[k] = fired[k]
            log_event(s, t, k)
    if s.burst > s.burst_limit:
        return CHATTER
    return settle(s, t, False)


@_inner
def located(s: Any, t: float) -> Any:
    """Handle the roots that IDA found at t."""
    call(s.root_info, (s.mem, s.fired))
    fired = ints(s.fired, s.n_roots)
    for k in range(s.n_roots):
        if fired[k] != 0:
            return happened(s, t)
    return 0  # a function has come near to zero, and turns away


@_inner
def just_beyond(s: Any, t: float) -> Any:
    """Handle the event functions that change their sign within rounding of the end, as one does that is meant to do so there."""
    y, dy, ahead = doubles(s.y, s.n), doubles(s.dy, s.n), doubles(s.probe, s.n)
    for i in range(s.n):
        ahead[i] = y[i] + s.slack * dy[i]
    if event_values(s, t + s.slack, s.probe, s.g) != 0:
        return 0
    fired, sides, g, found = ints(s.fired, s.n_roots), ints(s.sides, s.n_roots), doubles(s.g, s.n_roots), False
    for k in range(s.n_roots):
        fired[k] = 0
        if g[k] * sides[k] < 0.0:
            fired[k] = -sides[k]
            found = True
    return happened(s, t) if found else 0


@_inner
def arrived(s: Any, t: float) -> Any:
    """Handle the time event at t."""
    fired = ints(s.fired, s.n_roots)
    for k in range(s.n_roots):
        fired[k] = 0
    log_event(s, t, -1)
    s.next_event += 1
    return settle(s, t, s.update == 0)


@_inner
def record(s: Any) -> None:
    n, row = s.n, s.sample
    y, out = doubles(s.y, n), doubles(s.out + 8 * row * n, n)
    order = longs(s.order, n)
    for i in range(n):
        out[i if s.order == 0 else order[i]] = y[i]
    data, modes = doubles(s.data, s.first_mode + s.n_modes), doubles(s.modes_out + 8 * row * s.n_modes, s.n_modes)
    for k in range(s.n_modes):
        modes[k] = data[s.first_mode + k]
    s.sample += 1


@_callback(_frame)
def drive(user: Any) -> Any:
    """Integrate until all samples are taken, something fails, or Python is needed; call again to go on."""
    s = carray(user, 1)[0]
    times, time_events = doubles(s.times, s.n_times), doubles(s.time_events, s.n_time_events)
    reached = doubles(s.scratch, 1)
    pause_at = min(steps_so_far(s) + CHUNK, s.max_steps)
    if s.started == 0:
        s.started = 1
        status = settle(s, s.t, True)
        if status < 0:
            return status
    while True:
        tiny = 10 * EPS * abs(s.t)
        while s.sample < s.n_times and times[s.sample] <= s.t + tiny:
            record(s)
        if s.sample == s.n_times:
            s.steps = steps_so_far(s)
            return DONE
        if s.events + s.n_roots + 1 > s.event_capacity:
            return LOG_FULL
        if steps_so_far(s) >= pause_at:
            return STEP_LIMIT if pause_at == s.max_steps else PAUSE
        if s.next_event < s.n_time_events and time_events[s.next_event] > s.t_end:
            s.next_event = s.n_time_events
        stop = next_stop(s)
        if s.next_event < s.n_time_events and stop <= s.t + tiny:
            status = arrived(s, s.t)
        else:
            call(s.set_stop, (s.mem, stop - s.origin))
            call(s.set_max_steps, (s.mem, min(CHUNK, s.max_steps)))
            target = min(times[s.sample], stop)
            if s.first_reach > 0.0:
                target = min(target, s.t + max(s.first_reach, 1000 * EPS * abs(s.t)))
                s.first_reach = 0.0
            s.flag = call(s.solve, (s.mem, target - s.origin, s.scratch, s.yy, s.yp, _int(IDA_NORMAL)))
            before = s.t
            status, s.t = 0, s.origin + reached[0]
            if s.flag == IDA_ROOT_RETURN:
                status = located(s, s.t)
            elif s.flag == IDA_TOO_MUCH_WORK:
                status = STALLED if s.t - before <= CHUNK * EPS * abs(s.t) else 0
            elif s.flag < 0:
                status = s.flag
            elif s.next_event < s.n_time_events and target == stop:
                s.t = stop
                status = arrived(s, stop)
            if status >= 0 and s.flag != IDA_ROOT_RETURN and s.n_roots > 0 and s.t >= s.t_end - tiny:
                status = just_beyond(s, s.t)
        if status < 0:
            s.steps = steps_so_far(s)
            return status
