"""The XP train along three roads that share no code: components, bond graph, and the equations that the paper prints."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import romb, solve_ivp
from scipy.optimize import linear_sum_assignment

import gearlib as gl
import gearparts as gp
from gearlib.bondgraph import RunTime, state_equations
from gearparts.trains import zhou_cui_2022 as zc
from gearparts.trains.paper_graphs import PREFERENCE, single_loop_train
from tests.bondgraph.paper_parameters import by_name

TABLE_4 = {name: q.value for name, q in zc.TABLE_4.items() if name[0] in "RIKC" and name != "K_s"}
OPEN = {"R_1": 0.0285, "R_2": 0.0465, "I_1": 0.0015, "I_2": 0.0094, "I_62": 0.0036, "I_66": 0.0036}
OPEN |= {"m_18": 1.0, "m_19": 1.0, "m_22": 1.0}
TORQUE, T_STEP, T_END = 100.0, 0.1, 0.5
# The paper's velocities f2, f11, f26, f35, f78 and deflections by the components' names. The sun's side counts its lumped
# planets in the sense in which they turn, against the paper's pitch line.
PATHS = {
    "p2": "w_in", "q6": "q_ring", "p11": "train.x_unit.planets_at_ring.w", "p26": "w_sun", "q30": "q_sun",
    "p35": "train.x_unit.planets_at_sun.w", "q74": "q_pair", "p78": "train.p_unit.gear_2.w",
}  # fmt: skip


ROOT = Path(__file__).parents[2]


def stated(row: str, page: str = "docs/xp_train.md") -> float:
    """The figure in a page's table, in the row that begins so: before the limit. Rounding may double it on another processor."""
    line = next(line for line in (ROOT / page).read_text(encoding="utf-8").splitlines() if line.startswith(f"| {row}"))
    return 2.0 * float(line.split("|")[-3])


@cache
def train(torque: bool = False) -> gl.System:
    """The paper's system, its torque free or stepping; every parameter is given to a run, nothing is translated again."""
    step = gl.Piecewise((0.0, gl.time < T_STEP), (TORQUE, True))
    return gl.compile(gp.ZhouCui2022(tau_in=step) if torque else gp.ZhouCui2022())


@cache
def bond_graph() -> RunTime:
    return RunTime(state_equations(single_loop_train().graph, PREFERENCE))


def near_table_4(rng: np.random.Generator) -> dict[str, float]:
    return {name: value * float(2 ** rng.uniform(-1, 1)) for name, value in (TABLE_4 | OPEN).items()}


def order_one(rng: np.random.Generator) -> dict[str, float]:
    return {name: float(rng.uniform(0.3, 3.0)) for name in TABLE_4 | OPEN}


def scales(params: zc.BondParameters) -> Any:
    """Momenta and deflections of the explicit form over the variables in `PATHS`."""
    inertia = {name: params.I[int(name[1:])] if name[0] == "p" else 1.0 for name in PATHS}
    return np.array([-inertia[name] if name == "p35" else inertia[name] for name in zc.STATES])


def bond_order(names: tuple[str, ...], own: tuple[str, ...]) -> list[int]:
    """Where the explicit form's ``p11`` or ``Sf8`` stands among the bond graph's ``p_11`` or ``Sf_8``."""
    return [own.index(name.rstrip("0123456789") + "_" + name.lstrip("SefpqI")) for name in names]


def multiset_distance(found: Any, expected: Any) -> float:
    """Largest relative difference of two multisets of eigenvalues."""
    assert len(found) == len(expected)
    cost = abs(np.subtract.outer(found, expected)) / abs(expected)
    return float(cost[linear_sum_assignment(cost)].max())


# ---------------------------------------------------------------- linear models


def test_eight_states_and_index_three() -> None:
    assert len(train().states) == 8
    assert {"q_ring", "q_sun", "q_pair", "w_in"} <= set(train().states)
    assert "structural index 3" in train().summary()


@pytest.mark.parametrize("draw", [near_table_4, order_one])
def test_eigenvalues_are_those_of_the_explicit_form(draw: Any) -> None:
    rng = np.random.default_rng(1)
    for i, given in enumerate([TABLE_4, *(draw(rng) for _ in range(50))]):
        model = train().linearize(["tau_in"], ["w_out"], parameters=given, sparse=True)
        A, _ = zc.explicit_matrices(zc.bond_parameters(**given))
        assert model.A.shape == (8, 8)
        eigenvalues = np.linalg.eigvals(model.A)
        distance = multiset_distance(eigenvalues, np.linalg.eigvals(A))
        rows = ("eigenvalues, 100 random", "| 100 random") if i else ("eigenvalues, relative", "eigenvalues of")
        assert distance < min(stated(rows[0], "README.md"), stated(rows[1])) < 1e-9
        assert eigenvalues.real.max() < 0  # the paper calls the linear train unstable


