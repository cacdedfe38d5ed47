"""The choice between two methods, decision by decision: with methods whose work, time and answers are prescribed."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import SolverError
from gearlib.solvers import alternation
from gearlib.solvers.alternation import APART, EARLY, SETTLE, SHARE, SOON, WINDOW, WORTH_DECAY, WORTH_VIBRATION, alternate

START, STEPS, PACE = 50.0, 20.0, 1e-3
SHORTEST = START + STEPS
END = 1000.0


class Other:
    """Advances by so much time and work in each call, until it is done."""

    def __init__(self, calls: Iterable[tuple[float, float]] = (), done_after: float = np.inf, work: float = 0.0) -> None:
        self.calls, self.done_after, self.t, self.work = iter(calls), done_after, 0.0, work
        self.asked: list[int] = []
        self.status, self.closed = "more", 0

    def advance(self, steps: int) -> str:
        self.asked.append(steps)
        t, work = next(self.calls)
        self.t, self.work = self.t + t, self.work + work
        self.status = "done" if len(self.asked) >= self.done_after else "more"
        return self.status

    def solution(self) -> Any:
        return "solution"

    def close(self) -> None:
        self.closed += 1


def test_a_trial_is_measured_after_it_has_settled() -> None:
    """Faster as soon as one window is as fast; given up when its work is used up, later where it comes close."""
    slow, close, fast = (0.49 * 40, 40.0), (0.5 * 40, 40.0), (40.0, 40.0)
    start = (0.0, 60.0)
    cases: list[tuple[list[tuple[float, float]], bool, int]] = [
        ([start, fast], True, 2),
        ([start, slow, fast], True, 3),
        ([start, slow, slow], False, 3),  # 60 and 100 are within 100, 140 is not
        ([start, slow, close, slow], False, 4),  # 140 is within 180
        ([start, close, close, close, close], False, 5),  # 180 too, but not 220
        ([start, close, close, close, fast], True, 5),
        ([(0.0, 101.0)], False, 1),
    ]
    for calls, faster, count in cases:
        other = Other([*calls, *[fast] * 3])
        assert alternation.tried(other, 1.0, 100.0, 180.0) is faster  # type: ignore[arg-type]
        assert other.asked == [SETTLE, *[WINDOW] * (count - 1)]
    for after in (1, 2):
        other = Other([start, slow], done_after=after)
        assert alternation.tried(other, 1.0, 100.0, 180.0)  # type: ignore[arg-type]
        assert len(other.asked) == after


def test_it_stays_as_long_as_not_too_much_is_lost_in_one_stretch() -> None:
    """Two trials, or a tenth of all work; gains after a loss make up for that only. Windows grow with the steps."""
    lost, gained = (0.0, 50.0), (500.0, 50.0)
    cases = [
        ([lost] * 9, False, 5),  # 250 is more than 200
        ([gained, *[lost] * 9], False, 6),  # a gain before does not count
        ([lost, lost, gained, *[lost] * 9], False, 8),
        ([(25.0, 50.0)] * 12, False, 9),
    ]
    for calls, end, count in cases:
        other = Other(calls)
        assert alternation.stays(other, 1.0, 0.0, 100.0) is end  # type: ignore[arg-type]
        assert len(other.asked) == count
    other = Other([lost] * 99)  # a tenth of 10000 and what it did itself
    assert not alternation.stays(other, 1.0, 10_000.0, 100.0)  # type: ignore[arg-type]
    assert len(other.asked) == next(k for k in itertools.count() if 50.0 * k > 0.1 * (10_000.0 + 50.0 * k))
    other = Other([gained] * 60, done_after=60)
    assert alternation.stays(other, 1.0, 0.0, 100.0)  # type: ignore[arg-type]
    steps = 0
    for asked in other.asked:
        assert asked == max(WINDOW, int(SHARE * steps))
        steps += asked
    assert other.asked[-1] > 4 * WINDOW
    other = Other([lost] * 5, done_after=5)  # at the end nothing is lost any more
    assert alternation.stays(other, 1.0, 0.0, 100.0)  # type: ignore[arg-type]
    other = Other()
    other.status = "left"
    assert alternation.stays(other, 1.0, 0.0, 100.0)  # type: ignore[arg-type]
    assert other.asked == []


class Explicit:
    """Stops for stiffness at the given times, with so much work done by then, and watches as it is told."""

    def __init__(self, stops: list[tuple[float, float]], damped: bool, watched: list[float]) -> None:
        self.stops, self.damped, self.watched = stops, damped, watched
        self.t = self.work = 0.0
        self.pace, self.status, self.closed = PACE, "more", 0

    def watch(self, work_first: float = 0.0) -> None:
        self.watched.append(work_first)

    def advance(self) -> str:
        if not self.stops:
            self.t, self.status = END, "done"
        else:
            (self.t, self.work), self.status = self.stops.pop(0), "stiff"
        return self.status

    def solution(self) -> Any:
        return SimpleNamespace(t_last=self.t)


def decided(
    monkeypatch: pytest.MonkeyPatch, stops: list[list[tuple[float, float]]], answers: list[Any], damped: bool = True,
) -> tuple[list[float], list[tuple[float, ...]], list[Any], list[Other], list[tuple[float, ...]]]:  # fmt: skip
    """What the explicit method watched, what the trials and stays were allowed, and the legs.

    ``answers``: of each trial, whether it is faster ("fails": it fails), whether it stays to the end, and its work.
    """
    watched: list[float] = []
    allowed: list[tuple[float, ...]] = []
    stays: list[tuple[float, ...]] = []
    others: list[Other] = []
    coming = iter(answers)

    def explicit(legs: Any) -> Any:
        own = Explicit(stops.pop(0), damped, watched)
        return own, own

    def implicit(legs: Any) -> Any:
        assert legs[-1].method == "explicit"
        others.append(Other())
        others[-1].answer = next(coming)  # type: ignore[attr-defined]
        return others[-1]

    def tried(other: Any, *given: float) -> bool:
        allowed.append(given)
        faster, _, other.work = other.answer
        if faster == "fails":
            raise SolverError("failed")
        return bool(faster)

    def stay(other: Any, *given: float) -> bool:
        stays.append(given)
        return bool(other.answer[1])

    monkeypatch.setattr(alternation, "tried", tried)
    monkeypatch.setattr(alternation, "stays", stay)
    legs = alternate(explicit, implicit, lambda: (START, STEPS), END)
    return watched, allowed, legs, others, stays


@pytest.mark.parametrize("damped", [True, False])
def test_a_trial_must_be_worth_it(damped: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The work that remains, at the explicit pace, is two trials or more for a decay, four for a vibration; else it is looked at later."""
    least = (WORTH_DECAY if damped else WORTH_VIBRATION) * SHORTEST
    for share, worth in ((0.99, False), (1.01, True)):
        left = share * least
        watched, allowed, legs, others, _ = decided(
            monkeypatch, [[(END - left * PACE, 7.0)], []], [(False, False, 1.0)], damped
        )
        assert watched[0] == 0.0
        assert (len(allowed), len(others)) == ((1, 1) if worth else (0, 0))
        if not worth:
            assert watched[1:] == [pytest.approx(left / 2)]
        assert [leg.method for leg in legs] == (["explicit", "implicit", "explicit"] if worth else ["explicit"])


