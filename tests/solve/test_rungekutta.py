"""Explicit Runge-Kutta methods against closed forms: orders, tolerances, events, failures, stiffness."""

from __future__ import annotations

import ctypes
import math
import subprocess
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.errors import ArgumentError, SolverError
from gearlib.solve import tableaux
from gearlib.solve.problem import Floats, Problem, Solution
from gearlib.solve.rungekutta import integrate

_DOUBLES, _INTS, _LONGS = (ctypes.POINTER(t) for t in (ctypes.c_double, ctypes.c_int32, ctypes.c_int64))


def native(function: Callable[..., int | None], out: Any = _DOUBLES) -> Any:
    """A Python function (t, x, out, data) as the C function that the integrator calls."""
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, _DOUBLES, out, _DOUBLES, _LONGS)
    wrapped = kind(lambda t, x, out, data, index: function(t, x, out, data) or 0)
    return SimpleNamespace(address=ctypes.cast(wrapped, ctypes.c_void_p).value, keep=wrapped)


def problem(rhs: Callable[..., int | None], x0: Any, **more: Any) -> Problem:
    """An explicit problem of Python functions."""
    x0 = np.array(x0, dtype=float)
    for name in ("roots", "update"):
        if name in more:
            more[name] = native(more[name], _INTS if name == "update" else _DOUBLES)
    more.setdefault("data", np.zeros(4))
    more.setdefault("nominal", np.ones(x0.size))
    return Problem(native(rhs), x0, index=np.zeros(1, dtype=np.int64), differential=np.ones(x0.size, dtype=np.bool_), **more)


def oscillator(t: float, x: Any, dx: Any, data: Any) -> None:
    dx[0], dx[1] = x[1], -x[0]


def pendulum(t: float, x: Any, dx: Any, data: Any) -> None:
    dx[0], dx[1] = x[1], -math.sin(x[0])


def logistic(t: float, x: Any, dx: Any, data: Any) -> None:
    dx[0] = x[0] * (1.0 - x[0]) * 2.0 * (1.0 + math.cos(t))


def logistic_exact(t: Floats) -> Floats:
    return np.asarray(1.0 / (1.0 + 9.0 * np.exp(-2.0 * (t + np.sin(t)))))


ORBIT_START = (0.5, 0.0, 0.0, math.sqrt(3.0))


def orbit(t: float, x: Any, dx: Any, data: Any) -> None:
    cube = math.hypot(x[0], x[1]) ** 3
    dx[0], dx[1], dx[2], dx[3] = x[2], x[3], -x[0] / cube, -x[1] / cube


def orbit_exact(times: Floats) -> Floats:
    """Position on Kepler's ellipse of eccentricity 0.5, from its nearest point."""
    anomaly = times.copy()
    for _ in range(50):  # Newton on Kepler's equation
        anomaly -= (anomaly - 0.5 * np.sin(anomaly) - times) / (1.0 - 0.5 * np.cos(anomaly))
    return np.column_stack((np.cos(anomaly) - 0.5, math.sqrt(0.75) * np.sin(anomaly)))


def falling(t: float, x: Any, dx: Any, data: Any) -> None:
    dx[0], dx[1] = x[1], -9.81


# ---------------------------------------------------------------- methods


@pytest.mark.parametrize(
    ("order", "c", "a"), [(5, tableaux.TSIT5_C[:7], tableaux.TSIT5_A), (8, tableaux.DOP853_C[:13], tableaux.DOP853_A[:13])]
)
def test_coefficients_satisfy_order_conditions(order: int, c: Any, a: Any) -> None:
    """Row sums, quadrature, and the conditions of the tall and the bushy trees (Hairer et al., II.2)."""
    s = len(a)
    matrix = np.array([list(row) + [0.0] * (s - len(row)) for row in a])
    c, b = np.array(c), matrix[-1]
    assert matrix.sum(axis=1) == pytest.approx(c, abs=3e-15)
    tall, density = np.ones(s), 1.0
    for k in range(1, order + 1):
        assert b @ c ** (k - 1) == pytest.approx(1.0 / k, abs=3e-15)
        density *= k
        assert b @ tall == pytest.approx(1.0 / density, abs=1e-14)
        assert b @ (c ** max(k - 3, 0) * (matrix @ c)) == pytest.approx(1.0 / (2 * max(k, 3)), abs=1e-14)
        tall = matrix @ tall
    assert abs(b @ c**order - 1.0 / (order + 1)) > 1e-6


