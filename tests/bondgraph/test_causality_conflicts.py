"""Why no causality fits: who sets what, once or in two ways, or leaves nothing that sets it."""

from __future__ import annotations

from typing import Any

import pytest

from gearlib.bondgraph import GY, TF, BondGraph, C, I, One, R, Se, Sf, Zero, assign_causality
from gearlib.bondgraph.elements import Element
from gearlib.errors import ArgumentError, BalanceError


def said(*bonds: tuple[int, Element, Element]) -> str:
    with pytest.raises(BalanceError) as problem:
        assign_causality(BondGraph(*bonds, name="graph"))
    return str(problem.value).removeprefix("graph: no causality fits: ")


def parallel(source: Element, junction: Any, end: Element) -> str:
    """A source, and two transformers side by side."""
    a, b, one, other = junction("a"), junction("b"), TF(2), TF(3)
    return said((1, source, a), (2, a, one), (3, a, other), (4, one, b), (5, other, b), (6, b, end))


def test_one_source_sets_a_junction_through_two_bonds_at_once() -> None:
    assert parallel(Sf(), One, I()) == "Sf on bond 1 sets the flow of the 1-junction 'b' in two ways, through bonds 4 and 5"
    assert parallel(Se(), Zero, C()) == "Se on bond 1 sets the effort of the 0-junction 'b' in two ways, through bonds 4 and 5"


def test_one_source_leaves_nothing_that_sets_a_junction() -> None:
    """Both bonds bring what the junction only adds up."""
    z, v = Zero("z"), One("v")
    assert said((1, Se(), z), (2, z, v), (3, z, v)) == "Se on bond 1 leaves nothing that sets the flow of the 1-junction 'v'"
    assert said((1, Sf(), v), (2, v, z), (3, z, v)) == "Sf on bond 1 leaves nothing that sets the effort of the 0-junction 'z'"


def test_one_source_sets_a_bond_from_both_ends() -> None:
    """Two ways of different lengths meet on bond 6."""
    a, b, c, tf = One("a"), One("b"), One("c"), [TF(2), TF(3), TF(4)]
    ring = [(2, a, tf[0]), (3, tf[0], b), (4, a, tf[1]), (5, tf[1], c), (6, c, tf[2]), (7, tf[2], b), (8, b, I()), (9, c, I())]
    assert said((1, Sf(), a), *ring) == "Sf on bond 1 sets the flow of bond 6 in two ways"


@pytest.mark.parametrize(
    ("first", "middle", "second", "quantity"),
    [
        ((Sf, One), TF, (Sf, One), "flow"), ((Se, Zero), TF, (Se, Zero), "effort"), ((Sf, One), GY, (Se, Zero), "causality"),
        ((Se, Zero), GY, (Sf, One), "causality"),
    ],
)  # fmt: skip
def test_two_sources_meet(first: Any, middle: Any, second: Any, quantity: str) -> None:
    a, tf, b = first[1]("a"), middle(2), second[1]("b")
    one, other = first[0](), second[0]()
    found = said((1, one, a), (2, a, tf), (3, tf, b), (4, other, b), (5, a, R()))
    assert found == f"{one.kind} on bond 1 and {other.kind} on bond 4 both set the {quantity} of bond 4"


def test_sources_leave_nothing_that_sets_a_junction_between_them() -> None:
    """Efforts alone on a 1-junction, through 0-junctions that get theirs at once."""
    x, v = Zero("x"), One("v")
    bonds = [(1, Se(), x), (2, x, v), (3, x, v), (4, Se(), v)]
    assert said(*bonds) == "Se on bond 1 and Se on bond 4 both set the effort of bond 4"
    assert said((4, Se(), x), (2, x, v), (3, x, v), (1, Se(), v)) == (
        "Se on bond 1 and Se on bond 4 leave nothing that sets the flow of the 1-junction 'v'"
    )


@pytest.mark.parametrize("beside", [False, True])
def test_three_gears_side_by_side_lock_two_shafts(beside: bool) -> None:
    """A bond without a source or storage element is named alone; also where another part, which comes first, has no conflict."""
    a, b, tf = One("a"), One("b"), [TF(2), TF(3), TF(4)]
    gears = [bond for k, t in enumerate(tf) for bond in ((10 + k, a, t), (20 + k, t, b))]
    apart: list[Any] = [(0, c := One("c"), I()), (30, c, R())] if beside else []
    assert said((1, a, I()), (2, b, I()), *gears, *apart) == (
        "bond 10 sets the flow of the 1-junction 'b' in two ways, through bonds 21 and 22"
    )


@pytest.mark.parametrize(
    ("wrong", "storage", "numbers"),
    [([1], 0, "bonds 1; they are on none"), ([1], 1, "bonds 1; they are on 2"), ([7, 1], 2, "bonds 7 and 1; they are on 2 and 3"),
     ([7, 1, 9], 3, "bonds 7, 1 and 9; they are on 2, 3 and 4"), ([2, 7, 1, 9, 8], 4, "bonds 7, 1, 9 and 8; they are on 2, 3, 4 and 5")],
)  # fmt: skip
def test_numbers_of_bonds_are_listed(wrong: list[int], storage: int, numbers: str) -> None:
    v = One("v")
    graph = BondGraph((1, Se(), v), (6, v, R()), *((2 + k, v, C()) for k in range(storage)), name="graph")
    with pytest.raises(ArgumentError) as problem:
        assign_causality(graph, wrong)
    assert str(problem.value) == f"graph: prefer: no storage element on {numbers}"
