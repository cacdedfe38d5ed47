"""Requests to IDA and its results, for both backends; errors of IDA in plain words."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from gearlib.arguments import shown
from gearlib.errors import ArgumentError, GearlibError, SolverError, StartError
from gearlib.solvers.ida.iteration_matrix import MatrixPlan, plan
from gearlib.solvers.problem import Floats, Integers, Problem

# IDA controls the error of each step. Over a run the errors add up, most of all on lightly damped vibration, which a backward
# differentiation formula neither damps nor keeps in phase. Measured on chains of 10, 100 and 1000 inertias (25 periods of the
# excitation, rtol 1e-3 to 1e-12), the largest error of a state relative to its largest value is 7 to 1000 times the tolerance
# that IDA is given. With a fiftieth of what the user asks for it is 0.07 to 50 times that (80 at 1e-12 and 1000 inertias, where
# rounding errors rule), for 1.2 to 2.8 times the steps.
SAFETY = 0.02
# Newton's iteration stops at a third of IDA's tolerance. Near rounding errors what it leaves spoils the error estimates (steps
# multiply by three at 1e-12); it is made ten times as exact there. scikit-sundae's interface cannot do that.
TIGHT, NEWTON, NEWTON_TIGHT = 1e-12, 0.33, 0.033
FINEST = 1e-15  # a relative tolerance below a few units of rounding error is refused by IDA

# How a run ends, beside IDA's own return values (-1 to -99): 0 done, and
RHS_FAILED, UPDATE_FAILED, UNSETTLED, CHATTER, STEP_LIMIT, ROOTS_FAILED, START_FAILED = -101, -102, -103, -104, -105, -106, -107
ERROR_TEST = -3  # fails again and again, with ever smaller steps: one of the former
STALLED = -108  # IDA only warns when t + h is no more than t
CHUNK = 1000  # steps after which IDA hands back: for Ctrl-C, and to see whether t still moves
# Where the right-hand side is looked at before the first step, in shares of the time to the next stop: far, near and very near,
# and no simple fractions, so that no periodic excitation returns to its value at all of them.
PROBES = (7.32e-4, 6.18e-7, 4.14e-10)
# A function that turns away from zero may have crossed it twice since the last step. Its slope is taken over a part of the step;
# it matters where the line through value and slope, drawn backwards, meets zero within so many steps.
SLOPE_OVER, REACH = 1e-6, 4.0
BURST = 1000  # so many instants with events within `IdaRequest.window` are chattering


@dataclass(frozen=True)
class IdaRequest:
    """Request to either backend: the problem with sample times, tolerances and matrix storage."""

    problem: Problem
    times: Floats
    rtol: float  # as handed to IDA
    atol: Floats
    full_atol: Floats  # what the caller asked for
    matrix: MatrixPlan
    max_steps: int
    time_events: Floats  # those after the start
    data: Floats  # a copy: events change it
    modes: slice
    patience: int = -1  # refused evaluations after which to give up; negative: never

    def rhs_at(self, t: float, x: Floats) -> Floats:
        """f(t, x), for messages."""
        f, index = np.zeros(len(x)), np.ascontiguousarray(self.problem.index, dtype=np.int64)
        signature = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *(ctypes.c_void_p,) * 4)
        signature(self.problem.rhs.address)(t, x.ctypes.data, f.ctypes.data, self.data.ctypes.data, index.ctypes.data)
        return f

    @property
    def newton(self) -> float:
        """The share of the tolerance that Newton's iteration may leave."""
        return NEWTON_TIGHT if self.rtol < TIGHT else NEWTON

    @property
    def window(self) -> float:
        """Within it, `BURST` events are chattering: a billionth of the run, or what rounding leaves of it."""
        t0, t1 = float(self.times[0]), float(self.times[-1])
        return max(1e-9 * (t1 - t0), 1e6 * float(np.finfo(np.float64).eps) * max(abs(t0), abs(t1)))

    @property
    def slack(self) -> float:
        """How far (s) before an event a sample is still on it: IDA locates a root to a hundred roundings of its step's end."""
        return 200.0 * float(np.finfo(np.float64).eps) * max(abs(float(self.times[0])), abs(float(self.times[-1])))

    @property
    def start_span(self) -> float:
        """The time scale that IDA is told when it looks for consistent values."""
        return 0.01 * float(self.times[-1] - self.times[0]) or 1.0


@dataclass(frozen=True)
class IdaOutcome:
    """Result of either backend; ``steps`` is None where the backend cannot tell."""

    status: int
    t: float
    x: Floats
    modes: Floats
    event_times: Floats
    event_roots: Integers
    rhs: int
    jac: int
    attempts: int
    restarts: int
    steps: int | None = None
    order: int | None = None
    step_size: float | None = None
    worst_state: int = -1  # with the largest error estimate
    bad_time: float | None = None  # where the right-hand side was last refused or not finite
    bad_state: int = -1
    x_failed: Floats | None = None  # where it ended (the start that could not be made consistent), if it failed


