"""Numbers for the equations of a bond graph: inputs of every kind, and arguments that are refused by name."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from gearlib.bondgraph import (
    GY,
    TF,
    BondGraph,
    C,
    I,
    MSe,
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
from gearlib.errors import ArgumentError, BindingError, GearlibError, SolverError


def oscillator(**values: Any) -> BondGraph:
    v = One("v")
    return BondGraph((1, Se(), v), (2, v, I()), (3, v, C()), (4, v, R(**values)), name="oscillator")


@pytest.fixture(scope="module")
def run() -> RunTime:
    return RunTime(state_equations(oscillator()))


NUMBERS = {"I_2": 2.0, "C_3": 0.5, "R_4": 3.0}


def test_names_and_their_order(run: RunTime) -> None:
    assert (run.states, run.inputs, run.parameters) == (("p_2", "q_3"), ("Se_1",), ("C_3", "I_2", "R_4"))
    by_name = run.rhs(0.0, [4.0, 1.0], {"Se_1": 7.0}, NUMBERS)
    assert by_name == pytest.approx([7.0 - 1.0 / 0.5 - 3.0 * 2.0, 2.0])
    assert run.rhs(0.0, [4.0, 1.0], [7.0], [0.5, 2.0, 3.0]) == pytest.approx(by_name)
    assert run.rhs(0.0, [4.0, 1.0], parameters=NUMBERS) == pytest.approx([by_name[0] - 7.0, 2.0]), "no input is zero"


def test_linear_model_and_variables_of_bonds(run: RunTime) -> None:
    A, B = run.matrices(NUMBERS)
    assert pytest.approx(np.array([[-1.5, -2.0], [0.5, 0.0]])) == A
    assert pytest.approx(np.array([[1.0], [0.0]])) == B
    found = run.bond_variables(0.0, [4.0, 1.0], [7.0], NUMBERS)
    assert {n: pytest.approx(v) for n, v in {1: (7.0, 2.0), 2: (-1.0, 2.0), 3: (2.0, 2.0), 4: (6.0, 2.0)}.items()} == found


@pytest.mark.parametrize("given", [5.0, 5, lambda t: 5.0 + 0 * t, sp.Integer(5), lambda t: 2 * t, 2 * time, sp.sin(time)])
def test_inputs_are_numbers_functions_or_expressions_of_time(run: RunTime, given: Any) -> None:
    right = run.bind(NUMBERS, {"Se_1": given})
    for t in (0.0, 2.5):
        value = given(t) if callable(given) else float(sp.sympify(given).subs(time, t))
        assert right(t, np.array([0.0, 0.0])) == pytest.approx([value, 0.0])
    assert run.bind(NUMBERS)(1.0, np.array([4.0, 1.0])) == pytest.approx([-8.0, 2.0])


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda r: r.rhs(0.0, [1.0], parameters=NUMBERS), "x must hold 2 numbers (p_2, q_3), not (1,)"),
        (lambda r: r.rhs(0.0, [1.0, 2.0], parameters=[1.0]), "oscillator: 1 values for 3 parameters: C_3, I_2, R_4"),
        (lambda r: r.rhs(0.0, [1.0, 2.0], [1.0, 2.0], NUMBERS), "oscillator: 2 values for 1 inputs: Se_1"),
        (lambda r: r.rhs(0.0, [1.0, 2.0], {"Se": 1.0}, NUMBERS), "oscillator: no input 'Se': did you mean 'Se_1'? Valid names: Se_1"),
        (lambda r: r.rhs(0.0, [1.0, 2.0], parameters={"I_2": 1.0}), "oscillator: no value for parameter C_3, R_4"),
        (lambda r: r.rhs(0.0, [1.0, 2.0], parameters=NUMBERS | {"I_2": True}), "oscillator: parameter I_2 = True; expected finite numbers"),
        (lambda r: r.rhs(0.0, [1.0, 2.0], parameters={2: 1.0}),
         "2 is not a name; names are strings, such as 'C_3' (in oscillator: parameters)"),
        (lambda r: r.rhs(0.0, [1.0, 2.0], {1: 1.0}, NUMBERS), "1 is not a name; names are strings, such as 'Se_1' (in oscillator: inputs)"),
        (lambda r: r.bind(NUMBERS, {"Se_2": 1.0}), "oscillator: no input 'Se_2': did you mean 'Se_1'? Valid names: Se_1"),
        (lambda r: r.bind(NUMBERS, None, {"Se_2": 1.0}), "oscillator: no input 'Se_2': did you mean 'Se_1'? Valid names: Se_1"),
        (lambda r: r.bind(NUMBERS, {"Se_1": sp.Symbol("x")}), "input 'Se_1' is x; expected an expression of gearlib.bondgraph.time"),
        (lambda r: r.bind(NUMBERS, {"Se_1": time + sp.oo}), "input 'Se_1' is oo; expected an expression of gearlib.bondgraph.time"),
        (lambda r: r.bind(NUMBERS, {"Se_1": float}),
         "input 'Se_1' is <class 'float'>; expected a number, a function of time, or an expression of gearlib.bondgraph.time"),
        (lambda r: RunTime(3), "equations is 3; expected the result of state_equations"),
        (lambda r: r.matrices(NUMBERS | {"C_3": 0.0}),
         "oscillator: with these values of parameters something is divided by zero"),
        (lambda r: r.rhs(0.0, [1.0, 2.0], parameters=NUMBERS | {"I_2": 0.0}),
         "oscillator: with these values something is divided by zero (an inertia, a compliance)"),
    ],
)  # fmt: skip
def test_what_is_refused_at_run_time(run: RunTime, call: Any, said: str) -> None:
    with pytest.raises(GearlibError) as problem:
        call(run)
    assert str(problem.value) == said


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: energy_symbol("r", 3), "energy_symbol: kind is 'r'; expected 'p' or 'q'"),
        (lambda: One(3), "One: name is 3; expected text, such as 'rotor'"),
        (lambda: R(law=3), "R: law is 3; expected a function of one expression"),
        (lambda: R(conductance=float), "R: conductance is <class 'float'>; expected a function of one expression"),
        (lambda: C(inverse="q"), "C: inverse is 'q'; expected a function of one expression"),
        (lambda: BondGraph(name=3), "BondGraph: name is 3; expected text"),
        (lambda: oscillator().at(I()), "oscillator: the I element given is on no bond of this graph"),
        (lambda: oscillator().at(3), "oscillator: element is 3; expected an element of the graph, one of graph.elements"),
        (lambda: oscillator().element(2, C), "oscillator: bond 2 joins 1-junction 'v' and I on bond 2"),
        (lambda: oscillator().element(True), "oscillator: there is no bond True; bonds are 1, 2, 3, 4"),
        (lambda: oscillator().of_kind(3), "kinds are (3,); expected classes of elements, such as R"),
        (lambda: assign_causality(3), "graph is 3; expected a BondGraph"),
        (lambda: state_equations(oscillator(), causality=3),
         "oscillator: causality is 3; expected the result of assign_causality for this graph"),
        (lambda: state_equations(oscillator(), causality=assign_causality(BondGraph((1, Se(), C())))), None),
        (lambda: state_equations(oscillator(law=lambda f: 1 / 0)),
         "the law of R on bond 4 raised ZeroDivisionError: division by zero"),
        (lambda: state_equations(oscillator(law=lambda f: "f")), "the law of R on bond 4 is 'f'; expected a number or an expression"),
        (lambda: state_equations(oscillator(value=math.inf)), "R_4 is inf; expected a finite number"),
        (lambda: state_equations(oscillator(value=sp.I)), "R_4 is I; expected a finite real number or expression"),
        (lambda: state_equations(oscillator(value=1 - sp.oo)), "R_4 is -oo; expected a finite real number or expression"),
    ],
)  # fmt: skip
def test_what_is_refused_of_elements_and_graphs(make: Any, said: str | None) -> None:
    with pytest.raises(ArgumentError) as problem:
        make()
    assert said is None or str(problem.value) == said


def test_parameters_are_numbers_names_fractions_or_expressions() -> None:
    v, w = One("v"), Zero("")
    tf, gy = TF(Fraction(1, 3)), GY("r")
    graph = BondGraph(
        (1, Se(7), v),
        (2, v, I(sp.Symbol("a", real=True) * 2)),
        (3, v, tf),
        (4, tf, w),
        (5, w, C("c")),
        (6, w, gy),
        (7, gy, R()),
    )
    equations = state_equations(graph)
    a, c, r, resistance, p, q = (sp.Symbol(n, real=True) for n in ("a", "c", "r", "R_7", "p_2", "q_5"))
    assert equations.parameters == (resistance, a, c, r)
    third = sp.Rational(1, 3)
    assert equations.printed == {p: 7 - third * q / c, q: sp.expand(third * p / (2 * a) - q / c * resistance / r**2)}
    assert graph.label(w) == "0-junction of bonds 4, 5, 6"
    assert graph.label(gy) == "GY on bonds 6, 7"


def test_latex_is_broken_after_so_many_terms() -> None:
    text = state_equations(oscillator()).latex(terms=1)
    assert text.count("\\quad") == 2
    with pytest.raises(ArgumentError, match="terms is 0"):
        state_equations(oscillator()).latex(terms=0)
    with pytest.raises(BindingError, match="no parameter"):
        RunTime(state_equations(oscillator())).bind(NUMBERS | {"J": 1.0})


@pytest.mark.parametrize("effort", [4.0, 25.0, -25.0, 300.0])
def test_long_steps_of_newtons_method_are_halved(effort: float) -> None:
    """An effort that levels off: from zero, whole steps would go to and fro for ever at 25."""
    i, node = One("i"), Zero("node")
    part = R(law=lambda f: 20 * sp.atan(f))
    graph = BondGraph((1, Se(), i), (2, i, R()), (3, i, node), (4, node, part), (5, node, I()))
    run = RunTime(state_equations(graph))
    found = run.bond_variables(0.0, [3.0], [effort], {"I_5": 2.0, "R_2": 1.0})
    flow = brentq(lambda f: 20 * np.arctan(f) + (f + 1.5) - effort, -500, 500, xtol=1e-13)
    assert found[4] == pytest.approx((20 * np.arctan(flow), flow), rel=1e-10)
    assert found[2] == pytest.approx((flow + 1.5, flow + 1.5), rel=1e-10)


def test_a_solution_that_rounding_hides_is_taken_where_nothing_is_left() -> None:
    """f**3 - 3 f**2 + 3 f = 1 has a threefold solution: beside it the residual is rounding long before the steps are."""
    v = One("v")
    run = RunTime(state_equations(BondGraph((1, Se(), v), (2, v, R(3.0)), (3, v, R(law=lambda f: f**3 - 3 * f**2)))))
    effort, flow = run.bond_variables(0.0, [], [1.0])[2]
    assert flow == pytest.approx(1.0, abs=1e-4)
    assert effort == pytest.approx(3 * flow)


@pytest.mark.parametrize(("beyond", "solved"), [(0.95e-9, True), (1.05e-9, False)])
def test_what_no_step_reduces_is_solved_to_1e_10_of_the_unknowns_or_refused(beyond: float, solved: bool) -> None:
    """(f - 9)**2 = -beyond has no solution; 1e-10 (1 + 9) of it is taken for rounding."""
    v = One("v")
    run = RunTime(state_equations(BondGraph((1, Se(), v), (2, v, R(1.0)), (3, v, R(law=lambda f: f**2 - 19 * f)))))
    if solved:
        assert run.bond_variables(0.0, [], [-81 - beyond])[2] == pytest.approx((9.0, 9.0), rel=1e-5)
        return
    with pytest.raises(SolverError, match="found no solution of the algebraic loops at t = 0 s"):
        run.bond_variables(0.0, [], [-81 - beyond])


def test_a_source_may_begin_at_time_zero() -> None:
    v = One("v")
    right = RunTime(state_equations(BondGraph((1, MSe(sp.sqrt(time)), v), (2, v, I())))).bind({"I_2": 2.0})
    assert right(9.0, np.array([1.0])) == pytest.approx([3.0])


def test_rates_of_states_that_are_no_numbers_are_none() -> None:
    """An integrator may try them; that is no division by zero in the equations."""
    a, b, gear = One("a"), One("b"), TF(2 + sp.sin(time))
    graph = BondGraph((1, Se(), a), (2, a, I(1.0)), (3, a, gear), (4, gear, b), (5, b, I(1.0)))
    assert np.isnan(RunTime(state_equations(graph)).bind()(4.0, np.array([np.nan]))).all()


def test_inputs_of_several_kinds_stand_side_by_side() -> None:
    """A number, an expression, a function and nothing, each in its place; and their rates where they are needed."""
    v, nodes = One("v"), [Zero(f"{k}") for k in range(4)]
    bonds: list[Any] = [(10 + k, v, node) for k, node in enumerate(nodes)]
    bonds += [(20 + k, Sf(), node) for k, node in enumerate(nodes)]
    masses = [I(1.0 + k) for k in range(4)]
    bonds += [(30 + k, node, mass) for k, (node, mass) in enumerate(zip(nodes, masses, strict=True))]
    graph = BondGraph((1, v, I(5.0)), *bonds)
    equations = state_equations(graph, [1])
    assert [str(p) for p in equations.states] == ["p_1"]
    run = RunTime(equations)
    names = ["Sf_20", "Sf_21", "Sf_22", "Sf_23"]
    assert list(run.inputs) == names
    given = {"Sf_20": 2.0, "Sf_21": time**2, "Sf_22": np.sin}
    right = run.bind((), given, {"Sf_22": np.cos})
    t, x = 0.7, np.arange(1.0, len(run.states) + 1)
    values, rates = [2.0, t**2, np.sin(t), 0.0], [0.0, 2 * t, np.cos(t), 0.0]
    assert right(t, x) == pytest.approx(run.rhs(t, x, values, (), rates))
    assert right(t, x) == pytest.approx(
        run.rhs(t, x, dict(zip(names, values, strict=True)), (), dict(zip(names, rates, strict=True)))
    )
    # each mass turns with v and its source: p_k = J_k (p_1 / 5 + f_k), and 5 w' is minus the sum of their rates
    w = -sum((1 + k) * rates[k] for k in range(4)) / (5 + sum(1 + k for k in range(4)))
    assert right(t, x)[0] == pytest.approx(5 * w)
