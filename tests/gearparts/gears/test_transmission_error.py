"""Static transmission error over the mesh phase: its value by hand, and a rate that is its derivative."""

from __future__ import annotations

import math

import pytest
from scipy.interpolate import CubicSpline

import gearparts as gp
from tests.gearparts.laws import right_side

TERMS, ROWS = ((1.0, 2e-6, 0.4), (3.0, -1e-6, 1.1)), ((0.5, 1e-6), (2.0, 4e-6), (4.5, -2e-6))


@pytest.mark.parametrize(("terms", "rows"), [(TERMS, ()), ((), ROWS), (TERMS[1:], ROWS)])
def test_the_rate_of_the_error_is_its_derivative(
    terms: tuple[tuple[float, ...], ...], rows: tuple[tuple[float, ...], ...]
) -> None:
    mesh = gp.DetailedExternalMesh(r_a=0.1, r_b=0.2, c=1e8, d=0.0, error_terms=terms, error_table=rows)
    curve = CubicSpline([0.5, 2.0, 4.5, 0.5 + 2 * math.pi], [1e-6, 4e-6, -2e-6, 1e-6], bc_type="periodic") if rows else None

    def at(phase: float, left: str, **values: float) -> float:
        inside = right_side(mesh, "phase_in_error", phase=phase)
        return right_side(mesh, left, phase=phase, phase_in_error=inside, **values)

    for phase in (-7.3, 0.9, 6.5):
        inside = right_side(mesh, "phase_in_error", phase=phase)
        assert inside == (pytest.approx(0.5 + (phase - 0.5) % (2 * math.pi)) if rows else 0.0)
        expected = sum(a * math.sin(k * phase + p) for k, a, p in terms) + (float(curve(phase)) if curve else 0.0)
        assert at(phase, "e") == pytest.approx(expected, abs=1e-18)
        slope = (at(phase + 1e-5, "e") - at(phase - 1e-5, "e")) / 2e-5
        assert at(phase, "v", z_a=20.0, w_a=3.0) == pytest.approx(60.0 * slope, abs=1e-13)
        assert at(phase, "v", r_a=0.1, r_b=0.2, w_b=5.0, e_rate=0.25) == pytest.approx(1.25)
