"""Compiled part of the native IDA backend: SUNDIALS callbacks, and the stepper functions for `gearlib.solvers.drive.drive_loop`.

All of it is generic. A model enters through the addresses of its native functions in an `IdaRecord`, which SUNDIALS passes to every
callback as its user data; so this module, which is written in the small language, is compiled once per machine.

IDA's unknowns may be ordered differently from the model's, so that the Jacobian has a narrow band: component i of an ``N_Vector`` is
then state ``order[i]`` of the model.
"""

from __future__ import annotations

import math

from gearlib.compiler.small_language import Prototype, floats, floats_at, int32, int32s_at, ints_at, native
from gearlib.native.layout import MODEL
from gearlib.solvers.drive.drive_loop import FOUND, RHS_FAILED, ROOTS_FAILED, START, STEPPED, TIMED
from gearlib.solvers.ida.ida_stepper import (
    CHUNK,
    EPS,
    NEGATIVE_ZERO,
    PROBES,
    REACH,
    SLOPE_OVER,
    STALLED,
    START_FAILED,
)
from gearlib.solvers.ida.start_matrices import AHEAD, NEWTON_LIMIT, SETTLED
from gearlib.solvers.ida.user_data import IdaRecord

IDA_ONE_STEP, IDA_STOP_RETURN, IDA_ROOT_RETURN, IDA_YA_YDP_INIT = 2, 1, 2, 1

# SUNDIALS functions, keyed by the record fields that hold their addresses.
ARRAY_POINTER = Prototype("int", ("int",))
GET_STEPS = ROOT_INFO = Prototype("int32", ("int", "int"))
GET_IC = Prototype("int32", ("int", "int", "int"))
REINIT = Prototype("int32", ("int", "float", "int", "int"))
CALC_IC = Prototype("int32", ("int", "int32", "float"))
GET_DKY = Prototype("int32", ("int", "float", "int32", "int"))
SET_STOP = Prototype("int32", ("int", "float"))
SOLVE = Prototype("int32", ("int", "float", "int", "int", "int", "int32"))
LS_SETUP = Prototype("int32", ("int", "int"))
LS_SOLVE = Prototype("int32", ("int", "int", "int", "int", "float"))


@native
def array_of(s: IdaRecord, vector: int) -> int:
    """Address of the data of an ``N_Vector``."""
    return ARRAY_POINTER(s.array_pointer, vector)


@native
def is_finite(x: float) -> bool:
    return x * 0.0 == 0.0


@native
def all_finite(values: floats, n: int) -> bool:
    a = b = c = d = 0.0  # NaN and infinity survive multiplication by zero; four accumulators are independent
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
    """Record where the right-hand side (or Jacobian) could not be evaluated, and request a smaller step."""
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
    """Permute states from IDA's order to the model's, by address."""
    if y != x:
        source, target, order = floats_at(y), floats_at(x), ints_at(s.order)
        for i in range(s.n):
            target[i if s.order == 0 else order[i]] = source[i]


@native
def natural(s: IdaRecord, y: int, dy: int) -> int:
    """Address of the states in the model's order, followed by their derivatives if it needs them, from vectors in IDA's order."""
    if s.order == 0 and s.implicit == 0:
        return y
    to_natural(s, y, s.natural)
    if s.implicit != 0:
        to_natural(s, dy, s.natural + 8 * s.n)
    return s.natural


@native
def defect(s: IdaRecord, t: float, y: int, dy: int, r: int) -> int:
    """F(t, x, x') or diag(differential) x' - f(t, x), in IDA's order, stored at an address; t counts from the epoch."""
    n = s.n
    f_address = r if s.order == 0 else s.f
    status = MODEL(s.rhs, s.origin + t, natural(s, y, dy), f_address, s.data, s.index)
    f = floats_at(f_address)
    if status < 0:
        refuse(s, t, f, 0)
        return -1
    if status > 0 or not all_finite(f, n):
        return refuse(s, t, f, n) if all_finite(floats_at(y), n) else 1  # else its iteration went astray after a refusal
    target, rate, d, order = floats_at(r), floats_at(dy), floats_at(s.differential), ints_at(s.order)
    if s.implicit != 0:
        for i in range(n if s.order != 0 else 0):
            target[i] = f[order[i]]
    elif s.order == 0:
        for i in range(n):
            target[i] = d[i] * rate[i] - f[i]
    else:
        for i in range(n):
            target[i] = d[i] * rate[i] - f[order[i]]
    return 0


