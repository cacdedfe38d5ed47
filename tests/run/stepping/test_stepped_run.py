"""Runs that are advanced from outside, against whole runs and closed forms."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError, SolverError
from tests.benchmarks.users import ElectricVehicle, Planets, Servo, TwoStageGearbox
from tests.run.test_continued_runs import Thermostat, temperature

METHODS = ["auto", "rk5", "rk8", "ida"]


class Drive(gl.Component):
    def assemble(self) -> list[Any]:
        self.torque, self.load, self.drag, self.ground = gp.Torque(), gp.Inertia(J=2.0), gp.Damper(d=0.5), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.load.flange_a), gl.connect(self.load.flange_b, self.drag.flange_a),
            gl.connect(self.drag.flange_b, self.ground.flange),
        ]  # fmt: skip


@pytest.fixture(scope="module")
def drive() -> gl.System:
    return gl.compile(Drive())


class Cooling(gl.Component):
    """A temperature that falls evenly, to below absolute zero."""

    T, rate = gl.Variable("K", start=1.0, min=0.0), gl.Input("K/s")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.T), -self.rate)]


@pytest.mark.parametrize("method", METHODS)
def test_a_step_to_below_a_minimum_is_refused(method: str) -> None:
    run = gl.compile(Cooling()).stepper(method=method, inputs={"rate": 1.0})
    assert run.advance(0.75) is None
    with pytest.raises(gl.GearlibError, match=r"T .*0"):
        run.advance(1.25)


# ---------------------------------------------------------------- the same as a whole run


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dt", [0.05, 0.5, 1.0, 3.0])
def test_discrete_state_is_carried(method: str, dt: float) -> None:
    """Switched at 1, 5 and 7 s, on which some of the steps end."""
    run = gl.compile(Thermostat()).stepper(method=method)
    for k in range(1, round(12.0 / dt) + 1):
        run.advance(k * dt)
        assert run["T"] == pytest.approx(temperature(np.array([run.t]))[0], abs=1e-8)
    assert run["cycles"] == 2.0
    assert sorted({round(t, 6) for t, _ in run.events}) == [1.0, 5.0, 7.0, 11.0]


@pytest.mark.parametrize(
    ("component", "end", "name", "share"),
    [
        (ElectricVehicle, 0.8, "vehicle.w", 1e-5), (ElectricVehicle, 0.8, "motor.w", 1e-5), (Servo, 0.4, "load.phi", 1e-5),
        (Planets, 0.03, "sun.w", 1e-4), (TwoStageGearbox, 0.05, "load.w", 1e-5),
    ],
)  # fmt: skip
def test_stepped_is_simulated(component: type[gl.Component], end: float, name: str, share: float) -> None:
    system = gl.compile(component(), outputs=[name])
    times = np.linspace(0.0, end, 41)
    whole = system.simulate(end, times=times, rtol=1e-8)[name]
    run, found = system.stepper(rtol=1e-8), []
    found.append(run[name])
    for t in times[1:].tolist():
        run.advance(t)
        found.append(run[name])
    assert np.array(found) == pytest.approx(whole, abs=share * np.abs(whole).max())


@pytest.mark.parametrize("method", [*METHODS, "taylor"])
def test_a_step_may_be_as_short_as_the_rounding_of_time(drive: gl.System, method: str) -> None:
    """Times that a caller computes in two ways; 2 w' + 0.5 w = 3."""
    shortest = [2.7, math.nextafter(2.7, 3.0), 2.7 + 3e-15, 4.0]
    for times in (
        [0.0, *shortest],
        [2.5, 2.6, *shortest],
        [-0.3, -0.15, -5e-17, 2e-16, 0.3],
        [1.3, math.nextafter(1.3, 2.0), 2.0],
    ):
        run = drive.stepper(t_start=times[0], method=method, rtol=1e-10, inputs={"torque.tau": 3.0})
        for t in times[1:]:
            run.advance(t)
            assert run["load.w"] == pytest.approx(6.0 - 6.0 * math.exp(-0.25 * (t - times[0])), rel=1e-8)


# ---------------------------------------------------------------- inputs


