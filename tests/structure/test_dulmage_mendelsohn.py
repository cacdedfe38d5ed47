"""Matching and the Dulmage-Mendelsohn decomposition."""

from __future__ import annotations

from typing import Any

import networkx as nx
import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import maximum_bipartite_matching

import gearlib as gl
import gearparts as gp
from gearlib.errors import BalanceError
from gearlib.structure import dulmage_mendelsohn as matchings
from gearlib.structure.dulmage_mendelsohn import (
    dulmage_mendelsohn,
    matching_by_graph,
    matching_by_lists,
    maximum_matching,
)

c = gl.connect
incidence = st.lists(st.lists(st.integers(0, 7), unique=True, max_size=4), min_size=1, max_size=9)


@given(incidence)
def test_matching_is_maximum(rows: list[list[int]]) -> None:
    found = maximum_matching(rows)
    assert len(set(found.values())) == len(found)
    assert all(v in rows[e] for e, v in found.items())
    graph: Any = nx.Graph()
    top = [("e", e) for e in range(len(rows))]
    graph.add_nodes_from(top)
    graph.add_edges_from((("e", e), ("v", v)) for e, row in enumerate(rows) for v in row)
    assert len(found) == len(nx.bipartite.hopcroft_karp_matching(graph, top_nodes=top)) // 2


@given(incidence)
def test_parts_are_those_that_no_maximum_matching_covers(rows: list[list[int]]) -> None:
    """An equation belongs to the over-determined part if some maximum matching leaves it out, and so for variables."""
    balance = dulmage_mendelsohn(rows, range(8))
    size = len(maximum_matching(rows))
    if balance is None:
        assert len(rows) == size == 8
        return
    assert balance.surplus == len(rows) - size
    assert balance.deficit == 8 - size
    excess = [e for e in range(len(rows)) if len(maximum_matching([r if i != e else [] for i, r in enumerate(rows)])) == size]
    assert list(balance.excess_equations) == excess
    assert list(balance.excess_variables) == sorted({v for e in excess for v in rows[e]})
    free = [v for v in range(8) if len(maximum_matching([[u for u in r if u != v] for r in rows])) == size]
    assert list(balance.undetermined) == free
    assert list(balance.missing_equations) == [e for e, r in enumerate(rows) if set(r) & set(free)]


def model(assemble: Any) -> gl.Component:
    made: gl.Component = type("Model", (gl.Component,), {"assemble": assemble})()
    return made


def doubly_driven(self: Any) -> list[Any]:
    self.one, self.other, self.load = gp.Speed(), gp.Speed(), gp.Inertia(J=1.0)
    return [c(self.one.flange, self.load.flange_a), c(self.other.flange, self.load.flange_b)]


def doubly_grounded(self: Any) -> list[Any]:
    self.one, self.other, self.load = gp.Fixed(), gp.Fixed(phi0=0.1), gp.Inertia(J=1.0)
    return [c(self.one.flange, self.load.flange_a), c(self.other.flange, self.load.flange_b)]


def grounded_on_both_sides(self: Any) -> list[Any]:
    self.one, self.other, self.gear = gp.Fixed(), gp.Fixed(phi0=1.0), gp.IdealGear(ratio=2.0)
    return [c(self.one.flange, self.gear.flange_a), c(self.other.flange, self.gear.flange_b)]


def unconnected(self: Any) -> list[Any]:
    self.gear = gp.IdealGear(ratio=2.0)
    return []


def source_in_the_air(self: Any) -> list[Any]:
    self.torque, self.load = gp.Torque(tau=1.0), gp.Inertia(J=1.0)
    return []


@pytest.mark.parametrize(
    ("assemble", "message"),
    [
        (doubly_driven, r"over-determined.*The equations: .*one \(Speed: .*other \(Speed: .*The variables: .*driven twice"),
        (
            doubly_grounded,
            r"over-determined: held twice by one \(Fixed: .*other \(Fixed: .*The variables: load\.phi\. Remove one",
        ),
        (grounded_on_both_sides, r"over-determined: held twice by one \(Fixed: .*; other \(Fixed: "),
        (
            unconnected,
            r"gear\.flange_a and gear\.flange_b are connected to nothing.*under-determined.*1 too few\. "
            r"The variables: gear\.flange_a\.phi; gear\.flange_b\.phi\.",
        ),
        (
            source_in_the_air,
            r"torque\.flange is connected to nothing.*over-determined.*torque \(binding\).*under-determined.*torque\.flange\.phi",
        ),
    ],
)
def test_unbalanced_models_are_named(assemble: Any, message: str) -> None:
    with pytest.raises(BalanceError, match=message):
        gl.compile(model(assemble))


