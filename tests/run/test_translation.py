"""Compiled models: their parameters by path, units, states and the derivatives of parameters by others."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, LoopError, NameLookupError
from gearlib.linear.operating_point import operating_point
from gearlib.run.translation import asked_scene, output_nodes, translate
from tests.program.test_derivatives import Bound


@cache
def bound() -> Any:
    return gl.compile(Bound()).translation


def test_parameters_follow_from_each_other_unless_given() -> None:
    """a.J = density width size^4, and b.J = 2 a.J + 5 density size^5."""
    names = bound().model.parameters.index
    found = bound().parameter_values({"size": 0.5})
    J = 7800.0 * 0.05 * 0.5**4
    assert found[names["a.J"]] == pytest.approx(J)
    assert found[names["b.J"]] == pytest.approx(2 * J + 5 * 7800.0 * 0.5**5)
    found = bound().parameter_values({"a.J": 3.0})
    assert found[names["a.J"]] == 3.0
    assert found[names["b.J"]] == pytest.approx(6.0 + 5 * 7800.0 * 0.2**5)
    assert (
        bound().parameter_values(None).tolist()
        == bound().parameter_values({}).tolist()
        == bound().model.parameters.defaults.tolist()
    )
    for number in (1, np.int64(1), np.float32(1.0), 1.0):
        assert bound().parameter_values({"size": number})[names["size"]] == 1.0


@pytest.mark.parametrize("value", [True, "1", None, [1.0], 1j, np.timedelta64(1, "s")])
def test_what_is_no_number_is_refused(value: Any) -> None:
    with pytest.raises(ArgumentError, match=r"^parameter size is .*; expected a number$"):
        bound().parameter_values({"size": value})


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
def test_numbers_out_of_bounds_are_refused_alike_whatever_their_type(value: float) -> None:
    said = []
    for number in (value, np.float64(value)):
        with pytest.raises(gl.GearlibError) as refused:
            bound().parameter_values({"a.J": number})
        said.append(str(refused.value))
    assert said[0] == said[1]
    assert "a.J" in said[0]


def test_derivatives_of_parameters_by_others() -> None:
    """Through two levels of bindings; not of those that were given."""
    names, numbers = bound().model.parameters.names, bound().parameter_values({})
    h = 1e-6
    for given in ([], ["a.J"]):
        fixed = {name: float(numbers[bound().model.parameters.index[name]]) for name in given}
        changes = np.zeros((len(names), 2))
        for p, k, weight in bound().parameter_changes(["size", "density"], numbers, given):
            changes[p, k] += weight
        for k, (name, value) in enumerate((("size", 0.2), ("density", 7800.0))):
            up, down = (bound().parameter_values({**fixed, name: value * (1 + s * h)}) for s in (1, -1))
            assert changes[:, k] == pytest.approx((up - down) / (2 * h * value), rel=1e-6, abs=1e-9)
    assert changes[bound().model.parameters.index["a.J"]].tolist() == [0.0, 0.0]


def by_differences(J: float, size: float = 0.2) -> float:
    """d b.w(1) / d size with a.J given."""
    ends = [
        gl.compile(Bound(), outputs=["b.w"]).simulate(1.0, times=[1.0], parameters={"size": size + h, "a.J": J})["b.w"][0]
        for h in (1e-5, -1e-5)
    ]
    return float((ends[0] - ends[1]) / 2e-5)


@pytest.mark.parametrize("runs", [2, 9], ids=["one by one", "together"])
def test_parameters_given_in_a_sweep_follow_from_no_others(runs: int) -> None:
    """So that the gradient of each run holds them fixed."""
    system, values = gl.compile(Bound(), outputs=["b.w"]), np.linspace(3.0, 4.0, runs)
    found = system.sweep(
        {"a.J": values}, 1.0, times=[1.0], reduce={"slope": lambda result: result.gradient({"b.w": [1.0]}, ["size"])["size"]}
    )
    for J, slope in ((values[0], found["slope"][0]), (values[-1], found["slope"][-1])):
        assert slope == pytest.approx(by_differences(float(J)), rel=1e-5)


def test_parameters_given_to_a_run_stay_given_at_its_moments() -> None:
    """And in the runs that go on from it: what follows from them does not count as given."""
    system = gl.compile(Bound())
    first = system.simulate(1.0, times=[0.0, 1.0], parameters={"a.J": 3.0})
    later = system.simulate(2.0, start=first)
    assert (first.request.given, later.request.given) == (("a.J",), ("a.J",))  # type: ignore[attr-defined]
    own = bound().parameter_changes(["size"], first.request.parameters, ["a.J"])  # type: ignore[attr-defined]
    changed = {bound().model.parameters.names[p] for p, _, weight in own if weight}
    assert {"b.J", "rim.J"} <= changed
    assert "a.J" not in changed
    for result, t in ((first, 1.0), (later, 2.0)):
        translation = system.translation
        _, _, point = operating_point(translation, translation.structure.states, (result, t))
        assert point.change is not None
        assert point.change(["size"]).parameters == own


def test_units_of_variables_derivatives_and_parameters() -> None:
    assert [bound().unit(name) for name in ("a.w", "der(a.w)", "torque.tau")] == ["rad/s", "rad/s/s", "N.m"]
    assert {name: bound().parameter_units[name] for name in ("size", "a.J", "gear.ratio")} == {
        "size": "m",
        "a.J": "kg.m2",
        "gear.ratio": "1",
    }


class Ends(gl.Component):
    """Bodies of any inertia, also none, at both ends of a shaft."""

    a, b = gl.Parameter("kg.m2", default=1.0), gl.Parameter("kg.m2", default=1.0)

    def assemble(self) -> list[Any]:
        self.torque, self.shaft = gp.Torque(tau=3.0), gp.SpringDamper(c=10.0, d=1.0)
        self.one, self.two = gp.Inertia(J=self.a), gp.Inertia(J=self.b)
        ends = ((self.torque.flange, self.one.flange_a), (self.one.flange_b, self.shaft.flange_a))
        return [*(gl.connect(*two) for two in ends), gl.connect(self.shaft.flange_b, self.two.flange_a)]


def test_a_system_fits_parameters_that_are_not_those_it_was_compiled_with() -> None:
    """From zeros, which are substituted into the equations, to others and back; a massless end follows the shaft at once."""
    kinds = [{"a": a, "b": b} for a, b in ((1.0, 1.0), (0.0, 2.0), (0.5, 2.0))]
    systems = [gl.compile(Ends(**kind), outputs=["two.w"]) for kind in kinds]
    expected = [system.simulate(1.0, times=[0.5, 1.0])["two.w"] for system in systems]
    assert expected[1] == pytest.approx([0.75, 1.5])  # the torque by the other inertia
    for system, own in zip(systems, kinds, strict=True):
        assert len(system.translation.special) == (own["a"] == 0.0)
        for kind, speeds in zip(kinds, expected, strict=True):
            assert system.simulate(1.0, times=[0.5, 1.0], parameters=kind)["two.w"] == pytest.approx(speeds), (own, kind)
            fitted, numbers = system.translation.fitted(kind)
            assert fitted.special == ["one.J = 0"] * (kind["a"] == 0.0)
            assert numbers.tolist() == fitted.parameter_values(kind).tolist()


class Driven(gl.Component):
    def assemble(self) -> list[Any]:
        self.one, self.two, self.body, self.other = gp.Torque(), gp.Torque(), gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        return [gl.connect(self.one.flange, self.body.flange_a), gl.connect(self.two.flange, self.other.flange_a)]


def test_inputs_that_outputs_need() -> None:
    whole = translate(Driven(), None)
    assert whole.inputs == whole.open_inputs == whole.needed_inputs == ("one.tau", "two.tau")
    assert translate(Driven(), ("other.w",)).needed_inputs == ("two.tau",)
    assert translate(Driven(), ("other.w", "body.w")).needed_inputs == ("one.tau", "two.tau")
    assert translate(Driven(), ()).needed_inputs == ()
    table = gl.Table([0.0, 1.0], [0.0, 1.0])
    signals = whole.input_signals({"two.tau": table})
    assert signals == [0.0, table]
    assert whole.input_signals(None) == [0.0, 0.0]
    with pytest.raises(NameLookupError, match=r"^the model has no unbound input 'two.taux'; "):
        whole.input_signals({"two.taux": 1.0})
    with pytest.raises(NameLookupError, match=r"no unbound input 'body.w'; it is bound in the model, or no input$"):
        whole.input_signals({"body.w": 1.0})


def test_scenes_with_other_states_are_made_once() -> None:
    whole = translate(Driven(), ("body.w",))
    own, states = whole.scene, whole.structure.states
    assert whole.with_states(own.states) is own
    assert whole.with_states(states) is whole.with_states(states)
    assert whole.with_states(states).states == states
    assert whole.scene_of(own.states, (), own.outputs) is own
    (node,) = whole.nodes(["other.a"])
    other = whole.scene_of(own.states, (), (node,))
    assert other is not own
    assert other.outputs == (node,)
    assert whole.states == own.state_names == ("body.w",)


def test_scenes_of_outputs() -> None:
    """The states that they need, and what else is computed; of everything, the states without absolute angles."""
    structure = translate(Driven(), None).structure
    model = structure.model
    asked = asked_scene(structure, ("other.a", "other.w"))
    assert [model.name(v) for v, _ in asked.states] == ["other.w"]
    assert asked.outputs == tuple(n for n in output_nodes(structure, ("other.a",)) if n not in asked.states)
    everything = asked_scene(structure, None)
    assert everything.outputs == ()
    assert not set(everything.states) & set(structure.angles)
    read = asked_scene(structure, ("other.w",), ("body.w",))
    assert sorted(model.name(v) for v, _ in read.states) == ["body.w", "other.w"]


def test_progress_of_a_translation() -> None:
    told: list[float] = []
    translate(Driven(), None, told.append)
    assert told == sorted(told)
    assert all(0.0 < share <= 1.0 for share in told)
    assert told


class Row(gl.Component):
    """A torque on a body that may have no mass, and so many others behind a shaft."""

    count = 1
    J = gl.Parameter("kg.m2", default=1.0)

    def assemble(self) -> list[Any]:
        self.torque, self.first = gp.Torque(tau=6.0), gp.Inertia(J=self.J)
        self.shaft, self.others = gp.SpringDamper(c=10.0, d=1.0), [gp.Inertia(J=1.0) for _ in range(type(self).count)]
        return [
            gl.connect(self.torque.flange, self.first.flange_a),
            gl.connect(self.first.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, *(body.flange_a for body in self.others)),
        ]


def test_parts_are_those_of_the_compilation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where zeros have equations derived anew, what assemble() would make by now does not count."""
    system = gl.compile(Row(), outputs=["others[0].w"])
    monkeypatch.setattr(Row, "count", 3)
    assert system.simulate(1.0, samples=2, parameters={"J": 0.0})["others[0].w"] == pytest.approx([0.0, 6.0])
    assert gl.compile(Row()).simulate(1.0, samples=2, parameters={"J": 0.0})["others[0].w"] == pytest.approx([0.0, 2.0])


