"""Drawings: all bonds and elements are there, strokes and half arrows are where they belong, no text is on another."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex

from gearlib.bondgraph import TF, BondGraph, C, I, One, R, Se, Zero, assign_causality, draw
from gearlib.bondgraph.draw import BOND_COLOUR, NUMBER_COLOUR, STROKE_COLOUR
from gearlib.errors import ArgumentError


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


def cross(directions: list[tuple[float, float]], name: str = "") -> tuple[BondGraph, dict[Any, tuple[float, float]]]:
    """A 1-junction at the origin with an element in each direction; the first bond comes in."""
    v = One(name)
    ends = [Se(), *(I() for _ in directions[1:])]
    bonds = [(k, end, v) if isinstance(end, Se) else (k, v, end) for k, end in enumerate(ends, 1)]
    return BondGraph(*bonds), {v: (0.0, 0.0), **dict(zip(ends, directions, strict=True))}


def lines_of(ax: Any, colour: str) -> list[np.ndarray[Any, Any]]:
    return [np.asarray(line.get_xydata()) for line in ax.lines if to_hex(line.get_color()) == to_hex(colour)]


AROUND = [(2.0, 0.0), (0.0, 2.0), (-2.0, 0.0), (0.0, -2.0)]


def test_bonds_leave_room_for_their_elements_and_carry_half_arrows_and_numbers() -> None:
    """A bond ends at the border of an ellipse; the half arrow's barb lies behind the head, to the right of the bond."""
    graph, positions = cross(AROUND)
    ax = draw(graph, positions)
    wide = {(1, 0): (0.2, 0.36), (0, 1): (0.24, 0.26)}  # of the junction and of a one-port, along x and along y
    for (n, bond), line in zip(graph.bonds.items(), lines_of(ax, BOND_COLOUR), strict=True):
        tail, head = np.array(positions[bond.tail]), np.array(positions[bond.head])
        along = (head - tail) / 2.0
        near, far = wide[tuple(np.abs(along).astype(int).tolist())]
        at_tail, at_head = (far, near) if n == 1 else (near, far)
        assert line[0] == pytest.approx(tail + at_tail * along)
        assert line[1] == pytest.approx(head - at_head * along)
        right = np.array([along[1], -along[0]])
        assert line[2] - line[1] == pytest.approx(-0.2 * along + 0.11 * right)
        (number,) = (text for text in ax.texts if text.get_text() == str(n) and to_hex(text.get_color()) == NUMBER_COLOUR)
        assert number.get_position() == pytest.approx((line[0] + line[1]) / 2 - 0.19 * right)
    assert lines_of(ax, STROKE_COLOUR) == []
    plt.close(ax.figure)


@pytest.mark.parametrize("inward", [False, True])
def test_strokes_are_across_the_end_that_receives_the_effort(inward: bool) -> None:
    graph, positions = cross(AROUND[:3])
    if inward:
        v, tf = One("v"), TF(2)
        source, mass = Se(), I()
        graph = BondGraph((1, source, v), (2, v, tf), (3, tf, w := One("w")), (4, w, mass))
        positions = {source: (0, 0), v: (2, 0), tf: (4, 0), w: (4, 2), mass: (4, 4)}
    causality = assign_causality(graph)
    ax = draw(graph, positions, causality=causality)
    bonds, strokes = lines_of(ax, BOND_COLOUR), lines_of(ax, STROKE_COLOUR)
    assert len(strokes) == len(graph.bonds)
    for bond, line, stroke in zip(graph.bonds.values(), bonds, strokes, strict=True):
        end = line[1] if causality.effort_to[bond.number] is bond.head else line[0]
        assert stroke.mean(axis=0) == pytest.approx(end)
        assert np.linalg.norm(stroke[1] - stroke[0]) == pytest.approx(0.22)
        assert (stroke[1] - stroke[0]) @ (line[1] - line[0]) == pytest.approx(0.0)
    late = {text.get_text() for text in ax.texts if to_hex(text.get_color()) == to_hex(STROKE_COLOUR)}
    assert late == {f"$I_{{{n}}}$" for n in causality.derivative}
    assert bool(late) == (not inward)
    plt.close(ax.figure)


def test_bonds_follow_their_routes() -> None:
    graph, positions = cross(AROUND[:2])
    ax = draw(graph, positions, routes={2: [(1.0, 0.0), (1.0, 3.0), (0.0, 3.0)]}, causality=assign_causality(graph))
    _, line = lines_of(ax, BOND_COLOUR)
    assert line[:5] == pytest.approx(np.array([[0.2, 0], [1, 0], [1, 3], [0, 3], [0, 2.26]]))
    (number,) = (text for text in ax.texts if text.get_text() == "2" and to_hex(text.get_color()) == NUMBER_COLOUR)
    assert number.get_position() == pytest.approx((1.0 - 0.19, 1.5)), "beside the longest piece"
    plt.close(ax.figure)


