"""Runs that begin late: no digits of a step are lost to the clock, and where those of the drive are, that is said."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

STARTS = [1e3, 1e6, 1e9, -1e9]


class Driven(gl.Component):
    """A sine torque on two bodies with a gap between them, one of which a bearing holds back."""

    t0 = gl.Parameter("s", "when the drive begins", default=0.0)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=10 * gl.sin(30 * (gl.time - self.t0)))
        self.motor, self.gap, self.load = gp.Inertia(J=0.1), gp.ElastoBacklash(c=1e4, d=3.0, b=1e-3), gp.Inertia(J=0.2)
        self.bearing = gp.BearingFriction(tau_pos=((0.0, 0.5),))
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.gap.flange_a),
            gl.connect(self.gap.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.bearing.flange_a),
        ]


class Coasting(gl.Component):
    """A vibration that time does not drive."""

    def assemble(self) -> list[Any]:
        self.body, self.spring, self.wall = gp.Inertia(J=1.0), gp.SpringDamper(c=1e4, d=0.0), gp.Fixed()
        self.bearing = gp.BearingFriction(tau_pos=((0.0, 0.5), (1.0, 0.7)))
        return [
            gl.connect(self.wall.flange, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.body.flange_a),
            gl.connect(self.body.flange_b, self.bearing.flange_a),
        ]


def histories(component: gl.Component, t0: float, method: str, rtol: float, **options: Any) -> tuple[Any, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of the clock: tested below
        run = gl.simulate(component, t0 + 0.5, t_start=t0, samples=65, method=method, rtol=rtol, **options)
    return run, run["load.w" if isinstance(component, Driven) else "body.w"]


@pytest.mark.parametrize("t0", STARTS)
@pytest.mark.parametrize("method", ["rk5", "rk8", "ida", "auto"])
def test_late_start_changes_nothing_but_what_the_clock_rounds(method: str, t0: float) -> None:
    """What a torque of 10 N.m at 30 rad/s changes by in one tick of the clock, on 0.3 kg.m2 for half a second."""
    reference = histories(Driven(), 0.0, "rk8", 1e-10)[1]
    run, found = histories(Driven(t0=t0), t0, method, 1e-6)
    assert len(run.events) == 28
    assert np.abs(found - reference).max() < 3e-5 + 10 * 30 / 0.3 * 0.5 * np.spacing(abs(t0))


@pytest.mark.parametrize("t0", [*STARTS, 1e12])
@pytest.mark.parametrize("method", ["rk5", "rk8", "ida"])
def test_without_a_drive_a_late_start_changes_nothing(method: str, t0: float) -> None:
    given = {"start": {"body.w": 1.0}}
    reference = histories(Coasting(), 0.0, method, 1e-6, **given)[1]
    found = histories(Coasting(), t0, method, 1e-6, **given)[1]
    assert np.abs(found - reference).max() < 3e-5


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida"])
def test_accuracy_that_the_clock_does_not_allow_is_said(method: str) -> None:
    with pytest.warns(RuntimeWarning, match=r"at t = 1e\+09 s the clock's resolution is 1\.2e-07 s, too coarse for rtol=1e-06"):
        gl.simulate(Driven(t0=1e9), 1e9 + 0.5, t_start=1e9, samples=5, method=method)
    gl.simulate(Driven(t0=1e6), 1e6 + 0.5, t_start=1e6, samples=5, method=method)  # no warning, which would be an error


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida"])
def test_conditions_in_time_switch_at_a_late_time(method: str) -> None:
    class Switched(gl.Component):
        x = gl.Variable("1", "goes up after 1e9 + 0.3 s", start=0.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), gl.Piecewise((1.0, gl.time >= 1e9 + 0.3), (0.0, True)))]

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        run = gl.simulate(Switched(), 1e9 + 1.0, t_start=1e9, samples=11, method=method)
    assert run["x"][-1] == pytest.approx(0.7, abs=2e-7)
    assert [(t, name) for t, name in run.events] == [
        (1e9 + 0.3, "Switched: der(x) = Piecewise((1.0, time >= 1000000000.3), (0.0, True))")
    ]


@pytest.mark.parametrize("method", ["rk", "ida"])
def test_many_events_late_do_not_count_as_chattering(method: str) -> None:
    """1500 instants in 1.5 s, each counted in an interval of its own."""

    class Sampled(gl.Component):
        x, n = gl.Variable("1", start=0.0), gl.Discrete("instants")

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), -self.x), gl.When(gl.sample(0.0009765625), gl.Eq(self.n, gl.pre(self.n) + 1))]

    system = gl.compile(Sampled(), ["n"])
    for t_start in (0.0, 4096.0):
        run = system.simulate(t_start + 1.5, t_start=t_start, samples=2, method=method)
        assert np.diff(run["n"]).tolist() == [1536.0]
