"""Trains in which equations without inertia leave a constraint between springs, against equations written by hand."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, ModelError
from gearlib.reduce.combinations import dependent_rows
from gearparts.interfaces import Compliant

c = gl.connect


class Hardening(Compliant):
    """A spring with a cubic part."""

    c = gl.Parameter("N.m/rad", "stiffness")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.tau, self.c * (self.phi_rel + self.phi_rel**3 / 4))]


class Block(gl.Component):
    """A body, a spring, a planetary set without inertia, locked to itself, with a damper across that, a spring, a body."""

    ratio = gl.Parameter("1", "of the set", default=4.0)
    spring = gl.Structural(gp.Spring)
    planetary = gl.Structural(gp.IdealPlanetary)

    def assemble(self) -> list[Any]:
        self.torque, self.a, self.b = gp.Torque(tau=3.0), gp.Inertia(J=2.0, start={"w": 1.0}), gp.Inertia(J=1.0)
        self.s, self.p, self.k = self.spring(c=22.0), self.planetary(ratio=self.ratio), gp.Spring(c=10.0)
        self.d = gp.Damper(d=2.0)
        return [
            c(self.torque.flange, self.a.flange_a), c(self.a.flange_b, self.s.flange_a), c(self.s.flange_b, self.p.sun),
            c(self.p.sun, self.p.carrier, self.d.flange_a), c(self.p.ring, self.k.flange_a, self.d.flange_b),
            c(self.k.flange_b, self.b.flange_a),
        ]  # fmt: skip


def two_bodies(torque: Any) -> list[float]:
    """Speeds of a and b after 2 s, with a torque between them that depends on the angle between them."""

    def rates(t: float, x: Any) -> Any:
        between = torque(x[0] - x[2])
        return [x[1], (3.0 - between) / 2.0, x[3], between]

    found = solve_ivp(rates, (0.0, 2.0), [0.0, 1.0, 0.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-12)
    return [float(found.y[1, -1]), float(found.y[3, -1])]


@pytest.mark.parametrize("method", ["rk", "ida", "exact"])
def test_springs_balance_each_other_at_a_set_without_inertia(method: str) -> None:
    system = gl.compile(Block())
    right = two_bodies(lambda q: q / (1 / 22 + 1 / 10))
    for ratio in (4.0, 2.5):
        result = system.simulate(2.0, samples=3, rtol=1e-9, method=method, parameters={"ratio": ratio})
        assert [result["a.w"][-1], result["b.w"][-1]] == pytest.approx(right, rel=1e-7)
        assert result["s.tau"] == pytest.approx(result["k.tau"], abs=1e-9)
        assert result["p.ring.tau"] == pytest.approx(ratio * result["p.sun.tau"], abs=1e-9)
    assert pickle.loads(pickle.dumps(result))["p.ring.tau"].tolist() == result["p.ring.tau"].tolist()


def test_the_springs_may_be_nonlinear() -> None:
    def torque(q: float) -> float:
        first = brentq(lambda p: 22 * (p + p**3 / 4) - 10 * (q - p), -50, 50, xtol=1e-15)
        return 10 * (q - float(first))

    for method in ("rk", "ida"):
        result = gl.compile(Block(spring=Hardening)).simulate(2.0, samples=3, rtol=1e-9, method=method)
        assert [result["a.w"][-1], result["b.w"][-1]] == pytest.approx(two_bodies(torque), rel=1e-6)


class Stiffening(Compliant):
    """A spring that is twice as stiff beyond -0.1 rad; half as stiff after 1 s."""

    c = gl.Parameter("N.m/rad", "stiffness")
    soft = gl.Discrete("factor", start=1.0)

    def equations(self) -> list[Any]:
        beyond = gl.Piecewise((self.phi_rel + 0.1, self.phi_rel < -0.1), (0, True))
        return [
            gl.Eq(self.tau, self.c * self.soft * (self.phi_rel + beyond)),
            gl.Eq(self.soft, gl.Piecewise((0.5, gl.time > 1.0), (1, True))),
        ]


def test_the_sum_may_hold_relations_and_discrete_variables() -> None:
    """The two springs in series: 22 N.m/rad, 44 beyond 0.1 rad, half of that after a second; and 10 N.m/rad."""

    def torque(q: float, factor: float) -> float:
        first, second = 22 * factor, 44 * factor
        p = 10 * q / (first + 10)
        return 10 * (q - (p if p <= 0.1 else (10 * q + 0.1 * first) / (second + 10)))

    def rates(t: float, x: Any, factor: float) -> Any:
        between = torque(x[0] - x[2], factor)
        return [x[1], (3.0 - between) / 2.0, x[3], between]

    state = [0.0, 1.0, 0.0, 0.0]
    for span, factor in (((0.0, 1.0), 1.0), ((1.0, 2.0), 0.5)):
        found = solve_ivp(rates, span, state, args=(factor,), method="DOP853", rtol=1e-10, atol=1e-12, max_step=0.01)
        state = found.y[:, -1].tolist()
    system = gl.compile(Block(spring=Stiffening))
    result = system.simulate(2.0, samples=3, rtol=1e-9, method="ida")
    assert [result["a.w"][-1], result["b.w"][-1]] == pytest.approx([state[1], state[3]], rel=1e-6)


class Pushed(gl.Component):
    """A planetary set with torques on its ring and its carrier."""

    ratio = gl.Parameter("1", "of the set")
    sun, carrier, ring = gp.Flange("sun"), gp.Flange("carrier"), gp.Flange("ring")

    def torques(self) -> Any:
        """They begin at different times."""
        return [gl.Piecewise((tau, gl.time > begin), (0, True)) for tau, begin in ((1.0, 0.5), (2.0, 1.2))]

    def equations(self) -> list[Any]:
        sun, carrier, ring = self.sun, self.carrier, self.ring
        on_ring, on_carrier = self.torques()
        return [
            gl.Eq(carrier.phi * (1 + self.ratio), self.ratio * ring.phi + sun.phi),
            gl.Eq(ring.tau, self.ratio * sun.tau + on_ring),
            gl.Eq(carrier.tau, -(1 + self.ratio) * sun.tau + on_carrier),
        ]


class Leaking(gl.Component):
    """A planetary set that loses a share of the sun's torque from the carrier's."""

    ratio, share = gl.Parameter("1", "of the set"), gl.Parameter("1", "lost", default=0.0)
    sun, carrier, ring = gp.Flange("sun"), gp.Flange("carrier"), gp.Flange("ring")

    def equations(self) -> list[Any]:
        sun, carrier, ring = self.sun, self.carrier, self.ring
        return [
            gl.Eq(carrier.phi * (1 + self.ratio), self.ratio * ring.phi + sun.phi),
            gl.Eq(ring.tau, self.ratio * sun.tau),
            gl.Eq(carrier.tau, -(1 + self.ratio - self.share) * sun.tau),
        ]


class Counting(Pushed):
    """Torques while a clock is beyond a limit, which its passing raises at once: so there are none."""

    clock, limit = gl.Variable("1", start=0.0), gl.Discrete("limit", start=0.5)

    def torques(self) -> Any:
        return [gl.Piecewise((1.0, self.clock > gl.pre(self.limit)), (0, True)), 0]

    def equations(self) -> list[Any]:
        raised = gl.Piecewise((gl.pre(self.limit) + 1, self.clock > gl.pre(self.limit)), (gl.pre(self.limit), True))
        return [gl.Eq(gl.der(self.clock), 1), gl.Eq(self.limit, raised)]


def test_each_equation_of_the_sum_keeps_its_own_relations() -> None:
    """The springs meet at the angle q, where 22 (a - q) + 10 (b - q) is the torque on the set: 0, then 1, then 3."""

    def rates(t: float, x: Any, torque: float) -> Any:
        q = (22 * x[0] + 10 * x[2] - torque) / 32
        return [x[1], (3.0 - 22 * (x[0] - q)) / 2.0, x[3], 10 * (q - x[2])]

    state = [0.0, 1.0, 0.0, 0.0]
    for start, end, torque in ((0.0, 0.5, 0.0), (0.5, 1.2, 1.0), (1.2, 2.0, 3.0)):
        state = solve_ivp(rates, (start, end), state, args=(torque,), method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1].tolist()
    result = gl.compile(Block(planetary=Pushed)).simulate(2.0, samples=2, rtol=1e-9, method="ida")
    assert [result["a.w"][-1], result["b.w"][-1]] == pytest.approx([state[1], state[3]], rel=1e-6)


@pytest.mark.parametrize("method", ["rk", "ida"])
def test_what_the_sum_compares_with_values_before_an_event_is_decided_again(method: str) -> None:
    result = gl.compile(Block(planetary=Counting)).simulate(2.0, samples=2, rtol=1e-9, method=method)
    assert result["p.limit"][-1] == 2.5
    assert [result["a.w"][-1], result["b.w"][-1]] == pytest.approx(two_bodies(lambda q: q / (1 / 22 + 1 / 10)), rel=1e-6)


def test_linear_analyses_know_the_constraint() -> None:
    system = gl.compile(Block(), ["a.w"])
    found = gl.modes(system)
    assert found.frequencies[-1] == pytest.approx(np.sqrt((1 / 2 + 1) / (1 / 22 + 1 / 10)) / (2 * np.pi))
    poles = np.linalg.eigvals(system.linearize(["torque.tau"], ["a.w"]).A)
    assert np.abs(poles).max() == pytest.approx(2 * np.pi * found.frequencies[-1])


class Delta(gl.Component):
    """Three bodies on springs, and three dampers between the springs' other ends."""

    d = gl.Parameter("N.m.s/rad", "damping", default=4.0)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=3.0)
        self.bodies = [gp.Inertia(J=J) for J in (2.0, 1.0, 3.0)]
        self.springs = [gp.Spring(c=k) for k in (22.0, 10.0, 5.0)]
        self.dampers = [gp.Damper(d=d) for d in (self.d, 2 * self.d, 3.0)]
        ends = [s.flange_b for s in self.springs]
        between = [c(d.flange_a, ends[i]) for i, d in enumerate(self.dampers)]
        between += [c(d.flange_b, ends[(i + 1) % 3]) for i, d in enumerate(self.dampers)]
        joined = [c(b.flange_b, s.flange_a) for b, s in zip(self.bodies, self.springs, strict=True)]
        return [c(self.torque.flange, self.bodies[0].flange_a), *joined, *between]


