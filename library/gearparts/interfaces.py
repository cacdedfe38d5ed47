"""Connectors and base classes (partial models) of families of components.

Sign convention, as in Modelica: a flow is positive into the component, so a positive torque at a flange accelerates the component in
the direction of increasing angle, and the power that flows in is the sum of ``tau * der(phi)`` over its flanges.
"""

from __future__ import annotations

from typing import Any

import gearlib as gl

SMALL = 1e-4  # rad or m: nominal deflection, the scale of absolute tolerances
SLOW = 1e-2  # rad/s or m/s: nominal speed of it, for a vibration at 100 rad/s


class Flange(gl.Connector):
    """A shaft end: angle ``phi`` (rad) and torque ``tau`` (N.m, flow)."""

    phi = gl.Potential("rad", "absolute angle")
    tau = gl.Flow("N.m", "torque into the component")


class TranslationalFlange(gl.Connector):
    """A push rod's end: displacement ``s`` (m) and force ``f`` (N, flow)."""

    s = gl.Potential("m", "absolute displacement")
    f = gl.Flow("N", "force into the component")


class HeatPort(gl.Connector):
    """A thermal connection: temperature ``T`` (K) and heat flow ``Q_flow`` (W, flow)."""

    T = gl.Potential("K", "temperature")
    Q_flow = gl.Flow("W", "heat flow into the component")


class TwoFlanges(gl.Component):
    """Base of elements between two shafts."""

    flange_a = Flange("left")
    flange_b = Flange("right")


class TwoFlangesAndSupport(TwoFlanges):
    """Base of elements between two shafts with an optional support: the housing that takes the reaction torque."""

    use_support = gl.Structural(False, "whether the housing is a flange; otherwise it stands still")
    support = Flange("housing", when="use_support")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.support.tau, -self.flange_a.tau - self.flange_b.tau)] if self.use_support else []


class OneFlange(gl.Component):
    """Base of sources: one flange, and an optional support: the housing that takes the reaction torque."""

    use_support = gl.Structural(False, "whether the housing is a flange; otherwise it stands still")
    flange = Flange("driven shaft")
    support = Flange("housing", when="use_support")

    def angle(self) -> Any:
        """Angle of the shaft relative to the housing."""
        return self.flange.phi - self.support.phi if self.use_support else self.flange.phi

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.support.tau, -self.flange.tau)] if self.use_support else []

    def energies(self) -> gl.Energy:
        return gl.Energy(source=True)


class MaybeHeated(gl.Component):
    """Base of elements with an optional heat port for their losses."""

    use_heat_port = gl.Structural(False, "whether the loss flows to a heat port")
    heat_port = HeatPort("takes the loss", when="use_heat_port")


class Dissipative(MaybeHeated):
    """Base of dissipative elements: the power loss, which flows to the heat port if there is one."""

    loss_power = gl.Variable("W", "power lost to heat")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.heat_port.Q_flow, -self.loss_power)] if self.use_heat_port else []


class Compliant(TwoFlanges):
    """Base of springs and dampers: the torque between the flanges, relative angle and relative speed.

    The torque acts on both flanges with opposite signs; a derived class equates it. The relative angle is preferred as a state: it
    stays small however far the shafts turn.
    """

    phi_rel = gl.Variable("rad", "flange_b.phi - flange_a.phi", state="prefer", nominal=SMALL)
    w_rel = gl.Variable("rad/s", "relative speed", nominal=SLOW)
    a_rel = gl.Derivative("w_rel", "rad/s2", "relative acceleration")
    tau = gl.Variable("N.m", "torque between the flanges; pulls them together when positive")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.phi_rel, self.flange_b.phi - self.flange_a.phi),
            gl.Eq(self.w_rel, gl.der(self.phi_rel)),
            gl.Eq(self.flange_b.tau, self.tau),
            gl.Eq(self.flange_a.tau, -self.tau),
        ]
