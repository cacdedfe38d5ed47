"""Expressions of equations: derivatives, and what is no expression."""

from __future__ import annotations

from typing import Any

import pytest
import sympy

import gearlib as gl
from gearlib.errors import DeclarationError
from gearlib.language.expressions import DEEPEST, check_depth

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
