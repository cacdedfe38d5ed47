"""Inertias, springs, dampers, distributed shafts, and the fixed ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

import gearlib as gl
from gearparts.interfaces import SLOW, Compliant, Dissipative, Flange, MaybeHeated, TwoFlanges

if TYPE_CHECKING:
    from gearlib.language.component import Connection


class Fixed(gl.Component):
    """Flange fixed at an angle: ``phi = phi0``."""

    icon = "fixed"

    flange = Flange("held")
    phi0 = gl.Parameter("rad", "fixed angle", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.phi, self.phi0)]

    def energies(self) -> gl.Energy:
        return gl.Energy(source=True)


class Inertia(TwoFlanges):
    """Rigid body rotating about a fixed axis: ``J der(w) = flange_a.tau + flange_b.tau``."""

    icon = "inertia"

    J = gl.Parameter("kg.m2", "moment of inertia", min=0)
    phi = gl.Variable("rad", "angle")
    w = gl.Variable("rad/s", "angular velocity", nominal=SLOW)
    a = gl.Derivative("w", "rad/s2", "angular acceleration")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.flange_a.phi, self.phi),
            gl.Eq(self.flange_b.phi, self.phi),
            gl.Eq(gl.der(self.phi), self.w),
            gl.Eq(self.J * gl.der(self.w), self.flange_a.tau + self.flange_b.tau),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.J * self.w**2 / 2)


class Disc(TwoFlanges):
    """Constant angle between two flanges: ``phi_b = phi_a + delta_phi``, ``tau_a + tau_b = 0``."""

    icon = "disc"

    delta_phi = gl.Parameter("rad", "angle of flange_b relative to flange_a", default=0.0)
    phi = gl.Variable("rad", "angle midway between the flanges", state="avoid")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.flange_a.phi, self.phi - self.delta_phi / 2),
            gl.Eq(self.flange_b.phi, self.phi + self.delta_phi / 2),
            gl.Eq(self.flange_a.tau + self.flange_b.tau, 0),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class Spring(Compliant):
    """Linear torsional spring: ``tau = c (phi_rel - phi_rel0)``."""

    icon = "spring"

    c = gl.Parameter("N.m/rad", "stiffness", min=0)
    phi_rel0 = gl.Parameter("rad", "unstretched angle", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.tau, self.c * (self.phi_rel - self.phi_rel0))]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.c * (self.phi_rel - self.phi_rel0) ** 2 / 2)


class Damper(Compliant, Dissipative):
    """Linear torsional damper: ``tau = d w_rel``; it dissipates ``tau w_rel``."""

    icon = "damper"

    d = gl.Parameter("N.m.s/rad", "damping", min=0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.tau, self.d * self.w_rel),
            gl.Eq(self.loss_power, self.tau * self.w_rel),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(heat=self.loss_power)


class SpringDamper(Compliant, Dissipative):
    """Spring and damper in parallel: ``tau = c (phi_rel - phi_rel0) + d w_rel``; it dissipates ``d w_rel**2``."""

    icon = "spring_damper"

    c = gl.Parameter("N.m/rad", "stiffness", min=0)
    d = gl.Parameter("N.m.s/rad", "damping", min=0)
    phi_rel0 = gl.Parameter("rad", "unstretched angle", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.tau, self.c * (self.phi_rel - self.phi_rel0) + self.d * self.w_rel),
            gl.Eq(self.loss_power, self.d * self.w_rel**2),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.c * (self.phi_rel - self.phi_rel0) ** 2 / 2, heat=self.loss_power)


class RelativeStates(TwoFlanges):
    """Provides the relative motion of two shafts as states: ``phi_rel = phi_b - phi_a``, ``w_rel = der(phi_rel)``; no torque."""

    icon = "link"

    phi_rel = gl.Variable("rad", "flange_b.phi - flange_a.phi", state="prefer")
    w_rel = gl.Variable("rad/s", "relative speed", state="prefer")
    a_rel = gl.Variable("rad/s2", "relative acceleration")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.phi_rel, self.flange_b.phi - self.flange_a.phi),
            gl.Eq(self.w_rel, gl.der(self.phi_rel)),
            gl.Eq(self.a_rel, gl.der(self.w_rel)),
            gl.Eq(self.flange_a.tau, 0),
            gl.Eq(self.flange_b.tau, 0),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class InitializeFlange(gl.Component):
    """Fixes the start of a shaft: ``phi = phi_start``, ``w = w_start`` and ``a = a_start``, at the start only; no torque.

    It fixes start values of deviations, which are variables on which nothing else depends. The number of values must fit the model: for
    an acceleration, one start value elsewhere must be free.
    """

    use_phi_start = gl.Structural(True, "whether the angle starts at phi_start")
    use_w_start = gl.Structural(True, "whether the speed starts at w_start")
    use_a_start = gl.Structural(True, "whether the acceleration starts at a_start")
    flange = Flange("shaft to be started")
    phi_start = gl.Input("rad", "angle at the start", default=0.0)
    w_start = gl.Input("rad/s", "speed at the start", default=0.0)
    a_start = gl.Input("rad/s2", "acceleration at the start", default=0.0)
    w = gl.Variable("rad/s", "speed", state="avoid")
    a = gl.Variable("rad/s2", "acceleration")
    phi_error = gl.Variable("rad", "phi - phi_start, where used", start=0.0)
    w_error = gl.Variable("rad/s", "w - w_start, where used", start=0.0)
    a_error = gl.Variable("rad/s2", "a - a_start, where used", start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.flange.tau, 0),
            gl.Eq(self.w, gl.der(self.flange.phi)),
            gl.Eq(self.a, gl.der(self.w)),
            gl.Eq(self.phi_error, self.flange.phi - self.phi_start if self.use_phi_start else 0),
            gl.Eq(self.w_error, self.w - self.w_start if self.use_w_start else 0),
            gl.Eq(self.a_error, self.a - self.a_start if self.use_a_start else 0),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class TorsionalShaft(TwoFlanges, MaybeHeated):
    """Elastic shaft with distributed inertia, divided into equal segments: springs with half of their inertia at each end.

    Undamped and with free ends its natural frequencies are ``w_k = 2 n sqrt(c / J) sin(k pi / (2 n))``, which tend to the continuous
    shaft's ``k pi sqrt(c / J)`` as n grows. With ``use_heat_port`` all segments share one heat port.
    """

    icon = "shaft"

    segments = gl.Structural(10, "number n of segments", min=1, max=100_000)
    J = gl.Parameter("kg.m2", "moment of inertia of the whole shaft", min=0)
    c = gl.Parameter("N.m/rad", "stiffness of the whole shaft", min=0)
    d = gl.Parameter("N.m.s/rad", "damping of the whole shaft, of its twisting", default=0.0, min=0)

    def assemble(self) -> list[Connection]:
        n = self.segments
        self.bodies = [Inertia(J=self.J / (2 * n if i in (0, n) else n)) for i in range(n + 1)]
        self.springs = [SpringDamper(c=n * self.c, d=n * self.d, use_heat_port=self.use_heat_port) for _ in range(n)]
        left = [gl.connect(body.flange_b, s.flange_a) for body, s in zip(self.bodies[:-1], self.springs, strict=True)]
        right = [gl.connect(s.flange_b, body.flange_a) for body, s in zip(self.bodies[1:], self.springs, strict=True)]
        ends = [gl.connect(self.flange_a, self.bodies[0].flange_a), gl.connect(self.bodies[-1].flange_b, self.flange_b)]
        heat = [gl.connect(self.heat_port, *(s.heat_port for s in self.springs))] if self.use_heat_port else []
        return [*ends, *left, *right, *heat]