class Chosen(Row):
    """The same, with one of two bodies behind the shaft."""

    behind = 0

    def assemble(self) -> list[Any]:
        self.torque, self.first = gp.Torque(tau=6.0), gp.Inertia(J=self.J)
        self.shaft, self.others = gp.SpringDamper(c=10.0, d=1.0), [gp.Inertia(J=1.0), gp.Inertia(J=1.0)]
        return [
            gl.connect(self.torque.flange, self.first.flange_a),
            gl.connect(self.first.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.others[type(self).behind].flange_a),
        ]


def test_connections_are_those_of_the_compilation(monkeypatch: pytest.MonkeyPatch) -> None:
    system = gl.compile(Chosen(), outputs=["others[0].w"])
    monkeypatch.setattr(Chosen, "behind", 1)
    assert system.simulate(1.0, samples=2, parameters={"J": 0.0})["others[0].w"] == pytest.approx([0.0, 6.0])
    assert gl.compile(Chosen()).simulate(1.0, samples=2, parameters={"J": 0.0})["others[0].w"].tolist() == [0.0, 0.0]


class Around(gl.Component):
    """Two bodies that two discs join: the angles of both must be the same."""

    one, other = gl.Parameter("rad", default=0.0), gl.Parameter("rad", default=0.0)
    J = gl.Parameter("kg.m2", default=0.0)

    def assemble(self) -> list[Any]:
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=1.0 + self.J)
        self.first, self.second = gp.Disc(delta_phi=self.one), gp.Disc(delta_phi=self.other)
        return [
            gl.connect(self.a.flange_b, self.first.flange_a, self.second.flange_a),
            gl.connect(self.b.flange_a, self.first.flange_b, self.second.flange_b),
        ]


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_what_closes_a_loop_has_no_derivative(angle: float) -> None:
    """Of the two angles neither may change alone, whether or not they are zero; the inertia may."""
    translation = gl.compile(Around(one=angle, other=angle)).translation
    numbers, index = translation.parameter_values({}), translation.model.parameters.index
    for names in (["one"], ["other"], ["J", "one"]):
        with pytest.raises(
            LoopError, match=rf"^there is no derivative with respect to {names[-1]}: equations of .* follow from the"
        ):
            translation.parameter_changes(names, numbers, [])
    changes = {translation.model.parameters.names[p]: w for p, _, w in translation.parameter_changes(["J"], numbers, [])}
    assert changes["J"] == changes["b.J"] == 1.0
    assert index["one"] not in {p for p, _, _ in translation.parameter_changes(["J"], numbers, [])}
    with pytest.raises(LoopError):
        translation.parameter_values({"one": angle + 0.1})


