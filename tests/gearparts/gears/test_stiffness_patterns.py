"""Stiffness of a tooth pair along its path of contact."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gearparts as gp
from gearparts.gears.stiffness_patterns import cai_pair_stiffness


@pytest.mark.parametrize("beta", [0.0, 0.2, 0.45])
def test_cai_s_pair_is_stiffest_in_the_middle_of_its_contact_and_symmetric(beta: float) -> None:
    """At the middle it has the stiffness of a single pair."""
    pair = gp.GearPair(20, 40, m_n=3e-3, width=0.02, beta=beta)
    whole = pair.contact_ratio + pair.overlap_ratio
    shares = np.linspace(0.0, 1.0, 21)
    law = np.array([cai_pair_stiffness(pair, u * whole) for u in shares]) / (pair.single_stiffness * pair.width)
    assert law[10] == pytest.approx(1.0, rel=1e-12)
    assert law == pytest.approx(law[::-1], rel=1e-12)
    assert (np.diff(law[:11]) > 0).all()
    assert [cai_pair_stiffness(pair, u) for u in (-0.01, 1.01 * whole)] == [0.0, 0.0]


def test_cai_s_helical_law_by_hand() -> None:
    """Cai 1995: exp(C |X / (1.125 eps_alpha)|**3) with C = 0.322 (beta - 5) + 0.23 b / H - 23.26, beta in degrees, X from the middle."""
    pair = gp.GearPair(20, 40, m_n=3e-3, width=0.02, beta=math.radians(20))
    whole = pair.contact_ratio + pair.overlap_ratio
    C = 0.322 * 15 + 0.23 * 0.02 / (2.25 * 3e-3) - 23.26
    expected = math.exp(C * (0.3 / (1.125 * pair.contact_ratio)) ** 3)
    for X in (-0.3, 0.3):
        found = cai_pair_stiffness(pair, whole / 2 + X) / (pair.single_stiffness * pair.width)
        assert found == pytest.approx(expected, rel=1e-12)
