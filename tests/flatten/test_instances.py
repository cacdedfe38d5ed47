"""What instances are given: start values from within and from outside, inputs, and the parameters behind both."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError, BoundError, ConnectionError, DeclarationError, ModelError
from gearlib.flatten.flatten import flatten
from gearlib.flatten.instances import place_of, walk
from gearlib.flatten.model import FlatModel
from gearlib.language.expressions import real_symbol


def starts(model: FlatModel) -> dict[str, tuple[float, bool]]:
    """Start values by name, each with whether it is fixed."""
    values = model.parameters.defaults
    pairs = zip(model.started.tolist(), model.start_slots.tolist(), model.start_fixed.tolist(), strict=True)
    return {model.name(v): (float(values[slot]), fixed) for v, slot, fixed in pairs}


class Cell(gl.Component):
    x = gl.Variable("m", "place", start=1.0)
    y = gl.Variable("m", "other place", guess=2.0)
    z = gl.Variable("m", "free")
    v = gl.Variable("m/s", "speed")
    a = gl.Derivative("v", "m/s2")
    n = gl.Discrete("count", start=4.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.v), gl.Eq(self.y, 2 * self.x), gl.Eq(self.z, self.x + self.y), gl.Eq(gl.der(self.v), 0),
            gl.Eq(self.n, gl.Piecewise((gl.pre(self.n) + 1, self.x > 9), (0, True))),
        ]  # fmt: skip


class Box(gl.Component):
    start_of_v = gl.Parameter("m/s", default=7.0)

    def assemble(self) -> list[Any]:
        self.cell = Cell(start={"v": self.start_of_v, "y": 3.0}, guess={"z": 9.0})
        return []


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, {"x": (1.0, True), "y": (3.0, True), "z": (9.0, False), "v": (7.0, True)}),
        ({"start": {"cell.x": 5.0}}, {"x": (5.0, True), "y": (3.0, True), "z": (9.0, False), "v": (7.0, True)}),
        (
            {"guess": {"cell.x": 5.0, "cell.y": 6.0}},
            {"x": (5.0, False), "y": (6.0, False), "z": (9.0, False), "v": (7.0, True)},
        ),
        (
            {"start": {"cell.z": 8.0}, "start_of_v": 2.0},
            {"x": (1.0, True), "y": (3.0, True), "z": (8.0, True), "v": (2.0, True)},
        ),
    ],
)
def test_start_values_of_the_outermost_count(given: dict[str, Any], expected: dict[str, tuple[float, bool]]) -> None:
    assert starts(flatten(Box(**given))) == {f"cell.{name}": value for name, value in expected.items()}


def test_start_values_of_one_component() -> None:
    assert starts(flatten(Cell())) == {"x": (1.0, True), "y": (2.0, False)}
    assert starts(flatten(Cell(start={"y": 5.0}))) == {"x": (1.0, True), "y": (5.0, True)}
    assert starts(flatten(Cell(guess={"y": 5.0}))) == {"x": (1.0, True), "y": (5.0, False)}
    assert starts(flatten(Cell(start={"n": 2, "y": 5.0}))) == {"x": (1.0, True), "y": (5.0, True)}
    own = flatten(Cell(start={"n": 2}))
    assert own.discrete_starts.tolist() == [2.0]
    assert flatten(Cell()).discrete_starts.tolist() == [4.0]
    assert "n" not in starts(own)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Cell(guess={"n": 2}), BindingError, r"^n is discrete, and is not searched for; give its value as start=\{'n': \.\.\.\}"),
        (lambda: Cell(start={"n": "a"}), BindingError, r"^start\(n\) is 'a' \(str\); expected a number in 1 \(start value of a disc"),
        (lambda: Cell(start={"a": 2}), BindingError, r"^Cell: start value for 'a', which is the derivative of 'v'.*start=\{'v': \.\.\.\} "),
        (lambda: Cell(guess={"der(x)": 2}), BindingError, r"^Cell: guess value for 'der\(x\)', which is the derivative of 'x'"),
        (lambda: Cell(start={"der(zz)": 2}), BindingError, r"^Cell: start value for 'der\(zz\)', which is not a variable of Cell"),
        (lambda: Cell(start={"der(z)": 2}), BindingError, r"^Cell: start value for 'der\(z\)', which is the derivative of 'z'"),
        (lambda: Cell(start={3: 2}), BindingError, r"^Cell: start value for '3', which is not a variable of Cell"),
        (lambda: Box(start={"cell.xx": 2}), BindingError, r"^Box: start value for 'cell\.xx', which is not a variable of Box; .*cell\.x"),
        (lambda: Box(start={"cel.x": 2}), BindingError, r"^Box: start value for 'cel\.x', which is not a variable of Box"),
        (lambda: Box(start={"cell.x": "a"}), BindingError, r"^start\(cell\.x\) is 'a' \(str\); expected a number in m \(start value\)"),
        (lambda: Box(start={"cell.v": np.inf}), BoundError, r"^start\(cell\.v\) is inf; expected a finite number in m/s"),
        (lambda: Box(start_of_v=2 * gl.time), BindingError, r"^start_of_v is 2\*time; expected a number in m/s: nothing encloses"),
        (lambda: Cell(start={"x": 2 * gl.pi * gl.time}), BindingError, r"^start\(x\) is 2\*pi\*time; expected .* in m: nothing"),
    ],
)  # fmt: skip
def test_start_values_that_cannot_be(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        flatten(make())


class Part(gl.Component):
    """Inputs of every kind."""

    free = gl.Input("N", "given from outside")
    plain = gl.Input("N", "bound by its declaration", default=2.0)
    made = gl.Input("N", "bound to what its component knows", default=lambda p: 3 * p.k + p.free)
    k = gl.Parameter("N", default=1.5)
    sum = gl.Variable("N")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.sum, self.free + self.plain + self.made)]


@pytest.mark.parametrize(
    ("given", "inputs", "total"),
    [
        ({}, {"part.free": 10.0}, 26.5), ({"free": 1.0}, {}, 8.5), ({"plain": None}, {"part.free": 10.0, "part.plain": 20.0}, 44.5),
        ({"made": 5 * gl.time}, {"part.free": 10.0}, 17.0),
        ({"free": 2 * gl.time + 1, "plain": 4.0}, {}, 14.5), ({"k": 2.0, "free": None}, {"part.free": 1.0}, 10.0),
    ],
)  # fmt: skip
def test_inputs_are_bound_by_what_is_given_or_their_default(
    given: dict[str, Any], inputs: dict[str, float], total: float
) -> None:
    class Whole(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = Part(**given)
            return []

    system = gl.compile(Whole())
    assert set(system.inputs) == set(inputs)
    assert system.simulate(1.0, samples=2, inputs=inputs)["part.sum"][-1] == pytest.approx(total)


def test_numbers_in_a_binding_have_no_names_of_their_own_and_a_bound_number_has_the_inputs() -> None:
    class Whole(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = Part(free=4.0 * gl.sin(3.0 * gl.time)), Part(free=7.0)
            return []

    table = flatten(Whole()).parameters
    assert sorted(table.names[k] for k in table.written) == ["one.free#0", "one.free#1", "one.made#0", "other.made#0"]
    assert {"other.free", "other.plain", "one.k"} <= set(table.own_names)
    assert not any("#" in name or name.startswith("start(") for name in table.own_names)
    assert gl.compile(Whole()).simulate(1.0, samples=2, parameters={"other.free": 1.0})["other.sum"][-1] == 8.5


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (lambda w: w.k + w.part.sum, r"part\.k: depends on 'part\.sum', which is a variable; only parameters of the enclosing"),
        (lambda w: 2 * gl.language.expressions.real_symbol("nothing"), r"part\.k: depends on 'nothing', which is unknown; only parameters"),
    ],
)  # fmt: skip
def test_parameters_follow_from_parameters(value: Any, message: str) -> None:
    class Whole(gl.Component):
        k = gl.Parameter("N", default=1.0)

        def assemble(self) -> list[Any]:
            self.part = Part()
            self.part._bindings["k"] = value(self)
            return []

    with pytest.raises(BindingError, match=message):
        flatten(Whole())


def test_components_within_components_end() -> None:
    class Deep(gl.Component):
        level = gl.Structural(0)

        def assemble(self) -> list[Any]:
            if self.level:
                self.i = Deep(level=self.level - 1)
            else:
                self.body = gp.Inertia(J=1.0)
            return []

    assert flatten(Deep(level=200)).instances[-1].path.count(".") == 200
    with pytest.raises(ModelError, match=rf"^{30 * 'i.'}\.\.\.: components within components, 200 levels deep; does"):
        flatten(Deep(level=201))


def test_ports_that_are_loose_and_ports_with_something_inside() -> None:
    class Case(gl.Component):
        flange = gp.Flange("outside")
        spare = gp.Flange("unused")

        def assemble(self) -> list[Any]:
            self.body = gp.Inertia(J=1.0)
            return [gl.connect(self.flange, self.body.flange_a)]

    class Whole(gl.Component):
        def assemble(self) -> list[Any]:
            self.case, self.other = Case(), gp.Inertia(J=1.0)
            return [gl.connect(self.case.flange, self.other.flange_a)]

    model = flatten(Whole())

    def named(ports: Any) -> set[str]:
        return {f"{model.instances[number].path}.{connector}" for number, connector in ports}

    assert named(model.inner_ports) == {"case.flange"}
    assert named(model.loose_ports) == {"case.spare", "case.body.flange_b", "other.flange_b"}


@pytest.mark.parametrize("name", ["body.nothing", "ghost.w", "body"])
def test_an_input_is_bound_to_variables_that_exist(name: str) -> None:
    class Driven(gl.Component):
        def assemble(self) -> Any:
            self.body, self.torque = gp.Inertia(J=1.0), gp.Torque(tau=real_symbol(name))
            return [gl.connect(self.torque.flange, self.body.flange_a)]

    with pytest.raises(BindingError, match=rf"^torque\.tau: '{name}' is not a variable here$"):
        flatten(Driven())


class Moded(gl.Component):
    """Switches at 1 s."""

    mode = gl.Discrete(start=1.0)

    def equations(self) -> list[Any]:
        return [gl.When(gl.time >= 1.0, gl.Eq(self.mode, 3.0))]


def test_an_input_follows_a_discrete_variable_of_another_part() -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.switch, self.body = Moded(), gp.Inertia(J=2.0)
            self.torque = gp.Torque(tau=4.0 * self.switch.mode)
            return [gl.connect(self.torque.flange, self.body.flange_a)]

    run = gl.compile(Driven(), outputs=["body.w"]).simulate(2.0, samples=5)
    assert run["body.w"] == pytest.approx([0.0, 1.0, 2.0, 5.0, 8.0], abs=1e-9)
    assert run["torque.tau"][[0, -1]] == pytest.approx([4.0, 12.0])


class Counting(gl.Component):
    """Counts at an event, and knows whether the run is being started."""

    first, second = gl.Discrete(start=1.0), gl.Discrete(start=2.0)

    def equations(self) -> list[Any]:
        fresh = gl.Piecewise((5.0, gl.initial()), (gl.pre(self.first) + 1, True))
        return [gl.When(gl.time > 1, gl.Eq(self.first, fresh)), gl.Eq(self.second, gl.pre(self.second) + self.first)]


def test_discrete_variables_are_at_their_places_in_the_discrete_state() -> None:
    """Of n = 6: the k-th at k, before an event at n + k, and whether the run is being started at 2 n."""

    class Bound(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.one, self.two, self.load = Counting(), Counting(), gp.Inertia(J=1.0)
            self.now = gp.Torque(tau=self.two.second)
            self.before = gp.Torque(tau=gl.pre(self.two.first) + 2 * self.one.second)
            return [gl.connect(self.load.flange_a, self.now.flange, self.before.flange)]

    model = flatten(Bound())
    assert model.discretes == tuple(f"{path}.{name}" for path in ("one", "two") for name in ("first", "second", "when_0"))
    assert model.discrete_starts[[0, 1, 3, 4]].tolist() == [1.0, 2.0, 1.0, 2.0]
    places = [*(f"{name}" for name in model.discretes), *(f"pre({name})" for name in model.discretes), "initial()"]
    found = {
        tuple(places[k] for k in row)
        for group in (*model.groups, *(update.equations for update in model.updates)) if group.template.discretes
        for row in group.discretes.tolist()
    }  # fmt: skip
    own = [[f"initial(),pre({p}.first),pre({p}.when_0),{p}.when_0", f"{p}.first,pre({p}.second)"] for p in ("one", "two")]
    bound = ["two.second", "one.second,pre(two.first)"]
    assert found == {tuple(names.split(",")) for names in (*own[0], *own[1], *bound)}


def test_a_component_is_assembled_once_more_where_it_may_have_changed() -> None:
    class Growing(gl.Component):
        calls = 0

        def assemble(self) -> list[Any]:
            type(self).calls += 1
            self.body = [gp.Inertia(J=1.0) for _ in range(self.calls)]
            return []

    one = Growing()
    for anew, bodies in ((False, 1), (False, 1), (True, 2), (True, 3), (False, 3)):
        assert len(flatten(one, anew=anew).instances) == 1 + bodies
    assert [len(walk(one, anew).instances) for anew in (False, True)] == [1 + 3, 1 + 4]


def test_units_of_given_values_are_those_of_what_they_are_given_to() -> None:
    class Heavy(gl.Component):
        m = gl.Parameter("kg", default=2.0)

        def assemble(self) -> list[Any]:
            self.body = gp.Inertia(J=self.m)
            return []

    class Whole(gl.Component):
        def assemble(self) -> list[Any]:
            self.heavy = Heavy()
            return []

    for made in (Heavy, Whole):
        with pytest.raises(DeclarationError, match=r"units do not match .*: Heavy: body\.J is in kg\.m2, its value m in kg"):
            flatten(made())


@pytest.mark.parametrize("inside", [False, True])
def test_signals_are_joined_where_nothing_else_is_connected(inside: bool) -> None:
    class Blocks(gl.Component):
        def assemble(self) -> list[Any]:
            self.first, self.second = gp.blocks.Gain(k=2.0, u=3.0), gp.blocks.Gain(k=5.0)
            return [gl.connect(self.first.y, self.second.u)]

    class Whole(gl.Component):
        def assemble(self) -> list[Any]:
            self.blocks = Blocks()
            return []

    model = flatten(Whole() if inside else Blocks())
    assert model.inputs.tolist() == []
    path = "blocks." if inside else ""
    first, second = (int(model.representative[model.variable(path + name)]) for name in ("first.y", "second.u"))
    assert first == second


def test_an_output_of_a_composite_is_the_signal_joined_to_it() -> None:
    class Doubled(gl.Component):
        y = gl.Variable("any", "output signal")

        def assemble(self) -> list[Any]:
            self.gain = gp.blocks.Gain(k=2.0, u=3.0)
            return [gl.connect(self.gain.y, self.y)]

    model = flatten(Doubled())
    assert model.n_equations == model.n_variables
    assert len({int(model.representative[model.variable(name)]) for name in ("y", "gain.y")}) == 1


def test_what_a_value_is_missing_for_is_named() -> None:
    for part, path in ((gp.Inertia(), "J"), (Holding(), "body.J")):
        with pytest.raises(BindingError) as told:
            flatten(part)
        assert str(told.value) == f"{path} has no value; give one in kg.m2 (moment of inertia): J=..."
    with pytest.raises(BindingError) as told:
        flatten(Cell(start={"x": None}))
    assert str(told.value) == "start(x) has no value; give one in m (start value)"


class Holding(gl.Component):
    """A body without an inertia."""

    def assemble(self) -> list[Any]:
        self.body = gp.Inertia()
        return []


def test_a_table_that_an_input_is_bound_to_has_events_at_its_corners() -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.body = gp.Torque(tau=gl.Table([0.0, 1.0, 2.0, 4.0], [0.0, 3.0, 1.0, 2.0])), gp.Inertia(J=2.0)
            return [gl.connect(self.torque.flange, self.body.flange_a)]

    assert flatten(Driven()).n_relations >= 3


@pytest.mark.parametrize("deep", [False, True])
def test_a_connection_to_a_part_of_another_component_is_refused(deep: bool) -> None:
    """Also where both belong to one model."""
    others: list[Any] = []

    class Inside(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.own = gp.Inertia(J=1.0)
            return [gl.connect(self.own.flange_a, others[-1].flange_a)]

    class Model(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.beside = [gp.Inertia(J=1.0)]
            others.append(self.beside[0])
            self.inside = Holder() if deep else Inside()
            return []

    class Holder(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.held = Inside()
            return []

    path = r"inside\.held" if deep else "inside"
    with pytest.raises(ConnectionError, match=rf"^{path}: connects Inertia 'beside\[0\]\.flange_a', which is not part of it; "):
        flatten(Model())


def test_the_place_of_a_variable_is_its_instance_and_its_name_there() -> None:
    """Of instances without variables, which begin where the next one does, none is a place."""

    class Empty(gl.Component):
        def assemble(self) -> list[Any]:
            return []

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.nothing, self.b, self.c, self.last = (
                gp.Inertia(J=1.0),
                Empty(),
                gp.Damper(d=1.0),
                gp.Inertia(J=2.0),
                Empty(),
            )
            return []

    tree = walk(Row())
    found = [place_of(tree, variable) for variable in range(tree.n_variables)]
    assert found == [(instance, name) for instance in tree.instances for name in instance.declared.variables]
    assert list(dict.fromkeys(instance.path for instance, _ in found)) == ["a", "b", "c"]


class Joint(gl.Component):
    """Nothing but a connection of its own flanges."""

    flange_a, flange_b = gp.Flange(), gp.Flange()

    def assemble(self) -> Any:
        return [gl.connect(self.flange_a, self.flange_b)]


def test_a_component_may_be_nothing_but_a_connection() -> None:
    class Two(gl.Component):
        def assemble(self) -> Any:
            self.torque, self.x, self.joint, self.y = gp.Torque(tau=6.0), gp.Inertia(J=1.0), Joint(), gp.Inertia(J=2.0)
            return [
                gl.connect(self.torque.flange, self.x.flange_a),
                gl.connect(self.x.flange_b, self.joint.flange_a),
                gl.connect(self.joint.flange_b, self.y.flange_a),
            ]

    assert gl.simulate(Two(), 1.0, samples=2)["y.w"] == pytest.approx([0.0, 2.0])
