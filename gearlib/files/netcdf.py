"""Result files in netCDF 3 with 64-bit offsets, readable by every netCDF library: one variable per history over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gearlib.errors import ArgumentError, FileError
from gearlib.files.contents import Record, damaged, foreign_file, from_header

HEADER = "gearlib_header"  # the attribute with the provenance
MAGIC = b"CDF"


def write(record: Record, path: Path) -> None:
    """Write a record."""
    from scipy.io import netcdf_file

    spread = record.spread
    if wrong := [name for name in spread.names if name == "time" or "/" in name]:
        raise ArgumentError(f"netCDF has no variable of the name {wrong[0]!r}; leave it out of names, or choose another format")
    file = netcdf_file(path, "w", version=2)
    try:
        file.Conventions, file.model, file.gearlib_header = b"CF-1.8", spread.model.encode(), spread.header().encode()
        file.createDimension("time", len(spread.time))
        headings = zip(["time", *spread.names], ["s", *spread.units], ["time", *spread.descriptions], strict=True)
        for (name, unit, description), history in zip(headings, (spread.time, *spread.data.T), strict=True):
            # The library writes one byte per character
            variable = file.createVariable(name.encode().decode("latin-1"), "d", ("time",))
            variable[:] = history
            if unit:
                variable.units = unit.encode()
            if description:
                variable.long_name = description.encode()
    finally:
        file.close()


def read(path: Path) -> Record:
    """Read a record."""
    from scipy.io import netcdf_file

    with path.open("rb") as raw:
        if raw.read(3) != MAGIC:
            raise foreign_file(path)
    try:
        with netcdf_file(path, "r", mmap=False) as file:
            header = getattr(file, HEADER, None)
            if header is None:
                raise foreign_file(path)
            columns = {n.encode("latin-1").decode(): np.array(v.data, float) for n, v in file.variables.items()}
    except FileError:
        raise
    except Exception as problem:  # whatever the library raises for missing bytes
        raise damaged(path, f"{type(problem).__name__}: {problem}") from None
    if "time" not in columns:
        raise damaged(path, "it has no time")
    return from_header(header, columns.pop("time"), columns, path)
