"""Operating points: time, states, inputs and what a run has switched, and how they move with parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, StartError
from gearlib.linear.operating_point import fitting, operating_point, parameters_at
from gearlib.run.subject import translation_of


class Tank(gl.Component):
    """A level that comes to u / a; a mark that falls with time may not fall below 0."""

    a = gl.Parameter("1/s", default=2.0)
    fall = gl.Parameter("1/s", default=5.0)
    u = gl.Input("1/s")
    y = gl.Variable("1", start=0.0)
    mark = gl.Variable("1", min=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.y), self.u - self.a * self.y), gl.Eq(self.mark, self.y - self.fall * gl.time)]


class Plant(gl.Component):
    k = gl.Parameter("1/s", default=1.0)
    b = gl.Parameter("1", default=4.0)

    def assemble(self) -> list[Any]:
        self.tank = Tank(a=2 * self.k, start={"y": 3 * self.b})
        return []


@pytest.fixture(scope="module")
def plant() -> Any:
    return translation_of(gl.compile(Plant()))


def place(translation: Any) -> tuple[Any, tuple[tuple[int, int], ...]]:
    node = (translation.model.variable("tank.y"), 0)
    return node, (node,)


def test_start_values_and_how_they_move_with_parameters(plant: Any) -> None:
    node, states = place(plant)
    scene, numbers, point = operating_point(plant, states, inputs={"tank.u": 7.0})
    table = plant.model.parameters.index
    assert (point.t, point.states, point.inputs.tolist(), point.steady) == (0.0, {node: 12.0}, [7.0], False)
    assert operating_point(plant, states, inputs={"tank.u": lambda t: 7.0 + t})[2].inputs.tolist() == [7.0]
    assert point.discrete is None
    assert point.history is None
    assert scene.states == states
    assert [numbers[table[name]] for name in ("k", "b", "tank.a")] == [1.0, 4.0, 2.0]
    assert point.change is not None
    moved = point.change(["b", "k"])
    assert {(p, k): w for p, k, w in moved.parameters}.items() >= {
        ((table["b"], 0), 1.0), ((table["k"], 1), 1.0), ((table["tank.a"], 1), 2.0),
    }  # fmt: skip
    assert moved.find_states()[node].tolist() == [3.0, 0.0]
    _, _, other = operating_point(plant, states, {"tank.y": 1.5})
    assert other.states == {node: 1.5}
    assert other.change is not None
    assert other.change(["b"]).find_states()[node].tolist() == [0.0]


def test_what_is_given_follows_no_other_parameter(plant: Any) -> None:
    node, states = place(plant)
    table = plant.model.parameters.index
    _, numbers, given = operating_point(plant, states, parameters={"tank.a": 9.0, "b": 5.0})
    assert numbers[table["tank.a"]] == 9.0
    assert given.states == {node: 15.0}
    assert given.change is not None
    assert {p: w for p, _, w in given.change(["k"]).parameters if w} == {table["k"]: 1.0}


def test_a_steady_state_moves_as_its_closed_form_says(plant: Any) -> None:
    """u / a = 3 / (2 k)."""
    node, states = place(plant)
    for k in (1.0, 0.25):
        _, _, point = operating_point(plant, states, "steady", {"k": k, "tank.fall": 0.0}, {"tank.u": 3.0})
        assert point.states[node] == pytest.approx(3 / (2 * k))
        assert point.steady
        assert point.change is not None
        moved = point.change(["k", "b"]).find_states()[node]
        assert moved == pytest.approx([-3 / (2 * k**2), 0.0], abs=1e-9)


class Swelling(gl.Component):
    """A level with a loss that changes with time."""

    a = gl.Parameter("1/s", default=2.0)
    y = gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.y), 7.0 - (self.a + 3.0 * gl.cos(gl.time)) * self.y)]


def test_a_steady_state_and_its_changes_are_those_of_time_0() -> None:
    """7 / (a + 3), whatever the loss was before."""
    translation = translation_of(gl.compile(Swelling()))
    node = (translation.model.variable("y"), 0)
    _, _, point = operating_point(translation, (node,), "steady")
    assert point.states[node] == pytest.approx(7 / 5)
    assert point.change is not None
    assert point.change(["a"]).find_states()[node] == pytest.approx([-7 / 25])


def test_a_moment_of_a_run_has_its_time_inputs_and_parameters(plant: Any) -> None:
    """y = 3 + 9 exp(-t), between samples, too; it moves with no parameter."""
    system = gl.compile(Plant())
    mine = system.simulate(1.0, samples=11, parameters={"k": 0.5, "tank.fall": 0.0}, inputs={"tank.u": 3.0}, rtol=1e-10)
    translation = translation_of(system)
    node, states = place(translation)
    table = translation.model.parameters.index
    for t in (0.0, 0.35, 1.0):
        _, numbers, point = operating_point(translation, states, (mine, t))
        assert point.t == t
        assert point.states[node] == pytest.approx(3 + 9 * np.exp(-t), rel=1e-8)
        assert point.inputs.tolist() == [3.0]
        assert numbers[table["tank.a"]] == 1.0
        assert point.history is not None
        assert point.history(node) == point.states[node]
        assert not point.steady
        assert point.change is not None
        moved = point.change(["k", "b"])
        assert moved.find_states()[node].tolist() == [0.0, 0.0]
        assert {p: w for p, k, w in moved.parameters if not k and w} == {table["k"]: 1.0, table["tank.a"]: 2.0}
    _, numbers, point = operating_point(translation, states, (mine, 0.5), {"tank.a": 8.0})
    assert numbers[table["tank.a"]] == 8.0
    assert point.change is not None
    assert {p: w for p, _, w in point.change(["k"]).parameters if w} == {table["k"]: 1.0}
    assert parameters_at(translation, (mine, 0.5))[table["k"]] == 0.5
    assert parameters_at(translation, None, {"k": 3.0})[table["tank.a"]] == 6.0
    assert fitting(translation, (mine, 0.5), {"b": 1.0}).structure is translation.structure
    for wrong in (-0.1, 1.1, "end", None, True):
        with pytest.raises(ArgumentError, match=r"at names the time .*; the run goes from 0 to 1 s"):
            operating_point(translation, states, (mine, wrong))
    with pytest.raises(ArgumentError, match="at names a run of another system than Plant; simulate this one"):
        operating_point(plant, place(plant)[1], (mine, 0.5))


@pytest.mark.parametrize("at", ["still", 3.0, (1, 2), ("steady",), True])
def test_what_is_no_operating_point_is_refused(plant: Any, at: Any) -> None:
    with pytest.raises(ArgumentError, match=r"^at is .*; expected start values by path, 'steady', or \(result, time\)$"):
        operating_point(plant, place(plant)[1], at)


def test_a_start_below_a_minimum_is_refused_at_time_0(plant: Any) -> None:
    """The mark is 12 then, and below 0 later; it is where it falls, not where the run would be."""
    states = place(plant)[1]
    assert operating_point(plant, states, parameters={"tank.fall": 50.0})[2].t == 0.0
    with pytest.raises(StartError, match="at t = 0 s"):
        operating_point(plant, states, {"tank.y": -0.1})


class Wrapped(gl.Component):
    """An angle that follows another: one root of many, half a turn apart."""

    x, y, z = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0), gl.Variable("1")
    rate = gl.Parameter("1/s", default=2.0)

    def equations(self) -> list[Any]:
        a = self.y - self.x
        return [gl.Eq(gl.der(self.x), self.rate), gl.Eq(gl.sin(a) + 0.3 * gl.sin(2 * a), 0), gl.Eq(self.z, self.y**2)]


@pytest.mark.parametrize("t", [0.0, 2.05, 5.0])
def test_a_moment_of_a_run_is_on_the_branch_of_the_run(t: float) -> None:
    """y = x = 2 t, so dz/dx = 2 y = 4 t; from the start values alone the nearest root to 0 would be found."""
    system = gl.compile(Wrapped())
    model = system.linearize(inputs=[], outputs=["z", "y"], at=(system.simulate(5.0, samples=101), t))
    np.testing.assert_allclose(model.C, [[4 * t], [1.0]], rtol=1e-6, atol=1e-12)
    if not t:
        np.testing.assert_allclose(system.linearize(inputs=[], outputs=["z", "y"]).C, model.C, atol=1e-12)
