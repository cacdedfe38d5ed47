"""Runs with delays, and what goes on from them: starts that follow from themselves, histories that are carried on, and jumps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, StartError

B = gp.blocks


class Loop(gl.Component):
    """What is late is k times itself and 3: y = k y(t - delay) + 3; and an integral of it."""

    k = gl.Parameter("1", default=0.5)
    T = gl.Parameter("s", "delay", default=0.5)
    shift = gl.Parameter("1", default=3.0)

    def assemble(self) -> list[Any]:
        self.late, self.gain = B.FixedDelay(delay_time=self.T), B.Gain(k=self.k)
        self.sum, self.store = B.Add(u2=self.shift), B.Integrator(start={"y": 0.0})
        return [
            gl.connect(self.late.y, self.gain.u), gl.connect(self.gain.y, self.sum.u1), gl.connect(self.sum.y, self.late.u),
            gl.connect(self.sum.y, self.store.u),
        ]  # fmt: skip


@pytest.fixture(scope="module")
def loop() -> gl.System:
    return gl.compile(Loop())


@pytest.mark.parametrize("k", [0.5, -0.5, 0.6, 0.0, -1.0, 0.65, 2.0, -3.0])
def test_a_start_that_follows_from_itself_settles(loop: gl.System, k: float) -> None:
    """The delay gives at first what it takes: y = k y + 3, which stays so."""
    found = loop.simulate(1.25, samples=6, parameters={"k": k}, method="rk")
    assert found["late.y"] == pytest.approx(np.full(6, 3.0 / (1.0 - k)), rel=1e-9)
    assert found["store.y"] == pytest.approx(3.0 / (1.0 - k) * found.time, rel=1e-6)


def test_a_start_without_a_value_is_refused(loop: gl.System) -> None:
    """y = y + 3."""
    with pytest.raises(
        StartError, match=r"^the signal of late at the start follows from itself: the delay gives at first what it"
    ):
        loop.simulate(1.0, samples=3, parameters={"k": 1.0})


@pytest.mark.parametrize("lags", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_steady_states_and_starts_of_loops_through_several_delays(seed: int, lags: bool) -> None:
    """u = A y + b, with a lag in each loop or none, whatever the gains are: u = y = inverse(1 - A) b."""
    rng = np.random.default_rng(seed)
    A, b = rng.uniform(-3, 3, (3, 3)), rng.uniform(-2, 2, 3)

    class Net(gl.Component):
        def assemble(self) -> list[Any]:
            self.late = [B.FixedDelay(delay_time=T) for T in (0.5, 0.7, 1.1)]
            sums = [sum((A[i, j] * self.late[j].y for j in range(3)), b[i]) for i in range(3)]
            self.sum = [B.FirstOrder(T=0.3, u=u) if lags else B.Gain(k=1.0, u=u) for u in sums]
            return [gl.connect(x.y, late.u) for x, late in zip(self.sum, self.late, strict=True)]

    run = gl.simulate(Net(), 0.4, samples=3, start="steady" if lags else None)
    for k, right in enumerate(np.linalg.solve(np.eye(3) - A, b)):
        assert run[f"late[{k}].y"] == pytest.approx(np.full(3, right), rel=1e-9)


class Returned(gl.Component):
    """An integrator is told what its shaft's speed was, or an approximation of that: w = 3 is a steady state."""

    pade = gl.Structural(False)

    def assemble(self) -> list[gl.Connection]:
        self.body, self.damper, self.ground = gp.Inertia(J=2.0), gp.Damper(d=5.0), gp.Fixed()
        self.late = (B.PadeDelay if self.pade else B.FixedDelay)(delay_time=0.1, u=self.body.w)
        self.controller = B.Integrator(u=3.0 - self.late.y)
        self.torque = gp.Torque(tau=self.controller.y)
        return [
            gl.connect(self.torque.flange, self.body.flange_a, self.damper.flange_a),
            gl.connect(self.damper.flange_b, self.ground.flange),
        ]


def test_a_steady_state_that_a_delay_brings_about_is_refused_with_the_reason() -> None:
    """It exists, and so the reason is not that no speed had an effect; what the message advises finds it."""
    system = gl.compile(Returned(), outputs=["body.w"])
    with pytest.raises(StartError, match=r"^no steady state was found while the outputs of late are held, .* go on from that"):
        system.simulate(1.0, samples=2, start="steady")
    assert system.simulate(60.0, samples=2)["body.w"][-1] == pytest.approx(3.0, abs=1e-5)
    approximated = gl.compile(Returned(pade=True), outputs=["body.w"])
    assert approximated.simulate(1.0, samples=2, start="steady")["body.w"] == pytest.approx(np.full(2, 3.0), rel=1e-9)


def echoes(t: Any, k: float, T: float, jumps: dict[float, float]) -> Any:
    """y after the constant 3 / (1 - k), with the shift set to other values at some times."""

    def at(t: float) -> float:
        if t < 0.0:
            return 3.0 / (1.0 - k)
        shift = [3.0, *(value for time, value in jumps.items() if time <= t + 1e-12)][-1]
        return k * at(t - T + 1e-13) + shift

    return np.array([at(x) for x in t])


