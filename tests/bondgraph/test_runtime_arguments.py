"""Arguments of the numerical equations in all their forms: sequences, mappings, nothing; inputs whose rates matter; loops that bend."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp

from gearlib.bondgraph import BondGraph, C, I, One, R, RunTime, Se, Sf, Zero, runtime, state_equations, time
from gearlib.errors import ArgumentError, BindingError, BoundError, NameLookupError, SolverError


def pulled() -> RunTime:
    """A source of flow on an inertia, and a compliance behind a resistance: ``q' = Sf``, ``e_1 = I f' + R f + q / C``."""
    v = One("v")
    return RunTime(state_equations(BondGraph((1, Sf(), v), (2, v, I()), (3, v, C()), (4, v, R()), name="pulled")))


NUMBERS = {"I_2": 2.0, "C_3": 0.5, "R_4": 3.0}
FORMS: list[Any] = [lambda x: (x,), lambda x: [x], lambda x: np.array([x]), lambda x: {"Sf_1": x}]


@pytest.mark.parametrize("u", FORMS)
@pytest.mark.parametrize("rate", FORMS)
def test_inputs_and_their_rates_are_sequences_or_mappings(u: Any, rate: Any) -> None:
    run = pulled()
    assert (run.states, run.inputs, run.parameters) == (("q_3",), ("Sf_1",), ("C_3", "I_2", "R_4"))
    assert run.rhs(0.0, [4.0], u(5.0), NUMBERS, rate(7.0)).tolist() == [5.0]
    found = run.bond_variables(0.0, (4.0,), u(5.0), tuple(NUMBERS[name] for name in run.parameters), rate(7.0))
    assert found[2] == pytest.approx((14.0, 5.0))
    assert abs(found[1][0]) == pytest.approx(14.0 + 8.0 + 15.0)
    assert (found[3], found[4]) == (pytest.approx((8.0, 5.0)), pytest.approx((15.0, 5.0)))


def test_inputs_and_rates_that_are_left_out_are_zero() -> None:
    run = pulled()
    assert run.rhs(0.0, [4.0], parameters=NUMBERS).tolist() == [0.0]
    assert run.bond_variables(0.0, [4.0], [5.0], NUMBERS)[2] == (0.0, 5.0)
    assert run.bond_variables(0.0, [4.0], (), NUMBERS, [7.0])[2] == (14.0, 0.0)


@pytest.mark.parametrize(
    ("arguments", "kind", "said"),
    [
        (((1.0, 2.0), NUMBERS), BindingError, "pulled: 2 values for 1 inputs: Sf_1"),
        (((1.0,), NUMBERS, (1.0, 2.0)), BindingError, "pulled: 2 values for 1 inputs: Sf_1"),
        (([], NUMBERS), BindingError, "pulled: 0 values for 1 inputs: Sf_1"),
        (({}, NUMBERS), BindingError, "pulled: no value for input Sf_1"),
        (((1.0,), NUMBERS, {}), BindingError, "pulled: no value for input Sf_1"),
        ((({"Sf_1": "a"}), NUMBERS), BoundError, "pulled: input Sf_1 = 'a'; expected finite numbers"),
        (((), ()), BindingError, "pulled: 0 values for 3 parameters: C_3, I_2, R_4"),
    ],
)  # fmt: skip
def test_as_many_values_as_names(arguments: Any, kind: Any, said: str) -> None:
    with pytest.raises(kind) as refused:
        pulled().rhs(0.0, [1.0], *arguments)
    assert str(refused.value) == said


def test_a_system_without_inputs_and_parameters_takes_none() -> None:
    run = RunTime(state_equations(BondGraph((1, Se(3), v := One("v")), (2, v, I(2)), name="plain")))
    assert run.rhs(0.0, [1.0]).tolist() == run.rhs(0.0, [1.0], [], {}, np.empty(0)).tolist() == [3.0]
    assert run.bind()(0.0, np.array([1.0])).tolist() == [3.0]
    A, B = run.matrices()
    assert (A.tolist(), B.shape) == ([[0.0]], (1, 0))
    for call in (lambda: run.rhs(0.0, [1.0], [2.0]), lambda: run.rhs(0.0, [1.0], parameters=[2.0])):
        with pytest.raises(BindingError, match=r"^plain: 1 values for 0 (inputs|parameters): none$"):
            call()
    with pytest.raises(NameLookupError, match=r"^1 is not a name; names are strings, such as 'J' \(in plain: parameters\)$"):
        run.rhs(0.0, [1.0], parameters={1: 2.0})


def summed() -> RunTime:
    """A source of flow between two inertias: ``p_2' = Se - I_5 (p_2' / I_2 + Sf')``."""
    a, s, b = One("a"), Zero("s"), One("b")
    graph = BondGraph((1, Se(), a), (2, a, I(2.0)), (3, a, s), (4, Sf(), s), (6, s, b), (5, b, I(3.0)), name="summed")
    return RunTime(state_equations(graph))


