"""Users' scenes that are smooth or rattle: a power-split hybrid, a loose wheel, 200 bodies with backlash, 1e5 revolutions; by hand."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gearlib as gl
import gearparts as gp
from tests.benchmarks.gallery import gallery

Floats = NDArray[np.float64]
c = gl.connect
HYBRID = gallery("power_split_hybrid", "Hybrid")
LOOSE = gallery("rattle", "LooseWheel")


# ---------------------------------------------------------------- power-split hybrid

HYBRID_CORNERS = tuple(sorted({*HYBRID.ENGINE.t.tolist(), *HYBRID.ASKED.t.tolist(), *HYBRID.DRIVER.t.tolist()}))


def hybrid(t: float, x: Floats) -> list[float]:
    """Speeds of engine and car, state of the controller; with the sun's torque tau the ring has i tau, the carrier -(1 + i) tau."""
    engine, car, integral = x.tolist()
    i, final, sun = HYBRID.I_SET, HYBRID.FINAL, HYBRID.J_GENERATOR
    torque, driver, wanted = (float(np.interp(t, p.t, p.y)) for p in (HYBRID.ENGINE, HYBRID.DRIVER, HYBRID.ASKED))
    current = HYBRID.K * (integral + wanted - engine) - torque / (1 + i)
    boost = driver / final - i * torque / (1 + i)
    road = -(12.0 + 0.4 * car**2 * 0.31**3) * math.tanh(car)
    a, d = HYBRID.J_ENGINE + sun * (1 + i) ** 2, HYBRID.J_CAR + (HYBRID.J_MOTOR + sun * i**2) * final**2
    b = -sun * (1 + i) * i * final
    p, q = torque + (1 + i) * current, final * boost - i * final * current + road
    whole = a * d - b * b
    return [(d * p - b * q) / whole, (a * q - b * p) / whole, (wanted - engine) / HYBRID.T]


# ---------------------------------------------------------------- loose wheel

SHAKE = 3.5  # rad/s, more than half above what makes the wheel lift off
LOOSE_START = {"wheel.w": LOOSE.SPEED, "mesh.phi_rel": -LOOSE.BACKLASH / 2 - LOOSE.DRAG / LOOSE.STIFFNESS}


def loose_wheel(t: float, x: Floats) -> list[float]:
    """Angle across the mesh, speed of the wheel."""
    gap, w = x.tolist()
    slip = w - LOOSE.SPEED - SHAKE * math.sin(LOOSE.FIRING * t)
    torque = elasto_backlash(gap, slip, LOOSE.STIFFNESS, LOOSE.DAMPING, LOOSE.BACKLASH / 2)
    return [slip, (-torque - LOOSE.DRAG) / LOOSE.J]


def elasto_backlash(x: float, slip: float, stiffness: float, damping: float, half: float) -> float:
    """Modelica's ElastoBacklash: no pull, and a damping of no more than the spring's torque."""
    if x > half:
        spring = stiffness * (x - half)
        return max(0.0, spring + min(spring, damping * slip))
    if x < -half:
        spring = stiffness * (x + half)
        return min(0.0, spring + max(spring, damping * slip))
    return 0.0


# ---------------------------------------------------------------- 200 bodies with rattle

BODIES, EVERY, PLAY = 200, 20, 2e-3  # every so many couplings one has backlash, rad


