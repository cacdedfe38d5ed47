"""Couplings, the universal joint, bearings: closed forms and energy."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipk

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, StartError
from tests.gearparts.related import RelatedProbe


class Coupled(gl.Component):
    """A coupling whose flange_a is held."""

    given = gl.Structural((), "of the coupling, as pairs")
    phi0 = gl.Parameter("rad", "twist at the start", default=0.2)

    def assemble(self) -> Any:
        self.coupling = gp.ElasticCoupling(J_a=0.1, J_b=0.4, **dict(self.given))
        self.ground, self.load = gp.Fixed(), gp.Inertia(J=0.6, start={"phi": self.phi0, "w": 0.0})
        return [
            gl.connect(self.ground.flange, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.load.flange_a),
        ]


def coupled(**given: Any) -> Coupled:
    return Coupled(given=tuple(given.items()))


def test_a_linear_coupling_swings_with_its_hub() -> None:
    t = np.linspace(0.0, 1.0, 21)
    result = gl.simulate(coupled(c=100.0, d=0.0), t_end=1.0, times=t)
    assert result["load.phi"] == pytest.approx(0.2 * np.cos(10.0 * t), abs=1e-6)


@pytest.mark.parametrize("c_3", [4000.0, -1000.0])
def test_a_cubic_coupling_has_duffing_s_period(c_3: float) -> None:
    """A quarter of the period is the time from rest at phi0 to zero, a complete elliptic integral."""
    omega2 = 100.0 + c_3 * 0.04
    m = c_3 * 0.04 / (2 * omega2)
    quarter = float(ellipk(m)) / math.sqrt(omega2)
    energy = lambda x: 100.0 * x**2 / 2 + c_3 * x**4 / 4  # noqa: E731
    direct = quad(lambda s: 0.4 * s / math.sqrt(2 * (energy(0.2) - energy(0.2 * (1 - s**2)))), 0, 1)[0]
    assert quarter == pytest.approx(direct, rel=1e-8)
    system = gl.compile(coupled(element="cubic", c=100.0, d=0.0, c_3=c_3), outputs=["load.phi", "load.w"])
    result = system.simulate(4 * quarter, times=np.array([0.0, quarter, 2 * quarter, 4 * quarter]), rtol=1e-10)
    assert result["load.phi"] == pytest.approx([0.2, 0.0, -0.2, 0.2], abs=1e-7)
    assert result["load.w"][1] == pytest.approx(-math.sqrt(2 * energy(0.2)), rel=1e-7)


def test_a_coupling_with_backlash_flies_freely_through_its_gap() -> None:
    system = gl.compile(coupled(element="backlash", c=1e4, d=0.0, b=0.4), outputs=["load.phi", "load.w", "coupling.spring.tau"])
    t = np.linspace(0.0, 0.1, 11)
    result = system.simulate(0.1, times=t, start={"load.phi": 0.0, "load.w": 1.5}, rtol=1e-9)
    assert result["load.phi"] == pytest.approx(1.5 * t, abs=1e-9)
    assert (result["coupling.spring.tau"] == 0).all()


@pytest.mark.parametrize("element", ["linear", "cubic"])
def test_power_into_a_coupling_is_stored_or_lost(element: str) -> None:
    more = gl.offered({"c_3": 500.0})
    p = RelatedProbe(coupled(element=element, c=100.0, d=3.0, use_heat_port=False, **more))
    rng = np.random.default_rng(2)
    for _ in range(20):
        x, w = rng.normal(size=2)
        value = p.values({s: (w if s.endswith((".w", "w_rel")) else x) for s in p.states})
        x, w = value("coupling.spring.phi_rel"), value("load.w")
        stored = (100.0 * x + (500.0 * x**3 if element == "cubic" else 0.0)) * w
        assert 1.0 * value("der(load.w)") * w + stored + value("coupling.spring.loss_power") == pytest.approx(0.0, abs=1e-9)
        assert value("coupling.spring.loss_power") == pytest.approx(3.0 * w**2, rel=1e-12)


class Jointed(gl.Component):
    """Two bodies joined by a universal joint, or by two in a row that cancel each other's variation."""

    double = gl.Structural(False)

    def assemble(self) -> Any:
        self.a, self.b = gp.Inertia(J=0.3, start={"phi": 0.4, "w": 20.0}), gp.Inertia(J=0.7)
        self.torque, self.joint = gp.Torque(tau=2.0), gp.UniversalJoint(beta=0.6)
        links = [gl.connect(self.torque.flange, self.a.flange_a), gl.connect(self.a.flange_b, self.joint.flange_a)]
        if not self.double:
            return [*links, gl.connect(self.joint.flange_b, self.b.flange_a)]
        self.second = gp.UniversalJoint(beta=0.6)
        return [
            *links,
            gl.connect(self.joint.flange_b, self.second.flange_b),
            gl.connect(self.second.flange_a, self.b.flange_a),
        ]


