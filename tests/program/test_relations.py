"""Which relations and discrete variables a program follows: those that it depends on, directly or through others."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.build import build, slot_table
from gearlib.program.event_iteration import compares_with_before, relation_of, right_hand
from gearlib.program.interpret import owner_of
from gearlib.program.relations import jumps_below, relations_of, used_discrete
from tests.program.programs import point


class Counters(gl.Component):
    """x is driven by ``used``, which follows ``behind``; ``alone`` follows time only, and nothing needs it."""

    rate = gl.Parameter("1/s", default=1.0)
    x = gl.Variable("1")
    y = gl.Variable("1")
    used = gl.Discrete("1")
    behind = gl.Discrete("1")
    alone = gl.Discrete("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.rate * (1.0 + self.used)),
            gl.Eq(self.y, gl.Piecewise((1.0, self.x > 3.0), (2.0, True))),
            gl.When(self.x >= 1.0, gl.Eq(self.used, self.behind + 1.0)),
            gl.When(self.x <= -2.0, gl.Eq(self.behind, 5.0)),
            gl.When(gl.time >= 0.5, gl.Eq(self.alone, gl.pre(self.alone) + 1.0)),
            gl.When(self.x >= 7.0, gl.reinit(self.x, -1.0)),
        ]


@cache
def counters() -> Any:
    return gl.compile(Counters(), outputs=["x"]).translation


def followed(wanted: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> Any:
    """The relations of the states' rates, or of some outputs; with the discrete variables that they set, by name."""
    model, structure = counters().model, counters().structure
    states = counters().scene.states
    nodes = [(model.variable(name), 0) for name in outputs] or counters().scene.rates
    program = build(structure, nodes, states, dynamic=not outputs)
    found = relations_of(structure, program, [model.discretes.index(name) for name in wanted])
    names = {model.discretes[int(t) - model.n_relations] for b in found.discretes for t in b.targets}
    return found, {name for name in names if not name.startswith("when_")}  # whose conditions have flags of their own


def test_only_what_is_needed_is_followed() -> None:
    found, names = followed()
    assert names == {"used", "behind"}
    assert len(found.reinits) == 1
    assert (len(found.timed), len(found.searched)) == (0, 3)  # the conditions of used, behind and the reinit
    found, names = followed(("alone",))
    assert names == {"used", "behind", "alone"}
    assert (len(found.timed), len(found.searched)) == (1, 3)
    assert sorted([*found.timed, *found.searched]) == found.used.tolist()
    assert {int(t) for b in found.batches for t in b.targets} == set(found.used.tolist())


def test_a_relation_of_an_output_alone() -> None:
    """y depends on whether x > 3, and on no discrete variable; a reinit of x is followed in any case."""
    found, names = followed(outputs=("y",))
    assert names == set()
    assert len(found.searched) == 2
    program = build(counters().structure, [(counters().model.variable("y"), 0)], counters().scene.states, dynamic=False)
    assert len(used_discrete(program)) == 1
    assert set(used_discrete(program).tolist()) <= set(found.used.tolist())


def test_slots_by_variable_and_order() -> None:
    table = slot_table({(0, 0): 4, (2, 1): 7, (1, 0): 5}, 4)
    assert table.tolist() == [[4, 5, -1, -1], [-1, -1, 7, -1]]
    assert slot_table({}, 2).tolist() == [[-1, -1]]


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        (lambda x: x > 1.0, (True, False)), (lambda x: x >= 1.0, (False, False)), (lambda x: x < 1.0, (True, True)),
        (lambda x: x <= 1.0, (False, True)),
    ],
)  # fmt: skip
def test_a_relation_is_strict_or_not_and_negated_or_not(condition: Any, expected: tuple[bool, bool]) -> None:
    """And it holds where the condition does, on both sides and at the limit."""

    class One(gl.Component):
        x = gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), self.rate * gl.Piecewise((1.0, condition(self.x)), (2.0, True)))]

    relations = gl.compile(One()).translation.scene.relations
    assert relations is not None
    (phase,) = relations.event_iteration.event_functions
    found = relation_of(phase.batch).strict, relation_of(phase.batch).negated
    for x in (0.0, 1.0, 2.0):
        g = (1.0 if found == expected else -1.0) * (x - 1.0)
        holds = phase.hold(np.array([g]))[0]
        assert bool(holds) == bool(condition(x)) or found != expected
    assert found[0] == expected[0]
    assert not compares_with_before(phase.batch)


