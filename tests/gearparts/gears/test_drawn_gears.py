"""Gears for views: pairs and planetary sets whose wheels stand in mesh, and the directions of their forces."""

import math

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ModelError
from gearparts.gears.drawn_gears import planetary_set

UNIT = {"I_s": 1.0, "I_r": 1.0, "I_h": 1.0, "I_spin": 1.0, "I_orbit": 1.0}


def off_a_whole_turn(angle):
    return abs(np.exp(1j * angle) - 1)


def test_every_planet_stands_in_mesh_with_sun_and_ring():
    rng, left = np.random.default_rng(5), 40
    while left:
        z_s, z_p, more, planets = (int(n) for n in rng.integers([9, 9, -1, 2], [50, 40, 2, 6]))
        z_r = z_s + 2 * z_p + more
        try:
            first = rng.uniform(-3, 3)
            angles = [first + psi for psi in gp.planet_positions(z_s, z_r, planets, Z_p=z_p)]
            gears = planetary_set((z_s, z_p, z_r), 0.1, angles, ["f"], ["g"])
        except gl.GearlibError:
            continue
        left -= 1
        at_sun, *at_planets, at_ring = gears.placed(*rng.uniform(-5, 5, 2))
        for planet in at_planets:  # a tooth stands on the line of centres as far from it as a space of the other gear
            line = math.atan2(planet.y, planet.x)
            assert off_a_whole_turn(z_r * (at_ring.angle - line) - z_p * (planet.angle - line)) < 1e-6
            assert off_a_whole_turn(z_s * (at_sun.angle - line) + z_p * (planet.angle - line - math.pi) - math.pi) < 1e-6


@pytest.mark.parametrize("held", ["ring", "carrier", "sun"])
def test_the_held_shaft_stands_still_and_the_others_obey_willis(held):
    gears = planetary_set((20, 15, 50), 0.1, [0.0, 2.4], ["f"], ["g"])
    first, carrier = gears.holding[held]
    before, after = gears.placed(0.0, 0.0), gears.placed(first, carrier)
    sun, ring = after[0].angle - before[0].angle, after[-1].angle - before[-1].angle
    assert {"ring": ring, "carrier": carrier, "sun": sun}[held] == pytest.approx(0.0, abs=1e-12)
    assert 20 * sun + 50 * ring == pytest.approx(70 * carrier, abs=1e-12)


@pytest.mark.parametrize("internal", [False, True])
@pytest.mark.parametrize("force", [300.0, -200.0])
@pytest.mark.parametrize("carrier", [0.0, 0.8])
def test_moments_of_the_drawn_force_are_those_of_the_mesh(internal, force, carrier):
    """About both axes it has the base radius as its arm: the torques that the mesh's equations have."""
    pair = gp.GearPair(20, 50, 2e-3, 0.02, x_1=0.2, internal=internal)
    gears = pair.drawn_gears()
    a, b = gears.placed(0.3, carrier)
    x, y, fx, fy = gears.force_on_b(gears.contacts[0], [a, b], force)
    assert math.hypot(x, y) == pytest.approx(gears.wheels[0].pitch_radius)
    assert math.atan2(y, x) == pytest.approx(carrier)
    assert math.hypot(fx, fy) == pytest.approx(abs(force))
    r_a, r_b = (pair.base_radii[1], pair.base_radii[0]) if internal else pair.base_radii
    assert x * fy - y * fx == pytest.approx(r_a * force)  # what a gives away
    about_b = (x - b.x) * fy - (y - b.y) * fx
    assert about_b == pytest.approx((1 if internal else -1) * r_b * force)


def test_a_mesh_whose_axes_are_carried_follows_its_support():
    values = gp.GearPair(20, 40, 3e-3, 0.02).mesh_values()
    drawn = {carried: gp.DetailedExternalMesh(d=0.0, use_support=carried, **values).drawn_gears() for carried in (False, True)}
    assert {carried: gears.carrier for carried, gears in drawn.items()} == {False: "", True: "support.phi"}


def test_a_mesh_with_the_values_of_a_pair_is_drawn_like_the_pair():
    for pair in (gp.GearPair(20, 40, 3e-3, 0.02), gp.GearPair(20, 60, 3e-3, 0.02, internal=True)):
        kind = gp.DetailedInternalMesh if pair.internal else gp.DetailedExternalMesh
        own, other = kind(d=0.0, **pair.mesh_values()).drawn_gears(), pair.drawn_gears()
        for wheel, same in zip(own.wheels, other.wheels, strict=True):
            assert wheel.orbit == pytest.approx(same.orbit)
            assert wheel.turn == pytest.approx(same.turn)
            assert np.abs(np.hypot(*wheel.outline.T).max() - np.hypot(*same.outline.T).max()) < 1e-9
            assert wheel.pitch_radius == pytest.approx(same.pitch_radius)


