"""Curves of pages: what a chart holds, of long ones as many points as it may have."""

from __future__ import annotations

import json
import re

import numpy as np

from gearlib.drawing.page import MOST_POINTS, Curve, chart, thinned


def test_a_long_curve_has_as_many_points_as_are_allowed() -> None:
    """Both ends, and two of each piece, where neither end is an extreme."""
    x = np.linspace(0, 1, 3 * MOST_POINTS)
    y = np.random.default_rng(3).normal(size=len(x))
    y[[0, -1]] = 0.0
    a, b = thinned(x, y)
    assert len(a) == len(b) == MOST_POINTS
    assert (a[0], a[-1], b[0], b[-1]) == (0, 1, 0, 0)


def test_a_chart_holds_its_curves_and_the_texts_at_points() -> None:
    html = chart([Curve("", np.arange(2.0), np.array([3.0, -1.5]), "red")], "x", "y", points=[(1.0, 2.0, "here")], height=99)
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', html)
    curve = {"name": "", "x": [0, 1], "y": [3, -1.5], "colour": "red", "dash": ""}
    point = {"x": 1, "y": 2, "text": "here"}
    assert json.loads(data) == {
        "x": "x", "y": "y", "height": 99, "events": [], "points": [point], "curves": [curve], "ylim": None,
    }  # fmt: skip


def test_a_chart_holds_numbers_of_seven_digits_and_gaps() -> None:
    y = np.array([1.0 / 3.0, np.nan, -2.0, np.inf])
    html = chart([Curve("a < b", np.arange(4.0), y, "#123456", "4 2")], "time, s", "x", events=[0.5], ylim=(-1.0, 2.0))
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', html)
    assert "<" not in data
    curve = {"name": "a < b", "x": [0, 1, 2, 3], "y": [0.3333333, None, -2, None], "colour": "#123456", "dash": "4 2"}
    assert json.loads(data) == {
        "x": "time, s", "y": "x", "height": 260, "events": [0.5], "points": [], "curves": [curve], "ylim": [-1, 2],
    }  # fmt: skip
