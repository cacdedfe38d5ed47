"""A run stops where an expression ceases to exist, by every method, and says which one; what is only written as a quotient goes on."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import pytest
from scipy.integrate import quad

import gearlib as gl
from gearlib.errors import SolverError

METHODS = [
    ("rk5", 1e-2),
    ("rk5", 1e-3),
    ("rk5", 1e-6),
    ("rk8", 1e-3),
    ("rk8", 1e-9),
    ("ida", 1e-2),
    ("ida", 1e-3),
    ("ida", 1e-6),
]


def leaf(dx: Callable[[Any], Any], dy: Callable[[Any], Any], more: Callable[[Any], list[Any]] = lambda s: []) -> gl.Component:
    """x from 1 on, and y."""

    def equations(self: Any) -> list[Any]:
        return [gl.Eq(gl.der(self.x), dx(self)), gl.Eq(gl.der(self.y), dy(self)), *more(self)]

    declared = {"x": gl.Variable("1", start=1.0), "y": gl.Variable("1", start=0.0), "p": gl.Parameter("1", default=-1.0)}
    made: gl.Component = type("Leaf", (gl.Component,), declared | {"equations": equations})()
    return made


def down(s: Any) -> Any:
    return -1.0


POLES: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any], float, str]] = {  # with when it is met, and how it is named
    "division": (lambda s: -1 / s.x, lambda s: 0, 0.5, "der(x) = -1/x"),
    "square": (lambda s: -1 / s.x**2, lambda s: 0, 1 / 3, "der(x) = -1/x**2"),
    "cube": (lambda s: -1 / s.x**3, lambda s: 0, 0.25, "der(x) = -1/x**3"),
    "magnitude": (lambda s: -1 / abs(s.x), lambda s: 0, 0.5, "der(x) = -1/Abs(x)"),
    "exponent": (lambda s: -(s.x**s.p), lambda s: 0, 0.5, "der(x) = -x**p"),
    "sum": (down, lambda s: 3 + s.y + 1 / (s.x - 0.5), 0.5, "1/(x - 0.5)"),
    "time": (down, lambda s: 1 / (gl.time - 0.7), 0.7, "1/(time - 0.7)"),
    "tangent": (down, lambda s: gl.tan(1 - s.x), math.pi / 2, "tan(x - 1)"),
    "branch": (down, lambda s: gl.Piecewise((s.x, s.x > 0.6), (1 / (s.x - 0.3), True)), 0.7, "1/(x - 0.3)"),
    "root": (down, lambda s: gl.sqrt(s.x - 0.5), 0.5, "sqrt(x - 0.5)"),
    "root below": (down, lambda s: 1 / gl.sqrt(s.x - 0.5), 0.5, "x - 0.5"),
    "logarithm": (down, lambda s: gl.log(s.x - 0.5), 0.5, "log(x - 0.5)"),
    "power": (down, lambda s: (s.x - 0.5) ** 1.5, 0.5, "(x - 0.5)**1.5"),
    "arcsine": (lambda s: 1.0, lambda s: gl.asin(s.x - 0.5), 0.5, "asin(x - 0.5)"),
    "arccosine": (lambda s: 1.0, lambda s: gl.acos(s.x - 0.5), 0.5, "acos(x - 0.5)"),
    "escape": (lambda s: s.x**2, lambda s: 0, 1.0, "der(x) = x**2"),
}


@pytest.mark.parametrize("name", POLES)
def test_a_run_stops_at_a_pole(name: str) -> None:
    """At coarse tolerances, too, where a step would reach beyond it, and the numbers there look harmless."""
    dx, dy, at, expression = POLES[name]
    system = gl.compile(leaf(dx, dy))
    for method, rtol in METHODS:
        with pytest.raises(SolverError, match=re.escape(expression)) as caught:
            system.simulate(3.0, samples=4, method=method, rtol=rtol)
        when = re.search(r"at t ?= ?([\d.e+-]+)", str(caught.value))
        assert when is not None
        assert float(when[1]) == pytest.approx(at, rel=0.02), (method, rtol)
        assert "Leaf: " in str(caught.value)


def _between(function: Callable[[float], float], x: float) -> float:
    """The integral over v = x - 0.5 .. 0.5, where the function is not evaluated at zero."""
    value: float = quad(function, x - 0.5, 0.0, epsabs=1e-12)[0] + quad(function, 0.0, 0.5, epsabs=1e-12)[0]
    return value


QUOTIENTS: dict[str, tuple[Callable[[Any], Any], Callable[[float], float]]] = {  # and the integral from x to 1
    "sine": (lambda s: gl.sin(s.x - 0.5) / (s.x - 0.5), lambda x: _between(lambda v: math.sin(v) / v, x)),
    "cosine": (lambda s: (1 - gl.cos(s.x - 0.5)) / (s.x - 0.5), lambda x: _between(lambda v: (1 - math.cos(v)) / v, x)),
    "common factor": (lambda s: 2 * s.x / (s.x + s.x**3), lambda x: 2 * (math.atan(1) - math.atan(x))),
    "sign": (lambda s: (s.x - 0.5) / abs(s.x - 0.5), lambda x: 0.5 - abs(x - 0.5)),
    "another branch": (lambda s: gl.Piecewise((0, s.x < 0.5), (1 / s.x, True)), lambda x: math.log(2)),
    "around zero": (lambda s: gl.Piecewise((1 / s.x, abs(s.x) > 0.5), (4 * s.x, True)), lambda x: 0.0 - math.log(abs(x))),
    "around zero without events": (
        lambda s: gl.no_event(gl.Piecewise((1 / s.x, gl.Or(s.x > 0.5, s.x < -0.5)), (4 * s.x, True))), lambda x: -math.log(abs(x)),
    ),
    "positive": (lambda s: 1 / (1 + s.x**2), lambda x: math.atan(1) - math.atan(x)),
    "exponent": (lambda s: s.x ** (-2 * s.p), lambda x: (1 - x**3) / 3),
    "power of a magnitude": (
        lambda s: gl.sign(s.x - 0.5) * abs(s.x - 0.5) ** 1.85, lambda x: (0.5**2.85 - abs(x - 0.5) ** 2.85) / 2.85,
    ),
    "unknown power of a magnitude": (lambda s: abs(s.x - 0.5) ** -s.p, lambda x: (0.25 + (x - 0.5) ** 2) / 2),
    "power of a magnitude and more": (
        lambda s: (abs(s.x - 0.5) + 0.1) ** -1.5, lambda x: 4 / math.sqrt(0.1) - 2 / math.sqrt(0.6) - 2 / math.sqrt(abs(x - 0.5) + 0.1),
    ),
    "root of a magnitude": (lambda s: gl.sqrt(abs(s.x - 0.5)), lambda x: (0.5**1.5 + (0.5 - x) ** 1.5) / 1.5),
    "root of an extremum": (lambda s: gl.sqrt(gl.Max(s.x - 0.5, 0)), lambda x: 0.5**1.5 / 1.5),
    "logarithm of an extremum": (
        lambda s: gl.log(gl.Max(s.x - 0.5, 0.1)), lambda x: 0.5 * math.log(0.5) - 0.4 + (0.5 - x) * math.log(0.1),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", QUOTIENTS)
def test_what_is_finite_goes_on(name: str) -> None:
    dy, integral = QUOTIENTS[name]
    system = gl.compile(leaf(down, dy))
    for method, rtol in METHODS:
        result = system.simulate(2.1, samples=4, method=method, rtol=rtol)
        allowed = (200 if "without events" in name else 20) * rtol
        assert result["y"][-1] == pytest.approx(integral(-1.1), rel=allowed, abs=allowed), (method, rtol)


def test_a_divisor_may_jump_over_zero() -> None:
    model = leaf(down, lambda s: 1 / s.x, lambda s: [gl.When(s.x < 0.25, gl.reinit(s.x, -0.5))])
    system = gl.compile(model)
    for method, rtol in METHODS:
        y = system.simulate(1.25, samples=2, method=method, rtol=rtol)["y"][-1]
        assert y == pytest.approx(math.log(4) - math.log(2), rel=20 * rtol)


def test_an_input_that_is_divided_by_may_jump_over_zero() -> None:
    class Driven(gl.Component):
        u = gl.Input("1", "divisor")
        x = gl.Variable("1", start=0.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), 1 / self.u)]

    system = gl.compile(Driven())
    step, ramp = gl.Table([0.0, 0.5, 0.5, 1.0], [1.0, 1.0, -2.0, -2.0]), gl.Table([0.0, 1.0], [1.0, -1.0])
    for method, rtol in METHODS:
        x = system.simulate(1.0, samples=2, method=method, rtol=rtol, inputs={"u": step})["x"][-1]
        assert x == pytest.approx(0.25, abs=5 * rtol)
        with pytest.raises(SolverError, match="Driven: "):
            system.simulate(1.0, samples=2, method=method, rtol=rtol, inputs={"u": ramp})


@pytest.mark.parametrize("kind", ["nonlinear", "many"])
def test_divisors_in_loops(kind: str) -> None:
    """A program that is not written out."""

    class One(gl.Component):
        x = gl.Variable("1", start=1.0)
        z = gl.Variable("1", guess=1.0)
        a = gl.Parameter("1", default=1.0)

        def equations(self) -> list[gl.Eq]:
            second = self.z + self.z**3 if kind == "nonlinear" else self.z
            return [gl.Eq(gl.der(self.x), -self.a / self.x + 0 * self.z), gl.Eq(second, self.x)]

    class Several(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = [One(a=0.1 + (k == 7)) for k in range(10 if kind == "nonlinear" else 300)]
            return []

    system = gl.compile(Several())
    for method, rtol in METHODS[::3]:
        with pytest.raises(SolverError, match=r"fastest of all goes part\[7\]\.x"):
            system.simulate(3.0, samples=4, method=method, rtol=rtol)
    assert system.simulate(0.4, samples=2)["part[7].x"][-1] == pytest.approx(math.sqrt(1 - 0.88), rel=1e-5)
