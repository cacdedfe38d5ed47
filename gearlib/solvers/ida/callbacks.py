"""Compiled part of the native IDA backend: SUNDIALS' callbacks, and the steps of `gearlib.solvers.drive.drive_loop`.

All of it is generic. A model enters by the addresses of its native functions, written into an `IdaRecord` that SUNDIALS hands
back to every callback as its user data; hence this module, which is in the small language, is compiled once per machine.

IDA's unknowns may be ordered otherwise than the model's, so that the Jacobian has a narrow band: component i of an ``N_Vector``
is then state ``order[i]`` of the model.
"""

from __future__ import annotations

import math

from gearlib.compiler.small_language import floats, floats_at, int32, int32s_at, ints_at, native
from gearlib.compiler.translate import Prototype
from gearlib.native.layout import MODEL
from gearlib.solvers.drive.drive_loop import FOUND, RHS_FAILED, START, STEPPED, TIMED
from gearlib.solvers.ida.ida_stepper import CHUNK, PROBES, REACH, ROOTS_FAILED, SLOPE_OVER, STALLED, START_FAILED
from gearlib.solvers.ida.user_data import IdaRecord

IDA_ONE_STEP, IDA_STOP_RETURN, IDA_ROOT_RETURN, IDA_YA_YDP_INIT = 2, 1, 2, 1
NEGATIVE_ZERO = -1e-300  # what an event function that is exactly zero is taken for: zero belongs to the negative side

# SUNDIALS' functions, by the fields of the record that hold their addresses.
ARRAY_POINTER = Prototype("int", ("int",))
GET_STEPS = ROOT_INFO = Prototype("int32", ("int", "int"))
GET_IC = Prototype("int32", ("int", "int", "int"))
REINIT = Prototype("int32", ("int", "float", "int", "int"))
CALC_IC = Prototype("int32", ("int", "int32", "float"))
GET_DKY = Prototype("int32", ("int", "float", "int32", "int"))
SET_STOP = Prototype("int32", ("int", "float"))
SOLVE = Prototype("int32", ("int", "float", "int", "int", "int", "int32"))
EPS = 2.220446049250313e-16


@native
def array_of(s: IdaRecord, vector: int) -> int:
    """Address of the numbers of an ``N_Vector``."""
    return ARRAY_POINTER(s.array_pointer, vector)


@native
def is_finite(x: float) -> bool:
    return x * 0.0 == 0.0


@native
def all_finite(values: floats, n: int) -> bool:
    a = b = c = d = 0.0  # not-a-number and infinity survive a sum of zero times each; four sums do not wait for each other
    whole = n - n % 4
    for i in range(0, whole, 4):
        a += values[i] * 0.0
        b += values[i + 1] * 0.0
        c += values[i + 2] * 0.0
        d += values[i + 3] * 0.0
    for i in range(whole, n):
        a += values[i] * 0.0
    return a + b + (c + d) == 0.0


@native
def refuse(s: IdaRecord, t: float, values: floats, n: int) -> int:
    """Note where the right-hand side (or Jacobian) could not be evaluated, and ask for a smaller step."""
    s.refused += 1
    s.bad_time = t
    s.bad_state = -1
    for i in range(n):
        if not is_finite(values[i]):
            s.bad_state = i
            break
    return -1 if s.refused == s.patience else 1


@native
def to_natural(s: IdaRecord, y: int, x: int) -> None:
    """States from IDA's order to the model's, by address."""
    if y != x:
        source, target, order = floats_at(y), floats_at(x), ints_at(s.order)
        for i in range(s.n):
            target[i if s.order == 0 else order[i]] = source[i]


@native
def natural(s: IdaRecord, y: int) -> int:
    """The address of the states in the model's order, from a vector in IDA's order."""
    if s.order == 0:
        return y
    to_natural(s, y, s.natural)
    return s.natural


