"""Stiffness of a tooth pair along its path of contact."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gearparts as gp
from gearlib.errors import ArgumentError, BoundError
from gearparts.gears.stiffness_patterns import cai_pair_stiffness, cai_stiffness


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


@pytest.mark.parametrize("beta", [0.0, 0.35])
def test_a_pattern_is_the_sum_of_the_pairs_in_contact_in_the_middle_of_each_step(beta: float) -> None:
    """Rows over the phase, relative to their mean; a mean that is given scales them."""
    pair = gp.GearPair(20, 40, m_n=3e-3, width=0.02, beta=beta)
    path = pair.contact_ratio + pair.overlap_ratio
    phases = [2 * math.pi * (k + 0.5) / 8 for k in range(8)]
    sums = [sum(cai_pair_stiffness(pair, (k + 0.5) / 8 + n) for n in range(5) if (k + 0.5) / 8 + n < path) for k in range(8)]
    for mean, scaled in ((None, np.mean(sums)), (0.5, 0.5), (3e8, 3e8)):
        pattern = cai_stiffness(pair, 8, mean)
        assert pattern.mean == pytest.approx(scaled, rel=1e-14)
        assert [phase for phase, _ in pattern.table] == pytest.approx(phases, rel=1e-15)
        assert [value for _, value in pattern.table] == pytest.approx(np.array(sums) / np.mean(sums), rel=1e-13)


def test_a_pattern_has_eight_rows_or_more_and_a_positive_mean() -> None:
    pair = gp.GearPair(20, 40, m_n=3e-3, width=0.02)
    assert len(cai_stiffness(pair).table) == 32
    with pytest.raises(ArgumentError, match=r"samples is 7"):
        cai_stiffness(pair, 7)
    for mean in (0.0, -1.0, math.inf, "1"):
        with pytest.raises(ArgumentError, match=rf"^cai_stiffness\(mean={mean!r}\): expected a positive stiffness, N/m$"):
            cai_stiffness(pair, 8, mean)  # type: ignore[arg-type]
    for call in (lambda: cai_stiffness(3), lambda: cai_pair_stiffness(None, 0.5)):  # type: ignore[arg-type]
        with pytest.raises(ArgumentError, match=r"^pair is (3|None); expected a GearPair$"):
            call()
    with pytest.raises(ArgumentError, match="place is 'x'"):
        cai_pair_stiffness(pair, "x")  # type: ignore[arg-type]


def test_a_wide_helical_pair_of_equal_stiffness_is_the_last_one_that_cai_s_formula_is_for() -> None:
    """With C = -0.5 the ends of contact are still the softest; with C = 0.5 they would be stiffer than the middle."""
    for C in (-0.5, 0.5):
        width = (C + 23.26 - 0.322 * 15) / 0.23 * 2.25 * 3e-3
        pair = gp.GearPair(20, 40, m_n=3e-3, width=width, beta=math.radians(20))
        if C > 0:
            with pytest.raises(BoundError, match=rf"does not hold for a helix of 20 degrees and a width of {width:g} m"):
                cai_pair_stiffness(pair, 0.0)
        else:
            half = (pair.contact_ratio + pair.overlap_ratio) / 2 / (1.125 * pair.contact_ratio)
            expected = pair.single_stiffness * width * math.exp(-0.5 * half**3)
            assert cai_pair_stiffness(pair, 0.0) == pytest.approx(expected, rel=1e-9)