@pytest.mark.parametrize("draw", [near_table_4, order_one])
def test_frequency_responses_of_three_roads(draw: Any) -> None:
    """From the torque and the transmission error to all states."""
    rng, run = np.random.default_rng(2), bond_graph()
    rows, columns = bond_order(zc.STATES, run.states), bond_order(zc.SOURCES, run.inputs)
    sources = np.array([[1, 0], [0, 1], [0, 1], [0, 1]])  # Se1; Sf8 = Sf32 = Sf72
    limit = stated("frequency responses")
    assert limit < 1e-9
    for given in [TABLE_4, *(draw(rng) for _ in range(4))]:
        params = zc.bond_parameters(**given)
        model = train().linearize(["tau_in", "train.e_rate"], list(PATHS.values()), parameters=given, sparse=True)
        A, B = run.matrices(by_name(bond_graph(), params))
        A, B = A[np.ix_(rows, rows)], B[np.ix_(rows, columns)] @ sources
        A_printed, B_printed = zc.explicit_matrices(params)
        for w in np.geomspace(1e-3, 10, 30) * np.abs(np.linalg.eigvals(A_printed)).max():
            expected = np.linalg.solve(1j * w * np.eye(8) - A_printed, B_printed @ sources)
            bonds = np.linalg.solve(1j * w * np.eye(8) - A, B)
            parts = model.C @ np.linalg.solve(1j * w * np.eye(8) - model.A, model.B) + model.D
            for found in (bonds, scales(params)[:, None] * parts):
                assert np.all(abs(found - expected) <= limit * abs(expected))


def test_torque_and_speed_of_the_ring_are_a_passive_pair() -> None:
    rng = np.random.default_rng(5)
    for given in [TABLE_4, *(near_table_4(rng) for _ in range(10))]:
        response = train().linearize(["tau_in"], ["w_in"], parameters=given)(1j * np.geomspace(1e-1, 1e5, 500))
        assert response.real.min() > 0


@pytest.mark.parametrize("seed", range(30))
def test_right_sides_of_three_roads(seed: int) -> None:
    """Rates of all states in a random state of motion, at a random time."""
    rng, run = np.random.default_rng(seed), bond_graph()
    given = near_table_4(rng) if seed % 2 else order_one(rng)
    params, t, torque = zc.bond_parameters(**given), float(rng.uniform(0, 1)), float(rng.normal())
    motion = rng.normal(size=8) * np.where([name[0] == "q" for name in zc.STATES], 1e-6 if seed % 2 else 1.0, 1.0)
    e = float(zc.transmission_error_rate(t))
    x = scales(params) * motion
    expected = zc.explicit_rhs(t, x, params, (torque, e, e, e))
    rows, columns = bond_order(zc.STATES, run.states), bond_order(zc.SOURCES, run.inputs)
    state, sources = np.empty(8), np.empty(4)
    state[rows], sources[columns] = x, (torque, e, e, e)
    bonds = run.rhs(t, state, sources, by_name(bond_graph(), params))[rows]
    start = dict(zip(PATHS.values(), motion.tolist(), strict=True))
    result = train().simulate(t + 1e-9, t_start=t, samples=2, parameters=given, inputs={"tau_in": torque}, start=start)
    parts = scales(params) * [result[f"der({path})"][0] for path in PATHS.values()]
    speeds, deflections = ([k for k, name in enumerate(zc.STATES) if name[0] == kind] for kind in "pq")
    for found in (bonds, parts):
        for same_unit in (speeds, deflections):
            error = abs(found - expected)[same_unit].max() / abs(expected[same_unit]).max()
            assert error < stated("right-hand sides") < 1e-11


# ---------------------------------------------------------------- runs


@cache
def explicit_run(names: tuple[tuple[str, float], ...]) -> tuple[Any, dict[str, Any]]:
    """Times and signals of the explicit form under the step, integrated by DOP853 in two parts."""
    params, x, parts = zc.bond_parameters(**dict(names)), np.zeros(8), []
    before, after = np.linspace(0, T_STEP, 101), np.linspace(T_STEP, T_END, 401)
    for times, torque in ((before, 0.0), (after, TORQUE)):

        def rhs(t: float, x: Any, torque: float = torque) -> Any:
            e = zc.transmission_error_rate(t)
            return zc.explicit_rhs(t, x, params, (torque, e, e, e))

        parts.append(solve_ivp(rhs, times[[0, -1]], x, "DOP853", times, rtol=1e-12, atol=1e-15).y)
        x = parts[-1][:, -1]
    states = np.hstack([parts[0][:, :-1], parts[1]])
    signals = dict(zip(PATHS.values(), states / scales(params)[:, None], strict=True))
    signals["w_out"] = -signals["train.p_unit.gear_2.w"] / params.m[22]
    return np.concatenate([before[:-1], after]), signals


