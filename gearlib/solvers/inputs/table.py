"""`Table`: an input as a piecewise polynomial function of time, linear or cubic."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import as_path, finite, flag, one_name, one_of, real, reals, shown
from gearlib.errors import ArgumentError, NameLookupError, nearest
from gearlib.language.tabulated import Tabulated, bilinear, is_symbolic, piecewise_polynomial
from gearlib.optional import optional

Floats = NDArray[np.float64]


INTERPOLATIONS = ("linear", "previous", "monotone", "akima", "cubic")
OUTSIDE = ("hold", "periodic")
MOST_KNOTS = 10_000_000  # knots of a periodic table over a run
RESOLVED = 2.0**12  # spacings of the clock over which a function's slope is taken at least
JUMP = 1e-6  # of a function's largest value: a change over that interval, and hardly more over a longer one, that is a jump
REMEMBERED = 20  # values of a function that are remembered with a run, about


class Table(Tabulated):
    """Function of time or of another variable, interpolated between points.

    Pass it to a run, ``simulate(inputs={"torque.tau": table})``, or bind an input of a part to it, ``gp.Torque(tau=table)``: a function
    of time whose corners the run steps to exactly. In equations, ``table(self.w)`` is a function of a variable, with exact slopes; its
    corners raise no events unless ``table(self.w, events=True)`` asks for them, its jumps do. In equations and bindings a table may
    have at most 200 points.

    Parameters
    ----------
    t : sequence of float, shape (n,)
        Increasing times, s. Two equal times make a step, which the smooth interpolations do not support.
    y : sequence of float, shape (n,)
        Values.
    interpolation : {"linear", "previous", "monotone", "akima", "cubic"}
        Piecewise linear; constant from each point to the next; cubic with continuous slope, without overshoot (PCHIP) or with visually
        pleasing curves (Akima); cubic with continuous curvature (a spline, not-a-knot or periodic at its ends).
    outside : {"hold", "periodic"}
        Beyond the first and last point: constant, or periodic; the last value of a smooth periodic table must equal the first.

    Examples
    --------
    >>> Table([0, 1, 1, 2], [0, 1, 3, 3])(np.array([0.5, 1.0, 5.0]))
    array([0.5, 3. , 3. ])
    >>> Table([0, 1, 2], [0, 1, 0], interpolation="cubic", outside="periodic")(np.array([0.5, 2.5, -1.0]))
    array([0.5, 0.5, 1. ])

    A fan with a tabulated torque-speed curve:

    >>> import gearlib as gl, gearparts as gp
    >>> class Fan(gl.Component):
    ...     def assemble(self):
    ...         self.rotor, self.drive = gp.Inertia(J=1.0), gp.Torque(tau=Table([0, 1, 1], [0, 0, 6]))
    ...         self.load = gp.Torque(tau=-Table([0, 10, 20], [0, 2, 8])(self.rotor.w))
    ...         return [gl.connect(self.drive.flange, self.rotor.flange_a, self.load.flange)]
    >>> float(round(gl.simulate(Fan(), 60.0, samples=2)["rotor.w"][-1], 4))
    16.6667
    """

    def __init__(self, t: ArrayLike, y: ArrayLike, interpolation: str = "linear", outside: str = "hold") -> None:
        self.t = reals("Table(t, y): t", t, "an increasing sequence of finite numbers, s").copy()
        self.y = reals("Table(t, y): y", y, "a sequence of finite numbers").copy()
        if self.t.ndim != 1 or self.t.shape != self.y.shape or len(self.t) < 1:
            raise ArgumentError(
                f"Table(t, y): expected two sequences of one length, got shapes {self.t.shape} and {self.y.shape}"
            )
        if (np.diff(self.t) < 0).any():
            raise ArgumentError("Table(t, y): the times must not decrease")
        self.interpolation = one_of("Table(t, y): interpolation", interpolation, INTERPOLATIONS)
        self.outside = one_of("Table(t, y): outside", outside, OUTSIDE)
        if self.outside == "periodic":
            self._check_period()
        if self.interpolation == "previous":  # piecewise constant, as steps
            self.t, self.y = np.repeat(self.t, 2)[1:], np.repeat(self.y, 2)[:-1]
        self.coefficients = _cubics(self.t, self.y, self.interpolation, self.outside == "periodic")
        self.origin: Table = self  # the table that `over` repeats
        self._repeated: Table | None = None
        self._corners: Floats | None = None
        for part in (self.t, self.y, self.coefficients):  # read-only, since derived values are cached
            part.flags.writeable = False

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        time: str = "time",
        column: str = "",
        interpolation: str = "linear",
        outside: str = "hold",
    ) -> Table:
        r"""Read a table from two columns of a file.

        Parameters
        ----------
        path : path
            A text file with a header line (``.csv``, ``.txt``, ...), separated by commas, semicolons, tabs or spaces; a Parquet file;
            or a result file.
        time, column : str
            Names of the columns with the times (s) and the values.
        interpolation, outside : str
            As for `Table`.

        Raises
        ------
        FileError, NameLookupError, ArgumentError
            The file cannot be read, lacks the column, or its numbers do not make a table; the message says where.

        Examples
        --------
        >>> path = getfixture("tmp_path") / "torque.csv"
        >>> _ = path.write_text("t,tau\n0,1\n2,5\n", encoding="utf-8")
        >>> Table.read(path, time="t", column="tau")(1.0).item()
        3.0
        """
        from gearlib.files.columns import read_columns

        source = as_path("path", path)
        names = (one_name("time", time, "t"), one_name("column", column, "tau"))
        if not column:
            raise ArgumentError(
                "Table.read: name the column with the values, as in Table.read('torque.csv', time='t', column='tau')"
            )
        t, y = read_columns(source, names)
        return cls._of(f"{source}: ", t, y, interpolation, outside)

    @classmethod
    def of(cls, data: Any, column: str | None = None, interpolation: str = "linear", outside: str = "hold") -> Table:
        """A table from a pandas Series, or from a column of a DataFrame; the index is the time, s.

        >>> import pandas
        >>> Table.of(pandas.Series([1.0, 5.0], index=[0.0, 2.0]))(1.0).item()
        3.0
        """
        pandas = optional("pandas")
        if isinstance(data, pandas.DataFrame):
            names = [str(name) for name in data.columns]
            column = one_name("column", column, "tau")
            if column not in names:
                raise NameLookupError(f"the table has no column '{column}'; {nearest(column, names)}")
            if (count := names.count(column)) > 1:
                raise ArgumentError(f"the table has {count} columns '{column}'; expected one")
            data = data.iloc[:, names.index(column)]
        if not isinstance(data, pandas.Series):
            raise ArgumentError(f"Table.of(data): data is {shown(data)}; expected a pandas Series or DataFrame")
        return cls._of("Table.of(data): ", data.index.to_numpy(), data.to_numpy(), interpolation, outside)

    @classmethod
    def _of(cls, said: str, t: Any, y: Any, interpolation: str, outside: str) -> Table:
        try:
            return cls(t, y, interpolation, outside)
        except ArgumentError as problem:
            raise ArgumentError(f"{said}{problem}") from None

    def _check_period(self) -> None:
        if len(self.t) < 2 or self.t[-1] == self.t[0]:
            raise ArgumentError("Table(t, y): a periodic table needs two times or more")
        if not self.straight and self.y[0] != self.y[-1]:
            raise ArgumentError(
                f"Table(t, y): a smooth periodic table ends with the value that it begins with, got {self.y[0]:g} and {self.y[-1]:g}"
            )

    @property
    def straight(self) -> bool:
        """Whether it is piecewise linear."""
        return self.interpolation in ("linear", "previous")

    @property
    def corners(self) -> Floats:
        """Times that a run steps to exactly, s: all points, unless the curve is known to be smooth at them."""
        return self.t if self._corners is None else self._corners

    @property
    def jumps(self) -> Floats:
        """Times at which its value jumps, s."""
        changes = np.diff(self.y) != 0
        found: Floats = self.t[1:][changes if self.interpolation == "previous" else changes & (np.diff(self.t) == 0)]
        return found

    @property
    def decisive(self) -> Floats:
        """Times at which its value may jump; it does so without two equal times where it was joined of several tables."""
        return self.jumps if self._corners is None else self.t

    def between(self, begin: float, end: float) -> Table:
        """The part between two times; its first and last piece extend beyond its ends."""
        first = max(int(np.searchsorted(self.t, begin, side="right")) - 1, 0)
        last = max(int(np.searchsorted(self.t, end, side="left")), first + 1)
        found = copy(self)
        found.t, c = self.t[first:last].copy(), self.coefficients[:, first:last].copy()
        if (s := begin - found.t[0]) and math.isfinite(s):
            a0, a1, a2, a3 = c[:, 0]
            c[:, 0] = a0 + s * (a1 + s * (a2 + s * a3)), a1 + s * (2 * a2 + 3 * s * a3), a2 + 3 * s * a3, a3
            found.t[0] = begin
        found.coefficients, found.y = c, c[0]
        return found

    def later(self, by: float) -> Table:
        """The same values some time later, s.

        >>> Table([0, 1], [2, 3]).later(0.5)([0.5, 1.5])
        array([2., 3.])
        """
        found = copy(self)
        found.t, found.origin, found._repeated = self.t + by, found, None
        if self._corners is not None:
            found._corners = self._corners + by
        return found

    def beginning_at(self, instants: Floats, same: float) -> Table:
        """The table with the times that come after an instant by less than ``same`` (s) moved there, if it may jump at any.

        >>> Table([0.0, 3 * 0.1], [1.0, 2.0], "previous").beginning_at(np.array([0.3]), 1e-15)(0.3).item()
        2.0
        """

        def moved(times: Floats) -> Floats:
            there = np.append(instants, math.inf)[np.searchsorted(instants, times - same)]
            return np.asarray(np.minimum(times, there), float)

        decisive = self.decisive
        if not (moved(decisive) < decisive).any():
            return self
        found = copy(self)
        found.t, found.origin, found._repeated = moved(self.t), found, None
        if self._corners is not None:
            found._corners = moved(self._corners)
        return found

    def over(self, t0: float, t1: float) -> Table:
        """The table over an interval (s), with periods unrolled.

        Raises
        ------
        ArgumentError
            There are too many periods.
        """
        t0, t1 = real("t0", t0), real("t1", t1)
        if not t0 <= t1:
            raise ArgumentError(f"t1 is {t1:g}, before t0, which is {t0:g} s")
        whole = self.origin
        if whole.outside != "periodic":
            return self
        kept = whole._repeated
        if kept is None or not kept.t[0] <= t0 <= t1 <= kept.t[-1]:
            whole._repeated = kept = whole._unrolled(t0, t1)
        return kept

    def _unrolled(self, t0: float, t1: float) -> Table:
        period = self.t[-1] - self.t[0]
        first, last = math.floor((t0 - self.t[0]) / period), math.ceil((t1 - self.t[0]) / period)
        if (last - first + 1) * len(self.t) > MOST_KNOTS:
            raise ArgumentError(
                f"a table with a period of {period:g} s comes {last - first} times from {t0:g} to {t1:g} s, which is too often; give a "
                "function of time instead"
            )
        shifts = period * np.arange(first, last + 1)
        found = copy(self)
        # Where periods join, rounding must not step back in time
        found.t = np.maximum.accumulate((shifts[:, None] + self.t).ravel())
        found.y = np.tile(self.y, len(shifts))
        found.coefficients = np.tile(self.coefficients, len(shifts))
        found.outside = "hold"
        return found

    def expression(self, x: Any, events: bool) -> Any:
        """The table as a function of an expression.

        Raises
        ------
        ArgumentError
            A periodic table, or one with more points than an equation admits.
        """
        if self.outside == "periodic":
            raise ArgumentError(
                "Table(t, y): a periodic table is not a function in an equation; leave the input unbound and give the table to "
                "simulate(inputs={...})"
            )
        return piecewise_polynomial("Table(t, y)", x, self.t, self.coefficients, events)

    def __call__(self, time: Any, events: bool = False) -> Any:
        if is_symbolic(time):
            return self.expression(time, flag("events", events))
        t = reals("time", time, "finite numbers, s")
        if self.outside == "periodic":
            t = self.t[0] + (t - self.t[0]) % (self.t[-1] - self.t[0])
        k = np.searchsorted(self.t, t, side="right")
        piece = np.maximum(k - 1, 0)
        since = np.where(k > 0, t - self.t[piece], 0.0)
        c0, c1, c2, c3 = self.coefficients[:, piece]
        result: Floats = c0 + since * (c1 + since * (c2 + since * c3))
        return result

    def lines(self, starts: Floats, inside: Floats) -> tuple[Floats, Floats]:
        """Values and slopes of the linear pieces just after some times; ``inside`` (s) later they are still valid."""
        k = np.searchsorted(self.t, starts + inside, side="right")
        piece = np.maximum(k - 1, 0)
        slopes = np.where(k > 0, self.coefficients[1, piece], 0.0)
        return self.y[piece] + slopes * (starts - self.t[piece]), slopes


def concatenated(parts: Sequence[Table], corners: Sequence[float]) -> Table:
    """Tables that follow each other as one, with the times that a run steps to exactly.

    >>> both = concatenated([Table([0, 1], [0, 1]).between(0.0, 1.0), Table([1, 2], [5, 6])], [1.0])
    >>> both([0.5, 1.0, 1.5]), both.corners
    (array([0.5, 5. , 5.5]), array([1.]))
    """
    found = copy(parts[0])
    found.t = np.maximum.accumulate(np.concatenate([part.t for part in parts]))
    found.coefficients = np.hstack([part.coefficients for part in parts])
    found.y, found.interpolation, found.outside = found.coefficients[0], "cubic", "hold"
    found.origin, found._repeated, found._corners = found, None, np.unique(np.asarray(corners, float))
    return found


class Table2D:
    """Function of two variables on a rectangular grid, bilinear in each cell: the map of an engine or a motor.

    ``table(self.w, self.throttle)`` is its value in an equation, with exact slopes; outside the grid it takes the value at the nearest
    point of the edge. The grid lines raise no events unless ``events=True`` asks for them.

    Parameters
    ----------
    x : sequence of float, shape (n,)
    y : sequence of float, shape (m,)
        Increasing.
    z : sequence of sequences of float, shape (n, m)
        Values at the grid points; at most 800.

    Examples
    --------
    >>> torque = Table2D([0, 100, 200], [0, 1], [[0, 50], [0, 80], [0, 60]])
    >>> torque([50.0, 300.0], 0.5)
    array([32.5, 30. ])
    """

    def __init__(self, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> None:
        self.x, self.y = (
            reals(f"Table2D(x, y, z): {name}", given, "an increasing sequence of finite numbers").copy()
            for name, given in (("x", x), ("y", y))
        )
        self.z = reals("Table2D(x, y, z): z", z, "rows of finite numbers, one for each x").copy()
        if self.x.ndim != 1 or self.y.ndim != 1 or self.z.shape != (len(self.x), len(self.y)) or not self.z.size:
            raise ArgumentError(
                f"Table2D(x, y, z): z has the shape {self.z.shape}; expected a row for each of the {self.x.size} x, a number in it for "
                f"each of the {self.y.size} y"
            )
        for name, given in (("x", self.x), ("y", self.y)):
            if (np.diff(given) <= 0).any():
                raise ArgumentError(f"Table2D(x, y, z): {name} must increase")
        for part in (self.x, self.y, self.z):
            part.flags.writeable = False

    def __call__(self, x: Any, y: Any, events: bool = False) -> Any:
        if is_symbolic(x) or is_symbolic(y):
            return bilinear("Table2D(x, y, z)", x, y, self.x, self.y, self.z, flag("events", events))
        places = np.broadcast_arrays(reals("x", x, "finite numbers"), reals("y", y, "finite numbers"))
        (i, u), (j, v) = (cell(knots, place) for knots, place in zip((self.x, self.y), places, strict=True))
        a, b = np.minimum(i + 1, len(self.x) - 1), np.minimum(j + 1, len(self.y) - 1)
        lower, upper = (self.z[k, j] + (self.z[k, b] - self.z[k, j]) * v for k in (i, a))
        return lower + (upper - lower) * u


def cell(knots: Floats, places: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Index of the interval that contains a point, and the relative position in it, 0 to 1."""
    i = np.clip(np.searchsorted(knots, places, side="right") - 1, 0, max(len(knots) - 2, 0))
    width = knots[np.minimum(i + 1, len(knots) - 1)] - knots[i]
    share = np.divide(places - knots[i], width, out=np.zeros(np.shape(places)), where=width > 0)
    return i, np.clip(share, 0.0, 1.0)


