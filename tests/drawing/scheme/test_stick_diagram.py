"""Stick diagrams: every part of a train is drawn, shafts join what is connected, and bands are as wide as the power."""

import xml.etree.ElementTree as ET
from functools import cache
from random import Random

import networkx as nx
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.icons import INK
from gearlib.drawing.scheme.routing import RouteSearch
from gearlib.drawing.scheme.stick_diagram import Scheme
from gearlib.drawing.scheme.train import train_of
from gearlib.errors import ModelError
from gearlib.language.outline import outline

SVG = "{http://www.w3.org/2000/svg}"


class TwoStages(gl.Component):
    """A motor, two stages of spur gears, a machine behind a coupling."""

    def assemble(self):
        self.motor, self.rotor, self.middle, self.machine = gp.Torque(tau=10.0), *(gp.Inertia(J=0.1) for _ in range(3))
        self.first = gp.ExternalMesh(r_a=0.02, r_b=0.06, c=1e8, d=1e3)
        self.second = gp.ExternalMesh(r_a=0.025, r_b=0.08, c=1e8, d=1e3)
        self.coupling = gp.SpringDamper(c=1e4, d=1.0)
        self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-50.0, w_nominal=20.0)
        return [
            gl.connect(self.motor.flange, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.first.flange_a),
            gl.connect(self.first.flange_b, self.middle.flange_a),
            gl.connect(self.middle.flange_b, self.second.flange_a),
            gl.connect(self.second.flange_b, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.machine.flange_a),
            gl.connect(self.machine.flange_b, self.load.flange),
        ]


class Automatic(gl.Component):
    """Four speeds from a set of Ravigneaux's, three clutches and two brakes."""

    def assemble(self):
        self.engine, self.load = gp.Torque(tau=1.0), gp.Torque(tau=-1.0)
        self.box = gp.Ravigneaux(ratio_small=2.2, ratio_large=2.9)
        self.K1, self.K2, self.K3 = (gp.Clutch(fn_max=1e4, f_normalized=0.0) for _ in range(3))
        self.B1, self.B2 = (gp.Brake(fn_max=1e4, f_normalized=0.0) for _ in range(2))
        return [
            gl.connect(self.engine.flange, self.K1.flange_a, self.K2.flange_a, self.K3.flange_a),
            gl.connect(self.K1.flange_b, self.box.small_sun),
            gl.connect(self.K2.flange_b, self.box.large_sun, self.B1.flange_a),
            gl.connect(self.K3.flange_b, self.box.carrier, self.B2.flange_a),
            gl.connect(self.box.ring, self.load.flange),
        ]


class Gear(gl.Component):
    """Ravigneaux's set with one of its shafts held: first gear the carrier, second the large sun."""

    held = gl.Structural("carrier", "the shaft that stands still", choices=("carrier", "large_sun"))

    def assemble(self):
        self.engine, self.load, self.housing = gp.Torque(), gp.Torque(), gp.Fixed()
        self.box = gp.Ravigneaux(ratio_small=2.2, ratio_large=2.9)
        self.sun, self.large, self.web, self.drum = (gp.Inertia(J=1.0) for _ in range(4))
        return [
            gl.connect(self.engine.flange, self.box.small_sun, self.sun.flange_a),
            gl.connect(self.box.large_sun, self.large.flange_a),
            gl.connect(self.box.carrier, self.web.flange_a),
            gl.connect(self.box.ring, self.drum.flange_a),
            gl.connect(self.drum.flange_b, self.load.flange),
            gl.connect(self.housing.flange, getattr(self.box, self.held)),
        ]


TRAINS = {
    "xp": gp.ZhouCui2022,
    "px": gp.PXTrain,
    "two stages": TwoStages,
    "simpson": lambda: gp.Simpson(ratio_front=2.0, ratio_rear=2.2),
    "ravigneaux": Automatic,
    "one set": lambda: gp.PlanetaryUnit(planet_meshes="separate"),
    "losses": lambda: gp.Gearbox(ratio=-2.0, c=1e5, d=10.0),
}


@cache
def scheme_of(name: str) -> Scheme:
    """The stick diagram of a train; several tests look at it."""
    found: Scheme = TRAINS[name]().scheme()
    return found


def touching(routing, axes):
    """The lines, and the points at which symbols are, as a graph of what meets."""
    lines = [line for line in routing.lines if line[:2] != line[2:4]]
    graph = nx.Graph()
    graph.add_nodes_from(range(len(lines)))
    for i, a in enumerate(lines):
        for j, b in enumerate(lines[:i]):
            apart = [
                max(min(a[k], a[k + 2]), min(b[k], b[k + 2])) - min(max(a[k], a[k + 2]), max(b[k], b[k + 2])) for k in (0, 1)
            ]
            if a[4] == b[4] and max(apart) < 1e-9:
                graph.add_edge(i, j)
    return lines, graph


