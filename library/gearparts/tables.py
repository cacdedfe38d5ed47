"""Interpolation of tables over speed: friction coefficients, bearing torques, efficiencies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import sympy

import gearlib as gl
from gearlib.arguments import is_real, shown
from gearlib.errors import BindingError

Rows = tuple[tuple[float, ...], ...]
IDEAL_MESH: Rows = ((0.0, 1.0, 1.0),)  # speed, and the efficiencies with either gear driving
NO_FRICTION: Rows = ((0.0, 0.0),)  # speed and friction torque
SMOOTHNESS = ("linear", "constant", "akima")  # Modelica's LinearSegments, ConstantSegments and ContinuousDerivative


def interpolated(
    rows: Rows, x: Any, column: int = 1, smoothness: str = "linear", limits: tuple[float, float] = (-math.inf, math.inf)
) -> Any:  # fmt: skip
    """A column of a table as a function of the first column; only its jumps raise events.

    Beyond both ends it is extrapolated linearly, from the outermost two rows or with the slope at the end, as in Modelica. A single row
    is a constant.

    Parameters
    ----------
    rows : tuple of tuples of float
        Validated by `check_rows`.
    x : expression
        In the unit of the first column.
    column : int
        Column number, from 1.
    smoothness : {"linear", "constant", "akima"}
        Piecewise linear; piecewise constant, holding each row's value up to the next row; or Akima cubics with a continuous derivative.
    limits : tuple of float
        Values at which the extrapolation beyond the last row ends, such as 0 and 1 of an efficiency.

    References
    ----------
    H. Akima, "A new method of interpolation and smooth curve fitting based on local procedures", Journal of the ACM 17 (1970),
    589-602. https://doi.org/10.1145/321607.321609

    Examples
    --------
    >>> import sympy
    >>> x = sympy.Symbol("x", real=True)
    >>> interpolated(((0.0, 0.5),), x)
    0.5
    >>> law = interpolated(((0.0, 1.0), (2.0, 3.0), (4.0, 3.0)), x).args[0]
    >>> [float(law.subs(x, at)) for at in (-1.0, 1.0, 3.0, 9.0)]
    [0.0, 2.0, 3.0, 3.0]
    >>> law = interpolated(((0.0, 4.0), (2.0, 3.0)), x, limits=(0.0, 5.0)).args[0]
    >>> [float(law.subs(x, at)) for at in (-1.0, 4.0, 9.0)]
    [4.5, 2.0, 0.0]
    """
    if len(rows) == 1:
        return rows[0][column]
    if smoothness == "constant":
        steps = [(left[column], x < right[0]) for left, right in pairwise(rows)]
        return gl.Piecewise(*steps, (rows[-1][column], True))
    slopes = _akima_slopes(rows, column) if smoothness == "akima" and len(rows) > 2 else None
    lines = []
    for i, (left, right) in enumerate(pairwise(rows)):
        width, rise, s = right[0] - left[0], (right[column] - left[column]) / (right[0] - left[0]), x - left[0]
        if slopes is None:
            law = left[column] + rise * s
        else:
            second, third = 3 * rise - 2 * slopes[i] - slopes[i + 1], slopes[i] + slopes[i + 1] - 2 * rise
            law = left[column] + s * (slopes[i] + s * (second / width + s * third / width**2))
        lines.append((law, x < right[0]))
    if slopes is None:
        lines[-1] = (lines[-1][0], True)
    else:
        first, last = rows[0], rows[-1]
        lines = [(first[column] + slopes[0] * (x - first[0]), x < first[0]), *lines]
        lines.append((last[column] + slopes[-1] * (x - last[0]), True))
    rise = _last_slope(rows, column, smoothness)
    limit = limits[0] if rise < 0 else limits[1]
    if rise and math.isfinite(limit):
        lines[-1:] = [(lines[-1][0], x < reaches(rows, column, limit, smoothness)), (limit, True)]
    return piecewise_without_events(*lines)


def reaches(rows: Rows, column: int, limit: float, smoothness: str = "linear") -> float:
    """Where the extrapolation beyond the last row is at a limit; infinity if it does not come there.

    Examples
    --------
    >>> reaches(((0.0, 0.5), (2.0, 0.75)), 1, 1.0), reaches(((0.0, 0.5), (2.0, 0.25)), 1, 1.0)
    (4.0, inf)
    """
    last, rise = rows[-1], _last_slope(rows, column, smoothness)
    to_go = limit - last[column]
    return last[0] if to_go == 0 else last[0] + to_go / rise if to_go * rise > 0 else math.inf


def _last_slope(rows: Rows, column: int, smoothness: str) -> float:
    """Slope of the extrapolation beyond the last row."""
    if len(rows) == 1 or smoothness == "constant":
        return 0.0
    if smoothness == "akima" and len(rows) > 2:
        return _akima_slopes(rows, column)[-1]
    left, right = rows[-2:]
    return (right[column] - left[column]) / (right[0] - left[0])


def _akima_slopes(rows: Rows, column: int) -> list[float]:
    """Slope of Akima's curve at each row: a mean of the secants on both sides, weighted towards the one that changes less."""
    m = [(right[column] - left[column]) / (right[0] - left[0]) for left, right in pairwise(rows)]
    m = [3 * m[0] - 2 * m[1], 2 * m[0] - m[1], *m, 2 * m[-1] - m[-2], 3 * m[-1] - 2 * m[-2]]
    slopes = []
    for i in range(len(rows)):
        before, after = abs(m[i + 1] - m[i]), abs(m[i + 3] - m[i + 2])
        even = before + after == 0
        slopes.append((m[i + 1] + m[i + 2]) / 2 if even else (after * m[i + 1] + before * m[i + 2]) / (before + after))
    return slopes


