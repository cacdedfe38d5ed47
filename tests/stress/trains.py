"""Random trains that keep a ledger: what came in, what was lost, so that energy can be audited."""

from __future__ import annotations

import random
from functools import cache
from typing import Any

import numpy as np

import gearlib as gl
import gearparts as gp

c = gl.connect


class RandomTrain(gl.Component):
    """Bodies joined one after another by shafts, meshes, gears and planetary sets; elastic loops; second gears and sets beside
    others, which are redundant; a fan; a torque that swings.

    ``work`` is the energy that came in less what dampers and fans took; ``stored`` is what bodies, shafts and meshes hold.
    """

    seed = gl.Structural(0, "of what is joined to what, and how")
    order = gl.Structural(0, "seed of the order in which parts are made and connected")
    amplitude = gl.Parameter("N.m", "of the driving torque", default=10.0)
    omega = gl.Parameter("rad/s", "of the driving torque", default=20.0)
    work = gl.Variable("J", "energy brought in, less losses", nominal=1.0)
    stored = gl.Variable("J", "kinetic and elastic energy")

    def assemble(self) -> list[Any]:
        bodies, joints = blueprint(self.seed)
        parts: dict[str, Any] = {f"body_{i}": lambda: gp.Inertia(J=1.0) for i in range(bodies)}
        parts["drive"] = lambda: gp.Torque(tau=self.amplitude * (1 + gl.sin(self.omega * gl.time)))
        parts["fan"] = lambda: gp.QuadraticSpeedDependentTorque(tau_nominal=-0.05, w_nominal=1.0, torque_direction=False)
        links = [("drive.flange", "body_0.flange_a"), ("fan.flange", f"body_{bodies - 1}.flange_b")]
        for k, (kind, ends) in enumerate(joints):
            name = f"{kind}_{k}"
            parts[name] = MAKE[kind]
            for flange, body in zip(FLANGES[kind], ends, strict=True):
                links.append((f"{name}.{flange}", f"body_{body}.flange_b"))
        shuffle, names = random.Random(self.order), list(parts)
        if self.order:
            shuffle.shuffle(names)
            shuffle.shuffle(links)
        for name in names:
            setattr(self, name, parts[name]())
        return [c(*(_port(self, end) for end in (pair if shuffle.random() < 0.5 else pair[::-1]))) for pair in links]

    def equations(self) -> list[gl.Eq]:
        bodies, joints = blueprint(self.seed)
        last = getattr(self, f"body_{bodies - 1}")
        first: Any = self.body_0
        stored: Any = 0
        power = self.drive.tau * first.w - self.fan.flange.tau * last.w
        for i in range(bodies):
            body = getattr(self, f"body_{i}")
            stored = stored + body.J * body.w**2 / 2
        for k, (kind, _) in enumerate(joints):
            part = getattr(self, f"{kind}_{k}")
            if kind == "shaft":
                stored, power = stored + part.c * part.phi_rel**2 / 2, power - part.d * part.w_rel**2
            elif kind == "mesh":
                stored, power = stored + part.c * part.q**2 / 2, power - part.d * part.v**2
        return [gl.Eq(gl.der(self.work), power), gl.Eq(self.stored, stored)]


def _port(train: gl.Component, path: str) -> Any:
    part, connector = path.split(".")
    return getattr(getattr(train, part), connector)


MAKE: dict[str, Any] = {
    "shaft": lambda: gp.SpringDamper(c=1e4, d=1.0),
    "mesh": lambda: gp.ExternalMesh(r_a=0.1, r_b=0.1, c=1e6, d=10.0),
    "gear": lambda: gp.IdealGear(ratio=1.5),
    "planetary": lambda: gp.IdealPlanetary(ratio=3.0),
}
FLANGES = {
    "shaft": ("flange_a", "flange_b"), "mesh": ("flange_a", "flange_b"), "gear": ("flange_a", "flange_b"),
    "planetary": ("sun", "carrier", "ring"),
}  # fmt: skip


@cache
def blueprint(seed: int) -> tuple[int, tuple[tuple[str, tuple[int, ...]], ...]]:
    """Number of bodies, and joints with the bodies at their ends.

    A tree, so that no rigid loop can lock, elastic loops, and twins of rigid joints, whose constraints follow from the others.
    """
    rng = random.Random(seed)
    bodies, joints = 1, []
    for _ in range(rng.randint(1, 6)):
        kind = rng.choice(["shaft", "shaft", "mesh", "gear", "planetary"])
        old = rng.randrange(bodies)
        if kind == "planetary":
            ends = [old, bodies, bodies + 1]
            rng.shuffle(ends)
            joints.append((kind, tuple(ends)))
            bodies += 2
        else:
            joints.append((kind, (old, bodies)))
            bodies += 1
    for _ in range(rng.randint(0, 2) if bodies > 2 else 0):
        one, other = rng.sample(range(bodies), 2)
        joints.append((rng.choice(["shaft", "mesh"]), (one, other)))
    rigid = [joint for joint in joints if joint[0] in ("gear", "planetary")]
    if rigid and rng.random() < 0.4:
        joints.append(rng.choice(rigid))
    return bodies, tuple(joints)


def random_parameters(seed: int, numbers: int) -> dict[str, float]:
    """Values over several decades for a train's parameters; some dampers and springs are switched off."""
    rng = np.random.default_rng(numbers)
    bodies, joints = blueprint(seed)
    values = {f"body_{i}.J": float(10 ** rng.uniform(-3, 1)) for i in range(bodies)}
    values |= {"amplitude": float(10 ** rng.uniform(-1, 2)), "omega": float(10 ** rng.uniform(0, 2.5))}
    for k, (kind, _) in enumerate(joints):
        name = f"{kind}_{k}"
        if kind == "shaft":
            values |= {f"{name}.c": float(10 ** rng.uniform(1, 6)), f"{name}.d": float(10 ** rng.uniform(-4, 1))}
        elif kind == "mesh":
            values |= {f"{name}.c": float(10 ** rng.uniform(4, 8)), f"{name}.d": float(10 ** rng.uniform(-2, 3))}
            values |= {f"{name}.r_a": float(rng.uniform(0.02, 0.5)), f"{name}.r_b": float(rng.uniform(0.02, 0.5))}
        else:
            sign = rng.choice([-1.0, 1.0]) if kind == "gear" else 1.0
            first = joints.index(joints[k])  # of twins, which have one ratio
            values[f"{name}.ratio"] = values.get(f"{kind}_{first}.ratio", float(sign * rng.uniform(0.3, 5.0)))
        if kind in ("shaft", "mesh") and rng.random() < 0.15:
            values[f"{name}.{rng.choice(['c', 'd'])}"] = 0.0
    return values


@cache
def compiled(seed: int, order: int = 0) -> gl.System:
    """A train, compiled once; parameters differ from run to run."""
    bodies, _ = blueprint(seed)
    return gl.compile(RandomTrain(seed=seed, order=order), outputs=["work", "stored", *(f"body_{i}.w" for i in range(bodies))])
