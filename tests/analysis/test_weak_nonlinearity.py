"""Describing functions of backlash, and harmonic balance: against Fourier integrals, a closed form, and time integration."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.integrate import quad

import gearlib as gl
import gearparts as gp

C, GAP, ZETA, F_M, F_A = 1.0, 2.0, 0.05, 0.3, 0.1  # mass 1, so that the natural frequency in contact is 1


class GearPair(gl.Component):
    """A gear pair's deflection with backlash, preload and a periodic torque: ``q'' + 2 zeta q' + g(q) = F_m + F_a cos(w t)``."""

    w = gl.Parameter("rad/s", default=0.8)
    F_a = gl.Parameter("N", default=F_A)
    q = gl.Variable("m", start=1.3)
    v = gl.Variable("m/s", start=0.0)

    def equations(self) -> list[gl.Eq]:
        contact = gl.no_event(gl.Max(self.q - GAP / 2, 0) + gl.Min(self.q + GAP / 2, 0))
        force = F_M + self.F_a * gl.cos(self.w * gl.time)
        return [gl.Eq(gl.der(self.q), self.v), gl.Eq(gl.der(self.v), force - 2 * ZETA * self.v - C * contact)]


@pytest.fixture(scope="module")
def pair() -> gl.System:
    return gl.compile(GearPair())


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


def test_one_harmonic_is_the_closed_form(pair: gl.System) -> None:
    """``(N1(A) - w**2)**2 + (2 zeta w)**2 = (F_a / A)**2`` with the mean that carries the preload, at every point of the branch."""
    response = gl.harmonic_balance(pair, "w", 1.5, 0.3, samples=2048, step=0.05)
    A, w = response.amplitude("q"), response.omega
    N1 = gl.equivalent_stiffness(A, F_M, c=C, b=GAP)
    F0, _ = gl.backlash_describing_function(A, response.mean("q"), c=C, b=GAP)
    assert pytest.approx(F_M, abs=1e-5) == F0
    assert np.hypot(N1 - w**2, 2 * ZETA * w) * A == pytest.approx(F_A, rel=1e-4)
    assert len(response.folds) == 2
    assert (A.max() > 0.3).all()  # contact is lost
    assert (~response.stable).any()
    assert response.stable[0]
    # between the folds the branch is unstable, outside it is not
    low, high = sorted(response.folds)
    turned = np.diff(w) > 0
    middle = np.flatnonzero(turned)[2:-2]
    assert not response.stable[middle].any()
    assert response.stable[(w < 0.98 * low) | (w > 1.02 * high)].all()


def test_linear_system_has_the_linear_response(pair: gl.System) -> None:
    response = gl.harmonic_balance(pair, "w", 0.2, 0.5, harmonics=3, parameters={"F_a": 0.01})
    exact = 0.01 / np.abs(C - response.omega**2 + 2j * ZETA * response.omega)
    assert response.amplitude("q") == pytest.approx(exact, rel=1e-8)
    assert response.amplitude("q", 2) == pytest.approx(0.0, abs=1e-10)
    assert response.omega[-1] == 0.5
    # Floquet multipliers are exp(eigenvalue * period)
    pole = -ZETA + 1j * np.sqrt(1 - ZETA**2)
    expected = np.exp(pole * 2 * np.pi / response.omega)
    assert np.abs(response.multipliers[:, 0]) == pytest.approx(np.abs(expected), rel=1e-6)


@pytest.mark.parametrize("rising", [True, False])
def test_many_harmonics_are_the_time_integration(pair: gl.System, rising: bool) -> None:
    """Both stable branches at one frequency: the one with contact lost, and the linear one."""
    response = gl.harmonic_balance(pair, "w", 1.5, 0.3, harmonics=12, samples=512, step=0.05)
    low, high = sorted(response.folds)
    w = 0.5 * (low + high)
    crossing = np.flatnonzero(((response.omega[:-1] - w) * (response.omega[1:] - w) < 0) & response.stable[1:])
    assert len(crossing) == 2
    amplitudes = response.amplitude("q")[crossing]
    k = int(crossing[np.argmax(amplitudes)] if rising else crossing[np.argmin(amplitudes)])
    w = float(response.omega[k])
    t, q = response.waveform("q", k, 128)
    _, v = response.waveform("v", k, 128)
    periods = 40 * 2 * np.pi / w
    start = {"q": float(q[0]) + 1e-3, "v": float(v[0])}
    run = pair.simulate(periods + t[-1], times=np.append(0.0, periods + t), start=start, parameters={"w": w}, rtol=1e-10)
    size = np.abs(q - q.mean()).max()
    assert np.abs(run["q"][1:] - q).max() < 2e-3 * size
    assert abs(np.fft.rfft(run["q"][1:])[1]) / 64 == pytest.approx(response.amplitude("q")[k], rel=2e-4)


class Coupled(gl.Component):
    """Two bodies, a coupling with backlash from the library, a damper beside it, and a periodic torque."""

    w = gl.Parameter("rad/s", default=30.0)

    def assemble(self) -> list[gl.Connection]:
        self.torque = gp.Torque(tau=3.0 + 2.0 * gl.cos(self.w * gl.time))
        self.body, self.damper, self.spring, self.ground = gp.Inertia(J=0.1), gp.Damper(d=0.1), gp.Spring(c=100.0), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.body.flange_a),
            gl.connect(self.body.flange_b, self.damper.flange_a, self.spring.flange_a),
            gl.connect(self.damper.flange_b, self.spring.flange_b, self.ground.flange),
        ]


def test_a_train_of_library_components() -> None:
    system = gl.compile(Coupled())
    response = gl.harmonic_balance(system, "w", 10.0, 50.0)
    name = next(s for s in response.states if s.endswith("w"))
    w = response.omega
    assert response.amplitude(name) == pytest.approx(2.0 * w / np.abs(100.0 - 0.1 * w**2 + 0.1j * w), rel=1e-7)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("w", 0.0, 1.0, {}), "positive frequencies"),
        (("w", 1.0, 2.0, {"harmonics": 0}), "harmonics is 0"),
        (("w", 1.0, 2.0, {"harmonics": 9, "samples": 12}), "need at least 19"),
        (("omega", 1.0, 2.0, {}), "no parameter 'omega'"),
    ],
)
def test_errors(pair: gl.System, arguments: tuple[str, float, float, dict[str, int]], message: str) -> None:
    parameter, start, end, options = arguments
    with pytest.raises(gl.GearlibError, match=message):
        gl.harmonic_balance(pair, parameter, start, end, **options)
