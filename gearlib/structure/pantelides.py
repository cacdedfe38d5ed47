"""Pantelides' algorithm: how often each equation must be differentiated until the system can be solved for its highest derivatives.

C. C. Pantelides, "The consistent initialization of differential-algebraic systems", SIAM Journal on Scientific and Statistical
Computing 9 (1988) 213-231, doi 10.1137/0909014. The system must be structurally nonsingular (`balance` is checked first).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import networkx as nx

from gearlib.errors import SingularError
from gearlib.structure.dulmage_mendelsohn import MOST_IN_GRAPHS, alternating_reach, bipartite_graph
from gearlib.structure.incidence import Columns, Node


@dataclass(frozen=True)
class Differentiation:
    """The result of Pantelides' algorithm."""

    counts: tuple[int, ...]  # per equation, how often it is differentiated
    orders: Mapping[int, int]  # per variable, the order of its highest derivative
    assignment: Mapping[int, int]  # equation -> the variable whose highest derivative it determines

    @property
    def index(self) -> int:
        """Structural index of the system as written (0: an ODE; 1: algebraic unknowns; higher: constraints on states)."""
        algebraic = any(order == 0 for order in self.orders.values())
        return max(self.counts, default=0) + int(algebraic)


def pantelides(n_equations: int, columns: Columns) -> Differentiation:
    """Differentiation counts, highest orders, and an assignment of highest derivatives to equations.

    Up to `MOST_IN_GRAPHS` equations it works on networkx graphs, beyond that on lists.

    Parameters
    ----------
    n_equations : int
        Number of equations.
    columns : callable
        ``columns(e, k)`` lists the (variable, order) of the k-th derivative of equation e.

    Raises
    ------
    SingularError
        The system is structurally singular.

    Examples
    --------
    The pendulum of Pantelides' paper (x'' = T x, y'' = T y - g, x^2 + y^2 = L^2) with x, y, T = 0, 1, 2: the constraint is
    differentiated twice.

    >>> rows = [[(0, 2), (2, 0), (0, 0)], [(1, 2), (2, 0), (1, 0)], [(0, 0), (1, 0)]]
    >>> def columns(e, k):
    ...     return sorted({(v, order + j) for v, order in rows[e] for j in range(k + 1)})
    >>> pantelides(3, columns).counts
    (0, 0, 2)
    """
    return by_graph(n_equations, columns) if n_equations <= MOST_IN_GRAPHS else by_lists(n_equations, columns)


def by_graph(n_equations: int, columns: Columns) -> Differentiation:
    """Pantelides' algorithm built on networkx: Hopcroft-Karp matchings, and the descendants of unmatched equations.

    The equations are matched with their variables of highest order. What alternating paths reach from an unmatched equation is a
    minimally structurally singular subset, so all of it must be differentiated; the subsets of several unmatched equations can be
    differentiated together, before matching again. The counts are minimal, and so equal to those of `by_lists`.
    """
    counts = [0] * n_equations
    current = [columns(e, 0) for e in range(n_equations)]
    orders: dict[int, int] = {}
    for row in current:
        _raise(orders, row)
    most = (n_equations - 1) * max(orders.values(), default=0)
    while True:
        graph, variables = bipartite_graph([[v for v, order in row if order == orders[v]] for row in current])
        partner = nx.bipartite.hopcroft_karp_matching(graph, range(n_equations))
        unmatched = [e for e in range(n_equations) if e not in partner]
        if not unmatched:
            return Differentiation(tuple(counts), orders, {e: variables[partner[e] - n_equations] for e in range(n_equations)})
        reached = sorted(alternating_reach(graph, partner, unmatched))
        _differentiate(reached[: bisect_left(reached, n_equations)], counts, current, orders, columns, most)


def _differentiate(
    equations: Sequence[int], counts: list[int], current: list[list[Node]], orders: dict[int, int], columns: Columns, most: int
) -> None:
    """Differentiate some equations once more, as far as a nonsingular system may need it.

    In one, an equation is differentiated no more often than along a chain of all equations, from each of which to the next the highest
    order rises by the largest order that is written.
    """
    for e in equations:
        counts[e] += 1
        if counts[e] > most:
            raise SingularError("the equations determine no highest derivatives, however often they are differentiated")
        current[e] = columns(e, counts[e])
        _raise(orders, current[e])


def _raise(orders: dict[int, int], row: Sequence[Node]) -> None:
    """Raise the highest orders to those of an equation."""
    for v, order in row:
        if order > orders.get(v, -1):
            orders[v] = order


def by_lists(n_equations: int, columns: Columns) -> Differentiation:
    """Pantelides' algorithm as published, one equation at a time and without a graph: for the many equations of large trains."""
    counts = [0] * n_equations
    current = [columns(e, 0) for e in range(n_equations)]
    orders: dict[int, int] = {}
    for row in current:
        _raise(orders, row)
    most = (n_equations - 1) * max(orders.values(), default=0)
    owner: dict[int, int] = {}  # variable (at its highest order) -> equation
    for e in range(n_equations):
        while True:
            coloured = _augment(e, current, orders, owner)
            if not coloured:
                break
            _differentiate(coloured, counts, current, orders, columns, most)
    return Differentiation(tuple(counts), orders, {e: v for v, e in owner.items()})


def _augment(start: int, current: list[list[tuple[int, int]]], orders: Mapping[int, int], owner: dict[int, int]) -> list[int]:
    """Augment the matching by equation ``start``; returns nothing on success, else the coloured equations."""
    for v, order in current[start]:  # free variable
        if order == orders[v] and v not in owner:
            owner[v] = start
            return []
    came_from: dict[int, int] = {}  # variable -> equation that reached it
    coloured, stack = [start], [start]
    while stack:
        e = stack.pop()
        for v, order in current[e]:
            if order != orders[v] or v in came_from:
                continue
            came_from[v] = e
            if v not in owner:
                while True:  # shift the partners along the path
                    e = came_from[v]
                    previous = next((u for u, holder in ((u, owner.get(u)) for u, _ in current[e]) if holder == e), None)
                    owner[v] = e
                    if e == start:
                        return []
                    assert previous is not None
                    v = previous
            coloured.append(owner[v])
            stack.append(owner[v])
    return coloured
