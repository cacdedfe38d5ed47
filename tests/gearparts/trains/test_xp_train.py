"""The XP train against the paper's explicit equations, for Table 4 and for parameters drawn at random."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

import gearlib as gl
import gearparts as gp
from gearparts.trains import zhou_cui_2022 as zc

BY_NAME = [
    *(n for n in zc.TABLE_4 if n[0] in "RIKC" and n != "K_s"),
    "R_1",
    "R_2",
    "I_1",
    "I_2",
    "I_62",
    "I_66",
    "m_18",
    "m_19",
]


def distance(a: Any, b: Any) -> float:
    """Largest relative difference of two multisets of eigenvalues."""
    cost = abs(np.subtract.outer(a, b)) / np.maximum(abs(b), 1e-30)
    rows, columns = linear_sum_assignment(cost)
    assert len(a) == len(b)
    return float(cost[rows, columns].max())


def expected(**given: float) -> Any:
    return np.linalg.eigvals(zc.explicit_matrices(zc.bond_parameters(**given))[0])


def test_table_4(probe: Callable[..., Any]) -> None:
    p = probe(gp.ZhouCui2022())
    assert len(p.states) == 8
    eigenvalues = np.linalg.eigvals(p.A)
    assert distance(eigenvalues, expected()) < 1e-12
    assert abs(eigenvalues).max() / (2 * np.pi) == pytest.approx(1228.5427144, abs=1e-7)
    for name, quantity in zc.TABLE_4.items():
        if not name.startswith("Z"):
            declared = getattr(gp.ZhouCui2022, name)
            assert float(declared.default) == pytest.approx(quantity.value, rel=1e-15)
            assert declared.unit == quantity.unit or name == "K_s"


@pytest.mark.parametrize("seed", range(10))
def test_random_parameters(probe: Callable[..., Any], seed: int) -> None:
    rng = np.random.default_rng(seed)
    given = {name: float(rng.uniform(0.3, 3.0)) for name in [*BY_NAME, "m_22"]}
    p = probe(gp.ZhouCui2022(tau_in=1.0, **gl.offered(given)))
    assert len(p.states) == 8
    assert distance(np.linalg.eigvals(p.A), expected(**given)) < 1e-9


def test_rates_of_the_state_at_random(probe: Callable[..., Any]) -> None:
    """Speeds, mesh deflections and sources, one by one: the signs and places of all of them."""
    p, rng, t, tau = probe(gp.ZhouCui2022(tau_in=137.0)), np.random.default_rng(3), 0.123, 137.0
    value = p.values({s: rng.normal() * (1e-6 if s.startswith("q") else 1.0) for s in p.states}, t=t)
    params = zc.bond_parameters()
    paths = {2: "w_in", 11: "train.x_unit.planets_at_ring.w", 26: "w_sun", 78: "train.p_unit.gear_2.w"}
    deflections = {6: "q_ring", 30: "q_sun", 74: "q_pair"}

    def momenta(prefix: str) -> dict[str, float]:
        def read(name: str) -> float:
            return value(f"{prefix}({name})" if prefix else name)

        # The sun's side counts its lumped planets in the sense in which they turn, against the paper's pitch line.
        given = {f"p{b}": params.I[b] * read(path) for b, path in paths.items()}
        given["p35"] = -params.I[35] * read("train.x_unit.planets_at_sun.w")
        return given | {f"q{b}": read(path) for b, path in deflections.items()}

    x, dx = ([m[s] for s in zc.STATES] for m in (momenta(""), momenta("der")))
    e = float(zc.transmission_error_rate(t))
    reference = zc.explicit_rhs(t, x, params, (tau, e, e, e))
    assert np.max(abs(np.array(dx) - reference) / abs(reference)) < 1e-10
    flows = zc.flows(x, params, (tau, e, e, e))
    assert value("w_out") == pytest.approx(flows[81], rel=1e-13)
    assert value("train.x_unit.support[2].w_rel") == pytest.approx(-flows[83], rel=1e-10)
    assert value("train.x_unit.planet[0].spin.w") == pytest.approx(-flows[17], rel=1e-10)


def test_train_alone_between_flanges(probe: Callable[..., Any]) -> None:
    class Bench(gl.Component):
        def assemble(self) -> Any:
            self.drive, self.brake, self.train = gp.Torque(tau=137.0), gp.Torque(tau=-12.0), gp.XPTrain(e_rate=2e-3)
            return [
                gl.connect(self.drive.flange, self.train.flange_in),
                gl.connect(self.train.flange_out, self.brake.flange),
            ]

    p = probe(Bench())
    assert len(p.states) == 8
    value = p.values(dict.fromkeys(p.states, 0.0))
    params = zc.bond_parameters()
    flows = zc.flow_rows(params)
    # from rest, M dv/dt = torques - mesh forces, which the damping and the transmission error make
    M = sum(params.I[b] * np.outer(flows[b][:5], flows[b][:5]) for b in zc.INERTIAS)
    force = flows[1][:5] * 137.0 + flows[81][:5] * -12.0
    force = force - sum(flows[r][:5] * params.R[r] * 2e-3 for r in (7, 31, 75))
    rates = np.linalg.solve(M, force)
    assert value("der(train.x_unit.ring_gear.w)") == pytest.approx(rates[0], rel=1e-12)
    assert value("der(train.x_unit.carrier_body.w)") == pytest.approx(-rates[4], rel=1e-12)


def test_elastic_shaft_adds_one_degree_of_freedom(probe: Callable[..., Any]) -> None:
    given = {"m_18": 1.3, "m_19": 0.8, "m_22": 1.1, "K_s": 3e5, "I_62": 0.002}
    p = probe(gp.ZhouCui2022(tau_in=1.0, elastic_shafts=True, **given))
    params = zc.bond_parameters(**{k: v for k, v in given.items() if k != "K_s"})
    rows = {b: np.append(r[:5], 0.0) for b, r in zc.flow_rows(params).items()}
    gear_1 = np.eye(6)[5]  # no longer m19 times the shaft's end at the sun
    rows |= {66: gear_1, 69: gear_1}
    rows[74] = rows[75] = -params.m[20] * gear_1 - params.m[21] * rows[78]
    twist = gear_1 / params.m[19] - rows[62]
    M = sum(params.I[b] * np.outer(rows[b], rows[b]) for b in zc.INERTIAS)
    D = sum(params.R[b] * np.outer(rows[b], rows[b]) for b in zc.RESISTANCES)
    springs = np.array([rows[6], rows[30], rows[74], twist])
    stiffness = np.diag([1.8e8, 1.8e8, 1.8e8, 3e5])
    speeds = np.linalg.solve(M, np.hstack([-D, -springs.T @ stiffness]))
    reference = np.linalg.eigvals(np.vstack([speeds, np.hstack([springs, np.zeros((4, 4))])]))
    elastic = [e for e in np.linalg.eigvals(p.A) if abs(e) > 1e-6]
    assert distance(elastic, reference) < 1e-9
