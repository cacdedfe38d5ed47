"""Derivatives that occur in no equation, from the defining equations differentiated once more.

If the matched equations can be solved for some unknowns, their derivatives can be solved for the derivatives of these, with the same
matching. So the derivative of any output can be asked for; nothing is differentiated unless one is.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from gearlib.structure.incidence import Columns, Node


class Determined(dict[Node, Node]):
    """Which equation determines each unknown, and on demand each derivative of one.

    Iteration and ``in`` go over the unknowns of the model, ``[]`` also gives the equation of a derivative.

    Parameters
    ----------
    solved_by : mapping
        The equation of each unknown.
    columns : callable
        What stands in an equation's derivatives.
    states, given : collections
        States; and variables that come from outside, whose derivatives are not known.
    """

    def __init__(
        self, solved_by: Mapping[Node, Node], columns: Columns, states: Collection[Node], given: Collection[int]
    ) -> None:
        super().__init__(solved_by)
        self._columns, self._states, self._given = columns, frozenset(states), frozenset(given)
        self._known: dict[Node, bool] = {}

    def __missing__(self, node: Node) -> Node:
        v, k = node
        if k == 0 or node in self._states:
            raise KeyError(node)
        e, j = self[v, k - 1]
        return e, j + 1

    def knows(self, node: Node) -> bool:
        """Whether something determines a node, or can be differentiated to do so."""
        if node not in self._known:
            self._known[node] = node in self or self._can_be_computed(node)
        return self._known[node]

    def _can_be_computed(self, node: Node) -> bool:
        """Whether all that a derivative depends on is determined, down to what the model holds."""
        if not any((node[0], k) in self for k in range(node[1])):
            return False
        stack, seen = [node], {node}
        while stack:
            e, j = self[stack.pop()]
            for other in self._columns(e, j):
                if other[0] in self._given:
                    if other[1]:
                        return False
                elif other not in seen and other not in self._states and other not in self:
                    seen.add(other)
                    stack.append(other)
        return True