def _cubics(t: Floats, y: Floats, interpolation: str, periodic: bool) -> Floats:
    """Cubic coefficients in powers of the time since each point, shape (4, points); constant after the last one."""
    found = np.zeros((4, len(t)))
    found[0] = y
    if interpolation in ("linear", "previous") or len(t) < 2:
        width = np.diff(t)
        np.divide(np.diff(y), width, out=found[1, :-1], where=width > 0.0)
        return found
    if (np.diff(t) == 0).any():
        raise ArgumentError(f"Table(t, y): two equal times make a step, which interpolation={interpolation!r} does not know")
    from scipy.interpolate import Akima1DInterpolator, CubicSpline, PchipInterpolator

    if interpolation == "cubic":
        pieces = CubicSpline(t, y, bc_type="periodic" if periodic else "not-a-knot")
        found[:, :-1] = pieces.c[::-1]
        return found
    made = PchipInterpolator if interpolation == "monotone" else Akima1DInterpolator
    if not periodic:
        pieces = made(t, y)
        found[: len(pieces.c), :-1] = pieces.c[::-1]
        return found
    period, n = t[-1] - t[0], len(t) - 1
    before = np.concatenate([t[:-1] - period, t[:-1], t + period])
    pieces = made(before, np.concatenate([y[:-1], y[:-1], y]))  # periodic extension, for the slopes at the ends
    found[: len(pieces.c), :-1] = pieces.c[::-1, n : 2 * n]
    return found


