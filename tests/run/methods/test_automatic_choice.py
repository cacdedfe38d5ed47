"""What "auto" chooses, and why: exponentials, series or Runge-Kutta, and IDA where nothing moves."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from tests.many_runs.test_in_lanes import Relaxing


class Decay(gl.Component):
    """x' = u + w - x^2 or, if it is linear, u + w - x; the motion may be driven by time."""

    linear, driven = gl.Structural(False), gl.Structural(False)
    x, u = gl.Variable("any", start=1.0), gl.Input("any")

    def equations(self) -> list[Any]:
        drive = gl.sin(gl.time) if self.driven else 0.0
        return [gl.Eq(gl.der(self.x), self.u + drive - (self.x if self.linear else self.x**2))]


@cache
def system(**kind: bool) -> gl.System:
    return gl.compile(Decay(**kind))


NOT_LINEAR = "the equations are not linear with constant coefficients"
STEADY = f"{NOT_LINEAR}; the run begins in a steady state, which nothing leaves with time"


@pytest.mark.parametrize(
    ("kind", "start", "u", "why", "implicit"),
    [
        ({"linear": True}, None, 4.0, "the scene is linear and time-invariant", False),
        ({}, None, 4.0, NOT_LINEAR, False),
        ({}, {"x": 2.0}, 4.0, NOT_LINEAR, False),  # steady, too, but that is not known
        ({}, "steady", 4.0, STEADY, True),
        ({"driven": True}, "steady", 4.0, NOT_LINEAR, False),
        ({}, "steady", gl.Table([0.0, 1.0], [4.0, 9.0]), NOT_LINEAR, False),
        ({}, "steady", lambda t: 4.0, NOT_LINEAR, False),
        ({"linear": True}, None, lambda t: 4.0, "an input is a Python function", False),
    ],
)
def test_the_choice_and_its_reason(kind: dict[str, bool], start: Any, u: Any, why: str, implicit: bool) -> None:
    run = system(**kind).simulate(0.25, samples=3, start=start, inputs={"u": u})
    assert run.stats["why"] == why
    assert (run.stats["method"] == "ida") == implicit
    assert (run.stats["method"] == "exact") == (why.startswith("the scene is linear"))
    if implicit:
        assert run["x"] == pytest.approx([2.0] * 3, rel=1e-9)


def test_counts_of_all_legs_are_added() -> None:
    """A relaxation oscillator that an explicit method begins and IDA goes on with: more of everything than in its first part alone."""
    whole, begun = (gl.compile(Relaxing()).simulate(t, samples=2, parameters={"mu": 3e4}) for t in (5.0, 1e-3))
    assert whole.stats["legs"] > 1
    assert begun.stats["legs"] == 1
    for count in ("steps", "rhs", "work"):
        assert whole.stats[count] is not None, count
        assert whole.stats[count] > begun.stats[count] > 0, count
    assert whole.stats["jac"] > 0


class Stiff(gl.Component):
    """A state that follows an input slowly, and one that follows it at once."""

    u = gl.Input("1")
    x, y = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.u - self.x**3), gl.Eq(gl.der(self.y), -1e5 * (self.y - gl.sin(self.x)))]


def test_an_input_is_asked_in_counted_evaluations() -> None:
    """Of both parts: most of them are those of the explicit method, before it hands over."""
    asked: list[float] = []

    def u(t: float) -> float:
        asked.append(t)
        return float(np.cos(t))

    whole = gl.compile(Stiff()).simulate(1.0, samples=2, inputs={"u": u})
    assert whole.stats["legs"] == 2
    assert whole.stats["rhs"] >= len(asked) > 0.5 * whole.stats["rhs"]