def delta_by_hand(d: float) -> list[float]:
    """Speeds of the bodies after 2 s: the sum of the springs' torques is zero, and stays so."""
    J, k = np.array([2.0, 1.0, 3.0]), np.array([22.0, 10.0, 5.0])
    D = np.zeros((3, 3))
    for i, damping in enumerate((d, 2 * d, 3.0)):
        j = (i + 1) % 3
        D[[i, j], [i, j]] += damping
        D[[i, j], [j, i]] -= damping
    whole = np.vstack([np.hstack([D, np.zeros((3, 1))])[:2], [*k, 0.0]])[:, :3]

    def rates(t: float, x: Any) -> Any:
        q, w = x[:3], x[3:]  # deflections of the springs; D n = k q at the nodes, of which two say all, and k . (w - n) = 0
        n = np.linalg.solve(whole, [*(k * q)[:2], k @ w])
        return [*(w - n), *((np.array([3.0, 0, 0]) - k * q) / J)]

    found = solve_ivp(rates, (0.0, 2.0), np.zeros(6), method="DOP853", rtol=1e-11, atol=1e-12)
    return [float(w) for w in found.y[3:, -1]]


def test_a_delta_of_dampers_between_nodes_without_inertia() -> None:
    system = gl.compile(Delta(), [f"bodies[{i}].w" for i in range(3)])
    for d in (4.0, 1.0):
        result = system.simulate(2.0, samples=2, rtol=1e-9, parameters={"d": d}, method="ida")
        assert [result[f"bodies[{i}].w"][-1] for i in range(3)] == pytest.approx(delta_by_hand(d), rel=1e-6)
    assert (
        system.translation.fitted({"d": 1.0})[0] is system.translation
    )  # the sum around the ring of dampers is the constraint
    rates = system.simulate(2.0, samples=2, rtol=1e-9, sensitivities=["d"])
    by_differences = (np.array(delta_by_hand(4.0 + 1e-3)) - np.array(delta_by_hand(4.0 - 1e-3))) / 2e-3
    assert rates.sensitivity("bodies[1].w", "d")[-1] == pytest.approx(by_differences[1], rel=1e-4)


