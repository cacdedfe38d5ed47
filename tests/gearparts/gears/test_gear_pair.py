"""Geometry of gear pairs and their stiffness, against examples worked by hand and other formulas."""

from __future__ import annotations

import dataclasses
import math
import re
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

import gearparts as gp
from gearlib.errors import ArgumentError, BoundError

DIN = gp.GearPair(19, 104, m_n=4e-3, width=0.04864, x_1=0.5, x_2=0.15)  # a DIN 3990 example: z = 19 and 104, module 4 mm


def test_geometry_of_an_example_with_profile_shift() -> None:
    assert math.degrees(DIN.alpha_wt) == pytest.approx(21.531902292465457, rel=1e-14)
    assert 1e3 * DIN.centre_distance == pytest.approx(248.506843355171, rel=1e-13)
    assert [2e3 * r for r in DIN.base_radii] == pytest.approx([71.41663917972905, 390.9121302469379], rel=1e-14)
    assert [2e3 * r for r in DIN.tip_radii] == pytest.approx([88.0, 425.2], rel=1e-14)
    assert DIN.contact_ratio == pytest.approx(1.5363235945832296, rel=1e-13)
    assert DIN.contact_ratio == DIN.approach + DIN.recess


def test_contact_ratio_of_two_racks_is_the_limit_of_many_teeth() -> None:
    alpha = math.pi / 9  # each addendum of one module gives 1 / sin(alpha) along the line of action
    limit = 2 / (math.sin(alpha) * math.pi * math.cos(alpha))
    for internal in (False, True):
        large = gp.GearPair(10**6, 3 * 10**6, m_n=1e-3, width=0.01, internal=internal)
        assert large.contact_ratio == pytest.approx(limit, rel=1e-5)


def test_an_internal_pair_by_its_triangles() -> None:
    # 24 and 60 teeth, module 4: base radii 48 cos 20, 120 cos 20; tips 52 and 116; centres 72 apart
    pair, cos, sin = gp.GearPair(24, 60, m_n=4e-3, width=0.05, internal=True), math.cos(math.pi / 9), math.sin(math.pi / 9)
    path = math.sqrt(52**2 - (48 * cos) ** 2) - math.sqrt(116**2 - (120 * cos) ** 2) + 72 * sin
    assert pair.contact_ratio == pytest.approx(path / (4 * math.pi * cos), rel=1e-13)
    assert pair.centre_distance == pytest.approx(0.072, rel=1e-14)


def test_iso_6336_stiffness_worked_by_hand() -> None:
    # z = 20 and 40, no profile shift: q' = 0.04723 + 0.0077755 + 0.00644775 = 0.06145325 mm um / N; C_B = 0.975
    pair = gp.GearPair(20, 40, m_n=3e-3, width=0.02)
    assert pair.single_stiffness == pytest.approx(1e9 * 0.8 * 0.975 / 0.06145325, rel=1e-12)  # 12.693 N/(mm um)
    assert pair.mesh_stiffness == pytest.approx(pair.single_stiffness * (0.75 * pair.contact_ratio + 0.25), rel=1e-15)
    # z = 19 and 104 with x = 0.5 and 0.15, term by term
    terms = [
        0.04723, 0.15551 / 19, 0.25791 / 104, -0.00635 * 0.5, -0.11654 * 0.5 / 19, -0.00193 * 0.15, -0.24188 * 0.15 / 104,
        0.00529 * 0.25, 0.00182 * 0.0225,
    ]  # fmt: skip
    assert DIN.single_stiffness == pytest.approx(1e9 * 0.8 * 0.975 / sum(terms), rel=1e-12)
    assert 13.5e9 < DIN.single_stiffness < 15.5e9  # the standard's mean value for such pairs is 14 N/(mm um)
    assert 19e9 < DIN.mesh_stiffness < 21.5e9  # ... and 20 for c_gamma


def test_iso_6336_stiffness_of_helical_and_internal_and_lightly_loaded_pairs() -> None:
    beta = math.radians(15)
    helical = gp.GearPair(20, 40, m_n=3e-3, width=0.02, beta=beta)
    virtual = 20 / ((1 - (math.sin(beta) * math.cos(math.pi / 9)) ** 2) * math.cos(beta))
    assert helical.virtual_teeth[0] == pytest.approx(virtual, rel=1e-14)
    q = 0.04723 + 0.15551 / virtual + 0.25791 / (2 * virtual)
    assert helical.single_stiffness == pytest.approx(1e9 * 0.78 * math.cos(beta) / q, rel=1e-12)
    ring = gp.GearPair(20, 60, m_n=3e-3, width=0.02, internal=True)
    assert ring.single_stiffness == pytest.approx(1e9 * 0.78 / (0.04723 + 0.15551 / 20), rel=1e-12)
    light = gp.GearPair(20, 40, m_n=3e-3, width=0.02, line_load=4e4)
    assert light.single_stiffness == pytest.approx(0.4**0.25 * 0.78e9 / 0.06145325, rel=1e-12)