@pytest.mark.parametrize("given", [{}, near_table_4(np.random.default_rng(3))], ids=["Table 4", "random"])
@pytest.mark.parametrize(
    ("method", "form", "tolerance", "in_readme", "on_page"),
    [
        ("ida", "dae", 1e-7, "IDA on the index-reduced DAE", None),
        ("ida", "ode", 1e-7, "the same on the ODE form", "IDA, `rtol=1e-10`"),
        ("rk", "ode", 1e-7, None, "Runge-Kutta"),
        ("exact", "ode", 1e-9, "exact method, against the same", "exact method"),
    ],
)
def test_runs_follow_the_explicit_form(
    method: str, form: str, tolerance: float, in_readme: str | None, on_page: str | None, given: dict[str, float]
) -> None:
    times, expected = explicit_run(tuple(given.items()))
    chosen = {} if form == "ode" else {"form": form}
    result = train(torque=True).simulate(T_END, times=times, rtol=1e-10, parameters=given, method=method, **chosen)
    assert result.stats["method"].startswith(method)
    errors = {name: abs(result[name] - signal).max() / abs(signal).max() for name, signal in expected.items()}
    assert max(errors.values()) < tolerance
    if in_readme is not None and not given:
        assert max(errors.values()) < stated(in_readme, "README.md") < tolerance
    if on_page is not None:
        assert max(errors.values()) < stated(on_page) < tolerance


@pytest.mark.parametrize("method", ["exact", "ida", "rk"])
def test_work_in_is_energy_stored_and_lost(method: str) -> None:
    """Every inertia, mesh and damper is found by its parameter; the powers are integrated by Romberg's rule on each side."""
    times = np.concatenate([np.linspace(0, T_STEP, 2**12 + 1), np.linspace(T_STEP, T_END, 2**14 + 1)[1:]])
    system = train(torque=True)
    result = system.simulate(T_END, times=times, method=method, rtol=1e-12)
    stored, lost, driven = np.zeros_like(times), np.zeros_like(times), np.zeros_like(times)
    count = 0
    for name, value in system.parameters.items():
        path, _, symbol = name.rpartition(".")
        if symbol == "J":
            stored += value * result[f"{path}.w"] ** 2 / 2
        elif symbol == "c":
            stored += value * result[f"{path}.q"] ** 2 / 2
            driven += result[f"{path}.f"] * result[f"{path}.e_rate"]
        elif symbol == "d":
            lost += value * result[f"{path}.v" if "mesh" in path else f"{path}.w_rel"] ** 2
        count += symbol in ("J", "c", "d")
    assert count == 15 + 3 + 7  # the paper's inertias, compliances and resistances
    n = 2**12
    h, H = T_STEP / n, (T_END - T_STEP) / 2**14
    torque, error = TORQUE * romb(result["w_in"][n:], H), romb(driven[: n + 1], h) + romb(driven[n:], H)
    work = torque + error
    heat = romb(lost[: n + 1], h) + romb(lost[n:], H)
    assert heat > 0.5 * work > 0
    residual = abs(work - (stored[-1] - stored[0]) - heat) / work
    assert residual < min(stated("energy balance", "README.md"), stated("work in")) < 1e-8
    page = " ".join((ROOT / "docs/xp_train.md").read_text(encoding="utf-8").split())
    assert f"the torque does {torque:.1f} J of work and the transmission error absorbs {-error:.1f} J" in page
    assert f"At the end {stored[-1] - stored[0]:.1f} J are stored" in page


# ---------------------------------------------------------------- variants


def test_elastic_shaft_becomes_rigid_as_it_stiffens() -> None:
    """The transfer function differs from that of the rigid shaft by a term that falls with 1 / K_s."""
    elastic = gl.compile(gp.ZhouCui2022(elastic_shafts=True))
    assert len(elastic.states) == 10
    s = 2j * np.pi * np.geomspace(1, 2000, 50)
    rigid = train().linearize(["tau_in"], ["w_out"])(s)
    stiffness = 2e8 * 4.0 ** np.arange(-3, 4)
    errors = [np.max(abs(elastic.linearize(["tau_in"], ["w_out"], parameters={"K_s": k})(s) / rigid - 1)) for k in stiffness]
    assert errors[3] < 1e-2  # Table 4's shaft is nearly rigid
    rates = -np.diff(np.log(errors)) / np.log(4)
    assert rates == pytest.approx(1, abs=0.02)


