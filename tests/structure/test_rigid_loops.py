"""Rigid loops: what is redundant is left out, what contradicts is named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.errors import LoopError
from gearlib.structure.rigid_loops import Combination, core, examine

c = gl.connect


def dependent_rows(seed: int) -> Any:
    """A matrix whose rows depend on each other in several ways."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 7)), int(rng.integers(1, 9))
    basis = rng.integers(-3, 4, size=(int(rng.integers(1, m + 1)), n)).astype(float)
    return np.array([rng.choice([0, 1, -2, 0.5], size=len(basis)) @ basis for _ in range(m)])


def as_rows(A: Any) -> list[dict[int, float]]:
    return [{j: float(a) for j, a in enumerate(row) if a} for row in np.asarray(A)]


def contradictions(rows: Any, constants: list[float]) -> list[Combination]:
    """Without variables that are forced to stand still."""
    return [found for found in examine(rows, constants)[1] if found.variable < 0]


@given(st.integers(0, 10_000))
def test_what_is_left_is_independent_and_says_the_same(seed: int) -> None:
    A = dependent_rows(seed)
    redundant, _ = examine(as_rows(A), [0.0] * len(A))
    dropped = {found.last for found in redundant}
    kept = np.array([row for i, row in enumerate(A) if i not in dropped]).reshape(-1, A.shape[1])
    assert len(dropped) == len(redundant) == len(A) - np.linalg.matrix_rank(A)
    assert len(kept) == np.linalg.matrix_rank(A)
    for found in redundant:
        assert np.allclose(np.array(found.multipliers) @ A[list(found.rows)], 0, atol=1e-9)


@given(st.integers(0, 10_000))
def test_right_hand_sides_decide_between_redundant_and_contradictory(seed: int) -> None:
    A = dependent_rows(seed)
    x = np.arange(1.0, A.shape[1] + 1)
    rows = [{j: a for j, a in enumerate(row) if a} for row in A]
    assert contradictions(rows, list(A @ x)) == []
    rank = np.linalg.matrix_rank(A)
    b = A @ x + np.random.default_rng(seed).normal(size=len(A))
    assert len(contradictions(rows, list(b))) == len(A) - rank


@given(st.integers(0, 10_000))
def test_a_contradiction_is_a_sum_of_rows_with_nothing_left_but_a_number(seed: int) -> None:
    A = dependent_rows(seed)
    b = np.random.default_rng(seed).normal(size=len(A))
    for found in contradictions(as_rows(A), list(b)):
        weights = np.array(found.multipliers)
        assert np.abs(weights @ A[list(found.rows)]).max() < 1e-9 * np.abs(weights).max()
        assert weights @ b[list(found.rows)] == pytest.approx(found.constant, rel=1e-6)
        assert dict(zip(found.rows, weights, strict=True))[found.last] == 1.0


@given(st.integers(0, 10_000))
def test_what_is_forced_to_stand_follows_from_its_rows(seed: int) -> None:
    """The rows of each finding leave one variable, which is zero; where nothing in a loop can turn, there is one."""
    A = dependent_rows(seed)
    loop = core(as_rows(A))
    redundant, forced = examine(as_rows(A), [0.0] * len(A))
    assert len(redundant) == len(A) - np.linalg.matrix_rank(A)
    for found in forced:
        left = np.array(found.multipliers) @ A[list(found.rows)]
        assert np.flatnonzero(np.abs(left) > 1e-9).tolist() == [found.variable]
        assert len(found.rows) > 1
    inside = A[loop][:, np.abs(A[loop]).any(axis=0)] if loop else np.zeros((0, 0))
    held = any(np.count_nonzero(row) == 1 for row in inside)
    if inside.size and not held and np.linalg.matrix_rank(inside) == inside.shape[1]:
        assert forced
    assert contradictions(as_rows(A), [0.0] * len(A)) == []
    x = np.arange(1.0, A.shape[1] + 1)  # each has a place of its own, other than zero
    assert examine(as_rows(A), list(A @ x))[1] == []


def test_what_stands_on_the_ground_is_not_forced() -> None:
    """A gear between two grounds: one of the three equations follows from the others, and nothing is wrong with the ratio."""
    redundant, contradictory = examine([{0: 1.0}, {0: 1.0, 1: -2.0}, {1: 1.0}], [0.0, 0.0, 0.0])
    assert [sorted(found.rows) for found in redundant] == [[0, 1, 2]]
    assert contradictory == []


