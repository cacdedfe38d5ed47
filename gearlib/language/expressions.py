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
from sympy.logic.boolalg import Boolean

from gearlib.errors import DeclarationError

__all__ = [
    "And", "Eq", "Max", "Min", "Not", "Or", "Piecewise", "When", "acos", "asin", "atan", "atan2", "cos", "cosh", "der",
    "equals", "exp", "holds", "initial", "log", "no_event", "pi", "pre", "reinit", "sign", "sin", "sinh", "sqrt", "tan", "tanh",
    "time",
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
        for side in (self.left, self.right):
            if isinstance(side, str):
                raise TypeError(f"{side!r} is text; write an expression of variables, such as self.{side}")
        return sympy.sympify(self.left) - value_of(self.right)


@dataclass(frozen=True)
class Reinit:
    """What `reinit` returns: a state and its new value."""

    state: Any
    value: Any


@dataclass(frozen=True, init=False)
class When:
    """Actions at the moment at which a condition becomes true.

    Parameters
    ----------
    condition : relation or Boolean expression of relations
    *actions : Eq or reinit
        Equations of discrete variables, and new values of states.

    Examples
    --------
    A ball that bounces, in the equations of a component::

        gl.When(self.h < 0, gl.reinit(self.v, -0.8 * self.v), gl.Eq(self.bounces, gl.pre(self.bounces) + 1))
    """

    condition: Any
    actions: tuple[Eq | Reinit, ...]

    def __init__(self, condition: Any, *actions: Eq | Reinit) -> None:
        object.__setattr__(self, "condition", condition)
        object.__setattr__(self, "actions", actions)


def reinit(state: Any, value: Any) -> Reinit:
    """Give a state a new value; only in `When`."""
    return Reinit(state, value)


def value_of(expression: Any) -> Any:
    """An expression as a number: 1 for a condition that holds, 0 for one that does not."""
    expression = sympy.sympify(expression)
    if isinstance(expression, Boolean) and not isinstance(expression, sympy.Symbol):  # sympy's symbols are Boolean, too
        return sympy.Piecewise((1, expression), (0, True))
    return expression


def pre(variable: Any) -> Any:
    """The value of a discrete variable before the event that is being handled."""
    if not isinstance(variable, sympy.Symbol):
        raise DeclarationError(f"pre({variable!r}): expected a discrete variable, such as self.mode")
    return sympy.Symbol(f"pre({variable.name})", real=True)


def holds(variable: Any) -> Any:
    """The condition that a discrete variable is not zero."""
    return sympy.Ne(variable, 0)


def equals(variable: Any, value: float) -> Any:
    """The condition that a discrete variable has a value."""
    return sympy.Eq(variable, value)


def initial() -> Any:
    """The condition that the run is just being started."""
    return sympy.Ne(sympy.Symbol("initial()", real=True), 0)


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
    2*der(phi)*phi
    """
    try:
        if isinstance(expression, str):
            raise TypeError
        return total_derivative(sympy.sympify(expression), frozenset())
    except (TypeError, AttributeError, sympy.SympifyError):
        raise DeclarationError(
            f"der({expression!r}): expected a variable, such as self.w, or an expression of variables"
        ) from None


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