class RigidTrain(gl.Component):
    """The train with no compliance: the loop is closed by gears alone."""

    J_ring = gl.Parameter("kg.m2", "inertia on the ring", default=0.151, min=0)
    J_sun = gl.Parameter("kg.m2", "inertia on the sun", default=0.0087, min=0)
    J_carrier = gl.Parameter("kg.m2", "inertia on the carrier", default=0.0491, min=0)

    def assemble(self) -> list[Any]:
        self.drive, self.set, self.pair = gp.Torque(tau=7.0), gp.IdealPlanetary(ratio=81 / 19), gp.IdealGear(ratio=-31 / 19)
        self.coupling = gp.IdealGear(ratio=-1.0)
        self.ring, self.sun = gp.Inertia(J=self.J_ring), gp.Inertia(J=self.J_sun)
        self.carrier = gp.Inertia(J=self.J_carrier)
        return [
            gl.connect(self.drive.flange, self.ring.flange_a),
            gl.connect(self.ring.flange_b, self.set.ring),
            gl.connect(self.set.sun, self.sun.flange_a),
            gl.connect(self.sun.flange_b, self.pair.flange_a),
            gl.connect(self.pair.flange_b, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.carrier.flange_a),
            gl.connect(self.carrier.flange_b, self.set.carrier),
        ]


def test_rigid_train_has_one_degree_of_freedom() -> None:
    system = gl.compile(RigidTrain())
    assert len(system.states) == 1
    rng = np.random.default_rng(4)
    for _ in range(10):
        J_ring, J_sun, J_carrier = rng.uniform(0.1, 2.0, 3)
        given = {"J_ring": J_ring, "J_sun": J_sun, "J_carrier": J_carrier}
        result = system.simulate(1.0, samples=2, parameters=given)
        # for one turn of the carrier the sun makes 31/19, and Willis: 19 w_sun + 81 w_ring = 100 w_carrier
        w_sun, w_ring = 31 / 19, (100 - 31) / 81
        inertia = (J_ring * w_ring**2 + J_sun * w_sun**2 + J_carrier) / w_ring**2
        limit = stated("rigid train")
        assert limit < 1e-12
        assert result["der(ring.w)"] == pytest.approx(7.0 / inertia, rel=limit, abs=0.0)
        assert result["carrier.w"][-1] == pytest.approx(7.0 / inertia / w_ring, rel=limit, abs=0.0)


PARTS = {
    "drive": lambda: gp.Torque(tau=TORQUE),
    "unit": lambda: gp.PlanetaryUnit(
        R_s=0.0285, R_p=0.0465, I_s=0.0015, I_r=0.151, I_h=0.0491, I_spin=0.0094, I_orbit=0.0094,
        K_ring=1.8e8, C_ring=2e3, K_sun=1.8e8, C_sun=2e3, C_v=1.8e3,
    ),
    "shaft": lambda: gp.Inertia(J=0.0072),
    "pair": lambda: gp.FixedAxisUnit(R_1=0.0285, R_2=0.0465, I_1=0.0015, I_2=0.0094, K_g=1.8e8, C_g=2e3),
    "coupling": lambda: gp.IdealGear(ratio=-1.0),
    "load": lambda: gp.Damper(d=10.125),
    "ground": lambda: gp.Fixed(),
}  # fmt: skip
JOINTS = (
    ("drive.flange", "unit.ring"), ("unit.sun", "shaft.flange_a"), ("shaft.flange_b", "pair.flange_a"),
    ("pair.flange_b", "coupling.flange_a"), ("coupling.flange_b", "unit.carrier", "load.flange_a"),
    ("load.flange_b", "ground.flange"),
)  # fmt: skip


def shuffled(seed: int) -> gl.Component:
    """The train, its parts made and its connections written in some order."""
    rng = np.random.default_rng(seed)

    def mixed(items: Any) -> list[Any]:
        return [items[k] for k in rng.permutation(len(items))]

    parts, joints = mixed(list(PARTS)), [mixed(joint) for joint in mixed(JOINTS)]

    class Shuffled(gl.Component):
        def assemble(self) -> list[Any]:
            for name in parts:
                setattr(self, name, PARTS[name]())
            ports = [[end.split(".") for end in joint] for joint in joints]
            return [gl.connect(*(getattr(getattr(self, part), port) for part, port in joint)) for joint in ports]

    return Shuffled()


def test_order_of_parts_and_connections_changes_the_last_digits_only() -> None:
    names = ["unit.ring_gear.w", "unit.sun_gear.w", "unit.ring_mesh.q", "unit.sun_mesh.q", "pair.mesh.q", "load.w_rel"]
    first, *others = (gl.simulate(shuffled(seed), 0.02, samples=101, outputs=names) for seed in range(5))
    limit = stated("order in which")
    assert limit < 1e-11
    for other in others:
        for name in names:
            assert abs(other[name] - first[name]).max() < limit * abs(first[name]).max(), name
