"""Involute teeth: the involute of the base circle, thickness, fillets as a rack cuts them, flanks that touch and do not overlap."""

import math
from contextlib import suppress

import numpy as np
import pytest
from matplotlib.path import Path

import gearparts as gp
from gearlib.errors import BoundError
from gearparts.gears.involute import involute_angle
from gearparts.gears.tooth_form import ToothForm


@pytest.mark.parametrize("form", [ToothForm(20, 2e-3), ToothForm(12, 3e-3, x=0.4), ToothForm(45, 1e-3, 0.3, x=-0.2)])
@pytest.mark.parametrize("ring", [False, True])
def test_flanks_are_involutes_of_the_base_circle(form, ring):
    form = ToothForm(form.z, form.m, form.alpha, form.x, ring=ring)
    radii, half = form.flank()
    radii, half = radii[radii > form.base_radius * 1.0001], half[radii > form.base_radius * 1.0001]
    unrolled = np.sqrt((radii / form.base_radius) ** 2 - 1)  # length of the thread over the base radius
    if not ring:  # below the flank there is the fillet
        flank = half <= [form.half_angle(r) + 1e-15 for r in radii]
        flank &= radii > form._fillet(9)[0].max() + 1e-12
        half, unrolled = half[flank], unrolled[flank]
    assert len(half) > 5
    assert half + unrolled - np.arctan(unrolled) == pytest.approx(half[0] + unrolled[0] - np.arctan(unrolled[0]), abs=1e-14)


@pytest.mark.parametrize("ring", [False, True])
@pytest.mark.parametrize("x", [-0.3, 0.0, 0.5])
def test_thickness_at_the_reference_circle(x, ring):
    form = ToothForm(31, 2e-3, x=x, ring=ring)
    width = 2 * form.pitch_radius * form.half_angle(form.pitch_radius)
    thickness = math.pi * form.m - width if ring else width
    assert thickness == pytest.approx(form.m * (math.pi / 2 + 2 * x * math.tan(form.alpha)), rel=1e-14)


@pytest.mark.parametrize(("z", "x"), [(20, 0.0), (30, 0.3), (60, -0.4)])
def test_the_fillet_ends_on_the_flank_where_nothing_is_cut_under(z, x):
    form = ToothForm(z, 1.0, x=x)
    radii, angles = form._fillet(9)
    assert radii[0] == pytest.approx(form.root_radius, rel=1e-14)
    assert angles[-1] == pytest.approx(form.half_angle(radii[-1]), abs=1e-14)
    # where a rack's straight flank ends, on the line of action: (h_fP - rho (1 - sin(alpha)) - x) m below the pitch point
    below = 1.25 - 0.38 * (1 - math.sin(form.alpha)) - x
    along = form.pitch_radius * math.sin(form.alpha) - below / math.sin(form.alpha)
    assert radii[-1] == pytest.approx(math.hypot(form.base_radius, along), rel=1e-14)


def cut_by_rack(form, radius, angle):
    """Whether a rack that rolls on the pitch circle takes away a point, at an angle from the middle of a tooth."""
    m, tan, deep, rho = form.m, math.tan(form.alpha), form.h_fP * form.m, form.rho * form.m
    turn = np.linspace(-1.2, 1.2, 20001)
    x, depth = radius * np.sin(angle + turn), form.pitch_radius + form.x * m - radius * np.cos(angle + turn)
    straight = math.pi * m / 4 - depth * tan
    middle = math.pi * m / 4 - (deep - rho) * tan - rho / math.cos(form.alpha)  # of the corner's circle
    with np.errstate(invalid="ignore"):
        corner = middle + np.sqrt(rho**2 - (depth - deep + rho) ** 2)
    half = np.where(depth < deep - rho * (1 - math.sin(form.alpha)), straight, np.where(depth < deep, corner, -np.inf))
    return bool((np.abs(x - form.pitch_radius * turn - math.pi * m / 2) < half).any())


