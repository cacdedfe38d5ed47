"""Gears seen along their axes: an SVG picture that moves, a page with a slider, an animation of matplotlib."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from math import degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import real, shown
from gearlib.drawing.gears.gear_set import GearSet, WheelPosition
from gearlib.drawing.icons import BODY, INK, LIGHT
from gearlib.drawing.style import MARK
from gearlib.drawing.svg import Picture, animated, circle, document, element, escaped, group, line, number, polygon, text
from gearlib.errors import ArgumentError
from gearlib.optional import optional

Floats = NDArray[np.float64]

SIZE, TOP, BOTTOM, EDGE = 440.0, 26.0, 40.0, 14.0  # of a panel, pixels
LONGEST = 0.32  # of a force, over the panel's extent
FILLS = {"ring": LIGHT, "centre": BODY, "planet": "#bcd3ea"}
GREY = "#5b6b7d"


@dataclass(frozen=True, eq=False)
class GearMotion:
    """A set of gears over the frames of a view.

    Parameters
    ----------
    name : str
        Path of the component; empty for the model itself.
    gears : GearSet
    first, carrier : array
        Angles in each frame, rad.
    forces : array
        Of each mesh in each frame, shape (frames, contacts), N; no columns where forces are not shown.
    """

    name: str
    gears: GearSet
    first: Floats
    carrier: Floats
    forces: Floats

    @property
    def largest(self) -> float:
        """The largest force of a mesh in all frames, N."""
        return float(np.abs(self.forces).max(initial=0.0))

    def at(self, frame: int) -> list[WheelPosition]:
        """Where the wheels are in a frame."""
        return self.gears.placed(float(self.first[frame]), float(self.carrier[frame]))

    def arrows(self, frame: int) -> list[tuple[float, float, float, float]]:
        """Of each mesh: its pitch point, and the force on the second wheel as a length in the picture, m."""
        if not self.largest:
            return []
        scale, placed = LONGEST * self.gears.extent / self.largest, self.at(frame)
        return [
            self.gears.force_on_b(c, placed, float(f) * scale)
            for c, f in zip(self.gears.contacts, self.forces[frame], strict=True)
        ]


class GearView(Picture):
    """Gears seen along their axes, over some frames.

    Shown by notebooks; ``save("gears.svg")`` writes the picture, which moves where there are several frames, and
    ``save("gears.html")`` a page with a slider. `animate` makes an animation of matplotlib.

    Parameters
    ----------
    name : str
        Of the model.
    motions : sequence of GearMotion
        The sets, which are shown side by side.
    captions : sequence of str
        What each frame shows, such as its time.
    """

    def __init__(self, name: str, motions: Sequence[GearMotion], captions: Sequence[str]) -> None:
        self.name, self.motions, self.captions = name, tuple(motions), tuple(captions)
        moving = len(self.captions) > 1
        super().__init__(self._drawn(moving), self._page() if moving else None)

    def __repr__(self) -> str:
        wheels = sum(len(m.gears.wheels) for m in self.motions)
        written = "save('gears.svg') or save('gears.html')" if len(self.captions) > 1 else "save('gears.svg')"
        return f"<GearView of {self.name}: {wheels} gears, {len(self.captions)} frames; {written} writes it>"

    def animate(self, interval: float = 50.0) -> Any:
        """A matplotlib ``FuncAnimation`` of the frames; ``.save("gears.gif", writer="pillow")`` writes a GIF.

        Parameters
        ----------
        interval : float
            Between frames, ms.
        """
        plt, patches = optional("matplotlib.pyplot"), optional("matplotlib.patches")
        FuncAnimation = optional("matplotlib.animation").FuncAnimation
        between = real("interval", interval, "milliseconds")
        if not 1 <= between <= 1e6:
            raise ArgumentError(f"interval is {shown(interval)}; expected milliseconds, from 1 to 1e6")
        figure, axes = plt.subplots(
            1, len(self.motions), figsize=(5 * len(self.motions), 5.2), layout="constrained", squeeze=False
        )
        wheels, arrows = [], []
        for motion, ax in zip(self.motions, axes[0], strict=True):
            left, low, right, high = _bounds(motion.gears)
            ax.set(xlim=(left, right), ylim=(low, high), aspect="equal", title=motion.name or self.name)
            ax.axis("off")
            for wheel in _back_to_front(motion.gears):
                drawn = motion.gears.wheels[wheel]
                fill = FILLS["ring" if drawn.ring else "planet" if drawn.orbit else "centre"]
                if drawn.ring:
                    ax.add_patch(patches.Circle((0, 0), _rim(motion.gears, wheel), facecolor=fill, edgecolor=INK))
                shape = ax.add_patch(
                    patches.Polygon(
                        drawn.outline, closed=True, facecolor="white" if drawn.ring else fill, edgecolor=INK, lw=0.8
                    )
                )
                (mark,) = ax.plot([], [], color=INK, lw=2)
                wheels.append((motion, wheel, shape, mark))
            for k in range(len(motion.arrows(0))):
                arrow = ax.annotate(
                    "", (0, 0), (0, 0), arrowprops={"arrowstyle": "-|>", "color": MARK, "lw": 2}, annotation_clip=False
                )
                arrows.append((motion, k, arrow))
        title = figure.suptitle(self.captions[0], fontsize=10)

        def update(frame: int) -> list[Any]:
            for motion, wheel, shape, mark in wheels:
                at, drawn = motion.at(frame)[wheel], motion.gears.wheels[wheel]
                shape.set_xy(_moved(drawn.outline, at))
                inner, outer = _mark(motion.gears, wheel)
                mark.set_data(*_moved(np.array([[inner, 0.0], [outer, 0.0]]), at).T)
            for motion, k, arrow in arrows:
                x, y, fx, fy = motion.arrows(frame)[k]
                arrow.set_position((x, y))
                arrow.xy = (x + fx, y + fy)
            title.set_text(self.captions[frame])
            return [shape for _, _, shape, _ in wheels]

        update(0)
        return FuncAnimation(figure, update, frames=len(self.captions), interval=between)

    def _drawn(self, moving: bool) -> str:
        content: list[str] = []
        x = 0.0
        for motion in self.motions:
            content += _panel(motion, x, moving, motion.name or self.name)
            x += SIZE
        if not moving:  # a picture that moves cannot change its text
            content.append(text(x / 2, TOP + SIZE + 18, self.captions[0], text_anchor="middle", fill=INK, class_="caption"))
        return document(x, TOP + SIZE + BOTTOM, content, f"Gears of {self.name}")

    def _page(self) -> str:
        """The picture with a slider; its script moves the wheels and arrows."""
        panels = [(motion, SIZE * k) for k, motion in enumerate(self.motions)]
        frames = []
        for k, caption in enumerate(self.captions):
            places = [_screen(motion, x, k)[wheel] for motion, x in panels for wheel in _back_to_front(motion.gears)]
            ends = [end for motion, x in panels for end in _screen_arrows(motion, x, k)]
            frames.append({"caption": caption, "wheels": _rounded(places), "arrows": _rounded(ends)})
        script = files("gearlib.drawing.gears").joinpath("gear_view.js").read_text(encoding="utf-8")
        data = json.dumps(frames, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
        return (
            f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Gears of {escaped(self.name)}</title>\n'
            '<link rel="icon" href="data:,"><style>body{margin:0;font-family:Helvetica,Arial,sans-serif;background:white}'
            "svg{max-width:100%;height:auto;display:block}.move{display:flex;gap:8px;padding:4px 14px}.move input{flex:1}</style></head>\n"
            f'<body>{self._drawn(False)}\n<div class="move"><button type="button">Play</button>'
            f'<input type="range" min="0" max="{len(frames) - 1}" value="0" aria-label="frame"></div>\n'
            f'<script type="application/json">{data}</script>\n<script>\n{script}</script></body></html>\n'
        )


def _rounded(rows: Sequence[Sequence[float]]) -> list[list[float]]:
    return [[float(f"{v:.6g}") for v in row] for row in rows]


def _bounds(gears: GearSet) -> tuple[float, float, float, float]:
    """Left, lower, right and upper edge of a square around everything in all its motion, m."""
    turning = any(abs(c) > 0 for _, c in gears.holding.values()) or any(w.ring for w in gears.wheels)
    if turning:
        r = gears.extent * 1.04
        return -r, -r, r, r
    first, second = (float(np.hypot(*w.outline.T).max()) for w in gears.wheels[:2])
    left, right = -first, gears.wheels[1].orbit + second
    middle, half = (left + right) / 2, (right - left) / 2 * 1.04
    return middle - half, -half, middle + half, half


def _scale(gears: GearSet) -> tuple[float, float, float]:
    """Pixels per metre, and the set's axis in its panel, pixels."""
    left, low, right, _ = _bounds(gears)
    scale = (SIZE - 2 * EDGE) / (right - left)
    return scale, EDGE - left * scale, TOP + SIZE - EDGE + low * scale


