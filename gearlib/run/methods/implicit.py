"""``"ida"``: SUNDIALS IDA, for the equations in any of their forms."""

from __future__ import annotations

from dataclasses import replace

from gearlib.run.methods.method import Method
from gearlib.run.methods.run import Run
from gearlib.solvers.drive.driver import Stepper
from gearlib.solvers.problem import Problem, Solution


class Implicit(Method):
    """SUNDIALS IDA."""

    name = "ida"
    jacobian = True

    def stepper(self, problem: Problem) -> Stepper:
        from gearlib.solvers.ida.ida import ida

        return ida()

    def solve(self, run: Run, why: str) -> Solution:
        found = super().solve(run, why)
        n = len(run.scene.states if run.handed is None else run.handed.equations.unknowns)
        return replace(found, stats=found.stats | {"form": run.form, "unknowns": n})

    def _stepper(self, run: Run, problem: Problem) -> Stepper:
        from gearlib.solvers.ida.ida import ida

        return ida(native=run.backend == "native")
