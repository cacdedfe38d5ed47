"""Poles where states are coupled in one direction only: they are those of the states alone, however large the coupling is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.linear.poles import poles
from gearlib.vibration.spectrum import dense_spectrum

FAST, SLOW, COUPLING = 2.2e4, 0.0449, 5e8


@pytest.mark.parametrize("seed", range(20))
def test_poles_of_a_triangular_matrix_stand_on_its_diagonal(seed: int) -> None:
    """Eight decades of poles, fifteen of couplings, in any order of the states."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    right = np.sort(-(10.0 ** rng.uniform(-3, 5, n)))
    below = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-6, 9, (n, n)) * (rng.random((n, n)) < 0.5)
    order = rng.permutation(n)
    matrix = (np.diag(right) + np.tril(below, -1))[np.ix_(order, order)]
    found = poles(matrix)
    assert found.verdict == "stable"
    assert np.sort(found.values.real) == pytest.approx(right, rel=1e-9)
    assert dense_spectrum(matrix, np.eye(n), None).decays[::-1] == pytest.approx(right, rel=1e-9)


class OneWay(gl.Component):
    """A fast state that drives a slow one."""

    fast = gl.Parameter("1/s", default=FAST)
    slow = gl.Parameter("1/s", default=SLOW)
    coupling = gl.Parameter("1/s", default=COUPLING)
    u = gl.Input("1")
    x = gl.Variable("1")
    y = gl.Variable("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.fast * (self.u - self.x)),
            gl.Eq(gl.der(self.y), -self.coupling * self.x - self.slow * self.y),
        ]


def test_all_analyses_see_a_slow_state_behind_a_large_coupling() -> None:
    system = gl.compile(OneWay(), outputs=["y"])
    assert np.sort(gl.stability(system).eigenvalues.real) == pytest.approx([-FAST, -SLOW], rel=1e-9)
    assert gl.modes(system).decays == pytest.approx([-SLOW, -FAST], rel=1e-9)
    omega = np.array([1e-3, 0.05, 1e4])
    response = gl.frequency_response(system, omega, inputs=["u"], outputs=["y"])
    s = 1j * omega
    expected = -COUPLING * FAST / ((s + FAST) * (s + SLOW))
    assert np.asarray(response["y", "u"]) == pytest.approx(expected, rel=1e-9)
