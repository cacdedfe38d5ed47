"""Derivatives of linear models with respect to parameters, by closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


def test_inputs_that_the_model_computes_itself() -> None:
    """Two torques that are bound, on a body of J behind gears of ratio i: i / (J s) each; and one that is not bound."""

    class Driven(gl.Component):
        i = gl.Parameter("1", default=2.0)

        def assemble(self) -> list[Any]:
            self.one, self.two, self.three = gp.Torque(tau=2 + gl.sin(gl.time)), gp.Torque(tau=3 + gl.cos(gl.time)), gp.Torque()
            self.gear, self.other, self.load = gp.IdealGear(ratio=self.i), gp.IdealGear(ratio=3 * self.i), gp.Inertia(J=5.0)
            return [
                gl.connect(self.one.flange, self.gear.flange_a),
                gl.connect(self.two.flange, self.other.flange_a),
                gl.connect(self.gear.flange_b, self.other.flange_b, self.load.flange_a, self.three.flange),
            ]

    names, s = ["two.tau", "three.tau", "one.tau"], 2.0j
    found = gl.frequency_response(gl.compile(Driven()), [2.0], names, ["load.w"])
    assert found.values[0, :, 0] == pytest.approx(np.array([6.0, 1.0, 2.0]) / (5.0 * s))
    by_ratio, by_body = found.sensitivities(["i", "load.J"])[:, 0, :, 0]
    assert by_ratio == pytest.approx(np.array([3.0, 0.0, 1.0]) / (5.0 * s), abs=1e-15)
    assert by_body == pytest.approx(-np.array([6.0, 1.0, 2.0]) / (25.0 * s))
