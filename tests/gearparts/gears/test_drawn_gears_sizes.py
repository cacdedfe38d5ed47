"""Sizes, places and motions of drawn gears, by hand from the numbers of teeth, the centre distance and the path of contact."""

import math

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ModelError
from gearparts.gears.drawn_gears import pair_of, pitched_pair, planetary_set
from gearparts.gears.tooth_form import ToothForm


def ends(wheel):
    """Least and largest radius of an outline."""
    radii = np.hypot(*wheel.outline.T)
    return radii.min(), radii.max()


@pytest.mark.parametrize("ring", [False, True])
def test_a_pair_shares_its_centre_distance_by_the_teeth(ring):
    forms = ToothForm(60, 2e-3, ring=ring), ToothForm(20, 2e-3)
    gears = pair_of(*forms, 0.12, 0.4, force="mesh.f", names=("first", "second"), carrier="support.phi")
    a, b = gears.wheels
    assert (a.name, b.name) == ("first: 60", "second: 20")
    assert (a.ring, b.ring) == (ring, False)
    assert (a.pitch_radius, b.pitch_radius) == pytest.approx((0.18, 0.06) if ring else (0.09, 0.03))
    assert (a.orbit, b.orbit, a.place, b.place) == (0.0, 0.12, 0.0, 0.0)
    assert a.turn == (0.0, 1.0, 0.0)
    assert b.turn == pytest.approx((0.0, 3.0, -2.0) if ring else (math.pi * 21 / 20, -3.0, 4.0))
    (contact,) = gears.contacts
    assert (contact.a, contact.b, contact.alpha, contact.force, contact.share) == (0, 1, 0.4, "mesh.f", 1.0)
    assert (gears.first, gears.carrier, gears.holding) == ("flange_a.phi", "support.phi", {"support": (1.0, 0.0)})
    for wheel, form in zip(gears.wheels, forms, strict=True):
        assert np.array_equal(wheel.outline, form.outline())
    plain = pair_of(*forms, 0.12, 0.4)
    assert (plain.contacts[0].force, plain.carrier, [w.name for w in plain.wheels]) == ("f", "", ["a: 60", "b: 20"])


def test_a_pair_of_pitch_radii_has_standard_teeth():
    unit = gp.FixedAxisUnit(Z_1=15, R_1=0.03, R_2=0.05, I_1=1.0, I_2=1.0, K_g=1e8, C_g=0.0)
    a, b = pitched_pair(unit, 15, "mesh.f").wheels
    assert (ends(a), ends(b)) == ((pytest.approx(0.025), pytest.approx(0.034)), (pytest.approx(0.045), pytest.approx(0.054)))
    assert (b.name, b.orbit) == ("gear 2: 25", pytest.approx(0.08))
    for R_1, R_2 in ((-0.03, 0.05), (0.03, -0.05), (0.03, 0.0), (0.0, -0.05)):
        assert gp.FixedAxisUnit(Z_1=15, R_1=R_1, R_2=R_2, I_1=1.0, I_2=1.0, K_g=1e8, C_g=0.0).drawn_gears() is None
        mesh = gp.DetailedExternalMesh(z_a=15.0, r_a=R_1, r_b=R_2, c=1e8, d=0.0)
        assert mesh.drawn_gears() is None


