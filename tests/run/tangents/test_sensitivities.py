"""Sensitivities of smooth runs, against closed forms and against runs with other numbers."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError
from tests.run.tangents.other_runs import against_other_runs, differences, off
from tests.trains import Chain

c = gl.connect


@pytest.fixture(scope="module")
def driven() -> gl.System:
    return gl.compile(gp.ZhouCui2022(tau_in=100.0, e_amplitude=1e-5, e_omega=500.0, e_phase=0.1), outputs=["w_out", "q_ring"])


@pytest.mark.parametrize("parameter", ["K_g", "C_g", "I_r", "R_s", "e_amplitude", "e_omega", "e_phase", "start(w_in)"])
def test_of_the_xp_train(driven: gl.System, parameter: str) -> None:
    against_other_runs(driven, [parameter], ["w_out", "q_ring", "der(w_out)"], 0.05, "exact")


class Decay(gl.Component):
    """x' = -k x, and what follows from x."""

    k = gl.Parameter("1/s", "rate", default=0.7)
    x = gl.Variable("1", "quantity", start=3.0)
    y = gl.Variable("1/s", "what follows")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), -self.k * self.x), gl.Eq(self.y, self.k**2 * self.x * gl.time)]


@pytest.mark.parametrize("method", ["auto", "exact", "rk", "rk5", "rk8", "ida"])
def test_of_a_decay(method: str) -> None:
    run = gl.compile(Decay()).simulate(2.0, samples=9, rtol=1e-9, method=method, sensitivities=["k", "start(x)"])
    t, decay = run.time, np.exp(-0.7 * run.time)
    for name, parameter, right in (
        ("x", "k", -t * 3.0 * decay),
        ("x", "start(x)", decay),
        ("y", "k", (2 * 0.7 - 0.7**2 * t) * 3.0 * t * decay),
        ("y", "start(x)", 0.7**2 * t * decay),
        ("der(x)", "k", (0.7 * t - 1) * 3.0 * decay),
    ):
        assert off(run.sensitivity(name, parameter), right) < 2e-8, (name, parameter)


@pytest.mark.parametrize("parameter", ["J", "c", "d_load", "body[1].J", "start(body[0].w)"])
def test_of_what_is_bound_to_a_parameter(chain: Callable[..., gl.System], parameter: str) -> None:
    against_other_runs(
        chain(grounded=True),
        [parameter],
        ["body[3].w", "shaft[0].tau", "der(body[0].w)"],
        2.0,
        "exact",
        inputs={"torque.tau": 3.0},
    )


def test_a_bound_parameter_that_is_given_does_not_follow() -> None:
    system = gl.compile(Chain(grounded=True), outputs=["body[3].w"])
    given = {"body[1].J": 1.3}  # the value that it would have
    run = system.simulate(1.0, samples=5, rtol=1e-10, inputs={"torque.tau": 1.0}, parameters=given, sensitivities=["J"])

    def other(J: float) -> Any:
        return system.simulate(1.0, samples=5, inputs={"torque.tau": 1.0}, parameters={**given, "J": J})["body[3].w"]

    assert off(run.sensitivity("body[3].w", "J"), differences(other, 1.0)) < 1e-6


