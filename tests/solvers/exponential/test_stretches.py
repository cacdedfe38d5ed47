"""Stretches lead from the start through all samples, one behind the other, and stop at every breakpoint on the way."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.solvers.exponential.stretches import Stretch, stretches


def grid(kind: str, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return {
        "even": np.linspace(0.0, 3.0, 31),
        "two even parts": np.concatenate([np.linspace(0.0, 1.0, 11), np.linspace(1.05, 3.0, 40)]),
        "uneven": np.sort(rng.uniform(0.0, 3.0, 25)),
        "repeated": np.repeat(np.linspace(0.5, 3.0, 6), 2),
        "growing": np.cumsum(0.1 * 1.001 ** np.arange(25.0)),
        "single": np.array([2.0]),
    }[kind]


@pytest.mark.parametrize("kind", ["even", "two even parts", "uneven", "repeated", "growing", "single"])
@pytest.mark.parametrize("breakpoints", [[], [1.0], [0.5, 1.0, 1.7], [0.003, 0.004, 2.9999], [3.5]])
def test_the_way_is_walked_without_gaps(kind: str, breakpoints: list[float]) -> None:
    times = grid(kind, len(breakpoints))
    starts = [0.0, *breakpoints]
    at, piece, row = 0.0, 0, int(np.searchsorted(times, 1e-12))
    for stretch in stretches(times, 0.0, np.array(breakpoints)):
        while piece < stretch.piece:  # a piece is left at its end only
            piece += 1
            assert at == pytest.approx(starts[piece], abs=1e-12) or starts[piece] > times[-1]
            at = starts[piece]
        assert starts[piece] + stretch.start == pytest.approx(at, abs=1e-12)
        ends = starts[piece] + stretch.start + stretch.h * np.arange(1, stretch.count + 1)
        if stretch.row >= 0:
            assert stretch.row == row
            assert ends == pytest.approx(times[row : row + stretch.count], abs=1e-12)
            row += stretch.count
        else:
            assert stretch.count == 1
            assert ends[0] == pytest.approx(starts[piece + 1], abs=1e-12)
        assert stretch.count > 0
        at = float(ends[-1])
        assert piece + 1 == len(starts) or at <= starts[piece + 1] + 1e-12
    assert row == len(times)


def test_equal_steps_are_one_stretch() -> None:
    """Up to rounding, wherever they begin; what grows by a thousandth each time is not equal."""
    assert [s.count for s in stretches(grid("even", 0), 0.0, np.empty(0))] == [30]
    assert [s.count for s in stretches(1e3 + grid("even", 0), 1e3, np.empty(0))] == [30]
    assert [s.count for s in stretches(grid("two even parts", 0), 0.0, np.empty(0))] == [10, 40]
    assert [s.count for s in stretches(grid("growing", 0), 0.0, np.empty(0))] == [1] * 25
    assert [s.count for s in stretches(np.array([0.0, 0.0, 1.0]), 0.0, np.empty(0))] == [1]
    assert stretches(np.array([0.0, 0.0]), 0.0, np.array([1.0])) == []


@pytest.mark.parametrize("begin", [0.0, -1.5, -3.0])
def test_drift_is_not_hidden_in_equal_steps(begin: float) -> None:
    """Steps that differ by rounding only, but all in one direction, would miss their samples: they are taken one by one."""
    same, n = 8.0 * 2.0**-53 * 3.0, 400
    steps = 3.0 / n + 0.9 * same * np.linspace(-1.0, 1.0, n)
    times = begin + np.cumsum(steps)
    found = stretches(times, begin, np.empty(0))
    assert [s.count for s in found].count(1) > 0.5 * n
    starts = np.array([s.start for s in found])
    assert starts[0] == 0.0
    assert starts[1:] == pytest.approx([s.start + s.count * s.h for s in found[:-1]], abs=2 * same)
    assert begin + starts == pytest.approx([begin, *(times[s.row - 1] for s in found[1:])], abs=2 * same)


def test_a_sample_at_a_breakpoint_belongs_to_the_piece_before() -> None:
    assert stretches(np.array([1.0, 2.0]), 0.0, np.array([1.0])) == [Stretch(0, 0.0, 1.0, 1, 0), Stretch(1, 0.0, 1.0, 1, 1)]
