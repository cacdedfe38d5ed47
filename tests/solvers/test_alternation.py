"""The choice between two methods by counted work, with methods that are nothing but a pace."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearlib.errors import SolverError
from gearlib.solvers.alternation import Leg, alternate
from gearlib.solvers.drive.driver import Driver, Stepper
from gearlib.solvers.ida.ida import ida
from gearlib.solvers.ida.ida_stepper import trial
from gearlib.solvers.problem import Problem, Solution
from gearlib.solvers.rungekutta.rungekutta import RungeKutta
from tests.run.python_problem import driver
from tests.solvers.rungekutta.test_rungekutta import problem, van_der_pol

STEP = 1000.0  # work of a step of either method
START = 50 * STEP  # of the second method
TRIAL = 150 * STEP
Pace = Callable[[float], float]


class Method:
    """Gets on by ``pace(t)`` seconds for each unit of work, after a start that takes some steps of no length."""

    def __init__(self, book: Book, pace: Pace, t: float, slow_start: int = 0, fails_at: float = np.inf) -> None:
        self.book, self._pace, self.t, self.work, self.status = book, pace, t, 0.0, "more"
        self.slow_start, self.fails_at, self.steps, self.first_look = slow_start, fails_at, 0, np.inf
        self.damped = False

    @property
    def pace(self) -> float:
        return self._pace(self.t)

    def watch(self, work_first: float = 0.0) -> None:
        self.first_look, self.status = self.work + work_first, "more"

    def advance(self, steps: int = 1000) -> str:
        for _ in range(0, steps, 5):  # at once
            self.steps += 5
            self.work += 5 * STEP
            self.book.work += 5 * STEP
            if self.steps > self.slow_start:
                self.t += 5 * STEP * self._pace(self.t)
            if self.t >= self.fails_at:
                raise SolverError("failed")
            if self.t >= self.book.end:
                self.status = "done"
                break
            if self.work >= self.first_look + 15 * STEP:
                self.status = "stiff"
                break
        return self.status

    def solution(self) -> Solution:
        none = np.empty(0)
        return Solution(none, none, none, self.status, self.t, none, none, none, np.empty(0, np.int64), {})

    def close(self) -> None:
        self.book.closed += 1


class Book:
    """What two methods do together."""

    def __init__(
        self, explicit: Pace, implicit: Pace, end: float = 1.0, slow_start: int = 50, fails_at: float = np.inf
    ) -> None:
        self.work, self.closed, self.trials, self.end = 0.0, 0, 0, end
        self.paces = explicit, implicit
        self.slow_start, self.fails_at = slow_start, fails_at

    def run(self) -> list[Leg]:
        def first(legs: Sequence[Leg]) -> Any:
            method = Method(self, self.paces[0], legs[-1].solution.t_last if legs else 0.0)
            return method, method

        def second(legs: Sequence[Leg]) -> Any:
            self.trials += 1
            self.work += START
            return Method(self, self.paces[1], legs[-1].solution.t_last, self.slow_start, self.fails_at)

        return alternate(first, second, lambda: (START, TRIAL - START), self.end)

    def alone(self, which: int) -> float:
        """The work of one method from the beginning to the end."""
        other = Book(*self.paces, end=self.end)
        method = Method(other, self.paces[which], 0.0, which * self.slow_start)
        while method.advance() == "more":
            pass
        return other.work


@given(exponent=st.floats(-1.5, 1.5), long=st.floats(1.0, 2.5))
@settings(max_examples=20, deadline=None)
def test_costs_little_more_than_the_better_one(exponent: float, long: float) -> None:
    """Whatever the ratio of the paces, and however long the run is against a trial."""
    pace = 1.0 / (10**long * TRIAL)
    book = Book(lambda t: pace, lambda t: pace * 10**exponent)
    legs = book.run()
    assert legs[-1].solution.t_last >= 1.0
    assert book.work <= 1.3 * min(book.alone(0), book.alone(1)) + 10 * TRIAL
    assert book.closed == book.trials


@given(turns=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=6))
@settings(max_examples=20, deadline=None)
def test_hands_over_and_back_where_the_paces_change(turns: list[float]) -> None:
    pace = 1.0 / (600 * TRIAL)
    book = Book(lambda t: pace, lambda t: pace * 10 ** turns[min(int(t * len(turns)), len(turns) - 1)])
    book.run()
    assert book.work <= 1.3 * min(book.alone(0), book.alone(1)) + 10 * TRIAL


def test_where_each_is_the_better_one_for_a_time_both_are_used() -> None:
    pace = 1.0 / (600 * TRIAL)
    book = Book(lambda t: pace, lambda t: pace * (10.0 if 0.3 < t < 0.6 else 0.1))
    legs = book.run()
    assert book.work < 0.9 * min(book.alone(0), book.alone(1))
    assert legs[-1].method == "explicit"
    assert any(leg.method == "implicit" and leg.stayed for leg in legs)


def test_a_method_far_behind_is_given_up_early() -> None:
    """Starting it counts in what a trial costs, but not in what it may spend on steps."""
    pace = 1.0 / (12 * TRIAL)
    legs = Book(lambda t: pace, lambda t: 0.1 * pace).run()
    assert all(leg.run.work <= 100 * STEP + 45 * STEP for leg in legs if leg.method == "implicit")


def test_a_method_that_comes_close_is_given_more_time() -> None:
    """Where it gets faster just after the first measurements, one trial suffices."""
    pace = 1.0 / (12 * TRIAL)
    book = Book(lambda t: pace, lambda t: pace * (0.7 if t < 0.06 else 3.0))
    book.run()
    assert book.trials == 1


def test_a_short_rest_is_not_worth_a_trial() -> None:
    pace = 1.0 / (3 * TRIAL)
    book = Book(lambda t: pace, lambda t: 100 * pace)
    assert [leg.method for leg in book.run()] == ["explicit"]
    assert book.trials == 0


def test_legs_follow_each_other_in_time() -> None:
    pace = 1.0 / (600 * TRIAL)
    legs = Book(lambda t: pace, lambda t: pace * (3.0 if int(10 * t) % 2 else 0.3)).run()
    times = [leg.solution.t_last for leg in legs]
    assert len(legs) > 3
    assert times == sorted(times)
    assert all(a.method != b.method for a, b in zip(legs, legs[1:], strict=False))


def test_a_method_that_fails_on_trial_is_given_up() -> None:
    pace = 1.0 / (300 * TRIAL)
    book = Book(lambda t: pace, lambda t: pace / 10, fails_at=0.0)
    assert [leg.method for leg in book.run()] == ["explicit"]
    assert 1 <= book.trials < 10
    assert book.closed == book.trials


def test_a_method_that_fails_when_it_was_chosen_is_an_error() -> None:
    pace = 1.0 / (300 * TRIAL)
    with pytest.raises(SolverError, match="failed"):
        Book(lambda t: pace, lambda t: pace * 10, fails_at=0.5).run()


# ---------------------------------------------------------------- Runge-Kutta and IDA


def legs_of(p: Problem, t_end: float, rtol: float, order: int) -> list[Leg]:
    """Legs of a run whose problem has no memory but its states."""

    def begin(legs: Sequence[Leg], stepper: Stepper) -> Driver:
        if not legs:
            return driver(p, [0.0, t_end], stepper, rtol=rtol)
        last = legs[-1].solution
        return driver(replace(p, x0=last.x_last), [last.t_last, t_end], stepper, rtol=rtol)

    def explicit(legs: Sequence[Leg]) -> tuple[Driver, RungeKutta]:
        stepper = RungeKutta(order)
        return begin(legs, stepper), stepper

    def implicit(legs: Sequence[Leg]) -> Driver:
        return begin(legs, ida())

    return alternate(explicit, implicit, lambda: trial(p), t_end)


@pytest.mark.parametrize("order", [5, 8])
def test_stiff_problems_go_to_ida(order: int) -> None:
    legs = legs_of(problem(van_der_pol, [2.0, 0.0]), 500.0, 1e-4, order)
    assert [leg.method for leg in legs] == ["explicit", "implicit"]
    assert legs[0].solution.stats["steps"] < 200


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("rtol", [1e-4, 1e-7])
@pytest.mark.parametrize("zeta", [0.02, 0.2])
def test_vibrations_stay_with_runge_kutta(order: int, rtol: float, zeta: float) -> None:
    """Frequencies in the ratio 30, the fast one soon at rest: what limits the steps is no decay, and IDA must follow the slow one."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = x[1], -x[0] - 0.02 * x[1]
        dx[2], dx[3] = x[3], -900.0 * x[2] - 60.0 * zeta * x[3] + 1e-3 * x[0]

    p = problem(rhs, [1.0, 0.0, 0.0, 1.0], nominal=np.array([1.0, 1.0, 1.0 / 30.0, 1.0]))
    legs = legs_of(p, 150.0, rtol, order)
    assert legs[-1].method == "explicit"
    assert sum(leg.method == "implicit" for leg in legs) <= 1


@pytest.mark.parametrize(("alive", "method"), [(1.0, "explicit"), (0.0, "implicit")])
def test_ida_once_nothing_fast_is_alive(alive: float, method: str) -> None:
    """A fast vibration that soon dies away limits the steps; a slower one may stay, and every method must follow it."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = x[1], -900.0 * x[0]
        dx[2], dx[3] = x[3], -1e6 * x[2] - 600.0 * x[3]

    p = problem(rhs, [alive, 0.0, 1e-3, 0.0], nominal=np.array([1.0, 30.0, 1e-3, 1.0]))
    assert legs_of(p, 30.0, 1e-8, 8)[-1].method == method
