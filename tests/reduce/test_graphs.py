"""The equations as networkx graphs: what networkx finds in them is what translation found."""

from __future__ import annotations

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.run.forms.scene_form import scene_form
from gearlib.structure.dulmage_mendelsohn import maximum_matching
from gearlib.structure.sorting import sort_blocks
from tests.benchmarks.scenes import Star, Tree

SYSTEMS = {
    "XP": lambda: gl.compile(gp.ZhouCui2022(tau_in=100.0)),
    "star": lambda: gl.compile(Star(N=4), outputs=["load[2].w"]),
    **{f"tree {seed}": lambda seed=seed: gl.compile(Tree(N=12, seed=seed)) for seed in range(3)},
}


@pytest.fixture(scope="module", params=list(SYSTEMS))
def system(request: pytest.FixtureRequest) -> gl.System:
    return SYSTEMS[request.param]()


def equations(graph: nx.Graph) -> list[tuple[str, int, int]]:
    return [n for n, side in graph.nodes(data="bipartite") if side == 0]


def test_every_flat_equation_can_be_matched(system: gl.System) -> None:
    graph = system.graph()
    assert nx.is_bipartite(graph)
    top = equations(graph)
    assert len(top) == len(system.translation.structure.rows)
    matching = nx.bipartite.hopcroft_karp_matching(graph, top)
    rows = [[n[1] for n in graph[e] if not graph.nodes[n]["given"]] for e in top]
    assert len(matching) // 2 == len(maximum_matching(rows)) == len(top)
    assert all(data["path"] for _, data in graph.nodes(data=True))


def test_blocks_are_the_strong_components_in_an_order_of_computation(system: gl.System) -> None:
    graph = system.graph(reduced=True)
    blocks = graph.graph["blocks"]
    own = {frozenset(n[1:] for n in block) for block in blocks}
    scene = system.translation.scene
    unknowns = [n for block in own for n in block]
    assert own == {frozenset(block) for block in sort_blocks(scene.structure.dependence, unknowns)}
    several = {frozenset(n for n in c if n[0] == "variable") for c in nx.strongly_connected_components(graph)}
    assert {frozenset(b) for b in blocks if len(b) > 1} <= several
    done = {n for n, data in graph.nodes(data=True) if data["bipartite"] == 1 and data["block"] is None}
    assert all(graph.nodes[n]["state"] or graph.nodes[n]["given"] for n in done)
    for number, block in enumerate(blocks):
        done |= set(block)
        for variable in block:
            (equation,) = graph.predecessors(variable)
            assert graph.nodes[equation]["block"] == graph.nodes[variable]["block"] == number
            assert set(graph.predecessors(equation)) <= done


def test_unknowns_are_those_of_the_dae(system: gl.System) -> None:
    """The graph's unknowns are the derivatives of the states and the algebraic unknowns that IDA is handed."""
    graph, equations_ = system.graph(reduced=True), scene_form(system.translation.scene, "dae").equations
    states = set(equations_.unknowns[: equations_.n_states])
    handed = {*equations_.algebraic, *((v, k + 1) for v, k in states)} - states
    assert {n[1:] for block in graph.graph["blocks"] for n in block} == handed


def test_differentiated_equations_and_states_are_marked() -> None:
    system = SYSTEMS["XP"]()
    graph = system.graph(reduced=True)
    counts = system.translation.structure.differentiation.counts
    found = {(n[1], data["differentiated"]) for n, data in graph.nodes(data=True) if data["bipartite"] == 0}
    assert max(k for _, k in found) == 2
    assert all(k <= counts[e] for e, k in found)
    marked = {data["path"] for _, data in graph.nodes(data=True) if data.get("state")}
    assert marked == set(system.states)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.lists(st.integers(0, 11), max_size=4, unique=True), min_size=1, max_size=12))
def test_the_arrays_match_as_many_as_hopcroft_and_karp(rows: list[list[int]]) -> None:
    graph = nx.Graph()
    top = [("e", e) for e in range(len(rows))]
    graph.add_nodes_from(top)
    graph.add_edges_from((("e", e), ("v", v)) for e, row in enumerate(rows) for v in row)
    assert len(maximum_matching(rows)) == len(nx.bipartite.hopcroft_karp_matching(graph, top)) // 2


def test_arguments_are_checked() -> None:
    with pytest.raises(ArgumentError, match="reduced"):
        SYSTEMS["XP"]().graph(reduced="yes")  # type: ignore[arg-type]
