"""Code generation for events: root functions of the relations, and the event iteration (update)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import relation_kernel
from gearlib.native.layout import EACH, Layout
from gearlib.native.source import CLOSING, Body, loop, looped
from gearlib.program.program import Batch
from gearlib.program.relations import Relations

Integers = NDArray[np.int64]
MOST_ITERATIONS = 100


def root_numbers(relations: Relations) -> Integers:
    """The relations that need a root search, in the order of the native root functions."""
    return relations.used[~relations.on_time]


def roots_body(relations: Relations, layout: Layout) -> Body:
    """g of each relation that compares more than time, with the sign that makes zero count as negative."""
    body = looped(relations.program, layout)
    body.lines = body.lines[:-CLOSING]
    numbers = root_numbers(relations)
    for batch in relations.batches:
        rows = np.flatnonzero(np.isin(batch.targets, numbers))
        if len(rows):
            part = batch.take(rows)
            strict, negated = relation_of(batch)
            sign = "" if strict != negated else "-"  # positive where a strict relation holds, where another one does not
            loop(body, _retarget(part, np.searchsorted(numbers, part.targets)), f"values[{{target}}] = {sign}({{value}})")
    return body


def update_body(relations: Relations, layout: Layout, n_relations: int, n_discrete: int, guards: tuple[int, int]) -> Body:
    """The event iteration.

    With the values before the event held, relations and discrete variables are evaluated until none changes; then the values before
    are set to these, and all is repeated until that changes nothing either. A relation whose root was located takes the side that it
    crossed to; it is evaluated like the others once a state has been given a new value, or once the values before have been set, if it
    compares with one of them. At the end ``fired`` holds the side of each root that goes with its relation, 2 or -2, and the signs of
    divisors, which may have jumped, are marked as old: ``guards`` tells where they stand, and how many there are.
    """
    body = looped(relations.program, layout)
    numbers = root_numbers(relations)
    head, compute, body.lines = body.lines[:2], body.lines[2:-CLOSING], []
    if any(batch.arguments.size for batch in relations.discretes):
        body.lines += compute
    for batch in relations.discretes:  # first, so that what has just become stuck is tried as locked
        loop(body, batch, "y = {value}\nif data[r + {target}] != y:\n    data[r + {target}] = y\n    changed = 1")
    body.lines += compute
    for batch in relations.batches:
        _relation_loops(body, batch, numbers)
    inner, body.lines = body.lines, []
    sizes = body.array([n_relations, n_discrete])
    for batch in relations.reinits:
        loop(body, batch, "y = {value}\nif x[{target}] != y:\n    x[{target}] = y\n    result = 2")
    reinits = body.lines
    forget = (
        ["if result == 2:", f"    for k in range({len(numbers)}):", "        fired[k] = 0"] if reinits and len(numbers) else []
    )
    body.lines = []
    for batch in relations.batches:
        _sides(body, batch, numbers)
    sides = body.lines
    old = _old_signs(body, guards)
    body.lines = [
        *head, f"h = {sizes}", "nr, nd = index[h], index[h + 1]", "result = 0", "moved = 1",
        f"for outer in range({MOST_ITERATIONS}):",
        "    changed = 1",
        f"    for iteration in range({MOST_ITERATIONS}):",
        "        changed = 0",
        *(f"        {line}" for line in inner),
        "        if changed == 0:",
        "            break",
        "        result = 1",
        "    if changed != 0:",
        "        return -1",
        "    moved = 0",
        "    for k in range(nd):",
        "        if data[r + nr + nd + k] != data[r + nr + k]:",
        "            moved = 1",
        *(f"    {line}" for line in reinits),
        *(f"    {line}" for line in forget),
        "    for k in range(nd):",
        "        data[r + nr + nd + k] = data[r + nr + k]",
        "    if moved == 0:",
        "        break",
        "    result = max(result, 1)",
        "if moved != 0:",
        "    return -1",
        *sides,
        *old,
        "return result",
    ]  # fmt: skip
    return body


def _old_signs(body: Body, guards: tuple[int, int]) -> list[str]:
    place, count = guards
    if not count:
        return []
    return [f"s = {body.array([place])}", f"for k in range({count}):", f"    data[index[s] + {EACH} * k] *= 0.5"]


def _relation_loops(body: Body, batch: Batch, numbers: Integers) -> None:
    strict, negated = relation_of(batch)
    compare = {(False, False): ">=", (True, False): ">", (False, True): "<=", (True, True): "<"}[strict, negated]
    located = np.isin(batch.targets, numbers)
    for rows, timed in ((np.flatnonzero(located), False), (np.flatnonzero(~located), True)):
        if not len(rows):
            continue
        part = batch.take(rows)
        roots = np.searchsorted(numbers, part.targets) if not timed else np.zeros(len(rows), np.int64)
        if timed:  # the right-hand limit
            body.lines += ["now = t", "t = t + 1e-12 * max(abs(t), 1e-3)"]
        _relation_loop(body, part, roots, timed, compare, strict)
        if timed:
            body.lines.append("t = now")


def _relation_loop(body: Body, part: Batch, roots: Integers, timed: bool, compare: str, strict: bool) -> None:
    lines = ["y = {value}", f"f = 1.0 if y {compare} 0.0 else 0.0"]
    if not timed:
        first = " and outer == 0" if compares_with_before(part) else ""
        lines += [f"if fired[{{extra}}] != 0{first}:", f"    f = 1.0 if fired[{{extra}}] {'>' if strict else '<'} 0 else 0.0"]
    lines += ["if data[r + {target}] != f:", "    data[r + {target}] = f", "    changed = 1"]
    loop(body, part, "\n".join(lines), extra=roots)


def _sides(body: Body, batch: Batch, numbers: Integers) -> None:
    """Side of each event function, from its relation: by rounding, the function's own sign may differ."""
    located = np.flatnonzero(np.isin(batch.targets, numbers))
    if len(located):
        part = batch.take(located)
        holds, fails = (2, -2) if relation_of(batch)[0] else (-2, 2)
        statement = f"fired[{{extra}}] = {holds} if data[r + {{target}}] != 0.0 else {fails}"
        loop(body, part, statement, extra=np.searchsorted(numbers, part.targets))


def compares_with_before(batch: Batch) -> bool:
    """Whether a discrete variable's value before the event is part of what a relation compares."""
    template, n = batch.kernel.template, len(batch.kernel.template.relations)
    return any(template.discretes[i - n].startswith("pre(") for i in batch.kernel.relations if i >= n)


def relation_of(batch: Batch) -> tuple[bool, bool]:
    """(strict, negated) of the relation that a kernel belongs to."""
    for j, relation in enumerate(batch.kernel.template.relations):
        if relation_kernel(batch.kernel.template, j) is batch.kernel:
            return relation.strict, relation.negated
    raise AssertionError("a kernel without its relation")


def _retarget(batch: Batch, targets: Integers) -> Batch:
    return Batch(
        batch.kernel, batch.equations, targets, batch.signs, batch.arguments, batch.argument_signs, batch.parameters,
        batch.relations,
    )  # fmt: skip
