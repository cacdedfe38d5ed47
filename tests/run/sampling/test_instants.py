"""Runs that are cut at sample instants: which controllers act when, what they read, and what the pieces are joined into."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipk

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, SolverError


class Memory:
    """A controller's function that notes its calls, and returns what it is told to."""

    def __init__(self) -> None:
        self.calls: list[tuple[float, list[float]]] = []
        self.begun: list[tuple[float, Any]] = []
        self.answer: Any = lambda t, values: 0.0

    def __call__(self, t: float, values: Any) -> Any:
        self.calls.append((t, values.tolist()))
        return self.answer(t, values)

    def begin_run(self, t: float, given: Any) -> None:
        self.calls.clear()
        self.begun.append((t, given))


class Block(gl.Component):
    """Two integrators: x of what is given from outside and of u, y of v; each time y passes 1 it is counted. And a signal that is zero."""

    u, v = gl.Input("any", default=0.0), gl.Input("any", default=0.0)
    other = gl.Input("any", "from outside")
    x, y = gl.Variable("any", start=1.0), gl.Variable("any", start=0.0)
    opposite, nothing = gl.Variable("any"), gl.Variable("any")
    passed = gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.u + self.other),
            gl.Eq(gl.der(self.y), self.v),
            gl.Eq(self.opposite, -self.x),
            gl.Eq(self.nothing, 0.0),
            gl.When(self.y > 1.0, gl.Eq(self.passed, gl.pre(self.passed) + 1)),
        ]


ONE, TWO = Memory(), Memory()


QUIET = {"block.other": 0.0}


class Plant(gl.Component):
    """One controller every 0.25 s that sets u, another every 0.75 s, from 0.25 s on, that sets v; the latter also gives a number."""

    def assemble(self) -> list[Any]:
        self.block, self.gain = Block(), gp.blocks.Gain(k=1.0)
        b = self.block
        self.one = gl.Sampled(ONE, 0.25, inputs=[b.x, b.opposite, b.nothing], outputs=[b.u])
        self.two = gl.Sampled(TWO, 0.75, inputs=[b.y], outputs=[b.v, self.gain.u], offset=0.25)
        return []


@pytest.fixture(scope="module")
def plant() -> gl.System:
    return gl.compile(Plant())


@pytest.fixture(autouse=True)
def anew() -> None:
    for memory in (ONE, TWO):
        memory.calls.clear()
        memory.begun.clear()
    ONE.answer = lambda t, values: -2.0 * values[0]
    TWO.answer = lambda t, values: (2.0 * t, 10.0 + t)


def x_by_hand(instants: int, given: float = 0.0) -> list[float]:
    """x at each instant: der(x) is -2 x at the last instant, and what is given."""
    found = [1.0]
    for _ in range(instants - 1):
        found.append(found[-1] + 0.25 * (given - 2.0 * found[-1]))
    return found


@pytest.mark.parametrize("samples", [2, 5, 9, 11])
@pytest.mark.parametrize("given", [0.0, 1.0])
def test_what_is_read_and_what_is_held(plant: gl.System, samples: int, given: float) -> None:
    """Values at an instant are those just before for the controllers, and those just after in the result; wherever the samples lie."""
    found = plant.simulate(2.0, samples=samples, inputs={"block.other": given}, method="rk")
    x = x_by_hand(9, given)
    assert [t for t, _ in ONE.calls] == [0.25 * k for k in range(9)]
    assert np.array([values for _, values in ONE.calls]) == pytest.approx(np.array([[v, -v, 0.0] for v in x]), abs=1e-9)
    y = [0.0, 0.75 * 0.5, 0.75 * 0.5 + 0.75 * 2.0]
    assert [t for t, _ in TWO.calls] == [0.25, 1.0, 1.75]
    assert np.array([values for _, values in TWO.calls]) == pytest.approx(np.array(y)[:, None], abs=1e-9)
    t = found.time
    k = np.floor(t / 0.25 + 1e-9).astype(int)
    assert found["block.u"] == pytest.approx(-2.0 * np.array(x)[k], abs=1e-9)
    assert found["block.x"] == pytest.approx(np.array(x)[k] + (t - 0.25 * k) * (given - 2.0 * np.array(x)[k]), abs=1e-9)
    since = np.where(t < 0.25, np.nan, 0.25 + 0.75 * np.floor((t - 0.25) / 0.75 + 1e-9))
    assert found["block.v"] == pytest.approx(np.where(t < 0.25, 0.0, 2.0 * since), abs=1e-12)
    assert found["gain.y"] == pytest.approx(np.where(t < 0.25, 0.0, 10.0 + since), abs=1e-12)


