"""Names of derivatives, and what an instance says of its variables: typical sizes and wishes for states."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.attributes import PREFERENCE, choices_of, nominals, of_any_alias, preferences
from gearlib.flatten.flatten import flatten
from gearlib.flatten.instances import walk


class Pair(gl.Component):
    """Two bodies and a spring; the second body feels a tenth of the first one's acceleration."""

    options: ClassVar[dict[str, Any]] = {}

    def assemble(self) -> list[Any]:
        self.left, self.right = gp.Inertia(J=2.0), gp.Inertia(J=1.0)
        self.spring = gp.SpringDamper(c=10.0, d=1.0, **self.options)
        self.drive = gp.Torque(tau=gl.sin(gl.time))
        self.drag = gp.Torque(tau=-0.1 * self.left.a)
        return [
            gl.connect(self.drive.flange, self.left.flange_a),
            gl.connect(self.left.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.right.flange_a),
            gl.connect(self.right.flange_b, self.drag.flange),
        ]


def pair(**options: Any) -> gl.Component:
    made: gl.Component = type("Pair", (Pair,), {"options": options})()
    return made


def test_a_is_the_derivative_of_w() -> None:
    system = gl.compile(Pair(), outputs=["left.a", "right.a", "spring.tau"])
    r = system.simulate(1.0, samples=11)
    assert (r["left.a"] == r["der(left.w)"]).all()
    assert r["right.a"] == pytest.approx(-r["spring.tau"] - 0.1 * r["left.a"])
    assert "left.a" in r
    assert "left.b" not in r
    assert "left.a" not in system.variables, "it is no unknown"
    linear = system.linearize(inputs=["drive.tau"], outputs=["left.a"])
    assert np.asarray(linear.D).ravel() == pytest.approx([0.5])


def test_nominal_values_of_the_instance_win_over_those_of_the_class() -> None:
    def nominal(model: gl.Component, name: str) -> float:
        flat = flatten(model)
        return float(flat.nominal[flat.representative[flat.variable(name)]])

    assert nominal(pair(), "spring.phi_rel") == 1e-4
    assert nominal(pair(nominal={"phi_rel": 0.5}), "spring.phi_rel") == 0.5
    assert nominal(pair(), "left.w") == 1e-2


def test_a_wish_of_the_instance_changes_the_states() -> None:
    outputs = ["right.phi", "spring.phi_rel"]
    assert "spring.phi_rel" in gl.compile(pair(), outputs=outputs).states
    assert set(gl.compile(pair(state={"phi_rel": "never"}), outputs=outputs).states) >= {"left.phi", "right.phi"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"nominal": {"phi": 1.0}}, r"spring: nominal is given for 'phi', which is not a variable of SpringDamper; .*phi_rel"),
        ({"nominal": {"phi_rel": 0.0}}, r"spring: nominal value of 'phi_rel' is 0\.0; expected a positive number"),
        ({"state": {"phi_rel": "always"}}, r"spring: state of 'phi_rel' is 'always'; valid choices: 'never', 'avoid'"),
        ({"state": "prefer"}, r"state is 'prefer'; expected preferences by name"),
    ],
)
def test_wrong_ones_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(BindingError, match=message):
        gl.compile(pair(**options))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"nominal": {"v": 2.0}}, r"Inertia: nominal is given for 'v', which is not a variable of Inertia; .* w$"),
        ({"nominal": {3: 2.0}}, r"Inertia: nominal is given for 3, which is not a variable of Inertia; "),
        ({"state": {"v": "prefer"}}, r"Inertia: state is given for 'v', which is not a variable of Inertia; "),
        ({"state": {"load.w": "prefer"}}, r"Inertia: state is given for 'load\.w', .*; give that of a part to the part$"),
        ({"state": {"w": "often"}}, r"Inertia: state of 'w' is 'often'; valid choices: 'never', 'avoid', 'default', 'prefer'$"),
        ({"state": {"w": ["prefer"]}}, r"Inertia: state of 'w' is \['prefer'\]; valid choices: "),
        ({"nominal": {"w": -0.5}}, r"Inertia: nominal value of 'w' is -0\.5; expected a positive number, its typical size$"),
        ({"nominal": {"w": 0}}, r"Inertia: nominal value of 'w' is 0; expected a positive number"),
        ({"nominal": {"w": "large"}}, r"Inertia: nominal value of 'w' is 'large'; expected a positive number"),
    ],
)
def test_choices_are_refused_before_they_are_used(given: dict[str, Any], message: str) -> None:
    """Only what is given to a part of the variable's path is advised to be given there."""
    (instance,) = walk(gp.Inertia(J=1.0)).instances
    with pytest.raises(BindingError, match=f"^{message}") as told:
        list(choices_of(gp.Inertia(J=1.0, **given), instance))
    assert ("; give that of a part to the part" in str(told.value)) == ("load.w" in str(given))


