"""Modelica text says what the expression says: it is read again by a small parser of Modelica's expressions, and evaluated."""

from __future__ import annotations

import math
import operator
import re
from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
from gearlib.equations.modelica_printer import condition_text, modelica_name, modelica_text
from gearlib.errors import ModelicaError
from gearlib.language.expressions import JustBefore, SquareWave

x, y, z = sympy.symbols("x y z", real=True)
TOKEN = re.compile(r"\s*(\d+\.?\d*(?:e[+-]?\d+)?|[a-zA-Z_]\w*|<>|<=|>=|==|[-+*/^(),<>])")


class Reader:
    """Recursive descent by the grammar of the Modelica specification: a sign belongs to the sum, and a power has one exponent."""

    def __init__(self, text: str, values: dict[str, float]) -> None:
        self.tokens, self.at, self.values = TOKEN.findall(text), 0, values
        assert "".join(self.tokens) == text.replace(" ", "")

    def take(self, *wanted: str) -> str:
        if self.at < len(self.tokens) and self.tokens[self.at] in wanted:
            self.at += 1
            return str(self.tokens[self.at - 1])
        return ""

    def expression(self) -> Any:
        if self.take("if"):
            return self.branches()
        return self.either()

    def branches(self) -> Any:
        condition = self.expression()
        assert self.take("then")
        value = self.expression()
        if self.take("elseif"):
            other = self.branches()
        else:
            assert self.take("else")
            other = self.expression()
        return value if condition else other

    def either(self) -> Any:
        value = self.both()
        while self.take("or"):
            value = self.both() or value
        return value

    def both(self) -> Any:
        value = self.negated()
        while self.take("and"):
            value = self.negated() and value
        return value

    def negated(self) -> Any:
        return not self.relation() if self.take("not") else self.relation()

    def relation(self) -> Any:
        left = self.sum()
        sign = self.take("<", "<=", ">", ">=", "==", "<>")
        if not sign:
            return left
        right = self.sum()
        signs = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "<>": operator.ne}
        return signs[sign](left, right)

    def sum(self) -> Any:
        value = -self.product() if self.take("-") else self.product()
        while sign := self.take("+", "-"):
            value = value + self.product() if sign == "+" else value - self.product()
        return value

    def product(self) -> Any:
        value = self.power()
        while sign := self.take("*", "/"):
            value = value * self.power() if sign == "*" else value / self.power()
        return value

    def power(self) -> Any:
        base = self.primary()
        return base ** self.primary() if self.take("^") else base

    def primary(self) -> Any:
        if self.take("("):
            value = self.expression()
            assert self.take(")")
            return value
        token = str(self.tokens[self.at])
        self.at += 1
        if self.take("("):
            arguments = [self.expression()]
            while self.take(","):
                arguments.append(self.expression())
            assert self.take(")")
            own: dict[str, Any] = {"noEvent": lambda v: v}
            name = {"asin": "asin", "acos": "acos", "atan": "atan"}.get(token, token)
            return (own.get(name) or getattr(math, name))(*arguments)
        if token in ("true", "false"):
            return token == "true"
        return self.values[token] if token in self.values else float(token)


def read(text: str, **values: float) -> Any:
    reader = Reader(text, values)
    found = reader.expression()
    assert reader.at == len(reader.tokens), text
    return found


