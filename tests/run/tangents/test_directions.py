"""Directions of differentiation by name, and the bookkeeping of tangents along them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.run.tangents.directions import TangentDirections
from gearlib.run.tangents.requested import directions, refuse_form
from gearlib.run.tangents.tangents import Tangents
from tests.program.test_derivatives import Bound


class Train(gl.Component):
    kind = gl.Structural(1)

    def assemble(self) -> list[Any]:
        self.open, self.body = gp.Torque(), gp.Inertia(J=0.5, start={"w": 3.0})
        self.shaft, self.load = gp.SpringDamper(c=8.0, d=0.1), gp.Inertia(J=2.0, nominal={"w": 40.0})
        return [
            gl.connect(self.open.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]  # fmt: skip


@cache
def train() -> Any:
    return gl.compile(Train()).translation


class Trains(gl.Component):
    def assemble(self) -> list[Any]:
        self.part = [Train(), Train()]
        return []


@cache
def bound() -> Any:
    return gl.compile(Bound()).translation


def asked(names: Any, start: Any = None, model: Any = None) -> Any:
    translation = model or train()
    return directions(translation, names, translation.model.parameters.defaults, (), start)


def test_parameters_and_start_values_in_their_order() -> None:
    """A size for each: the parameter's value, or the nominal value of the variable."""
    found = asked(["shaft.c", "start(body.w)", "body.J", "start(load.w)"])
    assert isinstance(found, TangentDirections)
    names, model = train().model.parameters.names, train().model
    assert found.names == ("shaft.c", "start(body.w)", "body.J", "start(load.w)")
    assert len(found) == 4
    assert found.place == {name: k for k, name in enumerate(found.names)}
    assert {(names[p], k, w) for p, k, w in found.seeds} >= {("shaft.c", 0, 1.0), ("body.J", 2, 1.0)}
    assert [(model.name(v).rpartition(".")[2], k, abs(sign)) for v, k, sign in found.starts] == [("w", 1, 1), ("w", 3, 1)]
    assert found.sizes.tolist() == [8.0, model.nominal[model.variable("body.w")], 0.5, 40.0]
    assert asked([]) is None
    assert asked(()) is None


def test_what_is_bound_to_a_parameter_moves_along() -> None:
    found = asked(["density", "width"], model=bound())
    moved = {(bound().model.parameters.names[p], k): w for p, k, w in found.seeds}
    assert moved["a.J", 0] == pytest.approx(0.05 * 0.2**4)
    assert moved["a.J", 1] == pytest.approx(7800.0 * 0.2**4)
    assert moved["gear.ratio", 1] == pytest.approx(1 / 0.2)
    assert ("gear.ratio", 0) not in moved


@pytest.mark.parametrize(
    ("names", "error", "said"),
    [
        (["shaft.c", "body.J", "shaft.c"], ArgumentError, r"^sensitivities names 'shaft.c' twice$"),
        (["kind"], NameLookupError, r"'kind', a structural choice: .* no derivative"),
        (["open.tau"], NameLookupError, r"'open.tau', an input; .* bind open.tau to an expression"),
        (["body.w"], NameLookupError, r"'body.w', a variable; with respect to its start value write 'start\(body.w\)'$"),
        (["shaft.cc"], NameLookupError, r"shaft.cc.* to differentiate with respect to"),
        (["start(body.flange_b.tau)"], ArgumentError, r"body.flange_b.tau has no start value: it follows from those of the states"),
        (["start(load.flange_b.tau)"], ArgumentError, r"and load.flange_b.tau is always zero$"),
        (["start(der(body.w))"], NameLookupError, r"der\(body.w\) is a derivative, which has no start value; body.w has one"),
        (["start(open.tau)"], NameLookupError, r"open.tau is an input, which has no start value"),
    ],
)  # fmt: skip
def test_names_without_a_derivative(names: list[str], error: Any, said: str) -> None:
    with pytest.raises(error, match=said):
        asked(names)


def test_a_choice_of_a_part_in_an_array() -> None:
    translation = gl.compile(Trains()).translation
    with pytest.raises(NameLookupError, match=r"'part\[1\].kind', a structural choice: .* no derivative"):
        asked(["part[1].kind"], model=translation)
    for absent in ("part[2].kind", "none.kind", "part[1].shaft.kind"):
        with pytest.raises(NameLookupError, match=r"no parameter '.*' to differentiate with respect to"):
            asked([absent], model=translation)


def test_a_start_value_of_the_run_can_be_varied() -> None:
    """Of a variable that follows from the states, if it is given for the run."""
    found = asked(["start(shaft.tau)"], start={"shaft.tau": 1.0})
    assert len(found.starts) == 1
    with pytest.raises(ArgumentError, match="start value"):
        asked(["start(shaft.tau)"], start={"body.w": 1.0})


class Counting(gl.Component):
    """What follows from a state, and a discrete variable."""

    a, b, c, x = gl.Variable("1"), gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    n = gl.Discrete("1", start=0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), 1 - self.a),
            *(gl.Eq(y, k * gl.sin(self.x)) for k, y in enumerate((self.a, self.b, self.c), 1)),
            gl.When(self.x > 2, gl.Eq(self.n, gl.pre(self.n) + 1)),
        ]


def test_the_start_of_a_discrete_variable_is_none_of_another_variable() -> None:
    model = gl.compile(Counting(), outputs=["a", "b", "c", "x", "n"]).translation
    places = {int(model.model.representative[model.model.variable(name)]) for name in ("a", "b", "c", "x")}
    assert places == {0, 1, 2, 3}  # whatever a discrete variable is taken for, it is one of them
    for name in ("a", "b", "c"):
        with pytest.raises(ArgumentError, match=f"and {name} has no start value: it follows from those of the states"):
            asked([f"start({name})"], start={"n": 1.0}, model=model)
        assert len(asked([f"start({name})"], start={"n": 1.0, name: 0.5}, model=model).starts) == 1
    assert len(asked(["start(x)"], start={"n": 1.0}, model=model).starts) == 1


def test_forms_that_leave_unknowns_to_ida_are_refused() -> None:
    refuse_form(train(), "ode")
    for form in ("torn", "dae"):
        with pytest.raises(ArgumentError, match=rf"^sensitivities need form='ode', .*; the form is '{form}'$"):
            refuse_form(train(), form)


def test_values_of_states_are_spread_over_their_tangents() -> None:
    """The tangents of one state together, each relative to the size of its direction."""
    found = asked(["shaft.c", "start(load.w)"])
    own = Tangents(found, np.zeros((3, 2)))
    assert own.spread(np.array([1.0, 2.0, 80.0])) == pytest.approx(
        np.array([[1.0 / 8.0, 1.0 / 40.0], [2.0 / 8.0, 2.0 / 40.0], [10.0, 2.0]]).ravel()
    )
