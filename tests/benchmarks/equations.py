"""The benchmark's scenes: as components, and reduced by hand to explicit equations for everything they are compared with.

The equations by hand are written twice: for numba, and in the operators of whatever symbols are handed in (CasADi, heyoka).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from numba import njit

import gearlib as gl
import gearparts as gp
from gearlib.solvers.problem import Floats
from gearparts.trains import zhou_cui_2022 as zc
from tests.benchmarks import floor_rk

c = gl.connect


class RigidLoop(gl.Component):
    """M2: gears and a planetary set closed to one degree of freedom, elastic shaft, load that grows with speed squared."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=10 + 5 * gl.sin(20 * gl.pi * gl.time))
        self.motor, self.pinion = gp.Inertia(J=0.01), gp.Inertia(J=0.02)
        self.sun, self.carrier, self.ring = gp.Inertia(J=0.005), gp.Inertia(J=0.05), gp.Inertia(J=0.1)
        self.load = gp.Inertia(J=2.0)
        self.reduction, self.closing = gp.IdealGear(ratio=3), gp.IdealGear(ratio=0.5)
        self.planetary = gp.IdealPlanetary(ratio=81 / 19)
        self.shaft = gp.SpringDamper(c=1e4, d=10.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-0.05, w_nominal=1.0, torque_direction=False)
        return [
            c(self.torque.flange, self.motor.flange_a), c(self.motor.flange_b, self.reduction.flange_a),
            c(self.reduction.flange_b, self.pinion.flange_a), c(self.pinion.flange_b, self.sun.flange_a),
            c(self.sun.flange_b, self.planetary.sun), c(self.planetary.ring, self.ring.flange_a),
            c(self.planetary.carrier, self.carrier.flange_a),
            c(self.ring.flange_b, self.closing.flange_a), c(self.closing.flange_b, self.carrier.flange_a),
            c(self.carrier.flange_b, self.shaft.flange_a), c(self.shaft.flange_b, self.load.flange_a),
            c(self.load.flange_b, self.fan.flange),
        ]  # fmt: skip


class BacklashPair(gl.Component):
    """M3: gear pair with backlash, its deflection a state; transmission error as a function of the pinion's angle."""

    J_1 = gl.Parameter("kg.m2", "inertia of the pinion", default=0.001)
    J_2 = gl.Parameter("kg.m2", "inertia of the wheel", default=0.016)
    r_1 = gl.Parameter("m", "base radius of the pinion", default=0.05)
    r_2 = gl.Parameter("m", "base radius of the wheel", default=0.1)
    k = gl.Parameter("N/m", "mesh stiffness", default=2e8)
    d = gl.Parameter("N.s/m", "mesh damping", default=2000.0)
    b = gl.Parameter("m", "half of the backlash", default=50e-6)
    theta = gl.Variable("rad", "angle of the pinion")
    w_1 = gl.Variable("rad/s", "speed of the pinion", nominal=100.0)
    w_2 = gl.Variable("rad/s", "speed of the wheel", nominal=100.0)
    x = gl.Variable("m", "deflection, free within the backlash", nominal=1e-5)
    v = gl.Variable("m/s", "its rate")
    F = gl.Variable("N", "mesh force")

    def equations(self) -> list[gl.Eq]:
        contact = gl.Piecewise(
            (self.k * (self.x - self.b) + self.d * self.v, self.x > self.b),
            (self.k * (self.x + self.b) + self.d * self.v, self.x < -self.b),
            (0.0, True),
        )
        return [
            gl.Eq(gl.der(self.theta), self.w_1),
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(self.v, self.r_1 * self.w_1 - self.r_2 * self.w_2 - 2e-4 * gl.cos(20 * self.theta) * self.w_1),
            gl.Eq(self.F, contact),
            gl.Eq(self.J_1 * gl.der(self.w_1), 40 - 0.002 * (self.w_1 - 800) - self.r_1 * self.F),
            gl.Eq(self.J_2 * gl.der(self.w_2), self.r_2 * self.F - 80),
        ]


@dataclass(frozen=True)
class ByHand:
    """Explicit equations, reduced by hand: the least that a specialist would integrate."""

    rhs: Any  # numba function (t, x, dx, data, index)
    x0: Floats
    data: Floats
    index: Any
    nominal: Floats
    outputs: Floats  # matrix that gives the scene's outputs from the states
    symbolic: Callable[[Sequence[Any], Any, Any], list[Any]]  # (states, time, functions) -> derivatives
    band: tuple[int, int] | None = None  # of the Jacobian
    step: float = 1e-5  # to begin with


# ---------------------------------------------------------------- M1


