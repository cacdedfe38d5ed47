"""Users' scenes: trains that somebody would model, as components, with equations by hand and references that share no code with gearlib.

The equations by hand are integrated by SciPy at a tolerance far below what is judged; linear ones by the matrix exponential over
each stretch between two points of their tables.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gearlib as gl
import gearparts as gp
from tests.benchmarks import user_motions as motions
from tests.benchmarks import user_shifts as shifts
from tests.benchmarks.user_motions import elasto_backlash
from tests.gearparts.msl_hybrid_examples import CoupledClutches

Floats = NDArray[np.float64]
c = gl.connect


@dataclass(frozen=True)
class EquationsByHand:
    """An initial-value problem: der(x) = rhs(t, x), from ``start``; the outputs are some of x, times ``signs``.

    No step of the reference leads across a corner of what drives the motion, and none is longer than ``longest`` (s).
    """

    rhs: Callable[..., list[Any] | Floats]
    start: Floats
    outputs: list[int]
    signs: Any = 1.0
    corners: tuple[float, ...] = ()
    longest: float = 1e-3
    series: bool = False  # whether rhs(t, x, sin) takes symbols, too, for a solver by Taylor series
    minutes: bool = False  # whether a run in Python takes minutes: such are not measured

    def solved(self, times: Floats) -> Floats:
        """The outputs, by SciPy at a tolerance far below what is judged."""
        ends = [float(times[0]), *(t for t in self.corners if times[0] < t < times[-1]), float(times[-1])]
        x, out = self.start, np.empty((len(times), len(self.start)))
        for begin, end in pairwise(ends):
            inside = (times >= begin) & (times <= end)
            found = solve_ivp(
                self.rhs, (begin, end), x, "DOP853", np.union1d(times[inside], end), rtol=3e-13, atol=1e-14, max_step=self.longest,
            )  # fmt: skip
            out[inside], x = found.y[:, np.searchsorted(found.t, times[inside])].T, found.y[:, -1]
        return out[:, self.outputs] * self.signs


@dataclass(frozen=True)
class UserScene:
    """A component, what drives it, and its reference."""

    title: str
    component: Callable[[], gl.Component]
    outputs: tuple[str, ...]
    times: Floats
    reference: Callable[[Floats], Floats]  # output times -> (samples, outputs)
    inputs: dict[str, Any] = field(default_factory=dict)
    by_hand: EquationsByHand | None = None
    start: dict[str, float] = field(default_factory=dict)

    def error(self, values: Floats, times: Floats | None = None) -> float:
        """Largest error of all outputs over their largest value; infinite where a value is not finite."""
        right = self.reference(self.times if times is None else times)
        found = float((np.abs(values - right) / np.abs(right).max(axis=0)).max())
        return found if math.isfinite(found) else math.inf


# ---------------------------------------------------------------- two bodies and a fan


class BodiesAndFan(gl.Component):
    """Motor and wheel on a shaft, started against a fan: the smallest train, on which what a run costs besides its steps is seen."""

    def assemble(self) -> list[Any]:
        self.torque, self.motor, self.wheel = gp.ConstantTorque(tau_constant=50.0), gp.Inertia(J=0.02), gp.Inertia(J=0.5)
        self.shaft = gp.SpringDamper(c=500.0, d=1.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-40.0, w_nominal=100.0)
        return [
            c(self.torque.flange, self.motor.flange_a), c(self.motor.flange_b, self.shaft.flange_a),
            c(self.shaft.flange_b, self.wheel.flange_a), c(self.wheel.flange_b, self.fan.flange),
        ]  # fmt: skip


def bodies_and_fan(t: Any, x: Any, sin: Any = math.sin) -> list[Any]:
    """Speeds of motor and wheel, twist of the shaft; the wheel turns forward only."""
    motor, wheel, twist = x.tolist()
    torque = 500 * twist + (motor - wheel)
    return [(50 - torque) / 0.02, (torque - 0.004 * wheel * wheel) / 0.5, motor - wheel]


# ---------------------------------------------------------------- two-stage gearbox


class TwoStageGearbox(gl.Component):
    """Motor, two stages with elastic teeth and three shafts, a load with a fan: lightly damped vibration of some kilohertz."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=50 + 5 * gl.sin(120 * gl.time))
        self.motor, self.pinion_1, self.wheel_1 = gp.Inertia(J=0.02), gp.Inertia(J=5e-4), gp.Inertia(J=1e-2)
        self.pinion_2, self.wheel_2, self.load = gp.Inertia(J=1e-3), gp.Inertia(J=0.05), gp.Inertia(J=2.0)
        self.shaft_1, self.shaft_2 = gp.SpringDamper(c=1e4, d=2.0), gp.SpringDamper(c=5e4, d=5.0)
        self.shaft_3 = gp.SpringDamper(c=8e4, d=10.0)
        self.mesh_1 = gp.ExternalMesh(r_a=0.03, r_b=0.09, c=2e8, d=1500.0)
        self.mesh_2 = gp.ExternalMesh(r_a=0.035, r_b=0.12, c=3e8, d=2500.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-400.0, w_nominal=30.0, torque_direction=False)
        return [
            c(self.torque.flange, self.motor.flange_a), c(self.motor.flange_b, self.shaft_1.flange_a),
            c(self.shaft_1.flange_b, self.pinion_1.flange_a), c(self.pinion_1.flange_b, self.mesh_1.flange_a),
            c(self.mesh_1.flange_b, self.wheel_1.flange_a), c(self.wheel_1.flange_b, self.shaft_2.flange_a),
            c(self.shaft_2.flange_b, self.pinion_2.flange_a), c(self.pinion_2.flange_b, self.mesh_2.flange_a),
            c(self.mesh_2.flange_b, self.wheel_2.flange_a), c(self.wheel_2.flange_b, self.shaft_3.flange_a),
            c(self.shaft_3.flange_b, self.load.flange_a), c(self.load.flange_b, self.fan.flange),
        ]  # fmt: skip


