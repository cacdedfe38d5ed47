"""Modes in stick diagrams: what dials, bands and table show is the shape of the mode, and that of closed forms."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.scheme.routing import RouteSearch
from gearlib.drawing.scheme.shown_motion import LEAST, SWING, ShownMotion
from gearlib.drawing.scheme.stick_diagram import Scheme
from gearlib.drawing.scheme.train import Symbol
from gearlib.errors import ArgumentError, ModelError
from tests.drawing.shapes import CLOSE, shapes

SVG = "{http://www.w3.org/2000/svg}"


class Geared(gl.Component):
    """A motor that drives a machine by an elastic shaft and a gear pair."""

    def assemble(self):
        self.motor, self.pinion, self.machine = gp.Inertia(J=2.0), gp.Inertia(J=0.5), gp.Inertia(J=9.0)
        self.shaft, self.gears = gp.Spring(c=300.0), gp.IdealGear(ratio=-3.0)
        return [
            gl.connect(self.motor.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.pinion.flange_a),
            gl.connect(self.pinion.flange_b, self.gears.flange_a),
            gl.connect(self.gears.flange_b, self.machine.flange_a),
        ]


class Damped(gl.Component):
    """Two bodies on a grounded chain, a strong damper at the end: the phases of the bodies differ."""

    def assemble(self):
        self.housing, self.first, self.second = gp.Fixed(), gp.SpringDamper(c=900.0, d=1.0), gp.SpringDamper(c=400.0, d=2.0)
        self.brake, self.a, self.b = gp.Damper(d=8.0), gp.Inertia(J=1.0), gp.Inertia(J=0.5)
        return [
            gl.connect(self.housing.flange, self.first.flange_a, self.brake.flange_b),
            gl.connect(self.first.flange_b, self.a.flange_a),
            gl.connect(self.a.flange_b, self.second.flange_a),
            gl.connect(self.second.flange_b, self.b.flange_a),
            gl.connect(self.b.flange_b, self.brake.flange_a),
        ]


def shown(scheme: Scheme) -> dict[str, tuple[float, complex]]:
    """Of each flange: the hand's angle over the largest, and amplitude and phase from the table."""
    root = ET.fromstring(scheme.svg)
    hands: dict[str, float] = {}
    for dial in (g for g in root.iter(f"{SVG}g") if g.get("class") == "dial"):
        (hand,) = (g for g in dial.iter(f"{SVG}g") if g.get("class") == "hand")
        turned = re.fullmatch(r"rotate\((.*)\)", hand.get("transform", ""))
        assert turned is not None
        hands[next(t.text or "" for t in dial.iter(f"{SVG}text"))] = float(turned[1]) / SWING
    found = {}
    for number, amplitude, phase, flanges in scheme.results.listing(scheme.axes, scheme.routing).rows:
        assert all(f">{cell}</text>" in scheme.svg for cell in (number, amplitude, phase, flanges))
        value = float(amplitude) * np.exp(1j * np.deg2rad(0.0 if phase == "-" else float(phase)))
        found |= {name: (hands[number], complex(value)) for name in flanges.split(", ")}
    return found


def test_two_bodies_and_a_gear_pair_move_as_the_closed_form_says() -> None:
    """About the node of the shaft: 2 a = -(0.5 + 9 / 3^2) b for the bodies beside it, and the machine turns back at a third."""
    modes = gl.modes(gl.compile(Geared()))
    free, elastic = (shown(modes.scheme(k)) for k in range(2))
    scale = {"shaft.flange_a": 1.0, "gears.flange_a": 1.0, "shaft.flange_b": 1.0, "gears.flange_b": -1 / 3}
    for flange, value in scale.items():
        assert free[flange][0] == pytest.approx(value, abs=1e-4)
    scale = {"shaft.flange_a": -0.75, "gears.flange_a": 1.0, "shaft.flange_b": 1.0, "gears.flange_b": -1 / 3}
    for flange, value in scale.items():
        assert elastic[flange][0] == pytest.approx(value, abs=1e-4)
        assert elastic[flange][1] == pytest.approx(value, abs=1e-3)
    equal = np.sqrt(300.0 * (1 / 2.0 + 1 / 1.5)) / (2 * np.pi)
    svg = modes.scheme(1).svg
    assert f">Mode 1: {equal:.5g} Hz, damping ratio 0</text>" in svg
    assert ">Mode 0: free motion</text>" in modes.scheme(0).svg
    assert modes.scheme(-1).svg == svg


