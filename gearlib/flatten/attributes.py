"""Attributes of variables: flow or potential, state preference, nominal value.

They are declared by the component's class and may be overridden per instance; aliases share them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import is_real, shown
from gearlib.equations.class_record import ClassRecord
from gearlib.errors import BindingError, nearest
from gearlib.flatten.model import Instance
from gearlib.flatten.tree import Tree
from gearlib.language.component import Component
from gearlib.language.declarations import Variable
from gearlib.language.interior import nominals_of, preferences_of

PREFERENCE = {"never": 0, "avoid": 1, "default": 2, "prefer": 3}


Choices = Sequence[tuple[int, str, Any]]
"""Attributes given to instances: variable, "nominal" or "state", and the value."""


def choices_of(component: Component, instance: Instance) -> Iterator[tuple[str, str, Any]]:
    """Attribute overrides of an instance: name, "nominal" or "state", and the value.

    Raises
    ------
    BindingError
        An unknown variable, or an invalid value.
    """
    where = instance.path or instance.kind
    for what, given in (("nominal", nominals_of(component)), ("state", preferences_of(component))):
        for name, value in given.items():
            if not isinstance(name, str) or name not in instance.declared.variables:
                raise BindingError(
                    f"{where}: {what} is given for {shown(name)}, which is not a variable of {instance.kind}; "
                    f"{nearest(str(name), instance.declared.variables)}{'; give that of a part to the part' * ('.' in str(name))}"
                )
            if what == "state" and not (isinstance(value, str) and value in PREFERENCE):
                raise BindingError(
                    f"{where}: state of '{name}' is {shown(value)}; valid choices: {', '.join(map(repr, PREFERENCE))}"
                )
            if what == "nominal" and not (is_real(value) and value > 0):
                raise BindingError(
                    f"{where}: nominal value of '{name}' is {shown(value)}; expected a positive number, its typical size"
                )
            yield name, what, value


def places_of_classes(tree: Tree) -> list[tuple[ClassRecord, NDArray[np.int64]]]:
    """Each class with the first variables of its instances."""
    found: dict[int, tuple[ClassRecord, list[int]]] = {}
    for instance in tree.instances:
        found.setdefault(id(instance.record), (instance.record, []))[1].append(instance.first_variable)
    return [(record, np.array(first, np.int64)) for record, first in found.values()]


def declared(
    places: Iterable[tuple[ClassRecord, NDArray[np.int64]]], value: Callable[[str, Variable], Any], default: NDArray[Any]
) -> NDArray[Any]:
    """An attribute of all variables as the classes declare it.

    Parameters
    ----------
    places : iterable of (class record, array of int)
        See `places_of_classes`.
    value : callable
        The attribute of a variable with a name and a declaration.
    default : array, shape (variables,)
        For variables of no instance.
    """
    result = default.copy()
    for record, first in places:
        values = np.array([value(name, v) for name, v in record.declared.variables.items()], default.dtype)
        result[first[:, None] + np.arange(len(values))] = values
    return result


def of_any_alias(own: NDArray[np.bool_], rep: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether a variable or one of its aliases has an attribute, at their representative."""
    found = np.zeros(len(rep), bool)
    found[rep[own]] = True
    return found


def preferences(
    own: NDArray[np.int64], potential: NDArray[np.bool_], rep: NDArray[np.int64], choices: Choices
) -> NDArray[np.int64]:
    """Preference of each representative as a state, merged from its aliases; instance overrides take precedence."""
    found = np.where(potential, PREFERENCE["avoid"], PREFERENCE["default"])
    for level in (PREFERENCE["avoid"], PREFERENCE["never"], PREFERENCE["prefer"]):
        found[rep[own == level]] = level
    for variable, wish in ((v, x) for v, what, x in choices if what == "state"):
        found[rep[variable]] = PREFERENCE[wish]
    return found


def nominals(own: NDArray[np.float64], rep: NDArray[np.int64], choices: Choices) -> NDArray[np.float64]:
    """Nominal value of each representative: instance overrides take precedence, then the smallest among its aliases."""
    found = np.ones(len(rep))
    for size in sorted(set(own[own != 1.0].tolist()), reverse=True):
        found[rep[own == size]] = size
    for variable, size in sorted(((v, x) for v, what, x in choices if what == "nominal"), key=lambda choice: -choice[1]):
        found[rep[variable]] = size
    return found
