"""Sparsity patterns of derivatives, and of their copies for tangents, against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.native.jacobian import inverted_blocks, pattern_of
from gearlib.program.derivative_plan import derivative_plan, state_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.program import Linear
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
