"""Tearing, step by step as it is described."""

from __future__ import annotations

import numpy as np

from gearlib.structure.tearing import Tearing, tear


def step_by_step(rows: list[dict[int, bool]]) -> Tearing:
    """The lowest row that one unknown is left in, if it can be solved for that; else the column in most open rows is torn."""
    n = len(rows)
    order: list[tuple[int, int]] = []
    tears: list[int] = []
    while len(order) + len(tears) < n:
        known = {*tears, *(c for _, c in order)}
        still_open = [r for r in range(n) if r not in {r for r, _ in order}]
        left = {r: [c for c in rows[r] if c not in known] for r in still_open}
        ready = [(r, left[r][0]) for r in still_open if len(left[r]) == 1 and rows[r][left[r][0]]]
        if ready:
            order.append(ready[0])
        else:
            unknown = [c for c in range(n) if c not in known]
            tears.append(max(unknown, key=lambda c: (sum(c in rows[r] for r in still_open), -c)))
    solved = [r for r, _ in order]
    return Tearing((*solved, *(r for r in range(n) if r not in solved)), (*(c for _, c in order), *tears), len(order))


def test_blocks_drawn_at_random_are_torn_as_described() -> None:
    rng = np.random.default_rng(3)
    for _ in range(150):
        n = int(rng.integers(1, 9))
        rows = [
            {int(c): bool(rng.random() < 0.7) for c in rng.permutation(n)[: rng.integers(1, min(n, 4) + 1)]} for _ in range(n)
        ]
        found = tear(rows)
        assert found == step_by_step(rows), rows
        assert found.tears == found.columns[found.lead :]


def test_there_may_be_nothing_to_tear() -> None:
    assert tear([]) == Tearing((), (), 0)
