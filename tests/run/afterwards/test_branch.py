"""Which solution of nonlinear equations a run shows: the one that the motion leads to, whatever times are asked for."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import gearlib as gl
from gearlib.run.afterwards.branch import Branch, follow, iterated_unknowns


class Loop(gl.Component):
    """An angle b that follows a through a loop with many solutions, forced or with a constant speed."""

    w = gl.Parameter("rad/s", "speed", default=3.0)
    k = gl.Parameter("1", "eccentricity", default=0.3)
    swing = gl.Parameter("rad/s", "swing of the speed", default=0.0)
    a = gl.Variable("rad", "", start=0.0)
    b = gl.Variable("rad", "", guess=0.0)
    z = gl.Variable("rad.s", "", start=0.0)
    high = gl.Variable("1", "whether b is past 5 rad")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.a), self.w + self.swing * gl.sin(7 * gl.time)),
            gl.Eq(gl.sin(self.b - self.a), self.k * gl.sin(self.b)),
            gl.Eq(gl.der(self.z), self.b),
            gl.Eq(self.high, gl.Piecewise((1.0, self.b > 5.0), (0.0, True))),
        ]


NAMED = {outputs: gl.compile(Loop(), outputs=outputs) for outputs in (("b",), ("z", "b"), ("z",), ("a",), None)}


def followed(times: Any, w: float = 3.0, k: float = 0.3, swing: float = 0.0, turns: int = 0) -> Any:
    """b by its own differential equation, which the loop gives by differentiation."""

    def rates(t: float, y: Any) -> Any:
        speed = w + swing * np.sin(7 * t)
        c = np.cos(y[1] - y[0])
        return [speed, speed * c / (c - k * np.cos(y[1]))]

    start = [0.0, 2 * np.pi * turns]
    return solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, rtol=1e-11, atol=1e-12, method="DOP853").y[1]


@pytest.mark.parametrize("outputs", list(NAMED))
@pytest.mark.parametrize("method", ["auto", "rk", "rk8", "ida", "exact"])
def test_few_samples_show_the_same(outputs: tuple[str, ...] | None, method: str) -> None:
    if method == "exact" and outputs not in (("b",), ("a",)):
        return  # a nonlinear scene
    for samples in (2, 3, 11):
        result = NAMED[outputs].simulate(5.0, samples=samples, method=method, rtol=1e-8)
        assert result["b"] == pytest.approx(followed(result.time), rel=1e-6, abs=1e-6)


@settings(max_examples=12, deadline=None)
@given(
    st.floats(-20.0, 20.0), st.floats(-0.7, 0.7), st.floats(0.0, 60.0),
    st.sampled_from(list(NAMED)), st.lists(st.floats(0.01, 4.0), min_size=1, max_size=7, unique=True),
)  # fmt: skip
def test_any_times_of_any_loop(w: float, k: float, swing: float, outputs: Any, times: list[float]) -> None:
    times = sorted(times)
    numbers = {"w": w, "k": k, "swing": swing}
    expected = followed(np.array(times), w, k, swing)
    found = NAMED[outputs].simulate(times[-1], times=times, parameters=numbers, rtol=1e-8)["b"]
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_what_the_start_does_not_show() -> None:
    """The first sample may come late, and the run may be read in another process."""
    result = NAMED["z",].simulate(5.0, times=[4.9, 5.0], rtol=1e-8)
    assert result["b"] == pytest.approx(followed(np.array([0.0, 4.9, 5.0]))[1:], rel=1e-6)
    again = pickle.loads(pickle.dumps(NAMED["z",].simulate(5.0, samples=2, rtol=1e-8)))
    assert again["b"][-1] == pytest.approx(followed(np.array([0.0, 5.0]))[-1], rel=1e-6)


def test_the_guess_chooses_the_branch() -> None:
    class Other(Loop):
        b = gl.Variable("rad", "", guess=6.0)

    result = gl.compile(Other(), outputs=["z", "b"]).simulate(5.0, samples=2, rtol=1e-8)
    assert result["b"] == pytest.approx(followed(np.array([0.0, 5.0]), turns=1), rel=1e-6)


class Faster(gl.Component):
    """The same loop behind a transmission that turns three times as fast from a = 5 rad on, which nothing in the run depends on."""

    a, c, b = gl.Variable("rad", start=0.0), gl.Variable("rad"), gl.Variable("rad", guess=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.a), 3.0),
            gl.Eq(self.c, gl.Piecewise((3 * self.a - 10, self.a > 5), (self.a, True))),
            gl.Eq(gl.sin(self.b - self.c), 0.3 * gl.sin(self.b)),
        ]


@pytest.mark.parametrize("method", ["rk", "ida", "exact"])
@pytest.mark.parametrize("samples", [2, 3, 11])
def test_conditions_that_only_the_loop_needs(method: str, samples: int) -> None:
    result = gl.compile(Faster(), outputs=["a"]).simulate(6.0, samples=samples, method=method, rtol=1e-9)
    turned = [3 * t if t < 5 / 3 else 9 * t - 10 for t in result.time]
    expected = [brentq(lambda b, c=c: b - c - np.arcsin(0.3 * np.sin(b)), c - 1, c + 1) for c in turned]
    assert result["b"] == pytest.approx(expected, rel=1e-7)


class FourBar(gl.Component):
    """A crank and rocker: lengths 1, 3, 2.5 and 3 between the joints; a torque turns the crank against its damping."""

    phi = gl.Variable("rad", "crank", start=0.0)
    w = gl.Variable("rad/s", "", start=4.0)
    coupler = gl.Variable("rad", "", guess=1.0)
    rocker = gl.Variable("rad", "", guess=1.5)

    def equations(self) -> list[Any]:
        cos, sin = gl.cos, gl.sin
        return [
            gl.Eq(gl.der(self.phi), self.w),
            gl.Eq(gl.der(self.w), 2.0 - 0.5 * self.w + 0.1 * sin(self.rocker)),
            gl.Eq(cos(self.phi) + 3.0 * cos(self.coupler), 3.0 + 2.5 * cos(self.rocker)),
            gl.Eq(sin(self.phi) + 3.0 * sin(self.coupler), 2.5 * sin(self.rocker)),
        ]


@pytest.mark.parametrize("method", ["auto", "ida"])
@pytest.mark.parametrize("outputs", [["rocker", "coupler"], ["phi"]])
def test_a_linkage_stays_assembled_as_it_is(method: str, outputs: list[str]) -> None:
    system = gl.compile(FourBar(), outputs=outputs)
    for samples in (2, 3, 6):
        result = system.simulate(6.0, samples=samples, method=method, rtol=1e-9)
        x, y = 3.0 - np.cos(result["phi"]), -np.sin(result["phi"])  # from the crank's pin to the rocker's joint
        d = np.hypot(x, y)
        rocker = np.arctan2(y, x) + np.pi - np.arccos((d**2 + 2.5**2 - 3.0**2) / (2 * 2.5 * d))
        assert result["rocker"] == pytest.approx(rocker, abs=1e-8)


class Kicked(gl.Component):
    """The loop's parameter jumps at events of the state: b jumps with it to the nearest solution."""

    a = gl.Variable("rad", "", start=0.0)
    b = gl.Variable("rad", "", guess=0.0)

    def equations(self) -> list[Any]:
        k = gl.Piecewise((0.3, gl.sin(self.a) > 0.1), (-0.2, True))
        return [gl.Eq(gl.der(self.a), 3.0), gl.Eq(gl.sin(self.b - self.a), k * gl.sin(self.b))]


