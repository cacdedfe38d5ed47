"""What the structure of a small model says of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.flatten.flatten import flatten
from gearlib.reduce.reduction import Structure, analyse, awkward, choose_again, discrete_nodes, reinit_nodes
from tests.reduce.test_discontinuities import RISES, Set
from tests.reduce.test_reduction import Bumped, Pendulum


def structure_of(component: gl.Component) -> Structure:
    model = flatten(component)
    return analyse(model, model.parameters.defaults)


def named(structure: Structure, nodes: Any) -> set[str]:
    return {"der(" * k + structure.model.name(v) + ")" * k for v, k in nodes}


class Memory(gl.Component):
    """An integral of what is no speed, on which nothing depends."""

    y = gl.Variable("1", start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.y), gl.sin(self.y * 0 + gl.time))]


def test_angles_are_those_of_bodies_whatever_comes_first() -> None:
    class Both(gl.Component):
        swapped = gl.Structural(False)

        def assemble(self) -> list[Any]:
            parts = {"body": gp.Inertia(J=1.0), "memory": Memory()}
            for name in sorted(parts, reverse=self.swapped):
                setattr(self, name, parts[name])
            return []

    for swapped in (False, True):
        found = structure_of(Both(swapped=swapped))
        assert {n.rpartition(".")[2] for n in named(found, found.states)} == {"phi", "w", "y"}
        assert {n.rpartition(".")[2] for n in named(found, found.angles)} == {"phi"}


class Kinds(gl.Component):
    """Laws with a relation, with a mode, with both and with neither, of which some are differentiated."""

    x, on = gl.Variable("1", start=0.0), gl.Discrete("mode")
    bend, scaled, plain, still, w = (gl.Variable("1") for _ in range(5))

    def equations(self) -> list[Any]:
        x = self.x
        bend = gl.Piecewise((x - 1, x > 1), (0, True))
        return [
            gl.Eq(gl.der(x), 1), gl.Eq(self.on, gl.Piecewise((1, gl.time > 1), (0, True))),
            gl.Eq(self.bend, bend), gl.Eq(self.scaled, x**2 * gl.pre(self.on)), gl.Eq(self.plain, x**3),
            gl.Eq(self.still, gl.Piecewise((x**2, x > 2), (4, True)) * gl.pre(self.on)),
            gl.Eq(self.w, gl.der(self.bend) + gl.der(self.scaled) + gl.der(self.plain)),
        ]  # fmt: skip


def test_differentiated_equations_that_change_at_events() -> None:
    found = structure_of(Kinds())
    rows = [named(found, row) for row in found.model.rows]
    of = {name: rows.index({name, "x"}) for name in ("bend", "scaled", "plain", "still")}
    assert {e for e, count in enumerate(found.differentiation.counts) if count} == {of["bend"], of["scaled"], of["plain"]}
    assert found.changing == {of["bend"], of["scaled"]}
    assert found.switching == {of["bend"]}


def test_new_values_of_states_depend_on_what_decides_them_through_modes_too() -> None:
    class Hit(gl.Component):
        x, v, far, other = (gl.Variable("1", start=1.0) for _ in range(4))
        count = gl.Discrete("hits")

        def equations(self) -> list[Any]:
            again = gl.When(self.x < 0, gl.reinit(self.v, -self.v * self.count), gl.reinit(self.far, 2.0))
            counted = gl.Eq(self.count, gl.Piecewise((1, self.other > 3), (2, True)))
            rates = [gl.Eq(gl.der(self.x), self.v)] + [gl.Eq(gl.der(n), -1) for n in (self.v, self.far, self.other)]
            return [*rates, counted, again]

    found = structure_of(Hit())
    nodes = {next(iter(named(found, [state]))): named(found, deciding) for state, deciding in reinit_nodes(found.model).items()}
    assert nodes == {"v": {"x", "v", "other"}, "far": {"x", "far"}}
    assert found.at_reinits == reinit_nodes(found.model)


class Reset(Pendulum):
    """With a count that an event sets to zero, and optionally the speed to the right."""

    z, kicked = gl.Variable("1", start=0.0), gl.Structural(False)

    def equations(self) -> list[Any]:
        kicks = [gl.When(gl.time > 2, gl.reinit(self.u, 1))] if self.kicked else []
        return [gl.Eq(gl.der(self.z), 1), gl.When(gl.time > 1, gl.reinit(self.z, 0)), *kicks]


@pytest.mark.parametrize(("kicked", "states"), [(False, "yvz"), (True, "yuz")])
def test_other_states_are_chosen_with_all_that_events_set(kicked: bool, states: str) -> None:
    """Where y moves more than x, but an event sets the speed of x."""
    angle = 1.4
    found = structure_of(Reset(guess={"y": -1.0}, kicked=kicked))
    model = found.model
    assert named(found, found.states) == set("xuz")
    known = np.zeros((3, model.n_variables))
    values = {"x": np.sin(angle), "y": -np.cos(angle), "u": np.cos(angle), "v": np.sin(angle)}
    for name, value in values.items():
        known[0, model.representative[model.variable(name)]] = value
    known[1, [model.representative[model.variable(n)] for n in "xy"]] = values["u"], values["v"]
    again = choose_again(found, model.parameters.defaults, 0.0, known)
    assert again is not None
    assert named(again, again.states) == set(states)
    same = choose_again(again, model.parameters.defaults, 0.0, known)
    assert same is None or same.is_state != again.is_state


class Starting(gl.Component):
    """Equations that ask whether the run is being started, beside a mode that a variable decides."""

    x, y, z, u = (gl.Variable("1", start=0.0) for _ in range(4))
    far, first = gl.Discrete("decided by x"), gl.Discrete("set at the start")

    def equations(self) -> list[Any]:
        at_start = gl.Piecewise((1, gl.initial()), (2, True))
        return [
            gl.Eq(gl.der(self.x), at_start), gl.Eq(gl.der(self.y), gl.pre(self.first)), gl.Eq(gl.der(self.z), self.far),
            gl.Eq(gl.der(self.u), gl.pre(self.far)), gl.Eq(self.far, gl.Piecewise((1, self.x > 1), (0, True))),
            gl.Eq(self.first, gl.Piecewise((1, gl.initial()), (gl.pre(self.first), True))),
            gl.When(self.z > 2, gl.reinit(self.z, at_start)), gl.When(self.z > 3, gl.reinit(self.u, gl.pre(self.far))),
        ]  # fmt: skip


def test_the_start_of_a_run_is_no_mode_that_variables_decide() -> None:
    class Several(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other, self.third = Starting(), Starting(), Starting()
            return []

    found = structure_of(Several())
    model = found.model
    for part in ("one", "other", "third"):
        node = {n: (int(model.representative[model.variable(f"{part}.{n}")]), 0) for n in "xyzu"}
        of = {n: next(e for e, row in enumerate(model.rows) if (node[n][0], 1) in row) for n in "xyzu"}
        assert [found.at_events.get(of[n], []) for n in "xyzu"] == [[], [], [node["x"]], [node["x"]]]
        number = {n: model.discretes.index(f"{part}.{n}") for n in ("far", "first")}
        assert discrete_nodes(model, number["far"]) == [node["x"]]
        assert discrete_nodes(model, number["first"]) == []
        assert found.at_reinits[node["z"]] == [node["z"]]
        assert found.at_reinits[node["u"]] == sorted([node["x"], node["z"], node["u"]])
    assert len(found.at_reinits) == 6


class Cam(gl.Component):
    """A follower on a cam, both with inertia; or a cam alone, of which the follower's place is computed."""

    phi, s, w = gl.Variable("1", start=1.5), gl.Variable("1"), gl.Variable("1")
    v, f = gl.Variable("1"), gl.Variable("1")
    down, heavy = gl.Structural(False), gl.Structural(True)

    def equations(self) -> list[gl.Eq]:
        lift = 3 * (1 - gl.cos(self.phi))
        place = gl.Eq(-self.s, lift) if self.down else gl.Eq(self.s, lift)
        cam = [gl.Eq(gl.der(self.phi), self.w), gl.Eq(gl.der(self.w), -self.f * gl.sin(self.phi)), place]
        follower = [gl.Eq(gl.der(self.s), self.v), gl.Eq(gl.der(self.v), self.f - 1)]
        return cam + (follower if self.heavy else [gl.Eq(self.v, 2 * self.s), gl.Eq(self.f, gl.sin(self.s))])


