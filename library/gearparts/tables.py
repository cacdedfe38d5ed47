"""Tables over a speed: friction coefficients, bearing torques, efficiencies, interpolated between their rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gearlib as gl
from gearlib.errors import BindingError

Rows = tuple[tuple[float, ...], ...]


def interpolated(rows: Rows, x: Any, column: int = 1) -> Any:
    """A column of a table as a piecewise linear function of the first one; no events are made at its corners.

    Beyond both ends the outermost two rows are extrapolated, as in Modelica. One row is a constant.

    Parameters
    ----------
    rows : tuple of tuples of float
        Checked with `check_rows`.
    x : expression
        In the unit of the first column.
    column : int
        Which column, from 1.

    Examples
    --------
    >>> import sympy
    >>> x = sympy.Symbol("x", real=True)
    >>> interpolated(((0.0, 0.5),), x)
    0.5
    >>> law = interpolated(((0.0, 1.0), (2.0, 3.0), (4.0, 3.0)), x).args[0]
    >>> [float(law.subs(x, at)) for at in (-1.0, 1.0, 3.0, 9.0)]
    [0.0, 2.0, 3.0, 3.0]
    """
    if len(rows) == 1:
        return rows[0][column]
    lines = []
    for left, right in zip(rows, rows[1:], strict=False):
        slope = (right[column] - left[column]) / (right[0] - left[0])
        lines.append((left[column] + slope * (x - left[0]), x < right[0]))
    lines[-1] = (lines[-1][0], True)
    return piecewise_without_events(*lines)


def piecewise_without_events(*branches: Any) -> Any:
    """A `Piecewise` whose conditions are evaluated at every moment; plain where its branches are all the same."""
    law = gl.Piecewise(*branches)
    return gl.no_event(law) if isinstance(law, gl.Piecewise) else law


def at_zero(rows: Rows, column: int = 1) -> float:
    """The value of `interpolated` at zero.

    Examples
    --------
    >>> at_zero(((0.0, 0.5), (1.0, 0.75)))
    0.5
    """
    if len(rows) == 1:
        return rows[0][column]
    i = max(k for k in range(len(rows) - 1) if k == 0 or rows[k][0] <= 0)
    left, right = rows[i], rows[i + 1]
    return left[column] - left[0] * (right[column] - left[column]) / (right[0] - left[0])


def check_rows(owner: str, rows: Sequence[Any], columns: int) -> Rows:
    """Rows of numbers, with the first column increasing.

    Raises
    ------
    BindingError
        Anything else; ``owner`` says whose table it is.

    Examples
    --------
    >>> check_rows("Clutch.mu_pos", [[0, 0.5]], 2)
    ((0.0, 0.5),)
    """
    try:
        table = tuple(tuple(float(number) for number in row) for row in rows)
    except TypeError:
        raise BindingError(f"{owner} is {rows!r}; expected rows of {columns} numbers") from None
    if not table or any(len(row) != columns for row in table):
        raise BindingError(f"{owner} is {rows!r}; expected one or more rows of {columns} numbers")
    if any(not row[0] < following[0] for row, following in zip(table, table[1:], strict=False)):
        raise BindingError(f"{owner} is {rows!r}; the first column must increase")
    return table
