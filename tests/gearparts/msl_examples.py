"""Example models of Modelica.Mechanics.Rotational 4.1.0, with Modelica's instance names."""

from __future__ import annotations

from typing import Any

import gearlib as gl
import gearparts as gp

ALPHA20_COPPER = 3.92e-3  # 1/K


class FirstGrounded(gl.Component):
    """A motor with a gear drives a load through a spring; torque and gear stand on the ground by themselves."""

    use_support = gl.Structural(False)
    amplitude = gl.Parameter("N.m", "amplitude of the driving torque", default=10.0)
    f = gl.Parameter("Hz", "frequency of the driving torque", default=5.0)
    Jmotor = gl.Parameter("kg.m2", "motor", default=0.1, min=0)
    Jload = gl.Parameter("kg.m2", "load", default=2.0, min=0)
    ratio = gl.Parameter("1", "gear ratio", default=10.0)
    damping = gl.Parameter("N.m.s/rad", "damping in the bearing of the gear", default=10.0)

    def assemble(self) -> Any:
        self.fixed = gp.Fixed()
        sine = self.amplitude * gl.sin(2 * gl.pi * self.f * gl.time)
        self.torque = gp.Torque(tau=sine, use_support=self.use_support)
        self.inertia1 = gp.Inertia(J=self.Jmotor)
        self.idealGear = gp.IdealGear(ratio=self.ratio, use_support=self.use_support)
        self.inertia2 = gp.Inertia(J=2.0, start={"phi": 0.0, "w": 0.0})
        self.spring = gp.Spring(c=1e4, start={"phi_rel": 0.0})
        self.inertia3 = gp.Inertia(J=self.Jload, start={"w": 0.0})
        self.damper = gp.Damper(d=self.damping)
        supports = [self.torque.support, self.idealGear.support] if self.use_support else []
        return [
            gl.connect(self.torque.flange, self.inertia1.flange_a),
            gl.connect(self.inertia1.flange_b, self.idealGear.flange_a),
            gl.connect(self.idealGear.flange_b, self.inertia2.flange_a),
            gl.connect(self.inertia2.flange_b, self.spring.flange_a, self.damper.flange_a),
            gl.connect(self.spring.flange_b, self.inertia3.flange_a),
            gl.connect(self.damper.flange_b, self.fixed.flange, *supports),
        ]


def first() -> FirstGrounded:
    """Modelica's First: FirstGrounded with the supports of torque and gear connected to ``fixed``."""
    return FirstGrounded(use_support=True)


class RollingWheel(gl.Component):
    """A torque step drives a wheel that rolls and a mass against a drag that grows with speed squared."""

    def assemble(self) -> Any:
        self.torqueStep = gp.TorqueStep(step_torque=10.0, offset_torque=0.0, start_time=0.1)
        self.inertia = gp.Inertia(J=1.0, start={"phi": 0.0, "w": 0.0})
        self.idealRollingWheel = gp.IdealRollingWheel(radius=1.0)
        self.mass = gp.Mass(m=1.0, L=0.0)
        self.quadraticSpeedDependentForce = gp.QuadraticSpeedDependentForce(
            f_nominal=-10.0, v_nominal=5.0, force_direction=False
        )
        return [
            gl.connect(self.torqueStep.flange, self.inertia.flange_a),
            gl.connect(self.inertia.flange_b, self.idealRollingWheel.flange_r),
            gl.connect(self.idealRollingWheel.flange_t, self.mass.flange_a),
            gl.connect(self.mass.flange_b, self.quadraticSpeedDependentForce.flange),
        ]


class ElasticBearing(gl.Component):
    """A gear whose housing has inertia and stands on a spring and a damper."""

    def assemble(self) -> Any:
        ramp = gl.Piecewise((100.0 * gl.time / 5.0, gl.time < 5.0), (100.0, True))
        self.torque = gp.Torque(tau=ramp, use_support=True)
        self.shaft = gp.Inertia(J=1.0, start={"phi": 0.0, "w": 0.0})
        self.idealGear = gp.IdealGear(ratio=3.0, use_support=True)
        self.spring = gp.Spring(c=1e3, start={"phi_rel": 0.0})
        self.load = gp.Inertia(J=50.0, start={"w": 0.0})
        self.housing = gp.Inertia(J=5.0)
        self.multiSensor = gp.MultiSensor()
        self.springDamper = gp.SpringDamper(c=1e5, d=5.0, start={"phi_rel": 0.0, "w_rel": 0.0})
        self.fixed = gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.idealGear.flange_a),
            gl.connect(self.idealGear.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.load.flange_a),
            gl.connect(self.idealGear.support, self.housing.flange_b),
            gl.connect(self.housing.flange_a, self.multiSensor.flange_b),
            gl.connect(self.multiSensor.flange_a, self.springDamper.flange_b),
            gl.connect(self.springDamper.flange_a, self.fixed.flange, self.torque.support),
        ]


class EddyCurrentBrake(gl.Component):
    """An eddy current brake whose excitation rises from 0.1 s to 0.2 s stops a wheel and heats its own disc."""

    def assemble(self) -> Any:
        ramp = gl.Piecewise((0, gl.time < 0.1), ((gl.time - 0.1) / 0.1, gl.time < 0.2), (1, True))
        self.eddyCurrentTorque = gp.EddyCurrentTorque(
            tau_nominal=100.0, w_nominal=10.0, T_ref=293.15, alpha20=ALPHA20_COPPER, excitation=ramp, use_heat_port=True
        )
        self.inertia = gp.Inertia(J=1.0, start={"phi": 0.0, "w": 20.0})
        self.heatCapacitor = gp.HeatCapacitor(C=1.0, start={"T": 293.15})
        return [
            gl.connect(self.eddyCurrentTorque.flange, self.inertia.flange_a),
            gl.connect(self.eddyCurrentTorque.heat_port, self.heatCapacitor.port),
        ]


class CompareBrakingTorque(gl.Component):
    """Four inertias that are braked by a constant torque, and by torques linear, quadratic and inverse in speed."""

    J = gl.Parameter("kg.m2", "moment of inertia", default=1.0, min=0)
    w_start = gl.Parameter("rad/s", "speed at the start", default=100.0)
    tau_nominal = gl.Parameter("N.m", "nominal torque", default=100.0)
    w_nominal = gl.Parameter("rad/s", "nominal speed", default=lambda model: abs(model.w_start))
    w0 = gl.Parameter("rad/s", "speed below which torques are smaller", default=1.0)

    def assemble(self) -> Any:
        nominal = {"tau_nominal": -self.tau_nominal, "w_nominal": self.w_nominal, "torque_direction": False}
        self.signTorque = gp.SignTorque(tau_nominal=-self.tau_nominal, w0=self.w0, reg="linear")
        self.linearSpeedDependentTorque = gp.LinearSpeedDependentTorque(**nominal)
        self.quadraticSpeedDependentTorque = gp.QuadraticSpeedDependentTorque(**nominal)
        self.inverseSpeedDependentTorque = gp.InverseSpeedDependentTorque(**nominal, w0=self.w0)
        torques = [
            self.signTorque, self.linearSpeedDependentTorque, self.quadraticSpeedDependentTorque,
            self.inverseSpeedDependentTorque,
        ]  # fmt: skip
        links = []
        for i, torque in enumerate(torques, 1):
            inertia = gp.Inertia(J=self.J, start={"phi": 0.0, "w": self.w_start})
            setattr(self, f"inertia{i}", inertia)
            links.append(gl.connect(torque.flange, inertia.flange_a))
        return links
