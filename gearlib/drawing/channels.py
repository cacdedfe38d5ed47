"""Channel routing: wires between layers, with one vertical segment per net and channel, each on a track of its own.

References
----------
D. N. Deutsch, "A dogleg channel router", Design Automation Conference (1976) 425-433. https://doi.org/10.1145/800146.804843
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import networkx as nx

TRACK = 8.0  # between vertical segments
MARGIN = 12.0  # between a layer and the first track
NUDGE = 3.0  # distance of two wires that would overlap, in the units of the picture

Segment = tuple[float, float, float, float]


@dataclass(frozen=True)
class Channel:
    """Width of a channel, and the tracks of its nets.

    Parameters
    ----------
    width : float
    track : dict of int to float
        Position of a net's vertical segment, from the channel's left edge; straight nets have none.
    nudged : frozenset of (net, y)
        Right ends shifted by `NUDGE`, since two nets would overlap otherwise.
    """

    width: float
    track: dict[int, float]
    nudged: frozenset[tuple[int, float]]


def channel(left: Mapping[int, Sequence[float]], right: Mapping[int, Sequence[float]], beside: Mapping[int, float]) -> Channel:
    """Assign the nets of a channel to tracks.

    Parameters
    ----------
    left, right : mapping of int to sequence of float
        Heights at which nets end at the left and right edges.
    beside : mapping of int to float
        Heights of wires in the gutter below or above, for nets that continue in another row of layers.
    """
    spans: dict[int, tuple[float, float]] = {}
    for net in dict.fromkeys([*left, *right, *beside]):
        ends = [*left.get(net, ()), *right.get(net, ()), *([beside[net]] if net in beside else ())]
        straight = len(ends) == 2 and ends[0] == ends[1] and net in left and net in right
        if not straight:
            spans[net] = min(ends), max(ends)
    before = nx.DiGraph()  # the net that ends at a height on the left precedes the one that ends there on the right
    before.add_nodes_from(spans)
    at = {y: net for net, ends in left.items() for y in ends if net in spans}
    nudged: set[tuple[int, float]] = set()
    for net, heights in right.items():
        for y in heights:
            other = at.get(y, net)
            if net in spans and other != net:
                if nx.has_path(before, net, other):
                    nudged.add((net, y))
                else:
                    before.add_edge(other, net)
    falls = {n: (left[n][0] < spans[n][1] if n in left else False) for n in spans}
    rank = {n: (-left[n][0] if falls[n] else left[n][0]) if n in left else spans[n][0] for n in spans}
    level: dict[int, int] = {}
    taken: list[list[tuple[float, float]]] = []
    for net in nx.lexicographical_topological_sort(before, key=lambda n: (rank[n], n)):
        low, high = spans[net]
        place = max((level[p] + 1 for p in before.predecessors(net)), default=0)
        while place < len(taken) and any(low - GAP < b and a < high + GAP for a, b in taken[place]):
            place += 1
        while place >= len(taken):
            taken.append([])
        taken[place].append((low, high))
        level[net] = place
    width = 2 * MARGIN + TRACK * max(len(taken) - 1, 0)
    return Channel(width, {net: MARGIN + TRACK * place for net, place in level.items()}, frozenset(nudged))


GAP = 5.0  # between vertical segments on one track


def wires(
    found: Channel, x: float, left: Mapping[int, Sequence[float]], right: Mapping[int, Sequence[float]],
    beside: Mapping[int, float],
) -> dict[int, list[Segment]]:  # fmt: skip
    """Segments, by net, of a channel whose left edge is at ``x``."""
    end = x + found.width
    pieces: dict[int, list[Segment]] = {}
    for net in dict.fromkeys([*left, *right, *beside]):
        here = pieces.setdefault(net, [])
        if net not in found.track:
            here.append((x, left[net][0], end, left[net][0]))
            continue
        track = x + found.track[net]
        ends = [*left.get(net, ()), *([beside[net]] if net in beside else ())]
        here += [(x, y, track, y) for y in left.get(net, ())]
        for y in right.get(net, ()):
            shift = NUDGE if (net, y) in found.nudged else 0.0
            ends.append(y + shift)
            if shift:
                here.append((end - NUDGE, y, end - NUDGE, y + shift))
                here.append((end - NUDGE, y, end, y))
            here.append((track, y + shift, end - (NUDGE if shift else 0.0), y + shift))
        if min(ends) < max(ends):
            here.append((track, min(ends), track, max(ends)))
    return pieces
