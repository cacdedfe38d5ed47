"""Component classes as Modelica classes: declarations, modified parts, equations, connections."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gearlib.equations.modelica_printer import condition_text, modelica_name, modelica_text
from gearlib.errors import ModelicaError
from gearlib.flatten.signals import joined_signals
from gearlib.language.component import Component, Port, equations_of, evaluated_in, given_to
from gearlib.language.declarations import NO_VALUE, Connector, Discrete, Flow, Input, Parameter, Variable, declared_by
from gearlib.language.delayed import Delayed
from gearlib.language.expressions import Eq, Reinit, When, pre, time, value_of
from gearlib.language.interior import connections_of, parts_of
from gearlib.language.sampled import Sampled
from gearlib.language.tabulated import Tabulated
from gearlib.modelica.counterparts import Counterpart, home_of, standard_library
from gearlib.modelica.lexer import KEYWORDS

_ELEMENT = re.compile(r"(.*)\[(\d+)\]$")
_CALLED = {  # functions in written texts, which a variable of that name would hide
    "pre", "sample", "reinit", "noEvent", "initial", "sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2",
    "sinh", "cosh", "tanh",
}  # fmt: skip
_TAKEN = KEYWORDS | {"Real", "Integer", "Boolean", "String", "time", "StateSelect"} | _CALLED


@dataclass
class Change:
    """A modification to be written: a value, and nested modifications."""

    value: str | None = None
    inner: dict[str, Change] = field(default_factory=dict)

    def within(self, path: Sequence[str]) -> Change:
        """The nested modification at a path."""
        return self if not path else self.inner.setdefault(path[0], Change()).within(path[1:])

    def text(self, name: str, each: bool = False) -> str:
        """Modelica text, such as ``w(start = 1, fixed = true)``."""
        inner = f"({', '.join(c.text(n, each) for n, c in self.inner.items())})" if self.inner else ""
        return f"{'each ' if each and not inner else ''}{name}{inner}{f' = {self.value}' if self.value is not None else ''}"


@dataclass(frozen=True)
class Lifted:
    """An unbound input of a part, which becomes an input of the class: its name, unit and description."""

    name: str
    unit: str
    description: str


@dataclass
class PackageText:
    """The classes written so far, each once."""

    standard_library: bool
    texts: dict[str, str] = field(default_factory=dict)  # by name, in dependency order
    lifted: dict[str, tuple[Lifted, ...]] = field(default_factory=dict)
    named: dict[int, str] = field(default_factory=dict)  # by the component that was written
    seen: dict[int, ClassText] = field(default_factory=dict)

    def class_text(self, component: Component) -> ClassText:
        """Writer for the class of a component."""
        if id(component) not in self.seen:
            self.seen[id(component)] = ClassText(self, component)
        return self.seen[id(component)]

    def class_name(self, component: Component, is_root: bool = False) -> str:
        """Class name of a component; writes the class if that has not been done."""
        if id(component) not in self.named:
            self.named[id(component)] = self._written(component, is_root)
        return self.named[id(component)]

    def _written(self, component: Component, is_root: bool) -> str:
        wanted = safe_name(type(component).__name__)
        body, lifted = self.class_text(component).body(is_root)
        name = self._kept(wanted, lambda name: _class_text("model", name, type(component), body))
        self.lifted[name] = lifted
        return name

    def _kept(self, wanted: str, text: Callable[[str], str]) -> str:
        """Name under which a text is kept; two classes of one name that differ are numbered."""
        name = free_name(wanted, lambda name: self.texts.get(name) not in (None, text(name)))
        self.texts.setdefault(name, text(name))
        return name

    def connector_name(self, connector: Connector) -> str:
        """Class name of a connector."""
        kind = type(connector)
        if self.standard_library and (full := interface_of(kind)) is not None:
            return full
        lines = []
        for variable, declared in connector.variables.items():
            flow = "flow " if isinstance(declared, Flow) else ""
            lines.append(
                f"  {flow}Real {safe_name(variable)}{attributes_text({}, declared.unit)}{comment(declared.description)};"
            )
        return self._kept(safe_name(kind.__name__), lambda name: _class_text("connector", name, kind, lines))

    def counterpart(self, part: Component) -> tuple[str, Counterpart] | None:
        """The standard library's class for a part, if it is to be used and can express all given values."""
        if not self.standard_library:
            return None
        found = modelica_class(type(part))
        if found is None or not _can_express(found[1], part):
            return None
        return found


