"""Which part of the P unit, of the XP train and of the paper's system has which value, and how each mesh is excited."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.flatten import flatten
from gearlib.language.expressions import value_of
from tests.gearparts.test_declared_numbers import parameters

PAIR = {"R_1": 0.3, "R_2": 0.6, "I_1": 2.0, "I_2": 3.0, "K_g": 4.0, "C_g": 5.0}
TEETH = {"Z_s": 19, "Z_p": 31, "Z_r": 81}
RADII = {"R_s": 0.19, "R_p": 0.31, "R_r": 0.81, "R_h": 0.5}
SYMBOLS = RADII | {
    name: 0.5 + 0.1 * k
    for k, name in enumerate((
        "I_s", "I_r", "I_h", "K_g", "C_g", "C_v", "R_1", "R_2", "I_1", "I_2", "I_62", "I_66", "I_11", "I_35", "I_17", "I_22",
        "m_18", "m_19", "m_22",
    ))
}  # fmt: skip


def some(found: dict[str, float], expected: dict[str, float], path: str = "") -> bool:
    return {name: found.get(path + name) for name in expected} == pytest.approx(expected, rel=1e-14)


def test_a_pair_on_fixed_axes_has_two_bodies_and_a_mesh() -> None:
    expected = {"gear_1.J": 2.0, "gear_2.J": 3.0, "mesh.r_a": 0.3, "mesh.r_b": 0.6, "mesh.c": 4.0, "mesh.d": 5.0}
    for more, kind in (
        ({}, gp.ExternalMesh),
        ({"Z_1": 20}, gp.ExternalMesh),
        ({"details": (("b", 1e-4),)}, gp.DetailedExternalMesh),
    ):
        assert type(gp.FixedAxisUnit(**PAIR, **more).mesh) is kind
    assert some(parameters(gp.FixedAxisUnit(**PAIR)), expected)
    varying = (("stiffness", "sinusoidal"), ("c_amplitude", 0.1))
    for more, z_a in (({}, 1.0), ({"Z_1": 20}, 20.0), ({"Z_1": 20, "details": (*varying, ("z_a", 25.0))}, 25.0)):
        found = parameters(gp.FixedAxisUnit(**PAIR, **{"details": varying} | more))
        assert some(found, expected | {"mesh.z_a": z_a, "mesh.c_amplitude": 0.1})


def shafts(elastic: bool, s: dict[str, float]) -> dict[str, float]:
    """The sun's speed over the shaft's is 1 / m_18, the shaft's over gear 1's 1 / m_19; gear 2 turns against the carrier, m_22 as fast."""
    bodies = {"shaft_at_sun.J": s["I_62"], "shaft_at_pair.J": s["I_66"]} | ({"shaft.c": 7.0} if elastic else {})
    pair = {"gear_1.J": s["I_1"], "gear_2.J": s["I_2"], "mesh.r_a": s["R_1"], "mesh.r_b": s["R_2"], "mesh.c": s["K_g"]}
    pair |= {"mesh.d": s["C_g"]}
    ratios = {"step_18.ratio": 1 / s["m_18"], "step_19.ratio": 1 / s["m_19"], "coupling.ratio": -s["m_22"]}
    return bodies | ratios | {f"p_unit.{name}": x for name, x in pair.items()}


@pytest.mark.parametrize("elastic", [False, True])
def test_each_symbol_of_the_lumped_train_is_a_value_of_its_part(elastic: bool) -> None:
    s = SYMBOLS
    found = parameters(gp.XPTrain(planets=2, elastic_shafts=elastic, **s, **({"K_s": 7.0} if elastic else {})))
    assert some(found, shafts(elastic, s))
    assert ("shaft.c" in found) == elastic
    unit = {"sun_gear.J": s["I_s"], "ring_gear.J": s["I_r"], "carrier_body.J": s["I_h"], "planets_at_ring.J": s["I_11"]}
    unit |= {"planets_at_sun.J": s["I_35"]}
    for n in range(2):
        unit |= {f"planet[{n}].spin.J": s["I_17"], f"planet[{n}].orbit.J": s["I_22"], f"support[{n}].d": s["C_v"] * 0.31**2}
        unit |= {f"planet[{n}].kinematics.r_p": 0.31, f"planet[{n}].kinematics.r_h": 0.5}
    for mesh, radius in (("ring_mesh", 0.81), ("sun_mesh", 0.19)):
        unit |= {f"{mesh}.r_a": radius, f"{mesh}.r_b": 0.31, f"{mesh}.c": s["K_g"], f"{mesh}.d": s["C_g"]}
    assert some(found, unit, "x_unit.")


def test_planets_of_a_train_stand_where_the_teeth_let_them_unless_positions_are_given() -> None:
    where = gp.planet_positions(19, 81, 3)
    for given, expected in (({}, ()), (TEETH, where), (TEETH | {"positions": where[::-1]}, where[::-1])):
        unit = gp.XPTrain(planet_meshes="separate", **given).x_unit
        assert unit.positions == expected
        assert (unit.Z_s, unit.Z_p, unit.Z_r) == ((19, 31, 81) if given else (0, 0, 0))
    for missing in ("Z_s", "Z_r"):
        assert gp.XPTrain(**TEETH | {missing: 0}).x_unit.positions == ()


def test_the_pair_s_first_gear_has_the_teeth_of_the_sun_unless_told_otherwise() -> None:
    assert [gp.XPTrain(**given).p_unit.Z_1 for given in ({}, TEETH, TEETH | {"Z_1": 25})] == [0, 19, 25]


@pytest.mark.parametrize("planet_meshes", ["lumped", "separate"])
def test_the_paper_s_system_is_the_train_with_a_damper_on_the_carrier(planet_meshes: str) -> None:
    given = SYMBOLS if planet_meshes == "lumped" else {n: v for n, v in SYMBOLS.items() if n not in ("I_11", "I_35")}
    system, train = gp.ZhouCui2022(planet_meshes=planet_meshes, **given), gp.XPTrain(planet_meshes=planet_meshes, **{
        n: v for n, v in given.items() if n != "C_v" or planet_meshes == "lumped"
    })  # fmt: skip
    found, alone = parameters(system), parameters(train)
    assert found["load.d"] == pytest.approx(SYMBOLS["C_v"] * 0.25, rel=1e-15)
    parts = {name: value for name, value in alone.items() if "." in name and not name.endswith("C_v")}
    assert some(found, parts, "train.")
    assert type(system.train.x_unit) is type(train.x_unit)


def test_the_table_s_stiffness_of_the_shaft_counts_with_elastic_shafts_only() -> None:
    flatten(gp.ZhouCui2022(K_s=2.0e8))  # as in Table 4
    for given in ({"K_s": 3e8}, {"K_s": 2.0e8 * (1 + 1e-9)}):
        with pytest.raises(BindingError, match=r"K_s=.* has no effect with elastic_shafts=False"):
            flatten(gp.ZhouCui2022(**given))
    assert parameters(gp.ZhouCui2022(K_s=3e8, elastic_shafts=True))["train.shaft.c"] == 3e8


class ExcitedTrain(gl.Component):
    """A train at rest, whose meshes have errors of their own."""

    def assemble(self) -> Any:
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        self.train = gp.XPTrain(e_rate_ring=1e-3, e_rate_sun=2e-3, e_rate_pair=3e-3)
        return [gl.connect(self.a.flange_b, self.train.flange_in), gl.connect(self.train.flange_out, self.b.flange_a)]


def test_the_pair_s_error_opens_its_mesh_and_the_others_close_theirs(probe: Callable[..., Any]) -> None:
    """The paper counts the pair's deflection on the other flank."""
    value = probe(ExcitedTrain()).values({})
    meshes = ("x_unit.ring_mesh", "x_unit.sun_mesh", "p_unit.mesh")
    assert [value(f"train.{mesh}.v") for mesh in meshes] == pytest.approx([1e-3, 2e-3, -3e-3], rel=1e-12)


def test_the_paper_s_excitation_is_a_cosine() -> None:
    rate = value_of(gp.ZhouCui2022(e_amplitude=0.5, e_omega=3.0, e_phase=0.7).excitation())
    (time,) = rate.free_symbols
    assert float(rate.subs(time, 2.0)) == pytest.approx(0.5 * math.cos(6.7), rel=1e-14)
