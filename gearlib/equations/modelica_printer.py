"""Expressions as Modelica text."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import sympy
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanAtom

from gearlib.arguments import shown
from gearlib.errors import ModelicaError
from gearlib.language.expressions import JustBefore, Sample, SquareWave, no_event, real_symbol, settled

SUM, PRODUCT, POWER, ATOM = 1, 2, 3, 4  # operator precedence
_SAME = (
    sympy.sin, sympy.cos, sympy.tan, sympy.asin, sympy.acos, sympy.atan, sympy.atan2, sympy.sinh, sympy.cosh, sympy.tanh, sympy.exp,
    sympy.log,
)  # fmt: skip
_RECIPROCAL = {sympy.sec: "cos", sympy.csc: "sin", sympy.cot: "tan"}
_NO_EVENT = type(no_event(real_symbol("x")))
_SETTLED = type(settled(real_symbol("x")))
_SIGN = {"<": "<", "<=": "<=", ">": ">", ">=": ">=", "==": "==", "!=": "<>"}
_FUNCTION_OF = re.compile(r"(der|pre)\((.*)\)$")
_INDEX = re.compile(r"(?<=\[)\d+(?=\])")

Naming = Callable[[str], str]


def modelica_name(name: str) -> str:
    """A path in Modelica syntax, with indices counted from 1.

    >>> modelica_name("planets[0].w")
    'planets[1].w'
    """
    return _INDEX.sub(lambda m: str(int(m.group()) + 1), name)


def modelica_text(expression: Any, naming: Naming = modelica_name) -> str:
    """An expression or a condition as Modelica text.

    Parameters
    ----------
    expression : expression, condition or number
    naming : callable
        Returns the name of a symbol.

    Raises
    ------
    ModelicaError
        A function without a Modelica equivalent.

    Examples
    --------
    >>> import gearlib as gl
    >>> x, w = real_symbol("x"), real_symbol("load.w")
    >>> modelica_text(2.5 * x**2 - w / 3 + gl.Piecewise((-x, w < 0), (gl.sqrt(x), True)))
    '-load.w/3 + 2.5*x^2 + (if load.w < 0 then -x else sqrt(x))'
    >>> modelica_text((-x) ** 3 * gl.exp(-2 * w)), modelica_text(gl.der(x) * gl.pre(x)), modelica_text(x ** -0.5)
    ('-x^3*exp(-2*load.w)', 'der(x)*pre(x)', '1/x^0.5')
    """
    return _Printer(naming).text(sympy.sympify(expression))


def condition_text(value: Any, naming: Naming = modelica_name) -> str:
    """A value that is 1 or 0 as a condition in Modelica text.

    Examples
    --------
    >>> import gearlib as gl
    >>> w = real_symbol("w")
    >>> condition_text(gl.Piecewise((1, w > 2), (0, True))), condition_text(w), condition_text(sympy.Integer(1))
    ('w > 2', 'w > 0.5', 'true')
    """
    if isinstance(value, sympy.Piecewise) and [v for v, _ in value.args] == [1, 0]:
        return modelica_text(value.args[0][1], naming)
    return modelica_text(value > 0.5, naming)


class _Printer:
    """Prints expressions, with names of symbols given by a function."""

    def __init__(self, naming: Naming) -> None:
        self.naming = naming

    def text(self, e: Any, least: int = SUM) -> str:
        """The text, parenthesised where its precedence is lower than its context requires."""
        found, strength = self.with_strength(e)
        return f"({found})" if strength < least else found

    def with_strength(self, e: Any) -> tuple[str, int]:
        if isinstance(e, (BooleanAtom, Relational, sympy.And, sympy.Or, sympy.Not)):
            return self.condition(e), SUM
        if e.is_Symbol:
            return self.symbol(e.name), ATOM
        if e.is_Number or e is sympy.pi or e is sympy.E:
            return self.number(e)
        if e.is_Add:
            return self.sum(e), SUM
        if e.is_Mul:
            return self.product(e)
        if e.is_Pow:
            return self.power(e)
        if isinstance(e, sympy.Piecewise):
            return f"({self.piecewise(e)})", ATOM
        return self.function(e), ATOM

    def symbol(self, name: str) -> str:
        inner = _FUNCTION_OF.match(name)
        if inner is not None:
            function, argument = inner.groups()
            return f"{function}({self.symbol(argument)})"
        return name if name in ("time", "initial()") else self.naming(name)

    def number(self, e: Any) -> tuple[str, int]:
        if e.is_Integer:
            return str(int(e)), ATOM if e >= 0 else SUM
        if e.is_Rational:
            return f"{e.p}/{e.q}", PRODUCT if e >= 0 else SUM
        value = float(e)
        if not math.isfinite(value):
            raise ModelicaError(f"the number {e} cannot be written in Modelica")
        return repr(value), ATOM if value >= 0 else SUM

    def sum(self, e: Any) -> str:
        found = ""
        for term in e.as_ordered_terms():
            negative = term.could_extract_minus_sign() and not term.is_Add
            text = self.text(-term if negative else term, PRODUCT)
            found += (f" - {text}" if negative else f" + {text}") if found else (f"-{text}" if negative else text)
        return found

    def product(self, e: Any) -> tuple[str, int]:
        coefficient, _ = e.as_coeff_Mul()
        if coefficient.is_negative:
            return f"-{self.text(-e, PRODUCT)}", SUM
        above, below = [], []
        for factor in e.as_ordered_factors():
            if factor.is_Rational and not factor.is_Integer:
                above += [sympy.Integer(factor.p)] if factor.p != 1 else []
                below.append(sympy.Integer(factor.q))
            elif factor.is_Pow and factor.exp.is_negative:
                below.append(factor.base ** (-factor.exp))
            else:
                above.append(factor)
        text = "*".join(self.text(f, POWER) for f in above) or "1"
        if below:
            divisor = "*".join(self.text(f, POWER) for f in below)
            text += f"/({divisor})" if len(below) > 1 else f"/{divisor}"
        return text, PRODUCT

    def power(self, e: Any) -> tuple[str, int]:
        base, exponent = e.base, e.exp
        if exponent == sympy.Rational(1, 2):
            return f"sqrt({self.text(base)})", ATOM
        if base is sympy.E:
            return f"exp({self.text(exponent)})", ATOM
        if exponent.is_negative:
            return f"1/{self.text(base ** (-exponent), POWER)}", PRODUCT
        return f"{self.text(base, ATOM)}^{self.text(exponent, ATOM)}", POWER

    def piecewise(self, e: Any) -> str:
        found = ""
        for value, condition in e.args:
            if condition == True:  # noqa: E712 - sympy's
                return f"{found} else {self.text(value)}" if found else self.text(value)
            found += f"{' elseif' if found else 'if'} {self.condition(condition)} then {self.text(value)}"
        raise ModelicaError(f"{e} does not say what holds otherwise")

    def function(self, e: Any) -> str:
        if isinstance(e, _SAME):
            return f"{type(e).__name__}({', '.join(map(self.text, e.args))})"
        if type(e) in _RECIPROCAL:
            return f"(1/{_RECIPROCAL[type(e)]}({self.text(*e.args)}))"
        if isinstance(e, _NO_EVENT):
            return f"noEvent({self.text(*e.args)})"
        if isinstance(e, _SETTLED):
            return self.text(*e.args)
        if isinstance(e, sympy.Abs):  # Modelica's abs raises no event, gearlib's does
            (x,) = e.args
            return f"(if {self.text(x)} >= 0 then {self.text(x)} else {self.text(-x)})"
        if isinstance(e, sympy.sign):
            x = self.text(*e.args)
            return f"(if {x} > 0 then 1 elseif {x} < 0 then -1 else 0)"
        if isinstance(e, (sympy.Max, sympy.Min)):
            return self.extreme([self.text(a) for a in sorted(e.args, key=str)], ">" if isinstance(e, sympy.Max) else "<")
        if isinstance(e, SquareWave):
            t, period, offset = (self.text(a, PRODUCT) for a in e.args)
            return f"(if {t} >= {offset} then sin({math.pi!r}*({t} - {offset})/{period}) else -1)"
        if isinstance(e, JustBefore):
            return self.text(*e.args)
        raise ModelicaError(f"{shown(e)} cannot be written in Modelica: there is no function {type(e).__name__}")

    def extreme(self, texts: list[str], sign: str) -> str:
        first, *rest = texts
        if not rest:
            return first
        other = self.extreme(rest, sign)
        return f"(if {first} {sign} {other} then {first} else {other})"

    def condition(self, c: Any) -> str:
        if isinstance(c, BooleanAtom):
            return "true" if c else "false"
        if isinstance(c, sympy.Not):
            return f"not ({self.condition(*c.args)})"
        if isinstance(c, (sympy.And, sympy.Or)):
            word = " and " if isinstance(c, sympy.And) else " or "
            return word.join(f"({self.condition(a)})" for a in sorted(c.args, key=str))
        if not isinstance(c, Relational):
            raise ModelicaError(f"{shown(c)} is not a condition that can be written in Modelica")
        if isinstance(c.lhs, Sample):
            period, offset = (self.text(a) for a in c.lhs.args)
            return f"sample({offset}, {period})"
        if c == sympy.Ne(real_symbol("initial()"), 0):
            return "initial()"
        return f"{self.text(c.lhs)} {_SIGN[c.rel_op]} {self.text(c.rhs)}"
