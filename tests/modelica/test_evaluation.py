"""Modelica expressions as numbers, and as expressions of a component's variables; what has no value is refused."""

from __future__ import annotations

import math
from typing import Any

import pytest

import gearlib as gl
from gearlib.errors import ModelicaError
from gearlib.language.component import equations_of
from gearlib.language.expressions import real_symbol
from gearlib.modelica.counterparts import standard_library
from gearlib.modelica.evaluation import Evaluation
from gearlib.modelica.scopes import outermost
from gearlib.modelica.syntax_tree import ComponentNode
from gearlib.modelica.text_parser import parsed


def value(text: str) -> Any:
    """The value of an expression without variables, which stands in line 2."""
    whole = parsed(f"model M Real x =\n{text}; end M;", "M.mo")
    node = whole.classes[0].elements[0]
    assert isinstance(node, ComponentNode)
    assert node.value is not None
    return Evaluation(outermost(whole, standard_library().knows)).value(node.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("7 + 2", 9), ("7 - 2", 5), ("7 * 2", 14), ("7 / 2", 3.5), ("7 ^ 2", 49.0), ("2 ^ (-1)", 0.5), ("0.25 ^ 0.5", 0.5),
        ("-7", -7), ("+7", 7), ("7 < 2", False), ("2 < 2", False), ("2 <= 2", True), ("3 <= 2", False), ("2 > 2", False),
        ("3 > 2", True), ("2 >= 2", True), ("2 >= 3", False), ("2 == 2.0", True), ("2 == 3", False), ("2 <> 2", False),
        ("2 <> 3", True), ('"a" == "a"', True), ('"a" <> "a"', False), ("not false", True), ("not true", False),
        ("true and true", True), ("true and false", False), ("false and false", False), ("false or false", False),
        ("false or true", True), ("true or true", True), ("if 1 > 2 then 3 else 4", 4), ("if 2 > 1 then 3 else 4", 3),
        ("if false then 1 elseif true then 2 else 3", 2), ("if false then 1 elseif false then 2 else 3", 3),
        ("{1, 2} + {3, 5}", (4, 7)), ("{1, 2} - {3, 5}", (-2, -3)), ("-{1, 2}", (-1, -2)), ("3 * {1, 2}", (3, 6)),
        ("{1, 2} / 2", (0.5, 1.0)), ("{1, 2} .* {3, 5}", (3, 10)), ("{1, 2} .^ 2", (1, 4)), ("{6, 8} ./ {3, 2}", (2.0, 4.0)),
        ("{1, 2} .+ 1", (2, 3)), ("2 * {{1, 2}, {3, 4}}", ((2, 4), (6, 8))), ("{} + {}", ()),
        ("[1, 2; 3, 4] + {5, 6}", ((6, 7), (9, 10))), ("{k * k for k in 1:3}", (1, 4, 9)),
        ("{{j + k for k in 1:2} for j in {10, 20}}", ((11, 12), (21, 22))),
        ("1:2:6", (1, 3, 5)), ("1:2:7", (1, 3, 5, 7)), ("5:-2:1", (5, 3, 1)), ("5:-2:0", (5, 3, 1)), ("2:2", (2,)), ("3:2", ()),
        ("1:4 / 2", (1, 2)),
    ],
)  # fmt: skip
def test_operators_of_numbers(text: str, expected: Any) -> None:
    found = value(text)
    assert found == expected
    assert isinstance(found, bool) == isinstance(expected, bool)


