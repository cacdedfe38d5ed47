"""The order of steps: level by level, in batches as large as possible."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from gearlib.codegen.program import Batch, Linear, Newton, Step


def schedule(batches: Sequence[Batch], others: Sequence[Linear | Newton], n_slots: int, n_known: int) -> tuple[Step, ...]:
    """Levels: each step as early as its arguments allow; steps of one level and kernel form one batch."""
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
    level = _levels(arguments, maker.tolist(), n_known)
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


def _levels(arguments: Sequence[Sequence[int]], maker: Sequence[int], n_known: int) -> list[int]:
    level = [-1] * len(arguments)
    for start in range(len(arguments)):
        stack = [start]
        while stack:
            s = stack[-1]
            if level[s] >= 0:
                stack.pop()
                continue
            before = [maker[a] for a in arguments[s] if a >= n_known]
            open_ = [m for m in before if level[m] < 0]
            if open_:
                stack += open_
            else:
                level[s] = 1 + max((level[m] for m in before), default=0)
                stack.pop()
    return level
