"""Feasibility of completing a partial causality assignment.

Every junction receives its common variable from exactly one of its bonds. A bond between a 0- and a 1-junction serves both or neither,
one between two junctions of a kind serves exactly one of them, and likewise through transformers and gyrators. So a complete assignment
is a matching that covers all junctions; bonds to storage elements, resistances and the like are optional.
"""

from __future__ import annotations

from collections.abc import Mapping

import networkx as nx

from gearlib.bondgraph.elements import GY, TF, Element, Junction, Zero
from gearlib.bondgraph.graph import Bond, BondGraph

__all__ = ["can_be_completed"]


def can_be_completed(graph: BondGraph, effort_to: Mapping[int, Element]) -> bool:
    """Whether the strokes set so far, with their consequences, are part of a complete assignment.

    Parameters
    ----------
    graph : BondGraph
        The graph.
    effort_to : mapping
        Maps each settled bond to the end that receives its effort.

    Returns
    -------
    bool
        True if the rest can be assigned.

    Examples
    --------
    Two shafts joined by two gears cannot move, unless the ratios are equal; each gear sets the speed of one shaft. A third gear is one
    too many:

    >>> from gearlib.bondgraph import TF, BondGraph, I, One
    >>> a, b, gears = One("a"), One("b"), [TF(2), TF(3), TF(4)]
    >>> bonds = [(1, a, I()), (2, b, I()), *((10 + k, a, tf) for k, tf in enumerate(gears))]
    >>> bonds += [(20 + k, tf, b) for k, tf in enumerate(gears)]
    >>> can_be_completed(BondGraph(*(bond for bond in bonds if bond[0] not in (12, 22))), {})
    True
    >>> can_be_completed(BondGraph(*bonds), {})
    False
    """
    net = nx.Graph()
    wanting = [e for e in graph.elements if isinstance(e, Junction) and not _is_determined(graph, e, effort_to)]
    net.add_nodes_from(wanting)
    seen: set[int] = set()
    middles = 0
    for bond in graph.bonds.values():
        if bond.number in effort_to or bond.number in seen:
            continue
        ends = [_follow(graph, bond, end, seen) for end in (bond.head, bond.tail)]
        oriented = [(end, effort_in == isinstance(end, Zero)) for end, effort_in in ends if isinstance(end, Junction)]
        match oriented:
            case [(junction, _)]:
                net.add_edge(junction, ("leaf", bond.number), weight=1)
            case [(one, this), (other, that)] if this == that:
                net.add_edge(one, other, weight=2)
            case [(one, _), (other, _)]:
                middles += 1
                net.add_edges_from(((end, ("middle", bond.number)) for end in (one, other)), weight=2)
    matching = nx.max_weight_matching(net)
    return bool(sum(net.edges[edge]["weight"] for edge in matching) == len(wanting) + middles)


def _is_determined(graph: BondGraph, junction: Junction, effort_to: Mapping[int, Element]) -> bool:
    """Whether a bond already determines the junction's common variable: the effort of a 0-junction, the flow of a 1-junction."""
    zero = isinstance(junction, Zero)
    return any((effort_to[b.number] is junction) == zero for b in graph.at(junction) if b.number in effort_to)


def _follow(graph: BondGraph, bond: Bond, end: Element, seen: set[int]) -> tuple[Element, bool]:
    """The element that a bond leads to through transformers and gyrators, and whether effort towards the bond's head enters it."""
    effort_in = end is bond.head
    seen.add(bond.number)
    while isinstance(end, TF | GY):
        (bond,) = (b for b in graph.at(end) if b is not bond)
        if bond.number in seen:  # a ring of transformers without a junction
            break
        seen.add(bond.number)
        effort_in = effort_in != isinstance(end, GY)
        end = bond.other(end)
    return end, effort_in
