"""Connection sets: equal potentials, flows that sum to zero."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

import networkx as nx
import sympy

from gearlib.equations.template import Template, make_template

MOST_ADDENDS = 8  # longer sums are split, so that no template grows with the model


SignedSum = tuple[tuple[int, int], ...]
"""Variables with their signs, whose sum is zero."""


@lru_cache
def sum_template(n: int) -> Template:
    """The sum of n flows; signs are applied where the variables are."""
    return make_template(f"sum of {n} flows", sympy.Add(*(sympy.Symbol(f"flow_{i}", real=True) for i in range(n))), ())


def connection_sets(links: Iterable[Sequence[int]]) -> list[list[int]]:
    """Sets of connected nodes, each sorted, in the order of their lowest node.

    >>> connection_sets([(4, 2), (1, 7), (2, 9)])
    [[1, 7], [2, 4, 9]]
    """
    graph = nx.Graph()
    for link in links:
        nx.add_path(graph, link)
    return sorted(sorted(s) for s in nx.connected_components(graph))


def split_sum(members: SignedSum, new_variable: int) -> tuple[list[SignedSum], int]:
    """A long sum as several short ones over new variables; returns them and the next free variable."""
    sums: list[SignedSum] = []
    while len(members) > MOST_ADDENDS:
        head = MOST_ADDENDS - 1
        sums.append((*members[:head], (new_variable, -1)))
        members = (*members[head:], (new_variable, 1))
        new_variable += 1
    return [*sums, members], new_variable
