"""Scene M3: a gear pair with backlash that hammers on its drive flank; about 510 losses of contact in 0.2 s."""

from __future__ import annotations

from typing import Any

import gearlib as gl
import gearparts as gp
from gearparts.gears.mesh_models import DetailedExternalMesh

HALF_GAP = 50e-6  # m


class BacklashPair(gl.Component):
    """A pinion drives a wheel; the transmission error has 20 periods per turn of the pinion. The wheel turns backward."""

    def assemble(self) -> Any:
        self.pinion = gp.Inertia(J=0.001, start={"phi": 0.0, "w": 800.0})
        self.wheel = gp.Inertia(J=0.016, start={"w": -400.0})
        self.mesh = DetailedExternalMesh(
            backlash=True, error_terms=((1, -10e-6, 0.0),), z_a=20.0, r_a=0.05, r_b=0.1, c=2e8, d=2000.0, b=2 * HALF_GAP,
            start={"q": HALF_GAP},
        )  # fmt: skip
        self.drive = gp.Torque(tau=40.0 - 0.002 * (self.pinion.w - 800.0))
        self.load = gp.Torque(tau=80.0)
        return [
            gl.connect(self.drive.flange, self.pinion.flange_a),
            gl.connect(self.pinion.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.load.flange),
        ]