def test_a_model_without_inputs_takes_none() -> None:
    translation = gl.compile(gp.Inertia(J=1.0)).translation
    assert translation.input_signals(None) == translation.input_signals({}) == []
    with pytest.raises(NameLookupError, match=r"^the model has no unbound input 'torque.tau'; "):
        translation.input_signals({"torque.tau": 1.0})


class Modes(gl.Component):
    """Two discrete variables with start values, one of which moves the state."""

    x = gl.Variable("any", start=1.0)
    n, m = gl.Discrete(start=2.0), gl.Discrete(start=3.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.n + self.m),
            gl.When(self.x > 100.0, gl.Eq(self.n, 0.0)),
            gl.When(self.x > 200.0, gl.Eq(self.m, 0.0)),
        ]


def test_start_values_of_discrete_variables() -> None:
    """Those that are given, beside those of the model; where none is given, none is kept."""
    translation = gl.compile(Modes()).translation
    scene, numbers = translation.scene, translation.parameter_values({})

    def begun(start: Any) -> Any:
        return translation.start(scene, numbers, 0.0, start, (), accepts_discrete=True)

    names = list(translation.model.discretes)
    for given, expected in (({"n": 7.0}, [7.0, 3.0]), ({"m": 8.0, "n": 7.0}, [7.0, 8.0]), ({"m": 8.0, "x": 4.0}, [2.0, 8.0])):
        found = begun(given)
        assert [found.given[names.index(name)] for name in ("n", "m")] == expected
        place = translation.model.n_relations
        assert [found.discrete[place + names.index(name)] for name in ("n", "m")] == expected
        assert found.states.tolist() == [given.get("x", 1.0)]
    assert begun({"x": 4.0}).given is None
    assert translation.model.discrete_starts[[names.index("n"), names.index("m")]].tolist() == [2.0, 3.0]
    with pytest.raises(NameLookupError, match=r"^n is a discrete variable; its start value is part of the model"):
        translation.start(scene, numbers, 0.0, {"n": 7.0}, ())