def test_values_before_an_event_are_known() -> None:
    class Memory(gl.Component):
        x = gl.Variable("1")
        n = gl.Discrete("1")
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), self.rate * (1.0 + self.n)),
                gl.When(self.x >= gl.pre(self.n) + 1.0, gl.Eq(self.n, gl.pre(self.n) + 1.0)),
            ]

    relations = gl.compile(Memory()).translation.scene.relations
    assert relations is not None
    assert [compares_with_before(phase.batch) for phase in relations.event_iteration.event_functions] == [True]


def test_the_right_hand_limit_of_time_is_just_later() -> None:
    """By a trillionth of the time, and of a millisecond at least."""
    t = np.array([0.0, 1e-3, -1e-3, 2.0, -5.0, 1e6])
    assert right_hand(t) - t == pytest.approx([1e-15, 1e-15, 1e-15, 2e-12, 5e-12, 1e-6], rel=1e-3, abs=0.0)


class Idle(gl.Component):
    z = gl.Variable("1")

    def equations(self) -> list[Any]:
        return [gl.Eq(self.z, 1.0)]


def test_rules_know_their_components() -> None:
    """By path, each its own: for messages that name what an event iteration keeps changing."""

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other, self.rest = Counters(), Counters(), [Idle() for _ in range(4)]
            return []

    translation = gl.compile(Two(), outputs=["one.x", "other.x"]).translation
    model, structure = translation.model, translation.structure
    program = build(structure, translation.scene.rates, translation.scene.states, dynamic=True)
    found, owners = relations_of(structure, program), set()
    for batch in found.discretes:
        for target, equation in zip(batch.targets.tolist(), batch.equations.tolist(), strict=True):
            owners.add(owner_of(structure, equation))
            assert model.discretes[target - model.n_relations].startswith(f"{owner_of(structure, equation)}.")
    assert owners == {"one", "other"}
    assert len(found.timed) == 0
    everything = relations_of(structure, program, range(len(model.discretes)))
    of_time = {int(t) for b in everything.batches if b.kernel.on_time for t in b.targets}
    assert len(of_time) == 2
    assert everything.timed.tolist() == sorted(of_time)
    (reinit,) = found.reinits
    assert [owner_of(structure, e) for e in reinit.equations] == [
        model.name(program.states[state][0]).rpartition(".")[0] for state in reinit.targets
    ]


class Restarted(gl.Component):
    """y decays, and is set to p where x = t reaches 1: at once, or behind a counter."""

    counted = gl.Structural(False)
    p = gl.Parameter("1", default=3.0)
    rate = gl.Parameter("1/s", default=1.0)
    x, y = gl.Variable("1"), gl.Variable("1", start=0.5)
    level = gl.Discrete("1", start=1.0)

    def equations(self) -> list[Any]:
        reached = self.level >= 2.0 if self.counted else self.x >= 1.0
        return [
            gl.Eq(gl.der(self.x), self.rate), gl.Eq(gl.der(self.y), -self.rate * self.y),
            gl.When(self.x >= gl.pre(self.level), gl.Eq(self.level, gl.pre(self.level) + 1.0)),
            gl.When(reached, gl.reinit(self.y, self.p)),
        ]  # fmt: skip


