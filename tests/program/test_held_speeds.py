"""Speeds that a discrete state holds: by brakes on bodies that accelerate each other, in every combination."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.held_speeds import held_speeds
from gearlib.program.interpret import evaluate
from gearlib.program.program import Newton
from tests.linear.test_held_states import Bent, Coasting


class Braked(gl.Component):
    """A body under a reaction; ``soft`` is how far the locked brake gives way, in proportion to the reaction."""

    w, r, common = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    J, held, soft, other, drag = (gl.Parameter("1", default=value) for value in (2.0, 1.0, 1e-25, 0.0, 0.3))
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        acceleration = gl.der(self.w) / self.rate
        return [
            gl.Eq(self.J * acceleration + 0.5 * self.common, 1.0 - self.r),
            gl.Eq(
                gl.Piecewise(
                    (acceleration + self.soft * self.r + self.other * self.common, self.held > 0.5),
                    (self.r - 0.4 - self.drag * self.w, True),
                ),
                0,
            ),
        ]


class Bodies(gl.Component):
    """Three of them, each of which feels the acceleration of all."""

    def assemble(self) -> list[Any]:
        self.body = [Braked(J=2.0), Braked(J=3.0), Braked(J=50.0)]
        return []

    def equations(self) -> list[gl.Eq]:
        total = sum(gl.der(one.w) / one.rate for one in self.body)
        return [gl.Eq(one.common, total) for one in self.body]


class Always(Bodies):
    """The same beside a body that its parameters hold, whatever the discrete state."""

    w, r, soft, other, rate = gl.Variable("1"), gl.Variable("1"), *(gl.Parameter("1", default=v) for v in (1e-25, 0.0, 1.0))

    def equations(self) -> list[Any]:
        acceleration, common = gl.der(self.w) / self.rate, self.body[0].common
        return [
            gl.Eq(acceleration + 0.5 * common, 1.0 - self.r),
            gl.Eq((2.0 + gl.sin(gl.time)) * acceleration + self.soft * self.r + self.other * common, 0),
        ]  # fmt: skip


@cache
def bodies() -> Any:
    return gl.compile(Bodies()).translation


def found(translation: Any, values: dict[str, float], x: Any, u: Any = (), t: float = 0.3) -> Any:
    """The rows at a point, in the order of the states' names."""
    scene = translation.scene
    numbers = scene.numbers(translation.parameter_values(values))
    at = np.array([t]), np.array(x, float)[:, None], np.array(u, float).reshape(-1, 1)
    flags = scene.discrete(numbers, *at)
    slots = evaluate(numbers, *at, flags)
    return held_speeds(translation.structure, numbers, t, slots[:, 0], flags[:, 0])[:, np.argsort(scene.state_names)]


@pytest.mark.parametrize("held", [*product((0.0, 1.0), repeat=3)], ids=str)
def test_a_braked_body_is_held_and_another_is_not(held: tuple[float, ...]) -> None:
    rows = found(bodies(), {f"body[{i}].held": value for i, value in enumerate(held)}, [0.2, -0.7, 1.1])
    assert sorted(rows.tolist(), reverse=True) == np.eye(3)[np.flatnonzero(held)].tolist()


@pytest.mark.parametrize(
    ("values", "count"),
    [
        ({}, 3), ({"body[1].soft": 1e-22}, 3), ({"body[1].soft": 1e-3}, 2), ({"body[1].soft": -1e-3}, 2),
        ({"body[0].other": 0.1, "body[2].other": -0.1}, 1), ({"body[1].other": 1e-24}, 3),
        ({"body[1].rate": 1e-3, "body[1].soft": 1e-18}, 3), ({"body[1].rate": 1e3, "body[1].soft": 1e-22}, 2),
        ({f"body[{i}].{name}": 0.0 for i in range(3) for name in ("held", "drag")}, 0),
    ],
    ids=str,
)  # fmt: skip
def test_what_gives_way_holds_nothing(values: dict[str, float], count: int) -> None:
    """Nor what ties two accelerations to each other; artificial compliances do not count."""
    rows = found(bodies(), values, [0.2, -0.7, 1.1])
    assert rows.shape == (count, 3)
    assert (rows.sum(axis=1) == 1.0).all()


@pytest.mark.parametrize("x", [(0.6, 1.5), (-2.0, 0.3), (0.0, 1.0)])
def test_a_speed_that_is_no_state_is_held_by_its_slopes(x: tuple[float, float]) -> None:
    """``s = w (1 + p^2)`` changes by ``2 p w`` per position and ``1 + p^2`` per speed."""
    bent = gl.compile(Bent()).translation
    place = dict(zip(bent.scene.state_names, range(2), strict=True))
    p, w = x
    point = [0.0, 0.0]
    point[place["w"]], point[place["x"]] = w, p
    assert found(bent, {}, point) == pytest.approx(np.array([[1 + p**2, 2 * p * w]]), rel=1e-14)
    assert found(bent, {"held": 0.0}, point).shape == (0, 2)


