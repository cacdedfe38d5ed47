"""`Samples`: varied and fixed values of a sweep; `grid` makes a full factorial design."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, is_real, name_list, reals, shown
from gearlib.errors import ArgumentError
from gearlib.solvers.inputs.table import Table

Integers = NDArray[np.int64]
EXPECTED = (
    "values by path: {'K_g': [1e8, 2e8], 'I_r': 0.3}, gl.grid(...), a DataFrame, or an array (runs, names) with names=[...]"
)
RUN = "run"  # axis name of runs that do not form a grid


@dataclass(frozen=True, eq=False)
class Grid:
    """Full factorial design, made by `grid`.

    Attributes
    ----------
    axes : mapping
        Values along each axis: arrays of numbers, or tuples of tables.
    fixed : mapping
        Values common to all runs.
    """

    axes: Mapping[str, Any]
    fixed: Mapping[str, Any]


def grid(values: Mapping[str, Any] | None = None, /, **more: Any) -> Grid:
    """Full factorial design: all combinations of the values of some parameters, for a sweep.

    Parameters
    ----------
    values : mapping of str to sequence, optional
        By path; a single number is the same in all runs and makes no axis.
    **more : sequence
        The same, for names without dots.

    Returns
    -------
    Grid

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Spin(gl.Component):
    ...     def assemble(self):
    ...         self.torque, self.body = gp.Torque(), gp.Inertia(J=1.0)
    ...         return [gl.connect(self.torque.flange, self.body.flange_a)]
    >>> varied = gl.grid({"body.J": [1.0, 2.0, 4.0], "torque.tau": [4.0, 8.0]})
    >>> gl.compile(Spin()).sweep(varied, 1.0, outputs=["body.w"], samples=2)["body.w"][:, :, -1]
    array([[4., 8.],
           [2., 4.],
           [1., 2.]])
    """
    given = by_name("values", values, "a mapping of paths to sequences of numbers", "load.J")
    if twice := given.keys() & more.keys():
        raise ArgumentError(f"{min(twice)} is given in values, and by its name; leave one of the two out")
    axes, fixed = _sorted(given | more, "values")
    if empty := [name for name, column in axes.items() if not len(column)]:
        raise ArgumentError(f"values: there is no run, those of {empty[0]} are empty")
    return Grid(axes, fixed)


@dataclass(frozen=True, eq=False)
class Samples:
    """Varied and fixed values of a sweep.

    Attributes
    ----------
    columns : mapping
        Varied values, by name: an array of numbers, or a tuple of tables, one per run.
    fixed : mapping
        Values common to all runs.
    axes : mapping
        Axes of the runs: ``{"run": None}``, or the values along each axis of a grid.
    shape : tuple of int
        Number of runs along each axis.
    """

    columns: Mapping[str, Any]
    fixed: Mapping[str, Any]
    axes: Mapping[str, Any]
    shape: tuple[int, ...]

    def __len__(self) -> int:
        return int(np.prod(self.shape))

    @property
    def names(self) -> list[str]:
        """All names with given values, varied or fixed."""
        return [*self.columns, *self.fixed]

    @property
    def numbers(self) -> dict[str, NDArray[np.float64]]:
        """The numeric columns."""
        return {name: column for name, column in self.columns.items() if isinstance(column, np.ndarray)}

    def part(self, runs: Integers) -> dict[str, Any]:
        """The columns of some runs."""
        return {
            name: column[runs] if isinstance(column, np.ndarray) else tuple(column[i] for i in runs.tolist())
            for name, column in self.columns.items()
        }

    def place(self, run: int) -> int | tuple[int, ...]:
        """Index of a run in arrays of results: a number, or one per axis of a grid."""
        return run if len(self.shape) == 1 else tuple(int(i) for i in np.unravel_index(run, self.shape))


def rows(part: Mapping[str, Any], count: int) -> Iterator[dict[str, Any]]:
    """The values of each run, from their `Samples.part`."""
    listed = [column.tolist() if isinstance(column, np.ndarray) else column for column in part.values()]
    for values in zip(*listed, strict=True) if listed else ((),) * count:
        yield dict(zip(part, values, strict=True))


def as_samples(given: Any, names: Sequence[str] | None = None) -> Samples:
    """Convert a user's specification of varied values.

    Parameters
    ----------
    given : mapping, Grid, DataFrame or array
        Values by path, of equal length where they vary; a grid; a table with one column per path; or an array with one row per run, as
        from `scipy.stats.qmc`.
    names : sequence of str, optional
        Column names of an array.

    Raises
    ------
    ArgumentError, NameLookupError
        An unsupported type, different lengths, or values that are not finite.

    Examples
    --------
    >>> found = as_samples({"a": [1, 2, 3], "b": 5})
    >>> found.shape, found.fixed, [*rows(found.part(np.array([2])), 1)]
    ((3,), {'b': 5.0}, [{'a': 3.0}])
    >>> as_samples(np.array([[1.0, 2.0], [3.0, 4.0]]), ["a", "b"]).columns["b"]
    array([2., 4.])
    """
    if names is not None:
        return _of_array(given, name_list("names", names, "load.J"))
    pandas = sys.modules.get("pandas")  # whoever has a DataFrame has imported pandas
    if pandas is not None and isinstance(given, pandas.DataFrame):
        given = {name: given[name].to_numpy() for name in given.columns}
    if isinstance(given, Grid):
        return _factorial(given)
    if isinstance(given, np.ndarray):
        raise ArgumentError("parameters is an array; say what its columns are: names=['K_g', 'C_v']")
    values = by_name("parameters", given, EXPECTED, "load.J")
    columns, fixed = _sorted(values, "parameters")
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        found = ", ".join(f"{name} {n}" for name, n in list(lengths.items())[:8])
        raise ArgumentError(
            f"parameters: sequences run together and must be equally long, got {found}; for all combinations give gl.grid(...)"
        )
    count = next(iter(lengths.values()), 1)
    if not count:
        raise ArgumentError("parameters: there is no run, the sequences are empty")
    return Samples(columns, fixed, {RUN: None}, (count,))


def _of_array(given: Any, names: list[str]) -> Samples:
    expected = f"an array of finite numbers of shape (runs, {len(names)}), since there are {len(names)} names"
    table = reals("parameters", given, expected)
    if table.ndim != 2 or table.shape[1] != len(names) or not len(table):
        raise ArgumentError(f"parameters has the shape {table.shape}; expected {expected}")
    if len(set(names)) < len(names):
        raise ArgumentError(f"names is {shown(names)}; expected each name once")
    return as_samples({name: table[:, k].copy() for k, name in enumerate(names)})


def _factorial(given: Grid) -> Samples:
    columns, fixed = given.axes, given.fixed
    shape = tuple(len(column) for column in columns.values())
    if not shape:
        return Samples({}, fixed, {RUN: None}, (1,))
    spread: dict[str, Any] = {}
    for (name, column), places in zip(columns.items(), np.unravel_index(np.arange(np.prod(shape)), shape), strict=True):
        spread[name] = column[places] if isinstance(column, np.ndarray) else tuple(column[i] for i in places.tolist())
    return Samples(spread, fixed, columns, shape)


def _sorted(values: Mapping[str, Any], what: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Varied and fixed values."""
    columns: dict[str, Any] = {}
    fixed: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Table) or callable(value):
            fixed[name] = value
        elif is_real(value):
            fixed[name] = float(value)
        else:
            columns[name] = _column(f"{what}['{name}']", value)
    return columns, fixed


def _column(what: str, value: Any) -> Any:
    """A column of finite numbers, or of tables and functions."""
    expected = "a number, or a sequence with a finite number (for an input, or a table) for each run"
    if isinstance(value, (list, tuple)) and any(isinstance(one, Table) or callable(one) for one in value):
        wrong = [one for one in value if not (isinstance(one, Table) or callable(one) or is_real(one))]
        if wrong:
            raise ArgumentError(f"{what} holds {shown(wrong[0])}; expected {expected}")
        return tuple(value)
    found = reals(what, value, expected)
    if found.ndim != 1:
        raise ArgumentError(f"{what} is {shown(value)}; expected {expected}")
    return found.copy()
