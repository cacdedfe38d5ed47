"""The drawn incidence matrix: what it shows is the reduced graph, below its diagonal blocks only."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.incidence_picture import LONGEST_LABEL, ONCE, TWICE, IncidenceMatrix, IncidencePicture
from gearlib.drawing.style import COLOURS, MARK
from gearlib.drawing.svg import text_width
from gearlib.errors import ArgumentError
from tests.drawing.shapes import CLOSE, Shape, shapes


@pytest.fixture(scope="module")
def system() -> gl.System:
    return gl.compile(gp.ZhouCui2022(tau_in=100.0))


def test_matrix_is_block_lower_triangular(system: gl.System) -> None:
    matrix = system.draw_structure().matrix
    n_states = sum(state for _, state in matrix.columns)
    assert n_states == len(system.states)
    assert sum(matrix.blocks) == len(matrix.rows) == len(matrix.columns) - n_states
    block = [b for b, size in enumerate(matrix.blocks) for _ in range(size)]
    for i, j in matrix.entries:
        assert j < n_states or block[j - n_states] <= block[i]
    assert {(i, n_states + i) for i in range(len(matrix.rows))} <= set(matrix.entries)
    assert {times for _, times in matrix.rows} == {0, 1, 2}


def test_picture_is_svg_with_every_name(system: gl.System, tmp_path: Path) -> None:
    picture = system.draw_structure()
    root = ElementTree.fromstring(picture.svg)
    texts = [element.text or "" for element in root.iter("{http://www.w3.org/2000/svg}text")]
    for name in system.states:
        assert any(text == name or (text[:20] == name[:20] and "…" in text) for text in texts), name
    width, height = float(root.attrib["width"]), float(root.attrib["height"])
    assert width < 1600
    assert height < 1600
    assert picture.save(tmp_path / "structure.svg").read_text(encoding="utf-8") == picture.svg
    with pytest.raises(ArgumentError, match="svg"):
        picture.save(tmp_path / "structure.png")
    assert "49 blocks" in repr(picture)


def test_blocks_are_squares_along_the_diagonal_with_their_dots_inside(system: gl.System) -> None:
    """Each begins at the corner of the one before, from behind the states to the end of the matrix."""
    picture = system.draw_structure()
    matrix, every = picture.matrix, list(ElementTree.fromstring(picture.svg).iter("{http://www.w3.org/2000/svg}rect"))

    def rectangles(*fills: str) -> list[tuple[float, ...]]:
        found = [one for one in every if one.attrib.get("fill") in fills]
        return [tuple(float(one.attrib[key]) for key in ("x", "y", "width", "height")) for one in found]

    (left, top, wide, high), *_ = [r for r in rectangles("none") if r[2] > 50]
    cell = high / len(matrix.rows)
    assert wide == pytest.approx(cell * len(matrix.columns), rel=1e-3)
    n_states = sum(state for _, state in matrix.columns)
    assert (left, top, cell * n_states, high) in [pytest.approx(r, abs=0.11) for r in rectangles("#dbe9f6")]
    squares, first = [], 0
    for size in matrix.blocks:
        squares.append((left + cell * (n_states + first), top + cell * first, cell * size, cell * size))
        first += size
    blocks = [r for r in rectangles("#f6dcdc", "#eeeeee") if r[1] >= top - 0.1]
    assert len(blocks) == len(squares)
    for found, expected in zip(blocks, squares, strict=True):
        assert found == pytest.approx(expected, abs=0.11)
    dots = [(x + w / 2, y + h / 2) for x, y, w, h in rectangles("black") if y > top]
    middles = [(left + cell * (n_states + i + 0.5), top + cell * (i + 0.5)) for i in range(len(matrix.rows))]
    assert np.array(sorted(dots)) == pytest.approx(np.array(sorted(middles)), abs=0.11)


NAMES = ("first law", "second law", "x" * LONGEST_LABEL, "y" * 25 + "z" * 24)
MATRIX = IncidenceMatrix(
    rows=tuple(zip(NAMES, (0, 1, 2, 3), strict=True)),
    columns=(("phi", True), ("a.speed", True), ("a", False), ("b", False), ("torque", False), ("d", False)),
    entries=((0, 2), (1, 3), (2, 4), (3, 5), (1, 0), (2, 5), (3, 4), (3, 1)),
    blocks=(1, 1, 2),
    title="A model",
)


@pytest.fixture(scope="module")
def drawn() -> list[Shape]:
    return shapes(IncidencePicture(MATRIX).svg)


def frame(drawn: list[Shape]) -> tuple[float, float, float, float, float]:
    """Left, upper, right and lower edge of the matrix, and the size of a cell."""
    (found,) = (s for s in drawn if s.kind == "rect" and s.attributes.get("fill") == "none")
    left, upper, right, lower = found.box
    assert (right - left) / len(MATRIX.columns) == pytest.approx((lower - upper) / len(MATRIX.rows))
    return left, upper, right, lower, (right - left) / len(MATRIX.columns)


def test_equations_are_named_beside_their_rows(drawn: list[Shape]) -> None:
    """On a ground that says whether they are differentiated; a long name has both of its ends."""
    left, upper, right, _, cell = frame(drawn)
    shown = [*NAMES[:3], "y" * 20 + "…" + "y" * 3 + "z" * 24]
    assert len(shown[3]) == LONGEST_LABEL
    for i, (name, ground) in enumerate(zip(shown, ([], [ONCE], [TWICE], [TWICE]), strict=True)):
        y = upper + cell * (i + 0.5)
        (label,) = (s for s in drawn if s.text == name)
        assert label.attributes["text-anchor"] == "end"
        assert 6 <= label.box[0] < label.box[2] < left
        assert left - label.box[2] < 10
        assert label.points[0][1] - 0.36 * label.size == pytest.approx(y, abs=0.5)
        behind = [s for s in drawn if s.attributes.get("fill") in (ONCE, TWICE) and s.box[1] < y < s.box[3]]
        assert [s.attributes["fill"] for s in behind] == ground
        for s in behind:
            assert (s.box[1], s.box[3]) == pytest.approx((y - cell / 2, y + cell / 2), abs=CLOSE)
            assert 2 <= s.box[0] < label.box[0] < label.box[2] < s.box[2] <= left
        (line,) = (s for s in drawn if s.kind == "line" and abs(s.middle[1] - y) < CLOSE and np.ptp(s.points[:, 0]) > 0)
        assert line.points == pytest.approx(np.array([[left, y], [right, y]]), abs=CLOSE)


def test_variables_are_named_upright_above_their_columns(drawn: list[Shape]) -> None:
    left, upper, _, lower, cell = frame(drawn)
    for j, (name, state) in enumerate(MATRIX.columns):
        x = left + cell * (j + 0.5)
        (label,) = (s for s in drawn if s.text == name)
        assert label.attributes["fill"] == (COLOURS[0] if state else "black")
        assert label.attributes["transform"].startswith("rotate(-90 ")
        assert label.points[0][0] - 0.36 * label.size == pytest.approx(x, abs=0.5)
        assert upper - 8 < label.points[0][1] < upper
        assert label.points[0][1] - text_width(name, label.size) > 36, "below the legend"
        (line,) = (s for s in drawn if s.kind == "line" and abs(s.middle[0] - x) < CLOSE and np.ptp(s.points[:, 1]) > 0)
        assert line.points == pytest.approx(np.array([[x, upper], [x, lower]]), abs=CLOSE)


def test_dots_are_square_where_an_equation_determines_its_variable(drawn: list[Shape]) -> None:
    left, upper, _, _, cell = frame(drawn)
    for i, j in MATRIX.entries:
        (dot,) = (s for s in drawn if s.title == f"{MATRIX.rows[i][0]}: {MATRIX.columns[j][0]}")
        assert dot.kind == ("rect" if j == 2 + i else "circle")
        assert dot.middle == pytest.approx([left + cell * (j + 0.5), upper + cell * (i + 0.5)], abs=CLOSE)
        assert 2 < (dot.box[2] - dot.box[0]) / 2 < cell / 2
    blocks = [s for s in drawn if s.kind == "rect" and s.attributes.get("fill") in ("#eeeeee", "#f6dcdc") and s.box[1] > 40]
    together = [s.box[2] - s.box[0] > 1.5 * cell for s in blocks]
    assert together == [False, False, True]
    assert [s.attributes["fill"] == "#f6dcdc" for s in blocks] == [s.attributes["stroke"] == MARK for s in blocks] == together


def test_a_legend_between_title_and_matrix_tells_the_colours(drawn: list[Shape]) -> None:
    left, upper, *_ = frame(drawn)
    (title,) = (s for s in drawn if s.text == MATRIX.title)
    said = {
        "states": "#dbe9f6", "differentiated once": ONCE, "twice or more": TWICE, "solved together": "#f6dcdc",
        "determined by this equation": "black",
    }  # fmt: skip
    edge = left - 1.0
    for words, fill in said.items():
        (label,) = (s for s in drawn if s.text == words)
        (mark,) = (s for s in drawn if s.kind == "rect" and s.box[3] < 36 and s.attributes.get("fill") == fill)
        assert title.box[3] < mark.box[1] < mark.box[3] < upper
        assert edge < mark.box[0] < mark.box[2] < label.box[0] < mark.box[2] + 10
        assert label.points[0][1] - 0.36 * label.size == pytest.approx(mark.middle[1], abs=1)
        edge = label.box[2]
    assert title.points[0][0] == pytest.approx(left)


@pytest.mark.parametrize("title", ["M", "A model with a title that is far longer than its matrix is wide or its legend is"])
def test_the_picture_of_a_small_model_holds_all_of_its_legend_and_title(title: str) -> None:
    page, *content = shapes(IncidencePicture(replace(MATRIX, title=title)).svg)
    for s in content:
        if "rotate" not in s.attributes.get("transform", ""):
            assert min(s.box[:2]) >= 0
            assert s.box[2] <= page.box[2]
            assert s.box[3] <= page.box[3] - 8
