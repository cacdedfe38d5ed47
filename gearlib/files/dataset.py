"""Conversion of a record to `xarray.Dataset`, and zarr files through xarray: one variable per history over time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gearlib.errors import ArgumentError, FileError
from gearlib.files.contents import Record, damaged, foreign_file, from_header
from gearlib.optional import optional

if TYPE_CHECKING:
    import xarray

HEADER = "gearlib_header"  # the variable with the provenance


def dataset(record: Record) -> xarray.Dataset:
    """A record as an `xarray.Dataset`: units and descriptions are attributes of variables, the provenance is a variable."""
    made, spread = optional("xarray").Dataset, record.spread
    if taken := {"time", HEADER} & set(record.names):
        raise ArgumentError(
            f"a variable of the model is called {taken.pop()}, which the file format reserves; leave it out of names"
        )
    variables = {
        name: ("time", spread.data[:, i], {"units": spread.units[i], "long_name": spread.descriptions[i]})
        for i, name in enumerate(spread.names)
    }
    attributes = {"model": record.model, "method": str(record.stats.get("method", "")), **record.versions}
    found: xarray.Dataset = made(variables, {"time": ("time", spread.time, {"units": "s", "long_name": "time"})}, attributes)
    return found


def write(record: Record, path: Path) -> None:
    """Write a record as a folder in zarr format 2."""
    optional("zarr")
    dataset(record).assign({HEADER: ((), record.spread.header())}).to_zarr(path, zarr_format=2)


def read(path: Path) -> Record:
    """Read a record."""
    _, xarray = optional("zarr"), optional("xarray")
    if not (path / ".zgroup").exists():
        raise foreign_file(path)
    try:
        with xarray.open_zarr(path, decode_times=False, chunks=None) as found:
            if HEADER not in found:
                raise foreign_file(path)
            columns = {str(name): found[name].to_numpy() for name in found.variables}
    except FileError:
        raise
    except Exception as problem:  # whatever the library raises for missing files
        raise damaged(path, f"{type(problem).__name__}: {problem}") from None
    return from_header(str(columns.pop(HEADER)), columns.pop("time"), columns, path)
