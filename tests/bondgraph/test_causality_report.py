"""Assignments in words."""

from __future__ import annotations

from typing import Any

from gearlib.bondgraph import BondGraph, C, I, One, R, Se, Zero, assign_causality


def test_loops_are_reported_by_their_resistances() -> None:
    """Two loops apart, each of two resistances at one effort behind a third."""
    bonds: list[Any] = []
    for first in (10, 1):
        v, z = One(), Zero()
        bonds += [
            (first, Se(), v),
            (first + 1, v, R()),
            (first + 2, v, z),
            (first + 3, z, R()),
            (first + 4, z, I()),
            (first + 5, v, C()),
        ]
    report = assign_causality(BondGraph(*bonds)).report()
    assert report == "integral causality: 5, 6, 14, 15\nderivative causality: none\nalgebraic loops: 2 and 4; 11 and 13"
