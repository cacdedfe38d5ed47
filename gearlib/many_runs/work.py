"""`Work`: what is done in each run of a sweep, in this process or in another one, and what comes back from some runs: a `Chunk`."""

from __future__ import annotations

import pickle
import platform
import threading
import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import shown
from gearlib.errors import ArgumentError, GearlibError
from gearlib.language.recipes import packed
from gearlib.many_runs.samples import Samples, rows

Values = Mapping[str, NDArray[Any]]
Warned = tuple[type[Warning], str]


@dataclass(frozen=True, eq=False)
class Row:
    """What one run gives: arrays by name, and coordinates along their axes, by dimension."""

    values: dict[str, Any]
    coordinates: Mapping[str, Any] = field(default_factory=dict)


class Work(ABC):
    """What is done in each run of a sweep."""

    @property
    def reshapes(self) -> bool:
        """Whether `finished` makes other values of those of all runs."""
        return False

    @abstractmethod
    def row(self, given: Mapping[str, Any]) -> Row:
        """One run, with what varies given by name.

        Raises
        ------
        GearlibError
            The run failed.
        """

    @abstractmethod
    def dimensions(self, name: str) -> tuple[str, ...]:
        """Names of the axes of a value, as far as they have one."""

    @abstractmethod
    def unit(self, name: str) -> str:
        """Unit of a value; empty where it is not known."""

    def finished(self, samples: Samples, values: Values) -> tuple[Values, Mapping[str, tuple[str, ...]]]:
        """What is shown in place of the values of all runs, arrays of shape (runs, ...), and the names of their axes."""
        return values, {}

    @abstractmethod
    def identity(self) -> Iterator[bytes]:
        """What tells this work from any other, the same in every process."""


@dataclass(frozen=True, eq=False)
class Chunk:
    """What some runs gave: an array by name with a row for each run (NaN where it failed), errors, warnings, and the time it took."""

    values: dict[str, NDArray[Any]]
    coordinates: Mapping[str, Any]
    errors: dict[int, GearlibError]  # by the number in the chunk
    warned: tuple[Warned, ...]
    seconds: float


def reduced(reduce: Mapping[str, Callable[[Any], Any]], result: Any) -> dict[str, Any]:
    """The numbers that a user's functions make of a result.

    Raises
    ------
    ArgumentError
        A function failed, or made no numbers.
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


def done(work: Work, part: Mapping[str, Any], count: int) -> Chunk:
    """Carry out some runs, one after another."""
    begin = time.perf_counter()
    errors: dict[int, GearlibError] = {}
    values: dict[str, NDArray[Any]] = {}
    coordinates: Mapping[str, Any] = {}
    for i, given in enumerate(rows(part, count)):
        try:
            row = work.row(given)
            if not values:
                values, coordinates = blank(row.values, count), row.coordinates
            put(values, i, row.values)
        except GearlibError as problem:
            errors[i] = problem
    return Chunk(values, coordinates, errors, (), time.perf_counter() - begin)


def blank(row: Mapping[str, Any], count: int) -> dict[str, NDArray[Any]]:
    """Arrays for so many rows as one that is known, all NaN."""
    return {
        name: np.full((count, *np.shape(value)), np.nan, complex if np.iscomplexobj(value) else float)
        for name, value in row.items()
    }


def put(values: Mapping[str, NDArray[Any]], i: int, row: Mapping[str, Any]) -> None:
    """Write a row; all of it or nothing.

    Raises
    ------
    ArgumentError
        Its values have other shapes than those of the first run had.
    """
    for name, value in row.items():
        there = values[name]
        if np.shape(value) != there.shape[1:]:
            raise ArgumentError(
                f"{name} has the shape {np.shape(value)} in this run and {there.shape[1:]} in the first one; all must be alike"
            )
        if np.iscomplexobj(value) and not np.iscomplexobj(there):
            raise ArgumentError(f"{name} is complex in this run and was real in the first one; all must be alike")
    for name, value in row.items():
        values[name][i] = value


# ---------------------------------------------------------------- elsewhere

_opening = threading.Lock()


def here() -> str:
    """What tells this process from others, on this machine and elsewhere."""
    return f"{platform.node()} {threading.main_thread().native_id}"


def job(work: Work) -> bytes:
    """Work as bytes that another process can open: models are a few hundred of them, and are translated and compiled there."""
    try:
        return packed(work)
    except Exception as problem:
        raise ArgumentError(
            f"what is to be done cannot be sent to another process ({type(problem).__name__}: {problem}); functions and component "
            "classes must stand in a module, or pip install cloudpickle"
        ) from problem


def done_there(packed_work: bytes, part: Mapping[str, Any], count: int, home: str) -> Chunk:
    """Carry out some runs in another process, which translates a model once; ``home`` is the one that asks, and keeps warnings."""
    with _opening:  # one translation, though several threads may begin
        work: Work = pickle.loads(packed_work)
    if here() == home:
        return done(work, part, count)
    with noted() as found:
        chunk = done(work, part, count)
    return Chunk(chunk.values, chunk.coordinates, chunk.errors, tuple(dict.fromkeys(found())), chunk.seconds)


@contextmanager
def noted() -> Iterator[Callable[[], list[Warned]]]:
    """Note the warnings of all that runs meanwhile, in all threads, instead of showing them."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield lambda: [(w.category, str(w.message)) for w in found]
