"""The order of an elimination, against SuperLU's factors and dense matrices."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from gearlib.structure.elimination_order import EliminationOrder, elimination_order


def pattern(seed: int) -> tuple[int, np.ndarray]:
    """Places with a perfect matching, in any order and some of them twice."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 30))
    places = np.concatenate([np.arange(n) * n + rng.permutation(n), rng.integers(0, n * n, 2 * n)])
    return n, rng.permutation(places)


@pytest.mark.parametrize("seed", range(10))
def test_entries_are_found_by_place_and_columns_by_where_they_start(seed: int) -> None:
    n, targets = pattern(seed)
    found = elimination_order(n, targets)
    assert sorted(found.places.tolist()) == sorted(set(targets.tolist()))
    numbers = {place: k for k, place in enumerate(found.places.tolist())}
    assert found.entries(targets).tolist() == [numbers[place] for place in targets.tolist()]
    assert found.starts.tolist() == [int((found.places % n < c).sum()) for c in range(n + 1)]
    columns = [(found.places[a:b] % n).tolist() for a, b in zip(found.starts[:-1], found.starts[1:], strict=True)]
    assert columns == [[c] * len(column) for c, column in enumerate(columns)]
    dense = np.zeros((n, n))
    dense.flat[found.places] = values = np.arange(1.0, len(found.places) + 1)
    assert (found.matrix(values).toarray() == dense).all()


@pytest.mark.parametrize("seed", range(10))
def test_pivots_are_where_they_are_said_to_be_and_fill_in_as_much(seed: int) -> None:
    n, targets = pattern(seed)
    found = elimination_order(n, targets)
    assert sorted(found.rows.tolist()) == sorted(found.columns.tolist()) == list(range(n))
    values = np.random.default_rng(seed).uniform(0.5, 1.5, len(found.places))
    sorted_ = found.matrix(values)[found.rows][:, found.columns].tocsc()
    factors = splu(sorted_, permc_spec="NATURAL", diag_pivot_thresh=0.0)
    assert (factors.perm_r == np.arange(n)).all(), "no row is exchanged for generic numbers"
    assert max(factors.L.nnz, factors.U.nnz) == found.fill


def test_fill_of_a_triangle_is_that_of_the_triangle() -> None:
    n = 12
    rows, columns = np.tril_indices(n)
    order: EliminationOrder = elimination_order(n, columns * n + rows)
    assert order.fill == n * (n + 1) // 2
