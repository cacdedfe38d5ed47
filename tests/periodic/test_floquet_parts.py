"""Parts of the monodromy matrix: panels, products, null spaces, and eigenvalues that rounding puts beside the unit circle."""

from __future__ import annotations

from functools import reduce
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.periodic import floquet
from gearlib.periodic import floquet as parts
from gearlib.periodic.floquet import vibration_multipliers
from gearlib.periodic.periods import moments
from tests.periodic.test_floquet import pumped


@pytest.mark.parametrize("count", range(1, 12))
def test_a_product_has_the_first_matrix_on_the_right(count: int) -> None:
    steps = np.random.default_rng(count).normal(size=(count, 3, 3))
    assert parts.product(steps) == pytest.approx(reduce(lambda whole, step: step @ whole, steps), rel=1e-12)


def test_panels_divide_each_piece_equally_and_are_no_longer_than_asked() -> None:
    flags = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    found: Any = SimpleNamespace(pieces=[(0.5, 1.5, flags[0]), (1.5, 1.55, flags[1]), (1.55, 0.5 + 2 * np.pi, flags[0])])
    starts, lengths, discrete, last = parts.panels_of(found, 0.25)
    assert last == [4, 1, int(np.ceil((2 * np.pi - 1.05) / 0.25))]
    assert lengths[:5] == pytest.approx([0.25] * 4 + [0.05])
    assert lengths[5:] == pytest.approx((2 * np.pi - 1.05) / last[2])
    assert starts[:6] == pytest.approx([0.5, 0.75, 1.0, 1.25, 1.5, 1.55])
    assert starts[1:] == pytest.approx((starts + lengths)[:-1])
    assert discrete.T.tolist() == [*[[1.0, 0.0]] * 4, [0.0, 1.0], *[[1.0, 0.0]] * last[2]]
    equal: Any = SimpleNamespace(pieces=[(1.0, 1.0, flags[0])])
    assert [part.tolist() for part in parts.panels_of(equal, 0.25)[:2]] == [[1.0], [0.0]]


def test_a_null_space_is_what_a_matrix_takes_to_a_millionth_or_less() -> None:
    basis = np.linalg.qr(np.random.default_rng(1).normal(size=(4, 4)))[0]
    left = np.linalg.qr(np.random.default_rng(2).normal(size=(4, 4)))[0]
    for sizes, count in (([3, 1, 2e-6, 1e-3], 0), ([3, 1, 0.9e-6, 1e-3], 1), ([3, 0.0, 1e-9, 1e-3], 2), ([0.0] * 4, 4)):
        matrix = left @ np.diag(sizes) @ basis.T
        found = parts.null(matrix)
        assert found.shape == (4, count)
        assert found.T @ found == pytest.approx(np.eye(count))
        assert np.linalg.norm(matrix @ found) < 1.1e-6
    assert parts.null(np.ones((1, 3))).shape == (3, 2)
    assert parts.null(np.ones((3, 1))).shape == (1, 0)
    assert parts.null(np.empty((0, 3))).shape == (3, 3)


def turned(angle: float, size: float) -> np.ndarray:
    return size * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize(
    ("size", "on_circle"), [(1 + 0.5e-12, True), (1 - 0.5e-12, True), (1 + 2e-12, False), (1 - 2e-12, False), (0.3, False)]
)
def test_eigenvalues_whose_distance_from_the_unit_circle_is_rounding_lie_on_it(size: float, on_circle: bool) -> None:
    """A pair of a normal matrix, which is known to a part in 1e12 of its norm."""
    found = parts.eigenvalues(turned(0.7, size))
    assert np.angle(found) == pytest.approx([0.7, -0.7]) or np.angle(found) == pytest.approx([-0.7, 0.7])
    expected = 1.0 if on_circle else size
    assert np.abs(found) == pytest.approx([expected] * 2, rel=2e-15)