def test_pieces_are_joined_into_one_run(plant: gl.System) -> None:
    """With the steps of all of them, the events in order, and what cut it; y is 1 at 1 s + 0.625 / 2."""
    found = plant.simulate(2.0, samples=3, method="rk", inputs=QUIET)
    assert found.stats["pieces"] == 9  # the last one has no length
    assert found.stats["why"].endswith("; cut at the instants of one, two")
    assert found.stats["steps"] >= 8
    assert [(round(t, 9), name.rpartition(":")[2].strip()) for t, name in found.events] == [(1.3125, "when_0")]
    assert found["block.passed"].tolist() == [0.0, 0.0, 1.0]
    single = plant.simulate(0.2, samples=2, method="rk", inputs=QUIET)
    assert (single.stats["pieces"], found.stats["steps"] > single.stats["steps"] >= 1) == (1, True)


def test_instants_that_differ_by_rounding_are_one() -> None:
    """Thrice 0.1 s is not 0.3 s; both controllers read what was before the first of them acted, in the order in which they were made."""
    order: list[Any] = []

    class Both(gl.Component):
        def assemble(self) -> list[Any]:
            b = self.block = Block()
            self.slow = gl.Sampled(lambda t, v: order.append(("slow", t, *v)) or 1.0, 0.3, inputs=[b.x], outputs=[b.u])
            self.fast = gl.Sampled(lambda t, v: order.append(("fast", t, *v)) or 2.0, 0.1, inputs=[b.u], outputs=[b.v])
            return []

    found = gl.compile(Both(), outputs=["block.x", "block.y"]).simulate(0.65, samples=2, method="rk", inputs=QUIET)
    assert found.stats["pieces"] == 7
    names = [name for name, *_ in order]
    assert names == ["slow", "fast", "fast", "fast", "slow", "fast", "fast", "fast", "slow", "fast"]
    assert [values[1] for name, *values in order if name == "fast"] == [0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    both = [t for name, t, *_ in order if name == "slow"]
    assert both == pytest.approx([0.0, 0.3, 0.6])
    assert {round(t, 12) for t in both} < {round(t, 12) for name, t, *_ in order if name == "fast"}  # each is told its own


def test_an_instant_a_rounding_away_from_where_a_run_is_interrupted_is_one() -> None:
    """Three times 0.05 s is a rounding later than 15 times 0.01 s: the function is called once, and nothing warns."""
    called: list[float] = []

    class Counted(gl.Component):
        def assemble(self) -> list[Any]:
            b = self.block = Block()
            self.law = gl.Sampled(lambda t, v: called.append(t) or 1.0, 0.05, inputs=[b.x], outputs=[b.u])
            return []

    system, times = gl.compile(Counted(), outputs=["block.x"]), [k * 0.01 for k in range(1, 101)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        stepped = system.stepper(method="rk", inputs=QUIET)
        for t in times:
            stepped.advance(t)
        assert called == pytest.approx(np.arange(21) / 20)
        called.clear()
        run = system.simulate(times[0], method="rk", inputs=QUIET)
        for t in times[1:]:
            run = system.simulate(t, start=run, method="rk")
    assert called == pytest.approx(np.arange(21) / 20)


def test_functions_are_told_that_a_run_begins(plant: gl.System) -> None:
    """Of a run that goes on with what they had set; of one that is done again for another variable not at all."""
    first = plant.simulate(1.0, samples=3, method="rk", inputs=QUIET)
    assert ONE.begun == TWO.begun == [(0.0, None)]
    assert len(ONE.calls) == 5
    assert first.at(0.6)["block.x"] == pytest.approx(x_by_hand(3)[2] * (1 - 2 * 0.1), rel=1e-9)
    assert (len(ONE.begun), len(ONE.calls)) == (1, 5)
    again = plant.simulate(1.75, start=first, samples=4, method="rk", inputs=QUIET)
    assert [t for t, _ in ONE.calls] == [1.25, 1.5, 1.75]  # not at 1 s again
    assert [t for t, _ in TWO.calls] == [1.75]
    (t, given) = ONE.begun[-1]
    assert (t, given) == (1.0, [pytest.approx(-2.0 * x_by_hand(5)[4], rel=1e-9)])
    assert TWO.begun[-1] == (1.0, [2.0, 11.0])
    assert again["block.x"][[0, -1]] == pytest.approx([x_by_hand(5)[4], x_by_hand(8)[7]], rel=1e-9)
    assert again["block.v"].tolist() == [2.0, 2.0, 2.0, 3.5]
    middle = plant.simulate(1.25, start=(first, 0.6), samples=2, method="rk", inputs=QUIET)
    assert ONE.begun[-1] == (0.6, [pytest.approx(-2.0 * x_by_hand(3)[2], rel=1e-9)])
    assert TWO.begun[-1] == (0.6, [0.5, 10.25])
    assert middle["block.x"][-1] == pytest.approx(x_by_hand(6)[5], rel=1e-9)


def test_a_longest_step_is_that_of_each_piece(plant: gl.System) -> None:
    few, many = (plant.simulate(2.0, samples=2, method="rk", max_step=step, inputs=QUIET) for step in (None, 0.01))
    assert many.stats["steps"] >= 200 > few.stats["steps"]


def test_methods_that_cannot_be_interrupted_are_refused(plant: gl.System) -> None:
    said = r"^method='exact' does not call the function of one; use method='auto', 'rk' or 'ida'$"
    with pytest.raises(ArgumentError, match=said):
        plant.simulate(1.0, method="exact", inputs=QUIET)
    for method, taken in (("auto", "taylor"), ("ida", "ida"), ("rk", "rk5")):
        found = plant.simulate(0.5, samples=2, method=method, inputs=QUIET)
        assert found["block.x"][-1] == pytest.approx(0.25, rel=1e-5)
        assert found.stats["method"] == taken


def test_states_that_become_singular_between_instants() -> None:
    """A pendulum with its height as state: it cannot go on with others where that is at its lowest."""

    class Swing(gl.Component):
        x, y = gl.Variable("any", guess=0.6), gl.Variable("any", start=-0.8, state="prefer")
        u, v = gl.Variable("any"), gl.Variable("any", start=0.0, state="prefer")
        T, push = gl.Variable("any"), gl.Input("any", default=0.0)

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), self.u),
                gl.Eq(gl.der(self.y), self.v),
                gl.Eq(gl.der(self.u), -self.T * self.x + self.push),
                gl.Eq(gl.der(self.v), -self.T * self.y - 9.81),
                gl.Eq(self.x**2 + self.y**2, 1.0),
            ]

    class Watched(gl.Component):
        def assemble(self) -> list[Any]:
            self.swing = Swing()
            self.law = gl.Sampled(lambda t, v: 0.0, 10.0, inputs=[self.swing.y], outputs=[self.swing.push])
            return []

    with pytest.raises(SolverError) as refused:
        gl.compile(Watched()).simulate(3.0, samples=2, method="ida")
    said = str(refused.value)
    begun = "the states of the run become singular at t = "
    assert said.startswith(begun)
    assert said.endswith("does not go on with others: declare other variables as state='prefer'")
    lowest = ellipk(np.sin(np.arcsin(0.6) / 2) ** 2) / np.sqrt(9.81)  # a quarter of its period
    assert 0.8 * lowest < float(said.removeprefix(begun).split()[0]) < lowest
