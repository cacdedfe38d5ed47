"""Operating points at which a comparison is about to change: the linear model is of one side, and that is told."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import GearlibWarning

C = gl.Parameter("N.m/rad", default=100.0)


class Coupling(gl.Component):
    """A torque over an angle."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    c = C
    limit = gl.Parameter("rad", default=0.2)
    law = gl.Structural(None)

    def equations(self) -> list[Any]:
        a, b = self.flange_a, self.flange_b
        return [gl.Eq(b.tau, self.law(self.c, b.phi - a.phi, self.limit)), gl.Eq(a.tau, -b.tau)]


class Held(gl.Component):
    """A body on such a coupling."""

    law, count = gl.Structural(None), gl.Structural(1)
    phi = gl.Parameter("rad", default=0.0)

    def assemble(self) -> list[Any]:
        self.ground, self.damper = gp.Fixed(), gp.Damper(d=0.1)
        self.body = gp.Inertia(J=1.0, start={"phi": self.phi, "w": 0.0})
        self.coupling = [Coupling(law=self.law) for _ in range(self.count)]
        return [
            gl.connect(self.ground.flange, self.damper.flange_a, *(c.flange_a for c in self.coupling)),
            gl.connect(self.body.flange_a, self.damper.flange_b, *(c.flange_b for c in self.coupling)),
        ]


TABLE = gl.Table([-1.0, 0.0, 1.0], [-10.0, 0.0, 100.0])
CORNERS = {  # with the stiffness on the left and on the right
    "one side": (lambda c, x, b: gl.Max(c * x, 0), 0.0, 100.0),
    "two slopes": (lambda c, x, b: gl.Piecewise((c * x, x >= 0), (0.1 * c * x, True)), 10.0, 100.0),
    "no event": (lambda c, x, b: gl.no_event(gl.Max(c * x, 0)), 0.0, 100.0),
    "size": (lambda c, x, b: c * abs(x), -100.0, 100.0),
    "an event beside none": (lambda c, x, b: gl.Max(c * x, 0) + gl.no_event(gl.Max(-c * x, 0)), -100.0, 100.0),
    "table": (lambda c, x, b: TABLE(x) * c / 100, 10.0, 100.0),
}
SMOOTH = {
    "same slope": lambda c, x, b: gl.Piecewise((c * x, x >= 0), (c * x + c * x**2 / b, True)),
    "parabola": lambda c, x, b: c * x + c * x * abs(x) / b,
    "beside": lambda c, x, b: gl.Max(c * (x - b), 0) + c * x,
}


@pytest.mark.parametrize("law", CORNERS)
def test_a_corner_at_the_operating_point_is_told(law: str) -> None:
    given, left, right = CORNERS[law]
    system = gl.compile(Held(law=given), outputs=["body.phi"])
    said = (
        r"at this operating point there is a corner in the equations of coupling\[0\] \(.*flange_[ab]\.phi.* = 0\): the linear"
    )
    for analysis in (gl.modes, gl.stability, gl.System.linearize):
        with pytest.warns(GearlibWarning, match=said) as told:
            analysis(system)
        assert {w.filename for w in told} == {__file__}
    for phi, stiffness in ((-0.1, left), (0.1, right)):
        poles = np.linalg.eigvals(system.linearize(at={"body.phi": phi}).A)
        assert np.prod(poles).real == pytest.approx(stiffness, abs=1e-9)


@pytest.mark.parametrize("law", SMOOTH)
def test_where_the_sides_agree_nothing_is_told(law: str) -> None:
    model = gl.compile(Held(law=SMOOTH[law]), outputs=["body.phi"]).linearize()
    assert sorted(np.linalg.eigvals(model.A).imag) == pytest.approx([-np.sqrt(100 - 0.05**2), np.sqrt(100 - 0.05**2)])


