"""Values of parameters and inputs: numbers, and expressions as shared equations."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
from gearlib.equations.bindings import (
    MOST_NUMBERS,
    bind_input,
    canonical,
    is_computable,
    is_expression,
    number,
    parameter_function,
)
from gearlib.equations.template import Template
from gearlib.errors import BindingError, BoundError

w, k, b, phi = (sympy.Symbol(name, real=True) for name in ("load.w", "k", "b", "load.phi"))
t = gl.time


def bound(expression: Any, **known: Any) -> tuple[Template, dict[str, str], dict[str, Any]]:
    return bind_input(expression, lambda name: name in {"k", "b", "p0", "p1"}, "motor.tau", **known)


def meant(expression: Any, **known: Any) -> Any:
    """What a binding says, with the names that its own ones stand for put back."""
    template, variables, values = bound(expression, **known)
    table: dict[Any, Any] = {}
    for key, value in values.items():
        table[sympy.Symbol(key, real=True)] = sympy.Symbol(value, real=True) if isinstance(value, str) else sympy.Float(value)
    for key, path in variables.items():
        for order in range(3):
            name = "der(" * order + "{}" + ")" * order
            table[sympy.Symbol(name.format(key), real=True)] = sympy.Symbol(name.format(path), real=True)
    assert template.binds
    assert set(template.parameters) <= set(values)
    return (sympy.Symbol("bound", real=True) - template.residual).xreplace(table)


@pytest.mark.parametrize(
    "expression",
    [
        2.5 * gl.sin(3 * t + 0.5), -k * w + 4, k**2 * gl.exp(-t / 3) + b, gl.pi * t, 7, -0.0, 1, gl.pi,
        gl.der(w) * 2 - gl.der(gl.der(phi)) + w,
        gl.Piecewise((3 * t, t < 2), (k, True)), gl.Piecewise((1.5 * w, t < k), (2, t < 4.5), (0, True)), w**3 - t**-2,
    ],
)  # fmt: skip
def test_a_binding_says_what_was_written(expression: Any) -> None:
    said, point = meant(expression), {w: 1.3, k: 0.7, b: -2.0, phi: 0.4, gl.der(w): 5.0, gl.der(gl.der(phi)): -3.0}
    for time in (0.9, 3.1, 5.0):
        wanted = float(sympy.sympify(expression).subs(point).subs(t, time))
        held = bound(expression)[0].relations
        flags = {}
        for i, r in enumerate(held):
            g = r.g.subs({sympy.Symbol(p, real=True): v for p, v in bound(expression)[2].items() if not isinstance(v, str)})
            g = g.subs({sympy.Symbol(p, real=True): 0.7 for p, v in bound(expression)[2].items() if v == "k"}).subs(t, time)
            flags[sympy.Symbol(f"relation({i})", real=True)] = int(bool(g < 0 if r.negated else g > 0))
        assert float(said.subs(point).subs(t, time).subs(flags)) == pytest.approx(wanted, rel=1e-15)


def test_symbols_may_have_the_names_that_the_shared_equation_uses() -> None:
    p0, p1, v0, v1, own = symbols = sympy.symbols("p0 p1 v0 v1 bound", real=True)
    beyond = gl.Piecewise((4 * v1, p1 - 3 * v0 > 0), (2 * p0, True))
    expression = 10 * p0 + 7 * p1 * gl.sin(2 * t) - 3 * v1 * v0 + own / 4
    said = meant(expression) - expression
    assert float(said.subs(dict(zip(symbols, (1.1, 1.3, 1.7, 1.9, 2.3), strict=True))).subs(t, 0.6)) == pytest.approx(
        0, abs=1e-14
    )
    template, variables, values = bound(beyond)
    (relation,) = template.relations
    point = {key: {"v0": 1.7, "v1": 1.9}[path] for key, path in variables.items()}
    point |= {key: {"p0": 1.1, "p1": 1.3}.get(value, value) for key, value in values.items()}
    g = relation.g.subs({sympy.Symbol(key, real=True): value for key, value in point.items()})
    assert float(g) == pytest.approx(1.3 - 3 * 1.7)


def test_numbers_become_parameters_except_zero_one_and_exponents() -> None:
    template, variables, values = bound(2.5 * gl.sin(3.5 * t) + w**2 - 1)
    assert sorted(values.values()) == [2.5, 3.5]
    assert variables == {"v0": "load.w"}
    assert sorted(s.name for s in template.residual.free_symbols) == ["bound", "p0", "p1", "time", "v0"]
    assert bound(10 * gl.sin(31.4 * t))[0] is bound(20 * gl.sin(6.28 * t))[0], "one equation for all"
    assert bound(4.0)[0] is bound(-3)[0] is bound(gl.pi)[0]
    assert bound(gl.pi)[2] == {"p0": np.pi}


def test_a_variable_and_its_derivatives_are_one() -> None:
    _, variables, values = bound(gl.der(w) + w + phi + k + k * b)
    assert sorted(variables.values()) == ["load.phi", "load.w"]
    assert sorted(values.values()) == ["b", "k"]


@pytest.mark.parametrize(("count", "parameters"), [(MOST_NUMBERS, MOST_NUMBERS), (MOST_NUMBERS + 1, 0)])
def test_a_table_keeps_its_numbers(count: int, parameters: int) -> None:
    terms = [sympy.Float(2.5 + i) * sympy.Symbol(f"x{i}", real=True) for i in range(count)]
    assert len(bound(sympy.Add(*terms))[2]) == parameters


def test_discrete_variables_are_named_by_their_number() -> None:
    mode = sympy.Symbol("clutch.mode", real=True)
    numbers = {"clutch.mode": 5}
    template, variables, values = bound(gl.pre(mode) + 3 * mode, discrete=lambda name: numbers.get(name, -1))
    assert template.discretes == ("discrete[5]", "pre(discrete[5])")
    assert (variables, values) == ({}, {"p0": 3.0})
    first, _, _ = bound(mode + w, discrete=lambda name: 0 if name == "clutch.mode" else -1)
    assert first.discretes == ("discrete[0]",)
    held = gl.Piecewise((2.0, gl.holds(mode)), (3.0, True))
    assert bound(held, discrete=lambda name: numbers.get(name, -1))[0].relations == (), "it changes at events only"


@pytest.mark.parametrize("given", [k, k + 1, t, sympy.Integer(3), gl.pi, 2.0, "k", None])
def test_what_is_an_expression(given: Any) -> None:
    assert is_expression(given) is (given in (k, k + 1, t))


def test_parameters_of_an_expression_are_numbered_by_name() -> None:
    assert canonical(k) == (sympy.Symbol("a0", real=True), ("k",))
    expression, names = canonical(k * 2 - b / w)
    assert names == ("b", "k", "load.w")
    assert parameter_function(expression, ("a0", "a1", "a2"))(4.0, np.array([1.0, 2.0]), 8.0) == pytest.approx([1.5, 3.5])
    foreign, names = canonical(2 * sympy.Symbol("k", positive=True) + sympy.Symbol("k"))
    assert (parameter_function(foreign, ("a0",))(3.0), names) == (9.0, ("k",)), (
        "symbols of other kinds are the real ones of their names"
    )


def test_derivatives_by_a_parameter() -> None:
    expression, _ = canonical(k * 2 - b / w)
    assert parameter_function(expression, ("a0", "a1", "a2"), "a2")(4.0, 1.0, 8.0) == pytest.approx(4.0 / 64)
    size, _ = canonical(gl.Max(abs(k), 3))
    assert [parameter_function(size, ("a0",), "a0")(v) for v in (-5.0, 1.0, 5.0)] == [-1.0, 0.0, 1.0]


@pytest.mark.parametrize("given", [2, 2.0, np.float64(2), np.int32(2), Fraction(4, 2), sympy.Integer(2), sympy.sqrt(4)])
def test_numbers(given: Any) -> None:
    assert number(given, "m.J", "kg.m2", "inertia") == 2.0


@pytest.mark.parametrize(
    ("given", "description", "error", "message"),
    [
        (True, "", BindingError, r"^m\.J is True \(bool\); expected a number in kg\.m2$"),
        (np.True_, "inertia", BindingError, r"expected a number in kg\.m2 \(inertia\)$"),
        (np.timedelta64(3, "s"), "", BindingError, r"\(timedelta64\); expected a number"),
        (np.complex128(1), "", BindingError, "complex128"),
        ("2", "", BindingError, r"is '2' \(str\)"),
        (2 * k, "", BindingError, r"m\.J is 2\*k; expected .*, or an expression of the enclosing"),
        (10**400, "", BoundError, r"^m\.J is too large; expected a finite number in kg\.m2$"),
        (-np.inf, "", BoundError, r"^m\.J is -inf; expected a finite number in kg\.m2$"),
    ],
)  # fmt: skip
def test_what_is_no_number(given: Any, description: str, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        number(given, "m.J", "kg.m2", description)


def test_functions_that_gearlib_has_can_be_computed() -> None:
    """Whatever their value is at a point: the logarithm of zero is one, too."""
    a, other = sympy.symbols("a0 a1", real=True)
    known = {sympy.sin(a) + other: True, sympy.log(a - other): True, 1 / (a - 1): True, a**other: True}
    unknown = {sympy.gamma(a): False, sympy.Function("g")(a) * other: False}
    for expression, there in (known | unknown).items():
        assert is_computable(expression, ("a0", "a1")) is there, expression


@pytest.mark.parametrize("given", [0, 1, -1, 7, 2.5, gl.pi])
def test_a_number_is_a_parameter_of_its_own(given: Any) -> None:
    template, variables, values = bound(given)
    assert (variables, values) == ({}, {"p0": float(given)})
    assert template.residual == sympy.Symbol("bound", real=True) - sympy.Symbol("p0", real=True)
    assert (template.columns, template.parameters, template.relations) == ((("bound", 0),), ("p0",), ())


@pytest.mark.parametrize("given", [k, 1 + k, k * w, sympy.S.One / k])
def test_what_holds_no_number_brings_none(given: Any) -> None:
    assert all(isinstance(value, str) for value in bound(given)[2].values())


@pytest.mark.parametrize(
    ("given", "numbers"),
    [
        (2.5 ** gl.sin(3 * t), [2.5, 3.0]), (gl.sin(3 * t) ** 2, [3.0]), (gl.sin(2 * t) ** 2.5, [2.0]),
        (gl.Piecewise((w, t < 2), (0, True)), [2.0]), (gl.Piecewise((1, t < 2), (-1, True)), [2.0]),
        (gl.Piecewise((3 * t, t < 2), (gl.cos(4 * t), True)), [2.0, 3.0, 4.0]),
    ],
)  # fmt: skip
def test_numbers_of_a_power_and_of_branches(given: Any, numbers: list[float]) -> None:
    """Zeros, ones and exponents stay."""
    values = bound(given)[2]
    assert sorted(abs(float(v)) for v in values.values()) == numbers
    assert list(values) == [f"p{i}" for i in range(len(numbers))]
