"""Planetary sets with elastic meshes, composed of bodies, meshes and the kinematics of planets on a carrier."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import gearlib as gl
from gearlib.arguments import shown
from gearlib.errors import BindingError
from gearlib.language.declarations import Offered
from gearlib.language.interior import number_of, path_of, radii_of
from gearparts.gears.meshes import ExternalMesh, InternalMesh
from gearparts.gears.rigid_gears import IdealGear, IdealPlanetary
from gearparts.interfaces import Flange
from gearparts.planetary.phasing import MOST_PLANETS, check_angles, check_assembly, from_first
from gearparts.rotational.shafts import Damper, Inertia
from gearparts.tables import IDEAL_MESH, NO_FRICTION

if TYPE_CHECKING:
    from gearlib.drawing.gears.gear_set import GearSet
    from gearlib.language.component import Connection
    from gearparts.gears.mesh_models import DetailedExternalMesh, DetailedInternalMesh
    from gearparts.planetary.lossy_planetary import LossyPlanetary


class PlanetOnCarrier(gl.Component):
    """Kinematics of one planet whose bearing is mounted on the carrier, without inertia or losses.

    With ``w`` the planet's absolute speed, its pitch line moves with ``r_p w + r_h w_carrier`` on the ring's side, and with ``r_p w -
    r_h w_carrier`` on the sun's side. ``ring_side`` and ``sun_side`` rotate as a planet with fixed centre would have to for the same
    motion of its pitch line, so that a mesh made for fixed centres can be connected to them::

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

    ``I_spin der(w) = `` torques of both sides, with `PlanetOnCarrier` between them and the carrier; the orbit adds ``I_orbit`` to the
    carrier.
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
    """Planetary differential with two degrees of freedom (the X unit), in several levels of detail, one class each.

    ``PlanetaryUnit(level=..., planet_meshes=...)`` makes one of them; bodies and radii are common to all.

    =============  =================  ==========================
    ``level``      ``planet_meshes``  class
    =============  =================  ==========================
    ``"ideal"``                       `IdealPlanetaryUnit`
    ``"lossy"``                       `LossyPlanetaryUnit`
    ``"elastic"``  ``"lumped"``       `LumpedPlanetaryUnit`
    ``"elastic"``  ``"separate"``     `TorsionalPlanetaryUnit`
    ``"planar"``                      `TranslationalPlanetaryUnit`
    =============  =================  ==========================

    Without deflection, and without slip in the support dampers of ``"lumped"`` (a third degree of freedom), all satisfy Willis'
    equation ``R_r w_ring + R_s w_sun = 2 R_h w_carrier`` with ``R_r = R_s + 2 R_p``. Numbers of teeth, if given, must permit assembly
    of the planets at their ``positions``.

    References
    ----------
    X. Zhou, Y. Cui, Journal of Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290

    J. Lin, R. G. Parker, Journal of Vibration and Acoustics 121 (1999) 316-321. https://doi.org/10.1115/1.2893982
    """

    icon = "planetary"
    radii = ("R_s", "R_r")

    level: ClassVar[str]
    planet_meshes: ClassVar[str] = "lumped"

    sun = Flange("sun shaft")
    carrier = Flange("carrier shaft")
    ring = Flange("ring shaft")
    planets = gl.Structural(3, "number of planets", min=1, max=MOST_PLANETS)
    Z_s = gl.Structural(0, "teeth of the sun; 0: not known", min=0)
    Z_p = gl.Structural(0, "teeth of a planet; 0: not known", min=0)
    Z_r = gl.Structural(0, "teeth of the ring; 0: not known", min=0)
    positions = gl.Structural((), "angles of the planets on the carrier, rad (see `planet_positions`); equally spaced without")

    R_s = gl.Parameter("m", "pitch radius of the sun", min=0)
    R_p = gl.Parameter("m", "pitch radius of a planet", min=0)
    R_r = gl.Parameter("m", "pitch radius of the ring", default=lambda unit: unit.R_s + 2 * unit.R_p, min=0)
    R_h = gl.Parameter("m", "radius of the planets' centres on the carrier", default=lambda unit: unit.R_s + unit.R_p, min=0)
    I_s = gl.Parameter("kg.m2", "moment of inertia of the sun", min=0)
    I_r = gl.Parameter("kg.m2", "moment of inertia of the ring", min=0)
    I_h = gl.Parameter("kg.m2", "moment of inertia of the carrier without planets", min=0)
    I_spin = gl.Parameter("kg.m2", "moment of inertia of one planet about its own axis", min=0)
    I_orbit = gl.Parameter("kg.m2", "moment of inertia of one planet's centre about the carrier's axis", min=0)

    def __new__(cls, *_: Any, level: str = "elastic", planet_meshes: str = "lumped", **__: Any) -> PlanetaryUnit:
        if cls is not PlanetaryUnit:
            return object.__new__(cls)
        for name, value in (("level", level), ("planet_meshes", planet_meshes)):
            valid = CHOICES[name]
            if value not in valid:
                choices = ", ".join(map(repr, valid))
                raise BindingError(f"PlanetaryUnit: structural choice '{name}' is {shown(value)}; valid choices: {choices}")
        return object.__new__(model_of(level, planet_meshes))

    def __init__(self, *positional: Any, level: str | None = None, planet_meshes: str | None = None, **values: Any) -> None:
        # values of other models are refused once the unit's path is known
        others = {n: v for n, v in values.items() if n not in self._bindable and any(n in m._bindable for m in MODELS)}
        super().__init__(*positional, **{n: v for n, v in values.items() if n not in others})
        chosen = {"level": level, "planet_meshes": planet_meshes}
        others |= {n: v for n, v in chosen.items() if v is not None and v != getattr(self, n)}
        if without_effect := tuple((n, v) for n, v in others.items() if _is_own(v)):
            self.without_effect = without_effect

    def refuse_what_has_no_effect(self) -> None:
        """Raise `BindingError` for a value that only another model of the unit uses."""
        for name, value in self.__dict__.get("without_effect", ()):
            models = [m for m in MODELS if name in m._bindable or (name in CHOICES and getattr(m, name) == value)]
            described: Any = models[0]._declarations.get(name)
            meaning = f" ({described.description})" if described else ""
            levels = [f"level={m.level!r}" for m in models]
            advice = levels if name in CHOICES else self._other_choices(models)
            path = f"{path_of(self)} (PlanetaryUnit)" if path_of(self) else "PlanetaryUnit"
            raise BindingError(
                f"{path}: {name}={shown(value)} has no effect with level={self.level!r}, planet_meshes={self.planet_meshes!r}{meaning}; "
                f"it counts with {' or '.join(advice)}"
            )

    def _other_choices(self, models: list[type[PlanetaryUnit]]) -> list[str]:
        """The choices that select one of ``models``: one changed, or both where needed."""
        single = [f"level={m.level!r}" for m in models if m.level != self.level and m is model_of(m.level, self.planet_meshes)]
        single += [f"planet_meshes={m.planet_meshes!r}" for m in models if m.level == self.level]
        return single or [f"level={m.level!r} and planet_meshes={m.planet_meshes!r}" for m in models]

    def check(self) -> None:
        """Refuse values without effect, and planets that cannot be assembled between sun and ring."""
        self.refuse_what_has_no_effect()
        if self.Z_s or self.Z_p or self.Z_r:
            check_assembly("PlanetaryUnit", self.Z_s, self.Z_p, self.Z_r, self.planets, self.positions or None)
            self.check_radii()

    def check_radii(self) -> None:
        """Refuse radii of sun, ring and carrier that contradict their teeth, to half a tooth of the ring.

        The radii determine the speeds, the teeth the mesh phases: both meshes of a planet must have one frequency. The planet's own
        radius is not compared, since its working pitch circles at sun and ring differ with profile shift.
        """
        R_s, R_r = radii_of(self)
        if R_s > 0 and abs(self.Z_s * R_r / R_s - self.Z_r) > 0.5:
            raise BindingError(
                f"{path_of(self) or type(self).__name__}: R_r / R_s = {R_r:g} / {R_s:g} = {R_r / R_s:.6g}, but Z_r / Z_s = {self.Z_r} / "
                f"{self.Z_s} = {self.Z_r / self.Z_s:.6g}; expected R_r = {R_s * self.Z_r / self.Z_s:.6g} m (by default R_s + 2 R_p)"
            )
        R_h, both = number_of(self, "R_h"), 1 + self.Z_r / self.Z_s
        if R_s > 0 and R_h is not None and abs(2 * R_h / R_s - both) * self.Z_s > 0.5:
            raise BindingError(
                f"{path_of(self) or type(self).__name__}: 2 R_h / R_s = 2 * {R_h:g} / {R_s:g} = {2 * R_h / R_s:.6g}, but 1 + Z_r / Z_s = "
                f"{both:.6g}, the ratio of sun and carrier; expected R_h = {R_s * both / 2:.6g} m (by default R_s + R_p)"
            )

    def drawn_gears(self) -> GearSet | None:
        """With numbers of teeth, from the sun's pitch radius."""
        R_s = radii_of(self)[0]
        if not (self.Z_s and self.Z_p and self.Z_r and R_s > 0):
            return None
        self.check()
        distance = R_s * (self.Z_s + self.Z_p) / self.Z_s
        at_sun, at_ring = self.mesh_forces()
        from gearparts.gears.drawn_gears import planetary_set

        return planetary_set((self.Z_s, self.Z_p, self.Z_r), distance, [float(psi) for psi in self.angles()], at_sun, at_ring)

    def mesh_forces(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Variables of the forces at sun and ring: one for each planet, one for all of them, or none."""
        return (), ()

    def angles(self) -> list[Any]:
        """Angles of the planets on the carrier, rad."""
        check_angles("PlanetaryUnit", self.planets, self.positions)
        return list(self.positions) or [2 * gl.pi * n / self.planets for n in range(self.planets)]


def _is_own(value: Any) -> bool:
    """Whether a value was given to the unit itself: neither optional, nor passed on by the enclosing component."""
    if type(value) is Offered or value is None or callable(value):
        return False
    return not any(symbol.name != "time" for symbol in getattr(value, "free_symbols", ()))


class TurningPlanetaryUnit(PlanetaryUnit):
    """Base of the units whose bodies only rotate: bodies with their shafts."""

    def bodies(self) -> list[Connection]:
        """Sun, ring, carrier and planets, and their shafts."""
        self.check()
        self.ring_gear, self.sun_gear = Inertia(J=self.I_r), Inertia(J=self.I_s)
        self.carrier_body = Inertia(J=self.I_h)
        self.planet = [
            Planet(R_p=self.R_p, R_h=self.R_h, I_spin=self.I_spin, I_orbit=self.I_orbit) for _ in range(self.planets)
        ]
        return [
            gl.connect(self.ring, self.ring_gear.flange_a),
            gl.connect(self.sun, self.sun_gear.flange_a),
            gl.connect(self.carrier, self.carrier_body.flange_a),
            gl.connect(self.carrier_body.flange_b, *(planet.carrier for planet in self.planet)),
        ]

    def rigid(self, rigid_set: IdealPlanetary | LossyPlanetary) -> list[Connection]:
        """The bodies connected by a rigid set, and by a lossless gear that rotates the planets."""
        shafts = self.bodies()
        self.set = rigid_set
        self.rolling = IdealGear(ratio=-self.R_p / self.R_s)
        return [
            *shafts,
            gl.connect(self.sun_gear.flange_b, self.set.sun, self.rolling.flange_a),
            gl.connect(self.rolling.flange_b, *(planet.sun_side for planet in self.planet)),
            gl.connect(self.ring_gear.flange_b, self.set.ring),
            gl.connect(self.carrier_body.flange_b, self.set.carrier),
        ]


class IdealPlanetaryUnit(TurningPlanetaryUnit):
    """Rigid planetary differential: `IdealPlanetary` with the inertias of sun, ring, carrier and planets."""

    level = "ideal"

    def assemble(self) -> list[Connection]:
        return self.rigid(IdealPlanetary(ratio=self.R_r / self.R_s))


class LossyPlanetaryUnit(TurningPlanetaryUnit):
    """Rigid planetary differential with the losses of `LossyPlanetary`, and the inertias of sun, ring, carrier and planets."""

    level = "lossy"

    sun_efficiency = gl.Structural(IDEAL_MESH, "lossy: rows of speed (rad/s), efficiencies with sun and with ring driving")
    ring_efficiency = gl.Structural(IDEAL_MESH, "lossy: rows of speed (rad/s), efficiencies with sun and with ring driving")
    bearing = gl.Structural(NO_FRICTION, "lossy: rows of speed (rad/s) and friction torque at the sun (N.m)")

    def assemble(self) -> list[Connection]:
        from gearparts.planetary.lossy_planetary import LossyPlanetary

        return self.rigid(
            LossyPlanetary(
                ratio=self.R_r / self.R_s, sun_mesh=self.sun_efficiency, ring_mesh=self.ring_efficiency, bearing=self.bearing
            )
        )


class MeshValues(PlanetaryUnit):
    """Base of units with elastic meshes: their stiffness and damping."""

    K_ring = gl.Parameter("N/m", "elastic, planar: stiffness of a mesh at the ring", default=1e8, min=0)
    C_ring = gl.Parameter("N.s/m", "elastic, planar: damping of a mesh at the ring", default=0.0, min=0)
    K_sun = gl.Parameter("N/m", "elastic, planar: stiffness of a mesh at the sun", default=1e8, min=0)
    C_sun = gl.Parameter("N.s/m", "elastic, planar: damping of a mesh at the sun", default=0.0, min=0)


class ElasticPlanetaryUnit(TurningPlanetaryUnit, MeshValues):
    """Base of units with rotating bodies and elastic meshes."""

    level = "elastic"

    sun_details = gl.Structural((), "elastic: choices and values of detailed meshes at the sun, as pairs")
    ring_details = gl.Structural((), "elastic: choices and values of detailed meshes at the ring, as pairs")
    ring_phase = gl.Parameter(
        "rad", "elastic: mesh phase of the ring against the sun", default=lambda unit: gl.pi * ((unit.Z_p - 1) % 2)
    )
    e_rate = gl.Input("m/s", "elastic: rate of the transmission error, the same in all meshes", default=0.0)
    e_rate_ring = gl.Input("m/s", "elastic: the same at the ring alone", default=lambda unit: unit.e_rate)
    e_rate_sun = gl.Input("m/s", "elastic: the same at the sun alone", default=lambda unit: unit.e_rate)

    def internal_mesh(self) -> InternalMesh:
        """Mesh of the ring and a planet."""
        return InternalMesh(r_a=self.R_r, r_b=self.R_p, c=self.K_ring, d=self.C_ring, e_rate=self.e_rate_ring)

    def external_mesh(self) -> ExternalMesh:
        """Mesh of the sun and a planet."""
        return ExternalMesh(r_a=self.R_s, r_b=self.R_p, c=self.K_sun, d=self.C_sun, e_rate=self.e_rate_sun)

    def detailed_meshes(self, angles: list[Any]) -> tuple[list[DetailedExternalMesh], list[DetailedInternalMesh]]:
        """Meshes at sun and ring that ride on the carrier, each with the phase of a planet at one of the ``angles`` from the first."""
        if not self.Z_s:  # nor the others: `check` refuses some of them
            raise BindingError(
                f"{path_of(self) or type(self).__name__}: sun_details and ring_details need the numbers of teeth Z_s, Z_p, Z_r"
            )
        from gearparts.gears.mesh_models import DetailedExternalMesh, DetailedInternalMesh, details_of

        common = {"r_b": self.R_p, "use_support": True}
        sun = {"e_rate": self.e_rate_sun, "r_a": self.R_s, "z_a": self.Z_s, "c": self.K_sun, "d": self.C_sun}
        ring = {"e_rate": self.e_rate_ring, "r_a": self.R_r, "z_a": self.Z_r, "c": self.K_ring, "d": self.C_ring}
        sun, ring = {**common, **sun, **details_of(self, "sun_details")}, {**common, **ring, **details_of(self, "ring_details")}
        at_sun, at_ring = sun.pop("phase0", 0), ring.pop("phase0", 0) + self.ring_phase
        return (
            [DetailedExternalMesh(phase0=at_sun - self.Z_s * psi, **sun) for psi in angles],
            [DetailedInternalMesh(phase0=at_ring - self.Z_r * psi, **ring) for psi in angles],
        )


class LumpedPlanetaryUnit(ElasticPlanetaryUnit):
    """Planetary differential after Zhou and Cui: one elastic mesh at the ring and one at the sun represent those of all planets.

    Each mesh has the stiffness of all planets together, and one body represents the planets as that mesh sees them. The planets' spin
    and orbit follow the body at the ring rigidly; one support damper per planet leads to the body at the sun, which moves
    independently. With ``sun_details`` or ``ring_details`` both meshes are detailed ones, in the phase of the first planet.
    """

    I_at_ring = gl.Parameter("kg.m2", "lumped: planets as the ring's mesh sees them", default=lambda unit: unit.I_spin, min=0)
    I_at_sun = gl.Parameter("kg.m2", "lumped: planets as the sun's mesh sees them", default=lambda unit: unit.I_spin, min=0)
    # No default: nothing else leads torque to the carrier.
    C_v = gl.Parameter("N.s/m", "lumped: damping of one planet's support, which alone leads torque to the carrier", min=0)

    def assemble(self) -> list[Connection]:
        shafts = self.bodies()
        self.planets_at_ring, self.planets_at_sun = Inertia(J=self.I_at_ring), Inertia(J=self.I_at_sun)
        self.support = [Damper(d=self.C_v * self.R_p**2) for _ in self.planet]
        return [
            *shafts,
            *self.meshes(),
            gl.connect(self.ring_gear.flange_b, self.ring_mesh.flange_a),
            gl.connect(self.sun_gear.flange_b, self.sun_mesh.flange_a),
            gl.connect(self.planets_at_ring.flange_b, *(planet.ring_side for planet in self.planet)),
            gl.connect(self.planets_at_sun.flange_b, *(support.flange_a for support in self.support)),
            *(gl.connect(p.sun_side, s.flange_b) for p, s in zip(self.planet, self.support, strict=True)),
        ]

    def mesh_forces(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return ("sun_mesh.f",), ("ring_mesh.f",)

    def meshes(self) -> list[Connection]:
        """Both meshes, and their connections to the planets as each mesh sees them.

        A detailed mesh is mounted on the carrier, relative to which its teeth are counted; `PlanetOnCarrier` transfers the planets to
        that frame.
        """
        self.ring_mesh: Any
        self.sun_mesh: Any
        if not (self.sun_details or self.ring_details):
            self.ring_mesh, self.sun_mesh = self.internal_mesh(), self.external_mesh()
            at_ring, at_sun, riding = self.ring_mesh.flange_b, self.sun_mesh.flange_b, []
        else:
            (self.sun_mesh,), (self.ring_mesh,) = self.detailed_meshes([0.0])
            self.seen_by_ring = PlanetOnCarrier(r_p=self.R_p, r_h=self.R_r - self.R_p)
            self.seen_by_sun = PlanetOnCarrier(r_p=self.R_p, r_h=self.R_s + self.R_p)
            at_ring, at_sun = self.seen_by_ring.ring_side, self.seen_by_sun.sun_side
            riding = [
                gl.connect(self.ring_mesh.flange_b, self.seen_by_ring.planet),
                gl.connect(self.sun_mesh.flange_b, self.seen_by_sun.planet),
                gl.connect(
                    self.carrier_body.flange_b, self.ring_mesh.support, self.sun_mesh.support, self.seen_by_ring.carrier,
                    self.seen_by_sun.carrier,
                ),
            ]  # fmt: skip
        return [*riding, gl.connect(at_ring, self.planets_at_ring.flange_a), gl.connect(at_sun, self.planets_at_sun.flange_a)]


class TorsionalPlanetaryUnit(ElasticPlanetaryUnit):
    """Planetary differential with a ring mesh and a sun mesh for every planet, each mounted rigidly on the carrier.

    ``K_ring, C_ring, K_sun, C_sun`` apply to one mesh. With ``sun_details`` or ``ring_details`` the meshes are detailed ones
    (`DetailedExternalMesh`, `DetailedInternalMesh`) with these choices and values, whose phases follow from the numbers of teeth:
    planet n at ``psi_n`` from the first has the mesh phase ``-Z_s psi_n`` at the sun and ``ring_phase - Z_r psi_n`` at the ring
    (`planet_phasing`).
    With the sun driving, the ring's phase decreases, and its patterns are traversed backwards.
    """

    planet_meshes = "separate"

    def mesh_forces(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return tuple(f"sun_meshes[{n}].f" for n in range(self.planets)), tuple(
            f"ring_meshes[{n}].f" for n in range(self.planets)
        )

    def assemble(self) -> list[Connection]:
        shafts = self.bodies()
        detailed = bool(self.sun_details or self.ring_details)
        self.ring_meshes: list[Any]
        self.sun_meshes: list[Any]
        if detailed:
            self.sun_meshes, self.ring_meshes = self.detailed_meshes(from_first(self.angles()))
        else:
            self.ring_meshes = [self.internal_mesh() for _ in self.planet]
            self.sun_meshes = [self.external_mesh() for _ in self.planet]
        links = [
            *shafts,
            gl.connect(self.ring_gear.flange_b, *(mesh.flange_a for mesh in self.ring_meshes)),
            gl.connect(self.sun_gear.flange_b, *(mesh.flange_a for mesh in self.sun_meshes)),
        ]
        meshing = zip(self.planet, self.ring_meshes, self.sun_meshes, strict=True)
        if detailed:
            links.append(
                gl.connect(self.carrier_body.flange_b, *(mesh.support for mesh in (*self.sun_meshes, *self.ring_meshes)))
            )
            return links + [gl.connect(p.shaft, outer.flange_b, inner.flange_b) for p, outer, inner in meshing]
        for planet, at_ring, at_sun in meshing:
            links += [gl.connect(at_ring.flange_b, planet.ring_side), gl.connect(at_sun.flange_b, planet.sun_side)]
        return links


class TranslationalPlanetaryUnit(MeshValues):
    """Planetary differential with bodies that also move laterally on elastic bearings: `PlanarPlanetaryUnit` from pitch radii.

    ``K_ring, C_ring, K_sun, C_sun`` apply to one mesh. The radii are those at which the mesh forces act, so the planet centres are at
    ``R_h / cos(alpha)``.
    """

    level = "planar"

    alpha = gl.Parameter("rad", "planar: working pressure angle", default=gl.pi / 9, min=0, max=1.5)
    m_s = gl.Parameter("kg", "planar: mass of the sun", default=lambda unit: 2 * unit.I_s / unit.R_s**2, min=0)
    m_r = gl.Parameter("kg", "planar: mass of the ring", default=lambda unit: unit.I_r / unit.R_r**2, min=0)
    m_h = gl.Parameter("kg", "planar: mass of the carrier", default=lambda unit: 2 * unit.I_h / unit.R_h**2, min=0)
    k_s = gl.Parameter("N/m", "planar: bearing stiffness of the sun", default=1e9, min=0)
    k_r = gl.Parameter("N/m", "planar: bearing stiffness of the ring", default=1e9, min=0)
    k_h = gl.Parameter("N/m", "planar: bearing stiffness of the carrier", default=1e9, min=0)
    k_p = gl.Parameter("N/m", "planar: bearing stiffness of a planet", default=1e9, min=0)
    pin_errors = gl.Structural((), "planar: by how much each planet's pin is ahead of its place on the carrier, m")

    def mesh_forces(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return (
            tuple(f"planar.sun_mesh[{n}].f" for n in range(self.planets)),
            tuple(f"planar.ring_mesh[{n}].f" for n in range(self.planets)),
        )

    def assemble(self) -> list[Connection]:
        self.check()
        r_c = self.R_h / gl.cos(self.alpha)
        from gearparts.planetary.planar import PlanarPlanetaryUnit

        self.planar = PlanarPlanetaryUnit(
            planets=self.planets, r_s=self.R_s, r_r=self.R_r, r_p=self.R_p, r_c=r_c, m_s=self.m_s, m_r=self.m_r,
            m_c=self.m_h, m_p=self.I_orbit / r_c**2, I_s=self.I_s, I_r=self.I_r, I_c=self.I_h, I_p=self.I_spin,
            k_sp=self.K_sun, k_rp=self.K_ring, d_sp=self.C_sun, d_rp=self.C_ring, k_s=self.k_s, k_r=self.k_r, k_c=self.k_h,
            k_p=self.k_p, alpha=self.alpha, positions=self.positions, pin_errors=self.pin_errors,
        )  # fmt: skip
        return [gl.connect(getattr(self, shaft), getattr(self.planar, shaft)) for shaft in ("sun", "carrier", "ring")]


MODELS: tuple[type[PlanetaryUnit], ...] = (
    IdealPlanetaryUnit, LossyPlanetaryUnit, LumpedPlanetaryUnit, TorsionalPlanetaryUnit, TranslationalPlanetaryUnit,
)  # fmt: skip
CHOICES = {name: tuple(dict.fromkeys(getattr(model, name) for model in MODELS)) for name in ("level", "planet_meshes")}


def model_of(level: str, planet_meshes: str) -> type[PlanetaryUnit]:
    """The class for a level of detail; ``planet_meshes`` decides where there are two.

    Examples
    --------
    >>> model_of("elastic", "separate").__name__
    'TorsionalPlanetaryUnit'
    """
    models = [model for model in MODELS if model.level == level]
    return next((model for model in models if model.planet_meshes == planet_meshes), models[0])