@pytest.mark.parametrize(("difference", "same"), [(1e-9, False), (1e-11, True), (-1e-9, False), (-1e-11, True)])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_ratios_are_equal_up_to_rounding_of_their_rows(difference: float, same: bool, size: float) -> None:
    """Relative to the largest coefficient of a row; constants relative to theirs, or to 1."""
    rows = [{0: size, 1: -2.0 * size}, {0: 1.0, 1: -2.0 * (1 + difference)}]
    redundant, contradictory = examine(rows, [0.0, 0.0])
    assert (len(redundant), len(contradictory)) == ((1, 0) if same else (0, 1))
    rows = [{0: 1.0, 1: -2.0}, {0: 1.0, 1: -2.0}]
    redundant, contradictory = examine(rows, [size, size + difference * max(size, 1.0)])
    assert (len(redundant), len(contradictory)) == ((1, 0) if same else (0, 1))


def test_what_varies_with_time_agrees_with_nothing() -> None:
    assert examine([{0: 1.0, 1: -3.0}] * 2, [float("nan"), 0.0])[1][0].rows == (0, 1)


@given(st.lists(st.dictionaries(st.integers(0, 6), st.sampled_from([0.0, 1.0]), max_size=3), max_size=9))
def test_the_core_is_what_no_row_can_leave(rows: list[dict[int, float]]) -> None:
    """Brute force: take rows away, one by one, while one has a variable that no other has."""
    left = list(range(len(rows)))
    while True:
        used = [v for r in left for v, c in rows[r].items() if c]
        alone = [r for r in left if any(c and used.count(v) == 1 for v, c in rows[r].items())]
        if not alone:
            break
        left.remove(alone[0])
    assert core(rows) == left


