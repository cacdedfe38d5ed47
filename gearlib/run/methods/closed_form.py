"""``"exact"``: linear time-invariant scenes by matrix exponentials, without time steps or compilation."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gearlib.run.methods.method import Method, finished, refusal
from gearlib.run.methods.run import Run
from gearlib.solvers.drive.driver import Driver, integrate
from gearlib.solvers.inputs.table import breakpoints, values
from gearlib.solvers.problem import LinearForm, NoCode, Problem, Solution

if TYPE_CHECKING:
    from gearlib.solvers.exponential.exact import Exponential

Floats = NDArray[np.float64]
# States; on chains Runge-Kutta takes as long at 20 000 (0.05 s for 0.02 s of motion), and less at 50 000 (0.15 s instead of 0.26 s)
LARGEST_EXACT = 30_000
FEW_CORNERS = 50  # corners of tables up to which choosing a method does not pay
SLOW_CORNER = 3e-4  # s per corner of a table, where there are too many states for `Intervals`
# Measured: a Runge-Kutta step and its cost per slot of the program (s); radians of the fastest motion that it spans
RK_STEP, RK_SLOT, REACH_OF_A_STEP = 1.5e-6, 3e-8, 3.0
NO_CODE, NO_NUMBERS, NO_INDICES, NO_FLAGS = NoCode(), np.empty(0), np.empty(0, np.int64), np.empty(0, bool)


class Exact(Method):
    """``"exact"``: matrix exponentials of a linear time-invariant scene, with inputs in closed form."""

    name, steps = "exact", False

    def fits(self, run: Run) -> str | None:
        """Why a run cannot be integrated this way, or None."""
        found = exponential(run)
        return self._lack(found) if isinstance(found, str) else None

    def stepper(self, problem: Problem) -> Exponential:
        from gearlib.solvers.exponential.exact import Exponential

        return Exponential(problem)

    def solve(self, run: Run, why: str) -> Solution:
        """Integrate a run."""
        found = exponential(run)
        if isinstance(found, str):
            raise refusal(self.name, self._lack(found))
        return exponential_solution(run, found, why)

    @staticmethod
    def _lack(reason: str) -> str:
        return f"needs a linear time-invariant scene: {reason}"


def _linear(run: Run) -> LinearForm | str:
    """The linear form of a run, or the reason why it has none."""
    if run.still:
        return LinearForm(np.zeros((0, 0)), np.zeros((0, 0)), ())
    if len(run.scene.states) > LARGEST_EXACT:
        return f"{len(run.scene.states)} states are too many for an exponential"
    if run.tangents is not None:
        from gearlib.run.tangents.linear_changes import changed_form

        return changed_form(run.scene, run.numbers, run.signals, run.tangents.directions)
    from gearlib.run.linear_form import linear_form

    return linear_form(run.scene, run.numbers, run.signals)


def _start(run: Run) -> Floats:
    """The states at the start, followed by their tangents."""
    tangents = run.tangents if run.scene.states else None
    return run.start.states if tangents is None else np.append(run.start.states, tangents.start)


def _problem(run: Run, linear: LinearForm) -> Problem:
    """The problem with a linear form instead of native functions."""
    scene = run.scene
    return Problem(
        rhs=NO_CODE, x0=_start(run), data=NO_NUMBERS, index=NO_INDICES, differential=NO_FLAGS,
        nominal=scene.nominal, state_names=scene.state_names, times=run.times, rtol=run.rtol, linear=linear,
    )  # fmt: skip


def exponential(run: Run) -> Exponential | str:
    """The matrix-exponential stepper for a run, or the reason why there is none."""
    linear = _linear(run)
    if isinstance(linear, str):
        return linear
    known = linear.stepper[0] if linear.stepper else None
    if known is None or known.problem.rtol != run.rtol or known.problem.times.tobytes() != run.times.tobytes():
        known = Exact().stepper(_problem(run, linear))
        linear.stepper[:] = [known]
    stepper: Exponential = known
    return stepper.why_not or stepper


def exponential_solution(run: Run, stepper: Exponential, why: str) -> Solution:
    """Integrate by matrix exponentials; relations, which depend on time only, are evaluated at the samples."""
    problem = stepper.problem
    if problem.x0.tobytes() != _start(run).tobytes():
        problem = _problem(run, stepper.linear)
    found = finished(run, integrate(Driver(problem, stepper)), Exact.name, why)
    scene = run.scene
    if not scene.n_discrete:
        return found
    inputs = values(run.signals, run.times)
    return replace(found, discrete=scene.discrete(run.numbers, run.times, found.x.T, inputs).T)


def too_many_corners(run: Run, stepper: Exponential) -> str | None:
    """Reason to leave tables to Runge-Kutta, which steps from corner to corner, if that is faster."""
    corners = len(breakpoints(run.signals))
    if corners <= FEW_CORNERS:
        return None
    if stepper.cuts is None:
        exact_seconds, rate = corners * SLOW_CORNER, 0.0
    else:
        rate = stepper.rate()
        exact_seconds = min(stepper.cuts.costs(len(run.scene.states), len(stepper.cornered), rate))
    steps = corners + rate * float(run.times[-1] - run.times[0]) / REACH_OF_A_STEP
    seconds = steps * (RK_STEP + RK_SLOT * run.scene.program.n_slots)
    if run.tangents is not None:  # a column costs Runge-Kutta a right-hand side, and exponentials a system of twice the size
        count = len(run.tangents.directions)
        seconds *= 1 + count
        if stepper.cuts is not None:
            exact_seconds = count * min(stepper.cuts.costs(2 * len(run.scene.states), len(stepper.cornered), rate))
    if exact_seconds <= 1.2 * seconds:
        return None
    return (
        f"a table has {corners} points: exponentials from one to the next are estimated to take {exact_seconds:.2g} s, steps "
        f"of Runge-Kutta {seconds:.2g} s"
    )
