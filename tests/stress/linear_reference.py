"""Linear trains solved by hand: a mass matrix, null spaces, and the matrix exponential. Nothing here comes from gearlib.

Each node has an angle; q are the angles, v their rates. Rigid parts are rows of ``G v = u(t)`` with multipliers ``lam``:

    M v' + D v + K q = f(t) + G^T lam,    q' = v,    v = v_p(t) + T1 a + T2 b + T3 c

T1, T2, T3 span the motions that G leaves free: T1 moves inertia, T2 moves none but works dampers, T3 strains springs only.
So a follows Newton's law, b a balance of damping, and c keeps the derivative of the balance of the springs along T3. What
would move without any of the three is undetermined, and such a train has no unique motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from tests.stress.described import Part, Signal, Train

Floats = NDArray[np.float64]
SMALL = 1e-9  # a singular value below it is zero; rows are of order 1
CLEAR = 1e-4  # a train with a singular value between the two is not judged: its structure depends on rounding
ROUNDING = 1e-13  # an entry of an orthonormal basis below it is zero: nodes may turn a million times faster than others
SHARES = {"Inertia": (1.0, -1.0), "TorqueSensor": (1.0, -1.0), "PowerSensor": (1.0, -1.0), "MultiSensor": (1.0, -1.0)}
COMPLIANT = ("Spring", "Damper", "SpringDamper", "ElastoBacklash", "ElastoBacklash2", "Clutch", "OneWayClutch")
PRESCRIBED = ("Fixed", "ConstantSpeed", "Speed", "Position", "Accelerate", "Move")


class Unclear(Exception):
    """The train's structure depends on rounding."""


@dataclass(frozen=True)
class Row:
    """A constraint ``sum(coefficients * v at the part's flanges) = rate(t)``; the angles add up to ``offset`` at the start."""

    part: Part
    coefficients: tuple[float, ...]
    offset: float | None  # None: any start angle will do
    rate: Any  # coefficients of the exogenous signals


def null_space(matrix: Floats, width: int) -> Floats:
    """Orthonormal basis of what a matrix maps to zero; the rows are of order 1."""
    if not matrix.size:
        return np.eye(width)
    _, sizes, right = np.linalg.svd(matrix)
    if any(SMALL < s < CLEAR for s in sizes):
        raise Unclear("a singular value is neither zero nor clear of it")
    return right[int((sizes > SMALL).sum()) :].T


def beside(whole: Floats, part: Floats) -> Floats:
    """Orthonormal basis of what a space holds beside a subspace."""
    if not part.shape[1]:
        return whole
    return whole @ null_space((whole.T @ part).T, whole.shape[1])


def constrained(space: Floats, rows: Sequence[Floats]) -> Floats:
    """The part of a space on which all rows vanish."""
    if not rows or not space.shape[1]:
        return space
    normal = [row / np.abs(row).max() for row in rows if np.abs(row).max() > 0]
    return space @ null_space(np.array(normal) @ space, space.shape[1]) if normal else space


class Exogenous:
    """All signals of a train as ``z``: powers of time, sines and cosines. ``z' = S z``; steps make stretches of time."""

    def __init__(self, train: Train) -> None:
        signals = [s for p in train.parts for _, s in p.signals()]
        self.waves = sorted({(s.omega, s.phase) for s in signals if s.amplitude})
        self.size = 4 + 2 * len(self.waves)
        S = np.zeros((self.size, self.size))
        for k in range(3):
            S[k + 1, k] = 1.0
        for k, (omega, _) in enumerate(self.waves):
            i = 4 + 2 * k
            S[i, i + 1], S[i + 1, i] = omega, -omega
        self.S = S
        self.moments = sorted({m for s in signals for m, _ in s.steps if 0 < m < train.t_end})

    def at(self, t: float) -> Floats:
        z = [1.0, t, t**2 / 2, t**3 / 6]
        for omega, phase in self.waves:
            z += [np.sin(omega * t + phase), np.cos(omega * t + phase)]
        return np.array(z)

    def coefficients(self, value: float | Signal, t: float) -> Floats:
        """The row that gives a signal at, and just after, a moment."""
        row = np.zeros(self.size)
        if not isinstance(value, Signal):
            row[0] = value
            return row
        row[0] = value.bias + sum(h for m, h in value.steps if m <= t)
        row[1] = value.slope
        if value.amplitude:
            row[4 + 2 * self.waves.index((value.omega, value.phase))] = value.amplitude
        return row

    def integral(self, row: Floats) -> Floats:
        """The row of a signal's integral from 0 on (up to the third power of time)."""
        result = np.zeros(self.size)
        result[1:4] = row[:3]
        for k, (omega, phase) in enumerate(self.waves):
            i = 4 + 2 * k
            sine, cosine = row[i], row[i + 1]
            result[i + 1] -= sine / omega
            result[i] += cosine / omega
            result[0] += sine * np.cos(phase) / omega - cosine * np.sin(phase) / omega
        return result

    def derivative(self, row: Floats) -> Floats:
        return row @ self.S


