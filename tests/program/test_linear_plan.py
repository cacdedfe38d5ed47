"""The matrices of linear programs: one sparse computation, and the general road of `sensitivity`, give the same."""

from __future__ import annotations

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.program.linear_plan import linear_plan
from gearlib.program.sensitivity import affine_seeds, sensitivity


class Lifted(gl.Component):
    """A motor, a rigid gear with inertias on both sides, an elastic rope, a weight: a linear block, a constant and an input."""

    def assemble(self) -> list[gl.Connection]:
        self.motor = gp.Torque(tau=3.0)
        self.rotor, self.drum = gp.Inertia(J=0.02), gp.Inertia(J=0.5)
        self.gear = gp.IdealGear(ratio=7.0)
        self.shaft = gp.SpringDamper(c=2e4, d=3.0)
        self.load, self.weight = gp.Inertia(J=1.5), gp.Torque(tau=-12.0)
        return [
            gl.connect(self.motor.flange, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.drum.flange_a),
            gl.connect(self.drum.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a, self.weight.flange),
        ]


@pytest.mark.parametrize("component", [Lifted(), gp.XPTrain()], ids=["Lifted", "XPTrain"])
def test_both_roads_agree(component: gl.Component) -> None:
    system = gl.compile(component)
    scene, program = system.translation.scene, system.translation.scene.program
    numbers = scene.numbers(
        system.translation.model.parameters.evaluate({0: 1.25 * system.translation.model.parameters.defaults[0]})
    )
    added = [int(batch.targets[i]) for batch, i in affine_seeds(program)]
    plan = linear_plan(program, added)
    assert plan is not None
    n = len(program.states) + len(program.inputs)
    found = np.zeros((len(program.outputs), n + len(added)))
    found[plan.rows, plan.seeds] = plan.entries(numbers.main)
    seeds = [(slot, k, 1.0) for k, slot in enumerate(added)]
    slots, flags = np.zeros(program.n_slots), np.zeros(scene.n_modes)
    expected = sensitivity(numbers.main, 0.0, slots, flags, range(n), seeds)[program.output_slots]
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13 * np.abs(expected).max())


def test_what_is_added_twice_has_no_plan() -> None:
    system = gl.compile(Lifted())
    assert linear_plan(system.translation.scene.program, [9, 9]) is None
