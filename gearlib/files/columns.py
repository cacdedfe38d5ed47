"""Named numeric columns read from files of measurements and of other programs."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import FileError, NameLookupError, nearest
from gearlib.files.formats import FORMATS, load_record
from gearlib.optional import optional

Floats = NDArray[np.float64]
SEPARATORS = (";", "\t", ",")  # in order of precedence: a comma may be a decimal sign


def read_columns(path: Path, names: tuple[str, ...]) -> tuple[Floats, ...]:
    """Read some columns of a file.

    Parameters
    ----------
    path : Path
        A result file, any Parquet file, or a text file with a header line and lines of numbers, separated by commas, semicolons (the
        decimal sign may then be a comma), tabs or spaces; lines that begin with "#" are ignored.
    names : tuple of str
        The columns to read.

    Raises
    ------
    FileError
        The file cannot be read, or a field is not a number; the message gives the line.
    NameLookupError
        The file lacks a column.
    """
    try:
        if path.suffix.lower() == ".parquet":
            columns = _parquet_columns(path, names)
        elif path.suffix.lower() in FORMATS and path.suffix.lower() != ".csv":
            record = load_record(path)
            _places(path, names, ["time", *(name for name in record.names if name != "time")])
            columns = {name: record.time if name == "time" else record.history(name) for name in names}
        else:
            columns = _text_columns(path, names)
    except OSError as problem:
        raise FileError(f"{path} cannot be read: {problem.strerror or problem}") from None
    try:
        return tuple(np.asarray(columns[name], float) for name in names)
    except (TypeError, ValueError):
        raise FileError(f"{path} contains something other than numbers in one of the columns {', '.join(names)}") from None


def _places(path: Path, names: tuple[str, ...], there: list[str]) -> dict[str, int]:
    """Index of each column."""
    for name in names:
        if name not in there:
            raise NameLookupError(f"{path} has no column '{name}'; {nearest(name, there)}")
        if (count := there.count(name)) > 1:
            raise FileError(f"{path} has {count} columns '{name}'; expected one")
    return {name: there.index(name) for name in names}


def _parquet_columns(path: Path, names: tuple[str, ...]) -> dict[str, Any]:
    parquet = optional("pyarrow.parquet")
    try:
        table = parquet.read_table(path)
        there = table.column_names
    except OSError:
        raise
    except Exception as problem:  # whatever the library raises for other bytes
        raise FileError(f"{path} cannot be read: {problem}") from None
    return {name: table.column(place).to_numpy() for name, place in _places(path, names, there).items()}


def _text_columns(path: Path, names: tuple[str, ...]) -> dict[str, list[float]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise FileError(f"{path} is not UTF-8 text") from None
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise FileError(f"{path} is empty; expected a line of names and lines of numbers")
    separator = next((s for s in SEPARATORS if s in lines[0][1]), " ")
    rows = csv.reader(io.StringIO("\n".join(line for _, line in lines)), delimiter=separator, skipinitialspace=True)
    try:
        head, *body = ((lines[rows.line_num - 1], [field.strip() for field in row]) for row in rows)
    except csv.Error as problem:
        raise FileError(f"{path} cannot be read: {problem}") from None
    places = _places(path, names, head[1])
    columns: dict[str, list[float]] = {name: [] for name in names}
    for (number, line), row in body:
        if any(row[len(head[1]) :]):
            raise FileError(
                f"{path}, line {number}: {len(row)} fields in {len(head[1])} columns; expected a point as the decimal sign, or "
                f"semicolons between the columns: {line.strip()[:80]}"
            )
        for name, place in places.items():
            field = row[place] if place < len(row) else ""
            try:
                columns[name].append(float(field.replace(",", ".") if separator == ";" else field))
            except ValueError:
                said = f"{field!r} in the column {name}" if field else f"nothing in the column {name}"
                raise FileError(f"{path}, line {number}: {said}; expected a number: {line.strip()[:80]}") from None
    return columns
