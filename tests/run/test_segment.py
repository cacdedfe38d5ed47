"""Segments of runs: histories that follow from states, discrete states at samples, and relations that a run did not need."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import NameLookupError, SolverError
from gearlib.run.segment import Segment


class Steps(gl.Component):
    """x rises by 1 per second; n counts at 0.5 and 1 s, and an input is added; y needs to know whether x is above 0.75."""

    k = gl.Parameter("any", default=3.0)
    x, y = gl.Variable("any", start=0.0), gl.Variable("any")
    ratio, square = gl.Variable("any"), gl.Variable("any")
    u, n, m = gl.Input("any"), gl.Discrete(start=1.0), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.Eq(self.y, gl.Piecewise((self.k, self.x > 0.75), (self.u, True))),
            gl.Eq(self.ratio, 1.0 / (self.x - 0.5)),
            gl.Eq(self.square, self.x**2 + self.u),
            gl.When(gl.sample(0.5, 0.5), gl.Eq(self.n, gl.pre(self.n) + 1)),
            gl.When(self.x > 10.0, gl.Eq(self.m, 1.0)),
        ]


@cache
def system() -> gl.System:
    return gl.compile(Steps(), outputs=["x", "n"])


def segment(times: Any = (0.0, 0.25, 0.5, 0.75, 1.0), u: Any = 2.0, **more: Any) -> Segment:
    result: Any = system().simulate(1.0, times=list(times), inputs={"u": u}, method="rk", **more)
    found: Segment = result._segments[0]
    return found


def history(own: Segment, name: str) -> list[float]:
    node, sign = own.scene.named(name)
    return [float(v) for v in sign * own.history(node)]


def test_histories_that_follow_from_the_states() -> None:
    own = segment(u=lambda t: 2.0 + t)
    assert history(own, "x") == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0], abs=1e-12)
    assert history(own, "square") == pytest.approx([2.0, 2.3125, 2.75, 3.3125, 4.0])
    assert history(own, "der(x)") == [1.0] * 5
    assert history(own, "u") == [2.0, 2.25, 2.5, 2.75, 3.0]


def test_relations_that_the_run_did_not_need() -> None:
    """They are evaluated at the samples."""
    own = segment([0.0, 0.7, 0.8, 1.0])
    assert own.scene.relations is not None
    assert history(own, "y") == [2.0, 2.0, 3.0, 3.0]


def test_a_history_that_is_changed_is_the_caller_s() -> None:
    own = segment()
    node, _ = own.scene.named("x")
    own.history(node)[:] = 7.0
    assert own.states[:, 0] == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0], abs=1e-12)
    assert own.discrete_variable("n").tolist() == [1.0, 1.0, 2.0, 2.0, 3.0]
    own.discrete_variable("n")[:] = 7.0
    assert own.discrete_variable("n").tolist() == [1.0, 1.0, 2.0, 2.0, 3.0]


@pytest.mark.parametrize(("t", "n"), [(0.0, 1.0), (0.1, 1.0), (0.25, 1.0), (0.5, 2.0), (0.9, 2.0), (1.0, 3.0)])
def test_the_discrete_state_is_that_of_the_last_sample(t: float, n: float) -> None:
    own = kept()
    place = own.scene.model.n_relations + own.scene.model.discretes.index("n")
    assert own.discrete_at(own.scene.program, t)[place] == n


@cache
def kept() -> Segment:
    return segment()


def test_values_that_are_not_finite_are_told() -> None:
    """With the first time, and how many there are; none of a segment that is silent."""
    own = segment([0.0, 0.25, 0.5, 1.0])
    with pytest.warns(RuntimeWarning, match=r"^ratio is -?inf at t = 0\.5 s: its equations give it no finite value there$"):
        history(own, "ratio")
    twice = replace(own, states=np.array([[0.0], [0.5], [0.5], [0.5]]), known={}, computed=[])
    with pytest.warns(RuntimeWarning, match=r"^ratio is -?inf at t = 0\.25 s and at 2 more samples: its equations"):
        history(twice, "ratio")
    silent = replace(twice, known={}, computed=[], silent=True)
    assert np.isinf(history(silent, "ratio")).tolist() == [False, True, True, True]


def test_what_was_not_recorded_is_named() -> None:
    own = segment()
    with pytest.raises(
        NameLookupError, match=r"^the discrete variable m was not needed in this run; name it in outputs=\[\.\.\.\]$"
    ):
        own.discrete_variable("m")
    nothing = replace(own, scene=SimpleNamespace(relations=None, model=own.scene.model))  # type: ignore[arg-type]
    with pytest.raises(NameLookupError, match=r"^the discrete variable n was not needed"):
        nothing.discrete_variable("n")


def test_events_of_a_segment() -> None:
    """Times at which something switches or is sampled; the corners of a table are none where nothing does."""
    assert segment().events == pytest.approx([0.5, 1.0])
    u = gl.Table([0.0, 0.3, 1.0], [0.0, 1.0, 0.0])
    result: Any = gl.compile(Apart(), outputs=["x", "z"]).simulate(1.0, samples=3, inputs={"u": u}, method="rk")
    assert result._segments[0].events.tolist() == []


class Contrary(gl.Component):
    """y is -1 if x + y is more than 1 + at, and 1 otherwise: from x = at on, neither fits."""

    at = gl.Parameter("any", default=0.3)
    x, y = gl.Variable("any", start=0.0), gl.Variable("any")

    def equations(self) -> list[Any]:
        low = gl.Piecewise((-1.0, self.x + self.y > 1.0 + self.at), (1.0, True))
        return [gl.Eq(gl.der(self.x), 1.0), gl.Eq(self.y, low)]


def test_relations_without_a_value_are_named_where_they_have_none() -> None:
    class Both(gl.Component):
        def assemble(self) -> list[Any]:
            self.early, self.late, self.never = Contrary(), Contrary(at=0.6), Contrary(at=7.0)
            return []

    found = gl.compile(Both(), outputs=["early.x", "late.x", "never.x"]).simulate(1.0, samples=5, method="rk")
    assert found["never.y"].tolist() == [1.0] * 5
    with pytest.raises(
        SolverError, match=r"^a relation of early holds if and only if it does not at t = 0\.5 s: no value fits$"
    ):
        found["early.y"]
    with pytest.raises(
        SolverError, match=r"^a relation of late holds if and only if it does not at t = 0\.75 s: no value fits$"
    ):
        found["late.y"]


class Turned(gl.Component):
    """b - a = 0.3 sin(b), on the branch that is followed from the start; a rises by 3 per second."""

    a, b = gl.Variable("1", start=0.0), gl.Variable("1")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.a), 3.0 + 0.0 * self.b), gl.Eq(gl.sin(self.b - self.a), 0.3 * gl.sin(self.b))]


def test_guesses_lie_on_the_branch_of_the_run() -> None:
    """At the first sample, which may be long after the start: 15 rad have been turned by then."""
    result: Any = gl.compile(Turned(), outputs=["a", "b"]).simulate(6.0, times=[5.0, 6.0], method="rk", rtol=1e-9)
    b = result["b"]
    assert np.abs(b - 3.0 * result.time).max() < 0.4
    assert np.sin(b - 3.0 * result.time) == pytest.approx(0.3 * np.sin(b), abs=1e-8)
    own = result._segments[0]
    guess = own.guess_on_branch()
    v = own.scene.named("b")[0][0]
    assert guess[v] == pytest.approx(b[0], abs=1e-6) or v not in own.scene.program.undifferentiated[0]


class Behind(gl.Component):
    """What a run needs is declared behind what it does not."""

    y, z = gl.Variable("1"), gl.Variable("1")
    b, a = gl.Variable("1"), gl.Variable("1", start=0.5)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(self.y, 2.0 * self.a + 100.0),
            gl.Eq(self.z, 3.0 * self.a + 200.0),
            gl.Eq(self.b**3 + self.b, 10.0 * self.a),
            gl.Eq(gl.der(self.a), 1.0 + 0.0 * self.b + gl.sin(self.b) * 0.01),
        ]


def test_guesses_of_all_that_the_run_computes() -> None:
    """At the first sample; those of other variables stay."""
    own: Any = gl.compile(Behind(), outputs=["a"]).simulate(1.0, times=[0.5, 1.0], method="rk")._segments[0]  # type: ignore[attr-defined]
    guess = replace(own, guess=np.full(len(own.guess), 7.0)).guess_on_branch()
    found = {name: float(guess[own.scene.named(name)[0][0]]) for name in "abyz"}
    assert found["a"] == own.states[0, 0]
    assert found["b"] ** 3 + found["b"] == pytest.approx(10.0 * found["a"], rel=1e-9)
    assert (found["y"], found["z"]) == (7.0, 7.0)


def test_sensitivities_of_what_follows_from_states() -> None:
    """y = k above 0.75, square = x^2 + u: with respect to k and to the start of x."""
    result = system().simulate(1.0, times=[0.0, 0.7, 0.8, 1.0], inputs={"u": 2.0}, method="rk", sensitivities=["k", "start(x)"])
    assert result.sensitivity("y", "k").tolist() == [0.0, 0.0, 1.0, 1.0]
    assert result.sensitivity("square", "start(x)") == pytest.approx([0.0, 1.4, 1.6, 2.0], abs=1e-9)
    assert result.sensitivity("square", "k").tolist() == [0.0] * 4
    assert result.sensitivity("x", "start(x)") == pytest.approx([1.0] * 4)
    assert result.sensitivity("der(x)", "start(x)") == pytest.approx([0.0] * 4)


class Apart(gl.Component):
    """y follows from x, z from x and an input."""

    u, x = gl.Input("any"), gl.Variable("any", start=1.0)
    y, z = gl.Variable("any"), gl.Variable("any")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), -self.x), gl.Eq(self.y, self.x**2), gl.Eq(self.z, self.x * self.u)]


def test_inputs_are_read_where_something_depends_on_them() -> None:
    asked: list[float] = []

    def u(t: float) -> float:
        asked.append(t)
        return 2.0

    found = gl.compile(Apart(), outputs=["x"]).simulate(1.0, samples=4, inputs={"u": u}, method="rk", rtol=1e-9)
    before = len(asked)
    assert found["y"] == pytest.approx(np.exp(-2 * found.time), rel=1e-7)
    assert len(asked) == before
    assert found["z"] == pytest.approx(2 * np.exp(-found.time), rel=1e-7)
    assert len(asked) > before


class Folded(gl.Component):
    """z^2 + 0.1 z^4 = 1 + x behind x = 0.5, and 1 - x before it; y and r follow from z and from whether it is below -1.2."""

    behind = gl.Parameter("any", default=0.5)
    x, z = gl.Variable("any", start=0.0), gl.Variable("any", guess=-1.0)
    y, r = gl.Variable("any"), gl.Variable("any")

    def equations(self) -> list[Any]:
        level = gl.Piecewise((1 + self.x, self.x > self.behind), (1 - self.x, True))
        gain = gl.Piecewise((5.0, self.z < -1.2), (2.0, True))
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.Eq(self.z**2 + 0.1 * self.z**4, level),
            gl.Eq(self.y, gain * self.z),
            gl.Eq(self.r**3 + self.r, gain * self.x),
        ]


@pytest.mark.parametrize("outputs", [["x"], ["x", "z"], ["x", "z", "y", "r"]])
def test_only_what_relations_settle_to_must_have_a_solution(outputs: list[str]) -> None:
    """By hand: z = -sqrt(5 (sqrt(1 + 0.4 q) - 1)). Beyond x = 1 there is none as long as x is taken to be before 0.5."""
    result = gl.compile(Folded(), outputs=outputs).simulate(2.0, samples=21)
    x = np.asarray(result["x"])
    z = -np.sqrt(5.0 * (np.sqrt(1.0 + 0.4 * np.where(x > 0.5, 1.0 + x, 1.0 - x)) - 1.0))
    gain = np.where(z < -1.2, 5.0, 2.0)
    for name in ("r", "y", "z"):
        found = np.asarray(result[name])
        assert (found**3 + found if name == "r" else found) == pytest.approx(
            {"z": z, "y": gain * z, "r": gain * x}[name], abs=1e-7
        )


def test_what_they_settle_to_must_have_one() -> None:
    result = gl.compile(Folded(behind=5.0), outputs=["x"]).simulate(2.0, samples=21)
    for name in ("y", "r"):
        with pytest.raises(SolverError, match=r"were not solved at t = 1\.\S+ s; they have no solution there"):
            result[name]