def gearbox(t: Any, x: Any, sin: Any = math.sin) -> list[Any]:
    """Speeds of the six bodies, then twists and deflections from the motor to the load, which turns forward only."""
    m, p1, g1, p2, g2, load, s1, q1, s2, q2, s3 = x.tolist()
    r1, r2, v1, v2 = m - p1, g1 - p2, 0.03 * p1 + 0.09 * g1, 0.035 * p2 + 0.12 * g2
    t1, t2, t3 = 1e4 * s1 + 2 * r1, 5e4 * s2 + 5 * r2, 8e4 * s3 + 10 * (g2 - load)
    f1, f2 = 2e8 * q1 + 1500 * v1, 3e8 * q2 + 2500 * v2
    return [
        (50 + 5 * sin(120 * t) - t1) / 0.02, (t1 - 0.03 * f1) / 5e-4, (-0.09 * f1 - t2) / 1e-2,
        (t2 - 0.035 * f2) / 1e-3, (-0.12 * f2 - t3) / 0.05, (t3 - 400 / 900 * load * load) / 2.0,
        r1, v1, r2, v2, g2 - load,
    ]  # fmt: skip


# ---------------------------------------------------------------- electric vehicle


class ElectricVehicle(gl.Component):
    """Motor, reduction, backlash in the driveline, half shaft, tyre, vehicle; the torque changes its sign and back."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=-30 + 90 * (1 + gl.sin(2 * gl.pi * 1.5 * gl.time)))
        self.motor, self.differential, self.wheel = gp.Inertia(J=0.04), gp.Inertia(J=0.05), gp.Inertia(J=2.0)
        self.vehicle = gp.Inertia(J=150.0)
        self.reduction = gp.IdealGear(ratio=9.0)
        self.gap = gp.ElastoBacklash(c=6e4, d=60.0, b=0.03)
        self.shaft, self.tyre = gp.SpringDamper(c=1.2e4, d=20.0), gp.SpringDamper(c=3e4, d=500.0)
        self.drag = gp.QuadraticSpeedDependentTorque(tau_nominal=-400.0, w_nominal=100.0, torque_direction=False)
        return [
            c(self.torque.flange, self.motor.flange_a), c(self.motor.flange_b, self.reduction.flange_a),
            c(self.reduction.flange_b, self.gap.flange_a), c(self.gap.flange_b, self.differential.flange_a),
            c(self.differential.flange_b, self.shaft.flange_a), c(self.shaft.flange_b, self.wheel.flange_a),
            c(self.wheel.flange_b, self.tyre.flange_a), c(self.tyre.flange_b, self.vehicle.flange_a),
            c(self.vehicle.flange_b, self.drag.flange),
        ]  # fmt: skip


def vehicle(t: float, x: Floats) -> list[float]:
    """Speeds of motor (reduced), differential, wheel and vehicle, then the twists of gap, shaft and tyre (second less first)."""
    m, d, w, v, gap, shaft, tyre = x.tolist()
    slip = d - m
    torque = elasto_backlash(gap, slip, 6e4, 60.0, 0.015)
    first, second = 1.2e4 * shaft + 20 * (w - d), 3e4 * tyre + 500 * (v - w)
    drive = -30 + 90 * (1 + math.sin(2 * math.pi * 1.5 * t))
    return [
        (9 * drive + torque) / (81 * 0.04), (first - torque) / 0.05, (second - first) / 2.0, (-second - 0.04 * v * abs(v)) / 150.0,
        slip, w - d, v - w,
    ]  # fmt: skip


# ---------------------------------------------------------------- crank train and wind turbine

POINTS = 10_000  # of each table of the crank train
CRANK_END, WIND_END = 0.5, 60.0


@cache
def cylinder(number: int) -> tuple[Floats, Floats]:
    """A gas torque of one cylinder, as measured: harmonics of the cycle and noise, at points of its own."""
    t = np.linspace(0.0, CRANK_END, POINTS) + (number - 2.5) * 1e-7
    phase = 2 * math.pi * 25 * t - number * 2 * math.pi / 3
    noise = np.random.default_rng(number).normal(size=POINTS)
    return t, 60 + sum(200 / k * np.sin(k * phase + k) for k in range(1, 9)) + noise


class CrankTrain(gl.Component):
    """Six throws with a measured torque each, damper, flywheel and a load that grows with the speed."""

    def assemble(self) -> list[Any]:
        self.throw = [gp.Inertia(J=0.02) for _ in range(6)]
        self.torque = [gp.Torque() for _ in range(6)]
        self.web = [gp.SpringDamper(c=8e5, d=30.0) for _ in range(6)]
        self.ring, self.rubber = gp.Inertia(J=0.01), gp.SpringDamper(c=2e4, d=8.0)
        self.flywheel = gp.Inertia(J=0.5)
        self.load = gp.LinearSpeedDependentTorque(tau_nominal=-400.0, w_nominal=150.0, torque_direction=False)
        return [
            c(self.ring.flange_b, self.rubber.flange_a), c(self.rubber.flange_b, self.throw[0].flange_a),
            *(c(torque.flange, throw.flange_a) for torque, throw in zip(self.torque, self.throw, strict=True)),
            *(c(throw.flange_b, web.flange_a) for throw, web in zip(self.throw, self.web, strict=True)),
            *(c(web.flange_b, throw.flange_a) for web, throw in zip(self.web[:-1], self.throw[1:], strict=True)),
            c(self.web[-1].flange_b, self.flywheel.flange_a), c(self.flywheel.flange_b, self.load.flange),
        ]  # fmt: skip


def torsional(J: list[float], stiffness: list[float], damping: list[float], drag: float) -> Floats:
    """A of a chain: speeds, then twists; the drag (N.m.s/rad) is on the last body."""
    n, inverse = len(J), np.diag(1.0 / np.array(J))
    D = np.eye(n - 1, n) - np.eye(n - 1, n, k=1)
    A = np.zeros((2 * n - 1, 2 * n - 1))
    A[:n, :n], A[:n, n:], A[n:, :n] = -inverse @ D.T @ np.diag(damping) @ D, -inverse @ D.T @ np.diag(stiffness), D
    A[n - 1, n - 1] -= drag / J[-1]
    return A


def through_points(A: Floats, B: Floats, tables: list[tuple[Floats, Floats]], times: Floats) -> Floats:
    """States of x' = A x + B u at the times, from rest; the inputs are straight between their points."""
    n, k = B.shape
    corners = np.unique(np.concatenate([times, *(t[(t > times[0]) & (t < times[-1])] for t, _ in tables)]))
    M = np.zeros((n + 2 * k, n + 2 * k))
    M[:n, :n], M[:n, n : n + k], M[n : n + k, n + k :] = A, B, np.eye(k)
    values = np.array([np.interp(corners, t, y) for t, y in tables])
    known: dict[float, Floats] = {}
    x, found = np.zeros(n), [np.zeros(n)]
    for i, h in enumerate(np.diff(corners).tolist()):
        key = float(f"{h:.9e}")  # equal intervals differ by rounding
        if key not in known:
            known[key] = expm(M * h)[:n]
        slope = (values[:, i + 1] - values[:, i]) / h
        x = known[key] @ np.concatenate([x, values[:, i], slope])
        found.append(x)
    return np.array(found)[np.searchsorted(corners, times)]


