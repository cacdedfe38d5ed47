"""Mistakes in a bond graph are named, with the bonds at fault."""

from __future__ import annotations

import pytest

from gearlib.bondgraph import TF, BondGraph, C, I, One, R, RunTime, Se, Sf, Zero, assign_causality, state_equations
from gearlib.errors import ArgumentError, BalanceError, BindingError, ConnectionError, SingularError


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
    with pytest.raises(ConnectionError, match=r"bond 1 is there twice"):
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
