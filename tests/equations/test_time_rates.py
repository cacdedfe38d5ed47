"""Rates of what time drives, against the spacing of the zeros of sampled expressions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


class Drive(gl.Component):
    """A torque by an expression of time with a frequency as a parameter."""

    omega = gl.Parameter("rad/s", "frequency", default=7.0)
    kind = gl.Structural("sine")

    def assemble(self) -> list[Any]:
        t, w = gl.time, self.omega
        tau = {
            "sine": gl.sin(w * t + 1),
            "sum": 2 + 3 * t**2 + gl.cos(3 * t) + gl.sin(2 * w * t),
            "beat": gl.sin(3 * t) * gl.cos(w * t),
            "power": gl.sin(w * t) ** 4,
            "bell": gl.exp(-((w * (t - 1)) ** 2) / 2),
            "decay": gl.exp(-3 * t) * t,
            "chirp": gl.sin((w * t) ** 2),
            "quotient": 1 / (2 + gl.sin(w * t)),
        }[self.kind]
        self.torque, self.body = gp.Torque(tau=tau), gp.Inertia(J=1.0)
        return [gl.connect(self.torque.flange, self.body.flange_a)]


@pytest.mark.parametrize(
    ("kind", "rate"), [("sine", 5.0), ("sum", 10.0), ("beat", 8.0), ("power", 20.0), ("bell", 5.0), ("decay", 0.0)]
)
def test_the_fastest_of_what_time_drives(kind: str, rate: float) -> None:
    translation = gl.compile(Drive(kind=kind), outputs=["body.w"]).translation
    fastest = translation.scene.fastest_drive
    assert fastest.known
    assert fastest(translation.parameter_values({"omega": 5.0})) == pytest.approx(rate)
    if kind in ("sine", "sum", "beat", "power"):  # no term of the Fourier series is faster
        t = np.arange(4096) * (2 * math.pi / 4096)
        f = {"sine": np.sin(5 * t + 1), "sum": np.cos(3 * t) + np.sin(10 * t), "beat": np.sin(3 * t) * np.cos(5 * t)}
        weights = np.abs(np.fft.rfft(f.get(kind, np.sin(5 * t) ** 4)))
        assert np.flatnonzero(weights > 1e-6 * weights.max()).max() == rate


@pytest.mark.parametrize("kind", ["chirp", "quotient"])
def test_what_has_no_rate(kind: str) -> None:
    assert not gl.compile(Drive(kind=kind), outputs=["body.w"]).translation.scene.fastest_drive.known
