"""FixedDelay against the method of steps by hand, in all methods; runs that go on, that are stepped, that are refused. PadeDelay."""

from __future__ import annotations

import pickle
from functools import lru_cache
from math import factorial
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from numpy.typing import NDArray

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, GearlibError, ModelicaError, StartError
from gearlib.flatten.flatten import flatten

B = gp.blocks


class Feedback(gl.Component):
    """``der(x) = -x(t - 1)`` from ``x = 1`` before the start."""

    T = gl.Parameter("s", "delay", default=1.0)

    def assemble(self) -> list[gl.Connection]:
        self.x, self.late, self.gain = B.Integrator(start={"y": 1.0}), B.FixedDelay(delay_time=self.T), B.Gain(k=-1.0)
        return [gl.connect(self.x.y, self.late.u), gl.connect(self.late.y, self.gain.u), gl.connect(self.gain.y, self.x.u)]


def by_steps(times: NDArray[np.float64], T: float = 1.0) -> NDArray[np.float64]:
    """The sum of (-1)^k (t - (k - 1) T)^k / k! over the k with (k - 1) T <= t."""
    terms = [[(-1) ** k * (t - (k - 1) * T) ** k / factorial(k) for k in range(int(t / T + 1e-9) + 2)] for t in times]
    return np.array([sum(row) for row in terms])


class Approximated(gl.Component):
    """A delay as a rational function, behind a gain."""

    n = gl.Structural(1)
    m = gl.Structural(None)

    def assemble(self) -> list[gl.Connection]:
        self.gain, self.late = B.Gain(k=1.0), B.PadeDelay(delay_time=0.3, n=self.n, m=self.m)
        return [gl.connect(self.gain.y, self.late.u)]


@pytest.mark.parametrize(("n", "m"), [(1, None), (2, 1), (4, 0), (5, 5), (10, 9)])
def test_pade_is_that_of_control(n: int, m: int | None) -> None:
    linear = gl.compile(Approximated(n=n, m=m)).linearize(inputs=["gain.u"], outputs=["late.y"])
    s = 1j * np.logspace(-1, 3, 30)
    expected = control.tf(*control.pade(0.3, n, m))(s)
    assert np.abs(linear(s) - expected).max() < 1e-12


def test_pade_begins_settled_and_follows_what_is_slow() -> None:
    result = gl.simulate(Approximated(n=4), 2.0, samples=41, rtol=1e-10, inputs={"gain.u": lambda t: 2.0 + np.sin(t) ** 4})
    late = np.maximum(result.time - 0.3, 0.0)
    assert result["late.y"] == pytest.approx(2.0 + np.sin(late) ** 4, abs=2e-3)
    assert gl.simulate(Approximated(n=3), 1.0, samples=3, inputs={"gain.u": 5.0})["late.y"] == pytest.approx(
        [5.0] * 3, rel=1e-9
    )


@pytest.mark.parametrize("n", [0, 21])
def test_pade_has_one_to_twenty_poles(n: int) -> None:
    with pytest.raises(gl.errors.BoundError, match=f"n is {n}; expected 1 to 20"):
        flatten(Approximated(n=n))


@pytest.mark.parametrize("m", [3, -1, 1.0, True])
def test_pade_refuses_more_zeros_than_poles(m: Any) -> None:
    with pytest.raises(gl.errors.BindingError, match=f"m is {m}; expected a whole number from 0 to n = 2"):
        flatten(Approximated(n=2, m=m))


@pytest.fixture(scope="module")
def system() -> gl.System:
    return gl.compile(Feedback())


@pytest.mark.parametrize("method", ["auto", "rk5", "rk8", "ida"])
def test_every_method_gives_the_motion_of_the_method_of_steps(system: gl.System, method: str) -> None:
    r = system.simulate(6.0, samples=61, method=method, rtol=1e-9)
    assert r["x.y"] == pytest.approx(by_steps(r.time), abs=3e-9)
    assert r["late.y"] == pytest.approx(np.where(r.time < 1.0, 1.0, by_steps(np.maximum(r.time - 1.0, 0.0))), abs=3e-9)
    assert r["late.total"] == pytest.approx(by_steps(np.ones(1)) - by_steps(r.time + 1.0), abs=3e-9), "the integral of x"
    assert r.stats["pieces"] == 6


def test_the_delay_is_a_parameter(system: gl.System) -> None:
    r = system.simulate(2.0, samples=21, rtol=1e-9, parameters={"T": 0.3})
    assert r["x.y"] == pytest.approx(by_steps(r.time, 0.3), abs=3e-9)


