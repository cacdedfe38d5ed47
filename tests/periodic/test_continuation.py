"""Continuation on curves that are known: how many points it gives, and where."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gearlib.errors import SolverError
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


@pytest.mark.parametrize("step", [0.02, 0.005])
def test_points_are_as_far_apart_as_is_asked_for(step: float) -> None:
    """In parts of the interval, a growth by the own size counts 0.2; from a quarter of that, half as much more at each point."""
    path = follow(circle, np.array([-0.6]), -0.8, 2.0, step, 2000)
    z, w = path.z[:, 0], path.w / 2.8
    size = np.maximum(np.abs(z), 0.05 * np.maximum.accumulate(np.abs(z)))[:-1]
    lengths = np.hypot(0.2 * np.diff(z) / size, np.diff(w))
    assert lengths[:4] == pytest.approx(step / 4 * 1.5 ** np.arange(4), rel=1e-2)
    assert lengths.max() == pytest.approx(step, rel=1e-3)
    usual = np.abs(lengths - step) < 1e-3 * step
    assert usual.sum() > 0.9 * len(lengths)
    assert not usual[-1], "the last point lies at the end of the interval"


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


def test_every_point_but_the_first_is_shown_to_who_accepts() -> None:
    """Those at a fold and at the end as well."""
    shown: list[float] = []
    path = follow(circle, np.array([-0.6]), -0.8, 2.0, 0.05, 2000, accept=lambda z, w: not shown.append(w))
    assert shown == path.w[1:].tolist()
    assert path.complete
    for last in (path.folds[0], len(path.w) - 1):
        cut = follow(circle, np.array([-0.6]), -0.8, 2.0, 0.05, 2000, accept=lambda z, w, last=last: w != path.w[last])
        assert (len(cut.w), cut.complete) == (last + 1, False)


@pytest.mark.parametrize(("start", "end"), [(2.0, 12.0), (12.0, 2.0)])
def test_steps_begin_at_a_quarter_and_grow_to_the_largest(start: float, end: float) -> None:
    """On a level line, where nothing bends: in parts of the interval, in either direction."""

    def level(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        return z - 3.0, np.eye(1), np.zeros(1)

    path = follow(level, np.array([3.0]), start, end, 0.1, 500)
    steps = np.diff(path.w) / (end - start)
    assert steps[:-1] == pytest.approx([0.025, 0.0375, 0.05625, 0.084375, *[0.1] * (len(steps) - 5)])
    assert path.w[-1] == end
    assert 0.0 < steps[-1] <= 0.1


def growing(k: float) -> object:
    def equations(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        """Both unknowns grow as ``exp(k w)``, the first one a thousand times as large."""
        e = np.exp(k * w)
        return z - np.array([1e3, 1.0]) * e, np.eye(2), -k * np.array([1e3, 1.0]) * e

    return equations


def test_growth_by_its_own_size_counts_a_fifth_of_the_interval() -> None:
    """Where a branch is steep, its size grows by ``step / 0.2`` of itself in a step; what is skipped does not count."""
    steep = follow(growing(20.0), np.array([1e3, 1.0]), 0.0, 1.0, 0.04, 1000)
    assert steep.complete
    growth = np.diff(steep.z[:, 1]) / steep.z[:-1, 1]
    along = np.hypot(np.diff(steep.w), 0.2 * growth)
    assert along[0] == pytest.approx(0.01, rel=0.02)
    assert 0.039 < along.max() < 0.048
    assert (along[1:] / along[:-1] < 1.6).all()
    level = growing(0.0)

    def both(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        return tuple(np.concatenate(parts) if k != 1 else np.diag(np.ones(4)) for k, parts in enumerate(  # type: ignore[return-value]
            zip(growing(20.0)(z[:2], w), level(z[2:], w), strict=True)))  # type: ignore[operator]  # fmt: skip

    skipping = follow(both, np.array([1e3, 1.0, 1e3, 1.0]), 0.0, 1.0, 0.04, 1000, skipped=2)
    plain = follow(level, np.array([1e3, 1.0]), 0.0, 1.0, 0.04, 1000)
    assert skipping.w == pytest.approx(plain.w, rel=1e-9)


@pytest.mark.parametrize("gap", [0.1, 0.03])
@pytest.mark.parametrize("side", [1, -1])
def test_a_branch_is_not_left_for_one_that_it_comes_near(gap: float, side: int) -> None:
    """Both branches of ``z**2 = (w - 1)**2 + gap**2`` bend sharply where they are nearest."""

    def hyperbola(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        return z**2 - (w - 1) ** 2 - gap**2, np.diag(2 * z), np.array([-2 * (w - 1)])

    path = follow(hyperbola, np.array([side * np.hypot(1.0, gap)]), 0.0, 2.0, 0.2, 1000)
    assert path.complete
    assert path.z[:, 0] == pytest.approx(side * np.hypot(path.w - 1, gap), rel=1e-6)
    assert not path.folds
    assert len(path.w) < 60


def test_where_a_branch_ends_the_message_says_where() -> None:
    def half(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        if w > 5.0:
            raise np.linalg.LinAlgError
        return z - w, np.eye(1), -np.ones(1)

    with pytest.raises(SolverError) as failed:
        follow(half, np.array([2.0]), 2.0, 12.0, 0.1, 500)
    said = re.match(
        r"the branch cannot be followed beyond (\S+) rad/s, after (\d+) points: steps of (\S+) of the interval do not converge; "
        "take more samples, or fewer harmonics$",
        str(failed.value),
    )
    assert said is not None
    assert float(said[1]) == pytest.approx(5.0, abs=1e-5)
    whole = follow(lambda z, w: (z - w, np.eye(1), -np.ones(1)), np.array([2.0]), 2.0, 12.0, 0.1, 500)
    assert int(said[2]) >= (whole.w < 4.0).sum()
    assert 1e-8 < float(said[3]) < 1e-7


def test_no_frequency_below_zero_is_tried() -> None:
    """On the way back to the start, a long step would lead beyond it."""
    tried: list[float] = []

    def back(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        tried.append(w)
        return (z - 3) ** 2 + w - 40.0, np.diag(2 * (z - 3)), np.ones(1)

    path = follow(back, np.array([3 - np.sqrt(39.0)]), 1.0, 101.0, 0.3, 500)
    assert path.complete
    assert path.w[-1] == 1.0
    assert path.z[-1, 0] == pytest.approx(3 + np.sqrt(39.0), rel=1e-9)
    assert path.w[path.folds[0]] == pytest.approx(40.0, abs=1e-6)
    assert min(tried) > 0.0
