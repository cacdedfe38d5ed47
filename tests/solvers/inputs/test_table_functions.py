"""Tables as functions: shifted and repeated, cut and unrolled, as lines; maps of two variables against SciPy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.solvers.inputs.table import INTERPOLATIONS, FunctionInput, breakpoints, slopes_before, values

T, Y = np.array([0.0, 0.5, 0.8, 1.7, 2.0]), np.array([1.0, 3.0, -1.0, 0.5, 1.0])
kinds = pytest.mark.parametrize("kind", INTERPOLATIONS)
starts = pytest.mark.parametrize("start", [0.0, -1.5, 2.0, 1e4])


@kinds
@starts
def test_a_periodic_table_repeats_from_wherever_it_begins(kind: str, start: float) -> None:
    own = gl.Table(start + T, Y, kind, "periodic")
    t = np.array([0.01, 0.3, 0.77, 1.2, 1.99])
    once = gl.Table(T, Y, kind, "periodic")(t)
    for turns in (-3, 0, 1, 7):
        assert own(start + 2.0 * turns + t) == pytest.approx(once, abs=1e-8)
    assert len({*once.tolist()}) >= 4


@kinds
@starts
def test_a_table_over_an_interval_is_the_table(kind: str, start: float) -> None:
    """With its periods side by side; one that is not periodic is taken as it is."""
    own = gl.Table(start + T, Y, kind, "periodic")
    for t0, t1 in (
        (start - 3.3, start - 3.1),
        (start + 0.1, start + 0.2),
        (start - 2.0, start + 9.7),
        (start + 4.0, start + 4.0),
    ):
        whole = own.over(t0, t1)
        t = np.linspace(t0, t1, 57)[:-1] + 1e-7
        assert whole.t[0] <= t0 <= t1 <= whole.t[-1]
        assert whole(t) == pytest.approx(own(t), abs=1e-6)
        assert (np.diff(whole.t) >= 0).all()
        assert whole.outside == "hold"
        assert whole.over(t0 - 50.0, t1).t[0] <= t0 - 50.0  # again from the origin
    held = gl.Table(start + T, Y, kind)
    assert held.over(0.0, 1.0) is held
    with pytest.raises(ArgumentError, match=r"^t1 is 1, before t0, which is 2 s$"):
        own.over(2.0, 1.0)


def test_too_many_periods_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.solvers.inputs.table.MOST_KNOTS", 5 * 12)
    own = gl.Table(T, Y, outside="periodic")
    assert len(own.over(0.0, 20.0).t) <= 5 * 12
    with pytest.raises(ArgumentError, match=r"a table with a period of 2 s comes 13 times from 0 to 26 s, which is too often"):
        gl.Table(T, Y, outside="periodic").over(0.0, 26.0)


@kinds
def test_a_part_of_a_table_goes_on_beyond_its_ends(kind: str) -> None:
    """Its first and last pieces extend; in between it is the table."""
    own = gl.Table(T, Y, kind)
    for begin, end in ((0.2, 0.3), (0.2, 1.1), (0.5, 0.8), (-1.0, 5.0), (1.9, 3.0), (0.6, 1.75)):
        part = own.between(begin, end)
        t = np.linspace(max(begin, 0.0), min(end, 2.0), 23)[:-1]
        assert part(t) == pytest.approx(own(t), abs=1e-12)
        assert part.t[0] == max(begin, 0.0) or begin < 0.0
        assert own.t.tolist() == T.tolist() or kind == "previous"
    assert float(own.between(0.6, 0.6)(0.6)) == pytest.approx(float(own(0.6)))
    c = own.between(0.6, 0.7).coefficients[:, 0]
    for h in (0.05, 0.5):  # beyond its end
        assert float(own.between(0.6, 0.7)(0.6 + h)) == pytest.approx(c @ h ** np.arange(4))


@pytest.mark.parametrize("kind", ["linear", "previous"])
def test_lines_just_after_some_times(kind: str) -> None:
    own = (
        gl.Table([0.0, 1.0, 1.0, 3.0], [0.0, 2.0, 5.0, 1.0])
        if kind == "linear"
        else gl.Table([0.0, 1.0, 3.0], [2.0, 5.0, 1.0], kind)
    )
    begin = np.array([-1.0, 0.0, 0.4, 1.0, 2.5, 3.0, 9.0])
    found, slopes = own.lines(begin, np.full(7, 0.1))
    assert found == pytest.approx(own(begin))
    assert slopes == pytest.approx((own(begin + 0.1) - own(begin)) / 0.1, abs=1e-12)


def test_times_at_which_a_table_jumps_or_bends() -> None:
    steps = gl.Table([0.0, 1.0, 2.0, 3.0], [1.0, 1.0, 4.0, 4.0], "previous")
    assert steps.jumps.tolist() == [2.0]
    lines = gl.Table([0.0, 1.0, 1.0, 2.0, 2.0, 3.0], [0.0, 1.0, 1.0, 2.0, 5.0, 5.0])
    assert lines.jumps.tolist() == [2.0]
    assert {1.0, 2.0} >= {t for t in lines.corners.tolist() if t not in (0.0, 3.0)} >= {2.0}
    assert breakpoints([3.0, lines, lambda t: t]).tolist() == sorted({*lines.corners.tolist()})
    both = breakpoints([lines, gl.Table([0.0, 0.25, 2.0], [0.0, 1.0, 0.0])])
    assert (np.diff(both) > 0).all()
    assert set(both.tolist()) >= {0.25, 2.0}
    assert breakpoints([1.0]).tolist() == []


@pytest.mark.parametrize("shape", [(2, 2), (4, 3), (3, 5)])
def test_maps_are_bilinear_and_held_beyond_the_edge(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(shape[0])
    x, y = (np.cumsum(rng.uniform(0.1, 1.0, n)) for n in shape)
    z = rng.normal(size=shape)
    own = gl.Table2D(x, y, z)
    exact = RegularGridInterpolator((x, y), z)
    at = np.column_stack([rng.uniform(x[0] - 1, x[-1] + 1, 80), rng.uniform(y[0] - 1, y[-1] + 1, 80)])
    inside = np.column_stack([at[:, 0].clip(x[0], x[-1]), at[:, 1].clip(y[0], y[-1])])
    assert own(at[:, 0], at[:, 1]) == pytest.approx(exact(inside), abs=1e-13)
    assert own(*np.meshgrid(x, y, indexing="ij")) == pytest.approx(z, abs=1e-13)
    assert own(x, float(y[0])) == pytest.approx(z[:, 0])


def test_maps_with_a_single_line_or_point() -> None:
    assert gl.Table2D([1.0], [0.0, 2.0], [[3.0, 5.0]])([0.0, 9.0], 1.0).tolist() == [4.0, 4.0]
    assert gl.Table2D([0.0, 2.0], [1.0], [[3.0], [5.0]])(1.0, [0.0, 9.0]).tolist() == [4.0, 4.0]
    assert float(gl.Table2D([1.0], [1.0], [[7.0]])(5.0, -5.0)) == 7.0


@pytest.mark.parametrize(
    ("x", "y", "z", "said"),
    [
        ([0, 1], [0, 1], [[1, 2, 3], [4, 5, 6]], r"z has the shape \(2, 3\); expected a row for each of the 2 x, .* each of the 2 y$"),
        ([0, 0], [0, 1], [[1, 2], [3, 4]], r"x must increase$"), ([0, 1], [1, 0], [[1, 2], [3, 4]], r"y must increase$"),
        ([], [], [], r"z has the shape"), ([[0, 1]], [0, 1], [[1, 2]], r"z has the shape"),
    ],
)  # fmt: skip
def test_maps_that_are_none(x: Any, y: Any, z: Any, said: str) -> None:
    with pytest.raises(ArgumentError, match=r"^Table2D\(x, y, z\): " + said):
        gl.Table2D(x, y, z)


def test_values_of_all_kinds_of_inputs() -> None:
    t = np.array([0.0, 0.25, 2.0])
    found = values([2.5, gl.Table([0.0, 1.0], [0.0, 4.0]), lambda t: t**2, np.float64(-1.0)], t)
    assert found.tolist() == [[2.5] * 3, [0.0, 1.0, 4.0], [0.0, 0.0625, 4.0], [-1.0] * 3]
    assert values([], t).shape == (0, 3)


@pytest.mark.parametrize("late", [0.0, 1e3, 1e6])
@pytest.mark.parametrize("rate", [1e-2, 1.0, 1e3])
@pytest.mark.parametrize("phase", [0.0, 0.4, 3.0])
def test_slopes_of_functions_of_any_speed_at_any_time(phase: float, rate: float, late: float) -> None:
    """Up to what the clock resolves; also of one that has just begun to move, and whatever it did long before."""
    t, exact = late + phase / rate + 1e-3, rate * math.cos(phase)

    def smooth(s: float) -> float:
        return math.sin(rate * (s - t) + phase)

    signals = [smooth, lambda s: smooth(s) if s > t - 0.1 / rate else 7.0, lambda s: 3.0 * smooth(s) + 5.0, lambda s: 2.0]
    found = slopes_before(signals, t, 0.5 * t)
    assert found == pytest.approx([exact, exact, 3.0 * exact, 0.0], rel=1e-6 + 1e-12 * late * rate)


def test_slopes_at_jumps_and_at_the_start() -> None:
    """As steep as the clock allows; nothing has moved at the start, where values before it are not asked for."""
    for t in (0.3, 1e4):
        (found,) = slopes_before([lambda s, t=t: 2.0 if s >= t else -1.0], t, 0.5 * t)
        assert found > 1e8
        assert slopes_before([lambda s, t=t: 2.0 * (s - t) if s <= t else 9.0], t, 0.5 * t) == pytest.approx([2.0])
    asked: list[float] = []
    assert slopes_before([lambda s: asked.append(s) or math.sqrt(s)], 0.0, 0.0).tolist() == [0.0]
    assert slopes_before([lambda s: asked.append(s) or math.sqrt(s)], 1e-3, 0.5e-3) == pytest.approx([0.5 / 1e-3**0.5])
    assert min(asked) >= 0.0


@pytest.mark.parametrize(("longest", "calls"), [(0.25, None), (1e-15, 7)])
def test_functions_are_not_asked_for_slopes_from_long_before(longest: float, calls: int | None) -> None:
    """Up to a fourth of the way at least, as intervals grow; over three intervals, each with two values, where the clock allows no more."""
    asked: list[float] = []
    assert slopes_before([lambda s: asked.append(s) or 2.0 * s], 1.0, longest) == pytest.approx([2.0], rel=1e-6)
    if calls is None:
        assert 0.25 * longest < 1.0 - min(asked) <= longest
    else:
        assert len(asked) == calls
        steps = sorted(1.0 - s for s in asked)
        assert steps[1:] == pytest.approx([steps[1] * factor for factor in (1, 2, 4, 8, 16, 32)], rel=1e-12)


@kinds
@pytest.mark.parametrize("outside", ["hold", "periodic"])
def test_slopes_of_tables_are_those_of_the_piece_before(kind: str, outside: str) -> None:
    own, h = gl.Table(0.3 + T, Y, kind, outside), 1e-5
    before = 0.3 + np.array([-0.35, 0.0, 0.25, 0.5, 0.8, 1.5, 2.0, 2.4, 9.3])
    values_before = [own(before - k * h) for k in (1, 2, 3)]  # at a step the piece after it begins
    found = [slopes_before([own], t, 1.0)[0] for t in before]
    assert found == pytest.approx(np.dot([2.5, -4.0, 1.5], values_before) / h, abs=1e-5)


def test_a_part_of_a_table_is_level_before_it_begins() -> None:
    """And goes on as steeply as its last piece; slopes are those of its values."""
    part, h = gl.Table([0.0, 1.0, 3.0, 4.0], [0.0, 2.0, 8.0, 1.0]).between(0.5, 2.5), 1e-6
    times = np.array([0.3, 0.5, 0.6, 1.0, 1.5, 9.0])
    found = [slopes_before([part], t, 1.0)[0] for t in times]
    assert found == pytest.approx([0.0, 0.0, 2.0, 2.0, 3.0, 3.0], rel=1e-12)
    assert found == pytest.approx((part(times - h) - part(times - 2 * h)) / h, abs=1e-8)


def test_a_function_that_fails_is_named_with_its_input() -> None:
    def wind(t: float) -> Any:
        return {0.0: 1.5, 1.0: None, 2.0: float("nan")}.get(t) if t < 3 else 1 / 0

    own = FunctionInput("fan.tau", wind)
    assert own(0.0) == 1.5
    said = "the function wind of the input fan.tau, called with t = "
    for t, end in ((1.0, "1 s, returned"), (2.0, "2 s, returned"), (3.0, "3 s, raised ZeroDivisionError: ")):
        with pytest.raises(ArgumentError, match=f"^{said}{end}"):
            own(t)
