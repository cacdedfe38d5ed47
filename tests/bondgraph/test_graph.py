"""Mistakes in a bond graph are named, with the bonds at fault."""

from __future__ import annotations

import math
from typing import Any

import pytest

from gearlib.bondgraph import TF, BondGraph, C, I, One, R, RunTime, Se, Sf, Zero, assign_causality, state_equations
from gearlib.errors import ArgumentError, BalanceError, BindingError, BoundError, ConnectionError, SingularError


def test_dangling_bond() -> None:
    with pytest.raises(ConnectionError, match=r"1-junction 'v' has only bond 1: the bond dangles"):
        BondGraph((1, Se(), One("v")))


def test_transformer_with_one_bond() -> None:
    v = One("v")
    with pytest.raises(ConnectionError, match=r"TF on bond 3 must have two bonds, but it has 1"):
        BondGraph((1, Se(), v), (2, v, I()), (3, v, TF(2)))


def test_one_port_with_two_bonds() -> None:
    v, shared = One("v"), I()
    with pytest.raises(ConnectionError, match=r"I on bonds 2, 3 is a one-port"):
        BondGraph((1, Se(), v), (2, v, shared), (3, v, shared))


def test_number_used_twice_and_bond_to_itself() -> None:
    v = One("v")
    with pytest.raises(ConnectionError, match=r"bond 1 is used twice"):
        BondGraph((1, Se(), v), (1, v, I()))
    with pytest.raises(ConnectionError, match=r"bond 2 begins and ends on the same element"):
        BondGraph((1, Se(), v), (2, v, v))


def test_orientation_conflicts() -> None:
    v = One("v")
    with pytest.raises(ConnectionError, match=r"I on bond 2 takes up power: the half arrow must point to it"):
        BondGraph((1, Se(), v), (2, I(), v))
    with pytest.raises(ConnectionError, match=r"Se on bond 1 gives power: the half arrow must point away"):
        BondGraph((1, v, Se()), (2, v, I()))
    tf, w = TF(2), One("w")
    with pytest.raises(ConnectionError, match=r"TF on bonds 2, 3 must have one half arrow pointing in and one pointing out"):
        BondGraph((1, Se(), v), (2, v, tf), (3, w, tf), (4, w, I()))


def test_sources_that_fight() -> None:
    v, zero, tf = One("v"), Zero("node"), TF(2)
    with pytest.raises(BalanceError, match=r"Sf on bond 1 and Sf on bond 2 both set the flow of bond 2"):
        assign_causality(BondGraph((1, Sf(), v), (2, Sf(), v), (3, v, I())))
    with pytest.raises(BalanceError, match=r"Se on bond 1 and Se on bond 2 both set the effort of bond 2"):
        assign_causality(BondGraph((1, Se(), zero), (2, Se(), zero), (3, zero, C())))
    w = One("w")
    with pytest.raises(BalanceError, match=r"Sf on bond 1 and Sf on bond 4 both set the flow"):
        assign_causality(BondGraph((1, Sf(), v), (2, v, tf), (3, tf, w), (4, Sf(), w)))
    with pytest.raises(BalanceError, match=r"Se on bond 1 and Se on bond 2 both set the effort of bond 2"):
        assign_causality(BondGraph((1, Se(), v), (2, Se(), v)))


def test_wrong_bond_numbers() -> None:
    v = One("v")
    graph = BondGraph((1, Se(), v), (2, v, I()), (3, v, R()))
    with pytest.raises(ArgumentError, match=r"no storage element on bonds 3; they are on 2"):
        assign_causality(graph, prefer=[3])
    with pytest.raises(ArgumentError, match=r"there is no bond 7; bonds are 1, 2, 3"):
        graph.element(7)


def test_wrong_numbers_at_run_time() -> None:
    v = One("v")
    run = RunTime(state_equations(BondGraph((1, Se(), v), (2, v, I()), (3, v, I()), (4, v, R()))))
    with pytest.raises(BindingError, match=r"no parameter 'R_5': did you mean 'R_4'"):
        run.rhs(0.0, [1.0], parameters={"I_2": 1, "I_3": 1, "R_5": 1})
    with pytest.raises(BindingError, match=r"no value for parameter R_4"):
        run.rhs(0.0, [1.0], parameters={"I_2": 1, "I_3": 1})
    with pytest.raises(BindingError, match=r"no input 'Se_2'"):
        run.bind({"I_2": 1, "I_3": 1, "R_4": 1}, inputs={"Se_2": 1.0})
    with pytest.raises(ArgumentError, match=r"x must hold 1 numbers \(p_2\)"):
        run.rhs(0.0, [1.0, 2.0], parameters=[1, 1, 1])
    with pytest.raises(SingularError, match=r"these values make the equations for dp_2 singular"):
        run.rhs(0.0, [1.0], parameters={"I_2": 1.0, "I_3": -1.0, "R_4": 1.0})


@pytest.mark.parametrize(
    ("bonds", "message"),
    [
        ((5,), r"5 is not a bond; expected \(number, tail, head\)"),
        (((1, Se()),), r"is not a bond; expected \(number, tail, head\)"),
        ((("1", Se(), One("v")),), "is not a bond"),
        (((1.0, Se(), One("v")),), "is not a bond"),
        (([1, Se(), One("v")],), "is not a bond"),
        (((1, Se(), One("v"), One("w")),), "is not a bond"),
        (((True, Se(), One("v")),), "is not a bond"),
        (((1, "Se", One("v")),), "bond 1 ends on 'Se', which is not an element"),
        (((1, Se, One("v")),), r"which is not an element; make one: Se\(\.\.\.\)"),
        (((1, Se(), int),), r"^bond graph: bond 1 ends on <class 'int'>, which is not an element$"),
    ],
)
def test_what_is_no_bond_is_refused(bonds: tuple[Any, ...], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        BondGraph(*bonds)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (float("nan"), "I_2 is nan; expected a finite"),
        ([1.0], r"I_2 is \[1.0\]; expected a number, the name of a parameter"),
        (0, "I_2 is 0; leave the element out"),
    ],
)
def test_values_that_are_no_numbers_are_refused(value: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        state_equations(BondGraph((1, Se("F"), (v := One("v"))), (2, v, I(value)))).explicit()


def test_no_rate_is_nan_in_silence() -> None:
    run = RunTime(state_equations(BondGraph((1, Se(), (v := One("v"))), (2, v, I("m")), (3, v, R("d")))))
    with pytest.raises(BoundError, match="parameter m = nan; expected finite numbers"):
        run.rhs(0.0, [1.0], parameters={"m": math.nan, "d": 1.0})
    with pytest.raises(BoundError, match="parameter m = 'one'; expected finite numbers"):
        run.bind({"m": "one", "d": 1.0})  # type: ignore[dict-item]
    for call in (lambda p: run.rhs(0.0, [1.0], parameters=p), run.bind):
        with pytest.raises(SingularError, match="something is divided by zero"):
            call({"m": 0.0, "d": 1.0})


@pytest.mark.parametrize("prefer", [2, "2"])
def test_a_preference_is_a_list_of_bonds(prefer: Any) -> None:
    graph = BondGraph((1, Se(), (v := One("v"))), (2, v, I("m")))
    with pytest.raises(ArgumentError, match=r"prefer is .*expected numbers of bonds with a storage element, such as \[2, 6\]"):
        assign_causality(graph, prefer=prefer)
