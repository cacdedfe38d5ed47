"""Planar planetary gears: translational-rotational model with x, y and rotation of each body.

The model of Lin and Parker: bodies in a plane on elastic bearings, with meshes as springs along their lines of action, in the frame of
a carrier at rest (no gyroscopic terms). Positions are counted from the unloaded state.

References
----------
J. Lin, R. G. Parker, "Analytical Characterization of the Unique Properties of Planetary Gear Free Vibration", Journal of
Vibration and Acoustics 121 (1999) 316-321. https://doi.org/10.1115/1.2893982
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gearlib as gl
from gearlib.errors import BindingError
from gearparts.interfaces import Flange
from gearparts.planetary.phasing import MOST_PLANETS, check_angles

if TYPE_CHECKING:
    from gearlib.language.component import Connection


class PlanarFlange(gl.Connector):
    """A point of a body in the plane: displacements (m), angle (rad); forces (N) and torque (N.m), flows."""

    x = gl.Potential("m", "displacement in x")
    y = gl.Potential("m", "displacement in y")
    phi = gl.Potential("rad", "angle")
    f_x = gl.Flow("N", "force in x, into the component")
    f_y = gl.Flow("N", "force in y, into the component")
    tau = gl.Flow("N.m", "torque, into the component")


class PlanarBody(gl.Component):
    """A rigid body in the plane: ``m der(v) = f``, ``J der(w) = tau``."""

    icon = "body"

    centre = PlanarFlange("centre of mass")
    m = gl.Parameter("kg", "mass", min=0)
    J = gl.Parameter("kg.m2", "moment of inertia about the centre", min=0)
    v_x = gl.Variable("m/s", "velocity in x")
    v_y = gl.Variable("m/s", "velocity in y")
    w = gl.Variable("rad/s", "angular velocity")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.v_x, gl.der(self.centre.x)),
            gl.Eq(self.v_y, gl.der(self.centre.y)),
            gl.Eq(self.w, gl.der(self.centre.phi)),
            gl.Eq(self.m * gl.der(self.v_x), self.centre.f_x),
            gl.Eq(self.m * gl.der(self.v_y), self.centre.f_y),
            gl.Eq(self.J * gl.der(self.w), self.centre.tau),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=(self.m * (self.v_x**2 + self.v_y**2) + self.J * self.w**2) / 2)


class PlanarShaft(gl.Component):
    """Couples the rotation of a planar body to a shaft, ``flange.phi = centre.phi``; the bearing takes no torque."""

    centre = PlanarFlange("the body")
    flange = Flange("its shaft")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.flange.phi, self.centre.phi),
            gl.Eq(self.flange.tau, -self.centre.tau),
            gl.Eq(self.centre.f_x, 0),
            gl.Eq(self.centre.f_y, 0),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class PlanarSupport(gl.Component):
    """Springs and dampers between a body's centre and the housing, ``f = k x + d der(x)``, including rotation."""

    centre = PlanarFlange("the body")
    k = gl.Parameter("N/m", "radial stiffness", min=0)
    d = gl.Parameter("N.s/m", "radial damping", default=0.0, min=0)
    k_phi = gl.Parameter("N.m/rad", "torsional stiffness", default=0.0, min=0)
    d_phi = gl.Parameter("N.m.s/rad", "torsional damping", default=0.0, min=0)
    turning = gl.Structural(False, "whether the support also holds the body against turning")

    def equations(self) -> list[gl.Eq]:
        c = self.centre
        torque = self.k_phi * c.phi + self.d_phi * gl.der(c.phi) if self.turning else 0
        return [
            gl.Eq(c.f_x, self.k * c.x + self.d * gl.der(c.x)),
            gl.Eq(c.f_y, self.k * c.y + self.d * gl.der(c.y)),
            gl.Eq(c.tau, torque),
        ]

    def energies(self) -> gl.Energy:
        c = self.centre
        stored = self.k * (c.x**2 + c.y**2) / 2
        heat = self.d * (gl.der(c.x) ** 2 + gl.der(c.y) ** 2)
        if self.turning:
            stored, heat = stored + self.k_phi * c.phi**2 / 2, heat + self.d_phi * gl.der(c.phi) ** 2
        return gl.Energy(stored=stored, heat=heat)


