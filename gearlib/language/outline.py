"""Outline of a component for its block diagram: parts, ports, connections, and signals between inputs."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import networkx as nx

from gearlib.arguments import flag, real, whole
from gearlib.drawing.block_diagram import OWN, Net, Outline, Pin, Terminal
from gearlib.drawing.diagram import Diagram
from gearlib.drawing.page import paragraph, picture, preformatted
from gearlib.drawing.scheme.stick_diagram import Scheme
from gearlib.drawing.scheme.train import Train, train_of
from gearlib.errors import ArgumentError, GearlibError, ModelError
from gearlib.language import interior
from gearlib.language.declarations import Connector, Discrete, Input, Owner, Potential, Variable, declared_by

DOMAINS = {"rad": "rotation", "m": "translation", "K": "heat"}  # by the unit of a connector's potential
DEEPEST = 200  # nesting depth of components


def drawn(component: Owner, depth: int, fold: bool, width: float) -> Diagram:
    """The diagram of a component, as `Component.diagram` describes it.

    Raises
    ------
    ArgumentError
        An invalid depth or width.
    """
    deep, wide = whole("depth", depth, 1), real("width", width)
    if wide < 200:
        raise ArgumentError(f"width is {wide:g}; expected 200 pixels or more")
    return Diagram(outline(component, deep), fold=flag("fold", fold), width=wide)


def scheme_of(component: Owner) -> Scheme:
    """The stick diagram of a component, as `Component.scheme` describes it."""
    return Scheme(train_in(component))


def train_in(component: Owner) -> Train:
    """All rotating parts of a component, at all depths, for the stick diagram."""
    return train_of(outline(component, DEEPEST))


def html_of(component: Owner) -> str:
    """Notebook representation of a component: its diagram, or the reason why there is none."""
    about = paragraph((type(component).__doc__ or type(component).__name__).strip().partition("\n")[0].replace("`", ""))
    try:
        return about + picture(drawn(component, 1, True, 1400.0).svg)
    except GearlibError as why:
        return about + preformatted(str(why))


@interior.reads_parts
def outline(component: Owner, depth: int) -> Outline:
    """Diagram contents of a component, with nested parts down to a depth; everything is reassembled.

    Raises
    ------
    ModelError
        Infinitely nested components.
    """
    interior.forget(component)
    return _outline(component, interior.name_of(component) or type(component).__name__, depth, 0, ())


def _outline(component: Owner, name: str, depth: int, level: int, more: tuple[Terminal, ...]) -> Outline:
    """Outline of a component, including signal ports and ports of its parts that are connected from outside."""
    if level > DEEPEST:
        raise ModelError(
            f"{component!r}: components within components, {DEEPEST} levels deep; a part of its own class without end?"
        )
    connections = interior.connections_of(component)
    parts: list[Outline] = []
    nets: list[Net] = []
    if depth > 0 and interior.parts_of(component):
        for connection in connections:
            pins = tuple(_pin(component, port) for port in connection.ports)
            if pins:
                nets.append(Net(pins, domain(connection.ports[0].connector)))
        for port in more:  # of a part's part
            inner, _, rest = port.name.partition(".")
            if rest and port.domain != "signal":
                nets.append(Net((Pin(OWN, port.name), Pin(inner, rest)), port.domain))
        joined_signals = [Net(tuple(map(_signal_pin, c.signals)), "signal") for c in connections if c.signals]
        nets = joined(nets) + joined([*joined_signals, *_signals(component)])
        others: dict[str, dict[str, Terminal]] = {part: {} for part in (OWN, *interior.parts_of(component))}
        for net in nets:
            for pin in net.pins:
                others[pin.part].setdefault(pin.port, Terminal(pin.port, net.domain))
        more = (*more, *others.pop(OWN).values())
        parts = [
            _outline(interior.parts_of(component)[part], part, depth - 1, level + 1, tuple(extra.values()))
            for part, extra in others.items()
        ]
    ports = {own: Terminal(own, domain(connector)) for own, connector in declared_by(component).connectors.items()}
    ports |= {port.name: port for port in more if port.name not in ports}
    icon = component.icon if isinstance(component.icon, str) else ""
    return Outline(
        name, type(component).__name__, icon, tuple(ports.values()), tuple(parts), tuple(nets), bool(interior.parts_of(component)),
        _note(component), radii=interior.radii_of(component),
    )  # fmt: skip


def domain(connector: Connector) -> str:
    """Physical domain of a connector, by the unit of its potential."""
    units = [v.unit for v in connector.variables.values() if isinstance(v, Potential)]
    return DOMAINS.get(units[0], "other") if len(units) == 1 else "other"


def _pin(scope: Owner, port: Any) -> Pin:
    """A connected port as a pin; a port of a nested part belongs to the part, with its path from there."""
    if port.component is scope:
        return Pin(OWN, port.connector.name)
    part, _, inner = interior.path_of(port.component, scope).partition(".")
    return Pin(part, f"{inner}.{port.connector.name}" if inner else port.connector.name)


def joined(nets: list[Net]) -> list[Net]:
    """Merge nets that share a pin.

    >>> a, b, c = (Pin("x", name) for name in "abc")
    >>> [len(net.pins) for net in joined([Net((a, b)), Net((b, c))])]
    [3]
    """
    graph = nx.Graph()
    for net in nets:
        graph.add_nodes_from(net.pins, domain=net.domain)
        graph.add_edges_from(pairwise(net.pins))
    place = {pin: i for i, pin in enumerate(graph)}
    sets = [sorted(pins, key=place.__getitem__) for pins in nx.connected_components(graph)]
    return [Net(tuple(pins), graph.nodes[pins[0]]["domain"]) for pins in sorted(sets, key=lambda pins: place[pins[0]])]


def _signals(component: Owner) -> list[Net]:
    """Inputs of parts that are bound to a variable of another part, or to an input of the component itself."""
    targets: dict[Pin, list[Pin]] = {}
    for name, part in interior.parts_of(component).items():
        for own, declared in interior.declarations_of(part).items():
            if isinstance(declared, Input) and own in interior.bindings_of(part):
                for source in _sources(component, interior.bindings_of(part)[own]):
                    if source.part != name:
                        targets.setdefault(source, []).append(Pin(name, own))
    return [Net((source, *ends), "signal") for source, ends in targets.items()]


def _signal_pin(signal: object) -> Pin:
    part, _, variable = str(signal).partition(".")
    return Pin(part, variable) if variable else Pin(OWN, part)


def _sources(component: Owner, value: object) -> Iterator[Pin]:
    symbols = getattr(value, "free_symbols", ())
    for symbol in sorted(str(s) for s in symbols):
        part, _, variable = symbol.partition(".")
        if variable and part in interior.parts_of(component):
            yield Pin(part, variable)
        elif not variable and isinstance(interior.declarations_of(component).get(part), (Input, Variable, Discrete)):
            yield Pin(OWN, part)


def _note(component: Owner) -> str:
    """Tooltip: the class, and the values given to the part."""
    values = [
        f"{name} = {value}"
        for name, value in {**interior.choices_given_to(component), **interior.bindings_of(component)}.items()
    ]
    return "\n".join([type(component).__name__, *(v if len(v) <= 80 else v[:77] + "..." for v in values)])
