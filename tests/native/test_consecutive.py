"""Loops over consecutive slots are for linear equations only."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
import gearparts as gp

c = gl.connect


class Hub(gl.Component):
    """A body that drives n equal branches through springs and gears with losses; all is shared evenly."""

    n = gl.Structural(9)

    def assemble(self) -> list[Any]:
        losses = ((0.0, 0.9, 0.8, 0.1, 0.1),)
        self.torque, self.hub = gp.Torque(tau=0.5 * self.n), gp.Inertia(J=0.1 * self.n)
        self.shaft = [gp.SpringDamper(c=100.0, d=1.0) for _ in range(self.n)]
        self.gear = [gp.LossyGear(ratio=2.0, loss_table=losses) for _ in range(self.n)]
        self.load = [gp.Inertia(J=1.0) for _ in range(self.n)]
        links = [c(self.torque.flange, self.hub.flange_a)]
        for shaft, gear, load in zip(self.shaft, self.gear, self.load, strict=True):
            links += [c(self.hub.flange_b, shaft.flange_a), c(shaft.flange_b, gear.flange_a), c(gear.flange_b, load.flange_a)]
        return links


def test_a_hub_with_many_lossy_gears_moves_as_one_branch_with_its_share() -> None:
    one, system = gl.simulate(Hub(n=1), 0.3, samples=3, rtol=1e-8), gl.compile(Hub(n=9))
    for method in ("rk", "ida"):
        many = system.simulate(0.3, samples=3, rtol=1e-8, method=method)
        for mine, other in (("hub.w", "hub.w"), ("gear[0].loss_power", "gear[0].loss_power"), ("load[8].w", "load[0].w")):
            assert many[mine] == pytest.approx(one[other], rel=1e-5)
