"""Files of sweeps, written as runs come in and resumable after an interrupt: zarr and netCDF.

Every value is an array whose first axis is the run. A run counts as done once its numbers are written: a crash in between costs that
run only. Failures are stored in a separate file, ``sweep.zarr.failures``, one line of JSON per run.
"""

from __future__ import annotations

import json
import struct
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import as_path, shown
from gearlib.errors import ArgumentError, FileError
from gearlib.files.replacing import replacing
from gearlib.optional import optional

Integers = NDArray[np.int64]
HEADER = "gearlib_sweep"  # the attribute that identifies the sweep
DONE = "gearlib_done"  # 1 for each run that is done
RUN = "run"
ROOM = 4_000_000_000  # bytes of a variable; netCDF with 64-bit offsets permits 2**32 - 4
PIECE = 4_000_000  # bytes of a chunk of a zarr array


@dataclass(frozen=True)
class StoredArray:
    """An array in a file: names and lengths of its axes, data type, and attributes."""

    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    kind: str = "f8"  # or "c16"
    attributes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class SweepLayout:
    """Contents of a file: values with one row per run, coordinates, and the identity of the sweep."""

    runs: int
    values: Mapping[str, StoredArray]
    coordinates: Mapping[str, tuple[tuple[str, ...], Any, Mapping[str, str]]]  # axes, numbers or names, attributes
    attributes: Mapping[str, Any]

    @property
    def header(self) -> str:
        """Attributes and shapes of the values, as one line of JSON."""
        arrays = {name: [v.dimensions, v.shape, v.kind, dict(v.attributes)] for name, v in self.values.items()}
        return json.dumps({**self.attributes, "runs": self.runs, "values": arrays})


class SweepFile(ABC):
    """A file that receives the runs of a sweep.

    Attributes
    ----------
    done : bool array (runs,)
        Which runs it contains.
    batch : int
        Number of runs that are best written together.
    """

    done: NDArray[np.bool_]
    batch = 1

    def __init__(self, path: Path, layout: SweepLayout) -> None:
        self.path, self.layout = path, layout

    @property
    def failures_path(self) -> Path:
        """Path of the file with the failures."""
        return self.path.with_name(self.path.name + ".failures")

    def write(self, runs: Integers, values: Mapping[str, NDArray[Any]], failures: Mapping[int, tuple[str, str]]) -> None:
        """Write some runs and mark them done; ``failures`` are error types and messages by run."""
        if failures:
            with self.failures_path.open("a", encoding="utf-8") as file:
                file.writelines(json.dumps([int(run), *failure]) + "\n" for run, failure in failures.items())
        if len(runs):
            self._write(runs, values)
            self.done[runs] = True

    def failures(self) -> dict[int, tuple[str, str]]:
        """Error types and messages of the failed runs."""
        found: dict[int, tuple[str, str]] = {}
        if self.failures_path.exists():
            for line in self.failures_path.read_text(encoding="utf-8").splitlines():
                try:
                    run, kind, message = json.loads(line)
                except ValueError:
                    continue  # truncated when the process ended
                if self.done[run]:
                    found[run] = kind, message
        return found

    @abstractmethod
    def _write(self, runs: Integers, values: Mapping[str, NDArray[Any]]) -> None: ...

    @abstractmethod
    def read(self, name: str) -> NDArray[Any]:
        """A value of all runs; NaN where a run is not done."""


def sweep_path(path: Any) -> Path:
    """Path of a sweep's file; `ArgumentError` for an unknown suffix."""
    found = as_path("to", path)
    if found.suffix.lower() not in (".zarr", ".nc"):
        raise ArgumentError(f"to is {shown(path)}; expected a path that ends in .zarr or .nc")
    return found


def found_header(path: Path) -> dict[str, Any] | None:
    """Header of an existing file; None if there is none.

    Raises
    ------
    FileError
        Not a file of a sweep.
    """
    if not path.exists():
        return None
    try:
        header = _zarr_header(path) if path.suffix.lower() == ".zarr" else _netcdf_header(path)
        return dict(json.loads(header))
    except Exception:  # whatever a library raises for another file
        raise FileError(f"{path} is there and is not a file of a sweep; give another path, or remove it") from None


def create(path: Path, layout: SweepLayout) -> SweepFile:
    """A new file, with no run done."""
    kind = ZarrFile if path.suffix.lower() == ".zarr" else NetcdfFile
    kind.make(path, layout)
    found: SweepFile = kind(path, layout)
    found.failures_path.unlink(missing_ok=True)
    return found


def reopen(path: Path, layout: SweepLayout) -> SweepFile:
    """An existing file, to be resumed."""
    return ZarrFile(path, layout) if path.suffix.lower() == ".zarr" else NetcdfFile(path, layout)