class LinearTrain:
    """The matrices of a described train and, unless it has no unique motion, its reduction."""

    def __init__(self, train: Train) -> None:
        self.train = train
        self.nodes = sorted({node for p in train.parts for node in p.at})
        self.place = {node: k for k, node in enumerate(self.nodes)}
        self.z = Exogenous(train)
        n = len(self.nodes)
        self.M, self.D, self.K = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
        self.preload = np.zeros(n)
        self.rows: list[Row] = []
        self.massive: list[Floats] = []
        self.damped: list[Floats] = []
        self.driven: list[Floats] = []  # rows whose damping is negative
        self.elastic: list[Floats] = []
        self.start_of_speed: dict[str, Floats] = {}
        for part in train.parts:
            self._add(part)
        self.G = np.array([self.spread(r.part, r.coefficients) for r in self.rows]).reshape(len(self.rows), n)
        self.prescribed = np.array([r.rate for r in self.rows]).reshape(len(self.rows), self.z.size)
        self._reduce()

    def spread(self, part: Part, coefficients: Sequence[float]) -> Floats:
        """A row over all nodes from coefficients at a part's flanges; several flanges may share a node."""
        row = np.zeros(len(self.nodes))
        for node, coefficient in zip(part.at, coefficients, strict=False):
            row[self.place[node]] += coefficient
        row[np.abs(row) < 1e-14] = 0.0
        return row

    def _add(self, part: Part) -> None:
        kind, value = part.kind, part.value
        across = self.spread(part, (-1.0, 1.0))
        relative = self.spread(part, (1.0, -1.0)[: len(part.at)])
        zero = np.zeros(self.z.size)
        if kind in ("Inertia", "TorqueSensor", "PowerSensor", "MultiSensor"):
            if kind == "Inertia" and value("J") > 0:
                body = self.spread(part, (1.0,))
                self.M += value("J") * np.outer(body, body)
                self.massive.append(body)
            self.rows.append(Row(part, SHARES[kind], 0.0, zero))
        elif kind == "Kicked":
            body = self.spread(part, (1.0,))
            self.M += value("J") * np.outer(body, body)
            self.massive.append(body)
        elif kind in ("BearingFriction", "Brake"):
            self.rows.append(Row(part, (1.0, -1.0, 0.0)[: len(part.at)], 0.0, zero))
        elif kind == "Disc":
            self.rows.append(Row(part, (-1.0, 1.0), value("delta_phi"), zero))
        elif kind in ("Spring", "Damper", "SpringDamper"):
            c, d = value("c"), value("d")
            self.K += c * np.outer(across, across)
            self.D += d * np.outer(across, across)
            self.preload += c * value("phi_rel0") * across
            self.elastic += [across] if c > 0 else []
            self.damped += [across] if d > 0 else []
        elif kind == "LinearSpeedDependentTorque":
            d = -value("tau_nominal") / value("w_nominal")
            self.D += d * np.outer(relative, relative)
            self.damped += [relative] if d > 0 else []
            self.driven += [relative] if d < 0 else []
        elif kind == "IdealGear":
            r = value("ratio")
            self.rows.append(Row(part, (1.0, -r, r - 1.0)[: len(part.at)], 0.0, zero))
        elif kind == "IdealPlanetary":
            r = value("ratio")
            self.rows.append(Row(part, (1.0, -(1 + r), r), 0.0, zero))
        elif kind in PRESCRIBED:
            self._prescribe(part)

    def _prescribe(self, part: Part) -> None:
        z, value, coefficients = self.z, part.value, (1.0, -1.0)[: len(part.at)]
        offset: float | None = None
        if part.kind == "Fixed":
            rate, offset = np.zeros(z.size), value("phi0")
        elif part.kind == "ConstantSpeed":
            rate = z.coefficients(value("w_fixed"), 0.0)
        elif part.kind == "Speed":
            rate = z.coefficients(value("w_ref"), 0.0)
        elif part.kind == "Accelerate":
            rate = z.integral(z.coefficients(value("a_ref"), 0.0))
            rate[0] += value("w_start")
        else:
            row = z.coefficients(value("phi_ref"), 0.0)
            rate, offset = z.derivative(row), float(row @ z.at(0.0))
        self.rows.append(Row(part, coefficients, offset, rate))

    # ------------------------------------------------------------ structure

    def _reduce(self) -> None:
        n = len(self.nodes)
        G = self.G
        free = constrained(np.eye(n), list(G))
        self.problems: list[str] = []
        back = np.linalg.pinv(G, rcond=SMALL) if G.size else np.zeros((n, len(self.rows)))
        self.v_p = back @ self.prescribed
        if G.size and np.abs(G @ self.v_p - self.prescribed).max(initial=0.0) > 1e-10 * (
            1 + np.abs(self.prescribed).max(initial=0.0)
        ):
            self.problems.append("the prescribed speeds contradict each other")
        known = [k for k, r in enumerate(self.rows) if r.offset is not None]
        offsets = np.array([self.rows[k].offset for k in known])
        at = np.linalg.pinv(G[known], rcond=SMALL) @ offsets if known else np.zeros(n)
        if known and np.abs(G[known] @ at - offsets).max() > 1e-10 * (1 + np.abs(offsets).max()):
            self.problems.append("the prescribed angles contradict each other")
        massless = constrained(free, self.massive)
        undamped = constrained(massless, self.damped)
        if any(np.abs(row @ massless).max(initial=0.0) > SMALL for row in self.driven):
            raise Unclear("a torque that grows with the speed of what has no inertia")
        nothing = constrained(undamped, self.elastic)
        self.loose = self.nodes[int(np.abs(nothing).max(axis=1).argmax())] if nothing.shape[1] else None
        if nothing.shape[1]:
            self.problems.append("a motion without inertia, damping or stiffness")
        self.T1, self.T2, self.T3 = (
            np.where(np.abs(T) > ROUNDING, T, 0.0)
            for T in (beside(free, massless), beside(massless, undamped), beside(undamped, nothing))
        )
        gears = [g for g, r in zip(G, self.rows, strict=True) if r.part.kind not in PRESCRIBED]
        rigid = constrained(np.eye(n), gears)
        moving = np.abs(rigid).max(axis=1, initial=0.0) > 1e-7
        self.locked = not moving.all()  # gears whose ratios contradict each other leave no motion at all
        held = [k for k, r in enumerate(self.rows) if r.part.kind in PRESCRIBED]
        apart = [k for k in range(len(self.rows)) if k not in held]
        rank = np.linalg.matrix_rank(G, tol=SMALL) if G.size else 0
        without = np.linalg.matrix_rank(G[apart], tol=SMALL) if apart else 0
        self.held_twice = len(held) > rank - without  # one prescribed motion follows from others
        # parts whose multiplier is known whatever the others are
        if G.size:
            left = null_space(G.T, len(self.rows))
            self.known = np.abs(left).max(axis=1, initial=0.0) < 1e-7
        else:
            self.known = np.zeros(0, bool)

    @cached_property
    def inverse(self) -> tuple[Floats, Floats, Floats]:
        T1, T2, T3 = self.T1, self.T2, self.T3
        return tuple(
            np.linalg.inv(T.T @ W @ T) if T.shape[1] else np.zeros((0, 0))
            for T, W in ((T1, self.M), (T2, self.D), (T3, self.K))
        )  # type: ignore[return-value]

    def forces(self, t: float) -> Floats:
        """Given torques at the nodes, as rows over the exogenous signals, from a moment on."""
        F = np.zeros((len(self.nodes), self.z.size))
        F[:, 0] += self.preload
        for part in self.train.parts:
            shape: tuple[float, ...] = (1.0, -1.0)[: len(part.at)]
            if part.kind == "Torque":
                row = self.z.coefficients(part.value("tau"), t)
            elif part.kind == "ConstantTorque":
                row = self.z.coefficients(part.value("tau_constant"), t)
            elif part.kind == "TorqueStep":
                height = part.value("step_torque") if t >= part.value("start_time") else 0.0
                row = self.z.coefficients(part.value("offset_torque") + height, t)
            elif part.kind == "Torque2":
                row, shape = self.z.coefficients(part.value("tau"), t), (-1.0, 1.0)
            else:
                continue
            F += np.outer(self.spread(part, shape), row)
        return F

    def system(self, t: float) -> Stretch:
        """The equations from a moment on, up to the next step."""
        return Stretch(self, self.forces(t))

    @property
    def struck(self) -> bool:
        """Whether a step of torque moves what has neither inertia nor damping: its speed would be infinite."""
        steps = np.diff([self.forces(t)[:, 0] for t in [0.0, *self.moments]], axis=0)
        return bool(steps.size and self.T3.size and np.abs(steps @ self.T3).max() > 1e-9)

    @property
    def jolted(self) -> bool:
        """Whether a step of torque makes a speed jump whose acceleration is measured: it would be infinite."""
        steps = np.diff([self.forces(t)[:, 0] for t in [0.0, *self.moments]], axis=0)
        if not steps.size or not self.T2.size:
            return False
        jumps = steps @ self.T2 @ np.linalg.solve(self.T2.T @ self.D @ self.T2, self.T2.T)
        for part in self.train.parts:
            if part.kind in ("AccSensor", "RelAccSensor", "RelativeStates"):
                row = self.spread(part, (1.0,) if part.kind == "AccSensor" else (-1.0, 1.0))
                if np.abs(jumps @ row).max() > 1e-9:
                    return True
        return False

    @property
    def differentiated(self) -> str | None:
        """Whether an input that is bound to nothing acts on what has no inertia: speeds or accelerations need its derivative.

        Where it acts between what is rigidly one, the derivative cancels, which an analysis of structure does not see.
        """
        massless = np.hstack([self.T2, self.T3])
        found: str | None = None
        for part in self.train.parts:
            if part.kind in ("Torque", "Torque2") and any(not s.bound for _, s in part.signals()):
                row = self.spread(part, (-1.0, 1.0) if part.kind == "Torque2" else (1.0, -1.0)[: len(part.at)])
                if np.abs(row @ massless).max(initial=0.0) > 1e-9:
                    return "an input that is bound to nothing would have to be differentiated"
                if np.abs(massless[row != 0]).max(initial=0.0) > 1e-9:
                    found = "an input that is bound to nothing acts within what has no inertia"
        return found

    @property
    def moments(self) -> list[float]:
        steps = [p.value("start_time") for p in self.train.parts if p.kind == "TorqueStep"]
        return sorted({*self.z.moments, *(s for s in steps if 0 < s < self.train.t_end)})

    # ------------------------------------------------------------ motion

    @cached_property
    def first_angles(self) -> Floats:
        """Angles near those that the train wants, and that the prescribed angles and rigid parts allow."""
        wanted = np.array([self.train.angles[node % len(self.train.angles)] for node in self.nodes])
        known = [k for k, r in enumerate(self.rows) if r.offset is not None]
        if not known:
            return wanted
        offsets = np.array([self.rows[k].offset for k in known])
        return wanted + np.linalg.pinv(self.G[known], rcond=SMALL) @ (offsets - self.G[known] @ wanted)

    def start(self) -> Floats:
        """The start ``x``: speeds near those that the train wants."""
        speeds = np.array([self.train.speeds[node % len(self.train.speeds)] for node in self.nodes])
        a = self.T1.T @ (speeds - self.v_p @ self.z.at(0.0))
        return np.concatenate([np.zeros(self.T1.shape[1] + self.T2.shape[1]), a])

    def solve(self, times: Floats) -> tuple[Floats, Floats, list[Stretch]]:
        """States, exogenous signals and equations at some times; times on a step are just after it."""
        x = self.start()
        states, zs, stretches = [], [], []
        edges = [0.0, *self.moments, np.inf]
        for begin, end in zip(edges, edges[1:]):
            stretch, now = self.system(begin), begin
            inner = [t for t in times if begin <= t < end]
            for t in [*inner, *([end] if np.isfinite(end) else [])]:
                x = stretch.carried(x, self.z.at(now), t - now)
                now = t
                if t < end:
                    states.append(x)
                    zs.append(self.z.at(t))
                    stretches.append(stretch)
        return np.array(states), np.array(zs), stretches