class Geared(gl.Component):
    """Two gears without inertia between two springs, and a damper beside them, in which nothing turns if the gears cancel."""

    ratio = gl.Parameter("1", "of the first gear", default=4.0)
    J = gl.Parameter("kg.m2", "of the wheel between them", default=0.0, min=0)

    def assemble(self) -> list[Any]:
        self.torque, self.a, self.b = gp.Torque(tau=3.0), gp.Inertia(J=2.0), gp.Inertia(J=1.0)
        self.s, self.k, self.d, self.wheel = gp.Spring(c=22.0), gp.Spring(c=10.0), gp.Damper(d=2.0), gp.Inertia(J=self.J)
        self.first, self.second = gp.IdealGear(ratio=self.ratio, use_support=True), gp.IdealGear(ratio=0.25, use_support=True)
        self.ground = gp.Fixed()
        return [
            c(self.torque.flange, self.a.flange_a), c(self.a.flange_b, self.s.flange_a),
            c(self.s.flange_b, self.first.flange_a, self.d.flange_a),
            c(self.first.flange_b, self.wheel.flange_a), c(self.wheel.flange_b, self.second.flange_a),
            c(self.second.flange_b, self.k.flange_a, self.d.flange_b), c(self.k.flange_b, self.b.flange_a),
            c(self.ground.flange, self.first.support, self.second.support),
        ]  # fmt: skip


