"""Pantelides' algorithm, against his examples and against an independent characterisation."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearlib.errors import SingularError
from gearlib.structure import pantelides as algorithms
from gearlib.structure.pantelides import Differentiation, by_graph, by_lists, pantelides
from tests.stress.test_right_calls import given as returned

Rows = list[list[tuple[int, int]]]


def dense(rows: Rows) -> Callable[[int, int], list[tuple[int, int]]]:
    """Columns of equations nonlinear in everything: the k-th derivative holds all orders from 0 to k more."""
    return lambda e, k: sorted({(v, order + j) for v, order in rows[e] for j in range(k + 1)})


def test_pendulum_of_the_paper() -> None:
    """Example 4: x' = w, y' = z, w' = T x, z' = T y - g, x^2 + y^2 = L^2."""
    x, y, w, z, T = range(5)
    rows = [[(x, 1), (w, 0)], [(y, 1), (z, 0)], [(w, 1), (T, 0), (x, 0)], [(z, 1), (T, 0), (y, 0)], [(x, 0), (y, 0)]]
    result = pantelides(5, dense(rows))
    assert result.counts == (1, 1, 0, 0, 2)
    assert dict(result.orders) == {x: 2, y: 2, w: 1, z: 1, T: 0}
    assert result.index == 3
    assert sorted(result.assignment) == [0, 1, 2, 3, 4]
    assert sorted(result.assignment.values()) == [x, y, w, z, T]


@pytest.mark.parametrize(
    ("rows", "counts", "index"),
    [
        ([[(0, 1)], [(1, 1), (0, 0)]], (0, 0), 0),  # an ODE
        ([[(0, 1), (1, 0)], [(1, 0), (0, 0)]], (0, 0), 1),  # one algebraic unknown
        ([[(0, 1), (1, 0)], [(0, 0)]], (0, 1), 2),  # x' = y, x = u(t)
        ([[(0, 1), (1, 0)], [(1, 1), (2, 0)], [(0, 0)]], (1, 0, 2), 3),  # a chain of integrators driven from its end
    ],
)
def test_counts_and_index(rows: Rows, counts: tuple[int, ...], index: int) -> None:
    result = pantelides(len(rows), dense(rows))
    assert result.counts == counts
    assert result.index == index


def smallest_offsets(rows: Rows, limit: int = 4) -> tuple[int, ...]:
    """Pryce's dual problem by trying everything: the least c >= 0 with d_v - c_e >= order(e, v), equal along an assignment."""
    n = len(rows)
    sigma = np.full((n, n), -1)
    for e, row in enumerate(rows):
        for v, order in row:
            sigma[e, v] = max(sigma[e, v], order)
    perms = [p for p in itertools.permutations(range(n)) if all(sigma[e, p[e]] >= 0 for e in range(n))]
    value = max(sum(int(sigma[e, p[e]]) for e in range(n)) for p in perms)
    best = next(p for p in perms if sum(int(sigma[e, p[e]]) for e in range(n)) == value)
    c = [0] * n
    while True:  # Pryce's fixed point; the least solution
        d = [max(int(sigma[e, v]) + c[e] for e in range(n) if sigma[e, v] >= 0) for v in range(n)]
        new = [d[best[e]] - int(sigma[e, best[e]]) for e in range(n)]
        if new == c:
            return tuple(c)
        c = new
        assert max(c) <= limit * n


