"""Rates of what depends on time or on a state; assignments of other graphs."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from gearlib.bondgraph import (
    TF,
    BondGraph,
    C,
    I,
    MSe,
    One,
    R,
    RunTime,
    Se,
    Zero,
    assign_causality,
    energy_symbol,
    state_equations,
    time,
)
from gearlib.bondgraph.efforts_and_flows import rate_of
from gearlib.bondgraph.elements import symbol
from gearlib.errors import ArgumentError


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


def test_the_magnitude_of_what_depends_on_time_has_a_rate_since_time_is_real() -> None:
    z, q = Zero("z"), energy_symbol("q", 2)
    equations = state_equations(BondGraph((1, MSe(sp.Abs(sp.sin(3 * time))), z), (2, z, C()), (3, z, R())))
    assert equations.elimination[rate_of(q)] == 3 * symbol("C_2") * sp.cos(3 * time) * sp.sign(sp.sin(3 * time))


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


def test_an_assignment_of_another_graph_is_refused_even_where_all_its_elements_are_there() -> None:
    v, source, mass, spring = One("v"), Se(), I(), C()
    small = BondGraph((1, source, v), (2, v, mass), name="small")
    large = BondGraph((1, source, v), (2, v, mass), (3, v, spring))
    with pytest.raises(
        ArgumentError, match=r"^small: causality is Causality\(.*; expected the result of assign_causality for this graph$"
    ):
        state_equations(small, causality=assign_causality(large))
    assert [str(x) for x in state_equations(small, causality=assign_causality(small)).states] == ["p_2"]
