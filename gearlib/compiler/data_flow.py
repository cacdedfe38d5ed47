"""Data-flow analysis of loops: loop-carried names, and whether the iterations are independent (vectorisable)."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Sequence

ELEMENTWISE = (  # operations that have vector forms
    ast.Assign, ast.BinOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.UnaryOp, ast.USub, ast.Constant, ast.Name, ast.Subscript,
    ast.expr_context,
)  # fmt: skip


def carried(statement: ast.For | ast.While) -> set[str]:
    r"""Loop-carried names: their value from before the loop, or from the previous iteration, is live in the body or after it.

    >>> loop, = ast.parse("for k in range(n):\n    a = b[k]\n    s += a\n    if a > 0:\n        z = a").body
    >>> sorted(carried(loop))
    ['s', 'z']
    """
    read: set[str] = set() if isinstance(statement, ast.For) else _loaded(statement.test)
    leaving: list[set[str]] = []
    end = _follow(statement.body, _names([statement.target]) if isinstance(statement, ast.For) else set(), read, leaving)
    given, anew = _everywhere([end, *leaving]), stored(statement.body)
    return anew & (read | (anew - given))


def stored(statements: Iterable[ast.stmt]) -> set[str]:
    """Names assigned anywhere in some statements."""
    found: set[str] = set()
    for statement in statements:
        if isinstance(statement, ast.If):
            found |= stored(statement.body) | stored(statement.orelse)
        elif isinstance(statement, ast.For):
            found |= stored(statement.body) | _names([statement.target])
        elif isinstance(statement, ast.While):
            found |= stored(statement.body)
        elif isinstance(statement, ast.Assign):
            found |= _names(statement.targets)
        elif isinstance(statement, (ast.AugAssign, ast.AnnAssign)):
            found |= _names([statement.target])
    return found


def _names(targets: Iterable[ast.expr]) -> set[str]:
    parts = [part for target in targets for part in (target.elts if isinstance(target, ast.Tuple) else [target])]
    return {part.id for part in parts if isinstance(part, ast.Name)}


def is_never_empty(call: ast.expr) -> bool:
    """Whether a range has constant bounds and at least one iteration."""
    if not (isinstance(call, ast.Call) and all(isinstance(a, ast.Constant) and isinstance(a.value, int) for a in call.args)):
        return False
    return len(range(*(a.value for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, int)))) > 0


def _loaded(node: ast.AST) -> set[str]:
    """Names that are read; takes less than half the time of `ast.walk`."""
    found: set[str] = set()
    pending: list[object] = [node]
    while pending:
        one = pending.pop()
        if isinstance(one, ast.Name):
            if isinstance(one.ctx, ast.Load):
                found.add(one.id)
        elif isinstance(one, list):
            pending += one
        elif isinstance(one, (ast.expr, ast.stmt)) and not isinstance(one, ast.Constant):
            pending += [getattr(one, name) for name in one._fields]
    return found


def _everywhere(ways: Sequence[set[str] | None]) -> set[str]:
    """Names that are assigned on every reachable path."""
    taken = [way for way in ways if way is not None]
    return set.intersection(*taken) if taken else set()


def _follow(statements: Sequence[ast.stmt], given: set[str], read: set[str], leaving: list[set[str]]) -> set[str] | None:
    """Names assigned at the end, None where it is unreachable; names read before assignment are added to ``read``."""
    for statement in statements:
        if isinstance(statement, ast.If):
            read |= _loaded(statement.test) - given
            ways = [_follow(part, set(given), read, leaving) for part in (statement.body, statement.orelse)]
            if ways == [None, None]:
                return None
            given = _everywhere(ways)
        elif isinstance(statement, ast.For):
            read |= _loaded(statement.iter) - given
            inside: list[set[str]] = []
            end = _follow(statement.body, given | _names([statement.target]), read, inside)
            if is_never_empty(statement.iter):
                given = _everywhere([end, *inside])
        elif isinstance(statement, ast.While):
            read |= _loaded(statement.test) - given
            _follow(statement.body, set(given), read, [])
        else:
            read |= _loaded(statement) - given
            if isinstance(statement, ast.AugAssign) and isinstance(statement.target, ast.Name):
                read |= {statement.target.id} - given
            if isinstance(statement, (ast.Break, ast.Continue)):
                leaving.append(given)
                return None
            if isinstance(statement, ast.Return):
                return None
            given = given | stored([statement])
    return given


def is_elementwise(statement: ast.For, target: str) -> bool:
    r"""Whether the body is elementwise: each iteration stores one array element, with indices of stride one or loop-invariant.

    >>> loops = ast.parse("for k in r: y[a + k] = 2 * x[k] - x[b]\nfor k in r: y[k] = x[2 * k]\nfor k in r: y[k] = x[k] * k").body
    >>> [is_elementwise(loop, "k") for loop in loops]
    [True, False, False]
    """
    body = statement.body[0]
    if len(statement.body) > 1 or not isinstance(body, ast.Assign) or not isinstance(body.targets[0], ast.Subscript):
        return False
    nodes = list(ast.walk(body))
    subscripts = [node for node in nodes if isinstance(node, ast.Subscript)]
    inside = sum(isinstance(n, ast.Name) and n.id == target for s in subscripts for n in ast.walk(s.slice))
    return (
        all(isinstance(node, ELEMENTWISE) for node in nodes)
        and all(_grows_by_one(s.slice, target) or not grows_with(s.slice, target) for s in subscripts)
        and sum(isinstance(n, ast.Name) and n.id == target for n in nodes) == inside
        and grows_with(body.targets[0].slice, target)
    )


def grows_with(index: ast.expr, target: str) -> bool:
    return any(isinstance(node, ast.Name) and node.id == target for node in ast.walk(index))


def _grows_by_one(index: ast.expr, target: str) -> bool:
    """Whether an index is ``k`` plus a loop-invariant expression (stride one)."""
    if isinstance(index, ast.BinOp) and isinstance(index.op, ast.Add):
        grows = [side for side in (index.left, index.right) if grows_with(side, target)]
        return len(grows) == 1 and _grows_by_one(grows[0], target)
    return isinstance(index, ast.Name) and index.id == target
