"""Signals tabulated over time: several columns, as in Modelica.Blocks.Sources.CombiTimeTable."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import gearlib as gl
from gearlib.arguments import is_real, shown
from gearlib.errors import BindingError
from gearparts.blocks.interfaces import SO, Block
from gearparts.tables import check_rows

INTERPOLATIONS = {"linear": "linear", "constant": "previous", "akima": "akima", "monotone": "monotone"}
EXTRAPOLATIONS = ("lines", "hold", "periodic")


class TableColumn(SO):
    """One column of a `CombiTimeTable`."""

    table = gl.Structural(None, "gl.Table of the column")
    extrapolation = gl.Structural("lines", "as of CombiTimeTable")
    offset = gl.Parameter("any", "added to the signal, also before it begins")
    start_time = gl.Parameter("s", "time at which the signal begins")
    shift_time = gl.Parameter("s", "time of the table's zero")
    T0 = gl.Discrete("start of the period")

    def equations(self) -> list[gl.Eq]:
        t, periodic = self.table.t, self.extrapolation == "periodic"
        law = _pieces(self.table, gl.time - self.T0 if periodic else gl.time - self.shift_time, self.extrapolation)
        begun = gl.Piecewise((0, gl.time < self.start_time), (law, True))
        if not periodic:
            return [gl.Eq(self.T0, gl.pre(self.T0)), gl.Eq(self.y, self.offset + begun)]
        period, first = float(t[-1] - t[0]), float(t[0])
        turn = 2 * gl.pi * (gl.time - self.shift_time - first) / period
        angle, rounding = gl.atan2(gl.sin(turn), gl.cos(turn)) / (2 * gl.pi), 1e-15 * (1 + abs(turn))
        since = period * gl.no_event(
            gl.Piecewise((angle, angle >= -rounding), (angle + 1, True))
        )  # where a run starts between instants
        instant = gl.sample(period, self.shift_time + first)  # has no instants before the first one
        earlier = gl.And(gl.time < self.shift_time + first, gl.time - gl.pre(self.T0) >= t[-1])
        begin = gl.Piecewise(
            (gl.time - first, instant),
            (gl.time - since - first, gl.initial()),
            (gl.pre(self.T0) + period, earlier),
            (gl.pre(self.T0), True),
        )
        return [gl.Eq(self.T0, begin), gl.Eq(self.y, self.offset + begun)]


class CombiTimeTable(Block):
    """Signals tabulated over time: the columns of a table, outputs ``outputs[0].y``, ``outputs[1].y``, ....

    Before ``start_time`` each is ``offset``. ``smoothness`` is "linear", "constant" (each row's values hold up to the next), "akima" or
    "monotone" (cubics that do not overshoot); ``extrapolation`` is "lines" (the slopes at the ends go on, Modelica's LastTwoPoints),
    "hold" (HoldLastPoint) or "periodic". The run steps to each row's time exactly. Two rows at one time make a step, which "akima" and
    "monotone" do not know; "lines" hold the value beyond a step at an end.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Driven(gl.Component):
    ...     def assemble(self):
    ...         self.plan = gp.blocks.CombiTimeTable(table=[[0, 0, 1], [1, 4, 3], [2, 0, 5]], extrapolation="hold")
    ...         self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
    ...         return [gl.connect(self.plan.outputs[0].y, self.torque.tau), gl.connect(self.torque.flange, self.load.flange_a)]
    >>> result = gl.simulate(Driven(), t_end=3.0, samples=4)
    >>> result["load.w"].round(9), result["plan.outputs[1].y"]
    (array([0., 1., 2., 2.]), array([1., 3., 5., 5.]))
    """

    table = gl.Structural((), "rows: a time, s, and a value for each column")
    columns = gl.Structural((), "which columns, from 1 for the first one behind the time; nothing: all")
    smoothness = gl.Structural("linear", "linear, constant, akima or monotone")
    extrapolation = gl.Structural("lines", "lines, hold or periodic")
    offset = gl.Parameter("any", "added to the signals, also before they begin", default=0.0)
    start_time = gl.Parameter("s", "time at which the signals begin", default=0.0)
    shift_time = gl.Parameter("s", "time of the table's zero", default=lambda table: table.start_time)

    def assemble(self) -> Sequence[gl.Connection]:
        rows, columns = self._rows()
        self.outputs = [
            TableColumn(
                table=gl.Table([row[0] for row in rows], [row[c] for row in rows], INTERPOLATIONS[self.smoothness]),
                extrapolation=self.extrapolation, offset=self.offset, start_time=self.start_time, shift_time=self.shift_time,
            )
            for c in columns
        ]  # fmt: skip
        return []

    def _rows(self) -> tuple[Any, tuple[int, ...]]:
        """The table's rows and the columns that are outputs, checked."""
        said = "CombiTimeTable"
        for name, value, known in (
            ("smoothness", self.smoothness, tuple(INTERPOLATIONS)), ("extrapolation", self.extrapolation, EXTRAPOLATIONS),
        ):  # fmt: skip
            if value not in known:
                raise BindingError(f"{said}: {name} is {shown(value)}; expected {', '.join(map(repr, known))}")
        try:
            width = len(self.table[0])
        except Exception:  # no rows, or a sequence of the user's that fails
            width = 0
        if width < 2:
            raise BindingError(f"{said}: table is {shown(self.table)}; expected rows of a time and one or more values")
        rows = check_rows(f"{said}: table", self.table, width, steps=True)
        step = next((row[0] for row, following in pairwise(rows) if row[0] == following[0]), None)
        if step is not None and self.smoothness in ("akima", "monotone"):
            raise BindingError(
                f"{said}: table has two rows at {step:g} s, a step, which smoothness={self.smoothness!r} does not know"
            )
        columns = tuple(self.columns) or tuple(range(1, width))
        if not all(is_real(c) and c == int(c) and 1 <= c < width for c in columns):
            raise BindingError(f"{said}: columns is {shown(self.columns)}; expected numbers from 1 to {width - 1}")
        if self.extrapolation == "periodic" and rows[0][0] == rows[-1][0]:
            raise BindingError(f"{said}: a periodic table needs two times or more")
        return rows, tuple(int(c) for c in columns)


def _pieces(table: gl.Table, x: Any, extrapolation: str) -> Any:
    """A table as a function of an expression, with what follows beyond its ends."""
    t, coefficients = table.t.tolist(), table.coefficients.T.tolist()
    spans = [k for k in range(len(t) - 1) if t[k + 1] > t[k]]  # without width, the next one takes over

    def law(k: int) -> Any:
        c, s = coefficients[k], x - t[k]
        return c[0] + s * (c[1] + s * (c[2] + s * c[3])) if any(c[1:]) else c[0]

    if extrapolation == "periodic":
        return gl.Piecewise(*((law(k), x < t[k + 1]) for k in spans[:-1]), (law(spans[-1]), True))
    first_slope = last_slope = 0.0
    if extrapolation == "lines" and spans:
        _, b, c, d = coefficients[-2]
        w = t[-1] - t[-2]
        first_slope, last_slope = coefficients[0][1], b + w * (2 * c + 3 * w * d)
    before, after = coefficients[0][0] + first_slope * (x - t[0]), coefficients[-1][0] + last_slope * (x - t[-1])
    return gl.Piecewise((before, x < t[0]), *((law(k), x < t[k + 1]) for k in spans), (after, True))
