"""Parameter sets in TOML, CSV and SSV: out, in, and read by a program that is not gearlib."""

from __future__ import annotations

import math
import tomllib
from fractions import Fraction
from itertools import chain
from pathlib import Path

import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, FileError
from tests.files.scenes import run, system

SUFFIXES = (".toml", ".csv", ".ssv")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_models_parameters_come_back(suffix: str, tmp_path: Path) -> None:
    path, every = tmp_path / f"p{suffix}", system().parameters | {"J_load": 0.1 + 0.2, "ω.x": -1e-300}
    gl.save_parameters(path, every, system().parameter_units)
    assert gl.load_parameters(path) == every
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_run_with_parameters_from_a_file(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"p{suffix}"
    gl.save_parameters(path, {"J_load": 1.5})
    inputs = {"torque.tau": lambda t: 6.0 + t}
    found = system().simulate(2.0, samples=41, parameters=gl.load_parameters(path), inputs=inputs)
    assert found["load.w"] == pytest.approx(run()["load.w"], rel=1e-12)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_values_that_are_not_finite(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"p{suffix}"
    gl.save_parameters(path, {"a": math.inf, "b": -math.inf, "c": math.nan})
    found = gl.load_parameters(path)
    assert (found["a"], found["b"], math.isnan(found["c"])) == (math.inf, -math.inf, True)


@pytest.mark.parametrize("suffix", [".toml", ".csv", ".ssv"])
@pytest.mark.parametrize("name", ["β.J", "𐐀.c", "body[0].J", 'a"b', "a\\b", "a,b;c", "#a = 1", "<&>", "a\u0301", " a "])
def test_names_come_back(suffix: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / f"set{suffix}"
    gl.save_parameters(path, {name: 0.1}, {name: "kg.m2"})
    assert gl.load_parameters(path) == {name: 0.1}


@pytest.mark.parametrize("character", ["\x7f", "\t", "\n", "\x01", "\u2028"])
def test_control_characters_in_toml(character: str, tmp_path: Path) -> None:
    gl.save_parameters(tmp_path / "set.toml", {f"a{character}b": 0.1})
    assert gl.load_parameters(tmp_path / "set.toml") == {f"a{character}b": 0.1}


def test_units_of_parameters() -> None:
    assert system().parameter_units["J_load"] == "kg.m2"
    assert system().parameter_units["gear.ratio"] == "1"


def test_fmpy_reads_ssv(tmp_path: Path) -> None:
    from fmpy.ssp.ssd import read_ssv

    gl.save_parameters(tmp_path / "p.ssv", {"load.J": 1.25, "shaft.c": 4000.0}, {"load.J": "kg.m2", "shaft.c": "N.m/rad"})
    found = read_ssv(str(tmp_path / "p.ssv"), validate=True)
    assert {p.name: float(p.value) for p in found.parameters} == {"load.J": 1.25, "shaft.c": 4000.0}


def test_the_text_of_an_ssv_file_has_each_unit_once(tmp_path: Path) -> None:
    values = {"load.J": 1.25, "a": -math.inf, "b": math.nan, "n": 3}
    gl.save_parameters(tmp_path / "p.ssv", values, {"load.J": "kg.m2", "a": "rad", "b": "kg.m2"})
    head, *lines = (tmp_path / "p.ssv").read_text(encoding="utf-8").splitlines()
    assert head == (
        '<ssv:ParameterSet xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" '
        f'xmlns:ssv="{NAMESPACE}" version="1.0" name="parameters">'
    )
    reals = {"load.J": '"1.25" unit="kg.m2"', "a": '"-INF" unit="rad"', "b": '"NaN" unit="kg.m2"', "n": '"3.0"'}
    entries = [[f'<ssv:Parameter name="{n}">', f"<ssv:Real value={v} />", "</ssv:Parameter>"] for n, v in reals.items()]
    units = [
        [f'<ssc:Unit name="{u}">', f"<ssc:BaseUnit {e} />", "</ssc:Unit>"]
        for u, e in {"kg.m2": 'kg="1" m="2"', "rad": 'rad="1"'}.items()
    ]
    assert [line.strip() for line in lines] == [
        "<ssv:Parameters>", *chain(*entries), "</ssv:Parameters>", "<ssv:Units>", *chain(*units), "</ssv:Units>",
        "</ssv:ParameterSet>",
    ]  # fmt: skip
    found = gl.load_parameters(tmp_path / "p.ssv")
    assert list(found.values()) == pytest.approx(list(values.values()), nan_ok=True)


def test_python_reads_toml_and_tables_are_read(tmp_path: Path) -> None:
    gl.save_parameters(tmp_path / "p.toml", {'a."b"[1]': 2.0}, {'a."b"[1]': "N.m"})
    assert tomllib.loads((tmp_path / "p.toml").read_text(encoding="utf-8")) == {'a."b"[1]': 2.0}
    (tmp_path / "q.toml").write_text('J_load = 3\n[load]\nJ = 1.5\n[gear.mesh]\n"c" = 1e6\n', encoding="utf-8")
    assert gl.load_parameters(tmp_path / "q.toml") == {"J_load": 3.0, "load.J": 1.5, "gear.mesh.c": 1e6}


def test_units_that_an_ssv_file_defines_are_converted(tmp_path: Path) -> None:
    (tmp_path / "p.ssv").write_text(
        """<?xml version="1.0" encoding="UTF-8"?>
        <ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
          xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="p">
          <ssv:Parameters>
            <ssv:Parameter name="w"><ssv:Real value="60" unit="rpm"/></ssv:Parameter>
            <ssv:Parameter name="T"><ssv:Real value="20" unit="degC"/></ssv:Parameter>
            <ssv:Parameter name="n"><ssv:Integer value="3"/></ssv:Parameter>
          </ssv:Parameters>
          <ssv:Units>
            <ssc:Unit name="rpm"><ssc:BaseUnit s="-1" rad="1" factor="0.10471975511965977"/></ssc:Unit>
            <ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>
          </ssv:Units>
        </ssv:ParameterSet>""",
        encoding="utf-8",
    )
    assert gl.load_parameters(tmp_path / "p.ssv") == pytest.approx({"w": 2 * math.pi, "T": 293.15, "n": 3.0})


NAMESPACE = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
UNITS = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = f'<ParameterSet xmlns="{NAMESPACE}"><Parameters>{{}}</Parameters></ParameterSet>'


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("p.toml", "a = [1", r"p\.toml is not TOML: Unclosed array"),
        ("p.toml", "[a]\nb = 'x'", r"parameter a\.b is 'x'; expected a number"),
        ("p.toml", "a = true", "parameter a is True; expected a number"),
        ("p.csv", "", "expected the columns name,value,unit"),
        ("p.csv", "a,1\n", "begins with 'a,1'; expected the columns name,value,unit"),
        ("p.csv", "name,value\na,1\nb,x\n", r"p\.csv, line 3: 'b,x'; expected a name and a number"),
        ("p.csv", "name,value\na\n", "line 2: 'a'; expected a name and a number"),
        ("p.csv", "name,value\na,1\na,2\n", "names the parameter a twice"),
        ("p.csv", "name,value,unit\na,1,rpm\n", r"parameter a: the unit 'rpm' is not accepted: declare 'rad/s'"),
        ("p.ssv", "<a", r"p\.ssv is not XML"),
        ("p.ssv", "<a/>", "not a parameter set of the SSP standard: its root is a"),
        (
            "p.ssv",
            SSV.format('<Parameter name="a"><String value="x"/></Parameter>'),
            "parameter a is a String; expected a Real",
        ),
        ("p.ssv", SSV.format('<Parameter name="a"><Real value="x"/></Parameter>'), "parameter a is 'x'; expected a number"),
        ("p.ssv", SSV.format('<Parameter name="a"><Real value="1" unit="rpm"/></Parameter>'), "parameter a: the unit 'rpm'"),
        (
            "p.ssv",
            f'<ParameterSet xmlns="{NAMESPACE}" xmlns:c="{UNITS}"><c:Unit name="u"><c:BaseUnit factor="x"/></c:Unit></ParameterSet>',
            r"p\.ssv cannot be read: could not convert string to float: 'x'",
        ),
        (
            "p.ssv",
            f'<ParameterSet xmlns="{NAMESPACE}" xmlns:c="{UNITS}"><Units><c:Unit name="u"><c:BaseUnit factor="2"/></c:Unit>'
            '<c:Unit name="u"><c:BaseUnit factor="3"/></c:Unit></Units></ParameterSet>',
            r"p\.ssv defines the unit u twice",
        ),
        ("p.yaml", "", r"suffix '\.yaml'; expected \.toml, \.csv, \.ssv"),
    ],
)
def test_other_files_are_refused(name: str, text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises((FileError, ArgumentError), match=message):
        gl.load_parameters(tmp_path / name)


def test_what_is_beyond_all_measure_is_refused(tmp_path: Path) -> None:
    for name, text, message in (
        ("p.toml", f"a = 1{'0' * 400}", "int too large to convert to float"),
        ("p.toml", f"a = 1{'0' * 5000}", "Exceeds the limit"),
        ("p.toml", f"a = {'[' * 3000}", "maximum recursion depth exceeded"),
        ("p.csv", f'name,value\n"{"x" * 200_000}', "field larger than field limit"),
    ):
        (tmp_path / name).write_text(text, encoding="utf-8")
        with pytest.raises(FileError, match=f"{name} cannot be read: {message}"):
            gl.load_parameters(tmp_path / name)


def test_what_cannot_be_read_or_written(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"p\.toml cannot be read: No such file"):
        gl.load_parameters(tmp_path / "p.toml")
    (tmp_path / "p.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(FileError, match=r"p\.toml is not UTF-8 text"):
        gl.load_parameters(tmp_path / "p.toml")
    with pytest.raises(ArgumentError, match="parameter a is 'x'; expected a number"):
        gl.save_parameters(tmp_path / "p.toml", {"a": "x"})  # type: ignore[dict-item]
    for huge in (10**400, Fraction(10**400, 3)):
        with pytest.raises(ArgumentError, match=r"parameter a is .*; expected a number"):
            gl.save_parameters(tmp_path / "p.toml", {"a": huge})
    with pytest.raises(ArgumentError, match=r"the unit of a is 3; expected a name, such as 'kg\.m2'"):
        gl.save_parameters(tmp_path / "p.toml", {"a": 1.0}, {"a": 3})  # type: ignore[dict-item]
    for name in ("p\0.toml", "\ud800.toml"):
        with pytest.raises(ArgumentError, match=r"path is .*; expected the path of a file"):
            gl.save_parameters(name, {"a": 1.0})
    with pytest.raises(ArgumentError, match="the unit 'rpm'"):
        gl.save_parameters(tmp_path / "p.ssv", {"a": 1.0}, {"a": "rpm"})


@pytest.mark.parametrize("suffix", [".toml", ".csv", ".ssv"])
def test_each_character_of_a_name_is_read_back_or_refused(suffix: str, tmp_path: Path) -> None:
    refused = set()
    for code in (*range(0x30), 0x7F, 0x85, 0x2028, 0xD800, 0xFEFF, 0xFFFE, 0x10FFFF):
        name, path = f"{chr(code)}a{chr(code)}{chr(10)}", tmp_path / f"p{suffix}"
        try:
            gl.save_parameters(path, {"J": 1.0, name: 2.0})
        except ArgumentError as problem:
            assert f"cannot hold the parameter {name!r}" in str(problem)
            refused.add(code)
        else:
            assert gl.load_parameters(path) == {"J": 1.0, name: 2.0}
    control = {*range(0x20)} - {9, 10, 13} | {0xFFFE} if suffix == ".ssv" else set()
    assert refused == control | {0xD800}


def test_a_unit_that_breaks_the_line_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"cannot hold the parameter 'a' of the unit 'm\\n\]'"):
        gl.save_parameters(tmp_path / "p.toml", {"b": 1.0, "a": 2.0}, {"a": "m\n]"})


@pytest.mark.parametrize(("kinds", "said"), [("", "nothing"), ("<ssv:String value='2'/><ssv:Real value='2'/>", "String")])
def test_the_first_kind_of_an_ssv_parameter_counts(kinds: str, said: str, tmp_path: Path) -> None:
    """Others may be added behind it; what has none that is a number is refused by name."""

    def written(inside: str) -> Path:
        path = tmp_path / "p.ssv"
        parameter = f"<ssv:Parameter name='J'><other/>{inside}</ssv:Parameter>"
        path.write_text(
            f"<ssv:ParameterSet xmlns:ssv='{NAMESPACE}'><ssv:Parameters>{parameter}</ssv:Parameters></ssv:ParameterSet>"
        )
        return path

    assert gl.load_parameters(written("<ssv:Real value='2.5'/><ssv:String value='x'/>")) == {"J": 2.5}
    with pytest.raises(FileError, match=rf"p\.ssv: parameter J is a {said}; expected a Real or an Integer"):
        gl.load_parameters(written(kinds))
