"""What is compared with a declared unit when the values of parts are checked."""

from __future__ import annotations

from typing import Any

import gearlib as gl
import gearparts as gp
from gearlib.language.dimensions import values_given
from gearlib.language.units import dimension


class Given(gl.Component):
    """Numbers and expressions, as parameters, start values and guesses."""

    angle = gl.Parameter("rad", default=0.1)
    inertia = gl.Parameter("kg.m2", default=2.0)

    def assemble(self) -> list[Any]:
        self.body = gp.Inertia(J=self.inertia, start={"w": 3.0, "phi": self.angle})
        self.load = gp.Inertia(J=1.0, start={"phi": 2}, guess={"w": 2 * self.angle})
        return [gl.connect(self.body.flange_b, self.load.flange_a)]


def test_expressions_are_compared_and_plain_numbers_are_in_the_declared_unit() -> None:
    given = Given()
    assert sorted((str(value), unit, where) for value, unit, where in values_given(given)) == [
        ("2*angle", dimension("rad/s"), "the start value of load.w"),
        ("angle", dimension("rad"), "the start value of body.phi"),
        ("inertia", dimension("kg.m2"), "body.J"),
    ]
