"""The graphs of a model whose equations are few enough to be written down."""

from __future__ import annotations

from typing import Any

import gearlib as gl
from gearlib.flatten.flatten import flatten
from gearlib.reduce.graphs import flat_graph, reduced_graph
from gearlib.reduce.reduction import Structure, analyse
from tests.stress.test_right_calls import given


class Few(gl.Component):
    """x is a state; y follows from it, and so does p, whose derivative v is."""

    u, x = gl.Input("1"), gl.Variable("1", start=1.0)
    y, p, v = (gl.Variable("1") for _ in range(3))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.u * self.y),
            gl.Eq(self.y + gl.sin(self.y), 2 * self.x),
            gl.Eq(self.p, self.x**2),
            gl.Eq(self.v, gl.der(self.p) + self.p),
        ]


RATE, Y, P, V = "Few: der(x) = u*y", "Few: y + sin(y) = 2*x", "Few: p = x**2", "Few: v = p + der(p)"


class Box(gl.Component):
    def assemble(self) -> list[Any]:
        self.few = Few()
        return []


def structure() -> Structure:
    model = flatten(Box())
    return analyse(model, model.parameters.defaults)


def test_the_flat_graph_holds_what_is_written() -> None:
    graph = given(lambda: flat_graph(structure()))
    label = {n: data["label"] for n, data in graph.nodes(data=True) if data["bipartite"] == 0}
    path = {n: data["path"] for n, data in graph.nodes(data=True) if data["bipartite"] == 1}
    assert {data["path"] for n, data in graph.nodes(data=True) if n in label} == {"few"}
    assert {n[0] for n in label} == {"equation"}
    assert {n[0] for n in path} == {"variable"}
    assert {n[2] for n in graph} == {0}
    orders = {
        label[a if a in label else b]: {path[n]: graph.edges[a, n]["orders"] for n in graph[a]} for a in label for b in [a]
    }
    assert {name.replace("der(p) + p", "p + der(p)"): found for name, found in orders.items()} == {
        RATE: {"few.x": (1,), "few.u": (0,), "few.y": (0,)},
        Y: {"few.y": (0,), "few.x": (0,)},
        P: {"few.p": (0,), "few.x": (0,)},
        V: {"few.v": (0,), "few.p": (0, 1)},
    }
    about = {path[n]: (graph.nodes[n]["order"], graph.nodes[n]["given"]) for n in path}
    assert about == {
        "few.x": (1, False),
        "few.u": (0, True),
        "few.y": (0, False),
        "few.p": (1, False),
        "few.v": (0, False),
    }


def test_the_reduced_graph_says_what_determines_what() -> None:
    found = structure()
    v, x = (int(found.model.representative[found.model.variable(f"few.{n}")]) for n in "vx")
    assert found.states == ((x, 0),)
    graph = given(lambda: reduced_graph(found, [(v, 0)]))
    label = {n: (data["label"], data["differentiated"]) for n, data in graph.nodes(data=True) if data["bipartite"] == 0}
    path = {n: data["path"] for n, data in graph.nodes(data=True) if data["bipartite"] == 1}
    assert all(n[0] == "equation" and n[2] == times for n, (_, times) in label.items())
    assert all(n[0] == "variable" and name.count("der(") == n[2] for n, name in path.items())
    assert {graph.nodes[n]["path"] for n in label} == {"few"}
    given_by = {path[m]: (label[n][1], {path[k] for k in graph.predecessors(n)}) for n in label for m in graph.successors(n)}
    assert given_by == {
        "few.v": (0, {"few.p", "der(few.p)"}),
        "few.p": (0, {"few.x"}),
        "der(few.p)": (1, {"few.x", "der(few.x)"}),
        "der(few.x)": (0, {"few.u", "few.y"}),
        "few.y": (0, {"few.x"}),
    }
    kinds = {path[n]: (graph.nodes[n]["state"], graph.nodes[n]["given"], graph.nodes[n]["block"] is None) for n in path}
    assert {name for name, kind in kinds.items() if kind == (True, False, True)} == {"few.x"}
    assert {name for name, kind in kinds.items() if kind == (False, True, True)} == {"few.u"}
    assert {name for name, kind in kinds.items() if kind == (False, False, False)} == set(given_by)
    for number, block in enumerate(graph.graph["blocks"]):
        for variable in block:
            (equation,) = graph.predecessors(variable)
            assert graph.nodes[variable]["block"] == graph.nodes[equation]["block"] == number
    assert sum(map(len, graph.graph["blocks"])) == 5


def test_rates_of_states_are_followed() -> None:
    """Asked for what needs the state alone, the graph holds its rate and what that needs."""
    found = structure()
    p = int(found.model.representative[found.model.variable("few.p")])
    graph = reduced_graph(found, [(p, 0)])
    assert {data["path"] for _, data in graph.nodes(data=True) if data.get("block") is not None and "state" in data} == {
        "few.p", "der(few.x)", "few.y",
    }  # fmt: skip
