"""Recurrences for Taylor coefficients: every operation against SciPy's integration of the same equation by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import gearlib as gl
from gearlib.errors import ArgumentError

EXPRESSIONS: dict[str, tuple[Any, Any]] = {
    "polynomial": (lambda x, t: 1 - x**2 + x**3 / 5, lambda x, t: 1 - x**2 + x**3 / 5),
    "negative and broken powers": (lambda x, t: x**-2 + x**1.5 - x**-1.5, lambda x, t: x**-2 + x**1.5 - x**-1.5),
    "roots": (lambda x, t: gl.sqrt(x) + 1 / gl.sqrt(1 + x), lambda x, t: math.sqrt(x) + 1 / math.sqrt(1 + x)),
    "quotients": (lambda x, t: x / (1 + x) + t / (2 + x), lambda x, t: x / (1 + x) + t / (2 + x)),
    "exponentials": (lambda x, t: gl.exp(-x) + gl.exp(-2 * t), lambda x, t: math.exp(-x) + math.exp(-2 * t)),
    "logarithm": (lambda x, t: gl.log(1 + x * x), lambda x, t: math.log(1 + x * x)),
    "sine of the state": (lambda x, t: gl.sin(3 * x) + gl.cos(x * x), lambda x, t: math.sin(3 * x) + math.cos(x * x)),
    "sine of time": (lambda x, t: gl.sin(5 * t + 1) * x - gl.cos(t), lambda x, t: math.sin(5 * t + 1) * x - math.cos(t)),
    "chirp": (lambda x, t: gl.sin(4 * t * t) - x, lambda x, t: math.sin(4 * t * t) - x),
    "tangents": (lambda x, t: gl.tan(x / 3) - gl.tanh(2 * x), lambda x, t: math.tan(x / 3) - math.tanh(2 * x)),
    "hyperbolic": (lambda x, t: gl.sinh(x) / gl.cosh(2 * x), lambda x, t: math.sinh(x) / math.cosh(2 * x)),
    "arcs": (
        lambda x, t: gl.atan(2 * x) - gl.asin(x / 9) + gl.acos(x / 9) / 5,
        lambda x, t: math.atan(2 * x) - math.asin(x / 9) + math.acos(x / 9) / 5,
    ),
    "angle": (lambda x, t: gl.atan2(x, 1 + t), lambda x, t: math.atan2(x, 1 + t)),
    "time": (lambda x, t: t**3 - t * x, lambda x, t: t**3 - t * x),
    "magnitude": (lambda x, t: 1 - abs(x - 3) * x, lambda x, t: 1 - abs(x - 3) * x),
    "constants": (lambda x, t: gl.sqrt(2) * gl.pi / x, lambda x, t: math.sqrt(2) * math.pi / x),
}  # fmt: skip


class Grows(gl.Component):
    """der(x) = an expression of x and time."""

    kind = gl.Structural("polynomial")
    rate = gl.Parameter("1/s", "makes time a number", default=1.0)
    x = gl.Variable("1", "quantity", start=0.7)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), EXPRESSIONS[self.kind][0](self.x, self.rate * gl.time))]


@pytest.mark.parametrize("kind", EXPRESSIONS)
def test_every_operation_has_its_series(kind: str) -> None:
    times = np.linspace(0.0, 1.0, 6)
    result = gl.compile(Grows(kind=kind)).simulate(1.0, times=times, method="taylor", rtol=1e-12, atol=1e-14)
    right = EXPRESSIONS[kind][1]
    found = solve_ivp(lambda t, x: [right(x[0], t)], (0.0, 1.0), [0.7], "DOP853", times, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(result["x"], found.y[0], rtol=3e-11)
    assert result.stats["method"] == "taylor"
    assert result.stats["steps"] < 120  # a series that were wrong at some order would take very short steps


def test_what_has_no_series_is_refused() -> None:
    class Inert(gl.Component):
        """A cubic equation for the torque."""

        w = gl.Variable("1", "speed", start=1.0)
        y = gl.Variable("1", "root of a cubic")

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.w), -self.y), gl.Eq(self.y**3 + self.y, self.w)]

    with pytest.raises(ArgumentError, match=r"method='taylor' has no Taylor series for equations that are solved together"):
        gl.compile(Inert()).simulate(1.0, method="taylor")


KINKS: dict[str, Any] = {
    "none": lambda x, t: x**2 - gl.sin(t),
    "sign": lambda x, t: gl.no_event(gl.sign(x - 1)),
    "branch": lambda x, t: gl.no_event(gl.Piecewise((x, x > 1), (1, True))),
    "largest": lambda x, t: gl.no_event(sympy.Max(x, 1)),
    "smallest": lambda x, t: gl.no_event(sympy.Min(x, 1)),
}


@pytest.mark.parametrize("kind", KINKS)
def test_series_with_kinks_that_no_event_marks_are_known(kind: str) -> None:
    class Kinked(gl.Component):
        rate = gl.Parameter("1/s", default=1.0)
        x = gl.Variable("1", start=0.7)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), KINKS[kind](self.x, self.rate * gl.time))]

    series = gl.compile(Kinked()).translation.scene.series
    assert not isinstance(series, str)
    assert series.branches == (kind != "none")
