"""Rigid gears between shafts."""

from __future__ import annotations

import gearlib as gl
from gearparts.interfaces import Flange, TwoFlanges


class IdealGear(TwoFlanges):
    """Gear pair without inertia, losses or elasticity: ``phi_a = ratio phi_b`` relative to the support."""

    use_support = gl.Structural(False, "whether the housing is a flange; otherwise it stands still")
    support = Flange("housing", when="use_support")
    ratio = gl.Parameter("1", "transmission ratio, flange_a over flange_b")

    def equations(self) -> list[gl.Eq]:
        torque = gl.Eq(self.ratio * self.flange_a.tau + self.flange_b.tau, 0)
        if not self.use_support:
            return [torque, gl.Eq(self.flange_a.phi, self.ratio * self.flange_b.phi)]
        return [
            torque,
            gl.Eq(self.flange_a.phi - self.support.phi, self.ratio * (self.flange_b.phi - self.support.phi)),
            gl.Eq(self.support.tau, -self.flange_a.tau - self.flange_b.tau),
        ]


class IdealPlanetary(gl.Component):
    """Planetary set without inertia or losses: Willis' equation ``(1 + ratio) carrier = sun + ratio ring``."""

    sun = Flange("sun shaft")
    carrier = Flange("carrier shaft")
    ring = Flange("ring shaft")
    ratio = gl.Parameter("1", "teeth of the ring over teeth of the sun")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq((1 + self.ratio) * self.carrier.phi, self.sun.phi + self.ratio * self.ring.phi),
            gl.Eq(self.ring.tau, self.ratio * self.sun.tau),
            gl.Eq(self.carrier.tau, -(1 + self.ratio) * self.sun.tau),
        ]
