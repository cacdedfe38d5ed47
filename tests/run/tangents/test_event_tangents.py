"""Sensitivities through events: tangents jump where the time of an event, or what it does, depends on the parameter."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, SolverError
from tests.benchmarks.equations import BacklashPair
from tests.run.tangents.other_runs import against_other_runs, off

c = gl.connect
METHODS = ["rk5", "rk8", "ida"]


class Switched(gl.Component):
    """x' = a from the time t_0 on."""

    a = gl.Parameter("1/s", default=2.0)
    t_0 = gl.Parameter("s", default=0.5)
    x = gl.Variable("1", start=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), gl.Piecewise((self.a, gl.time >= self.t_0), (0.0, True)))]


@pytest.mark.parametrize("method", METHODS)
def test_of_the_time_of_a_switch(method: str) -> None:
    run = gl.compile(Switched()).simulate(1.2, samples=7, rtol=1e-9, method=method, sensitivities=["t_0", "a", "start(x)"])
    late = run.time > 0.5
    assert np.allclose(run.sensitivity("x", "t_0"), np.where(late, -2.0, 0.0), atol=1e-12)
    assert np.allclose(run.sensitivity("x", "a"), np.maximum(run.time - 0.5, 0.0), atol=1e-9)
    assert np.allclose(run.sensitivity("x", "start(x)"), 1.0)


class Set(gl.Component):
    """x' = d, which an event sets to a parameter that nothing else depends on."""

    p, x, d = gl.Parameter("1/s", default=2.0), gl.Variable("1", start=0.0), gl.Discrete(start=1.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.d), gl.When(gl.time >= 0.5, gl.Eq(self.d, self.p))]


@pytest.mark.parametrize("method", METHODS)
def test_of_a_parameter_that_an_event_hands_over(method: str) -> None:
    run = gl.compile(Set()).simulate(1.2, samples=7, method=method, sensitivities=["p"])
    assert run["x"] == pytest.approx(run.time + np.maximum(run.time - 0.5, 0.0), abs=1e-9)
    assert run.sensitivity("x", "p") == pytest.approx(np.maximum(run.time - 0.5, 0.0), abs=1e-9)


class Followed(gl.Component):
    """x grows twice as fast while an input is above a limit."""

    u, limit = gl.Input("1"), gl.Parameter("1", default=0.3)
    rate = gl.Parameter("1/s", default=1.0)
    x = gl.Variable("1", start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.rate * gl.Piecewise((2.0, self.u > self.limit), (1.0, True)))]


FOLLOWED = gl.compile(Followed())


@pytest.mark.parametrize("begin", [0.0, 1e4])
def test_of_the_time_at_which_an_input_passes_a_limit(begin: float) -> None:
    """That is -1 / (du/dt) later: of 50 Hz, long after time zero too; where the input jumps, no limit moves the time."""
    w, points = 100 * np.pi, np.linspace(-1e-4, 9e-3, 92)

    def found(u: Any) -> Any:
        run = FOLLOWED.simulate(begin + 0.008, t_start=begin, samples=2, inputs={"u": u}, sensitivities=["limit"], rtol=1e-7)
        return run.sensitivity("x", "limit")[-1]

    assert found(lambda t: np.sin(w * (t - begin))) == pytest.approx(-1 / (w * np.sqrt(1 - 0.3**2)), rel=1e-5)
    piece = np.searchsorted(np.sin(w * points[:50]), 0.3)
    chord = np.diff(np.sin(w * points))[piece - 1] / np.diff(points)[piece - 1]
    assert found(gl.Table(begin + points, np.sin(w * points))) == pytest.approx(-1 / chord, rel=1e-5)
    for step in (lambda t: 1.0 if t > begin + 0.003 else -1.0, gl.Table(begin + np.array([0, 3e-3, 3e-3, 1]), [-1, -1, 1, 1])):
        assert found(step) == pytest.approx(0.0, abs=1e-6)


