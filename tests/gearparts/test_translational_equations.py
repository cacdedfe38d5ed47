"""Rods and forces on them: equations and energies at numbers worked out by hand."""

from __future__ import annotations

from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits, powers

X, V = 0.25, -1.5
LAWS: list[tuple[Any, dict[str, float], float, float]] = [
    (gp.TranslationalSpring, {"c": 40.0}, 40.0 * X, 20.0 * X**2),
    (gp.TranslationalDamper, {"d": 3.0}, 0.0, 0.0),
    (gp.TranslationalSpringDamper, {"c": 40.0, "d": 3.0}, 40.0 * X, 20.0 * X**2),
]


@pytest.mark.parametrize(("kind", "given", "spring", "stored"), LAWS)
@pytest.mark.parametrize("use_heat_port", [False, True])
def test_a_spring_between_rods_stores_and_a_damper_loses(
    kind: Any, given: dict[str, float], spring: float, stored: float, use_heat_port: bool
) -> None:
    damped = "d" in given
    f, lost = spring + (3.0 * V if damped else 0.0), 3.0 * V**2 if damped else 0.0
    part = kind(**given, **({"use_heat_port": use_heat_port} if damped else {}))
    values = {
        "s_rel0": 0.5, "s_rel": 0.75, "der(s_rel)": V, "v_rel": V, "flange_a.s": 0.1, "flange_b.s": 0.85, "c": 40.0, "d": 3.0,
        "f": f, "flange_a.f": -f, "flange_b.f": f, "loss_power": lost, "heat_port.Q_flow": -lost,
    }  # fmt: skip
    assert misfits(part, values) == []
    assert powers(part, values) == pytest.approx((stored, lost, 0.0), abs=1e-14)


def test_a_mass_accelerates_under_the_forces_at_its_ends() -> None:
    values = {
        "m": 2.0, "L": 0.5, "s": 1.0, "flange_a.s": 0.75, "flange_b.s": 1.25, "der(s)": 3.0, "v": 3.0, "der(v)": 2.5,
        "flange_a.f": 7.0, "flange_b.f": -2.0,
    }  # fmt: skip
    assert misfits(gp.Mass(m=2.0, L=0.5), values) == []
    assert powers(gp.Mass(m=2.0), values) == (9.0, 0.0, 0.0)
    assert misfits(gp.TranslationalFixed(s0=0.5), {"flange.s": 0.5, "s0": 0.5}) == []


@pytest.mark.parametrize("use_support", [False, True])
@pytest.mark.parametrize("force_direction", [False, True])
@pytest.mark.parametrize("v", [-2.0, 2.0])
def test_a_force_over_the_velocity_drives_or_brakes(use_support: bool, force_direction: bool, v: float) -> None:
    """6 N at 4 m/s accelerate the rod: 1.5 N at 2 m/s, in the sense of the motion or always forward."""
    f = -1.5 if force_direction or v > 0 else 1.5
    part = gp.QuadraticSpeedDependentForce(
        f_nominal=6.0, v_nominal=4.0, force_direction=force_direction, use_support=use_support
    )
    values = {
        "f_nominal": 6.0, "v_nominal": 4.0, "v": v, "der(flange.s)": v + 0.5 * use_support, "der(support.s)": 0.5, "f": f,
        "flange.f": f, "support.f": -f,
    }  # fmt: skip
    assert misfits(part, values) == []
    assert powers(part, values) == (0.0, max(f * v, 0.0), max(-f * v, 0.0))
    assert misfits(gp.Force(f=2.5, use_support=use_support), {"f": 2.5, "flange.f": -2.5, "support.f": 2.5}) == []
