"""Attributes of variables: flow or potential, state preference, nominal value.

They are declared by the component's class and may be overridden per instance; aliases share them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import is_real, shown
from gearlib.errors import BindingError, nearest
from gearlib.flatten.model import Instance
from gearlib.flatten.tree import Tree
from gearlib.language.component import Component
from gearlib.language.declarations import Flow, Potential
from gearlib.language.interior import nominals_of, preferences_of

PREFERENCE = {"never": 0, "avoid": 1, "default": 2, "prefer": 3}


@dataclass(frozen=True)
class Attributes:
    """Attributes of all variables, one array each."""

    potential: NDArray[np.bool_]
    flow: NDArray[np.bool_]
    rank: NDArray[np.int64]  # rank as the representative of its aliases
    preference: NDArray[np.int64]  # preference as a state
    nominal: NDArray[np.float64]


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
            if not isinstance(name, str) or name not in instance.variables:
                raise BindingError(
                    f"{where}: {what} is given for {shown(name)}, which is not a variable of {instance.kind}; "
                    f"{nearest(str(name), instance.variables)}"
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


def attributes_of(tree: Tree, n_variables: int) -> Attributes:
    """Attributes as declared by the classes."""
    own = Attributes(
        np.zeros(n_variables, bool), np.zeros(n_variables, bool), np.ones(n_variables, np.int64),
        np.full(n_variables, PREFERENCE["default"]), np.ones(n_variables),
    )  # fmt: skip
    targets = (own.potential, own.flow, own.rank, own.preference, own.nominal)
    known: dict[int, list[np.ndarray]] = {}
    for record, instance in zip(tree.records, tree.instances, strict=True):
        if id(record) not in known:
            declared = record.declared.variables
            known[id(record)] = [
                np.array([isinstance(v, Potential) for v in declared.values()], bool),
                np.array([isinstance(v, Flow) for v in declared.values()], bool),
                np.array(["." in n for n in declared], np.int64),
                np.array([PREFERENCE[v.state] for v in declared.values()], np.int64),
                np.array([v.nominal for v in declared.values()], float),
            ]
        here = slice(instance.first_variable, instance.first_variable + len(instance.variables))
        for target, values in zip(targets, known[id(record)], strict=True):
            target[here] = values
    return own


def merge(own: Attributes, rep: NDArray[np.int64], choices: Sequence[tuple[int, str, Any]]) -> Attributes:
    """Attributes of each representative, merged from its aliases; instance overrides take precedence, then the smallest nominal value."""
    n = len(rep)
    potential, flow = np.zeros(n, bool), np.zeros(n, bool)
    potential[rep[own.potential]] = True
    flow[rep[own.flow]] = True
    preference = np.full(n, PREFERENCE["default"])
    preference[potential] = PREFERENCE["avoid"]
    for level in (PREFERENCE["avoid"], PREFERENCE["never"], PREFERENCE["prefer"]):
        preference[rep[own.preference == level]] = level
    nominal = np.ones(n)
    for size in np.unique(own.nominal[own.nominal != 1.0])[::-1]:
        nominal[rep[own.nominal == size]] = size
    for variable, size in sorted(((v, x) for v, what, x in choices if what == "nominal"), key=lambda choice: -choice[1]):
        nominal[rep[variable]] = size
    for variable, wish in ((v, x) for v, what, x in choices if what == "state"):
        preference[rep[variable]] = PREFERENCE[wish]
    return Attributes(potential, flow, own.rank, preference, nominal)
