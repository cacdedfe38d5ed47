"""Contents of a block diagram as plain data: nested parts, their ports, and the nets that connect these."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import networkx as nx

MEMBER = re.compile(r"(.*)\[(\d+)\]$")
OWN = ""  # in a pin, the component itself: a border port


@dataclass(frozen=True)
class Terminal:
    """A connector, or the end of a signal.

    Parameters
    ----------
    name : str
    domain : {"rotation", "translation", "heat", "signal", "other"}
        Physical domain.
    """

    name: str
    domain: str = "rotation"


@dataclass(frozen=True, order=True)
class Pin:
    """A port of a part, by name; `OWN` is the component itself."""

    part: str
    port: str


@dataclass(frozen=True)
class Net:
    """Connected ports; for a signal, the first is its source. ``count`` identical nets are drawn as one."""

    pins: tuple[Pin, ...]
    domain: str = "rotation"
    count: int = 1


@dataclass(frozen=True)
class Outline:
    """A component as drawn.

    Parameters
    ----------
    name, kind : str
        Name of the part, and of its class.
    icon : str
        Name of its icon; empty: a labelled box.
    ports : tuple of Terminal
    parts : tuple of Outline
        Its parts, down to the displayed depth.
    nets : tuple of Net
        Connections between ports of its parts, and of its own.
    composite : bool
        Whether it has parts, displayed or not.
    note : str
        Tooltip.
    count : int
        Number of family members that it stands for.
    members : tuple of str
        Names of these members, if more than one.
    radii : tuple of float
        Radii of its gears (m), or one ratio; NaN if unknown.
    """

    name: str
    kind: str
    icon: str = ""
    ports: tuple[Terminal, ...] = ()
    parts: tuple[Outline, ...] = ()
    nets: tuple[Net, ...] = ()
    composite: bool = False
    note: str = ""
    count: int = 1
    members: tuple[str, ...] = ()
    radii: tuple[float, ...] = ()


def folded(outline: Outline) -> Outline:
    """The outline with each family of identical parts drawn once.

    Parts ``planet[0]``, ``planet[1]``, ... of one class with the same ports and the same inside become one ``planet`` with their count,
    and nets that differ only in the members become one. Where members are connected to each other, as in a chain, the first and the
    last of each family remain, with one box for all between.

    >>> wheels = tuple(Outline(f"wheel[{i}]", "Wheel", ports=(Terminal("a"),)) for i in range(3))
    >>> nets = (Net((Pin("", "in"), *(Pin(w.name, "a") for w in wheels))),)
    >>> found = folded(Outline("car", "Car", ports=(Terminal("in"),), parts=wheels, nets=nets))
    >>> [(part.name, part.count) for part in found.parts], [pin.part for pin in found.nets[0].pins]
    ([('wheel', 3)], ['', 'wheel'])
    """
    families: dict[str, list[Outline]] = {}
    for part in outline.parts:
        if found := MEMBER.match(part.name):
            families.setdefault(found[1], []).append(part)
    merged = {name: members for name, members in families.items() if len(members) > 1 and len(set(map(_shape, members))) == 1}
    chains: list[list[Outline]] = []
    while linked := _linked(merged, outline.nets):
        chains += [merged[name] for name in linked if len(merged[name]) > 3]
        merged = {name: members for name, members in merged.items() if name not in linked}
    name_of = {m.name: name for name, members in merged.items() for m in members}
    stands_for: dict[str, Outline] = {
        name: replace(
            folded(members[0]), name=name, count=len(members), members=tuple(m.name for m in members), note=_listed(members)
        )
        for name, members in merged.items()
    }  # fmt: skip
    parts, pins_of = _middles(chains, outline.nets)
    for part in parts:
        name_of |= dict.fromkeys(part.members, part.name)
        stands_for[part.name] = part
    nets = _merged(outline.nets, name_of, pins_of)
    shown = dict.fromkeys(name_of.get(part.name, part.name) for part in outline.parts)
    own = {part.name: part for part in outline.parts}
    return replace(
        outline, parts=tuple(stands_for[name] if name in stands_for else folded(own[name]) for name in shown), nets=nets
    )


def _shape(outline: Outline) -> tuple[object, ...]:
    """What members of a family have in common."""
    inside = tuple((part.name, _shape(part)) for part in outline.parts)
    return outline.kind, outline.ports, outline.composite, outline.nets, inside


def _listed(members: list[Outline]) -> str:
    return f"{members[0].name} ... {members[-1].name}\n{members[0].note}"


def _merged(nets: tuple[Net, ...], name_of: Mapping[str, str], pins_of: Mapping[Pin, Pin]) -> tuple[Net, ...]:
    """Merge nets under the names of drawn parts; nets inside a merged part are dropped."""
    found: Counter[tuple[tuple[Pin, ...], str]] = Counter()
    for net in nets:
        pins = tuple(dict.fromkeys(pins_of.get(pin, Pin(name_of.get(pin.part, pin.part), pin.port)) for pin in net.pins))
        if pins != (INSIDE,):
            found[tuple(pin for pin in pins if pin != INSIDE), net.domain] += net.count
    return tuple(Net(pins, domain, count) for (pins, domain), count in found.items())


def _linked(merged: Mapping[str, list[Outline]], nets: tuple[Net, ...]) -> list[str]:
    """Families with a port that would belong to several nets: their members are not all connected alike."""
    name_of = {m.name: name for name, members in merged.items() for m in members}
    uses: dict[Pin, set[frozenset[Pin]]] = {}
    for net in nets:
        pins = frozenset(Pin(name_of.get(pin.part, pin.part), pin.port) for pin in net.pins)
        for pin in pins:
            if pin.part in merged:
                uses.setdefault(pin, set()).add(pins)
    several = {pin.part for pin, found in uses.items() if len(found) > 1}
    return [name for name in merged if name in several]


INSIDE = Pin("...", "...")


def _middles(chains: list[list[Outline]], nets: tuple[Net, ...]) -> tuple[list[Outline], dict[Pin, Pin]]:
    """One part for all members of linked chains except the first and last, and the mapping of their pins."""
    family_of = {m.name: i for i, chain in enumerate(chains) for m in chain}
    graph = nx.Graph()
    graph.add_nodes_from(range(len(chains)))
    for net in nets:
        graph.add_edges_from(pairwise([family_of[pin.part] for pin in net.pins if pin.part in family_of]))
    parts: list[Outline] = []
    pins_of: dict[Pin, Pin] = {}
    for number, group in enumerate(sorted(sorted(g) for g in nx.connected_components(graph))):
        middle = {m.name for i in group for m in chains[i][1:-1]}
        name = "..." if number == 0 else f"... ({number + 1})"
        ports: list[Terminal] = []
        for net in nets:
            here = [pin for pin in net.pins if pin.part in middle]
            if here and len(here) < len(net.pins):
                ports.append(Terminal(f"{here[0].part}.{here[0].port}", net.domain))
                pins_of |= dict.fromkeys(here, Pin(name, ports[-1].name))
            else:
                pins_of |= dict.fromkeys(here, INSIDE)
        members = tuple(m.name for i in group for m in chains[i][1:-1])
        kind = ", ".join(f"{len(chains[i]) - 2} × {MEMBER.match(chains[i][0].name)[1]}" for i in group)  # type: ignore[index]
        parts.append(
            Outline(name, kind, "chain", tuple(ports), note=f"{kind}\n{members[0]} ... {members[-1]}", members=members)
        )
    return parts, pins_of