def geared_by_hand(ratio: float, J: float) -> float:
    """Speed of b after 2 s: the first node turns ``ratio`` times, the second one 4 times as fast as the wheel, to angle n."""

    def rates(t: float, x: Any) -> Any:
        a, n, b, wa, wb, wn = x
        left, right = 22 * (a - ratio * n), 10 * (4 * n - b)
        push, damping = ratio * left - 4 * right, 2 * (ratio - 4) ** 2
        if J == 0 and damping:
            wn = push / damping
        elif J == 0:
            wn = (22 * ratio * wa + 40 * wb) / (22 * ratio**2 + 160)
        return [wa, wn, wb, (3 - left) / 2, right, (push - damping * wn) / J if J else 0.0]

    found = solve_ivp(rates, (0.0, 2.0), np.zeros(6), method="Radau", rtol=1e-9, atol=1e-11)
    return float(found.y[4, -1])


def test_what_cancels_may_depend_on_values() -> None:
    """Gears of 4 and 1/4 cancel, with a wheel that has no inertia: other values, and the same ones again."""
    system = gl.compile(Geared(), ["b.w"])
    for ratio, J in ((4.0, 0.0), (3.0, 0.0), (4.0, 0.5), (4.0, 0.0)):
        result = system.simulate(2.0, samples=2, rtol=1e-9, parameters={"ratio": ratio, "J": J}, method="ida")
        assert result["b.w"][-1] == pytest.approx(geared_by_hand(ratio, J), rel=1e-6), (ratio, J)
    decided = system.translation.fitted({})[0]
    assert "sums        2 in which the highest derivatives cancel" in gl.System(decided).summary()
    assert {"first.ratio = 4", "wheel.J = 0"} <= set(system.translation.variants.named(decided.decided_by))
    with pytest.raises(ArgumentError, match=r"first.ratio, which is 4, and that decided which equation determines what"):
        system.simulate(2.0, samples=2, sensitivities=["ratio"])


