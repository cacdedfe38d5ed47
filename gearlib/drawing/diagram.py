"""Block diagram of a component as SVG: icons, labels, wires coloured by domain."""

from __future__ import annotations

from collections.abc import Iterator

from gearlib.drawing.arrangement import (
    ASIDE,
    LABEL,
    LEFT,
    TITLE,
    ZONE,
    Arrangement,
    Border,
    Placed,
    Wire,
    arranged,
    icon_of,
    label_of,
)
from gearlib.drawing.block_diagram import OWN, Outline, Terminal, folded
from gearlib.drawing.icons import INK, LIGHT
from gearlib.drawing.svg import (
    Picture,
    circle,
    document,
    element,
    group,
    line,
    number,
    path,
    polygon,
    rectangle,
    text,
    text_width,
)

COLOURS = {"rotation": INK, "translation": "#1b7837", "heat": "#c0392b", "signal": "#1f6fd1", "other": "#6a3d9a"}
EDGE = 16.0  # around the diagram, in the units of the picture
GREY = "#5b6b7d"


class Diagram(Picture):
    """Block diagram of a component.

    Displayed by notebooks, and saved with ``save("train.svg")``; ``svg`` is the text. ``arrangement`` holds the positions of boxes and
    wires.
    """

    def __init__(self, outline: Outline, *, fold: bool = True, width: float = 1400.0) -> None:
        self.outline = folded(outline) if fold else outline
        self.arrangement = arranged(self.outline if self.outline.parts else _alone(self.outline), width)
        super().__init__(_document(self.outline, self.arrangement))

    def __repr__(self) -> str:
        boxes, joined = len(self.arrangement.boxes), len(self.arrangement.wires)
        return f"<Diagram of {self.outline.name}: {boxes} boxes, {joined} wires; save('train.svg') writes it>"


def _alone(outline: Outline) -> Outline:
    """A part without displayed contents: its diagram consists of its icon."""
    return Outline(outline.name, outline.kind, parts=(outline,))


def _document(outline: Outline, found: Arrangement) -> str:
    width, height = found.width + 2 * EDGE, found.height + 2 * EDGE
    return document(width, height, _contents(found, EDGE, EDGE, EDGE / 2), f"Diagram of {outline.name} ({outline.kind})")


def _contents(found: Arrangement, x: float, y: float, free: float) -> Iterator[str]:
    """All elements of a layout with its upper left corner at (x, y); the frame keeps a distance ``free``."""
    for wire in found.wires:
        yield _wire(wire, x, y)
    joined = {pin.port for wire in found.wires for pin in wire.net.pins if pin.part == OWN}
    for port in found.border:
        yield from _border(port, x, y, found.width, free, port.port.name in joined)
    for box in found.boxes:
        yield group(_box(box, x + box.x, y + box.y), title=f"{box.part.name}: {box.part.note or box.part.kind}")


def _style(domain: str) -> dict[str, str]:
    thin = domain == "signal"
    return {"stroke": COLOURS[domain], "stroke_width": "1.1" if thin else "1.7"} | ({"stroke_dasharray": "5 3"} if thin else {})


def _wire(wire: Wire, x: float, y: float) -> str:
    d = " ".join(f"M{number(x + x1)} {number(y + y1)} L{number(x + x2)} {number(y + y2)}" for x1, y1, x2, y2 in wire.pieces)
    style = _style(wire.net.domain)
    drawn = [element("path", d=d, fill="none", stroke_linecap="square", **style)]
    drawn += [circle(x + px, y + py, 2.6, fill=style["stroke"]) for px, py in wire.joints]
    pins = ", ".join(f"{p.part}.{p.port}" if p.part else p.port for p in wire.net.pins)
    return group(drawn, title=pins if wire.net.count == 1 else f"{wire.net.count} × {pins}")


def _border(port: Border, x: float, y: float, width: float, free: float, joined: bool) -> Iterator[str]:
    """A port of the component: a square on the frame, its name, and the wire to the first channel if it is connected."""
    frame = x - free if port.side == LEFT else x + width + free
    if joined:
        yield line(frame, y + port.y, x + port.x, y + port.y, **_style(port.port.domain))
    yield _square(port.port, frame, y + port.y)
    at, anchor = (frame + 7, "start") if port.side == LEFT else (frame - 7, "end")
    yield text(at, y + port.y - 4, port.port.name, text_anchor=anchor, font_size="10", fill=COLOURS[port.port.domain])