class Ball(gl.Component):
    """Falls on a floor at h = 0, bounces with the restitution e, and remembers how fast it came."""

    e = gl.Parameter("1", "restitution", default=0.8)
    g = gl.Parameter("m/s2", "gravity", default=9.81)
    h = gl.Variable("m", "height", start=1.0)
    v = gl.Variable("m/s", "speed", start=0.0)
    above = gl.Variable("m/s", "speed above the last impact's")
    impact = gl.Discrete("speed of the last impact")
    bounces = gl.Discrete("how often it touched the floor")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.h), self.v),
            gl.Eq(gl.der(self.v), -self.g),
            gl.Eq(self.above, self.v - self.impact),
            gl.When(
                self.h < 0,
                gl.reinit(self.v, -self.e * self.v),
                gl.Eq(self.impact, self.v),
                gl.Eq(self.bounces, gl.pre(self.bounces) + 1),
            ),
        ]


def bounced(t: Any, h: float, e: float, g: float) -> Any:
    """Height and speed between the first impact and the second."""
    first = np.sqrt(2 * h / g)
    up = e * np.sqrt(2 * g * h)
    return up * (t - first) - g * (t - first) ** 2 / 2, up - g * (t - first)


@pytest.mark.parametrize("method", METHODS)
def test_of_a_ball_that_bounces(method: str) -> None:
    run = gl.compile(Ball()).simulate(
        0.9, times=[0.5, 0.7, 0.9], rtol=1e-9, method=method, sensitivities=["e", "g", "start(h)"]
    )
    at, tiny = [1.0, 0.8, 9.81], 1e-200
    for place, name in enumerate(["start(h)", "e", "g"]):
        numbers = [complex(x, tiny * (place == k)) for k, x in enumerate(at)]
        h, v = bounced(run.time, *numbers)
        assert off(run.sensitivity("h", name), h.imag / tiny) < 1e-7
        assert off(run.sensitivity("v", name), v.imag / tiny) < 1e-7
        speed = -np.sqrt(2 * numbers[2] * numbers[0])
        if name != "e":
            assert off(run.sensitivity("above", name), (v - speed).imag / tiny) < 1e-7


def test_through_many_bounces() -> None:
    run = against_other_runs(gl.compile(Ball()), ["e", "g", "start(h)"], ["h", "v", "above"], 1.5, step=1e-4)
    assert run.stats["events"] == 4


class Heated(gl.Component):
    """Two-point control, with values that are held: the time and a state when it was switched off last."""

    low, high = gl.Parameter("1", default=1.0), gl.Parameter("1", default=2.0)
    k, power = gl.Parameter("1/s", default=1.0), gl.Parameter("1/s", default=3.0)
    x, y = gl.Variable("1", start=0.5), gl.Variable("1", start=0.0)
    on, held = gl.Discrete("on", start=1.0), gl.Discrete("what was held")

    def equations(self) -> list[Any]:
        switch = gl.Piecewise((0.0, self.x > self.high), (1.0, self.x < self.low), (gl.pre(self.on), True))
        return [
            gl.Eq(gl.der(self.x), -self.k * self.x + self.power * self.on),
            gl.Eq(gl.der(self.y), self.k * (self.held - self.y)),
            gl.Eq(self.on, switch),
            gl.When(self.x > self.high, gl.Eq(self.held, gl.time * self.k + self.y)),
        ]


@pytest.mark.parametrize("method", METHODS)
def test_of_what_discrete_variables_hold(method: str) -> None:
    names = ["low", "high", "k", "power", "start(x)"]
    run = against_other_runs(gl.compile(Heated()), names, ["x", "y"], 3.0, by=method, step=1e-4)
    assert run.stats["events"] > 10


@pytest.mark.parametrize("by", ["auto", "ida"])
def test_through_contacts(by: str) -> None:
    """The gear pair M3 of the benchmarks, which loses contact some fifty times."""
    system = gl.compile(BacklashPair(start={"w_1": 800.0, "w_2": 400.0}), outputs=["w_1", "F"])
    run = against_other_runs(system, ["k", "d", "b", "J_1", "r_1"], ["w_1", "F"], 0.01, by=by, step=3e-5)
    assert run.stats["events"] > 40


