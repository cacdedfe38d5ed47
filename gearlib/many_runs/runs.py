"""`Runs`: the results of a sweep."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import one_name
from gearlib.errors import ArgumentError, GearlibError, NameLookupError, nearest
from gearlib.files.contents import versions
from gearlib.files.sweep_files import StoredArray
from gearlib.many_runs.samples import RUN, Samples
from gearlib.optional import optional
from gearlib.records import unwritable

if TYPE_CHECKING:
    import pandas
    import xarray


class Runs:
    """Results of many runs; ``runs["load.w"]`` is an array whose first axis is the run, or with one axis per parameter of a grid.

    Attributes
    ----------
    shape : tuple of int
        Number of runs, or of values along each axis of a grid.
    errors : dict
        The `GearlibError` of each failed run, by its index in the arrays: a number, or a tuple. Its values are NaN.
    done : bool array
        Which runs were executed; all, unless the sweep was interrupted.
    coordinates : dict of str to array
        Coordinates of the values' axes: ``coordinates["time"]``, s.
    stats : dict
        Number of runs, number of failures, and run time.
    """

    def __init__(
        self, model: str, samples: Samples, values: Mapping[str, StoredArray], read: Callable[[str], NDArray[Any]],
        coordinates: Mapping[str, Any], done: NDArray[np.bool_], errors: Mapping[int, GearlibError], units: Mapping[str, str],
        stats: Mapping[str, Any],
    ) -> None:  # fmt: skip
        self.shape, self.done, self.stats = samples.shape, done.reshape(samples.shape), dict(stats)
        self.errors = {samples.place(run): errors[run] for run in sorted(errors)}
        self.coordinates = {name: np.asarray(numbers) for name, numbers in coordinates.items()}
        self._model, self._samples, self._values, self._read, self._units = model, samples, dict(values), read, dict(units)

    @property
    def time(self) -> NDArray[np.float64]:
        """The output times, s.

        Raises
        ------
        NameLookupError
            No histories were kept.
        """
        if "time" not in self.coordinates:
            raise NameLookupError("these runs hold no histories, and so no times")
        return np.asarray(self.coordinates["time"], float)

    @property
    def parameters(self) -> dict[str, Any]:
        """The varied values, by name: arrays of the shape of the runs (lists of tables for inputs); and the values common to all runs."""
        found: dict[str, Any] = {}
        for name, column in self._samples.columns.items():
            found[name] = unwritable(column).reshape(self.shape) if isinstance(column, np.ndarray) else list(column)
        return found | dict(self._samples.fixed)

    def __getitem__(self, name: str) -> NDArray[Any]:
        if one_name("runs[...]", name, "load.w") in self._values:
            return unwritable(self._read(name)).reshape(self.shape + self._values[name].shape)
        if name in self._samples.numbers:
            return unwritable(self._samples.numbers[name]).reshape(self.shape)
        raise NameLookupError(
            f"the runs have kept nothing of the name '{name}'; {nearest(name, [*self._values, *self._samples.numbers])}"
        )

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __len__(self) -> int:
        return len(self._samples)

    def keys(self) -> list[str]:
        """Names of the values that were kept."""
        return list(self._values)

    def unit(self, name: str) -> str:
        """Unit of a value; empty if unknown."""
        if one_name("name", name, "load.w") not in self._units:
            raise NameLookupError(f"the runs have kept nothing of the name '{name}'; {nearest(name, self._units)}")
        return self._units[name]

    def to_xarray(self) -> xarray.Dataset:
        """The values as an `xarray.Dataset`, with units, and the varied parameters as coordinates.

        Runs of a grid have one axis per parameter, named by it; other runs have the axis ``run``.
        """
        made, samples = optional("xarray").Dataset, self._samples
        axes = tuple(samples.axes)
        coordinates: dict[str, Any] = {
            name: ((name,), numbers, {"units": "s"} if name == "time" else {}) for name, numbers in self.coordinates.items()
        }
        if axes == (RUN,):
            coordinates |= {name: ((RUN,), column, self._told(name)) for name, column in samples.numbers.items()}
            coordinates[RUN] = ((RUN,), np.arange(len(self)), {})
        else:
            for name, along in samples.axes.items():
                places = along if isinstance(along, np.ndarray) else np.arange(len(along))
                coordinates[name] = ((name,), places, self._told(name))
        variables = {name: ((*axes, *value.dimensions), self[name], self._told(name)) for name, value in self._values.items()}
        numbers = {name: value for name, value in samples.fixed.items() if isinstance(value, float)}
        attributes = {"model": self._model, **versions(), **numbers, "failed_runs": len(self.errors)}
        found: xarray.Dataset = made(variables, coordinates, attributes)
        return found

    def _told(self, name: str) -> dict[str, str]:
        return {"units": self._units[name]} if self._units.get(name) else {}

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per run or, if histories were kept, per run and time: the varied parameters, and the values.

        Raises
        ------
        ArgumentError
            The values have axes other than time; use `to_xarray`.
        """
        pandas = optional("pandas")
        if other := [n for n, v in self._values.items() if v.shape and v.dimensions != ("time",)]:
            raise ArgumentError(f"{other[0]} has axes of its own, for which a table has no columns; to_xarray() has them")
        over_time = [n for n, v in self._values.items() if v.shape]
        count = len(self.time) if over_time else 1
        index = pandas.Index(np.repeat(np.arange(len(self)), count), name=RUN)
        table = {name: np.repeat(column, count) for name, column in self._samples.numbers.items()}
        if over_time:
            table["time"] = np.tile(self.time, len(self))
        for name in self._values:
            table[name] = self._read(name).ravel() if name in over_time else np.repeat(self._read(name), count)
        return pandas.DataFrame(table, index=index)

    def __repr__(self) -> str:
        failed = f", {len(self.errors)} failed" if self.errors else ""
        missing = "" if self.done.all() else f", {int((~self.done).sum())} not done"
        runs = " x ".join(map(str, self.shape))
        return f"<Runs of {self._model}: {runs}{failed}{missing}; {', '.join(list(self._values)[:8])}>"