def modelica_class(kind: type[Component]) -> tuple[str, Counterpart] | None:
    """The standard library's counterpart of a component class."""
    for full, counterpart in standard_library().counterparts.items():
        if counterpart.home == home_of(kind) and ".Interfaces." not in full:
            return full, counterpart
    return None


def interface_of(kind: type[Connector]) -> str | None:
    """The standard library's counterpart of a connector class."""
    for full, counterpart in standard_library().counterparts.items():
        if counterpart.home == home_of(kind) and full.endswith(("_a", "HeatPort")):
            return full
    return None


def _can_express(counterpart: Counterpart, part: Component) -> bool:
    """Whether nothing given to a part is without an equivalent in the Modelica library."""
    given = given_to(part)
    names = [*given.values, *given.choices, *given.start, *given.guess, *given.nominal, *given.state]
    return not any(name in counterpart.own for name in names)


class ClassText:
    """Writer for one class."""

    def __init__(self, package: PackageText, component: Component) -> None:
        self.package, self.component = package, component
        self.connections = connections_of(component)
        self.parts = dict(parts_of(component))
        self.declared = declared_by(component)
        self.counterparts = {name: package.counterpart(part) for name, part in self.parts.items()}
        self.names: dict[str, str] = {}  # parts that cannot be elements of an array
        self.taken: set[str] = set()
        self.lifted: list[Lifted] = []
        self.separated: dict[str, list[str]] | None = None
        for name, part in self.parts.items():
            if isinstance(part, Sampled):
                raise ModelicaError(f"{name} calls a Python function, which cannot be written in Modelica")
            if isinstance(part, Delayed) and self.counterparts[name] is None:
                raise ModelicaError(f"{name} delays a signal: that is written with standard_library=True only, and not flat")

    # ------------------------------------------------------------ names

    def naming(self, name: str) -> str:
        """Name in the text of a variable of the component, by its path from there."""
        first, dot, rest = name.partition(".")
        self.families()
        if name in self.declared.derivatives:
            return f"der({self.naming(self.declared.derivatives[name][4:-1])})"
        if not dot:
            return safe_name(modelica_name(name))
        own = self.names.get(first) or safe_name(modelica_name(first))
        if (found := self.counterparts.get(first)) is not None:
            return f"{own}.{_outward(found[1], rest)}"
        if first in self.parts:
            inner = self.package.class_text(self.parts[first]).naming(rest)
            return re.sub(r"(der\()*", rf"\g<0>{own}.", inner, count=1)
        return ".".join([own, *map(safe_name, modelica_name(rest).split("."))])

    def text(self, value: Any) -> str:
        if isinstance(value, Tabulated):
            value = value.expression(time, True)
        return modelica_text(value_of(value), self.number)

    def is_truth(self, name: str) -> bool:
        """Whether a signal, by its path from the component, is true or false in Modelica."""
        part, _, local = name.rpartition(".")
        found = self.counterparts.get(part)
        return found is not None and local in found[1].truths

    def number(self, name: str) -> str:
        """Text of a signal as a number."""
        return f"(if {self.naming(name)} then 1 else 0)" if self.is_truth(name) else self.naming(name)

    def given(self, target: str, value: Any) -> str:
        """Text of a value for an input, by its path from the component."""
        if not self.is_truth(target):
            return self.text(value)
        value = value_of(value)
        if value.is_Symbol and self.is_truth(value.name):
            return self.naming(value.name)
        return condition_text(value, self.number)

    # ------------------------------------------------------------ the class

    def body(self, is_root: bool) -> tuple[list[str], tuple[Lifted, ...]]:
        """The lines of the class, and those inputs of its parts that become its own."""
        families = self.families()
        given = given_to(self.component)
        outer = given if is_root else None
        declarations = [self._parameter(n, p, given.values if is_root else {}) for n, p in self.declared.parameters.items()]
        for name, connector in self.declared.connectors.items():
            declarations.append(f"{self.package.connector_name(connector)} {safe_name(name)}{comment(connector.description)};")
        joined = self._signals()
        integers = integer_discretes(equations_of(self.component), self.declared.discretes)
        for name, variable in self.declared.variables.items():
            if "." not in name:
                declarations.append(self._variable(name, variable, outer, joined.get("", {})))
        for name, discrete in self.declared.discretes.items():
            start = (outer.start if outer else {}).get(name, discrete.start)
            number = repr(int(start)) if name in integers else repr(float(start))
            kind = "Integer" if name in integers else "discrete Real"
            declarations.append(f"{kind} {safe_name(name)}(start = {number}, fixed = true){comment(discrete.description)};")
        parts = [line for family, members in families.items() for line in self._family(family, members, joined, outer)]
        lifted = [f"input Real {i.name}{attributes_text({}, i.unit)}{comment(i.description)};" for i in self.lifted]
        stated = [*self._equations(integers), *self._connects()]
        lines = [*declarations, *lifted, *parts]
        return ["  " + line for line in lines] + (["equation", *("  " + line for line in stated)] if stated else []), tuple(
            self.lifted
        )

    def _parameter(self, name: str, declared: Parameter, given: Mapping[str, Any]) -> str:
        value = given.get(name, declared.default)
        attributes = {b: repr(v) for b, v in (("min", declared.min), ("max", declared.max)) if math.isfinite(v)}
        text = "" if value is NO_VALUE or value is None else f" = {self.text(evaluated_in(self.component, value))}"
        return f"parameter Real {safe_name(name)}{attributes_text(attributes, declared.unit)}{text}{comment(declared.description)};"

    def _variable(self, name: str, declared: Variable, outer: Any, joined: Mapping[str, str]) -> str:
        start, fixed = (declared.start, True) if declared.start is not None else (declared.guess or None, False)
        nominal, state = declared.nominal, declared.state
        if outer is not None:
            if name in outer.guess:
                start, fixed = outer.guess[name], False
            if name in outer.start:
                start, fixed = outer.start[name], True
            nominal, state = outer.nominal.get(name, nominal), outer.state.get(name, state)
        attributes = variable_attributes(declared, None if start is None else self.text(start), fixed, nominal, state)
        value = ""
        if isinstance(declared, Input):
            given = outer.values.get(name, declared.default) if outer is not None else declared.default
            if given is not NO_VALUE and given is not None:
                value = f" = {self.text(evaluated_in(self.component, given))}"
        if name in joined:
            value = f" = {joined[name]}"
        # what is bound is no input of the system
        prefix = "input " if isinstance(declared, Input) and not (value and outer is not None) else ""
        return (
            f"{prefix}Real {safe_name(name)}{attributes_text(attributes, declared.unit)}{value}{comment(declared.description)};"
        )

    # ------------------------------------------------------------ parts

    def families(self) -> dict[str, list[str]]:
        """The parts by family; single parts, and members of a family that differ, stand alone."""
        if self.separated is None:
            self.separated = self._separate_families()
        return self.separated

    def _separate_families(self) -> dict[str, list[str]]:
        families: dict[str, list[str]] = {}
        for name in self.parts:
            found = _ELEMENT.match(name)
            families.setdefault(found[1] if found else name, []).append(name)
        declared = self.declared
        variables = (name for name in declared.variables if "." not in name)
        for name in (*declared.parameters, *declared.connectors, *variables, *declared.discretes, *families):
            if safe_name(name) in self.taken:
                raise ModelicaError(
                    f"{type(self.component).__name__}: {name} would be called {safe_name(name)}, as another one is; "
                    "flat=True writes such a model"
                )
            self.taken.add(safe_name(name))
        separated: dict[str, list[str]] = {}
        for family, members in families.items():
            alike = len({self._kind(name) for name in members}) == 1
            if alike or members == [family]:
                separated[family] = members
                continue
            for name in members:
                self.names[name] = self._free(name.replace("[", "_").replace("]", ""))
                separated[name] = [name]
        return separated

    def _free(self, wanted: str) -> str:
        """A name that nothing else in the class has."""
        name = free_name(safe_name(wanted), self.taken.__contains__)
        self.taken.add(name)
        return name

    def _kind(self, name: str) -> str:
        found = self.counterparts[name]
        part = self.parts[name]
        if found is None:
            return self.package.class_name(part)
        return found[0] + "".join(sorted([*map(str, given_to(part).choices.items()), *given_to(part).values]))

    def _family(self, family: str, members: list[str], joined: Mapping[str, Mapping[str, str]], outer: Any) -> Iterator[str]:
        changes = [self._changes(name, joined.get(name, {}), outer) for name in members]
        found = self.counterparts[members[0]]
        kind = found[0] if found is not None else self.package.class_name(self.parts[members[0]])
        own = self.names.get(family) or safe_name(family)
        if members == [family]:
            yield f"{kind} {changes[0].text(own)};"
        else:
            merged = _merged(changes)
            inner = f"({', '.join(merged)})" if merged else ""
            yield f"{kind} {own}[{len(members)}]{inner};"

    def _changes(self, name: str, joined: Mapping[str, str], outer: Any) -> Change:
        """Modifications of a part."""
        part, found, given = self.parts[name], self.counterparts[name], given_to(self.parts[name])
        change = Change()

        def at(path: str) -> Change:
            if found is not None:
                return change.within(_outward(found[1], path).split("."))
            inner = self.package.class_text(part).naming(path)
            if not re.fullmatch(r"[\w.]+", inner):
                raise ModelicaError(
                    f"{name}.{path} is one of a family in its class, or a derivative; flat=True writes such a model"
                )
            return change.within(inner.split("."))

        if found is not None:
            for choice, value in given.choices.items():
                at(choice).value = _choice_text(found[1], choice, value)
        for own, value in given.values.items():
            if value is not None and own not in joined:
                at(own).value = self._value_of_part(name, own, value)
        for own, source in joined.items():
            at(own).value = source
        starts = [(given.guess, False, self.text), (given.start, True, self.text)]
        if outer is not None:
            starts += [(_below(name, outer.guess), False, self.text), (_below(name, outer.start), True, self.text)]
        for values, fixed, text in starts:
            for path, value in values.items():
                if found is not None and path in found[1].starts.values():
                    parameter = next(p for p, v in found[1].starts.items() if v == path)
                    change.within([parameter]).value = text(value)
                    if fixed and "initType" in found[1].only:
                        change.within(["initType"]).value = f"Modelica.Blocks.Types.Init.{found[1].only['initType'][0]}"
                    continue
                at(path).within(["start"]).value = text(value)
                if fixed:
                    at(path).within(["fixed"]).value = "true"
        for path, value in {**given.nominal, **(_below(name, outer.nominal) if outer else {})}.items():
            at(path).within(["nominal"]).value = repr(float(value))
        for path, value in {**given.state, **(_below(name, outer.state) if outer else {})}.items():
            at(path).within(["stateSelect"]).value = f"StateSelect.{value}"
        self._lift_inputs(name, part, given.values, joined, at)
        for array, signals in found[1].arrays.items() if found is not None else ():
            if isinstance(signals, tuple) and any(f"{array}[{k + 1}]" in change.inner for k in range(len(signals))):
                elements = [change.inner.pop(f"{array}[{k + 1}]", Change("0")) for k in range(len(signals))]
                change.within([array]).value = f"{{{', '.join(str(e.value) for e in elements)}}}"
        return change

    def _value_of_part(self, name: str, own: str, value: Any) -> str:
        """Text of a value given to a part."""
        found = self.counterparts[name]
        converted = {} if found is None else found[1].converted
        if found is not None and (modelica := standard_library().outward(found[1]).get(own, own)) in converted:
            value = converted[modelica][1](value)
        if isinstance(value, tuple):
            return f"{{{', '.join(map(self.text, value))}}}"
        return self.given(f"{name}.{own}", value)

    def _lift_inputs(self, name: str, part: Component, values: Mapping[str, Any], joined: Mapping[str, str], at: Any) -> None:
        """Turn unbound inputs of parts into inputs of the class."""
        known = self.counterparts[name]
        unbound = [
            Lifted(n, v.unit, v.description)
            for n, v in declared_by(part).variables.items()
            if isinstance(v, Input) and v.default is NO_VALUE and values.get(n) is None and n not in joined
            if known is None or n not in known[1].own
        ]
        if known is None:
            unbound += self.package.lifted.get(self.package.class_name(part), ())
        for each in unbound:
            own = self._free(f"{name}_{each.name}".replace("[", "_").replace("]", "").replace(".", "_"))
            self.lifted.append(Lifted(own, each.unit, each.description))
            at(each.name).value = own

    # ------------------------------------------------------------ equations

    def _signals(self) -> dict[str, dict[str, str]]:
        """Signals bound to inputs of parts, and to outputs of the component: by part, and by name there."""
        names = {id(part): name for name, part in self.parts.items()}
        found: dict[str, dict[str, str]] = {}
        for target, local, source in joined_signals(self.component, ""):
            if target is self.component:
                found.setdefault("", {})[local] = self.number(str(source))
            elif id(target) in names:
                found.setdefault(names[id(target)], {})[local] = self.given(f"{names[id(target)]}.{local}", source)
            else:
                raise ModelicaError(f"{local} of a part within a part takes a signal; flat=True writes such a model")
        return found

    def _equations(self, integers: frozenset[str]) -> Iterator[str]:
        for equation in equations_of(self.component):
            yield from equation_lines(equation, self.naming)

    def _connects(self) -> Iterator[str]:
        for connection in self.connections:
            first, *others = connection.ports or (None,)
            for other in others:
                yield f"connect({self._port(first)}, {self._port(other)});"

    def _port(self, port: Port | None) -> str:
        assert port is not None
        if port.component is self.component:
            return safe_name(port.connector.name)
        for name, part in self.parts.items():
            if part is port.component:
                return self.naming(f"{name}.{port.connector.name}")
        raise ModelicaError(
            f"{port!r} is a connector of a part within a part, which Modelica does not connect; flat=True writes such a model"
        )


