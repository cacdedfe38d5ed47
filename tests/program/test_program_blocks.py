"""Blocks that are solved by iteration: how they are eliminated, and which of their equations are zero where their unknowns are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.interpret import owner_of
from gearlib.program.program import Batch, Newton
from tests.program.test_schedule import differences


def block(n: int, *groups: Any) -> Newton:
    """With a matrix whose entries are at some places, in one or several batches."""
    entries = tuple(
        differences(np.zeros(len(g), np.int64), np.array(g), np.zeros((len(g), 2), np.int64), np.ones((len(g), 2), np.int64))
        for g in groups
    )
    return Newton(np.arange(n), (), entries, True, np.arange(n), 0, False)


@pytest.mark.parametrize(
    ("n", "entries", "sparse"), [(23, 60, False), (24, 60, True), (24, 144, True), (24, 145, False), (40, 400, True)]
)
def test_large_blocks_with_few_entries_are_eliminated_by_their_pattern(n: int, entries: int, sparse: bool) -> None:
    """From 24 unknowns, and up to a quarter of all entries; an entry that two batches add to counts once."""
    diagonal = [i * n + i for i in range(n)]
    others = np.random.default_rng(n).permutation([k for k in range(n * n) if k % (n + 1)])[: entries - n].tolist()
    for groups in ((diagonal + others,), (diagonal, others), (diagonal + others[:5], others)):
        assert (block(n, *groups).order is not None) == sparse


class Cell(gl.Component):
    y, before, behind, s, load = (gl.Variable("1") for _ in range(5))

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.s * self.y + self.before + self.behind, self.load)]


@pytest.mark.parametrize("loaded", [None, 0, 2])
@pytest.mark.parametrize("ends", [(0, 0), (1, 0), (0, -1), (1, 1)], ids=str)
def test_equations_with_a_rest(ends: tuple[int, int], loaded: int | None) -> None:
    """In a chain whose unknowns move each other: only what is joined to a state, or loaded, is not zero where they all are."""

    class Chain(gl.Component):
        x = gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)

        def assemble(self) -> list[Any]:
            self.cell = [Cell() for _ in range(4)]
            return []

        def equations(self) -> list[gl.Eq]:
            cells, (first, last) = self.cell, (end * self.x if end else 0 for end in ends)
            joined = [gl.Eq(one.behind, other.y) for one, other in zip(cells, cells[1:], strict=False)]
            joined += [gl.Eq(other.before, one.y) for one, other in zip(cells, cells[1:], strict=False)]
            loads = [gl.Eq(one.load, -self.x if i == loaded else 0) for i, one in enumerate(cells)]
            return [
                gl.Eq(gl.der(self.x), self.rate * sum(one.y for one in cells)), *joined, *loads,
                *(gl.Eq(one.s, self.x) for one in cells), gl.Eq(cells[0].before, first), gl.Eq(cells[-1].behind, last),
            ]  # fmt: skip

    translation = gl.compile(Chain()).translation
    (step,) = (s for s in translation.scene.program.steps if isinstance(s, Newton))
    assert (step.linear, len(step.unknowns)) == (True, 4)
    kept = [owner_of(translation.structure, int(e)) for batch in step.rests for e in batch.equations]
    expected = {i for i, end in zip((0, 3), ends, strict=True) if end} | ({loaded} if loaded is not None else set())
    assert sorted(kept) == [f"cell[{i}]" for i in sorted(expected)]
    whole: dict[int, tuple[Batch, int]] = {int(e): (b, i) for b in step.residuals for i, e in enumerate(b.equations)}
    for batch in step.rests:
        for i, equation in enumerate(batch.equations.tolist()):
            before, row = whole[equation]
            assert batch.targets[i] == before.targets[row]
            assert batch.arguments[i].tolist() == before.arguments[row].tolist()
