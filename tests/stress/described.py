"""Trains as data: what gearlib's model builder and the references written by hand both read.

A train is a list of parts whose flanges lie on numbered nodes. Its printed form reproduces it, and parts can be dropped.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gearlib as gl
import gearparts as gp

Floats = NDArray[np.float64]

FLANGES = {
    **dict.fromkeys(
        [
            "Inertia", "Disc", "Spring", "Damper", "SpringDamper", "ElastoBacklash", "ElastoBacklash2", "Clutch", "OneWayClutch",
            "Torque2", "RelativeStates", "RelAngleSensor", "RelSpeedSensor", "RelAccSensor", "TorqueSensor", "PowerSensor",
            "MultiSensor", "DetailedExternalMesh", "CubicSpringDamper", "TorsionalShaft", "ElasticCoupling", "Gearbox",
        ],
        ("flange_a", "flange_b"),
    ),
    **dict.fromkeys(["IdealGear", "LossyGear", "BearingFriction", "Brake"], ("flange_a", "flange_b", "support")),
    "IdealPlanetary": ("sun", "carrier", "ring"),
    **dict.fromkeys(["Fixed", "AngleSensor", "SpeedSensor", "AccSensor", "Switched", "Kicked"], ("flange",)),
    **dict.fromkeys(
        [
            "Torque", "ConstantTorque", "TorqueStep", "LinearSpeedDependentTorque", "QuadraticSpeedDependentTorque", "ConstantSpeed",
            "Speed", "Position", "Accelerate", "Move",
        ],
        ("flange", "support"),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Signal:
    """``bias + slope t + amplitude sin(omega t + phase)``, and steps: heights that are added from moments on."""

    bias: float = 0.0
    slope: float = 0.0
    amplitude: float = 0.0
    omega: float = 1.0
    phase: float = 0.0
    steps: tuple[tuple[float, float], ...] = ()
    bound: bool = True

    def __call__(self, t: Any) -> Any:
        t = np.asarray(t, float)
        smooth = self.bias + self.slope * t + self.amplitude * np.sin(self.omega * t + self.phase)
        return smooth + sum(height * (t >= moment) for moment, height in self.steps)

    def expression(self) -> Any:
        """As a function of gearlib's time."""
        smooth: Any = self.bias
        if self.slope:
            smooth = smooth + self.slope * gl.time
        if self.amplitude:
            smooth = smooth + self.amplitude * gl.sin(self.omega * gl.time + self.phase)
        for moment, height in self.steps:
            smooth = smooth + gl.Piecewise((height, gl.time >= moment), (0, True))
        return smooth

    def rate(self) -> Signal:
        """The derivative of a signal without steps."""
        return Signal(bias=self.slope, amplitude=self.amplitude * self.omega, omega=self.omega, phase=self.phase + np.pi / 2)

    def given(self, t_end: float) -> Any:
        """As the value of an unbound input: a number, a table, or a function."""
        if not (self.amplitude or self.slope or self.steps):
            return self.bias
        if self.amplitude:
            return self
        times = [0.0, *(moment for step in sorted(self.steps) for moment in (step[0], step[0])), t_end]
        smooth = [self.bias + self.slope * t for t in times]
        heights = np.repeat(np.cumsum([0.0, *(height for _, height in sorted(self.steps))]), 2)
        return gl.Table(times, np.add(smooth, heights))


@dataclass(frozen=True)
class Part:
    """A component, the nodes of its flanges (fewer than it could have: no support), and its values."""

    name: str
    kind: str
    at: tuple[int, ...]
    values: tuple[tuple[str, Any], ...] = ()

    @property
    def flanges(self) -> tuple[str, ...]:
        return FLANGES[self.kind][: len(self.at)]

    @cached_property
    def _by_name(self) -> dict[str, Any]:
        return dict(self.values)

    def value(self, name: str, default: Any = 0.0) -> Any:
        return self._by_name.get(name, default)

    def signals(self) -> Iterator[tuple[str, Signal]]:
        return ((name, value) for name, value in self.values if isinstance(value, Signal))


@dataclass(frozen=True)
class Train:
    """Parts, wanted start angles and speeds of the nodes (a reference makes them consistent), and the length of the run."""

    parts: tuple[Part, ...]
    angles: tuple[float, ...]
    speeds: tuple[float, ...]
    t_end: float = 1.0

    def without(self, name: str) -> Train:
        return replace(self, parts=tuple(p for p in self.parts if p.name != name))

    def part(self, name: str) -> Part:
        return next(p for p in self.parts if p.name == name)

    def unbound(self) -> dict[str, Any]:
        """Values of the inputs that are bound to nothing."""
        return {f"{p.name}.{n}": s.given(self.t_end) for p in self.parts for n, s in p.signals() if not s.bound}

    def zeros(self) -> tuple[str, ...]:
        """Parameters that are zero."""
        return tuple(f"{p.name}.{n}" for p in self.parts for n, v in p.values if n in ("J", "c", "d") and v == 0)


class Switched(gl.Component):
    """A torque that a speed switches on and off, with a dead zone between: a controller of two points."""

    flange = gp.Flange("driven shaft")
    tau_on = gl.Parameter("N.m", "torque while it is on")
    w_low = gl.Parameter("rad/s", "speed below which it goes on")
    w_high = gl.Parameter("rad/s", "speed above which it goes off")
    w = gl.Variable("rad/s", "speed", state="avoid")
    on = gl.Discrete("whether the torque acts", start=0.0)
    count = gl.Discrete("how often it went on", start=0.0)

    def equations(self) -> list[Any]:
        on = gl.Piecewise((1, self.w < self.w_low), (0, self.w > self.w_high), (gl.pre(self.on), True))
        return [
            gl.Eq(self.w, gl.der(self.flange.phi)),
            gl.Eq(self.on, on),
            gl.Eq(self.flange.tau, -gl.Piecewise((self.tau_on, gl.holds(self.on)), (0, True))),
            gl.When(gl.holds(self.on), gl.Eq(self.count, gl.pre(self.count) + 1)),
        ]


