"""Expressions of equations: derivatives, and what is no expression."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
from gearlib.equations.kernel import array_function, scalar_source
from gearlib.errors import DeclarationError
from gearlib.language.expressions import (
    DEEPEST,
    JustBefore,
    SquareWave,
    alternates,
    as_condition,
    as_number,
    check_depth,
    real_symbol,
    total_derivative,
    value_of,
)

x, y, k = sympy.symbols("x y k", real=True)
dx, dy = sympy.Symbol("der(x)", real=True), sympy.Symbol("der(y)", real=True)


@pytest.mark.parametrize(
    ("expression", "derivative"),
    [
        (x, dx),
        (3, 0),
        (x * y, dx * y + x * dy),
        (gl.sin(x), gl.cos(x) * dx),
        (gl.time**2 * x, 2 * gl.time * x + gl.time**2 * dx),
        (dx, sympy.Symbol("der(der(x))", real=True)),
    ],
)
def test_total_derivative(expression: Any, derivative: Any) -> None:
    assert sympy.expand(gl.der(expression) - derivative) == 0


@pytest.mark.parametrize("wrong", ["x", None, object(), [1]])
def test_derivative_of_something_else(wrong: Any) -> None:
    with pytest.raises(
        DeclarationError, match=r"argument of der\(\) is .*; expected .* expression of variables, such as self\.w"
    ):
        gl.der(wrong)


def test_an_equation_is_not_evaluated() -> None:
    assert gl.Eq(x, x).residual == 0
    assert gl.Eq(x, y).residual == x - y
    assert gl.Eq(x, 2) == gl.Eq(x, 2)


def leaf(right: Any) -> gl.Component:
    """A component with the one equation x = right(self)."""

    class Leaf(gl.Component):
        x = gl.Variable("1", "unknown")
        p = gl.Parameter("1", "number", default=2.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.x, right(self))]

    return Leaf()


@pytest.mark.parametrize(
    ("right", "message"),
    [
        (lambda s: "speed", r"Leaf.equations..: .*'speed'; expected .*text is never evaluated; write self\.speed"),
        (lambda s: None, "Leaf.equations..: x == None is not an equation"),
        (lambda s: [1, 2], r"Leaf.equations..: x == \[1, 2\] is not an equation"),
        (lambda s: s, "Leaf.equations..: x == <Leaf> is not an equation"),
        (lambda s: 1j, "is not an equation: the right side is .*; expected a number or an expression"),
        (lambda s: float("nan"), "is not an equation: the right side is .*; expected a number or an expression"),
        (lambda s: float("inf"), "is not an equation: the right side is .*; expected a number or an expression"),
        (lambda s: s.x / 0, "expected a real expression"),
        (lambda s: sympy.Matrix([1, 2]), "is not an equation"),
        (lambda s: sympy.Symbol("speed"), "'speed' is not declared; Valid names: x"),
        (lambda s: sympy.Function("f")(s.x), r"holds f\(x\), which is not a function of gearlib"),
        (lambda s: sympy.Derivative(s.x, gl.time), r"which is not a function of gearlib; the time derivative is gl\.der\(x\)"),
        (lambda s: sympy.Integral(s.x, gl.time), "which is not a function of gearlib"),
        (lambda s: sympy.floor(s.x), r"floor\(x\), which is not a function of gearlib"),
        (lambda s: gl.Piecewise((1, s.x > 1)), r"no value where no condition is true; end it with \(value, True\)"),
        (lambda s: gl.Piecewise((1, sympy.Eq(s.x, 0)), (0, True)), "equality of real numbers is not an event"),
        (lambda s: 1 if s.x > 0 else 2, r"Leaf\.equations\(\): .*use gl\.Piecewise.* instead of if"),
        (lambda s: __import__("math").sin(s.x), r"Leaf\.equations\(\): .*use gl\.sin, gl\.sqrt"),
        (lambda s: __import__("numpy").sin(s.x), r"Leaf\.equations\(\): .*use gl\.sin, gl\.sqrt"),
    ],
)
def test_slips_in_an_equation(right: Any, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        gl.compile(leaf(right))


def test_symbols_without_assumptions_are_the_declared_ones() -> None:
    # a user's sympy.Symbol("p") is another symbol than the declared one, which is real
    result = gl.compile(leaf(lambda s: sympy.Symbol("p") + 1)).simulate(1.0, samples=2)
    assert result["x"].tolist() == [3.0, 3.0]


def test_derivative_of_a_parameter_is_zero() -> None:
    assert gl.compile(leaf(lambda s: gl.der(s.p * s.p) + 5)).simulate(1.0, samples=2)["x"].tolist() == [5.0, 5.0]


def test_functions_have_names_documentation_and_a_number_of_arguments() -> None:
    assert (gl.sin.__name__, gl.sin.__doc__) == ("sin", "sin of a number or an expression.")
    assert (gl.atan2.__name__, gl.atan2.__doc__) == ("atan2", "atan2 of numbers or expressions.")
    for function, arguments, said in (
        (gl.sin, (x, y), r"sin\(\) takes 1 argument, got 2"),
        (gl.atan2, (x,), r"atan2\(\) takes 2 arguments, got 1"),
    ):
        with pytest.raises(TypeError, match=said):
            function(*arguments)


def test_depth_is_counted_before_sympy_works_on_an_expression() -> None:
    """As deep as is allowed passes; one level more is refused by name, also where sympy could still follow."""
    deep = x
    for _ in range(DEEPEST - 1):
        deep = sympy.sin(deep)
    check_depth(deep, "Part")
    check_depth(3.0, "Part")
    with pytest.raises(DeclarationError, match="Part: an expression is nested too deeply"):
        check_depth(sympy.sin(deep), "Part")


@pytest.mark.parametrize(
    ("given", "found"),
    [
        (2, sympy.Integer(2)), (2.5, sympy.Float(2.5)), (np.int64(3), sympy.Integer(3)), (np.float32(0.5), sympy.Float(0.5)),
        (np.array(4.0), sympy.Float(4.0)),
        (Fraction(1, 3), sympy.Rational(1, 3)), (x, x), (x + 1, x + 1), (gl.pi, sympy.pi), (np.array(7), sympy.Integer(7)),
        (sympy.Float(2.0), sympy.Float(2.0)),
    ],
)  # fmt: skip
def test_numbers_and_expressions(given: Any, found: Any) -> None:
    assert as_number(given, "a value") == found
    assert type(as_number(given, "a value")) is type(found)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("w", r"a value is 'w'; expected a number or an expression of variables, .* \(text is never evaluated; write self\.w\)$"),
        ("2*w", r"a value is '2\*w'; expected .* \(text is never evaluated\)$"), (True, "a value is True; expected a number"),
        (x > 1, r"\(a condition is not a number; gl\.Piecewise\(\(1, condition\), \(0, True\)\) makes it one\)"),
        (math.inf, "a value is inf; expected .*, and finite"),
        (sympy.oo, "and finite"), (sympy.nan, "and finite"), (sympy.I, "and finite"), (10**400, "a value"),
        (np.ones(2), "expected a number"), (None, r"such as self\.w or self\.flange_a\.phi$"),
    ],
)  # fmt: skip
def test_what_is_no_number(wrong: Any, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        as_number(wrong, "a value")


def test_conditions_are_comparisons() -> None:
    for condition in (x > 1, gl.And(x > 1, y < 2), gl.Or(x > 1, gl.Not(gl.holds(k))), gl.initial()):
        assert as_condition(condition, "the condition") == condition
    for truth in (True, np.True_, sympy.true):
        assert as_condition(truth, "the condition") is sympy.true
    for untruth in (False, np.False_):
        assert as_condition(untruth, "the condition") is sympy.false
    for wrong, message in (
        (x, r"the condition is x, which is not a condition; compare it, as in x > 0 \(a discrete variable: gl\.holds\(\.\.\.\)\)"),
        (sympy.And(x > 1, sympy.Symbol("b")), "the condition is b, which is not a condition; compare it"),
        (1, r"the condition is 1, which is not a condition; expected a comparison, such as self\.x > 0\.5"),
        (x + 1, "the condition is x \\+ 1, which"),
    ):  # fmt: skip
        with pytest.raises(DeclarationError, match=message):
            as_condition(wrong, "the condition")


def test_the_value_of_a_condition_is_one_or_zero() -> None:
    assert [value_of(v) for v in (True, False, np.True_, sympy.false)] == [1, 0, 1, 0]
    held = value_of(x > 1)
    assert [held.subs(x, v) for v in (2, 0)] == [1, 0]
    assert value_of(x) is x


@pytest.mark.parametrize("name", ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt"])
def test_functions_are_those_of_their_names(name: str) -> None:
    at = 0.37
    expected = getattr(math, name)(at)
    assert float(getattr(gl, name)(at)) == pytest.approx(expected, rel=1e-15)
    assert float(getattr(gl, name)(x).subs(x, at)) == pytest.approx(expected, rel=1e-15)
    with pytest.raises(DeclarationError, match=rf"the argument of {name}\(\) is 'x'"):
        getattr(gl, name)("x")


def test_functions_of_several_numbers() -> None:
    assert float(gl.atan2(-1.0, -2.0)) == math.atan2(-1, -2)
    assert [gl.sign(v) for v in (-2, 0, 5)] == [-1, 0, 1]
    assert (gl.Max(1, 5, 3), gl.Min(4, 2, 8), gl.Max(x), gl.Min(y)) == (5, 2, x, y)
    assert gl.Max(x, y).subs({x: 1, y: 2}) == 2
    assert gl.Min(x, y).subs({x: 1, y: 2}) == 1
    for function, name in ((gl.Max, "Max"), (gl.Min, "Min")):
        with pytest.raises(DeclarationError, match=rf"{name}\(\) is given nothing; expected one or more numbers"):
            function()
        with pytest.raises(DeclarationError, match=rf"an argument of {name}\(\) is 'a'"):
            function(x, "a")
    with pytest.raises(DeclarationError, match=r"log\(0\) is zoo"):
        gl.log(0)


def test_truth_tables() -> None:
    for a in (0, 2):
        for b in (0, 2):
            point = {x: a, y: b}
            assert bool(gl.And(x > 1, y > 1).subs(point)) == (a > 1 and b > 1)
            assert bool(gl.Or(x > 1, y > 1).subs(point)) == (a > 1 or b > 1)
        assert bool(gl.Not(x > 1).subs(x, a)) == (not a > 1)
    for function in (gl.And, gl.Or):
        with pytest.raises(DeclarationError, match=rf"an argument of {function.__name__}\(\) is 3, which is not a condition"):
            function(x > 1, 3)
    with pytest.raises(DeclarationError, match=r"the argument of Not\(\) is x, which is not a condition"):
        gl.Not(x)


def test_branches_are_pairs() -> None:
    law = gl.Piecewise((x, x < 1), [2, x < 2], sympy.Tuple(3, x < 3), (x > 4, True))
    assert [law.subs(x, v) for v in (0.5, 1.5, 2.5, 3.5, 4.5)] == [0.5, 2, 3, 0, 1]
    for branches, message in (
        ((), r"Piecewise\(\) is given nothing; expected \(value, condition\), \.\.\., \(value, True\)"),
        (("ab",), r"^Piecewise\(\) is given 'ab'; expected \(value, condition\), such as"),
        ((3,), r"is given 3; expected \(value, condition\), such as"),
        (((1, x > 0, 2),), "expected .value, condition."),
        (((1, False), (2, True)), r"the condition of 1 is False; == compares at once, gl\.equals\(variable, value\)"),
        (((1, np.False_),), "the condition of 1 is False"), ((("a", True),), r"a value of Piecewise\(\) is 'a'"),
        (((1, x),), r"a condition of Piecewise\(\) is x"),
    ):  # fmt: skip
        with pytest.raises(DeclarationError, match=message):
            gl.Piecewise(*branches)


def test_when_has_a_condition_actions_and_others_in_order_of_precedence() -> None:
    third = gl.When(x > 3, gl.Eq(k, 3))
    second = gl.When(x > 2, gl.Eq(k, 2), elsewhen=third)
    first = gl.When(x > 1, gl.Eq(k, 1), gl.reinit(y, 0), elsewhen=second)
    assert first.branches == (first, second, third)
    assert third.branches == (third,)
    assert (first.condition, len(first.actions), third.elsewhen) == (x > 1, 2, None)
    for make, message in (
        (lambda: gl.When(x > 1, 3), r"When\(\) is given 3; expected gl\.Eq\(discrete variable, \.\.\.\) or gl\.reinit"),
        (lambda: gl.When(x > 1, elsewhen=3), r"elsewhen is 3; expected another gl\.When\(condition"),
        (lambda: gl.When(True), "the condition is True, and never becomes true; .*gl.initial"),
        (lambda: gl.When(False, gl.Eq(k, 1)), "the condition is False, and never becomes true"),
        (lambda: gl.When(x), r"the condition of When\(\) is x"),
        (lambda: gl.reinit(2 * x, 1), r"reinit\(\) is given 2\*x; expected a state"),
        (lambda: gl.reinit(x, "y"), r"the new value of x in reinit\(\) is 'y'"),
        (lambda: gl.pre(3), r"pre\(3\): expected a discrete variable, such as self\.mode"),
        (lambda: gl.sample(0), r"the period is 0; expected a positive number"),
        (lambda: gl.sample(-0.5), "the period is -0.5; expected"), (lambda: gl.sample("a"), r"the period of sample\(\) is 'a'"),
        (lambda: gl.sample(1, "a"), r"the offset of sample\(\) is 'a'"),
    ):  # fmt: skip
        with pytest.raises(DeclarationError, match=message):
            make()


def test_conditions_on_discrete_variables() -> None:
    assert gl.pre(k) == real_symbol("pre(k)")
    assert [bool(gl.holds(k).subs(k, v)) for v in (0, 1, -2)] == [False, True, True]
    assert [bool(gl.equals(k, 2).subs(k, v)) for v in (0, 1, 2)] == [False, False, True]
    assert [bool(gl.equals(k, True).subs(k, v)) for v in (0, 1)] == [False, True]
    assert [bool(gl.initial().subs(real_symbol("initial()"), v)) for v in (0, 1)] == [False, True]
    for found, offset in ((gl.sample(0.5), 0), (gl.sample(0.5, 0.1), 0.1)):
        assert found.lhs.args == (0.5, offset)
    assert alternates(0.5).lhs.args == (gl.time, 0.5, 0)
    assert gl.sample(k).lhs.args[0] == k


@pytest.mark.parametrize("t", [-3.0, 0.5, 0.99, 1.25, 1.75, 2.2, 2.75, 7.9])
def test_square_waves_and_times_just_before(t: float) -> None:
    """In both printings: negative before the offset 1, positive from then on for half a second, and so on."""
    wave, before = SquareWave(x, sympy.Float(0.5), sympy.Float(1.0)), JustBefore(x)
    positive = t >= 1.0 and math.floor((t - 1.0) / 0.5) % 2 == 0
    for value in (array_function((x,), wave)(np.array([t]))[0], eval(scalar_source(wave), {"sin": math.sin, "x": t})):
        assert (value > 0) == positive
        assert abs(value) <= 1.0
    at, moving = {x: 3.5, k: 0.5, y: 1.0}, SquareWave(x, k, y)  # the fifth period begins
    slopes = [float(sympy.diff(moving, symbol).subs(at)) for symbol in (x, k, y)]
    assert [-slope / slopes[0] for slope in slopes[1:]] == pytest.approx([5.0, 1.0])
    for value in (array_function((x,), before)(np.array([t]))[0], eval(scalar_source(before), {"x": t})):
        assert t - value == pytest.approx(2e-12 * abs(t), rel=1e-3)
    assert array_function((x,), before)(np.array([0.0]))[0] == -2e-15
    assert eval(scalar_source(before), {"x": 0.0}) == -2e-15


@pytest.mark.parametrize("number", [SquareWave(x, 0.5, 1), JustBefore(x), gl.sample(0.5).lhs], ids=lambda e: type(e).__name__)
def test_functions_of_time_are_real_so_that_the_root_of_a_square_is_a_magnitude(number: Any) -> None:
    assert sympy.sqrt(number**2) == abs(number)
    assert number.is_real


def test_time_goes_by_at_the_rate_of_one() -> None:
    assert gl.der(gl.time) == 1


def test_constants_are_not_differentiated() -> None:
    t = gl.time
    assert total_derivative(x * k + t * y, frozenset({"k"})) == dx * k + y + t * dy
    assert total_derivative(k, frozenset({"k"})) == 0
    assert total_derivative(t, frozenset()) == 1
    assert gl.der(gl.time) == 1
    assert gl.no_event(x > 1).args[0].subs(x, 2) == 1
