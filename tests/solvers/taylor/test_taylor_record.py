"""What the Taylor method writes into a run's record: orders, longest step, costs, and where the work space holds differences."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.native.series_source import HIGHEST, ROW
from gearlib.solvers.drive import drive_loop
from gearlib.solvers.drive.driver import PATIENCE, Driver
from gearlib.solvers.rungekutta.first_step import DAMPED
from gearlib.solvers.taylor import taylor_loop
from gearlib.solvers.taylor.taylor import COEFFICIENT, OPERATION, STEP, TERM, Taylor
from tests.run.python_problem import driver, problem


def run_of(n: int = 5, begin: float = 3.0, asked: Any = None, **more: Any) -> tuple[Driver, Any]:
    flags = {name: more.pop(name, False) for name in ("guarded", "pulses", "branches", "hides")}
    numbers = {name: more.pop(name, value) for name, value in (("rows", 9), ("sums", 7), ("products", 4), ("compared", 2))}
    series: Any = SimpleNamespace(address=123, **numbers, **flags)
    own = problem(lambda *_: 0, [0.0] * n, nominal=np.arange(1.0, n + 1.0), rhs_cost=70.0, **more)
    run = driver(own, begin + np.array([0.0, 0.5, 4.0]), Taylor(series), rtol=1e-3, **(asked or {}))
    return run, run.record


def test_orders_are_limited_where_events_or_branches_are_looked_for() -> None:
    watched: dict[str, Any] = {"roots": lambda *_: 0, "n_roots": 1}
    for more, highest in (({}, HIGHEST), ({"branches": True}, taylor_loop.SEARCHED), (watched, taylor_loop.SEARCHED)):
        _, record = run_of(**more)
        assert (record.highest, record.next_order) == (highest, min(taylor_loop.FIRST, highest))


def test_the_longest_step_is_that_of_series_unless_there_are_pulses() -> None:
    for more, longest in (
        ({}, 4.0), ({"longest_step": 0.3}, 4.0), ({"longest_expanded_step": 0.2}, 0.2),
        ({"longest_step": 0.3, "longest_expanded_step": 0.2, "pulses": True}, 0.3), ({"longest_step": 9.0, "pulses": True}, 4.0),
    ):  # fmt: skip
        run, record = run_of(**more)
        assert record.h_max == longest
        run.stepper.until(9.0, 0.01)
        assert record.h_max == 0.01


@pytest.mark.parametrize("hides", [False, True])
def test_numbers_of_a_run(hides: bool) -> None:
    _, record = run_of(hides=hides, guarded=not hides, asked={"may_leave": hides})
    assert (record.size, record.rtol, record.span, record.series, record.guarded) == (8, 1e-3, 4.0, 123, int(not hides))
    assert (record.patience, record.rates) == (PATIENCE if hides else -1, record.k)
    assert (record.slack, record.slack_share) == (pytest.approx(4e-16, rel=1e-12), taylor_loop.LOCATED)
    assert (record.looks, record.compared, record.compared_at) == (int(hides), 2, (9 - 2) * ROW)
    atol = np.ctypeslib.as_array((np.ctypeslib.ctypes.c_double * 8).from_address(record.atol)).tolist()
    assert atol == pytest.approx([1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 1.0, 1.0, 1.0])
    assert record.cost_order == pytest.approx(7 * OPERATION + 8 * COEFFICIENT + (70.0 if hides else 0.0))
    assert record.cost_product == pytest.approx(0.5 * 4 * TERM + (8 * COEFFICIENT if hides else 0.0))
    assert record.cost_step == pytest.approx(STEP + 70.0 + 8 * COEFFICIENT)


def test_room_for_coefficients() -> None:
    """A row for each order from zero on; the work space of a series without any is not empty."""
    for rows, work in ((9, 9 * ROW), (0, ROW), (1, ROW)):
        own = Taylor(SimpleNamespace(rows=rows))  # type: ignore[arg-type]
        found = own.memory(12, 3)
        series = 12 * (HIGHEST + 1)
        assert found == {
            "x_new": 12, "y": 12, "k": 24, "c": series, "ahead": series, "g": 21, "side": 3, "atol": 12, "within": 12,
            "rates_within": 12, "work": work, "norms": HIGHEST + 1, "weights": 12,
        }  # fmt: skip


def test_a_decay_is_told_from_a_vibration_and_failures_have_their_words() -> None:
    run, record = run_of(begin=0.0)
    stepper: Any = run.stepper
    for cosine, damped in ((-1.01 * DAMPED, True), (-0.99 * DAMPED, False), (0.9, False)):
        record.cosine = cosine
        assert stepper.damped == damped
    codes = (taylor_loop.UNDERFLOW, taylor_loop.NOT_FINITE, *drive_loop.EVALUATED)
    assert all(stepper.leaves(code) for code in codes)
    assert not stepper.leaves(-99)
    assert stepper.pace == 0.0
    record.t, record.steps = 0.5, 30
    where = "at t = 0.5 s after 30 steps"
    told = f"the Taylor coefficients are not finite {where}: a root of zero, or a pole; use method='rk'"
    assert str(stepper.failure(taylor_loop.NOT_FINITE)) == told
    assert str(stepper.failure(drive_loop.RHS_FAILED)) == f"the right-hand side cannot be evaluated {where}"
    assert str(stepper.failure(taylor_loop.UNDERFLOW)).startswith(f"the step became too small {where}")
    stepper.watch(1e30)
    assert record.detect_from == 30 + 10**12
    assert math.isfinite(stepper.work)