@pytest.mark.parametrize("internal", [False, True])
@pytest.mark.parametrize(("z_1", "z_2", "x_1"), [(25, 60, 0.0), (30, 75, 0.3), (35, 70, -0.2)])
def test_tips_stay_a_quarter_module_off_the_roots(internal, z_1, z_2, x_1):
    """Along the line of centres of a mesh whose teeth follow from its path of contact."""
    pair = gp.GearPair(z_1, z_2, 3e-3, 0.02, x_1=x_1, internal=internal)
    kind = gp.DetailedInternalMesh if internal else gp.DetailedExternalMesh
    mesh = kind(d=0.0, **pair.mesh_values())
    a, b = mesh.drawn_gears().wheels
    m = 2 * mesh.r_a / (math.cos(mesh.alpha) * mesh.z_a)
    r_a, r_b = (np.hypot(*wheel.outline.T) for wheel in (a, b))
    if internal:
        off = r_a.max() - (b.orbit + r_b.max()), r_a.min() - (b.orbit + r_b.min())
    else:
        off = b.orbit - r_a.max() - r_b.min(), b.orbit - r_a.min() - r_b.max()
    assert off == pytest.approx((0.25 * m, 0.25 * m), rel=1e-6)


def half_width(wheel, radius, z):
    """Half the width of a tooth (of a ring: of a space) at a radius, from the outline."""
    one = wheel.outline[: len(wheel.outline) // z // 2]
    radii, angles = np.hypot(*one.T), -np.arctan2(one[:, 1], one[:, 0])
    return radius * np.interp(radius, radii, angles)


@pytest.mark.parametrize("z_r", [69, 70, 71])
def test_teeth_of_a_planetary_set_fill_the_spaces_with_a_quarter_module_at_the_tips(z_r):
    """On the working pitch circles a tooth is as wide as the space that it enters."""
    gears = planetary_set((20, 25, z_r), 0.09, [0.0], ["f"], ["g"])
    sun, planet, ring = gears.wheels
    m = 2 * 0.09 / 45
    assert half_width(sun, sun.pitch_radius, 20) + half_width(planet, planet.pitch_radius, 25) == pytest.approx(
        math.pi * m / 2, rel=4e-3
    )
    working = ring.pitch_radius * 25 / z_r
    assert ring.pitch_radius - working == pytest.approx(0.09)
    assert half_width(ring, ring.pitch_radius, z_r) == pytest.approx(
        half_width(planet, working, 25), rel=4e-3
    )  # chords for arcs
    at_sun, at_ring = gears.contacts
    assert at_sun.alpha == math.pi / 9
    assert math.cos(at_ring.alpha) == pytest.approx((z_r - 25) / 45 * math.cos(math.pi / 9), rel=1e-13)
    r_planet, r_ring = (np.hypot(*wheel.outline.T) for wheel in (planet, ring))
    assert r_ring.min() == pytest.approx(0.09 + r_planet.min() + 0.25 * m, rel=1e-12)


@pytest.mark.parametrize(("names", "share"), [(["f"], 1 / 3), (["f0", "f1", "f2"], 1.0)])
def test_a_force_of_all_planets_is_shared_by_their_meshes(names, share):
    gears = planetary_set((30, 20, 70), 0.1, [0.0, 2.0, 4.0], names, [f"r{n}" for n in names])
    told = [(c.a, c.b, c.force, c.share) for c in gears.contacts]
    by_planet = names * 3 if len(names) == 1 else names
    assert told == [(0, n + 1, by_planet[n], share) for n in range(3)] + [
        (4, n + 1, f"r{by_planet[n]}", share) for n in range(3)
    ]
    assert planetary_set((30, 20, 70), 0.1, [0.0], [], []).contacts == ()


def test_a_ring_that_no_profile_shift_brings_into_mesh_is_refused_at_both_ends():
    """The cosine of the working pressure angle lies between a half and one."""
    fitting = []
    for z_r in range(60, 90):
        try:
            planetary_set((20, 25, z_r), 0.09, [0.0], [], [])
            fitting.append(z_r)
        except ModelError:
            pass
    cosines = {z_r: (z_r - 25) / 45 * math.cos(math.pi / 9) for z_r in range(50, 90)}
    assert fitting == [z_r for z_r in range(60, 90) if 0.5 < cosines[z_r] <= 1]
    with pytest.raises(ModelError, match="expected a ring of about 70 teeth"):
        planetary_set((20, 25, 48), 0.09, [0.0], [], [])


def test_a_unit_on_fixed_axes_is_drawn_from_its_pitch_radii():
    unit = {"I_1": 1.0, "I_2": 1.0, "K_g": 1e8, "C_g": 0.0}
    gears = gp.FixedAxisUnit(Z_1=20, R_1=0.03, R_2=0.06, **unit).drawn_gears()
    assert [w.name for w in gears.wheels] == ["gear 1: 20", "gear 2: 40"]
    assert [w.pitch_radius for w in gears.wheels] == pytest.approx([0.03, 0.06])
    assert gears.wheels[1].orbit == pytest.approx(0.09)
    assert np.hypot(*gears.wheels[0].outline.T).max() == pytest.approx(0.033)  # a module of 3 mm beyond the pitch circle
    assert (gears.contacts[0].alpha, gears.contacts[0].force) == (math.pi / 9, "mesh.f")
    assert gp.FixedAxisUnit(R_1=0.03, R_2=0.06, **unit).drawn_gears() is None
    for radii in ({"R_1": 0.0, "R_2": 0.06}, {"R_1": 0.03, "R_2": 0.0}):
        assert gp.FixedAxisUnit(Z_1=20, **radii, **unit).drawn_gears() is None


def test_a_mesh_is_drawn_from_three_teeth_on_where_its_radii_and_angle_are_known():
    values = {"r_a": 0.1, "r_b": 0.2, "c": 1e8, "d": 0.0, "z_a": 20.0}
    assert gp.DetailedExternalMesh(**values).drawn_gears() is not None
    for wrong in ({"z_a": 2.0}, {"r_a": 0.0}, {"r_b": 0.0}):
        assert gp.DetailedExternalMesh(**{**values, **wrong}).drawn_gears() is None
    for alpha in (0.0, 1.2):
        assert gp.DetailedExternalMesh(friction=True, alpha=alpha, **values).drawn_gears() is None
    assert [w.name for w in gp.DetailedExternalMesh(**{**values, "z_a": 3.0}).drawn_gears().wheels] == [
        "gear a: 3",
        "gear b: 6",
    ]
    with pytest.raises(ModelError, match="give the other one 2 teeth"):
        gp.DetailedExternalMesh(**{**values, "z_a": 4.0, "r_b": 0.05}).drawn_gears()


def test_what_is_not_known_is_not_drawn():
    assert gp.DetailedExternalMesh(r_a=0.1, r_b=0.2, c=1e8, d=0.0).drawn_gears() is None
    teeth = {"Z_s": 30, "Z_p": 20, "Z_r": 70}
    for known in ((), ("Z_s", "Z_p"), ("Z_s", "Z_r"), ("Z_p", "Z_r")):
        assert gp.PlanetaryUnit(R_s=0.03, R_p=0.02, **UNIT, **{z: teeth[z] for z in known}).drawn_gears() is None
    assert gp.PlanetaryUnit(R_s=0.0, R_p=0.02, **UNIT, **teeth).drawn_gears() is None
    assert gp.Inertia(J=1.0).drawn_gears() is None


def test_numbers_of_teeth_that_do_not_fit_are_refused():
    with pytest.raises(
        ModelError, match=r"DetailedExternalMesh: .* give the other one 33\.3333 teeth; expected a whole number"
    ):
        gp.DetailedExternalMesh(r_a=0.03, r_b=0.05, z_a=20, c=1e8, d=0.0).drawn_gears()
    near = gp.DetailedExternalMesh(r_a=0.03, r_b=0.06 * 1.0008, z_a=20, c=1e8, d=0.0)  # 40.03 teeth are 40
    assert near.drawn_gears().wheels[1].name == "gear b: 40"
    with pytest.raises(ModelError, match=r"give the other one 40\.06 teeth"):
        gp.DetailedExternalMesh(r_a=0.03, r_b=0.06 * 1.0015, z_a=20, c=1e8, d=0.0).drawn_gears()
    with pytest.raises(ModelError, match=r"no profile shift lets the ring mesh .* expected a ring of about 70 teeth"):
        planetary_set((30, 20, 90), 0.1, [0.0], [], [])


@pytest.mark.parametrize(
    ("level", "meshes", "forces"), [("ideal", "lumped", 0), ("elastic", "lumped", 6), ("elastic", "separate", 6)]
)
def test_units_of_all_levels_have_gears(level, meshes, forces):
    unit = gp.PlanetaryUnit(level=level, planet_meshes=meshes, R_s=0.03, R_p=0.02, Z_s=30, Z_p=20, Z_r=70, planets=5, **UNIT)
    gears = unit.drawn_gears()
    assert [w.ring for w in gears.wheels] == [False] * 6 + [True]
    assert [w.name for w in gears.wheels] == ["sun: 30", *(f"planet {n}: 20" for n in range(1, 6)), "ring: 70"]
    assert len(gears.contacts) == (10 if forces else 0)
    assert gears.wheels[1].orbit == pytest.approx(0.05)
    assert sum(c.share for c in gears.contacts) == pytest.approx(0 if not forces else 2 if meshes == "lumped" else 10)
