"""Single-loop trains besides the XP train: PX, with a power split at the input, and XX, with two planetary units.

A P unit (gears on fixed axes) has two shafts and one degree of freedom, an X unit (planetary differential) three shafts and two. A loop
of one of each leaves one degree of freedom, a loop of two X units leaves two, one of which is held.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import gearlib as gl
from gearparts.gears.rigid_gears import IdealGear
from gearparts.interfaces import Flange
from gearparts.planetary.phasing import MOST_PLANETS
from gearparts.planetary.planetary_unit import PlanetaryUnit
from gearparts.rotational.shafts import Fixed, Inertia, Spring
from gearparts.trains.xp_train import XPSymbols

if TYPE_CHECKING:
    from gearlib.language.component import Connection


class PXTrain(XPSymbols):
    """The PX single-loop train: the input drives the sun and, through a P unit, the ring; the carrier sums both (input split).

    Shaft - sun - meshes - planets - carrier, and shaft - gear 1 - mesh - gear 2 - coupling - ring - meshes - planets: the loop of
    `XPTrain` with the P unit between sun and ring. With rigid meshes and the shaft speed ``w``, ``w_sun = w / m_18``, ``w_ring = m_19
    R_1 / (R_2 m_22) w`` and ``2 R_h w_carrier = R_s w_sun + R_r w_ring``.

    The symbols are those of `XPTrain`; ``m_22`` is the speed of gear 2 over that of the ring, in opposite directions.
    """

    planet_meshes = gl.Structural(
        "separate", "one mesh for all planets, or one for each (then K_g and C_g hold for one)", choices=("lumped", "separate")
    )
    flange_in = Flange("shaft of sun and gear 1")
    flange_out = Flange("carrier")
    e_rate = gl.Input("m/s", "rate of the transmission error, the same in all meshes", default=0.0)

    def assemble(self) -> list[Connection]:
        self.x_unit = self.planetary(self.e_rate, self.e_rate, self.planet_meshes)
        self.p_unit = self.pair(self.e_rate)
        self.shaft_at_sun, self.shaft_at_pair = Inertia(J=self.I_62), Inertia(J=self.I_66)
        self.step_18, self.step_19 = IdealGear(ratio=self.m_18), IdealGear(ratio=1 / self.m_19)
        self.coupling = IdealGear(ratio=-self.m_22)
        links = [
            gl.connect(self.flange_in, self.shaft_at_sun.flange_a),
            gl.connect(self.step_18.flange_b, self.x_unit.sun),
            gl.connect(self.step_19.flange_b, self.shaft_at_pair.flange_a),
            gl.connect(self.shaft_at_pair.flange_b, self.p_unit.flange_a),
            gl.connect(self.p_unit.flange_b, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.x_unit.ring),
            gl.connect(self.x_unit.carrier, self.flange_out),
        ]
        if not self.elastic_shafts:
            return [*links, gl.connect(self.shaft_at_sun.flange_b, self.step_18.flange_a, self.step_19.flange_a)]
        self.shaft = Spring(c=self.K_s)
        return [
            *links,
            gl.connect(self.shaft_at_sun.flange_b, self.step_18.flange_a, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.step_19.flange_a),
        ]


class XXTrain(gl.Component):
    """The XX single-loop train: two planetary units with a common sun shaft; the first carrier drives the second ring.

    The second carrier is the output. The first ring is held by the housing or, with ``ring_free``, is a third shaft. With rigid meshes,
    ``k = R_r / R_s`` of each unit and the first ring held, ``w_carrier1 = w_sun / (1 + k_1)`` and ``w_carrier2 = (w_sun + k_2
    w_carrier1) / (1 + k_2)``. Bodies and meshes are those of `PlanetaryUnit`; the defaults are those of `XPTrain`.
    """

    planets = gl.Structural(3, "number of planets of each unit", min=1, max=MOST_PLANETS)
    planet_meshes = gl.Structural("separate", "one mesh for all planets, or one for each", choices=("lumped", "separate"))
    ring_free = gl.Structural(False, "whether the first ring is a shaft; otherwise it is held")
    flange_in = Flange("shaft of both suns")
    flange_out = Flange("second carrier")
    flange_ring = Flange("first ring", when="ring_free")

    R_s1 = gl.Parameter("m", "pitch radius of the first sun", default=0.0285, min=0)
    R_p1 = gl.Parameter("m", "pitch radius of a planet of the first unit", default=0.0465, min=0)
    I_s1 = gl.Parameter("kg.m2", "moment of inertia of the first sun", default=0.0015, min=0)
    I_p1 = gl.Parameter(
        "kg.m2", "moment of inertia of a planet of the first unit, of its spin and of its orbit", default=0.0094, min=0
    )
    I_r1 = gl.Parameter("kg.m2", "moment of inertia of the first ring", default=0.1510, min=0)
    I_h1 = gl.Parameter("kg.m2", "moment of inertia of the first carrier", default=0.0491, min=0)
    R_s2 = gl.Parameter("m", "pitch radius of the second sun", default=lambda train: train.R_s1, min=0)
    R_p2 = gl.Parameter("m", "pitch radius of a planet of the second unit", default=lambda train: train.R_p1, min=0)
    I_s2 = gl.Parameter("kg.m2", "moment of inertia of the second sun", default=lambda train: train.I_s1, min=0)
    I_p2 = gl.Parameter("kg.m2", "moment of inertia of a planet of the second unit", default=lambda train: train.I_p1, min=0)
    I_r2 = gl.Parameter("kg.m2", "moment of inertia of the second ring", default=lambda train: train.I_r1, min=0)
    I_h2 = gl.Parameter("kg.m2", "moment of inertia of the second carrier", default=lambda train: train.I_h1, min=0)
    K_g = gl.Parameter("N/m", "mesh stiffness", default=1.8e8, min=0)
    C_g = gl.Parameter("N.s/m", "mesh damping", default=2000.0, min=0)
    C_v = gl.Parameter("N.s/m", "lumped: support damping of a planet", default=1800.0, min=0)
    e_rate = gl.Input("m/s", "rate of the transmission error, the same in all meshes", default=0.0)

    def assemble(self) -> list[Connection]:
        common = {
            "planets": self.planets, "planet_meshes": self.planet_meshes, "K_ring": self.K_g, "C_ring": self.C_g,
            "K_sun": self.K_g, "C_sun": self.C_g, "C_v": self.C_v, "e_rate": self.e_rate,
        }  # fmt: skip
        self.first = PlanetaryUnit(
            R_s=self.R_s1, R_p=self.R_p1, I_s=self.I_s1, I_r=self.I_r1, I_h=self.I_h1, I_spin=self.I_p1, I_orbit=self.I_p1,
            **common,
        )  # fmt: skip
        self.second = PlanetaryUnit(
            R_s=self.R_s2, R_p=self.R_p2, I_s=self.I_s2, I_r=self.I_r2, I_h=self.I_h2, I_spin=self.I_p2, I_orbit=self.I_p2,
            **common,
        )  # fmt: skip
        links = [
            gl.connect(self.flange_in, self.first.sun, self.second.sun),
            gl.connect(self.first.carrier, self.second.ring),
            gl.connect(self.second.carrier, self.flange_out),
        ]
        if self.ring_free:
            return [*links, gl.connect(self.flange_ring, self.first.ring)]
        self.housing = Fixed()
        return [*links, gl.connect(self.housing.flange, self.first.ring)]