@pytest.mark.parametrize(
    "given",
    [{"z": 9}, {"z": 12}, {"z": 17}, {"z": 25}, {"z": 40, "x": 0.4}, {"z": 70, "x": -0.2}, {"z": 30, "h_aP": 0.4, "h_fP": 0.6}],
)
def test_teeth_are_what_a_rack_leaves(given):
    """Flanks, fillets and undercut: a little farther out is cut away, a little farther in is not."""
    form = ToothForm(m=1.0, **given)
    radii, half = form.flank()
    for radius, angle in zip(radii[1:], half[1:], strict=True):  # at the root itself the bottom of the space begins
        assert not cut_by_rack(form, radius, angle - 2e-3 / radius), radius
        assert cut_by_rack(form, radius, angle + 2e-3 / radius), radius


def test_few_teeth_are_cut_under():
    form = ToothForm(9, 1.0)
    radii, half = form.flank()
    assert (np.diff(radii) > 0).all()
    waist = half * radii
    assert waist.min() < waist[radii > form.base_radius * 1.05].max() - 0.1  # narrower below than further out
    assert half[0] == pytest.approx(form._fillet(9)[1][0])


def test_pointed_teeth_end_where_their_flanks_meet():
    form = ToothForm(10, 1.0, x=0.9)
    assert form.tip_radius < form.pitch_radius + 1.9
    assert form.half_angle(form.tip_radius) == pytest.approx(0.0, abs=1e-12)


def random_pairs(count):
    rng = np.random.default_rng(17)
    while count:
        z_1, ring = int(rng.integers(9, 60)), bool(rng.integers(2))
        z_2 = int(rng.integers(z_1 + 15, z_1 + 90) if ring else rng.integers(9, 90))
        x_1, x_2 = rng.uniform(-0.3, 0.6, 2)
        with suppress(BoundError):
            pair = gp.GearPair(z_1, z_2, 2e-3, 0.02, x_1=x_1, x_2=x_2, beta=rng.uniform(0.0, 0.4), internal=ring)
            if 0.05 < pair.alpha_wt < 0.8:
                count -= 1
                yield pair


def placed(points, at):
    c, s = math.cos(at.angle), math.sin(at.angle)
    return points @ np.array([[c, s], [-s, c]]) + [at.x, at.y]


@pytest.mark.parametrize("side", [-1, 1])
def test_both_flanks_touch_in_each_point_of_the_line_of_action(side):
    """A point of the line of action is on a flank of the one gear where it is on one of the other, on the drive and the coast side."""
    for angle, pair in enumerate(random_pairs(40)):
        gears = pair.drawn_gears()
        forms = _forms(pair)[:: -1 if pair.internal else 1]
        places = gears.placed(angle / 7, 0.0)
        incline = -side * pair.alpha_wt
        reach = 0.99 * min(wheel.pitch_radius for wheel in gears.wheels) * math.sin(pair.alpha_wt)  # not beyond a tangent point
        along = np.linspace(-1, 1, 7) * min(0.8 * pair.base_pitch, reach)
        points = np.array([gears.wheels[0].pitch_radius, 0.0]) + along[:, None] * [-math.sin(incline), math.cos(incline)]
        phases = []
        for form, at in zip(forms, places, strict=True):
            x, y = (points - [at.x, at.y]).T
            half = np.array([form.half_angle(r) for r in np.hypot(x, y)])
            phases.append(form.z * (np.arctan2(y, x) - at.angle - side * half))
        together = phases[0] - phases[1] if pair.internal else phases[0] + phases[1]
        assert np.abs(np.exp(1j * together) - 1).max() < 1e-8, pair


def _forms(pair):
    m, turn = pair.m_n / math.cos(pair.beta), math.cos(pair.beta)
    return (
        ToothForm(pair.z_1, m, pair.alpha_t, pair.x_1 * turn),
        ToothForm(pair.z_2, m, pair.alpha_t, pair.x_2 * turn, ring=pair.internal),
    )