def test_an_eigenvalue_that_is_ill_conditioned_is_known_less_well() -> None:
    """Two multipliers a thousandth apart whose directions are nearly the same, and two at right angles."""
    basis = turned(0.6, 1.0)
    coupled = basis @ np.array([[1.0 + 1e-10, 1.0], [0.0, 1.0 - 1e-3]]) @ basis.T
    assert sorted(np.abs(parts.eigenvalues(coupled))) == [pytest.approx(1.0 - 1e-3), 1.0]
    for size in (1 + 0.5e-9, 1 - 0.5e-9):  # beside one of a thousand
        large = np.diag([0.0, 0.0, 1e3])
        large[:2, :2] = turned(0.7, size)
        assert sorted(np.abs(parts.eigenvalues(large))) == pytest.approx([1.0, 1.0, 1e3], rel=1e-15)
    apart = np.array([[1.0 + 1e-10, 0.0, 0.0], [0.0, 1.0 - 1e-3, 0.0], [0.0, 0.0, 0.5]])
    assert sorted(np.abs(parts.eigenvalues(apart)))[2] == pytest.approx(1.0 + 1e-10, rel=1e-14)
    assert parts.eigenvalues(np.empty((0, 0))).shape == (0,)
    assert parts.eigenvalues(np.zeros((1, 1))).tolist() == [0.0]


def test_what_is_kept_and_what_nothing_depends_on_have_no_multipliers() -> None:
    """Candidates count where the matrix keeps them: beside them the multipliers of the rest, in whatever basis."""
    rng = np.random.default_rng(3)
    basis = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    inner = np.array([[1.0, 2.0, 0.3, 0.1], [0.0, 1.0, 0.0, 0.0], [0.0, 0.5, 0.9, 0.2], [0.0, 0.1, 0.0, -0.4]])
    over_period = basis @ inner @ basis.T
    angle, speed, third = (basis[:, [k]] for k in range(3))
    none = np.empty((4, 0))

    def sizes(sums: np.ndarray, idle: np.ndarray) -> list[float]:
        return sorted(vibration_multipliers(over_period, sums, idle, np.zeros(4)).real.round(9).tolist())

    assert sizes(speed, angle) == pytest.approx([-0.4, 0.9])
    assert sizes(speed, none) == pytest.approx([-0.4, 0.9, 1.0])
    assert sizes(none, angle) == pytest.approx([-0.4, 0.9, 1.0])
    assert sizes(none, none) == pytest.approx([-0.4, 0.9, 1.0, 1.0], abs=1e-6)
    assert sizes(np.hstack([speed, third]), np.hstack([angle, third])) == pytest.approx([-0.4, 0.9])  # the third is not kept


@pytest.mark.parametrize(("off", "count"), [(0.0, 1), (1e-8, 1), (1e-3, 0)])
def test_a_phase_that_is_idle_already_takes_no_other_multiplier(off: float, count: int) -> None:
    """A growth along the idle direction but for rounding leaves 0.97; one across it takes that, the nearest to 1."""
    over_period = np.diag([1.0, 0.97, -0.8])
    growth = 5.0 * np.array([1.0, off, 0.0])
    found = vibration_multipliers(over_period, np.empty((3, 0)), np.eye(3)[:, :1], growth)
    assert sorted(found.real.tolist()) == [-0.8, 0.97][: 1 + count]


def test_beyond_the_most_panels_coefficients_count_as_constant_in_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """As the mean of two places: of ``y'' + 0.1 y' + (1 + 3 x(t)^2) y = 0``, in sixteen panels of which each is too long."""
    monkeypatch.setattr(floquet, "MOST", 16)
    omega, c = 0.5, np.array([[0.2, 0.0], [0.8, 0.0], [0.5, 0.0]])
    driven = pumped().driven(pumped().scene(["x", "v"]))(omega)
    found = floquet.monodromy(driven, c, moments(driven, c, 32), None, 32)
    expected = np.eye(2)
    h = 2 * np.pi / 16
    for k in range(16):
        places = h * (k + 0.5 + np.array([-1, 1]) * np.sqrt(3) / 6)
        x = 0.2 + 0.8 * np.cos(places) + 0.5 * np.sin(places)
        expected = expm(h / omega * np.array([[0.0, 1.0], [-1.0 - 3 * np.mean(x**2), -0.1]])) @ expected
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-4)