def crank_train(times: Floats) -> Floats:
    A = torsional([0.01, *[0.02] * 6, 0.5], [2e4, *[8e5] * 6], [8.0, *[30.0] * 6], 400 / 150)
    B = np.zeros((15, 6))
    B[np.arange(1, 7), np.arange(6)] = 1 / 0.02
    return through_points(A, B, [cylinder(k) for k in range(6)], times)[:, [0, 7]]


@cache
def gusts() -> tuple[Floats, Floats]:
    """A rotor torque of 400 points."""
    rng = np.random.default_rng(1)
    t = np.linspace(0.0, WIND_END, 400)
    return t, 1e6 * (1 + 0.2 * np.cumsum(rng.normal(size=400)) / 20) + 5e4 * np.sin(3 * 1.8 * t)


class WindTurbine(gl.Component):
    """Rotor with a measured torque, main shaft, gearbox, coupling and a generator that brakes in proportion to its speed."""

    def assemble(self) -> list[Any]:
        self.torque, self.rotor, self.gearbox = gp.Torque(), gp.Inertia(J=4e6), gp.IdealGear(ratio=90.0)
        self.main, self.first = gp.SpringDamper(c=1.6e8, d=2.5e5), gp.Inertia(J=1e4)
        self.coupling, self.generator = gp.SpringDamper(c=5e4, d=30.0), gp.Inertia(J=90.0)
        self.brake = gp.LinearSpeedDependentTorque(tau_nominal=-1.1e4, w_nominal=160.0, torque_direction=False)
        return [
            c(self.torque.flange, self.rotor.flange_a), c(self.rotor.flange_b, self.main.flange_a),
            c(self.main.flange_b, self.first.flange_a), c(self.first.flange_b, self.gearbox.flange_a),
            c(self.gearbox.flange_b, self.coupling.flange_a), c(self.coupling.flange_b, self.generator.flange_a),
            c(self.generator.flange_b, self.brake.flange),
        ]  # fmt: skip