def request(
    problem: Problem, times: ArrayLike, rtol: float, atol: ArrayLike | None, max_steps: int, linear_solver: str | None
) -> IdaRequest:
    """Check and complete what the caller of `gearlib.solvers.ida.ida.integrate` gave."""
    t = np.ascontiguousarray(times, dtype=np.float64)
    if t.ndim != 1 or t.size == 0 or not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0):
        raise ArgumentError("times must be finite and strictly increasing, with at least one of them")
    if not 0 < rtol < 1:
        raise ArgumentError(f"rtol must lie between 0 and 1, not {rtol}")
    if max_steps < 1:
        raise ArgumentError(f"max_steps must be at least 1, not {max_steps}")
    if linear_solver not in (None, "dense", "band", "sparse"):
        raise ArgumentError(f"linear_solver must be 'dense', 'band', 'sparse' or None, not {shown(linear_solver)}")
    n = len(problem.x0)
    absolute = np.asarray(rtol * problem.nominal if atol is None else atol, dtype=np.float64)
    if absolute.shape not in ((), (n,)) or not np.all(absolute >= 0) or not np.all(np.isfinite(absolute)):
        raise ArgumentError(f"atol must be a non-negative number, or one for each of the {n} states")
    if not np.all(np.isfinite(problem.x0)):
        raise StartError(f"state {int(np.flatnonzero(~np.isfinite(problem.x0))[0])} starts at a value that is not finite")
    events = np.unique(np.asarray(problem.time_events, dtype=np.float64))
    start, stop, _ = problem.modes.indices(len(problem.data))
    return IdaRequest(
        problem=problem,
        times=t,
        rtol=max(SAFETY * rtol, FINEST),
        atol=np.array(np.broadcast_to(SAFETY * absolute, (n,))),
        full_atol=np.broadcast_to(absolute, (n,)),
        matrix=plan(problem, linear_solver),
        max_steps=min(max_steps, 2**31 - 1),
        time_events=events[events > t[0]],
        data=np.array(problem.data, dtype=np.float64),
        modes=slice(start, max(start, stop)),
    )


def with_less_safety(asked: IdaRequest, state: int) -> IdaRequest | None:
    """The request with all of the absolute tolerance that was asked for in one state; None where it has that.

    A state that passes through zero among large ones carries their rounding, which may be more than a fiftieth of its tolerance.
    """
    if state < 0 or asked.atol[state] >= asked.full_atol[state]:
        return None
    atol = asked.atol.copy()
    atol[state] = asked.full_atol[state]
    return replace(asked, atol=atol, data=np.array(asked.problem.data, dtype=np.float64))


def refused(asked: IdaRequest, outcome: IdaOutcome) -> bool:
    """Whether a run ended where the right-hand side does not exist just ahead, whatever IDA gave up over."""
    near = outcome.bad_time is not None and outcome.bad_time >= outcome.t - 1e-6 * float(asked.times[-1] - asked.times[0])
    return outcome.status in (RHS_FAILED, -8, -9, -12) or (outcome.status in (-3, -4, STALLED) and near)


def failure(asked: IdaRequest, outcome: IdaOutcome) -> GearlibError:
    """The exception that tells why a run ended with a negative status."""
    when = f"at t={outcome.t:.9g}"
    status = outcome.status
    if status in (START_FAILED, -13, -14):
        return _no_start(asked, outcome, when)
    if refused(asked, outcome):
        return SolverError(_not_evaluated(asked, outcome) + asked.problem.blamed(outcome.t, outcome.x_failed, asked.data))
    if status == CHATTER:
        involved = np.unique(outcome.event_roots[outcome.event_times >= outcome.t - asked.window])
        names = "; ".join(dict.fromkeys(asked.problem.root_name(int(k)) for k in involved if k >= 0))
        return SolverError(f"events chatter {when}: more than {BURST} of them within {asked.window:.3g} s, of {names}")
    if status == UPDATE_FAILED:
        x = asked.problem.x0 if outcome.x_failed is None else outcome.x_failed
        return SolverError(f"the event iteration failed {when}{asked.problem.not_settled(outcome.t, x, asked.data)}")
    step = "" if outcome.step_size is None else f" (h={outcome.step_size:.3g})"
    worst = (
        "" if outcome.worst_state < 0 else f"; the error estimate is largest in {asked.problem.state_name(outcome.worst_state)}"
    )
    texts = {
        STEP_LIMIT: f"{asked.max_steps} steps taken without reaching t={asked.times[-1]:.9g}; stopped {when}{step}{worst}",
        UNSETTLED: f"the event iteration does not settle {when}: the algebraic unknowns carry event functions to and fro",
        STALLED: f"the step size became too small {when}{step}: time does not move any more{worst}",
        ROOTS_FAILED: f"the event functions could not be evaluated {when}",
        -2: f"the tolerances are too small for double precision {when}{worst}",
        -3: f"the step size became too small {when}{step}: the error test fails again and again{worst}",
        -4: f"the step size became too small {when}{step}: Newton's iteration does not converge{worst}",
        -6: f"the Jacobian could not be evaluated or factorised {when}",
        -7: f"the linear equations of a step could not be solved {when}",
        -10: f"the event functions could not be evaluated {when}",
        -22: f"a state whose absolute tolerance is zero became zero, or the samples lie too close together, {when}",
    }
    text = texts.get(status, f"IDA failed {when} (its return value: {status})")
    blamed = asked.problem.blamed(outcome.t, outcome.x_failed, asked.data) if status in (-3, -4, STALLED) else ""
    return SolverError(text + blamed)


def _not_evaluated(asked: IdaRequest, outcome: IdaOutcome) -> str:
    bad = outcome.t if outcome.bad_time is None else outcome.bad_time
    until = f"at t={bad:.9g}; integrated until t={outcome.t:.9g}"
    if outcome.bad_state >= 0:
        return f"der({asked.problem.state_name(outcome.bad_state)}) is not finite {until}"
    return f"the right-hand side could not be evaluated {until}"


def _no_start(asked: IdaRequest, outcome: IdaOutcome, when: str) -> GearlibError:
    text = f"no consistent values of the algebraic unknowns were found {when}"
    if outcome.x_failed is not None:
        left = np.where(asked.problem.differential, 0.0, np.abs(asked.rhs_at(outcome.t, outcome.x_failed)))
        text += f"; the residual of equation {int(np.argmax(left))} is {float(left.max()):.3g} at the values tried first"
    return StartError(text) if outcome.t == asked.times[0] else SolverError(text)
