"""Random linear trains, as data: rigid loops that close and some that do not, parts across one shaft, zeros, sources, sensors."""

from __future__ import annotations

import math
import random
from typing import Any

from tests.stress.described import Part, Signal, Train
from tests.stress.linear_reference import LinearTrain, Unclear


class Draw:
    """Grows a train. Each node has a turn, its speed where all turn rigidly, and an angle at which rigid loops close."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.turn: list[float] = []
        self.angle: list[float] = []
        self.parts: list[Part] = []
        self.swing = Signal(
            amplitude=self.rng.uniform(0.1, 2.0), omega=self.rng.uniform(1.0, 20.0), phase=self.rng.uniform(0, 3)
        )
        self.pace = self.rng.choice([0.0, self.rng.uniform(-5, 5)])

    def node(self, turn: float | None = None, angle: float | None = None) -> int:
        rng = self.rng
        self.turn.append(rng.choice([-1, 1]) * rng.choice([1.0, 0.5, rng.uniform(0.4, 2.5)]) if turn is None else turn)
        self.angle.append(rng.choice([0.0, rng.uniform(-1, 1)]) if angle is None else angle)
        return len(self.turn) - 1

    def any(self, new: float = 0.2) -> int:
        if not self.turn or self.rng.random() < new:
            return self.node()
        return self.rng.randrange(len(self.turn))

    def alike(self, node: int) -> int:
        """A node that may be joined rigidly to another one: itself, one that turns alike, or a new one."""
        same = [k for k in range(len(self.turn)) if self.turn[k] == self.turn[node] and self.angle[k] == self.angle[node]]
        return self.rng.choice([*same, self.node(self.turn[node], self.angle[node])] if self.rng.random() < 0.7 else same)

    def support(self, share: float = 0.25) -> tuple[int, ...]:
        return (self.any(0.1),) if self.rng.random() < share else ()

    def size(self, low: float, high: float, zero: float = 0.12) -> float:
        return 0.0 if self.rng.random() < zero else float(10 ** self.rng.uniform(low, high))

    def signal(self, steps: bool = True) -> Signal:
        rng = self.rng
        kind = rng.choice(["constant", "wave", "ramp", "steps"] if steps else ["constant", "wave", "ramp"])
        signal: dict[str, Any] = {"bias": rng.uniform(-5, 5)}
        if kind == "wave":
            signal |= {"amplitude": rng.uniform(0.5, 5), "omega": rng.uniform(1, 30), "phase": rng.uniform(0, 6)}
        if kind == "ramp":
            signal |= {"slope": rng.uniform(-5, 5)}
        if kind == "steps":
            signal |= {"steps": tuple((rng.uniform(0.05, 0.9), rng.uniform(-5, 5)) for _ in range(rng.randint(1, 2)))}
        return Signal(bound=rng.random() < 0.5, **signal)

    def put(self, kind: str, at: tuple[int, ...], **values: Any) -> None:
        name = f"{kind[0].lower()}{kind[1:]}{sum(p.kind == kind for p in self.parts)}"
        self.parts.append(Part(name, kind, at, tuple(values.items())))

    def train(self) -> Train:
        rng = random.Random(len(self.parts))
        angles = tuple(angle + rng.uniform(-0.2, 0.2) for angle in self.angle)
        return Train(tuple(self.parts), angles, tuple(rng.uniform(-3, 3) for _ in self.angle))

    # ------------------------------------------------------------ parts

    def body(self) -> None:
        first = self.any(0.7)
        self.put("Inertia", (first, self.alike(first)), J=self.size(-2, 1))

    def elastic(self) -> None:
        rng, at = self.rng, (self.any(), self.any())
        kind = rng.choice(["Spring", "Damper", "SpringDamper", "SpringDamper"])
        values = {"c": self.size(0, 4)} if kind != "Damper" else {}
        values |= {"d": self.size(-2, 1)} if kind != "Spring" else {}
        if kind != "Damper" and rng.random() < 0.3:
            values["phi_rel0"] = rng.uniform(-0.5, 0.5)
        self.put(kind, at, **values)

    def gear(self) -> None:
        rng, a, b, support = self.rng, self.any(0.1), self.any(0.4), self.support()
        turns = [self.turn[k] - (self.turn[support[0]] if support else 0.0) for k in (a, b)]
        angles = [self.angle[k] - (self.angle[support[0]] if support else 0.0) for k in (a, b)]
        if rng.random() < 0.05:
            ratio = rng.uniform(-3, 3)
        elif all(abs(t) > 0.1 for t in turns) and abs(angles[0] * turns[1] - angles[1] * turns[0]) < 1e-12:
            ratio = turns[0] / turns[1]
        elif abs(turns[0]) > 0.1:
            ratio = rng.choice([-1.0, 2.0, 0.5, rng.uniform(0.3, 3)])
            base = (self.turn[support[0]], self.angle[support[0]]) if support else (0.0, 0.0)
            b = self.node(base[0] + turns[0] / ratio, base[1] + angles[0] / ratio)
        else:
            return
        self.put("IdealGear", (a, b, *support), ratio=ratio)

    def planetary(self) -> None:
        rng, ratio = self.rng, self.rng.uniform(0.5, 4.0)
        sun, carrier = self.any(0.4), self.any(0.3)
        turn = ((1 + ratio) * self.turn[carrier] - self.turn[sun]) / ratio
        angle = ((1 + ratio) * self.angle[carrier] - self.angle[sun]) / ratio
        ring = self.node(turn, angle)
        if rng.random() < 0.3:  # beside existing nodes; at times of a ratio that closes the loop
            other = self.any(0.0)
            ways = self.turn[sun] - self.turn[carrier], self.turn[carrier] - self.turn[other]
            if all(abs(w) > 0.1 for w in ways) and abs(ways[0] / ways[1] + 1) > 0.1:
                ring, ratio = other, ways[0] / ways[1]
        self.put("IdealPlanetary", (sun, carrier, ring), ratio=ratio)

    def source(self) -> None:
        rng = self.rng
        kind = rng.choice(["Torque", "Torque", "Torque", "ConstantTorque", "TorqueStep", "Torque2", "Torque2"])
        at = (self.any(0.05), *self.support()) if kind != "Torque2" else (self.any(0.05), self.any(0.05))
        if kind in ("Torque", "Torque2"):
            self.put(kind, at, tau=self.signal())
        elif kind == "ConstantTorque":
            self.put(kind, at, tau_constant=rng.uniform(-5, 5))
        else:
            self.put(
                kind, at, step_torque=rng.uniform(-5, 5), offset_torque=rng.choice([0.0, 1.0]), start_time=rng.uniform(0.1, 0.8)
            )

    def load(self) -> None:
        self.put(
            "LinearSpeedDependentTorque", (self.any(0.05), *self.support()), tau_nominal=-self.rng.uniform(0.1, 5),
            w_nominal=self.rng.uniform(0.5, 5), torque_direction=False,
        )  # fmt: skip

    def motion(self) -> None:
        rng, at = self.rng, (self.any(0.1), *self.support(0.3))
        turn = self.turn[at[0]] - (self.turn[at[1]] if len(at) > 1 else 0.0)
        angle = self.angle[at[0]] - (self.angle[at[1]] if len(at) > 1 else 0.0)
        if rng.random() < 0.1:
            turn, angle = turn + rng.uniform(-1, 1), angle + rng.choice([0.0, 1.0])
        kind = rng.choice(["Fixed", "ConstantSpeed", "Speed", "Position", "Accelerate", "Move"])
        wave = Signal(
            amplitude=turn * self.swing.amplitude, omega=self.swing.omega, phase=self.swing.phase, bias=turn * self.pace
        )
        if kind == "Fixed":
            self.put(kind, at[:1], phi0=self.angle[at[0]] if rng.random() < 0.9 else rng.uniform(-1, 1))
        elif kind == "ConstantSpeed":
            self.put(kind, at, w_fixed=turn * self.pace)
        elif kind == "Speed":
            self.put(kind, at, w_ref=wave)
        elif kind == "Accelerate":
            self.put(
                kind, at, a_ref=Signal(bias=turn * self.pace, amplitude=turn, omega=self.swing.omega), w_start=turn * self.pace
            )
        else:
            start = wave.amplitude * math.sin(wave.phase)
            self.put(kind, at, phi_ref=Signal(angle - start, wave.bias, wave.amplitude, wave.omega, wave.phase))

    def rigid(self) -> None:
        a = self.any(0.05)
        kind = self.rng.choice(["TorqueSensor", "MultiSensor", "PowerSensor", "Disc", "Disc"])
        if kind == "Disc":
            b = self.any(0.5)
            if self.turn[a] != self.turn[b]:
                b = self.node(self.turn[a])
            self.put(kind, (a, b), delta_phi=self.angle[b] - self.angle[a])
        else:
            self.put(kind, (a, self.alike(a)))

    def sensor(self) -> None:
        kind = self.rng.choice(
            ["AngleSensor", "SpeedSensor", "AccSensor", "RelAngleSensor", "RelSpeedSensor", "RelAccSensor", "RelativeStates"]
        )
        self.put(kind, (self.any(0),) if kind in ("AngleSensor", "SpeedSensor", "AccSensor") else (self.any(0), self.any(0)))


def linear_train(seed: int) -> Train:
    """A random train of two to some fifteen parts."""
    draw = Draw(seed)
    rng = draw.rng
    for _ in range(rng.randint(1, 4)):
        draw.body()
    kinds = rng.choices(
        [draw.body, draw.elastic, draw.gear, draw.planetary, draw.source, draw.load, draw.motion, draw.rigid, draw.sensor],
        [2, 5, 3, 1.2, 3, 1, 1, 1, 1],
        k=rng.randint(1, 10),
    )
    for put in kinds:
        put()
    while rng.random() < 0.97:  # what nothing holds gets a body, or a damper and a spring to what stands still
        loose = undetermined(draw.train())
        if loose is None:
            break
        if rng.random() < 0.6:
            draw.put("Inertia", (loose, draw.alike(loose)), J=draw.size(-2, 1, zero=0))
        else:
            draw.put("SpringDamper", (loose, draw.any()), c=draw.size(0, 4), d=draw.size(-2, 1))
    return draw.train()


def undetermined(train: Train) -> int | None:
    """A node that moves without inertia, damping or stiffness, if there is one."""
    try:
        return LinearTrain(train).loose
    except Unclear:
        return None
