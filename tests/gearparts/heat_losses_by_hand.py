"""Modelica's HeatLosses, integrated with SciPy mode by mode: a reference that shares nothing with gearlib.

There is no state machine here: at each event the modes are found by trying them, as in `friction_by_hand`. The train is a chain, so
that the torques behind the lossy gear follow from each other. While everything behind the spring is at rest, gear and brake share
the torque in no unique way; it stays at rest as long as any split is within the limits of both.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

Floats = np.ndarray
J = 2.0
C, D, GAP, LIMIT = 1e5, 100.0, 0.0005, 1.0  # coupling with backlash; bearing
AT_REST = 1e-8  # rad/s
SLACK = 1e-7  # N.m or rad/s2: what an event leaves of a margin that has come to zero
# state: angles and speeds of bodies 1 .. 6, and the heat that has left
Modes = tuple[int, int, int, int, int, int]  # bearing, gear, its driving side (1: a), clutch, freewheel, brake; 0: stuck


def pressed(t: float) -> float:
    return math.sin(0.4 * math.pi * t)


def coupling(x: float, v: float, side: int) -> tuple[float, float]:
    """Torque and damping part of the coupling; side: 0 gap, 1 or -1 contact with full damping, 2 or -2 with limited damping."""
    if side == 0:
        return 0.0, 0.0
    sense = 1 if side > 0 else -1
    spring = C * (x - sense * GAP)
    damping = spring if abs(side) == 2 else D * v
    return spring + damping, damping


def side_of(x: float, v: float) -> int:
    """Which branch of the coupling holds."""
    if abs(x) <= GAP:
        return 0
    sense = 1 if x > 0 else -1
    spring, damping = C * (abs(x) - GAP), sense * D * v
    if spring + damping <= 0:
        return 0
    return sense * (2 if damping > spring else 1)


def gear(sense: int, side: int, speed: float) -> tuple[float, float]:
    """(p, r) of the loss L = p T + r where the gear turns in a sense, with T of the sign ``side``."""
    eta, B = 0.8 - 0.1 * speed, 1.0 + speed
    return ((1 - eta) if side == sense else (1 - 1 / eta)), sense * B


def behind(t: float, y: Floats, S: float, modes: Modes) -> Floats:
    """a4, a5, a6, T, L, clutch, freewheel and brake torque, from the torque S of the spring before body 4."""
    _, g, side, c, o, b = modes
    f = pressed(t)
    A, rhs = np.zeros((8, 8)), np.zeros(8)
    a4, a5, a6, T, L, K, F, B = range(8)
    A[0, [a4, T]], rhs[0] = (J, 1.0), S
    A[1, [K, T, L]] = 1.0, -2.0, 2.0
    A[2, [a5, K, F]] = J, -1.0, 1.0
    A[3, [a6, F, B]] = J, -1.0, 1.0
    if g == 0:
        A[4, a4] = 1.0
    else:
        p, r = gear(g, side, abs(y[9]))
        A[4, [L, T]], rhs[4] = (1.0, -p), r
    if c == 0:
        A[5, [a5, a4]] = 1.0, -0.5
    else:  # slides with v = w5 - w4 / 2 of this sense
        A[5, K], rhs[5] = 1.0, -c * 5 * f
    if o == 0:
        A[6, [a6, a5]] = 1.0, -1.0
    else:
        A[6, F], rhs[6] = 1.0, -0.5 * f
    if b == 0:
        A[7, a6] = 1.0
    else:
        A[7, B], rhs[7] = 1.0, b * f
    return np.linalg.solve(A, rhs)


def held(t: float, S: float) -> float:
    """How far all of gear, clutch, freewheel and brake are from giving way to S, at rest; positive where some split holds."""
    f = pressed(t)
    # L lies between its limits; K = 2 (T - L) = F = B
    upper = 2 * (S - min((1 - 1 / 0.8) * S - 1, 0.2 * S - 1))
    lower = 2 * (S - max(0.2 * S + 1, (1 - 1 / 0.8) * S + 1))
    reach = min(f, 5 * f)
    return min(upper + min(reach, 0.5 * f * (1 + 1e-4)), reach - lower)


def at_rest_behind(y: Floats) -> bool:
    return bool((np.abs(y[9:12]) <= AT_REST).all())


def torques(t: float, y: Floats, side: int) -> tuple[float, float, float, float, float]:
    """Damper, spring-damper, coupling, its damping part, and spring before body 4."""
    phi, w = y[:6], y[6:12]
    back, damping = coupling(phi[2] - phi[1], w[2] - w[1], side)
    return 10 * w[0], 1e4 * (phi[1] - phi[0]) + 20 * (w[1] - w[0]), back, damping, 1e4 * (phi[2] - phi[3])


def rates(t: float, y: Floats, side: int, modes: Modes | None, bearing: int) -> tuple[Floats, Floats, float, float]:
    """Accelerations, unknowns of `behind` (zeros where all is held), the bearing's torque, and the heat."""
    w = y[6:12]
    brake, shaft, back, damping, S = torques(t, y, side)
    a = np.zeros(6)
    a[0] = (20 * math.sin(10 * math.pi * t) - brake + shaft) / J
    a[1] = (back - shaft) / J
    net = -back - S
    friction = net if bearing == 0 else bearing * LIMIT
    a[2] = (net - friction) / J
    z = np.zeros(8) if modes is None else behind(t, y, S, modes)
    a[3:] = z[:3]
    heat = brake * w[0] + 20 * (w[1] - w[0]) ** 2 + damping * (w[2] - w[1]) + friction * w[2]
    heat += z[4] * w[3] - z[5] * (w[4] - w[3] / 2) - z[6] * (w[5] - w[4]) + z[7] * w[5]
    return a, z, friction, heat


