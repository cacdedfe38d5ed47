"""Which part of a planetary unit has which value, at all levels of detail."""

from __future__ import annotations

import math
from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.test_declared_numbers import parameters

SIZES = {"R_s": 0.3, "R_p": 0.45, "R_r": 1.205, "R_h": 0.752}  # a planet with profile shift: neither R_s + 2 R_p nor R_s + R_p
BODIES = {"I_s": 2.0, "I_r": 3.0, "I_h": 4.0, "I_spin": 5.0, "I_orbit": 6.0}
MESHES = {"K_ring": 7.0, "K_sun": 8.0, "C_ring": 9.0, "C_sun": 10.0}
TEETH = {"Z_s": 20, "Z_p": 29, "Z_r": 80}


def values(**given: Any) -> dict[str, float]:
    return parameters(gp.PlanetaryUnit(**SIZES, **BODIES, **given))


def turning_bodies(planets: int) -> dict[str, float]:
    expected = {"sun_gear.J": 2.0, "ring_gear.J": 3.0, "carrier_body.J": 4.0}
    for n in range(planets):
        expected |= {f"planet[{n}].spin.J": 5.0, f"planet[{n}].orbit.J": 6.0}
        expected |= {f"planet[{n}].kinematics.r_p": 0.45, f"planet[{n}].kinematics.r_h": 0.752}
    return expected


def meshes(at_ring: str, at_sun: str) -> dict[str, float]:
    ring, sun = {"r_a": 1.205, "r_b": 0.45, "c": 7.0, "d": 9.0}, {"r_a": 0.3, "r_b": 0.45, "c": 8.0, "d": 10.0}
    return {f"{at_ring}.{n}": v for n, v in ring.items()} | {f"{at_sun}.{n}": v for n, v in sun.items()}


def holds(found: dict[str, float], expected: dict[str, float]) -> bool:
    return {name: found.get(name) for name in expected} == pytest.approx(expected, rel=1e-14, abs=1e-14)


@pytest.mark.parametrize("level", ["ideal", "lossy"])
def test_a_rigid_unit_has_the_ratios_of_its_radii(level: str) -> None:
    """Its planets roll on the sun, against it."""
    found = values(level=level, planets=2)
    assert holds(found, turning_bodies(2) | {"set.ratio": 1.205 / 0.3, "rolling.ratio": -0.45 / 0.3})
    assert level == "ideal" or found["set.gear.ratio"] == pytest.approx(-1.205 / 0.3, rel=1e-15)


def test_a_lumped_unit_has_one_mesh_at_the_ring_and_one_at_the_sun() -> None:
    """Support dampers act along the line of action."""
    lumped = values(planets=2, C_v=11.0, I_at_ring=12.0, I_at_sun=13.0, **MESHES)
    supports = {"support[0].d": 11.0 * 0.45**2, "support[1].d": 11.0 * 0.45**2}
    lumps = {"planets_at_ring.J": 12.0, "planets_at_sun.J": 13.0}
    assert holds(lumped, turning_bodies(2) | meshes("ring_mesh", "sun_mesh") | supports | lumps)
    assert holds(values(C_v=11.0, **MESHES), {"planets_at_ring.J": 5.0, "planets_at_sun.J": 5.0})


def test_a_torsional_unit_has_two_meshes_for_every_planet() -> None:
    found = values(planet_meshes="separate", planets=2, **MESHES)
    for n in range(2):
        assert holds(found, turning_bodies(2) | meshes(f"ring_meshes[{n}]", f"sun_meshes[{n}]"))