def test_what_nothing_determines_is_refused_by_name() -> None:
    class Loose(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.a, self.p = gp.Torque(tau=1.0), gp.Inertia(J=1.0), gp.IdealPlanetary(ratio=2.0)
            self.push = gp.Torque(tau=gl.sin(gl.time))
            return [
                c(self.torque.flange, self.a.flange_a),
                c(self.push.flange, self.p.sun),
                c(self.p.sun, self.p.carrier, self.p.ring),
            ]

    with pytest.raises(ModelError, match=r"p\.sun\.phi"):
        gl.compile(Loose(), ["p.sun.phi"]).simulate(1.0, samples=2)


@pytest.mark.parametrize("n", [2, 5, 9])
def test_dependent_rows_are_found_whatever_their_sizes(n: int) -> None:
    rng = np.random.default_rng(n)
    whole = rng.normal(size=(n, n + 2))
    mixed = np.vstack([whole, whole[0] * 3 - whole[-1]]) * 10.0 ** rng.integers(-6, 6, (n + 1, 1))
    (weights,) = dependent_rows(mixed)
    assert np.abs(weights @ mixed).max() <= 1e-9 * np.abs(weights[:, None] * mixed).max()
    assert set(np.flatnonzero(weights).tolist()) == {0, n - 1, n}
    assert dependent_rows(whole) == []


def test_weights_that_cancel_rows_are_reduced() -> None:
    """A basis in echelon form: no vector holds the first row of another, which has the weight 1."""
    rows = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 1.0], [2.0, 5.0, 1.0], [1.0, 1.0, -1.0], [3.0, 0.0, 7.0]])
    found = dependent_rows(rows)
    assert len(found) == 2
    for weights in found:
        assert np.abs(weights @ rows).max() < 1e-12
    leads = [int(np.flatnonzero(w)[0]) for w in found]
    assert leads == sorted(set(leads))
    for k, weights in enumerate(found):
        assert weights[leads[k]] == 1.0
        assert all(weights[lead] == 0.0 for lead in leads[:k] + leads[k + 1 :])


@pytest.mark.parametrize(("difference", "count"), [(1e-13, 1), (1e-9, 0)])
def test_rows_are_dependent_up_to_rounding(difference: float, count: int) -> None:
    assert len(dependent_rows(np.array([[1.0, 2.0], [3.0, 6.0 * (1 + difference)]]))) == count


def test_rows_that_no_sum_needs_have_no_weight() -> None:
    rows = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0], [0.0, -4.0, 0.0]])
    assert dependent_rows(rows) == [
        pytest.approx([0.0, 1.0, 0.0, -0.5, 0.0], rel=1e-14, abs=0),
        pytest.approx([0.0, 0.0, 1.0, 0.0, 0.25], rel=1e-14, abs=0),
    ]


def test_a_row_without_coefficients_and_a_column_without() -> None:
    assert dependent_rows(np.array([[1.0, 1.0], [0.0, 0.0]])) == [], "nothing is left of such an equation"
    assert dependent_rows(np.array([[1.0, 0.0], [2.0, 0.0]])) == [pytest.approx([1.0, -0.5], rel=1e-14)]
    assert dependent_rows(np.array([[3.0, 0.0], [1.0, 0.0]])) == [pytest.approx([1.0, -3.0], rel=1e-14)]


def test_what_cancels_is_found_again_for_a_share_that_was_zero() -> None:
    """The springs meet at the angle q, where 22 (a - q) is 10 (q - b) less the share of what the set passes on."""
    system = gl.compile(Block(planetary=Leaking), ["a.w", "b.w"])
    with pytest.raises(ArgumentError, match=r"^p\.share is 0, and that decided which equation determines what"):
        system.simulate(2.0, samples=2, sensitivities=["p.share"])
    for share in (0.5, 0.0):

        def rates(t: float, x: Any, passed: float = 1.0 - share / 4.0) -> Any:
            q = (22 * x[0] + passed * 10 * x[2]) / (22 + passed * 10)
            return [x[1], (3.0 - 22 * (x[0] - q)) / 2.0, x[3], 10 * (q - x[2])]

        found = solve_ivp(rates, (0.0, 2.0), [0.0, 1.0, 0.0, 0.0], method="DOP853", rtol=1e-10, atol=1e-12)
        result = system.simulate(2.0, samples=2, rtol=1e-9, parameters={"p.share": share}, method="ida")
        assert [result["a.w"][-1], result["b.w"][-1]] == pytest.approx(found.y[[1, 3], -1], rel=1e-6), share
