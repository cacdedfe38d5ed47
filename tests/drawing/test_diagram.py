"""Block diagrams: everything is drawn, nothing lies on anything else."""

import xml.etree.ElementTree as ET
from itertools import combinations

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.drawing.arrangement import TITLE, Arrangement
from gearlib.drawing.block_diagram import OWN, Net, Outline, Pin, Terminal
from gearlib.drawing.diagram import Diagram
from gearlib.drawing.icons import ICONS
from gearlib.drawing.svg import text_width
from gearlib.errors import ArgumentError
from gearlib.language.component import Component
from gearlib.language.interior import path_of


class EightSpeeds(gl.Component):
    """Automatic gearbox of four planetary sets, two brakes and three clutches."""

    def assemble(self):
        self.engine, self.shaft = gp.Torque(tau=200.0), gp.Inertia(J=0.1)
        self.p1, self.p2, self.p3, self.p4 = (gp.IdealPlanetary(ratio=r) for r in (2.0, 2.0, 1.6, 3.7))
        self.A, self.B = (gp.Brake(fn_max=1e4, f_normalized=f) for f in (1.0, 0.0))
        self.C, self.D, self.E = (gp.Clutch(fn_max=1e4, f_normalized=f) for f in (1.0, 0.0, 0.0))
        self.out, self.vehicle = gp.Inertia(J=0.2), gp.Inertia(J=20.0)
        self.propeller = gp.SpringDamper(c=1e4, d=10.0)
        self.road = gp.QuadraticSpeedDependentTorque(tau_nominal=-100.0, w_nominal=100.0)
        return [
            gl.connect(self.engine.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.p2.carrier, self.E.flange_a),
            gl.connect(self.p1.sun, self.p2.sun, self.B.flange_a),
            gl.connect(self.p1.ring, self.A.flange_a),
            gl.connect(self.p1.carrier, self.p4.ring),
            gl.connect(self.p2.ring, self.p3.sun, self.C.flange_a),
            gl.connect(self.C.flange_b, self.p4.sun, self.E.flange_b, self.p3.ring),
            gl.connect(self.p3.carrier, self.D.flange_a),
            gl.connect(self.D.flange_b, self.p4.carrier, self.out.flange_a),
            gl.connect(self.out.flange_b, self.propeller.flange_a),
            gl.connect(self.propeller.flange_b, self.vehicle.flange_a),
            gl.connect(self.vehicle.flange_b, self.road.flange),
        ]


