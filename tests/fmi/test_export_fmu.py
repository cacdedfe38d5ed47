"""FMUs as FMPy sees them: valid, and the same motion as gearlib's own, in co-simulation and in model exchange."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from ctypes import byref, c_char, c_double, c_size_t, c_ubyte, c_void_p
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from tests.benchmarks.scenes import Chain
from tests.fmi.fmu_instance import FmuInstance
from tests.gearparts import msl_hybrid_examples
from tests.gearparts.planetary.test_planetary_levels import LEVELS, driven
from tests.test_acceptance import RigidLoop

TOGETHER = 1e-6  # s: events that lie closer are one


@dataclass(frozen=True)
class Case:
    make: Callable[[], gl.Component]
    t_end: float
    outputs: tuple[str, ...] | None = None
    samples: int = 201
    events: bool = False


CASES = {
    "xp": Case(lambda: gp.ZhouCui2022(tau_in=100.0), 0.05),
    "backlash": Case(msl_hybrid_examples.Backlash, 0.5, events=True),
    "clutch_shift": Case(msl_hybrid_examples.SimpleGearShift, 3.0, events=True),
    "lossy_planetary": Case(lambda: driven(**LEVELS["lossy"]), 0.2),
    "long_chain": Case(lambda: Chain(N=30), 0.02, ("body[29].w", "body[0].w")),
}


@dataclass
class Exported:
    """An FMU with the system that it was made of."""

    system: gl.System
    path: Path
    events: list[float] = field(default_factory=list)

    def simulate(self, kind: str, t_end: float, samples: int, **options: Any) -> Any:
        """Simulate by FMPy, with events noted."""
        self.events, errors = [], []

        def log(*arguments: Any) -> None:
            status, text = arguments[-3], arguments[-1].decode()
            if text.startswith("event at t = "):
                self.events.append(float(text.split()[4]))
            elif status > 1:
                errors.append(text)

        options = {"relative_tolerance": 1e-11, "stop_time": t_end, "output_interval": t_end / (samples - 1)} | options
        if kind == "ModelExchange":
            options["solver"] = "CVode"
        found = fmpy.simulate_fmu(str(self.path), fmi_type=kind, logger=log, debug_logging=True, **options)
        assert errors == []
        return found


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Exported]:
    """Each FMU is made once."""
    known: dict[tuple[str, str], Exported] = {}
    systems: dict[str, gl.System] = {}

    def make(name: str, version: str = "3.0") -> Exported:
        if name not in systems:
            systems[name] = gl.compile(CASES[name].make(), CASES[name].outputs)
        if (name, version) not in known:
            path = tmp_path_factory.mktemp(name) / f"{name}.fmu"
            known[name, version] = Exported(systems[name], systems[name].export_fmu(path, version=version))
        return known[name, version]

    return make


def instants(times: list[float]) -> list[float]:
    """Events that lie close together count once."""
    found: list[float] = []
    for t in sorted(times):
        if not found or t - found[-1] > TOGETHER:
            found.append(t)
    return found


MADE = [*((name, "3.0") for name in CASES), ("clutch_shift", "2.0")]


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize(("name", "version"), MADE)
def test_fmu_moves_as_the_system_does(name: str, version: str, kind: str, export: Callable[..., Exported]) -> None:
    case, fmu = CASES[name], export(name, version)
    names = case.outputs or fmu.system.states
    expected = fmu.system.simulate(case.t_end, samples=case.samples, rtol=1e-12, method="rk")
    found = fmu.simulate(kind, case.t_end, case.samples, output=list(names))
    accuracy = 1e-6 if kind == "CoSimulation" else 1e-5
    for column in names:
        values = np.interp(expected.time, found["time"], found[column])
        np.testing.assert_allclose(
            values, expected[column], rtol=0, atol=accuracy * np.abs(expected[column]).max(), err_msg=column
        )
    here, there = instants(fmu.events), instants([t for t, _ in expected.events])
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-6)
    assert bool(here) == case.events


@pytest.mark.parametrize(("name", "version"), MADE)
def test_fmu_is_valid(name: str, version: str, export: Callable[..., Exported]) -> None:
    assert validate_fmu(str(export(name, version).path)) == []


@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_description_tells_units_bounds_and_dependencies(version: str, export: Callable[..., Exported]) -> None:
    """As FMPy reads it: display units with their factors, and what each derivative depends on as the linear model has it."""
    fmu = export("xp", version)
    found = fmpy.read_model_description(str(fmu.path))
    known = {v.name: v for v in found.modelVariables}
    units = {u.name: u for u in found.unitDefinitions}
    (displayed,) = (d for d in units["rad/s"].displayUnits if d.name == "rev/min")
    assert displayed.factor == pytest.approx(60.0 / (2.0 * np.pi))
    base = units["kg.m2"].baseUnit
    assert (base.kg, base.m, base.s) == (1, 2, 0)
    inertia = known["I_h"]
    assert (inertia.unit, float(inertia.min), inertia.variability, inertia.causality) == ("kg.m2", 0.0, "tunable", "parameter")
    assert inertia.description == type(fmu.system.translation.component).I_h.description != ""
    speeds = [v for v in known.values() if v.unit == "rad/s"]
    assert speeds
    assert {v.displayUnit for v in speeds} == {"rev/min"}
    assert all(
        float(known[name].start) == 0.0 or known[name].start for name in fmu.system.states if known[name].initial == "exact"
    )
    unknowns = {u.variable.name for u in found.initialUnknowns}
    assert {v.variable.name for v in found.derivatives} <= unknowns
    assert not any("event_indicators" in name for name in unknowns)

    states = list(fmu.system.states)
    model = fmu.system.linearize(sparse=True)
    order = [model.states.index(name) for name in states]
    A = np.asarray(model.A)[np.ix_(order, order)]
    told = 0
    for derivative in found.derivatives:
        row = next(k for k, name in enumerate(states) if known[name] is derivative.variable.derivative)
        names = {v.name for v in derivative.dependencies}
        assert {states[k] for k in np.flatnonzero(A[row])} <= names, derivative.variable.name
        told += len(names)
    assert told < len(states) ** 2, "not simply all of them"


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_outputs_that_follow_events_do_not_claim_to_depend_on_nothing(version: str, tmp_path: Path) -> None:
    """An input turns them through a condition; what no event reaches names what it is computed from."""

    class Switched(gl.Component):
        u, v, second = gl.Input("1"), gl.Input("1"), gl.Parameter("s", default=1.0)
        x, on, twice, held, turned, summed = gl.Variable("1", start=0.0), *(gl.Variable("1") for _ in range(5))
        loop_a, loop_b, mode = gl.Variable("1"), gl.Variable("1"), gl.Discrete()

        def equations(self) -> list[Any]:
            return [
                gl.Eq(self.second * gl.der(self.x), self.v - self.x),
                gl.Eq(self.on, gl.Piecewise((1.0, self.u > 0.5), (0.0, True))),
                gl.Eq(self.twice, 2 * self.on),
                gl.Eq(self.mode, self.u > 0.2),
                gl.Eq(self.held, 3.0 * self.mode),
                gl.Eq(self.turned, gl.Piecewise((self.x, self.u > 0.5), (-self.x, True))),
                gl.Eq(self.summed, self.x + self.v),
                gl.Eq(self.loop_a + self.loop_b, self.twice),
                gl.Eq(self.loop_a - 2 * self.loop_b, self.x),
            ]

    outputs = ["on", "twice", "held", "turned", "summed", "mode", "loop_a"]
    path = gl.compile(Switched(), outputs=outputs).export_fmu(tmp_path / "switched.fmu", version=version)
    found = {
        o.variable.name: None if o.dependencies is None else {d.name for d in o.dependencies}
        for o in fmpy.read_model_description(str(path)).outputs
    }
    assert found == {**dict.fromkeys(outputs), "summed": {"x", "v"}}


def test_archive_holds_no_python(export: Callable[..., Exported]) -> None:
    with zipfile.ZipFile(export("xp").path) as archive:
        names = archive.namelist()
    assert [n for n in names if n.endswith(".py")] == []
    assert "modelDescription.xml" in names
    assert sum(n.startswith("binaries/") for n in names) == 1


def test_same_model_gives_the_same_bytes(export: Callable[..., Exported], tmp_path: Path) -> None:
    first = export("xp")
    again = gl.compile(CASES["xp"].make()).export_fmu(tmp_path / "xp.fmu")
    assert again.read_bytes() == first.path.read_bytes()


# ---------------------------------------------------------------- the interface itself


@pytest.fixture
def slave(export: Callable[..., Exported], tmp_path: Path) -> Any:
    made: list[FmuInstance] = []

    def make(name: str, kind: str = "cs") -> FmuInstance:
        made.append(FmuInstance(export(name).path, tmp_path, kind))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.parametrize("serialised", [False, True])
def test_memory_is_restored_in_the_middle(
    serialised: bool, slave: Callable[..., FmuInstance], export: Callable[..., Exported]
) -> None:
    names = export("backlash").system.states
    one = slave("backlash")
    one.begin()
    one.go(0.1, 10)
    memory, t = one.fmu.getFMUState(), one.t
    one.go(0.2, 20)
    first = one.get(*names)
    other = one
    if serialised:
        content = one.fmu.serializeFMUState(memory)
        other = slave("backlash")
        other.begin()
        memory = other.fmu.deserializeFMUState(content)
    other.fmu.setFMUState(memory)
    other.t = t
    other.go(0.2, 20)
    assert other.get(*names) == first
    other.fmu.freeFMUState(memory)


def test_memory_is_restored_in_model_exchange(slave: Callable[..., FmuInstance], export: Callable[..., Exported]) -> None:
    """Time, states, parameters and what was computed from them: the derivatives are what they were."""
    names = export("backlash").system.states
    one, n = slave("backlash", "me"), len(names)
    one.begin()
    values = (c_double * n)()

    def rates(t: float, shift: float) -> list[float]:
        one.fmu.setTime(t)
        values[:] = [shift + 0.1 * k for k in range(n)]
        one.fmu.setContinuousStates(values, n)
        one.fmu.getContinuousStateDerivatives(values, n)
        return list(values)

    first = rates(0.1, 0.01)
    memory = one.fmu.getFMUState()
    one.set({"inertia2.J": 7.0})
    assert rates(0.2, -0.5) != first
    one.fmu.setFMUState(memory)
    one.fmu.getContinuousStateDerivatives(values, n)
    assert list(values) == first
    assert one.get("inertia2.J", "time") == [export("backlash").system.parameters["inertia2.J"], 0.1]
    one.fmu.freeFMUState(memory)


def instantiated(path: Path, folder: Path, kind: str) -> tuple[Any, Any, list[str]]:
    """An FMU of either version, its description, and the list of its messages."""
    description, content = fmpy.read_model_description(str(path)), fmpy.extract(str(path), str(folder))
    told: list[str] = []
    fmu = fmpy.instantiate_fmu(content, description, kind, logger=lambda *a: told.append(a[-1].decode()))
    return fmu, description, told


def initialised(path: Path, folder: Path, kind: str, start: float = 0.0) -> tuple[Any, Any, list[str]]:
    """The same, ready to begin at a time."""
    fmu, description, told = instantiated(path, folder, kind)
    if description.fmiVersion == "2.0":
        fmu.setupExperiment(startTime=start)
        fmu.enterInitializationMode()
    else:
        fmu.enterInitializationMode(startTime=start)
    fmu.exitInitializationMode()
    return fmu, description, told


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_arrays_of_another_length_are_refused_by_number(version: str, export: Callable[..., Exported], tmp_path: Path) -> None:
    path = export("clutch_shift", version).path
    fmu, description, told = initialised(path, tmp_path, "ModelExchange")
    first = version[0]
    state, derivatives, des = {"2": ("FMUstate", "Derivatives", "DeS"), "3": ("FMUState", "ContinuousStateDerivatives", "Des")}[
        first
    ]

    def call(name: str, *given: Any) -> None:
        getattr(fmu, f"fmi{first}{name}")(fmu.component, *given)

    def refused(message: str, name: str, *given: Any) -> None:
        with pytest.raises(fmpy.fmi1.FMICallException):
            call(name, *given)
        assert told[-1] == message

    n, z = description.numberOfContinuousStates, description.numberOfEventIndicators
    values = (c_double * (n + z + 1))()
    for name in (f"Get{derivatives}", *(f"{k}ContinuousStates" for k in ("Get", "Set", "GetNominalsOf"))):
        refused(f"the model has {n} states, not {n + 1}", name, values, n + 1)
    refused(f"the model has {z} event indicators, not {z - 1}", "GetEventIndicators", values, z - 1)

    memory, again, size = c_void_p(), c_void_p(), c_size_t()
    call(f"Get{state}", byref(memory))
    call(f"Serialized{state}Size", memory, byref(size))
    needed, more = size.value, size.value + 100
    content = ((c_char if first == "2" else c_ubyte) * more)()
    refused(
        f"a serialized state takes {needed} bytes; there is room for {needed - 1}",
        f"Serialize{state}",
        memory,
        content,
        needed - 1,
    )
    call(f"Serialize{state}", memory, content, more)
    call(f"{des}erialize{state}", content, more, byref(again))
    text = f"these 10 bytes are no serialized state of this FMU, which takes {needed}"
    refused(text, f"{des}erialize{state}", content, 10, byref(c_void_p()))
    for each in (memory, again):
        call(f"Free{state}", byref(each))
    fmu.terminate()
    fmu.freeInstance()


def test_hundred_instances_do_not_know_each_other(slave: Callable[..., FmuInstance], export: Callable[..., Exported]) -> None:
    system = export("xp").system
    every = [slave("xp") for _ in range(100)]
    for k, one in enumerate(every):
        one.begin(I_h=0.2 * (1 + k))
    for _ in range(2):
        for one in every:
            one.go(0.005)
    for k in (0, 37, 99):
        expected = system.simulate(0.01, samples=2, rtol=1e-11, method="rk", parameters={"I_h": 0.2 * (1 + k)})
        found = every[k].get(*system.states)
        for name, value in zip(system.states, found, strict=True):
            assert value == pytest.approx(expected[name][-1], rel=1e-7, abs=1e-12), name


@pytest.mark.parametrize("kind", ["me", "cs"])
def test_directional_derivatives_are_those_of_the_linear_model(
    kind: str, slave: Callable[..., FmuInstance], export: Callable[..., Exported]
) -> None:
    system = export("xp").system
    model = system.linearize(sparse=True)
    one = slave("xp", kind)
    one.begin()
    rates = [one.references[f"der({n})"] for n in system.states]
    states = [one.references[n] for n in system.states]
    order = [model.states.index(n) for n in system.states]
    A = np.asarray(model.A if isinstance(model.A, np.ndarray) else model.A.toarray())[np.ix_(order, order)]
    seed = np.arange(1.0, len(states) + 1)
    found = one.fmu.getDirectionalDerivative(rates, states, seed.tolist())
    np.testing.assert_allclose(found, A @ seed, rtol=1e-10, atol=1e-10 * np.abs(A).max())
    found = one.fmu.getAdjointDerivative(rates, states, seed.tolist())
    np.testing.assert_allclose(found, A.T @ seed, rtol=1e-10, atol=1e-10 * np.abs(A).max())


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_derivatives_are_those_by_states_and_inputs(version: str, tmp_path: Path) -> None:
    """By hand: a state's own is 1, that of its negative -1; none by parameters and time, and none of event indicators."""

    class Lag(gl.Component):
        T, limit = gl.Parameter("s", default=0.25), gl.Parameter("1", default=2.0)
        u, x, y, z = gl.Input("1"), gl.Variable("1", start=1.0), gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[Any]:
            over = gl.Piecewise((1.0, self.x > self.limit), (0.0, True))
            return [
                gl.Eq(self.T * gl.der(self.x), self.u - self.x - over), gl.Eq(self.y, -self.x), gl.Eq(self.z, 3 * self.u + self.x),
            ]  # fmt: skip

    path = gl.compile(Lag(), outputs=["x", "y", "z"]).export_fmu(tmp_path / "lag.fmu", version=version)
    fmu, description, told = initialised(path, tmp_path / "content", "CoSimulation")
    at = {v.name: v.valueReference for v in description.modelVariables}
    unknown, known = [at[n] for n in ("x", "der(x)", "y", "z")], [at["x"], at["u"]]
    by_hand = np.array([[1.0, 0.0], [-4.0, 4.0], [-1.0, 0.0], [1.0, 3.0]])
    for seed in ([1.0, 0.0], [0.0, 1.0], [2.0, -3.0]):
        np.testing.assert_allclose(fmu.getDirectionalDerivative(unknown, known, seed), by_hand @ seed, rtol=1e-12)
    if version == "3.0":
        for weights in np.eye(4):
            found = fmu.getAdjointDerivative(unknown, known, weights.tolist(), nSensitivity=2)
            np.testing.assert_allclose(found, weights @ by_hand, rtol=1e-12)
    for others, said in (([at["T"]], "by states and inputs"), ([0], "by states and inputs")):
        with pytest.raises(fmpy.fmi1.FMICallException):
            fmu.getDirectionalDerivative(unknown, others, [1.0])
        assert said in told[-1]
    if version == "3.0":
        with pytest.raises(fmpy.fmi1.FMICallException):
            fmu.getDirectionalDerivative([at["event_indicators[0]"]], known, [1.0, 1.0])
        assert "event indicators have no derivatives" in told[-1]
    fmu.terminate()
    fmu.freeInstance()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_step_begins_where_the_last_one_ended(version: str, tmp_path: Path) -> None:
    """A step that is to be repeated needs the saved state; without it, it is refused. A reset forgets the start time."""

    class Clock(gl.Component):
        forth, x = gl.Structural(True), gl.Variable("s", start=0.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), 1.0 if self.forth else -1.0)]

    one, another = (
        gl.compile(Clock(forth=forth)).export_fmu(tmp_path / f"{name}.fmu", version=version)
        for name, forth in (("one", True), ("other", False))
    )
    other = instantiated(another, tmp_path / "other", "CoSimulation")[0]
    fmu, description, told = initialised(
        one, tmp_path / "one", "CoSimulation", start=1.0
    )  # FMPy keeps the last logger of FMI 2
    x = [next(v.valueReference for v in description.modelVariables if v.name == "x")]
    get, suffix = (fmu.getReal, "state") if version == "2.0" else (fmu.getFloat64, "State")
    memory = getattr(fmu, f"getFMU{suffix}")()
    fmu.doStep(1.0, 0.25)
    for t in (1.0, 1.5, 0.0):
        with pytest.raises(fmpy.fmi1.FMICallException):
            fmu.doStep(t, 0.25)
        assert "but the last one ended at 1.25 s" in told[-1]
    assert get(x) == pytest.approx([0.25], rel=1e-12)
    content = getattr(fmu, f"serializeFMU{suffix}")(memory)
    with pytest.raises(fmpy.fmi1.FMICallException):
        getattr(other, f"de{'S' if version == '2.0' else 's'}erializeFMU{suffix}")(content)
    getattr(fmu, f"setFMU{suffix}")(memory)
    fmu.doStep(1.0, 0.5)
    assert get(x) == pytest.approx([0.5], rel=1e-12)
    fmu.reset()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, 0.25)
    assert get(x) == pytest.approx([0.25], rel=1e-12)
    for each in (fmu, other):
        each.freeInstance()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_what_falls_below_its_least_value_is_refused_as_in_a_run(version: str, kind: str, tmp_path: Path) -> None:
    """A tank that runs empty, started with 0.5: at the start where it is given less than nothing, later where it has run out."""

    class Tank(gl.Component):
        x, empty, second = gl.Variable("m", start=0.5), gl.Variable("m"), gl.Parameter("s", default=1.0)
        level, speed = gl.Variable("m", "level", min=0), gl.Parameter("m/s", default=0.4)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), -self.speed), gl.Eq(self.level, -self.empty), gl.Eq(self.empty, -2 * self.x)]

    path = gl.compile(Tank(), outputs=["x"]).export_fmu(tmp_path / "tank.fmu", version=version)
    told: list[str] = []

    def until(stop_time: float, **start: float) -> float:
        options: dict[str, Any] = {"start_values": start, "logger": lambda *a: told.append(a[-1].decode()), "solver": "CVode"}
        return float(fmpy.simulate_fmu(str(path), fmi_type=kind, stop_time=stop_time, output_interval=0.1, **options)["x"][-1])

    assert until(1.2) == pytest.approx(0.5 - 0.4 * 1.2)
    assert until(1.5, x=0.6) == pytest.approx(0.0, abs=1e-6)
    assert told == []
    for stop_time, start, said in ((1.0, -1e-3, "-0.002 at t = 0 s"), (2.0, 0.5, "-0.04 at t = 1.3 s")):
        with pytest.raises(Exception, match="failed with status"):
            until(stop_time, x=start)
        assert re.match(r"level is -\S+ at t = \S+ s, but it cannot be below 0$", told[-1]), told
        assert kind == "ModelExchange" or said in told[-1]


