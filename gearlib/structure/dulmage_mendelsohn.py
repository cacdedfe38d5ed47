"""Maximum matching and Dulmage-Mendelsohn decomposition: over- and under-determined parts of a system.

A. L. Dulmage and N. S. Mendelsohn, "Coverings of bipartite graphs", Canadian Journal of Mathematics 10 (1958) 517-534,
doi 10.4153/CJM-1958-052-0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import networkx as nx

MOST_IN_GRAPHS = 500  # rows; beyond that, lists take a tenth to a twentieth of the time (docs/how_it_scales.md)


@dataclass(frozen=True)
class Imbalance:
    """The over- and under-determined parts of a system."""

    excess_equations: tuple[int, ...]  # the over-determined part
    excess_variables: tuple[int, ...]  # variables that it determines more than once
    missing_equations: tuple[int, ...]  # equations of the under-determined part
    undetermined: tuple[int, ...]  # its variables
    surplus: int  # equations too many
    deficit: int  # variables too many


def dulmage_mendelsohn(rows: Sequence[Sequence[int]], variables: Sequence[int]) -> Imbalance | None:
    """Match equations with variables, and find the over- and under-determined parts; None if each has its partner.

    Parameters
    ----------
    rows : sequence of sequences of int
        The variables of each equation.
    variables : sequence of int
        All variables.

    Examples
    --------
    Two equations for x0, none for x1:

    >>> b = dulmage_mendelsohn([[0], [0]], [0, 1])
    >>> b.excess_equations, b.excess_variables, b.undetermined
    ((0, 1), (0,), (1,))
    """
    partner = maximum_matching(rows)
    taken = set(partner.values())
    free_equations = [e for e in range(len(rows)) if e not in partner]
    free_variables = [v for v in variables if v not in taken]
    if not (free_equations or free_variables):
        return None
    graph: nx.Graph = nx.Graph()
    graph.add_nodes_from((("e", e) for e in range(len(rows))), bipartite=0)
    graph.add_nodes_from((("v", v) for v in variables), bipartite=1)
    graph.add_edges_from((("e", e), ("v", v)) for e, row in enumerate(rows) for v in row)
    pairs = {("e", e): ("v", v) for e, v in partner.items()} | {("v", v): ("e", e) for e, v in partner.items()}
    over = alternating_reach(graph, pairs, [("e", e) for e in free_equations])
    under = alternating_reach(graph, pairs, [("v", v) for v in free_variables])
    over_e, over_v, under_e, under_v = (
        tuple(sorted(i for s, i in part if s == side)) for part in (over, under) for side in ("e", "v")
    )
    return Imbalance(over_e, over_v, under_e, under_v, len(free_equations), len(free_variables))


def maximum_matching(rows: Sequence[Sequence[Any]]) -> dict[int, Any]:
    """Maximum matching, row -> column: on a graph up to `MOST_IN_GRAPHS` rows, beyond that on lists.

    Examples
    --------
    >>> maximum_matching([["a", "b"], ["a"], ["a"]])
    {0: 'b', 1: 'a'}
    """
    return matching_by_graph(rows) if len(rows) <= MOST_IN_GRAPHS else matching_by_lists(rows)


def bipartite_graph(rows: Sequence[Sequence[Any]]) -> tuple[nx.Graph, list[Any]]:
    """The bipartite graph of rows 0, 1, ... and their columns, numbered from ``len(rows)``; and the list of columns."""
    columns = {c: k for k, c in enumerate(dict.fromkeys(c for row in rows for c in row), len(rows))}
    graph: nx.Graph = nx.Graph()
    graph.add_nodes_from(range(len(rows)), bipartite=0)
    graph.add_nodes_from(columns.values(), bipartite=1)
    graph.add_edges_from((r, columns[c]) for r, row in enumerate(rows) for c in row)
    return graph, list(columns)


def matching_by_graph(rows: Sequence[Sequence[Any]]) -> dict[int, Any]:
    """Maximum matching by the Hopcroft-Karp algorithm of networkx.

    J. E. Hopcroft and R. M. Karp, "An n^(5/2) algorithm for maximum matchings in bipartite graphs", SIAM Journal on Computing 2 (1973)
    225-231, doi 10.1137/0202019.
    """
    graph, columns = bipartite_graph(rows)
    partner = nx.bipartite.hopcroft_karp_matching(graph, range(len(rows)))
    return {r: columns[partner[r] - len(rows)] for r in range(len(rows)) if r in partner}


def alternating_reach(graph: nx.Graph, partner: Mapping[Any, Any], start: Iterable[Any]) -> set[Any]:
    """Nodes reached by alternating paths from unmatched nodes of one side: forwards along any edge, backwards along matched ones."""
    start = list(start)
    side = {graph.nodes[node]["bipartite"] for node in start}
    paths: nx.DiGraph = nx.DiGraph()
    paths.add_nodes_from(["start", *start])
    for node, other in graph.edges:
        here, there = (node, other) if graph.nodes[node]["bipartite"] in side else (other, node)
        paths.add_edge(here, there)
        if partner.get(there) == here:
            paths.add_edge(there, here)
    paths.add_edges_from(("start", node) for node in start)  # a single source
    return set(nx.descendants(paths, "start"))


def matching_by_lists(rows: Sequence[Sequence[Any]]) -> dict[int, Any]:
    """Maximum matching without a graph, for the many rows of large trains.

    Augmenting paths are searched from all free rows at once, trying each column once per pass (A. Pothen and C.-J. Fan, "Computing the
    block triangular form of a sparse matrix", ACM Transactions on Mathematical Software 16 (1990) 303-324, doi 10.1145/98267.98287).
    """
    owner: dict[Any, int] = {}
    free = []
    for r, row in enumerate(rows):  # greedy initial matching
        for c in row:
            if c not in owner:
                owner[c] = r
                break
        else:
            free.append(r)
    for _ in free:  # a pass matches at least one of these, or is the last
        seen: set[Any] = set()
        remaining = [r for r in free if not _augment(r, rows, owner, seen)]
        if len(remaining) == len(free):
            break
        free = remaining
    return {r: c for c, r in owner.items()}


def _augment(start: int, rows: Sequence[Sequence[Any]], owner: dict[Any, int], seen: set[Any]) -> bool:
    """Augment the matching by a row along an alternating path, depth-first."""
    path: list[tuple[int, Any]] = []  # (row, the column to be matched with it)
    stack = [(start, iter(rows[start]))]
    while stack:
        r, columns = stack[-1]
        for c in columns:
            if c in seen:
                continue
            seen.add(c)
            path.append((r, c))
            if c not in owner:
                owner.update({column: row for row, column in path})
                return True
            stack.append((owner[c], iter(rows[owner[c]])))
            break
        else:
            stack.pop()
            if path:
                path.pop()
    return False