def _screen(motion: GearMotion, x: float, frame: int) -> list[tuple[float, float, float]]:
    """Centre (pixels) and angle (degrees, clockwise) of each wheel."""
    scale, left, middle = _scale(motion.gears)
    return [(x + left + scale * w.x, middle - scale * w.y, -degrees(w.angle)) for w in motion.at(frame)]


def _screen_arrows(motion: GearMotion, x: float, frame: int) -> list[tuple[float, float, float, float]]:
    scale, left, middle = _scale(motion.gears)
    return [
        (x + left + scale * px, middle - scale * py, x + left + scale * (px + fx), middle - scale * (py + fy))
        for px, py, fx, fy in motion.arrows(frame)
    ]


def _moved(points: Floats, at: WheelPosition) -> Floats:
    c, s = np.cos(at.angle), np.sin(at.angle)
    moved: Floats = points @ np.array([[c, s], [-s, c]]) + [at.x, at.y]
    return moved


def _rim(gears: GearSet, wheel: int) -> float:
    return float(np.hypot(*gears.wheels[wheel].outline.T).max()) * 1.1


def _mark(gears: GearSet, wheel: int) -> tuple[float, float]:
    """The mark that shows a wheel's rotation: distances of its inner and outer end from the axis, m."""
    drawn = gears.wheels[wheel]
    if drawn.ring:
        rim = _rim(gears, wheel)
        return rim - 0.07 * rim, rim - 0.015 * rim
    return 0.3 * drawn.pitch_radius, 0.75 * drawn.pitch_radius


