"""Directions of a search for a steady state: what may grow, what must stay, and what may be moved."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.run.start_values import Start
from gearlib.run.steady import Search, SteadyEquations, growing, search_steady, steady_changes


class Slip(gl.Component):
    """A driven body, a fan behind a slipping coupling; its angle is a state, too."""

    def assemble(self) -> list[Any]:
        self.torque, self.a, self.b = gp.Torque(tau=6.0), gp.Inertia(J=0.5), gp.Inertia(J=2.0)
        self.slip, self.shaft = gp.Damper(d=3.0), gp.SpringDamper(c=40.0, d=0.1)
        self.c, self.fan = gp.Inertia(J=1.0), gp.QuadraticSpeedDependentTorque(tau_nominal=-1.5, w_nominal=2.0)
        return [
            gl.connect(self.torque.flange, self.a.flange_a), gl.connect(self.a.flange_b, self.slip.flange_a),
            gl.connect(self.slip.flange_b, self.b.flange_a), gl.connect(self.b.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.c.flange_a), gl.connect(self.c.flange_b, self.fan.flange),
        ]  # fmt: skip


@cache
def slip() -> Any:
    return gl.compile(Slip()).translation


def search(grows: Any, held: Any = None) -> Search:
    scene = slip().with_states(slip().structure.states)
    begin = Start(np.zeros(len(scene.states)), np.zeros(scene.model.n_variables), ())
    return Search(scene, scene.prepared(slip().parameter_values({})), begin, np.zeros(0), 0.0, np.asarray(grows, float), held)


def orthonormal(n: int, k: int) -> Any:
    return np.linalg.qr(np.random.default_rng(10 * n + k).normal(size=(n, k)))[0]


@pytest.mark.parametrize("k", [0, 1, 2])
@pytest.mark.parametrize("kind", ["general", "single states", "some states"])
def test_what_must_stay_is_the_rest_of_what_may_grow(k: int, kind: str) -> None:
    """Orthonormal, and across all growing directions; unit vectors where these are states."""
    n = 6
    grows = {"general": orthonormal(n, k), "single states": np.eye(n)[:, [1, 4][:k]], "some states": np.zeros((n, k))}[kind]
    if kind == "some states" and k:
        grows[[0, 2, 5]] = orthonormal(3, k)
    own = search(grows).stationary
    assert own.shape == (n, n - k)
    assert own.T @ own == pytest.approx(np.eye(n - k), abs=1e-12)
    assert grows.T @ own == pytest.approx(np.zeros((k, n - k)), abs=1e-12)
    if kind == "single states":
        assert ((own == 0.0) | (own == 1.0)).all()


def test_what_is_held_is_not_moved() -> None:
    grows, held = np.eye(6)[:, [1]], orthonormal(6, 2)
    own = search(grows, held)
    assert own.movable.shape == (6, 3)
    assert own.movable.T @ own.movable == pytest.approx(np.eye(3), abs=1e-12)
    assert held.T @ own.movable == pytest.approx(np.zeros((2, 3)), abs=1e-10)
    assert grows.T @ own.movable == pytest.approx(np.zeros((1, 3)), abs=1e-12)
    assert search(grows).movable is not None
    assert search(grows).movable.shape == (6, 5)


def test_where_all_is_held_rates_vanish_up_to_their_rounding() -> None:
    """No state is left to be moved."""
    own, noise = search(np.zeros((6, 0)), np.eye(6)), np.linspace(1.0, 2.0, 6)
    assert own.movable.shape == (6, 0)
    equations = SteadyEquations(own, orthonormal(6, 6))
    assert equations.hold(0.9 * noise, noise)
    assert not equations.hold(noise + 0.1 * np.eye(6)[3], noise)
    assert not equations.change(noise).any()
    assert not equations.largest_change(noise).any()


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_the_change_of_the_states_makes_the_rates_vanish_and_keeps_what_they_keep(unit: float) -> None:
    """Rates that keep one sum and depend on all but one direction, in like and in unlike units.

    Nothing within the rounding of the rates changes the states by more than the bound.
    """
    rng, units = np.random.default_rng(4), unit ** np.linspace(-1, 1, 6)
    kept, unfelt = rng.uniform(0.5, 1.5, 6), rng.uniform(0.5, 1.5, 6)
    gradient = rng.normal(size=(6, 6))
    gradient -= np.outer(kept, kept @ gradient) / (kept @ kept)
    gradient -= np.outer(gradient @ unfelt, unfelt) / (unfelt @ unfelt)
    gradient, kept, unfelt = gradient * units[:, None] / units, kept / units, unfelt * units
    equations = SteadyEquations(search(np.zeros((6, 0))), gradient)
    assert equations.open.shape == equations.kept.shape == (6, 1)
    f, noise = gradient @ (rng.normal(size=6) * units), rng.uniform(1.0, 2.0, 6) * units
    change = equations.change(f)
    assert (gradient @ change + f) / units == pytest.approx(np.zeros(6), abs=1e-9)
    assert kept @ change == pytest.approx(0.0, abs=1e-9)
    assert equations.along(change) == pytest.approx(np.zeros(6), abs=1e-9 * np.abs(change).max())
    assert equations.along(unfelt) == pytest.approx(unfelt, rel=1e-9)
    assert equations.hold(f, 1e-9 * noise)
    assert not equations.hold(f + 1e-3 * noise, 1e-5 * noise)
    bound = equations.largest_change(noise)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 6)).reshape(6, -1)
    largest = np.abs(equations.change(signs * noise[:, None])).max(axis=1)
    assert (largest <= bound * (1 + 1e-9)).all()
    assert (bound < 100.0 * largest).all()


def test_where_each_rate_has_its_own_state_the_bound_is_their_quotient() -> None:
    slopes, noise = np.array([1e-6, -2.0, 3.0, 4e5, -5.0, 6.0]), np.linspace(1.0, 2.0, 6)
    for order in (range(6), [3, 0, 5, 1, 4, 2]):
        gradient = np.diag(slopes)[list(order)]
        equations = SteadyEquations(search(np.zeros((6, 0))), gradient)
        assert equations.largest_change(noise[list(order)]) == pytest.approx(noise / np.abs(slopes), rel=1e-12)
        assert equations.change(noise[list(order)]) == pytest.approx(-noise / slopes, rel=1e-12)


def test_rates_and_their_derivatives_in_nominal_values() -> None:
    """Against differences; beside a bound on their rounding, and the largest of the derivatives."""
    own = search(np.zeros((len(slip().structure.states), 0)))
    x = np.random.default_rng(2).uniform(0.5, 1.5, len(own.scale))
    f, gradient, noise = own.equations(x)
    for i in range(len(x)):
        h = np.zeros(len(x))
        h[i] = 1e-4
        difference = (own.equations(x + h * own.scale)[0] - own.equations(x - h * own.scale)[0]) / 2e-4
        assert gradient[:, i] == pytest.approx(difference, rel=1e-6, abs=1e-7)
    assert (noise >= 0.0).all()
    assert noise.max() < 1e-9 * np.abs(f).max()
    assert own.largest(gradient) == pytest.approx(np.abs(gradient).max())
    turned = search(np.eye(len(x))[:, [0]])
    assert turned.largest(gradient) == pytest.approx(np.abs(gradient[1:, 1:]).max())


def test_a_growing_mode_limits_the_step() -> None:
    own = search(np.zeros((6, 0)))
    stable = -np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert own.longest_stable(stable) == np.inf
    unstable = stable.copy()
    unstable[2, 2] = 0.25
    assert own.longest_stable(unstable) == pytest.approx(2.0)
    assert own.longest_stable(stable + np.diag([0, 0, 3.0 + 1e-10, 0, 0, 0])) == np.inf  # rounding
    just = np.diag([1e-9 * 5.0, -1.0, -2.0, -3.0, -4.0, -5.0])
    assert own.longest_stable(just) == np.inf
    just[0, 0] *= 1.01
    assert own.longest_stable(just) == pytest.approx(0.5 / 5.05e-9)


def test_angles_grow_in_a_steady_rotation() -> None:
    """6 = 1.5 (w / 2)^2: 4 rad/s behind the coupling, 6/3 more before it; the shaft twists by 6/40."""
    scene = slip().scene
    numbers = scene.prepared(slip().parameter_values({}))
    assert growing(scene, numbers).shape == (len(scene.states), 0)
    whole = slip().with_states(slip().structure.states)
    grows = growing(whole, whole.prepared(slip().parameter_values({})))
    turning = [name for name, row in zip(whole.state_names, grows, strict=True) if row.any()]
    assert turning
    assert all(name.endswith(("phi", "phi_rel")) for name in turning)
    begin = Start(np.full(len(scene.states), 0.5), np.zeros(scene.model.n_variables), ())
    x = dict(zip(scene.state_names, search_steady(scene, numbers, begin, np.zeros(0), 0.0), strict=True))
    assert (x["a.w"], x["b.w"], x["c.w"]) == pytest.approx((6.0, 4.0, 4.0), rel=1e-9)
    assert x["shaft.phi_rel"] == pytest.approx(-6.0 / 40.0, rel=1e-9) or x["shaft.phi_rel"] == pytest.approx(0.15, rel=1e-9)


def test_a_steady_state_follows_its_parameters() -> None:
    """w_c = 2 sqrt(tau / 1.5) and w_a = w_c + tau / d, by the torque and the damping."""
    names = ["torque.tau", "slip.d"] if "torque.tau" in slip().model.parameters.index else ["slip.d", "fan.tau_nominal"]
    scene, table = slip().scene, slip().model.parameters
    numbers = scene.prepared(slip().parameter_values({}))
    n, seeds = len(scene.states), [(table.index[name], k, 1.0) for k, name in enumerate(names)]
    begin = Start(np.full(n, 0.5), np.zeros(scene.model.n_variables), (), changes=np.zeros((n, 2)))
    x = search_steady(scene, numbers, begin, np.zeros(0), 0.0)
    found = steady_changes(scene, numbers, begin, np.zeros(0), 0.0, x, seeds)
    for k, name in enumerate(names):
        ends = []
        for share in (1 + 1e-5, 1 - 1e-5):
            moved = scene.prepared(slip().parameter_values({name: share * float(table.defaults[table.index[name]])}))
            ends.append(search_steady(scene, moved, begin, np.zeros(0), 0.0))
        expected = (ends[0] - ends[1]) / (2e-5 * float(table.defaults[table.index[name]]))
        assert found[:, k] == pytest.approx(expected, rel=1e-6, abs=1e-8)
    assert np.abs(found).max() > 0.1
