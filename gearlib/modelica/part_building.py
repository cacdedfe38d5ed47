"""Instantiation of parts: library classes and classes of the text, under modifications."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from gearlib.arguments import shown
from gearlib.errors import ModelicaError, nearest
from gearlib.language.component import Component
from gearlib.language.declarations import Connector, Declaration, Derivative, Discrete, Input, Parameter, Structural, Variable
from gearlib.modelica.class_content import Modifications, by_name, check_attributes, content_of, given_value, with_classes
from gearlib.modelica.counterparts import Counterpart
from gearlib.modelica.element_types import ElementType, connector_class, kind_of, type_named
from gearlib.modelica.evaluation import Evaluation
from gearlib.modelica.lexer import TextPlace
from gearlib.modelica.scopes import ClassScope
from gearlib.modelica.syntax_tree import (
    ArrayNode,
    ClassNode,
    ComponentNode,
    GivenNode,
    Modification,
    NumberNode,
    StringNode,
    SyntaxNode,
    TruthNode,
)

ClassOf = Callable[[ClassScope, Modifications], type[Component]]
STATE_SELECT = {"never": "never", "avoid": "avoid", "default": "default", "prefer": "prefer", "always": "prefer"}


@dataclass
class PartValues:
    """Arguments given to an instance."""

    values: dict[str, Any] = field(default_factory=dict)
    start: dict[str, Any] = field(default_factory=dict)
    guess: dict[str, Any] = field(default_factory=dict)
    nominal: dict[str, float] = field(default_factory=dict)
    state: dict[str, Any] = field(default_factory=dict)

    def made(self, kind: type[Component], at: TextPlace) -> Component:
        """The instance."""
        with at.in_refusals():
            return kind(start=self.start, guess=self.guess, nominal=self.nominal, state=self.state, **self.values)


@dataclass(frozen=True)
class PartMaker:
    """Makes the instances of one declared part; ``number`` is the index in an array of ``size`` parts, counted from 0.

    ``in_array``: whether what is modified is in an array of parts within the part.
    """

    evaluation: Evaluation
    class_of: ClassOf
    number: int | None = None
    size: int | None = None
    in_array: bool = False

    def made(self, kind: ElementType, modifications: Modifications, at: TextPlace) -> Component:
        """An instance of a library class, or of a class of the text."""
        given = PartValues()
        if kind.counterpart is not None:
            self._library(kind.counterpart, modifications, given)
            return given.made(kind.counterpart.component, at)
        assert kind.scope is not None
        return given.made(self._own(kind.scope, modifications, given), at)

    def _value(self, m: Modification, of: Callable[[SyntaxNode], Any]) -> Any:
        found = of(given_value(m))
        if self.number is not None and not m.each and isinstance(found, tuple):
            if len(found) != self.size:
                raise ModelicaError(f"{m.at}: {len(found)} values; the array has {self.size} elements")
            return found[self.number]
        return found

    def _attribute(self, m: Modification) -> Any:
        return attribute(m, self._value(m, self.evaluation.constant))

    def _evaluation(self, of_parameters: bool) -> Evaluation:
        return replace(self.evaluation, of_parameters=of_parameters)

    # ------------------------------------------------------------ library classes

    def _library(self, counterpart: Counterpart, modifications: Modifications, given: PartValues) -> None:
        kind, evaluation = counterpart.component, self.evaluation
        for name, m in modifications.items():
            if m.redeclared is not None:
                raise ModelicaError(f"{m.at}: '{name}' cannot be redeclared here")
            if name in counterpart.ignored:
                continue
            if name in counterpart.only:
                if m.value is not None and (found := self._value(m, evaluation.constant)) not in counterpart.only[name]:
                    valid = " or ".join(map(str, counterpart.only[name]))
                    raise ModelicaError(f"{m.at}: {name} = {found} is not supported; expected {valid}")
            elif isinstance(signals := counterpart.arrays.get(name), tuple) and m.value is not None:
                values = self._value(m, evaluation.number)
                if not isinstance(values, tuple) or len(values) != len(signals):
                    raise ModelicaError(f"{m.at}: '{name}' is an array of {len(signals)} signals")
                given.values.update(zip(signals, values, strict=True))
            elif name in counterpart.starts:
                given.start[counterpart.starts[name]] = self._value(m, evaluation.number)
            elif name in counterpart.nominals:
                given.nominal[counterpart.nominals[name]] = self._attribute(m)
            elif name == "stateSelect" and counterpart.states:
                wanted = self._attribute(m)
                given.state.update(dict.fromkeys(counterpart.states, wanted))
            else:
                self._declared(kind, counterpart, name, m, given)

    def _declared(self, kind: type[Any], counterpart: Counterpart, name: str, m: Modification, given: PartValues) -> None:
        local = counterpart.given.get(name) or counterpart.local(name)
        declared = getattr(kind, local, None)
        if isinstance(declared, Structural):
            if m.value is not None:
                given.values[local] = chosen(counterpart, name, self._value(m, self.evaluation.constant), m)
        elif isinstance(declared, (Parameter, Input)) and m.value is not None:
            value = self._value(m, self._evaluation(isinstance(declared, Parameter)).number)
            with m.at.in_refusals():
                given.values[local] = counterpart.converted[name][0](value) if name in counterpart.converted else value
        elif isinstance(declared, Parameter):
            check_attributes(by_name(m.inner))
        elif isinstance(declared, (Variable, Discrete, Connector, Derivative)) and m.value is None:
            self.attributes(local, declared, m, given)
        else:
            valid = [n for base in kind.__mro__ for n, d in vars(base).items() if isinstance(d, Declaration)]
            raise ModelicaError(f"{m.at}: {kind.__name__} has no '{name}' that can be modified; {nearest(local, valid)}")

    def _variable(
        self, path: str, declared: Declaration | None, m: Modification, given: PartValues, before: Modifications
    ) -> Modifications:
        """Attributes of a variable, and what of them is left to its class, which has those of ``before``: whether its start is fixed."""
        inner = dict(by_name(m.inner))
        left: dict[str, Modification] = {}
        (own,) = m.name
        if isinstance(declared, Connector) and m.value is None:
            for name, further in inner.items():
                stated = by_name(before[name].inner) if name in before else {}
                left |= self._variable(f"{path}.{name}", variable_of(declared, path, name, m), further, given, stated)
            return {own: replace(m, inner=tuple(left.values()))} if left else {}
        if self.in_array and m.value is None:
            check_attributes(inner)
            within = (self._given_within((*path.split("."), n), v, n != "start", given, False) for n, v in inner.items())
            return {own: replace(m, inner=tuple(within))}
        if isinstance(declared, Variable) and m.value is None:
            if "fixed" in inner:
                fixed = self._attribute(inner["fixed"])
                if not (fixed and "start" in inner):
                    left = {own: replace(m, inner=(replace(inner.pop("fixed"), value=TruthNode(m.at, fixed)),))}
            elif "start" in inner and "fixed" in before and isinstance(before["fixed"].value, TruthNode):
                inner["fixed"] = before["fixed"]
            m = replace(m, inner=tuple(inner.values()))
        self.attributes(path, declared, m, given)
        return left

    def attributes(self, path: str, declared: Declaration | None, m: Modification, given: PartValues) -> None:
        """``start``, ``fixed``, ``nominal`` and ``stateSelect`` of a variable, or of the variables of a connector."""
        inner = by_name(m.inner)
        if m.value is not None:
            raise ModelicaError(f"{m.at}: '{path}' is a variable of a part; an equation gives its value")
        if isinstance(declared, Connector):
            for name, further in inner.items():
                self.attributes(f"{path}.{name}", variable_of(declared, path, name, m), further, given)
            return
        check_attributes(inner)
        fixed = "fixed" in inner and self._attribute(inner["fixed"])
        if fixed and isinstance(declared, Derivative):
            raise ModelicaError(f"{m.at}: '{path}' is a derivative, whose start value cannot be fixed; use InitializeFlange")
        if "start" in inner:
            value = self._value(inner["start"], self._evaluation(True).number)
            if fixed or isinstance(declared, Discrete):
                given.start[path] = value
            elif not isinstance(declared, Derivative):
                given.guess[path] = value
        elif fixed and isinstance(declared, Variable):
            given.start[path] = declared.guess
        for name, further in inner.items():
            if name == "nominal":
                given.nominal[path] = self._attribute(further)
            elif name == "stateSelect":
                given.state[path] = self._attribute(further)

    # ------------------------------------------------------------ classes of the text

    def _own(self, scope: ClassScope, modifications: Modifications, given: PartValues) -> type[Component]:
        """The class of a part, with modifications of its own parts applied; other values are given to the instance."""
        inside = self._split((), scope, modifications, given)
        return self.class_of(with_classes(scope, modifications, self.evaluation.scope), inside)

    def _within(self, path: tuple[str, ...], kind: ElementType, inner: Modifications, given: PartValues) -> Modifications:
        """Modifications of a part within the part, of either kind."""
        if kind.counterpart is not None:
            return self._of_library(path, kind.counterpart, inner, given)
        assert kind.scope is not None
        return self._split(path, kind.scope, inner, given)

    def _split(
        self, path: tuple[str, ...], scope: ClassScope, modifications: Modifications, given: PartValues
    ) -> Modifications:
        """Modifications to apply to the class: values within its parts, and redeclarations."""
        kept: dict[str, Modification] = {}
        content = content_of(scope, modifications if any(m.redeclared for m in modifications.values()) else {})
        for name, m in modifications.items():
            if isinstance(m.redeclared, ClassNode):
                continue
            element = content.elements.get(name)
            if element is None:
                self._of_base(path, scope, name, m, given, kept)
                continue
            around = with_classes(element.scope, modifications, self.evaluation.scope)
            kind = type_named(element.node.type, around, element.node)
            here = kind_of(element.node, kind, frozenset())
            if here == "constant":
                raise ModelicaError(f"{m.at}: '{name}' is a constant, and cannot be modified")
            if m.redeclared is not None:
                kept[name] = self._closed((*path, name), m, given)
            elif here in ("parameter", "input", "structural"):
                if m.value is None:
                    continue
                if "final" in element.node.prefixes:
                    raise ModelicaError(f"{m.at}: '{name}' is final, and cannot be modified")
                if path:
                    kept[name] = self._given_within((*path, name), m, here == "structural", given, here == "input")
                else:
                    of = self.evaluation.constant if here == "structural" else self._evaluation(here == "parameter").number
                    given.values[name] = self._value(m, of)
            elif here == "part":
                number = None if m.each else self.number  # an array of values is for one of the part's own
                inside = replace(self, number=number, in_array=self.in_array or bool(element.node.dimensions))
                if further := inside._within((*path, name), kind, by_name(m.inner), given):
                    kept[name] = replace(m, inner=tuple(further.values()))
            else:
                declared: Declaration = Discrete() if here == "discrete" else Variable()
                if kind.counterpart is not None:
                    declared = kind.counterpart.component()
                elif kind.scope is not None:
                    declared = connector_class(kind.scope)()
                kept |= self._variable(".".join((*path, name)), declared, m, given, element.modifications)
        return kept

    def _of_base(
        self, path: tuple[str, ...], scope: ClassScope, name: str, m: Modification, given: PartValues, kept: dict[str, Modification],
    ) -> None:  # fmt: skip
        content = content_of(scope, {})
        for counterpart, before in content.library_bases:
            local = counterpart.local(name)
            declared = getattr(counterpart.component, local, None)
            if path:
                kept |= self._of_library(path, counterpart, {name: m}, given)
            elif isinstance(declared, Variable) and m.value is None:
                kept |= self._variable(local, declared, m, given, by_name(before[name].inner) if name in before else {})
            else:
                self._library(counterpart, {name: m}, given)
            return
        raise ModelicaError(f"{m.at}: {scope.name} has no element '{name}' to be modified; {nearest(name, content.elements)}")

    def _of_library(
        self, path: tuple[str, ...], counterpart: Counterpart, inner: Modifications, given: PartValues
    ) -> Modifications:
        """Modifications of a library part within a part."""
        kept: dict[str, Modification] = {}
        for name, m in inner.items():
            local = counterpart.given.get(name) or counterpart.local(name)
            declared = getattr(counterpart.component, local, None)
            if m.value is None and isinstance(declared, (Variable, Discrete, Connector)):
                kept |= self._variable(".".join((*path, local)), declared, m, given, {})
            else:
                structural = isinstance(declared, Structural) or name in counterpart.ignored or name == "stateSelect"
                signal = isinstance(declared, Input) or name in counterpart.arrays
                kept[name] = self._given_within((*path, name), m, structural, given, signal) if m.value is not None else m
        return kept

    def _given_within(
        self, path: tuple[str, ...], m: Modification, structural: bool, given: PartValues, signal: bool
    ) -> Modification:
        """A modification whose value is a parameter or an input of the enclosing class or, for a structural choice, the value itself.

        An array is one of such values.
        """
        if structural:
            return replace(m, value=_literal(self._value(m, self.evaluation.constant), m))

        def passed(name: str, value: Any) -> SyntaxNode:
            if isinstance(value, tuple):
                return ArrayNode(m.at, tuple(passed(f"{name}__{k}", v) for k, v in enumerate(value, 1)))
            given.values[name] = value
            return GivenNode(m.at, name, signal)

        return replace(m, value=passed("__".join(path), self._value(m, self._evaluation(not signal).number)))

    def _closed(self, path: tuple[str, ...], m: Modification, given: PartValues) -> Modification:
        """A redeclaration whose values are parameters of the enclosing class."""
        new = m.redeclared
        assert isinstance(new, ComponentNode)
        further = self._within(path, type_named(new.type, self.evaluation.scope, new), by_name(new.modifications), given)
        return replace(m, redeclared=replace(new, modifications=tuple(further.values())))


def variable_of(connector: Connector | type[Connector], path: str, name: str, m: Modification) -> Variable:
    """A variable of a connector that is modified."""
    if name not in connector.variables:
        raise ModelicaError(f"{m.at}: '{path}' has no '{name}'; {nearest(name, connector.variables)}")
    return connector.variables[name]


def attribute(m: Modification, value: Any) -> Any:
    """An attribute of a variable, from its constant value: whether it is ``fixed``, the wish of ``stateSelect``, or a number."""
    name, expected = ".".join(m.name), "a number"
    if name == "fixed":
        if isinstance(value, bool):
            return value
        expected = "true or false"
    elif name == "stateSelect":
        if value in STATE_SELECT:
            return STATE_SELECT[value]
        expected = f"one of {', '.join(STATE_SELECT)}"
    elif isinstance(value, (int, float)):
        return float(value)
    raise ModelicaError(f"{m.at}: '{name}' is {shown(value)}; expected {expected}")


def chosen(counterpart: Counterpart, name: str, value: Any, m: Modification) -> Any:
    """Value of a structural choice; enumeration literals are translated."""
    values = counterpart.values.get(name)
    if name in counterpart.converted:
        return counterpart.converted[name][0](value)
    if values is None:
        return value
    if value not in values:
        raise ModelicaError(f"{m.at}: {name} = {value} is not supported; {nearest(str(value), map(str, values))}")
    return values[value]


def _literal(value: Any, m: Modification) -> SyntaxNode:
    match value:
        case bool():
            return TruthNode(m.at, value)
        case str():
            return StringNode(m.at, value)
        case tuple():
            return ArrayNode(m.at, tuple(_literal(v, m) for v in value))
    return NumberNode(m.at, value)