def test_runs_go_on_with_the_history(system: gl.System) -> None:
    first = system.simulate(2.35, samples=24, rtol=1e-9)
    for start in (first, (first, 1.7), (pickle.loads(pickle.dumps(first)), 2.0)):
        then = system.simulate(5.0, start=start, samples=11, rtol=1e-9)
        assert then["x.y"] == pytest.approx(by_steps(then.time), abs=3e-9)
    assert first.at(1.23)["x.y"] == pytest.approx(by_steps(np.array([1.23])), abs=3e-9)
    assert first["gain.y"] == pytest.approx(-first["late.y"])


class Late(gl.Component):
    """A ramp of 0.2 a second, delayed."""

    def assemble(self) -> list[gl.Connection]:
        self.ramp, self.late = B.Ramp(height=2.0, duration=10.0), B.FixedDelay(delay_time=0.25)
        return [gl.connect(self.ramp.y, self.late.u)]


@pytest.mark.parametrize("delay", [0.1, 0.25, 0.4, 2.0])
def test_a_run_that_goes_on_with_another_delay_reads_the_signal_as_it_was_then(delay: float) -> None:
    system = gl.compile(Late(), outputs=["late.y"])
    first, longer = system.simulate(1.0, samples=3), {"late.delay_time": delay}
    for t in (1.0, 0.6):
        then = system.simulate(2.0, start=(first, t), samples=8, parameters=longer)
        assert then["late.y"] == pytest.approx(0.2 * np.maximum(then.time - delay, 0.0), abs=1e-9)
    run = system.stepper(start=first, parameters=longer)
    run.advance(1.2)
    assert run["late.y"] == pytest.approx(0.2 * max(1.2 - delay, 0.0), abs=1e-9)
    second = system.simulate(1.5, start=first, samples=3)
    if delay <= 0.25:
        again = system.simulate(2.0, start=second, samples=8, parameters=longer)
        assert again["late.y"] == pytest.approx(0.2 * (again.time - delay), abs=1e-9)
    else:
        said = rf"the delay of late becomes {delay:g} s, and the run that goes on, .* has kept its signal for 0\.25 s"
        with pytest.raises(ArgumentError, match=said):
            system.simulate(2.0, start=second, samples=8, parameters=longer)


def test_stepped_runs_keep_it_and_come_back(system: gl.System) -> None:
    run = system.stepper(rtol=1e-9)
    for k in range(1, 18):
        run.advance(0.13 * k)
    state = run.state()
    for _ in range(2):
        for k in range(18, 31):
            run.advance(0.13 * k)
        assert run["x.y"] == pytest.approx(by_steps(np.array([3.9]))[0], abs=3e-9)
        assert run["late.y"] == pytest.approx(by_steps(np.array([2.9]))[0], abs=3e-9)
        run.restore(state)