def test_iso_6336_stiffness_with_all_factors_term_by_term() -> None:
    beta, alpha = 0.2, math.radians(25)
    pair = gp.GearPair(
        23, 41, m_n=2e-3, width=0.02, x_1=0.3, x_2=0.1, beta=-beta, alpha_n=alpha, h_fP=1.4, blank=0.85, line_load=7e4
    )  # fmt: skip
    beta_b = math.asin(math.sin(beta) * math.cos(alpha))
    z_1, z_2 = (z / (math.cos(beta_b) ** 2 * math.cos(beta)) for z in (23, 41))
    q = (
        0.04723 + 0.15551 / z_1 + 0.25791 / z_2 - 0.00635 * 0.3 - 0.11654 * 0.3 / z_1 - 0.00193 * 0.1 - 0.24188 * 0.1 / z_2
        + 0.00529 * 0.3**2 + 0.00182 * 0.1**2
    )  # fmt: skip
    rack = (1 + 0.5 * (1.2 - 1.4)) * (1 + 0.02 * 5)  # C_B: a deeper dedendum softens, a larger pressure angle stiffens
    assert pair.single_stiffness == pytest.approx(0.7**0.25 * 1e9 * 0.8 * 0.85 * rack * math.cos(beta) / q, rel=1e-12)
    full, at_limit, below = (
        gp.GearPair(20, 40, 3e-3, 0.02, line_load=load).single_stiffness for load in (math.inf, 1e5, 9.9e4)
    )
    assert full == at_limit
    assert below == pytest.approx(0.99**0.25 * full, rel=1e-12)


def some_pairs() -> list[gp.GearPair]:
    """External and internal, spur and helical of either hand; short and long teeth."""
    rng = np.random.default_rng(8)
    pairs = []
    for k in range(24):
        internal = k % 2 == 1
        z_1 = int(rng.integers(25, 50))
        z_2 = z_1 + int(rng.integers(25, 60))
        x_1, x_2 = rng.uniform(0.0, 0.3, 2)
        h_aP, beta = float(rng.choice([0.4, 1.0, 1.4])), float(rng.choice([0.0, 0.25, -0.25]))
        alpha_n = float(rng.uniform(0.3, 0.4))
        with suppress(BoundError):
            pairs.append(gp.GearPair(z_1, z_2, 2e-3, 0.03, x_1, x_2, alpha_n, beta, internal, h_aP))
    assert len(pairs) > 18
    assert {pair.internal for pair in pairs} == {True, False}
    ratios = [pair.contact_ratio for pair in pairs]
    assert min(ratios) < 1
    assert max(ratios) > 2
    return pairs


def test_a_pair_in_its_transverse_section() -> None:
    for pair in some_pairs():
        sense = -1 if pair.internal else 1
        assert pair.ratio == pair.z_2 / pair.z_1
        assert math.tan(pair.alpha_t) * math.cos(pair.beta) == pytest.approx(math.tan(pair.alpha_n), rel=1e-13)
        assert math.tan(pair.beta_b) == pytest.approx(math.tan(pair.beta) * math.cos(pair.alpha_t), rel=1e-13)
        assert [2 * math.pi * r / z for r, z in zip(pair.base_radii, (pair.z_1, pair.z_2), strict=True)] == pytest.approx(
            [pair.base_pitch] * 2, rel=1e-13
        )
        (a_1, a_2), (b_1, b_2) = pair.tip_radii, pair.base_radii
        assert b_1 / math.cos(pair.alpha_t) == pytest.approx(pair.z_1 * 1e-3 / math.cos(pair.beta), rel=1e-13)
        assert pair.centre_distance * math.cos(pair.alpha_wt) == pytest.approx(abs(b_2 + sense * b_1), rel=1e-13)
        # along the line of action: the path goes as far as the tips reach, and not beyond the tangent point of the mate
        slope = math.tan(pair.alpha_wt)
        after, before = (math.sqrt(a**2 - b**2) - b * slope for a, b in ((a_1, b_1), (a_2, b_2)))
        after = after if pair.internal else min(after, b_2 * slope)
        assert pair.recess * pair.base_pitch == pytest.approx(after, rel=1e-11)
        assert pair.approach * pair.base_pitch == pytest.approx(min(sense * before, b_1 * slope), rel=1e-11)
        assert pair.contact_ratio == pair.approach + pair.recess
        assert pair.overlap_ratio * 2e-3 * math.pi == pytest.approx(0.03 * abs(math.sin(pair.beta)), abs=1e-18)


