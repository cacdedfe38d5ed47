"""The choice of columns, step by step on dense matrices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from gearlib.structure.incidence import Node
from gearlib.structure.pantelides import Differentiation
from gearlib.structure.states import constraints, select_columns

Rows = dict[Node, dict[Node, float]]


def greedy(rows: Rows, badness: dict[Node, tuple[float, ...]], ranks: Sequence[int]) -> tuple[set[Node], int]:
    """Columns from the least wanted one on, each unless it depends on earlier ones; and how many rows are left over.

    Among equals that with the fewest entries, then the largest one relative to its row, then the lowest rank and derivative.
    """
    nodes = sorted({n for row in rows.values() for n, a in row.items() if a})
    A = np.array([[row.get(n, 0.0) for n in nodes] for row in rows.values()])
    A /= np.abs(A).max(axis=1, keepdims=True)

    def wish(n: Node) -> Any:
        column = A[:, nodes.index(n)]
        return [-x for x in badness.get(n, (0.0,))], np.count_nonzero(column), -np.abs(column).max(), ranks[n[0]], n[1]

    chosen: list[Node] = []
    for n in sorted(nodes, key=wish):
        more = [nodes.index(m) for m in [*chosen, n]]
        if np.linalg.matrix_rank(A[:, more], tol=1e-9) == len(more):
            chosen.append(n)
    return set(chosen), len(rows) - len(chosen)


@pytest.mark.parametrize("seed", range(6))
def test_ties_are_broken_as_described(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(15):
        m, n = int(rng.integers(1, 6)), int(rng.integers(2, 8))
        nodes = [(int(v), int(k)) for v, k in {(int(i) // 2, int(i) % 2) for i in rng.permutation(16)[:n]}]
        values = rng.choice([0.0, 0.0, 1.0, -2.0, 3.0], (m, len(nodes)))
        values[np.arange(m), rng.integers(0, len(nodes), m)] = -1.0
        rows = {
            (int(e), 0): dict(zip(nodes, map(float, row), strict=True))
            for e, row in zip(rng.permutation(m), values, strict=True)
        }
        badness = {node: (float(rng.integers(0, 2)), float(rng.integers(0, 2))) for node in nodes if rng.random() < 0.6}
        badness = {node: (0.0, 0.0) for node in nodes} | badness
        ranks = rng.permutation(8).tolist()
        chosen, left = select_columns(rows, badness, ranks=ranks)
        assert (chosen, len(left)) == greedy(rows, badness, ranks)
        assert left == sorted(left)
        assert select_columns(rows, badness)[0] == greedy(rows, badness, range(8))[0]


@pytest.mark.parametrize(("others", "taken"), [(7, "x"), (8, "y")])
def test_a_column_that_fills_in_goes_behind_its_equals(others: int, taken: str) -> None:
    """p + x = 0 and some p + y = 0: without p there are as many x - y = 0, and x, which had one entry, has one in each of them."""
    p, x, y = (0, 0), (1, 0), (2, 0)
    rows: Rows = {(0, 0): {p: 1.0, x: 1.0}, **{(e, 0): {p: 1.0, y: 1.0} for e in range(1, others + 1)}}
    chosen, left = select_columns(rows, {p: (9.0,)})
    assert (chosen, len(left)) == ({p, {"x": x, "y": y}[taken]}, others - 1)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(("share", "left"), [(0.04, 2), (0.4, 1)])
def test_a_short_row_is_no_pivot_if_its_coefficient_is_less_than_a_tenth_of_another_ones(
    size: float, share: float, left: int
) -> None:
    """The second row is the first plus the third. Without the first, the lower one of the others is taken; without the third, the first."""
    x, y, z = (0, 0), (1, 0), (2, 0)
    coefficients = np.array([[1.0, 1.0, 1.0], [1.0 + share, 2.0, 1.0], [share, 1.0, 0.0]]) * size
    rows = {(e, 0): dict(zip((x, y, z), row, strict=True)) for e, row in enumerate(coefficients.tolist())}
    assert select_columns(rows, {x: (9.0,), y: (5.0,)}) == ({x, y}, [(left, 0)])


@pytest.mark.parametrize(("larger", "taken"), [(1 + 2e-6, "ab"), (1 + 0.5e-6, "ac"), (-1 - 2e-6, "ab"), (0.5, "ac")])
def test_where_coefficients_vary_another_one_has_to_be_larger(larger: float, taken: str) -> None:
    """Column a, which has one entry, comes before b, which has two; where b is larger in the row it is taken, and then a before c."""
    place = {"a": (0, 0), "b": (1, 0), "c": (2, 0)}
    a, b, c = place.values()
    rows: Rows = {(4, 1): {a: 1.0, b: larger}, (5, 0): {b: 1.0, c: 0.5}}
    assert select_columns(rows, {}, varying=frozenset({4})) == ({place[name] for name in taken}, [])
    assert select_columns(rows, {}, varying=frozenset({5})) == ({a, b}, []), "b is larger than c in the other row"
    assert select_columns(rows, {}) == ({a, c}, [])
    assert select_columns(rows, {a: (1.0,)}, varying=frozenset({4})) == ({a, c}, []), "b is no equal of a"


def test_what_is_chosen_already_is_not_put_in_place_of_another() -> None:
    """In the varying row only the wanted one is left beside the chosen one, however small its coefficient."""
    a, b = (0, 0), (1, 0)
    rows: Rows = {(0, 0): {a: 1.0}, (1, 0): {a: 100.0, b: 1.0}}
    assert select_columns(rows, {a: (1.0,), b: (1.0,)}, varying=frozenset({1})) == ({a, b}, [])


@pytest.mark.parametrize(("share", "left"), [(0.11, (1, 0)), (0.1, (1, 0)), (0.09, (0, 0))])
def test_a_pivot_is_a_tenth_of_the_largest_in_its_column_or_more(share: float, left: Node) -> None:
    """Without p, two rows hold the same; the first one is large enough for its former size, or left over."""
    p, a = (0, 0), (1, 0)
    rows: Rows = {(0, 0): {p: 1 / share, a: 1.0}, (1, 0): {a: 1.0}, (2, 0): {p: 1.0}}
    assert select_columns(rows, {p: (1.0,)}) == ({p, a}, [left])


def test_a_column_of_no_known_badness_counts_as_zero() -> None:
    a, b = (0, 0), (1, 0)
    rows: Rows = {(0, 0): {a: 1.0, b: 1.0}}
    assert select_columns(rows, {a: (-0.5,)}) == ({b}, [])
    assert select_columns(rows, {b: (0.5,)}) == ({b}, [])
    assert select_columns(rows, {b: (0.0,)}) == ({a}, [])


def test_coefficients_of_one_node_are_added_at_each_order() -> None:
    """An equation f(v, v') twice differentiated, in which v stands twice: rows of f and f'."""
    v, w = 3, 4
    result = Differentiation((2,), {v: 3, w: 2}, {0: v})
    given = 5  # from outside: no unknown, so it has no order
    entries = [(0, v, 0, 2.0), (0, v, 1, 5.0), (0, v, 0, 0.5), (0, w, 0, 1.0), (0, w, 0, 0.25), (0, given, 0, 4.0)]
    assert constraints(result, entries) == {
        (0, 0): {(v, 0): 2.5, (v, 1): 5.0, (w, 0): 1.25},
        (0, 1): {(v, 1): 2.5, (v, 2): 5.0, (w, 1): 1.25},
    }


def test_of_a_variable_and_its_derivative_the_variable_is_no_state() -> None:
    for nodes in ([(1, 0), (1, 1)], [(1, 1), (1, 0)]):
        assert select_columns({(0, 0): dict.fromkeys(nodes, 1.0)}, {}) == ({(1, 0)}, [])


@pytest.mark.parametrize("size", [100.0, 1.0, 0.01])
@pytest.mark.parametrize(("share", "taken"), [(0.5e-11, 1), (2e-11, 0)])
def test_a_coefficient_counts_from_a_share_of_its_rows_largest_on(size: float, share: float, taken: int) -> None:
    assert select_columns({(0, 0): {(0, 0): share * size, (1, 0): -size}}, {(0, 0): (9.0,)}) == ({(taken, 0)}, [])
