"""The list of benchmark scenes, each with a reference at a far tighter tolerance than anything it judges.

Linear scenes: matrix exponential of the equations by hand, extended by the system that generates the excitation. The others:
heyoka's Taylor method at 1e-16, with located events; scipy's DOP853 at 3e-14 where heyoka is not installed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gearlib as gl
import gearparts as gp
from gearlib.solvers.problem import Floats
from tests.benchmarks import modelica
from tests.benchmarks.equations import (
    BacklashPair,
    ByHand,
    RigidLoop,
    chain_by_hand,
    loop_by_hand,
    pair_by_hand,
    shown,
    xp_by_hand,
)
from tests.benchmarks.scenes import Chain


@dataclass(frozen=True)
class BenchScene:
    """A scene, its equations by hand and its reference."""

    name: str
    title: str
    component: Callable[[], gl.Component]
    outputs: tuple[str, ...]
    groups: tuple[int, ...]  # outputs with the same number share a scale: the largest value of any of them
    times: Floats
    by_hand: Callable[[], ByHand]
    reference: Callable[[], Floats]  # (samples, outputs)
    linear: bool
    modelica: Callable[[], str]

    def error(self, values: Floats) -> float:
        """Largest error of all outputs over the largest value of their group; infinite where a value is not finite."""
        reference, groups = self.reference(), np.array(self.groups)
        largest = np.abs(reference).max(axis=0)
        scale = np.array([largest[groups == g].max() for g in groups])
        found = float((np.abs(values - reference) / scale).max())
        return found if math.isfinite(found) else math.inf


def state_matrix(hand: ByHand) -> tuple[Floats, Floats, Floats]:
    """A, and the excitation's constant part and that at t = 0, of linear equations by hand."""
    n = hand.x0.size
    zero, column, A = np.zeros(n), np.zeros(n), np.zeros((n, n))
    hand.rhs(0.0, zero, column, hand.data, hand.index)
    at_zero = column.copy()
    for j in range(n):
        unit = zero.copy()
        unit[j] = 1.0
        hand.rhs(0.0, unit, column, hand.data, hand.index)
        A[:, j] = column - at_zero
    return A, zero, at_zero


def linear_reference(hand: ByHand, times: Floats, omega: float, phase: float) -> Floats:
    """Outputs by the exponential of x' = A x + b + r cos(omega t + phase), balanced by the nominal values."""
    n = hand.x0.size
    A, _, _ = state_matrix(hand)
    b, r = _excitation(hand, omega, phase)
    scale = hand.nominal
    M = np.zeros((n + 3, n + 3))
    M[:n, :n] = A * scale / scale[:, None]
    M[:n, n], M[:n, n + 1] = b / scale, r / scale
    M[n + 1, n + 2], M[n + 2, n + 1] = -omega, omega  # cos and sin
    step = expm(M * (times[1] - times[0]))
    states = np.zeros((times.size, n + 3))
    states[0, n:] = 1.0, math.cos(phase), math.sin(phase)
    states[0, :n] = hand.x0 / scale
    for i in range(1, times.size):
        states[i] = step @ states[i - 1]
        turn = omega * times[i] + phase
        states[i, n:] = 1.0, math.cos(turn), math.sin(turn)
    return np.asarray((states[:, :n] * scale) @ hand.outputs.T)


def _excitation(hand: ByHand, omega: float, phase: float) -> tuple[Floats, Floats]:
    """b and r, from the right-hand side at rest at two times."""
    n = hand.x0.size
    first, second = np.zeros(n), np.zeros(n)
    hand.rhs((math.pi / 2 - phase) / omega, np.zeros(n), first, hand.data, hand.index)  # cos = 0
    hand.rhs(-phase / omega, np.zeros(n), second, hand.data, hand.index)  # cos = 1
    return first, second - first


def smooth_reference(hand: ByHand, times: Floats) -> Floats:
    """Outputs of a smooth nonlinear scene."""
    try:
        import heyoka as hy
    except ImportError:

        def f(t: float, x: Floats) -> Floats:
            dx = np.empty_like(x)
            hand.rhs(t, x, dx, hand.data, hand.index)
            return dx

        found = solve_ivp(f, times[[0, -1]], hand.x0, "DOP853", times, rtol=3e-14, atol=1e-16)
        return np.asarray(found.y.T @ hand.outputs.T)
    names = hy.make_vars(*(f"x_{i}" for i in range(hand.x0.size)))
    derivatives = hand.symbolic(names, hy.time, SimpleNamespace(sin=hy.sin, cos=hy.cos))
    integrator = hy.taylor_adaptive(list(zip(names, derivatives, strict=True)), hand.x0.tolist(), tol=1e-16)
    return np.asarray(integrator.propagate_grid(times)[-1] @ hand.outputs.T)


def flank_event(hy: Any, x: Any, side: float) -> Any:
    """heyoka's terminal event of one flank: par[0] says whether there is contact, par[1] where the flank is."""

    def switch(integrator: Any, direction: int) -> bool:
        integrator.pars[:] = (1.0, side * 50e-6) if direction * side > 0 else (0.0, 0.0)
        return True

    return hy.t_event(x - side * 50e-6, callback=switch, cooldown=1e-9)


