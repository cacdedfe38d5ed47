"""Signed union-find against the same equalities solved as linear equations."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gearlib.flatten.aliases import unite


def integers(values: list[int]) -> np.ndarray:
    return np.array(values, np.int64)


def test_signs_multiply_along_a_chain() -> None:
    a = unite(4, integers([0, 1, 2]), integers([1, 2, 3]), integers([-1, -1, -1]), integers([0, 1, 1, 1]))
    assert a.representative.tolist() == [0, 0, 0, 0]
    assert a.sign.tolist() == [1, -1, 1, -1]
    assert a.sign.dtype == np.int64
    assert a.redundant == 0


def test_rank_then_number_choose_the_representative() -> None:
    a = unite(3, integers([0, 1]), integers([1, 2]), integers([1, 1]), integers([1, 1, 0]))
    assert a.representative.tolist() == [2, 2, 2]
    a = unite(3, integers([2, 1]), integers([1, 0]), integers([1, 1]), integers([1, 1, 1]))
    assert a.representative.tolist() == [0, 0, 0]


def test_zero_and_contradictory_signs() -> None:
    # x0 = 0, x1 = x2 and x1 = -x2 (so both vanish), x3 free, x1 = x2 once more says nothing new
    a = unite(4, integers([0, 1, 1, 1]), integers([-1, 2, 2, 2]), integers([0, 1, -1, 1]), np.zeros(4, np.int64))
    assert a.sign.tolist() == [0, 0, 0, 1]
    assert a.redundant == 1


@given(st.data())
def test_equals_the_null_space_of_the_equalities(data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 8))
    node = st.integers(0, n - 1)
    links = data.draw(st.lists(st.tuples(node, st.integers(-1, n - 1), st.sampled_from([-1, 1])), max_size=12))
    links = [(a, b, s) for a, b, s in links if a != b]
    left, right, sign = (integers([link[i] for link in links]) for i in range(3))
    found = unite(n, left, right, sign, np.zeros(n, np.int64))
    matrix = np.zeros((len(links), n))
    for row, (a, b, s) in zip(matrix, links, strict=True):
        row[a] += 1
        if b >= 0:
            row[b] -= s
    rank = np.linalg.matrix_rank(matrix) if len(links) else 0
    assert found.redundant == len(links) - rank
    free = {int(r) for r, s in zip(found.representative, found.sign, strict=True) if s}
    assert len(free) == n - rank
    values = dict(zip(free, np.random.default_rng(0).normal(size=len(free)), strict=True))
    x = np.array([s * values.get(int(r), 0.0) for r, s in zip(found.representative, found.sign, strict=True)])
    assert np.allclose(matrix @ x, 0)
