"""The expressions that equations are written in: sympy's, with a few additions for models.

``der(x)`` is the time derivative, ``time`` the independent variable. Everything is real.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy
from sympy import And, Max, Min, Not, Or, Piecewise
from sympy.core.function import UndefinedFunction

__all__ = [
    "And", "Eq", "Max", "Min", "Not", "Or", "Piecewise", "acos", "asin", "atan", "atan2", "cos", "cosh", "der", "exp", "log",
    "no_event", "pi", "sign", "sin", "sinh", "sqrt", "tan", "tanh", "time",
]  # fmt: skip

time: Any = sympy.Symbol("time", real=True)
pi: Any = sympy.pi

sin, cos, tan = sympy.sin, sympy.cos, sympy.tan
asin, acos, atan, atan2 = sympy.asin, sympy.acos, sympy.atan, sympy.atan2
sinh, cosh, tanh = sympy.sinh, sympy.cosh, sympy.tanh
exp, log, sqrt, sign = sympy.exp, sympy.log, sympy.sqrt, sympy.sign

_NO_EVENT: Callable[[Any], Any] = UndefinedFunction("no_event", real=True)


@dataclass(frozen=True)
class Eq:
    """The equation ``left == right``; neither side is an input or an output of it.

    Examples
    --------
    >>> import sympy
    >>> tau, w = sympy.symbols("tau w")
    >>> Eq(tau, 2 * w).residual
    tau - 2*w
    """

    left: Any
    right: Any

    @property
    def residual(self) -> Any:
        return sympy.sympify(self.left) - sympy.sympify(self.right)


def der(expression: Any) -> Any:
    """Time derivative of a variable, or of an expression of variables.

    The derivative of the variable ``x`` is the symbol named ``der(x)``.

    Examples
    --------
    >>> import sympy
    >>> phi = sympy.Symbol("phi", real=True)
    >>> der(phi)
    der(phi)
    >>> der(phi**2)
    2*phi*der(phi)
    """
    return total_derivative(sympy.sympify(expression), frozenset())


def total_derivative(expression: Any, constants: frozenset[str]) -> Any:
    """Derivative of ``expression`` along time, with the symbols named in ``constants`` held fixed."""
    total = sympy.diff(expression, time)
    for symbol in sorted(expression.free_symbols, key=str):
        if symbol != time and symbol.name not in constants:
            rate = sympy.Symbol(f"der({symbol.name})", real=True)
            total += rate if expression == symbol else sympy.diff(expression, symbol) * rate
    return total


def no_event(expression: Any) -> Any:
    """The same value, with the relations in it evaluated at every moment and no event made of them."""
    return _NO_EVENT(sympy.sympify(expression))
