"""What a class declares, and what it may not."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError, BoundError, DeclarationError


def test_declarations_are_inherited_in_order() -> None:
    class Base(gl.Component):
        a = gl.Parameter("m", "first")
        x = gl.Variable("m", "second")

    class Derived(Base):
        b = gl.Parameter("m", "third", default=1.0)

    assert list(Derived._declarations) == ["a", "x", "b"]
    assert Derived.a is Base.a
    assert (Derived.b.unit, Derived.b.description) == ("m", "third")


def test_outside_equations_a_parameter_is_the_value_given() -> None:
    assert gp.Inertia(J=3.0).J == 3.0
    assert gp.Inertia().J is None
    assert gp.Fixed().phi0 == 0.0


def test_structural_choices_are_plain_values() -> None:
    assert gp.PlanetaryUnit(planets=5).planets == 5
    assert gp.PlanetaryUnit().planet_meshes == "lumped"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"planets": "3"}, r"structural choice 'planets' is '3' \(str\); expected int"),
        ({"planets": 3.0}, r"structural choice 'planets' is 3.0 \(float\); expected int"),
        ({"planet_meshes": "single"}, r"'planet_meshes' is 'single'; valid choices: 'lumped', 'separate'"),
    ],
)
def test_wrong_structural_choices_are_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(BindingError, match=message):
        gp.PlanetaryUnit(**given)


def declare(name: str, value: Any) -> type[gl.Component]:
    return type("Wrong", (gl.Component,), {name: value})


@pytest.mark.parametrize("name", ["time", "start", "guess", "equations", "assemble", "_x"])
def test_reserved_names(name: str) -> None:
    with pytest.raises(DeclarationError, match=rf"Wrong\.{name}: this name is reserved"):
        declare(name, gl.Variable("m", "x"))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (gl.Variable, r"Wrong\.x is the class Variable; make a declaration: Variable\(\.\.\.\)"),
        (gp.Flange, r"Wrong\.x is the class Flange; make a declaration: Flange\(\.\.\.\)"),
        (gp.Inertia(J=1.0), r"Wrong\.x: parts are made in assemble\(\).*self\.x = Inertia\(\.\.\.\)"),
        (gp.Flange("support", when="nope"), r"Wrong\.x: when='nope' is not a Structural of the class"),
    ],
)
def test_slips_in_the_class_body(value: Any, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        declare("x", value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"state": "prefered"}, "state='prefered'.*'never', 'avoid', 'default', 'prefer'"),
        ({"nominal": 0.0}, "nominal=0.0.*expected a positive number"),
        ({"nominal": -1.0}, "nominal=-1.0.*expected a positive number"),
        ({"nominal": float("nan")}, "nominal is nan; expected a finite number"),
    ],
)
def test_wrong_attributes_of_a_variable(given: dict[str, Any], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        gl.Variable("m", "x", **given)


def test_a_connector_needs_both_halves() -> None:
    with pytest.raises(DeclarationError, match="Half declares only one half; a Potential and a Flow are needed"):
        type("Half", (gl.Connector,), {"phi": gl.Potential("rad", "angle")})


def test_conditional_connector() -> None:
    assert gp.IdealGear(ratio=2.0, use_support=True).support.connector.name == "support"
    with pytest.raises(gl.GearlibError, match="IdealGear has no 'support' here; make it with use_support=True"):
        gp.IdealGear(ratio=2.0).support  # noqa: B018


def test_unknown_variable_of_a_port() -> None:
    with pytest.raises(AttributeError, match="Flange 'flange_a' has no variable 'phii'; it has phi, tau"):
        gp.Inertia(J=1.0).flange_a.phii  # noqa: B018


class Row(gl.Component):
    count = gl.Structural(2, "number of bodies", min=1, max=4)
    share = gl.Structural(0.5, "of the whole", max=1)

    def assemble(self) -> Any:
        self.body = [gp.Inertia(J=self.share) for _ in range(self.count)]
        return []


class Shed(gl.Component):
    count = gl.Structural(2)

    def assemble(self) -> Any:
        self.row = Row(count=self.count)
        return []


def test_structural_choices_have_bounds_and_are_refused_by_path() -> None:
    for count in (1, 4):
        assert len(gl.compile(Row(count=count), outputs=["body[0].w"]).summary()) > 0
    with pytest.raises(BoundError, match=r"^Row: count is 0; expected 1 to 4$"):
        gl.compile(Row(count=0))
    with pytest.raises(BoundError, match=r"^row: count is 5; expected 1 to 4$"):
        gl.compile(Shed(count=5))
    with pytest.raises(BoundError, match=r"^Row: share is 1\.5; expected 1 or less$"):
        gl.compile(Row(share=1.5))
    with pytest.raises(BoundError, match=r"^Row: share is nan; expected 1 or less$"):
        gl.compile(Row(share=float("nan")))


@pytest.mark.parametrize(
    ("declare", "message"),
    [
        (lambda: gl.Structural((), min=1), r"Structural: min and max bound a number; the default is \(\)"),
        (lambda: gl.Structural(True, max=1), r"Structural: min and max bound a number; the default is True"),
        (lambda: gl.Structural(0, min=1), r"Structural: the default is 0; expected 1 or more"),
        (lambda: gl.Structural(3, min=1, max=2), r"Structural: the default is 3; expected 1 to 2"),
        (lambda: gl.Structural(3, min="a"), r"Structural: min"),
    ],
)
def test_bounds_of_a_structural_choice_fit_its_default(declare: Any, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        declare()
