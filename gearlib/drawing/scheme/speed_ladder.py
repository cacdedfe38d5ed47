"""Speed ladders of planetary sets: shafts are rails at positions given by the ratios, motions are straight lines across them.

By Willis' equation the speed of a carrier lies between those of sun and ring in the ratio of their teeth, so that the speeds of all
members of a set, drawn at the right positions, lie on a straight line (the diagram of Ravigneaux and Kutzbach). Sets that share two
shafts share one ladder.

References
----------
K. Kutzbach, "Mehrgliedrige Radgetriebe und ihre Gesetze", Maschinenbau 6 (1927) 1080.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, log10, pi

from gearlib.drawing.icons import INK
from gearlib.drawing.scheme.labels import HALO
from gearlib.drawing.scheme.train import Symbol, Train, members
from gearlib.drawing.style import COLOURS, MARK
from gearlib.drawing.svg import Picture, circle, document, group, line, path, text, text_width
from gearlib.errors import ModelError

WIDTH, HEIGHT, EDGE, ROW = 320.0, 260.0, 24.0, 14.0
BETWEEN = 96.0  # two ladders
FITS = 1e-6  # relative mismatch of Willis' equation up to which speeds are those of the set
GREY = "#5b6b7d"
BENT = "not straight: a damper slips, or other ratios than the model's"
Speeds = Mapping[tuple[str, str], float]


@dataclass
class Ladder:
    """Sets with common rails, and the position of each shaft's rail (sun of the first set at 0, its ring at 1)."""

    sets: list[Symbol] = field(default_factory=list)
    rails: dict[int, float] = field(default_factory=dict)


def ladders(train: Train) -> list[Ladder]:
    """Ladders of a train; sets with two common shafts share one.

    >>> one = Symbol("front", "planetary", "planetary", (0, 1, 2), ("sun", "carrier", "ring"), (1.0, 2.0))
    >>> two = Symbol("rear", "planetary", "planetary", (0, 3, 1), ("sun", "carrier", "ring"), (1.0, 2.0))
    >>> {shaft: round(place, 3) for shaft, place in ladders(Train("", "", (one, two), 4))[0].rails.items()}
    {0: 0.0, 2: 1.0, 1: 0.667, 3: 0.444}
    """
    found: list[Ladder] = []
    left = train.sets
    while left:
        for symbol in left:
            here = next((ladder for ladder in found if len(ladder.rails.keys() & set(symbol.shafts)) >= 2), None)
            if here is not None:
                break
        else:
            symbol, here = left[0], Ladder()
            found.append(here)
            here.rails |= {symbol.shafts[0]: 0.0, symbol.shafts[2]: 1.0}
        left.remove(symbol)
        sun, carrier, ring = symbol.shafts
        i, at = ratio_of(symbol), here.rails
        if sun in at and ring in at:
            at.setdefault(carrier, (at[sun] + i * at[ring]) / (1 + i))
        elif sun in at:
            at[ring] = ((1 + i) * at[carrier] - at[sun]) / i
        else:
            at[sun] = (1 + i) * at[carrier] - i * at[ring]
        here.sets.append(symbol)
    return found


def ratio_of(symbol: Symbol) -> float:
    """Teeth of the ring over teeth of the sun; negative with double pinions."""
    ratio = symbol.radii[1] / symbol.radii[0]
    return ratio if symbol.kind == "planetary" else -ratio


def speed_ladder(train: Train, motions: Mapping[str, Speeds]) -> Picture:
    """Draw the speeds of all planetary sets.

    Parameters
    ----------
    train : Train
    motions : mapping of str to speeds
        Speeds (rad/s) by part and flange, for each motion to compare; a single one may have an empty name.

    Raises
    ------
    ModelError
        No planetary set.
    """
    drawn = ladders(train)
    if not drawn:
        raise ModelError(f"{train.name}: it has no planetary set, whose speeds a ladder would show")
    speeds = {name: _by_shaft(train, found) for name, found in motions.items()}
    shown = [w * 30 / pi for found in speeds.values() for ladder in drawn for s, w in found.items() if s in ladder.rails]
    low, high = min([0.0, *shown]), max([0.0, *shown])
    if high == low:
        low, high = -1.0, 1.0
    labels = {s: _label(train, ladder, s) for ladder in drawn for s in ladder.rails}
    rows = max(len(_staggered(ladder, labels)) for ladder in drawn)
    top = EDGE + 46 + ROW * rows
    scale = HEIGHT / (high - low)

    def y(speed: float) -> float:
        return top + (high - speed) * scale

    content: list[str] = []
    left = EDGE + 56
    for k, ladder in enumerate(drawn):
        content += _ladder(ladder, left + k * (WIDTH + BETWEEN), speeds, labels, y, (low, high))
    right = left + len(drawn) * (WIDTH + BETWEEN)
    for tick in _ticks(low, high):
        content.insert(
            0, line(left - 12, y(tick), right - BETWEEN + 12, y(tick), stroke=INK if tick == 0 else "#dfe6ee", stroke_width="1")
        )
        content.append(text(left - 18, y(tick) + 4, f"{tick:g}", text_anchor="end", font_size="10", fill=INK))
    title = f"Speeds of {train.name}, 1/min"
    content.append(text(EDGE, EDGE, title, font_size="13", font_weight="bold", fill=INK))
    bottom = top + HEIGHT + EDGE + 14
    for k, name in enumerate(n for n in speeds if n):
        at = bottom + ROW * k
        content.append(line(left, at - 4, left + 24, at - 4, stroke=COLOURS[k % len(COLOURS)], stroke_width="2"))
        content.append(text(left + 30, at, name, font_size="10", fill=INK))
    return Picture(document(max(right, text_width(title, 13) + 2 * EDGE), bottom + ROW * len(speeds) + 8, content, title))


