"""Whole messages for unbalanced models, as analysis gives them."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BalanceError
from gearlib.flatten.flatten import flatten
from gearlib.reduce.reduction import analyse


def told(component: gl.Component) -> str:
    model = flatten(component)
    with pytest.raises(BalanceError) as caught:
        analyse(model, model.parameters.defaults)
    return str(caught.value)


def test_two_equations_for_one_variable() -> None:
    class Over(gl.Component):
        x, y = gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(self.x, gl.sin(gl.time)),
                gl.Eq(self.x**3, gl.exp(gl.time)),
                gl.Eq(self.y**3, self.x),
                gl.Eq(self.y, self.x),
            ]

    assert told(Over()) == (
        "the model is not balanced. the model (Over) has 4 equations for 2 unknowns (x; y), 2 are too many: x = sin(time); "
        "x**3 = exp(time); y**3 = x; y = x. over-determined: 3 equations for 1 variables, 2 too many. The equations: "
        "Over (Over: x = sin(time)); Over (Over: x**3 = exp(time)); Over (Over: y**3 = x). The variables: x."
    )


def test_one_equation_for_two_variables() -> None:
    class Under(gl.Component):
        x, y = gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.x + self.y, gl.time)]

    assert told(Under()) == (
        "the model is not balanced. the model (Under) has 1 equation for 2 unknowns (x; y), 1 is missing. under-determined: "
        "2 variables in 1 equations, 1 too few. The variables: x; y."
    )


def test_what_is_driven_twice_is_asked_for() -> None:
    class Twice(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other, self.load = gp.Speed(), gp.Speed(), gp.Inertia(J=1.0)
            return [gl.connect(self.one.flange, self.load.flange_a), gl.connect(self.other.flange, self.load.flange_b)]

    said = told(Twice())
    assert said.startswith("the model is not balanced. over-determined: ")
    over, under = said.split(" under-determined: ")
    assert over.endswith(
        " Is something held or driven twice (two sources or grounds on one rigid shaft), or a source not connected?"
    )
    assert under.endswith(" Is a flange left unconnected inside a composite, or a variable without an equation?")


class Drive(gl.Component):
    """Two torques on a body, one of which an equation gives."""

    bound = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.q, self.r, self.a = gp.Torque(**({"tau": 2.0} if self.bound else {})), gp.Torque(), gp.Inertia(J=1.0)
        return [gl.connect(self.q.flange, self.r.flange, self.a.flange_a)]

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.q.tau, 3 * gl.sin(gl.time))]


@pytest.mark.parametrize("boxed", [False, True])
@pytest.mark.parametrize(("bound", "given"), [(False, "given from outside"), (True, "bound to something already")])
def test_of_two_inputs_the_one_in_an_equation_is_to_be_bound(bound: bool, given: str, boxed: bool) -> None:
    """Where the part is made, which may be in a part of the model."""

    class Outer(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.q = Drive(bound=bound), gp.Inertia(J=2.0)
            return []

    said, q = told(Outer() if boxed else Drive(bound=bound)), "drive.q" if boxed else "q"
    assert said.count("is an input") == 1
    assert (
        f"{q}.tau is an input and {given}; if it is to obey Drive: q.tau = 3*sin(time), bind it: tau=... where {q} is made."
        in said
    )


def test_that_torques_at_one_node_have_no_sum_is_not_said_of_one_of_them() -> None:
    """The sum is the connection's, which no part has written: nothing but inputs is in it, and nothing determines the angle."""

    class Torques(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.c = gp.Torque(), gp.Torque(), gp.Torque()
            return [gl.connect(self.a.flange, self.b.flange, self.c.flange)]

    said = told(Torques())
    assert said.count("Nothing determines a.flange.phi") == 1
    assert "over-determined: 1 equations for 0 variables, 1 too many. The equations: connection (sum of 3 flows)" in said
    assert "is an input" not in said
