"""Handing over from one method to another."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.solvers import alternation

c = gl.connect


class Drive(gl.Component):
    """A light inertia on a hard damper, and a load with the square of its speed."""

    d = gl.Parameter("N.m.s/rad", "damping", default=50.0)

    def assemble(self) -> list[Any]:
        self.t, self.a, self.b = gp.Torque(tau=2.0), gp.Inertia(J=1e-3), gp.Inertia(J=1.0)
        self.s = gp.SpringDamper(c=10.0, d=self.d)
        self.q = gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=10.0)
        return [
            c(self.t.flange, self.a.flange_a), c(self.a.flange_b, self.s.flange_a), c(self.s.flange_b, self.b.flange_a),
            c(self.b.flange_b, self.q.flange),
        ]  # fmt: skip


@pytest.mark.parametrize("apart", [0.0, 1e-16, -1e-16, 1e-9])
def test_hand_over_on_a_sample_time(apart: float, monkeypatch: pytest.MonkeyPatch) -> None:
    system, ends, alternate = gl.compile(Drive()), [], alternation.alternate

    def noted(*arguments: Any, **options: Any) -> Any:
        legs = alternate(*arguments, **options)
        ends.append((legs[0].solution.status, legs[0].solution.t_last))
        return legs

    monkeypatch.setattr(alternation, "alternate", noted)
    plain = system.simulate(1.0, samples=11)
    status, t = ends[-1]
    assert status == "stiff"
    times = np.unique([0.0, t * (1 - 1e-3), t + apart, 0.5, 1.0])
    result = system.simulate(1.0, times=times)
    assert ends[-1] == (status, t)  # samples do not change the steps
    assert result.stats["method"] == "ida"
    assert result["b.w"][-1] == pytest.approx(plain["b.w"][-1], rel=1e-4)
    fine = system.simulate(1.0, times=times, rtol=1e-10, method="ida")
    assert result["b.w"] == pytest.approx(fine["b.w"], rel=1e-4, abs=1e-6)
