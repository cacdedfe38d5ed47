"""`Template`: symbolic residual of one equation of a class, analysed once for all instances.

A template knows its variables (with their derivative orders), its partial derivatives and whether they are constant, and its own time
derivative. Derived quantities are computed on demand and cached.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, wraps
from typing import Any, TypeVar, cast

import sympy
from sympy.core.function import AppliedUndef
from sympy.core.relational import Relational

from gearlib.arguments import shown
from gearlib.errors import DeclarationError, NameLookupError
from gearlib.language.expressions import Eq, JustBefore, Sample, SquareWave, as_condition, real_symbol, time, total_derivative

LARGEST = sys.float_info.max
Found = TypeVar("Found", bound=Callable[..., Any])
Column = tuple[str, int]  # a variable and its derivative order
_DER = re.compile(r"der\((.*)\)$")
KNOWN = (
    sympy.sin, sympy.cos, sympy.tan, sympy.asin, sympy.acos, sympy.atan, sympy.atan2, sympy.sinh, sympy.cosh, sympy.tanh,
    sympy.asinh, sympy.acosh, sympy.atanh, sympy.exp, sympy.log, sympy.sign, sympy.Abs, sympy.Max, sympy.Min, sympy.Piecewise,
    SquareWave, JustBefore,
)  # fmt: skip


@dataclass(frozen=True)
class Relation:
    """A comparison in an equation. It keeps its value between events; ``g`` > 0 (or >= 0) means that it is true."""

    g: Any
    strict: bool
    negated: bool  # the comparison was written with "less": true when g < 0 (or <= 0) with g as written
    last: bool = False  # written with `settled`: an event iteration decides it once all else has settled


def memoised(function: Found) -> Found:
    """Memoise a function in its first argument (a template, kernel or program), so that derived data live as long as that."""
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def found(subject: Any, *arguments: Any) -> Any:
        key = (name, *arguments)
        if key not in subject.memo:
            return subject.memo.setdefault(key, function(subject, *arguments))  # another thread's result, if that was first
        return subject.memo[key]

    return cast("Found", found)


@dataclass(frozen=True, eq=False)
class Template:
    """A residual over the symbols of one class.

    Attributes
    ----------
    label : str
        For messages: the class and the equation.
    residual : sympy expression
        Zero when the equation holds.
    columns : tuple of (str, int)
        Variables, each with its derivative order.
    parameters : tuple of str
        Names of the parameters.
    relations : tuple of Relation
        Comparisons, replaced by the symbols of `relation_symbol` (1: true, 0: false).
    discretes : tuple of str
        Discrete variables: ``mode``, ``pre(mode)``, ``initial()``.
    binds : bool
        Whether it is the binding of an input, ``bound``, to an expression.
    """

    label: str
    residual: Any
    columns: tuple[Column, ...]
    parameters: tuple[str, ...]
    relations: tuple[Relation, ...] = ()
    discretes: tuple[str, ...] = ()
    binds: bool = False
    memo: dict[Any, Any] = field(init=False, default_factory=dict)  # cache of `memoised` functions

    @cached_property
    def locals(self) -> tuple[str, ...]:
        """Its variables, including those in relations, regardless of derivative order."""
        return tuple(dict.fromkeys(name for name, _ in (*self.columns, *self.relation_columns)))

    @cached_property
    def relation_columns(self) -> tuple[Column, ...]:
        """The variables that its relations compare."""
        known = {*self.parameters, *self.discretes, time.name}
        names = {s.name for r in self.relations for s in r.g.free_symbols} - known
        return tuple(parse_column(n) for n in sorted(names))

    @cached_property
    def local_columns(self) -> tuple[tuple[int, int], ...]:
        """The columns as (position in ``locals``, derivative order)."""
        return columns_among(self, self.locals)

    @cached_property
    def symbols(self) -> tuple[Any, ...]:
        """The symbol of each column."""
        return tuple(column_symbol(c) for c in self.columns)

    @cached_property
    def on_time(self) -> bool:
        return time in self.residual.free_symbols

    @cached_property
    def timed(self) -> bool:
        """Whether it depends on time itself, or on a condition of time."""
        return self.on_time or any(time in relation.g.free_symbols for relation in self.relations)

    @cached_property
    def slopes(self) -> tuple[Any, ...]:
        """Partial derivatives of the residual with respect to the columns."""
        return tuple(sympy.diff(self.residual, symbol) for symbol in self.symbols)

    @cached_property
    def fixed(self) -> tuple[bool, ...]:
        """Which of these depend on parameters only."""
        parameters = {*map(real_symbol, self.parameters)}
        return tuple(slope.free_symbols <= parameters for slope in self.slopes)

    @cached_property
    def factors(self) -> frozenset[str]:
        """Parameters that multiply a variable as a factor, so that at zero the equation loses that variable."""
        symbols = {name: sympy.Symbol(name, real=True) for name in self.parameters}
        expressions = [slope for slope in self.slopes if not slope.is_number]
        return frozenset(n for n, s in symbols.items() if any(e.has(s) and vanishes(e, [s]) for e in expressions))

    @cached_property
    def cancelling(self) -> tuple[int, ...]:
        """Columns whose coefficients are sums of parameters that may cancel, such as ``1 - ratio``."""
        slopes = zip(self.slopes, self.fixed, strict=True)
        return tuple(c for c, (slope, fixed) in enumerate(slopes) if fixed and not slope.is_number and slope.has(sympy.Add))

    @cached_property
    def linear(self) -> bool:
        """Whether it is linear in all its variables, with coefficients that are constant during a run."""
        return not self.relations_on_variables and all(self.fixed)

    @cached_property
    def relations_on_variables(self) -> bool:
        return bool(self.relation_columns)

    @cached_property
    def rest(self) -> Any:
        """The residual with all its variables set to zero."""
        return self.residual.xreplace({s: sympy.S.Zero for s in self.symbols})

    @cached_property
    def weights(self) -> tuple[float, ...] | None:
        """Factors of the variables, if the equation states nothing but that their sum with these factors, plain numbers, is zero."""
        if self.parameters or self.discretes or self.relations or self.on_time or any(order for _, order in self.columns):
            return None
        if not self.linear or self.rest != 0:
            return None
        return tuple(float(slope) for slope in self.slopes)

    @cached_property
    def alias(self) -> tuple[int, int, int] | None:
        """(i, j, s) if the equation says local i = s * local j; (i, -1, 0) if it says local i = 0."""
        if self.weights is None or len(self.weights) not in (1, 2):
            return None
        if len(self.weights) == 1:
            return (0, -1, 0)
        one, other = self.weights
        return (0, 1, -1 if one == other else 1) if abs(one) == abs(other) == 1.0 else None

    @cached_property
    def derivative(self) -> Template:
        """The equation differentiated with respect to time."""
        constant = frozenset(
            {*self.parameters, *self.discretes, *(relation_symbol(i).name for i in range(len(self.relations)))}
        )
        residual = total_derivative(self.residual, constant)
        return make_template(f"der({self.label})", residual, self.parameters, self.relations, self.discretes)


@memoised
def columns_among(template: Template, names: tuple[str, ...]) -> tuple[tuple[int, int], ...]:
    """The columns as (position among some names, derivative order). A derivative has its variables in another order."""
    position = {name: i for i, name in enumerate(names)}
    return tuple((position[name], order) for name, order in template.columns)


def vanishes(expression: Any, symbols: Iterable[Any]) -> bool:
    """Whether an expression is zero where some symbols are."""
    try:
        return bool(expression.xreplace(dict.fromkeys(symbols, sympy.S.Zero)) == 0)
    except TypeError:  # sympy compares infinity, to which 1/symbol has become
        return False


def relation_symbol(number: int) -> Any:
    """The symbol of a relation of a template; no variable of a model can have its name."""
    return real_symbol(f"relation({number})")


def is_relation(name: str) -> bool:
    """Whether a symbol's name is that of a relation."""
    return name.startswith("relation(")


