"""Rigid gears: gear pair, planetary set, rack and pinion, rolling wheel."""

from __future__ import annotations

from typing import Any

import gearlib as gl
from gearparts.interfaces import Flange, TranslationalFlange, TwoFlangesAndSupport


class IdealGear(TwoFlangesAndSupport):
    """Gear pair without inertia, losses or elasticity: ``phi_a = ratio phi_b`` relative to the support."""

    icon = "gear"
    radii = ("ratio",)

    ratio = gl.Parameter("1", "transmission ratio, flange_a over flange_b")

    def equations(self) -> list[gl.Eq]:
        housing = self.support.phi if self.use_support else 0
        return [
            gl.Eq(self.ratio * self.flange_a.tau + self.flange_b.tau, 0),
            gl.Eq(self.flange_a.phi - housing, self.ratio * (self.flange_b.phi - housing)),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class IdealPlanetary(gl.Component):
    """Planetary set without inertia or losses: Willis' equation ``(1 + ratio) carrier = sun + ratio ring``."""

    icon = "planetary"
    radii = ("ratio",)

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

    def energies(self) -> gl.Energy:
        return gl.Energy()


class RotationToTranslation(gl.Component):
    """Base of rack and wheel: a rotational and a translational flange, each with an optional housing."""

    icon = "rack"

    use_support_r = gl.Structural(False, "whether the housing of the shaft is a flange; otherwise it stands still")
    use_support_t = gl.Structural(False, "whether the housing of the rod is a flange; otherwise it stands still")
    flange_r = Flange("shaft")
    flange_t = TranslationalFlange("rod")
    support_r = Flange("housing of the shaft", when="use_support_r")
    support_t = TranslationalFlange("housing of the rod", when="use_support_t")

    def angle(self) -> Any:
        """Angle of the shaft relative to its housing."""
        return self.flange_r.phi - self.support_r.phi if self.use_support_r else self.flange_r.phi

    def position(self) -> Any:
        """Position of the rod relative to its housing."""
        return self.flange_t.s - self.support_t.s if self.use_support_t else self.flange_t.s

    def equations(self) -> list[gl.Eq]:
        turning = [gl.Eq(self.support_r.tau, -self.flange_r.tau)] if self.use_support_r else []
        return [*turning, gl.Eq(self.support_t.f, -self.flange_t.f)] if self.use_support_t else turning

    def energies(self) -> gl.Energy:
        return gl.Energy()


class IdealGearR2T(RotationToTranslation):
    """Rack and pinion without inertia or losses: ``phi_r = ratio s_t``, ``ratio tau_r + f_t = 0``."""

    ratio = gl.Parameter("rad/m", "transmission ratio, angle of flange_r over travel of flange_t")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.angle(), self.ratio * self.position()),
            gl.Eq(self.ratio * self.flange_r.tau + self.flange_t.f, 0),
        ]


class IdealRollingWheel(RotationToTranslation):
    """Wheel rolling without slip, inertia or losses: ``radius phi_r = s_t``, ``radius f_t + tau_r = 0``."""

    radius = gl.Parameter("m", "radius of the wheel")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.radius * self.angle(), self.position()),
            gl.Eq(self.radius * self.flange_t.f + self.flange_r.tau, 0),
        ]
