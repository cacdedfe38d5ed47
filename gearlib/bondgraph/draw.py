"""Drawing of bond graphs with half arrows, causal strokes and bond numbers, using matplotlib."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from textwrap import wrap
from typing import Any

import networkx as nx
import numpy as np
import sympy as sp

from gearlib.arguments import check_axes, real, reals, shown
from gearlib.bondgraph.causality import Causality
from gearlib.bondgraph.elements import GY, TF, Element, Junction, expression
from gearlib.bondgraph.graph import Bond, BondGraph, check_graph
from gearlib.errors import ArgumentError
from gearlib.optional import optional

__all__ = ["draw"]

BOND_COLOUR, STROKE_COLOUR, NUMBER_COLOUR = "0.25", "#b22222", "#1f4e9c"
NAME_COLOUR = "#2e6b2e"
PLAIN = {"facecolor": "white", "edgecolor": "none", "pad": 0.3}  # behind names, which may lie on bonds


def draw(
    graph: BondGraph,
    positions: Mapping[Element, tuple[float, float]] | None = None,
    *,
    routes: Mapping[int, Sequence[tuple[float, float]]] | None = None,
    causality: Causality | None = None,
    ax: Any = None,
    scale: float = 1.0,
) -> Any:
    """Draw a bond graph.

    Parameters
    ----------
    graph : BondGraph
        The graph.
    positions : mapping, optional
        Positions of the elements, about two units apart; by default a spring layout.
    routes : mapping, optional
        Points that a bond passes through, from tail to head, by bond number; by default straight.
    causality : Causality, optional
        Causal strokes to draw: the end with the stroke receives the effort. Elements with derivative causality are drawn in the colour
        of the strokes.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into; by default a new figure of suitable size.
    scale : float
        Inches per unit of length, in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        Use ``ax.figure.savefig(...)`` to write it to a file.
    """
    check_graph(graph)
    layout = {e: [xy] for e, xy in _layout(graph).items()} if positions is None else positions
    place = {element: points[0] for element, points in _points("positions", layout, positions is not None).items()}
    way = {} if routes is None else _points("routes", routes)
    if missing := [element for element in graph.elements if element not in place]:
        raise ArgumentError(f"positions has none for {graph.label(missing[0])}; expected one for each element")
    if not (causality is None or isinstance(causality, Causality)):
        raise ArgumentError(f"causality is {shown(causality)}; expected the result of assign_causality")
    expected = "a positive number of inches, up to 100"
    if not 0 < (scale := real("scale", scale, expected)) <= 100:
        raise ArgumentError(f"scale is {shown(scale)}; expected {expected}")
    if ax is None:
        plt = optional("matplotlib.pyplot")

        spread = np.ptp(np.array(list(place.values())), axis=0)
        _, ax = plt.subplots(figsize=tuple(scale * (spread + 2)), layout="constrained")
    check_axes(ax, 1, "ax")
    lines = {n: [place[bond.tail], *way.get(n, ()), place[bond.head]] for n, bond in graph.bonds.items()}
    for bond in graph.bonds.values():
        _draw_bond(ax, bond, lines[bond.number], (_room(bond.tail, graph), _room(bond.head, graph)), causality)
    late = set(causality.derivative) if causality else set()
    for element, xy in place.items():
        numbers = {bond.number for bond in graph.at(element)}
        one_port = not isinstance(element, Junction | TF | GY)
        ax.text(
            *xy, _label(element, graph), ha="center", va="center", fontsize=9 if one_port else 10, zorder=3,
            weight="bold" if isinstance(element, Junction) else "normal",
            color=STROKE_COLOUR if one_port and numbers & late else "black",
        )  # fmt: skip
        if isinstance(element, Junction) and element.name:
            _draw_name(ax, element, xy, [_leaving(lines[b.number], b.tail is element) for b in graph.at(element)])
    ax.set_aspect("equal")
    ax.set_axis_off()
    # text does not affect axis limits: half a unit around the elements makes room for it
    ends = np.array(list(place.values()))
    ax.update_datalim([ends.min(axis=0) - 0.5, ends.max(axis=0) + 0.5])
    ax.margins(0.01)
    ax.autoscale_view()
    return ax


def _points(name: str, given: Any, single: bool = False) -> dict[Any, Any]:
    """Points, shape (n, 2), of elements or bonds; ``single`` ones are given without an enclosing list."""
    expected = "points (x, y) by element" if name == "positions" else "lists of points (x, y) by number of bond"
    try:
        found = {key: reals(name, [value] if single else value, expected) for key, value in dict(given).items()}
    except Exception:  # not a mapping of points; a user's object may fail
        found = {None: np.empty(0)}
    if any(points.ndim != 2 or points.shape[1] != 2 for points in found.values()):
        raise ArgumentError(f"{name} is {shown(given)}; expected {expected}")
    return found


def _label(element: Element, graph: BondGraph) -> str:
    if isinstance(element, Junction):
        return element.kind
    if isinstance(element, TF | GY):
        return f"{element.kind}\n${sp.latex(expression(element.modulus, 'modulus'), fold_short_frac=True)}$"
    return f"${element.kind}_{{{graph.at(element)[0].number}}}$"


def _room(element: Element, graph: BondGraph) -> tuple[float, float]:
    """Half width and height reserved for an element at a bond's end, in units of length.

    Around a junction it grows with the number of bonds, so that the causal strokes of neighbours do not overlap.
    """
    if isinstance(element, Junction):
        crowd = max(1.0, len(graph.at(element)) / 4)
        return 0.2 * crowd, 0.24 * crowd
    return (0.3 + 0.045 * len(str(element.modulus)), 0.38) if isinstance(element, TF | GY) else (0.36, 0.26)


def _gap(room: tuple[float, float], direction: Any) -> float:
    """Distance of a bond's end from the centre of its element."""
    return float(1 / np.hypot(direction[0] / room[0], direction[1] / room[1]))


