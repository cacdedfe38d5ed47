"""Kernels: source of one scalar expression derived from a template (solution, residual, partial derivative), shared by all instances.

A kernel's source contains ``x0, x1, ...`` for the columns of its template, ``p0, ...`` for its parameters, ``r0, ...`` for its
relations and ``t`` for time. It is printed in two forms: for arrays (NumPy) and for scalars (native code).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial, reduce
from types import SimpleNamespace
from typing import Any

import numpy as np
import sympy
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.pycode import PythonCodePrinter

from gearlib.equations.template import Relation, Template, column_symbol, memoised, relation_symbol, vanishes
from gearlib.language.expressions import time

CALL, DIVISION = 20, 4  # cost, in additions, of an elementary function such as the sine, and of a division or square root


def _select(conditions: Sequence[Any], values: Sequence[Any], default: float) -> Any:
    """`numpy.select`, which takes several times as long for a few numbers."""
    found: Any = default
    for condition, value in zip(reversed(conditions), reversed(values), strict=True):
        found = np.where(condition, value, found)
    return found


# Conditions on arrays of different shapes (of time alone, of parameters alone) are combined pairwise
_NAMES = vars(np) | {
    "select": _select,
    "reduce": reduce,  # of the largest and the least of several
    "logical_and": SimpleNamespace(reduce=partial(reduce, np.logical_and)),
    "logical_or": SimpleNamespace(reduce=partial(reduce, np.logical_or)),
}


@dataclass(frozen=True, eq=False)
class Kernel:
    """A scalar expression of a template.

    ``columns``, ``parameters`` and ``relations`` are the positions in the template's lists that the text uses; discrete variables
    count as relations, after these.
    """

    template: Template
    expression: Any  # over x0, p0, r0, t
    columns: tuple[int, ...]
    parameters: tuple[int, ...]
    relations: tuple[int, ...]
    memo: dict[Any, Any] = field(init=False, default_factory=dict)  # cache of `memoised` functions

    @cached_property
    def scalar(self) -> str:
        """Python source for scalars."""
        return scalar_source(self.expression)

    @cached_property
    def function(self) -> Callable[..., Any]:
        """Vectorised function ``f(t, *columns, *parameters, *relations)``, in the order of the attributes."""
        names = ["t", *(f"x{i}" for i in self.columns), *(f"p{i}" for i in self.parameters), *(f"r{i}" for i in self.relations)]
        return array_function([sympy.Symbol(name, real=True) for name in names], self.expression)

    @cached_property
    def divisors(self) -> tuple[Kernel, ...]:
        """Divisors of the kernel that may pass through zero as the model moves: 1/x gives x, tan(x) its cos(x).

        Each changes sign there, even where the kernel does not (1/x**2 gives x abs(x), 1/abs(x) gives x). The divisor of a branch that
        is not taken is 0.
        """
        moving = {sympy.Symbol(f"x{c}", real=True) for c in self.columns} | {sympy.Symbol("t", real=True)}
        found = dict.fromkeys(d for d in _divisors(self.expression) if d.free_symbols & moving and not _has_one_sign(d))
        return tuple(_part(self, d) for d in found)

    @cached_property
    def on_time(self) -> bool:
        return sympy.Symbol("t", real=True) in self.expression.free_symbols

    @property
    def constant(self) -> bool:
        """Whether it depends on parameters only."""
        return not (self.columns or self.relations or self.on_time)

    @cached_property
    def operations(self) -> int:
        """Approximate cost of an evaluation in additions; a function call counts as `CALL`."""
        return _operations(self.expression)

    @cached_property
    def is_copy(self) -> bool:
        """Whether it is one of the columns, unchanged."""
        return len(self.columns) == 1 and bool(self.expression == sympy.Symbol(f"x{self.columns[0]}", real=True))

    @cached_property
    def is_zero(self) -> bool:
        return bool(self.expression == 0)

    @cached_property
    def number(self) -> float | None:
        """Its value, if it is a plain number."""
        return float(self.expression) if self.expression.is_number else None


def array_function(symbols: Sequence[Any], *expressions: Any) -> Callable[..., Any]:
    """Vectorised function of some symbols: the value of an expression, or of several as a tuple.

    `sympy.lambdify` does the same, but imports everything that NumPy has.

    >>> x, y = sympy.symbols("x body.y", real=True)
    >>> array_function((x, y), sympy.Piecewise((x, x > y), (0, True)))(np.array([1.0, 3.0]), 2.0)
    array([0., 3.])
    """
    places = {symbol: sympy.Symbol(f"a{i}", real=True) for i, symbol in enumerate(symbols)}
    return _printed(len(places), *(expression.xreplace(places) for expression in expressions))


@lru_cache(maxsize=10_000)
def _printed(count: int, *expressions: Any) -> Callable[..., Any]:
    """The function of a0, a1, ...: many equations differ in their names only."""
    printer = NumPyPrinter({"fully_qualified_modules": False})
    texts = [printer.doprint(_without_cases(expression)) for expression in expressions]
    arguments = ", ".join(f"a{i}" for i in range(count))
    function: Callable[..., Any] = eval(f"lambda {arguments}: ({', '.join(texts)})", dict(_NAMES))
    return function


def _without_cases(expression: Any) -> Any:
    """An expression whose conditions are conjunctions instead of cases, which the printers would simplify, for seconds, or not take."""
    return expression.replace(sympy.ITE, lambda c, a, b: (c & a) | (~c & b)) if expression.has(sympy.ITE) else expression


def scalar_source(expression: Any) -> str:
    """Python source of an expression for scalars, which is also valid in the small language.

    >>> scalar_source(sympy.sin(sympy.Symbol("x")) / 2)
    '(1/2)*sin(x)'
    """
    text: str = PythonCodePrinter({"fully_qualified_modules": False}).doprint(_without_cases(expression))
    return text


def _operations(expression: Any) -> int:
    """Approximate cost of an expression, in additions.

    >>> x = sympy.Symbol("x")
    >>> _operations(2 * x + 1), _operations(x**2 - sympy.cos(x))
    (2, 23)
    """
    below = sum(map(_operations, expression.args))
    if isinstance(expression, (sympy.Add, sympy.Mul)):
        return below + len(expression.args) - 1
    if isinstance(expression, sympy.Pow):
        exponent = expression.exp
        if exponent.is_Integer:
            return below + max(1, int(abs(exponent)).bit_length() - 1) + (DIVISION if exponent.is_negative else 0)
        return below + (DIVISION if exponent.is_Rational and exponent.q == 2 else CALL)
    return below + CALL if isinstance(expression, sympy.Function) and not expression.is_Piecewise else below


def _kernel(template: Template, expression: Any) -> Kernel:
    table: dict[Any, Any] = {time: sympy.Symbol("t", real=True)}
    used = expression.free_symbols
    columns, parameters, relations = [], [], []
    for i, column in enumerate(template.columns):
        symbol = column_symbol(column)
        if symbol in used:
            table[symbol] = sympy.Symbol(f"x{i}", real=True)
            columns.append(i)
    for i, name in enumerate((*template.columns, *template.relation_columns)[len(template.columns) :], len(template.columns)):
        symbol = column_symbol(name)
        if symbol in used and symbol not in table:
            table[symbol] = sympy.Symbol(f"x{i}", real=True)
            columns.append(i)
    for i, name_ in enumerate(template.parameters):
        symbol = sympy.Symbol(name_, real=True)
        if symbol in used:
            table[symbol] = sympy.Symbol(f"p{i}", real=True)
            parameters.append(i)
    variables = (sympy.Symbol(name, real=True) for name in template.discretes)
    for i, symbol in enumerate([*map(relation_symbol, range(len(template.relations))), *variables]):
        if symbol in used:
            table[symbol] = sympy.Symbol(f"r{i}", real=True)
            relations.append(i)
    renamed = expression.xreplace(table)
    return Kernel(template, renamed, tuple(columns), tuple(parameters), tuple(relations))


@memoised
def differentiated(template: Template, times: int) -> Template:
    """The template of an equation's derivative of a given order."""
    for _ in range(times):
        template = template.derivative
    return template


