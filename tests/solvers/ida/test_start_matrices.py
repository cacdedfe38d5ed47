"""Linear algebra of consistent start values: what follows from the states, how accurately, and where it is lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gearlib.native.source import SMALLER_CONSTRAINED
from gearlib.solvers.ida import start_matrices as module
from gearlib.solvers.ida.start_matrices import Watch, jacobian_at, of_algebraic, start_matrices
from gearlib.solvers.problem import Problem
from tests.run.python_problem import native, problem


def linear(J: Any, differential: Any, implicit: bool = False, **more: Any) -> Problem:
    """A problem with a constant, full Jacobian; ``data[0]`` multiplies it, and a negative time makes it fail."""
    J = np.asarray(J, float)
    n, entries = len(J), J.T.ravel().tolist()

    def jac(t: float, x: Any, out: Any, data: Any) -> int:
        for k, entry in enumerate(entries):
            out[k] = entry * data[0]
        return int(t < 0)

    given = {"data": np.ones(4), "times": np.array([0.0, 1.0]), "rtol": 1e-6} | more
    return replace(
        problem(lambda t, x, dx, data: 0, np.zeros(n)), jac=native(jac), jac_indptr=n * np.arange(J.shape[1] + 1),
        jac_indices=np.tile(np.arange(n), J.shape[1]), differential=np.asarray(differential, bool), implicit=implicit, **given,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_matrices_of_rates_and_algebraic_unknowns(seed: int) -> None:
    """F = diag(d) x' - f: by x' where an unknown is differential, by x where it is algebraic; and by the differential x."""
    J, d = np.random.default_rng(seed).normal(size=(4, 4)), np.array([True, False, True, False])
    unknown, state = start_matrices(linear(J, d), J.T.ravel())
    assert unknown.toarray() == pytest.approx(np.where(d, np.diag(d.astype(float)), -J))
    assert state.toarray() == pytest.approx(np.where(d, -J, 0.0))
    both = np.random.default_rng(seed).normal(size=(4, 8))
    unknown, state = start_matrices(linear(both, d, implicit=True), both.T.ravel())
    assert unknown.toarray() == pytest.approx(both[:, 4:] + np.where(d, 0.0, both[:, :4]))
    assert state.toarray() == pytest.approx(np.where(d, both[:, :4], 0.0))


def test_what_follows_from_the_states_is_as_accurate_as_these() -> None:
    """y = 3 x_0 + 4e3 x_1: its tolerance follows from those of the states, in the root mean square."""
    J, d = np.array([[-1.0, 0.0, 0.0], [0.0, -2.0, 0.0], [3.0, 4e3, -1.0]]), [True, True, False]
    absolute = np.array([1e-6, 2e-9, 1e-12])
    scales, found = of_algebraic(linear(J, d), absolute)
    own = absolute / 1e-6
    expected = np.hypot(3.0 * own[0], 4e3 * own[1])
    assert scales == pytest.approx([1.0, 1.0, max(expected, 1.0)])  # not below the nominal values
    assert found == pytest.approx([1e-6, 2e-9, 1e-6 * max(expected, 1.0)])
    small = linear(J, d, nominal=np.full(3, 1e-9))
    scales, found = of_algebraic(small, absolute)
    assert scales == pytest.approx([1.0 * own[0], 2.0 * own[1], expected])  # of the rates, too
    assert found == pytest.approx([1e-6, 2e-9, 1e-6 * expected])


def test_many_states_are_sampled(monkeypatch: pytest.MonkeyPatch) -> None:
    """By random combinations of them: the same to a factor."""
    rng, n = np.random.default_rng(1), 6
    J, d = rng.normal(size=(n, n)), np.arange(n) < 4
    absolute = 10.0 ** rng.uniform(-9, -5, n)
    exact, _ = of_algebraic(linear(J, d, nominal=np.full(n, 1e-12)), absolute)
    monkeypatch.setattr(module, "MOST_COLUMNS", n - 1)
    sampled, _ = of_algebraic(linear(J, d, nominal=np.full(n, 1e-12)), absolute)
    assert (sampled != exact).any()
    assert (sampled > 0.4 * exact).all()
    assert (sampled < 2.5 * exact).all()
    monkeypatch.setattr(module, "MOST_COLUMNS", n)
    assert of_algebraic(linear(J, d, nominal=np.full(n, 1e-12)), absolute)[0].tolist() == exact.tolist()


def test_without_algebraic_unknowns_tolerances_are_as_given() -> None:
    J, absolute = np.array([[-1.0, 5.0], [3.0, -1.0]]), np.array([1e-6, 1e-7])
    singular = np.array([[-1.0, 0.0], [1.0, 0.0]])
    for own in (linear(J, [True, True]), replace(linear(J, [True, False]), jac=None), linear(singular, [True, False])):
        scales, found = of_algebraic(own, absolute)
        assert scales.tolist() == [1.0, 1.0]
        assert found.tolist() == absolute.tolist()


def test_a_jacobian_that_cannot_be_evaluated_is_no_number() -> None:
    own = linear([[2.0, 3.0], [5.0, 7.0]], [True, False])
    assert jacobian_at(own, 0.0, np.zeros(4), np.full(4, 10.0)).tolist() == [20.0, 50.0, 30.0, 70.0]
    assert np.isnan(jacobian_at(own, -1.0, np.zeros(4), np.ones(4))).all()


def test_a_determinant_that_falls_is_noticed() -> None:
    """0 = 2 y - x: scaled down, the determinant falls by the logarithm of the scale; to a fifth it counts as lost."""
    watch, none = Watch(linear([[-1.0, 0.0], [-1.0, 2.0]], [True, False])), np.zeros(2)
    allowed = float(np.exp(-SMALLER_CONSTRAINED))
    for scale, spent in (
        (1.0, False),
        (5.0, False),
        (1.01 * allowed, False),
        (0.99 * allowed, True),
        (0.0, True),
        (1.0, False),
    ):
        assert watch.spent(0.0, none, none, np.full(4, scale)) == spent
    assert watch.spent(-1.0, none, none, np.ones(4))