@native
def residual(t: float, yy: int, yp: int, rr: int, user: int) -> int32:
    """r = diag(differential) x' - f(t, x), an ``IDAResFn``."""
    s = IdaRecord(user)
    s.n_rhs += 1
    if t != s.attempt_time:
        s.attempt_time = t
        s.attempts += 1
    n = s.n
    r_address = array_of(s, rr)
    f_address = r_address if s.order == 0 else s.f
    x = natural(s, array_of(s, yy))
    status = MODEL(s.rhs, s.origin + (s.since + t), x, f_address, s.data, s.index)
    f = floats_at(f_address)
    if status < 0:
        refuse(s, s.since + t, f, 0)
        return -1
    if status > 0 or not all_finite(f, n):
        return refuse(s, s.since + t, f, n)
    r, dy, d = floats_at(r_address), floats_at(array_of(s, yp)), floats_at(s.differential)
    if s.order == 0:
        for i in range(n):
            r[i] = d[i] * dy[i] - f[i]
    else:
        order = ints_at(s.order)
        for i in range(n):
            r[i] = d[i] * dy[i] - f[order[i]]
    return 0


@native
def jacobian(t: float, cj: float, yy: int, yp: int, rr: int, jj: int, user: int, t1: int, t2: int, t3: int) -> int32:
    """cj diag(differential) - df/dx, an ``IDALsJacFn``: SUNDIALS hands the matrix over cleared."""
    s = IdaRecord(user)
    s.n_jac += 1
    x = natural(s, array_of(s, yy))
    status = MODEL(s.jac, s.origin + (s.since + t), x, s.values, s.data, s.index)
    values = floats_at(s.values)
    if status < 0:
        return -1
    if status > 0 or not all_finite(values, s.nnz):
        return refuse(s, s.since + t, values, 0)
    position, diagonal = ints_at(s.position), ints_at(s.diagonal)
    matrix = floats_at(s.matrix)  # the bound is not looked at
    for k in range(s.nnz):
        matrix[position[k]] = -values[k]
    for k in range(s.n_diagonal):
        matrix[diagonal[k]] += cj
    source, target = int32s_at(s.pattern_source), int32s_at(s.pattern)
    starts_source, starts = int32s_at(s.starts_source), int32s_at(s.starts)
    for k in range(s.n + 1 if s.n_pattern > 0 else 0):  # a sparse matrix comes with its pattern cleared as well
        starts[k] = starts_source[k]
    for k in range(s.n_pattern):
        target[k] = source[k]
    return 0


@native
def event_values(s: IdaRecord, t: float, y: int, g: int) -> int:
    status = MODEL(s.roots, s.origin + t, natural(s, y), g, s.data, s.index)
    values = floats_at(g)
    for k in range(s.n_roots):
        if values[k] == 0.0:
            values[k] = NEGATIVE_ZERO
    return -1 if status != 0 else 0


@native
def take_sides(s: IdaRecord, t: float) -> int:
    """Take the signs of the event functions at (t, y) for their sides."""
    if s.n_roots > 0:
        if event_values(s, t, s.y, s.g) != 0:
            return ROOTS_FAILED
        g, sides = floats_at(s.g), int32s_at(s.sides)
        for k in range(s.n_roots):
            sides[k] = 1 if g[k] > 0.0 else -1
    return 0


@native
def turning(s: IdaRecord, t: float, y: int, dy: int, g: int) -> None:
    """The second half of the event functions: positive where one of the first half turns away from zero.

    One that keeps its side at both ends of a step, but has left it in between, has an extremum there, at which its slope changes
    sign. IDA locates that, and on the way there the crossing before it. Where the function cannot have left its side, its slope is
    left out: its extrema would cost evaluations.
    """
    if s.attempt_time > s.step_end:
        s.step_begin, s.step_end = s.step_end, s.attempt_time
    h = s.step_end - s.step_begin if s.step_end > s.step_begin else 1e-3 * s.first_guess
    dt = max(SLOPE_OVER * h, 64 * EPS * abs(s.origin))  # the clock's rounding has no slope
    values, sides, later = floats_at(g), int32s_at(s.sides), floats_at(s.later)
    for k in range(s.n_roots):
        values[s.n_roots + k] = NEGATIVE_ZERO
    if t + dt <= t:
        return
    here, slope, ahead = floats_at(y), floats_at(dy), floats_at(s.probe)
    for i in range(s.n):
        ahead[i] = here[i] + dt * slope[i]
    if event_values(s, t + dt, s.probe, s.later) != 0:
        return
    for k in range(s.n_roots):
        rise = sides[k] * (later[k] - values[k]) / dt
        if rise < 0.0 or rise * REACH * h > sides[k] * values[k]:
            values[s.n_roots + k] = rise if rise != 0.0 else NEGATIVE_ZERO


