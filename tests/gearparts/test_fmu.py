"""An FMU at a shaft: an engine of our own, exported and taken in again."""

from __future__ import annotations

import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.fmi.imported_fmu import ImportedFmu


class Engine(gl.Component):
    """Its torque follows the throttle with a lag, and falls with the speed."""

    lag = gl.Parameter("s", "time constant", default=0.05, min=1e-6)
    w = gl.Input("rad/s", "speed of the shaft")
    throttle = gl.Input("1", "0 to 1")
    tau = gl.Variable("N.m", "torque on the shaft", start=0.0)
    power = gl.Variable("W", "power to the shaft")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.lag * gl.der(self.tau), 100.0 * self.throttle - 0.5 * self.w - self.tau),
            gl.Eq(self.power, self.tau * self.w),
        ]


class Whole(gl.Component):
    """The same engine, compiled into the train."""

    def assemble(self) -> list[Any]:
        self.engine, self.torque, self.sensor = Engine(lag=0.03), gp.Torque(), gp.SpeedSensor()
        self.flywheel, self.shaft, self.load = gp.Inertia(J=0.3), gp.SpringDamper(c=2e3, d=5.0), gp.Inertia(J=1.0)
        return [
            gl.connect(self.engine.tau, self.torque.tau),
            gl.connect(self.sensor.w, self.engine.w),
            gl.connect(self.torque.flange, self.sensor.flange, self.flywheel.flange_a),
            gl.connect(self.flywheel.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]


class Coupled(gl.Component):
    path = gl.Structural("", "of the engine")
    period = gl.Structural(1e-3, "s")

    def assemble(self) -> list[Any]:
        self.engine = gp.FMU(
            self.path, inputs=["throttle"], outputs=["power"], values={"lag": 0.03}, period=self.period,
        )  # fmt: skip
        self.flywheel, self.shaft, self.load = gp.Inertia(J=0.3), gp.SpringDamper(c=2e3, d=5.0), gp.Inertia(J=1.0)
        return [
            gl.connect(self.engine.flange, self.flywheel.flange_a),
            gl.connect(self.flywheel.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]


@pytest.fixture(scope="module")
def engines(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    system, folder = gl.compile(Engine(), outputs=["tau", "power"]), tmp_path_factory.mktemp("engines")
    return {v: system.export_fmu(folder / f"engine{v[0]}.fmu", version=v, kind="cs", rtol=1e-9) for v in ("2.0", "3.0")}


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_coupled_engine_approaches_the_one_in_the_model(version: str, engines: dict[str, Path]) -> None:
    """The error falls in proportion to the period."""
    whole = gl.simulate(Whole(), 0.4, samples=5, rtol=1e-10, inputs={"engine.throttle": 0.8})
    errors = []
    for period in (4e-3, 2e-3):
        result = gl.simulate(
            Coupled(path=str(engines[version]), period=period), 0.4, samples=5, rtol=1e-8, inputs={"engine.signals[0].u": 0.8}
        )
        errors.append(float(np.abs(result["load.w"] - whole["load.w"]).max()))
        taken = result["engine.taken[0].y"][-1]
        assert taken == pytest.approx(result["engine.source.tau"][-1] * result["flywheel.w"][-1], rel=2e-2)
    assert errors[0] < 0.02 * whole["load.w"].max()
    assert errors[1] < 0.6 * errors[0]


def test_without_being_told_it_exchanges_every_millisecond(engines: dict[str, Path]) -> None:
    unit = gp.FMU(engines["3.0"], values={"lag": 0.03})
    assert unit.exchange.period == unit.period == 1e-3


def test_a_second_run_begins_anew_and_copies_do_so_too(engines: dict[str, Path]) -> None:
    system = gl.compile(Coupled(path=str(engines["3.0"]), period=4e-3))
    given = {"engine.signals[0].u": 0.8}
    first = system.simulate(0.04, samples=3, inputs=given)["load.w"]
    assert np.array_equal(system.simulate(0.04, samples=3, inputs=given)["load.w"], first)
    assert np.array_equal(pickle.loads(pickle.dumps(system)).simulate(0.04, samples=3, inputs=given)["load.w"], first)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_each_run_has_its_own_state_of_the_fmu_or_is_refused(version: str, engines: dict[str, Path]) -> None:
    system = gl.compile(Coupled(path=str(engines[version]), period=4e-3), outputs=["load.w"])
    given: Any = {"engine.signals[0].u": 0.8}
    whole = system.simulate(0.08, samples=5, inputs=given)
    later = system.simulate(1.08, t_start=1.0, samples=5, inputs=given)  # after the one before, without a state of it
    assert later["load.w"] == pytest.approx(whole["load.w"], rel=1e-5, abs=1e-9)
    half = system.simulate(0.04, samples=3, inputs=given)
    rest = system.simulate(0.08, samples=3, start=half)
    assert rest["load.w"] == pytest.approx(whole["load.w"][2:], rel=1e-5)
    for start in (half, (whole, 0.04)):
        with pytest.raises(gl.GearlibError, match=r"goes on at 0\.04 s, and engine.*cannot be set back"):
            system.simulate(0.08, samples=3, start=start)
    run = system.stepper(inputs=given)
    run.advance(0.04)
    here = run.state()
    run.advance(0.08)
    assert run["load.w"] == pytest.approx(whole["load.w"][-1], rel=1e-5)
    run.restore(here)
    with pytest.raises(gl.GearlibError, match="cannot be set back"):
        run.advance(0.08)
    one, other = (system.stepper(inputs=given) for _ in range(2))
    one.advance(0.04)
    with pytest.raises(gl.GearlibError, match="cannot be set back"):
        other.advance(0.04)
    one.advance(0.08)
    assert one["load.w"] == pytest.approx(whole["load.w"][-1], rel=1e-5)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"speed": "speed"}, "has no input 'speed' that is a number"),
        ({"torque": "tau_"}, "has no output 'tau_' that is a number; did you mean 'tau'"),
        ({"values": {"lag_": 1.0}}, "has no parameter 'lag_' that is a number; did you mean 'lag'"),
        ({"values": {"lag": "x"}}, "lag of engine3.fmu is 'x'"),
        ({"path": "nowhere.fmu"}, "nowhere.fmu cannot be read: there is no such file"),
        ({"path": __file__}, "is not an FMU"),
        ({"period": 0.0}, "period is 0; expected a positive number of seconds"),
        ({"inputs": "throttle"}, "inputs is 'throttle'; expected a list of names"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(options: dict[str, Any], text: str, engines: dict[str, Path]) -> None:
    with pytest.raises(gl.GearlibError, match=text):
        gp.FMU(**{"path": engines["3.0"], **options})


DESCRIBED = """<fmiModelDescription fmiVersion="2.0" modelName="engine" guid="1">
<CoSimulation modelIdentifier="engine"/>
<UnitDefinitions>{definitions}</UnitDefinitions>
<TypeDefinitions><SimpleType name="Speed"><Real unit="{unit}"/></SimpleType></TypeDefinitions>
<ModelVariables>
<ScalarVariable name="w" valueReference="0" causality="input"><Real {declared} start="0"/></ScalarVariable>
<ScalarVariable name="tau" valueReference="1" causality="output"><Real/></ScalarVariable>
</ModelVariables></fmiModelDescription>"""
TURNS = '<Unit name="turns"><BaseUnit rad="1" s="-1" factor="{}"/></Unit>'


@pytest.mark.parametrize("declared", ['unit="{}"', 'declaredType="Speed"'])
@pytest.mark.parametrize(
    ("unit", "definitions", "fits"),
    [
        ("rad/s", "", True),
        ("turns", "", None),  # not defined: nobody can tell
        ("turns", '<Unit name="turns"/>', None),
        ("turns", TURNS.format("1"), True),
        ("turns", TURNS.format("6.28"), True),  # converted
        ("turns", '<Unit name="turns"><BaseUnit s="-1" factor="0.0167"/></Unit>', False),  # of which angle?
        ("turns", '<Unit name="turns"><BaseUnit s="-1" offset="1"/></Unit>', False),
        ("turns", '<Unit name="turns"><BaseUnit m="1" s="-1"/></Unit>', False),
        ("rpm", "", False),
        ("1/min", "", False),
        ("rev/min", "", False),
        ("1/s", "", True),
        ("N.m", "", False),
        ("Hz", "", False),
        ("Hz", '<Unit name="Hz"><BaseUnit s="-1"/></Unit>', False),
        ("rad/s", '<Unit name="rad/s"><BaseUnit s="-1"/></Unit>', True),
    ],
)
def test_units_of_an_fmu_can_be_those_of_a_shaft_or_are_refused(
    unit: str, definitions: str, fits: bool | None, declared: str, tmp_path: Path
) -> None:
    with zipfile.ZipFile(tmp_path / "engine.fmu", "w") as file:
        text = DESCRIBED.format(unit=unit, definitions=definitions, declared=declared.format(unit))
        file.writestr("modelDescription.xml", text)
    if fits is None:
        with pytest.warns(
            gl.GearlibWarning, match=r"w of engine\.fmu is in turns, which the file does not define; it is taken as rad/s"
        ):
            gp.FMU(tmp_path / "engine.fmu")
    elif fits:
        assert gp.FMU(tmp_path / "engine.fmu").unit.inputs == ["w"]
    else:
        with pytest.raises(ArgumentError, match=rf"w of engine\.fmu is in {unit}; expected rad/s"):
            gp.FMU(tmp_path / "engine.fmu")


IN_TURNS = """<UnitDefinitions>
<Unit name="turns"><BaseUnit rad="1" s="-1" factor="0.5"/></Unit><Unit name="heat"><BaseUnit K="1" factor="4" offset="250"/></Unit>"""


class Heated(gl.Component):
    """Numbers without units in equations: they are what the description says."""

    w = gl.Input("rad/s", "speed of the shaft")
    other = gl.Input("rad/s", "speed of another shaft")
    tau = gl.Variable("N.m", "torque on the shaft")
    T = gl.Variable("K", "temperature")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.tau, 10.0 - 1.0 * self.w - 1.0 * self.other), gl.Eq(self.T, 2.0 * self.other)]


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("relative", [False, True])
def test_numbers_in_other_units_are_converted_by_the_definitions_in_the_file(
    version: str, relative: bool, tmp_path: Path
) -> None:
    """At the start the FMU is told 3 rad/s as 6 turns, and 5 rad/s as 10; it answers with a torque of -6, and 20 of its degrees."""

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.unit = gp.FMU(tmp_path / "turns.fmu", inputs=["other"], outputs=["T"], period=1.0)
            self.body, self.second = gp.Inertia(J=1.0, start={"w": 3.0}), gp.Inertia(J=1.0, start={"w": 5.0})
            return [gl.connect(self.unit.flange, self.body.flange_a), gl.connect(self.second.w, self.unit.signals[0].u)]

    plain = gl.compile(Heated(), outputs=["tau", "T"]).export_fmu(tmp_path / "plain.fmu", version=version, kind="cs")
    with zipfile.ZipFile(plain) as old, zipfile.ZipFile(tmp_path / "turns.fmu", "w") as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename == "modelDescription.xml":
                text = content.decode().replace("<UnitDefinitions>", IN_TURNS).replace('unit="rad/s"', 'unit="turns"')
                given = f'unit="heat" relativeQuantity="{str(relative).lower()}"'
                kind = f'<SimpleType name="Heat"><Real {given}/></SimpleType>'
                kind = kind if version == "2.0" else f'<Float64Type name="Heat" {given}/>'
                text = text.replace("<ModelVariables>", f"<TypeDefinitions>{kind}</TypeDefinitions><ModelVariables>")
                text = text.replace(' unit="K"', ' declaredType="Heat"')
                content = text.replace(' displayUnit="rev/min"', "").replace(' displayUnit="degC"', "").encode()
            new.writestr(entry, content)
    result = gl.simulate(Train(), 0.5, samples=2)
    assert result["unit.source.tau"] == pytest.approx(10.0 - 6.0 - 10.0, rel=1e-12)
    assert result["unit.taken[0].y"] == pytest.approx(4.0 * 20.0 + (0.0 if relative else 250.0), rel=1e-12)


