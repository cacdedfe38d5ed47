"""Where each entry of a Jacobian stands in IDA's matrix, whatever its storage; and which storage is taken."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.solvers.ida import iteration_matrix
from gearlib.solvers.ida.iteration_matrix import MatrixPlan, columns_of, plan, reverse_cuthill_mckee
from gearlib.solvers.ida.sundials import Solver, load
from gearlib.solvers.problem import Problem
from tests.run.python_problem import problem


def with_pattern(pattern: np.ndarray, differential: Any = None, implicit: bool = False, analytic: bool = True) -> Problem:
    """A problem whose Jacobian has entries where a pattern is not zero, by columns."""
    n = len(pattern)
    columns, rows = np.nonzero(pattern.T)
    starts = np.searchsorted(columns, np.arange(pattern.shape[1] + 1))
    own = replace(
        problem(lambda t, x, dx, data: 0, np.zeros(n)), jac_indptr=starts, jac_indices=rows, implicit=implicit,
        jac=SimpleNamespace(address=0) if analytic else None, matrix_plans={},
    )  # fmt: skip
    return own if differential is None else replace(own, differential=np.asarray(differential, bool))


def scattered(n: int, seed: int) -> np.ndarray:
    return (np.random.default_rng(seed).random((n, n)) < 0.15) | np.eye(n, dtype=bool)


def chain(n: int, width: int = 1) -> np.ndarray:
    """Neighbours are coupled, in a shuffled order."""
    i = np.arange(n)
    own = np.abs(i[:, None] - i) <= width
    shuffle = np.random.default_rng(n).permutation(n)
    return own[np.ix_(shuffle, shuffle)]


def stored(found: MatrixPlan, n: int, entries: np.ndarray, diagonal: float) -> np.ndarray:
    """The matrix that SUNDIALS reads from the storage: in IDA's order."""
    height = {"dense": n, "band": found.upper + 2 * found.lower + 1, "sparse": 0}[found.kind]
    size = len(found.pattern[1]) if found.pattern else n * height
    data = np.zeros(size)
    np.add.at(data, found.position, entries)
    np.add.at(data, found.diagonal, diagonal)
    matrix = np.zeros((n, n))
    for at, value in enumerate(data):
        if found.pattern:
            row, column = int(found.pattern[1][at]), int(np.searchsorted(found.pattern[0], at, side="right")) - 1
        else:
            column, row = divmod(at, height)
            row += 0 if found.kind == "dense" else column - found.upper - found.lower
        if value:
            matrix[row, column] = value
    return matrix


@pytest.mark.parametrize("kind", ["dense", "band", "sparse"])
@pytest.mark.parametrize("number", range(4))
def test_entries_stand_where_sundials_looks_for_them(kind: str, number: int) -> None:
    n = [5, 18, 30, 24][number]
    pattern = [scattered(5, 1), scattered(18, 2), chain(30), chain(24, 2)][number]
    differential = np.random.default_rng(number).random(n) < 0.7
    own = with_pattern(pattern, differential)
    found = plan(own, kind)
    assert found.kind == kind
    entries = np.random.default_rng(3).uniform(1.0, 2.0, int(pattern.sum()))
    J = np.zeros((n, n))
    J[own.jac_indices, columns_of(own)] = entries
    order = np.arange(n) if found.order is None else found.order
    assert sorted(order.tolist()) == list(range(n))
    matrix = stored(found, n, entries, 100.0)
    assert matrix == pytest.approx((J + 100.0 * np.diag(differential.astype(float)))[np.ix_(order, order)])
    assert order[found.rows].tolist() == own.jac_indices.tolist()
    assert order[found.columns].tolist() == columns_of(own).tolist()
    assert found.part.tolist() == [0 if differential[c] else 1 for c in columns_of(own)]
    if kind == "band":
        assert (found.lower, found.upper) == (max(found.rows - found.columns), max(found.columns - found.rows))
        assert number != 2 or (found.lower, found.upper) == (1, 1)  # whatever its numbering
        assert number != 3 or found.lower + found.upper == 4


def test_rates_of_an_implicit_problem_take_the_columns_of_their_unknowns() -> None:
    """No diagonal is added: F(t, x, x') holds its own."""
    n = 4
    pattern = np.hstack([chain(n), np.eye(n, dtype=bool)[:, :3]])
    found = plan(with_pattern(pattern, [True, True, True, False], implicit=True))
    columns = columns_of(with_pattern(pattern, implicit=True))
    assert found.columns.tolist() == (columns % n).tolist()
    assert found.diagonal.tolist() == []
    assert found.part.tolist() == [2 if c >= n else 1 if c == 3 else 0 for c in columns]


def test_the_cheapest_storage_is_taken() -> None:
    """Small or full: dense; a chain: a band; a large matrix of no order: sparse, if its entries are known."""
    assert plan(with_pattern(chain(16))).kind == "dense"
    assert plan(with_pattern(chain(17))).kind == "band"
    assert plan(with_pattern(chain(400))).kind == "band"
    assert plan(with_pattern(np.ones((60, 60), bool))).kind == "dense"
    star = np.eye(300, dtype=bool)
    star[0] = star[:, 0] = True
    assert plan(with_pattern(star)).kind == "sparse"
    assert plan(with_pattern(star, analytic=False)).kind != "sparse"
    bare = problem(lambda t, x, dx, data: 0, np.zeros(400))
    assert plan(bare).kind == "dense"
    assert plan(bare).part.tolist() == []