@pytest.mark.parametrize("name", TRAINS)
def test_all_parts_are_drawn_and_each_shaft_is_one_line(name) -> None:
    scheme = scheme_of(name)
    ET.fromstring(scheme.svg)
    assert scheme.routing.crossings <= 1, scheme.routing.crossings
    for symbol in scheme.train.symbols:
        assert f">{symbol.name}" in scheme.svg
    lines, graph = touching(scheme.routing, scheme.axes)
    assert all(x == end or y == height for x, y, end, height, _ in lines)
    for piece in nx.connected_components(graph):
        assert len({lines[i][4] for i in piece}) == 1
    for shaft, (y, points) in scheme.routing.spines.items():
        own = [i for i, line in enumerate(lines) if line[4] == shaft and line[1] == line[3] == y]
        assert own or len({x for _, _, x in points}) == 1, shaft
        assert len({next(k for k, c in enumerate(nx.connected_components(graph)) if i in c) for i in own}) <= 1


def numbers_of(element, *names):
    return tuple(float(element.get(name)) for name in names)


@pytest.mark.parametrize("name", TRAINS)
def test_the_picture_holds_the_lines_and_breaks_them_at_crossings(name) -> None:
    scheme = scheme_of(name)
    root = ET.fromstring(scheme.svg)
    left, upper, width, height = (float(n) for n in root.get("viewBox").split())
    drawing = next(g for g in root.iter(SVG + "g") if g.get("transform", "").startswith("translate"))
    dx, dy = (float(n) for n in drawing.get("transform")[len("translate(") : -1].split())
    lines = [(numbers_of(e, "x1", "y1", "x2", "y2"), e.get("stroke")) for e in drawing.findall(SVG + "line")]
    drawn = np.array([ends for ends, stroke in lines if stroke == INK])
    for line in scheme.routing.lines:
        assert np.abs(drawn - line[:4]).max(axis=1).min() < 0.01, line
    level = [line for line in scheme.routing.lines if line[1] == line[3]]
    upright = [line for line in scheme.routing.lines if line[0] == line[2]]
    crossed = [
        (v[0], h[1]) for h in level for v in upright
        if v[4] != h[4] and min(h[0], h[2]) < v[0] < max(h[0], h[2]) and min(v[1], v[3]) < h[1] < max(v[1], v[3])
    ]  # fmt: skip
    broken = [((x1 + x2) / 2, y1) for (x1, y1, x2, _), stroke in lines if stroke == "white"]
    assert np.array(sorted(broken)) == pytest.approx(np.array(sorted(crossed)), abs=0.01)
    for (x1, y1, x2, y2), _ in lines:
        assert left <= min(x1, x2) + dx <= max(x1, x2) + dx <= left + width
        assert upper <= min(y1, y2) + dy <= max(y1, y2) + dy <= upper + height


@pytest.mark.parametrize("name", ["simpson", "one set"])
def test_lines_of_all_arrangements_are_horizontal_or_vertical(name) -> None:
    search, random = RouteSearch(scheme_of(name).axes), Random(1)
    for _ in range(60):
        lines = search.drawn(search.shaken(search.first(), random)).lines
        assert all(x == end or y == height for x, y, end, height, _ in lines)


def test_shafts_are_what_is_connected_rigidly() -> None:
    train = scheme_of("two stages").train
    assert train.shafts == 4  # motor and pinion; both gears of the middle shaft; wheel and coupling; machine
    first, second = (next(s for s in train.symbols if s.name == n) for n in ("first", "second"))
    assert first.shafts[1] == second.shafts[0]
    assert first.radii == (0.02, 0.06)


def test_bars_have_the_ratio_of_the_radii_and_meet() -> None:
    axes = scheme_of("two stages").axes
    for symbol in axes.symbols:
        if symbol.kind == "external":
            a, b = symbol.radii
            heights = [axes.height[axes.of[s]] for s in symbol.shafts]
            assert a + b == pytest.approx(abs(heights[0] - heights[1]))
            assert b / a == pytest.approx({"first": 3.0, "second": 3.2}[symbol.name])


def test_the_xp_loop_closes_over_the_second_axis() -> None:
    scheme = scheme_of("xp")
    by_name = {s.name: s for s in scheme.train.symbols}
    unit, pair, back = by_name["train.x_unit"], by_name["train.p_unit"], by_name["train.coupling"]
    assert pair.shafts[0] == unit.shafts[0]  # sun and gear 1, over two steps of ratio 1
    assert pair.shafts[1] == back.shafts[0]
    assert back.shafts[1] == unit.shafts[1]  # the carrier
    assert len(scheme.axes.height) == 2
    assert scheme.routing.crossings == 0