@pytest.mark.parametrize(
    ("equations", "message"),
    [
        (lambda s: [gl.Eq(s.x + s.y, 1)], r"under-determined: 2 variables in 1 equations, 1 too few\. The variables: x; y"),
        (lambda s: [gl.Eq(s.x, 1)], "under-determined: 1 variables in 0 equations, 1 too few. The variables: y"),
        (
            lambda s: [gl.Eq(s.x + s.y, 1), gl.Eq(s.x - s.y, 2), gl.Eq(s.x, 3 * s.y)],
            "over-determined: .* contradict each other: .*x = 3",
        ),
        (
            lambda s: [gl.Eq(s.x + s.y, 1), gl.Eq(s.x * s.y, 2), gl.Eq(s.x, gl.exp(s.y))],
            r"over-determined: 3 equations for 2 .*x = exp",
        ),
        (lambda s: [gl.Eq(s.x, 1), gl.Eq(s.y, 1), gl.Eq(s.x, s.x)], "over-determined: Leaf: x = x holds no variable"),
        (lambda s: [gl.Eq(s.x, 1), gl.Eq(s.y, 1), gl.Eq(1, 2)], "over-determined: .*Leaf: 1 = 2"),
    ],
)
def test_unbalanced_leaves_are_named(equations: Any, message: str) -> None:
    declared = {"x": gl.Variable("1", "one"), "y": gl.Variable("1", "other")}
    with pytest.raises(BalanceError, match=message):
        gl.compile(type("Leaf", (gl.Component,), {**declared, "equations": equations})())


@given(st.lists(st.lists(st.integers(0, 9), max_size=4), max_size=12))
def test_graphs_and_lists_match_as_many(rows: list[list[int]]) -> None:
    graph, lists = matching_by_graph(rows), matching_by_lists(rows)
    assert len(graph) == len(lists)
    for partner in (graph, lists):
        assert len(set(partner.values())) == len(partner)
        assert all(v in rows[e] for e, v in partner.items())


@pytest.mark.parametrize("seed", range(6))
def test_rows_that_get_in_each_others_way_are_matched_in_several_passes(seed: int) -> None:
    """Two or three entries in each of many rows: a search often meets columns that another one of the same pass has tried."""
    rng = np.random.default_rng(seed)
    n = 150
    rows = [list(dict.fromkeys(rng.integers(0, n, rng.integers(2, 4)).tolist())) for _ in range(n)]
    pattern = sparse.csr_matrix(
        (np.ones(sum(map(len, rows))), np.concatenate(rows), np.cumsum([0, *map(len, rows)])), shape=(n, n)
    )
    most = int((maximum_bipartite_matching(pattern) >= 0).sum())
    assert len(matching_by_lists(rows)) == len(matching_by_graph(rows)) == most < n


def counted(rows: list[list[int]]) -> tuple[list[list[int]], list[int]]:
    """Rows, and a list of those that have been read."""
    read: list[int] = []

    class Row(list[int]):
        def __iter__(self) -> Any:
            read.append(rows.index(self))
            return super().__iter__()

    return [Row(row) for row in rows], read


def test_rows_with_a_free_column_are_read_once() -> None:
    """Lists are for large trains, most of whose equations find a variable at once: no path is searched for them."""
    rows, read = counted([[k - 1, k] for k in range(1, 50)])
    assert matching_by_lists(rows) == {k: k for k in range(49)}
    assert read == list(range(49))


def test_what_finds_no_partner_in_a_pass_is_not_tried_again_unless_another_one_has() -> None:
    rows, read = counted([[0], [0, 0], [0, 0, 0]])
    assert matching_by_lists(rows) == {0: 0}
    assert read == [0, 1, 2, 1, 0, 2], (
        "at first all, then the two that are left, with the one that has what the first of them wants"
    )


@pytest.mark.parametrize(("rows", "way"), [(2, "graph"), (3, "graph"), (4, "lists")])
def test_lists_are_used_beyond_a_number_of_rows(rows: int, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matchings, "MOST_IN_GRAPHS", 3)
    monkeypatch.setattr(matchings, "matching_by_graph", lambda rows: "graph")
    monkeypatch.setattr(matchings, "matching_by_lists", lambda rows: "lists")
    assert maximum_matching([[k] for k in range(rows)]) == way