class Stretch:
    """``x' = A x + B z`` between two steps, and everything else that follows from ``x`` and ``z``.

    ``x = (y1, y2, a)`` with ``q = T1 y1 + T2 y2 + T3 y3 + (angles at the start) + (integral of v_p)``.
    """

    def __init__(self, train: LinearTrain, F: Floats) -> None:
        n, T1, T2, T3 = len(train.nodes), train.T1, train.T2, train.T3
        n1, n2 = T1.shape[1], T2.shape[1]
        i1, i2, i3 = train.inverse
        M, D, K, S, v_p = train.M, train.D, train.K, train.z.S, train.v_p
        moved = np.array([train.z.integral(row) for row in v_p]).reshape(n, len(S))
        moved[:, 0] += train.first_angles
        eye = np.eye(2 * n1 + n2)
        y1, y2, a = np.split(eye, [n1, n1 + n2])
        # every quantity is a pair of matrices: what x contributes, what z contributes
        given = lambda matrix: (np.zeros((len(matrix), 2 * n1 + n2)), matrix)  # noqa: E731
        state = lambda matrix: (matrix, np.zeros((len(matrix), len(S))))  # noqa: E731
        most = add(state(T1 @ y1 + T2 @ y2), given(moved))
        y3 = times(i3 @ T3.T, add(given(F), times(-K, most)))
        self.q = q = add(most, times(T3, y3))
        v1 = add(state(T1 @ a), given(v_p))
        b = times(i2 @ T2.T, add(given(F), add(times(-K, q), times(-D, v1))))
        v2 = add(v1, times(T2, b))
        c = times(i3 @ T3.T, add(given(F @ S), times(-K, v2)))
        self.v = v = add(v2, times(T3, c))
        pull = add(given(F), add(times(-K, q), times(-D, v)))
        ad = times(i1 @ T1.T, add(pull, given(-M @ v_p @ S)))
        self.A, self.B = np.vstack([a, b[0], ad[0]]), np.vstack([np.zeros((n1, len(S))), b[1], ad[1]])
        inertial = add(times(T1, ad), given(v_p @ S))  # the acceleration but for massless motions
        bd = times(i2 @ T2.T, add(given(F @ S), add(times(-K, v), times(-D, inertial))))
        cd = times(i3 @ T3.T, add(given(F @ S @ S), times(-K, add(inertial, times(T2, bd)))))
        self.vd = add(inertial, add(times(T2, bd), times(T3, cd)))
        self.S = S
        residual = add(times(M, inertial), (-pull[0], -pull[1]))  # = G^T lam
        self.lam = times(np.linalg.pinv(train.G.T, rcond=SMALL), residual) if train.G.size else given(np.zeros((0, len(S))))

    def carried(self, x: Floats, z: Floats, h: float) -> Floats:
        if h == 0:
            return x
        whole = np.block([[self.A, self.B], [np.zeros((len(z), len(x))), self.S]])
        result: Floats = (expm(whole * h) @ np.concatenate([x, z]))[: len(x)]
        return result


