"""Kernels: one printed computation of a template, for arrays and for scalars alike."""

from __future__ import annotations

import gc
import math
import weakref
from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
from gearlib.equations.kernel import (
    Kernel,
    array_function,
    derivative_of,
    difference_kernel,
    differentiated,
    is_zero_without,
    partial_kernel,
    relation_kernel,
    residual_kernel,
    rest_of,
    solve_kernel,
    terms_of_parameters,
    without_columns,
)
from gearlib.equations.template import Template, template_of

x, y, z, p, q = sympy.symbols("x y z p q", real=True)
POINT = {"x": 0.7, "y": 1.3, "z": -0.4, "p": 2.5, "q": 0.8}
T = 0.35


def make(residual: Any) -> Template:
    return template_of(gl.Eq(residual, 0), "test", lambda name: name in {"p", "q"})


def relations_at(template: Template) -> list[float]:
    table = {sympy.Symbol(k, real=True): v for k, v in POINT.items()}
    return [float(bool((r.g.subs(table) < 0) if r.negated else (r.g.subs(table) > 0))) for r in template.relations]


def arguments(kernel: Kernel) -> list[float]:
    columns = [*kernel.template.columns, *kernel.template.relation_columns]
    values = [POINT[columns[i][0]] if columns[i][1] == 0 else 0.11 * columns[i][1] for i in kernel.columns]
    values += [POINT[kernel.template.parameters[i]] for i in kernel.parameters]
    return values + [relations_at(kernel.template)[i] for i in kernel.relations]


def scalar(kernel: Kernel) -> float:
    names = [*(f"x{i}" for i in kernel.columns), *(f"p{i}" for i in kernel.parameters), *(f"r{i}" for i in kernel.relations)]
    scope = dict(vars(math)) | {"t": T, "sign": np.sign} | dict(zip(names, arguments(kernel), strict=True))
    return float(eval(kernel.scalar, scope))


RESIDUALS = [
    p * x + q * y - gl.sin(gl.time),
    x**2 + y**2 - p**2,
    gl.exp(x / p) * gl.sqrt(y) + gl.log(y) * gl.cos(z),
    gl.atan2(y, x) - gl.tanh(z) + gl.asin(x) * gl.acos(x) - gl.atan(z),
    gl.cosh(x) + gl.sinh(y) + gl.tan(z) + x**3.5 + y**-2 + gl.tan(x + gl.pi / 2),
    gl.Piecewise((p * x, x > q), (y, x > -q), (z, True)),
    gl.Max(x, y, z) + gl.Min(x, y) * gl.sign(z) + abs(z),
    gl.no_event(x + gl.no_event(y)) * p,
    gl.no_event(gl.Max(x, y, z)) + gl.no_event(abs(z)) * gl.no_event(gl.sign(z)),
    gl.Piecewise((1, gl.And(x > 0, y > q)), (2, gl.Or(z > 0, gl.Not(x > 1))), (3, True)) * x,
]


def exact(expression: Any) -> float:
    table = {sympy.Symbol(k, real=True): v for k, v in POINT.items()} | {gl.time: T}
    expression = expression.replace(lambda e: getattr(e.func, "__name__", "") == "no_event", lambda e: e.args[0])
    return float(expression.subs(table))


@pytest.mark.parametrize("residual", RESIDUALS, ids=str)
def test_both_printings_are_the_expression(residual: Any) -> None:
    kernel = residual_kernel(make(residual))
    assert scalar(kernel) == pytest.approx(exact(residual), rel=1e-14)
    arrays = [np.full(3, a) for a in arguments(kernel)]
    assert np.broadcast_to(kernel.function(T, *arrays), 3) == pytest.approx(exact(residual), rel=1e-14)


@pytest.mark.parametrize("residual", RESIDUALS[:5], ids=str)
def test_partial_derivatives_are_those_of_differences(residual: Any) -> None:
    template = make(residual)
    h = 1e-6
    for column, (name, _) in enumerate(template.columns):
        symbol = sympy.Symbol(name, real=True)
        difference = (exact(residual.subs(symbol, symbol + h)) - exact(residual.subs(symbol, symbol - h))) / (2 * h)
        assert scalar(partial_kernel(template, column)) == pytest.approx(difference, rel=1e-7)
        assert scalar(derivative_of(residual_kernel(template), f"x{column}")) == pytest.approx(difference, rel=1e-7)


@pytest.mark.parametrize("column", ["x", "y"])
def test_solved_for_a_column(column: str) -> None:
    residual = p * x - q * y + z**2 + gl.sin(gl.time)
    template = make(residual)
    kernel = solve_kernel(template, [name for name, _ in template.columns].index(column))
    assert kernel is not None
    symbol = sympy.Symbol(column, real=True)
    assert exact(residual.subs(symbol, scalar(kernel))) == pytest.approx(0.0, abs=1e-14)