def wind_turbine(times: Floats) -> Floats:
    """Reduced to the rotor's side: with ``ratio = w_a / w_b`` the generator turns 90 times slower than the rotor."""
    r = 1 / 90.0
    A = torsional([4e6, 1e4, 90.0 * r**2], [1.6e8, 5e4 * r**2], [2.5e5, 30.0 * r**2], 1.1e4 / 160 * r**2)
    B = np.zeros((5, 1))
    B[0, 0] = 1 / 4e6
    return through_points(A, B, [gusts()], times)[:, [0, 2]] * [1.0, r]


# ---------------------------------------------------------------- planets with backlash

GAP, SUN, PLANET, CARRIER_R, RING_R = 40e-6, 0.03, 0.0225, 0.0525, 0.075


class Planets(gl.Component):
    """A planetary set driven by its sun; the teeth of sun and planets have backlash and a stiffness that varies as they mesh."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=20 + 15 * gl.sin(300 * gl.time))
        self.sun, self.carrier = gp.Inertia(J=1e-3), gp.Inertia(J=0.1)
        self.planet = [gp.Inertia(J=2e-4) for _ in range(3)]
        self.kinematics = [gp.PlanetOnCarrier(r_p=PLANET, r_h=CARRIER_R) for _ in range(3)]
        self.inner = [
            gp.DetailedExternalMesh(
                backlash=True, stiffness="sinusoidal", c_amplitude=0.2, b=GAP, c=1e8, d=500.0, r_a=SUN, r_b=PLANET, z_a=24,
                phase0=-16 * math.pi * n,
            )
            for n in range(3)
        ]  # fmt: skip
        self.outer = [gp.InternalMesh(c=2e8, d=800.0, r_a=RING_R, r_b=PLANET) for _ in range(3)]
        self.ground = gp.Fixed()
        self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-60.0, w_nominal=60.0, torque_direction=False)
        links = [
            c(self.torque.flange, self.sun.flange_a), c(self.carrier.flange_b, self.load.flange),
            c(self.sun.flange_b, *(m.flange_a for m in self.inner)), c(self.ground.flange, *(m.flange_a for m in self.outer)),
            c(self.carrier.flange_a, *(k.carrier for k in self.kinematics)),
        ]  # fmt: skip
        for planet, kinematics, inner, outer in zip(self.planet, self.kinematics, self.inner, self.outer, strict=True):
            links += [
                c(planet.flange_a, kinematics.planet), c(kinematics.sun_side, inner.flange_b),
                c(kinematics.ring_side, outer.flange_b),
            ]  # fmt: skip
        return links


def planets(t: float, x: Floats) -> list[float]:
    """Speeds of sun, carrier, planet; deflections at sun and ring; phase. The three planets move alike: one stands for all."""
    s, h, p, inner, outer, phase = x.tolist()
    v_in = SUN * s + PLANET * p - CARRIER_R * h
    v_out = -(PLANET * p + CARRIER_R * h)
    stiffness = 1e8 * (1 + 0.2 * math.cos(phase))
    f_in = 0.0
    if inner >= GAP / 2:
        f_in = stiffness * (inner - GAP / 2) + 500.0 * v_in
    elif inner < -GAP / 2:
        f_in = stiffness * (inner + GAP / 2) + 500.0 * v_in
    f_out = 2e8 * outer + 800.0 * v_out
    return [
        (20 + 15 * math.sin(300 * t) - 3 * SUN * f_in) / 1e-3,
        (3 * CARRIER_R * (f_in + f_out) - 60 / 3600 * h * abs(h)) / 0.1,
        PLANET * (f_out - f_in) / 2e-4,
        v_in, v_out, 24 * s,
    ]  # fmt: skip


# ---------------------------------------------------------------- servo


class PositionControl(gl.Component):
    """A motor that turns its shaft to an angle that oscillates: proportional to the angle's and the speed's error."""

    flange = gp.Flange()
    k = gl.Parameter("N.m/rad", "gain", default=400.0)
    k_v = gl.Parameter("N.m.s/rad", "gain of the speed", default=0.6)
    phi = gl.Variable("rad", "angle")
    w = gl.Variable("rad/s", "speed")

    def equations(self) -> list[gl.Eq]:
        wanted = 0.5 * gl.sin(10 * gl.time)
        return [
            gl.Eq(self.phi, self.flange.phi),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(self.flange.tau, -self.k * (wanted - self.phi) - self.k_v * (5 * gl.cos(10 * gl.time) - self.w)),
        ]


class Servo(gl.Component):
    """A controlled motor with a bearing that sticks and slides, and a stiff, strongly damped coupling to its load."""

    def assemble(self) -> list[Any]:
        self.control, self.motor, self.load = PositionControl(), gp.Inertia(J=1e-3), gp.Inertia(J=3e-3)
        self.bearing = gp.BearingFriction(tau_pos=((0.0, 0.8), (1.0, 0.85)))
        self.coupling = gp.SpringDamper(c=2e4, d=40.0)
        self.stop = gp.LinearSpeedDependentTorque(tau_nominal=-0.02, w_nominal=1.0, torque_direction=False)
        return [
            c(self.control.flange, self.motor.flange_a), c(self.motor.flange_b, self.bearing.flange_a),
            c(self.bearing.flange_b, self.coupling.flange_a), c(self.coupling.flange_b, self.load.flange_a),
            c(self.load.flange_b, self.stop.flange),
        ]  # fmt: skip


def servo(times: Floats) -> Floats:
    """Angles of motor and load; sliding and sticking phases one after the other, with Radau's method."""

    def torque(t: float, phi: float, w: float, twist: float, w_load: float) -> float:
        control = 400 * (0.5 * math.sin(10 * t) - phi) + 0.6 * (5 * math.cos(10 * t) - w)
        return control - 2e4 * twist - 40 * (w - w_load)

    def rate(sense: int) -> Any:
        def f(t: float, x: Floats) -> list[float]:  # angle and speed of the motor, twist, speed of the load
            phi, w, twist, w_load = x.tolist()
            free = torque(t, phi, w, twist, w_load) - sense * 0.8 - (0.05 * w if sense else 0.0)
            coupling = 2e4 * twist + 40 * (w - w_load)
            return [w, free / 1e-3 if sense else 0.0, w - w_load, (coupling - 0.02 * w_load) / 3e-3]

        return f

    def breaks_away(t: float, x: Floats) -> float:
        return abs(torque(t, *x.tolist())) - 0.8

    def stops(t: float, x: Floats) -> float:
        return float(x[1])

    breaks_away.terminal = stops.terminal = True  # type: ignore[attr-defined]
    breaks_away.direction = 1.0  # type: ignore[attr-defined]
    t, x, sense = 0.0, np.zeros(4), 1 if torque(0.0, 0.0, 0.0, 0.0, 0.0) > 0.8 else 0
    out = np.zeros((len(times), 4))
    while t < times[-1]:
        stops.direction = -float(sense)  # type: ignore[attr-defined]
        found = solve_ivp(
            rate(sense), (t, times[-1]), x, "Radau", events=stops if sense else breaks_away, dense_output=True,
            rtol=1e-11, atol=1e-14,
        )  # fmt: skip
        inside = (times >= t) & (times <= found.t[-1])
        out[inside] = found.sol(times[inside]).T
        t, x = float(found.t[-1]), found.y[:, -1].copy()
        if found.status == 1:
            pull = torque(t, *x.tolist())
            if sense:
                x[1] = 0.0
                pull = torque(t, *x.tolist())
                sense = 0 if abs(pull) <= 0.8 else int(math.copysign(1, pull))
            else:
                sense = int(math.copysign(1, pull))
    return np.column_stack([out[:, 0], out[:, 0] - out[:, 2]])


