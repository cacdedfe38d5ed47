"""Sparse elimination: the order of its pivots, scales that begin with known sizes, and solutions."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from gearlib.structure.sparse_elimination import factorise, independent


@pytest.mark.parametrize(("safe", "exchange"), [(1e-3, 0.1), (1e-9, 1e-9), (1e-3, 0.8)])
@pytest.mark.parametrize("seed", range(6))
def test_each_pivot_is_in_a_shortest_row_and_in_the_emptiest_column_of_its_large_entries(
    seed: int, safe: float, exchange: float
) -> None:
    """What is left of the matrix before each step, by dense elimination with the pivots that were chosen."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 12))
    left = rng.uniform(0.5, 1.5, (n, n + 2)) * rng.choice([1.0, -1.0, 0.3], (n, n + 2)) * (rng.random((n, n + 2)) < 0.35)
    left[np.arange(n), rng.permutation(n)] = 1.0
    rows, columns = independent(sparse.csr_matrix(left), safe, exchange)
    assert len(rows) == len(set(rows.tolist())) == len(set(columns.tolist())) == np.linalg.matrix_rank(left)
    open_rows = set(range(n))
    for r, c in zip(rows.tolist(), columns.tolist(), strict=True):
        lengths = {i: np.count_nonzero(left[i]) for i in open_rows if left[i].any()}
        assert (lengths[r], r) == min((length, i) for i, length in lengths.items())
        users = np.count_nonzero(left[sorted(open_rows)], axis=0)
        large = np.abs(left[r]) >= exchange * np.abs(left[r]).max() * (1 - 1e-12)
        assert large[c]
        assert users[c] == users[large & (left[r] != 0)].min()
        open_rows.remove(r)
        for i in open_rows:
            factor = left[i, c] / left[r, c]
            left[i] -= factor * left[r]
            left[i, c] = 0.0
            left[i][np.abs(left[i]) < 1e-13] = 0.0


@pytest.mark.parametrize(("smallest", "first"), [(0.11, 1), (0.09, 0)])
def test_an_entry_is_large_enough_from_a_tenth_of_its_rows_largest_on(smallest: float, first: int) -> None:
    """Column 1 would fill in nothing."""
    rows, columns = independent(sparse.csr_matrix([[1.0, smallest], [1.0, 0.0], [1.0, 0.0]]))
    assert dict(zip(rows.tolist(), columns.tolist(), strict=True))[0 if first else 1] == (1 if first else 0)


@pytest.mark.parametrize(("more", "order"), [(0.0, [0, 2, 1]), (2e-15, [0, 2, 1]), (-2e-15, [0, 2, 1]), (1e-13, [0, 1, 2])])
@pytest.mark.parametrize("factor", [7.0, 8.0])
def test_what_rounding_leaves_of_a_difference_is_no_entry(more: float, order: list[int], factor: float) -> None:
    """Row 2 without a multiple of row 0 is a row of one entry, and comes before one of two; 0.7 / 0.1 is not 7 to the last bit."""
    last = [factor / 10, factor / 10 * 3 * (1 + more), 1.0, 0.0]
    rows, columns = independent(sparse.csr_matrix([[0.1, 0.3, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], last]))
    assert rows.tolist() == order
    assert dict(zip(rows.tolist(), columns.tolist(), strict=True))[1] == 3


def test_rows_that_fill_in_too_much_are_left_to_the_dense_remainder() -> None:
    """Every pivot of 22 full rows would fill in 21 * 21 entries; of 21 rows, 20 * 20."""
    rng = np.random.default_rng(4)
    for n in (20, 21, 22, 23):
        rows, columns = independent(sparse.csr_matrix(rng.uniform(0.5, 1.5, (n, n))))
        assert sorted(rows.tolist()) == sorted(columns.tolist()) == list(range(n))
        assert (rows.tolist() == list(range(n))) == (n <= 21), "the elimination takes them in order, the remainder by size"


