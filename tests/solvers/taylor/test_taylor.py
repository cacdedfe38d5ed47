"""The Taylor method as a whole: accuracy against closed forms, events, kinks, refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, SolverError


class Oscillator(gl.Component):
    """Two bodies on a shaft: they turn against each other at 30 rad/s, and the torque makes them turn together."""

    def assemble(self) -> list[Any]:
        self.one, self.other = gp.Inertia(J=1.0, start={"w": 3.0}), gp.Inertia(J=1.0, start={"w": -3.0})
        self.shaft, self.torque = gp.Spring(c=450.0, start={"phi_rel": 0.0}), gp.Torque()
        return [
            gl.connect(self.torque.flange, self.one.flange_a), gl.connect(self.one.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.other.flange_a),
        ]  # fmt: skip


OSCILLATOR = gl.compile(Oscillator(), outputs=["one.w", "other.w"])


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
def test_vibration_follows_the_closed_form(rtol: float) -> None:
    result = OSCILLATOR.simulate(10.0, samples=101, method="taylor", rtol=rtol, inputs={"torque.tau": 0.0})
    right = 3.0 * np.cos(30.0 * result.time)
    assert np.abs(result["one.w"] - right).max() < 30 * rtol + 3e-12
    assert (
        result.stats["coefficients"] < 12 * 300
    )  # 300 rad; Runge-Kutta of order 8 takes as many at 1e-6, twice as many at 1e-12


def test_a_smooth_motion_takes_few_steps() -> None:
    """Constant acceleration is a polynomial: one step, exact."""
    result = gl.simulate(
        Rolls(), 5.0, samples=3, method="taylor", start={"w": 0.0, "phi": 0.0}, inputs={"tau": 2.0}, outputs=["phi", "w"]
    )
    np.testing.assert_allclose(result["phi"], [0.0, 6.25, 25.0], rtol=1e-14)
    assert result.stats["steps"] <= 2


class Rolls(gl.Component):
    """A body that a torque accelerates."""

    tau = gl.Input("1", "torque")
    phi = gl.Variable("1", "angle")
    w = gl.Variable("1", "speed")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.phi), self.w), gl.Eq(gl.der(self.w), self.tau)]


class Pulse(gl.Component):
    """A quantity that a short pulse moves, or that follows a sine of time."""

    bell = gl.Structural(True)
    rate = gl.Parameter("1/s", "makes time a number", default=1.0)
    x = gl.Variable("1", "quantity", start=0.0)

    def equations(self) -> list[Any]:
        t = self.rate * gl.time
        return [gl.Eq(gl.der(self.x), gl.exp(-200 * (t - 5) ** 2) if self.bell else gl.sin(2 * t))]


def test_a_pulse_of_time_is_not_jumped_over() -> None:
    """Where nothing moves, all coefficients are zero: the width of the bell limits the steps."""
    result = gl.simulate(Pulse(), 10.0, samples=2, method="taylor")
    assert result["x"][-1] == pytest.approx(math.sqrt(math.pi / 200), rel=1e-5)


def test_sinusoids_of_time_limit_no_step() -> None:
    result = gl.simulate(Pulse(bell=False), 100.0, samples=21, method="taylor", rtol=1e-9)
    np.testing.assert_allclose(result["x"], np.sin(result.time) ** 2, atol=1e-8)
    assert result.stats["steps"] < 60  # half a period would be 64
    assert gl.simulate(Pulse(bell=False), 100.0, samples=2, method="taylor", max_step=0.5).stats["steps"] >= 200


class Slows(gl.Component):
    """A body braked by a fan that turns with it or against it; ``no_event`` hides the kink from the event search."""

    w = gl.Variable("1", "speed", start=2.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.w), -1 - gl.no_event(abs(self.w) * self.w))]


def test_a_kink_that_no_event_announces_is_seen() -> None:
    """w = tan(a - t) until w = 0 at t = a, then -tanh(t - a)."""
    result = gl.simulate(Slows(), 2.0, samples=201, method="taylor", rtol=1e-10)
    a = math.atan(2.0)
    right = np.where(result.time < a, np.tan(a - result.time), -np.tanh(result.time - a))
    np.testing.assert_allclose(result["w"], right, atol=2e-9)


class Ball(gl.Component):
    """A ball that bounces."""

    h = gl.Variable("m", "height", start=1.0)
    v = gl.Variable("m/s", "speed", start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.h), self.v), gl.Eq(gl.der(self.v), -9.81),
            gl.When(self.h < 0, gl.reinit(self.v, -0.8 * self.v)),
        ]  # fmt: skip


def test_events_are_located_on_the_polynomial() -> None:
    result = gl.simulate(Ball(), 1.5, samples=151, method="taylor", rtol=1e-8)
    first = math.sqrt(2 / 9.81)
    times = np.array([t for t, _ in result.events])  # down, and up again at once
    np.testing.assert_allclose(times[np.diff(times, prepend=0.0) > 1e-3][:2], [first, first * 2.6], rtol=1e-13)


def test_backlash_against_runge_kutta() -> None:
    """Contact and flight between teeth: both methods locate the same events."""
    system = gl.compile(Rattles(), outputs=["load.w"])
    start = {"motor.w": 1.0, "load.w": 0.0, "gap.phi_rel": 0.0}
    ours, theirs = (
        system.simulate(2.0, samples=101, method=method, rtol=1e-10, start=start, inputs={"torque.tau": 0.0})
        for method in ("taylor", "rk8")
    )
    assert len(ours.events) == len(theirs.events) > 3
    np.testing.assert_allclose([t for t, _ in ours.events], [t for t, _ in theirs.events], rtol=1e-9)
    np.testing.assert_allclose(ours["load.w"], theirs["load.w"], atol=1e-9)


class Rattles(gl.Component):
    """Two bodies with a gap between them."""

    def assemble(self) -> list[Any]:
        self.motor, self.load, self.torque = gp.Inertia(J=0.1), gp.Inertia(J=0.2), gp.Torque()
        self.gap = gp.ElastoBacklash(c=500.0, d=0.2, b=0.2)
        return [
            gl.connect(self.torque.flange, self.motor.flange_a), gl.connect(self.motor.flange_b, self.gap.flange_a),
            gl.connect(self.gap.flange_b, self.load.flange_a),
        ]  # fmt: skip


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (gl.Table([0.0, 1.0], [0.0, 1.0]), "torque.tau is a table"), (math.sin, "torque.tau is a Python function"),
    ],
)  # fmt: skip
def test_inputs_without_a_series_are_refused(given: Any, reason: str) -> None:
    with pytest.raises(ArgumentError, match=f"method='taylor' needs inputs with a Taylor series: {reason}; use method='auto'"):
        OSCILLATOR.simulate(1.0, method="taylor", inputs={"torque.tau": given})


def test_a_pole_ends_the_run() -> None:
    class Blows(gl.Component):
        """x = 1 / (1 - t)."""

        x = gl.Variable("1", "quantity", start=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), self.x**2)]

    with pytest.raises(SolverError, match=r"at t = (0\.999|1)"):
        gl.simulate(Blows(), 2.0, method="taylor")


def test_a_root_of_zero_ends_the_run_with_advice() -> None:
    class Starts(gl.Component):
        """Torricelli's law, filled from empty."""

        x = gl.Variable("1", "level", start=0.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), 1 - gl.sqrt(self.x))]

    with pytest.raises(SolverError, match=r"Taylor coefficients are not finite at t = 0 s .*use method='rk'"):
        gl.simulate(Starts(), 1.0, method="taylor")