class Shift(gl.Component):
    """A planetary set that is shifted from a brake to a clutch, as Modelica's SimpleGearShift."""

    t_shift = gl.Parameter("s", default=2.03)
    torque = gl.Parameter("N.m", default=20.0)

    def assemble(self) -> list[Any]:
        t = gl.time
        ramp = gl.Piecewise((0.0, t < self.t_shift), ((t - self.t_shift) / 0.1, t < self.t_shift + 0.1), (1.0, True))
        self.drive = gp.Torque(tau=gl.Piecewise((self.torque, t >= 0.5), (0.0, True)))
        self.engine, self.load = gp.Inertia(J=1), gp.Inertia(J=10, start={"phi": 0, "w": 0})
        self.planetary = gp.IdealPlanetary(ratio=1.5)
        self.clutch = gp.Clutch(cgeo=2, fn_max=100, f_normalized=ramp, start={"phi_rel": 0, "w_rel": 0})
        self.brake = gp.Brake(cgeo=2, fn_max=100, f_normalized=1 - ramp)
        self.drag = gp.QuadraticSpeedDependentTorque(tau_nominal=-20, w_nominal=10.5)
        return [
            c(self.drive.flange, self.engine.flange_a), c(self.engine.flange_b, self.planetary.sun),
            c(self.engine.flange_b, self.clutch.flange_a), c(self.planetary.ring, self.clutch.flange_b),
            c(self.planetary.ring, self.brake.flange_a), c(self.planetary.carrier, self.load.flange_a),
            c(self.load.flange_b, self.drag.flange),
        ]  # fmt: skip


def test_through_a_clutch_shift() -> None:
    names = ["t_shift", "engine.J", "planetary.ratio", "clutch.fn_max"]
    run = against_other_runs(gl.compile(Shift()), names, ["load.w", "engine.w", "clutch.tau"], 4.0, samples=9)
    assert run.stats["events"] >= 6


def test_the_tangent_of_a_speed_vanishes_where_a_brake_holds_it() -> None:
    class Braked(gl.Component):
        def assemble(self) -> list[Any]:
            self.wheel, self.brake = gp.Inertia(J=2.0, start={"w": 3.0}), gp.Brake(fn_max=10.0, f_normalized=1.0)
            return [c(self.wheel.flange_b, self.brake.flange_a)]

    system = gl.compile(Braked(), outputs=["wheel.w", "wheel.phi"])
    run = system.simulate(2.0, samples=21, rtol=1e-9, sensitivities=["wheel.J", "start(wheel.w)"])
    stopped = 2.0 * 3.0 / 5.0  # mue = 0.5
    for name, turned, slowing in (("wheel.J", 3.0**2 / 10.0, 2.5 / 2.0), ("start(wheel.w)", 2.0 * 3.0 / 5.0, 1.0)):
        late = run.time > stopped
        assert abs(run.sensitivity("wheel.w", name)[late]).max() < 1e-9
        right = run.time * slowing if name == "wheel.J" else np.full(21, slowing)
        assert np.allclose(run.sensitivity("wheel.w", name)[~late], right[~late], atol=1e-8)
        assert np.allclose(run.sensitivity("wheel.phi", name)[late], turned, atol=1e-7)


def test_of_an_event_that_ends_a_motion() -> None:
    class Ending(gl.Component):
        a = gl.Parameter("1", default=1.0)
        k = gl.Parameter("1/s", default=1.0)
        x, y = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0)

        def equations(self) -> list[gl.Eq]:
            inside = self.k * gl.Piecewise((1.0, self.x < self.a), (0.0, True))
            return [gl.Eq(gl.der(self.x), inside), gl.Eq(gl.der(self.y), inside)]

    run = gl.compile(Ending()).simulate(3.0, samples=4, rtol=1e-9, sensitivities=["a", "k"])
    assert np.allclose(run.sensitivity("y", "a"), [0.0, 1.0, 1.0, 1.0], atol=1e-9)  # x stays at a
    assert np.allclose(run.sensitivity("y", "k")[2:], 0.0, atol=1e-9)


def test_states_that_end_on_the_way_are_refused() -> None:
    class Pendulum(gl.Component):
        """A point on a circle, in Cartesian coordinates."""

        length = gl.Parameter("m", default=1.0)
        x, y = gl.Variable("m", start=0.6), gl.Variable("m")
        vx, vy = gl.Variable("m/s"), gl.Variable("m/s")
        F = gl.Variable("N/(kg.m)")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), self.vx),
                gl.Eq(gl.der(self.y), self.vy),
                gl.Eq(gl.der(self.vx), -self.F * self.x),
                gl.Eq(gl.der(self.vy), -self.F * self.y - 9.81),
                gl.Eq(self.x**2 + self.y**2, self.length**2),
            ]

    system = gl.compile(Pendulum(guess={"y": -0.8}))
    if "x" not in system.states:
        pytest.fail(f"the states are {system.states}")
    with pytest.raises(SolverError, match="there are no sensitivities after t ="):
        system.simulate(20.0, samples=3, start={"vx": 8.0}, sensitivities=["length"])