def test_what_is_not_linear_is_not_solved() -> None:
    template = make(x**2 - y)
    assert solve_kernel(template, [name for name, _ in template.columns].index("x")) is None


def test_residual_without_columns() -> None:
    template = make(p * x + 3 * y + q)
    assert scalar(residual_kernel(template, frozenset(range(2)))) == POINT["q"]
    assert residual_kernel(make(p * x + y), frozenset(range(2))).is_zero


def test_a_kernel_takes_what_stands_in_it() -> None:
    """A variable that stands in a relation only comes after those of the equation."""
    template = make(gl.Piecewise((p * y, x > q * gl.time), (y, x > z), (z, True)))
    names = [name for name, _ in (*template.columns, *template.relation_columns)]
    assert names == ["y", "z", "x", "z"]
    assert (template.parameters, len(template.relations)) == (("p", "q"), 2)
    value, (one, other) = residual_kernel(template), (relation_kernel(template, k) for k in (0, 1))
    assert (value.columns, value.parameters, value.relations) == ((0, 1), (0,), (0, 1))
    assert {(k.columns, k.parameters, k.relations) for k in (one, other)} == {((2,), (1,), ()), ((1, 2), (), ())}
    assert not value.on_time
    for k in (value, one, other):
        used = (
            [f"x{c}" for c in k.columns] + [f"p{c}" for c in k.parameters] + [f"r{c}" for c in k.relations] + ["t"] * k.on_time
        )
        assert k.expression.free_symbols == {sympy.Symbol(name, real=True) for name in used}


def test_relation_and_derivatives_are_made_once() -> None:
    template = make(gl.Piecewise((x, x > q), (0, True)))
    assert relation_kernel(template, 0) is relation_kernel(template, 0)
    assert abs(scalar(relation_kernel(template, 0))) == pytest.approx(abs(POINT["x"] - POINT["q"]))
    assert differentiated(template, 0) is template
    assert differentiated(template, 2) is differentiated(template, 2)
    assert max(order for _, order in differentiated(make(x * y), 2).columns) == 2


@pytest.mark.parametrize(
    ("expression", "additions"),
    [
        (x * y * p + q - 1, 4),
        (sympy.sqrt(x), 4),
        (1 / x, 5),
        (x**7, 2),
        (x ** sympy.Rational(2, 3), 20),
        (x**p, 20),
        (sympy.sin(x + y), 21),
        (gl.Piecewise((x + y + z, x > 0), (0, True)), 2),
    ],
)
def test_what_an_evaluation_costs(expression: Any, additions: int) -> None:
    """In additions: a division or a square root counts for 4, a function for 20, a power as many as its squarings."""
    template = make(z + expression)
    assert residual_kernel(template).operations == additions + 1


def test_what_is_derived_from_a_template_goes_with_it() -> None:
    template = make(x**2 + y)
    kernels = [residual_kernel(template), partial_kernel(template, 0)]
    assert residual_kernel(template) is kernels[0]
    gone = [weakref.ref(kernel) for kernel in kernels]
    del template, kernels
    gc.collect()
    assert [there() for there in gone] == [None, None]


def test_the_largest_and_the_least_of_several() -> None:
    x, y, z = sympy.symbols("x y z", real=True)
    largest, least = array_function((x, y, z), sympy.Max(x, y, z), sympy.Min(x, y, z))(np.array([1.0, 5.0]), 2.0, 3.0)
    assert largest.tolist() == [3.0, 5.0]
    assert least.tolist() == [1.0, 2.0]


def test_conditions_that_are_cases_are_printed_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sympy's printer would simplify them first, for seconds."""
    monkeypatch.setattr("sympy.logic.boolalg.simplify_logic", None)
    x, y, z = sympy.symbols("x y z", real=True)
    case = sympy.Piecewise((x, x > y), (y - z, True))
    expression = sympy.Piecewise((1, (case > z) & (y > 0)), (x * z, sympy.Not(case < y)), (3, True))
    assert expression.has(sympy.ITE)
    points = np.random.default_rng(1).normal(size=(3, 40))
    expected = [float(expression.subs(dict(zip((x, y, z), point, strict=True)))) for point in points.T]
    assert {1.0, 3.0} < set(expected)
    assert array_function((x, y, z), expression)(*points) == pytest.approx(expected, rel=1e-15)
    held = array_function((x, y, z), expression)(points[0], 0.25, points[2])  # arrays and numbers
    assert held.shape == (40,)


