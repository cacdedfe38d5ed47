"""Users' scenes with clutches and brakes: coupled clutches, a dual-clutch gearbox, eight speeds; their equations by hand."""

from __future__ import annotations

import io
import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

import gearlib as gl
from tests.benchmarks.friction_by_hand import Rubbing, RubbingTrain
from tests.benchmarks.gallery import gallery

Floats = NDArray[np.float64]
DUAL = gallery("dual_clutch", "Gearbox")
EIGHT = gallery("eight_speeds", "EightSpeeds")


def coupled_clutches(times: Floats) -> Floats:
    """Speeds of the four bodies of Modelica's CoupledClutches, all of 1 kg.m2."""
    pressed = (lambda t: math.sin(0.4 * math.pi * t + 1.570796326794897), lambda t: float(t >= 0.4), lambda t: float(t >= 0.9))
    rows = np.eye(3, 4) - np.eye(3, 4, k=1)
    elements = [Rubbing(row, lambda t, f=f: 10.0 * f(t), 1.1) for row, f in zip(rows, pressed, strict=True)]
    train = RubbingTrain(
        np.eye(4), lambda t, q, v: np.array([10 * math.sin(10 * math.pi * t), 0, 0, 0]), elements, np.array([10.0, 0, 0, 0]),
        (0.4, 0.9),
    )  # fmt: skip
    return train.solved(times)


def dual_clutch(times: Floats) -> Floats:
    """Speeds of engine and car; the coordinates are the angles of engine, final gear's wheel and car."""
    first, second = DUAL.FIRST * DUAL.FINAL, DUAL.SECOND * DUAL.FINAL
    elements = [
        Rubbing(np.array([1.0, -ratio, 0.0]), lambda t, s=share: DUAL.CAPACITY * float(np.interp(t, s.t, s.y)))
        for ratio, share in ((first, DUAL.SHARE_1), (second, DUAL.SHARE_2))
    ]

    def force(t: float, q: Floats, v: Floats) -> Floats:
        torque = 9e3 * (q[2] - q[1]) + 180.0 * (v[2] - v[1])
        return np.array([DUAL.TORQUE, torque, -torque])

    train = RubbingTrain(
        np.diag([DUAL.J_ENGINE, 2e-3 * (first**2 + second**2), DUAL.J_CAR]), force, elements,
        np.array([300.0, 300.0 / first, 300.0 / first]), tuple({*DUAL.SHARE_1.t.tolist(), *DUAL.SHARE_2.t.tolist()}),
    )  # fmt: skip
    return train.solved(times)[:, [0, 2]]


INPUT, SUN, RING, CARRIER, FRONT, MIDDLE, LEVER, OUT = range(8)  # the shafts of the eight-speed gearbox
J_CAR, DRIVE = 1900 * 0.33**2, 3.2


@cache
def pressures() -> dict[str, tuple[Floats, Floats]]:
    columns = np.genfromtxt(io.StringIO(EIGHT.PRESSURES), delimiter=",", names=True)
    return {name: (columns["t"], columns[name]) for name in "ABCDE"}


def eight_speeds_inputs() -> dict[str, Any]:
    return {f"{name}.f_normalized": gl.Table(*points) for name, points in pressures().items()}


@cache
def eight_speeds_by_willis() -> tuple[Floats, dict[str, Floats], Floats]:
    """Speeds of the shafts over four free ones, sliding speeds of the elements over the shafts' ones, and first gear's speeds."""
    members = {
        "p1": (SUN, CARRIER, RING),
        "p2": (SUN, INPUT, FRONT),
        "p3": (FRONT, LEVER, MIDDLE),
        "p4": (MIDDLE, OUT, CARRIER),
    }
    willis = np.zeros((4, 8))
    for row, (name, (sun, carrier, ring)) in zip(willis, members.items(), strict=True):
        row[[sun, ring, carrier]] = 1.0, EIGHT.RATIOS[name], -(1 + EIGHT.RATIOS[name])
    e = np.eye(8)
    slips = {"A": e[RING], "B": e[SUN], "C": e[FRONT] - e[MIDDLE], "D": e[LEVER] - e[OUT], "E": e[INPUT] - e[MIDDLE]}
    first = np.linalg.solve(np.vstack([willis, *(slips[name] for name in "ABE"), e[INPUT]]), [0.0] * 7 + [120.0])
    return null_space(willis), slips, first


def eight_speeds_start() -> dict[str, float]:
    return {"car.w": float(eight_speeds_by_willis()[2][OUT]) / DRIVE, "drum.w": 0.0, "ring.w": 0.0, "sun.w": 0.0}


def eight_speeds(times: Floats) -> Floats:
    """Speeds of engine and car."""
    N, slips, first = eight_speeds_by_willis()
    J = np.full(8, 0.012)
    J[[INPUT, OUT]] = 0.25, J_CAR / DRIVE**2

    def force(t: float, q: Floats, v: Floats) -> Floats:
        road = 450.0 * (float(N[OUT] @ v) / DRIVE / 100.0) ** 2 / DRIVE
        return np.asarray(220.0 * N[INPUT] - road * N[OUT])

    elements = [
        Rubbing(slips[name] @ N, lambda t, p=points: 1250.0 * float(np.interp(t, *p))) for name, points in pressures().items()
    ]
    train = RubbingTrain(N.T * J @ N, force, elements, N.T @ first, tuple(pressures()["A"][0].tolist()))
    return train.solved(times) @ N[[INPUT, OUT]].T / [1.0, DRIVE]