def _back_to_front(gears: GearSet) -> list[int]:
    return sorted(range(len(gears.wheels)), key=lambda k: not gears.wheels[k].ring)


def _panel(motion: GearMotion, x: float, moving: bool, title: str) -> Iterator[str]:
    """One set: its wheels, their pitch circles and names, and the forces of the meshes."""
    gears = motion.gears
    scale = _scale(gears)[0]
    frames = range(len(motion.first)) if moving else range(1)
    places = [_screen(motion, x, k) for k in frames]
    yield text(x + SIZE / 2, 18, title, text_anchor="middle", font_weight="bold", fill=INK)
    for wheel in _back_to_front(gears):
        drawn, (cx, cy, angle) = gears.wheels[wheel], places[0][wheel]
        shape = [(scale * px, -scale * py) for px, py in drawn.outline.tolist()]
        parts = []
        fill = FILLS["ring" if drawn.ring else "planet" if drawn.orbit else "centre"]
        if drawn.ring:
            parts.append(circle(0, 0, scale * _rim(gears, wheel), fill=fill, stroke=INK, stroke_width="1"))
        parts.append(
            polygon(shape, fill="white" if drawn.ring else fill, stroke=INK, stroke_width="0.8", stroke_linejoin="round")
        )
        parts.append(
            circle(0, 0, scale * drawn.pitch_radius, fill="none", stroke=GREY, stroke_width="0.6", stroke_dasharray="8 2 2 2")
        )
        inner, outer = _mark(gears, wheel)
        parts.append(line(scale * inner, 0, scale * outer, 0, stroke=INK, stroke_width="2"))
        if not drawn.ring:
            parts.append(circle(0, 0, 2.5, fill=INK))
        length = _length(len(places))
        turning = [animated("transform", (number(p[wheel][2]) for p in places), length, "rotate")] if moving else []
        turned = group([*parts, *turning], transform=f"rotate({number(angle)})", class_="turn")
        shifted = [(p[wheel][0], p[wheel][1]) for p in places]
        moves = (f"{number(px)} {number(py)}" for px, py in shifted)
        shifting = [animated("transform", moves, length, "translate")] if len(set(shifted)) > 1 else []
        yield group(
            [turned, *shifting], drawn.name,
            transform=f"translate({number(cx)} {number(cy)})", class_="wheel",
        )  # fmt: skip
    yield from _named(gears, x)
    ends = [_screen_arrows(motion, x, k) for k in frames]
    for k in range(len(ends[0])):
        yield _arrow([e[k] for e in ends], moving)
    if ends[0]:
        shown, unit = (motion.largest, "N") if motion.largest < 1e4 else (motion.largest / 1e3, "kN")
        second = "planets" if len(gears.wheels) > 2 else gears.wheels[1].name.partition(":")[0]
        about = f"arrows: forces of the meshes on the {second}, longest {shown:.4g} {unit}"
        yield text(x + SIZE / 2, TOP + SIZE + 34, about, text_anchor="middle", fill=GREY, font_size="10")


