"""Polynomials of tables as they are stored: powers of the time since each point, constant after the last one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator, CubicSpline, PchipInterpolator

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.solvers.inputs import table
from gearlib.solvers.inputs.table import concatenated

T, Y = np.array([0.0, 0.5, 0.8, 1.7, 2.0]), np.array([1.0, 3.0, -1.0, 0.5, 1.0])


def test_lines_and_steps() -> None:
    """Two points at one time: a step, whose piece of no length has no slope."""
    none = [0.0] * 4
    lines = gl.Table([0.0, 1.0, 1.0, 3.0], [0.0, 2.0, 5.0, 1.0])
    assert lines.coefficients.tolist() == [[0.0, 2.0, 5.0, 1.0], [2.0, 0.0, -2.0, 0.0], none, none]
    steps = gl.Table([0.0, 1.0, 3.0], [2.0, 5.0, 1.0], "previous")
    assert steps.t.tolist() == [0.0, 1.0, 1.0, 3.0, 3.0]
    assert steps.y.tolist() == [2.0, 2.0, 5.0, 5.0, 1.0]
    assert steps.coefficients[1:].tolist() == [[0.0] * 5] * 3
    for kind in ("linear", "cubic", "monotone", "akima", "previous"):
        assert gl.Table([1.0], [7.0], kind).coefficients.tolist() == [[7.0], [0.0], [0.0], [0.0]]
    for kind in ("cubic", "monotone", "akima"):
        with pytest.raises(ArgumentError, match=f"two equal times make a step, which interpolation='{kind}' does not know"):
            gl.Table([1.0, 1.0], [0.0, 1.0], kind)


@pytest.mark.parametrize("kind", ["cubic", "monotone", "akima"])
@pytest.mark.parametrize("outside", ["hold", "periodic"])
def test_smooth_pieces_are_scipys(kind: str, outside: str) -> None:
    """Of a periodic table those of one that goes on before and behind."""
    own = gl.Table(0.25 + T, Y, kind, outside)
    assert own.coefficients[:, -1].tolist() == [Y[-1], 0.0, 0.0, 0.0]
    t, y = 0.25 + T, Y
    if outside == "periodic" and kind != "cubic":
        t, y = (np.concatenate([t[:-1] - 2.0, t[:-1], t + 2.0]), np.concatenate([y[:-1], y[:-1], y]))
    pieces: Any = {
        "cubic": lambda: CubicSpline(t, y, bc_type="periodic" if outside == "periodic" else "not-a-knot"),
        "monotone": lambda: PchipInterpolator(t, y), "akima": lambda: Akima1DInterpolator(t, y),
    }[kind]()  # fmt: skip
    first = 4 if outside == "periodic" and kind != "cubic" else 0
    assert own.coefficients[:, :-1] == pytest.approx(pieces.c[::-1, first : first + 4], rel=1e-12, abs=1e-12)
    two = gl.Table([0.0, 2.0], [1.0, 5.0], kind)
    assert two([0.5, 1.0, 9.0]) == pytest.approx([2.0, 3.0, 5.0])


@pytest.mark.parametrize("last", [0, 1, 5])
def test_a_periodic_table_has_so_many_knots_over_a_run(last: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each period that it touches, the one that begins at its end included."""
    end = last * 2.0 + 1.0
    for begin, periods in ((0.0, last + 2), (-0.5, last + 3)):
        for most in (5 * periods, 5 * periods - 1):
            monkeypatch.setattr("gearlib.solvers.inputs.table.MOST_KNOTS", most)
            own = gl.Table(T, Y, outside="periodic")
            if most == 5 * periods:
                assert len(own.over(begin, end).t) == most
            else:
                with pytest.raises(ArgumentError, match=rf"comes {periods - 1} times from .* which is too often"):
                    own.over(begin, end)


def test_a_repeated_table_is_kept_while_it_reaches_far_enough() -> None:
    own = gl.Table(T, Y, outside="periodic")
    whole = own.over(0.5, 7.0)
    assert own.over(0.5, 7.0) is whole.over(1.0, 2.0) is whole
    assert own.over(-0.5, 7.0) is not whole
    again = own.over(0.5, 7.0)
    assert own.over(0.5, again.t[-1] + 0.5) is not again


def test_a_part_may_begin_at_any_time() -> None:
    """At a point it is the table from there on; without a beginning it is all of it up to its end."""
    for kind in ("linear", "cubic"):
        own = gl.Table(T, Y, kind)
        whole = own.between(-np.inf, 1.0)
        assert whole.t.tolist() == T[:3].tolist()
        assert whole.coefficients.tolist() == own.coefficients[:, :3].tolist()
        part = own.between(0.5, 1.0)
        assert (part.t.tolist(), part.coefficients.tolist()) == (T[1:3].tolist(), own.coefficients[:, 1:3].tolist())
        later = own.between(0.6, 0.7)
        assert later.t.tolist() == [0.6]
        t = np.array([0.6, 0.65, 0.79])
        assert later(t) == pytest.approx(own(t), rel=1e-13)
        assert later.y.tolist() == later.coefficients[0].tolist()


def test_a_later_table_has_its_corners_later() -> None:
    both = concatenated([gl.Table([0.0, 1.0], [0.0, 1.0]).between(0.0, 1.0), gl.Table([1.0, 2.0], [5.0, 6.0])], [1.0, 0.5, 1.0])
    assert both.corners.tolist() == [0.5, 1.0]
    moved = both.later(0.25)
    assert moved.corners.tolist() == [0.75, 1.25]
    assert both.corners.tolist() == [0.5, 1.0]
    assert moved.t.tolist() == (both.t + 0.25).tolist()
    assert (both.interpolation, both.outside, both.origin) == ("cubic", "hold", both)
    plain = gl.Table(T, Y, outside="periodic")
    plain.over(0.0, 5.0)
    later = plain.later(10.0)
    assert later.corners.tolist() == (T + 10.0).tolist()
    assert later.over(10.0, 11.0).t[0] == 10.0
    assert later.origin is later


def test_cells_of_a_grid() -> None:
    """The place in each, held at the edge; a single line is a cell of no width."""
    knots = np.array([0.0, 1.0, 4.0])
    i, share = table.cell(knots, np.array([-1.0, 0.0, 0.25, 1.0, 2.5, 4.0, 9.0]))
    assert i.tolist() == [0, 0, 0, 1, 1, 1, 1]
    assert share.tolist() == [0.0, 0.0, 0.25, 0.0, 0.5, 1.0, 1.0]
    i, share = table.cell(knots[:2], np.array([0.5, 1.0, 9.0]))
    assert (i.tolist(), share.tolist()) == ([0] * 3, [0.5, 1.0, 1.0])
    i, share = table.cell(np.array([2.0]), np.array([1.0, 2.0, 3.0]))
    assert (i.tolist(), share.tolist()) == ([0] * 3, [0.0] * 3)


def test_numbers_of_tables_cannot_be_changed() -> None:
    """What was derived from them would not follow."""
    own, grid = gl.Table(T, Y), gl.Table2D([0.0, 1.0], [0.0, 2.0], [[1.0, 2.0], [3.0, 4.0]])
    for part in (own.t, own.y, own.coefficients, grid.x, grid.y, grid.z):
        assert not part.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            part[0] = 7.0
