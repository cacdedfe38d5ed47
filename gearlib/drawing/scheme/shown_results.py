"""`ShownResults`: what a stick diagram shows besides the train, and the table below it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import hypot

from gearlib.drawing.scheme.axes import Axes
from gearlib.drawing.scheme.routing import Routing
from gearlib.drawing.scheme.train import Symbol

LABEL, CLEAR = 17.0, 26.0  # height of a label above its symbol; between numbers, pixels


@dataclass(frozen=True)
class Listing:
    """Table below a stick diagram: numbers in all columns but the last, which is text; and a note below it."""

    head: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    note: str = ""


class ShownResults:
    """Results in a stick diagram, in its coordinates. This base shows none."""

    @property
    def heading(self) -> str:
        """Line above the drawing; empty for none."""
        return ""

    def background(self, axes: Axes, routing: Routing) -> Iterator[str]:
        """SVG behind the train."""
        return iter(())

    def above(self, axes: Axes, routing: Routing) -> Iterator[str]:
        """SVG in front of the train."""
        return iter(())

    def notes(self, symbol: Symbol) -> list[str]:
        """Lines of the tooltip of a part."""
        return []

    def listing(self, axes: Axes, routing: Routing) -> Listing:
        """The table below the drawing."""
        return Listing()


def places_of_numbers(axes: Axes, routing: Routing) -> Iterator[tuple[int, int, float, float]]:
    """Number of each shaft, the shaft, and where its number is: on a long segment, clear of other numbers and of labels."""
    pairs = zip(axes.symbols, routing.places, strict=True)
    taken = [(place.x, place.y - LABEL) for symbol, place in pairs if symbol.kind == "inline"]
    for k, (shaft, (y, points)) in enumerate(sorted(routing.spines.items())):
        ends = sorted({p[2] for p in points})
        segments = sorted(pairwise(ends), key=lambda s: s[0] - s[1]) or [(ends[0], ends[0])]
        places = [left + share * (right - left) for left, right in segments for share in (0.5, 0.25, 0.75)]
        x = max(places, key=lambda x, y=y: min([CLEAR, *(hypot(x - x2, y - y2) for x2, y2 in taken)]))  # type: ignore[misc]
        taken.append((x, y))
        yield k + 1, shaft, x, y