@pytest.mark.parametrize(
    ("left", "work", "most"),
    [
        (1e5, 10.0, EARLY * 1e5), (300.0, 10.0, STEPS), (1500.0, 6000.0, SHARE * 750.0 - START), (3000.0, 1000.0, EARLY * 3000.0),
        (1500.0, 1e6, EARLY * 1500.0), (2000.0, 1e6, EARLY * 2000.0), (1000.0, 1e6, EARLY * 1000.0), (900.0, 5e5, EARLY * 900.0),
        (100_000.0, 40_000.0, SHARE * 40_000.0 - START), (100_000.0, 90_000.0, SHARE * 50_000.0 - START),
    ],
)  # fmt: skip
def test_a_trial_may_take_a_share_of_the_work(left: float, work: float, most: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tenth of what is done, or of half of what remains, less the start; or three hundredths of what remains; the shortest at least."""
    expected = max(STEPS, SHARE * min(work, left / 2) - START, EARLY * left)
    _, allowed, _, _, _ = decided(monkeypatch, [[(END - left * PACE, work)], []], [(False, False, 1.0)])
    assert allowed[0] == pytest.approx((PACE, expected, max(expected, SHORTEST)))
    assert expected == pytest.approx(max(most, expected))


def test_after_a_failure_it_waits_twice_as_long_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    stops = [[(10.0, 100.0), (20.0, 200.0), (30.0, 300.0)]]
    watched, _, legs, others, _ = decided(monkeypatch, stops, [("fails", False, 5.0)] * 3)
    assert watched == pytest.approx([0.0, APART * SHORTEST, 2 * APART * SHORTEST, 4 * APART * SHORTEST])
    assert [leg.method for leg in legs] == ["explicit"]
    assert [other.closed for other in others] == [1, 1, 1]


def test_a_faster_method_goes_on_to_the_end_or_is_tried_again_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    stops = [[(10.0, 100.0)], [(20.0, 30.0)]]
    watched, allowed, legs, others, stays = decided(monkeypatch, stops, [(True, False, 40.0), (True, True, 60.0)])
    assert watched == pytest.approx([0.0, APART * SHORTEST])
    assert [(leg.method, leg.stayed) for leg in legs] == [
        ("explicit", True), ("implicit", True), ("explicit", True), ("implicit", True),
    ]  # fmt: skip
    assert [other.closed for other in others] == [1, 1]
    # spent: all that was done before, by either method
    assert [given[1] for given in stays] == pytest.approx([100.0, 100.0 + 40.0 + 30.0])
    assert [given[::2] for given in stays] == [(PACE, SHORTEST)] * 2
    assert allowed[1][1] == pytest.approx(max(STEPS, SHARE * 170.0 - START, EARLY * 980.0 / PACE))


def test_a_slower_method_is_tried_again_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a long run: ten trials, then twice as much each time, but a tenth of what remains at most; soon, if little remains."""
    answers = [(False, False, 40.0), (False, False, 44.0), (False, False, 48.0)]
    stops = [[(10.0, 100.0)], [(20.0, 30.0)], [(30.0, 30.0)], []]
    watched, _, legs, others, _ = decided(monkeypatch, stops, answers)
    first = max(min(0.0, SHARE * 990.0 / PACE), APART * (START + 40.0))
    second = max(min(2 * first, SHARE * 980.0 / PACE), APART * (START + 44.0))
    third = max(min(2 * second, SHARE * 970.0 / PACE), APART * (START + 48.0))
    assert watched == pytest.approx([0.0, first, second, third])
    assert (first, second, third) == pytest.approx((900.0, 1800.0, 3600.0))
    assert [leg.stayed for leg in legs] == [True, False] * 3 + [True]
    assert [other.closed for other in others] == [1, 1, 1]

    left = 0.99 * START / EARLY  # a short rest
    stops = [[(END - left * PACE, 100.0)], [(END - 0.5 * left * PACE, 30.0)], []]
    watched, *_ = decided(monkeypatch, stops, answers)
    first = SOON * (START + 40.0)
    assert watched == pytest.approx([0.0, first, max(min(2 * first, SHARE * 0.5 * left), APART * (START + 44.0))])
    left = 1.01 * START / EARLY
    watched, *_ = decided(monkeypatch, [[(END - left * PACE, 100.0)], []], answers)
    assert watched == pytest.approx([0.0, APART * (START + 40.0)])
