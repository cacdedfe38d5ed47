"""The choice of states, and of others where the ones in use no longer determine the motion."""

from __future__ import annotations

import numpy as np
import pytest

import gearlib as gl
from gearlib.reduce.reduction import choose_again
from gearlib.run.translation import Translation


class Pendulum(gl.Component):
    """A point on a rod of length 1."""

    x = gl.Variable("1", start=0.0)
    y = gl.Variable("1")
    u = gl.Variable("1", start=1.0)
    v = gl.Variable("1")
    pull = gl.Variable("1", "force of the rod over mass and length")
    g = gl.Parameter("1", default=9.81)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.u),
            gl.Eq(gl.der(self.y), self.v),
            gl.Eq(gl.der(self.u), -self.pull * self.x),
            gl.Eq(gl.der(self.v), -self.pull * self.y - self.g),
            gl.Eq(self.x**2 + self.y**2, 1.0),
        ]


@pytest.fixture(scope="module")
def pendulum() -> Translation:
    return gl.compile(Pendulum(guess={"y": -1.0})).translation


@pytest.mark.parametrize(("angle", "state"), [(0.1, "x"), (1.4, "y"), (-1.8, "y"), (3.0, "x")])
def test_the_larger_pivot_decides_which_coordinate_is_a_state(pendulum: Translation, angle: float, state: str) -> None:
    structure, model = pendulum.scene.structure, pendulum.scene.model
    x, y, u, v = map(model.variable, "xyuv")
    known = np.zeros((3, model.n_variables))
    known[0, [x, y, u, v]] = np.sin(angle), -np.cos(angle), np.cos(angle), np.sin(angle)
    known[1, [x, y]] = known[0, [u, v]]

    def coordinate(states: tuple[tuple[int, int], ...]) -> str:
        (found,) = [name for name, place in (("x", x), ("y", y)) if (place, 0) in states]
        return found

    assert coordinate(structure.states) == "x"
    again = choose_again(structure, pendulum.parameter_values({}), 0.0, known)
    assert coordinate((structure if again is None else again).states) == state
