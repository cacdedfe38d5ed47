"""``"taylor"``: Taylor's method of variable order, for smooth scenes of moderate size."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gearlib.run.methods.method import Method, refusal
from gearlib.run.methods.run import Run, is_function
from gearlib.solvers.inputs.table import Table
from gearlib.solvers.problem import Problem

if TYPE_CHECKING:
    from gearlib.solvers.taylor.taylor import Taylor


class TaylorSeriesMethod(Method):
    """Taylor series of the motion at each step, by automatic differentiation of the equations."""

    name = "taylor"

    def fits(self, run: Run) -> str | None:
        """The reason why a run cannot be integrated by Taylor series, or None."""
        if run.tangents is not None:
            return "does not integrate sensitivities"
        if run.form != "ode":
            return f"needs the equations as form='ode', not {run.form!r}"
        for (variable, _), signal in zip(run.scene.program.inputs, run.signals, strict=False):
            if isinstance(signal, Table) or is_function(signal):
                kind = "a table" if isinstance(signal, Table) else "a Python function"
                return f"needs inputs with a Taylor series: {run.scene.model.name(variable)} is {kind}"
        found = run.scene.series
        return found if isinstance(found, str) else None

    def stepper(self, problem: Problem) -> Taylor:
        found = "needs the equations as form='ode'" if problem.series is None else problem.series()
        if isinstance(found, str):
            raise refusal(self.name, found)
        from gearlib.solvers.taylor.taylor import Taylor

        return Taylor(found)
