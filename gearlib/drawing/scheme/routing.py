"""Routing of a stick diagram: symbols in columns and shafts on levels, with as few crossings as local search finds.

Planetary sets are shown by their upper half. Every shaft has a level: hollow shafts nest within the suns, drums around the rings. From
each symbol a vertical line leads to the level of its shaft. The order of the columns, the levels and the sides with the fewest
crossings are found by local search: from an initial arrangement, improving changes are accepted until there are none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from random import Random

import networkx as nx
import numpy as np

from gearlib.drawing.scheme.axes import Axes
from gearlib.drawing.scheme.train import Symbol

HOLLOW, DRUM, INSIDE = 9.0, 10.0, 4  # spacing of hollow shafts, and of drums; levels of hollow shafts
WIDTH = {
    "external": 42.0,
    "internal": 54.0,
    "planetary": 78.0,
    "double_planetary": 90.0,
    "inline": 76.0,
    "held": 40.0,
    "end": 64.0,
}
TRACK = {"planetary": 30.0, "double_planetary": 36.0, "inline": 32.0, "internal": 20.0}
CLEAR = 4.0  # distance of lines that do not touch, in the units of the picture
CROSSING = 1000.0  # price of a crossing in units of length: more than a detour within the drawing
OUTSIDE = 4000.0  # length of the lines that lead out of the drawing, past all of it
EFFORT = 2500  # changes that the search tries; fewer for long trains, where each takes longer
Line = tuple[float, float, float, float, int]  # x1, y1, x2, y2, shaft


@dataclass(frozen=True)
class Choice:
    """Decision variables: order of the columns, level of each shaft (from -1 downwards: drums), and a side for each symbol."""

    order: tuple[int, ...]
    level: tuple[int, ...]
    turned: tuple[bool, ...]
    second: tuple[bool, ...]


@dataclass(frozen=True)
class Place:
    """Position of a symbol: its column, and the height of its axis."""

    x: float
    y: float
    turned: bool


@dataclass(frozen=True)
class Routing:
    """Positions of all symbols, and the lines of all shafts.

    Parameters
    ----------
    places : tuple of Place
    lines : tuple of (x1, y1, x2, y2, shaft)
    spines : dict of int to (y, meeting points)
        Level of each shaft, and the points where symbols meet it: (symbol, flange, x).
    crossings : int
        Lines of different shafts that cross or touch.
    enclosed : int
        Lines that separate drives and loads from the outside.
    """

    places: tuple[Place, ...]
    lines: tuple[Line, ...]
    spines: dict[int, tuple[float, tuple[tuple[int, int, float], ...]]]
    crossings: int
    enclosed: int


def routed(axes: Axes) -> Routing:
    """The best arrangement found by local search; deterministic."""
    symbols = axes.symbols
    search = RouteSearch(axes)
    start = search.first()
    best, least = start, search.cost(start)
    random = Random(1)
    tries = max(1, EFFORT * 12 // max(len(symbols), 1) ** 2) if len(symbols) > 40 else EFFORT
    for attempt in range(4):
        choice = start if attempt == 0 else search.shaken(best, random)
        found, price, tries = search.improved(choice, random, tries)
        if price < least:
            best, least = found, price
        if least < CROSSING or tries <= 0:
            break
    return search.drawn(best)


class RouteSearch:
    """Cost function and neighbourhood of arrangements of one train."""

    def __init__(self, axes: Axes) -> None:
        self.axes = axes
        self.on_ring = _held_on_rings(axes.symbols)
        self.columns = [i for i in range(len(axes.symbols)) if i not in self.on_ring]
        self.reach = [frozenset(axes.of[s] for s in symbol.shafts) for symbol in axes.symbols]
        self.width = [WIDTH[symbol.kind] for symbol in axes.symbols]
        n = max(axes.of, default=-1) + 1
        self.outer = [0.0] * n
        self.top = [16.0] * n
        for symbol in axes.symbols:
            for k, shaft in enumerate(symbol.shafts):
                at = axes.of[shaft]
                if symbol.kind in ("planetary", "double_planetary"):
                    self.outer[at] = max(self.outer[at], symbol.radii[1] + 14.0)
                elif symbol.kind in ("external", "internal"):
                    self.top[at] = max(self.top[at], symbol.radii[k] + 6.0)
        count = [sum(of == axis for of in axes.of) for axis in range(n)]
        self.levels = [
            [*range(min(INSIDE, count[of])), *(range(-1, -1 - min(5, count[of]), -1) if self.outer[of] else ())]
            for of in axes.of
        ]

    def first(self) -> Choice:
        """Initial arrangement: columns along the train from its first drive; hollow shafts where possible."""
        symbols = self.axes.symbols
        graph = nx.Graph()
        graph.add_nodes_from(("symbol", i) for i in self.columns)
        for i in self.columns:
            graph.add_edges_from((("symbol", i), ("shaft", s)) for s in symbols[i].shafts)
        order: list[int] = []
        starts = sorted(self.columns, key=lambda i: (symbols[i].kind != "end", i))
        for first in starts:
            if first not in order:
                order += [i for kind, i in nx.bfs_tree(graph, ("symbol", first)) if kind == "symbol" and i not in order]
        level = [0] * len(self.axes.of)
        for symbol in symbols:
            if symbol.kind in ("planetary", "double_planetary"):
                level[symbol.shafts[2]] = -1
        return Choice(tuple(order), tuple(level), (False,) * len(symbols), (False,) * len(symbols))

    def shaken(self, choice: Choice, random: Random) -> Choice:
        """Another initial arrangement, partly randomised."""
        order = list(choice.order)
        for _ in range(2):
            order.insert(random.randrange(len(order)), order.pop(random.randrange(len(order))))
        level = tuple(random.choice(self.levels[s]) if random.random() < 0.3 else now for s, now in enumerate(choice.level))
        turned = tuple(side != (random.random() < 0.2) for side in choice.turned)
        return replace(choice, order=tuple(order), level=level, turned=turned)

    def changes(self, choice: Choice) -> Iterator[Choice]:
        """All arrangements one change away."""
        for shaft, levels in enumerate(self.levels):
            for level in levels:
                if level != choice.level[shaft]:
                    yield replace(choice, level=(*choice.level[:shaft], level, *choice.level[shaft + 1 :]))
            for other in range(shaft):
                if self.axes.of[shaft] == self.axes.of[other] and choice.level[shaft] != choice.level[other]:
                    swapped = list(choice.level)
                    swapped[shaft], swapped[other] = swapped[other], swapped[shaft]
                    yield replace(choice, level=tuple(swapped))
        for i, symbol in enumerate(self.axes.symbols):
            if symbol.kind in TRACK or symbol.kind == "held":
                yield replace(choice, turned=_switched(choice.turned, i))
            if symbol.kind == "inline":
                yield replace(choice, second=_switched(choice.second, i))
        for i in range(len(choice.order)):
            rest = (*choice.order[:i], *choice.order[i + 1 :])
            for j in range(len(choice.order)):
                if i != j:
                    yield replace(choice, order=(*rest[:j], choice.order[i], *rest[j:]))

    def improved(self, choice: Choice, random: Random, tries: int) -> tuple[Choice, float, int]:
        price = self.cost(choice)
        better = True
        while better and tries > 0:
            better = False
            around = list(self.changes(choice))
            random.shuffle(around)
            for other in around:
                tries -= 1
                cost = self.cost(other)
                if cost < price - 1e-9:
                    choice, price, better = other, cost, True
                    break
                if tries <= 0:
                    break
        return choice, price, tries

    def cost(self, choice: Choice) -> float:
        found = self.drawn(choice)
        length = sum(abs(x2 - x1) + 0.6 * abs(y2 - y1) for x1, y1, x2, y2, _ in found.lines)
        heights = sum(4.0 * abs(level) for level in choice.level)
        return CROSSING * (found.crossings + 0.2 * found.enclosed) + length + heights

    def drawn(self, choice: Choice) -> Routing:
        """Positions and lines of an arrangement."""
        axes, symbols = self.axes, self.axes.symbols
        x = self.columns_of(choice)
        base = [axes.height[axis] for axis in axes.of]
        rise = [
            HOLLOW * level if level >= 0 else self.outer[axes.of[s]] + DRUM * (-1 - level)
            for s, level in enumerate(choice.level)
        ]
        top = list(self.top)
        for s, h in enumerate(rise):
            top[axes.of[s]] = max(top[axes.of[s]], h + 14.0, self.outer[axes.of[s]])
        lines: list[Line] = []
        bodies: list[Line] = []
        places: list[Place] = []
        meet: dict[int, list[tuple[int, int, float]]] = {s: [] for s in range(len(axes.of))}

        def lead(i: int, flange: int, at: float, y: float) -> None:
            """Vertical line from a symbol to the level of its shaft."""
            shaft = symbols[i].shafts[flange]
            level = base[shaft] - rise[shaft]
            meet[shaft].append((i, flange, at))
            if abs(level - y) > 1e-9:
                lines.append((at, y, at, level, shaft))

        for i, symbol in enumerate(symbols):
            at, turned, shafts = x[i], choice.turned[i], symbol.shafts
            side = -1.0 if turned else 1.0
            y = base[shafts[0]]
            if symbol.kind in ("external", "internal"):
                self._pair(i, symbol, at, side, base, rise, bodies, lines, meet)
            elif symbol.kind in ("planetary", "double_planetary"):
                sun, carrier, ring = shafts
                r, R = symbol.radii
                pin, track = y - (r + R) / 2, at + side * TRACK[symbol.kind]
                bodies += [
                    (at, y - r, at, y - r + 3, sun),
                    (at, y - R + 4, at, y - r - 4, carrier),
                    (at - 10, y - R, at + 10, y - R, ring),
                ]
                lines.append((at, pin, track, pin, carrier))
                lead(i, 1, track, pin)
                other = at - side * TRACK[symbol.kind]
                if rise[sun] < r:
                    lead(i, 0, at, y - r)
                else:
                    lines.append((at, y - r + 3, other, y - r + 3, sun))
                    lead(i, 0, other, y - r + 3)
                if rise[ring] > R:
                    lead(i, 2, at, y - R)
                else:
                    lines.append((at, y - R, other, y - R, ring))
                    lead(i, 2, other, y - R)
            elif symbol.kind == "inline":
                chosen = shafts[choice.second[i]]
                y = base[chosen] - rise[chosen]
                for k in range(len(shafts)):
                    towards = at + (-side if k == 0 else side) * TRACK["inline"]
                    height = y + 8.0 * (k - 1) if k > 1 else y
                    lines.append((at + (-side if k == 0 else side) * 24.0, height, towards, height, shafts[k]))
                    lead(i, k, towards, height)
                bodies += [(at - 8, y - 9, at - 8, y + 9, shafts[turned]), (at + 8, y - 9, at + 8, y + 9, shafts[1 - turned])]
            elif symbol.kind == "held":
                axis = axes.of[shafts[0]]
                over = self.on_ring.get(i)
                if over is not None:
                    y, turned = y - top[axis], False
                    from_ring = base[shafts[0]] - symbols[over].radii[1]
                    lines.append((at, from_ring, at, y, shafts[0]))
                    meet[shafts[0]].append((i, 0, at))
                elif turned and rise[shafts[0]] < self.outer[axis] + 1:
                    y += 26.0
                    lead(i, 0, at, y)
                else:
                    y, turned = y - top[axis], False
                    lead(i, 0, at, y)
            else:
                y -= rise[shafts[0]]
                lead(i, 0, at, y)
            places.append(Place(at, y, turned))
        outwards = self._ends(places, meet, bodies)
        spines = {}
        for shaft, points in meet.items():
            if points:
                level, ends = base[shaft] - rise[shaft], [p[2] for p in points]
                lines.append((min(ends), level, max(ends), level, shaft))
                spines[shaft] = (level, tuple(sorted(points, key=lambda p: p[2])))
        return Routing(tuple(places), tuple(lines), spines, *crossings(lines, bodies, outwards))

    def _ends(self, places: list[Place], meet: dict[int, list[tuple[int, int, float]]], bodies: list[Line]) -> list[Line]:
        """Turn drives and loads away from their shafts; the returned lines from them to the outside should not be crossed."""
        outwards = []
        for i, symbol in enumerate(self.axes.symbols):
            if symbol.kind == "end":
                at, shaft = places[i], symbol.shafts[0]
                turned = sum(p[2] for p in meet[shaft]) / len(meet[shaft]) < at.x
                places[i] = replace(at, turned=turned)
                away = 1.0 if turned else -1.0
                bodies += [(at.x + away * dx, at.y - 14, at.x + away * dx, at.y + 14, shaft) for dx in (0.0, 24.0)]
                if not all(p[2] <= at.x if turned else p[2] >= at.x for p in meet[shaft]):
                    bodies.append((at.x + 6 * away, at.y, at.x + 6 * away, at.y, -1 - shaft))
                outwards.append((at.x + 6 * away, at.y, at.x + OUTSIDE * away, at.y, shaft))
        return outwards

    def _pair(
        self, i: int, symbol: Symbol, at: float, side: float, base: Sequence[float], rise: Sequence[float], bodies: list[Line],
        lines: list[Line], meet: dict[int, list[tuple[int, int, float]]],
    ) -> None:  # fmt: skip
        for k, (shaft, r) in enumerate(zip(symbol.shafts, symbol.radii, strict=True)):
            y, h = base[shaft], rise[shaft]
            web = at + side * TRACK["internal"] if symbol.kind == "internal" and k == 0 else at
            meet[shaft].append((i, k, web))
            if web != at:
                bodies += [(at - 6, y - r, web, y - r, shaft), (at - 6, y + r, web, y + r, shaft)]
            if h > r:  # a drum cannot carry it: the line would lead away from the axis
                bodies.append((web, y - r, web, y - r, -1 - shaft))
            bodies += [(web, y - r + CLEAR, web, y - h, shaft), (web, y + h, web, y + r - CLEAR, shaft)]
            if h:
                lines.append((web - 12, y + h, web + 12, y + h, shaft))

    def columns_of(self, choice: Choice) -> list[float]:
        """Columns as narrow as their symbols allow; symbols on different axes may share a position."""
        x = [0.0] * len(self.width)
        done: list[tuple[float, frozenset[int]]] = []  # right edges
        for i in choice.order:
            reach, half = self.reach[i], self.width[i] / 2
            x[i] = max([edge + half for edge, axes in done if not reach.isdisjoint(axes)], default=0.0)
            done.append((x[i] + half, reach))
        for i, over in self.on_ring.items():
            x[i] = x[over]
        return x


def _switched(values: tuple[bool, ...], i: int) -> tuple[bool, ...]:
    return (*values[:i], not values[i], *values[i + 1 :])


def _held_on_rings(symbols: Sequence[Symbol]) -> dict[int, int]:
    """Brakes and fixed supports directly above a ring that they hold, with the set of that ring."""
    found: dict[int, int] = {}
    for i, symbol in enumerate(symbols):
        if symbol.kind == "held":
            rings = [
                j for j, s in enumerate(symbols)
                if s.kind in ("planetary", "double_planetary") and s.shafts[2] == symbol.shafts[0] and j not in found.values()
            ]  # fmt: skip
            if rings:
                found[i] = rings[-1]
    return found


def crossings(lines: list[Line], bodies: list[Line], outwards: list[Line]) -> tuple[int, int]:
    """Number of crossings, contacts or overlaps between lines and bodies of different shafts, and of lines that block the outside."""
    x1, y1, x2, y2, shaft = np.array(lines + bodies + outwards).T
    x1, x2 = np.minimum(x1, x2), np.maximum(x1, x2) + CLEAR
    y1, y2 = np.minimum(y1, y2), np.maximum(y1, y2) + CLEAR
    over = (x1[:, None] < x2) & (x1 < x2[:, None]) & (y1[:, None] < y2) & (y1 < y2[:, None]) & (shaft[:, None] != shaft)
    inside = len(lines) + len(bodies)
    return int(over[:inside, :inside].sum()) // 2, int(over[inside:, : len(lines)].sum())