def test_what_decided_the_equations_has_no_derivative() -> None:
    """A zero that was substituted, by its own name and by that of the parameter that it follows from."""
    massless = gl.compile(Ends()).translation.fitted({"a": 0.0})[0]
    numbers = massless.parameter_values({"a": 0.0})
    for name, what in (("a", "a changes one.J, which"), ("one.J", "one.J")):
        with pytest.raises(ArgumentError) as refused:
            massless.parameter_changes([name], numbers, [])
        assert str(refused.value) == (
            f"{what} is 0, and that decided which equation determines what: there is no derivative with respect to it; give another "
            "value: parameters={'one.J': ...}"
        )
    assert massless.parameter_changes(["b"], numbers, [])


class Doubled(gl.Component):
    """Two gears in a row, and one beside them with the product of their ratios."""

    ratio = gl.Parameter("1", default=3.0)
    beside = gl.Parameter("1", default=lambda s: s.ratio**2)

    def assemble(self) -> list[Any]:
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        self.one, self.two = gp.IdealGear(ratio=self.ratio), gp.IdealGear(ratio=self.ratio)
        self.other = gp.IdealGear(ratio=self.beside)
        return [
            gl.connect(self.a.flange_b, self.one.flange_a, self.other.flange_a),
            gl.connect(self.one.flange_b, self.two.flange_a),
            gl.connect(self.two.flange_b, self.other.flange_b, self.b.flange_a),
        ]