def speeds(y: Floats) -> tuple[float, float, float, float]:
    """Of gear, clutch, freewheel and brake."""
    return y[9], y[10] - y[9] / 2, y[11] - y[10], y[11]


def margins(t: float, y: Floats, modes: Modes, z: Floats) -> list[float]:
    """Positive as long as the modes last."""
    f = pressed(t)
    _, g, side, c, o, b = modes
    v = speeds(y)
    T, L, K, F, B = z[3:]
    if g == 0:
        p_up, r_up = (0.2, 1.0) if T > 0 else (1 - 1 / 0.8, 1.0)
        p_down, r_down = (1 - 1 / 0.8, -1.0) if T > 0 else (0.2, -1.0)
        gear_margin = min(p_up * T + r_up - L, L - (p_down * T + r_down))
        drive = 1.0
    else:
        gear_margin, drive = g * v[0], side * T
    return [
        gear_margin,
        drive,
        5 * f - abs(K) if c == 0 else c * v[1],
        F + 0.5 * f * (1 + 1e-4) if o == 0 else v[2],
        f - abs(B) if b == 0 else b * v[3],
    ]


def candidates(y: Floats, broken: Sequence[int]) -> Iterator[tuple[int, int, int, int, int]]:
    """Modes of gear (with both driving sides), clutch, freewheel and brake, those with the most stuck first."""
    v = speeds(y)
    choices = []
    for i, speed in enumerate(v):
        if abs(speed) > AT_REST:
            choices.append([int(np.sign(speed))])
        else:
            slides = [1] if i == 2 else [1, -1]
            choices.append(slides if i in broken else [0, *slides])
    for g, c, o, b in sorted(itertools.product(*choices), key=lambda m: sum(x != 0 for x in m)):
        for side in (1, -1) if g else (1,):
            yield g, side, c, o, b


def next_modes(t: float, y: Floats, side: int, bearing: int, broken: Sequence[int]) -> Modes | None:
    """The modes just after an event; None where all behind the spring is held."""
    after = t + 1e-10
    S = torques(after, y, side)[4]
    if at_rest_behind(y) and 9 not in broken and held(after, S) > 0:
        return None
    for chosen in candidates(y, broken):
        g, drive, c, o, b = chosen
        if (g, c, o, b) == (0, 0, 0, 0):
            continue
        modes = (bearing, g, drive, c, o, b)
        try:
            z = behind(after, y, S, modes)
        except np.linalg.LinAlgError:
            continue
        accelerations = (z[0], z[1] - z[0] / 2, z[2] - z[1], z[2])
        good = True
        for i, (mode, speed, a) in enumerate(zip((g, c, o, b), speeds(y), accelerations, strict=True)):
            if mode and abs(speed) <= AT_REST:
                good &= mode * a >= -SLACK
            elif not mode:
                good &= margins(after, y, modes, z)[(0, 2, 3, 4)[i]] >= -SLACK
        if good and (g == 0 or drive * z[3] >= -SLACK):
            return modes
    raise AssertionError(f"no modes fit at t = {t}")


