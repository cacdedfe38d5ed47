"""Rigid loops: redundant or contradictory linear constraints with constant coefficients, by rank-revealing elimination.

A structural rank counts equations; two equal gears side by side count twice. So the kinematic equations are examined with their
numerical coefficients. Whatever hangs on the rest like a tree cannot be redundant and is peeled off first; what is left are the
loops, and they are eliminated with a record of which equations were combined.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush

import numpy as np
from numpy.typing import NDArray

TOLERANCE = 1e-10  # of a row's largest coefficient: below it, a coefficient is rounding
INDEPENDENT = 1e-7  # sine of the angle below which a direction says nothing new
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Combination:
    """Rows that, combined with these multipliers, leave nothing (or a single variable)."""

    rows: tuple[int, ...]
    multipliers: tuple[float, ...]
    variable: int = -1  # the one that is forced to stand still
    constant: float = 0.0  # what is left on the right-hand side
    last: int = -1  # the row that came out empty: without it the others are independent


@dataclass(frozen=True)
class Loops:
    """Redundant and contradictory rows."""

    redundant: tuple[Combination, ...]  # the row ``last`` of each is not needed
    contradictory: tuple[Combination, ...]


def examine(rows: Sequence[Mapping[int, float]], constants: Sequence[float], may_stand: frozenset[int]) -> Loops:
    """Find redundant and contradictory rows of ``sum(row[v] * x[v]) = constant``.

    Parameters
    ----------
    rows : sequence of mappings
        Coefficient of each variable.
    constants : sequence of float
        Right-hand sides; NaN where it varies with time.
    may_stand : frozenset of int
        Variables that may be forced to a constant without that being an error.

    Examples
    --------
    Two equal gears side by side, then two that disagree:

    >>> examine([{0: 1, 1: -3}, {0: 1, 1: -3}], [0, 0], frozenset()).redundant[0].rows
    (0, 1)
    >>> examine([{0: 1, 1: -3}, {0: 1, 1: -2}], [0, 0], frozenset()).contradictory[0].rows
    (0, 1)
    """
    alive = core(rows)
    work: dict[int, dict[int, float]] = {r: {v: c for v, c in rows[r].items() if c != 0.0} for r in alive}
    combos: dict[int, dict[int, float]] = {r: {r: 1.0} for r in alive}
    rhs = {r: float(constants[r]) for r in alive}
    scale = {r: max((abs(c) for c in work[r].values()), default=1.0) for r in alive}
    holders: dict[int, set[int]] = defaultdict(set)
    for r, row in work.items():
        for v in row:
            holders[v].add(r)
    redundant: list[Combination] = []
    contradictory: list[Combination] = []
    fixing = {r for r, row in work.items() if len(row) == 1}
    pending = set(alive)
    heap = [(len(work[r]), r) for r in alive]
    heapify(heap)
    while pending:
        length, r = heappop(heap)  # a row with the fewest entries
        if r not in pending or length != len(work[r]):  # changed since it was put there
            continue
        pending.remove(r)
        row = work[r]
        if not row:
            most = max(map(abs, combos[r].values()))
            involved = tuple(i for i in sorted(combos[r]) if abs(combos[r][i]) > TOLERANCE * most)
            found = Combination(involved, tuple(combos[r][i] for i in involved), constant=rhs[r], last=r)
            vanishes = abs(rhs[r]) <= TOLERANCE * max(1.0, *(abs(constants[i]) for i in combos[r]))
            (redundant if vanishes else contradictory).append(found)
            continue
        pivot = min(row, key=lambda v: (abs(row[v]) < 0.1 * max(map(abs, row.values())), len(holders[v]), v))
        if len(row) == 1:
            grounded = any(i in fixing for i in combos[r])
            if len(combos[r]) > 1 and not grounded and pivot not in may_stand and rhs[r] == 0.0:
                involved = tuple(sorted(combos[r]))
                contradictory.append(Combination(involved, tuple(combos[r][i] for i in involved), pivot))
        for other in sorted(holders[pivot] & pending):
            factor = work[other][pivot] / row[pivot]
            for v, c in row.items():
                value = work[other].get(v, 0.0) - factor * c
                if v == pivot or abs(value) <= TOLERANCE * max(scale[other], abs(factor) * scale[r]):
                    work[other].pop(v, None)
                    holders[v].discard(other)
                else:
                    work[other][v] = value
                    holders[v].add(other)
            heappush(heap, (len(work[other]), other))
            rhs[other] -= factor * rhs[r]
            for i, c in combos[r].items():
                combos[other][i] = combos[other].get(i, 0.0) - factor * c
    return Loops(tuple(redundant), tuple(contradictory))


def core(rows: Sequence[Mapping[int, float]]) -> list[int]:
    """The 2-core of the rows: those left after repeatedly removing rows with a variable of their own."""
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
        if alone is None or degree[v] != 1:
            continue
        gone.add(alone)
        for u, c in rows[alone].items():
            if c != 0.0:
                degree[u] -= 1
                if degree[u] == 1:
                    stack.append(u)
    return [r for r in range(len(rows)) if r not in gone]


def null_space(rows: Sequence[Mapping[int, float]], columns: Iterable[int] = ()) -> dict[int, Floats]:
    """The solutions of ``sum(row[v] * x[v]) = 0``: of each column that is not zero in all of them, its values in a basis.

    The basis is orthonormal, so that the scalar products of columns' values do not depend on the order of rows and columns.

    Parameters
    ----------
    rows : sequence of mappings
        Coefficient of each column.
    columns : iterable of int
        Columns that count even if they are in no row.

    Examples
    --------
    The torques x1, x2 of two gears side by side share the known torque x0:

    >>> values = null_space([{0: 1.0}, {0: 1.0, 1: 1.0, 2: 1.0}])
    >>> sorted(values), round(float(values[1] @ values[2]), 6)
    ([1, 2], -0.5)
    """
    work = [{v: c for v, c in row.items() if c != 0.0} for row in rows]
    scale = [max((abs(c) for c in row.values()), default=1.0) for row in work]
    holders: dict[int, set[int]] = defaultdict(set, {v: set() for v in columns})
    for r, row in enumerate(work):
        for v in row:
            holders[v].add(r)
    heap = [(len(row), r) for r, row in enumerate(work) if row]
    heapify(heap)
    pivots: list[tuple[int, dict[int, float]]] = []
    while heap:
        length, r = heappop(heap)
        row = work[r]
        if not row or length != len(row):
            continue
        largest = max(map(abs, row.values()))
        pivot = min(row, key=lambda v: (abs(row[v]) < 0.1 * largest, len(holders[v]), v))
        pivots.append((pivot, row))
        work[r] = {}
        for v in row:
            holders[v].discard(r)
        for other in sorted(holders[pivot]):
            factor = work[other][pivot] / row[pivot]
            for v, c in row.items():
                value = work[other].get(v, 0.0) - factor * c
                if v == pivot or abs(value) <= TOLERANCE * max(scale[other], abs(factor) * scale[r]):
                    work[other].pop(v, None)
                    holders[v].discard(other)
                else:
                    work[other][v] = value
                    holders[v].add(other)
            heappush(heap, (len(work[other]), other))
    free = sorted(set(holders) - {pivot for pivot, _ in pivots})
    if not free:
        return {}
    values: dict[int, Floats] = dict(zip(free, np.eye(len(free)), strict=True))
    for pivot, row in reversed(pivots):
        terms = [c / row[pivot] * values[v] for v, c in row.items() if v in values]
        if terms:
            total = np.sum(terms, axis=0)
            total[np.abs(total) <= TOLERANCE * np.abs(terms).max(axis=0)] = 0.0
            if total.any():
                values[pivot] = -total
    basis = np.linalg.qr(np.array(list(values.values())))[0]
    return dict(zip(values, basis, strict=True))


def determining(values: Mapping[int, Floats], order: Iterable[int]) -> list[int]:
    """Columns that leave only x = 0 of a null space when they are set to zero: the first ones of an order that will do.

    >>> determining(null_space([{0: 1.0, 1: 1.0, 2: 1.0}, {2: 1.0}]), [2, 1, 0])
    [1]
    """
    chosen: list[int] = []
    dimension = len(next(iter(values.values()), ()))
    directions = np.empty((dimension, dimension))  # orthonormal, one for each column that was chosen
    for column in order:
        if len(chosen) == dimension:
            break
        if column not in values:
            continue
        known, rest = directions[: len(chosen)], values[column]
        for _ in range(2):  # twice is enough
            rest = rest - (known @ rest) @ known
        size = float(np.linalg.norm(rest))
        if size > INDEPENDENT * float(np.linalg.norm(values[column])):
            directions[len(chosen)] = rest / size
            chosen.append(column)
    return chosen