class Engaged(gl.Component):
    """Two bodies and a clutch, which holds unless they start at different speeds; a load."""

    w = gl.Parameter("rad/s", "speed of the load at the start", default=5.0)
    press = gl.Parameter("1", "of the clutch", default=1.0)

    def assemble(self) -> list[Any]:
        self.motor, self.load = gp.Inertia(J=0.2, start={"w": 5.0}), gp.Inertia(J=0.3, start={"w": self.w})
        self.clutch = gp.Clutch(fn_max=8.0, f_normalized=self.press)
        self.fan, self.ground = gp.Damper(d=0.1), gp.Fixed()
        return [
            c(self.motor.flange_b, self.clutch.flange_a), c(self.clutch.flange_b, self.load.flange_a),
            c(self.load.flange_b, self.fan.flange_a), c(self.fan.flange_b, self.ground.flange),
        ]  # fmt: skip


def test_a_start_that_moves_what_sticks_is_refused() -> None:
    """It would slide for a moment; beginning with a slip, or where both sides move together, there is a tangent."""
    system = gl.compile(Engaged(), outputs=["motor.w", "load.w", "clutch.w_rel"])
    for name in ("start(motor.w)", "w"):
        with pytest.raises(
            ArgumentError, match=rf"^sensitivities names '{re.escape(name)}', which moves .* where something sticks"
        ):
            system.simulate(1.0, sensitivities=["load.J", name])
    sliding = system.simulate(1.0, samples=3, rtol=1e-10, parameters={"w": 4.0}, sensitivities=["w"])
    near = [system.simulate(1.0, samples=3, rtol=1e-11, parameters={"w": 4.0 + d})["motor.w"] for d in (-1e-4, 1e-4)]
    assert sliding.sensitivity("motor.w", "w") == pytest.approx((near[1] - near[0]) / 2e-4, abs=1e-6)
    assert system.simulate(1.0, parameters={"press": 0.0}, sensitivities=["w"]).sensitivity("clutch.w_rel", "w")[0] == 1.0


class SampledFeedback(gl.Component):
    """``x' = 2 h``; the controller ``h = k (5 - x)`` acts at instants, the first of them the start, or at the start alone."""

    k = gl.Parameter("1", default=4.0)
    x = gl.Variable("1", start=0.0)
    h = gl.Discrete("held")
    again = gl.Structural(True, "whether it acts more than once")

    def equations(self) -> list[Any]:
        instant = gl.sample(0.02) if self.again else gl.Or(gl.initial(), self.x > 100.0)
        return [gl.Eq(gl.der(self.x), 2 * self.h), gl.When(instant, gl.Eq(self.h, self.k * (5 - self.x)))]


@pytest.mark.parametrize("method", ["auto", "ida"])
def test_what_is_set_at_the_start_has_tangents(method: str) -> None:
    run = gl.simulate(SampledFeedback(), 0.2, samples=11, method=method, rtol=1e-9, sensitivities=["k"])
    n = np.arange(11)
    assert run["x"] == pytest.approx(5 * (1 - (1 - 0.16) ** n), abs=1e-8)
    assert run.sensitivity("x", "k") == pytest.approx(5 * n * 0.04 * (1 - 0.16) ** (n - 1.0), abs=1e-8)
    once = gl.simulate(SampledFeedback(again=False), 0.2, samples=11, method=method, rtol=1e-9, sensitivities=["k"])
    assert once.sensitivity("x", "k") == pytest.approx(10.0 * once.time, abs=1e-8)