def test_jumps_at_events() -> None:
    system = gl.compile(Kicked(), outputs=["b"])
    for samples in (2, 5, 101):
        result = system.simulate(5.0, samples=samples)
        a, b = result["a"], result["b"]
        k = np.where(np.sin(a) > 0.1, 0.3, -0.2)
        assert np.sin(b - a) == pytest.approx(k * np.sin(b), abs=1e-9)
        assert np.abs(b - a).max() < 0.5  # of b - a, arcsin(k sin b) is the solution near zero


def test_values_between_steps_are_a_cubics() -> None:
    """From values and slopes at both ends; held beyond the first and last; in the order that is asked for."""
    t = np.array([0.0, 0.5, 2.0])
    values, slopes = np.column_stack([t**3 - t, 2 * t]), np.column_stack([3 * t**2 - 1, 2 + 0 * t])
    branch = Branch(((7, 0), (9, 0)), t, values, slopes)
    at = np.array([-1.0, 0.0, 0.2, 0.5, 1.3, 2.0, 3.0])
    inside = at.clip(0.0, 2.0)
    assert branch.guess([(9, 0), (7, 0)], at) == pytest.approx(np.stack([2 * inside, inside**3 - inside]), abs=1e-14)
    single = Branch(((7, 0),), t[:1], np.array([[4.0]]), np.array([[1.0]]))
    assert single.guess([(7, 0)], at).tolist() == [[4.0] * 7]


