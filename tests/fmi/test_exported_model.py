"""What of a model an FMU contains: outputs, parameters that stay what they are, start values; and what it cannot contain."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, GearlibWarning, ModelError, NameLookupError
from gearlib.fmi import exported_model as module
from gearlib.fmi.exported_model import ExportedModel, exported_model, used_parameters
from tests.fmi.test_model_source import Timed
from tests.fmi.test_preparation import Bound
from tests.run.refusals.test_jumps import ROUGH, SMOOTH, Cam


class Chosen(gl.Component):
    """A gear whose state is the speed of the motor, and that starts with a speed of the wheel."""

    w = gl.Parameter("rad/s", default=5.0)
    twice = gl.Parameter("rad/s", default=lambda c: 2 * c.w)
    J = gl.Parameter("kg.m2", default=1.0)

    def assemble(self) -> list[Any]:
        self.motor, self.gear = gp.Inertia(J=self.J, state={"w": "prefer"}), gp.IdealGear(ratio=3.0)
        self.wheel = gp.Inertia(J=2.0, start={"w": self.twice}, state={"w": "never"})
        return [
            gl.connect(self.motor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.wheel.flange_a),
        ]


class Closed(gl.Component):
    """Two rigid gears between the same two shafts; a ratio of their own in each."""

    ratio, same = gl.Parameter("1", default=3.0), gl.Parameter("1", default=0.0)

    def assemble(self) -> list[Any]:
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.one, self.other = gp.IdealGear(ratio=self.ratio), gp.IdealGear(ratio=3.0 + self.same)
        return [
            gl.connect(self.a.flange_b, self.one.flange_a, self.other.flange_a),
            gl.connect(self.one.flange_b, self.other.flange_b, self.b.flange_a),
        ]


class Measured(gl.Component):
    """What starts with a given value is a multiple of the state."""

    k = gl.Parameter("1", default=2.0)
    x, y = gl.Variable("any"), gl.Variable("any", start=3.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), -self.x), gl.Eq(self.y, self.k * self.x)]


class Decided(gl.Component):
    """A body without inertia, so that its equation determines a torque."""

    J, k = gl.Parameter("kg.m2", default=0.0), gl.Parameter("kg.m2", default=1.0)

    def assemble(self) -> list[Any]:
        self.torque, self.a, self.shaft = gp.Torque(), gp.Inertia(J=3 * self.J), gp.SpringDamper(c=1.0, d=1.0)
        self.b = gp.Inertia(J=self.k)
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.b.flange_a),
        ]


def exported(component: gl.Component, outputs: Any = None, **options: Any) -> ExportedModel:
    given = {"parameters": None, "inputs": None, "outputs": None, **options}
    return exported_model(gl.compile(component, outputs).translation, **given)


STARTS, EQUATIONS, LOOP = (
    "start values are computed from it",
    "its value is part of the equations",
    "a rigid loop closes with it",
)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (Chosen, dict.fromkeys(("w", "twice", "gear.ratio", "start(wheel.w)"), STARTS)),
        (Measured, dict.fromkeys(("k", "start(y)"), STARTS)),
        (Closed, dict.fromkeys(("ratio", "same"), LOOP)),
        (Decided, dict.fromkeys(("J", "a.J"), EQUATIONS)),
        (Bound, {}),
    ],
)
def test_parameters_that_stay_what_they_are(make: Callable[[], gl.Component], expected: dict[str, str]) -> None:
    """With all that they follow from: another value of these would have no effect, or a wrong one, such as a loop no longer closing."""
    found = exported(make())
    names = found.model.parameters.names
    assert {names[p]: why for p, why in found.constants.items()} == expected


def test_start_values_belong_to_states_or_follow() -> None:
    found = exported(Chosen(), ["wheel.w"])
    assert (found.own_starts, found.start.tolist()) == ((True,), [30.0])
    bound = exported(Bound())
    assert dict(zip(bound.scene.state_names, bound.own_starts, strict=True)) == {
        "motor.w": False, "shaft.phi_rel": True, "load.w": False,
    }  # fmt: skip
    assert bound.start.tolist() == [3.0, 0.0, 0.75]
    assert exported(Bound(), parameters={"w": 8.0}).start.tolist() == [8.0, 0.0, 2.0]
    names = bound.model.parameters.names
    assert {names[p] for p in bound.dependent} == {"start(load.w)", "motor.J", "start(motor.w)", "wheel.J"}
    assert {names[p]: value for p, value in bound.given.items() if "." not in names[p]} == {"J": 0.5, "w": 3.0, "when": 0.02}
    assert not bound.dependent & bound.given.keys()


def test_outputs_that_are_neither_states_nor_their_derivatives() -> None:
    names = ["motor.w", "der(motor.w)", "gear.flange_a.tau", "gear.flange_b.tau", "wheel.w", "motor.w"]
    found = exported(Chosen(), names)
    assert found.names == tuple(names[:-1])
    assert [o.name for o in found.outputs] == ["gear.flange_a.tau", "gear.flange_b.tau", "wheel.w"]
    places = [found.observed.outputs[o.slot] for o in found.outputs]
    assert len(set(places)) == 3
    assert places == [node for node in found.nodes if node in places]
    assert [o.sign * found.outputs[0].sign for o in found.outputs] == [1, -1, -1]
    assert [(o.order, o.discrete) for o in found.outputs] == [(0, -1)] * 3
    assert [list(found.model.names())[o.variable] for o in found.outputs] == [o.name for o in found.outputs]
    assert found.observed.outputs[0] == (found.scene.states[0][0], 1), "the derivatives of the states come first"
    faster = exported(Chosen(), ["der(wheel.w)"]).outputs
    assert [(o.name, o.order) for o in faster] == [("der(wheel.w)", 1)]


def test_discrete_outputs_are_places_of_the_discrete_state() -> None:
    class Counting(gl.Component):
        x = gl.Variable("any", start=0.0)
        first, n, m = gl.Discrete(start=5), gl.Discrete(start=4), gl.Discrete(start=7)

        def equations(self) -> list[Any]:
            count = [gl.Eq(v, gl.pre(v) + 1) for v in (self.first, self.n, self.m)]
            return [gl.Eq(gl.der(self.x), 1.0), gl.When(self.x > 1, *count)]

    found = exported(Counting(), ["m", "x", "n"])
    start = found.model.initial_discrete()
    assert [(o.name, start[o.discrete]) for o in found.outputs] == [("m", 7.0), ("n", 4.0)]
    assert {(o.variable, o.order, o.slot, o.sign) for o in found.outputs} == {(-1, 0, -1, 1)}


def test_parameters_that_the_outputs_need() -> None:
    found = exported(Decided(), ["b.w"])
    names = found.model.parameters.names
    assert {names[p] for p in used_parameters(found.observed)} == {"b.J"}
    bound = exported(Bound())
    assert {bound.model.parameters.names[p] for p in used_parameters(bound.observed)} == {
        "motor.J", "gear.ratio", "wheel.J", "shaft.c", "shaft.d", "shaft.phi_rel0", "load.J", "torque.tau#0",
    }  # fmt: skip


class Two(gl.Component):
    """Two inputs, of which one drives the state in time."""

    u, v = gl.Input("any"), gl.Input("any")
    x = gl.Variable("any", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.u + 2 * self.v)]


@pytest.mark.parametrize(
    ("inputs", "numbers", "starts"),
    [
        (None, (0, 1), [0, 0]),
        ([], (), [0, 0]),
        (["v"], (1,), [0, 0]),
        (["v", "u"], (1, 0), [0, 0]),
        ({"v": 3}, (1,), [0, 3]),
        ({"v": 3, "u": 4.0}, (1, 0), [4, 3]),
    ],
)
def test_inputs_that_the_tool_provides(inputs: Any, numbers: tuple[int, ...], starts: list[float]) -> None:
    """The others are 0, as a warning says."""
    left = [name for k, name in enumerate(("u", "v")) if k not in numbers]
    with pytest.warns(gl.InputWarning, match=f"{', '.join(left)}: .* 0 in the FMU") if left else nullcontext():
        found = exported(Two(), inputs=inputs)
    assert (found.inputs, found.input_starts.tolist(), found.driven, found.timed) == (numbers, starts, False, ())


def test_what_time_drives() -> None:
    class Driven(gl.Component):
        x = gl.Variable("any", start=0.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), gl.sin(gl.time))]

    assert exported(Driven()).driven
    bound = exported(Bound())
    assert (bound.driven, len(bound.timed)) == (False, 1)
    assert bound.relations is not None
    assert bound.relations.on_time is not None
    assert bound.relations.on_time.all()
    assert exported(Two()).relations is None


def test_times_that_a_formula_gives_are_not_searched_for() -> None:
    """An instant and a wave have one; a sine of time has none."""

    class Late(Timed):
        y = gl.Discrete()

        def equations(self) -> Any:
            return [gl.When(gl.sin(3 * gl.time) > 0.3, gl.Eq(self.y, 1))]

    found = exported(Late(), ["x", "n", "y"])
    assert sorted(t.wave is None for t in found.timed) == [False, True]
    relations = found.relations
    assert relations is not None
    assert relations.on_time is not None
    assert (len(relations.on_time), relations.on_time.sum(), len(relations.searched)) == (3, 2, 1)


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"inputs": ["w"]}, NameLookupError, "the model has no unbound input 'w'; Valid names: u, v"),
        ({"inputs": ["x"]}, NameLookupError, "the model has no unbound input 'x'; it is bound in the model, or no input"),
        ({"inputs": {"u": "a"}}, ArgumentError, "input u is 'a'; expected a finite number"),
        ({"inputs": {"u": abs}}, ArgumentError,
         "the input u is <built-in function abs>: an FMU holds no Python and no table. Leave it to the tool that imports the FMU "
         "(inputs=['u']), or bind it in the model to an expression of gl.time or to a gl.Table of gl.time"),
        ({"outputs": ["x", "v"]}, ArgumentError, "v is an input of the FMU, so it cannot be an output; leave it out of outputs"),
        ({"outputs": ["y"]}, NameLookupError, None),
    ],
)  # fmt: skip
def test_what_is_refused(options: dict[str, Any], error: type[Exception], said: str | None) -> None:
    with pytest.raises(error) as problem:
        exported(Two(), **options)
    assert said is None or str(problem.value) == said


def test_an_impulse_that_an_fmu_does_not_have_is_told() -> None:
    with pytest.warns(GearlibWarning, match="^Cam: cam: an equation that has to be differentiated may jump or have a corner"):
        exported(Cam(law=ROUGH["corner"][0]))
    exported(Cam(law=SMOOTH["parabola"]))


@pytest.mark.parametrize(("at", "stop_time"), [(0.5, 1.0), (2.0, 3.0), (2.0, 1.0)])
def test_a_jump_within_the_simulated_time_is_refused_as_in_a_run(at: float, stop_time: float) -> None:
    """A later one is told: a tool may simulate for longer."""

    class Moved(gl.Component):
        def assemble(self) -> list[Any]:
            speed = gl.Piecewise((1.0, gl.time < at), (3.0, True))
            self.motor, self.body = gp.Speed(w_ref=speed, exact=True), gp.Inertia(J=1.0)
            return [gl.connect(self.motor.flange, self.body.flange_a)]

    system = gl.compile(Moved(), ["body.a"])
    said = f"^motor: motor.w_ref has a jump at t = {at:g} s, but must be differentiated there"
    if at > stop_time:
        with pytest.warns(GearlibWarning, match="^Moved: motor: an equation that has to be differentiated may jump"):
            exported_model(system.translation, None, None, None, stop_time)
        return
    with pytest.raises(ModelError, match=said):
        exported_model(system.translation, None, None, None, stop_time)
    with pytest.raises(ModelError, match=said):
        system.simulate(stop_time)["body.a"]


def test_parameters_that_follow_are_not_given() -> None:
    with pytest.raises(ArgumentError) as said:
        exported(Chosen(), parameters={"w": 1.0, "motor.J": 2.0})
    assert str(said.value) == "motor.J follows from other parameters, and does so in the FMU: give those, not motor.J"


def test_equations_solved_together_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many as an FMU, which factorises a dense matrix, can do."""
    count = max(len(step.unknowns) for step in exported(Bound()).observed.steps if hasattr(step, "unknowns"))
    monkeypatch.setattr(module, "MOST_DENSE", count)
    exported(Bound())
    monkeypatch.setattr(module, "MOST_DENSE", count - 1)
    with pytest.raises(ArgumentError) as said:
        exported(Bound())
    assert str(said.value) == (
        f"Bound: {count} equations are solved together, and an FMU factorises {count - 1} at most; make some of the rigid connections "
        "elastic"
    )
