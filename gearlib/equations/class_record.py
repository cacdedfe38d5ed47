"""`class_record`: the analysis of one class with one set of structural choices, shared by all its instances."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import sympy

from gearlib.arguments import shown
from gearlib.equations.discrete_updates import Update, split_equations
from gearlib.equations.template import Template, template_of
from gearlib.errors import BalanceError, DeclarationError, nearest
from gearlib.language.component import PRIVATE, Component, check_declarations, equations_of, with_parts
from gearlib.language.declarations import Connector, Declared, Discrete, declared_by
from gearlib.language.dimensions import unit_errors, values_compared, values_given
from gearlib.language.expressions import Eq, Reinit, When, check_depth, value_of
from gearlib.language.interior import choices_read_of, declarations_of, parts_of, structural_of

MOST = 300  # equations of a class up to which it is examined for sums of them that repeat others
DEPENDENT = 1e-10  # singular value of scaled equations, and weight of an equation in a sum, that count as zero


@dataclass(frozen=True)
class ClassRecord:
    """Declarations and analysed equations of one class with one set of structural choices."""

    declared: Declared
    variable_index: dict[str, int]
    parameter_index: dict[str, int]
    connector_index: dict[str, int]
    templates: tuple[Template, ...]
    local: bool  # the equations contain only the component's own variables and parameters
    updates: tuple[Update, ...]
    discretes: dict[str, Discrete]
    choices: frozenset[str]  # structural choices that the equations and the connectors depend on
    own_names: frozenset[str]  # own parameters and variables in the equations
    fitting: set[Any] = field(default_factory=set)  # parts with values given to them, whose units were found to fit


Met = dict[Any, ClassRecord]  # by class and arguments of an instance: the records of the current compilation
_records: WeakKeyDictionary[type[Component], dict[Any, ClassRecord]] = WeakKeyDictionary()


def class_record(component: Component, met: Met | None = None) -> ClassRecord:
    """Class record of a component, memoised by its equations.

    What ``equations`` reads may have changed since the last compilation: a constant of a module, an attribute of the class or of an
    object. So ``equations`` is called again once per compilation, class and structural choice, and its result is the cache key.
    """
    kind = type(component)
    key = _choices(component)
    readable = _readable(component)
    whole = id(component) if readable is None else (key, readable)
    found = None if met is None else met.get(whole)
    if found is not None:
        return found
    check_declarations(kind)
    equations = equations_of(component)
    parts = _kinds_of_parts(component) if equations else ()
    written = (key, parts, tuple(_written(e, kind.__name__) for e in equations))
    known = _records.setdefault(kind, {})
    if written not in known:
        known[written] = _analysed(component, equations)
    if met is not None:
        met[whole] = known[written]
    return known[written]


def _choices(component: Component) -> tuple[Any, ...]:
    """Class and structural choices of a component, which can be compared."""
    kind, values = type(component), structural_of(component)
    key = (kind, tuple(values.items()), tuple(map(type, values.values())))
    try:
        hash(key)
    except Exception:  # a user's object may have a failing hash()
        raise DeclarationError(f"{kind.__name__}: values of structural choices must be hashable, got {shown(values)}") from None
    return key


def _written(action: Eq | When | Reinit, name: str) -> tuple[Any, ...]:
    """Hashable form of an equation: its sides as sympy expressions."""
    if isinstance(action, When):
        return tuple((branch.condition, *(_written(a, name) for a in branch.actions)) for branch in action.branches)
    if isinstance(action, Reinit):
        return action.state, action.value, "reinit"
    for side in (action.left, action.right):
        check_depth(side, name)
    try:
        return value_of(action.left, "the left side"), value_of(action.right, "the right side")
    except DeclarationError as problem:
        sides = f"{shown(action.left)} == {shown(action.right)}"
        raise DeclarationError(f"{name}.equations(): {sides} is not an equation: {problem}") from None


def _analysed(component: Component, equations: Sequence[Eq | When]) -> ClassRecord:
    """Analyse equations that are not in the cache."""
    declared = declared_by(component)
    name = type(component).__name__

    def is_parameter(symbol: str) -> bool:
        return _kind_of(symbol, component, declared) == "parameter"

    continuous, updates, discretes = split_equations(name, equations, declared.discretes, is_parameter, declared.variables)

    def is_discrete(symbol: str) -> bool:
        return symbol == "initial()" or symbol.removeprefix("pre(").removesuffix(")") in discretes

    templates = tuple(template_of(e, f"{name}: {e.left} = {e.right}", is_parameter, is_discrete) for e in continuous)
    everything = (*templates, *(u.template for u in updates))
    for t in everything:
        for local in t.locals:
            if _kind_of(local, component, declared) is None:
                if (of := local.removeprefix("pre(").removesuffix(")")) != local and of in declared.variables:
                    raise DeclarationError(
                        f"{t.label}: {local} is for a gl.Discrete, and {of} changes continuously; in a gl.When, {of} itself is its value "
                        "before the event"
                    )
                raise DeclarationError(f"{t.label}: '{local}' is not declared; {nearest(local, declared.variables)}")
    _refuse_void(templates)
    refuse_misfits(unit_errors(component, values_compared(component, equations)))
    own = all(local in declared.variables for t in everything for local in t.locals)
    own = own and all(p in declared.parameters for t in everything for p in t.parameters)
    return ClassRecord(
        declared,
        {n: i for i, n in enumerate(declared.variables)},
        {n: i for i, n in enumerate(declared.parameters)},
        {n: i for i, n in enumerate(declared.connectors)},
        templates,
        own and not updates and not any(t.discretes for t in templates),
        updates,
        discretes,
        frozenset(choices_read_of(component))
        | {d.when for d in declarations_of(component).values() if isinstance(d, Connector) and d.when},
        frozenset(n for t in everything for n in (*t.locals, *t.parameters)),
    )


def _refuse_void(templates: Sequence[Template]) -> None:
    """Refuse equations of a class that contain no variable, or that repeat others of the class.

    In later phases both could pass for redundant rigid connections, whose undetermined torque is set to zero.
    """
    known: dict[Any, Template] = {}
    for t in templates:
        if not (t.columns or t.discretes or t.relation_columns):
            raise BalanceError(
                f"the model is not balanced. over-determined: {t.label} holds no variable that it could determine"
            )
        other = known.setdefault(t.residual, known.get(-t.residual, t))
        if other is not t:
            raise BalanceError(
                f"the model is not balanced. over-determined: {_both(other, t)} say the same; leave one of them out"
            )
    sharing = _sharing([t for t in _sharing(templates) if t.linear and t.columns]) if len(templates) <= MOST else ()
    if repeated := _dependent(sharing):
        raise BalanceError(
            f"the model is not balanced. over-determined: one of these equations follows from the others: {'; '.join(repeated)}"
        )


def _sharing(templates: Sequence[Template]) -> Sequence[Template]:
    """Equations without a variable of their own: only these can follow from each other."""
    for _ in templates:  # without some, others have one, too
        count = Counter(column for t in templates for column in t.columns)
        left = [t for t in templates if all(count[column] > 1 for column in t.columns)]
        if len(left) == len(templates):
            break
        templates = left
    return templates


def _dependent(templates: Sequence[Template]) -> list[str]:
    """Those of some linear equations that repeat each other, or sums of each other, whatever their parameters are."""
    symbols = sorted({s for t in templates for s in t.residual.free_symbols}, key=str)
    generic = {s: sympy.Float(1.5 + math.sin(3 * k * k)) for k, s in enumerate(symbols, 1)}
    columns = dict.fromkeys(column for t in templates for column in t.columns)
    known: dict[str, list[float]] = {}
    for t in templates:
        slopes = dict(zip(t.columns, t.slopes, strict=True))
        values = [e.xreplace(generic) for e in (*(slopes.get(column, sympy.S.Zero) for column in columns), t.rest)]
        if all(value.is_Float or value.is_Rational for value in values):  # else no number follows from its parameters
            known[t.label] = list(map(float, values))
    rows = np.reshape([*known.values()], (-1, len(columns) + 1))
    rows /= np.abs(rows[:, :-1]).max(axis=1, initial=0.0, keepdims=True)
    rows /= np.maximum(np.abs(rows).max(axis=0, initial=0.0), 1e-300)
    left, sizes, _ = np.linalg.svd(rows)
    repeated = (np.abs(left[:, int((sizes > DEPENDENT).sum()) :]) > DEPENDENT).any(axis=1)
    return [label for label, here in zip(known, repeated, strict=True) if here]


def _both(one: Template, other: Template) -> str:
    return f"{one.label} and {other.label}" if one.label != other.label else f"two equations {one.label}"


def check_values(component: Component, record: ClassRecord) -> None:
    """Refuse values given to parts whose units do not fit; values of assemblies already checked are skipped."""
    if not (pairs := tuple(values_given(component))):
        return
    given = (_kinds_of_parts(component), pairs)
    if given not in record.fitting:
        refuse_misfits(unit_errors(component, pairs))
        record.fitting.add(given)


def refuse_misfits(errors: Sequence[str]) -> None:
    """Raise the errors found by `unit_errors`."""
    if errors:
        raise DeclarationError(f"units do not match (gl.check_units lists all mismatches of a component): {'; '.join(errors)}")


def _kinds_of_parts(component: Component) -> tuple[Any, ...]:
    """What the names that equations take from parts depend on."""
    return tuple((path, _choices(part)) for path, part in with_parts(component)[1:])


def _readable(component: Component) -> tuple[Any, ...] | None:
    """What the equations of an instance may depend on besides its structural choices: its attributes, its parts, and theirs.

    Parts may be given to an instance, so that another of its class has others. None where attributes cannot be compared.
    """
    own = _plain_attributes(component)
    if own is None or not parts_of(component) or type(component).equations is Component.equations:
        return own
    parts = [(path, _choices(part), _plain_attributes(part)) for path, part in with_parts(component)[1:]]
    return None if any(attributes is None for _, _, attributes in parts) else (own, *parts)


def _plain_attributes(component: Component) -> tuple[Any, ...] | None:
    """Attributes of an instance besides its parts: its equations may depend on them, as on a structural choice.

    None where they cannot be compared (arrays): the equations of such an instance are analysed separately.
    """
    own = component.__dict__
    if len(own) == len(PRIVATE):
        return ()
    families = {name.partition("[")[0] for name in parts_of(component)}
    plain = tuple((n, type(v), v) for n, v in own.items() if n not in PRIVATE and n not in families)
    try:
        hash(plain)
    except Exception:  # a user's object may have a failing hash()
        return None
    return plain


def _kind_of(name: str, component: Component, declared: Declared) -> str | None:
    """Kind of a name as seen from a component, its own or a part's: "variable", "parameter" or None."""
    if name in declared.variables:
        return "variable"
    if name in declared.parameters:
        return "parameter"
    part, local = descend(component, name)
    return None if part is component else _kind_of(local, part, declared_by(part))


def descend(component: Component, name: str) -> tuple[Component, str]:
    """The innermost part that a dotted path leads to, and the rest of the path."""
    head, dot, rest = name.partition(".")
    part = parts_of(component).get(head) if dot else None
    return (component, name) if part is None else descend(part, rest)
