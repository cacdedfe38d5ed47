"""Linear meshes: a spring and a damper along the line of action, excited by the transmission error.

The deflection ``q`` is counted from unloaded contact and is positive if the teeth are pressed together by a positive rotation of
``flange_a``. It is a state, and the shaft angles enter through their rates only, so that no absolute angle becomes a state.

References
----------
H. N. Özgüven, D. R. Houser, "Mathematical models used in gear dynamics - a review", Journal of Sound and Vibration 121 (1988),
383-411. https://doi.org/10.1016/S0022-460X(88)80365-1
"""

from __future__ import annotations

from typing import ClassVar

import gearlib as gl
from gearparts.interfaces import MaybeHeated, TwoFlanges


class GearMesh(TwoFlanges, MaybeHeated):
    """Base of linear meshes: radii, compliance, deflection, force and rate of the transmission error."""

    icon = "mesh"
    radii = ("r_a", "r_b")

    turns_against: ClassVar[int]  # 1 if the gears counter-rotate, -1 otherwise
    r_a = gl.Parameter("m", "base radius of the gear on flange_a (pitch radius where forces act along the pitch line)", min=0)
    r_b = gl.Parameter("m", "base radius of the gear on flange_b", min=0)
    c = gl.Parameter("N/m", "mesh stiffness along the line of action", min=0)
    d = gl.Parameter("N.s/m", "mesh damping along the line of action", min=0)
    e_rate = gl.Input("m/s", "rate of the transmission error; adds to the deflection", default=0.0)
    q = gl.Variable("m", "deflection along the line of action", state="prefer", nominal=1e-6)
    v = gl.Variable("m/s", "rate of deflection")
    f = gl.Variable("N", "force along the line of action; acts against a positive turn of flange_a")

    def equations(self) -> list[gl.Eq]:
        r_b = self.turns_against * self.r_b
        heat = [gl.Eq(self.heat_port.Q_flow, -self.d * self.v**2)] if self.use_heat_port else []
        return [
            gl.Eq(gl.der(self.q), self.v),
            gl.Eq(self.v, self.r_a * gl.der(self.flange_a.phi) + r_b * gl.der(self.flange_b.phi) + self.e_rate),
            gl.Eq(self.f, self.c * self.q + self.d * self.v),
            gl.Eq(self.flange_a.tau, self.r_a * self.f),
            gl.Eq(self.flange_b.tau, r_b * self.f),
            *heat,
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.c * self.q**2 / 2, heat=self.d * self.v**2, supplied=self.f * self.e_rate)


class ExternalMesh(GearMesh):
    """Mesh of two external gears: ``der(q) = r_a w_a + r_b w_b + e_rate``, ``f = c q + d der(q)``.

    If the pair is mounted on a rotating carrier, connect it through `PlanetOnCarrier`.
    """

    turns_against = 1


class InternalMesh(GearMesh):
    """Mesh of a ring gear on flange_a and an external gear on flange_b: ``der(q) = r_a w_a - r_b w_b + e_rate``, ``f = c q + d der(q)``.

    If the pair is mounted on a rotating carrier, connect it through `PlanetOnCarrier`.
    """

    icon = "internal_mesh"

    turns_against = -1
