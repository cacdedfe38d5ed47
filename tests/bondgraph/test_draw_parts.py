"""Marks of a drawing one by one, on a sheet that only notes them: bonds, half arrows, strokes, numbers and names."""

from __future__ import annotations

from importlib import import_module
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
import pytest

from gearlib.bondgraph import GY, TF, BondGraph, C, I, One, R, Se, Sf, Zero, assign_causality
from gearlib.bondgraph.draw import BOND_COLOUR, STROKE_COLOUR
from gearlib.errors import ArgumentError

marks: Any = import_module("gearlib.bondgraph.draw")  # the package has a function of this name


class Sheet:
    """What is drawn, in order."""

    def __init__(self) -> None:
        self.lines: list[tuple[Any, str]] = []
        self.texts: list[tuple[Any, str, dict[str, Any]]] = []

    def plot(self, x: Any, y: Any, *, color: str, **_: Any) -> None:
        self.lines.append((np.column_stack([x, y]), color))

    def text(self, x: float, y: float, what: str, **how: Any) -> None:
        self.texts.append((np.array([x, y]), what, how))


@pytest.mark.parametrize(
    ("direction", "distance"),
    [((1, 0), 0.3), ((-1, 0), 0.3), ((0, 1), 0.4), ((0, -1), 0.4), ((0.6, 0.8), 1 / np.hypot(2.0, 2.0))],
)
def test_a_bond_ends_at_an_ellipse_around_its_element(direction: Any, distance: float) -> None:
    assert marks._gap((0.3, 0.4), np.array(direction, float)) == pytest.approx(distance)


def test_directions_have_unit_length_and_turn_left() -> None:
    found = marks._direction(np.array([1.0, 2.0]), np.array([4.0, -2.0]))
    assert found == pytest.approx([0.6, -0.8])
    assert marks._turned(found) == pytest.approx([0.8, 0.6])
    assert marks._turned(np.array([1.0, 0.0])).tolist() == [0.0, 1.0]


@pytest.mark.parametrize(("from_tail", "angle"), [(True, np.pi / 2), (False, np.pi)])
def test_a_bond_with_a_bend_leaves_its_ends_at_different_angles(from_tail: bool, angle: float) -> None:
    points = [np.array(p, float) for p in ((0, 0), (0, 2), (3, 2))]
    assert marks._leaving(points, from_tail) == pytest.approx(angle)
    assert marks._leaving(points[:2], from_tail) == pytest.approx(np.pi / 2 if from_tail else -np.pi / 2)


def test_rooms_and_labels_of_elements() -> None:
    v, z, tf, gy = One("v"), Zero(), TF("m"), GY("ratio")
    bonds = [(1, Se(), v), (2, v, tf), (3, tf, z), (4, z, gy), (5, gy, w := One("w")), (6, w, I()), (17, z, C())]
    graph = BondGraph(*bonds, *((20 + k, v, R()) for k in range(3)))
    assert [marks._label(e, graph) for e in (v, z, tf, gy, graph.element(6), graph.element(17), graph.element(1))] == [
        "1", "0", "TF\n$m$", "GY\n$ratio$", "$I_{6}$", "$C_{17}$", "$Se_{1}$",
    ]  # fmt: skip
    rooms = {e: marks._room(e, graph) for e in (v, w, tf, gy, graph.element(6))}
    assert rooms[v] == pytest.approx((0.2 * 5 / 4, 0.24 * 5 / 4))
    assert rooms[w] == (0.2, 0.24)
    assert rooms[tf] == (pytest.approx(0.345), 0.38)
    assert rooms[gy] == (pytest.approx(0.525), 0.38)
    assert rooms[graph.element(6)] == (0.36, 0.26)


ROOMS = ((0.2, 0.3), (0.4, 0.5))


def bond_and_causality(into_head: bool) -> Any:
    """A source of effort gives it to the head, one of flow takes it at the tail."""
    source, v = (Se() if into_head else Sf()), One("v")
    graph = BondGraph((7, source, v), (8, v, R()))
    causality = assign_causality(graph)
    assert (causality.effort_to[7] is v) == into_head
    return graph.bonds[7], causality


@pytest.mark.parametrize("into_head", [True, False, None])
def test_a_straight_bond_with_its_half_arrow_stroke_and_number(into_head: bool | None) -> None:
    bond, causality = bond_and_causality(bool(into_head))
    sheet, points = Sheet(), [np.array([1.0, 1.0]), np.array([4.0, 1.0])]
    marks._draw_bond(sheet, bond, points, ROOMS, causality if into_head is not None else None)
    (line, colour), *strokes = sheet.lines
    assert colour == BOND_COLOUR
    assert line == pytest.approx(np.array([[1.2, 1.0], [3.6, 1.0], [3.4, 0.89]]))
    assert len(strokes) == (into_head is not None)
    if strokes:
        x = 3.6 if into_head else 1.2
        assert strokes[0][0] == pytest.approx(np.array([[x, 1.11], [x, 0.89]]))
        assert strokes[0][1] == STROKE_COLOUR
    ((place, number, _),) = sheet.texts
    assert (number, place) == ("7", pytest.approx([2.4, 1.19]))


