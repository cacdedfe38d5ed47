"""When the periods of a tabulated signal begin, and its pieces, at numbers."""

from __future__ import annotations

import math
from typing import Any

import pytest
import sympy

import gearlib as gl
from gearlib.flatten.flatten import flatten
from gearparts.blocks.time_tables import CombiTimeTable, TableColumn
from tests.gearparts.blocks.bench import Driven, answer, close
from tests.gearparts.laws import right_side, stated

ROWS = ((0.25, 0.5, 0.75, 1.25), (1.0, 3.0, -2.0, 4.0))  # of a period of 1 s
FIRST = 0.25


def column(extrapolation: str, kind: Any = "linear") -> TableColumn:
    return TableColumn(table=gl.Table(*ROWS, kind), extrapolation=extrapolation, offset=0.0, start_time=0.0, shift_time=0.0)


PERIODIC = column("periodic")


def start_of_period(time: float, shift: float, *, instant: bool = False, initial: bool = False, before: float = 0.0) -> float:
    """What T0 becomes, in a run that is at an instant of a period's begin, or starts, or in neither."""
    law = stated(PERIODIC)["T0"].replace(lambda e: e.func.__name__ == "Sample", lambda e: sympy.Float(float(instant)))
    values = {"time": time, "shift_time": shift, "pre(T0)": before, "initial()": float(initial)}
    return float(law.xreplace({s: sympy.Float(values[s.name]) for s in law.free_symbols}))


@pytest.mark.parametrize("periods", [-40, -3, -1, 0, 1, 2, 7, 1000])
@pytest.mark.parametrize("part", [0.1, 0.4, 0.6, 0.9])
def test_a_run_starts_within_the_period_of_its_time(periods: int, part: float) -> None:
    """Its table's first row is then ``part`` of a period ago."""
    time = 3.0 + FIRST + periods + part
    assert time - start_of_period(time, 3.0, initial=True) - FIRST == pytest.approx(part, abs=1e-9)


def test_a_run_that_starts_where_a_period_begins_but_for_rounding_starts_with_the_first_row() -> None:
    instants = [(k * 1.1 + s, s - FIRST) for s in (0.1, 0.3, 0.7) for k in (0, 10, 20, 70, 130)]
    instants += [(0.3, 0.1 + 0.2 - FIRST), (math.nextafter(0.3, 0.0), 0.3 - FIRST), (0.25, math.nextafter(0.0, 1.0))]
    instants += [(math.nextafter(time, 0.0), shift) for time, shift in instants if time > 20.0]
    for time, shift in instants:
        turned = time - shift - FIRST
        assert abs(turned - round(turned)) < 1e-13
        assert time - start_of_period(time, shift, initial=True) == pytest.approx(FIRST, abs=1e-12), (time, shift)


def test_periods_follow_each_other_before_the_first_instant_too() -> None:
    """With the table's zero at 3 s, instants begin at 3.25 s; what is before them is counted from the last begin."""
    assert start_of_period(4.5, 3.0, instant=True, before=2.0) == 4.25
    assert start_of_period(2.75, 3.0, before=1.5) == 2.5, "1.25 s after the zero, where the last row is"
    assert start_of_period(2.5, 3.0, before=1.5) == 1.5
    assert start_of_period(3.0, 3.0, before=1.5) == 2.5, "the first instant is not yet"
    assert start_of_period(3.5, 3.0, before=1.5) == 1.5, "after the first instant they alone count"


def value(block: TableColumn, since: float, **more: float) -> float:
    given = {"time": 10.0 + since, "T0": 10.0, "shift_time": 10.0, "start_time": 10.0} | more
    return right_side(block, "y", **given)


def test_a_column_goes_through_its_rows_and_on_by_its_law() -> None:
    inside = ((0.25, 1.0), (0.375, 2.0), (0.5, 3.0), (0.625, 0.5), (0.75, -2.0), (1.0, 1.0))
    for extrapolation, before, after in (("lines", -1.0, 10.0), ("hold", 1.0, 4.0), ("periodic", -1.0, 10.0)):
        block = column(extrapolation)
        for since, y in (*inside, (0.0, before), (1.75, after)):
            assert value(block, since) == pytest.approx(y, abs=1e-12), (extrapolation, since)
        assert value(block, 1.25) == pytest.approx(4.0, abs=1e-12)
        assert value(block, 0.5, offset=7.0) == 10.0
        assert value(block, 0.5, offset=7.0, start_time=10.5) == 10.0
        assert value(block, 0.5, offset=7.0, start_time=10.6) == 7.0


def test_a_column_in_steps_holds_each_row_up_to_the_next_one() -> None:
    for extrapolation in ("lines", "hold"):
        block = column(extrapolation, "previous")
        for since, y in ((0.0, 1.0), (0.25, 1.0), (0.4, 1.0), (0.5, 3.0), (0.75, -2.0), (1.2, -2.0), (1.25, 4.0), (3.0, 4.0)):
            assert value(block, since) == y, (extrapolation, since)
    block = column("periodic", "previous")
    assert [value(block, since) for since in (0.3, 0.5, 0.6, 0.75, 1.2)] == [1.0, 3.0, 3.0, -2.0, -2.0]


@pytest.mark.parametrize("extrapolation", ["lines", "hold"])
def test_a_single_row_is_a_constant(extrapolation: str) -> None:
    t, y = answer(CombiTimeTable, out="outputs[0].y", table=[[0.5, 3.0]], extrapolation=extrapolation, samples=5)
    assert (y == 3.0).all(), t


@pytest.mark.parametrize("rows", [[[0.0, 9.0], [0.0, 2.0], [1.0, 4.0]], [[0.0, 2.0], [1.0, 4.0], [1.0, 9.0]]])
def test_a_period_may_begin_or_end_with_a_step(rows: list[list[float]]) -> None:
    t, y = answer(CombiTimeTable, out="outputs[0].y", table=rows, extrapolation="periodic", samples=9)
    assert close(y, 2.0 + 2.0 * (t % 1.0), 1e-9)


def refusal(**values: Any) -> str:
    """What is raised for a table's values."""
    try:
        flatten(Driven(make=lambda: CombiTimeTable(**values)))
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def test_columns_are_counted_from_one() -> None:
    table = [[0.0, 1.0, 2.0], [1.0, 3.0, 4.0]]
    assert not refusal(table=table, columns=[1, 2])
    for columns in ([0], [3], [-1], [1.5], [None]):
        assert refusal(table=table, columns=columns).startswith("BindingError: CombiTimeTable: columns is"), columns


def test_a_curve_goes_on_with_its_slopes() -> None:
    """A parabola's cubic pieces are the parabola, whose slopes at the ends are 2 and -6."""
    times = (0.0, 1.0, 2.0, 3.0, 4.0)
    table = gl.Table(times, [2.0 * t - t**2 for t in times], "akima")
    curve = table.coefficients.T
    first, last = curve[0][1], curve[-2][1] + 2 * curve[-2][2] + 3 * curve[-2][3]
    assert (first, last) == pytest.approx((2.0, -6.0), abs=1e-12)
    block = TableColumn(table=table, extrapolation="lines", offset=0.0, start_time=0.0, shift_time=0.0)
    for since, y in ((-0.5, -1.0), (0.5, 0.75), (1.5, 0.75), (2.5, -1.25), (5.5, -17.0)):
        assert value(block, since, start_time=0.0) == pytest.approx(y, abs=1e-12)
