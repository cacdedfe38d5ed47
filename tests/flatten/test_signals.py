"""Signals that `connect` joins: which input takes which value, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError, ConnectionError, DeclarationError
from gearlib.flatten.flatten import flatten
from gearlib.language.expressions import real_symbol
from gearlib.language.outline import outline

B = gp.blocks
c = gl.connect


class Amplifier(gl.Component):
    """A composite with an input and an output of its own."""

    u = gl.Input("any", "input signal")
    y = gl.Variable("any", "output signal")

    def assemble(self) -> list[gl.Connection]:
        self.first, self.second = B.Gain(k=2.0), B.Gain(k=5.0)
        return [c(self.u, self.first.u), c(self.first.y, self.second.u), c(self.y, self.second.y)]


def model(join: Callable[[Any], list[gl.Connection]]) -> gl.Component:
    class Model(gl.Component):
        k = gl.Parameter("1", "a number", default=3.0)

        def assemble(self) -> list[gl.Connection]:
            self.ramp, self.step = B.Ramp(duration=10.0), B.Step()
            self.a, self.b = B.Gain(k=1.0), B.Gain(k=1.0)
            self.amplifier, self.torque, self.load = Amplifier(), gp.Torque(), gp.Inertia(J=1.0)
            return [c(self.torque.flange, self.load.flange_a), *join(self)]

    return Model()


def test_composites_hand_signals_through_in_any_order() -> None:
    for join in (
        lambda m: [c(m.ramp.y, m.amplifier.u), c(m.amplifier.y, m.torque.tau, m.a.u, m.b.u)],
        lambda m: [c(m.torque.tau, m.b.u), c(m.a.u, m.b.u), c(m.a.u, m.amplifier.y), c(m.amplifier.u, m.ramp.y)],
        lambda m: [c(m.ramp.y, m.amplifier.first.u), c(m.amplifier.second.y, m.torque.tau, m.a.u, m.b.u)],
    )[:2]:
        r = gl.simulate(model(join), 2.0, samples=3)
        assert r["load.w"] == pytest.approx([0.0, 0.5, 2.0])
        assert np.array_equal(r["a.y"], r["b.y"])


def test_without_a_source_the_first_input_is_the_systems() -> None:
    system = gl.compile(model(lambda m: [c(m.torque.tau, m.a.u), c(m.b.u, m.amplifier.u)]))
    assert system.inputs == ("torque.tau", "b.u") or set(system.inputs) == {"torque.tau", "b.u"}
    r = system.simulate(1.0, samples=2, inputs={"torque.tau": 4.0, "b.u": 1.0})
    assert (r["a.y"][-1], r["amplifier.y"][-1], r["load.w"][-1]) == pytest.approx((4.0, 10.0, 4.0))


def test_a_sensor_is_a_source_and_the_diagram_shows_signals() -> None:
    class Governed(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.speed, self.torque, self.load = gp.SpeedSensor(), gp.Torque(), gp.Inertia(J=2.0, start={"w": 3.0})
            self.law = B.Gain(k=-4.0)
            return [
                c(self.speed.flange, self.load.flange_a, self.torque.flange), c(self.speed.w, self.law.u), c(self.law.y, self.torque.tau)
            ]  # fmt: skip

    r = gl.simulate(Governed(), 1.0, samples=11, rtol=1e-9)
    assert r["load.w"] == pytest.approx(3.0 * np.exp(-2.0 * r.time), rel=1e-8)
    wires = outline(Governed(), 1).nets
    assert {tuple(str(p.port) for p in net.pins) for net in wires if net.domain == "signal"} == {("w", "u"), ("y", "tau")}


@pytest.mark.parametrize(
    ("join", "kind", "message"),
    [
        (
            lambda m: [c(m.ramp.y, m.step.y)],
            ConnectionError,
            r"Model: connect\(\) joins the signals ramp\.y, step\.y, each of which",
        ),
        (lambda m: [c(m.ramp.y, m.a.u), c(m.a.u, m.step.y)], ConnectionError, r"joins the signals ramp\.y, step\.y"),
        (lambda m: [c(m.k, m.a.u)], ConnectionError, r"is given the parameter k; a parameter is not a signal"),
        (lambda m: [c(gl.time, m.a.u)], ConnectionError, r"is given time; bind the input"),
        (lambda m: [c(gl.der(m.load.w), m.a.u)], ConnectionError, r"is given der\(load\.w\); bind the input"),
        (
            lambda m: [c(real_symbol("a.foo"), m.b.u)],
            ConnectionError,
            r"^Model: connect\(\) is given a\.foo, which is not a signal here; .*u, y$",
        ),
        (lambda m: [c(m.ramp.y)], ConnectionError, r"needs two signals, got only ramp\.y"),
        (lambda m: [c(m.a.u, m.a.u)], ConnectionError, r"a\.u is connected to itself"),
        (
            lambda m: [c(2 * m.ramp.y, m.a.u)],
            ConnectionError,
            r"got 2\*ramp\.y \(an expression is bound where the part is made",
        ),
        (lambda m: [c(m.ramp.y, m.load.flange_a)], ConnectionError, r"joins connectors, such as motor\.flange_b; got ramp\.y"),
        (
            lambda m: [c(m.ramp.y, m.amplifier.first.u)],
            ConnectionError,
            r"^amplifier\.first: 'u' takes two signals: u, which amplifier joins to it, and ramp\.y$",
        ),
        (lambda m: [c(m.load.w, m.torque.tau)], DeclarationError, r"load\.w is in s-1, torque\.tau is in kg\.m2\.s-2"),
    ],
)
def test_signals_that_are_refused(join: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        gl.compile(model(join))


def test_what_nothing_gives_a_value_is_named() -> None:
    class Outputs(gl.Component):
        y, z = gl.Variable("1"), gl.Variable("1")

        def assemble(self) -> list[gl.Connection]:
            self.gain = B.Gain(k=1.0)
            return [c(self.y, self.z)]

    with pytest.raises(ConnectionError, match=r"^Outputs: nothing gives y a value; connect it to a variable of a part$"):
        gl.compile(Outputs())


def test_an_input_is_not_bound_and_connected() -> None:
    class Both(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.step, self.gain = B.Step(), B.Gain(k=1.0, u=3.0)
            return [c(self.step.y, self.gain.u)]

    with pytest.raises(
        BindingError, match=r"gain\.u is bound to 3\.0, and connected to the signal step\.y; leave one of them out"
    ):
        gl.compile(Both())


def test_a_connected_signal_replaces_a_default() -> None:
    class Excited(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.current, self.brake = B.Constant(k=0.5), gp.EddyCurrentTorque(tau_nominal=1.0, w_nominal=1.0)
            self.load = gp.Inertia(J=1.0, start={"w": 2.0})
            return [c(self.current.y, self.brake.excitation), c(self.brake.flange, self.load.flange_a)]

    assert gl.simulate(Excited(), 0.1, samples=2)["brake.excitation"].tolist() == [0.5, 0.5]


def test_a_discrete_variable_is_a_source() -> None:
    class Switch(gl.Component):
        mode = gl.Discrete("1", start=2.0)

        def equations(self) -> list[Any]:
            return [gl.When(gl.time > 0.5, gl.Eq(self.mode, 5.0))]

    class Switched(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.switch, self.gain = Switch(), B.Gain(k=3.0)
            return [c(self.switch.mode, self.gain.u)]

    class Backwards(Switched):
        def assemble(self) -> list[Any]:
            super().assemble()
            return [c(self.gain.u, self.switch.mode)]

    class Twice(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.switch, self.gain = [Switch(), Switch()], B.Gain(k=3.0)
            return [c(self.switch[0].mode, self.gain.u, self.switch[1].mode)]

    for kind in (Switched, Backwards):
        model = flatten(kind())
        assert model.inputs.tolist() == []
        (bound,) = (g for g in model.groups if g.template.binds)
        assert bound.discretes.tolist() == [[model.discretes.index("switch.mode")]]
    with pytest.raises(
        ConnectionError, match=r"^Twice: connect\(\) joins the signals switch\[0\]\.mode, switch\[1\]\.mode, each of"
    ):
        flatten(Twice())