def test_inputs_act_from_one_step_to_the_next(drive: gl.System) -> None:
    """2 w' + 0.5 w = tau, held for each step: exact from step to step."""
    run, w = drive.stepper(rtol=1e-10), 0.0
    for k in range(20):
        tau = math.sin(1.0 + k)
        run.inputs["torque.tau"] = tau
        assert run["load.a"] == pytest.approx((tau - 0.5 * w) / 2.0, abs=1e-8)
        run.advance(0.2 * (k + 1))
        w = tau / 0.5 + (w - tau / 0.5) * math.exp(-0.25 * 0.2)
        assert run["load.w"] == pytest.approx(w, rel=1e-8)
        assert run["der(load.w)"] == pytest.approx((tau - 0.5 * w) / 2.0, abs=1e-8)


def test_functions_and_tables_are_inputs_too(drive: gl.System) -> None:
    again = {"outside": "periodic"}
    signals: list[Any] = [
        math.cos, gl.Table([0.0, 1.0, 2.0], [1.0, 3.0, 0.0]), 2.0, gl.Table([0.0, 0.1, 0.3], [1.0, 3.0, 0.0], **again),
        gl.Table([0.5, 0.6, 0.9], [1.0, -2.0, 9.0], "previous", **again),
    ]  # fmt: skip
    for signal in signals:
        run = drive.stepper(inputs={"torque.tau": signal}, rtol=1e-9)
        for t in (0.7, 1.3, 2.0):
            run.advance(t)
        whole = drive.simulate(2.0, samples=2, inputs={"torque.tau": signal}, rtol=1e-10)
        assert run["load.w"] == pytest.approx(whole["load.w"][-1], rel=1e-6)


def test_a_controller_in_python(drive: gl.System) -> None:
    """Stopped by what it shows."""
    run = drive.stepper()
    while run["load.w"] < 3.0:
        run.inputs["torque.tau"] = 4.0 * (4.0 - run["load.w"])
        run.advance(run.t + 0.01)
    assert 0.5 < run.t < 1.2


# ---------------------------------------------------------------- coming back


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("component", [Thermostat, ElectricVehicle, Servo])
def test_restored_it_goes_on_bit_for_bit(component: type[gl.Component], method: str) -> None:
    run = gl.compile(component()).stepper(method=method)
    run.advance(0.11)
    state = run.state()
    assert state.t == 0.11

    def rest() -> list[Any]:
        found: list[Any] = []
        for t in (0.13, 0.2, 0.31):
            run.advance(t)
            found += [run.state().states.tolist(), run.t, list(run.events)]
        return found

    first = rest()
    run.restore(state)
    assert run.t == 0.11
    assert rest() == first


def test_restored_with_its_inputs(drive: gl.System) -> None:
    run = drive.stepper(inputs={"torque.tau": 3.0})
    run.advance(1.0)
    state = run.state()
    run.inputs["torque.tau"] = -7.0
    run.advance(2.0)
    run.restore(state)
    assert dict(run.inputs) == {"torque.tau": 3.0}
    other = drive.stepper()
    other.restore(state)  # of another run of the same system
    run.advance(2.0)
    other.advance(2.0)
    assert other["load.w"] == run["load.w"] == pytest.approx(6.0 * (1 - math.exp(-0.5)), rel=1e-5)


def test_a_step_that_fails_leaves_the_run_where_it_was() -> None:
    class Escape(gl.Component):
        x = gl.Variable("1", "", start=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), self.x**2)]

    run = gl.compile(Escape()).stepper(rtol=1e-9)
    run.advance(0.5)
    with pytest.raises(SolverError):
        run.advance(2.0)
    assert (run.t, run["x"]) == (0.5, pytest.approx(2.0, rel=1e-7))
    run.advance(0.75)
    assert run["x"] == pytest.approx(4.0, rel=1e-7)


# ---------------------------------------------------------------- where it begins


def test_begins_as_a_simulation_does(drive: gl.System) -> None:
    run = drive.stepper(t_start=3.0, start={"load.w": 5.0}, parameters={"drag.d": 1.0})
    assert (run.t, run["load.w"]) == (3.0, 5.0)
    run.advance(5.0)
    assert run["load.w"] == pytest.approx(5.0 * math.exp(-1.0), rel=1e-5)
    run = drive.stepper(start="steady", inputs={"torque.tau": 2.0})
    assert run["load.w"] == pytest.approx(4.0)
    half = drive.simulate(1.0, inputs={"torque.tau": 2.0})
    run = drive.stepper(start=half)
    assert (run.t, dict(run.inputs)) == (1.0, {"torque.tau": 2.0})
    run.advance(2.0)
    assert run["load.w"] == pytest.approx(4.0 * (1 - math.exp(-0.5)), rel=1e-5)


