"""IDA backend through scikit-sundae's Python interface; the model's native functions are called through ctypes.

It follows `gearlib.solvers.ida.callbacks` decision by decision, so that both backends take the same steps (but for the tightest
tolerances, where the native one makes Newton's iteration more exact than scikit-sundae lets one ask for). scikit-sundae does
not tell how many steps were accepted nor in which state the error was largest, and ignores what its callbacks return: for a
right-hand side that asks for a smaller step it is given not-a-number, with which Newton's iteration cannot converge.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import io
import warnings
from typing import Any

import numpy as np

from gearlib.errors import SolverError
from gearlib.solvers.ida.ida_request import (
    BURST,
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
    IdaOutcome,
    IdaRequest,
)
from gearlib.solvers.problem import Native

_ROOT_RETURN, _TOO_MUCH_WORK, _ILL_INPUT = 2, -1, -22
_NEGATIVE_ZERO = -1e-300
_pointer = ctypes.c_void_p
EPS = float(np.finfo(np.float64).eps)


class _FailedError(Exception):
    """A callback failed for good; carries the status."""


def run(asked: IdaRequest) -> IdaOutcome:
    """Integrate through scikit-sundae.

    Raises
    ------
    SolverError
        If scikit-sundae is not installed.
    """
    try:
        from sksundae.ida import IDA
    except ImportError as problem:
        raise SolverError("the package scikit-sundae, which brings SUNDIALS, is not installed") from problem
    driver = _Driver(asked, IDA)
    with contextlib.redirect_stdout(io.StringIO()):  # scikit-sundae prints SUNDIALS' messages
        status = driver.drive()
    return driver.outcome(status)


def _function(native: Native | None, third: Any = _pointer) -> Any:
    if native is None:
        return None
    return ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, _pointer, third, _pointer, _pointer)(native.address)


class _Driver:
    """The state of a run; methods mirror the functions of `gearlib.solvers.ida.callbacks`."""

    def __init__(self, asked: IdaRequest, ida: Any) -> None:
        problem, matrix = asked.problem, asked.matrix
        n = len(problem.x0)
        self.asked, self.n = asked, n
        self.n_roots = problem.n_roots if problem.roots is not None else 0
        self.order: Any = slice(None) if matrix.order is None else matrix.order
        self.differential = np.asarray(problem.differential, dtype=np.float64)[self.order]
        self.algebraic = np.flatnonzero(self.differential == 0)
        self.index = np.ascontiguousarray(problem.index, dtype=np.int64)
        self.pointers = (asked.data.ctypes.data, self.index.ctypes.data)
        self.rhs, self.jac = _function(problem.rhs), _function(problem.jac)
        self.root_values, self.update = _function(problem.roots), _function(problem.update)

        self.y, self.x, self.f = np.array(problem.x0, dtype=np.float64)[self.order], np.zeros(n), np.zeros(n)
        self.values, self.g = np.zeros(len(matrix.position)), np.zeros(self.n_roots)
        self.fired, self.sides = np.zeros(self.n_roots, dtype=np.int32), np.zeros(self.n_roots)
        self.out = np.full((len(asked.times), n), np.nan)
        self.modes = np.full((len(asked.times), asked.modes.stop - asked.modes.start), np.nan)
        self.t, self.sample, self.next_event = float(asked.times[0]), 0, 0
        self.burst, self.burst_start = 0, self.t
        self.event_times: list[float] = []
        self.event_roots: list[int] = []
        self.n_rhs = self.n_jac = self.attempts = self.restarts = 0
        self.attempt_time, self.bad_state, self.first_reach, self.first_guess = np.nan, -1, 0.0, 0.0
        self.step_begin = self.step_end = self.t
        self.dy = np.zeros(n)
        self.problem: BaseException | None = None
        self.bad_time: float | None = None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that a sparse pattern with a Jacobian needs no differences
            self.ida = ida(self._guarded(self._residual), **self._options())

    def _options(self) -> dict[str, Any]:
        asked, matrix = self.asked, self.asked.matrix
        options: dict[str, Any] = {
            "rtol": asked.rtol,
            "atol": asked.atol[self.order],
            "linsolver": matrix.kind,
            "max_num_steps": min(CHUNK, asked.max_steps),
            "jacfn": self._guarded(self._sparse_jacobian if matrix.pattern is not None else self._full_jacobian),
        }
        if self.jac is None:
            del options["jacfn"]
        if asked.problem.longest_step < np.inf:
            options["max_step"] = asked.problem.longest_step
        if matrix.kind == "band":
            options |= {"lband": matrix.lower, "uband": matrix.upper}
        if matrix.pattern is not None:
            from scipy.sparse import csc_matrix

            starts, rows = matrix.pattern
            options["sparsity"] = csc_matrix((np.ones(len(rows)), rows, starts), shape=(self.n, self.n))
        if len(self.algebraic):
            options |= {"algebraic_idx": self.algebraic.tolist(), "calc_initcond": "yp0", "calc_init_dt": asked.start_span}
        if self.n_roots:

            def events(t: float, y: Any, dy: Any, g: Any) -> None:
                self._events(t, y)
                g[: self.n_roots] = self.g
                g[self.n_roots :] = self._turning(t, y, dy, g[: self.n_roots])

            functions: Any = self._guarded(events)
            functions.direction = [0] * self.n_roots + [1] * self.n_roots
            options |= {"eventsfn": functions, "num_events": 2 * self.n_roots}
        return options

    def _guarded(self, callback: Any) -> Any:
        """A callback whose exception is kept, lest it is lost on its way through IDA: see `_raise`."""

        @functools.wraps(callback)
        def call(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except BaseException as problem:
                self.problem = self.problem or problem
                raise

        return call

    def _raise(self) -> None:
        if self.problem is not None:
            raise self.problem

    def _natural(self, y: Any) -> int:
        self.x[self.order] = y
        return int(self.x.ctypes.data)

    def _in_natural_order(self) -> Any:
        self._natural(self.y)
        return self.x.copy()

    def _refuse(self, t: float, bad_state: int) -> None:
        self.bad_time, self.bad_state = t, bad_state

    def _evaluate(self, t: float, y: Any) -> int:
        """f at (t, y); a positive result asks for a smaller step."""
        self.n_rhs += 1
        status = int(self.rhs(t, self._natural(y), self.f.ctypes.data, *self.pointers))
        wrong = np.flatnonzero(~np.isfinite(self.f))
        if status != 0 or len(wrong):
            self._refuse(t, int(wrong[0]) if len(wrong) and status >= 0 else -1)
        return status or int(len(wrong) > 0)

    def _residual(self, t: float, y: Any, dy: Any, r: Any) -> None:
        if t != self.attempt_time:
            self.attempt_time = t
            self.attempts += 1
        status = self._evaluate(t, y)
        if status < 0:
            raise _FailedError(-8)
        r[:] = np.nan if status > 0 else self.differential * dy - self.f[self.order]

    def _jacobian_values(self, t: float, y: Any) -> None:
        self.n_jac += 1
        status = self.jac(t, self._natural(y), self.values.ctypes.data, *self.pointers)
        if status < 0:
            raise _FailedError(-6)
        if status > 0 or not np.all(np.isfinite(self.values)):
            self._refuse(t, -1)
            self.values[:] = np.nan

    def _full_jacobian(self, t: float, y: Any, dy: Any, r: Any, cj: float, jj: Any) -> None:
        self._jacobian_values(t, y)
        matrix, own = self.asked.matrix, np.flatnonzero(self.differential)
        jj[own, own] = 0.0
        jj[matrix.rows, matrix.columns] = -self.values
        jj[own, own] += cj

    def _sparse_jacobian(self, t: float, y: Any, dy: Any, r: Any, cj: float, jj: Any) -> None:
        self._jacobian_values(t, y)
        jj[:] = 0.0
        jj[self.asked.matrix.position] = -self.values
        jj[self.asked.matrix.diagonal] += cj

    def _events(self, t: float, y: Any) -> None:
        if self.root_values(t, self._natural(y), self.g.ctypes.data, *self.pointers) != 0:
            raise _FailedError(ROOTS_FAILED)
        self.g[self.g == 0.0] = _NEGATIVE_ZERO

    def _take_sides(self, t: float) -> None:
        self._events(t, self.y)
        self.sides = np.where(self.g > 0, 1.0, -1.0)

    def _turning(self, t: float, y: Any, dy: Any, values: Any) -> Any:
        if self.attempt_time > self.step_end:
            self.step_begin, self.step_end = self.step_end, self.attempt_time
        h = self.step_end - self.step_begin if self.step_end > self.step_begin else 1e-3 * self.first_guess
        dt = SLOPE_OVER * h
        if t + dt <= t or self.root_values(t + dt, self._natural(y + dt * dy), self.g.ctypes.data, *self.pointers) != 0:
            return np.full(self.n_roots, _NEGATIVE_ZERO)
        self.g[self.g == 0.0] = _NEGATIVE_ZERO
        rise = self.sides * (self.g - values) / dt
        counts = (rise < 0.0) | (rise * REACH * h > self.sides * values)
        return np.where(counts & (rise != 0.0), rise, _NEGATIVE_ZERO)

    def _restart(self, t: float) -> None:
        self.restarts += 1
        if self._evaluate(t, self.y) != 0:
            raise _FailedError(RHS_FAILED)
        dy = self.differential * self.f[self.order]
        self.attempt_time = self.step_begin = self.step_end = t
        try:
            start = self.ida.init_step(t, self.y, dy)
            self._raise()
            self.y, self.dy = start.y, start.yp
        except RuntimeError as problem:  # scikit-sundae tells the reason only in words
            raise _FailedError(START_FAILED if "IDACalcIC" in str(problem) else -99) from problem
        self.attempt_time = t
        self.first_reach = self.first_guess = 1000 * self._first_step(t)
        if self.n_roots:
            self._take_sides(t)

    def _next_stop(self) -> float:
        events, end = self.asked.time_events, float(self.asked.times[-1])
        return min(float(events[self.next_event]), end) if self.next_event < len(events) else end

    def _first_step(self, t: float) -> float:
        span, x = self._next_stop() - t, self._natural(self.y)
        step = span * PROBES[0]
        f, probe = np.zeros(self.n), np.zeros(self.n)
        self.n_rhs += 1 + len(PROBES)
        if self.rhs(t, x, f.ctypes.data, *self.pointers) != 0:
            return step
        weight = (self.asked.rtol * np.abs(self.y) + self.asked.atol[self.order])[self.differential != 0]
        for delta in span * np.array(PROBES):
            if t + delta > t and self.rhs(t + delta, x, probe.ctypes.data, *self.pointers) == 0:
                change = (probe - f)[self.order]
                total = float(np.cumsum([0.0, *(change[self.differential != 0] / weight) ** 2])[-1])  # in order, as compiled
                if np.any(change[self.differential == 0] != 0):
                    step = min(step, span * PROBES[1])
                if total > 0 and np.isfinite(total):
                    step = min(step, float(np.sqrt(delta / np.sqrt(total / self.n))))
        return step

    def _settle(self, t: float, forced: bool) -> None:
        for _ in range(100):
            if self.update is not None:
                outcome = self.update(t, self._natural(self.y), self.fired.ctypes.data, *self.pointers)
                if outcome < 0:
                    raise _FailedError(UPDATE_FAILED)
                if outcome == 2:
                    self.y = self.x[self.order].copy()
                if outcome == 0 and not forced:
                    return
            elif not forced:
                return
            watch = len(self.algebraic) > 0 and self.n_roots > 0 and self.update is not None
            if watch:
                self._take_sides(t)
                before = self.sides
            self._restart(t)
            if not watch:
                return
            self.fired[:] = np.where(self.sides == before, 0, self.sides)
            if not self.fired.any():
                return
            forced = False
        raise _FailedError(UNSETTLED)

    def _log(self, t: float, root: int) -> None:
        self.event_times.append(t)
        self.event_roots.append(root)
        while self.sample > 0 and self.asked.times[self.sample - 1] >= t - self.asked.slack:  # as in ``callbacks``
            self.sample -= 1

    def _happened(self, t: float) -> None:
        if t - self.burst_start > self.asked.window:
            self.burst_start, self.burst = t, 0
        self.burst += 1
        for k in np.flatnonzero(self.fired):
            self.sides[k] = self.fired[k]
            self._log(t, int(k))
        if self.burst > BURST:
            raise _FailedError(CHATTER)
        self._settle(t, False)

    def _located(self, t: float, fired: Any) -> None:
        self.fired[:] = fired[: self.n_roots]
        if self.fired.any():
            self._happened(t)

    def _just_beyond(self, t: float) -> None:
        later = t + self.asked.slack
        if self.root_values(later, self._natural(self.y + self.asked.slack * self.dy), self.g.ctypes.data, *self.pointers) == 0:
            self.g[self.g == 0.0] = _NEGATIVE_ZERO
            self.fired[:] = np.where(self.g * self.sides < 0, -self.sides, 0)
            if self.fired.any():
                self._happened(t)

    def _arrived(self, t: float) -> None:
        self.fired[:] = 0
        self._log(t, -1)
        self.next_event += 1
        self._settle(t, self.update is None)

    def _record(self) -> None:
        self.out[self.sample][self.order] = self.y
        self.modes[self.sample] = self.asked.data[self.asked.modes]
        self.sample += 1

    def drive(self) -> int:
        try:
            self._settle(self.t, True)
            while self._advance():
                pass
        except _FailedError as problem:
            return int(problem.args[0])
        return 0

    def _advance(self) -> bool:
        """One sample or event further; False when all samples are taken."""
        times, events = self.asked.times, self.asked.time_events
        tiny = 10 * EPS * abs(self.t)
        while self.sample < len(times) and times[self.sample] <= self.t + tiny:
            self._record()
        if self.sample == len(times):
            return False
        pending = self.next_event < len(events) and events[self.next_event] <= times[-1]
        if not pending:
            self.next_event = len(events)
        stop = self._next_stop()
        if pending and stop <= self.t + tiny:
            self._arrived(self.t)
            return True
        if self.attempts >= self.asked.max_steps:
            raise _FailedError(STEP_LIMIT)
        target, method = min(float(times[self.sample]), stop), "normal"
        if self.first_reach > 0:  # IDA takes a thousandth of it
            target, method = min(stop, self.t + max(self.first_reach, 1000 * EPS * abs(self.t))), "onestep"
            self.first_reach = 0.0
        step = self.ida.step(target, method=method, tstop=stop)
        self._raise()
        if method == "onestep" and step.status == 0:
            return True  # from here on IDA interpolates; no sample is after the step yet
        if step.status == _ILL_INPUT:  # nothing was done: what the step holds is anything
            raise _FailedError(step.status)
        before, self.t, self.y, self.dy = self.t, float(step.t), step.y, step.yp
        if step.status == _TOO_MUCH_WORK:
            if self.t - before <= CHUNK * EPS * abs(self.t):
                raise _FailedError(STALLED)
            return True
        if step.status < 0:
            raise _FailedError(step.status)
        if step.status == _ROOT_RETURN:
            self._located(self.t, step.i_events[-1])
        elif pending and target == stop:
            self.t = stop
            self._arrived(stop)
        if self.n_roots and step.status != _ROOT_RETURN and self.t >= times[-1] - tiny:
            self._just_beyond(self.t)
        return True

    def outcome(self, status: int) -> IdaOutcome:
        return IdaOutcome(
            status=status,
            t=self.t,
            x=self.out,
            modes=self.modes,
            event_times=np.array(self.event_times),
            event_roots=np.array(self.event_roots, dtype=np.int64),
            rhs=self.n_rhs,
            jac=self.n_jac,
            attempts=self.attempts,
            restarts=self.restarts - 1,
            bad_time=self.bad_time,
            bad_state=self.bad_state,
            x_failed=self._in_natural_order() if status < 0 else None,
        )