@pytest.mark.parametrize("mode", [0, 1])
def test_amplitudes_and_phases_are_those_of_the_shape(mode: int) -> None:
    modes = gl.modes(gl.compile(Damped()))
    found = shown(modes.scheme(mode))
    names = ["second.flange_a", "second.flange_b", "first.flange_b", "brake.flange_a"]
    shape = modes.shape(mode, *(f"{name}.phi" for name in names))
    drawn = np.array([found[name][1] for name in names])
    assert np.angle(shape[1] / shape[0], deg=True) % 180 > 5  # a mode whose bodies are not in phase
    assert drawn[1:] / drawn[0] == pytest.approx(shape[1:] / shape[0], rel=0.03)  # whole degrees
    assert np.abs(drawn).max() == pytest.approx(1.0)
    assert [found[name][0] for name in names] == pytest.approx(drawn.real.tolist(), abs=0.01)
    assert found["housing"] == (0.0, 0.0)


def test_hands_swing_as_the_mode_over_one_period() -> None:
    modes = gl.modes(gl.compile(Damped()))
    scheme = modes.scheme(0)
    assert isinstance(scheme.results, ShownMotion)
    root = ET.fromstring(scheme.svg)
    swings = {
        tuple(float(v) / SWING for v in motion.get("values", "").split(";")) for motion in root.iter(f"{SVG}animateTransform")
    }
    assert len(swings) == 2
    for turn in scheme.results.turns.values():
        time = np.linspace(0.0, 1.0, 33)
        expected = (turn * np.exp(2j * np.pi * time)).real
        assert not turn or any(np.allclose(swing, expected, atol=1e-4) for swing in swings)
    bands = [g for g in root.iter(f"{SVG}g") if g.get("class") == "band"]
    assert len(bands) == 2
    for band in bands:
        assert {a.get("attributeName") for a in band.iter(f"{SVG}animate")} == {"stroke-width", "stroke"}
    assert "<script" not in scheme.svg


def test_gears_have_the_band_of_their_shaft() -> None:
    modes = gl.modes(gl.compile(Geared()))
    scheme = modes.scheme(1)
    (place,) = (p for s, p in zip(scheme.axes.symbols, scheme.routing.places, strict=True) if s.name == "gears")
    bands = [g for g in ET.fromstring(scheme.svg).iter(f"{SVG}g") if g.get("class") == "band"]
    through = [b for b in bands if any({line.get("x1"), line.get("x2")} == {f"{place.x:g}"} for line in b.iter(f"{SVG}line"))]
    assert len({b.get("stroke") for b in through}) == 2


@pytest.mark.parametrize("turned", [False, True])
def test_the_band_of_a_ring_is_on_its_web_beside_the_wheel(turned: bool) -> None:
    axes = gp.InternalMesh(r_a=0.09, r_b=0.03, c=1e8, d=0.0).scheme().axes
    search = RouteSearch(axes)
    routing = search.drawn(replace(search.first(), turned=(turned,)))
    (symbol,) = axes.symbols
    bands = [shapes(band) for band in ShownMotion("mode", {s: 1.0 for s in symbol.shafts}).background(axes, routing)]
    webs = []
    for shaft, radius, band in zip(symbol.shafts, symbol.radii, bands, strict=True):
        ((_, _, web),) = routing.spines[shaft][1]
        webs.append(web)
        upright = [s for s in band if abs(np.ptp(s.points[:, 1]) - 2 * radius) < CLOSE]
        assert [s.middle for s in upright] == [pytest.approx([web, axes.height[axes.of[shaft]]], abs=CLOSE)]
    assert (webs[0] < webs[1]) == turned


