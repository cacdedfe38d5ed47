"""Steady states: values by closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


def test_what_is_always_zero_is_zero_in_the_steady_state() -> None:
    """The torque at the loose end of a spring."""

    class Loose(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load, self.spring = gp.Torque(tau=3.0), gp.Inertia(J=1.5), gp.Spring(c=3.0)
            self.brake, self.ground = gp.Damper(d=0.5), gp.Fixed()
            ends = [self.torque.flange, self.load.flange_a, self.brake.flange_a, self.spring.flange_a]
            return [gl.connect(*ends), gl.connect(self.brake.flange_b, self.ground.flange)]

    found = gl.steady_state(gl.compile(Loose()), ["load.w", "spring.flange_b.tau", "brake.flange_b.tau"])
    assert found.values == pytest.approx(np.array([6.0, 0.0, -3.0]))
    assert [found.sensitivity(name, "brake.d") for name in found.names] == pytest.approx([-12.0, 0.0, 0.0], abs=1e-12)
