"""The compiled half of the IDA road: the callbacks that SUNDIALS calls, and the loop that calls SUNDIALS.

All of it is generic. A model enters by the addresses of its native functions, written into a ``FRAME`` that SUNDIALS hands
back to every callback as its user data; hence this module is compiled once per machine and read from numba's cache afterwards.
Importing it imports numba: only `gearlib.solve.ida` does, when it integrates.

IDA's unknowns may be ordered otherwise than the model's, so that the Jacobian has a narrow band: component i of an ``N_Vector``
is then state ``order[i]`` of the model.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, cfunc, from_dtype, njit, types
from numba.extending import intrinsic

from gearlib.solve.ida_request import CHATTER, RHS_FAILED, ROOTS_FAILED, START_FAILED, STEP_LIMIT, UNSETTLED, UPDATE_FAILED

# How `drive` ends, beside the failures of `ida_request`: all samples taken, back for a breath, event log full.
DONE, PAUSE, LOG_FULL = 0, 1, 2
IDA_NORMAL, IDA_ROOT_RETURN, IDA_TOO_MUCH_WORK, IDA_YA_YDP_INIT = 1, 2, -1, 1
CHUNK = 1000  # steps between two returns to Python, so that Ctrl-C works
NEGATIVE_ZERO = -1e-300  # what an event function that is exactly zero is taken for: zero belongs to the negative side

_addresses = [
    "rhs", "jac", "roots", "update",  # the model
    "array_pointer", "solve", "reinit", "calc_ic", "get_ic", "root_info", "set_stop", "set_max_steps", "get_steps",  # SUNDIALS
    "mem", "yy", "yp",
    "data", "index", "x", "f", "y", "dy", "differential", "order",
    "values", "matrix", "position", "diagonal", "pattern", "pattern_source", "starts", "starts_source",
    "fired", "sides", "g", "times", "out", "modes_out", "time_events", "event_times", "event_roots", "scratch", "counter",
]  # fmt: skip
_integers = [
    "n", "nnz", "n_diagonal", "n_pattern", "n_roots", "n_algebraic", "n_times", "n_time_events", "n_modes", "first_mode",
    "event_capacity", "started", "sample", "next_event", "events", "burst", "burst_limit", "max_steps", "flag",
    "n_rhs", "n_jac", "steps", "attempts", "restarts", "refused", "bad_state",
]  # fmt: skip
_reals = ["t", "t_end", "window", "burst_start", "ic_span", "attempt_time", "bad_time"]

FRAME = np.dtype(
    [(name, np.int64) for name in _addresses + _integers] + [(name, np.float64) for name in _reals],
)
_frame = types.CPointer(from_dtype(FRAME))
_int, _long, _double = types.int32, types.int64, types.float64
EPS = float(np.finfo(np.float64).eps)


@intrinsic
def call(typingctx: Any, address: Any, arguments: Any) -> Any:
    """Call the C function at an address, with a tuple of arguments; it returns an int32."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        count = len(signature.args[1].types)
        values = [builder.extract_value(args[1], i) for i in range(count)]
        function = ir.FunctionType(ir.IntType(32), [value.type for value in values])
        return builder.call(builder.inttoptr(args[0], function.as_pointer()), values)

    return _int(_long, arguments), codegen