def _named(gears: GearSet, x: float) -> Iterator[str]:
    """Names with numbers of teeth in one line above the picture; like planets are named once."""
    kinds: dict[str, int] = {}
    for wheel in gears.wheels:
        name, _, teeth = wheel.name.partition(": ")
        kind = f"{name.rstrip(' 0123456789') if wheel.orbit and name.startswith('planet') else name}: {teeth}"
        kinds[kind] = kinds.get(kind, 0) + 1
    words = [f"{kind} teeth" if count == 1 else f"{count} × {kind} teeth" for kind, count in kinds.items()]
    yield text(x + SIZE / 2, 34, ", ".join(words), text_anchor="middle", fill=GREY, font_size="10")


def _length(frames: int) -> float:
    """Duration of the animation, s."""
    return max(0.08 * frames, 1.0)


def _arrow(ends: Sequence[tuple[float, float, float, float]], moving: bool) -> str:
    """An arrow as a path, so that one value animates all of it."""
    shapes = [_arrow_path(*e) for e in ends]
    style: Mapping[str, str] = {"fill": MARK, "stroke": MARK, "stroke_width": "1.6", "stroke_linejoin": "round"}
    return element("path", animated("d", shapes, _length(len(ends))) if moving else "", d=shapes[0], class_="force", **style)


def _arrow_path(x1: float, y1: float, x2: float, y2: float) -> str:
    """A shaft and a head, always of as many points."""
    length = float(np.hypot(x2 - x1, y2 - y1))
    ux, uy = ((x2 - x1) / length, (y2 - y1) / length) if length else (1.0, 0.0)
    head = min(9.0, 0.6 * length)
    bx, by, half = x2 - head * ux, y2 - head * uy, 0.38 * head
    points = [(x1, y1), (bx, by), (bx - half * uy, by + half * ux), (x2, y2), (bx + half * uy, by - half * ux), (bx, by)]
    return "M" + " L".join(f"{number(px)} {number(py)}" for px, py in points)
