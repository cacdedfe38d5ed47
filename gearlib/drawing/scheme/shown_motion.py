"""Motion of a mode in a stick diagram: a dial at each shaft that swings, coloured bands, and a table of amplitudes and phases."""

from __future__ import annotations

from cmath import phase
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import cos, degrees, pi, radians, sin

from gearlib.drawing.icons import INK
from gearlib.drawing.scheme.axes import Axes
from gearlib.drawing.scheme.routing import TRACK, Routing
from gearlib.drawing.scheme.shown_results import Listing, ShownResults, places_of_numbers
from gearlib.drawing.scheme.train import Symbol
from gearlib.drawing.style import COLOURS
from gearlib.drawing.svg import animated, circle, element, group, line, number, text

FORWARD, BACK, SWEPT = COLOURS[3], COLOURS[4], "#e3e8ee"
SWING, RADIUS, RIM = 120.0, 7.0, 12.0  # of the shaft that turns most, degrees; radii of the number and of the dial
NARROW, WIDEST, LEAST = 3.0, 13.0, 1e-3  # widths of bands, and the least amplitude that has one
FRAMES, PERIOD = 32, 2.0  # of the animation; s


@dataclass(frozen=True)
class ShownMotion(ShownResults):
    """Swing of each shaft over one period.

    Parameters
    ----------
    mode : str
        Number and frequency of the mode.
    turns : mapping of int to complex
        Amplitude of each shaft over the largest; shafts without one are not shown.
    """

    mode: str
    turns: Mapping[int, complex]

    @property
    def heading(self) -> str:
        """The mode."""
        return self.mode

    def background(self, axes: Axes, routing: Routing) -> Iterator[str]:
        """Bands along the shafts and their gears, as wide as the amplitude, in the colour of the sense."""
        lines = [*routing.lines, *_webs(axes, routing)]
        for shaft, turn in self.turns.items():
            if abs(turn) > LEAST:
                bands = [line(x1, y1, x2, y2) for x1, y1, x2, y2, of in lines if of == shaft]
                values = _over_a_period(turn)
                widths = (number(_width(value)) for value in values)
                colours = [_colour(value) for value in values]
                yield group(
                    [*bands, animated("stroke-width", widths, PERIOD),
                     animated("stroke", colours, PERIOD, calcMode="discrete")],
                    class_="band", stroke=_colour(turn.real), stroke_width=number(_width(turn)), stroke_opacity="0.45",
                )  # fmt: skip

    def above(self, axes: Axes, routing: Routing) -> Iterator[str]:
        """Dials with the numbers of the shafts: grey as far as they swing, coloured up to the hand."""
        for count, shaft, x, y in places_of_numbers(axes, routing):
            if shaft in self.turns:
                yield group(
                    _dial(self.turns[shaft], str(count)), f"shaft {count}: {_amplitude(self.turns[shaft])}",
                    transform=f"translate({number(x)} {number(y)})", class_="dial",
                )  # fmt: skip

    def notes(self, symbol: Symbol) -> list[str]:
        """Amplitudes of its flanges."""
        pairs = zip(symbol.ports, symbol.shafts, strict=True)
        return [f"{port}: {_amplitude(self.turns[shaft])}" for port, shaft in pairs if shaft in self.turns]

    def listing(self, axes: Axes, routing: Routing) -> Listing:
        """For each shaft: its number, amplitude and phase, and the flanges on it."""
        rows = []
        for count, shaft, _, _ in places_of_numbers(axes, routing):
            if shaft in self.turns:
                turn, on = self.turns[shaft], routing.spines[shaft][1]
                names = dict.fromkeys(axes.symbols[i].named(axes.symbols[i].ports[flange]) for i, flange, _ in on)
                angle = _phase(turn) if abs(turn) > LEAST else "-"
                rows.append((str(count), f"{abs(turn):.3f}", angle, ", ".join(names)))
        return Listing(("shaft", "amplitude", "phase, °", "flanges on it"), tuple(rows), self._note)

    @property
    def _note(self) -> str:
        if max(map(abs, self.turns.values()), default=0.0) <= LEAST:
            return "no shaft of the drawing turns in this mode"
        return f"bands and dials: angle over the largest ({SWING:g}° on a dial); orange and violet turn in opposite senses"


def _amplitude(turn: complex) -> str:
    return f"{abs(turn):.3f} of the largest" + (f", phase {_phase(turn)}°" if abs(turn) > LEAST else "")


def _phase(turn: complex) -> str:
    """In degrees, above -180 and up to 180."""
    whole = round(degrees(phase(turn)))
    return str(180 if whole == -180 else whole)


def _colour(value: float) -> str:
    return FORWARD if value >= 0 else BACK


def _width(turn: complex) -> float:
    return NARROW + (WIDEST - NARROW) * abs(turn)


def _over_a_period(turn: complex) -> list[float]:
    """Angle at equal intervals over a period, with both ends."""
    angle = phase(turn)
    return [abs(turn) * cos(2 * pi * k / FRAMES + angle) for k in range(FRAMES + 1)]


def _webs(axes: Axes, routing: Routing) -> Iterator[tuple[float, float, float, float, int]]:
    """Gears of pairs, which belong to their shafts and are drawn with their symbol."""
    for symbol, place in zip(axes.symbols, routing.places, strict=True):
        if symbol.kind in ("external", "internal"):
            for k, (shaft, r) in enumerate(zip(symbol.shafts, symbol.radii, strict=True)):
                side = (-1.0 if place.turned else 1.0) * TRACK["internal"] if symbol.kind == "internal" and k == 0 else 0.0
                y = axes.height[axes.of[shaft]]
                yield place.x + side, y - r, place.x + side, y + r, shaft


def _dial(turn: complex, count: str) -> Iterator[str]:
    """Seen along the shaft: the hand is at the top at rest, and clockwise of it for a positive angle."""
    reach, now = SWING * abs(turn), SWING * turn.real
    yield circle(0, 0, RIM, fill="white", stroke=INK, stroke_width="0.8")
    if abs(turn) > LEAST:
        yield _sector(-reach, reach, SWEPT)
        yield _sector(min(0.0, now), max(0.0, now), _colour(now))
    hand = line(0, -RADIUS, 0, -RIM - 3, stroke=INK, stroke_width="2.4", stroke_linecap="round")
    swing = animated("transform", (number(SWING * value) for value in _over_a_period(turn)), PERIOD, "rotate")
    yield group([hand, *([swing] if abs(turn) > LEAST else [])], transform=f"rotate({number(now)})", class_="hand")
    yield circle(0, 0, RADIUS, fill="white", stroke=INK, stroke_width="0.8")
    yield text(0, 3.2, count, text_anchor="middle", font_size="9", fill=INK)


def _sector(start: float, end: float, fill: str) -> str:
    """Part of the dial between two angles from the top, degrees."""
    (x1, y1), (x2, y2) = ((RIM * sin(radians(a)), -RIM * cos(radians(a))) for a in (start, end))
    large = int(end - start > 180)
    corners = f"M0 0 L{number(x1)} {number(y1)} A{number(RIM)} {number(RIM)} 0 {large} 1 {number(x2)} {number(y2)} Z"
    return element("path", d=corners, fill=fill)
