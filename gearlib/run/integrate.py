"""`integrate`: integrate a run with a method."""

from __future__ import annotations

import time as clock

from gearlib.run.methods.closed_form import Exact
from gearlib.run.methods.explicit import Explicit
from gearlib.run.methods.method import Integrates, refusal
from gearlib.run.methods.run import Run
from gearlib.solvers.problem import Solution


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
