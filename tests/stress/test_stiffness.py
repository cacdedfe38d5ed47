"""Mesh stiffness from 1e2 to 1e14 N/m, damping from none to far above critical, inertia ratios to 1e10."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import gearlib as gl
import gearparts as gp

R_1, R_2, J_1, J_2 = 0.05, 0.1, 0.01, 0.2
MASS = 1 / (R_1**2 / J_1 + R_2**2 / J_2)  # kg, of the mesh's vibration
STIFFNESSES = tuple(10.0**k for k in range(2, 15))
c = gl.connect


class Pair(gl.Component):
    """A gear pair with an elastic or a rigid mesh; a fan as load makes it nonlinear."""

    rigid = gl.Structural(False)
    linear = gl.Structural(False, "no fan")
    fan = gl.Parameter("N.m", "drag of the load at 1 rad/s; it grows with the speed squared", default=0.01)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=10 + 2 * gl.sin(30 * gl.time))
        self.pinion, self.wheel = gp.Inertia(J=J_1), gp.Inertia(J=J_2)
        if not self.linear:
            drag = {"tau_nominal": -self.fan, "w_nominal": 1.0, "torque_direction": False}
            self.load = gp.QuadraticSpeedDependentTorque(**drag)
        self.mesh = gp.IdealGear(ratio=-R_2 / R_1) if self.rigid else gp.ExternalMesh(r_a=R_1, r_b=R_2, c=1e8, d=0.0)
        links = [
            c(self.torque.flange, self.pinion.flange_a), c(self.pinion.flange_b, self.mesh.flange_a),
            c(self.mesh.flange_b, self.wheel.flange_a),
        ]  # fmt: skip
        return links if self.linear else [*links, c(self.wheel.flange_b, self.load.flange)]


@cache
def compiled(rigid: bool = False, linear: bool = False) -> gl.System:
    return gl.compile(Pair(rigid=rigid, linear=linear), outputs=["pinion.w", "wheel.w"])


def damping(stiffness: float, ratio: float) -> float:
    """N.s/m at a fraction of critical damping."""
    return 2 * ratio * math.sqrt(stiffness * MASS)


def run(stiffness: float, ratio: float, method: str, rtol: float = 1e-8, t_end: float = 0.5, **parameters: float) -> Any:
    values = {"mesh.c": stiffness, "mesh.d": damping(stiffness, ratio), **parameters}
    return compiled().simulate(t_end, samples=51, method=method, rtol=rtol, parameters=values)


def distance_from_rigid(stiffness: float, ratio: float = 0.7, rtol: float = 1e-10) -> float:
    """Of the wheel's speed, after the first vibration has died away."""
    rigid = compiled(True).simulate(0.5, samples=51, method="rk8", rtol=1e-12)
    elastic = run(stiffness, ratio, "auto" if stiffness > 1e9 else "rk8", rtol)
    return float(np.abs(elastic["wheel.w"] - rigid["wheel.w"])[10:].max())


def slopes(stiffnesses: tuple[float, ...], found: list[float]) -> list[float]:
    """Powers of 1 / stiffness that lead from one value to the next."""
    return [math.log10(a / b) / math.log10(y / x) for a, b, x, y in zip(found, found[1:], stiffnesses, stiffnesses[1:])]


def test_elastic_becomes_rigid() -> None:
    # the deflection is F / k, its rate too: first order in 1 / k
    ladder = (1e7, 1e8, 1e9)
    assert slopes(ladder, [distance_from_rigid(k) for k in ladder]) == pytest.approx([1.0, 1.0], abs=0.1)


@pytest.mark.stress
@pytest.mark.parametrize("ratio", [0.7, 3.0])
def test_elastic_becomes_rigid_up_the_ladder(ratio: float) -> None:
    ladder = (1e6, 1e7, 1e8, 1e9, 1e10)
    assert slopes(ladder, [distance_from_rigid(k, ratio) for k in ladder]) == pytest.approx([1.0] * 4, abs=0.1)
    # above, the difference is what the tolerance leaves of it
    for stiffness in (1e11, 1e12, 1e13, 1e14):
        assert distance_from_rigid(stiffness, ratio) < 3e-8