@pytest.mark.parametrize("outputs", [("y",), ("x", "y"), ("x",)])
@pytest.mark.parametrize("counted", [False, True])
def test_states_on_which_a_reinit_depends_are_integrated(counted: bool, outputs: tuple[str, ...]) -> None:
    """Although no rate needs them; the restarted state may also be asked for only afterwards."""
    times = np.array([0.0, 0.9, 1.0, 1.5])
    run = gl.compile(Restarted(counted=counted), outputs=list(outputs)).simulate(1.5, times=times, rtol=1e-10)
    assert run["x"] == pytest.approx(times, abs=1e-12)
    assert run["y"] == pytest.approx(np.where(times < 1.0, 0.5 * np.exp(-times), 3.0 * np.exp(1.0 - times)), rel=1e-8)


class Stepped(gl.Component):
    """Two masses whose positions are tied by ``x = 2 y + f`` where f changes at an event: f itself jumps, its slope, or its curvature."""

    kind = gl.Structural("step")
    rate, p = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=0.2)
    x, y, v, w, u, f = (gl.Variable("1") for _ in range(6))
    m = gl.Discrete("1")

    def equations(self) -> list[Any]:
        kinds = {
            "step": lambda: gl.Piecewise((0.0, self.u > 1), (self.p, self.u > -7), (2 * self.p, True)),
            "bend": lambda: gl.Piecewise((0.0, self.u > 1), (self.p * (self.u - 1), True)),
            "curve": lambda: gl.Piecewise((0.0, self.u > 1), (self.p * (self.u - 1) ** 2, True)),
            "discrete": lambda: self.p * self.m,
            "both": lambda: gl.Piecewise((0.0, self.u > 1), (self.p, True)) + self.rate * self.m,
            "smooth": lambda: self.p * gl.sin(self.u),
        }
        return [
            gl.Eq(gl.der(self.x), self.rate * self.v), gl.Eq(gl.der(self.y), self.rate * self.w),
            gl.Eq(gl.der(self.v), self.rate * (self.f + 1)), gl.Eq(2 * gl.der(self.w), -self.rate * self.f),
            gl.Eq(self.x, 2 * self.y + kinds[self.kind]()), gl.Eq(self.u, self.y + 1),
            gl.When(self.y > 3, gl.Eq(self.m, 1.0)),
        ]  # fmt: skip


class TwoStepped(gl.Component):
    kind = gl.Structural("step")

    def assemble(self) -> list[Any]:
        self.a, self.b = Stepped(kind=self.kind), Stepped(kind=self.kind)
        return []


@pytest.mark.parametrize(
    ("kind", "orders"), [("step", [0]), ("bend", [1]), ("curve", []), ("discrete", [0]), ("both", [0]), ("smooth", [])]
)
def test_equations_that_jump_below_the_derivatives_that_are_used(kind: str, orders: list[int]) -> None:
    """The constraint is used twice differentiated: its value and its first derivative may jump, and do if p is not zero."""
    outputs = [f"{part}.{name}" for part in "ab" for name in "xy"]
    translation = gl.compile(TwoStepped(kind=kind), outputs=outputs).translation
    model, structure, program = translation.model, translation.structure, translation.scene.program
    values, places = model.parameters.values.copy(), {}
    for part in "ab":
        tied = {model.variable(f"{part}.{name}") for name in "xy"}
        (constraint,) = (e for e in range(len(model.places)) if tied <= {v for v, _ in model.nodes(e, 0)})
        g, i = model.places[constraint]
        first = int(model.first_relations[g])
        value = model.n_relations + model.discretes.index(f"{part}.m")
        places[part, constraint] = {
            "discrete": [value],
            "both": [first + i, value],
            "step": [first + 2 * i, first + 2 * i + 1],
        }.get(kind, [first + i])
    for p in ((0.2, 0.3), (0.0, 0.2), (-3.0, 0.0))[: 1 if kind == "both" else 3]:
        own = dict(zip("ab", p, strict=True))
        values[[model.parameters.index[f"{part}.p"] for part in "ab"]] = p
        found = {(jump.equation, jump.order, tuple(jump.places.tolist())) for jump in jumps_below(structure, program, values)}
        assert found == {
            (e, k, tuple(where)) for (part, e), where in places.items() for k in orders if own[part] or kind == "discrete"
        }
    if kind not in ("discrete", "both", "smooth"):
        assert {e for where in places.values() for e in where} <= {*relations_of(structure, program).used.tolist()}