def _leaving(points: list[Any], from_tail: bool) -> float:
    """Angle at which a bond leaves its tail or its head."""
    x, y = _direction(points[0], points[1]) if from_tail else _direction(points[-1], points[-2])
    return float(np.arctan2(y, x))


def _draw_name(ax: Any, junction: Junction, xy: Any, angles: list[float]) -> None:
    """Place a junction's name where its bonds leave most room; preferably beside it rather than above or below."""
    choices = np.radians([0, 180, 45, 135, 225, 315, 90, 270])
    free = [min(abs((choice - angle + np.pi) % (2 * np.pi) - np.pi) for angle in angles) for choice in choices]
    best = choices[int(np.argmax(np.round(free, 1)))]
    side = {0: "center", 1: "left", -1: "right"}[int(np.sign(np.round(np.cos(best), 6)))]
    level = {0: "center", 1: "bottom", -1: "top"}[int(np.sign(np.round(np.sin(best), 6)))]
    offset = np.array([0.2, 0.3]) * np.sign(np.round([np.cos(best), np.sin(best)], 6))
    name = "\n".join(wrap(junction.name, 7, break_long_words=False))
    if level == "center":
        offset[0] *= 1.5  # clear of the strokes of bonds that leave at 45 degrees
    ax.text(*(xy + offset), name, ha=side, va=level, fontsize=8, style="italic", color=NAME_COLOUR, zorder=2.5, bbox=PLAIN)


def _draw_bond(
    ax: Any, bond: Bond, points: list[Any], rooms: tuple[tuple[float, float], tuple[float, float]], causality: Causality | None
) -> None:
    first, last = _direction(points[0], points[1]), _direction(points[-2], points[-1])
    points = [points[0] + _gap(rooms[0], first) * first, *points[1:-1], points[-1] - _gap(rooms[1], last) * last]
    across = _turned(last)
    barb = points[-1] - 0.2 * last - 0.11 * across
    ax.plot(*np.transpose([*points, barb]), color=BOND_COLOUR, lw=1, zorder=1, solid_capstyle="butt")
    if causality is not None:
        at_head = causality.effort_to[bond.number] is bond.head
        end, half = (points[-1], 0.11 * across) if at_head else (points[0], 0.11 * _turned(first))
        ax.plot(*np.transpose([end + half, end - half]), color=STROKE_COLOUR, lw=1.8, zorder=2)
    start, stop = max(pairwise(points), key=lambda ends: float(np.linalg.norm(ends[1] - ends[0])))
    middle = (start + stop) / 2 + 0.19 * _turned(_direction(start, stop))
    ax.text(*middle, str(bond.number), ha="center", va="center", fontsize=7.5, color=NUMBER_COLOUR, zorder=4)


def _direction(start: Any, stop: Any) -> Any:
    return (stop - start) / np.linalg.norm(stop - start)


def _turned(direction: Any) -> Any:
    """The direction rotated left by a right angle."""
    return np.array([-direction[1], direction[0]])


def _layout(graph: BondGraph) -> dict[Element, tuple[float, float]]:
    """Layout with bonds of similar length."""
    net = nx.Graph()
    net.add_nodes_from(graph.elements)
    net.add_edges_from((bond.tail, bond.head) for bond in graph.bonds.values())
    start = nx.circular_layout(net)
    found = nx.kamada_kawai_layout(net, pos=start) if nx.is_connected(net) else start
    lengths = [np.linalg.norm(found[a] - found[b]) for a, b in net.edges]
    return {element: (float(x), float(y)) for element, (x, y) in ((k, v * 1.3 / np.median(lengths)) for k, v in found.items())}
