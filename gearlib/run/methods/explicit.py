"""``"rk"``: explicit Runge-Kutta methods, of order 5 or 8."""

from __future__ import annotations

from gearlib.run.methods.method import Method
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.problem import Problem
from gearlib.solvers.rungekutta.rungekutta import RungeKutta

# Of tables: points from which on a pilot of so many steps of order 5 shows whether that suffices, and what its wanted step must then
# be beside the steps that the points leave
MANY_CORNERS, PILOT, CUT = 1000, 100, 0.6


class Explicit(Method):
    """Runge-Kutta, of the order that fits the tolerance."""

    name = "rk"
    order: int | None = None

    def stepper(self, problem: Problem) -> RungeKutta:
        return RungeKutta(self.order or order_of(problem))


class Explicit5(Explicit):
    """Tsitouras' method of order 5."""

    name, order = "rk5", 5


class Explicit8(Explicit):
    """Dormand's and Prince's method of order 8."""

    name, order = "rk8", 8


def order_of(problem: Problem) -> int:
    """The order of Runge-Kutta: by tolerance, but 5 where tables cut the steps so short that a higher one is of no use."""
    if problem.rtol >= 1e-6:
        return 5
    if len(problem.time_events) < MANY_CORNERS:
        return 8
    stepper = RungeKutta(5)
    pilot = Driver(problem, stepper)
    pilot.advance(PILOT)
    return 5 if stepper.wanted >= CUT * (pilot.t - problem.times[0]) / PILOT else 8
