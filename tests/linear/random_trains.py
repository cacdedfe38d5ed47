"""Random elastic trains, as components and as matrices that are put together without gearlib."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import gearlib as gl
import gearparts as gp


@dataclass(frozen=True)
class Drawn:
    """Bodies, edges (body, ratio, body, stiffness, damping), dampers and springs to the ground, and a loop."""

    J: tuple[float, ...]
    edges: tuple[tuple[int, float, int, float, float], ...]
    ground: tuple[tuple[int, float, float], ...]  # body, stiffness, damping
    drive: int
    sensor: tuple[str, int]  # "w" of a body, or "tau" or "phi_rel" of an edge
    gain: float


def draw(rng: np.random.Generator) -> Drawn:
    """A tree of two to six bodies, every third with a loop; one in four without damping, half of them held or braked somewhere."""
    n = int(rng.integers(2, 7))
    damped = rng.random() < 0.75

    def numbers() -> tuple[float, float]:
        stiffness = 10 ** rng.uniform(1, 5)
        return stiffness, damped * stiffness * 10 ** rng.uniform(-4, -2)

    edges = [(int(rng.integers(k)), float(rng.choice([-1, 1]) * rng.uniform(0.4, 2.5)), k, *numbers()) for k in range(1, n)]
    if n > 2 and rng.random() < 0.33:
        edges.append((0, float(rng.uniform(0.5, 2)), n - 1, *numbers()))
    ground = []
    if rng.random() < 0.5:
        ground.append(
            (int(rng.integers(n)), float(rng.choice([0.0, 1.0])) * 10 ** rng.uniform(1, 4), damped * 10 ** rng.uniform(-1, 1))
        )
    kind = str(rng.choice(["w", "tau", "phi_rel"]))
    sensor = kind, int(rng.integers(n if kind == "w" else len(edges)))
    gain = float(rng.choice([-1, 1, 1]) * 10 ** rng.uniform(-3, 2) * (1e3 if kind == "phi_rel" else 1))
    return Drawn(tuple((10 ** rng.uniform(-2, 1, n)).tolist()), tuple(edges), tuple(ground), int(rng.integers(n)), sensor, gain)


class Train(gl.Component):
    """A drawn train as a component: a gear and a shaft for each edge."""

    drawn = gl.Structural(None)

    def assemble(self) -> list[Any]:
        drawn: Drawn = self.drawn
        self.body = [gp.Inertia(J=J) for J in drawn.J]
        self.gear = [gp.IdealGear(ratio=ratio) for _, ratio, *_ in drawn.edges]
        self.shaft = [gp.SpringDamper(c=c, d=d) for *_, c, d in drawn.edges]
        self.torque, self.fixed = gp.Torque(), gp.Fixed()
        self.support = [gp.SpringDamper(c=c, d=d) if c else gp.Damper(d=d) for _, c, d in drawn.ground]
        links = [gl.connect(self.torque.flange, self.body[drawn.drive].flange_a)]
        for (left, _, right, *_), gear, shaft in zip(drawn.edges, self.gear, self.shaft, strict=True):
            links += [gl.connect(self.body[left].flange_b, gear.flange_a), gl.connect(gear.flange_b, shaft.flange_a)]
            links.append(gl.connect(shaft.flange_b, self.body[right].flange_a))
        for (body, *_), support in zip(drawn.ground, self.support, strict=True):
            links += [gl.connect(self.body[body].flange_b, support.flange_a), gl.connect(support.flange_b, self.fixed.flange)]
        return links


def sensor_name(drawn: Drawn) -> str:
    kind, k = drawn.sensor
    return f"body[{k}].w" if kind == "w" else f"shaft[{k}].{kind}"


def matrices(drawn: Drawn) -> tuple[Any, Any, Any]:
    """A, b, c of the loop by hand. Twists E phi in an orthonormal basis of what they can be, then speeds."""
    n, J = len(drawn.J), np.array(drawn.J)
    springs = [(left, ratio, right, c, d) for left, ratio, right, c, d in drawn.edges]
    E = np.zeros((len(springs) + len(drawn.ground), n))
    for row, (left, ratio, right, _, _) in zip(E, springs, strict=False):
        row[left] -= 1 / ratio
        row[right] += 1
    for row, (body, *_) in zip(E[len(springs) :], drawn.ground, strict=True):
        row[body] = -1
    c = np.array([e[3] for e in springs] + [g[1] for g in drawn.ground])
    d = np.array([e[4] for e in springs] + [g[2] for g in drawn.ground])
    elastic = E[c > 0]
    basis, sizes, _ = np.linalg.svd(elastic, full_matrices=False)
    basis = basis[:, sizes > 1e-12 * sizes[0]]
    m = basis.shape[1]
    A = np.zeros((m + n, m + n))
    A[:m, m:] = basis.T @ elastic
    A[m:, :m] = -(elastic.T * c[c > 0]) @ basis / J[:, None]
    A[m:, m:] = -(E.T * d) @ E / J[:, None]
    b, row = np.zeros(m + n), np.zeros(m + n)
    b[m + drawn.drive] = 1 / J[drawn.drive]
    kind, k = drawn.sensor
    if kind == "w":
        row[m + k] = 1.0
    else:
        row[:m] = basis[k] * (c[k] if kind == "tau" else 1.0)
        row[m:] = E[k] * (d[k] if kind == "tau" else 0.0)
    return A, b, row
