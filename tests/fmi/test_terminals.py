"""Terminals of FMUs: the variables at each flange that an input drives, and a file that is valid by the schema of FMI 3.0."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import pytest
from lxml import etree

import gearlib as gl
import gearparts as gp
from gearlib.fmi.exported_model import exported_model
from gearlib.fmi.fmu_variables import fmu_variables
from gearlib.fmi.terminals import FlangeTerminal, terminals
from gearparts.interfaces import Flange

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"


class Front(gl.Component):
    """A motor with a torque from outside at the end of its shaft, and one at its rotor."""

    def assemble(self) -> list[Any]:
        self.motor, self.rotor = gp.Torque(), gp.Inertia(J=0.5, start={"w": 3.0, "phi": 0.1})
        self.shaft, self.hub = gp.SpringDamper(c=50.0, d=0.5), gp.Inertia(J=0.2)
        self.end = gp.TorqueToAngleAdaptor()
        return [
            gl.connect(self.motor.flange, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.hub.flange_a),
            gl.connect(self.hub.flange_b, self.end.flange),
        ]


class Rear(gl.Component):
    """A load behind a shaft whose other end is moved from outside."""

    def assemble(self) -> list[Any]:
        self.start, self.shaft, self.load = gp.AngleToTorqueAdaptor(), gp.SpringDamper(c=80.0, d=0.1), gp.Inertia(J=1.0)
        return [
            gl.connect(self.start.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]


OUTPUTS: dict[Callable[[], gl.Component], list[str]] = {
    Front: ["rotor.phi", "rotor.w", "shaft.w_rel", "shaft.tau", "end.phi", "end.w", "end.a"],
    Rear: ["start.tau", "load.w"],
}
EXPECTED = {
    Front: {
        "motor.flange": {("motor.tau", "tau", "inflow"), ("rotor.phi", "phi", "signal"), ("rotor.w", "w", "signal")},
        "end.flange": {
            ("end.tau", "tau", "outflow"), ("end.phi", "phi", "signal"), ("end.w", "w", "signal"), ("end.a", "a", "signal"),
        },
    },
    Rear: {
        "start.flange": {
            ("start.phi_ref", "phi", "signal"), ("start.tau", "tau", "inflow"),
        },
    },
}  # fmt: skip


def found(component: gl.Component, outputs: list[str] | None) -> tuple[FlangeTerminal, ...]:
    exported = exported_model(gl.compile(component, outputs=outputs).translation, None, None, None)
    return terminals(exported, fmu_variables(exported, 0))


@pytest.mark.parametrize("make", OUTPUTS)
def test_inputs_and_outputs_at_a_flange_are_a_terminal(make: Callable[[], gl.Component]) -> None:
    members = {t.name: {(m.variable, m.name, m.kind) for m in t.members} for t in found(make(), OUTPUTS[make])}
    assert members == EXPECTED[make]


def test_a_member_is_one_variable_and_an_input_before_an_output() -> None:
    """Of a rigid shaft, all bodies have the flange's speed; of a spring at the motor, the torque is the motor's."""

    class Rigid(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.shaft, self.load = gp.Torque(), gp.SpringDamper(c=50.0, d=0.5), gp.Inertia(J=0.2)
            self.speed = gp.SpeedSensor()
            return [
                gl.connect(self.motor.flange, self.shaft.flange_a, self.speed.flange),
                gl.connect(self.shaft.flange_b, self.load.flange_a),
            ]

    (terminal,) = found(Rigid(), ["shaft.tau", "speed.w", "shaft.flange_a.phi", "speed.flange.phi"])
    assert sorted((m.name, m.variable, m.kind) for m in terminal.members) == [
        ("phi", "shaft.flange_a.phi", "signal"), ("tau", "motor.tau", "inflow"), ("w", "speed.w", "signal"),
    ]  # fmt: skip


def test_the_file_of_an_fmu_is_valid_and_names_its_variables(tmp_path: Path) -> None:
    path = gl.compile(Rear(), outputs=OUTPUTS[Rear]).export_fmu(tmp_path / "rear.fmu", kind="cs")
    with zipfile.ZipFile(path) as archive:
        text = etree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
    etree.XMLSchema(etree.parse(str(SCHEMA))).assertValid(text)
    known = {v.name for v in fmpy.read_model_description(str(path), validate=True).modelVariables}
    assert {m.get("variableName") for m in text.iter("TerminalMemberVariable")} == {"start.phi_ref", "start.tau"} <= known


def test_fmi_2_has_no_terminals(tmp_path: Path) -> None:
    path = gl.compile(Rear(), outputs=OUTPUTS[Rear]).export_fmu(tmp_path / "rear.fmu", kind="cs", version="2.0")
    with zipfile.ZipFile(path) as archive:
        assert not [name for name in archive.namelist() if "terminals" in name]


class Push(gl.Component):
    """A torque whose input is the first variable of all."""

    tau = gl.Input("N.m")
    flange = Flange()

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, -self.tau)]


def test_the_first_variable_counts_like_any_other() -> None:
    class Pushed(gl.Component):
        def assemble(self) -> list[Any]:
            self.push, self.body = Push(), gp.Inertia(J=1.0)
            return [gl.connect(self.push.flange, self.body.flange_a)]

    (terminal,) = found(Pushed(), ["body.w"])
    assert {(m.variable, m.name, m.kind) for m in terminal.members} == {
        ("push.tau", "tau", "inflow"),
        ("body.w", "w", "signal"),
    }


class Reverser(gl.Component):
    """Two flanges that turn against each other."""

    flange_a, flange_b = Flange(), Flange()

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange_b.phi, -self.flange_a.phi), gl.Eq(self.flange_a.tau, self.flange_b.tau)]


@pytest.mark.parametrize("sensed", [False, True])
def test_members_turn_as_their_flange_does(sensed: bool) -> None:
    """A speed behind a reversing gear is not the flange's; a sensor's at the flange is, whatever it is computed from."""

    class Reversed(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.reverser, self.motor = gp.Inertia(J=1.0), Reverser(), gp.Torque()
            sensors = []
            if sensed:
                self.w, self.a, self.phi = gp.SpeedSensor(), gp.AccSensor(), gp.AngleSensor()
                sensors = [self.w.flange, self.a.flange, self.phi.flange]
            return [
                gl.connect(self.body.flange_b, self.reverser.flange_a),
                gl.connect(self.reverser.flange_b, self.motor.flange, *sensors),
            ]

    behind = ["body.phi", "body.w", "body.a"]
    at = ["phi.phi", "w.w", "a.a"] if sensed else []
    members = {(m.variable, m.name) for t in found(Reversed(), [*behind, *at]) for m in t.members}
    assert members == ({("motor.tau", "tau"), *((name, name.partition(".")[2]) for name in at)} if sensed else set())


def test_a_law_of_the_speed_is_no_derivative() -> None:
    class Sliding(gl.Component):
        tau, flange = gl.Input("N.m"), Flange()
        speed, square, beside = gl.Variable("rad/s"), gl.Variable("rad/s"), gl.Variable("rad/s")
        unit = gl.Parameter("s/rad", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(self.flange.tau, -self.tau),
                gl.Eq(gl.der(self.flange.phi), self.unit * self.square**2),
                gl.Eq(2 * gl.der(self.flange.phi), self.speed),
                gl.Eq(gl.der(self.flange.phi) + 3, self.beside),
            ]

    class Pushed(gl.Component):
        def assemble(self) -> list[Any]:
            self.slide, self.body = Sliding(), gp.Inertia(J=1.0)
            return [gl.connect(self.slide.flange, self.body.flange_a)]

    (terminal,) = found(Pushed(), ["slide.square", "slide.speed", "slide.beside", "body.w"])
    assert {(m.variable, m.name) for m in terminal.members} == {("slide.tau", "tau"), ("body.w", "w")}


def test_what_nothing_drives_or_nobody_sees_is_no_terminal() -> None:
    assert found(gp.Inertia(J=1.0), None) == ()
    assert [t.name for t in found(Front(), ["end.w"])] == ["end.flange"]