def layout_of(header: Mapping[str, Any], coordinates: Mapping[str, Any]) -> SweepLayout:
    """The layout of a file, from its header."""
    values = {
        name: StoredArray(tuple(axes), tuple(shape), kind, attributes)
        for name, (axes, shape, kind, attributes) in header["values"].items()
    }
    attributes = {key: value for key, value in header.items() if key not in ("runs", "values")}
    return SweepLayout(int(header["runs"]), values, coordinates, attributes)


# ---------------------------------------------------------------- zarr


class ZarrFile(SweepFile):
    """A folder in zarr format 2, which xarray opens."""

    def __init__(self, path: Path, layout: SweepLayout) -> None:
        super().__init__(path, layout)
        self._group = optional("zarr").open_group(path, mode="r+")
        self.done = np.asarray(self._group[DONE][:], bool)
        self.batch = min(_piece(layout, name) for name in layout.values)

    @staticmethod
    def make(path: Path, layout: SweepLayout) -> None:
        """A new folder, with no run done."""
        zarr = optional("zarr")
        with replacing(path) as beside:
            group = zarr.open_group(beside, mode="w", zarr_format=2)
            group.attrs[HEADER] = layout.header

            def array(name: str, axes: tuple[str, ...], attributes: Mapping[str, str], **more: Any) -> Any:
                return group.create_array(name, attributes={"_ARRAY_DIMENSIONS": list(axes), **attributes}, **more)

            for name, v in layout.values.items():
                shape = (layout.runs, *v.shape)
                chunks = (_piece(layout, name), *(max(1, n) for n in v.shape))
                empty = complex(np.nan, np.nan) if v.kind == "c16" else np.nan
                array(name, (RUN, *v.dimensions), v.attributes, shape=shape, dtype=v.kind, chunks=chunks, fill_value=empty)
            known = {
                name: (axes, np.asarray(numbers), attributes)
                for name, (axes, numbers, attributes) in layout.coordinates.items()
            }
            known[DONE] = ((RUN,), np.zeros(layout.runs, "i1"), {})
            for name, (axes, numbers, attributes) in known.items():  # without a fill value: 0 is a value
                one = tuple(max(1, n) for n in numbers.shape)
                array(name, axes, attributes, shape=numbers.shape, dtype=numbers.dtype, chunks=one, fill_value=None)[...] = (
                    numbers
                )
            zarr.consolidate_metadata(beside)

    def _write(self, runs: Integers, values: Mapping[str, NDArray[Any]]) -> None:
        together = len(runs) == runs[-1] - runs[0] + 1
        for name, rows in values.items():
            if together:
                self._group[name][int(runs[0]) : int(runs[-1]) + 1] = rows
            else:
                self._group[name].oindex[runs] = rows
        marked = self.done.astype("i1")
        marked[runs] = 1
        self._group[DONE][:] = marked

    def read(self, name: str) -> NDArray[Any]:
        return np.asarray(self._group[name][...])


