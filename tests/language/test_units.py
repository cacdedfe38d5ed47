"""Named units by what they are made of."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from gearlib.errors import DeclarationError
from gearlib.language.units import BASE, INSTEAD, NONE, SECOND, UNITS, dimension, name_of


@pytest.mark.parametrize(
    ("unit", "same"),
    [
        ("Hz", "1/s"), ("N", "kg.m/s2"), ("Pa", "N/m2"), ("J", "N.m"), ("W", "J/s"), ("C", "A.s"), ("V", "W/A"), ("Ohm", "V/A"),
        ("F", "C/V"), ("H", "Wb/A"), ("Wb", "V.s"), ("T", "Wb/m2"), ("rad", "1"),
    ],
)  # fmt: skip
def test_named_units_are_those_of_the_si(unit: str, same: str) -> None:
    assert dimension(unit) == dimension(same) is not None


def test_base_units_are_independent() -> None:
    assert sorted(sum(map(abs, UNITS[unit])) for unit in ("kg", "m", "s", "K", "A")) == [1] * 5
    assert len({UNITS[unit] for unit in ("1", "kg", "m", "s", "K", "A")}) == 6


@pytest.mark.parametrize(
    ("unit", "exponents"),
    [
        ("kg.m2/s3", (1, 2, -3, 0, 0)), ("W/(m2.K)", (1, 0, -3, -1, 0)), ("1/s", (0, 0, -1, 0, 0)), ("m-2", (0, -2, 0, 0, 0)),
        ("1", (0, 0, 0, 0, 0)),
        ("N.m.s/rad", (1, 2, -1, 0, 0)), ("A.s-1/m-3", (0, 3, -1, 0, 1)),
        ("m-123", (0, -123, 0, 0, 0)), ("m1234", (0, 1234, 0, 0, 0)), ("m123", (0, 123, 0, 0, 0)), ("/s", (0, 0, -1, 0, 0)),
    ],
)  # fmt: skip
def test_exponents_add_up_on_both_sides_of_the_slash(unit: str, exponents: tuple[int, ...]) -> None:
    assert dimension(unit) == tuple(map(Fraction, exponents))


def test_any_has_no_dimension_and_names_are_written_in_base_units() -> None:
    assert dimension("any") is None
    assert name_of(None) == "any"
    assert name_of(NONE) == "1"
    assert name_of(dimension("s")) == name_of(SECOND) == "s"
    assert name_of((Fraction(1), Fraction(-2), Fraction(1, 2), Fraction(0), Fraction(3))) == "kg.m-2.s1/2.A3"
    for unit in UNITS:
        assert dimension(name_of(dimension(unit))) == dimension(unit)


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("rpm", r"the unit 'rpm' is not accepted: declare 'rad/s' instead, and give values in that unit \(1 rpm is 0\.1047"),
        ("1/min", r"the unit '1/min' is not accepted: declare 'rad/s'"),
        ("Nmm/rad", r"has the factor 'Nmm', which is not accepted: declare 'N\.m'"),
        ("m/min", r"the unit 'm/min' has the factor 'min', which is not accepted: declare 's' instead"),
        ("mm2", r"declare 'm' instead.*\(1 mm is 1e-3 m\)"),
        ("N*m", r"the unit 'N\*m' cannot be parsed: join factors by dots"), ("m^2/s", r"'m\^2', which cannot be parsed"),
        ("N m", "cannot be parsed"),
        ("furlong", r"the unit 'furlong' is not known; known: 1, rad, kg, .*, any"), ("m/", "the unit 'm/' is not known"),
        ("m12345", "not known"),
        ("m-1234", "not known"), ("m/s/s", "the factor 's/s', which is not known"), ("", "^$"),
        ("10", "'10' is not known"),
        ("N/(sx", "not known"), ("N/xs)", "not known"), ("1-3", "not known"), ("1000.N", "has the factor '1000', which is not known"),
        ("1/12", "factor '12'"),
        ("m..s", "has the factor '', which is not known"), ("2m", "not known"),
    ],
)  # fmt: skip
def test_other_units_are_refused_with_the_one_to_declare(unit: str, message: str) -> None:
    if not unit:
        assert dimension(unit) == NONE
        return
    with pytest.raises(DeclarationError, match=message):
        dimension(unit)


def test_units_outside_the_si_say_what_they_are_in_it() -> None:
    """Each replacement is a unit that is accepted, and the value of one is in it."""
    inch, foot, pound = 0.0254, 0.3048, 0.45359237
    known = {
        "rpm": 2 * math.pi / 60, "rev": 2 * math.pi, "deg": math.pi / 180, "in": inch, "ft": 12 * inch, "lb": pound, "lbf": pound * 9.80665,
        "kWh": 3.6e6,
        "hp": 550 * foot * pound * 9.80665, "PS": 75 * 9.80665, "mph": 1609.344 / 3600, "kph": 1 / 3.6,
        "bar": 1e5, "h": 3600.0, "Wh": 3600.0, "min": 60.0,
    }  # fmt: skip
    prefixes = {"k": 1e3, "M": 1e6, "G": 1e9, "m": 1e-3, "u": 1e-6, "c": 1e-2}
    for unit, (si, size) in INSTEAD.items():
        assert dimension(si) is not None
        if unit in known:
            assert float(size.split()[0]) == pytest.approx(known[unit], rel=1e-8), unit
        elif unit[1:] == si and unit[0] in prefixes:
            assert size == "0.01" or float(size.split()[0]) == prefixes[unit[0]], unit
    assert len(BASE) == 5
