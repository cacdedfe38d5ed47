"""Level scheduling against networkx's longest paths, and what cannot be put in order; slots in the order of evaluation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np
import pytest

from gearlib.equations.kernel import difference_kernel
from gearlib.errors import ModelError
from gearlib.program.interpret import batch_values
from gearlib.program.program import Batch, Linear, Newton, Step
from gearlib.program.schedule import levels, renumber, schedule

KNOWN = 3  # slots 0 to 2 are given; step s computes slot 3 + s


@pytest.mark.parametrize("seed", range(4))
def test_level_is_the_longest_chain_of_steps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 40
    rank = rng.permutation(n)  # steps are not listed in the order of evaluation
    before = [np.flatnonzero((rank < rank[s]) & (rng.random(n) < 0.1)).tolist() for s in range(n)]
    arguments = [[*(KNOWN + m for m in before[s]), *rng.integers(-1, KNOWN, 2).tolist()] for s in range(n)]
    graph = nx.DiGraph([(m, s) for s in range(n) for m in before[s]])
    longest = {s: nx.dag_longest_path_length(graph.subgraph([s, *nx.ancestors(graph, s)])) for s in graph}
    assert levels(arguments, [-1] * KNOWN + list(range(n)), KNOWN) == [1 + longest.get(s, 0) for s in range(n)]


def test_chain_longer_than_the_recursion_limit() -> None:
    n = 5000
    arguments = [[KNOWN + s + 1] for s in range(n - 1)] + [[0]]
    assert levels(arguments, [-1] * KNOWN + list(range(n)), KNOWN) == list(range(n, 0, -1))


@pytest.mark.parametrize(
    ("arguments", "maker"),
    [
        ([[KNOWN]], [0]),  # of itself
        ([[KNOWN + 1], [KNOWN + 2], [KNOWN, 1]], [0, 1, 2]),  # in a circle
        ([[0], [KNOWN, KNOWN + 2]], [0, 1, -1]),  # of what nothing computes
    ],
)
def test_unknowns_without_a_beginning_are_refused(arguments: list[list[int]], maker: list[int]) -> None:
    with pytest.raises(ModelError, match="computed from itself, or from one that no equation determines"):
        levels(arguments, [-1] * KNOWN + maker, KNOWN)


KERNEL = difference_kernel("one less the other")


@dataclass
class Drawn:
    """Differences of slots in a random order, with a block of either kind among them; rows know their numbers as equations."""

    batches: list[Batch]
    others: list[Linear | Newton]
    n_slots: int
    level: dict[tuple[int, int], int]  # of (batch, row), or (-1 - block, 0): the longest chain behind it

    @property
    def expected(self) -> list[tuple[int, int, list[int]]]:
        """Level, batch or block, rows: in order."""
        groups: dict[tuple[int, int], list[int]] = {}
        for (b, row), level in self.level.items():
            groups.setdefault((level, b), []).append(row)
        return [(level, b, sorted(rows)) for (level, b), rows in sorted(groups.items())]


def differences(equations: Any, targets: Any, arguments: Any, signs: Any) -> Batch:
    n, nothing = len(targets), np.zeros((len(targets), 0), np.int64)
    return Batch(KERNEL, equations, targets, np.ones(n, np.int64), arguments, signs, nothing, nothing)


def drawn(seed: int) -> Drawn:
    rng = np.random.default_rng(seed)
    sizes, blocks = [9, 1, 5, 7], [-1, -2, -3]  # rows of the batches; a linear block of two, two other ones of three unknowns
    things = [(b, row) for b, size in enumerate(sizes) for row in range(size)] + [(o, 0) for o in blocks]
    counts = {thing: {-1: 2, -2: 3, -3: 3}.get(thing[0], 1) for thing in things}
    total = KNOWN + sum(counts.values()) + 1  # one slot that nothing computes
    free = (KNOWN + rng.permutation(total - KNOWN)).tolist()
    made = {thing: [free.pop() for _ in range(counts[thing])] for thing in things}
    ready, level, read = [*range(KNOWN)], {}, {}
    of_slot: dict[int, int] = dict.fromkeys(ready, 0)
    for k in rng.permutation(len(things)).tolist():
        thing = things[k]
        read[thing] = [ready[i] for i in rng.integers(0, len(ready), 2)]
        absent = rng.random(2) < 0.2  # of such an argument it does not matter which slot it names
        level[thing] = 1 + max([0, *(of_slot[s] for s, none in zip(read[thing], absent, strict=True) if not none)])
        read[thing] = [
            (free[0] if none else s, 0 if none else rng.choice([-1, 1])) for s, none in zip(read[thing], absent, strict=True)
        ]
        ready += made[thing]
        of_slot |= dict.fromkeys(made[thing], level[thing])
    first, batches = 0, []
    for b, size in enumerate(sizes):
        rows = [(b, row) for row in range(size)]
        table = np.array([read[row] for row in rows])
        numbers = first + rng.permutation(size)
        batches.append(differences(numbers, np.array([made[row][0] for row in rows]), table[:, :, 0], table[:, :, 1]))
        first += size
    others: list[Linear | Newton] = []
    for o in blocks:
        unknowns, pairs = np.array(made[o, 0]), np.array(read[o, 0])[None]
        if o == -1:
            known = pairs[0, :, 0][pairs[0, :, 1] != 0]
            others.append(Linear(unknowns, (), known, np.arange(len(known)), np.arange(2)))
            continue
        inside = differences(np.zeros(2, np.int64), np.arange(2), unknowns[[[0, 1], [2, 0]]], np.ones((2, 2), np.int64))
        outside = differences(np.zeros(1, np.int64), np.arange(1), pairs[:, :, 0], pairs[:, :, 1])
        parts = ((inside, outside), ()) if o == -2 else ((inside,), (outside,))  # what the matrix reads counts as well
        others.append(Newton(unknowns, *parts, False, np.arange(3), 0, False))
    return Drawn(batches, others, total, level)


@pytest.mark.parametrize("seed", range(6))
def test_steps_are_as_early_and_as_large_as_can_be(seed: int) -> None:
    given = drawn(seed)
    steps = schedule(given.batches, given.others, given.n_slots, KNOWN)
    assert len(steps) == len(given.expected)
    for step, (_, b, rows) in zip(steps, given.expected, strict=True):
        if b < 0:
            assert step is given.others[-1 - b]
        else:
            assert isinstance(step, Batch)
            assert step.equations.tolist() == given.batches[b].equations[rows].tolist()
            assert step.arguments.tolist() == given.batches[b].arguments[rows].tolist()


def carried_out(steps: Sequence[Step], n_slots: int) -> Any:
    """Values of all slots; of a block's unknowns some numbers that follow from what it reads."""
    slots, none = np.zeros((n_slots, 1)), np.empty((0, 1))
    slots[:KNOWN, 0] = [1.37, -2.11, 0.53]
    for step in steps:
        if isinstance(step, Batch):
            slots[step.targets] = batch_values(step, np.zeros(1), slots, none[:, 0], none)
        elif isinstance(step, Linear):
            slots[step.unknowns] = np.array([[3.0], [-1.5]]) * slots[step.known].sum()
        else:
            slots[step.unknowns] = [[0.3], [0.7], [-0.2]]
            for batch in (*step.residuals, *step.jacobian):
                slots[step.unknowns[0]] += batch_values(batch, np.zeros(1), slots, none[:, 0], none).sum()
    return slots[:, 0]


