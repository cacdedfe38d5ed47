"""Events of the explicit Runge-Kutta methods: bounces, backlash, simultaneous, double, timed and chattering ones."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gearlib.errors import SolverError
from gearlib.solvers.problem import Floats, Problem, Solution
from tests.run.python_problem import problem, rk


def oscillator(t: float, x: Any, dx: Any, data: Any) -> None:
    dx[0], dx[1] = x[1], -x[0]


def falling(t: float, x: Any, dx: Any, data: Any) -> None:
    dx[0], dx[1] = x[1], -9.81


def bouncing(**more: Any) -> Problem:
    """Ball dropped from 1 m with restitution 0.8; data[0] counts the bounces."""

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0] = x[0]

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        if fired[0] != -1:
            return 0
        x[0], x[1] = more.get("place", x[0]), -0.8 * x[1]
        data[0] += 1.0
        return 2

    return problem(falling, [1.0, 0.0], roots=roots, n_roots=1, update=update, discrete=slice(0, 1))


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("place", [{}, {"place": 0.0}])
def test_bouncing_ball(order: int, place: dict[str, float]) -> None:
    """Impacts at t1 (1 + 2 (0.8 + 0.8^2 + ...)), also where the new position is exactly on the root."""
    times = np.linspace(0.0, 3.0, 301)
    solution = rk(bouncing(**place), times, rtol=1e-8, order=order)
    first = math.sqrt(2.0 / 9.81)
    powers = np.concatenate(([0.0], 2.0 * np.cumsum(0.8 ** np.arange(1, 9))))
    impacts = first * (1.0 + powers)
    impacts = impacts[impacts < 3.0]
    downwards = solution.event_times[: 2 * impacts.size : 1 if place else 2]
    assert downwards[: impacts.size] == pytest.approx(impacts, abs=1e-13)
    bounce = np.searchsorted(impacts, times, side="right")
    since = times - np.concatenate(([-first], impacts))[bounce]
    speed = 9.81 * first * 0.8**bounce
    assert solution.x[:, 0] == pytest.approx(speed * since - 0.5 * 9.81 * since**2, abs=1e-12)
    assert solution.discrete[:, 0] == pytest.approx(bounce)


def backlash(t: float, x: Any, dx: Any, data: Any) -> None:
    """Mass between two springs of frequency 30 with a free gap of +-1; data[0] tells the spring."""
    dx[0] = x[1]
    dx[1] = -900.0 * (x[0] - data[0]) if data[0] != 0.0 else 0.0


def backlash_roots(t: float, x: Any, g: Any, data: Any) -> None:
    g[0], g[1] = x[0] - 1.0, x[0] + 1.0


def backlash_update(t: float, x: Any, fired: Any, data: Any) -> int:
    flank = 1.0 if x[0] > 1.0 else -1.0 if x[0] < -1.0 else 0.0
    changed, data[0] = flank != data[0], flank
    return int(changed)


def backlash_exact(times: Floats, speed: float) -> Floats:
    """Position of the mass that starts at 0: straight, half a sine, straight, half a sine."""
    quarter, half_sine = 1.0 / speed, math.pi / 30.0
    half_period = 2.0 * quarter + half_sine
    sign = 1.0 - 2.0 * (np.floor(times / half_period) % 2)
    s = times % half_period
    free_in, bump, free_out = (
        s * speed,
        1.0 + speed / 30.0 * np.sin(30.0 * (s - quarter)),
        1.0 - speed * (s - quarter - half_sine),
    )
    return np.asarray(sign * np.where(s < quarter, free_in, np.where(s < quarter + half_sine, bump, free_out)))


@pytest.mark.parametrize(("order", "rtol"), [(5, 1e-6), (5, 1e-9), (8, 1e-6), (8, 1e-11)])
def test_backlash_oscillator(order: int, rtol: float) -> None:
    speed = 12.0
    p = problem(backlash, [0.0, speed], roots=backlash_roots, n_roots=2, update=backlash_update, discrete=slice(0, 1))
    times = np.linspace(0.0, 3.0, 311)
    solution = rk(p, times, rtol=rtol, order=order)
    assert solution.x[:, 0] == pytest.approx(backlash_exact(times, speed), abs=300.0 * rtol)
    half_period = 2.0 / speed + math.pi / 30.0
    enter = 1.0 / speed + half_period * np.arange(12)
    expected = np.sort(np.concatenate((enter, enter + math.pi / 30.0)))
    expected = expected[expected < 3.0]
    assert solution.event_times == pytest.approx(expected, abs=20.0 * rtol)
    assert solution.event_roots.tolist() == [0, 0, 1, 1] * 5 + [0, 0, 1][: expected.size - 20]
    position = np.abs(backlash_exact(times, speed)) > 1.0
    clear = np.abs(np.abs(solution.x[:, 0]) - 1.0) > 1e-3
    assert np.array_equal(np.abs(solution.discrete[clear, 0]) > 0.0, position[clear])


@pytest.mark.parametrize(("order", "rtol", "most"), [(5, 1e-5, 40.0), (8, 1e-5, 38.0), (8, 1e-9, 80.0)])
def test_a_phase_that_comes_again_begins_with_the_step_that_suited_it(order: int, rtol: float, most: float) -> None:
    """Evaluations from one event to the next, few of them for steps that are rejected or too small."""
    p = problem(backlash, [0.0, 12.0], roots=backlash_roots, n_roots=2, update=backlash_update, discrete=slice(0, 1))
    stats = rk(p, np.array([0.0, 30.0]), rtol=rtol, order=order).stats
    assert stats["events"] == 221
    assert stats["rhs"] < most * stats["events"]
    assert stats["rejected"] < 10


def test_events_are_located_to_rounding() -> None:
    """At every event the state is on the root, on its far side, whatever the tolerance."""
    found: list[float] = []

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        for k, place in ((0, 1.0), (1, -1.0)):
            if fired[k]:
                found.append((x[0] - place) * fired[k])
        return backlash_update(t, x, fired, data)

    p = problem(backlash, [0.0, 12.0], roots=backlash_roots, n_roots=2, update=update)
    rk(p, np.array([0.0, 3.0]), rtol=1e-3)
    assert len(found) == 22
    assert min(found) > 0.0
    assert max(found) < 3e-14


def test_late_times_cost_no_accuracy() -> None:
    """What rounding takes from the time, 1e-11 s here, is not lost at each step and event, but only in the samples' times."""
    p = problem(backlash, [0.0, 12.0], roots=backlash_roots, n_roots=2, update=backlash_update, discrete=slice(0, 1))
    times = 1e5 + np.linspace(0.0, 30.0, 311)
    solution = rk(p, times, rtol=1e-11, order=8)
    assert solution.x[:, 0] == pytest.approx(backlash_exact(times - 1e5, 12.0), abs=1e-9)