@native
def roots(t: float, yy: int, yp: int, g: int, user: int) -> int32:
    """The event functions and what finds pairs of their roots, an ``IDARootFn``.

    None is ever exactly zero, which IDA would set aside until it moves.
    """
    s = IdaRecord(user)
    y = array_of(s, yy)
    status = event_values(s, s.since + t, y, g)
    if status == 0:
        turning(s, s.since + t, y, array_of(s, yp), g)
    return status


@native
def steps_so_far(s: IdaRecord) -> int:
    GET_STEPS(s.get_steps, s.mem, s.counter)
    return s.earlier + ints_at(s.counter)[0]


@native
def restart(s: IdaRecord, t: float) -> int:
    """Start IDA anew at (t, x) with consistent x' and algebraic unknowns.

    IDA's time begins at zero there. It adds up its steps, and what rounding takes from the sum acts on the solution as if the clock
    were wrong: with t = 0.2 s and 500 000 steps by 1e-13 s. It locates roots to a hundred roundings of its time.
    """
    n = s.n
    s.earlier = steps_so_far(s)
    s.restarts += 1
    s.n_rhs += 1
    status = MODEL(s.rhs, s.origin + t, natural(s, s.y), s.f, s.data, s.index)
    f, dy, d = floats_at(s.f), floats_at(s.dy), floats_at(s.differential)
    if status != 0 or not all_finite(f, n):
        refuse(s, t, f, n)
        return RHS_FAILED
    order = ints_at(s.order)
    for i in range(n):
        dy[i] = d[i] * f[i if s.order == 0 else order[i]]
    s.since, s.attempt_time, s.step_begin, s.step_end = t, 0.0, 0.0, 0.0
    flag = REINIT(s.reinit, s.mem, 0.0, s.yy, s.yp)
    if flag < 0:
        return flag
    if s.n_algebraic > 0:
        flag = CALC_IC(s.calc_ic, s.mem, IDA_YA_YDP_INIT, s.ic_span)
        s.attempt_time = 0.0
        if flag < 0:
            return START_FAILED
        GET_IC(s.get_ic, s.mem, s.yy, s.yp)
    s.first_reach = s.first_guess = 1000.0 * first_step(s, t)  # of which IDA takes a thousandth
    return take_sides(s, t)


@native
def first_step(s: IdaRecord, t: float) -> float:
    """A first step after which what the excitation does to x'' is half the tolerance.

    IDA's own first step knows x' only. A model at rest has none, and is stepped over its whole excitation: a sine whose period
    divides the step is never seen.
    """
    n, span = s.n, floats_at(s.stops)[s.stop] - t
    f, probe, d, y, atol = floats_at(s.f), floats_at(s.probe), floats_at(s.differential), floats_at(s.y), floats_at(s.atol)
    order = ints_at(s.order)
    x = natural(s, s.y)
    step = span * PROBES[0]
    s.n_rhs += 1 + len(PROBES)
    if MODEL(s.rhs, s.origin + t, x, s.f, s.data, s.index) != 0:
        return step
    for share in PROBES:
        delta = share * span
        if s.origin + (t + delta) > s.origin + t and MODEL(s.rhs, s.origin + (t + delta), x, s.probe, s.data, s.index) == 0:
            total = 0.0
            for i in range(n):
                k = i if s.order == 0 else order[i]
                change = probe[k] - f[k]
                if d[i] != 0.0:
                    total += (change / (s.rtol * abs(y[i]) + atol[i])) ** 2
                elif change != 0.0:  # in units unknown
                    step = min(step, span * PROBES[1])
            if total > 0.0 and is_finite(total):
                step = min(step, math.sqrt(delta / math.sqrt(total / n)))
    return step