@pytest.mark.parametrize(
    ("expression", "divisors"),
    [
        (1 / x, [x]), (1 / x**2, [x * abs(x)]), (1 / abs(x), [x]), (y / (x - z), [x - z]), (gl.tan(x), [gl.cos(x)]), (1 / (x**2 + 1), []),
        (1 / p, []), (x * y + gl.sin(x), []), (1 / (gl.time - p), [gl.time - p]), (gl.sqrt(x), []),
        (1 / gl.sqrt(x), [x / gl.sqrt(abs(x))]),
        (x**p, [gl.Piecewise((x * abs(x) ** (-1 - p), p < 0), (0, True))]), (gl.exp(1 / x) + 1 / (x * y), [x, y]),
        (gl.Piecewise((1 / (x - z), y > 0), (2 / (z - x), True)), [x - z]),
    ],
)  # fmt: skip
def test_divisors_change_sign_where_the_kernel_has_a_pole(expression: Any, divisors: list[Any]) -> None:
    found = residual_kernel(template_of(gl.Eq(expression, 0), "test", lambda name: name in {"p", "q"})).divisors
    assert len(found) == len(divisors)
    for px, py, pz, time in ((0.7, 1.3, -0.4, 2.0), (-0.6, 0.2, 0.9, -3.0), (1.1, -2.0, 0.3, 3.5)):
        values = {"x": px, "y": py, "z": pz, "p": 2.5, "q": 0.8}
        table = {sympy.Symbol(n, real=True): v for n, v in values.items()} | {gl.time: time}
        got = []
        for kernel in found:
            names = [kernel.template.columns[i][0] for i in kernel.columns] + [
                kernel.template.parameters[i] for i in kernel.parameters
            ]
            got.append(abs(complex(kernel.function(time, *(values[n] for n in names)))))
        assert sorted(got) == pytest.approx(sorted(abs(float(d.subs(table))) for d in divisors))


@pytest.mark.parametrize("expression", [1 / x, 1 / x**2, 1 / x**3, 1 / abs(x), gl.tan(x + gl.pi / 2)], ids=str)
def test_a_divisor_has_opposite_signs_on_the_two_sides_of_a_pole(expression: Any) -> None:
    """Also where the kernel itself has the same on both."""
    (divisor,) = residual_kernel(make(expression)).divisors
    near = [float(divisor.function(T, at, *[at >= 0] * len(divisor.relations))) for at in (-0.01, 0.01)]
    assert near[0] * near[1] < 0
    assert near[0] == pytest.approx(-near[1], rel=1e-12)


def test_a_divisor_of_a_branch_counts_while_the_branch_is_taken() -> None:
    both = gl.Piecewise((1 / x, y > 0), (2 / x, True))
    one = gl.Piecewise((1 / x, y > 0), (z, True))
    other = gl.Piecewise((z, y > 0), (1 / x, True))
    for expression, over, under in ((both, 0.7, 0.7), (one, 0.7, 0.0), (other, 0.0, 0.7)):
        found = residual_kernel(make(expression)).divisors
        assert len(found) == 1
        (divisor,) = found
        values = [0.7 for _ in divisor.columns]
        assert [abs(float(divisor.function(0.0, *values, *([flag] * len(divisor.relations))))) for flag in (1, 0)] == [
            over,
            under,
        ]


def test_what_a_kernel_is() -> None:
    template = make(p * x - y + 3 * z)
    place = {name: c for c, (name, _) in enumerate(template.columns)}
    slope = {name: partial_kernel(template, c) for name, c in place.items()}
    assert slope["y"].number == -1.0
    assert [slope[n].number for n in "xyz"] == [None, -1.0, 3.0]
    assert [slope[n].constant for n in "xyz"] == [True] * 3
    assert not residual_kernel(template).constant
    assert not residual_kernel(make(p + gl.time)).constant
    assert not residual_kernel(make(gl.Piecewise((1, gl.time > 1), (2, True)))).constant
    only = {n: residual_kernel(make(e)) for n, e in {"x": x, "2x": 2 * x, "xy": x + y, "p": p, "0": sympy.Integer(0)}.items()}
    assert only["x"].is_copy
    assert [name for name, kernel in only.items() if kernel.is_copy] == ["x"]
    assert [name for name, kernel in only.items() if kernel.is_zero] == ["0"]
    apart = difference_kernel("two")
    assert apart.expression == sympy.Symbol("x0", real=True) - sympy.Symbol("x1", real=True)
    assert apart.function(0.0, 5.0, 3.0) == 2.0


def test_columns_set_to_zero() -> None:
    kernel = residual_kernel(make(p * x + q * y + gl.cos(z) + gl.time))
    assert without_columns(kernel, frozenset()).columns == kernel.columns
    assert len(without_columns(kernel, frozenset({0})).columns) == 2
    rest = rest_of(kernel)
    assert (rest.columns, rest.parameters) == ((), ())
    assert scalar(rest) == 1.0 + T


