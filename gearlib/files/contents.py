"""`Record`: histories with their provenance, the content of every result file."""

from __future__ import annotations

import json
import platform
import sys
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError, FileError

Floats = NDArray[np.float64]
Kind = TypeVar("Kind")
KIND = "gearlib result"
VERSION = 1  # of the header; files of a later version are refused
COMPUTING = ("numpy", "scipy", "llvmlite", "sksundae")


def versions() -> dict[str, str]:
    """Versions of gearlib, Python and the numerical packages in use."""
    used = {name: sys.modules[name] for name in ("gearlib", *COMPUTING) if name in sys.modules}
    return {"python": platform.python_version(), **{name: str(module.__version__) for name, module in used.items()}}


@dataclass(frozen=True, eq=False)
class Record:
    """Histories with their provenance.

    Attributes
    ----------
    time : array, shape (samples,)
        s.
    data : array, shape (samples, columns)
        Distinct histories.
    names : tuple of str
        Variables.
    columns, signs : tuple of int
        For each name, the column of ``data`` that holds its history, and its sign (+1 or -1).
    units, descriptions : tuple of str
        For each name.
    model : str
        Class name of the model; "" if unknown.
    parameters : mapping
        Value of every parameter, by path.
    stats : mapping
        Solver statistics.
    events : sequence of (float, str)
        Times and locations.
    options : mapping
        Tolerances and other settings of the run.
    versions : mapping
        Versions of gearlib and of the packages that computed the histories.
    """

    time: Floats
    data: Floats
    names: tuple[str, ...]
    columns: tuple[int, ...]
    signs: tuple[int, ...]
    units: tuple[str, ...]
    descriptions: tuple[str, ...]
    model: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    stats: Mapping[str, Any] = field(default_factory=dict)
    events: Sequence[tuple[float, str]] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def place(self) -> dict[str, int]:
        """Index of each name."""
        return {name: i for i, name in enumerate(self.names)}

    def history(self, name: str) -> Floats:
        """History of a variable."""
        i = self.place[name]
        history: Floats = self.signs[i] * self.data[:, self.columns[i]]
        return history

    @cached_property
    def spread(self) -> Record:
        """The same with a separate column per name, for formats without aliases."""
        data = np.ascontiguousarray(self.data[:, list(self.columns)] * np.array(self.signs, float))
        return replace(self, data=data, columns=tuple(range(len(self.names))), signs=(1,) * len(self.names))

    @property
    def checksum(self) -> int:
        """CRC-32 of times and histories."""
        found = 0
        for values in (self.time, self.data):
            found = zlib.crc32(np.ascontiguousarray(values, "<f8").ravel().data, found)  # row by row, not copied
        return found

    def header(self) -> str:
        """Everything but the numbers, as one line of ASCII (JSON with NaN and Infinity for values that are not finite).

        Examples
        --------
        >>> record = Record(np.array([0.0, 1.0]), np.array([[2.0], [3.0]]), ("w",), (0,), (1,), ("rad/s",), ("speed",))
        >>> from_header(record.header(), record.time, record.data, "r.csv").units
        ('rad/s',)
        """
        names = (
            "names", "columns", "signs", "units", "descriptions", "model", "parameters", "stats", "events", "options", "versions",
        )  # fmt: skip
        content = {KIND: VERSION} | {name: getattr(self, name) for name in names}
        return json.dumps(content | {"samples": len(self.time), "checksum": self.checksum}, default=_plain)


def _plain(value: Any) -> Any:
    """Convert numpy numbers and other values to JSON types."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else str(value)


def from_header(header: str | bytes, time: Any, data: Any, path: Any) -> Record:
    """Reconstruct a record from its `Record.header` and its numbers: the original columns, or histories by name.

    Raises
    ------
    FileError
        The header was not written by gearlib, or the numbers do not belong to it.
    """
    try:
        found = json.loads(header)
        later = found[KIND] > VERSION
    except (ValueError, KeyError, TypeError):
        raise foreign_file(path) from None
    if later:
        raise FileError(f"{path} was written by a later gearlib, {found.get('versions')}; this one cannot read it")
    try:
        if isinstance(data, Mapping):
            data = np.array([data[name] for name in found["names"]], float).reshape(-1, len(time)).T
        stats = {k: tuple(v) if isinstance(v, list) else v for k, v in found["stats"].items()}  # JSON has no tuples
        record = Record(
            np.ascontiguousarray(time, float), np.ascontiguousarray(data, float), tuple(found["names"]), tuple(found["columns"]),
            tuple(found["signs"]), tuple(found["units"]), tuple(found["descriptions"]), found["model"], found["parameters"],
            stats, tuple((t, where) for t, where in found["events"]), found["options"], found["versions"],
        )  # fmt: skip
        samples, checksum = found["samples"], found["checksum"]
    except KeyError as problem:
        raise damaged(path, f"it has no {problem.args[0]}") from None
    except (ValueError, TypeError, AttributeError) as problem:
        raise damaged(path, str(problem)) from None
    expected, held = (samples, len(set(record.columns))), record.data.shape
    if held != expected or len(record.time) != samples:
        raise damaged(
            path, f"it holds {len(record.time)} times and data of the shape {held}; expected {samples} and {expected}"
        )
    if record.checksum != checksum:
        raise damaged(path, "its numbers are not those that were written (checksum)")
    return record


def by_suffix(path: Path, formats: Mapping[str, Kind]) -> Kind:
    """The format that a path's suffix selects.

    Raises
    ------
    ArgumentError
        No format has that suffix.
    """
    found = formats.get(path.suffix.lower())
    if found is None:
        raise ArgumentError(f"{path} has the suffix {path.suffix!r}; expected {', '.join(formats)}")
    return found


def foreign_file(path: Any) -> FileError:
    """The error for a file of another kind."""
    return FileError(f"{path} is not a result file of gearlib; expected a file written by result.save(...)")


def damaged(path: Any, why: str) -> FileError:
    """The error for a damaged result file."""
    return FileError(f"{path} is truncated or damaged: {why}")
