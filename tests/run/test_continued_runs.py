"""A run that goes on from another one, with all of its state; halves and wholes of random hybrid trains."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError

METHODS = ["rk5", "rk8", "ida"]


class Thermostat(gl.Component):
    """Heats until 22 K, cools until 18 K: between them the temperature does not tell which."""

    T = gl.Variable("K", "temperature", start=20.0)
    on = gl.Discrete("heater", start=1.0)
    cycles = gl.Discrete("how often it was switched on")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.T), gl.Piecewise((2.0, gl.holds(self.on)), (-1.0, True))),
            gl.Eq(self.on, gl.Piecewise((1, self.T < 18.0), (0, self.T > 22.0), (gl.pre(self.on), True))),
            gl.When(gl.equals(self.on, 1), gl.Eq(self.cycles, gl.pre(self.cycles) + 1)),
        ]


@pytest.fixture(scope="module")
def thermostat() -> gl.System:
    return gl.compile(Thermostat())


def temperature(t: np.ndarray) -> np.ndarray:
    """Up from 20 at 2 K/s, then down and up between 22 and 18 within six seconds."""
    phase = (t - 1.0) % 6.0
    return np.where(t < 1.0, 20.0 + 2.0 * t, np.where(phase < 4.0, 22.0 - phase, 18.0 + 2.0 * (phase - 4.0)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("t", [0.0, 0.5, 1.0, 3.0, 3.21, 5.0, 6.0])
def test_a_run_goes_on_with_its_discrete_state(thermostat: gl.System, method: str, t: float) -> None:
    """From a sample, from between two samples, and from an event."""
    half = thermostat.simulate(8.0, samples=17, method=method)
    rest = thermostat.simulate(20.0, samples=31, method=method, start=(half, t))
    assert rest.time[0] == t
    assert rest["T"] == pytest.approx(temperature(rest.time), abs=1e-9)
    assert rest["cycles"][-1] == 3.0
    if t > 0.0:
        half = thermostat.simulate(t, samples=4, method=method)
        rest = thermostat.simulate(20.0, samples=31, method=method, start=half)
        assert rest["T"] == pytest.approx(temperature(rest.time), abs=1e-9)
        assert rest["cycles"][-1] == 3.0


def test_a_run_may_go_on_at_another_time(thermostat: gl.System) -> None:
    half = thermostat.simulate(3.0)
    rest = thermostat.simulate(5.0, t_start=0.0, samples=11, start=half)
    assert rest.time[0] == 0.0
    assert rest["T"] == pytest.approx(temperature(rest.time + 3.0), abs=1e-9)


def test_start_values_of_discrete_variables(thermostat: gl.System) -> None:
    result = thermostat.simulate(3.0, samples=4, start={"on": 0, "T": 19.0, "cycles": 7})
    assert result["T"] == pytest.approx([19.0, 18.0, 20.0, 22.0], abs=1e-9)
    assert result["cycles"].tolist() == [7.0, 8.0, 8.0, 8.0]
    with pytest.raises(ArgumentError, match="start of on"):
        thermostat.simulate(3.0, start={"on": float("nan")})


def test_parameters_and_inputs_stay_unless_others_are_given() -> None:
    class Body(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load = gp.Torque(), gp.Inertia(J=1.0)
            return [gl.connect(self.torque.flange, self.load.flange_a)]

    system = gl.compile(Body())
    half = system.simulate(1.0, parameters={"load.J": 2.0}, inputs={"torque.tau": 6.0})
    assert system.simulate(2.0, start=half)["load.w"][-1] == pytest.approx(6.0)
    assert system.simulate(2.0, start=half, parameters={"load.J": 1.0})["load.w"][-1] == pytest.approx(9.0)
    assert system.simulate(2.0, start=half, inputs={"torque.tau": 2.0})["load.w"][-1] == pytest.approx(4.0)
    assert system.simulate(2.0, start=half)["load.phi"][-1] == pytest.approx(6.0), "the angle, which was not integrated"


def test_what_is_not_given_anew_stays() -> None:
    """Each parameter and each input by itself: in runs, steps, sweeps and linear models alike. (J1 + J2) der(w) = one + other."""

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other, self.a, self.b = gp.Torque(), gp.Torque(), gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            return [
                gl.connect(self.one.flange, self.a.flange_a),
                gl.connect(self.other.flange, self.b.flange_b),
                gl.connect(self.a.flange_b, self.b.flange_a),
            ]

    system = gl.compile(Two(), outputs=["a.w"])
    half = system.simulate(1.0, parameters={"a.J": 3.0}, inputs={"one.tau": 8.0, "other.tau": lambda t: 4.0})
    assert half["a.w"][-1] == pytest.approx(3.0)
    changed: dict[str, Any] = {"start": half, "parameters": {"b.J": 5.0}, "inputs": {"one.tau": 12.0}}
    assert system.simulate(2.0, **changed)["a.w"][-1] == pytest.approx(3.0 + 16 / 8)
    step = system.stepper(**changed)
    step.advance(2.0)
    assert step["a.w"] == pytest.approx(3.0 + 16 / 8)
    given = {"b.J": np.linspace(5.0, 12.0, 8), "one.tau": np.linspace(12.0, 5.0, 8)}
    runs = system.sweep(given, 2.0, start=half, samples=2)
    assert runs["a.w"][:, -1] == pytest.approx(3.0 + (given["one.tau"] + 4) / (3 + given["b.J"]))
    numbers = system.sweep({"b.J": np.linspace(5.0, 12.0, 8), "other.tau": 4.0}, 2.0, start=half, samples=2)
    assert numbers["a.w"][:, -1] == pytest.approx(3.0 + 12 / (3 + given["b.J"]))
    assert system.linearize(["one.tau"], ["a.w"], at=(half, 1.0), parameters={"b.J": 5.0}).B[0, 0] == pytest.approx(1 / 8)
    assert half.stats["zero_inputs"] == system.simulate(2.0, **changed).stats["zero_inputs"] == ()


def test_a_run_goes_on_after_it_was_copied(thermostat: gl.System) -> None:
    half = copy.deepcopy(thermostat.simulate(3.0))
    rest = thermostat.simulate(20.0, samples=31, start=half)
    assert rest["T"] == pytest.approx(temperature(rest.time), abs=1e-9)


def test_what_cannot_go_on_is_told(thermostat: gl.System) -> None:
    class Other(gl.Component):
        def assemble(self) -> list[Any]:
            self.load = gp.Inertia(J=1.0)
            return []

    half = thermostat.simulate(3.0)
    with pytest.raises(ArgumentError, match="a run of another system than Other"):
        gl.compile(Other()).simulate(5.0, start=half)
    with pytest.raises(ArgumentError, match=r"names the time 4 s; the run goes from 0 to 3 s"):
        thermostat.simulate(5.0, start=(half, 4.0))
    with pytest.raises(ArgumentError, match=r"t_end \(2\) must be greater than t_start \(3\)"):
        thermostat.simulate(2.0, start=half)
    with pytest.raises(NameLookupError, match="no variable 'off'"):
        thermostat.simulate(2.0, start={"off": 1.0})
    with pytest.raises(ArgumentError, match=r"expected a mapping of start values, 'steady', a result, or \(result, time\)"):
        thermostat.simulate(2.0, start=(half, 1.0, 2.0))


class Branched(gl.Component):
    """sin(b - a) = 0.3 sin(b): the branch depends on the way."""

    a = gl.Variable("rad", "turns steadily", start=0.0)
    b = gl.Variable("rad", "follows")
    z = gl.Variable("rad.s", "integral of b", start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.a), 3.0),
            gl.Eq(gl.sin(self.b - self.a), 0.3 * gl.sin(self.b)),
            gl.Eq(gl.der(self.z), self.b),
        ]


class Behind(gl.Component):
    """The same behind many variables that it does not depend on."""

    def assemble(self) -> list[Any]:
        self.others, self.branched = [Thermostat() for _ in range(9)], Branched()
        return []


@pytest.mark.parametrize(("kind", "path"), [(Branched, ""), (Behind, "branched.")])
def test_a_run_stays_on_its_branch(kind: type[gl.Component], path: str) -> None:
    system = gl.compile(kind(), outputs=[f"{path}z"])
    whole = system.simulate(5.0, samples=1001, rtol=1e-10)
    rest = system.simulate(5.0, samples=501, rtol=1e-10, start=(whole, 2.5))
    assert rest[f"{path}z"][-1] == pytest.approx(whole[f"{path}z"][-1], rel=1e-6)


class Rattle(gl.Component):
    """A driven pair of bodies with backlash, a bearing that sticks, a clutch that is let go and a freewheel; touches are counted."""

    amplitude = gl.Parameter("N.m", "of the torque", default=8.0)
    rate = gl.Parameter("rad/s", "of the torque", default=7.0)
    b = gl.Parameter("rad", "backlash", default=0.05)
    friction = gl.Parameter("N.m", "of the bearing", default=1.0)

    def assemble(self) -> list[Any]:
        pulse = gl.Piecewise((1, gl.time < 0.7), (0, gl.time < 1.3), (1, True))
        self.drive = gp.Torque(tau=self.amplitude * gl.sin(self.rate * gl.time) + 2)
        self.motor = gp.Inertia(J=0.2, start={"phi": 0.0, "w": 0.0})
        self.gap = gp.ElastoBacklash(c=400.0, d=2.0, b=self.b)
        self.wheel = gp.Inertia(J=0.5, start={"phi": 0.0, "w": 0.0})
        self.clutch = gp.Clutch(fn_max=4.0, f_normalized=pulse)
        self.load = gp.Inertia(J=0.8, start={"phi": 0.0, "w": 0.0})
        self.bearing = gp.BearingFriction(tau_pos=((0.0, 0.6), (10.0, 1.2)))
        self.freewheel = gp.OneWayClutch(fn_max=0.2, f_normalized=1.0, peak=1.1)
        self.last = gp.Inertia(J=0.3, start={"phi": 0.0, "w": 0.0})
        self.brake = gp.Damper(d=0.05)
        self.ground = gp.Fixed()
        return [
            gl.connect(self.drive.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.gap.flange_a),
            gl.connect(self.gap.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.clutch.flange_a),
            gl.connect(self.clutch.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.bearing.flange_a),
            gl.connect(self.bearing.flange_b, self.freewheel.flange_a),
            gl.connect(self.freewheel.flange_b, self.last.flange_a),
            gl.connect(self.last.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
        ]


MODES = ["clutch.mode", "bearing.mode", "freewheel.stuck"]
SPEEDS = ["motor.w", "wheel.w", "load.w", "last.w"]


@pytest.fixture(scope="module")
def rattle() -> gl.System:
    return gl.compile(Rattle())


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("method", METHODS)
def test_a_whole_is_two_halves(rattle: gl.System, method: str, seed: int) -> None:
    draw = np.random.default_rng(seed)
    numbers = {"amplitude": draw.uniform(3, 12), "rate": draw.uniform(3, 12), "b": draw.uniform(0.001, 0.1)}
    t, grid = float(draw.uniform(0.2, 1.8)), np.linspace(0.0, 2.0, 41)
    whole = rattle.simulate(2.0, times=grid, method=method, rtol=1e-8, parameters=numbers)
    half = rattle.simulate(t, samples=3, method=method, rtol=1e-8, parameters=numbers)
    later = np.append(grid[grid > t], 2.0)[:-1]
    for start in (half, (whole, t)):
        rest = rattle.simulate(2.0, times=later, method=method, rtol=1e-8, start=start)
        for name in SPEEDS:
            assert rest[name] == pytest.approx(whole[name][grid > t], abs=2e-4), name
        for name in MODES:
            assert np.mean(rest[name] == whole[name][grid > t]) > 0.9, name


@pytest.mark.parametrize("seed", range(4))
def test_methods_and_samples_agree_about_the_events(rattle: gl.System, seed: int) -> None:
    draw = np.random.default_rng(seed)
    numbers = {"amplitude": draw.uniform(3, 12), "rate": draw.uniform(3, 12), "b": draw.uniform(0.001, 0.1)}
    runs = [
        rattle.simulate(2.0, samples=samples, method=method, rtol=1e-9, parameters=numbers)
        for method in METHODS for samples in (2, 83)
    ]  # fmt: skip
    for run in runs[1:]:
        assert [name for _, name in run.events] == [name for _, name in runs[0].events]
        assert [t for t, _ in run.events] == pytest.approx([t for t, _ in runs[0].events], abs=2e-5)
        for name in SPEEDS:
            assert run[name][-1] == pytest.approx(runs[0][name][-1], abs=1e-5)


class Crossings(gl.Component):
    """Counts how often a vibration passes a level, upwards; each time it turns the drive round."""

    x, v, s = gl.Variable("1", start=-0.4), gl.Variable("1", start=0.1), gl.Parameter("s", default=1.0)
    level, d, n = gl.Parameter("1", default=0.1), gl.Discrete(start=0.5), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(self.s * gl.der(self.x), self.v),
            gl.Eq(self.s * gl.der(self.v), self.d - 9.0 * self.x - self.x**3),
            gl.When(self.x > self.level, gl.Eq(self.d, -gl.pre(self.d)), gl.Eq(self.n, gl.pre(self.n) + 1)),
        ]


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida", "taylor"])
def test_an_event_at_the_end_of_a_run_is_not_met_again_by_the_next_one(method: str) -> None:
    """Where the run stops a rounding before it, so that the states alone do not tell that it has been passed."""
    system = gl.compile(Crossings(), outputs=["x", "d", "n"])
    for level in np.random.default_rng(2).uniform(-0.3, 0.3, 12).tolist():
        whole = system.simulate(5.0, samples=2, method=method, rtol=1e-9, parameters={"level": level})
        for t in [t for t, _ in whole.events] or [1.0]:
            first = system.simulate(t, samples=2, method=method, rtol=1e-9, parameters={"level": level})
            then = system.simulate(5.0, samples=2, method=method, rtol=1e-9, start=first)
            assert (then["n"][-1], then["d"][-1]) == (whole["n"][-1], whole["d"][-1]), (level, t)
            assert then["x"][-1] == pytest.approx(whole["x"][-1], abs=1e-6)


@pytest.mark.parametrize("samples", [17, 1601])
@pytest.mark.parametrize("method", METHODS)
def test_times_beside_an_event_are_looked_at_in_the_steps_that_found_it(
    thermostat: gl.System, method: str, samples: int
) -> None:
    """Up to a billionth of the run, however it is sampled; elsewhere a run up to the time is enough, without the later samples."""
    whole = thermostat.simulate(16.0, samples=samples, method=method)
    event = next(t for t, _ in whole.events if t > 4.0)
    assert event == pytest.approx(5.0, abs=1e-8)
    for share in (-0.9e-9, 0.9e-9):
        t = event + share * 16.0
        assert whole.with_sample(t).time.tolist() == [*whole.time[whole.time < t], t, *whole.time[whole.time > t]]
    for share in (-1.1e-9, 1.1e-9):
        t = event + share * 16.0
        assert whole.with_sample(t).time.tolist() == [*whole.time[whole.time < t], t]
    assert whole.with_sample(whole.time[3]) is whole