@pytest.mark.parametrize("begin", [2.0, -2.0])
def test_functions_of_inputs_are_asked_after_the_start_only(begin: float) -> None:
    """u passes the limit 0.3 s after the start, at 1 per second; x grows twice as fast from there on."""
    asked: list[float] = []

    def u(t: float) -> float:
        asked.append(t)
        return t - begin

    run = FOLLOWED.simulate(begin + 1.0, t_start=begin, samples=2, inputs={"u": u}, sensitivities=["limit", "rate"])
    assert min(asked) == begin
    assert run.sensitivity("x", "limit")[-1] == pytest.approx(-1.0, rel=1e-7)
    assert run.sensitivity("x", "rate")[-1] == pytest.approx(1.7, rel=1e-7)


class Pulses(gl.Component):
    """x' is a pulse's height for a part of each period, y' a value of time at the beginning of the period."""

    period, width = gl.Parameter("s", default=0.4), gl.Parameter("1", default=30.0)
    begin = gl.Parameter("s", default=0.05)

    def assemble(self) -> list[gl.Connection]:
        self.pulse = gp.blocks.Pulse(amplitude=2.0, period=self.period, width=self.width, start_time=self.begin)
        self.held = gp.blocks.Sampler(sample_period=self.period, start_time=self.begin, u=3.0 * gl.time)
        self.x, self.y = gp.blocks.Integrator(u=self.pulse.y), gp.blocks.Integrator(u=self.held.y)
        return []


@pytest.mark.parametrize("method", METHODS)
def test_of_what_moves_instants(method: str) -> None:
    """By hand, in the k-th period; ``since`` is the time from its beginning on."""
    T, w, b, t = 0.4, 0.3, 0.05, np.array([0.0, 0.1, 0.3, 0.5, 0.9, 1.2])
    run = gl.simulate(Pulses(), 1.2, times=t, method=method, sensitivities=["period", "width", "begin"], rtol=1e-9)
    k = np.maximum(np.floor((t - b) / T), 0.0)
    since, begun = t - b - k * T, t > b
    on = since < w * T  # x = 2 (k w T + since), behind the pulse 2 (k + 1) w T
    assert run.sensitivity("x.y", "period") == pytest.approx(begun * np.where(on, 2 * k * (w - 1), 2 * (k + 1) * w), abs=1e-9)
    assert run.sensitivity("x.y", "width") == pytest.approx(begun * 0.02 * T * np.where(on, k, k + 1), abs=1e-9)
    assert run.sensitivity("x.y", "begin") == pytest.approx(begun * np.where(on, -2.0, 0.0), abs=1e-9)
    # held = 3 (b + k T), and y the sum of its steps
    assert run.sensitivity("held.y", "period") == pytest.approx(3 * k, abs=1e-9)
    assert run.sensitivity("held.y", "begin") == pytest.approx(3.0 * begun, abs=1e-9)
    assert run.sensitivity("y.y", "period") == pytest.approx(3 * k * (since - T), abs=1e-9)
    assert run.sensitivity("y.y", "begin") == pytest.approx(begun * 3 * (since - b), abs=1e-9)


class Together(gl.Component):
    """Two torques that begin at one time, two bodies that meet a third one through gaps at one time, and two samplers."""

    one, other = gl.Parameter("s", default=0.4), gl.Parameter("s", default=0.4)
    c, period = gl.Parameter("N.m/rad", default=80.0), gl.Parameter("s", default=0.35)
    samplers = gl.Structural(False)

    def assemble(self) -> list[gl.Connection]:
        self.first = gp.TorqueStep(step_torque=2.0, start_time=self.one)
        self.second = gp.TorqueStep(step_torque=-5.0, start_time=self.other)
        self.middle, self.fan = (
            gp.Inertia(J=1.0, start={"w": 0.5, "phi": 0.0}),
            gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=1.0),
        )
        self.gap = [gp.ElastoBacklash(c=stiffness, d=4.0, b=0.05, start={"phi_rel": 0.0}) for stiffness in (self.c, 80.0)]
        self.side = [gp.Inertia(J=0.3, start={"w": 0.0}) for _ in self.gap]
        if self.samplers:
            self.held = [gp.blocks.Sampler(sample_period=each, u=self.middle.w) for each in (self.period, 0.7)]
        return [
            c(self.first.flange, self.second.flange, self.middle.flange_a),
            c(self.middle.flange_b, self.fan.flange, *(gap.flange_a for gap in self.gap)),
            *(c(gap.flange_b, side.flange_a) for gap, side in zip(self.gap, self.side, strict=True)),
        ]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["one", "other", "c"])
