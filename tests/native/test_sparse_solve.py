"""Sparse factorisation of large blocks in native code, against numpy's dense one."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

from gearlib.compiler.object_code import compiled
from gearlib.native.source import HEADER
from gearlib.native.sparse_solve import SPARSE_SOLVE, factors_size, pattern_array, room
from gearlib.structure.elimination_order import EliminationOrder, elimination_order

CALL = '''
def call(t: float, x: floats, dx: floats, data: floats, index: ints) -> int32:
    """Right-hand side first, then entries, then factors."""
    n, entries = int(x[0]), int(x[1])
    sparse_factorise(data, index, 0, n, n + entries)
    return sparse_apply(data, index, 0, n + entries, 0, 1)
'''


def solved(order: EliminationOrder, matrix: np.ndarray[Any, Any], right: np.ndarray[Any, Any]) -> tuple[int, Any, float, float]:
    """Status, solution, logarithm of the determinant, entries of the lower factor."""
    n, entries = order.n, len(order.places)
    data = np.concatenate([right, matrix.ravel()[order.places], np.zeros(factors_size(order))])
    sizes, index = np.array([n, entries], float), pattern_array(order)
    function = compiled(HEADER + SPARSE_SOLVE + CALL, "call")
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[ctypes.c_void_p] * 4)(function.address)
    status = call(0.0, sizes.ctypes.data, sizes.ctypes.data, data.ctypes.data, index.ctypes.data)
    fill = float(data[n + entries + 2 + 11 * n])
    return status, data[:n], float(data[n + entries]), fill


def pattern(rng: np.random.Generator, n: int, density: float) -> np.ndarray[Any, Any]:
    mask = rng.random((n, n)) < density
    mask[np.arange(n), rng.permutation(n)] = True
    return mask


@pytest.mark.parametrize("seed", range(12))
def test_random_matrices(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 60))
    mask = pattern(rng, n, float(rng.choice([0.02, 0.1, 0.4])))
    order = elimination_order(n, np.flatnonzero(mask))
    for _ in range(5):  # many entries may be zero, as those of friction in other modes
        matrix = np.where(mask, rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-3, 3, (n, 1)), 0.0)
        right = rng.normal(size=n)
        status, found, determinant, _ = solved(order, matrix, right)
        assert status == 0
        error = np.abs(matrix @ found - right) / (np.abs(matrix) @ np.abs(found) + np.abs(right))
        assert error.max() < 1e-11
        assert determinant == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-8)


@pytest.mark.parametrize("seed", range(6))
def test_dependent_equations_are_left_out_where_they_agree(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    n = int(rng.integers(5, 40))
    mask = pattern(rng, n, 0.1)
    mask[1] |= mask[0]
    mask[2] |= mask[0]
    order = elimination_order(n, np.flatnonzero(mask))
    matrix = np.where(mask, rng.integers(-3, 4, (n, n)), 0.0).astype(float)
    matrix[2] = 2.0 * matrix[0]
    right = matrix @ rng.integers(-3, 4, n)
    status, found, determinant, _ = solved(order, matrix, right)
    assert status == 0
    assert determinant < -1e299
    assert matrix @ found == pytest.approx(right, abs=1e-9)
    right[2] += 1.0
    assert solved(order, matrix, right)[0] == 1


@pytest.mark.parametrize("seed", range(40))
def test_what_is_open_is_shared_as_compliances_would(seed: int) -> None:
    """Locked elements hold the same motions: of all torques that do, the smallest by their squares."""
    rng = np.random.default_rng(seed)
    motions, locked = int(rng.integers(2, 10)), int(rng.integers(2, 30))
    ratios = rng.choice([-1, 1], (locked, motions)) * 10 ** rng.uniform(-0.5, 0.5, (locked, motions))
    ratios = np.where(rng.random((locked, motions)) < 0.5, ratios, 0.0)
    ratios[np.arange(locked), rng.integers(0, motions, locked)] = 1.0
    inertias = 10 ** rng.uniform(-1, 1, motions)
    matrix = np.block([[np.diag(inertias), ratios.T], [ratios, -1e-25 * np.eye(locked)]])
    torque = rng.normal(size=motions)
    rows, columns = rng.permutation(motions + locked), rng.permutation(motions + locked)
    mixed = matrix[rows][:, columns]
    status, found, _, _ = solved(
        elimination_order(len(mixed), np.flatnonzero(mixed)), mixed, np.concatenate([torque, np.zeros(locked)])[rows]
    )
    assert status == 0
    x = np.empty(motions + locked)
    x[columns] = found
    _, sizes, back = np.linalg.svd(ratios)
    free = back[int((sizes > 1e-12 * sizes[0]).sum()) :].T  # how they can still move
    acceleration = free @ np.linalg.solve(free.T @ (inertias[:, None] * free), free.T @ torque)
    assert x[:motions] == pytest.approx(acceleration, abs=1e-9)
    least = np.linalg.lstsq(ratios.T, torque - inertias * acceleration, rcond=1e-12)[0]
    assert x[motions:] == pytest.approx(least, rel=1e-6, abs=1e-6 * np.abs(least).max())


def test_factors_of_a_star_grow_with_its_branches() -> None:
    """Whichever of its equations each branch is solved by: modes chosen at random."""
    rng, fills = np.random.default_rng(1), []
    for n in (20, 200):
        size, i = 2 * n + 1, np.arange(n)
        mask = np.zeros((size, size), bool)
        mask[2 * i, 2 * i] = mask[2 * i, 2 * i + 1] = mask[2 * i + 1, 2 * i] = mask[2 * i + 1, 2 * i + 1] = True
        mask[2 * i + 1, -1] = mask[-1, 2 * i] = mask[-1, -1] = True
        order = elimination_order(size, np.flatnonzero(mask))
        most = 0.0
        for _ in range(5):
            matrix = np.where(mask, rng.normal(size=(size, size)), 0.0)
            stuck = rng.random(n) < 0.5
            matrix[2 * i[stuck], 2 * i[stuck]] = 0.0
            matrix[2 * i[~stuck] + 1, 2 * i[~stuck] + 1] = 1e-25
            right = rng.normal(size=size)
            status, found, _, fill = solved(order, matrix, right)
            assert status == 0
            assert matrix @ found == pytest.approx(right, abs=1e-8)
            most = max(most, fill)
        fills.append(most)
    assert fills[1] < 15 * fills[0]


def test_room_for_factors() -> None:
    """A full triangle while that is small, else some times the fill of the planned order; and all of it behind the right-hand side."""
    for n in (1, 3, 20, 141, 142, 400):
        full = elimination_order(n, np.arange(n * n))
        assert room(full) >= min(n * (n + 1) // 2, 10_000)
        band = elimination_order(n, np.flatnonzero(np.abs(np.subtract.outer(np.arange(n), np.arange(n))) <= 1))
        assert room(band) == max(6 * band.fill, min(n * (n + 1) // 2, 10_000))
        assert factors_size(band) == 4 + 13 * n + 4 * room(band)
        array = pattern_array(band)
        assert array[:2].tolist() == [n, room(band)]
        assert sorted(array[2 : 2 + n].tolist()) == sorted(array[2 + n : 2 + 2 * n].tolist()) == list(range(n))
        assert array[2 + n : 2 + 2 * n][band.rows].tolist() == list(range(n))