@pytest.mark.parametrize("ratio", [3.0, -0.5])
def test_a_loop_that_closes_with_a_curved_binding_has_a_derivative(ratio: float) -> None:
    """Of what all its ratios follow from; of none of them alone, and not where one of them is given."""
    translation = gl.compile(Doubled(ratio=ratio)).translation
    numbers, names = translation.parameter_values({}), translation.model.parameters.names
    changes = {names[p]: w for p, _, w in translation.parameter_changes(["ratio"], numbers, [])}
    assert changes["two.ratio"] == 1.0
    assert changes["other.ratio"] == pytest.approx(2 * ratio)
    for name, given in (("beside", []), ("two.ratio", []), ("ratio", ["beside"])):
        with pytest.raises(LoopError, match=rf"^there is no derivative with respect to {name}: "):
            translation.parameter_changes([name], numbers, given)


@pytest.mark.parametrize("left", [{"redundant": ("a",)}, {"closed": ("a",)}], ids=str)
def test_sums_after_which_an_equation_says_nothing_are_refused(left: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.run.translation.analyse", lambda model, parameters: replace(bound().structure, **left))
    with pytest.raises(LoopError, match=r"^what is left of equations says nothing new$"):
        bound().with_sums((), bound().parameter_values({}))


def test_of_the_outputs_those_are_computed_that_are_neither_states_nor_inputs_nor_nothing() -> None:
    class Mixed(gl.Component):
        u, v = gl.Input("any"), gl.Variable("any")
        x, y, z = gl.Variable("any", start=1.0), gl.Variable("any"), gl.Variable("any")

        def equations(self) -> list[Any]:
            rate = gl.Eq(gl.der(self.x), self.u - self.x)
            return [rate, gl.Eq(self.y, 2 * self.x + self.u), gl.Eq(self.z, 0.0), gl.Eq(self.v, self.u)]

    for outputs, computed, states in (
        (["u", "v", "z"], [], ()), (["x"], [], ("x",)), (["x", "y", "u", "y"], [("y", 0)], ("x",)), (["der(x)"], [("x", 1)], ("x",)),
    ):  # fmt: skip
        scene = gl.compile(Mixed(), outputs=outputs).translation.scene
        assert [(scene.model.name(v), order) for v, order in scene.outputs] == computed
        assert scene.state_names == states