@pytest.mark.parametrize("method", ["taylor", "auto"])
def test_a_run_does_not_creep_past_a_branch_point(method: str) -> None:
    """x' = -1 - sqrt(x) ends at t = 2 - 2 ln 2 = 0.6137, where all terms of the series lie below the tolerance."""

    class Draining(gl.Component):
        x = gl.Variable("1", start=1.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), -1.0 - gl.sqrt(self.x))]

    with pytest.raises(SolverError, match=r"at t = 0\.61370\d* s .* der\(x\) is nan there"):
        gl.simulate(Draining(), 0.614, samples=3, method=method)


def test_a_stepped_run_equals_a_whole_one() -> None:
    run = OSCILLATOR.stepper(method="taylor", rtol=1e-10, inputs={"torque.tau": 1.0})
    for t in np.linspace(0.1, 1.0, 10):
        run.advance(float(t))
    whole = OSCILLATOR.simulate(1.0, samples=2, method="taylor", rtol=1e-10, inputs={"torque.tau": 1.0})
    assert abs(run["one.w"] - whole["one.w"][-1]) < 1e-8


class Counted(gl.Component):
    """1 / (1 + t), and two counters."""

    x = gl.Variable("1", "level", start=1.0)
    thirds, halves = gl.Discrete("of 0.3 s"), gl.Discrete("of 0.5 s")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), -(self.x**2)),
            gl.When(gl.sample(0.3, 0.3), gl.Eq(self.thirds, gl.pre(self.thirds) + 1)),
            gl.When(gl.sample(0.5, 0.5), gl.Eq(self.halves, gl.pre(self.halves) + 1)),
        ]