FUNCTIONS = (
    math.sin, math.cos, math.tan, math.asin, math.acos, math.atan, math.sinh, math.cosh, math.tanh, math.exp, math.log, math.sqrt,
    math.log10,
)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        *((f"{f.__name__}(0.6)", f(0.6)) for f in FUNCTIONS),
        ("Modelica.Math.atan2(-1, -2)", math.atan2(-1, -2)), ("abs(-3)", 3), ("abs(2.5)", 2.5), ("sign(-2)", -1), ("sign(0)", 0),
        ("sign(0.1)", 1), ("min(3, 2)", 2), ("max(3, 2)", 3), ("min({3, 2, 4})", 2), ("max({3, 2, 4})", 4), ("max({7})", 7),
        ("min(7)", 7), ("integer(-2.5)", -3), ("floor(2.9)", 2), ("ceil(2.1)", 3), ("ceil(-2.9)", -2), ("mod(7, 3)", 1), ("mod(-7, 3)", 2),
        ("mod(7, -3)", -2), ("div(7, 3)", 2), ("div(-7, 3)", -2), ("rem(7, 3)", 1), ("rem(-7, 3)", -1), ("mod(2.5, 1)", 0.5),
        ("size({{1, 2, 3}, {4, 5, 6}}, 1)", 2), ("size({{1, 2, 3}, {4, 5, 6}}, 2)", 3), ("size({4, 5, 6}, 1)", 3),
        ("zeros(2)", (0.0, 0.0)), ("ones(1 + 2)", (1.0, 1.0, 1.0)), ("fill(7, 2 * 1)", (7, 7)), ("linspace(1, 3, 5)", (1, 1.5, 2, 2.5, 3)),
        ("sum({1, 2, 4})", 7), ("product({2, 3, 4})", 24), ("sum({})", 0), ("product({})", 1), ("sum(5)", 5),
        ("sum(k for k in 1:4)", 10), ("product({k for k in 2:4})", 24), ("smooth(1, 3)", 3), ("noEvent(3)", 3),
        ("noEvent(true)", True), ("der(3)", 0), ("homotopy(2, 3)", 2), ("homotopy(simplified = 3, actual = 2)", 2),
        ("homotopy(actual = 2, simplified = 3)", 2), ("semiLinear(2, 3, 5)", 6), ("semiLinear(-2, 3, 5)", -10), ("semiLinear(0, 3, 5)", 0),
        ("Modelica.Constants.pi", math.pi), ("Modelica.Units.Conversions.from_rpm(60)", 2 * math.pi),
        ("Modelica.Units.Conversions.from_degC(20)", 293.15), ("Modelica.SIunits.Conversions.to_degC(300)", 26.85),
        ("Modelica.Units.Conversions.to_kmh(10)", 36),
    ],
)  # fmt: skip
def test_functions_of_numbers(text: str, expected: Any) -> None:
    assert value(text) == pytest.approx(expected, rel=1e-15, abs=1e-13)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 / 0", "a division by zero"),
        ("mod(1, 0)", "a division by zero"),
        ("linspace(1, 2, 1)", "a division by zero"),
        ("sqrt(-1)", "this cannot be evaluated: math domain error"),
        ("(-8) ^ (1 / 3)", "this cannot be evaluated: math domain error"),
        ("10 ^ 400", "this cannot be evaluated: math range error"),
        ("size(zeros(0), 2)", "this cannot be evaluated: tuple index out of range"),
        ("size(3, 1)", "this cannot be evaluated: object of type 'int' has no len()"),
        ('2 + "a"', "'a' is a string; expected a number"),
        ("1:2.5", "expected whole numbers, as in 1:n"),
        ("0.5:2", "expected whole numbers, as in 1:n"),
        ("1:1e400", "expected whole numbers, as in 1:n"),
        ("1:0:3", "expected whole numbers, as in 1:n"),
        ("1:0.5:3", "expected whole numbers, as in 1:n"),
        ("1:time", "this has to be a whole number, known when the model is built; it depends on time"),
        ("{k for k in 3}", "expected a range, such as 1:n"),
        ("{k for k in {time}}", "this has to be a range such as 1:n, known when the model is built; it depends on (time,)"),
        ("{1, 2} * {3, 4}", "arrays of these sizes are not supported with '*'"),
        ("{1, 2} + {3, 4, 5}", "arrays of these sizes are not supported with '+'"),
        ("{1, 2} < 3", "arrays of these sizes are not supported with '<'"),
        ("{1, 2} >= {3, 1}", "arrays of these sizes are not supported with '>='"),
        ("min(1, 2, 3)", "min() takes 2 arguments, got 3"),
        ("max()", "max() takes 2 arguments, got 0"),
        ("sin()", "sin() takes 1 arguments, got 0"),
        ("sin(x = 1)", "sin: arguments by name are not supported"),
        ("mod(time, 2)", "mod() is read of numbers known when the model is built only; got time"),
        ("sum({1}, {2})", "sum() takes 1 arguments, got 2"),
        ("der()", "der() takes 1 arguments, got 0"),
        ("smooth(1)", "smooth() takes 2 arguments, got 1"),
        ("initial(1)", "initial() takes 0 arguments, got 1"),
        ("sample(1)", "sample() takes 2 arguments, got 1"),
        ("semiLinear(1, 2)", "semiLinear() takes 3 arguments, got 2"),
        ("homotopy(simplified = 3)", "homotopy() without its actual value"),
        ("not 3", "expected a condition, such as w > 0"),
        ('if "a" then 1 else 2', "expected a condition, such as w > 0"),
        ("Modelica.Units.Conversions.from_deg(1, 2)", "Modelica.Units.Conversions.from_deg() takes 1 arguments, got 2"),
    ],
)  # fmt: skip
def test_what_has_no_value_is_refused(text: str, said: str) -> None:
    with pytest.raises(ModelicaError) as problem:
        value(text)
    place, _, message = str(problem.value).partition(": ")
    assert message == said
    assert place.startswith("M.mo, line 2, column ")
    assert int(place.rpartition(" ")[2]) <= len(text)


# ---------------------------------------------------------------- of variables

