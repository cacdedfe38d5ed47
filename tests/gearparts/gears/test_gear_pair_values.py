"""What a gear pair hands to a mesh, and the bounds of what it accepts, each from both sides."""

from __future__ import annotations

import math
from typing import Any

import pytest

import gearparts as gp
from gearlib.errors import BoundError
from gearlib.language.declarations import Offered

GIVEN: dict[str, Any] = {"z_1": 25, "z_2": 70, "m_n": 2e-3, "width": 0.03, "x_1": 0.3, "x_2": -0.1}


@pytest.mark.parametrize("internal", [False, True])
def test_values_of_a_mesh_are_those_of_the_gear_on_its_first_flange(internal: bool) -> None:
    """The pinion's, or the ring's; contact begins with the mate's tip."""
    pair = gp.GearPair(**GIVEN, internal=internal)
    values = pair.mesh_values()
    first, second = (1, 0) if internal else (0, 1)
    assert values == {
        "r_a": pair.base_radii[first], "r_b": pair.base_radii[second], "z_a": (25.0, 70.0)[first],
        "c": pair.mesh_stiffness * 0.03, "alpha": pair.alpha_wt, "contact_ratio": pair.contact_ratio,
        "approach": pair.recess if internal else pair.approach,
    }  # fmt: skip
    assert pair.approach != pytest.approx(pair.recess, rel=0.01)
    assert all(isinstance(value, Offered) for value in values.values())


@pytest.mark.parametrize("internal", [False, True])
def test_a_pair_without_profile_shift_works_at_its_reference_circles(internal: bool) -> None:
    """By hand, of 25 and 70 teeth with a helix of 0.2 rad: the centre distance, path of contact and face overlap."""
    pair = gp.GearPair(25, 70, 2e-3, 0.03, beta=0.2, internal=internal)
    m_t, alpha_t = 2e-3 / math.cos(0.2), math.atan(math.tan(math.pi / 9) / math.cos(0.2))
    assert pair.alpha_wt == pytest.approx(alpha_t, rel=1e-12)
    assert pair.centre_distance == pytest.approx(m_t * (45 if internal else 95) / 2, rel=1e-12)
    base = 25 * m_t / 2 * math.cos(alpha_t), 70 * m_t / 2 * math.cos(alpha_t)
    assert pair.base_radii == pytest.approx(base, rel=1e-14)
    assert pair.tip_radii == pytest.approx((25 * m_t / 2 + 2e-3, 70 * m_t / 2 + (-2e-3 if internal else 2e-3)), rel=1e-14)
    recess = math.sqrt(pair.tip_radii[0] ** 2 - base[0] ** 2) - base[0] * math.tan(alpha_t)
    approach = math.sqrt(pair.tip_radii[1] ** 2 - base[1] ** 2) - base[1] * math.tan(alpha_t)
    pitch = math.pi * m_t * math.cos(alpha_t)
    assert (pair.base_pitch, pair.recess) == pytest.approx((pitch, recess / pitch), rel=1e-11)
    assert pair.approach == pytest.approx((-approach if internal else approach) / pitch, rel=1e-11)
    assert pair.overlap_ratio == pytest.approx(0.03 * math.tan(0.2) / (math.pi * m_t), rel=1e-12)
    per_tooth = 1 / ((1 - (math.sin(0.2) * math.cos(math.pi / 9)) ** 2) * math.cos(0.2))
    assert pair.virtual_teeth == pytest.approx((25 * per_tooth, math.inf if internal else 70 * per_tooth), rel=1e-12)


def test_numbers_that_are_too_large_are_refused_and_the_largest_are_not() -> None:
    for name in ("m_n", "width"):
        assert getattr(gp.GearPair(**GIVEN | {name: 1e100}), name) == 1e100
    assert gp.GearPair(**GIVEN, line_load=1e300).single_stiffness == gp.GearPair(**GIVEN).single_stiffness
    for line_load in (1.1e300, -math.inf, math.nan):
        with pytest.raises(BoundError, match=r"^GearPair\.line_load is .*; expected a positive number$"):
            gp.GearPair(**GIVEN, line_load=line_load)
    for name in ("x_1", "x_2", "beta"):
        with pytest.raises(BoundError, match=rf"^GearPair\.{name} is 1e\+150; expected a finite number$"):
            gp.GearPair(**GIVEN | {name: 1e150})
    with pytest.raises(BoundError, match=r"^GearPair\.alpha_n is 1\.57079\d* rad; expected an angle between 0 and pi/2$"):
        gp.GearPair(**GIVEN, alpha_n=math.pi / 2)


