"""Terminals of an FMU (FMI 3.0): which of its inputs and outputs belong to one flange, so that a tool connects shafts and not signals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from gearlib.equations.kernel import partial_kernel, residual_kernel
from gearlib.flatten.model import FlatModel
from gearlib.fmi.exported_model import ExportedModel
from gearlib.fmi.fmu_variables import FmuVariables, differentiated_unit
from gearlib.language.declarations import Flow, Potential

MOTIONS = {"phi": ("phi", "w", "a"), "s": ("s", "v", "a")}  # a potential and its derivatives, as Modelica calls them


@dataclass(frozen=True)
class TerminalMember:
    """A variable of a terminal.

    Attributes
    ----------
    variable : str
        Of the FMU.
    name : str
        What it is at the terminal: ``"phi"``, ``"w"``, ``"tau"``.
    kind : str
        ``"signal"``; ``"inflow"`` or ``"outflow"``, where it is a flow that counts positive into the FMU or out of it.
    """

    variable: str
    name: str
    kind: str


@dataclass(frozen=True)
class FlangeTerminal:
    """A flange at which an FMU is driven: path of the connector, its inputs, and its outputs."""

    name: str
    description: str
    members: tuple[TerminalMember, ...]


def terminals(exported: ExportedModel, variables: FmuVariables) -> tuple[FlangeTerminal, ...]:
    """Flanges of parts that an input of the FMU drives, each with one input or output for each member.

    A flange is one where a flow and a motion (or a temperature) are among the inputs and outputs; those that only one of both is
    known of are no terminals.
    """
    model = exported.model
    public = {v.name: v.causality for v in variables.listed if v.causality in ("input", "output")}
    driven = {name.rpartition(".")[0] for name, causality in public.items() if causality == "input"}
    found = []
    for instance in model.instances:
        if instance.path not in driven:
            continue
        groups: dict[str, dict[str, Potential | Flow]] = {}
        for name, declared in instance.declared.variables.items():
            connector, _, member = name.rpartition(".")
            if connector and isinstance(declared, (Potential, Flow)):
                groups.setdefault(connector, {})[member] = declared
        for connector, members in groups.items():
            path = f"{instance.path}.{connector}" if instance.path else connector
            each: dict[str, TerminalMember] = {}
            for m in _members(exported, public, instance.path, path, members):
                each.setdefault(m.name, m)  # a tool joins members by name; inputs come before their aliases among the outputs
            known = tuple(each.values())
            if {"signal"} < {m.kind for m in known}:
                found.append(FlangeTerminal(path, f"{instance.path or exported.translation.name}: a flange", known))
    return tuple(found)


def _members(
    exported: ExportedModel, public: dict[str, str], owner: str, connector: str, declared: dict[str, Potential | Flow]
) -> Iterator[TerminalMember]:
    """Inputs and outputs that are a connector's variables or derivatives of its potential; an input is recognised by its unit."""
    model = exported.model
    speeds = _speeds(model)
    for member, variable in declared.items():
        at, sign = _place(model, f"{connector}.{member}")
        if isinstance(variable, Flow):
            for name in public:
                place, own = _place(model, name)
                if place == at >= 0 and own:
                    yield TerminalMember(
                        name, member, "outflow" if sign * own > 0 else "inflow"
                    )  # into the part is out of the rest
            continue
        orders = [{(at, sign)}]
        for _ in range(2):
            orders.append({(w, way * turned) for v, way in orders[-1] for w, turned in speeds.get(v, ())})
        names = MOTIONS.get(member, (member, f"der({member})", f"der(der({member}))"))
        units = [differentiated_unit(variable.unit, k) for k in range(len(names))]
        for name, causality in public.items():
            place, own = _place(model, name)
            if causality == "input":
                of = model.declaration(model.variable(name))
                if name.rpartition(".")[0] == owner and of is not None and of.unit in units:
                    yield TerminalMember(name, names[units.index(of.unit)], "signal")
            elif order := [k for k, same in enumerate(orders) if (place, own) in same]:
                yield TerminalMember(name, names[order[0]], "signal")


def _place(model: FlatModel, name: str) -> tuple[int, int]:
    """Index of the representative of a variable, and its sign; -1 if there is none."""
    k = model.find(name)
    return (-1, 0) if k is None else (int(model.representative[k]), int(model.sign[k]))


def _speeds(model: FlatModel) -> dict[int, set[tuple[int, int]]]:
    """Variables that an equation says to be the derivative of another one, up to their sign: ``der(phi) = w``."""
    found: dict[int, set[tuple[int, int]]] = {}
    for group in model.groups:
        t = group.template
        if sorted(order for _, order in t.columns) != [0, 1] or t.parameters or t.discretes or t.relations or t.on_time:
            continue
        (first, _), (second, _) = t.local_columns
        one, other = (partial_kernel(t, c).number for c in range(2))
        if one is None or other is None or abs(one) != abs(other) or residual_kernel(t, frozenset({0, 1})).number != 0:
            continue
        differentiated = 0 if t.columns[0][1] else 1
        for row, signs in zip(group.variables.tolist(), group.signs.tolist(), strict=True):
            places, factors = (row[first], row[second]), (signs[first], signs[second])
            if all(factors):
                turned = 1 if one * factors[0] + other * factors[1] == 0 else -1
                found.setdefault(places[differentiated], set()).add((places[1 - differentiated], turned))
    return found


def terminals_text(found: tuple[FlangeTerminal, ...]) -> bytes:
    """``terminalsAndIcons.xml``."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    listed = SubElement(root, "Terminals")
    for terminal in found:
        element = SubElement(listed, "Terminal", name=terminal.name, matchingRule="plug", description=terminal.description)
        for m in terminal.members:
            SubElement(element, "TerminalMemberVariable", variableName=m.variable, memberName=m.name, variableKind=m.kind)
    indent(root)
    return bytes(tostring(root, encoding="UTF-8", xml_declaration=True))
