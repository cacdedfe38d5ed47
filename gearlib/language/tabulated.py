"""Tables as expressions: piecewise polynomials of one variable, and bilinear maps of two.

They are differentiated like any expression, so that Jacobians and linear models have the exact slopes of the pieces. Corners raise no
events unless requested; jumps always do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.arguments import shown
from gearlib.errors import ArgumentError
from gearlib.language.expressions import no_event

Floats = NDArray[np.float64]
NO_NUMBERS = (sympy.nan, sympy.zoo, sympy.oo, sympy.S.NegativeInfinity, sympy.I)
MOST_PIECES = 200  # per expression; each generates code of its own


class Tabulated(ABC):
    """Interpolated data points; an input may be bound to them as a function of time."""

    @abstractmethod
    def expression(self, x: Any, events: bool) -> Any:
        """The interpolant as a function of an expression."""


def is_symbolic(value: Any) -> bool:
    """Whether a value is an expression of variables, or time."""
    return isinstance(value, sympy.Expr)


def _check_arguments(said: str, *arguments: Any) -> None:
    """Refuse arguments that are not finite and real, or contain branches: substituted into every piece, these would multiply."""
    for x in arguments:
        if isinstance(x, sympy.Basic) and x.has(*NO_NUMBERS):
            raise ArgumentError(f"{said} is given {shown(x)}; expected a finite real number, or an expression of such numbers")
        if isinstance(x, sympy.Basic) and x.has(sympy.Piecewise, sympy.Max, sympy.Min, sympy.Abs, sympy.sign):
            raise ArgumentError(
                f"{said} is given an expression with branches; give this to a variable with an equation of its own, or to a part such as "
                "gearparts.blocks.Gain(k=1.0, u=...), and the table its output y"
            )


def piecewise_polynomial(said: str, x: Any, knots: Floats, coefficients: Floats, events: bool) -> Any:
    """Piecewise polynomial with ``coefficients`` in powers of ``x`` minus each knot, up to the next; constant outside.

    Parameters
    ----------
    said : str
        Name in error messages.
    x : expression
    knots : array, shape (n,)
        Nondecreasing; equal knots make a jump, from the first of them to the last.
    coefficients : array, shape (4, n)
    events : bool
        Whether corners raise events as well.

    Examples
    --------
    >>> x = sympy.Symbol("x", real=True)
    >>> law = piecewise_polynomial("a table", x, np.array([0.0, 2.0]), np.array([[1.0, 5.0], [2.0, 0], [0, 0], [0, 0]]), True)
    >>> [float(law.subs(x, at)) for at in (-1, 0.5, 3)]
    [1.0, 2.0, 5.0]
    """
    _check_arguments(said, x)
    if len(knots) > MOST_PIECES:
        raise ArgumentError(
            f"{said} has {len(knots)} points; in an equation, at most {MOST_PIECES} are taken. Leave the input unbound and give the "
            "table to simulate(inputs={...}), or use fewer points"
        )
    ends_a_run = np.append(knots[1:] != knots[:-1], True)
    kept = ends_a_run | np.roll(ends_a_run, 1)  # of several equal knots, what is between the first and the last has no width
    knots, coefficients = knots[kept], coefficients[:, kept]
    jumps = [k for k in range(1, len(knots)) if knots[k] == knots[k - 1] and coefficients[0, k] != coefficients[0, k - 1]]
    if events:
        return _between(x, knots, coefficients, 0, len(knots), True)
    ends = [*jumps, len(knots)]
    stretches = [_between(x, knots, coefficients, a, b, a == 0) for a, b in zip([0, *jumps], ends, strict=True)]
    stretches = [no_event(s) if s.has(sympy.Piecewise) else s for s in stretches]
    return sympy.Piecewise(
        *((s, x < sympy.Float(knots[k])) for s, k in zip(stretches[:-1], jumps, strict=True)), (stretches[-1], True)
    )


def _between(x: Any, knots: Floats, coefficients: Floats, first: int, end: int, outermost: bool) -> Any:
    """The pieces between some knots; before the first knot of all, its value."""
    branches = [(sympy.Float(coefficients[0, 0]), x < sympy.Float(knots[0]))] if outermost else []
    ends = np.append(knots[1:], np.inf)
    for k in range(first, end):
        if ends[k] == knots[k]:
            continue  # zero width: the next piece takes over
        s, law = x - sympy.Float(knots[k]), sympy.Integer(0)
        for c in coefficients[::-1, k].tolist():
            law = (law * s + sympy.Float(c)) if c or law != 0 else law
        branches.append((law if law != 0 else sympy.Float(0.0), x < sympy.Float(ends[k])))
    return sympy.Piecewise(*branches[:-1], (branches[-1][0], True))


def bilinear(said: str, x: Any, y: Any, xs: Floats, ys: Floats, z: Floats, events: bool) -> Any:
    """Bilinear interpolation on a rectangular grid; outside, the value at the nearest point of the edge.

    Parameters
    ----------
    said : str
    x, y : expression
    xs, ys : array
        Increasing, shapes (n,) and (m,).
    z : array, shape (n, m)
    events : bool
        Whether the grid lines raise events.
    """
    _check_arguments(said, x, y)
    cells = (len(xs) + 1) * (len(ys) + 1)
    if cells > 4 * MOST_PIECES:
        raise ArgumentError(
            f"{said} has {len(xs)} x {len(ys)} points; expected {4 * MOST_PIECES} in all or fewer: each cell is code of its own"
        )
    rows = [_line(y, ys, [sympy.Float(value) for value in row]) for row in z.tolist()]
    law = _line(x, xs, rows)
    return law if events or not law.has(sympy.Piecewise) else no_event(law)


def _line(x: Any, knots: Floats, values: list[Any]) -> Any:
    """Linear interpolation between values at knots, which may be expressions; constant outside."""
    branches = [(values[0], x < sympy.Float(knots[0]))]
    for k in range(len(knots) - 1):
        share = (x - sympy.Float(knots[k])) / sympy.Float(knots[k + 1] - knots[k])
        branches.append((values[k] + (values[k + 1] - values[k]) * share, x < sympy.Float(knots[k + 1])))
    return sympy.Piecewise(*branches, (values[-1], True))