def test_nothing_holds_a_rotor_that_coasts() -> None:
    """Whose drive is off; nor one that is driven."""
    coasting = gl.compile(Coasting()).translation
    for x in ([0.5, 0.5], [1.5, 1.5]):
        assert found(coasting, {}, x).shape == (0, 2)


@pytest.mark.parametrize("x", [0.5, 1.5])
def test_a_drive_that_is_off_holds_nothing_though_it_is_solved_together_with_the_rotor(x: float) -> None:
    """Its torque is unknown, but does not answer to the acceleration where x is 0.5; two inputs drive what it has nothing to do with."""

    class Off(gl.Component):
        w, tau, x = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
        u, v = gl.Input("1"), gl.Input("1")
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            a = gl.der(self.w) / self.rate
            return [
                gl.Eq(2.0 * a, gl.Piecewise((0, self.x < 1), (self.tau, True))),
                gl.Eq(self.tau, 3 * self.x - 0.1 * self.w - (self.x - 0.5) * a),
                gl.Eq(gl.der(self.x), self.rate * (self.u - self.v - self.x)),
            ]

    off = gl.compile(Off()).translation
    assert any(isinstance(step, Newton) for step in off.scene.program.steps)
    assert found(off, {}, [x, x], [0.3, 0.4]).shape == (0, 2)


@pytest.mark.parametrize("J", [1e-16, 1.0, 1e16])
def test_a_body_of_any_inertia_is_held(J: float) -> None:
    """The reaction answers with the inertia times the acceleration."""

    class Alone(gl.Component):
        w, r = gl.Variable("1"), gl.Variable("1")
        rate, J, held = gl.Parameter("1/s", default=1.0), gl.Parameter("1"), gl.Parameter("1", default=1.0)

        def equations(self) -> list[gl.Eq]:
            a = gl.der(self.w) / self.rate
            return [
                gl.Eq(self.J * a, 1.0 - self.r),
                gl.Eq(gl.Piecewise((a, self.held > 0.5), (self.r - 0.3 * self.w, True)), 0),
            ]

    assert found(gl.compile(Alone(J=J)).translation, {}, [0.4]).tolist() == [[1.0]]


def test_brakes_side_by_side_hold_a_body_together() -> None:
    """They share the reaction in any way."""

    class Shared(gl.Component):
        w, r, q = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
        rate, held = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=1.0)

        def equations(self) -> list[gl.Eq]:
            a = gl.der(self.w) / self.rate
            return [
                gl.Eq(2.0 * a, 1.0 - self.r - self.q),
                gl.Eq(gl.Piecewise((a, self.held > 0.5), (self.r - 0.3 * self.w, True)), 0),
                gl.Eq(gl.Piecewise((a, self.held > 0.5), (self.q - 0.2 * self.w, True)), 0),
            ]

    shared = gl.compile(Shared()).translation
    assert found(shared, {}, [0.4]).tolist() == [[1.0]]
    assert found(shared, {"held": 0.0}, [0.4]).shape == (0, 1)


@pytest.mark.parametrize("w", [1.0, 0.4])
def test_a_reaction_does_not_hold_a_speed_that_is_driven_elsewhere(w: float) -> None:
    """Nor where that speed rests by chance: its acceleration follows from another equation."""

    class Driven(gl.Component):
        w, r, z = (gl.Variable("1") for _ in range(3))
        rate, held = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=1.0)

        def equations(self) -> list[gl.Eq]:
            a = gl.der(self.w) / self.rate
            return [
                gl.Eq(a, 1.0 - self.w), gl.Eq(gl.der(self.z), self.rate * self.r),
                gl.Eq(gl.Piecewise((a + 1e-25 * self.r, self.held > 0.5), (self.r - 0.4, True)), 0),
            ]  # fmt: skip

    driven = gl.compile(Driven()).translation
    assert any(isinstance(step, Newton) for step in driven.scene.program.steps)
    point = [{"w": w, "z": 0.2}[name] for name in driven.scene.state_names]
    assert found(driven, {}, point).shape == (0, 2)


