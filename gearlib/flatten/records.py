"""`class_record`: the analysis of one class with one set of structural choices, shared by all its instances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

from gearlib.errors import DeclarationError, nearest
from gearlib.flatten.discrete import Update, split_equations
from gearlib.flatten.templates import Template, template_of
from gearlib.language.component import PRIVATE, Component, Declared, declared_by, equations_of
from gearlib.language.declarations import Connector, Discrete


@dataclass(frozen=True)
class ClassRecord:
    """What one class with one set of structural choices declares and states."""

    declared: Declared
    variable_index: dict[str, int]
    parameter_index: dict[str, int]
    templates: tuple[Template, ...]
    local: bool  # the equations hold the component's own variables and parameters only
    updates: tuple[Update, ...]
    discretes: dict[str, Discrete]
    choices: frozenset[str]  # structural choices that the equations and the connectors depend on
    own_names: frozenset[str]  # own parameters and variables that the equations hold


_records: WeakKeyDictionary[type[Component], dict[Any, ClassRecord]] = WeakKeyDictionary()


def class_record(component: Component) -> ClassRecord:
    """The analysis of a component's class, from the cache where the class was met before."""
    key: Any = tuple(component._structural.items())
    known = _records.setdefault(type(component), {})
    try:
        hash(key)
    except TypeError:
        raise DeclarationError(
            f"{type(component).__name__}: values of structural choices must be hashable, got {key}"
        ) from None
    extras = _plain_attributes(component)
    key = None if extras is None else key + extras
    if key in known:
        return known[key]
    declared = declared_by(component)
    name = type(component).__name__
    lookup = _Lookup(component, declared)
    split = split_equations(name, equations_of(component), declared.discretes, lookup.is_parameter, declared.variables)

    def is_held(symbol: str) -> bool:
        return symbol == "initial()" or symbol.removeprefix("pre(").removesuffix(")") in split.discretes

    templates = tuple(template_of(e, f"{name}: {e.left} = {e.right}", lookup.is_parameter, is_held) for e in split.continuous)
    everything = (*templates, *(u.template for u in split.updates))
    for t in everything:
        for local in t.locals:
            if lookup.find(local) is None:
                raise DeclarationError(f"{t.label}: '{local}' is not declared; {nearest(local, declared.variables)}")
    own = all(local in declared.variables for t in everything for local in t.locals)
    own = own and all(p in declared.parameters for t in everything for p in t.parameters)
    record = ClassRecord(
        declared,
        {n: i for i, n in enumerate(declared.variables)},
        {n: i for i, n in enumerate(declared.parameters)},
        templates,
        own and not split.updates and not any(t.held for t in templates),
        split.updates,
        split.discretes,
        frozenset(component._read) | {d.when for d in component._declarations.values() if isinstance(d, Connector) and d.when},
        frozenset(n for t in everything for n in (*t.locals, *t.parameters)),
    )
    if key is not None:
        known[key] = record
    return record


def _plain_attributes(component: Component) -> tuple[tuple[str, Any], ...] | None:
    """What an instance holds besides its parts: its equations may depend on it, as on a structural choice.

    None where that cannot be compared (arrays): such an instance is analysed by itself.
    """
    own = component.__dict__
    if len(own) == len(PRIVATE):
        return ()
    families = {name.split("[", 1)[0] for name in component._parts}
    plain = tuple((n, v) for n, v in own.items() if n not in PRIVATE and n not in families)
    try:
        hash(plain)
    except TypeError:
        return None
    return plain


@dataclass(frozen=True)
class _Lookup:
    """Resolves names as seen from a component: its own, or those of its parts."""

    component: Component
    declared: Declared

    def find(self, name: str) -> str | None:
        """What the name is: "variable", "parameter" or None."""
        if name in self.declared.variables:
            return "variable"
        if name in self.declared.parameters:
            return "parameter"
        part, local = descend(self.component, name)
        if part is None or part is self.component:
            return None
        return _Lookup(part, declared_by(part)).find(local)

    def is_parameter(self, name: str) -> bool:
        return self.find(name) == "parameter"


def descend(component: Component, name: str) -> tuple[Component | None, str]:
    node = component
    while "." in name and name.split(".", 1)[0] in node._parts:
        head, name = name.split(".", 1)
        node = node._parts[head]
    return node, name