@intrinsic
def call_for_address(typingctx: Any, address: Any, argument: Any) -> Any:
    """Call the C function at an address, with one address; it returns an address."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        function = ir.FunctionType(ir.IntType(64), [ir.IntType(64)])
        return builder.call(builder.inttoptr(args[0], function.as_pointer()), [args[1]])

    return _long(_long, _long), codegen


def _cast(target: Any) -> Any:
    @intrinsic
    def cast(typingctx: Any, address: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return types.CPointer(target)(_long), codegen

    return cast


_as_doubles, _as_longs, _as_ints = _cast(_double), _cast(_long), _cast(_int)


@njit
def doubles(address: int, n: int) -> Any:
    return carray(_as_doubles(address), n)


@njit
def longs(address: int, n: int) -> Any:
    return carray(_as_longs(address), n)


@njit
def ints(address: int, n: int) -> Any:
    return carray(_as_ints(address), n)


@njit(fastmath={"reassoc"})
def all_finite(values: Any, n: int) -> bool:
    total = 0.0  # not-a-number and infinity survive a sum of zero times each; reassociation lets it use vectors
    for i in range(n):
        total += values[i] * 0.0
    return bool(total == 0.0)


@njit
def refuse(s: Any, t: float, values: Any, n: int) -> int:
    """Note where the right-hand side (or Jacobian) could not be evaluated, and ask for a smaller step."""
    s.refused += 1
    s.bad_time = t
    s.bad_state = -1
    for i in range(n):
        if not np.isfinite(values[i]):
            s.bad_state = i
            break
    return 1


@njit
def natural(s: Any, y: int) -> int:
    """The address of the states in the model's order, from a vector in IDA's order."""
    if s.order == 0:
        return y
    source, target, order = doubles(y, s.n), doubles(s.x, s.n), longs(s.order, s.n)
    for i in range(s.n):
        target[order[i]] = source[i]
    return s.x  # type: ignore[no-any-return]


@cfunc(_int(_double, _long, _long, _long, _frame), cache=True)
def residual(t: float, yy: int, yp: int, rr: int, user: Any) -> int:
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
    status = call(s.rhs, (t, x, f_address, s.data, s.index))
    f = doubles(f_address, n)
    if status < 0:
        refuse(s, t, f, 0)
        return -1
    if status > 0 or not all_finite(f, n):
        return refuse(s, t, f, n)
    r, dy, d = doubles(r_address, n), doubles(call_for_address(s.array_pointer, yp), n), doubles(s.differential, n)
    if s.order == 0:
        for i in range(n):
            r[i] = d[i] * dy[i] - f[i]
    else:
        order = longs(s.order, n)
        for i in range(n):
            r[i] = d[i] * dy[i] - f[order[i]]
    return 0


@cfunc(_int(_double, _double, _long, _long, _long, _long, _frame, _long, _long, _long), cache=True)
def jacobian(t: float, cj: float, yy: int, yp: int, rr: int, jj: int, user: Any, t1: int, t2: int, t3: int) -> int:
    """cj diag(differential) - df/dx, an ``IDALsJacFn``: SUNDIALS hands the matrix over cleared."""
    s = carray(user, 1)[0]
    s.n_jac += 1
    x = natural(s, call_for_address(s.array_pointer, yy))
    status = call(s.jac, (t, x, s.values, s.data, s.index))
    values = doubles(s.values, s.nnz)
    if status < 0:
        return -1
    if status > 0 or not all_finite(values, s.nnz):
        return refuse(s, t, values, 0)
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


@njit
def event_values(s: Any, t: float, y: int, g: int) -> int:
    status = call(s.roots, (t, natural(s, y), g, s.data, s.index))
    values = doubles(g, s.n_roots)
    for k in range(s.n_roots):
        if values[k] == 0.0:
            values[k] = NEGATIVE_ZERO
    return -1 if status != 0 else 0


@cfunc(_int(_double, _long, _long, _long, _frame), cache=True)
def roots(t: float, yy: int, yp: int, g: int, user: Any) -> int:
    """The event functions, an ``IDARootFn``. None is ever exactly zero, which IDA would set aside until it moves."""
    s = carray(user, 1)[0]
    return event_values(s, t, call_for_address(s.array_pointer, yy), g)  # type: ignore[no-any-return]


@njit
def steps_so_far(s: Any) -> int:
    call(s.get_steps, (s.mem, s.counter))
    return s.steps + longs(s.counter, 1)[0]  # type: ignore[no-any-return]


@njit
def restart(s: Any, t: float) -> int:
    """Start IDA anew at (t, x) with consistent x' and algebraic unknowns."""
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
    s.flag = call(s.reinit, (s.mem, t, s.yy, s.yp))
    s.attempt_time = t
    if s.flag < 0:
        return s.flag  # type: ignore[no-any-return]
    if s.n_algebraic > 0:
        s.flag = call(s.calc_ic, (s.mem, _int(IDA_YA_YDP_INIT), t + s.ic_span))
        s.attempt_time = t
        if s.flag < 0:
            return START_FAILED
        call(s.get_ic, (s.mem, s.yy, s.yp))
    return 0


