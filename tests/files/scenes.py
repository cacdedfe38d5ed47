"""A run for files: aliases of both signs, a flow that is always zero, events, a discrete variable, letters that ASCII lacks."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import gearlib as gl
import gearparts as gp


class Counter(gl.Component):
    """Counts the revolutions of a signal's source; Zähler, счётчик."""

    u = gl.Input("rad/s", "Drehzahl ω, счётчик")
    phi = gl.Variable("rad", "angle, as 3·10⁰ rad")
    n = gl.Discrete(start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.phi), self.u),
            gl.When(self.phi > 3.0 * (self.n + 1.0), gl.Eq(self.n, gl.pre(self.n) + 1.0)),
        ]


class Drive(gl.Component):
    J_load = gl.Parameter("kg.m2", "load inertia", default=2.0, min=0)

    def assemble(self) -> list[Any]:
        self.torque, self.motor = gp.Torque(), gp.Inertia(J=1.0)
        self.load = gp.Inertia(J=self.J_load)
        self.gear = gp.IdealGear(ratio=-2.0)
        self.counter = Counter(u=self.motor.w)
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.load.flange_a),
        ]


@lru_cache(maxsize=1)
def system() -> gl.System:
    return gl.compile(Drive())


@lru_cache(maxsize=1)
def run() -> gl.Result:
    return system().simulate(2.0, samples=41, parameters={"J_load": 1.5}, inputs={"torque.tau": lambda t: 6.0 + t})