@pytest.mark.parametrize("stop_time", [1.0, 1e6, 1e10])
def test_events_are_as_sharp_in_a_run_without_an_end(stop_time: float, tmp_path: Path) -> None:
    """By hand: x' is 1 up to just behind a communication point, then 3. Importers give huge stop times where they know of no end."""

    class Faster(gl.Component):
        x, second = gl.Variable("1", start=0.0), gl.Parameter("s", default=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(self.second * gl.der(self.x), gl.Piecewise((1.0, self.x < 0.3000005), (3.0, True)))]

    (tmp_path / "content").mkdir()
    one = FmuInstance(gl.compile(Faster()).export_fmu(tmp_path / "faster.fmu"), tmp_path / "content")
    one.fmu.enterInitializationMode(tolerance=1e-8, startTime=0.0, stopTime=stop_time)
    one.fmu.exitInitializationMode()
    one.go(1.0, 10)
    assert one.get("x") == pytest.approx([0.3000005 + 3 * 0.6999995], rel=1e-10)
    one.close()


def test_a_freewheel_that_is_overtaken_is_refused_where_its_fmu_begins(tmp_path: Path) -> None:
    class Overtaken(gl.Component):
        def assemble(self) -> list[Any]:
            self.fast, self.slow = gp.Inertia(J=1.0, start={"w": 1.0}), gp.Inertia(J=1.0, start={"w": 0.0})
            self.freewheel = gp.OneWayClutch(fn_max=100.0, f_normalized=0.0)
            return [
                gl.connect(self.fast.flange_b, self.freewheel.flange_a),
                gl.connect(self.freewheel.flange_b, self.slow.flange_a),
            ]

    (tmp_path / "content").mkdir()
    one = FmuInstance(gl.compile(Overtaken()).export_fmu(tmp_path / "overtaken.fmu"), tmp_path / "content")
    with pytest.raises(fmpy.fmi1.FMICallException):
        one.begin()
    assert one.messages == ["freewheel.w_rel is -1 at t = 0 s, but it cannot be below 0"]
    one.fmu.reset()
    one.begin(**{"fast.w": -1.0})
    one.go(0.1)
    assert one.get("fast.w", "slow.w") == pytest.approx([-1.0, 0.0])
    one.close()


