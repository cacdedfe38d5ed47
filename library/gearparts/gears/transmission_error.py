"""Static transmission error of a mesh: Fourier sum and table over the mesh phase."""

from __future__ import annotations

from math import pi
from typing import Any

import gearlib as gl
from gearparts.gears.mesh_phase import MeshMotion, checked_period, checked_terms, periodic, wrapped
from gearparts.tables import Rows


class TransmissionError(MeshMotion):
    """Base of meshes with a static transmission error, which adds to the deflection."""

    error_terms = gl.Structural((), "static transmission error: rows of order, amplitude (m), phase (rad) of sines")
    error_table = gl.Structural((), "static transmission error: rows of mesh phase (rad), error (m)")
    e_rate = gl.Input("m/s", "rate of a further transmission error; adds to the deflection", default=0.0)
    e = gl.Variable("m", "static transmission error; adds to the deflection", state="never")
    phase_in_error = gl.Variable("rad", "error_table: phase within its period", state="never")

    def equations(self) -> list[gl.Eq]:
        error = sum(amplitude * gl.sin(order * self.phase + shift) for order, amplitude, shift in self._error_terms())
        within: Any = 0
        if self.error_table:
            table = self._error_table()
            error, within = error + periodic(table, self.phase_in_error)[0], wrapped(self.phase, table[0][0] + pi)
        return [gl.Eq(self.phase_in_error, within), gl.Eq(self.e, error)]

    def error_rate(self) -> Any:
        """Rate of the total transmission error: from the mesh phase, and from the input."""
        slope = sum(order * amplitude * gl.cos(order * self.phase + shift) for order, amplitude, shift in self._error_terms())
        if self.error_table:
            slope = slope + periodic(self._error_table(), self.phase_in_error)[1]
        return self.e_rate + slope * self.phase_rate()

    def _error_terms(self) -> Rows:
        return checked_terms(self, "error_terms")

    def _error_table(self) -> Rows:
        return checked_period(f"{type(self).__name__}.error_table", self.error_table)
