"""`gl.Sampled`: Python functions at exact instants, against loops by hand; runs that go on, that are done again, that are stepped."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, BindingError, GearlibError


class Law:
    """A controller that counts its calls."""

    def __init__(self) -> None:
        self.calls: list[tuple[float, ...]] = []

    def __call__(self, t: float, values: Any) -> float:
        self.calls.append((t, *values))
        return 10.0 * (3.0 - values[0])


LAW = Law()


class Governed(gl.Component):
    """A load whose speed a sampled function governs."""

    law = gl.Structural(LAW, "the function")
    period = gl.Structural(0.1, "s")
    offset = gl.Structural(0.0, "s")

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
        self.governor = gl.Sampled(self.law, self.period, inputs=[self.load.w], outputs=[self.torque.tau], offset=self.offset)
        return [gl.connect(self.torque.flange, self.load.flange_a)]


def by_hand(steps: int) -> list[float]:
    w, found = 0.0, []
    for _ in range(steps):
        found.append(w)
        w += 0.1 * 10.0 * (3.0 - w) / 2.0
    return found


@pytest.fixture
def system() -> gl.System:
    LAW.calls.clear()
    return gl.compile(Governed())


def test_periods_and_offsets_of_any_size() -> None:
    for given, calls in (({"period": 1e308}, 1), ({"offset": 1e308}, 0), ({"period": 1e-300, "offset": 3.0}, 0)):
        LAW.calls.clear()
        gl.compile(Governed(**given)).simulate(2.0)
        assert len(LAW.calls) == calls, given
    with pytest.raises(gl.GearlibError, match=r"period of governor is .* s: from 0 to 2 s there are inf instants, more than"):
        gl.compile(Governed(period=5e-324)).simulate(2.0)


@pytest.mark.parametrize("method", ["auto", "rk8", "ida"])
def test_a_function_is_called_at_exact_instants_and_its_value_is_held(system: gl.System, method: str) -> None:
    r = system.simulate(2.0, samples=41, method=method, rtol=1e-9)
    assert [t for t, _ in LAW.calls] == [0.1 * k for k in range(21)]
    assert r["load.w"][::2] == pytest.approx(by_hand(21), abs=1e-9)
    assert r["torque.tau"] == pytest.approx(np.repeat([10.0 * (3.0 - w) for w in by_hand(21)], 2)[:41], abs=1e-8)
    assert [w for _, w in LAW.calls] == pytest.approx(by_hand(21), abs=1e-9)
    assert system.inputs == ()
    assert "cut at the instants of governor" in r.stats["why"]


def test_what_is_asked_for_later_calls_no_function_again(system: gl.System) -> None:
    r = system.simulate(1.0, samples=11)
    n = len(LAW.calls)
    angle = 0.1 * np.cumsum([0.0, *(np.array(by_hand(11))[1:] + np.array(by_hand(11))[:-1]) / 2])
    assert r["load.phi"] == pytest.approx(angle, abs=1e-9)
    assert r.energy_balance().relative_residual < 1e-9
    assert r.at(0.55)["load.w"] == pytest.approx((by_hand(7)[5] + by_hand(7)[6]) / 2)
    assert np.array_equal(pickle.loads(pickle.dumps(r))["load.w"], r["load.w"])
    assert len(LAW.calls) == n


def test_a_run_that_goes_on_counts_an_instant_once(system: gl.System) -> None:
    first = system.simulate(1.0, samples=11)
    second = system.simulate(2.0, start=first, samples=11)
    assert [t for t, _ in LAW.calls] == pytest.approx(0.1 * np.arange(21))
    assert second["load.w"] == pytest.approx(by_hand(21)[10:])
    third = system.simulate(1.5, start=(first, 0.55), samples=2)
    assert third["load.w"][-1] == pytest.approx(by_hand(16)[-1])


@pytest.mark.parametrize(("t_start", "count"), [(0.0, 11), (0.05, 10), (3.0, 11)])
def test_a_run_that_goes_on_at_another_time_calls_it_at_the_instants_there(
    system: gl.System, t_start: float, count: int
) -> None:
    first = system.simulate(1.0, samples=2)
    LAW.calls.clear()
    system.simulate(t_start + 1.0, t_start=t_start, start=first, samples=2)
    assert len(LAW.calls) == count
    LAW.calls.clear()
    system.stepper(start=first, t_start=t_start).advance(t_start + 1.0)
    assert len(LAW.calls) == count


def test_stepped_runs_call_it_too_and_come_back(system: gl.System) -> None:
    run = system.stepper()
    for k in range(1, 21):
        run.advance(0.05 * k)
    assert run["load.w"] == pytest.approx(by_hand(11)[-1])
    state = run.state()
    run.advance(1.5)
    after = run["load.w"], run["torque.tau"]
    assert after[0] == pytest.approx(by_hand(16)[-1])
    run.restore(state)
    run.advance(1.5)
    assert (run["load.w"], run["torque.tau"]) == after
    assert list(run.inputs) == []


def test_before_its_first_instant_it_gives_nothing() -> None:
    r = gl.simulate(Governed(offset=0.35), 0.5, times=[0.3, 0.36, 0.5])
    assert r["torque.tau"] == pytest.approx([0.0, 30.0, 10.0 * (3.0 - 1.5)])


def test_several_controllers_signals_and_events() -> None:
    """A fast inner loop, a slow outer one that commands it, and a load with backlash; a policy with two outputs and a memory."""
    seen: list[float] = []

    def outer(t: float, values: Any) -> list[float]:
        seen.append(t)
        return [2.0 * (1.0 - values[0]), len(seen)]

    class Loop(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.motor, self.load = gp.Torque(), gp.Inertia(J=0.5), gp.Inertia(J=1.0)
            self.gap, self.speed, self.count = (
                gp.ElastoBacklash(c=500.0, d=5.0, b=0.02),
                gp.blocks.Gain(k=1.0),
                gp.blocks.Gain(k=1.0),
            )
            self.slow = gl.Sampled(outer, 0.05, inputs=[self.load.phi], outputs=[self.speed.u, self.count.u])
            self.fast = gl.Sampled(
                lambda t, v: 20.0 * (v[0] - v[1]), 0.01, inputs=[self.speed.y, self.motor.w], outputs=[self.torque.tau]
            )
            return [
                gl.connect(self.torque.flange, self.motor.flange_a),
                gl.connect(self.motor.flange_b, self.gap.flange_a),
                gl.connect(self.gap.flange_b, self.load.flange_a),
            ]

    r = gl.simulate(Loop(), 6.0, samples=601, rtol=1e-8, outputs=["load.phi", "torque.tau", "speed.y", "count.y"])
    assert r["load.phi"][-1] == pytest.approx(1.0, abs=0.02)
    assert seen == pytest.approx(0.05 * np.arange(121), abs=1e-14)
    assert np.array_equal(r["count.y"], np.floor(r.time / 0.05 + 1e-9) + 1)
    assert len(r.events) > 0
    step = gl.compile(Loop(), outputs=["load.phi"]).stepper(rtol=1e-8)
    seen.clear()
    for t in (0.5, 1.7, 2.0):
        step.advance(t)
    assert step["load.phi"] == pytest.approx(r["load.phi"][200], abs=1e-6)


def test_analyses_refuse_it_by_name(system: gl.System) -> None:
    for analysis in (
        lambda: system.linearize(outputs=["load.w"]),
        lambda: gl.modes(system),
        lambda: gl.stability(system),
        lambda: system.power_flow(),
        lambda: gl.frequency_response(system, [1.0]),
    ):
        with pytest.raises(GearlibError, match=r"needs equations, and governor is a Python function \(gl\.Sampled\)"):
            analysis()
    with pytest.raises(ArgumentError, match=r"method='exact' does not call the function of governor"):
        system.simulate(1.0, method="exact")


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (lambda t, v: 1 / 0, r"function of governor, called at t = 0 s, raised ZeroDivisionError: division by zero"),
        (lambda t, v: "fast", r"called at t = 0 s, returned 'fast'; expected 1 finite number"),
        (lambda t, v: [1.0, 2.0], r"returned \[1\.0, 2\.0\]; expected 1 finite number"),
        (lambda t, v: float("nan"), r"returned nan; expected 1 finite number"),
        (lambda t, v: None, r"returned None; expected 1 finite number"),
    ],
)
def test_functions_that_fail_are_named(law: Any, message: str) -> None:
    class Failing(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
            self.governor = gl.Sampled(law, 0.1, inputs=[self.load.w], outputs=[self.torque.tau])
            return [gl.connect(self.torque.flange, self.load.flange_a)]

    with pytest.raises(ArgumentError, match=message):
        gl.simulate(Failing(), 1.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"function": 3.0}, r"function is 3\.0; expected a function of the time and an array"),
        ({"period": 0.0}, r"period is 0\.0; expected a positive number"),
        ({"outputs": []}, r"outputs is empty"),
        ({"outputs": [3.0]}, r"outputs is \[3\.0\]; expected a list of signals"),
        ({"inputs": "w"}, r"inputs is 'w'; expected a list of signals"),
    ],
)
def test_arguments_that_are_refused(given: Any, message: str) -> None:
    class Wrong(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
            self.governor = gl.Sampled(
                **{"function": LAW, "period": 0.1, "inputs": [self.load.w], "outputs": [self.torque.tau], **given}
            )
            return [gl.connect(self.torque.flange, self.load.flange_a)]

    with pytest.raises(BindingError, match=message):
        gl.compile(Wrong())


class Chain(gl.Component):
    """A ramp is sampled by a block, whose value a function reads; a block samples what that gives, another one delays it."""

    period = gl.Structural(0.1, "s")
    offset = gl.Structural(0.0, "s")
    other_period = gl.Structural(0.1, "s")
    other_offset = gl.Structural(0.0, "s")

    def assemble(self) -> list[gl.Connection]:
        of_blocks = {"sample_period": self.other_period, "start_time": self.other_offset}
        self.ramp, self.gain = gp.blocks.Ramp(height=1.0, duration=1.0), gp.blocks.Gain(k=1.0)
        self.first = gp.blocks.Sampler(**of_blocks, u=self.ramp.y)
        self.law = gl.Sampled(
            lambda t, v: 100.0 + v[0], self.period, inputs=[self.first.y], outputs=[self.gain.u], offset=self.offset
        )
        self.last, self.late = gp.blocks.Sampler(**of_blocks, u=self.gain.y), gp.blocks.UnitDelay(**of_blocks, u=self.gain.y)
        self.torque, self.load = gp.Torque(tau=self.last.y), gp.Inertia(J=1.0)
        return [gl.connect(self.torque.flange, self.load.flange_a)]


NAMES = ["first.y", "gain.y", "last.y", "late.y"]


@pytest.mark.parametrize("method", ["auto", "rk", "ida"])
def test_blocks_and_functions_that_share_an_instant_follow_each_other(method: str) -> None:
    """Each takes what the one before it gives at the same instant, at the start as later; before, the last lagged by a period."""
    system = gl.compile(Chain(), outputs=[*NAMES, "load.w"])
    r = system.simulate(0.4, samples=9, method=method, rtol=1e-9)
    first = np.array([0.0, 0.0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4])
    assert r["first.y"] == pytest.approx(first, abs=1e-12)
    assert r["gain.y"] == pytest.approx(100.0 + first, abs=1e-12)
    assert r["last.y"] == pytest.approx(100.0 + first, abs=1e-12)
    assert r["late.y"] == pytest.approx([0.0, 0.0, *(100.0 + first[:-2])], abs=1e-12)
    speed = 0.05 * np.cumsum([0.0, *(100.0 + first[:-1])])
    assert r["load.w"] == pytest.approx(speed, rel=1e-8)
    assert r.at(0.25)["last.y"] == pytest.approx(100.2)
    assert [t for t, where in r.events if "last" in where] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert r.stats["events"] == len(r.events)
    for half in (0.2, 0.25):
        begun = system.simulate(half, samples=2, method=method, rtol=1e-9)
        rest = system.simulate(0.4, times=r.time[r.time > half], start=begun, method=method, rtol=1e-9)
        for name in NAMES:
            assert rest[name] == pytest.approx(r[name][r.time > half], abs=1e-12)
    run = system.stepper(method=method, rtol=1e-9)
    for k, t in enumerate(r.time[1:].tolist(), 1):
        run.advance(t)
        assert [run[name] for name in NAMES] == pytest.approx([r[name][k] for name in NAMES], abs=1e-12)


@pytest.mark.parametrize(
    "given",
    [
        {"period": 0.07, "offset": -0.01, "other_period": 0.03},  # 0.9000000000000001 and 0.8999999999999999
        {"period": 0.03, "other_period": 0.07, "other_offset": -0.01},
    ],
)
def test_instants_that_differ_by_rounding_are_one(given: dict[str, float]) -> None:
    r = gl.simulate(Chain(**given), 1.0, times=[0.0, 0.89, 0.9, 0.91, 1.0])
    assert r["first.y"][2:4] == pytest.approx([0.9, 0.9])
    assert r["gain.y"][2:4] == pytest.approx([100.9, 100.9])
    assert r["last.y"][2:4] == pytest.approx([100.9, 100.9])


def test_a_sample_just_before_an_instant_by_rounding_holds_what_follows() -> None:
    r = gl.simulate(Governed(offset=0.1), 0.5, times=[0.1, 0.3, 0.5])  # the third instant is at 0.1 + 2 * 0.1 > 0.3
    assert r["torque.tau"] == pytest.approx([30.0, 10.0 * (3.0 - by_hand(3)[2]), 10.0 * (3.0 - by_hand(5)[4])])
