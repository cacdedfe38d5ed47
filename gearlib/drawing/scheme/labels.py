"""Where the names of parts stand in a stick diagram: as near as possible to their part, off all lines and off each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gearlib.drawing.icons import INK
from gearlib.drawing.svg import text, text_width

SIZE = 10.0  # px, of the letters
AIR = 2.0  # px, around them
HALO = {"paint_order": "stroke", "stroke": "white", "stroke_width": "3"}
"""Of letters, which interrupt lines."""
Box = tuple[float, float, float, float]
"""Left, upper, right and lower edge, px."""


@dataclass(frozen=True)
class Label:
    """A name and the places where it may stand.

    Parameters
    ----------
    words : str
    places : sequence of (float, float, str)
        Base line of the text and its ``text-anchor``, the best place first.
    """

    words: str
    places: Sequence[tuple[float, float, str]]

    def box(self, place: tuple[float, float, str]) -> Box:
        """What the text covers at a place."""
        x, y, anchor = place
        wide = text_width(self.words, SIZE)
        left = x - wide * {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor]
        return left - AIR, y - 0.8 * SIZE - AIR, left + wide + AIR, y + 0.2 * SIZE + AIR

    def drawn(self, place: tuple[float, float, str]) -> str:
        """The text at a place."""
        x, y, anchor = place
        return text(x, y, self.words, text_anchor=anchor, font_size="10", fill=INK, **HALO)


def overlap(a: Box, b: Box) -> float:
    """Area that two boxes share, plus their common edge: also of lines, which have no area."""
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    return 0.0 if wide < 0 or high < 0 else wide * high + wide + high


def placed(labels: Sequence[Label], taken: Sequence[Box]) -> list[tuple[float, float, str]]:
    """A place for each label.

    Parameters
    ----------
    labels : sequence of Label
    taken : sequence of Box
        Lines and parts.

    Returns
    -------
    list of (float, float, str)
        The first free place; where none is free, that which covers least.

    Examples
    --------
    >>> above, below = (0.0, -5.0, "middle"), (0.0, 15.0, "middle")
    >>> placed([Label("K1", [above, below])], [(-50.0, -8.0, 50.0, -8.0)]) == [below]
    True
    """
    covered, found = list(taken), []
    for label in labels:
        best = min(label.places, key=lambda place, label=label: sum(overlap(label.box(place), box) for box in covered))  # type: ignore[misc]
        found.append(best)
        covered.append(label.box(best))
    return found
