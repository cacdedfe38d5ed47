"""Translational masses, springs, dampers, forces, and the fixed ground."""

from __future__ import annotations

import gearlib as gl
from gearparts.interfaces import SLOW, Dissipative, TranslationalFlange
from gearparts.rotational.sources import SMALLEST


class TwoTranslationalFlanges(gl.Component):
    """Base of elements between two rods."""

    flange_a = TranslationalFlange("left")
    flange_b = TranslationalFlange("right")


class TranslationalFixed(gl.Component):
    """Flange fixed at a position: ``s = s0``."""

    icon = "fixed"

    flange = TranslationalFlange("held")
    s0 = gl.Parameter("m", "fixed position", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.s, self.s0)]

    def energies(self) -> gl.Energy:
        return gl.Energy(source=True)


class Mass(TwoTranslationalFlanges):
    """Rigid sliding body: ``m der(v) = flange_a.f + flange_b.f``, ``v = der(s)``; its flanges are at ``s -/+ L / 2``."""

    icon = "mass"

    m = gl.Parameter("kg", "mass", min=0)
    L = gl.Parameter("m", "length from flange_a to flange_b", default=0.0)
    s = gl.Variable("m", "position of the middle")
    v = gl.Variable("m/s", "velocity", nominal=SLOW)
    a = gl.Derivative("v", "m/s2", "acceleration")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.flange_a.s, self.s - self.L / 2),
            gl.Eq(self.flange_b.s, self.s + self.L / 2),
            gl.Eq(gl.der(self.s), self.v),
            gl.Eq(self.m * gl.der(self.v), self.flange_a.f + self.flange_b.f),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.m * self.v**2 / 2)


class TranslationalCompliant(TwoTranslationalFlanges):
    """Base of translational springs and dampers: the force between the flanges, relative position and velocity.

    The force acts on both flanges with opposite signs; a derived class equates it.
    """

    s_rel = gl.Variable("m", "flange_b.s - flange_a.s", state="prefer", nominal=1e-4)
    v_rel = gl.Variable("m/s", "relative velocity", nominal=SLOW)
    f = gl.Variable("N", "force between the flanges; pulls them together when positive")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.s_rel, self.flange_b.s - self.flange_a.s),
            gl.Eq(self.v_rel, gl.der(self.s_rel)),
            gl.Eq(self.flange_b.f, self.f),
            gl.Eq(self.flange_a.f, -self.f),
        ]


class TranslationalSpring(TranslationalCompliant):
    """Linear spring: ``f = c (s_rel - s_rel0)``."""

    icon = "spring"

    c = gl.Parameter("N/m", "stiffness", min=0)
    s_rel0 = gl.Parameter("m", "unstretched length", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.f, self.c * (self.s_rel - self.s_rel0))]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.c * (self.s_rel - self.s_rel0) ** 2 / 2)


class TranslationalDamper(TranslationalCompliant, Dissipative):
    """Linear damper: ``f = d v_rel``; it dissipates ``f v_rel``."""

    icon = "damper"

    d = gl.Parameter("N.s/m", "damping", min=0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.f, self.d * self.v_rel),
            gl.Eq(self.loss_power, self.f * self.v_rel),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(heat=self.loss_power)


class TranslationalSpringDamper(TranslationalCompliant, Dissipative):
    """Spring and damper in parallel: ``f = c (s_rel - s_rel0) + d v_rel``; it dissipates ``d v_rel**2``."""

    icon = "spring_damper"

    c = gl.Parameter("N/m", "stiffness", min=0)
    d = gl.Parameter("N.s/m", "damping", min=0)
    s_rel0 = gl.Parameter("m", "unstretched length", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.f, self.c * (self.s_rel - self.s_rel0) + self.d * self.v_rel),
            gl.Eq(self.loss_power, self.d * self.v_rel**2),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.c * (self.s_rel - self.s_rel0) ** 2 / 2, heat=self.loss_power)


class OneTranslationalFlange(gl.Component):
    """Base of forces: one flange, and an optional support, the housing that takes the reaction."""

    use_support = gl.Structural(False, "whether the housing is a flange; otherwise it stands still")
    flange = TranslationalFlange("driven rod")
    support = TranslationalFlange("housing", when="use_support")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.support.f, -self.flange.f)] if self.use_support else []

    def energies(self) -> gl.Energy:
        return gl.Energy(source=True)


class Force(OneTranslationalFlange):
    """Prescribed force: ``flange.f = -f``; a positive ``f`` accelerates the connected rod."""

    icon = "force"

    f = gl.Input("N", "driving force")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.f, -self.f)]


class QuadraticSpeedDependentForce(OneTranslationalFlange):
    """Force proportional to velocity squared: ``f = flange.f = -f_nominal (v / v_nominal)**2``.

    With ``force_direction`` (the default) it acts in the same direction for both directions of motion; without, it changes sign with
    the velocity: ``f = -f_nominal v abs(v) / v_nominal**2``.
    """

    icon = "load"

    f_nominal = gl.Parameter("N", "force at nominal velocity that accelerates the rod; negative: a load")
    v_nominal = gl.Parameter("m/s", "nominal velocity", min=SMALLEST)
    force_direction = gl.Structural(True, "same direction of force in both directions of motion")
    v = gl.Variable("m/s", "velocity of the flange relative to the support", state="avoid")
    f = gl.Variable("N", "force into this component at the flange")

    def equations(self) -> list[gl.Eq]:
        position = self.flange.s - self.support.s if self.use_support else self.flange.s
        square = self.v**2 if self.force_direction else self.v * gl.no_event(abs(self.v))
        return [
            gl.Eq(self.v, gl.der(position)),
            gl.Eq(self.f, -self.f_nominal * square / self.v_nominal**2),
            gl.Eq(self.flange.f, self.f),
        ]

    def energies(self) -> gl.Energy:
        """It either drives, or dissipates the power it takes, like air resistance."""
        power = self.f * self.v
        return gl.Energy(supplied=gl.Max(-power, 0), heat=gl.Max(power, 0))
