"""Explicit Runge-Kutta methods with events, for scenes that are neither stiff nor implicit.

The integration itself is the compiled loop of ``loop``; here the problem is handed to it and its result is made.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import shown
from gearlib.compiler.instructions import BLOCK
from gearlib.compiler.native_module import native_functions
from gearlib.errors import ArgumentError, SolverError
from gearlib.solvers.problem import Floats, Integers, Problem, Solution, late_start
from gearlib.solvers.rungekutta import loop
from gearlib.solvers.rungekutta.first_step import DAMPED
from gearlib.solvers.rungekutta.record import LoopRecord

__all__ = ["RungeKutta", "integrate"]

PATIENCE = 12  # refused evaluations that are borne before a run is said to have left what its states describe
_STEPS_PER_CALL = 20_000  # Python looks after interrupts in between
_EVENTS_AT_FIRST = 256
_ROWS = {5: (7, 4), 8: (16, 7)}  # stages, and polynomials of the dense output
_METHODS = {5: "Tsitouras 5(4)", 8: "Dormand-Prince 8(5,3)"}


def integrate(
    problem: Problem,
    times: Floats,
    *,
    rtol: float,
    atol: ArrayLike | None = None,
    order: int = 5,
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
    max_steps
        Accepted and rejected steps after which to give up.
    first_step
        First step to try (s); estimated if not given.
    may_leave
        Stop with the status ``"left"`` where the right-hand side cannot be evaluated further on.

    Returns
    -------
    Solution
        With the status ``"left"`` it holds the samples up to ``t_last``, and ``stats["data"]`` the model's data there.

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
    >>> from gearlib.solvers.problem import Problem
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
    stepper = RungeKutta(
        problem, times, rtol=rtol, atol=atol, order=order, max_steps=max_steps, first_step=first_step, may_leave=may_leave
    )
    while stepper.advance() == "more":
        pass
    return stepper.solution()


class RungeKutta:
    """An explicit Runge-Kutta method on its way through a problem; the parameters are those of `integrate`.

    Attributes
    ----------
    status : str
        ``"more"``, ``"done"``, ``"left"``, or ``"stiff"``: stability limits the steps, and `watch` asked to be told so.
    """

    def __init__(
        self, problem: Problem, times: Floats, *, rtol: float, atol: ArrayLike | None = None, order: int = 5,
        max_steps: int = 10_000_000, first_step: float | None = None, may_leave: bool = False,
    ) -> None:  # fmt: skip
        times, tolerance = _checked(problem, times, rtol, atol, order)
        self.problem, self.max_steps, self.may_leave, self.status = problem, max_steps, may_leave, "more"
        self._call = _loop()
        self._run = _prepare(problem, times, order, rtol, tolerance)
        record = self._run.record
        record.h, record.patience = first_step or 0.0, PATIENCE if may_leave else -1
        self.t_end = float(times[-1])

    @property
    def t(self) -> float:
        """Where it is, s."""
        return _now(self._run.record)

    @property
    def x(self) -> Floats:
        """The states there."""
        return self._run.x.copy()

    @property
    def work(self) -> float:
        """What was done so far, ns: estimated from counted operations."""
        record = self._run.record
        return work(self.problem, record.order, record.steps, record.events)

    def watch(self, work_first: float = 0.0) -> None:
        """Look for stiffness, and stop once it limits the steps, after so much more work."""
        record = self._run.record
        steps = math.ceil(min(work_first / work(self.problem, record.order, 1, 0), 1e12))
        record.detect, record.detect_from = 1, record.steps + steps
        record.stiff_steps = record.calm_steps = 0

    @property
    def pace(self) -> float:
        """Seconds of the motion for each nanosecond of work, since stability has limited the steps."""
        record = self._run.record
        done = work(self.problem, record.order, record.steps - record.stiff_first, record.events - record.stiff_events)
        return (record.t - record.stiff_t) / done if done > 0.0 else 0.0

    @property
    def wanted(self) -> float:
        """The step, s, that the tolerance allows, whether or not a time event cuts it short."""
        return self._run.record.h

    @property
    def damped(self) -> bool:
        """Whether what limits the steps is a decay rather than a vibration."""
        record = self._run.record
        return record.products < 0.0 and record.products**2 > (DAMPED * DAMPED) * record.slopes * record.moves

    def advance(self, steps: int = _STEPS_PER_CALL) -> str:
        """Go on by so many steps, or until something happens; returns the status."""
        run, record = self._run, self._run.record
        left = self.max_steps - record.steps
        if left <= 0 and self.t < self.t_end:
            raise SolverError(f"gave up {_where(record)}: max_steps is {self.max_steps}")
        run.make_room()
        record.budget = max(1, min(steps, left))
        code = self._call(ctypes.addressof(record))
        if code >= 0:
            self.status = {loop.DONE: "done", loop.MORE: "more", loop.STIFF: "stiff"}[code]
        elif self.may_leave and code in (loop.UNDERFLOW, loop.RHS_FAILED):
            self.status = "left"
        else:
            self._complain(code)
        return self.status

    def _complain(self, code: int) -> NoReturn:
        problem, run = self.problem, self._run
        more = problem.not_settled(self.t, run.x, run.data) if code == loop.UPDATE_FAILED else ""
        if code in (loop.UNDERFLOW, loop.RHS_FAILED):
            more = problem.blamed(self.t, run.x, run.data)
        raise SolverError(_complaint(problem, code, run) + more)

    def solution(self) -> Solution:
        """What has been found so far."""
        return _solution(self._run, self.status, self.work)


def work(problem: Problem, order: int, steps: int, events: int) -> float:
    """What some steps and events cost, ns: estimated from counted operations (measured for 3 to 200 states)."""
    n, effort = problem.x0.size, problem.effort
    looks = effort.roots if problem.roots is not None else 0.0
    step = 6.0 * effort.rhs + 150.0 + 5.0 * n if order == 5 else 12.0 * effort.rhs + 250.0 + 10.0 * n
    return steps * (step + 2.0 * looks) + events * (effort.rhs + effort.update + 10.0 * looks)


@cache
def _loop() -> Callable[[int], int]:
    """The compiled loop; ctypes releases Python's lock while it runs."""
    functions = native_functions(*loop.MODULES)
    advance: Any = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64)(functions.addresses["advance"])
    return lambda address: int(advance(address))