@njit(error_model="numpy")
def interleaved_rhs(t: float, x: Any, dx: Any, data: Any, index: Any) -> int:
    """The chain with speeds and twists in turn (w_0, q_0, w_1, ...), so that its Jacobian is a narrow band."""
    n = index[0]
    before = data[3] * math.sin(data[4] * t)
    for i in range(n - 1):
        slip = x[2 * i] - x[2 * i + 2]
        torque = data[0] * x[2 * i + 1] + data[1] * slip
        dx[2 * i + 1] = slip
        dx[2 * i] = (before - torque) * data[5 + i]
        before = torque
    dx[2 * n - 2] = (before - data[2] * x[2 * n - 2]) * data[4 + n]
    return 0


def chain_symbolic(n: int, x: Sequence[Any], t: Any, f: Any) -> list[Any]:
    dx: list[Any] = []
    before = 100.0 * f.sin(2 * math.pi * 50 * t)
    for i in range(n - 1):
        slip = x[2 * i] - x[2 * i + 2]
        torque = 1e5 * x[2 * i + 1] + 5.0 * slip
        dx += [(before - torque) * (1.0 / (0.01 * (1 + i / n))), slip]
        before = torque
    return dx + [(before - 1.0 * x[2 * n - 2]) * (1.0 / (0.01 * (1 + (n - 1) / n)))]


