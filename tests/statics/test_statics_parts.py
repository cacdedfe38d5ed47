"""Flanges of a train one by one: which there are, their speeds and torques in a motion, and what is given or named."""

from __future__ import annotations

import warnings
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.flatten.model import FlatModel
from gearlib.linear.operating_point import Point
from gearlib.statics import statics
from gearlib.statics.steady_motion import Given, Motion


class Line(gl.Connector):
    """Hydraulic."""

    p = gl.Potential("Pa")
    q = gl.Flow("m3/s")


class Warm(gl.Connector):
    """Thermal."""

    T = gl.Potential("K")
    P = gl.Flow("W")


class Machine(gl.Component):
    """A pump with a shaft, a line, a housing that gets warm, and a rod that slides."""

    flange, rod, line, housing = gp.Flange("shaft"), gp.TranslationalFlange("rod"), Line("line"), Warm("housing")
    D, k, area = gl.Parameter("m3", default=1e-5), gl.Parameter("N.s/m", default=2.0), gl.Parameter("m2", default=1e-3)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.flange.tau, self.D * self.line.p),
            gl.Eq(self.line.q, -self.D * gl.der(self.flange.phi)),
            gl.Eq(self.rod.f, self.k * gl.der(self.rod.s)),
            gl.Eq(self.housing.P, -self.k * gl.der(self.rod.s) ** 2),
        ]


class Tank(gl.Component):
    line = Line("line")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.line.p, 0)]


class Air(gl.Component):
    housing = Warm("housing")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.housing.T, 300)]


