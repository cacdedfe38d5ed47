"""Examples of Modelica.Mechanics.Rotational 4.1.0 with friction, clutches and backlash, with Modelica's instance names."""

from __future__ import annotations

from typing import Any

import gearlib as gl
import gearparts as gp
from gearparts.gears.lossy import LossyGear
from gearparts.rotational.backlash import ElastoBacklash, ElastoBacklash2
from gearparts.rotational.friction import BearingFriction, Brake, Clutch
from gearparts.rotational.friction import OneWayClutch as OneWayClutchPart

AT_REST = {"phi": 0.0, "w": 0.0}


def sine(amplitude: float, f: float, phase: float = 0.0) -> Any:
    return amplitude * gl.sin(2 * gl.pi * f * gl.time + phase)


def step(start_time: float, height: float = 1.0) -> Any:
    return gl.Piecewise((0, gl.time < start_time), (height, True))


def ramp(height: float, duration: float, offset: float = 0.0, start_time: float = 0.0) -> Any:
    begin, end = start_time, start_time + duration
    rising = height * (gl.time - begin) / duration
    return offset + gl.Piecewise((0, gl.time < begin), (rising, gl.time < end), (height, True))


class Backlash(gl.Component):
    """Three oscillators on the ground: without backlash, and with backlash of both kinds."""

    def assemble(self) -> Any:
        angle = 1.570796326794897
        self.fixed1, self.fixed2, self.fixed3 = gp.Fixed(), gp.Fixed(), gp.Fixed()
        self.springDamper = gp.SpringDamper(c=20e3, d=50.0)
        self.elastoBacklash = ElastoBacklash(c=20e3, d=50.0, b=0.7853981633974483)
        self.elastoBacklash2 = ElastoBacklash2(c=20e3, d=50.0, b=0.78539816339745)
        self.inertia1, self.inertia2, self.inertia3 = (gp.Inertia(J=5.0, start={"phi": angle, "w": 0.0}) for _ in range(3))
        return [
            gl.connect(self.fixed1.flange, self.springDamper.flange_a),
            gl.connect(self.springDamper.flange_b, self.inertia1.flange_a),
            gl.connect(self.fixed2.flange, self.elastoBacklash.flange_a),
            gl.connect(self.elastoBacklash.flange_b, self.inertia2.flange_a),
            gl.connect(self.fixed3.flange, self.elastoBacklash2.flange_a),
            gl.connect(self.elastoBacklash2.flange_b, self.inertia3.flange_a),
        ]


class Friction(gl.Component):
    """A drive with a clutch and a brake."""

    startTime = gl.Parameter("s", "when the motor stops and the brake starts", default=0.5)

    def assemble(self) -> Any:
        on = gl.Piecewise((0, gl.time < self.startTime), (1, True))
        self.torque = gp.Torque(tau=200 * gl.sin(100 * gl.time) * (1 - on), use_support=True)
        self.inertia3 = gp.Inertia(J=1.0, start={"phi": 0.0, "w": 100.0})
        self.clutch = Clutch(fn_max=160.0, f_normalized=1.0)
        self.inertia2 = gp.Inertia(J=0.05, start={"phi": 0.0, "w": 90.0})
        self.spring = gp.SpringDamper(c=160.0, d=1.0)
        self.brake = Brake(fn_max=1600.0, f_normalized=on, use_support=True)
        self.inertia1 = gp.Inertia(J=1.0, start={"phi": 0.0, "w": 90.0})
        self.fixed = gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.inertia3.flange_a),
            gl.connect(self.inertia3.flange_b, self.clutch.flange_a),
            gl.connect(self.clutch.flange_b, self.inertia2.flange_a),
            gl.connect(self.inertia2.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.inertia1.flange_a),
            gl.connect(self.torque.support, self.brake.support, self.fixed.flange),
        ]