class Shrinking(gl.Component):
    """A condition that compares a huge number before 0.5 s, and one of size one afterwards; it comes true at 0.7 s."""

    x = gl.Variable("s", "clock")
    late = gl.Discrete("after 0.5 s")
    true = gl.Discrete("after 0.7 s")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.Eq(self.late, self.x > 0.5),
            gl.Eq(self.true, 1e9 * (self.late - 1) + self.late * (self.x - 0.7) > 0),
        ]


def test_an_event_function_that_becomes_smaller_at_an_event_is_located_as_sharply_as_one_that_was_small(tmp_path: Path) -> None:
    """The hysteresis goes by the size of the function since the last event, not by its size before."""
    system = gl.compile(Shrinking(), outputs=["true"])
    fmu = Exported(system, system.export_fmu(tmp_path / "shrinking.fmu"))
    found = fmu.simulate("ModelExchange", 1.0, 11, output=["true"])
    assert found["true"][-1] == 1.0
    assert fmu.events == pytest.approx([0.5, 0.7], abs=1e-6)


class Counting(gl.Component):
    """x' is the number of instants so far."""

    period = gl.Parameter("s", default=0.1)
    x, n = gl.Variable("1", start=0.0), gl.Discrete("instants so far")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.n),
            gl.When(gl.sample(self.period, self.period), gl.Eq(self.n, gl.pre(self.n) + 1)),
        ]


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize(("period", "steps"), [(0.05, 100), (0.05, 20), (0.07, 100)])
def test_instants_are_those_of_the_importing_tool_up_to_rounding(
    version: str, period: float, steps: int, tmp_path: Path
) -> None:
    """Three times 0.05 s is a rounding later than 15 times 0.01 s."""
    system = gl.compile(Counting(), outputs=["x", "n"])
    fmu = Exported(system, system.export_fmu(tmp_path / "counting.fmu", version=version))
    found = fmu.simulate("CoSimulation", 1.0, steps + 1, output=["x", "n"], start_values={"period": period})
    instants = period * np.arange(1, int(1.0 / period + 1e-9) + 1)
    np.testing.assert_array_equal(found["n"], [np.sum(instants < t + 1e-9) for t in found["time"]])
    np.testing.assert_allclose(found["x"], [np.maximum(t - instants, 0.0).sum() for t in found["time"]], atol=1e-9)