class Reverse(gl.Component):
    """One angle is minus the other, as is one torque."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange_a.phi, -self.flange_b.phi), gl.Eq(self.flange_a.tau, self.flange_b.tau)]


class Plant(gl.Component):
    """A root with a flange of its own, a composite with parts, a machine, a reversing gear, and a wall."""

    class Inner(gl.Component):
        end = gp.Flange("end")

        def assemble(self) -> list[Any]:
            self.body, self.turn = gp.Inertia(J=1.0), Reverse()
            return [gl.connect(self.end, self.body.flange_a), gl.connect(self.body.flange_b, self.turn.flange_a)]

    out = gp.Flange("of the plant itself")

    def assemble(self) -> list[Any]:
        self.box, self.drive, self.machine, self.mass = self.Inner(), gp.Torque(), Machine(), gp.Mass(m=2.0)
        self.tank, self.air, self.wall, self.drag = Tank(), Air(), gp.Fixed(), gp.Damper(d=0.5)
        return [
            gl.connect(self.drive.flange, self.box.end, self.drag.flange_a),
            gl.connect(self.drag.flange_b, self.wall.flange),
            gl.connect(self.box.turn.flange_b, self.machine.flange, self.out),
            gl.connect(self.machine.rod, self.mass.flange_a),
            gl.connect(self.machine.line, self.tank.line),
            gl.connect(self.machine.housing, self.air.housing),
        ]


@cache
def plant() -> FlatModel:
    return gl.compile(Plant()).translation.structure.complete


def motion(model: FlatModel, value: float) -> Motion:
    """All constants and rates of one value."""
    n = model.n_variables
    ones = np.full(n, value)
    return SimpleNamespace(constants=ones, rates=2 * ones, undetermined=np.zeros(2 * n))  # type: ignore[return-value]


FLANGES = (
    "out", "box.end", "box.body.flange_a", "box.body.flange_b", "box.turn.flange_a", "box.turn.flange_b", "drive.flange",
    "machine.flange", "machine.rod", "mass.flange_a", "mass.flange_b", "wall.flange", "drag.flange_a", "drag.flange_b",
)  # fmt: skip


def test_shafts_and_rods_are_flanges_and_lines_and_housings_are_none() -> None:
    model = plant()
    found = {}
    for i, potential, flow, flange in statics.mechanical(model):
        path = model.instances[i].path
        name = f"{path}.{flange}" if path else flange
        found[name] = (potential, flow)
    assert sorted(found) == sorted(FLANGES)
    for name, (potential, flow) in found.items():
        angle, torque = ("s", "f") if "rod" in name or name.startswith("mass") else ("phi", "tau")
        assert (potential, flow) == (model.variable(f"{name}.{angle}"), model.variable(f"{name}.{torque}")), name
    assert statics.composites(model) == {"", "box"}


@pytest.mark.parametrize("value", [0.0, 1.5, -2.0])
def test_speeds_and_torques_have_the_signs_of_their_flanges_and_zeros_have_none(value: float) -> None:
    model = plant()
    flanges = {f.name: f for f in statics.flange_powers(model, motion(model, value))}
    assert sorted(flanges) == sorted(FLANGES)
    for name, f in flanges.items():
        slides = "rod" in name or name.startswith("mass")
        p, t = (model.variable(f"{name}.{x}") for x in (("s", "f") if slides else ("phi", "tau")))
        assert f.speed == 2 * value * model.sign[p]
        assert f.torque == value * model.sign[t]
        assert f.power == f.speed * f.torque
        assert f.sliding == slides
        assert f.leaf == (name not in ("out", "box.end"))
        assert not any(np.signbit(x) for x in (f.speed, f.torque, f.power) if x == 0.0), name
    assert flanges["box.turn.flange_a"].speed == -flanges["box.turn.flange_b"].speed
    shafts = {name: f.shaft for name, f in flanges.items()}
    assert shafts["drive.flange"] == shafts["box.end"] == shafts["box.turn.flange_a"]
    assert shafts["machine.rod"] == shafts["mass.flange_a"] != shafts["drive.flange"]
    assert {model.sign[model.variable(f"{name}.phi")] for name in ("box.turn.flange_a", "box.turn.flange_b")} == {-1, 1}


@pytest.mark.parametrize("q", [0.0, 1e-3, -1e-3])
def test_what_exchanges_something_else_through_a_line_is_named(q: float) -> None:
    """Heat is no such thing, and a composite is named by its parts; a line without a flow carries nothing."""
    model = plant()
    found = motion(model, 1.0)
    found.constants[int(model.representative[model.variable("machine.line.q")])] = q
    assert statics.exchanged_beside(model, found) == (("machine",) if q else ())


def test_open_torques_are_named_by_the_flanges_of_basic_components() -> None:
    model = plant()
    names = [name for name in FLANGES if name not in ("out", "box.end")]
    for torque in ("box.body.flange_a.tau", "machine.rod.f", "drag.flange_a.tau"):
        rep = int(model.representative[model.variable(torque)])
        wanted = []
        for name in names:
            v = model.variable(f"{name}.{'f' if 'rod' in name or name.startswith('mass') else 'tau'}")
            wanted += [name] if model.representative[v] == rep and model.sign[v] else []
        assert sorted(statics.shared_names(model, {rep})) == sorted(wanted)
        assert wanted
    assert statics.shared_names(model, set()) == ()


OPEN = {
    "drive.tau": ["input drive.tau", "torque of drive.flange"],
    "wall.flange.phi'": ["speed of wall.flange", "speed of drag.flange_b"],
    "wall.flange.tau": ["torque of wall.flange"],
    "mass.flange_b.s'": ["speed of mass.flange_b"],
    "machine.rod.s'": ["speed of machine.rod", "speed of mass.flange_a"],
    "machine.rod.f": [],  # of a part with two flanges, which passes it on
    "out.tau": [],  # nothing is connected
    "machine.flange.phi'": [
        "speed of out", "speed of box.end", "speed of box.body.flange_a", "speed of box.body.flange_b", "speed of box.turn.flange_a",
        "speed of box.turn.flange_b", "speed of drive.flange", "speed of machine.flange", "speed of drag.flange_a",
    ],
}  # fmt: skip


@pytest.mark.parametrize("turning", [True, False])
@pytest.mark.parametrize("name", OPEN)
def test_speeds_and_outer_torques_that_stay_open_are_named(name: str, turning: bool) -> None:
    """From 1e-8 on; at rest an outer torque may stay open, as an input may not."""
    model = plant()
    found = motion(model, 1.0 if turning else 0.0)
    v = int(model.representative[model.variable(name.removesuffix("'"))]) + model.n_variables * name.endswith("'")
    found.undetermined[v] = 1e-8
    statics.refuse_open(model, found)
    found.undetermined[v] = 1.1e-8
    wanted = [one for one in OPEN[name] if turning or not one.startswith("torque")]
    if not wanted:
        statics.refuse_open(model, found)
        return
    with pytest.raises(ArgumentError) as refused:
        statics.refuse_open(model, found)
    said = str(refused.value).removeprefix("too little is given: the ").removesuffix(" stay open; give more speeds or torques")
    names, _, more = said.partition(" and ")
    assert set(names.split(", ")) <= set(wanted)
    assert len(names.split(", ")) == min(4, len(wanted))
    assert more == (f"{len(wanted) - 4} more" if len(wanted) > 4 else "")


@pytest.mark.parametrize(
    ("name", "variable", "order"),
    [
        ("box.body.w", "box.body.w", 0), ("box.body.phi", "box.body.phi", 1), ("der(box.body.phi)", "box.body.phi", 1),
        ("box.end", "box.end.phi", 1), ("out", "out.phi", 1), ("machine.rod", "machine.rod.s", 1), ("mass.v", "mass.v", 0),
        ("der(machine.rod)", "machine.rod.s", 1), ("drag.phi_rel", "drag.phi_rel", 1), ("der(mass.v)", "mass.v", 1),
    ],
)  # fmt: skip
def test_speeds_are_variables_angles_and_flanges(name: str, variable: str, order: int) -> None:
    model = plant()
    v = model.variable(variable)
    assert statics.speed_named(model, name) == (int(model.representative[v]), order, int(model.sign[v]))


@pytest.mark.parametrize("name", ["der(der(box.body.phi))", "der(der(box.end))", "der(der(mass.v))"])
def test_an_acceleration_is_no_speed(name: str) -> None:
    with pytest.raises(ArgumentError) as refused:
        statics.speed_named(plant(), name)
    assert str(refused.value) == f"{name} is no speed"


def test_what_is_given_has_the_sign_of_what_stands_for_it() -> None:
    model = plant()
    given = statics.given_values(model, {"box.turn.flange_b": 3.0, "mass.v": 2.0}, {"drive.tau": 7.0})
    for one, (name, variable, order, value) in zip(
        given,
        [
            ("box.turn.flange_b", "box.turn.flange_b.phi", 1, 3.0),
            ("mass.v", "mass.v", 0, 2.0),
            ("drive.tau", "drive.tau", 0, 7.0),
        ],
        strict=True,
    ):
        v = model.variable(variable)
        assert one == Given(name, int(model.representative[v]), order, value * int(model.sign[v]))
    assert statics.given_values(model, None, None) == []


def test_speeds_of_a_state_are_told_from_deflections() -> None:
    """Speeds of angles and of variables; deflections are neither angles nor rates."""
    model = plant()

    def v(name: str) -> int:
        return int(model.representative[model.variable(name)])

    states = {
        (v("box.body.w"), 0): 1.0, (v("mass.v"), 0): 2.0, (v("box.body.phi"), 0): 3.0, (v("box.body.phi"), 1): 4.0,
        (v("drag.phi_rel"), 0): 5.0, (v("drag.phi_rel"), 1): 6.0, (v("machine.rod.s"), 1): 7.0,
    }  # fmt: skip
    speeds, deflections = statics.speeds_and_deflections(model, Point(0.0, states, np.empty(0), np.empty(0)))
    found = {(s.variable, s.order): s.value for s in speeds}
    angle, reading = (v("box.body.phi"), 1), (v("drag.phi_rel"), 0)
    assert {(v("box.body.w"), 0), (v("mass.v"), 0), angle, (v("machine.rod.s"), 1)} == set(found)
    assert all(found[key] == states[key] for key in found)
    assert [(d.variable, d.order, d.value) for d in deflections] == [(*reading, 5.0)]


@pytest.mark.parametrize("size", [1.0, -1.0, 1e6])
@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize(("off", "agrees"), [(0.0, True), (0.9e-6, True), (1.1e-6, False), (-0.9e-6, True), (-1.1e-6, False)])
def test_speeds_agree_up_to_a_millionth_of_the_largest(size: float, order: int, off: float, agrees: bool) -> None:
    speeds = [Given("fast", 0, order, size), Given("slow", 1, order, 1e-3 * size)]
    found = SimpleNamespace(constants=np.full(2, 50.0), rates=np.full(2, 50.0))
    own = found.rates if order else found.constants
    own[:] = [size, 1e-3 * size + off * abs(size)]
    assert statics.agree(found, speeds) == agrees  # type: ignore[arg-type]
    own[:] = [0.9e-9, 0.0]
    still = [Given("fast", 0, order, 0.0), Given("slow", 1, order, 0.0)]
    assert statics.agree(found, still)  # type: ignore[arg-type]
    own[0] = 1.1e-9
    assert not statics.agree(found, still)  # type: ignore[arg-type]


class Later(gl.Component):
    """A drag that becomes a push half a second later."""

    flange = gp.Flange("shaft")
    d, begin = gl.Parameter("N.m.s/rad", default=2.0), gl.Parameter("s", default=0.5)

    def equations(self) -> list[gl.Eq]:
        w = gl.der(self.flange.phi)
        return [gl.Eq(self.flange.tau, gl.Piecewise((self.d * w, gl.time < self.begin), (-self.d * w, True)))]


def test_a_motion_is_stable_by_the_laws_at_first() -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body, self.load = gp.Torque(tau=6.0), gp.Inertia(J=1.0), Later()
            return [gl.connect(self.drive.flange, self.body.flange_a, self.load.flange)]

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        flow = gl.power_flow(gl.compile(Driven()))
    assert flow["load.flange"].speed == pytest.approx(3.0)
    assert ["unstable" in str(w.message) for w in said] == [False]
    assert "changes with time" in str(said[0].message)
