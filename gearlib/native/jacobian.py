"""Code generation for the analytic Jacobian: forward accumulation of partial derivatives over a fixed sparsity pattern.

Every slot has a row of derivatives with respect to the states that it depends on; the rows lie one after another in ``data``. The
lists say, for each instance, which entry is multiplied into which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import derivative_of
from gearlib.native.layout import Layout
from gearlib.native.source import CLOSING, Body, loop, looped, sign_groups
from gearlib.program.program import Batch, Linear, Newton, Program

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Pattern:
    """Sparsity of the Jacobian (CSC), and where each slot's row of derivatives lies."""

    indptr: Integers
    indices: Integers
    rows: tuple[tuple[int, ...], ...]  # of each slot: the states it depends on
    first: Integers  # of each slot: its first entry
    size: int


def pattern_of(program: Program) -> Pattern:
    """Which states each slot depends on, and the pattern of the outputs."""
    n = len(program.states)
    rows: list[tuple[int, ...]] = [(i,) if i < n else () for i in range(program.n_slots)]
    for step in program.steps:
        if isinstance(step, Batch):
            active = _active(step)
            for i, target in enumerate(step.targets.tolist()):
                rows[target] = _union(rows, [step.arguments[i, a] for a in active if step.argument_signs[i, a]])
        elif isinstance(step, Linear):
            union = _union(rows, step.known.tolist())
            for u in step.unknowns.tolist():
                rows[u] = union
        else:
            inside = set(step.unknowns.tolist())
            outside = {
                int(b.arguments[i, a])
                for b in step.residuals
                for a in _active(b)
                for i in range(len(b))
                if b.argument_signs[i, a]
            }
            union = _union(rows, sorted(outside - inside))
            for u in step.unknowns.tolist():
                rows[u] = union
    first = np.cumsum([0, *(len(r) for r in rows)])
    pairs = sorted((state, i) for i, slot in enumerate(program.output_slots.tolist()) for state in rows[slot])
    indptr = np.zeros(n + 1, np.int64)
    np.cumsum(np.bincount([s for s, _ in pairs], minlength=n), out=indptr[1:])
    return Pattern(indptr, np.array([i for _, i in pairs], np.int64), tuple(rows), first[:-1], int(first[-1]))


def _active(batch: Batch) -> list[int]:
    return [a for a, c in enumerate(batch.kernel.columns) if not derivative_of(batch.kernel, c).is_zero]


def _union(rows: Sequence[tuple[int, ...]], slots: Sequence[int]) -> tuple[int, ...]:
    found = {rows[int(s)] for s in slots}
    if len(found) == 1:
        return found.pop()
    return tuple(sorted(set().union(*found))) if found else ()


def jacobian_body(program: Program, layout: Layout, pattern: Pattern) -> tuple[Body, int]:
    """The body of the native Jacobian, and how large ``data`` must be for it."""
    body = looped(program, layout)
    body.lines = body.lines[:-CLOSING]  # no derivatives of states are stored
    at = layout.size + body.n_coefficients
    seeds = body.array([pattern.first[i] for i in range(len(program.states))])
    head = body.array([at, pattern.size])
    body.lines += [
        f"h, a = {head}, {seeds}",
        "d = index[h]",
        "for k in range(index[h + 1]):",
        "    data[d + k] = 0.0",
        "for k in range(n):",
        "    data[d + index[a + k]] = 1.0",
    ]
    pieces: list[Body] = []
    block = 0
    for step in program.steps:
        if isinstance(step, Batch):
            for a in _active(step):
                pieces += _accumulate(body, step, a, pattern)
            continue
        pieces.append(body.piece())
        if isinstance(step, Linear):
            _combine(pieces[-1], step, layout.solutions[block], layout.needed[block], pattern)
            block += 1
        else:
            _implicit(pieces[-1], step, pattern)
    body.include_all(pieces)
    slots = program.output_slots.tolist()
    place = {s: {j: int(pattern.first[s]) + k for k, j in enumerate(pattern.rows[s])} for s in slots}
    out = [
        place[slots[pattern.indices[q]]][j]
        for j in range(len(program.states))
        for q in range(pattern.indptr[j], pattern.indptr[j + 1])
    ]
    source = body.array(out)
    count = body.array([len(out)])
    body.lines += [f"a, h = {source}, {count}", "for k in range(index[h]):", "    values[k] = data[d + index[a + k]]"]
    return body, at + pattern.size


def _derivative_batch(batch: Batch, a: int) -> Batch:
    kernel = derivative_of(batch.kernel, batch.kernel.columns[a])
    x = [batch.kernel.columns.index(c) for c in kernel.columns]
    p = [batch.kernel.parameters.index(c) for c in kernel.parameters]
    r = [batch.kernel.relations.index(c) for c in kernel.relations]
    return Batch(
        kernel, batch.equations, batch.targets, batch.signs * batch.argument_signs[:, a], batch.arguments[:, x],
        batch.argument_signs[:, x], batch.parameters[:, p], batch.relations[:, r],
    )  # fmt: skip