def test_costs_of_storages_are_compared() -> None:
    """A solution in each step, a factorisation in every twentieth: of full matrices, bands and nonzeros; bands win a draw."""
    for n, lower, upper in ((20, 3, 1), (40, 7, 2), (40, 2, 7), (60, 0, 0), (120, 20, 30)):
        dense, band = n**2 + n**3 / 3 / 20, n * (2 * lower + upper) + n * lower * (lower + upper) / 20
        found = iteration_matrix.cheapest(n, 10**9, lower, upper, True)
        assert found == ("band" if band <= dense else "dense")
        assert iteration_matrix.cheapest(n, 10**9, lower, upper, False) == found
    for n in (200, 300):
        dearest = n**2 + n**3 // 60
        for nonzeros in ((dearest - 50_000) // 80 - 1, (dearest - 50_000) // 80 + 2):
            sparse = 50_000 + 80 * nonzeros < dearest
            assert iteration_matrix.cheapest(n, nonzeros, n - 1, n - 1, True) == ("sparse" if sparse else "dense")
    assert iteration_matrix.cheapest(400, 10_000, 180, 180, True) == "sparse"
    assert iteration_matrix.cheapest(400, 10_000, 180, 180, False) == "dense"
    for lower in range(12, 24):  # where a band of 40 becomes dearer than a full matrix
        band, dense = 40 * (3 * lower + lower**2 / 10), 1600 + 64000 / 60
        assert iteration_matrix.cheapest(40, 10**9, lower, lower, True) == ("band" if band < dense else "dense")
    for upper in range(20, 80):
        band = 40 * (6 + upper + 3 * (3 + upper) / 20)
        assert iteration_matrix.cheapest(40, 10**9, 3, upper, True) == ("band" if band < 1600 + 64000 / 60 else "dense")


@pytest.mark.parametrize(("upper", "lower"), [(1, 1), (1, 2), (2, 1), (2, 2), (0, 2)])
def test_bands_have_sundials_length_of_a_column(upper: int, lower: int) -> None:
    """However wide they are: the address of an entry is that of its column and its distance from the diagonal."""
    n = 3
    solver = Solver(load(), np.zeros(n), np.zeros(n))
    solver.use_band(upper, lower)
    lib = next(lib for lib in load().libraries if hasattr(lib, "SUNBandMatrix_LDim"))
    lib.SUNBandMatrix_LDim.argtypes, lib.SUNBandMatrix_LDim.restype = [ctypes.c_void_p], ctypes.c_int64
    length = lib.SUNBandMatrix_LDim(solver.matrix)
    solver.close()
    i = np.arange(n)
    found = plan(with_pattern((i - i[:, None] <= upper) & (i[:, None] - i <= lower)), "band")
    assert (found.kind, found.upper, found.lower) == ("band", upper, lower)
    first = {int(c): int(p - (r - c)) for p, r, c in zip(found.position, found.rows, found.columns, strict=True)}
    assert [first[k] - first[0] for k in range(n)] == [0, length, 2 * length]
    assert found.diagonal.tolist() == [first[k] for k in range(n)]


def test_a_plan_is_made_once_for_each_request() -> None:
    own = with_pattern(scattered(20, 1))
    assert plan(own) is plan(replace(own, x0=own.x0 + 1.0))
    assert plan(own, "band") is not plan(own)
    assert plan(replace(own, differential=np.zeros(20, bool))) is not plan(own)
    assert plan(own) is plan(own, None)


def test_operations_and_words() -> None:
    """Of a factorisation and of a solution: as the cube and the square of the unknowns, or in proportion to them."""
    band = MatrixPlan("band", upper=2, lower=3)
    assert band.operations(10) == (150.0, 80.0)
    assert MatrixPlan("dense").operations(6) == (72.0, 36.0)
    sparse = plan(with_pattern(scattered(20, 1)), "sparse")
    count = int(scattered(20, 1).sum())
    assert sparse.operations(20) == (1e6 + 1200.0 * count, 20.0 * count)
    assert MatrixPlan("sparse").operations(20) == (1e6, 0.0)
    assert sparse.describe() == f"sparse (SuperLU), {count} nonzeros"
    assert MatrixPlan("dense").describe() == "dense"
    assert MatrixPlan("sparse").describe() == "sparse (SuperLU), 0 nonzeros"


@pytest.mark.parametrize("seed", range(5))
def test_chains_and_trees_are_ordered_along_their_length(seed: int) -> None:
    """A path has a band of one; several components are numbered one after the other."""
    rng, n = np.random.default_rng(seed), 40
    name = rng.permutation(n)
    cut = int(rng.integers(5, 35))
    edges = [(name[i], name[i + 1]) for i in range(n - 1) if i != cut]
    rows, columns = (np.array(side) for side in zip(*edges, strict=True))
    order = reverse_cuthill_mckee(n, rows, columns)
    place = np.argsort(order)
    assert sorted(order.tolist()) == list(range(n))
    assert np.abs(place[rows] - place[columns]).max() == 1
    parts = (place[name] <= place[name[: cut + 1]].max()) if place[name[0]] < place[name[-1]] else None
    assert parts is None or parts.sum() == cut + 1