def as_table(value: Any) -> Any:
    """A table from an equivalent input: a pair of sequences (times, values), or a pandas Series; other values are returned as they are.

    >>> as_table(([0.0, 2.0], [1.0, 5.0]))(1.0).item()
    3.0
    """
    pandas = sys.modules.get("pandas")  # whoever has a Series has imported pandas
    if pandas is not None and isinstance(value, pandas.Series):
        return Table.of(value)
    if isinstance(value, tuple) and len(value) == 2:
        return Table(*value)
    return value


Signal = Any  # a number, a FunctionInput, or a Table


def unrolled(signals: Sequence[Signal], t0: float, t1: float) -> tuple[Signal, ...]:
    """The signals over an interval (s): periodic tables with their periods there, which native code does not know."""
    return tuple(s.over(t0, t1) if isinstance(s, Table) else s for s in signals)


def breakpoints(signals: Sequence[Signal]) -> Floats:
    """Times of all corners of tables."""
    tables = [s.corners for s in signals if isinstance(s, Table)]
    if not tables:
        return np.empty(0)
    corners = np.sort(np.concatenate([np.empty(0), *tables]))
    return corners[np.diff(corners, prepend=-np.inf) > 0]


@dataclass(frozen=True)
class FunctionInput:
    """An input given by a Python function of time; errors name it by its path.

    What a function reads may change after the run, whose variables are computed when they are asked for: then it no longer is the
    input of the run. So some of its values are remembered with the run.

    Raises
    ------
    ArgumentError
        When called: the function fails, or returns anything but a finite number.
    """

    path: str
    function: Callable[[float], Any]
    remembered: dict[float, float] = field(default_factory=dict, compare=False, repr=False)  # values at some times of the run

    def __call__(self, t: float) -> float:
        try:
            value = self.function(t)
        except Exception as problem:
            raise ArgumentError(f"{self._at(t, 'raised')} {type(problem).__name__}: {problem}") from problem
        return finite(lambda: self._at(t, "returned"), value)

    def remember(self, times: Floats) -> None:
        """Remember the values at some samples of the run, unless it is a repeated one."""
        if not self.remembered:
            self.remembered.update((t, self(t)) for t in times[:: max(1, len(times) // REMEMBERED)].tolist())

    def confirm(self) -> None:
        """Raise `ArgumentError` if the function returns other values than in the run."""
        for t, value in self.remembered.items():
            now = self(t)
            if now != value:
                raise ArgumentError(
                    f"{self._at(t, 'returned')} {now:.9g}, but {value:.9g} in the run: something that it reads has changed since, and "
                    "what is computed now would not belong to the run. Bind what it reads, such as the variable of a loop: "
                    "lambda t, k=k: ..."
                )

    def _at(self, t: float, did: str) -> str:
        name = getattr(self.function, "__name__", None) or shown(self.function)
        return f"the function {name} of the input {self.path}, called with t = {t:.9g} s, {did}"


def values_in_run(signals: Sequence[Signal], times: Floats) -> Floats:
    """As `values`, of the inputs of a run that is over.

    Raises
    ------
    ArgumentError
        A function returns other values than in the run.
    """
    for signal in signals:
        if isinstance(signal, FunctionInput):
            signal.confirm()
    return values(signals, times)


def values(signals: Sequence[Signal], times: Floats) -> Floats:
    """Values of the signals at some times, shape (signals, times)."""
    rows = []
    for signal in signals:
        if isinstance(signal, Table):
            rows.append(signal(times))
        elif callable(signal):
            rows.append(np.array([signal(float(t)) for t in times]))
        else:
            rows.append(np.full(len(times), float(signal)))
    return np.array(rows, float).reshape(len(rows), len(times))


def slopes_before(signals: Sequence[Signal], t: float, longest: float) -> Floats:
    """Slopes (1/s) of the signals just before a time, with values of functions from within ``longest`` (s) before it.

    >>> slopes_before([3.0, Table([0, 1, 3], [0, 2, 0]), lambda t: 5.0 * t], 1.0, 1.0)
    array([0., 2., 5.])
    """
    found = [
        _slope_of_table(s, t) if isinstance(s, Table) else _slope_of_function(s, t, longest) if callable(s) else 0.0
        for s in signals
    ]
    return np.array(found, float)


def _slope_of_table(table: Table, t: float) -> float:
    begin, period = table.t[0], table.t[-1] - table.t[0]
    if table.outside == "periodic":
        t = begin + ((t - begin) % period or period)
    piece = int(np.searchsorted(table.t, t)) - 1
    if piece < 0:
        return 0.0
    since, (_, c1, c2, c3) = t - table.t[piece], table.coefficients[:, piece]
    return float(c1 + since * (2.0 * c2 + 3.0 * since * c3))


def _slope_of_function(function: Callable[[float], float], t: float, longest: float) -> float:
    """Slope by differences of second order, over the interval where rounding and curvature are least.

    Only the function knows how fast it is, so that ever longer intervals are tried. A jump is as steep as over the shortest one.
    """
    if not longest:
        return 0.0
    value, h = function(t), RESOLVED * math.ulp(max(abs(t), longest))
    longest = max(longest, 32.0 * h)  # three intervals
    largest, least, found = abs(value), math.inf, 0.0
    known: list[tuple[float, float]] = []  # slope, and change of the function, over each interval
    while 2.0 * h <= longest:
        near, far = function(t - h), function(t - 2.0 * h)
        first, second = t - (t - h), t - (t - 2.0 * h)  # as the clock knows them
        steep = (value - near) / first
        slope = steep + (steep - (near - far) / (second - first)) * first / second
        largest = max(largest, abs(near), abs(far))
        if known:
            error = abs(slope - known[-1][0]) + 4.0 * math.ulp(largest) / h
            if error < least:
                least, found = error, known[-1][0]
            elif error > 100.0 * least:
                break
        known.append((slope, abs(value - near)))
        h *= 4.0
    if len(known) > 1 and known[0][1] > max(JUMP * largest, 0.5 * known[1][1]):
        return known[0][0]
    return found
