"""A stick diagram as SVG, plain or with the speeds, torques and powers of a steady motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import pi

from gearlib.drawing.icons import ICONS, INK, LIGHT
from gearlib.drawing.sankey import watts
from gearlib.drawing.scheme.axes import Axes, axes_of
from gearlib.drawing.scheme.routing import TRACK, Place, Routing, routed
from gearlib.drawing.scheme.train import Symbol, Train
from gearlib.drawing.style import COLOURS
from gearlib.drawing.svg import Picture, circle, document, group, line, number, polygon, rectangle, text, text_width

EDGE, LINE, BAR = 30.0, 1.8, 7.0
POWER, GREY = "#e08e0b", "#5b6b7d"
WIDEST = 22.0
HALO = {"stroke": "white", "stroke_width": "5", "stroke_linecap": "butt"}
Bounds = tuple[float, float, float, float]


@dataclass(frozen=True)
class Load:
    """Load of a flange: speed (rad/s), torque (N.m) and power (W), the latter two positive into the part."""

    speed: float
    torque: float
    power: float


class Scheme(Picture):
    """Stick diagram of a train.

    Displayed by notebooks, and saved with ``save("train.svg")``; ``svg`` is the text. ``train`` holds the shafts and their symbols,
    ``routing`` the positions and lines.
    """

    def __init__(self, train: Train, loads: Mapping[tuple[str, str], Load] | None = None) -> None:
        self.train = train
        self.axes = axes_of(train)
        self.routing = routed(self.axes)
        super().__init__(_document(train, self.axes, self.routing, loads or {}))

    def __repr__(self) -> str:
        return f"<Scheme of {self.train.name}: {self.train.shafts} shafts, {len(self.train.symbols)} parts; save('train.svg') writes it>"


def _document(train: Train, axes: Axes, routing: Routing, loads: Mapping[tuple[str, str], Load]) -> str:
    left, upper, right, lower = _bounds(axes, routing)
    title = f"Scheme of {train.name}" + (f" ({train.kind})" if train.kind != train.name else "")
    rows = list(_table(axes, routing, loads)) if loads else []
    widest = max((106.0 + text_width(torques, 10) for _, _, torques in rows), default=0.0)
    width = max(right - left, text_width(title, 13), widest) + 2 * EDGE
    height = lower - upper + 2 * EDGE
    drawn = list(_drawn(axes, routing, loads, (left, right)))
    most = max((abs(load.power) for load in loads.values()), default=0.0)
    content = [group(drawn, transform=f"translate({number(EDGE - left)} {number(EDGE - upper)})"), *_listed(rows, height, most)]
    return document(width, height + (40.0 + 15.0 * len(rows) if rows else 0.0), content, title)


def _bounds(axes: Axes, routing: Routing) -> Bounds:
    x = [c for x1, _, x2, _, _ in routing.lines for c in (x1, x2)] + [p.x for p in routing.places]
    y = [c for _, y1, _, y2, _ in routing.lines for c in (y1, y2)] + [p.y for p in routing.places]
    for symbol, place in zip(axes.symbols, routing.places, strict=True):
        for k, shaft in enumerate(symbol.shafts):
            if symbol.kind in ("external", "internal"):
                at = axes.height[axes.of[shaft]]
                y += [at - symbol.radii[k], at + symbol.radii[k]]
            elif symbol.kind in ("planetary", "double_planetary"):
                y.append(axes.height[axes.of[shaft]] - symbol.radii[1] - 18)
        wide = max(32.0, text_width(symbol.label, 10) / 2)
        x += [place.x - wide, place.x + wide]
        y += [place.y - 26, place.y + 30]
    return min(x), min(y), max(x), max(y)


def _drawn(axes: Axes, routing: Routing, loads: Mapping[tuple[str, str], Load], ends: tuple[float, float]) -> Iterator[str]:
    for at in axes.height:
        yield line(ends[0], at, ends[1], at, stroke="#9fb0c0", stroke_width="0.8", stroke_dasharray="12 3 2 3")
    if loads:
        yield from _bands(axes, routing, loads)
    for x1, y1, x2, y2, _ in routing.lines:
        if x1 == x2:  # verticals pass behind
            yield line(x1, y1, x2, y2, stroke=INK, stroke_width=LINE, stroke_linecap="round")
    for x1, y1, x2, y2, shaft in routing.lines:
        if y1 == y2 and x1 != x2:
            crossed = [v for v in routing.lines if v[4] != shaft and v[0] == v[2] and min(x1, x2) < v[0] < max(x1, x2)
                       and min(v[1], v[3]) < y1 < max(v[1], v[3])]  # fmt: skip
            for v in crossed:
                yield line(v[0] - 5, y1, v[0] + 5, y1, **HALO)
            yield line(x1, y1, x2, y2, stroke=INK, stroke_width=LINE, stroke_linecap="round")
    for symbol, place in zip(axes.symbols, routing.places, strict=True):
        yield group(_symbol(symbol, place, axes), title=_tip(symbol, loads))
    if loads:
        yield from _speeds(axes, routing, loads)


def _tip(symbol: Symbol, loads: Mapping[tuple[str, str], Load]) -> str:
    found = [(port, loads[symbol.name, port]) for port in symbol.ports if (symbol.name, port) in loads]
    said = [f"{port}: {at.speed * 30 / pi:.4g} 1/min, {at.torque:.4g} N·m, {watts(at.power)}" for port, at in found]
    return "\n".join([symbol.name, *said])


def _symbol(symbol: Symbol, place: Place, axes: Axes) -> Iterator[str]:
    base = [axes.height[axes.of[s]] for s in symbol.shafts]
    side = -1.0 if place.turned else 1.0
    if symbol.kind in ("external", "internal"):
        yield from _pair(symbol, place.x, side, base)
    elif symbol.kind in ("planetary", "double_planetary"):
        yield from _set(symbol, place.x, base[0], side)
    elif symbol.kind == "held":
        yield from _held(symbol, place)
    elif symbol.kind == "inline":
        yield from _inline(symbol, place)
    else:
        yield from _end(symbol, place)


def _gear(x: float, y1: float, y2: float) -> str:
    """A gear seen from the side: a web and a bar at the teeth."""
    return line(x, y1, x, y2, stroke=INK, stroke_width=LINE)


def _teeth(x: float, y: float, half: float = BAR) -> str:
    return line(x - half, y, x + half, y, stroke=INK, stroke_width=LINE)


def _label(x: float, y: float, content: str, **how: str) -> str:
    style = {
        "text_anchor": "middle",
        "font_size": "10",
        "fill": INK,
        "paint_order": "stroke",
        "stroke": "white",
        "stroke_width": "3",
    }
    return text(x, y, content, **(style | how))


def _pair(symbol: Symbol, x: float, side: float, base: Sequence[float]) -> Iterator[str]:
    gap = 1.5
    for k, (y, r) in enumerate(zip(base, symbol.radii, strict=True)):
        web = x + side * TRACK["internal"] if symbol.kind == "internal" and k == 0 else x
        if web != x:
            for edge in (y - r, y + r):
                yield line(x - BAR, edge, web, edge, stroke=INK, stroke_width=LINE)
            yield _gear(web, y - r, y + r)
        else:
            towards = base[1 - k] - y
            inner = symbol.kind == "internal"
            lower, upper = (r - gap, r) if (towards > 0) != inner else (r, r - gap)
            yield _gear(x, y - upper, y + lower)
            yield _teeth(x, y - upper)
            yield _teeth(x, y + lower)
    sense = 1.0 if (base[1] > base[0]) == (symbol.kind == "external" or symbol.radii[0] > symbol.radii[1]) else -1.0
    yield _label(x + 11, base[0] + sense * symbol.radii[0] + 3.5, symbol.label, text_anchor="start")


def _set(symbol: Symbol, x: float, y: float, side: float) -> Iterator[str]:
    """Upper half of a planetary set."""
    sun, ring = symbol.radii
    yield _teeth(x, y - sun)
    yield _teeth(x, y - ring, 10.0)
    planets = [(sun, ring)] if symbol.kind == "planetary" else [(sun, (sun + ring) / 2 + 5), ((sun + ring) / 2 - 5, ring)]
    for k, (inner, outer) in enumerate(planets):
        at = x + (0 if len(planets) == 1 else (5.0 if k else -5.0))
        yield line(at, y - inner - 2, at, y - outer + 2, stroke=COLOURS[0], stroke_width="2.6")
        for edge in (inner + 2, outer - 2):
            yield line(at - BAR + 1.5, y - edge, at + BAR - 1.5, y - edge, stroke=COLOURS[0], stroke_width=LINE)
        yield circle(at, y - (inner + outer) / 2, 2.2, fill="white", stroke=COLOURS[0], stroke_width="1.4")
    yield _label(x - 14 * side, y - (sun + ring) / 2 + 3.5, symbol.label, text_anchor="end" if side > 0 else "start")


def _housing(x: float, y: float, up: bool, half: float = 14.0) -> Iterator[str]:
    """Housing: a line with hatching on the side away from the part."""
    yield line(x - half, y, x + half, y, stroke=INK, stroke_width="2")
    steps = int(2 * half / 5)
    for k in range(steps + 1):
        at = x - half + 5 * k
        yield line(at, y, at + 4, y + (-7 if up else 7), stroke=INK, stroke_width="1")


def _held(symbol: Symbol, place: Place) -> Iterator[str]:
    up = not place.turned
    out = -1.0 if up else 1.0
    if symbol.icon == "brake":
        yield rectangle(place.x - 4, place.y - (0 if up else 12), 8, 12, fill="white")
        for step in (4.5, 10.5):
            yield line(
                place.x - 10, place.y - out * step, place.x + 10, place.y - out * step, stroke="#c0392b", stroke_width="2.6"
            )
        yield line(place.x, place.y, place.x, place.y - out * 4.5, stroke=INK, stroke_width=LINE)
        yield line(place.x, place.y - out * 10.5, place.x, place.y - out * 12, stroke=INK, stroke_width=LINE)
    yield from _housing(place.x, place.y, up)
    if symbol.label:
        yield _label(place.x, place.y + (-11 if up else 19), symbol.label)


def _inline(symbol: Symbol, place: Place) -> Iterator[str]:
    x, y = place.x, place.y
    at = f"translate({number(x)} {number(y)})"
    if symbol.icon == "clutch":
        for side in (-1, 1):
            yield line(x + 24 * side, y, x + 4 * side, y, stroke=INK, stroke_width=LINE)
            yield line(x + 4 * side, y - 9, x + 4 * side, y + 9, stroke="#c0392b", stroke_width="2.6")
        yield _label(x, y - 14, symbol.label)
    elif symbol.icon in ("box", "ratio"):
        yield rectangle(x - 24, y - 12, 48, 24, rx=3, fill=LIGHT, stroke=INK, stroke_width="1.3")
        if symbol.icon == "ratio":
            yield line(x - 24, y + 12, x + 24, y - 12, stroke=INK, stroke_width="1")
        yield _label(x, y - 17, symbol.label)
    else:
        icon = ICONS[symbol.icon]
        mirror = " scale(-1 1)" if place.turned else ""
        yield group(icon.drawing, transform=at + mirror)
        if icon.letters:
            yield group(icon.letters, transform=at)
        yield _label(x, y - 21, symbol.label)


def _end(symbol: Symbol, place: Place) -> Iterator[str]:
    """A drive or load at the end of its shaft; ``turned``: its shaft is on its left."""
    x, y = place.x, place.y
    away = -1.0 if not place.turned else 1.0
    if symbol.icon == "port":
        yield circle(x, y, 4, fill="white", stroke=INK, stroke_width=LINE)
        yield _label(x + 9 * away, y + 4, symbol.label, text_anchor="end" if away < 0 else "start")
        return
    centre = x + 24 * away
    at = f"translate({number(centre)} {number(y)})"
    icon = ICONS.get(symbol.icon)
    if symbol.icon == "rack" or icon is None:
        yield rectangle(centre - 24, y - 14, 48, 28, rx=3, fill=LIGHT, stroke=INK, stroke_width="1.3")
    else:
        yield group(icon.drawing, transform=at + (" scale(-1 1)" if place.turned else ""))
        yield group(icon.letters, transform=at)
    yield _label(centre, y + 30, symbol.label)


# ---------------------------------------------------------------- results


def _bands(axes: Axes, routing: Routing, loads: Mapping[tuple[str, str], Load]) -> Iterator[str]:
    """Power flow along the shafts, with width proportional to power and arrows in its direction."""
    top = max((abs(load.power) for load in loads.values()), default=0.0)
    if not top:
        return
    for y, points in routing.spines.values():
        passing = 0.0
        for (i, flange, x1), (_, _, x2) in zip(points, points[1:], strict=False):
            symbol = axes.symbols[i]
            found = loads.get((symbol.name, symbol.ports[flange]))
            passing -= 0.0 if found is None else found.power
            if abs(passing) > 1e-3 * top and x2 - x1 > 1:
                yield from _arrow(x1, x2, y, passing / top)


def _arrow(x1: float, x2: float, y: float, share: float) -> Iterator[str]:
    width = max(WIDEST * abs(share), 2.0)
    start, end = (x1, x2) if share > 0 else (x2, x1)
    yield line(start, y, end, y, stroke=POWER, stroke_width=width, stroke_opacity="0.45")
    if abs(end - start) > 30:
        sense = 1 if share > 0 else -1
        yield polygon([(end - 12 * sense, y - width / 2 - 4), (end, y), (end - 12 * sense, y + width / 2 + 4)], fill=POWER)


def _speeds(axes: Axes, routing: Routing, loads: Mapping[tuple[str, str], Load]) -> Iterator[str]:
    """The number of each shaft at its longest segment; the table below gives its speed."""
    for k, (_, (y, points)) in enumerate(_numbered(routing)):
        places = sorted({p[2] for p in points})
        gaps = [(b - a, (a + b) / 2) for a, b in zip(places, places[1:], strict=False)]
        x = max(gaps)[1] if gaps else places[0]
        yield circle(x, y, 7, fill="white", stroke=INK, stroke_width="1")
        yield text(x, y + 3.2, str(k + 1), text_anchor="middle", font_size="9", fill=INK)


def _numbered(routing: Routing) -> list[tuple[int, tuple[float, tuple[tuple[int, int, float], ...]]]]:
    return sorted(routing.spines.items())


def _table(axes: Axes, routing: Routing, loads: Mapping[tuple[str, str], Load]) -> Iterator[tuple[str, str, str]]:
    """For each shaft: its number, its speed, and the torques on it."""
    for k, (_, (_, points)) in enumerate(_numbered(routing)):
        on = [(axes.symbols[i], axes.symbols[i].ports[flange]) for i, flange, _ in points]
        found = [(s, port, loads[s.name, port]) for s, port in on if (s.name, port) in loads]
        if found:
            torques = ", ".join(
                f"{s.name if len(s.ports) == 1 else f'{s.name}.{port}'} {load.torque:.4g}" for s, port, load in found
            )
            yield str(k + 1), f"{found[0][2].speed * 30 / pi:.5g}", torques


def _listed(rows: Sequence[tuple[str, str, str]], y: float, most: float) -> Iterator[str]:
    if rows:
        yield text(EDGE, y + 6, "shaft", font_size="10", fill=GREY)
        yield text(EDGE + 90, y + 6, "1/min", font_size="10", fill=GREY, text_anchor="end")
        yield text(EDGE + 106, y + 6, "torques into the parts, N·m", font_size="10", fill=GREY)
    for k, (shaft, speed, torques) in enumerate(rows):
        at = y + 22 + 15 * k
        yield text(EDGE + 8, at, shaft, font_size="10", fill=INK)
        yield text(EDGE + 90, at, speed, font_size="10", fill=INK, text_anchor="end")
        yield text(EDGE + 106, at, torques, font_size="10", fill=INK)
    if rows:
        at = y + 26 + 15 * len(rows)
        yield text(EDGE, at, f"bands: power along the shafts, widest {watts(most)}", font_size="10", fill=GREY)