def test_the_token_is_of_128_bits_and_tells_models_apart(tmp_path: Path) -> None:
    tokens = set()
    for J, version in ((1.0, "3.0"), (2.0, "3.0"), (1.0, "2.0")):
        system = gl.compile(gp.Inertia(J=J))
        twice = [
            fmpy.read_model_description(str(system.export_fmu(tmp_path / "m.fmu", version=version))).guid for _ in range(2)
        ]
        assert twice[0] == twice[1]
        assert re.fullmatch(r"\{[0-9a-f]{32}\}", twice[0])
        tokens.add(twice[0])
    assert len(tokens) == 3


def test_inputs_follow_slopes_in_fmi_2(tmp_path: Path) -> None:
    """A torque that rises by 5 N.m/s on 2 kg.m2: the speed is 1.25 t^2 only if the input moves within the steps."""
    from fmpy.fmi2 import FMU2Slave

    class Pushed(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
            return [gl.connect(self.torque.flange, self.load.flange_a)]

    path = gl.compile(Pushed(), outputs=["load.w"]).export_fmu(tmp_path / "pushed.fmu", version="2.0")
    description = fmpy.read_model_description(str(path))
    place = {v.name: v.valueReference for v in description.modelVariables}
    fmpy.extract(str(path), str(tmp_path / "content"))
    one = FMU2Slave(
        guid=description.guid, unzipDirectory=str(tmp_path / "content"), instanceName="one",
        modelIdentifier=description.coSimulation.modelIdentifier,
    )  # fmt: skip
    one.instantiate()
    one.setupExperiment(tolerance=1e-9, startTime=0.0)
    one.enterInitializationMode()
    one.exitInitializationMode()
    for k in range(4):
        one.setReal([place["torque.tau"]], [5.0 * 0.25 * k])
        one.setRealInputDerivatives([place["torque.tau"]], [1], [5.0])
        one.doStep(0.25 * k, 0.25)
    assert one.getReal([place["load.w"], place["torque.tau"]]) == pytest.approx([1.25, 5.0], rel=1e-12)
    one.terminate()
    one.freeInstance()


class Lagging(gl.Component):
    """A first-order lag of its input, and when the input has become larger than one."""

    u = gl.Input("any")
    x = gl.Variable("any", start=0.0)
    over = gl.Discrete("whether the input is larger than 1")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.u - self.x), gl.Eq(self.over, self.u > 1.0)]


