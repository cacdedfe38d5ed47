"""Bindings of parameters and inputs: numbers, or expressions in the enclosing component's symbols.

Numeric literals in an input's expression become parameters, so that 10 sin(31.4 t) and 20 sin(6.28 t) share one template.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import sympy

from gearlib.arguments import shown
from gearlib.equations.kernel import array_function
from gearlib.equations.template import (
    Relation,
    Template,
    checked,
    is_relation,
    lift_relations,
    make_template,
    over_real_symbols,
    parse_column,
    piecewise,
)
from gearlib.errors import BindingError, BoundError
from gearlib.language.expressions import check_depth, real_symbol, time, value_of


def number(value: Any, path: str, unit: str, description: str) -> float:
    """The value as a finite float; the error names the parameter."""
    expected = f"expected a number in {unit} ({description})" if description else f"expected a number in {unit}"
    if isinstance(value, (bool, np.bool_, np.timedelta64, np.complexfloating)) or not isinstance(
        value, (int, float, np.number, Fraction, sympy.Expr)
    ):
        raise BindingError(f"{path} is {shown(value)} ({type(value).__name__}); {expected}")
    try:
        result = float(value)
    except TypeError:
        raise BindingError(f"{path} is {value}; {expected}, or an expression of the enclosing component's parameters") from None
    except OverflowError:
        raise BoundError(f"{path} is too large; expected a finite number in {unit}") from None
    if not math.isfinite(result):
        raise BoundError(f"{path} is {result}; expected a finite number in {unit}")
    return result


def is_expression(value: Any) -> bool:
    """Whether a given value contains symbols."""
    return isinstance(value, sympy.Basic) and bool(value.free_symbols)


def parameter_function(expression: Any, arguments: tuple[str, ...], by: str | None = None) -> Callable[..., Any]:
    """A vectorised function for an expression of parameters, or for its derivative with respect to one of them."""
    if by is not None:
        expression = sympy.diff(piecewise(expression), real_symbol(by))
    return array_function([real_symbol(a) for a in arguments], expression)


def is_computable(expression: Any, arguments: tuple[str, ...]) -> bool:
    """Whether gearlib has all functions in an expression of parameters."""
    try:
        with np.errstate(all="ignore"):
            parameter_function(expression, arguments)(*np.ones(len(arguments)))
    except (NameError, NotImplementedError):
        return False
    return True


def canonical(expression: Any) -> tuple[Any, tuple[str, ...]]:
    """The expression over a0, a1, ..., and the names that these replace."""
    expression = over_real_symbols(expression)
    names = tuple(sorted(s.name for s in expression.free_symbols))
    table = {real_symbol(n): real_symbol(f"a{i}") for i, n in enumerate(names)}
    return expression.xreplace(table), names


_templates: dict[Any, Template] = {}
MOST_NUMBERS = 40  # literals in an expression that become parameters; a table has more, and gets a template of its own


def discrete_name(number: int, before: bool = False) -> str:
    """Name in a binding for a discrete variable, by its number in the whole model."""
    return f"pre(discrete[{number}])" if before else f"discrete[{number}]"


def is_discrete_name(name: str) -> bool:
    return name.startswith(("discrete[", "pre(discrete["))


def bind_input(
    expression: Any,
    is_parameter: Callable[[str], bool],
    path: str = "an input",
    discrete: Callable[[str], int] = lambda name: -1,
) -> tuple[Template, dict[str, str], dict[str, str | float]]:
    """The equation that binds an input to an expression or number; ``discrete`` returns a discrete variable's number, or -1.

    It is shared, over ``bound`` (the input), variables v0, v1, ... and parameters p0, p1, ...; with it come the relative path of each of
    these variables, and that of each of these parameters, or its number.
    """
    check_depth(expression, path)
    value = checked(value_of(expression, path), path)
    numbers = {s: discrete(s.name.removeprefix("pre(").removesuffix(")")) for s in value.free_symbols}
    held = {s: real_symbol(discrete_name(k, s.name.startswith("pre("))) for s, k in numbers.items() if k >= 0}
    expression, relations = lift_relations(value.xreplace(held), is_discrete_name)
    if expression.is_Number or expression.is_NumberSymbol:
        return _template(real_symbol("p0"), (), ("p0",)), {}, {"p0": float(expression)}
    values: dict[str, str | float] = {}
    renamed: dict[Any, Any] = {}
    tabulated = sum(node.is_Number for node in sympy.preorder_traversal(expression)) > MOST_NUMBERS

    def lift(e: Any) -> Any:
        if tabulated:
            return e
        if e.is_Number or e.is_NumberSymbol:
            if abs(float(e)) in (0.0, 1.0):  # structural, not a value to vary
                return sympy.Integer(int(e))
            key = f"p{len(values)}"
            values[key] = float(e)
            lifted_number = sympy.Dummy(real=True)  # a symbol of the expression may have the key's name
            renamed[lifted_number] = real_symbol(key)
            return lifted_number
        if e.is_Pow and e.exp.is_Number:
            return sympy.Pow(lift(e.base), e.exp)
        if e.is_Piecewise:
            return sympy.Piecewise(*((lift(value), condition) for value, condition in e.args))
        if not e.args:
            return e
        return e.func(*(lift(a) for a in e.args))

    lifted = lift(expression)
    lifted_relations = tuple(replace(r, g=lift(r.g)) for r in relations)
    symbols = set(lifted.free_symbols).union(*(r.g.free_symbols for r in lifted_relations))
    variables: dict[str, str] = {}
    for symbol in sorted(symbols, key=str):
        name = symbol.name
        if symbol == time or symbol in renamed or is_relation(name) or is_discrete_name(name):
            continue
        base, order = parse_column(name)
        if is_parameter(base):
            key = f"p{len(values)}"
            values[key] = base
        else:
            key = next((k for k, v in variables.items() if v == base), f"v{len(variables)}")
            variables[key] = base
            key = "der(" * order + key + ")" * order
        renamed[symbol] = real_symbol(key)
    lifted = lifted.xreplace(renamed)
    lifted_relations = tuple(replace(r, g=r.g.xreplace(renamed)) for r in lifted_relations)
    return _template(lifted, lifted_relations, tuple(values)), variables, values


def _template(value: Any, relations: tuple[Relation, ...], parameters: tuple[str, ...]) -> Template:
    key = (value, relations)
    if key not in _templates:
        symbols = value.free_symbols.union(*(r.g.free_symbols for r in relations))
        discretes = {s.name for s in symbols if is_discrete_name(s.name)}
        _templates[key] = make_template("binding", real_symbol("bound") - value, parameters, relations, discretes, binds=True)
    return _templates[key]