def _square(port: Terminal, x: float, y: float) -> str:
    colour = COLOURS[port.domain]
    if port.domain == "signal":
        return polygon([(x - 4, y - 4), (x + 4, y), (x - 4, y + 4)], fill=colour)
    return rectangle(x - 3.5, y - 3.5, 7, 7, fill="white" if port.name.endswith("_b") else colour, stroke=colour)


def _box(box: Placed, x: float, y: float) -> Iterator[str]:
    middle, part = x + box.width / 2, box.part
    if box.inner is not None:
        yield from _family(box, x, y, box.width, box.height)
        yield rectangle(x, y, box.width, box.height, rx=6, fill="#fafcfe", stroke=GREY, stroke_dasharray="4 3")
        yield text(x + 8, y + 15, label_of(part), font_weight="bold", fill=INK)
        yield text(
            x + 16 + text_width(label_of(part)) * 1.08, y + 15, part.kind, fill=GREY, font_style="italic", font_size="10"
        )
        free = (box.width - box.inner.width) / 2
        yield from _contents(box.inner, x + free, y + TITLE, free)
        return
    icon = icon_of(part)
    below = y + box.height - LABEL + 12
    if icon.framed:
        body = box.height - LABEL
        yield from _family(box, x, y, box.width, body)
        yield rectangle(x, y, box.width, body, rx=4, fill=LIGHT, stroke=INK, stroke_width="1.3")
        if part.composite:
            yield rectangle(x + 3, y + 3, box.width - 6, body - 6, rx=2, fill="none", stroke=INK, stroke_width="0.6")
        if icon.drawing:
            yield group(icon.drawing, transform=f"translate({number(middle)} {number(y + body / 2)})")
        else:
            wide = {at: max((text_width(p.name, 9) for p, side, _ in box.ends if side == at), default=0.0) for at in (-1, 1)}
            centre = middle + (wide[-1] - wide[1]) / 2
            yield text(centre, y + body / 2 + 4, part.kind, text_anchor="middle", font_size="10", fill=INK)
        for port, side, height in box.ends:
            at, anchor = (x + 7, "start") if side == LEFT else (x + box.width - 7, "end")
            yield _square(port, x if side == LEFT else x + box.width, y + height)
            yield text(at, y + height + 3, port.name, text_anchor=anchor, font_size="9", fill=COLOURS[port.domain])
    else:
        yield from _family(box, middle - 28, y + 2, 56, ZONE - 4)
        yield from _through(box, x, y, middle)
    yield text(middle, below, label_of(part), text_anchor="middle", fill=INK)


def _family(box: Placed, x: float, y: float, width: float, height: float) -> Iterator[str]:
    """Outlines behind a part that stands for several."""
    if box.part.count > 1 or len(box.part.members) > 1:
        for shift in (6, 3):
            yield rectangle(x + shift, y - shift, width, height, rx=4, fill="white", stroke=GREY, stroke_width="0.8")
        yield rectangle(x, y, width, height, rx=4, fill="white", stroke=GREY, stroke_width="0.8")


def _through(box: Placed, x: float, y: float, middle: float) -> Iterator[str]:
    """An icon with its shafts extended to the edges of its box, and further ports below it."""
    icon = icon_of(box.part)
    centre = y + ZONE / 2
    mirror = "scale(-1 1)" if box.mirrored else ""
    place = f"translate({number(middle)} {number(centre)})"
    shafts = [end for end in box.ends if end[0].domain != "signal" and end[0].name not in ASIDE][:2]
    for port, side, height in box.ends:
        edge = x if side == LEFT else x + box.width
        style = _style(port.domain)
        if any(port is shaft for shaft, _, _ in shafts):
            yield line(edge, y + height, middle + 24 * side, y + height, **style)
            continue
        yield path([(edge, y + height), (middle, y + height), (middle, centre + 16)], fill="none", **style)
        at, anchor = (middle - 4, "end") if side == LEFT else (middle + 4, "start")
        yield text(at, y + height - 3, port.name, text_anchor=anchor, font_size="8.5", fill=style["stroke"])
    yield group(icon.drawing, transform=f"{place} {mirror}".strip())
    if icon.letters:
        yield group(icon.letters, transform=place)