DECLARED = """
    input Real u; Real x, y; Boolean b; discrete Real d; discrete Integer n; parameter Real k = 2; parameter Integer p = 3;
    parameter Boolean on = true; parameter Real row[3] = {1, 2, 4}; constant Real c = 5; parameter String said = "so";
"""


def equations(text: str) -> tuple[Any, list[Any]]:
    """A component with the variables above, and its equations."""
    component = gl.read_modelica(f"model M {DECLARED} equation {text} end M;")()
    return component, equations_of(component)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x + y * u", lambda c: c.x + c.y * c.u),
        ("x - y / 2", lambda c: c.x - c.y / 2.0),
        ("2 * 3 * x", lambda c: 6.0 * c.x),
        ("x ^ 2", lambda c: c.x**2),
        ("x ^ 0.5", lambda c: gl.sqrt(c.x)),
        ("x ^ 2.0", lambda c: c.x**2),
        ("x ^ 0.3", lambda c: c.x**0.3),
        ("2 ^ x", lambda c: 2**c.x),
        ("k * p", lambda c: 3.0 * real_symbol("k")),
        ("c * p", lambda c: 15.0),
        ("row[2] + row[p]", lambda c: 6),
        ("sum(row)", lambda c: 7),
        ("sum(row[2:3])", lambda c: 6),
        ("sum(row[:])", lambda c: 7),
        ("sum(row * x)", lambda c: 7.0 * c.x),
        ("product({x, y, 2})", lambda c: 2.0 * c.x * c.y),
        ("max({x, y, 2})", lambda c: gl.no_event(gl.Max(c.x, c.y, 2))),
        ("min(x, 2)", lambda c: gl.no_event(gl.Min(c.x, 2))),
        ("abs(x)", lambda c: gl.no_event(abs(c.x))),
        ("sign(x)", lambda c: gl.no_event(gl.sign(c.x))),
        ("sin(x)", lambda c: gl.sin(c.x)),
        ("log10(x)", lambda c: gl.log(c.x) / math.log(10)),
        ("atan2(x, y)", lambda c: gl.atan2(c.x, c.y)),
        ("der(x)", lambda c: gl.der(c.x)),
        ("time", lambda c: gl.time),
        ("noEvent(x)", lambda c: gl.no_event(c.x)),
        ("smooth(1, x)", lambda c: c.x),
        ("homotopy(x, y)", lambda c: c.x),
        ("semiLinear(x, 2, y)", lambda c: gl.Piecewise((2.0 * c.x, c.x >= 0), (c.x * c.y, True))),
        ("pre(n)", lambda c: gl.pre(c.n)),
        ("pre(d)", lambda c: gl.pre(c.d)),
        ("pre(x)", lambda c: c.x),
        ("if x > 1 then y else 2", lambda c: gl.Piecewise((c.y, c.x > 1), (2, True))),
        ("if on then x else y", lambda c: c.x),
        ("if not on then x else y", lambda c: c.y),
        ("if x > 1 then 1 elseif on then 2 elseif y > 1 then 3 else 4", lambda c: gl.Piecewise((1, c.x > 1), (2, True))),
        ("if x > 1 then 1 elseif on then 2 elseif y > 1 then 1 / 0 else 1 / 0", lambda c: gl.Piecewise((1, c.x > 1), (2, True))),
        ("if on then x elseif x > 1 then 1 / 0 else 1 / 0", lambda c: c.x),
        ("if not on then 1 / 0 elseif x > 1 then 2 else 3", lambda c: gl.Piecewise((2, c.x > 1), (3, True))),
        ("if not on then 1 elseif x > 1 then 2 else 3", lambda c: gl.Piecewise((2, c.x > 1), (3, True))),
        ("if noEvent(x > 1) then 2 else 3", lambda c: gl.no_event(gl.Piecewise((2, c.x > 1), (3, True)))),
        ("if noEvent(x > 1) then 2 elseif y > 1 then 4 else 3",
         lambda c: gl.Piecewise((2, c.x > 1), (4, c.y > 1), (3, True))),
        ("if b then 2 else 3", lambda c: gl.Piecewise((2, gl.holds(c.b)), (3, True))),
        ("if pre(b) then 2 else 3", lambda c: gl.Piecewise((2, gl.holds(gl.pre(c.b))), (3, True))),
        ("if k then 2 else 3", lambda c: gl.Piecewise((2, real_symbol("k") > 0.5), (3, True))),
        ("if said == \"so\" then 2 else 3", lambda c: 2),
        ("Modelica.Units.Conversions.from_degC(x)", lambda c: c.x * 1.0 + 273.15),
        ("Modelica.Units.Conversions.to_rpm(x)", lambda c: c.x * 30 / math.pi),
    ],
)  # fmt: skip
def test_expressions_of_variables(text: str, expected: Any) -> None:
    component, (found,) = equations(f"x = {text};")
    assert found == gl.Eq(component.x, expected(component))