@pytest.mark.parametrize(("z", "x"), [(7, 0.0), (8, 0.1), (10, 0.0), (12, 0.1), (14, 0.0), (25, 0.0)])
def test_contact_ends_where_the_corner_of_the_rack_has_cut_the_flank_away(z: int, x: float) -> None:
    """Points of the involute, each tried against all places of the rack's corner as the gear rolls along it."""
    alpha, rho, h_fP = math.pi / 9, 0.38, 1.25
    r, base = z / 2, z / 2 * math.cos(math.pi / 9)
    turn = np.linspace(-8.0, 8.0, 4001) / z  # of the gear
    straight = (
        math.pi / 4 - (h_fP - rho) * math.tan(alpha) - rho / math.cos(alpha)
    )  # the corner's centre, beside the middle of its tooth
    y, x_corner = r + x - (h_fP - rho), r * turn - straight
    centre = np.stack([x_corner * np.cos(turn) - y * np.sin(turn), x_corner * np.sin(turn) + y * np.cos(turn)])
    kept = []
    for way in np.linspace(0.0, r * math.sin(alpha), 201):
        radius = math.hypot(base, way)
        half = (math.pi / 2 + 2 * x * math.tan(alpha)) / z + math.tan(alpha) - alpha - way / base + math.atan(way / base)
        from_space = math.pi / z - half  # the flank beside the middle of the space that the rack's tooth cuts
        gaps = [
            np.hypot(*(centre - radius * np.array([[side * math.sin(from_space)], [math.cos(from_space)]]))) for side in (-1, 1)
        ]
        kept.append(min(gap.min() for gap in gaps) > rho * (1 - 1e-5))
    begin = r * math.sin(alpha) * (len(kept) - 1 - kept[::-1].index(False)) / 200 if not all(kept) else 0.0
    pair = gp.GearPair(z, 400, 1.0, 1.0, x_1=x)
    limited = base * math.tan(pair.alpha_wt) - begin
    reach = math.sqrt(pair.tip_radii[1] ** 2 - pair.base_radii[1] ** 2) - pair.base_radii[1] * math.tan(pair.alpha_wt)
    assert pair.approach * pair.base_pitch == pytest.approx(min(limited, reach), abs=r * math.sin(alpha) / 150)


def test_loss_factor_is_the_mean_over_the_pairs_in_contact() -> None:
    """Sliding over the path of contact, added up phase by phase; also with three pairs in contact, or less than one."""
    for pair in some_pairs():
        path = max(pair.contact_ratio, 1.0)
        phases = (np.arange(20_000) + 0.5) / 20_000
        places = phases + np.arange(4)[:, None]
        touching = places < path
        mean = ((np.abs(places - pair.approach) * touching).sum(0) / touching.sum(0)).mean()
        sense = -1 if pair.internal else 1
        expected = 2 * math.pi * (1 / pair.z_1 + sense / pair.z_2) / math.cos(pair.beta_b) * mean
        assert pair.loss_factor == pytest.approx(expected, rel=2e-4)


def test_efficiency_up_to_the_friction_that_takes_all_power() -> None:
    factor = DIN.loss_factor
    assert DIN.efficiency(0) == 1.0
    assert DIN.efficiency(0.05) == pytest.approx(1 - 0.05 * factor, rel=1e-15)
    assert 0 < DIN.efficiency(0.999999 / factor) < 1e-5
    for mu in (1.000001 / factor, -1e-9):
        with pytest.raises(BoundError, match=f"from 0 on, below {1 / factor:.3g}, at which all power is lost"):
            DIN.efficiency(mu)


def test_loss_factor_is_the_formula_of_the_textbook() -> None:
    for pair, sign in (
        (gp.GearPair(20, 40, m_n=3e-3, width=0.02), 1),
        (gp.GearPair(29, 60, 3e-3, 0.02, internal=True, h_aP=0.8), -1),
    ):
        assert max(pair.approach, pair.recess) < 1
        bracket = 1 - pair.contact_ratio + pair.approach**2 + pair.recess**2
        assert pair.loss_factor == pytest.approx(math.pi * (1 / pair.z_1 + sign / pair.z_2) * bracket, rel=1e-12)


