"""What a diagram shows: parts, connections and signals of a component, as data."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.block_diagram import OWN, Net, Outline, Pin
from gearlib.drawing.page import picture
from gearlib.errors import ArgumentError, ModelError
from gearlib.language import outline as module
from gearlib.language.outline import domain, drawn, html_of, joined, outline


class Stage(gl.Component):
    """A body on a shaft, with a motor by a signal."""

    flange = gp.Flange("outside")
    level = gl.Input("N.m", "torque of the motor")
    J = gl.Parameter("kg.m2", default=1.0)
    speed = gl.Variable("rad/s", "of the body")
    step = gl.Discrete("mode")

    def assemble(self) -> list[Any]:
        self.motor, self.body = gp.Torque(tau=2 * self.level), gp.Inertia(J=self.J)
        self.fan = gp.Torque(tau=-0.1 * self.body.w - self.speed * self.step)
        self.gain = gp.blocks.Gain(k=1.0)
        return [
            gl.connect(self.motor.flange, self.body.flange_a),
            gl.connect(self.body.flange_a, self.fan.flange),
            gl.connect(self.body.flange_b, self.flange),
            gl.connect(self.level, self.gain.u),
        ]

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.speed, self.body.w), gl.Eq(self.step, 1)]


class Plant(gl.Component):
    def assemble(self) -> list[Any]:
        self.stage, self.load, self.mass = Stage(level=3.0), gp.Inertia(J=2.0), gp.IdealGearR2T(ratio=2.0)
        self.sensor = gp.SpeedSensor()
        return [
            gl.connect(self.stage.flange, self.load.flange_a, self.mass.flange_r),
            gl.connect(self.stage.body.flange_b, self.sensor.flange),
        ]


def pins(net: Net) -> set[str]:
    return {f"{pin.part}.{pin.port}" if pin.part != OWN else pin.port for pin in net.pins}


def part(found: Outline, name: str) -> Outline:
    (one,) = [p for p in found.parts if p.name == name]
    return one


def test_parts_ports_nets_and_signals_of_one_level() -> None:
    found = outline(Stage(), 1)
    assert (found.name, [p.name for p in found.parts]) == ("Stage", ["motor", "body", "fan", "gain"])
    assert all(p.parts == () for p in found.parts)
    turning = [pins(n) for n in found.nets if n.domain == "rotation"]
    assert turning == [{"motor.flange", "body.flange_a", "fan.flange"}, {"body.flange_b", "flange"}], (
        "what shares a pin is one net"
    )
    signals = {frozenset(pins(n)) for n in found.nets if n.domain == "signal"}
    assert signals == {frozenset({"level", "gain.u", "motor.tau"}), frozenset({"body.w", "fan.tau", "speed", "step"})}
    assert {t.name: t.domain for t in part(found, "motor").ports} == {"flange": "rotation", "tau": "signal"}
    assert part(found, "body").ports[0].domain == "rotation"
    assert "J = J" in part(found, "body").note.split("\n")


def test_parameters_are_no_signals() -> None:
    """A part's parameter may follow from another part's; only inputs are drawn as driven."""

    class Copied(gl.Component):
        J, level = gl.Parameter("kg.m2", default=1.0), gl.Input("N.m", "torque")
        share = gl.Parameter("1", default=0.5)

        def assemble(self) -> list[Any]:
            self.one, self.torque = gp.Inertia(J=self.J), gp.Torque(tau=self.share * self.level * gl.time)
            self.other = gp.Inertia(J=2 * self.one.J)
            return [gl.connect(self.one.flange_a, self.torque.flange)]

    assert [pins(net) for net in outline(Copied(), 1).nets] == [{"one.flange_a", "torque.flange"}, {"level", "torque.tau"}]


def test_variables_of_own_connectors_are_no_signals() -> None:
    class Following(gl.Component):
        flange = gp.Flange("outside")

        def assemble(self) -> list[Any]:
            self.body, self.push = gp.Inertia(J=1.0), gp.Torque(tau=0.5 * self.flange.tau)
            return [gl.connect(self.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.push.flange)]

    assert [pins(net) for net in outline(Following(), 1).nets] == [
        {"flange", "body.flange_a"},
        {"body.flange_b", "push.flange"},
    ]


def test_levels_are_opened_down_to_a_depth() -> None:
    one, two = outline(Plant(), 1), outline(Plant(), 2)
    assert part(one, "stage").parts == ()
    assert [p.name for p in part(two, "stage").parts] == ["motor", "body", "fan", "gain"]
    assert part(two, "load").parts == ()
    names = {t.name for t in part(one, "stage").ports}
    assert names >= {"flange", "body.flange_b"}, "a port of a part's part that is connected from outside"
    inside = [pins(n) for n in part(two, "stage").nets if n.domain == "rotation"]
    assert {"body.flange_b", "flange"} <= set().union(*inside)
    own, out = Pin("body", "flange_b"), Pin(OWN, "body.flange_b")
    assert [set(net.pins) for net in part(two, "stage").nets if out in net.pins] == [{own, out, Pin(OWN, "flange")}]
    assert [p.name for p in outline(Plant(), 1).parts] == ["stage", "load", "mass", "sensor"]
    assert {t.name: t.domain for t in part(one, "mass").ports} == {"flange_r": "rotation", "flange_t": "translation"}


def test_domains_are_those_of_the_potentials_units() -> None:
    def of(*units: str) -> str:
        pairs = {f"e{k}": gl.Potential(unit) for k, unit in enumerate(units)} | {
            f"f{k}": gl.Flow("N") for k in range(len(units))
        }
        return domain(type("Plug", (gl.Connector,), pairs)("plug"))

    assert [of("rad"), of("m"), of("K"), of("V"), of("rad", "m")] == ["rotation", "translation", "heat", "other", "other"]


def test_nets_that_share_a_pin_are_one_in_order_of_their_first_pins() -> None:
    a, b, c, d, e = (Pin("x", name) for name in "abcde")
    assert joined([Net((a, b), "rotation"), Net((b, c), "heat")]) == [Net((a, b, c), "rotation")]  # that of the first pin
    found = joined([Net((d, e), "heat"), Net((b, a), "rotation"), Net((c,), "signal"), Net((b, e), "heat")])
    assert [(set(n.pins), n.domain) for n in found] == [({d, e, a, b}, "heat"), ({c}, "signal")]


def test_nets_are_in_order_also_where_a_later_one_adds_to_the_first() -> None:
    a, b, c, e = (Pin("x", name) for name in "abce")
    found = joined([Net((a,), "heat"), Net((b, c), "heat"), Net((a, e), "heat")])
    assert [net.pins for net in found] == [(a, e), (b, c)]


@pytest.mark.parametrize(("length", "shown"), [(75, 75), (76, 76), (77, 73)])
def test_long_values_are_cut_in_notes(length: int, shown: int) -> None:
    """A line of 80 letters is whole: "s = " and two quotes leave 76."""

    class Named(gl.Component):
        s = gl.Structural("")

    class Holder(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = Named(s="x" * length)
            return []

    kind, line = part(outline(Holder(), 1), "part").note.split("\n")
    assert (kind, line) == ("Named", "s = " + "x" * shown + ("..." if shown < length else ""))


def test_what_cannot_be_drawn() -> None:
    for width, right in ((200, True), (199.5, False)):
        if right:
            assert drawn(Stage(), 1, True, width).svg
        else:
            with pytest.raises(ArgumentError, match=r"width is 199\.5; expected 200 pixels or more"):
                drawn(Stage(), 1, True, width)
    with pytest.raises(ArgumentError, match="depth is 0"):
        drawn(Stage(), 0, True, 500)

    class Endless(gl.Component):
        """`Itself` inside."""

        def assemble(self) -> list[Any]:
            self.inner = Endless()
            return []

    with pytest.raises(ModelError, match="components within components, 200 levels deep; a part of its own class without end"):
        outline(Endless(), 1000)
    assert len(part(outline(Endless(), 1), "inner").parts) == 0


def test_notebooks_show_a_diagram_or_the_reason_why_there_is_none() -> None:
    class Wrong(gl.Component):
        """A `wrong` one.

        More about it.
        """

        def assemble(self) -> list[Any]:
            return [3]  # type: ignore[list-item]

    shown = html_of(Wrong())
    assert "A wrong one." in shown
    assert "More about" not in shown
    assert "must return a list of connect" in shown
    for shows in (Stage(), nested(0)):
        assert html_of(shows).endswith(picture(drawn(shows, 1, True, 1400.0).svg))
    assert drawn(nested(0), 1, True, 1400.0).svg != drawn(nested(0), 1, False, 1400.0).svg, "three alike are one box"


def nested(levels: int) -> gl.Component:
    class Nested(gl.Component):
        def assemble(self) -> list[Any]:
            self.inner = nested(levels - 1) if levels else gp.Inertia(J=1.0)
            self.others = [gp.Inertia(J=1.0) for _ in range(3)]
            return []

    return Nested()


def test_parts_in_parts_are_followed_down_to_the_deepest_level(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "DEEPEST", 3)
    found = outline(nested(2), 9)
    for _ in range(3):
        found = part(found, "inner")
    assert (found.kind, found.parts) == ("Inertia", ())
    with pytest.raises(ModelError, match=r"inner\.inner\.inner\.inner>: components within components, 3 levels deep"):
        outline(nested(3), 9)
