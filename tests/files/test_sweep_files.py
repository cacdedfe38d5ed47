"""Files of sweeps: what is in them as other programs see it, how they are resumed, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import netcdf_file

from gearlib.errors import ArgumentError, FileError
from gearlib.files.sweep_files import PIECE, StoredArray, SweepLayout, create, found_header, layout_of, reopen, sweep_path

SUFFIXES = [".nc", ".zarr"]
COORDINATES: dict[str, Any] = {
    "time": (("time",), np.array([0.0, 0.5, 1.0]), {"units": "s"}),
    "J": (("run",), np.array([1.0, 2.0, 3.0, 4.0]), {"units": "kg.m2", "long_name": "Trägheit"}),
    "shape": (("mode",), np.array(["first", "ω"]), {}),
}
VALUES = {
    "load.w": StoredArray(("time",), (3,), attributes={"units": "rad/s", "long_name": ""}),
    "peak": StoredArray((), ()),
    "matrix": StoredArray(("mode", "time"), (2, 3)),
    "none": StoredArray(("nothing",), (0,)),
}
LAYOUT = SweepLayout(4, VALUES, COORDINATES, {"model": "Drive", "reduce": ["peak"]})


def rows(runs: list[int]) -> dict[str, Any]:
    """Numbers that tell their places."""
    return {
        name: np.array([100.0 * run + np.arange(float(np.prod(v.shape))).reshape(v.shape) for run in runs]).reshape(
            len(runs), *v.shape
        )
        for name, v in VALUES.items()
    }


def seen(path: Path) -> dict[str, tuple[tuple[str, ...], np.ndarray[Any, Any], dict[str, str]]]:
    """What another program sees: dimensions, numbers and attributes of each variable."""
    if path.suffix == ".zarr":
        whole = pytest.importorskip("xarray").open_zarr(path, chunks=None)
        return {str(n): (v.dims, v.to_numpy(), dict(v.attrs)) for n, v in whole.variables.items()}
    with netcdf_file(path, mmap=False) as file:
        assert file.Conventions == b"CF-1.8"
        return {
            n.encode("latin-1").decode(): (
                v.dimensions, v.data.copy(), {k: getattr(v, k).decode() for k in ("units", "long_name") if hasattr(v, k)},
            )
            for n, v in file.variables.items()
        }  # fmt: skip


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_other_programs_see_values_coordinates_and_what_is_missing(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"s{suffix}"
    file = create(path, LAYOUT)
    assert not file.done.any()
    file.write(np.array([2, 0]), rows([2, 0]), {})
    file.write(np.array([3]), rows([3]), {})
    assert list(file.done) == [True, False, True, True]
    found = seen(path)
    expected = rows([0, 1, 2, 3])
    assert file.read("none").shape == (4, 0)
    for name, v in VALUES.items():
        if name not in found:
            assert (name, suffix) == ("none", ".nc"), "netCDF 3 has no empty arrays"
            continue
        dimensions, numbers, attributes = found[name]
        assert dimensions == ("run", *v.dimensions)
        assert numbers[[0, 2, 3]] == pytest.approx(expected[name][[0, 2, 3]])
        assert np.isnan(numbers[1]).all()
        assert {k: t for k, t in attributes.items() if t} == {k: t for k, t in v.attributes.items() if t}
        assert file.read(name)[[0, 2, 3]] == pytest.approx(expected[name][[0, 2, 3]])
        assert np.isnan(file.read(name)[1]).all()
    assert list(found["gearlib_done"][1]) == [1, 0, 1, 1]
    for name, (axes, numbers, attributes) in COORDINATES.items():
        dimensions, there, said = found[name]
        if name == "shape" and suffix == ".nc":
            assert dimensions == ("mode", "shape_length")
            assert [b"".join(row).rstrip(b"\0").decode() for row in there] == ["first", "ω"]
            continue
        assert (dimensions, said) == (axes, attributes)
        assert list(there) == list(numbers)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_files_are_resumed_as_they_were_left(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"s{suffix}"
    assert found_header(path) is None
    create(path, LAYOUT).write(np.array([1, 2]), rows([1, 2]), {2: ("SolverError", "step 3")})
    header = found_header(path)
    assert header is not None
    assert (header["model"], header["reduce"], header["runs"]) == ("Drive", ["peak"], 4)
    layout = layout_of(header, COORDINATES)
    assert (layout.runs, layout.attributes, dict(layout.values)) == (4, LAYOUT.attributes, VALUES)
    assert layout.header == LAYOUT.header
    again = reopen(path, layout)
    assert list(again.done) == [False, True, True, False]
    assert again.failures() == {2: ("SolverError", "step 3")}
    again.write(np.array([0]), rows([0]), {0: ("SolverError", "step 5")})
    with again.failures_path.open("a", encoding="utf-8") as file:
        file.write('[3, "SolverError", "not done"]\n[1, "Sol')  # a run that was not written, and a line cut off
    assert reopen(path, layout).failures() == {0: ("SolverError", "step 5"), 2: ("SolverError", "step 3")}
    assert reopen(path, layout).read("peak")[:3] == pytest.approx([0.0, 100.0, 200.0])
    assert create(path, LAYOUT).failures() == {}, "a new file has no failures of an old one"
    assert not reopen(path, layout).done.any()


def test_numbers_in_netcdf_begin_at_whole_doubles(tmp_path: Path) -> None:
    """So that programs can map them as they are, behind names and marks of any length."""
    path = tmp_path / "s.nc"
    for runs in (1, 3, 4):
        coordinates = {**COORDINATES, "J": (("run",), np.arange(float(runs)), {})}
        create(path, SweepLayout(runs, VALUES, coordinates, {}))
        with netcdf_file(path, mmap=True) as file:  # whose pages begin at multiples of 4096
            begins = {name: variable.data.ctypes.data % 4096 for name, variable in file.variables.items()}
        assert len(set(begins.values())) == len(COORDINATES) + len(VALUES)  # the empty one is left out, the marks are added
        assert all(begin % 8 == 0 for begin in begins.values()), begins


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_no_run_and_failures_only(suffix: str, tmp_path: Path) -> None:
    file = create(tmp_path / f"s{suffix}", LAYOUT)
    file.write(np.array([], int), {}, {1: ("SolverError", "early")})
    assert not file.done.any()
    assert file.failures() == {}
    assert file.failures_path.name == f"s{suffix}.failures"


def test_runs_of_a_zarr_file_are_written_by_chunks_of_some_megabytes(tmp_path: Path) -> None:
    """As many runs as fit, of the array with the largest rows; complex numbers take 16 bytes."""
    for kind, size, number in (("f8", PIECE // 8 // 3, 8), ("c16", PIECE // 16 // 4, 16)):
        long = {"x": StoredArray(("t",), (size,), kind), "y": StoredArray((), ())}
        file = create(tmp_path / f"{kind}.zarr", SweepLayout(5, long, {}, {}))
        assert file.batch == PIECE // (size * number)
        assert np.isnan(file.read("x")[0, 0])
    assert create(tmp_path / "few.zarr", SweepLayout(2, {"y": StoredArray((), ())}, {}, {})).batch == 2
    huge = {"x": StoredArray(("t",), (PIECE,))}
    assert create(tmp_path / "huge.zarr", SweepLayout(3, huge, {}, {})).batch == 1
    assert create(tmp_path / "s.nc", LAYOUT).batch == 1


def test_what_netcdf_cannot_hold(tmp_path: Path) -> None:
    def made(name: str, shape: tuple[int, ...], kind: str = "f8", runs: int = 1) -> Any:
        return create(tmp_path / "s.nc", SweepLayout(runs, {name: StoredArray(("t",), shape, kind)}, {}, {}))

    end = "; give a path that ends in .zarr"
    for arguments, said in (
        (("z", (1,), "c16"), "to: z is complex, which netCDF cannot hold" + end),
        (("a/b", (1,)), "to: netCDF has no variable of the name 'a/b'" + end),
        (("z", (500_000_001,)), "to: z takes more than 4 GB, which netCDF cannot hold" + end),
        (("z", (1000,), "f8", 500_001), "to: z takes more than 4 GB, which netCDF cannot hold" + end),
    ):
        with pytest.raises(ArgumentError) as problem:
            made(*arguments)
        assert str(problem.value) == said
    assert list(tmp_path.iterdir()) == []


def test_files_that_are_cut_off_or_of_another_kind(tmp_path: Path) -> None:
    path = tmp_path / "s.nc"
    create(path, LAYOUT)
    size = path.stat().st_size
    assert size % 8 == 0
    with path.open("r+b") as file:
        file.truncate(size - 1)
    with pytest.raises(FileError, match=rf"s\.nc is truncated: it has {size - 1} of {size} bytes; remove it, and begin again"):
        reopen(path, LAYOUT)
    for name in ("x.nc", "x.zarr"):
        (tmp_path / name).write_text("else", encoding="utf-8")
        with pytest.raises(FileError, match=f"{name} is there and is not a file of a sweep; give another path, or remove it"):
            found_header(tmp_path / name)


@pytest.mark.parametrize("path", ["s.csv", "s", 3])
def test_paths_of_sweeps(path: Any) -> None:
    assert sweep_path("a/B.ZARR") == Path("a/B.ZARR")
    with pytest.raises(ArgumentError, match=r"to is .*; expected (a path that ends in .zarr or .nc|the path of a file)"):
        sweep_path(path)
