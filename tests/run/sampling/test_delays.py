"""The history of a delayed signal: what was read comes back later, with its jumps and kinks where they were."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, SolverError
from gearlib.run.sampling.delays import MOST, Delay, DelayHistory, more_points, points, separate
from gearlib.run.sampling.instants import cut_times

DELAY = 0.5


def read(f: Callable[[Any], Any], begin: float, end: float, count: int = 41) -> Any:
    t = np.linspace(begin, end, count)
    return t, np.asarray(f(t), float)


def history(*parts: tuple[Callable[[Any], Any], float, float], first: float = 0.0) -> DelayHistory:
    """A constant, and then functions of time on intervals that follow each other."""
    found = DelayHistory.going_on(DELAY, first, parts[0][1])
    for f, begin, end in parts:
        found.add([begin], [read(f, begin, end)])
    return found


def test_what_was_read_comes_back_later() -> None:
    """A sine from 0 on, which goes on smoothly at 0.5, and a jump at 1."""
    assert history((np.sin, 0.0, 0.5), (np.sin, 0.5, 1.0)).window(0.0, 1.5).corners == pytest.approx([0.5])  # the kink at first
    found = history((np.sin, 0.0, 0.5), (np.sin, 0.5, 1.0), (lambda t: 3.0 + t, 1.0, 1.5))
    t = np.array([0.1, 0.49, 0.5, 0.7, 1.0, 1.3, 1.499])
    expected = np.where(t < DELAY, 0.0, np.sin(t - DELAY))
    window = found.window(0.0, 1.5)
    assert window(t) == pytest.approx(expected, abs=1e-9)
    assert window.corners == pytest.approx([1.5])  # the past is forgotten
    assert found.window(0.6, 1.4)(t[3:6]) == pytest.approx(expected[3:6], abs=1e-9)
    assert found.window(0.6, 1.4).corners.tolist() == []
    assert found.window(1.5, 2.0)([1.5, 1.75, 2.0]) == pytest.approx([4.0, 4.25, 4.5])
    assert (found.inside(0.0, 1.5), found.inside(1.0, 1.6), found.inside(1.5, 1.6)) == ([], [1.5], [])
    assert found.largest == pytest.approx(4.5)


def test_the_whole_history_from_a_time_on() -> None:
    found = history((lambda t: t, 0.0, 0.5), (lambda t: t**2 + 0.25, 0.5, 1.0), first=0.0)
    whole = found.whole(0.0)
    t = np.array([0.0, 0.3, 0.5, 0.9, 1.0, 1.2, 1.5])
    expected = np.where(t < 0.5, 0.0, np.where(t < 1.0, t - 0.5, (t - 0.5) ** 2 + 0.25))
    assert whole(t) == pytest.approx(expected, abs=1e-12)
    assert found.whole(1.0)(t[4:]) == pytest.approx(expected[4:], abs=1e-12)
    assert found.whole(1.0).t[0] == 1.0


@pytest.mark.parametrize(
    ("step", "turn", "bends"),
    [(0.0, 0.0, 0), (1e-9, 0.0, 0), (1e-6, 0.0, 1), (0.0, 1e-4, 0), (0.0, 0.1, 1), (-1e-6, 0.0, 1),
     (0.9e-8, 0.0, 0), (1.1e-8, 0.0, 1), (0.0, 1.99e-3, 0), (0.0, 2.01e-3, 1), (0.0, -1.99e-3, 0), (0.0, -2.01e-3, 1)],
)  # fmt: skip
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_jumps_and_kinks_are_seen_relative_to_the_signal(step: float, turn: float, bends: int, size: float) -> None:
    """A jump by more than 1e-8 of the largest value, or a change of the slope by more than 1e-3 of it over the table."""
    found = history(
        (lambda t: size * (1.0 - t), 0.0, 0.5),
        (lambda t: size * (1.0 - t + step + turn * (t - 0.5)), 0.5, 1.0),
        first=size,
    )
    assert len(found.inside(0.9, 1.1)) == bends


def test_a_few_points_are_joined_by_lines() -> None:
    """A cubic takes four."""
    for count, middle in ((3, 2.5), (4, 2.25)):
        found = DelayHistory.going_on(1.0, 0.0, 0.0)
        t = np.array([0.0, 1.0, 2.0, 3.0])[:count]
        found.add([0.0], [(t, t**2)])
        assert float(found.tables[-1](2.5)) == pytest.approx(middle)


def test_a_continued_run_knows_the_history() -> None:
    """Its corners ahead, up to one delay later, are corners of what comes; the later ones are not reached."""
    past = gl.Table([0.0, 1.0, 2.0, 3.0], [0.0, -5.0, 1.0, 1.0])
    found = DelayHistory.going_on(1.5, past, 1.0)
    assert (found.delay, found.begins, found.largest) == (1.5, [-math.inf], 5.0)
    assert found.bends == [2.0, 2.5]
    assert found.window(1.0, 2.5)([1.0, 1.5, 2.25]) == pytest.approx([-5.0, -2.0, 1.0])
    constant = DelayHistory.going_on(0.3, -2.0, 4.0)
    assert (constant.bends, constant.largest) == ([4.3], 2.0)
    assert constant.window(4.0, 4.3)([4.0, 4.2]).tolist() == [-2.0, -2.0]


@pytest.mark.parametrize("count", [17, 33, 65])
def test_the_estimated_error_is_about_the_true_one(count: int) -> None:
    """Of a cubic spline through the points of a sine, relative to the largest value; by an order of magnitude."""
    t, u = read(lambda t: 2.0 * np.sin(9.0 * t), 0.0, 1.0, count)
    between = 0.5 * (t[1:] + t[:-1])
    true = np.abs(gl.Table(t, u, "cubic")(between) - 2.0 * np.sin(9.0 * between)).max() / 2.0
    found = DelayHistory.going_on(1.0, 0.0, 0.0).error([(t, u)])
    assert 0.3 * true < found < 10.0 * true
    other = DelayHistory.going_on(1.0, 8.0, 0.0)  # beside larger values the error is smaller
    assert other.error([(t, u)]) == pytest.approx(found * np.abs(u).max() / 8.0, rel=1e-12)
    assert other.error([(t[:8], u[:8])]) == 0.0  # too few points to tell
    assert other.error([(t[:8], u[:8]), (t, u)]) == other.error([(t, u)])


@pytest.mark.parametrize("times", [[0.0], [0.0, 0.4], [0.0, 0.01, 0.7], [0.0, 1e-9, 0.7]])
@pytest.mark.parametrize("count", [4, 32, 33])
def test_points_lie_between_the_times(times: list[float], count: int) -> None:
    """``count`` in a length of 2 at least, eight in each interval at least, evenly, and an even number of steps; not quite at the ends."""
    end, length = 1.0, 2.0
    found = points(times, end, length, count)
    assert len(found) == len(times)
    for t, a, b in zip(found, times, [*times[1:], end], strict=True):
        steps = len(t) - 1
        assert steps % 2 == 0
        assert max(8, count * (b - a) / length) <= steps < max(8, count * (b - a) / length + 1) + 2
        assert np.diff(t)[1:-1] == pytest.approx((b - a) / steps, rel=1e-9)
        gap = min(1e-10 * length, 0.1 * (b - a) / steps)
        assert (t[0] - a, b - t[-1]) == (pytest.approx(gap, rel=1e-4), pytest.approx(gap, rel=1e-4))
        assert a < t[0] < t[1]


def test_times_that_lie_too_close_together_are_one() -> None:
    assert separate([], 2.0, 3.0) == [2.0]
    assert separate([2.5, 2.25], 2.0, 3.0) == [2.0, 2.25, 2.5]
    assert separate([2.5, 2.5 + 0.9e-7, 2.5 + 1.1e-7], 2.0, 3.0) == [2.0, 2.5, 2.5 + 1.1e-7]
    assert separate([2.0 + 0.9e-7, 3.0 - 0.9e-7], 2.0, 3.0) == [2.0]
    assert separate([2.0 + 1.1e-7, 3.0 - 1.1e-7], 2.0, 3.0) == [2.0, 2.0 + 1.1e-7, 3.0 - 1.1e-7]


def test_more_points_until_there_are_too_many() -> None:
    assert more_points(32, "line", 0.0) == 64
    assert more_points(MOST // 2, "line", 0.0) == MOST
    with pytest.raises(
        SolverError, match=rf"the history of line before t = 1.25 s is not known .* with {MOST} points in a piece"
    ):
        more_points(MOST, "line", 1.25)


def test_a_delay_acts_at_no_instant() -> None:
    assert Delay("line", ("line.now",), (0,), 0).instants(0.0, 1.0) == []


def test_a_run_is_cut_after_each_delay_but_not_next_to_an_instant_of_a_controller() -> None:
    """The shortest of two delays, also with a run that begins late; the last cut is before the end."""
    delays = {3: DelayHistory.going_on(0.7, 0.0, 1.0), 4: DelayHistory.going_on(0.25, 0.0, 1.0)}
    assert cut_times({}, [1.0], 1.0, 2.0) == []
    assert cut_times(delays, [], 1.0, 2.25) == pytest.approx([1.25, 1.5, 1.75, 2.0], rel=1e-15)
    assert cut_times(delays, [1.5, 1.75 + 1e-15, 1.9], 1.0, 2.25) == pytest.approx([1.25, 2.0], rel=1e-15)
    assert cut_times(delays, [-1.5], 1.0, 2.0 + 1e-15) == pytest.approx([1.25, 1.5, 1.75], rel=1e-15)


def test_a_run_of_as_many_pieces_as_are_allowed_is_cut_and_a_longer_one_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted from its own start, in the shortest delay."""
    monkeypatch.setattr("gearlib.run.sampling.instants.MOST_CUTS", 5)
    delays = {3: DelayHistory.going_on(0.7, 0.0, 1.0), 4: DelayHistory.going_on(0.25, 0.0, 1.0)}
    assert len(cut_times(delays, [], 1.0, 2.25)) == 4
    with pytest.raises(ArgumentError, match=r"a delay of 0\.25 s cuts the run from 1 to 2\.5 s into more than 5 pieces"):
        cut_times(delays, [], 1.0, 2.5)
