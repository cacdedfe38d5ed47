"""Explicit Runge-Kutta methods with events, for scenes that are neither stiff nor implicit.

The integration itself is the compiled loop of ``rk_loop``; here the problem is handed to it and its result is made.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.errors import ArgumentError, SolverError
from gearlib.solve.problem import Floats, Problem, Solution

__all__ = ["integrate"]

PATIENCE = 12  # refused evaluations that are borne before a run is said to have left what its states describe
_STEPS_PER_CALL = 20_000  # Python looks after interrupts in between
_EVENTS_AT_FIRST = 256
_ROWS = {5: 7, 8: 16}
_METHODS = {5: "Tsitouras 5(4)", 8: "Dormand-Prince 8(5,3)"}


def integrate(
    problem: Problem,
    times: Floats,
    *,
    rtol: float,
    atol: ArrayLike | None = None,
    order: int = 5,
    detect_stiffness: bool = False,
    max_steps: int = 10_000_000,
    first_step: float | None = None,
    may_leave: bool = False,
) -> Solution:
    """Integrate an explicit problem from ``times[0]`` to ``times[-1]`` with a Runge-Kutta method.

    Parameters
    ----------
    problem
        The initial value problem; all its unknowns must be differential.
    times
        Samples wanted (s), not decreasing. They do not limit the steps: samples come from the dense output.
    rtol
        Relative tolerance of the error of a step.
    atol
        Absolute tolerance, one number or one for each state, in the units of the states; ``rtol * problem.nominal`` if not
        given.
    order
        5 (Tsitouras, dense output of order 4) for coarse tolerances, 8 (Dormand and Prince, dense output of order 7) for fine
        ones: on gear chains it is the faster one from 1e-6 on.
    detect_stiffness
        Stop with the status ``"stiff"`` where the step is limited by the stability of the method and much is left to do.
    max_steps
        Accepted and rejected steps after which to give up.
    first_step
        First step to try (s); estimated if not given.
    may_leave
        Stop with the status ``"left"`` where the right-hand side cannot be evaluated further on.

    Returns
    -------
    Solution
        With a status of ``"stiff"`` or ``"left"`` it holds the samples up to ``t_last``, and ``stats["data"]`` the model's data
        there.

    Raises
    ------
    ArgumentError
        For a bad argument, or a problem with algebraic unknowns.
    SolverError
        Where the right-hand side fails, the step becomes too small, or events chatter.

    References
    ----------
    Ch. Tsitouras, doi:10.1016/j.camwa.2011.06.002; E. Hairer, S. P. Norsett, G. Wanner, doi:10.1007/978-3-540-78862-1.

    Examples
    --------
    A Python function will do for a try: x' = -x.

    >>> import ctypes, types
    >>> import numpy as np
    >>> from gearlib.solve.problem import Problem
    >>> P = ctypes.POINTER
    >>> signature = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[P(ctypes.c_double)] * 3, P(ctypes.c_int64))
    >>> @signature
    ... def decay(t, x, dx, data, index):
    ...     dx[0] = -x[0]
    ...     return 0
    >>> rhs = types.SimpleNamespace(address=ctypes.cast(decay, ctypes.c_void_p).value)
    >>> empty, one = np.empty(0), np.ones(1)
    >>> problem = Problem(rhs, one, empty, np.empty(0, dtype=np.int64), np.array([True]), one)
    >>> solution = integrate(problem, np.array([0.0, 1.0, 2.0]), rtol=1e-9, order=8)
    >>> bool(np.allclose(solution.x[:, 0], np.exp(-solution.t), rtol=1e-8, atol=0))
    True
    """
    times, tolerance = _checked(problem, times, rtol, atol, order)
    from gearlib.solve import rk_loop  # imports numba

    n, n_roots = problem.x0.size, problem.n_roots if problem.roots is not None else 0
    first_mode, last_mode, _ = problem.modes.indices(problem.data.size)
    data, index = np.array(problem.data, dtype=np.float64), np.ascontiguousarray(problem.index, dtype=np.int64)
    x = np.array(problem.x0, dtype=np.float64)
    out_x, out_modes = np.empty((times.size, n)), np.empty((times.size, max(last_mode - first_mode, 0)))
    span = float(times[-1] - times[0])
    clock = np.zeros(rk_loop.CLOCK_SIZE)
    clock[: rk_loop.LAST] = times[0], first_step or 0.0, 0.0, 0.0, span, 0.1 * span
    count = np.zeros(11, dtype=np.int64)
    count[rk_loop.PATIENCE] = PATIENCE if may_leave else -1
    addresses = tuple(0 if f is None else f.address for f in (problem.rhs, problem.roots, problem.update))
    fixed = (
        (*addresses, data.ctypes.data, index.ctypes.data), clock, count, x, np.empty(n), np.empty(n),
        np.zeros((_ROWS[order], n)), np.empty(16), tolerance, float(rtol), times, out_x, out_modes, data, first_mode,
        *_stops(problem.time_events, times), np.zeros((7, n_roots)), np.zeros(n_roots, dtype=np.int32),
        np.zeros(n_roots, dtype=np.int32),
    )  # fmt: skip
    log_t, log_root = np.empty(_EVENTS_AT_FIRST + n_roots), np.empty(_EVENTS_AT_FIRST + n_roots, dtype=np.int64)
    code = rk_loop.MORE
    while code == rk_loop.MORE:
        left = max_steps - int(count[rk_loop.STEPS])
        if left <= 0 and clock[rk_loop.T] < times[-1]:
            raise SolverError(f"gave up {_where(clock, count)}: max_steps is {max_steps}")
        code = rk_loop.advance(order, *fixed, log_t, log_root, max(1, min(_STEPS_PER_CALL, left)), detect_stiffness)
        if log_t.size < count[rk_loop.EVENTS] + n_roots + 2:
            log_t, log_root = np.resize(log_t, 2 * log_t.size), np.resize(log_root, 2 * log_t.size)
    events = int(count[rk_loop.EVENTS])
    left = may_leave and code in (rk_loop.UNDERFLOW, rk_loop.RHS_FAILED)
    if code < 0 and not left:
        more = problem.not_settled(float(clock[rk_loop.T]), x, data) if code == rk_loop.UPDATE_FAILED else ""
        raise SolverError(_complaint(problem, code, _where(clock, count), log_root[max(0, events - 100) : events]) + more)
    samples, status = int(count[rk_loop.SAMPLE]), "left" if left else ("stiff" if code == rk_loop.STIFF else "done")
    stats: dict[str, Any] = {
        "method": _METHODS[order], "order": order, "steps": int(count[rk_loop.STEPS] - count[rk_loop.REJECTED]),
        "rejected": int(count[rk_loop.REJECTED]), "rhs": int(count[rk_loop.RHS]), "events": events,
    }  # fmt: skip
    if status != "done":
        stats["data"] = data
    return Solution(
        t=times[:samples], x=out_x[:samples], modes=out_modes[:samples], status=status,
        t_last=float(clock[rk_loop.T]), x_last=x, event_times=log_t[:events].copy(), event_roots=log_root[:events].copy(),
        stats=stats,
    )  # fmt: skip


def _checked(problem: Problem, times: Floats, rtol: float, atol: ArrayLike | None, order: int) -> tuple[Floats, Floats]:
    """Sample times and absolute tolerances, in the form that the loop needs."""
    if order not in _ROWS:
        raise ArgumentError(f"order is 5 or 8, not {order!r}")
    if not np.all(problem.differential):
        raise ArgumentError("an explicit method cannot solve a problem with algebraic unknowns")
    times = np.array(times, dtype=np.float64)
    if times.ndim != 1 or times.size == 0 or not np.isfinite(times).all() or (times[1:] < times[:-1]).any():
        raise ArgumentError("times must be finite and not decrease, and there must be one at least")
    if not 0.0 < rtol < 1.0:
        raise ArgumentError(f"rtol must lie between 0 and 1, not {rtol!r}")
    tolerance = rtol * problem.nominal if atol is None else np.asarray(atol, dtype=np.float64)
    try:
        tolerance = np.full(problem.x0.shape, tolerance)
    except ValueError:
        raise ArgumentError(f"atol is one number or {problem.x0.size} of them") from None
    if not np.all((tolerance > 0.0) & np.isfinite(tolerance)):
        raise ArgumentError("absolute tolerances must be positive and finite")
    return times, tolerance


def _stops(time_events: Floats, times: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Times to step to exactly: the time events within the span, and the end. The flags tell events from a mere end."""
    if time_events.size == 0:
        return times[-1:].copy(), np.zeros(1, dtype=np.bool_)
    inside = np.unique(time_events[(time_events > times[0]) & (time_events <= times[-1])])
    timed = np.ones(inside.size, dtype=np.bool_)
    if inside.size == 0 or inside[-1] < times[-1]:
        return np.append(inside, times[-1]), np.append(timed, False)
    return inside, timed


def _where(clock: Floats, count: NDArray[np.int64]) -> str:
    from gearlib.solve.rk_loop import REJECTED, STEPS, H, T

    return f"at t = {clock[T]:.9g} s after {count[STEPS]} steps ({count[REJECTED]} rejected, the next of {clock[H]:.1g} s)"


def _complaint(problem: Problem, code: int, where: str, last_roots: NDArray[np.int64]) -> str:
    """What a negative code of the loop means."""
    from gearlib.solve import rk_loop

    if code == rk_loop.UNDERFLOW:
        return f"the step became too small {where}: the solution goes to infinity, jumps, or cannot be evaluated further on"
    if code == rk_loop.CHATTERING:
        names = "; ".join(dict.fromkeys(problem.root_name(int(r)) for r in np.unique(last_roots) if r >= 0))
        return f"events chatter {where}: {rk_loop.CHATTER_EVENTS} of them hardly apart, the last ones of {names}"
    if code == rk_loop.UPDATE_FAILED:
        return f"an event could not be handled {where}"
    return f"the right-hand side cannot be evaluated {where}"