@pytest.mark.parametrize(
    ("z_1", "z_2", "x_1", "x_2", "ring"),
    [
        (20, 40, 0, 0, False),
        (12, 30, 0.3, -0.3, False),
        (10, 35, 0.5, 0.2, False),
        (25, 70, 0, 0, True),
        (20, 60, 0.3, 0.3, True),
    ],
)
@pytest.mark.parametrize("angle", [0.0, 0.05, 0.11])
def test_gears_in_mesh_do_not_overlap(z_1, z_2, x_1, x_2, ring, angle):
    pair = gp.GearPair(z_1, z_2, 1.0, 1.0, x_1=x_1, x_2=x_2, internal=ring)
    gears = pair.drawn_gears()
    a, b = (placed(w.outline, at) for w, at in zip(gears.wheels, gears.placed(angle, 0.0), strict=True))
    inside = Path(a).contains_points(b)
    wrong = b[~inside] if ring else b[inside]
    depth = max((_distance(a, point) for point in wrong), default=0.0)
    assert depth < 2e-3  # of a module: chords for arcs
    assert Path(b).contains_points(a).any() == ring or Path(b).contains_points(a).sum() < 5


def _distance(polygon, point):
    start, end = polygon, np.roll(polygon, -1, axis=0)
    along = end - start
    share = np.clip(((point - start) * along).sum(1) / (along**2).sum(1), 0, 1)
    return np.hypot(*(start + share[:, None] * along - point).T).min()


@pytest.mark.parametrize("alpha", [0.0, 1e-4, 0.05, 0.35, 0.8, 1.2, 1.5])
def test_the_involute_function_has_an_inverse_for_all_pressure_angles(alpha):
    assert involute_angle(math.tan(alpha) - alpha) == pytest.approx(alpha, rel=1e-9)


def test_points_of_a_flank_are_at_equal_steps_of_its_roll_angle():
    form = ToothForm(30, 2e-3, ring=True)
    radii, _ = form.flank()
    steps = np.diff(np.sqrt((radii / form.base_radius) ** 2 - 1))
    assert steps == pytest.approx(np.full(len(radii) - 1, steps[0]), rel=1e-9)
    assert (radii[0], radii[-1]) == pytest.approx((form.tip_radius, form.root_radius), rel=1e-14)


def test_a_rounded_corner_that_is_too_wide_for_the_rack_meets_its_neighbour_in_the_middle_of_the_space():
    """The foot of a tooth is at most as wide as the pitch."""
    for rho in (0.2, 0.38, 0.7):
        form = ToothForm(24, 1.0, rho=rho)
        radii, half = form.flank()
        assert radii[0] == pytest.approx(form.root_radius)
        free = math.pi / 4 + (1.25 - rho) * math.tan(form.alpha) + rho / math.cos(form.alpha)  # of the corner's centre, m = 1
        assert half[0] * form.pitch_radius == pytest.approx(min(free, math.pi / 2), rel=1e-12)
    assert free > math.pi / 2


def test_tips_are_where_they_are_asked_for_or_end_at_the_point_or_at_the_base_circle():
    assert ToothForm(20, 2e-3, tip=0.0215).tip_radius == 0.0215
    assert ToothForm(60, 2e-3, ring=True, tip=0.0585).tip_radius == 0.0585
    ring = ToothForm(20, 2e-3, ring=True)  # the base circle is farther out than one module within the pitch circle
    assert ring.tip_radius == ring.base_radius > ring.pitch_radius - ring.m
    assert ToothForm(60, 2e-3, ring=True, x=0.3).tip_radius == pytest.approx(0.06 - 1.3 * 2e-3)
    assert ToothForm(60, 2e-3, ring=True, x=0.3).root_radius == pytest.approx(0.06 + 0.95 * 2e-3)
    assert ToothForm(60, 2e-3, x=0.3).root_radius == pytest.approx(0.06 - 0.95 * 2e-3)


