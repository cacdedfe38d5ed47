"""Speeds and torques by whatever name they have, in nested and sliding trains; what does not exist is refused by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError


class Hoist(gl.Component):
    """A motor, a gearbox of two nested stages, a pinion that lifts a mass by its rack, a bearing in the housing."""

    class Box(gl.Component):
        class Stage(gl.Component):
            input, output = gp.Flange(), gp.Flange()

            def assemble(self) -> list[Any]:
                self.gear, self.wheel = gp.IdealGear(ratio=-4.0), gp.Inertia(J=0.2)
                return [
                    gl.connect(self.input, self.gear.flange_a),
                    gl.connect(self.gear.flange_b, self.wheel.flange_a),
                    gl.connect(self.wheel.flange_b, self.output),
                ]

        input, output = gp.Flange(), gp.Flange()

        def assemble(self) -> list[Any]:
            self.first, self.second = self.Stage(), self.Stage()
            return [
                gl.connect(self.input, self.first.input),
                gl.connect(self.first.output, self.second.input),
                gl.connect(self.second.output, self.output),
            ]

    def assemble(self) -> list[Any]:
        self.motor, self.rotor, self.box = gp.Torque(), gp.Inertia(J=0.1), self.Box()
        self.rack, self.load, self.lift = gp.IdealGearR2T(ratio=5.0), gp.Mass(m=10.0), gp.Force()
        self.bearing, self.housing = gp.Damper(d=0.5), gp.Fixed()
        return [
            gl.connect(self.motor.flange, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.box.input, self.bearing.flange_a),
            gl.connect(self.bearing.flange_b, self.housing.flange),
            gl.connect(self.box.output, self.rack.flange_r),
            gl.connect(self.rack.flange_t, self.load.flange_a),
            gl.connect(self.load.flange_b, self.lift.flange),
        ]


@pytest.fixture(scope="module")
def hoist() -> gl.System:
    return gl.compile(Hoist())


W, F = 80.0, 300.0  # of the rotor; the load pulls with -F


@pytest.mark.parametrize(
    ("name", "speed"),
    [("motor.flange", W), ("rotor.phi", W), ("bearing.w_rel", -W), ("box.first.output", -W / 4), ("der(load.s)", W / 80)],
)
def test_a_speed_by_any_of_its_names(hoist: gl.System, name: str, speed: float) -> None:
    """Of a flange, a speed or an angle, whatever the sign by which it stands for another; the motion is always the same."""
    flow = gl.power_flow(hoist, speeds={name: speed}, torques={"lift.f": -F})
    assert flow["rotor.flange_a"].speed == pytest.approx(W)
    assert flow["load.flange_a"].speed == pytest.approx(W / 80)
    assert flow["motor.flange"].torque == pytest.approx(-(F / 80 + 0.5 * W))
    assert flow["bearing.flange_a"].torque == pytest.approx(0.5 * W)
    assert flow["rack.flange_t"].power == pytest.approx(-F * W / 80)
    assert flow.input_power == pytest.approx(F * W / 80 + 0.5 * W**2)
    assert flow.imbalance < 1e-12
    assert gl.speed_ratio(hoist, "rotor.w", name) == pytest.approx(W / speed)
    assert gl.speed_ratio(hoist, name, "load.v") == pytest.approx(80 * speed / W)
    assert flow.mobility == 1


def test_flanges_of_composites_repeat_those_of_their_parts(hoist: gl.System) -> None:
    flow = gl.power_flow(hoist, speeds={"rotor.w": W}, torques={"lift.f": -F})
    whole = {f.component for f in flow.flanges if not f.leaf}
    assert whole == {"box", "box.first", "box.second"}
    assert {f.component for f in flow.flanges if f.leaf} == {
        "motor", "rotor", "bearing", "housing", "rack", "load", "lift", "box.first.gear", "box.first.wheel", "box.second.gear",
        "box.second.wheel",
    }  # fmt: skip
    for stage, torque in (("first", F / 80), ("second", -F / 20)):
        assert flow[f"box.{stage}.input"].torque == pytest.approx(torque)
        assert flow[f"box.{stage}.input"].torque == pytest.approx(flow[f"box.{stage}.gear.flange_a"].torque)
        assert flow[f"box.{stage}.output"].power == pytest.approx(-flow[f"box.{stage}.input"].power)
    assert {f.name for f in flow.flanges if f.sliding} == {"rack.flange_t", "load.flange_a", "load.flange_b", "lift.flange"}
    shafts = {f.name: f.shaft for f in flow.flanges}
    assert shafts["rotor.flange_a"] == shafts["box.first.gear.flange_a"] == shafts["bearing.flange_a"]
    assert len({shafts[n] for n in ("rotor.flange_a", "box.first.output", "box.output", "load.flange_a")}) == 4
    assert shafts["housing.flange"] == shafts["bearing.flange_b"]
    assert flow.absorbed["bearing"] == pytest.approx(0.5 * W**2)
    assert "box.first.gear" in str(flow)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"speeds": {"rotor.a": 1.0}, "torques": {}}, None),
        ({"speeds": {"der(rotor.w)": 1.0}}, r"no steady motion has the given der\(rotor\.w\)"),
        ({"speeds": {"der(der(rotor.phi))": 1.0}}, r"is no speed|der\(der"),
        ({"speeds": {"housing.flange": 1.0}}, "no steady motion has the given housing.flange: the equations of housing cannot hold"),
        ({"speeds": {"rotor.w": 1.0}, "torques": {"lift.x": 1.0}}, "no input 'lift.x'"),
        ({"speeds": {"rotor.w": "fast"}}, "speed rotor.w is 'fast'; expected a finite number"),
        ({"torques": {"motor.tau": "strong"}}, "torque motor.tau is 'strong'; expected a finite number"),
        ({"speeds": 3.0}, "speeds is"),
        ({"speeds": {"rotor.w": 1.0, "load.v": 1.0}, "torques": {"lift.f": 0.0}}, r"given rotor\.w, load\.v, lift\.f: the equations of"),
        ({}, "too little is given"),
    ],
)  # fmt: skip
def test_wrong_speeds_and_torques_are_refused(hoist: gl.System, given: dict[str, Any], said: str | None) -> None:
    with pytest.raises(gl.GearlibError, match=said):
        gl.power_flow(hoist, **given)


def test_a_speed_of_zero_may_be_given_where_nothing_turns(hoist: gl.System) -> None:
    flow = gl.power_flow(hoist, speeds={"housing.flange": 0.0, "rotor.w": W}, torques={"lift.f": -F})
    assert flow["motor.flange"].torque == pytest.approx(-(F / 80 + 0.5 * W))


class Differential(gl.Component):
    """Two in a row: four bodies, three degrees of freedom."""

    def assemble(self) -> list[Any]:
        self.one, self.two, self.wall = gp.IdealPlanetary(ratio=2.0), gp.IdealPlanetary(ratio=3.0), gp.Fixed()
        self.body = [gp.Inertia(J=1.0) for _ in range(4)]
        ends = (self.one.sun, self.one.ring, self.two.sun, self.two.ring)
        return [
            gl.connect(self.one.carrier, self.two.carrier),
            *(gl.connect(end, body.flange_a) for end, body in zip(ends, self.body, strict=True)),
        ]


def test_ratios_with_something_held() -> None:
    system = gl.compile(Differential())
    assert gl.mobility(system) == 3
    held = ["one.ring", "two.ring"]
    assert gl.speed_ratio(system, "one.sun", "two.sun", held=held) == pytest.approx(3 / 4)
    assert gl.speed_ratio(system, "body[0].w", "one.carrier", held=held) == pytest.approx(3.0)
    assert gl.speed_ratio(system, "one.sun", "one.ring", held=["one.carrier"]) == pytest.approx(-2.0)
    for driving, driven, held, said in (
        ("one.sun", "two.sun", ["one.ring"], r"two\.sun does not follow from one\.sun alone; name the speeds that are held"),
        ("one.sun", "two.sun", ["one.ring", "one.carrier"], r"one\.sun cannot turn with one\.ring, one\.carrier held"),
        ("one.sun", "two.carrier", ["two.carrier"], r"two\.carrier stands still while one\.sun turns: the ratio is infinite"),
        ("one.sun", "wall.flange", [], r"wall\.flange stands still while one\.sun turns: the ratio is infinite"),
        ("wall.flange", "one.sun", [], r"wall\.flange"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError, match=said):
            gl.speed_ratio(system, driving, driven, held=held)
    with pytest.raises(ArgumentError, match="held is"):
        gl.speed_ratio(system, "one.sun", "two.sun", held="one.ring")


@pytest.mark.parametrize("count", [1, 4, 5])
def test_what_stays_open_is_named_four_at_most(count: int) -> None:
    class Free(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor = [gp.Torque() for _ in range(count)]
            self.body = [gp.Inertia(J=1.0) for _ in range(count)]
            return [gl.connect(m.flange, b.flange_a) for m, b in zip(self.motor, self.body, strict=True)]

    system = gl.compile(Free())
    names = [f"speed of {part}[{k}].{flange}" for part, flanges in (("motor", ["flange"]), ("body", ["flange_a", "flange_b"]))
             for k in range(count) for flange in flanges]  # fmt: skip
    with pytest.raises(ArgumentError) as refused:
        gl.power_flow(system, torques={f"motor[{k}].tau": 0.0 for k in range(count)})
    said = str(refused.value)
    listed = said.partition("too little is given: the ")[2].partition(" stay open; give more speeds or torques")[0]
    shown, _, more = listed.partition(" and ")
    assert set(shown.split(", ")) <= set(names)
    assert len(shown.split(", ")) == min(4, len(names))
    assert more == ("" if len(names) <= 4 else f"{len(names) - 4} more")
    assert gl.mobility(system) == count
    assert np.isfinite(gl.power_flow(system, speeds={f"body[{k}].w": 1.0 for k in range(count)}).largest)


def test_drives_that_could_share_a_torque_in_any_way_are_named_with_their_flanges() -> None:
    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.two, self.body = gp.Torque(), gp.Torque(), gp.Inertia(J=1.0)
            return [gl.connect(self.one.flange, self.two.flange, self.body.flange_a)]

    system = gl.compile(Two())
    inputs, flanges = "input one.tau, input two.tau", "torque of one.flange, torque of two.flange"
    for speed, open_ in ((3.0, f"{inputs}, {flanges}"), (0.0, inputs)):  # at rest a torque does no work
        with pytest.raises(ArgumentError) as refused:
            gl.power_flow(system, speeds={"body.w": speed})
        assert str(refused.value) == f"too little is given: the {open_} stay open; give more speeds or torques"
    flow = gl.power_flow(system, speeds={"body.w": 3.0}, torques={"one.tau": 2.0})
    assert [flow[name].torque for name in ("one.flange", "two.flange")] == pytest.approx([-2.0, 2.0])


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 33])
def test_as_many_speeds_are_independent_as_bodies_turn_freely(count: int) -> None:
    class Apart(gl.Component):
        x = gl.Variable("1", "no shaft")

        def assemble(self) -> list[Any]:
            self.body = [gp.Inertia(J=1.0) for _ in range(count)]
            return []

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), -self.x)]

    assert gl.mobility(gl.compile(Apart())) == count


class Ended(gl.Component):
    """A gear between a body and the ground, and a body whose other end is free."""

    def assemble(self) -> list[Any]:
        self.ground, self.body, self.motor = gp.Fixed(), gp.Inertia(J=1.0), gp.Torque()
        self.set = gp.IdealPlanetary(ratio=2.0)
        self.out = gp.Inertia(J=1.0)
        return [
            gl.connect(self.motor.flange, self.body.flange_a, self.set.sun), gl.connect(self.set.ring, self.ground.flange),
            gl.connect(self.set.carrier, self.out.flange_a),
        ]  # fmt: skip


def test_what_stands_still_and_what_carries_nothing() -> None:
    system = gl.compile(Ended())
    with pytest.raises(
        gl.GearlibError, match=r"^set\.ring stands still while set\.sun turns: the ratio is infinite$|^set\.ring always"
    ):
        gl.speed_ratio(system, "set.sun", "set.ring")
    with pytest.raises(gl.GearlibError, match=r"^set\.ring cannot turn$"):
        gl.speed_ratio(system, "set.ring", "set.sun")
    with pytest.raises(gl.GearlibError, match=r"^set\.sun cannot turn with out\.w held$"):
        gl.speed_ratio(system, "set.sun", "set.ring", held=["out.w"])
    with pytest.raises(
        gl.GearlibError,
        match=r"^out\.flange_b\.tau is always zero; a torque needs a source that is connected, such as gp\.Torque$",
    ):
        system.power_flow(speeds={"body.w": 3.0}, torques={"out.flange_b.tau": 5.0})
    flow = system.power_flow(speeds={"body.w": 3.0}, torques={"out.flange_b.tau": 0.0})
    assert flow["out.flange_a"].speed == pytest.approx(1.0, rel=1e-12)


class Wall(gl.Component):
    """What does not turn at all."""

    flange = gp.Flange("held")

    def equations(self) -> list[Any]:
        return [gl.Eq(self.flange.phi, 0)]


def test_an_angle_that_is_always_zero_is_no_shaft() -> None:
    class Braked(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body, self.brake, self.wall = gp.Torque(), gp.Inertia(J=1.0), gp.Damper(d=0.5), Wall()
            ends = gl.connect(self.drive.flange, self.body.flange_a, self.brake.flange_a)
            return [ends, gl.connect(self.brake.flange_b, self.wall.flange)]

    system = gl.compile(Braked())
    flow = system.power_flow(speeds={"body.w": 4.0, "wall.flange": 0.0})
    assert (flow["wall.flange"].speed, flow["wall.flange"].torque) == (0.0, pytest.approx(2.0))
    assert flow["wall.flange"].shaft == flow["brake.flange_b"].shaft == -1
    assert flow["body.flange_b"].shaft == flow["drive.flange"].shaft >= 0
    assert flow.absorbed["brake"] == pytest.approx(8.0)
    still: list[Callable[[], Any]] = [
        lambda: gl.speed_ratio(system, "body.w", "wall.flange"), lambda: gl.speed_ratio(system, "wall.flange", "body.w"),
        lambda: system.power_flow(speeds={"wall.flange": 3.0}),
    ]  # fmt: skip
    for ask in still:
        with pytest.raises(gl.GearlibError, match=r"^wall\.flange always stands still$"):
            ask()
    assert gl.speed_ratio(system, "drive.flange", "body.w", held=["wall.flange"]) == pytest.approx(1.0)


def test_a_train_that_could_not_be_run_may_turn_steadily() -> None:
    """Without its inertia nothing says how fast the body turns, unless a speed is given."""

    class Free(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body = gp.Torque(), gp.Inertia(J=1.0)
            return [gl.connect(self.drive.flange, self.body.flange_a)]

    system, massless = gl.compile(Free()), {"body.J": 0.0}
    flow = system.power_flow(speeds={"body.w": 5.0}, parameters=massless)
    assert (flow["drive.flange"].speed, flow["drive.flange"].torque) == (5.0, 0.0)
    with pytest.raises(gl.GearlibError, match=r"with body\.J = 0"):
        system.simulate(1.0, parameters=massless)
