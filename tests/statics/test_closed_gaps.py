"""Power flow through gaps: which side is in contact where a speed is given and a torque is found."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError

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
