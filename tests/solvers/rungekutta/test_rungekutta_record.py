"""What explicit methods write into a run's record: tolerances, longest and first steps, patience, how near an event is on time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gearlib.solvers.drive import drive_loop
from gearlib.solvers.drive.driver import PATIENCE
from gearlib.solvers.rungekutta import loop
from gearlib.solvers.rungekutta.first_step import DAMPED
from gearlib.solvers.rungekutta.rungekutta import RungeKutta, work
from tests.run.python_problem import driver, problem


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize(("longest", "h_max"), [(math.inf, 0.4), (0.3, 0.3), (0.5, 0.4)])
def test_numbers_of_a_run(order: int, longest: float, h_max: float) -> None:
    own = problem(lambda *_: 0, [0.0] * 5, nominal=np.arange(1.0, 6.0), longest_step=longest)
    for first, may_leave in ((None, False), (0.125, True)):
        stepper = RungeKutta(order, first)
        run = driver(own, [3.0, 3.5, 7.0], stepper, rtol=1e-3, may_leave=may_leave)
        record: Any = run.record
        assert (record.order, record.size, record.rtol, record.span) == (order, 8, 1e-3, 4.0)
        assert (record.h_max, record.h) == (pytest.approx(h_max), first or 0.0)
        assert record.patience == (PATIENCE if may_leave else -1)
        assert (record.slack, record.slack_share) == (pytest.approx(4e-16, rel=1e-12), loop.LOCATED)
        assert record.rates == record.k
        atol = (np.ctypeslib.as_array((np.ctypeslib.ctypes.c_double * 8).from_address(record.atol))).tolist()
        assert atol == pytest.approx([1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 1.0, 1.0, 1.0])
        stepper.until(9.0, 0.01)
        assert record.h_max == 0.01
        assert stepper.wanted == record.h


def test_stages_polynomials_and_events_have_their_room() -> None:
    for order, stages, polynomials in ((5, 7, 4), (8, 16, 7)):
        found = RungeKutta(order).memory(12, 3)
        assert found == {
            "x_new": 12, "y": 12, "k": 12 * stages, "c": 12 * polynomials, "phases": 16, "g": 21, "side": 3, "atol": 12,
        }  # fmt: skip


def test_work_of_steps_and_events_in_nanoseconds() -> None:
    """Six right-hand sides, 150 ns and 5 for each state; for order 8 twice as many, 250 and 10; two looks at event functions."""
    own = problem(lambda *_: 0, [0.0] * 3, roots=lambda *_: 0, n_roots=1, rhs_cost=70.0, roots_cost=11.0, update_cost=13.0)
    assert work(own, 5, 10, 0) == pytest.approx(10 * (6 * 70.0 + 150.0 + 15.0 + 22.0))
    assert work(own, 8, 10, 0) == pytest.approx(10 * (12 * 70.0 + 250.0 + 30.0 + 22.0))
    assert work(own, 5, 0, 10) == pytest.approx(10 * (70.0 + 13.0 + 110.0))


@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_what_limits_the_steps_is_a_decay_within_45_degrees(size: float) -> None:
    run = driver(problem(lambda *_: 0, [0.0]), [0.0, 1.0], RungeKutta())
    record: Any = run.record
    for cosine, damped in ((-1.01 * DAMPED, True), (-0.99 * DAMPED, False), (0.99, False)):
        record.slopes, record.moves, record.products = 4.0 * size, 9.0 * size, cosine * 6.0 * size
        assert run.stepper.damped == damped  # type: ignore[attr-defined]


def test_pace_and_watch() -> None:
    """Seconds for each nanosecond since stability has limited the steps; watched after so many steps more."""
    own = problem(lambda *_: 0, [0.0])
    run = driver(own, [0.0, 1.0], RungeKutta())
    stepper, record = run.stepper, run.record
    r: Any = record
    assert stepper.pace == 0.0  # type: ignore[attr-defined]
    r.t, r.stiff_t, r.steps, r.stiff_first, r.events, r.stiff_events = 0.75, 0.5, 30, 10, 7, 4
    assert stepper.pace == pytest.approx(0.25 / work(own, 5, 20, 3))  # type: ignore[attr-defined]
    assert stepper.work == pytest.approx(work(own, 5, 30, 7))
    r.stiff_steps, r.calm_steps = 3, 2
    stepper.watch(2.5 * work(own, 5, 1, 0))  # type: ignore[attr-defined]
    assert (r.detect, r.detect_from, r.stiff_steps, r.calm_steps) == (1, 33, 0, 0)
    stepper.watch(1e30)  # type: ignore[attr-defined]
    assert r.detect_from == 30 + 10**12
    r.rejected, r.evaluations = 4, 99
    assert stepper.stats() == {"method": "rk5", "order": 5, "steps": 26, "rejected": 4, "rhs": 99}


def test_failures_of_explicit_methods() -> None:
    run = driver(problem(lambda *_: 0, [0.0]), [0.0, 1.0], RungeKutta())
    stepper, r = run.stepper, run.record
    assert [stepper.leaves(code) for code in (loop.UNDERFLOW, *drive_loop.EVALUATED, -99)] == [True] * (
        1 + len(drive_loop.EVALUATED)
    ) + [False]
    r.t, r.steps, r.rejected, r.h = 0.5, 30, 4, 0.0123  # type: ignore[attr-defined]
    where = "at t = 0.5 s after 30 steps (4 rejected, the next of 0.01 s)"
    assert str(stepper.failure(loop.UNDERFLOW)).startswith(f"the step became too small {where}: the solution goes to infinity")
    assert str(stepper.failure(drive_loop.RHS_FAILED)) == f"the right-hand side cannot be evaluated {where}"
