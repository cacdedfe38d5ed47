"""The equations as networkx graphs, flat and index-reduced, with names and roles as attributes.

Nodes are ``("equation", e, k)`` and ``("variable", v, k)``: the k-th derivative of equation e or of variable v of the flat model. All
algorithms of networkx apply: matchings, components, orders.
"""

from __future__ import annotations

from collections.abc import Iterable

import networkx as nx

from gearlib.reduce.reduction import Structure
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import reach, sort_blocks

Vertex = tuple[str, int, int]


def flat_graph(structure: Structure) -> nx.Graph:
    """The bipartite graph of the flat equations and their variables, after alias elimination.

    An equation has the attributes ``bipartite`` (0), ``path`` of its component and ``label``; a variable ``bipartite`` (1), ``path``,
    ``given`` (an unbound input) and ``order`` of its highest derivative; an edge the derivative ``orders`` with which the variable
    occurs in the equation.

    Parameters
    ----------
    structure : Structure
    """
    model = structure.model
    given = frozenset(model.inputs.tolist())
    graph: nx.Graph = nx.Graph(name="flat equations")
    for e, (g, i) in enumerate(structure.model.places):
        equation = ("equation", e, 0)
        graph.add_node(equation, bipartite=0, path=model.owner(g, i), label=model.groups[g].template.label)
        orders: dict[int, list[int]] = {}
        for v, order in structure.columns(e, 0):
            orders.setdefault(v, []).append(order)
        for v, present in orders.items():
            variable = ("variable", v, 0)
            highest = max(*present, graph.nodes[variable]["order"] if variable in graph else 0)
            graph.add_node(variable, bipartite=1, path=model.name(v), given=v in given, order=highest)
            graph.add_edge(equation, variable, orders=tuple(sorted(present)))
    return graph


def reduced_graph(structure: Structure, targets: Iterable[Node]) -> nx.DiGraph:
    """The graph of the index-reduced equations that some unknowns need, sorted into blocks.

    An arc leads from an equation to the variable matched to it, and to the equation from every other variable in it. An equation
    has the attributes ``bipartite`` (0), ``path``, ``label``, ``differentiated`` (how often) and ``block``; a variable ``bipartite``
    (1), ``path`` (``der(...)`` for a derivative), ``state``, ``given`` and ``block`` (None for states and inputs). Blocks are numbered
    in evaluation order; the graph attribute ``blocks`` lists the variables of each.

    Parameters
    ----------
    structure : Structure
    targets : iterable of nodes
        For example the derivatives of the integrated states.
    """
    model = structure.model
    inside = sorted(reach(structure, targets, dynamic=True)[0])
    blocks = sort_blocks(structure, inside)
    block_of = {node: b for b, block in enumerate(blocks) for node in block}
    graph: nx.DiGraph = nx.DiGraph(name="index-reduced equations")

    def variable(node: Node) -> Vertex:
        vertex = ("variable", *node)
        if vertex not in graph:
            graph.add_node(
                vertex, bipartite=1, path="der(" * node[1] + model.name(node[0]) + ")" * node[1],
                state=node in structure.is_state, given=node[0] in structure.given, block=block_of.get(node),
            )  # fmt: skip
        return vertex

    for node in inside:
        e, k = structure.equation(node)
        g, i = structure.model.places[e]
        equation, label = ("equation", e, k), model.groups[g].template.label
        graph.add_node(equation, bipartite=0, path=model.owner(g, i), label=label, differentiated=k, block=block_of[node])
        graph.add_edge(equation, variable(node))
        graph.add_edges_from((variable(other), equation) for other in structure.columns(e, k) if other != node)
    graph.graph["blocks"] = tuple(tuple(("variable", *node) for node in block) for block in blocks)
    return graph
