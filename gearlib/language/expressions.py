"""Expressions in equations: sympy's, with additions for modelling.

``der(x)`` is the time derivative, ``time`` the independent variable. Everything is real. sympy evaluates strings as code, so only
numbers and expressions are passed on to it: `as_number`, `as_condition` and `value_of` are the only entry points.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
import sympy
from sympy.core.function import UndefinedFunction
from sympy.logic.boolalg import Boolean, BooleanAtom, BooleanFunction

from gearlib.arguments import real, shown
from gearlib.errors import ArgumentError, DeclarationError

__all__ = [
    "And", "Eq", "Max", "Min", "Not", "Or", "Piecewise", "When", "acos", "asin", "atan", "atan2", "cos", "cosh", "der",
    "equals", "exp", "holds", "initial", "log", "no_event", "pi", "pre", "reinit", "sample", "settled", "sign", "sin", "sinh", "sqrt",
    "tan", "tanh", "time",
]  # fmt: skip


@lru_cache(maxsize=100_000)
def real_symbol(name: str) -> Any:
    """The symbol for a name; cached, since every compilation writes the equations again."""
    return sympy.Symbol(name, real=True)


time: Any = real_symbol("time")
pi: Any = sympy.pi

DEEPEST = 130  # nesting levels; at 200 sympy's derivative exceeds Python's default limit of 1000 frames
TOO_DEEP = "an expression is nested too deeply; give its parts to variables with equations of their own"
_NO_EVENT: Callable[[Any], Any] = UndefinedFunction("no_event", real=True)
_SETTLED: Callable[[Any], Any] = UndefinedFunction("settled", real=True)
_EXPECTED = "a number or an expression of variables, such as self.w or self.flange_a.phi"


def as_number(value: Any, said: str) -> Any:
    """A number or an expression in sympy's form.

    Parameters
    ----------
    value : number or sympy expression
    said : str
        Name of the value in error messages.

    Raises
    ------
    DeclarationError
        Anything else: a string, a condition, a container, a number that is not finite.

    Examples
    --------
    >>> as_number(2, "the argument of sin")
    2
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
        try:
            found = real(said, value, f"{_EXPECTED}, and finite")
        except ArgumentError as problem:
            raise DeclarationError(str(problem)) from None
        return sympy.Integer(int(value)) if isinstance(value, (int, np.integer)) else sympy.Float(found)
    if isinstance(value, Fraction):
        value = sympy.Rational(value.numerator, value.denominator)
    if isinstance(value, sympy.Expr) and not value.is_Matrix:
        if value.is_Atom and not value.is_Symbol and not _is_ordinary(value):
            raise DeclarationError(f"{said} is {shown(value)}; expected {_EXPECTED}, and finite")
        return value
    hint = ""
    if isinstance(value, str):
        hint = f"text is never evaluated; write self.{value}" if value.isidentifier() else "text is never evaluated"
    elif isinstance(value, Boolean):
        hint = "a condition is not a number; gl.Piecewise((1, condition), (0, True)) makes it one"
    raise DeclarationError(f"{said} is {shown(value)}; expected {_EXPECTED}{f' ({hint})' if hint else ''}")


def _is_ordinary(number: Any) -> bool:
    """Whether a sympy number is real, finite and representable as a float."""
    try:
        return math.isfinite(float(number))
    except (TypeError, ValueError, OverflowError):
        return False


def as_condition(value: Any, said: str) -> Any:
    """A comparison, or several combined by And, Or and Not, in sympy's form; or a Boolean.

    Raises
    ------
    DeclarationError
        Anything else: a number, a variable (which is not a comparison), a string.

    Examples
    --------
    >>> as_condition(time < 2, "the condition")
    time < 2
    """
    if isinstance(value, (bool, np.bool_)):
        return sympy.true if value else sympy.false
    if isinstance(value, sympy.Symbol):  # sympy's symbols are Boolean, too
        raise DeclarationError(
            f"{said} is {value}, which is not a condition; compare it, as in {value} > 0 (a discrete variable: gl.holds(...))"
        )
    if isinstance(value, BooleanFunction):
        for part in value.args:
            as_condition(part, said)
        return value
    if isinstance(value, Boolean):
        return value
    raise DeclarationError(f"{said} is {shown(value)}, which is not a condition; expected a comparison, such as self.x > 0.5")


