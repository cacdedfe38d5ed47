"""Dimensional analysis of a component's equations, and of the values that it gives to its parts.

Numeric literals, and functions of time made of literals, match every dimension when they stand alone; so does anything multiplied by a
number with a decimal point, since tables put the numbers of their rows into equations. Whole numbers, fractions and pi as factors are
dimensionless in equations; in a value given to a part they may carry a unit, like the 4 of ``tau=-4 * self.load.w``, and a value that
is a pure number is in the declared unit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import Any

import sympy
from sympy.core.relational import Relational

from gearlib.language.component import Component, equations_of, inside, no_component, reads_of, signals_of
from gearlib.language.declarations import Connector, Derivative, Discrete, Input, Parameter
from gearlib.language.expressions import Eq, Reinit, When, check_depth, time, value_of
from gearlib.language.interior import (
    bindable_of,
    bindings_of,
    connections_of,
    declarations_of,
    guesses_of,
    parts_of,
    reads_parts,
    starts_of,
)
from gearlib.language.units import NONE, SECOND, Dimension, dimension, name_of

# Expressions that should have equal dimensions (or an expression and a dimension), and their location
Pair = tuple[Any, Any, str]
UnitOf = Callable[[str], Dimension | None]
_DER = re.compile(r"der\((.*)\)$")
_OF_NUMBERS = (
    sympy.sin, sympy.cos, sympy.tan, sympy.asin, sympy.acos, sympy.atan, sympy.sinh, sympy.cosh, sympy.tanh, sympy.asinh,
    sympy.acosh, sympy.atanh, sympy.exp, sympy.log,
)  # fmt: skip


class _Mismatch(Exception):
    """Two dimensions that should be equal."""


@reads_parts
def check_units(component: Component) -> list[str]:
    """Dimension errors in the equations of a component and its parts, and in the values given to parts.

    Finds the same errors as `compile`, without compiling: no parameter needs a value. Angles are dimensionless; zero and numeric
    literals match every dimension.

    Parameters
    ----------
    component : Component
        Its structural choices determine which equations it has.

    Returns
    -------
    list of str
        One message per error; empty if there are none.

    Examples
    --------
    >>> import gearlib as gl
    >>> class Wrong(gl.Component):
    ...     m = gl.Parameter("kg", "mass")
    ...     v = gl.Variable("m/s", "speed")
    ...     def equations(self):
    ...         return [gl.Eq(self.m * gl.der(self.v), self.v)]
    >>> gl.check_units(Wrong())
    ['Wrong: der(v)*m is in kg.m.s-2, v is in m.s-1']
    """
    if not isinstance(component, Component):
        raise no_component(component)
    errors: dict[str, None] = {}
    stack = [component]
    while stack:
        node = stack.pop()
        connections_of(node)
        errors.update(dict.fromkeys(unit_errors(node, values_compared(node, equations_of(node)))))
        errors.update(dict.fromkeys(unit_errors(node, values_given(node))))
        stack += parts_of(node).values()
    return list(errors)


def unit_errors(component: Component, pairs: Iterable[Pair]) -> list[str]:
    """One message for each pair of different dimensions."""
    kind, errors = type(component).__name__, dict[str, None]()
    unit_of = _lookup(component)
    known: dict[Any, Dimension | None] = {}

    def measured(value: Any, loose: bool) -> Dimension | None:
        if (value, loose) not in known:
            known[value, loose] = _measure(value, unit_of, loose)
        return known[value, loose]

    for left, right, where in pairs:
        check_depth(left, where or kind)
        check_depth(right, where or kind)
        try:
            a = measured(value_of(left), bool(where))
            b = right if isinstance(right, tuple) else measured(value_of(right), False)
            if (
                a is not None and b is not None and a != b and not (where and a == NONE)
            ):  # a plain number is in the declared unit
                if where:
                    errors[f"{kind}: {where} is in {name_of(b)}, its value {left} in {name_of(a)}"] = None
                else:
                    errors[f"{kind}: {left} is in {name_of(a)}, {right} is in {name_of(b)}"] = None
        except _Mismatch as problem:
            errors[f"{kind}: {problem} ({f'in the value of {where}' if where else f'in {left} = {right}'})"] = None
    return list(errors)


def is_in(component: Component, value: Any, unit: str) -> bool:
    """Whether an equation of a component may say that a value is a variable in some unit."""
    wanted = dimension(unit)
    return wanted is None or not unit_errors(component, [(value, wanted, "")])


def values_compared(component: Component, equations: Iterable[Eq | When]) -> Iterator[Pair]:
    """Both sides of all equations, including actions; conditions; and derivative aliases."""
    for equation in equations:
        if isinstance(equation, Eq):
            yield equation.left, equation.right, ""
            continue
        for branch in equation.branches:
            yield branch.condition, 0, ""
            for action in branch.actions:
                yield (action.state, action.value, "") if isinstance(action, Reinit) else (action.left, action.right, "")
    with inside(component):
        for name, declared in declarations_of(component).items():
            if isinstance(declared, Derivative):
                unit = dimension(declared.unit)
                yield getattr(component, name), NONE if unit is None else unit, name


def values_given(component: Component) -> Iterator[Pair]:
    """Default values and values given to parts, if they are expressions (plain numbers are in the declared unit), and joined signals."""
    for signals in signals_of(component):
        yield from ((signals[0], other, "") for other in signals[1:])
    with inside(component):
        for name, own in declarations_of(component).items():
            if isinstance(own, (Parameter, Input)) and _may_be_symbolic(own.default):
                yield from _given(component, f"the default of {name}", own.unit, own.default)
        for name, part in parts_of(component).items():
            for key, value in bindings_of(part).items():
                if _may_be_symbolic(value):
                    yield from _given(component, f"{name}.{key}", bindable_of(part)[key].unit, value)
            for given in (starts_of(part), guesses_of(part)):
                for key, value in given.items():
                    if isinstance(value, sympy.Basic) and isinstance(key, str) and (wanted := _lookup(part)(key)) is not None:
                        yield value, wanted, f"the start value of {name}.{key}"


def _may_be_symbolic(value: Any) -> bool:
    """Whether a value may be an expression, or a function that returns one."""
    return isinstance(value, sympy.Basic) or callable(value)


def _given(component: Component, where: str, unit: str, value: Any) -> Iterator[Pair]:
    wanted = dimension(unit)
    if callable(value) and not isinstance(value, sympy.Basic):
        try:
            with reads_of(component):  # dimension checks do not count as reading a structural choice
                value = value(component)
        except Exception:  # a user's function: its errors are reported where its value is needed
            return
    if isinstance(value, sympy.Basic) and wanted is not None:
        yield value, wanted, where


def _lookup(component: Component) -> UnitOf:
    """A function that returns the dimension of a symbol by name, None where it may be any."""

    def declared_unit(name: str) -> str:
        owner = component
        *path, last = name.split(".")
        for step in path:
            if step in parts_of(owner):
                owner = parts_of(owner)[step]
                continue
            connector = declarations_of(owner).get(step)
            inner = connector.variables.get(last) if isinstance(connector, Connector) else None
            return inner.unit if inner is not None else "any"
        declared = declarations_of(owner).get(last)
        return "any" if isinstance(declared, Discrete) else getattr(declared, "unit", "any")

    def dimension_of(name: str) -> Dimension | None:
        if name == time.name:
            return SECOND
        if found := _DER.match(name):
            inner = None if declared_unit(found[1]) == "1" else dimension_of(found[1])
            return None if inner is None else _times(inner, SECOND, -1)
        return dimension(declared_unit(name))

    return dimension_of


def _times(a: Dimension, b: Dimension, power: Fraction | int = 1) -> Dimension:
    return tuple(x + power * y for x, y in zip(a, b, strict=True))


def _one(terms: Iterable[Any], unit_of: UnitOf, loose: bool, whole: Any) -> Dimension | None:
    """The common dimension of some terms."""
    common: Dimension | None = None
    first: Any = None
    for term in terms:
        d = _measure(term, unit_of, loose)
        if d is None:
            continue
        if common is not None and d != common:
            raise _Mismatch(f"{first} is in {name_of(common)}, {term} is in {name_of(d)}, together in {whole}")
        common, first = d, term
    return common


def _measure(e: Any, unit_of: UnitOf, loose: bool) -> Dimension | None:
    """Dimension of an expression, None where it may be any; with ``loose``, literal factors may carry a unit."""
    if isinstance(e, sympy.Symbol):
        return None if e == time else unit_of(e.name)
    if not e.free_symbols - {time}:
        return None
    if isinstance(e, sympy.Mul):
        return _product(_factor(f, unit_of, loose) for f in e.args)
    if isinstance(e, sympy.Pow) and e.exp.is_Number:
        return _power(e, unit_of, loose)
    if isinstance(e, (sympy.Pow, *_OF_NUMBERS)):
        for argument in e.args:
            if (found := _measure(argument, unit_of, loose)) not in (None, NONE):
                raise _Mismatch(f"{argument} is in {name_of(found)}, and has to be a pure number in {e}")
        return NONE
    if isinstance(e, (sympy.atan2, sympy.sign)):
        _one(e.args, unit_of, loose, e)
        return NONE
    if isinstance(e, sympy.Piecewise):
        for _, condition in e.args:
            _measure_condition(condition, unit_of, loose)
        return _one([value for value, _ in e.args], unit_of, loose, e)
    if isinstance(e, sympy.Add) and any(unit_of(s.name) is None for s in e.free_symbols):
        return None
    if isinstance(e, sympy.Expr):  # sums, extrema, absolute values, no_event
        return _one(e.args, unit_of, loose, e)
    _measure_condition(e, unit_of, loose)
    return NONE


def _factor(e: Any, unit_of: UnitOf, loose: bool) -> Dimension | None:
    """Dimension of a factor: whole numbers are dimensionless here, and time is in s."""
    if e == time:
        return SECOND
    if e.free_symbols - {time}:
        return _measure(e, unit_of, loose)
    if e.is_number:
        return None if e.has(sympy.Float) or (loose and e != -1) else NONE
    if isinstance(e, sympy.Pow) and e.exp.is_Number:
        return _power(e, unit_of, loose)
    return NONE if isinstance(e, _OF_NUMBERS) else None


def _power(e: Any, unit_of: UnitOf, loose: bool) -> Dimension | None:
    """Dimension of a power with a number as its exponent."""
    base, exponent = _factor(e.base, unit_of, loose), float(e.exp)
    if base is None or not math.isfinite(exponent):  # which is refused where the model is compiled
        return None
    return _times(NONE, base, Fraction(exponent).limit_denominator(1000))


def _product(factors: Iterable[Dimension | None]) -> Dimension | None:
    total = NONE
    for factor in factors:
        if factor is None:
            return None
        total = _times(total, factor)
    return total


def _measure_condition(condition: Any, unit_of: UnitOf, loose: bool) -> None:
    for relation in condition.atoms(Relational) if isinstance(condition, sympy.Basic) else ():
        _one(relation.args, unit_of, loose, relation)
