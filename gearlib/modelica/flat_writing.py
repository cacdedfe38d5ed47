"""A whole model as a single Modelica class without parts: every variable and equation, with connections expanded."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import networkx as nx

from gearlib.equations.modelica_printer import modelica_text
from gearlib.errors import ModelicaError
from gearlib.flatten.signals import joined_signals
from gearlib.language.component import Component, equations_of, evaluated_in, given_to
from gearlib.language.declarations import NO_VALUE, Flow, Input, Variable, declared_by
from gearlib.language.delayed import Delayed
from gearlib.language.dimensions import is_in
from gearlib.language.expressions import time, value_of
from gearlib.language.interior import connections_of, parts_of
from gearlib.language.sampled import Sampled
from gearlib.language.tabulated import Tabulated
from gearlib.modelica.class_writing import (
    attributes_text,
    comment,
    equation_lines,
    free_name,
    integer_discretes,
    safe_name,
    variable_attributes,
)

_NO_LETTER = re.compile(r"\W+")


def _members(component: Component, prefix: str) -> Iterator[tuple[str, Component]]:
    """A component and all nested parts, with the prefixes of their variables."""
    connections_of(component)  # assembles the component
    yield prefix, component
    for name, part in parts_of(component).items():
        yield from _members(part, f"{prefix}{name}.")


class FlatText:
    """Variables of a model under flat names, and its equations."""

    def __init__(self, root: Component) -> None:
        self.root = root
        self.members = dict(_members(root, ""))
        self.prefix = {id(part): prefix for prefix, part in self.members.items()}
        self.names: dict[str, str] = {}
        self.taken: set[str] = set()
        for prefix, part in self.members.items():
            if isinstance(part, Sampled):
                raise ModelicaError(f"{prefix[:-1]} calls a Python function, which cannot be written in Modelica")
            if isinstance(part, Delayed):
                raise ModelicaError(
                    f"{prefix[:-1]} delays a signal: that is written with standard_library=True only, and not flat"
                )
            declared = declared_by(part)
            for name in (*declared.parameters, *declared.variables, *declared.discretes):
                self._name(prefix + name)

    def _name(self, path: str) -> None:
        """A unique name of letters, digits and underscores."""
        wanted = safe_name(_NO_LETTER.sub("_", re.sub(r"\[(\d+)\]", lambda m: f"_{int(m[1]) + 1}", path)))
        self.names[path] = free_name(wanted, self.taken.__contains__)
        self.taken.add(self.names[path])

    def text(self, value: Any, prefix: str) -> str:
        """A value written in the scope of a part."""
        if isinstance(value, Tabulated):
            value = value.expression(time, True)
        return modelica_text(value_of(value), lambda name: self._named(prefix, name))

    def _named(self, prefix: str, name: str) -> str:
        if prefix + name in self.names:
            return self.names[prefix + name]
        owner, dot, last = (prefix + name).rpartition(".")
        derived = declared_by(self.members[f"{owner}." if dot else ""]).derivatives.get(last)
        if derived is None:
            raise ModelicaError(f"nothing is called '{prefix}{name}'")
        of = derived[4:-1]
        return f"der({self._named(f'{owner}.' if dot else '', of)})"

    def lines(self) -> Iterator[str]:
        """The declarations and equations."""
        bound = dict(self._signals())
        starts = self._attributes()
        stated: list[str] = []
        for prefix, part in self.members.items():
            declared, given = declared_by(part), given_to(part)
            above = self._above(prefix)
            for name, p in declared.parameters.items():
                value, scope = (given.values[name], above) if name in given.values else (evaluated_in(part, p.default), prefix)
                text = "" if value is NO_VALUE or value is None else f" = {self.text(value, scope)}"
                bounds = {b: repr(v) for b, v in (("min", p.min), ("max", p.max)) if math.isfinite(v)}
                yield f"parameter Real {self.names[prefix + name]}{attributes_text(bounds, p.unit)}{text}{comment(p.description)};"
            integers = integer_discretes(equations_of(part), declared.discretes)
            for name, d in declared.discretes.items():
                start = starts.get(prefix + name, {}).get("start", repr(d.start))
                kind = "Integer" if name in integers else "discrete Real"
                start = str(int(float(start))) if name in integers else start
                yield f"{kind} {self.names[prefix + name]}(start = {start}, fixed = true){comment(d.description)};"
            for name, v in declared.variables.items():
                yield self._variable(prefix, name, v, part, starts.get(prefix + name, {}), bound)
            for equation in equations_of(part):
                stated += equation_lines(equation, lambda n, prefix=prefix: self._named(prefix, n))
        yield "equation"
        yield from stated
        yield from self._connections()

    def _variable(
        self, prefix: str, name: str, v: Variable, part: Component, own: dict[str, str], bound: dict[str, str]
    ) -> str:
        start = repr(float(v.start if v.start is not None else v.guess)) if v.start is not None or v.guess else None
        attributes = variable_attributes(v, start, v.start is not None, v.nominal, v.state) | own
        kind, value = "", bound.get(prefix + name)
        if isinstance(v, Input) and value is None:
            given = given_to(part).values.get(name)
            if given is not None:
                above = self._above(prefix)
                value = self.text(given, above)
                number = not isinstance(given, Tabulated) and is_in(self.members[above], given, "1")
                if number and not is_in(self.members[above], given, v.unit):
                    value = f"1.0*({value})"  # a pure number is in the declared unit: an equation has to say so
            elif v.default is not NO_VALUE and v.default is not None:
                value = self.text(evaluated_in(part, v.default), prefix)
            else:
                kind = "input "
        text = "" if value is None else f" = {value}"
        return f"{kind}Real {self.names[prefix + name]}{attributes_text(attributes, v.unit)}{text}{comment(v.description)};"

    def _above(self, prefix: str) -> str:
        """Prefix of the component that encloses a part."""
        return prefix[:-1].rpartition(".")[0] + "." if "." in prefix[:-1] else ""

    def _signals(self) -> Iterator[tuple[str, str]]:
        for prefix, part in self.members.items():
            for target, local, source in joined_signals(part, prefix[:-1]):
                yield self.prefix[id(target)] + local, self._named(prefix, str(source))

    def _attributes(self) -> dict[str, dict[str, str]]:
        """Start values and other attributes given to parts; outer ones take precedence."""
        found: dict[str, dict[str, str]] = {}
        for prefix, part in reversed(list(self.members.items())):
            given, above = given_to(part), self._above(prefix)
            for values, fixed in ((given.guess, False), (given.start, True)):
                for path, value in values.items():
                    own = {"start": self.text(value, above), **({"fixed": "true"} if fixed else {})}
                    found.setdefault(prefix + path, {}).update(own)
            for path, nominal in given.nominal.items():
                found.setdefault(prefix + path, {})["nominal"] = repr(float(nominal))
            for path, state in given.state.items():
                found.setdefault(prefix + path, {})["stateSelect"] = f"StateSelect.{state}"
        return found

    def _connections(self) -> Iterator[str]:
        """Connection equations: equal potentials, and flows that sum to zero, with opposite sign for a connector seen from inside."""
        graph: Any = nx.Graph()
        kinds: dict[tuple[str, bool], Any] = {}
        for prefix, part in self.members.items():
            for name, connector in declared_by(part).connectors.items():
                kinds[f"{prefix}{name}", False] = connector
                graph.add_node((f"{prefix}{name}", False))
            for connection in connections_of(part):
                ends = [(f"{self.prefix[id(p.component)]}{p.connector.name}", p.component is part) for p in connection.ports]
                kinds.update((end, port.connector) for end, port in zip(ends, connection.ports, strict=True))
                graph.add_edges_from((ends[0], other) for other in ends[1:])
        for together in nx.connected_components(graph):
            ends = sorted(together)
            for name, variable in kinds[ends[0]].variables.items():
                full = [(self.names[f"{path}.{name}"], inside) for path, inside in ends]
                if isinstance(variable, Flow):
                    terms = "".join(f" {'-' if inside else '+'} {flow}" for flow, inside in full)
                    yield f"{terms.removeprefix(' + ').removeprefix(' ')} = 0;"
                else:
                    yield from (f"{other} = {full[0][0]};" for other, _ in full[1:])
