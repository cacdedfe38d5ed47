"""Bond graphs: numbered bonds between elements, validated at construction."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

from gearlib.arguments import is_real, shown
from gearlib.bondgraph.elements import GY, TF, Element, Junction, R, Se, Sf, Storage
from gearlib.errors import ArgumentError, ConnectionError

__all__ = ["Bond", "BondGraph"]


@dataclass(frozen=True)
class Bond:
    """A bond; its half arrow points from ``tail`` to ``head``, the direction of positive power."""

    number: int
    tail: Element
    head: Element

    def other(self, end: Element) -> Element:
        """The opposite end."""
        return self.tail if end is self.head else self.head

    def sign(self, end: Element) -> int:
        """+1 if the half arrow points to ``end``, -1 if it points away from it."""
        return 1 if end is self.head else -1


class BondGraph:
    """Elements joined by numbered bonds.

    Parameters
    ----------
    *bonds : tuple
        (number, tail, head) of each bond. The half arrow points from tail to head: into I, C and R, through TF and GY.
    name : str
        Name of the graph in messages.

    Raises
    ------
    ConnectionError
        An element has too few or too many bonds, a bond number is duplicated, or half arrows point the wrong way.

    Examples
    --------
    A mass on a spring, driven by a force:

    >>> from gearlib.bondgraph import BondGraph, C, I, One, Se
    >>> v = One("v")
    >>> graph = BondGraph((1, Se(), v), (2, v, I()), (3, v, C()), name="oscillator")
    >>> [bond.number for bond in graph.at(v)]
    [1, 2, 3]

    References
    ----------
    D. C. Karnopp, D. L. Margolis, R. C. Rosenberg, "System Dynamics", 5th ed., Wiley, 2012.
    https://doi.org/10.1002/9781118152812
    """

    def __init__(self, *bonds: tuple[int, Element, Element], name: str = "bond graph") -> None:
        if not isinstance(name, str):
            raise ArgumentError(f"BondGraph: name is {shown(name)}; expected text")
        self.name = name
        made: dict[int, Bond] = {}
        for bond in bonds:
            number, tail, head = _of_bond(name, bond)
            if number in made:
                raise ConnectionError(f"{name}: bond {number} is used twice")
            if tail is head:
                raise ConnectionError(f"{name}: bond {number} begins and ends on the same element")
            made[number] = Bond(number, tail, head)
        self.bonds: Mapping[int, Bond] = MappingProxyType(dict(sorted(made.items())))
        for element, ends in self._ends.items():
            _check(self, element, ends)

    @cached_property
    def _ends(self) -> Mapping[Element, tuple[Bond, ...]]:
        ends: dict[Element, list[Bond]] = {}
        for bond in self.bonds.values():
            for element in (bond.tail, bond.head):
                ends.setdefault(element, []).append(bond)
        return MappingProxyType({element: tuple(found) for element, found in ends.items()})

    @property
    def elements(self) -> tuple[Element, ...]:
        """All elements, ordered by their lowest bonds."""
        return tuple(self._ends)

    def at(self, element: Element) -> tuple[Bond, ...]:
        """Bonds that end on ``element``, by number."""
        self._check_element(element)
        if element not in self._ends:
            raise ArgumentError(f"{self.name}: the {element.kind} element given is on no bond of this graph")
        return self._ends[element]

    def _check_element(self, element: Any) -> None:
        if not isinstance(element, Element):
            raise ArgumentError(
                f"{self.name}: element is {shown(element)}; expected an element of the graph, one of graph.elements"
            )

    def element(self, number: int, *kinds: type[Element]) -> Element:
        """The source, storage element or resistance at an end of a bond, restricted to some kinds if these are given.

        >>> from gearlib.bondgraph import BondGraph, C, Se
        >>> graph = BondGraph((1, Se(), C()))
        >>> graph.element(1).kind, graph.element(1, C).kind
        ('Se', 'C')
        """
        _check_kinds(kinds)
        if not is_real(number) or number not in self.bonds:
            raise ArgumentError(f"{self.name}: there is no bond {shown(number)}; bonds are {', '.join(map(str, self.bonds))}")
        bond = self.bonds[number]
        for end in (bond.tail, bond.head):
            if not isinstance(end, Junction | TF | GY) and (not kinds or isinstance(end, kinds)):
                return end
        raise ArgumentError(f"{self.name}: bond {number} joins {self.label(bond.tail)} and {self.label(bond.head)}")

    def of_kind(self, *kinds: type[Element]) -> tuple[int, ...]:
        """Bonds of the one-port elements of these kinds, by number."""
        _check_kinds(kinds)
        found = (bonds[0].number for element, bonds in self._ends.items() if isinstance(element, kinds) and len(bonds) == 1)
        return tuple(sorted(found))

    def label(self, element: Element) -> str:
        """Label of an element in messages: its kind, and its name or its bonds."""
        self._check_element(element)
        if isinstance(element, Junction):
            where = f" '{element.name}'" if element.name else f" of bonds {_numbers(self._ends.get(element, ()))}"
            return f"{element.kind}-junction{where}"
        bonds = self._ends.get(element, ())
        return f"{element.kind} on bond{'s' if len(bonds) > 1 else ''} {_numbers(bonds)}"


def _check_kinds(kinds: tuple[Any, ...]) -> None:
    for kind in kinds:
        if not (isinstance(kind, type) and issubclass(kind, Element)):
            raise ArgumentError(f"kinds are {shown(kinds)}; expected classes of elements, such as R")


def check_graph(graph: Any) -> None:
    """Raise `ArgumentError` for anything but a bond graph."""
    if not isinstance(graph, BondGraph):
        raise ArgumentError(f"graph is {shown(graph)}; expected a BondGraph")


def _of_bond(name: str, bond: Any) -> tuple[int, Element, Element]:
    if not isinstance(bond, tuple) or len(bond) != 3 or not isinstance(bond[0], int) or not is_real(bond[0]):
        raise ArgumentError(f"{name}: {shown(bond)} is not a bond; expected (number, tail, head), such as (1, Se(), One('v'))")
    number, tail, head = bond
    for end in (tail, head):
        if not isinstance(end, Element):
            hint = f"; make one: {end.__name__}(...)" if isinstance(end, type) and issubclass(end, Element) else ""
            raise ArgumentError(f"{name}: bond {number} ends on {shown(end)}, which is not an element{hint}")
    return number, tail, head


def _numbers(bonds: Iterable[Bond]) -> str:
    return ", ".join(str(bond.number) for bond in bonds)


def _check(graph: BondGraph, element: Element, bonds: tuple[Bond, ...]) -> None:
    label = f"{graph.name}: {graph.label(element)}"
    if isinstance(element, Junction):
        if len(bonds) < 2:
            raise ConnectionError(f"{label} has only bond {_numbers(bonds)}: the bond dangles")
        return
    if isinstance(element, TF | GY):
        if len(bonds) != 2:
            raise ConnectionError(f"{label} must have two bonds, but it has {len(bonds)}")
        if bonds[0].sign(element) == bonds[1].sign(element):
            raise ConnectionError(f"{label} must have one half arrow pointing in and one pointing out")
        return
    if len(bonds) != 1:
        raise ConnectionError(f"{label} is a one-port: it must have one bond, but it has {len(bonds)}")
    inward = bonds[0].head is element
    if isinstance(element, Storage | R) and not inward:
        raise ConnectionError(f"{label} takes up power: the half arrow must point to it")
    if isinstance(element, Se | Sf) and inward:
        raise ConnectionError(f"{label} gives power: the half arrow must point away from it")
