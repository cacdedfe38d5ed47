"""Ratios and numbers of independent speeds by hand, with what is refused letter by letter; and steady states that are searched for."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.statics import statics


@cache
def geared() -> gl.System:
    """A motor, a gear of -3, a rack; a differential apart; a wall."""

    class Geared(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.gear, self.rack, self.mass = (
                gp.Inertia(J=1.0),
                gp.IdealGear(ratio=-3.0),
                gp.IdealGearR2T(ratio=4.0),
                gp.Mass(m=1.0),
            )
            self.unit, self.body = gp.IdealPlanetary(ratio=2.0), [gp.Inertia(J=1.0) for _ in range(3)]
            self.wall, self.drag = gp.Fixed(), gp.Damper(d=1.0)
            ends = (self.unit.sun, self.unit.ring, self.unit.carrier)
            return [
                gl.connect(self.motor.flange_b, self.gear.flange_a), gl.connect(self.gear.flange_b, self.rack.flange_r),
                gl.connect(self.rack.flange_t, self.mass.flange_a),
                *(gl.connect(e, b.flange_a) for e, b in zip(ends, self.body, strict=True)),
                gl.connect(self.motor.flange_a, self.drag.flange_a), gl.connect(self.drag.flange_b, self.wall.flange),
            ]  # fmt: skip

    return gl.compile(Geared())


@pytest.mark.parametrize(
    ("driving", "driven", "held", "ratio"),
    [
        ("motor.w", "gear.flange_b", [], -3.0), ("gear.flange_b", "motor.phi", [], -1 / 3), ("motor.w", "mass.v", [], -12.0),
        ("mass.v", "der(motor.phi)", [], -1 / 12), ("motor.w", "drag.w_rel", [], -1.0), ("motor.w", "motor.w", [], 1.0),
        ("unit.sun", "unit.carrier", ["unit.ring"], 3.0), ("body[0].w", "body[2].w", ["body[1].w"], 3.0),
        ("motor.w", "mass.v", ["unit.ring"], -12.0),
        ("unit.sun", "unit.ring", ["unit.carrier"], -2.0), ("unit.carrier", "unit.ring", ["unit.sun"], 2 / 3),
    ],
)  # fmt: skip
def test_ratios_of_speeds(driving: str, driven: str, held: list[str], ratio: float) -> None:
    assert gl.speed_ratio(geared(), driving, driven, held=held) == pytest.approx(ratio, rel=1e-12)
    assert gl.mobility(geared()) == 3


@pytest.mark.parametrize(
    ("driving", "driven", "held", "said"),
    [
        ("unit.sun", "unit.ring", [], "unit.ring does not follow from unit.sun alone; name the speeds that are held (held=[...])"),
        ("motor.w", "unit.ring", [], "unit.ring does not follow from motor.w alone; name the speeds that are held (held=[...])"),
        ("unit.sun", "unit.ring", ["unit.ring"], "unit.ring stands still while unit.sun turns: the ratio is infinite"),
        ("unit.sun", "unit.carrier", ["unit.ring", "unit.sun"], "unit.sun cannot turn with unit.ring, unit.sun held"),
        ("unit.sun", "unit.sun", ["unit.sun"], "unit.sun cannot turn with unit.sun held"),
        ("unit.sun", "unit.carrier", ["unit.ring", "unit.carrier"], "unit.sun cannot turn with unit.ring, unit.carrier held"),
        ("motor.w", "mass.v", ["mass.v"], "motor.w cannot turn with mass.v held"),
        ("wall.flange", "motor.w", [], "wall.flange cannot turn"),
        ("der(der(motor.phi))", "mass.v", [], "der(der(motor.phi)) is no speed"),
    ],
)  # fmt: skip
def test_ratios_that_there_are_not(driving: str, driven: str, held: list[str], said: str) -> None:
    with pytest.raises(ArgumentError) as refused:
        gl.speed_ratio(geared(), driving, driven, held=held)
    assert str(refused.value) == said


@pytest.mark.parametrize(("driving", "driven"), [("motor.v", "mass.v"), ("motor.w", "mass.w")])
def test_speeds_that_there_are_not(driving: str, driven: str) -> None:
    wrong = driving if driving == "motor.v" else driven
    with pytest.raises(NameLookupError, match=rf"^the model has no speed or flange '{wrong}'; did you mean"):
        gl.speed_ratio(geared(), driving, driven)


@cache
def one_stage() -> gl.System:
    class Stage(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.gear, self.b = gp.Inertia(J=1.0), gp.IdealGear(ratio=1.0), gp.Inertia(J=1.0)
            return [gl.connect(self.a.flange_b, self.gear.flange_a), gl.connect(self.gear.flange_b, self.b.flange_a)]

    return gl.compile(Stage())


@pytest.mark.parametrize("ratio", [1e-9, 1e9, -1e-6])
def test_ratios_may_be_large_or_small(ratio: float) -> None:
    assert gl.speed_ratio(one_stage(), "a.w", "b.w", parameters={"gear.ratio": ratio}) == pytest.approx(ratio, rel=1e-12)
    assert gl.mobility(one_stage(), parameters={"gear.ratio": ratio}) == 1


@cache
def dragged() -> gl.System:
    """Two torques on a body with drag, and a spring to another body with drag."""

    class Dragged(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.two, self.a, self.b = gp.Torque(), gp.Torque(), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.shaft, self.drag = gp.SpringDamper(c=50.0, d=1.0), [gp.Damper(d=0.5), gp.Damper(d=1.5)]
            self.wall = gp.Fixed()
            return [
                gl.connect(self.one.flange, self.two.flange, self.a.flange_a, self.drag[0].flange_a),
                gl.connect(self.a.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.b.flange_a, self.drag[1].flange_a),
                gl.connect(self.wall.flange, *(drag.flange_b for drag in self.drag)),
            ]  # fmt: skip

    return gl.compile(Dragged())


def point(most: float, speeds: dict[str, float] | None = None, **torques: float) -> Any:
    translation = dragged().translation
    model, numbers = translation.structure.complete, translation.parameter_values({})
    given = statics.given_values(model, speeds, {f"{name}.tau": value for name, value in torques.items()})
    found = statics.steady_point(translation, numbers, given, most)
    if found is None:
        return None
    assert found.t == 0.0
    assert sorted(found.inputs.tolist()) == sorted(torques.values())
    return {(model.name(v), k): value for (v, k), value in found.states.items()}


def test_the_steady_state_is_searched_for_where_all_that_drives_is_given() -> None:
    """6 and 2 N.m against 2 N.m.s/rad: 4 rad/s; the shaft carries 1.5 of these, so it is twisted by 6 / 50."""
    states = point(100, one=6.0, two=2.0)
    assert len(states) == 4
    speeds = sorted(value for value in states.values() if abs(value) > 1.0)
    assert speeds == pytest.approx([4.0, 4.0])
    first, second = (value for value in states.values() if abs(value) < 1.0)  # turns of the dampers
    assert abs(first - second) == pytest.approx(0.12)
    assert point(4, one=6.0, two=2.0) == pytest.approx(states)
    assert point(float("inf"), one=6.0, two=2.0) == pytest.approx(states)


def test_no_steady_state_is_searched_for_where_that_is_not_so_or_would_take_long() -> None:
    assert point(3, one=6.0, two=2.0) is None
    assert point(100, one=6.0) is None
    assert point(100) is None
    assert point(100, {"a.flange_a": 3.0}, one=6.0, two=2.0) is None
    assert point(100, {"a.w": 3.0}, one=6.0) is None


@pytest.mark.parametrize("driving", ["held.flange_a", "held.flange_b", "held.w"])
def test_what_is_held_cannot_turn_whatever_is_asked_for(driving: str) -> None:
    """Also where nothing joins it to what is driven."""

    class Apart(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.held, self.free = gp.Fixed(), gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            return [gl.connect(self.ground.flange, self.held.flange_a)]

    system = gl.compile(Apart())
    with pytest.raises(ArgumentError, match=rf"^{driving} cannot turn$"):
        gl.speed_ratio(system, driving, "free.flange_a")
