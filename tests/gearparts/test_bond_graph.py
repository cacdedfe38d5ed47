"""Bond graphs as parts of models: mixed models against all-component ones, explicit matrices and closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment

import gearlib as gl
import gearparts as gp
from gearlib.bondgraph import GY, TF, BondGraph, C, I, MSe, One, R, RunTime, Se, Sf, Zero, energy_symbol, state_equations, time
from gearlib.errors import ArgumentError, BoundError, DeclarationError
from gearparts.trains import zhou_cui_2022 as zc
from gearparts.trains.paper_graphs import planetary_unit

XUnit = gp.from_bond_graph(
    planetary_unit().graph, ports={"ring": 1, "sun": 60, "carrier": 80}, nominal={"q_6": 1e-6, "q_30": 1e-6}
)


def bonds(names: list[str], params: zc.BondParameters) -> dict[str, float]:
    """Values of the graph's parameters: ``I_2`` from ``params.I[2]``."""
    return {name: float(getattr(params, name[0])[int(name[2:])]) for name in names}


class MixedTrain(gl.Component):
    """The paper's train with the X unit (and the load) as a bond graph and the rest as components."""

    values: dict[str, float]

    def assemble(self) -> Any:
        e = self.error()
        self.x_unit = XUnit(Sf_8=e, Sf_32=e, **self.values)
        self.drive, self.sun_shaft, self.end = gp.Torque(tau=100.0), gp.Inertia(J=0.0036), gp.Inertia(J=0.0036)
        self.p_unit = gp.FixedAxisUnit(R_1=0.0285, R_2=0.0465, I_1=0.0015, I_2=0.0094, K_g=1.8e8, C_g=2000.0, e_rate=-e)
        self.coupling = gp.IdealGear(ratio=-1.0)
        return [
            gl.connect(self.drive.flange, self.x_unit.ring),
            gl.connect(self.x_unit.sun, self.sun_shaft.flange_a),
            gl.connect(self.sun_shaft.flange_b, self.end.flange_a),
            gl.connect(self.end.flange_b, self.p_unit.flange_a),
            gl.connect(self.p_unit.flange_b, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.x_unit.carrier),
        ]

    def error(self) -> Any:
        return 0.0027 * gl.cos(28.0 * gl.time + 21 * gl.pi)


def parameters_of(part: type[gp.BondGraphPart]) -> list[str]:
    return [name for name, declared in vars(part).items() if isinstance(declared, gl.Parameter)]


@pytest.fixture(scope="module")
def mixed() -> gl.System:
    MixedTrain.values = bonds(parameters_of(XUnit), zc.bond_parameters())
    return gl.compile(MixedTrain())


INPUTS, OUTPUTS = ["drive.tau"], ["x_unit.f_2", "x_unit.f_26", "x_unit.f_81", "x_unit.q_6", "x_unit.q_30"]


def test_mixed_train_has_the_explicit_equations(mixed: gl.System) -> None:
    model = mixed.linearize(INPUTS, [*OUTPUTS, "p_unit.mesh.q"], sparse=True)
    A, B = zc.explicit_matrices(zc.bond_parameters())
    found, expected = np.linalg.eigvals(model.A), np.linalg.eigvals(A)
    cost = abs(np.subtract.outer(found, expected)) / abs(expected)
    assert cost[linear_sum_assignment(cost)].max() < 1e-11
    flows, params = zc.flow_rows(zc.bond_parameters()), zc.bond_parameters()
    rows = np.zeros((6, 8))
    for k, bond in enumerate((2, 26, 81)):
        rows[k, [0, 2, 3, 5, 7]] = flows[bond][:5] / [params.I[b] for b in zc.INDEPENDENT]
    rows[3, 1], rows[4, 4], rows[5, 6] = 1.0, 1.0, -1.0  # the pair's deflection is on the other flank
    for w in np.logspace(-2, 5, 71):
        one = model.C @ np.linalg.solve(1j * w * np.eye(8) - model.A, model.B)
        two = rows @ np.linalg.solve(1j * w * np.eye(8) - A, B[:, :1])
        assert np.all(np.abs(one - two) <= 3e-9 * np.abs(two))  # 1.0e-9 where numpy has only SSE3


def test_mixed_train_moves_as_the_one_of_components(mixed: gl.System) -> None:
    times = np.linspace(0, 0.2, 21)
    plain = gl.compile(gp.ZhouCui2022(tau_in=100.0), ["w_in", "w_sun", "w_out", "q_ring", "q_sun"])
    one, two = (s.simulate(0.2, times=times, method="rk", rtol=1e-9) for s in (mixed, plain))
    for name, other in zip(OUTPUTS, plain.outputs or (), strict=True):
        assert np.abs(one[name] - two[other]).max() < 1e-7 * np.abs(two[other]).max()
    # power that the three ports take in is what is stored and lost inside
    power = sum(one[f"x_unit.e_{n}"] * one[f"x_unit.f_{n}"] for n in (1, 60, 80, 8, 32))
    graph = planetary_unit().graph
    inside = sum(one[f"x_unit.e_{n}"] * one[f"x_unit.f_{n}"] for n in graph.of_kind(I, C, R))
    assert np.abs(power - inside).max() < 1e-10 * np.abs(power).max()


