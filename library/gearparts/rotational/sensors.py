"""Ideal sensors: they measure motion without torque, or torque without relative motion."""

from __future__ import annotations

import gearlib as gl
from gearparts.interfaces import Flange, TwoFlanges


class AbsoluteSensor(gl.Component):
    """Base of sensors of absolute motion; they take no torque."""

    icon = "sensor"

    flange = Flange("shaft that is measured")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, 0)]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class AngleSensor(AbsoluteSensor):
    """Measures the angle of a shaft: ``phi = flange.phi``, ``flange.tau = 0``."""

    phi = gl.Variable("rad", "absolute angle", state="avoid")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.phi, self.flange.phi)]


class SpeedSensor(AbsoluteSensor):
    """Measures the speed of a shaft: ``w = der(flange.phi)``, ``flange.tau = 0``."""

    w = gl.Variable("rad/s", "absolute speed", state="avoid")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.w, gl.der(self.flange.phi))]


class AccSensor(AbsoluteSensor):
    """Measures the acceleration of a shaft: ``w = der(flange.phi)``, ``a = der(w)``, ``flange.tau = 0``."""

    w = gl.Variable("rad/s", "absolute speed", state="avoid")
    a = gl.Variable("rad/s2", "absolute acceleration")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.w, gl.der(self.flange.phi)), gl.Eq(self.a, gl.der(self.w))]


class RelativeSensor(TwoFlanges):
    """Base of sensors of relative motion: relative angle, no torque at either flange."""

    icon = "sensor_between"

    phi_rel = gl.Variable("rad", "flange_b.phi - flange_a.phi", state="avoid")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.phi_rel, self.flange_b.phi - self.flange_a.phi),
            gl.Eq(self.flange_a.tau, 0),
            gl.Eq(self.flange_b.tau, 0),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class RelAngleSensor(RelativeSensor):
    """Measures the angle between two shafts: ``phi_rel = flange_b.phi - flange_a.phi``, no torque."""


class RelSpeedSensor(RelativeSensor):
    """Measures the speed between two shafts: ``w_rel = der(flange_b.phi - flange_a.phi)``, no torque."""

    w_rel = gl.Variable("rad/s", "relative speed", state="avoid")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.w_rel, gl.der(self.phi_rel))]


class RelAccSensor(RelativeSensor):
    """Measures the acceleration between two shafts: ``w_rel = der(phi_rel)``, ``a_rel = der(w_rel)``, no torque."""

    w_rel = gl.Variable("rad/s", "relative speed", state="avoid")
    a_rel = gl.Variable("rad/s2", "relative acceleration")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.w_rel, gl.der(self.phi_rel)),
            gl.Eq(self.a_rel, gl.der(self.w_rel)),
        ]


class SeriesSensor(TwoFlanges):
    """Base of sensors in series with a shaft: equal angles, torque passed through."""

    icon = "sensor_between"

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange_a.phi, self.flange_b.phi), gl.Eq(self.flange_a.tau + self.flange_b.tau, 0)]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class TorqueSensor(SeriesSensor):
    """Measures the torque in a shaft: ``tau = flange_a.tau = -flange_b.tau``."""

    tau = gl.Variable("N.m", "torque through the shaft, positive into flange_a")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.tau, self.flange_a.tau)]


class PowerSensor(SeriesSensor):
    """Measures the power through a shaft: ``power = flange_a.tau der(flange_a.phi)``."""

    power = gl.Variable("W", "power from flange_a to flange_b")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.power, self.flange_a.tau * gl.der(self.flange_a.phi))]


class MultiSensor(SeriesSensor):
    """Measures the speed, torque and power in a shaft: ``w = der(flange_a.phi)``, ``tau = flange_a.tau``, ``power = tau w``."""

    w = gl.Variable("rad/s", "speed of the shaft", state="avoid")
    tau = gl.Variable("N.m", "torque through the shaft, positive into flange_a")
    power = gl.Variable("W", "power from flange_a to flange_b")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.w, gl.der(self.flange_a.phi)),
            gl.Eq(self.tau, self.flange_a.tau),
            gl.Eq(self.power, self.tau * self.w),
        ]