def equation_lines(equation: Eq | When, naming: Any) -> Iterator[str]:
    """An equation as lines of text."""
    if isinstance(equation, Eq):
        yield f"{modelica_text(value_of(equation.left), naming)} = {modelica_text(value_of(equation.right), naming)};"
        return
    assigned = {a.left: None for branch in equation.branches for a in branch.actions if isinstance(a, Eq)}
    for branch in equation.branches:
        yield f"{'when' if branch is equation else 'elsewhen'} {modelica_text(branch.condition, naming)} then"
        own = {a.left for a in branch.actions if isinstance(a, Eq)}
        kept = (Eq(target, pre(target)) for target in assigned if target not in own)  # all branches assign the same variables
        for action in (*branch.actions, *kept):
            if isinstance(action, Reinit):
                yield f"  reinit({modelica_text(action.state, naming)}, {modelica_text(action.value, naming)});"
            else:
                yield f"  {modelica_text(action.left, naming)} = {modelica_text(value_of(action.right), naming)};"
    yield "end when;"


def integer_discretes(equations: Sequence[Eq | When], discretes: Mapping[str, Discrete]) -> frozenset[str]:
    """The discrete variables with integer values."""
    assigned: dict[str, list[Any]] = {name: [] for name in discretes}
    for equation in equations:
        for action in [equation] if isinstance(equation, Eq) else [a for branch in equation.branches for a in branch.actions]:
            if isinstance(action, Eq) and str(action.left) in assigned:
                assigned[str(action.left)].append(value_of(action.right))
    found = {name for name, d in discretes.items() if float(d.start).is_integer()}
    while True:
        allowed = found | {f"pre({name})" for name in found}
        kept = {name for name in found if all(_is_whole(value, allowed) for value in assigned[name])}
        if kept == found:
            return frozenset(found)
        found = kept


