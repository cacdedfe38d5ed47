"""Deviations of matrix exponentials from the identity, against SciPy's exponential and against mpmath's digits."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.solvers.exponential.dense import (
    Propagator,
    balanced_norm,
    deviation,
    double,
    doublings_for,
    estimate,
    product,
)


def matrix(n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, n))


@pytest.mark.parametrize("h", [0.0, 1e-12, 0.01, 0.3, 1.7, -0.9])
@pytest.mark.parametrize("n", [1, 2, 5, 70])
def test_deviation_is_that_of_scipys_exponential(n: int, h: float) -> None:
    A = matrix(n, n) / math.sqrt(n)
    found, expected = deviation(A, h), expm(A * h) - np.eye(n)
    assert found == pytest.approx(expected, abs=1e-14 * max(1.0, np.abs(expected).max()))
    if abs(h) < 1e-9:
        assert found == pytest.approx(A * h + (A * h) @ (A * h) / 2, rel=1e-14, abs=0.0)


def test_slow_motion_beside_a_fast_one_keeps_its_digits() -> None:
    """Rates of 1e8 and 1e-8 over a second, coupled: each entry to its own digits."""
    A = np.array([[-1e8, 1e-3, 0.0], [0.0, -1e-8, 2.0], [0.0, 0.0, 0.0]])
    with mp.workdps(60):
        exact = mp.expm(mp.matrix(A.tolist()), method="pade") - mp.eye(3)
        expected = np.array(exact.tolist(), float)
    assert deviation(A, 1.0) == pytest.approx(expected, rel=1e-13, abs=0.0)


@pytest.mark.parametrize("h", [0.2, 3.0])
@pytest.mark.parametrize("directions", [1, 3])
def test_a_stack_is_the_exponential_of_the_block_triangular_matrix(directions: int, h: float) -> None:
    n = 4
    A, changes = matrix(n, 1), [matrix(n, 2 + k) for k in range(directions)]
    found = deviation(np.array([A, *changes]), h)
    assert found[0] == pytest.approx(expm(A * h) - np.eye(n), rel=1e-12, abs=1e-12)
    for own, change in zip(found[1:], changes, strict=True):
        whole = expm(np.block([[A, np.zeros((n, n))], [change, A]]) * h)
        assert own == pytest.approx(whole[n:, :n], rel=1e-12, abs=1e-11)
    assert double(deviation(np.array([A, *changes]), h / 2)) == pytest.approx(found, rel=1e-11, abs=1e-11)


def test_products_of_stacks_obey_the_product_rule() -> None:
    a, b = np.array([matrix(3, 1), matrix(3, 2)]), np.array([matrix(3, 3), matrix(3, 4)])
    found = product(a, b)
    assert found[0] == pytest.approx(a[0] @ b[0], rel=1e-14)
    assert found[1] == pytest.approx(a[1] @ b[0] + a[0] @ b[1], rel=1e-13)
    assert product(a[0], b[0]) == pytest.approx(a[0] @ b[0], rel=1e-14)


def test_norm_does_not_depend_on_units() -> None:
    """Scaled by powers of two, a spring and an inertia are two numbers of the same size."""
    assert balanced_norm(np.array([[0.0, 2.0**20], [-(2.0**-20), 0.0]])) == 1.0
    assert balanced_norm(np.array([[3.0, 0.0], [0.0, -5.0]])) == 5.0
    assert balanced_norm(np.array([[1.0, 1.0], [0.0, 0.0]])) <= 1.5  # the smaller of the row and column sums at most


@pytest.mark.parametrize("n", [1, 10, 40, 200])
def test_blocks_of_steps_grow_with_their_number(n: int) -> None:
    """No more steps in a block than there are, one by one for a single step, and more for more; 4096 at most."""
    found = [doublings_for(count, n) for count in (1, 2, 3, 10, 100, 1000, 10**5, 10**8)]
    assert found == sorted(found)
    assert all(2**k <= count for k, count in zip(found, (1, 2, 3, 10, 100, 1000, 10**5, 10**8), strict=True))
    assert found[-1] == 12
    assert doublings_for(1000, 10) > doublings_for(1000, 200)  # a product of large matrices costs more


def test_estimates_grow_with_what_is_done() -> None:
    """Each length of step takes an exponential, whose doublings grow with its angle; and each step a product with a vector."""
    one = estimate(20, [1.0], 10)
    assert estimate(20, [1.0, 1.0], 10) - one == pytest.approx(one - estimate(20, [], 10), rel=1e-12)
    fast = [estimate(20, [2.0**k], 10) for k in range(20)]
    assert np.diff(fast) == pytest.approx(np.full(19, fast[1] - fast[0]), rel=1e-9)  # one product for each doubling
    assert 4.0 < (one - estimate(20, [], 10)) / (fast[1] - fast[0]) < 10.0  # beside those of the series
    assert estimate(20, [0.0], 10) == estimate(20, [0.1], 10)  # no doubling
    assert estimate(20, [1.0], 2010) - one == pytest.approx(estimate(20, [], 2000), rel=1e-9)
    assert estimate(400, [1.0], 10) / estimate(200, [1.0], 10) == pytest.approx(8.0, rel=0.2)  # as the cube of the states
    assert 1e-6 < estimate(1, [1.0], 1) < 1e-3  # s


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 65])
@pytest.mark.parametrize("directions", [0, 2])
def test_steps_are_powers_of_the_exponential(count: int, directions: int) -> None:
    n, h = 3, 0.2
    A, changes = matrix(n, 5) - 2 * np.eye(n), [matrix(n, 6 + k) for k in range(directions)]
    z = matrix(n, 9)[0] if not directions else np.array([matrix(n, 9)[k] for k in range(1 + directions)])
    propagator = Propagator(A if not directions else np.array([A, *changes]), h)
    found = propagator.advance(z, count)
    assert found.shape == (count, *z.shape)
    states = z if not directions else z[0]
    for k in range(count):
        E = expm(A * h * (k + 1))
        assert (found[k] if not directions else found[k, 0]) == pytest.approx(E @ states, rel=1e-11, abs=1e-13)
        for i, change in enumerate(changes, 1):
            whole = expm(np.block([[A, np.zeros((n, n))], [change, A]]) * h * (k + 1))
            assert found[k, i] == pytest.approx(whole[n:] @ np.concatenate([states, z[i]]), rel=1e-10, abs=1e-12)
    assert propagator.advance(z, count) == pytest.approx(found, rel=0.0, abs=0.0)
