"""Explicit Runge-Kutta methods against closed forms: orders, tolerances, failures, stiffness."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.errors import ArgumentError, SolverError
from gearlib.solvers.problem import Floats
from gearlib.solvers.rungekutta import tableaux
from gearlib.solvers.rungekutta.rungekutta import RungeKutta, work
from tests.run.python_problem import driver, problem, rk


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
        run = rk(problem(orbit, ORBIT_START, time_events=grid), times, rtol=1e-3, atol=1e9, order=order, first_step=1.0)
        assert run.stats["steps"] == n
        errors.append(np.abs(run.x[1, :2] - orbit_exact(times)[1]).max())
    assert order - 0.3 < math.log2(errors[0] / errors[1]) < order + 1.1


@pytest.mark.parametrize("order", [5, 8])
def test_dense_output_is_as_accurate_as_the_steps(order: int) -> None:
    few, many = np.array([0.0, 20.0]), np.linspace(0.0, 20.0, 2001)
    at_end = rk(problem(oscillator, [1.0, 0.0]), few, rtol=1e-7, order=order)
    dense = rk(problem(oscillator, [1.0, 0.0]), many, rtol=1e-7, order=order)
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
    solution = rk(problem(orbit, ORBIT_START), times, rtol=rtol, order=order)
    error = np.abs(solution.x[:, :2] - orbit_exact(times)).max()
    assert 0.02 * rtol < error < 50.0 * rtol


@pytest.mark.parametrize("order", [5, 8])
def test_relative_tolerance_counts_where_a_state_is_large(order: int) -> None:
    def growth(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = x[0]

    times = np.array([0.0, 30.0])
    solution = rk(problem(growth, [1.0], nominal=np.array([1e-20])), times, rtol=1e-6, order=order)
    assert (5e-9 if order == 5 else 1e-7) < abs(solution.x[-1, 0] / math.exp(30.0) - 1.0) < 1e-5


def test_absolute_tolerance_counts_where_a_state_is_small() -> None:
    """A decaying state is followed to its nominal size times rtol, and further with a tighter atol."""

    def decay(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = -x[0]

    times = np.array([0.0, 30.0])
    loose = rk(problem(decay, [1.0]), times, rtol=1e-6, order=8)
    tight = rk(problem(decay, [1.0]), times, rtol=1e-6, atol=1e-25, order=8)
    tiny = rk(problem(decay, [1.0], nominal=np.array([1e-19])), times, rtol=1e-6, order=8)
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
    solution = rk(problem(rhs, start), times, rtol=1e-9, order=order)
    assert solution.x == pytest.approx(exact, abs=2e-8)


def test_run_leaves_the_problem_alone_and_repeats_itself() -> None:
    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        data[0] += 1.0
        x[0] += 1.0
        return 2

    p = problem(oscillator, [1.0, 0.0], update=update, time_events=np.array([0.5]), discrete=slice(0, 1))
    times = np.linspace(0.0, 1.0, 5)
    first, second = rk(p, times, rtol=1e-6), rk(p, times, rtol=1e-6)
    assert np.array_equal(first.x, second.x)
    assert np.array_equal(first.discrete, second.discrete)
    assert np.all(p.data == 0.0)
    assert np.all(p.x0 == [1.0, 0.0])


def test_long_run_is_done_in_several_calls_of_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    times = np.linspace(0.0, 10.0, 11)
    whole = rk(problem(pendulum, [2.0, 0.0]), times, rtol=1e-8)
    monkeypatch.setattr("gearlib.solvers.drive.driver.STEPS_PER_CALL", 3)
    parts = rk(problem(pendulum, [2.0, 0.0]), times, rtol=1e-8)
    assert np.array_equal(whole.x, parts.x)
    assert whole.stats == parts.stats


@pytest.mark.parametrize("order", [5, 8])
def test_a_kink_does_not_slip_through(order: int) -> None:
    """x' = -(1 + x) / 2 below 1 and (1 - 3 x) / 2 above: where the kink lies in a step, an error estimate may vanish by chance."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = -0.5 * (1.0 + x[0]) if x[0] < 1.0 else 0.5 * (1.0 - 3.0 * x[0])

    times = np.array([0.0, 1.5, 2.5])
    kink = 2.0 / 3.0 * math.log(8.5)
    exact = 2.0 * np.exp(-0.5 * (times[1:] - kink)) - 1.0
    for rtol in np.logspace(-10, -4, 61):
        solution = rk(problem(rhs, [6.0]), times, rtol=float(rtol), order=order)
        assert np.abs(solution.x[1:, 0] - exact).max() < 500.0 * rtol