def column_symbol(column: Column) -> Any:
    """The symbol of a variable's derivative of a given order."""
    name, order = column
    return real_symbol("der(" * order + name + ")" * order)


def parse_column(name: str) -> Column:
    """The variable and derivative order that a symbol's name stands for.

    >>> parse_column("der(der(load.phi))")
    ('load.phi', 2)
    """
    order = 0
    if not isinstance(name, str):
        raise NameLookupError(f"{shown(name)} is not a name; names are strings, such as 'load.w'")
    while match := _DER.match(name):
        name, order = match.group(1), order + 1
    return name, order


def make_template(
    label: str,
    residual: Any,
    parameters: Collection[str],
    relations: tuple[Relation, ...] = (),
    discretes: Collection[str] = (),
    binds: bool = False,
) -> Template:
    """A template for a residual whose relations have been replaced."""
    named = sorted(s.name for s in residual.free_symbols if s != time)
    apart = {*parameters, *discretes}
    columns = tuple(parse_column(n) for n in named if n not in apart and not is_relation(n))
    used = {s.name for r in relations for s in r.g.free_symbols}.union(named)
    return Template(
        label, residual, columns, tuple(n for n in sorted(parameters) if n in used), relations,
        tuple(n for n in sorted(discretes) if n in used), binds,
    )  # fmt: skip


