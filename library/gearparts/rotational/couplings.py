"""Couplings between shafts: elastic couplings with hubs, universal joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

import gearlib as gl
from gearparts.interfaces import Compliant, Dissipative, MaybeHeated, TwoFlanges
from gearparts.rotational.backlash import ElastoBacklash
from gearparts.rotational.shafts import Inertia, SpringDamper

if TYPE_CHECKING:
    from gearlib.language.component import Connection


class CubicSpringDamper(Compliant, Dissipative):
    """Spring with cubic stiffening (or softening), and a damper: ``tau = c x + c_3 x**3 + d w_rel``, ``x = phi_rel - phi_rel0``.

    It stores ``c x**2 / 2 + c_3 x**4 / 4`` and dissipates ``d w_rel**2``. A model of rubber and steel-spring couplings (G. Duffing,
    "Erzwungene Schwingungen bei veränderlicher Eigenfrequenz", Vieweg, 1918).
    """

    icon = "spring_damper"

    c = gl.Parameter("N.m/rad", "stiffness where it is not twisted", min=0)
    c_3 = gl.Parameter("N.m/rad3", "growth of the stiffness; negative: it softens", default=0.0)
    d = gl.Parameter("N.m.s/rad", "damping", min=0)
    phi_rel0 = gl.Parameter("rad", "unstretched angle", default=0.0)

    def equations(self) -> list[gl.Eq]:
        x = self.phi_rel - self.phi_rel0
        return [
            gl.Eq(self.tau, self.c * x + self.c_3 * x**3 + self.d * self.w_rel),
            gl.Eq(self.loss_power, self.d * self.w_rel**2),
        ]

    def energies(self) -> gl.Energy:
        x = self.phi_rel - self.phi_rel0
        return gl.Energy(stored=self.c * x**2 / 2 + self.c_3 * x**4 / 4, heat=self.loss_power)


class ElasticCoupling(TwoFlanges, MaybeHeated):
    """Two hubs with an elastic element between them.

    Depending on ``element``, it is a `SpringDamper` (``"linear"``), a `CubicSpringDamper` (``"cubic"``) or an `ElastoBacklash`
    (``"backlash"``), with ``phi_rel = flange_b.phi - flange_a.phi``.
    """

    icon = "spring_damper"

    element = gl.Structural("linear", "law of the elastic element", choices=("linear", "cubic", "backlash"))
    J_a = gl.Parameter("kg.m2", "moment of inertia of the hub on flange_a", min=0)
    J_b = gl.Parameter("kg.m2", "moment of inertia of the hub on flange_b", min=0)
    c = gl.Parameter("N.m/rad", "stiffness", min=0)
    d = gl.Parameter("N.m.s/rad", "damping", min=0)
    c_3 = gl.Parameter("N.m/rad3", "cubic: growth of the stiffness", default=0.0)
    b = gl.Parameter("rad", "backlash: total backlash", default=0.0, min=0)

    def assemble(self) -> list[Connection]:
        self.hub_a, self.hub_b = Inertia(J=self.J_a), Inertia(J=self.J_b)
        heat = self.use_heat_port
        if self.element == "linear":
            self.spring: SpringDamper | CubicSpringDamper | ElastoBacklash = SpringDamper(
                c=self.c, d=self.d, use_heat_port=heat
            )
        elif self.element == "cubic":
            self.spring = CubicSpringDamper(c=self.c, c_3=self.c_3, d=self.d, use_heat_port=heat)
        else:
            self.spring = ElastoBacklash(c=self.c, d=self.d, b=self.b, use_heat_port=heat)
        links = [
            gl.connect(self.flange_a, self.hub_a.flange_a),
            gl.connect(self.hub_a.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.hub_b.flange_a),
            gl.connect(self.hub_b.flange_b, self.flange_b),
        ]
        return [*links, gl.connect(self.heat_port, self.spring.heat_port)] if heat else links


class UniversalJoint(TwoFlanges):
    """Universal (Cardan, Hooke) joint between shafts at an angle, without inertia or losses.

    ``tan(phi_b) = tan(phi_a) / cos(beta)``; so ``w_b = w_a cos(beta) / (sin(phi_a)**2 + cos(beta)**2 cos(phi_a)**2)``, which varies
    twice per revolution between ``cos(beta)`` and ``1 / cos(beta)`` times ``w_a``, and ``w_a tau_a + w_b tau_b = 0``. At ``phi_a = 0``
    the arm of the cross in the fork of flange_a lies in the plane of both shafts. The law is written for the difference of the angles,
    ``phi_b - phi_a = atan2((1 - cos(beta)) sin(phi_a) cos(phi_a), sin(phi_a)**2 + cos(beta) cos(phi_a)**2)``, which has no jumps.

    References
    ----------
    F. Schmelz, H. C. Seherr-Thoss, E. Aucktor, "Universal Joints and Driveshafts", Springer, 2006.
    """

    icon = "joint"

    beta = gl.Parameter("rad", "angle between the shafts", min=-1.5, max=1.5)

    def equations(self) -> list[gl.Eq]:
        sin, cos, bend = gl.sin(self.flange_a.phi), gl.cos(self.flange_a.phi), gl.cos(self.beta)
        ahead = gl.atan2((1 - bend) * sin * cos, sin**2 + bend * cos**2)
        ratio = bend / (sin**2 + bend**2 * cos**2)
        return [
            gl.Eq(self.flange_b.phi, self.flange_a.phi + ahead),
            gl.Eq(self.flange_a.tau + ratio * self.flange_b.tau, 0),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()