def test_known_sizes_of_unknowns_are_their_scales() -> None:
    """Where the equations leave it open; an unknown of no known size is scaled by its equation."""
    found = factorise(sparse.diags([4.0, -5.0, 0.25]), np.array([10.0, np.nan, 100.0]))
    assert found.column == pytest.approx([10.0, 0.2, 100.0])
    assert found.row == pytest.approx([1 / 40, 1.0, 1 / 25])
    plain = factorise(sparse.diags([4.0, -5.0, 0.25]))
    assert plain.row * np.array([4.0, 5.0, 0.25]) * plain.column == pytest.approx([1.0, 1.0, 1.0], rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_scales_that_begin_with_sizes_end_as_close_to_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = sparse.random(20, 25, 0.2, random_state=rng, data_rvs=rng.standard_normal).tocsr()
    sizes = np.where(rng.random(25) < 0.5, np.nan, 10 ** rng.uniform(-8, 8, 25))
    found = factorise(matrix, sizes)
    scaled = np.abs(found.row[:, None] * matrix.toarray() * found.column)
    for axis in (0, 1):
        largest = scaled.max(axis=axis)
        assert np.abs(np.log2(largest[largest > 0])).max() < 0.2


@pytest.mark.parametrize(("entry", "rank"), [(1e-25, 2), (1e-35, 1)])
def test_what_is_negligible_by_known_sizes_scales_nothing(entry: float, rank: int) -> None:
    """An entry alone in its column, which rounding has left there; without sizes it would be scaled to 1."""
    matrix = sparse.csr_matrix([[1.0, entry], [1.0, 0.0]])
    found = factorise(matrix, np.array([1.0, 1.0]))
    assert found.rank == rank
    if rank == 1:
        assert found.column == pytest.approx([1.0, 1.0])
        assert found.row == pytest.approx([1.0, 1.0])
    assert factorise(matrix).rank == 2


@pytest.mark.parametrize("seed", range(4))
def test_solutions_weights_and_directions_by_dense_algebra(seed: int) -> None:
    """With 12 equations of rank 6 for 9 unknowns of different sizes."""
    rng = np.random.default_rng(seed)
    full = rng.normal(size=(12, 6)) @ rng.normal(size=(6, 9)) * 10.0 ** rng.uniform(-2, 2, 9)
    found = factorise(sparse.csr_matrix(full))
    assert (found.rank, len(found.open)) == (6, 3)
    assert sorted([*found.open.tolist(), *found.columns.tolist()]) == list(range(9))
    square = full[np.ix_(found.rows, found.columns)]
    rhs = full @ rng.normal(size=9)
    x = found.solve(rhs)
    assert (x[found.open] == 0.0).all()
    assert x[found.columns] == pytest.approx(np.linalg.solve(square, rhs[found.rows]), rel=1e-8)
    size = np.abs(x / found.column).max()
    residual = rng.normal(size=12)
    terms = np.abs(found.row[:, None] * full) @ np.abs(x) + 1e-4 * size
    assert found.contradiction(residual, x) == pytest.approx(np.abs(residual * found.row) / terms, rel=1e-12)
    for row in set(range(12)) - set(found.rows.tolist()):
        weights = found.combined(row)
        assert weights[row] == 1.0
        others = [r for r in range(12) if r not in found.rows and r != row]
        assert (weights[others] == 0.0).all()
        assert weights * found.row @ full == pytest.approx(np.zeros(9), abs=1e-10)
    directions = found.directions(4)
    assert directions.shape == (9, 4)
    assert ((directions[found.open] >= 0.5) & (directions[found.open] <= 1.5)).all()
    assert full @ (found.column[:, None] * directions) == pytest.approx(np.zeros((12, 4)), abs=1e-9)
    assert found.undetermined == pytest.approx(np.abs(found.directions(3)).max(axis=1))


def test_there_may_be_no_equations_and_no_unknowns() -> None:
    none = factorise(sparse.csr_matrix((0, 2)))
    assert (none.rank, none.open.tolist(), none.solve(np.zeros(0)).tolist()) == (0, [0, 1], [0.0, 0.0])
    nothing = factorise(sparse.csr_matrix((2, 0)))
    assert (nothing.rank, nothing.open.tolist(), nothing.undetermined.tolist()) == (0, [], [])


def test_an_unknown_of_no_known_size_is_scaled_beside_those_of_known_ones() -> None:
    """Of 2 x + 4 y, where x is about 10, y is about 5."""
    found = factorise(sparse.csr_matrix([[2.0, 4.0]]), np.array([10.0, np.nan]))
    assert found.row == pytest.approx([1 / 20], rel=1e-12)
    assert found.column == pytest.approx([10.0, 5.0], rel=1e-12)


@pytest.mark.parametrize(("difference", "rank"), [(1e-7, 2), (1e-9, 1)])
def test_rows_of_the_dense_remainder_are_dependent_relative_to_its_largest(difference: float, rank: int) -> None:
    """Where it is larger than 1: here all is left to it, since no pivot is large enough."""
    rows, columns = independent(sparse.csr_matrix([[1e3, 1e3], [1e3, 1e3 + difference]]), safe=1e9)
    assert (len(rows), len(columns)) == (rank, rank)


@pytest.mark.parametrize(
    ("matrix", "sizes"),
    [
        ([[1e-20, 1e-28], [1.0, 0.0]], [1.0, 1.0]),
        ([[1e20, 1e-8], [1.0, 0.0]], [1.0, 1e20]),
        ([[1.0, 1e-8], [1.0, 0.0]], [1.0, 1.0]),
    ],
)
def test_small_terms_of_known_sizes_are_scaled_whatever_the_units(matrix: list[list[float]], sizes: list[float]) -> None:
    """The second unknown has a share of 1e-8 in the first equation; nothing else scales it."""
    found = factorise(sparse.csr_matrix(matrix), np.array(sizes))
    scaled = np.abs(np.array(matrix) * found.row[:, None] * found.column)
    assert scaled.max(axis=0) == pytest.approx([1.0, 1.0], abs=0.5)
    assert scaled.max(axis=1) == pytest.approx([1.0, 1.0], abs=0.5)