def cams(order: tuple[str, ...]) -> gl.Component:
    """Some of a light follower, and heavy ones up (two) and down, declared in an order."""

    class Cams(gl.Component):
        def assemble(self) -> list[Any]:
            made = {"light": Cam(heavy=False), "up": Cam(), "also": Cam(), "down": Cam(down=True)}
            for name in order:
                setattr(self, name, made[name])
            return []

    return Cams()


@pytest.mark.parametrize("order", [("light", "up", "down"), ("up", "light", "down"), ("down", "light", "up")])
def test_the_angle_of_a_cam_is_a_state_where_the_follower_moves_faster(order: tuple[str, ...]) -> None:
    """It determines the follower's place at any angle; that determines it in one half of a turn only."""
    found = structure_of(cams(order))
    assert named(found, found.states) == {f"{name}.{state}" for name in order for state in ("phi", "w")}
    counts = {name: 0 for name in order}
    for e, count in enumerate(found.differentiation.counts):
        owner = found.model.owner(*found.model.places[e])
        counts[owner] = max(counts[owner], count)
    assert counts == {"light": 0, "up": 2, "down": 2}


@pytest.mark.parametrize(
    ("wishes", "states"),
    [
        ({"s": "prefer", "v": "prefer"}, {"phi", "w"}),
        ({"phi": "never"}, {"s", "w"}),
        ({"phi": "never", "w": "never"}, {"s", "v"}),
        ({"phi": "avoid", "w": "avoid"}, {"phi", "w"}),
    ],
)
def test_the_angle_of_a_cam_is_a_state_before_what_is_preferred_unless_it_may_never_be(
    wishes: dict[str, Any], states: set[str]
) -> None:
    found = structure_of(Cam(state=wishes))
    assert named(found, found.states) == states


