"""Structure diagrams: shafts and nodes, degrees of freedom, loops, drawings."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from gearlib.errors import ArgumentError, ConnectionError, NameLookupError
from gearparts.trains.structure_diagram import StructureDiagram, Unit, single_loop, unit_diagram


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


def test_a_unit_stands_between_its_input_and_output_and_above_its_third_shaft() -> None:
    for kind in "PX":
        (unit,), nodes = unit_diagram(kind).units, unit_diagram(kind).nodes
        (x, y), (x_in, y_in), (x_out, y_out) = unit.position, nodes["I"], nodes["O"]
        assert y_in == y_out == y
        assert x - x_in == x_out - x > 1
        if kind == "X":
            assert nodes["N"][0] == x
            assert nodes["N"][1] < y - 1


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


def test_graphs_of_trains_do_not_import_matplotlib() -> None:
    code = (
        "import sys, gearparts.trains.paper_graphs, gearparts.trains.structure_diagram; sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, env={"PYTHONPATH": ":".join(sys.path)}).returncode == 0


@pytest.mark.parametrize("diagram", [*map(single_loop, ("XP", "PX", "XX")), *map(unit_diagram, "PX")], ids=lambda d: d.name)
def test_labels_stand_beside_what_they_name(diagram: StructureDiagram) -> None:
    """A unit's in it, a shaft's where the shaft leaves its unit, a node's above or below it; none on a line, and none on another."""
    ax = diagram.draw()
    lines = [np.transpose(line.get_data()) for line in ax.lines if len(line.get_xdata()) > 1]
    dots = {tuple(map(float, np.ravel(line.get_data()))) for line in ax.lines if len(line.get_xdata()) == 1}
    assert dots == set(diagram.nodes.values())
    texts = [(text.get_text().strip("$").strip("\\"), np.array(text.get_position())) for text in ax.texts]
    units = {unit.name: np.array(unit.position) for unit in diagram.units}
    assert [(n, tuple(p)) for n, p in texts if n in units] == [(n, tuple(p)) for n, p in units.items()]
    for node, place in diagram.nodes.items():
        (dx, dy) = next(p for n, p in texts if n == node) - place
        assert (dx, 0.2 < abs(dy) < 0.4) == (0, True), node
    shafts = [(n, p) for n, p in texts if n not in units and n not in diagram.nodes]
    assert sorted(n for n, _ in shafts) == sorted(shaft for _, shaft in diagram.shafts)
    for name, place in shafts:
        assert min(np.abs(place - p).max() for p in units.values()) == pytest.approx(0.6), name
    for name, place in [(n, p) for n, p in texts if n not in units]:
        assert min(distance(place, line) for line in lines) > 0.1, name
        assert min(float(np.hypot(*(place - p))) for n, p in texts if p is not place) > 0.3, name
        assert all(np.hypot(*(place - p)) > 0.43 for p in units.values()), name
    size = {text.get_text().strip("$").strip("\\"): text.get_fontsize() for text in ax.texts}
    assert min(size[n] for n in units) > max(size[n] for n in diagram.nodes)
    assert min(size[n] for n in diagram.nodes) > max(size[n] for n, _ in shafts) > 8
    ends = {tuple(map(float, line[-1])) for line in lines}
    assert {diagram.nodes[node] for node in diagram.shafts.values()} <= ends
    for line in lines:  # a shaft leaves its unit sideways and turns once, at a right angle
        assert all(a[0] == b[0] or a[1] == b[1] for a, b in pairwise(line))
    for patch, unit in zip(ax.patches, diagram.units, strict=True):
        box = patch.get_extents().transformed(ax.transData.inverted())
        assert ((box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2) == pytest.approx(unit.position, abs=1e-9)
        assert box.width == pytest.approx(box.height) == pytest.approx(0.8, abs=0.07)
        assert (
            max(line.get_zorder() for line in ax.lines) <= patch.get_zorder() < ax.texts[0].get_zorder()
        )  # it hides what leads into it
        assert {patch.get_linewidth()} == {line.get_linewidth() for line in ax.lines if len(line.get_xdata()) > 1}
    (left, right), places = ax.get_xlim(), [x for x, _ in diagram.nodes.values()]
    assert 0 < min(places) - left < 0.5
    assert 0 < right - max(places) < 0.5
    plt.close(ax.figure)


def distance(point: Any, line: Any) -> float:
    """Of a point from a line of several pieces."""
    found = []
    for a, b in pairwise(line):
        share = np.clip(np.dot(point - a, b - a) / max(np.dot(b - a, b - a), 1e-12), 0, 1)
        found.append(float(np.hypot(*(a + share * (b - a) - point))))
    return min(found)


def test_shafts_that_share_a_node_are_connected() -> None:
    """Table 3 of the paper: XP joins the X unit's b and the P unit's alpha, and both units at the output; PX at the input."""
    joined = {
        kind: sorted(
            sorted(f"{u}.{s}" for (u, s), at in single_loop(kind).shafts.items() if at == node) for node in single_loop(kind).nodes
        )
        for kind in ("XP", "PX", "XX")
    }  # fmt: skip
    assert joined["XP"] == [[], ["P.alpha", "X.b"], ["P.beta", "X.c"], ["X.a"]]
    assert joined["PX"] == [[], ["P.alpha", "X.a"], ["P.beta", "X.b"], ["X.c"]]
    assert joined["XX"] == [["X_1.a"], ["X_1.b", "X_2.a"], ["X_1.c", "X_2.c"], ["X_2.b"]]
    assert (single_loop("XP").terminals, single_loop("PX").terminals) == ({"O": "J_1"}, {"I": "J_0"})
    for kind in ("XP", "PX", "XX"):
        nodes = single_loop(kind).nodes
        assert nodes["I"][0] < min(x for n, (x, _) in nodes.items() if n != "I")
        assert nodes["O"][0] > max(x for n, (x, _) in nodes.items() if n != "O")


@pytest.mark.parametrize(
    ("kind", "labels"),
    [("P", {r"$\alpha$", r"$\beta$", "$I$", "$O$", "$P$"}), ("X", {"$a$", "$b$", "$c$", "$I$", "$O$", "$N$", "$X$"})],
)
def test_shafts_of_a_p_unit_have_greek_letters_and_those_of_an_x_unit_latin_ones(kind: str, labels: set[str]) -> None:
    ax = plt.figure().add_subplot()
    assert unit_diagram(kind).draw(ax) is ax
    assert {text.get_text() for text in ax.texts} == labels
    assert ax.get_title() == f"{kind} unit"
    plt.close(ax.figure)


def test_a_loop_is_drawn_as_a_rectangle_between_its_input_and_output() -> None:
    """Units and nodes stand at its corners, a P unit in the middle of its lower side; I and O are equally far outside."""
    corners = {"XP": ("X", "J_1", "J_0", None), "PX": ("J_0", "X", None, "J_1"), "XX": ("X_1", "J_1", "J_0", "X_2")}
    for kind, (left, right, low_left, low_right) in corners.items():
        diagram = single_loop(kind)
        at = {unit.name: np.array(unit.position) for unit in diagram.units} | {n: np.array(p) for n, p in diagram.nodes.items()}
        width, height = at[right][0] - at[left][0], (at[low_left or low_right] - at[left])[1]
        assert (at[right] - at[left]).tolist() == [width, 0.0]
        assert width > 2
        assert height < -1
        if low_left:
            assert at[low_left].tolist() == (at[left] + [0.0, height]).tolist()
        if low_right:
            assert at[low_right].tolist() == (at[right] + [0.0, height]).tolist()
        if "P" in at:
            assert at["P"].tolist() == (at[left] + [width / 2, height]).tolist()
        before, after = at[left] - at["I"], at["O"] - at["X_2" if kind == "XX" else right]
        assert before.tolist() == pytest.approx(after.tolist(), rel=1e-12)
        assert (before[0] > 1, before[1]) == (True, 0.0)