class SimpleGearShift(gl.Component):
    """A planetary set whose ring is freed by a brake and coupled to the sun by a clutch."""

    def assemble(self) -> Any:
        shift = ramp(1.0, 0.1, start_time=2.0)
        self.torqueStep = gp.TorqueStep(step_torque=20.0, start_time=0.5)
        self.engine = gp.Inertia(J=1.0)
        self.idealPlanetary = gp.IdealPlanetary(ratio=75 / 50)
        self.load = gp.Inertia(J=10.0, start=AT_REST)
        self.quadraticSpeedDependentTorque = gp.QuadraticSpeedDependentTorque(tau_nominal=-20.0, w_nominal=10.471975511966)
        self.clutch = Clutch(cgeo=2.0, fn_max=100.0, f_normalized=shift, start={"phi_rel": 0.0, "w_rel": 0.0})
        self.brake = Brake(cgeo=2.0, fn_max=100.0, f_normalized=1 - shift)
        return [
            gl.connect(self.torqueStep.flange, self.engine.flange_a),
            gl.connect(self.quadraticSpeedDependentTorque.flange, self.load.flange_b),
            gl.connect(self.engine.flange_b, self.idealPlanetary.sun, self.clutch.flange_a),
            gl.connect(self.idealPlanetary.ring, self.clutch.flange_b, self.brake.flange_a),
            gl.connect(self.idealPlanetary.carrier, self.load.flange_a),
        ]


class LossyGearDemo1(gl.Component):
    """A gear of low efficiency that locks."""

    def assemble(self) -> Any:
        self.gear = LossyGear(ratio=2.0, loss_table=((0.0, 0.5, 0.5, 0.0, 0.0),), use_support=True)
        self.Inertia1 = gp.Inertia(J=1.0)
        self.Inertia2 = gp.Inertia(J=1.5, start=AT_REST)
        self.torque1 = gp.Torque(tau=sine(10.0, 1.0), use_support=True)
        self.torque2 = gp.Torque(tau=ramp(5.0, 2.0, -10.0), use_support=True)
        self.fixed = gp.Fixed()
        return [
            gl.connect(self.Inertia1.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.Inertia2.flange_a),
            gl.connect(self.torque1.flange, self.Inertia1.flange_a),
            gl.connect(self.torque2.flange, self.Inertia2.flange_b),
            gl.connect(self.fixed.flange, self.gear.support, self.torque1.support, self.torque2.support),
        ]


class LossyGearDemo2(gl.Component):
    """A gear of low efficiency and a bearing with friction on one shaft: stuck, they share the torque in no unique way."""

    def assemble(self) -> Any:
        self.gear = LossyGear(ratio=2.0, loss_table=((0.0, 0.5, 0.5, 0.0, 0.0),), use_support=True)
        self.Inertia1 = gp.Inertia(J=1.0)
        self.Inertia2 = gp.Inertia(J=1.5, start=AT_REST)
        self.torque1 = gp.Torque(tau=sine(10.0, 1.0), use_support=True)
        self.torque2 = gp.Torque(tau=ramp(5.0, 2.0, -10.0), use_support=True)
        self.bearingFriction = BearingFriction(tau_pos=((0.0, 0.5), (1.0, 1.0)), use_support=True)
        self.fixed = gp.Fixed()
        return [
            gl.connect(self.torque2.flange, self.Inertia2.flange_b),
            gl.connect(self.Inertia2.flange_a, self.gear.flange_b),
            gl.connect(self.gear.flange_a, self.Inertia1.flange_b),
            gl.connect(self.Inertia1.flange_a, self.bearingFriction.flange_b),
            gl.connect(self.bearingFriction.flange_a, self.torque1.flange),
            gl.connect(
                self.fixed.flange, self.gear.support, self.torque2.support, self.bearingFriction.support, self.torque1.support
            ),
        ]


