"""Translation of Modelica equations to `Eq`, `When` and `connect`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gearlib.errors import GearlibWarning, ModelicaError, warn
from gearlib.language import expressions as language
from gearlib.language.component import Connection, Port, connect
from gearlib.language.expressions import Eq, Reinit, When
from gearlib.modelica.evaluation import Absent, Evaluation
from gearlib.modelica.syntax_tree import (
    ArrayNode,
    CallStatement,
    ConditionalNode,
    ConnectNode,
    EqualityNode,
    LoopNode,
    ReferenceNode,
    SyntaxNode,
)


def equations_from(node: SyntaxNode, evaluation: Evaluation) -> Iterator[Eq | When]:
    """The equations that an equation of the text stands for; connections are skipped."""
    match node:
        case EqualityNode():
            yield from _equality(node, evaluation)
        case LoopNode():
            for k in evaluation.range(node.range):
                for inner in node.body:
                    yield from equations_from(inner, evaluation.at_index(node.index, k))
        case ConditionalNode(is_when=True):
            yield from _when(node, evaluation)
        case ConditionalNode():
            yield from _conditional(node, evaluation)
        case CallStatement():
            _statement(node)


def _equality(node: EqualityNode, evaluation: Evaluation) -> Iterator[Eq]:
    if isinstance(node.left, ReferenceNode) and len(node.left.names) == 1:
        evaluation.check_assigned(node.left.names[0], node.right)
    left, right = evaluation.number(node.left), evaluation.number(node.right)
    if isinstance(left, tuple) != isinstance(right, tuple) or (isinstance(left, tuple) and len(left) != len(right)):
        raise ModelicaError(f"{node.at}: the two sides are arrays of different sizes")
    pairs = zip(left, right, strict=True) if isinstance(left, tuple) else [(left, right)]
    for a, b in pairs:
        for side, value in ((node.left, a), (node.right, b)):
            if isinstance(value, (Port, tuple)) or callable(value):
                raise ModelicaError(
                    f"{side.at}: this is not a variable; a connector's variables are equated, or connectors connected"
                )
        yield Eq(a, b)


def _branches(node: ConditionalNode, evaluation: Evaluation) -> tuple[list[tuple[Any, tuple[SyntaxNode, ...]]], bool]:
    """The branches that may be active, and whether the last one is unconditional."""
    found: list[tuple[Any, tuple[SyntaxNode, ...]]] = []
    for condition, body in node.branches:
        decided = True if condition is None else evaluation.condition(condition)
        if decided is True:
            return [*found, (True, body)], True
        if decided is not False:
            found.append((decided, body))
    return found, False


def _conditional(node: ConditionalNode, evaluation: Evaluation) -> Iterator[Eq | When]:
    branches, complete = _branches(node, evaluation)
    if complete and len(branches) == 1:
        for inner in branches[0][1]:
            yield from equations_from(inner, evaluation)
        return
    if not branches:
        return
    if not complete:
        raise ModelicaError(f"{node.at}: an if-equation whose condition may vary needs an else-branch")
    found = []
    for _, body in branches:
        equations: list[Eq] = []
        for inner in body:
            for equation in equations_from(inner, evaluation):
                if not isinstance(equation, Eq):
                    raise ModelicaError(f"{inner.at}: when-equations within if-equations are not supported")
                equations.append(equation)
        found.append(equations)
    if len({len(equations) for equations in found}) != 1:
        raise ModelicaError(f"{node.at}: the branches have different numbers of equations")
    conditions = [condition for condition, _ in branches]
    for row in zip(*found, strict=True):
        if all(equation.left == row[0].left for equation in row):
            yield Eq(row[0].left, language.Piecewise(*((e.right, c) for e, c in zip(row, conditions, strict=True))))
        else:
            yield Eq(language.Piecewise(*((e.residual, c) for e, c in zip(row, conditions, strict=True))), 0)


def _when(node: ConditionalNode, evaluation: Evaluation) -> Iterator[When]:
    found: When | None = None
    for condition, body in reversed(node.branches):
        assert condition is not None
        actions = tuple(_actions(body, evaluation))
        # any of several conditions: each becomes true on its own
        conditions = condition.items if isinstance(condition, ArrayNode) else (condition,)
        for each in reversed(conditions):
            becomes = evaluation.condition(each)
            if becomes is False:
                continue
            with node.at.in_refusals():
                found = When(becomes, *actions, elsewhen=found)
    if found is not None:
        yield found


def _actions(body: tuple[SyntaxNode, ...], evaluation: Evaluation) -> Iterator[Eq | Reinit]:
    """The actions of a branch of a when-equation."""
    for inner in body:
        if isinstance(inner, CallStatement) and inner.call.function == "reinit" and len(inner.call.arguments) == 2:
            state, value = inner.call.arguments
            yield language.reinit(evaluation.value(state), evaluation.number(value))
            continue
        for action in equations_from(inner, evaluation):
            if not isinstance(action, Eq):
                raise ModelicaError(f"{inner.at}: expected equations of discrete variables, or reinit")
            yield action


def _statement(node: CallStatement) -> None:
    name = node.call.function
    if name == "assert":
        warn(f"{node.at}: an assertion is not watched", GearlibWarning)
    else:
        raise ModelicaError(f"{node.at}: {name}() as an equation is not supported")


def assigned_in_whens(nodes: list[SyntaxNode]) -> frozenset[str]:
    """The variables assigned in when-equations."""
    found: set[str] = set()
    stack = [(node, False) for node in nodes]
    while stack:
        node, within = stack.pop()
        if isinstance(node, ConditionalNode):
            stack += [(inner, within or node.is_when) for _, body in node.branches for inner in body]
        elif isinstance(node, LoopNode):
            stack += [(inner, within) for inner in node.body]
        elif within and isinstance(node, EqualityNode) and isinstance(node.left, ReferenceNode):
            found.add(node.left.names[0])
    return frozenset(found)


def connections_from(node: SyntaxNode, evaluation: Evaluation) -> Iterator[Connection]:
    """The connections that an equation of the text states; those of absent components are skipped."""
    match node:
        case ConnectNode():
            try:
                left, right = evaluation.value(node.left), evaluation.value(node.right)
            except Absent:
                return
            if isinstance(left, tuple) != isinstance(right, tuple) or (isinstance(left, tuple) and len(left) != len(right)):
                raise ModelicaError(f"{node.at}: arrays of different sizes cannot be connected")
            for a, b in zip(left, right, strict=True) if isinstance(left, tuple) else [(left, right)]:
                with node.at.in_refusals():
                    made = connect(a, b)
                yield made
        case LoopNode():
            for k in evaluation.range(node.range):
                for inner in node.body:
                    yield from connections_from(inner, evaluation.at_index(node.index, k))
        case ConditionalNode(is_when=False):
            if _has_connections(node):
                branches, complete = _branches(node, evaluation)
                if len(branches) > 1 or (branches and not complete):
                    raise ModelicaError(f"{node.at}: connections under a condition that may vary are not supported")
                for _, body in branches:
                    for inner in body:
                        yield from connections_from(inner, evaluation)


def _has_connections(node: SyntaxNode) -> bool:
    match node:
        case ConnectNode():
            return True
        case LoopNode():
            return any(map(_has_connections, node.body))
        case ConditionalNode():
            return any(_has_connections(inner) for _, body in node.branches for inner in body)
    return False