@native
def residual(t: float, yy: int, yp: int, rr: int, user: int) -> int32:
    """The residual, an ``IDAResFn``."""
    s = IdaRecord(user)
    s.n_rhs += 1
    if t != s.attempt_time:
        s.attempt_time = t
        s.attempts += 1
    return defect(s, s.since + t, array_of(s, yy), array_of(s, yp), array_of(s, rr))


@native
def jacobian_values(s: IdaRecord, t: float, y: int, dy: int) -> int:
    """Evaluate the nonzeros of the model's Jacobian into ``values``."""
    s.n_jac += 1
    status = MODEL(s.jac, s.origin + t, natural(s, y, dy), s.values, s.data, s.index)
    values = floats_at(s.values)
    if status < 0:
        return -1
    if status > 0:
        return refuse(s, t, values, 0)
    for k in range(s.nnz):
        if not is_finite(values[k]):  # a vertical tangent, as of sqrt(x) at zero: Newton's iteration goes without it
            values[k] = 0.0
    return 0


@native
def fill_matrix(s: IdaRecord, of_states: float, of_rates: float) -> None:
    """Fill a cleared matrix: of_rates dF/dx' + dF/dx, with the columns of differential unknowns in the latter scaled by ``of_states``."""
    s.factorised = 1
    values, matrix = floats_at(s.values), floats_at(s.matrix)
    position, diagonal, part = ints_at(s.position), ints_at(s.diagonal), ints_at(s.part)
    sign = 1.0 if s.implicit != 0 else -1.0
    for k in range(s.nnz):
        factor = of_states if part[k] == 0 else (1.0 if part[k] == 1 else of_rates)
        matrix[position[k]] += sign * factor * values[k]
    for k in range(s.n_diagonal):
        matrix[diagonal[k]] += of_rates
    source, target = int32s_at(s.pattern_source), int32s_at(s.pattern)
    starts_source, starts = int32s_at(s.starts_source), int32s_at(s.starts)
    for k in range(s.n + 1 if s.n_pattern > 0 else 0):  # the pattern of a sparse matrix is cleared as well
        starts[k] = starts_source[k]
    for k in range(s.n_pattern):
        target[k] = source[k]


@native
def jacobian(t: float, cj: float, yy: int, yp: int, rr: int, jj: int, user: int, t1: int, t2: int, t3: int) -> int32:
    """cj dF/dx' + dF/dx, an ``IDALsJacFn``: SUNDIALS passes the matrix cleared."""
    s = IdaRecord(user)
    status = jacobian_values(s, s.since + t, array_of(s, yy), array_of(s, yp))
    if status == 0:
        fill_matrix(s, 1.0, cj)
    return status


@native
def event_values(s: IdaRecord, t: float, y: int, dy: int, g: int) -> int:
    status = MODEL(s.roots, s.origin + t, natural(s, y, dy), g, s.data, s.index)
    values = floats_at(g)
    for k in range(s.n_roots):
        if values[k] == 0.0:
            values[k] = NEGATIVE_ZERO
    return -1 if status != 0 else 0


@native
def take_sides(s: IdaRecord, t: float) -> int:
    """Set the sides of the event functions to their signs at (t, y), or just after it where algebraic unknowns were recomputed."""
    if s.n_roots > 0:
        y, dy, ahead = floats_at(s.y), floats_at(s.dy), floats_at(s.probe)
        later = AHEAD * s.slack if s.n_algebraic > 0 else 0.0
        for i in range(s.n):
            ahead[i] = y[i] + later * dy[i]
        if event_values(s, t + later, s.probe, s.dy, s.g) != 0:
            return ROOTS_FAILED
        g, sides = floats_at(s.g), int32s_at(s.sides)
        for k in range(s.n_roots):
            sides[k] = 1 if g[k] > 0.0 else -1
    return 0