def test_a_universal_joint_turns_as_its_fork_and_keeps_energy() -> None:
    system = gl.compile(Jointed(), outputs=["a.phi", "a.w", "b.phi", "b.w", "joint.flange_a.tau", "joint.flange_b.tau"])
    r = system.simulate(1.0, samples=201, rtol=1e-10)
    assert r["a.phi"][-1] > 10.0  # several turns
    assert np.sin(r["b.phi"]) * np.cos(r["a.phi"]) * math.cos(0.6) == pytest.approx(
        np.cos(r["b.phi"]) * np.sin(r["a.phi"]), abs=1e-9
    )
    assert np.abs(r["b.phi"] - r["a.phi"]).max() < 0.2
    ratio = math.cos(0.6) / (1 - math.sin(0.6) ** 2 * np.cos(r["a.phi"]) ** 2)
    assert r["b.w"] == pytest.approx(ratio * r["a.w"], rel=1e-9)
    assert r["joint.flange_a.tau"] == pytest.approx(-ratio * r["joint.flange_b.tau"], rel=1e-9, abs=1e-12)
    energy = 0.15 * r["a.w"] ** 2 + 0.35 * r["b.w"] ** 2 - 2.0 * r["a.phi"]
    assert energy == pytest.approx(np.full(201, energy[0]), rel=1e-7)


def test_a_straight_joint_is_a_rigid_coupling_and_turns_steadily() -> None:
    class Driven(gl.Component):
        beta = gl.Parameter("rad", default=0.0)

        def assemble(self) -> Any:
            self.torque, self.joint = gp.Torque(tau=2.0), gp.UniversalJoint(beta=self.beta)
            self.a, self.b, self.drag, self.ground = gp.Inertia(J=0.3), gp.Inertia(J=0.7), gp.Damper(d=0.5), gp.Fixed()
            chain = [self.a, self.joint, self.b, self.drag]
            links = [gl.connect(one.flange_b, other.flange_a) for one, other in itertools.pairwise(chain)]
            return [
                *links,
                gl.connect(self.torque.flange, self.a.flange_a),
                gl.connect(self.drag.flange_b, self.ground.flange),
            ]

    system = gl.compile(Driven())
    assert gl.steady_state(system, ["a.w", "b.w"]).values == pytest.approx(4.0)  # 2 N.m / 0.5 N.m.s/rad
    assert gl.modes(system, at="steady").decays == pytest.approx([-0.5 / (0.3 + 0.7)])
    with pytest.raises(StartError, match=r"vary with .*\.phi, which would grow for ever, and repeat every turn"):
        gl.steady_state(system, parameters={"beta": 0.3})


def test_two_universal_joints_in_mirror_arrangement_run_evenly() -> None:
    r = gl.compile(Jointed(double=True), outputs=["a.phi", "b.phi", "a.w"]).simulate(0.5, samples=21, rtol=1e-9)
    assert r["b.phi"] == pytest.approx(r["a.phi"], abs=1e-9)
    assert r["a.w"] == pytest.approx(20.0 + 2.0 * r.time, abs=1e-6)


@pytest.mark.parametrize("rows", [3, 4, 12])
def test_palmgren_s_table_has_the_rows_that_were_asked_for(rows: int) -> None:
    """From 0 to w_max, with one where the law has its corner if that is on the way: three rows are the least."""
    table = gp.palmgren_friction(0.06, f_0=2.0, viscosity=30e-6, w_max=200.0, rows=rows)
    corner = 2000 / 30 * np.pi / 30
    assert [w for w, _ in table] == pytest.approx([0.0, *np.linspace(corner, 200.0, rows - 1)], rel=1e-12)
    level = 160e-10 * 2.0 * 60.0**3
    assert [tau for _, tau in table[:2]] == pytest.approx([level, 1e-10 * 2.0 * 2000 ** (2 / 3) * 60.0**3], rel=1e-9)
    assert table[-1][1] == pytest.approx(1e-10 * 2.0 * (30 * 200.0 * 30 / np.pi) ** (2 / 3) * 60.0**3, rel=1e-12)
    slow = gp.palmgren_friction(0.06, f_0=2.0, viscosity=30e-6, w_max=5.0, rows=rows)
    assert [w for w, _ in slow] == pytest.approx(np.linspace(0, 5.0, rows), rel=1e-12)
    assert [tau for _, tau in slow] == pytest.approx([level] * rows, rel=1e-12)