@pytest.mark.parametrize(("amplitude", "swings"), [(0.0, False), (LEAST, False), (1.01 * LEAST, True)])
def test_a_shaft_that_hardly_swings_is_shown_at_rest(amplitude: float, swings: bool) -> None:
    """Without a band, a sector on its dial, a phase or a movement of its hand."""
    scheme = gl.modes(gl.compile(Geared())).scheme(1)
    motion = ShownMotion("mode", {shaft: 1j * amplitude for shaft in range(scheme.train.shafts)})
    assert bool([*motion.background(scheme.axes, scheme.routing)]) == swings
    dials = [*motion.above(scheme.axes, scheme.routing)]
    assert len(dials) == scheme.train.shafts
    assert {"<path" in dial for dial in dials} == {"animateTransform" in dial for dial in dials} == {swings}
    listing = motion.listing(scheme.axes, scheme.routing)
    assert {row[2] for row in listing.rows} == {"90" if swings else "-"}
    assert listing.note.startswith("no shaft") != swings
    said = motion.notes(scheme.axes.symbols[0])[0]
    assert said.endswith(f"{amplitude:.3f} of the largest" + ", phase 90°" * swings)


@pytest.mark.parametrize(
    ("turn", "phase"),
    [(complex(-1.0, -0.0), 180), (complex(-1.0, 0.0), 180), (complex(-0.7, -1e-4), 180), (-1j, -90), (1.0, 0), (1 + 1j, 45),
     (complex(-1.0, -0.02), -179)],
)  # fmt: skip
def test_phases_are_whole_degrees_above_minus_180(turn: complex, phase: int) -> None:
    symbol = Symbol("body", "end", "torque", (0,), ("flange",), label="body")
    (said,) = ShownMotion("mode", {0: turn}).notes(symbol)
    assert said == f"flange: {abs(turn):.3f} of the largest, phase {phase}°"


def test_flanges_of_the_model_itself() -> None:
    """A set that is the model, and a model with ports of its own."""

    class Stage(gl.Component):
        front, back = gp.Flange(), gp.Flange()

        def assemble(self):
            self.a, self.b, self.shaft = gp.Inertia(J=1.0), gp.Inertia(J=4.0), gp.Spring(c=10.0)
            return [
                gl.connect(self.front, self.a.flange_a),
                gl.connect(self.a.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.b.flange_a),
                gl.connect(self.b.flange_b, self.back),
            ]

    found = shown(gl.modes(gl.compile(Stage())).scheme(1))
    assert [found[name][0] for name in ("front", "back")] == pytest.approx([1.0, -0.25], abs=1e-4)
    unit = gp.PlanetaryUnit(R_s=0.03, R_p=0.025, I_s=1e-3, I_r=2e-2, I_h=1e-2, I_spin=1e-4, I_orbit=2e-3, C_v=0.0)
    modes = gl.modes(gl.compile(unit))
    assert len(modes) > modes.free > 0
    for k in range(len(modes)):
        found, shape = shown(modes.scheme(k)), modes.shape(k, "sun.phi", "carrier.phi", "ring.phi")
        names = [f"{type(unit).__name__}.{port}" for port in ("sun", "carrier", "ring")]
        assert np.abs([found[name][1] for name in names]) == pytest.approx(np.abs(shape) / np.abs(shape).max(), abs=1e-3)


def test_a_mode_of_the_planets_alone_leaves_the_shafts_at_rest() -> None:
    modes = gl.modes(gl.compile(gp.ZhouCui2022(planet_meshes="separate")))
    scheme = modes.scheme(2)
    assert all(value == (0.0, 0.0) for value in shown(scheme).values())
    assert "no shaft of the drawing turns in this mode" in scheme.svg
    assert "animate" not in scheme.svg


def test_refusals() -> None:
    class Slides(gl.Component):
        def assemble(self):
            self.ground, self.spring, self.mass = gp.TranslationalFixed(), gp.TranslationalSpring(c=100.0), gp.Mass(m=1.0)
            return [
                gl.connect(self.ground.flange, self.spring.flange_a),
                gl.connect(self.spring.flange_b, self.mass.flange_a),
            ]

    with pytest.raises(ModelError, match="nothing in it turns"):
        gl.modes(gl.compile(Slides())).scheme(0)
    with pytest.raises(ArgumentError, match="there is no mode 7"):
        gl.modes(gl.compile(Geared())).scheme(7)
