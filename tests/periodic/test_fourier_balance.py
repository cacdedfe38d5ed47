"""The error of a motion in Fourier series, where what is missing is known."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.periodic.first_motion import First, Forced

ZETA, OMEGA, HARMONICS = 0.05, 0.7, 3


class Oscillator(gl.Component):
    """``x'' + 2 zeta x' + x = F``."""

    F = gl.Input("1")
    zeta = gl.Parameter("1", default=ZETA)
    x = gl.Variable("1")
    v = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), self.F - 2 * self.zeta * self.v - self.x)]


@cache
def solved() -> First:
    drive: dict[str, Any] = {"F": lambda phase, w: 2.0 + np.cos(phase)}
    task = Forced(gl.compile(Oscillator()).translation, None, {}, drive, HARMONICS, {})
    return task.first(task.scene(["x"]), OMEGA, 32, None, None)


def test_a_linear_motion_is_exact() -> None:
    balance = solved().balance
    c = balance.coefficients(solved().z)
    response = 1 / (1 - OMEGA**2 + 2j * ZETA * OMEGA)
    assert c[0] == pytest.approx([2.0, 0.0], abs=1e-12)
    assert np.hypot(*c[1:3]) == pytest.approx(abs(response) * np.array([1.0, OMEGA]))
    assert max(balance.error(solved().z, OMEGA)) < 1e-10


@pytest.mark.parametrize("place", range(2 * HARMONICS + 1))
@pytest.mark.parametrize("state", [0, 1])
def test_the_error_is_what_was_added_to_the_motion(place: int, state: int) -> None:
    """To the mean, a cosine or a sine; in parts of the state's amplitude, at the motion's own harmonics."""
    balance = solved().balance
    c = balance.coefficients(solved().z).copy()
    amplitude = np.hypot(*c[1:3])[state]
    c[place, state] += 0.01 * amplitude
    low, error = balance.error(balance.unknowns(c), OMEGA)
    assert low == pytest.approx(0.01, rel=0.03)
    assert error == pytest.approx(low, rel=1e-6)
