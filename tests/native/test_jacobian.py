"""Sparsity patterns of derivatives, and of their copies for tangents, against dense matrices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearlib.native.jacobian import elimination_size, inverted_blocks, pattern_of
from gearlib.native.sparse_solve import factors_size
from gearlib.program.derivative_plan import derivative_plan, state_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.program import Linear, Newton
from gearlib.structure.elimination_order import EliminationOrder
from tests.program.programs import KINDS, point


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tangents", [0, 1, 3])
def test_pattern_is_where_the_matrix_is_not_zero(kind: str, tangents: int) -> None:
    """One block for the states, and one for each tangent of theirs: row and column ``state * tangents + number`` behind the states."""
    p = point(kind)
    plan, n = state_plan(p.program), len(p.program.states)
    matrix = dense(plan, entries(plan, At(p.numbers, p.t, p.slots, p.flags)))
    found = pattern_of(plan, tangents)
    size = n * (1 + tangents)
    assert len(found.indptr) == size + 1
    assert found.indptr[0] == 0
    assert found.indptr[-1] == len(found.indices)
    filled = np.zeros((size, size), int)
    np.add.at(filled, (found.indices, np.repeat(np.arange(size), np.diff(found.indptr))), 1)
    own = filled[:n, :n]
    assert own.max(initial=0) <= 1
    assert (own[(matrix != 0).any(axis=0)] == 1).all()
    expected = np.zeros_like(filled)
    expected[:n, :n] = own
    for k in range(tangents):
        place = n + np.arange(n) * tangents + k
        expected[np.ix_(place, place)] = own
    assert filled.tolist() == expected.tolist()
    for column in range(n):  # rows ascend in each column, as compressed columns have them
        assert (np.diff(found.indices[found.indptr[column] : found.indptr[column + 1]]) > 0).all()
    assert found.size == plan.n_entries


def test_blocks_whose_matrix_is_differentiated_are_inverted() -> None:
    """Only where a parameter of the matrix is a seed; the rows with a right-hand side."""
    program = point("bound").program
    (block,) = program.linear_blocks
    inside = {int(p) for b in block.matrix for p in b.parameters.ravel()}
    outside = {int(p) for s in program.steps if not isinstance(s, Linear) for p in s.parameters.ravel()} - inside  # type: ignore[union-attr]
    assert inverted_blocks(derivative_plan(program, [(program.n_slots + p, 0) for p in outside], program.output_slots)) == []
    one = min(inside)
    found = inverted_blocks(derivative_plan(program, [(program.n_slots + one, 0)], program.output_slots))
    ((step, rows),) = found
    assert step.step is block
    n = len(block.unknowns)
    expected = {int(t) // n for b in block.matrix for i, t in enumerate(b.targets) if one in b.parameters[i]}
    assert set(rows.tolist()) >= expected
    assert set(rows.tolist()) <= expected | set(block.known_rows.tolist())


def test_an_elimination_has_room_for_its_matrix_and_what_solves_it() -> None:
    """Entries, their largest magnitudes, columns' order and compliances, determinant; of a sparse one, entries and factors."""
    blocks = [step for kind in KINDS for step in point(kind).program.steps if isinstance(step, Linear | Newton)]
    assert {type(block) for block in blocks} == {Linear, Newton}
    for block in blocks:
        n = len(block.unknowns)
        order = None if isinstance(block, Linear) else block.order
        dense_room = n * n + n * n + n + n + 1
        assert elimination_size(block) == (dense_room if order is None else len(order.places) + factors_size(order))
    newton = next(block for block in blocks if isinstance(block, Newton))
    n, every = len(newton.unknowns), np.arange(len(newton.unknowns))
    order = EliminationOrder(n, every * n + every, every, every, n)  # a diagonal
    sparse = replace(newton)
    vars(sparse)["order"] = order
    assert elimination_size(sparse) == n + factors_size(order)
