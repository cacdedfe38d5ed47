"""The equations as networkx graphs: what networkx finds in them is what translation found."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.run.scene_form import scene_form
from gearlib.structure import dulmage_mendelsohn, pantelides
from gearlib.structure.dulmage_mendelsohn import matching_by_lists
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
    assert len(top) == len(system.translation.structure.model.places)
    matching = nx.bipartite.hopcroft_karp_matching(graph, top)
    rows = [[n[1] for n in graph[e] if not graph.nodes[n]["given"]] for e in top]
    assert len(matching) // 2 == len(matching_by_lists(rows)) == len(top)
    assert all(data["path"] for _, data in graph.nodes(data=True))


def test_flat_equations_know_their_variables_and_orders(system: gl.System) -> None:
    graph, model = system.graph(), system.translation.structure.model
    assert {n[1:] for n in graph if n[0] == "equation"} == {(e, 0) for e in range(len(model.places))}
    for node, data in graph.nodes(data=True):
        number = node[1]
        if node[0] == "variable":
            highest = max(order for other in graph[node] for order in graph.edges[node, other]["orders"])
            assert node[2] == 0
            assert data == {"bipartite": 1, "path": model.name(number), "given": number in model.inputs, "order": highest}
        else:
            found = sorted((v[1], order) for v in graph[node] for order in graph.edges[node, v]["orders"])
            assert found == sorted(model.nodes(number, 0))
            assert all(list(graph.edges[node, v]["orders"]) == sorted(graph.edges[node, v]["orders"]) for v in graph[node])


def test_blocks_are_the_strong_components_in_an_order_of_computation(system: gl.System) -> None:
    graph = system.graph(reduced=True)
    assert all(data["bipartite"] == ("equation", "variable").index(n[0]) for n, data in graph.nodes(data=True))
    blocks = graph.graph["blocks"]
    own = {frozenset(n[1:] for n in block) for block in blocks}
    scene = system.translation.scene
    unknowns = [n for block in own for n in block]
    assert own == {frozenset(block) for block in sort_blocks(scene.structure, unknowns)}
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


class RandomTrain(gl.Component):
    """Bodies in a row, joined by gears, springs, planetary sets with a free or braked third shaft, and now and then nothing elastic."""

    seed = gl.Structural(0)

    def assemble(self) -> list[gl.Connection]:
        rng = np.random.default_rng(self.seed)
        self.torque, self.ground = gp.Torque(tau=gl.sin(gl.time)), gp.Fixed()
        n = int(rng.integers(2, 7))
        self.body = [gp.Inertia(J=float(rng.uniform(0.5, 2))) for _ in range(n)]
        self.third = [gp.Inertia(J=1.0) for _ in range(n - 1)]
        links = [gl.connect(self.torque.flange, self.body[0].flange_a)]
        self.link = [
            (
                gp.IdealGear(ratio=float(rng.uniform(-3, -0.5))), gp.SpringDamper(c=100.0, d=1.0), gp.Spring(c=50.0),
                gp.IdealPlanetary(ratio=float(rng.uniform(1.5, 4))),
            )[rng.integers(4)]
            for _ in range(n - 1)
        ]  # fmt: skip
        for k, link in enumerate(self.link):
            if isinstance(link, gp.IdealPlanetary):
                links += [
                    gl.connect(self.body[k].flange_b, link.sun), gl.connect(link.carrier, self.body[k + 1].flange_a),
                    gl.connect(link.ring, self.third[k].flange_a),
                ]  # fmt: skip
                continue
            links += [gl.connect(self.body[k].flange_b, link.flange_a), gl.connect(link.flange_b, self.body[k + 1].flange_a)]
        return links


@pytest.mark.parametrize("seed", range(6))
def test_trains_are_reduced_alike_by_graphs_and_by_lists(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    by_graphs = gl.compile(RandomTrain(seed=seed))
    for module in (dulmage_mendelsohn, pantelides):
        monkeypatch.setattr(module, "MOST_IN_GRAPHS", 0)
    by_lists = gl.compile(RandomTrain(seed=seed))
    one, two = (system.translation.structure.differentiation for system in (by_graphs, by_lists))
    assert one.counts == two.counts
    assert dict(one.orders) == dict(two.orders)
    assert by_graphs.states == by_lists.states
    blocks = [{frozenset(block) for block in s.graph(reduced=True).graph["blocks"]} for s in (by_graphs, by_lists)]
    assert blocks[0] == blocks[1]
    assert np.allclose(by_graphs.linearize(["torque.tau"]).A, by_lists.linearize(["torque.tau"]).A, rtol=1e-12, atol=1e-12)


def test_arguments_are_checked() -> None:
    with pytest.raises(ArgumentError, match="reduced"):
        SYSTEMS["XP"]().graph(reduced="yes")  # type: ignore[arg-type]