@pytest.mark.parametrize(("order", "steps"), [(5, 20), (8, 12)])
@pytest.mark.parametrize(("end", "theta"), [(True, 1.0), (False, 0.5), (False, 0.8)])
def test_error_falls_with_the_order_of_the_method(order: int, steps: int, end: bool, theta: float) -> None:
    """Half the step, 2^order times less error: at the end, and of the dense output within the first step.

    Time events with a lax tolerance make equal steps. A dense output of order p - 1 has a local error of order p.
    """
    errors = []
    for n in (steps, 2 * steps):
        grid = np.linspace(0.0, 2.0, n + 1)
        times = np.array([0.0, theta * grid[1 if not end else -1], 2.0])
        run = integrate(problem(orbit, ORBIT_START, time_events=grid), times, rtol=1e-3, atol=1e9, order=order, first_step=1.0)
        assert run.stats["steps"] == n
        errors.append(np.abs(run.x[1, :2] - orbit_exact(times)[1]).max())
    assert order - 0.3 < math.log2(errors[0] / errors[1]) < order + 1.1


@pytest.mark.parametrize("order", [5, 8])
def test_dense_output_is_as_accurate_as_the_steps(order: int) -> None:
    few, many = np.array([0.0, 20.0]), np.linspace(0.0, 20.0, 2001)
    at_end = integrate(problem(oscillator, [1.0, 0.0]), few, rtol=1e-7, order=order)
    dense = integrate(problem(oscillator, [1.0, 0.0]), many, rtol=1e-7, order=order)
    error = np.abs(dense.x - np.column_stack((np.cos(many), -np.sin(many))))
    assert dense.stats["steps"] == at_end.stats["steps"]
    assert dense.x[-1] == pytest.approx(at_end.x[-1], rel=1e-13)
    assert error.max() < 4.0 * error[-1].max()
    assert error[1000:].max() > error[:200].max()  # a global error that grows, not one of interpolation


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7, 1e-9, 1e-11])
def test_error_is_proportional_to_the_tolerance(order: int, rtol: float) -> None:
    """One revolution on Kepler's ellipse, whose closed form multiplies an error of the period."""
    times = np.linspace(0.0, 2.0 * math.pi, 41)
    solution = integrate(problem(orbit, ORBIT_START), times, rtol=rtol, order=order)
    error = np.abs(solution.x[:, :2] - orbit_exact(times)).max()
    assert 0.02 * rtol < error < 50.0 * rtol