EXPRESSIONS = [
    sympy.Float(-0.5) ** x, sympy.Rational(-1, 2) ** x, sympy.Integer(-1) ** x, sympy.Float(0.5) ** x,
    x + y * z, x - (y - z), x - (y + z), -(x + y) * z, -x * y, x / y / z, x / (y * z), (x / y) * z, x * y**-2, (x * y) ** 3, (-x) ** 3,
    (-x) ** 2, -(x**2),
    x ** (y + 1), (x**y) ** 2, x**-y, 2**-x, x ** (-sympy.exp(y)), y * x ** (-1 - z**2),
    sympy.sqrt(x) / sympy.sqrt(y * z), x ** sympy.Rational(2, 3), x ** sympy.Rational(-2, 3),
    1 / (1 + 1 / x),
    sympy.Rational(2, 3) * x - sympy.Rational(1, 3) * y, sympy.Rational(-7, 2) * (x - y), -sympy.Rational(1, 2), 2.5e-7 * x - 3e12 * y,
    -1.5 * x, sympy.Integer(-3) ** x * 0 + x,
    sympy.sin(x) * sympy.cos(-y) + sympy.tan(z) * sympy.exp(x - y) - sympy.log(x) + sympy.atan2(-y, x),
    sympy.asin(x / 9) + sympy.acos(-x / 9) - sympy.atan(x),
    sympy.sinh(x) - sympy.cosh(y) * sympy.tanh(z), 1 / sympy.cos(x) + 1 / sympy.sin(y) + sympy.sec(z) - sympy.csc(x) * sympy.cot(y),
    sympy.pi * x - sympy.E**2,
    sympy.Abs(x - y) * 2, sympy.sign(x - y) - sympy.sign(y - x) * 3, sympy.Max(x, y, z) - sympy.Min(x, y, z), sympy.Max(x - y, 1),
    sympy.Min(-x, -y) * 2,
    gl.Piecewise((x, x > y), (y, y > z), (-z, True)) * 2 - 1, gl.Piecewise((1, x < 1), (gl.Piecewise((2, y >= 1), (3, True)), True)),
    x * (y + gl.Piecewise((1, x <= y), (-1, True))),
    gl.Piecewise((1, gl.And(x > 0, y > 1, z < 2)), (2, gl.Or(x > 1, gl.Not(y > z))), (3, True)), gl.no_event(abs(x)) + 1,
    -gl.no_event(x - y) / z, (x + y) / (x - 3 * z) * (y - 5),
    gl.Piecewise((1, sympy.Eq(x, 2)), (2, sympy.Ne(y, 2)), (3, True)), -(x + 1) * (y - 2) / -(z + 3), x - 3 * (-y),
    x + sympy.Mul(-1, y + z, evaluate=False), 5 - x, 0.1 + x,
]  # fmt: skip
TEXTS = [
    (sympy.pi, "3.141592653589793"), (sympy.E, "2.718281828459045"), (sympy.Integer(-3), "-3"), (sympy.Rational(-3, 2), "-3/2"),
    (x + sympy.Rational(1, 2), "x + 1/2"), (x - sympy.Rational(1, 2), "x - 1/2"), (x * sympy.Rational(1, 2), "x/2"),
    (sympy.Rational(1, 2) ** x, "(1/2)^x"), (sympy.Float(0.5) ** x, "0.5^x"), (sympy.Float(-0.5) ** x, "(-0.5)^x"),
    (sympy.Integer(0) ** x, "0^x"), (sympy.Float(0.0) ** x, "0.0^x"), (sympy.Integer(2) ** x, "2^x"), (sympy.Integer(-1) ** x, "(-1)^x"),
    (x ** (y + 1), "x^(y + 1)"), (x**-y, "x^(-y)"), (x**-2, "1/x^2"), (2 * x**2 * y / 3, "2*x^2*y/3"), (x * sympy.sqrt(y), "x*sqrt(y)"),
    ((x + y) * (x - y), "(x - y)*(x + y)"), (x / (y * z), "x/(y*z)"), (x / (y + z), "x/(y + z)"), (x / y**2, "x/y^2"),
    (-x * y, "-x*y"), (-x - y, "-x - y"), (-(x + y) * z, "z*(-x - y)"), (3 - x, "3 - x"), (x * y + z, "x*y + z"),
    (abs(x - y) * 2, "2*(if x - y >= 0 then x - y else -x + y)"), (sympy.Max(x - y, 1), "(if 1 > x - y then 1 else x - y)"),
    (gl.no_event(x - y), "noEvent(x - y)"), (gl.settled(x - y), "x - y"),
    (1 / sympy.cos(x - y), "1/cos(x - y)"), (sympy.cot(x), "(1/tan(x))"),
    (sympy.Min(x, y, z), "(if x < (if y < z then y else z) then x else (if y < z then y else z))"),
]  # fmt: skip
POINTS = [(2.0, 3.0, 0.5), (0.7, 0.2, 1.9), (1.5, 1.5, 2.5), (3.0, 2.0, 4.0)]


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=str)
def test_the_text_has_the_value_of_the_expression(expression: Any) -> None:
    plain = expression.replace(lambda e: getattr(e.func, "__name__", "") == "no_event", lambda e: e.args[0])
    text = modelica_text(expression)
    for point in POINTS:
        expected = complex(plain.subs(dict(zip((x, y, z), point, strict=True))).evalf())
        if expected.imag == 0:
            assert read(text, **dict(zip("xyz", point, strict=True))) == pytest.approx(expected.real, rel=1e-12), text