@pytest.mark.parametrize("order", [0, 1])
def test_several_speeds_that_are_no_states_are_held(order: int) -> None:
    """``s = w (1 + p^2)`` and ``q = v - 2 w`` of three states, in any order of the equations."""

    class Several(gl.Component):
        w, v, p, f, g = (gl.Variable("1") for _ in range(5))
        s, q = (gl.Variable("1", state="never") for _ in range(2))
        rate, held = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=1.0)

        def equations(self) -> list[gl.Eq]:
            def at_rest(speed: Any, force: Any) -> Any:
                return gl.Eq(gl.Piecewise((gl.der(speed) / self.rate, self.held > 0.5), (force - 0.3 * speed, True)), 0)

            brakes = [at_rest(self.s, self.f), at_rest(self.q, self.g)]
            return [
                gl.Eq(gl.der(self.p), self.rate * self.w),
                gl.Eq(2.0 * gl.der(self.w) / self.rate, 1.0 - self.f * (1 + self.p**2) + 2 * self.g),
                gl.Eq(3.0 * gl.der(self.v) / self.rate, 0.5 - self.g),
                gl.Eq(self.s, self.w * (1 + self.p**2)), gl.Eq(self.q, self.v - 2 * self.w),
                *(brakes[::-1] if order else brakes),
            ]  # fmt: skip

    several = gl.compile(Several(), outputs=["w", "v", "p"]).translation
    at = {"w": 0.5, "v": -0.3, "p": 1.5}
    names = sorted(several.scene.state_names)
    assert names == ["p", "v", "w"]
    rows = found(several, {}, [at[name] for name in several.scene.state_names])
    expected = [[2 * 1.5 * 0.5, 0.0, 1 + 1.5**2], [0.0, 1.0, -2.0]]
    assert sorted(rows.tolist()) == [pytest.approx(row, rel=1e-13, abs=1e-14) for row in sorted(expected)]
    assert found(several, {"held": 0.0}, [at[name] for name in several.scene.state_names]).shape == (0, 3)


@pytest.mark.parametrize("x", [0.5, 0.8])
def test_a_reaction_that_vanishes_at_a_point_holds_nothing(x: float) -> None:
    """Where no event lets go of it: its lever passes through zero as the state moves."""

    class Vanishing(gl.Component):
        w, r, x = (gl.Variable("1") for _ in range(3))
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            a = gl.der(self.w) / self.rate
            return [
                gl.Eq(a + (self.x - 0.5) * self.r, 0), gl.Eq(2.0 * a + self.r, 1.0 - self.w),
                gl.Eq(gl.der(self.x), self.rate * gl.Piecewise((self.r, self.w > 0.1), (0.5, True))),
            ]  # fmt: skip

    vanishing = gl.compile(Vanishing()).translation
    assert any(isinstance(step, Newton) for step in vanishing.scene.program.steps)
    point = [{"w": 0.4, "x": x}[name] for name in vanishing.scene.state_names]
    assert found(vanishing, {}, point).shape == (0, 2)


@pytest.mark.parametrize("u", [(0.7, -0.2), (0.0, 3.0)])
def test_a_held_speed_beside_inputs(u: tuple[float, float]) -> None:
    """``s = (1 + p^2) w`` is held from some time on, whatever drives the body."""

    class Driven(gl.Component):
        w, p, f = (gl.Variable("1") for _ in range(3))
        s = gl.Variable("1", state="never")
        u, v = gl.Input("1"), gl.Input("1")
        rate, begin = gl.Parameter("1/s", default=1.0), gl.Parameter("s", default=0.1)

        def equations(self) -> list[gl.Eq]:
            brake = gl.Piecewise((gl.der(self.s) / self.rate, gl.time > self.begin), (self.f - 0.3 * self.s, True))
            return [
                gl.Eq(gl.der(self.p), self.rate * self.w), gl.Eq(self.s, (1 + self.p**2) * self.w), gl.Eq(brake, 0),
                gl.Eq(2.0 * gl.der(self.w) / self.rate, self.u - 2 * self.v - self.f),
            ]  # fmt: skip

    driven, at = gl.compile(Driven()).translation, {"w": 0.4, "p": -0.8}
    x = [at[name] for name in driven.scene.state_names]
    assert found(driven, {}, x, u) == pytest.approx(np.array([[2 * at["p"] * at["w"], 1 + at["p"] ** 2]]), rel=1e-13)
    assert found(driven, {}, x, u, 0.05).shape == (0, 2)


def test_what_no_discrete_state_holds_is_not_held() -> None:
    values = {"body[0].held": 1.0, "body[1].held": 0.0, "body[2].held": 0.0}
    rows = found(gl.compile(Always()).translation, values, [0.2, -0.7, 1.1, 0.4])
    assert rows.tolist() == [[1.0, 0.0, 0.0, 0.0]]