def gears(*ratios: float, bodies: int = 2) -> gl.Component:
    """Gears side by side between two inertias."""

    class Loop(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.torque = gp.Torque(tau=6.0)
            self.gear = [gp.IdealGear(ratio=r) for r in ratios]
            return [
                c(self.torque.flange, self.a.flange_a),
                *(c(self.a.flange_b, g.flange_a) for g in self.gear),
                *(c(g.flange_b, self.b.flange_a) for g in self.gear),
            ]

    return Loop()


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_equal_gears_side_by_side_turn_as_one(count: int) -> None:
    system = gl.compile(gears(*[2.0] * count))
    assert len(system.states) == 1
    assert ("redundant" in system.summary()) == (count > 1)
    result = system.simulate(1.0, samples=3)
    # J = 1 + 2/4 seen from a
    assert result["a.w"] == pytest.approx(6 / 1.5 * result.time, rel=1e-12)
    assert result["b.w"] == pytest.approx(6 / 1.5 / 2 * result.time, rel=1e-12)
    assert sum(result[f"gear[{i}].flange_a.tau"] for i in range(count)) == pytest.approx(6 - 4.0)


@pytest.mark.parametrize("error", [1e-13, -3e-14])
def test_ratios_that_differ_by_rounding_are_equal(error: float) -> None:
    result = gl.simulate(gears(2.0, 2.0 * (1 + error)), 1.0, samples=2)
    assert result["a.w"][-1] == pytest.approx(4.0, rel=1e-11)


@pytest.mark.parametrize("ratio", [3.0, -2.0, 2.0 * (1 + 1e-6)])
def test_gears_that_contradict_each_other_are_named(ratio: float) -> None:
    with pytest.raises(
        LoopError, match=r"the rigid loop through gear\[0\], gear\[1\] cannot turn.*make one of the connections elastic"
    ):
        gl.compile(gears(2.0, ratio))


def test_a_parameter_of_a_run_cannot_break_a_loop() -> None:
    system = gl.compile(gears(2.0, 2.0))
    assert system.simulate(1.0, samples=2, parameters={"b.J": 6.0})["a.w"][-1] == pytest.approx(6 / 2.5)
    with pytest.raises(LoopError, match=r"gear\[0\], gear\[1\]|compile again"):
        system.simulate(1.0, samples=2, parameters={"gear[1].ratio": 3.0})


def test_bodies_joined_at_both_ends() -> None:
    class Joined(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.torque = gp.Inertia(J=1.0), gp.Inertia(J=2.0), gp.Torque(tau=6.0)
            return [
                c(self.torque.flange, self.a.flange_a),
                c(self.a.flange_a, self.b.flange_a),
                c(self.a.flange_b, self.b.flange_b),
            ]

    result = gl.simulate(Joined(), 1.0, samples=2)
    assert result["b.w"][-1] == pytest.approx(2.0, rel=1e-12)


def test_a_loop_of_planetary_sets_that_locks_is_named() -> None:
    """Two sets with the same ratio whose rings, suns and carriers are joined, one ring through a gear: nothing can turn."""

    class Locked(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = gp.IdealPlanetary(ratio=3.0), gp.IdealPlanetary(ratio=3.0)
            self.gear, self.body = gp.IdealGear(ratio=2.0), [gp.Inertia(J=1.0) for _ in range(3)]
            return [
                c(self.one.sun, self.other.sun, self.body[0].flange_a),
                c(self.one.carrier, self.other.carrier, self.body[1].flange_a),
                c(self.one.ring, self.gear.flange_a, self.body[2].flange_a),
                c(self.gear.flange_b, self.other.ring),
            ]

    with pytest.raises(
        LoopError, match=r"the rigid loop through (one|other|gear), (one|other|gear), (one|other|gear) cannot turn"
    ):
        gl.compile(Locked())


@pytest.mark.parametrize("seed", range(12))
def test_loops_are_found_whatever_the_sizes_of_rows_and_coefficients(seed: int) -> None:
    """As many redundant rows as the rank says, which are combinations of those that they name."""
    rng = np.random.default_rng(seed)
    n, rank = 8, int(rng.integers(2, 6))
    base = rng.normal(size=(rank, n)) * 10.0 ** rng.uniform(-3, 0, (rank, n))
    mixed = np.vstack([base, rng.integers(-3, 4, (4, rank)) @ base])
    mixed = mixed[np.abs(mixed).max(axis=1) > 0][rng.permutation((np.abs(mixed).max(axis=1) > 0).sum())]
    mixed *= 10.0 ** rng.uniform(-7, 7, (len(mixed), 1))
    rows = [dict(enumerate(row.tolist())) for row in mixed]
    redundant, contradictory = examine(rows, [0.0] * len(rows))
    assert len(redundant) == len(rows) - np.linalg.matrix_rank(mixed / np.abs(mixed).max(axis=1, keepdims=True))
    assert contradictory == []
    for found in redundant:
        terms = np.array(found.multipliers)[:, None] * mixed[list(found.rows)]
        assert np.abs(terms.sum(axis=0)).max() < 1e-8 * np.abs(terms).max()
        assert found.last in found.rows


@pytest.mark.parametrize("small", [3.1e-10, -1.7e-8])
def test_a_small_coefficient_is_no_pivot(small: float) -> None:
    """Divided by it, rounding would hide that the last row is a sum of the others, whatever stands first."""
    first, second = np.array([small, 1.37, 0.73]), np.array([0.91, 1.13, 0.3])
    redundant, contradictory = examine(as_rows([first, second, 3 * first + 2 * second]), [0.0] * 3)
    assert contradictory == []
    assert [found.rows for found in redundant] == [(0, 1, 2)]
    weights = np.array(redundant[0].multipliers)
    assert weights / weights[2] == pytest.approx([-3.0, -2.0, 1.0], rel=1e-9)


def test_a_row_with_several_variables_of_its_own_leaves_once() -> None:
    """The variable that is seen first belongs to another row, which leaves too."""
    assert core([{0: 1.0}, {1: 1.0, 2: 1.0}]) == []
    assert core([{0: 1.0, 5: 2.0}, {1: 1.0, 2: 1.0, 5: 0.0}, {3: 1.0}, {3: 2.0}]) == [2, 3]


@pytest.mark.parametrize("factor", [1.0, -1.0, 2.0])
def test_a_chain_of_rows_leaves_from_its_end(factor: float) -> None:
    assert core([{k: 1.0, k + 1: factor} for k in range(5)]) == []
    assert core([*({k: 1.0, k + 1: factor} for k in range(5)), {5: 1.0, 0: 1.0}]) == list(range(6))
