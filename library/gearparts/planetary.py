"""Planetary sets with elastic meshes, made of bodies, meshes and the kinematics of planets on a carrier."""

from __future__ import annotations

from typing import TYPE_CHECKING

import gearlib as gl
from gearparts.interfaces import Flange
from gearparts.meshes import ExternalMesh, InternalMesh
from gearparts.shafts import Damper, Inertia

if TYPE_CHECKING:
    from gearlib.language.component import Connection


class PlanetOnCarrier(gl.Component):
    """Kinematics of one planet whose bearing rides on the carrier, without inertia or losses.

    With ``w`` the planet's absolute speed, its pitch line moves with ``r_p w + r_h w_carrier`` at the ring's side, and with
    ``r_p w - r_h w_carrier`` at the sun's side. ``ring_side`` and ``sun_side`` turn as a planet with a resting centre would
    have to for the same motion of its pitch line, so that a mesh made for resting centres can be connected to them::

        ring_side.phi = planet.phi + (r_h / r_p) carrier.phi
        sun_side.phi  = planet.phi - (r_h / r_p) carrier.phi

    The torques conserve power.
    """

    planet = Flange("the planet's own shaft, absolute angle")
    carrier = Flange("carrier shaft")
    ring_side = Flange("the planet as the ring's mesh sees it")
    sun_side = Flange("the planet as the sun's mesh sees it")
    r_p = gl.Parameter("m", "pitch radius of the planet", min=0)
    r_h = gl.Parameter("m", "radius of the planets' centres on the carrier", min=0)

    def equations(self) -> list[gl.Eq]:
        ratio = self.r_h / self.r_p
        return [
            gl.Eq(self.ring_side.phi, self.planet.phi + ratio * self.carrier.phi),
            gl.Eq(self.sun_side.phi, self.planet.phi - ratio * self.carrier.phi),
            gl.Eq(self.planet.tau, -self.ring_side.tau - self.sun_side.tau),
            gl.Eq(self.carrier.tau, ratio * (self.sun_side.tau - self.ring_side.tau)),
        ]


class Planet(gl.Component):
    """A planet: its spin about its own axis (absolute speed), its orbit with the carrier, and their kinematics."""

    carrier = Flange("carrier shaft")
    ring_side = Flange("the planet as the ring's mesh sees it")
    sun_side = Flange("the planet as the sun's mesh sees it")
    R_p = gl.Parameter("m", "pitch radius of the planet", min=0)
    R_h = gl.Parameter("m", "radius of the planets' centres on the carrier", min=0)
    I_spin = gl.Parameter("kg.m2", "moment of inertia about the planet's own axis", min=0)
    I_orbit = gl.Parameter("kg.m2", "moment of inertia of its centre's motion about the carrier's axis", min=0)

    def assemble(self) -> list[Connection]:
        self.spin = Inertia(J=self.I_spin)
        self.orbit = Inertia(J=self.I_orbit)
        self.kinematics = PlanetOnCarrier(r_p=self.R_p, r_h=self.R_h)
        return [
            gl.connect(self.spin.flange_b, self.kinematics.planet),
            gl.connect(self.carrier, self.orbit.flange_a),
            gl.connect(self.orbit.flange_b, self.kinematics.carrier),
            gl.connect(self.kinematics.ring_side, self.ring_side),
            gl.connect(self.kinematics.sun_side, self.sun_side),
        ]


