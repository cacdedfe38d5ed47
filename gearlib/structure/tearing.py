"""Tearing of algebraic loops: a small set of iteration unknowns, from which the others follow in sequence.

A greedy choice in the manner of Cellier: an unknown that a single equation determines is eliminated; where there is none, the unknown
in the most equations becomes a tearing variable (F. E. Cellier and E. Kofman, "Continuous System Simulation", Springer 2006, section
7.4, doi 10.1007/0-387-30260-3).
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Tearing:
    """Order of rows and columns with a lower triangular leading part.

    The first ``lead`` rows each determine the column of equal index; the columns after these are the tearing variables, the rows after
    these their residual equations.
    """

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    lead: int

    @property
    def tears(self) -> tuple[int, ...]:
        return self.columns[self.lead :]


def tear(rows: Sequence[Mapping[int, bool]]) -> Tearing:
    """Tear a square block.

    Parameters
    ----------
    rows : sequence of mappings
        Columns of each row, and whether the row can be solved for them.

    Examples
    --------
    x0 = f(x1), x1 = g(x0): one of them is a tearing variable.

    >>> t = tear([{0: True, 1: True}, {0: True, 1: True}])
    >>> t.lead, t.tears
    (1, (0,))
    """
    n = len(rows)
    unknown = [set(row) for row in rows]
    holders: dict[int, list[int]] = {}
    for r, row in enumerate(rows):
        for c in row:
            holders.setdefault(c, []).append(r)
    open_rows = set(range(n))
    order: list[tuple[int, int]] = []
    tears: list[int] = []
    by_count = iter(sorted(range(n), key=lambda c: -len(holders.get(c, ()))))  # no row that is solved holds an open column
    known: set[int] = set()
    ready = [r for r in range(n) if len(unknown[r]) == 1]
    while len(order) + len(tears) < n:
        solvable = (heapq.heappop(ready) for _ in range(len(ready)))
        solved = next((r for r in solvable if len(unknown[r]) == 1 and rows[r][next(iter(unknown[r]))]), None)
        if solved is not None:
            column = next(iter(unknown[solved]))
            order.append((solved, column))
            open_rows.remove(solved)
        else:
            column = next(c for c in by_count if c not in known)
            tears.append(column)
        known.add(column)
        for r in holders.get(column, ()):
            unknown[r].discard(column)
            if len(unknown[r]) == 1:
                heapq.heappush(ready, r)
    return Tearing((*(r for r, _ in order), *sorted(open_rows)), (*(c for _, c in order), *tears), len(order))
