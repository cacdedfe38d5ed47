"""Drawings: all bonds and elements are there, strokes and half arrows are where they belong, no text is on another."""

from __future__ import annotations

import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_hex

from gearlib.bondgraph import BondGraph, C, I, One, R, Se, assign_causality, draw
from gearlib.bondgraph.draw import BOND_COLOUR, STROKE_COLOUR


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
    code = "import sys, gearlib.bondgraph; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, env={"PYTHONPATH": ":".join(sys.path)}).returncode == 0
