"""Bodies that turn, springs and dampers between them, and the ground."""

from __future__ import annotations

import gearlib as gl
from gearparts.interfaces import Compliant, Flange, TwoFlanges


class Fixed(gl.Component):
    """A flange held at an angle: ``phi = phi0``."""

    flange = Flange("held")
    phi0 = gl.Parameter("rad", "fixed angle", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.phi, self.phi0)]


class Inertia(TwoFlanges):
    """Rigid body turning about a fixed axis: ``J der(w) = flange_a.tau + flange_b.tau``."""

    J = gl.Parameter("kg.m2", "moment of inertia", min=0)
    phi = gl.Variable("rad", "angle")
    w = gl.Variable("rad/s", "angular velocity")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.flange_a.phi, self.phi),
            gl.Eq(self.flange_b.phi, self.phi),
            gl.Eq(gl.der(self.phi), self.w),
            gl.Eq(self.J * gl.der(self.w), self.flange_a.tau + self.flange_b.tau),
        ]


class Spring(Compliant):
    """Linear torsional spring: ``tau = c (phi_rel - phi_rel0)``."""

    c = gl.Parameter("N.m/rad", "stiffness", min=0)
    phi_rel0 = gl.Parameter("rad", "unstretched angle", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [*self.compliant_equations(), gl.Eq(self.tau, self.c * (self.phi_rel - self.phi_rel0))]


class Damper(Compliant):
    """Linear torsional damper: ``tau = d w_rel``."""

    d = gl.Parameter("N.m.s/rad", "damping", min=0)

    def equations(self) -> list[gl.Eq]:
        return [*self.compliant_equations(), gl.Eq(self.tau, self.d * self.w_rel)]


class SpringDamper(Compliant):
    """Spring and damper side by side: ``tau = c (phi_rel - phi_rel0) + d w_rel``."""

    c = gl.Parameter("N.m/rad", "stiffness", min=0)
    d = gl.Parameter("N.m.s/rad", "damping", min=0)
    phi_rel0 = gl.Parameter("rad", "unstretched angle", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [*self.compliant_equations(), gl.Eq(self.tau, self.c * (self.phi_rel - self.phi_rel0) + self.d * self.w_rel)]
