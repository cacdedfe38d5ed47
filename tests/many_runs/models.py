"""Models of the sweeps' tests, and functions that other processes can import."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np

import gearlib as gl
import gearparts as gp


class Drive(gl.Component):
    """A torque that nobody has bound, a motor, an elastic shaft and a braked load; linear."""

    J = gl.Parameter("kg.m2", "of the load", default=2.0, min=0)

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.motor = gp.Torque(), gp.Inertia(J=0.5)
        self.shaft, self.load = gp.SpringDamper(c=400.0, d=2.0), gp.Inertia(J=self.J, start={"w": 1.0})
        self.brake, self.ground = gp.Damper(d=0.5), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.motor.flange_a), gl.connect(self.motor.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a), gl.connect(self.load.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
        ]  # fmt: skip


class Rattle(gl.Component):
    """A pulsing torque through a gap: events between variables."""

    def assemble(self) -> list[gl.Connection]:
        self.torque = gp.Torque(tau=2.0 + 6.0 * gl.sin(9.0 * gl.time))
        self.motor, self.gap, self.load = gp.Inertia(J=0.2), gp.ElastoBacklash(c=500.0, d=1.0, b=0.02), gp.Inertia(J=0.4)
        self.brake, self.ground = gp.Damper(d=0.3), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.motor.flange_a), gl.connect(self.motor.flange_b, self.gap.flange_a),
            gl.connect(self.gap.flange_b, self.load.flange_a), gl.connect(self.load.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
        ]  # fmt: skip


class Thermostat(gl.Component):
    """A heater that switches: a discrete variable."""

    power = gl.Parameter("K/s", default=3.0)
    on = gl.Discrete(start=1.0)
    T = gl.Variable("K", start=18.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.T), self.power * self.on - 0.1 * (self.T - 10.0)),
            gl.Eq(self.on, gl.Piecewise((0, self.T > 21.0), (1, self.T < 19.0), (gl.pre(self.on), True))),
        ]


def peak(result: Any) -> float:
    return float(np.abs(result["load.w"]).max())


def slow_peak(result: Any) -> float:
    """The peak, after a while; what was done is noted in a file."""
    with Path(os.environ["GEARLIB_TEST_LOG"]).open("a") as log:
        log.write(f"{result.translation.model.parameters.names and result.request.parameters.sum():.17g}\n")
    time.sleep(0.02)
    return peak(result)


def dying(result: Any) -> float:
    """End the process where the load is heaviest."""
    if result.request.parameters.max() == 499.0:
        os._exit(3)
    return peak(result)
