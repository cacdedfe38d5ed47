"""A stick diagram as SVG, plain or with results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gearlib.drawing.icons import ICONS, INK, LIGHT
from gearlib.drawing.scheme.axes import Axes, axes_of
from gearlib.drawing.scheme.labels import Box, Label, placed
from gearlib.drawing.scheme.routing import TRACK, Place, Routing, routed
from gearlib.drawing.scheme.shown_results import Listing, ShownResults
from gearlib.drawing.scheme.train import Symbol, Train
from gearlib.drawing.style import COLOURS
from gearlib.drawing.svg import Picture, circle, document, group, line, number, rectangle, text, text_width

EDGE, HEADING, LINE, BAR = 30.0, 16.0, 1.8, 7.0
GREY = "#5b6b7d"
NUMBERS, NEXT, ROW = 90.0, 64.0, 15.0  # right edge of the first column of numbers, spacing of the next ones; height of rows
BEHIND = {"stroke": "white", "stroke_width": "5", "stroke_linecap": "butt"}
FAR = (14.0, 24.0, 38.0, 56.0, 78.0)  # px, from a part to its name beside it
Names = list[tuple[Label, tuple[float, float, str]]]


class Scheme(Picture):
    """Stick diagram of a train.

    Displayed by notebooks, and saved with ``save("train.svg")``; ``svg`` is the text. ``train`` holds the shafts and their symbols,
    ``routing`` the positions and lines, ``results`` what is shown besides.
    """

    def __init__(self, train: Train, results: ShownResults | None = None) -> None:
        self.train = train
        self.axes = axes_of(train)
        self.routing = routed(self.axes)
        self.results = ShownResults() if results is None else results
        super().__init__(_document(train, self.axes, self.routing, self.results))

    def __repr__(self) -> str:
        return f"<Scheme of {self.train.name}: {self.train.shafts} shafts, {len(self.train.symbols)} parts; save('train.svg') writes it>"


def _document(train: Train, axes: Axes, routing: Routing, results: ShownResults) -> str:
    names = placed_names(axes, routing)
    left, upper, right, lower = _bounds(axes, routing, names)
    title = f"Scheme of {train.name}" + (f" ({train.kind})" if train.kind != train.name else "")
    listing = results.listing(axes, routing)
    words = _words_at(listing)
    widest = max([0.0, *(words + text_width(row[-1], 10) for row in listing.rows)])
    widest = max(widest, text_width(title, 13), text_width(results.heading, 13), text_width(listing.note, 10))
    top = EDGE + (HEADING if results.heading else 0.0)
    width = max(right - left, widest) + 2 * EDGE
    height = lower - upper + top + EDGE
    content = [
        group(
            _drawn(axes, routing, names, results, (left, right)),
            transform=f"translate({number(EDGE - left)} {number(top - upper)})",
        )
    ]
    if results.heading:
        content.append(text(EDGE, 24, results.heading, font_size="13", font_weight="bold", fill=INK))
        title = f"{title}: {results.heading}"
    if listing.rows:
        content += _listed(listing, height)
        height += 40.0 + ROW * len(listing.rows)
    return document(width, height, content, title)


def _bounds(axes: Axes, routing: Routing, names: Names) -> Box:
    x = [c for x1, _, x2, _, _ in routing.lines for c in (x1, x2)] + [p.x for p in routing.places]
    y = [c for _, y1, _, y2, _ in routing.lines for c in (y1, y2)] + [p.y for p in routing.places]
    for symbol, place in zip(axes.symbols, routing.places, strict=True):
        for k, shaft in enumerate(symbol.shafts):
            if symbol.kind in ("external", "internal"):
                at = axes.height[axes.of[shaft]]
                y += [at - symbol.radii[k], at + symbol.radii[k]]
            elif symbol.kind in ("planetary", "double_planetary"):
                y.append(axes.height[axes.of[shaft]] - symbol.radii[1] - 18)
        x += [place.x - 32, place.x + 32]
        y += [place.y - 26, place.y + 30]
    for label, spot in names:
        left, upper, right, lower = label.box(spot)
        x, y = [*x, left, right], [*y, upper, lower]
    return min(x), min(y), max(x), max(y)


def _drawn(axes: Axes, routing: Routing, names: Names, results: ShownResults, ends: tuple[float, float]) -> Iterator[str]:
    for at in axes.height:
        yield line(ends[0], at, ends[1], at, stroke="#9fb0c0", stroke_width="0.8", stroke_dasharray="12 3 2 3")
    yield from results.background(axes, routing)
    for x1, y1, x2, y2, _ in routing.lines:
        if x1 == x2:  # verticals pass behind
            yield line(x1, y1, x2, y2, stroke=INK, stroke_width=LINE, stroke_linecap="round")
    for x1, y1, x2, y2, shaft in routing.lines:
        if y1 == y2 and x1 != x2:
            crossed = [v for v in routing.lines if v[4] != shaft and v[0] == v[2] and min(x1, x2) < v[0] < max(x1, x2)
                       and min(v[1], v[3]) < y1 < max(v[1], v[3])]  # fmt: skip
            for v in crossed:
                yield line(v[0] - 5, y1, v[0] + 5, y1, **BEHIND)
            yield line(x1, y1, x2, y2, stroke=INK, stroke_width=LINE, stroke_linecap="round")
    for symbol, place in zip(axes.symbols, routing.places, strict=True):
        yield group(_symbol(symbol, place, axes), title="\n".join([symbol.name, *results.notes(symbol)]))
    for label, spot in names:
        yield label.drawn(spot)
    yield from results.above(axes, routing)


def placed_names(axes: Axes, routing: Routing) -> Names:
    """The names of the parts, each at its place."""
    named = [(s, p) for s, p in zip(axes.symbols, routing.places, strict=True) if s.label]
    labels = [_label(symbol, place, axes) for symbol, place in named]
    lines = [(min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2)) for x1, y1, x2, y2, _ in routing.lines]
    return list(zip(labels, placed(labels, lines + [_body(*each, axes) for each in named]), strict=True))


def _body(symbol: Symbol, place: Place, axes: Axes) -> Box:
    """What a part covers besides its lines."""
    x, y = place.x, place.y
    if symbol.kind in ("planetary", "double_planetary"):
        base = axes.height[axes.of[symbol.shafts[0]]]
        return x - 10, base - symbol.radii[1], x + 10, base - symbol.radii[0]
    if symbol.kind in ("external", "internal"):
        edges = [
            axes.height[axes.of[s]] + sense * r for s, r in zip(symbol.shafts, symbol.radii, strict=True) for sense in (-1, 1)
        ]
        beside = (-1.0 if place.turned else 1.0) * TRACK["internal"] if symbol.kind == "internal" else 0.0  # of the ring's web
        return min(x - BAR, x + beside), min(edges), max(x + BAR, x + beside), max(edges)
    return x - 10, y - 9, x + 10, y + 9


def _symbol(symbol: Symbol, place: Place, axes: Axes) -> Iterator[str]:
    base = [axes.height[axes.of[s]] for s in symbol.shafts]
    side = -1.0 if place.turned else 1.0
    if symbol.kind in ("external", "internal"):
        yield from _pair(symbol, place.x, side, base)
    elif symbol.kind in ("planetary", "double_planetary"):
        yield from _set(symbol, place.x, base[0])
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


def _set(symbol: Symbol, x: float, y: float) -> Iterator[str]:
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


def _housing(x: float, y: float, up: bool) -> Iterator[str]:
    """Housing: a line with hatching on the side away from the part."""
    yield line(x - 14, y, x + 14, y, stroke=INK, stroke_width="2")
    for k in range(6):
        at = x - 14 + 5 * k
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


def _inline(symbol: Symbol, place: Place) -> Iterator[str]:
    x, y = place.x, place.y
    at = f"translate({number(x)} {number(y)})"
    if symbol.icon == "clutch":
        for side in (-1, 1):
            yield line(x + 24 * side, y, x + 4 * side, y, stroke=INK, stroke_width=LINE)
            yield line(x + 4 * side, y - 9, x + 4 * side, y + 9, stroke="#c0392b", stroke_width="2.6")
    elif symbol.icon in ("box", "ratio"):
        yield rectangle(x - 24, y - 12, 48, 24, rx=3, fill=LIGHT, stroke=INK, stroke_width="1.3")
        if symbol.icon == "ratio":
            yield line(x - 24, y + 12, x + 24, y - 12, stroke=INK, stroke_width="1")
    else:
        icon = ICONS[symbol.icon]
        mirror = " scale(-1 1)" if place.turned else ""
        yield group(icon.drawing, transform=at + mirror)
        if icon.letters:
            yield group(icon.letters, transform=at)


def _end(symbol: Symbol, place: Place) -> Iterator[str]:
    """A drive or load at the end of its shaft; ``turned``: its shaft is on its left."""
    x, y = place.x, place.y
    away = -1.0 if not place.turned else 1.0
    if symbol.icon == "port":
        yield circle(x, y, 4, fill="white", stroke=INK, stroke_width=LINE)
        return
    centre = x + 24 * away
    at = f"translate({number(centre)} {number(y)})"
    icon = ICONS.get(symbol.icon)
    if symbol.icon == "rack" or icon is None:
        yield rectangle(centre - 24, y - 14, 48, 28, rx=3, fill=LIGHT, stroke=INK, stroke_width="1.3")
    else:
        yield group(icon.drawing, transform=at + (" scale(-1 1)" if place.turned else ""))
        yield group(icon.letters, transform=at)


def _label(symbol: Symbol, place: Place, axes: Axes) -> Label:
    """The name of a part, beside, above or below it."""
    x, y, side = place.x, place.y, -1.0 if place.turned else 1.0
    base = [axes.height[axes.of[s]] for s in symbol.shafts]
    if symbol.kind in ("external", "internal"):
        sense = 1.0 if (base[1] > base[0]) == (symbol.kind == "external" or symbol.radii[0] > symbol.radii[1]) else -1.0
        y = base[0] + sense * symbol.radii[0] + 3.5
        return Label(symbol.label, [(x + away, y + up, "start") for away in FAR for up in (0.0, -12.0, 12.0)]
                     + [(x - away, y, "end") for away in FAR])  # fmt: skip
    if symbol.kind in ("planetary", "double_planetary"):
        y = base[0] - sum(symbol.radii) / 2 + 3.5
        return Label(symbol.label, [(x - away * sense, y + up, "end" if sense > 0 else "start")
                                    for away in FAR for up in (0.0, -14.0, 14.0) for sense in (side, -side)])  # fmt: skip
    if symbol.kind == "held":
        return Label(symbol.label, [(x, y + (19 if place.turned else -11), "middle"), (x + 17, y, "start"), (x - 17, y, "end")])
    if symbol.kind == "inline":
        above = 14.0 if symbol.icon == "clutch" else 17.0 if symbol.icon in ("box", "ratio") else 21.0
        rows = [(x, y - above, "middle"), (x, y + above + 7, "middle")]
        return Label(
            symbol.label, rows + [(x + sense * 7, at, end) for _, at, _ in rows for sense, end in ((1, "start"), (-1, "end"))]
        )
    if symbol.icon == "port":
        return Label(symbol.label, [(x - 9 * side, y + 4, "end" if side > 0 else "start")])
    return Label(symbol.label, [(x - 24 * side, y + 30, "middle"), (x - 24 * side, y - 24, "middle")])


def _words_at(listing: Listing) -> float:
    """Left edge of the last column."""
    return NUMBERS + NEXT * (len(listing.head) - 3) + 16.0


def _listed(listing: Listing, y: float) -> Iterator[str]:
    style = {"font_size": "10"}
    edges = [EDGE + NUMBERS + NEXT * k for k in range(len(listing.head) - 2)]
    for k, row in enumerate([listing.head, *listing.rows]):
        at = y + 6 if k == 0 else y + 7 + ROW * k
        fill = GREY if k == 0 else INK
        yield text(EDGE + (8 if k else 0), at, row[0], fill=fill, **style)
        for edge, value in zip(edges, row[1:-1], strict=True):
            yield text(edge, at, value, fill=fill, text_anchor="end", **style)
        yield text(EDGE + _words_at(listing), at, row[-1], fill=fill, **style)
    yield text(EDGE, y + 26 + ROW * len(listing.rows), listing.note, fill=GREY, **style)
