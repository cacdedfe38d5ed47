"""Heights of the nodes of a layered diagram: wires are straight where the order within the layers permits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

GRID = 8  # heights are multiples of it, so that wires that could be straight are
SWEEPS = 10  # over all layers: alternating directions first, both neighbours in the last four


@dataclass(frozen=True)
class Node:
    """A node of a layer: a box, or the point where a wire passes.

    Parameters
    ----------
    width, height : float
        The height is a multiple of `GRID`.
    pins : tuple of (net, side, offset)
        Ends of nets, -1 on the left and 1 on the right, with the distance from the upper edge, a multiple of `GRID`.
    """

    width: float
    height: float
    pins: tuple[tuple[int, int, float], ...]

    @property
    def is_wire(self) -> bool:
        return self.height == 0


def heights(rows: Sequence[Sequence[int]], nodes: Mapping[int, Node]) -> dict[int, float]:
    """Upper edge of every node, as multiples of `GRID` from 0, with connected pins at equal height where possible."""
    top: dict[int, float] = {}
    for row in rows:
        top |= zip(row, spread([0.0] * len(row), [1.0] * len(row), row, nodes), strict=True)
    forwards, backwards = list(range(len(rows))), list(range(len(rows) - 1, -1, -1))
    for sweep in range(SWEEPS):
        side = 0 if sweep >= SWEEPS - 4 else -1 if sweep % 2 == 0 else 1
        for i in forwards if sweep % 2 == 0 else backwards:
            wanted, weights = [], []
            for node in rows[i]:
                found = _wishes(node, i, side, rows, nodes, top)
                wanted.append(found[(len(found) - 1) // 2][0] if found else top[node])
                weights.append(sum(w for _, w in found) if found else 0.01)
            top |= zip(rows[i], spread(wanted, weights, rows[i], nodes), strict=True)
    for order in (forwards, backwards):  # nodes connected on one side only follow; the others stay
        for i in order:
            leaves = [len({side for _, side, _ in nodes[node].pins}) == 1 for node in rows[i]]
            wishes = [_wishes(node, i, 0, rows, nodes, top) if leaf else [] for node, leaf in zip(rows[i], leaves, strict=True)]
            wanted = [wish[0][0] if wish else top[node] for node, wish in zip(rows[i], wishes, strict=True)]
            top |= zip(rows[i], spread(wanted, [1.0 if wish else 1e6 for wish in wishes], rows[i], nodes), strict=True)
    lowest = min(top.values(), default=0.0)
    return {node: y - lowest for node, y in top.items()}


def _wishes(
    node: int, layer: int, side: int, rows: Sequence[Sequence[int]], nodes: Mapping[int, Node], top: Mapping[int, float]
) -> list[tuple[float, float]]:
    """Upper edges that would straighten a wire of the node, with weights: passing wires weigh more, so that they have few bends."""
    found = []
    for net, own, offset in nodes[node].pins:
        for towards in (-1, 1):
            if own != towards or side == -towards or not 0 <= layer + towards < len(rows):
                continue
            for other in rows[layer + towards]:
                for its_net, its_side, its_offset in nodes[other].pins:
                    if its_net == net and its_side == -towards:
                        weight = 1.0 + 3.0 * (nodes[node].is_wire and nodes[other].is_wire)
                        found.append((top[other] + its_offset - offset, weight))
    return sorted(found)


def spread(wanted: Sequence[float], weights: Sequence[float], row: Sequence[int], nodes: Mapping[int, Node]) -> list[float]:
    """Heights closest to the wanted ones without overlap, in the given order: isotonic regression, on the grid.

    >>> nodes = {0: Node(40, 64, ()), 1: Node(40, 64, ())}
    >>> spread([0, 8], [1, 1], [0, 1], nodes)
    [-32.0, 48.0]
    """
    shift, offsets = 0.0, []
    for i, node in enumerate(row):
        if i:
            shift += nodes[row[i - 1]].height + (GRID if nodes[row[i - 1]].is_wire and nodes[node].is_wire else 2 * GRID)
        offsets.append(shift)
    blocks: list[list[float]] = []  # mean, weight, members: pool adjacent violators
    for y, weight, offset in zip(wanted, weights, offsets, strict=True):
        blocks.append([y - offset, weight, 1])
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            mean, w, n = blocks.pop()
            blocks[-1] = [
                (blocks[-1][0] * blocks[-1][1] + mean * w) / (blocks[-1][1] + w),
                blocks[-1][1] + w,
                blocks[-1][2] + n,
            ]
    free = [GRID * float(round(mean / GRID)) for mean, _, n in blocks for _ in range(int(n))]
    return [y + offset for y, offset in zip(free, offsets, strict=True)]
