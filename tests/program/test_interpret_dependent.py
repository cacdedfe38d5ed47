"""Equations that depend on each other up to rounding: what they leave open is shared as artificial compliances would have it."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.program.derivative_plan import derivative_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import evaluate, solve_regular
from gearlib.program.program import Newton


class Locked(gl.Component):
    """Two masses of 1 kg, and two stuck elements that both hold c a + d b at zero, one of them by k times that; x pulls at the first."""

    a, b, r, q, x = (gl.Variable("1") for _ in range(5))
    rate, k = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=3.0)
    c, d, give = gl.Parameter("1", default=0.1), gl.Parameter("1", default=0.2), gl.Parameter("1", default=1e-25)
    w = gl.Parameter("1", default=1.0)  # weight of the equation of one of them
    softer = gl.Parameter("1", default=1.0)  # how many times as far it gives way
    across = gl.Parameter("1", default=0.0)  # how far each gives way under the reaction of the other

    def equations(self) -> list[Any]:
        def element(lever: Any, reaction: Any, other: Any, w: Any = 1.0, softer: Any = 1.0) -> Any:
            gives = softer * self.give * reaction + self.across * self.give * other
            held = w * lever * self.c * self.a + w * lever * self.d * self.b + w * gives
            return gl.Eq(gl.Piecewise((held, self.x > -1.0), (reaction, True)), 0)

        return [
            gl.Eq(gl.der(self.x), self.rate * (self.a + self.b)),
            gl.Eq(self.a + self.c * self.r + self.k * self.c * self.q, self.x),
            gl.Eq(self.b + self.d * self.r + self.k * self.d * self.q, 0 * self.x),
            element(1.0, self.r, self.q), element(self.k, self.q, self.r, self.w, self.softer),
        ]  # fmt: skip


@cache
def locked(large: bool) -> Any:
    """Its block is treated as a large one, or not."""
    with pytest.MonkeyPatch.context() as patch:
        if large:
            patch.setattr("gearlib.program.program.SPARSE", 1.0)
            patch.setattr("gearlib.program.program.LARGE", 1)
        found = gl.compile(Locked(), outputs=["a", "b", "r", "q"]).translation
        (step,) = (s for s in found.scene.program.steps if isinstance(s, Newton))
        assert (step.order is not None) == large
        return found


@pytest.mark.parametrize("large", [False, True], ids=["dense", "sparse"])
@pytest.mark.parametrize(("count", "softer"), [(1, 1.0), (2, 1.0), (1, 5.0), (2, 0.3)])
@pytest.mark.parametrize("across", [0.0, 1e-13])
@pytest.mark.parametrize(("give", "w"), [(1e-25, 1.0), (1e-30, 1e15), (1e-25, 1e-15)])
@pytest.mark.parametrize("k", [1.0, 2.0, 3.0, 0.7, -1.9])
def test_stuck_elements_share_their_load(
    k: float, give: float, w: float, count: int, softer: float, across: float, large: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The load u = c x / (c^2 + d^2) = r + k q, with the least r^2 + softer q^2; at several times as at one, and so do derivatives.

    0.1 times 3 is not 0.3, so that the equations of both elements seem to say something different.
    """
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", 1 if large else 400)
    scene = locked(large).scene
    numbers = scene.numbers(locked(large).parameter_values({"k": k, "give": give, "w": w, "softer": softer, "across": across}))
    (step,) = (s for s in scene.program.steps if isinstance(s, Newton))
    x, none, t = np.array([[0.7e6, 0.9e-6][:count]]), np.zeros((0, count)), np.zeros(count)
    flags = scene.discrete(numbers, t, x, none)
    slots = evaluate(numbers, t, x, none, flags)
    u, one = 0.1 / 0.05, np.array([1.0, 1.0, 1.0, 1.0])
    expected = {"a": 1.0 - 0.1 * u, "b": -0.2 * u, "r": u * softer / (softer + k**2), "q": u * k / (softer + k**2)}
    places = [scene.program.slots[scene.model.variable(name), 0] for name in expected]
    right = np.array([*expected.values()])[:, None] * one[:count]
    np.testing.assert_allclose(slots[places] / x, right, rtol=1e-11, atol=1e-12)
    assert len(step.unknowns) >= 4
    plan = derivative_plan(scene.program, [(0, 0)], places[:2])
    found = dense(plan, entries(plan, At(numbers, t, slots, flags)))[:, :, 0].T
    np.testing.assert_allclose(found, right[:2], rtol=1e-11, atol=1e-12)
    reactions = derivative_plan(scene.program, [(0, 0)], places[2:])
    shares = dense(reactions, entries(reactions, At(numbers, t, slots, flags)))[:, :, 0]
    assert shares @ np.array([1.0, k]) == pytest.approx(np.full(count, u), rel=1e-11)
    assert np.abs(shares).max() < 10.0


