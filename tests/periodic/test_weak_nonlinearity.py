"""Describing functions of backlash: against Fourier integrals and python-control."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.integrate import quad

import gearlib as gl


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


def test_a_mesh_against_the_rest_of_the_train(paper: gl.System) -> None:
    """The loop in which a describing function stands for one mesh's springs: closed with K_g it has the train's poles again."""
    K_g, linear = paper.parameters["K_g"], paper.linearize(["tau_in"], ["q_ring"])
    i = linear.state_labels.index("q_ring")
    without, force = np.array(linear.A), -linear.A[:, [i]] / K_g
    without[:, i] = 0.0
    loop = control.ss(without, force, np.eye(len(without))[[i]], 0, inputs=["force"], outputs=["q_ring"])
    report = gl.stability(loop, ("force", "q_ring"), gain=K_g)
    poles = np.sort_complex(np.linalg.eigvals(linear.A))
    assert np.sort_complex(np.asarray(report.loop.closed_poles.values)) == pytest.approx(poles, rel=1e-6)
    omega = np.linspace(5800.0, 5900.0, 2001)
    L = np.array([K_g * np.linalg.solve(1j * w * np.eye(len(without)) - without, force)[i, 0] for w in omega])
    unit = int(np.flatnonzero(np.diff(np.sign(np.abs(L) - 1)))[0])
    assert report.loop.margins.phase_margin == pytest.approx(180 + np.degrees(np.angle(L[unit])), abs=0.01)
    assert np.isinf(report.loop.margins.gain_margin)
