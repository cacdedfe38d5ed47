"""Flank contact of a mesh: force and damping loss as functions of the deflection, with or without backlash."""

from __future__ import annotations

from typing import Any

import sympy

import gearlib as gl
from gearparts.gears.stiffness_laws import VaryingStiffness

CONTACT = {
    0.0: "open: mesh {}",
    1.0: "in contact: mesh {}",
    -1.0: "in contact, driven backwards: mesh {}",
    2.0: "in contact on both flanks: mesh {}",
}


class Flanks(VaryingStiffness):
    """Base of meshes with flank contact: force over deflection, and the side in contact."""

    backlash = gl.Structural(False, "whether the flanks can part; otherwise force and deflection are proportional")
    d = gl.Parameter("N.s/m", "mesh damping along the line of action; see mesh_damping", min=0)
    b = gl.Parameter("m", "backlash: total gap along the line of action; negative: interference, a preload", default=0.0)
    f = gl.Variable("N", "force along the line of action; acts against a positive turn of flange_a")
    contact = gl.Variable(
        "1",
        "1: pressed by a positive turn of flange_a, -1: by a negative one, 0: open, 2: both flanks are pressed",
        words=CONTACT,
    )

    def equations(self) -> list[gl.Eq]:
        damping = self.d * self.v
        if not self.backlash:
            force, contact = self.c_now * self.q + damping, 1
        else:
            half = self.b / 2
            drive, coast = self._touching()
            force = gl.Piecewise((self.c_now * (self.q - half) + damping, drive), (0, True)) + gl.Piecewise(
                (self.c_now * (self.q + half) + damping, coast), (0, True)
            )
            contact = gl.no_event(gl.Piecewise((2, sympy.And(drive, coast)), (1, drive), (-1, coast), (0, True)))
        return [gl.Eq(self.f, force), gl.Eq(self.contact, contact)]

    def damping_loss(self) -> Any:
        """Power dissipated by the damping of the flanks in contact."""
        loss = self.d * self.v * self.v
        if not self.backlash:
            return loss
        drive, coast = self._touching()
        return (gl.Piecewise((1, drive), (0, True)) + gl.Piecewise((1, coast), (0, True))) * loss

    def squared_deflection(self) -> Any:
        """Sum of the squared deflections of the flanks."""
        half = self.b / 2
        return gl.Max(self.q - half, 0) ** 2 + gl.Max(-self.q - half, 0) ** 2 if self.backlash else self.q**2

    def _touching(self) -> tuple[Any, Any]:
        """Contact flags of both flanks. One of them includes the edge of the gap: without a gap there is always contact."""
        return self.q >= self.b / 2, self.q < -self.b / 2