@pytest.mark.parametrize("method", ["taylor", "rk5", "rk8", "ida", "auto"])
def test_instants_may_differ_by_rounding(method: str) -> None:
    """0.3 + 9 * 0.3 is a rounding below 3: the step between the two instants is short, but not because the motion is rough."""
    run = gl.simulate(Counted(), 4.0, times=[0.0, 3.0, 4.0], method=method, rtol=1e-9)
    np.testing.assert_allclose(run["x"], [1.0, 0.25, 0.2], rtol=1e-7)
    np.testing.assert_array_equal((run["thirds"], run["halves"]), ([0, 10, 13], [0, 6, 8]))


class Swings(gl.Component):
    """cos(30 t), which is above 0.9995 for a hundredth of each period."""

    rate = gl.Parameter("1/s", "makes speeds numbers", default=30.0)
    x = gl.Variable("1", "deflection", start=1.0)
    v = gl.Variable("1", "speed", start=0.0)
    n = gl.Discrete("number of times that it came above")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.rate * self.v), gl.Eq(gl.der(self.v), -self.rate * self.x),
            gl.When(self.x > 0.9995, gl.Eq(self.n, gl.pre(self.n) + 1)),
        ]  # fmt: skip


@pytest.mark.parametrize("rtol", [1e-4, 1e-8])
def test_a_short_visit_within_a_step_is_not_missed(rtol: float) -> None:
    result = gl.simulate(Swings(), 10.0, samples=2, method="taylor", rtol=rtol, max_step=1.0)
    assert result["n"][-1] == 47.0  # 300 rad


class Visits(gl.Component):
    """cos(t), and the integral of a function of it, which acts on nothing."""

    of, limit = gl.Structural(0), gl.Structural(0.96)
    rate = gl.Parameter("1/s", "makes speeds numbers", default=1.0)
    x = gl.Variable("1", "deflection", start=1.0)
    v = gl.Variable("1", "speed", start=0.0)
    y = gl.Variable("1", "integral", start=0.0)

    def equations(self) -> list[Any]:
        above = self.x - self.limit
        function = (
            gl.tanh(1e4 * above),
            above / gl.sqrt(above**2 + 1e-8),
            gl.no_event(gl.Max(above, 0)),
            gl.Table([-2, self.limit, 2], [0, 0, 2 - self.limit])(self.x),
            gl.no_event(gl.Piecewise((1.0, above > 0), (0.0, True))),
        )[self.of]
        return [
            gl.Eq(gl.der(self.x), self.rate * self.v), gl.Eq(gl.der(self.v), -self.rate * self.x),
            gl.Eq(gl.der(self.y), self.rate * function),
        ]  # fmt: skip


@pytest.mark.parametrize("of", range(4))
@pytest.mark.parametrize("method", ["taylor", "auto"])
def test_what_a_function_does_within_a_step_is_seen(method: str, of: int) -> None:
    """It changes for a twelfth of each period, where the coefficients at the ends of the steps do not show it."""
    a, periods = math.acos(0.96), 5
    right = 4 * a - math.tau if of < 2 else 2 * (math.sin(a) - 0.96 * a)
    for rtol in (1e-3, 1e-6):
        run = gl.simulate(Visits(of=of), periods * math.tau, samples=2, method=method, rtol=rtol)
        assert run["y"][-1] == pytest.approx(periods * right, abs=50 * rtol * (1 + periods * abs(right))), run.stats


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_a_glimpse_of_another_expression_is_seen(rtol: float) -> None:
    """A two hundredth of each period; the error of its time is that of x over the slope of x at the crossings."""
    run = gl.simulate(Visits(of=4, limit=0.9999), 10.5 * math.tau, samples=2, method="taylor", rtol=rtol)
    assert run["y"][-1] == pytest.approx(21 * math.acos(0.9999), rel=1e3 * rtol), run.stats
    assert run.stats["rhs"] < 100  # the coefficients show it