def test_jumps_and_bends_come_out_as_they_went_in() -> None:
    """A square wave and a triangle through delays of which one is not commensurate; a load that the delayed square drives."""

    class Jumping(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.square, self.line = B.Pulse(period=0.4, start_time=0.1), B.Ramp(height=2.0, duration=0.5, start_time=0.2)
            self.late, self.later = B.FixedDelay(delay_time=0.15), B.FixedDelay(delay_time=0.33)
            self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
            return [
                gl.connect(self.square.y, self.late.u),
                gl.connect(self.line.y, self.later.u),
                gl.connect(self.late.y, self.torque.tau),
                gl.connect(self.torque.flange, self.load.flange_a),
            ]

    for method in ("rk", "ida"):
        r = gl.simulate(Jumping(), 1.5, times=np.linspace(0.0, 1.49, 150) + 1e-3, method=method, rtol=1e-9)
        before = r.time - 0.15 - 0.1
        assert np.array_equal(r["late.y"].round(9), ((before >= 0) & (before % 0.4 < 0.2)).astype(float))
        assert r["later.y"] == pytest.approx(2.0 * np.clip((r.time - 0.33 - 0.2) / 0.5, 0.0, 1.0), abs=1e-8)
        up = np.where(before < 0, 0.0, 0.2 * np.floor(before / 0.4) + np.minimum(before % 0.4, 0.2))
        assert r["load.w"] == pytest.approx(up / 2.0, abs=1e-8)


def test_events_of_the_train_come_through_the_delay() -> None:
    """A bouncing ball's speed jumps at times that only the run knows."""

    class Ball(gl.Component):
        h = gl.Variable("m", "height", start=1.0)
        v = gl.Variable("m/s", "speed", start=0.0)

        def assemble(self) -> list[gl.Connection]:
            self.late = B.FixedDelay(delay_time=0.2, u=self.v)
            return []

        def equations(self) -> list[Any]:
            hit = gl.When(self.h < 0, gl.reinit(self.v, -0.8 * self.v))
            return [gl.Eq(gl.der(self.h), self.v), gl.Eq(gl.der(self.v), -9.81), hit]

    g, hit = 9.81, np.sqrt(2.0 / 9.81)
    r = gl.simulate(Ball(), 1.3, samples=131, rtol=1e-9)
    t = r.time - 0.2
    rebound = 0.8 * g * hit
    second = hit + 2.0 * rebound / g
    expected = np.where(
        t < 0, 0.0, np.where(t < hit, -g * t, np.where(t < second, rebound - g * (t - hit), 0.8 * rebound - g * (t - second)))
    )
    assert r["late.y"] == pytest.approx(expected, abs=1e-7)


def test_a_sampled_controller_reads_a_delayed_signal() -> None:
    class Loop(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.ramp, self.late, self.hold = B.Ramp(duration=1.0), B.FixedDelay(delay_time=0.25), B.Gain(k=1.0)
            self.law = gl.Sampled(lambda t, v: 2.0 * v[0], 0.1, inputs=[self.late.y], outputs=[self.hold.u])
            return [gl.connect(self.ramp.y, self.late.u)]

    r = gl.simulate(Loop(), 1.0, samples=21, rtol=1e-9)
    instants = np.floor(r.time / 0.1 + 1e-9) * 0.1
    assert r["hold.y"] == pytest.approx(2.0 * np.maximum(instants - 0.25, 0.0), abs=1e-9)


def test_signals_that_hold_themselves_at_the_start() -> None:
    """What comes out is what goes in at first: u = (1 + y) / 3 begins with y = 0.5, u = 1 + y with no number."""

    class Held(gl.Component):
        k = gl.Parameter("1", "feedback", default=1.0 / 3.0)

        def assemble(self) -> list[gl.Connection]:
            self.late = B.FixedDelay(delay_time=0.2)
            self.gain = B.Gain(k=self.k, u=1.0 + self.late.y)
            return [gl.connect(self.gain.y, self.late.u)]

    assert gl.simulate(Held(), 1.0, samples=6)["late.y"] == pytest.approx(0.5)
    with pytest.raises(StartError, match=r"signal of late at the start follows from itself"):
        gl.simulate(Held(k=1.0), 1.0)


def test_what_knows_no_history_refuses_by_name(system: gl.System, tmp_path: Path) -> None:
    for analysis in (
        lambda: system.linearize(outputs=["x.y"]),
        lambda: gl.stability(system),
        lambda: system.export_fmu(tmp_path / "late.fmu"),
    ):
        with pytest.raises(GearlibError, match=r"late delays a signal; .*PadeDelay\(delay_time"):
            analysis()
    with pytest.raises(ArgumentError, match="method='exact' does not know the history of late"):
        system.simulate(1.0, method="exact")
    for options in ({"flat": True}, {"standard_library": False}):
        with pytest.raises(ModelicaError, match="late delays a signal"):
            gl.to_modelica(Feedback(), **options)
    with pytest.raises(ArgumentError, match="into more than 1000000 pieces"):
        system.simulate(10.0, parameters={"T": 1e-8})


def test_modelica_has_it_too() -> None:
    again = gl.read_modelica("""
        model Feedback
          Modelica.Blocks.Continuous.Integrator x(y_start = 1);
          Modelica.Blocks.Nonlinear.FixedDelay late(delayTime = 1);
          Modelica.Blocks.Math.Gain gain(k = -1);
        equation
          connect(x.y, late.u);
          connect(late.y, gain.u);
          connect(gain.y, x.u);
        end Feedback;""")
    r = gl.simulate(again(), 2.0, samples=5, rtol=1e-9)
    assert r["x.y"] == pytest.approx(by_steps(r.time), abs=3e-9)
    text = gl.to_modelica(Feedback())
    assert "Modelica.Blocks.Nonlinear.FixedDelay late(delayTime = T" in text
    assert "past" not in text


def test_a_delayed_loop_agrees_with_its_frequency_response() -> None:
    """A sine through a delay of a quarter period: a cosine."""

    class Sine(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.wave, self.late = B.Sine(f=1.0, amplitude=3.0), B.FixedDelay(delay_time=0.25)
            return [gl.connect(self.wave.y, self.late.u)]

    r = gl.simulate(Sine(), 2.0, samples=81, rtol=1e-8)
    assert r["late.y"] == pytest.approx(np.where(r.time < 0.25, 0.0, -3.0 * np.cos(2 * np.pi * r.time)), abs=1e-7)


class Pulses(gl.Component):
    """Pulses through two delays, whose bends come to lie on each other."""

    y = gl.Variable("1", start=0.0)

    def assemble(self) -> list[gl.Connection]:
        self.pulses = B.Pulse(amplitude=2.0, period=0.7, width=30.0)
        self.first, self.second = B.FixedDelay(delay_time=0.25), B.FixedDelay(delay_time=0.4)
        return [gl.connect(self.pulses.y, self.first.u), gl.connect(self.first.y, self.second.u)]

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.y), self.second.y)]


