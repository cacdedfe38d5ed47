"""Which connectors are told to be connected to nothing, in whole sentences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from tests.reduce.test_imbalance import connect
from tests.reduce.test_imbalance_told import told

c = gl.connect


class Housed(gl.Component):
    """A damper in a housing with one flange or two."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right", when="through")
    through = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.d = gp.Damper(d=1.0)
        right = [c(self.flange_b, self.d.flange_b)] if self.through else []
        return [c(self.flange_a, self.d.flange_a), *right]


class Driven(gl.Component):
    """A torque in a housing, with a support that is left open or none; and a flange that leads nowhere, or none."""

    flange, side = gp.Flange("driven"), gp.Flange("leads nowhere", when="more")
    supported, more = gl.Structural(False), gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.q = gp.Torque(tau=1.0, use_support=self.supported)
        return [c(self.flange, self.q.flange)]


class Idle(gl.Component):
    """Two flanges without torque, on which nothing depends, and an angle that is that of one of them."""

    flange, side, phi = gp.Flange("one"), gp.Flange("other"), gl.Variable("rad")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, 0), gl.Eq(self.side.tau, 0), gl.Eq(self.phi, self.flange.phi)]


class Angled(gl.Component):
    """A torque on a flange, the angle of which is told as a potential of the part itself."""

    flange, phi = gp.Flange("driven"), gl.Potential("rad")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, 1), gl.Eq(self.phi, self.flange.phi)]


class Sensing(gl.Component):
    """A body or a sensor in a housing, and another sensor that is connected to nothing."""

    flange, heavy = gp.Flange("of the first"), gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.first, self.second = gp.Inertia(J=1.0) if self.heavy else gp.SpeedSensor(), gp.SpeedSensor()
        return [c(self.flange, self.first.flange_a if self.heavy else self.first.flange)]


class Silent(gl.Component):
    """A variable that no equation holds."""

    x = gl.Variable("1")


class Forcing(gl.Component):
    """A speed without a torque; in exchange a variable that no equation holds."""

    flange, x, speed = gp.Flange("driven"), gl.Variable("1"), gl.Parameter("rad/s", default=2.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.flange.phi), self.speed), gl.Eq(self.flange.tau, 0)]


class Lacking(gl.Component):
    """A spring without the balance of its torques."""

    flange_a, flange_b, c = gp.Flange("left"), gp.Flange("right"), gl.Parameter("N.m/rad", default=3.0)

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        return [gl.Eq(b.tau, self.c * (b.phi - a.phi))]


def torque(**more: Any) -> gl.Component:
    return gp.Torque(tau=1.0, **more)


def gear() -> gl.Component:
    return gp.IdealGear(ratio=2.0)


def planetary() -> gl.Component:
    return gp.IdealPlanetary(ratio=2.0)


def body() -> gl.Component:
    return gp.Inertia(J=1.0)


def supported() -> gl.Component:
    return torque(use_support=True)


LACKING = (
    "k (Lacking) has 1 equation for 2 unknowns (flange_a.tau; flange_b.tau), 1 is missing: none of them holds flange_a.tau."
)
NOWHERE = "(Driven) has 1 equation for 2 unknowns (flange.tau; side.tau), 1 is missing: none of them holds side.tau."
TWICE = "Is something held or driven twice (two sources or grounds on one rigid shaft), or a source not connected?"
INSIDE = "Is a flange left unconnected inside a composite, or a variable without an equation?"


def one(path: str, choice: str = "") -> str:
    off = f", or leave it switched off ({choice}=False of {path.rpartition('.')[0]})" if choice else ""
    return f"{path} is connected to nothing; connect it{off}."


def several(*paths: str) -> str:
    return f"{' and '.join(paths)} are connected to nothing; connect them, or leave {paths[0].rpartition('.')[0]} out."


