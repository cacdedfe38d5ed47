"""Code generation for derivatives, such as the analytic Jacobian: sparse forward accumulation, following a plan.

The entries of a plan are stored consecutively in ``data``. Each factor is computed once and multiplied into all entries that it
contributes to; integer lists hold the sparsity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.native.layout import Layout
from gearlib.native.source import CLOSING, Body, entries_of, loop, looped, sign_groups
from gearlib.native.sparse_solve import factors_size, pattern_array
from gearlib.program.derivative_plan import DerivativePlan, Solved, Sums
from gearlib.program.program import Batch, Linear, Newton, Program

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Pattern:
    """Sparsity pattern of a derivative matrix, in compressed sparse columns."""

    indptr: Integers
    indices: Integers
    size: int  # entries computed, intermediate ones included
    plans: dict[Any, Any] = field(default_factory=dict)  # storage plans of solvers, cached by their requests


def pattern_of(plan: DerivativePlan, tangents: int = 0) -> Pattern:
    """Sparsity pattern of what a plan computes: one row per wanted slot, one column per seed.

    ``tangents``: number of tangents per state, which follow the states; the matrix is repeated on the diagonal for each of them. The
    off-diagonal blocks, second derivatives, are left out: Newton's method converges without them.
    """
    counts = np.bincount(plan.seeds, minlength=plan.n_seeds)
    rows = plan.rows[plan.by_column]
    if tangents:
        entry, copy = _with_copies(plan, tangents)
        rows, n = rows[entry], len(plan.wanted)
        rows = np.where(copy < 0, rows, n + rows * tangents + copy)
        counts = np.concatenate([counts, counts.repeat(tangents)])
    return Pattern(np.concatenate([[0], np.cumsum(counts)]), rows, plan.n_entries)


def _with_copies(plan: DerivativePlan, tangents: int) -> tuple[Integers, Integers]:
    """Entries column by column, of the matrix and then of the copies of its columns, and the copy that each belongs to (-1: none)."""
    ends = np.cumsum(np.bincount(plan.seeds, minlength=plan.n_seeds))
    columns = np.split(np.arange(len(plan.seeds)), ends[:-1])
    repeated = [np.tile(column, tangents) for column in columns]
    copies = [np.arange(tangents).repeat(len(column)) for column in columns]
    return np.concatenate([np.arange(len(plan.seeds)), *repeated]), np.concatenate([np.full(len(plan.seeds), -1), *copies])


def jacobian_body(program: Program, layout: Layout, plan: DerivativePlan, tangents: int = 0) -> tuple[Body, int]:
    """Body of a function that computes the entries of a plan, by columns, and the size of ``data`` that it needs.

    ``tangents``: as for `pattern_of`.
    """
    body = looped(program, layout)
    body.lines = body.lines[:-CLOSING]  # the derivatives of states are not stored
    ones = [f"h = {body.array([len(plan.order)])}", "for k in range(index[h]):", "    data[d + 1 + k] = 1.0"]
    end = accumulate(body, layout, plan, layout.size + body.n_coefficients, ones, 1 + len(plan.order))
    listed = plan.sources[plan.by_column]
    if tangents:
        listed = listed[_with_copies(plan, tangents)[0]]
    source, count = body.array(listed), body.array([len(listed)])
    body.lines += [f"a, h = {source}, {count}", "for k in range(index[h]):", "    values[k] = data[d + index[a + k]]"]
    return body, end


def tangent_body(program: Program, layout: Layout, plan: DerivativePlan) -> tuple[Body, int, int]:
    """Body of a right-hand side extended by tangents, the offset of its numbers in ``data``, and the size that this needs.

    Each seed of the plan is a direction, which enters at every state and at some parameters. The tangents are the weights at the
    states: they follow the states, those of one state after those of the other, and so do their derivatives. The numbers are the
    weights at the parameters and the inverses of `inverted_blocks`, row by row.
    """
    body = looped(program, layout, guarded=True)
    n, n_states = len(program.states), plan.n_seeds * len(program.states)
    weights = layout.size + body.n_coefficients
    n_weights = len(plan.order) - n_states
    inverses, at = [], weights + n_weights
    for step, equations in inverted_blocks(plan):
        inverses.append(at)
        at += len(step.rows) * len(equations)
    head = body.array([n_states, n, n_weights, weights])
    entering = [
        f"h = {head}",
        "for k in range(index[h]):",
        "    data[d + 1 + k] = x[index[h + 1] + k]",
        "for k in range(index[h + 2]):",
        "    data[d + 1 + index[h] + k] = data[index[h + 3] + k]",
    ]
    end = accumulate(body, layout, plan, at, entering, 0, inverses)
    found = np.zeros(n_states, np.int64)  # entry 0 is zero
    found[plan.rows * plan.n_seeds + plan.seeds] = plan.sources
    body.lines += [
        f"a, h = {body.array(found)}, {head}",
        "for k in range(index[h]):",
        "    dx[index[h + 1] + k] = data[d + index[a + k]]",
    ]
    return body, weights, end


def inverted_blocks(plan: DerivativePlan) -> list[tuple[Solved, Integers]]:
    """Linear blocks whose matrix depends on a differentiated parameter, each with the equations whose derivative has a right-hand side."""
    blocks = [s for s in plan.steps if isinstance(s, Solved) and s.implicit and isinstance(s.step, Linear)]
    return [(s, np.unique(s.sums.to // s.width)) for s in blocks]


def accumulate(
    body: Body,
    layout: Layout,
    plan: DerivativePlan,
    at: int,
    entering: Sequence[str],
    n_ones: int,
    inverses: Sequence[int] = (),
) -> int:
    """Append the statements that compute the entries of a plan, from offset ``at`` of ``data``; returns where their storage ends.

    The entries are followed by scratch space for the right-hand side of a block and its elimination. ``entering``: statements that set
    the entries of the seeds, which follow entry 0 at ``data[d]``; entries 1 to ``n_ones`` are one. ``inverses``: offsets of the
    inverses of `inverted_blocks`, if they were prepared.
    """
    implicit = [(s, len(s.step.unknowns)) for s in plan.steps if isinstance(s, Solved) and s.implicit]
    inverted = {id(s): (place, rows) for (s, rows), place in zip(inverted_blocks(plan), inverses, strict=False)}
    right = at + plan.n_entries
    scratch = right + max((n * s.width for s, n in implicit), default=0)
    end = scratch + max((n * s.width + elimination_size(s.step) for s, n in implicit), default=0)
    head = body.array([at, plan.n_entries, right, scratch])
    body.lines += [f"h = {head}", "d = index[h]", "for k in range(index[h + 1]):", "    data[d + k] = 0.0"]
    if implicit:
        body.lines.append("e, w = index[h + 2], index[h + 3]")
    body.lines += entering
    pieces: list[Body] = []
    for step in plan.steps:
        if isinstance(step, Sums):
            pieces += _summed(body, step, "d", n_ones)
            continue
        pieces.append(body.piece())
        if isinstance(step.step, Linear) and not step.implicit:
            _multiplied(pieces[-1], step, step.step, layout)
        elif id(step) in inverted:
            _applied(pieces[-1], step, *inverted[id(step)], n_ones)
        else:
            _eliminated(pieces[-1], step, n_ones)
        if len(step.added):
            _plain(pieces[-1], "d", step.first + step.added, step.added_sources)
    body.include_all(pieces)
    return end


def _summed(body: Body, sums: Sums, base: str, n_ones: int) -> list[Body]:
    """Accumulate sums of products at offsets from ``base``; entries below ``n_ones`` are one."""
    pieces, targets = [], sums.targets
    for position, (factor, slots) in enumerate(zip(sums.factors, sums.multiplied, strict=True)):
        chosen, pointer = sums.of_factor(position)
        pieces += _scattered(body, factor, slots, pointer, sums.sources[chosen], base, targets[chosen], n_ones)
    plain = np.flatnonzero(sums.which < 0)
    if len(plain):
        pieces.append(body.piece())
        _plain(pieces[-1], base, targets[plain], sums.sources[plain])
    return pieces


def _scattered(
    body: Body,
    part: Batch,
    extra: Integers | None,
    pointer: Integers,
    sources: Integers,
    base: str,
    targets: Integers,
    n_ones: int,
) -> list[Body]:
    """Nested loops over the rows of a factor and the entries that each contributes to; ``extra``: slots that multiply the factor."""
    value = "y = {value}" if extra is None else "y = ({value}) * data[v + {extra}]"
    if body.literal:
        piece = body.piece()
        for i in range(len(part)):
            row = np.array([i])
            loop(piece, part.take(row), value, extra=None if extra is None else extra[row])
            for source, target in zip(sources[pointer[i] : pointer[i + 1]], targets[pointer[i] : pointer[i + 1]], strict=True):
                piece.lines.append(f"data[{base} + {target}] += y" + (f" * data[d + {source}]" if source >= n_ones else ""))
        return [piece]
    pieces = []
    for rows in sign_groups(part):
        lengths = pointer[rows + 1] - pointer[rows]
        which = np.repeat(np.arange(len(rows)), lengths)
        chosen = np.arange(len(which)) + (pointer[rows] + lengths - np.cumsum(lengths))[which]
        piece = body.piece()
        p = piece.array(np.concatenate([[0], np.cumsum(lengths)]))
        f, g = piece.array(sources[chosen]), piece.array(targets[chosen])
        piece.lines.append(f"p, f, g = {p}, {f}, {g}")
        loop(
            piece, part.take(rows),
            f"{value}\nfor j in range(index[p + {{row}}], index[p + {{row}} + 1]):\n"
            f"    data[{base} + index[g + j]] += y * data[d + index[f + j]]",
            extra=None if extra is None else extra[rows],
        )  # fmt: skip
        pieces.append(piece)
    return pieces


def _plain(body: Body, base: str, targets: Integers, sources: Integers) -> None:
    """Add entries to others, without a factor."""
    body.lines += [
        f"f, g, a = {body.array(sources)}, {body.array(targets)}, {body.array([len(sources)])}",
        "for j in range(index[a]):",
        f"    data[{base} + index[g + j]] += data[d + index[f + j]]",
    ]


def _multiplied(body: Body, step: Solved, block: Linear, layout: Layout) -> None:
    """The entries of a linear block: its solution matrix, stored in ``data``, times those of the known slots."""
    known, column = np.divmod(step.sums.targets, step.width)
    rows = np.searchsorted(layout.needed[step.block], step.rows)
    number = layout.solutions[step.block] + rows[:, None] * len(block.known) + known
    target = step.first + np.arange(len(rows))[:, None] * step.width + column
    source = np.tile(step.sums.sources, len(rows))
    body.lines += [
        f"p, f, g, a = {body.array(number.ravel())}, {body.array(source)}, {body.array(target.ravel())}, {body.array([len(source)])}",
        "for j in range(index[a]):",
        "    data[d + index[g + j]] += data[index[p + j]] * data[d + index[f + j]]",
    ]


def _applied(body: Body, step: Solved, place: int, equations: Integers, n_ones: int) -> None:
    """Implicit differentiation of a linear block with its inverse in ``data``: dz = -inverse(A) (dA z + dg)."""
    row, column = np.divmod(step.sums.to, step.width)
    sums = replace(step.sums, to=np.searchsorted(equations, row) * step.width + column)
    head = body.array([len(equations), step.width, len(step.rows), step.first, place])
    body.lines += [f"h = {head}", "for k in range(index[h] * index[h + 1]):", "    data[e + k] = 0.0"]
    for piece in _summed(body, sums, "e", n_ones):
        body.include(piece)
    body.lines += [
        f"h = {head}",
        "q, p, f, g = index[h], index[h + 1], d + index[h + 3], index[h + 4]",
        "for i in range(index[h + 2]):",
        "    for j in range(q):",
        "        y = data[g + i * q + j]",
        "        for k in range(p):",
        "            data[f + i * p + k] -= y * data[e + j * p + k]",
    ]


def _eliminated(body: Body, step: Solved, n_ones: int) -> None:
    """Implicit differentiation of a block: dz = -inverse(J) (dr/dx)."""
    block = step.step
    n, order = len(block.unknowns), None if isinstance(block, Linear) else block.order
    lead = 0 if isinstance(block, Linear) else block.lead
    n_entries = n * n if order is None else len(order.places)
    head, rows = body.array([n, step.width, lead, len(step.rows), step.first, n_entries]), body.array(step.rows)
    body.lines += [f"h = {head}", "for k in range(index[h] * index[h + 1]):", "    data[e + k] = 0.0"]
    for piece in _summed(body, step.sums, "e", n_ones):
        body.include(piece)
    body.lines += [
        f"a, h = {rows}, {head}",
        "q, p, lead = index[h], index[h + 1], index[h + 2]",
        "f = w + q * p",
        "for k in range(index[h + 5]):",
        "    data[f + k] = 0.0",
    ]
    for batch in block.matrix if isinstance(block, Linear) else block.jacobian:
        loop(body, entries_of(batch, order), "data[f + {target}] += {value}")
    body.lines += ["for k in range(q):", "    for j in range(p):", "        data[w + q * j + k] = -data[e + k * p + j]"]
    if order is None:
        body.lines += ["if solve(data, f, w, q, p, p, lead) != 0:", "    return 1"]
    else:
        body.lines += [
            f"pattern, factors = {body.array(pattern_array(order))}, f + index[h + 5]",
            "sparse_factorise(data, index, pattern, f, factors)",
            "for j in range(p):",
            "    if sparse_apply(data, index, pattern, factors, w + q * j, 1) != 0:",
            "        return 1",
        ]
    body.lines += [
        "for k in range(index[h + 3]):",
        "    for j in range(p):",
        "        data[d + index[h + 4] + k * p + j] = data[w + q * j + index[a + k]]",
    ]


def elimination_size(block: Linear | Newton) -> int:
    """Numbers that the elimination of a block takes besides its right-hand sides."""
    n, order = len(block.unknowns), None if isinstance(block, Linear) else block.order
    return 2 * n * n + 2 * n + 1 if order is None else len(order.places) + factors_size(order)
