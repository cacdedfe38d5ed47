"""Graphs whose equations every textbook has, against those equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import expm
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
from gearlib.errors import ArgumentError, DeclarationError, SolverError


def test_motor_with_gear() -> None:
    # Karnopp, Margolis & Rosenberg, chapter 4: armature L, R; motor constant K; rotor and geared load turn as one
    i, w, out, gy, tf = One("current"), One("rotor"), One("load"), GY("K"), TF("n")
    graph = BondGraph(
        (1, Se("V"), i), (2, i, I("L")), (3, i, R("R_a")), (4, i, gy), (5, gy, w), (6, w, I("J")), (7, w, R("b")), (8, w, tf),
        (9, tf, out), (10, out, I("J_load")), (11, out, R("b_load")),
    )  # fmt: skip
    equations = state_equations(graph)
    assert equations.causality.integral == (2, 6)
    assert equations.causality.derivative == (10,)
    L, R_a, K, J, b, n, J_load, b_load, V = sp.symbols("L R_a K J b n J_load b_load V", real=True)
    p2, p6 = equations.states
    current, speed = p2 / L, p6 / J
    expected = [
        V - R_a * current - K * speed,
        (K * current - (b + n**2 * b_load) * speed) / (1 + n**2 * J_load / J),
    ]
    assert [sp.simplify(a - b) for a, b in zip(equations.explicit().values(), expected, strict=True)] == [0, 0]


def test_quarter_car() -> None:
    # Karnopp, Margolis & Rosenberg, fig. 5.8: road velocity, tyre spring, unsprung mass, suspension, sprung mass
    road, wheel, body, rel_tyre, rel = Zero("tyre"), One("wheel"), One("body"), Zero("suspension"), One("relative")
    graph = BondGraph(
        (1, Sf(), road), (2, road, C("c_t")), (3, road, wheel), (4, wheel, I("m_u")), (5, wheel, rel_tyre), (6, rel_tyre, rel),
        (7, rel, C("c_s")), (8, rel, R("d")), (9, rel_tyre, body), (10, body, I("m_s")),
    )  # fmt: skip
    run = RunTime(state_equations(graph))
    assert run.states == ("q_2", "p_4", "q_7", "p_10")
    kt, mu, ks, d, ms = 1.6e5, 36.0, 1.6e4, 980.0, 240.0
    A, B = run.matrices({"c_t": 1 / kt, "m_u": mu, "c_s": 1 / ks, "d": d, "m_s": ms})
    expected = [
        [0, -1 / mu, 0, 0],
        [kt, -d / mu, -ks, d / ms],
        [0, 1 / mu, 0, -1 / ms],
        [0, d / mu, ks, -d / ms],
    ]
    np.testing.assert_allclose(A, expected, rtol=1e-14)
    np.testing.assert_allclose(B, [[1], [0], [0], [0]])
    # a bump of sin(5 t) for one second, against the matrix exponential of the system with the sine's own two states
    f = run.bind([1 / ks, 1 / kt, d, ms, mu], inputs={"Sf_1": sp.sin(5 * time)})
    found = solve_ivp(f, (0, 1), np.zeros(4), rtol=1e-10, atol=1e-12).y[:, -1]
    whole = np.block([[A, B, np.zeros((4, 1))], [np.zeros((2, 4)), np.array([[0.0, 5.0], [-5.0, 0.0]])]])
    np.testing.assert_allclose(found, (expm(whole) @ [0, 0, 0, 0, 0, 1])[:4], rtol=1e-7)


def test_pair_of_rigidly_coupled_inertias() -> None:
    a, b, tf = One("a"), One("b"), TF("m")
    graph = BondGraph((1, Se(), a), (2, a, I()), (3, a, tf), (4, tf, b), (5, b, I()), (6, b, R()))
    for prefer, state in ((2, "p_2"), (5, "p_5")):
        equations = state_equations(graph, prefer=[prefer])
        assert [str(x) for x in equations.states] == [state]
    I_2, I_5, R_6, m, Se_1 = sp.symbols("I_2 I_5 R_6 m Se_1", real=True)
    first = state_equations(graph, prefer=[2])
    p2, p5, dp5 = sp.symbols("p_2 p_5 dp_5", real=True)
    assert sp.expand(first.printed[p2] - (Se_1 - m * (dp5 + R_6 * p5 / I_5))) == 0
    assert first.dependent_values[p5] == I_5 * m * p2 / I_2
    (rate,) = first.explicit().values()
    assert sp.simplify(rate - (Se_1 - m**2 * R_6 * p2 / I_2) / (1 + m**2 * I_5 / I_2)) == 0


def divider(second: R) -> BondGraph:
    i, node, coil = One("i"), Zero("node"), I("L")
    return BondGraph((1, Se(), i), (2, i, R("R_1")), (3, i, node), (4, node, second), (5, node, coil))


def test_loop_of_two_resistances() -> None:
    graph = divider(R("R_2"))
    causality = assign_causality(graph)
    assert causality.loops == ((2, 4),)
    assert len(causality.tears) == 1
    assert "algebraic loops: 2 and 4" in causality.report()
    equations = state_equations(graph)
    V, R_1, R_2, L = sp.symbols("Se_1 R_1 R_2 L", real=True)
    (p,) = equations.states
    (rate,) = equations.explicit().values()
    assert sp.simplify(rate - (V / R_1 - p / L) * R_1 * R_2 / (R_1 + R_2)) == 0
    run = RunTime(equations)
    assert run.rhs(0, [3.0], [10.0], {"R_1": 2.0, "R_2": 8.0, "L": 1.0})[0] == pytest.approx((5 - 3) * 1.6)


@pytest.mark.parametrize("law", [lambda f: 0.3 * f**3 + 2 * f, lambda f: sp.sinh(f) + f])
def test_loop_with_a_nonlinear_resistance(law) -> None:  # type: ignore[no-untyped-def]
    equations = state_equations(divider(R(law=law)))
    assert not equations.is_linear_in_unknowns
    run = RunTime(equations)
    for current, voltage in ((0.5, 4.0), (-2.0, 10.0), (3.0, -40.0)):
        rate = run.rhs(0, [current * 2.0], [voltage], {"R_1": 1.5, "L": 2.0})[0]
        branch = brentq(lambda f, V=voltage, i=current: float(law(f)) + 1.5 * (f + i) - V, -60, 60, xtol=1e-14)
        assert rate == pytest.approx(float(law(branch)), rel=1e-11)
    # the linear model by finite differences
    parameters = {"R_1": 1.5, "L": 2.0}
    A, B = run.matrices(parameters, x=[1.0], u=[4.0])
    h = 1e-5
    by_x = (run.rhs(0, [1 + h], [4.0], parameters) - run.rhs(0, [1 - h], [4.0], parameters)) / (2 * h)
    by_u = (run.rhs(0, [1.0], [4 + h], parameters) - run.rhs(0, [1.0], [4 - h], parameters)) / (2 * h)
    assert (A[0, 0], B[0, 0]) == (pytest.approx(by_x[0], rel=1e-7), pytest.approx(by_u[0], rel=1e-7))


def test_loop_without_solution_is_reported() -> None:
    graph = divider(R(law=lambda f: 5 + f**2))  # an effort that is never below 5
    with pytest.raises((SolverError,), match="no solution of the algebraic loops"):
        RunTime(state_equations(graph)).rhs(0, [10.0], [0.0], {"R_1": 1.0, "L": 1.0})


@pytest.mark.parametrize("missing", [1e-1, 1e-4, 1e-7])
def test_a_loop_that_nearly_has_a_solution_has_none(missing: float) -> None:
    """f**2 + f + 1/4 = -missing: the parabola ends above zero."""
    graph = divider(R(law=lambda f: f**2 + 0.25 + missing))
    with pytest.raises(SolverError, match="no solution of the algebraic loops"):
        RunTime(state_equations(graph)).rhs(0, [0.0], [0.0], {"R_1": 1.0, "L": 1.0})


@pytest.mark.parametrize("written", ["law", "conductance", "both"])
def test_a_nonlinear_resistance_is_evaluated_as_it_is_written(written: str) -> None:
    """In a loop of resistances, where either direction is possible: e(f) gives the effort, f(e) takes it."""
    laws = {"law": lambda f: sp.sinh(f), "conductance": lambda e: sp.asinh(e)}
    resistance = R(**(laws if written == "both" else {written: laws[written]}))
    graph = divider(resistance)
    if written != "both":
        assert (assign_causality(graph).effort_to[4] is resistance) == (written == "conductance")
    rate = RunTime(state_equations(graph)).rhs(0, [1.0], [4.0], {"R_1": 1.5, "L": 2.0})[0]
    branch = brentq(lambda f: np.sinh(f) + 1.5 * (f + 0.5) - 4.0, -10, 10, xtol=1e-14)
    assert rate == pytest.approx(np.sinh(branch), rel=1e-10)


def test_state_dependent_mass_matrix_of_a_slider_crank() -> None:
    # crank of inertia J drives a slider through v = r cos(phi) w; phi is stored by a compliance that has no stiffness
    crank, slider, phi = One("crank"), One("slider"), energy_symbol("q", 3)
    tf = TF(sp.Symbol("r", real=True) * sp.cos(phi))
    graph = BondGraph(
        (1, Se(), crank),
        (2, crank, I("J")),
        (3, crank, C(law=lambda q: 0)),
        (4, crank, tf),
        (5, tf, slider),
        (6, slider, I("M")),
    )
    equations = state_equations(graph)
    assert equations.causality.derivative == (6,)
    run = RunTime(equations)
    J, M, r, torque, angle, w = 0.4, 2.0, 0.3, 1.7, 0.8, 5.0
    rates = run.rhs(0.0, [J * w, angle], [torque], {"J": J, "M": M, "r": r})
    # Lagrange: (J + M r**2 cos**2) w' - M r**2 sin cos w**2 = torque
    acceleration = (torque + M * r**2 * np.sin(angle) * np.cos(angle) * w**2) / (J + M * r**2 * np.cos(angle) ** 2)
    np.testing.assert_allclose(rates, [J * acceleration, w], rtol=1e-14)
    # turning freely, the kinetic energy stays
    f = run.bind({"J": J, "M": M, "r": r})
    end = solve_ivp(f, (0, 3), [J * w, angle], rtol=1e-11, atol=1e-12).y[:, -1]

    def energy(x: list[float]) -> float:
        return 0.5 * (J + M * r**2 * np.cos(x[1]) ** 2) * (x[0] / J) ** 2

    assert energy(list(end)) == pytest.approx(energy([J * w, angle]), rel=1e-9)


def test_flow_source_on_an_inertia_needs_its_rate() -> None:
    v = One("v")
    graph = BondGraph((1, Sf(), v), (2, v, I()), (3, v, C()))
    equations = state_equations(graph)
    assert (equations.causality.integral, equations.causality.derivative) == ((3,), (2,))
    run = RunTime(equations)
    effort, flow = run.bond_variables(0.0, [0.0], [2.0], {"I_2": 3.0, "C_3": 1.0}, u_rate=[5.0])[1]
    assert (effort, flow) == (15.0, 2.0)


def test_rate_of_a_python_input_must_be_given_where_it_is_needed() -> None:
    # the flow source moves the inertia of bond 5 together with that of bond 2
    a, sum_of, b = One("a"), Zero("sum"), One("b")
    graph = BondGraph((1, Se(), a), (2, a, I()), (3, a, sum_of), (4, Sf(), sum_of), (5, sum_of, b), (6, b, I()))
    run = RunTime(state_equations(graph))
    parameters = {"I_2": 2.0, "I_6": 3.0}
    with pytest.raises(ArgumentError, match="input 'Sf_4' drives storage with derivative causality"):
        run.bind(parameters, inputs={"Sf_4": np.sin})
    by_function = run.bind(parameters, inputs={"Se_1": 7.0, "Sf_4": np.sin}, rates={"Sf_4": np.cos})
    by_expression = run.bind(parameters, inputs={"Se_1": 7.0, "Sf_4": sp.sin(time)})
    # 2 w' = 7 - e, e = 3 (w + sin t)'
    for f in (by_function, by_expression):
        assert f(0.4, np.array([1.0]))[0] == pytest.approx(2 * (7 - 3 * np.cos(0.4)) / 5, rel=1e-14)


def test_modulated_source_and_nonlinear_spring() -> None:
    # Duffing's oscillator with a force of time and position
    v = One("v")
    force = MSe(sp.cos(2 * time) - 0.5 * energy_symbol("q", 3))
    graph = BondGraph((1, force, v), (2, v, I(2.0)), (3, v, C(law=lambda q: q + q**3)), (4, v, R(conductance=lambda e: e / 4)))
    f = RunTime(state_equations(graph)).bind()
    np.testing.assert_allclose(f(0.3, [3.0, 0.7]), [np.cos(0.6) - 0.35 - 0.7 - 0.343 - 4 * 1.5, 1.5], rtol=1e-14)


def test_law_that_cannot_be_inverted_is_reported() -> None:
    v, node = One("v"), Zero("node")
    graph = BondGraph((1, Sf(), v), (2, v, R(conductance=lambda e: e + sp.erf(e))), (3, v, node), (4, node, C()))
    with pytest.raises(DeclarationError, match=r"R on bond 2 is needed in the other direction .* `law`"):
        state_equations(graph)


def test_nonlinear_inertia_with_derivative_causality() -> None:
    # p = 2 f + f**3 driven by a flow source; its effort is dp/dt
    v = One("v")
    inertia = I(law=lambda p: p, inverse=lambda f: 2 * f + f**3)
    run = RunTime(state_equations(BondGraph((1, Sf(), v), (2, v, inertia), (3, v, R()))))
    effort, _ = run.bond_variables(0.0, [], [0.5], {"R_3": 1.0}, u_rate=[4.0])[2]
    assert effort == pytest.approx((2 + 3 * 0.25) * 4)


def test_elements_joined_without_a_junction() -> None:
    assert RunTime(state_equations(BondGraph((1, Se(), I(2.0))))).rhs(0.0, [1.0], [3.0]).tolist() == [3.0]
    assert RunTime(state_equations(BondGraph((1, Sf(), R(2.0))))).bond_variables(0.0, [], [3.0])[1] == (6.0, 3.0)
    # a rotor on a mass, gyrator between: two inertias that are each other's spring
    a, b, gy = One("a"), One("b"), GY(3.0)
    graph = BondGraph((1, a, I(2.0)), (2, a, gy), (3, gy, b), (4, b, I(5.0)))
    A, _ = RunTime(state_equations(graph)).matrices()
    np.testing.assert_allclose(A, [[0, -3 / 5], [3 / 2, 0]])


def test_long_rigid_chain() -> None:
    # 40 inertias geared together one after the other: one state, and the reflected inertia is a geometric sum
    count, m = 40, 0.9
    shafts = [One(f"{k}") for k in range(count)]
    bonds: list[Any] = [(1, Se(), shafts[0])]
    for k, shaft in enumerate(shafts):
        bonds.append((10 * k + 2, shaft, I(1.0)))
        if k + 1 < count:
            tf = TF(m)
            bonds += [(10 * k + 3, shaft, tf), (10 * k + 4, tf, shafts[k + 1])]
    run = RunTime(state_equations(BondGraph(*bonds)))
    assert run.states == ("p_2",)
    assert run.rhs(0.0, [0.0], [1.0])[0] == pytest.approx((1 - m**2) / (1 - m ** (2 * count)))


def test_power_is_conserved_at_every_element_of_a_nonlinear_graph() -> None:
    graph = divider(R(law=lambda f: f**3))
    variables = RunTime(state_equations(graph)).bond_variables(0.0, [2.0], [5.0], {"R_1": 1.5, "L": 2.0})
    for element in graph.elements:
        if isinstance(element, One | Zero):
            assert sum(b.sign(element) * np.prod(variables[b.number]) for b in graph.at(element)) == pytest.approx(0, abs=1e-12)


def test_modulus_that_changes_with_time() -> None:
    # a gear whose ratio is 1 + t/2: (I_2 + I_5 m**2) w' + I_5 m m' w = torque
    a, b, tf = One("a"), One("b"), TF(1 + time / 2)
    run = RunTime(state_equations(BondGraph((1, Se(), a), (2, a, I()), (3, a, tf), (4, tf, b), (5, b, I()))))
    I_2, I_5, w, t, torque = 2.0, 3.0, 0.7, 1.2, 5.0
    m = 1 + t / 2
    expected = I_2 * (torque - I_5 * m * 0.5 * w) / (I_2 + I_5 * m**2)
    assert run.rhs(t, [I_2 * w], [torque], [I_2, I_5])[0] == pytest.approx(expected, rel=1e-14)
