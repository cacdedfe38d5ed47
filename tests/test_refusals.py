"""Slips of a modeller that once passed unnoticed or ended in a traceback: each is refused by name, or gives the right numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import AttributeNameError, BalanceError, BindingError, BoundError, DeclarationError, ModelError, SolverError


def leaf(equations: Callable[[Any], Any], **declarations: Any) -> gl.Component:
    """A component of a class made here."""
    made: gl.Component = type("Leaf", (gl.Component,), {"equations": equations, **declarations})()
    return made


def pair(equations: Callable[[Any], Any], guess: float = 0.0) -> gl.Component:
    return leaf(equations, x=gl.Variable("1", guess=guess), y=gl.Variable("1"))


def test_equations_without_a_solution_give_no_number() -> None:
    model = pair(lambda s: [gl.Eq(s.x**2, -1), gl.Eq(s.y, s.x)])
    with pytest.raises(SolverError, match=r"Leaf: x\*\*2 = -1 were not solved at t = 0 s; .* guess="):
        gl.simulate(model, 0.1, samples=2)["x"]


def test_equations_that_are_singular_at_the_guess_are_solved() -> None:
    result = gl.simulate(pair(lambda s: [gl.Eq(s.x**2, 4 + gl.time), gl.Eq(s.y, s.x)]), 0.5, samples=3)
    np.testing.assert_allclose(np.abs(result["y"]), np.sqrt(4 + result.time), rtol=1e-13)


@pytest.mark.parametrize("method", ["rk", "ida"])
def test_a_nonlinear_unknown_may_pass_through_zero(method: str) -> None:
    """exp(x) = 1 + y has x = 0 at the start, where no relative accuracy of x can be had."""
    model = pair(lambda s: [gl.Eq(gl.exp(s.x), 1 + s.y), gl.Eq(gl.der(s.y), gl.cos(gl.time))])
    result = gl.simulate(model, 6.0, samples=61, method=method, rtol=1e-9, outputs=["x", "y"])
    np.testing.assert_allclose(result["y"], np.sin(result.time), atol=2e-7)
    driven = pair(lambda s: [gl.Eq(gl.exp(s.x), 1 + s.y), gl.Eq(gl.der(s.y), 1 + s.x)])
    run = gl.simulate(driven, 0.5, samples=3, method=method, rtol=1e-9)
    np.testing.assert_allclose(run["x"], np.log1p(run["y"]), rtol=1e-9, atol=1e-13)


class Numbered(gl.Component):
    """Takes a number past the declarations."""

    x = gl.Variable("1")

    def __init__(self, number: Any, **bindings: Any) -> None:
        super().__init__(**bindings)
        self.number = number

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), float(np.sum(self.number)))]


class ManyNumbered(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.two, self.three, self.array = Numbered(2.0), Numbered(3.0), Numbered(np.array([1.0, 4.0]))
        self.row = [Numbered(np.array([6.0])), Numbered(7.0)]
        return []


def test_instances_that_differ_in_a_plain_attribute_keep_their_own_equations() -> None:
    result = gl.simulate(ManyNumbered(), 1.0, samples=2)
    found = [result[f"{name}.x"][-1] for name in ("two", "three", "array", "row[0]", "row[1]")]
    np.testing.assert_allclose(found, [2.0, 3.0, 5.0, 6.0, 7.0], rtol=1e-12)


class Ball(gl.Component):
    """Falls, with its speed as an unknown of its own."""

    h = gl.Variable("m", start=1.0)
    v = gl.Variable("m/s")

    def equations(self) -> list[gl.Eq | gl.When]:
        bounce = gl.When(self.h < 0, gl.reinit(self.v, -0.5 * self.v))
        return [gl.Eq(gl.der(self.h), self.v), gl.Eq(gl.der(gl.der(self.h)), -9.81), bounce]


def test_a_reinit_of_what_is_no_state_is_refused() -> None:
    with pytest.raises(ModelError, match=r"reinit\(v\): v is not a state, .* the states are h, der\(h\)\. .* gl\.der\(v\)"):
        gl.compile(Ball())


class Struck(gl.Component):
    """A body whose angle is set anew at a moment."""

    flange = gp.Flange("shaft")
    J = gl.Parameter("kg.m2", "moment of inertia", default=1.0)
    moment = gl.Parameter("s", "when it is struck")
    phi = gl.Variable("rad", "angle", state="prefer")
    w = gl.Variable("rad/s", "speed", state="prefer")

    def equations(self) -> list[gl.Eq | gl.When]:
        return [
            gl.Eq(self.phi, self.flange.phi),
            gl.Eq(gl.der(self.phi), self.w),
            gl.Eq(self.J * gl.der(self.w), self.flange.tau),
            gl.When(gl.time >= self.moment, gl.reinit(self.phi, self.phi + 1)),
        ]


class StruckTwice(gl.Component):
    """Two such bodies, one rigid shaft (turned over by a gear of -1), or an elastic one; made in either order."""

    link = gl.Structural("shaft", choices=("shaft", "gear", "spring"))
    swapped = gl.Structural(False)

    def assemble(self) -> list[gl.Connection]:
        if self.swapped:
            self.b, self.a = Struck(moment=0.7), Struck(moment=0.3)
        else:
            self.a, self.b = Struck(moment=0.3), Struck(moment=0.7)
        if self.link == "shaft":
            return [gl.connect(self.a.flange, self.b.flange)]
        self.between = gp.IdealGear(ratio=-1.0) if self.link == "gear" else gp.Damper(d=1.0)
        return [gl.connect(self.a.flange, self.between.flange_a), gl.connect(self.between.flange_b, self.b.flange)]


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(
    ("link", "said"),
    [
        ("shaft", r"reinit\(a\.phi\) and reinit\(b\.phi\) set one state"),
        ("gear", r"reinit\([ab]\.phi\): [ab]\.phi is not a state"),
    ],
)
def test_two_components_that_set_one_state_are_refused(link: str, said: str, swapped: bool) -> None:
    with pytest.raises(ModelError, match=said):
        gl.compile(StruckTwice(link=link, swapped=swapped))


def test_two_components_may_set_a_state_each() -> None:
    result = gl.simulate(StruckTwice(link="spring"), 1.0, times=[0.0, 0.5, 1.0])
    assert result["a.phi"] == pytest.approx([0.0, 1.0, 1.0])
    assert result["b.phi"] == pytest.approx([0.0, 0.0, 1.0])


class Drive(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.torque, self.load = gp.Torque(tau=10.0), gp.Inertia(J=2.0)
        return [gl.connect(self.torque.flange, self.load.flange_a)]


def test_the_torque_of_a_free_flange_is_an_output_that_is_zero() -> None:
    system = gl.compile(Drive(), outputs=["load.flange_b.tau", "load.w"])
    result = system.simulate(1.0, samples=3)
    assert result["load.flange_b.tau"].tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(result["load.w"], [0.0, 2.5, 5.0], rtol=1e-12)
    linear = system.linearize(inputs=["torque.tau"])
    np.testing.assert_allclose(linear.C @ linear.B + 0.0 * linear.D, [[0.0], [0.5]])
    alone = gl.compile(Drive(), outputs=["load.flange_b.tau"])
    assert alone.states == ()
    assert alone.linearize(inputs=["torque.tau"]).D.tolist() == [[0.0]]


class Misspelt(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.motor, self.load = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        return [gl.connect(self.motor.flange_b, self.load.flange_c)]


class Mapped(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.parts = {"motor": gp.Inertia(J=1.0)}
        return []


def test_slips_are_refused_by_name() -> None:
    with pytest.raises(AttributeNameError, match="load: Inertia has no 'flange_c'; did you mean 'flange_"):
        gl.compile(Misspelt())
    with pytest.raises(ModelError, match=r"Mapped\.parts is a dict of components; a family of parts is a list"):
        gl.compile(Mapped())
    with pytest.raises(BindingError, match="Inertia: start value for '3', which is not a variable of Inertia"):
        gl.compile(gp.Inertia(J=1.0, start={3: 1.0}))  # type: ignore[dict-item]
    with pytest.raises(DeclarationError, match=r"Parameter: unit is 2\.0; expected text.*default="):
        gl.Parameter(2.0)  # type: ignore[arg-type]
    with pytest.raises(DeclarationError, match=r"pre\(3\): expected a discrete variable"):
        gl.pre(3)
    with pytest.raises(
        DeclarationError, match=r"Leaf\.equations\(\): .* is y, which is not a condition; compare it, as in y > 0"
    ):
        gl.compile(pair(lambda s: [gl.Eq(s.x, gl.Piecewise((1, s.y), (0, True))), gl.Eq(s.y, gl.time)]))
    with pytest.raises(BoundError, match="ZhouCui2022: planets is 0; expected 1 to 1000"):
        gl.compile(gp.ZhouCui2022(planets=0))


def test_a_number_of_numpy_may_count_planets() -> None:
    assert gp.PlanetaryUnit(planets=np.int64(4)).planets == 4


class FlangeAsVariable(gl.Component):
    flange = gp.Flange("shaft")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(2.0 * self.flange, 1)]


class FlangeInEquation(gl.Component):
    flange = gp.Flange("shaft")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange, 1)]


def test_a_connector_is_no_variable() -> None:
    with pytest.raises(
        DeclarationError, match=r"a connector is not a variable; name one that it has, such as self\.flange_a\.phi"
    ):
        gl.compile(FlangeAsVariable())
    with pytest.raises(
        DeclarationError, match=r"<Flange FlangeInEquation\.flange> == 1 is not an equation: .* such as .* self\.flange_a\.phi"
    ):
        gl.compile(FlangeInEquation())


class Warm(gl.Component):
    """Two shafts side by side whose losses have nowhere to go."""

    together = gl.Structural(False, "whether the heat ports are connected to each other")

    def assemble(self) -> list[gl.Connection]:
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        self.one, self.other = (gp.SpringDamper(c=10.0, d=1.0, use_heat_port=True) for _ in range(2))
        links = [gl.connect(self.a.flange_b, s.flange_a) for s in (self.one, self.other)]
        links += [gl.connect(s.flange_b, self.b.flange_a) for s in (self.one, self.other)]
        return links + ([gl.connect(self.one.heat_port, self.other.heat_port)] if self.together else [])


def test_a_heat_port_that_is_left_open_is_named_first() -> None:
    off = r", or leave it switched off \(use_heat_port=False of {0}\)\. "
    said = r"{0}\.heat_port is connected to nothing; connect it" + off
    with pytest.raises(
        BalanceError, match=r"^the model is not balanced\. " + said.format("one") + said.format("other") + "over-"
    ):
        gl.compile(Warm())
    with pytest.raises(
        BalanceError, match=r"balanced\. Nothing determines one\.heat_port\.T: .* does" + off.format("one") + "over"
    ):
        gl.compile(Warm(together=True))
    with pytest.raises(
        BalanceError, match=r"balanced\. Nothing determines heat_port\.T: .*use_heat_port=False of SpringDamper\)"
    ):
        gl.compile(gp.SpringDamper(c=10.0, d=1.0, use_heat_port=True))
