"""Means over a turn of the mesh of laws at random: what follows from a phase, with equations in any order, against its course in numpy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from tests.statics.test_mesh_turn_course import driven

W, TURNS = 5.0, 3  # speed of the shaft, rad/s, and turns of the phase for each of it
KINDS = ("sum", "waves", "square", "product", "constant", "zero", "opposite", "condition", "rate", "least", "with the speed")
LAST = ("sum", "square", "product", "condition")


@dataclass(frozen=True)
class Law:
    """What one variable is of two earlier ones (-1: the sine of the phase), with three numbers."""

    kind: str
    first: int
    second: int
    numbers: tuple[float, float, float]
    scale: float  # both sides of the equation are multiplied by it

    def of(self, x: Any, y: Any, speed: Any, m: Any) -> Any:
        """The law in gearlib's functions, or in those of `Numbers`."""
        c0, c1, c2 = self.numbers
        return {
            "sum": lambda: c0 * x + c1 * y + c2, "waves": lambda: c0 * m.sin(x) + c1 * m.cos(y),
            "square": lambda: c0 * x**2 + c1 * y, "product": lambda: c0 * x * y + c1, "constant": lambda: c0,
            "zero": lambda: 0.0, "opposite": lambda: -x, "condition": lambda: m.Piecewise((c0, x > c1), (c2, True)),
            "rate": lambda: c0 * speed + x, "least": lambda: m.Min(x, c1), "with the speed": lambda: speed * x * c0,
        }[self.kind]()  # fmt: skip


class Numbers:
    """gearlib's functions for courses in numpy."""

    sin, cos, Min = np.sin, np.cos, np.minimum

    @staticmethod
    def Piecewise(first: Any, other: Any) -> Any:
        return np.where(first[1], first[0], other[0])


def laws(seed: int) -> list[Law]:
    """Laws of three to seven variables; the last one is that of the torque."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 8))
    found = []
    for k in range(count + 1):
        first, second = (int(i) for i in rng.integers(-1, k, 2))
        numbers = tuple(float(c) + 0.05 for c in np.round(rng.uniform(-2, 2, 3), 1))
        found.append(Law(str(rng.choice(KINDS if k < count else LAST)), first, second, numbers, float(rng.choice([1.0, 3.0]))))
    return found


class Lawful(gl.Component):
    """A load whose torque follows from a phase by laws at random."""

    flange, phase, speed = gp.Flange("shaft"), gl.Variable("rad"), gl.Variable("1")
    seed, n, s = gl.Structural(0), gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)
    v0, v1, v2, v3, v4, v5, v6 = (gl.Variable("1") for _ in range(7))

    def equations(self) -> list[Any]:
        known = [self.v0, self.v1, self.v2, self.v3, self.v4, self.v5, self.v6, gl.sin(self.phase)]
        *inner, last = laws(self.seed)
        found = [
            gl.Eq(gl.der(self.phase), TURNS * gl.der(self.flange.phi)),
            gl.Eq(self.speed, self.s * gl.der(self.flange.phi)),
        ]
        for k, law in enumerate(inner):
            found.append(gl.Eq(law.scale * known[k], law.scale * law.of(known[law.first], known[law.second], self.speed, gl)))
        found += [gl.Eq(v, 0) for v in known[len(inner) : 7]]
        found.append(gl.Eq(self.flange.tau, self.n * last.of(known[last.first], known[last.second], self.speed, gl)))
        return [found[i] for i in np.random.default_rng(self.seed + 999).permutation(len(found))]


@pytest.mark.parametrize("seed", range(40))
def test_the_mean_torque_is_that_of_its_course(seed: int) -> None:
    phase = 2 * np.pi * (np.arange(100_000) + 0.5) / 100_000
    known = [np.sin(phase)]  # that of law k stands at k + 1
    *inner, last = laws(seed)
    for law in inner:
        value = law.of(known[law.first + 1], known[law.second + 1], W, Numbers)
        known.append(np.broadcast_to(value, phase.shape))
    torque = np.broadcast_to(last.of(known[last.first + 1], known[last.second + 1], W, Numbers), phase.shape)
    found = gl.power_flow(driven(Lawful(seed=seed)), speeds={"body.w": W})["load.flange"].torque
    assert found == pytest.approx(torque.mean(), abs=3e-3 * (1 + np.abs(torque).max()))  # jumps are placed to 1/4096 of a turn
