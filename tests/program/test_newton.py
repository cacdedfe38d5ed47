"""Newton's method: where it converges, against SciPy's solver, and how it says that it does not."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root

from gearlib.program.newton import Correction, newton

Floats = NDArray[np.float64]


def small(x: Floats, step: Floats, residual: Floats) -> bool:
    return bool(np.abs(step).max() <= 1e-14 * np.abs(x).max())


def coupled(x: Floats, stiffness: Floats) -> Floats:
    """Hardening springs in a ring, each loaded by 1."""
    return stiffness * x + x**3 + 0.3 * np.roll(x, 1) - 1.0


def equations(x: Floats, stiffness: Floats) -> tuple[Floats, Correction]:
    n = len(x)
    matrix = np.diag(stiffness + 3 * x**2) + 0.3 * np.roll(np.eye(n), -1, axis=1)
    return coupled(x, stiffness), partial(np.linalg.solve, matrix)


@pytest.mark.parametrize("seed", range(5))
def test_it_comes_to_the_root_that_scipy_finds(seed: int) -> None:
    stiffness = np.random.default_rng(seed).uniform(1.0, 3.0, 6)
    found = newton(lambda x: equations(x, stiffness), np.zeros(6), small, 20)
    expected = root(coupled, np.zeros(6), (stiffness,), tol=1e-14).x
    assert found.settled
    np.testing.assert_allclose(found.x, expected, rtol=1e-12)


def arctangent(x: Floats) -> tuple[Floats, Correction]:
    return np.arctan(x), lambda r: r * (1.0 + x**2)


def test_damping_reaches_what_whole_steps_run_away_from() -> None:
    start = np.array([3.0])
    assert not newton(arctangent, start, lambda x, step, rest: abs(x[0]) < 1e-12, 5).settled
    found = newton(arctangent, start, lambda x, step, rest: abs(rest[0]) < 1e-12, 30, (1.0, 0.5, 0.25, 0.1))
    assert found.settled
    assert abs(found.x[0]) < 1e-12


def test_a_singular_matrix_ends_it_where_it_is() -> None:
    found = newton(lambda x: (x, partial(np.linalg.solve, np.zeros((2, 2)))), np.ones(2), small, 5)
    assert (found.settled, found.singular, found.iterations) == (False, True, 1)
    assert found.x.tolist() == [1.0, 1.0]


def test_equations_that_cannot_be_evaluated_end_it() -> None:
    found = newton(lambda x: (x * np.nan, lambda r: r), np.ones(2), small, 5)
    assert (found.settled, found.singular, found.iterations) == (False, False, 1)
    assert found.x.tolist() == [1.0, 1.0]


def test_it_gives_up_after_so_many_iterations() -> None:
    found = newton(lambda x: (x**2 + 1.0, lambda r: r / (2.0 * x)), np.array([0.7]), small, 7)
    assert (found.settled, found.singular, found.iterations) == (False, False, 7)


@pytest.mark.parametrize(("shares", "taken"), [((), 1.0), ((1.0,), 1.0), ((1.0, 0.5, 0.2, 0.1), 0.2), ((1.0, 0.5), 0.5)])
def test_the_first_share_that_helps_is_taken_or_the_last(shares: tuple[float, ...], taken: float) -> None:
    """From x = 2 a whole step leads to arctan's other side and farther away, half of one still does, a fifth does not."""
    seen: list[Floats] = []

    def settled(x: Floats, step: Floats, rest: Floats) -> bool:
        seen.extend((x, step, rest))
        return True

    def steep(x: Floats) -> tuple[Floats, Correction]:
        return np.arctan(x), lambda r: 9.0 * np.ones(1)

    found = newton(steep, np.array([2.0]), settled, 3, shares)
    x = 2.0 - 9.0 * taken
    assert [np.shape(a) for a in seen] == [(1,)] * 3
    assert np.concatenate(seen) == pytest.approx([x, 9.0 * taken, np.arctan(x if shares else 2.0)])
    assert (found.settled, found.iterations, found.singular, found.x[0]) == (True, 1, False, seen[0][0])


@pytest.mark.parametrize(("most", "settled"), [(3, False), (4, True), (5, True)])
def test_no_more_iterations_than_allowed_and_needed(most: int, settled: bool) -> None:
    found = newton(lambda x: (x, lambda r: 0.5 * r), np.ones(1), lambda x, step, rest: bool(x[0] == 0.5**4), most)
    assert (found.settled, found.iterations, found.x[0]) == (settled, min(most, 4), 0.5 ** min(most, 4))


def test_a_correction_that_is_a_number_in_part_goes_on() -> None:
    """Of many points at once some may be lost, and the others come to their roots."""
    found = newton(lambda x: (x - 1.0, lambda r: np.where(x == 5.0, np.nan, r)), np.array([5.0, 3.0]), lambda *_: True, 2)
    assert found.settled
    assert found.x[1] == 1.0


@pytest.mark.parametrize(("shares", "x"), [((1.0, 0.5), 0.0), ((1.0, 0.25), 1.0), ((1.0, 1.0), -2.0)])
def test_a_residual_that_stays_as_large_has_not_fallen(shares: tuple[float, ...], x: float) -> None:
    """From 2 a whole step leads to -2, where the arctangent is as large."""
    found = newton(lambda x: (np.arctan(x), lambda r: np.full(1, 4.0)), np.array([2.0]), lambda *_: True, 3, shares)
    assert (found.settled, found.x.tolist()) == (True, [x])


@pytest.mark.parametrize(("after", "x"), [(1, 8.0), (2, 4.0), (4, 1.0)])
def test_equations_that_are_singular_somewhere_end_it_there(after: int, x: float) -> None:
    """Evaluating them may say so as well, before the first step or later."""
    calls: list[float] = []

    def halved(x: Floats) -> tuple[Floats, Correction]:
        calls.append(float(x[0]))
        if len(calls) == after:
            raise np.linalg.LinAlgError
        return x, lambda r: 0.5 * r

    found = newton(halved, np.array([8.0]), lambda *_: False, 9)
    assert (found.settled, found.singular, found.iterations, found.x.tolist()) == (False, True, after, [x])
