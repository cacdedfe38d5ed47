"""Result file formats, selected by suffix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gearlib.errors import FileError
from gearlib.files import csv_text, dataset, mat, netcdf, parquet
from gearlib.files.contents import Record, by_suffix
from gearlib.files.replacing import replacing


@dataclass(frozen=True)
class Format:
    """Writer and reader of a format."""

    write: Callable[[Record, Path], None]
    read: Callable[[Path], Record]


FORMATS = {
    ".mat": Format(mat.write, mat.read),
    ".csv": Format(csv_text.write, csv_text.read),
    ".nc": Format(netcdf.write, netcdf.read),
    ".zarr": Format(dataset.write, dataset.read),
    ".parquet": Format(parquet.write, parquet.read),
}


def format_of(path: Path) -> Format:
    """The format of a result file; `ArgumentError` if the suffix selects none."""
    return by_suffix(path, FORMATS)


def save_record(record: Record, path: Path) -> None:
    """Write a record in the format selected by the suffix; an existing file is replaced atomically.

    Raises
    ------
    ArgumentError
        No format has that suffix.
    FileError
        The file cannot be written.
    """
    form = format_of(path)
    with replacing(path) as beside:
        form.write(record, beside)


def load_record(path: Path) -> Record:
    """Read a record.

    Raises
    ------
    ArgumentError
        No format has that suffix.
    FileError
        The file does not exist, or is of another kind, truncated or damaged.
    """
    form = format_of(path)
    try:
        return form.read(path)
    except OSError as problem:
        raise FileError(f"{path} cannot be read: {problem.strerror or problem}") from None
