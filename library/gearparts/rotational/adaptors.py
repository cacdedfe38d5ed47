"""Adaptors between a flange and signals, for the coupling of models by inputs and outputs."""

from __future__ import annotations

import gearlib as gl
from gearparts.interfaces import Flange


class TorqueToAngleAdaptor(gl.Component):
    """Flange driven by a torque signal, with its motion as an output: ``flange.tau = tau``, ``phi = flange.phi``.

    With ``use_w``, ``w = der(phi)``; with ``use_a`` in addition, ``a = der(w)``; otherwise they are zero. The signal is the torque that
    the other model takes from this flange, so a positive one decelerates what is connected.
    """

    use_w = gl.Structural(True, "whether the speed is an output")
    use_a = gl.Structural(True, "whether the acceleration is an output")
    flange = Flange("shaft")
    tau = gl.Input("N.m", "torque into this component at the flange")
    phi = gl.Variable("rad", "angle", state="avoid")
    w = gl.Variable("rad/s", "speed, where used", state="avoid")
    a = gl.Variable("rad/s2", "acceleration, where used")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.flange.tau, self.tau),
            gl.Eq(self.phi, self.flange.phi),
            gl.Eq(self.w, gl.der(self.phi) if self.use_w else 0),
            gl.Eq(self.a, gl.der(self.w) if all((self.use_w, self.use_a)) else 0),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(source=True)


class AngleToTorqueAdaptor(gl.Component):
    """Flange that follows motion signals, with its torque as an output: ``flange.phi = phi_ref``, ``tau = -flange.tau``.

    The output is the torque that the motion takes, so that it can drive a `TorqueToAngleAdaptor` in place of what is connected.

    With ``use_w`` and ``use_a`` none of the signals is differentiated: as in `Move`, ``der(w) = a_ref + 2 k (w_ref - w) + k**2 (phi_ref
    - phi)`` with ``w = der(phi)``, which starts at ``phi_ref`` and ``w_ref``. Otherwise the angle alone is followed, ``phi = phi_ref``,
    and must be twice differentiable.
    """

    use_w = gl.Structural(True, "whether the speed is given")
    use_a = gl.Structural(True, "whether the acceleration is given")
    flange = Flange("shaft")
    phi_ref = gl.Input("rad", "angle")
    w_ref = gl.Input("rad/s", "speed, the derivative of phi_ref; where used", default=0.0)
    a_ref = gl.Input("rad/s2", "acceleration, the derivative of w_ref; where used", default=0.0)
    k = gl.Parameter("1/s", "rate at which deviations decay", default=10.0, min=0)
    phi = gl.Variable("rad", "angle", state="prefer")
    w = gl.Variable("rad/s", "speed", state="prefer")
    phi_error = gl.Variable("rad", "phi - phi_ref", start=0.0)
    w_error = gl.Variable("rad/s", "w - w_ref, where used", start=0.0)
    tau = gl.Variable("N.m", "torque that the motion takes")

    def equations(self) -> list[gl.Eq]:
        given = all((self.use_w, self.use_a))
        smooth = gl.Eq(gl.der(self.w), self.a_ref - 2 * self.k * self.w_error - self.k**2 * self.phi_error)
        return [
            gl.Eq(self.phi, self.flange.phi),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(self.phi_error, self.phi - self.phi_ref if given else 0),
            gl.Eq(self.w_error, self.w - self.w_ref if given else 0),
            smooth if given else gl.Eq(self.phi, self.phi_ref),
            gl.Eq(self.tau, -self.flange.tau),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(source=True)
