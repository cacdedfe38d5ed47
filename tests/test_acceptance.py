"""Scenes as users write them, each against a published reference, a closed form, or another method."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np

import gearlib as gl
import gearparts as gp

REFERENCE = Path(__file__).parent / "reference"
c, pi, sin, t = gl.connect, gl.pi, gl.sin, gl.time


class Chain(gl.Component):
    """Inertias joined by spring-dampers, sine torque on the first, drag on the last."""

    N = gl.Structural(10)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=100 * sin(2 * pi * 50 * t))
        self.body = [gp.Inertia(J=0.01 * (1 + i / self.N)) for i in range(self.N)]
        self.shaft = [gp.SpringDamper(c=1e5, d=5.0) for _ in range(self.N - 1)]
        self.drag = gp.Damper(d=1.0)
        self.ground = gp.Fixed()
        links = [c(self.torque.flange, self.body[0].flange_a)]
        for left, shaft, right in zip(self.body, self.shaft, self.body[1:]):
            links += [c(left.flange_b, shaft.flange_a), c(shaft.flange_b, right.flange_a)]
        return links + [c(self.body[-1].flange_b, self.drag.flange_a), c(self.drag.flange_b, self.ground.flange)]


class RigidLoop(gl.Component):
    """Gears and a planetary set closed to one degree of freedom, elastic shaft, load that grows with speed squared."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=10 + 5 * sin(20 * pi * t))
        self.motor, self.pinion = gp.Inertia(J=0.01), gp.Inertia(J=0.02)
        self.sun, self.carrier, self.ring = gp.Inertia(J=0.005), gp.Inertia(J=0.05), gp.Inertia(J=0.1)
        self.load = gp.Inertia(J=2.0)
        self.reduction, self.closing = gp.IdealGear(ratio=3), gp.IdealGear(ratio=0.5)
        self.planetary = gp.IdealPlanetary(ratio=81 / 19)
        self.shaft = gp.SpringDamper(c=1e4, d=10.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-0.05, w_nominal=1.0, torque_direction=False)
        return [
            c(self.torque.flange, self.motor.flange_a),
            c(self.motor.flange_b, self.reduction.flange_a),
            c(self.reduction.flange_b, self.pinion.flange_a),
            c(self.pinion.flange_b, self.sun.flange_a),
            c(self.sun.flange_b, self.planetary.sun),
            c(self.planetary.ring, self.ring.flange_a),
            c(self.planetary.carrier, self.carrier.flange_a),
            c(self.ring.flange_b, self.closing.flange_a),
            c(self.closing.flange_b, self.carrier.flange_a),
            c(self.carrier.flange_b, self.shaft.flange_a),
            c(self.shaft.flange_b, self.load.flange_a),
            c(self.load.flange_b, self.fan.flange),
        ]


class First(gl.Component):
    """Modelica's First, with supports."""

    def assemble(self) -> list[Any]:
        self.fixed = gp.Fixed()
        self.torque = gp.Torque(tau=10 * sin(2 * pi * 5 * t), use_support=True)
        self.inertia1 = gp.Inertia(J=0.1)
        self.idealGear = gp.IdealGear(ratio=10, use_support=True)
        self.inertia2 = gp.Inertia(J=2, start={"phi": 0, "w": 0})
        self.spring = gp.Spring(c=1e4, start={"phi_rel": 0})
        self.inertia3 = gp.Inertia(J=2, start={"w": 0})
        self.damper = gp.Damper(d=10)
        return [
            c(self.torque.flange, self.inertia1.flange_a),
            c(self.inertia1.flange_b, self.idealGear.flange_a),
            c(self.idealGear.flange_b, self.inertia2.flange_a),
            c(self.inertia2.flange_b, self.spring.flange_a),
            c(self.spring.flange_b, self.inertia3.flange_a),
            c(self.damper.flange_a, self.inertia2.flange_b),
            c(self.damper.flange_b, self.fixed.flange),
            c(self.torque.support, self.fixed.flange),
            c(self.idealGear.support, self.fixed.flange),
        ]


def test_paper() -> None:
    system = gl.compile(gp.ZhouCui2022(tau_in=100.0))
    eigenvalues = np.linalg.eigvals(system.linearize(inputs=["tau_in"], outputs=["w_out"]).A)
    assert len(eigenvalues) == 8
    # Hz, the highest mode of the energy form with Table 4
    assert abs(max(abs(eigenvalues)) / (2 * math.pi) / 1228.5427144 - 1) < 1e-8
    result = system.simulate(t_end=0.05, samples=101)
    assert np.all(np.isfinite(result["w_out"]))
    assert result.time[-1] == 0.05


def test_chain() -> None:
    system = gl.compile(Chain(N=10), outputs=["body[9].w"])
    assert len(system.states) == 19
    one, other = (system.simulate(t_end=0.5, samples=101, method=m, rtol=1e-9)["body[9].w"] for m in ("ida", "auto"))
    assert np.max(abs(one - other)) / np.max(abs(one)) < 1e-5


def test_rigid_loop() -> None:
    system = gl.compile(RigidLoop(), outputs=["carrier.w", "load.w"])
    assert len(system.states) == 3
    tight, loose = (system.simulate(t_end=2.0, samples=201, rtol=r)["load.w"] for r in (1e-11, 1e-6))
    assert np.max(abs(tight - loose)) / np.max(abs(tight)) < 1e-4


def test_first() -> None:
    with open(REFERENCE / "msl-First.csv", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    data = dict(zip(rows[0], np.array(rows[1:], float).T, strict=True))
    signals = ["inertia3.phi", "inertia3.w", "damper.w_rel"]
    result = gl.compile(First(), outputs=signals).simulate(t_end=data["time"][-1], times=data["time"], rtol=1e-9)
    for name in signals:
        assert np.max(abs(result[name] - data[name])) / np.max(abs(data[name])) < 1e-8
