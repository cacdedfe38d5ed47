"""`Counterpart`: correspondence between component classes and those of the Modelica Standard Library, with their names."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from gearlib.language.declarations import Declaration

LIBRARY = "gearparts.modelica_names"  # module that lists the counterparts of the component library
_ELEMENT_OF_FAMILY = re.compile(r"(\w+)\[(\d+)\]\.(\w+)")
_HUMP = re.compile(r"(?<=[a-z0-9])([A-Z])")


def snake_case(name: str) -> str:
    """Convert a name from Modelica's usual spelling to that of the component library.

    >>> snake_case("useHeatPort"), snake_case("TorqueDirection"), snake_case("J"), snake_case("phi_rel0")
    ('use_heat_port', 'torque_direction', 'J', 'phi_rel0')
    """
    return _HUMP.sub(r"_\1", name).lower() if _HUMP.search(name) or (name[:1].isupper() and len(name) > 1) else name


class ModelicaClass(type):
    """Metaclass of component classes read from text, which are pickled as that text."""

    modelica_text: str
    modelica_source: str
    modelica_name: str


@dataclass(frozen=True)
class Counterpart:
    """The component class for a class of the Modelica Standard Library.

    Parameters
    ----------
    home : str
        Its location: ``"gearparts.rotational.shafts:Inertia"``.
    names : mapping of str to str
        Component names by Modelica names, where these are neither equal nor equal in snake case.
    given : mapping of str to str
        Component names by Modelica names, where modifications refer to another name than equations do: ``{"y": "expression"}``.
    values : mapping of str to mapping
        Values of structural choices by the last identifier of Modelica's enumeration literal.
    starts : mapping of str to str
        Variables by the parameters that hold their start values: ``{"y_start": "y"}``.
    nominals : mapping of str to str
        Variables by the parameters that hold their nominal values.
    states : tuple of str
        Variables that a ``stateSelect`` parameter refers to.
    ignored : frozenset of str
        Parameters without effect on trajectories.
    enumerations : mapping of str to str
        Enumeration types of ``values``.
    own : frozenset of str
        Names that Modelica's class does not have.
    only : mapping of str to tuple
        The values that some Modelica parameters may have, with no effect here; others are refused.
    converted : mapping of str to two functions
        Values of a Modelica parameter as the component's, and back.
    arrays : mapping of str to str or tuple of str
        The component's signals that are the elements of a Modelica array: a tuple of names, or the variable of a family of parts:
        ``{"y": "outputs.y", "u": ("phi_ref", "w_ref", "a_ref")}``.
    truths : frozenset of str
        Inputs and outputs of the component that are 1 or 0 where Modelica's are true or false.
    """

    home: str
    names: Mapping[str, str] = field(default_factory=dict)
    given: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    starts: Mapping[str, str] = field(default_factory=dict)
    nominals: Mapping[str, str] = field(default_factory=dict)
    states: tuple[str, ...] = ()
    ignored: frozenset[str] = frozenset()
    enumerations: Mapping[str, str] = field(default_factory=dict)
    own: frozenset[str] = frozenset()
    only: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    converted: Mapping[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = field(default_factory=dict)
    arrays: Mapping[str, str | tuple[str, ...]] = field(default_factory=dict)
    truths: frozenset[str] = frozenset()

    @cached_property
    def component(self) -> type[Any]:
        """The component or connector class."""
        module, _, name = self.home.partition(":")
        found: type[Any] = getattr(importlib.import_module(module), name)
        return found

    def local(self, name: str) -> str:
        """Name in the component class for a Modelica name."""
        return local_name(self.component, self.names, name)

    def element(self, path: str) -> str | None:
        """Modelica's element of an array, such as ``y[1]``, for a path in the component; None if it is none."""
        for array, signals in self.arrays.items():
            if isinstance(signals, tuple):
                if path in signals:
                    return f"{array}[{signals.index(path) + 1}]"
            elif (found := _ELEMENT_OF_FAMILY.fullmatch(path)) and f"{found[1]}.{found[3]}" == signals:
                return f"{array}[{int(found[2]) + 1}]"
        return None


def local_name(kind: type[Any], names: Mapping[str, str], name: str) -> str:
    """Name of a declaration or part: unchanged, or in snake case."""
    if name in names:
        return names[name]
    return name if isinstance(getattr(kind, name, None), Declaration) else snake_case(name)


@dataclass(frozen=True)
class StandardLibrary:
    """Counterparts of the Modelica Standard Library's classes, by their full names."""

    counterparts: Mapping[str, Counterpart]
    spellings: Mapping[str, str] = field(default_factory=dict)  # Modelica spellings by snake case

    def outward(self, counterpart: Counterpart) -> Mapping[str, str]:
        """Modelica names by component names, where they differ."""
        return {
            **self.spellings,
            **{local: name for names in (counterpart.names, counterpart.given) for name, local in names.items()},
        }

    @cached_property
    def names_by_home(self) -> Mapping[str, Mapping[str, str]]:
        """Modelica names that differ, by the location of the component class."""
        found: dict[str, dict[str, str]] = {}
        for counterpart in self.counterparts.values():
            found.setdefault(counterpart.home, {}).update(counterpart.names)
        return found

    @cached_property
    def arrays_by_home(self) -> Mapping[str, Mapping[str, str | tuple[str, ...]]]:
        """Modelica arrays of signals, by the location of the component class."""
        return {c.home: c.arrays for c in self.counterparts.values() if c.arrays}

    @cached_property
    def known(self) -> frozenset[str]:
        """Full names of the known classes and their packages."""
        found = {
            *self.counterparts, "Modelica.Units.SI", "Modelica.Units.Conversions", "Modelica.SIunits", "Modelica.Constants",
            "Modelica.Math", "Modelica.Blocks.Interfaces",
        }  # fmt: skip
        packages = {full[: m.start()] for full in found for m in re.finditer(r"\.", full)}
        return frozenset(found | packages)

    def knows(self, path: tuple[str, ...]) -> bool:
        """Whether a full name is known here."""
        above = ".".join(path[:-1])
        types = path.index("Types") if "Types" in path else 0
        return (
            ".".join(path) in self.known or above in _PACKAGES_OF_MANY or (types > 0 and ".".join(path[:types]) in self.known)
        )


_PACKAGES_OF_MANY = frozenset(
    {
        "Modelica.Units.SI", "Modelica.SIunits", "Modelica.Constants", "Modelica.Math", "Modelica.Units.Conversions",
        "Modelica.Blocks.Interfaces",
    }
)  # fmt: skip


def standard_library() -> StandardLibrary:
    """The counterparts provided by the component library."""
    found: StandardLibrary = importlib.import_module(LIBRARY).STANDARD_LIBRARY
    return found


def home_of(kind: type[Any]) -> str:
    """Location of a class, as counterparts state it; a class of the text may have the name of one of the library."""
    return f"{kind.__module__}:{kind.__name__}"


def names_in(kind: type[Any]) -> Mapping[str, str]:
    """Modelica names within instances of a class, where they differ."""
    by_home = standard_library().names_by_home
    return {name: local for base in reversed(kind.__mro__) for name, local in by_home.get(home_of(base), {}).items()}


def array_in(kind: type[Any], name: str) -> str | tuple[str, ...] | None:
    """The signals of a class that are the elements of a Modelica array; None if that is none."""
    by_home = standard_library().arrays_by_home
    return next((arrays[name] for base in kind.__mro__ if name in (arrays := by_home.get(home_of(base), {}))), None)
