"""Types of declared elements: numbers with units, Booleans, choices, connectors, parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from gearlib.arguments import shown
from gearlib.errors import ModelicaError, nearest
from gearlib.language.declarations import Connector, Flow, Input, Potential
from gearlib.modelica.class_content import DeclaredElement, Modifications, by_name, check_attributes, content_of, merged
from gearlib.modelica.counterparts import Counterpart, standard_library
from gearlib.modelica.scopes import ClassScope, Path, lookup
from gearlib.modelica.si_types import unit_named, unit_written
from gearlib.modelica.syntax_tree import ComponentNode, SyntaxNode

TypeKind = Literal["real", "integer", "boolean", "string", "connector", "part"]
ElementKind = Literal["constant", "parameter", "structural", "variable", "input", "discrete", "connector", "part"]

_BUILT_IN: Mapping[str, TypeKind] = {"Real": "real", "Integer": "integer", "Boolean": "boolean", "String": "string"}
_SIGNALS: Mapping[str, tuple[TypeKind, str]] = {
    f"Modelica.Blocks.Interfaces.{kind}{way}": (_BUILT_IN[kind], way.lower())
    for kind in ("Real", "Integer", "Boolean")
    for way in ("Input", "Output")
}


@dataclass(frozen=True)
class ElementType:
    """Type of an element: its kind, the attributes from its type, and the class of a connector or a part."""

    kind: TypeKind
    prefix: str = ""  # input, if part of the type
    unit: str = "any"
    attributes: Modifications = field(default_factory=dict)
    counterpart: Counterpart | None = None
    scope: ClassScope | None = None


def type_named(names: Path, scope: ClassScope, node: SyntaxNode) -> ElementType:
    """Resolve the type that a name denotes.

    Raises
    ------
    ModelicaError
        An unknown class, or one of an unsupported kind.
    """
    if len(names) == 1 and names[0] in _BUILT_IN:
        return ElementType(_BUILT_IN[names[0]])
    found = lookup(names, scope)
    if isinstance(found, ClassScope):
        return _type_of_class(found, node)
    path = ".".join(found)
    if (unit := unit_named(path)) is not None:
        return ElementType("real", unit=unit)
    if path in _SIGNALS:
        return ElementType(*_SIGNALS[path])
    if (counterpart := standard_library().counterparts.get(path)) is not None:
        kind: TypeKind = "connector" if issubclass(counterpart.component, Connector) else "part"
        return ElementType(kind, counterpart=counterpart)
    if found[0] == "Modelica" and "Types" in found:
        return ElementType("string")
    if found[:3] == ("Modelica", "Units", "SI") or found[:2] == ("Modelica", "SIunits"):
        return ElementType("real")
    if found == ("StateSelect",):
        return ElementType("string")
    raise ModelicaError(f"{node.at}: the class {path} is not known; {nearest(path, standard_library().counterparts, 6)}")


def _type_of_class(found: ClassScope, node: SyntaxNode) -> ElementType:
    kind, short = found.node.kind, found.node.short_for
    if kind == "type" or (short is not None and kind == "connector"):
        if found.node.literals:
            return ElementType("string")
        if short is None or found.outer is None:
            raise ModelicaError(
                f'{found.node.at}: this {kind} is not supported; expected a short form, as in type Torque = Real(unit="N.m")'
            )
        base = type_named(short.type, found.outer, short)
        attributes = merged(base.attributes, by_name(short.modifications))
        prefix = "input" if "input" in found.node.prefixes else base.prefix
        return replace(base, attributes=attributes, prefix=prefix)
    if kind == "connector":
        return ElementType("connector", scope=found)
    if kind in ("model", "block", "class"):
        return ElementType("part", scope=found)
    raise ModelicaError(f"{node.at}: {found.name} is a {kind}; expected a model, a block, a connector or a type")


def kind_of(node: ComponentNode, kind: ElementType, assigned: frozenset[str]) -> ElementKind:
    """Kind of a declared element; ``assigned`` are the variables assigned in when-equations."""
    if kind.kind in ("connector", "part"):
        return kind.kind
    if "constant" in node.prefixes:
        return "constant"
    if "parameter" in node.prefixes:
        return "parameter" if kind.kind == "real" and not node.dimensions else "structural"
    if kind.kind == "string":
        raise ModelicaError(f"{node.at}: '{node.name}' is a string that may vary; only parameters are read")
    if node.dimensions:
        raise ModelicaError(
            f"{node.at}: arrays of variables, such as '{node.name}', are not supported; arrays of components are"
        )
    if "input" in node.prefixes or kind.prefix == "input":
        return "input"
    if kind.kind in ("integer", "boolean") or "discrete" in node.prefixes or node.name in assigned:
        return "discrete"
    return "variable"


def element_of(kind: ElementType | None, name: str) -> tuple[bool, ElementType | None]:
    """Whether a class declares an input of that name, or an array of inputs; and the type of the element, if it is one of the text."""
    if kind is None:
        return False, None
    if (counterpart := kind.counterpart) is not None:
        local = counterpart.given.get(name) or counterpart.local(name)
        return name in counterpart.arrays or isinstance(getattr(counterpart.component, local, None), Input), None
    if kind.scope is None or (element := content_of(kind.scope, {}).elements.get(name)) is None:
        return False, None
    found = type_named(element.node.type, element.scope, element.node)
    return kind_of(element.node, found, frozenset()) == "input", found


def connector_class(scope: ClassScope) -> type[Connector]:
    """Connector class for a connector of the text.

    Raises
    ------
    ModelicaError
        It contains anything but pairs of real potentials and flows.
    """
    content = content_of(scope, {})
    members: dict[str, Any] = {}
    for name, element in content.elements.items():
        kind = type_named(element.node.type, element.scope, element.node)
        if kind.kind != "real" or element.node.dimensions or content.equations:
            raise ModelicaError(f"{element.node.at}: expected real variables in the connector {scope.name}, without equations")
        check_attributes(element.modifications)
        declared = Flow if "flow" in element.node.prefixes else Potential
        members[name] = declared(unit_of(element, kind), element.node.comment)
    if "stream" in {p for e in content.elements.values() for p in e.node.prefixes}:
        raise ModelicaError(f"{scope.node.at}: stream variables are not supported")
    return type(scope.node.name, (Connector,), {**members, "__doc__": scope.node.comment, "__module__": __name__})


def unit_of(element: DeclaredElement, kind: ElementType) -> str:
    """Unit of a real element: from its type, or its own attribute; "any" if there is none."""
    given = merged(kind.attributes, element.modifications).get("unit")
    text = getattr(given.value, "value", "") if given is not None else kind.unit
    return (unit_written(text) or "any") if isinstance(text, str) else "any"


_VALUES: Mapping[TypeKind, tuple[tuple[type, ...], str]] = {
    "real": ((int, float), "a number"), "integer": ((int,), "an Integer, a whole number"), "boolean": ((bool,), "true or false"),
    "string": ((str,), "a string, or a literal of the enumeration"),
}  # fmt: skip


def check_type(value: Any, kind: TypeKind | None, node: SyntaxNode) -> None:
    """Refuse a constant value of another type; whole numbers are real ones, too."""
    if isinstance(value, tuple):
        for each in value:
            check_type(each, kind, node)
    elif isinstance(value, (bool, int, float, str)) and kind is not None and kind in _VALUES:
        types, expected = _VALUES[kind]
        if not isinstance(value, types) or isinstance(value, bool) != (kind == "boolean"):
            raise ModelicaError(f"{node.at}: {shown(value)} is given; expected {expected}")
