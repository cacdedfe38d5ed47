"""Signal connections in composites: which input, or output of a composite, is bound to which signal."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import networkx as nx

from gearlib.equations.class_record import descend
from gearlib.errors import ConnectionError, nearest
from gearlib.language.component import Component, signals_of
from gearlib.language.declarations import Input, declared_by


def joined_signals(component: Component, path: str) -> Iterator[tuple[Component, str, Any]]:
    """The bindings made by a composite's signal connections: component, name of its input or output, and the signal bound to it.

    Connections that share a signal are merged. The source is a variable of a part, or an input of the composite itself; without one,
    the first input named serves as the source.

    Raises
    ------
    ConnectionError
        Not a signal, or several sources.
    """
    graph = nx.Graph()
    for signals in signals_of(component):
        graph.add_edges_from(pairwise(signals))
    place = {signal: k for k, signal in enumerate(graph)}
    owner = path or type(component).__name__
    for joined in nx.connected_components(graph):
        members = sorted(joined, key=place.__getitem__)
        drives = {signal: _drives(component, owner, signal.name) for signal in members}
        sources = [signal for signal in members if drives[signal]]
        if len(sources) > 1:
            names = ", ".join(map(str, sources))
            raise ConnectionError(
                f"{owner}: connect() joins the signals {names}, each of which has a value of its own; only one can be the source, the "
                "others are inputs of parts, such as torque.tau, or the component's own outputs"
            )
        source = sources[0] if sources else next((s for s in members if _is_input(component, s.name)), None)
        if source is None:
            raise ConnectionError(f"{owner}: nothing gives {members[0]} a value; connect it to a variable of a part")
        for target in members:
            if target is not source:
                part, local = descend(component, target.name)
                yield part, local, source


def _drives(component: Component, owner: str, name: str) -> bool:
    """Whether a signal is a source, as seen from inside a composite."""
    part, local = descend(component, name)
    known = declared_by(part)
    inside = part is component
    if local in known.variables:
        return isinstance(known.variables[local], Input) == inside
    if local in known.discretes:
        return True
    if local in known.parameters:
        raise ConnectionError(
            f"{owner}: connect() is given the parameter {name}; a parameter is not a signal, bind the input where its part is made"
        )
    if name == "time" or name.startswith(("der(", "pre(")):
        raise ConnectionError(f"{owner}: connect() is given {name}; bind the input to it where its part is made")
    raise ConnectionError(f"{owner}: connect() is given {name}, which is not a signal here; {nearest(local, known.variables)}")


def _is_input(component: Component, name: str) -> bool:
    part, local = descend(component, name)
    return isinstance(declared_by(part).variables[local], Input)