@pytest.mark.parametrize("name", ["f", "sign", "floor", "sum", "smooth", "noEvent"])
def test_a_function_of_the_text_hides_the_built_in_one_of_its_name(name: str) -> None:
    for declared in (f"function {name} = Modelica.Math.sin;", f"function {name} input Real x; output Real y; end {name};"):
        with pytest.raises(ModelicaError, match=f"user-defined functions, such as {name}, are not supported"):
            equations_of(gl.read_modelica(f"model M {declared} Real x; equation x = {name}(2); end M;")())
    imported = gl.read_modelica(f"model M import {name} = Modelica.Math.exp; Real x; equation x = {name}(time); end M;")()
    assert equations_of(imported) == [gl.Eq(imported.x, gl.exp(gl.time))]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x > 1", lambda c: c.x > 1),
        ("x >= y", lambda c: c.x >= c.y),
        ("x < 1 and y > 2", lambda c: gl.And(c.x < 1, c.y > 2)),
        ("x < 1 or y > 2", lambda c: gl.Or(c.x < 1, c.y > 2)),
        ("x < 1 and on", lambda c: c.x < 1),
        ("x < 1 or not on", lambda c: c.x < 1),
        ("not x < 1", lambda c: gl.Not(c.x < 1)),
        ("not b", lambda c: gl.Not(gl.holds(c.b))),
        ("n == 2", lambda c: gl.equals(c.n, 2)),
        ("2 == n", lambda c: gl.equals(c.n, 2)),
        ("n <> 2", lambda c: gl.Not(gl.equals(c.n, 2))),
        ("b == true", lambda c: gl.equals(c.b, 1)),
        ("b == (x > 1)", lambda c: gl.equals(c.b, gl.Piecewise((1, c.x > 1), (0, True)))),
        ("edge(b)", lambda c: gl.And(gl.holds(c.b), gl.Not(gl.holds(gl.pre(c.b))))),
        ("change(n)", lambda c: gl.Not(gl.equals(c.n, gl.pre(c.n)))),
        ("initial()", lambda c: gl.initial()),
        ("sample(1, 2)", lambda c: gl.sample(2, 1)),
        ("noEvent(x > 1)", lambda c: c.x > 1),
    ],
)  # fmt: skip
def test_conditions(text: str, expected: Any) -> None:
    component, (found,) = equations(f"when {text} then d = 1; end when;")
    assert found == gl.When(expected(component), gl.Eq(component.d, 1))


@pytest.mark.parametrize(("text", "known"), [("x > 1 or on", True), ("x > 1 and not on", False), ("on and p > 2", True)])
def test_conditions_that_parameters_decide(text: str, known: bool) -> None:
    component, (found,) = equations(f"if {text} then x = 1; else x = 2; end if;")
    assert found == gl.Eq(component.x, 1 if known else 2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = row[4];", "the index of row is 4; expected 1 to 3"),
        ("x = row[0];", "the index of row is 0; expected 1 to 3"),
        ("x = row[1.5];", "the index of row is 1.5; expected 1 to 3"),
        ("x = sum(row[2:4]);", "the index of row is (2, 3, 4); expected 1 to 3"),
        ("x = row[x];", "this has to be an index, known when the model is built; it depends on x"),
        ("x = k[1];", "k is not an array"),
        ("x = y.z;", "y.z is not supported: what stands before '.z' is not a component"),
        ("x = yy;", "nothing is called 'yy' here; did you mean 'y'?"),
        ("x = f(1);", "the function f() is not supported; "),
        ("x = said;", "'so' is a string; expected a number"),
        ("x = if x + 1 then 1 else 2;", "expected a condition, such as w > 0"),
        ("x = {1, 2};", "the two sides are arrays of different sizes"),
        ("{x, y} = {1, 2, 3};", "the two sides are arrays of different sizes"),
        ("if x > 1 then x = 1; end if;", "an if-equation whose condition may vary needs an else-branch"),
        ("if x > 1 then x = 1; y = 2; else x = 2; end if;", "the branches have different numbers of equations"),
        ("if x > 1 then when y > 1 then d = 1; end when; else x = 2; end if;", "when-equations within if-equations are not supported"),
        ("when x > 1 then when y > 1 then d = 1; end when; end when;", "expected equations of discrete variables, or reinit"),
        ("when true then d = 1; end when;", "When(): the condition is True, and never becomes true"),
        ("sin(x);", "sin() as an equation is not supported"),
    ],
)  # fmt: skip
def test_what_is_refused_of_variables(text: str, said: str) -> None:
    with pytest.raises(ModelicaError) as problem:
        equations(text)
    assert str(problem.value).partition(": ")[2].startswith(said)