@pytest.mark.parametrize("ring", [False, True])
@pytest.mark.parametrize(("alpha", "path", "approach"), [(0.4, 1.6, 0.9), (0.4, 1.3, 0.2), (0.06, 1.4, 0.3)])
def test_tips_of_a_mesh_end_its_path_of_contact(ring, alpha, path, approach):
    """From gear b's tip, the approach before the pitch point, to gear a's; a ring has teeth inside its base circle nowhere."""
    kind = gp.DetailedInternalMesh if ring else gp.DetailedExternalMesh
    mesh = kind(
        friction=True, r_a=0.09, r_b=0.045, z_a=60.0, alpha=alpha, contact_ratio=path, approach=approach, c=1e8, d=0.0
    )  # fmt: skip
    gears = mesh.drawn_gears()
    a, b = gears.wheels
    pitch, cos = 2 * math.pi * 0.09 / 60, math.cos(alpha)
    after = 0.09 * math.tan(alpha) + (-1 if ring else 1) * (path - approach) * pitch
    before = 0.045 * math.tan(alpha) + approach * pitch
    tip_a, tip_b = math.hypot(0.09, max(after, 0.0)), math.hypot(0.045, before)
    assert (ends(a)[0] if ring else ends(a)[1]) == pytest.approx(tip_a, rel=1e-12)
    assert ends(b)[1] == pytest.approx(tip_b, rel=1e-12)
    m = 2 * 0.09 / cos / 60
    distance = 0.045 / cos if ring else 0.135 / cos
    assert (a.name, b.name, a.ring) == ("ring: 60" if ring else "gear a: 60", "gear b: 30", ring)
    assert b.orbit == pytest.approx(distance, rel=1e-13)
    assert (a.pitch_radius, b.pitch_radius) == pytest.approx((0.09 / cos, 0.045 / cos), rel=1e-13)
    if alpha > 0.1:  # the roots stay a quarter of a module off the mate's tips
        assert (ends(a)[1] if ring else ends(a)[0]) == pytest.approx(
            distance + tip_b + m / 4 if ring else distance - tip_b - m / 4, rel=1e-9
        )
        assert ends(b)[0] == pytest.approx(tip_a - distance - m / 4 if ring else distance - tip_a - m / 4, rel=1e-9)
    assert gears.contacts[0].alpha == pytest.approx(alpha)


def test_a_path_without_an_approach_is_halved_by_the_pitch_point():
    given = {"friction": True, "r_a": 0.09, "r_b": 0.045, "z_a": 60.0, "alpha": 0.4, "contact_ratio": 1.6, "c": 1e8, "d": 0.0}

    class Train(gl.Component):
        approach = gl.Parameter("1", "a number that is not known yet")

        def assemble(self):
            self.mesh = gp.DetailedExternalMesh(**given, approach=self.approach)
            return []

    half, told = (gp.DetailedExternalMesh(**given, **more).drawn_gears() for more in ({}, {"approach": 0.8}))
    for drawn in (half, Train().mesh.drawn_gears(), Train(approach=0.8).mesh.drawn_gears()):
        for one, other in zip(drawn.wheels, told.wheels, strict=True):
            assert np.array_equal(one.outline, other.outline)


def test_teeth_are_drawn_from_three_on_and_up_to_a_pressure_angle_of_1_2():
    mesh = {"r_a": 0.1, "r_b": 0.1, "c": 1e8, "d": 0.0, "friction": True}
    for z_a, alpha, drawn in ((3.0, 0.4, True), (2.9, 0.4, False), (30.0, 1.19, True), (30.0, 1.2, False), (30.0, 0.0, False)):
        assert (gp.DetailedExternalMesh(z_a=z_a, alpha=alpha, **mesh).drawn_gears() is not None) == drawn, (z_a, alpha)


def test_teeth_of_the_other_gear_are_whole_to_a_thousandth_and_three_or_more():
    def second(r_b, z_a=20.0):
        return gp.DetailedExternalMesh(r_a=0.1, r_b=r_b, z_a=z_a, c=1e8, d=0.0).drawn_gears().wheels[1].name

    assert second(0.2 * 1.0009) == second(0.2 * 0.9991) == "gear b: 40"
    assert second(0.1, 3.0) == "gear b: 3"
    for r_b, z_a, teeth in ((0.2 * 1.0011, 20.0, "40.044"), (0.2 * 0.9989, 20.0, "39.956"), (0.05, 4.0, "2")):
        with pytest.raises(ModelError, match=rf"^DetailedExternalMesh: radii and teeth .* give the other one {teeth} teeth"):
            second(r_b, z_a)


