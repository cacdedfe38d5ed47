"""Three roads to the XP train's equations: components, bond graph, printed equations; they share no code after the parameters.

A fourth is the bond graph as a component, whose equations without causality go through index reduction like any other model.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gearlib as gl
import gearparts as gp
from gearlib.bondgraph import TF, RunTime, state_equations
from gearlib.bondgraph.elements import Junction
from gearparts.trains import zhou_cui_2022 as zc
from gearparts.trains.paper_graphs import PREFERENCE, single_loop_train
from tests.bondgraph.paper_parameters import by_name, random_parameters

Array = Any

GEOMETRY = ("R_s", "R_p", "R_r", "R_h", "I_s", "I_p", "I_r", "I_h", "I_f", "K_g", "C_g", "C_v", "R_1", "R_2", "I_1", "I_2",
            "I_62", "I_66", "m_18", "m_19", "m_22")  # fmt: skip
BODIES = {
    "w_in": 2, "train.x_unit.ring_gear.w": 2, "train.x_unit.planets_at_ring.w": 11, "w_sun": 26, "train.x_unit.sun_gear.w": 26,
    "train.x_unit.planets_at_sun.w": -35, "train.shaft_at_sun.w": 62, "train.shaft_at_pair.w": 66, "train.p_unit.gear_1.w": 69,
    "train.p_unit.gear_2.w": 78, "w_out": 81, "train.x_unit.carrier_body.w": 81,
}  # fmt: skip
"""Bonds whose flows the components' speeds are; the sun's side counts its planets in the sense in which they turn."""
DEFLECTIONS = {"q_ring": 1, "q_sun": 4, "q_pair": 6}
"""Places of the components' deflections in the printed state."""


@cache
def bond_graph() -> RunTime:
    return RunTime(state_equations(single_loop_train().graph, PREFERENCE))


@cache
def places() -> list[int]:
    """Of each printed state, its place among the bond graph's; both count momenta and displacements by bond."""
    return [bond_graph().states.index(f"{name[0]}_{name[1:]}") for name in zc.STATES]


def rates_of_bond_graph(x: Array, u: Array, params: zc.BondParameters) -> Array:
    state = np.empty(8)
    state[places()] = x
    sources = dict(zip(("Se_1", "Sf_8", "Sf_32", "Sf_72"), u, strict=True))
    return bond_graph().rhs(0.0, state, sources, by_name(bond_graph(), params))[places()]


def rates(system: gl.System, parameters: dict[str, float], values: dict[str, float], t: float = 0.0) -> dict[str, float]:
    """Rates of a system's states at the start of a run from these values."""
    start = {name: values[name] for name in system.states}
    result = system.simulate(t + 1e-9, t_start=t, times=[t], method="rk", parameters=parameters, start=start)
    return {name: float(result[f"der({name})"][0]) for name in system.states}


def speeds_and_deflections(x: Array, params: zc.BondParameters) -> dict[str, float]:
    """What the components call a printed state, or its rate where the sources are constant."""
    f = zc.flows(x, params)
    found = {name: float(np.sign(bond)) * f[abs(bond)] for name, bond in BODIES.items()}
    return found | {name: float(x[k]) for name, k in DEFLECTIONS.items()}


def disagreement(found: Any, expected: Any) -> float:
    """Largest difference in terms of the largest rate."""
    a, b = np.asarray(found, float), np.asarray(expected, float)
    return float(np.abs(a - b).max() / np.abs(b).max())


@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_bond_graph_and_printed_equations_for_random_sets(count: int) -> None:
    """All 22 moduli, 15 inertias, 7 resistances, 3 compliances, 4 sources and 8 states at random."""
    rng, worst = np.random.default_rng(2022), 0.0
    for _ in range(count):
        params, x, u = random_parameters(rng), rng.normal(size=8), rng.normal(size=4)
        worst = max(worst, disagreement(rates_of_bond_graph(x, u, params), zc.explicit_rhs(0.0, x, params, u)))
    assert worst < 1e-11


