"""Name resolution of classes: enclosing classes, imports and the standard library."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from gearlib.errors import ModelicaError
from gearlib.modelica.syntax_tree import ClassNode, ExtendsNode, ImportNode, Modification, TextNode

Path = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ClassScope:
    """A class of the text with its full name and enclosing scope; the outermost scope holds the text's classes."""

    node: ClassNode
    path: Path
    outer: ClassScope | None
    within: Path = ()
    is_known: Callable[[Path], bool] = lambda path: False  # whether the standard library has that name
    replaced: Mapping[str, ClassScope] = field(default_factory=dict)  # redeclared classes
    kept: tuple[Modification, ...] = ()  # modifications of the class that it redeclares

    @property
    def name(self) -> str:
        return ".".join(self.path)

    def inner(self, name: str) -> ClassScope | None:
        """A class declared within this one, excluding inherited ones."""
        if name in self.replaced:
            return self.replaced[name]
        found = self.node.classes.get(name)
        return None if found is None else ClassScope(found, (*self.path, name), self)

    def upwards(self) -> Iterator[ClassScope]:
        """The scope itself and the enclosing ones."""
        scope: ClassScope | None = self
        while scope is not None:
            yield scope
            scope = scope.outer

    @property
    def root(self) -> ClassScope:
        """The outermost scope."""
        return list(self.upwards())[-1]


def outermost(text: TextNode, is_known: Callable[[Path], bool]) -> ClassScope:
    """The scope of a whole text."""
    classes: dict[str, ClassNode] = {}
    for node in text.classes:
        if node.name in classes:
            raise ModelicaError(f"{node.at}: the class {node.name} is declared twice")
        classes[node.name] = node
    return ClassScope(ClassNode(text.at, "package", "", classes=classes), (), None, text.within, is_known)


def lookup(names: Path, scope: ClassScope) -> ClassScope | Path:
    """Resolve a name to a class of the text, or else to a full name, possibly one of the library.

    Parameters
    ----------
    names : tuple of str
        For example ``("Rotational", "Components", "Inertia")``.
    scope : ClassScope
        Where the name is used.
    """
    first, rest = names[0], names[1:]
    for level in scope.upwards():
        if (found := member(level, first)) is not None:
            return descended(found, rest) or names
        imports = [e for e in level.node.elements if isinstance(e, ImportNode)]
        for element in imports:
            if element.alias == first:
                return from_top((*element.path, *rest), scope)
        for element in imports:
            if element.alias == "*":
                package = from_top(element.path, scope)
                if isinstance(package, ClassScope):
                    if (found := descended(package, names)) is not None:
                        return found
                elif scope.root.is_known((*package, *names)):
                    return (*package, *names)
    return from_top(names, scope)


def from_top(names: Path, scope: ClassScope) -> ClassScope | Path:
    """Resolve a full name; within a package, also a name relative to it."""
    root = scope.root
    within = root.within
    if names[: len(within)] == within and (found := descended(root, names[len(within) :])) is not None:
        return found
    if (found := descended(root, names)) is not None:
        return found
    for k in range(len(within), 0, -1):
        if root.is_known((*within[:k], *names)):
            return (*within[:k], *names)
    return names


def descended(scope: ClassScope, names: Path) -> ClassScope | None:
    """The class at a path below a class."""
    for name in names:
        inner = member(scope, name)
        if inner is None:
            return None
        scope = inner
    return scope if names or scope.outer is not None else None


def member(scope: ClassScope, name: str) -> ClassScope | None:
    """A class declared in a class or inherited by it."""
    if (found := scope.inner(name)) is not None:
        return found
    for base in bases(scope):
        if (inherited := member(base, name)) is not None:
            return inherited
    return None


def bases(scope: ClassScope) -> list[ClassScope]:
    """The classes of the text that a class extends, with their names resolved in its enclosing scope."""
    if scope.outer is None:
        return []
    named = [e.type for e in scope.node.elements if isinstance(e, ExtendsNode)]
    if scope.node.short_for is not None:
        named.append(scope.node.short_for.type)
    found = [lookup(names, scope.outer) for names in named]
    return [base for base in found if isinstance(base, ClassScope) and base.node is not scope.node]
