"""The drawn incidence matrix: what it shows is the reduced graph, below its diagonal blocks only."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError


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
