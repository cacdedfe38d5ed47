"""Contents of a Modelica class including everything inherited, with modifications applied."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from gearlib.errors import ModelicaError, nearest
from gearlib.modelica.counterparts import Counterpart, standard_library
from gearlib.modelica.scopes import ClassScope, lookup, member
from gearlib.modelica.syntax_tree import ClassNode, ComponentNode, ExtendsNode, Modification, SyntaxNode

Modifications = Mapping[str, Modification]
ATTRIBUTES = ("start", "fixed", "nominal", "stateSelect", "displayUnit", "quantity", "unit", "min", "max", "unbounded")
_EMPTY_BASES = ("Modelica.Icons.", "Modelica.Mechanics.Rotational.Icons.", "Modelica.Blocks.Icons.")  # icons only


@dataclass(frozen=True)
class DeclaredElement:
    """A declared component of a class, the scope in which its type is resolved, and its modifications."""

    node: ComponentNode
    scope: ClassScope
    modifications: Modifications


@dataclass(frozen=True)
class Stated:
    """An equation with the scope in which it is written."""

    node: SyntaxNode
    scope: ClassScope


@dataclass
class Content:
    """All elements and equations of a class, including inherited ones."""

    elements: dict[str, DeclaredElement] = field(default_factory=dict)
    equations: list[Stated] = field(default_factory=list)
    initial_equations: list[Stated] = field(default_factory=list)
    library_bases: list[tuple[Counterpart, Modifications]] = field(default_factory=list)


def content_of(scope: ClassScope, modifications: Modifications) -> Content:
    """Contents of a class under modifications.

    Raises
    ------
    ModelicaError
        A class that extends itself or an unsupported class, contradictory elements, or a modification of an element that the class does
        not have.
    """
    found = Content()
    used: set[str] = set()
    _collect(scope, modifications, found, used, ())
    _check_used(modifications, used, scope, found)
    return found


def _check_used(modifications: Modifications, used: set[str], scope: ClassScope, found: Content) -> None:
    for name, m in modifications.items():
        if name not in used and not found.library_bases:  # which say themselves what they do not have
            raise ModelicaError(f"{m.at}: {scope.name} has no element '{name}' to be modified; {nearest(name, found.elements)}")


def _collect(scope: ClassScope, given: Modifications, found: Content, used: set[str], above: tuple[ClassNode, ...]) -> None:
    if scope.node in above:
        raise ModelicaError(f"{scope.node.at}: {scope.name} extends itself")
    above = (*above, scope.node)
    if scope.node.short_for is not None:
        short = scope.node.short_for
        _extend(replace(short, modifications=(*scope.kept, *short.modifications)), scope, given, found, used, above)
        return
    for element in scope.node.elements:
        if isinstance(element, ExtendsNode):
            _extend(element, scope, given, found, used, above)
        elif isinstance(element, ComponentNode) and "redeclare" not in element.prefixes:
            used.add(element.name)
            made = _modified(element, scope, given.get(element.name))
            if element.name in found.elements and found.elements[element.name].node != element:
                raise ModelicaError(f"{element.at}: '{element.name}' is declared twice")
            found.elements[element.name] = made
    used.update(scope.node.classes)
    found.equations += [Stated(e, scope) for e in scope.node.equations]
    found.initial_equations += [Stated(e, scope) for e in scope.node.initial_equations]


def _extend(
    base: ExtendsNode, scope: ClassScope, given: Modifications, found: Content, used: set[str], above: tuple[ClassNode, ...]
) -> None:
    around = scope.outer
    named = lookup(base.type, scope if scope.node.short_for is None else around or scope)
    written = merged(qualified(base.modifications, scope), qualified(_redeclarations(scope.node), scope))
    own = merged(written, given)
    if isinstance(named, ClassScope):
        inherited: set[str] = set()
        _collect(with_classes(named, own, scope), own, found, inherited, above)
        _check_used(written, inherited, named, found)
        used |= inherited
        return
    path = ".".join(named)
    if path.startswith(_EMPTY_BASES):
        return
    counterpart = standard_library().counterparts.get(path)
    if counterpart is None:
        raise ModelicaError(f"{base.at}: the class {path} is not known; {nearest(path, standard_library().counterparts)}")
    found.library_bases.append((counterpart, own))


def _redeclarations(node: ClassNode) -> Iterator[Modification]:
    """The elements of a class that redeclare inherited ones."""
    for new in (*node.elements, *node.classes.values()):
        if isinstance(new, (ComponentNode, ClassNode)) and "redeclare" in new.prefixes:
            yield Modification(new.at, (new.name,), redeclared=new)


def with_classes(scope: ClassScope, modifications: Modifications, where: ClassScope) -> ClassScope:
    """A class with some of its local classes replaced by redeclarations."""
    replaced = {
        name: _redeclared(m.redeclared, name, scope, where)
        for name, m in modifications.items()
        if isinstance(m.redeclared, ClassNode)
    }
    return replace(scope, replaced={**scope.replaced, **replaced}) if replaced else scope


def _kept(node: ClassNode | ComponentNode) -> tuple[Modification, ...]:
    """Modifications of a declaration that hold for its redeclarations, too."""
    if node.constraint is not None:
        return node.constraint
    if isinstance(node, ComponentNode):
        return node.modifications
    return () if node.short_for is None else node.short_for.modifications


def _redeclared(new: ClassNode, name: str, scope: ClassScope, where: ClassScope) -> ClassScope:
    old = member(replace(scope, replaced={}), name)  # as it was declared
    kept = () if old is None else _kept(old.node)
    if kept and new.short_for is None:
        raise ModelicaError(f"{new.at}: only a short class can redeclare one that is declared with modifications")
    return ClassScope(new, (*scope.path, name), where, kept=kept)


def _modified(node: ComponentNode, scope: ClassScope, modification: Modification | None) -> DeclaredElement:
    own = qualified(node.modifications, scope)
    if modification is None:
        return DeclaredElement(node, scope, own)
    if "constant" in node.prefixes:
        raise ModelicaError(f"{modification.at}: {node.name} is a constant, and cannot be modified")
    if "final" in node.prefixes and modification.value is not None:
        raise ModelicaError(f"{modification.at}: {node.name} is final, and cannot be modified")
    if isinstance(modification.redeclared, ComponentNode):
        new = modification.redeclared
        prefixes = node.prefixes | new.prefixes
        kept = replace(new, prefixes=prefixes, condition=node.condition, dimensions=new.dimensions or node.dimensions)
        return DeclaredElement(kept, scope, merged(qualified(_kept(node), scope), by_name(new.modifications)))
    value = node.value if modification.value is None else modification.value
    return DeclaredElement(replace(node, value=value), scope, merged(own, by_name(modification.inner)))


def qualified(modifications: Iterable[Modification], scope: ClassScope) -> Modifications:
    """Modifications by name, with redeclared classes as full names."""
    return {name: _qualified(m, scope) for name, m in by_name(modifications).items()}


def _qualified(m: Modification, scope: ClassScope) -> Modification:
    new = m.redeclared
    if isinstance(new, ComponentNode):
        found = lookup(new.type, scope)
        path = found.path if isinstance(found, ClassScope) else found
        return replace(m, redeclared=replace(new, type=path, modifications=tuple(qualified(new.modifications, scope).values())))
    return replace(m, inner=tuple(_qualified(inner, scope) for inner in m.inner)) if m.inner else m


def by_name(modifications: Iterable[Modification]) -> Modifications:
    """Modifications by the first part of their names; ``a.b = 1`` is ``a(b = 1)``."""
    found: dict[str, Modification] = {}
    for m in modifications:
        first, *rest = m.name
        if rest:
            m = Modification(m.at, (first,), None, (replace(m, name=tuple(rest)),))
        found[first] = _joined(found[first], m) if first in found else m
    return found


def check_attributes(modifications: Modifications) -> None:
    """Refuse what is no attribute of a variable or a parameter, and what has no value."""
    for name, m in modifications.items():
        if name not in ATTRIBUTES:
            raise ModelicaError(f"{m.at}: '{name}' is not an attribute of a variable; {nearest(name, ATTRIBUTES)}")
        given_value(m)


def given_value(m: Modification) -> SyntaxNode:
    """The value of a modification that must have one."""
    if m.value is None:
        raise ModelicaError(f"{m.at}: '{'.'.join(m.name)}' has no value; expected one, as in {'.'.join(m.name)} = 1")
    return m.value


def merged(inner: Modifications, outer: Modifications) -> Modifications:
    """Merge modifications of a class with those of a class that uses it; the latter take precedence."""
    found = dict(inner)
    for name, m in outer.items():
        found[name] = _joined(found[name], m) if name in found else m
    return found


def _joined(inner: Modification, outer: Modification) -> Modification:
    if inner.final and outer.value is not None:
        raise ModelicaError(f"{outer.at}: {'.'.join(outer.name)} is final, and cannot be modified")
    if outer.redeclared is not None:
        return outer
    within = merged(by_name(inner.inner), by_name(outer.inner))
    return replace(
        outer, value=inner.value if outer.value is None else outer.value, inner=tuple(within.values()), redeclared=inner.redeclared,
        each=outer.each or (outer.value is None and inner.each),
    )  # fmt: skip