def shown(n: int) -> list[int]:
    """Bodies of the chain whose speeds are wanted."""
    return [0, n // 2, n - 1]


def chain_data(n: int) -> Floats:
    return np.concatenate(([1e5, 5.0, 1.0, 100.0, 2.0 * math.pi * 50.0], 1.0 / (0.01 * (1.0 + np.arange(n) / n))))


@cache
def chain_by_hand(n: int) -> ByHand:
    outputs = np.zeros((3, 2 * n - 1))
    outputs[np.arange(3), 2 * np.array(shown(n))] = 1.0
    nominal = np.full(2 * n - 1, 1e-2)
    nominal[1::2] = 1e-4
    return ByHand(
        interleaved_rhs, np.zeros(2 * n - 1), chain_data(n), np.array([n]), nominal, outputs, partial(chain_symbolic, n), (2, 2)
    )


# ---------------------------------------------------------------- M2

_SUN = 1.0 + 0.5 * 81 / 19  # speed of the sun over that of the carrier
_J_LOOP = 0.05 + 0.1 * 0.25 + (0.02 + 0.005 + 9 * 0.01) * _SUN**2


@njit(error_model="numpy")
def loop_rhs(t: float, x: Any, dx: Any, data: Any, index: Any) -> int:
    """States: speed of the carrier, twist of the shaft, speed of the load."""
    dx[1] = x[0] - x[2]
    torque = 1e4 * x[1] + 10.0 * dx[1]
    dx[0] = (3.0 * _SUN * (10.0 + 5.0 * math.sin(20.0 * math.pi * t)) - torque) * (1.0 / _J_LOOP)
    dx[2] = (torque - 0.05 * x[2] * abs(x[2])) * 0.5
    return 0


def loop_symbolic(x: Sequence[Any], t: Any, f: Any) -> list[Any]:
    slip = x[0] - x[2]
    torque = 1e4 * x[1] + 10.0 * slip
    drive = 3.0 * _SUN * (10.0 + 5.0 * f.sin(20.0 * math.pi * t))
    return [(drive - torque) / _J_LOOP, slip, (torque - 0.05 * x[2] * x[2]) * 0.5]  # the load never turns backwards


@cache
def loop_by_hand() -> ByHand:
    outputs = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    nominal = np.array([1e-2, 1e-4, 1e-2])
    return ByHand(loop_rhs, np.zeros(3), np.zeros(1), np.zeros(1, dtype=np.int64), nominal, outputs, loop_symbolic)


# ---------------------------------------------------------------- M3


def pair_symbolic(x: Sequence[Any], t: Any, f: Any) -> list[Any]:
    """x = deflection, pinion angle, speeds of pinion and wheel; ``f.contact(x, v)`` is the mesh force."""
    v = 0.05 * x[2] - 0.1 * x[3] - 2e-4 * f.cos(20.0 * x[1]) * x[2]
    force = f.contact(x[0], v)
    return [v, x[2], (40.0 - 0.002 * (x[2] - 800.0) - 0.05 * force) / 0.001, (0.1 * force - 80.0) / 0.016]


@njit(error_model="numpy")
def pair_rhs(t: float, x: Any, dx: Any, data: Any, index: Any) -> int:
    """The pair with the flank read off the deflection, for solvers without events."""
    dx[0] = 0.05 * x[2] - 0.1 * x[3] - 2e-4 * math.cos(20.0 * x[1]) * x[2]
    dx[1] = x[2]
    force = 0.0
    if abs(x[0]) > 50e-6:
        force = 2e8 * (x[0] - math.copysign(50e-6, x[0])) + 2000.0 * dx[0]
    dx[2] = (40.0 - 0.002 * (x[2] - 800.0) - 0.05 * force) / 0.001
    dx[3] = (0.1 * force - 80.0) / 0.016
    return 0


@cache
def pair_by_hand() -> ByHand:
    problem = floor_rk.backlash()
    return ByHand(pair_rhs, problem.x0, problem.data, problem.index, problem.nominal, np.eye(4)[:1], pair_symbolic, step=1e-6)


# ---------------------------------------------------------------- XP


def xp_matrices(elastic: bool) -> tuple[Floats, Floats]:
    """A and B (for drive torque and transmission-error rate) from the energies; with the shaft K_s the sixth speed is f69.

    States: the speeds f2, f11, f26, f35, f78 (and f69), the deflections q6, q30, q74 (and the twist of the shaft).
    """
    p = zc.bond_parameters()
    rows = {k: np.append(r, 0.0) for k, r in zc.flow_rows(p).items()}  # over f2, f11, f26, f35, f78, Sf8, Sf32, Sf72, f69
    speeds, springs = [0, 1, 2, 3, 4], {6: 1 / p.C[6], 30: 1 / p.C[30], 74: 1 / p.C[74]}
    if elastic:
        own, m20 = np.eye(9)[8], p.m[20]
        rows[74] = rows[74] + m20 * rows[69] - m20 * own
        rows[66] = rows[69] = own
        rows[75], rows[100] = rows[74], rows[62] - own
        speeds, springs = [*speeds, 8], springs | {100: 2.0e8}
    n, inertia = len(speeds), np.zeros((len(speeds), len(speeds)))
    for bond in zc.INERTIAS:
        inertia += p.I[bond] * np.outer(rows[bond][speeds], rows[bond][speeds])
    A, B = np.zeros((n + len(springs), n + len(springs))), np.zeros((n + len(springs), 2))
    for bond, r in p.R.items():
        row = rows[bond]
        A[:n, :n] -= r * np.outer(row[speeds], row[speeds])
        B[:n, 1] -= r * row[speeds] * row[5:8].sum()
    for k, (bond, stiffness) in enumerate(springs.items()):
        A[n + k, :n], B[n + k, 1] = rows[bond][speeds], rows[bond][5:8].sum()
        A[:n, n + k] = -stiffness * rows[bond][speeds]
    B[:n, 0] = rows[1][speeds]
    A[:n], B[:n] = np.linalg.solve(inertia, A[:n]), np.linalg.solve(inertia, B[:n])
    return A, B


@njit(error_model="numpy")
def dense_rhs(t: float, x: Any, dx: Any, data: Any, index: Any) -> int:
    """x' = A x + b + r cos(omega t + phase); data = omega, phase, b, r, A column by column."""
    n = x.size
    rate = math.cos(data[0] * t + data[1])
    for i in range(n):
        dx[i] = data[2 + i] + rate * data[2 + n + i]
    for j in range(n):
        column, factor = 2 + 2 * n + j * n, x[j]
        for i in range(n):
            dx[i] += data[column + i] * factor
    return 0


def dense_symbolic(A: Floats, B: Floats, x: Sequence[Any], t: Any, f: Any) -> list[Any]:
    rate = 0.0027 * f.cos(28.0 * t + 21 * math.pi)
    result = []
    for row, (torque, excited) in zip(A.tolist(), B.tolist(), strict=True):
        total = 100.0 * torque + excited * rate
        for factor, value in zip(row, x, strict=True):
            if factor != 0.0:
                total = total + factor * value
        result.append(total)
    return result


@cache
def xp_by_hand(elastic: bool) -> ByHand:
    A, B = xp_matrices(elastic)
    size = len(A)
    speeds = size - (4 if elastic else 3)
    outputs = np.zeros((6, size))
    for row, column, sign in ((0, 0, 1), (1, 2, 1), (2, 4, -1), (3, speeds, 1), (4, speeds + 1, 1), (5, speeds + 2, 1)):
        outputs[row, column] = sign  # f81 = -f78
    nominal = np.full(size, 1e-2)
    nominal[speeds:] = 1e-6
    data = np.concatenate(([28.0, 21 * math.pi], 100.0 * B[:, 0], 0.0027 * B[:, 1], A.T.ravel()))
    symbolic = partial(dense_symbolic, A, B)
    return ByHand(dense_rhs, np.zeros(size), data, np.array([size]), nominal, outputs, symbolic)
