"""IDA on small problems with known answers, through both backends."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numba import carray, cfunc, types
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gearlib as gl
from gearlib.errors import ArgumentError, SolverError, StartError
from gearlib.solvers.ida import ida
from gearlib.solvers.ida.iteration_matrix import plan, reverse_cuthill_mckee
from gearlib.solvers.ida.sundials import Sundials, UnavailableError, load
from gearlib.solvers.problem import Problem
from tests.run.python_problem import by_ida

doubles, longs, ints = types.CPointer(types.float64), types.CPointer(types.int64), types.CPointer(types.int32)
evaluates = cfunc(types.int32(types.float64, doubles, doubles, doubles, longs), cache=True)
updates = cfunc(types.int32(types.float64, doubles, ints, doubles, longs), cache=True)
both_roads = pytest.mark.parametrize("native", [True, False], ids=["native", "scikit-sundae"])


def problem(
    rhs: Any, x0: list[float], data: list[float] | None = None, algebraic: tuple[int, ...] = (), **more: Any
) -> Problem:
    n = len(x0)
    return Problem(
        rhs=rhs,
        x0=np.array(x0, dtype=float),
        data=np.array(data or [0.0]),
        index=np.zeros(1, dtype=np.int64),
        differential=np.array([i not in algebraic for i in range(n)]),
        nominal=np.ones(n),
        **more,
    )


# --- linear systems x' = A x, with A in compressed columns: values in data, [n, indptr, indices] in index -------------------


@evaluates
def linear_rhs(t, x_, dx_, data_, index_):
    n = carray(index_, 1)[0]
    indptr = carray(index_, n + 2)[1:]
    indices = carray(index_, n + 2 + indptr[n])[n + 2 :]
    x, dx, values = carray(x_, n), carray(dx_, n), carray(data_, indptr[n])
    dx[:] = 0.0
    for j in range(n):
        for k in range(indptr[j], indptr[j + 1]):
            dx[indices[k]] += values[k] * x[j]
    return 0


@evaluates
def linear_jac(t, x_, values_, data_, index_):
    n = carray(index_, 1)[0]
    nnz = carray(index_, n + 2)[n + 1]
    carray(values_, nnz)[:] = carray(data_, nnz)
    return 0


def linear(matrix: Any, x0: Any) -> Problem:
    n = len(x0)
    columns, rows = np.nonzero(matrix.T)
    indptr = np.searchsorted(columns, np.arange(n + 1))
    return Problem(
        rhs=linear_rhs,
        jac=linear_jac,
        jac_indptr=indptr,
        jac_indices=rows,
        x0=np.array(x0, dtype=float),
        data=matrix[rows, columns],
        index=np.concatenate([[n], indptr, rows]),
        differential=np.ones(n, dtype=bool),
        nominal=np.ones(n),
    )


def chain(count: int) -> Any:
    """Bodies joined by springs and dampers, grounded at one end, driven by a sine that two further states make."""
    stiffness = 2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    stiffness[-1, -1] = 1
    a = np.zeros((2 * count + 2, 2 * count + 2))
    a[:count, count : 2 * count] = np.eye(count)
    a[count : 2 * count, :count] = -1e4 * stiffness
    a[count : 2 * count, count : 2 * count] = -0.5 * stiffness
    a[2 * count - 1, -2] = 100.0
    a[-2, -1], a[-1, -2] = 50.0, -50.0
    return a


@both_roads
def test_oscillator_matches_its_closed_form(native: bool) -> None:
    times = np.linspace(0, 2, 41)
    solution = by_ida(linear(np.array([[0.0, 1.0], [-100.0, 0.0]]), [1.0, 0.0]), times, rtol=1e-7, native=native)
    np.testing.assert_allclose(solution.x[:, 0], np.cos(10 * times), atol=1e-5)
    np.testing.assert_allclose(solution.x[:, 1], -10 * np.sin(10 * times), atol=1e-4)
    assert solution.status == "done"
    assert solution.t_last == 2.0
    np.testing.assert_array_equal(solution.x_last, solution.x[-1])


def test_late_times_cost_no_accuracy() -> None:
    """Rounding of the time, 1e-10 s here, is that of the samples and not of every step."""
    since = np.linspace(0, 2, 9)
    scene = linear(np.array([[0.0, 1.0], [-100.0, 0.0]]), [1.0, 0.0])
    solution = by_ida(scene, 1e6 + since, rtol=1e-11)
    np.testing.assert_allclose(solution.x[:, 0], np.cos(10 * since), atol=1e-9)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
def test_error_stays_near_what_was_asked_for(rtol: float) -> None:
    a = chain(10)
    x0 = np.append(np.zeros(21), 1.0)
    times = np.linspace(0, 0.5, 51)
    step = expm(a * 0.01)
    exact = np.array([np.linalg.matrix_power(step, k) @ x0 for k in range(51)])
    solved = replace(linear(a, x0), nominal=np.append(np.full(10, 1e-3), np.ones(12)))
    error = np.max(np.abs(by_ida(solved, times, rtol=rtol).x - exact), axis=0) / np.max(np.abs(exact), axis=0)
    assert 0.01 * rtol < np.max(error) < 100 * rtol


def test_every_storage_of_the_matrix_gives_the_same_solution() -> None:
    a = chain(30)
    rng = np.random.default_rng(0)
    shuffled = rng.permutation(62)
    a = a[np.ix_(shuffled, shuffled)]
    scene = linear(a, rng.standard_normal(62))
    times = np.linspace(0, 0.1, 11)
    solutions = {kind: by_ida(scene, times, rtol=1e-9, linear_solver=kind) for kind in ("dense", "band", "sparse")}
    exact = expm(a * 0.1) @ scene.x0
    scale = np.max(np.abs(exact))
    for kind, solution in solutions.items():
        assert str(solution.stats["linear_solver"]).startswith(kind)
        np.testing.assert_allclose(solution.x[-1], exact, atol=1e-7 * scale)
        np.testing.assert_allclose(solution.x, solutions["dense"].x, atol=1e-9 * scale)
    differences = by_ida(replace(scene, jac=None), times, rtol=1e-9)
    np.testing.assert_allclose(differences.x[-1], exact, atol=1e-7 * scale)


@pytest.mark.parametrize("kind", ["dense", "band", "sparse"])
def test_both_roads_take_the_same_steps(kind: str) -> None:
    scene = linear(chain(10), np.append(np.zeros(21), 1.0))
    times = np.linspace(0, 0.05, 6)
    native = by_ida(scene, times, rtol=1e-6, linear_solver=kind)
    other = by_ida(scene, times, rtol=1e-6, linear_solver=kind, native=False)
    for count in ("rhs", "jac", "attempts", "linear_solver"):
        assert native.stats[count] == other.stats[count]
    np.testing.assert_allclose(other.x, native.x, rtol=1e-12, atol=1e-12)
    assert native.stats["backend"].startswith("native: SUNDIALS 7")
    assert other.stats["backend"] == "scikit-sundae: asked for"
    assert native.stats["steps"] + native.stats["rejected"] == native.stats["attempts"]


def test_order_narrows_the_band_of_a_chain_wherever_its_numbering_starts() -> None:
    shuffled = np.random.default_rng(1).permutation(300)
    rows, columns = shuffled[:-1], shuffled[1:]
    place = np.argsort(reverse_cuthill_mckee(300, rows, columns))
    assert np.max(np.abs(place[rows] - place[columns])) == 1
    found = plan(linear(chain(100), np.zeros(202)))
    assert (found.kind, found.lower, found.upper) == ("band", 3, 3)


@evaluates
def shaken_rhs(t, x_, dx_, data_, index_):
    x, dx = carray(x_, 2), carray(dx_, 2)
    dx[0] = x[1]
    dx[1] = -1e4 * x[0] + np.sin(2 * np.pi * 50 * t)
    return 0


@both_roads
@pytest.mark.parametrize("t_end", [0.02, 10.0])
def test_excitation_of_a_model_at_rest_is_not_stepped_over(t_end: float, native: bool) -> None:
    # Every thousandth and hundredth of these times, IDA's own first steps, is a multiple of the half period or close to zero.
    solution = by_ida(problem(shaken_rhs, [0.0, 0.0]), [0.0, t_end], rtol=1e-6, atol=1e-10, native=native)
    natural, forced = 100.0, 100 * np.pi
    gain = 1 / (natural**2 - forced**2)
    exact = gain * (np.sin(forced * t_end) - forced / natural * np.sin(natural * t_end))
    assert solution.x[-1, 0] == pytest.approx(exact, rel=1e-3)


# --- differential-algebraic --------------------------------------------------------------------------------------------------


@evaluates
def robertson_rhs(t, x_, dx_, data_, index_):
    x, dx = carray(x_, 3), carray(dx_, 3)
    dx[0] = -0.04 * x[0] + 1e4 * x[1] * x[2]
    dx[1] = 0.04 * x[0] - 1e4 * x[1] * x[2] - 3e7 * x[1] * x[1]
    dx[2] = x[0] + x[1] + x[2] - 1.0
    return 0


@both_roads
def test_robertson_with_its_conservation_law(native: bool) -> None:
    times = np.array([0.0, 0.4, 4.0, 40.0])
    # The algebraic unknown starts wrong, to be made consistent.
    scene = replace(problem(robertson_rhs, [1.0, 0.0, 0.3], algebraic=(2,)), nominal=np.array([1.0, 1e-4, 1.0]))
    solution = by_ida(scene, times, rtol=1e-8, native=native)

    def ode(t: float, x: Any) -> list[float]:
        slow, fast, back = 0.04 * x[0], 3e7 * x[1] ** 2, 1e4 * x[1] * x[2]
        return [back - slow, slow - back - fast, fast]

    exact = solve_ivp(ode, (0, 40), [1.0, 0.0, 0.0], "Radau", times, rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(solution.x[1:], exact.y.T[1:], rtol=1e-6)
    assert abs(solution.x[0, 2]) < 1e-8


@evaluates
def driven_rhs(t, x_, dx_, data_, index_):
    x, dx, data = carray(x_, 2), carray(dx_, 2), carray(data_, 2)
    dx[0] = data[1] * x[1] - x[0]
    dx[1] = x[1] - data[0] * np.sin(50.0 * t) ** 2
    return 0


@evaluates
def driven_jac(t, x_, values_, data_, index_):
    values = carray(values_, 3)
    values[0], values[1], values[2] = -1.0, carray(data_, 2)[1], 1.0
    return 0


@pytest.mark.parametrize("amplitude", [1.0, -1.0, 1e-9])
@pytest.mark.parametrize("gain", [0.0, 1.0])
def test_an_algebraic_unknown_that_time_drives_limits_the_first_step(amplitude: float, gain: float) -> None:
    """Its rate is zero at the start. On both roads alike, whether or not a state follows."""
    pattern = {"jac_indptr": np.array([0, 1, 3]), "jac_indices": np.array([0, 0, 1])}
    scene = problem(driven_rhs, [0.0, 0.0], [amplitude, gain], algebraic=(1,), jac=driven_jac, **pattern)
    t = np.linspace(0.0, 1.0, 5)
    native, other = (by_ida(scene, t, rtol=1e-6, atol=1e-9, native=native) for native in (True, False))
    for count in ("rhs", "jac", "attempts"):
        assert native.stats[count] == other.stats[count]
    swing = (np.cos(100 * t) + 100 * np.sin(100 * t) - np.exp(-t)) / 10001
    state = 0.5 * gain * amplitude * (1 - np.exp(-t) - swing)
    np.testing.assert_allclose(native.x[:, 0], state, atol=1e-6)
    np.testing.assert_allclose(native.x[:, 1], amplitude * np.sin(50 * t) ** 2, atol=1e-7)
    np.testing.assert_allclose(other.x, native.x, rtol=1e-12, atol=1e-15)


@evaluates
def jump_rhs(t, x_, dx_, data_, index_):
    x, dx, data = carray(x_, 2), carray(dx_, 2), carray(data_, 3)
    dx[0] = 1.0 + data[2]
    dx[1] = x[1] - x[0] + 2.0 * data[1]  # x[1] drops by 2 when data[1] turns from 0 to 1
    return 0


@evaluates
def jump_roots(t, x_, g_, data_, index_):
    x, g = carray(x_, 2), carray(g_, 2)
    g[0] = x[0] - 1.0
    g[1] = x[1] + 0.5
    return 0


@updates
def jump_update(t, x_, fired_, data_, index_):
    fired, data = carray(fired_, 2), carray(data_, 3)
    changed = 0
    if fired[0] > 0:
        data[1] = 1.0
        changed = 1
    if fired[1] < 0:  # follows from the first one's jump, at the same instant
        data[2] = 1.0
        changed = 1
    return changed


@both_roads
def test_event_that_an_algebraic_jump_carries_along(native: bool) -> None:
    scene = problem(
        jump_rhs, [0.0, 0.0], [0.0] * 3, (1,), roots=jump_roots, n_roots=2, update=jump_update, discrete=slice(1, 3)
    )
    solution = by_ida(scene, [0.0, 0.9, 1.5], rtol=1e-8, native=native)
    np.testing.assert_allclose(solution.x, [[0, 0], [0.9, 0.9], [2.0, 0.0]], atol=1e-7)
    np.testing.assert_array_equal(solution.discrete, [[0, 0], [0, 0], [1, 1]])


# --- events ------------------------------------------------------------------------------------------------------------------


@evaluates
def ball_rhs(t, x_, dx_, data_, index_):
    x, dx = carray(x_, 2), carray(dx_, 2)
    dx[0] = x[1]
    dx[1] = -10.0
    return 0


@evaluates
def first_state_root(t, x_, g_, data_, index_):
    carray(g_, 1)[0] = carray(x_, 1)[0]
    return 0


@updates
def ball_update(t, x_, fired_, data_, index_):
    x, data = carray(x_, 2), carray(data_, 1)
    if carray(fired_, 1)[0] < 0:
        x[1] *= -0.5
        data[0] += 1.0
        return 2
    return 0


@both_roads
def test_bouncing_ball(native: bool) -> None:
    scene = problem(ball_rhs, [5.0, 0.0], [0.0], roots=first_state_root, n_roots=1, update=ball_update, discrete=slice(0, 1))
    times = np.array([0.0, 0.5, 1.2, 2.0, 2.4, 2.6])
    solution = by_ida(scene, times, rtol=1e-9, native=native)
    # Falls 5 m in 1 s to 10 m/s; leaves at 5 m/s, back after 1 s; leaves at 2.5 m/s, back after 0.5 s.
    falls = solution.event_times[[True, *(np.diff(solution.event_times) > 1e-6)]]
    np.testing.assert_allclose(falls, [1.0, 2.0, 2.5], atol=1e-7)
    since = np.array([0.2, 0.0, 0.4, 0.1])
    speed = np.array([5.0, 2.5, 2.5, 1.25])
    np.testing.assert_allclose(solution.x[2:, 0], speed * since - 5 * since**2, atol=1e-7)
    np.testing.assert_array_equal(solution.discrete[:, 0], [0, 0, 1, solution.discrete[3, 0], 2, 3])
    assert set(solution.event_roots) == {0}
    assert scene.data[0] == 0.0  # the problem itself is left as it was


@evaluates
def switched_rhs(t, x_, dx_, data_, index_):
    carray(dx_, 1)[0] = carray(data_, 1)[0]
    return 0


@updates
def clock_update(t, x_, fired_, data_, index_):
    data = carray(data_, 1)
    before = data[0]
    data[0] = 3.0 if t >= 0.3 else 1.0
    return 1 if data[0] != before else 0


@both_roads
def test_time_event_is_met_exactly_and_sampled_on_its_right(native: bool) -> None:
    times = np.array([0.0, 0.2, 0.3, 1.0])
    scene = problem(
        switched_rhs, [0.0], [1.0], update=clock_update, discrete=slice(0, 1), time_events=np.array([0.3, -1.0, 7.0])
    )
    solution = by_ida(scene, times, rtol=1e-8, native=native)
    np.testing.assert_allclose(solution.x[:, 0], [0, 0.2, 0.3, 2.4], atol=1e-9)
    np.testing.assert_array_equal(solution.discrete[:, 0], [1, 1, 3, 3])
    np.testing.assert_array_equal(solution.event_times, [0.3])
    np.testing.assert_array_equal(solution.event_roots, [-1])
    assert solution.stats["restarts"] == 1


@evaluates
def ramp_rhs(t, x_, dx_, data_, index_):
    carray(dx_, 1)[0] = max(t - 0.25, 0.0)
    return 0


@updates
def count_update(t, x_, fired_, data_, index_):
    carray(data_, 1)[0] += carray(fired_, 1)[0]
    return 1


@both_roads
def test_root_that_starts_at_zero_and_stays_there_for_a_while_is_found(native: bool) -> None:
    scene = problem(ramp_rhs, [0.0], [0.0], roots=first_state_root, n_roots=1, update=count_update, discrete=slice(0, 1))
    solution = by_ida(scene, [0.0, 0.2, 1.0], rtol=1e-6, native=native)
    np.testing.assert_array_equal(solution.discrete[:, 0], [0, 0, 1])
    np.testing.assert_allclose(solution.event_times, [0.25], atol=1e-3)


@both_roads
@pytest.mark.parametrize(("share", "passed"), [(-1e-11, 1.0), (-2e-15, 2.0), (0.0, 2.0), (2e-15, 2.0)])
def test_samples_within_rounding_of_a_root_are_on_its_right(native: bool, share: float, passed: float) -> None:
    for place in (0.1, 0.3, 0.7, 1.3, 2.9):
        scene = problem(
            switched_rhs, [-place], [1.0], roots=first_state_root, n_roots=1, update=count_update, discrete=slice(0, 1)
        )
        times = [0.0, place * (1.0 + share), 3.0]
        assert by_ida(scene, times, rtol=1e-8, native=native).discrete[:, 0].tolist() == [1.0, passed, 2.0]


@evaluates
def wave_rhs(t, x_, dx_, data_, index_):
    carray(dx_, 1)[0] = 1e3 * np.cos(1e3 * t)
    return 0


def test_log_of_events_grows() -> None:
    scene = problem(wave_rhs, [0.5], [0.0], roots=first_state_root, n_roots=1, update=count_update)
    solution = by_ida(scene, [0.0, 1.0], rtol=1e-6)
    # sin(1000 t) = -1/2 at 7 pi/6 + 2 pi k and 11 pi/6 + 2 pi k
    k = np.arange(159)
    exact = np.sort(np.concatenate([7 * np.pi / 6 + 2 * np.pi * k, 11 * np.pi / 6 + 2 * np.pi * k])) / 1e3
    np.testing.assert_allclose(solution.event_times, exact[exact < 1], atol=1e-5)


# --- failures ----------------------------------------------------------------------------------------------------------------


@evaluates
def blow_up_rhs(t, x_, dx_, data_, index_):
    carray(dx_, 1)[0] = carray(x_, 1)[0] ** 2
    return 0


@evaluates
def square_root_rhs(t, x_, dx_, data_, index_):
    dx = carray(dx_, 2)
    dx[0] = 1.0
    dx[1] = np.sqrt(1.0 - carray(x_, 1)[0]) if carray(x_, 1)[0] <= 1.0 else np.nan
    return 0


@evaluates
def stopping_rhs(t, x_, dx_, data_, index_):
    carray(dx_, 1)[0] = 1.0
    return -1 if t > 0.5 else 0


@evaluates
def refusing_rhs(t, x_, dx_, data_, index_):
    carray(dx_, 1)[0] = 1.0
    return 1 if t > 0.5 else 0


@updates
def failing_update(t, x_, fired_, data_, index_):
    return -1


@evaluates
def no_solution_rhs(t, x_, dx_, data_, index_):
    x, dx = carray(x_, 2), carray(dx_, 2)
    dx[0] = x[1]
    dx[1] = x[1] * x[1] + 1.0
    return 0


@updates
def sliding_update(t, x_, fired_, data_, index_):
    data = carray(data_, 1)
    before = data[0]
    if carray(fired_, 1)[0] != 0:
        data[0] = -carray(fired_, 1)[0]
    return 1 if data[0] != before else 0


FAILURES = {
    "blow-up": (problem(blow_up_rhs, [1.0]), SolverError, r"(too small|not finite) at t=(0\.99|1)"),
    "not a number": (
        problem(square_root_rhs, [0.0, 0.0]),
        SolverError,
        r"der\(state 1\) is not finite at t=(0\.9999|1).*integrated until t=",
    ),
    "rhs stops": (problem(stopping_rhs, [0.0]), SolverError, r"could not be evaluated at t=0\.[5-9]"),
    "rhs refuses": (problem(refusing_rhs, [0.0]), SolverError, r"could not be evaluated at t=0\.5.*until t=0\.[45]"),
    "update": (problem(ball_rhs, [5.0, 0.0], update=failing_update), SolverError, "an event could not be handled at t = 0 s"),
    "algebraic": (
        problem(no_solution_rhs, [0.0, 1.0], algebraic=(1,)),
        StartError,
        r"t=0; the residual of the equation of state 1 is 2",
    ),
    "chattering": (
        problem(switched_rhs, [0.5], [-1.0], roots=first_state_root, n_roots=1, update=sliding_update),
        SolverError,
        r"events chatter at t = 0\.5.* of root 0$",
    ),
}


@both_roads
@pytest.mark.parametrize("name", FAILURES)
def test_failures_are_told_in_plain_words(name: str, native: bool, capfd: pytest.CaptureFixture[str]) -> None:
    scene, error, text = FAILURES[name]
    with pytest.raises(error, match=text):
        by_ida(scene, [0.0, 2.0], rtol=1e-6, native=native)
    assert capfd.readouterr() == ("", "")


@both_roads
def test_step_limit(native: bool) -> None:
    with pytest.raises(SolverError, match=r"^gave up at t = .* after 20 steps towards t = 100 s: max_steps is 20$"):
        by_ida(linear(chain(3), np.ones(8)), [0.0, 100.0], rtol=1e-6, max_steps=20, native=native)
    assert by_ida(linear(chain(3), np.ones(8)), np.linspace(0, 1, 3), rtol=1e-6).stats["steps"] > 1000


def test_arguments_that_make_no_sense() -> None:
    scene = problem(ball_rhs, [5.0, 0.0])
    for times in ([1.0, 0.0], [], [0.0, np.inf], [0.0, np.nan, 1.0]):
        with pytest.raises(ArgumentError, match="not decrease"):
            by_ida(scene, times, rtol=1e-6)
    with pytest.raises(ArgumentError, match="rtol must lie between 0 and 1"):
        by_ida(scene, [0.0, 1.0], rtol=0.0)
    with pytest.raises(ArgumentError, match="atol is one number or 2 of them"):
        by_ida(scene, [0.0, 1.0], rtol=1e-6, atol=[1.0, 2.0, 3.0])
    with pytest.raises(StartError, match="state 1 starts at a value that is not finite"):
        by_ida(problem(ball_rhs, [5.0, np.nan]), [0.0, 1.0], rtol=1e-6)


# --- backends and resources -----------------------------------------------------------------------------------------------------


def test_other_road_is_taken_when_the_libraries_are_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing() -> None:
        raise UnavailableError("no libraries here")

    monkeypatch.setattr(ida, "load", nothing)
    solution = by_ida(problem(ball_rhs, [5.0, 0.0]), [0.0, 1.0], rtol=1e-6)
    assert solution.stats["backend"] == "scikit-sundae: no libraries here"
    np.testing.assert_allclose(solution.x[-1], [0.0, -10.0], atol=1e-5)


def test_a_function_is_found_in_whichever_library_has_it() -> None:
    found = load()
    fresh = replace(found, functions={})
    for name in ("SUNContext_Create", "N_VMake_Serial", "SUNLinSol_Dense", "IDACreate", "SUNLinSol_SuperLUMT"):
        assert fresh.address(name) == found.address(name) > 0
    assert fresh.IDASolve is fresh.IDASolve
    with pytest.raises(AttributeError, match="IDAInvented"):
        fresh.IDAInvented  # noqa: B018
    with pytest.raises(UnavailableError, match="libraries of scikit-sundae lack IDACreate"):
        Sundials(found.version, found.folder, ()).address("IDACreate")


def test_a_single_sample_is_the_start_after_its_event_iteration() -> None:
    scene = problem(switched_rhs, [0.25], [0.0], update=clock_update, discrete=slice(0, 1))
    solution = by_ida(scene, [0.5], rtol=1e-6)
    np.testing.assert_array_equal(solution.x, [[0.25]])
    np.testing.assert_array_equal(solution.discrete, [[3.0]])


def test_nothing_is_leaked() -> None:
    resource = pytest.importorskip("resource")
    scene = linear(chain(100), np.ones(202))

    def run(count: int) -> int:
        for _ in range(count):
            by_ida(scene, [0.0, 1e-6], rtol=1e-3, linear_solver="dense")  # each holds a matrix of 0.3 MB
        return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)

    before = run(20)
    assert run(300) - before < 20_000  # kB; leaking matrices would take 100 MB


def test_importing_is_light() -> None:
    heavy = "{'numba', 'sksundae', 'scipy', 'sympy'}"
    code = f"import sys, gearlib.solvers.ida.ida; print(sorted({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"


@pytest.mark.parametrize("native", [True, False])
def test_absurd_tolerances_are_refused_or_met(native: bool) -> None:
    """No exception is lost in a callback, and no memory is handed out that nothing was written to."""

    class Swing(gl.Component):
        x = gl.Variable("1", "angle", start=0.0)
        v = gl.Variable("1", "speed", start=1.0)

        def equations(self):
            return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), -gl.sin(self.x))]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ida, "ida", partial(ida.ida, native=native))
        with pytest.raises(SolverError, match=r"at t=0$"):
            gl.simulate(Swing(), 1.0, samples=3, method="ida", atol=1e-300)
