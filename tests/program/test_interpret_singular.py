"""Linear equations whose matrix varies, at points where it is singular: which solution is taken, and what is refused."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import gearlib as gl
from gearlib.errors import SolverError
from gearlib.program.interpret import evaluate
from gearlib.program.program import Newton

Floats = NDArray[np.float64]
N = 4


def _equations(self: Any) -> list[gl.Eq]:
    z = [getattr(self, f"z{j}") for j in range(N)]
    rows = [sum(getattr(self, f"a{i}{j}") * z[j] for j in range(N)) for i in range(N)]
    return [
        gl.Eq(gl.der(self.x), self.rate * sum(z)),
        *(gl.Eq(self.x * row, getattr(self, f"r{i}")) for i, row in enumerate(rows)),
    ]


@cache
def varying() -> Any:
    """``x A z = r`` with any A and r."""
    names: dict[str, Any] = {f"z{j}": gl.Variable("1") for j in range(N)} | {"x": gl.Variable("1")}
    names |= {f"a{i}{j}": gl.Parameter("1", default=float(i == j)) for i in range(N) for j in range(N)}
    names |= {f"r{i}": gl.Parameter("1", default=0.0) for i in range(N)} | {"rate": gl.Parameter("1/s", default=1.0)}
    return gl.compile(type("Varying", (gl.Component,), names | {"equations": _equations})()).translation


def numbers(matrix: Any, right: Any) -> Any:
    table, index = varying().model.parameters.values.copy(), varying().model.parameters.index
    table[[index[f"a{i}{j}"] for i in range(N) for j in range(N)]] = np.ravel(matrix)
    table[[index[f"r{i}"] for i in range(N)]] = right
    return varying().scene.numbers(table)


def solution(matrix: Any, right: Any, x: tuple[float, ...] = (1.0,), guess: Any = None) -> Floats:
    """z at some x, shape (unknowns, times); the guess may have a time for each."""
    scene, none = varying().scene, np.empty((0, len(x)))
    (step,) = (s for s in scene.program.steps if isinstance(s, Newton))
    assert (step.linear, len(step.unknowns)) == (True, N)
    slots = evaluate(numbers(matrix, right), np.arange(len(x), dtype=float), np.array([x]), none, none, guess)
    return np.asarray(slots[[scene.program.slots[scene.model.variable(f"z{j}"), 0] for j in range(N)]], float)


def smallest(matrix: Floats, right: Floats, weights: Floats) -> Floats:
    """The solution of independent rows whose weighted sum of squares is least."""
    across = matrix / weights
    return np.asarray(across.T @ np.linalg.solve(across @ matrix.T, right), float)


@pytest.mark.parametrize("x", [(1.0,), (0.5, 1.0, -4.0)], ids=["alone", "among others"])
@pytest.mark.parametrize("decades", [0, 20])
@pytest.mark.parametrize("rank", [1, 2, 3])
def test_of_many_solutions_the_smallest_is_taken(rank: int, decades: int, x: tuple[float, ...]) -> None:
    """In any units of the equations."""
    rng = np.random.default_rng(rank)
    rows, mixed = rng.normal(size=(rank, N)), rng.normal(size=(N, rank))
    units, right = 10.0 ** rng.uniform(-decades, decades, N), rng.normal(size=rank)
    found = solution(units[:, None] * (mixed @ rows), units * (mixed @ right), x)
    expected = smallest(rows, right, np.ones(N))
    np.testing.assert_allclose(found, expected[:, None] / np.array(x), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("give", [1e-25, -3e-21])
@pytest.mark.parametrize("soft", [[2], [3], [0, 2], [1, 2, 3]], ids=str)
def test_unknowns_with_a_compliance_are_as_small_as_can_be(soft: list[int], give: float, size: float) -> None:
    """Before any others: these are counted so little that they do not change the sum. In any unit of each unknown."""
    rng = np.random.default_rng(len(soft))
    rows, mixed = rng.normal(size=(2, N)), np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [2.0, 0.0]])
    rows[1, soft] = 0.0
    right = rng.normal(size=2)
    matrix = mixed @ rows
    matrix[1, soft] = give * np.abs(matrix[1]).max()
    weights = np.full(N, 1e-9)
    weights[soft] = np.abs(matrix[:, soft]).max(axis=0)
    found = solution(1e3 * matrix, 1e3 * size * mixed @ right)[:, 0]
    np.testing.assert_allclose(found / size, smallest(rows, right, weights), rtol=1e-6, atol=1e-8)


def test_a_share_of_a_row_above_compliances_is_an_entry_like_others() -> None:
    """1e-19 of the largest entry counts: the unknown that it multiplies is not said to be small."""
    matrix = np.array([[1.0, 1.0, 1.0, 0.0], [2.0, 2.0, 2.0, 0.0], [0.0, 0.0, 1e-19, 1.0], [0.0, 0.0, 1.0, 1.0]])
    plain = smallest(
        np.array([[1.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]), np.array([3.0, 2.0, 4.0]), np.ones(N)
    )
    np.testing.assert_allclose(solution(matrix, [3.0, 6.0, 2.0, 4.0])[:, 0], plain, rtol=1e-9)


def pair(off: float, distance: float = 0.0, unit: float = 1.0) -> tuple[Floats, list[float]]:
    """Two equations that are the same but for the distance, whose right-hand sides are not; and two others."""
    matrix = np.eye(N)
    matrix[:2, :2] = [[1.0, 1.0], [unit, unit * (1.0 + distance)]]
    return matrix, [1.0, unit * (1.0 + off), 3.0, -2.0]


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize(
    ("off", "right"), [(0.0, True), (1e-13, True), (1e-11, True), (3e-10, True), (1e-8, False), (1.0, False)]
)
def test_equations_that_disagree_by_more_than_rounding_are_refused(off: float, right: bool, unit: float) -> None:
    """By a billionth of the largest right-hand side in units of the equations, which is 3 here."""
    if right:
        np.testing.assert_allclose(solution(*pair(off, unit=unit))[:, 0], [0.5, 0.5, 3.0, -2.0], atol=1e-9)
        return
    text = (
        r"^the equations (Varying: [^;]* = r\d; ){3}Varying: [^;]* = r\d have no solution at t = 0 s: they depend on each other"
    )
    with pytest.raises(SolverError, match=text):
        solution(*pair(off, unit=unit))


def test_a_difference_above_rounding_decides() -> None:
    """z1 times 1e-14 is 1e-11: large, but what the equations say. Below rounding, the smallest solution is taken."""
    distance = (1.0 + 1e-14) - 1.0
    matrix, right = pair(1e-11, distance)
    one, other = solution(matrix, right)[:2, 0]
    assert other == pytest.approx(1e-11 / distance, rel=1e-3)
    assert one + other == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(solution(*pair(1e-14, distance))[:, 0], [0.5, 0.5, 3.0, -2.0], atol=1e-12)


@pytest.mark.parametrize("row", range(N))
def test_an_equation_without_unknowns_holds_or_does_not(row: int) -> None:
    """0 = 0 leaves an unknown open, which is zero then; 0 = 1 is refused, and be it ever so small."""
    matrix, right = np.diag([1.0, 2.0, 4.0, 8.0]), np.ones(N)
    matrix[row] = right[row] = 0.0
    expected = [1.0, 0.5, 0.25, 0.125]
    expected[row] = 0.0
    assert solution(matrix, right)[:, 0].tolist() == expected
    for wrong in (1.0, 1e-6):
        right[row] = wrong
        with pytest.raises(SolverError, match="have no solution at t = 0 s"):
            solution(matrix, right)


def test_equations_with_numbers_that_are_none_are_refused() -> None:
    matrix = np.diag([1.0, 2.0, 4.0, 0.0])
    for wrong in (np.nan, np.inf):
        bad = matrix.copy()
        bad[1, 1] = wrong
        with pytest.raises(SolverError, match="at t = 0 s"):
            solution(bad, [1.0, 1.0, 1.0, 0.0])
        with pytest.raises(SolverError, match="at t = 0 s"):
            solution(matrix, [1.0, wrong, 1.0, 0.0])


@pytest.mark.parametrize("x", [(1.0,), (0.5, -2.0)], ids=["alone", "together"])
@pytest.mark.parametrize("seed", range(3))
def test_regular_equations_in_any_units(seed: int, x: tuple[float, ...]) -> None:
    """Of the equations and of the unknowns."""
    rng = np.random.default_rng(seed)
    turned, right = np.linalg.qr(rng.normal(size=(N, N)))[0], rng.normal(size=N)
    rows, columns = 10.0 ** rng.uniform(-25, 25, (2, N))
    found = solution(rows[:, None] * turned * columns, rows * right, x)
    np.testing.assert_allclose(found * columns[:, None], (turned.T @ right)[:, None] / np.array(x), rtol=1e-10, atol=1e-12)


def test_only_compliances_tell_which_unknowns_shall_be_small() -> None:
    """An equation in which an unknown does not occur says nothing about it."""
    matrix = np.array([[1.0, 1.0, 1.0, 0.0], [2.0, 2.0, 2.0, 0.0], [0.0, 0.0, 1e-25, 1.0], [0.0, 0.0, 0.0, 3.0]])
    np.testing.assert_allclose(solution(matrix, [1.0, 2.0, 2.0, 6.0])[:, 0], [0.5, 0.5, 0.0, 2.0], atol=1e-14)
    matrix[2, 2] = 0.0
    np.testing.assert_allclose(solution(matrix, [1.0, 2.0, 2.0, 6.0])[:, 0], [1 / 3, 1 / 3, 1 / 3, 2.0], atol=1e-14)


@pytest.mark.parametrize("each", [False, True], ids=["one", "each time"])
def test_linear_equations_need_no_guess(each: bool) -> None:
    """It would cost digits of small unknowns, and what is open shall be small whatever was guessed."""
    guess = np.full((varying().scene.program.n_slots, 2) if each else varying().scene.program.n_slots, 1e6)
    np.testing.assert_allclose(
        solution(*pair(0.0), (1.0, -0.5), guess), np.outer([0.5, 0.5, 3.0, -2.0], [1.0, -2.0]), atol=1e-14
    )
    small = solution(np.diag([1.0, 2.0, 4.0, 8.0]), [3e-15, 1.0, 1.0, 7e-18], (1.0, 2.0), guess)
    np.testing.assert_allclose(small, np.outer([3e-15, 0.5, 0.25, 7e-18 / 8], [1.0, 0.5]), rtol=1e-14)


@pytest.mark.parametrize("size", [1e-8, 1e8])
def test_what_counts_as_rounding_grows_with_the_right_hand_sides(size: float) -> None:
    for off in (0.0, 1e-13, 1e-11, 1e-8):
        matrix, right = pair(off)
        if off == 1e-8:
            with pytest.raises(SolverError, match="have no solution at t = 0 s"):
                solution(matrix, size * np.array(right))
        else:
            found = solution(matrix, size * np.array(right))[:, 0]
            np.testing.assert_allclose(found, size * np.array([0.5, 0.5, 3.0, -2.0]), rtol=1e-9)


@pytest.mark.parametrize("rank", [0, 1, 3])
def test_what_nothing_moves_rests(rank: int) -> None:
    rng = np.random.default_rng(rank)
    matrix = rng.normal(size=(N, rank)) @ rng.normal(size=(rank, N))
    assert solution(matrix, np.zeros(N), (1.0, 2.0)).tolist() == np.zeros((N, 2)).tolist()