def test_cai_s_stiffness_over_the_phase() -> None:
    pair = gp.GearPair(20, 40, m_n=3e-3, width=0.02)
    pattern = gp.cai_stiffness(pair, 4000)
    largest, eps = pair.single_stiffness * pair.width, pair.contact_ratio
    assert pattern.mean == pytest.approx(0.85 * eps * largest, rel=1e-3)  # the mean of 0.55 + 1.8 u - 1.8 u**2 is 0.85
    assert pattern.mean == pytest.approx(pair.mesh_stiffness * pair.width, rel=0.06)  # ISO's mean
    values = dict(pattern.table)
    phase = pattern.table[1000][0]  # two pairs in contact
    u = phase / (2 * math.pi) / eps
    two = sum(0.55 + 1.8 * x - 1.8 * x**2 for x in (u, u + 1 / eps))
    assert values[phase] * pattern.mean == pytest.approx(two * largest, rel=1e-12)
    assert np.mean(list(values.values())) == pytest.approx(1.0, rel=1e-12)
    scaled = gp.cai_stiffness(pair, 64, mean=5e8)
    assert scaled.mean == 5e8


def test_cai_s_stiffness_of_helical_teeth_rises_and_falls_smoothly() -> None:
    pair = gp.GearPair(20, 60, m_n=4e-3, width=0.05, beta=math.radians(20))
    total = pair.contact_ratio + pair.overlap_ratio
    middle = gp.cai_pair_stiffness(pair, total / 2)
    assert middle == pair.single_stiffness * pair.width
    end = math.exp((0.322 * 15 + 0.23 * 0.05 / 0.009 - 23.26) * (total / 2 / (1.125 * pair.contact_ratio)) ** 3)
    assert gp.cai_pair_stiffness(pair, 0.0) == pytest.approx(middle * end, rel=1e-9)
    assert gp.cai_pair_stiffness(pair, -0.01) == gp.cai_pair_stiffness(pair, total + 0.01) == 0.0
    helical = np.ptp([v for _, v in gp.cai_stiffness(pair).table])
    spur = np.ptp([v for _, v in gp.cai_stiffness(gp.GearPair(20, 60, m_n=4e-3, width=0.05)).table])
    assert helical < 0.5 * spur


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"z_1": 0, "z_2": 40}, r"GearPair\.z_1 is 0; expected a positive number"),
        ({"z_1": 40, "z_2": 30, "internal": True}, r"a ring of 30 teeth around a pinion of 40"),
        ({"z_1": 20, "z_2": 30, "beta": 2.0}, r"GearPair\.beta is 2\.0 rad"),
        ({"z_1": 20, "z_2": 30, "alpha_n": 20}, r"GearPair\.alpha_n is 20 rad; expected an angle between 0 and pi/2"),
        (
            {"z_1": 19, "z_2": 30, "x_1": 1.5},
            r"the 19 teeth of z_1 end in points at a radius of 0\.03\d* m, before their tip circle of",
        ),
        (
            {"z_1": 30, "z_2": 19, "x_2": 1.5},
            r"the 19 teeth of z_2 end in points at a radius of 0\.03\d* m, before their tip circle of",
        ),
        ({"z_1": 19, "z_2": 60, "x_1": 1.5, "x_2": -1.2, "internal": True}, r"the 19 teeth of z_1 end in points"),
        ({"z_1": 20, "z_2": 30, "x_1": -3.0}, r"do not reach each other|no pressure angle fits"),
        ({"z_1": 20, "z_2": 30, "m_n": math.nan}, r"GearPair\.m_n is nan"),
        ({"z_1": "20", "z_2": 30}, r"GearPair\.z_1 is '20'; expected a positive number"),
        ({"z_1": 20.5, "z_2": 30}, r"GearPair\.z_1 is 20\.5; expected a whole number of teeth"),
        ({"z_1": 20, "z_2": 30, "x_2": "0"}, r"GearPair\.x_2 is '0'; expected a finite number"),
        ({"z_1": 20, "z_2": 30, "beta": None}, r"GearPair\.beta is None; expected a finite number"),
        ({"z_1": 20, "z_2": 30, "width": math.inf}, r"GearPair\.width is inf; expected a positive number"),
    ],
)
def test_impossible_pairs_are_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(BoundError, match=message):
        gp.GearPair(**{"m_n": 3e-3, "width": 0.02, **given})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["z_1", "z_2", "m_n", "width", "alpha_n", "h_aP", "h_fP", "blank", "line_load"])