def test_roots_that_cross_together_are_handled_together() -> None:
    calls: list[list[int]] = []

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = 1.0 + 0.1 * math.sin(t)

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0], g[1], g[2], g[3] = x[0] - 1.0, 8.0 * (1.0 - x[0]), x[0] - 1.5, 7.0

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        calls.append([fired[k] for k in range(4)])
        return 0

    solution = rk(problem(rhs, [0.0], roots=roots, n_roots=4, update=update), np.array([0.0, 2.0]), rtol=1e-6)
    assert calls == [[0, 0, 0, 0], [1, -1, 0, 0], [0, 0, 1, 0]]
    assert solution.event_roots.tolist() == [0, 1, 2]
    assert solution.event_times[0] == solution.event_times[1]


def passes(times: list[float], **more: Any) -> Solution:
    """A ball thrown past lines: x = 4 - (t - 2)^2 crosses x = 4 - d^2 at 2 - d and 2 + d; more than one step has no need."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = x[1], -2.0

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        for k, d in enumerate(times):
            g[k] = x[0] - (4.0 - d * d)

    p = problem(rhs, [-100.0 + 0.0 + 4.0, 20.0], roots=roots, n_roots=len(times))
    return rk(p, np.array([-8.0, 12.0]), rtol=1e-6, **more)


@pytest.mark.parametrize("order", [5, 8])
def test_two_crossings_within_one_step_are_seen(order: int) -> None:
    solution = passes([0.05], order=order)
    assert solution.event_times == pytest.approx([1.95, 2.05], abs=1e-9)
    assert passes([], order=order).stats["steps"] < 20


@pytest.mark.parametrize("order", [5, 8])
def test_crossings_within_one_step_come_in_their_order(order: int) -> None:
    solution = passes([0.3, 0.9, 0.5, 0.05, 1.3], order=order)
    assert solution.event_times == pytest.approx([0.7, 1.1, 1.5, 1.7, 1.95, 2.05, 2.3, 2.5, 2.9, 3.3], abs=1e-9)
    assert solution.event_roots.tolist() == [4, 1, 2, 0, 3, 3, 0, 2, 1, 4]


def test_root_without_update_is_only_recorded() -> None:
    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0] = x[0]

    solution = rk(problem(oscillator, [1.0, 0.0], roots=roots, n_roots=1), np.array([0.0, 20.0]), rtol=1e-10)
    assert solution.event_times == pytest.approx(math.pi * (np.arange(6) + 0.5), abs=1e-8)


@pytest.mark.parametrize("order", [5, 8])
def test_event_log_grows(order: int) -> None:
    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0], g[1] = math.sin(t), math.cos(t)

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = math.cos(t)

    p = problem(rhs, [0.0], roots=roots, n_roots=2)
    solution = rk(p, np.linspace(0.0, 1000.3, 7), rtol=1e-6, order=order)
    assert solution.event_times == pytest.approx(0.5 * math.pi * np.arange(1, 637), abs=1e-9)
    assert solution.event_roots.tolist() == [1, 0] * 318
    assert solution.x[:, 0] == pytest.approx(np.sin(solution.t), abs=1e-3)


def test_root_that_leaves_zero_is_an_event() -> None:
    """The relation x > 0 is false at the start, where x = 0 exactly, and true right after."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = 1.0 if data[0] == 0.0 else 2.0

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0] = x[0]

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        before, data[0] = data[0], float(x[0] > 0.0)
        return int(before != data[0])

    p = problem(rhs, [0.0], roots=roots, n_roots=1, update=update, discrete=slice(0, 1))
    times = np.array([9.0, 0.0, 1.0])[1:]  # what stands before them in memory is no sample
    solution = rk(p, times, rtol=1e-6)
    assert solution.t.tolist() == [0.0, 1.0]
    assert solution.discrete[:, 0].tolist() == [1.0, 1.0], "a sample on an event holds the right-hand limit"
    assert solution.x[-1, 0] == pytest.approx(2.0, abs=1e-12)
    assert solution.event_times == pytest.approx([0.0], abs=1e-14)


