"""Explicit Runge-Kutta methods with events, for scenes that are neither stiff nor implicit: the stepper of the compiled functions in
``loop``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any
from weakref import proxy

import numpy as np

from gearlib.arguments import shown
from gearlib.compiler.native_module import native_functions
from gearlib.errors import ArgumentError, SolverError
from gearlib.solvers.drive import drive_loop
from gearlib.solvers.drive.driver import PATIENCE, Driver, Stepper, no_further_step
from gearlib.solvers.problem import Floats, Problem
from gearlib.solvers.rungekutta import loop
from gearlib.solvers.rungekutta.first_step import DAMPED
from gearlib.solvers.rungekutta.record import LoopRecord

__all__ = ["RungeKutta"]

_ROWS = {5: (7, 4), 8: (16, 7)}  # stages, and number of dense-output polynomials


class RungeKutta(Stepper):
    """An explicit Runge-Kutta method.

    Parameters
    ----------
    order
        5 (Tsitouras, dense output of order 4) for coarse tolerances, 8 (Dormand and Prince, dense output of order 7) for fine ones: on
        gear chains it is faster from 1e-6 on.
    first_step
        First step size to try (s); estimated if not given.

    Raises
    ------
    ArgumentError
        Any other order, or (in `Driver`) a problem with algebraic unknowns.

    References
    ----------
    Ch. Tsitouras, doi:10.1016/j.camwa.2011.06.002; E. Hairer, S. P. Norsett, G. Wanner, doi:10.1007/978-3-540-78862-1.

    Examples
    --------
    A Python function suffices for a demonstration: x' = -x.

    >>> import ctypes, types
    >>> import numpy as np
    >>> from gearlib.solvers.drive.driver import integrate
    >>> P = ctypes.POINTER
    >>> signature = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[P(ctypes.c_double)] * 3, P(ctypes.c_int64))
    >>> @signature
    ... def decay(t, x, dx, data, index):
    ...     dx[0] = -x[0]
    ...     return 0
    >>> rhs = types.SimpleNamespace(address=ctypes.cast(decay, ctypes.c_void_p).value)
    >>> empty, one, times = np.empty(0), np.ones(1), np.array([0.0, 1.0, 2.0])
    >>> problem = Problem(rhs, one, empty, np.empty(0, dtype=np.int64), np.array([True]), one, times=times, rtol=1e-9)
    >>> solution = integrate(Driver(problem, RungeKutta(order=8)))
    >>> bool(np.allclose(solution.x[:, 0], np.exp(-solution.t), rtol=1e-8, atol=0))
    True
    """

    Record = LoopRecord
    record: LoopRecord

    def __init__(self, order: int = 5, first_step: float | None = None) -> None:
        if order not in _ROWS:
            raise ArgumentError(f"order is 5 or 8, not {shown(order)}")
        self.order, self.first_step = order, first_step

    def memory(self, size: int, n_roots: int) -> dict[str, int]:
        stages, polynomials = _ROWS[self.order]
        return {
            "x_new": size, "y": size, "k": stages * size, "c": polynomials * size, "phases": 16, "g": 7 * n_roots, "side": n_roots,
            "atol": size,
        }  # fmt: skip

    def attach(self, driver: Driver, memory: Callable[[str], Floats]) -> None:
        problem = driver.problem
        if np.count_nonzero(problem.differential) < problem.differential.size:
            raise ArgumentError("an explicit method cannot solve a problem with algebraic unknowns")
        self.driver, self.problem, self.record = proxy(driver), problem, driver.record  # type: ignore[assignment]
        record, n, span = self.record, problem.x0.size, float(problem.times[-1] - problem.times[0])
        atol = memory("atol")
        atol[n:], atol[:n] = 1.0, problem.absolute_tolerance
        record.order, record.size, record.rtol, record.span = self.order, atol.size, problem.rtol, span
        record.h_max, record.h = min(0.1 * span, problem.longest_step), self.first_step or 0.0
        record.patience = PATIENCE if problem.may_leave else -1
        record.slack, record.slack_share = 1e-16 * span, loop.LOCATED
        record.rates = record.k
        record.step, record.interpolate, record.accept, record.restart = _functions()

    def until(self, t: float, longest_step: float) -> None:
        self.record.h_max = longest_step

    @property
    def work(self) -> float:
        return work(self.problem, self.order, self.record.steps, self.record.events - self.driver.events_before)

    def watch(self, work_first: float = 0.0) -> None:
        record = self.record
        steps = math.ceil(min(work_first / work(self.problem, record.order, 1, 0), 1e12))
        record.detect, record.detect_from = 1, record.steps + steps
        record.stiff_steps = record.calm_steps = 0

    @property
    def pace(self) -> float:
        record = self.record
        done = work(self.problem, record.order, record.steps - record.stiff_first, record.events - record.stiff_events)
        return (record.t - record.stiff_t) / done if done > 0.0 else 0.0

    @property
    def wanted(self) -> float:
        """Step size (s) that the tolerance allows, regardless of time events."""
        return self.record.h

    @property
    def damped(self) -> bool:
        record = self.record
        return record.products < 0.0 and record.products**2 > (DAMPED * DAMPED) * record.slopes * record.moves

    def stats(self) -> dict[str, Any]:
        record = self.record
        return {
            "method": f"rk{self.order}", "order": self.order, "steps": record.steps - record.rejected,
            "rejected": record.rejected, "rhs": record.evaluations,
        }  # fmt: skip

    def leaves(self, code: int) -> bool:
        return code == loop.UNDERFLOW or code in drive_loop.EVALUATED

    def failure(self, code: int) -> SolverError:
        record, driver = self.record, self.driver
        where = f"at t = {driver.t:.9g} s after {record.steps} steps ({record.rejected} rejected, the next of {record.h:.1g} s)"
        return no_further_step(driver, where, drive_loop.EVALUATED.get(code))


def work(problem: Problem, order: int, steps: int, events: int) -> float:
    """Estimated cost of steps and events (ns), from counted operations (measured for 3 to 200 states)."""
    n, rhs, look = problem.x0.size, problem.rhs_cost, problem.look_cost
    step = 6.0 * rhs + 150.0 + 5.0 * n if order == 5 else 12.0 * rhs + 250.0 + 10.0 * n
    return steps * (step + 2.0 * look) + events * (rhs + problem.update_cost + 10.0 * look)


def _functions() -> tuple[int, int, int, int]:
    """Addresses of the compiled functions."""
    found = native_functions(*loop.MODULES).addresses
    return found["rk_step"], found["rk_interpolate"], found["rk_accept"], found["rk_restart"]