class Closed(gl.Component):
    """A rigid loop of gears, a shaft and a load that grows with the square of the speed; the torque changes with time."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=10 + 5 * gl.sin(20 * gl.pi * gl.time))
        self.motor, self.carrier, self.ring = gp.Inertia(J=0.01), gp.Inertia(J=0.05), gp.Inertia(J=0.1)
        self.load, self.closing = gp.Inertia(J=2.0), gp.IdealGear(ratio=0.5)
        self.planetary, self.shaft = gp.IdealPlanetary(ratio=81 / 19), gp.SpringDamper(c=1e4, d=10.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-0.05, w_nominal=1.0, torque_direction=False)
        return [
            c(self.torque.flange, self.motor.flange_a), c(self.motor.flange_b, self.planetary.sun),
            c(self.planetary.ring, self.ring.flange_a), c(self.planetary.carrier, self.carrier.flange_a),
            c(self.ring.flange_b, self.closing.flange_a), c(self.closing.flange_b, self.carrier.flange_a),
            c(self.carrier.flange_b, self.shaft.flange_a), c(self.shaft.flange_b, self.load.flange_a),
            c(self.load.flange_b, self.fan.flange),
        ]  # fmt: skip


@pytest.mark.parametrize("parameter", ["load.J", "motor.J", "planetary.ratio", "closing.ratio", "shaft.c", "fan.tau_nominal"])
def test_through_constant_linear_blocks(parameter: str) -> None:
    against_other_runs(gl.compile(Closed()), [parameter], ["load.w", "shaft.tau", "planetary.sun.tau"], 0.3, "rk8")


class Implicit(gl.Component):
    """A decay driven by r, which solves r + a r^3 + sin(r) / 10 = x by iteration."""

    k = gl.Parameter("1/s", "rate", default=1.0)
    a = gl.Parameter("1", "hardening", default=0.5)
    x = gl.Variable("1", "quantity")
    r = gl.Variable("1", "force")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), -self.k * self.r), gl.Eq(self.r + self.a * self.r**3 + 0.1 * gl.sin(self.r), self.x)]


@pytest.mark.parametrize("parameter", ["a", "start(x)"])
def test_through_blocks_that_are_solved_by_iteration(parameter: str) -> None:
    system = gl.compile(Implicit(start={"x": 2.0}))
    run = system.simulate(1.5, samples=7, rtol=1e-10, sensitivities=[parameter])

    def other(value: float) -> Any:
        given = {"start": {"x": value}} if parameter == "start(x)" else {"parameters": {"a": value}}
        result = system.simulate(1.5, samples=7, rtol=1e-12, method="rk8", **given)
        return np.array([result["x"], result["r"]])

    right = differences(other, 2.0 if parameter == "start(x)" else 0.5)
    assert off(run.sensitivity("x", parameter), right[0]) < 1e-6
    assert off(run.sensitivity("r", parameter), right[1]) < 1e-6


def test_of_a_start_that_is_bound_to_a_parameter() -> None:
    class Bound(gl.Component):
        x0 = gl.Parameter("1", default=3.0)

        def assemble(self) -> list[Any]:
            self.inner = Decay(start={"x": 2.0 * self.x0})
            return []

    run = gl.compile(Bound()).simulate(1.0, samples=3, rtol=1e-9, sensitivities=["x0"])
    assert off(run.sensitivity("inner.x", "x0"), 2.0 * np.exp(-0.7 * run.time)) < 1e-8
    assert (
        not gl.compile(Bound())
        .simulate(1.0, samples=3, start={"inner.x": 6.0}, sensitivities=["x0"])
        .sensitivity("inner.x", "x0")
        .any()
    )


def test_with_an_input_that_is_a_function_or_a_table(chain: Callable[..., gl.System]) -> None:
    system = gl.compile(Chain(grounded=True), outputs=["body[3].w"])
    for tau in (lambda t: 3.0 * np.sin(5.0 * t), gl.Table([0.0, 0.3, 1.0], [0.0, 2.0, -1.0])):
        run = system.simulate(1.0, samples=5, rtol=1e-10, inputs={"torque.tau": tau}, sensitivities=["c"])

        def other(value: float, tau: Any = tau) -> Any:
            found = system.simulate(
                1.0, samples=5, rtol=1e-12, method="rk8", inputs={"torque.tau": tau}, parameters={"c": value}
            )
            return found["body[3].w"]

        assert off(run.sensitivity("body[3].w", "c"), differences(other, 100.0)) < 1e-6


def test_of_an_angle_that_was_not_integrated() -> None:
    run = gl.compile(Chain(grounded=True), outputs=["body[3].w"]).simulate(
        1.0, samples=11, rtol=1e-10, inputs={"torque.tau": 3.0}, sensitivities=["J"]
    )
    slope = run.sensitivity("body[3].w", "J")
    angle = run.sensitivity("body[3].phi", "J")
    assert angle[-1] == pytest.approx(np.trapezoid(slope, run.time), rel=0.02)


def test_samples_and_other_copies_of_a_run(driven: gl.System) -> None:
    run = driven.simulate(0.02, samples=3, rtol=1e-9, sensitivities=["K_g"])
    other = driven.simulate(0.02, times=[0.01, 0.02], rtol=1e-9, sensitivities=["K_g"])
    assert np.allclose(run.sensitivity("w_out", "K_g")[1:], other.sensitivity("w_out", "K_g"), rtol=1e-12)
    copy = pickle.loads(pickle.dumps(run))
    assert (copy.sensitivity("q_ring", "K_g") == run.sensitivity("q_ring", "K_g")).all()
    assert np.allclose(run["w_out"], driven.simulate(0.02, samples=3, rtol=1e-9)["w_out"], rtol=1e-8)


def test_stiff_scenes_go_on_with_ida() -> None:
    class Fast(gl.Component):
        k, k0 = gl.Parameter("1/s", default=1e5), gl.Parameter("1/s", default=1.0)
        x, y = gl.Variable("1", start=1.0), gl.Variable("1", start=0.0)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), -self.k0 * self.x**2),
                gl.Eq(gl.der(self.y), -self.k * self.y + 1e5 * self.k0 * self.x),
            ]

    run = gl.compile(Fast()).simulate(3.0, samples=4, rtol=1e-8, sensitivities=["k", "start(x)"])
    assert "IDA" in run.stats["why"]
    assert off(run.sensitivity("x", "start(x)"), 1 / (1 + run.time) ** 2) < 1e-6
    assert off(run.sensitivity("y", "k")[1:], -1.0 / (1 + run.time[1:]) / 1e5) < 1e-4


@pytest.mark.parametrize(
    ("names", "error", "text"),
    [
        (["nonsense"], NameLookupError, "no parameter 'nonsense'"),
        (["body[0].w"], NameLookupError, r"write 'start\(body\[0\].w\)'"),
        (["torque.tau"], NameLookupError, "an input"),
        (["n"], NameLookupError, "a structural choice"),
        (["start(nonsense)"], NameLookupError, "nonsense"),
        (["start(der(body[0].w))"], NameLookupError, "derivative"),
        (["c", "c"], ArgumentError, "twice"),
        ("c", ArgumentError, "sensitivities"),
        (3, ArgumentError, "sensitivities"),
    ],
)
def test_names_that_are_refused(chain: Callable[..., gl.System], names: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        chain(grounded=True).simulate(1.0, sensitivities=names)


def test_what_a_run_was_not_asked_for_is_refused(chain: Callable[..., gl.System]) -> None:
    run = chain(grounded=True).simulate(1.0, samples=3, inputs={"torque.tau": 1.0}, sensitivities=["c"])
    with pytest.raises(ArgumentError, match=r"not asked for sensitivities with respect to 'd' \(it has c\)"):
        run.sensitivity("body[3].w", "d")
    with pytest.raises(NameLookupError, match="nonsense"):
        run.sensitivity("nonsense", "c")


def test_requests_that_are_refused(chain: Callable[..., gl.System]) -> None:
    system, asked = chain(grounded=True), {"sensitivities": ["c"], "inputs": {"torque.tau": 1.0}}
    with pytest.raises(ArgumentError, match="form='ode'"):
        system.simulate(1.0, method="ida", form="dae", **asked)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="needs a linear time-invariant scene"):
        gl.compile(Closed()).simulate(1.0, method="exact", sensitivities=["load.J"])
    with pytest.raises(ArgumentError, match="a run that goes on"):
        system.simulate(2.0, start=system.simulate(1.0, inputs={"torque.tau": 1.0}), sensitivities=["c"])


def test_of_a_start_that_follows_from_others() -> None:
    """Start values of a variable that is not a state: the states' follow from it, and from parameters on the way."""

    class Geared(gl.Component):
        ratio = gl.Parameter("1", default=4.0)
        w_0 = gl.Parameter("rad/s", default=3.0)

        def assemble(self) -> list[Any]:
            self.motor, self.gear, self.load = (
                gp.Inertia(J=0.1, start={"w": self.w_0}),
                gp.IdealGear(ratio=self.ratio),
                gp.Inertia(J=5.0),
            )
            self.drag = gp.QuadraticSpeedDependentTorque(tau_nominal=-2.0, w_nominal=1.0)
            return [
                c(self.motor.flange_b, self.gear.flange_a),
                c(self.gear.flange_b, self.load.flange_a),
                c(self.load.flange_b, self.drag.flange),
            ]

    system = gl.compile(Geared(), outputs=["load.w", "motor.w"])
    against_other_runs(system, ["ratio", "w_0", "start(motor.w)"], ["load.w", "motor.w"], 1.0)


