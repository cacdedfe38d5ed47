"""The same train in other units of torque and time: the same verdicts, and the same speeds and torques."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError

RATIO, TORQUE, DAMPING = -0.00225396, -0.6685, 1.35e-4


class Branched(gl.Component):
    """A driven body with an idle branch, and a branch whose damper takes the torque; ``k``: binary exponents of torque and time."""

    k = gl.Structural((0, 0))

    def assemble(self) -> list[Any]:
        torque, second = (2.0**k for k in self.k)
        self.body = [gp.Inertia(J=J * torque * second**2) for J in (2.7e-7, 0.041, 1.54)]
        self.drive = gp.ConstantTorque(tau_constant=TORQUE * torque)
        self.one, self.two = gp.IdealGear(ratio=-2.23429), gp.IdealGear(ratio=RATIO)
        self.shaft = [
            gp.SpringDamper(c=c * torque, d=d * torque * second) for c, d in ((8285.85, 72.7928), (37461.7, 0.109164))
        ]
        self.brake, self.ground = gp.Damper(d=DAMPING * torque * second), gp.Fixed()
        return [
            gl.connect(self.drive.flange, self.body[0].flange_a),
            gl.connect(self.body[0].flange_b, self.one.flange_a, self.two.flange_a),
            gl.connect(self.one.flange_b, self.shaft[0].flange_a),
            gl.connect(self.shaft[0].flange_b, self.body[1].flange_a),
            gl.connect(self.two.flange_b, self.shaft[1].flange_a),
            gl.connect(self.shaft[1].flange_b, self.body[2].flange_a),
            gl.connect(self.body[2].flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
        ]


@pytest.mark.parametrize("k", [(0, 0), (40, 0), (-40, 0), (0, 30), (0, -30), (0, 40), (0, -40), (-20, 40)])
def test_steady_motion_in_other_units(k: tuple[int, int]) -> None:
    system, torque, second = gl.compile(Branched(k=k)), 2.0 ** k[0], 2.0 ** k[1]
    flow = system.power_flow()
    assert flow["body[2].flange_a"].speed * second == pytest.approx(TORQUE * RATIO / DAMPING, rel=1e-9)
    assert flow["brake.flange_a"].torque / torque == pytest.approx(TORQUE * RATIO, rel=1e-9)
    with pytest.raises(ArgumentError, match=r"no steady motion has the given body\[0\].w"):
        system.power_flow(speeds={"body[0].w": 3.0 / second})
