"""Bonds of a graph one by one: their order, their ends and signs, their labels, and where they may not be."""

from __future__ import annotations

from typing import Any

import pytest

from gearlib.bondgraph import (
    GY,
    TF,
    BondGraph,
    C,
    I,
    MSe,
    MSf,
    One,
    R,
    Se,
    Sf,
    Zero,
)
from gearlib.errors import ArgumentError, ConnectionError


def mixed() -> tuple[BondGraph, dict[str, Any]]:
    e = {
        "se": Se(),
        "v": One("v"),
        "tf": TF(2),
        "z": Zero(),
        "gy": GY("r"),
        "w": One("w"),
        "i": I(),
        "c": C(),
        "r": R(),
        "sf": Sf(),
    }
    bonds = [
        (9, e["v"], e["tf"]), (4, e["se"], e["v"]), (7, e["tf"], e["z"]), (12, e["z"], e["gy"]), (3, e["gy"], e["w"]), (8, e["w"], e["i"]),
        (20, e["w"], e["r"]), (5, e["z"], e["c"]), (6, e["sf"], e["z"]),
    ]  # fmt: skip
    return BondGraph(*bonds, name="mixed"), e


def test_bonds_are_in_the_order_of_their_numbers_and_elements_in_that_of_their_bonds() -> None:
    graph, e = mixed()
    assert list(graph.bonds) == [3, 4, 5, 6, 7, 8, 9, 12, 20]
    assert graph.elements == tuple(e[name] for name in ("gy", "w", "se", "v", "z", "c", "sf", "tf", "i", "r"))
    assert [bond.number for bond in graph.at(e["z"])] == [5, 6, 7, 12]
    assert graph.of_kind(I, C) == (5, 8)
    assert graph.of_kind(Se, Sf, R) == (4, 6, 20)
    assert graph.of_kind(TF) == graph.of_kind(One) == ()


def test_the_ends_of_a_bond() -> None:
    graph, e = mixed()
    bond = graph.bonds[7]
    assert (bond.tail, bond.head) == (e["tf"], e["z"])
    assert (bond.other(e["tf"]), bond.other(e["z"])) == (e["z"], e["tf"])
    assert (bond.sign(e["z"]), bond.sign(e["tf"])) == (1, -1)
    assert [graph.element(n) for n in (4, 5, 6, 8, 20)] == [e["se"], e["c"], e["sf"], e["i"], e["r"]]
    assert graph.element(8, I, C) is e["i"]
    for number, kinds, said in (
        (7, (), "mixed: bond 7 joins TF on bonds 7, 9 and 0-junction of bonds 5, 6, 7, 12"),
        (8, (C,), "mixed: bond 8 joins 1-junction 'w' and I on bond 8"),
        (12, (GY,), "mixed: bond 12 joins 0-junction of bonds 5, 6, 7, 12 and GY"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError) as refused:
            graph.element(number, *kinds)
        assert str(refused.value).startswith(said)
    for wrong in (99, "4", 4.5, None):
        with pytest.raises(ArgumentError, match=r"^mixed: there is no bond .*; bonds are 3, 4, 5, 6, 7, 8, 9, 12, 20$"):
            graph.element(wrong)


def test_labels_of_elements_that_are_on_no_bond() -> None:
    graph, _ = mixed()
    assert graph.label(One()) == "1-junction of bonds "
    assert graph.label(Zero("far")) == "0-junction 'far'"
    assert graph.label(C()) == "C on bond "
    assert [one.kind for one in (MSe(1), MSf(1), One(), Zero(), GY(1))] == ["MSe", "MSf", "1", "0", "GY"]


@pytest.mark.parametrize(
    ("bonds", "said"),
    [
        (lambda v: [(1, Se(), v), (2, v, t := TF(2)), (3, t, v), (4, t, w := One("w")), (5, w, I())],
         "bond graph: TF on bonds 2, 3, 4 must have two bonds, but it has 3"),
        (lambda v: [(1, Se(), v), (2, v, One("w"))], "bond graph: 1-junction 'w' has only bond 2: the bond dangles"),
        (lambda v: [(1, v, MSf(2)), (2, v, I())], "bond graph: MSf on bond 1 gives power: the half arrow must point away from it"),
        (lambda v: [(1, R(), v), (2, v, I())], "bond graph: R on bond 1 takes up power: the half arrow must point to it"),
        (lambda v: [(1, v, i := C()), (2, v, i)], "bond graph: C on bonds 1, 2 is a one-port: it must have one bond, but it has 2"),
        (lambda v: [(2, Se(), v), (3, v, g := GY(2)), (4, v, g)],
         "bond graph: GY on bonds 3, 4 must have one half arrow pointing in and one pointing out"),
    ],
)  # fmt: skip
def test_elements_on_the_wrong_bonds(bonds: Any, said: str) -> None:
    with pytest.raises(ConnectionError) as refused:
        BondGraph(*bonds(One("v")))
    assert str(refused.value) == said


@pytest.mark.parametrize("bond", [(True, Se(), One()), (1.0, Se(), One()), [1, Se(), One()], (1, Se(), One(), 2), "bond"])
def test_a_bond_is_a_whole_number_with_two_ends(bond: Any) -> None:
    with pytest.raises(
        ArgumentError, match=r" is not a bond; expected \(number, tail, head\), such as \(1, Se\(\), One\('v'\)\)$"
    ):
        BondGraph(bond)
