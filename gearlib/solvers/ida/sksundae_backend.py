"""IDA backend through scikit-sundae's Python interface; the model's native functions are called through ctypes.

It follows `gearlib.solvers.ida.callbacks` decision by decision, so that both backends take the same steps (except at the tightest
tolerances, where the native one solves Newton's iteration more accurately than scikit-sundae allows). scikit-sundae reports neither the
number of accepted steps nor the state with the largest error, and ignores the return values of its callbacks: a right-hand side that
requests a smaller step returns NaN instead, with which Newton's iteration cannot converge. Its steps end at samples, since it has no
dense output.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from gearlib.errors import SolverError
from gearlib.solvers.drive.drive_loop import FOUND, RHS_FAILED, ROOTS_FAILED, START, STEPPED, TIMED
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.drive.python_stepper import FailedError, PythonStepper
from gearlib.solvers.ida.ida_stepper import (
    CHUNK,
    EPS,
    NEGATIVE_ZERO,
    PROBES,
    REACH,
    SLOPE_OVER,
    STALLED,
    START_FAILED,
    IdaStepper,
)
from gearlib.solvers.ida.start_matrices import AHEAD, NEWTON_LIMIT, SETTLED, SUPPRESSED, WATCHED, start_matrices
from gearlib.solvers.ida.user_data import IdaRecord
from gearlib.solvers.problem import Floats

_ROOT_RETURN, _TOO_MUCH_WORK, _ILL_INPUT = 2, -1, -22
_pointer = ctypes.c_void_p


class SundaeIda(IdaStepper, PythonStepper):
    """IDA through scikit-sundae; its methods mirror the functions of `gearlib.solvers.ida.callbacks`.

    Parameters
    ----------
    reason
        Why this backend is used.
    linear_solver
        As for `IdaStepper`.

    Raises
    ------
    SolverError
        scikit-sundae is not installed.
    """

    record: IdaRecord

    def __init__(self, reason: str, linear_solver: str | None = None) -> None:
        super().__init__(linear_solver)
        self.backend = f"scikit-sundae: {reason}"
        try:
            from sksundae.ida import IDA
        except ImportError as problem:
            raise SolverError("the package scikit-sundae, which brings SUNDIALS, is not installed") from problem
        self._interface = IDA

    def attach(self, driver: Driver, memory: Callable[[str], Floats]) -> None:
        PythonStepper.attach(self, driver, memory)
        IdaStepper.attach(self, driver, memory)
        n, n_roots = driver.x.size, self.record.n_roots
        self.n, self.n_roots, self.algebraic = n, n_roots, np.flatnonzero(self.differential == 0)
        self.implicit = self.problem.implicit
        self.solve: Any = None  # solver for the matrix of x' and the algebraic unknowns
        self.y, self.dy, self.f = driver.x[self.permuted].copy(), np.zeros(n), np.zeros(n)
        self.x = np.zeros(2 * n if self.implicit else n)
        self.values, self.g, self.sides = np.zeros(len(self.matrix.position)), np.zeros(n_roots), np.zeros(n_roots)
        jac = self.problem.jac
        self.jac: Any = (
            None if jac is None else ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *(_pointer,) * 4)(jac.address)
        )
        self.solved_here = self.jac is not None and (self.implicit or len(self.algebraic) > 0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about a sparse pattern being unused where there is a Jacobian
            self.ida = self._interface(self._residual, **self._options())
        if len(self.algebraic) and self.record.update:  # the event iteration depends on algebraic unknowns
            try:
                self._begin(self.record.t)
            except FailedError as failed:
                raise self.failure(int(failed.args[0])) from None
            self.accept()
            self.record.restarts = 0

    @property
    def rates(self) -> Floats:
        return np.asarray(self.dy, np.float64)

    def _options(self) -> dict[str, Any]:
        matrix = self.matrix
        options: dict[str, Any] = {
            "rtol": self.rtol,
            "atol": np.where(self.implicit & (self.differential == 0), SUPPRESSED, 1.0) * self.atol[self.permuted],
            "linsolver": matrix.kind,
            "max_num_steps": CHUNK if self.watch is None else WATCHED,
            "jacfn": self._sparse_jacobian if matrix.pattern is not None else self._full_jacobian,
        }
        if self.jac is None:
            del options["jacfn"]
        if self.problem.longest_step < np.inf:
            options["max_step"] = self.problem.longest_step
        if matrix.kind == "band":
            options |= {"lband": matrix.lower, "uband": matrix.upper}
        if matrix.pattern is not None:
            from scipy.sparse import csc_matrix

            starts, rows = matrix.pattern
            options["sparsity"] = csc_matrix((np.ones(len(rows)), rows, starts), shape=(self.n, self.n))
        if len(self.algebraic):
            options["algebraic_idx"] = self.algebraic.tolist()
        if len(self.algebraic) and not self.solved_here:
            options |= {"calc_initcond": "yp0", "calc_init_dt": self.record.ic_span}
        if self.n_roots:

            def events(t: float, y: Any, dy: Any, g: Any) -> None:
                self._events(t, y, dy)
                g[: self.n_roots] = self.g
                g[self.n_roots :] = self._turning(t, y, dy, g[: self.n_roots])

            functions: Any = events
            functions.direction = [0] * self.n_roots + [1] * self.n_roots
            options |= {"eventsfn": functions, "num_events": 2 * self.n_roots}
        return options

    def _natural(self, y: Any, dy: Any) -> Floats:
        self.x[: self.n][self.permuted] = y
        if self.implicit:
            self.x[self.n :][self.permuted] = dy
        return self.x

    def _refuse(self, t: float, bad_state: int) -> None:
        record = self.record
        record.refused += 1
        record.bad_time, record.bad_state = t, bad_state
        if record.refused == record.patience:
            raise FailedError(RHS_FAILED)

    def _jacobian(self, t: float, y: Any, dy: Any) -> int:
        x, record = self._natural(y, dy), self.record
        return int(self.jac(record.origin + t, x.ctypes.data, self.values.ctypes.data, record.data, record.index))

    def _evaluate(self, t: float, y: Any, dy: Any) -> int:
        """f at (t, y, dy); a positive result requests a smaller step."""
        self.record.n_rhs += 1
        status = self.rhs(t, self._natural(y, dy), self.f)
        wrong = np.flatnonzero(~np.isfinite(self.f))
        if (status != 0 or len(wrong)) and np.isfinite(y).all():  # else IDA went astray after a refusal
            self._refuse(t, int(wrong[0]) if len(wrong) and status >= 0 else -1)
        return status or int(len(wrong) > 0)

    def _residual(self, t: float, y: Any, dy: Any, r: Any) -> None:
        record = self.record
        if t != record.attempt_time:
            record.attempt_time = t
            record.attempts += 1
        status = self._evaluate(t, y, dy)
        if status < 0:
            raise FailedError(-8)
        r[:] = np.nan if status > 0 else self._defect(dy)

    def _defect(self, dy: Any) -> Any:
        """The residual, from the last evaluation."""
        return self.f[self.permuted] if self.implicit else self.differential * dy - self.f[self.permuted]

    def _jacobian_values(self, t: float, y: Any, dy: Any) -> None:
        self.record.n_jac += 1
        status = self._jacobian(t, y, dy)
        if status < 0:
            raise FailedError(-6)
        self.values[~np.isfinite(self.values)] = 0.0  # a vertical tangent, as of sqrt(x) at zero
        if status > 0:
            self._refuse(t, -1)
            self.values[:] = np.nan

    def _full_jacobian(self, t: float, y: Any, dy: Any, r: Any, cj: float, jj: Any) -> None:
        entries, matrix = self._entries(t, y, dy, cj), self.matrix
        jj[matrix.rows, matrix.columns] = 0.0
        if not self.implicit:
            own = np.flatnonzero(self.differential)
            jj[own, own] = cj
        np.add.at(jj, (matrix.rows, matrix.columns), entries)

    def _entries(self, t: float, y: Any, dy: Any, cj: float) -> Any:
        """Contribution of the nonzeros of the model's Jacobian to the iteration matrix."""
        self._jacobian_values(t, y, dy)
        return np.where(self.matrix.part == 2, cj, 1.0) * self.values * (1.0 if self.implicit else -1.0)

    def _sparse_jacobian(self, t: float, y: Any, dy: Any, r: Any, cj: float, jj: Any) -> None:
        entries = self._entries(t, y, dy, cj)
        jj[:] = 0.0
        np.add.at(jj, self.matrix.position, entries)
        jj[self.matrix.diagonal] += cj

    def _events(self, t: float, y: Any, dy: Any) -> None:
        if self.root_values(t, self._natural(y, dy), self.g) != 0:
            raise FailedError(ROOTS_FAILED)
        self.g[self.g == 0.0] = NEGATIVE_ZERO

    def _take_sides(self, t: float) -> None:
        ahead = AHEAD * self.record.slack if len(self.algebraic) else 0.0
        self._events(t + ahead, self.y + ahead * self.dy, self.dy)
        self.sides = np.where(self.g > 0, 1.0, -1.0)

    def _turning(self, t: float, y: Any, dy: Any, values: Any) -> Any:
        record = self.record
        if record.attempt_time > record.step_end:
            record.step_begin, record.step_end = record.step_end, record.attempt_time
        h = record.step_end - record.step_begin if record.step_end > record.step_begin else 1e-3 * record.first_guess
        dt = SLOPE_OVER * h
        if t + dt <= t or self.root_values(t + dt, self._natural(y + dt * dy, dy), self.g) != 0:
            return np.full(self.n_roots, NEGATIVE_ZERO)
        self.g[self.g == 0.0] = NEGATIVE_ZERO
        rise = self.sides * (self.g - values) / dt
        counts = (rise < 0.0) | (rise * REACH * h > self.sides * values)
        return np.where(counts & (rise != 0.0), rise, NEGATIVE_ZERO)

    def restart(self, changed: int, why: int) -> int:
        """Restart IDA after a change; returns how many event functions have jumped across zero, which is an event of the same instant."""
        if changed == 0 and why != START and not (why == TIMED and self.record.update == 0):
            return 0
        self.y = self.driver.x[self.permuted].copy()
        watch = len(self.algebraic) > 0 and self.n_roots > 0 and self.record.update != 0
        if watch:
            self._take_sides(self.record.t)
        before = self.sides
        self._begin(self.record.t)
        self.accept()
        fired, held = self.driver.fired, self.driver.fired.copy()  # twice the sides that agree with the relations
        if not self.n_roots or self.record.update == 0:
            return 0
        now, later = self._beyond(self.record.t, 0.0), self._beyond(self.record.t, self.record.slack)
        jumped = (held * now < 0.0) & (held * later < 0.0)
        jumped |= watch & (self.sides != before)
        fired[:] = np.where(jumped, self.sides, 0)
        self.sides = np.where(~jumped & (held != 0), held // 2, self.sides)
        return int(np.count_nonzero(fired))

    def _begin(self, t: float) -> None:
        record = self.record
        record.restarts += 1
        dy = self.dy
        if not self.implicit:
            if self._evaluate(t, self.y, dy) != 0:
                raise FailedError(RHS_FAILED)
            dy = self.differential * self.f[self.permuted]
        if self.solved_here:
            dy = self._consistent(t, dy * self.differential)
        record.attempt_time = record.step_begin = record.step_end = t
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # scikit-sundae prints SUNDIALS messages
                start = self.ida.init_step(t, self.y, dy)
            self.y, self.dy = start.y, start.yp
        except RuntimeError as problem:  # scikit-sundae gives the reason only as text
            raise FailedError(START_FAILED if "IDACalcIC" in str(problem) else -99) from problem
        record.attempt_time = t
        record.first_reach = record.first_guess = 1000 * self._first_step(t)
        if self.n_roots:
            self._take_sides(t)

    def _first_step(self, t: float) -> float:
        record, f, probe = self.record, np.zeros(self.n), np.zeros(self.n)
        span, x = self._stop - t, self._natural(self.y, self.dy)
        step = span * PROBES[0]
        if self.solved_here:
            return self._first_step_of_defect(t, span)
        record.n_rhs += 1 + len(PROBES)
        if self.rhs(t, x, f) != 0:
            return step
        weight = (self.rtol * np.abs(self.y) + self.atol[self.permuted])[self.differential != 0]
        for delta in span * np.array(PROBES):
            if record.origin + (t + delta) > record.origin + t and self.rhs(t + delta, x, probe) == 0:
                change = (probe - f)[self.permuted]
                # Summed in the same order as in compiled code
                total = float(np.cumsum([0.0, *(change[self.differential != 0] / weight) ** 2])[-1])
                if np.any(change[self.differential == 0] != 0):
                    step = min(step, span * PROBES[1])
                if total > 0 and np.isfinite(total):
                    step = min(step, float(np.sqrt(delta / np.sqrt(total / self.n))))
        return step

    def _consistent(self, t: float, dy: Any) -> Any:
        """Solve for the algebraic unknowns and x', which is returned."""
        from scipy.sparse.linalg import splu

        y, settled = self.y.copy(), False
        scale, own = self.scales[self.permuted], self.differential != 0
        with contextlib.suppress(RuntimeError, ValueError):  # singular or non-finite matrix
            for _ in range(NEWTON_LIMIT):
                if self._evaluate(t, y, dy) != 0:
                    break
                right = self._defect(dy)
                self._jacobian_values(t, y, dy)
                matrix = start_matrices(self.problem, self.values)[0]
                self.solve = splu(matrix[:, self.permuted][self.permuted].tocsc()).solve
                change = self.solve(right)
                if not np.isfinite(change).all():
                    break
                dy, y = dy - change * own, y - change * ~own
                largest = float((np.abs(change) / (np.where(own, np.abs(dy), np.abs(y)) + scale)).max(initial=0.0))
                if settled:
                    self.y = y
                    return self._with_slopes(t, dy)
                settled = largest <= SETTLED
        raise FailedError(START_FAILED)

    def _with_slopes(self, t: float, dy: Any) -> Any:
        """x' including the slopes of the algebraic unknowns."""
        delta = PROBES[1] * (self._stop - t)
        if self._evaluate(t, self.y, dy) == 0 and delta > 0.0:
            now = self._defect(dy).copy()
            if self._evaluate(t + delta, self.y + delta * self.differential * dy, dy) == 0 and self.solve is not None:
                slope = -self.solve(self._defect(dy) - now) / delta
                if np.isfinite(slope).all():
                    return np.where(self.differential == 0, slope, dy)
        return dy

    def _first_step_of_defect(self, t: float, span: float) -> float:
        step, own = span * PROBES[0], self.differential != 0
        self._evaluate(t, self.y, self.dy)
        now, weight = self._defect(self.dy).copy(), self.rtol * np.abs(self.y) + self.atol[self.permuted]
        for delta in span * np.array(PROBES):
            if t + delta > t and self._evaluate(t + delta, self.y, self.dy) == 0 and self.solve is not None:
                weighted = self.solve(self._defect(self.dy) - now) / weight
                if np.any(np.abs(weighted[~own]) > 1.0):
                    step = min(step, span * PROBES[1])
                total = float((weighted[own] ** 2).sum())
                if total > 0 and np.isfinite(total):
                    step = min(step, float(np.sqrt(delta / np.sqrt(total / self.n))))
        return step

    @property
    def _stop(self) -> float:
        """The next time to step to exactly."""
        return float(self.driver.stops[self.record.stop])

    def _beyond(self, t: float, slack: float) -> Any:
        """The event functions shortly after t; nan where they cannot be evaluated."""
        values = np.empty(self.n_roots)
        if self.root_values(t + slack, self._natural(self.y + slack * self.dy, self.dy), values) != 0:
            values[:] = np.nan
        return np.where(values == 0.0, NEGATIVE_ZERO, values)

    def _just_beyond(self, t: float) -> bool:
        fired = self.driver.fired
        fired[:] = np.where(self._beyond(t, self.record.slack) * self.sides < 0, -self.sides, 0)
        if fired.any():  # a run that goes on from here does not meet the event again
            self.y = self.y + self.record.slack * self.dy
        return bool(fired.any())

    def step(self, stop: float) -> int:
        """Step to the next sample, or as far as IDA gets."""
        record = self.record
        tiny = 10 * EPS * abs(record.t)
        record.reached = stop
        if stop <= record.t + tiny:
            return STEPPED
        sample = self.driver.times[record.sample] if record.sample < record.n_times else stop
        target, method = min(float(sample), stop), "normal"
        if record.first_reach > 0:  # IDA takes a thousandth of it
            target, method = min(stop, record.t + max(record.first_reach, 1000 * EPS * abs(record.t))), "onestep"
            record.first_reach = 0.0
        with contextlib.redirect_stdout(io.StringIO()):
            step = self.ida.step(target, method=method, tstop=stop)
        if method == "onestep" and step.status == 0:
            record.reached = record.t  # from here on IDA interpolates; no sample follows the step yet
            return STEPPED
        if step.status == _ILL_INPUT:  # nothing was done: the contents of the step are undefined
            raise FailedError(step.status)
        t = float(step.t)
        self.y, self.dy = step.y, step.yp
        if step.status < 0:
            stalled = step.status == _TOO_MUCH_WORK and t - record.t <= CHUNK * EPS * abs(t)
            if step.status != _TOO_MUCH_WORK or stalled:
                record.t = t
                self.accept()
                raise FailedError(STALLED if stalled else step.status)
        fired, found = self.driver.fired, False
        record.reached = stop if target == stop and step.status >= 0 and step.status != _ROOT_RETURN else t
        if step.status == _ROOT_RETURN:
            fired[:] = step.i_events[-1][: self.n_roots]
            found = bool(fired.any())
            record.from_zero = int(t - record.t <= record.slack)  # no event if it changes nothing
        elif self.n_roots and record.stop == record.n_stops - 1 and record.reached >= stop - tiny:
            found = self._just_beyond(record.reached)
        if found:
            self.sides = np.where(fired != 0, fired, self.sides)
        return FOUND if found else STEPPED

    def accept(self) -> None:
        x = self._natural(self.y, self.dy)
        self.driver.x[:] = x[: self.n]
        if self.implicit:  # behind x, where the event iteration expects it
            ctypes.memmove(self.record.x + 8 * self.n, x[self.n :].ctypes.data, 8 * self.n)

    def interpolate(self, t: float) -> Floats:
        """Never called: no step goes beyond a sample."""
        raise NotImplementedError(t)