class LossyGearDemo3(gl.Component):
    """A gear of very low efficiency with bearing friction: which side drives is not obvious."""

    def assemble(self) -> Any:
        self.gear = LossyGear(ratio=1.0, loss_table=((0.0, 0.25, 0.25, 0.625, 2.5),))
        self.Inertia1 = gp.Inertia(J=0.001, guess={"w": 10.0})
        self.Inertia2 = gp.Inertia(J=0.001, start={"phi": 0.0, "w": 10.0})
        self.torque1 = gp.Torque(tau=0.0)
        self.torque2 = gp.Torque(tau=step(0.5))
        return [
            gl.connect(self.Inertia1.flange_b, self.gear.flange_a),
            gl.connect(self.torque1.flange, self.Inertia1.flange_a),
            gl.connect(self.gear.flange_b, self.Inertia2.flange_a),
            gl.connect(self.Inertia2.flange_b, self.torque2.flange),
        ]


class CoupledClutches(gl.Component):
    """Four bodies and three clutches in a row, which are engaged one after another."""

    f = gl.Parameter("Hz", "frequency of clutch1's force", default=0.2)
    T2 = gl.Parameter("s", "when clutch2 is engaged", default=0.4)
    T3 = gl.Parameter("s", "when clutch3 is engaged", default=0.9)

    def assemble(self) -> Any:
        self.torque = gp.Torque(tau=sine(10.0, 5.0), use_support=True)
        self.J1 = gp.Inertia(J=1.0, start={"phi": 0.0, "w": 10.0})
        self.J2, self.J3, self.J4 = (gp.Inertia(J=1.0, start=AT_REST) for _ in range(3))
        self.clutch1 = Clutch(peak=1.1, fn_max=20.0, f_normalized=sine(1.0, self.f, 1.570796326794897))
        self.clutch2 = Clutch(peak=1.1, fn_max=20.0, f_normalized=step(self.T2))
        self.clutch3 = Clutch(peak=1.1, fn_max=20.0, f_normalized=step(self.T3))
        self.fixed = gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.J1.flange_a),
            gl.connect(self.J1.flange_b, self.clutch1.flange_a),
            gl.connect(self.clutch1.flange_b, self.J2.flange_a),
            gl.connect(self.J2.flange_b, self.clutch2.flange_a),
            gl.connect(self.clutch2.flange_b, self.J3.flange_a),
            gl.connect(self.J3.flange_b, self.clutch3.flange_a),
            gl.connect(self.clutch3.flange_b, self.J4.flange_a),
            gl.connect(self.fixed.flange, self.torque.support),
        ]


class OneWayClutch(gl.Component):
    """A one-way clutch between two bodies that is engaged in pulses."""

    def assemble(self) -> Any:
        pulse = gl.Piecewise((0, gl.time < 0.3), (1, gl.time < 0.95), (0, gl.time < 1.6), (1, True))  # until 2.25 s
        self.inertiaIn = gp.Inertia(J=1.0, start={"phi": 0.0, "w": -0.5})
        self.inertiaOut = gp.Inertia(J=1.0, start=AT_REST)
        self.oneWayClutch = OneWayClutchPart(peak=25.0, fn_max=3.0, f_normalized=pulse)
        self.torque = gp.Torque(tau=sine(10.0, 3.0))
        return [
            gl.connect(self.torque.flange, self.inertiaIn.flange_a),
            gl.connect(self.inertiaIn.flange_b, self.oneWayClutch.flange_a),
            gl.connect(self.oneWayClutch.flange_b, self.inertiaOut.flange_a),
        ]