@pytest.mark.parametrize("into_head", [True, False])
def test_a_bond_along_a_way_ends_across_its_last_piece(into_head: bool) -> None:
    """Up, to the right, down: the number is beside the longest piece, to its left."""
    bond, causality = bond_and_causality(into_head)
    sheet = Sheet()
    marks._draw_bond(sheet, bond, [np.array(p, float) for p in ((0, 0), (0, 2), (5, 2), (5, -1))], ROOMS, causality)
    (line, _), (stroke, _) = sheet.lines
    assert line == pytest.approx(np.array([[0, 0.3], [0, 2], [5, 2], [5, -0.5], [4.89, -0.3]]))
    end = np.array([5.0, -0.5]) if into_head else np.array([0.0, 0.3])
    half = np.array([0.11, 0.0]) if into_head else np.array([-0.11, 0.0])
    assert stroke == pytest.approx(np.array([end + half, end - half]))
    ((place, _, _),) = sheet.texts
    assert place == pytest.approx([2.5, 2.19])


@pytest.mark.parametrize(
    ("angles", "offset", "side", "level"),
    [
        ([90, 180, 270], (0.3, 0.0), "left", "center"), ([0, 90, 270], (-0.3, 0.0), "right", "center"),
        ([0, 180, 270], (0.0, 0.3), "center", "bottom"), ([0, 180, 90], (0.0, -0.3), "center", "top"),
        ([180, 270], (0.2, 0.3), "left", "bottom"), ([0, 270], (-0.2, 0.3), "right", "bottom"),
        ([0, 90], (-0.2, -0.3), "right", "top"), ([180, 90], (0.2, -0.3), "left", "top"), ([179, -179], (0.3, 0.0), "left", "center"),
        ([0], (-0.3, 0.0), "right", "center"), ([5, 177], (0.0, -0.3), "center", "top"),
    ],
)  # fmt: skip
def test_a_name_stands_where_most_room_is(angles: list[float], offset: tuple[float, float], side: str, level: str) -> None:
    sheet = Sheet()
    marks._draw_name(sheet, One("left planet carrier"), np.array([2.0, 5.0]), np.radians(angles).tolist())
    ((place, name, how),) = sheet.texts
    assert (place - [2.0, 5.0]) == pytest.approx(offset)
    assert (how["ha"], how["va"]) == (side, level)
    assert name == "left\nplanet\ncarrier"


def test_points_are_given_by_element_or_by_bond() -> None:
    single = marks._points("positions", {"a": (1, 2), "b": [3.0, 4.0]}, True)
    assert {key: value.tolist() for key, value in single.items()} == {"a": [[1.0, 2.0]], "b": [[3.0, 4.0]]}
    several = marks._points("routes", {1: [(1, 2), (3, 4)], 2: [(5, 6)]})
    assert {key: value.tolist() for key, value in several.items()} == {1: [[1.0, 2.0], [3.0, 4.0]], 2: [[5.0, 6.0]]}
    assert marks._points("routes", {}) == {}
    for name, given, expected in (
        ("positions", {1: 2}, "points (x, y) by element"), ("routes", 3, "lists of points (x, y) by number of bond"),
        ("routes", {1: [(1, 2, 3)]}, "lists of points (x, y) by number of bond"), ("routes", {1: (1, 2)}, "lists of points"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError) as refused:
            marks._points(name, given, name == "positions")
        assert str(refused.value).startswith(f"{name} is {given!r}; expected {expected}")


@pytest.mark.parametrize("connected", [True, False])
def test_a_layout_has_bonds_of_a_typical_length(connected: bool) -> None:
    """1.3 in the median; of a graph in two parts elements stand in a circle."""
    v, w = One("v"), One("w")
    bonds: list[Any] = [(1, Se(), v), (2, v, I()), (3, w, R()), (4, Se(), w), (5, w, C())]
    graph = BondGraph(*bonds, *([(6, v, w)] if connected else []))
    found = marks._layout(graph)
    assert set(found) == set(graph.elements)
    lengths = [np.linalg.norm(np.subtract(found[b.tail], found[b.head])) for b in graph.bonds.values()]
    assert np.median(lengths) == pytest.approx(1.3)
    places = np.array([*found.values()])
    if connected:
        assert max(lengths) < 1.6
        assert min(np.linalg.norm(np.subtract(a, b)) for a, b in pairwise(places)) > 0.5
    else:
        circle = np.array([*nx.circular_layout(nx.path_graph(len(places))).values()])
        assert places / np.linalg.norm(places, axis=1)[:, None] == pytest.approx(circle, abs=1e-6)
