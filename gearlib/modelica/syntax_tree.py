"""Syntax tree of Modelica: expressions, equations, declarations, classes, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field

from gearlib.modelica.lexer import TextPlace


@dataclass(frozen=True)
class SyntaxNode:
    """Base of all nodes, with the position of the construct."""

    at: TextPlace


@dataclass(frozen=True)
class NumberNode(SyntaxNode):
    """A numeric literal; an integer if it has neither point nor exponent."""

    value: float | int


@dataclass(frozen=True)
class StringNode(SyntaxNode):
    """A string."""

    value: str


@dataclass(frozen=True)
class TruthNode(SyntaxNode):
    """``true`` or ``false``."""

    value: bool


@dataclass(frozen=True)
class ReferenceNode(SyntaxNode):
    """A name with its subscripts: ``body[2].flange_a.phi``."""

    names: tuple[str, ...]
    subscripts: tuple[tuple[SyntaxNode, ...], ...]  # per identifier

    def __str__(self) -> str:
        return ".".join(self.names)


@dataclass(frozen=True)
class CallNode(SyntaxNode):
    """A function call: ``sin(x)``, ``der(w)``, ``pre(mode)``."""

    function: str
    arguments: tuple[SyntaxNode, ...]
    named: tuple[tuple[str, SyntaxNode], ...] = ()


@dataclass(frozen=True)
class OperationNode(SyntaxNode):
    """An operator with one or two operands."""

    operator: str
    operands: tuple[SyntaxNode, ...]


@dataclass(frozen=True)
class ChoiceNode(SyntaxNode):
    """``if c then a elseif d then b else e``."""

    branches: tuple[tuple[SyntaxNode, SyntaxNode], ...]  # condition, value
    otherwise: SyntaxNode


@dataclass(frozen=True)
class RangeNode(SyntaxNode):
    """``first : last`` or ``first : step : last``; a bare colon has no bounds."""

    first: SyntaxNode | None = None
    step: SyntaxNode | None = None
    last: SyntaxNode | None = None


@dataclass(frozen=True)
class ArrayNode(SyntaxNode):
    """``{a, b}``, or ``[a, b; c, d]`` as rows."""

    items: tuple[SyntaxNode, ...]


@dataclass(frozen=True)
class ComprehensionNode(SyntaxNode):
    """``{value for i in range}``."""

    value: SyntaxNode
    index: str
    range: SyntaxNode


@dataclass(frozen=True)
class GivenNode(SyntaxNode):
    """A value that the enclosing class passes to a nested part under a name of its own; a signal may vary with time."""

    name: str
    is_signal: bool = False


# ---------------------------------------------------------------- equations


@dataclass(frozen=True)
class EqualityNode(SyntaxNode):
    """``left = right``."""

    left: SyntaxNode
    right: SyntaxNode


@dataclass(frozen=True)
class ConnectNode(SyntaxNode):
    """``connect(a, b)``."""

    left: ReferenceNode
    right: ReferenceNode


@dataclass(frozen=True)
class LoopNode(SyntaxNode):
    """``for i in range loop ... end for``."""

    index: str
    range: SyntaxNode
    body: tuple[SyntaxNode, ...]


@dataclass(frozen=True)
class ConditionalNode(SyntaxNode):
    """``if c then ... elseif d then ... else ... end if`` or, for ``when``, with ``elsewhen``; no condition: else."""

    branches: tuple[tuple[SyntaxNode | None, tuple[SyntaxNode, ...]], ...]
    is_when: bool


@dataclass(frozen=True)
class CallStatement(SyntaxNode):
    """A function call used as an equation: ``reinit(w, 0)``, ``assert(...)``."""

    call: CallNode


# ---------------------------------------------------------------- declarations


@dataclass(frozen=True)
class Modification(SyntaxNode):
    """``J = 2``, ``w(start = 1, fixed = true)``, ``redeclare Fan load``."""

    name: tuple[str, ...]
    value: SyntaxNode | None = None
    inner: tuple[Modification, ...] = ()
    each: bool = False
    final: bool = False
    redeclared: ComponentNode | ClassNode | None = None


@dataclass(frozen=True)
class ComponentNode(SyntaxNode):
    """One declared component, variable or parameter."""

    name: str
    type: tuple[str, ...]
    prefixes: frozenset[str] = frozenset()  # parameter, constant, discrete, input, output, flow, final, inner, outer, ...
    dimensions: tuple[SyntaxNode, ...] = ()
    modifications: tuple[Modification, ...] = ()
    value: SyntaxNode | None = None
    condition: SyntaxNode | None = None
    comment: str = ""
    constraint: tuple[Modification, ...] | None = None  # what redeclarations keep; None: all of its modifications


@dataclass(frozen=True)
class ExtendsNode(SyntaxNode):
    """``extends Base(modifications)``."""

    type: tuple[str, ...]
    modifications: tuple[Modification, ...] = ()


@dataclass(frozen=True)
class ImportNode(SyntaxNode):
    """``import A.B``, ``import C = A.B``, ``import A.B.*``, ``import A.{B, C}``."""

    path: tuple[str, ...]
    alias: str = ""  # "*" for all


@dataclass(frozen=True, eq=False)
class ClassNode(SyntaxNode):
    """A class: its elements, equations and local classes; or, in short form, another class with modifications."""

    kind: str  # model, block, class, connector, package, type, record, function
    name: str
    prefixes: frozenset[str] = frozenset()
    elements: tuple[ComponentNode | ExtendsNode | ImportNode, ...] = ()
    classes: dict[str, ClassNode] = field(default_factory=dict)
    equations: tuple[SyntaxNode, ...] = ()
    initial_equations: tuple[SyntaxNode, ...] = ()
    comment: str = ""
    short_for: ExtendsNode | None = None
    literals: tuple[str, ...] = ()  # of an enumeration
    constraint: tuple[Modification, ...] | None = None  # as that of a component


@dataclass(frozen=True)
class TextNode(SyntaxNode):
    """A whole text: the ``within`` clause, and the classes in order."""

    within: tuple[str, ...]
    classes: tuple[ClassNode, ...]