def test_of_one_of_several_events_at_one_time(method: str, name: str) -> None:
    """Each switch moves with its own parameter, and is passed by itself."""
    outputs = ["middle.w", "side[0].w", "side[1].w"]
    against_other_runs(gl.compile(Together(), outputs=outputs), [name], outputs, 1.0, by=method, within=1e-5)


def test_events_at_one_time_of_which_either_could_do_first_are_refused() -> None:
    system = gl.compile(Together(samplers=True), outputs=["middle.w", "held[0].y", "held[1].y"])
    assert system.simulate(1.0, sensitivities=["c"]).sensitivity("middle.w", "c")[-1] != 0.0
    with pytest.raises(
        SolverError, match=r"after t = 0\.7 s: held\[\d\]: Sampler: .* and held\[\d\]: .* change there together, and"
    ):
        system.simulate(1.0, sensitivities=["period"])


class Ticks(gl.Component):
    """x passes 1 at 1 / p, at an instant of a sampler that is fixed; the two act on each other, or do not."""

    p, s = gl.Parameter("1/s", default=2.0), gl.Parameter("s", default=1.0)
    x, y, z = gl.Variable("1", start=0.0), gl.Variable("1", start=0.5), gl.Variable("1", start=1.0)
    held, n = gl.Discrete(), gl.Discrete()
    kind = gl.Structural("counts")

    def equations(self) -> list[Any]:
        passed, kind, instant = self.x > 1.0, self.kind, gl.sample(0.25, 0.25)
        acts = [gl.Eq(self.n, self.held if kind == "reads" else gl.pre(self.n) + 1)]
        acts += [gl.reinit(self.y, 3 * self.y + self.p * self.s)] if kind == "moves" else []
        acts += [gl.reinit(self.z, self.z + 1.0)] if kind == "changes" else []
        fast = gl.Piecewise((2, gl.And(self.held > 1, self.held < 2)), (1, True)) if kind == "faster" else 1
        return [
            gl.Eq(gl.der(self.x), self.p * fast),
            gl.Eq(gl.der(self.y), gl.Piecewise((self.n * self.p, passed), (self.y * self.p, True))),
            gl.Eq(gl.der(self.z), -self.held * self.p),
            gl.When(instant, gl.Eq(self.held, self.z + self.p * self.s)),
            gl.When(passed, *acts),
        ]


@pytest.mark.parametrize("kind", ["counts", "moves"])
@pytest.mark.parametrize("method", METHODS)
def test_an_event_at_an_instant_has_tangents_where_their_order_is_no_matter(method: str, kind: str) -> None:
    against_other_runs(gl.compile(Ticks(kind=kind)), ["p"], ["x", "y", "z"], 1.1, by=method, within=1e-5, samples=10)


@pytest.mark.parametrize("kind", ["reads", "changes", "faster"])
def test_an_event_at_an_instant_has_none_where_it_is(kind: str) -> None:
    """Runs beside it, with 2 / s and a little more or less, differ by a jump, or in their slopes."""
    with pytest.raises(SolverError, match=r"after t = 0\.5 s: .* change there together"):
        gl.simulate(Ticks(kind=kind), 1.1, method="rk5", rtol=1e-10, sensitivities=["p"])


class Held(gl.Component):
    """No states: y follows from what an event has held; s is a sum of its squares and a mode."""

    k, late = gl.Parameter("1", default=3.0), gl.Parameter("s", default=0.5)
    y, z = gl.Variable("any"), gl.Variable("any")
    h, s = gl.Discrete(), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(self.y, 2.0 * self.h + self.k),
            gl.Eq(self.z, gl.Piecewise((self.s, gl.time > 0.7), (0.0, True))),
            gl.When(gl.time >= self.late, gl.Eq(self.h, self.k * gl.time)),
            gl.When(gl.sample(0.3, 0.1), gl.Eq(self.s, gl.pre(self.s) + self.k**2)),
        ]


