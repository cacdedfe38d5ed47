"""`Record`: histories and what made them, as every result file holds them."""

from __future__ import annotations

import json
import platform
import sys
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import FileError

Floats = NDArray[np.float64]
KIND = "gearlib result"
VERSION = 1  # of the header; files of a later one are refused


COMPUTING = ("numpy", "scipy", "llvmlite", "sksundae")


def versions() -> dict[str, str]:
    """Of gearlib, Python and the packages in use that compute."""
    used = {name: sys.modules[name] for name in ("gearlib", *COMPUTING) if name in sys.modules}
    return {"python": platform.python_version(), **{name: str(module.__version__) for name, module in used.items()}}


@dataclass(frozen=True, eq=False)
class Record:
    """Histories, and what made them.

    Attributes
    ----------
    time : array, shape (samples,)
        s.
    data : array, shape (samples, columns)
        Distinct histories.
    names : tuple of str
        Variables.
    columns, signs : tuple of int
        For each name the column of ``data`` that holds its history, and +1 or -1, which it is multiplied by.
    units, descriptions : tuple of str
        For each name.
    model : str
        Name of the model's class; "" where it is not known.
    parameters : mapping
        Value of every parameter, by path.
    stats : mapping
        What the solver did.
    events : sequence of (float, str)
        When, and where.
    options : mapping
        Tolerances and other settings of the run.
    versions : mapping
        Of gearlib and of the packages that computed the histories.
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
        """Where each name stands."""
        return {name: i for i, name in enumerate(self.names)}

    def history(self, name: str) -> Floats:
        """The history of a variable."""
        i = self.place[name]
        history: Floats = self.signs[i] * self.data[:, self.columns[i]]
        return history

    @cached_property
    def spread(self) -> Record:
        """The same with a column of its own for each name, for formats that know no aliases."""
        data = np.ascontiguousarray(self.data[:, list(self.columns)] * np.array(self.signs, float))
        return replace(self, data=data, columns=tuple(range(len(self.names))), signs=(1,) * len(self.names))

    @property
    def checksum(self) -> int:
        """CRC-32 of times and histories."""
        return zlib.crc32(self.data.astype("<f8").tobytes(), zlib.crc32(self.time.astype("<f8").tobytes()))

    def header(self) -> str:
        """Everything but the numbers, as one line of ASCII (JSON; values that are not finite as NaN and Infinity).

        Examples
        --------
        >>> record = Record(np.array([0.0, 1.0]), np.array([[2.0], [3.0]]), ("w",), (0,), (1,), ("rad/s",), ("speed",))
        >>> from_header(record.header(), record.time, record.data, "r.csv").units
        ('rad/s',)
        """
        names = (
            "names",
            "columns",
            "signs",
            "units",
            "descriptions",
            "model",
            "parameters",
            "stats",
            "events",
            "options",
            "versions",
        )
        content = {KIND: VERSION} | {name: getattr(self, name) for name in names}
        return json.dumps(content | {"samples": len(self.time), "checksum": self.checksum}, default=_plain)


def _plain(value: Any) -> Any:
    """What JSON knows, of numpy's numbers and of what else a run may tell."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else str(value)


def from_header(header: str, time: Any, data: Any, path: Any) -> Record:
    """A record from its `Record.header` and its numbers: an array with the columns as they were, or histories by name.

    Raises
    ------
    FileError
        The header is none of gearlib's, or the numbers are not those that were written with it.
    """
    try:
        found = json.loads(header)
        later = found[KIND] > VERSION
    except (ValueError, KeyError, TypeError):
        raise not_ours(path) from None
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
    if record.data.shape != (samples, len(set(record.columns))) or len(record.time) != samples:
        raise damaged(path, f"it holds {len(record.time)} of {samples} samples")
    if record.checksum != checksum:
        raise damaged(path, "its numbers are not those that were written (checksum)")
    return record


def not_ours(path: Any) -> FileError:
    """A file of another kind."""
    return FileError(f"{path} is no result file of gearlib; expected what result.save(...) wrote")


def damaged(path: Any, why: str) -> FileError:
    """A file that was a result once."""
    return FileError(f"{path} is cut off or damaged: {why}")
