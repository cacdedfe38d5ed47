"""Results in files: each format read by a program that is not gearlib, and refused where it is cut off or of another kind."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import struct
import subprocess
import sys
import warnings
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, FileError, NameLookupError
from gearlib.files import formats
from gearlib.files.contents import Record, from_header
from gearlib.files.formats import FORMATS, Format, load_record, save_record
from tests.files.scenes import Drive, run, system

SUFFIXES = sorted(FORMATS)
IN_ONE_FILE = [suffix for suffix in SUFFIXES if suffix != ".zarr"]


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("saved")
    for suffix in SUFFIXES:
        run().save(folder / f"r{suffix}")
    return folder


def foreign(path: Path) -> Iterator[tuple[str, str, Any]]:
    """Name, unit and history of every variable, as another program reads them."""
    if path.suffix == ".mat":
        import DyMat

        found = DyMat.DyMatFile(str(path))
        for name in found.names(block=2):
            _, bracket, unit = found.description(name).rpartition("[")
            yield name, unit.rstrip("]") if bracket else "", found.data(name)
    elif path.suffix == ".csv":
        pandas = pytest.importorskip("pandas")
        frame = pandas.read_csv(path, comment="#", index_col="time")
        yield from ((name, run().unit(name), frame[name].to_numpy()) for name in frame)
    elif path.suffix == ".nc":
        import netCDF4

        with netCDF4.Dataset(path) as file:
            for name, variable in file.variables.items():
                if name != "time":
                    yield name, getattr(variable, "units", ""), np.array(variable[:])
    elif path.suffix == ".zarr":
        import zarr

        group = zarr.open_group(path, mode="r")
        for name, array in group.arrays():
            if name not in ("time", "gearlib_header"):
                yield name, array.attrs["units"], array[:]
    else:
        parquet = pytest.importorskip("pyarrow.parquet")
        table = parquet.read_table(path)
        for field, column in zip(table.schema, table.columns, strict=True):
            if field.name != "time":
                yield field.name, field.metadata[b"units"].decode(), column.to_numpy()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_another_program_reads_the_same(suffix: str, saved: Path) -> None:
    result, seen = run(), set()
    last_digit = 1e-15 if suffix == ".csv" else 0.0  # pandas rounds the last one
    for name, unit, history in foreign(saved / f"r{suffix}"):
        assert history == pytest.approx(result[name], rel=last_digit, abs=0), name
        assert unit == result.unit(name), name
        seen.add(name)
    every = {n for n in [*system().variables, "counter.n"]}
    assert seen >= every
    assert all(name in result for name in every)


def test_netcdf_files_may_be_larger_than_two_gigabytes(saved: Path) -> None:
    """In the format with offsets of 64 bits, the second version of netCDF 3."""
    assert (saved / "r.nc").read_bytes()[:4] == b"CDF\x02"


def test_aliases_cost_a_name_in_dymolas_format(saved: Path) -> None:
    from buildingspy.io.outputfile import Reader
    from scipy.io import loadmat

    found = loadmat(saved / "r.mat", chars_as_strings=False)
    block, column = found["dataInfo"][:2]
    assert block[0] == 0  # the time is in both
    assert set(block[1:].tolist()) == {1, 2}
    assert (block == 2).sum() > 1.5 * len(found["data_2"])
    assert (column < 0).any()
    assert set(map(len, found["data_1"])) == {2}
    reader = Reader(str(saved / "r.mat"), "dymola")
    time, torque = reader.values("torque.flange.tau")
    assert time == pytest.approx(run().time)
    assert torque == pytest.approx(-6.0 - run().time)
    assert reader.values("J_load")[1] == pytest.approx([1.5, 1.5])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_nothing_is_lost(suffix: str, saved: Path) -> None:
    found, result = gl.load_result(saved / f"r{suffix}"), run()
    assert isinstance(found, gl.Result)
    assert np.array_equal(found.time, result.time)
    assert set(found) >= {*system().variables, "counter.n"}
    for name, history in found.items():
        assert np.array_equal(history, result[name]), name
        assert found.unit(name) == result.unit(name)
    assert (found.stats, found.events) == (result.stats, result.events)
    assert found.model == "Drive"
    assert found.parameters["load.J"] == 1.5
    assert found.options["rtol"] == 1e-6
    assert found.options["method"] == "auto"
    assert set(found.versions) >= {"gearlib", "python", "numpy"}
    assert found.final["motor.w"] == result.final["motor.w"]
    assert found.record().descriptions == result.record().descriptions
    assert "Drehzahl ω, счётчик" in found.record().descriptions


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_from_any_format_to_any_other(suffix: str, saved: Path, tmp_path: Path) -> None:
    again = tmp_path / f"again{suffix}"
    gl.load_result(saved / "r.mat").save(again, names=["load.w", "counter.n", "torque.flange.tau"])
    found = gl.load_result(again)
    assert found.keys() == ["load.w", "counter.n", "torque.flange.tau"]
    assert all(np.array_equal(found[name], run()[name]) for name in found)


def test_what_is_saved_by_default() -> None:
    few = gl.compile(Drive(), outputs=["load.w"]).simulate(1.0, samples=3, inputs={"torque.tau": 0.0})
    assert few.record().names == ("load.w",)
    assert run().record(["load.w", "load.w"]).names == ("load.w",)
    with pytest.raises(NameLookupError, match="no variable 'typo'"):
        run().save("r.mat", names=["typo"])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_run_without_outputs_and_values_that_are_not_finite(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"r{suffix}"
    record = Record(np.array([0.0, 1.0]), np.empty((2, 0)), (), (), (), (), ())
    save_record(record, path)
    assert load_record(path).names == ()
    odd = np.array([[np.nan, np.inf], [-np.inf, 5e-324]])
    record = Record(
        np.array([0.0, 1.0]),
        odd,
        ("a", 'x[1,2]."b"', "ω"),
        (0, 1, 0),
        (1, 1, -1),
        ("1",) * 3,
        ("", "", ""),
        stats={"w": 0},
    )
    save_record(record, path)
    found = load_record(path)
    assert found.names == record.names
    assert all(np.array_equal(found.history(n), record.history(n), equal_nan=True) for n in record.names)
    assert found.stats == {"w": 0}


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize("suffix", IN_ONE_FILE)
def test_a_file_that_is_cut_off_anywhere_is_refused(suffix: str, saved: Path, tmp_path: Path) -> None:
    whole, path = (saved / f"r{suffix}").read_bytes(), tmp_path / f"cut{suffix}"
    places = {0, 1, 3, 4, 20, *range(100, len(whole), len(whole) // 40), len(whole) - 2, len(whole) - 1}
    for length in sorted(places):
        path.write_bytes(whole[:length])
        with pytest.raises(FileError, match=rf"cut\{suffix} is (truncated or damaged: .|not a result file of gearlib)"):
            gl.load_result(path)


@pytest.mark.parametrize("suffix", IN_ONE_FILE)
def test_a_file_with_a_changed_byte_is_refused_or_has_the_same_numbers(suffix: str, saved: Path, tmp_path: Path) -> None:
    whole, path, before = (saved / f"r{suffix}").read_bytes(), tmp_path / f"r{suffix}", load_record(saved / f"r{suffix}")
    for place in range(0, len(whole), len(whole) // 60):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x80]) + whole[place + 1 :])
        with suppress(FileError):
            found = load_record(path)
            assert np.array_equal(found.time, before.time)
            assert np.array_equal(found.data, before.data)


@pytest.mark.parametrize(
    ("suffix", "name", "said"),
    [
        (".nc", "time", "netCDF has no variable of the name 'time'"),
        (".nc", "a/b", "netCDF has no variable of the name 'a/b'"),
        (".zarr", "time", "a variable of the model is called time, which the file format reserves"),
        (".zarr", "gearlib_header", "a variable of the model is called gearlib_header, which the file format reserves"),
    ],
)  # fmt: skip
def test_names_that_a_format_does_not_have(suffix: str, name: str, said: str, tmp_path: Path) -> None:
    record = Record(np.zeros(1), np.zeros((1, 2)), ("w", name), (0, 1), (1, 1), ("", ""), ("", ""))
    with pytest.raises(ArgumentError) as problem:
        save_record(record, tmp_path / f"r{suffix}")
    assert str(problem.value).split("; leave it out of names")[0] == said
    assert list(tmp_path.iterdir()) == []


def test_provenance_of_any_kind_comes_back_as_json_has_it() -> None:
    """Numbers of NumPy as numbers, sequences as tuples, mappings of any kind, anything else in words."""
    time, data = np.zeros(1), np.zeros((1, 1))
    stats = {
        "n": np.int64(3),
        "x": np.float64(0.5),
        "many": np.array([1.0, 2.0]),
        "map": MappingProxyType({"a": 1}),
        "kind": Path("p"),
    }
    record = Record(time, data, ("w",), (0,), (1,), ("",), ("",), stats=stats, events=[(0.5, "gap")])
    found = from_header(record.header(), time, data, "r")
    assert found.stats == {"n": 3, "x": 0.5, "many": (1.0, 2.0), "map": {"a": 1}, "kind": "p"}
    assert found.events == ((0.5, "gap"),)
    assert (found.place, found.model, found.versions) == ({"w": 0}, "", {})


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("units", None, "r is truncated or damaged: it has no units"),
        ("samples", None, "r is truncated or damaged: it has no samples"),
        ("stats", [1], "r is truncated or damaged: 'list' object has no attribute 'items'"),
        ("events", [[1.0]], "r is truncated or damaged: not enough values to unpack (expected 2, got 1)"),
        ("gearlib result", None, "r is not a result file of gearlib; expected a file written by result.save(...)"),
        ("gearlib result", "1", "r is not a result file of gearlib; expected a file written by result.save(...)"),
    ],
)
def test_headers_that_were_changed_are_refused(key: str, value: Any, said: str) -> None:
    time, data = np.zeros(1), np.zeros((1, 1))
    header = json.loads(Record(time, data, ("w",), (0,), (1,), ("",), ("",)).header())
    header.pop(key)
    with pytest.raises(FileError) as problem:
        from_header(json.dumps(header if value is None else {**header, key: value}), time, data, "r")
    assert str(problem.value) == said
    with pytest.raises(FileError, match="r is not a result file of gearlib"):
        from_header("[1", time, data, "r")


@pytest.mark.parametrize("lacking", ["name", "description", "dataInfo", "data_1", "data_2"])
def test_a_trajectory_that_lacks_a_matrix_is_refused(lacking: str, saved: Path, tmp_path: Path) -> None:
    """Or has its matrices in the other order, which other programs write, too."""
    from scipy.io import loadmat, savemat

    found = {k: v for k, v in loadmat(saved / "r.mat", chars_as_strings=False).items() if not k.startswith("__")}
    with (tmp_path / "r.mat").open("wb") as file:
        savemat(file, {k: v for k, v in found.items() if k != lacking}, format="4")
    with pytest.raises(FileError, match=rf"r\.mat is truncated or damaged: it has no {lacking}$"):
        gl.load_result(tmp_path / "r.mat")
    found["Aclass"][3, :8] = np.array(list("binNorma"), "S1").astype(found["Aclass"].dtype)
    with (tmp_path / "r.mat").open("wb") as file:
        savemat(file, found, format="4")
    with pytest.raises(FileError, match=r"r\.mat is not a result file of gearlib"):
        gl.load_result(tmp_path / "r.mat")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"dataInfo": [[0, 2, 1], [1, 3, 1]]}, "w is column 3 of the 2 of data_2"),
        ({"dataInfo": [[0, 2, 1], [1, 0, 1]]}, "w is column 0 of the 2 of data_2"),
        ({"dataInfo": [[0, 2, 1], [1, 2, -2]]}, "J is column -2 of the 1 of data_1"),
        ({"dataInfo": [[0, 2], [1, 2]]}, "it has 3 names, 3 descriptions and 2 columns of dataInfo"),
        ({"description": [list("ab")]}, "it has 3 names, 2 descriptions and 3 columns of dataInfo"),
    ],
)
def test_a_trajectory_of_another_program_whose_matrices_do_not_fit(changed: Any, said: str, tmp_path: Path) -> None:
    from scipy.io import savemat

    path, lines = tmp_path / "r.mat", ["Atrajectory", "1.1        ", "           ", "binTrans   "]
    names = np.array([list("twJ")], "S1")
    whole = {
        "Aclass": np.array([list(line) for line in lines], "S1"), "name": names, "description": names,
        "dataInfo": [[0, 2, 1], [1, -2, 1]], "data_1": [[5.0, 5.0]], "data_2": [[0.0, 1.0], [3.0, 4.0]],
    }  # fmt: skip
    savemat(path, whole, format="4")
    assert (load_record(path).history("w").tolist(), load_record(path).parameters) == ([-3.0, -4.0], {"J": 5.0})
    savemat(path, whole | {k: np.array(v, "S1" if k == "description" else np.int32) for k, v in changed.items()}, format="4")
    with pytest.raises(FileError, match=rf"r\.mat is truncated or damaged: {said}$"):
        load_record(path)


def test_files_of_other_rows_and_without_times(saved: Path, tmp_path: Path) -> None:
    import netCDF4

    (tmp_path / "r.csv").write_text((saved / "r.csv").read_text(encoding="utf-8") + "1.0,x\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"r\.csv is truncated or damaged: .*"):
        gl.load_result(tmp_path / "r.csv")
    shutil.copy(saved / "r.nc", tmp_path / "r.nc")
    with netCDF4.Dataset(tmp_path / "r.nc", "a") as file:
        file.renameVariable("time", "t")
    with pytest.raises(FileError, match=r"r\.nc is truncated or damaged: it has no time$"):
        gl.load_result(tmp_path / "r.nc")


def test_a_zarr_folder_that_lacks_anything_is_refused(saved: Path, tmp_path: Path) -> None:
    files = sorted(p.relative_to(saved / "r.zarr") for p in (saved / "r.zarr").rglob("*") if p.is_file())
    chosen = [
        f
        for f in files
        if f.parts[0] in (".zgroup", "load.w", "time", "gearlib_header") and f.name not in (".zarray", ".zattrs")
    ]
    assert len(chosen) >= 4
    for n, file in enumerate(chosen):
        copy = tmp_path / f"{n}.zarr"
        shutil.copytree(saved / "r.zarr", copy)
        (copy / file).unlink()
        with pytest.raises(FileError, match=r"\.zarr is (truncated or damaged: .|not a result file)"):
            gl.load_result(copy)


def test_numbers_that_do_not_belong_to_the_header() -> None:
    """Each of the two lengths, and the number of distinct histories, which aliases share."""
    time, data = np.arange(3.0), np.arange(6.0).reshape(3, 2)
    written = Record(time, data, ("a", "b", "c"), (0, 1, 1), (1, 1, -1), ("",) * 3, ("",) * 3).header()
    assert np.array_equal(from_header(written, time, data, "r").history("c"), -data[:, 1])
    for times, numbers in ((time[:2], data), (time, data[:2]), (time, data[:, :1]), (time, data.T), (time, data[:, 0])):
        said = f"r is truncated or damaged: it holds {len(times)} times and data of the shape {numbers.shape}; expected 3 and (3, 2)"
        with pytest.raises(FileError, match=f"^{re.escape(said)}$"):
            from_header(written, times, numbers, "r")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_numbers_that_were_changed_are_noticed(suffix: str, saved: Path, tmp_path: Path) -> None:
    record = load_record(saved / f"r{suffix}")
    path = tmp_path / f"r{suffix}"
    save_record(Changed(**vars(record) | {"data": record.data + 1e-9}), path)
    with pytest.raises(FileError, match=r"its numbers are not those that were written \(checksum\)"):
        gl.load_result(path)


class Changed(Record):
    """Says the checksum of other numbers."""

    checksum = 1  # type: ignore[assignment]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_files_of_another_kind_are_refused(suffix: str, saved: Path, tmp_path: Path) -> None:
    path = tmp_path / f"r{suffix}"
    with pytest.raises(FileError, match=rf"r\{suffix} (cannot be read: No such file|is not a result file of gearlib)"):
        gl.load_result(path)
    for other in (".mat", ".csv", ".nc", ".parquet"):
        if other != suffix:
            shutil.copy(saved / f"r{other}", path)
            with pytest.raises(FileError, match=rf"r\{suffix} (is not a result file of gearlib|is truncated|cannot be read)"):
                gl.load_result(path)
    path.unlink()
    written_by_others(path)
    with pytest.raises(FileError, match=rf"r\{suffix} is not a result file of gearlib; expected a file written by result.save"):
        gl.load_result(path)


def written_by_others(path: Path) -> None:
    from scipy.io import netcdf_file, savemat

    if path.suffix == ".mat":
        savemat(path, {"x": np.arange(3.0)}, format="4")
    elif path.suffix == ".csv":
        path.write_text("time,x\n0,1\n", encoding="utf-8")
    elif path.suffix == ".nc":
        with netcdf_file(path, "w") as file:
            file.createDimension("x", 3)
    elif path.suffix == ".zarr":
        pytest.importorskip("xarray").Dataset({"x": ("t", [1.0])}).to_zarr(path, zarr_format=2)
    else:
        pytest.importorskip("pandas").DataFrame({"x": [1.0]}).to_parquet(path)


def test_a_file_of_a_later_version_is_refused(saved: Path, tmp_path: Path) -> None:
    text = (saved / "r.csv").read_text(encoding="utf-8")
    (tmp_path / "r.csv").write_text(text.replace('{"gearlib result": 1', '{"gearlib result": 2'), encoding="utf-8")
    with pytest.raises(FileError, match="written by a later gearlib"):
        gl.load_result(tmp_path / "r.csv")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_was_there_stays_until_all_is_written(
    suffix: str, saved: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"r{suffix}"
    run().save(path, names=["load.w"])

    usual = FORMATS[suffix]

    def half(record: Record, beside: Path) -> None:
        usual.write(record, beside)
        assert path.exists()
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(formats.FORMATS, suffix, Format(half, usual.read))
    with pytest.raises(FileError, match=rf"r\{suffix} cannot be written: No space left on device"):
        run().save(path)
    assert gl.load_result(path).keys() == ["load.w"]
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    monkeypatch.undo()
    run().save(path, names=["load.phi"])  # a folder replaces a folder, too
    assert gl.load_result(path).keys() == ["load.phi"]
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_places_where_nothing_can_be_written(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"there is no folder .*nowhere"):
        run().save(tmp_path / "nowhere" / "r.mat")
    (tmp_path / "folder.mat").mkdir()
    with pytest.raises(FileError, match=r"folder\.mat cannot be written: it is a folder"):
        run().save(tmp_path / "folder.mat")
    with pytest.raises(ArgumentError, match=r"suffix '\.xls'; expected \.mat, \.csv, \.nc, \.zarr, \.parquet"):
        run().save(tmp_path / "r.xls")
    with pytest.raises(ArgumentError, match=r"path is 3; expected the path of a file"):
        run().save(3)  # type: ignore[arg-type]


# ---------------------------------------------------------------- what others wrote


def test_a_file_of_openmodelica_is_read(saved: Path, tmp_path: Path) -> None:
    """As it writes them: no matrix of ours, signed aliases, constants in the first block, unit and displayUnit in the text."""
    from scipy.io import savemat

    def characters(lines: list[str]) -> Any:
        width = max(map(len, lines))
        return np.array([list(line.ljust(width)) for line in lines]).astype("S1")

    names = ["time", "J.w", "J.w_back", "J.J", "J.minus", "clock", "left"]
    content = {
        "Aclass": characters(["Atrajectory", "1.1", "", "binTrans"]),
        "name": characters(names).T,
        "description": characters(
            [
                "Simulation time [s]",
                "speed [rad/s|rpm]",
                "[rad/s]",
                "inertia [kg.m2]",
                "no unit",
                "time [s]",
                "time to zero [s]",
            ]
        ).T,
        "dataInfo": np.array(
            [[0, 1, 0, -1], [2, 2, 0, -1], [2, -2, 0, -1], [1, 2, 0, -1], [1, -2, 0, -1], [2, 1, 0, -1], [2, -1, 0, -1]],
            np.int32,
        ).T,
        "data_1": np.array([[0.0, 2.5], [1.0, 2.5]]).T,
        "data_2": np.array([[0.0, 0.5, 1.0], [3.0, 4.0, 5.0]]),
    }
    with (tmp_path / "om.mat").open("wb") as file:
        savemat(file, content, format="4")
    found = gl.load_result(tmp_path / "om.mat")
    assert found.keys() == ["J.w", "J.w_back", "clock", "left"]
    assert found["J.w_back"] == pytest.approx([-3.0, -4.0, -5.0])
    assert [found.unit(name) for name in found] == ["rad/s", "rad/s", "s", "s"]
    assert found.record().descriptions == ("speed", "", "time", "time to zero")
    assert found.parameters == {"J.J": 2.5, "J.minus": -2.5}
    assert found.at(0.25) == {"J.w": 3.5, "J.w_back": -3.5, "clock": 0.25, "left": -0.25}  # the time may have aliases, too


# ---------------------------------------------------------------- the result from a file


def test_what_a_result_from_a_file_can_do(saved: Path) -> None:
    found = gl.load_result(saved / "r.mat")
    assert repr(found) == f"<Result: 41 samples, 0 .. 2 s, {len(found)} variables of Drive, rk5>"
    assert len(found) == len(found.keys()) == len(dict(found.items()))
    assert found.to_dataframe(["load.w"])["load.w"].to_numpy() == pytest.approx(run()["load.w"])
    assert found.to_xarray(["load.w"])["load.w"].attrs["units"] == "rad/s"
    assert "rad/s" in found.plot("load.w").get_ylabel()
    spectrum, expected = (gl.order_spectrum(r, "load.w", "motor.phi", t_start=0.5) for r in (found, run()))
    assert np.array_equal(spectrum.amplitudes, expected.amplitudes)
    assert "load.w" in found
    assert "typo" not in found


def test_what_a_result_from_a_file_refuses(saved: Path) -> None:
    found = gl.load_result(saved / "r.mat")
    with pytest.raises(NameLookupError, match=r"the file holds no variable 'load\.ww'; did you mean 'load\.w'"):
        found["load.ww"]
    with pytest.raises(ArgumentError, match=r"result\[3\]: expected one name"):
        found[3]  # type: ignore[index]
    with pytest.raises(ArgumentError, match="t is 3 s; the run goes from 0 to 2 s"):
        found.at(3.0)
    with pytest.raises(ArgumentError, match="a result that was read from a file has no model"):
        found.energy_balance()
    for start in (found, (found, 1.0)):
        with pytest.raises(ArgumentError, match="start is a result from a file, which does not hold all of the run's state"):
            system().simulate(3.0, start=start)  # type: ignore[arg-type]


def test_only_text_in_utf_8_is_written_whatever_the_locale(tmp_path: Path) -> None:
    code = (
        "import sys, numpy as np; from pathlib import Path; from gearlib.files.contents import Record; "
        "from gearlib.files.formats import save_record, load_record; from gearlib.files.parameter_sets import *; "
        "r = Record(np.zeros(1), np.ones((1, 1)), ('ω',), (0,), (1,), ('rad/s',), ('Дрель',)); p = Path(sys.argv[1]); "
        "[save_record(r, p / f'r{s}') or load_record(p / f'r{s}') for s in ('.csv', '.mat', '.nc')]; "
        "[save_parameters(p / f'p{s}', {'ω': 1.5}) or load_parameters(p / f'p{s}') for s in ('.csv', '.toml', '.ssv')]"
    )
    (tmp_path / "script.py").write_text(code, encoding="utf-8")
    options = ["-S", "-X", "warn_default_encoding", "-W", "error::EncodingWarning", "-X", "utf8=0"]
    done = subprocess.run(
        [sys.executable, *options, str(tmp_path / "script.py"), str(tmp_path)],
        check=False,
        capture_output=True,
        env={
            **os.environ,
            "LC_ALL": "C",
            "PYTHONPATH": os.pathsep.join(sys.path),
        },  # -S: site reads no path in another encoding
    )
    assert done.returncode == 0, done.stderr.decode()
    with (tmp_path / "r.csv").open(encoding="utf-8", newline="") as file:
        file.readline()
        assert next(csv.reader(file)) == ["time", "ω"]


def test_checksum_is_that_of_the_numbers_row_by_row() -> None:
    """So that any program can tell whether a file is whole: times, then samples, in little-endian doubles."""
    data = np.arange(6.0).reshape(3, 2)
    for given in (data, np.asfortranarray(data), np.repeat(data, 2, axis=1)[:, ::2]):
        found = Record(np.array([0.0, 0.5, 1.0]), given, ("a", "b"), (0, 1), (1, 1), ("", ""), ("", ""))
        assert found.checksum == zlib.crc32(struct.pack("<9d", 0.0, 0.5, 1.0, *range(6)))


def test_no_warning_is_left_behind(saved: Path, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for suffix in SUFFIXES:
            gl.load_result(saved / f"r{suffix}").save(tmp_path / f"r{suffix}")
