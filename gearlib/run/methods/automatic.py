"""``"auto"``: choice of the integration method, with switching between Runge-Kutta and IDA on stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gearlib.errors import SolverError
from gearlib.run.methods.closed_form import exponential, exponential_solution, too_many_corners
from gearlib.run.methods.explicit import order_of
from gearlib.run.methods.implicit import Implicit
from gearlib.run.methods.method import finished, with_callbacks
from gearlib.run.methods.native_problem import memory, problem_of
from gearlib.run.methods.run import Run
from gearlib.solvers.alternation import Leg, alternate
from gearlib.solvers.drive.driver import Driver, Stepper
from gearlib.solvers.inputs.callback import Callbacks
from gearlib.solvers.inputs.table import Table
from gearlib.solvers.problem import Solution
from gearlib.solvers.rungekutta.rungekutta import RungeKutta

COUNTED = ("steps", "attempts", "rejected", "rhs", "jac", "restarts", "work")  # summed over the legs of a run


class Automatic:
    """Matrix exponentials where the scene is linear, else Runge-Kutta alternating with IDA."""

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
    """Runge-Kutta, and IDA where it makes faster progress."""

    name = "rk and ida"

    def fits(self, run: Run) -> str | None:
        """None: it always fits."""
        return None

    def solve(self, run: Run, why: str) -> Solution:
        """Integrate a run; ``stats["why"]`` of the solution lists the legs."""
        return with_callbacks(run, lambda callbacks: _alternated(run, callbacks, why))


def _alternated(run: Run, callbacks: Callbacks, why: str) -> Solution:
    from gearlib.solvers.ida.ida import ida
    from gearlib.solvers.ida.ida_stepper import trial

    start = problem_of(run, callbacks, jacobian=False)
    order = order_of(start)

    def explicit(legs: Sequence[Leg]) -> tuple[Driver, RungeKutta]:
        stepper = RungeKutta(order)
        return (handed_over(run, callbacks, legs[-1].run, stepper, False) if legs else Driver(start, stepper)), stepper

    def implicit(legs: Sequence[Leg]) -> Driver:
        return handed_over(run, callbacks, legs[-1].run, ida(), True)

    return _joined(run, alternate(explicit, implicit, trial(start), float(run.times[-1])), why)


def handed_over(run: Run, callbacks: Callbacks, before: Driver, stepper: Stepper, jacobian: bool) -> Driver:
    """A driver that continues with another stepper where a driver has stopped."""
    slots, held = memory(run, before.data)
    n, tangents = len(run.scene.states), run.tangents
    start = replace(run.start, states=before.x[:n].copy())
    if tangents is not None:
        tangents = replace(tangents, start=before.x[n:].reshape(tangents.start.shape).copy())
    here = replace(run, start=start, modes=held, slots=slots, tangents=tangents)
    return Driver(problem_of(here, callbacks, jacobian), stepper, before)


def _joined(run: Run, legs: Sequence[Leg], why: str) -> Solution:
    """The solution held by the last leg, with the statistics of all legs."""
    whole = finished(run, legs[-1].solution, "auto", f"{why}; {_told(legs)}" if len(legs) > 1 else why)
    for counted in COUNTED if len(legs) > 1 else ():
        counts = [leg.solution.stats.get(counted, 0) for leg in legs]
        if counted in whole.stats:  # scikit-sundae does not report its steps
            whole.stats[counted] = None if None in counts else sum(counts)
    whole.stats["legs"] = len(legs)
    return whole


def _told(legs: Sequence[Leg]) -> str:
    """The legs in words: which method integrated from where to where."""
    first, second = legs[0].solution, legs[1]
    text = f"explicit Runge-Kutta met stiffness at t = {first.t_last:.6g} s"
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
