"""Operating points at which a comparison is about to change: the linear model is of one side, and that is told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import GearlibWarning

C = gl.Parameter("N.m/rad", default=100.0)


class Coupling(gl.Component):
    """A torque over an angle."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    c = C
    limit = gl.Parameter("rad", default=0.2)
    law = gl.Structural(None)

    def equations(self) -> list[Any]:
        a, b = self.flange_a, self.flange_b
        return [gl.Eq(b.tau, self.law(self.c, b.phi - a.phi, self.limit)), gl.Eq(a.tau, -b.tau)]


class Held(gl.Component):
    """A body on such a coupling."""

    law, count = gl.Structural(None), gl.Structural(1)
    phi = gl.Parameter("rad", default=0.0)

    def assemble(self) -> list[Any]:
        self.ground, self.damper = gp.Fixed(), gp.Damper(d=0.1)
        self.body = gp.Inertia(J=1.0, start={"phi": self.phi, "w": 0.0})
        self.coupling = [Coupling(law=self.law) for _ in range(self.count)]
        return [
            gl.connect(self.ground.flange, self.damper.flange_a, *(c.flange_a for c in self.coupling)),
            gl.connect(self.body.flange_a, self.damper.flange_b, *(c.flange_b for c in self.coupling)),
        ]


TABLE = gl.Table([-1.0, 0.0, 1.0], [-10.0, 0.0, 100.0])
CORNERS = {  # with the stiffness on the left and on the right
    "one side": (lambda c, x, b: gl.Max(c * x, 0), 0.0, 100.0),
    "two slopes": (lambda c, x, b: gl.Piecewise((c * x, x >= 0), (0.1 * c * x, True)), 10.0, 100.0),
    "no event": (lambda c, x, b: gl.no_event(gl.Max(c * x, 0)), 0.0, 100.0),
    "size": (lambda c, x, b: c * abs(x), -100.0, 100.0),
    "table": (lambda c, x, b: TABLE(x) * c / 100, 10.0, 100.0),
}
SMOOTH = {
    "same slope": lambda c, x, b: gl.Piecewise((c * x, x >= 0), (c * x + c * x**2 / b, True)),
    "parabola": lambda c, x, b: c * x + c * x * abs(x) / b,
    "beside": lambda c, x, b: gl.Max(c * (x - b), 0) + c * x,
}


@pytest.mark.parametrize("law", CORNERS)
def test_a_corner_at_the_operating_point_is_told(law: str) -> None:
    given, left, right = CORNERS[law]
    system = gl.compile(Held(law=given), outputs=["body.phi"])
    said = (
        r"at this operating point there is a corner in the equations of coupling\[0\] \(.*flange_[ab]\.phi.* = 0\): the linear"
    )
    for analysis in (gl.modes, gl.stability, gl.System.linearize):
        with pytest.warns(GearlibWarning, match=said) as told:
            analysis(system)
        assert {w.filename for w in told} == {__file__}
    for phi, stiffness in ((-0.1, left), (0.1, right)):
        poles = np.linalg.eigvals(system.linearize(at={"body.phi": phi}).A)
        assert np.prod(poles).real == pytest.approx(stiffness, abs=1e-9)


@pytest.mark.parametrize("law", SMOOTH)
def test_where_the_sides_agree_nothing_is_told(law: str) -> None:
    model = gl.compile(Held(law=SMOOTH[law]), outputs=["body.phi"]).linearize()
    assert sorted(np.linalg.eigvals(model.A).imag) == pytest.approx([-np.sqrt(100 - 0.05**2), np.sqrt(100 - 0.05**2)])


@pytest.mark.parametrize("row", [0, 1, 2])
def test_a_comparison_of_one_component_does_not_decide_for_another(row: int) -> None:
    """The other couplings are cut out by comparisons of their own: what is a corner in them has no effect."""
    system = gl.compile(Held(law=lambda c, x, b: gl.Piecewise((gl.Max(c * x, 0), x > -b), (0, True)), count=3))
    limits = {f"coupling[{k}].limit": 1.0 if k == row else -1.0 for k in range(3)}
    with pytest.warns(GearlibWarning, match=rf"equations of coupling\[{row}\] \([^=]* = 0\): the linear"):
        gl.modes(system, parameters=limits)


def test_each_component_is_named_with_what_it_compares() -> None:
    system = gl.compile(Held(law=lambda c, x, b: gl.Max(c * (x - b), 0) + c * x, count=2))
    with pytest.warns(
        GearlibWarning, match=r"of coupling\[0\] \(.*limit.* = 0\), coupling\[1\] \(.*limit.* = 0\): the linear model is"
    ):
        gl.modes(system, at={"body.phi": 0.2})
    with pytest.warns(GearlibWarning, match=r"of coupling\[1\] \("):
        gl.modes(system, at={"body.phi": 0.1}, parameters={"coupling[1].limit": 0.1})
    gl.modes(system, at={"body.phi": 0.1})
