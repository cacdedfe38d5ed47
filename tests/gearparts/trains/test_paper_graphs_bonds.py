"""Which bonds the paper's figures have, and that the units alone are parts of the train."""

from __future__ import annotations

from typing import Any

import pytest

from gearlib.bondgraph import TF, C, I, R, Se, Sf
from gearlib.bondgraph.elements import Junction
from gearlib.bondgraph.graph import BondGraph
from gearparts.trains.paper_graphs import Figure, fixed_axis_unit, planetary_unit, single_loop_train

PAIR = {I: (69, 78), C: (74,), R: (75,), Sf: (72,)}
PLANETARY = {
    I: (2, 11, 17, 22, 26, 35, 41, 46, 51, 56, 81), C: (6, 30), R: (7, 31, 82, 83, 84, 85), Sf: (8, 32)
}  # fmt: skip
TRAIN = {kind: tuple(sorted((*PLANETARY[kind], *PAIR[kind], *((62, 66) if kind is I else ())))) for kind in PAIR}


def ends(graph: BondGraph) -> dict[int, tuple[Any, Any]]:
    """What each bond leads from and to: junctions by name, transformers by modulus, others by kind."""

    def named(element: Any) -> Any:
        return element.name if isinstance(element, Junction) else element.modulus if isinstance(element, TF) else type(element)

    return {number: (named(bond.tail), named(bond.head)) for number, bond in graph.bonds.items()}


@pytest.mark.parametrize(
    ("figure", "parts", "torques"),
    [
        (fixed_axis_unit(), PAIR, {68: "gear 1", 79: "gear 2"}),
        (planetary_unit(), PLANETARY, {1: "ring", 60: "sun", 80: "carrier"}),
        (single_loop_train(), TRAIN, {1: "ring"}),
    ],
    ids=["P", "X", "XP"],
)
def test_storage_resistances_and_sources_have_the_paper_s_numbers(
    figure: Figure, parts: dict[Any, tuple[int, ...]], torques: dict[int, str]
) -> None:
    assert {kind: figure.graph.of_kind(kind) for kind in parts} == parts
    found = ends(figure.graph)
    assert {n: found[n] for n in figure.graph.of_kind(Se)} == {n: (Se, junction) for n, junction in torques.items()}
    assert set(figure.routes) == {n for n in (25, 65) if n in found}


@pytest.mark.parametrize(
    ("unit", "name", "torques"),
    [(fixed_axis_unit(), "P unit", {68, 79}), (planetary_unit(), "X unit", {60, 80})],
    ids=["P", "X"],
)
def test_a_unit_alone_is_a_part_of_the_train(unit: Figure, name: str, torques: set[int]) -> None:
    """But for the torques at its shafts, which the train has at its input only."""
    own, whole = ends(unit.graph), ends(single_loop_train().graph)
    assert {n: both for n, both in own.items() if n not in torques} == {n: whole[n] for n in own.keys() - torques}
    assert unit.graph.name == name
    assert single_loop_train().graph.name == "XP single-loop train"
    assert set(unit.positions) == set(unit.graph.elements)