class PlanarMesh(gl.Component):
    """Mesh of two bodies: a spring and a damper along the line of action.

    ``der(q) = (v_y_a - v_y_b) cos(theta) - (v_x_a - v_x_b) sin(theta) + r_a w_a + r_b w_b + e_rate``; ``r_b`` is negative for a gear
    inside a ring. The deflection follows from the displacements, so that it is a state only if needed.
    """

    gear_a = PlanarFlange("gear a")
    gear_b = PlanarFlange("gear b")
    r_a = gl.Parameter("m", "base radius of gear a", min=0)
    r_b = gl.Parameter("m", "base radius of gear b, negative where it turns in the same sense")
    theta = gl.Parameter("rad", "direction of the normal of the line of action")
    c = gl.Parameter("N/m", "mesh stiffness", min=0)
    d = gl.Parameter("N.s/m", "mesh damping", default=0.0, min=0)
    e = gl.Input("m", "transmission error; adds to the deflection", default=0.0)
    q = gl.Variable("m", "deflection along the line of action", state="prefer", nominal=1e-6)
    f = gl.Variable("N", "force along the line of action")

    def equations(self) -> list[gl.Eq]:
        a, b = self.gear_a, self.gear_b
        sin, cos = gl.sin(self.theta), gl.cos(self.theta)
        sideways = (a.y - b.y) * cos - (a.x - b.x) * sin
        return [
            gl.Eq(self.q, sideways + self.r_a * a.phi + self.r_b * b.phi + self.e),
            gl.Eq(self.f, self.c * self.q + self.d * gl.der(self.q)),
            gl.Eq(a.f_x, -sin * self.f),
            gl.Eq(a.f_y, cos * self.f),
            gl.Eq(a.tau, self.r_a * self.f),
            gl.Eq(b.f_x, sin * self.f),
            gl.Eq(b.f_y, -cos * self.f),
            gl.Eq(b.tau, self.r_b * self.f),
        ]

    def energies(self) -> gl.Energy:
        """The difference between the power into the flanges and from the bodies is supplied by the transmission error."""
        a, b, rate = self.gear_a, self.gear_b, gl.der(self.q)
        sin, cos = gl.sin(self.theta), gl.cos(self.theta)
        sideways = (gl.der(a.y) - gl.der(b.y)) * cos - (gl.der(a.x) - gl.der(b.x)) * sin
        brought = sideways + self.r_a * gl.der(a.phi) + self.r_b * gl.der(b.phi)
        return gl.Energy(stored=self.c * self.q**2 / 2, heat=self.d * rate**2, supplied=self.f * (rate - brought))


class PlanetBearing(gl.Component):
    """Bearing of a planet on the carrier, at radius ``r`` and angle ``psi``: a spring and a damper in both directions.

    A pin that is ahead of its nominal position by ``e`` adds to the tangential deflection.
    """

    carrier = PlanarFlange("centre of the carrier")
    planet = PlanarFlange("centre of the planet")
    r = gl.Parameter("m", "radius of the planets' centres", min=0)
    psi = gl.Parameter("rad", "angle of the planet on the carrier")
    k = gl.Parameter("N/m", "radial stiffness", min=0)
    d = gl.Parameter("N.s/m", "radial damping", default=0.0, min=0)
    e = gl.Parameter("m", "tangential error of the pin's position", default=0.0)
    q_radial = gl.Variable("m", "radial deflection", state="prefer", nominal=1e-6)
    q_tangential = gl.Variable("m", "tangential deflection", state="prefer", nominal=1e-6)
    f_radial = gl.Variable("N", "radial force on the carrier")
    f_tangential = gl.Variable("N", "tangential force on the carrier")

    def equations(self) -> list[gl.Eq]:
        c, p = self.carrier, self.planet
        sin, cos = gl.sin(self.psi), gl.cos(self.psi)
        f_x = self.f_radial * cos - self.f_tangential * sin
        f_y = self.f_radial * sin + self.f_tangential * cos
        return [
            gl.Eq(self.q_radial, (c.x - p.x) * cos + (c.y - p.y) * sin),
            gl.Eq(self.q_tangential, (c.y - p.y) * cos - (c.x - p.x) * sin + self.r * c.phi + self.e),
            gl.Eq(self.f_radial, self.k * self.q_radial + self.d * gl.der(self.q_radial)),
            gl.Eq(self.f_tangential, self.k * self.q_tangential + self.d * gl.der(self.q_tangential)),
            gl.Eq(c.f_x, f_x),
            gl.Eq(c.f_y, f_y),
            gl.Eq(c.tau, self.r * self.f_tangential),
            gl.Eq(p.f_x, -f_x),
            gl.Eq(p.f_y, -f_y),
            gl.Eq(p.tau, 0),
        ]

    def energies(self) -> gl.Energy:
        square = self.q_radial**2 + self.q_tangential**2
        speed = gl.der(self.q_radial) ** 2 + gl.der(self.q_tangential) ** 2
        return gl.Energy(stored=self.k * square / 2, heat=self.d * speed)


