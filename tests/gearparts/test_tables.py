"""Tables over speed: few rows, what is beyond them, and limits of what is beyond them."""

from __future__ import annotations

import math
from typing import Any

import pytest
import sympy

import gearlib as gl
from gearparts.tables import at_zero, check_rows, extremes, interpolated
from tests.gearparts.laws import plain

X = sympy.Symbol("x", real=True)


def at(law: Any, *places: float) -> list[float]:
    return [float(plain(law).subs(X, sympy.Float(place))) for place in places]


def test_akima_s_curve_through_three_rows_is_a_parabola() -> None:
    """At equal distances all slopes are means of two secants; beyond the rows it goes on along the tangents."""
    rows = ((0.0, 9.0, 0.0), (1.0, 9.0, 1.0), (2.0, 9.0, 4.0))
    law = interpolated(rows, X, 2, "akima")
    assert at(law, -1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0) == pytest.approx([0.0, 0.0, 0.25, 1.0, 2.25, 4.0, 8.0], abs=1e-14)
    assert extremes(((-1.0, 1.0), (0.0, 0.0), (1.0, 1.0)), 1, "akima") == (0.0, 1.0)
    assert extremes(((1.0, 4.0), (2.0, 1.0), (4.0, 1.0)), 1, "akima")[0] < 1.0


@pytest.mark.parametrize("smoothness", ["linear", "akima"])
def test_through_two_rows_there_is_a_line(smoothness: str) -> None:
    rows = ((1.0, 2.0), (3.0, 8.0))
    assert at(interpolated(rows, X, 1, smoothness), -1.0, 1.0, 2.0, 5.0) == [-4.0, 2.0, 5.0, 14.0]
    assert at_zero(rows, 1, smoothness) == -1.0
    assert extremes(rows, 1, smoothness) == (2.0, 8.0)


@pytest.mark.parametrize("smoothness", ["linear", "constant", "akima"])
def test_a_single_row_is_a_constant(smoothness: str) -> None:
    assert interpolated(((1.0, 2.0, 7.0),), X, 2, smoothness) == 7.0
    assert at_zero(((1.0, 2.0, 7.0),), 2, smoothness) == 7.0
    assert extremes(((1.0, 2.0, 7.0),), 2, smoothness) == (7.0, 7.0)


def test_rows_of_a_curve_stand_in_the_order_of_their_first_column() -> None:
    """Whatever the others hold; only steps may have two rows at one place."""
    falling = ((-3.0, 9.0), (-1.0, 0.0), (2.0, -7.0))
    assert check_rows("T", falling, 2) == check_rows("T", falling, 2, steps=True) == falling
    assert check_rows("T", ((0.0, 1.0), (0.0, 2.0)), 2, steps=True) == ((0.0, 1.0), (0.0, 2.0))
    for rows, steps, said in (((0, 1), (0, 2)), False, "increase"), (((1, 1), (0, 2)), True, "not decrease"):
        with pytest.raises(gl.GearlibError, match=f"the first column must {said}$"):
            check_rows("T", rows, 2, steps=steps)


def test_steps_hold_each_row_up_to_the_next_one() -> None:
    law = interpolated(((1.0, 2.0), (3.0, 8.0), (4.0, 5.0)), X, 1, "constant")
    assert at(law, -9.0, 1.0, 2.9, 3.0, 3.9, 4.0, 9.0) == [2.0, 2.0, 2.0, 8.0, 8.0, 5.0, 5.0]
    assert at_zero(((1.0, 2.0), (3.0, 8.0)), 1, "constant") == 2.0
    assert at_zero(((-2.0, 2.0), (-1.0, 8.0), (1.0, 5.0)), 1, "constant") == 8.0


@pytest.mark.parametrize("smoothness", ["linear", "akima"])
def test_what_is_beyond_the_last_row_ends_at_a_limit(smoothness: str) -> None:
    """It falls to the lower one or rises to the upper one; before the first row and without a slope there is none."""
    falling, rising, level = ((0.0, 6.0), (1.0, 4.0)), ((0.0, 4.0), (1.0, 6.0)), ((0.0, 4.0), (1.0, 4.0))
    limits = (1.0, 7.0)
    assert at(interpolated(falling, X, 1, smoothness, limits), -1.0, 2.0, 2.5, 2.75, 9.0) == [8.0, 2.0, 1.0, 1.0, 1.0]
    assert at(interpolated(rising, X, 1, smoothness, limits), -3.0, 1.25, 1.5, 9.0) == [-2.0, 6.5, 7.0, 7.0]
    assert at(interpolated(level, X, 1, smoothness, limits), -3.0, 9.0) == [4.0, 4.0]
    assert at(interpolated(rising, X, 1, smoothness, (0.0, math.inf)), 9.0) == [22.0]
    assert at(interpolated(falling, X, 1, smoothness), 9.0) == [-12.0]


def test_akima_s_curve_ends_at_a_limit_along_its_last_tangent() -> None:
    """The parabola -x**2 falls by 4 a second at its last row; x**2 begins with 2 a second at 1."""
    falling = interpolated(((0.0, 0.0), (1.0, -1.0), (2.0, -4.0)), X, 1, "akima", (-6.0, 0.0))
    expected = [-0.25, -2.25, -5.0, -6.0, -6.0, -6.0]
    assert at(falling, 0.5, 1.5, 2.25, 2.5, 2.75, 3.0) == pytest.approx(expected, abs=1e-14)
    rising = interpolated(((1.0, 1.0), (2.0, 4.0), (3.0, 9.0)), X, 1, "akima", (0.0, 12.0))
    assert at(rising, -1.0, 1.5, 2.5, 3.25, 3.75) == pytest.approx([-3.0, 2.25, 6.25, 10.5, 12.0], abs=1e-14)


def test_a_limit_beyond_three_rows_leaves_what_is_between_them() -> None:
    law = interpolated(((0.0, 8.0), (1.0, 4.0), (2.0, 3.0)), X, 1, "linear", (0.0, math.inf))
    assert at(law, 0.5, 1.5, 3.0, 4.5, 5.0, 6.0) == [6.0, 3.5, 2.0, 0.5, 0.0, 0.0]
