"""Rates of explicit functions of time in an expression: of its sinusoids and bell curves.

A polynomial or an exponential of time has no pulse that a step could pass over unseen, and where a condition on time switches is known.
A sinusoid has one in each period, and a bell curve, the exponential of a quadratic in time, has one that is as wide as its exponent's
curvature tells.
"""

from __future__ import annotations

from typing import Any

import sympy

from gearlib.equations.kernel import Kernel
from gearlib.equations.template import memoised

_T: Any = sympy.Symbol("t", real=True)  # what time is called in a kernel


@memoised
def time_rates(kernel: Kernel) -> tuple[Any, ...] | None:
    """Angular rates (rad/s) of all that time moves in a kernel, as expressions in its parameters; None where they are not known.

    A bell curve ``exp(-(t/s)**2 / 2)`` has the rate ``1/s``.
    """
    found = _rates(kernel.expression)
    # a symbol that is no parameter stands for a variable or for an entry of the discrete state
    if found is None or any(symbol.name[0] != "p" for rate in found for symbol in rate.free_symbols):
        return None
    return tuple(sorted(set(found), key=sympy.default_sort_key))  # sets and products have no order of their own


def _rates(e: Any) -> list[Any] | None:
    """Rates of an expression.

    >>> t, p = _T, sympy.Symbol("p0", real=True)
    >>> _rates(3 * t**2 + 2 * sympy.sin(p * t + 1)), _rates(sympy.exp(-8 * t**2)), _rates(1 / (1 + t**2))
    ([Abs(p0)], [4], None)
    >>> sorted(_rates(sympy.sin(2 * t) * sympy.cos(3 * t) ** 2))
    [2, 6, 8]
    """
    if not e.has(_T) or e == _T:
        return []
    if isinstance(e, sympy.sin | sympy.cos):
        slope = sympy.diff(e.args[0], _T)
        return None if slope.has(_T) else [sympy.Abs(slope)]
    if isinstance(e, sympy.exp):
        slope = sympy.expand(sympy.diff(e.args[0], _T))
        curvature = sympy.simplify(sympy.diff(slope, _T))
        return [] if not slope.has(_T) else None if curvature.has(_T) else [sympy.sqrt(sympy.Abs(curvature))]
    if isinstance(e, sympy.Piecewise):
        parts = [] if any(condition.has(_T) for _, condition in e.args) else [_rates(part) for part, _ in e.args]
        return _all(parts) if parts else None
    if isinstance(e, sympy.Pow) and e.exp.is_Integer and e.exp > 0:
        inner = _rates(e.base)
        return None if inner is None else [e.exp * rate for rate in inner]
    if isinstance(e, sympy.Add | sympy.Mul):
        found = _all([_rates(part) for part in e.args])
        beating = isinstance(e, sympy.Mul) and found is not None and len(found) > 1
        return [*found, sum(found)] if beating and found is not None else found
    return None


def _all(parts: list[list[Any] | None]) -> list[Any] | None:
    found: list[Any] = []
    for part in parts:
        if part is None:
            return None
        found += part
    return found
