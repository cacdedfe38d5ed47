"""Trains that several tests use."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp


class Chain(gl.Component):
    """Bodies in a row, with springs and dampers between them, a torque on the first, and a damper to the ground if asked for."""

    n = gl.Structural(4)
    grounded = gl.Structural(False)
    J = gl.Parameter("kg.m2", default=1.0)
    c = gl.Parameter("N.m/rad", default=100.0)
    d = gl.Parameter("N.m.s/rad", default=0.0)
    d_load = gl.Parameter("N.m.s/rad", default=0.5)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque()
        self.body = [gp.Inertia(J=self.J * (1 + 0.3 * i)) for i in range(self.n)]
        self.shaft = [gp.SpringDamper(c=self.c * (1 + 0.2 * i), d=self.d) for i in range(self.n - 1)]
        links = [gl.connect(self.torque.flange, self.body[0].flange_a)]
        for left, shaft, right in zip(self.body, self.shaft, self.body[1:], strict=False):
            links += [gl.connect(left.flange_b, shaft.flange_a), gl.connect(shaft.flange_b, right.flange_a)]
        if self.grounded:
            self.load, self.ground = gp.Damper(d=self.d_load), gp.Fixed()
            links += [
                gl.connect(self.body[-1].flange_b, self.load.flange_a),
                gl.connect(self.load.flange_b, self.ground.flange),
            ]
        return links


@pytest.fixture(scope="session")
def chain() -> Callable[..., gl.System]:
    made: dict[Any, gl.System] = {}

    def make(**options: Any) -> gl.System:
        key = tuple(sorted(options.items()))
        if key not in made:
            made[key] = gl.compile(Chain(**options))
        return made[key]

    return make


@pytest.fixture(scope="session")
def paper() -> gl.System:
    return gl.compile(gp.ZhouCui2022())
