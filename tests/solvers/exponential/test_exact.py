"""Exact solutions of linear scenes against closed forms, 50-digit exponentials and step-size controlled integrators."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
import sympy
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from sympy import Piecewise, cos, exp, pi, sin

from gearlib.errors import ArgumentError, SolverError
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.drive.driver import integrate as drive
from gearlib.solvers.exponential.exact import Exponential, prepare
from gearlib.solvers.exponential.forcing import Forcing, recognise
from gearlib.solvers.exponential.stretches import stretches
from gearlib.solvers.inputs.table import Table
from gearlib.solvers.problem import LinearChanges, LinearForm, NoCode, Problem

t = sympy.Symbol("time", real=True)


def integrate(A: Any, B: Any, forcing: Forcing, x0: Any, times: Any, **options: Any) -> np.ndarray:
    return prepare(A, B, forcing, times, **options).solve(x0)


def solve(A: Any, B: Any, u: list[Any], x0: Any, times: Any, t0: float = 0.0, **options: Any) -> np.ndarray:
    forcing = recognise(u, t0, float(times[-1]))
    assert isinstance(forcing, Forcing), forcing
    B = np.asarray(B, float).reshape(A.shape[0], len(u))
    return integrate(A, B, forcing, np.asarray(x0, float), np.asarray(times, float), **options)


def reference(A: np.ndarray, x0: np.ndarray, time: float) -> np.ndarray:
    """exp(A time) x0 with all digits: 50, and as many more as the doublings lose."""
    size = float(np.abs(A).sum(axis=1).max()) * time
    doublings = max(0, math.ceil(math.log2(max(size, 1.0)))) + 4
    with mpmath.workdps(50 + doublings):
        X = mpmath.matrix(A.tolist()) * mpmath.mpf(time) / mpmath.mpf(2) ** doublings
        total = term = mpmath.eye(len(A))
        for k in range(1, 50):
            term = term * X / k
            total = total + term
        for _ in range(doublings):
            total = total * total
        return np.array([float(v) for v in total * mpmath.matrix(x0.tolist())])


def chain(N: int, c: float = 1e5, d: float = 5.0) -> tuple[Any, np.ndarray]:
    """N inertias, spring-dampers between them, a damper to ground on the last: speeds, then deflections."""
    J = 0.01 * (1.0 + np.arange(N) / N)
    stretch = scipy.sparse.diags_array([np.ones(N - 1), -np.ones(N - 1)], offsets=[0, 1], shape=(N - 1, N)).tocsr()
    drag = scipy.sparse.coo_array(([1.0], ([N - 1], [N - 1])), shape=(N, N))
    per_inertia = scipy.sparse.diags_array(1.0 / J)
    A = scipy.sparse.block_array(
        [[-per_inertia @ (d * stretch.T @ stretch + drag), -c * per_inertia @ stretch.T], [stretch, None]], format="csr"
    )
    B = np.zeros((2 * N - 1, 1))
    B[0, 0] = 1.0 / J[0]
    return A, B


# ---------------------------------------------------------------- closed forms

TIMES = np.linspace(0.0, 2.0, 41)


def test_damped_oscillator_under_a_sine() -> None:
    m, c, k, F, w = 2.0, 0.8, 50.0, 3.0, 4.0
    x = solve(np.array([[0, 1], [-k / m, -c / m]]), [0, 1 / m], [F * sin(w * t)], [0.1, -1.0], TIMES)
    steady = F / (k - m * w**2 + 1j * c * w)  # of exp(i w t); the sine is its imaginary part
    decay, wd = c / (2 * m), math.sqrt(k / m - (c / (2 * m)) ** 2)
    p0, v0 = 0.1 - steady.imag, -1.0 - (1j * w * steady).imag
    free = np.exp(-decay * TIMES) * (p0 * np.cos(wd * TIMES) + (v0 + decay * p0) / wd * np.sin(wd * TIMES))
    assert np.abs(x[:, 0] - free - (steady * np.exp(1j * w * TIMES)).imag).max() < 1e-15


def test_resonance() -> None:
    w = 7.0
    x = solve(np.array([[0, 1], [-(w**2), 0]]), [0, 1], [cos(w * t)], [0, 0], TIMES)
    assert np.abs(x[:, 0] - TIMES * np.sin(w * TIMES) / (2 * w)).max() < 1e-14


def test_exponential_at_the_eigenvalue() -> None:
    x = solve(np.array([[-3.0]]), [1], [exp(-3 * t)], [2], TIMES)
    assert x[:, 0] == pytest.approx((2 + TIMES) * np.exp(-3 * TIMES), rel=1e-14, abs=0)


def test_polynomial_through_integrators() -> None:
    x = solve(np.array([[0, 1, 0], [0, 0, 1], [0, 0, 0.0]]), [0, 0, 1], [1 - 6 * t**2], [1, 2, 3], TIMES)
    assert x[:, 0] == pytest.approx(1 + 2 * TIMES + 1.5 * TIMES**2 + TIMES**3 / 6 - TIMES**5 / 10, rel=1e-14, abs=0)


def test_defective_matrix() -> None:
    A = np.array([[-1.0, 1, 0], [0, -1, 1], [0, 0, -1]])
    x = solve(A, np.zeros((3, 0)), [], [0, 0, 1], TIMES)
    assert x[:, 0] == pytest.approx(TIMES**2 / 2 * np.exp(-TIMES), rel=1e-13, abs=0)


def test_product_of_all_kinds_is_integrated() -> None:
    x = solve(np.zeros((1, 1)), [1], [exp(-3 * t) * t**2 * cos(4 * t + 1)], [0], [0.7, 2.0])
    with mpmath.workdps(30):
        area = [float(mpmath.quad(lambda s: mpmath.exp(-3 * s) * s**2 * mpmath.cos(4 * s + 1), [0, end])) for end in (0.7, 2)]
    assert x[:, 0] == pytest.approx(area, rel=1e-14, abs=0)


@pytest.mark.parametrize("grid", [TIMES, [0.0, 0.1, 0.3, 0.30001, 2.0], [2.0], np.linspace(0, 2, 12)])
def test_step_ramp_and_pulse(grid: Any) -> None:
    s = np.asarray(grid, float)
    step = Piecewise((0, t < 0.3), (1, True))
    ramp = Piecewise((0, t < 0.3), (t - 0.3, True))
    pulse = Piecewise((1, (t > 0.3) & (t < 1.1)), (0, True))
    x = solve(np.diag([-2.0, -2.0, -2.0]), np.eye(3), [step, ramp, pulse], [0, 0, 0], s)
    late, after = np.maximum(s - 0.3, 0), np.maximum(s - 1.1, 0)
    rise = (1 - np.exp(-2 * late)) / 2
    assert x[:, 0] == pytest.approx(rise, abs=2e-16)
    assert x[:, 1] == pytest.approx(late / 2 - rise / 2, abs=2e-16)
    assert x[:, 2] == pytest.approx(rise - (1 - np.exp(-2 * after)) / 2, abs=2e-16)


def test_square_wave_keeps_energy_balance_of_each_switch() -> None:
    x = solve(np.array([[0.0]]), [1], [Piecewise((1, sin(2 * pi * t) > 0), (-1, True))], [0], np.linspace(0.25, 20.25, 41))
    assert np.abs(x[:, 0] - 0.25).max() < 1e-13  # 40 switches, each known to the rounding of t = 20: 3.6e-15


# ---------------------------------------------------------------- against exponentials with 50 digits

OMEGA = 1e5
HARD = {  # matrix, start, step, steps, error allowed relative to the peak of each state
    "nominal sizes 1e-6 and 1e3, entries 1e12": (
        np.array([[0, 1, 0], [-1e12, -10, 3e2], [0, 1e-4, -1]]), [1e-6, 0, 1e3], 1e-6, 100, 1e-13),
    "lightly damped, 1e5 radians in 1e4 steps": (np.array([[0, 1], [-(OMEGA**2), -0.2]]), [1, 0], 1e-4, 10_000, 2e-11),
    "the same in small steps, 100 radians": (np.array([[0, 1], [-(OMEGA**2), -0.2]]), [1, 0], 1e-7, 10_000, 2e-14),
    "stiff, -1e9, coupled with 1e5 rad/s": (
        np.array([[0, 1, 0], [-(OMEGA**2), -0.2, 1e3], [1e6, 1e3, -1e9]]), [1, 0, 1], 1e-4, 1000, 5e-12),
    "overdamped, -1e9 and -1": (np.array([[0, 1], [-1e9, -1e9]]), [1, 0], 1e-3, 1000, 1e-14),
    "unstable": (np.array([[0, 1], [400, 0.1]]), [1, 0], 1e-2, 100, 1e-13),
    "integrators and a slow drift": (np.array([[0, 1, 0], [0, 0, 1], [0, 0, -1e-9]]), [0, 0, 1], 1.0, 1000, 1e-14),
}  # fmt: skip


@pytest.mark.parametrize("name", HARD)
def test_hard_matrices(name: str) -> None:
    A, x0, h, steps, allowed = HARD[name]
    A, x0 = np.asarray(A, float), np.asarray(x0, float)
    times = h * np.arange(steps + 1)
    x = solve(A, np.zeros((len(A), 0)), [], x0, times)
    expected = reference(A, x0, times[-1])
    assert (np.abs(x[-1] - expected) / np.abs(x).max(axis=0)).max() < allowed
    sparse = np.linspace(0.0, times[-1], 4)
    again = solve(A, np.zeros((len(A), 0)), [], x0, sparse)
    assert (np.abs(again[-1] - expected) / np.abs(x).max(axis=0)).max() < allowed


def test_forced_chain_to_the_last_digits() -> None:
    A, B = chain(4)
    dense, w = A.toarray(), 100 * math.pi
    x = solve(dense, B, [100 * sin(2 * pi * 50 * t)], np.zeros(7), np.linspace(0, 0.5, 101))
    G = np.zeros((9, 9))
    G[:7, :7], G[:7, 8], G[7:, 7:] = dense, 100 * B[:, 0], [[0, -w], [w, 0]]
    expected = reference(G, np.array([0, 0, 0, 0, 0, 0, 0, 1.0, 0]), 0.5)[:7]
    assert (np.abs(x[-1] - expected) / np.abs(x).max(axis=0)).max() < 1e-13


# ---------------------------------------------------------------- against integrators with step-size control

entries = st.floats(-1, 1).map(lambda v: round(v, 3))


@given(st.data())
@settings(max_examples=15)
def test_random_scenes(data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 4))
    A = np.array(data.draw(st.lists(entries, min_size=n * n, max_size=n * n))).reshape(n, n) * 8
    B = np.array(data.draw(st.lists(entries, min_size=2 * n, max_size=2 * n))).reshape(n, 2)
    x0 = np.array(data.draw(st.lists(entries, min_size=n, max_size=n)))
    a, b, at = (data.draw(entries) for _ in range(3))
    u = [a * t * exp(b * t) * sin((5 + a) * t), Piecewise((b, t < 1 + at / 2), (a * t - cos(3 * t), True))]
    assume(abs(at) < 0.99)
    assume(np.linalg.eigvals(A).real.max() < 5)
    times = np.array([0.2, 0.4, 1 + at / 2, 2.0])
    x = solve(A, B, u, x0, times)
    f = sympy.lambdify(t, u[0], "math")
    y, ends = x0, [0.0, 1 + at / 2, 2.0]
    pieces = [lambda s: b, lambda s: a * s - math.cos(3 * s)]
    for start, end, g in zip(ends, ends[1:], pieces, strict=False):
        run = solve_ivp(lambda s, z, g=g: A @ z + B @ [f(s), g(s)], (start, end), y, "DOP853", rtol=1e-12, atol=1e-14)
        y = run.y[:, -1]
        assert np.abs(x[times == end][0] - y).max() < 1e-10 * max(1.0, np.abs(y).max())


def test_stiff_scene_against_forty_digits() -> None:
    """With its input as two more states, sin 3 t and cos 3 t."""
    A = np.array([[-1e6, 1e6, 0], [1.0, -3, 2], [0, -2, -0.1]])
    x = solve(A, [0, 0, 1], [sin(3 * t)], [1, 0, 0], [0.5, 2.0])
    whole = np.zeros((5, 5))
    whole[:3, :3], whole[2, 3], whole[3, 4], whole[4, 3] = A, 1.0, 3.0, -3.0
    with mpmath.workdps(40):
        expected = [mpmath.expm(mpmath.matrix(whole.tolist()) * end) * mpmath.matrix([1, 0, 0, 0, 1]) for end in (0.5, 2.0)]
    assert x == pytest.approx(np.array([[float(a) for a in row[:3]] for row in expected]), rel=1e-11)


# ---------------------------------------------------------------- output grids


@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=12).map(sorted), st.integers(2, 300))
@settings(max_examples=20)
def test_a_solution_does_not_depend_on_the_grid(some: list[float], samples: int) -> None:
    A = np.array([[0, 1.0, 0], [-900, -0.5, 2], [0, 3, -50]])
    u = [Piecewise((sin(20 * t), t < 0.77), (t, t < 1.5), (3, True))]
    grid = np.unique(np.concatenate([np.linspace(0, 2, samples), some]))
    x = solve(A, [0, 1, 1], u, [0.1, 0, 0], grid)
    alone = np.array([solve(A, [0, 1, 1], u, [0.1, 0, 0], [time])[0] if time else x[0] for time in some])
    assert np.abs(x[np.searchsorted(grid, some)] - alone).max() < 1e-13


def test_rows_at_the_start_repeated_and_on_breakpoints() -> None:
    u = [Piecewise((0, t < 1), (1, True))]
    x = solve(np.zeros((1, 1)), [1], u, [5.0], [0.0, 0.0, 1.0, 1.0, 1.5, 2.0, 2.0])
    assert x[:, 0].tolist() == [5, 5, 5, 5, 5.5, 6, 6]
    x = solve(np.zeros((1, 1)), [1], u, [5.0], [10.0], t0=-2.0)
    assert x[:, 0].tolist() == [14.0]
    forcing = recognise(u, 0.0, 2.0)
    assert integrate(np.zeros((1, 1)), np.ones((1, 1)), forcing, [5.0], []).shape == (0, 1)
    assert integrate(np.zeros((1, 1)), np.ones((1, 1)), forcing, [5.0], [0.0]).tolist() == [[5.0]]


def test_equal_steps_share_one_exponential() -> None:
    for grid in (np.linspace(0.1, 7.3, 5001), np.arange(0.0, 1.0, 1e-3) + 12.7, np.round(np.linspace(0, 1, 1001), 3)):
        cuts = stretches(grid, float(grid[0]), np.empty(0))
        assert [cut.count for cut in cuts] == [len(grid) - 1]
        reached = grid[0] + cuts[0].h * np.arange(1, len(grid))
        assert np.abs(reached - grid[1:]).max() < 1e-14
    onto = stretches(np.array([0.5, 1.0, 1.5]), 0.0, np.array([1.0]))
    assert [(c.piece, c.count) for c in onto] == [(0, 2), (1, 1)]
    assert [c.count for c in stretches(np.array([1.0, 2, 3, 3.5, 4, 4.5]), 0.0, np.array([2.25]))] == [2, 1, 1, 3]


@pytest.mark.parametrize("algorithm", ["dense", "action"])
def test_intervals_with_different_inputs_and_repeated_times(algorithm: str) -> None:
    u = [Piecewise((sin(3 * t), t < 1), (t**2, True))]
    x = solve(np.zeros((1, 1)), [1], u, [0], [0, 0.5, 1, 1, 1.5, 2, 2], algorithm=algorithm)
    first, second = [(1 - math.cos(3 * s)) / 3 for s in (0.5, 1)]
    late = [second + (s**3 - 1) / 3 for s in (1.5, 2)]
    assert x[:, 0] == pytest.approx([0, first, second, second, *late, late[1]], rel=1e-12, abs=1e-14)


def test_steps_that_grow_slowly_are_not_equal() -> None:
    w, steps = 300.0, 1e-3 * (1.0 + 2e-10 * np.arange(2000))  # each grows by less than the times' rounding
    times = 1000.0 + np.concatenate([[0.0], np.cumsum(steps)])
    x = solve(np.array([[0, w], [-w, 0]]), np.zeros((2, 0)), [], [1, 0], times, t0=1000.0)
    assert np.abs(x[:, 0] - np.cos(w * (times - 1000.0))).max() < 1e-9


# ---------------------------------------------------------------- the action of the exponential


def agree(A: Any, B: Any, u: list[Any], x0: Any, times: Any, allowed: float, **options: Any) -> None:
    sparse = solve(scipy.sparse.csr_array(A), B, u, x0, times, algorithm="action", **options)
    dense = solve(A.toarray() if scipy.sparse.issparse(A) else A, B, u, x0, times, algorithm="dense")
    error = np.abs(sparse - dense).max(axis=0) / np.abs(dense).max(axis=0)
    assert error.max() < allowed


@pytest.mark.parametrize(("rtol", "allowed"), [(1e-6, 1e-6), (1e-12, 2e-12)])
def test_action_on_a_chain(rtol: float, allowed: float) -> None:
    A, B = chain(40)
    agree(A, B, [100 * sin(2 * pi * 50 * t)], np.zeros(79), np.linspace(0, 0.2, 41), allowed, rtol=rtol)


def test_action_on_steps_of_all_lengths() -> None:
    A, B = chain(15)
    u = [Piecewise((1, t < 0.013), (t, t < 0.02), (sin(900 * t), True))]
    agree(A, B, u, np.linspace(0, 1, 29), [0.0, 1e-7, 0.01, 0.014, 0.0141, 0.0142, 0.0143, 0.1], 1e-11)


def test_action_with_absolute_angles_and_gravity() -> None:
    A, _ = chain(20)
    angles = scipy.sparse.eye_array(20, 39)
    A = scipy.sparse.block_array([[A, None], [angles, scipy.sparse.csr_array((20, 20))]], format="csr")
    B = np.concatenate([np.full(20, -9.81), np.zeros(39)])
    agree(A, B, [1 + 0 * t], np.zeros(59), np.linspace(0, 0.1, 11), 1e-11)


def test_action_on_a_diffusive_matrix() -> None:
    n = 60
    A = 1e4 * scipy.sparse.diags_array([np.ones(n - 1), -2 * np.ones(n), np.ones(n - 1)], offsets=[-1, 0, 1])
    agree(A, np.eye(n)[0], [sin(30 * t)], np.zeros(n), np.linspace(0, 0.5, 6), 1e-10)


@pytest.mark.parametrize("seed", range(6))
def test_action_on_matrices_without_symmetry(seed: int) -> None:
    random = np.random.default_rng(seed)
    n = 50
    A = scipy.sparse.random_array((n, n), density=0.06, rng=random, data_sampler=random.standard_normal).toarray() * 40
    A -= np.diag(random.uniform(0, 60, n))
    A = A * np.exp(random.uniform(-3, 3, (n, 1))) / np.exp(random.uniform(-3, 3, (1, n)))
    x0, times = random.standard_normal(n), np.linspace(0, 0.1, 8)
    forced = [cos(40 * t), t]
    B = random.standard_normal((n, 2))
    sparse = solve(scipy.sparse.csr_array(A), B, forced, x0, times, algorithm="action")
    dense = solve(A, B, forced, x0, times, algorithm="dense")
    assert (np.abs(sparse - dense).max(axis=0) / np.abs(dense).max(axis=0)).max() < 1e-9


def test_action_of_nothing_and_of_integrators() -> None:
    agree(np.zeros((3, 3)), [1, 2, 3], [1 + t], np.ones(3), [0.0, 1.0, 2.5], 1e-13)
    agree(np.diag(np.ones(4), 1), np.zeros((5, 0)), [], np.ones(5), np.linspace(0, 3, 7), 1e-12)


def test_dense_scenes_fall_into_parts() -> None:
    A, B = chain(15)
    whole = scipy.sparse.block_diag([A, 2 * A, 3 * A], format="csr")
    mixed = np.random.default_rng(0).permutation(87)
    inputs = scipy.linalg.block_diag(B, B, B)
    u = [sin(300 * t), cos(200 * t), 1 + 0 * t]
    run = recognise(u, 0.0, 0.1)
    times = np.linspace(0, 0.1, 5)
    x = integrate(whole[mixed][:, mixed], inputs[mixed], run, np.zeros(87), times, algorithm="dense")
    for k in range(3):
        alone = solve((k + 1) * A.toarray(), B, [u[k]], np.zeros(29), times)
        assert np.abs(x[:, np.argsort(mixed)[29 * k : 29 * k + 29]] - alone).max() < 1e-12 * np.abs(alone).max()


def test_the_faster_algorithm_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """If it has room for its matrices."""
    times = np.linspace(0, 0.5, 101)
    forcing = recognise([sin(300 * t)], 0.0, 0.5)
    assert isinstance(forcing, Forcing)
    assert [prepare(*chain(N), forcing, times).algorithm for N in (10, 30, 150)] == ["dense", "dense", "action"]
    stiff = chain(150, d=5e4)
    for limit, algorithm in ((4000, "dense"), (299, "dense"), (298, "action")):
        monkeypatch.setattr("gearlib.solvers.exponential.exact.DENSE_LIMIT", limit)
        assert prepare(*stiff, forcing, times).algorithm == algorithm


# ---------------------------------------------------------------- refusals


def test_refusals(monkeypatch: pytest.MonkeyPatch) -> None:
    forcing = recognise([t], 0.0, 1.0)
    assert isinstance(forcing, Forcing)
    A, B = -np.eye(2), np.ones((2, 1))
    with pytest.raises(
        ArgumentError, match=r"A is \(2, 2\) and B is \(2, 2\): with 1 inputs they must be \(n, n\) and \(n, 1\)"
    ):
        integrate(A, np.eye(2), forcing, [0, 0], [1.0])
    with pytest.raises(ArgumentError, match="of the linear scene are not finite"):
        integrate(A * math.nan, B, forcing, [0, 0], [1.0])
    with pytest.raises(ArgumentError, match=r"start values of shape \(3,\) for 2 states"):
        integrate(A, B, forcing, [0, 0, 0], [1.0])
    with pytest.raises(ArgumentError, match="in increasing order"):
        integrate(A, B, forcing, [0, 0], [1.0, 0.5])
    with pytest.raises(ArgumentError, match="inputs are known from 0 to 1 s"):
        integrate(A, B, forcing, [0, 0], [1.5])
    with pytest.raises(ArgumentError, match="choose one of auto, dense, action"):
        integrate(A, B, forcing, [0, 0], [1.0], algorithm="fast")
    with pytest.raises(SolverError, match=r"leaves the range of floating-point numbers before t = 1 s"):
        integrate(1e4 * np.eye(2), B, forcing, [1, 1], [0.0, 0.01, 1.0])
    with pytest.raises(ArgumentError, match="in increasing order"):
        integrate(A, B, forcing, [0, 0], [[0.0, 1.0]])
    for limit in (1, 2):
        monkeypatch.setattr("gearlib.solvers.exponential.exact.DENSE_LIMIT", limit)
        if limit == 1:
            with pytest.raises(SolverError, match=r"^2 states: a dense exponential of more than 1 takes too much memory$"):
                integrate(A, B, forcing, [0, 0], [1.0], algorithm="dense")
        else:
            assert integrate(A, B, forcing, [0, 0], [1.0], algorithm="dense")[-1] == pytest.approx(math.exp(-1.0), rel=1e-12)


def test_too_large_and_too_stiff() -> None:
    forcing = recognise([t], 0.0, 100.0)
    assert isinstance(forcing, Forcing)
    A, B = chain(4000, c=1e9, d=1e6)
    with pytest.raises(SolverError, match=r"7999 states.*Use method='ida' or method='rk'"):
        prepare(A, B, forcing, np.linspace(0, 100, 101))


# ---------------------------------------------------------------- as a stepper


def linear_problem(A: Any, B: Any, inputs: tuple[Any, ...], x0: list[float], times: np.ndarray) -> Problem:
    none, whole = np.empty(0), np.empty(0, np.int64)
    return Problem(
        rhs=NoCode(), x0=np.array(x0), data=none, index=whole, differential=np.ones(len(x0), bool), nominal=np.ones(len(x0)),
        linear=LinearForm(np.array(A, float), np.array(B, float), inputs), times=times,
    )  # fmt: skip


def test_driver_with_the_exponential_stepper() -> None:
    times = np.linspace(1.0, 3.0, 21)
    ramp = Table([0.0, 2.0, 4.0], [0.0, 2.0, 2.0])  # a table, a constant and a sine, each of them on its own integrator
    problem = linear_problem(np.zeros((3, 3)), np.eye(3), (ramp, sympy.Float(2), sin(t)), [1.0, 2.0, 3.0], times)
    driver = Driver(problem, Exponential(problem))
    found = drive(driver)
    area = np.where(times < 2.0, 0.5 * (times**2 - 1.0), 1.5 + 2.0 * (times - 2.0))
    expected = np.column_stack([1.0 + area, 2.0 + 2.0 * (times - 1.0), 3.0 + math.cos(1.0) - np.cos(times)])
    assert found.x == pytest.approx(expected, rel=1e-14)
    assert found.discrete.shape == (21, 0)
    assert (found.status, found.t_last, found.stats["events"], found.stats["steps"]) == ("done", 3.0, 0, 0)
    assert (found.x_last.tolist(), driver.t, found.event_times.tolist()) == (found.x[-1].tolist(), 3.0, [])


def test_a_stepper_serves_for_other_start_values() -> None:
    times = np.array([0.0, math.log(2.0)])
    first = linear_problem([[-1.0]], np.zeros((1, 0)), (), [8.0], times)
    stepper = Exponential(first)
    other = linear_problem([[-1.0]], np.zeros((1, 0)), (), [2.0], times)
    assert drive(Driver(first, stepper)).x[:, 0] == pytest.approx([8.0, 4.0], rel=1e-15)
    assert drive(Driver(other, stepper)).x[:, 0] == pytest.approx([2.0, 1.0], rel=1e-15)


def test_inputs_that_are_not_in_closed_form_are_named() -> None:
    problem = linear_problem([[-1.0]], [[1.0]], (sympy.tan(t),), [1.0], np.array([0.0, 1.0]))
    assert "tan" in Exponential(problem).why_not


@pytest.mark.parametrize("algorithm", ["dense", "action"])
@pytest.mark.parametrize(("N", "directions"), [(3, 1), (30, 2)])
def test_derivatives_are_those_of_the_block_triangular_system(algorithm: str, N: int, directions: int) -> None:
    """The tangents of random directions, with inputs of their own, beside the exponential of the whole."""
    A, B = chain(N, c=300.0, d=0.05)
    n, rng = A.shape[0], np.random.default_rng(N)
    share = scipy.sparse.csr_array(A)
    changes = [
        scipy.sparse.csr_array((share.data * rng.normal(size=share.nnz), share.indices, share.indptr))
        for _ in range(directions)
    ]
    inputs = [3.0 * sin(7 * t + 1), t * exp(-t), Piecewise((2, t < 0.4), (t, True))]
    B, driven = rng.normal(size=(n, 3)), rng.normal(size=(directions, n, 3))
    x0, times = rng.normal(size=(1 + directions, n)), np.linspace(0.0, 1.0, 6)
    whole = np.kron(np.eye(1 + directions), A.toarray())
    for k, change in enumerate(changes, 1):
        whole[k * n : (k + 1) * n, :n] = change.toarray()
    right = solve(whole, np.concatenate([B, *driven]), inputs, x0.ravel(), times, algorithm="dense").reshape(
        6, 1 + directions, n
    )
    forcing = recognise(inputs, 0.0, 1.0)
    assert isinstance(forcing, Forcing)
    given = LinearChanges(tuple(changes), driven)
    found = integrate(share, B, forcing, x0, times, algorithm=algorithm, changes=given)
    scale = np.abs(right).max(axis=(0, 2))[None, :, None]
    assert (np.abs(found - right) < 1e-10 * scale).all()
    one = scipy.linalg.expm(whole * 0.2) @ np.append(x0[0], np.zeros(n * directions))
    alone = integrate(share, B * 0.0, forcing, np.stack([x0[0], *np.zeros((directions, n))]), times,
                      algorithm=algorithm, changes=LinearChanges(tuple(changes), driven * 0.0))  # fmt: skip
    assert np.allclose(alone[1].ravel(), one, rtol=1e-9, atol=1e-10 * np.abs(one).max())
