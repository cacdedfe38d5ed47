"""Pictures of block diagrams: wires, boxes, ports and names are where the layout says, alike on both sides."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from gearlib.drawing.arrangement import ASIDE, LABEL, LEFT, RIGHT, TITLE, ZONE, Arrangement, Placed, icon_of, label_of
from gearlib.drawing.block_diagram import OWN, Net, Outline, Pin, Terminal
from gearlib.drawing.diagram import COLOURS, EDGE, Diagram
from tests.drawing.shapes import CLOSE, Shape, shapes
from tests.drawing.test_diagram import MODELS


def several() -> Diagram:
    """All that a box may be: framed or not, of one shaft or two or more, with ports aside, of a family, opened, with a border."""
    two = (Terminal("flange_a"), Terminal("flange_b"))
    inner = Outline(
        "inner", "Inner", ports=(*two, Terminal("u", "signal")),
        parts=(Outline("body", "Inertia", "inertia", two), Outline("law", "Law", ports=(Terminal("u", "signal"), Terminal("y", "signal")))),
        nets=(Net((Pin(OWN, "flange_a"), Pin("body", "flange_a"))), Net((Pin(OWN, "flange_b"), Pin("body", "flange_b"))),
              Net((Pin(OWN, "u"), Pin("law", "u")), "signal")),
    )  # fmt: skip
    parts = (
        Outline("motor", "Torque", "torque", (Terminal("flange"), Terminal("support"), Terminal("heat_port", "heat"))),
        Outline("set", "Set", "planetary", (Terminal("sun"), Terminal("carrier"), Terminal("ring"))),
        Outline("pair", "Pair", "gear", (*two, Terminal("support")), count=3),
        Outline("thing", "SomethingWithALongName", "", (Terminal("a"), Terminal("long_port_b"), Terminal("c")), composite=True),
        inner,
        Outline("end", "Load", "load", (Terminal("flange"),)),
    )
    nets = (
        Net((Pin("motor", "flange"), Pin("set", "sun"))),
        Net((Pin("set", "carrier"), Pin("pair", "flange_a"))),
        Net((Pin("pair", "flange_b"), Pin("inner", "flange_a"), Pin("thing", "a"))),
        Net((Pin("inner", "flange_b"), Pin("end", "flange"))),
        Net((Pin(OWN, "command"), Pin("inner", "u")), "signal", 2),
        Net((Pin(OWN, "housing"), Pin("motor", "support"), Pin("pair", "support"))),
        Net((Pin(OWN, "warmth"), Pin("motor", "heat_port")), "heat"),
    )
    own = (Terminal("command", "signal"), Terminal("housing"), Terminal("warmth", "heat"), Terminal("idle_b", "translation"))
    return Diagram(Outline("all", "All", ports=own, parts=parts, nets=nets, composite=True), width=2000.0)


DIAGRAMS = {"several": several, **{name: (lambda m=make, d=depth: m().diagram(d)) for name, (make, depth) in MODELS.items()}}


@pytest.fixture(scope="module", params=DIAGRAMS)
def diagram(request: pytest.FixtureRequest) -> Diagram:
    found: Diagram = DIAGRAMS[request.param]()
    return found


def layouts(found: Arrangement, x: float, y: float, free: float) -> Iterator[tuple[Arrangement, float, float, float]]:
    """All layouts with their places in the picture, and how far their frames stand off."""
    yield found, x, y, free
    for box in found.boxes:
        if box.inner is not None:
            margin = (box.width - box.inner.width) / 2
            yield from layouts(box.inner, x + box.x + margin, y + box.y + TITLE, margin)


def near(found: list[Shape], kind: str, point: tuple[float, float]) -> list[Shape]:
    return [s for s in found if s.kind == kind and np.hypot(*(s.middle - point)) < CLOSE]


def inside(shape: Shape, corner: np.ndarray, opposite: np.ndarray) -> bool:
    return bool((shape.middle >= corner).all() and (shape.middle <= opposite).all())


def named(found: list[Shape], words: str, y: float) -> Shape:
    """The text nearest to a height."""
    here = [s for s in found if s.text == words]
    assert here, f"{words} is not there"
    return min(here, key=lambda s: abs(s.middle[1] - y))


def test_wires_and_their_joints_are_drawn_at_their_places(diagram: Diagram) -> None:
    drawn = shapes(diagram.svg)
    expected = []
    for found, x, y, _ in layouts(diagram.arrangement, EDGE, EDGE, EDGE / 2):
        for wire in found.wires:
            colour, thin = COLOURS[wire.net.domain], wire.net.domain == "signal"
            names = ", ".join(f"{p.part}.{p.port}" if p.part else p.port for p in wire.net.pins)
            title = names if wire.net.count == 1 else f"{wire.net.count} × {names}"
            points = np.array(wire.pieces).reshape(-1, 2) + [x, y]
            expected.append((points, colour, thin, title, np.array(wire.joints).reshape(-1, 2) + [x, y]))
    wires = [s for s in drawn if s.attributes.get("stroke-linecap") == "square"]
    assert len(wires) == len(expected)
    for wire, (points, colour, thin, title, joints) in zip(wires, expected, strict=True):
        assert wire.points == pytest.approx(points, abs=CLOSE)
        assert (wire.attributes["stroke"], wire.title) == (colour, title)
        assert (wire.attributes.get("stroke-dasharray") is not None, wire.attributes["stroke-width"] < "1.5") == (thin, thin)
        dots = [s.middle for s in drawn if s.kind == "circle" and s.title == title and s.attributes["fill"] == colour]
        assert np.array(dots).reshape(-1, 2) == pytest.approx(joints, abs=CLOSE)


def test_ports_of_the_component_stand_at_its_frame(diagram: Diagram) -> None:
    """A mark on the frame, and the name inside of it, above the wire; a wire to the first channel only if something is connected."""
    drawn = shapes(diagram.svg)
    offsets = []
    for found, x, y, free in layouts(diagram.arrangement, EDGE, EDGE, EDGE / 2):
        used = {pin.port for wire in found.wires for pin in wire.net.pins if pin.part == OWN}
        for port in found.border:
            at = np.array([x - free if port.side == LEFT else x + found.width + free, y + port.y])
            mark = near(drawn, "polygon" if port.port.domain == "signal" else "rect", (at[0], at[1]))
            hollow = port.port.domain != "signal" and port.port.name.endswith("_b")
            assert [s.attributes.get("fill") for s in mark][-1:] == ["white" if hollow else COLOURS[port.port.domain]]
            stubs = [
                s
                for s in drawn
                if s.kind == "line" and s.points == pytest.approx(np.array([at, [x + port.x, at[1]]]), abs=CLOSE)
            ]
            assert len(stubs) == (port.port.name in used)
            name = min((s for s in drawn if s.text == port.port.name), key=lambda s: np.hypot(*(s.points[0] - at)))
            assert name.attributes["text-anchor"] == ("start" if port.side == LEFT else "end")
            offsets.append((-port.side * (name.points[0] - at)[0], (name.points[0] - at)[1]))
    for across, up in offsets:
        assert (across, up) == pytest.approx(offsets[0])
        assert across > 4
        assert -6 < up <= -2


def test_boxes_have_frames_names_and_ports(diagram: Diagram) -> None:
    drawn = shapes(diagram.svg)
    for found, x, y, _ in layouts(diagram.arrangement, EDGE, EDGE, EDGE / 2):
        for box in found.boxes:
            title = f"{box.part.name}: {box.part.note or box.part.kind}"
            corner = np.array([x + box.x, y + box.y])
            own = [s for s in drawn if s.title == title and inside(s, corner - 7, corner + [box.width + 7, box.height + 7])]
            centre = corner + [box.width / 2, (box.height - LABEL) / 2]
            if box.inner is not None:
                assert near(own, "rect", tuple(corner + [box.width / 2, box.height / 2]))
                name, kind = named(own, label_of(box.part), corner[1]), named(own, box.part.kind, corner[1])
                assert name.points[0][1] == kind.points[0][1]
                assert corner[1] < name.box[1] < name.box[3] < corner[1] + TITLE
                assert corner[0] < name.points[0][0] < name.box[2] < kind.points[0][0]
                continue
            name = named(own, label_of(box.part), corner[1] + box.height)
            assert name.points[0][0] == pytest.approx(centre[0], abs=CLOSE)
            assert corner[1] + box.height - LABEL < name.box[1] < name.box[3] < corner[1] + box.height
            if icon_of(box.part).framed:
                framed(box, own, corner, centre)
            else:
                with_shafts(box, own, corner, corner + [box.width / 2, ZONE / 2])
            behind = [
                s
                for s in own
                if s.kind == "rect" and s.attributes.get("fill") == "white" and s.attributes.get("stroke-width") == "0.8"
            ]
            assert len(behind) == (3 if box.part.count > 1 or len(box.part.members) > 1 else 0)
            shifts = np.array([s.middle - behind[-1].middle for s in behind])
            assert shifts == pytest.approx(np.array([[6, -6], [3, -3], [0, 0]])[: len(behind)] if behind else shifts)


def framed(box: Placed, own: list[Shape], corner: np.ndarray, centre: np.ndarray) -> None:
    """A frame about the whole body, a second one at equal distances in it where there is more inside, and marks on its edges."""
    frames = near(own, "rect", tuple(centre))
    outer = max(frames, key=lambda s: np.ptp(s.points[:, 0]))
    assert outer.box == pytest.approx((*corner, *(2 * centre - corner)), abs=CLOSE)
    seconds = [s for s in frames if s.attributes.get("stroke-width") == "0.6"]
    assert len(seconds) == bool(box.part.composite)
    for inner in seconds:
        assert inner.box == pytest.approx(np.array(outer.box) + [3, 3, -3, -3], abs=CLOSE)
    gaps = []
    for port, side, height in box.ends:
        at = corner + [0 if side == LEFT else box.width, height]
        assert near(own, "polygon" if port.domain == "signal" else "rect", tuple(at))
        name = named(own, port.name, at[1])
        assert name.points[0][1] - 0.36 * name.size == pytest.approx(at[1], abs=0.5)
        assert name.attributes["text-anchor"] == ("start" if side == LEFT else "end")
        gaps.append((-side * (name.points[0][0] - at[0]), name))
    assert len({round(gap, 2) for gap, _ in gaps}) <= 1
    if not icon_of(box.part).drawing:
        kind = named(own, box.part.kind, centre[1])
        assert kind.points[0][1] - 0.36 * kind.size == pytest.approx(centre[1], abs=0.5)
        left = max((s.box[2] for gap, s in gaps if s.attributes["text-anchor"] == "start"), default=corner[0])
        right = min((s.box[0] for gap, s in gaps if s.attributes["text-anchor"] == "end"), default=corner[0] + box.width)
        assert left < kind.box[0] < kind.box[2] < right
        if {side for _, side, _ in box.ends} == {LEFT, RIGHT}:  # in the middle of what the ports' names leave free
            assert kind.box[0] - left == pytest.approx(right - kind.box[2], abs=0.1)


def with_shafts(box: Placed, own: list[Shape], corner: np.ndarray, centre: np.ndarray) -> None:
    """Shafts from the edges to the icon, at equal heights; other ports below it, each with its name above its line."""
    shafts = [end for end in box.ends if end[0].domain != "signal" and end[0].name not in ASIDE][:2]
    for end in box.ends:
        port, side, height = end
        at = corner + [0 if side == LEFT else box.width, height]
        colour = COLOURS[port.domain]
        if end in shafts:
            to = np.array([centre[0] + 24 * side, at[1]])
            assert any(
                s.kind == "line"
                and s.points == pytest.approx(np.array([at, to]), abs=CLOSE)
                and s.attributes["stroke"] == colour
                for s in own
            )
        else:
            line = next(s for s in own if s.kind == "path" and s.points[0] == pytest.approx(at, abs=CLOSE))
            assert line.points[1:] == pytest.approx(np.array([[centre[0], at[1]], [centre[0], centre[1] + 16]]), abs=CLOSE)
            name = named(own, port.name, at[1])
            assert name.attributes["text-anchor"] == ("end" if side == LEFT else "start")
            assert side * (name.points[0][0] - centre[0]) == pytest.approx(4)
            assert -5 < name.points[0][1] - at[1] <= -2
    own_shafts = [port for port in box.part.ports if port.domain != "signal" and port.name not in ASIDE][:2]
    heights = dict(zip(own_shafts, (icon_of(box.part).left, icon_of(box.part).right)[-len(own_shafts) :], strict=True))
    for port, side, height in shafts:
        assert height == ZONE / 2 + heights[port]
        first = len(own_shafts) == 2 and port == own_shafts[0]
        assert box.mirrored == (side == (RIGHT if first else LEFT))


def test_the_page_has_equal_margins(diagram: Diagram) -> None:
    """And nothing reaches out of it."""
    page = shapes(diagram.svg)[0]
    assert page.box == (
        0,
        0,
        pytest.approx(diagram.arrangement.width + 2 * EDGE, abs=0.01),
        diagram.arrangement.height + 2 * EDGE,
    )
    for shape in shapes(diagram.svg)[1:]:
        if shape.kind != "text":
            assert min(shape.box[:2]) >= 0
            assert shape.box[2] <= page.box[2]
            assert shape.box[3] <= page.box[3]


def test_what_it_is_called() -> None:
    found = several()
    assert repr(found) == "<Diagram of all: 6 boxes, 7 wires; save('train.svg') writes it>"
    assert "<title>Diagram of all (All)</title>" in found.svg
