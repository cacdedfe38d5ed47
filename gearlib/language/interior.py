"""What the engine reads of a component. The attributes begin with an underscore, so that they take no name from a model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter, methodcaller
from typing import Any

from gearlib.errors import ModelError

Values = Callable[[Any], dict[str, Any]]

declarations_of: Values = attrgetter("_declarations")  # of a component or its class
bindable_of: Values = attrgetter("_bindable")  # those that take a value by keyword
parent_of: Callable[[Any], Any] = attrgetter("_parent")  # None of the outermost
name_of: Callable[[Any], str] = attrgetter("_name")  # in its parent
parts_of: Values = attrgetter("_parts")  # once it is assembled
connections_of: Callable[[Any], Sequence[Any]] = methodcaller("_assembled")  # which assembles a composite at the first call
forget: Callable[[Any], None] = methodcaller("_forget")  # what ``assemble`` has made, so that it is made again
bindings_of: Values = attrgetter("_bindings")  # what parameters and inputs were given
starts_of: Values = attrgetter("_start")  # what ``start=`` gave, and so on
guesses_of: Values = attrgetter("_guess")
nominals_of: Values = attrgetter("_nominal")
preferences_of: Values = attrgetter("_state")
structural_of: Values = attrgetter("_structural")  # values of all structural choices
choices_given_to: Values = attrgetter("_given")  # of those that were given
choices_read_of: Callable[[Any], set[str]] = attrgetter("_read")  # names of those that ``equations`` and ``assemble`` read
radii_of: Callable[[Any], tuple[float, ...]] = methodcaller("_radii")  # m, of its gears; nan where a value is missing


def path_of(component: Any, scope: Any = None) -> str:
    """The path of a component from one that encloses it, or from the outermost.

    Raises
    ------
    ModelError
        It is no part of ``scope``.
    """
    names: list[str] = []
    node = component
    while node is not None and node is not scope:
        names.append(name_of(node))
        node = parent_of(node)
    if scope is not None and node is None:
        raise ModelError(
            f"{type(scope).__name__} refers to a {type(component).__name__} that is no part of it; assign it to an attribute "
            "first (self.name = ...)"
        )
    return ".".join(n for n in reversed(names) if n)