def test_wheels_of_a_planetary_set_stand_and_turn_as_in_the_set():
    """Sun of 20, planets of 15, ring of 50 teeth: seen from the carrier the ring turns against the sun, 0.4 times as fast."""
    angles = [0.3, 2.5, 4.1]
    gears = planetary_set((20, 15, 50), 0.105, angles, ["s"], ["r0", "r1", "r2"])
    sun, *planets, ring = gears.wheels
    m = 2 * 0.105 / 35
    assert [w.name for w in gears.wheels] == ["sun: 20", "planet 1: 15", "planet 2: 15", "planet 3: 15", "ring: 50"]
    assert [w.ring for w in gears.wheels] == [False] * 4 + [True]
    assert [w.pitch_radius for w in gears.wheels] == pytest.approx([0.06, 0.045, 0.045, 0.045, 0.15])
    assert [w.orbit for w in gears.wheels] == [0.0, 0.105, 0.105, 0.105, 0.0]
    assert [w.place for w in planets] == angles
    assert sun.turn == (0.0, 1.0, 0.0)
    for planet, psi in zip(planets, angles, strict=True):
        start, by_sun, by_carrier = planet.turn
        assert (by_sun, by_carrier) == pytest.approx((-20 / 15, 1 + 20 / 15))
        teeth = 20 * -psi + 15 * (start - psi - math.pi) - math.pi  # on the line of centres a tooth faces a space
        assert math.remainder(teeth, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert ring.turn[1:] == pytest.approx((-0.4, 1.4))
    assert [ends(w) for w in (sun, planets[0])] == [
        (pytest.approx(0.06 - 1.25 * m), pytest.approx(0.06 + m)), (pytest.approx(0.045 - 1.25 * m), pytest.approx(0.045 + m))
    ]  # fmt: skip
    assert ends(ring) == (pytest.approx(0.15 - m), pytest.approx(0.15 + 1.25 * m))
    assert [(c.a, c.b, c.force, c.share) for c in gears.contacts] == [
        *((0, n, "s", pytest.approx(1 / 3)) for n in (1, 2, 3)), *((4, n, f"r{n - 1}", 1.0) for n in (1, 2, 3))
    ]  # fmt: skip
    assert [c.alpha for c in gears.contacts] == pytest.approx([math.pi / 9] * 6)
    assert (gears.first, gears.carrier) == ("sun.phi", "carrier.phi")
    assert gears.holding == {"ring": (1.0, pytest.approx(2 / 7)), "carrier": (1.0, 0.0), "sun": (0.0, 1.0)}


@pytest.mark.parametrize(
    ("planets", "names", "told"),
    [
        (1, ["f"], [("f", 1.0)]),
        (2, ["f"], [("f", 0.5), ("f", 0.5)]),
        (2, ["f0", "f1"], [("f0", 1.0), ("f1", 1.0)]),
        (2, [], []),
    ],
)
def test_planets_have_forces_of_their_own_or_share_one(planets, names, told):
    gears = planetary_set((20, 15, 50), 0.105, [0.3, 0.3 + math.pi][:planets], names, [])
    assert [(c.force, c.share) for c in gears.contacts] == told


def test_a_ring_with_one_tooth_more_or_less_is_shifted_into_mesh():
    """Its working pressure angle follows from the same centre distance; teeth and spaces keep the involute's law."""
    for z_r in (49, 51):
        gears = planetary_set((20, 15, z_r), 0.105, [0.0], ["s"], ["r"], alpha=0.4)
        ring, m = gears.wheels[-1], 2 * 0.105 / 35
        cosine = m * (z_r - 15) * math.cos(0.4) / 0.21
        working = math.acos(cosine)
        assert gears.contacts[1].alpha == pytest.approx(working)
        shift = (math.tan(0.4) - 0.4 - math.tan(working) + working) * (z_r - 15) / (2 * math.tan(0.4))
        assert ends(ring)[1] == pytest.approx(z_r * m / 2 + (1.25 - shift) * m)
        assert ends(ring)[0] == pytest.approx(0.105 + 0.045 - 1.25 * m + 0.25 * m)
        assert ring.pitch_radius == pytest.approx(0.105 * z_r / (z_r - 15))
