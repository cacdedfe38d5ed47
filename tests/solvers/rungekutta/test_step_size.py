"""Step-size control of the Runge-Kutta methods against the same written out for vectors: errors, stability, phases between events."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from gearlib.solvers.problem import Floats
from gearlib.solvers.rungekutta.first_step import DAMPED, FADE, NEAR5, NEAR8, STIFF5, STIFF8
from gearlib.solvers.rungekutta.loop import CALM, SURE
from gearlib.solvers.rungekutta.rungekutta import RungeKutta
from gearlib.solvers.rungekutta.stages import DIP, KINK
from gearlib.solvers.rungekutta.step_size import PHASES
from gearlib.solvers.rungekutta.tableaux import DOP853_A, DOP853_C, DOP853_E, TSIT5_A, TSIT5_C, TSIT5_E
from tests.run.python_problem import driver, problem
from tests.solvers.lanes.test_lane_loop import KINDS, Rates


@dataclass
class Alone:
    """A run with time events, after each of which the numbers from the second one on are others."""

    order: int
    f: Rates
    x: Floats
    rtol: float
    end: float
    rate: float
    first: float
    longest: float = math.inf
    events: Sequence[tuple[float, tuple[float, ...]]] = ()
    fails: Sequence[int] = ()  # numbers of the stages that cannot be evaluated
    looked: int = 0
    t: float = 0.0
    rejected: int = 0
    evaluations: int = 1
    log_error: float = 0.0
    steps: int = 0
    stiff_steps: int = 0
    calm_steps: int = 0
    most_stiff: int = 0
    noise: float = 0.0
    known: dict[tuple[float, ...], float] = field(default_factory=dict)

    def slope(self, t: float, x: Floats) -> Floats:
        return np.array([*self.f(t, x, [self.rate, *self.numbers])], dtype=float)

    def attempt(self, h: float) -> float:
        """Stages and error of a step; infinite where it cannot be evaluated."""
        A, c = (TSIT5_A, TSIT5_C) if self.order == 5 else (DOP853_A, DOP853_C)
        self.y, self.last = self.x, len(TSIT5_A) - 1 if self.order == 5 else 12
        self.evaluations += self.last
        for stage in range(1, self.last + 1):
            before, self.y = self.y, self.x + h * (np.array(A[stage]) @ self.k[:stage])
            self.looked += 1
            if self.looked in self.fails:
                return math.inf
            self.k[stage] = self.slope(self.t + c[stage] * h, self.y)
        k, weight = self.k, 1.0 / (self.rtol + self.rtol * np.maximum(abs(self.x), abs(self.y)))
        slope, move = weight * h * (k[self.last] - k[self.last - 1]), weight * (self.y - before)
        self.pair = slope @ slope, move @ move, slope @ move
        coarse, fine = (
            h * math.sqrt(np.mean((weight * (np.array(e) @ k[: len(e)])) ** 2))
            for e in ([TSIT5_E] * 2 if self.order == 5 else DOP853_E)
        )
        self.noise = 1e-12 * h * abs(k * weight).max() / max(fine, 1e-20)
        if self.order == 5:
            return fine
        error = fine**2 / math.sqrt(fine**2 + 0.01 * coarse**2) if fine else 0.0
        self.ratio, self.rough = error / (coarse * h**4) if coarse else 0.0, coarse / h**4
        error = max(error, DIP * self.ratios * coarse * h**4)
        if coarse > 1.0 and self.roughest and self.rough > KINK * self.roughest:
            error = max(error, self.rough / self.roughest)
        return error

    def careful(self, error: float) -> float:
        """The error where a vibration is near the limit of stability."""
        slopes, moves, product = self.pair
        near = (NEAR5 if self.order == 5 else NEAR8) ** 2 * moves
        if not slopes > near or product < -DAMPED * math.sqrt(slopes * moves):
            return error
        return error * min(12.0, (slopes / near) ** 2)

    def restart(self, changed: bool, first: bool = False) -> None:
        self.k[0], self.sums = self.slope(self.t, self.x), np.zeros(3)
        self.ratios = self.roughest = self.ratio = self.rough = 0.0
        if first:
            return
        self.evaluations += 1
        self.h, self.before_event = min(self.h, self.before_event), self.h
        if changed:
            self.fresh, self.is_known = True, self.numbers in self.known
            self.h = self.known[self.numbers] if self.is_known else 0.2 * self.h

    def adapt(self, h: float, error: float, retry: bool) -> None:
        log_error, growth = math.log(max(self.careful(error), 1e-10)), 0.0
        if self.fresh:
            growth = min(10.0, max(0.2, math.exp(((-2.0 if self.order == 5 else -5.0) - log_error) / self.order)))
            if h >= self.h:
                if self.numbers not in self.known and len(self.known) == PHASES:
                    self.known.pop(next(iter(self.known)))
                self.known[self.numbers] = h * min(growth, 1.0 if retry else 1.1 if self.is_known else 10.0)
            growth = min(growth, 1.2) if log_error > math.log(1e-4) else growth
        else:
            alpha, beta = (0.14, 0.08) if self.order == 5 else (0.0875, 0.05)
            growth = min(10.0, max(0.2, 0.9 * math.exp(beta * self.log_error - alpha * log_error)))
        growth = min(growth, 1.0) if retry else growth
        self.h = max(h * growth, self.h) if h < self.h else h * growth
        self.log_error, self.fresh = max(log_error, math.log(1e-4)), False
        self.ratios, self.roughest = max(self.ratio, 0.2 * self.ratios), max(self.rough, 0.5 * self.roughest)

    def watched(self) -> bool:
        """Whether stability limits the steps: so many that look like it, without so many others in a row."""
        self.sums = FADE * self.sums + self.pair
        if self.sums[0] > (STIFF5 if self.order == 5 else STIFF8) ** 2 * self.sums[1]:
            self.stiff_steps, self.calm_steps = self.stiff_steps + 1, 0
            self.most_stiff = max(self.most_stiff, self.stiff_steps)
            return self.stiff_steps >= SURE
        self.calm_steps += 1
        self.stiff_steps = 0 if self.calm_steps >= CALM else self.stiff_steps
        return False

    def attempts(self) -> Iterator[tuple[float, ...]]:
        """After each attempt: time, next step, error, rejected steps, evaluations, and what says that stability limits the steps."""
        longest, coming = min(0.1 * self.end, self.longest), [*self.events, (self.end, ())]
        self.numbers: tuple[float, ...] = (0.0, 0.0)
        self.k = np.zeros((13, len(self.x)))
        self.restart(False, first=True)
        self.h, self.before_event, self.fresh, self.is_known, retry = self.first, longest, True, False, False
        while self.t < self.end:
            h, self.steps = min(self.h, longest), self.steps + 1
            (stop, numbers), last = coming[0], self.t + 1.0001 * h >= coming[0][0]
            h = stop - self.t if last else h
            error, stiff = self.attempt(h), False
            if error <= 1.0:
                self.adapt(h, error, retry)
                retry, stiff = False, self.watched()
                self.t, self.k[0] = stop if last else self.t + h, self.k[self.last]
                self.x = np.where(abs(self.y) > 1e-250, self.y, 0.0)
                if last and numbers:
                    changed, self.numbers = numbers != self.numbers, numbers
                    coming.pop(0)
                    self.restart(changed)
            else:
                self.rejected, retry = self.rejected + 1, True
                self.h = h * (max(0.2, 0.9 * error ** (-1 / self.order)) if error < math.inf else 0.25)
            yield self.t, self.h, self.log_error, self.rejected, self.evaluations, self.stiff_steps, self.calm_steps, stiff


def compared(own: Alone, most: int = 100) -> Alone:
    """Take the steps in both ways, so many at most."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> int:
        dx[0], dx[1] = own.f(t, np.array([x[0], x[1]]), [data[0], data[1], data[2]])
        return int(next(number) in own.fails)

    number = itertools.count()  # zero is the start
    coming = iter([(0.0, 0.0), *(numbers for _, numbers in own.events)])

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        before, (data[1], data[2]) = (data[1], data[2]), next(coming)
        return int(before != (data[1], data[2]))

    model = problem(
        rhs, own.x, data=np.array([own.rate, 0.0, 0.0]), update=update, discrete=slice(1, 3), longest_step=own.longest,
        time_events=np.array([t for t, _ in own.events]),
    )  # fmt: skip
    run = driver(model, [0.0, own.end], RungeKutta(own.order, own.first), rtol=own.rtol)
    run.stepper.watch()  # type: ignore[attr-defined]
    record: Any = run.record
    for _, (t, h, log_error, *counts) in zip(range(most), own.attempts(), strict=False):
        status = run.advance(1)
        assert [record.rejected, record.evaluations, record.stiff_steps, record.calm_steps, status == "stiff"] == counts
        assert run.x == pytest.approx(own.x, rel=1e-9, abs=1e-14)
        assert record.t == pytest.approx(t, rel=1e-12)
        assert record.h == pytest.approx(h, rel=1e-5 + own.noise)
        assert record.log_error == pytest.approx(log_error, abs=1e-5 + own.noise)
        if own.order == 8:
            assert (record.ratios, record.roughest) == pytest.approx((own.ratios, own.roughest), rel=1e-5 + 10.0 * own.noise)
        # from there on: near the limit of stability differences grow
        own.t, own.h, own.x, own.log_error, own.ratios, own.roughest = (
            record.t, record.h, run.x.copy(), record.log_error, record.ratios, record.roughest,
        )  # fmt: skip
        own.sums, own.k[0] = np.array([record.slopes, record.moves, record.products]), own.slope(own.t, own.x)
    return own


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("kind", KINDS)
def test_steps_follow_from_errors_and_stability(order: int, kind: str) -> None:
    f, start, rates = KINDS[kind]
    for rate, rtol in zip(rates, itertools.cycle([1e-3, 1e-6])):
        compared(Alone(order, f, np.array(start), rtol, 2.0, rate, 1.0 / (3.0 + rate)))


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("longest", [math.inf, 0.05])
def test_a_phase_begins_with_the_step_that_suited_its_like(order: int, longest: float) -> None:
    """Known by all numbers that events change; an unknown one with a fifth of the last step, and nothing changes where none do."""
    f: Rates = lambda t, x, p: [p[1] - x[0] + 0.1 * np.cos(7.0 * t), p[2] * (1.0 - x[1]) * x[0]]  # noqa: E731
    phases = [(1.0, 0.0), (1.0, 3.0), (0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (1.0, 3.0), (-1.0, 9.0), (0.0, 0.0)]
    events = [(0.3 + 0.2 * i + 0.01 * i**2, numbers) for i, numbers in enumerate(phases)]
    own = compared(Alone(order, f, np.array([0.2, 0.3]), 1e-5, 3.0, 1.0, 0.1, longest, events), 400)
    assert own.t == 3.0
    assert len(own.known) > 2


def test_so_many_phases_are_remembered() -> None:
    """The one that was found first is forgotten for a further one."""
    f: Rates = lambda t, x, p: [p[1] * np.cos(9.0 * t) - x[0], x[0]]  # noqa: E731
    rounds = [float(k) for k in (1, 2, 3, 4, 5, 6, 7, 8, 1, 9, 0, 8, 3, 2, 1, 9)]
    own = Alone(5, f, np.array([0.2, 0.3]), 1e-4, 3.0, 1.0, 0.1, events=[(0.1 * i, (k, 1.0)) for i, k in enumerate(rounds, 1)])
    assert len(compared(own, 400).known) == PHASES


@pytest.mark.parametrize("order", [5, 8])
def test_a_step_that_cannot_be_evaluated_is_repeated_with_a_quarter(order: int) -> None:
    f, start, _ = KINDS["vibration"]
    own = Alone(order, f, np.array(start), 1e-5, 2.0, 5.0, 0.1, fails=[1, 4, 40, 70, 71, 72, 100])
    assert compared(own).rejected >= 7


@pytest.mark.parametrize("order", [5, 8])
def test_stability_limits_the_steps_where_it_has_done_so_for_a_while(order: int) -> None:
    """Until there are some other steps in a row."""
    f: Rates = lambda t, x, p: [-100.0 * (x[0] - np.cos(t)), -x[1] + 3e4 * np.exp(-5e3 * (t - 1.7) ** 2)]  # noqa: E731
    own = compared(Alone(order, f, np.array([2.0, 1.0]), 1e-3, 3.0, 1.0, 0.01), 400)
    assert own.t == 3.0
    assert own.most_stiff >= SURE
    assert own.stiff_steps < own.most_stiff or order == 8
