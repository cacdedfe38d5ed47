"""`Gathering`: collects the runs of a sweep as they come in, in memory or in a file."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib import errors as kinds
from gearlib.errors import ArgumentError, FileError, GearlibError
from gearlib.files.contents import versions
from gearlib.files.sweep_files import StoredArray, SweepFile, SweepLayout, create, found_header, layout_of, reopen
from gearlib.many_runs.identity import of_values
from gearlib.many_runs.runs import Runs
from gearlib.many_runs.samples import RUN, Samples
from gearlib.many_runs.work import Chunk, ManyRows, Row, Work, blank, check_names, first_of, put
from gearlib.run.request import physical_memory

Integers = NDArray[np.int64]
WAIT = 0.5  # s, for which runs wait at most to be written together: what an interrupt of the process may lose


class Gathering:
    """Results of a sweep received so far.

    Attributes
    ----------
    done : bool array
        Which runs have been received.
    before : int
        Number of runs written by an earlier, interrupted sweep.
    """

    def __init__(self, work: Work, model: str, samples: Samples, path: Path | None) -> None:
        self.work, self.model, self.samples, self.path = work, model, samples, path
        self.done = np.zeros(len(samples), bool)
        self.errors: dict[int, GearlibError] = {}
        self.coordinates: Mapping[str, Any] = {}
        self._values: dict[str, NDArray[Any]] = {}  # of all runs; with a file, of those waiting to be written
        self._waiting: list[int] = []
        self._file: SweepFile | None = None
        self._layout: dict[str, StoredArray] = {}
        self._written, self._begin = time.perf_counter(), time.perf_counter()
        self._digest = self._identity() if path is not None else ""
        if path is not None:
            self._resume(path)
        self.before = int(self.done.sum())

    def _identity(self) -> str:
        found = hashlib.sha256()
        samples = self.samples
        for part in [*self.work.identity(), *of_values(samples.columns), *of_values(samples.fixed), *of_values(samples.shape)]:
            found.update(part + b"\0")
        return found.hexdigest()

    def _resume(self, path: Path) -> None:
        """Resume from the file of an interrupted sweep.

        Raises
        ------
        FileError
            The file belongs to another sweep.
        """
        header = found_header(path)
        if header is None:
            return
        if header.get("digest") != self._digest:
            raise FileError(
                f"{path} was written by another sweep (of {header.get('model')}, {header.get('runs')} runs): model, what varies, "
                "outputs and options must be the same to go on with it; give another path, or remove it"
            )
        kept = {name: np.asarray(numbers) for name, numbers in header["coordinates"].items()}
        self.coordinates = kept
        layout = layout_of(header, self._columns())
        self._file = reopen(path, layout)
        self._layout = dict(layout.values)
        self.done = self._file.done.copy()
        for run, (kind, message) in self._file.failures().items():
            self.errors[run] = getattr(kinds, kind, GearlibError)(message)

    def _columns(self) -> dict[str, Any]:
        """Coordinates of the file: the varied values, and those of the results."""
        units = {"time": {"units": "s"}}
        of_runs = {
            name: ((RUN,), column, {"units": self.work.varied_unit(name)}) for name, column in self.samples.numbers.items()
        }
        return of_runs | {name: ((name,), numbers, units.get(name, {})) for name, numbers in self.coordinates.items()}

    @property
    def todo(self) -> Integers:
        """The runs that remain to be done."""
        return np.flatnonzero(~self.done)

    def _prepare(self, row: Mapping[str, Any], coordinates: Mapping[str, Any]) -> None:
        """Allocate storage, once the shapes of the values are known."""
        if self._layout:
            if not self._values and self._file is not None:
                self._values = blank(row, self._file.batch)
            return
        self.coordinates = coordinates
        layout = {
            name: StoredArray(
                self._axes(name, np.shape(value)), np.shape(value), "c16" if np.iscomplexobj(value) else "f8",
                {"units": self.work.unit(name), "coordinates": " ".join(self.samples.numbers)},
            )
            for name, value in row.items()
        }  # fmt: skip
        axes = {*coordinates, *(axis for stored in layout.values() for axis in stored.dimensions)}
        check_names(self.samples, [*self.work.presented(row)], axes)
        if self.path is None:
            self._refuse_too_much(layout)
            self._layout, self._values = layout, blank(row, len(self.samples))
            return
        shape = list(self.samples.shape)
        attributes = {
            "digest": self._digest, "model": self.model, "shape": shape, "axes": list(self.samples.axes), **versions(),
            "coordinates": {name: np.asarray(numbers).tolist() for name, numbers in coordinates.items()},
        }  # fmt: skip
        self._file = create(self.path, SweepLayout(len(self.samples), layout, self._columns(), attributes))
        self._layout, self._values = layout, blank(row, self._file.batch)

    def _axes(self, name: str, shape: tuple[int, ...]) -> tuple[str, ...]:
        named = self.work.dimensions(name)
        return named if len(named) == len(shape) else tuple(f"{name}_{k}" for k in range(len(shape)))

    def _refuse_too_much(self, layout: Mapping[str, StoredArray]) -> None:
        needed = 8.0 * len(self.samples) * sum(math.prod(v.shape) for v in layout.values())
        there = physical_memory()
        if needed > there:
            raise ArgumentError(
                f"outputs of {len(self.samples)} runs take {needed / 1e9:.3g} GB, and this machine has {there / 1e9:.3g}; keep less "
                "(samples=..., reduce={...}), or write to a file: to='sweep.zarr'"
            )

    def add(self, run: int, row: Row) -> None:
        """Store a successful run; it counts as failed if its values differ in shape from those of the others."""
        self._prepare(row.values, row.coordinates)
        try:
            put(self._values, self.coordinates, run if self._file is None else len(self._waiting), row)
        except ArgumentError as problem:
            self.fail(run, problem)
            return
        if self._file is None:
            self.done[run] = True
        else:
            self._waiting.append(run)
            self._written_soon()

    def add_all(self, runs: Integers, rows: ManyRows) -> None:
        """Store successful runs."""
        if self._file is not None or (self.path is not None and not self._layout):
            for i, run in enumerate(runs.tolist()):
                self.add(run, Row({name: values[i] for name, values in rows.values.items()}, rows.coordinates))
            return
        self._prepare(first_of(rows).values, rows.coordinates)
        try:
            put(self._values, self.coordinates, runs, rows)
        except ArgumentError as problem:
            for run in runs.tolist():
                self.fail(run, problem)
            return
        self.done[runs] = True

    def fail(self, run: int, problem: GearlibError) -> None:
        """Store a failed run."""
        self.errors[run] = problem
        if self._file is None:
            self.done[run] = True
            return
        for values in self._values.values():
            values[len(self._waiting)] = np.nan
        self._waiting.append(run)
        self._written_soon()

    def take(self, runs: Integers, chunk: Chunk) -> None:
        """Store runs executed elsewhere."""
        for i, run in enumerate(runs.tolist()):
            if i in chunk.errors:
                self.fail(run, chunk.errors[i])
            else:
                self.add(run, Row({name: values[i] for name, values in chunk.values.items()}, chunk.coordinates))

    def _written_soon(self) -> None:
        assert self._file is not None
        if len(self._waiting) >= self._file.batch or time.perf_counter() - self._written > WAIT:
            self.write()

    def write(self) -> None:
        """Write waiting runs to the file."""
        if self._file is not None:
            # Failures before shapes were known
            early = [run for run in self.errors if self.done[run] and not self._file.done[run]]
            order = np.argsort(np.array(self._waiting, np.int64), kind="stable")
            runs = np.array(self._waiting, np.int64)[order]
            failed = {
                r: (type(self.errors[r]).__name__, str(self.errors[r])) for r in [*early, *self._waiting] if r in self.errors
            }
            values = {name: rows[: len(order)][order] for name, rows in self._values.items()}
            self._file.write(np.array(early, np.int64), {}, {})
            self._file.write(runs, values, failed)
            self.done[runs] = True
            self._waiting.clear()
            self._written = time.perf_counter()

    def runs(self, interrupted: bool) -> Runs:
        """Everything received.

        Raises
        ------
        GearlibError
            Every run failed: the error of the first one.
        """
        if not self._layout and not interrupted:
            raise self.errors[min(self.errors)]
        self.write()
        file, n = self._file, len(self.samples)
        stats = {
            "runs": n, "done": int(self.done.sum()), "failed": len(self.errors), "done_before": self.before,
            "seconds": time.perf_counter() - self._begin, **self.work.statistics,
        }  # fmt: skip
        layout, read = self._layout, file.read if file is not None else self._values.__getitem__
        if self.work.reshapes and layout:
            shown, axes = self.work.finished(self.samples, {name: read(name) for name in layout})
            layout = {name: StoredArray(axes[name], np.shape(array)[1:]) for name, array in shown.items()}
            read = shown.__getitem__
        units = {name: self.work.varied_unit(name) for name in self.samples.names}
        units |= {name: self.work.unit(name) for name in layout}
        return Runs(
            self.model, self.samples, layout, read, self.coordinates, self.done, self.errors, units, stats,
        )  # fmt: skip
