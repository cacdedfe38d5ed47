"""The command `gearlib`: what it prints, what it writes, and one line for a user's fault."""

from __future__ import annotations

import csv
import io
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray

import gearlib as gl
from gearlib.command_line import EXAMPLES, main

DRIVE = textwrap.dedent('''
    import gearlib as gl
    import gearparts as gp


    class Drive(gl.Component):
        """A motor turns a load."""

        J_load = gl.Parameter("kg.m2", "load inertia", default=2.0, min=0)

        def assemble(self):
            self.torque, self.shaft = gp.Torque(), gp.SpringDamper(c=100.0, d=0.1)
            self.motor, self.load = gp.Inertia(J=1.0), gp.Inertia(J=self.J_load)
            return [
                gl.connect(self.torque.flange, self.motor.flange_a),
                gl.connect(self.motor.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.load.flange_a),
            ]
''')


@pytest.fixture
def drive(tmp_path: Path) -> str:
    (tmp_path / "drive.py").write_text(DRIVE, encoding="utf-8")
    (tmp_path / "torque.csv").write_text("t,tau\n0,6\n9,6\n", encoding="utf-8")
    (tmp_path / "bad.py").write_text("1 / 0\n", encoding="utf-8")
    return f"{tmp_path / 'drive.py'}:Drive"


def test_run_saves_what_was_asked_for(drive: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["run", drive, "--t-end", "2", "--set", "J_load=3", "--input", f"torque.tau={tmp_path / 'torque.csv'}:t,tau"]
    assert (
        main([*asked, "--out", str(tmp_path / "r.mat"), "--samples", "5", "--start", "motor.w=1", "--start", "load.w=1"]) == 0
    )
    printed = capsys.readouterr().out
    assert printed.startswith("<Result: 5 samples, 0 .. 2 s")
    found = gl.load_result(tmp_path / "r.mat")
    momentum = found["motor.w"] + 3.0 * found["load.w"]
    assert momentum == pytest.approx(4.0 + 6.0 * found.time)
    assert found.parameters["load.J"] == 3.0
    assert main(["plot", str(tmp_path / "r.mat"), "load.w", "--out", str(tmp_path / "r.png")]) == 0
    assert (tmp_path / "r.png").read_bytes().startswith(b"\x89PNG")


def test_run_prints_csv_and_nothing_else(drive: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "p.toml").write_text("J_load = 2.0\n", encoding="utf-8")
    asked = [
        "run",
        drive,
        "--t-end",
        "2",
        "--samples",
        "3",
        "--input",
        "torque.tau=6",
        "--outputs",
        "load.w,motor.w",
        "--out",
        "-",
    ]
    assert main([*asked, "--parameters", str(tmp_path / "p.toml")]) == 0
    head, *rows = csv.reader(io.StringIO(capsys.readouterr().out))
    assert head == ["time", "load.w", "motor.w"]
    assert [2 * float(load) + float(motor) for _, load, motor in rows] == pytest.approx([0.0, 6.0, 12.0])


def test_models_of_a_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["run", "gearparts:ZhouCui2022", "--t-end", "0.1", "--samples", "2", "--input", "tau_in=100", "--outputs", "w_in"])
        == 0
    )
    assert "w_in = " in capsys.readouterr().out
    assert main(["info", "gearparts:ZhouCui2021"]) == 2
    assert "did you mean 'ZhouCui2022'" in capsys.readouterr().err


