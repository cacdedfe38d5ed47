"""Balanced matrices: couplings that act one way only hide no slow pole."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.linear.balancing import balance
from gearlib.linear.poles import poles


@pytest.mark.parametrize("seed", [*range(20), 1322])
def test_poles_of_block_triangular_matrices_are_those_of_their_blocks(seed: int) -> None:
    random = np.random.default_rng(seed)
    sizes = random.integers(1, 4, 4)
    A, rates = np.zeros((sizes.sum(), sizes.sum())), 10.0 ** random.uniform(-1, 4, len(sizes))
    right: list[complex] = []
    ends = np.cumsum(sizes)
    for begin, end, rate in zip(ends - sizes, ends, rates, strict=True):
        block = random.normal(size=(end - begin, end - begin)) - 3 * np.eye(end - begin)
        A[begin:end, begin:end] = rate * block
        A[begin:end, :begin] = 10.0 ** random.uniform(3, 14) * random.normal(size=(end - begin, begin))  # rates of other units
        right += (rate * np.linalg.eigvals(block)).tolist()
    order = random.permutation(len(A))
    found = poles(A[np.ix_(order, order)]).values
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(np.array(right)), rel=1e-8)


def test_a_balanced_matrix_is_similar() -> None:
    A = np.array([[-2.0, 1e3, 0.0], [-1.0, 0.0, 0.0], [1e9, 5.0, -0.3]])
    balanced, scale = balance(A)
    assert scale[:, None] * balanced / scale == pytest.approx(A, rel=1e-14)