def test_choices_are_the_given_sizes_then_the_given_wishes() -> None:
    (instance,) = walk(gp.Inertia(J=1.0)).instances
    given = gp.Inertia(J=1.0, state={"phi": "never"}, nominal={"w": 0.5, "flange_a.phi": 1e-3})
    expected = [("w", "nominal", 0.5), ("flange_a.phi", "nominal", 1e-3), ("phi", "state", "never")]
    assert list(choices_of(given, instance)) == expected


def test_attributes_of_aliases_are_those_of_their_representative() -> None:
    """Variables 0 to 2 are one, 3 and 4 another; the first wins: given to an instance, else the strongest wish and the smallest size."""
    rep = np.array([0, 0, 0, 3, 3])
    assert of_any_alias(np.array([False, False, True, False, False]), rep).tolist() == [True, False, False, False, False]
    names = list(PREFERENCE)

    def preferred(own: list[str], potential: list[int], *choices: tuple[int, str, Any]) -> list[str]:
        levels = np.array([PREFERENCE[level] for level in own])
        found = preferences(levels, np.isin(np.arange(5), potential), rep, choices)
        return [names[level] for level in found[[0, 3]].tolist()]

    default = ["default"] * 5
    assert preferred(default, []) == ["default", "default"]
    assert preferred(default, [0]) == ["avoid", "default"]
    assert preferred(["default", "prefer", "default", "default", "avoid"], [0]) == ["prefer", "avoid"]
    assert preferred(["never", "prefer", "avoid", "never", "avoid"], []) == ["prefer", "never"]
    assert preferred(["prefer"] * 5, [], (1, "state", "never"), (3, "nominal", 2.0)) == ["never", "prefer"]

    def sizes(own: list[float], *choices: tuple[int, str, Any]) -> list[float]:
        return nominals(np.array(own), rep, choices)[[0, 3]].tolist()

    assert sizes([1.0] * 5) == [1.0, 1.0]
    assert sizes([1.0, 1e-3, 1e-2, 50.0, 1.0]) == [1e-3, 50.0]
    assert sizes([1.0, 1e-3, 1e-2, 1.0, 1.0], (2, "nominal", 7.0), (0, "nominal", 5.0)) == [5.0, 1.0]
    assert sizes([1.0, 1e-3, 1e-2, 1.0, 1.0], (2, "nominal", 7.0), (0, "nominal", 5.0), (4, "state", "never")) == [5.0, 1.0]


class Heat(gl.Connector):
    T = gl.Potential("K", "temperature")
    Q = gl.Flow("W", "heat")


class Heated(gl.Component):
    """Its angle is a coordinate, its temperature is none; dials show both, and a number without a unit."""

    flange, heat = gp.Flange("shaft"), Heat("heat port")
    c, k = gl.Parameter("N.m/rad", default=2.0), gl.Parameter("W/K", default=3.0)
    angle, warmth, count = gl.Variable("rad"), gl.Variable("K"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        law = [gl.Eq(self.angle, self.flange.phi), gl.Eq(self.warmth, self.heat.T), gl.Eq(self.count, 1.0)]
        return [*law, gl.Eq(self.flange.tau, self.c * self.angle), gl.Eq(self.heat.Q, self.k * self.warmth)]


def test_coordinates_are_potentials_with_a_place_of_their_own_to_count_from() -> None:
    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other, self.body = Heated(), Heated(), gp.Inertia(J=1.0)
            return [
                gl.connect(self.one.flange, self.other.flange, self.body.flange_a),
                gl.connect(self.one.heat, self.other.heat),
            ]

    model = flatten(Two())

    def those(marked: Any) -> set[str]:
        return {name for name in model.names() if marked[model.representative[model.variable(name)]]}

    dials = {"one.flange.phi", "other.flange.phi", "one.angle", "other.angle"}
    assert those(model.potential) == dials | {"body.phi", "body.flange_a.phi", "body.flange_b.phi"}
    flanges = {"one.flange.tau", "other.flange.tau", "body.flange_a.tau", "body.flange_b.tau"}
    assert those(model.flow) == flanges | {"one.heat.Q", "other.heat.Q"}
    preferred = dict(zip(model.names(), model.preference[model.representative].tolist(), strict=True))
    assert {name for name, level in preferred.items() if level == PREFERENCE["avoid"]} == those(model.potential)
