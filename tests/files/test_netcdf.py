"""Result files in netCDF, as another program reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import netcdf_file

from gearlib.errors import ArgumentError, FileError
from gearlib.files import netcdf
from gearlib.files.contents import Record

TIME = np.array([0.0, 0.5, 2.0])
DATA = np.array([[1.0, -2.0], [3.0, np.nan], [5.0, 1e300]])


def record(last: str = "ω") -> Record:
    return Record(
        TIME, DATA, ("a.w", "b", last), (0, 1, 0), (1, 1, -1), ("rad/s", "", "1"), ("speed of a", "", "Дрель"), model="Räder"
    )


def test_every_name_has_its_history_and_what_is_known_of_it(tmp_path: Path) -> None:
    """Neither a unit nor a description where there is none."""
    netcdf.write(record(), tmp_path / "r.nc")
    with netcdf_file(tmp_path / "r.nc", "r", mmap=False) as file:
        assert (file.Conventions, file.model.decode()) == (b"CF-1.8", "Räder")
        assert file.dimensions == {"time": 3}
        found = {name.encode("latin-1").decode(): v for name, v in file.variables.items()}
        assert {name: v.data.tolist() for name, v in found.items() if name != "b"} == {
            "time": TIME.tolist(), "a.w": [1.0, 3.0, 5.0], "ω": [-1.0, -3.0, -5.0],
        }  # fmt: skip
        assert np.array_equal(found["b"].data, DATA[:, 1], equal_nan=True)
        told = {
            name: tuple(v._attributes[key].decode() for key in ("units", "long_name") if key in v._attributes)
            for name, v in found.items()
        }
        assert told == {"time": ("s", "time"), "a.w": ("rad/s", "speed of a"), "b": (), "ω": ("1", "Дрель")}
        assert {v.dimensions for v in found.values()} == {("time",)}


def test_what_is_written_is_read(tmp_path: Path) -> None:
    netcdf.write(record(), tmp_path / "r.nc")
    found = netcdf.read(tmp_path / "r.nc")
    assert (found.names, found.units, found.descriptions, found.model) == (
        ("a.w", "b", "ω"), ("rad/s", "", "1"), ("speed of a", "", "Дрель"), "Räder",
    )  # fmt: skip
    assert found.time.tolist() == TIME.tolist()
    for name in found.names:
        assert np.array_equal(found.history(name), record().history(name), equal_nan=True)


@pytest.mark.parametrize("name", ["time", "a/b"])
def test_names_that_the_format_does_not_have_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=f"netCDF has no variable of the name '{name}'; leave it out of names"):
        netcdf.write(record(name), tmp_path / "r.nc")
    assert not (tmp_path / "r.nc").exists()


def test_other_files_are_told_from_damaged_ones(tmp_path: Path) -> None:
    path = tmp_path / "r.nc"
    netcdf.write(record(), path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileError, match=r"r\.nc"):
        netcdf.read(path)
    path.write_bytes(b"HDF" + whole[3:])
    with pytest.raises(FileError, match="is not a result file of gearlib"):
        netcdf.read(path)
    with netcdf_file(path, "w") as file:
        file.createDimension("time", 1)
    with pytest.raises(FileError, match="is not a result file of gearlib"):
        netcdf.read(path)
    with netcdf_file(path, "w") as file:
        file.gearlib_header = record().header().encode()
    with pytest.raises(FileError, match="it has no time"):
        netcdf.read(path)
