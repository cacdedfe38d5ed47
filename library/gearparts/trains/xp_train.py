"""Gear units and the trains composed of them: the XP single-loop train of Zhou and Cui (see `zhou_cui_2022`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gearlib as gl
from gearlib.arguments import is_real
from gearparts.gears.meshes import ExternalMesh
from gearparts.gears.rigid_gears import IdealGear
from gearparts.interfaces import Flange, TwoFlanges
from gearparts.planetary.phasing import MOST_PLANETS, planet_positions
from gearparts.planetary.planetary_unit import PlanetaryUnit
from gearparts.rotational.shafts import Damper, Fixed, Inertia, Spring
from gearparts.rotational.sources import Torque

if TYPE_CHECKING:
    from gearlib.drawing.gears.gear_set import GearSet
    from gearlib.language.component import Connection
    from gearparts.gears.mesh_models import DetailedExternalMesh


class FixedAxisUnit(TwoFlanges):
    """Two external gears on fixed axes with an elastic mesh, one degree of freedom (the P unit).

    If rigid, ``R_1 w_1 = -R_2 w_2``; the mesh deflection ``q`` has the rate ``R_1 w_1 + R_2 w_2 + e_rate``. With ``details`` the mesh
    is a `DetailedExternalMesh` with these choices and values, whose phase counts the teeth of gear 1.
    """

    icon = "mesh"
    radii = ("R_1", "R_2")

    Z_1 = gl.Structural(0, "teeth of gear 1; 0: not known", min=0)
    details = gl.Structural((), "choices and values of a detailed mesh, as pairs")

    R_1 = gl.Parameter("m", "pitch radius of gear 1, on flange_a", min=0)
    R_2 = gl.Parameter("m", "pitch radius of gear 2, on flange_b", min=0)
    I_1 = gl.Parameter("kg.m2", "moment of inertia of gear 1", min=0)
    I_2 = gl.Parameter("kg.m2", "moment of inertia of gear 2", min=0)
    K_g = gl.Parameter("N/m", "mesh stiffness", min=0)
    C_g = gl.Parameter("N.s/m", "mesh damping", min=0)
    e_rate = gl.Input("m/s", "rate of the transmission error", default=0.0)

    def drawn_gears(self) -> GearSet | None:
        """With Z_1, from the pitch radii; gear 2 has the teeth that its radius asks for."""
        from gearparts.gears.drawn_gears import pitched_pair

        return pitched_pair(self, self.Z_1, "mesh.f") if self.Z_1 else None

    def assemble(self) -> list[Connection]:
        self.gear_1, self.gear_2 = Inertia(J=self.I_1), Inertia(J=self.I_2)
        values = {"r_a": self.R_1, "r_b": self.R_2, "c": self.K_g, "d": self.C_g, "e_rate": self.e_rate}
        teeth = {"z_a": self.Z_1} if self.Z_1 else {}
        self.mesh: ExternalMesh | DetailedExternalMesh
        if self.details:
            from gearparts.gears.mesh_models import DetailedExternalMesh, details_of

            self.mesh = DetailedExternalMesh(**values | teeth | details_of(self, "details"))
        else:
            self.mesh = ExternalMesh(**values)
        return [
            gl.connect(self.flange_a, self.gear_1.flange_a),
            gl.connect(self.gear_1.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.gear_2.flange_a),
            gl.connect(self.gear_2.flange_b, self.flange_b),
        ]


class XPSymbols(gl.Component):
    """Base of the XP train's models: parameters with Table 4's symbols and values, and those that the paper leaves open.

    The table does not give the P unit's gears, the shaft's two ends, the planets' inertias as seen by the meshes, and the moduli m18,
    m19 and m22. Their defaults are assumptions: gear 1 equals the sun and gear 2 a planet, each end of the shaft has I_f, all planet
    inertias are I_p, and the moduli are 1. C_v acts along the line of action, as C_g does.
    """

    planets = gl.Structural(3, "number of planets", min=1, max=MOST_PLANETS)
    elastic_shafts = gl.Structural(
        False, "whether the shaft between sun and P unit is a spring K_s; equations (2)-(9) have none"
    )

    Z_s = gl.Structural(0, "teeth of the sun; 0: not known", min=0)
    Z_p = gl.Structural(0, "teeth of a planet; 0: not known", min=0)
    Z_r = gl.Structural(0, "teeth of the ring; 0: not known", min=0)
    Z_1 = gl.Structural(0, "teeth of the P unit's gear 1; 0: those of the sun", min=0)
    positions = gl.Structural(
        (), "angles of the planets, rad; without: where teeth are known, the nearest to equal spacing that fit"
    )
    ring_details = gl.Structural((), "choices and values of detailed meshes at the ring, as pairs")
    sun_details = gl.Structural((), "choices and values of detailed meshes at the sun, as pairs")
    pair_details = gl.Structural((), "choices and values of a detailed mesh in the P unit, as pairs")

    R_s = gl.Parameter("m", "pitch radius of the sun", default=0.0285, min=0)
    R_p = gl.Parameter("m", "pitch radius of a planet", default=0.0465, min=0)
    R_r = gl.Parameter("m", "pitch radius of the ring", default=0.1215, min=0)
    R_h = gl.Parameter("m", "radius of the carrier", default=0.075, min=0)
    I_s = gl.Parameter("kg.m2", "moment of inertia of the sun", default=0.0015, min=0)
    I_p = gl.Parameter("kg.m2", "moment of inertia of a planet", default=0.0094, min=0)
    I_r = gl.Parameter("kg.m2", "moment of inertia of the ring", default=0.1510, min=0)
    I_h = gl.Parameter("kg.m2", "moment of inertia of the carrier", default=0.0491, min=0)
    I_f = gl.Parameter("kg.m2", "moment of inertia of a shaft's end", default=0.0036, min=0)
    K_g = gl.Parameter("N/m", "mesh stiffness", default=1.8e8, min=0)
    C_g = gl.Parameter("N.s/m", "mesh damping", default=2000.0, min=0)
    C_v = gl.Parameter("N.s/m", "support damping of a planet, and damping of the load", default=1800.0, min=0)
    K_s = gl.Parameter(
        "N.m/rad", "stiffness of the shaft, with elastic_shafts; the table has its number in N/m", default=2.0e8, min=0
    )

    R_1 = gl.Parameter("m", "pitch radius of the P unit's gear 1", default=lambda train: train.R_s, min=0)
    R_2 = gl.Parameter("m", "pitch radius of the P unit's gear 2", default=lambda train: train.R_p, min=0)
    I_1 = gl.Parameter("kg.m2", "moment of inertia of gear 1 (bond 69)", default=lambda train: train.I_s, min=0)
    I_2 = gl.Parameter("kg.m2", "moment of inertia of gear 2 (bond 78)", default=lambda train: train.I_p, min=0)
    I_62 = gl.Parameter("kg.m2", "moment of inertia of the shaft's end at the sun", default=lambda train: train.I_f, min=0)
    I_66 = gl.Parameter("kg.m2", "moment of inertia of the shaft's end at the P unit", default=lambda train: train.I_f, min=0)
    I_11 = gl.Parameter("kg.m2", "planets as the ring's mesh sees them", default=lambda train: train.I_p, min=0)
    I_35 = gl.Parameter("kg.m2", "planets as the sun's mesh sees them", default=lambda train: train.I_p, min=0)
    I_17 = gl.Parameter("kg.m2", "spin of a planet (bonds 17, 41, 51)", default=lambda train: train.I_p, min=0)
    I_22 = gl.Parameter("kg.m2", "orbit of a planet (bonds 22, 46, 56)", default=lambda train: train.I_p, min=0)
    m_18 = gl.Parameter("1", "speed of the shaft over speed of the sun", default=1.0)
    m_19 = gl.Parameter("1", "speed of gear 1 over speed of the shaft", default=1.0)
    m_22 = gl.Parameter("1", "speed of gear 2 over speed of the carrier, against each other", default=1.0)

    def symbols(self) -> dict[str, Any]:
        """All of them by name, to be passed to a part with the same parameters."""
        return {n: getattr(self, n) for n, d in vars(XPSymbols).items() if isinstance(d, (gl.Parameter, gl.Structural))}

    def planetary(self, e_rate_ring: Any, e_rate_sun: Any, planet_meshes: str) -> PlanetaryUnit:
        """The X unit."""
        teeth = bool(self.Z_s and self.Z_r)
        positions = self.positions or (planet_positions(self.Z_s, self.Z_r, self.planets) if teeth else ())
        return PlanetaryUnit(
            planets=self.planets, planet_meshes=planet_meshes, R_s=self.R_s, R_p=self.R_p, R_r=self.R_r, R_h=self.R_h,
            I_s=self.I_s, I_r=self.I_r, I_h=self.I_h, I_spin=self.I_17, I_orbit=self.I_22, I_at_ring=self.I_11,
            I_at_sun=self.I_35, K_ring=self.K_g, C_ring=self.C_g, K_sun=self.K_g, C_sun=self.C_g, C_v=self.C_v,
            e_rate_ring=e_rate_ring, e_rate_sun=e_rate_sun, Z_s=self.Z_s, Z_p=self.Z_p, Z_r=self.Z_r, positions=positions,
            ring_details=self.ring_details, sun_details=self.sun_details,
        )  # fmt: skip

    def pair(self, e_rate: Any) -> FixedAxisUnit:
        """The P unit."""
        return FixedAxisUnit(
            R_1=self.R_1, R_2=self.R_2, I_1=self.I_1, I_2=self.I_2, K_g=self.K_g, C_g=self.C_g, e_rate=e_rate,
            Z_1=self.Z_1 or self.Z_s, details=self.pair_details,
        )  # fmt: skip


class XPTrain(XPSymbols):
    """The XP single-loop train: an X unit whose sun drives a P unit that joins the X unit's carrier at the output.

    Ring - mesh - planets - support dampers - mesh - sun - shaft - gear 1 - mesh - gear 2 - coupling - carrier, which moves the planets:
    the loop is closed. The paper counts one degree of freedom. In its equations, and here, the planets are two bodies, one per mesh,
    coupled by the support dampers only; with rigid meshes two speeds are therefore free (`gearlib.mobility` returns 2), and their
    difference decays in the dampers. Without slip in the dampers one is left. With ``planet_meshes="separate"`` each planet has two
    meshes of its own (``K_g`` and ``C_g`` then apply to one) and is mounted rigidly on the carrier, so that rigid meshes leave one
    degree of freedom: ``m_18 m_19 R_1 w_sun = m_22 R_2 w_carrier`` and ``R_r w_ring + R_s w_sun = 2 R_h w_carrier``.
    """

    planet_meshes = gl.Structural("lumped", "one mesh for all planets, or one for each", choices=("lumped", "separate"))
    flange_in = Flange("ring")
    flange_out = Flange("carrier")
    e_rate = gl.Input("m/s", "rate of the transmission error, with the paper's signs (Sf8 = Sf32 = Sf72)", default=0.0)
    e_rate_ring = gl.Input("m/s", "the same at the ring alone (Sf8)", default=lambda train: train.e_rate)
    e_rate_sun = gl.Input("m/s", "the same at the sun alone (Sf32)", default=lambda train: train.e_rate)
    e_rate_pair = gl.Input("m/s", "the same in the P unit alone (Sf72)", default=lambda train: train.e_rate)

    def assemble(self) -> list[Connection]:
        self.x_unit = self.planetary(self.e_rate_ring, self.e_rate_sun, self.planet_meshes)
        self.step_18 = IdealGear(ratio=1 / self.m_18)
        self.shaft_at_sun = Inertia(J=self.I_62)
        self.step_19 = IdealGear(ratio=1 / self.m_19)
        self.shaft_at_pair = Inertia(J=self.I_66)
        # The paper counts the pair's deflection on the other flank: f74 = Sf72 - R_1 f69 - R_2 f78.
        self.p_unit = self.pair(-self.e_rate_pair)
        self.coupling = IdealGear(ratio=-self.m_22)
        if self.elastic_shafts:
            self.shaft = Spring(c=self.K_s)
            shaft = [
                gl.connect(self.shaft_at_sun.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.step_19.flange_a),
            ]
        else:
            shaft = [gl.connect(self.shaft_at_sun.flange_b, self.step_19.flange_a)]
        return [
            gl.connect(self.flange_in, self.x_unit.ring),
            gl.connect(self.x_unit.sun, self.step_18.flange_a),
            gl.connect(self.step_18.flange_b, self.shaft_at_sun.flange_a),
            *shaft,
            gl.connect(self.step_19.flange_b, self.shaft_at_pair.flange_a),
            gl.connect(self.shaft_at_pair.flange_b, self.p_unit.flange_a),
            gl.connect(self.p_unit.flange_b, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.x_unit.carrier, self.flange_out),
        ]


class ZhouCui2022(XPSymbols):
    """The paper's complete system: a driving torque on the ring, the XP train, and a damper ``C_v R_h**2`` as load.

    All three meshes are excited by the transmission-error rate ``e_amplitude cos(e_omega t + e_phase)``, or each by its own. The
    symbols of Table 4 are its parameters, including numbers of teeth; its planets are positioned so that these permit assembly, since
    19 and 81 teeth do not allow three equally spaced planets.
    """

    planet_meshes = gl.Structural(
        "lumped", "one mesh for all planets, or one for each (then K_g and C_g hold for one)", choices=("lumped", "separate")
    )
    tau_in = gl.Input("N.m", "driving torque on the ring (Se1)")
    e_rate = gl.Input("m/s", "rate of the transmission error in Table 4", default=lambda train: train.excitation())
    e_rate_ring = gl.Input("m/s", "rate of the ring's transmission error (Sf8)", default=lambda train: train.train.e_rate)
    e_rate_sun = gl.Input("m/s", "rate of the sun's transmission error (Sf32)", default=lambda train: train.train.e_rate)
    e_rate_pair = gl.Input("m/s", "rate of the P unit's transmission error (Sf72)", default=lambda train: train.train.e_rate)
    e_amplitude = gl.Parameter("m/s", "amplitude of the transmission error's rate", default=0.0027)
    e_omega = gl.Parameter("rad/s", "angular frequency of the transmission error", default=28.0)
    e_phase = gl.Parameter("rad", "phase of the transmission error's rate", default=21 * gl.pi)
    w_in = gl.Variable("rad/s", "speed of the ring (f2)")
    w_sun = gl.Variable("rad/s", "speed of the sun (f26)")
    w_out = gl.Variable("rad/s", "speed of the carrier (f81)")
    q_ring = gl.Variable("m", "deflection of the mesh at the ring (q6); the mean over the planets' meshes", nominal=1e-6)
    q_sun = gl.Variable("m", "deflection of the mesh at the sun (q30); the mean over the planets' meshes", nominal=1e-6)
    q_pair = gl.Variable("m", "deflection of the P unit's mesh (q74)", nominal=1e-6)

    def __init__(self, *positional: Any, **values: Any) -> None:
        # Table 4 has K_s, but equations (2)-(9) do not: the table may be given as a whole, another K_s with elastic_shafts only
        table = {n: v for n, v in values.items() if n == "K_s" and is_real(v) and v == XPSymbols.K_s.default}
        super().__init__(*positional, **values | gl.offered(table))

    def excitation(self) -> Any:
        """``e_amplitude cos(e_omega t + e_phase)``."""
        return self.e_amplitude * gl.cos(self.e_omega * gl.time + self.e_phase)

    def assemble(self) -> list[Connection]:
        self.drive = Torque(tau=self.tau_in)
        self.train = XPTrain(
            **self.symbols(), planet_meshes=self.planet_meshes, e_rate=self.e_rate, e_rate_ring=self.e_rate_ring,
            e_rate_sun=self.e_rate_sun, e_rate_pair=self.e_rate_pair,
        )  # fmt: skip
        self.load = Damper(d=self.C_v * self.R_h**2)
        self.ground = Fixed()
        return [
            gl.connect(self.drive.flange, self.train.flange_in),
            gl.connect(self.train.flange_out, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]

    def equations(self) -> list[gl.Eq]:
        unit = self.train.x_unit
        lumped = self.planet_meshes == "lumped"
        at_ring, at_sun = ([unit.ring_mesh], [unit.sun_mesh]) if lumped else (unit.ring_meshes, unit.sun_meshes)
        return [
            gl.Eq(self.w_in, self.train.x_unit.ring_gear.w),
            gl.Eq(self.w_sun, self.train.x_unit.sun_gear.w),
            gl.Eq(self.w_out, self.train.x_unit.carrier_body.w),
            gl.Eq(self.q_ring, sum(mesh.q for mesh in at_ring) / len(at_ring)),
            gl.Eq(self.q_sun, sum(mesh.q for mesh in at_sun) / len(at_sun)),
            gl.Eq(self.q_pair, -self.train.p_unit.mesh.q),
        ]
