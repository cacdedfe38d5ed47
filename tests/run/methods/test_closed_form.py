"""When tables are left to Runge-Kutta: where steps from corner to corner are estimated to be faster than exponentials."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.run.methods.closed_form import FEW_CORNERS, exponential, exponential_solution, too_many_corners
from tests.run.methods.test_native_problem import plain, run
from tests.run.test_linear_form import train
from tests.trains import Chain


def with_corners(corners: int, **more: Any) -> Any:
    """A run of one second with a table of so many corners."""
    table = gl.Table(np.linspace(0.0, 1.0, corners), np.zeros(corners))
    return replace(run(train(), signals=(table,)), **more)


def stepper(exact: float, rate: float = 0.0, cuts: bool = True) -> Any:
    """A stand-in whose exponentials take an estimated time (s); of a system of twice the size twice that."""
    n = len(train().scene.states)
    costs = lambda states, inputs, rate: (exact * states / n, 2.0 * exact * states / n)  # noqa: E731
    return SimpleNamespace(cuts=SimpleNamespace(costs=costs) if cuts else None, cornered=(0,), rate=lambda: rate)


def test_few_corners_are_crossed_in_any_case() -> None:
    assert too_many_corners(with_corners(FEW_CORNERS), stepper(1e9)) is None
    assert too_many_corners(with_corners(FEW_CORNERS + 1), stepper(1e9)) is not None


@pytest.mark.parametrize("rate", [0.0, 3e4])
def test_the_faster_of_both_is_taken(rate: float) -> None:
    """A step for each corner, and for three radians of the fastest motion, of 1.5 us and 30 ns for each slot; exponentials at a tie."""
    seconds = (1000 + rate / 3.0) * (1.5e-6 + 3e-8 * train().scene.program.n_slots)
    assert too_many_corners(with_corners(1000), stepper(1.19 * seconds, rate)) is None
    reason = too_many_corners(with_corners(1000), stepper(1.21 * seconds, rate))
    assert reason == (
        f"a table has 1000 points: exponentials from one to the next are estimated to take {1.21 * seconds:.2g} s, steps of Runge-Kutta "
        f"{seconds:.2g} s"
    )


def test_many_states_take_long_for_each_corner() -> None:
    """Where no intervals are cut, 0.3 ms."""
    seconds = 1000 * (1.5e-6 + 3e-8 * train().scene.program.n_slots)
    reason = too_many_corners(with_corners(1000), stepper(0.0, cuts=False))
    assert (reason is not None) == (1.2 * seconds < 0.3)
    assert reason is not None
    assert "take 0.3 s" in reason


def test_tangents_cost_both_of_them() -> None:
    """Runge-Kutta a right-hand side each, exponentials a system of twice the size each."""
    seconds = 1000 * (1.5e-6 + 3e-8 * train().scene.program.n_slots)
    own = with_corners(1000, tangents=SimpleNamespace(directions=[0, 1, 2]))
    limit = 1.2 * 4 * seconds / 6
    assert too_many_corners(own, stepper(0.99 * limit)) is None
    assert too_many_corners(own, stepper(1.01 * limit)) is not None


def test_a_stepper_is_kept_for_the_same_times_and_tolerance() -> None:
    own = run(train())
    first = exponential(own)
    assert not isinstance(first, str)
    assert exponential(own) is first
    assert exponential(replace(own, rtol=1e-9)) is not first
    again = exponential(replace(own, rtol=1e-9))
    assert exponential(replace(own, rtol=1e-9, times=own.times * 2.0)) is not again
    assert exponential(run(plain())) == "the equations are not linear with constant coefficients"


@pytest.mark.parametrize("times", [(0.0, 0.6, 0.8, 1.0), (0.0, 1.0)])
def test_conditions_on_time_hold_at_the_samples(times: Any) -> None:
    """The pulse of the train ends at 0.7 s; a scene without conditions has no discrete state."""
    own = run(train(), times=times)
    stepper = exponential(own)
    assert not isinstance(stepper, str)
    found = exponential_solution(own, stepper, "asked for")
    assert found.stats["why"] == "asked for"
    assert found.discrete.shape == (len(times), own.scene.n_discrete)
    assert sorted(map(tuple, found.discrete.T.tolist())) == [tuple(float(t < 0.7) for t in times)]
    whole = gl.compile(Chain()).translation
    still = run(whole)
    steps = exponential(still)
    assert not isinstance(steps, str)
    assert exponential_solution(still, steps, "asked for").discrete.shape == (2, 0)