@native
def ida_restart(address: int, changed: int, why: int) -> int32:
    """Start IDA anew where something changed; how many event functions the algebraic unknowns carried across zero by it."""
    s = IdaRecord(address)
    if changed == 0 and why != START and not (why == TIMED and s.update == 0):
        return 0
    n, fired, sides, before = s.n, int32s_at(s.fired), int32s_at(s.sides), int32s_at(s.before)
    x, y, order = floats_at(s.x), floats_at(s.y), ints_at(s.order)
    if s.order != 0:
        for i in range(n):
            y[i] = x[order[i]]
    watch = s.n_algebraic > 0 and s.n_roots > 0 and s.update != 0
    if watch:
        if take_sides(s, s.t) != 0:
            return ROOTS_FAILED
        for k in range(s.n_roots):
            before[k] = sides[k]
    status = restart(s, s.t)
    if status < 0:
        return status
    to_natural(s, s.y, s.x)
    crossed = 0
    if watch:  # the algebraic unknowns jump at an event; what they carry across zero is an event of the same instant
        for k in range(s.n_roots):
            fired[k] = sides[k] if sides[k] != before[k] else 0
            crossed += sides[k] != before[k]
    return crossed


@native
def just_beyond(s: IdaRecord, t: float) -> bool:
    """Whether event functions change their sign within rounding of the end, as one does that is meant to do so there."""
    y, dy, ahead = floats_at(s.y), floats_at(s.dy), floats_at(s.probe)
    for i in range(s.n):
        ahead[i] = y[i] + s.slack * dy[i]
    if event_values(s, t + s.slack, s.probe, s.g) != 0:
        return False
    fired, sides, g, found = int32s_at(s.fired), int32s_at(s.sides), floats_at(s.g), False
    for k in range(s.n_roots):
        fired[k] = 0
        if g[k] * sides[k] < 0.0:
            fired[k] = -sides[k]
            found = True
    return found


@native
def ida_interpolate(address: int, t: float, out: int) -> int32:
    """The states at a time within the last step: they have no part in how IDA goes on."""
    s = IdaRecord(address)
    flag = GET_DKY(s.get_dky, s.mem, t - s.since, 0, s.yd)
    if flag >= 0:
        to_natural(s, s.between, out)
    return flag


@native
def take_states(s: IdaRecord) -> None:
    to_natural(s, s.y, s.x)
    s.done = steps_so_far(s)


@native
def ida_accept(address: int) -> int32:
    """The states at the end of the step, in the model's order."""
    take_states(IdaRecord(address))
    return 0


@native
def ida_step(address: int, stop: float) -> int32:
    """One step of IDA, up to an event in it."""
    s = IdaRecord(address)
    tiny = 10 * EPS * abs(s.t)
    s.reached = stop
    if stop <= s.t + tiny:
        return STEPPED
    if s.done >= s.look_at:
        if s.t - s.looked_t <= CHUNK * EPS * abs(s.t):
            return STALLED
        s.looked_t, s.look_at = s.t, s.done + CHUNK
    SET_STOP(s.set_stop, s.mem, stop - s.since)
    target = stop
    if s.first_reach > 0.0:
        target = min(target, s.t + max(s.first_reach, 1000 * EPS * abs(s.t)))
        s.first_reach = 0.0
    flag = SOLVE(s.solve, s.mem, target - s.since, s.scratch, s.yy, s.yp, IDA_ONE_STEP)
    t = s.since + floats_at(s.scratch)[0]
    if flag < 0:
        s.t = t
        take_states(s)
        return flag
    if flag != IDA_STOP_RETURN:
        s.reached = min(t, stop)
    found = False
    fired, sides = int32s_at(s.fired), int32s_at(s.sides)
    if flag == IDA_ROOT_RETURN:
        ROOT_INFO(s.root_info, s.mem, s.fired)
        for k in range(s.n_roots):  # none of these: a function has come near to zero, and turns away
            found = found or fired[k] != 0
    elif s.n_roots > 0 and s.stop == s.n_stops - 1 and s.reached >= stop - tiny:
        found = just_beyond(s, s.reached)
    if not found:
        return STEPPED
    for k in range(s.n_roots):
        if fired[k] != 0:
            sides[k] = fired[k]
    return FOUND