# ---------------------------------------------------------------- a motor

L, R_A, K, J, B_M = 0.012, 0.4, 0.21, 0.05, 0.002


def motor_graph() -> BondGraph:
    current, rotor, motor = One("current"), One("rotor"), GY("K")
    return BondGraph(
        (1, Se(), current), (2, current, I("L")), (3, current, R("R_a")), (4, current, motor), (5, motor, rotor),
        (6, rotor, I("J")), (7, rotor, R("b")), (8, Se(), rotor), name="DC motor",
    )  # fmt: skip


def test_motor_drives_a_train_of_components() -> None:
    """i' = (V - R i - K w) / L, (J + J_2 / n**2) w' = K i - (b + d / n**2) w, with the gear's ratio n."""
    Motor = gp.from_bond_graph(motor_graph(), ports={"shaft": 8}, defaults={"L": L, "R_a": R_A, "K": K, "b": B_M})
    n, J_2, d, V = 4.0, 1.3, 0.3, 24.0

    class Drive(gl.Component):
        def assemble(self) -> Any:
            self.motor, self.gear, self.load = Motor(J=J, Se_1=V), gp.IdealGear(ratio=n), gp.Inertia(J=J_2)
            self.friction, self.ground = gp.Damper(d=d), gp.Fixed()
            return [
                gl.connect(self.motor.shaft, self.gear.flange_a),
                gl.connect(self.gear.flange_b, self.load.flange_a),
                gl.connect(self.load.flange_b, self.friction.flange_a),
                gl.connect(self.friction.flange_b, self.ground.flange),
            ]

    system = gl.compile(Drive(), ["motor.f_2", "load.w"])
    A = np.array([[-R_A / L, -K / L], [K / (J + J_2 / n**2), -(B_M + d / n**2) / (J + J_2 / n**2)]])
    model = system.linearize(["motor.Se_1"], sparse=True)
    assert np.allclose(np.sort_complex(np.linalg.eigvals(model.A)), np.sort_complex(np.linalg.eigvals(A)), rtol=1e-12)
    for w in (0.0, 0.3, 5.0, 80.0):
        found = model.C @ np.linalg.solve(1j * w * np.eye(2) - model.A, model.B)
        expected = np.linalg.solve(1j * w * np.eye(2) - A, [1 / L, 0]) / [1, n]
        np.testing.assert_allclose(found[:, 0], expected, rtol=1e-12)
    result = system.simulate(0.5, samples=6, rtol=1e-10)
    forced = np.block([[A, np.array([[V / L], [0.0]])], [np.zeros((1, 3))]])
    expected = np.array([(expm(forced * t) @ [0, 0, 1])[:2] / [1, n] for t in result.time])
    np.testing.assert_allclose(np.column_stack([result["motor.f_2"], result["load.w"]]), expected, rtol=1e-8, atol=1e-12)
    balance = result.energy_balance()
    assert balance.relative_residual < 1e-6
    i, w = result["motor.f_2"], n * result["load.w"]
    assert balance.stored["motor"] == pytest.approx(L * i**2 / 2 + J * w**2 / 2, rel=1e-9)
    assert balance.work["motor"][-1] > balance.heat["motor"][-1] > 0


# ---------------------------------------------------------------- pushed ports, laws, modulation


def test_two_halves_of_a_quarter_car_meet_at_a_translational_flange() -> None:
    road, wheel, sum_of, rel, body = Zero("tyre"), One("wheel"), Zero("suspension"), One("relative"), One("body")
    lower = BondGraph(
        (1, Sf(), road), (2, road, C("c_t")), (3, road, wheel), (4, wheel, I("m_u")), (5, Se(), wheel), name="wheel"
    )
    upper = BondGraph(
        (1, Sf(), sum_of),
        (2, sum_of, rel),
        (3, rel, C("c_s")),
        (4, rel, R("d")),
        (5, sum_of, body),
        (6, body, I("m_s")),
        name="body",
    )
    Wheel = gp.from_bond_graph(lower, translational_ports={"hub": 5})
    Body = gp.from_bond_graph(upper, translational_ports={"hub": 1})
    k_t, m_u, k_s, d, m_s = 1.6e5, 36.0, 1.6e4, 980.0, 240.0

    class Car(gl.Component):
        def assemble(self) -> Any:
            self.wheel = Wheel(c_t=1 / k_t, m_u=m_u, Sf_1=0.2 * gl.sin(9 * gl.time))
            self.body = Body(c_s=1 / k_s, d=d, m_s=m_s)
            return [gl.connect(self.wheel.hub, self.body.hub)]

    system = gl.compile(Car(), ["wheel.q_2", "wheel.p_4", "body.q_3", "body.p_6"])
    model = system.linearize(["wheel.Sf_1"], sparse=True)
    A = np.array([[0, -1 / m_u, 0, 0], [k_t, -d / m_u, -k_s, d / m_s], [0, 1 / m_u, 0, -1 / m_s], [0, d / m_u, k_s, -d / m_s]])
    for w in (1.0, 8.0, 60.0):
        found = model.C @ np.linalg.solve(1j * w * np.eye(4) - model.A, model.B)
        np.testing.assert_allclose(found[:, 0], np.linalg.solve(1j * w * np.eye(4) - A, [1, 0, 0, 0]), rtol=1e-10)