def test_a_time_that_events_change_is_not_known_beforehand() -> None:
    """An alarm that is set anew each time, beside one at a time that a parameter tells; rules of the root are named by its class."""

    class Alarms(gl.Component):
        rate, p = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=0.7)
        x = gl.Variable("1")
        n, following = gl.Discrete("1"), gl.Discrete("1", start=0.5)

        def equations(self) -> list[Any]:
            t = self.rate * gl.time
            return [
                gl.Eq(gl.der(self.x), self.rate * (self.n + gl.Piecewise((1.0, t > self.p), (2.0, True)))),
                gl.When(t >= gl.pre(self.following), gl.Eq(self.following, gl.pre(self.following) + 0.5)),
                gl.When(t >= gl.pre(self.following) - 0.25, gl.Eq(self.n, gl.pre(self.n) + 1)),
            ]

    translation = gl.compile(Alarms()).translation
    relations, structure = translation.scene.relations, translation.structure
    assert relations is not None
    assert (len(relations.timed), len(relations.searched)) == (1, 2)
    (timed,) = (b for b in relations.batches if {*b.targets.tolist()} == {*relations.timed.tolist()})
    assert not timed.relations.size
    assert {owner_of(structure, int(e)) for b in relations.discretes for e in b.equations} == {"Alarms"}


def test_a_program_without_conditions_has_no_discrete_state() -> None:
    """In assignments and blocks of all kinds; where there are conditions, each entry is named once and in order."""
    for kind, count in (("bound", 0), ("loop", 0), ("held", 1)):
        program = point(kind).program
        found = used_discrete(program)
        assert len(found) == count
        assert found.tolist() == sorted({int(e) for batch in point(kind).batches for e in batch.relations.ravel()})


def test_each_part_reads_its_own_relations_of_those_of_its_equation() -> None:
    """Three conditions and their order, in each of three parts."""

    class Stepped(gl.Component):
        x = gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), gl.Piecewise((1, self.x > 1), (2, self.x > 2), (3, self.x > 3), (4, True)))]

    class Three(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = [Stepped() for _ in range(3)]
            return []

    translation = gl.compile(Three()).translation
    (batch,) = translation.scene.program.steps
    first = translation.model.first_relations[translation.model.places[int(batch.equations[0])][0]]
    assert batch.relations.tolist() == [[first + 3 * row + j for j in batch.kernel.relations] for row in range(3)]


@pytest.mark.parametrize("timed", [True, False])
def test_a_state_that_is_set_at_a_known_time(timed: bool) -> None:
    """The time is known beforehand, whatever the state is set to, and whichever numbers both have."""

    class Set(gl.Component):
        x, y = gl.Variable("1"), gl.Variable("1")
        rate, p = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=0.5)

        def equations(self) -> list[Any]:
            reached = self.rate * gl.time >= self.p if timed else self.y >= self.p
            return [
                gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(gl.der(self.y), self.rate),
                gl.When(reached, gl.reinit(self.x, self.x + 2 * self.y)),
            ]  # fmt: skip

    translation = gl.compile(Set(), outputs=["x", "y"]).translation
    relations = translation.scene.relations
    assert relations is not None
    assert (relations.timed.tolist(), relations.searched.tolist()) == (([0], []) if timed else ([], [0]))
    (batch,) = relations.reinits
    assert [relations.program.states[k] for k in batch.targets] == [(translation.model.variable("x"), 0)]