@native
def turning(s: IdaRecord, t: float, y: int, dy: int, g: int) -> None:
    """Second half of the event functions: positive where one of the first half turns away from zero.

    A function that keeps its side at both ends of a step but left it in between has an extremum there, where its slope changes sign.
    IDA locates that, and on the way the crossing before it. Slopes are not evaluated where the function cannot have left its side:
    locating its extrema would cost evaluations.
    """
    if s.attempt_time > s.step_end:
        s.step_begin, s.step_end = s.step_end, s.attempt_time
    h = s.step_end - s.step_begin if s.step_end > s.step_begin else 1e-3 * s.first_guess
    dt = max(SLOPE_OVER * h, 64 * EPS * abs(s.origin))  # below the resolution of time a difference quotient is meaningless
    values, sides, later = floats_at(g), int32s_at(s.sides), floats_at(s.later)
    for k in range(s.n_roots):
        values[s.n_roots + k] = NEGATIVE_ZERO
    if t + dt <= t:
        return
    here, slope, ahead = floats_at(y), floats_at(dy), floats_at(s.probe)
    for i in range(s.n):
        ahead[i] = here[i] + dt * slope[i]
    if event_values(s, t + dt, s.probe, dy, s.later) != 0:
        return
    for k in range(s.n_roots):
        rise = sides[k] * (later[k] - values[k]) / dt
        if rise < 0.0 or rise * REACH * h > sides[k] * values[k]:
            values[s.n_roots + k] = rise if rise != 0.0 else NEGATIVE_ZERO


@native
def roots(t: float, yy: int, yp: int, g: int, user: int) -> int32:
    """The event functions and the auxiliary ones for pairs of roots, an ``IDARootFn``.

    None is ever exactly zero, since IDA ignores such a function until it moves.
    """
    s = IdaRecord(user)
    y = array_of(s, yy)
    dy = array_of(s, yp)
    status = event_values(s, s.since + t, y, dy, g)
    if status == 0:
        turning(s, s.since + t, y, dy, g)
    return status


@native
def steps_so_far(s: IdaRecord) -> int:
    GET_STEPS(s.get_steps, s.mem, s.counter)
    return s.earlier + ints_at(s.counter)[0]


@native
def slopes(s: IdaRecord, t: float) -> None:
    """Slopes of the algebraic unknowns, by the matrix that `consistent` left factorised: event functions may depend on them."""
    delta = PROBES[1] * (floats_at(s.stops)[s.stop] - t)
    y, dy, d, change = floats_at(s.y), floats_at(s.dy), floats_at(s.differential), floats_at(s.change)
    now, later, ahead = floats_at(s.between), floats_at(s.defect), floats_at(s.probe)
    s.n_rhs += 2
    if delta <= 0.0 or defect(s, t, s.y, s.dy, s.between) != 0:
        return
    for i in range(s.n):
        ahead[i] = y[i] + delta * d[i] * dy[i]
    if defect(s, t + delta, s.probe, s.dy, s.defect) != 0:
        return
    for i in range(s.n):
        later[i] -= now[i]
    if LS_SOLVE(s.ls_solve, s.linear_solver, s.sun_matrix, s.change_vector, s.defect_vector, 0.0) != 0 or not all_finite(
        change, s.n
    ):
        return
    for i in range(s.n):
        if d[i] == 0.0:
            dy[i] = -change[i] / delta


@native
def consistent(s: IdaRecord, t: float) -> int:
    """Newton's iteration for x' and the algebraic unknowns, with the differential ones fixed: returns zero on convergence.

    ``IDACalcIC`` solves the same equations. It has a single matrix, in which the columns of x' also contain the terms of the
    differential unknowns, and so converges only linearly.
    """
    n, settled = s.n, False
    y, dy, d = floats_at(s.y), floats_at(s.dy), floats_at(s.differential)
    scale, change = floats_at(s.scale), floats_at(s.change)
    y_before, dy_before, matrix = floats_at(s.y_before), floats_at(s.dy_before), floats_at(s.matrix)
    for i in range(n):
        y_before[i], dy_before[i] = y[i], dy[i]
        dy[i] *= d[i]
    for _ in range(NEWTON_LIMIT):
        s.n_rhs += 1
        if defect(s, t, s.y, s.dy, s.defect) != 0 or jacobian_values(s, t, s.y, s.dy) != 0:
            break
        for k in range(s.n_matrix):
            matrix[k] = 0.0
        fill_matrix(s, 0.0, 1.0)
        if LS_SETUP(s.ls_setup, s.linear_solver, s.sun_matrix) != 0:
            break
        if LS_SOLVE(s.ls_solve, s.linear_solver, s.sun_matrix, s.change_vector, s.defect_vector, 0.0) != 0:
            break
        if not all_finite(change, n):
            break
        largest = 0.0
        for i in range(n):
            if d[i] != 0.0:
                dy[i] -= change[i]
                largest = max(largest, abs(change[i]) / (abs(dy[i]) + scale[i]))
            else:
                y[i] -= change[i]
                largest = max(largest, abs(change[i]) / (abs(y[i]) + scale[i]))
        if settled:  # one extra step, which doubles the digits
            slopes(s, t)
            return 0
        settled = largest <= SETTLED
    for i in range(n):
        y[i], dy[i] = y_before[i], dy_before[i]
    return START_FAILED


