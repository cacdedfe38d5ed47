"""Nonlinear and sampled blocks, and sources that repeat, in one model, against formulas and loops by hand."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, BoundError
from tests.gearparts.blocks.bench import Driven

B = gp.blocks
H = 0.07  # s, between instants
PID = {"y_min": -0.1, "wp": 0.7, "Ni": 0.6, "Nd": 8.0}


class Everything(gl.Component):
    """One of each, driven by sin(7 t)."""

    def assemble(self) -> list[gl.Connection]:
        u = gl.sin(7 * gl.time)
        self.pulse = B.Pulse(period=0.3, width=40.0, amplitude=2.0, start_time=0.1, n_period=4.0)
        self.trapezoid = B.Trapezoid(period=0.5, rising=0.1, width=0.2, falling=0.1, start_time=0.15, amplitude=3.0)
        self.limiter, self.dead_zone = B.Limiter(y_max=0.5, y_min=-0.3, u=u), B.DeadZone(u_max=0.4, u=u)
        self.rate, self.hysteresis = B.RateLimiter(rising=2.0, falling=-5.0, Td=1e-3), B.Hysteresis(u_low=-0.2, u_high=0.6, u=u)
        self.switch, self.logical = B.Switch(u1=1 * gl.time, u3=-5.0), B.LogicalSwitch(u3=1.0)
        self.sampler, self.delay = B.Sampler(sample_period=H, u=u), B.UnitDelay(sample_period=H, u=u, start={"taken": 9.0})
        self.hold = B.ZeroOrderHold(sample_period=H, start_time=0.02, u=u)
        self.triggered = B.TriggeredSampler(u=1 * gl.time)
        self.pid = B.DiscretePID(sample_period=0.05, k=2.0, Ti=0.3, Td=0.1, y_max=1.0, u_s=1.0, u_m=u, **PID)
        return [
            gl.connect(self.pulse.y, self.rate.u, self.triggered.trigger, self.logical.u1),
            gl.connect(self.hysteresis.y, self.switch.u2, self.logical.u2),
        ]


@lru_cache
def run(method: str = "auto") -> Any:
    return gl.simulate(Everything(), 2.0, samples=401, method=method)


@pytest.mark.parametrize("method", ["auto", "ida"])
def test_every_block_follows_its_law(method: str) -> None:
    r = run(method)
    t = r.time
    u = np.sin(7 * t)
    since = t - 0.1 + 1e-12
    pulse = (since >= 0) & (since % 0.3 < 0.12) & (since < 1.2)
    assert np.array_equal(r["pulse.y"], 2.0 * pulse)
    phase = (t - 0.15 + 1e-12) % 0.5
    assert r["trapezoid.y"] == pytest.approx(
        np.where(t < 0.15 - 1e-12, 0, np.interp(phase, [0, 0.1, 0.3, 0.4], [0, 3, 3, 0])), abs=1e-9
    )
    assert np.array_equal(r["limiter.y"], np.clip(u, -0.3, 0.5))
    assert r["dead_zone.y"] == pytest.approx(np.maximum(u - 0.4, 0) + np.minimum(u + 0.4, 0), abs=1e-15)
    k = np.floor(t / H + 1e-9)
    assert r["sampler.y"] == pytest.approx(np.sin(7 * k * H), abs=1e-14)
    assert r["delay.y"] == pytest.approx(np.where(k > 0, np.sin(7 * (k - 1) * H), 9.0), abs=1e-14)
    k = np.floor((t - 0.02) / H + 1e-9)
    assert r["hold.y"] == pytest.approx(np.where(k >= 0, np.sin(7 * (0.02 + k * H)), 0.0), abs=1e-14)
    k = np.clip(np.floor(since / 0.3), -1, 3)
    assert r["triggered.y"] == pytest.approx(np.where(k >= 0, 0.1 + 0.3 * k, 0.0), abs=1e-14)
    on, states = False, []
    for value in np.sin(7 * np.linspace(0.0, 2.0, 40001)):
        on = bool(value > 0.6 or (on and value >= -0.2))
        states.append(on)
    chosen = np.array(states)[::100]
    assert np.array_equal(r["hysteresis.y"], chosen)
    assert np.array_equal(r["switch.y"], np.where(chosen, t, -5.0))
    assert np.array_equal(r["logical.y"], np.where(chosen, pulse, True))


def test_the_digital_controller_is_the_loop_by_hand() -> None:
    integral = derivative = last = 0.0
    found = []
    for n in range(41):
        measured = np.sin(7 * n * 0.05)
        derivative = (0.1 * derivative - 2.0 * 0.1 * 8.0 * (measured - last if n else 0.0)) / (0.1 + 8.0 * 0.05)
        v = 2.0 * (0.7 * 1.0 - measured) + integral + derivative
        y = min(max(v, -0.1), 1.0)
        integral += 0.05 * (2.0 * (1.0 - measured) / 0.3 + (y - v) / (0.6 * 0.3))
        last = measured
        found.append(y)
    r = run()
    assert {1.0, -0.1} <= set(found)
    assert len(set(found)) > 10
    assert r["pid.y"] == pytest.approx(np.array(found)[np.floor(r.time / 0.05 + 1e-9).astype(int)], abs=1e-12)


def test_a_limited_rate() -> None:
    t, y = run().time, run()["rate.y"]
    inside = (t > 0.1) & (t < 0.21)
    assert y[inside] == pytest.approx(2.0 * (t[inside] - 0.1), abs=1e-5)
    inside = (t > 0.23) & (t < 0.26)
    assert np.diff(y[inside]) == pytest.approx(-5.0 * 0.005, abs=1e-6)


def test_sources_that_repeat_do_so_from_any_start() -> None:
    r = gl.simulate(Everything(), 2.0, t_start=0.31, samples=170, outputs=["trapezoid.y", "pulse.y"])
    phase = (r.time - 0.15 + 1e-12) % 0.5
    assert r["trapezoid.y"] == pytest.approx(np.interp(phase, [0, 0.1, 0.3, 0.4], [0, 3, 3, 0]), abs=1e-9)
    since = r.time - 0.1 + 1e-12
    assert np.array_equal(r["pulse.y"], 2.0 * ((since % 0.3 < 0.12) & (since < 1.2)))


def test_units_fit() -> None:
    assert gl.check_units(Everything()) == []


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: B.Limiter(y_max=1.0, y_min=2.0), r"block\.room is -1; expected at least 0"),
        (lambda: B.Hysteresis(u_low=2.0, u_high=1.0), r"block\.room is -1"),
        (lambda: B.Sampler(sample_period=0.0), r"block\.sample_period is 0; expected at least"),
        (lambda: B.Trapezoid(period=0.3, rising=0.1, width=0.2, falling=0.1), r"block\.pause is -0\.1; expected at least 0"),
        (lambda: B.Pulse(period=0.3, width=140.0), r"block\.width is 140; expected at most 100"),
    ],
)
def test_values_that_are_refused(make: Any, message: str) -> None:
    with pytest.raises(BoundError, match=message):
        gl.compile(Driven(make=make))


def test_a_digital_controller_in_the_loop() -> None:
    class Loop(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.controller = B.DiscretePID(sample_period=0.01, k=4.0, Ti=0.5, y_max=20.0, u_s=10.0)
            self.torque, self.load, self.speed = gp.Torque(), gp.Inertia(J=2.0), gp.SpeedSensor()
            return [
                gl.connect(self.speed.w, self.controller.u_m), gl.connect(self.controller.y, self.torque.tau),
                gl.connect(self.torque.flange, self.load.flange_a, self.speed.flange),
            ]  # fmt: skip

    r = gl.simulate(Loop(), 2.0, samples=201)
    w, integral, speeds = 0.0, 0.0, []
    for _ in range(201):
        speeds.append(w)
        v = 4.0 * (10.0 - w) + integral
        y = min(max(v, -20.0), 20.0)
        integral += 0.01 * (4.0 * (10.0 - w) / 0.5 + (y - v) / (0.9 * 0.5))
        w += 0.01 * y / 2.0
    assert r["load.w"] == pytest.approx(speeds, abs=1e-11)


class Thresholds(gl.Component):
    """Signals that stand at a limit, and beside it, for a second each."""

    def assemble(self) -> list[Any]:
        def levels(*values: float) -> Any:
            return gl.Piecewise(*((v, gl.time < n + 1) for n, v in enumerate(values[:-1])), (values[-1], True))

        u = levels(0.6, 0.61, 0.6, -0.2, -0.21, -0.2, 0.6, 0.7)
        self.hysteresis = B.Hysteresis(u_low=-0.2, u_high=0.6, u=u)
        self.begun = B.Hysteresis(u_low=-0.2, u_high=0.6, u=u, start={"on": 1})
        self.limiter, self.zone = B.Limiter(y_max=0.6, u=u), B.DeadZone(u_max=0.6, u_min=-0.2, u=u)
        two, one, three = levels(0, 0, 0, 0, 1, 1, 1, 0.5), levels(0, 0, 1, 1, 0, 0, 1, 0.6), levels(0, 1, 0, 1, 0, 1, 0, 0.5)
        self.logical, self.switch = B.LogicalSwitch(u1=one, u2=two, u3=three), B.Switch(u1=one, u2=two, u3=three)
        self.slow = B.RateLimiter(Td=0.5, rising=1.0, u=gl.time)
        self.endless, self.none = (B.Pulse(period=2.0, n_period=n, offset=0.25) for n in (-1.0, 0.0))
        self.never, self.always = (B.Pulse(period=2.0, width=w) for w in (0.0, 100.0))
        self.twice = B.Trapezoid(period=2.0, rising=0.5, width=1.0, falling=0.5, n_period=2.0)  # no pause
        return []


def test_at_their_limits_blocks_do_what_their_laws_say() -> None:
    t = np.arange(8) + 0.5
    r = gl.simulate(Thresholds(), 8.0, times=t)
    assert r["hysteresis.y"].tolist() == [0, 1, 1, 1, 0, 0, 0, 1]
    assert r["begun.y"].tolist() == [1, 1, 1, 1, 0, 0, 0, 1]
    assert r["limiter.y"] == pytest.approx([0.6, 0.6, 0.6, -0.2, -0.21, -0.2, 0.6, 0.6], abs=1e-15)
    assert r["zone.y"] == pytest.approx([0, 0.01, 0, 0, -0.01, 0, 0, 0.1], abs=1e-15)
    assert r["logical.y"].tolist() == [0, 1, 0, 1, 0, 0, 1, 0]
    assert r["switch.y"].tolist() == [0, 1, 0, 1, 0, 0, 1, 0.5]
    assert r["slow.y"] == pytest.approx(t - 0.5 * (1 - np.exp(-2 * t)), abs=1e-6)
    assert r["endless.y"].tolist() == [1.25, 0.25] * 4
    assert r["none.y"].tolist() == [0.25] * 8
    assert not r["never.y"].any()
    assert r["always.y"].all()
    assert r["twice.y"] == pytest.approx([1, 1, 1, 1, 0, 0, 0, 0], abs=1e-9)


def test_a_trigger_that_stops_at_one_half_samples_nothing() -> None:
    """Rising means above 0.5: a trigger from 0 to 0.5 at 1 s takes nothing, from 0.5 to 0.75 at 2 s it takes the input."""

    class Triggered(gl.Component):
        def assemble(self) -> list[Any]:
            level = gl.Piecewise((0.0, gl.time < 1.0), (0.5, gl.time < 2.0), (0.75, True))
            self.sampler = B.TriggeredSampler(u=1 * gl.time, trigger=level)
            return []

    result = gl.simulate(Triggered(), 3.0, times=[0.5, 1.5, 2.5])
    assert result["sampler.y"] == pytest.approx([0.0, 0.0, 2.0], abs=1e-12)


class Governed(gl.Component):
    """A body with a drag; a digital controller turns it, or only looks on."""

    acts = gl.Structural(True, "whether the controller drives the body")

    def assemble(self) -> list[gl.Connection]:
        self.controller = B.DiscretePID(sample_period=0.05, k=2.0, Ti=0.3, y_max=20.0, u_s=3.0)
        self.torque = gp.Torque(tau=self.controller.y if self.acts else 4.0)
        self.body, self.drag, self.ground, self.speed = gp.Inertia(J=1.0), gp.Damper(d=2.0), gp.Fixed(), gp.SpeedSensor()
        return [
            gl.connect(self.torque.flange, self.body.flange_a, self.speed.flange),
            gl.connect(self.body.flange_b, self.drag.flange_a),
            gl.connect(self.drag.flange_b, self.ground.flange),
            gl.connect(self.speed.w, self.controller.u_m),
        ]


ANALYSES: dict[str, Any] = {
    "poles": lambda s: s.linearize([], ["body.w"]).poles()[0].real,
    "modes": lambda s: gl.modes(s).decays[0],
    "stability": lambda s: gl.stability(s).eigenvalues[0].real,
    "steady state": lambda s: gl.steady_state(s, ["body.w"])["body.w"],
    "steady run": lambda s: s.simulate(1.0, samples=2, start="steady")["body.w"][-1],
    "power flow": lambda s: s.power_flow()["body.flange_a"].speed,
    "power flow at a speed": lambda s: s.power_flow({"body.w": 2.0}, {"torque.tau": 4.0})["body.flange_a"].speed,
}


@pytest.mark.parametrize("analysis", sorted(ANALYSES))
def test_analyses_refuse_what_acts_at_instants_unless_nothing_depends_on_it(analysis: str) -> None:
    """With its output held for ever the body would seem to be another one, which no controller stabilises."""
    with pytest.raises(
        ArgumentError, match=r"^a .* needs equations that act at all times, and controller acts at single instants"
    ):
        ANALYSES[analysis](gl.compile(Governed()))
    assert abs(ANALYSES[analysis](gl.compile(Governed(acts=False), ["body.w"]))) == pytest.approx(2.0)


def test_a_run_does_not_begin_in_a_steady_state_that_a_python_function_would_leave() -> None:
    class Programmed(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.body, self.drag, self.ground = gp.Torque(), gp.Inertia(J=1.0), gp.Damper(d=2.0), gp.Fixed()
            self.program = gl.Sampled(lambda t, v: 4.0 * (3.0 - v[0]), 0.05, inputs=[self.body.w], outputs=[self.torque.tau])
            return [
                gl.connect(self.torque.flange, self.body.flange_a),
                gl.connect(self.body.flange_b, self.drag.flange_a),
                gl.connect(self.drag.flange_b, self.ground.flange),
            ]

    with pytest.raises(ArgumentError, match=r"^a steady state needs equations, and program is a Python function"):
        gl.compile(Programmed()).simulate(1.0, start="steady")


class Chained(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.hold = B.ZeroOrderHold(sample_period=H, u=gl.cos(7 * gl.time))
        self.one, self.two = B.UnitDelay(sample_period=H), B.UnitDelay(sample_period=H)
        return [gl.connect(self.hold.y, self.one.u), gl.connect(self.one.y, self.two.u)]


@pytest.mark.parametrize("method", ["rk5", "ida"])
def test_delays_behind_a_hold_are_of_one_period(method: str) -> None:
    """The output of the hold changes just after the instant, and that is what the delay takes; another one follows at once."""
    r = gl.simulate(Chained(), 2.0, samples=401, method=method)
    k = np.floor(r.time / H + 1e-9)
    for name, late in (("hold.y", 0), ("one.y", 1), ("two.y", 2)):
        assert r[name] == pytest.approx(np.where(k >= late, np.cos(7 * (k - late) * H), 0.0), abs=1e-14), name
