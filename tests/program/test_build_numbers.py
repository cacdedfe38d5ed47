"""What a program is asked for: its states, outputs and slots; and that the equations of the model hold for what it computes."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.equations.kernel import residual_kernel
from gearlib.program.build import Builder, build
from gearlib.program.interpret import evaluate, prepare
from gearlib.structure.sorting import reach, sort_blocks
from tests.program.programs import KINDS, point
from tests.program.test_relations import Counters


class Chain(gl.Component):
    """x follows from an input, y from x, and z from nothing but time; s equals x, r is a rate of a rate."""

    rate = gl.Parameter("1/s", default=2.0)
    u = gl.Input("1")
    x, y, z, s, r, sharp = (gl.Variable("1") for _ in range(6))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * (self.u - self.x)),
            gl.Eq(self.y**3 + self.y, self.x),
            gl.Eq(gl.der(self.z), self.rate * gl.time),
            gl.Eq(self.s, self.x),
            gl.Eq(self.r, gl.der(self.s) / self.rate),
            gl.Eq(self.sharp, gl.Piecewise((self.x, self.z > 1.0), (-self.x, True))),
        ]


@cache
def chain() -> Any:
    return gl.compile(Chain(), outputs=["y", "r", "sharp"]).translation


def node(name: str, order: int = 0) -> tuple[int, int]:
    return chain().model.variable(name), order


def test_states_and_outputs_of_what_is_asked_for() -> None:
    X, Z = node("x"), node("z")
    rates = build(chain().structure, [], (Z, X), dynamic=True)
    assert (rates.states, rates.outputs) == ((Z, X), (node("z", 1), node("x", 1)))
    assert rates.slots.keys() == {Z, X, (chain().model.inputs[0], 0), *rates.outputs}
    value = build(chain().structure, [node("y"), node("y")], None, dynamic=False)
    assert (value.states, value.outputs) == ((X,), (node("y"),))
    assert value.slots.keys() == {X, (chain().model.inputs[0], 0), node("y")}
    assert build(chain().structure, [node("y")], None, dynamic=True).outputs == (node("x", 1),)
    given = build(chain().structure, [node("y")], (Z, X), dynamic=False)
    assert (given.states, given.slots[Z], given.slots[X], given.slots[node("y")]) == ((Z, X), 0, 1, 3)
    for program in (rates, value, given):
        assert program.n_slots == 1 + max(program.slots.values())
        assert program.residuals == ()
        assert not program.linear_blocks  # an unknown of its own equation is assigned
    plain = gl.compile(Bare()).translation
    empty = build(plain.structure, [], (), dynamic=False)
    assert (empty.states, empty.outputs, empty.n_slots, empty.steps) == ((), (), 0, ())


class Bare(gl.Component):
    x = gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), -self.rate * self.x)]


@pytest.mark.parametrize("states", [("x", "z"), ("z", "x")])
def test_slots_before_they_are_put_in_order(states: tuple[str, ...]) -> None:
    """States, inputs, then the unknowns of the blocks; the table has the same by order of derivative and variable."""
    order = tuple(node(name) for name in states)
    unknowns, _ = reach(chain().structure, [node("y"), node("r"), node("sharp"), *((v, 1) for v, _ in order)], dynamic=False)
    blocks = sort_blocks(chain().structure, unknowns)
    builder = Builder(chain().structure, blocks, order)
    nodes = [*order, (chain().model.inputs[0], 0), *(n for block in blocks for n in block)]
    assert builder.inputs == ((chain().model.inputs[0], 0),)
    assert [*builder.slots.items()] == [(n, i) for i, n in enumerate(nodes)]
    assert builder.n_slots == len(nodes)
    expected = np.full((2, chain().model.n_variables), -1)
    for i, (v, k) in enumerate(nodes):
        expected[k, v] = i
    assert builder.table.tolist() == expected.tolist()
    assert len(builder.groups) == len(chain().model.groups) + len(chain().model.updates)


@pytest.mark.parametrize("kind", KINDS)
def test_the_equations_of_the_model_hold(kind: str) -> None:
    """Those all of whose variables the program has computed: with the variables that the instances name, and no rows of a program."""
    p = point(kind)
    model, held = p.scene.model, 0
    for g, group in enumerate(model.groups):
        kernel = residual_kernel(group.template)
        columns = [*group.template.columns, *group.template.relation_columns]
        where = {name: c for c, name in enumerate(group.template.locals)}
        own = {name: c for c, name in enumerate(group.template.parameters)}
        for i in range(len(group.variables)):
            pairs = [(where[columns[c][0]], columns[c][1]) for c in kernel.columns]
            nodes = [(int(group.variables[i, c]), k) for c, k in pairs]
            signs = [int(group.signs[i, c]) for c, _ in pairs]
            if any(sign and n not in p.program.slots for n, sign in zip(nodes, signs, strict=True)):
                continue
            zero = np.zeros(2)
            x = [sign * p.slots[p.program.slots[n]] if sign else zero for n, sign in zip(nodes, signs, strict=True)]
            constants = [
                p.numbers.parameters[group.parameters[i, own[group.template.parameters[c]]]] for c in kernel.parameters
            ]
            n = len(group.template.relations)
            flags = [
                p.flags[model.first_relations[g] + i * n + c]
                if c < n
                else p.flags[model.n_relations + group.discretes[i, c - n]]
                for c in kernel.relations
            ]
            with np.errstate(all="ignore"):
                rest = np.asarray(kernel.function(p.t, *x, *constants, *flags), float) * np.ones(2)
            size = 1.0 + np.abs(p.slots).max(axis=0)
            assert (np.abs(rest) <= 1e-9 * size).all(), group.template.label
            held += 1
    assert held


class Two(gl.Component):
    def assemble(self) -> list[Any]:
        self.one, self.other = Counters(), Counters()
        return []


# what a discrete variable of one component follows, besides its own value before and its condition, now and before
FOLLOWS = {"used": ("when_0", ["behind"]), "behind": ("when_1", []), "alone": ("when_2", [])}


def test_what_is_evaluated_at_events_for_each_entry_of_the_discrete_state() -> None:
    """A relation by itself; a discrete variable for its value and for that before; re-initialised states in any case."""
    translation = gl.compile(Two(), outputs=["one.x", "other.x"]).translation
    model, states = translation.model, translation.scene.states
    builder, n, d = Builder(translation.structure, (), states), model.n_relations, len(model.discretes)
    names = [f"relation {i}" for i in range(n)] + [*model.discretes, *(f"pre({name})" for name in model.discretes)]
    reinits = [("one.x", ["pre(one.when_3)", "one.when_3"]), ("other.x", ["pre(other.when_3)", "other.when_3"])]
    relation_of, met = {}, set()
    for entry in range(n + 2 * d + 1):  # the last is the flag of the start of a run
        places = builder.places(np.array([entry]))
        for (kernel, g, i, kind, target, sign), (state, read) in zip(places[-2:], reinits, strict=True):
            assert (kind, sign, states[target]) == (2, 1, (model.variable(state), 0))
            assert builder.nodes(kernel, g, i) == [states[target]]
            assert sorted(names[e] for e in builder.discrete(kernel, g, i)) == sorted(read)
        if entry == n + 2 * d:
            assert len(places) == 2
            continue
        ((kernel, g, i, kind, target, sign),) = places[:-2]
        nodes, read = builder.nodes(kernel, g, i), [names[e] for e in builder.discrete(kernel, g, i)]
        assert sign == 1
        if entry < n:
            assert (kind, target, read) == (0, entry, [])
            level = float(kernel.function(10.0, *[20.0] * len(nodes)))
            owner = model.name(nodes[0][0]).split(".")[0] if nodes else ("one", "other")[entry % 2]
            assert nodes in ([], [(model.variable(f"{owner}.x"), 0)])
            met.add((owner, 20.0 - level if nodes else 10.0 - level))
            relation_of[owner, 20.0 - level if nodes else "time"] = f"relation {entry}"
            continue
        assert (kind, target, nodes) == (1, n + (entry - n) % d, [])
        owner, _, name = model.discretes[(entry - n) % d].partition(".")
        if name in FOLLOWS:
            condition, others = FOLLOWS[name]
            expected = [f"{owner}.{x}" for x in (condition, *others)] + [f"pre({owner}.{x})" for x in (name, condition)]
            assert sorted(read) == sorted(expected)
        else:
            limit = {"when_0": 1.0, "when_1": -2.0, "when_2": "time", "when_3": 7.0}[name]
            assert read == [relation_of[owner, limit]]
    assert met == {(owner, level) for owner in ("one", "other") for level in (3.0, 1.0, -2.0, 0.5, 7.0)}
    assert builder.places(np.arange(0)) == builder.places(np.array([n + 2 * d]))


@pytest.mark.parametrize(
    ("factor", "pivots"),
    [
        (lambda s: s.p, ["p"]),
        (lambda s: 2.0, []),
        (lambda s: s.x, []),
        (lambda s: s.p * s.x, []),
        (lambda s: s.p + s.q**2, ["p", "q"]),
    ],
    ids=["parameter", "number", "state", "parameter and state", "two parameters"],
)
def test_what_is_divided_by_and_does_not_change_is_checked_beforehand(factor: Any, pivots: list[str]) -> None:
    """``f y = 1``; a divisor that a state changes may vanish at some time, but not always."""

    class Quotient(gl.Component):
        x, y = gl.Variable("1"), gl.Variable("1")
        rate, p, q = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=3.0), gl.Parameter("1", default=0.5)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(factor(self) * self.y, 1.0)]

    translation = gl.compile(Quotient()).translation
    scene, table = translation.scene, translation.model.parameters
    assert [table.names[p] for batch in scene.program.pivots for p in batch.parameters[0]] == pivots
    numbers, none = scene.numbers(table.values), np.empty((0, 1))
    found = evaluate(numbers, np.zeros(1), np.array([[0.8]]), none, none)[scene.program.output_slots, 0]
    divisor = {"p": 3.0, "pq": 3.25}.get("".join(pivots)) or float(factor(Values()))
    assert found == pytest.approx([1.0 / divisor], rel=1e-14)


class Values:
    p, q, x = 3.0, 0.5, 0.8


@pytest.mark.parametrize("tied", [True, False])
def test_blocks_with_constraints_on_states_say_so(tied: bool) -> None:
    """``x^3 + x = 2 y`` gives x at any y; it ties two positions, or gives a number that nothing is integrated of."""

    class Tied(gl.Component):
        x = gl.Variable("1", state="never")
        y, v, w, f = (gl.Variable("1") for _ in range(4))
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            position = gl.Eq(self.x**3 + self.x, 2 * self.y)
            if not tied:
                return [
                    gl.Eq(gl.der(self.y), self.rate * self.w), gl.Eq(gl.der(self.w), -self.rate * self.f), position,
                    gl.Eq(self.v, self.x), gl.Eq(self.f, self.v),
                ]  # fmt: skip
            return [
                gl.Eq(gl.der(self.x), self.rate * self.v), gl.Eq(gl.der(self.y), self.rate * self.w), position,
                gl.Eq(gl.der(self.v), self.rate * (self.f - self.x)), gl.Eq(gl.der(self.w), -self.rate * self.f),
            ]  # fmt: skip

    (block,) = gl.compile(Tied()).translation.scene.program.iterated
    assert (len(block.unknowns), block.constrained) == (1, tied)


class Zones(gl.Component):
    """A number for each of four zones of k x, and another where x is beyond a limit."""

    x, y = gl.Variable("1"), gl.Variable("1")
    k, limit = gl.Parameter("1", default=1.0), gl.Parameter("1", default=5.0)

    def equations(self) -> list[gl.Eq]:
        z = self.k * self.x
        return [
            gl.Eq(
                self.y,
                gl.Piecewise((1.0, z < -1), (2.0, z < 0.5), (4.0, z < 2), (8.0, True))
                + gl.Piecewise((0.0, self.x < self.limit), (16.0, True)),
            )
        ]


class ManyZones(gl.Component):
    x = gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)

    def assemble(self) -> list[Any]:
        self.zones = [Zones(), Zones(k=-2.0), Zones(k=0.3, limit=1.0)]
        return []

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * sum(one.y for one in self.zones)),
            *(gl.Eq(one.x, self.x) for one in self.zones),
        ]


def test_conditions_of_several_instances_are_their_own() -> None:
    """Of several relations in one equation, for each of several components."""
    scene = gl.compile(ManyZones()).translation.scene
    numbers, x = scene.numbers(scene.model.parameters.values), np.linspace(-8.0, 8.0, 33)[None] + 0.01
    none, t = np.zeros((0, x.size)), np.zeros(x.size)
    slots = evaluate(numbers, t, x, none, scene.discrete(numbers, t, x, none))
    for i, (k, limit) in enumerate(((1.0, 5.0), (-2.0, 5.0), (0.3, 1.0))):
        z = k * x[0]
        expected = np.select([z < -1, z < 0.5, z < 2], [1.0, 2.0, 4.0], 8.0) + np.where(x[0] < limit, 0.0, 16.0)
        assert slots[scene.program.slots[scene.model.variable(f"zones[{i}].y"), 0]].tolist() == expected.tolist()


class Fed(gl.Component):
    u, y = gl.Input("1/s"), gl.Variable("1/s")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, 2 * self.u)]


class Feeding(gl.Component):
    """r is the rate of x, q the opposite of it, and an input is bound to it."""

    x, r, q = gl.Variable("1"), gl.Variable("1/s"), gl.Variable("1/s")
    rate = gl.Parameter("1/s", default=3.0)

    def assemble(self) -> list[Any]:
        self.fed = Fed(u=gl.der(self.x))
        return []

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.rate * self.x), gl.Eq(self.r, gl.der(self.x)), gl.Eq(self.q, -gl.der(self.x))]


def test_what_equals_another_unknown_shares_its_slot() -> None:
    """But not what is its opposite; and an input that is bound to it has its own, since it may be varied."""
    translation = gl.compile(Feeding(), outputs=["r", "q", "fed.y"]).translation
    names = {name: (translation.model.variable(name), 0) for name in ("x", "r", "q", "fed.u", "fed.y")}
    program = build(translation.structure, names.values(), translation.scene.states, dynamic=True)
    rate = program.slots[names["x"][0], 1]
    assert program.slots[names["r"]] == rate
    assert len({rate, *(program.slots[names[name]] for name in ("x", "q", "fed.u", "fed.y"))}) == 5
    numbers, none = prepare(program, translation.structure, translation.model.parameters.values), np.zeros((0, 1))
    slots = evaluate(numbers, np.zeros(1), np.array([[0.5]]), none, none)[:, 0]
    found = {name: slots[program.slots[node]] for name, node in names.items()}
    assert found == {"x": 0.5, "r": 1.5, "q": -1.5, "fed.u": 1.5, "fed.y": 3.0}


class Copying(gl.Component):
    """The rate of what is turned round in the whole."""

    y, r = gl.Variable("1"), gl.Variable("1/s")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.r, gl.der(self.y))]


class Turned(gl.Component):
    x = gl.Variable("1")
    rate = gl.Parameter("1/s", default=3.0)

    def assemble(self) -> list[Any]:
        self.same, self.opposite = Copying(), Copying()
        return []

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.rate * self.x), gl.Eq(self.same.y, self.x), gl.Eq(self.opposite.y, -self.x)]


def test_what_equals_the_opposite_of_an_unknown_has_a_slot_of_its_own() -> None:
    """Where the sign comes from the variable, and not from the equation."""
    translation = gl.compile(Turned(), outputs=["same.r", "opposite.r"]).translation
    nodes = {name: (translation.model.variable(name), 0) for name in ("same.r", "opposite.r")}
    program = build(translation.structure, nodes.values(), translation.scene.states, dynamic=True)
    numbers, none = prepare(program, translation.structure, translation.model.parameters.values), np.zeros((0, 1))
    slots = evaluate(numbers, np.zeros(1), np.array([[0.5]]), none, none)[:, 0]
    assert {name: slots[program.slots[node]] for name, node in nodes.items()} == {"same.r": 1.5, "opposite.r": -1.5}
    assert program.slots[nodes["same.r"]] == program.slots[translation.model.variable("x"), 1]
    assert program.slots[nodes["opposite.r"]] != program.slots[nodes["same.r"]]
