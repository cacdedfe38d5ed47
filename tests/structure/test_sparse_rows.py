"""Elimination of sparse rows: what is left of a subtraction is zero by the sizes of the rows, or of the two numbers."""

from __future__ import annotations

import pytest

from gearlib.structure.sparse_rows import eliminate, holders_of, sizes_of


@pytest.mark.parametrize(("left", "kept"), [(1e-8, False), (1e-4, True)])
def test_what_is_left_is_measured_by_the_rows(left: float, kept: bool) -> None:
    """A row of size 1e6 is known to 1e-6, with a rounding of 1e-12."""
    rows = {0: {7: 1.0, 8: 1.0, 9: 1e6}, 1: {7: 1.0, 8: 1.0 + left}}
    holders = holders_of(rows)
    assert list(eliminate(rows, holders, 0, 7, {1}, sizes_of(rows), 1e-12)) == [(1, 1.0)]
    assert set(rows[1]) == ({8, 9} if kept else {9})
    assert holders[8] == ({0, 1} if kept else {0})


@pytest.mark.parametrize(("left", "kept"), [(1e-14, False), (1e-8, True)])
def test_without_sizes_it_is_measured_by_the_two_numbers(left: float, kept: bool) -> None:
    rows = {0: {7: 1.0, 8: 1.0, 9: 1e6}, 1: {7: 1.0, 8: 1.0 + left}}
    holders = holders_of(rows)
    assert list(eliminate(rows, holders, 0, 7, {1}, None, 1e-12)) == [(1, 1.0)]
    assert set(rows[1]) == ({8, 9} if kept else {9})
    assert holders[8] == ({0, 1} if kept else {0})
