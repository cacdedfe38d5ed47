"""Drawings of bond graphs with half arrows, causal strokes and bond numbers, through matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import networkx as nx
import numpy as np
import sympy as sp

from gearlib.bondgraph.causality import Causality
from gearlib.bondgraph.elements import GY, TF, Element, Junction, expression
from gearlib.bondgraph.graph import Bond, BondGraph

__all__ = ["draw"]

BOND_COLOUR, STROKE_COLOUR, NUMBER_COLOUR = "0.25", "#b22222", "#1f4e9c"


def draw(
    graph: BondGraph,
    positions: Mapping[Element, tuple[float, float]] | None = None,
    *,
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
        Where the elements stand, about two units of length apart; a spring layout otherwise.
    causality : Causality, optional
        Draws the causal strokes: the end with the stroke receives the effort. Elements with derivative causality are in
        the colour of the strokes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure of fitting size otherwise.
    scale : float
        Size of a unit of length, in inches, in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        The drawing; ``ax.figure.savefig(...)`` writes it to a file.
    """
    place = {element: np.asarray(xy, dtype=float) for element, xy in (positions or _layout(graph)).items()}
    if ax is None:
        import matplotlib.pyplot as plt

        spread = np.ptp(np.array(list(place.values())), axis=0)
        _, ax = plt.subplots(figsize=tuple(scale * (spread + 2)), layout="constrained")
    for bond in graph.bonds.values():
        _draw_bond(ax, bond, place[bond.tail], place[bond.head], causality)
    late = set(causality.derivative) if causality else set()
    for element, xy in place.items():
        numbers = {bond.number for bond in graph.at(element)}
        one_port = not isinstance(element, Junction | TF | GY)
        ax.text(
            *xy, _label(element, graph), ha="center", va="center", fontsize=9 if one_port else 10, zorder=3,
            weight="bold" if isinstance(element, Junction) else "normal",
            color=STROKE_COLOUR if one_port and numbers & late else "black",
        )  # fmt: skip
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.margins(0.04)
    return ax


def _label(element: Element, graph: BondGraph) -> str:
    if isinstance(element, Junction):
        return element.kind
    if isinstance(element, TF | GY):
        return f"{element.kind}\n${sp.latex(expression(element.modulus, ''), fold_short_frac=True)}$"
    return f"${element.kind}_{{{graph.at(element)[0].number}}}$"


def _gap(element: Element, direction: Any) -> float:
    """Room that an element's letters take at a bond's end, in units of length."""
    width, height = (0.2, 0.24) if isinstance(element, Junction) else (0.32, 0.26)
    if isinstance(element, TF | GY):
        width, height = 0.38, 0.36
    return float(1 / np.hypot(direction[0] / width, direction[1] / height))


def _draw_bond(ax: Any, bond: Bond, tail: Any, head: Any, causality: Causality | None) -> None:
    along = (head - tail) / np.linalg.norm(head - tail)
    across = np.array([-along[1], along[0]])
    start, stop = tail + _gap(bond.tail, along) * along, head - _gap(bond.head, along) * along
    ax.plot(*np.transpose([start, stop]), color=BOND_COLOUR, lw=1, zorder=1, solid_capstyle="butt")
    barb = stop - 0.2 * along - 0.11 * across
    ax.plot(*np.transpose([stop, barb]), color=BOND_COLOUR, lw=1, zorder=1)
    if causality is not None:
        end = stop if causality.effort_to[bond.number] is bond.head else start
        ax.plot(*np.transpose([end + 0.11 * across, end - 0.11 * across]), color=STROKE_COLOUR, lw=1.8, zorder=2)
    middle = (start + stop) / 2 + 0.14 * across
    ax.text(*middle, str(bond.number), ha="center", va="center", fontsize=6.5, color=NUMBER_COLOUR, zorder=4)


def _layout(graph: BondGraph) -> dict[Element, tuple[float, float]]:
    """Positions that keep bonds about equally long."""
    net = nx.Graph()
    net.add_nodes_from(graph.elements)
    net.add_edges_from((bond.tail, bond.head) for bond in graph.bonds.values())
    start = nx.circular_layout(net)
    found = nx.kamada_kawai_layout(net, pos=start) if nx.is_connected(net) else start
    lengths = [np.linalg.norm(found[a] - found[b]) for a, b in net.edges]
    return {element: (float(x), float(y)) for element, (x, y) in ((k, v * 1.3 / np.median(lengths)) for k, v in found.items())}