@given(st.integers(0, 10_000))
def test_counts_are_the_least_offsets_of_the_signature_matrix(seed: int) -> None:
    """J. D. Pryce, BIT 41 (2001) 364-394: the canonical offsets are Pantelides' counts."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    p = rng.permutation(n)
    rows: Rows = []
    for e in range(n):
        row = {int(p[e]): int(rng.integers(0, 3))}  # an assignment exists
        for v in rng.choice(n, size=int(rng.integers(0, n)), replace=False):
            row.setdefault(int(v), int(rng.integers(0, 3)))
        rows.append(sorted(row.items()))
    assert pantelides(n, dense(rows)).counts == smallest_offsets(rows)


@given(
    st.integers(2, 9).flatmap(
        lambda n: st.lists(
            st.lists(st.tuples(st.integers(0, n - 1), st.integers(0, 2)), min_size=1, max_size=4), min_size=n, max_size=n
        )
    )
)
def test_graphs_and_lists_agree(rows: Rows) -> None:
    """The counts are the least possible, so both ways have one answer; an assignment may be any that fits."""
    rows = [sorted({(e, 0), *row}) for e, row in enumerate(rows)]  # structurally nonsingular
    asked: list[tuple[int, int]] = []

    def columns(e: int, order: int) -> list[tuple[int, int]]:
        asked.append((e, order))
        assert len(asked) == len(set(asked)), "each order of an equation is wanted once"
        return dense(rows)(e, order)

    graph, lists = by_graph(len(rows), columns), by_lists(len(rows), dense(rows))
    assert graph.counts == lists.counts
    assert dict(graph.orders) == dict(lists.orders)
    for result in (graph, lists):
        assert sorted(result.assignment) == sorted(result.assignment.values()) == list(range(len(rows)))
        for e, v in result.assignment.items():
            assert (v, result.orders[v]) in dense(rows)(e, result.counts[e])


@pytest.mark.parametrize(("n", "way"), [(2, "graph"), (3, "graph"), (4, "lists")])
def test_lists_are_used_beyond_a_number_of_equations(n: int, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(algorithms, "MOST_IN_GRAPHS", 3)
    monkeypatch.setattr(algorithms, "by_graph", lambda n, columns: "graph")
    monkeypatch.setattr(algorithms, "by_lists", lambda n, columns: "lists")
    assert pantelides(n, dense([])) == way


def test_no_equations_have_index_zero() -> None:
    assert pantelides(0, dense([])).index == 0


@pytest.mark.parametrize("way", [by_graph, by_lists])
@pytest.mark.parametrize(
    ("rows", "counts", "orders"),
    [
        ([[(0, 1), (1, 0)], [(1, 1), (2, 0)], [(0, 0)]], (1, 0, 2), {0: 2, 1: 1, 2: 0}),
        ([[(0, 0)], [(0, 1), (1, 0)]], (1, 0), {0: 1, 1: 0}),
        ([[(0, 0), (1, 1)], [(1, 0), (0, 1)]], (0, 0), {0: 1, 1: 1}),
        ([[(1, 2), (0, 0)], [(1, 0)], [(2, 0), (1, 1)]], (0, 2, 0), {0: 0, 1: 2, 2: 0}),
    ],
)
def test_derivatives_are_asked_for_in_turn_and_no_more_of_them_than_needed(
    way: Callable[..., Differentiation], rows: Rows, counts: tuple[int, ...], orders: dict[int, int]
) -> None:
    asked = [-1] * len(rows)

    def columns(e: int, k: int) -> list[tuple[int, int]]:
        asked[e] += 1
        assert k == asked[e] <= counts[e], "the next one, if it is needed"
        return dense(rows)(e, k)

    result = returned(lambda: way(len(rows), columns))
    assert isinstance(result, Differentiation)
    assert (result.counts, dict(result.orders), tuple(asked)) == (counts, orders, counts)
    assert all((v, orders[v]) in dense(rows)(e, counts[e]) for e, v in result.assignment.items())
    assert sorted(result.assignment.values()) == sorted(orders)


@pytest.mark.parametrize("way", [by_graph, by_lists])
@pytest.mark.parametrize("rows", [[[(0, 0)], [(0, 0)]], [[(0, 2), (1, 0)], [(1, 0)], [(1, 1)]]])
def test_two_equations_for_one_variable_are_not_differentiated_for_ever(
    way: Callable[..., Differentiation], rows: Rows
) -> None:
    with pytest.raises(SingularError, match="however often"):
        way(len(rows), dense(rows))


@pytest.mark.parametrize("way", [by_graph, by_lists])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_longest_chain_of_differentiations_is_not_refused(way: Callable[..., Differentiation], order: int) -> None:
    """x0 is given, and each variable is the highest derivative of the one before: the first equation is differentiated n - 1 times."""
    n = 6
    rows = [[(0, 0)], *([(i, order), (i + 1, 0)] for i in range(n - 1))]
    assert way(n, dense(rows)).counts == tuple(order * (n - 1 - i) if i else order * (n - 1) for i in [0, *range(1, n)])
