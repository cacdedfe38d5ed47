"""Start values of inner parts, given by the composite's own user."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


class Stage(gl.Component):
    """A composite that sets the start of a part."""

    flange_a, flange_b = gp.Flange(), gp.Flange()
    w0 = gl.Parameter("rad/s", "start speed", default=1.0)

    def assemble(self) -> list[Any]:
        self.body = [gp.Inertia(J=1.0, start={"w": self.w0}), gp.Inertia(J=1.0)]
        self.shaft = gp.SpringDamper(c=5.0, d=0.0)
        return [
            gl.connect(self.flange_a, self.body[0].flange_a),
            gl.connect(self.body[0].flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.body[1].flange_a),
            gl.connect(self.body[1].flange_b, self.flange_b),
        ]


class Whole(gl.Component):
    """Start values of inner parts, given from outside."""

    w_in = gl.Parameter("rad/s", "start speed", default=4.0)

    def assemble(self) -> list[Any]:
        self.stage = Stage(start={"body[0].w": self.w_in, "shaft.phi_rel": 0.1}, guess={"body[1].w": 3.0})
        return []


def test_a_composite_gives_start_values_to_its_parts() -> None:
    """What is outside wins over the part's own; expressions are those of the component that writes them."""
    system = gl.compile(Whole())
    for w in (4.0, 5.0):
        result = system.simulate(0.01, samples=2, parameters={"w_in": w})
        first = [result[f"stage.{name}"][0] for name in ("body[0].w", "body[1].w", "shaft.phi_rel")]
        assert np.array(first) == pytest.approx([w, 3.0, 0.1])
    assert gl.compile(Stage()).simulate(0.01, samples=2)["body[0].w"][0] == 1.0
    assert gl.compile(Stage(start={"body[0].w": 7.0})).simulate(0.01, samples=2)["body[0].w"][0] == 7.0


def test_start_value_of_an_unknown_inner_variable() -> None:
    with pytest.raises(
        gl.GearlibError, match=r"Stage: start value for 'body\[0\]\.v', which is not a variable of Stage; .*body\[0\]\.w"
    ):
        gl.compile(Stage(start={"body[0].v": 7.0}))