@pytest.mark.parametrize(("expression", "text"), TEXTS, ids=str)
def test_parentheses_stand_where_modelica_s_precedence_asks_for_them(expression: Any, text: str) -> None:
    assert modelica_text(expression) == text


@pytest.mark.parametrize("seed", range(16))
def test_random_sums_products_and_powers(seed: int) -> None:
    rng = np.random.default_rng(seed)

    def make(depth: int) -> Any:
        if depth == 0:
            whole, thirds, decimal = int(rng.integers(-4, 5)), int(rng.integers(-5, 6)), round(float(rng.normal()), 2)
            return [x, y, z, sympy.Integer(whole), sympy.Rational(thirds, 3), sympy.Float(decimal)][rng.integers(6)]
        a, b, n = make(depth - 1), make(depth - 1), int(rng.integers(-2, 4))
        root = (a * a + 1) ** sympy.Rational(1, 2)
        return [a + b, a - b, a * b, a / (b + 11), -a, a**n if a != 0 else b, root][rng.integers(7)]

    expression = make(4)
    for point in POINTS:
        expected = complex(sympy.sympify(expression).subs(dict(zip((x, y, z), point, strict=True))).evalf())
        if math.isfinite(abs(expected)):
            text = modelica_text(expression)
            assert read(text, **dict(zip("xyz", point, strict=True))) == pytest.approx(expected.real, rel=1e-9), text


@pytest.mark.parametrize(
    ("condition", "text"),
    [
        (x > 1, "x > 1"), (x <= y, "x <= y"), (gl.Not(gl.And(x > 1, y > 1)), "not ((x > 1) and (y > 1))"),
        (sympy.Not(sympy.And(x > 1, gl.holds(y)), evaluate=False), "not ((y <> 0) and (x > 1))"),
        (gl.equals(x, 2), "x == 2"), (gl.holds(x), "x <> 0"), (gl.initial(), "initial()"), (gl.sample(0.5, 0.1), "sample(0.1, 0.5)"),
        (sympy.true, "true"), (sympy.false, "false"),
        (gl.Or(gl.initial(), x > 1), "(initial()) or (x > 1)"), (sympy.Ne(x, y), "x <> y"),
    ],
)  # fmt: skip
def test_conditions(condition: Any, text: str) -> None:
    assert modelica_text(condition) == text


def test_values_that_are_one_or_zero_as_conditions() -> None:
    assert condition_text(gl.Piecewise((1, x > 2), (0, True))) == "x > 2"
    assert condition_text(gl.Piecewise((0, x > 2), (1, True))) == "(if x > 2 then 0 else 1) > 0.5"
    assert [condition_text(v) for v in (x, sympy.Integer(1), sympy.Integer(0))] == ["x > 0.5", "true", "false"]
    assert [condition_text(sympy.Rational(k, 10)) for k in (4, 5, 6)] == ["false", "false", "true"]
    assert condition_text(x, lambda name: f"a_{name}") == "a_x > 0.5"


def test_names_times_and_waves() -> None:
    assert modelica_name("row[0].planets[11].w") == "row[1].planets[12].w"
    inner = sympy.Symbol("der(der(row[0].w))", real=True)
    assert modelica_text(inner * gl.pre(sympy.Symbol("m[2]", real=True))) == "der(der(row[1].w))*pre(m[3])"
    assert modelica_text(inner, lambda name: f"own.{name}") == "der(der(own.row[0].w))"
    assert modelica_text(gl.time, lambda name: f"own.{name}") == "time"
    assert modelica_text(2.0) == "2.0"
    assert modelica_text(-3) == "-3"
    assert modelica_text(JustBefore(x)) == "x"
    wave = SquareWave(x, sympy.Float(0.5), sympy.Float(1.0))
    for at, sign in ((0.5, -1), (1.2, 1), (1.7, -1), (2.1, 1)):
        assert math.copysign(1, read(modelica_text(wave), x=at)) == sign


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (sympy.gamma(x), "cannot be written in Modelica: there is no function gamma"),
        (sympy.oo, "the number oo cannot be written in Modelica"),
        (sympy.Piecewise((1, x > 0)), "does not say what holds otherwise"),
        (sympy.Xor(x > 1, y > 1), "is not a condition that can be written"),
    ],
)  # fmt: skip
def test_what_modelica_cannot_say(wrong: Any, message: str) -> None:
    with pytest.raises(ModelicaError, match=message):
        modelica_text(gl.Piecewise((1, wrong), (0, True)) if wrong.is_Boolean else wrong)
