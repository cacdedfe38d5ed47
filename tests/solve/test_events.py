"""Events: relations, discrete variables, When and reinit, time events; both integrators, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

METHODS = ["rk5", "rk8", "ida"]


class Ball(gl.Component):
    """Falls on a floor at h = 0 and bounces with restitution e."""

    e = gl.Parameter("1", "restitution", default=0.8, min=0, max=1)
    h = gl.Variable("m", "height", start=1.0)
    v = gl.Variable("m/s", "speed", start=0.0)
    bounces = gl.Discrete("how often it touched the floor")

    def equations(self):
        return [
            gl.Eq(gl.der(self.h), self.v),
            gl.Eq(gl.der(self.v), -9.81),
            gl.When(self.h < 0, gl.reinit(self.v, -self.e * self.v), gl.Eq(self.bounces, gl.pre(self.bounces) + 1)),
        ]


def ball_height(t: float, e: float, g: float = 9.81) -> tuple[float, int]:
    """Height and number of bounces in closed form."""
    start, speed, count = math.sqrt(2 / g), math.sqrt(2 * g), 0
    if t < start:
        return 1 - g * t * t / 2, 0
    while True:
        count += 1
        speed *= e
        if t < start + 2 * speed / g:
            s = t - start
            return speed * s - g * s * s / 2, count
        start += 2 * speed / g


@pytest.mark.parametrize("method", METHODS)
def test_bouncing_ball(method):
    system = gl.compile(Ball(), outputs=["h", "bounces"])
    result = system.simulate(t_end=2.5, samples=41, method=method, rtol=1e-9, parameters={"e": 0.7})
    expected = [ball_height(t, 0.7) for t in result.time]
    assert result["h"] == pytest.approx([h for h, _ in expected], abs=1e-7)
    assert result["bounces"].tolist() == [n for _, n in expected]
    assert len(result.events) == 2 * result["bounces"][-1], "down through the floor, and up again"


class Stops(gl.Component):
    """x' = 1 until x reaches 1, then x' = 0; y counts the time since the start of the pulse."""

    x = gl.Variable("1", "position")
    y = gl.Variable("1", "integral of a pulse")
    high = gl.Variable("1", "pulse")

    def equations(self):
        return [
            gl.Eq(gl.der(self.x), gl.Piecewise((1, self.x < 1), (0, True))),
            gl.Eq(self.high, gl.Piecewise((0, gl.time < 0.3), (2, gl.time < 0.7), (0, True))),
            gl.Eq(gl.der(self.y), self.high),
        ]


@pytest.mark.parametrize("method", [*METHODS, "auto"])
def test_time_and_state_events(method):
    result = gl.simulate(Stops(), t_end=2.0, times=np.array([0, 0.3, 0.5, 0.7, 1.0, 2.0]), method=method, rtol=1e-9)
    assert result["y"] == pytest.approx([0, 0, 0.4, 0.8, 0.8, 0.8], abs=1e-9)
    assert result["x"][-1] == pytest.approx(1.0, abs=1e-8)
    assert result["high"].tolist() == [0, 2, 2, 0, 0, 0], "a sample on an event has the right-hand limit"


class Oscillator(gl.Component):
    """Mass with a gap: no force within +-g, stiffness c beyond (closed form in pieces)."""

    c = gl.Parameter("N/m", "stiffness", default=400.0)
    x = gl.Variable("m", "position", start=0.0)
    v = gl.Variable("m/s", "speed", start=1.0)

    def equations(self):
        force = gl.Piecewise((self.c * (self.x - 0.1), self.x > 0.1), (self.c * (self.x + 0.1), self.x < -0.1), (0, True))
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), -force)]


@pytest.mark.parametrize("method", METHODS)
def test_gap_oscillator_period(method):
    """The period is that of flight over the gap plus half a vibration on either side."""
    period = 4 * 0.1 / 1.0 + 2 * math.pi / 20
    result = gl.simulate(Oscillator(), t_end=20 * period, samples=21, method=method, rtol=1e-9)
    assert result["x"] == pytest.approx(np.zeros(21), abs=2e-6)
    assert result["v"] == pytest.approx(np.ones(21), abs=2e-6)


def test_two_clutches_on_one_rigid_shaft_share_a_torque_that_nothing_determines():
    """Both stuck: singular but consistent. The speed is right, and the sum of the torques."""

    class Pair(gl.Component):
        def assemble(self):
            self.torque, self.body, self.ground = gp.Torque(tau=10.0), gp.Inertia(J=2.0), gp.Fixed()
            self.brake = [gp.Brake(fn_max=100, f_normalized=1.0) for _ in range(2)]
            return [
                gl.connect(self.torque.flange, self.body.flange_a),
                gl.connect(self.body.flange_b, self.brake[0].flange_a),
                gl.connect(self.brake[0].flange_b, self.brake[1].flange_a),
            ]

    result = gl.simulate(Pair(), t_end=1.0, samples=5, method="rk", outputs=["body.w", "brake[0].tau", "brake[1].tau"])
    assert result["body.w"] == pytest.approx(np.zeros(5), abs=1e-12)
    assert result["brake[0].tau"] + result["brake[1].tau"] == pytest.approx(10 * np.ones(5)), "into the brakes"


def test_discrete_variable_without_an_equation_is_named():
    class Broken(gl.Component):
        mode = gl.Discrete("nothing sets it")
        x = gl.Variable("1", "x")

        def equations(self):
            return [gl.Eq(gl.der(self.x), self.mode)]

    with pytest.raises(gl.GearlibError, match="'mode' has 0 equations"):
        gl.compile(Broken())


def test_chattering_is_reported_with_the_component():
    class Chatter(gl.Component):
        x = gl.Variable("1", "x", start=0.5)

        def equations(self):
            return [gl.Eq(gl.der(self.x), gl.Piecewise((1, self.x < 0), (-1, True)))]

    with pytest.raises(gl.GearlibError, match=r"events chatter at t = 0.5 s .* of Chatter"):
        gl.simulate(Chatter(), t_end=1.0, method="rk")