@pytest.mark.parametrize(
    ("speed", "leap", "turns", "most"), [(0.2, 0.0, 0, 16), (0.2, 0.5, 0, 18), (2.0, 0.5, 1, 60), (-15.0, 0.5, 0, 250)]
)
def test_a_path_is_followed_in_few_steps_that_show_all_of_it(speed: float, leap: float, turns: int, most: int) -> None:
    """Of sin(b - a) = 0.3 sin(b) the solution next to a is a + atan2(0.3 sin a, 1 - 0.3 cos a); at an event a leaps."""
    translation = NAMED["z",].translation
    scene, (node,) = translation.scene, iterated_unknowns(translation.scene.program)[1]
    begin, end, event = -1.0, 2.0, 1.0 / 3.0
    events = np.array([begin, event, event, end + 1.0]) if leap else np.empty(0)

    def angle(times: Any) -> Any:
        return speed * (times - begin) + 0.2 * speed * np.sin(3.0 * times) + leap * (times >= event)

    def path(times: Any) -> Any:
        states = np.stack([angle(times) if name == "a" else 0.0 * times for name in scene.state_names])
        return states, np.empty((0, len(times))), np.zeros((scene.n_discrete, len(times)))

    def exact(times: Any) -> Any:
        a = angle(times)
        return a + np.arctan2(0.3 * np.sin(a), 1.0 - 0.3 * np.cos(a)) + 2.0 * np.pi * turns

    prepared = scene.numbers(translation.parameter_values({}))
    found = follow(prepared, path, begin, end, events, np.full(scene.program.n_slots, exact(begin)), points=256)
    assert found.nodes == (node,)
    assert (found.times[0], found.times[-1]) == (begin, end)
    assert 0.0 < np.diff(found.times).min() <= np.diff(found.times).max() == pytest.approx(3.0 * 32 / 256) or most > 20
    assert len(found.times) <= most
    assert found.values[:, 0] == pytest.approx(exact(found.times), abs=1e-8)
    h = 1e-6 * np.where(found.times > 1.99, -1.0, 1.0)
    smooth = np.abs(found.times - event) > 1e-3
    assert found.slopes[smooth, 0] == pytest.approx(
        ((exact(found.times + h) - exact(found.times)) / h)[smooth], rel=0.01, abs=0.01 * abs(speed)
    )
    at = np.random.default_rng(0).uniform(begin, end, 2000)
    assert found.guess([node], at)[0] == pytest.approx(exact(at), abs=0.01 * abs(speed))
    if leap:
        i = int(np.searchsorted(found.times, event))
        assert found.times[i] == event
        assert 0.0 < event - found.times[i - 1] < 1e-11
