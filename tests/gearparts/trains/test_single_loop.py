"""PX and XX trains: which part has which value, and where the transmission error acts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from tests.gearparts.test_declared_numbers import parameters

SYMBOLS = {
    name: 0.5 + 0.1 * k
    for k, name in enumerate((
        "R_s", "R_p", "R_r", "R_h", "I_s", "I_r", "I_h", "K_g", "C_g", "R_1", "R_2", "I_1", "I_2", "I_62", "I_66", "I_17",
        "I_22", "m_18", "m_19", "m_22",
    ))
}  # fmt: skip


@pytest.mark.parametrize("elastic", [False, True])
def test_each_symbol_is_a_value_of_its_part(elastic: bool) -> None:
    """Speeds: the shaft's over the sun's is m_18, gear 1's over the shaft's m_19, gear 2's against the ring's m_22."""
    s = SYMBOLS | ({"K_s": 7.0} if elastic else {})
    found = parameters(gp.PXTrain(planets=2, elastic_shafts=elastic, **s))
    expected = {
        "shaft_at_sun.J": s["I_62"], "shaft_at_pair.J": s["I_66"], "step_18.ratio": s["m_18"], "step_19.ratio": 1 / s["m_19"],
        "coupling.ratio": -s["m_22"], "p_unit.gear_1.J": s["I_1"], "p_unit.gear_2.J": s["I_2"], "p_unit.mesh.r_a": s["R_1"],
        "p_unit.mesh.r_b": s["R_2"], "p_unit.mesh.c": s["K_g"], "p_unit.mesh.d": s["C_g"], "x_unit.sun_gear.J": s["I_s"],
        "x_unit.ring_gear.J": s["I_r"], "x_unit.carrier_body.J": s["I_h"],
    }  # fmt: skip
    for n in range(2):
        planet, at_ring, at_sun = f"x_unit.planet[{n}]", f"x_unit.ring_meshes[{n}]", f"x_unit.sun_meshes[{n}]"
        expected |= {f"{planet}.spin.J": s["I_17"], f"{planet}.orbit.J": s["I_22"]}
        expected |= {f"{planet}.kinematics.r_p": s["R_p"], f"{planet}.kinematics.r_h": s["R_h"]}
        for mesh, radius in ((at_ring, s["R_r"]), (at_sun, s["R_s"])):
            expected |= {f"{mesh}.r_a": radius, f"{mesh}.r_b": s["R_p"], f"{mesh}.c": s["K_g"], f"{mesh}.d": s["C_g"]}
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-15)
    assert [value for name, value in found.items() if name == "shaft.c"] == ([7.0] if elastic else [])
    assert sum(name.startswith("x_unit.planet[") and name.endswith("spin.J") for name in found) == 2


def test_both_units_of_the_xx_train_have_their_own_values() -> None:
    sizes = ("R_s", "R_p", "I_s", "I_p", "I_r", "I_h")
    given = {f"{name}{unit}": unit + 0.1 * k for unit in (1, 2) for k, name in enumerate(sizes)}
    found = parameters(gp.XXTrain(planets=2, K_g=7.0, C_g=8.0, **given))
    for unit, path in ((1, "first"), (2, "second")):
        s = {name: given[f"{name}{unit}"] for name in sizes}
        expected = {"sun_gear.J": s["I_s"], "ring_gear.J": s["I_r"], "carrier_body.J": s["I_h"]}
        for n in range(2):
            expected |= {f"planet[{n}].spin.J": s["I_p"], f"planet[{n}].orbit.J": s["I_p"]}
            for mesh, radius in ((f"ring_meshes[{n}]", s["R_s"] + 2 * s["R_p"]), (f"sun_meshes[{n}]", s["R_s"])):
                expected |= {f"{mesh}.r_a": radius, f"{mesh}.r_b": s["R_p"], f"{mesh}.c": 7.0, f"{mesh}.d": 8.0}
        assert {name: found[f"{path}.{name}"] for name in expected} == pytest.approx(expected, rel=1e-15)


def test_lumped_units_of_the_xx_train_have_support_dampers() -> None:
    """Along the line of action, so with the square of the planets' radius as a damping against turning."""
    found = parameters(gp.XXTrain(planet_meshes="lumped", C_v=9.0, R_p1=0.3, R_p2=0.2))
    assert [found[f"first.support[{n}].d"] for n in range(3)] == pytest.approx([9.0 * 0.09] * 3)
    assert [found[f"second.support[{n}].d"] for n in range(3)] == pytest.approx([9.0 * 0.04] * 3)


class TrainAtRest(gl.Component):
    """A train between bodies, with a transmission error."""

    kind = gl.Structural(gp.PXTrain)

    def assemble(self) -> Any:
        self.a, self.b, self.train = gp.Inertia(J=1.0), gp.Inertia(J=1.0), self.kind(e_rate=3e-3, planets=2)
        return [gl.connect(self.a.flange_b, self.train.flange_in), gl.connect(self.train.flange_out, self.b.flange_a)]


@pytest.mark.parametrize(
    ("kind", "meshes"),
    [
        (gp.PXTrain, [*(f"x_unit.{side}_meshes[{n}]" for side in ("ring", "sun") for n in range(2)), "p_unit.mesh"]),
        (gp.XXTrain, [f"{u}.{side}_meshes[{n}]" for u in ("first", "second") for side in ("ring", "sun") for n in range(2)]),
    ],
)
def test_the_transmission_error_deflects_all_meshes_of_a_train_at_rest(
    probe: Callable[..., Any], kind: Any, meshes: list[str]
) -> None:
    value = probe(TrainAtRest(kind=kind)).values({})
    assert [value(f"train.{mesh}.v") for mesh in meshes] == pytest.approx([3e-3] * len(meshes), rel=1e-12)
