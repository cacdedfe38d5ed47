"""Code generation for derivatives, such as the analytic Jacobian: forward accumulation as a plan lists it.

The entries of a plan lie one after another in ``data``. Each factor is computed once and multiplied into all the entries that it
contributes to; lists of integers say which.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.native.layout import Layout
from gearlib.native.source import CLOSING, Body, loop, looped, sign_groups
from gearlib.program.derivative_plan import DerivativePlan, Solved, Sums
from gearlib.program.program import Batch, Linear, Program

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Pattern:
    """Sparsity of a matrix of derivatives, in compressed columns."""

    indptr: Integers
    indices: Integers
    size: int  # entries that are computed on the way


def pattern_of(plan: DerivativePlan) -> Pattern:
    """The sparsity of what a plan computes: a row for each slot that is wanted, a column for each seed."""
    counts = np.bincount(plan.seeds, minlength=plan.n_seeds)
    return Pattern(np.concatenate([[0], np.cumsum(counts)]), plan.rows[plan.by_column], plan.n_entries)


def jacobian_body(program: Program, layout: Layout, plan: DerivativePlan) -> tuple[Body, int]:
    """The body of a function that computes what a plan lists, by columns, and how large ``data`` must be for it.

    Behind the entries lie the right-hand side of a block, and what its elimination needs.
    """
    body = looped(program, layout)
    body.lines = body.lines[:-CLOSING]  # no derivatives of states are stored
    at = layout.size + body.n_coefficients
    implicit = [(s, len(s.step.unknowns)) for s in plan.steps if isinstance(s, Solved) and s.implicit]
    right = at + plan.n_entries
    scratch = right + max((n * s.width for s, n in implicit), default=0)
    end = scratch + max((n * n + 2 * n + 1 for _, n in implicit), default=0)
    head = body.array([at, plan.n_entries, len(plan.order), right, scratch])
    body.lines += [
        f"h = {head}",
        "d = index[h]",
        "for k in range(index[h + 1]):",
        "    data[d + k] = 0.0",
        "for k in range(index[h + 2]):",
        "    data[d + 1 + k] = 1.0",
    ]
    if implicit:
        body.lines.append("e, w = index[h + 3], index[h + 4]")
    pieces: list[Body] = []
    n_ones = 1 + len(plan.order)
    for step in plan.steps:
        if isinstance(step, Sums):
            pieces += _summed(body, step, "d", n_ones)
            continue
        pieces.append(body.piece())
        if isinstance(step.step, Linear) and not step.implicit:
            _multiplied(pieces[-1], step, step.step, layout)
        else:
            _eliminated(pieces[-1], step, n_ones)
        if len(step.added):
            _plain(pieces[-1], "d", step.first + step.added, step.added_sources)
    body.include_all(pieces)
    out = plan.sources[plan.by_column]
    source = body.array(out)
    count = body.array([len(out)])
    body.lines += [f"a, h = {source}, {count}", "for k in range(index[h]):", "    values[k] = data[d + index[a + k]]"]
    return body, end


def _summed(body: Body, sums: Sums, base: str, n_ones: int) -> list[Body]:
    """Add products to where each belongs, counted from ``base``; entries below ``n_ones`` are one."""
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
    """Loops over a factor's rows and, inside, over the entries that each contributes to; ``extra``: slots that multiply it."""
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
    """Add entries as they are."""
    body.lines += [
        f"f, g, a = {body.array(sources)}, {body.array(targets)}, {body.array([len(sources)])}",
        "for j in range(index[a]):",
        f"    data[{base} + index[g + j]] += data[d + index[f + j]]",
    ]


def _multiplied(body: Body, step: Solved, block: Linear, layout: Layout) -> None:
    """The entries of a linear block: its solution, which lies in ``data``, times those of what is known."""
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


def _eliminated(body: Body, step: Solved, n_ones: int) -> None:
    """Implicit differentiation of a block: dz = -inverse(J) (dr/dx), solved column by column."""
    block = step.step
    n = len(block.unknowns)
    lead = 0 if isinstance(block, Linear) else block.lead
    head, rows = body.array([n, step.width, lead, len(step.rows), step.first]), body.array(step.rows)
    body.lines += [f"h = {head}", "for k in range(index[h] * index[h + 1]):", "    data[e + k] = 0.0"]
    for piece in _summed(body, step.sums, "e", n_ones):
        body.include(piece)
    body.lines += [
        f"a, h = {rows}, {head}",
        "q, lead = index[h], index[h + 2]",
        "for l in range(index[h + 1]):",
        "    for k in range(q * q):",
        "        data[w + q + k] = 0.0",
    ]
    for batch in block.matrix if isinstance(block, Linear) else block.jacobian:
        loop(body, batch, "data[w + q + {target}] += {value}", "    ")
    body.lines += [
        "    for k in range(q):",
        "        data[w + k] = -data[e + k * index[h + 1] + l]",
        "    if solve(data, w + q, w, q, lead) != 0:",
        "        return 1",
        "    for k in range(index[h + 3]):",
        "        data[d + index[h + 4] + k * index[h + 1] + l] = data[w + index[a + k]]",
    ]