def test_time_events_are_met_exactly_and_samples_there_hold_the_limit_from_the_right() -> None:
    """A torque that is switched on at 0.1 and off at 0.7 s; each event also kicks the state."""
    seen: list[float] = []

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        assert t <= 0.1 or data[0] != 0.0 or t >= 0.7  # no stage looks beyond an event
        dx[0] = data[0]

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        seen.append(t)
        if t == 0.1:
            data[0], x[0] = 1.0, x[0] + 5.0
            return 2
        if t == 0.7:
            data[0] = 0.0
            return 1
        return 0

    p = problem(rhs, [0.0], update=update, discrete=slice(0, 1), time_events=np.array([0.7, 0.1, -1.0, 1.0, 8.0]))
    solution = rk(p, np.array([0.0, 0.0999999, 0.1, 0.4, 0.7, 1.0]), rtol=1e-6)
    assert seen == [0.0, 0.1, 0.7, 1.0]
    assert solution.x[:, 0] == pytest.approx([0.0, 0.0, 5.0, 5.3, 5.6, 5.6], abs=1e-12)
    assert solution.discrete[:, 0].tolist() == [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    assert solution.event_times.tolist() == [0.1, 0.7, 1.0]
    assert solution.event_roots.tolist() == [-1, -1, -1]


def test_sample_on_a_root_holds_the_limit_from_the_right() -> None:
    first = rk(bouncing(), np.array([0.0, 1.0]), rtol=1e-8)
    impact = first.event_times[0]
    solution = rk(bouncing(), np.array([0.0, impact - 1e-9, impact, 1.0]), rtol=1e-8)
    assert solution.x[1, 1] == pytest.approx(-9.81 * impact, rel=1e-6)
    assert solution.x[2, 1] == pytest.approx(0.8 * 9.81 * impact, rel=1e-9)


@pytest.mark.parametrize("order", [5, 8])
def test_samples_within_rounding_of_a_root_hold_the_limit_from_the_right(order: int) -> None:
    """A root is located a few units of rounding beside the time that a user would write down."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = 1.0

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        for k in range(40):
            g[k] = x[0] - (k + 0.5) / 7.0

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        jumped = sum(fired[k] > 0 for k in range(40))
        data[0] += jumped
        return int(jumped > 0)

    p = problem(rhs, [0.0], roots=roots, n_roots=40, update=update, discrete=slice(0, 1))
    events = (np.arange(40) + 0.5) / 7.0
    for share, passed in ((-1e-12, 0.0), (-1e-15, 1.0), (0.0, 1.0), (1e-15, 1.0)):
        times = np.concatenate(([0.0], events * (1.0 + share), [6.0]))
        solution = rk(p, times, rtol=1e-6, order=order)
        assert solution.discrete[1:-1, 0].tolist() == (np.arange(40) + passed).tolist()


def test_chattering_is_reported() -> None:
    """A relay that pushes its state back from both sides never gets beyond 1 s."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = -1.0 if data[0] > 0.0 else 1.0

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0] = x[0]

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        data[0] = 1.0 if x[0] > 0.0 else -1.0
        return 1

    with pytest.raises(SolverError, match=r"chatter at t = 1(\.0+\d*)? s .* of root 0"):
        rk(problem(rhs, [1.0], roots=roots, n_roots=1, update=update), np.array([0.0, 2.0]), rtol=1e-6)
