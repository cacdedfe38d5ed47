"""Compiled evaluation at many points agrees with the interpreter, on random trains and the paper's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import SolverError
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import evaluate
from gearlib.program.program import Newton
from tests.native.test_source import Chain
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train
from tests.stress.trains import RandomTrain

POINTS = 7


class Crank(gl.Component):
    """A rod on a crank: ``sin(b) = reach * sin(a)``, which has no solution where the right-hand side exceeds 1."""

    reach = gl.Parameter("1", default=0.9)
    rate = gl.Parameter("rad/s", default=1.0)
    a = gl.Variable("rad", "crank")
    b = gl.Variable("rad", "rod")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.a), self.rate * (1.0 + self.b)), gl.Eq(gl.sin(self.b), self.reach * gl.sin(self.a))]


def points(system: gl.System, seed: int) -> tuple[Any, ...]:
    """Numbers, their compiled counterpart and random points at which relations are as they settle."""
    scene, rng = system.translation.scene, np.random.default_rng(seed)
    parameters = system.translation.parameter_values({})
    plain, (compiled, evaluator) = scene.numbers(parameters), scene.compiled_numbers(parameters)
    t = rng.uniform(0.1, 2.0, POINTS)
    x = scene.nominal[:, None] * rng.uniform(-1.0, 1.0, (len(scene.states), POINTS))
    u = rng.normal(size=(len(scene.program.inputs), POINTS))
    flags = scene.discrete(plain, t, x, u)
    np.testing.assert_array_equal(scene.discrete(compiled, t, x, u), flags)
    return scene, plain, compiled, evaluator, (t, x, u, flags)


def agree(system: gl.System, seed: int) -> None:
    scene, plain, compiled, evaluator, (t, x, u, flags) = points(system, seed)
    slots = evaluate(plain, t, x, u, flags)
    size = np.abs(slots).max(axis=1, keepdims=True, initial=1e-300)
    for other in (compiled, scene.compiled_program(plain)):  # with derivatives, and without
        np.testing.assert_allclose(evaluate(other, t, x, u, flags) / size, slots / size, rtol=1e-9, atol=1e-10)
    plan = scene.jacobian
    expected = dense(plan, entries(plan, At(plain, t, slots, flags)))
    found_slots, found = evaluator.derivatives(t, x, u, flags)
    np.testing.assert_allclose(found_slots / size, slots / size, rtol=1e-9, atol=1e-10)
    largest = np.abs(expected).max(axis=2, keepdims=True, initial=1e-300)
    np.testing.assert_allclose(found / largest, expected / largest, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", [3, 11])
def test_random_linear_trains(seed: int) -> None:
    agree(gl.compile(RandomTrain(seed=seed)), seed)


@pytest.mark.parametrize("seed", [4, 23, 79])
def test_random_trains_that_switch(seed: int) -> None:
    """Backlash, friction, clutches: blocks that are solved by iteration."""
    agree(gl.compile(Model(train=hybrid_train(seed))), seed)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(60))
def test_many_random_trains(seed: int) -> None:
    agree(gl.compile(RandomTrain(seed=seed)), seed)
    agree(gl.compile(Model(train=hybrid_train(seed))), seed)


def test_loops_over_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their coefficients are stored behind the program's numbers."""
    monkeypatch.setattr("gearlib.native.consecutive.SHORTEST", 2)
    monkeypatch.setattr("gearlib.native.source.LONGEST", 0)
    agree(gl.compile(Chain(n=5)), 2)


def test_the_papers_train() -> None:
    agree(gl.compile(gp.ZhouCui2022()), 1)


@pytest.mark.parametrize("limit", [0, 260], ids=["loops", "written out"])
def test_nonlinear_block(limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.native.source.LONGEST", limit)
    system = gl.compile(Crank())
    assert any(isinstance(step, Newton) and not step.linear for step in system.translation.scene.program.steps)
    agree(system, 2)


def test_points_without_a_solution_are_refused_as_the_interpreter_does() -> None:
    system = gl.compile(Crank(reach=1.5))
    scene = system.translation.scene
    numbers, evaluator = scene.compiled_numbers(system.translation.parameter_values({}))
    t, x, none = np.zeros(3), np.array([[0.1, np.pi / 2, 0.2]]), np.empty((0, 3))
    for call in (evaluate, lambda _, *rest: evaluator.derivatives(*rest)):
        with pytest.raises(SolverError, match="were not solved at t = 0 s"):
            call(numbers, t, x, none, none)
    slots = evaluate(numbers, t, x, none, none, forgiving=True)
    b = scene.program.slots[next(n for n in scene.program.slots if n[1] == 0 and n not in scene.states)]
    np.testing.assert_allclose(np.sin(slots[b, [0, 2]]), 1.5 * np.sin(x[0, [0, 2]]), rtol=1e-12)


def test_a_guess_for_each_point_is_followed() -> None:
    """Each solution of several is found from a guess near it."""
    system = gl.compile(Crank())
    scene = system.translation.scene
    numbers, _ = scene.compiled_numbers(system.translation.parameter_values({}))
    t, x, none = np.zeros(2), np.array([[0.5, 0.5]]), np.empty((0, 2))
    b = scene.program.slots[next(n for n in scene.program.slots if n[1] == 0 and n not in scene.states)]
    guess = np.zeros((scene.program.n_slots, 2))
    guess[b] = 0.4, 2.7
    found = evaluate(numbers, t, x, none, none, guess)[b]
    first = np.arcsin(0.9 * np.sin(0.5))
    np.testing.assert_allclose(found, [first, np.pi - first], rtol=1e-12)


class Square(gl.Component):
    """``y^2 = 4 + x``: no direction from the guess y = 0, where compiled code gives up and the interpreter moves on."""

    x, y = gl.Variable("1"), gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(self.y**2, 4.0 + self.x)]


def test_points_that_compiled_code_leaves_are_interpreted() -> None:
    """The same values and derivatives, dy/dx = 1 / (2 y)."""
    system = gl.compile(Square())
    scene = system.translation.scene
    numbers, evaluator = scene.compiled_numbers(system.translation.parameter_values({}))
    t, x, none = np.zeros(3), np.array([[0.0, 5.0, 12.0]]), np.empty((0, 3))
    slots, found = evaluator.derivatives(t, x, none, none)
    y = slots[scene.program.output_slots[0]]
    np.testing.assert_allclose(np.abs(y), [2.0, 3.0, 4.0], rtol=1e-12)
    np.testing.assert_allclose(found[:, 0, 0], 0.5 / y, rtol=1e-10)
    np.testing.assert_allclose(evaluate(numbers, t, x, none, none), slots, rtol=1e-12)


def test_points_do_not_depend_on_the_ones_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """The determinant at one point is forgotten at the next, which may be nearer to a singular one."""
    monkeypatch.setattr("gearlib.native.source.SMALLER", 0.5)
    system = gl.compile(Square())
    scene = system.translation.scene
    numbers, _ = scene.compiled_numbers(system.translation.parameter_values({}))

    def interpreted(*_: Any) -> None:
        raise AssertionError("a point was left to the interpreter")

    monkeypatch.setattr("gearlib.native.evaluator.evaluate", interpreted)
    x, none = np.array([[21.0, 0.0, 5.0, -3.0]]), np.empty((0, 4))
    slots = evaluate(numbers, np.zeros(4), x, none, none, np.ones(scene.program.n_slots))
    np.testing.assert_allclose(slots[scene.program.output_slots[0]], [5.0, 2.0, 3.0, 1.0], rtol=1e-12)