def test_a_further_signal_in_a_unit_that_nobody_knows_is_taken_as_it_is_with_a_warning(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "engine.fmu", "w") as file:
        text = DESCRIBED.format(unit="knots", definitions="", declared='unit="knots"')
        file.writestr("modelDescription.xml", text.replace('name="w"', 'name="v"'))
    text = r"v of engine\.fmu is in knots, which the file does not define; it is taken as it is"
    with pytest.warns(gl.GearlibWarning, match=text):
        ImportedFmu(tmp_path / "engine.fmu", ["v"], [])


def test_a_value_for_an_input_that_the_model_drives_is_refused(engines: dict[str, Path]) -> None:
    """It would hold up to the first instant only, at which the model gives another."""
    with pytest.raises(ArgumentError, match=r"values has throttle, an input of engine3\.fmu that the model gives"):
        gp.FMU(engines["3.0"], inputs=["throttle"], values={"throttle": 0.5})
    assert gp.FMU(engines["3.0"], values={"throttle": 0.5}).unit.values == {"throttle": 0.5}


def test_an_fmu_that_ends_the_simulation_is_noticed(engines: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fmpy.fmi3.FMU3Slave.doStep", lambda *_, **__: (False, True, False, 0.0))
    with pytest.raises(ArgumentError, match=r"engine3\.fmu ended the simulation at 0\.004 s"):
        gl.simulate(Coupled(path=str(engines["3.0"]), period=4e-3), 0.04, samples=3, inputs={"engine.signals[0].u": 0.8})
