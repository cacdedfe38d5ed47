"""Power in a stick diagram: bands along the shafts, and a table of speeds and torques."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import copysign, pi

from gearlib.drawing.icons import INK
from gearlib.drawing.sankey import watts
from gearlib.drawing.scheme.axes import Axes
from gearlib.drawing.scheme.routing import Routing
from gearlib.drawing.scheme.shown_results import Listing, ShownResults, places_of_numbers
from gearlib.drawing.scheme.train import Symbol
from gearlib.drawing.svg import circle, line, polygon, text

POWER = "#e08e0b"
WIDEST = 22.0  # band, in the units of the picture


@dataclass(frozen=True)
class Load:
    """Load of a flange: speed (rad/s), torque (N.m) and power (W), the latter two positive into the part."""

    speed: float
    torque: float
    power: float


@dataclass(frozen=True)
class ShownPower(ShownResults):
    """Speeds, torques and powers of a steady motion.

    Parameters
    ----------
    loads : mapping of (str, str) to Load
        By part and flange.
    """

    loads: Mapping[tuple[str, str], Load]

    @property
    def _largest(self) -> float:
        return max((abs(load.power) for load in self.loads.values()), default=0.0)

    def background(self, axes: Axes, routing: Routing) -> Iterator[str]:
        """Power flow along the shafts, with width proportional to power and arrows in its direction."""
        if not self._largest:
            return
        for y, points in routing.spines.values():
            passing = 0.0
            for (i, flange, x1), (_, _, x2) in zip(points, points[1:], strict=False):
                symbol = axes.symbols[i]
                found = self.loads.get((symbol.name, symbol.ports[flange]))
                passing -= 0.0 if found is None else found.power
                if abs(passing) > 1e-3 * self._largest and x2 - x1 > 1:
                    yield from _arrow(x1, x2, y, passing / self._largest)

    def above(self, axes: Axes, routing: Routing) -> Iterator[str]:
        """The number of each shaft; the table below gives its speed."""
        for number, _, x, y in places_of_numbers(axes, routing):
            yield circle(x, y, 7, fill="white", stroke=INK, stroke_width="1")
            yield text(x, y + 3.2, str(number), text_anchor="middle", font_size="9", fill=INK)

    def notes(self, symbol: Symbol) -> list[str]:
        """Loads of its flanges."""
        found = [(port, self.loads[symbol.name, port]) for port in symbol.ports if (symbol.name, port) in self.loads]
        return [f"{port}: {at.speed * 30 / pi:.4g} 1/min, {at.torque:.4g} N·m, {watts(at.power)}" for port, at in found]

    def listing(self, axes: Axes, routing: Routing) -> Listing:
        """For each shaft: its number, its speed, and the torques on it."""
        rows = []
        for number, shaft, _, _ in places_of_numbers(axes, routing):
            on = [(axes.symbols[i], axes.symbols[i].ports[flange]) for i, flange, _ in routing.spines[shaft][1]]
            found = [(s, port, self.loads[s.name, port]) for s, port in on if (s.name, port) in self.loads]
            if found:
                torques = ", ".join(f"{s.named(port)} {load.torque:.4g}" for s, port, load in found)
                rows.append((str(number), f"{found[0][2].speed * 30 / pi:.5g}", torques))
        note = f"bands: power along the shafts, widest {watts(self._largest)}"
        return Listing(("shaft", "1/min", "torques into the parts, N·m"), tuple(rows), note)


def _arrow(x1: float, x2: float, y: float, share: float) -> Iterator[str]:
    width = max(WIDEST * abs(share), 2.0)
    start, end = (x1, x2) if share > 0 else (x2, x1)
    yield line(start, y, end, y, stroke=POWER, stroke_width=width, stroke_opacity="0.45")
    if x2 - x1 > 30:
        back = end - copysign(12, share)
        yield polygon([(back, y - width / 2 - 4), (end, y), (back, y + width / 2 + 4)], fill=POWER)