@pytest.mark.parametrize("method", ["ida", "rk8"])
def test_of_an_inertia_whose_acceleration_only_the_equations_of_a_mode_use(method: str) -> None:
    """A gear with an efficiency E: the load's acceleration is a = E i tau / (J_load + E i**2 J_motor)."""

    class Lossy(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive = gp.Torque()
            self.motor, self.load = gp.Inertia(J=0.5, start={"w": 6.0}), gp.Inertia(J=2.0)
            self.gear = gp.LossyGear(ratio=3.0, loss_table=[[0.0, 0.8, 0.7, 0.0, 0.0]])
            return [
                gl.connect(self.drive.flange, self.motor.flange_a),
                gl.connect(self.motor.flange_b, self.gear.flange_a),
                gl.connect(self.gear.flange_b, self.load.flange_a),
            ]

    run = gl.compile(Lossy(), outputs=["load.w", "motor.w"]).simulate(
        2.0, samples=5, method=method, rtol=1e-9, inputs={"drive.tau": 5.0}, sensitivities=["load.J", "motor.J"]
    )
    share, felt = 0.8 * 3.0, 2.0 + 0.8 * 9.0 * 0.5
    assert run["load.w"] == pytest.approx(2.0 + share * 5.0 / felt * run.time, rel=1e-7)
    for name, moved in (("load.J", 1.0), ("motor.J", 0.8 * 9.0)):
        slope = -share * 5.0 * moved / felt**2
        assert run.sensitivity("load.w", name) == pytest.approx(slope * run.time, rel=1e-6, abs=1e-9)
        assert run.sensitivity("motor.w", name) == pytest.approx(3.0 * slope * run.time, rel=1e-6, abs=1e-9)


def test_of_a_start_value_that_there_is_not(chain: Callable[..., gl.System]) -> None:
    system = chain(grounded=True)
    asked = {"inputs": {"torque.tau": 1.0}, "samples": 5, "rtol": 1e-10}
    free = next(f"body[{i}].phi" for i in range(4) if f"body[{i}].phi" not in system.states)
    with pytest.raises(ArgumentError, match="has no start value: it follows from those of the states"):
        system.simulate(1.0, sensitivities=[f"start({free})"], **asked)
    run = system.simulate(1.0, start={free: 0.2}, sensitivities=[f"start({free})"], **asked)
    assert run.sensitivity(free, f"start({free})")[0] == pytest.approx(1.0)
    apart = [system.simulate(1.0, start={free: 0.2 + d}, **asked)["body[3].w"] for d in (-0.1, 0.1)]
    assert np.allclose(run.sensitivity("body[3].w", f"start({free})"), (apart[1] - apart[0]) / 0.2, atol=1e-8)


def test_of_a_run_that_begins_in_a_steady_state() -> None:
    class Fan(gl.Component):
        tau = gl.Parameter("N.m", default=8.0)

        def assemble(self) -> list[Any]:
            t = gl.time
            self.torque = gp.Torque(tau=self.tau * (1 + gl.Piecewise((gl.sin(t), t > 0), (0.0, True))))
            self.body, self.fan = gp.Inertia(J=0.5), gp.QuadraticSpeedDependentTorque(tau_nominal=-2.0, w_nominal=1.0)
            return [c(self.torque.flange, self.body.flange_a), c(self.body.flange_b, self.fan.flange)]

    run = against_other_runs(
        gl.compile(Fan(), outputs=["body.w"]), ["tau", "body.J", "fan.tau_nominal"], ["body.w"], 1.0, start="steady"
    )
    assert run.sensitivity("body.w", "tau")[0] == pytest.approx(0.5 / np.sqrt(2.0 * 8.0), rel=1e-8)


class Locked(gl.Component):
    """A drive, a clutch that holds, a body with a damper: behind what sticks only the damper balances the drive."""

    tau = gl.Parameter("N.m", default=7.0)
    d = gl.Parameter("N.m.s/rad", default=0.5)
    held = gl.Structural(False, "whether a brake holds the body")

    def assemble(self) -> list[Any]:
        self.torque, self.motor, self.body = gp.Torque(tau=self.tau), gp.Inertia(J=0.1), gp.Inertia(J=4.0)
        self.clutch, self.damper, self.ground = gp.Clutch(fn_max=100.0, f_normalized=1.0), gp.Damper(d=self.d), gp.Fixed()
        if self.held:
            self.brake = gp.Brake(fn_max=100.0, f_normalized=1.0)
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.clutch.flange_a),
            gl.connect(self.clutch.flange_b, self.body.flange_a, *([self.brake.flange_a] if self.held else [])),
            gl.connect(self.body.flange_b, self.damper.flange_a),
            gl.connect(self.damper.flange_b, self.ground.flange),
        ]