def test_undamped_elastic_becomes_rigid() -> None:
    """The vibration that the torque's step excites stays: its deflection goes with 1 / k, its speed with k^-1/2."""
    ladder = STIFFNESSES[4:]
    deflections, distances = [], []
    for stiffness in ladder:
        times = np.linspace(0.0, 7.3 * 2 * math.pi * math.sqrt(MASS / stiffness), 1201)
        values = {"mesh.c": stiffness, "mesh.d": 0.0}
        elastic = compiled(linear=True).simulate(times[-1], times=times, method="exact", parameters=values)
        turned = (10 * times + 2 * (1 - np.cos(30 * times)) / 30) * R_2 / R_1  # N.m.s, on the wheel
        rigid = -turned / (J_2 + J_1 * (R_2 / R_1) ** 2)
        deflections.append(np.abs(elastic["mesh.q"]).max())
        distances.append(np.abs(elastic["wheel.w"] - rigid).max())
    # at 1e6 N/m the torque still changes a little within the few periods
    assert slopes(ladder, deflections) == pytest.approx([1.0] * 8, abs=0.02)
    assert slopes(ladder, distances) == pytest.approx([0.5] * 8, abs=0.02)


@pytest.mark.parametrize("stiffness", STIFFNESSES[::4])
def test_ida_steps_are_bounded(stiffness: float) -> None:
    result = run(stiffness, 1.0, "ida", 1e-6)
    assert result.stats["steps"] < 3000
    assert np.isfinite(result["wheel.w"]).all()


@pytest.mark.stress
@pytest.mark.parametrize("ratio", [0.3, 1.0, 10.0, 1000.0])
@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_ida_steps_are_bounded_up_the_ladder(stiffness: float, ratio: float) -> None:
    result = run(stiffness, ratio, "ida", 1e-6)
    assert result.stats["steps"] < 3000
    reference = run(stiffness, ratio, "ida", 1e-10)
    assert np.abs(result["wheel.w"] - reference["wheel.w"]).max() <= 1e-4 * np.abs(reference["wheel.w"]).max()


def test_auto_hands_over_where_it_is_stiff() -> None:
    soft, stiff = run(1e5, 1.0, "auto"), run(1e14, 1.0, "auto")
    assert soft.stats["method"] == "taylor"
    assert stiff.stats["method"] == "ida"
    assert "handed over" in stiff.stats["why"]
    assert stiff.stats["steps"] < 5000


@pytest.mark.stress
@pytest.mark.parametrize("ratio", [1.0, 100.0])
def test_auto_switches_once_up_the_ladder(ratio: float) -> None:
    results = [run(k, ratio, "auto", 1e-6) for k in STIFFNESSES]
    handed = [r.stats["method"] == "ida" for r in results]
    assert handed == sorted(handed)
    assert 0 < sum(handed) < len(handed)
    assert all(r.stats["work"] < 2e6 for r in results), [r.stats["work"] for r in results]


@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.3])
def test_auto_leaves_a_vibration_that_has_died_away(ratio: float, rtol: float) -> None:
    """Without handing over, order 5 takes a million steps at 1e14 N/m; the best method takes 3000 times less work."""
    results = [run(k, ratio, "auto", rtol) for k in STIFFNESSES]
    for k, auto in zip(STIFFNESSES, results, strict=True):
        best = run(k, ratio, "ida", rtol).stats["work"]
        if k < 1e12:  # beyond, Runge-Kutta alone would take seconds, and IDA is the better one
            best = min(best, run(k, ratio, "rk", rtol).stats["work"])
        assert auto.stats["work"] <= 2 * best + 2e6, f"{k:g} N/m; 2e6 (2 ms) for the preparation of both"
    assert results[-1].stats["method"] == "ida"


@pytest.mark.stress
@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_auto_stays_where_a_vibration_is_undamped(stiffness: float) -> None:
    """Every method must follow it, and explicit ones do so with the fewest steps."""
    t_end = min(0.5, 3000 * math.sqrt(MASS / stiffness))  # 480 periods at most
    auto, ida = (run(stiffness, 0.0, m, t_end=t_end) for m in ("auto", "ida"))
    assert auto.stats["method"] == "taylor"
    assert auto.stats["steps"] < ida.stats["steps"]
    scale = max(np.abs(ida["wheel.w"]).max(), 1.0)  # the nominal speed is 1 rad/s, and short runs end below
    assert np.abs(auto["wheel.w"] - ida["wheel.w"]).max() <= 1e-5 * scale


@pytest.mark.stress
@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize("ratio", [0.01, 1.0, 100.0])
def test_auto_agrees_with_ida(stiffness: float, ratio: float) -> None:
    one, other = (run(stiffness, ratio, m) for m in ("auto", "ida"))
    assert np.abs(one["wheel.w"] - other["wheel.w"]).max() <= 1e-5 * np.abs(other["wheel.w"]).max()


