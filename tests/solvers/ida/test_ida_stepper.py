"""The work by which IDA is compared with other methods."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gearlib.solvers.ida.ida_stepper import work
from tests.solvers.rungekutta.test_rungekutta import problem, van_der_pol

OPERATIONS = 50.0, 20.0
COUNTS = {"steps": 10, "rhs": 20, "jac": 3, "restarts": 2}


@pytest.mark.parametrize("count", COUNTS)
def test_every_count_takes_work_in_proportion(count: str) -> None:
    p = problem(van_der_pol, [2.0, 0.0])
    none = dict.fromkeys(COUNTS, 0)
    one = work(p, OPERATIONS, **{**none, count: 1})
    assert work(p, OPERATIONS, **none) == 0.0
    assert one > 0.0
    assert work(p, OPERATIONS, **{**none, count: 7}) == pytest.approx(7 * one)


@pytest.mark.parametrize(("function", "count"), [("rhs", "rhs"), ("jac", "jac"), ("update", "restarts")])
def test_a_dearer_function_takes_more_work_by_its_own_cost(function: str, count: str) -> None:
    """And by nothing else: a nanosecond more for each call."""
    p = problem(van_der_pol, [2.0, 0.0])
    cost = f"{function}_cost"
    dearer = replace(p, **{cost: getattr(p, cost) + 1.0})
    assert work(dearer, OPERATIONS, **COUNTS) - work(p, OPERATIONS, **COUNTS) == pytest.approx(COUNTS[count], rel=1e-6)
