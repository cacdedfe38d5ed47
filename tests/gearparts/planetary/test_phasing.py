"""Planet phasing against teeth that are laid out one by one."""

from __future__ import annotations

import cmath
import math

import pytest

import gearparts as gp
from gearlib.errors import BindingError


def fraction(x: float) -> float:
    return (x + 1e-9) % 1.0 - 1e-9


@pytest.mark.parametrize(("Z_s", "Z_p", "planets"), [(19, 31, 5), (30, 20, 4), (28, 22, 3), (18, 21, 6)])
def test_phases_from_teeth_laid_out_one_by_one(Z_s: int, Z_p: int, planets: int) -> None:
    """In the carrier's frame: which turn of the sun brings a contact to each pitch point."""
    Z_r = Z_s + 2 * Z_p
    if (Z_s + Z_r) % planets:
        with pytest.raises(BindingError):
            gp.planet_phasing(Z_s, Z_p, Z_r, planets)
        return
    phasing = gp.planet_phasing(Z_s, Z_p, Z_r, planets)
    for n in range(planets):
        psi = 2 * math.pi * n / planets
        # Sun flanks lie at multiples of 2 pi / Z_s. The planet turns clockwise, so the sun turns counter-clockwise by u, the ring
        # clockwise by u Z_s / Z_r: the first flank arrives at psi after these parts of a tooth.
        assert phasing.sun[n] == pytest.approx(fraction(Z_s * psi / (2 * math.pi)), abs=1e-9)
        ring_flank = min((2 * math.pi * k / Z_r - psi) % (2 * math.pi) for k in range(Z_r))  # ahead of psi, moving towards it
        assert fraction(phasing.ring[n]) == pytest.approx(fraction(ring_flank * Z_r / (2 * math.pi)), abs=1e-6)
    # The planet's flanks: leading ones at 2 pi k / Z_p touch the sun, trailing ones, half a pitch on, the ring, half a turn away.
    gap = min((math.pi - (2 * math.pi * k / Z_p + math.pi / Z_p)) % (2 * math.pi) for k in range(Z_p))
    assert fraction(phasing.ring_to_sun) == pytest.approx(fraction(gap * Z_p / (2 * math.pi)), abs=1e-6)


