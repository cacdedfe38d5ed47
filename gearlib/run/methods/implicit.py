"""``"ida"``: SUNDIALS IDA, for the equations in any of their forms."""

from __future__ import annotations

from dataclasses import replace

from gearlib.errors import SolverError
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
        from gearlib.solvers.ida.ida import is_native

        found = super().solve(run, why)
        if found.status == "left" and run.form != "dae" and not is_native(run.backend == "native"):
            # Not repeatable there: the last state known is a sample, and histories of nonlinear blocks repeat the run with other samples
            raise SolverError(
                f"the states in use ({', '.join(run.scene.state_names[:6])}) become singular after t = {found.t_last:.9g} s, and with "
                f"form={run.form!r} scikit-sundae's interface does not tell where others could go on; take backend='native', or "
                "form='dae', or declare other variables as state='prefer'"
            )
        n = len(run.scene.states if run.handed is None else run.handed.equations.unknowns)
        return replace(found, stats=found.stats | {"form": run.form, "unknowns": n})

    def _stepper(self, run: Run, problem: Problem) -> Stepper:
        from gearlib.solvers.ida.ida import ida

        return ida(native=run.backend == "native")