CUT = {
    "events": lambda c, x, b: gl.Piecewise((gl.Max(c * x, 0), x > -b), (0, True)),
    "no events": lambda c, x, b: gl.no_event(gl.Piecewise((gl.Max(c * x, 0), x > -b), (0, True))),
    "no events, other way round": lambda c, x, b: gl.no_event(gl.Piecewise((0, x <= -b), (gl.Max(c * x, 0), True))),
}


@pytest.mark.parametrize(("row", "law"), [*((k, "events") for k in range(3)), *((0, law) for law in CUT if law != "events")])
def test_a_comparison_of_one_component_does_not_decide_for_another(row: int, law: str) -> None:
    """The other couplings are cut out by comparisons of their own: what is a corner in them has no effect."""
    system = gl.compile(Held(law=CUT[law], count=3))
    limits = {f"coupling[{k}].limit": 0.5 if k == row else -0.5 for k in range(3)}
    with pytest.warns(GearlibWarning, match=rf"equations of coupling\[{row}\] \([^=]* = 0\): the linear"):
        gl.modes(system, parameters=limits)


def test_each_component_is_named_with_what_it_compares() -> None:
    system = gl.compile(Held(law=lambda c, x, b: gl.Max(c * (x - b), 0) + c * x, count=2))
    with pytest.warns(
        GearlibWarning, match=r"of coupling\[0\] \(.*limit.* = 0\), coupling\[1\] \(.*limit.* = 0\): the linear model is"
    ):
        gl.modes(system, at={"body.phi": 0.2})
    with pytest.warns(GearlibWarning, match=r"of coupling\[1\] \("):
        gl.modes(system, at={"body.phi": 0.1}, parameters={"coupling[1].limit": 0.1})
    gl.modes(system, at={"body.phi": 0.1})


class Cam(gl.Component):
    """A follower that leaves its seat at an angle; the angle of the cam is not needed for its speed."""

    flange_a, flange_b = gp.Flange("cam"), gp.Flange("follower")
    lift = gl.Variable("rad", "three times the angle of the cam")

    def equations(self) -> list[Any]:
        a, b = self.flange_a, self.flange_b
        law = gl.Max(self.lift - 0.3, 0)
        return [
            gl.Eq(self.lift, 3 * a.phi),
            gl.Eq(b.phi, law),
            gl.Eq(a.tau, -3 * b.tau * gl.Piecewise((1, self.lift > 0.3), (0, True))),
        ]


@pytest.mark.parametrize(("phi", "told"), [(0.1, True), (0.0999, False), (0.1001, False)])
def test_a_corner_of_what_only_changes_is_told(phi: float, told: bool) -> None:
    """The damper behind the cam feels the speed of the follower: w' = -9 d w beyond the corner, 0 before it."""
    system = cams()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        model = system.linearize([], ["body.w"], at={"body.phi": phi, "body.w": 2.0}, sparse=True)
    assert ["a corner in the equations of cam (" in str(one.message) for one in said] == [True] * told
    if not told:
        speed = model.states.index("body.w")
        assert np.asarray(model.A)[speed, speed] == pytest.approx(-0.9 if phi > 0.1 else 0.0, abs=1e-12)


@cache
def cams() -> gl.System:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.cam, self.damper, self.ground = gp.Inertia(J=1.0), Cam(), gp.Damper(d=0.1), gp.Fixed()
            return [
                gl.connect(self.body.flange_b, self.cam.flange_a),
                gl.connect(self.cam.flange_b, self.damper.flange_a),
                gl.connect(self.damper.flange_b, self.ground.flange),
            ]

    return gl.compile(Driven())


class Switched(gl.Component):
    """A damping that depends on a height or a depth, for which nothing else asks."""

    x, height, v, depth = gl.Variable("1", start=0.3), gl.Variable("1"), gl.Variable("1", start=1.0), gl.Variable("1")
    above = gl.Structural(None)

    def equations(self) -> list[Any]:
        damping = gl.Piecewise((4.0, self.above(self.height, self.depth, self.v)), (1.0, True))
        return [
            gl.Eq(gl.der(self.x), 1.0 + 0 * self.v),
            gl.Eq(self.height, self.x**2),
            gl.Eq(self.depth, -self.height),
            gl.Eq(gl.der(self.v), -damping * self.v),
        ]


