"""Couplings and meshes with backlash, and meshes whose stiffness varies: reference trajectories, closed forms, energy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp
from gearlib.language.component import energies_of
from gearlib.language.expressions import real_symbol
from gearparts.gears.mesh_models import DetailedExternalMesh, DetailedInternalMesh, mesh_damping
from gearparts.rotational.backlash import ElastoBacklash, ElastoBacklash2
from tests.benchmarks import floor_rk
from tests.gearparts import msl_hybrid_examples as msl
from tests.gearparts.laws import plain
from tests.gearparts.rotational.scenes_backlash import BacklashPair
from tests.gearparts.rotational.test_friction import METHODS, check_against_reference, run
from tests.gearparts.test_msl_examples import agree
from tests.run.python_problem import rk


@pytest.mark.parametrize("method", METHODS)
def test_backlash(method: str) -> None:
    result = check_against_reference(msl.Backlash(), "Backlash", method)
    assert result["elastoBacklash.tau"][0] == pytest.approx(20e3 * (math.pi / 2 - math.pi / 8), rel=1e-9)


class Oscillator(gl.Component):
    """A body on a coupling with backlash; the coupling may have a heat port."""

    kind = gl.Structural(ElastoBacklash)
    b = gl.Parameter("rad", default=0.0, min=0)

    def assemble(self) -> Any:
        self.body = gp.Inertia(J=1.0, start={"phi": 0.4, "w": 0.0})
        self.ground = gp.Fixed()
        self.coupling = self.kind(c=100.0, d=2.0, b=self.b, phi_rel0=0.1, use_heat_port=True)
        self.metal = gp.HeatCapacitor(C=1.0, start={"T": 300.0})
        return [
            gl.connect(self.ground.flange, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.body.flange_a),
            gl.connect(self.coupling.heat_port, self.metal.port),
        ]


@pytest.mark.parametrize("kind", [ElastoBacklash, ElastoBacklash2])
def test_without_backlash_it_is_a_spring_and_damper(kind: type[gl.Component]) -> None:
    t = np.linspace(0.0, 2.0, 201)
    result = run(Oscillator(kind=kind), ["body.phi", "metal.T", "body.w", "coupling.touching"], t, "rk")
    assert (result["coupling.touching"] == 1).all()
    omega = math.sqrt(99.0)
    agree(result, {"body.phi": 0.1 + 0.3 * np.exp(-t) * (np.cos(omega * t) + np.sin(omega * t) / omega)}, 1e-8)
    assert result.stats["events"] == 0
    energy = 0.5 * result["body.w"] ** 2 + 50 * (result["body.phi"] - 0.1) ** 2 + result["metal.T"]
    assert energy == pytest.approx(np.full(201, 304.5), abs=1e-7)


@pytest.mark.parametrize("kind", [ElastoBacklash, ElastoBacklash2])
def test_what_a_coupling_with_backlash_loses_heats_it(kind: type[gl.Component]) -> None:
    t = np.linspace(0.0, 2.0, 201)
    outputs = ["body.phi", "metal.T", "body.w", "coupling.tau", "coupling.phi_rel", "coupling.touching"]
    result = run(Oscillator(kind=kind, b=0.1), outputs, t, "rk")
    x = result["coupling.phi_rel"] - 0.1
    beyond = np.sign(x) * np.maximum(np.abs(x) - 0.05, 0.0)
    assert (result["coupling.tau"][beyond == 0] == 0).all()
    assert (result["coupling.touching"] == np.sign(beyond)).all()
    assert set(np.sign(beyond)) == {-1, 0, 1}
    assert (result["coupling.tau"] * np.sign(x) >= 0).all()  # no pull
    energy = 0.5 * result["body.w"] ** 2 + 50 * beyond**2 + result["metal.T"]
    assert energy == pytest.approx(np.full(201, 300 + 50 * 0.25**2), abs=1e-7)
    assert result["metal.T"][-1] > 301


def test_the_hammering_pair_agrees_with_equations_by_hand() -> None:
    by_hand = rk(floor_rk.backlash(), floor_rk.BACKLASH_TIMES, rtol=1e-12, order=8).x
    system = gl.compile(BacklashPair(), outputs=["mesh.q", "pinion.w", "wheel.w"])
    assert set(system.states) == {"mesh.q", "mesh.turned", "pinion.w", "wheel.w"}
    result = system.simulate(0.2, times=floor_rk.BACKLASH_TIMES, method="rk", rtol=1e-9)
    agree(result, {"mesh.q": by_hand[:, 0], "pinion.w": by_hand[:, 2], "wheel.w": -by_hand[:, 3]}, 1e-7)
    assert 1000 < result.stats["events"] < 1040  # each loss of contact, and each return


@pytest.mark.benchmark
def test_the_hammering_pair_takes_little_longer_than_a_loop_written_for_it() -> None:
    pair, times = floor_rk.backlash(), floor_rk.BACKLASH_TIMES
    system = gl.compile(BacklashPair(), outputs=["mesh.q", "pinion.w", "wheel.w"])
    loop = floor_rk.backlash_floor()
    floor = floor_rk.best_time(lambda: floor_rk.run_floor(loop, pair, times, 1e-6, 1e-6))
    ours = floor_rk.best_time(lambda: system.simulate(0.2, times=times, method="rk", rtol=1e-6))
    assert ours < 1.6 * floor


class Pair(gl.Component):
    """Two free bodies joined by a detailed mesh."""

    external = gl.Structural(True)
    options = gl.Structural((), "of the mesh, as pairs")
    q0 = gl.Parameter("m", default=0.0)
    w0 = gl.Parameter("rad/s", default=10.0)

    def assemble(self) -> Any:
        kind = DetailedExternalMesh if self.external else DetailedInternalMesh
        self.a = gp.Inertia(J=0.002, start={"w": self.w0})
        self.b = gp.Inertia(J=0.01)
        self.mesh = kind(r_a=0.05, r_b=0.1, c=1e7, start={"q": self.q0}, **{"d": 0.0, "z_a": 20.0, **dict(self.options)})
        return [gl.connect(self.a.flange_b, self.mesh.flange_a), gl.connect(self.mesh.flange_b, self.b.flange_a)]


MASS = 1 / (0.05**2 / 0.002 + 0.1**2 / 0.01)


def by_hand(stiffness: Any, error_rate: Any, external: bool, times: np.ndarray, breaks: list[float]) -> np.ndarray:
    """q, w_a and w_b of `Pair` with a stiffness and an error rate that depend on the angle of gear a."""
    sense = 1 if external else -1

    def rate(t: float, x: np.ndarray) -> list[float]:
        q, phi, wa, wb = x
        f = stiffness(20 * phi) * q
        return [0.05 * wa + sense * 0.1 * wb + error_rate(20 * phi) * 20 * wa, wa, -0.05 * f / 0.002, -sense * 0.1 * f / 0.01]

    return solve_ivp(rate, (0, times[-1]), [0, 0, 10.0, 0], "DOP853", times, rtol=1e-11, atol=1e-13, max_step=2e-4).y


FOURIER = ((1.0, 0.2, 0.3), (2.0, 0.1, -0.5))
ERROR = ((1.0, 5e-6, 0.1), (3.0, 1e-6, 0.0))


@pytest.mark.parametrize("external", [True, False])
@pytest.mark.parametrize(
    ("options", "stiffness"),
    [
        ({"stiffness": "sinusoidal", "c_amplitude": 0.3}, lambda p: 1e7 * (1 + 0.3 * np.cos(p))),
        (
            {"stiffness": "fourier", "stiffness_terms": FOURIER},
            lambda p: 1e7 * (1 + 0.2 * np.cos(p + 0.3) + 0.1 * np.cos(2 * p - 0.5)),
        ),
    ],
)
def test_stiffness_and_error_vary_over_the_mesh_phase(external: bool, options: dict[str, Any], stiffness: Any) -> None:
    t = np.linspace(0.0, 0.05, 101)
    expected = by_hand(stiffness, lambda p: 5e-6 * np.cos(p + 0.1) + 3e-6 * np.cos(3 * p), external, t, [])
    given = tuple({**options, "error_terms": ERROR}.items())
    result = run(Pair(external=external, options=given), ["mesh.q", "a.w", "b.w", "mesh.e", "mesh.phase"], t, "rk")
    agree(result, {"mesh.q": expected[0], "a.w": expected[2], "b.w": expected[3], "mesh.phase": 20 * expected[1]}, 1e-7)
    phase = result["mesh.phase"]
    assert result["mesh.e"] == pytest.approx(5e-6 * np.sin(phase + 0.1) + 1e-6 * np.sin(3 * phase), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("contact_ratio", [1.6, 2.25, 2.0])
def test_rectangular_stiffness_counts_the_pairs_in_contact(contact_ratio: float) -> None:
    options = tuple({"stiffness": "rectangular", "contact_ratio": contact_ratio}.items())
    result = run(Pair(options=options), ["mesh.c_now", "mesh.phase"], np.linspace(0.0, 0.5, 2001), "rk")
    phase, fewer = result["mesh.phase"], math.floor(contact_ratio)
    share = np.mod(phase / (2 * np.pi), 1.0)
    clear = np.abs(share - (contact_ratio - fewer)) > 1e-6
    pairs = fewer + (share < contact_ratio - fewer)
    assert phase[-1] > 20  # several periods
    assert result["mesh.c_now"][1:][clear[1:]] == pytest.approx((1e7 * pairs / contact_ratio)[1:][clear[1:]], rel=1e-12)


@pytest.mark.parametrize("kind", [{}, {"backlash": True, "b": 0.0}])
def test_damping_ratio(kind: dict[str, Any]) -> None:
    zeta = 0.1
    d = float(mesh_damping(zeta, 1e7, 0.002, 0.05, 0.01, 0.1))
    assert d == pytest.approx(2 * zeta * math.sqrt(1e7 * MASS), rel=1e-12)
    t = np.linspace(0.0, 0.004, 81)
    result = run(Pair(options=tuple({"d": d, **kind}.items())), ["mesh.q"], t, "rk")
    omega = math.sqrt(1e7 / MASS)
    damped = omega * math.sqrt(1 - zeta**2)
    expected = 0.5 / damped * np.exp(-zeta * omega * t) * np.sin(damped * t)
    agree(result, {"mesh.q": expected}, 1e-8)


def test_free_flight_through_the_gap_and_rebound() -> None:
    # 0.5 m/s across a gap of 1 mm: 2 ms of flight, half a period of contact, 2 ms back, ...
    options = tuple({"backlash": True, "b": 1e-3}.items())
    half_period = math.pi * math.sqrt(MASS / 1e7)
    t = np.linspace(0.0, 3 * (2e-3 + half_period), 301)
    result = run(Pair(options=options, q0=-5e-4), ["mesh.q", "mesh.f"], t, "rk")
    cycle = np.mod(t, 2e-3 + half_period)
    sense = 1 - 2 * np.mod(np.floor(t / (2e-3 + half_period)), 2)
    omega = math.pi / half_period
    expected = sense * np.where(cycle < 2e-3, -5e-4 + 0.5 * cycle, 5e-4 + 0.5 / omega * np.sin(omega * (cycle - 2e-3)))
    agree(result, {"mesh.q": expected}, 1e-7)


def test_preload_doubles_the_stiffness_until_a_flank_lifts() -> None:
    options = tuple({"backlash": True, "b": -1e-3}.items())  # larger than the deflection
    omega = math.sqrt(2e7 / MASS)
    t = np.linspace(0.0, 20 / omega, 201)
    result = run(Pair(options=options), ["mesh.q"], t, "rk")
    agree(result, {"mesh.q": 0.5 / omega * np.sin(omega * t)}, 1e-8)
    assert result.stats["events"] == 0
    lifting = gl.compile(Pair(options=tuple({"backlash": True, "b": -1e-4}.items())), outputs=["mesh.q", "mesh.f"])
    result = lifting.simulate(0.01, samples=401, method="rk", rtol=1e-9)
    q = result["mesh.q"]
    assert result["mesh.f"] == pytest.approx(1e7 * (np.maximum(q + 5e-5, 0) + np.minimum(q - 5e-5, 0)), rel=1e-9, abs=1e-6)
    assert np.abs(q).max() > 5e-5


class Loaded(gl.Component):
    """A damped pair with backlash under torque, with its loss on a body."""

    def assemble(self) -> Any:
        self.torque = gp.Torque(tau=5.0)
        self.a, self.b = gp.Inertia(J=0.002, start={"w": 10.0}), gp.Inertia(J=0.01)
        self.mesh = DetailedExternalMesh(
            r_a=0.05, r_b=0.1, c=1e7, d=300.0, b=1e-4, backlash=True, use_heat_port=True, start={"q": 0.0}
        )
        self.metal = gp.HeatCapacitor(C=1.0, start={"T": 0.0})
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.b.flange_a),
            gl.connect(self.mesh.heat_port, self.metal.port),
        ]


def test_power_into_a_detailed_mesh_is_stored_or_lost() -> None:
    outputs = ["a.w", "a.phi", "b.w", "mesh.q", "metal.T"]
    r = run(Loaded(), outputs, np.linspace(0.0, 0.02, 101), "rk", 1e-10)
    beyond = np.maximum(np.abs(r["mesh.q"]) - 5e-5, 0.0)
    energy = (
        0.001 * r["a.w"] ** 2 + 0.005 * r["b.w"] ** 2 + 0.5e7 * beyond**2 + r["metal.T"] - 5.0 * (r["a.phi"] - r["a.phi"][0])
    )
    assert energy == pytest.approx(np.full(101, 0.1), abs=1e-8)


@pytest.mark.parametrize("kind", [gp.ElastoBacklash, gp.ElastoBacklash2])
def test_the_spring_stores_what_is_beyond_the_gap_on_either_side(kind: type[gl.Component]) -> None:
    declared = energies_of(kind(c=300.0, b=0.2))
    assert declared is not None
    for x, beyond in ((0.15, 0.05), (-0.15, 0.05), (0.1, 0.0), (-0.1, 0.0), (0.03, 0.0), (-0.4, 0.3)):
        at = {"phi_rel": x + 0.7, "phi_rel0": 0.7, "b": 0.2, "c": 300.0}
        assert float(plain(declared.stored).subs({real_symbol(n): v for n, v in at.items()})) == pytest.approx(150 * beyond**2)
