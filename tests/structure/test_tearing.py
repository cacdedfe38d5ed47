"""Tearing of small blocks whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearlib.structure.tearing import tear


def test_a_chain_needs_no_tearing_variable():
    t = tear([{0: True}, {0: True, 1: True}, {1: True, 2: True}])
    assert (t.lead, t.tears, t.columns) == (3, (), (0, 1, 2))


def test_a_ring_of_five_is_torn_once():
    ring = [{i: True, (i + 1) % 5: True} for i in range(5)]
    t = tear(ring)
    assert t.lead == 4
    assert len(t.tears) == 1


def test_a_column_that_may_not_be_solved_for_is_torn():
    t = tear([{0: False, 1: True}, {0: True, 1: False}])
    assert t.lead == 1
    assert sorted(t.columns) == [0, 1]


@given(st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_the_leading_part_is_lower_triangular(n, seed):
    rng = np.random.default_rng(seed)
    rows = [{i: True} | {int(c): bool(rng.random() < 0.7) for c in rng.integers(0, n, 3)} for i in range(n)]
    t = tear(rows)
    assert sorted(t.rows) == sorted(t.columns) == list(range(n))
    place = {c: k for k, c in enumerate(t.columns)}
    for k, r in enumerate(t.rows[: t.lead]):
        assert rows[r][t.columns[k]]
        assert all(place[c] <= k or place[c] >= t.lead for c in rows[r])


def test_order_is_deterministic():
    rows = [{0: True, 1: True}, {1: True, 2: True}, {0: True, 2: True}]
    assert tear(rows) == tear(rows)
    with pytest.raises(AttributeError):
        tear(rows).lead = 2  # type: ignore[misc]


def test_the_work_grows_with_the_equations():
    """A star of thousands of loops that each need a tearing variable of their own."""
    n = 3000
    loops = [{2 * (i // 2): True, 2 * (i // 2) + 1: True, 2 * n: False} for i in range(2 * n)]
    t = tear([*loops, dict.fromkeys([*range(0, 2 * n, 2), 2 * n], True)])
    assert len(t.tears) == n
