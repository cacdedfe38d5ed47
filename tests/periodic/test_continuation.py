"""Continuation on curves that are known: how many points it gives, and where."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.periodic.continuation import follow

Floats = np.ndarray


def circle(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
    return np.array([z[0] ** 2 + w**2 - 1]), np.array([[2 * z[0]]]), np.array([2 * w])


def line(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
    return np.array([z[0] - 2 * w]), np.array([[1.0]]), np.array([-2.0])


def parabola(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
    """``w = 1 - z_0**2``, ``z_1 = z_0``: both grow through the fold at w = 1."""
    return np.array([z[0] ** 2 + w - 1, z[1] - z[0]]), np.array([[2 * z[0], 0.0], [-1.0, 1.0]]), np.array([1.0, 0.0])


def test_a_fold_is_where_the_parameter_turns_back() -> None:
    path = follow(parabola, np.array([-1.0, -1.0]), 0.0, 2.0, 0.02, 500)
    (fold,) = path.folds
    assert path.w[fold] == pytest.approx(1.0, abs=1e-9)
    assert path.z[fold] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert path.complete


@pytest.mark.parametrize("points", [2, 3, 7, 50])
def test_a_branch_ends_at_the_largest_number_of_points(points: int) -> None:
    path = follow(line, np.array([2.0]), 1.0, 1e6, 1e-6, points)
    assert len(path.w) == len(path.z) == points
    assert not path.complete
    assert path.z[:, 0] == pytest.approx(2 * path.w, rel=1e-9)
    assert (np.diff(path.w) > 0).all()


def test_a_fold_counts_as_a_point() -> None:
    """Whatever the limit, there are no more points, a fold at the limit included."""
    whole = follow(circle, np.array([-0.6]), -0.8, 2.0, 0.02, 2000)
    (fold,) = whole.folds
    assert whole.complete
    for points in (fold - 1, fold, fold + 1, fold + 2, fold + 5, len(whole.w), len(whole.w) + 1):
        path = follow(circle, np.array([-0.6]), -0.8, 2.0, 0.02, points)
        assert len(path.w) == min(points, len(whole.w))
        assert path.folds == (whole.folds if points > fold else ())
        assert path.complete == (points >= len(whole.w))
        assert path.w == pytest.approx(whole.w[: len(path.w)], rel=1e-12)


def test_a_point_that_is_not_accepted_is_the_last() -> None:
    path = follow(line, np.array([2.0]), 1.0, 2.0, 0.01, 500, accept=lambda z, w: w < 1.5)
    assert not path.complete
    assert (path.w[:-1] < 1.5).all()
    assert path.w[-1] >= 1.5