def test_sizes_of_a_pair_are_positive_numbers(name: str) -> None:
    for value in (0, -1.0, 1e301, math.nan):
        given: dict[str, object] = {"z_1": 20, "z_2": 40, "m_n": 3e-3, "width": 0.02, name: value}
        with pytest.raises(BoundError, match=rf"GearPair\.{name} is {re.escape(str(value))}; expected a positive number"):
            gp.GearPair(**given)  # type: ignore[arg-type]


def test_limits_of_a_pair_are_refused_and_what_is_beside_them_is_not() -> None:
    given: dict[str, Any] = {"z_1": 20, "z_2": 40, "m_n": 3e-3, "width": 0.02}
    for beta in (math.pi / 2, -math.pi / 2):
        with pytest.raises(BoundError, match=r"beta is .* rad; expected an angle between -pi/2 and pi/2"):
            gp.GearPair(**given, beta=beta)
    assert gp.GearPair(**given, beta=1.5).contact_ratio == gp.GearPair(**given, beta=-1.5).contact_ratio > 0
    with pytest.raises(BoundError, match="a ring of 20 teeth around a pinion of 20; expected z_2 > z_1"):
        gp.GearPair(**{**given, "z_2": 20}, internal=True)
    assert gp.GearPair(**{**given, "z_2": 21}, internal=True, h_aP=0.1).centre_distance == pytest.approx(1.5e-3)
    for x in (1e150, -math.inf):
        with pytest.raises(BoundError, match=r"GearPair\.x_1 is .*; expected a finite number"):
            gp.GearPair(**given, x_1=x)
    for internal in (1, "yes", None):
        with pytest.raises(BoundError, match=r"GearPair\.internal is .*; expected True or False"):
            gp.GearPair(**given, internal=internal)
    assert gp.GearPair(**{**given, "z_2": 60}, internal=np.True_).sense == -1  # type: ignore[arg-type]
    with pytest.raises(
        BoundError, match=r"20 and 40 teeth with profile shifts -2 and 0 do not reach each other's base circles"
    ):
        gp.GearPair(**given, x_1=-2.0)
    with pytest.raises(BoundError, match="no pressure angle fits the profile shifts 0 and -2"):
        gp.GearPair(**given, x_2=-2.0)


def test_a_drawn_pair_has_the_tips_and_roots_of_its_racks() -> None:
    """Addendum and dedendum are normal modules beyond the reference circle, whose radius grows with the helix angle."""
    for internal in (False, True):
        pair = gp.GearPair(25, 70, 2e-3, 0.02, x_1=0.2, x_2=0.1, beta=0.3, internal=internal)
        gears = pair.drawn_gears()
        wheels = gears.wheels[::-1] if internal else gears.wheels
        assert [w.name for w in wheels] == ["pinion: 25", "ring: 70" if internal else "wheel: 70"]
        assert [w.ring for w in wheels] == [False, internal]
        for wheel, tip, z, x in zip(wheels, pair.tip_radii, (25, 70), (0.2, 0.1), strict=True):
            ends = [float(f(np.hypot(*wheel.outline.T))) for f in (np.min, np.max)]
            depth = 2e-3 * (1.25 - x) * (1 if wheel.ring else -1)
            assert ends[:: -1 if wheel.ring else 1] == pytest.approx([z * 1e-3 / math.cos(0.3) + depth, tip], rel=1e-12)
        assert gears.contacts[0].alpha == pair.alpha_wt
        assert gears.wheels[1].orbit == pair.centre_distance


@pytest.mark.parametrize(("h_aP", "h_fP", "rho"), [(1.0, 1.25, 0.38), (0.3, 0.35, 0.315), (0.4, 0.422, 0.3798)])
def test_teeth_of_a_drawn_pair_have_the_rounded_feet_of_their_rack(h_aP: float, h_fP: float, rho: float) -> None:
    """0.38 normal modules round, or nine tenths of a smaller dedendum; the rack's lengths across are transverse ones."""
    pair = gp.GearPair(25, 70, 2e-3, 0.02, beta=0.3, h_aP=h_aP, h_fP=h_fP)
    across = math.pi / 4 / math.cos(0.3) + (h_fP - rho) * math.tan(pair.alpha_t) + rho / math.cos(pair.alpha_t)
    for wheel, z in zip(pair.drawn_gears().wheels, (25, 70), strict=True):
        x, y = wheel.outline[0]
        assert math.atan2(-y, x) * z / 2 / math.cos(0.3) == pytest.approx(across, rel=1e-12)