def backlash_reference(times: Floats) -> Floats:
    """Deflection of the backlash pair."""
    try:
        import heyoka as hy
    except ImportError:
        return backlash_by_scipy(times)
    hand = pair_by_hand()
    names = hy.make_vars(*(f"x_{i}" for i in range(4)))
    functions = SimpleNamespace(cos=hy.cos, contact=lambda x, v: hy.par[0] * (2e8 * (x - hy.par[1]) + 2000.0 * v))
    events = [flank_event(hy, names[0], side) for side in (1.0, -1.0)]
    system = list(zip(names, hand.symbolic(names, hy.time, functions), strict=True))
    integrator = hy.taylor_adaptive(system, hand.x0.tolist(), tol=1e-18, t_events=events, pars=[0.0, 0.0])
    integrator.state[0] -= 1e-19  # off the flank that it starts to leave
    return np.asarray(integrator.propagate_grid(times)[-1][:, :1])


def backlash_by_scipy(times: Floats) -> Floats:
    """The same, phase by phase with DOP853 at 3e-14 and every change of contact located to rounding."""
    hand = pair_by_hand()
    x, t, out = hand.x0.copy(), float(times[0]), np.empty(times.size)
    flank = 0.0  # the deflection decreases at the start
    while t < times[-1]:
        limits = (flank * 50e-6,) if flank else (50e-6, -50e-6)
        events = [_limit(limit, -flank if flank else math.copysign(1.0, limit)) for limit in limits]
        grid = times[(times > t) & (times <= times[-1])]
        found = solve_ivp(
            partial(_phase, flank), (t, times[-1]), x, "DOP853", events=events, dense_output=True, rtol=3e-14,
            atol=[1e-19, 1e-15, 1e-12, 1e-12], max_step=2e-4,
        )  # fmt: skip
        grid = grid[grid <= found.t[-1]]
        if grid.size:
            out[np.searchsorted(times, grid)] = found.sol(grid)[0]
        t, x = float(found.t[-1]), found.y[:, -1].copy()
        if found.status == 1:
            hit = next(k for k, e in enumerate(found.t_events) if e.size)
            x[0] = limits[hit]
            flank = 0.0 if flank else math.copysign(1.0, limits[hit])
    out[0] = hand.x0[0]
    return out[:, None]


def _phase(flank: float, t: float, x: Floats) -> list[float]:
    v = 0.05 * x[2] - 0.1 * x[3] - 2e-4 * math.cos(20.0 * x[1]) * x[2]
    force = 2e8 * (x[0] - flank * 50e-6) + 2000.0 * v if flank else 0.0
    return [v, x[2], (40.0 - 0.002 * (x[2] - 800.0) - 0.05 * force) / 0.001, (0.1 * force - 80.0) / 0.016]


def _limit(limit: float, direction: float) -> Any:
    def distance(t: float, x: Floats) -> float:
        return float(x[0] - limit)

    distance.terminal = True  # type: ignore[attr-defined]
    distance.direction = direction  # type: ignore[attr-defined]
    return distance


CHAIN, LOOP, PAIR, XP = np.linspace(0, 0.5, 101), np.linspace(0, 2, 201), np.linspace(0, 0.2, 2001), np.linspace(0, 0.5, 501)
XP_OUTPUTS = ("w_in", "w_sun", "w_out", "q_ring", "q_sun", "q_pair")


def _chain_scene(n: int) -> BenchScene:
    return BenchScene(
        f"M1-{n}", f"chain of {n} inertias, {2 * n - 1} states", lambda: Chain(N=n),
        tuple(f"body[{i}].w" for i in shown(n)), (0, 0, 0), CHAIN, lambda: chain_by_hand(n),
        cache(lambda: linear_reference(chain_by_hand(n), CHAIN, 100 * math.pi, -math.pi / 2)), True, lambda: modelica.chain(n),
    )  # fmt: skip


def _xp_scene(elastic: bool) -> BenchScene:
    name = "XP-K_s" if elastic else "XP"
    title = "XP train with an elastic shaft, 10 states" if elastic else "XP train of Zhou and Cui, 8 states"
    return BenchScene(
        name, title, lambda: gp.ZhouCui2022(tau_in=100.0, elastic_shafts=elastic), XP_OUTPUTS, tuple(range(6)), XP,
        lambda: xp_by_hand(elastic), cache(lambda: linear_reference(xp_by_hand(elastic), XP, 28.0, 21 * math.pi)), True,
        lambda: modelica.dense(xp_by_hand(elastic)),
    )  # fmt: skip


SCENES: dict[str, BenchScene] = {
    scene.name: scene
    for scene in (
        *(_chain_scene(n) for n in (10, 100, 1000)),
        BenchScene(
            "M2", "rigid closed loop with a fan, 3 states", RigidLoop, ("carrier.w", "load.w"), (0, 1), LOOP, loop_by_hand,
            cache(lambda: smooth_reference(loop_by_hand(), LOOP)), False, modelica.loop,
        ),
        BenchScene(
            "M3", "gear pair with backlash, 4 states", BacklashPair, ("x",), (0,), PAIR, pair_by_hand,
            cache(lambda: backlash_reference(PAIR)), False, modelica.pair,
        ),
        _xp_scene(False),
        _xp_scene(True),
    )
}  # fmt: skip
