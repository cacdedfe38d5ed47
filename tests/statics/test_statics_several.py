"""Trains with several steady motions, of any speed; what changes with time; and names in a train of one part."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, InputWarning
from gearlib.statics import statics
from gearlib.statics.steady_motion import Given


@cache
def blown(guess: float | None = None) -> gl.System:
    """A torque on a body with drag, and in air, whose torque has one direction whichever way it turns."""

    class Blown(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.body = gp.Torque(tau=1.0), gp.Inertia(J=1.0, guess={} if guess is None else {"w": guess})
            self.air = gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=1.0, torque_direction=True)
            self.drag = gp.LinearSpeedDependentTorque(tau_nominal=-1.0, w_nominal=1.0, torque_direction=False)
            return [gl.connect(self.motor.flange, self.body.flange_a, self.air.flange, self.drag.flange)]

    return gl.compile(Blown())


@pytest.mark.parametrize("speed", [1e-7, 1.0, 1e7])
def test_motions_both_ways_are_told_however_slow_or_fast(speed: float) -> None:
    """Where no run says which: the torque stands in place of what the motor does. 4 = x^2 + x for x times the speed."""
    with pytest.raises(ArgumentError) as refused:
        gl.power_flow(blown(), torques={"motor.tau": 4.0}, parameters={"air.w_nominal": speed, "drag.w_nominal": speed})
    said = str(refused.value)
    assert said.startswith("several steady motions have the given motor.tau: der(")
    one, other = said.partition(") is ")[2].partition("; give a speed, or say near which one it turns")[0].split(" in one and ")
    assert sorted([float(one), float(other.removesuffix(" in another"))]) == pytest.approx(
        [speed * (-1 - 17**0.5) / 2, speed * (-1 + 17**0.5) / 2], rel=1e-5
    )


@pytest.mark.parametrize(("guess", "sign"), [(1.0, 1), (40.0, 1), (-2.0, -1), (-40.0, -1)])
def test_of_several_motions_the_one_near_the_guess_is_meant(guess: float, sign: int) -> None:
    """Also where the torque stands in place of what the motor does, and from rest the other motion is found: 4 = x^2 + x."""
    flow = gl.power_flow(blown(guess), torques={"motor.tau": 4.0})
    assert flow["body.flange_a"].speed == pytest.approx((-1 + sign * 17**0.5) / 2, rel=1e-9)


class Levelling(gl.Component):
    """A load that hardly depends on speed where that is high."""

    flange = gp.Flange("shaft")
    tau, second = gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, self.tau * gl.tanh(self.second * gl.der(self.flange.phi)))]


@pytest.mark.parametrize("guess", [0.3, 50.0])
def test_a_guess_near_which_there_is_no_motion_hides_none(guess: float) -> None:
    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.body, self.load = gp.Torque(tau=0.1), gp.Inertia(J=1.0, guess={"w": guess}), Levelling()
            return [gl.connect(self.motor.flange, self.body.flange_a, self.load.flange)]

    flow = gl.power_flow(gl.compile(Train()), torques={"motor.tau": 0.5})
    assert flow["body.flange_a"].speed == pytest.approx(np.arctanh(0.5), rel=1e-9)


class Climb(gl.Component):
    """A load whose torque is zero at three speeds, of which the middle one is left at once; other laws hold long before and later."""

    flange = gp.Flange("shaft")
    k, second = gl.Parameter("N.m.s3/rad3", default=1.0), gl.Parameter("s", default=1.0)
    w = gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        law = self.k * (self.w - 1) * (self.w - 2) * (self.w - 3)
        return [
            gl.Eq(self.w, gl.der(self.flange.phi)),
            gl.Eq(self.flange.tau, gl.Piecewise((law, gl.time**2 < 0.25 * self.second**2), (-law, True))),
        ]


def test_the_motion_reached_is_searched_for_whatever_the_size_of_a_train_that_is_not_linear(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By the laws that hold at time 0."""

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.load = gp.Inertia(J=1.0, start={"w": 2.2}), Climb()
            return [gl.connect(self.body.flange_b, self.load.flange)]

    monkeypatch.setattr(statics, "MOST_JUDGED", 0)
    with pytest.warns(
        InputWarning, match=r"^Train: load changes with time, and counts with its value at t = 0 in the power flow$"
    ):
        assert gl.power_flow(gl.compile(Train()))["load.flange"].speed == pytest.approx(3.0, rel=1e-9)


