"""`Method`: the interface of an integration method, one class per file."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from gearlib.arguments import all_finite
from gearlib.errors import ArgumentError, SolverError
from gearlib.program.interpret import owner_of
from gearlib.records import altered
from gearlib.run.methods.native_problem import named_events, problem_of
from gearlib.run.methods.run import Run, is_function
from gearlib.run.scene import Scene
from gearlib.solvers.drive.driver import Driver, Stepper
from gearlib.solvers.drive.driver import integrate as to_the_end
from gearlib.solvers.problem import Problem, Solution

if TYPE_CHECKING:
    from gearlib.solvers.inputs.moving import Callbacks


class Integrates(Protocol):
    """Anything that can integrate a run: a `Method`, or a choice among several."""

    name: str

    def fits(self, run: Run) -> str | None: ...

    def solve(self, run: Run, why: str) -> Solution: ...


class Method(ABC):
    """An integration method. ``simulate(method=...)`` takes an instance, or the name under which it was registered.

    Attributes
    ----------
    name : str
        Its name in ``result.stats["method"]``.
    jacobian : bool
        Whether its stepper needs df/dx.
    steps : bool
        Whether it takes time steps, so that a run can be paused and continued with the stepper's state (step size, Jacobian).

    Examples
    --------
    Euler's method, with steps of 1/1000 s:

    >>> import gearlib as gl
    >>> class Steps(gl.ExplicitStepper):
    ...     def advance(self, t, x, stop):
    ...         h = min(1e-3, stop - t)
    ...         return t + h, x + h * self.f(t, x)
    >>> class Euler(gl.Method):
    ...     name = "euler"
    ...     def stepper(self, problem):
    ...         return Steps()
    >>> class Decay(gl.Component):
    ...     x = gl.Variable("1", "quantity", start=1.0)
    ...     def equations(self):
    ...         return [gl.Eq(gl.der(self.x), -self.x)]
    >>> result = gl.simulate(Decay(), 1.0, samples=2, method=Euler())
    >>> bool(abs(result["x"][-1] - 0.999**1000) < 1e-12)
    True
    """

    name: str
    jacobian: bool = False
    steps: bool = True

    def __str__(self) -> str:
        return self.name

    def fits(self, run: Run) -> str | None:
        """The reason why the method cannot integrate a run, as the rest of a sentence ("needs ..."); None if it can."""
        return None

    @abstractmethod
    def stepper(self, problem: Problem) -> Stepper:
        """The stepper for a problem."""

    def solve(self, run: Run, why: str) -> Solution:
        """Integrate a run."""
        if reason := self.fits(run):
            raise refusal(self.name, reason)
        return with_callbacks(run, lambda callbacks: self._to_the_end(run, callbacks, why))

    def _to_the_end(self, run: Run, callbacks: Callbacks, why: str) -> Solution:
        problem = problem_of(run, callbacks, self.jacobian)
        return finished(run, to_the_end(Driver(problem, self._stepper(run, problem))), self.name, why)

    def _stepper(self, run: Run, problem: Problem) -> Stepper:
        return self.stepper(problem)


def refusal(name: str, reason: str) -> ArgumentError:
    """The error for a method that does not fit a run."""
    return ArgumentError(f"method={name!r} {reason}; use method='auto', 'rk' or 'ida'")


def with_callbacks(run: Run, integrated: Callable[[Callbacks], Solution]) -> Solution:
    """The solution of a run; checks the Python callbacks, and adds advice to solver errors."""
    from gearlib.solvers.inputs.moving import Callbacks

    callbacks = Callbacks(run.may_stop)
    try:
        with callbacks.listening() if any(map(is_function, run.signals)) else nullcontext():
            solution = integrated(callbacks)
    except SolverError as problem:
        raise callbacks.failure() or explained(problem, run.scene) from None
    failure = callbacks.failure()
    if failure is not None:
        raise failure
    if said := run.coarse_clock(int(solution.stats.get("steps") or 0)):
        warnings.warn(said, RuntimeWarning, stacklevel=2)
    return solution


def finished(run: Run, solution: Solution, name: str, why: str) -> Solution:
    """A solution in the scene's terms: without auxiliary unknowns, checked to be finite, with named events."""
    if not all_finite(solution.x):
        bad = int(np.argmax(~np.isfinite(solution.x).all(axis=1)))
        raise SolverError(f"the solution is not finite at t = {solution.t[bad]:g} s")
    n, handed = len(run.scene.states), run.handed
    if run.tangents is not None:
        found = solution.x[:, n:] if n else np.empty((len(solution.x), 0))
        solution = replace(solution, tangents=found.reshape(len(found), n, len(run.tangents.directions)))
    stats: dict[str, Any] = {"method": name, "why": why, "states": n, **solution.stats}
    if limited := run.follows_samples:
        stats["max_step"] = f"two sample intervals, because of {limited}; give max_step"
    if handed is not None:
        branch = handed.slots(solution.x_last)
        solution = replace(solution, algebraic=handed.histories(solution.x), branch=branch)
    if solution.x.shape[1] > n:
        solution = altered(solution, x=solution.x[:, :n], x_last=solution.x_last[:n])
    return altered(solution, events=partial(named_events, run, solution), stats=stats)


def explained(problem: SolverError, scene: Scene) -> SolverError:
    """The same error with advice for runs that solve nonlinear equations."""
    iterated = scene.program.iterated
    owners = dict.fromkeys(owner_of(scene.structure, int(e)) for s in iterated for e in s.equations)
    if not owners or "chatter" in str(problem):
        return problem
    names = ", ".join(owners)
    if not any(s.constrained for s in iterated):
        return SolverError(
            f"{problem}. The nonlinear equations of {names} may have no solution further on, or need better guesses: guess={{...}} of "
            "their variables"
        )
    return SolverError(
        f"{problem}. The constraints of {names} may have become singular there for the states in use "
        f"({', '.join(scene.state_names[:6])}): start nearer to the end, or declare other variables as state='prefer'"
    )
