"""The work by which IDA is compared with other methods; what it does where an error test fails again and again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.errors import ArgumentError
from gearlib.solvers.ida.ida import ida
from gearlib.solvers.ida.ida_stepper import ERROR_TEST, OPERATION, work
from gearlib.solvers.ida.native_backend import NativeIda
from tests.run.python_problem import driver
from tests.solvers.ida.test_ida import linear
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


def test_operations_are_those_of_substitutions_and_factorisations() -> None:
    """One solution for each evaluation, one factorisation for each Jacobian."""
    p = problem(van_der_pol, [2.0, 0.0])
    least = work(p, (0.0, 0.0), **COUNTS)
    assert work(p, (50.0, 0.0), **COUNTS) - least == pytest.approx(50.0 * OPERATION * COUNTS["jac"])
    assert work(p, (0.0, 20.0), **COUNTS) - least == pytest.approx(20.0 * OPERATION * COUNTS["rhs"])


@pytest.mark.parametrize("kind", ["dense", "band"])
def test_the_state_that_fails_the_error_test_gets_its_whole_tolerance(kind: str) -> None:
    """One at a time, the one with the largest error; the run goes on, and to the same end."""
    rng, n = np.random.default_rng(3), 40
    chain = np.diag(np.full(n, -2.0)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    chain[0, :2] = 0.0  # a state that stays where it is
    order = rng.permutation(n)
    a, x0 = chain[np.ix_(order, order)], np.zeros(n)
    moved, still = int(np.flatnonzero(order == n - 1)[0]), int(np.flatnonzero(order == 0)[0])
    x0[moved] = 1.0
    stepper = ida(linear_solver=kind)
    assert isinstance(stepper, NativeIda)
    run = driver(linear(a, x0), [0.0, 0.5, 1.0], stepper, rtol=1e-8)
    assert not stepper.recovers(ERROR_TEST)  # before the first step
    run.advance(25)
    worst = stepper.worst_state()
    assert worst != still
    assert x0[worst] == 1.0 or (a[moved] @ np.eye(n)[worst]) != 0.0  # where it moves fastest
    before = stepper.atol.copy()
    assert not stepper.recovers(ERROR_TEST - 1)
    assert stepper.recovers(ERROR_TEST)
    assert np.flatnonzero(stepper.atol != before).tolist() == [worst]
    assert stepper.atol[worst] == stepper.full_atol[worst] == pytest.approx(50 * before[worst])
    assert run.advance(5) == "more"
    assert stepper.worst_state() not in (worst, still)
    while run.advance() == "more":
        pass
    for t, x in zip((0.0, 0.5, 1.0), run.solution().x, strict=True):
        assert x == pytest.approx(expm(t * a) @ x0, abs=2e-7)
    run.close()


def test_unknown_linear_solvers_are_refused() -> None:
    for native in (True, False):
        with pytest.raises(ArgumentError, match=r"^linear_solver must be 'dense', 'band', 'sparse' or None, not 'lu'$"):
            ida(native, "lu")