@pytest.mark.parametrize("order", [5, 8])
def test_relative_tolerance_counts_where_a_state_is_large(order: int) -> None:
    def growth(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = x[0]

    times = np.array([0.0, 30.0])
    solution = integrate(problem(growth, [1.0], nominal=np.array([1e-20])), times, rtol=1e-6, order=order)
    assert (5e-9 if order == 5 else 1e-7) < abs(solution.x[-1, 0] / math.exp(30.0) - 1.0) < 1e-5


def test_absolute_tolerance_counts_where_a_state_is_small() -> None:
    """A decaying state is followed to its nominal size times rtol, and further with a tighter atol."""

    def decay(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = -x[0]

    times = np.array([0.0, 30.0])
    loose = integrate(problem(decay, [1.0]), times, rtol=1e-6, order=8)
    tight = integrate(problem(decay, [1.0]), times, rtol=1e-6, atol=1e-25, order=8)
    tiny = integrate(problem(decay, [1.0], nominal=np.array([1e-19])), times, rtol=1e-6, order=8)
    assert tight.x[-1, 0] == pytest.approx(math.exp(-30.0), rel=1e-4)
    assert tight.x[-1, 0] == tiny.x[-1, 0]
    assert loose.stats["rhs"] < tight.stats["rhs"]


@pytest.mark.parametrize("order", [5, 8])
def test_chain_agrees_with_the_matrix_exponential(order: int) -> None:
    """Four inertias joined by spring-dampers, free, wave started at one end (19 states would only be slower in Python)."""
    n = 4
    matrix = np.zeros((2 * n - 1, 2 * n - 1))
    for i in range(n - 1):
        matrix[i, n - 1 + i], matrix[i, n + i] = 1.0, -1.0
        torque = np.zeros(2 * n - 1)
        torque[i], torque[n - 1 + i], torque[n + i] = 50.0, 0.5, -0.5
        matrix[n - 1 + i] -= torque
        matrix[n + i] += torque
    entries = matrix.tolist()

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        state = x[: 2 * n - 1]
        for i, row in enumerate(entries):
            dx[i] = sum(a * b for a, b in zip(row, state))

    times = np.linspace(0.0, 3.0, 31)
    start = np.zeros(2 * n - 1)
    start[n - 1] = 1.0
    exact = np.array([expm(matrix * t) @ start for t in times])
    solution = integrate(problem(rhs, start), times, rtol=1e-9, order=order)
    assert solution.x == pytest.approx(exact, abs=2e-8)


def test_run_leaves_the_problem_alone_and_repeats_itself() -> None:
    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        data[0] += 1.0
        x[0] += 1.0
        return 2

    p = problem(oscillator, [1.0, 0.0], update=update, time_events=np.array([0.5]), modes=slice(0, 1))
    times = np.linspace(0.0, 1.0, 5)
    first, second = integrate(p, times, rtol=1e-6), integrate(p, times, rtol=1e-6)
    assert np.array_equal(first.x, second.x)
    assert np.array_equal(first.modes, second.modes)
    assert np.all(p.data == 0.0)
    assert np.all(p.x0 == [1.0, 0.0])


def test_long_run_is_done_in_several_calls_of_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    times = np.linspace(0.0, 10.0, 11)
    whole = integrate(problem(pendulum, [2.0, 0.0]), times, rtol=1e-8)
    monkeypatch.setattr("gearlib.solve.rungekutta._STEPS_PER_CALL", 3)
    parts = integrate(problem(pendulum, [2.0, 0.0]), times, rtol=1e-8)
    assert np.array_equal(whole.x, parts.x)
    assert whole.stats == parts.stats


def test_single_sample_is_the_start() -> None:
    solution = integrate(problem(oscillator, [1.0, 2.0]), np.array([3.0]), rtol=1e-6)
    assert solution.x.tolist() == [[1.0, 2.0]]
    assert (solution.t_last, solution.status, solution.stats["steps"]) == (3.0, "done", 0)


def test_quantities_near_underflow_become_zero() -> None:
    """They would slow arithmetic down many times, as in a long chain at rest that a wave runs into."""

    def decay(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = -x[0]

    solution = integrate(problem(decay, [1e-240]), np.linspace(0.0, 60.0, 4), rtol=1e-6, atol=1e-260)
    assert solution.x[1, 0] == pytest.approx(1e-240 * math.exp(-20.0), rel=1e-5)
    assert solution.x[-1, 0] == 0.0


# ---------------------------------------------------------------- events


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

    return problem(falling, [1.0, 0.0], roots=roots, n_roots=1, update=update, modes=slice(0, 1))


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("place", [{}, {"place": 0.0}])
def test_bouncing_ball(order: int, place: dict[str, float]) -> None:
    """Impacts at t1 (1 + 2 (0.8 + 0.8^2 + ...)), also where the new position is exactly on the root."""
    times = np.linspace(0.0, 3.0, 301)
    solution = integrate(bouncing(**place), times, rtol=1e-8, order=order)
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
    assert solution.modes[:, 0] == pytest.approx(bounce)


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
    p = problem(backlash, [0.0, speed], roots=backlash_roots, n_roots=2, update=backlash_update, modes=slice(0, 1))
    times = np.linspace(0.0, 3.0, 311)
    solution = integrate(p, times, rtol=rtol, order=order)
    assert solution.x[:, 0] == pytest.approx(backlash_exact(times, speed), abs=300.0 * rtol)
    half_period = 2.0 / speed + math.pi / 30.0
    enter = 1.0 / speed + half_period * np.arange(12)
    expected = np.sort(np.concatenate((enter, enter + math.pi / 30.0)))
    expected = expected[expected < 3.0]
    assert solution.event_times == pytest.approx(expected, abs=20.0 * rtol)
    assert solution.event_roots.tolist() == [0, 0, 1, 1] * 5 + [0, 0, 1][: expected.size - 20]
    position = np.abs(backlash_exact(times, speed)) > 1.0
    clear = np.abs(np.abs(solution.x[:, 0]) - 1.0) > 1e-3
    assert np.array_equal(np.abs(solution.modes[clear, 0]) > 0.0, position[clear])


def test_events_are_located_to_rounding() -> None:
    """At every event the state is on the root, on its far side, whatever the tolerance."""
    found: list[float] = []

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        for k, place in ((0, 1.0), (1, -1.0)):
            if fired[k]:
                found.append((x[0] - place) * fired[k])
        return backlash_update(t, x, fired, data)

    p = problem(backlash, [0.0, 12.0], roots=backlash_roots, n_roots=2, update=update)
    integrate(p, np.array([0.0, 3.0]), rtol=1e-3)
    assert len(found) == 22
    assert min(found) > 0.0
    assert max(found) < 3e-14


def test_roots_that_cross_together_are_handled_together() -> None:
    calls: list[list[int]] = []

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = 1.0 + 0.1 * math.sin(t)

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0], g[1], g[2], g[3] = x[0] - 1.0, 8.0 * (1.0 - x[0]), x[0] - 1.5, 7.0

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        calls.append([fired[k] for k in range(4)])
        return 0

    solution = integrate(problem(rhs, [0.0], roots=roots, n_roots=4, update=update), np.array([0.0, 2.0]), rtol=1e-6)
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
    return integrate(p, np.array([-8.0, 12.0]), rtol=1e-6, **more)


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

    solution = integrate(problem(oscillator, [1.0, 0.0], roots=roots, n_roots=1), np.array([0.0, 20.0]), rtol=1e-10)
    assert solution.event_times == pytest.approx(math.pi * (np.arange(6) + 0.5), abs=1e-8)


@pytest.mark.parametrize("order", [5, 8])
def test_event_log_grows(order: int) -> None:
    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0], g[1] = math.sin(t), math.cos(t)

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = math.cos(t)

    p = problem(rhs, [0.0], roots=roots, n_roots=2)
    solution = integrate(p, np.linspace(0.0, 1000.3, 7), rtol=1e-6, order=order)
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

    p = problem(rhs, [0.0], roots=roots, n_roots=1, update=update, modes=slice(0, 1))
    solution = integrate(p, np.array([0.0, 1.0]), rtol=1e-6)
    assert solution.modes[:, 0].tolist() == [0.0, 1.0]
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

    p = problem(rhs, [0.0], update=update, modes=slice(0, 1), time_events=np.array([0.7, 0.1, -1.0, 1.0, 8.0]))
    solution = integrate(p, np.array([0.0, 0.0999999, 0.1, 0.4, 0.7, 1.0]), rtol=1e-6)
    assert seen == [0.0, 0.1, 0.7, 1.0]
    assert solution.x[:, 0] == pytest.approx([0.0, 0.0, 5.0, 5.3, 5.6, 5.6], abs=1e-12)
    assert solution.modes[:, 0].tolist() == [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    assert solution.event_times.tolist() == [0.1, 0.7, 1.0]
    assert solution.event_roots.tolist() == [-1, -1, -1]


def test_sample_on_a_root_holds_the_limit_from_the_right() -> None:
    first = integrate(bouncing(), np.array([0.0, 1.0]), rtol=1e-8)
    impact = first.event_times[0]
    solution = integrate(bouncing(), np.array([0.0, impact - 1e-9, impact, 1.0]), rtol=1e-8)
    assert solution.x[1, 1] == pytest.approx(-9.81 * impact, rel=1e-6)
    assert solution.x[2, 1] == pytest.approx(0.8 * 9.81 * impact, rel=1e-9)


def test_chattering_is_reported() -> None:
    """A relay that pushes its state back from both sides never gets beyond 1 s."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = -1.0 if data[0] > 0.0 else 1.0

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0] = x[0]

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        data[0] = 1.0 if x[0] > 0.0 else -1.0
        return 1

    with pytest.raises(SolverError, match=r"chatter at t = 1(\.0+\d*)? s .* of roots \[0\]"):
        integrate(problem(rhs, [1.0], roots=roots, n_roots=1, update=update), np.array([0.0, 2.0]), rtol=1e-6)


# ---------------------------------------------------------------- failures


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("how", ["code", "nan"])
def test_right_hand_side_that_asks_for_smaller_steps(order: int, how: str) -> None:
    """x' = -2 sqrt(x) cannot be evaluated below zero, where too large a step would get; a failed stage is the last one tried."""
    failed_at = [math.inf]

    def rhs(t: float, x: Any, dx: Any, data: Any) -> int:
        assert t < failed_at[0]
        failed_at[0] = t if x[0] < 0.0 and how == "code" else math.inf
        if x[0] < 0.0:
            dx[0] = math.nan if how == "nan" else 0.0
            return 1 if how == "code" else 0
        dx[0] = -2.0 * math.sqrt(x[0])
        return 0

    times = np.linspace(0.0, 0.99, 100)
    solution = integrate(problem(rhs, [1.0]), times, rtol=1e-5, order=order, first_step=30.0)
    assert solution.x[:, 0] == pytest.approx((1.0 - times) ** 2, abs=1e-4)
    longer = problem(rhs, [1.0])
    with pytest.raises(SolverError, match=r"too small at t = (1|0\.99\d*|1\.0\d*) s"):
        integrate(longer, np.array([0.0, 1.5]), rtol=1e-5, order=order)


def test_solution_that_goes_to_infinity_is_reported() -> None:
    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = x[0] * x[0]

    with pytest.raises(SolverError, match=r"too small at t = (1|0\.9999\d*|1\.0000\d*) s after \d+ steps"):
        integrate(problem(rhs, [1.0]), np.array([0.0, 2.0]), rtol=1e-6)


@pytest.mark.parametrize("at_once", [True, False])
def test_right_hand_side_that_stops_the_run(at_once: bool) -> None:
    def rhs(t: float, x: Any, dx: Any, data: Any) -> int:
        dx[0] = 1.0
        return -1 if at_once or t > 0.5 else 0

    with pytest.raises(SolverError, match="right-hand side cannot be evaluated at t = 0"):
        integrate(problem(rhs, [0.0]), np.array([0.0, 1.0]), rtol=1e-6)


def test_update_that_fails() -> None:
    with pytest.raises(SolverError, match=r"event could not be handled at t = 0\.25 s"):
        integrate(
            problem(oscillator, [1.0, 0.0], update=lambda t, *_: -1 if t > 0.0 else 0, time_events=np.array([0.25])),
            np.array([0.0, 1.0]),
            rtol=1e-6,
        )


def test_number_of_steps_is_limited() -> None:
    with pytest.raises(SolverError, match=r"after 20 steps .* max_steps is 20"):
        integrate(problem(oscillator, [1.0, 0.0]), np.array([0.0, 1e4]), rtol=1e-6, max_steps=20)
    enough = integrate(problem(oscillator, [1.0, 0.0]), np.array([0.0, 1.0]), rtol=1e-6).stats["steps"]
    assert integrate(problem(oscillator, [1.0, 0.0]), np.array([0.0, 1.0]), rtol=1e-6, max_steps=enough).status == "done"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"order": 4}, "order is 5 or 8, not 4"),
        ({"rtol": 0.0}, "rtol must lie between 0 and 1"),
        ({"atol": [1.0, 1.0, 1.0]}, "atol is one number or 2"),
        ({"atol": 0.0}, "must be positive"),
        ({"times": [1.0, 0.0]}, "not decrease"),
        ({"times": []}, "at least"),
    ],
)
def test_bad_arguments(arguments: dict[str, Any], message: str) -> None:
    times = np.array(arguments.pop("times", [0.0, 1.0]))
    with pytest.raises(ArgumentError, match=message):
        integrate(problem(oscillator, [1.0, 0.0]), times, **{"rtol": 1e-6, **arguments})


