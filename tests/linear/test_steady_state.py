"""Steady states: values by closed forms."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


def test_what_is_always_zero_is_zero_in_the_steady_state() -> None:
    """The torque at the loose end of a spring."""

    class Loose(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load, self.spring = gp.Torque(tau=3.0), gp.Inertia(J=1.5), gp.Spring(c=3.0)
            self.brake, self.ground = gp.Damper(d=0.5), gp.Fixed()
            ends = [self.torque.flange, self.load.flange_a, self.brake.flange_a, self.spring.flange_a]
            return [gl.connect(*ends), gl.connect(self.brake.flange_b, self.ground.flange)]

    found = gl.steady_state(gl.compile(Loose()), ["load.w", "spring.flange_b.tau", "brake.flange_b.tau"])
    assert found.values == pytest.approx(np.array([6.0, 0.0, -3.0]))
    assert [found.sensitivity(name, "brake.d") for name in found.names] == pytest.approx([-12.0, 0.0, 0.0], abs=1e-12)


class Leaving(gl.Component):
    """Two states that leave their steady values, and one that comes to its own."""

    a, b, c = gl.Parameter("1/s", default=0.25), gl.Parameter("1/s", default=0.5), gl.Parameter("1/s", default=-3.0)
    x, y, z = gl.Variable("1", start=1.0), gl.Variable("1", start=2.0), gl.Variable("1", start=0.0)

    def equations(self) -> list[gl.Eq]:
        pairs = ((self.x, self.a, 1), (self.y, self.b, 2), (self.z, self.c, 3))
        return [gl.Eq(gl.der(v), rate * (v - end)) for v, rate, end in pairs]


def test_an_unstable_steady_state_is_told_with_its_fastest_growth() -> None:
    system = gl.compile(Leaving())
    with pytest.warns(
        gl.GearlibWarning, match=r"^Leaving: the steady state is unstable, .* by a factor of e in 2 s; a run from"
    ):
        found = gl.steady_state(system)
    assert found.values == pytest.approx(np.array([1.0, 2.0, 3.0]))
    assert gl.steady_state(system, parameters={"a": -0.25, "b": -0.5}).values == pytest.approx(found.values)


def test_a_single_state_that_leaves_is_told_too() -> None:
    class One(gl.Component):
        x, rate = gl.Variable("1", start=1.0), gl.Parameter("1/s", default=0.25)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.rate * (self.x - 3.0))]

    with pytest.warns(
        gl.GearlibWarning, match=r"^One: the steady state is unstable, a motion near it grows by a factor of e in 4 s;"
    ):
        found = gl.steady_state(gl.compile(One()))
    assert found["x"] == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("changing", "speed", "told"),
    [(gl.cos(5 * gl.time), 8.0, True), (gl.sin(5 * gl.time), 6.0, False), (2 * gl.time, 6.0, True), (0.5, 7.0, False)],
)
def test_what_is_off_its_mean_at_first_is_told(changing: Any, speed: float, told: bool) -> None:
    """A torque of 3 N.m, and what changes, against a damper of 0.5 N.m.s/rad; a ramp has no mean."""

    class Shaken(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load = gp.Torque(tau=3.0 + changing), gp.Inertia(J=1.5)
            self.brake, self.ground = gp.Damper(d=0.5), gp.Fixed()
            ends = [self.torque.flange, self.load.flange_a, self.brake.flange_a]
            return [gl.connect(*ends), gl.connect(self.brake.flange_b, self.ground.flange)]

    system = gl.compile(Shaken(), outputs=["load.w"])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = gl.steady_state(system)
    texts = ["Shaken: torque.tau changes with time, and counts with its value at t = 0 in the steady state"] * told
    assert [str(one.message) for one in said] == texts
    assert found["load.w"] == pytest.approx(speed)


def test_functions_of_time_count_with_their_values_at_time_0() -> None:
    """In what the state depends on, and in what is only computed."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load = gp.Torque(), gp.Inertia(J=1.5)
            self.brake, self.ground = gp.Damper(d=0.5), gp.Fixed()
            ends = [self.torque.flange, self.load.flange_a, self.brake.flange_a]
            return [gl.connect(*ends), gl.connect(self.brake.flange_b, self.ground.flange)]

    system = gl.compile(Driven())
    found = gl.steady_state(system, ["load.w", "torque.tau", "load.a"], inputs={"torque.tau": lambda t: 3.0 + t})
    assert found.values == pytest.approx(np.array([6.0, 3.0, 0.0]), abs=1e-12)
