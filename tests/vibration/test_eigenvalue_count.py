"""Counts of eigenvalues in a disc: the steps along its edge, by hand, and eigenvalues close to the edge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse

from gearlib.vibration import eigenvalue_count
from gearlib.vibration.eigenvalue_count import WIDEST, follow, missing_inside


def recorded(phase: Callable[[float], float], step: float) -> tuple[float | None, list[float]]:
    """The change of a phase that is given within a turn, and the angles at which it was asked for."""
    asked: list[float] = []

    def within_a_turn(angle: float) -> float:
        asked.append(angle)
        return phase(angle) % (2 * np.pi)

    return follow(within_a_turn, step), asked


@pytest.mark.parametrize("slope", [0.0, 1.0, -9.0])
def test_steps_along_an_even_phase_grow_by_half_up_to_the_widest(slope: float) -> None:
    found, asked = recorded(lambda angle: slope * angle, 0.01)
    assert found == pytest.approx(slope * np.pi)
    growing = [0.01, 0.015, 0.0225, 0.03375]
    assert asked[:5] == pytest.approx([0.0, *np.cumsum(growing)])
    assert np.diff(asked[4:-1]) == pytest.approx(np.full(len(asked) - 6, WIDEST))
    assert asked[-1] == np.pi


@pytest.mark.parametrize(
    ("jump", "steps"),
    [
        (0.09, [0.03]), (-0.11, [0.02]), (0.24, [0.02]), (-0.26, [0.014]), (0.39, [0.014]),
        (0.41, [0.02 / 3, 0.02 / 9, 0.02 / 27]), (-1.2, [0.02 / 3, 0.02 / 9]), (1.2, [0.02 / 3, 0.02 / 9]),
    ],
)  # fmt: skip
def test_the_next_step_is_as_wide_as_the_last_sample_was_close(jump: float, steps: list[float]) -> None:
    """Half as wide again, as wide, narrower, or another try with a third, from the first step on."""
    found, asked = recorded(lambda angle: jump * (angle > 0), 0.02)
    if abs(jump) < 0.4:
        assert asked[:3] == pytest.approx([0.0, 0.02, 0.02 + steps[0]])
        return
    assert asked[: 2 + len(steps)] == pytest.approx([0.0, 0.02, *steps])
    assert found is None
    assert 0.02 / 3 ** (len(asked) - 1) < 1e-9 < 0.02 / 3 ** (len(asked) - 2)


def test_a_phase_that_bends_by_more_than_a_radian_is_sampled_more_closely() -> None:
    """400 a**2 is known exactly from the last three samples, and departs from a straight line by 400 s (s + s before)."""
    found, asked = recorded(lambda angle: 400 * angle**2, 0.02)
    assert found == pytest.approx(400 * np.pi**2)
    # The first samples are off by 0.16 and 0.32. A step of 0.04 is too wide, and not tried, but a third of it is taken, where
    # 400 * 0.04 * 0.0715 > 1 > 400 * 0.0315 * 0.0525, and where 400 * 0.04 * 0.07 > 1 > 400 * 0.03 * 0.05.
    at = np.cumsum([0.0, 0.02, 0.02, 0.014, 0.021, 0.0315, 0.04 / 3, 0.02, 0.03, 0.04 / 3, 0.02, 0.03])
    assert asked[: len(at)] == pytest.approx(at)


@pytest.mark.parametrize(("states", "expected"), [(2, 0.05), (10, 0.05), (40, 0.0125)])
def test_the_first_step_is_half_a_radian_for_all_eigenvalues_together(
    states: int, expected: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[float] = []
    monkeypatch.setattr(eigenvalue_count, "follow", lambda phase, step: steps.append(step))
    found: Any = missing_inside(sparse.identity(states, format="csc"), 3.0, np.empty(0, complex), 0)
    assert found is None
    assert steps == [pytest.approx(expected)]
