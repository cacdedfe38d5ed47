"""Connection sets: equal potentials, flows that sum to zero."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import networkx as nx
import sympy

from gearlib.equations.template import Template, make_template

MOST_ADDENDS = 8  # longer sums are split, so that no template grows with the model


@dataclass(frozen=True)
class Sum:
    """sign[0] * variable[0] + sign[1] * variable[1] + ... = 0"""

    variables: tuple[int, ...]
    signs: tuple[int, ...]


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


def split_sum(members: Sum, new_variable: int) -> tuple[list[Sum], int]:
    """A long sum as several short ones over new variables; returns them and the next free variable."""
    variables, signs = list(members.variables), list(members.signs)
    sums: list[Sum] = []
    while len(variables) > MOST_ADDENDS:
        head = MOST_ADDENDS - 1
        sums.append(Sum((*variables[:head], new_variable), (*signs[:head], -1)))
        variables, signs = [*variables[head:], new_variable], [*signs[head:], 1]
        new_variable += 1
    return [*sums, Sum(tuple(variables), tuple(signs))], new_variable
