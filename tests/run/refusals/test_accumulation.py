"""Events that accumulate before a certain time, after which a run is no motion of the model."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import GearlibWarning
from gearlib.run.refusals.accumulation import accumulated, warn_of_accumulation


class Ball(gl.Component):
    """Bounces with a part of its speed; where ``rests``, it stays where it is once it is slow."""

    rests = gl.Structural(False)
    e = gl.Parameter("1", "coefficient of restitution", default=0.8)
    h = gl.Variable("m", start=1.0)
    v = gl.Variable("m/s")
    lies = gl.Discrete()

    def equations(self) -> list[Any]:
        slow = gl.And(self.h < 0, self.v > -1e-3) if self.rests else self.h < -1e9
        return [
            gl.Eq(gl.der(self.h), self.v * (1 - self.lies)),
            gl.Eq(gl.der(self.v), -9.81 * (1 - self.lies)),
            gl.When(slow, gl.Eq(self.lies, 1)),
            gl.When(self.h < 0, gl.reinit(self.v, -self.e * self.v)),
        ]


@pytest.mark.parametrize("method", ["rk", "ida", "taylor"])
@pytest.mark.parametrize("e", [0.95, 0.8, 0.3])
def test_a_run_that_passes_infinitely_many_bounces_warns(method: str, e: float) -> None:
    system = gl.compile(Ball())
    rests_at = np.sqrt(2 / 9.81) * (1 + 2 * e / (1 - e))
    before = system.simulate(0.99 * rests_at, method=method, parameters={"e": e})
    assert before["h"].min() > -1e-9
    with pytest.warns(GearlibWarning, match=r"of Ball: when_1 come ever faster until t = ") as said:
        system.simulate(1.5 * rests_at, method=method, parameters={"e": e})
    assert float(str(said[0].message).split("t = ")[1].split(" s")[0]) == pytest.approx(rests_at, rel=1e-4)


def test_a_ball_that_comes_to_rest_does_not() -> None:
    run = gl.compile(Ball(rests=True)).simulate(8.0)
    assert run["lies"][-1] == 1
    assert abs(run["h"][-1]) < 1e-6


def after(gaps: Sequence[float], first: float = 0.0) -> Any:
    """Times with some intervals between them."""
    return np.cumsum([first, *gaps])


SHRINKING = [0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6]  # by 1e-5 in five steps


@pytest.mark.parametrize(
    ("gaps", "wait", "last"),
    [
        (SHRINKING, 1.0, 6),
        (SHRINKING, 1.01e-3, 6),  # a thousand of the last intervals without an event
        (SHRINKING, 0.99e-3, None),
        (SHRINKING[:-1], 1.0, None),  # only by 1e-4
        ([0.1, 5e-3, 2.5e-4, 1.25e-5, 6.25e-7], 1.0, None),  # by enough, but in four steps
        ([0.1, 5e-3, 2.5e-4, 1.25e-5, 6.25e-7, 3e-8], 1.0, None),
        ([0.1, 0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6], 1.0, None),  # two longest ones: no shrinking from the first on
        ([0.02, 0.05, *SHRINKING], 1.0, 8),  # before the longest interval nothing matters
        ([0.1, 0.01, 1e-4, 1e-3, 1e-5, 1e-6], 1.0, None),  # not each shorter than the one before
        ([0.1, 0.01, 1e-4, 1e-4, 1e-5, 1e-6], 1.0, None),
        ([*SHRINKING, 3e-6, 0.05, 0.02], 0.01, 7),  # a long wait, and other events after it
        ([*SHRINKING, 0.05, 0.02], 0.01, 6),
        ([*SHRINKING, 1e-7, 1e-8], 0.99e-3, None),  # a thousand of the interval that is the first to be short
        ([*SHRINKING, 1e-7, 1e-8], 1.01e-3, 8),
        ([0.1] * 20, 200.0, None),
    ],
)
@pytest.mark.parametrize("begin", [0.0, 3.0, -3.0])
def test_where_events_accumulate(gaps: list[float], wait: float, last: int | None, begin: float) -> None:
    """Intervals become shorter one after another, at least five times and by 2e-5 in all, and then no event comes for long."""
    times = after(gaps, begin)
    found = accumulated(times, float(times[-1]) + wait)
    assert found == (None if last is None else times[last])


def test_events_within_rounding_are_one() -> None:
    """A time that comes twice ends no series, and begins none."""
    times = after(SHRINKING, 2.0)
    twice = np.sort(np.concatenate([times, times * (1 + 5e-14)]))
    assert accumulated(twice, 4.0) == times[-1]
    assert accumulated(-twice[::-1], 4.0) is None
    assert accumulated(np.repeat(times[:4], 4), 4.0) is None


def told(roots: Sequence[int], times: Any, end: float, handed: Any = None) -> list[str]:
    """What is said of a run with these events."""
    own = SimpleNamespace(root_names=("first", "second"))
    solution: Any = SimpleNamespace(event_times=np.asarray(times), event_roots=np.asarray(roots), t_last=end)
    run: Any = SimpleNamespace(scene=own, handed=handed)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        warn_of_accumulation(run, solution)
    assert all(one.category is GearlibWarning for one in said)
    return [str(one.message) for one in said]


def test_the_events_of_each_equation_are_judged_by_themselves() -> None:
    """Those of another one in between, or of time, end no series; the form that was integrated names them."""
    times = after(SHRINKING, 1.0)
    first = times[-1]
    (said,) = told([1] * 7, times, 3.0)
    assert said.startswith(f"the events of second come ever faster until t = {first:.6g} s, where they are closer together")
    between = np.sort(np.concatenate([times, times + 0.4 * np.append(np.diff(times), 1e-7)]))
    roots = [0, 1] * 7
    assert [one.split(" come")[0] for one in told(roots, between, 3.0)] == ["the events of first", "the events of second"]
    assert [one.split(" come")[0] for one in told([-k for k in roots], between, 3.0)] == ["the events of first"]
    assert told([-1] * 7, times, 3.0) == []
    assert told([0] * 7, times, float(times[-1])) == []
    other = SimpleNamespace(root_names=("third",))
    assert told([0] * 7, times, 3.0, other)[0].startswith("the events of third come")
    assert told([0] * 5, times[:5], 3.0) == told([], [], 3.0) == []