def test_a_pair_whose_teeth_are_too_short_to_meet_is_refused() -> None:
    """Tips that stay inside the base circles, or a path of contact that ends before it begins."""
    for given, outside in (({"x_1": -1.7}, True), ({"x_1": -1.8}, False), ({"x_2": 1.3, "internal": True}, False)):
        tips, half = {"x_1": 0.0, "x_2": 0.0} | given, math.cos(math.pi / 9)
        ring = 70 * (1 - half) / 2 - tips["x_2"] - 1  # tips beyond the base circle, over the module
        assert (ring > 0 if "internal" in given else 25 * (1 - half) / 2 + tips["x_1"] + 1 > 0) == outside
        with pytest.raises(BoundError, match=r"do not reach each other's base circles along the line of action"):
            gp.GearPair(**GIVEN | {"x_1": 0.0, "x_2": 0.0} | given)  # type: ignore[operator]
    assert gp.GearPair(**GIVEN | {"h_aP": 0.05}).contact_ratio > 0


def test_efficiency_is_one_less_friction_times_the_loss_factor() -> None:
    pair = gp.GearPair(**GIVEN)
    assert [pair.efficiency(mu) for mu in (0.0, 0.06)] == [1.0, 1 - 0.06 * pair.loss_factor]
    assert 0 < pair.efficiency(0.9999 / pair.loss_factor) < 2e-4
    said = rf"^GearPair\.efficiency: mu is .*; expected a mean friction coefficient from 0 on, below {1 / pair.loss_factor:.3g}, at which"
    least = 1 / pair.loss_factor
    least = least if least * pair.loss_factor >= 1 else math.nextafter(least, 1.0)  # at which all power is lost
    for mu in (-1e-9, least, math.nan, "0.06"):
        with pytest.raises(BoundError, match=said):
            pair.efficiency(mu)  # type: ignore[arg-type]


def test_a_rack_that_is_so_deep_that_its_teeth_have_no_stiffness_is_refused() -> None:
    """C_B falls by a half for each module that the dedendum exceeds 1.2, so to zero at 3.2."""
    assert gp.GearPair(20, 40, 3e-3, 0.02, h_fP=2.2).single_stiffness == pytest.approx(
        gp.GearPair(20, 40, 3e-3, 0.02, h_fP=1.2).single_stiffness / 2, rel=1e-12
    )
    with pytest.raises(BoundError, match=r"ISO 6336-1 knows no stiffness of teeth with h_fP = 3\.2, alpha_n = 0\.349066 rad"):
        gp.GearPair(20, 40, 3e-3, 0.02, h_fP=3.2).single_stiffness  # noqa: B018


def test_stiffness_grows_with_the_pressure_angle_and_falls_with_the_depth_of_the_rack() -> None:
    """ISO 6336-1's c' in N/(mm um) of 20 and 40 teeth by hand, and C_B: a half per module of dedendum, a fiftieth per degree."""
    flexibility = 0.04723 + 0.15551 / 20 + 0.25791 / 40
    for h_fP, degrees, factor in ((1.2, 20.0, 1.0), (1.0, 20.0, 1.1), (1.2, 25.0, 1.1), (1.4, 15.0, 0.9 * 0.9)):
        pair = gp.GearPair(20, 40, 3e-3, 0.02, h_fP=h_fP, alpha_n=math.radians(degrees), blank=0.9)
        assert pair.single_stiffness == pytest.approx(1e9 * 0.8 * 0.9 * factor / flexibility, rel=1e-12)
    shifted = gp.GearPair(20, 40, 3e-3, 0.02, x_1=0.4, x_2=0.3, h_fP=1.2, line_load=2.5e4)
    terms = -0.00635 * 0.4 - 0.11654 * 0.4 / 20 - 0.00193 * 0.3 - 0.24188 * 0.3 / 40 + 0.00529 * 0.16 + 0.00182 * 0.09
    assert shifted.single_stiffness == pytest.approx(1e9 * 0.8 * 0.25**0.25 / (flexibility + terms), rel=1e-12)
