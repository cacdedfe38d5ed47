"""The involute function against its printed tables, and its inverse for all pressure angles below a right one."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gearparts as gp
from gearparts.gears.involute import involute, involute_angle


@pytest.mark.parametrize(("degrees", "printed"), [(14.5, 0.0055448), (20, 0.0149044), (25, 0.0299753), (45, 0.2146018)])
def test_values_of_the_tables(degrees: float, printed: float) -> None:
    assert involute(math.radians(degrees)) == pytest.approx(printed, abs=5e-8)
    assert math.degrees(involute_angle(printed)) == pytest.approx(degrees, abs=1e-3)


def test_the_inverse_holds_up_to_a_right_angle() -> None:
    for alpha in (*np.linspace(0.01, 1.57, 157).tolist(), 1.5707, 1.570796):
        assert involute_angle(involute(alpha)) == pytest.approx(alpha, rel=1e-12), alpha
    assert involute_angle(0.0) == 0.0
    for value in (1e-12, 1e-10):  # tan(a) - a tends to a**3 / 3
        assert involute_angle(value) == pytest.approx(math.cbrt(3 * value), rel=1e-6)


def test_the_centre_distance_of_a_helix_that_is_almost_along_the_pitch_circle() -> None:
    """Without profile shift it is half the sum of the reference diameters, at any helix angle."""
    for beta in (0.0, 0.3, 1.5, 1.56, 1.57):
        pair = gp.GearPair(20, 40, m_n=3e-3, width=0.02, beta=beta)
        assert pair.centre_distance == pytest.approx(3e-3 / math.cos(beta) * 30, rel=1e-9)
