"""Inputs of runs in lanes as straight pieces between corners: of tables that are written down."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.many_runs import in_lanes
from gearlib.many_runs import in_lanes as parts
from gearlib.many_runs.in_lanes import check_lanes

RISING = gl.Table([0.0, 0.5, 1.0], [0.0, 1.0, 3.0])
FALLING = gl.Table([-1.0, 0.25, 0.75, 2.0], [4.0, 4.0, 2.0, 2.0])
GRID = np.array([0.0, 0.25, 1.0])


def test_a_row_has_the_lines_between_the_corners_inside_the_run() -> None:
    """Each by its value at time zero and its slope; a number is level."""
    corners, lines = parts.row([RISING, 7.0], GRID)
    assert corners.tolist() == [0.5]
    assert lines == pytest.approx(np.array([[0.0, 2.0, 7.0, 0.0], [-1.0, 4.0, 7.0, 0.0]]))
    corners, lines = parts.row([RISING, FALLING], GRID)
    assert corners.tolist() == [0.25, 0.5, 0.75]
    assert lines[:, :2] == pytest.approx(np.array([[0.0, 2.0], [0.0, 2.0], [-1.0, 4.0], [-1.0, 4.0]]))
    assert lines[:, 2:] == pytest.approx(np.array([[4.0, 0.0], [5.0, -4.0], [5.0, -4.0], [2.0, 0.0]]))
    corners, lines = parts.row([3.0], GRID)
    assert (corners.tolist(), lines.tolist()) == ([], [[3.0, 0.0]])
    corners, lines = parts.row([RISING], np.array([0.6, 0.9]))
    assert (corners.tolist(), lines) == ([], pytest.approx(np.array([[-1.0, 4.0]])))


@pytest.mark.parametrize("t", [0.1, 0.3, 0.6, 0.8])
def test_a_line_is_the_table_where_it_holds(t: float) -> None:
    corners, lines = parts.row([RISING, FALLING], GRID)
    value, slope = lines[np.searchsorted(corners, t)].reshape(2, 2).T
    assert value + slope * t == pytest.approx([np.interp(t, table.t, table.y) for table in (RISING, FALLING)])


def test_runs_of_the_same_tables_share_a_row() -> None:
    corners, pieces = parts.pieces_of([[RISING] * 5, [7.0] * 5], np.array([1, 3, 4]), GRID)
    assert corners.tolist() == [[0.5]]
    assert pieces == pytest.approx(np.array([[[0.0, 2.0, 7.0, 0.0], [-1.0, 4.0, 7.0, 0.0]]]))
    corners, pieces = parts.pieces_of([], np.array([1, 3]), GRID)
    assert (corners.shape, pieces.shape) == ((1, 0), (1, 1, 0))


def test_runs_of_other_tables_have_a_row_each() -> None:
    """Rows with fewer corners have the others never, and go on with their last piece."""
    signals = [[RISING, FALLING, RISING, 5.0]]
    corners, pieces = parts.pieces_of(signals, np.array([3, 1, 0]), GRID)
    assert corners.tolist() == [[np.inf, np.inf], [0.25, 0.75], [0.5, np.inf]]
    assert pieces == pytest.approx(
        np.array([[[5.0, 0.0]] * 3, [[4.0, 0.0], [5.0, -4.0], [2.0, 0.0]], [[0.0, 2.0], [-1.0, 4.0], [-1.0, 4.0]]])
    )


def test_tables_of_straight_lines_with_few_corners_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    cubic = gl.Table([0.0, 0.4, 0.5, 1.0], [0.0, 1.0, 3.0, 0.0], interpolation="cubic")
    prepared: Any = SimpleNamespace(count=4, signals=[[RISING, cubic, 3.0, FALLING], [1.0] * 4, [RISING, RISING, cubic, 2.0]])
    assert parts.straight(prepared, [0, 2]).tolist() == [True, False, False, True]
    assert parts.straight(prepared, [0]).tolist() == [True, False, True, True]
    assert parts.straight(prepared, []).tolist() == [True] * 4
    monkeypatch.setattr(in_lanes, "MOST_CORNERS", 3)
    assert parts.straight(prepared, [0]).tolist() == [True, False, True, False]


@pytest.mark.parametrize("lanes", [1, 8, "auto", np.int64(8)])
def test_lanes_that_there_are(lanes: Any) -> None:
    check_lanes(lanes)


@pytest.mark.parametrize("lanes", [0, 2, 7, 9, True, 8.0, "8", "Auto", None, np.float64(8), np.array([8])])
def test_lanes_that_there_are_not(lanes: Any) -> None:
    with pytest.raises(ArgumentError, match=r"^lanes is .*; expected 'auto', 1 or 8$"):
        check_lanes(lanes)


@pytest.mark.parametrize("begin", [0.0, 2.0])
def test_the_inputs_of_a_run_are_lines_between_corners(begin: float) -> None:
    """In pairs of the value at time zero and the slope; corners outside the run, and at its ends, are none."""
    first, second = gl.Table([0.5, 1.0, 3.0], [1.0, 4.0, 0.0]), gl.Table([0.0, 2.5, 4.0], [3.0, 3.0, -1.0])
    signals = [first, 7.0, second, first, -2.0]
    grid = begin + np.array([0.0, 0.5, 2.0])
    corners, lines = in_lanes.row(signals, grid)
    inside = sorted({0.5, 1.0, 3.0, 2.5} & {t for t in (0.5, 1.0, 2.5, 3.0, 4.0) if grid[0] < t < grid[-1]})
    assert corners.tolist() == inside
    assert lines.shape == (len(inside) + 1, 10)
    edges = [grid[0], *inside, grid[-1]]
    for k, (a, b) in enumerate(zip(edges, edges[1:], strict=False)):
        t = np.linspace(a, b, 5)[1:-1]
        for j, signal in enumerate(signals):
            exact = signal(t) if isinstance(signal, gl.Table) else np.full(3, signal)
            assert lines[k, 2 * j] + lines[k, 2 * j + 1] * t == pytest.approx(exact, rel=1e-12)
