"""Derivatives of eigenvalues: of matrices whose eigenvalues are known for every value of a parameter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.linalg import block_diag

from gearlib.errors import SolverError
from gearlib.linear import eigenvalue_changes as module
from gearlib.linear.balancing import similarity
from gearlib.linear.eigenvalue_changes import eigenvalue_changes


@pytest.fixture(params=["all vectors", "vectors around each"])
def road(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Both ways to the eigenvectors: of a small matrix, and of one that counts as large."""
    if request.param == "all vectors":
        return np.asarray
    monkeypatch.setattr(module, "MOST_FULL", 0)
    return sparse.csr_matrix


def turned(A: Any, *more: Any, seed: int = 0, units: float = 2.0) -> list[Any]:
    """The same matrices in other states: in any units, and mixed."""
    rng = np.random.default_rng(seed)
    T = np.diag(10.0 ** rng.uniform(-units, units, len(A))) @ (np.eye(len(A)) + 0.2 * rng.normal(size=A.shape))
    return [T @ m @ np.linalg.inv(T) for m in (A, *more)]


@pytest.mark.parametrize("seed", range(3))
def test_simple_eigenvalues_change_as_their_closed_form_says(seed: int, road: Any) -> None:
    """Oscillators s**2 + d s + c = 0, each by its c and by its d, decays by themselves; 0 stays."""
    c, d = np.array([9.0, 100.0, 400.0]), np.array([0.6, 0.0, 4.0])
    blocks = [np.array([[0.0, 1.0], [-ck, -dk]]) for ck, dk in zip(c, d, strict=True)]
    A = block_diag(*blocks, [[-0.7]], [[0.0]], [[-90.0]])
    by_c = block_diag(*[np.array([[0.0, 0.0], [-(k + 1.0), 0.0]]) for k in range(3)], [[0.0]], [[0.0]], [[2.0]])
    by_d = block_diag(*[np.array([[0.0, 0.0], [0.0, -(k + 1.0)]]) for k in range(3)], [[5.0]], [[0.0]], [[0.0]])
    given = [road(m) for m in turned(A, by_c, by_d, seed=seed)]
    s = np.concatenate([-d / 2 + 1j * np.sqrt(c - d**2 / 4), [-0.7, 0.0, -90.0]])
    slope = 2 * s[:3] + d
    found = eigenvalue_changes(given[0], given[1:], s)
    assert found.shape == (2, 6)
    assert found[0] == pytest.approx(np.array([*(-np.arange(1, 4) / slope), 0.0, 0.0, 2.0]), rel=1e-6, abs=1e-9)
    assert found[1] == pytest.approx(np.array([*(-np.arange(1, 4) * s[:3] / slope), 5.0, 0.0, 0.0]), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("unit", [1e-9, 1e-4, 1.0, 1e6])
def test_slow_or_fast_ones_are_not_alike(unit: float, road: Any) -> None:
    """What is equal is told by ratios."""
    A, change = np.diag([1.0, 1.5, 2.0, 2.0 + 1e-6]), np.diag([4.0, 5.0, 6.0, 7.0])
    (found,) = eigenvalue_changes(road(unit * A), [road(change)], unit * np.diag(A).astype(complex))
    assert found == pytest.approx([4.0, 5.0, 6.0, 7.0])


def test_branches_of_a_repeated_eigenvalue_are_sorted(road: Any) -> None:
    """Three of one value part by the eigenvalues of what changes in their space, by real parts, then by imaginary ones."""
    inner = np.array([[1.0, 4.0, 0.0], [-4.0, 1.0, 0.0], [0.0, 0.0, -2.0]])
    A, change = turned(np.diag([3.0, 3.0, 3.0, 8.0, -1.0]), block_diag(inner, [[6.0]], [[7.0]]), units=0.5)
    (found,) = eigenvalue_changes(road(A), [road(change)], np.array([3.0, 8.0, 3.0, 3.0, -1.0]))
    assert found == pytest.approx(np.array([-2.0, 6.0, 1.0 - 4.0j, 1.0 + 4.0j, 7.0]), rel=1e-6)


def test_some_of_a_repeated_eigenvalue_are_told_if_they_change_alike(road: Any) -> None:
    A, alike, parting = np.diag([2.0, 2.0, 2.0, 5.0]), np.diag([3.0, 3.0, 3.0, 1.0]), np.diag([3.0, 3.0, 3.1, 1.0])
    (found,) = eigenvalue_changes(road(A), [road(alike)], np.array([2.0, 2.0]))
    assert found == pytest.approx([3.0, 3.0])
    said = r"the eigenvalue 2\+0j 1/s is repeated 3 times, and a change of the parameter parts them; ask for all of them, not for 2"
    with pytest.raises(SolverError, match=said):
        eigenvalue_changes(road(A), [road(parting)], np.array([2.0, 2.0]))
    (found,) = eigenvalue_changes(road(A), [road(0 * alike)], np.array([2.0, 5.0]))
    assert found.tolist() == [0.0, 0.0]


def test_a_repeated_eigenvalue_with_too_few_vectors_is_refused(road: Any) -> None:
    A, change = np.array([[-2.0, 1.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, -9.0]]), np.diag([0.0, 1.0, 4.0])
    with pytest.raises(SolverError, match=r"the eigenvalue -2\+0j 1/s has no derivative: it is repeated with too few"):
        eigenvalue_changes(road(A), [road(change)], np.array([-2.0, -2.0, -9.0], complex))


def test_nothing_changes_where_all_are_zero_or_nothing_is_asked(road: Any) -> None:
    A = road(np.array([[0.0, 1.0], [0.0, 0.0]]))
    assert eigenvalue_changes(A, [A, A, A], np.zeros(2)).tolist() == [[0, 0]] * 3
    assert eigenvalue_changes(road(np.diag([1.0, 2.0])), [], np.array([1.0, 2.0])).shape == (0, 2)


def test_neighbours_of_a_large_matrix_do_not_mix() -> None:
    """Of six hundred, some are asked for; two are close, but not alike."""
    values = np.concatenate([[1.0, 1.0 + 1e-5], np.arange(2.0, 600.0)])
    rates = np.cos(np.arange(600.0))
    A, change = (sparse.diags(m).tocsr() for m in (values, rates))
    for chosen in ([0, 1], [0], [1, 300, 599]):
        (found,) = eigenvalue_changes(A, [change], values[chosen].astype(complex))
        assert found == pytest.approx(rates[chosen], rel=1e-6)


def test_branches_are_found_from_values_that_are_not_exact(road: Any) -> None:
    """A repeated eigenvalue that is known to seven digits is one of those that are repeated to sixteen."""
    A, change = turned(np.diag([3.0, 3.0, 8.0]), np.diag([1.0, -2.0, 5.0]), units=0.5)
    (found,) = eigenvalue_changes(road(A), [road(change)], np.array([3.0, 3.0, 8.0]) * (1 + 2e-7))
    assert found == pytest.approx([-2.0, 1.0, 5.0], rel=1e-6)


def test_vectors_around_a_value_are_unit_vectors_of_the_scaled_states() -> None:
    A = np.random.default_rng(3).normal(size=(6, 6)) + np.diag(np.arange(6.0))
    scale = similarity(A)[:, None]
    values, left, right = module._vectors_around(sparse.csr_matrix(A), complex(np.linalg.eigvals(A)[2]))
    assert A @ right == pytest.approx(right * values, rel=1e-9, abs=1e-9)
    assert A.T @ left == pytest.approx(left * values.conj(), rel=1e-9, abs=1e-9)
    assert np.linalg.norm([left * scale, right / scale], axis=1) == pytest.approx(np.ones((2, 6)), rel=1e-9)