class Train(gl.Component):
    def assemble(self) -> list[Any]:
        self.torque, self.set = gp.Torque(tau=0.5), gp.IdealPlanetary(ratio=2.0)
        self.sun, self.carrier, self.ring = (gp.Inertia(J=J) for J in (1.0, 2.0, 0.7))
        self.clutch = [gp.Clutch(fn_max=10.0, f_normalized=1.0) for _ in range(3)]
        one, two, three = self.clutch
        return [
            gl.connect(self.torque.flange, self.sun.flange_a),
            gl.connect(self.sun.flange_b, self.set.sun, one.flange_a, three.flange_a),
            gl.connect(self.set.carrier, self.carrier.flange_a, one.flange_b, two.flange_a),
            gl.connect(self.set.ring, self.ring.flange_a, two.flange_b, three.flange_b),
        ]


@cache
def train() -> gl.System:
    return gl.compile(Train(), outputs=[*(f"clutch[{i}].tau" for i in range(3)), "sun.w"])


@pytest.mark.parametrize("ratio", [2.0, 2.1, 1.7, 3.3])
def test_clutches_that_lock_a_planetary_set_share_their_torque(ratio: float) -> None:
    """All three that there can be, of the same kind: the torques that keep the balance and whose sum of squares is least."""
    names = [f"clutch[{i}].tau" for i in range(3)]
    run = train().simulate(0.5, samples=3, parameters={"set.ratio": ratio})
    a = 0.5 / 3.7  # the whole as one body
    through = np.array([[-1.0, 0.0, -1.0], [1.0, -1.0, 0.0], [0.0, 1.0, 1.0]])  # torques of clutches on sun, carrier and ring
    teeth = np.array([1.0, -(1.0 + ratio), ratio])  # those of the set, up to a factor
    across = np.eye(3) - np.outer(teeth, teeth) / (teeth @ teeth)
    least = np.linalg.pinv(across @ through) @ across @ (np.array([1.0, 2.0, 0.7]) * a - [0.5, 0.0, 0.0])
    found = np.array([run[name] for name in names])
    assert np.abs(found) == pytest.approx(np.abs(least)[:, None] * np.ones(3), rel=1e-9)
    assert run["sun.w"] == pytest.approx(a * run.time, rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_regular_equations_of_many_times(seed: int) -> None:
    """In any units, with several right-hand sides; nearly dependent ones are refused."""
    rng = np.random.default_rng(seed)
    times, n, sides = 4, 1 + 2 * seed, 1 + seed
    matrices = np.linalg.qr(rng.normal(size=(times, n, n)))[0]
    rows, columns = 10.0 ** rng.uniform(-30, 30, (times, n, 1)), 10.0 ** rng.uniform(-30, 30, (times, 1, n))
    right = rng.normal(size=(times, n, sides))
    try:
        found = solve_regular(rows * matrices * columns, rows * right)
    except np.linalg.LinAlgError:
        pytest.fail("regular equations are refused")
    expected = np.swapaxes(matrices, 1, 2) @ right
    np.testing.assert_allclose(found * np.swapaxes(columns, 1, 2), expected, rtol=1e-11, atol=1e-12)
    for distance, regular in ((1e-11, True), (1e-15, False), (0.0, False)):
        pair = np.stack([np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([[1.0, 1.0], [1.0, 1.0 + distance]])])
        if regular:
            np.testing.assert_allclose(solve_regular(pair, pair @ np.ones((2, 2, 1))), np.ones((2, 2, 1)), rtol=1e-4)
        else:
            for count in (1, 2, 4):
                with pytest.raises(np.linalg.LinAlgError):
                    solve_regular(pair, np.ones((2, 2, count)))
