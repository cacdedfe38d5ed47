"""Incidence matrix of the index-reduced equations in block lower triangular form, as an SVG picture."""

from __future__ import annotations

from dataclasses import dataclass

from gearlib.drawing import svg
from gearlib.drawing.style import COLOURS, MARK

CELL = 10.0  # pixels
SIZE = 8.0  # font size
LONGEST_LABEL = 48  # characters
LEGEND = 570.0  # its width, pixels
ONCE, TWICE = "#fde2b8", "#f7b26a"  # backgrounds of equations differentiated once, and more often


@dataclass(frozen=True)
class IncidenceMatrix:
    """Contents of an incidence picture.

    Parameters
    ----------
    rows : tuple of (str, int)
        Label of each equation, and how often it is differentiated.
    columns : tuple of (str, bool)
        Name of each variable, and whether it is a state.
    entries : tuple of (int, int)
        Row and column.
    blocks : tuple of int
        Number of unknowns of each block, in order.
    title : str
    """

    rows: tuple[tuple[str, int], ...]
    columns: tuple[tuple[str, bool], ...]
    entries: tuple[tuple[int, int], ...]
    blocks: tuple[int, ...]
    title: str


class IncidencePicture(svg.Picture):
    """A drawn incidence matrix; ``save("structure.svg")`` writes it.

    Attributes
    ----------
    matrix : IncidenceMatrix
    """

    def __init__(self, matrix: IncidenceMatrix) -> None:
        self.matrix = matrix
        super().__init__(_drawn(matrix))

    def __repr__(self) -> str:
        m = self.matrix
        return f"<Structure of {m.title}: {len(m.rows)} equations in {len(m.blocks)} blocks; save('structure.svg') writes it>"


def _shortened(name: str) -> str:
    return name if len(name) <= LONGEST_LABEL else f"{name[:20]}…{name[-(LONGEST_LABEL - 21) :]}"


def _drawn(matrix: IncidenceMatrix) -> str:
    names = [_shortened(name) for name, _ in matrix.rows]
    heads = [_shortened(name) for name, _ in matrix.columns]
    n_states = sum(state for _, state in matrix.columns)
    left = 16.0 + max((svg.text_width(name, SIZE) for name in names), default=0.0)
    top = 44.0 + max((svg.text_width(head, SIZE) for head in heads), default=0.0)
    wide, high = CELL * len(heads), CELL * len(names)
    content = [svg.text(left, 16, matrix.title, font_size="13", font_weight="bold"), *_legend(left)]
    content.append(svg.rectangle(left, top, CELL * n_states, high, fill="#dbe9f6"))
    for j, head in enumerate(heads):
        x = left + CELL * (j + 0.5)
        state = matrix.columns[j][1]
        content.append(
            svg.text(x + 3, top - 5, head, font_size=f"{SIZE:g}", fill=COLOURS[0] if state else "black",
                     transform=f"rotate(-90 {svg.number(x + 3)} {svg.number(top - 5)})")
        )  # fmt: skip
        content.append(svg.line(x, top, x, top + high, stroke="#e8e8e8", stroke_width=0.5))
    for i, name in enumerate(names):
        y = top + CELL * (i + 0.5)
        times = matrix.rows[i][1]
        if times:
            content.append(svg.rectangle(4, y - CELL / 2, left - 8, CELL, fill=ONCE if times == 1 else TWICE))
        content.append(svg.text(left - 6, y + 3, name, font_size=f"{SIZE:g}", text_anchor="end"))
        content.append(svg.line(left, y, left + wide, y, stroke="#e8e8e8", stroke_width=0.5))
    first = 0
    for size in matrix.blocks:
        x, y = left + CELL * (n_states + first), top + CELL * first
        several = size > 1
        content.append(
            svg.rectangle(x, y, CELL * size, CELL * size, fill="#f6dcdc" if several else "#eeeeee",
                          stroke=MARK if several else "#999999", stroke_width=1.0 if several else 0.5)
        )  # fmt: skip
        first += size
    for i, j in matrix.entries:
        x, y = left + CELL * (j + 0.5), top + CELL * (i + 0.5)
        title = f"{matrix.rows[i][0]}: {matrix.columns[j][0]}"
        solved = j == n_states + i
        dot = svg.rectangle(x - 3, y - 3, 6, 6, fill="black") if solved else svg.circle(x, y, 2.2, fill="#555555")
        content.append(svg.group([dot], title))
    content.append(svg.rectangle(left, top, wide, high, fill="none", stroke="black", stroke_width=0.8))
    right = left + max(wide, LEGEND, 1.1 * svg.text_width(matrix.title, 13))  # of a bold title
    return svg.document(right + 12, top + high + 12, content, f"Incidence matrix of {matrix.title}")


def _legend(x: float) -> list[str]:
    """Legend below the title."""
    parts = []
    for mark, label in (
        (svg.rectangle(x, 24, 10, 10, fill="#dbe9f6"), "states"),
        (svg.rectangle(x + 60, 24, 10, 10, fill=ONCE), "differentiated once"),
        (svg.rectangle(x + 190, 24, 10, 10, fill=TWICE), "twice or more"),
        (svg.rectangle(x + 290, 24, 10, 10, fill="#f6dcdc", stroke=MARK), "solved together"),
        (svg.rectangle(x + 402, 26, 6, 6, fill="black"), "determined by this equation"),
    ):
        parts.append(mark)
        start = float(mark.split('x="')[1].split('"')[0])
        parts.append(svg.text(start + 14, 33, label, font_size="9"))
    return parts
