"""Recurrences for Taylor coefficients: every operation against mpmath's series, whole runs against SciPy's integration."""

from __future__ import annotations

import math
import re
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.native.series_source import ROW, SERIES, NoSeriesError, taylor_source
from gearlib.native.source import LONGEST

EXPRESSIONS: dict[str, tuple[Any, Any]] = {
    "polynomial": (lambda x, t: 1 - x**2 + x**3 / 5, lambda x, t: 1 - x**2 + x**3 / 5),
    "quotients": (lambda x, t: x / (1 + x) + t / (2 + x), lambda x, t: x / (1 + x) + t / (2 + x)),
    "sine of time": (lambda x, t: gl.sin(5 * t + 1) * x - gl.cos(t), lambda x, t: math.sin(5 * t + 1) * x - math.cos(t)),
    "chirp": (lambda x, t: gl.sin(4 * t * t) - x, lambda x, t: math.sin(4 * t * t) - x),
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
def test_runs_by_series(kind: str) -> None:
    times = np.linspace(0.0, 1.0, 6)
    result = gl.compile(Grows(kind=kind)).simulate(1.0, times=times, method="taylor", rtol=1e-12, atol=1e-14)
    right = EXPRESSIONS[kind][1]
    found = solve_ivp(lambda t, x: [right(x[0], t)], (0.0, 1.0), [0.7], "DOP853", times, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(result["x"], found.y[0], rtol=3e-11)
    assert result.stats["method"] == "taylor"
    assert result.stats["steps"] < 120  # a series that were wrong at some order would take very short steps


FUNCTIONS: dict[str, tuple[Any, Any]] = {
    "powers": (lambda x, t: x**0 * t + x**5 - x**-3 + x**8 / t**9, lambda x, t: t + x**5 - x**-3 + x**8 / t**9),
    "broken powers": (lambda x, t: x**2.5 + (x * t) ** -0.5 + t**1.5, lambda x, t: x**2.5 + (x * t) ** -0.5 + t**1.5),
    "high powers": (lambda x, t: x**9 - x**-11 + x**8 + t**-8, lambda x, t: x**9 - x**-11 + x**8 + t**-8),
    "powers of powers": (lambda x, t: x**t + 2**x + x ** (gl.sqrt(2) / 3), lambda x, t: x**t + 2**x + x ** (mp.sqrt(2) / 3)),
    "quotients": (lambda x, t: 3 / x + x / t - t / (x * 2) + x / 7, lambda x, t: 3 / x + x / t - t / (x * 2) + x / 7),
    "products with time": (lambda x, t: t * t * x + x * t, lambda x, t: t * t * x + x * t),
    "root": (lambda x, t: gl.sqrt(x * t) - gl.sqrt(t), lambda x, t: mp.sqrt(x * t) - mp.sqrt(t)),
    "exponentials": (lambda x, t: gl.exp(x * t) - gl.exp(-t) + gl.exp(x), lambda x, t: mp.exp(x * t) - mp.exp(-t) + mp.exp(x)),
    "logarithms": (lambda x, t: gl.log(x) * gl.log(t + x * x), lambda x, t: mp.log(x) * mp.log(t + x * x)),
    "circular": (
        lambda x, t: gl.sin(x * x) - gl.cos(x) + gl.sin(t) / gl.cos(t) + gl.tan(x / 2),
        lambda x, t: mp.sin(x * x) - mp.cos(x) + mp.sin(t) / mp.cos(t) + mp.tan(x / 2),
    ),
    "hyperbolic": (lambda x, t: gl.sinh(x) - gl.cosh(t) + gl.tanh(x * t), lambda x, t: mp.sinh(x) - mp.cosh(t) + mp.tanh(x * t)),
    "arcs": (
        lambda x, t: gl.atan(x) - gl.asin(x / 4) + gl.acos(t / 3) - gl.asin(t / 2),
        lambda x, t: mp.atan(x) - mp.asin(x / 4) + mp.acos(t / 3) - mp.asin(t / 2),
    ),
    "areas": (
        lambda x, t: sympy.asinh(x) - sympy.acosh(2 + x) + sympy.atanh(x / 4) - gl.atan(t),
        lambda x, t: mp.asinh(x) - mp.acosh(2 + x) + mp.atanh(x / 4) - mp.atan(t),
    ),
    "angles": (
        lambda x, t: gl.atan2(x, t) + gl.atan2(x, 2) - gl.atan2(-3, t),
        lambda x, t: mp.atan2(x, t) + mp.atan2(x, 2) - mp.atan2(-3, t),
    ),
    "magnitudes": (lambda x, t: gl.no_event(abs(x - 2) * t - abs(t)), lambda x, t: (2 - x) * t - t),
    "magnitude of a variable": (lambda x, t: gl.no_event(abs(x) * x * t), lambda x, t: x * x * t),
    "signs": (lambda x, t: gl.no_event(gl.sign(x - 2) * t * x + gl.sign(t)), lambda x, t: 1 - t * x),
    "largest and smallest": (
        lambda x, t: gl.no_event(sympy.Max(x, 1) * t - sympy.Min(x, 3) + sympy.Max(t, x) - sympy.Min(x * t, 1) * x),
        lambda x, t: x * t - x + x - x,
    ),
    "branches": (
        lambda x, t: gl.no_event(gl.Piecewise((x, (x > 1) & (t < 5)), (t, True)) - gl.Piecewise((1, x < t), (t, True))),
        lambda x, t: x - 1 if x < t else x - t,
    ),
    "the middle of three": (  # its conditions hold conditions
        lambda x, t: gl.no_event(sympy.Min(x, 1, t) * x + sympy.Max(2, x, t) * t),
        lambda x, t: t * x + 2 * t,
    ),
    "what is not so": (
        lambda x, t: gl.no_event(gl.Piecewise((x, ~((x > 1) & (t > 5))), (t, True)) - gl.Piecewise((x, ~(x > 1)), (t**2, True))),
        lambda x, t: x - t**2,
    ),
}  # fmt: skip
ORDER = 11


def driven(kinds: tuple[str, ...]) -> gl.Component:
    """der(x) = 1, and der(y) = f(x, t) for several functions."""

    def equations(self: Any) -> list[Any]:
        right = {f"y{i}": FUNCTIONS[kind][0](self.x, self.rate * gl.time) for i, kind in enumerate(kinds)}
        return [gl.Eq(gl.der(getattr(self, name)), value * self.rate) for name, value in ({"x": 1.0} | right).items()]

    variables = {name: gl.Variable("1") for name in ("x", *(f"y{i}" for i in range(len(kinds))))}
    rate = gl.Parameter("1/s", "makes time a number", default=1.0)
    return type("Driven", (gl.Component,), {"rate": rate, **variables, "equations": equations})()  # type: ignore[no-any-return]


@pytest.mark.parametrize("half", [0, 1])
def test_coefficients_are_those_of_the_exact_solution(half: int) -> None:
    """From x = 1.3 at t = 0.8 on, x = t + 0.5, so that y is an integral over time; against mpmath's Taylor series."""
    kinds = (*FUNCTIONS,)[half::2]
    scene = gl.compile(driven(kinds)).translation.scene
    series, n = scene.series, 1 + len(kinds)
    assert not isinstance(series, str), series
    numbers = scene.prepared(scene.model.parameters.evaluate({}))
    data = scene.data(scene.native, numbers, np.zeros(0), np.zeros(scene.n_discrete), np.zeros(scene.model.n_variables))
    c, work = np.zeros((ORDER + 1, n)), np.full(series.rows * ROW + 1, np.nan)  # nothing is read before it is written
    c[0, 0] = 1.3
    SERIES(series.address, 0.8, *(a.ctypes.data for a in (c, work, data, scene.native.index)), ORDER, n)
    assert np.isnan(work[-1])
    assert [scene.model.name(v) for v, _ in scene.states] == ["x", *(f"y{i}" for i in range(n - 1))]
    assert c[1:3, 0].tolist() == [1.0, 0.0]
    for i, kind in enumerate(kinds, 1):
        with mp.workdps(40):
            exact = mp.taylor(lambda t, f=FUNCTIONS[kind][1]: f(t + mp.mpf(1) / 2, t), mp.mpf("0.8"), ORDER - 1)
        wanted = [float(a / k) for k, a in enumerate(exact, 1)]
        np.testing.assert_allclose(c[1:, i], wanted, rtol=1e-12, atol=1e-13 * np.abs(wanted).max(), err_msg=kind)


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
    "none": lambda x, t: x**2 - gl.sin(t) + gl.no_event(gl.Piecewise((1, gl.pi > 3), (2, True))),
    "magnitude": lambda x, t: gl.no_event(abs(x - 1)),
    "magnitude of time": lambda x, t: gl.no_event(abs(t - 1)),
    "sign": lambda x, t: gl.no_event(gl.sign(x - 1)),
    "branch": lambda x, t: gl.no_event(gl.Piecewise((x, x > 1), (1, True))),
    "one of two signs": lambda x, t: gl.no_event(gl.Piecewise((x, t > 1), (-x, True))),
    "branch of branches": lambda x, t: gl.no_event(gl.Piecewise((x, (x > 1) | ~(t > 1)), (1, True))),
    "largest": lambda x, t: gl.no_event(sympy.Max(x, 1)),
    "smallest": lambda x, t: gl.no_event(sympy.Min(x, 1, 2 * t)),
}
PULSES: dict[str, Any] = {
    "bell curve of time": lambda x, t: gl.exp(-(t**2)),
    "bell curve of a state": lambda x, t: gl.exp(-x),
    "growing exponent": lambda x, t: x**t,
}
STEADY: dict[str, Any] = {
    "growth": lambda x, t: gl.exp(2 * t - 1) * x,
    "constant base": lambda x, t: 2**t,
    "oscillation": lambda x, t: gl.sin(t**2) + gl.tanh(x),
    "power": lambda x, t: x**2.5,
    "root": lambda x, t: gl.sqrt(x),
    "arc": lambda x, t: gl.atan(x),
    "hyperbola": lambda x, t: gl.sinh(x),
    "tangent": lambda x, t: gl.tan(x) / (1 + x),
}
HIDING = {*PULSES, "oscillation", "power", "root", "arc", "hyperbola"}


def written(right: Any) -> tuple[str, Any]:
    """Source of the coefficients of x' = f(x, t), and its writer."""

    class Kinked(gl.Component):
        rate = gl.Parameter("1/s", default=1.0)
        x = gl.Variable("1", start=0.7)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), right(self.x, self.rate * gl.time))]

    scene = gl.compile(Kinked()).translation.scene
    return taylor_source(scene.program, scene.layout)