@pytest.mark.parametrize(("x", "told"), [(0.5, True), (0.4999, False), (0.5001, False)])
@pytest.mark.parametrize(
    "above",
    [
        lambda up, down, v: up > 0.25,
        lambda up, down, v: down < -0.25,
        lambda up, down, v: up * v > 0.5,
        lambda up, down, v: down * v < -0.5,
    ],
)
def test_a_corner_at_what_only_a_condition_asks_for_is_told(x: float, told: bool, above: Any) -> None:
    system = gl.compile(Switched(above=above), outputs=["v"])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        model = system.linearize([], ["v"], at={"x": x, "v": 2.0}, sparse=True)
    texts = [str(one.message) for one in said if "a corner in the equations of Switched (" in str(one.message)]
    assert len(texts) == told
    if not told:
        speed = model.states.index("v")
        assert np.asarray(model.A)[speed, speed] == pytest.approx(-4.0 if x > 0.5 else -1.0, abs=1e-12)


class Ramp(gl.Component):
    """One state, whose rate has another slope on each side of a point; both sides of its equation are multiplied by a scale."""

    k, edge, scale = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=0.0), gl.Parameter("s", default=1.0)
    x = gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(self.scale * gl.der(self.x), self.scale * self.k * gl.Max(self.x - self.edge, 0))]


@pytest.mark.parametrize(("k", "scale"), [(1e-5, 1.0), (1.0, 1.0), (1e7, 1.0), (1.0, 1e-7)])
@pytest.mark.parametrize(("edge", "told"), [(0.0, True), (1e-9, False), (-1e-9, False), (1e6, False)])
def test_corners_are_told_at_any_slope_and_not_beside_them(k: float, scale: float, edge: float, told: bool) -> None:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        model = ramp().linearize([], ["x"], at={"x": 0.0}, parameters={"k": k, "edge": edge, "scale": scale}, sparse=True)
    assert ["a corner in the equations of Ramp" in str(one.message) for one in said] == [True] * told
    if not told:
        assert np.asarray(model.A).ravel() == pytest.approx([k if edge < 0 else 0.0])


@cache
def ramp() -> gl.System:
    return gl.compile(Ramp())


