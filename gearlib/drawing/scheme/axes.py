"""Axes of a train: coaxial shafts, centre distances, and the sizes of gears in the drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import networkx as nx

from gearlib.drawing.scheme.train import Symbol, Train

LARGEST, SMALLEST = 88.0, 13.0  # radii of gears, pixels
PAIR = 104.0  # centre distance of two axes where only ratios are known
SUN = (32.0, 0.62)  # least radius of a sun, and its largest relative to its ring
APART = 46.0  # minimum distance of axes


@dataclass(frozen=True)
class Axes:
    """Positions of the axes, and symbols with the sizes of their gears.

    Parameters
    ----------
    symbols : tuple of Symbol
        With radii in pixels; a gear pair on a single axis is drawn as a box.
    of : tuple of int
        Axis of each shaft.
    height : tuple of float
        Distance of each axis below the first, pixels.
    """

    symbols: tuple[Symbol, ...]
    of: tuple[int, ...]
    height: tuple[float, ...]


def axes_of(train: Train) -> Axes:
    """Determine the axes: shafts of planetary sets and couplings are coaxial; gear pairs connect axes."""
    graph = nx.Graph()
    graph.add_nodes_from(range(train.shafts))
    for symbol in train.symbols:
        if symbol.kind in ("planetary", "double_planetary", "inline"):
            graph.add_edges_from((symbol.shafts[0], other) for other in symbol.shafts[1:])
    of = [0] * train.shafts
    for axis, shafts in enumerate(sorted(sorted(c) for c in nx.connected_components(graph))):
        for shaft in shafts:
            of[shaft] = axis
    symbols = [
        _boxed(s) if s.kind in ("external", "internal") and len({of[i] for i in s.shafts}) == 1 else s for s in train.symbols
    ]
    sizes = [r for s in symbols if s.in_metres for r in s.radii]
    scale = LARGEST / max(sizes) if sizes and max(sizes) > 0 else 0.0
    symbols = [_sized(s, scale) for s in symbols]
    height = _heights(symbols, of)
    return Axes(tuple(_fitted(s, of, height) for s in symbols), tuple(of), tuple(height))


def _boxed(symbol: Symbol) -> Symbol:
    ratio = symbol.radii[1] / symbol.radii[0]
    return replace(
        symbol,
        kind="inline",
        icon="ratio",
        radii=(),
        label=f"{symbol.name}: {-ratio if symbol.kind == 'external' else ratio:.4g}",
    )


def _sized(symbol: Symbol, scale: float) -> Symbol:
    """Scale radii to pixels."""
    if not symbol.radii:
        return symbol
    a, b = symbol.radii
    if symbol.kind in ("planetary", "double_planetary"):
        ring = max(b * scale, 60.0) if symbol.in_metres else LARGEST
        sun = min(max(ring * a / b if b else 0.0, SUN[0]), SUN[1] * ring)
        return replace(symbol, radii=(sun, ring))
    size = scale if symbol.in_metres else PAIR / (a + b)
    return replace(symbol, radii=(a * size, b * size))


def _heights(symbols: Sequence[Symbol], of: Sequence[int]) -> list[float]:
    """Place each axis below, or above, an axis that it meshes with, at the distance given by the radii where known."""
    count = max(of, default=-1) + 1
    size = [sum(of[i] == axis for s in symbols for i in s.shafts) for axis in range(count)]
    height: dict[int, float] = {}
    pairs = [s for s in symbols if s.kind in ("external", "internal")]
    above = {of[i] for s in symbols if s.kind in ("planetary", "double_planetary") for i in s.shafts}
    ends = [of[s.shafts[0]] for s in symbols if s.kind == "end"]
    while len(height) < count:
        left = [axis for axis in range(count) if axis not in height]
        first = next((axis for axis in ends if axis in left), -1)
        start = max(left, key=lambda axis: (axis in above, axis == first, size[axis], -axis))
        height[start] = max(height.values()) + 3 * LARGEST if height else 0.0
        waiting = [start]
        while waiting:
            axis = waiting.pop(0)
            for pair in pairs:
                ends = [of[i] for i in pair.shafts]
                if axis not in ends:
                    continue
                other = ends[1 - ends.index(axis)]
                if other in height:
                    continue
                distance = _distance(pair)
                free = [height[axis] + sign * times * distance for times in (1, 1.4, 1.9, 2.5, 3.2, 4) for sign in (1, -1)]
                if axis in above:  # the upper half is occupied by planetary sets
                    free = free[::2] + free[1::2]
                height[other] = next(
                    (y for y in free if all(abs(y - h) >= APART for h in height.values())), max(height.values()) + distance
                )
                waiting.append(other)
    return [height[axis] for axis in range(count)]


def _distance(pair: Symbol) -> float:
    a, b = pair.radii
    return max(a + b if pair.kind == "external" else abs(a - b), APART)


def _fitted(symbol: Symbol, of: Sequence[int], height: Sequence[float]) -> Symbol:
    """A gear pair scaled to the distance of its axes."""
    if symbol.kind not in ("external", "internal"):
        return symbol
    apart = abs(height[of[symbol.shafts[0]]] - height[of[symbol.shafts[1]]])
    a, b = symbol.radii
    if symbol.kind == "internal":
        small = max(b * apart / max(abs(a - b), 1e-9), SMALLEST)
        return replace(symbol, radii=(apart + small, small))
    first = min(max(apart * a / (a + b), SMALLEST), apart - SMALLEST)
    return replace(symbol, radii=(first, apart - first))