@pytest.mark.parametrize("seed", range(6))
def test_slots_are_numbered_as_they_are_computed(seed: int) -> None:
    """And have the values that they had; what nothing computes has no number."""
    given = drawn(seed)
    before = schedule(given.batches, given.others, given.n_slots, KNOWN)
    place, after = renumber(before, given.n_slots, KNOWN)
    made = np.concatenate([step.targets if isinstance(step, Batch) else step.unknowns for step in after])
    assert made.tolist() == [*range(KNOWN, given.n_slots - 1)]
    assert place[:KNOWN].tolist() == [*range(KNOWN)]
    assert place[place < 0].tolist() == [-1]
    assert [type(step) for step in after] == [type(step) for step in before]
    for step in after:
        parts = [step] if isinstance(step, Batch) else [] if isinstance(step, Linear) else [*step.residuals, *step.jacobian]
        assert all((batch.arguments >= 0).all() for batch in parts)
        assert not isinstance(step, Batch) or (np.diff(step.equations) > 0).all()
    old, new = carried_out(before, given.n_slots), carried_out(after, given.n_slots - 1)
    there = place >= 0
    assert new[place[there]] == pytest.approx(old[there], rel=1e-12)
    assert len(np.unique(old)) > len(old) // 3


@pytest.mark.parametrize("named", [0, 1, 2, 3])
@pytest.mark.parametrize("n_known", [0, 1, 2])
def test_absent_arguments_are_waited_for_by_no_one(n_known: int, named: int) -> None:
    """Whichever slot they name, and however few slots are given: of a chain in which each row reads the one before and nothing else."""
    rows = 3
    targets = n_known + np.arange(rows)
    arguments = np.column_stack([np.maximum(targets - 1, 0), np.full(rows, named)])
    signs = np.column_stack([(targets > 0).astype(int), np.zeros(rows, np.int64)])
    steps = schedule([differences(np.arange(rows), targets, arguments, signs)], [], n_known + rows + 1, n_known)
    assert [step.equations.tolist() for step in steps if isinstance(step, Batch)] == [[0], [1], [2]]
    place, moved = renumber(steps, n_known + rows + 1, n_known)
    assert place.tolist() == [*range(n_known + rows), -1]
    assert carried_out_alone(moved, n_known + rows, n_known) == pytest.approx(
        [1.5, 2.5][:n_known] + [[0.0, 1.5, 2.5][n_known]] * rows
    )


def carried_out_alone(steps: Sequence[Step], n_slots: int, n_known: int) -> Any:
    """Values of the slots of batches alone."""
    slots, none = np.zeros((n_slots, 1)), np.empty((0, 1))
    slots[:n_known, 0] = [1.5, 2.5][:n_known]
    for step in steps:
        assert isinstance(step, Batch)
        slots[step.targets] = batch_values(step, np.zeros(1), slots, none[:, 0], none)
    return slots[:, 0]


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_a_slot_that_nothing_computes_is_not_waited_for(rows: int) -> None:
    """A row that reads it is refused, also behind others and beside a block."""
    targets, n = KNOWN + np.arange(rows), KNOWN + rows + 3
    arguments, signs = np.zeros((rows, 2), np.int64), np.ones((rows, 2), np.int64)
    block = Linear(np.array([n - 3, n - 2]), (), np.array([0]), np.arange(1), np.arange(2))
    assert len(schedule([differences(np.arange(rows), targets, arguments, signs)], [block], n, KNOWN)) == 2
    arguments[-1, 1] = n - 1
    with pytest.raises(ModelError, match="computed from itself, or from one that no equation determines"):
        schedule([differences(np.arange(rows), targets, arguments, signs)], [block], n, KNOWN)