@pytest.mark.parametrize("count", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_three_roads_for_random_sets(count: int) -> None:
    """The components' parameters are radii, inertias, stiffness, damping and ratios; the moduli follow from them."""
    system = gl.compile(gp.ZhouCui2022(tau_in=1.0))
    rng, worst = np.random.default_rng(4), np.zeros(2)
    for _ in range(count):
        given = {name: float(rng.uniform(0.3, 3.0)) for name in GEOMETRY}
        x, t, tau, amplitude = rng.normal(size=8), float(rng.uniform(0, 9)), float(rng.normal()), float(rng.normal())
        params = zc.bond_parameters(**given)
        e = float(zc.transmission_error_rate(t, amplitude))
        u = (tau, e, e, e)
        printed = zc.explicit_rhs(t, x, params, u)
        worst[0] = max(worst[0], disagreement(rates_of_bond_graph(x, u, params), printed))
        found = rates(system, given | {"tau_in": tau, "e_amplitude": amplitude}, speeds_and_deflections(x, params), t)
        expected = speeds_and_deflections(printed, params)
        worst[1] = max(worst[1], disagreement([*found.values()], [expected[name] for name in found]))
    assert (worst < 1e-11).all()


@pytest.mark.parametrize("count", [50, pytest.param(1000, marks=pytest.mark.slow)])
def test_bond_graph_as_a_component_for_random_sets(count: int) -> None:
    """The elements' equations without causality, reduced and sorted like any model; everything at random."""
    Train = gp.from_bond_graph(single_loop_train().graph)
    sources = ("Se_1", "Sf_8", "Sf_32", "Sf_72")
    system = gl.compile(
        Train(**by_name(bond_graph(), random_parameters(np.random.default_rng(0))), **dict.fromkeys(sources, 0.5))
    )
    rng, worst = np.random.default_rng(5), 0.0
    for _ in range(count):
        params, x, u = random_parameters(rng), rng.normal(size=8), rng.normal(size=4)
        printed = zc.explicit_rhs(0.0, x, params, u)
        values, expected = stored(x, u, params), stored(printed, np.zeros(4), params)
        found = rates(system, by_name(bond_graph(), params) | dict(zip(sources, u.tolist(), strict=True)), values)
        worst = max(worst, disagreement([*found.values()], [expected[name] for name in found]))
    assert worst < 1e-11


def stored(x: Array, u: Array, params: zc.BondParameters) -> dict[str, float]:
    """All p and q from a printed state."""
    f = zc.flows(x, params, u)
    return {f"p_{n}": params.I[n] * f[n] for n in zc.INERTIAS} | {"q_6": x[1], "q_30": x[4], "q_74": x[6]}


# ---------------------------------------------------------------- frequency responses

OUTPUTS = ("w_in", "w_sun", "w_out", "q_ring", "q_sun", "q_pair")


def outputs_of_printed(params: zc.BondParameters) -> Array:
    rows = np.zeros((6, 8))
    flows = zc.flow_rows(params)
    for k, bond in enumerate((2, 26, 81)):
        rows[k, [0, 2, 3, 5, 7]] = flows[bond][:5] / [params.I[b] for b in zc.INDEPENDENT]
    rows[[3, 4, 5], [1, 4, 6]] = 1.0
    return rows


@pytest.mark.parametrize("seed", [None, *range(10)])
def test_frequency_responses(seed: int | None) -> None:
    """From torque and transmission error to speeds and deflections, 0.01 to 1e5 rad/s; None: Table 4."""
    rng = np.random.default_rng(seed)
    given = {} if seed is None else {name: float(rng.uniform(0.3, 3.0)) for name in GEOMETRY}
    params = zc.bond_parameters(**given)
    system = gl.compile(gp.ZhouCui2022(tau_in=1.0))
    model = system.linearize(["tau_in", "train.e_rate"], list(OUTPUTS), sparse=True, parameters=given)
    A, B = zc.explicit_matrices(params)
    Ab, Bb = (M[places()] for M in bond_graph().matrices(by_name(bond_graph(), params)))
    Ab, join = Ab[:, places()], np.array([[1, 0], [0, 1], [0, 1], [0, 1]])  # one transmission error for all meshes
    rows = outputs_of_printed(params)
    order = [bond_graph().inputs.index(name) for name in ("Se_1", "Sf_8", "Sf_32", "Sf_72")]
    for w in np.logspace(-2, 5, 141):
        expected = rows @ np.linalg.solve(1j * w * np.eye(8) - A, B @ join)
        of_graph = rows @ np.linalg.solve(1j * w * np.eye(8) - Ab, Bb[:, order] @ join)
        of_parts = model.C @ np.linalg.solve(1j * w * np.eye(8) - model.A, model.B) + model.D
        for found in (of_graph, of_parts):
            assert np.all(np.abs(found - expected) <= 1e-9 * np.abs(expected).max(axis=1, keepdims=True))


# ---------------------------------------------------------------- motion


def exact_motion(A: Array, B: Array, times: Array, torque: float) -> Array:
    """States from rest under a constant torque and the transmission error of Table 4, by the matrix exponential."""
    forced = np.zeros((11, 11))
    forced[:8, :8], forced[:8, 8] = A, B[:, 0] * torque
    e_0 = zc.TABLE_4["e_amplitude"].value * np.exp(1j * zc.TABLE_4["e_phase"].value)
    omega = zc.TABLE_4["e_omega"].value
    forced[:8, 9] = B[:, 1:].sum(axis=1)
    forced[9, 10], forced[10, 9] = -omega, omega
    start = np.array([0.0] * 8 + [1.0, e_0.real, e_0.imag])
    return np.array([(expm(forced * t) @ start)[:8] for t in times])


@pytest.mark.parametrize(("method", "rtol"), [("exact", 1e-10), ("ida", 1e-6), ("ida", 1e-9), ("rk", 1e-6), ("rk", 1e-9)])
def test_trajectories(method: str, rtol: float) -> None:
    """Speeds and deflections of components within the tolerance asked for, in terms of their largest values."""
    params, times = zc.bond_parameters(), np.linspace(0.0, 0.3, 31)
    A, B = params.matrices
    expected = exact_motion(A, B, times, 100.0) @ outputs_of_printed(params).T
    system = gl.compile(gp.ZhouCui2022(tau_in=100.0), list(OUTPUTS))
    result = system.simulate(0.3, times=times, method=method, rtol=rtol)
    found = np.column_stack([result[name] for name in OUTPUTS])
    error = np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert np.all(error[:3] <= 10 * rtol)
    assert np.all(error[3:] <= 100 * rtol)  # 1e-6 m is their nominal size, and they follow speeds whose tolerance is coarser


def test_trajectory_of_the_bond_graph_and_power_at_every_junction_and_transformer() -> None:
    """SciPy integrates the bond graph's equations; along the run each junction and each TF passes on all power it gets."""
    run, params, times = bond_graph(), zc.bond_parameters(), np.linspace(0.0, 0.3, 31)
    inputs = dict.fromkeys(("Sf_8", "Sf_32", "Sf_72"), lambda t: float(zc.transmission_error_rate(t)))
    numbers = by_name(bond_graph(), params)
    f = run.bind(numbers, {"Se_1": 100.0, **inputs}, rates=dict.fromkeys(inputs, lambda t: 0.0))
    solution = solve_ivp(f, (0, 0.3), np.zeros(8), "DOP853", times, rtol=1e-9, atol=1e-15)
    expected = exact_motion(*params.matrices, times, 100.0)
    found = solution.y[places()].T
    assert np.all(np.abs(found - expected).max(axis=0) <= 1e-7 * np.abs(expected).max(axis=0))
    graph = run.equations.graph
    for t, x in zip(times, solution.y.T, strict=True):
        e = float(zc.transmission_error_rate(t))
        variables = run.bond_variables(t, x, {"Se_1": 100.0, "Sf_8": e, "Sf_32": e, "Sf_72": e}, numbers)
        power = {n: effort * flow for n, (effort, flow) in variables.items()}
        largest = max(map(abs, power.values()))
        for element in graph.elements:
            if isinstance(element, Junction | TF):
                assert abs(sum(b.sign(element) * power[b.number] for b in graph.at(element))) <= 1e-11 * largest
        stored_or_lost = sum(power[n] for n in (*zc.INERTIAS, *zc.COMPLIANCES, *zc.RESISTANCES))
        assert abs(sum(power[n] for n in (1, 8, 32, 72)) - stored_or_lost) <= 1e-11 * largest
