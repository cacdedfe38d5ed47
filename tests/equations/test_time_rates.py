"""Rates of what time drives, against the spacing of the zeros of sampled expressions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.equations.kernel import residual_kernel
from gearlib.equations.template import template_of
from gearlib.equations.time_rates import time_rates

t, x = gl.time, sympy.Symbol("x", real=True)


def rates(expression: Any, w: float = 5.0) -> list[float] | None:
    """The rates of the kernel of an expression with a parameter w."""
    template = template_of(gl.Eq(expression, 0), "test", lambda name: name == "w")
    found = time_rates(residual_kernel(template))
    return None if found is None else [float(rate.subs(sympy.Symbol("p0", real=True), w)) for rate in found]


W = sympy.Symbol("w", real=True)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (gl.sin(W * t + 1), [5]), (gl.cos(1 - W * t), [5]), (2 + 3 * t**2 + gl.cos(3 * t) + gl.sin(2 * W * t), [3, 10]),
        (gl.sin(3 * t) * gl.cos(W * t), [3, 5, 8]), (gl.sin(W * t) ** 4, [20]), (gl.exp(-((W * (t - 1)) ** 2) / 2), [5]),
        (gl.exp(-3 * t) * t, []), (3 * x - 2, []), (gl.sin(x) * t, []), (7 * gl.sin(t), [1]), (x * gl.sin(2 * t), [2]),
        (gl.Piecewise((gl.sin(2 * t), x > 1), (gl.cos(3 * t), True)), [2, 3]), (gl.sin(2 * t) + gl.sin(2 * t + 1), [2]),
        (gl.sin((W * t) ** 2), None), (1 / (2 + gl.sin(W * t)), None), (gl.exp(t**3), None), (gl.exp(gl.sin(t)), None),
        (gl.sqrt(t), None),
        (gl.sin(x * t), None), (gl.atan(t), None), (gl.sin(t) + gl.atan(t), None), (gl.sin(t) * gl.atan(t), None),
        ((t + gl.atan(t)) ** 2, None),
        (gl.no_event(gl.Piecewise((1, t < 1), (gl.sin(t), True))), None), (gl.Piecewise((gl.atan(t), x > 1), (0, True)), None),
    ],
)  # fmt: skip
def test_rates_of_an_expression(expression: Any, expected: list[float] | None) -> None:
    found = rates(expression)
    assert (None if found is None else sorted(found)) == (None if expected is None else pytest.approx(expected))


@pytest.mark.parametrize(
    "expression",
    [gl.sin(5 * t + 1), gl.cos(3 * t) + gl.sin(10 * t), gl.sin(3 * t) * gl.cos(5 * t), gl.sin(5 * t) ** 4,
     gl.sin(2 * t) * gl.cos(3 * t) ** 2],
)  # fmt: skip
def test_no_term_of_the_fourier_series_is_faster(expression: Any) -> None:
    values = sympy.lambdify(t, expression)(np.arange(1024) * (2 * math.pi / 1024))
    weights = np.abs(np.fft.rfft(values))
    assert np.flatnonzero(weights > 1e-6 * weights.max()).max() == max(rates(expression) or [])


class Drive(gl.Component):
    """A torque by an expression of time with a frequency as a parameter."""

    omega = gl.Parameter("rad/s", "frequency", default=7.0)
    steady = gl.Structural(True)

    def assemble(self) -> list[Any]:
        tau = gl.sin(3 * t) * gl.cos(self.omega * t) if self.steady else gl.sin((self.omega * t) ** 2)
        self.torque, self.body = gp.Torque(tau=tau), gp.Inertia(J=1.0)
        return [gl.connect(self.torque.flange, self.body.flange_a)]


def test_the_fastest_of_what_time_drives() -> None:
    translation = gl.compile(Drive(), outputs=["body.w"]).translation
    fastest = translation.scene.fastest_drive
    assert fastest.known
    assert fastest(translation.parameter_values({"omega": 5.0})) == pytest.approx(8.0)
    assert not gl.compile(Drive(steady=False), outputs=["body.w"]).translation.scene.fastest_drive.known