def next_bearing(t: float, y: Floats, side: int, broken: bool) -> int:
    if abs(y[8]) > AT_REST:
        return int(np.sign(y[8]))
    _, _, back, _, S = torques(t + 1e-9, y, side)
    return 0 if abs(back + S) <= LIMIT and not broken else int(np.sign(-back - S))


def settle(y: Floats, zero: Sequence[int]) -> None:
    """Make exactly zero the relative speeds that have reached it: 0 gear, 1 clutch, 2 freewheel, 3 brake, 4 bearing."""
    for i in zero:
        if i == 4:
            y[8] = 0.0
        elif i == 0:
            y[9] = 0.0
        elif i == 1:
            y[10] = y[9] / 2
        elif i == 2:
            y[11] = y[10]
        else:
            y[11] = 0.0


def integrate(times: Floats) -> tuple[Floats, Floats]:
    """State at the times, shape (13, times), and modes (bearing, gear, clutch, freewheel, brake), shape (5, times)."""
    out, seen = np.zeros((13, len(times))), np.zeros((5, len(times)))
    t, y, end = float(times[0]), np.zeros(13), float(times[-1])
    broken: list[int] = []
    while t < end:
        x, v = y[2] - y[1], y[8] - y[7]
        side = side_of(x + 1e-9 * v, v)
        bearing = next_bearing(t, y, side, 4 in broken)
        modes = next_modes(t, y, side, bearing, broken)
        y, t_new, broken, dense = _stretch(t, y, end, side, bearing, modes)
        inside = (times >= t) & (times <= t_new)
        if inside.any():
            out[:, inside] = dense(times[inside])
        row = (bearing, 0, 0, 0, 0) if modes is None else (bearing, modes[1], *modes[3:])
        seen[:, inside] = np.array(row)[:, None]
        t = t_new
    return out, seen


def _stretch(t: float, y: Floats, end: float, side: int, bearing: int, modes: Modes | None) -> tuple[Any, ...]:
    def rate(at: float, s: Floats) -> Floats:
        a, _, _, heat = rates(at, s, side, modes, bearing)
        return np.concatenate([s[6:12], a, [heat]])

    def watched(at: float, s: Floats) -> list[float]:
        _, z, friction, _ = rates(at, s, side, modes, bearing)
        x, v = s[2] - s[1], s[8] - s[7]
        found = [LIMIT - abs(friction) if bearing == 0 else bearing * s[8]]
        if side == 0:  # in the gap, or beyond it with a damping that would pull
            sense = 1 if x > 0 else -1
            apart = abs(x) > GAP
            found.append(GAP - abs(x) if not apart else -(C * (abs(x) - GAP) + sense * D * v))
        else:
            sense = 1 if side > 0 else -1
            spring, damping = C * (sense * x - GAP), sense * D * v
            found += [spring, spring + damping, (damping - spring) * (1 if abs(side) == 2 else -1)]
        if modes is None:
            return [*found, held(at, torques(at, s, side)[4])]
        return [*found, *margins(at, s, modes, z)]

    start = watched(t, y)
    events: list[Any] = []
    for i in range(len(start)):

        def margin(at: float, s: Floats, i: int = i) -> float:
            return watched(at, s)[i] + (1e-5 if at - t < 1e-8 else 0.0)  # what begins at zero is lifted for the first moment

        margin.terminal, margin.direction = True, -1  # type: ignore[attr-defined]
        events.append(margin)
    solution = solve_ivp(rate, (t, end), y, "DOP853", dense_output=True, events=events, rtol=1e-12, atol=1e-15, max_step=2e-3)
    y, broken = solution.y[:, -1].copy(), []
    offset = len(start) - (1 if modes is None else 5)
    for i, found in enumerate(solution.t_events):
        if not len(found):
            continue
        if i == 0:
            if bearing == 0:
                broken.append(4)
            else:
                settle(y, [4])
        elif i >= offset and modes is None:
            broken.append(9)
        elif i >= offset:
            which = (0, -1, 1, 2, 3)[i - offset]
            if which >= 0:
                if (modes[1], modes[3], modes[4], modes[5])[which] == 0:
                    broken.append(which)
                else:
                    settle(y, [which])
    return y, float(solution.t[-1]), broken, solution.sol
