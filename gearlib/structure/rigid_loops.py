"""Rigid loops: redundant or contradictory linear constraints with constant coefficients, by rank-revealing elimination.

A structural rank counts equations; two equal gears in parallel count twice. So the kinematic equations are examined with their
numerical coefficients. Tree-like parts cannot be redundant and are removed first; what remains are loops, which are eliminated while
recording which equations were combined.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush

from gearlib.structure.sparse_rows import eliminate, holders_of, sizes_of

TOLERANCE = 1e-10  # relative to the row's largest coefficient: smaller coefficients are rounding


@dataclass(frozen=True)
class Combination:
    """Rows whose combination with these multipliers leaves nothing (or a single variable)."""

    rows: tuple[int, ...]
    multipliers: tuple[float, ...]
    variable: int = -1  # the variable forced to zero
    constant: float = 0.0  # remaining right-hand side
    last: int = -1  # the row that became empty: without it the others are independent


def examine(rows: Sequence[Mapping[int, float]], constants: Sequence[float]) -> tuple[list[Combination], list[Combination]]:
    """Find redundant and contradictory rows of ``sum(row[v] * x[v]) = constant``; the row ``last`` of each redundancy can be removed.

    Parameters
    ----------
    rows : sequence of mappings
        Coefficients by variable.
    constants : sequence of float
        Right-hand sides; NaN where they vary with time.

    Examples
    --------
    Two equal gears in parallel, then two that contradict each other:

    >>> examine([{0: 1, 1: -3}, {0: 1, 1: -3}], [0, 0])[0][0].rows
    (0, 1)
    >>> examine([{0: 1, 1: -3}, {0: 1, 1: -2}], [0, 0])[1][0].rows
    (0, 1)
    """
    alive = core(rows)
    work = {r: {v: c for v, c in rows[r].items() if c != 0.0} for r in alive}
    holders, sizes = holders_of(work), sizes_of(work)
    combos: dict[int, dict[int, float]] = {r: {r: 1.0} for r in alive}
    rhs = {r: float(constants[r]) for r in alive}
    redundant: list[Combination] = []
    contradictory: list[Combination] = []
    fixing = {r for r, row in work.items() if len(row) == 1}
    pending = set(alive)
    heap = [(len(work[r]), r) for r in alive]
    heapify(heap)
    while pending:
        length, r = heappop(heap)  # a row with the fewest entries
        row = work[r]
        if r not in pending or length != len(row):  # outdated queue entry
            continue
        pending.remove(r)
        if not row:
            terms = {i: abs(c) * sizes[i] for i, c in combos[r].items()}
            involved = tuple(i for i in sorted(terms) if terms[i] > TOLERANCE * max(terms.values()))
            found = Combination(involved, tuple(combos[r][i] for i in involved), constant=rhs[r], last=r)
            vanishes = abs(rhs[r]) <= TOLERANCE * max(1.0, *(abs(constants[i]) for i in combos[r]))
            (redundant if vanishes else contradictory).append(found)
            continue
        pivot = min(row, key=lambda v: (abs(row[v]) < 0.1 * max(map(abs, row.values())), len(holders[v]), v))
        if len(row) == 1:
            grounded = any(i in fixing for i in combos[r])
            if not grounded and rhs[r] == 0.0:
                involved = tuple(sorted(combos[r]))
                contradictory.append(Combination(involved, tuple(combos[r][i] for i in involved), pivot))
        for other, factor in eliminate(work, holders, r, pivot, pending, sizes, TOLERANCE):
            heappush(heap, (len(work[other]), other))
            rhs[other] -= factor * rhs[r]
            for i, c in combos[r].items():
                combos[other][i] = combos[other].get(i, 0.0) - factor * c
    return redundant, contradictory


def core(rows: Sequence[Mapping[int, float]]) -> list[int]:
    """The 2-core of the rows: what remains after repeatedly removing rows with a variable of their own."""
    holders: dict[int, list[int]] = defaultdict(list)
    for r, row in enumerate(rows):
        for v, c in row.items():
            if c != 0.0:
                holders[v].append(r)
    degree = {v: len(rs) for v, rs in holders.items()}
    gone: set[int] = set()
    stack = [v for v, d in degree.items() if d == 1]
    while stack:
        v = stack.pop()
        alone = next((r for r in holders[v] if r not in gone), None)
        if alone is None:
            continue
        gone.add(alone)
        for u, c in rows[alone].items():
            if c != 0.0:
                degree[u] -= 1
                if degree[u] == 1:
                    stack.append(u)
    return [r for r in range(len(rows)) if r not in gone]
