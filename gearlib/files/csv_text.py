"""Result files as comma-separated values: a comment with the provenance, a header line, one line per sample."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TextIO

import numpy as np

from gearlib.files.contents import Record, damaged, foreign_file, from_header

MARK = "# gearlib "


def write(record: Record, path: Path) -> None:
    """Write a record in UTF-8, with numbers at full precision and a decimal point in any locale."""
    spread = record.spread
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{MARK}{spread.header()}\n")
        write_columns(spread, file)


def write_columns(record: Record, file: TextIO) -> None:
    """Write the header line and the samples to an open file."""
    spread = record.spread
    csv.writer(file, lineterminator="\n").writerow(["time", *spread.names])
    rows = np.column_stack([spread.time, spread.data]).tolist()
    for row in rows:
        file.write(",".join(map(repr, row)) + "\n")


def read(path: Path) -> Record:
    """Read a record."""
    with path.open(encoding="utf-8", newline="") as file:
        try:
            text = file.read()
        except UnicodeDecodeError:
            raise foreign_file(path) from None
    if not text.startswith(MARK):
        raise foreign_file(path)
    header, _, rest = text.partition("\n")
    if not rest.endswith("\n"):
        raise damaged(path, "its last line has no end")
    try:
        rows = np.loadtxt(io.StringIO(rest.partition("\n")[2]), delimiter=",", comments=None, ndmin=2)
    except ValueError as problem:
        raise damaged(path, str(problem)) from None
    return from_header(header.removeprefix(MARK), rows[:, 0], rows[:, 1:], path)