class Echo(gl.Component):
    """A step that comes back every 0.2 s, and never becomes smoother."""

    y, z = gl.Variable("1"), gl.Variable("1", start=0.0)

    def assemble(self) -> list[gl.Connection]:
        self.step, self.late = B.Step(start_time=0.05), B.FixedDelay(delay_time=0.2, u=self.y)
        return []

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.step.y + 0.9 * self.late.y), gl.Eq(gl.der(self.z), self.y)]


def test_jumps_stay_jumps_in_delays_in_series_and_in_loops() -> None:
    pulses = gl.simulate(Pulses(), 5.0, samples=38, rtol=1e-9, method="rk5")
    late = pulses.time - 0.65  # before that, the first one has long been there
    assert pulses["second.y"] == pytest.approx(np.where((late < 0) | (late % 0.7 < 0.21), 2.0, 0.0))
    assert pulses["y"][-1] == pytest.approx(2.0 * (0.65 + 6 * 0.21 + 0.15), abs=1e-6)
    echo = gl.simulate(Echo(), 4.0, samples=41, rtol=1e-9, method="rk5")
    heights = np.cumsum(0.9 ** np.arange(21))
    count = np.floor((echo.time - 0.05) / 0.2 + 1e-9).astype(int)
    assert echo["y"] == pytest.approx(np.where(count < 0, 0.0, heights[count]))
    assert echo["z"][-1] == pytest.approx(0.2 * heights[:19].sum() + 0.15 * heights[19], abs=1e-6)


class Sequel(gl.Component):
    """What a sampler takes goes through a delay of some of its periods to another one."""

    h = gl.Parameter("s", "period", default=0.06)
    delay = gl.Parameter("s", "a multiple of the period", default=0.06)

    def assemble(self) -> list[gl.Connection]:
        self.first = B.Sampler(sample_period=self.h, u=1.0 + gl.time)
        self.late, self.last = B.FixedDelay(delay_time=self.delay), B.Sampler(sample_period=self.h)
        self.read = B.Gain(k=1.0)
        self.law = gl.Sampled(lambda t, v: v[0], 0.06, inputs=[self.late.y], outputs=[self.read.u])
        self.sum = B.Integrator()
        return [
            gl.connect(self.first.y, self.late.u),
            gl.connect(self.late.y, self.last.u),
            gl.connect(self.last.y, self.sum.u),
        ]


@lru_cache
def sequel() -> gl.System:
    return gl.compile(Sequel(), outputs=["first.y", "late.y", "last.y", "read.y", "sum.y"])


@pytest.mark.parametrize("method", ["auto", "ida"])
@pytest.mark.parametrize("periods", [1, 3])
@pytest.mark.parametrize("h", [0.03, 0.06, 0.3])
def test_a_delay_of_whole_periods_comes_in_time_for_the_next_sampler(h: float, periods: int, method: str) -> None:
    """At an instant it gives what was taken that many periods before, whatever rounding makes of the times."""
    n, system = 24, sequel()
    given = {"h": h, "delay": round(h * periods, 9)}
    times = [round(h * k, 9) for k in range(n)]
    taken = 1.0 + h * np.arange(n)
    late = np.concatenate([np.ones(periods), taken[:-periods]])
    total = h * np.cumsum([0.0, *late[:-1]])
    r = system.simulate(times[-1], times=times, method=method, rtol=1e-9, parameters=given)
    for name, values in (("first.y", taken), ("late.y", late), ("last.y", late), ("sum.y", total)):
        assert r[name] == pytest.approx(values, abs=1e-7), name
    if h == 0.06:
        assert r["read.y"] == pytest.approx(late, abs=1e-7)
    half = system.simulate(times[10], times=times[:11], method=method, rtol=1e-9, parameters=given)
    assert system.simulate(times[-1], times=times[10:], start=half, rtol=1e-9)["last.y"] == pytest.approx(late[10:], abs=1e-7)
    run = system.stepper(method=method, rtol=1e-9, parameters=given)
    for k, t in enumerate(times[1:], 1):
        run.advance(t)
        assert [run["late.y"], run["last.y"], run["sum.y"]] == pytest.approx([late[k], late[k], total[k]], abs=1e-7), t
