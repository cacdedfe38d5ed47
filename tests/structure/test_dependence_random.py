"""Dependences drawn at random, against fixed points and descendants by networkx."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import networkx as nx
import numpy as np

from gearlib.structure.dependence import Dependence
from gearlib.structure.incidence import Node
from tests.stress.test_right_calls import given

GIVEN = 90


class Drawn:
    """Variables of which some are states: their rates, and the others, are solved from equations with other nodes and what is given."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 8))
        self.order = rng.integers(0, 2, n).tolist()
        self.states = tuple((v, 0) for v in range(n) if self.order[v])
        names = rng.permutation(n).tolist()  # of the equations
        self.solved = {(v, self.order[v]): (names[v], 0) for v in range(n)}
        nodes = [*self.states, *self.solved]
        others = {v: [nodes[i] for i in rng.integers(0, len(nodes), rng.integers(0, 3))] for v in range(n)}
        outside = {v: [(GIVEN + int(rng.integers(2)), int(rng.random() < 0.2))] * int(rng.random() < 0.5) for v in range(n)}
        rows = {names[v]: list(dict.fromkeys([(v, self.order[v]), *others[v], *outside[v]])) for v in range(n)}
        self.rows: Mapping[int, Sequence[Node]] = {e: [rows[e][i] for i in rng.permutation(len(rows[e]))] for e in rows}
        some = [nodes[i] for i in rng.permutation(len(nodes))[: rng.integers(0, 3)]]
        self.at_events = {int(rng.integers(n)): some} if n > 3 else {}
        self.at_reinits = {state: [nodes[-1], (GIVEN, 0)] for state in self.states[:1]}

    def columns(self, e: int, k: int) -> list[Node]:
        """Nodes of an equation's derivative; the lower ones stay in it, as in a product."""
        return sorted({(v, order + j) for v, order in self.rows[e] for j in range(k + 1)})

    def dependence(self, given: bool = True) -> Dependence:
        outside = frozenset({GIVEN, GIVEN + 1})
        columns = self.columns if given else lambda e, k: [n for n in self.columns(e, k) if n[0] < GIVEN]
        return Dependence(self.states, self.solved, columns, outside if given else frozenset(), self.at_events, self.at_reinits)

    def inner(self, node: Node) -> list[Node]:
        """The nodes in the equation that gives a node, which is no state, at the order at which it does."""
        v, k = node
        e, _ = self.solved[v, self.order[v]]
        return self.columns(e, k - self.order[v])


SEEDS = range(40)


def test_what_is_computed_needs_no_rate_of_what_is_given() -> None:
    """By a fixed point: what is lost is the rate of what is given, and all that is computed from what is lost."""
    for seed in SEEDS:
        drawn = Drawn(seed)
        found = drawn.dependence()
        unknown = [(v, k) for v, least in enumerate(drawn.order) for k in range(least, 5)]
        lost: set[Node] = {(v, k) for v in (GIVEN, GIVEN + 1) for k in range(1, 9)}
        while new := {n for n in unknown if n not in lost and lost & set(drawn.inner(n))}:
            lost |= new
        for node in (n for n in unknown if n[1] < 4):
            assert found.computes(node) == (node not in lost), node
            assert found.computes(node) == (node not in lost), "when it is asked again"
            e, k = drawn.solved[node[0], drawn.order[node[0]]]
            assert found.equation(node) == (e, k + node[1] - drawn.order[node[0]])
            assert found.of(node) == [n for n in drawn.inner(node) if n != node and n[0] < GIVEN]
        assert all(found.computes(n) for n in [*drawn.states, (GIVEN, 0), (GIVEN + 1, 0)])
        assert not any(found.computes(n) for n in [(GIVEN, 1), (GIVEN + 1, 2), (50, 0), (50, 1)])
        assert all(drawn.dependence(given=False).computes(n) for n in unknown)


def test_what_needs_equations_is_downstream_of_their_unknowns() -> None:
    for seed in SEEDS:
        drawn = Drawn(seed)
        found = drawn.dependence()
        uses = nx.DiGraph([(n, other) for n in drawn.solved for other in drawn.inner(n) if other not in drawn.states])
        uses.add_nodes_from(drawn.solved)
        for n, place in drawn.solved.items():
            assert found.needing({place}) == {n, *nx.ancestors(uses, n)}
        two = list(drawn.solved)[:2]
        assert found.needing([drawn.solved[n] for n in two]) == {*two, *(a for n in two for a in nx.ancestors(uses, n))}
        rates = {e for e, row in drawn.rows.items() if any(v >= GIVEN and order for v, order in row)}
        assert found.with_rates_of_given == {(e, 0) for e in rates}
        assert drawn.dependence(given=False).with_rates_of_given == frozenset()


def test_what_is_given_may_stay_in_a_derivative_without_its_rate() -> None:
    """y = x floor(u), whose derivative is y' = x' floor(u); z = x u has z' = x' u + x u'; and w = x^2 has w' = 2 x x'."""
    x, y, z, u, w = range(5)
    rows = {
        (0, 0): [(x, 1)], (0, 1): [(x, 2)], (1, 0): [(y, 0), (x, 0), (u, 0)], (1, 1): [(y, 1), (x, 1), (u, 0)],
        (2, 0): [(z, 0), (x, 0), (u, 0)], (2, 1): [(z, 1), (z, 0), (x, 1), (u, 0), (u, 1)],
        (3, 0): [(w, 0), (x, 0)], (3, 1): [(w, 1), (x, 0), (x, 1)],
    }  # fmt: skip
    solved: dict[Node, Node] = {(x, 1): (0, 0), (y, 0): (1, 0), (z, 0): (2, 0), (w, 0): (3, 0)}
    found = Dependence(((x, 0),), solved, lambda e, k: rows[e, k], frozenset({u}))
    assert [given(partial(found.computes, (v, 1))) for v in (y, z, w)] == [True, False, True]