@memoised
def solve_kernel(template: Template, column: int) -> Kernel | None:
    """The equation solved for one of its columns; None if it is not linear in that column."""
    partial = partial_kernel(template, column)
    if column in partial.columns or partial.relations:
        return None
    rest = template.residual.xreplace({template.symbols[column]: sympy.S.Zero})
    number = partial.number
    if number is not None and abs(number) == 1.0:
        return _kernel(template, sympy.expand_mul(-rest if number > 0.0 else rest))
    return _kernel(template, -rest / template.slopes[column])


@memoised
def residual_kernel(template: Template, without: frozenset[int] = frozenset()) -> Kernel:
    """The residual, with some columns set to zero."""
    zeros = {template.symbols[c]: sympy.S.Zero for c in without}
    return _kernel(template, template.residual.xreplace(zeros))


@memoised
def partial_kernel(template: Template, column: int) -> Kernel:
    """The partial derivative of the residual with respect to a column."""
    return _kernel(template, template.slopes[column])


@memoised
def terms_of_parameters(kernel: Kernel) -> tuple[Kernel, Kernel]:
    """The terms of a sum that depend on parameters only, and the others."""
    moving = [s for s in kernel.expression.free_symbols if not s.name.startswith("p")]
    fixed, others = sympy.expand_mul(kernel.expression).as_independent(*moving, as_Add=True)
    return _part(kernel, fixed), _part(kernel, others)