def test_algebraic_unknowns_are_refused() -> None:
    p = problem(oscillator, [1.0, 0.0])
    p.differential[1] = False
    with pytest.raises(ArgumentError, match="algebraic unknowns"):
        integrate(p, np.array([0.0, 1.0]), rtol=1e-6)


# ---------------------------------------------------------------- stiffness


def van_der_pol(t: float, x: Any, dx: Any, data: Any) -> None:
    dx[0], dx[1] = x[1], 1000.0 * (1.0 - x[0] * x[0]) * x[1] - x[0]


@pytest.mark.parametrize("order", [5, 8])
def test_stiffness_is_detected(order: int) -> None:
    """Van der Pol's oscillator with mu = 1000 on its slow branch, x' = x / (mu (1 - x^2)): stopped early, near that branch."""
    times = np.linspace(0.0, 500.0, 50001)
    solution = integrate(problem(van_der_pol, [2.0, 0.0]), times, rtol=1e-4, order=order, detect_stiffness=True)
    assert solution.status == "stiff"
    assert solution.stats["steps"] < 2000
    assert solution.t.size == solution.x.shape[0] == np.searchsorted(times, solution.t_last, side="right")
    x = solution.x_last[0]
    assert solution.t_last == pytest.approx(1000.0 * (math.log(x / 2.0) - (x * x - 4.0) / 2.0), rel=0.02)
    assert solution.stats["data"].shape == (4,)


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-7])
@pytest.mark.parametrize(("zeta", "scale"), [(0.02, 1.0), (0.02, 1e-6), (0.2, 1.0)])
def test_vibrations_are_not_taken_for_stiff(order: int, rtol: float, zeta: float, scale: float) -> None:
    """Frequencies in the ratio 30, the fast one soon at rest: the limit of stability is not on the real axis."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = x[1], -x[0] - 0.02 * x[1]
        dx[2], dx[3] = x[3], -900.0 * x[2] - 60.0 * zeta * x[3] + 1e-3 * x[0]

    p = problem(rhs, [scale, 0.0, 0.0, scale], nominal=np.array([scale, scale, scale / 30.0, scale]))
    solution = integrate(p, np.array([0.0, 150.0]), rtol=rtol, order=order, detect_stiffness=True)
    assert solution.status == "done"
    assert solution.stats["steps"] > 600


def test_stiff_run_near_its_end_is_finished() -> None:
    solution = integrate(problem(van_der_pol, [2.0, 0.0]), np.array([0.0, 0.3]), rtol=1e-4, detect_stiffness=True)
    assert solution.status == "done"


# ---------------------------------------------------------------- cost


def test_numba_is_imported_by_the_first_run_only() -> None:
    code = "import sys, gearlib.solve.rungekutta; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
