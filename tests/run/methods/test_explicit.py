"""The order of Runge-Kutta's method: by the tolerance, unless the points of tables limit the steps anyway."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.run.methods.explicit import Explicit, Explicit5, Explicit8, order_of
from gearlib.run.methods.native_problem import problem_of
from gearlib.run.methods.run import Run
from gearlib.run.start_values import Start
from gearlib.solvers.inputs.moving import Callbacks


@pytest.mark.parametrize(
    ("rtol", "points", "order"), [(1e-3, 0, 5), (1e-6, 0, 5), (0.99e-6, 0, 8), (1e-12, 999, 8), (1e-6, 10**6, 5)]
)
def test_the_order_follows_the_tolerance(rtol: float, points: int, order: int) -> None:
    problem: Any = SimpleNamespace(rtol=rtol, time_events=np.zeros(points))
    assert order_of(problem) == order
    assert Explicit().stepper(problem).order == order
    assert (Explicit5().stepper(problem).order, Explicit8().stepper(problem).order) == (5, 8)


class Driven(gl.Component):
    """A pendulum of some frequency under a torque that is a table."""

    omega = gl.Parameter("any", default=1.0)
    x, v, u = gl.Variable("any", start=1.0), gl.Variable("any", start=0.0), gl.Input("any")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), -(self.omega**2) * gl.sin(self.x) + self.u)]


SYSTEM = gl.compile(Driven())


@pytest.mark.parametrize(
    ("omega", "points", "order"), [(1.0, 2001, 5), (50.0, 2001, 5), (600.0, 2001, 8), (1e4, 2001, 8), (1.0, 900, 8)]
)
def test_many_points_are_crossed_with_order_5_where_they_limit_the_steps(omega: float, points: int, order: int) -> None:
    """In 1 s; where the motion needs much shorter steps than the points allow, the tolerance decides."""
    scene, times = SYSTEM.translation.scene, np.linspace(0.0, 1.0, points)
    table = gl.Table(times, np.zeros(points))
    numbers = scene.prepared(SYSTEM.translation.parameter_values({"omega": omega}))
    start = Start(np.array([{"x": 1.0, "v": 0.0}[name] for name in scene.state_names]), np.zeros(scene.model.n_variables), ())
    run = Run(scene, numbers, start, (table,), np.array([0.0, 1.0]), 1e-8, None)
    assert order_of(problem_of(run, Callbacks(), False)) == order
