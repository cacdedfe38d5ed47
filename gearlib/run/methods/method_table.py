"""Methods by name; `register_method` adds one; `integrate` carries one out."""

from __future__ import annotations

import time as clock

from gearlib.arguments import shown
from gearlib.errors import ArgumentError, nearest
from gearlib.run.methods.automatic import Alternating, Automatic
from gearlib.run.methods.closed_form import Exact
from gearlib.run.methods.explicit import Explicit, Explicit5, Explicit8
from gearlib.run.methods.implicit import Implicit
from gearlib.run.methods.method import Integrates, Method, refusal
from gearlib.run.methods.power_series import TaylorSeriesMethod
from gearlib.run.methods.run import Run
from gearlib.solvers.problem import Solution

BY_TURNS = Alternating()  # as "auto" does for nonlinear scenes
METHODS: dict[str, Integrates] = {
    m.name: m for m in (Automatic(), Exact(), Implicit(), Explicit(), Explicit5(), Explicit8(), TaylorSeriesMethod())
}


def register_method(method: Method) -> None:
    """Register a method under its name, for ``simulate(method=method.name)`` in this process.

    Raises
    ------
    ArgumentError
        Not a `Method`, or a name of one of gearlib's own.
    """
    if not isinstance(method, Method) or not isinstance(getattr(method, "name", None), str):
        raise ArgumentError(f"register_method({shown(method)}): expected an instance of a subclass of gl.Method with a name")
    if method.name in METHODS and type(METHODS[method.name]).__module__.startswith("gearlib."):
        raise ArgumentError(f"there is a method {method.name!r} in gearlib; give yours another name")
    METHODS[method.name] = method


def method_of(choice: str | Method) -> Integrates:
    """The method that a name stands for, or the instance that was given.

    Raises
    ------
    ArgumentError
        Unknown name; the message lists the known ones.
    """
    if isinstance(choice, Method):
        return choice
    if not isinstance(choice, str) or choice not in METHODS:
        advice = (
            nearest(choice, list(METHODS)) if isinstance(choice, str) else f"Valid names: {', '.join(METHODS)}, or a gl.Method"
        )
        raise ArgumentError(f"there is no method {shown(choice)}; {advice}")
    return METHODS[choice]


def integrate(run: Run, method: Integrates) -> Solution:
    """Integrate a run with a method, after checking that the method fits.

    Raises
    ------
    ArgumentError
        The method cannot integrate this scene.
    SolverError
        The integration failed.
    """
    begin = clock.perf_counter()
    if run.still:
        solution = Exact().solve(run, "there are no states")
    elif not run.scene.states:  # events only: any method steps from one to the next
        if reason := method.fits(run):
            raise refusal(method.name, reason)
        solution = Explicit().solve(run, "there are no states, but discrete variables")
    else:
        solution = method.solve(run, "asked for")
    solution.stats["seconds"] = clock.perf_counter() - begin
    return solution
