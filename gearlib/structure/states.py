"""The choice of states, by dummy derivatives.

For each differentiated constraint one derivative that it holds becomes a "dummy": an unknown like any other, so that its integral
is no state. Which ones, is a matter of preference (absolute angles first) among the choices that keep the constraints solvable,
and that is checked with numbers: a structurally sound pivot can be zero in a gear loop.

S. E. Mattsson and G. Soderlind, "Index reduction in differential-algebraic equations using dummy derivatives", SIAM Journal on
Scientific Computing 14 (1993) 677-692, doi 10.1137/0914043.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gearlib.structure.incidence import Entries, Node
from gearlib.structure.pantelides import Differentiation

ZERO = 1e-11  # of a row's largest coefficient


@dataclass(frozen=True)
class StateChoice:
    """Which nodes are states, and which equation determines each other one.

    A node (v, k) is the k-th derivative of variable v; an equation (e, k) the k-th derivative of equation e.
    """

    states: tuple[Node, ...]
    solved_by: Mapping[Node, Node]
    singular: tuple[int, ...]  # equations left without a pivot


def choose_states(
    result: Differentiation, entries: Entries, badness: Mapping[Node, tuple[float, ...]]
) -> StateChoice:
    """Select dummy derivatives.

    Parameters
    ----------
    result : Differentiation
        Of Pantelides' algorithm.
    entries : Entries
        Partial derivatives of the differentiated equations (as written) with respect to each variable and order.
    badness : mapping
        Of each candidate node (v, k), how little it is wanted as a state; larger is worse.
    """
    counts, orders = result.counts, result.orders
    solved_by: dict[Node, Node] = {(v, orders[v]): (e, counts[e]) for e, v in result.assignment.items()}
    coefficients: dict[int, dict[int, float]] = defaultdict(dict)
    for e, v, order, value in zip(
        entries.rows.tolist(), entries.variables.tolist(), entries.orders.tolist(), entries.values.tolist(), strict=True
    ):
        if order == orders[v] - counts[e] and value != 0.0:
            coefficients[e][v] = coefficients[e].get(v, 0.0) + value
    dummies: set[Node] = set()
    candidates = {v for v, order in orders.items() if order >= 1}
    rows = [e for e, c in enumerate(counts) if c >= 1]
    singular: list[int] = []
    stage = 1
    while rows:
        pivots, failed = select_columns(
            {e: {v: a for v, a in coefficients[e].items() if v in candidates} for e in rows},
            {v: badness.get((v, orders[v] - stage), (0.0,)) for v in candidates},
        )
        singular += failed
        for e, v in pivots.items():
            dummies.add((v, orders[v] - stage + 1))
            solved_by[v, orders[v] - stage] = (e, counts[e] - stage)
        stage += 1
        chosen = set(pivots.values())
        candidates = {v for v in chosen if orders[v] >= stage}
        rows = [e for e in rows if counts[e] >= stage and e in pivots]
    states = tuple(
        (v, k) for v, order in sorted(orders.items()) for k in range(order) if (v, k + 1) not in dummies
    )
    return StateChoice(states, solved_by, tuple(singular))


def select_columns(
    rows: Mapping[int, Mapping[int, float]], badness: Mapping[int, Sequence[float]]
) -> tuple[dict[int, int], list[int]]:
    """Independent columns, the worst first: row -> column, and the rows that found none.

    Columns are taken in the order of their badness; each becomes the pivot of a row unless it depends on the earlier ones, as the
    greedy algorithm for a basis of greatest weight has it. Among equals a column with few entries goes first, which keeps the
    elimination sparse.

    Examples
    --------
    >>> select_columns({0: {7: -1.0, 8: 1.0, 9: 1.0}}, {7: (3,), 8: (3,), 9: (1,)})
    ({0: 7}, [])
    """
    work = {r: dict(row) for r, row in rows.items()}
    scale = {r: max((abs(a) for a in row.values()), default=1.0) for r, row in rows.items()}
    holders: dict[int, set[int]] = defaultdict(set)
    for r, row in work.items():
        for v in row:
            holders[v].add(r)
    largest = {v: max(abs(work[r][v]) / scale[r] for r in rs) for v, rs in holders.items()}
    queue = sorted(holders, key=lambda v: ([-b for b in badness.get(v, (0.0,))], len(holders[v]), -largest[v], v))
    open_rows = set(work)
    pivots: dict[int, int] = {}
    for column in queue:
        usable = [r for r in holders[column] & open_rows if abs(work[r][column]) > ZERO * scale[r]]
        if not usable:
            continue
        best = max(abs(work[r][column]) / scale[r] for r in usable)
        pivot = min((r for r in usable if abs(work[r][column]) >= 0.1 * best * scale[r]), key=lambda r: (len(work[r]), r))
        pivots[pivot] = column
        open_rows.remove(pivot)
        for r in sorted(usable):
            if r == pivot:
                continue
            factor = work[r][column] / work[pivot][column]
            for v, a in work[pivot].items():
                value = work[r].get(v, 0.0) - factor * a
                if v == column or abs(value) <= ZERO * max(scale[r], abs(factor) * scale[pivot]):
                    work[r].pop(v, None)
                    holders[v].discard(r)
                else:
                    work[r][v] = value
                    holders[v].add(r)
        if not open_rows:
            break
    return pivots, sorted(open_rows)
