"""The work by which IDA is compared with other methods; what it does where an error test fails again and again."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.errors import ArgumentError, SolverError, StartError
from gearlib.solvers.drive.drive_loop import RHS_FAILED, ROOTS_FAILED
from gearlib.solvers.drive.driver import integrate
from gearlib.solvers.ida.ida import ida
from gearlib.solvers.ida.ida_stepper import (
    EPS,
    ERROR_TEST,
    FINEST,
    NEWTON,
    NEWTON_TIGHT,
    OPERATION,
    STALLED,
    START,
    START_FAILED,
    TRIAL,
    trial,
    work,
)
from gearlib.solvers.ida.native_backend import NativeIda
from tests.run.python_problem import driver
from tests.run.python_problem import problem as python_problem
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
    assert not stepper.recovers(ERROR_TEST)  # it has its full tolerance already
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


@pytest.mark.parametrize("native", [True, False])
def test_statistics_of_a_run(native: bool) -> None:
    """A restart for each event that changes something; one road does not know steps and orders."""
    for jumps in range(3):

        def update(t: float, x: Any, fired: Any, data: Any) -> int:
            return 1 if t > 0.0 else 0

        own = python_problem(
            lambda t, x, dx, data: dx.__setitem__(0, -x[0]), [1.0], update=update, time_events=0.25 * np.arange(1, jumps + 1)
        )
        run = driver(own, [0.0, 1.0], ida(native), rtol=1e-4)
        found, record = integrate(run).stats, run.record
        known = (record.done, record.attempts - record.done) if native else (None, None)  # type: ignore[attr-defined]
        assert (found["steps"], found["rejected"]) == known
        assert found["order"] in (range(1, 6) if native else [None])
        assert (found["method"], found["restarts"], found["jac"], found["linear_solver"]) == ("ida", jumps, 0, "dense")
        assert (found["rhs"], found["attempts"]) == (record.n_rhs, record.attempts)  # type: ignore[attr-defined]
        assert found["attempts"] > 10 * (1 + jumps)


def test_work_in_nanoseconds() -> None:
    """1100 for each step, 60 for each state, and two looks at the event functions; 800 and four looks for a restart."""
    p = problem(van_der_pol, [2.0, 0.0])
    for watched, look in ((p, 0.0), (replace(p, roots=p.rhs, roots_cost=7.0), 7.0)):
        assert work(watched, (0.0, 0.0), 10, 0, 0, 0) == pytest.approx(10 * (1100.0 + 120.0 + 2.0 * look))
        assert work(watched, (0.0, 0.0), 0, 0, 0, 10) == pytest.approx(10 * (800.0 + p.update_cost + 4.0 * look))
        start, steps = trial(watched)
        assert start == START
        assert steps == pytest.approx(TRIAL * (1100.0 + 120.0 + 2.0 * look + 1.3 * p.rhs_cost))


def test_roots_are_located_to_a_hundred_units_of_rounding() -> None:
    """Of the run's own clock, which begins at its start if that is late; a run that goes on has a later end."""
    own = python_problem(lambda t, x, dx, data: dx.__setitem__(0, 1.0), [0.0])
    for begin, end, farthest in ((0.0, 2.0, 2.0), (-1.5, 0.5, 1.5), (100.0, 102.0, 2.0), (-102.0, -100.0, 2.0)):
        run = driver(own, [begin, end], ida(), rtol=1e-4)
        assert run.record.slack == pytest.approx(200.0 * EPS * farthest, rel=1e-12)
        run.stepper.until(end + 3.0, math.inf)
        assert run.record.slack == pytest.approx(200.0 * EPS * abs(end + 3.0 - run.record.origin), rel=1e-12)
        run.close()


def test_tolerances_are_a_fiftieth_and_the_finest_ones_are_met_by_more_exact_iterations() -> None:
    own = python_problem(lambda t, x, dx, data: None, [0.0, 1.0])
    for rtol, passed, newton in (
        (1e-3, 2e-5, NEWTON),
        (5.1e-11, 1.02e-12, NEWTON),
        (4.9e-11, 9.8e-13, NEWTON_TIGHT),
        (1e-14, FINEST, NEWTON_TIGHT),
    ):
        stepper = ida()
        run = driver(own, [0.0, 1.0], stepper, rtol=rtol, atol=[1e-3, 1e-5])
        assert (stepper.rtol, stepper.newton) == (pytest.approx(passed, rel=1e-12), newton)
        assert stepper.atol == pytest.approx([2e-5, 2e-7])
        run.close()