class Passes(gl.Component):
    """cos(t), counted where it is above 0.9995, and cos(t - a), cos(t - a / 2), which are so a little later."""

    rate = gl.Parameter("1/s", "makes speeds numbers", default=1.0)
    a = gl.Parameter("1")
    x = gl.Variable("1", "deflection", start=1.0)
    v = gl.Variable("1", "speed", start=0.0)
    n, late, between = gl.Discrete("passes"), gl.Discrete("later ones"), gl.Discrete("those between")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.rate * self.v), gl.Eq(gl.der(self.v), -self.rate * self.x),
            *(
                gl.When(self.x * gl.cos(lag) - self.v * gl.sin(lag) > 0.9995, gl.Eq(count, gl.pre(count) + 1))
                for count, lag in ((self.n, 0.0), (self.late, self.a), (self.between, self.a / 2))
            ),
        ]  # fmt: skip


@pytest.mark.parametrize(("method", "a"), [("taylor", 0.2), ("rk8", 0.35)])
def test_of_several_short_visits_within_a_step_the_first_is_taken(method: str, a: float) -> None:
    result = gl.simulate(Passes(a=a), 200.0, samples=2, method=method, rtol=1e-7)
    assert [result[name][-1] for name in ("n", "late", "between")] == [
        31.0,
        32.0,
        32.0,
    ]  # 31.8 turns, of which n begins within one


def test_a_decay_of_any_rate_has_its_series() -> None:
    """Coefficients of order 30 overflow for a rate of 1e12 /s: fewer are used."""

    class Damped(gl.Component):
        """A decay so fast that it is over at once."""

        rate = gl.Parameter("1/s", "rate", default=1e12)
        x = gl.Variable("1", "quantity", start=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), -self.rate * (self.x + gl.no_event(abs(self.x) * self.x)))]

    result = gl.simulate(Damped(), 1e-9, samples=5, method="taylor")
    np.testing.assert_allclose(result["x"][1:], 0.0, atol=1e-5)


class Ceiling(gl.Component):
    """A ball that is pressed against a ceiling, from which it bounces without loss."""

    H = gl.Parameter("m", "height of the ceiling")
    h = gl.Variable("m", "height")
    v = gl.Variable("m/s", "speed", start=-0.02)
    bounces = gl.Discrete("how often it touched the ceiling")

    def equations(self) -> list[Any]:
        touched = gl.When(self.h > self.H, gl.reinit(self.v, -self.v), gl.Eq(self.bounces, gl.pre(self.bounces) + 1))
        return [gl.Eq(gl.der(self.h), self.v), gl.Eq(gl.der(self.v), 9.0), touched]


@pytest.mark.parametrize("method", ["auto", "rk5", "ida"])
@pytest.mark.parametrize("height", [10.0, 1000.0])
def test_short_flights_far_from_zero_are_seen(height: float, method: str) -> None:
    """A flight lasts 2 * 0.02 / 9 s, a fraction of the longest step; beside the height its first part is lost in rounding."""
    r = gl.simulate(Ceiling(H=height, start={"h": height}), 1.0, times=[0.0, 0.25, 1.0], method=method, rtol=1e-9)
    left = 0.25 - 56 * 0.04 / 9.0
    assert r["bounces"][1] == 56.0
    assert r["h"][1] - height == pytest.approx(-0.02 * left + 4.5 * left**2, abs=1e-9)
    assert r["bounces"][2] in (224.0, 225.0)  # the last one is at the end
    assert r["h"].max() - height < 1e-9


class Powered(gl.Component):
    """The integral of a power of a sine."""

    power = gl.Structural(6)
    f, second = gl.Parameter("Hz", default=50.0), gl.Parameter("s", default=1.0)
    x = gl.Variable("1", start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.second * gl.der(self.x), gl.sin(2 * gl.pi * self.f * gl.time) ** self.power)]


@pytest.mark.parametrize("power", [4, 6, 8, 20])
@pytest.mark.parametrize("f", [1.0, 50.0])
def test_powers_of_a_sine_are_seen_where_their_low_coefficients_vanish(power: int, f: float) -> None:
    """At the start they are zero, and so is the right-hand side at the end of each second. The mean is binomial."""
    r = gl.compile(Powered(power=power)).simulate(2.0, samples=3, method="taylor", parameters={"f": f}, rtol=1e-8)
    assert r["x"] == pytest.approx(math.comb(power, power // 2) / 2**power * r.time, abs=1e-5)