@pytest.mark.parametrize(
    ("residual", "column", "value"),
    [(2 * x - y, "x", 0.65), (y - 2 * x, "x", 0.65), (2 * x - y, "y", 1.4), (x + y - 3, "y", 2.3), (3 - x - y, "y", 2.3),
     (p * x - 5 * q, "x", 1.6)],
)  # fmt: skip
def test_solutions_whatever_the_sign_and_size_of_the_coefficient(residual: Any, column: str, value: float) -> None:
    template = make(residual)
    kernel = solve_kernel(template, [name for name, _ in template.columns].index(column))
    assert kernel is not None
    assert scalar(kernel) == pytest.approx(value, rel=1e-14)


def test_a_coefficient_that_switches_is_not_divided_by() -> None:
    template = make(gl.Piecewise((x, gl.time > 1), (2 * x, True)) - y)
    assert solve_kernel(template, [name for name, _ in template.columns].index("x")) is None


def test_terms_of_parameters_are_those_in_which_nothing_moves() -> None:
    kernel = residual_kernel(make(p * (x + q) - q**2 + 3 + gl.sin(gl.time) * p))
    fixed, moving = terms_of_parameters(kernel)
    assert (fixed.columns, fixed.parameters, fixed.on_time) == ((), (0, 1), False)
    assert (moving.columns, moving.parameters, moving.on_time) == ((0,), (0,), True)
    assert scalar(fixed) == pytest.approx(POINT["p"] * POINT["q"] - POINT["q"] ** 2 + 3, rel=1e-15)
    assert scalar(moving) == pytest.approx(POINT["p"] * (POINT["x"] + math.sin(T)), rel=1e-15)
    assert terms_of_parameters(residual_kernel(make(x * p)))[0].is_zero
    assert terms_of_parameters(residual_kernel(make(q * p)))[1].is_zero


def test_kernels_that_vanish_without_their_parameters() -> None:
    """Not the bend q of a joint alone, but both where both are zero; 1/q has no value there."""
    kernel = residual_kernel(make(p * x + q * y + gl.sin(p) * gl.time))
    assert [is_zero_without(kernel, parts) for parts in ((), (0,), (1,), (0, 1))] == [False, False, False, True]
    assert is_zero_without(residual_kernel(make(q * x)), (0,))
    assert not is_zero_without(residual_kernel(make(x / q)), (0,))


def test_discrete_variables_come_after_the_relations() -> None:
    condition = gl.Piecewise((x, x > q), (y, True))
    template = template_of(gl.Eq(condition * z, p * y + gl.pre(z)), "test", lambda n: n in "pq", lambda n: n in ("z", "pre(z)"))
    kernel = residual_kernel(template)
    assert template.discretes == ("pre(z)", "z")
    assert kernel.relations == (0, 1, 2)
    assert {s.name for s in kernel.expression.free_symbols} == {"x0", "x1", "p0", "r0", "r1", "r2"}
    for flag in (0.0, 1.0):
        held = flag if not template.relations[0].negated else 1.0 - flag
        assert kernel.function(T, 2.0, 3.0, 5.0, held, 7.0, 11.0) == 11.0 * (2.0 if held else 3.0) - 5.0 * 3.0 - 7.0


@pytest.mark.parametrize("sign", [1, -1])
def test_what_cancels_is_not_in_a_solution(sign: int) -> None:
    template = make(sign * x + p * (y + q) - p * q)
    kernel = solve_kernel(template, [name for name, _ in template.columns].index("x"))
    assert kernel is not None
    assert [template.parameters[i] for i in kernel.parameters] == ["p"]
    assert scalar(kernel) == pytest.approx(-sign * POINT["p"] * POINT["y"], rel=1e-15)


def test_a_magnitude_that_is_left_without_some_columns_has_the_divisor_of_its_argument() -> None:
    template = make(1 / gl.sqrt(x**2 + y**2) - p)
    place = [name for name, _ in template.columns].index("y")
    left = without_columns(residual_kernel(template), frozenset({place}))
    assert left.expression.has(sympy.Abs)
    assert [d.expression for d in left.divisors] == [sympy.Symbol(f"x{1 - place}", real=True)]


def test_a_power_has_a_divisor_while_its_exponent_is_negative() -> None:
    (divisor,) = residual_kernel(make(x**p - y)).divisors
    assert [divisor.template.columns[c][0] for c in divisor.columns] == ["x"]
    for exponent in (-2.5, -1.0, -0.5, 0.0, 0.5, 2.0):
        for at in (-0.7, 0.7):
            wanted = math.copysign(0.7 ** (-exponent), at) if exponent < 0.0 else 0.0
            assert float(divisor.function(0.0, at, exponent)) == pytest.approx(wanted, rel=1e-14)