class PlanarPlanetaryUnit(gl.Component):
    """Planetary gear with bodies that move in the plane, on elastic bearings.

    A floating sun has no bearing: ``k_s = 0``. Three planets then share the load equally despite pin position errors.

    Moments of inertia are those of the bodies (``I/r^2`` of the literature times the square of the base radius; the carrier's radius is
    that of the planet centres). The support stiffness ``k_u`` of the literature, in N/m, corresponds to a torsional stiffness ``k_u
    r^2`` here.
    """

    icon = "planetary"
    radii = ("r_s", "r_r")

    sun = Flange("sun shaft")
    carrier = Flange("carrier shaft")
    ring = Flange("ring shaft")
    planets = gl.Structural(4, "number of planets", min=1, max=MOST_PLANETS)
    positions = gl.Structural((), "angles of the planets on the carrier, rad; equally spaced without")
    pin_errors = gl.Structural((), "by how much each planet's pin is ahead of its place on the carrier, m; none without")
    ring_held = gl.Structural(False, "whether the ring has a torsional support")

    r_s = gl.Parameter("m", "base radius of the sun", min=0)
    r_r = gl.Parameter("m", "base radius of the ring", min=0)
    r_p = gl.Parameter("m", "base radius of a planet", min=0)
    r_c = gl.Parameter("m", "radius of the planets' centres", min=0)
    m_s = gl.Parameter("kg", "mass of the sun", min=0)
    m_r = gl.Parameter("kg", "mass of the ring", min=0)
    m_c = gl.Parameter("kg", "mass of the carrier", min=0)
    m_p = gl.Parameter("kg", "mass of a planet", min=0)
    I_s = gl.Parameter("kg.m2", "moment of inertia of the sun", min=0)
    I_r = gl.Parameter("kg.m2", "moment of inertia of the ring", min=0)
    I_c = gl.Parameter("kg.m2", "moment of inertia of the carrier without planets", min=0)
    I_p = gl.Parameter("kg.m2", "moment of inertia of a planet", min=0)
    k_sp = gl.Parameter("N/m", "stiffness of a mesh at the sun", min=0)
    k_rp = gl.Parameter("N/m", "stiffness of a mesh at the ring", min=0)
    d_sp = gl.Parameter("N.s/m", "damping of a mesh at the sun", default=0.0, min=0)
    d_rp = gl.Parameter("N.s/m", "damping of a mesh at the ring", default=0.0, min=0)
    k_s = gl.Parameter("N/m", "bearing stiffness of the sun", min=0)
    k_r = gl.Parameter("N/m", "bearing stiffness of the ring", min=0)
    k_c = gl.Parameter("N/m", "bearing stiffness of the carrier", min=0)
    k_p = gl.Parameter("N/m", "bearing stiffness of a planet", min=0)
    k_ring_phi = gl.Parameter("N.m/rad", "torsional stiffness of the ring's support, with ring_held", default=0.0, min=0)
    alpha = gl.Parameter("rad", "pressure angle", min=0, max=1.5)
    e_sun = gl.Input("m", "transmission error of the meshes at the sun", default=0.0)
    e_ring = gl.Input("m", "transmission error of the meshes at the ring", default=0.0)

    def assemble(self) -> list[Connection]:
        self.sun_gear = PlanarBody(m=self.m_s, J=self.I_s)
        self.ring_gear = PlanarBody(m=self.m_r, J=self.I_r)
        self.carrier_body = PlanarBody(m=self.m_c, J=self.I_c)
        self.planet = [PlanarBody(m=self.m_p, J=self.I_p) for _ in range(self.planets)]
        self.sun_bearing, self.carrier_bearing = PlanarSupport(k=self.k_s), PlanarSupport(k=self.k_c)
        self.ring_bearing = PlanarSupport(k=self.k_r, k_phi=self.k_ring_phi, turning=self.ring_held)
        self.sun_shaft, self.ring_shaft, self.carrier_shaft = PlanarShaft(), PlanarShaft(), PlanarShaft()
        psi = list(check_angles("PlanarPlanetaryUnit", self.planets, self.positions))
        psi = psi or [2 * gl.pi * n / self.planets for n in range(self.planets)]
        errors = self.pin_errors or [0.0] * self.planets
        if len(errors) != self.planets:
            raise BindingError(f"PlanarPlanetaryUnit: {len(errors)} pin_errors for {self.planets} planets")
        self.sun_mesh = [self._mesh(self.r_s, self.r_p, p - self.alpha, self.k_sp, self.d_sp, self.e_sun) for p in psi]
        self.ring_mesh = [self._mesh(self.r_r, -self.r_p, p + self.alpha, self.k_rp, self.d_rp, self.e_ring) for p in psi]
        self.planet_bearing = [PlanetBearing(r=self.r_c, psi=p, k=self.k_p, e=e) for p, e in zip(psi, errors, strict=True)]
        bearings, sun, ring = self.planet_bearing, self.sun_mesh, self.ring_mesh
        links = [
            gl.connect(self.sun, self.sun_shaft.flange),
            gl.connect(self.ring, self.ring_shaft.flange),
            gl.connect(self.carrier, self.carrier_shaft.flange),
            gl.connect(self.sun_gear.centre, self.sun_bearing.centre, self.sun_shaft.centre, *(m.gear_a for m in sun)),
            gl.connect(self.ring_gear.centre, self.ring_bearing.centre, self.ring_shaft.centre, *(m.gear_a for m in ring)),
            gl.connect(
                self.carrier_body.centre, self.carrier_bearing.centre, self.carrier_shaft.centre, *(b.carrier for b in bearings)
            ),
        ]
        meshing = zip(self.planet, sun, ring, bearings, strict=True)
        return [*links, *(gl.connect(p.centre, s.gear_b, r.gear_b, b.planet) for p, s, r, b in meshing)]

    def _mesh(self, r_a: Any, r_b: Any, theta: Any, c: Any, d: Any, e: Any) -> PlanarMesh:
        return PlanarMesh(r_a=r_a, r_b=r_b, theta=theta, c=c, d=d, e=e)