def never(name: str) -> bool:
    """Predicate that is always false: no name is a discrete variable."""
    return False


def template_of(
    equation: Eq, label: str, is_parameter: Callable[[str], bool], is_discrete: Callable[[str], bool] = never
) -> Template:
    """Analyse one equation of a class.

    Parameters
    ----------
    equation : Eq
        On the symbols of the class.
    label : str
        For error messages.
    is_parameter, is_discrete : callable
        Whether a symbol of that name is a parameter, or a discrete variable.
    """
    return template_of_value(equation.residual, label, is_parameter, is_discrete)


def template_of_value(
    residual: Any, label: str, is_parameter: Callable[[str], bool], is_discrete: Callable[[str], bool]
) -> Template:
    """As `template_of`, for an expression."""
    residual = checked(residual, f"{label}: the residual")
    gone = {s: 0 for s in residual.free_symbols if is_parameter(parse_column(s.name)[0]) and parse_column(s.name)[1]}
    residual, relations = lift_relations(residual.xreplace(gone), is_discrete)
    names = {s.name for s in residual.free_symbols}.union(s.name for r in relations for s in r.g.free_symbols)
    parameters = {n for n in names if is_parameter(n)}
    return make_template(label, residual, parameters, relations, {n for n in names if is_discrete(n)})


def checked(expression: Any, label: str) -> Any:
    """The expression over real symbols; raises an error if it cannot be evaluated, differentiated and printed."""
    bad = (sympy.nan, sympy.zoo, sympy.oo, sympy.S.NegativeInfinity, sympy.I)
    if not isinstance(expression, sympy.Expr) or expression.has(*bad):
        raise DeclarationError(f"{label} is {expression}; expected a real expression of variables and parameters")
    if expression.has(sympy.cot):  # sympy's tan(x + pi/2)
        expression = expression.replace(sympy.cot, lambda x: sympy.cos(x) / sympy.sin(x))
    for node in expression.atoms(sympy.Function, sympy.Derivative, sympy.Integral, sympy.Sum, sympy.Subs):
        if not isinstance(node, KNOWN) and node.func.__name__ not in ("no_event", "settled"):
            hint = "; the time derivative is gl.der(x)" if isinstance(node, sympy.Derivative) else ""
            if isinstance(node, Sample):
                raise DeclarationError(
                    f"{label} holds gl.sample{node.args}, which holds at single instants; it belongs into gl.When, or into the equation of "
                    "a gl.Discrete"
                )
            raise DeclarationError(f"{label} holds {node}, which is not a function of gearlib{hint}")
    for node in expression.atoms(sympy.Piecewise):
        if node.args[-1][1] != sympy.true:
            raise DeclarationError(
                f"{label} holds {node}, which has no value where no condition is true; end it with (value, True)"
            )
        for _, condition in node.args:
            as_condition(condition, f"{label} holds a Piecewise, where the condition")
    for huge in expression.atoms(sympy.Number):
        if abs(huge) > LARGEST:
            raise DeclarationError(f"{label} holds {shown(huge)}, which is too large for a computer's numbers")
    return over_real_symbols(expression)


