"""Examples of Modelica.Mechanics.Rotational against reference trajectories, closed forms, and SciPy on equations by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gearlib as gl
from tests.gearparts import msl_examples as msl

REFERENCE = Path(__file__).resolve().parents[1] / "reference"
METHODS = ["auto", "ida", "rk"]


def reference(name: str) -> dict[str, np.ndarray]:
    """Independent solutions, 1e-9 of the peak or better."""
    columns = np.genfromtxt(REFERENCE / f"msl-{name}.csv", delimiter=",", names=True, deletechars="", replace_space="")
    return {c.strip('"'): columns[c] for c in columns.dtype.names}


def agree(result: Any, expected: dict[str, np.ndarray], tolerance: float = 1e-6) -> None:
    """Each signal differs by less than a part of its peak."""
    for name, signal in expected.items():
        peak = np.abs(signal).max()
        assert np.abs(result[name] - signal).max() < tolerance * peak, name


def run(component: gl.Component, expected: dict[str, np.ndarray], method: str, rtol: float = 1e-9) -> Any:
    times = expected.pop("time")
    system = gl.compile(component, outputs=list(expected))
    return system.simulate(times[-1], times=times, method=method, rtol=rtol)


@pytest.mark.parametrize("method", METHODS)
def test_first(method: str) -> None:
    expected = reference("First")
    assert len(expected) == 10
    agree(run(msl.first(), expected, method), expected)


@pytest.mark.parametrize("method", METHODS)
def test_first_grounded_moves_as_first_does(method: str) -> None:
    expected = reference("First")
    agree(run(msl.FirstGrounded(), expected, method), expected)


def test_the_ground_takes_the_reactions_of_torque_and_gear() -> None:
    result = gl.simulate(msl.first(), t_end=0.2, samples=21, rtol=1e-9)
    tau = 10 * np.sin(10 * np.pi * result.time)
    motor = tau - 0.1 * result["der(inertia1.w)"]  # into the gear
    assert result["torque.support.tau"] == pytest.approx(tau, abs=1e-9)
    assert result["idealGear.support.tau"] == pytest.approx(9 * motor, abs=1e-9)
    ground = -(result["torque.support.tau"] + result["idealGear.support.tau"] + result["damper.flange_b.tau"])
    assert result["fixed.flange.tau"] == pytest.approx(ground, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_rolling_wheel(method: str) -> None:
    expected = reference("RollingWheel")
    result = run(msl.RollingWheel(), expected, method)
    agree(result, expected)
    late = np.maximum(result.time - 0.1, 0.0)
    agree(result, {"inertia.w": 5 * np.tanh(late), "inertia.phi": 5 * np.log(np.cosh(late))}, 1e-8)
    assert result.stats["events"] == 1


def elastic_bearing(times: np.ndarray) -> dict[str, np.ndarray]:
    """Its three equations of motion, by Lagrange, solved with the matrix exponential of the system and its ramp."""
    # q = (shaft, housing, load); the spring's twist is load - (shaft + 2 housing) / 3
    twist = np.array([-1 / 3, -2 / 3, 1.0])
    K = 1e3 * np.outer(twist, twist) + np.diag([0.0, 1e5, 0.0])
    C, inverse = np.diag([0.0, 5.0, 0.0]), np.diag([1.0, 1 / 5, 1 / 50])
    A = np.zeros((8, 8))
    A[:3, 3:6] = np.eye(3)
    A[3:6, :3], A[3:6, 3:6] = -inverse @ K, -inverse @ C
    A[3, 6], A[6, 7] = 1.0, 1.0  # torque on the shaft, and its rate
    step = times[1] - times[0]
    forward = expm(A * step)
    x = np.zeros((len(times), 8))
    x[0, 7] = 20.0
    for i, t in enumerate(times[:-1]):
        now = x[i].copy()
        now[7] = 20.0 if t < 5.0 - 1e-9 else 0.0
        x[i + 1] = forward @ now
    shaft, housing, load = x[:, :3].T
    return {
        "shaft.phi": shaft, "housing.phi": housing, "load.phi": load,
        "shaft.w": x[:, 3], "housing.w": x[:, 4], "load.w": x[:, 5],
        "spring.tau": 1e3 * (x[:, :3] @ twist), "springDamper.phi_rel": housing, "springDamper.w_rel": x[:, 4],
        "multiSensor.w": x[:, 4], "multiSensor.tau": -1e5 * housing - 5 * x[:, 4],
    }  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
def test_elastic_bearing(method: str) -> None:
    times = np.linspace(0.0, 10.0, 401)
    expected = elastic_bearing(times)
    result = run(msl.ElasticBearing(), {"time": times, **expected}, method)
    agree(result, expected)


@pytest.mark.parametrize("method", METHODS)
def test_eddy_current_brake(method: str) -> None:
    def by_hand(t: float, x: np.ndarray) -> list[float]:
        _, w, T = x
        wn = w / (10 * (1 + 3.92e-3 * (T - 293.15)))
        tau = 200 * excitation(t) ** 2 * wn / (1 + wn**2)
        return [w, -tau, tau * w]

    def excitation(t: float) -> float:
        return min(max(10 * (t - 0.1), 0.0), 1.0)

    times = np.linspace(0.0, 1.0, 101)
    x = np.zeros((3, 101))
    x[:, :11] = np.array([20 * times[:11], np.full(11, 20.0), np.full(11, 293.15)])
    for first, last in ((10, 20), (20, 100)):  # from one corner of the ramp to the next
        here = times[first : last + 1]
        x[:, first : last + 1] = solve_ivp(by_hand, here[[0, -1]], x[:, first], "DOP853", here, rtol=1e-12, atol=1e-12).y
    loss = [-by_hand(t, row)[1] * row[1] for t, row in zip(times, x.T, strict=True)]
    expected = {"inertia.phi": x[0], "inertia.w": x[1], "heatCapacitor.T": x[2], "eddyCurrentTorque.loss_power": np.array(loss)}
    result = run(msl.EddyCurrentBrake(), {"time": times, **expected}, method)
    agree(result, expected)
    energy = 0.5 * result["inertia.w"] ** 2 + 1.0 * (result["heatCapacitor.T"] - 293.15)
    assert energy == pytest.approx(np.full(101, 200.0), rel=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_compare_braking_torque(method: str) -> None:
    t = np.linspace(0.0, 5.0, 251)
    slow1, slow4 = 0.99, (100.0**2 - 1.0) / 2e4  # when the speed has come down to w0 = 1
    after1, after4 = np.exp(-100 * np.maximum(t - slow1, 0)), np.exp(-100 * np.maximum(t - slow4, 0))
    expected = {
        "inertia1.w": np.where(t < slow1, 100 - 100 * t, after1),
        "inertia2.w": 100 * np.exp(-t),
        "inertia3.w": 100 / (1 + t),
        "inertia4.w": np.where(t < slow4, np.sqrt(np.maximum(1e4 - 2e4 * t, 1.0)), after4),
        "inertia2.phi": 100 * (1 - np.exp(-t)),
        "inertia3.phi": 100 * np.log1p(t),
    }
    result = run(msl.CompareBrakingTorque(), {"time": t, **expected}, method)
    agree(result, expected)
    assert result.stats["events"] >= 2
