"""``"rk"``: explicit Runge-Kutta methods, of order 5 or 8."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gearlib.run.methods.method import Method
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.problem import Problem

if TYPE_CHECKING:
    from gearlib.solvers.rungekutta.rungekutta import RungeKutta

# Where tables have that many points, a pilot run of PILOT steps of order 5 decides: order 5 suffices if the step size that the tolerance
# allows is at least CUT times the mean step that the points allow.
MANY_CORNERS, PILOT, CUT = 1000, 100, 0.6


class Explicit(Method):
    """Runge-Kutta, of the order that fits the tolerance."""

    name = "rk"
    order: int | None = None

    def stepper(self, problem: Problem) -> RungeKutta:
        from gearlib.solvers.rungekutta.rungekutta import RungeKutta

        return RungeKutta(self.order or order_of(problem))


class Explicit5(Explicit):
    """Tsitouras' method of order 5."""

    name, order = "rk5", 5


class Explicit8(Explicit):
    """The Dormand-Prince method of order 8."""

    name, order = "rk8", 8


def order_of(problem: Problem) -> int:
    """Runge-Kutta order: by tolerance, but 5 where table points limit the step so that a higher order does not pay."""
    if problem.rtol >= 1e-6:
        return 5
    if len(problem.time_events) < MANY_CORNERS:
        return 8
    from gearlib.solvers.rungekutta.rungekutta import RungeKutta

    stepper = RungeKutta(5)
    pilot = Driver(problem, stepper)
    pilot.advance(PILOT)
    passed = max(1, int((problem.time_events <= pilot.t).sum()))
    return 5 if stepper.wanted >= CUT * (pilot.t - problem.times[0]) / passed else 8