@pytest.mark.parametrize("held", [False, True])
def test_of_a_steady_state_behind_what_sticks(held: bool) -> None:
    """At w = tau / d, and at rest behind a brake that holds: what sticks yields by 1e-25 to a torque, which moves nothing."""
    system = gl.compile(Locked(held=held), outputs=["body.w", "clutch.tau"])
    run = system.simulate(1.0, start="steady", samples=2, sensitivities=["tau", "d"])
    assert run.sensitivity("body.w", "tau") == pytest.approx(0.0 if held else 1 / 0.5, abs=1e-9)
    assert run.sensitivity("body.w", "d") == pytest.approx(0.0 if held else -7.0 / 0.5**2, abs=1e-9)
    assert run.sensitivity("clutch.tau", "tau") == pytest.approx(-1.0)


class Wound(gl.Component):
    """A torque winds up a spring; behind it a gear, and a brake that holds its other shaft."""

    tau = gl.Parameter("N.m", default=3.0)
    c = gl.Parameter("N.m/rad", default=80.0)
    ratio = gl.Parameter("1", default=2.0)
    press = gl.Parameter("N", default=30.0)

    def assemble(self) -> list[Any]:
        self.torque, self.spring, self.gear = (
            gp.Torque(tau=self.tau),
            gp.SpringDamper(c=self.c, d=0.4),
            gp.IdealGear(ratio=self.ratio),
        )
        self.motor, self.shaft, self.wheel = gp.Inertia(J=0.2), gp.Inertia(J=1.0), gp.Inertia(J=0.3)
        self.brake = gp.Brake(fn_max=self.press, f_normalized=1.0)
        return [
            c(self.torque.flange, self.motor.flange_a),
            c(self.motor.flange_b, self.spring.flange_a),
            c(self.spring.flange_b, self.shaft.flange_a),
            c(self.shaft.flange_b, self.gear.flange_a),
            c(self.gear.flange_b, self.wheel.flange_a),
            c(self.wheel.flange_b, self.brake.flange_a),
        ]


