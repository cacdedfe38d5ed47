"""Accessors for the engine's view of a component; the attributes begin with an underscore so that models may use any name."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from operator import attrgetter, methodcaller
from threading import RLock
from typing import Any, ParamSpec, TypeVar

from gearlib.errors import ModelError

P = ParamSpec("P")
R = TypeVar("R")
Values = Callable[[Any], dict[str, Any]]
ASSEMBLING = RLock()
"""Held while components are assembled and read, which several threads may share; not across a fork."""
if sys.platform != "win32":  # a child forked meanwhile would wait for it for ever
    os.register_at_fork(before=ASSEMBLING.acquire, after_in_parent=ASSEMBLING.release, after_in_child=ASSEMBLING.release)

declarations_of: Values = attrgetter("_declarations")  # of a component or its class
bindable_of: Values = attrgetter("_bindable")  # declarations that accept a value by keyword
parent_of: Callable[[Any], Any] = attrgetter("_parent")  # None for the root
name_of: Callable[[Any], str] = attrgetter("_name")  # in its parent
parts_of: Values = attrgetter("_parts")  # after assembly
connections_of: Callable[[Any], Sequence[Any]] = methodcaller("_assembled")  # assembles a composite on first use
forget: Callable[[Any], None] = methodcaller("_forget")  # discards what ``assemble`` has made, so that it runs again
bindings_of: Values = attrgetter("_bindings")  # values given to parameters and inputs
starts_of: Values = attrgetter("_start")  # from ``start=``, and so on
guesses_of: Values = attrgetter("_guess")
nominals_of: Values = attrgetter("_nominal")
preferences_of: Values = attrgetter("_state")
structural_of: Values = attrgetter("_structural")  # values of all structural choices
choices_given_to: Values = attrgetter("_given")  # those given explicitly
choices_read_of: Callable[[Any], set[str]] = attrgetter("_read")  # names of those that ``equations`` and ``assemble`` have read
radii_of: Callable[[Any], tuple[float, ...]] = methodcaller("_radii")  # m, of its gears; nan for missing values


def reads_parts(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function that reads an assembled component: no other thread assembles it anew meanwhile."""

    @wraps(function)
    def alone(*args: P.args, **given: P.kwargs) -> R:
        with ASSEMBLING:
            return function(*args, **given)

    return alone


def number_of(component: Any, name: str) -> float | None:
    """The number that a parameter has by what was given, by its default, or by what encloses the component; None: it has none."""
    return methodcaller("_number", name)(component)  # type: ignore[no-any-return]


def path_of(component: Any, scope: Any = None) -> str:
    """Path of a component relative to an enclosing one, or to the root.

    Raises
    ------
    ModelError
        It is not a part of ``scope``.
    """
    names: list[str] = []
    node = component
    while node is not None and node is not scope:
        names.append(name_of(node))
        node = parent_of(node)
    if scope is not None and node is None:
        raise ModelError(
            f"{type(scope).__name__} refers to a {type(component).__name__} that is not part of it; assign it to an attribute "
            "first (self.name = ...)"
        )
    return ".".join(n for n in reversed(names) if n)
