"""`ExplicitStepper`: base class of one-step methods in Python; adds events, dense output and statistics to the step formula."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from gearlib.errors import SolverError
from gearlib.solvers.drive.drive_loop import EVALUATED, FOUND, RHS_FAILED, ROOTS_FAILED, ROUNDING, STEPPED
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.drive.python_stepper import FailedError, PythonStepper
from gearlib.solvers.problem import Floats

__all__ = ["ExplicitStepper"]

HALVINGS = 60  # bisections of a step to locate a zero of an event function: down to rounding


class ExplicitStepper(PythonStepper):
    """Base class of explicit one-step methods in Python. A subclass implements `advance`.

    Dense output is the cubic Hermite interpolant of values and slopes at both ends of a step; events are located on it. An event
    function that crosses zero twice within a step goes unnoticed.
    """

    def attach(self, driver: Driver, memory: Callable[[str], Floats]) -> None:
        super().attach(driver, memory)
        self._evaluations = 0
        self._sides = np.zeros(self.record.n_roots)
        self._fired: Floats = self._sides
        self._resting = np.zeros(self.record.n_roots, np.bool_)

    @abstractmethod
    def advance(self, t: float, x: Floats, stop: float) -> tuple[float, Floats]:
        """Time and states after one step from ``(t, x)``, at most up to ``stop``."""

    def f(self, t: float, x: Floats) -> Floats:
        """Right-hand side: derivatives of the states."""
        self._evaluations += 1
        out = np.empty(len(x))
        if self.rhs(t, np.ascontiguousarray(x), out) != 0 or not np.isfinite(out).all():
            raise FailedError(RHS_FAILED)
        return out

    def _event_functions(self, t: float, x: Floats) -> Floats:
        g = np.empty(len(self._sides))
        if self.root_values(t, np.ascontiguousarray(x), g) != 0:
            raise FailedError(ROOTS_FAILED)
        return g

    def _crossed(self, t: float, x: Floats) -> Floats:
        """Directions in which event functions have crossed zero."""
        g = self._event_functions(t, x)
        left = (g * self._sides < 0.0) | (self._resting & (g == 0.0))
        directions: Floats = np.where(left, -self._sides, np.where(self._sides == 0.0, np.sign(g), 0.0))
        return directions

    def restart(self, changed: int, why: int) -> int:
        self._t, self._x = self.record.t, self.driver.x.copy()
        self._slope = self.f(self._t, self._x)
        g = self._event_functions(self._t, self._x)
        fired = self.driver.fired  # the side of each event function, where the event iteration determines it
        told = np.where(np.abs(fired) == 2, fired // 2, 0)
        self._sides = np.where(told != 0, told, np.sign(g))
        if not (g * told < 0.0).any():
            return 0
        # what is on the other side beyond rounding of the time, too, has jumped: an event of the same instant
        ahead = 25.0 * ROUNDING * max(abs(self.record.origin + self._t), float(np.ptp(self.driver.times)))
        later = self._event_functions(self._t + ahead, self._x + ahead * self._slope)
        fired[:] = np.where((g * told < 0.0) & (later * told < 0.0), -told, 0)
        return int(np.count_nonzero(fired))

    def step(self, stop: float) -> int:
        t, record = self._t, self.record
        end, x = self.advance(t, self._x, stop)
        if stop - end <= 4e-16 * abs(stop):
            end = stop
        self._ends = end, x, self.f(end, x)
        self._reached = end, x
        record.reached = end
        if len(self._sides):  # what comes to rest at zero is no longer positive there
            later = end + 25.0 * ROUNDING * abs(record.origin + end)
            still = (self._event_functions(end, x) == 0.0) & (
                self._event_functions(later, x + (later - end) * self._ends[2]) == 0.0
            )
            self._resting = (self._sides > 0.0) & still
        if not len(self._sides) or not self._crossed(end, x).any():
            return STEPPED
        low, high = t, end
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            low, high = (low, middle) if self._crossed(middle, self.interpolate(middle)).any() else (middle, high)
        if high < end:
            self._reached = high, self.interpolate(high)
        record.reached = self._reached[0]
        self._fired = self._crossed(*self._reached)
        self.driver.fired[:] = self._fired
        record.from_zero = int(not (self._sides[self._fired != 0] != 0).any())
        return FOUND

    def interpolate(self, t: float) -> Floats:
        end, x, slope = self._ends
        h = end - self._t
        s = (t - self._t) / h
        u = 1.0 - s
        value: Floats = self._x * u**2 * (1 + 2 * s) + x * s**2 * (3 - 2 * s) + h * s * u * (u * self._slope - s * slope)
        return value

    def accept(self) -> None:
        end, _, slope = self._ends
        (self._t, self._x), whole = self._reached, self._reached[0] == end
        self.driver.x[:] = self._x
        self._slope = slope if whole else self.f(self._t, self._x)

    @property
    def work(self) -> float:
        return self._evaluations * self.problem.rhs_cost

    def stats(self) -> dict[str, Any]:
        return {"steps": self.record.steps, "rejected": 0, "rhs": self._evaluations}

    def leaves(self, code: int) -> bool:
        return code in EVALUATED

    def failure(self, code: int) -> SolverError:
        return SolverError(f"{EVALUATED[code]} cannot be evaluated beyond t = {self.driver.t:.9g} s{self.driver.blamed}")