def over_real_symbols(expression: Any) -> Any:
    """The expression in gearlib's symbols: a user's ``sympy.Symbol("x", positive=True)`` is another one than the declared x."""
    foreign = {s: own for s in expression.free_symbols if s != (own := real_symbol(s.name))}
    return expression.xreplace(foreign) if foreign else expression


def lift_relations(expression: Any, is_discrete: Callable[[str], bool] = never) -> tuple[Any, tuple[Relation, ...]]:
    """Replace the comparisons in ``expression`` by symbols that keep their value between events.

    A comparison of discrete variables changes at events only, and is left as it is.
    """
    protected = {a: sympy.Dummy("no_event", real=True) for a in expression.atoms(sympy.Function) if _no_event(a)}
    given = expression.xreplace(protected)
    expression, followed = _followed(given)
    expression = piecewise(expression)
    atoms = expression.atoms(Relational).union(*(value.atoms(Relational) for value in followed.values()))
    if not protected and not atoms:
        return _all_compared(expression), ()
    plain = {dummy: piecewise(call.replace(_no_event, lambda e: sympy.Add(*e.args))) for call, dummy in protected.items()}
    whole = {a: a.xreplace(followed).xreplace(plain) for a in atoms}
    events = [
        a for a in sorted(whole, key=lambda a: str(whole[a]))
        if isinstance(whole[a], Relational) and not all(is_discrete(s.name) for s in whole[a].free_symbols)
    ]  # fmt: skip
    (found, _), (_, lifted) = _lifted([whole[a] for a in events], 0), _lifted(events, 0)
    held = {a: relation for a, relation in lifted.items() if given.has(a)}
    for dummy, value in followed.items():
        searched = [sympy.Ne(lifted[a].lhs, 2) for a in events if a in value.atoms(Relational)]  # true: those are 0 or 1
        followed[dummy] = sympy.Piecewise((value.xreplace(held), sympy.And(*searched)), (sympy.S.Zero, True))
    return _with_real_branches(_all_compared(expression.xreplace(lifted).xreplace(followed).xreplace(plain))), found


def _all_compared(expression: Any) -> Any:
    """The expression, whose comparisons are lifted, with no `settled` that is not one of them."""
    for rest in expression.find(_settled) if expression.atoms(AppliedUndef) else ():
        raise DeclarationError(
            f"{rest} is not compared, or with discrete variables alone; expected a comparison that raises events, such as "
            "gl.settled(self.x) > 0"
        )
    return expression


def _with_real_branches(expression: Any) -> Any:
    """The expression with no number in branches whose value is complex: sympy takes the power of each branch, also of one not taken."""

    def real(e: Any) -> Any:
        return sympy.Piecewise(*((sympy.nan if value.has(sympy.I) else value, condition) for value, condition in e.args))

    return expression.replace(lambda e: isinstance(e, sympy.Piecewise), real) if expression.has(sympy.I) else expression


