"""The parts of continuation: arclength, tangents, planes and folds of curves that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearlib.periodic import continuation as parts
from gearlib.periodic.continuation import follow
from tests.periodic.test_continuation import circle

Floats = np.ndarray


def plane(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
    """``z = (3 w, w)``."""
    return z - np.array([3.0, 1.0]) * w, np.eye(2), -np.array([3.0, 1.0])


def between(start: float = 2.0, end: float = 12.0, skipped: int = 0) -> parts.Continuation:
    return parts.Continuation(plane, start, end, skipped)


def at(*y: float, tangent: tuple[float, ...] = (), largest: float = 0.0) -> parts.BranchPoint:
    return parts.BranchPoint(np.array(y), np.array(tangent or y, float), 0, largest)


def test_the_parameter_is_scaled_to_the_interval() -> None:
    for start, end in ((2.0, 12.0), (12.0, 2.0)):
        task = between(start, end)
        y = np.array([1.0, 5.0, 0.3])
        w = start + 0.3 * (end - start)
        assert task.place(y) == pytest.approx(w)
        rest, gradient = task.extended(y)
        assert rest == pytest.approx([1.0 - 3 * w, 5.0 - w])
        assert gradient == pytest.approx(np.array([[1.0, 0.0, -3.0 * (end - start)], [0.0, 1.0, -(end - start)]]))


def test_the_size_of_a_point_is_that_of_what_is_not_skipped_and_a_twentieth_of_the_largest() -> None:
    y = np.array([100.0, 3.0, 4.0, 0.7])
    assert between().size(y) == pytest.approx(np.sqrt(10025.0))
    assert between(skipped=1).size(y) == 5.0
    assert between(skipped=1).size(y, 99.0) == 5.0
    assert between(skipped=1).size(y, 200.0) == pytest.approx(10.0)
    assert 0.0 < between().size(np.zeros(4)) < 1e-90


def test_arclength_counts_a_growth_of_its_own_size_as_a_fifth_of_the_interval() -> None:
    task, point = between(skipped=1), at(7.0, 3.0, 4.0, 0.5, tangent=(9.0, 2.0, -1.0, 0.25))
    a, b = np.array([50.0, 1.0, 2.0, 3.0]), np.array([60.0, -4.0, 5.0, 7.0])
    assert task.inner(a, b, point) == pytest.approx((0.2 / 5.0) ** 2 * 6.0 + 21.0)
    large = at(7.0, 3.0, 4.0, 0.5, tangent=(9.0, 2.0, -1.0, 0.25), largest=200.0)
    assert task.inner(a, b, large) == pytest.approx((0.2 / 10.0) ** 2 * 6.0 + 21.0)
    for here in (point, large):
        assert task.normal(here) @ a == pytest.approx(task.inner(a, here.tangent, here))


@pytest.mark.parametrize(
    ("off", "turned", "strayed"),
    [
        (0.0, 0.0, False),
        (0.29, 0.0, False),
        (0.31, 0.0, True),
        (-0.31, 0.0, True),
        (0.0, 25.0, False),  # cos 25.8 deg is 0.9
        (0.0, 27.0, True),
        (0.0, 180.0, True),
    ],
)
def test_a_branch_that_bends_may_have_been_left(off: float, turned: float, strayed: bool) -> None:
    """A prediction error of three tenths of the step, and tangents whose cosine is 0.9, are the limits; tangents of any length."""
    task = between()
    size, length = 5.0, 0.02
    unit = np.array([size / 0.2, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])  # of arclength 1, at right angles
    point = at(3.0, 4.0, 0.5, tangent=tuple(unit[1]))
    y = point.y + length * unit[1] + off * length * unit[0]
    tangent = 3.0 * (np.cos(np.radians(turned)) * unit[1] + np.sin(np.radians(turned)) * unit[0])
    assert task.strayed(point, parts.BranchPoint(y, tangent, 1, 0.0), length) == strayed


def test_a_branch_begins_with_its_tangent_in_the_direction_of_the_interval() -> None:
    for start, end in ((1.0, 3.0), (3.0, 1.0)):
        task = between(start, end)
        z = np.array([3.0, 1.0]) * start
        point = task.begin(z)
        along = np.array([3.0 * (end - start), end - start, 1.0])
        assert point.y.tolist() == [*z, 0.0]
        assert point.largest == pytest.approx(np.linalg.norm(z))
        assert point.tangent[-1] > 0
        assert task.inner(point.tangent, point.tangent, point) == pytest.approx(1.0)
        assert point.tangent / point.tangent[-1] == pytest.approx(along)
    fold = parts.Continuation(circle, 1.0, 2.0, 0).begin(np.array([0.0]))  # there is no tangent in that direction
    assert fold.tangent.tolist() == [0.0, 1.0]


def test_a_step_leads_to_the_plane_a_length_ahead() -> None:
    """On a circle: the new point satisfies the equation, and its tangent is that of the circle, of unit length and onwards."""
    task = parts.Continuation(circle, -0.8, 1.2, 0)
    point = task.begin(np.array([-0.6]))
    new = task.corrected(point, 0.05)
    assert new is not None
    z, w = float(new.y[0]), task.place(new.y)
    assert z**2 + w**2 == pytest.approx(1.0, rel=1e-12)
    assert task.inner(new.y - point.y, point.tangent, point) == pytest.approx(0.05, rel=1e-9)
    assert task.inner(new.tangent, new.tangent, new) == pytest.approx(1.0)
    assert task.inner(new.tangent, point.tangent, point) > 0
    assert z * new.tangent[0] + w * 2.0 * new.tangent[1] == pytest.approx(0.0, abs=1e-9)
    assert new.largest == pytest.approx(max(0.6, abs(z)))
    assert 1 <= new.iterations <= 4


@pytest.mark.parametrize(
    ("size", "noise", "settles"),
    [(1e3, 2e-3, True), (1e3, 2e-2, False), (30.0, 1e-4, True), (30.0, 6e-4, False), (1e6, 2.0, True)],
)
def test_changes_that_do_not_get_smaller_are_rounding_if_they_are_small_beside_the_unknowns(
    size: float, noise: float, settles: bool
) -> None:
    """A residual that is off by some noise, of another sign each time: changes are twice that, below 1e-5 of the size or above."""
    times = 0

    def noisy(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        nonlocal times
        times += 1
        return z - size + noise * (-1) ** times, np.eye(1), np.zeros(1)

    task = parts.Continuation(noisy, 2.0, 3.0, 0)
    guess = np.array([size, 0.5])
    found = task.on_plane(guess, np.array([0.0, 1.0]), at(size, 0.0, tangent=(0.0, 1.0)))
    assert (found is not None) == settles
    if found is not None:
        assert found.y == pytest.approx([size, 0.5], abs=2 * noise)
        assert found.iterations <= 4


def test_no_point_is_sought_at_a_frequency_that_is_not_positive() -> None:
    """But where the branch begins at none that is positive itself."""
    below = parts.Continuation(plane, 1.0, 2.0, 0)
    point = below.begin(np.array([3.0, 1.0]))
    normal = np.array([0.0, 0.0, 1.0])
    for share, found in ((-1.1, False), (-1.0, False), (-0.9, True)):
        guess = np.array([3.0, 1.0, share])
        assert (below.on_plane(guess, normal, point) is not None) == found
    free = parts.Continuation(plane, -1.0, 2.0, 0)
    reached = free.on_plane(np.array([0.0, 0.0, 0.1]), normal, free.begin(np.array([-3.0, -1.0])))
    assert reached is not None
    assert reached.y[:2] == pytest.approx([-2.1, -0.7])


def test_the_last_point_lies_at_the_border() -> None:
    """On a circle, whatever the other unknowns are."""

    def beside(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        rest, by_z, by_w = circle(z[:1], w)
        return np.append(rest, z[1] - 1.25), np.array([[by_z[0, 0], 0.0], [0.0, 1.0]]), np.append(by_w, 0.0)

    task = parts.Continuation(beside, -0.8, 0.0, 0)
    point, beyond = at(-0.8, 1.25, 0.25), at(-np.sqrt(0.96), 1.25, 1.25)
    for border in (0.5, 1.0):
        found = task.at_border(point, beyond, border)
        assert found is not None
        assert found.y[-1] == border
        assert found.y[:2] == pytest.approx([-np.sqrt(1 - (0.8 * (1 - border)) ** 2), 1.25], rel=1e-12)
        assert found.iterations <= 4


@pytest.mark.parametrize(
    ("kind", "z", "length"),
    [("even", -0.04, 0.5), ("even", -0.04, 0.35), ("uneven", -0.04, 0.5), ("uneven", -0.04, 0.35), ("sharp", -0.4, 0.3)],
)
def test_a_fold_is_found_between_two_points(kind: str, z: float, length: float) -> None:
    """Of ``w = 1 - f(z)``, where f has its least value 0 at z = 0; also of almost a corner, beside which tangents hardly change."""
    f = {
        "even": np.square, "uneven": lambda z: np.exp(5 * z) - 1 - 5 * z, "sharp": lambda z: np.hypot(z, 0.02) - 0.02,
    }[kind]  # fmt: skip
    rise = {
        "even": lambda z: 2 * z, "uneven": lambda z: 5 * (np.exp(5 * z) - 1), "sharp": lambda z: z / np.hypot(z, 0.02),
    }[kind]  # fmt: skip
    task = parts.Continuation(lambda z, w: (f(z) + w - 1, np.diag(rise(z)), np.ones(1)), 0.0, 2.0, 0)
    raw = np.array([1.0, -rise(z) / 2])
    y = z, (1 - f(z)) / 2
    size = np.sqrt(task.inner(raw, raw, at(*y, largest=1.0)))
    point = at(*y, tangent=tuple(raw / size), largest=1.0)
    beyond = task.corrected(point, length)
    assert beyond is not None
    assert point.tangent[-1] > 0 > beyond.tangent[-1]
    found = task.fold(point, beyond, length)
    assert found is not None
    assert task.place(found.y) == pytest.approx(1.0, abs=1e-9)
    assert found.y[0] == pytest.approx(0.0, abs=1e-5)
    assert abs(found.tangent[-1]) < 1e-6 * abs(point.tangent[-1] - beyond.tangent[-1])


def test_points_are_shown_with_all_their_unknowns() -> None:
    shown: list[tuple[list[float], float]] = []
    path = follow(plane, np.array([6.0, 2.0]), 2.0, 3.0, 0.2, 100, accept=lambda z, w: not shown.append((z.tolist(), w)))
    assert path.complete
    assert [z for z, _ in shown] == path.z[1:].tolist()
    assert [w for _, w in shown] == path.w[1:].tolist()
    assert path.z == pytest.approx(path.w[:, None] * [3.0, 1.0], rel=1e-9)


@pytest.mark.parametrize("side", [1, -1])
def test_a_step_that_leaves_the_branch_is_halved(side: int) -> None:
    """Both branches of ``z**2 = (w - 1)**2 + 0.003**2`` come nearer to each other than a step."""

    def hyperbola(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        return z**2 - (w - 1) ** 2 - 0.003**2, np.diag(2 * z), np.array([-2 * (w - 1)])

    path = follow(hyperbola, np.array([side * np.hypot(1.0, 0.003)]), 0.0, 2.0, 0.05, 1000)
    assert path.complete
    assert path.z[:, 0] == pytest.approx(side * np.hypot(path.w - 1, 0.003), rel=1e-6)


@pytest.mark.parametrize(("iterations", "factor"), [(1, 1.5), (3, 1.5), (4, 1.0), (5, 1.0), (6, 0.6), (11, 0.6)])
def test_steps_get_longer_where_they_converge_fast(iterations: int, factor: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a straight branch, from a quarter of the longest step on."""
    plain = parts.Continuation.corrected

    def corrected(task: parts.Continuation, point: parts.BranchPoint, length: float) -> parts.BranchPoint | None:
        found = plain(task, point, length)
        return None if found is None else replace(found, iterations=iterations)

    monkeypatch.setattr(parts.Continuation, "corrected", corrected)

    def steady(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        return z - 1.0, np.eye(1), np.zeros(1)

    step = 0.04
    path = follow(steady, np.ones(1), 2.0, 4.0, step, 8)
    expected = np.minimum(step / 4 * factor ** np.arange(7), step)
    assert np.diff(path.w) / 2.0 == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("root", "found"), [(-1e-9, False), (1e-9, True)])
def test_a_point_just_below_zero_is_none(root: float, found: bool) -> None:
    """Also where a last small correction led there."""

    def at_rest(z: Floats, w: float) -> tuple[Floats, Floats, Floats]:
        return np.array([w - root]), np.zeros((1, 1)), np.ones(1)

    task = parts.Continuation(at_rest, 1.0, 2.0, 0)
    guess, across = np.array([3.0, -1.0 + 2e-9]), np.array([1.0, 0.0])
    assert (task.on_plane(guess, across, at(3.0, 0.0, tangent=(0.0, 1.0))) is not None) == found