@memoised
def is_zero_without(kernel: Kernel, parameters: tuple[int, ...]) -> bool:
    """Whether a kernel is zero everywhere if some of its parameters are zero: the bend of a joint that is straight."""
    return vanishes(kernel.expression, [sympy.Symbol(f"p{p}", real=True) for p in parameters])


def difference_kernel(label: str) -> Kernel:
    """One column minus another: the equation between two aliases."""
    one, other = (sympy.Symbol(name, real=True) for name in ("one", "other"))
    template = Template(label, one - other, (("one", 0), ("other", 0)), ())
    return _kernel(template, template.residual)


@memoised
def relation_kernel(template: Template, relation: int) -> Kernel:
    """The expression that a relation compares with zero."""
    r: Relation = template.relations[relation]
    return _kernel(template, r.g)


@memoised
def derivative_of(kernel: Kernel, name: str) -> Kernel:
    """Partial derivative of a kernel with respect to one of its columns, such as x0, or parameters, such as p0."""
    return _part(kernel, sympy.diff(kernel.expression, sympy.Symbol(name, real=True)))


def _divisors(expression: Any) -> list[Any]:
    if isinstance(expression, sympy.Piecewise):
        branches = [_divisors(value) for value, _ in expression.args]
        always = [d for d in branches[0] if all(d in others or -d in others for others in branches)]
        found: list[Any] = list(always)
        earlier: list[Any] = []
        for divisors, (_, condition) in zip(branches, expression.args, strict=True):
            here = [d for d in divisors if d not in always and -d not in always]
            found += [sympy.Piecewise(*earlier, (d, condition), (0, True)) for d in here]
            earlier.append((0, condition))
        return found
    inside = [d for part in expression.args for d in _divisors(part)]
    if isinstance(expression, sympy.tan):
        return [*inside, sympy.cos(*expression.args)]
    if isinstance(expression, sympy.Pow) and not expression.exp.is_nonnegative:
        (base,) = expression.base.args if isinstance(expression.base, sympy.Abs) else (expression.base,)  # the x of abs(x)
        divisor = base * sympy.Abs(base) ** (-1 - expression.exp)
        known = expression.exp.is_negative
        return [*inside, divisor if known else sympy.Piecewise((divisor, expression.exp < 0), (0, True))]
    return inside


def _has_one_sign(expression: Any) -> bool:
    return bool(expression.is_positive or expression.is_negative)


def _part(kernel: Kernel, expression: Any) -> Kernel:
    """A kernel for another expression over the symbols of a given kernel, or some of them."""
    used = {s.name for s in expression.free_symbols}
    return Kernel(
        kernel.template, expression,
        tuple(i for i in kernel.columns if f"x{i}" in used),
        tuple(i for i in kernel.parameters if f"p{i}" in used),
        tuple(i for i in kernel.relations if f"r{i}" in used),
    )  # fmt: skip


@memoised
def rest_of(kernel: Kernel) -> Kernel:
    """The kernel with all its columns set to zero."""
    return without_columns(kernel, frozenset(kernel.columns))


@memoised
def without_columns(kernel: Kernel, columns: frozenset[int]) -> Kernel:
    """The kernel with some of its columns set to zero."""
    zeros = {sympy.Symbol(f"x{c}", real=True): sympy.S.Zero for c in columns}
    return _part(kernel, kernel.expression.xreplace(zeros))
