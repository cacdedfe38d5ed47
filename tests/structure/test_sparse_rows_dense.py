"""A step of elimination, against the same on a dense matrix."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.structure.sparse_rows import eliminate, holders_of, sizes_of


@pytest.mark.parametrize("seed", range(8))
def test_multiples_of_a_row_are_subtracted_from_those_that_are_named(seed: int) -> None:
    """From these only, in order; and the rows that hold each column are known before and after."""
    rng = np.random.default_rng(seed)
    matrix = rng.integers(-3, 4, (6, 7)) * (rng.random((6, 7)) < 0.7) * 1.0
    matrix[2, 3] = -2.0
    rows = {r: {c: float(a) for c, a in enumerate(row) if a} for r, row in enumerate(matrix)}
    holders, sizes = holders_of(rows), sizes_of(rows)
    assert holders == {c: set(np.flatnonzero(column).tolist()) for c, column in enumerate(matrix.T) if column.any()}
    assert sizes == {r: max(abs(a) for a in row) or 1.0 for r, row in enumerate(matrix.tolist())}
    among = {0, 5, 4, 1}
    steps = list(eliminate(rows, holders, 2, 3, among, sizes if seed % 2 else None, 1e-12))
    factors = matrix[:, 3] / -2.0
    assert steps == [(r, factors[r]) for r in sorted(among) if factors[r]]
    for r in among:
        matrix[r] -= factors[r] * matrix[2]
    assert rows == {r: {c: pytest.approx(a) for c, a in enumerate(row) if a} for r, row in enumerate(matrix.tolist())}
    assert {c: rs for c, rs in holders.items() if rs} == {c: rs for c, rs in holders_of(rows).items() if rs}


def test_an_empty_row_has_size_one() -> None:
    assert sizes_of({"a": {}, "b": {1: -3.0, 2: 2.0}}) == {"a": 1.0, "b": 3.0}


@pytest.mark.parametrize(
    ("factor", "size", "left", "kept"),
    [
        (1e3, 1.0, 2e-9, True), (1e3, 1.0, 0.5e-9, False),  # the pivot row, multiplied, is the larger one
        (-1e3, 1.0, 2e-9, True), (-1e3, 1.0, 0.5e-9, False),
        (1e-3, 50.0, 2e-15, False), (1e-3, 50.0, 1e-10, True), (1e-3, 50.0, 4e-11, False),  # the other one is
    ],
)  # fmt: skip
def test_what_is_left_is_zero_below_the_rounding_of_the_larger_row(factor: float, size: float, left: float, kept: bool) -> None:
    """Rounding is 1e-12 of the magnitude of the row, or of the pivot's times the factor."""
    rows = {0: {7: 1.0, 8: 1.0}, 1: {7: factor, 8: factor + left}}
    holders = holders_of(rows)
    list(eliminate(rows, holders, 0, 7, {1}, {0: 1.0, 1: size}, 1e-12))
    assert set(rows[1]) == ({8} if kept else set())
    assert holders[8] == ({0, 1} if kept else {0})


@pytest.mark.parametrize(("old", "kept"), [(1.0 + 1e-13, False), (1.0 + 1e-11, True), (0.0, True)])
def test_without_sizes_the_larger_number_decides(old: float, kept: bool) -> None:
    rows = {0: {7: 2.0, 8: 2.0}, 1: {7: 1.0, **({8: old} if old else {})}}
    holders = holders_of(rows)
    list(eliminate(rows, holders, 0, 7, {1}, None, 1e-12))
    assert set(rows[1]) == ({8} if kept else set())
    assert holders[8] == ({0, 1} if kept else {0})


def test_what_cancels_exactly_is_gone_without_any_rounding() -> None:
    rows = {0: {7: 2.0, 8: 3.0}, 1: {7: 2.0, 8: 3.0, 9: 1.0}}
    holders = holders_of(rows)
    assert list(eliminate(rows, holders, 0, 7, {1})) == [(1, 1.0)]
    assert rows[1] == {9: 1.0}
    assert holders[8] == {0}


@pytest.mark.parametrize("size", [1e-6, 1e6])
@pytest.mark.parametrize(("left", "kept"), [(1e-13, False), (1e-11, True)])
def test_without_sizes_rounding_grows_with_the_numbers(size: float, left: float, kept: bool) -> None:
    rows = {0: {7: 1.0, 8: size}, 1: {7: 1.0, 8: size * (1 + left)}}
    list(eliminate(rows, holders_of(rows), 0, 7, {1}, None, 1e-12))
    assert set(rows[1]) == ({8} if kept else set())
