"""Torques, speeds and angles that drive a train."""

from __future__ import annotations

import gearlib as gl
from gearparts.interfaces import Flange


class OneFlange(gl.Component):
    """Declares the flange of a source, and its support."""

    use_support = gl.Structural(False, "whether the housing is a flange; otherwise it stands still")
    flange = Flange("driven shaft")
    support = Flange("housing", when="use_support")

    def support_equations(self) -> list[gl.Eq]:
        """The housing takes the reaction."""
        return [gl.Eq(self.support.tau, -self.flange.tau)] if self.use_support else []


class Torque(OneFlange):
    """A given torque: positive ``tau`` accelerates the connected shaft."""

    tau = gl.Input("N.m", "driving torque")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, -self.tau), *self.support_equations()]


class QuadraticSpeedDependentTorque(OneFlange):
    """Load torque that grows with speed squared, ``tau_nominal`` at ``w_nominal``.

    With ``torque_direction`` (the default) it has the sign of ``tau_nominal`` whichever way the shaft turns; without, it
    changes sign with the speed, as a fan's does.
    """

    tau_nominal = gl.Parameter("N.m", "torque at nominal speed; negative: a load")
    w_nominal = gl.Parameter("rad/s", "nominal speed")
    torque_direction = gl.Structural(True, "same direction of torque in both directions of rotation")
    w = gl.Variable("rad/s", "speed of the flange relative to the support")
    tau = gl.Variable("N.m", "torque at the flange that accelerates it")

    def equations(self) -> list[gl.Eq]:
        relative = self.flange.phi - self.support.phi if self.use_support else self.flange.phi
        square = self.w**2 if self.torque_direction else self.w * gl.no_event(abs(self.w))
        return [
            gl.Eq(self.w, gl.der(relative)),
            gl.Eq(self.tau, self.tau_nominal * square / self.w_nominal**2),
            gl.Eq(self.flange.tau, -self.tau),
            *self.support_equations(),
        ]
