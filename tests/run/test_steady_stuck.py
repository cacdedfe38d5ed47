"""Steady states at which something sticks: Coulomb's friction on a spring."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import StartError
from gearlib.run import steady as steady_module
from gearlib.run.steady import Search, search_steady


class Rubbed(gl.Component):
    """A body on a spring of 10 N m/rad in a bearing that holds 3 N m, with a torque from outside."""

    def assemble(self) -> list[Any]:
        self.push, self.body, self.spring, self.wall = gp.Torque(), gp.Inertia(J=1.0), gp.Spring(c=10.0), gp.Fixed()
        self.bearing = gp.BearingFriction(tau_pos=((0.0, 3.0), (10.0, 3.0)))
        return [
            gl.connect(self.push.flange, self.body.flange_a, self.bearing.flange_a),
            gl.connect(self.body.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.wall.flange),
        ]


@cache
def rubbed() -> gl.System:
    return gl.compile(Rubbed())


def steady(phi: float, tau: float = 0.0, J: float = 1.0) -> dict[str, float]:
    """The steady state that the motion from a deflection, without speed, reaches."""
    translation = rubbed().translation
    scene, numbers = translation.scene, translation.parameter_values({"body.J": J})
    begin = translation.start(scene, numbers, 0.0, {"body.phi": phi, "body.w": 0.0}, (tau,))
    found = search_steady(scene, scene.prepared(numbers), begin, np.array([tau]), 0.0)
    return dict(zip(scene.state_names, found.tolist(), strict=True))


@pytest.mark.parametrize("phi", [0.2, -0.29])
def test_a_body_that_its_spring_does_not_move_rests_where_it_is(phi: float) -> None:
    assert steady(phi) == {"body.w": 0.0, "spring.phi_rel": -phi}


@pytest.mark.parametrize("phi", [1.0, 0.5, -0.35, 0.31, 2.0])
def test_a_body_that_slides_rests_where_its_motion_ends(phi: float) -> None:
    """Each half swing is one about the edge of the band of 0.3 rad, in which the body may rest; it ends inside, and not at an edge."""
    rest = phi
    while abs(rest) > 0.3:
        rest = 0.6 * np.sign(rest) - rest
    assert steady(phi) == pytest.approx({"body.w": 0.0, "spring.phi_rel": -rest}, abs=1e-7)


def test_a_heavy_body_takes_longer_to_the_same_rest() -> None:
    """Two half swings of pi sqrt(J / c) = 9.9 s each, from 1 to -0.4 and -0.2 rad: after 10 s it has nearly stopped for the first time."""
    assert steady(1.0, J=100.0) == pytest.approx({"body.w": 0.0, "spring.phi_rel": 0.2}, abs=1e-7)


def test_where_sliding_ends_has_no_derivative() -> None:
    with pytest.raises(StartError, match="one of many side by side"):
        gl.steady_state(gl.compile(Rubbed(start={"body.phi": 0.5})), inputs={"push.tau": 0.0}).sensitivity(
            "spring.phi_rel", "spring.c"
        )


def search() -> Search:
    translation = rubbed().translation
    scene, numbers = translation.scene, translation.parameter_values({})
    begin = translation.start(scene, numbers, 0.0, {"body.phi": 0.2, "body.w": 0.0}, (0.0,))
    return Search(scene, scene.prepared(numbers), begin, np.zeros(1), 0.0, np.zeros((2, 0)))


@pytest.mark.parametrize("slip", [1e-6, -1e-6, 1e-8, -1e-4])
def test_a_slip_of_the_size_of_a_tolerance_is_taken_away(slip: float) -> None:
    """What a run that ends stuck leaves of a speed would start as sliding; the direction in which it would slide is held."""
    own = search()
    stuck = own.discrete(np.array([0.0, -0.2]))[:, 0]
    moved, held = steady_module.sticking(own, np.array([slip, -0.2]), stuck)
    assert abs(moved[0]) < 1e-10
    assert moved[1] == -0.2
    assert own.discrete(moved)[:, 0].tolist() == stuck.tolist()
    assert held is not None
    assert np.abs(held) == pytest.approx(np.array([[1.0], [0.0]]), abs=1e-12)


class Beside(gl.Component):
    """A body that spins freely, and one in a bearing, whose slip is the last state."""

    def assemble(self) -> list[Any]:
        self.spin, self.body = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        self.bearing = gp.BearingFriction(tau_pos=((0.0, 3.0), (10.0, 3.0)))
        return [gl.connect(self.body.flange_b, self.bearing.flange_a)]


@pytest.mark.parametrize("slip", [1e-6, -1e-6])
def test_a_slip_is_taken_away_beside_what_moves(slip: float) -> None:
    translation = gl.compile(Beside(), outputs=["spin.w", "body.w"]).translation
    scene, numbers = translation.scene, translation.parameter_values({})
    begin = translation.start(scene, numbers, 0.0, {"spin.w": 5.0, "body.w": 0.0}, ())
    assert scene.state_names[0] == "spin.w"
    own = Search(scene, scene.prepared(numbers), begin, np.zeros(0), 0.0, np.zeros((2, 0)))
    stuck = own.discrete(np.array([5.0, 0.0]))[:, 0]
    moved, held = steady_module.sticking(own, np.array([5.0, slip]), stuck)
    assert moved[0] == 5.0
    assert abs(moved[1]) < 1e-10
    assert own.discrete(moved)[:, 0].tolist() == stuck.tolist()
    assert held is not None
    assert np.abs(held) == pytest.approx(np.array([[0.0], [1.0]]), abs=1e-12)


def test_what_slides_or_is_far_from_sticking_stays() -> None:
    own = search()
    stuck = own.discrete(np.array([0.0, -0.2]))[:, 0]
    far = np.array([1.1e-4 * 0.2 / own.scale[1], -0.2])  # more than 1e-4 of the largest state, in nominal values
    moved, held = steady_module.sticking(own, far, stuck)
    assert (moved.tolist(), held) == (far.tolist(), None)
    for w in (1.0, -1.0):
        x = np.array([w, -0.2])
        moved, held = steady_module.sticking(own, x, own.discrete(x)[:, 0])
        assert (moved.tolist(), held) == (x.tolist(), None)


def test_what_sticks_already_is_held_where_it_is() -> None:
    own = search()
    x = np.array([0.0, -0.2])
    moved, held = steady_module.sticking(own, x, own.discrete(x)[:, 0])
    assert moved.tolist() == x.tolist()
    assert held is not None
    assert np.abs(held) == pytest.approx(np.array([[1.0], [0.0]]), abs=1e-12)


class Both(gl.Component):
    def assemble(self) -> list[Any]:
        self.first, self.second = Rubbed(), Rubbed()
        return []


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_one_sticks_while_another_slides(speed: float) -> None:
    """Only the slip of what sticks is taken away and held."""
    translation = gl.compile(Both()).translation
    scene, numbers = translation.scene, translation.parameter_values({})
    begin = translation.start(scene, numbers, 0.0, {"first.body.w": 0.0, "second.body.w": 0.0}, (0.0, 0.0))
    own = Search(scene, scene.prepared(numbers), begin, np.zeros(2), 0.0, np.zeros((4, 0)))
    first, second = (scene.state_names.index(f"{part}.body.w") for part in ("first", "second"))
    x = np.zeros(4)
    x[second] = speed
    discrete = own.discrete(x)[:, 0]
    x[first] = 1e-6
    moved, held = steady_module.sticking(own, x, discrete)
    assert abs(moved[first]) < 1e-10
    assert np.delete(moved, first).tolist() == np.delete(x, first).tolist()
    assert held is not None
    assert np.abs(held[:, 0]) == pytest.approx(np.eye(4)[first], abs=1e-12)
    assert held.shape == (4, 1)
