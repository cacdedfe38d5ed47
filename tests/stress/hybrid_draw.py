"""Random trains that switch, as data: backlash, friction, clutches, freewheels, controllers, stops."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

from tests.stress.described import Part, Signal, Train


class Draw:
    """Grows a train whose every node carries a body."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.parts: list[Part] = []
        self.bodies = 0

    def put(self, kind: str, at: tuple[int, ...], **values: Any) -> None:
        name = f"{kind[0].lower()}{kind[1:]}{sum(p.kind == kind for p in self.parts)}"
        self.parts.append(Part(name, kind, at, tuple(values.items())))

    def body(self) -> int:
        self.put("Inertia", (self.bodies, self.bodies), J=round(10 ** self.rng.uniform(-1.3, 0.3), 3))
        self.bodies += 1
        return self.bodies - 1

    def any(self) -> int:
        return self.rng.randrange(self.bodies)

    def two(self) -> tuple[int, int]:
        if self.bodies < 2:
            self.body()
        one, other = self.rng.sample(range(self.bodies), 2)
        return one, other

    def new(self) -> tuple[int, int]:
        """An old body and a new one."""
        old = self.any()
        pair = old, self.body()
        return pair if self.rng.random() < 0.5 else pair[::-1]

    def support(self, body: int) -> tuple[int, ...]:
        others = [k for k in range(self.bodies) if k != body]
        return (self.rng.choice(others),) if others and self.rng.random() < 0.25 else ()

    def signal(self, size: float = 5.0) -> Signal:
        rng = self.rng
        kind = rng.choice(["constant", "wave", "wave", "ramp", "steps"])
        bias, bound = rng.uniform(-size, size), rng.random() < 0.5
        if kind == "wave":
            return Signal(
                bias / 2, amplitude=rng.uniform(0.3, 1.5) * size, omega=rng.uniform(3, 25), phase=rng.uniform(0, 6), bound=bound
            )
        if kind == "ramp":
            return Signal(bias, slope=rng.uniform(-2, 2) * size, bound=bound)
        if kind == "steps":
            return Signal(
                bias,
                steps=((rng.uniform(0.1, 0.5), rng.uniform(-2, 2) * size), (rng.uniform(0.5, 0.9), rng.uniform(-2, 2) * size)),
                bound=bound,
            )
        return Signal(bias, bound=bound)

    def pressing(self) -> Signal:
        rng, bound = self.rng, self.rng.random() < 0.5
        kind = rng.choice(["constant", "steps", "wave", "ramp"])
        if kind == "steps":
            first = rng.choice([0.0, 1.0])
            return Signal(
                first,
                steps=((rng.uniform(0.1, 0.5), 1 - 2 * first), (rng.uniform(0.5, 0.9), rng.uniform(0.1, 0.5))),
                bound=bound,
            )
        if kind == "wave":
            return Signal(0.3, amplitude=0.7, omega=rng.uniform(4, 12), phase=rng.uniform(0, 6), bound=bound)
        if kind == "ramp":
            return Signal(rng.uniform(0.2, 1), slope=rng.uniform(-0.8, 0.5), bound=bound)
        return Signal(rng.uniform(0.2, 1.0), bound=bound)

    def rows(self, size: float) -> tuple[tuple[float, float], ...]:
        if self.rng.random() < 0.6:
            return ((0.0, round(size, 3)),)
        return ((0.0, round(size, 3)), (50.0, round(size * self.rng.uniform(0.7, 2.0), 3)))

    # ------------------------------------------------------------ parts

    def spring(self) -> None:
        at = self.new() if self.rng.random() < 0.5 else self.two()
        self.put("SpringDamper", at, c=round(10 ** self.rng.uniform(1, 3), 2), d=round(10 ** self.rng.uniform(-2, 0), 3))

    def gap(self) -> None:
        at = self.new() if self.rng.random() < 0.6 else self.two()
        kind = self.rng.choice(["ElastoBacklash", "ElastoBacklash2"])
        self.put(
            kind, at, c=round(10 ** self.rng.uniform(1.5, 3.5), 1), d=round(10 ** self.rng.uniform(-2, 0.3), 3),
            b=self.rng.choice([0.0, 0.05, 0.2, 0.6]), phi_rel0=self.rng.choice([0.0, 0.0, 0.1]),
        )  # fmt: skip

    def gear(self) -> None:
        if self.rng.random() < 0.7:
            self.put("IdealGear", self.new(), ratio=self.rng.choice([-1.0, 2.0, round(self.rng.uniform(0.4, 3), 2)]))
        else:
            ends = [*self.new(), self.body()]
            self.rng.shuffle(ends)
            self.put("IdealPlanetary", (ends[0], ends[1], ends[2]), ratio=round(self.rng.uniform(1, 4), 2))

    def friction(self) -> None:
        rng = self.rng
        kind = rng.choice(["BearingFriction", "Brake", "Clutch", "Clutch", "OneWayClutch"])
        if kind == "BearingFriction":
            body = self.any()
            self.put(kind, (body, body, *self.support(body)), tau_pos=self.rows(rng.uniform(0.3, 4)))
            return
        values: dict[str, Any] = {
            "mu_pos": self.rows(rng.uniform(0.3, 1)),
            "fn_max": round(rng.uniform(1, 10), 2),
            "f_normalized": self.pressing(),
        }
        if kind == "Brake":
            body = self.any()
            self.put(kind, (body, body, *self.support(body)), **values)
        else:
            self.put(kind, self.new() if rng.random() < 0.6 else self.two(), **values)

    def source(self) -> None:
        if self.rng.random() < 0.7:
            body = self.any()
            self.put("Torque", (body, *self.support(body)), tau=self.signal())
        else:
            self.put("Torque2", self.two(), tau=self.signal())

    def load(self) -> None:
        rng, body = self.rng, self.any()
        kind = rng.choice(["LinearSpeedDependentTorque", "QuadraticSpeedDependentTorque"])
        self.put(
            kind, (body, *self.support(body)) if kind[0] == "L" else (body,), tau_nominal=-round(rng.uniform(0.1, 3), 2),
            w_nominal=round(rng.uniform(1, 10), 2), torque_direction=False,
        )  # fmt: skip

    def switched(self) -> None:
        low = self.rng.uniform(-3, 2)
        self.put(
            "Switched",
            (self.any(),),
            tau_on=round(self.rng.uniform(2, 10), 2),
            w_low=low,
            w_high=low + self.rng.uniform(0.2, 2),
        )

    def kicked(self) -> None:
        rng, node = self.rng, self.bodies
        self.put(
            "Kicked", (node,), J=round(rng.uniform(0.1, 1), 2), phi_stop=rng.uniform(0.3, 1.5), restitution=rng.choice([1.0, 0.8]),
            moment=rng.uniform(0.1, 2.0), kick=rng.uniform(-3, 3),
        )  # fmt: skip
        self.put("SpringDamper", (self.any(), node), c=round(10 ** rng.uniform(1, 2.5), 1), d=round(rng.uniform(0.01, 0.3), 3))

    def driven(self) -> None:
        if any(p.kind in ("ConstantSpeed", "Speed") for p in self.parts):
            return
        if self.rng.random() < 0.5:
            self.put("ConstantSpeed", (self.any(),), w_fixed=self.rng.uniform(-5, 5))
        else:
            wave = Signal(self.rng.uniform(-2, 2), amplitude=self.rng.uniform(1, 4), omega=self.rng.uniform(3, 15))
            self.put("Speed", (self.any(),), w_ref=wave)


