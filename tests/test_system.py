"""`compile`, `simulate`, `linearize`: their arguments, and what they say when these are wrong."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, BoundError, GearlibError, ModelError, NameLookupError, SingularError, SolverError

c = gl.connect


class Drive(gl.Component):
    J_load = gl.Parameter("kg.m2", "load inertia", default=2.0, min=0)

    def assemble(self) -> list[Any]:
        self.torque, self.motor = gp.Torque(), gp.Inertia(J=0.1)
        self.gear, self.load = gp.IdealGear(ratio=10), gp.Inertia(J=self.J_load)
        return [
            c(self.torque.flange, self.motor.flange_a),
            c(self.motor.flange_b, self.gear.flange_a),
            c(self.gear.flange_b, self.load.flange_a),
        ]


SYSTEM = gl.compile(Drive())
FREE = {"torque.tau": 0.0}


def test_the_example_of_the_design() -> None:
    system = gl.compile(Drive(), outputs=["load.w"])
    assert system.outputs == ("load.w",)
    assert system.inputs == ("torque.tau",)
    assert system.states in {("load.w",), ("motor.w",)}
    assert system.parameters == {"J_load": 2.0, "motor.J": 0.1, "gear.ratio": 10.0, "load.J": 2.0}
    assert {"load.w", "torque.tau", "gear.flange_b.phi"} <= set(system.variables)
    result = system.simulate(1.0, samples=501, parameters={"J_load": 3.0}, inputs={"torque.tau": 13.0})
    assert result["load.w"] == pytest.approx(10 * result.time, rel=1e-12)
    assert repr(system) == "<System Drive: 1 states>"


def test_simulate_in_one_call() -> None:
    result = gl.simulate(Drive(), 1.0, samples=3, outputs=["load.w"], inputs={"torque.tau": 12.0})
    assert result["load.w"] == pytest.approx([0.0, 5.0, 10.0])
    assert list(result) == ["load.w"]


def test_the_time_axis() -> None:
    assert len(SYSTEM.simulate(1.0, inputs=FREE).time) == 501
    assert SYSTEM.simulate(3.0, t_start=1.0, samples=3, inputs=FREE).time.tolist() == [1.0, 2.0, 3.0]
    assert SYSTEM.simulate(3.0, times=[0.0, 0.1, 3.0], inputs=FREE).time.tolist() == [0.0, 0.1, 3.0]
    assert SYSTEM.simulate(np.float32(1.0), samples=np.int64(3), inputs=FREE).time.tolist() == [0.0, 0.5, 1.0]


def test_time_of_an_expression_is_that_of_the_run() -> None:
    class Ramp(gl.Component):
        x = gl.Variable("m", "ramp", start=0.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), gl.time)]

    for method in ("exact", "ida", "rk"):
        assert gl.compile(Ramp()).simulate(3.0, t_start=1.0, samples=2, method=method)["x"][-1] == pytest.approx(4.0, rel=1e-6)


def test_a_stepper_begins_at_zero_or_where_an_earlier_run_stopped() -> None:
    """With the parameters of that run, unless others are given; seen from the load, 130 N.m turn its inertia and 10 kg.m2 more."""
    earlier = SYSTEM.simulate(2.0, samples=5, parameters={"J_load": 3.0}, inputs={"torque.tau": 13.0})
    for options, begin, speed, rate in (
        ({}, 0.0, 0.0, 13 / 1.2),
        ({"t_start": 4}, 4.0, 0.0, 13 / 1.2),
        ({"start": earlier}, 2.0, 20.0, 10.0),
        ({"start": (earlier, 1.5)}, 1.5, 15.0, 10.0),
        ({"start": earlier, "t_start": 7.0}, 7.0, 20.0, 10.0),
        ({"start": earlier, "parameters": {"J_load": 2.0}}, 2.0, 20.0, 13 / 1.2),
        ({"parameters": {"J_load": 16.0}}, 0.0, 0.0, 5.0),
    ):
        run = SYSTEM.stepper(**{"inputs": {"torque.tau": 13.0}, **options})  # type: ignore[arg-type]
        assert (run.t, run["load.w"]) == (begin, pytest.approx(speed))
        run.advance(begin + 0.5)
        assert (run.t, run["load.w"]) == (begin + 0.5, pytest.approx(speed + 0.5 * rate))
    with pytest.raises(ArgumentError) as said:
        SYSTEM.stepper(method="exact")
    assert str(said.value) == "a stepper cannot take method='exact'; use method='auto', 'rk' or 'ida'"


def test_a_run_leaves_nothing_behind() -> None:
    first = SYSTEM.simulate(1.0, samples=3, inputs={"torque.tau": 5.0})["load.w"]
    SYSTEM.simulate(1.0, samples=3, inputs={"torque.tau": 9.0}, parameters={"J_load": 7.0}, start={"load.w": 3.0})
    assert SYSTEM.simulate(1.0, samples=3, inputs={"torque.tau": 5.0})["load.w"].tolist() == first.tolist()


def test_progress_shows_nothing_where_there_is_no_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    SYSTEM.simulate(1.0, samples=3, inputs=FREE, progress=True)
    gl.compile(Drive(), progress=True)
    assert capfd.readouterr() == ("", "")


def test_progress_of_compilation_is_told() -> None:
    told: list[float] = []
    gl.compile(Drive(), progress=lambda fraction, _: told.append(fraction))
    assert told == sorted(told)
    assert (len(told) > 1, told[-1]) == (True, 1.0)
    with pytest.raises(ArgumentError, match="progress is 'yes'; expected True, False, or a function"):
        gl.compile(Drive(), progress="yes")


def test_summary_tells_every_phase() -> None:
    text = SYSTEM.summary()
    for phase in ("flatten", "reduce", "states", "dropped", "sort", "scene"):
        assert f"\n  {phase}" in text
    assert "4 components, 3 connection sets" in text.replace("5 components", "4 components")
    assert "linear, time-invariant; outputs: everything, on demand" in text


def test_a_summary_is_that_of_inputs_at_zero() -> None:
    """Start values that fit each other without the input alone: x, and y = x + u, both start at 5."""

    class Offset(gl.Component):
        u, x, y = gl.Input("any"), gl.Variable("any", start=5.0), gl.Variable("any", start=5.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), 0.0), gl.Eq(self.y, self.x + self.u)]

    system = gl.compile(Offset())
    assert "x" in system.summary()
    with pytest.raises(gl.GearlibError, match="start values contradict each other"):
        system.simulate(1.0, samples=2, inputs={"u": 1.0})


@pytest.mark.parametrize("given", [Drive, None, "Drive", SYSTEM])
def test_only_components_are_compiled(given: Any) -> None:
    with pytest.raises(
        ModelError, match=r"expected a component, got .*" + (r"make an instance: Drive\(\)" if given is Drive else "")
    ):
        gl.compile(given)


@pytest.mark.parametrize(
    ("outputs", "message"),
    [
        (["load.ww"], r"the model has no output 'load\.ww'; did you mean 'load\.w'"),
        (["laod.w"], r"the model has no output 'laod\.w'; did you mean 'load\.w'"),
        (["load"], r"'load' is a component, no output; name one of its variables: load\.flange_a\.phi"),
        (["load.J"], r"the model has no output 'load\.J'"),
        (["der(load.w"], r"no output 'der\(load\.w'; did you mean"),
        (["der(der(load.ww))"], r"no output 'load\.ww'; did you mean 'load\.w'"),
        ([""], "no output ''"),
        ([3], "3 is not a name; names are strings"),
    ],
)
def test_unknown_outputs(outputs: Any, message: str) -> None:
    with pytest.raises(NameLookupError, match=message):
        gl.compile(Drive(), outputs=outputs)


NAN = float("nan")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"t_end": 0.0}, r"t_end \(0\) must be greater than t_start \(0\)"),
        ({"t_end": -1.0}, r"t_end \(-1\) must be greater than t_start \(0\)"),
        ({"t_start": 1.0}, r"t_end \(1\) must be greater than t_start \(1\)"),
        ({"t_end": NAN}, "t_end is nan; expected a finite number of seconds"),
        ({"t_end": float("inf")}, "t_end is inf; expected a finite number of seconds"),
        ({"t_end": "1"}, "t_end is '1'; expected a finite number of seconds"),
        ({"t_end": None}, "t_end is None; expected a finite number of seconds"),
        ({"t_start": "now"}, "t_start is 'now'; expected a finite number of seconds"),
        ({"samples": 1}, "samples is 1; expected a whole number, 2 or more"),
        ({"samples": 10.5}, "samples is 10.5; expected a whole number, 2 or more"),
        ({"samples": -5}, "samples is -5; expected a whole number, 2 or more"),
        ({"times": [0, 1, 0.5]}, r"times is array\(\[0\. , 1\. , 0\.5\]\); expected an increasing sequence of finite numbers"),
        ({"times": [0, 0.5, 0.5, 1]}, "times is .*; expected an increasing sequence"),
        ({"times": []}, "times is .*; expected an increasing sequence"),
        ({"times": [[0, 1]]}, "times is .*; expected an increasing sequence"),
        ({"times": [0, NAN]}, "times is .*; expected an increasing sequence"),
        ({"times": 3}, "times is .*; expected an increasing sequence"),
        ({"times": [0, 2]}, r"times must lie in t_start \.\. t_end \(0 \.\. 1\), got 0 \.\. 2"),
        ({"times": [-0.5, 1]}, r"times must lie in t_start \.\. t_end \(0 \.\. 1\), got -0\.5 \.\. 1"),
        ({"times": [0, 1], "samples": 3}, "give samples or times, not both"),
        ({"method": "idas"}, "there is no method 'idas'; did you mean 'ida'"),
        ({"method": None}, "there is no method None; Valid names: auto, exact, ida"),
        ({"rtol": 0.0}, "rtol is 0.0; expected a number from 1e-13 to 0.1"),
        ({"rtol": 1.0}, "rtol is 1.0; expected a number from 1e-13 to 0.1"),
        ({"rtol": NAN}, "rtol is nan; expected a number from 1e-13 to 0.1"),
        ({"rtol": "1e-6"}, "rtol is '1e-6'; expected a number"),
        ({"atol": -1.0}, "atol is -1.0; expected positive numbers"),
        ({"atol": NAN}, "atol is nan; expected positive numbers"),
        ({"parameters": {"J_load": "1"}}, r"parameter J_load is '1' \(str\); expected a number"),
        ({"parameters": {"J_load": None}}, r"parameter J_load is None \(NoneType\); expected a number"),
        ({"parameters": {"J_load": np.ones(1)}}, r"parameter J_load is array.* expected a number"),
        ({"parameters": {"J_load": 1j}}, r"parameter J_load is 1j \(complex\); expected a number"),
    ],
)
def test_wrong_arguments_of_a_run(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        SYSTEM.simulate(**{"t_end": 1.0, **options})


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"typo": 1}, NameLookupError, r"the model has no parameter 'typo'; .*J_load, gear\.ratio, load\.J, motor\.J"),
        ({"load.j": 1}, NameLookupError, r"the model has no parameter 'load\.j'; did you mean 'load\.J'"),
        ({"load.w": 1}, NameLookupError, r"the model has no parameter 'load\.w'"),
        ({"J_load": NAN}, BoundError, "J_load is nan; expected a finite number"),
        ({"J_load": -1.0}, BoundError, "J_load is -1; expected at least 0"),
        ({"motor.J": 0.0, "load.J": 0.0}, SingularError, "with motor.J = 0; load.J = 0: the model is not balanced"),
    ],
)
def test_wrong_parameters_of_a_run(parameters: dict[str, Any], error: type[GearlibError], message: str) -> None:
    with pytest.raises(error, match=message):
        SYSTEM.simulate(1.0, parameters=parameters)


def bad_call(name: str) -> None:
    run, linear = SYSTEM.simulate, SYSTEM.linearize
    calls: dict[str, Callable[[], Any]] = {
        "outputs=3": lambda: gl.compile(Drive(), outputs=3),  # type: ignore[arg-type]
        "times='abc'": lambda: run(1.0, times="abc"),  # type: ignore[arg-type]
        "times=['a']": lambda: run(1.0, times=["a"]),  # type: ignore[arg-type]
        "atol of three": lambda: run(1.0, atol=[1.0, 2.0, 3.0]),
        "atol='x'": lambda: run(1.0, atol="x"),  # type: ignore[arg-type]
        "atol=0 with ida": lambda: run(1.0, atol=0.0, method="ida"),
        "parameters as a list": lambda: run(1.0, parameters=["J_load"]),  # type: ignore[arg-type]
        "parameters by number": lambda: run(1.0, parameters={3: 1.0}),  # type: ignore[dict-item]
        "start=3": lambda: run(1.0, start=3),  # type: ignore[arg-type]
        "start as a list": lambda: run(1.0, start=["load.w"]),  # type: ignore[arg-type]
        "inputs as a list": lambda: run(1.0, inputs=[1]),  # type: ignore[arg-type]
        "inputs=5": lambda: run(1.0, inputs=5),  # type: ignore[arg-type]
        "inputs by number": lambda: run(1.0, inputs={3: 1.0}),  # type: ignore[dict-item]
        "at=3": lambda: linear(["torque.tau"], ["load.w"], at=3),
        "at after the end": lambda: linear(["torque.tau"], ["load.w"], at=(run(1.0, inputs=FREE), 5.0)),
        "at='x' of a run": lambda: linear(["torque.tau"], ["load.w"], at=(run(1.0, inputs=FREE), "x")),
    }
    calls[name]()


def test_outputs_are_a_list() -> None:
    with pytest.raises(ArgumentError, match=r"outputs is 'load\.w'; expected a list of names, such as \['load\.w'\]"):
        gl.compile(Drive(), outputs="load.w")


@pytest.mark.parametrize(
    "name",
    [
        "outputs=3", "times='abc'", "times=['a']", "atol of three", "atol='x'", "atol=0 with ida", "parameters as a list",
        "parameters by number", "start=3", "start as a list", "inputs as a list", "inputs=5", "inputs by number", "at=3",
        "at after the end", "at='x' of a run",
    ],
)  # fmt: skip
def test_slips_are_named(name: str) -> None:
    with pytest.raises((ArgumentError, NameLookupError)):
        bad_call(name)


def leaf(right: Callable[[Any], Any], start: float = 1.0, p: float = 0.0) -> gl.System:
    class Leaf(gl.Component):
        x = gl.Variable("1", "state", start=start)
        p = gl.Parameter("1", "number", default=0.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), right(self))]

    return gl.compile(Leaf() if p == 0.0 else Leaf(p=p))


@pytest.mark.parametrize("method", ["ida", "rk", "auto"])
@pytest.mark.parametrize(
    ("right", "start"),
    [
        (lambda s: s.x**2, 1.0),  # escapes at t = 1
        (lambda s: -gl.sqrt(s.x) - 1, 1.0),  # leaves the domain of the root
        (lambda s: gl.log(s.x), -1.0),  # begins outside
        (lambda s: 1 / s.x, 0.0),
        (lambda s: s.x**2 / s.p, 1.0),
    ],
)
def test_what_cannot_be_integrated_says_when(right: Callable[[Any], Any], start: float, method: str) -> None:
    with pytest.raises(GearlibError, match=r"t ?= ?[01]"):
        leaf(right, start).simulate(2.0, method=method)


def test_division_by_a_parameter_that_is_zero() -> None:
    with pytest.raises(SingularError, match=r"\bp\b"):
        leaf(lambda s: s.x / s.p).simulate(1.0)


def test_a_linear_scene_that_overflows() -> None:
    with pytest.raises(SolverError, match=r"t = 0\.(69|70)"):
        leaf(lambda s: 1000 * s.x).simulate(2.0)


@pytest.mark.parametrize(
    ("equations", "names"),
    [(lambda s: [gl.Eq(s.x * s.x, 4)], ["x"]), (lambda s: [gl.Eq(s.x, 2)], ["x"])],
)
def test_models_without_states(equations: Any, names: list[str]) -> None:
    x = gl.Variable("1", "unknown", guess=1.0)
    system = gl.compile(type("Leaf", (gl.Component,), {"x": x, "equations": equations})())
    assert system.states == ()
    for method in ("auto", "ida", "rk"):
        assert system.simulate(1.0, samples=3, method=method)["x"] == pytest.approx([2.0, 2.0, 2.0])


def test_an_empty_model() -> None:
    assert len(gl.compile(gl.Component()).simulate(1.0, samples=3).time) == 3


def test_exact_says_why_it_cannot() -> None:
    with pytest.raises(ArgumentError, match="method='exact' needs a linear time-invariant scene: the equations are not linear"):
        leaf(lambda s: -(s.x**2)).simulate(1.0, method="exact")


def test_massless_bodies() -> None:
    class Spin(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.m, self.n = gp.Torque(tau=2.0), gp.Inertia(J=0.0), gp.Inertia(J=1.0)
            return [c(self.torque.flange, self.m.flange_a), c(self.m.flange_b, self.n.flange_a)]

    system = gl.compile(Spin())
    assert system.simulate(1.0, samples=2)["m.w"][-1] == pytest.approx(2.0)  # carried by the other
    with pytest.raises(SingularError, match=r"(m|n)\b.*"):
        system.simulate(1.0, parameters={"n.J": 0.0})


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((["torque.ta"], ["load.w"]), NameLookupError, r"no input 'torque\.ta'; did you mean 'torque\.tau'"),
        ((["load.w"], ["load.w"]), NameLookupError, r"no input 'load\.w'; Valid names: torque\.tau"),
        ((["torque.tau"], ["load.ww"]), NameLookupError, r"no output 'load\.ww'; did you mean 'load\.w'"),
        (("torque.tau", ["load.w"]), ArgumentError, r"inputs is 'torque\.tau'; expected a list of names, .* \['torque\.tau'\]"),
        ((["torque.tau"], "load.w"), ArgumentError, r"outputs is 'load\.w'; expected a list of names, such as \['load\.w'\]"),
    ],
)
def test_wrong_arguments_of_linearize(arguments: Any, error: type[GearlibError], message: str) -> None:
    with pytest.raises(error, match=message):
        SYSTEM.linearize(*arguments)


def test_linear_model_of_the_drive() -> None:
    linear = SYSTEM.linearize(["torque.tau"], ["load.w", "motor.w"])
    assert type(linear).__name__ == "StateSpace"
    assert type(SYSTEM.linearize(["torque.tau"], ["load.w"], sparse=True)).__name__ == "LinearModel"
    assert [name.replace("_", ".") for name in linear.input_labels] == ["torque.tau"]  # python-control takes no dots
    assert [name.replace("_", ".") for name in linear.output_labels] == ["load.w", "motor.w"]
    response = linear(2j)[:, 0]
    assert response == pytest.approx(np.array([10.0, 100.0]) / (2.0 + 10.0) / 2j, rel=1e-12)


ZERO = "load.flange_b.tau"  # nothing is connected there
SWINGING = {"torque.tau": lambda phase, _: np.cos(phase)}
ASKED: dict[str, Callable[[gl.System], Any]] = {
    "run": lambda s: s.simulate(1.0, samples=3, inputs={"torque.tau": 3.0})[ZERO],
    "gradient": lambda s: s.simulate(1.0, samples=3, inputs={"torque.tau": 3.0}).gradient({ZERO: np.ones(3)}, ["J_load"])["J_load"],
    "sweep": lambda s: s.sweep({"J_load": np.linspace(1, 2, 9)}, 1.0, samples=3, outputs=["load.w", ZERO], inputs=FREE)[ZERO],
    "sweep in lanes": lambda s: s.sweep({"J_load": np.linspace(1, 2, 9)}, 1.0, method="rk5", lanes=8, outputs=[ZERO], inputs=FREE)[ZERO],
    "peaks": lambda s: s.sweep({"J_load": np.linspace(1, 2, 9)}, 1.0, reduce={"peak": gl.peak(ZERO)}, inputs=FREE)["peak"],
    "harmonic balance": lambda s: gl.harmonic_balance(s, 1.0, 2.0, outputs=["load.w", ZERO], inputs=SWINGING).coefficients[..., 1],
    "response": lambda s: gl.frequency_response(s, [1.0], ["torque.tau"], [ZERO]).values,
}  # fmt: skip


@pytest.mark.parametrize("way", sorted(ASKED))
def test_what_is_always_zero_can_be_asked_for_everywhere(way: str) -> None:
    found = np.asarray(ASKED[way](gl.compile(Drive())))
    assert found.size > 0
    assert not found.any()
    assert not np.signbit(found.real).any()