class Kicked(gl.Component):
    """A body that turns back at a stop, and that is struck at a moment: its speed is set anew."""

    flange = gp.Flange("shaft")
    J = gl.Parameter("kg.m2", "moment of inertia", min=0)
    phi_stop = gl.Parameter("rad", "angle of the stop")
    restitution = gl.Parameter("1", "speed after over speed before", default=0.5)
    moment = gl.Parameter("s", "when it is struck")
    kick = gl.Parameter("rad/s", "what its speed gains then")
    phi = gl.Variable("rad", "angle", state="prefer")
    w = gl.Variable("rad/s", "speed", state="prefer")
    hits = gl.Discrete("how often it met the stop", start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(self.phi, self.flange.phi),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(self.J * gl.der(self.w), self.flange.tau),
            gl.When(
                self.phi > self.phi_stop,
                gl.reinit(self.w, -self.restitution * self.w),
                gl.Eq(self.hits, gl.pre(self.hits) + 1),
            ),
            gl.When(gl.time >= self.moment, gl.reinit(self.w, self.w + self.kick)),
        ]


OWN: dict[str, type[gl.Component]] = {"Switched": Switched, "Kicked": Kicked}


class Model(gl.Component):
    """A described train as a component; ``order`` is the seed of the order in which parts are made and connected."""

    train = gl.Structural(None)
    order = gl.Structural(0)

    def assemble(self) -> list[Any]:
        train: Train = self.train
        shuffle = random.Random(self.order)
        parts = list(train.parts)
        if self.order:
            shuffle.shuffle(parts)
        ends: dict[int, list[tuple[str, str]]] = {}
        for part in parts:
            setattr(self, part.name, made(part))
            for flange, node in zip(part.flanges, part.at, strict=True):
                ends.setdefault(node, []).append((part.name, flange))
        links = []
        for sharing in ends.values():
            if self.order:
                shuffle.shuffle(sharing)
            links += connected(sharing, shuffle if self.order else None)
        if self.order:
            shuffle.shuffle(links)
        return [gl.connect(*(getattr(getattr(self, name), flange) for name, flange in link)) for link in links]


def made(part: Part) -> gl.Component:
    """The component that a part describes."""
    values: dict[str, Any] = {}
    for name, value in part.values:
        if not isinstance(value, Signal):
            values[name] = value
        elif value.bound:
            values[name] = value.expression()
    values.pop("w_start", None)  # of a prescribed acceleration: a start value
    if part.kind in ("Speed", "Position"):
        values["exact"] = True
    if part.kind == "Move":
        values |= {
            "w_ref": part.value("phi_ref").rate().expression(),
            "a_ref": part.value("phi_ref").rate().rate().expression(),
        }
    if "support" in FLANGES[part.kind] and len(part.at) == len(FLANGES[part.kind]):
        values["use_support"] = True
    kind: Callable[..., gl.Component] = OWN.get(part.kind) or getattr(gp, part.kind)
    return kind(**values)


def connected(ends: list[tuple[str, str]], shuffle: random.Random | None) -> list[tuple[tuple[str, str], ...]]:
    """Ways to connect the flanges of a node: all at once, or pairs that form a tree."""
    if len(ends) < 2:
        return []
    if shuffle is None or shuffle.random() < 0.3:
        return [tuple(ends)]
    pairs = [(ends[shuffle.randrange(k)], ends[k]) for k in range(1, len(ends))]
    return [pair if shuffle.random() < 0.5 else pair[::-1] for pair in pairs]


def shrunk(train: Train, fails: Callable[[Train], bool]) -> Train:
    """A train that still fails, with as many parts dropped, supports taken away and values made simple as possible."""
    smaller = True
    while smaller:
        smaller = False
        for name in [p.name for p in train.parts]:
            fewer = train.without(name)
            if fewer.parts and fails(fewer):
                train, smaller = fewer, True
        for part in train.parts:
            for simple in simpler(part):
                changed = replace(train, parts=tuple(simple if p is part else p for p in train.parts))
                if fails(changed):
                    train, smaller = changed, True
                    break
    for rounded in (tuple(0.0 for _ in train.angles), tuple(round(a, 1) for a in train.angles)):
        if rounded != train.angles and fails(replace(train, angles=rounded)):
            train = replace(train, angles=rounded)
            break
    for rounded in (tuple(0.0 for _ in train.speeds), tuple(round(a, 1) for a in train.speeds)):
        if rounded != train.speeds and fails(replace(train, speeds=rounded)):
            train = replace(train, speeds=rounded)
            break
    return train


def simpler(part: Part) -> Iterator[Part]:
    """Parts that say less: without support, with a number for a signal, with rounder numbers."""
    if "support" in FLANGES[part.kind] and len(part.at) == len(FLANGES[part.kind]):
        yield replace(part, at=part.at[:-1])
    for k, (name, value) in enumerate(part.values):
        replaced: list[Any] = []
        if isinstance(value, Signal):
            plain = Signal(bias=1.0, bound=value.bound)
            replaced = [
                s
                for s in (plain, replace(value, bound=True), replace(value, steps=()), replace(value, amplitude=0.0))
                if s != value
            ]
        elif isinstance(value, float) and value != round(value):
            replaced = [float(round(value)) or 1.0, round(value, 1)]
        for new in replaced:
            if new != value:
                yield replace(part, values=(*part.values[:k], (name, new), *part.values[k + 1 :]))
