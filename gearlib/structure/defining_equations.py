"""Derivatives that occur in no equation, obtained by differentiating their defining equations.

If the matched equations can be solved for some unknowns, their derivatives can be solved for the derivatives of these, with the same
matching. So the derivative of any output is available, and equations are differentiated only on demand.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from gearlib.structure.incidence import Columns, Node


class Determined(dict[Node, Node]):
    """Matching of equations to unknowns, extended on demand to their derivatives.

    Iteration and ``in`` cover the unknowns of the model; ``[]`` also returns the equation of a derivative.

    Parameters
    ----------
    solved_by : mapping
        Equation matched to each unknown.
    columns : callable
        Lists the nodes in an equation's derivatives.
    states, given : collections
        States; and variables given from outside, whose derivatives are not known.
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
        """Whether a node is determined, or can be by differentiation."""
        if node not in self._known:
            self._known[node] = node in self or self._can_be_computed(node)
        return self._known[node]

    def _can_be_computed(self, node: Node) -> bool:
        """Whether everything that a derivative depends on is determined, down to the nodes of the model."""
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
