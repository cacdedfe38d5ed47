"""Linear equations of blocks that may depend on each other: in any units, of least norm, or refused where they disagree."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.program.derivatives import shares_by_matrix, solve_shared


def answer(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution, which there is."""
    try:
        return solve_shared(matrix, right)
    except np.linalg.LinAlgError:
        pytest.fail("equations that agree are refused")


@pytest.mark.parametrize("seed", range(4))
def test_regular_equations_in_any_units(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 1 + seed
    matrix = np.linalg.qr(rng.normal(size=(n, n)))[0]
    rows, columns = 10.0 ** rng.uniform(-40, 40, (2, n))
    right = rng.normal(size=(n, 2))
    found = answer(rows[:, None] * matrix * columns, rows[:, None] * right)
    np.testing.assert_allclose(found * columns[:, None], matrix.T @ right, rtol=1e-11, atol=1e-13)


def test_equal_elements_share_what_is_undetermined() -> None:
    matrix = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 4.0]])
    np.testing.assert_allclose(answer(matrix, np.array([[6.0], [12.0], [2.0]])), [[3.0], [3.0], [0.5]], rtol=1e-14)
    np.testing.assert_allclose(answer(np.zeros((2, 2)), np.zeros((2, 1))), np.zeros((2, 1)))


@pytest.mark.parametrize("off", [1e-8, -1e-8, 1.0])
def test_equations_that_disagree_are_refused(off: float) -> None:
    matrix = np.array([[1.0, 1.0], [1.0, 1.0]])
    answer(matrix, np.array([[1.0], [1.0 + 1e-3 * 1e-8]]))
    with pytest.raises(np.linalg.LinAlgError):
        solve_shared(matrix, np.array([[1.0], [1.0 + off]]))


@pytest.mark.parametrize(("distance", "determined"), [(1e-11, True), (1e-14, False)])
def test_equations_that_are_almost_the_same(distance: float, determined: bool) -> None:
    """Beyond a condition number of 1e13 they count as one, which the least solution satisfies."""
    found = answer(np.array([[1.0, 1.0], [1.0, 1.0 + distance]]), np.array([[2.0], [2.0 + distance]]))
    np.testing.assert_allclose(found, [[1.0], [1.0]], rtol=1e-4)
    other = answer(np.array([[1.0, 1.0], [1.0, 1.0 + distance]]), np.array([[2.0], [2.0]]))
    np.testing.assert_allclose(other, [[2.0], [0.0]] if determined else [[1.0], [1.0]], atol=1e-4)


def chain(n: int, step: float) -> np.ndarray:
    """Equations between neighbours, regular, but each unknown in units smaller than those of the one before."""
    matrix = 4.0 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)
    return np.asarray(matrix * step ** np.arange(n), float)


@pytest.mark.parametrize("step", [1e-8, 1e8, -1e-5])
def test_units_that_differ_along_a_chain(step: float) -> None:
    """Scaled by their largest entries rows and columns would leave the diagonal negligible."""
    right = np.array([[1.0, -2.0], [0.5, 0.0], [3.0, 1.0], [0.0, 1.0], [2.0, -1.0]])
    plain = np.linalg.solve(chain(5, 1.0), right)
    found = answer(chain(5, step), right)
    np.testing.assert_allclose(found * step ** np.arange(5)[:, None], plain, rtol=1e-12, atol=1e-13)
    turned = answer(chain(5, step).T, right * step ** np.arange(5)[:, None])
    np.testing.assert_allclose(turned, plain, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_equal_elements_share_in_any_units(seed: int) -> None:
    """As the one above, in units of their own."""
    rows, columns = 10.0 ** np.random.default_rng(seed).uniform(-20, 20, (2, 3))
    matrix = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 4.0]])
    found = answer(rows[:, None] * matrix * columns, rows[:, None] * np.array([[6.0], [12.0], [2.0]]))
    np.testing.assert_allclose(found * columns[:, None], [[3.0], [3.0], [0.5]], rtol=1e-12)


