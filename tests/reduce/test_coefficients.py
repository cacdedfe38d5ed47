"""Numbers at the start values, as structure asks for them."""

from __future__ import annotations

import numpy as np

import gearlib as gl
from gearlib.flatten.flatten import flatten
from gearlib.reduce.coefficients import at_start, partials_at, rest_at, start_guess


class Leaf(gl.Component):
    """y is -z, so one of them stands for both."""

    x = gl.Variable("1", "product", guess=5.0)
    y = gl.Variable("1", "one", start=-2.0)
    z = gl.Variable("1", "its opposite")
    p = gl.Parameter("1", "factor", default=3.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.y, -self.z),
            gl.Eq(self.p * self.x * (1 + self.z), self.p**2 + gl.time),
            gl.Eq(gl.der(self.y), 1 + self.p),
        ]


def test_partial_derivatives_at_the_start() -> None:
    model = flatten(Leaf())
    parameters = model.parameters.defaults
    guess = start_guess(model, parameters)
    assert guess[model.representative[model.variable("y")]] * model.sign[model.variable("y")] == -2.0
    assert guess[model.representative[model.variable("z")]] * model.sign[model.variable("z")] == 2.0
    known = at_start(model, parameters)
    for g, group in enumerate(model.groups):
        found = {
            name: float(partials_at(model, g, i, parameters, known)[0]) for i, (name, _) in enumerate(group.template.columns)
        }
        if "x" in found:
            assert found == {"x": 3.0 * (1 + 2), "z": 3.0 * 5.0}
            assert np.isnan(rest_at(model, g, parameters, known)).all()  # varies with time
        else:
            assert found == {"y": 1.0}
            assert rest_at(model, g, parameters, known).tolist() == [-4.0]
