"""Sparse equations with redundant rows and free unknowns, against dense singular value decompositions."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from gearlib.structure.sparse_elimination import factorise


def deficient(rng: np.random.Generator, m: int, n: int, rank: int) -> sparse.csr_matrix:
    """A sparse matrix of some rank, its rows and columns scaled over ten decades."""
    left = sparse.random(m, rank, 0.25, random_state=rng, data_rvs=rng.standard_normal) + sparse.eye(m, rank)
    right = sparse.random(rank, n, 0.25, random_state=rng, data_rvs=rng.standard_normal) + sparse.eye(rank, n)
    scale_rows, scale_columns = (sparse.diags(10 ** rng.uniform(-5, 5, k)) for k in (m, n))
    return (scale_rows @ left @ right @ scale_columns).tocsr()


@pytest.mark.parametrize("seed", range(40))
def test_rank_and_free_unknowns_are_those_of_the_singular_values(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, n = (int(k) for k in rng.integers(3, 60, 2))
    matrix = deficient(rng, m, n, int(rng.integers(1, min(m, n) + 1)))
    found = factorise(matrix)
    full = found.row[:, None] * matrix.toarray() * found.column
    _, sizes, rows = np.linalg.svd(full)
    rank = int((sizes > 1e-11 * sizes[0]).sum())
    assert found.rank == rank
    free = np.abs(rows[rank:]).max(axis=0, initial=0.0) > 1e-8
    assert ((found.undetermined > 1e-8) == free).all()
    directions = found.directions(n)
    assert np.linalg.matrix_rank(directions, tol=1e-8) == n - rank
    assert np.abs(full @ directions).max(initial=0.0) < 1e-9 * np.abs(directions).max(initial=1.0)


def test_solution_of_consistent_equations_meets_all_of_them() -> None:
    rng = np.random.default_rng(7)
    matrix = deficient(rng, 80, 70, 50)
    x = rng.standard_normal(70)
    found = factorise(matrix)
    left = matrix @ found.solve(matrix @ x) - matrix @ x
    assert np.abs(left * found.row).max() < 1e-11 * np.abs(x / found.column).max()


@pytest.mark.parametrize(("size", "ratio"), [(1.0, 1.0), (0.01, 0.99), (1e-4, 0.5), (1e-7, 1e-3)])
def test_contradictions_are_relative_to_the_terms_of_their_row(size: float, ratio: float) -> None:
    """Down to a floor of 1e-4 of the largest unknown."""
    found = factorise(sparse.csr_matrix([[1.0, 0.0], [0.0, 1.0]]))
    x = np.array([1.0, size])
    assert found.contradiction(np.array([0.0, size]), x) == pytest.approx([0.0, ratio], rel=0.02)


def test_rows_that_contradict_each_other_are_named() -> None:
    """Rows 0, 2 and 3 are dependent, row 1 has nothing to do with them."""
    matrix = sparse.csr_matrix([[1.0, -1.0, 0, 0], [0, 0, 1.0, -1.0], [0, 1.0, 0, 0], [1.0, 0, 0, 0]])
    found = factorise(matrix)
    (dependent,) = set(range(4)) - set(found.rows.tolist())
    weights = found.combined(dependent) * found.row
    assert np.abs(weights @ matrix.toarray()).max() < 1e-15
    assert (np.abs(weights) > 0.1).tolist() == [True, False, True, True]


def test_pivots_too_small_for_the_elimination_are_told_from_rounding() -> None:
    """A pivot of 1e-9 counts, one of 1e-13 does not."""
    for epsilon, rank in ((1e-9, 2), (1e-13, 1)):
        assert factorise(sparse.csr_matrix([[1.0, 1.0], [1.0, 1.0 + epsilon]])).rank == rank


def test_fully_coupled_equations_go_to_the_dense_part() -> None:
    rng = np.random.default_rng(1)
    full = rng.standard_normal((120, 120))
    full[60:] = rng.standard_normal((60, 30)) @ full[:30]
    assert factorise(sparse.csr_matrix(full)).rank == 60


@pytest.mark.parametrize("seed", range(5))
def test_scales_bring_the_largest_entries_of_rows_and_columns_close_to_one(seed: int) -> None:
    found = factorise(deficient(np.random.default_rng(seed), 30, 20, 15))
    scaled = np.abs(found.row[:, None] * found.matrix.toarray() * found.column)
    for axis in (0, 1):
        largest = scaled.max(axis=axis)
        assert np.abs(np.log2(largest[largest > 0])).max() < 0.2


def test_equations_without_coefficients_determine_nothing() -> None:
    found = factorise(sparse.csr_matrix((2, 3)))
    assert (found.rank, found.open.tolist(), found.solve(np.ones(2)).tolist()) == (0, [0, 1, 2], [0.0, 0.0, 0.0])
    assert found.combined(1).tolist() == [0.0, 1.0]
    assert (found.undetermined > 0.4).all()
    assert factorise(sparse.csr_matrix(np.eye(3))).undetermined.tolist() == [0.0, 0.0, 0.0]
    assert found.contradiction(np.array([0.0, 1.0]), np.zeros(3)).tolist() == [0.0, np.inf]