@native
def restart(s: IdaRecord, t: float) -> int:
    """Restart IDA at (t, x) with consistent x' and algebraic unknowns.

    IDA's time is reset to zero there. It accumulates its steps, and rounding of the sum acts on the solution like an error of the
    clock, as with t = 0.2 s and 500 000 steps of 1e-13 s. It locates roots to a hundred units of rounding of its time.
    """
    n = s.n
    s.earlier = steps_so_far(s)
    s.restarts += 1
    if s.implicit == 0:
        s.n_rhs += 1
        status = MODEL(s.rhs, s.origin + t, natural(s, s.y, s.dy), s.f, s.data, s.index)
        f, dy, d = floats_at(s.f), floats_at(s.dy), floats_at(s.differential)
        if status != 0 or not all_finite(f, n):
            refuse(s, t, f, n if status >= 0 else 0)
            return RHS_FAILED
        order = ints_at(s.order)
        for i in range(n):
            dy[i] = d[i] * f[i if s.order == 0 else order[i]]
    solved = consistent(s, t) == 0 if s.jac != 0 and (s.n_algebraic > 0 or s.implicit != 0) else False
    s.since, s.attempt_time, s.step_begin, s.step_end = t, 0.0, 0.0, 0.0
    flag = REINIT(s.reinit, s.mem, 0.0, s.yy, s.yp)
    if flag < 0:
        return flag
    if not solved and (s.n_algebraic > 0 or s.implicit != 0):
        flag = CALC_IC(s.calc_ic, s.mem, IDA_YA_YDP_INIT, s.ic_span)
        s.attempt_time = 0.0
        if flag < 0:
            return START_FAILED
        GET_IC(s.get_ic, s.mem, s.yy, s.yp)
    step = first_step_of_defect(s, t) if solved else first_step(s, t)
    s.first_reach = s.first_guess = 1000.0 * step  # IDA takes a thousandth of it
    return take_sides(s, t)


@native
def first_step(s: IdaRecord, t: float) -> float:
    """First step size for which the effect of the excitation on x'' is half the tolerance.

    IDA's own choice is based on x' only. For a model at rest, where x' is zero, the first step may skip its whole excitation: a sine
    whose period divides the step goes unnoticed.
    """
    n, span = s.n, floats_at(s.stops)[s.stop] - t
    f, probe, d, y, atol = floats_at(s.f), floats_at(s.probe), floats_at(s.differential), floats_at(s.y), floats_at(s.atol)
    order = ints_at(s.order)
    x = natural(s, s.y, s.dy)
    step = span * PROBES[0]
    if s.implicit != 0:
        return span * PROBES[1]
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
                elif change != 0.0:  # units unknown
                    step = min(step, span * PROBES[1])
            if total > 0.0 and is_finite(total):
                step = min(step, math.sqrt(delta / math.sqrt(total / n)))
    return step


@native
def first_step_of_defect(s: IdaRecord, t: float) -> float:
    """The same after `consistent` has solved for x' and the algebraic unknowns, reusing the matrix that it left factorised."""
    n, span = s.n, floats_at(s.stops)[s.stop] - t
    d, y, atol, change = floats_at(s.differential), floats_at(s.y), floats_at(s.atol), floats_at(s.change)
    now, later = floats_at(s.between), floats_at(s.defect)
    step = span * PROBES[0]
    s.n_rhs += 1 + len(PROBES)
    if defect(s, t, s.y, s.dy, s.between) != 0:
        return step
    for share in PROBES:
        delta = share * span
        if s.origin + (t + delta) > s.origin + t and defect(s, t + delta, s.y, s.dy, s.defect) == 0:
            for i in range(n):
                later[i] -= now[i]
            if LS_SOLVE(s.ls_solve, s.linear_solver, s.sun_matrix, s.change_vector, s.defect_vector, 0.0) != 0:
                return step
            total = 0.0
            for i in range(n):
                weighted = change[i] / (s.rtol * abs(y[i]) + atol[i])
                if d[i] != 0.0:
                    total += weighted**2
                elif abs(weighted) > 1.0:  # driven by time without delay
                    step = min(step, span * PROBES[1])
            if total > 0.0 and is_finite(total):
                step = min(step, math.sqrt(delta / math.sqrt(total / n)))
    return step