def test_a_ring_that_is_held_alone_has_the_housing_above_it() -> None:
    scheme = scheme_of("ravigneaux")
    assert sum(s.kind == "held" for s in scheme.train.symbols) == 2

    class Held(gl.Component):
        def assemble(self):
            self.set, self.brake = gp.IdealPlanetary(ratio=2.0), gp.Brake(fn_max=1.0, f_normalized=1.0)
            self.drive, self.load = gp.Torque(tau=1.0), gp.Torque(tau=-3.0)
            return [
                gl.connect(self.set.ring, self.brake.flange_a),
                gl.connect(self.drive.flange, self.set.sun),
                gl.connect(self.set.carrier, self.load.flange),
            ]

    scheme = Held().scheme()
    places = dict(zip([s.name for s in scheme.train.symbols], scheme.routing.places, strict=True))
    assert places["brake"].x == places["set"].x
    assert places["brake"].y < places["set"].y - scheme.axes.symbols[0].radii[1]


def test_the_picture_is_the_same_again() -> None:
    assert Automatic().scheme().svg == scheme_of("ravigneaux").svg


def test_powers_meet_at_every_shaft_and_add_up_along_it() -> None:
    flow = gl.compile(Gear()).power_flow(speeds={"engine.flange": 200.0}, torques={"load.tau": -100.0})
    scheme = flow.scheme()
    ET.fromstring(scheme.svg)
    for _, points in scheme.routing.spines.values():
        powers = [flow[f"{scheme.train.symbols[i].name}.{scheme.train.symbols[i].ports[k]}"].power for i, k, _ in points]
        assert sum(powers) == pytest.approx(0.0, abs=1e-9 * flow.largest)
    assert "1909.9" in scheme.svg  # 200 rad/s in 1/min
    assert "868.12" in scheme.svg  # over the ratio 2.2


def test_ladders_are_straight_lines() -> None:
    flows = {h: gl.compile(Gear(held=h)).power_flow(speeds={"engine.flange": 200.0}, torques={"load.tau": -100.0})
             for h in ("carrier", "large_sun")}  # fmt: skip
    picture = flows["carrier"].speed_ladder("1st gear", {"2nd gear": flows["large_sun"]})
    root = ET.fromstring(picture.svg)
    groups = [g for g in root.iter(SVG + "g") if g[0].text in ("1st gear", "2nd gear")]
    assert len(groups) == 2
    for group in groups:
        at = np.array([(float(c.get("cx")), float(c.get("cy"))) for c in group if c.tag.endswith("circle")])
        assert len(at) == 4
        assert abs(np.linalg.det(np.c_[at[[0, 1, 3]], np.ones(3)])) < 3.0  # pixels squared: rounded coordinates
        assert np.polyfit(at[:, 0], at[:, 1], 1, full=True)[1][0] < 1e-3
    assert "not straight" not in picture.svg


def test_slip_bends_the_ladder() -> None:
    values = {"tau_in": 100.0, "e_rate_ring": 0.0, "e_rate_sun": 0.0, "e_rate_pair": 0.0}
    assert "not straight" in gl.compile(gp.ZhouCui2022()).power_flow(torques=values).speed_ladder().svg
    stiff = gl.compile(gp.ZhouCui2022(planet_meshes="separate")).power_flow(torques=values)
    assert "not straight" not in stiff.speed_ladder().svg


def test_refusals() -> None:
    class Slides(gl.Component):
        def assemble(self):
            self.mass = gp.Mass(m=1.0)
            return []

    class Carried(gl.Component):
        def assemble(self):
            self.mesh = gp.DetailedExternalMesh(r_a=0.1, r_b=0.1, c=1e8, d=1e3, use_support=True)
            self.drive = gp.Torque(tau=1.0)
            return [gl.connect(self.drive.flange, self.mesh.support)]

    with pytest.raises(ModelError, match="nothing in it turns"):
        Slides().scheme()
    with pytest.raises(ModelError, match="mesh: its support turns with a shaft of the train"):
        Carried().scheme()
    flow = gl.PowerFlow((), 1, component=TwoStages())
    with pytest.raises(ModelError, match="no planetary set"):
        flow.speed_ladder()
    with pytest.raises(gl.GearlibError, match="made by hand"):
        gl.PowerFlow((), 1).scheme()


def test_radii_come_from_what_encloses_a_part() -> None:
    class Pair(gl.Component):
        r = gl.Parameter("m", "radius", default=0.03)
        double = gl.Parameter("m", "another", default=lambda pair: 2 * pair.r)

        def assemble(self):
            self.mesh = gp.ExternalMesh(r_a=self.r, r_b=self.double + 0.01, c=1e8, d=0.0)
            return []

    (symbol,) = train_of(outline(Pair(r=0.04), 9)).symbols
    assert symbol.radii == pytest.approx((0.04, 0.09))
    (symbol,) = train_of(outline(gp.PlanetaryUnit(), 9)).symbols[:1]
    assert symbol.kind == "planetary"
