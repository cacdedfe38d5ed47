"""Sparse row elimination: the step shared by all numerical eliminations.

They differ in what is eliminated, in which order, and in what is recorded: `gearlib.structure.rigid_loops` records combinations,
`gearlib.structure.states` chooses columns by preference, `gearlib.structure.sparse_elimination` finds the rank of large matrices.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from typing import TypeVar

R = TypeVar("R")
C = TypeVar("C")


def holders_of(rows: Mapping[R, Mapping[C, float]]) -> dict[C, set[R]]:
    """For each column the rows that contain it."""
    found: dict[C, set[R]] = defaultdict(set)
    for r, row in rows.items():
        for c in row:
            found[c].add(r)
    return found


def sizes_of(rows: Mapping[R, Mapping[C, float]]) -> dict[R, float]:
    """Largest coefficient of each row; 1 for an empty one."""
    return {r: max(map(abs, row.values()), default=1.0) for r, row in rows.items()}


def eliminate(
    rows: Mapping[R, dict[C, float]], holders: Mapping[C, set[R]], pivot: R, column: C, among: Collection[R],
    sizes: Mapping[R, float] | None = None, rounding: float = 0.0,
) -> Iterator[tuple[R, float]]:  # fmt: skip
    """Subtract multiples of a row from others so that a column vanishes from them; ``rows`` and ``holders`` are modified.

    Parameters
    ----------
    rows : mapping of mappings
        Coefficients by column.
    holders : mapping of sets
        For each column the rows that contain it.
    pivot, column : a row, and one of its columns
    among : collection of rows
        The other rows.
    sizes : mapping, optional
        A magnitude per row. The result of a subtraction counts as zero below ``rounding`` times the magnitudes of the two rows, by
        default of the two numbers.

    Yields
    ------
    row, factor
        Each modified row, and the multiple that was subtracted.

    Examples
    --------
    >>> rows = {0: {7: 2.0, 8: 1.0}, 1: {7: 1.0, 8: 0.5, 9: 3.0}}
    >>> holders = holders_of(rows)
    >>> list(eliminate(rows, holders, 0, 7, {1}, sizes_of(rows), 1e-12)), rows[1], sorted(holders[8])
    ([(1, 0.5)], {9: 3.0}, [0])
    """
    source = rows[pivot]
    divisor = source[column]
    rest = [(c, v) for c, v in source.items() if c != column]
    for other in sorted(holders[column].intersection(among)):  # type: ignore[type-var]
        row = rows[other]
        factor = row.pop(column) / divisor
        holders[column].discard(other)
        least = None if sizes is None else rounding * max(sizes[other], abs(factor) * sizes[pivot])
        for c, v in rest:
            old, term = row.get(c, 0.0), factor * v
            value = old - term
            if abs(value) <= (rounding * max(abs(old), abs(term)) if least is None else least):
                if row.pop(c, None) is not None:
                    holders[c].discard(other)
            else:
                row[c] = value
                holders[c].add(other)
        yield other, factor