@pytest.mark.parametrize(("distance", "determined"), [(1e-12, True), (5e-13, True), (3e-13, False), (1e-13, False)])
def test_the_condition_number_from_which_equations_count_as_one(distance: float, determined: bool) -> None:
    """1e13, which is 4 over the distance."""
    found = answer(np.array([[1.0, 1.0], [1.0, 1.0 + distance]]), np.array([[2.0], [2.0]]))
    np.testing.assert_allclose(found, [[2.0], [0.0]] if determined else [[1.0], [1.0]], atol=1e-9)


def test_what_nothing_moves_rests() -> None:
    for matrix in (np.zeros((1, 1)), np.ones((3, 3)), np.diag([1.0, 0.0]), np.eye(2)):
        assert answer(matrix, np.zeros((len(matrix), 2))).tolist() == np.zeros((len(matrix), 2)).tolist()


def test_compliances_tell_the_shares_and_the_transpose_is_one() -> None:
    """Two locked elements on one body, the second with a compliance of 4, so that it has a fifth of the torque; a third alone."""
    matrix = np.array([[1.0, 1.0, 0.0, 2.0], [1e-27, 0.0, 0.0, 1.0], [0.0, 4e-27, 0.0, 1.0], [0.0, 0.0, 2.0, 1.0]])
    sides = np.array([[10.0, 1.0], [0.0, 0.0], [0.0, 0.0], [0.0, 3.0]])
    np.testing.assert_allclose(answer(matrix, sides), [[8.0, 0.8], [2.0, 0.2], [0.0, 1.5], [0.0, 0.0]], atol=1e-12)
    back = solve_shared(matrix, np.eye(4), transposed=True)
    np.testing.assert_allclose(back.T @ sides, answer(matrix, sides), atol=1e-12)


def test_the_transpose_for_what_is_left_open_is_refused() -> None:
    matrix = np.array([[1.0, 1.0], [1.0, 1.0]])
    np.testing.assert_allclose(solve_shared(matrix, np.array([[2.0], [2.0]]), transposed=True).sum(), 2.0)
    with pytest.raises(np.linalg.LinAlgError):
        solve_shared(matrix, np.array([[1.0], [0.0]]), transposed=True)


@pytest.mark.parametrize("entry", [0, 1, 2, 3])
def test_shares_follow_the_matrix(entry: int) -> None:
    """By central differences: a ratio, which stands in two rows; a compliance; its unit; the largest entry of a column."""

    def matrix(by: float) -> np.ndarray:
        c = np.array([3.0, 1.0, 1.0, 2.0])
        c[entry] += by
        return np.array([[1.0, c[3], c[0], 2.0], [c[1] * 1e-27, 0.0, 0.0, c[2]], [0, 4e-27, 0, c[3]], [0, 0, 2e-27, c[0]]])

    side, step = np.array([[10.0], [0.0], [0.0], [0.0]]), 1e-4
    found = answer(matrix(0.0), side)
    found[3] = 0.0  # at rest, up to rounding
    expected = (answer(matrix(step), side) - answer(matrix(-step), side)) / (2.0 * step)
    change = (matrix(step) - matrix(-step)) / (2.0 * step)
    shares = shares_by_matrix(matrix(0.0), found[:, 0])
    assert shares is not None
    moved = shares.times(change[:, :, None]) - answer(matrix(0.0), np.where(change > 0.5, change, 0.0) @ found)
    np.testing.assert_allclose(moved, expected, rtol=1e-6, atol=1e-9)
    weights = np.array([[1.0], [-2.0], [3.0], [0.5]])
    back = shares.transposed(weights)
    np.testing.assert_allclose((back[:, :, 0] * change).sum(), (weights * shares.times(change[:, :, None])).sum(), rtol=1e-9)


def test_only_what_compliances_tell_follows_the_matrix() -> None:
    assert shares_by_matrix(np.eye(3), np.ones(3)) is None
    assert shares_by_matrix(np.ones((2, 2)), np.ones(2)) is None
