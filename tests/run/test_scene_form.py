"""What a scene hands over to IDA: unknowns and slots by name, where they begin, and events of what is computed in sequence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.run.scene import node_name
from gearlib.run.scene_form import SceneForm, scene_form
from gearlib.run.start_values import Start
from tests.program.test_derivatives import Loop
from tests.run.test_constrained import Pendulum


def form(kind: str, **values: Any) -> SceneForm:
    return scene_form(gl.compile(Loop(**values)).translation.scene, kind)


@pytest.mark.parametrize("kind", ["torn", "dae"])
def test_unknowns_and_slots_by_name(kind: str) -> None:
    own = form(kind)
    names, program = own.slot_names, own.program
    assert own is scene_form(own.scene, kind)
    assert own.implicit == (kind == "dae")
    assert own.state_names == (("a", "b") if kind == "torn" else ("a", "b", "w"))
    assert own.differential.tolist() == [True] + [False] * (len(own.state_names) - 1)
    assert own.nominal.tolist() == [1.0] * len(own.state_names)
    assert len(names) == program.n_slots
    assert names[: len(own.state_names)] == list(own.state_names)
    residuals = [names[slot] for slot in program.residuals]
    if kind == "torn":
        assert residuals == ["residual b"]
    else:
        assert names[3] in ("der(a)", "rate of a")
        assert residuals == ["residual rate of a", "residual b", "residual w"]
    assert (own.relation_names, own.root_names, own.time_switches.timed) == ({}, (), ())


@pytest.mark.parametrize("kind", ["torn", "dae"])
def test_first_values_are_on_the_branch_of_the_run(kind: str) -> None:
    """b of sin(b - a) = 0.3 sin(b): found from its guess, or taken from the slots with which a run goes on."""
    own = form(kind)
    scene, model = own.scene, own.scene.model
    numbers = scene.prepared(model.parameters.defaults)
    guess = np.zeros(model.n_variables)
    guess[model.variable("b")] = 0.3
    start, inputs = Start(np.array([0.4]), guess, ()), np.array([0.5])
    x = own.first(numbers, 0.0, start, inputs, np.zeros(0), None)
    a, b = x[:2]
    assert a == 0.4
    assert np.sin(b - a) == pytest.approx(0.3 * np.sin(b), abs=1e-12)
    assert 0.4 < b < 1.0
    if kind == "dae":
        assert x[2] == pytest.approx(2.0 * b**2 * np.cos(b))
    slots = np.full(scene.program.n_slots, 7.25)
    assert own.first(numbers, 0.0, start, inputs, np.zeros(0), slots)[1:].tolist() == [7.25] * (len(x) - 1)
    found = own.slots(np.array([0.1, 0.2, 0.3])[: len(x)])
    for k, node in enumerate(own.equations.unknowns):
        assert found[scene.program.slots[node]] == pytest.approx(0.1 * (k + 1))
    assert np.count_nonzero(found) == len(x)


def test_histories_of_what_ida_found() -> None:
    x = np.arange(12.0).reshape(4, 3)
    own = form("dae")
    histories = {node_name(own.scene.model, node): h.tolist() for node, h in own.histories(x).items()}
    assert histories == {"b": [1.0, 4.0, 7.0, 10.0], "w": [2.0, 5.0, 8.0, 11.0]}
    assert form("torn").histories(x) == {}


class Counter(gl.Component):
    """A cubic spring torque by iteration, and a pair of linear equations whose solution counts turns: an event at p z = 1."""

    p = gl.Parameter("1", default=2.0)
    rate = gl.Parameter("1/s", default=1.0)
    x = gl.Variable("1", start=1.0)
    t = gl.Variable("1")
    y, z, u = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    on = gl.Discrete("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), -self.rate * self.y),
            gl.Eq(gl.der(self.t), self.rate),
            gl.Eq(self.y**3 + self.y, self.x),
            gl.Eq(self.p * self.z + self.u, 3 * self.t),
            gl.Eq(self.z - self.u, 0.0),
            gl.When(self.p * self.z >= 1.0, gl.Eq(self.on, 1.0)),
        ]


@pytest.mark.parametrize("p", [2.0, 5.0])
@pytest.mark.parametrize("kind", ["ode", "torn", "dae"])
def test_events_of_what_a_constant_block_determines(kind: str, p: float) -> None:
    """(p + 1) z = 3 t, so that p z is one at t = (p + 1) / (3 p)."""
    system = gl.compile(Counter(p=p), outputs=["x", "z", "on"])
    found = system.simulate(1.0, samples=5, method="ida", form=kind, rtol=1e-9)
    assert [t for t, _ in found.events] == pytest.approx([(p + 1) / (3 * p)], rel=1e-7)
    assert found["z"] == pytest.approx(3 * found.time / (p + 1), rel=1e-7, abs=1e-9)
    assert found["on"].tolist() == [float(t >= (p + 1) / (3 * p)) for t in found.time]


def test_first_values_of_linear_equations_are_their_guesses() -> None:
    """Of variables; derivatives begin at zero. IDA finds the rest."""

    class Linear(gl.Component):
        """Two masses that a rigid lever joins: the constraint between their places is differentiated twice."""

        L = gl.Parameter("any", default=2.0)
        x, y = gl.Variable("any", start=1.0), gl.Variable("any")
        u, v, force = gl.Variable("any"), gl.Variable("any"), gl.Variable("any")

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), self.u),
                gl.Eq(gl.der(self.y), self.v),
                gl.Eq(gl.der(self.u), -self.force - self.x),
                gl.Eq(gl.der(self.v), self.L * self.force),
                gl.Eq(self.x, self.L * self.y),
            ]

    scene = gl.compile(Linear()).translation.scene
    own, model = scene_form(scene, "dae"), scene.model
    assert scene.program.is_linear
    guess = np.arange(1.0, 1.0 + model.n_variables)
    start = Start(np.full(len(scene.states), 0.5), guess, ())
    found = own.first(scene.prepared(model.parameters.defaults), 0.0, start, np.zeros(0), np.zeros(0), None)
    assert found[: len(scene.states)].tolist() == [0.5] * len(scene.states)
    algebraic = own.equations.algebraic
    assert found[len(scene.states) :].tolist() == [guess[v] if k == 0 else 0.0 for v, k in algebraic]
    assert any(k > 0 for _, k in algebraic)
    assert any(k == 0 for _, k in algebraic)


def test_sizes_of_unknowns() -> None:
    """Those that variables declare; derivatives have none of their own."""
    own = scene_form(gl.compile(Loop(nominal={"a": 3.0, "b": 5.0, "w": 7.0})).translation.scene, "dae")
    assert dict(zip(own.state_names, own.nominal.tolist(), strict=True)) == {"a": 3.0, "b": 5.0, "w": 7.0}
    sizes = {"x": 3.0, "y": 4.0, "u": 5.0, "v": 6.0, "T": 7.0}
    system = gl.compile(Pendulum(start={"x": 0.6}, guess={"y": -0.8}, nominal=sizes))
    pendulum = scene_form(system.translation.scene, "dae")
    found = dict(zip(pendulum.state_names, pendulum.nominal.tolist(), strict=True))
    assert found == {name: sizes.get(name, 1.0) for name in found}
    assert {"y", "T"} <= set(found)
    assert 1.0 in found.values()


@pytest.mark.parametrize("kind", ["torn", "dae"])
def test_first_values_are_left_to_ida_where_iteration_finds_none(kind: str) -> None:
    """y^2 + 1 = x from x = 0: the states are the start's, and only IDA tells that there is no solution."""

    class Missed(gl.Component):
        x, y = gl.Variable("1", start=0.0), gl.Variable("1", guess=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), 1.0 + self.y), gl.Eq(self.y**2 + 1.0, self.x)]

    system = gl.compile(Missed(), outputs=["y"])
    own, model = scene_form(system.translation.scene, kind), system.translation.model
    start = Start(np.array([0.0]), np.ones(model.n_variables), ())
    x = own.first(own.scene.prepared(model.parameters.defaults), 0.0, start, np.zeros(0), np.zeros(0), None)
    assert x.shape == (len(own.equations.unknowns),)
    assert x[0] == 0.0
