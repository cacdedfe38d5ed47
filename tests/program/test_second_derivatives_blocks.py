"""Changes of derivatives with the entries of constant blocks, one behind the other, against those of matrices by hand."""

from __future__ import annotations

import numpy as np
import pytest

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
