"""Block lower triangular form: strongly connected components in topological order, pruned to the targets.

The blocks are the strongly connected components of the graph "unknown depends on unknown" (R. Tarjan, "Depth-first search and
linear graph algorithms", SIAM Journal on Computing 1 (1972) 146-160, doi 10.1137/0201010).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

import networkx as nx

from gearlib.structure.dependence import Dependence
from gearlib.structure.incidence import Node

Block = tuple[Node, ...]  # unknowns that are solved simultaneously


def reach(dependence: Dependence, targets: Iterable[Node], dynamic: bool, events: bool = False) -> tuple[list[Node], set[Node]]:
    """Unknowns and states that the targets depend on.

    With ``dynamic``, also what the derivatives of the states depend on; with ``events``, also what determines the modes of equations.
    """
    unknowns: dict[Node, None] = {}
    states: set[Node] = set()
    given = dependence.given
    stack = [t for t in targets if t[0] not in given]
    seen = set(stack)
    while stack:
        node = stack.pop()
        if node in dependence.is_state:
            states.add(node)
            following = [(node[0], node[1] + 1)] if dynamic else []
            if dynamic and events:
                following += dependence.at_reinits.get(node, ())
        else:
            unknowns[node] = None
            e, k = dependence.equation(node)
            following = dependence.columns(e, k)
            if events and e in dependence.at_events:
                following = [*following, *dependence.at_events[e]]
        for other in following:
            if other not in seen and other[0] not in given:
                seen.add(other)
                stack.append(other)
    return list(unknowns), states


def sort_blocks(dependence: Dependence, unknowns: Collection[Node]) -> tuple[Block, ...]:
    """Strongly connected components in topological order.

    Components of one level are ordered by their lowest unknown, so that the result does not depend on hashing.
    """
    inside = set(unknowns)
    graph: nx.DiGraph = nx.DiGraph()
    ordered = sorted(inside)
    graph.add_nodes_from(ordered)
    for node in ordered:
        graph.add_edges_from((node, other) for other in dependence.of(node) if other in inside)
    return tuple(tuple(sorted(c)) for c in nx.strongly_connected_components(graph))  # dependencies first


def sinks(dependence: Dependence, states: Iterable[Node], position: Callable[[Node], bool]) -> frozenset[Node]:
    """States that are pure integrals, on which nothing depends but themselves: usually absolute angles."""
    remaining = list(states)
    _, needed = reach(dependence, [(v, k + 1) for v, k in remaining], dynamic=False, events=True)
    return frozenset(s for s in remaining if s not in needed and position(s))