def _followed(expression: Any) -> tuple[Any, dict[Any, Any]]:
    """The expression with symbols in place of extrema and magnitudes that keep an argument in its domain, and what these stand for.

    Their events are located, but their value is not held up to there: the step that looks for the zero of x could not be evaluated
    beyond it if ``sqrt(abs(x))`` still was ``sqrt(x)`` there.
    """
    values: dict[Any, Any] = {}

    def follow(e: Any) -> Any:
        inner = {a: sympy.Dummy("followed", real=True) for a in e.args[0].atoms(sympy.Abs, sympy.Max, sympy.Min)}
        values.update({dummy: piecewise(a).xreplace(values) for a, dummy in inner.items()})
        return e.func(e.args[0].xreplace(inner), *e.args[1:])

    bounded = (sympy.log, sympy.asin, sympy.acos, sympy.acosh, sympy.atanh)
    return expression.replace(lambda e: isinstance(e, bounded) or (e.is_Pow and not e.exp.is_integer), follow), values


def _lifted(comparisons: Sequence[Any], first: int) -> tuple[tuple[Relation, ...], dict[Any, Any]]:
    """Relations, numbered from ``first`` on, and what takes the place of the comparisons that they stand for."""
    found: list[Relation] = []
    for atom in comparisons:
        if isinstance(atom, (sympy.Eq, sympy.Ne)):
            raise DeclarationError(f"the comparison {atom}: use <, <=, >, >=; equality of real numbers is not an event")
        less = isinstance(atom, (sympy.StrictLessThan, sympy.LessThan))
        difference = atom.lhs - atom.rhs
        g = difference.replace(_settled, lambda e: e.args[0]) if difference.atoms(AppliedUndef) else difference
        strict = isinstance(atom, (sympy.StrictLessThan, sympy.StrictGreaterThan))
        found.append(Relation(g, strict, less, last=g != difference))
    return tuple(found), {a: sympy.Ne(relation_symbol(first + i), 0) for i, a in enumerate(comparisons)}


def without_events(template: Template) -> list[Any]:
    """The comparisons of a template that raise no events: those of `gl.no_event`, and corners of tables."""
    order = (sympy.StrictLessThan, sympy.LessThan, sympy.StrictGreaterThan, sympy.GreaterThan)
    fixed = {real_symbol(name) for name in (*template.parameters, *template.discretes)}
    return sorted((a for a in template.residual.atoms(*order) if not a.free_symbols <= fixed), key=str)


def with_events(template: Template, comparisons: Sequence[Any]) -> Template:
    """The template with relations in place of some comparisons `without_events`."""
    found, lifted = _lifted(comparisons, len(template.relations))
    residual, relations = template.residual.xreplace(lifted), (*template.relations, *found)
    return make_template(template.label, residual, template.parameters, relations, template.discretes, template.binds)


def _no_event(e: Any) -> bool:
    return bool(getattr(e.func, "__name__", "") == "no_event")


def _settled(e: Any) -> bool:
    return bool(getattr(e.func, "__name__", "") == "settled")


def piecewise(expression: Any) -> Any:
    """Rewrite sign, abs, Min and Max as Piecewise, which is closed under differentiation."""
    if not expression.has(sympy.sign, sympy.Abs, sympy.Max, sympy.Min):
        return expression
    zero = sympy.S.Zero
    # sympy splits abs(sign(x) * y); the power of a branch of -1 would be a complex number
    expression = expression.replace(
        lambda e: isinstance(e, sympy.Abs) and isinstance(e.args[0], sympy.sign),
        lambda e: sympy.Piecewise((1, e.args[0].args[0] > zero), (1, e.args[0].args[0] < zero), (0, True)),
    )
    expression = expression.replace(sympy.sign, lambda x: sympy.Piecewise((1, x > zero), (-1, x < zero), (0, True)))
    expression = expression.replace(sympy.Abs, lambda x: sympy.Piecewise((x, x >= zero), (-x, True)))
    return expression.replace(lambda e: isinstance(e, (sympy.Max, sympy.Min)), _extremum)


def _extremum(e: Any) -> Any:
    larger = isinstance(e, sympy.Max)
    best = e.args[0]
    for other in e.args[1:]:
        best = sympy.Piecewise((best, best >= other if larger else best <= other), (other, True))
    return best
