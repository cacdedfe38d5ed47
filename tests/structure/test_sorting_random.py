"""What is reached in dependences drawn at random, against descendants by networkx; blocks and integrals of these."""

from __future__ import annotations

from typing import Any

import networkx as nx
import numpy as np
import pytest

from gearlib.structure.incidence import Node
from gearlib.structure.sorting import reach, sinks, sort_blocks
from tests.structure.test_dependence_random import GIVEN, SEEDS, Drawn


@pytest.mark.parametrize("events", [False, True])
@pytest.mark.parametrize("dynamic", [False, True])
def test_what_is_reached_are_descendants(dynamic: bool, events: bool) -> None:
    for seed in SEEDS:
        drawn = Drawn(seed)
        found = drawn.dependence()
        uses: Any = nx.DiGraph()
        uses.add_nodes_from([*drawn.solved, *drawn.states])
        for n, (e, _) in drawn.solved.items():
            uses.add_edges_from((n, other) for other in [*drawn.inner(n), *(drawn.at_events.get(e, ()) if events else ())])
        for v, k in drawn.states if dynamic else ():
            uses.add_edges_from(
                ((v, k), other) for other in [(v, k + 1), *(drawn.at_reinits.get((v, k), ()) if events else ())]
            )
        for targets in ([n] for n in [*drawn.solved, *drawn.states]):
            whole = {n for t in targets for n in (t, *nx.descendants(uses, t)) if n[0] < GIVEN}
            unknowns, states = reach(found, [*targets, (GIVEN, 0)], dynamic, events)
            assert len(unknowns) == len(set(unknowns))
            assert (set(unknowns), states) == (whole - set(drawn.states), whole & set(drawn.states)), (seed, targets)


def test_integrals_are_states_that_no_rate_needs() -> None:
    for seed in SEEDS:
        drawn = Drawn(seed)
        found = drawn.dependence()
        _, needed = reach(found, [(v, k + 1) for v, k in drawn.states], dynamic=False, events=True)
        assert sinks(found, drawn.states, lambda node: node[0] != 2) == {
            s for s in drawn.states if s not in needed and s[0] != 2
        }


def test_blocks_do_not_depend_on_the_order_of_the_unknowns() -> None:
    for seed in SEEDS:
        drawn = Drawn(seed)
        rng = np.random.default_rng(seed)
        unknowns = list(drawn.solved)
        mixed = [unknowns[i] for i in rng.permutation(len(unknowns))]
        blocks = sort_blocks(drawn.dependence(), mixed)
        assert blocks == sort_blocks(drawn.dependence(), unknowns)
        assert all(list(block) == sorted(block) for block in blocks)
        done: set[Node] = set()
        for block in blocks:
            done |= set(block)
            assert all(other in done for n in block for other in drawn.inner(n) if other in drawn.solved)
