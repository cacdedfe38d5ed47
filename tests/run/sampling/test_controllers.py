"""Sampled controllers of a compiled model: when they act, what they may return, and which inputs they set."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.run.sampling.controllers import (
    Controller,
    check_instants,
    controllers_of,
    read_by_controllers,
    refuse_controllers,
)
from gearparts import blocks


def controller(period: float = 0.25, offset: float = 0.0, function: Any = None, gives: int = 1) -> Controller:
    class Pair(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load = gp.Torque(), gp.Inertia(J=1.0)
            self.law = gl.Sampled(function or (lambda t, y: 0.0), period, offset=offset, outputs=[self.torque.tau])
            return [gl.connect(self.torque.flange, self.load.flange_a)]

    return Controller("law", Pair().law, ("law.inputs[0].y",), tuple(range(gives)))


def test_instants_in_a_closed_interval() -> None:
    assert controller(0.25).instants(0.0, 1.0) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert controller(0.25, 0.1).instants(0.0, 0.6) == pytest.approx([0.1, 0.35, 0.6])
    assert controller(0.25, -0.1).instants(0.0, 0.5) == pytest.approx([0.15, 0.4])
    assert controller(2.0, 0.5).instants(1.0, 2.0) == []
    for first, last in ((3, 9), (7, 12)):  # ends that miss an instant by rounding
        t0, t1 = math.nextafter(0.1 * first, 9.0), math.nextafter(0.1 * last, 0.0)
        found = controller(0.1).instants(t0, t1)
        assert (found[0], found[-1], len(found)) == (t0, t1, last - first + 1)


@pytest.mark.parametrize("returned", [2.5, np.float64(2.5), [2.5], (2.5,), np.array([2.5]), np.array([[2.5]])])
def test_one_number_in_any_shape(returned: Any) -> None:
    seen: list[Any] = []
    law = controller(function=lambda t, y: seen.append((t, y.tolist())) or returned)
    assert law(0.5, np.array([1.0, 2.0])) == [2.5]
    assert seen == [(0.5, [1.0, 2.0])]


@pytest.mark.parametrize("returned", [None, "2.5", [], [1.0, 2.0], np.nan, np.inf, [[None]], 1j])
def test_what_is_not_one_finite_number_is_refused(returned: Any) -> None:
    law = controller(function=lambda t, y: returned)
    message = r"the function of law, called at t = 0.125 s, returned .*; expected 1 finite number$"
    with pytest.raises(ArgumentError, match=message):
        law(0.125, np.zeros(1))


def test_several_numbers() -> None:
    assert controller(function=lambda t, y: (1, 2.0), gives=2)(0.0, np.zeros(1)) == [1.0, 2.0]
    with pytest.raises(ArgumentError, match=r"returned 1.0; expected 2 finite numbers$"):
        controller(function=lambda t, y: 1.0, gives=2)(0.0, np.zeros(1))


def test_a_function_that_fails_is_named() -> None:
    with pytest.raises(ArgumentError, match=r"the function of law, called at t = 3 s, raised ZeroDivisionError: .*zero"):
        controller(function=lambda t, y: 1 / 0)(3.0, np.zeros(1))


class Plant(gl.Component):
    """Two torques set by one controller, a third one open, and a delay."""

    def assemble(self) -> list[Any]:
        self.open, self.one, self.two = gp.Torque(), gp.Torque(), gp.Torque()
        self.load = gp.Inertia(J=1.0)
        self.line = gp.blocks.FixedDelay(u=self.load.w, delay_time=0.1)
        self.law = gl.Sampled(
            lambda t, y: (y[0], y[1]), 0.5, inputs=[self.load.w, self.load.phi], outputs=[self.one.tau, self.two.tau]
        )
        return [gl.connect(self.open.flange, self.one.flange, self.two.flange, self.load.flange_a)]


def made(model: gl.Component) -> gl.Component:
    """A model with its parts, as its compilation leaves it."""
    return gl.compile(model).translation.component


def test_inputs_that_controllers_and_delays_set() -> None:
    plant = made(Plant())
    inputs = ("law.outputs[1].u", "open.tau", "line.past", "law.outputs[0].u")
    law, line = sorted(controllers_of(plant, inputs, ("load.J", "line.delay_time")), key=lambda c: c.path)
    assert (law.path, law.reads, law.gives) == ("law", ("law.inputs[0].y", "law.inputs[1].y"), (3, 0))
    assert (line.path, line.reads, line.gives, line.parameter) == ("line", ("line.now",), (2,), 1)
    assert sorted(read_by_controllers(plant)) == ["law.inputs[0].y", "law.inputs[1].y", "line.now", "line.total"]
    assert controllers_of(made(gp.Inertia(J=1.0)), (), ()) == read_by_controllers(made(gp.Inertia(J=1.0))) == ()


def test_a_controller_is_joined_to_its_signals_in_a_model_without_connections() -> None:
    """der(y) is -2 y at the last instant: 1, 1/2, 1/4."""

    class Alone(gl.Component):
        def assemble(self) -> list[Any]:
            self.store = gp.blocks.Integrator(start={"y": 1.0})
            self.law = gl.Sampled(lambda t, y: -2.0 * y[0], 0.25, inputs=[self.store.y], outputs=[self.store.u])
            return []

    system = gl.compile(Alone(), outputs=["store.y"])
    assert system.translation.open_inputs == ()
    assert system.simulate(0.5, samples=3)["store.y"] == pytest.approx([1.0, 0.5, 0.25])


def test_a_delay_by_itself_is_the_whole_model() -> None:
    """Its history is kept as that of a part; and it is refused by the name of its class."""
    system = gl.compile(gp.blocks.FixedDelay(delay_time=0.25), outputs=["y"])
    assert system.translation.open_inputs == ("u",)
    (own,) = system.translation.controllers
    assert (own.path, own.reads) == ("FixedDelay", ("now",))
    found = system.simulate(1.0, samples=5, inputs={"u": lambda t: 3.0 * t})
    assert found["y"] == pytest.approx([0.0, 0.0, 0.75, 1.5, 2.25], abs=1e-6)
    with pytest.raises(ArgumentError, match=r"^it needs equations without a history, and FixedDelay delays a signal"):
        refuse_controllers(system.translation.component, "it")


def test_analyses_that_need_equations_refuse_both_by_name() -> None:
    class Governed(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load = gp.Torque(), gp.Inertia(J=1.0)
            self.law = gl.Sampled(lambda t, y: 0.0, 0.5, outputs=[self.torque.tau])
            return [gl.connect(self.torque.flange, self.load.flange_a)]

    with pytest.raises(
        ArgumentError, match=r"^it needs equations without a history, and line delays a signal; put .*PadeDelay"
    ):
        refuse_controllers(made(Plant()), "it")
    with pytest.raises(ArgumentError, match=r"^it needs equations, and law is a Python function \(gl.Sampled\); leave it out"):
        refuse_controllers(made(Governed()), "it")
    refuse_controllers(made(gp.Inertia(J=1.0)), "it")


class Held(gl.Component):
    """x is driven by what was kept at an instant; z only by itself, and is set to 0 at instants."""

    k = gl.Parameter("any", default=1.0)
    x, z = gl.Variable("any", start=1.0), gl.Variable("any", start=1.0)
    kept, late = gl.Discrete(), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), -self.kept),
            gl.Eq(gl.der(self.z), -self.k * self.z),
            gl.When(gl.sample(0.1), gl.Eq(self.kept, self.x)),
            gl.When(gl.sample(0.2), gl.reinit(self.z, 0.0)),
            gl.When(self.x < 0.5, gl.Eq(self.late, 1.0)),
        ]


def test_what_acts_at_single_instants_is_refused_where_it_is_held_in_rates() -> None:
    """By the part that it stands in; not for rates that do not depend on it."""
    scene = gl.compile(Held()).translation.scene
    by_name = dict(zip(scene.state_names, scene.states, strict=True))
    with pytest.raises(
        ArgumentError, match=r"^it needs equations that act at all times, and the model acts at single instants \(gl"
    ):
        check_instants(scene.structure, [by_name["x"], by_name["z"]], "it")
    check_instants(scene.structure, [by_name["z"]], "it")

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.first, self.second = Held(), Held()
            return []

    both = gl.compile(Two()).translation.scene
    with pytest.raises(ArgumentError, match=r"times, and first, second acts at single instants"):
        check_instants(both.structure, both.states, "it")
    own = dict(zip(both.state_names, both.states, strict=True))
    with pytest.raises(ArgumentError, match=r"times, and second acts at single instants"):
        check_instants(both.structure, [own["second.x"], own["first.z"]], "it")


class Taken(gl.Component):
    """A speed that a pulse train takes, and holds against itself; and a flag that events set, too."""

    w = gl.Variable("rad/s", start=1.0)
    y = gl.Variable("rad/s")
    held = gl.Discrete("speed at the last pulse")
    past = gl.Discrete("whether the speed fell below a half")
    fed = gl.Structural(True)

    def equations(self) -> list[gl.Eq | gl.When]:
        brake = 20.0 * (self.held if self.fed else self.w) * (2.0 - self.past)
        return [
            gl.Eq(gl.der(self.w), -brake),
            gl.Eq(self.y, 2.0 * self.held),
            gl.When(gl.sin(20 * gl.pi * gl.time) > 0, gl.Eq(self.held, self.w)),
            gl.When(self.w < 0.5, gl.Eq(self.past, 1.0)),
        ]


def test_what_events_hold_is_said_to_be_constant() -> None:
    """A linear model of the controlled speed would be that of the open loop; a flag stays as it is, which is no news."""
    said = r"takes held as constant, which events set from w: it holds as long as none does"
    fed, free = gl.compile(Taken()), gl.compile(Taken(fed=False))
    for ask in (
        lambda: fed.linearize(inputs=[], outputs=["w"]),
        lambda: gl.stability(fed),
        lambda: gl.modes(fed),
        lambda: free.linearize(inputs=[], outputs=["y"]),
    ):
        with pytest.warns(gl.GearlibWarning, match=said):
            ask()
    assert float(free.linearize(inputs=[], outputs=["w"]).A[0, 0]) == -40.0


class Measured(gl.Component):
    """A braked body under a torque; its speed is sampled, and nothing depends on that."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.load, self.brake, self.ground = gp.Torque(), gp.Inertia(J=1.0), gp.Damper(d=1.0), gp.Fixed()
        self.sensor, self.sampler = gp.SpeedSensor(), blocks.Sampler(sample_period=0.1)
        return [
            gl.connect(self.torque.flange, self.load.flange_a), gl.connect(self.load.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange), gl.connect(self.sensor.flange, self.load.flange_b),
            gl.connect(self.sensor.w, self.sampler.u),
        ]  # fmt: skip


def test_a_sampled_signal_is_no_output_of_a_linear_model() -> None:
    """It would not respond at all: at low frequencies it does as the speed, 1 / (1 + j w)."""
    system, loop = gl.compile(Measured()), ("torque.tau", "sampler.y")
    for ask in (
        lambda: system.linearize(inputs=["torque.tau"], outputs=["load.w", "sampler.y"]),
        lambda: gl.frequency_response(system, [0.1], ["torque.tau"], ["sampler.y"]),
        lambda: gl.stability(system, loop=loop),
        lambda: gl.steady_state(system, ["sampler.y"], inputs={"torque.tau": 3.0}),
    ):
        with pytest.raises(ArgumentError, match=r"^a linear model needs equations that act at all times, and sampler acts at"):
            ask()
    found = gl.frequency_response(system, [0.1], ["torque.tau"], ["load.w"])
    assert found["load.w"][0] == pytest.approx(1 / (1 + 0.1j), rel=1e-12)