def test_angles_are_there(drive: gl.System) -> None:
    run = drive.stepper(start={"load.w": 1.0, "load.phi": 2.0})
    run.advance(1.0)
    assert run["load.phi"] == pytest.approx(2.0 + 4.0 * (1 - math.exp(-0.25)), rel=1e-6)
    run = gl.compile(Drive(), outputs=["load.w"]).stepper()
    with pytest.raises(NameLookupError, match=r"load\.phi is not known in this run.*outputs"):
        run["load.phi"]


# ---------------------------------------------------------------- refusals


def test_refusals(drive: gl.System) -> None:
    run = drive.stepper()
    run.advance(1.0)
    for t in (1.0, 0.5, float("nan"), "2"):
        with pytest.raises(ArgumentError):
            run.advance(t)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="exact"):
        drive.stepper(method="exact")
    with pytest.raises(NameLookupError, match=r"torque\.tau"):
        run.inputs["torque.tu"] = 1.0
    with pytest.raises(ArgumentError, match=r"torque\.tau"):
        run.inputs["torque.tau"] = "1.0"
    with pytest.raises(ArgumentError, match="cannot be taken away"):
        del run.inputs["torque.tau"]
    with pytest.raises(ArgumentError, match="restore"):
        run.restore(gl.compile(Thermostat()).stepper().state())
    with pytest.raises(ArgumentError, match="one name"):
        run[0]  # type: ignore[index]
    with pytest.raises(NameLookupError, match=r"load\.w"):
        run["load.ww"]


