"""State selection: dummy derivatives by greedy column choice with numerical pivoting.

After Pantelides' algorithm every equation except its highest derivative is a constraint on the state candidates, which are all but the
highest derivatives of variables. The constraints are solved for as many candidates as there are constraints; the rest are states. Any
choice that keeps the constraints solvable is valid, so it is made by preference (absolute angles are eliminated first), and solvability
is checked numerically, since a structurally sound pivot can be zero in a gear loop. The derivatives that are solved for, and so are not
integrals of anything, are the dummy derivatives of Mattsson and Soderlind; unlike theirs, the choices at different levels of
differentiation are independent, so that a deflection can be a state while the angles on both sides are differentiated twice.

S. E. Mattsson and G. Soderlind, "Index reduction in differential-algebraic equations using dummy derivatives", SIAM Journal on
Scientific Computing 14 (1993) 677-692, doi 10.1137/0914043.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from gearlib.structure.dulmage_mendelsohn import maximum_matching
from gearlib.structure.incidence import Entry, Node
from gearlib.structure.pantelides import Differentiation
from gearlib.structure.sparse_rows import eliminate, holders_of, sizes_of

ZERO = 1e-11  # relative to a row's largest coefficient
FILLED = 8  # ratio of a column's entries to their original number that counts as fill-in


def constraints(result: Differentiation, entries: Iterable[Entry]) -> dict[Node, dict[Node, float]]:
    """The constraints on the state candidates: all but the highest derivatives of each equation, as rows of coefficients.

    Parameters
    ----------
    result : Differentiation
        Result of Pantelides' algorithm.
    entries : iterable of (equation, variable, order, value)
        Partial derivatives of the differentiated equations (as written) with respect to each variable and order.
    """
    counts, orders = result.counts, result.orders
    rows: dict[Node, dict[Node, float]] = {(e, k): {} for e, c in enumerate(counts) for k in range(c)}
    for e, v, order, value in entries:
        for k in range(counts[e]):
            if value != 0.0 and order + k < orders.get(v, 0):  # what is given has no order
                rows[e, k][v, order + k] = rows[e, k].get((v, order + k), 0.0) + value
    return rows


def matched(
    result: Differentiation, rows: Mapping[Node, Mapping[Node, float]], eliminated: Collection[Node]
) -> dict[Node, Node]:
    """The equation matched to each node that is no state: highest derivatives, and the candidates that constraints eliminate."""
    solved_by: dict[Node, Node] = {(v, result.orders[v]): (e, result.counts[e]) for e, v in result.assignment.items()}
    keys = list(rows)
    partner = maximum_matching([[n for n, a in rows[key].items() if n in eliminated and a != 0.0] for key in keys])
    solved_by.update({node: keys[r] for r, node in partner.items()})
    return solved_by


def select_columns(
    rows: Mapping[Node, Mapping[Node, float]],
    badness: Mapping[Node, Sequence[float]],
    varying: frozenset[int] = frozenset(),
    zero: float = ZERO,
    ranks: Sequence[int] | None = None,
) -> tuple[set[Node], list[Node]]:
    """Select the nodes that are eliminated, as independent columns, one per constraint, least wanted first; and the rows without one.

    Columns are considered in order of badness; each is chosen unless it depends on earlier ones (the greedy algorithm for a
    maximum-weight basis). Among equals, columns with few entries come first, which keeps the elimination sparse; but in an equation
    with ``varying`` coefficients the one with the largest coefficient does, being farthest from zero. A row whose remainder is below
    ``zero`` of its largest coefficient is dependent.

    Parameters
    ----------
    rows : mapping
        Coefficients of the nodes in each constraint.
    badness : mapping
        Sort key of each candidate node (v, k): larger means less wanted as a state.
    varying : frozenset of int
        Equations with coefficients that change during a run.
    ranks : sequence of int, optional
        Tie-break between equal candidates: the one whose variable has the lowest rank is not a state. By default the variables'
        numbers.

    Examples
    --------
    A deflection is the difference of two angles; the first angle is eliminated:

    >>> select_columns({(0, 0): {(7, 0): -1.0, (8, 0): 1.0, (9, 0): 1.0}}, {(7, 0): (3,), (8, 0): (3,), (9, 0): (1,)})
    ({(7, 0)}, [])
    """
    work = {r: {v: a for v, a in row.items() if a != 0.0} for r, row in rows.items()}
    scale, holders = sizes_of(work), holders_of(work)
    largest = {v: max([abs(work[r][v]) / scale[r] for r in rs]) for v, rs in holders.items()}
    entries = {v: len(rs) for v, rs in holders.items()}

    def key(v: Node) -> Any:
        """The first of these has the largest coefficient."""
        return badness.get(v, (0.0,)), -entries[v], largest[v], (-(v[0] if ranks is None else ranks[v[0]]), -v[1])

    waiting = sorted(holders, key=key)
    open_rows = set(work)
    chosen: set[Node] = set()
    while waiting and open_rows:
        column = waiting.pop()
        if column in chosen:
            continue
        if len(holders[column]) > FILLED * entries[column]:  # a column with fill-in goes behind its equals
            entries[column] = len(holders[column])
            insort(waiting, column, key=key)
            continue
        usable = [r for r in holders[column] & open_rows if abs(work[r][column]) > zero * scale[r]]
        if not usable:
            continue
        best = max([abs(work[r][column]) / scale[r] for r in usable])
        good = [r for r in usable if abs(work[r][column]) >= 0.1 * best * scale[r]]
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