@pytest.mark.parametrize("method", ["auto", *METHODS])
def test_of_what_is_held_without_states(method: str) -> None:
    """``y = k + 2 k late`` from the event on; ``s = n k^2`` after n instants, at 0.1, 0.4, 0.7 and 1 s."""
    run = gl.simulate(Held(), 1.0, samples=6, method=method, sensitivities=["k", "late"])
    held = run.time > 0.5
    assert run["y"] == pytest.approx(np.where(held, 6.0, 3.0))
    assert run.sensitivity("y", "k") == pytest.approx(np.where(held, 2.0, 1.0))
    assert run.sensitivity("y", "late") == pytest.approx(np.where(held, 6.0, 0.0))
    assert run["z"] == pytest.approx([0.0, 0.0, 0.0, 0.0, 27.0, 36.0])
    assert run.sensitivity("z", "k") == pytest.approx([0.0, 0.0, 0.0, 0.0, 18.0, 24.0])
    assert run.sensitivity("z", "late").tolist() == [0.0] * 6


def test_modes_without_states_need_no_times_of_events() -> None:
    """A condition that passes zero without slope, at a time that has no derivative: nothing is held from there."""

    class Mode(gl.Component):
        p, k = gl.Parameter("s3", default=0.0), gl.Parameter("1", default=3.0)
        y = gl.Variable("any")

        def equations(self) -> list[Any]:
            return [gl.Eq(self.y, self.k * gl.Piecewise((2.0, (gl.time - 0.5) ** 3 > self.p), (1.0, True)))]

    run = gl.simulate(Mode(), 1.0, samples=4, sensitivities=["k", "p"])
    assert run.sensitivity("y", "k") == pytest.approx([1.0, 1.0, 2.0, 2.0])
    assert run.sensitivity("y", "p").tolist() == [0.0] * 4


class Restarted(gl.Component):
    """x grows with time, and is multiplied when it passes a limit; no discrete variable takes part."""

    k, limit = gl.Parameter("1", default=3.0), gl.Parameter("any", default=1.0)
    x, over = gl.Variable("any", start=0.0), gl.Variable("any", start=0.0)

    def equations(self) -> list[Any]:
        growing = [gl.Eq(gl.der(self.x), 1.0), gl.Eq(gl.der(self.over), 1.0)]
        return [*growing, gl.When(self.over > self.limit, gl.reinit(self.x, self.k * self.x))]


@pytest.mark.parametrize("method", METHODS)
def test_of_a_new_value_alone(method: str) -> None:
    """``x = k limit + t - limit`` from there on."""
    run = gl.simulate(Restarted(), 2.0, times=[0.5, 1.5, 2.0], method=method, sensitivities=["k", "limit", "start(x)"])
    assert run["x"] == pytest.approx([0.5, 3.5, 4.0])
    assert run.sensitivity("x", "k") == pytest.approx([0.0, 1.0, 1.0])
    assert run.sensitivity("x", "limit") == pytest.approx([0.0, 2.0, 2.0])
    assert run.sensitivity("x", "start(x)") == pytest.approx([1.0, 3.0, 3.0])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("limit", [1.0, 1.3])
def test_of_a_new_value_that_is_the_old_one(method: str, limit: float) -> None:
    """x = k limit + t - limit behind the event: with k = 1 it changes nothing but what x depends on."""
    run = gl.simulate(
        Restarted(k=1.0, limit=limit), 2.0, times=[0.5, 2.0], method=method, sensitivities=["k", "limit", "start(x)"]
    )
    assert run["x"] == pytest.approx([0.5, 2.0])
    assert run.sensitivity("x", "k") == pytest.approx([0.0, limit])
    assert run.sensitivity("x", "limit") == pytest.approx([0.0, 0.0], abs=1e-9)
    assert run.sensitivity("x", "start(x)") == pytest.approx([1.0, 1.0])


class Begun(gl.Component):
    """v' = F - a s, where s switches by v or by time, at the start or not."""

    v, one = gl.Variable("1", start=0.0), gl.Parameter("s", default=1.0)
    F, a, t_0 = gl.Parameter("1", default=2.5), gl.Parameter("1", default=0.5), gl.Parameter("s", default=0.0)
    kind = gl.Structural("sign")

    def equations(self) -> list[Any]:
        v, on = self.v, gl.time >= self.t_0
        s = {
            "sign": gl.sign(v),
            "above": gl.Piecewise((1, v > 0), (-1, True)),
            "not below": gl.Piecewise((1, v >= 0), (-1, True)),
            "bend": abs(v),
            "step": v + gl.Piecewise((1, on), (0, True)),
            "ramp": v + gl.Piecewise(((gl.time - self.t_0) / self.one, on), (0, True)),
        }[self.kind]
        return [gl.Eq(self.one * gl.der(v), self.F - self.a * s)]