Pair = tuple[Floats, Floats]


def add(one: Pair, other: Pair) -> Pair:
    return one[0] + other[0], one[1] + other[1]


def times(matrix: Floats, pair: Pair) -> Pair:
    return matrix @ pair[0], matrix @ pair[1]


# ---------------------------------------------------------------- what can be compared


@dataclass(frozen=True)
class Quantity:
    """A variable of gearlib's: its path, unit, and what it is of ``x`` and ``z`` (None: not determined)."""

    path: str
    unit: str
    rows: Pair


def quantities(solved: LinearTrain, stretch: Stretch) -> list[Quantity]:
    """Everything that both sides know, on one stretch."""
    found: list[Quantity] = []
    numbers = {id(r.part): k for k, r in enumerate(solved.rows)}
    zero: Pair = (np.zeros(stretch.A.shape[0]), np.zeros(stretch.B.shape[1]))

    def put(part: Part, variable: str, unit: str, pair: Pair) -> None:
        found.append(Quantity(f"{part.name}.{variable}", unit, pair))

    def of(row: Floats, pair: Pair) -> Pair:
        return row @ pair[0], row @ pair[1]

    def turning(part: Part, coefficients: Sequence[float], names: Sequence[str]) -> None:
        row = solved.spread(part, coefficients)
        for name, unit, pair in zip(names, ("rad", "rad/s", "rad/s2"), (stretch.q, stretch.v, stretch.vd), strict=False):
            if name:
                put(part, name, unit, of(row, pair))

    for part in solved.train.parts:
        kind, k = part.kind, numbers.get(id(part))
        lam: Pair = zero if k is None else (stretch.lam[0][k], stretch.lam[1][k])
        determined = k is not None and bool(solved.known[k])
        one = (1.0, -1.0)[: len(part.at)]
        if kind == "Inertia":
            turning(part, (1.0,), ("phi", "w", "a"))
            if determined:
                accelerates = of(solved.spread(part, (1.0,)), stretch.vd)
                whole = part.value("J") * accelerates[0], part.value("J") * accelerates[1]
                put(part, "flange_b.tau", "N.m", lam)
                put(part, "flange_a.tau", "N.m", (whole[0] - lam[0], whole[1] - lam[1]))
        elif kind in ("Spring", "Damper", "SpringDamper"):
            turning(part, (-1.0, 1.0), ("phi_rel", "w_rel"))
            row = solved.spread(part, (-1.0, 1.0))
            c, d, rest = part.value("c"), part.value("d"), part.value("phi_rel0")
            twist, rate = of(row, stretch.q), of(row, stretch.v)
            tau = c * twist[0] + d * rate[0], c * (twist[1] - rest * (np.arange(len(twist[1])) == 0)) + d * rate[1]
            put(part, "tau", "N.m", tau)
            put(part, "flange_a.tau", "N.m", (-tau[0], -tau[1]))
        elif kind in ("IdealGear", "IdealPlanetary", "TorqueSensor", "MultiSensor", "PowerSensor", "Disc"):
            if determined:
                for flange, coefficient in zip(part.flanges, solved.rows[k].coefficients, strict=True):  # type: ignore[index]
                    put(part, f"{flange}.tau", "N.m", (-coefficient * lam[0], -coefficient * lam[1]))
            if kind == "MultiSensor":
                turning(part, (1.0,), ("", "w"))
        elif kind in PRESCRIBED:
            if kind != "Fixed":
                turning(part, one, ("phi", "w"))
            if determined:
                put(part, "flange.tau", "N.m", (-lam[0], -lam[1]))
                if len(part.at) == 2:
                    put(part, "support.tau", "N.m", lam)
        elif kind == "LinearSpeedDependentTorque":
            turning(part, one, ("", "w"))
            rate = of(solved.spread(part, one), stretch.v)
            factor = part.value("tau_nominal") / part.value("w_nominal")
            put(part, "tau", "N.m", (factor * rate[0], factor * rate[1]))
        elif kind in ("AngleSensor", "SpeedSensor", "AccSensor"):
            names = {"AngleSensor": ("phi",), "SpeedSensor": ("", "w"), "AccSensor": ("", "w", "a")}[kind]
            turning(part, (1.0,), names)
        elif kind in ("RelativeStates", "RelAngleSensor", "RelSpeedSensor", "RelAccSensor"):
            names = {"RelAngleSensor": ("phi_rel",), "RelSpeedSensor": ("phi_rel", "w_rel")}.get(
                kind, ("phi_rel", "w_rel", "a_rel")
            )
            turning(part, (-1.0, 1.0), names)
    return found