def _kept(reference: Callable[[Floats], Floats]) -> Callable[[Floats], Floats]:
    """The reference, computed once for the same times."""
    known: dict[bytes, Floats] = {}

    def look_up(times: Floats) -> Floats:
        if times.tobytes() not in known:
            known[times.tobytes()] = reference(times)
        return known[times.tobytes()]

    return look_up


def _smooth(
    title: str, component: Any, outputs: tuple[str, ...], times: Floats, hand: EquationsByHand, start: dict[str, float] | None = None,
    reference: Callable[[Floats], Floats] | None = None,
) -> UserScene:  # fmt: skip
    """A scene whose equations by hand SciPy can integrate as they stand."""
    return UserScene(title, component, outputs, times, _kept(reference or hand.solved), by_hand=hand, start=start or {})


USERS: dict[str, UserScene] = {
    "fan": _smooth(
        "two bodies and a fan, 3 states", BodiesAndFan, ("motor.w", "wheel.w"), np.linspace(0, 0.2, 51),
        EquationsByHand(bodies_and_fan, np.zeros(3), [0, 1], series=True),
    ),
    "gearbox": _smooth(
        "two-stage gearbox, 11 states", TwoStageGearbox, ("motor.w", "load.w"), np.linspace(0, 2, 401),
        EquationsByHand(gearbox, np.zeros(11), [0, 5], series=True),
    ),
    "vehicle": _smooth(
        "electric vehicle with backlash, 7 states", ElectricVehicle, ("motor.w", "vehicle.w"), np.linspace(0, 3, 601),
        EquationsByHand(vehicle, np.zeros(7), [0, 3], [9.0, 1.0]),
    ),
    "crank train": UserScene(
        "crank train, six torque tables of 10 000 points", CrankTrain, ("ring.w", "flywheel.w"), np.linspace(0, CRANK_END, 501),
        _kept(crank_train), {f"torque[{k}].tau": gl.Table(*cylinder(k)) for k in range(6)},
    ),
    "wind turbine": UserScene(
        "wind turbine, torque table of 400 points", WindTurbine, ("rotor.w", "generator.w"), np.linspace(0, WIND_END, 601),
        _kept(wind_turbine), {"torque.tau": gl.Table(*gusts())},
    ),
    "planets": _smooth(
        "planets with backlash and varying stiffness", Planets, ("sun.w", "carrier.w"), np.linspace(0, 0.2, 401),
        EquationsByHand(planets, np.zeros(6), [0, 1]),
    ),
    "servo": UserScene(
        "stiff servo with friction", Servo, ("motor.phi", "load.phi"), np.linspace(0, 2, 401), _kept(servo),
    ),
    "hybrid": _smooth(
        "power-split hybrid with a controller", motions.HYBRID.Hybrid, ("engine.w", "car.w"), np.linspace(0, 14, 701),
        EquationsByHand(motions.hybrid, np.array([105.0, 0.0, 0.0]), [0, 1], 1.0, motions.HYBRID_CORNERS, 2e-2),
    ),
    "eight speeds": UserScene(
        "8-speed gearbox, two shifts", shifts.EIGHT.EightSpeeds, ("shaft.w", "car.w"), np.linspace(0, 8, 801),
        _kept(shifts.eight_speeds), shifts.eight_speeds_inputs(), start=shifts.eight_speeds_start(),
    ),
    "coupled clutches": UserScene(
        "coupled clutches", CoupledClutches, ("J1.w", "J2.w", "J3.w", "J4.w"), np.linspace(0, 1.2, 241), _kept(shifts.coupled_clutches),
    ),
    "dual clutch": UserScene(
        "dual-clutch gearbox, clutches engaging", shifts.DUAL.Gearbox, ("engine.w", "car.w"), np.linspace(0, 3, 601),
        _kept(shifts.dual_clutch),
    ),
    "loose wheel": _smooth(
        "loose wheel that rattles", lambda: motions.LOOSE.LooseWheel(shake=motions.SHAKE), ("wheel.w",),
        np.linspace(0, 0.3, 301),
        EquationsByHand(motions.loose_wheel, np.array(list(motions.LOOSE_START.values())[::-1]), [1], longest=1e-4),
        motions.LOOSE_START,
    ),
    "rattle": _smooth(
        "200 bodies with rattle, 399 states", motions.Rattle, ("body[0].w", "body[199].w"), np.linspace(0, 0.4, 401),
        EquationsByHand(motions.rattle, np.zeros(2 * motions.BODIES - 1), [0, motions.BODIES - 1]),
    ),
    "revolutions": _smooth(
        "1e5 revolutions", motions.ManyTurns, ("motor.w", "motor.phi"), np.linspace(0, 1000, 501),
        EquationsByHand(motions.many_turns, np.array([motions.CRUISE, motions.CRUISE, 0.0, 0.0]), [0, 2],
                        series=True, minutes=True), motions.MANY_START,
        motions.by_collocation,
    ),
}  # fmt: skip
