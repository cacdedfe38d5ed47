"""Circulating power: cycles in the directed graph of power flow between shafts and components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class PowerEdge:
    """Power (W) that a component takes from a shaft (negative: delivers)."""

    component: str
    shaft: int
    power: float


@dataclass(frozen=True)
class Circulation:
    """A circulating power (W), and the components that it flows through."""

    power: float
    components: tuple[str, ...]


def circulations(branches: Sequence[PowerEdge]) -> tuple[Circulation, ...]:
    """Remove cycles from the power flow until none is left; each carries the smallest power along its path.

    Power flows from a shaft into a component and out at another shaft. In a train with one closed loop there is at most one cycle, and
    its power is the circulating power of that loop; with several loops the sum depends on the decomposition, and shortest cycles are
    removed first.

    Examples
    --------
    >>> loop = [PowerEdge("a", 1, 5.0), PowerEdge("a", 2, -5.0), PowerEdge("b", 2, 5.0), PowerEdge("b", 1, -4.0)]
    >>> loop.append(PowerEdge("drive", 1, -1.0))
    >>> circulations(loop)
    (Circulation(power=4.0, components=('a', 'b')),)
    """
    import networkx as nx

    graph = nx.DiGraph()
    largest = max((abs(b.power) for b in branches), default=0.0)
    for b in branches:
        ends = (("shaft", b.shaft), ("part", b.component))
        graph.add_edge(*(ends if b.power > 0 else reversed(ends)), power=abs(b.power))
    found: list[Circulation] = []
    while True:
        cycle = _shortest_cycle(graph)
        if cycle is None:
            return tuple(sorted(found, key=lambda c: -c.power))
        edges = list(zip(cycle, [*cycle[1:], cycle[0]], strict=True))
        power = min(graph.edges[e]["power"] for e in edges)
        parts = [name for kind, name in cycle if kind == "part"]
        first = parts.index(min(parts))
        found.append(Circulation(power, tuple(parts[first:] + parts[:first])))
        for e in edges:
            graph.edges[e]["power"] -= power
            if graph.edges[e]["power"] <= 1e-12 * largest:
                graph.remove_edge(*e)


def _shortest_cycle(graph: Any) -> list[tuple[str, Any]] | None:
    """A shortest cycle. Only branching nodes are tried as starts: a cycle without one is its whole component."""
    import networkx as nx

    best: list[tuple[str, Any]] | None = None
    for group in nx.strongly_connected_components(graph):
        if len(group) < 2:
            continue
        inside = graph.subgraph(group)
        # Sorted, since the order of sets of strings changes from process to process.
        starts = sorted((node for node in group if inside.out_degree(node) > 1), key=str) or [min(group, key=str)]
        for u in starts:
            for v in sorted(inside.successors(u), key=str):
                path = nx.shortest_path(inside, v, u)
                if best is None or len(path) < len(best):
                    best = path
    return best