class OneWayClutchDisengaged(gl.Component):
    """A one-way clutch that works as a freewheel only, with a load on the driven body."""

    def assemble(self) -> Any:
        self.inertiaIn = gp.Inertia(J=1.0, start={"phi": 0.0, "w": -0.5})
        self.inertiaOut = gp.Inertia(J=1.0, start=AT_REST)
        self.oneWayClutch = OneWayClutchPart(peak=25.0, fn_max=3.0, f_normalized=0.0)
        self.torque = gp.Torque(tau=0.3 + sine(10.0, 2.0))
        self.torqueLoad = gp.ConstantTorque(tau_constant=-0.3)
        return [
            gl.connect(self.torque.flange, self.inertiaIn.flange_a),
            gl.connect(self.inertiaIn.flange_b, self.oneWayClutch.flange_a),
            gl.connect(self.oneWayClutch.flange_b, self.inertiaOut.flange_a),
            gl.connect(self.inertiaOut.flange_b, self.torqueLoad.flange),
        ]


class HeatLosses(gl.Component):
    """A drive with one of each part that loses power; all losses are carried off to the surrounding air."""

    def assemble(self) -> Any:
        self.torque = gp.Torque(tau=sine(20.0, 5.0))
        self.inertia1, self.inertia2, self.inertia3, self.inertia4 = (gp.Inertia(J=2.0, start=AT_REST) for _ in range(4))
        self.inertia5, self.inertia6 = gp.Inertia(J=2.0), gp.Inertia(J=2.0)
        self.damper = gp.Damper(d=10.0, use_heat_port=True)
        self.fixed = gp.Fixed()
        self.convection = gp.Convection(Gc=20.0)
        self.TAmbient = gp.FixedTemperature(T=298.15)
        self.springDamper = gp.SpringDamper(c=1e4, d=20.0, use_heat_port=True)
        self.elastoBacklash = ElastoBacklash(c=1e5, d=100.0, b=0.001, use_heat_port=True)
        self.bearingFriction = BearingFriction(use_heat_port=True)
        self.spring3 = gp.Spring(c=1e4)
        self.lossyGear = LossyGear(
            ratio=2.0, loss_table=((0.0, 0.8, 0.8, 1.0, 1.0), (1.0, 0.7, 0.7, 2.0, 2.0)), use_heat_port=True
        )
        pressed = sine(1.0, 0.2)
        relative = {"phi_rel": 0.0, "w_rel": 0.0}
        self.clutch = Clutch(fn_max=10.0, f_normalized=pressed, use_heat_port=True, start=relative)
        self.oneWayClutch = OneWayClutchPart(fn_max=1.0, f_normalized=pressed, use_heat_port=True, start=relative)
        self.brake = Brake(fn_max=2.0, f_normalized=pressed, use_heat_port=True)
        warm = [
            self.damper, self.springDamper, self.elastoBacklash, self.bearingFriction, self.lossyGear, self.clutch,
            self.oneWayClutch, self.brake,
        ]  # fmt: skip
        return [
            gl.connect(self.torque.flange, self.inertia1.flange_a),
            gl.connect(self.inertia1.flange_b, self.damper.flange_b, self.springDamper.flange_a),
            gl.connect(self.damper.flange_a, self.fixed.flange),
            gl.connect(self.springDamper.flange_b, self.inertia2.flange_a),
            gl.connect(self.inertia2.flange_b, self.elastoBacklash.flange_a),
            gl.connect(self.elastoBacklash.flange_b, self.inertia3.flange_a),
            gl.connect(self.inertia3.flange_b, self.bearingFriction.flange_a),
            gl.connect(self.bearingFriction.flange_b, self.spring3.flange_a),
            gl.connect(self.spring3.flange_b, self.inertia4.flange_a),
            gl.connect(self.inertia4.flange_b, self.lossyGear.flange_a),
            gl.connect(self.lossyGear.flange_b, self.clutch.flange_a),
            gl.connect(self.clutch.flange_b, self.inertia5.flange_a),
            gl.connect(self.inertia5.flange_b, self.oneWayClutch.flange_a),
            gl.connect(self.oneWayClutch.flange_b, self.inertia6.flange_a),
            gl.connect(self.inertia6.flange_b, self.brake.flange_a),
            gl.connect(self.convection.solid, *(part.heat_port for part in warm)),
            gl.connect(self.convection.fluid, self.TAmbient.port),
        ]