def test_inputs_move_within_the_steps_of_fmi_3(tmp_path: Path) -> None:
    """Intermediate update: the input is 2 sin(3 t) at each evaluation, and the steps are longer than its half waves."""
    path = gl.compile(Lagging(), outputs=["x", "over"]).export_fmu(tmp_path / "lagging.fmu")
    assert validate_fmu(str(path)) == []
    one = FmuInstance(path, tmp_path / "content", moving={"u": lambda t: 2.0 * np.sin(3.0 * t)})
    one.begin()
    for k in range(3):
        one.go(1.5)
        t = 1.5 * (k + 1)
        exact = (np.sin(3 * t) - 3 * np.cos(3 * t) + 3 * np.exp(-t)) / 5
        assert one.get("x", "u", "over") == pytest.approx([exact, 2 * np.sin(3 * t), float(2 * np.sin(3 * t) > 1.0)], abs=1e-8)
    events = [float(text.split()[4]) for text in one.messages if text.startswith("event at t = ")]
    crossings = sorted(
        [*(np.pi / 18 + 2 * np.pi * k / 3 for k in range(3)), *(5 * np.pi / 18 + 2 * np.pi * k / 3 for k in range(2))]
    )
    assert events == pytest.approx(crossings, abs=1e-7)
    one.moving = {"x": lambda t: 1.0}
    one.go(0.1)
    assert "only inputs can be set within a step" in one.messages[-1]
    one.close()