# ---------------------------------------------------------------- what is kept from one advance to the next


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the methods with which a driver was begun, one for each time."""
    from gearlib.run.methods import automatic
    from gearlib.run.stepping import live_run

    found: list[str] = []

    class Counted(live_run.Driver):
        def __init__(self, problem: Any, stepper: Any, before: Any = None) -> None:
            found.append(type(stepper).__name__)
            super().__init__(problem, stepper, before)

    for module in (live_run, automatic):
        monkeypatch.setattr(module, "Driver", Counted)
    return found


@pytest.mark.parametrize("method", ["auto", "rk5", "rk8", "ida"])
def test_a_thousand_advances_are_one_run(method: str, begun: list[str]) -> None:
    """One driver, about one step for each advance, and the answer of a whole run."""
    run = gl.compile(TwoStageGearbox(), outputs=["load.w"]).stepper(method=method, rtol=1e-6)
    begun.clear()  # what gave the first sample
    for k in range(1, 1001):
        run.advance(5e-5 * k)
    assert len(begun) == 1
    assert run._live is not None
    assert run._live.driver.record.steps < 3500
    whole = gl.compile(TwoStageGearbox(), outputs=["load.w"]).simulate(0.05, samples=2, rtol=1e-9)
    assert run["load.w"] == pytest.approx(whole["load.w"][-1], rel=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_inputs_that_are_set_keep_the_driver(drive: gl.System, method: str, begun: list[str]) -> None:
    run, w = drive.stepper(rtol=1e-9, method=method, inputs={"torque.tau": 0.0}), 0.0
    begun.clear()
    for k in range(50):
        run.inputs["torque.tau"] = tau = math.sin(1.0 + k)
        run.advance(0.02 * (k + 1))
        w = tau / 0.5 + (w - tau / 0.5) * math.exp(-0.25 * 0.02)
        assert run["load.w"] == pytest.approx(w, rel=1e-7, abs=1e-9)
    assert len(begun) == 1
    run.inputs["torque.tau"] = lambda t: 1.0  # what is not a number makes the run begin anew
    run.advance(2.0)
    run.advance(2.5)
    assert len(begun) == 2


@pytest.mark.parametrize("method", METHODS)
def test_conditions_in_time_are_met_in_each_advance(method: str) -> None:
    """Steps of 0.01 s through a square wave of 0.03 s, whose integral is known; some of its edges are ends of steps."""

    class Square(gl.Component):
        x = gl.Variable("1", "integral", start=0.0)
        z = gl.Variable("1", "lag", start=0.0)

        def equations(self) -> list[Any]:
            edges = gl.Piecewise((1.0, gl.time < 0.03), (-1.0, gl.time < 0.0655), (2.0, gl.time < 3.001), (0.0, True))
            return [gl.Eq(gl.der(self.x), edges), gl.Eq(gl.der(self.z), 10.0 * (self.x - self.z))]

    run = gl.compile(Square()).stepper(method=method, rtol=1e-9)
    for k in range(1, 401):
        run.advance(0.01 * k)
        t = run.t
        expected = min(t, 0.03) - min(max(t - 0.03, 0.0), 0.0355) + 2.0 * min(max(t - 0.0655, 0.0), 2.9355)
        assert run["x"] == pytest.approx(expected, abs=1e-9)
    assert [round(t, 9) for t, _ in run.events] == [0.03, 0.0655, 3.001]


def test_stiffness_is_met_by_ida(begun: list[str]) -> None:
    """x' = -1e6 (x - y), y' = -y: Runge-Kutta would need some 300 000 steps for a second."""

    class Stiff(gl.Component):
        x = gl.Variable("1", "", start=1.0)
        y = gl.Variable("1", "", start=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), -1e6 * (self.x - self.y * self.y)), gl.Eq(gl.der(self.y), -self.y)]

    run = gl.compile(Stiff()).stepper(rtol=1e-7)
    begun.clear()
    for k in range(1, 101):
        run.advance(0.01 * k)
    assert begun == ["RungeKutta", "NativeIda"]
    assert run["y"] == pytest.approx(math.exp(-1.0), rel=1e-5)
    assert run["x"] == pytest.approx(math.exp(-2.0), rel=1e-5)


def test_a_run_that_fails_can_go_on_with_another_input() -> None:
    class Root(gl.Component):
        u = gl.Input("1", "rate")
        x = gl.Variable("1", "", start=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), self.u * gl.sqrt(self.x))]

    run = gl.compile(Root()).stepper(inputs={"u": -1.0}, rtol=1e-8)
    run.advance(0.5)
    run.advance(1.0)
    assert run["x"] == pytest.approx(0.25, rel=1e-6)
    with pytest.raises(SolverError):
        run.advance(3.0)
    assert (run.t, run["x"]) == (1.0, pytest.approx(0.25, rel=1e-6))
    run.inputs["u"] = 1.0
    run.advance(2.0)
    assert run["x"] == pytest.approx(1.0, rel=1e-6)


def test_what_a_forgotten_run_holds_is_freed(drive: gl.System) -> None:
    run = drive.stepper(method="ida", inputs={"torque.tau": 1.0})
    run.advance(0.1)
    run.advance(0.2)
    assert run._live is not None
    stepper: Any = run._live.driver.stepper
    assert stepper.solver is not None
    del run
    assert stepper.solver is None


def test_discrete_variables_begin_where_they_are_told() -> None:
    class Counter(gl.Component):
        x = gl.Variable("1", start=0.0)
        n = gl.Discrete("1", start=2.0)
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), self.rate), gl.When(self.x >= 1.0, gl.Eq(self.n, gl.pre(self.n) + 1.0))]

    system = gl.compile(Counter())
    for start, first in ((None, 2.0), ({"n": 7.0, "x": 0.5}, 7.0)):
        run = system.stepper(start=start)
        assert run["n"] == first
        run.advance(1.5)
        assert run["n"] == first + 1.0
        assert run["x"] == pytest.approx(1.5 + (0.5 if start else 0.0))


@pytest.mark.parametrize("method", ["rk5", "ida", "auto"])
def test_steps_before_zero(drive: gl.System, method: str) -> None:
    """From -3 s on; the length of an advance counts, not its times. w = 8 (1 - exp(-(t + 3) / 4))."""
    run = drive.stepper(t_start=-3.0, method=method, inputs={"torque.tau": 4.0}, rtol=1e-9)
    for t in (-2.5, -1.0, 0.0, 0.5):
        run.advance(t)
        assert run["load.w"] == pytest.approx(8.0 * (1.0 - math.exp(-(t + 3.0) / 4.0)), rel=1e-6)


def test_interrupts_are_listened_for_during_an_advance(drive: gl.System) -> None:
    """While a function of time is an input; not before it and after it."""
    before, hooks = sys.unraisablehook, []

    def torque(t: float) -> float:
        hooks.append(sys.unraisablehook)
        return 1.0

    run = drive.stepper(method="rk5", inputs={"torque.tau": torque})
    hooks.clear()
    run.advance(0.5)
    assert any(hook is not before for hook in hooks)  # but for the values at the start
    assert sys.unraisablehook is before
