"""What an FMU computes from its parameters, beside what gearlib computes in Python."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

import gearlib as gl
import gearparts as gp
from gearlib.fmi.exported_model import exported_model
from gearlib.fmi.model_source import model_source
from tests.fmi.fmu_instance import FmuInstance
from tests.test_acceptance import RigidLoop


class Bound(gl.Component):
    """Start values, inertias and a time that follow from parameters; a rigid gear, so that equations are solved together."""

    J = gl.Parameter("kg.m2", "inertia of the motor", default=0.5, min=0.0)
    w = gl.Parameter("rad/s", "speed at the start", default=3.0)
    when = gl.Parameter("s", "time of the step", default=0.02)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=gl.Piecewise((7.0, gl.time >= self.when), (1.0, True)))
        self.motor = gp.Inertia(J=self.J, start={"phi": 0.0, "w": self.w})
        self.gear = gp.IdealGear(ratio=3.0)
        self.wheel = gp.Inertia(J=4 * self.J + 1.0)
        self.shaft, self.load = gp.SpringDamper(c=1e3, d=2.0), gp.Inertia(J=2.0, start={"w": self.w / 4})
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]


MODELS: dict[str, Callable[[], gl.Component]] = {"bound": Bound, "xp": gp.ZhouCui2022, "rigid_loop": RigidLoop}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[gl.System, Path, Path]]:
    known: dict[str, tuple[gl.System, Path, Path]] = {}

    def make(name: str) -> tuple[gl.System, Path, Path]:
        if name not in known:
            folder = tmp_path_factory.mktemp(name)
            system = gl.compile(MODELS[name]())
            (folder / "content").mkdir()
            known[name] = system, system.export_fmu(folder / f"{name}.fmu"), folder / "content"
        return known[name]

    return make


@pytest.mark.parametrize("name", MODELS)
def test_each_parameter_has_the_effect_that_it_has_in_gearlib(name: str, made: Callable[..., Any]) -> None:
    system, path, folder = made(name)
    inputs = dict.fromkeys(system.inputs, 1.0)
    one = FmuInstance(path, folder, "me")
    checked = 0
    for variable in one.description.modelVariables:
        if variable.causality != "parameter":
            continue
        before = float(variable.start)
        value = 1.07 * before if before else 0.1
        one.fmu.reset()
        one.set({variable.name: value, **inputs})
        one.fmu.enterInitializationMode(startTime=0.0)
        expected = system.simulate(1e-9, samples=2, method="rk", parameters={variable.name: value}, inputs=inputs)
        for state in system.states:
            got, rate = one.get(state, f"der({state})")
            assert got == pytest.approx(expected[state][0], rel=1e-12, abs=1e-14), (variable.name, state)
            assert rate == pytest.approx(expected[f"der({state})"][0], rel=1e-9, abs=1e-9), (variable.name, state)
        checked += 1
    assert checked > 3
    one.close()


def test_time_of_an_event_follows_its_parameter(made: Callable[..., Any]) -> None:
    system, path, folder = made("bound")
    one = FmuInstance(path, folder)
    one.begin(when=0.0301)
    one.go(0.1, 10)
    expected = system.simulate(0.1, samples=2, rtol=1e-11, method="rk", parameters={"when": 0.0301})
    np.testing.assert_allclose(one.get(*system.states), [expected[n][-1] for n in system.states], rtol=1e-8)
    one.close()


def test_tunable_parameter_changes_during_a_run(made: Callable[..., Any]) -> None:
    system, path, folder = made("bound")
    one = FmuInstance(path, folder)
    one.begin()
    one.go(0.05, 5)
    one.set({"shaft.c": 300.0})
    one.go(0.05, 5)
    first = system.simulate(0.05, samples=2, rtol=1e-11, method="rk")
    then = system.simulate(0.1, samples=2, rtol=1e-11, method="rk", start=first, parameters={"shaft.c": 300.0})
    np.testing.assert_allclose(one.get(*system.states), [then[n][-1] for n in system.states], rtol=1e-8)
    one.close()


def test_iterations_begin_at_the_guesses(tmp_path: Path) -> None:
    """Which root each loop takes: that on the side of its guess."""

    class Roots(gl.Component):
        x = gl.Variable("1", start=4.0)
        low, high = gl.Variable("1", guess=-3.0), gl.Variable("1", guess=3.0)
        double = gl.Variable("1")

        def equations(self) -> Any:
            return [
                gl.Eq(gl.der(self.x), -self.x + self.low),
                gl.Eq(self.double, 2 * self.low),
                gl.Eq(self.low**2 + 0.5 * self.low, self.x),
                gl.Eq(self.high**2 + 0.1 * self.high, 10 + self.double),
            ]

    system = gl.compile(Roots(), outputs=["low", "high"])
    one = FmuInstance(system.export_fmu(tmp_path / "roots.fmu"), tmp_path, "me")
    one.begin()
    low, high = one.get("low", "high")
    assert low == pytest.approx(min(np.roots([1, 0.5, -4])), rel=1e-9)
    assert high == pytest.approx(max(np.roots([1, 0.1, -10 - 2 * low])), rel=1e-9)
    one.close()


def test_start_value_that_is_given_holds(made: Callable[..., Any]) -> None:
    system, path, folder = made("bound")
    kinds = {v.name: v for v in FmuInstance(path, folder).description.modelVariables}
    assert {name for name in system.states if kinds[name].initial == "calculated"} == {"motor.w", "load.w"} & set(system.states)
    one = FmuInstance(path, folder)
    free = next(name for name in system.states if kinds[name].initial == "exact")
    one.begin(**{free: 0.01})
    assert one.get(free) == [0.01]
    one.close()


def test_equations_that_may_become_singular_are_named_by_their_parts() -> None:
    exported = exported_model(gl.compile(Bound()).translation, None, None, None)
    (said,) = {check for check in model_source(exported).checks if "singular" in check}
    assert said == "the equations of gear, motor, wheel are singular with these parameters"


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"J": -1.0}, "J is -1; it must lie between 0 and inf"),
        ({"wheel.J": 3.5}, "wheel.J cannot be set: it is constant, or follows from other parameters"),
        ({"gear.ratio": 0.0}, "singular|division by zero"),
        ({"motor.w": 1.0}, "follows from parameters and cannot be set"),
    ],
)
def test_values_that_cannot_be_are_refused_by_name(values: dict[str, float], text: str, made: Callable[..., Any]) -> None:
    _, path, folder = made("bound")
    one = FmuInstance(path, folder)
    with pytest.raises(FMICallException):
        one.begin(**values)
    assert re.search(text, one.messages[-1]), one.messages
    one.close()


def test_start_values_of_other_variables_than_states_are_constant(tmp_path: Path) -> None:
    class Rolling(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.gear = gp.Inertia(J=1.0), gp.IdealGear(ratio=3.0)
            self.wheel = gp.Inertia(J=2.0, start={"w": 5.0})
            return [
                gl.connect(self.motor.flange_b, self.gear.flange_a),
                gl.connect(self.gear.flange_b, self.wheel.flange_a),
            ]

    system = gl.compile(Rolling(), outputs=["wheel.w", "motor.w"])
    description = FmuInstance(system.export_fmu(tmp_path / "rolling.fmu"), tmp_path / "content").description
    ratio = next(v for v in description.modelVariables if v.name == "gear.ratio")
    if system.translation.scene.unfixed is None:
        assert ratio.variability == "constant"
        assert "start values are computed from it" in ratio.description
    else:
        assert ratio.variability == "tunable"


def test_start_values_of_one_variable_that_contradict_each_other(tmp_path: Path) -> None:
    """Two bodies of one rigid shaft, both with a fixed angle: one angle, or a refusal that names both."""

    class Shaft(gl.Component):
        p_a = gl.Parameter("rad", "angle of the first body", default=0.5)
        p_b = gl.Parameter("rad", "angle of the second", default=0.5)

        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0, start={"phi": self.p_a}), gp.Inertia(J=2.0, start={"phi": self.p_b})
            self.spring = gp.Torque(tau=-30.0 * self.a.phi)
            return [gl.connect(self.spring.flange, self.a.flange_a), gl.connect(self.a.flange_b, self.b.flange_a)]

    (tmp_path / "content").mkdir()
    path = gl.compile(Shaft(), outputs=["a.phi"]).export_fmu(tmp_path / "shaft.fmu")
    one = FmuInstance(path, tmp_path / "content")
    one.begin(p_a=0.7, p_b=0.7)
    assert one.get("a.phi") == pytest.approx([0.7], rel=1e-12)
    one.fmu.reset()
    with pytest.raises(FMICallException):
        one.begin(p_a=0.7, p_b=0.7001)
    assert re.search(r"start\(a\.phi\) and start\(b\.phi\) contradict each other: they are one variable", one.messages[-1]), (
        one.messages
    )
    one.close()


TIMES = {
    "sine": lambda t, p, k: gl.sin(2 * gl.pi * t), "falling": lambda t, p, k: -gl.sin(2 * gl.pi * t),
    "no formula": lambda t, p, k: gl.sin(2 * gl.pi * t + t**2), "growth": lambda t, p, k: gl.exp(t) - 1,
    "late": lambda t, p, k: (t - 0.3 + p) * k - p * k,
}  # fmt: skip


@pytest.mark.parametrize("kind", TIMES)
def test_conditions_on_time_begin_and_switch_as_in_gearlib(kind: str, tmp_path: Path) -> None:
    """Zero at the start, where they have their right-hand limit; or hidden by rounding, where they should switch."""

    class Counted(gl.Component):
        x, n = gl.Variable("1", start=0.0), gl.Discrete()
        p, k, s = gl.Parameter("1", default=54321.987), gl.Parameter("1", default=3.1), gl.Parameter("s", default=1.0)

        def equations(self) -> list[Any]:
            on = TIMES[kind](gl.time / self.s, self.p, self.k) > 0
            run = gl.Eq(gl.der(self.x), gl.Piecewise((1, on), (0, True)) / self.s)
            return [run, gl.When(on, gl.Eq(self.n, gl.pre(self.n) + 1))]

    system = gl.compile(Counted(), outputs=["x", "n"])
    path = system.export_fmu(tmp_path / "counted.fmu", stop_time=1.2)
    on = np.array([float(TIMES[kind](t, 0.0, 1.0)) > 0 for t in np.linspace(0.0, 1.2, 1001)[1:]])
    begins = int(np.count_nonzero(np.diff(on.astype(int)) > 0))
    for method in ("rk5", "ida", "taylor"):
        run = system.simulate(1.2, samples=2, method=method)
        assert run["n"][-1] == begins
        assert run["x"][-1] == pytest.approx(1.2 * on.mean(), abs=2e-3)
        assert 0.0 not in [t for t, _ in run.events]
    for name in ("CoSimulation", "ModelExchange"):
        found = fmpy.simulate_fmu(str(path), fmi_type=name, stop_time=1.2, output_interval=0.3, output=["x", "n"])
        assert found["n"][-1] == begins
        assert found["x"][-1] == pytest.approx(run["x"][-1], abs=1e-5)


def test_start_values_that_follow_from_inputs_and_time_hold_for_those_alone(tmp_path: Path) -> None:
    """A speed is fixed, so the angle follows from the load: c phi = tau + jump - d w; that of any other load is not known."""

    class Loaded(gl.Component):
        c, d = gl.Parameter("N.m/rad", default=10.0), gl.Parameter("N.m.s/rad", default=2.0)
        least, jump = gl.Parameter("N.m", default=2.0), gl.Parameter("N.m", default=7.0)
        tau = gl.Input("N.m")
        phi, w, more = gl.Variable("rad"), gl.Variable("rad/s", start=0.5), gl.Variable("N.m")
        second = gl.Parameter("s", default=1.0)

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.phi), self.w),
                gl.Eq(self.d * self.w, self.tau + self.more + self.jump * gl.sin(gl.time / self.second) - self.c * self.phi),
                gl.Eq(self.more, gl.Piecewise((self.jump, self.tau > self.least), (0.0, True))),
            ]

    class Both(gl.Component):
        def assemble(self) -> list[Any]:
            self.loaded = Loaded()
            self.body, self.torque = gp.Inertia(J=1.0), gp.Torque()
            return [gl.connect(self.torque.flange, self.body.flange_a)]

    (tmp_path / "content").mkdir()
    path = gl.compile(Both(), outputs=["loaded.w", "body.w"]).export_fmu(
        tmp_path / "loaded.fmu", inputs={"loaded.tau": 3.0, "torque.tau": 0.0}
    )
    one = FmuInstance(path, tmp_path / "content")
    kinds = {v.name: v.variability for v in one.description.modelVariables}
    names = [f"loaded.{n}" for n in ("c", "d", "least", "jump", "second")]
    assert [kinds[n] for n in names] == ["constant"] * 5
    one.begin(**{"loaded.tau": 3.0})
    assert one.get("loaded.phi", "loaded.w") == pytest.approx([(3.0 + 7.0 - 2.0 * 0.5) / 10.0, 0.5], rel=1e-9)
    one.fmu.reset()
    with pytest.raises(FMICallException):
        one.begin(**{"loaded.tau": 1.0})
    assert "start values were computed with loaded.tau = 3" in one.messages[-1]
    one.fmu.reset()
    with pytest.raises(FMICallException):
        one.fmu.enterInitializationMode(startTime=0.5)
    assert "start values were computed for a start at t = 0 s" in one.messages[-1]
    one.close()


class Sampling(gl.Component):
    """Counts the instants of a sampler; its period follows from its rate."""

    rate = gl.Parameter("Hz", "instants per second", default=10.0)
    count = gl.Parameter("1", "what an instant counts", default=1.0)
    x = gl.Variable("1", "a clock", start=0.0)
    n = gl.Discrete("instants so far")

    def equations(self) -> Any:
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.When(gl.sample(1 / self.rate), gl.Eq(self.n, gl.pre(self.n) + self.count)),
        ]


def test_the_period_of_a_sampler_is_set_before_a_run_only(tmp_path: Path) -> None:
    """Which instant is the last one would be another question with each period; what an instant does may change."""
    path = gl.compile(Sampling(), outputs=["n"]).export_fmu(tmp_path / "sampling.fmu")
    one = FmuInstance(path, tmp_path / "content")
    kinds = {v.name: v.variability for v in one.description.modelVariables}
    assert (kinds["rate"], kinds["count"]) == ("fixed", "tunable")
    one.begin(rate=4.0)
    one.go(1.1)
    assert one.get("n") == [5.0]
    with pytest.raises(FMICallException):
        one.set({"rate": 7.0})
    assert "rate cannot be set during a run: instants repeat with it; set it before the start" in one.messages[-1]
    one.set({"rate": 4.0, "count": 10.0})
    one.go(0.5)
    assert one.get("n") == [25.0]
    one.fmu.reset()
    one.t = 0.0
    one.begin(rate=7.0)
    one.go(1.1)
    assert one.get("n") == [8.0]
    one.close()
