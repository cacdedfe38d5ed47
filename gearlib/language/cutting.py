"""`cut`: opens connections of a model, whose potentials and flows become inputs and outputs.

A connection equates potentials and balances flows. Opening it leaves two ends: the part's own connector, and the rest of what was
connected there. At each end one of the two quantities is prescribed, as an input of the model, and the other is its response.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, get_args

import sympy

from gearlib.arguments import shown
from gearlib.errors import ArgumentError, NameLookupError, nearest
from gearlib.language.component import (
    Component,
    Port,
    changed,
    connect,
    enclosing,
    equations_of,
    insert_part,
    name_of,
    reconnect,
    with_parts,
)
from gearlib.language.declarations import Connector, Derivative, Flow, Input, Potential, Variable, declared_by
from gearlib.language.energy import Energy
from gearlib.language.expressions import Eq, der
from gearlib.language.interior import connections_of, declarations_of, parts_of, reads_parts

Given = Literal["flow", "rate", "potential", "free", "held"]


@dataclass(frozen=True)
class Cut:
    """A connector to be cut, with the quantities prescribed to it and to the rest; None: chosen automatically."""

    part: str
    connector: str
    given: str | None = None
    rest: str | None = None


@reads_parts
def cut(
    component: Component, *places: str, given: Given | Mapping[str, Given] | None = None,
    rest: Given | Mapping[str, Given] | None = None,
) -> Component:  # fmt: skip
    """Open connections of a model; their potentials and flows become inputs and outputs.

    Where ``"train.x_unit.sun"`` is cut, the component ``train`` has two additional parts: ``train.x_unit_sun`` at the named connector,
    and ``train.x_unit_sun_rest`` at everything that was connected to it. Both have a ``flow`` (into what they are connected to: a
    torque, N.m), a ``potential`` (an angle) and its ``rate`` (a speed). Nothing is removed: a model compiled for outputs on one side
    leaves out the other side.

    Parameters
    ----------
    component : Component
        Left unchanged.
    *places : str
        Paths of connectors; the path of a part stands for all its connected connectors.
    given, rest : {"flow", "rate", "potential", "free", "held"} or mapping of path to one of these, optional
        Quantity prescribed at the named connector, and at the rest. The first three are unbound inputs of the model, 0 unless given;
        ``"free"`` means zero flow, ``"held"`` a rate of 0. By default the flow is prescribed to the connector, and the rest is free;
        where nothing responds to a flow, since everything connected there prescribes one (a torque source), the rate is, and the rest
        is held. A body takes flows, a spring between two cuts takes rates: otherwise the input would have to be differentiated, which
        is refused.

    Returns
    -------
    Component
        A model to be compiled.

    Raises
    ------
    ArgumentError, NameLookupError
        Unknown part or connector; a connector that is not connected, or has more than one potential and flow.

    Examples
    --------
    The load on its own:

    >>> import gearlib as gl, gearparts as gp
    >>> class Drive(gl.Component):
    ...     def assemble(self):
    ...         self.motor, self.shaft, self.load = gp.Inertia(J=1.0), gp.Spring(c=8.0), gp.Inertia(J=2.0)
    ...         motor_side = gl.connect(self.motor.flange_b, self.shaft.flange_a)
    ...         return [motor_side, gl.connect(self.shaft.flange_b, self.load.flange_a)]
    >>> system = gl.compile(gl.cut(Drive(), "load"), outputs=["load.w"])
    >>> system.states
    ('load.w',)
    >>> system.linearize(["load_flange_a.flow"], ["load.w"]).B.tolist()
    [[0.5]]
    """
    if not isinstance(component, Component):
        raise ArgumentError(f"cut: expected a component, got {shown(component)}")
    if not places:
        raise ArgumentError("cut: no place is given; name connectors or parts, such as 'train.x_unit.sun'")
    chosen: dict[tuple[str, str], Cut] = {}
    named: set[str] = set()
    for place in places:
        for part, connector in _connectors_at(component, place):
            path = f"{part}.{connector}"
            ends = _choice("given", given, path, place), _choice("rest", rest, path, place)
            chosen[part, connector] = Cut(part, connector, *ends)
            named |= {place, path}
    for what, choice in (("given", given), ("rest", rest)):
        for path in choice if isinstance(choice, Mapping) else ():
            if path not in named:
                raise NameLookupError(f"cut: {what} names {shown(path)}, which is not cut; {nearest(str(path), sorted(named))}")
    return changed(component, partial(open_connections, cuts=tuple(chosen.values())))


def open_connections(whole: Component, cuts: tuple[Cut, ...]) -> None:
    """Perform cuts in an assembled component, by inserting end parts."""
    opened = [(place, getattr(part_at(whole, place.part), place.connector)) for place in cuts]
    ports = [port for _, port in opened]
    joined = [_joined_to(port) for port in ports]
    for (place, port), others in zip(opened, joined, strict=True):
        if not others:
            raise ArgumentError(f"cut: {place.part}.{place.connector} is connected to nothing, so that there is nothing to cut")
        for composite in enclosing(port.component):
            kept = [c for c in connections_of(composite) if port not in c.ports]  # an end joins the others again
            reconnect(composite, kept)
    for (place, port), others in zip(opened, joined, strict=True):
        parent = next(enclosing(port.component))
        name = f"{name_of(port.component)}_{place.connector}".replace("[", "_").replace("]", "")
        left = [other for other in others if other not in ports]
        for end, side, given, fitting in (
            (name, [port], place.given, ("rate", "flow")), (f"{name}_rest", left, place.rest, ("held", "free")),
        ):  # fmt: skip
            if side:
                if end in {*vars(parent), *declarations_of(parent)}:
                    raise ArgumentError(
                        f"cut: {type(parent).__name__} has '{end}' already, as the end at {place.part}.{place.connector} would be called; "
                        "has it been cut before?"
                    )
                insert_part(parent, end, end_of(type(port.connector), given or fitting[_answers_to_flows(whole, side)])())
                reconnect(parent, [*connections_of(parent), connect(getattr(parent, end).port, *side)])


def _joined_to(port: Port) -> list[Port]:
    """Ports connected to a port outside its part."""
    links = (c.ports for composite in enclosing(port.component) for c in connections_of(composite) if port in c.ports)
    return list(dict.fromkeys(other for link in links for other in link if other != port))


def _answers_to_flows(whole: Component, side: list[Port]) -> bool:
    """Whether anything connected there has an equation for the potential; a torque source has none."""
    links = [c.ports for part in (p for _, p in with_parts(whole)) for c in connections_of(part)]
    seen, stack = list(side), list(side)
    while stack:
        port = stack.pop()
        potentials = {f"{port.connector.name}.{n}" for n, v in port.connector.variables.items() if isinstance(v, Potential)}
        if potentials & _names(port.component):
            return True
        following = [other for link in links if port in link for other in link if other not in seen]
        seen += following
        stack += following
    return False


def _names(component: Component) -> set[str]:
    """Names in the equations of a component."""
    sides = [side for e in equations_of(component) if isinstance(e, Eq) for side in (e.left, e.right)]
    return {symbol.name for side in sides for symbol in sympy.sympify(side).free_symbols}


def part_at(component: Component, path: str) -> Component:
    """The part of an assembled component with a path."""
    node = component
    for k, name in enumerate(path.split(".") if path else []):
        connections_of(node)
        if name not in parts_of(node):
            where = ".".join(path.split(".")[:k])
            raise NameLookupError(
                f"cut: {where or type(component).__name__} has no part '{name}'; {nearest(name, parts_of(node))}"
            )
        node = parts_of(node)[name]
    return node


def _connectors_at(whole: Component, place: Any) -> list[tuple[str, str]]:
    """The connectors that a place stands for: (path of the part, name of the connector)."""
    if not isinstance(place, str):
        raise ArgumentError(f"cut: got {shown(place)}; expected paths of connectors or parts, such as 'train.x_unit.sun'")
    head, _, last = place.rpartition(".")
    before, _, between = head.rpartition(".")
    if head and between in declared_by(part_at(whole, before)).connectors:
        raise NameLookupError(f"cut: {place} is a variable; name the connector: {head}")
    owner = part_at(whole, head)
    connections_of(owner)
    if last in declared_by(owner).connectors:
        if not head:
            raise ArgumentError(f"cut: {place} is a connector of the whole model, connected to nothing outside")
        return [(head, last)]
    if last not in parts_of(owner):
        valid = [*parts_of(owner), *(declared_by(owner).connectors if head else ())]
        raise NameLookupError(f"cut: {head or type(whole).__name__} has no part or connector '{last}'; {nearest(last, valid)}")
    part = part_at(whole, place)
    found = [c for c in declared_by(part).connectors if _joined_to(getattr(part, c))]
    if not found:
        raise ArgumentError(f"cut: {place} has no connector that is connected, so that there is nothing to cut")
    return [(place, connector) for connector in found]


def _choice(what: str, choice: Any, path: str, place: str) -> str | None:
    """The quantity prescribed at a place: the choice for all places, or for the connector or its part."""
    value = choice.get(path, choice.get(place)) if isinstance(choice, Mapping) else choice
    if value is None or (isinstance(value, str) and value in get_args(Given)):
        return value
    raise ArgumentError(f"cut: {what} is {shown(value)} at {path}; expected {', '.join(get_args(Given))}")


def end_of(connector: type[Connector], given: str) -> type[Component]:
    """The class of an end of a cut: one quantity is an input, the other is the response of the connected part."""
    if given not in connector.ends:
        connector.ends[given] = _new_end(connector, given)
    found: type[Component] = connector.ends[given]
    return found


def _new_end(connector: type[Connector], given: str) -> type[Component]:
    potentials = [n for n, v in connector.variables.items() if isinstance(v, Potential)]
    flows = [n for n, v in connector.variables.items() if isinstance(v, Flow)]
    if len(potentials) != 1 or len(flows) != 1:
        raise ArgumentError(
            f"cut: a {connector.__name__} has {len(potentials)} potentials and {len(flows)} flows; expected one of each"
        )
    unit, flow_unit = connector.variables[potentials[0]].unit, connector.variables[flows[0]].unit

    def equations(self: Any) -> list[Eq]:
        own = [Eq(getattr(self.port, potentials[0]), self.potential), Eq(getattr(self.port, flows[0]), -self.flow)]
        return [*own, Eq(der(self.potential), self.rate)] if given in ("rate", "held") else own

    def energies(self: Any) -> Energy:
        return Energy(source=True)

    declared: dict[str, Any] = {
        "__doc__": f"End of a cut {connector.__name__}: {given}.",
        "__module__": __name__,
        "port": connector("what was cut"),
        "flow": Variable(flow_unit, "flow into what is connected"),
        "potential": Variable(unit, "potential"),
        "rate": Derivative("potential", f"{unit}/s", "rate of the potential"),
        "equations": equations,
        "energies": energies,
    }
    bound = 0.0 if given in ("free", "held") else None  # a constant can be differentiated
    if given in ("rate", "held"):
        declared["rate"] = Input(f"{unit}/s", "rate of the potential, from outside", default=bound)
    elif given in ("flow", "free"):
        declared["flow"] = Input(flow_unit, "flow into what is connected, from outside", default=bound)
    else:
        declared["potential"] = Input(unit, "potential, from outside")
    return type(f"{connector.__name__}End", (Component,), declared)