def test_what_is_identically_zero_constrains_nothing() -> None:
    """A pendulum with the torque of a loose flange in its constraint."""

    class Held(gl.Component):
        flange, x, y = gp.Flange("free"), gl.Variable("1", start=0.1), gl.Variable("1")
        u, v, pull, k = gl.Variable("1"), gl.Variable("1"), gl.Variable("1"), gl.Parameter("1/(N.m)", default=1.0)

        def equations(self) -> list[Any]:
            zero = self.k * self.flange.tau
            return [
                gl.Eq(gl.der(self.x), self.u), gl.Eq(gl.der(self.y), self.v), gl.Eq(gl.der(self.u), -self.pull * self.x),
                gl.Eq(gl.der(self.v), -self.pull * self.y - 1), gl.Eq(self.x**2 + self.y**2 * (1 + zero) + zero, 1.0),
                gl.Eq(self.flange.phi, self.x * zero + self.y),
            ]  # fmt: skip

    found = structure_of(Held(guess={"y": -1.0}))
    assert named(found, found.states) == {"x", "u"}


def test_derivatives_are_avoided_as_much_as_absolute_angles() -> None:
    """Of a = b' / 3, the one with the larger coefficient is solved for."""

    class Scaled(gl.Component):
        a, b, f = gl.Variable("1", state="avoid"), gl.Variable("1"), gl.Variable("1")
        factor = gl.Structural(3.0)

        def equations(self) -> list[gl.Eq]:
            rate = gl.der(self.b)
            return [gl.Eq(self.factor * self.a, rate), gl.Eq(gl.der(rate), self.f - self.b), gl.Eq(gl.der(self.a), self.f)]

    for factor, states in ((3.0, {"b", "der(b)"}), (0.25, {"a", "b"})):
        found = structure_of(Scaled(factor=factor))
        assert named(found, found.states) == states


@pytest.mark.parametrize("factor", [0.25, 4.0])
def test_of_constant_ratios_what_the_others_follow_from_is_the_state(factor: float) -> None:
    """Of a = factor b + t and c = factor b + 2 t, with the smaller coefficients and with the larger ones."""

    class Geared(gl.Component):
        a, b, c, f, g = (gl.Variable("1") for _ in range(5))
        ratio = gl.Parameter("1", default=factor)

        def equations(self) -> list[gl.Eq]:
            laws = [gl.Eq(self.a, self.ratio * self.b + gl.time), gl.Eq(self.c, self.ratio * self.b + 2 * gl.time)]
            rates = [gl.Eq(gl.der(self.a), self.f), gl.Eq(gl.der(self.b), self.f + self.g), gl.Eq(gl.der(self.c), -self.g)]
            return [*laws, *rates]

    found = structure_of(Geared())
    assert named(found, found.states) == {"b"}


