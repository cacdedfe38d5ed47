"""Blocks that are solved by iteration: at many times together as at each time alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SolverError
from gearlib.program.derivatives import undetermined
from gearlib.program.interpret import evaluate
from gearlib.program.program import Newton
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train


class Pair(gl.Component):
    """``x a + b = 1`` and ``a + x b = 1``: ``a = b = 1 / (1 + x)``, but at x = 1 the two say the same, and at x = -1 they disagree."""

    x = gl.Variable("1")
    a = gl.Variable("1")
    b = gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * self.a),
            gl.Eq(self.x * self.a + self.b, 1.0),
            gl.Eq(self.a + self.x * self.b, 1.0),
        ]


def values(x: list[float], forgiving: bool = False) -> Any:
    """a and b at some x."""
    system = gl.compile(Pair(), outputs=["a", "b"])
    scene = system.translation.scene
    (step,) = (s for s in scene.program.steps if isinstance(s, Newton))
    assert step.linear
    numbers = scene.numbers(system.translation.parameter_values({}))
    none = np.empty((0, len(x)))
    return evaluate(numbers, np.arange(len(x), dtype=float), np.array([x]), none, none, None, forgiving)[step.unknowns]


@pytest.mark.parametrize("entries", [1, 1_000_000], ids=["one by one", "together"])
def test_singular_times_do_not_harm_others(entries: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the solutions at x = 1 the smallest is taken."""
    monkeypatch.setattr("gearlib.program.interpret.ENTRIES", entries)
    x = [0.0, 3.0, 1.0, -0.5, 1.0]
    np.testing.assert_allclose(values(x), np.tile(1 / (1 + np.array(x)), (2, 1)), rtol=1e-14)


def test_time_without_a_solution_is_named() -> None:
    with pytest.raises(SolverError, match="have no solution at t = 2 s: they depend on each other there"):
        values([0.0, 3.0, -1.0, 2.0])
    np.testing.assert_allclose(values([0.0, 3.0, -1.0, 2.0], forgiving=True)[:, :2], [[1.0, 0.25]] * 2, rtol=1e-14)


@pytest.mark.parametrize("seed", [4, 28, 58])
def test_many_times_are_as_many_points_on_random_trains_that_switch(seed: int) -> None:
    scene = gl.compile(Model(train=hybrid_train(seed))).translation.scene
    assert any(isinstance(step, Newton) for step in scene.program.steps)
    numbers, rng, times = scene.numbers(scene.model.parameters.evaluate({})), np.random.default_rng(seed), 8
    t, x = rng.uniform(0, 2, times), scene.nominal[:, None] * rng.uniform(-1, 1, (len(scene.states), times))
    u = np.zeros((len(scene.program.inputs), times))
    flags = scene.discrete(numbers, t, x, u)
    together = evaluate(numbers, t, x, u, flags, forgiving=True)
    for i in range(times):
        k = slice(i, i + 1)
        alone = evaluate(numbers, t[k], x[:, k], u[:, k], flags[:, k], forgiving=True)[:, 0]
        np.testing.assert_allclose(together[:, i], alone, rtol=1e-12, atol=1e-13 * np.abs(alone).max())


def test_what_a_singular_block_leaves_open_is_in_the_units_of_its_unknowns() -> None:
    """``x a + c b = 1`` and ``a + x c b = 1`` leave ``a = -c b`` open at x = 1, whatever c."""

    class Scaled(gl.Component):
        x = gl.Variable("1")
        a = gl.Variable("1")
        b = gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)
        c = gl.Parameter("1", default=1000.0)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), self.rate * self.a),
                gl.Eq(self.x * self.a + self.c * self.b, 1.0),
                gl.Eq(self.a + self.x * self.c * self.b, 1.0),
            ]

    system = gl.compile(Scaled(), outputs=["a", "b"])
    scene = system.translation.scene
    numbers, none = scene.numbers(system.translation.parameter_values({})), np.empty((0, 1))
    for x, count in ((1.0, 1), (3.0, 0)):
        slots = evaluate(numbers, np.zeros(1), np.array([[x]]), none, none)[:, 0]
        a, b = (scene.program.slots[scene.model.variable(name), 0] for name in ("a", "b"))
        directions = undetermined(numbers, 0.0, slots, none[:, 0], [a, b])
        assert directions.shape == (2, count)
        for da, db in directions.T:
            assert da == pytest.approx(-1000.0 * db)
            assert abs(da) > 0
