"""Generated scalar functions, against the arrays that they stand for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gearlib.program import scalars
from gearlib.program.derivative_plan import state_plan
from gearlib.program.interpret import constant_values
from gearlib.program.scalars import constants, constants_function, linear_function
from tests.program.programs import KINDS, compiled, point
from tests.program.test_interpret import CONSTANT, parameters_of, rotated


@pytest.mark.parametrize("kind", KINDS)
def test_pivots_and_matrices_follow_each_other(kind: str) -> None:
    p = point(kind)
    function = constants(p.program)
    assert function is not None
    found = function(p.numbers.parameters.tolist())
    for part, group in zip(p.program.constant_parts, p.program.constant_groups, strict=True):
        expected = [constant_values(batch, p.numbers.parameters) for batch in group]
        assert found[part] == pytest.approx(np.concatenate([np.empty(0), *expected]), rel=1e-15)
    assert len(found) == sum(len(b) for group in p.program.constant_groups for b in group)


def test_entries_of_a_block_are_those_of_its_matrix() -> None:
    matrix = rotated(3)
    function = constants(CONSTANT.scene.program)
    assert function is not None
    (block,) = CONSTANT.scene.program.linear_blocks
    found = np.array(function(parameters_of(matrix, 5.0).tolist()))
    entries = np.zeros(9)
    entries[block.places] = found[CONSTANT.scene.program.constant_parts[1]]
    assert np.sort(np.abs(entries)) == pytest.approx(np.sort(np.abs(matrix).ravel()), rel=1e-15)
    assert np.abs(np.linalg.det(entries.reshape(3, 3))) == pytest.approx(abs(np.linalg.det(matrix)))
    assert np.abs(found[CONSTANT.scene.program.constant_parts[0]]).tolist() == [5.0]


def test_nothing_to_compute() -> None:
    function = constants_function([])
    assert function is not None
    assert function([1.0]) == []


def test_functions_have_their_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many numbers as are allowed, and one too many; of derivatives four times as many statements."""
    program = compiled("bound").translation.scene.program
    batches = [b for group in program.constant_groups for b in group]
    size = sum(map(len, batches))
    for most, there in ((size, True), (size - 1, False)):
        monkeypatch.setattr(scalars, "MOST", most)
        assert (constants_function(batches) is not None) == there
    plan = state_plan(program)
    lines = statements(program, plan, monkeypatch)
    for most, there in ((lines / 4, True), (lines / 4 - 0.25, False)):
        monkeypatch.setattr(scalars, "MOST", most)
        assert (linear_function(program, plan) is not None) == there


def statements(program: Any, plan: Any, monkeypatch: pytest.MonkeyPatch) -> int:
    """The fewest that are allowed, by trial."""
    for lines in range(1000):
        monkeypatch.setattr(scalars, "MOST", lines / 4)
        if linear_function(program, plan) is not None:
            return lines
    raise AssertionError("too many")
