"""`Work`: the task performed in each run of a sweep, locally or in another process; `Chunk`: the results of some runs."""

from __future__ import annotations

import pickle
import platform
import threading
import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import shown
from gearlib.errors import ArgumentError, GearlibError
from gearlib.language.recipes import packed
from gearlib.many_runs.samples import RUN, Samples, rows

Values = Mapping[str, NDArray[Any]]
Integers = NDArray[np.int64]
Warned = tuple[type[Warning], str]


@dataclass(frozen=True, eq=False)
class Row:
    """Result of one run: arrays by name, and coordinates along their axes, by dimension."""

    values: dict[str, Any]
    coordinates: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ManyRows:
    """Results of some runs: arrays by name with one row per run, and coordinates."""

    values: dict[str, NDArray[Any]]
    coordinates: Mapping[str, Any]


class Work(ABC):
    """The task performed in each run of a sweep."""

    @property
    def reshapes(self) -> bool:
        """Whether `finished` replaces the values of all runs."""
        return False

    @abstractmethod
    def row(self, given: Mapping[str, Any]) -> Row:
        """Perform one run, with the varied values by name.

        Raises
        ------
        GearlibError
            The run failed.
        """

    def together(
        self, part: Mapping[str, Any], count: int
    ) -> Iterator[tuple[int, Row | GearlibError] | tuple[Integers, ManyRows]]:
        """Some runs, with their numbers, in any order: by default one after another."""
        for i, given in enumerate(rows(part, count)):
            yield i, self.attempted(given)

    def attempted(self, given: Mapping[str, Any]) -> Row | GearlibError:
        """One run, or the error with which it failed."""
        try:
            return self.row(given)
        except GearlibError as problem:
            return problem

    @property
    def statistics(self) -> Mapping[str, Any]:
        """Entries for the sweep's ``stats`` on how the runs are performed."""
        return {}

    @abstractmethod
    def dimensions(self, name: str) -> tuple[str, ...]:
        """Names of the axes of a value, as far as they are named."""

    @abstractmethod
    def unit(self, name: str) -> str:
        """Unit of a value; empty if unknown."""

    @abstractmethod
    def varied_unit(self, name: str) -> str:
        """Unit of what varies over the runs; empty if unknown."""

    def presented(self, names: Iterable[str]) -> Iterable[str]:
        """Names of the values that `finished` presents, given those of a run."""
        return names

    def finished(self, samples: Samples, values: Values) -> tuple[Values, Mapping[str, tuple[str, ...]]]:
        """Values to present in place of those of all runs, arrays of shape (runs, ...), and the names of their axes."""
        return values, {}

    @abstractmethod
    def identity(self) -> Iterator[bytes]:
        """Bytes that identify this work, the same in every process."""


@dataclass(frozen=True, eq=False)
class Chunk:
    """Results of some runs: arrays by name with one row per run (NaN if failed), errors, warnings, and run time."""

    values: dict[str, NDArray[Any]]
    coordinates: Mapping[str, Any]
    errors: dict[int, GearlibError]  # by index in the chunk
    warned: tuple[Warned, ...]
    seconds: float


def reduced(reduce: Mapping[str, Callable[[Any], Any]], result: Any) -> dict[str, Any]:
    """The values that a user's functions return for a result.

    Raises
    ------
    ArgumentError
        A function failed, or did not return numbers.
    """
    found: dict[str, Any] = {}
    for name, function in reduce.items():
        try:
            value = np.asarray(function(result))
        except GearlibError:
            raise
        except Exception as problem:
            raise ArgumentError(f"reduce['{name}'] raised {type(problem).__name__}: {problem}") from problem
        if value.dtype.kind not in "biufc":
            raise ArgumentError(f"reduce['{name}'] returned {shown(value)}; expected a number or an array of numbers")
        found[name] = value
    return found


def check_names(samples: Samples, results: Collection[str], axes: Collection[str]) -> None:
    """Raise `ArgumentError` if a name stands for two of what varies, a result, and an axis of results."""
    own_axes = (*axes, RUN) if RUN in samples.axes else axes
    kinds = ("is given to the runs", samples.names), ("is a result", results), ("is an axis of the results", own_axes)
    for (first, names), (second, others) in combinations(kinds, 2):
        if both := [name for name in names if name in others]:
            raise ArgumentError(
                f"{both[0]} {first} and {second}, too; give the result another name: reduce={{'name': function}}"
            )


