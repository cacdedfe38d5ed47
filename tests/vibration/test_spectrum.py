"""Spectra of matrices by hand: free motions, preloads and positions at 0, decays, and the scales of large matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.linalg import block_diag

from gearlib.errors import SolverError
from gearlib.linear.balancing import similarity
from gearlib.vibration import spectrum as module
from gearlib.vibration.eigenvalue_count import missing_inside
from gearlib.vibration.lowest_eigenvalues import lowest
from gearlib.vibration.spectrum import dense_spectrum, sparse_spectrum, without_preloads
from tests.stress.test_right_calls import given


def chain(n: int, inertia: float = 2.0, c: float = 18.0) -> tuple[Any, Any, Any]:
    """Bodies in a row with springs between them, twists before speeds; their speeds and torques as rows."""
    twist = np.zeros((n - 1, n))
    twist[np.arange(n - 1), np.arange(n - 1)], twist[np.arange(n - 1), np.arange(1, n)] = 1.0, -1.0
    A = np.block([[np.zeros((n - 1, n - 1)), twist], [-c * twist.T / inertia, np.zeros((n, n))]])
    speeds = np.hstack([np.zeros((n, n - 1)), np.eye(n)])
    forces = np.hstack([c * np.eye(n - 1), np.zeros((n - 1, n))])
    return A, speeds, forces


def hand(n: int, inertia: float = 2.0, c: float = 18.0) -> Any:
    return 2 * np.sqrt(c / inertia) * np.sin(np.pi * np.arange(1, n) / (2 * n))


@pytest.mark.parametrize("count", [None, 1, 3, 9])
@pytest.mark.parametrize("n", [2, 5])
def test_a_free_chain(n: int, count: int | None) -> None:
    """One free motion, in which all speeds are alike and nothing is twisted; shapes with the largest state 1."""
    A, speeds, forces = chain(n)
    found = dense_spectrum(A, speeds, count, forces)
    kept = len(hand(n)[:count])
    assert found.values == pytest.approx(1j * hand(n)[:count], rel=1e-10)
    assert (found.values.real == 0).all()
    assert found.free.shape == (2 * n - 1, 1)
    motion = found.free[:, 0] / found.free[-1, 0]
    assert motion == pytest.approx([0.0] * (n - 1) + [1.0] * n)
    assert found.preloads == 0
    assert len(found.decays) == 0
    assert np.abs(found.vectors).max(axis=0) == pytest.approx(np.ones(kept))
    assert A @ found.vectors == pytest.approx(found.vectors * found.values, abs=1e-9)
    assert dense_spectrum(A, speeds, count).preloads is None


def test_what_is_at_zero_is_a_motion_a_preload_or_neither() -> None:
    """A loop of two springs between two bodies can be preloaded; a position on which nothing depends is not counted."""
    A = np.zeros((5, 5))  # two twists, a position, two speeds
    A[0, 3], A[0, 4], A[1, 3], A[1, 4], A[2, 3] = 1.0, -1.0, 1.0, -1.0, 1.0
    A[3, :2], A[4, :2] = [-6.0, -3.0], [2.0, 1.0]
    speeds, forces = np.eye(5)[3:], np.diag([6.0, 3.0, 0, 0, 0])[:2]
    found = dense_spectrum(A, speeds, None, forces)
    assert found.values == pytest.approx([1j * np.sqrt(12.0)])
    assert (found.free.shape[1], found.preloads) == (1, 1)
    assert dense_spectrum(A, speeds, None, 0 * forces).preloads == 0
    for size in (1e-15, 1e-7, 1e7, 1e15):  # units of forces and speeds
        assert dense_spectrum(A, speeds, None, size * forces).preloads == 1
        turned = dense_spectrum(A, size**0.4 * speeds, None, forces)
        assert (turned.free.shape[1], turned.preloads) == (1, 1)
    keep = [0, 1, 3, 4]
    free = found.free[keep]
    mixed = free + np.array([[1.0], [-2.0], [0.0], [0.0]])
    clean, alone = given(lambda: without_preloads(A[np.ix_(keep, keep)], speeds[:, keep], mixed))
    assert alone
    assert clean[:, 0] == pytest.approx([0.0, 0.0, *free[2:, 0]])
    mixed, alone = without_preloads(np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[1.0, 0.0]]), np.ones((2, 1)))
    assert not alone
    assert mixed.tolist() == [[1], [1]]


@pytest.mark.parametrize("springs", [1, 2, 3, 5])
def test_parallel_springs_can_be_preloaded_in_one_way_less_than_there_are(springs: int) -> None:
    """Between two bodies that turn freely; the position of one of them is a state that changes with its speed."""
    c = np.arange(1.0, springs + 1)
    A = np.zeros((springs + 3, springs + 3))  # twists, the position, two speeds
    A[:springs, -2:], A[springs, -2] = [1.0, -1.0], 1.0
    A[-2, :springs], A[-1, :springs] = -c / 2.0, c / 3.0
    found = dense_spectrum(A, np.eye(springs + 3)[-2:], None, np.diag([*c, 0, 0, 0])[:springs])
    assert (found.free.shape[1], found.preloads) == (1, springs - 1)
    assert found.values == pytest.approx([1j * np.sqrt(c.sum() * (1 / 2 + 1 / 3))])
    assert found.free[-2:, 0] / found.free[-1, 0] == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize("form", [np.asarray, sparse.csc_matrix])
@pytest.mark.parametrize("c", [1e-9, 1.0, 1e9])
def test_rounding_of_what_stands_is_no_motion_of_it_whatever_the_stiffness(form: Any, c: float) -> None:
    """One body turns freely, another hangs on a spring to the ground, in which the free motion leaves a part in 1e13."""
    A = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-c / 2.0, 0.0, 0.0]])
    speeds = np.eye(3)[1:]
    free, alone = without_preloads(form(A), form(speeds), np.array([[0.5], [1.0], [1e-13]]))
    assert (alone, free[:, 0].tolist()) == (True, [0.0, 1.0, 1e-13])
    moving = np.array([[0.5], [1.0], [1e-3]])
    free, alone = without_preloads(form(A), form(speeds), moving)
    assert not alone
    assert free is moving


def test_still_or_empty_matrices() -> None:
    nothing = dense_spectrum(np.zeros((0, 0)), np.zeros((0, 0)), None, np.zeros((0, 0)))
    assert (len(nothing.values), nothing.free.shape, nothing.preloads, len(nothing.decays)) == (0, (0, 0), 0, 0)
    assert nothing.vectors.shape == (0, 0)
    still = dense_spectrum(np.zeros((2, 2)), np.zeros((1, 2)), None, np.zeros((1, 2)))
    assert (still.free.shape, still.preloads) == ((2, 0), 0)
    coasting = dense_spectrum(np.zeros((2, 2)), np.array([[0.0, 1.0]]), None, np.array([[5.0, 0.0]]))
    assert coasting.free.shape == (2, 1)
    assert coasting.free[0, 0] == pytest.approx(0)
    assert coasting.preloads == 1
    for rest in (np.zeros((2, 2)), np.array([[0.0, 1.0], [0.0, 0.0]])):
        large = sparse_spectrum(sparse.csr_matrix(rest), sparse.csr_matrix([[0.0, 1.0]]), 3)
        assert (large.free.shape, len(large.values), len(large.decays)) == ((2, 1), 0, 0)


def test_decays_are_sorted_from_the_slowest_and_modes_by_magnitude() -> None:
    swings = [np.array([[0.0, w], [-w, -2 * ratio * w]]) for w, ratio in ((5.0, 0.1), (3.0, 0.9), (4.0, 0.0))]
    A = block_diag(*swings, [[-7.0]], [[-0.5]], [[2.0]])
    found = dense_spectrum(A, np.eye(9), None)
    assert found.decays == pytest.approx([2.0, -0.5, -7.0])
    assert np.abs(found.values) == pytest.approx([3.0, 4.0, 5.0])
    assert -found.values.real / np.abs(found.values) == pytest.approx([0.9, 0.0, 0.1], abs=1e-12)
    assert found.values[1].real == 0


@pytest.mark.parametrize("n", [40])
def test_large_chains_have_the_same_lowest_modes(n: int) -> None:
    A, speeds, _ = chain(n)
    large = sparse_spectrum(sparse.csr_matrix(A), sparse.csr_matrix(speeds), 4)
    assert large.values[:4] == pytest.approx(1j * hand(n)[:4], rel=1e-9)
    assert large.free.shape[1] == 1
    assert large.free[:, 0] / large.free[-1, 0] == pytest.approx([0.0] * (n - 1) + [1.0] * n, abs=1e-9)
    assert large.preloads is None


def test_what_cannot_be_verified_is_computed_in_full_or_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    A, speeds, _ = chain(6)
    monkeypatch.setattr(module, "lowest", lambda *_: None)
    sparse_ones = sparse.csr_matrix(A), sparse.csr_matrix(speeds)
    assert sparse_spectrum(*sparse_ones, 3).values == pytest.approx(1j * hand(6)[:3])
    monkeypatch.setattr(module, "MOST_FULL", 11)
    assert len(sparse_spectrum(*sparse_ones, 3).values) == 3
    monkeypatch.setattr(module, "MOST_FULL", 10)
    with pytest.raises(
        SolverError, match=r"the lowest 3 modes of 11 states could not be told .* \(10 states have all theirs\)"
    ):
        sparse_spectrum(*sparse_ones, 3)


@pytest.mark.parametrize("seed", range(6))
def test_scales_make_partners_alike_and_rows_as_large_as_columns(seed: int) -> None:
    """Of random units: a_ij and a_ji come to one size; what acts one way only is scaled, too, and what is alone stays finite."""
    rng = np.random.default_rng(seed)
    n = 12
    units = 10.0 ** rng.uniform(-5, 5, n)
    skew = np.triu(rng.uniform(0.5, 2, (n, n)) * (rng.random((n, n)) < 0.3), 1)
    A = (skew - skew.T) * units[:, None] / units
    A[0, :] = A[:, 0] = 0.0  # a state without any coupling
    A[0, 0] = -3.0
    scale = similarity(sparse.csr_matrix(A))
    assert np.isfinite(scale).all()
    assert np.log(scale).mean() == pytest.approx(0)
    scaled = np.abs(A / scale[:, None] * scale)
    assert scaled == pytest.approx(scaled.T, rel=1e-4)
    A[1, 2:5], A[2:5, 1] = 1e6 * rng.uniform(1, 2, 3), 0.0  # state 1 is driven by others, and drives nothing of them
    scale = similarity(sparse.csr_matrix(A))
    assert np.isfinite(scale).all()
    scaled = np.abs(A / scale[:, None] * scale) * ~np.eye(n, dtype=bool)
    rows, columns = scaled.sum(axis=1), scaled.sum(axis=0)
    both = (rows > 0) & (columns > 0)
    assert (np.abs(np.log(rows[both] / columns[both])) < 1.0).all()


@pytest.mark.parametrize("count", [1, 3])
def test_the_lowest_of_a_matrix_with_zeros_and_decays(count: int) -> None:
    """Poles at 0 are counted in advance; real ones take places in the disc, but are not oscillating modes."""
    w = np.array([1.0, 1.0, 2.5, 4.0, *np.linspace(20, 60, 90)])
    swings = [np.array([[0.0, x], [-x, -0.02 * x]]) for x in w]
    A = sparse.csc_matrix(block_diag(*swings, np.zeros((2, 2)), np.diag([-0.1, -1.7, -3.0])))
    found = lowest(A, count, 2)
    assert found is not None
    ringing = found.values[found.values.imag > 0]
    assert len(ringing) >= count
    assert np.abs(ringing) == pytest.approx(w[: len(ringing)], rel=1e-9)
    assert -ringing.real / np.abs(ringing) == pytest.approx(np.full(len(ringing), 0.01), rel=1e-7)
    radius = np.abs(found.values).max()
    inside = [x for x in (-0.1, -1.7, -3.0) if abs(x) <= radius]
    assert sorted(found.values[found.values.imag == 0].real, reverse=True) == pytest.approx(inside)
    assert (np.diff(np.abs(found.values)) > -1e-9).all()
    assert A @ found.vectors == pytest.approx(found.vectors * found.values, abs=1e-7)
    assert missing_inside(A, radius * 1.01, found.values, 2) == 0


def test_a_count_on_the_edge_is_not_known() -> None:
    A = sparse.csc_matrix(block_diag(*(np.array([[0.0, x], [-x, 0.0]]) for x in range(1, 12))))
    assert missing_inside(A, 5.0, np.empty(0, complex), 0) is None
    assert missing_inside(A, 5.0 + 1e-12, np.empty(0, complex), 0) is None
    assert missing_inside(A, 5.01, np.empty(0, complex), 0) == 10
    real = sparse.csc_matrix(np.diag([-1.0, 5.0, 7.0, -9.0]))
    assert [missing_inside(real, radius, np.empty(0, complex), 0) for radius in (4.9, 5.0, 7.1, 9.0)] == [1, None, 3, None]
    assert missing_inside(A, 0.5, np.empty(0, complex), 0) == 0


@pytest.mark.parametrize("unit", [1e-8, 1e-3, 1.0, 1e4, 1e8])
def test_a_spectrum_is_the_same_in_any_unit_of_time(unit: float) -> None:
    """Swings, one nearly and one critically damped, decays, a free motion and a preload."""
    swings = [np.array([[0.0, w], [-w, -2 * ratio * w]]) for w, ratio in ((5.0, 0.1), (3.0, 0.999), (4.0, 0.0), (2.5, 1.0))]
    loop = np.zeros((4, 4))  # two springs between two bodies
    loop[0, 2:], loop[1, 2:], loop[2, :2], loop[3, :2] = [1.0, -1.0], [1.0, -1.0], [-6.0, -3.0], [2.0, 1.0]
    A = block_diag(*swings, [[-7.0]], [[-0.5]], loop)
    speeds, forces = np.eye(len(A))[-2:], np.diag([6.0, 3.0])
    found = dense_spectrum(unit * A, speeds, None, np.hstack([np.zeros((2, len(A) - 4)), forces, np.zeros((2, 2))]))
    expected = [3.0 * np.exp(1j * np.arccos(-0.999)), np.sqrt(12.0) * 1j, 4j, 5.0 * np.exp(1j * np.arccos(-0.1))]
    assert found.values / unit == pytest.approx(np.array(expected), rel=1e-9)
    assert (found.values.real[1:3] == 0).all()
    assert found.decays / unit == pytest.approx([-0.5, -2.5, -2.5, -7.0], rel=1e-6)
    assert (found.free.shape[1], found.preloads) == (1, 1)
    assert unit * A @ found.vectors == pytest.approx(found.vectors * found.values, rel=1e-8, abs=1e-9 * unit)


@pytest.mark.parametrize("form", [np.asarray, sparse.csr_matrix])
@pytest.mark.parametrize("seed", range(4))
def test_preloads_are_taken_out_of_free_motions_of_geared_shafts(seed: int, form: Any) -> None:
    """Bodies in a row, each driven by the one before through two springs side by side, with any ratio: rounding is no rate."""
    rng = np.random.default_rng(seed)
    n = 5
    ratio, J, c = rng.uniform(0.2, 3, n - 1), 10.0 ** rng.uniform(-3, 3, n), 10.0 ** rng.uniform(0, 6, 2 * (n - 1))
    twist = np.zeros((2 * (n - 1), n))
    for k in range(n - 1):
        twist[[2 * k, 2 * k + 1], k], twist[[2 * k, 2 * k + 1], k + 1] = ratio[k], -1.0
    A = np.block([[np.zeros((len(c), len(c))), twist], [-(twist * c[:, None]).T / J[:, None], np.zeros((n, n))]])
    speeds = np.hstack([np.zeros((n, len(c))), np.eye(n)])
    forces = np.hstack([np.diag(c), np.zeros((len(c), n))])
    A *= (1e-14, 1e-3, 1e3, 1e9)[seed]  # in any unit of time
    found = dense_spectrum(A, speeds, None, forces)
    assert (found.free.shape[1], found.preloads) == (1, n - 1)
    turning = np.cumprod([1.0, *ratio])
    locked = np.zeros(len(A))
    locked[:2] = [c[1], -c[0]]
    motion = found.free / found.free[-n, 0]
    free, alone = without_preloads(form(A), form(speeds), motion + 0.3 * locked[:, None] / c.max())
    assert alone
    assert free[: len(c)].tolist() == [[0]] * len(c)
    assert free[len(c) :, 0] == pytest.approx(turning, rel=1e-6)
    pushed = motion * (1.0, 1e-14, 1e9, 1e-9)[seed]
    pushed[-1] *= 1.01  # no motion at 0
    free, alone = without_preloads(form(A), form(speeds), pushed)
    assert not alone
    assert free is pushed


@pytest.mark.parametrize("seed", range(6))
def test_preloads_and_free_motions_are_counted_in_any_units_of_the_states(seed: int) -> None:
    """Two bodies that turn freely, with several springs side by side; angles in seconds of arc, speeds in turns a day, and the like."""
    rng = np.random.default_rng(seed)
    springs = int(rng.integers(2, 6))
    c, J = rng.uniform(1, 9, springs), rng.uniform(1, 9, 2)
    A = np.zeros((springs + 2, springs + 2))
    A[:springs, -2:] = [1.0, -1.0]
    A[-2, :springs], A[-1, :springs] = -c / J[0], c / J[1]
    units = 10.0 ** rng.uniform(-7, 7, springs + 2)
    scaled = A * units[:, None] / units
    speeds, forces = np.eye(springs + 2)[-2:] / units, np.diag([*c, 0, 0])[:springs] / units
    found = dense_spectrum(scaled, speeds, None, forces)
    assert (found.free.shape[1], found.preloads) == (1, springs - 1)
    assert found.values == pytest.approx([1j * np.sqrt(c.sum() * (1 / J).sum())])
    assert speeds @ found.vectors * J[:, None] == pytest.approx(
        (speeds @ found.vectors * J[:, None])[0] * np.array([[1.0], [-1.0]])
    )


@pytest.mark.parametrize(("unit", "damping"), [(1e-12, 0.05), (1e-6, 0.05), (1e6, 0.0)])
def test_damping_of_large_matrices_is_rounding_or_not_in_any_unit_of_time(
    unit: float, damping: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Damping in proportion to stiffness: the ratio is w d / (2 c). The position of one body is a state, too."""
    monkeypatch.setattr(module, "MOST_FULL", 0)  # the lowest ones alone are computed
    n = 100
    A, speeds, _ = chain(n)
    A[-n:, -n:] = damping / 18.0 * A[-n:, : n - 1] @ A[: n - 1, -n:]
    A = np.block([[A, np.zeros((2 * n - 1, 1))], [speeds[0], np.zeros(1)]])
    speeds = np.hstack([speeds, np.zeros((n, 1))])
    found = sparse_spectrum(sparse.csr_matrix(unit * A), sparse.csr_matrix(speeds), 3)
    w = hand(n)[:3]
    assert np.abs(found.values[:3]) / unit == pytest.approx(w, rel=1e-8)
    assert -found.values[:3].real / np.abs(found.values[:3]) == pytest.approx(w * damping / 36.0, rel=1e-6)
    assert damping or (found.values.real == 0).all()
    assert found.free.shape[1] == 1
    assert (speeds @ found.free)[:, 0] / (speeds @ found.free)[0, 0] == pytest.approx(np.ones(n), abs=1e-8)


@pytest.mark.parametrize("count", [1, 2, 5, 6, 7, 8, 12])
def test_all_that_is_inside_is_counted_though_nothing_is_known(count: int) -> None:
    """Slow decays far inside the disc turn the phase evenly, from the first step on; one outside does not."""
    values = [-0.001 * (k + 1) for k in range(count)]
    A = sparse.csc_matrix(np.diag([*values, -50.0, 70.0]))
    assert missing_inside(A, 1.0, np.empty(0, complex), 0) == count
    assert missing_inside(A, 1.0, np.array(values[:1], complex), 0) == count - 1
    assert missing_inside(A, 60.0, np.array(values, complex), 0) == 1


def test_speeds_that_are_rounding_make_no_free_motion() -> None:
    """Of a state that stays as it is, beside one that decays."""
    A = np.diag([0.0, -1.0])
    for speed, free in ((1e-13, 0), (1e-6, 1)):
        assert dense_spectrum(A, np.array([[speed, 1.0]]), None).free.shape == (2, free)
