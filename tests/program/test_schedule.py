"""Level scheduling against networkx's longest paths, and what cannot be put in order."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest

from gearlib.errors import ModelError
from gearlib.program.schedule import levels

KNOWN = 3  # slots 0 to 2 are given; step s computes slot 3 + s


@pytest.mark.parametrize("seed", range(4))
def test_level_is_the_longest_chain_of_steps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 40
    rank = rng.permutation(n)  # steps are not listed in the order of evaluation
    before = [np.flatnonzero((rank < rank[s]) & (rng.random(n) < 0.1)).tolist() for s in range(n)]
    arguments = [[*(KNOWN + m for m in before[s]), *rng.integers(-1, KNOWN, 2).tolist()] for s in range(n)]
    graph = nx.DiGraph([(m, s) for s in range(n) for m in before[s]])
    longest = {s: nx.dag_longest_path_length(graph.subgraph([s, *nx.ancestors(graph, s)])) for s in graph}
    assert levels(arguments, [-1] * KNOWN + list(range(n)), KNOWN) == [1 + longest.get(s, 0) for s in range(n)]


def test_chain_longer_than_the_recursion_limit() -> None:
    n = 5000
    arguments = [[KNOWN + s + 1] for s in range(n - 1)] + [[0]]
    assert levels(arguments, [-1] * KNOWN + list(range(n)), KNOWN) == list(range(n, 0, -1))


@pytest.mark.parametrize(
    ("arguments", "maker"),
    [
        ([[KNOWN]], [0]),  # of itself
        ([[KNOWN + 1], [KNOWN + 2], [KNOWN, 1]], [0, 1, 2]),  # in a circle
        ([[0], [KNOWN, KNOWN + 2]], [0, 1, -1]),  # of what nothing computes
    ],
)
def test_unknowns_without_a_beginning_are_refused(arguments: list[list[int]], maker: list[int]) -> None:
    with pytest.raises(ModelError, match="computed from itself, or from one that no equation determines"):
        levels(arguments, [-1] * KNOWN + maker, KNOWN)
