"""Are there as many equations as unknowns, everywhere? The Dulmage-Mendelsohn decomposition answers by name.

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
    """A maximum matching, and the parts of the system that it cannot cover."""

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
    """Match equations with variables and name what is too much on either side.

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
    graph: nx.Graph = nx.Graph()
    left = [("e", e) for e in range(len(rows))]
    graph.add_nodes_from(left)
    graph.add_nodes_from(("v", v) for v in variables)
    graph.add_edges_from((("e", e), ("v", v)) for e, row in enumerate(rows) for v in row)
    partner = maximum_matching(rows)
    taken = {v: e for e, v in partner.items()}
    free_equations = [e for e in range(len(rows)) if e not in partner]
    free_variables = [v for v in variables if v not in taken]
    over_e, over_v = _alternate(graph, [("e", e) for e in free_equations], taken, partner)
    under_e, under_v = _alternate(graph, [("v", v) for v in free_variables], taken, partner)
    return Balance(partner, over_e, over_v, under_e, under_v, len(free_equations), len(free_variables))


def maximum_matching(rows: Sequence[Sequence[Any]]) -> dict[int, Any]:
    """Row -> column. Whatever has only one partner left is matched at once; Hopcroft and Karp's algorithm does the rest."""
    holders: dict[Any, list[int]] = {}
    for e, row in enumerate(rows):
        for v in row:
            holders.setdefault(v, []).append(e)
    degree_e, degree_v = [len(r) for r in rows], {v: len(es) for v, es in holders.items()}
    partner: dict[int, int] = {}
    taken: set[Any] = set()
    stack: list[tuple[str, Any]] = [("e", e) for e, d in enumerate(degree_e) if d == 1] + [("v", v) for v, d in degree_v.items() if d == 1]
    while stack:
        side, i = stack.pop()
        if side == "e":
            if i in partner:
                continue
            pair = next(((i, v) for v in rows[i] if v not in taken), None)
        else:
            if i in taken:
                continue
            pair = next(((e, i) for e in holders[i] if e not in partner), None)
        if pair is None:
            continue
        e, v = pair
        partner[e] = v
        taken.add(v)
        for other in holders[v]:
            degree_e[other] -= 1
            if degree_e[other] == 1 and other not in partner:
                stack.append(("e", other))
        for other in rows[e]:
            degree_v[other] -= 1
            if degree_v[other] == 1 and other not in taken:
                stack.append(("v", other))
    rest: nx.Graph = nx.Graph()
    top = [("e", e) for e in range(len(rows)) if e not in partner]
    rest.add_nodes_from(top)
    rest.add_edges_from((("e", e), ("v", v)) for _, e in top for v in rows[e] if v not in taken)
    found = nx.bipartite.hopcroft_karp_matching(rest, top_nodes=top)
    partner.update({i: w for (side, i), (_, w) in found.items() if side == "e"})
    return partner


def _alternate(
    graph: nx.Graph, start: list[tuple[str, int]], taken: Mapping[int, int], partner: Mapping[int, int]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """All that alternating paths reach from unmatched nodes."""
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