def _accumulate(body: Body, batch: Batch, a: int, pattern: Pattern) -> list[Body]:
    keep = np.flatnonzero(batch.argument_signs[:, a])
    if not len(keep):
        return []
    part = _derivative_batch(batch.take(keep), a)
    pointer, source, target = [0], [], []
    for i in keep.tolist():
        to, of = int(batch.targets[i]), int(batch.arguments[i, a])
        place = {s: q for q, s in enumerate(pattern.rows[to])}
        for q, state in enumerate(pattern.rows[of]):
            source.append(int(pattern.first[of]) + q)
            target.append(int(pattern.first[to]) + place[state])
        pointer.append(len(source))
    return _chain(body, part, pointer, source, target)


def _chain(body: Body, part: Batch, pointer: list[int], source: list[int], target: list[int]) -> list[Body]:
    """Loops over instances and, inside, over the entries that each contributes to."""
    pieces = []
    if body.literal:
        piece = body.piece()
        for i in range(len(part)):
            loop(piece, part.take(np.array([i])), "y = {value}")
            piece.lines += [f"data[d + {target[q]}] += y * data[d + {source[q]}]" for q in range(pointer[i], pointer[i + 1])]
        return [piece]
    for rows in sign_groups(part):
        entries = [range(pointer[i], pointer[i + 1]) for i in rows.tolist()]
        piece = body.piece()
        p = piece.array(np.cumsum([0, *(len(e) for e in entries)]))
        f = piece.array([source[q] for e in entries for q in e])
        g = piece.array([target[q] for e in entries for q in e])
        piece.lines.append(f"p, f, g = {p}, {f}, {g}")
        loop(
            piece, part.take(rows),
            "y = {value}\nfor j in range(index[p + {row}], index[p + {row} + 1]):\n"
            "    data[d + index[g + j]] += y * data[d + index[f + j]]",
        )  # fmt: skip
        pieces.append(piece)
    return pieces


def _combine(body: Body, step: Linear, at: int, needed: Integers, pattern: Pattern) -> None:
    number, source, target = [], [], []
    for i, row in enumerate(needed.tolist()):
        to = int(step.unknowns[row])
        place = {s: q for q, s in enumerate(pattern.rows[to])}
        for j, of in enumerate(step.known.tolist()):
            for q, state in enumerate(pattern.rows[of]):
                number.append(at + i * len(step.known) + j)
                source.append(int(pattern.first[of]) + q)
                target.append(int(pattern.first[to]) + place[state])
    head = body.array([len(number)])
    body.lines += [
        f"p, f, g, a = {body.array(number)}, {body.array(source)}, {body.array(target)}, {head}",
        "for j in range(index[a]):",
        "    data[d + index[g + j]] += data[index[p + j]] * data[d + index[f + j]]",
    ]


def _implicit(body: Body, step: Newton, pattern: Pattern) -> None:
    """Implicit differentiation of a Newton block: dz = -inverse(J) (dr/dx), solved column by column."""
    n = len(step.unknowns)
    inside = set(step.unknowns.tolist())
    seeds = pattern.rows[int(step.unknowns[0])]
    place = {s: q for q, s in enumerate(seeds)}
    first = [int(pattern.first[u]) for u in step.unknowns]
    for batch in step.residuals:
        for a in _active(batch):
            keep = np.array(
                [i for i in range(len(batch)) if batch.argument_signs[i, a] and int(batch.arguments[i, a]) not in inside],
                np.int64,
            )
            if not len(keep):
                continue
            part = _derivative_batch(batch.take(keep), a)
            pointer, source, target = [0], [], []
            for i in keep.tolist():
                of, row = int(batch.arguments[i, a]), int(batch.targets[i])
                for q, state in enumerate(pattern.rows[of]):
                    source.append(int(pattern.first[of]) + q)
                    target.append(first[row] + place[state])  # the row's own entries hold -dr/dx until they are solved
                pointer.append(len(source))
            for piece in _chain(body, part, pointer, source, target):
                body.include(piece)
    unknowns, head = body.array(first), body.array([n, len(seeds), step.lead])
    body.lines += [
        f"a, h = {unknowns}, {head}",
        "q, lead = index[h], index[h + 2]",
        "for l in range(index[h + 1]):",
        "    for k in range(q * q):",
        "        data[w + q + k] = 0.0",
    ]
    for batch in step.jacobian:
        loop(body, batch, "data[w + q + {target}] += {value}", "    ")
    body.lines += [
        "    for k in range(q):",
        "        data[w + k] = -data[d + index[a + k] + l]",
        "    if solve(data, w + q, w, q, lead) != 0:",
        "        return 1",
        "    for k in range(q):",
        "        data[d + index[a + k] + l] = data[w + k]",
    ]