class Rattle(gl.Component):
    """A long row of shafts whose couplings have backlash here and there; the torque at its head changes its sign."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=20 + 60 * gl.sin(150 * gl.time))
        self.body = [gp.Inertia(J=0.01) for _ in range(BODIES)]
        self.shaft = [
            gp.ElastoBacklash(c=1e4, d=3.0, b=PLAY) if k % EVERY == EVERY // 2 else gp.SpringDamper(c=1e4, d=3.0)
            for k in range(BODIES - 1)
        ]
        self.drag = gp.LinearSpeedDependentTorque(tau_nominal=-1.0, w_nominal=1.0, torque_direction=False)
        return [
            c(self.torque.flange, self.body[0].flange_a), c(self.body[-1].flange_b, self.drag.flange),
            *(c(left.flange_b, shaft.flange_a) for left, shaft in zip(self.body, self.shaft, strict=False)),
            *(c(shaft.flange_b, right.flange_a) for shaft, right in zip(self.shaft, self.body[1:], strict=True)),
        ]  # fmt: skip


GAPS = np.arange(BODIES - 1) % EVERY == EVERY // 2


def rattle(t: float, x: Floats) -> Floats:
    """Speeds of the bodies, then twists of the shafts (second less first)."""
    w, twist = x[:BODIES], x[BODIES:]
    slip = np.diff(w)
    torque = 1e4 * twist + 3.0 * slip
    for k in np.flatnonzero(GAPS):
        torque[k] = elasto_backlash(float(twist[k]), float(slip[k]), 1e4, 3.0, PLAY / 2)
    total = np.zeros(BODIES)
    total[0], total[-1] = 20 + 60 * math.sin(150 * t), -w[-1]
    total[:-1] += torque
    total[1:] -= torque
    return np.concatenate([total / 0.01, slip])


# ---------------------------------------------------------------- 1e5 revolutions

CRUISE = 200 * math.pi  # rad/s


class RippleOfAngle(gl.Component):
    """A torque that varies twice in each turn of its shaft."""

    flange = gp.Flange()
    mean = gl.Parameter("N.m", "mean torque", default=40.0)
    ripple = gl.Parameter("N.m", "amplitude", default=10.0)
    phi = gl.Variable("rad", "angle")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.phi, self.flange.phi), gl.Eq(self.flange.tau, -self.mean - self.ripple * gl.sin(2 * self.phi))]


class ManyTurns(gl.Component):
    """A motor whose torque varies with its angle, a shaft and a fan, for 1e5 revolutions."""

    def assemble(self) -> list[Any]:
        self.torque, self.motor, self.wheel = RippleOfAngle(), gp.Inertia(J=0.05), gp.Inertia(J=0.2)
        self.shaft = gp.SpringDamper(c=2000.0, d=1.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-40.0, w_nominal=CRUISE)
        return [
            c(self.torque.flange, self.motor.flange_a), c(self.motor.flange_b, self.shaft.flange_a),
            c(self.shaft.flange_b, self.wheel.flange_a), c(self.wheel.flange_b, self.fan.flange),
        ]  # fmt: skip


MANY_START = {"motor.w": CRUISE, "wheel.w": CRUISE, "motor.phi": 0.0}


def many_turns(t: Any, x: Any, sin: Any = math.sin) -> list[Any]:
    """Speeds of motor and wheel, angle of the motor, twist of the shaft (first less second)."""
    motor, wheel, phi, twist = x.tolist()
    torque = 2000.0 * twist + (motor - wheel)
    return [
        (40 + 10 * sin(2 * phi) - torque) / 0.05, (torque - 40 / CRUISE**2 * wheel * wheel) / 0.2, motor, motor - wheel,
    ]  # fmt: skip


@cache
def _gauss(stages: int) -> tuple[Floats, Floats]:
    """A and b of Gauss' collocation, of order twice the stages."""
    nodes, weights = np.polynomial.legendre.leggauss(stages)
    nodes, weights = (nodes + 1) / 2, weights / 2
    powers = np.arange(1, stages + 1)
    A = np.linalg.solve((nodes[:, None] ** (powers - 1)).T, (nodes[:, None] ** powers / powers).T).T
    return A, weights


def _collocated(A: Floats, b: Floats, x: Floats, h: float, steps: int, samples: int, cruise: float) -> Floats:
    """Samples of the state, so many steps apart; the angle is summed with compensation."""
    n = len(b)
    out = np.empty((samples, 4))
    out[0] = x
    k, stage, before = np.zeros((n, 4)), np.empty(4), np.empty((n, 4))
    lost = np.zeros(4)
    for sample in range(1, samples):
        for _ in range(steps):
            for _ in range(50):
                before[:] = k
                for i in range(n):
                    for j in range(4):
                        total = 0.0
                        for m in range(n):
                            total += A[i, m] * k[m, j]
                        stage[j] = x[j] + h * total
                    torque = 2000.0 * stage[3] + (stage[0] - stage[1])
                    k[i, 0] = (40 + 10 * math.sin(2 * stage[2]) - torque) / 0.05
                    k[i, 1] = (torque - 40 / cruise**2 * stage[1] * stage[1]) / 0.2
                    k[i, 2] = stage[0]
                    k[i, 3] = stage[0] - stage[1]
                if np.abs(k - before).max() < 1e-13 * np.abs(k).max():
                    break
            for j in range(4):
                total = -lost[j]
                for m in range(n):
                    total += h * b[m] * k[m, j]
                new = x[j] + total
                lost[j] = (new - x[j]) - total
                x[j] = new
        out[sample] = x
    return out


def by_collocation(times: Floats, steps: int = 0) -> Floats:
    """Speed and angle of the motor at equidistant times by Gauss' method of order 12 with equal steps of half a millisecond."""
    A, b = _gauss(6)
    interval = float(times[1] - times[0])
    steps = steps or math.ceil(interval / 5e-4)
    loop: Any = _collocated
    if steps * len(times) > 10_000:  # worth compiling
        from numba import njit

        loop = njit(_collocated)
    start = np.array([CRUISE, CRUISE, 0.0, 0.0])
    return np.asarray(loop(A, b, start, interval / steps, steps, len(times), CRUISE)[:, [0, 2]])