@njit
def settle(s: Any, t: float, forced: bool) -> int:
    """Event iteration at t and, where something changed or it is forced, a consistent restart."""
    fired, sides, g = ints(s.fired, s.n_roots), ints(s.sides, s.n_roots), doubles(s.g, s.n_roots)
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
            if event_values(s, t, s.y, s.g) != 0:
                return ROOTS_FAILED
            for k in range(s.n_roots):
                sides[k] = 1 if g[k] > 0.0 else -1
        status = restart(s, t)
        if status < 0 or not watch:
            return status  # type: ignore[no-any-return]
        # The algebraic unknowns jump at an event; what they carry across zero is an event of the same instant.
        if event_values(s, t, s.y, s.g) != 0:
            return ROOTS_FAILED
        flips = 0
        for k in range(s.n_roots):
            side = 1 if g[k] > 0.0 else -1
            fired[k] = side if side != sides[k] else 0
            flips += side != sides[k]
        if flips == 0:
            return 0
        forced = False
    return UNSETTLED


@njit
def log_event(s: Any, t: float, root: int) -> None:
    longs(s.event_roots, s.event_capacity)[s.events] = root
    doubles(s.event_times, s.event_capacity)[s.events] = t
    s.events += 1


@njit
def located(s: Any, t: float) -> int:
    """Handle the roots that IDA found at t."""
    if t - s.burst_start > s.window:
        s.burst_start, s.burst = t, 0
    s.burst += 1
    call(s.root_info, (s.mem, s.fired))
    fired = ints(s.fired, s.n_roots)
    for k in range(s.n_roots):
        if fired[k] != 0:
            log_event(s, t, k)
    if s.burst > s.burst_limit:
        return CHATTER
    return settle(s, t, False)  # type: ignore[no-any-return]


@njit
def arrived(s: Any, t: float) -> int:
    """Handle the time event at t."""
    fired = ints(s.fired, s.n_roots)
    for k in range(s.n_roots):
        fired[k] = 0
    log_event(s, t, -1)
    s.next_event += 1
    return settle(s, t, s.update == 0)  # type: ignore[no-any-return]


@njit
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


@cfunc(_int(_frame), cache=True)
def drive(user: Any) -> int:
    """Integrate until all samples are taken, something fails, or Python is needed; call again to go on."""
    s = carray(user, 1)[0]
    times, time_events = doubles(s.times, s.n_times), doubles(s.time_events, s.n_time_events)
    reached = doubles(s.scratch, 1)
    pause_at = min(steps_so_far(s) + CHUNK, s.max_steps)
    if s.started == 0:
        s.started = 1
        status = settle(s, s.t, True)
        if status < 0:
            return status  # type: ignore[no-any-return]
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
        stop = s.t_end
        if s.next_event < s.n_time_events and time_events[s.next_event] <= stop:
            stop = time_events[s.next_event]
        else:
            s.next_event = s.n_time_events
        if s.next_event < s.n_time_events and stop <= s.t + tiny:
            status = arrived(s, s.t)
        else:
            call(s.set_stop, (s.mem, stop))
            call(s.set_max_steps, (s.mem, max(pause_at - steps_so_far(s), 1)))
            target = min(times[s.sample], stop)
            s.flag = call(s.solve, (s.mem, target, s.scratch, s.yy, s.yp, _int(IDA_NORMAL)))
            status, s.t = 0, reached[0]
            if s.flag == IDA_ROOT_RETURN:
                status = located(s, s.t)
            elif s.flag < 0 and s.flag != IDA_TOO_MUCH_WORK:
                status = s.flag
            elif s.next_event < s.n_time_events and target == stop:
                s.t = stop
                status = arrived(s, stop)
        if status < 0:
            s.steps = steps_so_far(s)
            return status  # type: ignore[no-any-return]
