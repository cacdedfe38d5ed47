"""Conditions of a model one by one: which variables they compare, where their values are, and rates that are rounding."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.equations.kernel import relation_kernel
from gearlib.errors import ArgumentError
from gearlib.flatten.model import FlatModel
from gearlib.statics import closed_gaps
from gearlib.statics.closed_gaps import drifting, refuse_drift, with_gaps_closed
from gearlib.statics.mesh_turn import apply
from gearlib.statics.steady_motion import Given, motion_from, settled_discrete


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_rates_that_are_rounding_are_none(size: float) -> None:
    """Relative to the fastest, whatever its sense: 1e-9 of it."""
    rates = size * np.array([0.5, -2.0, 1.9e-9, -1.9e-9, 2.1e-9, -2.1e-9, 0.0])
    assert closed_gaps.without_rounding(rates).tolist() == [rates[0], rates[1], 0.0, 0.0, rates[4], rates[5], 0.0]
    assert closed_gaps.without_rounding(np.zeros(3)).tolist() == [0.0] * 3
    assert closed_gaps.without_rounding(np.empty(0)).tolist() == []


class Watched(gl.Component):
    """Conditions on variables, on a rate, on an input of time alone, and in an update of a discrete variable."""

    x, y, z = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    limit = gl.Parameter("1", default=2.0)
    second = gl.Parameter("s", default=1.0)
    n = gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), gl.Piecewise((1, self.y > self.z), (2, self.x <= self.limit), (3, True))),
            gl.Eq(gl.der(self.y), gl.Piecewise((1, gl.time < 5.0), (2, True))),
            gl.Eq(self.z, 1 + self.second * gl.der(self.x) / 4),
            gl.Eq(self.n, gl.Piecewise((3, self.x > self.z), (1, True))),
        ]


@cache
def watched() -> FlatModel:
    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.two = Watched(), Watched(limit=-1.0)
            return []

    return gl.compile(Two()).translation.structure.complete


def test_conditions_are_those_on_variables_with_the_variables_that_they_compare() -> None:
    """Those of time alone are none; of the equations first, then of the updates."""
    model = watched()
    pairs = {
        frozenset(model.name(int(v)) for v in closed_gaps.compared_by(model, g, c)): (g, c)
        for g, c in closed_gaps.comparing(model)
    }
    both = [frozenset(f"{part}.{name}" for part in ("one", "two") for name in names) for names in ("yz", "x", "xz")]
    assert set(pairs) == set(both)
    assert len(closed_gaps.comparing(model)) == 3
    assert len(closed_gaps.groups(model)) == len(model.groups) + 1
    assert pairs[both[2]][0] == len(model.groups)
    assert all(g < len(model.groups) for g, _ in (pairs[both[0]], pairs[both[1]]))


def test_values_of_a_condition_are_found_in_the_discrete_state() -> None:
    model = watched()
    parameters = model.parameters.defaults
    a = np.zeros(model.n_variables)
    values = {"one.x": 1.0, "one.y": 3.0, "one.z": 2.0, "two.x": 5.0, "two.y": -3.0, "two.z": 2.0}
    for name, value in values.items():
        v = model.variable(name)
        a[model.representative[v]] = value * model.sign[v]
    found = settled_discrete(model, parameters, a, np.zeros(len(a)))
    for g, c in closed_gaps.comparing(model):
        group = closed_gaps.groups(model)[g]
        relation = group.template.relations[c]
        value = apply(model, relation_kernel(group.template, c), g, group, parameters, a, np.zeros(len(a)), found)
        value = -value if relation.negated else value
        places = closed_gaps.values_at(model, g, c)
        assert len(set(places.tolist())) == len(group) == 2
        assert found[places].tolist() == [float(v > 0 if relation.strict else v >= 0) for v in value]


@cache
def coupled() -> gl.System:
    class Coupled(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.drive, self.load = gp.Inertia(J=1.0), gp.Inertia(J=2.0), gp.Torque(), gp.Torque()
            self.gap = gp.ElastoBacklash(c=1e4, d=10.0, b=0.2)
            return [
                gl.connect(self.a.flange_b, self.gap.flange_a), gl.connect(self.gap.flange_b, self.b.flange_a),
                gl.connect(self.b.flange_b, self.load.flange), gl.connect(self.drive.flange, self.a.flange_a),
            ]  # fmt: skip

    return gl.compile(Coupled())


@pytest.mark.parametrize(
    ("speeds", "torque", "twist"),
    [
        ({"a.w": 3.0}, 50.0, 0.1 + 50.0 / 1e4), ({"a.w": 3.0}, -50.0, -0.1 - 50.0 / 1e4), ({"a.w": 3.0, "b.w": 3.0}, 0.0, None),
        ({"a.w": 3.0, "b.w": 2.0}, 0.0, None),
    ],
)  # fmt: skip
@pytest.mark.parametrize("d", [10.0, 1e7])
def test_a_gap_is_closed_at_the_side_of_the_load_or_left_as_it_is(
    speeds: dict[str, float], torque: float, twist: float | None, d: float
) -> None:
    """A load that drives is ahead. Left open where both sides turn alike, and where no side would do. However large its damping."""
    translation = coupled().translation
    model, numbers = translation.structure.complete, translation.parameter_values({"gap.d": d})
    given = []
    for name, value in (*speeds.items(), ("load.tau", torque)):
        v = model.variable(name)
        given.append(Given(name, int(model.representative[v]), 0, value * int(model.sign[v])))
    motion = motion_from(model, numbers, given, np.zeros(2 * model.n_variables))
    found = with_gaps_closed(model, numbers, given, motion)
    assert (found is motion) == (twist is None)
    v = model.variable("gap.phi_rel")
    relative = (found.constants if twist is not None else np.zeros(model.n_variables))[model.representative[v]] * model.sign[v]
    assert abs(relative) == pytest.approx(abs(twist or 0.0), rel=1e-9)
    if twist is not None:
        assert np.sign(relative) == np.sign(twist)
        assert found.rates[model.representative[v]] == pytest.approx(0.0, abs=1e-9)


@cache
def beside_idle_gaps() -> gl.System:
    """A gap that carries the load, and seven whose sides are on one shaft."""

    class Many(gl.Component):
        def assemble(self) -> list[Any]:
            self.gap, self.a, self.b = gp.ElastoBacklash(c=1e4, d=10.0, b=0.2), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.idle = [gp.ElastoBacklash(c=1e4, d=10.0, b=0.2) for _ in range(7)]
            self.drive, self.load = gp.Torque(), gp.Torque()
            return [
                gl.connect(self.drive.flange, self.a.flange_a, *(idle.flange_a for idle in self.idle)),
                gl.connect(self.a.flange_b, self.gap.flange_a, *(idle.flange_b for idle in self.idle)),
                gl.connect(self.gap.flange_b, self.b.flange_a), gl.connect(self.b.flange_b, self.load.flange),
            ]  # fmt: skip

    return gl.compile(Many())


@pytest.mark.parametrize("torque", [50.0, -50.0])
def test_gaps_that_do_not_close_are_not_among_those_that_are_tried(torque: float) -> None:
    flow = beside_idle_gaps().power_flow(speeds={"a.w": 3.0}, torques={"load.tau": torque})
    assert flow["b.flange_a"].speed == pytest.approx(3.0, rel=1e-9)
    assert flow["drive.flange"].torque == pytest.approx(torque, rel=1e-9)


class AngleWatcher(gl.Component):
    """A body with conditions on its angle: ``phi + bend phi^2`` against 5 from below, or against -5 from above."""

    below = gl.Structural(True)
    bend = gl.Parameter("1", default=0.0)
    turned = gl.Variable("1")

    def assemble(self) -> list[Any]:
        self.body = gp.Inertia(J=1.0)
        return []

    def equations(self) -> list[gl.Eq]:
        x = self.body.flange_a.phi + self.bend * self.body.flange_a.phi**2
        return [gl.Eq(self.turned, gl.Piecewise((1, x < 5.0 if self.below else x > -5.0), (2, True)))]


@cache
def turned(below: bool) -> gl.System:
    return gl.compile(AngleWatcher(below=below))


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize("pace", [1.0, -1.0, 3.0])
@pytest.mark.parametrize(("bend", "evenly"), [(0.0, True), (1e-7, True), (1e-4, False)])
def test_a_condition_that_will_change_is_one_whose_value_grows_evenly_towards_its_limit(
    below: bool, pace: float, bend: float, evenly: bool
) -> None:
    """Not one that leads away from it, has changed already, or bends by more than a millionth, as what comes and goes does."""
    translation = turned(below).translation
    model, numbers = translation.structure.complete, translation.parameter_values({"bend": bend})
    still = motion_from(model, numbers, [], np.zeros(2 * model.n_variables))
    v = model.variable("body.phi")
    rep, sign = int(model.representative[v]), int(model.sign[v])
    for start, changed in ((0.0, False), (7.0 if below else -7.0, True)):
        constants, rates = np.zeros(model.n_variables), np.zeros(model.n_variables)
        constants[rep], rates[rep] = sign * start, sign * pace
        discrete = settled_discrete(model, numbers, constants, rates)
        motion = replace(still, constants=constants, rates=rates, discrete=discrete)
        towards = (pace > 0) == (below != changed)
        assert drifting(model, numbers, motion) == (["AngleWatcher"] if towards and evenly else [])


def test_four_gaps_that_are_open_between_different_speeds_are_named_at_most() -> None:
    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.gap = (
                [gp.Inertia(J=1.0) for _ in range(6)],
                [gp.ElastoBacklash(c=1e4, d=10.0, b=0.2) for _ in range(5)],
            )
            return [
                link
                for a, gap, b in zip(self.body, self.gap, self.body[1:], strict=False)
                for link in (gl.connect(a.flange_b, gap.flange_a), gl.connect(gap.flange_b, b.flange_a))
            ]

    translation = gl.compile(Row()).translation
    model, numbers = translation.structure.complete, translation.parameter_values({})
    motion = motion_from(model, numbers, [], np.zeros(2 * model.n_variables))
    rates = np.zeros(model.n_variables)
    for k in range(5):
        v = model.variable(f"gap[{k}].phi_rel")
        rates[model.representative[v]] = model.sign[v]
    moving = replace(motion, rates=rates)
    assert drifting(model, numbers, moving) == [f"gap[{k}]" for k in range(5)]
    with pytest.raises(ArgumentError, match=r"the given torques: in gap\[0\], gap\[1\], gap\[2\], gap\[3\] a gap is open"):
        refuse_drift(model, numbers, moving, [])
