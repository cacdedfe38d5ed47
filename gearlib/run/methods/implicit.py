"""``"ida"``: SUNDIALS' IDA."""

from __future__ import annotations

from gearlib.run.methods.method import Method
from gearlib.solvers.drive.driver import Stepper
from gearlib.solvers.problem import Problem


class Implicit(Method):
    """IDA."""

    name = "ida"
    jacobian = True

    def stepper(self, problem: Problem) -> Stepper:
        from gearlib.solvers.ida.ida import ida

        return ida()
