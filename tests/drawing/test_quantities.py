"""Units of axes: factors between them, spelling, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.drawing.quantities import in_unit, spelled
from gearlib.errors import ArgumentError

FACTORS = [
    ("m", "nm", 1e9), ("m", "um", 1e6), ("m", "cm", 1e2), ("m", "km", 1e-3), ("N/m", "GN/m", 1e-9), ("N/m", "N/mm", 1e-3),
    ("m/s2", "mm/s2", 1e3), ("kg.m2", "kg.cm2", 1e4), ("rad", "deg", 180 / np.pi), ("rad", "°", 180 / np.pi), ("rad", "rev", 0.5 / np.pi),
    ("rad", "arcmin", 10800 / np.pi), ("rad/s", "1/min", 30 / np.pi), ("rad/s", "rpm", 30 / np.pi), ("m/s", "km/h", 3.6),
    ("Pa", "bar", 1e-5), ("Pa", "MPa", 1e-6), ("s", "min", 1 / 60), ("s", "h", 1 / 3600), ("1", "%", 100.0), ("J", "kWh", 1 / 3.6e6),
    ("W", "W", 1.0),
]  # fmt: skip
OTHER = [("m", "s"), ("m", "m2"), ("m/s", "m"), ("N.m", "N"), ("rad", "1/min"), ("m", "xm"), ("m", "1-2-3")]
SPELLED = [
    ("N.m/rad", "N·m/rad"), ("W/(m2.K)", "W/(m²·K)"), ("m2/m", "m"), ("m/m", ""), ("s-1", "1/s"), ("1/s2", "1/s²"), ("m-2", "1/m²"),
    ("m12", "m¹²"), ("N·m·s²", "N·m·s²"), ("a..b", "a·b"), ("5x", "5x"),
]  # fmt: skip


@pytest.mark.parametrize(("unit", "wanted", "factor"), FACTORS)
def test_factors_of_units(unit: str, wanted: str, factor: float) -> None:
    assert in_unit(unit, wanted).factor == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(("unit", "wanted"), OTHER)
def test_other_units_are_refused(unit: str, wanted: str) -> None:
    with pytest.raises(ArgumentError, match=f"units: '{wanted}' is not a unit for values in {spelled(unit)}"):
        in_unit(unit, wanted)


@pytest.mark.parametrize(("unit", "text"), SPELLED)
def test_units_are_spelled_with_one_stroke(unit: str, text: str) -> None:
    assert spelled(unit) == text
