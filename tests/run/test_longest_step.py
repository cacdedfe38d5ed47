"""What time drives is not stepped over, however little the states move before."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError

METHODS = ["auto", "rk8", "ida"]


class Pulse(gl.Component):
    """A torque pulse at 5 s on a body, stuck or free."""

    width = gl.Parameter("s", "of the pulse", default=0.05)
    stuck = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.torque, self.body = gp.Torque(tau=3 * gl.exp(-(((gl.time - 5) / self.width) ** 2))), gp.Inertia(J=1.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-1e-9, w_nominal=1.0, torque_direction=False)
        links = [gl.connect(self.torque.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.fan.flange)]
        if self.stuck:
            self.brake = gp.Brake(fn_max=1.0, mu_pos=((0.0, 1.0),), f_normalized=1.0)
            links.append(gl.connect(self.body.flange_b, self.brake.flange_a))
        return links


class Swing(gl.Component):
    """A torque that overcomes friction for a moment, twice in a period."""

    def assemble(self) -> list[Any]:
        self.torque, self.body = gp.Torque(tau=1.05 * gl.sin(10 * gl.time)), gp.Inertia(J=1.0)
        self.friction = gp.BearingFriction(tau_pos=((0.0, 1.0),))
        return [gl.connect(self.torque.flange, self.body.flange_a), gl.connect(self.body.flange_a, self.friction.flange_a)]


@pytest.fixture(scope="module")
def free() -> gl.System:
    return gl.compile(Pulse(), outputs=["body.w"])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("width", [0.05, 0.01])
def test_a_pulse_on_a_body_at_rest(free: gl.System, method: str, width: float) -> None:
    result = free.simulate(10.0, samples=1001, method=method, parameters={"width": width})
    assert result["body.w"][-1] == pytest.approx(3 * width * math.sqrt(math.pi), rel=1e-4)


@pytest.mark.parametrize("method", ["rk8", "ida"])
def test_a_step_limit_that_is_given(free: gl.System, method: str) -> None:
    options: dict[str, Any] = {"times": [0.0, 10.0], "method": method, "parameters": {"width": 0.001}}
    assert abs(free.simulate(10.0, max_step=1.0, **options)["body.w"][-1]) < 1e-6  # stepped over
    assert free.simulate(10.0, max_step=1e-3, **options)["body.w"][-1] == pytest.approx(3e-3 * math.sqrt(math.pi), rel=1e-4)


class Opaque(gl.Component):
    """A torque that is given to a body with a fan, or a pulse whose width cannot be told from its expression."""

    pulse = gl.Structural(False)

    def assemble(self) -> list[Any]:
        tau = {"tau": 3 / (1 + ((gl.time - 5) / 0.05) ** 2)} if self.pulse else {}
        self.torque, self.body = gp.Torque(**tau), gp.Inertia(J=1.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-1e-9, w_nominal=1.0, torque_direction=False)
        return [gl.connect(self.torque.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.fan.flange)]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("component", [Pulse(stuck=True), Swing()])
def test_samples_do_not_change_the_steps(component: gl.Component, method: str) -> None:
    system = gl.compile(component, outputs=["body.w", "body.phi"])
    runs = [system.simulate(10.0, samples=samples, method=method) for samples in (2, 11, 2001)]
    assert len({(r.stats["steps"], tuple(r.events)) for r in runs}) == 1
    assert not any("max_step" in r.stats for r in runs)
    for name in ("body.w", "body.phi"):
        np.testing.assert_array_equal(runs[1][name], runs[2][name][::200])


@pytest.mark.parametrize("method", ["rk8", "ida"])
def test_a_pulse_between_two_samples_is_found(free: gl.System, method: str) -> None:
    found = free.simulate(10.0, samples=2, method=method, parameters={"width": 0.001})["body.w"][-1]
    assert found == pytest.approx(3e-3 * math.sqrt(math.pi), rel=1e-3)


@pytest.mark.parametrize("pulse", [False, True])
def test_what_is_not_known_follows_the_samples_and_says_so(pulse: bool) -> None:
    system = gl.compile(Opaque(pulse=pulse), outputs=["body.w"])
    inputs = None if pulse else {"torque.tau": lambda t: 3 / (1 + ((t - 5) / 0.05) ** 2)}
    run = system.simulate(10.0, samples=1001, inputs=inputs)
    said = "an expression of time" if pulse else "torque.tau: a Python function"
    assert run.stats[
        "max_step"
    ] == f"two sample intervals, because of {said}, whose shortest pulse is not known; give max_step".replace(
        "time, whose", "time whose"
    )
    assert run["body.w"][-1] == pytest.approx(0.3 * math.atan(100), rel=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_a_pulse_on_a_stuck_body(method: str) -> None:
    system = gl.compile(Pulse(stuck=True), outputs=["body.phi"])
    result = system.simulate(10.0, samples=1001, method=method, parameters={"width": 0.1})
    t = np.linspace(4.5, 5.5, 2_000_001)  # by hand: the excess of the torque accelerates, then the brake stops it
    tau = 3 * np.exp(-(((t - 5) / 0.1) ** 2))
    speed = np.cumsum(tau - 1.0) * (t[1] - t[0])
    begin = int(np.argmax(tau > 1.0))
    speed -= speed[begin]
    end = begin + 1 + int(np.argmax(speed[begin + 1 :] <= 0.0))
    assert result["body.phi"][-1] == pytest.approx(speed[begin:end].sum() * (t[1] - t[0]), rel=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_a_release_in_every_half_period(method: str) -> None:
    result = gl.compile(Swing(), outputs=["body.w"]).simulate(10.0, samples=1001, method=method)
    half = np.floor(result.time * 10 / np.pi)
    assert len(set(half[np.abs(result["body.w"]) > 1e-5])) == 32


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.nan, "1", True])
def test_a_limit_that_is_none(free: gl.System, wrong: Any) -> None:
    with pytest.raises(ArgumentError, match=r"max_step is .*expected a positive number of seconds"):
        free.simulate(1.0, max_step=wrong)


class Compared(gl.Component):
    """Counts how often a sine that only a condition contains rises above a state that hardly moves."""

    x, n = gl.Variable("1", start=0.5), gl.Discrete()

    def equations(self) -> list[Any]:
        rises = gl.sin(200 * gl.time) > self.x
        return [gl.Eq(gl.der(self.x), 1e-9 * (1 - self.x**2)), gl.When(rises, gl.Eq(self.n, gl.pre(self.n) + 1))]


@pytest.mark.parametrize("method", ["rk", "ida", "auto"])
def test_a_fast_sine_in_a_condition_is_seen(method: str) -> None:
    """At pi / 6 of each turn: 2000 rad are 318.3 turns."""
    run = gl.compile(Compared()).simulate(10.0, samples=2, method=method)
    assert run["n"][-1] == 319
    assert [t for t, _ in run.events][::2] == pytest.approx((np.pi / 6 + 2 * np.pi * np.arange(319)) / 200, abs=1e-6)
