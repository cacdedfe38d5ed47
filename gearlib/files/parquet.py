"""Result files as Apache Parquet: one column per history, with its unit and description, and the provenance."""

from __future__ import annotations

from pathlib import Path

from gearlib.errors import FileError
from gearlib.files.contents import Record, damaged, foreign_file, from_header
from gearlib.optional import optional

HEADER = b"gearlib"  # key in the metadata of the schema
MAGIC = b"PAR1"


def write(record: Record, path: Path) -> None:
    """Write a record, using pyarrow."""
    pyarrow, parquet, spread = optional("pyarrow"), optional("pyarrow.parquet"), record.spread
    names = ["time", *spread.names]
    headings = [("s", "time"), *zip(spread.units, spread.descriptions, strict=True)]
    fields = [
        pyarrow.field(name, pyarrow.float64(), metadata={"units": unit, "description": description})
        for name, (unit, description) in zip(names, headings, strict=True)
    ]
    columns = [pyarrow.array(column) for column in (spread.time, *spread.data.T)]
    schema = pyarrow.schema(fields, metadata={HEADER: spread.header()})
    parquet.write_table(pyarrow.Table.from_arrays(columns, schema=schema), path)


def read(path: Path) -> Record:
    """Read a record."""
    parquet = optional("pyarrow.parquet")
    with path.open("rb") as file:
        if file.read(4) != MAGIC:
            raise foreign_file(path)
    try:
        with path.open("rb") as file:
            table = parquet.read_table(file)
        header = (table.schema.metadata or {}).get(HEADER)
        if header is None:
            raise foreign_file(path)
        time, *histories = (column.to_numpy() for column in table.columns)
    except FileError:
        raise
    except Exception as problem:  # whatever the library raises for missing bytes
        raise damaged(path, f"{type(problem).__name__}: {problem}") from None
    return from_header(header, time, dict(zip(table.column_names[1:], histories, strict=True)), path)