@pytest.mark.parametrize("method", ["rk5", "ida", "auto"])
@pytest.mark.parametrize("kind", ["sign", "above", "not below", "bend"])
def test_of_what_switches_at_the_start(method: str, kind: str) -> None:
    """From rest, v = (F - a) t: of the start value it is 1 on one side and (F - a) / (F + a) on the other; 0.8 was told for a sign."""
    system = gl.compile(Begun(kind=kind))
    if kind == "bend":
        run = system.simulate(1.0, samples=2, method=method, rtol=1e-9, sensitivities=["start(v)"])
        assert run.sensitivity("v", "start(v)")[-1] == pytest.approx(np.exp(-0.5), rel=1e-6)
        return
    with pytest.raises(SolverError, match=r"no sensitivity to 'start\(v\)': the event function of .* is zero at the start"):
        system.simulate(1.0, method=method, sensitivities=["a", "start(v)"])
    run = system.simulate(1.0, samples=2, method=method, sensitivities=["a", "F"])
    assert [run.sensitivity("v", name)[-1] for name in ("a", "F")] == pytest.approx([-1.0, 1.0], rel=1e-6)
    run = system.simulate(1.0, samples=2, method=method, start={"v": -0.1}, sensitivities=["start(v)"])
    assert run.sensitivity("v", "start(v)")[-1] == pytest.approx(2.0 / 3.0, rel=1e-6)


@pytest.mark.parametrize("method", ["rk5", "ida", "exact", "auto"])
def test_of_the_time_of_a_step_at_the_start(method: str) -> None:
    """Earlier it makes no difference, later it does; a ramp goes on alike."""
    system, more = gl.compile(Begun(kind="step")), {"method": method, "samples": 2, "sensitivities": ["t_0"]}
    with pytest.raises((SolverError, ArgumentError), match="the start"):
        system.simulate(1.0, **more)
    later = system.simulate(1.0, parameters={"t_0": 0.25}, **more)
    assert later.sensitivity("v", "t_0")[-1] == pytest.approx(0.5 * np.exp(-0.5 * 0.75), rel=1e-6)
    if method != "exact":
        ramp = gl.compile(Begun(kind="ramp")).simulate(1.0, **more)
        assert ramp.sensitivity("v", "t_0")[-1] == pytest.approx(1 - np.exp(-0.5), rel=1e-6)


class Raised(gl.Component):
    """x = p t is always below its limit, which is raised by L each time it is reached; y' is the limit."""

    x, one = gl.Variable("1", start=0.0), gl.Parameter("s", default=1.0)
    below, y = gl.Variable("s", start=0.0), gl.Variable("s", start=0.0)
    L, p, limit = gl.Parameter("1", default=1.0), gl.Parameter("1", default=1.0), gl.Discrete()

    def equations(self) -> list[Any]:
        x, limit = self.x, self.limit
        reached = gl.Or(gl.initial(), x >= gl.pre(limit))
        return [
            gl.Eq(self.one * gl.der(x), self.p),
            gl.When(reached, gl.Eq(limit, gl.pre(limit) + self.L)),
            gl.Eq(gl.der(self.below), gl.Piecewise((1, x < limit), (0, True))),
            gl.Eq(gl.der(self.y), limit),
        ]


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida", "auto"])
def test_of_what_jumps_away_from_its_zero(method: str) -> None:
    """It does so at the time of the event; its own zero is elsewhere, by which the time below depended on the limit."""
    run = gl.simulate(Raised(), 3.5, samples=2, method=method, rtol=1e-9, sensitivities=["L", "p"])
    assert run["below"][-1] == pytest.approx(3.5, abs=1e-6)
    # y = L (4 t - t_1 - t_2 - t_3) with t_k = k L / p
    right = {"below": (0.0, 0.0), "y": (14.0 - 2 * 6.0, 6.0)}
    for name, values in right.items():
        assert [run.sensitivity(name, q)[-1] for q in ("L", "p")] == pytest.approx(values, abs=1e-6), name