@pytest.mark.parametrize("kind", [*KINKS, *PULSES, *STEADY])
def test_what_a_series_does_not_show_is_known(kind: str) -> None:
    """Kinks that no event marks, exponentials of what is not affine in time, and what is constant to rounding far from where it changes."""
    text, write = written((KINKS | PULSES | STEADY)[kind])
    assert write.branches == bool(write.compared) == (kind in KINKS and kind != "none")
    assert write.pulses == (kind in PULSES)
    assert write.hides == (kind in HIDING)
    assert write.products == text.count("for j in range(")
    assert len({int(at) for at in re.findall(r"work\[(\d+)", text)} - {1 + k * ROW for k in range(write.rows)}) == write.rows


@pytest.mark.parametrize(
    ("one", "other", "affine"),
    [
        (lambda t: 2 * t, lambda t: 1 - t, True),
        (lambda t: 2 * t, lambda t: 3, True),
        (lambda t: 3, lambda t: 2 * t, True),
        (lambda t: 2 * t, lambda t: t**2, False),
        (lambda t: t**2, lambda t: 2 * t, False),
        (lambda t: t**2, lambda t: 3, False),
    ],
)
def test_a_choice_is_affine_in_time_where_both_branches_are(one: Any, other: Any, affine: bool) -> None:
    """So is its exponential shown by a series; a constant is affine, too."""
    _, write = written(lambda x, t: gl.exp(gl.no_event(gl.Piecewise((one(t), x > 1), (other(t), True)))))
    assert write.pulses is not affine
    assert write.branches


def test_many_products_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of time, and repeated ones, cost nothing more."""

    def right(x: Any, t: Any) -> Any:
        return x**4 * t + gl.sin(x) * x**4 + gl.sin(x)

    _, write = written(right)
    assert write.products == 5  # x x, x^2 x^2, two for the sine and cosine, and their product
    for most in (5, 4):
        monkeypatch.setattr("gearlib.native.series_source.MOST_PRODUCTS", most)
        if most == 5:
            assert written(right)[1].products == 5
        else:
            with pytest.raises(NoSeriesError, match=r"^takes up to 4 products and functions of variables$"):
                written(right)
    monkeypatch.setattr("gearlib.native.source.LONGEST", 0)
    with pytest.raises(NoSeriesError, match=rf"^takes up to {LONGEST} equations$"):
        written(right)