class Silent(gl.Component):
    """Compares with what is always zero."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    c = C
    zero = gl.Variable("rad")

    def equations(self) -> list[Any]:
        a, b = self.flange_a, self.flange_b
        twist = b.phi - a.phi
        torque = gl.Piecewise((self.c * twist, twist >= self.zero), (0.1 * self.c * twist, True))
        return [gl.Eq(self.zero, 0), gl.Eq(b.tau, torque), gl.Eq(a.tau, -b.tau)]


def test_what_is_always_zero_is_compared_as_zero() -> None:
    class Hanging(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.body, self.coupling = gp.Fixed(), gp.Inertia(J=1.0), Silent()
            return [
                gl.connect(self.ground.flange, self.coupling.flange_a),
                gl.connect(self.body.flange_a, self.coupling.flange_b),
            ]

    system = gl.compile(Hanging(), outputs=["body.phi"])
    with pytest.warns(GearlibWarning, match=r"there is a corner in the equations of coupling \("):
        system.linearize(at={"body.phi": 0.0})
    for phi, stiffness in ((-1.0, 10.0), (0.5, 100.0)):
        assert np.prod(np.linalg.eigvals(system.linearize(at={"body.phi": phi}).A)).real == pytest.approx(stiffness)


class Valves(gl.Component):
    """A flow that two valves let out, each from a level on; a gain of 0 shuts one."""

    p, q = gl.Parameter("1", default=9.0), gl.Parameter("1", default=9.0)
    g, h, leak = (gl.Parameter("1/s", default=k) for k in (0.0, 0.0, 1.0))
    x = gl.Variable("1", start=1.0)

    def equations(self) -> list[Any]:
        first = gl.Piecewise((self.x - self.p, self.x > self.p), (0, True))
        second = gl.Piecewise((self.x - self.q, self.x > self.q), (0, True))
        return [gl.Eq(gl.der(self.x), -self.leak * self.x - self.g * first - self.h * second)]


class Tanks(gl.Component):
    """Before the tanks, a part that compares as well."""

    def assemble(self) -> list[Any]:
        self.before, self.tank = Ramp(edge=5.0), [Valves() for _ in range(3)]
        return []


@cache
def tanks() -> gl.System:
    return gl.compile(Tanks())


@pytest.mark.parametrize("row", range(3))
@pytest.mark.parametrize(("level", "gain"), [("p", "g"), ("q", "h")])
def test_of_many_comparisons_the_one_that_is_equal_has_two_sides(row: int, level: str, gain: str) -> None:
    """One valve of one tank has a gain and stands at its level; beside it, the slope of its side is that of the model."""
    parameters = {f"tank[{row}].{level}": 1.0, f"tank[{row}].{gain}": 3.0}
    names = [f"tank[{k}].x" for k in range(3)]
    with pytest.warns(GearlibWarning, match=rf"corner in the equations of tank\[{row}\] \([^=]*\b{level}\b[^=]* = 0\): the"):
        tanks().linearize([], names, parameters=parameters, sparse=True)
    for x, slope in ((0.9, -1.0), (1.1, -4.0)):
        model = tanks().linearize([], names, at={names[row]: x}, parameters=parameters, sparse=True)
        assert np.diag(model.C @ np.asarray(model.A) @ model.C.T) == pytest.approx(
            [slope if k == row else -1.0 for k in range(3)]
        )


class Measured(gl.Component):
    """A law with a corner that is no event, and one that is; a gain decides whether it has an effect."""

    edge, gain = gl.Parameter("1", default=9.0), gl.Parameter("1/s", default=1.0)
    x, y = gl.Variable("1", start=1.0), gl.Variable("1")

    def equations(self) -> list[Any]:
        silent = gl.no_event(gl.Max(self.x - self.edge, 0))
        told = gl.Piecewise((2 * self.x - 3, self.x > 3), (self.x, True))
        return [gl.Eq(self.y, silent + told), gl.Eq(gl.der(self.x), -self.gain * self.y)]


@pytest.mark.parametrize("x", [1e-9, 1.0, 1e9])
def test_a_corner_without_an_event_is_told_at_values_of_any_size(x: float) -> None:
    system = gl.compile(Measured(), outputs=["x"])
    with pytest.warns(GearlibWarning, match=r"corner in the equations of Measured \([^=]*edge[^=]* = 0\): the"):
        system.linearize([], at={"x": x}, parameters={"edge": x}, sparse=True)


@pytest.mark.parametrize(("beside", "told"), [(5e-12, True), (-5e-12, True), (1e-11, False), (-1e-11, False)])
def test_a_point_that_rounding_parts_from_a_corner_is_at_it(beside: float, told: bool) -> None:
    """A comparison of two values of 3 that agree to a relative 1e-12 of their sum has two sides, also if it is the only one."""
    system = gl.compile(Measured(), outputs=["x"])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        system.linearize([], at={"x": 3.0 + beside}, sparse=True)
    assert ["a corner in the equations of Measured (" in str(one.message) for one in said] == [True] * told


def test_a_corner_without_an_event_leaves_the_events_of_others_alone() -> None:
    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = [Measured() for _ in range(3)]
            return []

    system = gl.compile(Row(), outputs=[f"part[{k}].x" for k in range(3)])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for row in range(3):  # where it has no effect
            system.linearize([], parameters={f"part[{row}].edge": 1.0, f"part[{row}].gain": 0.0}, sparse=True)
    assert not [one for one in said if "a corner" in str(one.message)]
    with pytest.warns(GearlibWarning, match=r"corner in the equations of part\[1\] \([^=]*edge[^=]* = 0\): the"):
        system.linearize([], parameters={"part[1].edge": 1.0}, sparse=True)


@pytest.mark.parametrize(
    ("holds", "told"),
    [
        (lambda z: z > 0, False), (lambda z: z >= 0, True), (lambda z: z < 0, False), (lambda z: z <= 0, True),
        (lambda z: z > -1, True), (lambda z: z < -1, False), (lambda z: z > 1, False), (lambda z: z < 1, True),
    ],
)  # fmt: skip
@pytest.mark.parametrize("events", [True, False])
def test_comparisons_of_what_stands_still_are_what_they_are_at_the_point(holds: Any, told: bool, events: bool) -> None:
    """Of zero with zero, too: a corner behind one that does not hold has no effect, and is not named beside another."""

    class Gated(gl.Component):
        k, always = gl.Parameter("1/s", default=1.0), gl.Parameter("1/s", default=1.0)
        x, zero = gl.Variable("1", start=0.0), gl.Variable("1")

        def equations(self) -> list[Any]:
            law = gl.Piecewise((gl.Max(self.x, 0), holds(self.zero)), (0, True))
            return [gl.Eq(self.zero, 0), gl.Eq(gl.der(self.x), self.k * (law if events else gl.no_event(law)))]

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.gated, self.ramp = Gated(), Ramp()
            return []

    system = gl.compile(Two())
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        system.linearize([], ["gated.x"], sparse=True)
    assert ["a corner in the equations of gated (" in str(one.message) for one in said] == [True] * told
    with pytest.warns(GearlibWarning, match=r"in the equations of (gated \(.* = 0\), )?ramp \(") as both:
        system.linearize([], ["gated.x", "ramp.x"], sparse=True)
    assert ["gated" in str(one.message) for one in both] == [told]


class Counting(gl.Component):
    """A stop that works where a discrete variable has its number."""

    number, edge = gl.Parameter("1", default=1.0), gl.Parameter("1", default=1.0)
    x, first, second = gl.Variable("1", start=1.0), gl.Discrete(start=3.0), gl.Discrete(start=5.0)

    def equations(self) -> list[Any]:
        law = gl.Piecewise((2 * self.x, gl.And(self.x > self.edge, self.second < self.number)), (self.x, True))
        keep = [gl.Eq(self.first, gl.pre(self.first)), gl.Eq(self.second, gl.pre(self.second))]
        return [gl.Eq(gl.der(self.x), -gl.no_event(law)), *keep]


def test_what_discrete_variables_compare_is_that_of_their_own_component() -> None:
    """Of three with the numbers 4, 4 and 6, a second variable of 5 lets the last one have a corner."""

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = [Counting(number=number) for number in (4.0, 4.0, 6.0)]
            return []

    with pytest.warns(GearlibWarning, match=r"corner in the equations of part\[2\] \([^=]*edge[^=]* = 0\): the"):
        gl.compile(Row()).linearize([], ["part[0].x", "part[1].x", "part[2].x"], sparse=True)


class Gapped(gl.Component):
    """A body in a gap of 0.1 rad, the sides of which a discrete variable tells."""

    kind = gl.Structural(None)

    def assemble(self) -> list[Any]:
        self.push, self.body, self.ground = gp.Torque(), gp.Inertia(J=1.0), gp.Fixed()
        self.gap = self.kind(c=100.0, d=3.0, b=0.1)
        return [
            gl.connect(self.push.flange, self.body.flange_a),
            gl.connect(self.body.flange_b, self.gap.flange_b),
            gl.connect(self.gap.flange_a, self.ground.flange),
        ]


@pytest.mark.parametrize("kind", [gp.ElastoBacklash, gp.ElastoBacklash2])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("beyond", "w", "told"), [(0, 0, True), (0, 0.1, True), (0, -0.1, False), (1e-9, 0, False), (-1e-9, 0, False)]
)
def test_a_corner_that_a_discrete_variable_tells(kind: Any, side: float, beyond: float, w: float, told: bool) -> None:
    """At its edge a gap has a stiffness on one side; the body that leaves the contact feels no torque on either side."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        at = {"gap.phi_rel": side * (0.05 + beyond), "body.w": side * w}
        stiffness = -np.asarray(gl.compile(Gapped(kind=kind)).linearize(["push.tau"], ["body.w"], at=at).A).min()
    assert ["a corner in the equations of gap.contact: " in str(one.message) for one in said] == [True] * told
    assert stiffness == (100.0 if beyond > 0 else 0.0)