def test_only_inputs_are_taken_for_variables_that_move_within_steps(tmp_path: Path) -> None:
    path = gl.compile(Lagging(), outputs=["x"]).export_fmu(tmp_path / "lagging.fmu")
    with pytest.raises(Exception, match="Failed to instantiate FMU"):
        FmuInstance(path, tmp_path / "content", moving={"x": lambda t: 1.0})


# ---------------------------------------------------------------- what cannot be


class Driven(gl.Component):
    def assemble(self) -> list[Any]:
        self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
        return [gl.connect(self.torque.flange, self.load.flange_a)]


class Governed(Driven):
    def assemble(self) -> list[Any]:
        links = super().assemble()
        self.governor = gl.Sampled(lambda t, v: -v[0], 0.1, inputs=[self.load.w], outputs=[self.torque.tau])
        return links


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"inputs": {"torque.tau": lambda t: t}}, "torque.tau is .*an FMU holds no Python"),
        ({"inputs": {"torque.tau": gl.Table([0, 1], [0, 1])}}, "torque.tau is .*an FMU holds no Python and no table"),
        ({"inputs": ["torque.tou"]}, "no unbound input 'torque.tou'; .*torque.tau"),
        ({"outputs": ["torque.tau"]}, "torque.tau is an input of the FMU"),
        ({"outputs": ["load.v"]}, "no output 'load.v'"),
        ({"version": "1.0"}, "expected '3.0', '2.0'"),
        ({"kind": ["se"]}, "expected 'me', 'cs'"),
        ({"kind": []}, "kind is empty"),
        ({"platforms": ["x86_64-beos"]}, "no platform 'x86_64-beos'"),
        ({"stop_time": -1.0}, "stop_time is -1"),
        ({"rtol": 2.0}, "rtol is 2"),
    ],
)
def test_bad_arguments_are_refused_by_name(options: dict[str, Any], text: str, tmp_path: Path) -> None:
    with pytest.raises(gl.GearlibError, match=text):
        gl.compile(Driven()).export_fmu(tmp_path / "driven.fmu", **options)
    assert list(tmp_path.iterdir()) == []


