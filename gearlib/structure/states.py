"""State selection: dummy derivatives by column choice with numerical pivoting.

After Pantelides' algorithm every equation but its last derivative is a constraint on what could be a state: on all derivatives of
variables but the highest. As many of them as there are constraints are solved for; the rest are states. Any choice that keeps the
constraints solvable will do, so it is made by preference (absolute angles are given up first), and solvability is checked with
numbers, since a structurally sound pivot can be zero in a gear loop. The derivatives that are solved for, and so are not integrals
of anything, are the dummy derivatives of Mattsson and Soderlind; unlike theirs, the choice on one level of differentiation does not
bind that on another, so that a deflection can be a state where the angles on both its sides are differentiated twice.

S. E. Mattsson and G. Soderlind, "Index reduction in differential-algebraic equations using dummy derivatives", SIAM Journal on
Scientific Computing 14 (1993) 677-692, doi 10.1137/0914043.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gearlib.structure.dulmage_mendelsohn import maximum_matching
from gearlib.structure.incidence import Entry, Node
from gearlib.structure.pantelides import Differentiation
from gearlib.structure.sparse_rows import eliminate, holders_of, sizes_of

ZERO = 1e-11  # of a row's largest coefficient
FILLED = 8  # times as many entries as a column had: it has filled up


@dataclass(frozen=True)
class StateChoice:
    """Which nodes are states, and which equation determines each other one.

    A node (v, k) is the k-th derivative of variable v; an equation (e, k) the k-th derivative of equation e.
    """

    states: tuple[Node, ...]
    solved_by: Mapping[Node, Node]
    singular: tuple[int, ...]  # equations left without a pivot


def choose_states(
    result: Differentiation,
    entries: Iterable[Entry],
    badness: Mapping[Node, tuple[float, ...]],
    varying: frozenset[int] = frozenset(),
    ranks: Sequence[int] | None = None,
) -> StateChoice:
    """Select the states.

    Parameters
    ----------
    result : Differentiation
        Of Pantelides' algorithm.
    entries : iterable of (equation, variable, order, value)
        Partial derivatives of the differentiated equations (as written) with respect to each variable and order.
    badness : mapping
        Of each candidate node (v, k), how little it is wanted as a state; larger is worse.
    varying : frozenset of int
        Equations whose coefficients change during a run.
    ranks : sequence of int, optional
        Of each variable: of equals the one with the lowest rank is no state. By default the variables' numbers.
    """
    counts, orders = result.counts, result.orders
    solved_by: dict[Node, Node] = {(v, orders[v]): (e, counts[e]) for e, v in result.assignment.items()}
    rows: dict[Node, dict[Node, float]] = {(e, k): {} for e, c in enumerate(counts) for k in range(c)}
    for e, v, order, value in entries:
        for k in range(counts[e]):
            if value != 0.0 and order + k < orders[v]:
                rows[e, k][v, order + k] = rows[e, k].get((v, order + k), 0.0) + value
    chosen, failed = select_columns(rows, badness, varying, ranks=ranks)
    keys = list(rows)
    partner = maximum_matching([[n for n, a in rows[key].items() if n in chosen and a != 0.0] for key in keys])
    solved_by.update({node: keys[r] for r, node in partner.items()})
    states = tuple((v, k) for v, order in sorted(orders.items()) for k in range(order) if (v, k) not in chosen)
    return StateChoice(states, solved_by, tuple(sorted({e for e, _ in failed})))


def select_columns(
    rows: Mapping[Node, Mapping[Node, float]],
    badness: Mapping[Node, Sequence[float]],
    varying: frozenset[int] = frozenset(),
    zero: float = ZERO,
    ranks: Sequence[int] | None = None,
) -> tuple[set[Node], list[Node]]:
    """Independent columns, one per row, least wanted first; and the rows without one.

    Columns are taken in the order of their badness; each is chosen unless it depends on the earlier ones, as the greedy algorithm
    for a basis of greatest weight has it. Among equals a column with few entries goes first, which keeps the elimination sparse; but
    in an equation with ``varying`` coefficients the one with the largest coefficient does, which is the farthest from vanishing. What
    is left of a row below ``zero`` of its largest coefficient says nothing.

    Examples
    --------
    A deflection is the difference of two angles; the first angle is given up:

    >>> select_columns({(0, 0): {(7, 0): -1.0, (8, 0): 1.0, (9, 0): 1.0}}, {(7, 0): (3,), (8, 0): (3,), (9, 0): (1,)})
    ({(7, 0)}, [])
    """
    work = {r: {v: a for v, a in row.items() if a != 0.0} for r, row in rows.items()}
    scale, holders = sizes_of(work), holders_of(work)
    largest = {v: max(abs(work[r][v]) / scale[r] for r in rs) for v, rs in holders.items()}
    entries = {v: len(rs) for v, rs in holders.items()}

    def key(v: Node) -> Any:
        """The first one has the largest."""
        return badness.get(v, (0.0,)), -entries[v], largest[v], (-(v[0] if ranks is None else ranks[v[0]]), -v[1])

    waiting = sorted(holders, key=key)
    open_rows = set(work)
    chosen: set[Node] = set()
    while waiting and open_rows:
        column = waiting.pop()
        if column in chosen:
            continue
        if len(holders[column]) > FILLED * entries[column]:  # a column that has filled up waits behind its equals
            entries[column] = len(holders[column])
            insort(waiting, column, key=key)
            continue
        usable = [r for r in holders[column] & open_rows if abs(work[r][column]) > zero * scale[r]]
        if not usable:
            continue
        best = max(abs(work[r][column]) / scale[r] for r in usable)
        good = (r for r in usable if abs(work[r][column]) >= 0.1 * best * scale[r])
        pivot = min(good, key=lambda r: (len(work[r]), r))
        row = work[pivot]
        if pivot[0] in varying:
            equals = [v for v in row if badness.get(v) == badness.get(column) and v not in chosen]
            largest_one = max(equals, key=lambda v: abs(row[v]))
            if abs(row[largest_one]) > (1 + 1e-6) * abs(row[column]):
                waiting.append(column)
                column = largest_one
        chosen.add(column)
        open_rows.remove(pivot)
        for _ in eliminate(work, holders, pivot, column, open_rows, scale, zero):
            pass
    return chosen, sorted(open_rows)