class PlanetaryUnit(gl.Component):
    """Planetary differential with elastic meshes, two degrees of freedom (the X unit).

    Two models of the planets' meshes:

    ``"lumped"``, Zhou and Cui's: one mesh at the ring and one at the sun, with the stiffness of all planets together, and one
    body each for the planets as that mesh sees them. The planets' spin and orbit follow the body at the ring rigidly; a
    support damper for each planet leads to the body at the sun, which is a motion of its own.

    ``"separate"``: every planet has a mesh with the ring and a mesh with the sun, and rides rigidly on the carrier.
    ``K_ring, C_ring, K_sun, C_sun`` then hold for one mesh; ``I_at_ring``, ``I_at_sun`` and ``C_v`` have no meaning.

    With no deflection both obey Willis' equation ``R_r w_ring + R_s w_sun = 2 R_h w_carrier``.

    References
    ----------
    X. Zhou, Y. Cui, Journal of Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290
    """

    sun = Flange("sun shaft")
    carrier = Flange("carrier shaft")
    ring = Flange("ring shaft")
    planets = gl.Structural(3, "number of planets")
    planet_meshes = gl.Structural("lumped", "one mesh for all planets, or one for each", choices=("lumped", "separate"))

    R_s = gl.Parameter("m", "pitch radius of the sun", min=0)
    R_p = gl.Parameter("m", "pitch radius of a planet", min=0)
    R_r = gl.Parameter("m", "pitch radius of the ring", default=lambda unit: unit.R_s + 2 * unit.R_p, min=0)
    R_h = gl.Parameter("m", "radius of the planets' centres on the carrier", default=lambda unit: unit.R_s + unit.R_p, min=0)
    I_s = gl.Parameter("kg.m2", "moment of inertia of the sun", min=0)
    I_r = gl.Parameter("kg.m2", "moment of inertia of the ring", min=0)
    I_h = gl.Parameter("kg.m2", "moment of inertia of the carrier without planets", min=0)
    I_spin = gl.Parameter("kg.m2", "moment of inertia of one planet about its own axis", min=0)
    I_orbit = gl.Parameter("kg.m2", "moment of inertia of one planet's centre about the carrier's axis", min=0)
    I_at_ring = gl.Parameter("kg.m2", "lumped: planets as the ring's mesh sees them", default=lambda unit: unit.I_spin, min=0)
    I_at_sun = gl.Parameter("kg.m2", "lumped: planets as the sun's mesh sees them", default=lambda unit: unit.I_spin, min=0)
    K_ring = gl.Parameter("N/m", "stiffness of a mesh at the ring", min=0)
    C_ring = gl.Parameter("N.s/m", "damping of a mesh at the ring", min=0)
    K_sun = gl.Parameter("N/m", "stiffness of a mesh at the sun", min=0)
    C_sun = gl.Parameter("N.s/m", "damping of a mesh at the sun", min=0)
    C_v = gl.Parameter("N.s/m", "lumped: damping of one planet's support along the line of action", default=0.0, min=0)
    e_rate = gl.Input("m/s", "rate of the transmission error, the same in all meshes", default=0.0)

    def assemble(self) -> list[Connection]:
        self.ring_gear, self.sun_gear = Inertia(J=self.I_r), Inertia(J=self.I_s)
        self.carrier_body = Inertia(J=self.I_h)
        self.planet = [
            Planet(R_p=self.R_p, R_h=self.R_h, I_spin=self.I_spin, I_orbit=self.I_orbit) for _ in range(self.planets)
        ]
        shafts = [
            gl.connect(self.ring, self.ring_gear.flange_a),
            gl.connect(self.sun, self.sun_gear.flange_a),
            gl.connect(self.carrier, self.carrier_body.flange_a),
            gl.connect(self.carrier_body.flange_b, *(planet.carrier for planet in self.planet)),
        ]
        return shafts + (self._lumped() if self.planet_meshes == "lumped" else self._separate())

    def _lumped(self) -> list[Connection]:
        self.ring_mesh, self.sun_mesh = self._internal_mesh(), self._external_mesh()
        self.planets_at_ring, self.planets_at_sun = Inertia(J=self.I_at_ring), Inertia(J=self.I_at_sun)
        self.support = [Damper(d=self.C_v * self.R_p**2) for _ in self.planet]
        links = [
            gl.connect(self.ring_gear.flange_b, self.ring_mesh.flange_a),
            gl.connect(self.ring_mesh.flange_b, self.planets_at_ring.flange_a),
            gl.connect(self.sun_gear.flange_b, self.sun_mesh.flange_a),
            gl.connect(self.sun_mesh.flange_b, self.planets_at_sun.flange_a),
            gl.connect(self.planets_at_ring.flange_b, *(planet.ring_side for planet in self.planet)),
            gl.connect(self.planets_at_sun.flange_b, *(support.flange_a for support in self.support)),
        ]
        return links + [gl.connect(p.sun_side, s.flange_b) for p, s in zip(self.planet, self.support, strict=True)]

    def _separate(self) -> list[Connection]:
        self.ring_meshes = [self._internal_mesh() for _ in self.planet]
        self.sun_meshes = [self._external_mesh() for _ in self.planet]
        links = [
            gl.connect(self.ring_gear.flange_b, *(mesh.flange_a for mesh in self.ring_meshes)),
            gl.connect(self.sun_gear.flange_b, *(mesh.flange_a for mesh in self.sun_meshes)),
        ]
        for planet, at_ring, at_sun in zip(self.planet, self.ring_meshes, self.sun_meshes, strict=True):
            links += [gl.connect(at_ring.flange_b, planet.ring_side), gl.connect(at_sun.flange_b, planet.sun_side)]
        return links

    def _internal_mesh(self) -> InternalMesh:
        return InternalMesh(r_a=self.R_r, r_b=self.R_p, c=self.K_ring, d=self.C_ring, e_rate=self.e_rate)

    def _external_mesh(self) -> ExternalMesh:
        return ExternalMesh(r_a=self.R_s, r_b=self.R_p, c=self.K_sun, d=self.C_sun, e_rate=self.e_rate)