@lru_cache(maxsize=10_000)
def _built(kind: Any, arguments: tuple[Any, ...]) -> Any:
    """A condition or a Piecewise; cached, since sympy simplifies it at length and every compilation writes the equations again."""
    return kind(*arguments)


def value_of(expression: Any, said: str = "a value") -> Any:
    """An expression as a number: 1 for a true condition, 0 for a false one."""
    if isinstance(expression, (bool, np.bool_)):
        return sympy.Integer(int(expression))
    if isinstance(expression, Boolean) and not isinstance(expression, sympy.Symbol):
        return _built(sympy.Piecewise, ((sympy.S.One, as_condition(expression, said)), (sympy.S.Zero, sympy.true)))
    return as_number(expression, said)


def check_depth(expression: Any, said: str) -> None:
    """Refuse an expression nested too deeply for sympy, which differentiates and prints recursively."""
    if not isinstance(expression, sympy.Basic) or not expression.args:
        return
    level = {expression}
    for _ in range(DEEPEST):
        level = {part for node in level for part in node.args}
        if not level:
            return
    raise DeclarationError(f"{said}: {TOO_DEEP}")


def _function(kind: Any, count: int = 1) -> Callable[..., Any]:
    """A sympy function that accepts numbers and expressions only."""
    name = kind.__name__

    def call(*arguments: Any) -> Any:
        if len(arguments) != count:
            raise TypeError(f"{name}() takes {count} argument{'s' if count > 1 else ''}, got {len(arguments)}")
        numbers = [as_number(a, f"the argument of {name}()") for a in arguments]
        found = kind(*numbers)
        return found if found.args else as_number(found, f"{name}({', '.join(map(shown, numbers))})")

    call.__name__ = call.__qualname__ = name
    call.__doc__ = f"{name} of {'a number or an expression' if count == 1 else 'numbers or expressions'}."
    return call


sin, cos, tan = _function(sympy.sin), _function(sympy.cos), _function(sympy.tan)
asin, acos, atan, atan2 = _function(sympy.asin), _function(sympy.acos), _function(sympy.atan), _function(sympy.atan2, 2)
sinh, cosh, tanh = _function(sympy.sinh), _function(sympy.cosh), _function(sympy.tanh)
exp, log, sqrt, sign = _function(sympy.exp), _function(sympy.log), _function(sympy.sqrt), _function(sympy.sign)


def _numbers(name: str, values: tuple[Any, ...]) -> list[Any]:
    if not values:
        raise DeclarationError(f"{name}() is given nothing; expected one or more numbers or expressions")
    return [as_number(v, f"an argument of {name}()") for v in values]


def Max(*values: Any) -> Any:
    """Maximum of numbers or expressions."""
    return _built(sympy.Max, tuple(_numbers("Max", values)))


def Min(*values: Any) -> Any:
    """Minimum of numbers or expressions."""
    return _built(sympy.Min, tuple(_numbers("Min", values)))


def And(*conditions: Any) -> Any:
    """Conjunction: all conditions hold."""
    return _built(sympy.And, tuple(as_condition(c, "an argument of And()") for c in conditions))


def Or(*conditions: Any) -> Any:
    """Disjunction: at least one condition holds."""
    return _built(sympy.Or, tuple(as_condition(c, "an argument of Or()") for c in conditions))


def Not(condition: Any) -> Any:
    """Negation of a condition."""
    return _built(sympy.Not, (as_condition(condition, "the argument of Not()"),))


def Piecewise(*branches: tuple[Any, Any]) -> Any:
    """The value of the first branch whose condition holds.

    Parameters
    ----------
    *branches : (value, condition)
        The last condition must be True.

    Raises
    ------
    DeclarationError
        A branch that is not such a pair, or a condition that Python evaluated to False: ``==`` compares symbols, not their values.

    Examples
    --------
    >>> Piecewise((10, time < 0.5), (0, True))
    Piecewise((10, time < 0.5), (0, True))
    """
    pairs = []
    for branch in branches:
        if not isinstance(branch, (tuple, list, sympy.Tuple)) or len(branch) != 2:
            raise DeclarationError(
                f"Piecewise() is given {shown(branch)}; expected (value, condition), such as (1, self.x > 0)"
            )
        value, condition = branch
        if isinstance(condition, (bool, np.bool_)) and not condition:
            raise DeclarationError(f"Piecewise(): the condition of {shown(value)} is False; {_COMPARED_AT_ONCE}")
        pairs.append((value_of(value, "a value of Piecewise()"), as_condition(condition, "a condition of Piecewise()")))
    if not pairs:
        raise DeclarationError("Piecewise() is given nothing; expected (value, condition), ..., (value, True)")
    return _built(sympy.Piecewise, tuple(pairs))


