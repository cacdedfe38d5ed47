"""Level scheduling: steps grouped by dependency level into maximal batches."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ModelError
from gearlib.program.program import Batch, Linear, Newton, Step

Integers = NDArray[np.int64]
UNSEEN, WAITING = -1, -2  # states of a step without a level: not visited, or waiting for its arguments


def schedule(batches: Sequence[Batch], others: Sequence[Linear | Newton], n_slots: int, n_known: int) -> tuple[Step, ...]:
    """Schedule each step as early as its arguments allow; steps of one level and kernel form one batch."""
    maker = np.full(n_slots, -1)
    kinds: list[tuple[int, int]] = []  # (batch, row) or (-1 - block, 0)
    arguments: list[list[int]] = []
    for b, batch in enumerate(batches):
        maker[batch.targets] = np.arange(len(kinds), len(kinds) + len(batch))
        kinds += [(b, i) for i in range(len(batch))]
        arguments += np.where(batch.argument_signs == 0, -1, batch.arguments).tolist()
    for o, block in enumerate(others):
        maker[block.unknowns] = len(kinds)
        kinds.append((-1 - o, 0))
        if isinstance(block, Linear):
            arguments.append(block.known.tolist())
        else:
            own = set(block.unknowns.tolist())
            outside = {a for b_ in (*block.residuals, *block.jacobian) for a in b_.arguments[b_.argument_signs != 0].tolist()}
            arguments.append(sorted(outside - own))
    level = levels(arguments, maker.tolist(), n_known)
    buckets: dict[tuple[int, int], list[int]] = defaultdict(list)
    for s, (b, i) in enumerate(kinds):
        buckets[level[s], b].append(i)
    steps: list[Step] = []
    for (_, b), rows in sorted(buckets.items()):
        if b < 0:
            steps.append(others[-1 - b])
        else:
            steps.append(batches[b] if len(rows) == len(batches[b]) else batches[b].take(np.array(rows, np.int64)))
    return tuple(steps)


def renumber(steps: Sequence[Step], n_slots: int, n_known: int) -> tuple[Integers, tuple[Step, ...]]:
    """Renumber slots in evaluation order, so that a batch writes, and often reads, consecutive slots.

    Returns
    -------
    place : array of int
        New number of each slot; -1 where it is not computed.
    steps : tuple of Step
    """
    sorted_steps = [s.take(np.argsort(s.equations, kind="stable")) if isinstance(s, Batch) else s for s in steps]
    place = np.full(n_slots, -1)
    place[:n_known] = np.arange(n_known)
    count = n_known
    for step in sorted_steps:
        made = step.targets if isinstance(step, Batch) else step.unknowns
        place[made] = np.arange(count, count + len(made))
        count += len(made)

    def moved(batch: Batch, targets: bool) -> Batch:
        arguments = np.where(batch.argument_signs == 0, 0, place[batch.arguments])
        return replace(batch, targets=place[batch.targets] if targets else batch.targets, arguments=arguments)

    result: list[Step] = []
    for step in sorted_steps:
        if isinstance(step, Batch):
            result.append(moved(step, True))
        elif isinstance(step, Linear):
            result.append(replace(step, unknowns=place[step.unknowns], known=place[step.known]))
        else:
            residuals, jacobian = (tuple(moved(b, False) for b in part) for part in (step.residuals, step.jacobian))
            result.append(replace(step, unknowns=place[step.unknowns], residuals=residuals, jacobian=jacobian))
    return place, tuple(result)


def levels(arguments: Sequence[Sequence[int]], maker: Sequence[int], n_known: int) -> list[int]:
    """Length of the longest chain of steps behind each step: those of one level do not need each other."""
    level = [UNSEEN] * len(arguments)
    for start in range(len(arguments)):
        stack = [start]
        while stack:
            s = stack[-1]
            if level[s] >= 0:
                stack.pop()
                continue
            before = [maker[a] for a in arguments[s] if a >= n_known]
            open_ = [m for m in before if m < 0 or level[m] < 0]
            if not open_:
                level[s] = 1 + max((level[m] for m in before), default=0)
                stack.pop()
            elif any(m < 0 or level[m] == WAITING for m in open_):
                raise ModelError("an unknown is computed from itself, or from one that no equation determines")
            else:
                level[s] = WAITING
                stack += open_
    return level
