"""Named units by what they are made of."""

from __future__ import annotations

import pytest

from gearlib.language.units import UNITS, dimension


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
