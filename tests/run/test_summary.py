"""The summary of a model, whole: its counts can be told from the equations."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
import gearparts as gp


class Pendulum(gl.Component):
    """A mass on a rod: a constraint that is differentiated twice, and the definitions of the two speeds once."""

    x = gl.Variable("m", start=0.6)
    y = gl.Variable("m", guess=-0.8)
    u = gl.Variable("m/s")
    v = gl.Variable("m/s")
    T = gl.Variable("1/s2", "tension over mass and length")
    L = gl.Parameter("m", default=1.0)
    g = gl.Parameter("m/s2", default=9.81)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.u),
            gl.Eq(gl.der(self.y), self.v),
            gl.Eq(gl.der(self.u), -self.T * self.x),
            gl.Eq(gl.der(self.v), -self.T * self.y - self.g),
            gl.Eq(self.x**2 + self.y**2, self.L**2),
        ]


PENDULUM = """\
Pendulum: 1 components, 0 connection sets
  flatten     5 equations in 5 variables; 0 aliases removed, 5 equations left in 5 templates
  reduce      structural index 3; 3 equations differentiated, up to 2 times
  states      2 possible, 2 integrated: x, u
  sort        8 unknowns in 3 steps; blocks of 1, 5 (2 nonlinear or varying)
  scene       nonlinear, or with coefficients that vary; outputs: everything, on demand
  start       at their guess, since nothing fixes them: u"""
FORMS = {
    "ode": "",
    "dae": "\n  dae         8 unknowns and as many equations, of which 6 are algebraic; index 1\n    differential  x, u"
    "\n    algebraic     der(der(x)), y, der(y), der(der(y)), der(v), T",
    "torn": "\n  torn        3 unknowns and as many equations, of which 1 are algebraic; index 1\n    differential  x, u"
    "\n    algebraic     y",
}


@pytest.mark.parametrize("form", FORMS)
def test_a_pendulum(form: str) -> None:
    assert gl.compile(Pendulum()).summary(form) == PENDULUM + FORMS[form]


class Decays(gl.Component):
    """A state that nothing else needs, one that is given, and so many numbers that follow from it."""

    n = gl.Structural(12)
    rate = gl.Parameter("1/s", default=1.0)

    def assemble(self) -> list[Any]:
        self.drive, self.body = gp.Torque(), gp.Inertia(J=1.0, start={"phi": 0.0, "w": 2.0})
        self.others = [gp.Inertia(J=1.0) for _ in range(self.n)]
        return [gl.connect(self.drive.flange, self.body.flange_a, *(other.flange_a for other in self.others))]


@pytest.mark.parametrize(("n", "more"), [(12, ""), (14, " and 2 more")])
def test_twelve_names_are_listed(n: int, more: str) -> None:
    """One angle is possible, and dropped where only speeds are outputs."""
    names = [f"others[{i}].w" for i in range(n)]
    lines = gl.compile(Decays(n=n), outputs=names).summary().splitlines()
    assert lines[0] == f"Decays: {n + 3} components, 1 connection sets"
    assert lines[3].startswith("  states      2 possible, 1 integrated: ")
    assert lines[4].endswith(".phi (no output depends on them)")
    assert lines[-2:] == [
        f"  scene       linear, time-invariant; outputs: {', '.join(names[:12])}{more}",
        "  inputs      0 unless a run is given them: drive.tau",
    ]