@pytest.mark.parametrize("Z_s", [18, 19, 20, 21, 22])
def test_excited_modes_are_those_whose_forces_add_up(Z_s: int) -> None:
    planets, Z_r = 5, 100 - Z_s
    phasing = gp.planet_phasing(Z_s, (Z_r - Z_s) // 2, Z_r, planets)
    for harmonic in (1, 2, 3):
        forces = [cmath.exp(-2j * math.pi * harmonic * g) for g in phasing.sun]
        turned = [cmath.exp(2j * math.pi * n / planets) for n in range(planets)]
        torque = abs(sum(forces))
        sideways = max(
            abs(sum(f * t for f, t in zip(forces, turned, strict=True))),
            abs(sum(f / t for f, t in zip(forces, turned, strict=True))),
        )
        found = "rotational" if torque > 1e-6 else "translational" if sideways > 1e-6 else "planet"
        assert phasing.excites(harmonic) == found


def test_the_sense_and_the_positions() -> None:
    one, other = gp.planet_phasing(19, 31, 81, 5), gp.planet_phasing(19, 31, 81, 5, clockwise=False)
    assert [fraction(a + b) for a, b in zip(one.sun, other.sun, strict=True)] == pytest.approx([0.0] * 5, abs=1e-9)
    at = [0.0, 2 * math.pi * 33 / 100, 2 * math.pi * 67 / 100]
    uneven = gp.planet_phasing(19, 31, 81, 3, positions=at)
    assert uneven.sun == pytest.approx((0.0, 0.27, 0.73), abs=1e-12)


@pytest.mark.parametrize("clockwise", [True, False])
def test_phases_do_not_depend_on_where_angles_are_counted_from(clockwise: bool) -> None:
    at = gp.planet_positions(19, 81, 3)
    plain, turned = (
        gp.planet_phasing(19, 31, 81, 3, positions=[psi + by for psi in at], clockwise=clockwise) for by in (0.0, 0.4)
    )
    assert turned.sun[0] == turned.ring[0] == 0.0
    assert turned.sun == pytest.approx(plain.sun, abs=1e-9)
    assert turned.ring == pytest.approx(plain.ring, abs=1e-9)


def test_a_phase_between_ring_and_sun_may_be_given() -> None:
    assert gp.planet_phasing(19, 31, 81, 5, ring_to_sun=0.25).ring_to_sun == 0.25
    assert [gp.planet_phasing(20, Z_p, 80, 5).ring_to_sun for Z_p in (30, 31)] == [0.5, 0.0]


@pytest.mark.parametrize("ring_to_sun", [math.nan, math.inf, "0.5"])
def test_a_phase_that_is_no_number_is_named(ring_to_sun: object) -> None:
    with pytest.raises(BindingError, match=r"planet_phasing: ring_to_sun is .*; expected a number of mesh periods"):
        gp.planet_phasing(19, 31, 81, 5, ring_to_sun=ring_to_sun)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((19, 31, 81, 3, None), r"unit: 3 equally spaced planets .* sum 100 must .* valid numbers: 1, 2, 4, 5, 10"),
        ((40, 38, 116, 5, None), r"valid numbers: 1, 2, 3, 4, 6, 12\)"),
        ((19, 31, 81, 2, [0.0, 1.0]), r"planet 1 at 1 rad does not fit .* nearest position is 1\.00531 rad"),
        ((19, 31, 81, 3, [0.0]), r"1 positions for 3 planets"),
        ((19, 81, 31, 5, None), r"needs Z_r near Z_s \+ 2 Z_p"),
        ((20, 30, 50, 5, None), r"needs Z_r near Z_s \+ 2 Z_p"),
        ((19, 31, 81, 2, [0.0, math.nan]), r"unit: positions are .*nan.*; expected angles, rad"),
        ((19, 31, 81, 2, "ab"), r"unit: positions are 'ab'; expected angles, rad"),
        ((19.5, 31, 81, 5, None), r"unit: Z_s is 19\.5; expected a whole number"),
    ],
)
def test_what_cannot_be_assembled_is_named(given: tuple[object, ...], message: str) -> None:
    with pytest.raises(BindingError, match=message):
        gp.check_assembly("unit", *given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("Z_s", "Z_r", "planets"), [(19, 81, 3), (19, 81, 4), (22, 82, 4), (20, 73, 5), (21, 72, 7), (30, 71, 2), (9, 30, 1)]
)
def test_positions_are_the_nearest_that_can_be_assembled(Z_s: int, Z_r: int, planets: int) -> None:
    positions = gp.planet_positions(Z_s, Z_r, planets)
    gp.check_assembly("set", Z_s, (Z_r - Z_s) // 2, Z_r, planets, positions)
    admissible = [2 * math.pi * k / (Z_s + Z_r) for k in range(Z_s + Z_r)]
    for n, psi in enumerate(positions):
        wanted = 2 * math.pi * n / planets
        assert abs(psi - wanted) == pytest.approx(min(abs(a - wanted) for a in admissible), abs=1e-12)
    equal = [2 * math.pi * n / planets for n in range(planets)]
    assert (list(positions) == pytest.approx(equal, abs=1e-12)) == ((Z_s + Z_r) % planets == 0)


def test_neighbours_that_touch_are_refused() -> None:
    # tip circles of 33 teeth's diameter, 50 teeth's radius: sin(pi / N) > 33 / 50 up to N = 4
    assert len(gp.planet_positions(19, 81, 4, Z_p=31)) == 4
    with pytest.raises(BindingError, match="5 planets do not fit around a sun of Z_s = 19 teeth: neighbours 72 degrees apart"):
        gp.planet_positions(19, 81, 5, Z_p=31)
    with pytest.raises(BindingError, match="8 planets do not fit"):
        gp.planet_positions(2, 4, 8)
    with pytest.raises(BindingError, match=r"planet_positions: Z_p is 2\.5; expected a whole number above 0"):
        gp.planet_positions(19, 81, 3, Z_p=2.5)
    with pytest.raises(BindingError, match="2 planets do not fit"):  # opposite each other, their tips touch over the sun
        gp.planet_positions(2, 20, 2, Z_p=9)
    assert len(gp.planet_positions(3, 21, 2, Z_p=9)) == 2
    assert gp.planet_positions(2, 20, 1, Z_p=9) == (0.0,)


def test_half_way_between_two_places_a_planet_takes_the_first_one() -> None:
    assert gp.planet_positions(30, 71, 2) == (0.0, pytest.approx(2 * math.pi * 50 / 101, rel=1e-15))
    assert gp.planet_positions(20, 70, 4) == pytest.approx([2 * math.pi * k / 90 for k in (0, 22, 45, 67)], rel=1e-15)


def test_a_place_may_be_off_by_a_millionth_of_a_tooth() -> None:
    tooth = 2 * math.pi / 100
    gp.check_assembly("unit", 19, 31, 81, 2, [0.3, 0.3 + (20 + 0.9e-6) * tooth])
    for off in (1.1e-6, -1.1e-6, 0.5):
        with pytest.raises(BindingError, match=r"unit: planet 1 at .* nearest position is"):
            gp.check_assembly("unit", 19, 31, 81, 2, [0.3, 0.3 + (20 + off) * tooth])


def test_phases_of_whole_periods_are_zero() -> None:
    """Not one, and not a rounding beside it."""
    for Z_s, Z_p, planets in ((30, 20, 5), (21, 24, 9), (19, 31, 5)):
        phasing = gp.planet_phasing(Z_s, Z_p, Z_s + 2 * Z_p, planets)
        for phase in (*phasing.sun, *phasing.ring):
            assert 0.0 <= phase < 1 - 1e-6
            assert phase == 0.0 or phase > 1e-6
        assert phasing.teeth == (Z_s, Z_s + 2 * Z_p)


@pytest.mark.parametrize("clockwise", [True, False])
def test_phases_of_planets_at_given_angles(clockwise: bool) -> None:
    """A quarter and 0.37 of a turn from the first: 20 and 80 teeth make 5 and 20, 7.4 and 29.6 periods."""
    at = [1.0, 1.0 + math.pi / 2, 1.0 + 0.74 * math.pi]
    phasing = gp.planet_phasing(20, 30, 80, 3, positions=at, clockwise=clockwise)
    assert phasing.sun == pytest.approx((0.0, 0.0, 0.4 if clockwise else 0.6), abs=1e-12)
    assert phasing.ring == pytest.approx((0.0, 0.0, 0.4 if clockwise else 0.6), abs=1e-12)


def test_a_phase_that_rounding_leaves_beside_a_whole_period_is_zero() -> None:
    for off, zero in ((1e-12, True), (-1e-12, True), (1e-9, False), (-1e-9, False)):
        phasing = gp.planet_phasing(20, 30, 80, 2, positions=(0.0, math.pi / 2 + off))
        assert (phasing.sun[1] == 0.0) == (phasing.ring[1] == 0.0) == zero, off
        assert 0.0 <= phasing.sun[1] < 1.0
