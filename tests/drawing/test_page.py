"""Curves of pages: long ones are thinned to as many points as a chart may have."""

from __future__ import annotations

import numpy as np

from gearlib.drawing.page import MOST_POINTS, thinned


def test_a_long_curve_has_as_many_points_as_are_allowed() -> None:
    """Both ends, and two of each piece, where neither end is an extreme."""
    x = np.linspace(0, 1, 3 * MOST_POINTS)
    y = np.random.default_rng(3).normal(size=len(x))
    y[[0, -1]] = 0.0
    a, b = thinned(x, y)
    assert len(a) == len(b) == MOST_POINTS
    assert (a[0], a[-1], b[0], b[-1]) == (0, 1, 0, 0)