def test_info_modes_and_check(drive: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert [main([name, drive, "--set", "J_load=3"]) for name in ("info", "modes", "check")] == [0, 0, 0]
    printed = capsys.readouterr().out
    assert "inputs: torque.tau" in printed
    assert "  J_load = 3 kg.m2" in printed
    assert "1.83" in printed  # Hz, sqrt(100 (1 + 1/3)) / (2 pi)
    assert "Drive: units agree, " in printed


def test_sweep_prints_the_last_values_of_all_combinations(
    drive: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = [
        "sweep",
        drive,
        "--vary",
        "J_load=1:3:3",
        "--vary",
        "torque.tau=2,4",
        "--t-end",
        "2",
        "--outputs",
        "load.w,motor.w",
    ]
    assert main([*asked, "--out", "-"]) == 0
    head, *rows = csv.reader(io.StringIO(capsys.readouterr().out))
    assert head == ["J_load", "torque.tau", "load.w", "motor.w"]
    assert [(float(J), float(tau)) for J, tau, *_ in rows] == [(J, tau) for J in (1.0, 2.0, 3.0) for tau in (2.0, 4.0)]
    assert [float(J) * float(load) + float(motor) for J, _, load, motor in rows] == pytest.approx([4.0, 8.0] * 3)
    assert main([*asked, "--out", str(tmp_path / "runs.csv")]) == 0
    assert (tmp_path / "runs.csv").read_text(encoding="utf-8").startswith("J_load,torque.tau,load.w,motor.w\n1.0,2.0,")


def test_models_go_to_modelica_text_and_come_from_it(drive: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = tmp_path / "Drive.mo"
    assert main(["modelica", drive, "--set", "J_load=3", "--out", str(text)]) == 0
    asked = ["--t-end", "2", "--samples", "2", "--input", "torque_tau=6", "--outputs", "load.w,motor.w", "--out", "-"]
    for model in (str(text), f"{text}:DrivePackage.Drive"):
        assert main(["run", model, *asked]) == 0
        _, _, (_, load, motor) = csv.reader(io.StringIO(capsys.readouterr().out))
        assert 3 * float(load) + float(motor) == pytest.approx(12.0)
    assert main(["modelica", drive, "--flat"]) == 0
    assert capsys.readouterr().out.startswith('model Drive "A motor turns a load."')


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["sweep", "{drive}", "--t-end", "1", "--vary", "J_load=x"], "--vary J_load=x: expected NAME=NUMBER,NUMBER"),
        (["modelica", "{drive}", "--out", "Drive.txt"], "--out Drive.txt: expected the name of a file that ends with .mo"),
        (["info", "{drive}", "--set", "J_lod=3"], "the model has no parameter 'J_lod'; did you mean 'J_load'"),
        (["info", "{drive}", "--set", "J_load=-3"], "J_load is -3"),
        (
            ["sweep", "{drive}", "--t-end", "1", "--vary", "J_load=1", "--vary", "J_load=2,3"],
            "--vary J_load=1 --vary J_load=2,3: one name is given twice; give all of its values at once",
        ),
        (
            ["info", "{drive}", "--set", "J_load=1", "--set", "J_load =2"],
            "--set J_load=1 --set J_load =2: one name is given twice",
        ),
        (
            ["run", "{drive}", "--t-end", "1", "--start", "load.w=1", "--start", "load.w=2"],
            "--start load.w=1 --start load.w=2: one name is given twice",
        ),
        (
            ["run", "{drive}", "--t-end", "1", "--input", "torque.tau=1", "--input", "torque.tau=2"],
            "--input torque.tau=1 --input torque.tau=2: one name is given twice",
        ),
        (
            ["sweep", "{drive}", "--t-end", "1", "--vary", "J_load=1,2", "--set", "J_load=3"],
            "--vary J_load=1,2 --set J_load=3: one name is given twice",
        ),
        (
            ["sweep", "{drive}", "--t-end", "1", "--vary", "J_load=1:inf:3"],
            "values['J_load'] is [nan, inf, inf]; expected a number",
        ),
        (["info", "nowhere.mo"], "nowhere.mo cannot be read: there is no such file"),
        (["info", "{drive}x"], "has no component class Drivex; did you mean 'Drive'?"),
        (["info", "drive"], "the model is 'drive'; expected FILE.py:CLASS"),
        (["info", ":Drive"], "the model is ':Drive'; expected FILE.py:CLASS"),
        (["info", "drive.py:"], "the model is 'drive.py:'; expected FILE.py:CLASS"),
        (["info", "nowhere.mo:Drive"], "nowhere.mo cannot be read: there is no such file"),
        (["info", "nowhere.py:Drive"], "nowhere.py cannot be read: there is no such file"),
        (["info", "no_such_module:Drive"], "no_such_module cannot be loaded: ModuleNotFoundError"),
        (["info", "{folder}/bad.py:Drive"], "bad.py cannot be loaded: ZeroDivisionError: division by zero"),
        (["run", "{drive}", "--t-end", "-1"], "t_end (-1) must be greater than t_start (0)"),
        (["run", "{drive}", "--t-end", "1", "--set", "J_lod=3"], "no parameter 'J_lod'; did you mean 'J_load'"),
        (["run", "{drive}", "--t-end", "1", "--set", "J_load"], "--set J_load: there is no '='; expected NAME=NUMBER"),
        (["run", "{drive}", "--t-end", "1", "--set", "J_load=x"], "--set J_load=x: there is 'x', which is not a number"),
        (["run", "{drive}", "--t-end", "1", "--input", "torque.tau=t.csv"], "expected NAME=NUMBER or NAME=FILE:TIME,COLUMN"),
        (["run", "{drive}", "--t-end", "1", "--input", "torque.tau={folder}/torque.csv:t,x"], "torque.csv has no column 'x'"),
        (["run", "{drive}", "--t-end", "1", "--out", "r.xls"], "r.xls has the suffix '.xls'; expected .mat"),
        (["plot", "{folder}/drive.py"], "drive.py has the suffix '.py'"),
    ],
)
def test_a_users_fault_is_one_line(arguments: list[str], message: str, drive: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = Path(drive.rpartition(":")[0]).parent
    assert main([a.format(drive=drive, folder=folder) for a in arguments]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert said.startswith(f"gearlib {arguments[0]}: ")


NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")


def test_the_page_shows_what_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its files are written and its commands run; numbers are those of another machine, where only rounding and sizes differ."""
    page = (Path(__file__).resolve().parents[1] / "docs" / "command_line.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for name, text in re.findall(r"^`(\S+)`:\n\n```\w*\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        Path(name).write_text(text, encoding="utf-8")
    (console,) = re.findall(r"^```console\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    commands = re.findall(r"^\$ gearlib (.*)\n((?:[^$].*\n)*)", console, re.MULTILINE)
    assert {line.split()[0] for line, _ in commands} >= EXAMPLES.keys() - {"info"}
    for line, shown in commands:
        code = main(line.split())
        captured = capsys.readouterr()
        assert code == (0 if captured.out or not captured.err else 2)
        found, size = captured.out + captured.err, line.startswith("fmu")
        assert NUMBER.sub("#", found) == NUMBER.sub("#", shown)
        numbers = [np.array(NUMBER.findall(text), float) for text in (found, shown)]
        np.testing.assert_allclose(*numbers, rtol=0.5 if size else 1e-6)


@pytest.mark.parametrize("name", EXAMPLES)
def test_help_shows_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([name, "--help"])
    assert stopped.value.code == 0
    assert " ".join(EXAMPLES[name].split()) in " ".join(capsys.readouterr().out.split())


@pytest.mark.filterwarnings("always")
def test_a_warning_is_one_line(drive: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", drive, "--t-end", "1", "--outputs", "load.w"]) == 0
    said = capsys.readouterr().err
    assert said.startswith("gearlib run: warning: Drive: no value was given for the input torque.tau")
    assert said.count("\n") == 1


def test_wrong_usage_ends_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([], ["nonsense"], ["run", "drive.py:Drive"]):
        with pytest.raises(SystemExit) as stopped:
            main(arguments)
        assert stopped.value.code == 2
    assert "usage: gearlib" in capsys.readouterr().err


def test_who_reads_the_output_may_stop(drive: str) -> None:
    asked = [sys.executable, "-m", "gearlib.command_line", "run", drive, "--t-end", "1", "--samples", "20000", "--out", "-"]
    with subprocess.Popen([*asked, "--input", "torque.tau=1"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline().startswith(b"time,")
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_fmu_is_written_with_the_parameters_given(drive: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fmpy = pytest.importorskip("fmpy")
    out = tmp_path / "drive.fmu"
    assert (
        main(["fmu", drive, "--out", str(out), "--outputs", "load.w", "--set", "J_load=3", "--kind", "cs", "--t-end", "2"]) == 0
    )
    assert f"{out}: FMI 3.0, " in capsys.readouterr().out
    description = fmpy.read_model_description(str(out))
    variables = {v.name: v for v in description.modelVariables}
    assert (float(variables["J_load"].start), variables["J_load"].unit) == (3.0, "kg.m2")
    assert (variables["load.J"].causality, variables["torque.tau"].causality) == ("calculatedParameter", "input")
    assert [o.variable.name for o in description.outputs] == ["load.w"]
    assert description.modelExchange is None
    assert float(description.defaultExperiment.stopTime) == 2.0
    assert main(["fmu", drive, "--out", str(out), "--set", "load.J=3"]) == 2
    assert "load.J follows from other parameters" in capsys.readouterr().err


def test_info_lists_what_a_run_may_be_given(drive: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", drive, "--set", "J_load=1234567"]) == 0
    lines = capsys.readouterr().out.splitlines()
    listed = lines[lines.index("inputs: torque.tau") :]
    assert listed == [
        "inputs: torque.tau",
        f"states: {', '.join(gl.compile(_drive(drive)).states)}",
        "parameters:",
        "  J_load = 1.23457e+06 kg.m2",
        "  shaft.c = 100 N.m/rad",
        "  shaft.d = 0.1 N.m.s/rad",
        "  shaft.phi_rel0 = 0 rad",
        "  motor.J = 1 kg.m2",
        "  load.J = 1.23457e+06 kg.m2",
    ]
    assert main(["info", "gearparts:ZhouCui2022"]) == 0
    text = capsys.readouterr().out
    assert "\ninputs: tau_in\n" in text
    assert "\n  train.coupling.ratio = -1\n" in text, "no unit where there is none"


def _drive(drive: str) -> Any:
    found: dict[str, Any] = {}
    exec(compile(Path(drive.rpartition(":")[0]).read_text(encoding="utf-8"), "drive.py", "exec"), found)
    return found["Drive"]()


def test_a_model_without_inputs_says_so_and_what_lies_beside_it_is_imported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "beside_a_model.py").write_text("J = 4.0\n", encoding="utf-8")
    (tmp_path / "model_with_neighbour.py").write_text(
        textwrap.dedent("""
            import gearlib as gl
            import gearparts as gp
            from beside_a_model import J

            class Spin(gl.Component):
                def assemble(self):
                    self.body = gp.Inertia(J=J, start={"w": 2.0})
                    return []
            """),
        encoding="utf-8",
    )
    model = f"{tmp_path / 'model_with_neighbour.py'}:Spin"
    assert [main([name, model]) for name in ("info", "check")] == [0, 0]
    printed = capsys.readouterr().out.splitlines()
    assert "inputs: none" in printed
    assert "  body.J = 4 kg.m2" in printed
    assert printed[-1] == "Spin: units agree, 1 states, it starts"


def test_an_interrupt_ends_with_130(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "interrupted.py").write_text("raise KeyboardInterrupt\n", encoding="utf-8")
    assert main(["info", f"{tmp_path / 'interrupted.py'}:Drive"]) == 130
    assert capsys.readouterr() == ("", "")


def test_pictures_are_shown_or_saved(
    drive: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown: list[list[str]] = []
    monkeypatch.setattr(plt, "show", lambda: shown.append([ax.get_legend_handles_labels()[1][0] for ax in plt.gcf().axes]))
    asked = ["run", drive, "--t-end", "1", "--samples", "3", "--input", "torque.tau=1", "--out", str(tmp_path / "r.csv")]
    assert main([*asked, "--plot", "load.w,shaft.tau"]) == 0
    assert main([*asked]) == 0
    assert len(shown) == 1
    assert main(["plot", str(tmp_path / "r.csv")]) == 0
    assert main(["plot", str(tmp_path / "r.csv"), "load.w"]) == 0
    assert len(shown) == 3
    assert main(["plot", str(tmp_path / "r.csv"), "load.w", "--out", str(tmp_path / "r.xyz")]) == 2
    assert f"{tmp_path / 'r.xyz'} cannot be written: Format 'xyz' is not supported" in capsys.readouterr().err
    assert len(shown) == 3
    plt.close("all")


def test_a_sweep_keeps_the_states_unless_told_otherwise(drive: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["sweep", drive, "--t-end", "1", "--samples", "3", "--vary", "J_load=1,2", "--input", "torque.tau=1"]
    assert main(asked) == 0
    head, *rows = csv.reader(io.StringIO(capsys.readouterr().out))
    states = gl.compile(_drive(drive)).states
    assert head == ["J_load", *states]
    assert [float(row[0]) for row in rows] == [1.0, 2.0]
    assert main([*asked, "--out", str(tmp_path / "runs.nc"), "--start", "load.w=5"]) == 0
    assert capsys.readouterr().out.startswith("<Runs of Drive: 2; ")
    with xarray.open_dataset(tmp_path / "runs.nc") as found:
        assert found["load.w"].shape == (2, 3)
        assert found["load.w"][:, 0].to_numpy().tolist() == [5.0, 5.0]
        last = found[states[0]][:, -1].to_numpy()
    assert main([*asked, "--start", "load.w=5"]) == 0
    again = [float(row[1]) for row in list(csv.reader(io.StringIO(capsys.readouterr().out)))[1:]]
    assert again == pytest.approx(last.tolist())


@pytest.mark.parametrize(
    "text", ["J_load=1:3", "J_load=1:2:3:4", "J_load=", "J_load", "J_load=1:3:x", "J_load=1:3:99999999999999"]
)
def test_what_varies_is_listed_or_counted(drive: str, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", drive, "--t-end", "1", "--vary", text]) == 2
    assert f"--vary {text}: expected NAME=NUMBER,NUMBER or NAME=FIRST:LAST:COUNT, as in --vary " in capsys.readouterr().err
