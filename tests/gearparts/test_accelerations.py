"""Accelerations by name, as in Modelica, and derivatives that no equation holds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError

LINKS = {
    "Spring": lambda: gp.Spring(c=90.0),
    "Damper": lambda: gp.Damper(d=0.7),
    "SpringDamper": lambda: gp.SpringDamper(c=90.0, d=0.7),
    "ElastoBacklash": lambda: gp.ElastoBacklash(c=90.0, d=0.7, b=0.02),
    "Clutch": lambda: gp.Clutch(fn_max=0.4, f_normalized=1.0),
    "OneWayClutch": lambda: gp.OneWayClutch(fn_max=0.4, f_normalized=1.0),
    "Gearbox": lambda: gp.Gearbox(ratio=1.0, c=90.0, d=0.7),
}


class Pair(gl.Component):
    """Two bodies with something between them, under a torque that swings."""

    link = gl.Structural("Spring")
    free = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque() if self.free else gp.Torque(tau=3 * gl.sin(9 * gl.time))
        self.a, self.b, self.between = gp.Inertia(J=0.3), gp.Inertia(J=0.5), LINKS[self.link]()
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.between.flange_a),
            gl.connect(self.between.flange_b, self.b.flange_a),
        ]


@pytest.mark.parametrize("kind", sorted(LINKS))
def test_relative_acceleration_is_the_difference_of_the_bodies(kind: str) -> None:
    result = gl.compile(Pair(link=kind)).simulate(1.0, samples=101, rtol=1e-8)
    expected = result["b.a"] - result["a.a"]
    assert np.abs(expected).max() > 0.1
    assert result["between.a_rel"] == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


def test_it_costs_nothing_where_it_is_not_asked_for() -> None:
    """The derivatives of the states need no more than before; an output that is one adds its own equations only."""
    plain, asked = gl.compile(Pair(link="SpringDamper")), gl.compile(Pair(link="SpringDamper"), outputs=["between.a_rel"])
    assert plain.translation.structure.differentiation.counts == asked.translation.structure.differentiation.counts
    assert asked.states == ("a.w", "b.w", "between.phi_rel")
    assert "between.a_rel" not in plain.source
    assert "der(between.w_rel)" not in plain.source


def test_acceleration_of_brakes_bearings_and_motions() -> None:
    class Held(gl.Component):
        def assemble(self) -> list[Any]:
            self.motion = gp.Speed(w_ref=3 * gl.sin(2 * gl.time), exact=True)
            self.brake, self.bearing = gp.Brake(fn_max=1.0, f_normalized=1.0), gp.BearingFriction()
            self.one, self.other = gp.Inertia(J=1.0, start={"w": 5.0}), gp.Inertia(J=2.0, start={"w": 5.0})
            return [
                gl.connect(self.one.flange_a, self.brake.flange_a),
                gl.connect(self.other.flange_a, self.bearing.flange_a),
            ]

    result = gl.simulate(Held(), 1.0, samples=21)
    assert result["motion.a"] == pytest.approx(6 * np.cos(2 * result.time), rel=1e-10)
    assert result["brake.a"] == pytest.approx(-0.5)
    assert result["bearing.a"] == pytest.approx(-0.5)


def test_derivatives_of_any_variable() -> None:
    """Of torques and of accelerations, against differences of fine samples."""
    result = gl.compile(Pair(link="SpringDamper")).simulate(1.0, samples=20001, rtol=1e-11)
    for name in ("between.tau", "a.a", "b.a", "der(between.tau)"):
        difference = np.gradient(result[name], result.time)[1:-1]
        assert result[f"der({name})"][1:-1] == pytest.approx(difference, abs=1e-5 * np.abs(difference).max())
    assert result["der(torque.tau)"] == pytest.approx(27 * np.cos(9 * result.time))


def test_derivative_through_equations_that_are_solved_together() -> None:
    """A massless middle between two dampers: 2 (w_a - w) = 3 (w - w_b), so der(w) is the mean of the bodies' accelerations."""

    class Middle(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0, start={"w": 4.0}), gp.Inertia(J=2.0)
            self.left, self.right, self.gear = gp.Damper(d=2.0), gp.Damper(d=3.0), gp.IdealGear(ratio=1.0)
            return [
                gl.connect(self.a.flange_b, self.left.flange_a),
                gl.connect(self.left.flange_b, self.gear.flange_a),
                gl.connect(self.gear.flange_b, self.right.flange_a),
                gl.connect(self.right.flange_b, self.b.flange_a),
            ]

    result = gl.simulate(Middle(), 1.0, samples=11)
    mean = (2 * result["a.a"] + 3 * result["b.a"]) / 5
    assert result["left.a_rel"] == pytest.approx(mean - result["a.a"], rel=1e-9)
    assert result["der(left.tau)"] == pytest.approx(2 * (mean - result["a.a"]), rel=1e-9)


def test_derivative_of_an_input_that_nothing_is_bound_to_is_refused() -> None:
    system = gl.compile(Pair(link="SpringDamper", free=True))
    result = system.simulate(0.1, samples=3, inputs={"torque.tau": 1.0})
    assert result["between.a_rel"][0] == pytest.approx(-1 / 0.3)
    for name in ("der(a.a)", "der(torque.tau)"):
        with pytest.raises(NameLookupError, match="needs the derivative of an input, so it is not computed"):
            result[name]
        with pytest.raises(NameLookupError, match="needs the derivative of an input, so it cannot be an output"):
            gl.compile(Pair(link="SpringDamper", free=True), outputs=[name])


def test_linear_model_of_an_acceleration_and_not_of_the_derivative_of_an_input() -> None:
    system = gl.compile(Pair(link="SpringDamper"))
    model = system.linearize(["torque.tau"], ["between.a_rel", "a.a", "b.a"])
    assert np.array(model.C)[0] == pytest.approx(np.array(model.C)[2] - np.array(model.C)[1], rel=1e-12)
    assert np.array(model.D).ravel() == pytest.approx([-1 / 0.3, 1 / 0.3, 0.0])
    with pytest.raises(ArgumentError, match=r"outputs der\(a\.a\) need the derivative of the input torque\.tau"):
        system.linearize(["torque.tau"], ["der(a.a)"])