Parts = dict[str, Callable[[], gl.Component]]
CASES: dict[str, tuple[Parts, tuple[str, ...], list[str]]] = {
    "sensors": ({f"s{k}": gp.SpeedSensor for k in range(4)}, (), [one(f"s{k}.flange") for k in range(3)]),
    "torques": ({f"q{k}": torque for k in range(4)}, (), [one(f"q{k}.flange") for k in range(3)]),
    "torque with a support": ({"q": supported}, (), [several("q.flange", "q.support")]),
    "supports and sensors": (
        {"a": body, "q": supported, "r": supported, "s": gp.SpeedSensor, "t": gp.SpeedSensor},
        ("q.flange a.flange_a", "r.flange a.flange_a"),
        [one("q.support", "use_support"), one("r.support", "use_support"), one("s.flange")],
    ),
    "sensor of two shafts": ({"m": gp.MultiSensor, "a": body}, (), [several("m.flange_a", "m.flange_b")]),
    "prescribed motion against nothing": (
        {"q": lambda: gp.Speed(w_ref=1.0, use_support=True)}, (), [several("q.flange", "q.support")],
    ),
    "all flanges of a set": ({"p": planetary, "a": body}, (), [several("p.sun", "p.carrier", "p.ring")]),
    "two flanges of a set": ({"p": planetary, "a": body}, ("p.sun a.flange_a",), [several("p.carrier", "p.ring")]),
    "the last flange of a set": (
        {"p": planetary, "a": body, "s": gp.SpeedSensor}, ("p.sun a.flange_a", "p.ring s.flange"), [one("p.carrier")],
    ),
    "a gear behind a torque": ({"q": torque, "g": gear, "a": body}, ("q.flange g.flange_a",), [one("g.flange_b")]),
    "a housing": ({"box": Housed, "a": body}, (), [one("box.flange_a")]),
    "a housing with two flanges": (
        {"box": lambda: Housed(through=True), "a": body}, (), [several("box.flange_a", "box.flange_b")],
    ),
    "a housing, and a part with a similar name": (
        {"box": Housed, "boxed": gp.SpeedSensor, "a": body}, (), [one("box.flange_a"), one("boxed.flange")],
    ),
    "a support in a housing": (
        {"b": lambda: Driven(supported=True), "a": body}, ("b.flange a.flange_a",), [one("b.q.support", "use_support")],
    ),
    "a torque in a housing": ({"a": body, "b": Driven}, (), [one("b.flange")]),
    "what leads nowhere": (
        {"b": lambda: Driven(more=True), "a": body}, ("b.flange a.flange_a",),
        [f"b {NOWHERE}", one("b.side", "more")],
    ),
    "two torques in housings that lead nowhere": (
        {"b": lambda: Driven(more=True), "r": lambda: Driven(more=True)}, ("b.flange r.flange",),
        [
            f"b, r {NOWHERE}", "Nothing determines b.flange.phi: connect b.flange to a component that does.",
            one("b.side", "more"), one("r.side", "more"),
        ],
    ),
    "an idle part": ({"a": body, "e": Idle}, (), [several("e.flange", "e.side")]),
    "an angle of its own": ({"a": body, "e": Angled}, (), [one("e.flange")]),
    "a sensor in a housing that turns by itself": ({"t": lambda: Sensing(heavy=True)}, (), [one("t.second.flange")]),
    "a sensor in a housing that is to be connected first": ({"t": Sensing, "a": body}, (), [one("t.flange")]),
    "what no equation holds, and a torque": (
        {"n": Silent, "q": torque}, (),
        ["n (Silent) has no equations for 1 unknown (x), 1 is missing: none of them holds x.", one("q.flange")],
    ),
    "a class at fault beside a gear": (
        {"k": Lacking, "a": body, "q": torque, "g": gear}, ("k.flange_a a.flange_a", "q.flange g.flange_a"), [LACKING],
    ),
    "the free end of a body that is driven without a torque": (
        {"a": body, "f": Forcing}, ("f.flange a.flange_a",), [TWICE, INSIDE],
    ),
    "an idle part on a shaft": ({"a": body, "e": Idle}, ("e.flange a.flange_a",), [one("e.side")]),
    "two idle parts": (
        {"e": Idle, "f": Idle}, ("e.flange f.flange",),
        ["Nothing determines e.flange.phi: connect e.flange to a component that does.", one("e.side"), one("f.side")],
    ),
    "a class at fault beside a sensor": (
        {"k": Lacking, "a": body, "s": gp.SpeedSensor}, ("k.flange_a a.flange_a",), [LACKING],
    ),
    "a class at fault beside a torque": (
        {"k": Lacking, "a": body, "q": torque}, ("k.flange_a a.flange_a",), [LACKING, one("q.flange")],
    ),
    "a class at fault beside a support and a gear": (
        {"k": Lacking, "a": body, "q": supported, "g": gear}, ("k.flange_a a.flange_a", "q.flange a.flange_b"),
        [LACKING, one("q.support", "use_support")],
    ),
    "dampers in a row": (
        {"d": lambda: gp.Damper(d=1.0), "e": lambda: gp.Damper(d=1.0)}, ("d.flange_b e.flange_a",), [INSIDE],
    ),
    "a torque on a damper": ({"q": torque, "d": lambda: gp.Damper(d=1.0)}, ("q.flange d.flange_a",), [TWICE, INSIDE]),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_connectors_that_lead_to_nothing_are_told(name: str) -> None:
    """Those that cause the imbalance, three at most; of a housing its own; not those of free ends."""
    parts, links, sentences = CASES[name]
    said = told(connect({part: make() for part, make in parts.items()}, *links)).removeprefix("the model is not balanced. ")
    found = []
    while said:
        for start, end in (("over-determined: ", " The variables: "), ("under-determined: ", " The variables: ")):
            if said.startswith(start):
                said = said.partition(end)[2].partition(". ")[2]
        sentence = next((s for s in sentences if said.startswith(s)), said)
        found += [sentence] if sentence else []
        said = said.removeprefix(sentence).removeprefix(" ")
    assert sorted(found) == sorted(sentences)


def test_a_flange_of_the_whole_model_is_to_be_connected() -> None:
    class Held(gl.Component):
        flange, x = gp.Flange("any"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.flange.tau, 1), gl.Eq(self.x, gl.sin(gl.time))]

    said = told(Held())
    assert said.startswith(
        "the model is not balanced. Nothing determines flange.phi: connect flange to a component that does. over-"
    )
    assert told(connect({"h": Held()})).startswith(f"the model is not balanced. {one('h.flange')} over-")