def done(work: Work, part: Mapping[str, Any], count: int) -> Chunk:
    """Execute some runs."""
    begin = time.perf_counter()
    errors: dict[int, GearlibError] = {}
    values: dict[str, NDArray[Any]] = {}
    coordinates: Mapping[str, Any] = {}
    for i, row in work.together(part, count):
        if isinstance(row, GearlibError):
            errors[int(i)] = row
            continue
        if not values:
            values, coordinates = blank(first_of(row).values, count), row.coordinates
        try:
            put(values, coordinates, i, row)
        except ArgumentError as problem:
            errors |= dict.fromkeys([i] if isinstance(i, int) else i.tolist(), problem)
    return Chunk(values, coordinates, errors, (), time.perf_counter() - begin)


def first_of(row: Row | ManyRows) -> Row:
    """The first of some rows."""
    return row if isinstance(row, Row) else Row({name: value[0] for name, value in row.values.items()}, row.coordinates)


def blank(row: Mapping[str, Any], count: int) -> dict[str, NDArray[Any]]:
    """Arrays with a number of rows like the given one, filled with NaN."""
    return {
        name: np.full((count, *np.shape(value)), np.nan, complex if np.iscomplexobj(value) else float)
        for name, value in row.items()
    }


def put(values: Values, coordinates: Mapping[str, Any], i: int | Integers, row: Row | ManyRows) -> None:
    """Write a row, or some that are alike, completely or not at all.

    Raises
    ------
    ArgumentError
        Its values differ in name, shape or coordinates from those of the first run.
    """
    if other := row.values.keys() ^ values.keys():
        which = "this run and not in the first one" if min(other) in row.values else "the first run and not in this one"
        raise ArgumentError(f"{min(other)} is there in {which}; all must be alike")
    for name, along in row.coordinates.items():
        there = coordinates.get(name, ())
        if along is not there and not np.array_equal(along, there):
            raise ArgumentError(f"the axis {name} has other values in this run than in the first one; all must be alike")
    for name, value in row.values.items():
        there = values[name]
        shape = np.shape(value)[0 if isinstance(i, int) else 1 :]
        if shape != there.shape[1:]:
            raise ArgumentError(
                f"{name} has the shape {shape} in this run and {there.shape[1:]} in the first one; all must be alike"
            )
        if np.iscomplexobj(value) and not np.iscomplexobj(there):
            raise ArgumentError(f"{name} is complex in this run and was real in the first one; all must be alike")
    for name, value in row.values.items():
        values[name][i] = value


# ---------------------------------------------------------------- elsewhere

_opening = threading.Lock()


def here() -> str:
    """Identifier of this process, unique across machines."""
    return f"{platform.node()} {threading.main_thread().native_id}"


def job(work: Work) -> bytes:
    """Pickled work for another process: models take a few hundred bytes, and are translated and compiled there."""
    try:
        return packed(work)
    except Exception as problem:
        raise ArgumentError(
            f"what is to be done cannot be sent to another process ({type(problem).__name__}: {problem}); functions and component "
            "classes must stand in a module, or pip install cloudpickle"
        ) from problem


def done_there(packed_work: bytes, part: Mapping[str, Any], count: int, home: str) -> Chunk:
    """Execute some runs in another process, translating the model once; ``home`` is the process that asks, which handles warnings."""
    with _opening:  # a single translation, even if several threads start at once
        work: Work = pickle.loads(packed_work)
    if here() == home:
        return done(work, part, count)
    with noted() as found:
        chunk = done(work, part, count)
    return Chunk(chunk.values, chunk.coordinates, chunk.errors, tuple(dict.fromkeys(found())), chunk.seconds)


@contextmanager
def noted() -> Iterator[Callable[[], list[Warned]]]:
    """Collect the warnings of all threads inside the block, instead of showing them."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield lambda: [(w.category, str(w.message)) for w in found]
