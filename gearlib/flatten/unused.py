"""Refusal of unused values: parameters, inputs and structural choices that have no effect under the chosen structure.

A parameter counts as used if an equation of a component, a start value or another used parameter contains it; an input if an equation
other than its own binding does; a structural choice if ``assemble`` or ``equations`` read it, or the default of a used parameter did.
Values that a composite passes to its parts are not refused there: then the composite's own parameter is unused, and is refused if it
was given.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
import sympy

from gearlib.errors import BindingError, GearlibError
from gearlib.flatten.instances import walk
from gearlib.flatten.tree import Tree
from gearlib.language.component import Component, inside, reads_of
from gearlib.language.declarations import NO_VALUE, Input, Offered, Parameter, Structural
from gearlib.language.interior import bindings_of, choices_given_to, choices_read_of, declarations_of, parts_of, structural_of

MOST_TRIALS = 40  # alternative choices tried for the error message


def refuse_unused(tree: Tree, root: Component) -> None:
    """Raise `BindingError` for the first given value without effect."""
    used: Used | None = None
    for component in _components(root):
        number = tree.numbers[id(component)]
        record = tree.instances[number].record
        for name, value in choices_given_to(component).items():
            default = declarations_of(component)[name].default
            if name in choices_read_of(component) or name in record.choices or type(value) is Offered or _same(value, default):
                continue
            used = used or Used(tree)
            if name not in _read_by_defaults(component, number, used):
                raise _refusal(component, tree.instances[number].path, name, value)
        for name, value in bindings_of(component).items():
            if name in record.own_names or type(value) is Offered or value is None or value is NO_VALUE or callable(value):
                continue
            if _from_parent(value):
                continue
            used = used or Used(tree)
            if not used.has(number, name):
                raise _refusal(component, tree.instances[number].path, name, value)


class Used:
    """Parameters and variables that occur in a model's equations, directly or through bindings."""

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self.parameters = np.zeros(len(tree.parameter_names), bool)
        self.variables = np.zeros(tree.n_variables, bool)
        first_variable = np.array([i.first_variable for i in tree.instances], np.int64)
        first_parameter = np.array([i.first_parameter for i in tree.instances], np.int64)
        for template, owners in tree.local_rows.items():
            record, who = tree.instances[owners[0]].record, np.array(owners, np.int64)
            for name in template.parameters:
                self.parameters[first_parameter[who] + record.parameter_index[name]] = True
            for name in template.locals:
                self.variables[first_variable[who] + record.variable_index[name]] = True
        bound: dict[int, tuple[list[int], list[int]]] = {}
        for template, rows in tree.rows.items():
            for _, variables, parameters in rows:
                own = tree.bound.get((template, tuple(variables)))
                if own is not None:
                    bound[own] = variables, parameters
                else:
                    self._mark(variables, parameters)
        for targets in tree.updates.values():
            for _, variables, parameters, _ in targets:
                self._mark(variables, parameters)
        for _, slot, _ in tree.starts:
            self.parameters[slot] = True
        self._follow(bound)

    def _mark(self, variables: list[int], parameters: list[int]) -> None:
        self.variables[variables] = True
        self.parameters[parameters] = True

    def _follow(self, bound: dict[int, tuple[list[int], list[int]]]) -> None:
        """Mark what used parameters and inputs are computed from."""
        made: dict[int, tuple[int, ...]] = {}
        for rows, targets in self._tree.dependents.values():
            made.update(zip(targets, rows, strict=True))
        while True:
            before = self.parameters.sum() + self.variables.sum()
            for own, (variables, parameters) in bound.items():
                if self.variables[own]:
                    self._mark(variables, parameters)
            for target, arguments in made.items():
                if self.parameters[target]:
                    self.parameters[list(arguments)] = True
            if self.parameters.sum() + self.variables.sum() == before:
                return

    def has(self, number: int, name: str) -> bool:
        """Whether a component's parameter or input is used."""
        instance = self._tree.instances[number]
        if name in instance.declared.parameters:
            return bool(self.parameters[instance.parameter(name)])
        return bool(self.variables[instance.variable(name)])


def _read_by_defaults(component: Component, number: int, used: Used) -> set[str]:
    """The structural choices read by the defaults of a component's used parameters and inputs."""
    with inside(component), reads_of(component) as found:
        for name, declared in declarations_of(component).items():
            if isinstance(declared, (Parameter, Input)) and callable(declared.default) and name not in bindings_of(component):
                if used.has(number, name):
                    declared.default(component)
    return found


def _components(root: Component) -> Iterator[Component]:
    stack = [root]
    while stack:
        component = stack.pop()
        yield component
        stack += reversed(parts_of(component).values())


def _same(value: Any, default: Any) -> bool:
    try:
        return bool(value == default)
    except ValueError:  # arrays, which are never a default
        return False


def _from_parent(value: Any) -> bool:
    """Whether a value is an expression of the enclosing component's symbols other than time."""
    return isinstance(value, sympy.Basic) and any(symbol.name != "time" for symbol in value.free_symbols)


def _refusal(component: Component, path: str, name: str, value: Any) -> BindingError:
    kind = type(component).__name__
    declared: Any = declarations_of(component)[name]
    chosen = ", ".join(f"{n}={structural_of(component)[n]!r}" for n in _alternatives(component))
    here = f" with {chosen}" if chosen else ""
    text = declared.description.strip()
    meaning = f" ({text})" if text else ""
    found = _where_it_counts(component, name)
    advice = f"it counts with {' or '.join(found)}" if found else "leave it out"
    shown = repr(value) if len(repr(value)) <= 60 else f"{repr(value)[:55]} ..."
    where = f"{path} ({kind})" if path else kind
    return BindingError(f"{where}: {name}={shown} has no effect{here}{meaning}; {advice}")


def _alternatives(component: Component) -> dict[str, tuple[Any, ...]]:
    """The other values of each structural choice with few values."""
    found: dict[str, tuple[Any, ...]] = {}
    for name, declared in declarations_of(component).items():
        if isinstance(declared, Structural):
            every = declared.choices or ((False, True) if isinstance(declared.default, bool) else ())
            if others := tuple(v for v in every if v != structural_of(component)[name]):
                found[name] = others
    return found


def _where_it_counts(component: Component, name: str) -> list[str]:
    """Other choices under which a value would be used; one choice changed, or two."""
    single = [((n, v),) for n, values in _alternatives(component).items() for v in values]
    double = [(*a, *b) for a, b in combinations(single, 2) if a[0][0] != b[0][0]]
    for trials in (single, double):
        if found := [t for t in trials[:MOST_TRIALS] if _counts(component, name, dict(t))]:
            return [" and ".join(f"{n}={v!r}" for n, v in trial) for trial in found]
    return []


def _counts(component: Component, name: str, other: dict[str, Any]) -> bool:
    """Whether a value would be used under other choices, with arbitrary numbers for all parameters."""
    declarations = declarations_of(component)
    values: dict[str, Any] = {n: 1.0 for n, d in declarations.items() if isinstance(d, Parameter) and d.default is NO_VALUE}
    values |= {n: 1.0 for n, d in declarations.items() if isinstance(d, Input)}
    try:
        trial = type(component)(**{**values, **structural_of(component), **other})
        try:
            tree = walk(trial)
        except GearlibError:
            return name in choices_read_of(trial)
        if isinstance(declarations[name], Structural):
            read = name in choices_read_of(trial) or name in tree.instances[0].record.choices
            return read or name in _read_by_defaults(trial, 0, Used(tree))
        return Used(tree).has(0, name)
    except Exception:  # a component with its own constructor, or one that needs other values: no advice then
        return False