def test_a_run_that_goes_on_with_another_shift(loop: gl.System) -> None:
    """The history is that of the run before it; each delay later a jump comes back."""
    first = loop.simulate(1.0, samples=3, method="rk")
    t = np.array([1.0, 1.2, 1.4, 1.6, 1.9, 2.1, 2.4, 2.75])
    second = loop.simulate(2.75, times=t, start=first, parameters={"shift": 4.0}, method="rk")
    assert second["sum.y"] == pytest.approx(echoes(t, 0.5, 0.5, {1.0: 4.0}), rel=1e-6)
    third = loop.simulate(3.4, times=[2.76, 3.1, 3.3], start=second, parameters={"shift": 3.5}, method="rk")
    assert third["sum.y"] == pytest.approx(echoes([2.76, 3.1, 3.3], 0.5, 0.5, {1.0: 4.0, 2.75: 3.5}), rel=1e-6)
    integral = 6.0 * 1.0 + 7.0 * 0.5 + 7.5 * 0.5 + 7.75 * 0.5 + 7.875 * 0.25
    assert second["store.y"][-1] == pytest.approx(integral, rel=1e-6)
    assert second.stats["pieces"] == 4
    assert second.stats["why"].endswith("; cut at the instants of late")


def test_a_longer_delay_needs_the_signal_of_a_run_that_began(loop: gl.System) -> None:
    """It was constant before; a run that itself went on has forgotten what was before its delay."""
    first = loop.simulate(1.0, samples=3, method="rk")
    second = loop.simulate(2.0, times=[1.1, 1.6, 1.9], start=first, parameters={"shift": 4.0, "T": 0.75}, method="rk")
    assert second["sum.y"] == pytest.approx([7.0, 7.0, 7.5], rel=1e-6)
    short = loop.simulate(2.6, times=[2.1, 2.2, 2.4, 2.6], start=second, parameters={"T": 0.25}, method="rk")
    assert short["sum.y"] == pytest.approx([7.75, 7.75, 7.875, 7.9375], rel=1e-6)
    said = r"^the delay of late becomes 0\.8 s, and the run that goes on, itself one that went on, has kept its signal for 0\.75 s;"
    with pytest.raises(ArgumentError, match=said):
        loop.simulate(3.0, start=second, parameters={"T": 0.8})


def test_two_delays_of_one_signal() -> None:
    """A ramp of 2 t, whose both copies come later, each by its own time."""

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.ramp = B.Integrator(u=2.0, start={"y": 0.0})
            self.one, self.other = B.FixedDelay(delay_time=0.3), B.FixedDelay(delay_time=0.7)
            return [gl.connect(self.ramp.y, self.one.u), gl.connect(self.ramp.y, self.other.u)]

    t = np.array([0.0, 0.2, 0.3, 0.6, 0.8, 1.5])
    found = gl.compile(Two()).simulate(1.5, times=t, method="rk")
    assert found["one.y"] == pytest.approx(2.0 * np.maximum(t - 0.3, 0.0), abs=1e-9)
    assert found["other.y"] == pytest.approx(2.0 * np.maximum(t - 0.7, 0.0), abs=1e-9)
    assert found.stats["pieces"] == 5
    with pytest.raises(
        ArgumentError, match=r"^method='exact' does not know the history of one; use method='auto', 'rk' or 'ida'$"
    ):
        gl.compile(Two()).simulate(1.5, method="exact")


def test_a_delay_of_nothing_gives_nothing() -> None:
    """Of a signal that is zero wherever it goes."""
    found = gl.compile(B.FixedDelay(u=0.0, delay_time=0.4)).simulate(1.0, samples=6, method="rk")
    assert found["y"].tolist() == [0.0] * 6


def test_a_start_beside_a_delay_of_nothing() -> None:
    """z = x + y starts at 5, and the delayed y is always zero."""

    class Beside(gl.Component):
        signal, x, z = gl.Variable("any"), gl.Variable("any"), gl.Variable("any", start=5.0)

        def assemble(self) -> list[Any]:
            self.delay = B.FixedDelay(u=self.signal, delay_time=0.4)
            return []

        def equations(self) -> list[Any]:
            return [gl.Eq(self.signal, 0.0), gl.Eq(gl.der(self.x), 0.0), gl.Eq(self.z, self.x + self.delay.y)]

    found = gl.compile(Beside()).simulate(1.0, samples=6, method="rk")
    assert found["x"] == pytest.approx(np.full(6, 5.0))
    assert found["z"] == pytest.approx(np.full(6, 5.0))


class Pulse(gl.Component):
    """The integral of a pulse above one, which comes a second after it was."""

    middle, width = gl.Parameter("s", default=6.5), gl.Parameter("s", default=0.02)

    def assemble(self) -> list[Any]:
        pulse = 1.0 + gl.exp(-(((gl.time - self.middle) / self.width) ** 2))
        self.gain, self.late, self.store = B.Gain(k=1.0, u=pulse), B.FixedDelay(delay_time=1.0), B.Integrator(start={"y": 0.0})
        return [gl.connect(self.gain.y, self.late.u), gl.connect(self.late.y, self.store.u)]


@pytest.mark.parametrize("method", ["rk", "ida"])
@pytest.mark.parametrize("middle", [0.4, 6.5, 13.45, 13.6])
def test_a_late_pulse_is_not_stepped_over(middle: float, method: str) -> None:
    """However long the longest step may be. Nothing changes before it comes; its area is the width times sqrt(pi)."""
    times = [0.0, middle + 0.5, middle + 1.5]
    found = gl.compile(Pulse()).simulate(
        times[-1], parameters={"middle": middle}, times=times, method=method, rtol=1e-8, atol=1e-10
    )
    assert found["store.y"] - found.time == pytest.approx([0.0, 0.0, 0.02 * np.sqrt(np.pi)], rel=1e-5, abs=1e-7)