@pytest.mark.parametrize("ratio", [0.0, 0.01, 1.0, 50.0])
@pytest.mark.parametrize("stiffness", [1e2, 1e6, 1e10, 1e14])
def test_exact_at_any_stiffness_and_damping(stiffness: float, ratio: float) -> None:
    """The deflection alone obeys an equation of second order, whose solution is known."""
    d = damping(stiffness, ratio)
    result = compiled(linear=True).simulate(0.01, samples=11, method="exact", parameters={"mesh.c": stiffness, "mesh.d": d})
    times = result.time
    A = np.zeros((4, 4))  # scaled time w t: deflection and its rate, and the cosine's two states; constant torque apart
    frequency = math.sqrt(stiffness / MASS)
    A[0, 1], A[1, 0], A[1, 1] = frequency, -frequency, -d / MASS
    A[1, 2], A[2, 3], A[3, 2] = 2 * R_1 / J_1 / frequency, 30.0, -30.0
    constant = 10 * R_1 / J_1 / frequency
    full = np.zeros((5, 5))
    full[:4, :4], full[1, 4] = A, constant
    start = np.array([0.0, 0.0, 0.0, 1.0, 1.0])
    expected = np.array([(expm(full * t) @ start)[0] for t in times])
    assert np.abs(result["mesh.q"] - expected).max() <= 1e-8 * np.abs(expected).max()


def two_bodies(J_a: float, J_b: float, stiffness: float, d: float, times: Any) -> Any:
    """Deflection and both speeds of the linear pair: exponential of its equations, with constant and sine as further states."""
    # the speeds times sqrt(J), the deflection times sqrt(k): the matrix is balanced then
    A = np.zeros((6, 6))
    pull = np.array([0.0, R_1 / math.sqrt(J_a), R_2 / math.sqrt(J_b), 0.0, 0.0, 0.0])
    A[0, 1:3] = math.sqrt(stiffness) * pull[1:3]
    for row in (1, 2):
        A[row] -= pull[row] * d * pull
        A[row, 0] -= pull[row] * math.sqrt(stiffness)
    A[1, 3], A[1, 4] = 10 / math.sqrt(J_a), 2 / math.sqrt(J_a)
    A[4, 5], A[5, 4] = 30.0, -30.0
    start = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 1.0])
    x = np.array([expm(A * t) @ start for t in times])
    return x[:, 0] / math.sqrt(stiffness), x[:, 1] / math.sqrt(J_a), x[:, 2] / math.sqrt(J_b)


@pytest.mark.parametrize(("J_a", "J_b"), [(2e-11, 0.2), (1e-6, 1e4), (1.0, 1e-10)])
@pytest.mark.parametrize("method", ["exact", "ida", "rk8"])
def test_inertia_ratios_to_1e10(method: str, J_a: float, J_b: float) -> None:
    mass = 1 / (R_1**2 / J_a + R_2**2 / J_b)
    stiffness = 1e6 * mass  # a thousand radians a second
    d = 0.5 * math.sqrt(stiffness * mass)
    values = {"pinion.J": J_a, "wheel.J": J_b, "mesh.c": stiffness, "mesh.d": d}
    result = compiled(linear=True).simulate(0.02, samples=6, method=method, rtol=1e-9, parameters=values)
    expected = two_bodies(J_a, J_b, stiffness, d, result.time)
    for name, right in zip(("mesh.q", "pinion.w", "wheel.w"), expected, strict=True):
        assert np.abs(result[name] - right).max() <= 3e-8 * np.abs(right).max(), name


@pytest.mark.parametrize("small", [1e-7, 2e-11])
def test_a_tiny_pinion_before_a_fan(small: float) -> None:
    """Stiff and nonlinear: ``auto`` is right however small the inertia."""
    values = {"pinion.J": small, "mesh.c": 1e6, "mesh.d": 2e3 * math.sqrt(small) / R_1}
    auto, ida = (compiled().simulate(0.5, samples=51, method=m, rtol=1e-7, parameters=values) for m in ("auto", "ida"))
    assert auto.stats["method"] == "ida"
    # IDA takes about a thousand steps, or stays at order 1 for good, as the last digits will have it: see docs/stability.md
    assert auto.stats["steps"] < 400_000
    assert np.abs(auto["wheel.w"] - ida["wheel.w"]).max() <= 1e-5 * np.abs(ida["wheel.w"]).max()