def test_the_row_at_the_corner_of_palmgren_s_law_is_that_of_the_faster_side() -> None:
    """Whatever the rounding of the corner's speed; the law falls by 0.8 % there."""
    for viscosity in np.linspace(10e-6, 90e-6, 50).tolist():
        (_, slow), (_, corner), *_ = gp.palmgren_friction(0.06, f_0=2.0, viscosity=viscosity)
        assert corner / slow == pytest.approx(2000 ** (2 / 3) / 160, rel=1e-9)


def test_palmgren_s_friction_worked_by_hand() -> None:
    # 60 mm, f_0 = 2, 30 mm2/s: at 1500 1/min nu n = 45000, M_0 = 1e-7 * 2 * 45000**(2/3) * 216000 = 54.66 N.mm; M_1 = 60 N.mm
    w = 1500 * math.pi / 30
    table = gp.palmgren_friction(0.06, f_0=2.0, viscosity=30e-6, f_1=5e-4, load=2000.0, w_max=w, rows=5)
    assert table[-1][1] == pytest.approx(0.06 + 0.05466, abs=1e-5)
    assert table[0][1] == pytest.approx(0.06 + 160e-10 * 2 * 216000, rel=1e-12)
    assert table[1][0] == pytest.approx(2000 / 30 * math.pi / 30, rel=1e-12)
    slow = gp.palmgren_friction(0.06, f_0=2.0, viscosity=1e-6, w_max=100.0)
    assert len({tau for _, tau in slow}) == 1
    with pytest.raises(ArgumentError, match="viscosity=0"):
        gp.palmgren_friction(0.06, f_0=2.0, viscosity=0.0)
    with pytest.raises(ArgumentError, match="rows is 2; expected a whole number, 3 or more"):
        gp.palmgren_friction(0.06, f_0=2.0, viscosity=1e-5, rows=2)
    for load in (math.inf, math.nan, "2000"):
        with pytest.raises(ArgumentError, match="load="):
            gp.palmgren_friction(0.06, f_0=2.0, viscosity=1e-5, load=load)
    for d_m in (math.inf, "0.06", None):
        with pytest.raises(ArgumentError, match=r"d_m=.*expected a positive number"):
            gp.palmgren_friction(d_m, f_0=2.0, viscosity=1e-5)


def test_palmgren_s_table_up_to_the_corner_of_its_law() -> None:
    """At a largest speed of just the corner there is nothing beyond it; the rows are distinct."""
    corner = 2000 / (1e6 * 30e-6) * math.pi / 30
    table = gp.palmgren_friction(0.06, f_0=2.0, viscosity=30e-6, w_max=corner, rows=5)
    assert [w for w, _ in table] == pytest.approx(np.linspace(0.0, corner, 5), rel=1e-15)


@pytest.mark.parametrize("name", ["d_m", "f_0", "viscosity", "w_max", "f_1", "load"])
def test_values_that_no_bearing_has_are_refused(name: str) -> None:
    given = {"d_m": 0.06, "f_0": 2.0, "viscosity": 30e-6, "w_max": 100.0, "f_1": 0.0, "load": 0.0}
    gp.palmgren_friction(**given)
    may_be_zero = name in ("f_1", "load")
    for value in (-1e-9, *(() if may_be_zero else (0.0,))):
        with pytest.raises(
            ArgumentError, match=f"{name}={value}.*expected {'0 or more' if may_be_zero else 'a positive number'}"
        ):
            gp.palmgren_friction(**{**given, name: value})


def test_friction_beyond_the_largest_number_is_refused() -> None:
    with pytest.raises(ArgumentError, match=r"d_m=1e\+105.*the torque is too large for a number"):
        gp.palmgren_friction(1e105, f_0=2.0, viscosity=30e-6)


@pytest.mark.slow
def test_a_shaft_in_rolling_bearings_runs_down_as_the_table_says() -> None:
    table = gp.palmgren_friction(0.06, f_0=2.0, viscosity=30e-6, f_1=5e-4, load=2000.0, w_max=160.0, rows=4)

    class RunDown(gl.Component):
        def assemble(self) -> Any:
            self.rotor, self.bearing = gp.Inertia(J=0.05, start={"w": 150.0}), gp.BearingFriction(tau_pos=table)
            return [gl.connect(self.rotor.flange_b, self.bearing.flange_a)]

    speeds, torques = np.array(table).T
    until = 40.0
    needed = quad(lambda w: 0.05 / np.interp(w, speeds, torques), until, 150.0, points=list(speeds[1:-1]))[0]
    result = gl.compile(RunDown(), outputs=["rotor.w"]).simulate(needed, samples=3, rtol=1e-9)
    assert result["rotor.w"][-1] == pytest.approx(until, rel=1e-6)