@pytest.mark.parametrize(
    ("directions", "expected", "aligned"),
    [
        ([(-2, 0), (0, 2), (0, -2)], (0.3, 0.0), ("left", "center")),
        ([(2, 0), (0, 2), (0, -2)], (-0.3, 0.0), ("right", "center")),
        ([(-2, 0), (0, 2)], (0.2, -0.3), ("left", "top")),
        ([(2, 0), (-2, 0)], (0.0, 0.3), ("center", "bottom")),
        ([(2, 0), (-2, 0), (0, 2)], (0.0, -0.3), ("center", "top")),
        ([(0, 2), (0, -2), (-2, 0), (2, 0)], (0.2, 0.3), ("left", "bottom")),
        ([(0, 2), (0, -2), (-2, 0), (2, 0), (2, 2)], (-0.2, 0.3), ("right", "bottom")),
        ([(0, 2), (0, -2), (-2, 0), (2, 0), (2, 2), (-2, 2), (2, -2)], (-0.2, -0.3), ("right", "top")),
    ],
)
def test_names_stand_where_bonds_leave_most_room(
    directions: list[tuple[float, float]], expected: tuple[float, float], aligned: tuple[str, str]
) -> None:
    """Beside the junction where there is room, and only else above or below it."""
    graph, positions = cross(directions, name="carrier and ring")
    ax = draw(graph, positions)
    (name,) = (text for text in ax.texts if text.get_text().startswith("carrier"))
    assert name.get_text() == "carrier\nand\nring"
    assert (name.get_position(), name.get_ha(), name.get_va()) == (pytest.approx(expected), *aligned)
    plt.close(ax.figure)


def test_what_elements_are_called_and_how_much_is_shown() -> None:
    v, w, tf = One("v"), Zero("w"), TF("m")
    graph = BondGraph((1, Se(), v), (2, v, tf), (3, tf, w), (17, w, C()))
    ax = draw(graph, dict(zip(graph.elements, [(0, 0), (2, 0), (4, 1), (6, 0), (8, 0)], strict=True)), scale=0.5)
    assert {text.get_text() for text in ax.texts} == {"$Se_{1}$", "1", "TF\n$m$", "0", "$C_{17}$", "v", "w", "2", "3", "17"}
    bold = {(text.get_text(), text.get_position()) for text in ax.texts if text.get_weight() == "bold"}
    assert bold == {("1", (2.0, 0.0)), ("0", (6.0, 0.0))}
    assert tuple(ax.figure.get_size_inches()) == pytest.approx((5.0, 1.5)), "the elements, and a unit on either side"
    assert (ax.get_xlim(), ax.get_ylim()) == (pytest.approx((-0.59, 8.59)), pytest.approx((-0.52, 1.52)))
    plt.close(ax.figure)


def test_rooms_grow_with_what_is_around_and_within() -> None:
    """The room of a junction with the number of its bonds from five on, that of a transformer with its modulus."""

    def reach(count: int) -> float:
        ax = draw(*cross([(2.0, 0.0)] + [(0.0, 2.0 + k) for k in range(count - 1)]))
        line = lines_of(ax, BOND_COLOUR)[0]
        plt.close(ax.figure)
        return float(line[1][0])

    assert [reach(n) for n in (2, 4, 5, 8)] == pytest.approx([0.2, 0.2, 0.25, 0.4])
    for modulus in ("m", "ratio"):
        v, tf, w = One("v"), TF(modulus), One("w")
        graph = BondGraph((1, Se(), v), (2, v, tf), (3, tf, w), (4, w, I()))
        ax = draw(graph, dict(zip(graph.elements, [(0, 0), (2, 0), (4, 0), (6, 0), (8, 0)], strict=True)))
        assert lines_of(ax, BOND_COLOUR)[1][1][0] == pytest.approx(4 - 0.3 - 0.045 * len(modulus))
        plt.close(ax.figure)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"positions": {}}, "positions has none for Se on bond 1; expected one for each element"),
        ({"positions": 3}, "positions is 3; expected points (x, y) by element"),
        ({"positions": {1: (1, 2, 3)}}, "positions is {1: (1, 2, 3)}; expected points (x, y) by element"),
        ({"routes": {1: (1, 2)}}, "routes is {1: (1, 2)}; expected lists of points (x, y) by number of bond"),
        ({"causality": 3}, "causality is 3; expected the result of assign_causality"),
        ({"scale": 0}, "scale is 0.0; expected a positive number of inches, up to 100"),
        ({"scale": 101}, "scale is 101.0; expected a positive number of inches, up to 100"),
    ],
)
def test_what_cannot_be_drawn(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError) as problem:
        draw(cross(AROUND)[0], **given)
    assert str(problem.value) == said