def test_laws_and_modulation_by_time_and_stored_quantities() -> None:
    """Duffing's oscillator with a force of time and position, and a crank, against the bond graph's own equations."""
    v = One("v")
    duffing = BondGraph(
        (1, MSe(sp.cos(2 * time) - 0.5 * energy_symbol("q", 3)), v), (2, v, I(2.0)), (3, v, C(law=lambda q: q + q**3)),
        (4, v, R(conductance=lambda e: e / 4)),
    )  # fmt: skip
    crank, slider = One("crank"), One("slider")
    tf = TF(sp.Symbol("r") * sp.cos(energy_symbol("q", 3)))
    slider_crank = BondGraph(
        (1, Se(1.7), crank), (2, crank, I("J")), (3, crank, C(law=lambda q: 0)), (4, crank, tf), (5, tf, slider), (6, slider, I("M")),
        (7, slider, R(law=lambda f: 0.3 * f**3)),
    )  # fmt: skip
    numbers = {"J": 0.4, "M": 2.0, "r": 0.3}
    for graph, given in ((duffing, {}), (slider_crank, numbers)):
        run = RunTime(state_equations(graph))
        part = gp.from_bond_graph(graph)
        start = dict(zip(run.states, (0.8, 0.6), strict=True))
        result = gl.simulate(part(start=start, **given), t_end=2.0, samples=9, method="rk", rtol=1e-10)
        x = np.column_stack([result[name] for name in run.states])
        rates = np.column_stack([result[f"der({name})"] for name in run.states])
        f = run.bind(given)
        np.testing.assert_allclose(rates, [f(t, row) for t, row in zip(result.time, x, strict=True)], rtol=1e-9, atol=1e-11)
        assert np.abs(x[0] - x[-1]).max() > 0.1
        assert result.energy_balance().relative_residual < 1e-6


@pytest.mark.parametrize(
    ("law", "potential"), [(lambda q: q + q**3, lambda q: q**2 / 2 + q**4 / 4), (None, lambda q: q**2 / 0.4)]
)
def test_what_storage_elements_store(law: Any, potential: Any) -> None:
    v = One("v")
    graph = BondGraph((1, v, I(2.0)), (2, v, C(law=law) if law else C(0.2)), (3, v, R(0.1)))
    result = gl.simulate(gp.from_bond_graph(graph)(start={"p_1": 0.5, "q_2": 0.8}), t_end=2.0, samples=9, rtol=1e-10)
    stored = sum(result.energy_balance().stored.values())
    assert stored == pytest.approx(result["p_1"] ** 2 / 4.0 + potential(result["q_2"]), rel=1e-9)


def test_a_deflection_of_a_graph_is_a_state_before_what_is_not_preferred() -> None:
    """Where one follows from the other: q / C is the torque of what it is joined to."""

    class Held(gl.Component):
        flange = gp.Flange()
        turn = gl.Variable("1", "share of a turn")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.turn * 2 * gl.pi, self.flange.phi), gl.Eq(self.flange.tau, 3.0 * self.turn)]

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.held, self.soft = Held(), Soft()
            return [gl.connect(self.soft.end, self.held.flange)]

    node = Zero("z")
    Soft = gp.from_bond_graph(BondGraph((1, Se(), node), (2, node, C(0.5)), (3, node, R(0.2))), ports={"end": 1})
    system = gl.compile(Train(), outputs=["soft.q_2", "held.turn"])
    assert system.translation.scene.state_names == ("soft.q_2",)


# ---------------------------------------------------------------- mistakes


def test_names_of_the_class() -> None:
    Motor = gp.from_bond_graph(motor_graph(), ports={"shaft": 8})
    assert (Motor.__name__, gp.from_bond_graph(motor_graph(), name="Motor").__name__) == ("DCMotor", "Motor")
    assert parameters_of(Motor) == ["J", "K", "L", "R_a", "b"]


