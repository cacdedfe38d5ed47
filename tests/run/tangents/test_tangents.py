"""Tangents of discrete variables over time, and which entries of the discrete state have any."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.run.tangents.directions import TangentDirections
from gearlib.run.tangents.tangents import LATEST, Tangents, carried, tangent_code


def made(*sizes: float) -> Tangents:
    n = len(sizes)
    directions = TangentDirections(tuple(f"p{k}" for k in range(n)), (), np.empty(0), (), np.array(sizes))
    return Tangents(directions, np.zeros((3, n)))


def test_what_was_noted_holds_until_the_next() -> None:
    """Zero before the first; of a time that was noted already, and of later ones, the new values take the place."""
    own = made(1.0, 2.0)
    zero, one, two, three = (np.full((2, 2), float(k)) for k in range(4))
    assert own.discretes((4, 7)).tolist() == zero.tolist()
    own.note(0.5, one)
    own.note(1.0, two)
    assert own.discretes((4, 7)).tolist() == two.tolist()
    found = own.discretes((4, 7), np.array([0.0, 0.49, 0.5, 0.7, 1.0, 9.0]))
    assert found[:, 0, 0].tolist() == [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]
    assert found.shape == (6, 2, 2)
    own.note(1.0, three)
    assert own.discretes((4, 7), np.array([0.7, 1.0]))[:, 1, 1].tolist() == [1.0, 3.0]
    own.note(0.75, two)
    assert own.discretes((4, 7), np.array([0.7, 1.0]))[:, 1, 1].tolist() == [1.0, 2.0]
    own.note(0.25, three)
    assert [t for t, _ in own.noted] == [0.25]


@pytest.mark.parametrize("t", [-4.0, 4.0, 1e6])
def test_a_sample_just_before_an_event_is_its_right_hand_limit(t: float) -> None:
    """Within rounding of the time, whichever its sign."""
    own = made(1.0)
    own.note(t, np.ones((1, 1)))
    times = t - np.array([1.5, 0.9, 0.0]) * LATEST * abs(t)
    assert own.discretes((0,), times)[:, 0, 0].tolist() == [0.0, 1.0, 1.0]


def test_what_is_spread_is_that_of_each_state_in_each_direction() -> None:
    assert made(2.0, 4.0).spread(np.array([1.0, 6.0])).tolist() == [0.5, 0.25, 3.0, 1.5]


class Kinds(gl.Component):
    """Discrete variables: of a state, of a parameter, of time, of another one and its last value, and two that are only counted."""

    k = gl.Parameter("any", default=2.0)
    x = gl.Variable("any", start=0.0)
    of_state, of_parameter, of_time, of_other, of_last, counted, mode = (gl.Discrete() for _ in range(7))

    def equations(self) -> list[Any]:
        late = self.x > 0.5
        return [
            gl.Eq(gl.der(self.x), 1.0 + 0.0 * self.of_last),
            gl.When(late, gl.Eq(self.of_state, self.x)),
            gl.When(late, gl.Eq(self.of_parameter, 3.0 * self.k)),
            gl.When(late, gl.Eq(self.of_time, gl.time)),
            gl.When(late, gl.Eq(self.of_other, 2.0 * self.of_state)),
            gl.When(late, gl.Eq(self.of_last, gl.pre(self.of_other) + 1.0)),
            gl.When(late, gl.Eq(self.counted, gl.pre(self.counted) + 1.0)),
            gl.When(late, gl.Eq(self.mode, 7.0)),
        ]


def test_entries_that_move_with_parameters() -> None:
    """Each together with its value before the last event; what is only counted, or set to a number, does not move."""
    scene = gl.compile(Kinds()).translation.scene
    n, names = scene.model.n_relations, list(scene.model.discretes)
    d = len(names)
    found = carried(scene)
    assert list(found) == sorted(found)
    now = {names[m - n] for m in found if n <= m < n + d}
    before = {names[m - n - d] for m in found if n + d <= m < n + 2 * d}
    assert now == before == {"of_state", "of_parameter", "of_time", "of_other", "of_last"}
    assert len(found) == 10


def test_code_is_made_once_for_each_set_of_directions() -> None:
    translation = gl.compile(Kinds()).translation
    scene, k = translation.scene, translation.model.parameters.index["k"]
    one, same, other = (
        TangentDirections(names, tuple((k, i) for i in range(len(names))), np.ones(len(names)), (), np.ones(len(names)))
        for names in (("k",), ("k",), ("k", "twice"))
    )
    first = tangent_code(scene, one)
    assert tangent_code(scene, same) is first
    assert tangent_code(scene, other) is not first
    assert first.discrete == carried(scene)


class Set(gl.Component):
    """x rises by k per second; at 1 s its value is kept in h, with which y rises from then on; at 2 s, 3 k is added."""

    k = gl.Parameter("any", default=2.0)
    x, y = gl.Variable("any", start=0.5), gl.Variable("any", start=0.0)
    h, more = gl.Discrete(), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.k),
            gl.Eq(gl.der(self.y), self.h + self.more),
            gl.When(gl.time >= 1.0, gl.Eq(self.h, self.x)),
            gl.When(gl.time >= 2.0, gl.Eq(self.more, 3 * self.k)),
        ]


@pytest.mark.parametrize("method", ["rk", "ida"])
def test_tangents_through_what_is_kept(method: str) -> None:
    """y = (x0 + k) (t - 1) from 1 s on, and 3 k (t - 2) more from 2 s on."""
    t = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    result = gl.compile(Set()).simulate(3.0, times=t, method=method, rtol=1e-9, sensitivities=["k", "start(x)"])
    middle, last = np.maximum(t - 1, 0), np.maximum(t - 2, 0)
    assert result["y"] == pytest.approx(2.5 * middle + 6.0 * last, abs=1e-9)
    assert result.sensitivity("y", "k") == pytest.approx(middle + 3 * last, abs=1e-8)
    assert result.sensitivity("y", "start(x)") == pytest.approx(middle, abs=1e-8)
    assert result.sensitivity("der(y)", "k") == pytest.approx(1.0 * (t >= 1) + 3.0 * (t >= 2), abs=1e-8)
    assert result.sensitivity("x", "k") == pytest.approx(t, abs=1e-8)


def test_tangents_without_states() -> None:
    """y = k (1 + n), where n counts the instants 0.5 and 1 s."""

    class Counted(gl.Component):
        k = gl.Parameter("any", default=2.0)
        y, n = gl.Variable("any"), gl.Discrete()

        def equations(self) -> list[Any]:
            return [gl.Eq(self.y, self.k * (1 + self.n)), gl.When(gl.sample(0.5, 0.5), gl.Eq(self.n, gl.pre(self.n) + 1))]

    result = gl.compile(Counted()).simulate(1.2, times=[0.0, 0.4, 0.7, 1.2], sensitivities=["k"])
    assert result["y"].tolist() == [2.0, 2.0, 4.0, 6.0]
    assert result.sensitivity("y", "k").tolist() == [1.0, 1.0, 2.0, 3.0]


class Block(gl.Component):
    """Rates of a and b that follow from two equations together: k h / (m - 1) and its opposite, where h is what x = k t was at 1 s."""

    k, m = gl.Parameter("any", default=2.0), gl.Parameter("any", default=3.0)
    a, b, x = gl.Variable("any", start=0.0), gl.Variable("any", start=0.0), gl.Variable("any", start=0.0)
    p, q, h = gl.Variable("any"), gl.Variable("any"), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.k),
            gl.Eq(gl.der(self.a), self.p),
            gl.Eq(gl.der(self.b), self.q),
            gl.Eq(self.m * self.p + self.q, self.k * self.h + 0 * self.a),
            gl.Eq(self.p + self.m * self.q, -self.k * self.h),
            gl.When(gl.time >= 1.0, gl.Eq(self.h, self.x)),
        ]


@pytest.mark.parametrize("method", ["rk", "ida"])
def test_tangents_of_a_block_that_depends_on_what_is_kept(method: str) -> None:
    """a = k^2 (t - 1) / (m - 1) from 1 s on."""
    t = np.array([0.0, 0.5, 1.5, 2.0, 3.0])
    result = gl.compile(Block()).simulate(3.0, times=t, method=method, rtol=1e-9, sensitivities=["k", "m"])
    since = np.maximum(t - 1.0, 0.0)
    for name, sign in (("a", 1.0), ("b", -1.0)):
        assert result[name] == pytest.approx(sign * 2.0 * since, abs=1e-8)
        assert result.sensitivity(name, "k") == pytest.approx(sign * 2.0 * since, abs=1e-7)
        assert result.sensitivity(name, "m") == pytest.approx(-sign * since, abs=1e-7)