TEXTS = {
    STALLED: "the step size became too small at t=0 (h=0): time does not move any more",
    ROOTS_FAILED: "the event functions could not be evaluated at t=0",
    -2: "the tolerances are too small for double precision at t=0",
    -3: "the step size became too small at t=0 (h=0): the error test fails again and again",
    -4: "the step size became too small at t=0 (h=0): Newton's iteration does not converge",
    -6: "the Jacobian could not be evaluated or factorised at t=0",
    -7: "the linear equations of a step could not be solved at t=0",
    -22: "an absolute tolerance is too small to divide by, or times lie too close together, at t=0",
    -10: "the event functions could not be evaluated at t=0",
    -5: "IDA failed at t=0 (its return value: -5)",
    RHS_FAILED: "the right-hand side could not be evaluated at t=0; integrated until t=0",
    -8: "the right-hand side could not be evaluated at t=0; integrated until t=0",
    -9: "the right-hand side could not be evaluated at t=0; integrated until t=0",
    -12: "the right-hand side could not be evaluated at t=0; integrated until t=0",
}


@pytest.mark.parametrize("code", TEXTS)
def test_every_failure_has_its_words(code: int) -> None:
    """With what is to blame where steps become too small, or the equations cannot be evaluated."""
    stepper = ida()
    own = replace(
        python_problem(lambda t, x, dx, data: None, [0.0]),
        culprit=lambda t, x, data: "; because of the brake",
        state_names=("a.w",),
    )
    run = driver(own, [0.0, 1.0], stepper)
    run.record.bad_state = -1
    blamed = "; because of the brake" if code in (STALLED, -3, -4, RHS_FAILED, -8, -9, -12) else ""
    assert str(stepper.failure(code)) == TEXTS[code] + blamed
    assert stepper.leaves(code) == (code in (RHS_FAILED, -8, -9, -12))
    run.close()


@pytest.mark.parametrize("begin", [0.0, 100.0])
def test_steps_that_shrink_where_the_model_refused_are_its_fault(begin: float) -> None:
    """Up to a millionth of the run before; the message says where, and in which equation."""
    stepper = ida()
    own = replace(python_problem(lambda t, x, dx, data: None, [0.0, 0.0]), state_names=("a.w", "a.phi"))
    run = driver(own, begin + np.array([0.0, 2.0]), stepper)
    record: Any = run.record
    record.t = 1.5 if begin == 0.0 else 1.5 + begin - record.origin
    assert stepper.bad_time is None
    assert not any(stepper.leaves(code) for code in (-3, -4, STALLED, -6, -22))
    record.refused, record.bad_state = 3, 1
    for back, near in ((1.9e-6, True), (2.1e-6, False), (-0.1, True)):
        record.bad_time = record.t - back
        assert stepper.bad_time == pytest.approx(begin + 1.5 - back, abs=1e-9)
        assert [stepper.leaves(code) for code in (-3, -4, STALLED, -6, -22)] == [near] * 3 + [False] * 2
    said = f"der(a.phi) is not finite at t={begin + 1.6:.9g}; integrated until t={begin + 1.5:.9g}"
    assert str(stepper.failure(-4)) == said
    record.patience = 3
    assert stepper.leaves(-6)  # a Jacobian that was refused as often as it may
    run.close()


def test_a_start_without_consistent_values_names_the_worst_equation() -> None:
    """Of the algebraic unknowns only; after the start it is no error of the start values."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1], dx[2] = 50.0, x[1] - 3.0, x[2] + 7.0

    own = replace(python_problem(rhs, [0.0] * 3), differential=np.array([True, False, False]), state_names=("x", "y", "z"))
    stepper = ida()
    run = driver(own, [1.0, 9.0], stepper)
    for t, kind in ((1.0, StartError), (2.0, SolverError)):
        run.record.t = t - run.record.origin
        for code in (START_FAILED, -13, -14):
            found = stepper.failure(code)
            assert type(found) is kind
            assert str(found) == (
                f"no consistent values of the algebraic unknowns were found at t={t:.9g}; the residual of the equation of z is 7 at the "
                "values tried first; take form='ode', which solves for them in turn"
            )
    run.close()
