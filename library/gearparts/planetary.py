"""Planetary sets with elastic meshes, made of bodies, meshes and the kinematics of planets on a carrier."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gearlib as gl
from gearparts.gears import IdealGear, IdealPlanetary
from gearparts.interfaces import Flange
from gearparts.lossy_planetary import IDEAL_MESH, NO_FRICTION, LossyPlanetary
from gearparts.mesh_models import DetailedExternalMesh, DetailedInternalMesh
from gearparts.meshes import ExternalMesh, InternalMesh
from gearparts.phasing import check_assembly
from gearparts.planar import PlanarPlanetaryUnit
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

    def energies(self) -> gl.Energy:
        return gl.Energy()


class Planet(gl.Component):
    """A planet: its spin about its own axis (absolute speed), its orbit with the carrier, and their kinematics.

    ``I_spin der(w) = `` torques of both sides, with `PlanetOnCarrier` between them and the carrier; the orbit adds ``I_orbit`` to
    the carrier.
    """

    carrier = Flange("carrier shaft")
    shaft = Flange("the planet's own shaft, absolute angle")
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
            gl.connect(self.shaft, self.spin.flange_a),
            gl.connect(self.spin.flange_b, self.kinematics.planet),
            gl.connect(self.carrier, self.orbit.flange_a),
            gl.connect(self.orbit.flange_b, self.kinematics.carrier),
            gl.connect(self.kinematics.ring_side, self.ring_side),
            gl.connect(self.kinematics.sun_side, self.sun_side),
        ]


class PlanetaryUnit(gl.Component):
    """Planetary differential, two degrees of freedom (the X unit), in several levels of detail.

    ``level`` chooses how much of it moves; bodies and radii are the same at all levels.

    ``"ideal"``: rigid; `IdealPlanetary` with the inertias of sun, ring, carrier and planets.

    ``"lossy"``: the same with the losses of `LossyPlanetary`: ``sun_efficiency``, ``ring_efficiency``, ``bearing``.

    ``"elastic"``: bodies that turn, with elastic meshes, in one of two models of the planets' meshes (``planet_meshes``):

    - ``"lumped"``, Zhou and Cui's: one mesh at the ring and one at the sun, with the stiffness of all planets together, and one
      body each for the planets as that mesh sees them. The planets' spin and orbit follow the body at the ring rigidly; a support
      damper for each planet leads to the body at the sun, which is a motion of its own.
    - ``"separate"``: every planet has a mesh with the ring and a mesh with the sun, and rides rigidly on the carrier.
      ``K_ring, C_ring, K_sun, C_sun`` then hold for one mesh; ``I_at_ring``, ``I_at_sun`` and ``C_v`` have no meaning. With
      ``sun_details`` or ``ring_details`` the meshes are detailed ones (`DetailedExternalMesh`, `DetailedInternalMesh`) with these
      choices and values, whose phases follow from the numbers of teeth: planet n at ``psi_n`` has the mesh phase
      ``-Z_s psi_n`` at the sun and ``ring_phase - Z_r psi_n`` at the ring (`planet_phasing`). Where the sun drives, the ring's
      phase decreases, and its patterns are run through backwards.

    ``"planar"``: all bodies also move sideways on elastic bearings (`PlanarPlanetaryUnit`), with a mesh for each planet, and
    ``K_ring, C_ring, K_sun, C_sun`` for one mesh. The radii are those at which the meshes' forces act, so the planets' centres
    are at ``R_h / cos(alpha)``.

    With no deflection, and no slip in the support dampers of ``"lumped"`` (a third degree of freedom), all obey Willis' equation
    ``R_r w_ring + R_s w_sun = 2 R_h w_carrier`` with ``R_r = R_s + 2 R_p``. Numbers
    of teeth, where given, must allow equally spaced planets to be assembled.

    References
    ----------
    X. Zhou, Y. Cui, Journal of Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290

    J. Lin, R. G. Parker, Journal of Vibration and Acoustics 121 (1999) 316-321. https://doi.org/10.1115/1.2893982
    """

    sun = Flange("sun shaft")
    carrier = Flange("carrier shaft")
    ring = Flange("ring shaft")
    planets = gl.Structural(3, "number of planets", min=1)
    level = gl.Structural("elastic", "what moves and what loses power", choices=("ideal", "lossy", "elastic", "planar"))
    planet_meshes = gl.Structural("lumped", "one mesh for all planets, or one for each", choices=("lumped", "separate"))
    sun_efficiency = gl.Structural(IDEAL_MESH, "lossy: rows of speed (rad/s), efficiencies with sun and with ring driving")
    ring_efficiency = gl.Structural(IDEAL_MESH, "lossy: rows of speed (rad/s), efficiencies with sun and with ring driving")
    bearing = gl.Structural(NO_FRICTION, "lossy: rows of speed (rad/s) and friction torque at the sun (N.m)")
    Z_s = gl.Structural(0, "teeth of the sun; 0: not known", min=0)
    Z_p = gl.Structural(0, "teeth of a planet; 0: not known", min=0)
    Z_r = gl.Structural(0, "teeth of the ring; 0: not known", min=0)
    sun_details = gl.Structural((), "separate: choices and values of the sun's detailed meshes, as pairs")
    ring_details = gl.Structural((), "separate: choices and values of the ring's detailed meshes, as pairs")

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
    K_ring = gl.Parameter("N/m", "elastic, planar: stiffness of a mesh at the ring", default=1e8, min=0)
    C_ring = gl.Parameter("N.s/m", "elastic, planar: damping of a mesh at the ring", default=0.0, min=0)
    K_sun = gl.Parameter("N/m", "elastic, planar: stiffness of a mesh at the sun", default=1e8, min=0)
    C_sun = gl.Parameter("N.s/m", "elastic, planar: damping of a mesh at the sun", default=0.0, min=0)
    C_v = gl.Parameter("N.s/m", "lumped: damping of one planet's support along the line of action", default=0.0, min=0)
    ring_phase = gl.Parameter(
        "rad", "separate: mesh phase of the ring against the sun", default=lambda unit: gl.pi * ((unit.Z_p - 1) % 2)
    )
    alpha = gl.Parameter("rad", "planar: working pressure angle", default=gl.pi / 9, min=0, max=1.5)
    m_s = gl.Parameter("kg", "planar: mass of the sun", default=lambda unit: 2 * unit.I_s / unit.R_s**2, min=0)
    m_r = gl.Parameter("kg", "planar: mass of the ring", default=lambda unit: unit.I_r / unit.R_r**2, min=0)
    m_h = gl.Parameter("kg", "planar: mass of the carrier", default=lambda unit: 2 * unit.I_h / unit.R_h**2, min=0)
    k_s = gl.Parameter("N/m", "planar: bearing stiffness of the sun", default=1e9, min=0)
    k_r = gl.Parameter("N/m", "planar: bearing stiffness of the ring", default=1e9, min=0)
    k_h = gl.Parameter("N/m", "planar: bearing stiffness of the carrier", default=1e9, min=0)
    k_p = gl.Parameter("N/m", "planar: bearing stiffness of a planet", default=1e9, min=0)
    e_rate = gl.Input("m/s", "elastic: rate of the transmission error, the same in all meshes", default=0.0)

    def assemble(self) -> list[Connection]:
        if self.Z_s or self.Z_p or self.Z_r:
            check_assembly(type(self).__name__, self.Z_s, self.Z_p, self.Z_r, self.planets)
        if self.level == "planar":
            return self._planar()
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
        if self.level != "elastic":
            return shafts + self._rigid()
        return shafts + (self._lumped() if self.planet_meshes == "lumped" else self._separate())

    def _rigid(self) -> list[Connection]:
        """The set, and a gear without losses that turns the planets."""
        ratio = self.R_r / self.R_s
        if self.level == "ideal":
            self.set: IdealPlanetary | LossyPlanetary = IdealPlanetary(ratio=ratio)
        else:
            self.set = LossyPlanetary(
                ratio=ratio, sun_mesh=self.sun_efficiency, ring_mesh=self.ring_efficiency, bearing=self.bearing
            )
        self.rolling = IdealGear(ratio=-self.R_p / self.R_s)
        return [
            gl.connect(self.sun_gear.flange_b, self.set.sun, self.rolling.flange_a),
            gl.connect(self.rolling.flange_b, *(planet.sun_side for planet in self.planet)),
            gl.connect(self.ring_gear.flange_b, self.set.ring),
            gl.connect(self.carrier_body.flange_b, self.set.carrier),
        ]

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
        if self.sun_details or self.ring_details:
            return self._detailed()
        self.ring_meshes: list[Any] = [self._internal_mesh() for _ in self.planet]
        self.sun_meshes: list[Any] = [self._external_mesh() for _ in self.planet]
        links = [
            gl.connect(self.ring_gear.flange_b, *(mesh.flange_a for mesh in self.ring_meshes)),
            gl.connect(self.sun_gear.flange_b, *(mesh.flange_a for mesh in self.sun_meshes)),
        ]
        for planet, at_ring, at_sun in zip(self.planet, self.ring_meshes, self.sun_meshes, strict=True):
            links += [gl.connect(at_ring.flange_b, planet.ring_side), gl.connect(at_sun.flange_b, planet.sun_side)]
        return links

    def _detailed(self) -> list[Connection]:
        """Meshes that ride on the carrier, each with its phase."""
        check_assembly(type(self).__name__, self.Z_s, self.Z_p, self.Z_r, self.planets)
        psi = [2 * gl.pi * n / self.planets for n in range(self.planets)]
        common = {"r_b": self.R_p, "use_support": True, "e_rate": self.e_rate}
        sun = {**common, "r_a": self.R_s, "z_a": self.Z_s, "c": self.K_sun, "d": self.C_sun, **dict(self.sun_details)}
        ring = {**common, "r_a": self.R_r, "z_a": self.Z_r, "c": self.K_ring, "d": self.C_ring, **dict(self.ring_details)}
        at_sun, at_ring = sun.pop("phase0", 0), ring.pop("phase0", 0) + self.ring_phase
        self.sun_meshes = [DetailedExternalMesh(phase0=at_sun - self.Z_s * p, **sun) for p in psi]
        self.ring_meshes = [DetailedInternalMesh(phase0=at_ring - self.Z_r * p, **ring) for p in psi]
        links = [
            gl.connect(self.ring_gear.flange_b, *(mesh.flange_a for mesh in self.ring_meshes)),
            gl.connect(self.sun_gear.flange_b, *(mesh.flange_a for mesh in self.sun_meshes)),
            gl.connect(self.carrier_body.flange_b, *(mesh.support for mesh in (*self.sun_meshes, *self.ring_meshes))),
        ]
        meshing = zip(self.planet, self.ring_meshes, self.sun_meshes, strict=True)
        return links + [gl.connect(p.shaft, outer.flange_b, inner.flange_b) for p, outer, inner in meshing]

    def _planar(self) -> list[Connection]:
        r_c = self.R_h / gl.cos(self.alpha)
        self.planar = PlanarPlanetaryUnit(
            planets=self.planets, r_s=self.R_s, r_r=self.R_r, r_p=self.R_p, r_c=r_c, m_s=self.m_s, m_r=self.m_r,
            m_c=self.m_h, m_p=self.I_orbit / r_c**2, I_s=self.I_s, I_r=self.I_r, I_c=self.I_h, I_p=self.I_spin,
            k_sp=self.K_sun, k_rp=self.K_ring, d_sp=self.C_sun, d_rp=self.C_ring, k_s=self.k_s, k_r=self.k_r, k_c=self.k_h,
            k_p=self.k_p, alpha=self.alpha,
        )  # fmt: skip
        return [gl.connect(getattr(self, shaft), getattr(self.planar, shaft)) for shaft in ("sun", "carrier", "ring")]

    def _internal_mesh(self) -> InternalMesh:
        return InternalMesh(r_a=self.R_r, r_b=self.R_p, c=self.K_ring, d=self.C_ring, e_rate=self.e_rate)

    def _external_mesh(self) -> ExternalMesh:
        return ExternalMesh(r_a=self.R_s, r_b=self.R_p, c=self.K_sun, d=self.C_sun, e_rate=self.e_rate)