class Stuck(gl.Component):
    """A body that friction holds, on a spring."""

    kind = gl.Structural(0)

    def assemble(self) -> list[Any]:
        self.push, self.body, self.spring, self.ground = gp.Torque(), gp.Inertia(J=1.0), gp.Spring(c=9.0), gp.Fixed()
        friction = (
            lambda: gp.BearingFriction(tau_pos=((0.0, 3.0),)), lambda: gp.Clutch(fn_max=1e3, f_normalized=1.0),
            lambda: gp.Brake(fn_max=1e3, f_normalized=1.0), lambda: gp.OneWayClutch(fn_max=1e3, f_normalized=1.0),
        )  # fmt: skip
        self.friction = friction[self.kind]()
        wall = self.ground.flange
        ends = (self.friction.flange_a, self.friction.flange_b) if self.kind % 2 else (self.friction.flange_a,)
        links = [
            (self.push.flange, self.body.flange_a),
            (self.body.flange_b, self.spring.flange_a),
            (self.spring.flange_b, wall),
        ]
        return [
            *(gl.connect(*link) for link in links),
            *(gl.connect(*pair) for pair in zip(ends, (self.body.flange_b, wall), strict=False)),
        ]


@pytest.mark.parametrize("kind", range(4))
def test_what_is_stuck_has_no_corner(kind: int) -> None:
    """It stays stuck beside its point; pytest makes warnings errors."""
    system = gl.compile(Stuck(kind=kind))
    assert len(gl.modes(system, at={"spring.phi_rel": -0.1, "body.w": 0.0}).omega) == 0
    result = system.simulate(0.1, start={"spring.phi_rel": -0.1, "body.w": 0.0}, samples=3, inputs={"push.tau": 0.0})
    assert len(gl.modes(system, at=(result, 0.1)).omega) == 0