class Chain(gl.Component):
    count = gl.Structural(100, "bodies")

    def assemble(self):
        self.motor, self.load, self.ground = gp.Torque(tau=10.0), gp.Damper(d=1.0), gp.Fixed()
        self.body = [gp.Inertia(J=1.0) for _ in range(self.count)]
        self.spring = [gp.SpringDamper(c=1e4, d=1.0) for _ in range(self.count - 1)]
        return [
            gl.connect(self.motor.flange, self.body[0].flange_a),
            *(gl.connect(body.flange_b, spring.flange_a) for body, spring in zip(self.body, self.spring, strict=False)),
            *(gl.connect(spring.flange_b, body.flange_a) for body, spring in zip(self.body[1:], self.spring, strict=True)),
            gl.connect(self.body[-1].flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]


class Controlled(gl.Component):
    """A speed controller: signals between parts, and a port of a part's part."""

    class Controller(gl.Component):
        w = gl.Input("rad/s", "speed")
        tau = gl.Variable("N.m", "torque")

        def equations(self):
            return [gl.Eq(self.tau, 5.0 * (10.0 - self.w))]

    class Motor(gl.Component):
        tau = gl.Input("N.m", "torque")

        def assemble(self):
            self.rotor, self.source = gp.Inertia(J=1.0), gp.Torque(tau=self.tau)
            return [gl.connect(self.source.flange, self.rotor.flange_a)]

    def assemble(self):
        self.sensor, self.ground, self.bearing = gp.SpeedSensor(), gp.Fixed(), gp.Damper(d=1.0)
        self.controller = self.Controller(w=self.sensor.w)
        self.motor = self.Motor(tau=self.controller.tau)
        return [
            gl.connect(self.motor.rotor.flange_b, self.sensor.flange, self.bearing.flange_a),
            gl.connect(self.bearing.flange_b, self.ground.flange),
        ]


MODELS = {
    "xp": (gp.ZhouCui2022, 3),
    "xp, top": (gp.ZhouCui2022, 1),
    "eight speeds": (EightSpeeds, 1),
    "chain": (Chain, 1),
    "control": (Controlled, 1),
    "control, inside": (Controlled, 2),
    "separate meshes": (lambda: gp.PlanetaryUnit(planet_meshes="separate"), 2),
    "planar": (gp.PlanarPlanetaryUnit, 1),
    "px": (gp.PXTrain, 2),
    "xx": (gp.XXTrain, 2),
    "ravigneaux": (lambda: gp.Ravigneaux(ratio_small=2.0, ratio_large=2.5), 2),
    "heat": (lambda: gp.Gearbox(use_heat_port=True, ratio=2.0, c=1e5, d=10.0), 1),
    "one part": (lambda: gp.Inertia(J=1.0), 1),
}  # fmt: skip


def box_edges(box):
    return box.x, box.y, box.x + box.width, box.y + box.height


def check(found: Arrangement) -> None:
    """Nothing lies on anything else, and every wire joins its pins."""
    for a, b in combinations(found.boxes, 2):
        (ax, ay, bx, by), (cx, cy, dx, dy) = box_edges(a), box_edges(b)
        assert bx <= cx or dx <= ax or by <= cy or dy <= ay, (a.part.name, b.part.name)
    for wire in found.wires:
        for x1, y1, x2, y2 in wire.pieces:
            assert x1 == x2 or y1 == y2, wire.net
            assert 0 <= min(x1, x2) <= max(x1, x2) <= found.width
            assert 0 <= min(y1, y2) <= max(y1, y2) <= found.height, wire.net
            for box in found.boxes:
                ax, ay, bx, by = box_edges(box)
                apart = max(x1, x2) <= ax or bx <= min(x1, x2) or max(y1, y2) <= ay or by <= min(y1, y2)
                assert apart, (wire.net, box.part.name)
        assert joins(wire, found), wire.net
    for a, b in combinations(found.wires, 2):
        for p in a.pieces:
            for q in b.pieces:
                assert not along(p, q), (a.net, b.net, p, q)
    for box in found.boxes:
        if box.inner is not None:
            assert box.inner.width <= box.width
            assert box.inner.height + TITLE <= box.height
            check(box.inner)


def test_a_port_that_nothing_inside_uses_has_no_wire_inside() -> None:
    class Inner(gl.Component):
        used = gl.Input("N.m", "torque", default=0.0)
        idle = gl.Input("N.m", "bound from outside, and read by nothing", default=0.0)

        def assemble(self):
            self.torque, self.body = gp.Torque(tau=self.used), gp.Inertia(J=1.0)
            return [gl.connect(self.torque.flange, self.body.flange_a)]

    class Outer(gl.Component):
        a, b = gl.Input("N.m", "torque"), gl.Input("N.m", "torque")

        def assemble(self):
            self.inner = Inner(used=self.a, idle=self.b)
            return []

    svg = ET.fromstring(Outer().diagram(2).svg)
    name = "{http://www.w3.org/2000/svg}"
    heights = {t.text: float(t.get("y")) + 4 for t in svg.iter(f"{name}text")}
    stubs = {float(line.get("y1")) for line in svg.iter(f"{name}line") if line.get("stroke-dasharray") == "5 3"}
    assert heights["used"] in stubs
    assert heights["a"] in stubs
    rows = [line for line in svg.iter(f"{name}line") if float(line.get("y1")) == heights["idle"]]
    assert all(
        float(line.get("x1")) < 60 for line in rows if line.get("stroke-dasharray") == "5 3"
    )  # outside of the frame only
    assert heights["idle"] not in stubs or heights["b"] == heights["idle"]


def along(p, q) -> bool:
    """Whether two pieces lie on each other; crossing at a right angle is fine."""
    if p[1] == p[3] == q[1] == q[3]:
        (a, b), (c, d) = sorted((p[0], p[2])), sorted((q[0], q[2]))
    elif p[0] == p[2] == q[0] == q[2]:
        (a, b), (c, d) = sorted((p[1], p[3])), sorted((q[1], q[3]))
    else:
        return False
    return min(b, d) - max(a, c) > 1e-9


def joins(wire, found) -> bool:
    """Whether the pieces of a wire are one, and reach each of its pins."""
    graph = nx.Graph()
    points = {(x, y) for x1, y1, x2, y2 in wire.pieces for x, y in ((x1, y1), (x2, y2))}
    places = set()
    for pin in wire.net.pins:
        if pin.part == OWN:
            port = next(b for b in found.border if b.port.name == pin.port)
            places.add((port.x, port.y))
        else:
            box = next(b for b in found.boxes if b.part.name == pin.part)
            side, height = next((side, y) for port, side, y in box.ends if port.name == pin.port)
            places.add((box.x if side < 0 else box.x + box.width, box.y + height))
    for x1, y1, x2, y2 in wire.pieces:
        on = sorted(p for p in points | places if min(x1, x2) <= p[0] <= max(x1, x2) and min(y1, y2) <= p[1] <= max(y1, y2))
        nx.add_path(graph, on)
    return places <= set(graph) and nx.is_connected(graph)


def drawn_pins(outline: Outline, path: str = "") -> set[frozenset[str]]:
    """The connections of an outline, by paths."""
    own = {
        frozenset(f"{path}{pin.part}.{pin.port}" if pin.part else f"{path}{pin.port}" for pin in net.pins)
        for net in outline.nets if net.domain != "signal"
    }  # fmt: skip
    return own.union(*(drawn_pins(part, f"{path}{part.name}.") for part in outline.parts))


def connections_of(component: Component, depth: int, path: str = "") -> nx.Graph:
    """What a component connects, from the connections themselves, down to a depth."""
    graph = nx.Graph()
    if depth == 0:
        return graph
    for connection in component._assembled():
        names = []
        for port in connection.ports:
            inner = path_of(port.component, component)
            names.append(f"{path}{inner}.{port.connector.name}" if inner else f"{path}{port.connector.name}")
        nx.add_path(graph, names)
    for name, part in component._parts.items():
        graph.update(connections_of(part, depth - 1, f"{path}{name}."))
    return graph


@pytest.mark.parametrize("fold", [True, False])
@pytest.mark.parametrize("name", MODELS)
def test_models_are_drawn_clearly(name, fold):
    make, depth = MODELS[name]
    diagram = make().diagram(depth, fold=fold)
    check(diagram.arrangement)
    root = ET.fromstring(diagram.svg)
    assert root.tag.endswith("svg")
    assert make().diagram(depth, fold=fold).svg == diagram.svg  # the same for the same model


@pytest.mark.parametrize("name", MODELS)
def test_every_part_and_connection_is_drawn(name):
    make, depth = MODELS[name]
    component = make()
    diagram = component.diagram(depth, fold=False)

    def paths(arrangement, prefix=""):
        for box in arrangement.boxes:
            yield prefix + box.part.name
            if box.inner is not None:
                yield from paths(box.inner, f"{prefix}{box.part.name}.")

    def expected(part, level, prefix=""):
        for own, inner in part._parts.items():
            yield prefix + own
            if level > 1:
                yield from expected(inner, level - 1, f"{prefix}{own}.")

    if component._parts:
        assert sorted(paths(diagram.arrangement)) == sorted(expected(component, depth))
    drawn = nx.Graph()
    for pins in drawn_pins(diagram.outline):
        nx.add_path(drawn, sorted(pins))
    asked = {frozenset(pins) for pins in nx.connected_components(connections_of(component, depth))}
    for pins in asked:
        there = [group for group in nx.connected_components(drawn) if pins & group]
        assert len(there) == 1, pins
        assert pins <= there[0]
    shown = sum(len(inner.wires) for inner in arrangements(diagram.arrangement))
    assert shown == sum(len(o.nets) for o in outlines(diagram.outline))


def arrangements(found):
    yield found
    for box in found.boxes:
        if box.inner is not None:
            yield from arrangements(box.inner)


def outlines(outline):
    yield outline
    for part in outline.parts:
        yield from outlines(part)


def test_kinds_of_opened_parts_stand_behind_their_names():
    diagram = gp.ZhouCui2022().diagram(2)
    texts = list(ET.fromstring(diagram.svg).iter("{http://www.w3.org/2000/svg}text"))
    names = [t for t in texts if t.get("font-weight") == "bold"]
    kinds = [t for t in texts if t.get("font-style") == "italic"]
    opened = [box for found in arrangements(diagram.arrangement) for box in found.boxes if box.inner is not None]
    beside = {(name.text, kind.text) for name in names for kind in kinds
              if name.get("y") == kind.get("y")
              and 0 < float(kind.get("x")) - float(name.get("x")) - text_width(name.text) < 30}  # fmt: skip
    assert opened
    assert {(box.part.name, box.part.kind) for box in opened} <= beside


def test_families_and_chains_are_folded():
    planets = gp.PlanetaryUnit(planet_meshes="separate", planets=5).diagram()
    counts = {box.part.name: box.part.count for box in planets.arrangement.boxes}
    assert counts["planet"] == counts["sun_meshes"] == counts["ring_meshes"] == 5
    assert "planet × 5" in planets.svg
    chain = Chain().diagram()
    middle = next(box.part for box in chain.arrangement.boxes if box.part.icon == "chain")
    assert len(chain.arrangement.boxes) == 8
    assert len(middle.members) == 98 + 97
    assert middle.note.splitlines()[1] == f"{middle.members[0]} ... {middle.members[-1]}"
    assert {"body[1]", "body[98]", "spring[1]", "spring[97]"} <= set(middle.members)
    assert len(Chain().diagram(fold=False).arrangement.boxes) == 202


class Stage(gl.Component):
    """As many discs as are chosen."""

    discs = gl.Structural(1, "how many")

    def assemble(self):
        self.disc = [gp.Inertia(J=1.0) for _ in range(self.discs)]
        return []


@pytest.mark.parametrize(
    ("sizes", "depth", "drawn"),
    [
        ((2, 2, 2), 2, {"stage": (3, ("stage[0]", "stage[1]", "stage[2]"))}),
        ((2, 1, 2), 2, {"stage[0]": (1, ()), "stage[1]": (1, ()), "stage[2]": (1, ())}),
        ((2, 1, 2), 1, {"stage": (3, ("stage[0]", "stage[1]", "stage[2]"))}),
        ((2,), 2, {"stage[0]": (1, ())}),
    ],
)
def test_members_are_drawn_once_where_they_look_alike(sizes, depth, drawn):
    """To the depth that is drawn; the note names the first and the last, and says what the first is."""

    class Train(gl.Component):
        def assemble(self):
            self.stage = [Stage(discs=n) for n in sizes]
            return []

    found = Train().diagram(depth).outline
    assert {part.name: (part.count, part.members) for part in found.parts} == drawn
    for part in found.parts:
        if part.count > 1:
            assert part.note.splitlines()[:2] == ["stage[0] ... stage[2]", "Stage"]
            assert [(disc.name, disc.count) for disc in part.parts] == ([("disc", 2)] if depth == 2 else [])


def test_signals_are_drawn_as_arrows():
    diagram = Controlled().diagram()
    signals = {frozenset((p.part, p.port) for p in net.pins) for net in diagram.outline.nets if net.domain == "signal"}
    assert signals == {
        frozenset({("sensor", "w"), ("controller", "w")}),
        frozenset({("controller", "tau"), ("motor", "tau")}),
    }


def test_every_icon_of_the_library_exists_and_is_used():
    classes = [cls for name in dir(gp) if isinstance(cls := getattr(gp, name), type) and issubclass(cls, Component)]
    used = {cls.icon for cls in (*classes, type(gp.PlanarPlanetaryUnit().sun_gear)) if cls.icon}
    assert used <= set(ICONS)
    assert set(ICONS) - used <= {"block"}
    for icon in ICONS.values():
        ET.fromstring("<g>" + "".join((*icon.drawing, *icon.letters)) + "</g>")
        assert icon.left % 8 == icon.right % 8 == 0


def test_a_picture_is_saved_as_svg_only(tmp_path):
    picture = gp.XPTrain().diagram()
    assert picture._repr_svg_() == picture.save(tmp_path / "train.svg").read_text(encoding="utf-8")
    with pytest.raises(ArgumentError, match="name it"):
        picture.save(tmp_path / "train.png")
    with pytest.raises(ArgumentError, match="depth"):
        gp.XPTrain().diagram(depth=0)
    with pytest.raises(ArgumentError, match="200 pixels"):
        gp.XPTrain().diagram(width=10)


def test_names_are_escaped():
    odd = Outline("<&>", 'a"b', ports=(Terminal("p<"),), parts=(Outline("x&y", "K<", ports=(Terminal("p<"),)),), nets=(
        Net((Pin(OWN, "p<"), Pin("x&y", "p<"))),))  # fmt: skip
    ET.fromstring(Diagram(odd).svg)


ICON_NAMES = [name for name in ICONS if name != "block"]


@st.composite
def random_outlines(draw, level=0):
    count = draw(st.integers(1, 9 if level == 0 else 4))
    parts = []
    for i in range(count):
        if level < 2 and draw(st.integers(0, 6)) == 0:
            parts.append(Outline(**{**vars(draw(random_outlines(level + 1))), "name": f"c{i}"}))
            continue
        icon = draw(st.sampled_from(["", *ICON_NAMES]))
        names = draw(st.sampled_from([("flange",), ("flange_a", "flange_b"), ("sun", "carrier", "ring"), ("a", "b", "c", "d"),
                                      ("flange_a", "flange_b", "support", "heat_port")]))  # fmt: skip
        parts.append(Outline(f"part{i}" * draw(st.integers(1, 4)), "Kind", icon, tuple(Terminal(n) for n in names)))
    own = tuple(Terminal(f"own{i}") for i in range(draw(st.integers(0, 3))))
    pins = [Pin(part.name, port.name) for part in parts for port in part.ports] + [Pin(OWN, port.name) for port in own]
    pins = draw(st.permutations(pins))
    nets = []
    while len(pins) > 1 and draw(st.integers(0, 9)):
        size = min(len(pins), draw(st.integers(2, 5)))
        nets.append(Net(tuple(pins[:size]), draw(st.sampled_from(["rotation", "rotation", "heat", "signal"]))))
        pins = pins[size:]
    return Outline("model", "Model", "", own, tuple(parts), tuple(nets), True)


@settings(max_examples=25, deadline=None)
@given(random_outlines(), st.sampled_from([300.0, 700.0, 1400.0]))
def test_random_models_are_drawn_clearly(outline, width):
    diagram = Diagram(outline, width=width)
    check(diagram.arrangement)
    ET.fromstring(diagram.svg)
    assert sum(len(a.wires) for a in arrangements(diagram.arrangement)) == sum(len(o.nets) for o in outlines(diagram.outline))
