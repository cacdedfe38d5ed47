"""Steady states: chains of shafts with clutches, backlash, friction, meshes and losses, under constant torques or at a given speed.

There is no formula for them, but a definition: a steady state is where a long run ends. The run goes on until nothing accelerates;
where it does not come to that, a train is not judged.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import gearlib as gl
from tests.stress.described import Model, Part, Train
from tests.stress.verdicts import RIGHT, UNCLEAR, WRONG, Verdict, attempted

LINKS = (
    "spring", "springs", "disc", "ideal", "lossy", "mesh", "meshgap", "backlash", "clutch", "slipping", "cubic", "shaft", "coupling",
    "planetary", "gearbox", "bearing",
)  # fmt: skip
RUBBING = (
    "LossyGear",
    "Gearbox",
    "Clutch",
    "BearingFriction",
)  # may keep torques at rest that depend on how the train came there
LOSSES = ((0.0, 0.95, 0.93, 0.1, 0.1),)
LONGEST = 3000.0  # s
SETTLED = 1e-7  # of the fastest speed, per second


@dataclass
class Chain:
    """A chain that grows: bodies on the nodes 0, 1, 2 ..., links between each and the next."""

    rng: random.Random
    parts: list[Part] = field(default_factory=list)
    held: int = 100  # nodes that stand still

    def put(self, kind: str, at: tuple[int, ...], **values: Any) -> None:
        number = sum(p.kind == kind for p in self.parts)
        self.parts.append(Part(f"{kind[0].lower()}{kind[1:]}{number}", kind, at, tuple(values.items())))

    def still(self) -> int:
        self.held += 1
        self.put("Fixed", (self.held,))
        return self.held

    def link(self, kind: str, a: int, b: int) -> None:
        rng, at = self.rng, (a, b)
        c, d, n = 10 ** rng.uniform(2, 4), 10 ** rng.uniform(-0.5, 1), rng.uniform(0.5, 3)
        signed = n * rng.choice([-1, 1])
        flanks = {"r_a": 0.05, "r_b": 0.05 * n, "c": 1e7, "d": 3000.0}
        match kind:
            case "spring":
                self.put("SpringDamper", at, c=c, d=d)
            case "springs":
                self.put("SpringDamper", at, c=c, d=d)
                self.put("Spring", at, c=c / 3)
                self.put("Damper", at, d=d)
            case "disc":
                self.put("Disc", at, delta_phi=rng.uniform(-1, 1))
            case "ideal":
                self.put("IdealGear", at, ratio=signed)
            case "lossy":
                self.put("LossyGear", at, ratio=signed, loss_table=LOSSES)
            case "mesh":
                self.put("DetailedExternalMesh", at, **flanks)
            case "meshgap":
                self.put("DetailedExternalMesh", at, **flanks, backlash=True, b=1e-4)
            case "backlash":
                self.put("ElastoBacklash", at, c=c, d=d, b=0.05)
            case "clutch":
                self.put("Clutch", at, fn_max=1e4, f_normalized=1.0)
            case "slipping":
                self.put("Clutch", at, fn_max=rng.uniform(1, 10), f_normalized=1.0)
                self.put("Damper", at, d=d)
            case "cubic":
                self.put("CubicSpringDamper", at, c=c, c_3=10 * c, d=d)
            case "shaft":
                self.put("TorsionalShaft", at, segments=3, J=0.1, c=c, d=d / 10)
            case "coupling":
                self.put("ElasticCoupling", at, J_a=0.01, J_b=0.02, c=c, d=d, element="backlash", b=0.02)
            case "planetary":
                self.put("IdealPlanetary", (a, b, self.still()), ratio=n + 1)
            case "gearbox":
                self.put("Gearbox", at, ratio=signed, c=c, d=d, b=0.03, loss_table=LOSSES)
            case "bearing":
                self.put("BearingFriction", at, tau_pos=((0.0, 0.3), (10.0, 0.5)))

    def load(self, node: int) -> None:
        rng = self.rng
        weakest = {"tau_nominal": -rng.uniform(1, 5), "w_nominal": rng.uniform(3, 20), "torque_direction": False}
        match rng.choice(["damper", "linear", "quadratic"]):
            case "damper":
                self.put("Damper", (node, self.still()), d=rng.uniform(0.1, 1))
            case "linear":
                self.put("LinearSpeedDependentTorque", (node,), **weakest)
            case "quadratic":
                self.put("QuadraticSpeedDependentTorque", (node,), **weakest)


def steady_train(seed: int) -> Train:
    """A chain of two to five bodies with a torque or a given speed at one end, and loads at the other and elsewhere."""
    rng = random.Random(seed)
    chain, links = Chain(rng), rng.choices(LINKS, k=rng.randint(1, 4))
    for node in range(len(links) + 1):
        chain.put("Inertia", (node, node), J=10 ** rng.uniform(-2, 0))
    for node, kind in enumerate(links):
        chain.link(kind, node, node + 1)
    if rng.random() < 0.2:
        chain.put("ConstantSpeed", (0,), w_fixed=rng.uniform(1, 30) * rng.choice([-1, 1]))
    else:
        chain.put("ConstantTorque", (0,), tau_constant=rng.uniform(2, 20))
    for node in sorted({len(links), rng.randint(0, len(links))}):
        chain.load(node)
    return Train(tuple(chain.parts), (0.0,), (0.0,))


def judge_steady(train: Train, seed: int = 0) -> Verdict:
    """Whether ``start="steady"`` is where a long run ends, and stays there."""
    return attempted(lambda: _run(train, random.Random(seed).choice([0, seed + 1])), None)


def _run(train: Train, order: int) -> Verdict:
    bodies = [f"{p.name}.w" for p in train.parts if p.kind == "Inertia"]
    twisted = [
        f"{p.name}.tau" for p in train.parts if p.kind in ("Spring", "SpringDamper", "ElastoBacklash", "CubicSpringDamper")
    ]
    if any(p.kind in RUBBING for p in train.parts):
        twisted = []
    names = [*bodies, *twisted]
    system = gl.compile(Model(train=train, order=order), [*names, *(f"der({n})" for n in bodies)])
    found = system.simulate(1.0, start="steady", samples=3, rtol=1e-8)
    end = system.simulate(30.0, samples=2, method="ida", rtol=1e-8)
    while True:
        size = max(abs(end[n][-1]) for n in bodies)
        left = max(abs(end[f"der({n})"][-1]) for n in bodies)
        if left <= SETTLED * max(size, 1e-3):
            break
        if end.time[-1] > LONGEST:
            return Verdict(UNCLEAR, f"a long run has not settled | {left:.1e} rad/s2")
        end = system.simulate(3 * float(end.time[-1]), samples=2, start=end, method="ida", rtol=1e-8)
    pull = max([1e-3, *(abs(end[n][-1]) for n in twisted)])
    for name in names:
        right, slack = end[name][-1], 1e-4 * (pull if name in twisted else max(size, 1e-3))
        if not np.abs(found[name] - right).max() <= slack:
            return Verdict(
                WRONG, f"{name} is {found[name]} in the steady state, order {order}; the long run ends at {right:.8g}"
            )
    return Verdict(RIGHT)
