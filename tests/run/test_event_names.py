"""Names of events: the component and its equation; the outermost component is called by its class, once."""

from __future__ import annotations

from typing import Any

import gearlib as gl


class Ball(gl.Component):
    """A ball that bounces, pushed up while it is below 0.5 m."""

    x, v = gl.Variable("m", "height", start=1.0), gl.Variable("m/s", "speed", start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), gl.Piecewise((-10, self.x > 0.5), (-1, True))),
            gl.When(self.x < 0.1, gl.reinit(self.v, -0.8 * self.v)),
        ]


class Box(gl.Component):
    def assemble(self) -> list[Any]:
        self.inner = Ball()
        return []


def test_event_of_the_outermost_component_has_its_class_once() -> None:
    names = {name for _, name in gl.simulate(Ball(), 1.0, method="rk").events}
    assert names == {"Ball: der(v) = Piecewise((-10, x > 0.5), (-1, True))", "Ball: when_0"}
    names = {name for _, name in gl.simulate(Box(), 1.0, method="rk").events}
    assert names == {"inner: Ball: der(v) = Piecewise((-10, x > 0.5), (-1, True))", "inner: Ball: when_0"}
