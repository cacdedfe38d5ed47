"""A train whose forces have corners and jumps at states that a Fourier series passes at known phases."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import gearlib as gl
from gearlib.periodic.first_motion import Forced

STOP, STIFF, FRICTION = 0.5, 3.0, 0.2
ZETA = 0.05


class Switching(gl.Component):
    """Mass 1 on a spring, which a stop stiffens, under a friction that jumps where a point of the spring changes its direction."""

    w = gl.Parameter("rad/s", default=0.8)
    x = gl.Variable("1")
    v = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        stop = gl.Piecewise((STIFF * (self.x - STOP), self.x > STOP), (0, True))
        friction = gl.Piecewise((FRICTION, self.v + 0.3 * self.x > 0.1 * gl.cos(self.w * gl.time)), (-FRICTION, True))
        force = gl.cos(self.w * gl.time) + 0.2 * self.w
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), force - self.x - 2 * ZETA * self.v - stop - friction)]


@cache
def task(harmonics: int) -> Forced:
    return Forced(gl.compile(Switching()).translation, "w", {}, {}, harmonics, {})


@cache
def driven(omega: float) -> Any:
    return task(3).driven(task(3).scene(["x", "v"]))(omega)


def motion(omega: float) -> np.ndarray:
    """Coefficients of some motion, x and its rate v, with two harmonics: no solution, but one that passes stop and direction."""
    x = np.array([0.1, 0.9, -0.4, 0.05, 0.15, 0.0, 0.0])
    v = np.zeros(7)
    v[[1, 3]], v[[2, 4]] = omega * np.array([1, 2]) * x[[2, 4]], -omega * np.array([1, 2]) * x[[1, 3]]
    return np.column_stack([x, v])
