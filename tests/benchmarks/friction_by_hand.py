"""Trains with clutches and brakes by hand: SciPy between located events, and between these one law of motion without a switch.

Each element slides in one sense, sticks, or is open. At an event those at rest get the modes that agree with the accelerations that
they cause, found by trying all; what sticks is held by a multiplier.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Floats = NDArray[np.float64]
AT_REST = 1e-9  # rad/s
STUCK = 0


@dataclass(frozen=True)
class Rubbing:
    """An element: its sliding speed is ``row @ v``, its torque of sliding (N.m) ``level(t)``, and 0 where it is open."""

    row: Floats
    level: Callable[[float], float]
    peak: float = 1.0  # break-away over sliding torque


@dataclass
class RubbingTrain:
    """``M v' = force(t, q, v) - sum of row * torque``, ``q' = v``, from q = 0 and ``v``; levels may jump at the corners only."""

    M: Floats
    force: Callable[[float, Floats, Floats], Floats]
    elements: list[Rubbing]
    v: Floats
    corners: tuple[float, ...] = ()
    events: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.n = len(self.v)
        self.inverse = np.linalg.inv(self.M)
        self.rows = np.array([e.row for e in self.elements], float)

    def accelerations(self, t: float, y: Floats, modes: tuple[int | None, ...]) -> tuple[Floats, Floats]:
        """v', and the torques of the elements that stick; a mode is the sense of sliding, 0 for stuck, None for open."""
        force = np.array(self.force(t, y[: self.n], y[self.n :]), float)
        for element, mode in zip(self.elements, modes, strict=True):
            if mode:
                force -= mode * element.level(t) * element.row
        free = self.inverse @ force
        R = self.rows[[m == STUCK for m in modes]]
        torques = np.linalg.solve(R @ self.inverse @ R.T, R @ free) if len(R) else np.zeros(0)
        return free - self.inverse @ R.T @ torques, torques

    def settled(self, t: float, y: Floats, open_: list[bool], breaks: dict[int, int]) -> tuple[int | None, ...]:
        """The modes that agree with the accelerations, the one with most elements stuck first."""
        choices: list[tuple[int | None, ...]] = []
        for k, speed in enumerate(self.rows @ y[self.n :]):
            resting = (breaks[k],) if k in breaks else (STUCK, 1, -1)
            choices.append((None,) if open_[k] else (int(np.sign(speed)),) if abs(speed) > AT_REST else resting)
        for modes in sorted(product(*choices), key=lambda m: -m.count(STUCK)):
            stuck = [k for k, m in enumerate(modes) if m == STUCK]
            if np.linalg.matrix_rank(self.rows[stuck]) < len(stuck):
                continue
            rates, torques = self.accelerations(t, y, modes)
            holds = all(
                abs(tau) <= self.elements[k].peak * self.elements[k].level(t) * (1 + 1e-12)
                for k, tau in zip(stuck, torques, strict=True)
            )
            slides = all(
                modes[k] * (e.row @ rates) >= -1e-6
                for k, e in enumerate(self.elements)
                if modes[k] and abs(e.row @ y[self.n :]) <= AT_REST
            )
            if holds and slides:
                return modes
        raise AssertionError(f"no modes at {t} s")

    def solved(self, times: Floats, rtol: float = 1e-12) -> Floats:
        """v at the times, shape (samples, n)."""
        y, out = np.concatenate([np.zeros(self.n), self.v]), np.empty((len(times), self.n))
        ends = [float(times[0]), *sorted(t for t in self.corners if times[0] < t < times[-1]), float(times[-1])]
        for begin, end in pairwise(ends):
            last = float(np.nextafter(end, begin))  # a level that jumps at the end has not jumped yet
            t, breaks = begin, dict[int, int]()
            open_ = [e.level((begin + end) / 2) <= 0.0 for e in self.elements]
            while t < last:
                modes = self.settled(t, y, open_, breaks)
                found, hit = self._phase(t, last, y, modes, rtol)
                inside = (times >= t) & (times <= (end if hit is None else found.t[-1]))
                if inside.any():
                    out[inside] = found.sol(np.minimum(times[inside], last))[self.n :].T
                t, y = float(found.t[-1]), found.y[:, -1].copy()
                breaks = {}
                if hit is not None:
                    self.events.append(t)
                    if modes[hit] == STUCK:
                        torque = self.accelerations(t, y, modes)[1][[k for k, m in enumerate(modes) if m == STUCK].index(hit)]
                        breaks[hit] = int(np.sign(torque))
                    else:  # exactly at rest
                        row = self.elements[hit].row
                        y[self.n :] -= self.inverse @ row * (row @ y[self.n :]) / (row @ self.inverse @ row)
        return out

    def _phase(self, t: float, end: float, y: Floats, modes: tuple[int | None, ...], rtol: float) -> tuple[Any, int | None]:
        """The motion in one set of modes up to the first element that stops or breaks away, and which one it is."""
        stuck = [k for k, m in enumerate(modes) if m == STUCK]

        def rate(t: float, y: Floats) -> Floats:
            return np.concatenate([y[self.n :], self.accelerations(t, y, modes)[0]])

        def speed(k: int, t: float, y: Floats) -> float:
            return float(self.elements[k].row @ y[self.n :])

        def excess(k: int, t: float, y: Floats) -> float:
            return float(
                abs(self.accelerations(t, y, modes)[1][stuck.index(k)]) - self.elements[k].peak * self.elements[k].level(t)
            )

        watched, events = [k for k, m in enumerate(modes) if m is not None], []
        for k in watched:
            mode = modes[k] or 0
            event: Any = partial(speed if mode else excess, k)
            event.terminal, event.direction = True, -float(mode) if mode else 1.0
            events.append(event)
        found = solve_ivp(
            rate, (t, end), y, "DOP853", events=events, dense_output=True, rtol=rtol, atol=rtol * 1e-1, max_step=5e-3
        )
        assert found.success, found.message
        return found, next((k for k, e in zip(watched, found.t_events or [], strict=True) if len(e)), None)
