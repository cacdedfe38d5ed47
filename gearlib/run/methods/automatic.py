"""``"auto"``: choice of the integration method, with switching between an explicit method and IDA on stiffness."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gearlib.errors import SolverError
from gearlib.run.methods.closed_form import exponential, exponential_solution, too_many_corners
from gearlib.run.methods.explicit import order_of
from gearlib.run.methods.implicit import Implicit
from gearlib.run.methods.method import finished, with_callbacks
from gearlib.run.methods.native_problem import memory, problem_of
from gearlib.run.methods.power_series import TaylorSeriesMethod
from gearlib.run.methods.run import Run
from gearlib.solvers.drive.driver import Driver, Stepper
from gearlib.solvers.inputs.table import Table
from gearlib.solvers.problem import Problem, Solution

if TYPE_CHECKING:
    from gearlib.native.series_source import TaylorSeries
    from gearlib.solvers.alternation import Leg
    from gearlib.solvers.inputs.moving import Callbacks
    from gearlib.solvers.rungekutta.rungekutta import RungeKutta
    from gearlib.solvers.taylor.taylor import Taylor

# Choice of the Runge-Kutta order by a pilot run, see `OrderChoice`
SETTLED, EARLY = 120, 0.1  # steps, and share of the run, before the orders are compared
PILOT = 60  # steps of the given order that are compared
GROWN = 8  # steps before the comparison in which the step size of the other order grows
WORTH = 6.0  # least work in the rest of the run, relative to that of a pilot, for which a pilot pays
BETTER = 1.2  # pace, relative to that of the given order, from which the other one is taken
PREPARED = 2e5  # work of preparing a run, ns
# Order 8 is given up for order 5 where the tolerance would allow steps LIMITED times as long as the longest step, and the rest of the run
# takes SAVED preparations; checked every LOOK steps
LIMITED, SAVED, LOOK = 2.0, 3.0, 16
# Most expensive right-hand side, ns, whose Taylor series are used: they are no slower than Runge-Kutta, but compiling them, once per
# structure, takes about a millisecond per nanosecond (measured)
AT_ONCE = 250.0
COUNTED = ("steps", "attempts", "rejected", "rhs", "jac", "restarts", "work")  # summed over the legs of a run


class Automatic:
    """Matrix exponentials where the scene is linear, else Taylor series, or Runge-Kutta, alternating with IDA."""

    name = "auto"

    def fits(self, run: Run) -> str | None:
        """None: some method always fits."""
        return None

    def solve(self, run: Run, why: str) -> Solution:
        """Integrate a run; ``stats["why"]`` of the solution gives the reason for the choice."""
        found = exponential(run)
        if isinstance(found, str):
            form = found
        else:
            try:
                reason = too_many_corners(run, found)
                if reason is None:
                    return exponential_solution(run, found, "the scene is linear and time-invariant")
                form = reason
            except SolverError as problem:
                form = str(problem)
        if run.start.steady and not run.driven and not any(isinstance(s, Table) for s in run.signals):
            # Stability limits explicit steps even where nothing moves, and lets rounding errors grow to the tolerance.
            return Implicit().solve(run, f"{form}; the run begins in a steady state, which nothing leaves with time")
        return Alternating().solve(run, form)


class Alternating:
    """Taylor series, or Runge-Kutta where they do not exist; IDA where it makes faster progress."""

    name = "rk and ida"

    def fits(self, run: Run) -> str | None:
        """None: it always fits."""
        return None

    def solve(self, run: Run, why: str) -> Solution:
        """Integrate a run; ``stats["why"]`` of the solution lists the legs."""
        return with_callbacks(run, lambda callbacks: _alternated(run, callbacks, why))


def _alternated(run: Run, callbacks: Callbacks, why: str) -> Solution:
    start = problem_of(run, callbacks, jacobian=False)
    series = _series(run, start)
    if series is not None:
        from gearlib.solvers.taylor.taylor import Taylor

        def expanded(legs: list[Leg]) -> tuple[Driver, Taylor]:
            stepper = Taylor(series)
            return (handed_over(run, callbacks, legs[-1].run, stepper, False) if legs else Driver(start, stepper)), stepper

        with suppress(SolverError):  # where a series ends, Runge-Kutta may go on, or says why not
            return _in_turns(run, callbacks, start, expanded, why)
    from gearlib.solvers.rungekutta.rungekutta import RungeKutta

    orders = OrderChoice(run, callbacks, order_of(start))

    def explicit(legs: list[Leg]) -> tuple[Driver, RungeKutta]:
        if legs:
            stepper = RungeKutta(orders.order)
            return handed_over(run, callbacks, legs[-1].run, stepper, False), stepper
        return orders.begun(start, legs)

    solution = _in_turns(run, callbacks, start, explicit, why)
    solution.stats["work"] += orders.work
    return solution


def _series(run: Run, start: Problem) -> TaylorSeries | None:
    """The function for Taylor coefficients, if it exists and its compilation pays."""
    if start.rhs_cost > AT_ONCE or TaylorSeriesMethod().fits(run):
        return None
    found = run.scene.series
    return None if isinstance(found, str) else found


def _in_turns(
    run: Run,
    callbacks: Callbacks,
    start: Problem,
    explicit: Callable[[list[Leg]], tuple[Driver, Taylor | RungeKutta]],
    why: str,
) -> Solution:
    """Integrate by an explicit method and IDA, whichever makes faster progress."""
    from gearlib.solvers.alternation import alternate

    def implicit(legs: Sequence[Leg]) -> Driver:
        from gearlib.solvers.ida.ida import ida

        return handed_over(run, callbacks, legs[-1].run, ida(), True)

    def trial_of_ida() -> tuple[float, float]:
        from gearlib.solvers.ida.ida_stepper import trial

        return trial(start)

    return _joined(run, alternate(explicit, implicit, trial_of_ida, float(run.times[-1])), why)


class OrderChoice:
    """Choice of the Runge-Kutta order by a pilot run: both orders integrate the same stretch of the motion, and their work is compared.

    A short rest of the run does not pay for a pilot; then the order is the one that the tolerance suggests.

    Attributes
    ----------
    order : int
    work : float
        Work of pilots whose motion is discarded, ns.
    """

    def __init__(self, run: Run, callbacks: Callbacks, order: int) -> None:
        self.run, self.callbacks, self.order, self.work = run, callbacks, order, 0.0

    def begun(self, start: Problem, legs: list[Leg]) -> tuple[Driver, RungeKutta]:
        """A driver after the first steps of the run, with the better order; if the order has changed, the steps so far become a leg."""
        from gearlib.solvers.rungekutta.rungekutta import RungeKutta

        stepper = RungeKutta(self.order)
        driver = Driver(start, stepper)
        stepper.watch()
        may_be_limited, t0, left = self.order == 8 and start.longest_step < math.inf, driver.t, math.inf
        while left > WORTH * PREPARED and (driver.record.steps < SETTLED or driver.t < t0 + EARLY * (driver.t_end - t0)):
            if driver.advance(LOOK if may_be_limited else SETTLED) != "more":
                return driver, stepper
            left = (driver.t_end - driver.t) * driver.work / max(driver.t - t0, 1e-300)
            if may_be_limited and stepper.wanted >= LIMITED * driver.record.h_max and left > SAVED * PREPARED:
                return self._with(5, driver, stepper, legs)
            may_be_limited = may_be_limited and driver.record.steps < SETTLED
        if left < WORTH * PREPARED:
            return driver, stepper
        problem, t0, work = self._anew(driver), driver.t, driver.work
        if driver.advance(PILOT) != "more":
            return driver, stepper
        pace = (driver.t - t0) / (driver.work - work)
        left = (driver.t_end - driver.t) / max(pace, 1e-300)
        if left < WORTH * (driver.work - work + PREPARED):
            return driver, stepper
        other = RungeKutta(13 - self.order, stepper.wanted)
        pilot = Driver(problem, other)
        try:
            pilot.advance(GROWN)
            t0, first = pilot.t, pilot.work
            while pilot.status == "more" and pilot.t < driver.t and pilot.work < driver.work - work:
                pilot.advance(GROWN)
        except SolverError:
            return driver, stepper
        self.work = pilot.work
        if pilot.t - t0 <= BETTER * pace * (pilot.work - first):
            return driver, stepper
        return self._with(other.order, driver, other, legs)

    def _with(self, order: int, driver: Driver, like: RungeKutta, legs: list[Leg]) -> tuple[Driver, RungeKutta]:
        """The rest of a run with another order, beginning with a known step size."""
        from gearlib.solvers.alternation import Leg
        from gearlib.solvers.rungekutta.rungekutta import RungeKutta

        legs.append(Leg("explicit", driver, driver.solution()))
        self.order, stepper = order, RungeKutta(order, min(like.wanted, driver.record.h_max))
        return handed_over(self.run, self.callbacks, driver, stepper, False), stepper

    def _anew(self, driver: Driver) -> Problem:
        """The problem from where a driver is, without samples."""
        here = replace(continued(self.run, driver), max_step=self.run.longest_step)
        return problem_of(replace(here, times=np.array([driver.t, driver.t_end])), self.callbacks, False)


def handed_over(run: Run, callbacks: Callbacks, before: Driver, stepper: Stepper, jacobian: bool) -> Driver:
    """A driver that continues with another stepper where a driver has stopped."""
    return Driver(problem_of(continued(run, before), callbacks, jacobian), stepper, before)


def continued(run: Run, before: Driver) -> Run:
    """A run as it goes on from where a driver is."""
    slots, held = memory(run, before.data)
    n, tangents = len(run.scene.states), run.tangents
    start = replace(run.start, states=before.x[:n].copy())
    if tangents is not None:
        tangents = replace(tangents, start=before.x[n:].reshape(tangents.start.shape).copy())
    return replace(run, start=start, discrete=held, slots=slots, tangents=tangents)


def _joined(run: Run, legs: Sequence[Leg], why: str) -> Solution:
    """The solution held by the last leg, with the statistics of all legs."""
    whole = finished(run, legs[-1].solution, "auto", f"{why}; {told(legs)}" if len(legs) > 1 else why)
    for counted in COUNTED if len(legs) > 1 else ():
        counts = [leg.solution.stats.get(counted, 0) for leg in legs]
        if counted in whole.stats:  # scikit-sundae does not report its steps
            whole.stats[counted] = None if None in counts else sum(counts)
    whole.stats["legs"] = len(legs)
    return whole


def told(legs: Sequence[Leg]) -> str:
    """The legs in words: which method integrated from where to where."""
    began = next((k for k, leg in enumerate(legs) if leg.method == "implicit"), len(legs))
    text = ""
    if legs[0].method == legs[1].method == "explicit":
        text = (
            f"order {legs[1].solution.stats['order']} from t = {legs[0].solution.t_last:.6g} s on, where it made more progress"
        )
    if began == len(legs):
        return text
    from gearlib.solvers.taylor.taylor import Taylor

    first, second = legs[began - 1].solution, legs[began]
    name = "the Taylor series" if first.stats["method"] == Taylor.name else "explicit Runge-Kutta"
    text += f"{'; ' if text else ''}{name} met stiffness at t = {first.t_last:.6g} s"
    stayed = sum(leg.method == "implicit" and leg.stayed for leg in legs)
    tried = sum(leg.method == "implicit" and not leg.stayed for leg in legs)
    if stayed and second.stayed:
        text += " and handed over to IDA"
    elif stayed:
        text += ", and handed over to IDA later on"
    backs = stayed - (legs[-1].method == "implicit")
    if backs:
        text += f", which handed back {'once' if backs == 1 else f'{backs} times'} where it was the slower one"
    if tried:
        text += f"; IDA was tried {'once' if tried == 1 else f'{tried} times'} and would have taken longer"
    return text