@pytest.mark.parametrize(("Z_p", "more", "ring_phase"), [(29, {}, 0.0), (30, {}, math.pi), (29, {"ring_phase": 0.4}, 0.4)])
def test_detailed_meshes_have_the_teeth_of_sun_and_ring_and_the_phases_of_their_planets(
    Z_p: int, more: dict[str, float], ring_phase: float
) -> None:
    psi = 2 * math.pi * 30 / 100
    details = {"sun_details": (("phase0", 0.1),), "ring_details": (("phase0", 0.7),)}
    found = values(
        planet_meshes="separate", planets=2, positions=(1.0, 1.0 + psi), **MESHES, **TEETH | {"Z_p": Z_p}, **details, **more
    )  # fmt: skip
    for n in range(2):
        expected = turning_bodies(2) | meshes(f"ring_meshes[{n}]", f"sun_meshes[{n}]")
        expected |= {f"sun_meshes[{n}].z_a": 20.0, f"ring_meshes[{n}].z_a": 80.0}
        expected |= {f"sun_meshes[{n}].phase0": 0.1 - 20 * psi * n}
        expected |= {f"ring_meshes[{n}].phase0": 0.7 + ring_phase - 80 * psi * n}
        assert holds(found, expected), n


def test_detailed_meshes_of_a_lumped_unit_see_the_planets_where_their_own_radii_put_them() -> None:
    """At the ring with its pitch radius less a planet's, at the sun with the sum of both, whatever the carrier's radius."""
    found = values(planets=2, C_v=11.0, sun_details=(("phase0", 0.1),), **MESHES, **TEETH)
    seen = {"seen_by_ring.r_p": 0.45, "seen_by_ring.r_h": 0.755, "seen_by_sun.r_p": 0.45, "seen_by_sun.r_h": 0.75}
    phases = {"ring_mesh.z_a": 80.0, "sun_mesh.z_a": 20.0, "sun_mesh.phase0": 0.1, "ring_mesh.phase0": 0.0}
    assert holds(found, turning_bodies(2) | meshes("ring_mesh", "sun_mesh") | seen | phases)


def test_a_planar_unit_has_its_planets_where_the_base_circles_put_them() -> None:
    bearings = {"k_s": 21.0, "k_r": 22.0, "k_h": 23.0, "k_p": 24.0}
    masses = {"m_s": 31.0, "m_r": 32.0, "m_h": 33.0}
    found = values(
        level="planar", planets=2, positions=(0.2, 3.0), pin_errors=(0.01, 0.02), alpha=0.4, **MESHES, **bearings, **masses
    )
    r_c = 0.752 / math.cos(0.4)
    bodies = {"sun_gear": (31.0, 2.0), "ring_gear": (32.0, 3.0), "carrier_body": (33.0, 4.0)}
    bodies |= {f"planet[{n}]": (6.0 / r_c**2, 5.0) for n in range(2)}
    expected = {f"{body}.{name}": x for body, both in bodies.items() for name, x in zip(("m", "J"), both, strict=True)}
    expected |= {"sun_bearing.k": 21.0, "ring_bearing.k": 22.0, "carrier_bearing.k": 23.0, "ring_bearing.k_phi": 0.0}
    for n, psi in enumerate((0.2, 3.0)):
        expected |= {f"planet_bearing[{n}].r": r_c, f"planet_bearing[{n}].psi": psi, f"planet_bearing[{n}].k": 24.0}
        expected |= {f"planet_bearing[{n}].e": 0.01 * (n + 1)}
        ring = {"r_a": 1.205, "r_b": -0.45, "theta": psi + 0.4, "c": 7.0, "d": 9.0}
        sun = {"r_a": 0.3, "r_b": 0.45, "theta": psi - 0.4, "c": 8.0, "d": 10.0}
        expected |= {f"ring_mesh[{n}].{name}": x for name, x in ring.items()}
        expected |= {f"sun_mesh[{n}].{name}": x for name, x in sun.items()}
    assert holds(found, {f"planar.{name}": x for name, x in expected.items()})


def test_planets_of_a_planar_unit_stand_at_equal_distances_and_pins_in_their_places_unless_told_otherwise() -> None:
    found = values(level="planar", planets=5, alpha=0.4)
    for n in range(5):
        psi = 2 * math.pi * n / 5
        expected = {f"planet_bearing[{n}].psi": psi, f"planet_bearing[{n}].e": 0.0}
        expected |= {f"sun_mesh[{n}].theta": psi - 0.4, f"ring_mesh[{n}].theta": psi + 0.4}
        assert holds(found, {f"planar.{name}": x for name, x in expected.items()})
