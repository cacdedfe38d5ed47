"""``"auto"``: the method that fits; where none is sure to, Runge-Kutta, and IDA where that gets on faster."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gearlib.errors import SolverError
from gearlib.run.methods.closed_form import exact_form, solved, too_many_corners
from gearlib.run.methods.explicit import order_of
from gearlib.run.methods.implicit import Implicit
from gearlib.run.methods.method import carried_out, finished
from gearlib.run.methods.native_problem import memory, problem_of
from gearlib.run.methods.run import Run
from gearlib.solvers.alternation import Leg, alternate
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.inputs.callback import Callbacks
from gearlib.solvers.inputs.table import Table
from gearlib.solvers.problem import Solution
from gearlib.solvers.rungekutta.rungekutta import RungeKutta

COUNTED = ("steps", "attempts", "rejected", "rhs", "jac", "events", "restarts", "work")  # over the legs of a run


class Automatic:
    """Exponentials where the scene is linear, else Runge-Kutta and IDA in turns."""

    name = "auto"

    def fits(self, run: Run) -> str | None:
        """There is always a method."""
        return None

    def solve(self, run: Run, why: str) -> Solution:
        """Integrate a run; ``stats["why"]`` of the solution says how it was chosen."""
        form = exact_form(run)
        if not isinstance(form, str):
            try:
                reason = too_many_corners(run, form)
                if reason is None:
                    return solved(run, form, "the scene is linear and time-invariant")
                form = reason
            except SolverError as problem:
                form = str(problem)
        if run.start.steady and not run.driven and not any(isinstance(s, Table) for s in run.signals):
            # Stability limits explicit steps even where nothing moves, and what rounding excites then grows to the tolerance.
            return Implicit().solve(run, f"{form}; the run begins in a steady state, which nothing leaves with time")
        return Alternating().solve(run, form)


class Alternating:
    """Runge-Kutta, and IDA where that gets on faster."""

    name = "rk and ida"

    def fits(self, run: Run) -> str | None:
        """It always does."""
        return None

    def solve(self, run: Run, why: str) -> Solution:
        """Integrate a run; ``stats["why"]`` of the solution says which method went from where to where."""
        return carried_out(run, lambda callbacks: _alternated(run, callbacks, why))


def _alternated(run: Run, callbacks: Callbacks, why: str) -> Solution:
    from gearlib.solvers.ida.ida import ida
    from gearlib.solvers.ida.ida_stepper import trial

    start = problem_of(run, callbacks, jacobian=False)
    order = order_of(start)

    def explicit(legs: Sequence[Leg]) -> tuple[Driver, RungeKutta]:
        stepper = RungeKutta(order)
        return Driver(problem_of(_rest(run, legs), callbacks, jacobian=False) if legs else start, stepper), stepper

    def implicit(legs: Sequence[Leg]) -> Driver:
        return Driver(problem_of(_rest(run, legs), callbacks, jacobian=True), ida())

    return _joined(run, alternate(explicit, implicit, trial(start), float(run.times[-1])), why)


def _wanted(run: Run, legs: Sequence[Leg]) -> list[slice]:
    """The samples of each leg that are the run's: a leg begins where the one before ended, which may be no sample, or one more time."""
    found, done = [], 0
    for leg in legs:
        t = leg.solution.t
        first = 0 if done < len(run.times) and len(t) and t[0] == run.times[done] else 1
        found.append(slice(first, None))
        done += len(t) - first
    return found


def _rest(run: Run, legs: Sequence[Leg]) -> Run:
    """What is left of a run after some legs."""
    if not legs:
        return run
    scene, last = run.scene, legs[-1]
    done = sum(len(leg.solution.t[wanted]) for leg, wanted in zip(legs, _wanted(run, legs), strict=True))
    t, times = last.solution.t_last, run.times[done:]
    if not len(times) or times[0] > t:
        times = np.concatenate([[t], times])
    slots, held = memory(scene, last.solution.data)
    start, longest = replace(run.start, states=last.solution.x_last[: len(scene.states)]), run.longest_step
    return replace(
        run, start=start, times=times, modes=held, slots=slots, max_step=longest if longest < math.inf else None
    )  # fmt: skip


def _joined(run: Run, legs: Sequence[Leg], why: str) -> Solution:
    """One solution of all legs."""
    why = f"{why}; {_told(legs)}" if len(legs) > 1 else why
    whole = [finished(run, leg.solution, "auto", why) for leg in legs]
    last = whole[-1]
    if len(legs) == 1:
        return last
    wanted = _wanted(run, legs)
    parts = list(zip(whole, wanted, strict=True))
    stats = dict(last.stats)
    for counted in COUNTED:
        counts = [leg.stats.get(counted, 0) for leg in whole]
        if counted in stats:  # scikit-sundae cannot tell the steps
            stats[counted] = None if None in counts else sum(counts)
    return replace(
        last, t=np.concatenate([leg.t[part] for leg, part in parts]), x=np.vstack([leg.x[part] for leg, part in parts]),
        modes=np.vstack([leg.modes[part] for leg, part in parts]), events=[event for leg in whole for event in leg.events], stats=stats,
    )  # fmt: skip


def _told(legs: Sequence[Leg]) -> str:
    """Which method went from where to where."""
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