def test_sampled_controllers_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(gl.GearlibError, match=r"an FMU needs equations, and governor is a Python function \(gl.Sampled\)"):
        gl.compile(Governed()).export_fmu(tmp_path / "governed.fmu")


def test_too_many_equations_to_factorise_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.fmi.exported_model.MOST_DENSE", 1)
    with pytest.raises(ArgumentError, match=r"RigidLoop: \d+ equations are solved together, and an FMU factorises 1 at most"):
        gl.compile(RigidLoop()).export_fmu(tmp_path / "loop.fmu")
    assert not list(tmp_path.iterdir())


def test_a_missing_compiler_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gearlib.fmi import binaries

    monkeypatch.setattr(binaries.shutil, "which", lambda name: None)
    monkeypatch.setattr(binaries, "find_spec", lambda name: None)
    with pytest.raises(gl.errors.MissingPackageError, match="pip install ziglang"):
        gl.compile(Driven()).export_fmu(tmp_path / "driven.fmu")


def test_an_fmu_has_a_name_that_tools_know(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"name the file \.\.\.\.fmu"):
        gl.compile(CASES["backlash"].make()).export_fmu(tmp_path / "nonsense")
    assert not list(tmp_path.iterdir())


class RestsAtZero(gl.Component):
    """A signal that falls to zero at 0.5 s and stays there until 0.95 s; x grows twice as fast while it is not above that."""

    x, way, signal = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    on = gl.Discrete("not above zero")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.way), 1.0),
            gl.Eq(self.signal, gl.no_event(gl.Max(0, 1 - 2 * self.way, 2 * self.way - 1.9))),
            gl.Eq(self.on, self.signal <= 0),
            gl.Eq(gl.der(self.x), gl.Piecewise((2.0, gl.holds(self.on)), (1.0, True))),
        ]