def hybrid_train(seed: int) -> Train:
    """A random train with one to four things that switch."""
    draw = Draw(seed)
    rng = draw.rng
    draw.body()
    for put in rng.choices([draw.gap, draw.friction, draw.switched], [3, 4, 1], k=rng.choice([1, 1, 2, 3])):
        put()
    for put in rng.choices(
        [draw.spring, draw.gear, draw.source, draw.load, draw.driven, draw.body], [3, 2, 4, 2, 1, 0.5], k=rng.randint(1, 5)
    ):
        put()
    if rng.random() < 0.15:
        draw.kicked()
    count = max(node for p in draw.parts for node in p.at) + 1
    still = rng.random() < 0.3
    sticking = [p for p in draw.parts if p.kind in ("BearingFriction", "Brake", "Clutch")]
    if len(sticking) == 1 and rng.random() < 0.3:  # beside others, what breaks away first would not be determined
        harder = replace(sticking[0], values=(*sticking[0].values, ("peak", round(rng.uniform(1.05, 1.6), 2))))
        draw.parts = [harder if p is sticking[0] else p for p in draw.parts]
    speeds = tuple(0.0 if still else rng.uniform(-4, 4) for _ in range(count))
    angles = tuple(rng.uniform(-0.2, 0.2) for _ in range(count))
    return Train(tuple(draw.parts), angles, speeds, rng.choice([1.0, 1.0, 2.0]))
