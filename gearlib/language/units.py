"""Dimensions: whether the equations of a component fit the units that it declares.

An angle has no dimension: 1 rad = 1. Zero fits every dimension. So does a number with a decimal point, and what is multiplied by
one, since tables put the numbers of their rows into equations; whole numbers, fractions and pi have no dimension.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from fractions import Fraction
from typing import Any

import sympy
from sympy.core.relational import Relational

from gearlib.errors import DeclarationError
from gearlib.language.component import Component, _inside, equations_of
from gearlib.language.declarations import Connector, Parameter
from gearlib.language.expressions import Eq, Reinit, When

Dimension = tuple[Fraction, Fraction, Fraction, Fraction]  # exponents of kg, m, s, K
NONE: Dimension = (Fraction(0),) * 4
SECOND: Dimension = (Fraction(0), Fraction(0), Fraction(1), Fraction(0))
_UNITS = {
    "1": (0, 0, 0, 0), "rad": (0, 0, 0, 0), "kg": (1, 0, 0, 0), "m": (0, 1, 0, 0), "s": (0, 0, 1, 0), "K": (0, 0, 0, 1),
    "Hz": (0, 0, -1, 0), "N": (1, 1, -2, 0), "J": (1, 2, -2, 0), "W": (1, 2, -3, 0),
}  # fmt: skip
_FACTOR = re.compile(r"([A-Za-z]+|1)(-?\d+)?$")
_DER = re.compile(r"der\((.*)\)$")
_OF_NUMBERS = (
    sympy.sin, sympy.cos, sympy.tan, sympy.asin, sympy.acos, sympy.atan, sympy.sinh, sympy.cosh, sympy.tanh, sympy.asinh,
    sympy.acosh, sympy.atanh, sympy.exp, sympy.log,
)  # fmt: skip


class _Mismatch(Exception):
    """Two dimensions that should be one."""


def dimension(unit: str) -> Dimension:
    """The dimension of a unit, as exponents of kg, m, s and K.

    Parameters
    ----------
    unit : str
        Such as ``"N.m.s/rad"``: factors with exponents, joined by points; all that follows the stroke is divided by.

    Raises
    ------
    DeclarationError
        A unit that is not known.

    Examples
    --------
    >>> dimension("N.m.s/rad") == dimension("kg.m2/s")
    True
    """
    total = [Fraction(0)] * 4
    above, _, below = unit.partition("/")
    for sense, side in ((1, above), (-1, below)):
        for factor in side.split(".") if side else []:
            found = _FACTOR.fullmatch(factor)
            if found is None or found[1] not in _UNITS:
                raise DeclarationError(f"the unit '{unit}' has the factor '{factor}'; known: {', '.join(_UNITS)}")
            exponent = sense * int(found[2] or 1)
            total = [t + exponent * e for t, e in zip(total, _UNITS[found[1]], strict=True)]
    return total[0], total[1], total[2], total[3]


def name_of(d: Dimension | None) -> str:
    """A dimension in base units, for messages.

    >>> name_of(dimension("N/m"))
    'kg.s-2'
    """
    if d is None:
        return "any"
    parts = [f"{u}{'' if e == 1 else e}" for u, e in zip(("kg", "m", "s", "K"), d, strict=True) if e]
    return ".".join(parts) or "1"


def unit_errors(component: Component, any_unit: Collection[str] = ()) -> list[str]:
    """Where the equations of a component, and the values that it gives to its parts, do not fit the declared units.

    Parameters
    ----------
    component : Component
        An instance; its structural choices decide which equations it has.
    any_unit : collection of str
        Names of variables that stand for quantities of different units in turn; sums with them are not examined.

    Returns
    -------
    list of str
        One message for each misfit; empty where all fits.

    Examples
    --------
    >>> import gearlib as gl
    >>> class Wrong(gl.Component):
    ...     m = gl.Parameter("kg", "mass")
    ...     v = gl.Variable("m/s", "speed")
    ...     def equations(self):
    ...         return [gl.Eq(self.m * gl.der(self.v), self.v)]
    >>> unit_errors(Wrong())
    ['Wrong: der(v)*m is in kg.m.s-2, v is in m.s-1']
    """
    kind, errors = type(component).__name__, list[str]()
    unit_of = _lookup(component, any_unit)
    for left, right in _compared(component):
        try:
            a, b = _measure(sympy.sympify(left), unit_of), _measure(sympy.sympify(right), unit_of)
            if a is not None and b is not None and a != b:
                errors.append(f"{kind}: {left} is in {name_of(a)}, {right} is in {name_of(b)}")
        except _Mismatch as problem:
            errors.append(f"{kind}: {problem} (in {left} = {right})")
    with _inside(component):
        given = list(_given(component))
    for where, declared, value in given:
        try:
            found = _measure(value, unit_of)
            if found is not None and found != declared:
                errors.append(f"{kind}: {where} is in {name_of(declared)}, its value {value} in {name_of(found)}")
        except _Mismatch as problem:
            errors.append(f"{kind}: {problem} (in the value of {where})")
    return errors


def _compared(component: Component) -> Iterator[tuple[Any, Any]]:
    """Both sides of all equations, of actions too, and conditions."""
    for equation in equations_of(component):
        if isinstance(equation, Eq):
            yield equation.left, equation.right
        elif isinstance(equation, When):
            yield equation.condition, 0
            for action in equation.actions:
                yield (action.state, action.value) if isinstance(action, Reinit) else (action.left, action.right)


def _given(component: Component) -> Iterator[tuple[str, Dimension, Any]]:
    """Values by default, and those given to parts."""
    component._assembled()
    for name, own in component._declarations.items():
        default = getattr(own, "default", None)
        if isinstance(own, Parameter) and callable(default):
            value = default(component)
            if isinstance(value, sympy.Basic):
                yield f"the default of {name}", dimension(own.unit), value
    for name, part in component._parts.items():
        for key, value in part._bindings.items():
            declared: Any = part._bindable[key]
            if isinstance(value, sympy.Basic):
                yield f"{name}.{key}", dimension(declared.unit), value


def _lookup(component: Component, any_unit: Collection[str]) -> Callable[[str], Dimension | None]:
    """A function that gives the dimension of a symbol by its name, None where it may have any."""

    def dimension_of(name: str) -> Dimension | None:
        if found := _DER.match(name):
            inner = dimension_of(found[1])
            return None if inner is None else _times(inner, SECOND, -1)
        if name == "time":
            return SECOND
        if name.startswith("pre(") or name == "initial()":
            return NONE
        owner = component
        *path, last = name.split(".")
        for step in path:
            if step in owner._parts:
                owner = owner._parts[step]
                continue
            connector = owner._declarations[step]
            assert isinstance(connector, Connector)
            return dimension(connector.variables[last].unit)
        if last in any_unit:
            return None
        return dimension(getattr(owner._declarations[last], "unit", "1"))

    return dimension_of


def _times(a: Dimension, b: Dimension, power: Any = 1) -> Dimension:
    p = Fraction(power)
    return a[0] + p * b[0], a[1] + p * b[1], a[2] + p * b[2], a[3] + p * b[3]


def _one(terms: list[Any], unit_of: Callable[[str], Dimension | None], whole: Any) -> Dimension | None:
    """The dimension that terms have in common."""
    common: Dimension | None = None
    first: Any = None
    for term in terms:
        d = _measure(term, unit_of)
        if d is None:
            continue
        if common is not None and d != common:
            raise _Mismatch(f"{first} is in {name_of(common)}, {term} is in {name_of(d)}, together in {whole}")
        common, first = d, term
    return common


def _measure(e: Any, unit_of: Callable[[str], Dimension | None]) -> Dimension | None:
    """The dimension of an expression; None where it may have any."""
    if isinstance(e, sympy.Symbol):
        return unit_of(e.name)
    if e.is_number:
        return None if e == 0 or e.has(sympy.Float) else NONE
    if isinstance(e, sympy.Mul):
        return _product([_measure(f, unit_of) for f in e.args])
    if isinstance(e, sympy.Pow) and e.exp.is_Rational:
        base = _measure(e.base, unit_of)
        return None if base is None else _times(NONE, base, Fraction(int(e.exp.p), int(e.exp.q)))
    if isinstance(e, (sympy.Pow, *_OF_NUMBERS)):
        _one([*e.args, sympy.Integer(1)], unit_of, e)
        return NONE
    if isinstance(e, (sympy.atan2, sympy.sign)):
        _one(list(e.args), unit_of, e)
        return NONE
    if isinstance(e, sympy.Piecewise):
        for _, condition in e.args:
            _measure_condition(condition, unit_of)
        return _one([value for value, _ in e.args], unit_of, e)
    if isinstance(e, sympy.Add) and any(unit_of(s.name) is None for s in e.free_symbols):
        return None
    if isinstance(e, sympy.Expr):  # sums, extrema, absolute values, no_event
        return _one(list(e.args), unit_of, e)
    _measure_condition(e, unit_of)
    return NONE


def _product(factors: list[Dimension | None]) -> Dimension | None:
    total = NONE
    for factor in factors:
        if factor is None:
            return None
        total = _times(total, factor)
    return total


def _measure_condition(condition: Any, unit_of: Callable[[str], Dimension | None]) -> None:
    for relation in condition.atoms(Relational) if isinstance(condition, sympy.Basic) else ():
        _one(list(relation.args), unit_of, relation)