def _by_shaft(train: Train, speeds: Speeds) -> dict[int, float]:
    """Speeds of the shafts of the sets."""
    return {shaft: speeds[s.name, port] for shaft, s, port in members(train) if s in train.sets and (s.name, port) in speeds}


def is_straight(symbol: Symbol, speeds: Mapping[int, float]) -> bool:
    """Whether the speeds of a set's shafts satisfy Willis' equation.

    >>> one = Symbol("set", "planetary", "planetary", (0, 1, 2), ("sun", "carrier", "ring"), (1.0, 2.0))
    >>> is_straight(one, {0: 3.0, 1: 1.0, 2: 0.0}), is_straight(one, {0: 3.1, 1: 1.0, 2: 0.0})
    (True, False)
    """
    if not all(s in speeds for s in symbol.shafts):
        return True
    (sun, carrier, ring), i = (speeds[s] for s in symbol.shafts), ratio_of(symbol)
    return abs(sun + i * ring - (1 + i) * carrier) <= FITS * (1 + abs(i)) * max(abs(w) for w in speeds.values())


def _label(train: Train, ladder: Ladder, shaft: int) -> str:
    """Names of the members on a shaft; for a single set, without the set's name."""
    names = [
        port if len(ladder.sets) == 1 else f"{s.name}.{port}"
        for on, s, port in members(train)
        if on == shaft and s in ladder.sets
    ]
    return " = ".join(names)


def _staggered(ladder: Ladder, labels: Mapping[int, str]) -> list[list[int]]:
    """Shafts grouped into rows whose labels do not overlap."""
    low, high = min(ladder.rails.values()), max(ladder.rails.values())
    rows: list[list[int]] = []
    ends: list[float] = []
    for shaft in sorted(ladder.rails, key=ladder.rails.__getitem__):
        x, half = (ladder.rails[shaft] - low) / (high - low) * WIDTH, text_width(labels[shaft], 10) / 2 + 5
        row = next((k for k, end in enumerate(ends) if x - half > end), len(ends))
        if row == len(ends):
            ends.append(0.0)
            rows.append([])
        ends[row] = x + half
        rows[row].append(shaft)
    return rows


def _ladder(
    ladder: Ladder,
    x: float,
    speeds: Mapping[str, Mapping[int, float]],
    labels: Mapping[int, str],
    y: Callable[[float], float],
    span: tuple[float, float],
) -> Iterator[str]:
    low, high = min(ladder.rails.values()), max(ladder.rails.values())
    at = {shaft: x + (place - low) / (high - low) * WIDTH for shaft, place in ladder.rails.items()}
    yield text(
        x + WIDTH / 2, EDGE + 22, ", ".join(s.name for s in ladder.sets), text_anchor="middle", font_size="11", fill=GREY
    )
    base = {shaft: EDGE + 24 + ROW * (row + 1) for row, shafts in enumerate(_staggered(ladder, labels)) for shaft in shafts}
    for shaft, label_y in base.items():
        yield line(at[shaft], label_y + 3, at[shaft], y(span[0]), stroke=GREY, stroke_width="1")
    for shaft, label_y in base.items():  # above the rails, which they interrupt
        yield text(at[shaft], label_y, labels[shaft], text_anchor="middle", font_size="10", fill=INK, **HALO)
    for k, (name, found) in enumerate(speeds.items()):
        points = sorted((at[s], y(found[s] * 30 / pi), found[s] * 30 / pi) for s in at if s in found)
        if len(points) < 2:
            continue
        colour = COLOURS[k % len(COLOURS)]
        parts = [path([p[:2] for p in points], fill="none", stroke=colour, stroke_width="2")]
        parts += [circle(px, py, 3.2, fill=colour) for px, py, _ in points]
        if len(speeds) == 1:
            parts += [
                text(
                    px + 6,
                    py - 6,
                    f"{w:.5g}",
                    font_size="10",
                    fill=colour,
                    **HALO,
                )
                for px, py, w in points
            ]
        yield group(parts, title=name or None)
    if not all(is_straight(symbol, found) for symbol in ladder.sets for found in speeds.values()):
        yield text(x + WIDTH / 2, y(span[0]) + 16, BENT, text_anchor="middle", font_size="9", fill=MARK)


def _ticks(low: float, high: float) -> Sequence[float]:
    raw = (high - low) / 6
    step = 10.0 ** floor(log10(raw))
    step *= next(m for m in (1, 2, 5, 10) if m * step >= raw)
    first = -floor(-low / step + 1e-9) if low < 0 else 0
    return [k * step for k in range(int(first), floor(high / step + 1e-9) + 1)]
