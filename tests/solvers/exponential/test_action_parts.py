"""The parts of the sparse exponential one by one: ellipses that miss eigenvalues, units of states, diagonals, bounds, steps and costs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.solvers.exponential import action as action_module
from gearlib.solvers.exponential.action import (
    Action,
    Ellipse,
    Triplets,
    enclosing,
    prepare,
)
from gearlib.solvers.exponential.chebyshev import TILE


def triplets(A: Any) -> Triplets:
    rows, columns = np.nonzero(A)
    return Triplets(rows, columns, A[rows, columns])


def parts(A: Any) -> tuple[Any, ...]:
    """Diagonal; rows, columns and entries off it; of each entry its mirror image, zero where there is none."""
    off = triplets(A - np.diag(np.diag(A)))
    return np.diag(A).copy(), off.rows, off.columns, off.entries, A[off.columns, off.rows]


def test_modes_that_equal_states_do_not_show_are_seen() -> None:
    """The sums of two equal halves vibrate, their differences fill a rectangle, whose corners a narrow ellipse would cut off."""
    n = 40
    sums = np.kron(np.eye(n), 1000.0 * np.array([[0.0, 1.0], [-1.0, 0.0]])) - 400.0 * np.eye(2 * n)
    differences = sums + np.diag(np.repeat(np.linspace(400.0, -400.0, n), 2))
    A = 0.5 * np.block([[sums + differences, sums - differences], [sums - differences, sums + differences]])
    action = prepare(triplets(A), np.arange(4 * n), span=1.0)
    z = np.concatenate([np.ones(2 * n), -np.ones(2 * n)])
    assert np.abs(action.advance(z, 0.1, 3, 1e-12)[-1] - expm(0.3 * A) @ z).max() < 1e-12


def test_an_ellipse_is_taken_only_if_its_polynomials_do_not_grow() -> None:
    """The narrow one where it holds; else it is widened by tenths, up to the safe one."""
    n = 40
    turn = np.kron(np.eye(n), 1000.0 * np.array([[0.0, 1.0], [-1.0, 0.0]]))
    wide = turn - np.diag(np.repeat(np.linspace(0.0, 800.0, n), 2))
    damped = turn - np.kron(np.eye(n), np.diag([20.0, 0.0]))
    for A in (wide, damped):
        diagonal, rows, columns, entries, mirrored = parts(A)
        tight, safe = enclosing(diagonal, rows, columns, entries, mirrored, 1.0)
        found = prepare(triplets(A), np.arange(2 * n), span=1.0)
        e, probe = found.ellipse, np.ones(2 * n)
        assert action_module.growth(e, found.offsets, found.diagonals, found.rows, found.columns, found.entries, probe) < 10.0
        if A is damped:
            assert e == tight != safe
        else:
            assert tight.imaginary < e.imaginary <= safe.imaginary
            steps = round(math.log(e.imaginary / tight.imaginary) / math.log(1.1))
            assert steps >= 1
            assert e == safe or e.imaginary == pytest.approx(tight.imaginary * 1.1**steps, rel=1e-12)
            assert e == safe or e.real == pytest.approx(tight.real * 1.1**steps, rel=1e-12)
            share = 1.1 ** -(steps if e != safe else 0)
            less = Ellipse(e.centre, e.real * share, e.imaginary * share)  # the one that would have been taken at first
            factor = 2.0 / (less.radius * less.focus)
            offsets, diagonals, r, c, others = action_module.split(rows, columns, entries, diagonal - less.centre)
            assert action_module.growth(less, offsets, diagonals * factor, r, c, others * factor, probe) >= 10.0 or e == safe


@pytest.mark.parametrize("span", [1e-9, 1.0, 1e9])
def test_bounds_of_a_vibration_and_of_a_decay(span: float) -> None:
    """Exact for two states, with two hundredths to spare; each half axis a thousandth of the other at least, or of the span."""
    least = 1e-3 / span

    def close(found: float, expected: float, longest: float) -> bool:
        return expected <= found <= expected + 2.1 / 512 * longest

    size = max(7.0, least)
    diagonal, *rest = parts(np.array([[0.0, 7.0], [-7.0, 0.0]]))
    tight, safe = enclosing(diagonal, *rest, span)  # type: ignore[arg-type]
    if span >= 1.0:
        assert tight == safe
        assert (tight.centre, close(tight.imaginary, 7.14, 7.14)) == (0.0, True)
        assert close(tight.real, 1.02e-3 * size, 7.14)
    none = np.empty(0, np.int64)
    decays = np.array([-5.0, -1.0, -2.0])
    tight, safe = enclosing(decays, none, none, np.empty(0), np.empty(0), span)
    size = max(2.0, least)
    assert tight == safe  # no vibration: the narrow one is not tried
    assert safe.centre == pytest.approx(-3.0, abs=2.1 / 512 * max(2.04, 1.02e-3 * size))
    if span >= 1.0:
        assert close(safe.real, 2.04, 2.04)
        assert close(safe.imaginary, 1.02 * 1e-3 * size, 2.04)
    nothing, _ = enclosing(np.zeros(2), none, none, np.empty(0), np.empty(0), span)
    assert nothing.real == pytest.approx(1.02e-3 * least, rel=5e-3)
    assert nothing.imaginary == pytest.approx(nothing.real * math.hypot(1.0, 0.5), rel=5e-3)  # elongated, since it is a circle


def test_units_make_springs_and_inertias_alike() -> None:
    """Entries (i, j) and (j, i) become equal in size, in every part of the scene."""
    rng, n = np.random.default_rng(4), 12
    symmetric = np.where(rng.random((n, n)) < 0.3, rng.uniform(0.5, 2.0, (n, n)), 0.0)
    symmetric = np.triu(symmetric, 1)
    symmetric[:6, 6:] = 0.0  # two parts
    units = 10.0 ** rng.uniform(-4, 4, n)
    A = (symmetric - symmetric.T) * units[:, None] / units
    diagonal, rows, columns, entries, mirrored = parts(A)
    scale = action_module.balance(rows, columns, entries, mirrored, diagonal, 1.0)
    scaled = entries * scale[columns] / scale[rows]
    assert np.abs(scaled) == pytest.approx(np.abs(symmetric + symmetric.T)[rows, columns], rel=1e-9)


@pytest.mark.parametrize("unit", [1.0, 1e5, 1e-7])
@pytest.mark.parametrize(
    ("rate", "span", "target"), [(50.0, 10.0, 1.0), (50.0, 1e-3, 1e3), (0.0, 4.0, 0.25), (500.0, 10.0, 10.0)]
)
def test_one_way_couplings_become_small(rate: float, span: float, target: float, unit: float) -> None:
    """A fiftieth of the fastest rate, or one over the span: an integrated angle, and what follows that in turn."""
    A = np.zeros((4, 4))
    A[0, 1], A[1, 0], A[2, 0], A[3, 2] = rate, -rate, 3.0 * unit, 1e-3 / unit
    diagonal, rows, columns, entries, mirrored = parts(A)
    scale = action_module.balance(rows, columns, entries, mirrored, diagonal, span)
    assert scale[0] == pytest.approx(scale[1])
    assert A[2, 0] * scale[0] / scale[2] == pytest.approx(target)
    assert A[3, 2] * scale[2] / scale[3] == pytest.approx(target)


def test_what_follows_much_faster_than_it_is_coupled_loses_three_digits_at_most() -> None:
    """Of a cascade of lags: the end of a short one is small in its units; along a long one its couplings are larger."""
    rate = 100.0
    for n in (2, 3, 20):
        A = -rate * np.eye(n) + 1e-2 * np.diag(np.ones(n - 1), -1)
        diagonal, rows, columns, entries, mirrored = parts(A)
        scale = action_module.balance(rows, columns, entries, mirrored, diagonal, 1.0)
        coupling = entries * scale[columns] / scale[rows]
        assert coupling == pytest.approx(np.full(n - 1, coupling[0]), rel=1e-9)
        whole = (n - 1) * math.log(rate)  # of the end of the cascade, with couplings of one over the span
        share = 1.0 - math.log(1e3) / whole
        assert math.log(coupling[0]) == pytest.approx(max(share, 0.0) * math.log(rate), abs=1e-9)


def test_levels_are_the_longest_ways_through_one_way_couplings() -> None:
    """Two ways lead to group 3; nothing leads to 0 and 4; with a cycle there are none."""
    to, of, size = np.array([1, 2, 3, 3]), np.array([0, 1, 2, 0]), np.array([1.0, 2.0, -4.0, 0.5])
    assert action_module.levels(to, of, size, 5).tolist() == [0.0, 1.0, 3.0, 0.5, 0.0]
    size[2] = 4.0
    assert action_module.levels(to, of, size, 5).tolist() == [0.0, 1.0, 3.0, 7.0, 0.0]
    assert action_module.levels(np.array([0, 1]), np.array([1, 0]), np.ones(2), 3).tolist() == [0.0] * 3
    none = np.empty(0, np.int64)
    assert action_module.levels(none, none, np.empty(0), 2).tolist() == [0.0, 0.0]
    chain = np.arange(25)
    assert action_module.levels(chain + 1, chain, np.ones(25), 26).tolist() == list(range(26))


@pytest.mark.parametrize("n", [1, 9, 16, 23])
def test_a_matrix_is_split_into_filled_diagonals_and_single_entries(n: int) -> None:
    """Those with an eighth of their places; the main one always."""
    rng = np.random.default_rng(n)
    A = np.diag(rng.normal(size=n)) if n != 16 else np.zeros((n, n))
    least = math.ceil(n / 8)
    wanted = {0}
    for offset, count in ((1, least), (-2, least - 1), (3, least + 1), (-4, 1)):
        places = rng.permutation(n - abs(offset))[:count] if n > 8 else []
        for k in places:
            A[k + max(-offset, 0), k + max(offset, 0)] = rng.uniform(1.0, 2.0)
        if len(places) >= n / 8:
            wanted.add(offset)
    diagonal, rows, columns, entries, _ = parts(A)
    offsets, diagonals, r, c, others = action_module.split(rows, columns, entries, diagonal)
    assert offsets.tolist() == sorted(wanted)
    found = np.zeros((n, n))
    np.add.at(found, (r, c), others)
    assert not {*(c - r).tolist()} & wanted
    for offset, values in zip(offsets, diagonals, strict=True):
        for row in range(n):
            if 0 <= row + offset < n:
                found[row, row + offset] += values[row]
            else:
                assert values[row] == 0.0
    assert found == pytest.approx(A, abs=0.0)


def test_mirror_images_of_entries() -> None:
    rng, n = np.random.default_rng(2), 7
    A = np.where(rng.random((n, n)) < 0.4, rng.normal(size=(n, n)), 0.0)
    rows, columns = np.nonzero(A)
    shuffled = rng.permutation(len(rows))
    rows, columns = rows[shuffled], columns[shuffled]
    places, there = action_module.transposes(n, rows, columns)
    assert there.tolist() == (A[columns, rows] != 0.0).tolist()
    assert rows[places[there]].tolist() == columns[there].tolist()
    assert columns[places[there]].tolist() == rows[there].tolist()
    places, there = action_module.transposes(n, rows[:0], columns[:0])
    assert (len(places), len(there)) == (0, 0)


@pytest.mark.parametrize(
    ("n", "inputs", "alone"), [(2 * TILE + 1, 3, 2 * TILE - 2), (2 * TILE, 3, 0), (2 * TILE + 1, 0, 2 * TILE + 1)]
)
def test_long_scenes_are_computed_in_tiles_if_far_entries_are_those_of_inputs(n: int, inputs: int, alone: int) -> None:
    rows = np.arange(n - 1)
    order = np.arange(n)
    far = np.array([5]), np.array([n - 1])
    for extra in (0, 1):
        i, j = (np.concatenate([a, b]) if extra and inputs else a for a, b in zip((rows, rows + 1), far, strict=True))
        given = Triplets(np.concatenate([i, rows + 1]), np.concatenate([j, rows]), np.append(np.ones(len(i)), -np.ones(n - 1)))
        assert prepare(given, order, 1.0, inputs).alone == alone
    within = Triplets(np.append(rows, 5), np.append(rows + 1, n // 2), np.append(np.ones(n - 1), 1.0))
    assert prepare(within, order, 1.0, inputs).alone == 0


def plain(ellipse: Ellipse) -> Action:
    none = np.empty(0, np.int64)
    return Action(np.ones(3), np.arange(3), ellipse, np.array([0]), np.zeros((1, 3)), none, none, np.empty(0), 0)


def test_steps_share_a_series_or_are_divided() -> None:
    """130 radians per series, 1e4 where decays prevail, and growth by two at most; no more than eight steps."""
    vibration, diffusion, growth = Ellipse(-1.0, 1.0, 64.0), Ellipse(-40.0, 40.0, 10.0 - 1e-9), Ellipse(3.0, 1.0, 64.0)
    reaches = {vibration: 2.0, diffusion: 1e4 / (50.0 - 1e-9), growth: 0.5, Ellipse(-40.0, 40.0, 10.0): 2.6}
    for ellipse, reach in reaches.items():
        steps = plain(ellipse)._steps
        assert steps(reach * 1.0001, 50) == (1, 2)
        assert steps(reach * 4.5, 50) == (1, 5)
        assert steps(reach * 0.9999, 50) == (1, 1)
        assert steps(reach / 2.0001, 50) == (2, 1)
        assert steps(reach / 7.99, 50) == (7, 1)
        assert steps(reach / 100.0, 50) == (8, 1)
        assert steps(reach / 100.0, 3) == (3, 1)
        assert steps(reach * 1e-9, 50) == (8, 1)


def test_tolerances_are_shared_by_all_series() -> None:
    own = plain(Ellipse(-1.0, 1.0, 2.0))
    assert own._tolerance(1e-6, 10, 30) == pytest.approx(1e-6 / 400.0)
    assert own._tolerance(1e-6, 0, 30) == pytest.approx(1e-8)
    assert own._tolerance(1e-15, 10, 1) == 1e-16


def test_costs_are_those_of_the_products() -> None:
    """In proportion to the terms of the series; those of diagonals and of single entries for themselves."""
    A = np.diag(np.ones(199), 1) - np.diag(np.ones(199), -1)
    own = prepare(triplets(A), np.arange(200), span=1.0)
    assert len(own.offsets) == 3
    for h, count in ((0.1, 20), (200.0, 20), (0.1, 1)):
        several, repeats = own._steps(h, count)
        terms = len(own.ellipse.series(h * several / repeats, own._tolerance(1e-9, count, repeats)))
        products = terms * count * repeats / several
        cost = own.seconds(h, count, 1e-9)
        more = replace(own, entries=np.ones(1000)).seconds(h, count, 1e-9)
        assert more - cost == pytest.approx(1.5e-6 * products, rel=1e-9)
        more = replace(own, offsets=np.arange(7)).seconds(h, count, 1e-9)
        assert more - cost == pytest.approx(4 * 200 * 1.4e-10 * products, rel=1e-9)
        more = replace(own, scale=np.ones(400)).seconds(h, count, 1e-9)
        assert more - cost == pytest.approx(200 * 4.5 * 1.4e-10 * products, rel=1e-9)
        assert cost - 1e-4 == pytest.approx((6e-8 + 200 * 4.5 * 1.4e-10) * products, rel=1e-9)


def test_ellipses_with_foci() -> None:
    """A hundredth of the square apart are enough; a circle becomes elongated."""
    for real, imaginary, kept in (
        (1.0, 0.94, True),
        (1.0, 0.96, False),
        (0.94, 1.0, True),
        (0.96, 1.0, False),
        (2.0, 2.0, False),
    ):
        own = Ellipse(-1.0, real, imaginary)
        found = own.with_foci()
        assert (found == own) == kept
        if not kept:
            assert (found.centre, found.real) == (-1.0, real)
            assert found.imaginary == pytest.approx(math.sqrt(max(real, imaginary) ** 2 + 0.25 * real**2))
    assert (Ellipse(0.0, 3.0, 5.0).focus, Ellipse(0.0, 5.0, 3.0).focus) == (4.0, 4.0)
    assert Ellipse(0.0, 3.0, 5.0).radius == 2.0
    assert [Ellipse(0.0, *axes).sign for axes in ((3.0, 5.0), (5.0, 3.0), (2.0, 2.0))] == [1.0, -1.0, 1.0]