def test_an_angle_that_is_the_first_variable_lends_its_kind_to_no_other() -> None:
    class Turning(gl.Component):
        flange = gp.Flange("turned at a speed of 1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.flange.phi), 1)]

    class Both(gl.Component):
        def assemble(self) -> list[Any]:
            self.turning, self.memory = Turning(), Memory()
            return []

    found = structure_of(Both())
    assert found.model.potential[0]
    assert named(found, found.states) == {"turning.flange.phi", "memory.y"}
    assert named(found, found.angles) == {"turning.flange.phi"}


def test_what_events_set_stays_a_state_when_others_give_way_to_jumps() -> None:
    class Both(gl.Component):
        def assemble(self) -> list[Any]:
            self.cam, self.jump = Bumped(), Set(u=RISES, state={"x": "prefer", "v": "never"})
            return []

    found = structure_of(Both())
    assert named(found, found.states) == {"cam.phi", "cam.v", "jump.v"}


def test_where_all_coefficients_vary_preferences_hold() -> None:
    """A pendulum between the vertical and the horizontal; x and its speed have starts, which counts less."""
    at = {"x": float(np.sin(0.7)), "u": 0.0}
    for wishes, states in (({}, {"x", "u"}), ({"y": "prefer", "v": "prefer"}, {"y", "v"})):
        found = structure_of(Pendulum(start=at, guess={"y": -float(np.cos(0.7))}, state=wishes))
        assert named(found, found.states) == states


def test_states_are_those_at_the_start_where_coefficients_change_with_time() -> None:
    """At 1 s the constraint cannot be solved for a."""

    class Fading(gl.Component):
        a, b, f = (gl.Variable("1") for _ in range(3))

        def equations(self) -> list[gl.Eq]:
            fades, grows = 1 - gl.time, 1 + gl.time
            rates = [gl.Eq(gl.der(self.a), fades * self.f - self.a), gl.Eq(gl.der(self.b), grows * self.f + 0.5)]
            return [*rates, gl.Eq(fades * self.a + grows * self.b, 1)]

    for preferred, other in ("ab", "ba"):
        found = structure_of(Fading(state={preferred: "prefer"}))
        assert named(found, found.states) == {preferred}
        parameters, unknown = found.model.parameters.defaults, np.zeros((3, found.model.n_variables))
        later = choose_again(found, parameters, 1.0, unknown)  # the larger coefficient is solved for
        assert named(found, (found if later is None else later).states) == {"a"}, other


def test_the_rate_of_a_cams_angle_is_a_state_before_a_preferred_speed_of_the_follower() -> None:
    class Plain(gl.Component):
        phi, s, v, f = gl.Variable("1", start=1.5), gl.Variable("1"), gl.Variable("1", state="prefer"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            turn = gl.Eq(gl.der(gl.der(self.phi)), -self.f * gl.sin(self.phi))
            follower = [gl.Eq(gl.der(self.s), self.v), gl.Eq(gl.der(self.v), self.f - 1)]
            return [turn, gl.Eq(self.s, 3 * (1 - gl.cos(self.phi))), *follower]

    class Lowered(gl.Component):
        """The same with a drop, of which the follower's position is the opposite."""

        drop, phi, s = gl.Variable("1"), gl.Variable("1", start=1.5), gl.Variable("1")
        v, f = gl.Variable("1", state="prefer"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.s, -self.drop), *Plain.equations(self)]

    for cam in (Plain(), Lowered()):
        found = structure_of(cam)
        assert named(found, found.states) == {"phi", "der(phi)"}
    s, sign = int(found.model.representative[found.model.variable("s")]), int(found.model.sign[found.model.variable("s")])
    assert (found.model.name(s), sign) == ("drop", -1)


@pytest.mark.parametrize(
    "order", [("light", "up", "down"), ("up", "light", "down"), ("down", "light", "up"), ("down", "up", "also", "light")]
)
def test_each_differentiated_constraint_tells_for_itself_what_it_is_not_to_be_solved_for(order: tuple[str, ...]) -> None:
    """The angle of its own cam and that one's speed, if there is a follower that it can be solved for instead."""
    found = structure_of(cams(order))
    model = found.model
    names = [model.name(v) for v in range(model.n_variables)]
    for e, row in enumerate(model.rows):
        once = replace(found.differentiation, counts=tuple(int(k == e) for k in range(len(model.rows))))
        held = {names[v] for v, _ in row}
        cam = next((c for c in ("up", "also", "down") if held == {f"{c}.s", f"{c}.phi"}), None)
        assert {names[v] for v in awkward(model, once)} == ({f"{cam}.phi", f"{cam}.w"} if cam else set()), (order, held)