@pytest.mark.parametrize("numbers", [(1, 2, 3, 4, 5, 6), (6, 5, 4, 3, 2, 1), (2, 6, 1, 5, 3, 4)])
def test_both_ports_of_a_transformer_are_flanges(numbers: tuple[int, ...]) -> None:
    """A gear with a body at each end: speeds, torques and ports do not depend on how the bonds are numbered."""
    into, left, inside, outside, right, out = numbers
    one, two, gear = One("left"), One("right"), TF("m")
    graph = BondGraph(
        (into, Se(), one), (left, one, I("J_a")), (inside, one, gear), (outside, gear, two), (right, two, I("J_b")),
        (out, Se(), two), name="gear",
    )  # fmt: skip
    Gear = gp.from_bond_graph(graph, ports={"first": into, "second": out})

    class Drive(gl.Component):
        def assemble(self) -> Any:
            self.gear = Gear(J_a=0.2, J_b=0.3, m=2.0)
            self.t, self.s, self.load = gp.Torque(tau=1.0), gp.Torque(tau=0.5), gp.Inertia(J=0.7)
            return [gl.connect(self.t.flange, self.gear.first), gl.connect(self.gear.second, self.load.flange_a, self.s.flange)]

    run = gl.simulate(Drive(), 2.0, samples=3)
    rate = (1.0 + 2 * 0.5) / (0.2 + 4 * (0.3 + 0.7))  # of the first shaft; the second one turns twice as fast
    assert run[f"gear.f_{into}"] == pytest.approx(rate * run.time, rel=1e-9)
    assert run["load.w"] == pytest.approx(2 * rate * run.time, rel=1e-9)
    assert run["gear.second.tau"] == pytest.approx(np.full(3, 0.5 - 0.7 * 2 * rate), rel=1e-9)
    for ports in ({"first": into, "second": left}, {"first": out, "second": outside}):
        with pytest.raises(ArgumentError, match=f"port 'second': bond {ports['second']} has no source without a value"):
            gp.from_bond_graph(graph, ports=ports)
    with pytest.raises(ArgumentError, match=f"two ports are on the same bond: first on {out}, second on {out}"):
        gp.from_bond_graph(graph, ports={"first": out, "second": out})
    with pytest.raises(ArgumentError, match=f"port 'second': bond {left} has no source"):
        gp.from_bond_graph(graph, ports={"first": into}, translational_ports={"second": left})


def test_wrong_ports_and_names_are_reported() -> None:
    graph = motor_graph()
    with pytest.raises(ArgumentError, match=r"DC motor: port 'shaft': bond 6 has no source without a value; such bonds: 1, 8"):
        gp.from_bond_graph(graph, ports={"shaft": 6})
    with pytest.raises(ArgumentError, match="two ports are on the same bond"):
        gp.from_bond_graph(graph, ports={"shaft": 8, "end": 8})
    both = {"shaft": 8, "end": 1}
    with pytest.raises(ArgumentError, match="'end' is named as a port of both kinds"):
        gp.from_bond_graph(graph, ports=both, translational_ports=both)
    with pytest.raises(ArgumentError, match="no parameter 'R'; did you mean 'R_a'"):
        gp.from_bond_graph(graph, defaults={"R": 1.0})
    with pytest.raises(ArgumentError, match="no variable 'q_9'"):
        gp.from_bond_graph(graph, nominal={"e_2": 2.0, "q_9": 1.0, "p_99": 1.0})
    with pytest.raises(DeclarationError, match="'p_6' cannot be a name here"):
        gp.from_bond_graph(graph, ports={"p_6": 8})
    v = One("v")
    with pytest.raises(DeclarationError, match="'2 m' cannot be a name here"):
        gp.from_bond_graph(BondGraph((1, Se(), v), (2, v, I("2 m"))))


def test_only_a_graph_with_named_ports_becomes_a_component() -> None:
    graph = BondGraph((1, Se(), (v := One("v"))), (2, v, I("m")))
    with pytest.raises(ArgumentError, match=r"from_bond_graph\(3\): expected a BondGraph"):
        gp.from_bond_graph(3)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match=r"ports is \[1\]; expected bonds by name"):
        gp.from_bond_graph(graph, ports=[1])  # type: ignore[arg-type]


def test_an_inertia_of_a_graph_cannot_be_negative() -> None:
    graph = BondGraph((1, Se(), (v := One("v"))), (2, v, I("m")), (3, v, C("k")), (4, v, R("d")), name="mass")
    Mass = gp.from_bond_graph(graph, defaults={"k": 2.0})
    gl.compile(Mass(m=1.0, d=-1.0))
    for wrong in ({"m": -1.0}, {"m": 1.0, "k": -2.0}):
        with pytest.raises(BoundError, match="expected at least 0"):
            gl.compile(Mass(**{"d": 1.0, **wrong}))
