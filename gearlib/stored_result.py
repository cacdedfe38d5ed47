"""`StoredResult`: a result read from a file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import as_path, name_list
from gearlib.errors import ArgumentError, NameLookupError, nearest
from gearlib.files.contents import Record
from gearlib.files.formats import load_record
from gearlib.run.result import Result

if TYPE_CHECKING:
    from gearlib.language.component import Component
    from gearlib.run.energy.energy_balance import EnergyBalance

Floats = NDArray[np.float64]


def load_result(path: str | os.PathLike[str]) -> StoredResult:
    """Read a result written by `Result.save`, or a ``.mat`` result of Dymola or OpenModelica.

    Parameters
    ----------
    path : path
        With the suffix ``.mat``, ``.csv``, ``.nc``, ``.zarr`` or ``.parquet``.

    Returns
    -------
    StoredResult
        A `Result` with everything that was saved.

    Raises
    ------
    FileError
        The file cannot be read, is not a result, or is truncated or damaged.
    """
    return StoredResult(load_record(as_path("path", path)))


class StoredResult(Result):
    """A result read from a file: it has the variables that were saved, and cannot be run again.

    Attributes
    ----------
    model : str
        Class name of the model; "" if the file does not give it.
    parameters : dict
        Parameter values of the run, by path.
    options, versions : dict
        Settings of the run, and versions of the software that computed it.
    """

    def __init__(self, record: Record) -> None:
        self._record = record
        self.time = record.time
        self.stats, self.events = dict(record.stats), list(record.events)
        self.model, self.parameters = record.model, dict(record.parameters)
        self.options, self.versions = dict(record.options), dict(record.versions)

    def _known(self, name: str) -> str:
        self._check_name(name)
        if name not in self._record.place:
            raise NameLookupError(f"the file holds no variable '{name}'; {nearest(name, self._record.names)}")
        return name

    def __getitem__(self, name: str) -> Floats:
        return self._record.history(self._known(name))

    def __iter__(self) -> Iterator[str]:
        return iter(self._record.names)

    def __contains__(self, name: object) -> bool:
        return name in self._record.names

    def unit(self, name: str) -> str:
        return self._record.units[self._record.place[self._known(name)]]

    def at(self, t: float) -> dict[str, float]:
        t = self._within(t)
        return {name: float(np.interp(t, self.time, history)) for name, history in self.items()}

    def record(self, names: Sequence[str] | None = None) -> Record:
        if names is None:
            return self._record
        chosen = list(dict.fromkeys(map(self._known, name_list("names", names, "load.w"))))
        places, whole = [self._record.place[name] for name in chosen], self._record
        used, columns = np.unique([whole.columns[i] for i in places], return_inverse=True)
        return replace(
            whole, data=np.ascontiguousarray(whole.data[:, used.astype(int)]), names=tuple(chosen), columns=tuple(columns.tolist()),
            signs=tuple(whole.signs[i] for i in places), units=tuple(whole.units[i] for i in places),
            descriptions=tuple(whole.descriptions[i] for i in places),
        )  # fmt: skip

    def energy_balance(self) -> EnergyBalance:
        """Refused, since the run would have to be repeated.

        Raises
        ------
        ArgumentError
            Always.
        """
        raise ArgumentError("a result that was read from a file has no model to do the run again; ask the result of simulate()")

    def model_drawn(self) -> Component:
        """Refused: files hold histories only.

        Raises
        ------
        ArgumentError
            Always.
        """
        raise ArgumentError(
            "a result that was read from a file has no model whose gears could be drawn; ask the result of simulate()"
        )

    def gradient(self, weights: Mapping[str, ArrayLike], names: Sequence[str]) -> dict[str, float]:
        """Refused, since files contain histories only.

        Raises
        ------
        ArgumentError
            Always.
        """
        raise ArgumentError("a result from a file has no gradients; repeat the run: system.simulate(...).gradient(...)")

    def sensitivity(self, name: str, parameter: str) -> Floats:
        """Refused, since files contain histories only.

        Raises
        ------
        ArgumentError
            Always.
        """
        raise ArgumentError("a result that was read from a file has no sensitivities; ask the result of simulate()")

    def __repr__(self) -> str:
        span = f"{self.time[0]:g} .. {self.time[-1]:g} s, " if len(self.time) else ""
        method = self.stats.get("method", "?")
        return f"<Result: {len(self.time)} samples, {span}{len(self)} variables of {self.model or 'a file'}, {method}>"
