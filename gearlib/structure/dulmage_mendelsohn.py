"""Maximum matching and Dulmage-Mendelsohn decomposition: over- and under-determined parts of a system.

A. L. Dulmage and N. S. Mendelsohn, "Coverings of bipartite graphs", Canadian Journal of Mathematics 10 (1958) 517-534,
doi 10.4153/CJM-1958-052-0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import networkx as nx


@dataclass(frozen=True)
class Balance:
    """A maximum matching, and the over- and under-determined parts."""

    matching: Mapping[int, int]  # equation -> variable
    excess_equations: tuple[int, ...]  # the over-determined part
    excess_variables: tuple[int, ...]  # the variables that it determines more than once
    missing_equations: tuple[int, ...]  # the equations of the under-determined part
    undetermined: tuple[int, ...]  # its variables
    surplus: int  # equations too many
    deficit: int  # variables too many

    @property
    def balanced(self) -> bool:
        return self.surplus == 0 and self.deficit == 0


def dulmage_mendelsohn(rows: Sequence[Sequence[int]], variables: Sequence[int]) -> Balance:
    """Match equations with variables, and find the over- and under-determined parts.

    Parameters
    ----------
    rows : sequence of sequences of int
        The variables of each equation.
    variables : sequence of int
        All variables.

    Examples
    --------
    Two equations for x0, none for x1 alone:

    >>> b = dulmage_mendelsohn([[0], [0]], [0, 1])
    >>> b.excess_equations, b.excess_variables, b.undetermined
    ((0, 1), (0,), (1,))
    """
    partner = maximum_matching(rows)
    taken = {v: e for e, v in partner.items()}
    free_equations = [e for e in range(len(rows)) if e not in partner]
    free_variables = [v for v in variables if v not in taken]
    if not (free_equations or free_variables):
        return Balance(partner, (), (), (), (), 0, 0)
    graph: nx.Graph = nx.Graph()
    graph.add_nodes_from(("e", e) for e in range(len(rows)))
    graph.add_nodes_from(("v", v) for v in variables)
    graph.add_edges_from((("e", e), ("v", v)) for e, row in enumerate(rows) for v in row)
    over_e, over_v = _alternate(graph, [("e", e) for e in free_equations], taken, partner)
    under_e, under_v = _alternate(graph, [("v", v) for v in free_variables], taken, partner)
    return Balance(partner, over_e, over_v, under_e, under_v, len(free_equations), len(free_variables))


def maximum_matching(rows: Sequence[Sequence[Any]]) -> dict[int, Any]:
    """Maximum matching, row -> column.

    Augmenting paths are searched from all free rows at once, each column being tried once a pass (A. Pothen and C.-J. Fan,
    "Computing the block triangular form of a sparse matrix", ACM Transactions on Mathematical Software 16 (1990) 303-324,
    doi 10.1145/98267.98287).

    Examples
    --------
    >>> maximum_matching([["a", "b"], ["a"], ["a"]])
    {1: 'a', 0: 'b'}
    """
    owner: dict[Any, int] = {}
    free = []
    for r, row in enumerate(rows):  # whatever is free at once
        for c in row:
            if c not in owner:
                owner[c] = r
                break
        else:
            free.append(r)
    progress = True
    while progress and free:
        progress = False
        seen: set[Any] = set()
        remaining = []
        for r in free:
            if _augment(r, rows, owner, seen):
                progress = True
            else:
                remaining.append(r)
        free = remaining
    return {r: c for c, r in owner.items()}


def _augment(start: int, rows: Sequence[Sequence[Any]], owner: dict[Any, int], seen: set[Any]) -> bool:
    """Augment the matching by a row along an alternating path, depth first."""
    path: list[tuple[int, Any]] = []  # (row, the column it would move to)
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


def _alternate(
    graph: nx.Graph, start: list[tuple[str, int]], taken: Mapping[int, int], partner: Mapping[int, int]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Nodes reachable from unmatched nodes by alternating paths."""
    if not start:
        return (), ()
    free_side = start[0][0]
    seen = set(start)
    stack = list(start)
    while stack:
        node = stack.pop()
        side, i = node
        if side == free_side:
            following = list(graph[node])
        elif side == "v":
            following = [("e", taken[i])] if i in taken else []
        else:
            following = [("v", partner[i])] if i in partner else []
        for other in following:
            if other not in seen:
                seen.add(other)
                stack.append(other)
    return tuple(sorted(i for s, i in seen if s == "e")), tuple(sorted(i for s, i in seen if s == "v"))
