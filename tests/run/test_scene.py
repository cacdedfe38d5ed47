"""Scenes: names, what variables need, and the data blocks of runs."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import NameLookupError, SingularError, SolverError
from gearlib.run.afterwards.branch import iterated_unknowns
from gearlib.run.scene import (
    Scene,
    guess_of,
    needed_discretes,
    needed_inputs,
    needed_states,
    node_name,
    relation_names,
    root_names,
)
from gearlib.run.start_values import starts_of_runs
from tests.program.test_derivatives import Loop
from tests.program.test_relations import counters


class Two(gl.Component):
    """A spring between a driven body and a braked one; beside them a body on its own."""

    def assemble(self) -> list[Any]:
        self.torque, self.other, self.third = gp.Torque(), gp.Torque(), gp.Torque()
        self.a, self.b, self.alone = gp.Inertia(J=0.5, start={"w": 3.0}), gp.Inertia(J=2.0), gp.Inertia(J=1.0)
        self.shaft, self.brake, self.ground = gp.SpringDamper(c=8.0, d=0.1), gp.Damper(d=0.3), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.a.flange_a), gl.connect(self.a.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.b.flange_a, self.other.flange), gl.connect(self.b.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange), gl.connect(self.third.flange, self.alone.flange_a),
        ]  # fmt: skip


@cache
def everything() -> Any:
    return gl.compile(Two()).translation


@cache
def two_outputs() -> Any:
    return gl.compile(Two(), outputs=["shaft.tau", "b.w"]).translation


def test_names_of_derivatives() -> None:
    model, v = everything().model, everything().model.variable("a.w")
    assert [node_name(model, (v, k)) for k in range(3)] == ["a.w", "der(a.w)", "der(der(a.w))"]


def test_states_are_those_that_outputs_need() -> None:
    assert sorted(two_outputs().scene.state_names) == ["a.w", "b.w", "shaft.phi_rel"]
    assert set(everything().scene.state_names) > set(two_outputs().scene.state_names)
    assert "alone.w" in everything().scene.state_names
    scene, model = two_outputs().scene, two_outputs().model
    assert [scene.place_of[s] for s in scene.states] == list(range(3))
    assert scene.rates == [(v, k + 1) for v, k in scene.states]
    w = (model.variable("alone.w"), 0)
    assert scene.missing(w) == (w,)
    assert scene.missing((model.variable("shaft.tau"), 0)) == ()
    phi = scene.named("a.phi")[0]
    (angle,) = scene.missing(phi)  # of whichever body it stands for
    assert angle in two_outputs().structure.angles
    assert needed_states(two_outputs().structure, [(model.variable("b.w"), 0)]) == tuple(sorted(scene.states))
    assert needed_states(two_outputs().structure, []) == ()


def test_inputs_are_those_that_variables_depend_on() -> None:
    def needed(*names: str) -> tuple[str, ...]:
        return needed_inputs(everything().structure, [everything().scene.named(name)[0] for name in names])

    assert needed("b.w") == ("torque.tau", "other.tau")
    assert needed("alone.w") == needed("alone.a") == ("third.tau",)
    assert set(needed("alone.w", "shaft.tau")) == {"torque.tau", "other.tau", "third.tau"}
    assert needed() == ()


class Reset(gl.Component):
    """Two integrals; one takes the value of an input at an instant."""

    u, v = gl.Input("1"), gl.Input("1")
    x, y = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), 0.0), gl.Eq(gl.der(self.y), self.v), gl.When(gl.time >= 0.5, gl.reinit(self.x, self.u))]


def test_inputs_that_are_read_at_an_instant_are_needed() -> None:
    system = gl.compile(Reset(), outputs=["x"])
    assert "u" in system.translation.needed_inputs
    with pytest.warns(gl.GearlibWarning, match="no value was given for the input"):
        run = system.simulate(1.0, samples=3, start={"x": 2.0})
    assert "u" in run.stats["zero_inputs"]
    assert run["x"].tolist() == [2.0, 0.0, 0.0]


def test_discrete_variables_that_follow_each_other() -> None:
    def needed(name: str) -> list[str]:
        found = needed_discretes(counters().structure, [counters().scene.named(name)[0]])
        return [counters().model.discretes[d] for d in found if not counters().model.discretes[d].startswith("when_")]

    assert needed("der(x)") == ["used", "behind"] or sorted(needed("der(x)")) == ["behind", "used"]
    assert needed("y") == []


def test_variables_by_name_with_their_sign() -> None:
    node, sign = everything().scene.named("shaft.flange_a.tau")
    other, opposite = everything().scene.named("shaft.flange_b.tau")
    assert (node, sign) == (other, -opposite)
    assert everything().scene.named("alone.flange_b.tau")[1] == 0
    with pytest.raises(NameLookupError, match=r"a\.ww"):
        everything().scene.named("a.ww")


def test_states_on_which_others_depend() -> None:
    """A trace keeps those that states may need that are asked for later; nothing where all are integrated."""
    scene = two_outputs().scene
    assert scene.feeding is not None
    assert {scene.state_names[i] for i in scene.feeding} == {"b.w"}  # the absolute angle; alone.w follows from its input
    whole = everything().with_states(everything().structure.states)
    assert whole.feeding is None
    assert [everything().structure.states[i] for i in scene.places] == list(scene.states)
    variables, orders = scene.everything
    assert list(zip(variables.tolist(), orders.tolist(), strict=True)) == list(everything().structure.states)
    own, derivatives = scene.starting
    assert own.tolist() == [v for v, _ in scene.states]
    assert derivatives.tolist() == [i for i, (_, k) in enumerate(scene.states) if k]


def test_every_slot_has_a_name() -> None:
    scene = everything().scene
    assert len(scene.slot_names) == scene.program.n_slots
    for slot in scene.program.slots.values():
        assert scene.slot_names[slot] in {node_name(scene.model, n) for n, s in scene.program.slots.items() if s == slot}
    named = {*scene.program.slots.values()}
    assert [scene.slot_names[i] for i in range(scene.program.n_slots) if i not in named] == [
        f"known_{i}" for i in range(scene.program.n_slots) if i not in named
    ]


def test_names_of_relations_are_those_of_components() -> None:
    names = relation_names(counters().structure, counters().scene.relations)
    relations = counters().scene.relations
    assert relations is not None
    assert sorted(names) == relations.used.tolist()
    assert counters().scene.root_names == root_names(relations, names) == tuple(names[int(k)] for k in relations.searched)
    assert (relation_names(everything().structure, None), root_names(None, {})) == ({}, ())


def test_variables_computed_together_have_one_program() -> None:
    scene = Scene(
        everything().structure,
        everything().scene.states,
        (),
        (everything().scene.named("shaft.tau")[0], everything().scene.named("brake.tau")[0]),
    )
    first, second = scene.outputs
    assert scene.computing(first) is scene.computing(second)
    assert set(scene.outputs) <= scene.computing(first).slots.keys()
    third = everything().scene.named("a.a")[0]
    alone = scene.computing(third)
    assert alone is not scene.computing(first)
    fourth, fifth = everything().scene.named("b.a")[0], everything().scene.named("alone.a")[0]
    scene.compute_together([fourth, fifth, third, first, scene.states[0]])
    assert scene.computing(fourth) is scene.computing(fifth)
    assert scene.computing(third) is alone
    assert scene.states[0] not in scene._computing


def test_start_values_of_iterations() -> None:
    """Of variables, by their slots; derivatives begin at zero."""
    translation = gl.compile(Loop()).translation
    program, start = translation.scene.program, np.arange(1.0, 1.0 + translation.model.n_variables)
    found = guess_of(program, start)
    for (v, k), slot in program.slots.items():
        assert found[slot] == (start[v] if k == 0 else 0.0)
    _, ((unknown, order),) = iterated_unknowns(program)
    assert (translation.model.name(unknown), order) == ("b", 0)


def test_data_of_a_run() -> None:
    """Parameters, discrete state and inputs at their places, and the guess in the slots; a second block is a copy with its own numbers."""
    translation = gl.compile(Loop()).translation
    scene, native = translation.scene, translation.scene.native
    start = np.linspace(0.1, 0.9, translation.model.n_variables)
    for values, u in (({}, 2.0), ({"length": 0.6}, -1.0)):
        numbers = scene.prepared(translation.parameter_values(values))
        data = scene.data(native, numbers, np.array([u]), np.zeros(scene.n_discrete), start)
        assert len(data) == native.size
        assert data[: len(numbers.parameters)].tolist() == numbers.parameters.tolist()
        assert data[native.shared.inputs] == u
        layout = native.rhs.layout
        assert data[layout.slots :][: scene.program.n_slots].tolist() == guess_of(scene.program, start).tolist()
        own = np.arange(float(scene.program.n_slots))
        data = scene.data(native, numbers, np.array([u]), np.zeros(scene.n_discrete), start, own)
        assert data[layout.slots :][: len(own)].tolist() == own.tolist()
    solved, none = everything().scene, (np.zeros(3), np.zeros(0), np.zeros(everything().model.n_variables))
    one, other = (solved.prepared(everything().parameter_values({"a.J": J})) for J in (0.5, 0.7))
    blocks = [solved.data(solved.native, numbers, *none) for numbers in (one, other, one)]
    assert blocks[0].tolist() == blocks[2].tolist()
    assert blocks[0].tolist() != blocks[1].tolist()
    blocks[0][:] = 7.0
    assert blocks[2].tolist() != blocks[0].tolist()


def test_regular_scenes_and_others() -> None:
    class Divided(gl.Component):
        p = gl.Parameter("1", default=2.0)
        x, y = gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.p * gl.der(self.x), self.y), gl.Eq(self.y, -self.x)]

    scene = gl.compile(Divided()).translation.scene
    assert scene.can_be_prepared(np.array([2.0]))
    assert not scene.can_be_prepared(np.array([0.0]))
    with pytest.raises(SingularError, match="p = 0"):
        scene.prepared(np.array([0.0]))
    assert (scene.on_time, scene.searched, counters().scene.searched) == (False, False, True)


def test_starts_of_many_runs() -> None:
    """Fixed values that contradict each other in a run give no numbers there."""
    table = np.stack([everything().parameter_values({})] * 2, axis=1)
    found = starts_of_runs(everything().scene, table)
    assert found is not None
    assert found.shape == (2, len(everything().scene.states))
    assert found[:, everything().scene.state_names.index("a.w")].tolist() == [3.0, 3.0]
    assert (everything().scene.unfixed is not None) == (found is not None)


@pytest.mark.parametrize("method", ["rk5", "ida"])
def test_errors_are_relative_to_the_size_that_a_variable_declares(method: str) -> None:
    """A vibration of 1e-9: with a size of 1, it would lie below the absolute tolerance."""

    def worst(size: float) -> float:
        own = {name: gl.Variable("1", start=start, nominal=size) for name, start in (("x", 1e-9), ("v", 0.0))}
        own["equations"] = lambda s: [gl.Eq(gl.der(s.x), 7 * s.v), gl.Eq(gl.der(s.v), -7 * s.x)]  # type: ignore[assignment]
        found = gl.simulate(type("Tiny", (gl.Component,), own)(), 5.0, samples=51, method=method, rtol=1e-6)
        return float(np.abs(found["x"] - 1e-9 * np.cos(7 * found.time)).max() / 1e-9)

    assert worst(1e-9) < 1e-3
    assert worst(1.0) > 0.1


def test_a_discrete_variable_that_no_event_sets() -> None:
    """It follows from parameters alone; x rises with it."""

    class Constant(gl.Component):
        k = gl.Parameter("any", default=2.0)
        x, n = gl.Variable("any", start=0.0), gl.Discrete()

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), self.n), gl.Eq(self.n, 3 * self.k)]

    system = gl.compile(Constant())
    relations = system.translation.scene.relations
    assert relations is not None
    assert (len(relations.used), len(relations.discretes), len(relations.reinits)) == (0, 1, 0)
    run = system.simulate(1.0, samples=3, parameters={"k": 4.0})
    assert run["n"].tolist() == [12.0, 12.0, 12.0]
    assert run["x"] == pytest.approx([0.0, 6.0, 12.0])


@pytest.mark.parametrize(
    ("rate", "flag", "on_time"),
    [(1.0, 1.0, False), (gl.sin(gl.time), 1.0, True), (1.0, gl.time, True), (gl.sin(gl.time), gl.time, True)],
)
def test_time_in_rates_or_conditions(rate: Any, flag: Any, on_time: bool) -> None:
    """Those on time alone do not count: steps end at their switches."""

    class Timed(gl.Component):
        x, n, m = gl.Variable("any", start=0.0), gl.Discrete(), gl.Discrete()

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), rate - self.x),
                gl.When(self.x > 0.5 * flag, gl.Eq(self.n, 1.0)),
                gl.When(gl.time > 0.5, gl.Eq(self.m, 1.0)),
            ]

    assert gl.compile(Timed()).translation.scene.on_time == on_time


def test_what_is_set_at_the_start_follows_from_no_other() -> None:
    """gl.initial() is no discrete variable of the model."""

    class Begun(gl.Component):
        x, y = gl.Variable("any", start=0.0), gl.Variable("any", start=0.0)
        first, second = gl.Discrete(), gl.Discrete()

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), self.second),
                gl.Eq(gl.der(self.y), self.first),
                gl.When(gl.time > 0.5, gl.Eq(self.first, 1.0)),
                gl.When(gl.initial(), gl.Eq(self.second, 4.0)),
            ]

    translation = gl.compile(Begun()).translation
    names = translation.model.discretes
    for rate, own in (("der(x)", "second"), ("der(y)", "first")):
        found = [names[k] for k in needed_discretes(translation.structure, [translation.scene.named(rate)[0]])]
        assert [name for name in found if not name.startswith("when_")] == [own]
        assert len(found) == 2


class Deciding(gl.Component):
    """y rises by what the sign of x decides; z is set to y when w passes 1."""

    x, w = gl.Variable("1", start=1.0), gl.Variable("1", start=0.0)
    y, z, alone = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), -1.0),
            gl.Eq(gl.der(self.w), 2.0),
            gl.Eq(gl.der(self.y), gl.Piecewise((3.0, self.x > 0.0), (1.0, True))),
            gl.Eq(gl.der(self.z), 0.0),
            gl.Eq(gl.der(self.alone), 1.0),
            gl.When(self.w > 1.0, gl.reinit(self.z, self.y)),
        ]


@pytest.mark.parametrize(("output", "states"), [("y", ["x", "y"]), ("z", ["w", "x", "y", "z"]), ("x", ["x"])])
def test_states_that_events_depend_on_are_needed(output: str, states: list[str]) -> None:
    assert sorted(gl.compile(Deciding(), outputs=[output]).states) == states


class Tipping(gl.Component):
    """Equations that are iterated, and a count of how often their solution has passed one: they are solved at events as well."""

    x = gl.Variable("1", start=0.0)
    y, n = gl.Variable("1"), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), 1.0 + 0.0 * self.y),
            gl.Eq(self.y**3 + self.y, self.x + self.n),
            gl.When(self.y > 1.0, gl.Eq(self.n, gl.pre(self.n) + 1.0)),
        ]


def test_a_run_that_goes_on_begins_events_on_its_branch() -> None:
    """What the program of events iterates begins at the slots of the run, and at start values where there are none."""
    translation = gl.compile(Tipping(), outputs=["y", "n"]).translation
    scene, native = translation.scene, translation.scene.native
    assert scene.relations is not None
    assert native.update is not None
    events = scene.relations.program
    shared = {node: slot for node, slot in scene.program.slots.items() if node in events.slots}
    assert events.iterated
    assert shared
    start = np.linspace(0.1, 0.9, translation.model.n_variables)
    given = scene.prepared(translation.parameter_values({})), np.zeros(0), np.zeros(scene.n_discrete), start
    own = 10.0 + np.arange(float(scene.program.n_slots))
    for slots in (None, own):
        data = scene.data(native, *given, slots)[native.update.layout.slots :][: events.n_slots]
        right = guess_of(events, start)
        for node, slot in shared.items() if slots is not None else ():
            right[events.slots[node]] = own[slot]
        assert data.tolist() == right.tolist()


def test_a_start_at_which_equations_have_no_solution_is_refused() -> None:
    """Of y^2 + 1 = x there is none from x = 0; on the way to the discrete state it would be passed over."""

    class Missed(gl.Component):
        x, y, n = gl.Variable("1", start=0.0), gl.Variable("1", guess=1.0), gl.Discrete()

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), 1.0),
                gl.Eq(self.y**2 + 1.0, self.x),
                gl.When(self.y > 1.0, gl.Eq(self.n, gl.pre(self.n) + 1.0)),
            ]

    translation = gl.compile(Missed(), outputs=["y", "n"]).translation
    scene, numbers = translation.scene, translation.scene.prepared(translation.parameter_values({}))
    guess = np.ones(translation.model.n_variables)
    for x, solved in ((5.0, True), (0.0, False)):
        given = numbers, np.zeros(1), np.array([[x]]), np.zeros((0, 1))
        if solved:
            assert scene.discrete(*given, start=guess)[:, 0].any()
        else:
            with pytest.raises(SolverError, match=r"y"):
                scene.discrete(*given, start=guess)


class Resets(gl.Component):
    """x takes the value of y when w passes 1, at a rate that z decides; nothing depends on alone."""

    w, x, y, z, alone = (gl.Variable("1") for _ in range(5))

    def equations(self) -> list[Any]:
        rate = gl.Piecewise((2.0, self.z > 0.5), (1.0, True))
        return [
            gl.Eq(gl.der(self.w), 1.0),
            gl.Eq(gl.der(self.x), rate),
            gl.Eq(gl.der(self.y), 3.0),
            gl.Eq(gl.der(self.z), 1.0),
            gl.Eq(gl.der(self.alone), 1.0),
            gl.When(self.w > 1.0, gl.reinit(self.x, self.y)),
        ]


def test_states_that_decide_an_event_or_give_its_values_are_needed() -> None:
    translation = gl.compile(Resets()).translation
    model, structure = translation.model, translation.structure

    def needed(*names: str) -> set[str]:
        return {node_name(model, node) for node in needed_states(structure, [(model.variable(name), 0) for name in names])}

    assert needed("x") == {"w", "x", "y", "z"}
    assert needed("y") == {"y"}
    assert needed("alone", "w") == {"alone", "w"}


class Unsolvable(gl.Component):
    """An unknown y whose square is below zero until x is positive; whether y is above 1 decides the rate."""

    x, y = gl.Variable("1"), gl.Variable("1", start=None)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), gl.Piecewise((1.0, self.y > 1.0), (2.0, True))), gl.Eq(self.y**2, self.x + 0 * self.y)]


def test_an_unknown_without_a_value_at_the_start_is_named() -> None:
    translation = gl.compile(Unsolvable(guess={"y": 1.0}), outputs=["x"]).translation
    scene, numbers = translation.scene, translation.scene.prepared(translation.parameter_values({}))

    def flags(x: float) -> Any:
        return scene.discrete(
            numbers, np.zeros(1), np.array([[x]]), np.empty((0, 1)), start=np.full(scene.model.n_variables, 1.0)
        )

    assert flags(4.0)[0].tolist() == [1.0]
    assert flags(0.25)[0].tolist() == [0.0]
    with pytest.raises(SolverError):
        flags(-1.0)


class Gauge(gl.Component):
    """A spring with the rate of its twist, which is limited, and the power of a loss in it, on which nothing depends."""

    a, b, c = gp.Flange("one end"), gp.Flange("other end"), gl.Parameter("N.m/rad", default=400.0)
    d = gl.Parameter("N.m.s/rad", default=0.1)
    twist, rate, lost = gl.Variable("rad"), gl.Variable("rad/s", min=-1e3), gl.Variable("W")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.twist, self.b.phi - self.a.phi),
            gl.Eq(self.rate, gl.der(self.twist)),
            gl.Eq(self.lost, self.d * self.rate**2),
            gl.Eq(self.b.tau, self.c * self.twist),
            gl.Eq(self.a.tau, -self.b.tau),
        ]


class Gauged(gl.Component):
    """A body on the ground behind a spring, and a torque on another spring behind it."""

    def assemble(self) -> list[gl.Connection]:
        self.ground, self.first, self.gauge, self.torque = gp.Fixed(), gp.SpringDamper(c=100.0, d=5.0), Gauge(), gp.Torque()
        self.body = gp.Inertia(J=1.0)
        return [
            gl.connect(self.ground.flange, self.first.flange_a),
            gl.connect(self.first.flange_b, self.body.flange_a),
            gl.connect(self.body.flange_b, self.gauge.a),
            gl.connect(self.gauge.b, self.torque.flange),
        ]


@pytest.mark.parametrize("start", [None, "steady"])
def test_what_needs_the_rate_of_an_input_is_left_out(start: Any) -> None:
    """Nothing else depends on it: neither the search for a steady state, nor what is compared with a limit, asks for it."""
    system = gl.compile(Gauged())
    with pytest.warns(
        gl.GearlibWarning, match=r"the minimum of gauge\.rate is not checked: this needs the derivative of an input"
    ):
        run = system.simulate(20.0, samples=2, inputs={"torque.tau": 8.0}, start=start)
    assert run["first.phi_rel"][-1] == pytest.approx(0.08, rel=1e-6)
    assert run["gauge.twist"] == pytest.approx([0.02, 0.02], rel=1e-12)
    for name in ("gauge.rate", "gauge.lost"):
        with pytest.raises(NameLookupError, match=rf"{name} needs the derivative of an input, so it is not computed"):
            run[name]
