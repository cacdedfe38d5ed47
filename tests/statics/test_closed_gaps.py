"""Power flow through gaps: which side is in contact where a speed is given and a torque is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.statics.closed_gaps import drifting, refuse_drift
from gearlib.statics.steady_motion import Given, motion_from, settled_discrete

C, D, B = 1e4, 10.0, 0.01
COUPLINGS: dict[str, Callable[[], Any]] = {
    "limited": lambda: gp.ElastoBacklash(c=C, d=D, b=B),
    "jumping": lambda: gp.ElastoBacklash2(c=C, d=D, b=B),
    "mesh": lambda: gp.DetailedExternalMesh(r_a=0.05, r_b=0.05, c=1e7, d=3000.0, backlash=True, b=1e-4),
}


class Through(gl.Component):
    """Motor, rotor, two gaps in series, driven body, load."""

    first = gl.Structural("limited")
    second = gl.Structural("jumping")
    load = gl.Structural("torque")

    def assemble(self) -> list[Any]:
        self.motor, self.rotor, self.middle, self.body = gp.Torque(), gp.Inertia(J=0.1), gp.Inertia(J=0.05), gp.Inertia(J=1.0)
        self.one, self.two = COUPLINGS[self.first](), COUPLINGS[self.second]()
        joined = [
            gl.connect(self.motor.flange, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.one.flange_a),
            gl.connect(self.one.flange_b, self.middle.flange_a),
            gl.connect(self.middle.flange_b, self.two.flange_a),
            gl.connect(self.two.flange_b, self.body.flange_a),
        ]
        if self.load == "torque":
            self.taker = gp.Torque()
            return [*joined, gl.connect(self.body.flange_b, self.taker.flange)]
        if self.load == "quadratic":
            self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-50.0, w_nominal=100.0, torque_direction=False)
            return [*joined, gl.connect(self.body.flange_b, self.fan.flange)]
        self.bearing, self.ground = gp.Damper(d=0.5), gp.Fixed()
        return [
            *joined,
            gl.connect(self.body.flange_b, self.bearing.flange_a),
            gl.connect(self.bearing.flange_b, self.ground.flange),
        ]


@cache
def compiled(first: str, second: str, load: str = "torque") -> gl.System:
    return gl.compile(Through(first=first, second=second, load=load))


TRAINS = [("limited", "jumping"), ("limited", "mesh"), ("mesh", "mesh")]


@pytest.mark.parametrize(("first", "second"), TRAINS)
@pytest.mark.parametrize(
    ("at", "torque", "speed"), [("rotor.w", -50.0, 100.0), ("body.w", 30.0, -3.0)]
)  # the load brakes, and drives
def test_given_speed_and_torque_of_the_load(first: str, second: str, at: str, torque: float, speed: float) -> None:
    flow = gl.power_flow(compiled(first, second), speeds={at: speed}, torques={"taker.tau": torque})
    turned = (-1) ** (first, second).count("mesh")  # external wheels reverse
    assert flow["motor.flange"].torque == pytest.approx(torque * turned, rel=1e-9)  # into the motor: against what it gives
    other = "body.flange_a" if at == "rotor.w" else "rotor.flange_a"
    assert flow[other].speed == pytest.approx(speed * turned, rel=1e-9)
    assert flow.imbalance < 1e-9


@pytest.mark.parametrize(
    ("at", "load", "speed"),
    [
        ("rotor.w", "quadratic", -100.0),
        ("rotor.w", "damper", 100.0),
        ("body.w", "damper", -100.0),
        pytest.param(
            "body.w", "quadratic", 100.0, marks=pytest.mark.slow
        ),  # Newton's method fails, and a long motion finds the state
    ],
)
def test_given_speed_and_a_load_that_grows_with_it(load: str, at: str, speed: float) -> None:
    """An open gap would leave the load standing still while the motor turns; it does not stay open."""
    system = compiled("limited", "jumping", load)
    flow = gl.power_flow(system, speeds={at: speed})
    assert flow["body.flange_a"].speed == pytest.approx(speed, rel=1e-9)
    assert flow["motor.flange"].torque == pytest.approx(-speed / 2, rel=1e-9)
    closed = gl.power_flow(system, speeds={at: speed}, parameters={"one.b": 0.0, "two.b": 0.0})
    assert flow.input_power == pytest.approx(closed.input_power, rel=1e-9)


@pytest.mark.parametrize(("first", "second"), TRAINS)
def test_sides_of_a_gap_at_two_speeds_are_refused(first: str, second: str) -> None:
    system = compiled(first, second)
    with pytest.raises(ArgumentError, match="a gap is open between sides that turn at different speeds") as refused:
        gl.power_flow(system, speeds={"rotor.w": 100.0, "middle.w": 50.0, "body.w": 50.0}, torques={"taker.tau": 0.0})
    assert "one" in str(refused.value).partition("taker.tau: in ")[2].partition(" a gap")[0]


class Coupling(gl.Component):
    """Two bodies with a gap of 0.2 rad between them."""

    def assemble(self) -> list[Any]:
        self.a, self.b, self.gap = gp.Inertia(J=1.0), gp.Inertia(J=2.0), gp.ElastoBacklash(c=C, d=D, b=0.2)
        return [gl.connect(self.a.flange_b, self.gap.flange_a), gl.connect(self.gap.flange_b, self.b.flange_a)]


@pytest.mark.parametrize("pace", [1.0, 1e-10])
@pytest.mark.parametrize(
    ("twist", "rate", "drifts"),
    [
        (0.0, 1.0, True), (0.0, -1.0, True), (0.05, -3.0, True), (0.0, 0.0, False), (0.0, 1e-10, False),  # of the speed: rounding
        (0.15, 1.0, False), (0.15, -1.0, True), (0.15, 0.0, False), (-0.15, 1.0, True), (-0.15, -1.0, False),
    ],
)  # fmt: skip
def test_a_gap_that_turns_open_or_shut_does_not_last(twist: float, rate: float, drifts: bool, pace: float) -> None:
    """Inside the gap any relative speed changes something; in contact one that leads away from it; however slow all is."""
    translation = compiled_coupling().translation
    model, numbers = translation.model, translation.parameter_values({})
    still = motion_from(model, numbers, [], np.zeros(2 * model.n_variables))
    constants, rates = np.zeros(model.n_variables), np.zeros(model.n_variables)
    v = model.variable("gap.phi_rel")
    rep, sign = int(model.representative[v]), int(model.sign[v])
    constants[rep], rates[rep] = sign * twist, sign * rate * pace
    rates[int(model.representative[model.variable("a.phi")])] = pace
    discrete = settled_discrete(model, numbers, constants, rates)
    motion = replace(still, constants=constants, rates=rates, discrete=discrete)
    assert drifting(model, numbers, motion) == (["gap"] if drifts else [])
    if drifts:
        said = "^no steady motion has the given a.w, b.w: in gap a gap is open between sides that turn at different speeds, or another"
        with pytest.raises(ArgumentError, match=said):
            refuse_drift(model, numbers, motion, [Given("a.w", 0, 0, 1.0), Given("b.w", 0, 0, 1.0)])
    else:
        refuse_drift(model, numbers, motion, [])
        assert drifting(model, numbers, replace(motion, rates=np.zeros(len(rates)))) == []


class Counted(Coupling):
    """With a condition of the model itself on the angle."""

    turned = gl.Variable("1", "1 before a turn, and 2 behind it")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.turned, gl.Piecewise((1, self.a.flange_a.phi < 2 * np.pi), (2, True)))]


def test_a_condition_of_the_model_itself_is_named_by_its_class() -> None:
    closed = {"gap.b": 0.0}
    with pytest.raises(
        ArgumentError, match=r"^no steady motion has the given a\.w: in Counted a gap is open .* or another condition"
    ):
        gl.power_flow(gl.compile(Counted()), speeds={"a.w": 1.0}, parameters=closed)
    assert gl.power_flow(gl.compile(Counted()), speeds={"a.w": -1.0}, parameters=closed)["b.flange_a"].speed == -1.0


@cache
def compiled_coupling() -> gl.System:
    return gl.compile(Coupling())


class Chain(gl.Component):
    """Motor, bodies with gaps between them, load."""

    gaps, load = gl.Structural(7), gl.Structural("fan")

    def assemble(self) -> list[Any]:
        self.motor, self.ground = gp.Torque(), gp.Fixed()
        self.body, self.gap = (
            [gp.Inertia(J=0.1) for _ in range(self.gaps + 1)],
            [COUPLINGS["limited"]() for _ in range(self.gaps)],
        )
        joined = [
            gl.connect(self.motor.flange, self.body[0].flange_a),
            *[gl.connect(body.flange_b, gap.flange_a) for body, gap in zip(self.body[:-1], self.gap, strict=True)],
            *[gl.connect(gap.flange_b, body.flange_a) for body, gap in zip(self.body[1:], self.gap, strict=True)],
        ]
        if self.load == "damper":
            self.damper = gp.Damper(d=0.5)
            ends = (
                gl.connect(self.damper.flange_a, self.body[-1].flange_b),
                gl.connect(self.damper.flange_b, self.ground.flange),
            )
            return [*joined, *ends]
        if self.load == "fan":
            self.fan: Any = gp.QuadraticSpeedDependentTorque(tau_nominal=-4.0, w_nominal=10.0, torque_direction=False)
        else:
            self.fan = gp.Torque()
        return [*joined, gl.connect(self.body[-1].flange_b, self.fan.flange)]


@cache
def chain(gaps: int, load: str) -> gl.System:
    return gl.compile(Chain(gaps=gaps, load=load))


def test_more_gaps_than_are_tried_are_closed_where_the_steady_state_has_them() -> None:
    """Seven in series, two sides each: 4 N.m backwards turn a load of 4 N.m (w / 10 rad/s)^2."""
    flow = chain(7, "fan").power_flow(torques={"motor.tau": -4.0})
    assert [flow[f"gap[{k}].flange_a"].torque for k in range(7)] == pytest.approx([-4.0] * 7, rel=1e-9)
    assert flow["fan.flange"].speed == pytest.approx(-10.0, rel=1e-9)


@pytest.mark.parametrize("place", ["body[0].w", "body[8].w"])
@pytest.mark.parametrize(
    ("load", "speed", "torque"), [("damper", 3.0, -1.5), ("damper", -3.0, 1.5), ("torque", -3.0, 5.0), ("torque", -3.0, -5.0)]
)
def test_a_long_row_of_gaps_is_closed_in_either_sense(place: str, load: str, speed: float, torque: float) -> None:
    """Eight in series, wherever the speed is given: what the load takes goes through all of them."""
    flow = chain(8, load).power_flow(speeds={place: speed}, torques={"fan.tau": torque} if load == "torque" else {})
    assert [flow[f"gap[{k}].flange_b"].torque for k in range(8)] == pytest.approx([torque] * 8, rel=1e-9)
    assert [flow[f"body[{k}].flange_a"].speed for k in range(9)] == pytest.approx([speed] * 9, rel=1e-9)