_COMPARED_AT_ONCE = "== compares at once, gl.equals(variable, value) at every moment"


@dataclass(frozen=True)
class Eq:
    """The equation ``left == right``; it has no causality.

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
        return value_of(self.left, "the left side") - value_of(self.right, "the right side")


@dataclass(frozen=True)
class Reinit:
    """Return value of `reinit`: a state and its new value."""

    state: Any
    value: Any


@dataclass(frozen=True, init=False)
class When:
    """Actions at the instant at which a condition becomes true.

    Parameters
    ----------
    condition : relation or Boolean expression of relations
    *actions : Eq or reinit
        Equations of discrete variables, and new values of states.
    elsewhen : When, optional
        Another one that may assign the same variables; it does nothing at an instant at which this condition becomes true.

    Examples
    --------
    A bouncing ball, in the equations of a component::

        gl.When(self.h < 0, gl.reinit(self.v, -0.8 * self.v), gl.Eq(self.bounces, gl.pre(self.bounces) + 1))

    A gear shifted up and down::

        gl.When(self.w > 200, gl.Eq(self.gear, 2), elsewhen=gl.When(self.w < 80, gl.Eq(self.gear, 1)))
    """

    condition: Any
    actions: tuple[Eq | Reinit, ...]
    elsewhen: When | None = None

    def __init__(self, condition: Any, *actions: Eq | Reinit, elsewhen: When | None = None) -> None:
        found = as_condition(condition, "the condition of When()")
        if isinstance(found, BooleanAtom):
            raise DeclarationError(
                f"When(): the condition is {bool(found)}, and never becomes true; {_COMPARED_AT_ONCE}, and gl.initial() holds at the "
                "start"
            )
        for action in actions:
            if not isinstance(action, (Eq, Reinit)):
                raise DeclarationError(
                    f"When() is given {shown(action)}; expected gl.Eq(discrete variable, ...) or gl.reinit(state, ...)"
                )
        if elsewhen is not None and not isinstance(elsewhen, When):
            raise DeclarationError(f"When(): elsewhen is {shown(elsewhen)}; expected another gl.When(condition, ...)")
        object.__setattr__(self, "condition", found)
        object.__setattr__(self, "actions", actions)
        object.__setattr__(self, "elsewhen", elsewhen)

    @property
    def branches(self) -> tuple[When, ...]:
        """The condition and actions, and those that follow as ``elsewhen``, in order of precedence."""
        return (self, *(() if self.elsewhen is None else self.elsewhen.branches))


def reinit(state: Any, value: Any) -> Reinit:
    """Re-initialise a state; only in `When`."""
    if not isinstance(state, sympy.Symbol):
        raise DeclarationError(f"reinit() is given {shown(state)}; expected a state, such as self.w")
    return Reinit(state, value_of(value, f"the new value of {state} in reinit()"))


def pre(variable: Any) -> Any:
    """Value of a discrete variable before the current event."""
    if not isinstance(variable, sympy.Symbol):
        raise DeclarationError(f"pre({shown(variable)}): expected a discrete variable, such as self.mode")
    return real_symbol(f"pre({variable.name})")


def holds(variable: Any) -> Any:
    """Condition that a discrete variable is nonzero."""
    return sympy.Ne(as_number(variable, "the argument of holds()"), 0)


def equals(variable: Any, value: float) -> Any:
    """Condition that a discrete variable has a given value."""
    wanted = int(value) if isinstance(value, (bool, np.bool_)) else value
    return sympy.Eq(as_number(variable, "the variable of equals()"), as_number(wanted, "the value of equals()"))


def initial() -> Any:
    """Condition that is true only while the run is being started."""
    return sympy.Ne(real_symbol("initial()"), 0)


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
    found = as_number(expression, "the argument of der()")
    return total_derivative(found.rewrite((sympy.Max, sympy.Min), sympy.Piecewise), frozenset())  # sympy's are steps of its own


def total_derivative(expression: Any, constants: frozenset[str]) -> Any:
    """Total time derivative of ``expression``, with the symbols named in ``constants`` held constant."""
    if expression.is_Symbol and expression.name != time.name:  # by far the most common case
        return sympy.S.Zero if expression.name in constants else real_symbol(f"der({expression.name})")
    total = sympy.diff(expression, time)
    for symbol in sorted(expression.free_symbols, key=str):
        if symbol != time and symbol.name not in constants:
            total += sympy.diff(expression, symbol) * real_symbol(f"der({symbol.name})")
    return total


class SquareWave(sympy.Function):  # type: ignore[misc]
    """Square wave of (time, period, offset): negative before ``offset``, then positive for a period, negative for the next, and so on."""

    is_real = True

    def _eval_derivative(self, symbol: Any) -> Any:
        """Of its sine, by which the instants move with the period and the offset."""
        t, period, offset = self.args
        turned = sympy.pi * (t - offset) / period
        return sympy.cos(turned) * turned.diff(symbol)

    def _pythoncode(self, printer: Any) -> str:
        t, period, offset = (printer.doprint(a) for a in self.args)
        return f"(sin({math.pi!r} * (({t}) - ({offset})) / ({period})) if ({t}) >= ({offset}) else -1.0)"

    def _numpycode(self, printer: Any) -> str:
        t, period, offset = (printer.doprint(a) for a in self.args)
        return f"where(({t}) >= ({offset}), sin({math.pi!r} * (({t}) - ({offset})) / ({period})), -1.0)"


class JustBefore(sympy.Function):  # type: ignore[misc]
    """A time slightly earlier, before events at the given time; conditions on time are evaluated at events half as much later."""

    is_real = True

    def _pythoncode(self, printer: Any) -> str:
        t = printer.doprint(self.args[0])
        return f"(({t}) - 2e-12 * max(abs({t}), 1e-3))"

    def _numpycode(self, printer: Any) -> str:
        t = printer.doprint(self.args[0])
        return f"(({t}) - 2e-12 * maximum(abs({t}), 1e-3))"


def alternates(period: Any, offset: Any = 0) -> Any:
    """Condition that holds from ``offset`` on in every other period; it switches at ``offset + k * period``."""
    return SquareWave(time, as_number(period, "the period"), as_number(offset, "the offset")) > 0


class Sample(sympy.Function):  # type: ignore[misc]
    """Placeholder written by `sample` (period, offset), until equations of discrete variables are separated from the others."""

    is_real = True


def sample(period: Any, offset: Any = 0) -> Any:
    """Condition that becomes true at the instants ``offset``, ``offset + period``, ``offset + 2 * period``, ...

    It holds at these instants only, and is meant for `When` and for equations of discrete variables. If the run starts at such an
    instant, it counts.

    Parameters
    ----------
    period, offset : number or expression of parameters
        s.

    Examples
    --------
    >>> import gearlib as gl
    >>> class Counter(gl.Component):
    ...     n = gl.Discrete("instants so far")
    ...     def equations(self):
    ...         return [gl.When(gl.sample(0.25, 0.1), gl.Eq(self.n, gl.pre(self.n) + 1))]
    >>> result = gl.simulate(Counter(), 1.0, samples=6)
    >>> result["n"]
    array([0., 1., 2., 3., 3., 4.])
    >>> [float(t) for t, _ in result.events]
    [0.1, 0.35, 0.6, 0.85]
    """
    found = as_number(period, "the period of sample()")
    if found.is_number and not found > 0:
        raise DeclarationError(f"sample(): the period is {period}; expected a positive number of seconds")
    return Sample(found, as_number(offset, "the offset of sample()")) > 0


def no_event(expression: Any) -> Any:
    """The same value, with its relations evaluated continuously and without raising events.

    A run is refused where one of them makes an equation jump that must be differentiated.
    """
    return _NO_EVENT(value_of(expression, "the argument of no_event()"))


def settled(expression: Any) -> Any:
    """The same value, to be compared only once an event iteration has settled all else.

    Until then ``settled(x) > 0`` keeps its value. So what depends on all parts of a model, as the break-away of a friction element does,
    is not decided while some of them still change: of two brakes that come to rest in the same instant, one locks first.
    """
    return _SETTLED(value_of(expression, "the argument of settled()"))
