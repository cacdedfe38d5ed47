"""Bodies with dry friction between them, integrated with SciPy mode by mode: a reference that shares nothing with gearlib.

There is no state machine here. At an event, the new modes are found by trying them: of the elements whose surfaces are at rest against
each other, some stick and some start to slide, such that those that stick hold with a torque within their limits and those that
slide accelerate in the direction in which they slide.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

Floats = np.ndarray
AT_REST = 1e-9  # rad/s


@dataclass(frozen=True)
class Element:
    """Friction between surfaces whose relative speed is a combination of the bodies' speeds.

    ``level(t, speed)`` is the sliding torque, ``limit(t)`` the torque at which it breaks away (0: free); a freewheel holds any
    torque the other way and never slides backward.
    """

    speed: Floats  # one factor for each body
    level: Callable[[float, float], float]
    limit: Callable[[float], float]
    freewheel: bool = False


@dataclass(frozen=True)
class Bodies:
    """``J der(w) = torque(t) - sum(speed_i tau_i)``."""

    J: Floats
    torque: Callable[[float], Floats]
    elements: Sequence[Element]

    def forces(self, t: float, w: Floats, modes: Sequence[int]) -> tuple[Floats, Floats]:
        """Accelerations of the bodies and torques of the elements; mode 0 sticks, 1 and -1 slide."""
        G = np.array([e.speed for e in self.elements])
        tau = np.array([m * e.level(t, abs(v)) for m, e, v in zip(modes, self.elements, G @ w, strict=True)])
        stuck = np.flatnonzero(np.array(modes) == 0)
        driven = self.torque(t) - G.T @ tau
        if len(stuck):
            matrix = (G[stuck] / self.J) @ G[stuck].T
            tau[stuck] = np.linalg.solve(matrix, G[stuck] @ (driven / self.J))
        return (self.torque(t) - G.T @ tau) / self.J, tau

    def margins(self, t: float, w: Floats, modes: Sequence[int]) -> Floats:
        """Positive as long as the modes last: speed of what slides, distance from the limit of what sticks."""
        _, tau = self.forces(t, w, modes)
        result = []
        for mode, element, torque in zip(modes, self.elements, tau, strict=True):
            if mode:
                result.append(mode * float(element.speed @ w))
            else:
                result.append(element.limit(t) - (torque if element.freewheel else abs(torque)))
        return np.array(result)

    def next_modes(self, t: float, w: Floats, broken: int | None, t_after: float) -> tuple[int, ...]:
        """The modes just after an event, with as many elements stuck as can be; ``broken`` has exceeded its limit."""
        choices = []
        for i, element in enumerate(self.elements):
            v = float(element.speed @ w)
            if abs(v) > AT_REST:
                choices.append([int(np.sign(v))])
            else:
                slides = [1] if element.freewheel else [1, -1]
                choices.append(slides if i == broken or element.limit(t_after) <= 0 else [0, *slides])
        for modes in sorted(itertools.product(*choices), key=lambda m: sum(x != 0 for x in m)):
            a, tau = self.forces(t_after, w, modes)
            good = True
            for mode, element, torque in zip(modes, self.elements, tau, strict=True):
                if mode and abs(float(element.speed @ w)) <= AT_REST:
                    good &= mode * float(element.speed @ a) >= -1e-9
                elif not mode:
                    good &= (torque if element.freewheel else abs(torque)) <= element.limit(t_after) + 1e-9
            if good:
                return modes
        raise AssertionError(f"no modes fit at t = {t}")

    def integrate(self, w0: Floats, times: Floats, stops: Sequence[float]) -> tuple[Floats, Floats, Floats]:
        """Angles from zero and speeds, shape (bodies, times), and modes, shape (elements, times)."""
        n = len(self.J)
        y, t, broken = np.concatenate([np.zeros(n), w0]), float(times[0]), None
        out, seen = np.zeros((2 * n, len(times))), np.zeros((len(self.elements), len(times)))
        while t < times[-1]:
            modes = self.next_modes(t, y[n:], broken, t + 1e-10)
            end = min([s for s in stops if s > t + 1e-12] + [float(times[-1])])
            y, t_new, broken, dense = self._stretch(modes, y, t, end)
            inside = (times >= t) & (times <= t_new)
            if inside.any():
                out[:, inside] = dense(times[inside])
            seen[:, inside] = np.array(modes)[:, None]
            t = t_new
        return out[:n], out[n:], seen

    def _stretch(self, modes: Sequence[int], y: Floats, t: float, end: float) -> tuple[Floats, float, int | None, Any]:
        n = len(self.J)
        events: list[Any] = []
        for i in range(len(modes)):

            def margin(at: float, state: Floats, i: int = i) -> float:
                # a margin that begins at zero (start of sliding) is lifted for the first moment
                return float(self.margins(at, state[n:], modes)[i] + (1e-6 if at - t < 1e-7 else 0.0))

            margin.terminal = True  # type: ignore[attr-defined]
            margin.direction = -1  # type: ignore[attr-defined]
            events.append(margin)

        def rate(at: float, state: Floats) -> Floats:
            return np.concatenate([state[n:], self.forces(at, state[n:], modes)[0]])

        solution = solve_ivp(
            rate, (t, end), y, "DOP853", dense_output=True, events=events, rtol=1e-12, atol=1e-13, max_step=0.01
        )
        y, broken = solution.y[:, -1].copy(), None
        for i, found in enumerate(solution.t_events):
            if len(found):
                if modes[i] == 0:
                    broken = i
                else:  # exactly at rest from here on
                    G = self.elements[i].speed
                    y[n:] -= G * float(G @ y[n:]) / float(G @ G)
        return y, float(solution.t[-1]), broken, solution.sol
