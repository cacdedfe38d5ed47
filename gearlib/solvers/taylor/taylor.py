"""The Taylor method, for smooth scenes of moderate size: the stepper of the compiled functions in ``taylor_loop``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any
from weakref import proxy

from gearlib.compiler.native_module import native_functions
from gearlib.errors import SolverError
from gearlib.native.series_source import HIGHEST, ROW, TaylorSeries
from gearlib.solvers.drive import drive_loop
from gearlib.solvers.drive.driver import PATIENCE, Driver, Stepper, no_further_step
from gearlib.solvers.problem import Floats
from gearlib.solvers.rungekutta.first_step import DAMPED
from gearlib.solvers.taylor import taylor_loop
from gearlib.solvers.taylor.series_record import SeriesRecord

__all__ = ["Taylor"]

# Measured, ns: an operation of one order, a term of a convolution, a coefficient in dense output and error, the rest of a step
OPERATION, TERM, COEFFICIENT, STEP = 0.08, 1.0, 0.2, 150.0


class Taylor(Stepper):
    """Taylor's method of variable order.

    Parameters
    ----------
    series
        The compiled function for the Taylor coefficients.

    References
    ----------
    A. Jorba, M. Zou, doi:10.1080/10586458.2005.10128904.
    """

    name = "taylor"
    Record = SeriesRecord
    record: SeriesRecord

    def __init__(self, series: TaylorSeries) -> None:
        self.series = series

    def memory(self, size: int, n_roots: int) -> dict[str, int]:
        series = (HIGHEST + 1) * size
        return {
            "x_new": size, "y": size, "k": 2 * size, "c": series, "ahead": series, "g": 7 * n_roots, "side": n_roots, "atol": size,
            "within": size, "rates_within": size, "work": max(1, self.series.rows) * ROW, "norms": HIGHEST + 1, "weights": size,
        }  # fmt: skip

    def attach(self, driver: Driver, memory: Callable[[str], Floats]) -> None:
        problem = driver.problem
        self.driver, self.problem, self.record = proxy(driver), problem, driver.record  # type: ignore[assignment]
        record, n, span = self.record, problem.x0.size, float(problem.times[-1] - problem.times[0])
        atol = memory("atol")
        atol[n:], atol[:n] = 1.0, problem.absolute_tolerance
        record.highest = taylor_loop.SEARCHED if record.n_roots or self.series.branches else HIGHEST
        record.next_order = min(taylor_loop.FIRST, record.highest)
        record.size, record.rtol, record.span = atol.size, problem.rtol, span
        record.h_max = min(span, problem.longest_step if self.series.pulses else problem.longest_expanded_step)
        record.patience = PATIENCE if problem.may_leave else -1
        record.rates = record.k
        record.slack, record.slack_share = 1e-16 * span, taylor_loop.LOCATED
        record.series, record.guarded = self.series.address, int(self.series.guarded)
        record.looks, record.compared = int(self.series.hides), self.series.compared
        record.compared_at = (self.series.rows - self.series.compared) * ROW
        record.cost_order = OPERATION * self.series.sums + COEFFICIENT * atol.size + record.looks * problem.rhs_cost
        record.cost_product = 0.5 * TERM * self.series.products + record.looks * COEFFICIENT * atol.size
        record.cost_step = STEP + problem.rhs_cost + COEFFICIENT * atol.size
        record.step, record.interpolate, record.accept, record.restart, record.motion = _functions()

    def until(self, t: float, longest_step: float) -> None:
        self.record.h_max = longest_step

    @property
    def work(self) -> float:
        record = self.record
        return self._work(record.steps, record.expansions, record.events - self.driver.events_before)

    def _work(self, steps: int, orders: float, events: int) -> float:
        """Estimated cost of steps, of orders of coefficients, and of events (ns), from counted operations."""
        record, problem, mean = self.record, self.problem, orders / max(steps, 1)
        own = steps * (record.cost_step + 2.0 * problem.look_cost) + orders * (record.cost_order + mean * record.cost_product)
        return own + events * (problem.rhs_cost + problem.update_cost + 10.0 * problem.look_cost)

    def watch(self, work_first: float = 0.0) -> None:
        record = self.record
        mean = record.expansions / record.steps if record.steps else taylor_loop.FIRST
        steps = math.ceil(min(work_first / self._work(1, mean, 0), 1e12))
        record.detect, record.detect_from, record.stiff_steps = 1, record.steps + steps, 0

    @property
    def pace(self) -> float:
        record = self.record
        steps, events = record.steps - record.stiff_first, record.events - record.stiff_events
        done = self._work(steps, steps * record.expansions / max(record.steps, 1), events)
        return (record.t - record.stiff_t) / done if done > 0.0 else 0.0

    @property
    def damped(self) -> bool:
        return self.record.cosine < -DAMPED

    def stats(self) -> dict[str, Any]:
        record = self.record
        return {
            "method": self.name, "order": record.order, "steps": record.steps, "rejected": record.rejected, "rhs": record.evaluations,
            "coefficients": record.expansions,
        }  # fmt: skip

    def leaves(self, code: int) -> bool:
        return code in (taylor_loop.UNDERFLOW, taylor_loop.NOT_FINITE, *drive_loop.EVALUATED)

    def failure(self, code: int) -> SolverError:
        record, driver = self.record, self.driver
        where = f"at t = {driver.t:.9g} s after {record.steps} steps"
        if code == taylor_loop.NOT_FINITE:
            text = f"the Taylor coefficients are not finite {where}: a root of zero, or a pole; use method='rk'"
            return SolverError(text + driver.blamed)
        return no_further_step(driver, where, drive_loop.EVALUATED.get(code))


def _functions() -> tuple[int, int, int, int, int]:
    """Addresses of the compiled functions."""
    found = native_functions(*taylor_loop.MODULES).addresses
    return found["taylor_step"], found["rk_interpolate"], found["rk_accept"], found["taylor_restart"], found["taylor_motion"]