@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_what_comes_to_rest_just_at_a_limit_has_reached_it(version: str, kind: str, tmp_path: Path) -> None:
    path = gl.compile(RestsAtZero(), outputs=["x"]).export_fmu(tmp_path / "rests.fmu", version=version)
    found = fmpy.simulate_fmu(str(path), fmi_type=kind, stop_time=1.5, output_interval=0.1)["x"][-1]
    assert found == pytest.approx(1.5 + 0.45, abs=1e-5)


class Pulsed(gl.Component):
    """A rate of 1 while a sinusoid of time, with a small state beside it, is above a level; how often that is so."""

    f, second = gl.Parameter("Hz", default=1.0), gl.Parameter("s", default=1.0)
    x, small = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0)
    n = gl.Discrete("number of pulses")

    def equations(self) -> list[Any]:
        above = gl.sin(2 * gl.pi * self.f * gl.time) + self.small > 0.9
        return [
            gl.Eq(self.second * gl.der(self.small), -self.small),
            gl.Eq(self.second * gl.der(self.x), gl.Piecewise((1.0, above), (0.0, True))),
            gl.When(above, gl.Eq(self.n, gl.pre(self.n) + 1)),
        ]


@pytest.mark.parametrize("steps", [1, 8])
def test_no_pulse_of_what_time_drives_is_stepped_over(steps: int, tmp_path: Path) -> None:
    """By hand: each period has one, of 2 arccos(0.9) rad. The frequency is tuned, also between steps; the run is much longer."""
    (tmp_path / "content").mkdir()
    path = gl.compile(Pulsed(), outputs=["x", "n"]).export_fmu(tmp_path / "pulsed.fmu")
    one = FmuInstance(path, tmp_path / "content")
    one.set({"f": 7.0})
    one.fmu.enterInitializationMode(tolerance=1e-6, startTime=0.0, stopTime=100.0)
    one.fmu.exitInitializationMode()
    one.go(4.0, steps)
    assert one.get("n") == [28.0]
    assert one.get("x") == pytest.approx([28 * np.arccos(0.9) / (np.pi * 7.0)], rel=1e-6)
    one.set({"f": 50.0})
    one.go(4.0, steps)
    assert one.get("n") == [228.0]
    assert one.get("x") == pytest.approx([np.arccos(0.9) / np.pi * (28 / 7.0 + 200 / 50.0)], rel=1e-6)
    one.close()


class FromTheStart(gl.Component):
    """x rises at 3 1/s after the time 0, and at 1 1/s up to there."""

    x = gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), gl.Piecewise((3.0, gl.time > 0), (1.0, True)))]


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_comparison_of_time_with_zero_is_one_without_rounding(kind: str, tmp_path: Path) -> None:
    path = gl.compile(FromTheStart()).export_fmu(tmp_path / "start.fmu", stop_time=1.0)
    for start, expected in ((0.0, 3.0), (-0.5, 2.0)):
        found = fmpy.simulate_fmu(str(path), fmi_type=kind, start_time=start, stop_time=start + 1.0, output_interval=0.1)["x"][
            -1
        ]
        assert found == pytest.approx(expected, rel=1e-6)
