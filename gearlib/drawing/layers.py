"""Layers of a block diagram from left to right, and the order within each: the layered method of Sugiyama, Tagawa and Toda.

References
----------
K. Sugiyama, S. Tagawa, M. Toda, IEEE Transactions on Systems, Man, and Cybernetics 11 (1981) 109-125.
https://doi.org/10.1109/TSMC.1981.4308636
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import networkx as nx
import numpy as np

SWEEPS = 12  # over all layers, to and fro; the best order that was met counts

Ends = Sequence[tuple[int, int]]
"""Ends of a net: (node, side), the side that the end has by convention: -1 left, 1 right, 0 any."""


def positions(count: int, nets: Sequence[Ends]) -> list[float]:
    """Positions of nodes on a line: one step from a right end of a net to its left ends, and otherwise close together.

    The connections of a drive train are undirected; this gives them a direction. The positions minimise ``sum weight (x_b - x_a -
    step)**2`` over the pairs of ends of each net.

    >>> [round(x) for x in positions(3, [[(0, 1), (1, -1)], [(1, 1), (2, -1)]])]
    [-1, 0, 1]
    """
    matrix, right = 1e-6 * np.eye(count), np.zeros(count)
    for ends in nets:
        for (a, side_a), (b, side_b) in combinations(ends, 2):
            if a == b:
                continue
            step = (side_a - side_b) / 2  # +1: a's right end at b's left end
            weight = (1.0 if abs(step) == 1 else 0.3 if step else 0.1) / len(ends)
            for p, q, towards in ((a, b, -1), (b, a, 1)):
                matrix[p, p] += weight
                matrix[p, q] -= weight
                right[p] += towards * weight * step
    return [float(x) for x in np.linalg.solve(matrix, right)]


def layers(count: int, nets: Sequence[Ends], fixed: Mapping[int, int]) -> list[int]:
    """Layer of every node: longest path over the nets, directed by `positions`.

    Parameters
    ----------
    count : int
        Number of nodes.
    nets : sequence of ends
        Connections between nodes.
    fixed : mapping of int to {-1, 1}
        Nodes that occupy the first layer (-1) or the last one (1) alone.

    Returns
    -------
    list of int
        Numbered from 0.

    >>> layers(4, [[(0, 1), (1, -1), (2, -1)], [(1, 1), (2, 1), (3, -1)]], {})
    [0, 1, 1, 2]
    """
    x = positions(count, nets)
    graph = nx.DiGraph()
    graph.add_nodes_from(n for n in range(count) if n not in fixed)
    for ends in nets:
        for (a, side_a), (b, side_b) in combinations([end for end in ends if end[0] not in fixed], 2):
            apart = x[b] - x[a]
            if a != b and (side_a * side_b == -1 or (side_a != side_b and abs(apart) > 0.2) or abs(apart) > 0.45):
                first = (a, b) if (round(apart, 4), b - a) > (0, 0) else (b, a)
                graph.add_edge(*first)
    layer = dict.fromkeys(graph, 0)
    order = list(nx.topological_sort(graph))
    for node in order:
        layer[node] = max((layer[p] + 1 for p in graph.predecessors(node)), default=0)
    for node in reversed(order):  # towards its neighbours, where that shortens wires
        after = [layer[s] for s in graph.successors(node)]
        if after and graph.in_degree(node) < len(after):
            layer[node] = min(after) - 1
    lowest = min(layer.values(), default=0) - (1 if -1 in fixed.values() else 0)
    last = max(layer.values(), default=-1) + 1
    return [layer[n] - lowest if n in layer else (0 if fixed[n] < 0 else last - lowest) for n in range(count)]


def ordered(rows: Sequence[Sequence[int]], places: Mapping[int, Sequence[tuple[int, float]]]) -> list[list[int]]:
    """Order of the nodes of each layer with few crossings, by forward and backward barycentre sweeps.

    Parameters
    ----------
    rows : sequence of sequences of int
        Nodes by layer, in an initial order.
    places : mapping of int to sequence of (net, offset)
        The nets of each node, with their ends as fractions of its height.

    Returns
    -------
    list of lists of int
        The order with the fewest crossings found; deterministic.
    """
    best = current = [list(row) for row in rows]
    fewest = _crossings(current, places)
    for sweep in range(SWEEPS):
        current = [list(row) for row in current]
        span = range(1, len(current)) if sweep % 2 == 0 else range(len(current) - 2, -1, -1)
        for i in span:
            neighbours = current[i - 1 if sweep % 2 == 0 else i + 1]
            here = _heights(neighbours, places)
            old = {node: float(k) for k, node in enumerate(current[i])}

            def centre(node: int, here: dict[int, float] = here, old: dict[int, float] = old) -> tuple[float, float]:
                known = [here[net] - offset for net, offset in places[node] if net in here]
                return (round(sum(known) / len(known), 6) if known else old[node], old[node])

            current[i].sort(key=centre)
        if (crossings := _crossings(current, places)) < fewest:
            best, fewest = current, crossings
        if not fewest:
            break
    return best


def _heights(row: Sequence[int], places: Mapping[int, Sequence[tuple[int, float]]]) -> dict[int, float]:
    """Mean height of every net that ends in a layer."""
    ends: dict[int, list[float]] = {}
    for k, node in enumerate(row):
        for net, offset in places[node]:
            ends.setdefault(net, []).append(k + offset)
    return {net: sum(found) / len(found) for net, found in ends.items()}


def _crossings(rows: Sequence[Sequence[int]], places: Mapping[int, Sequence[tuple[int, float]]]) -> int:
    count = 0
    for before, after in zip(rows, rows[1:], strict=False):
        left, right = _heights(before, places), _heights(after, places)
        both = [(left[net], right[net]) for net in left if net in right]
        count += sum((a[0] - b[0]) * (a[1] - b[1]) < 0 for a, b in combinations(both, 2))
    return count