def test_stiffness_beyond_its_formula_is_refused() -> None:
    """A basic rack of twice the usual depth would have a negative one; a helical pair that is stiffest at the ends of contact."""
    given: dict[str, Any] = {"z_1": 20, "z_2": 40, "m_n": 3e-3, "width": 0.02}
    assert gp.GearPair(**given, h_fP=3.19).mesh_stiffness > 0
    with pytest.raises(
        BoundError, match=r"knows no stiffness of teeth with h_fP = 3\.21, alpha_n = 0\.349066 rad and profile shifts 0"
    ):
        gp.GearPair(**given, h_fP=3.21).mesh_stiffness  # noqa: B018
    with pytest.raises(BoundError, match=r"Cai's formula does not hold for a helix of 85\.9437 degrees and a width of 0\.02 m"):
        gp.cai_stiffness(gp.GearPair(**given, beta=1.5))


def test_too_few_samples_are_refused() -> None:
    with pytest.raises(ArgumentError, match="samples is 4"):
        gp.cai_stiffness(DIN, 4)
    with pytest.raises(ArgumentError, match=r"samples is 8\.5"):
        gp.cai_stiffness(DIN, 8.5)  # type: ignore[arg-type]
    for mean in (math.nan, -1.0, 0.0):
        with pytest.raises(ArgumentError, match="mean="):
            gp.cai_stiffness(DIN, mean=mean)


@pytest.mark.parametrize("mu", [math.nan, -1.0, 50.0, "0.06", None])
def test_friction_that_no_mesh_has_is_refused(mu: object) -> None:
    with pytest.raises(BoundError, match=r"efficiency: mu is .*; expected a mean friction coefficient from 0 on, below \d"):
        DIN.efficiency(mu)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("J_a", 0.0, "a positive finite number"),
        ("r_b", "0.1", "a positive finite number"),
        ("c", math.nan, "a finite number from 0 on"),
        ("zeta", -0.05, "a finite number from 0 on"),
    ],
)
def test_damping_of_an_impossible_mesh_is_refused(name: str, value: object, expected: str) -> None:
    pair = {"zeta": 0.05, "c": 2e8, "J_a": 0.001, "r_a": 0.05, "J_b": 0.016, "r_b": 0.1}
    with pytest.raises(BoundError, match=f"mesh_damping: {name} is {value!r}; expected {expected}"):
        gp.mesh_damping(**{**pair, name: value})
    assert gp.mesh_damping(**{**pair, "zeta": 0}) == 0


def test_positive_profile_shift_moves_teeth_towards_their_tips() -> None:
    """ISO 21771, 4.2.4: for a ring, too, whose tips point to its axis; the docstring says so."""
    for internal, sense in ((False, 1), (True, -1)):
        plain, shifted = (gp.GearPair(20, 60, m_n=2e-3, width=0.02, internal=internal, x_1=x, x_2=x) for x in (0.0, 0.2))
        for gear, outwards in ((0, 1), (1, sense)):
            assert shifted.tip_radii[gear] - plain.tip_radii[gear] == pytest.approx(outwards * 0.2 * 2e-3)
    assert "ring's towards its axis" in str(gp.GearPair.__doc__)


def test_pairs_of_all_sizes_are_alike() -> None:
    """Lengths grow with the module, ratios and the stiffness per width stay; both hands of a helix are the same."""
    for pair in some_pairs():
        larger = dataclasses.replace(pair, m_n=3 * pair.m_n, width=3 * pair.width)
        for other, size in ((larger, 3.0), (dataclasses.replace(pair, beta=-pair.beta), 1.0)):
            for name in ("contact_ratio", "alpha_wt", "loss_factor", "overlap_ratio", "single_stiffness", "approach", "recess"):
                assert getattr(other, name) == pytest.approx(getattr(pair, name), rel=1e-12), name
            for name in ("centre_distance", "base_pitch", "base_radii", "tip_radii"):
                assert np.divide(getattr(other, name), getattr(pair, name)) == pytest.approx(size, rel=1e-12), name
            assert gp.cai_pair_stiffness(other, 0.3) == pytest.approx(size * gp.cai_pair_stiffness(pair, 0.3), rel=1e-12)