def test_an_outline_is_a_whole_gear():
    form = ToothForm(23, 2e-3)
    outline = form.outline()
    assert outline.shape == (2 * 23 * len(form.flank()[0]), 2)
    radii = np.hypot(*outline.T)
    assert radii.max() == pytest.approx(form.tip_radius)
    assert radii.min() == pytest.approx(form.root_radius)
    x, y = outline.T
    area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    assert math.pi * form.root_radius**2 < area < math.pi * form.tip_radius**2


@pytest.mark.parametrize(
    "given",
    [{"z": 20}, {"z": 9}, {"z": 24, "rho": 0.7}, {"z": 12, "x": 0.9},
     {"z": 40, "x": -0.3, "ring": True}, {"z": 30, "h_aP": 0.8, "h_fP": 1.4}],
)  # fmt: skip
def test_teeth_of_all_modules_are_alike(given):
    """Radii grow with the module, angles stay: undercut, pointed, with wide corners, of a ring."""
    (radii, half), unit = ToothForm(m=1.0, **given).flank(), ToothForm(m=1.0, **given)
    for m in (2e-3, 7.0):
        form = ToothForm(m=m, **given)
        assert form.flank()[0] / m == pytest.approx(radii, rel=1e-11)
        assert form.flank()[1] == pytest.approx(half, abs=1e-11)
        assert np.abs(form.outline() / m - unit.outline()).max() < 1e-10
        assert [form.tip_radius / m, form.root_radius / m] == pytest.approx([unit.tip_radius, unit.root_radius], rel=1e-11)


def test_a_flank_is_cut_under_below_the_well_known_number_of_teeth():
    """Where the straight flank of the rack, whose corner begins one module deep, ends behind the tangent point: z sin(alpha)**2 / 2."""
    for z in (8, 12, 16):
        limit = 1.0 - z * math.sin(math.pi / 9) ** 2 / 2  # the least profile shift
        rho = 0.25 / (1 - math.sin(math.pi / 9))
        assert ToothForm(z, 2e-3, x=limit + 1e-6, rho=rho).undercut == 0.0
        assert 0 < ToothForm(z, 2e-3, x=limit - 0.02, rho=rho).undercut < ToothForm(z, 2e-3, x=limit - 0.1, rho=rho).undercut
        assert ToothForm(z, 2e-3, x=limit - 0.1, rho=rho, ring=True).undercut == 0.0
        for beside in np.geomspace(1e-15, 1e-9, 7):  # where the undercut begins at the base circle, to rounding
            assert 0.0 <= ToothForm(z, 2e-3, x=limit - beside, rho=rho).undercut < 1e-8


@pytest.mark.parametrize("given", [{"z": 20}, {"z": 9}, {"z": 40, "x": 0.4}, {"z": 30, "ring": True}, {"z": 12, "x": 0.9}])
def test_no_point_of_a_flank_is_given_twice(given):
    radii, half = ToothForm(m=1.0, **given).flank()
    assert (np.diff(radii) > 0).all()
    assert len(radii) == len(half) >= 9


def test_a_fillet_rises_from_the_root_on():
    """For few teeth and many, with any profile shift and corner."""
    for z in (3, 5, 9, 20, 80):
        for x in np.linspace(-1.0, 1.5, 11):
            for rho in (0.1, 0.38, 0.7):
                radii, _ = ToothForm(z, 1.0, x=float(x), rho=rho)._fillet(9)
                assert len(radii) == 9
                assert (np.diff(radii) > 0).all(), (z, x, rho)


def test_teeth_of_a_ring_end_at_its_base_circle():
    """However far the profile shift moves them, even their roots."""
    form = ToothForm(20, 2e-3, ring=True, x=2.0)
    assert form.root_radius < form.base_radius
    assert form.flank()[0] == pytest.approx(np.full(9, form.base_radius), rel=1e-15)
