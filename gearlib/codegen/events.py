"""Source of event functions: what relations compare (roots), and the event iteration (update)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearlib.codegen.kernels import relation_kernel
from gearlib.codegen.layout import Layout
from gearlib.codegen.program import Batch, Relations
from gearlib.codegen.source import Body, _loop, looped

Integers = NDArray[np.int64]
MOST_ITERATIONS = 100


def root_numbers(relations: Relations) -> Integers:
    """The relations that need a root search, in the order of the native root functions."""
    return relations.used[~relations.on_time]


def roots_body(relations: Relations, layout: Layout) -> Body:
    """g of each relation that compares more than time."""
    body = looped(relations.program, layout)
    body.lines = body.lines[:-3]
    numbers = root_numbers(relations)
    for batch in relations.batches:
        rows = np.flatnonzero(np.isin(batch.targets, numbers))
        if len(rows):
            part = batch.take(rows)
            _loop(body, _retarget(part, np.searchsorted(numbers, part.targets)), "values[{target}] = {value}")
    return body


def update_body(relations: Relations, layout: Layout) -> Body:
    """Evaluate all relations until none changes; a relation whose root was located takes the side that it crossed to."""
    inner = looped(relations.program, layout)
    numbers = root_numbers(relations)
    head, inner.lines = inner.lines[:2], inner.lines[2:-3]
    for batch in relations.batches:
        relation = relation_of(batch)
        located = np.isin(batch.targets, numbers)
        for rows, timed in ((np.flatnonzero(located), False), (np.flatnonzero(~located), True)):
            if not len(rows):
                continue
            part = batch.take(rows)
            place = inner.array(np.searchsorted(numbers, part.targets) if not timed else np.zeros(len(rows), np.int64))
            if timed:
                inner.lines += ["now = t", "t = t + 1e-12 * max(abs(t), 1e-3)"]
            inner.lines.append(f"e = {place}")
            _loop(inner, part, "y = {value}")
            compare = {(False, False): ">=", (True, False): ">", (False, True): "<=", (True, True): "<"}[relation]
            side = "fired[index[e + k]] < 0" if relation[1] else "fired[index[e + k]] > 0"
            test = f"1.0 if y {compare} 0.0 else 0.0"
            inner.lines += [f"    f = {test}"]
            if not timed:
                inner.lines += ["    if fired[index[e + k]] != 0:", f"        f = 1.0 if {side} else 0.0"]
            inner.lines += [
                "    if data[r + index[o + 1 + k]] != f:",
                "        data[r + index[o + 1 + k]] = f",
                "        changed = 1",
            ]
            if timed:
                inner.lines.append("t = now")
    lines = [
        *head, "any_change = 0", f"for iteration in range({MOST_ITERATIONS}):", "    changed = 0",
        *(f"    {line}" for line in inner.lines),
        "    if changed == 0:", "        return any_change", "    any_change = 1", "return -1",
    ]  # fmt: skip
    inner.lines = lines
    return inner


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