@pytest.mark.parametrize("method", ["rk", "ida"])
def test_of_a_steady_state_in_which_everything_sticks(method: str) -> None:
    """Twist -tau / c, brake at ratio tau, no speed; also after finite changes of the parameters."""
    system = gl.compile(Wound(), outputs=["spring.phi_rel", "brake.tau", "motor.w"])
    names = ["tau", "c", "ratio", "press"]
    run = system.simulate(1.0, start="steady", samples=2, method=method, sensitivities=names)
    exact = {
        "spring.phi_rel": (-1 / 80, 3 / 80**2, 0.0, 0.0), "brake.tau": (2.0, 0.0, 3.0, 0.0), "motor.w": (0.0, 0.0, 0.0, 0.0),
    }  # fmt: skip
    for name, changes in exact.items():
        for parameter, change in zip(names, changes, strict=True):
            assert run.sensitivity(name, parameter) == pytest.approx([change] * 2, abs=1e-9), (name, parameter)
    moved = system.simulate(1.0, start="steady", samples=2, method=method, parameters={"tau": 3.001, "c": 80.01})
    shift = 0.001 * run.sensitivity("spring.phi_rel", "tau") + 0.01 * run.sensitivity("spring.phi_rel", "c")
    assert moved["spring.phi_rel"] - run["spring.phi_rel"] == pytest.approx(shift, abs=1e-8)
