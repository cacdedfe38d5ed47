"""Balanced matrices: couplings that act one way only hide no slow pole."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from gearlib.linear.balancing import balance, similarity
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


@pytest.mark.parametrize("seed", range(4))
def test_a_conservative_system_becomes_skew(seed: int) -> None:
    """Two trains of their own, with states of any units and a decay each; the scales are free but for one factor in each."""
    random = np.random.default_rng(seed)
    sizes = (7, 4)
    skew, first = np.zeros((11, 11)), 0
    for n in sizes:
        block = np.triu(random.normal(size=(n, n)) * (random.random((n, n)) < 0.4), 1)
        block += np.diag(random.uniform(0.5, 2.0, n - 1), 1)  # all of them are joined
        skew[first : first + n, first : first + n] = block - block.T
        first += n
    units = 10.0 ** random.uniform(-3, 3, 11)
    A = (skew - np.diag(random.uniform(0.0, 9.0, 11))) * units[:, None] / units
    order = random.permutation(11)
    for given in (A[np.ix_(order, order)], sparse.csr_matrix(A[np.ix_(order, order)])):
        scale = similarity(given)
        full = A[np.ix_(order, order)] * scale / scale[:, None]
        assert abs(full) == pytest.approx(abs(full).T, rel=1e-6)
        assert full == pytest.approx((skew - np.diag(np.diag(-A)))[np.ix_(order, order)], rel=1e-6, abs=1e-12)
        assert np.log(scale).mean() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("n", [3, 4])
def test_couplings_one_way_round_become_equal(n: int) -> None:
    """Of a ring; two states that hang on it one way keep their scales, and two that are not coupled at all do no harm."""
    sizes = 10.0 ** np.linspace(-2, 3, n)
    A = np.zeros((n + 4, n + 4))
    for k in range(n):
        A[k, (k + 1) % n] = sizes[k]
    ring = similarity(A)
    assert similarity(1e-7 * A) == pytest.approx(ring, rel=1e-12)
    scaled = (A * ring / ring[:, None])[:n, :n]
    assert scaled[scaled > 0] == pytest.approx(np.exp(np.log(sizes).mean()), rel=1e-2)
    A[n, 0] = A[1, n + 1] = 1e-3
    scale = similarity(A)
    assert scale[n:] == pytest.approx(scale[-1])
    assert (scale[:n] / scale[0]) == pytest.approx(ring[:n] / ring[0], rel=0.05)