def test_single_sample_is_the_start() -> None:
    solution = rk(problem(oscillator, [1.0, 2.0]), np.array([3.0]), rtol=1e-6)
    assert solution.x.tolist() == [[1.0, 2.0]]
    assert (solution.t_last, solution.status, solution.stats["steps"]) == (3.0, "done", 0)


def test_quantities_near_underflow_become_zero() -> None:
    """They would slow arithmetic down many times, as in a long chain at rest that a wave runs into."""

    def decay(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = -x[0]

    solution = rk(problem(decay, [1e-240]), np.linspace(0.0, 60.0, 4), rtol=1e-6, atol=1e-260)
    assert solution.x[1, 0] == pytest.approx(1e-240 * math.exp(-20.0), rel=1e-5)
    assert solution.x[-1, 0] == 0.0


# ---------------------------------------------------------------- failures


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("how", ["code", "nan"])
def test_right_hand_side_that_asks_for_smaller_steps(order: int, how: str) -> None:
    """x' = -2 sqrt(x) cannot be evaluated below zero, where a large step would get; a failed stage is the last one tried."""
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
    solution = rk(problem(rhs, [1.0]), times, rtol=1e-5, order=order, first_step=30.0)
    assert solution.x[:, 0] == pytest.approx((1.0 - times) ** 2, abs=1e-4)
    longer = problem(rhs, [1.0])
    with pytest.raises(SolverError, match=r"too small at t = (1|0\.99\d*|1\.0\d*) s"):
        rk(longer, np.array([0.0, 1.5]), rtol=1e-5, order=order)


def test_solution_that_goes_to_infinity_is_reported() -> None:
    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = x[0] * x[0]

    with pytest.raises(SolverError, match=r"too small at t = (1|0\.9999\d*|1\.0000\d*) s after \d+ steps"):
        rk(problem(rhs, [1.0]), np.array([0.0, 2.0]), rtol=1e-6)


@pytest.mark.parametrize("at_once", [True, False])
def test_right_hand_side_that_stops_the_run(at_once: bool) -> None:
    def rhs(t: float, x: Any, dx: Any, data: Any) -> int:
        dx[0] = 1.0
        return -1 if at_once or t > 0.5 else 0

    with pytest.raises(SolverError, match="right-hand side cannot be evaluated at t = 0"):
        rk(problem(rhs, [0.0]), np.array([0.0, 1.0]), rtol=1e-6)


def test_update_that_fails() -> None:
    with pytest.raises(SolverError, match=r"event could not be handled at t = 0\.25 s"):
        rk(
            problem(oscillator, [1.0, 0.0], update=lambda t, *_: -1 if t > 0.0 else 0, time_events=np.array([0.25])),
            np.array([0.0, 1.0]),
            rtol=1e-6,
        )


def test_number_of_steps_is_limited() -> None:
    with pytest.raises(SolverError, match=r"after 20 steps .* max_steps is 20"):
        rk(problem(oscillator, [1.0, 0.0]), np.array([0.0, 1e4]), rtol=1e-6, max_steps=20)
    enough = rk(problem(oscillator, [1.0, 0.0]), np.array([0.0, 1.0]), rtol=1e-6).stats["steps"]
    assert rk(problem(oscillator, [1.0, 0.0]), np.array([0.0, 1.0]), rtol=1e-6, max_steps=enough).status == "done"


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
        rk(problem(oscillator, [1.0, 0.0]), times, **{"rtol": 1e-6, **arguments})


def test_algebraic_unknowns_are_refused() -> None:
    p = problem(oscillator, [1.0, 0.0])
    p.differential[1] = False
    with pytest.raises(ArgumentError, match="algebraic unknowns"):
        rk(p, np.array([0.0, 1.0]), rtol=1e-6)


# ---------------------------------------------------------------- stiffness


def van_der_pol(t: float, x: Any, dx: Any, data: Any) -> None:
    dx[0], dx[1] = x[1], 1000.0 * (1.0 - x[0] * x[0]) * x[1] - x[0]


@pytest.mark.parametrize("order", [5, 8])
def test_stiffness_is_detected(order: int) -> None:
    """Van der Pol's oscillator with mu = 1000 on its slow branch, x' = x / (mu (1 - x^2)): stopped early, near that branch."""
    times = np.linspace(0.0, 500.0, 50001)
    run = driver(problem(van_der_pol, [2.0, 0.0]), times, stepper := RungeKutta(order), rtol=1e-4)
    stepper.watch()
    while run.advance() == "more":
        pass
    solution = run.solution()
    assert solution.status == "stiff"
    assert stepper.damped
    assert solution.stats["steps"] < 200
    assert solution.t.size == solution.x.shape[0] == np.searchsorted(times, solution.t_last, side="right")
    x = solution.x_last[0]
    # the slow branch is reached from rest after some time constants of 1/3000 s, which its formula leaves out
    assert solution.t_last == pytest.approx(1000.0 * (math.log(x / 2.0) - (x * x - 4.0) / 2.0), rel=0.02, abs=5e-4)
    assert solution.data.shape == (4,)


@pytest.mark.parametrize("order", [5, 8])
def test_pace_is_that_of_the_limit_of_stability(order: int) -> None:
    """x' = -1000 (x - cos t): the product of step and eigenvalue ends at 3.5 for Tsitouras' method, 6.1 for Dormand and Prince's."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = -1000.0 * (x[0] - math.cos(t))

    p = problem(rhs, [1.0])
    run = driver(p, [0.0, 10.0], stepper := RungeKutta(order), rtol=1e-4)
    stepper.watch()
    while run.advance() == "more":
        pass
    assert stepper.damped
    step = stepper.pace * work(p, order, 1, 0)
    assert 0.5 < 1000.0 * step / {5: 3.5, 8: 6.1}[order] < 1.1


def test_work_is_counted_in_operations() -> None:
    """Of the stages of each step, of vectors, and of looks at event functions, if there are any."""
    own = problem(oscillator, [1.0, 0.0], roots=lambda *_: 0, n_roots=1, rhs_cost=70.0, roots_cost=11.0, update_cost=13.0)
    assert work(own, 5, 7, 3) == 7 * (6 * 70.0 + 150.0 + 5 * 2 + 2 * 11.0) + 3 * (70.0 + 13.0 + 10 * 11.0)
    assert work(own, 8, 7, 3) == 7 * (12 * 70.0 + 250.0 + 10 * 2 + 2 * 11.0) + 3 * (70.0 + 13.0 + 10 * 11.0)
    assert work(problem(oscillator, [1.0, 0.0], rhs_cost=70.0), 5, 7, 0) == 7 * (6 * 70.0 + 150.0 + 5 * 2)


def test_watching_begins_after_some_work() -> None:
    p = problem(van_der_pol, [2.0, 0.0])
    run = driver(p, [0.0, 500.0], stepper := RungeKutta(), rtol=1e-4)
    stepper.watch()
    while run.advance() == "more":
        pass
    first = stepper.work
    stepper.watch(50 * work(p, 5, 1, 0))
    while run.advance() == "more":
        pass
    assert stepper.work - first == pytest.approx(50 * work(p, 5, 1, 0))


def test_a_run_that_stopped_for_stiffness_goes_on_as_if_it_had_not() -> None:
    times, p = np.linspace(0.0, 0.5, 11), problem(van_der_pol, [2.0, 0.0])
    run = driver(p, times, stepper := RungeKutta(), rtol=1e-4)
    stepper.watch()
    while run.advance(7) != "done":
        pass
    np.testing.assert_array_equal(run.solution().x, rk(p, times, rtol=1e-4).x)


# ---------------------------------------------------------------- memory


@pytest.mark.parametrize(
    ("order", "stages", "polynomials"),
    [(5, len(tableaux.TSIT5_A), len(tableaux.TSIT5_R[0])), (8, len(tableaux.DOP853_A), 3 + len(tableaux.DOP853_D))],
)
def test_memory_of_a_run_has_a_row_for_each_stage_and_polynomial(order: int, stages: int, polynomials: int) -> None:
    record = driver(problem(oscillator, [1.0, 0.0]), [0.0, 1.0], RungeKutta(order)).stepper.record
    row = 8 * record.size
    assert [(record.c - record.k) / row, (record.phases - record.c) / row] == [stages, polynomials]


# ---------------------------------------------------------------- cost


def test_numba_is_imported_by_the_first_run_only() -> None:
    code = "import sys, gearlib.solvers.rungekutta.rungekutta; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
