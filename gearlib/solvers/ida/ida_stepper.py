"""`IdaStepper`: the part common to both backends of IDA: tolerances, work counts, error messages."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any
from weakref import proxy

import numpy as np

from gearlib.arguments import shown
from gearlib.errors import ArgumentError, GearlibError, SolverError, StartError
from gearlib.solvers.drive.drive_loop import RHS_FAILED, ROOTS_FAILED
from gearlib.solvers.drive.driver import PATIENCE, Driver, Stepper
from gearlib.solvers.ida.iteration_matrix import plan
from gearlib.solvers.ida.start_matrices import WATCHED, Watch, of_algebraic
from gearlib.solvers.ida.user_data import IdaRecord
from gearlib.solvers.problem import Floats, Problem

# IDA controls the local error of each step. Over a run these errors accumulate, most of all on lightly damped vibration, which a
# backward differentiation formula neither damps nor keeps in phase. Measured on chains of 10, 100 and 1000 inertias (25 periods of the
# excitation, rtol 1e-3 to 1e-12), the global error of a state relative to its largest value is 7 to 1000 times the tolerance passed to
# IDA. With a fiftieth of the user's tolerance it is 0.07 to 50 times the latter (80 at 1e-12 and 1000 inertias, where rounding
# dominates), for 1.2 to 2.8 times as many steps.
SAFETY = 0.02
# Newton's iteration stops at a third of IDA's tolerance. Close to rounding, the remaining error spoils the local error estimates (three
# times as many steps at 1e-12), so it is solved ten times more accurately there. scikit-sundae's interface does not offer that option.
TIGHT, NEWTON, NEWTON_TIGHT = 1e-12, 0.33, 0.033
FINEST = 1e-15  # IDA rejects relative tolerances below a few units of rounding

# Failure codes, besides the driver's and IDA's own return values (-1 to -99)
START_FAILED = -107
ERROR_TEST = -3  # the error test fails repeatedly with ever smaller steps: one of the latter
STALLED = -108  # IDA merely warns when t + h equals t
CHUNK = 1000  # steps between checks that t still advances
# Where the right-hand side is sampled before the first step, as fractions of the time to the next stop: far, near and very near, and
# not simple fractions, so that no periodic excitation returns to its value at all of them.
PROBES = (7.32e-4, 6.18e-7, 4.14e-10)
# A function that turns away from zero may have crossed it twice since the last step. Its slope is taken over a fraction of the step; it
# matters where the tangent, extended backwards, meets zero within this many steps.
SLOPE_OVER, REACH = 1e-6, 4.0


EPS = float(np.finfo(np.float64).eps)
NEGATIVE_ZERO = -1e-300  # value reported for an event function that is exactly zero: zero belongs to the negative side
TRIAL = 100  # steps after which IDA has found its order and step size
START = 0.8e6  # ns, to start IDA (0.5 ms, measured) and to hand back to another method
OPERATION = 0.5  # ns per operation of an elimination


class IdaStepper(Stepper):
    """Common base of the IDA steppers; both backends use the same record fields.

    Parameters
    ----------
    linear_solver
        ``"dense"``, ``"band"`` or ``"sparse"``; by default the cheapest for the sparsity pattern of df/dx.

    Attributes
    ----------
    backend : str
        Name of the backend, with the reason for it.
    """

    Record = IdaRecord
    record: IdaRecord
    backend: str

    def __init__(self, linear_solver: str | None = None) -> None:
        if linear_solver not in (None, "dense", "band", "sparse"):
            raise ArgumentError(f"linear_solver must be 'dense', 'band', 'sparse' or None, not {shown(linear_solver)}")
        self.linear_solver = linear_solver

    def attach(self, driver: Driver, memory: Callable[[str], Floats]) -> None:
        problem, record = driver.problem, driver.record
        self.driver, self.problem, self.record = proxy(driver), problem, record  # type: ignore[assignment]
        n, t0, t1 = problem.x0.size, float(problem.times[0]), float(problem.times[-1])
        self.matrix = plan(problem, self.linear_solver)
        self.permuted: Any = slice(None) if self.matrix.order is None else self.matrix.order
        self.scales, self.full_atol = of_algebraic(problem, np.array(np.broadcast_to(problem.absolute_tolerance, (n,))))
        self.rtol = max(SAFETY * problem.rtol, FINEST)
        self.atol = SAFETY * self.full_atol
        self.differential = np.asarray(problem.differential, dtype=np.float64)[self.permuted]
        self.record.slack = _located(max(abs(t0 - record.origin), abs(t1 - record.origin)))
        self.record.span, self.record.rtol, self.record.ic_span = t1 - t0, self.rtol, 0.01 * (t1 - t0) or 1.0
        self.record.implicit = int(problem.implicit)
        handed = problem.jac is not None and (problem.implicit or not np.all(problem.differential))
        self.watch = Watch(problem) if handed and problem.may_leave else None
        self.looks_every = WATCHED if self.watch is not None else self.looks_every
        self.record.n_algebraic = n - int(np.count_nonzero(self.differential))
        self.record.look_at, self.record.looked_t = CHUNK, record.t
        self.record.patience = PATIENCE if problem.may_leave else -1

    def until(self, t: float, longest_step: float) -> None:
        self.record.slack = _located(abs(t - self.record.origin))

    @property
    def work(self) -> float:
        record = self.record
        return work(
            self.problem, self.matrix.operations(self.problem.x0.size), record.done, record.n_rhs, record.n_jac, record.restarts
        )

    @property
    def rates(self) -> Floats:
        """x' in IDA's order."""
        raise NotImplementedError

    def spent(self) -> bool:
        if self.watch is None:
            return False
        rates = np.zeros(self.problem.x0.size)
        rates[self.permuted] = self.rates
        return self.watch.spent(self.driver.t, self.driver.x, rates, self.driver.data.copy())

    @property
    def newton(self) -> float:
        """Fraction of the tolerance at which Newton's iteration stops."""
        return NEWTON_TIGHT if self.rtol < TIGHT else NEWTON

    def worst_state(self) -> int:
        """The state with the largest local error estimate; -1 where the backend does not know it."""
        return -1

    def step_size(self) -> float | None:
        """Current step size (s); None where the backend does not know it."""
        return None

    def stats(self) -> dict[str, Any]:
        record = self.record
        return {
            "method": "ida", "steps": None, "attempts": record.attempts, "rejected": None, "rhs": record.n_rhs, "jac": record.n_jac,
            "restarts": max(record.restarts - 1, 0), "order": None, "linear_solver": self.matrix.describe(), "backend": self.backend,
        }  # fmt: skip

    def rhs_at(self, t: float, x: Floats) -> Floats:
        """f(t, x), for messages; F(t, x, 0) for an implicit problem."""
        f, record = np.zeros(len(x)), self.record
        x = np.concatenate([x, np.zeros(len(x))])
        signature = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *(ctypes.c_void_p,) * 4)
        signature(record.rhs)(t, x.ctypes.data, f.ctypes.data, record.data, record.index)
        return f

    @property
    def bad_time(self) -> float | None:
        """Time of the last failed or non-finite evaluation of the right-hand side, s."""
        return self.record.origin + self.record.bad_time if self.record.refused > 0 else None

    def leaves(self, code: int) -> bool:
        near = self.bad_time is not None and self.bad_time >= self.driver.t - 1e-6 * self.record.span
        refused = code == -6 and self.record.refused == self.record.patience  # by the Jacobian at last
        return code in (RHS_FAILED, -8, -9, -12) or refused or (code in (-3, -4, STALLED) and near)

    def failure(self, code: int) -> GearlibError:
        when = f"at t={self.driver.t:.9g}"
        if code in (START_FAILED, -13, -14):
            return self._no_start(when)
        if self.leaves(code):
            return SolverError(self._not_evaluated() + self.driver.blamed)
        h, state = self.step_size(), self.worst_state()
        step = "" if h is None else f" (h={h:.3g})"
        worst = "" if state < 0 else f"; the error estimate is largest in {self.problem.state_name(state)}"
        texts = {
            STALLED: f"the step size became too small {when}{step}: time does not move any more{worst}",
            ROOTS_FAILED: f"the event functions could not be evaluated {when}",
            -2: f"the tolerances are too small for double precision {when}{worst}",
            -3: f"the step size became too small {when}{step}: the error test fails again and again{worst}",
            -4: f"the step size became too small {when}{step}: Newton's iteration does not converge{worst}",
            -6: f"the Jacobian could not be evaluated or factorised {when}",
            -7: f"the linear equations of a step could not be solved {when}",
            -22: f"an absolute tolerance is too small to divide by, or times lie too close together, {when}",
            -10: f"the event functions could not be evaluated {when}",
        }
        text = texts.get(code, f"IDA failed {when} (its return value: {code})")
        return SolverError(text + (self.driver.blamed if code in (-3, -4, STALLED) else ""))

    def _not_evaluated(self) -> str:
        t, state = self.driver.t, self.record.bad_state
        until = f"at t={t if self.bad_time is None else self.bad_time:.9g}; integrated until t={t:.9g}"
        if state >= 0:
            return f"{self.problem.equation_name(state)} is not finite {until}"
        return f"the right-hand side could not be evaluated {until}"

    def _no_start(self, when: str) -> GearlibError:
        t, x = self.driver.t, self.driver.x
        left = np.where(self.problem.differential, 0.0, np.abs(self.rhs_at(t, x)))
        text = (
            f"no consistent values of the algebraic unknowns were found {when}; the residual of "
            f"{self.problem.equation_name(int(np.argmax(left)))} is {float(left.max()):.3g} at the values tried first; take form='ode', "
            "which solves for them in turn"
        )
        return StartError(text) if t == self.problem.times[0] else SolverError(text)


def _located(t: float) -> float:
    """Accuracy of IDA's root location at a time (s): a hundred units of rounding of the end of its step."""
    return 200.0 * EPS * t


def work(problem: Problem, operations: tuple[float, float], steps: int, rhs: int, jac: int, restarts: int) -> float:
    """Estimated cost of steps and evaluations (ns), from counted operations (measured for 3 to 200 states)."""
    factorise, solve = operations
    step = 1100.0 + 60.0 * len(problem.x0) + 2.0 * problem.look_cost
    return (
        steps * step + rhs * (problem.rhs_cost + OPERATION * solve) + jac * (problem.jac_cost + OPERATION * factorise)
        + restarts * (800.0 + problem.update_cost + 4.0 * problem.look_cost)
    )  # fmt: skip


def trial(problem: Problem) -> tuple[float, float]:
    """Expected work of start-up, and of `TRIAL` steps (ns), known before IDA is created."""
    return START, TRIAL * (1100.0 + 60.0 * len(problem.x0) + 2.0 * problem.look_cost + 1.3 * problem.rhs_cost)