class Jumping(gl.Component):
    """A torque of the sign of a speed or of an input, written in several ways."""

    law = gl.Structural(None)
    u, x, y = gl.Input("1"), gl.Variable("1"), gl.Variable("1")
    side = gl.Discrete("sign of the input")

    def equations(self) -> list[Any]:
        force = self.law(self.x, self.u, self.side)
        side = gl.Piecewise((1, self.u > 0), (-1, True))
        return [gl.Eq(gl.der(self.x), force - self.x), gl.Eq(self.y, -self.x), gl.Eq(self.side, side)]


@pytest.mark.parametrize("at", [0.0, 0.1])
@pytest.mark.parametrize(
    "law",
    [
        lambda x, u, side: gl.Piecewise((1.0, x > 0), (-1.0, True)), lambda x, u, side: gl.sign(u),
        lambda x, u, side: gl.no_event(gl.Piecewise((1.0, x + u > 0), (-1.0, True))), lambda x, u, side: side,
    ],
)  # fmt: skip
def test_a_jump_at_the_operating_point_is_told(law: Any, at: float) -> None:
    """Its slopes are the same on both sides; beside it they are right."""
    system = gl.compile(Jumping(law=law))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        model = system.linearize(["u"], ["y"], at=(system.simulate(0.1, start={"x": at}, inputs={"u": at}, samples=2), 0.0))
    assert ["there is a jump of der(x): " in str(one.message) for one in said] == [True] * (at == 0)
    assert (np.asarray(model.A).tolist(), np.asarray(model.B).tolist()) == ([[-1.0]], [[0.0]])
