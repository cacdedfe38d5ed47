"""Bonds, elements and laws one by one: their order, their ends and signs, their labels, and what depends on time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp

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
    RunTime,
    Se,
    Sf,
    Zero,
    assign_causality,
    energy_symbol,
    state_equations,
    time,
)
from gearlib.bondgraph.efforts_and_flows import rate_of
from gearlib.bondgraph.elements import by_law, checked, symbol
from gearlib.errors import ArgumentError, ConnectionError, DeclarationError


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


def test_loops_are_reported_by_their_resistances() -> None:
    """Two loops apart, each of two resistances at one effort behind a third."""
    bonds: list[Any] = []
    for first in (10, 1):
        v, z = One(), Zero()
        bonds += [
            (first, Se(), v),
            (first + 1, v, R()),
            (first + 2, v, z),
            (first + 3, z, R()),
            (first + 4, z, I()),
            (first + 5, v, C()),
        ]
    report = assign_causality(BondGraph(*bonds)).report()
    assert report == "integral causality: 5, 6, 14, 15\nderivative causality: none\nalgebraic loops: 2 and 4; 11 and 13"


@pytest.mark.parametrize(("kind", "bond", "name"), [("p", 17, "p_17"), ("q", 0, "q_0")])
def test_symbols_of_what_is_stored_and_of_its_rate(kind: str, bond: int, name: str) -> None:
    found = energy_symbol(kind, bond)
    assert found == symbol(name) == sp.Symbol(name, real=True)
    assert rate_of(found) == symbol(f"d{name}")
    with pytest.raises(ArgumentError, match=r"^energy_symbol: bond is -1"):
        energy_symbol(kind, -1)
    with pytest.raises(ArgumentError, match=r"^rate_of: variable is 'p_1'; expected a symbol, such as p_17$"):
        rate_of("p_1")


def test_laws_give_expressions_or_say_what_went_wrong() -> None:
    x = symbol("x")
    assert by_law(lambda y: y**2 / 2, x, "the law") == x**2 / 2
    assert checked(3, "a") == 3
    for law, said in ((lambda y: [y], "the law is [x]; expected a number or an expression"),
                      (lambda y: y.nothing, "the law raised AttributeError: "),
                      (lambda y: None, "the law is None; expected a number or an expression")):  # fmt: skip
        with pytest.raises(ArgumentError) as refused:
            by_law(law, x, "the law")
        assert str(refused.value).startswith(said)


def test_what_depends_on_time_has_a_rate_of_its_own() -> None:
    """A compliance at an effort that swings: ``q = C sin t``, so a flow ``C cos t`` beside that of a resistance."""
    z = Zero("z")
    equations = state_equations(BondGraph((1, MSe(sp.sin(3 * time)), z), (2, z, C()), (3, z, R())))
    q = symbol("q_2")
    assert dict(equations.dependent_values) == {q: symbol("C_2") * sp.sin(3 * time)}
    assert equations.elimination[rate_of(q)] == 3 * symbol("C_2") * sp.cos(3 * time)
    assert (equations.states, equations.inputs) == ((), ())
    found = RunTime(equations).bond_variables(0.4, [], (), {"C_2": 2.0, "R_3": 5.0})
    e, f = np.sin(1.2), 6 * np.cos(1.2)
    assert found == {1: pytest.approx((e, f + e / 5)), 2: pytest.approx((e, f)), 3: pytest.approx((e, e / 5))}


def test_a_modulus_that_moves_with_a_state_enters_the_rate_of_what_depends_on_it() -> None:
    """An inertia behind a transformer of modulus 1 + q: ``p_4 = I_4 (1 + q) p_2 / I_2``."""
    v, w, q = One("v"), One("w"), energy_symbol("q", 5)
    tf = TF(1 + q)
    graph = BondGraph((1, Se(), v), (2, v, I(2)), (5, v, C(law=lambda _: 0)), (3, v, tf), (6, tf, w), (4, w, I(3)))
    run = RunTime(state_equations(graph))
    assert run.states == ("p_2", "q_5")
    p, x, u = 4.0, 0.5, 7.0
    m, speed = 1 + x, p / 2.0
    # energy: (2 + 3 m^2) f' + 3 m m' f = u with f = p / 2, m' = f
    acceleration = (u - 3 * m * speed**2) / (2 + 3 * m**2)
    assert run.rhs(0.0, [p, x], [u]) == pytest.approx([2 * acceleration, speed])
    assert run.bond_variables(0.0, [p, x], [u])[4] == pytest.approx((3 * (m * acceleration + speed**2), m * speed))


@pytest.mark.parametrize(("law", "inverse"), [(lambda p: p**3, lambda f: sp.cbrt(f)), (lambda p: p / 5, None), (None, None)])
def test_storage_that_follows_is_that_of_its_law(law: Any, inverse: Any) -> None:
    v = One("v")
    graph = BondGraph((1, Sf(), v), (2, v, I(5, law=law, inverse=inverse)))
    (value,) = state_equations(graph).dependent_values.values()
    assert float(value.subs(symbol("Sf_1"), 8)) == pytest.approx(2.0 if inverse else 40.0)


def test_a_law_with_two_solutions_is_none() -> None:
    z = Zero("z")
    with pytest.raises(DeclarationError) as refused:
        state_equations(BondGraph((1, Se(), z), (2, z, C(law=lambda q: q**2)), name="graph"))
    assert (
        str(refused.value) == "graph: C on bond 2 is needed in the other direction than its law gives: state its `inverse`, too"
    )
    for law, said in ((0, "C_2 is 0; leave the element out, or give it a value"),):
        with pytest.raises(ArgumentError, match=said):
            state_equations(BondGraph((1, Sf(), z), (2, z, C(law))))