def test_a_motion_other_than_that_of_the_run_is_not_taken_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The run ends at 3; where that is not what the equations give near it, they are solved near the start value."""

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.load = gp.Inertia(J=1.0, start={"w": 2.2}), Climb()
            return [gl.connect(self.body.flange_b, self.load.flange)]

    monkeypatch.setattr(statics, "agree", lambda *_: False)
    with pytest.warns(InputWarning, match="changes with time"):
        assert gl.power_flow(gl.compile(Train()))["load.flange"].speed == pytest.approx(2.0, rel=1e-9)


def test_of_several_inputs_over_time_the_first_is_named_to_be_given() -> None:
    class Twice(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.two = gp.Torque(tau=2 + gl.time), gp.Torque(tau=1 - gl.time)
            self.body, self.drag, self.wall = gp.Inertia(J=1.0), gp.Damper(d=0.5), gp.Fixed()
            ends = gl.connect(self.one.flange, self.two.flange, self.body.flange_a, self.drag.flange_a)
            return [ends, gl.connect(self.drag.flange_b, self.wall.flange)]

    system = gl.compile(Twice())
    with pytest.warns(InputWarning) as said:
        assert gl.power_flow(system)["body.flange_a"].speed == pytest.approx(6.0)
    (warning,) = said
    assert str(warning.message).startswith("Twice: one.tau, two.tau change with time, and count with their values at t = 0")
    assert str(warning.message).endswith("; pass power_flow(torques={'one.tau': ...})")
    with pytest.warns(
        InputWarning, match=r"^Twice: two\.tau changes with time, .*; pass power_flow\(torques=\{'two\.tau': \.\.\.\}\)$"
    ):
        gl.power_flow(system, torques={"one.tau": 3.0})


class Alone(gl.Component):
    """A train of one part."""

    left, right = gp.Flange("left"), gp.Flange("right")
    ratio, J = gl.Parameter("1", default=2.0), gl.Parameter("kg.m2", default=1.0)
    w = gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.left.phi, self.ratio * self.right.phi),
            gl.Eq(self.w, gl.der(self.right.phi)),
            gl.Eq(self.J * gl.der(self.w), self.right.tau + self.ratio * self.left.tau),
        ]


class Held(gl.Component):
    """Several parts, each of which may stay open."""

    def assemble(self) -> list[Any]:
        self.motor, self.body = [gp.Torque() for _ in range(5)], [gp.Inertia(J=1.0) for _ in range(5)]
        return [gl.connect(m.flange, b.flange_a) for m, b in zip(self.motor, self.body, strict=True)]


@cache
def held() -> gl.System:
    return gl.compile(Held())


@pytest.mark.parametrize("count", range(6))
def test_four_of_what_stays_open_are_named_and_the_others_counted(count: int) -> None:
    model = held().translation.structure.complete
    n = model.n_variables
    motion: Any = SimpleNamespace(constants=np.zeros(n), rates=np.zeros(n), undetermined=np.zeros(2 * n))
    for k in range(count):
        motion.undetermined[int(model.representative[model.variable(f"motor[{k}].tau")])] = 1.0
    if not count:
        statics.refuse_open(model, motion)
        return
    with pytest.raises(ArgumentError) as refused:
        statics.refuse_open(model, motion)
    names = ", ".join(f"input motor[{k}].tau" for k in range(min(count, 4)))
    more = " and 1 more" if count == 5 else ""
    assert str(refused.value) == f"too little is given: the {names}{more} stay open; give more speeds or torques"


def test_flanges_of_a_train_of_one_part_are_named_alone() -> None:
    model = gl.compile(Alone()).translation.structure.complete
    n = model.n_variables
    motion: Any = SimpleNamespace(constants=np.ones(n), rates=np.ones(n))
    assert [(f.name, f.component, f.leaf) for f in statics.flange_powers(model, motion)] == [
        ("left", "", True),
        ("right", "", True),
    ]
    for name in ("left", "right"):
        v = model.variable(f"{name}.tau")
        if model.sign[v]:
            assert name in statics.shared_names(model, {int(model.representative[v])})


def test_a_speed_at_the_limit_of_what_agrees_agrees() -> None:
    still = [Given("fast", 0, 0, 0.0)]
    assert statics.agree(SimpleNamespace(constants=np.array([1e-9]), rates=np.zeros(1)), still)  # type: ignore[arg-type]
    assert not statics.agree(SimpleNamespace(constants=np.array([1.0000001e-9]), rates=np.zeros(1)), still)  # type: ignore[arg-type]


@pytest.mark.parametrize("phase", [0.0, 1.0])
def test_a_torque_that_swings_about_its_mean_needs_no_warning(phase: float) -> None:
    """Though it is far from that at time 0."""

    class Swung(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.body = gp.Torque(tau=2 + 5 * gl.cos(3 * gl.time + phase)), gp.Inertia(J=1.0)
            self.drag, self.wall = gp.Damper(d=0.5), gp.Fixed()
            ends = gl.connect(self.torque.flange, self.body.flange_a, self.drag.flange_a)
            return [ends, gl.connect(self.drag.flange_b, self.wall.flange)]

    flow = gl.power_flow(gl.compile(Swung()))
    assert (flow["body.flange_a"].speed, flow["torque.flange"].torque) == pytest.approx((4.0, -2.0))
