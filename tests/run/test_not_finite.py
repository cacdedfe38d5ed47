"""Outputs that have no finite value at some sample: told, with their name and the time, when they are read."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import gearlib as gl


class Ratios(gl.Component):
    """x falls from 1; y is infinite at the start, z is not a number once x is below a half."""

    x, y, z, u = (gl.Variable("1") for _ in range(4))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), -self.x),
            gl.Eq(gl.time * self.y, 1),
            gl.Eq(self.z, (self.x - 0.5) ** 0.5),
            gl.Eq(self.u, self.z + 1e200),
        ]


@pytest.fixture
def result() -> gl.Result:
    return gl.compile(Ratios()).simulate(1.0, samples=5, start={"x": 1.0})


def test_the_variable_and_the_time_are_named(result: gl.Result) -> None:
    with pytest.warns(RuntimeWarning, match=r"^y is inf at t = 0 s: its equations give it no finite value there") as caught:
        assert result["y"].tolist() == [np.inf, 4.0, 2.0, 4 / 3, 1.0]
    assert caught[0].filename == __file__
    with pytest.warns(RuntimeWarning, match=r"^z is nan at t = 0\.75 s and at 1 more samples"):
        assert np.isfinite(result["z"]).tolist() == [True] * 3 + [False] * 2


def test_finite_values_are_not_complained_about(result: gl.Result) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isfinite(result["x"]).all()
        system = gl.compile(Ratios())
        later = system.simulate(0.5, times=[0.1, 0.5], start={"x": 1.0})
        assert later["y"] == pytest.approx([10.0, 2.0])
        assert later["u"] == pytest.approx(1e200)  # its square is not finite, but it is


def test_it_is_told_once(result: gl.Result) -> None:
    with pytest.warns(RuntimeWarning):
        result["y"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result["y"]
