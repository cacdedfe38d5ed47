"""Derivatives of linear models with respect to parameters, by closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.linear.linearized_program import LinearizedProgram
from gearlib.linear.operating_point import operating_point
from gearlib.program.build import build
from gearlib.program.interpret import prepare
from gearlib.run.subject import translation_of


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


def test_changes_have_the_shape_of_what_changes() -> None:
    """Columns of states, of inputs and of perturbations; ``x' = -a x + b y`` with y = 3 x."""

    class Small(gl.Component):
        a, b = gl.Parameter("1/s", default=2.0), gl.Parameter("1/s", default=5.0)
        x, y = gl.Variable("1", start=1.0), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.y, 3 * self.x), gl.Eq(gl.der(self.x), -self.a * self.x + self.b * self.y)]

    translation = translation_of(gl.compile(Small()))
    structure, (state,) = translation.structure, translation.scene.states
    scene, numbers, point = operating_point(translation, (state,))
    y = (structure.model.variable("y"), 0)
    program = build(structure, [y], (state,), dynamic=True)
    rate, slot = program.slots[state[0], state[1] + 1], program.slots[y]
    at = LinearizedProgram(
        scene, prepare(program, structure, numbers), point, (program.slots[state],), ((slot, 0, 1.0), (slot, 1, 2.0))
    )
    assert at.derivatives[rate] == pytest.approx([13.0, 5.0, 10.0])
    for found, row in zip(at.changes(["a", "b"], [rate]), ([-1.0, 0.0, 0.0], [3.0, 1.0, 2.0]), strict=True):
        assert found.tolist() == [row]