def piecewise_without_events(*branches: Any) -> Any:
    """A `Piecewise` whose conditions are evaluated continuously; a plain expression if all branches are equal."""
    law = gl.Piecewise(*branches)
    return gl.no_event(law) if isinstance(law, sympy.Piecewise) else law


def at_zero(rows: Rows, column: int = 1, smoothness: str = "linear") -> float:
    """The value of `interpolated` at zero.

    Examples
    --------
    >>> at_zero(((0.0, 0.5), (1.0, 0.75)))
    0.5
    """
    for row in rows:
        if row[0] == 0:
            return row[column]
    x = sympy.Symbol("x", real=True)
    law = interpolated(rows, x, column, smoothness)
    law = law.args[0] if getattr(law, "func", None) == gl.no_event(x).func else law  # the argument of no_event
    return float(law.subs(x, 0)) if isinstance(law, sympy.Basic) else float(law)


def extremes(rows: Rows, column: int = 1, smoothness: str = "linear") -> tuple[float, float]:
    """The least and the largest value of `interpolated` at the rows and between them, for speeds from zero on.

    Only Akima's curve goes beyond its rows.

    Examples
    --------
    >>> extremes(((0.0, 1.0), (1.0, 0.0), (2.0, 0.0), (3.0, 1.0)), 1, "akima")
    (-0.125, 1.0)
    """
    import numpy as np

    found = [row[column] for row in rows]
    if smoothness == "akima" and len(rows) > 2:
        for (left, right), (a, b) in zip(pairwise(rows), pairwise(_akima_slopes(rows, column)), strict=True):
            width, rise = right[0] - left[0], right[column] - left[column]
            # its slope is p s**2 + q s + r
            p, q, r = 3 * width * (a + b) - 6 * rise, 6 * rise - width * (4 * a + 2 * b), width * a
            flat = [s.real for s in np.roots([p, q, r]) if s.imag == 0 and 0 < s.real < 1 and left[0] + s.real * width >= 0]
            found += [left[column] + s * (r + s * (q / 2 + s * p / 3)) for s in flat]
    return float(min(found)), float(max(found))


def check_rows(owner: str, rows: Sequence[Any], columns: int, steps: bool = False) -> Rows:
    """Rows of numbers, with an increasing first column; ``steps``: two rows may have the same number there.

    Raises
    ------
    BindingError
        Anything else; ``owner`` names the table in the message.

    Examples
    --------
    >>> check_rows("Clutch.mu_pos", [[0, 0.5]], 2)
    ((0.0, 0.5),)
    """
    try:
        table = tuple(tuple(row) for row in rows)
    except Exception:  # not rows; a user's sequence may fail
        table = ()
    if not table or any(len(row) != columns for row in table):
        raise BindingError(f"{owner} is {shown(rows)}; expected one or more rows of {columns} numbers")
    if not all(is_real(number) for row in table for number in row):
        raise BindingError(f"{owner} is {shown(rows)}; expected finite numbers in rows of {columns}")
    table = tuple(tuple(float(number) for number in row) for row in table)
    if any(following[0] < row[0] or (following[0] == row[0] and not steps) for row, following in pairwise(table)):
        raise BindingError(f"{owner} is {shown(rows)}; the first column must {'not decrease' if steps else 'increase'}")
    return table