def test_a_flange_of_the_whole_model_that_may_be_switched_off_is_told_with_its_class() -> None:
    said = told(Driven(more=True))
    off = "Nothing determines side.phi: connect side to a component that does, or leave it switched off (more=False of Driven)."
    assert off in said
    assert "connected to nothing" not in said


class Measured(gl.Component):
    """A torque between two flanges, the relative angle of which is measured."""

    flange, support = gp.Flange("driven"), gp.Flange("other")
    u, turned = gl.Input("N.m"), gl.Variable("rad")

    def equations(self) -> list[gl.Eq]:
        near, far = self.flange, self.support
        return [gl.Eq(near.tau, -self.u), gl.Eq(far.tau, self.u), gl.Eq(self.turned, 2 * near.phi - 3 * far.phi)]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [("number", one("m.support")), ("time", one("m.support")), ("input", one("m.support")), ("spring", TWICE)],
)
def test_a_torque_that_nothing_takes_is_told_by_its_open_end_unless_something_else_could_be_zero(
    given: str, sentence: str
) -> None:
    """Given by a number, by time or from outside, it cannot be zero; the torque of a spring can."""

    class Drive(gl.Component):
        given, v = gl.Structural("number"), gl.Input("N.m", default=1.0)

        def assemble(self) -> list[Any]:
            self.a, self.b, self.s = gp.Inertia(J=1.0), gp.Inertia(J=1.0), gp.Spring(c=3.0)
            to = {"number": 2.0, "time": gl.sin(gl.time), "input": 2 * self.v, "spring": self.s.tau}
            self.m = Measured(u=to[self.given])
            return [c(self.m.flange, self.a.flange_a), c(self.a.flange_b, self.s.flange_a), c(self.s.flange_b, self.b.flange_a)]

    said = told(Drive(given=given) if given != "input" else Drive(given=given, v=None))
    assert said.startswith(f"the model is not balanced. {sentence} ") == (sentence is not TWICE)
    assert (TWICE in said) == (sentence is TWICE)