@native
def take_states(s: IdaRecord) -> None:
    """Copy the states, in the model's order, for samples and the event iteration."""
    to_natural(s, s.y, s.x)
    if s.implicit != 0:
        to_natural(s, s.dy, s.x + 8 * s.n)
    if s.trace != 0:
        to_natural(s, s.dy, s.rates)
    s.done = steps_so_far(s)


@native
def ida_restart(address: int, changed: int, why: int) -> int32:
    """Restart IDA after a change; returns how many event functions have jumped across zero, which is an event of the same instant."""
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
    take_states(s)
    if s.n_roots == 0 or s.update == 0:
        return 0
    seen = look_beyond(s, s.t) == 0
    now, later, crossed = floats_at(s.later), floats_at(s.g), 0
    for k in range(s.n_roots):
        held = fired[k]  # twice the side that agrees with the relation, see `update_body`
        fired[k] = 0
        # algebraic unknowns jump at an event, and so does what compares discrete variables, even that which has just crossed zero
        jumped = seen and held * now[k] < 0.0 and held * later[k] < 0.0
        if jumped or (watch and sides[k] != before[k]):
            fired[k] = sides[k]
            crossed += 1
        elif held != 0:
            sides[k] = held // 2
    return crossed


@native
def just_beyond(s: IdaRecord, t: float) -> bool:
    """Whether an event function changes sign within rounding of the end of the run, as one that is meant to do so at the end does.

    The states are then those just behind it, so that a run that goes on from here does not meet the event again.
    """
    y, dy, ahead = floats_at(s.y), floats_at(s.dy), floats_at(s.probe)
    for i in range(s.n):
        ahead[i] = y[i] + s.slack * dy[i]
    if event_values(s, t + s.slack, s.probe, s.dy, s.g) != 0:
        return False
    fired, sides, g, found = int32s_at(s.fired), int32s_at(s.sides), floats_at(s.g), False
    for k in range(s.n_roots):
        fired[k] = 0
        if g[k] * sides[k] < 0.0:
            fired[k] = -sides[k]
            found = True
    for i in range(s.n if found else 0):
        y[i] = ahead[i]
    return found


@native
def look_beyond(s: IdaRecord, t: float) -> int:
    """The event functions at (t, y), in ``later``, and beyond rounding of the time, in ``g``."""
    y, dy, ahead = floats_at(s.y), floats_at(s.dy), floats_at(s.probe)
    for i in range(s.n):
        ahead[i] = y[i] + s.slack * dy[i]
    return abs(event_values(s, t, s.y, s.dy, s.later)) + abs(event_values(s, t + s.slack, s.probe, s.dy, s.g))


@native
def see_beyond_rounding(s: IdaRecord, t: float) -> None:
    """Give event functions that are zero but for rounding, just after an event, the side that the motion takes them to.

    Of two functions that are zero together one crosses first, by rounding; the other follows before the first one has left its noise.
    """
    if look_beyond(s, t) != 0:
        return
    fired, sides, now, g, real = int32s_at(s.fired), int32s_at(s.sides), floats_at(s.later), floats_at(s.g), False
    for k in range(s.n_roots):
        side = 1 if g[k] > 0.0 else -1
        if fired[k] * side < 0 or now[k] * side < 0.0:
            fired[k] = side
        real = real or (fired[k] != 0 and fired[k] != sides[k])
    for k in range(s.n_roots if not real else 0):
        fired[k] = 0


@native
def ida_interpolate(address: int, t: float, out: int) -> int32:
    """States at a time within the last step, without effect on IDA's own state."""
    s = IdaRecord(address)
    flag = GET_DKY(s.get_dky, s.mem, t - s.since, 0, s.yd)
    if flag >= 0:
        to_natural(s, s.between, out)
    return flag


@native
def ida_accept(address: int) -> int32:
    """States at the end of the step, in the model's order."""
    take_states(IdaRecord(address))
    return 0


@native
def ida_step(address: int, stop: float) -> int32:
    """One step of IDA, up to an event within it."""
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
        s.from_zero = int(t - s.t <= s.slack)  # then it is no event if it changes nothing
        if s.from_zero != 0:
            see_beyond_rounding(s, t)
        for k in range(s.n_roots):  # not a crossing: a function has come close to zero and turns away
            found = found or fired[k] != 0
    elif s.n_roots > 0 and s.stop == s.n_stops - 1 and s.reached >= stop - tiny:
        found = just_beyond(s, s.reached)
    if not found:
        return STEPPED
    for k in range(s.n_roots):
        if fired[k] != 0:
            sides[k] = fired[k]
    return FOUND
