"""Translation of Modelica classes to component classes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from gearlib.errors import ModelicaError
from gearlib.language.component import RESERVED, Component, Connection
from gearlib.language.declarations import NO_VALUE, Connector, Declaration, Discrete, Input, Parameter, Structural, Variable
from gearlib.language.expressions import Eq, When
from gearlib.modelica.class_content import (
    Content,
    DeclaredElement,
    Modifications,
    by_name,
    check_attributes,
    content_of,
    given_value,
    merged,
)
from gearlib.modelica.counterparts import Counterpart, ModelicaClass
from gearlib.modelica.element_types import (
    ElementKind,
    ElementType,
    check_type,
    connector_class,
    element_of,
    kind_of,
    type_named,
    unit_of,
)
from gearlib.modelica.equation_reading import assigned_in_whens, connections_from, equations_from
from gearlib.modelica.evaluation import Evaluation
from gearlib.modelica.part_building import PartMaker, attribute, chosen, variable_of
from gearlib.modelica.scopes import ClassScope
from gearlib.modelica.syntax_tree import (
    ArrayNode,
    CallNode,
    ClassNode,
    ComponentNode,
    EqualityNode,
    GivenNode,
    Modification,
    OperationNode,
    ReferenceNode,
    SyntaxNode,
)


@dataclass(frozen=True)
class Member:
    """A declared element of a class, with its classification."""

    element: DeclaredElement
    type: ElementType
    kind: ElementKind

    @property
    def attributes(self) -> Modifications:
        """Attributes from the type and from the element."""
        return merged(self.type.attributes, self.element.modifications)

    @property
    def default(self) -> SyntaxNode | None:
        """The value given by the declaration."""
        return self.element.node.value


@dataclass
class TextClasses:
    """The component classes of one text, each made once."""

    text: str
    source: str
    made: dict[Any, type[Component]] = field(default_factory=dict)
    connectors: dict[ClassNode, type[Connector]] = field(default_factory=dict)

    def class_of(self, scope: ClassScope, modifications: Modifications) -> type[Component]:
        """Component class for a class of the text, with modifications of its parts applied."""
        key = scope.node, scope.kept, tuple((n, s.node) for n, s in scope.replaced.items()), tuple(modifications.items())
        if key not in self.made:
            self.made[key] = _ClassBuilder(self, scope, modifications).made()
        return self.made[key]

    def connector_of(self, scope: ClassScope) -> type[Connector]:
        """Connector class for a connector of the text."""
        if scope.node not in self.connectors:
            self.connectors[scope.node] = connector_class(scope)
        return self.connectors[scope.node]


class _ClassBuilder:
    """Builder that turns one class of the text into a component class."""

    def __init__(self, classes: TextClasses, scope: ClassScope, modifications: Modifications) -> None:
        self.classes, self.scope, self.modifications = classes, scope, modifications
        self.content: Content = content_of(scope, modifications)
        stated = [*self.content.equations, *self.content.initial_equations]
        assigned = assigned_in_whens([s.node for s in stated])
        self.members: dict[str, Member] = {}
        for name, element in self.content.elements.items():
            kind = type_named(element.node.type, element.scope, element.node)
            self.members[name] = Member(element, kind, kind_of(element.node, kind, assigned))
        # hidden variables that start at 0, and the expressions that they equal
        self.starting: list[tuple[str, Callable[[Evaluation], Any]]] = []
        self.parts, self.signals = _in_order_of_use(self.members)

    # ------------------------------------------------------------ the class

    def made(self) -> type[Component]:
        node = self.scope.node
        members: dict[str, Any] = {}
        for name, member in self.members.items():
            _check_name(name, member.element.node)
            with member.element.node.at.in_refusals():
                declared = self._declared(name, member)
            if declared is not None:
                members[name] = declared
        for given in _given_nodes(self.modifications.values()):
            members[given.name] = (Input if given.is_signal else Parameter)("any", "given by the enclosing class")
        for counterpart, modifications in self.content.library_bases:
            for name, m in modifications.items():
                if name not in self.members and name not in counterpart.ignored:
                    members.update(self._redeclared(counterpart, name, m))
        self._initial_equations()
        members |= {name: Variable("any", "what a start value is held to", start=0.0) for name, _ in self.starting}
        members |= {name: Variable("any", "signal bound to an input") for name in self.signals}
        bases = tuple(dict.fromkeys(c.component for c, _ in self.content.library_bases)) or (Component,)
        functions = {"equations": self._equations(), "assemble": self._assemble()}
        about = {
            "__doc__": node.comment or f"The Modelica class {self.scope.name}.", "__module__": __name__, "__qualname__": node.name,
            "modelica_text": self.classes.text, "modelica_source": self.classes.source, "modelica_name": self.scope.name,
        }  # fmt: skip
        with node.at.in_refusals():
            made: Any = ModelicaClass(node.name, bases, {**members, **functions, **about})
        found: type[Component] = made
        return found

    @property
    def fixed_values(self) -> Evaluation:
        """Evaluation context for values that must be known with the class."""
        return self._within(self.scope)

    def _within(self, scope: ClassScope) -> Evaluation:
        return Evaluation(scope, None, self._constants(), types={name: m.type.kind for name, m in self.members.items()})

    def _constants(self) -> Mapping[str, SyntaxNode]:
        """Values of constants, including structural choices whose default depends on others."""
        kinds = ("constant", "structural")
        return {n: m.default for n, m in self.members.items() if m.kind in kinds and m.default is not None}

    def evaluation(self, component: Component, scope: ClassScope | None = None) -> Evaluation:
        """Evaluation context for the expressions of the class in one instance."""
        conditional = frozenset(n for n, m in self.members.items() if m.element.node.condition is not None and m.kind == "part")
        return replace(self._within(scope or self.scope), component=component, conditional=conditional)

    # ------------------------------------------------------------ declarations

    def _declared(self, name: str, member: Member) -> Declaration | None:
        node, attributes = member.element.node, member.attributes
        for prefix in ("inner", "outer", "stream"):
            if prefix in node.prefixes:
                raise ModelicaError(f"{node.at}: '{prefix}' is not supported")
        if member.kind not in ("connector", "part"):
            check_attributes(attributes)
        if _names_in(node.value):
            self.fixed_values.check_assigned(name, node.value or node)
        unit = unit_of(member.element, member.type)
        match member.kind:
            case "parameter":
                bounds = {b: self._attribute(attributes[b]) for b in ("min", "max") if b in attributes}
                return Parameter(unit, node.comment, default=self._default(member), **bounds)
            case "structural":
                return Structural(self._structural(member), node.comment)
            case "input":
                return Input(unit, node.comment, default=self._default(member), **self._variable(name, node, attributes))
            case "variable":
                return Variable(unit, node.comment, **self._variable(name, node, attributes))
            case "discrete":
                return Discrete(node.comment, start=self._start(name, attributes["start"]) if "start" in attributes else 0.0)
            case "connector":
                return self._connector(member)
            case "constant" if not _names_in(node.value):
                self._structural(member)  # checked
        return None

    def _default(self, member: Member) -> Any:
        """A number, a function of the component that evaluates the default, or no value."""
        node = member.default
        if node is None:
            return NO_VALUE
        if isinstance(node, GivenNode) or _names_in(node):
            scope, constant = member.element.scope, member.kind == "parameter"
            return lambda c: replace(self.evaluation(c, scope), of_parameters=constant).number(node)
        evaluation = self._within(member.element.scope)
        check_type(evaluation.value(node), member.type.kind, node)
        found = evaluation.number(node)
        return float(found) if isinstance(found, (int, float)) else found

    def _structural(self, member: Member) -> Any:
        """The value if it depends on constants only; otherwise None, which stands for the expression in the text."""
        node = member.default
        if node is None or any(name in self.members and self.members[name].kind != "constant" for name in _names_in(node)):
            return None
        found = self._within(member.element.scope).constant(node)
        check_type(found, member.type.kind, node)
        return float(found) if member.type.kind == "real" and isinstance(found, int) else found

    def _variable(self, name: str, node: SyntaxNode, attributes: Modifications) -> dict[str, Any]:
        found: dict[str, Any] = {}
        start = attributes["start"].value if "start" in attributes else None
        held = "fixed" in attributes and self._attribute(attributes["fixed"])
        if start is None:
            found |= {"start": 0.0} if held else {}
        elif not (_names_in(start) - self._constants().keys() or isinstance(start, GivenNode)):
            found["start" if held else "guess"] = self._attribute(attributes["start"])
        elif held:
            given = start
            self.starting.append(
                (
                    f"{name.replace('.', '_')}_from_start",
                    lambda e: e.number(OperationNode(node.at, "-", (_reference(node, name), given))),
                )
            )
        for number in ("nominal", "min"):
            if number in attributes and not _names_in(attributes[number].value):
                found[number] = self._attribute(attributes[number])
        if "stateSelect" in attributes:
            found["state"] = self._attribute(attributes["stateSelect"])
        return found

    def _start(self, name: str, m: Modification) -> Any:
        found = self._attribute(m)
        check_type(self.fixed_values.constant(given_value(m)), self.members[name].type.kind, m)
        return found

    def _attribute(self, m: Modification) -> Any:
        return attribute(m, self.fixed_values.constant(given_value(m)))

    def _connector(self, member: Member) -> Connector:
        node = member.element.node
        if node.dimensions:
            raise ModelicaError(
                f"{node.at}: arrays of connectors, such as '{node.name}', are not supported; arrays of components are"
            )
        before: dict[str, Modifications] = {}
        if member.type.counterpart is not None:
            kind = member.type.counterpart.component
        else:
            assert member.type.scope is not None
            kind = self.classes.connector_of(member.type.scope)
            before = {name: element.modifications for name, element in content_of(member.type.scope, {}).elements.items()}
        for name, m in member.element.modifications.items():
            variable_of(kind, node.name, name, m)
            check_attributes(by_name(m.inner))
            before[name] = merged(before.get(name, {}), by_name(m.inner))
        when = None
        if node.condition is not None:
            named = self.members.get(str(node.condition), member)
            if not isinstance(node.condition, ReferenceNode) or named.kind != "structural":
                raise ModelicaError(
                    f"{node.condition.at}: the condition of a connector is read as the name of a Boolean parameter only"
                )
            when = str(node.condition)
        found: Connector = kind(node.comment, when=when)
        starts = {name: self._variable(f"{node.name}.{name}", node, attributes) for name, attributes in before.items()}
        variables = {name: replace(v, **starts.get(name, {})) for name, v in kind.variables.items()}
        object.__setattr__(found, "variables", variables)  # its own, for the class is that of other connectors too
        return found

    def _redeclared(self, counterpart: Counterpart, name: str, m: Modification) -> dict[str, Declaration]:
        """The declarations of a library base class that a modification changes."""
        local = counterpart.given.get(name) or counterpart.local(name)
        declared = getattr(counterpart.component, local, None)
        value = m.value
        if isinstance(declared, Structural) and value is not None:
            return {local: replace(declared, default=chosen(counterpart, name, self.fixed_values.constant(value), m))}
        if isinstance(declared, (Parameter, Input)) and value is not None:
            constant = isinstance(declared, Parameter)
            return {
                local: replace(declared, default=lambda c: replace(self.evaluation(c), of_parameters=constant).number(value))
            }
        if isinstance(declared, Variable) and value is None:
            attributes = by_name(m.inner)
            check_attributes(attributes)
            return {local: replace(declared, **self._variable(name, m, attributes))}
        raise ModelicaError(f"{m.at}: this modification of {counterpart.component.__name__} is not supported")

    # ------------------------------------------------------------ equations

    def _initial_equations(self) -> None:
        for number, stated in enumerate(self.content.initial_equations):
            node = stated.node
            if not isinstance(node, EqualityNode) or (isinstance(node.left, CallNode) and node.left.function == "pre"):
                raise ModelicaError(f"{node.at}: expected an equation of variables, such as w = w_start")
            scope = stated.scope

            def difference(e: Evaluation, node: EqualityNode = node, scope: ClassScope = scope) -> Any:
                found = [eq for eq in equations_from(node, replace(e, scope=scope)) if isinstance(eq, Eq)]
                if len(found) != 1:
                    raise ModelicaError(
                        f"{node.at}: an initial equation of arrays is not supported; write one for each variable"
                    )
                return found[0].residual

            self.starting.append((f"initial_equation_{number + 1}", difference))

    def _equations(self) -> Callable[[Component], list[Eq | When]]:
        def equations(component: Component) -> list[Eq | When]:
            found: list[Eq | When] = []
            e = self.evaluation(component)
            for name, member in self.members.items():
                if member.kind in ("variable", "discrete") and member.default is not None:
                    left = e.value(_reference(member.element.node, name))
                    found.append(Eq(left, replace(e, scope=member.element.scope).number(member.default)))
            for name, difference in self.starting:
                found.append(Eq(getattr(component, name), difference(e)))
            for name, (node, scope) in self.signals.items():
                value = replace(e, scope=scope).number(node)
                if isinstance(value, tuple):
                    raise ModelicaError(
                        f"{node.at}: an array of signals of parts that follow; give each by itself, or connect them"
                    )
                found.append(Eq(getattr(component, name), value))
            for stated in self.content.equations:
                found += equations_from(stated.node, replace(e, scope=stated.scope))
            return found

        return equations

    def _assemble(self) -> Callable[[Component], list[Connection]]:
        def assemble(component: Component) -> list[Connection]:
            e = self.evaluation(component)
            for name, member in self.parts:
                self._add_part(component, name, member, replace(e, scope=member.element.scope))
            found: list[Connection] = []
            for stated in self.content.equations:
                found += connections_from(stated.node, replace(e, scope=stated.scope))
            return found

        return assemble

    def _add_part(self, component: Component, name: str, member: Member, e: Evaluation) -> None:
        node, modifications = member.element.node, member.element.modifications
        if node.condition is not None:
            wanted = e.condition(node.condition)
            if not isinstance(wanted, bool):
                raise ModelicaError(
                    f"{node.condition.at}: the condition of a component has to be known when the model is built"
                )
            if not wanted:
                return
        if node.value is not None:
            raise ModelicaError(
                f"{node.value.at}: '{name}' is a component; modifications give values to it, as in {name}(J = 2)"
            )
        if not node.dimensions:
            setattr(component, name, PartMaker(e, self.classes.class_of).made(member.type, modifications, node.at))
            return
        if len(node.dimensions) > 1:
            raise ModelicaError(f"{node.at}: arrays of components with several dimensions are not supported")
        count = e.constant(node.dimensions[0], "a whole number")
        if not isinstance(count, int) or isinstance(count, bool) or count < 0:
            raise ModelicaError(f"{node.at}: the size of '{name}' is {count}; expected a whole number")
        makers = (PartMaker(e, self.classes.class_of, k, count) for k in range(count))
        setattr(component, name, [maker.made(member.type, modifications, node.at) for maker in makers])


def _reference(node: SyntaxNode, name: str) -> ReferenceNode:
    names = tuple(name.split("."))
    return ReferenceNode(node.at, names, ((),) * len(names))


def _check_name(name: str, node: SyntaxNode) -> None:
    if name in RESERVED or name in dir(Component) or name.startswith("_"):
        raise ModelicaError(f"{node.at}: the name '{name}' is reserved; give it another one")


def _in_order_of_use(
    members: Mapping[str, Member],
) -> tuple[list[tuple[str, Member]], dict[str, tuple[SyntaxNode, ClassScope]]]:
    """The parts, each after those that its modifications refer to; and signals between parts that refer to each other.

    Where parts are joined to a loop, the values that refer to later parts are variables of the class, with equations of their own.
    """
    waiting = {name: m for name, m in members.items() if m.kind == "part"}
    needs = {name: _names_in_modifications(m.element.modifications.values()) for name, m in waiting.items()}
    ordered: list[tuple[str, Member]] = []
    signals: dict[str, tuple[SyntaxNode, ClassScope]] = {}
    while waiting:
        ready = [name for name in waiting if not needs[name] & waiting.keys()]
        if not ready:
            name = min(waiting, key=lambda name: len(needs[name] & waiting.keys() - {name}))
            waiting[name] = _opened(name, waiting[name], waiting.keys(), signals)
            ready = [name]
        ordered += [(name, waiting.pop(name)) for name in ready]
    return ordered, signals


def _opened(name: str, member: Member, later: Collection[str], signals: dict[str, tuple[SyntaxNode, ClassScope]]) -> Member:
    """A part whose values refer to hidden signals instead of to later parts."""

    def without(node: SyntaxNode, path: str) -> SyntaxNode:
        if not _names_in(node) & set(later):
            return node
        if isinstance(node, ArrayNode):
            return replace(node, items=tuple(without(item, f"{path}_{k}") for k, item in enumerate(node.items)))
        hidden = f"{path}_signal"
        signals[hidden] = node, member.element.scope
        return ReferenceNode(node.at, (hidden,), ((),))

    def opened(m: Modification, path: str, within: ElementType | None) -> Modification:
        path = f"{path}_{'_'.join(m.name)}"
        is_input, kind = element_of(within, m.name[0])
        value = without(m.value, path) if m.value is not None and is_input else m.value
        return replace(m, value=value, inner=tuple(opened(inner, path, kind) for inner in m.inner))

    found = {key: opened(m, name, member.type) for key, m in member.element.modifications.items()}
    return replace(member, element=replace(member.element, modifications=found))


def _names_in_modifications(modifications: Any) -> set[str]:
    found: set[str] = set()
    for m in modifications:
        found |= _names_in(m.value) | _names_in_modifications(m.inner)
    return found


def _names_in(node: SyntaxNode | None) -> set[str]:
    """The first identifiers of the names in an expression."""
    found: set[str] = set()
    stack: list[Any] = [node]
    while stack:
        item = stack.pop()
        if isinstance(item, ReferenceNode):
            found.add(item.names[0])
        if isinstance(item, SyntaxNode):
            stack += list(vars(item).values())
        elif isinstance(item, tuple):
            stack += item
    return found


def _given_nodes(modifications: Any) -> Iterator[GivenNode]:
    """The values that an enclosing class passes to nested parts."""
    for m in modifications:
        stack = [m.value]
        while stack:
            item = stack.pop()
            if isinstance(item, GivenNode):
                yield item
            elif isinstance(item, ArrayNode):
                stack += item.items
        yield from _given_nodes(m.inner)
        if isinstance(m.redeclared, ComponentNode):
            yield from _given_nodes(m.redeclared.modifications)