def _piece(layout: SweepLayout, name: str) -> int:
    """Runs per chunk of an array."""
    v = layout.values[name]
    row = (16 if v.kind == "c16" else 8) * max(1, int(np.prod(v.shape)))
    return max(1, min(layout.runs, PIECE // row))


def _zarr_header(path: Path) -> str:
    return str(optional("zarr").open_group(path, mode="r").attrs[HEADER])


# ---------------------------------------------------------------- netCDF


class NetcdfFile(SweepFile):
    """NetCDF 3 with 64-bit offsets, written in place."""

    def __init__(self, path: Path, layout: SweepLayout) -> None:
        super().__init__(path, layout)
        _, places, size = _head(layout)
        if path.stat().st_size < size:
            raise FileError(f"{path} is truncated: it has {path.stat().st_size} of {size} bytes; remove it, and begin again")
        self._places = {
            name: np.memmap(path, _TYPES[kind], "r+", at, shape) if np.prod(shape) else np.empty(shape)
            for name, (kind, shape, at) in places.items()
        }
        self.done = np.array(self._places[DONE], bool)

    @staticmethod
    def make(path: Path, layout: SweepLayout) -> None:
        """A new file, with no run done."""
        head, places, size = _head(layout)
        with replacing(path) as beside:
            with beside.open("wb") as file:
                file.write(head)
                file.truncate(size)
            for name, (kind, shape, at) in places.items():
                if not np.prod(shape) or name == DONE:
                    continue
                there = np.memmap(beside, _TYPES[kind], "r+", at, shape)
                if name in layout.coordinates:
                    there[...] = _stored(layout.coordinates[name][1])
                else:
                    there[...] = np.nan
                there.flush()

    def _write(self, runs: Integers, values: Mapping[str, NDArray[Any]]) -> None:
        for name, rows in values.items():
            self._places[name][runs] = rows
        self._places[DONE][runs] = 1

    def read(self, name: str) -> NDArray[Any]:
        return np.asarray(self._places[name], float)


_TYPES = {"char": np.dtype("S1"), "byte": np.dtype("i1"), "double": np.dtype(">f8")}
_NUMBERS = {"byte": 1, "char": 2, "double": 6}
_SOME = {"dimensions": 10, "variables": 11, "attributes": 12}


def _stored(values: Any) -> NDArray[Any]:
    """Numbers as doubles, names as rows of characters."""
    found = np.asarray(values)
    if found.dtype.kind in "US":
        return np.char.encode(found.astype(str), "utf-8").view("S1").reshape(*found.shape, -1)
    return found.astype(float)


def _text(value: str) -> bytes:
    raw = value.encode()
    return struct.pack(">i", len(raw)) + raw + bytes(-len(raw) % 4)


def _list(kind: str, items: list[bytes]) -> bytes:
    return struct.pack(">ii", _SOME[kind] if items else 0, len(items)) + b"".join(items)


def _attributes(attributes: Mapping[str, str]) -> bytes:
    return _list(
        "attributes",
        [_text(name) + struct.pack(">i", _NUMBERS["char"]) + _text(text) for name, text in attributes.items() if text],
    )


def _head(layout: SweepLayout) -> tuple[bytes, dict[str, tuple[str, tuple[int, ...], int]], int]:
    """Header of a file; type, shape and offset of each variable; and the size of the file."""
    sizes: dict[str, int] = {RUN: layout.runs}
    variables: list[tuple[str, tuple[str, ...], tuple[int, ...], str, Mapping[str, str]]] = []
    for name, (axes, numbers, attributes) in layout.coordinates.items():
        stored = _stored(numbers)
        kind, shape = ("char", stored.shape) if stored.dtype.kind == "S" else ("double", stored.shape)
        dimensions = (*axes, f"{name}_length") if kind == "char" else axes
        variables.append((name, dimensions, shape, kind, attributes))
    variables.append((DONE, (RUN,), (layout.runs,), "byte", {}))
    for name, v in layout.values.items():
        if v.kind != "f8":
            raise ArgumentError(f"to: {name} is complex, which netCDF cannot hold; give a path that ends in .zarr")
        variables.append((name, (RUN, *v.dimensions), (layout.runs, *v.shape), "double", v.attributes))
    kept = [v for v in variables if 0 not in v[2]]  # a dimension of length 0 would be the unlimited one
    for name, dimensions, shape, kind, _ in kept:
        sizes |= dict(zip(dimensions, shape, strict=True))
        if wrong := [n for n in (name, *dimensions) if "/" in n]:
            raise ArgumentError(f"to: netCDF has no variable of the name {wrong[0]!r}; give a path that ends in .zarr")
        if int(np.prod(shape, dtype=float)) * _TYPES[kind].itemsize > ROOM:
            raise ArgumentError(f"to: {name} takes more than 4 GB, which netCDF cannot hold; give a path that ends in .zarr")
    order = {name: k for k, name in enumerate(sizes)}

    def head(places: list[int]) -> bytes:
        entries = []
        for (name, dimensions, shape, kind, attributes), at in zip(kept, places, strict=True):
            length = int(np.prod(shape)) * _TYPES[kind].itemsize
            ids = struct.pack(f">i{len(dimensions)}i", len(dimensions), *(order[d] for d in dimensions))
            entries.append(
                _text(name) + ids + _attributes(attributes) + struct.pack(">iIq", _NUMBERS[kind], length + -length % 4, at)
            )
        lengths = [_text(name) + struct.pack(">i", size) for name, size in sizes.items()]
        whole = _attributes({"Conventions": "CF-1.8", HEADER: layout.header})
        return b"CDF\x02" + struct.pack(">i", 0) + _list("dimensions", lengths) + whole + _list("variables", entries)

    at, places = len(head([0] * len(kept))), []
    for _, _, shape, kind, _ in kept:
        at += -at % 8
        places.append(at)
        at += int(np.prod(shape)) * _TYPES[kind].itemsize
    found = {v[0]: (v[3], v[2], 0) for v in variables} | {
        v[0]: (v[3], v[2], place) for v, place in zip(kept, places, strict=True)
    }
    return head(places), found, at + -at % 8


def _netcdf_header(path: Path) -> str:
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=True) as file:
        return bytes(getattr(file, HEADER)).decode()
