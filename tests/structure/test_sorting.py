"""The order of computation: Tarjan's components, and what is reached."""

from __future__ import annotations

from collections.abc import Sequence

import networkx as nx
from hypothesis import given
from hypothesis import strategies as st

from gearlib.structure.dependence import Dependence
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import reach, sinks, sort_blocks


def dependence(uses: Sequence[Sequence[int]], states: Sequence[Node] = ()) -> Dependence:
    """Unknown i is computed by equation i from ``uses[i]``."""
    solved_by = {(i, 0): (i, 0) for i in range(len(uses))}
    return Dependence(tuple(states), solved_by, lambda e, k: [(e, 0), *((v, 0) for v in uses[e])])


def test_figure_of_tarjans_paper() -> None:
    """Figure 3 of the paper: vertices 1 to 8 with components {1}, {2, 3, 4, 5, 7, 8 ...} as its edges give them."""
    edges = {1: [2], 2: [3, 8], 3: [4, 7], 4: [5], 5: [3, 6], 6: [], 7: [4, 6], 8: [1, 7]}
    blocks = sort_blocks(dependence([[]] + [edges[i] for i in range(1, 9)]), [(i, 0) for i in range(1, 9)])
    assert [sorted(v for v, _ in b) for b in blocks] == [[6], [3, 4, 5, 7], [1, 2, 8]]


@given(st.lists(st.lists(st.integers(0, 9), max_size=3), min_size=10, max_size=10))
def test_blocks_are_the_strong_components_and_come_after_what_they_use(uses: list[list[int]]) -> None:
    blocks = sort_blocks(dependence(uses), [(i, 0) for i in range(10)])
    graph = nx.DiGraph([(i, j) for i, row in enumerate(uses) for j in row])
    graph.add_nodes_from(range(10))
    expected = {frozenset(s) for s in nx.strongly_connected_components(graph)}
    assert {frozenset(v for v, _ in b) for b in blocks} == expected
    done: set[int] = set()
    for block in blocks:
        members = {v for v, _ in block}
        assert {j for i in members for j in uses[i]} <= done | members
        done |= members


def test_reach_stops_at_states_unless_their_derivatives_are_wanted() -> None:
    # w (0) is a state with der(w) (0, 1) = f(tau), tau (1) = g(w), p (2) = tau * w
    solved_by = {(0, 1): (0, 0), (1, 0): (1, 0), (2, 0): (2, 0)}
    columns = {0: [(0, 1), (1, 0)], 1: [(1, 0), (0, 0)], 2: [(2, 0), (1, 0), (0, 0)]}
    d = Dependence(((0, 0),), solved_by, lambda e, k: columns[e])
    assert reach(d, [(2, 0)], dynamic=False) == ([(2, 0), (1, 0)], {(0, 0)})
    unknowns, states = reach(d, [(0, 0)], dynamic=True)
    assert (set(unknowns), states) == ({(0, 1), (1, 0)}, {(0, 0)})


def test_sinks_are_integrals_that_nothing_depends_on() -> None:
    # phi' = w, w' = -w, psi' = phi
    solved_by = {(0, 1): (0, 0), (1, 1): (1, 0), (2, 1): (2, 0)}
    columns = {0: [(0, 1), (1, 0)], 1: [(1, 1), (1, 0)], 2: [(2, 1), (0, 0)]}
    d = Dependence(((0, 0), (1, 0), (2, 0)), solved_by, lambda e, k: [(v, order + k) for v, order in columns[e]])
    assert sinks(d, d.states, lambda node: True) == {(2, 0)}
    assert sinks(d, d.states, lambda node: False) == frozenset()


def test_what_decides_at_events_is_reached_where_it_is_asked_for() -> None:
    """x' = u + a, where a relation on p decides, p' = 1, a = 2; u is given."""
    x, p, a, u = (0, 0), (1, 0), (2, 0), (9, 0)
    solved_by = {(0, 1): (0, 0), (1, 1): (1, 0), a: (2, 0)}
    columns = {0: [(0, 1), a, u], 1: [(1, 1)], 2: [a]}
    d = Dependence((x, p), solved_by, lambda e, k: columns[e], frozenset({9}), {0: [p]})
    assert reach(d, [(0, 1), u], dynamic=False) == ([(0, 1), a], set())
    assert reach(d, [(0, 1), u], dynamic=False, events=True) == ([(0, 1), a], {p})
    assert set(reach(d, [x], dynamic=True, events=True)[0]) == {(0, 1), a, (1, 1)}
    assert sinks(d, d.states, lambda node: True) == {x}


def test_targets_that_are_given_are_told_by_their_variable() -> None:
    """Not by how often they are differentiated."""
    solved_by: dict[Node, Node] = {(0, 1): (0, 0), (2, 0): (1, 0), (2, 1): (1, 1)}
    d = Dependence(((0, 0),), solved_by, lambda e, k: [[(0, 1), (1, 0)], [(2, k)]][e], frozenset({1}))
    assert reach(d, [(1, 0), (0, 1), (2, 1), (1, 2)], dynamic=False) == ([(2, 1), (0, 1)], set())
