"""Describing functions of backlash, and harmonic balance: against Fourier integrals, a closed form, and time integration."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.integrate import quad

import gearlib as gl

C, GAP, ZETA, F_M, F_A = 1.0, 2.0, 0.05, 0.3, 0.1  # mass 1, so that the natural frequency in contact is 1


@pytest.mark.parametrize(("amplitude", "mean"), [(0.2, 1.5), (0.5, 1.2), (1.5, 0.3), (3.0, -0.4), (0.3, 0.1), (0.4, -2.0)])
def test_describing_function_is_the_fourier_integral(amplitude: float, mean: float) -> None:
    c, b, c_gap = 3.0, 2.0, 0.4

    def force(u: float) -> float:
        x = mean + amplitude * np.cos(u)
        edge = min(max(x, -b / 2), b / 2)
        return float(c * (x - edge) + c_gap * edge)

    edges = [np.arccos(z) for z in ((b / 2 - mean) / amplitude, (-b / 2 - mean) / amplitude) if abs(z) < 1]
    options = {"points": edges or None, "epsabs": 1e-13, "epsrel": 1e-13}
    F0 = quad(force, 0, np.pi, **options)[0] / np.pi
    N1 = quad(lambda u: force(u) * np.cos(u), 0, np.pi, **options)[0] * 2 / np.pi / amplitude
    found = gl.backlash_describing_function(amplitude, mean, c=c, b=b, c_gap=c_gap)
    assert found[0] == pytest.approx(F0, abs=1e-12)
    assert found[1] == pytest.approx(N1, abs=1e-12)


def test_symmetric_backlash_is_one_minus_saturation() -> None:
    """A dead zone is a straight line less a saturation, whose describing function python-control has."""
    amplitudes = np.array([1.1, 2.0, 5.0])
    _, N1 = gl.backlash_describing_function(amplitudes, 0.0, c=1.0, b=2.0)
    saturation = control.describing_function(control.saturation_nonlinearity(1.0), amplitudes)
    assert pytest.approx(1.0 - saturation, abs=1e-12) == N1


def test_preloaded_backlash_in_python_control() -> None:
    spring = gl.PreloadedBacklash(c=100.0, b=1.0, preload=20.0)
    stiffness = gl.equivalent_stiffness([0.1, 0.19, 0.3, 0.8], 20.0, c=100.0, b=1.0)
    assert control.describing_function(spring, np.array([0.1, 0.19, 0.3, 0.8])) == pytest.approx(stiffness, rel=1e-12)
    assert stiffness[:2] == pytest.approx(100.0)
    assert stiffness[2] < 100.0
    F0, _ = gl.backlash_describing_function(0.8, spring.mean(0.8), c=100.0, b=1.0)
    assert pytest.approx(20.0, rel=1e-12) == F0
    assert [spring(x) for x in (0.05, -0.2, -0.7, -1.4)] == pytest.approx([5.0, -20.0, -20.0, -40.0])
