"""`Dependence`: which nodes are states, which equation determines each other node, and on which nodes it depends."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from gearlib.structure.incidence import Columns, Node


@dataclass(frozen=True, eq=False)
class Dependence:
    """The states, and the dependency graph of all other nodes.

    A node (v, k) is the k-th derivative of variable v; an equation (e, k) the k-th derivative of equation e. Derivatives that occur in
    no equation are obtained by differentiating their defining equations: if the matched equations can be solved for some unknowns,
    their derivatives can be solved for the derivatives of these, with the same matching. So the derivative of any output is available,
    and equations are differentiated only on demand.

    Attributes
    ----------
    states : tuple of Node
    solved_by : mapping
        Equation matched to each other node of the model.
    columns : callable
        Lists the nodes in an equation's derivatives.
    given : frozenset of int
        Variables given from outside, whose derivatives are not known.
    at_events : mapping
        Per equation: the nodes that determine its relations and discrete variables.
    at_reinits : mapping
        Per state that events set: the nodes that determine its new value, and when it is set.
    """

    states: tuple[Node, ...]
    solved_by: Mapping[Node, Node]
    columns: Columns
    given: frozenset[int] = frozenset()
    at_events: Mapping[int, Sequence[Node]] = field(default_factory=dict)
    at_reinits: Mapping[Node, Sequence[Node]] = field(default_factory=dict)
    is_state: frozenset[Node] = field(init=False)
    _known: dict[Node, bool] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "is_state", frozenset(self.states))

    def equation(self, node: Node) -> Node:
        """The equation that determines a node, if need be the derivative of one of the model's."""
        found = self.solved_by.get(node)
        if found is not None:
            return found
        v, k = node
        if k == 0 or node in self.is_state:
            raise KeyError(node)
        e, j = self.equation((v, k - 1))
        return e, j + 1

    def of(self, node: Node) -> list[Node]:
        """The other nodes in the equation that determines ``node``."""
        e, k = self.equation(node)
        return [n for n in self.columns(e, k) if n != node and n[0] not in self.given]

    def computes(self, node: Node) -> bool:
        """Whether a node is a state, given, or computable from these, if need be by differentiation."""
        if node in self.is_state or node in self.solved_by:
            return node not in self._beyond_given
        if node[0] in self.given:
            return node[1] == 0
        if node not in self._known:
            self._known[node] = self._can_be_computed(node)
        return self._known[node]

    def needing(self, equations: Collection[Node]) -> set[Node]:
        """The nodes of the model that are determined by some equations, or by nodes that are, other than through states."""
        needed_by: defaultdict[Node, list[Node]] = defaultdict(list)
        stack = []
        for node, place in self.solved_by.items():
            for other in self.of(node):
                needed_by[other].append(node)
            if place in equations:
                stack.append(node)
        found = set(stack)
        while stack:
            following = [n for n in needed_by[stack.pop()] if n not in found]
            found.update(following)
            stack += following
        return found

    @cached_property
    def with_rates_of_given(self) -> frozenset[Node]:
        """Equations that contain the derivative of what is given."""
        if not self.given:
            return frozenset()
        return frozenset(e for e in self.solved_by.values() if any(k and v in self.given for v, k in self.columns(*e)))

    @cached_property
    def _beyond_given(self) -> set[Node]:
        return self.needing(self.with_rates_of_given) if self.with_rates_of_given else set()

    def _can_be_computed(self, node: Node) -> bool:
        """Whether everything that a derivative depends on is determined, down to the nodes of the model."""
        if not any((node[0], k) in self.solved_by for k in range(node[1])):
            return False
        stack, seen = [node], {node}
        while stack:
            e, j = self.equation(stack.pop())
            for other in self.columns(e, j):
                if other[0] in self.given:
                    if other[1]:
                        return False
                elif other in self._beyond_given:
                    return False
                elif other not in seen and other not in self.is_state and other not in self.solved_by:
                    seen.add(other)
                    stack.append(other)
        return True