def _is_whole(value: Any, names: set[str]) -> bool:
    if value.is_Integer or str(value) in names:
        return True
    if type(value).__name__ == "Piecewise":
        return all(_is_whole(branch, names) for branch, _ in value.args)
    return bool((value.is_Add or value.is_Mul) and all(_is_whole(a, names) for a in value.args))


def _merged(changes: list[Change]) -> list[str]:
    """Merge the modifications of the elements of an array."""
    found = []
    names = list(dict.fromkeys(n for c in changes for n in c.inner))
    for name in names:
        own = [c.inner.get(name, Change()) for c in changes]
        inner = _merged(own)
        values = [c.value for c in own]
        value, *others = dict.fromkeys(values)
        text = f"({', '.join(inner)})" if inner else ""
        if not others:
            found.append(f"{name}{text}" if value is None else f"each {name}{text} = {value}")
        elif None in values:
            raise ModelicaError(f"'{name}' is given to some parts of a family only; flat=True writes such a model")
        else:
            found.append(f"{name}{text} = {{{', '.join(map(str, values))}}}")
    return found


def _below(name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    return {path.removeprefix(f"{name}."): v for path, v in values.items() if path.startswith(f"{name}.")}


def _outward(counterpart: Counterpart, path: str) -> str:
    """Modelica's form of a path within an instance of a library class."""
    if (element := counterpart.element(path)) is not None:
        return element
    outward = standard_library().outward(counterpart)
    return ".".join(outward.get(step, modelica_name(step)) for step in path.split("."))


def _choice_text(counterpart: Counterpart, name: str, value: Any) -> str:
    modelica = standard_library().outward(counterpart).get(name, name)
    if modelica in counterpart.converted:
        value = counterpart.converted[modelica][1](value)
    literals = {ours: literal for literal, ours in counterpart.values.get(modelica, {}).items()}
    if value in literals if not isinstance(value, tuple) else False:
        return f"{counterpart.enumerations[modelica]}.{literals[value]}"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        if value and isinstance(value[0], tuple):
            return "[" + "; ".join(", ".join(repr(float(v)) for v in row) for row in value) + "]"
        whole = all(isinstance(v, int) for v in value)
        return "{" + ", ".join(repr(v if whole else float(v)) for v in value) + "}"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def variable_attributes(declared: Variable, start: str | None, fixed: bool, nominal: float, state: str) -> dict[str, str]:
    """The attributes of a variable that are not Modelica's defaults, except for its unit."""
    every = {
        "start": start, "fixed": "true" if fixed else None, "nominal": repr(float(nominal)) if nominal != 1.0 else None,
        "min": repr(float(declared.min)) if math.isfinite(declared.min) else None,
        "stateSelect": f"StateSelect.{state}" if state != "default" else None,
    }  # fmt: skip
    return {name: text for name, text in every.items() if text is not None}


def attributes_text(attributes: Mapping[str, str], unit: str) -> str:
    found = ([] if unit == "any" else [f'unit = "{unit}"']) + [f"{n} = {v}" for n, v in attributes.items()]
    return f"({', '.join(found)})" if found else ""


def comment(text: str | None) -> str:
    """A Modelica comment: the first line of a description."""
    first = (text or "").strip().partition("\n")[0].replace("\\", "\\\\").replace('"', '\\"')
    return f' "{first}"' if first else ""


def safe_name(name: str) -> str:
    return f"{name}_" if name in _TAKEN else name


def free_name(wanted: str, is_taken: Callable[[str], bool]) -> str:
    """A name, with a number where it is taken."""
    names = itertools.chain([wanted], (f"{wanted}_{number}" for number in itertools.count(2)))
    return next(name for name in names if not is_taken(name))


def _class_text(keyword: str, name: str, kind: type, lines: list[str]) -> str:
    return "\n".join([f"{keyword} {name}{comment(kind.__doc__)}", *lines, f"end {name};"])