@dataclass
class _Run:
    """The record that the compiled loop works on, and parts of what it points to."""

    record: LoopRecord
    whole: Floats  # all memory but an event log that has grown
    x: Floats
    data: Floats
    times: Floats
    out: Floats
    modes: Floats
    log_t: Floats
    log_root: Integers

    def make_room(self) -> None:
        """Let the event log grow where it is nearly full."""
        record = self.record
        if record.capacity < record.events + record.n_roots + 2:
            record.capacity = 2 * record.capacity + record.n_roots
            self.log_t, self.log_root = np.resize(self.log_t, record.capacity), np.resize(self.log_root, record.capacity)
            record.log_t, record.log_root = _address(self.log_t), _address(self.log_root)


def _prepare(problem: Problem, times: Floats, order: int, rtol: float, tolerance: Floats) -> _Run:
    """The record of a run, and its memory in one piece: a call of numpy takes as long as some steps of a small model."""
    n, n_times, n_roots = problem.x0.size, times.size, problem.n_roots if problem.roots is not None else 0
    stops, n_timed = _stops(problem.time_events, times)
    origin = late_start(float(times[0]), float(times[-1]))
    first_mode, last_mode, _ = problem.modes.indices(problem.data.size)
    n_modes, size = max(last_mode - first_mode, 0), BLOCK * max(1, -(-n // BLOCK))
    stages, polynomials = _ROWS[order]
    capacity = n_roots + (_EVENTS_AT_FIRST if n_roots or n_timed else 2)
    lengths = {
        "x": size, "x_new": size, "y": size, "k": stages * size, "c": polynomials * size,
        "phases": 16, "g": 7 * n_roots, "side": n_roots,
        "fired": n_roots, "atol": size, "data": problem.data.size, "index": problem.index.size, "stops": stops.size,
        "times": n_times, "out": n_times * n, "modes": n_times * n_modes, "log_t": capacity, "log_root": capacity,
    }  # fmt: skip
    record, whole = LoopRecord(), np.empty(sum(lengths.values()))
    first, at, parts = _address(whole), 0, {}
    for name, length in lengths.items():
        setattr(record, name, first + 8 * at)
        parts[name] = whole[at : at + length]
        at += length
    whole[: (record.atol - first) // 8] = 0.0
    parts["x"][:n], parts["atol"][n:], parts["atol"][:n] = problem.x0, 1.0, tolerance
    parts["data"][:], parts["stops"][:], parts["times"][:] = problem.data, stops - origin, times - origin
    parts["index"].view(np.int64)[:] = problem.index
    record.rhs, record.roots, record.update = (
        0 if f is None else f.address for f in (problem.rhs, problem.roots, problem.update)
    )
    record.order, record.n, record.size, record.n_roots = order, n, size, n_roots
    record.n_times, record.n_stops, record.n_timed, record.capacity = n_times, stops.size, n_timed, capacity
    record.n_modes, record.first_mode = n_modes, first_mode
    record.rtol, record.origin, record.t, record.span = rtol, origin, times[0] - origin, times[-1] - times[0]
    record.h_max = min(0.1 * record.span, problem.longest_step)
    return _Run(
        record, whole, parts["x"][:n], parts["data"], parts["times"], parts["out"].reshape(n_times, n),
        parts["modes"].reshape(n_times, n_modes), parts["log_t"], parts["log_root"].view(np.int64),
    )  # fmt: skip


def _solution(run: _Run, status: str, effort: float) -> Solution:
    record = run.record
    stats: dict[str, Any] = {
        "method": _METHODS[record.order], "order": record.order, "steps": record.steps - record.rejected,
        "rejected": record.rejected, "rhs": record.evaluations, "events": record.events,
        "work": effort,
    }  # fmt: skip
    if status != "done":
        stats["data"] = run.data.copy()
    samples, events = record.sample, record.events
    return Solution(
        t=run.times[:samples], x=run.out[:samples], modes=run.modes[:samples], status=status, t_last=_now(record), x_last=run.x.copy(),
        event_times=record.origin + run.log_t[:events], event_roots=run.log_root[:events].copy(), stats=stats,
    )  # fmt: skip


def _address(array: NDArray[Any]) -> int:
    buffer: Any = array
    return ctypes.addressof(ctypes.c_char.from_buffer(buffer))  # a third of the time of ``array.ctypes.data``


def _checked(problem: Problem, times: Floats, rtol: float, atol: ArrayLike | None, order: int) -> tuple[Floats, Floats]:
    """Sample times and absolute tolerances, in the form that the loop needs."""
    if order not in _ROWS:
        raise ArgumentError(f"order is 5 or 8, not {shown(order)}")
    if not problem.differential.all():
        raise ArgumentError("an explicit method cannot solve a problem with algebraic unknowns")
    times = np.asarray(times, dtype=np.float64)
    sorted_ = times.ndim == 1 and times.size > 0 and bool((times[1:] >= times[:-1]).all())
    if not sorted_ or not math.isfinite(times[0]) or not math.isfinite(times[-1]):
        raise ArgumentError("times must be finite and not decrease, and there must be one at least")
    if not 0.0 < rtol < 1.0:
        raise ArgumentError(f"rtol must lie between 0 and 1, not {shown(rtol)}")
    tolerance = rtol * problem.nominal if atol is None else np.asarray(atol, dtype=np.float64)
    if tolerance.shape not in ((), (1,), problem.x0.shape):
        raise ArgumentError(f"atol is one number or {problem.x0.size} of them")
    if not (tolerance.min() > 0.0 and tolerance.max() < math.inf):
        raise ArgumentError("absolute tolerances must be positive and finite")
    return times, tolerance


def _stops(time_events: Floats, times: Floats) -> tuple[Floats, int]:
    """Times to step to exactly: the time events within the span, and the end. How many of them are time events."""
    if time_events.size == 0:
        return times[-1:], 0
    inside = np.unique(time_events[(time_events > times[0]) & (time_events <= times[-1])])
    if inside.size == 0 or inside[-1] < times[-1]:
        return np.append(inside, times[-1]), inside.size
    return inside, inside.size


def _now(record: LoopRecord) -> float:
    return record.origin + record.t


def _where(record: LoopRecord) -> str:
    return f"at t = {_now(record):.9g} s after {record.steps} steps ({record.rejected} rejected, the next of {record.h:.1g} s)"


def _complaint(problem: Problem, code: int, run: _Run) -> str:
    """What a negative code of the loop means."""
    where = _where(run.record)
    if code == loop.UNDERFLOW:
        return f"the step became too small {where}: the solution goes to infinity, jumps, or cannot be evaluated further on"
    if code == loop.CHATTERING:
        last = np.unique(run.log_root[max(0, run.record.events - 100) : run.record.events])
        names = "; ".join(dict.fromkeys(problem.root_name(int(r)) for r in last if r >= 0))
        return f"events chatter {where}: {loop.CHATTER_EVENTS} of them hardly apart, the last ones of {names}"
    if code == loop.UPDATE_FAILED:
        return f"an event could not be handled {where}"
    return f"the right-hand side cannot be evaluated {where}"
