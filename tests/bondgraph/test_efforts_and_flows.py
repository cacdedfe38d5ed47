"""Efforts and flows as the elements that set them give them; long chains."""

from __future__ import annotations

import sys
from typing import Any

import pytest
import sympy as sp

from gearlib.bondgraph import (
    GY,
    TF,
    BondGraph,
    C,
    I,
    One,
    R,
    RunTime,
    Se,
    Sf,
    Zero,
    state_equations,
)


def symbols(names: str) -> tuple[Any, ...]:
    return tuple(sp.Symbol(name, real=True) for name in names.split())


def test_a_long_chain_of_gears_takes_no_deep_recursion() -> None:
    """More elements than a recursion may be deep: two inertias, an even number of turns of sense between them."""
    count = 80
    shafts = [One(f"{k}") for k in range(count)]
    bonds: list[Any] = [(1, Se(), shafts[0]), (2, shafts[0], I(2))]
    for k, (one, other) in enumerate(zip(shafts, shafts[1:], strict=False)):
        gear = TF(-1 if k < 10 else 1)
        bonds += [(3 + 2 * k, one, gear), (4 + 2 * k, gear, other)]
    graph = BondGraph(*bonds, (500, shafts[-1], I(3)))
    before, frame, depth = sys.getrecursionlimit(), sys._getframe(), 0
    while frame is not None:
        frame, depth = frame.f_back, depth + 1  # type: ignore[assignment]
    sys.setrecursionlimit(depth + 180)
    try:
        equations = state_equations(graph)
    except RecursionError:
        pytest.fail("the elements of a chain are visited one inside the other")
    finally:
        sys.setrecursionlimit(before)
    p_2, dp_500, source = symbols("p_2 dp_500 Se_1")
    assert equations.printed == {p_2: source - dp_500}
    assert list(equations.dependent_values.values()) == [3 * p_2 / 2]
    assert RunTime(equations).rhs(0.0, [1.0], [10.0]).tolist() == [4.0]


def test_a_common_variable_is_that_of_storage_with_derivative_causality() -> None:
    """f = p / I on a 1-junction and e = q / C on a 0-junction, of the element's own p or q; but not of other elements there."""
    v, z = One("v"), Zero("z")
    p_2, q_2, q_3, i_2, c_2, c_3, r_4, force, speed = symbols("p_2 q_2 q_3 I_2 C_2 C_3 R_4 Se_1 Sf_1")
    driven = state_equations(BondGraph((1, Sf(), v), (2, v, I()), (3, v, C()), (4, v, R())))
    assert driven.printed == {q_3: p_2 / i_2}
    assert (driven.flows[3], driven.flows[4], driven.efforts[4]) == (p_2 / i_2, p_2 / i_2, r_4 * p_2 / i_2)
    assert driven.dependent_values == {p_2: i_2 * speed}
    held = state_equations(BondGraph((1, Se(), z), (2, z, C()), (3, z, I()), (4, z, R())))
    assert held.efforts[4] == q_2 / c_2
    assert held.flows[4] == q_2 / c_2 / r_4
    assert held.dependent_values == {q_2: c_2 * force}
    # a compliance on a 1-junction sets its flow as a rate, an inertia on a 0-junction its effort
    series = state_equations(BondGraph((1, Se(), v), (2, v, C())))
    assert series.flows[1] == sp.Symbol("dq_2", real=True)
    assert series.efforts[2] == force
    parallel = state_equations(BondGraph((1, Sf(), z), (2, z, I())))
    assert parallel.efforts[1] == sp.Symbol("dp_2", real=True)
    assert parallel.flows[2] == speed
    both = state_equations(BondGraph((1, Se(), z), (2, z, C()), (3, z, C())))
    assert set(both.dependent) == {q_2, q_3}
    assert both.efforts[1] == force
    assert c_3 in both.parameters


def test_unknowns_of_a_loop_are_named_by_their_bonds() -> None:
    """Two loops of resistances behind each other: their first outputs are unknown."""
    i, node, j, end = One("i"), Zero("node"), One("j"), Zero("end")
    graph = BondGraph(
        (1, Se(), i), (2, i, R()), (3, i, node), (4, node, R()), (5, node, j), (6, j, R()), (7, j, end), (8, end, R()), (9, end, I()),
    )  # fmt: skip
    equations = state_equations(graph)
    assert [f"{letter}_{number}" for letter, number in equations.causality.tears] == [str(z) for z in equations.tears]
    assert len(set(equations.tears)) == len(equations.tears) > 1
    assert {int(str(z)[2:]) for z in equations.tears} <= {2, 4, 6, 8}
    # by nodes: currents through conductances, effort source of 10, inertia's flow p / I = 2
    run = RunTime(equations)
    values = {"R_2": 1.0, "R_4": 2.0, "R_6": 4.0, "R_8": 5.0, "I_9": 3.0}
    matrix = sp.Matrix(
        [[1 + sp.Rational(1, 2) + sp.Rational(1, 4), -sp.Rational(1, 4)], [-sp.Rational(1, 4), sp.Rational(9, 20)]]
    )
    node_effort, end_effort = matrix.LUsolve(sp.Matrix([10, -2]))
    found = run.bond_variables(0.0, [6.0], [10.0], values)
    assert run.rhs(0.0, [6.0], [10.0], values) == pytest.approx([float(end_effort)])
    assert (found[4][0], found[8][0]) == pytest.approx((float(node_effort), float(end_effort)))


def test_gyrators_and_transformers_give_what_their_moduli_say() -> None:
    """Whichever of their four quantities is given, and whichever way round their half arrows are."""
    for middle, source, kind in ((TF, Se, "e"), (TF, Sf, "f"), (GY, Se, "f"), (GY, Sf, "e")):
        for turned in (False, True):
            part = middle(sp.Rational(5, 2))
            load = R(3) if kind == "f" else R(sp.Rational(1, 3))
            end = One("w")
            bonds: list[Any] = [(1, source(7), v := One("v")), (2, v, part), (3, part, end), (4, end, load)]
            if turned:
                bonds[1:3] = [(2, part, v), (3, end, part)]
            equations = state_equations(BondGraph(*bonds))
            (e_2, f_2), (e_3, f_3) = ((equations.efforts[n], equations.flows[n]) for n in (2, 3))
            m = sp.Rational(5, 2)
            if turned:  # power goes from 3 to 2
                e_2, f_2, e_3, f_3 = e_3, f_3, e_2, f_2
            assert (f_3, e_2) == ((m * f_2, m * e_3) if middle is TF else (e_2 / m, m * f_3))
            assert middle is TF or e_3 == m * f_2
            assert (equations.efforts[1] if source is Se else equations.flows[1]) == 7
