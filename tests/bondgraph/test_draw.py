"""Drawings: all bonds and elements are there, strokes and half arrows are where they belong, no text is on another."""

from __future__ import annotations

import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex

from gearlib.bondgraph import BondGraph, C, I, One, R, Se, assign_causality, draw
from gearlib.bondgraph.draw import BOND_COLOUR, STROKE_COLOUR
from gearlib.bondgraph.paper import PREFERENCE, Figure, fixed_axis_unit, planetary_unit, single_loop_train
from gearlib.bondgraph.structure_diagram import StructureDiagram, Unit, single_loop, unit_diagram
from gearlib.errors import ArgumentError, ConnectionError, NameLookupError


@pytest.mark.parametrize("figure", [fixed_axis_unit(), planetary_unit(), single_loop_train()], ids=["P", "X", "XP"])
def test_figures_of_the_paper(figure: Figure) -> None:
    graph = figure.graph
    storage = graph.of_kind(I, C)
    causality = assign_causality(graph, [bond for bond in (*PREFERENCE, 81) if bond in storage])
    ax = figure.draw(causality)
    texts = {text.get_text() for text in ax.texts}
    assert {str(number) for number in graph.bonds} <= texts
    assert {f"${graph.element(n).kind}_{{{n}}}$" for n in storage} <= texts
    lines = [to_hex(line.get_color()) for line in ax.lines]
    assert lines.count(to_hex(BOND_COLOUR)) == lines.count(to_hex(STROKE_COLOUR)) == len(graph.bonds)
    ax.figure.canvas.draw()
    boxes = [text.get_window_extent().shrunk(0.9, 0.8) for text in ax.texts]
    overlaps = [(a, b) for a in range(len(boxes)) for b in range(a) if boxes[a].overlaps(boxes[b])]
    assert [(ax.texts[a].get_text(), ax.texts[b].get_text()) for a, b in overlaps] == []
    plt.close(ax.figure)


def test_half_arrow_at_the_head_and_stroke_where_the_effort_goes() -> None:
    v = One("v")
    graph = BondGraph((1, Se(), v), (2, v, I()))
    source, inertia = graph.element(1), graph.element(2)
    ax = draw(graph, {source: (0, 0), v: (2, 0), inertia: (4, 0)}, causality=assign_causality(graph))
    bonds = [line for line in ax.lines if to_hex(line.get_color()) == to_hex(BOND_COLOUR)]
    strokes = [line for line in ax.lines if to_hex(line.get_color()) == to_hex(STROKE_COLOUR)]
    for bond, stroke, head in zip(bonds, strokes, (2.0, 4.0), strict=True):
        x = np.asarray(bond.get_xdata())
        assert head - 0.5 < x[1] < head
        assert x[0] < x[2] < x[1]
        assert np.allclose(stroke.get_xdata(), x[1])  # both efforts go along the half arrow
    plt.close(ax.figure)


def test_layout_without_positions_keeps_elements_apart() -> None:
    v = One("v")
    ax = draw(BondGraph((1, Se(), v), (2, v, I()), (3, v, C()), (4, v, R())))
    places = np.array([text.get_position() for text in ax.texts if "$" in text.get_text() or text.get_text() == "1"])
    distances = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert distances[~np.eye(len(places), dtype=bool)].min() > 0.3
    plt.close(ax.figure)


def test_bond_graphs_do_not_import_matplotlib() -> None:
    code = "import sys, gearlib.bondgraph.paper, gearlib.bondgraph.structure_diagram; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, env={"PYTHONPATH": ":".join(sys.path)}).returncode == 0


@pytest.mark.parametrize(("kind", "freedom"), [("XP", 1), ("PX", 1), ("XX", 2)])
def test_single_loops(kind: str, freedom: int) -> None:
    diagram = single_loop(kind)
    assert (diagram.loops, diagram.degrees_of_freedom) == (1, freedom)
    ax = diagram.draw()
    assert {f"${name}$" for name in diagram.nodes} <= {text.get_text() for text in ax.texts}
    squares = sum(type(patch).__name__ == "Rectangle" for patch in ax.patches)
    assert (squares, len(ax.patches)) == (kind.count("P"), 2)
    plt.close(ax.figure)


def test_units() -> None:
    assert [(unit_diagram(k).degrees_of_freedom, unit_diagram(k).loops) for k in "PX"] == [(1, 0), (2, 0)]


def test_wrong_structure_is_named() -> None:
    with pytest.raises(ArgumentError, match="no single-loop train 'PP'"):
        single_loop("PP")
    with pytest.raises(ArgumentError, match="unit 'U': its kind is 'P' or 'X'"):
        Unit("Q", "U", (0, 0))
    unit = Unit("P", "P", (0, 0))
    with pytest.raises(NameLookupError, match=r"no shaft P.gamma"):
        StructureDiagram("S", (unit,), {"I": (1, 0)}, {("P", "gamma"): "I"}, {})
    with pytest.raises(NameLookupError, match="no node 'O'"):
        StructureDiagram("S", (unit,), {"I": (1, 0)}, {("P", "alpha"): "I", ("P", "beta"): "O"}, {})
    with pytest.raises(ConnectionError, match=r"shafts without a node: P.beta"):
        StructureDiagram("S", (unit,), {"I": (1, 0)}, {("P", "alpha"): "I"}, {})
