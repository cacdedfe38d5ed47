"""Shafts, gears, sensors, rods and heat against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BoundError


class Free(gl.Component):
    """A shaft with distributed inertia and free ends."""

    n = gl.Structural(8)

    def assemble(self) -> Any:
        self.shaft = gp.TorsionalShaft(segments=self.n, J=0.4, c=900.0, d=0.02)
        return []


def test_a_shaft_without_segments_is_refused() -> None:
    with pytest.raises(BoundError, match=r"shaft: segments is 0; expected 1 to 100000"):
        gl.compile(Free(n=0))


def test_a_torsional_shaft_has_the_frequencies_of_its_chain(probe: Callable[..., Any]) -> None:
    n, J, c, d = 8, 0.4, 900.0, 0.02
    stiffness = (2 * n * np.sin(np.arange(n + 1) * np.pi / (2 * n))) ** 2  # of each mode, for c = J = 1
    expected = np.concatenate([np.roots([J, d * k, c * k]) for k in stiffness[1:]])
    found = np.linalg.eigvals(probe(Free(n=n)).A)
    assert np.sort(np.abs(found))[0] < 1e-9 * np.abs(expected).max()  # it turns freely
    oscillating = np.sort_complex(found[np.abs(found) > 1.0])
    assert oscillating == pytest.approx(np.sort_complex(expected), rel=1e-10)


def test_a_fine_torsional_shaft_tends_to_the_continuous_one(probe: Callable[..., Any]) -> None:
    first = [min(w for w in np.abs(np.linalg.eigvals(probe(Free(n=n)).A)) if w > 1.0) for n in (4, 8, 16)]
    error = [abs(w / (np.pi * np.sqrt(900.0 / 0.4)) - 1) for w in first]
    assert error[1] / error[2] == pytest.approx(4.0, rel=0.01)  # second order
    assert error[2] < 2e-3


class Sensors(gl.Component):
    """A motor that drives a load through a twisted disc, a torque meter and a spring, with every sensor."""

    def assemble(self) -> Any:
        self.torque = gp.Torque(tau=5.0 * gl.sin(3 * gl.time))
        self.motor, self.load = gp.Inertia(J=0.5, start={"phi": 0.1, "w": 2.0}), gp.Inertia(J=1.5, start={"w": -1.0})
        self.disc = gp.Disc(delta_phi=0.4)
        self.meter, self.wattmeter, self.multi = gp.TorqueSensor(), gp.PowerSensor(), gp.MultiSensor()
        self.spring = gp.SpringDamper(c=30.0, d=0.5, phi_rel0=0.2)
        self.angle, self.speed, self.acc = gp.AngleSensor(), gp.SpeedSensor(), gp.AccSensor()
        self.rel_angle, self.rel_speed, self.rel_acc = gp.RelAngleSensor(), gp.RelSpeedSensor(), gp.RelAccSensor()
        self.relative = gp.RelativeStates()
        between = (self.rel_angle, self.rel_speed, self.rel_acc, self.relative)
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.disc.flange_a, *(s.flange_a for s in between)),
            gl.connect(self.disc.flange_b, self.meter.flange_a),
            gl.connect(self.meter.flange_b, self.wattmeter.flange_a),
            gl.connect(self.wattmeter.flange_b, self.multi.flange_a),
            gl.connect(self.multi.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.load.flange_a, *(s.flange_b for s in between)),
            gl.connect(self.load.flange_b, self.angle.flange, self.speed.flange, self.acc.flange),
        ]


def test_sensors_measure_what_the_bodies_do() -> None:
    result = gl.simulate(Sensors(), t_end=1.0, samples=21, rtol=1e-10)

    def same(name: str, expected: np.ndarray) -> None:
        assert result[name] == pytest.approx(expected, abs=1e-9), name

    motor, load = result["motor.w"], result["load.w"]
    twist = result["load.phi"] - result["motor.phi"]
    tau = -(30.0 * (twist - 0.4 - 0.2) + 0.5 * (load - motor))  # into the spring
    a_load, a_motor = tau / 1.5, (5.0 * np.sin(3 * result.time) - tau) / 0.5
    same("angle.phi", result["load.phi"])
    same("speed.w", load)
    same("acc.a", a_load)
    for name in ("rel_angle", "rel_speed", "rel_acc", "relative"):
        same(f"{name}.phi_rel", twist)
    same("rel_speed.w_rel", load - motor)
    same("relative.w_rel", load - motor)
    same("rel_acc.a_rel", a_load - a_motor)
    same("relative.a_rel", a_load - a_motor)
    same("meter.tau", tau)
    same("wattmeter.power", tau * motor)
    same("multi.power", tau * motor)
    same("multi.tau", tau)
    same("multi.w", motor)
    same("disc.flange_b.phi", result["motor.phi"] + 0.4)


def test_sensors_change_nothing() -> None:
    class Plain(gl.Component):
        def assemble(self) -> Any:
            self.motor, self.load = gp.Inertia(J=0.5, start={"phi": 0.1, "w": 2.0}), gp.Inertia(J=1.5, start={"w": -1.0})
            self.torque, self.spring = gp.Torque(tau=5.0 * gl.sin(3 * gl.time)), gp.SpringDamper(c=30.0, d=0.5, phi_rel0=0.6)
            return [
                gl.connect(self.torque.flange, self.motor.flange_a),
                gl.connect(self.motor.flange_b, self.spring.flange_a),
                gl.connect(self.spring.flange_b, self.load.flange_a),
            ]

    bare = gl.simulate(Plain(), t_end=1.0, samples=3, rtol=1e-10, start={"load.phi": 0.7})
    measured = gl.simulate(Sensors(), t_end=1.0, samples=3, rtol=1e-10, start={"load.phi": 0.7})
    assert measured["load.w"] == pytest.approx(bare["load.w"], abs=1e-9)


class Started(gl.Component):
    """Two bodies and a spring whose start is fixed at one flange."""

    use_phi_start = gl.Structural(True)
    use_w_start = gl.Structural(True)
    use_a_start = gl.Structural(True)

    def assemble(self) -> Any:
        self.a, self.b, self.spring = gp.Inertia(J=2.0), gp.Inertia(J=1.0), gp.SpringDamper(c=50.0, d=1.0)
        uses = {n: getattr(self, n) for n in ("use_phi_start", "use_w_start", "use_a_start")}
        self.initialize = gp.InitializeFlange(**uses, **gl.offered({"phi_start": 0.3, "w_start": 2.0, "a_start": 1.5}))
        return [
            gl.connect(self.a.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.b.flange_a, self.initialize.flange),
        ]


@pytest.mark.parametrize("used", [("phi", "w"), ("phi", "w", "a"), ("w",), ("a",)])
def test_a_flange_is_started_as_told(used: tuple[str, ...]) -> None:
    choice = {f"use_{n}_start": n in used for n in ("phi", "w", "a")}
    system = gl.compile(Started(**choice))
    result = system.simulate(0.5, samples=5)
    for name, path, value in (("phi", "b.phi", 0.3), ("w", "b.w", 2.0), ("a", "der(b.w)", 1.5)):
        if name in used:
            assert result[path][0] == pytest.approx(value, abs=1e-12)
    momentum = 2.0 * result["a.w"] + result["b.w"]
    assert momentum == pytest.approx(np.full(5, momentum[0]), abs=1e-12)  # the initialiser applies no torque


class Rack(gl.Component):
    """A falling weight on a rack turns a pinion against a damper; the housings stand still or swim."""

    def assemble(self) -> Any:
        self.force = gp.Force(f=9.0)
        self.mass = gp.Mass(m=2.0, L=0.5, start={"v": 0.0, "s": 0.1})
        self.rack = gp.IdealGearR2T(ratio=4.0)
        self.wheel, self.damper, self.ground = gp.Inertia(J=0.25), gp.Damper(d=0.75), gp.Fixed()
        return [
            gl.connect(self.force.flange, self.mass.flange_a),
            gl.connect(self.mass.flange_b, self.rack.flange_t),
            gl.connect(self.rack.flange_r, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.damper.flange_a),
            gl.connect(self.damper.flange_b, self.ground.flange),
        ]


def test_rack_and_pinion() -> None:
    result = gl.simulate(Rack(), t_end=2.0, samples=21)
    m, d = 2.0 + 0.25 * 16, 0.75 * 16  # the pinion as the rack feels it
    v = 9.0 / d * (1 - np.exp(-d / m * result.time))
    assert result["mass.v"] == pytest.approx(v, abs=1e-9)
    assert result["wheel.w"] == pytest.approx(4 * v, abs=1e-9)
    assert result["wheel.phi"] == pytest.approx(4 * (result["mass.s"] + 0.25), abs=1e-9)
    assert result["damper.loss_power"] == pytest.approx(0.75 * (4 * v) ** 2, abs=1e-9)


class Slide(gl.Component):
    """Two masses of some length between springs and dampers, the second of them against the wall."""

    def assemble(self) -> Any:
        self.wall = gp.TranslationalFixed(s0=0.2)
        self.first = gp.TranslationalSpringDamper(c=80.0, d=3.0, s_rel0=0.1)
        self.a = gp.Mass(m=2.0, L=0.3, start={"s": 0.55, "v": 0.4})
        self.second, self.damper = gp.TranslationalSpring(c=50.0, s_rel0=0.05), gp.TranslationalDamper(d=2.0)
        self.b = gp.Mass(m=1.0, L=0.1, start={"s": 0.9, "v": 0.0})
        self.drag = gp.QuadraticSpeedDependentForce(f_nominal=-0.0, v_nominal=1.0)
        return [
            gl.connect(self.wall.flange, self.first.flange_a),
            gl.connect(self.first.flange_b, self.a.flange_a),
            gl.connect(self.a.flange_b, self.second.flange_a, self.damper.flange_a),
            gl.connect(self.second.flange_b, self.damper.flange_b, self.b.flange_a),
            gl.connect(self.b.flange_b, self.drag.flange),
        ]


def test_masses_between_springs() -> None:
    from scipy.linalg import expm

    t = np.linspace(0.0, 3.0, 31)
    result = gl.compile(Slide()).simulate(3.0, times=t, rtol=1e-11)
    K, C = np.array([[130.0, -50.0], [-50.0, 50.0]]), np.array([[5.0, -2.0], [-2.0, 2.0]])
    M = np.diag([2.0, 1.0])
    # rest positions: both springs unstretched
    rest = np.array([0.2 + 0.1 + 0.15, 0.2 + 0.1 + 0.3 + 0.05 + 0.05])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    x0 = np.array([*(np.array([0.55, 0.9]) - rest), 0.4, 0.0])
    x = np.array([expm(A * s) @ x0 for s in t])
    assert result["a.s"] == pytest.approx(rest[0] + x[:, 0], abs=1e-9)
    assert result["b.s"] == pytest.approx(rest[1] + x[:, 1], abs=1e-9)
    assert result["b.v"] == pytest.approx(x[:, 3], abs=1e-8)


class Warm(gl.Component):
    """A brake that heats its disc, which cools by conduction, and its housing by convection."""

    def assemble(self) -> Any:
        self.wheel = gp.Inertia(J=4.0, start={"w": 30.0})
        self.brake, self.ground = gp.Damper(d=2.0, use_heat_port=True), gp.Fixed()
        self.disc, self.housing = gp.HeatCapacitor(C=50.0, start={"T": 300.0}), gp.HeatCapacitor(C=200.0, start={"T": 290.0})
        self.bolts, self.fan, self.air = gp.ThermalConductor(G=25.0), gp.Convection(Gc=10.0), gp.FixedTemperature(T=280.0)
        return [
            gl.connect(self.wheel.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
            gl.connect(self.brake.heat_port, self.disc.port, self.bolts.port_a),
            gl.connect(self.bolts.port_b, self.housing.port, self.fan.solid),
            gl.connect(self.fan.fluid, self.air.port),
        ]


def test_a_brake_heats_its_disc() -> None:
    from scipy.linalg import expm

    t = np.linspace(0.0, 10.0, 11)
    result = gl.compile(Warm()).simulate(10.0, times=t, rtol=1e-11)
    w = 30.0 * np.exp(-0.5 * t)
    assert result["wheel.w"] == pytest.approx(w, abs=1e-8)
    # temperatures over the air's, and the loss 1800 exp(-t) as a third state
    A = np.array([[-25 / 50, 25 / 50, 1 / 50], [25 / 200, -35 / 200, 0.0], [0.0, 0.0, -1.0]])
    x = np.array([expm(A * s) @ [20.0, 10.0, 1800.0] for s in t])
    assert result["disc.T"] == pytest.approx(280 + x[:, 0], abs=1e-7)
    assert result["housing.T"] == pytest.approx(280 + x[:, 1], abs=1e-7)
    assert result["fan.Q_flow"] == pytest.approx(10 * x[:, 1], abs=1e-6)
    assert result["brake.loss_power"] == pytest.approx(x[:, 2], abs=1e-6)


def test_all_segments_of_a_shaft_lose_to_one_heat_port() -> None:
    class Model(gl.Component):
        def assemble(self) -> Any:
            self.shaft = gp.TorsionalShaft(segments=4, J=0.4, c=50.0, d=0.5, use_heat_port=True)
            self.left, self.right = gp.Inertia(J=1.0, start={"w": 8.0}), gp.Inertia(J=2.0, start={"w": -3.0})
            self.oil = gp.HeatCapacitor(C=5.0, start={"T": 300.0})
            return [
                gl.connect(self.left.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.right.flange_a),
                gl.connect(self.shaft.heat_port, self.oil.port),
            ]

    # the inner bodies start at rest, the outer ones with their neighbours
    result = gl.simulate(Model(), t_end=60.0, samples=2, rtol=1e-9)
    before = 0.5 * (1.05 * 8.0**2 + 2.05 * 3.0**2)
    w = (1.05 * 8.0 - 2.05 * 3.0) / 3.4
    assert result["left.w"][-1] == pytest.approx(w, abs=1e-6)  # all turn together in the end
    assert 5.0 * (result["oil.T"][-1] - 300.0) == pytest.approx(before - 0.5 * 3.4 * w**2, rel=1e-7)
