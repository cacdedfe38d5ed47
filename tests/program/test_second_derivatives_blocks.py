"""Changes of derivatives with the entries of constant blocks, one behind the other, against those of matrices by hand."""

from __future__ import annotations

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.derivative_plan import derivative_plan
from gearlib.program.derivatives import At
from gearlib.program.interpret import evaluate
from gearlib.program.second_derivatives import Direction, entry_changes
from tests.program.test_scalars_blocks import blocks, by_hand

GIVEN = {"p": 3.0, "q": -0.5, "s": 2.0}
H = 1e-6


@pytest.mark.parametrize("with_parameter", [False, True], ids=["by states and inputs", "by a parameter too"])
@pytest.mark.parametrize("most", [400, 1], ids=["dense", "sparse"])
def test_rates_of_constant_blocks_change_with_their_entries(
    most: int, with_parameter: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Along each of three parameters and along all of them at once."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    translation = blocks()
    scene, model, program = translation.scene, translation.model, translation.scene.program
    program.solved.clear()
    numbers, index = scene.numbers(translation.parameter_values({})), translation.model.parameters.index
    order = [["x", "y"].index(name) for name in scene.state_names]
    columns, ways = [*order, 2], np.array([[1.0, 0.0, 0.0, 0.7], [0.0, 1.0, 0.0, -0.3], [0.0, 0.0, 1.0, 1.9]])
    moves = np.zeros((len(model.parameters.names), 4))
    moves[[index[name] for name in "pqs"]] = ways
    x = np.array([0.4, -1.3, 0.8])  # x, y, u

    def slots(values: dict[str, float]) -> np.ndarray:
        own = scene.numbers(translation.parameter_values(values))
        return evaluate(own, np.zeros(1), x[order][:, None], x[2:, None], np.zeros((0, 1)))

    sides = [[{n: v + h * way[i] for i, (n, v) in enumerate(GIVEN.items())} for h in (H, -H)] for way in ways.T]
    changes = np.concatenate([(slots(high) - slots(low)) / (2 * H) for high, low in sides], axis=1)
    program.solved.clear()
    entering = [(i, i) for i in range(3)] + ([(program.n_slots + index["p"], 3)] if with_parameter else [])
    plan = derivative_plan(program, entering, program.output_slots)
    at = At(numbers, np.zeros(1), slots({}), np.zeros((0, 1)))
    program.solved.clear()
    found = np.zeros((2, len(entering), 4))
    found[plan.rows, plan.seeds] = entry_changes(plan, at, Direction(changes, moves))
    for k, (high, low) in enumerate(sides):
        expected = (by_hand(**high)[0] - by_hand(**low)[0])[order] / (2 * H)
        np.testing.assert_allclose(found[:, :3, k], expected[:, columns], rtol=1e-6, atol=1e-7)
    if with_parameter:  # which of two parameters is the first does not matter
        h = 1e-4
        for k, way in enumerate(ways.T):
            total = np.zeros(2)
            for one in (1, -1):
                for other in (1, -1):
                    v = dict(zip("pqs", np.array([*GIVEN.values()]) + other * h * way + one * h * np.eye(3)[0], strict=True))
                    total += one * other * (by_hand(**v)[0] @ x)[order] / (4 * h**2)
            np.testing.assert_allclose(found[:, 3, k], total, rtol=1e-4, atol=1e-5)


class Lopsided(gl.Component):
    """Two equations for two unknowns; both of what they are given stands in the second."""

    x, y, a, b = (gl.Variable("1") for _ in range(4))
    p, q, rate = gl.Parameter("1", default=3.0), gl.Parameter("1", default=-0.5), gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * self.a), gl.Eq(gl.der(self.y), self.rate * self.b),
            gl.Eq(self.p * self.a + self.b, 0), gl.Eq(self.a - self.q * self.b, self.x + 2 * self.q * self.y),
        ]  # fmt: skip


@pytest.mark.parametrize("most", [400, 1], ids=["dense", "sparse"])
def test_each_row_of_a_block_gets_the_changes_of_its_own_terms(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """``M^-1 N`` changes by ``M^-1 (dN - dM M^-1 N)``."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    translation = gl.compile(Lopsided()).translation
    scene, program = translation.scene, translation.scene.program
    numbers, index = scene.numbers(translation.parameter_values({})), translation.model.parameters.index
    names = scene.state_names
    way = np.array([1.3, -0.7])  # of p and q
    moves = np.zeros((len(translation.model.parameters.names), 1))
    moves[[index["p"], index["q"]], 0] = way
    at = At(numbers, np.zeros(1), np.zeros((program.n_slots, 1)), np.zeros((0, 1)))  # the equations are linear

    def solution(p: float, q: float) -> np.ndarray:
        return np.linalg.solve([[p, 1.0], [1.0, -q]], [[0.0, 0.0], [1.0, 2 * q]])

    moved = np.array([[0.0, 0.0], [0.0, 2 * way[1]]]) - np.diag([way[0], -way[1]]) @ solution(3.0, -0.5)
    plan = derivative_plan(program, [(i, i) for i in range(2)], program.output_slots)
    found = np.zeros((2, 2))
    found[plan.rows, plan.seeds] = entry_changes(plan, at, Direction(np.zeros((program.n_slots, 1)), moves))[:, 0]
    order = ["xy".index(name) for name in names]
    assert found == pytest.approx(np.linalg.solve([[3.0, 1.0], [1.0, 0.5]], moved)[np.ix_(order, order)], rel=1e-12)