def start_values(solved: LinearTrain) -> dict[str, float]:
    """Start values of all bodies, springs, dampers, prescribed motions and sensors of angles between; they agree with each other."""
    stretch, x, z = solved.system(0.0), solved.start(), solved.z.at(0.0)
    q, v = stretch.q[0] @ x + stretch.q[1] @ z, stretch.v[0] @ x + stretch.v[1] @ z
    v[np.abs(v) < 1e-11 * np.abs(v).max(initial=0.0)] = 0.0  # of what stands still, rounding
    alike = [row for row in solved.G if np.count_nonzero(row) == 2 and row.sum() == 0.0]
    for row in alike * len(
        alike
    ):  # what is rigidly one turns as one, beside nodes without inertia that turn a million times faster
        first, second = np.flatnonzero(row)
        if abs(v[first] - v[second]) < 1e-12 * np.abs(v).max():
            v[second] = v[first]
    values: dict[str, float] = {}
    for part in solved.train.parts:
        if part.kind in ("Inertia", "Kicked"):
            row = solved.spread(part, (1.0,))
            values[f"{part.name}.phi"] = float(row @ q)
            values[f"{part.name}.w"] = float(row @ v)
        elif part.kind in (*COMPLIANT, "RelativeStates", "RelAngleSensor", "RelSpeedSensor", "RelAccSensor"):
            row = solved.spread(part, (-1.0, 1.0))
            values[f"{part.name}.phi_rel"] = float(row @ q)
        elif part.kind in ("Speed", "ConstantSpeed", "Accelerate", "Position", "Move", "AngleSensor"):
            row = solved.spread(part, (1.0, -1.0)[: len(part.at)])
            values[f"{part.name}.phi"] = float(row @ q)
            if part.kind == "Accelerate":
                values[f"{part.name}.w"] = float(part.value("w_start"))
    return values