@pytest.mark.parametrize(
    ("given", "rates", "rate"),
    [
        (4.0, {}, 0.0), (time**2, {}, 1.4), (sp.Integer(4), {}, 0.0), (np.sin, {"Sf_4": np.cos}, np.cos(0.7)), (np.sin, {"Sf_4": 9.0}, 9.0),
        (np.sin, {"Sf_4": time**3}, 3 * 0.49 * 0.7 / 3), (time**2, {"Sf_4": 9.0}, 9.0), (2, {"Sf_4": 9.0}, 9.0),
    ],
)  # fmt: skip
def test_rates_of_inputs_are_given_or_those_of_expressions(given: Any, rates: Any, rate: float) -> None:
    run = summed()
    assert run.states == ("p_2",)
    right = run.bind((), {"Se_1": 10.0, "Sf_4": given}, rates)
    # (1 + 3 / 2) p_2' = 10 - 3 Sf'
    assert right(0.7, np.array([1.0])) == pytest.approx([(10.0 - 3.0 * rate) / 2.5])


def test_a_function_of_time_whose_rate_matters_needs_that_rate() -> None:
    with pytest.raises(ArgumentError) as refused:
        summed().bind((), {"Sf_4": np.sin})
    assert str(refused.value) == "input 'Sf_4' drives storage with derivative causality: give its derivative in `rates`"
    summed().bind((), {"Se_1": np.sin, "Sf_4": 3.0})  # this one's rate does not
    with pytest.raises(ArgumentError, match=r"^input 'Sf_4' is 'fast'; expected a number, a function of time"):
        summed().bind((), {"Sf_4": 1.0}, {"Sf_4": "fast"})  # type: ignore[dict-item]


def test_signals_are_constant_arrays_or_functions_of_time() -> None:
    constant = runtime.signal([1.0, 2])
    assert constant(0.0) is constant(5.0)
    assert constant(3.0).tolist() == [1.0, 2.0]
    mixed = runtime.signal([1.0, time**2, lambda t: 10 * t, sp.Integer(7), 3])
    assert mixed(2.0).tolist() == [1.0, 4.0, 20.0, 7.0, 3.0]
    assert mixed(0.0).tolist() == [1.0, 0.0, 0.0, 7.0, 3.0]


def levelling(**law: Any) -> RunTime:
    """A source against a resistance and, at one node with it, another one and an inertia."""
    i, node = One("i"), Zero("node")
    graph = BondGraph((1, Se(), i), (2, i, R(2.0)), (3, i, node), (4, node, R(**law)), (5, node, I(5.0)), name="levelling")
    return RunTime(state_equations(graph))


def test_the_linear_model_of_a_loop_that_bends_is_that_at_its_own_solution() -> None:
    """``e = u - 2 (f + p / 5)`` with ``e = f^3 + f``: at f = 1, p = 10 and u = 8 the slope of e(f) is 4, so de = (du - 2 dp / 5) 4 / 6."""
    run = levelling(law=lambda f: f**3 + f)
    assert run.rhs(0.0, [10.0], [8.0]) == pytest.approx([2.0])
    A, B = run.matrices(x=[10.0], u=[8.0])
    assert (A.tolist(), B.tolist()) == ([[pytest.approx(-0.4 * 4 / 6)]], [[pytest.approx(4 / 6)]])
    A, B = run.matrices()  # at rest the slope is 1
    assert (A.tolist(), B.tolist()) == ([[pytest.approx(-0.4 / 3)]], [[pytest.approx(1 / 3)]])
    assert run.bind((), {"Se_1": 8.0})(0.0, np.array([10.0])) == pytest.approx([2.0])


def test_a_loop_without_a_solution_is_told_with_the_time() -> None:
    """``e = f^2 + 1`` never meets ``e = u - 2 f`` for u below 0."""
    run = levelling(law=lambda f: f**2 + 1)
    assert run.rhs(0.0, [0.0], [4.0]) == pytest.approx([2.0])
    with pytest.raises(SolverError) as refused:
        run.rhs(1.5, [0.0], [-4.0])
    assert str(refused.value) == "levelling: Newton's method found no solution of the algebraic loops at t = 1.5 s"
