"""The one driver: whatever takes the steps, events, samples and the log are the same."""

from __future__ import annotations

import gc
import itertools
import math
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import ArgumentError, SolverError, StartError
from gearlib.solvers.drive.driver import Driver, Stepper, integrate
from gearlib.solvers.drive.explicit_stepper import ExplicitStepper
from gearlib.solvers.ida.ida import ida
from gearlib.solvers.problem import Floats, Problem
from gearlib.solvers.rungekutta.rungekutta import RungeKutta
from tests.run.python_problem import driver, problem


class Heun(ExplicitStepper):
    """Of order 2, with steps of 1/1000 s."""

    def advance(self, t: float, x: Floats, stop: float) -> tuple[float, Floats]:
        h = min(1e-3, stop - t)
        k = self.f(t, x)
        return t + h, x + 0.5 * h * (k + self.f(t + h, x + h * k))


STEPPERS: dict[str, Callable[[], Stepper]] = {
    "rk5": RungeKutta, "rk8": lambda: RungeKutta(8), "ida": ida, "scikit-sundae": lambda: ida(native=False), "Python": Heun,
}  # fmt: skip
steppers = pytest.mark.parametrize("name", STEPPERS)


def ball() -> Problem:
    """Falls with 10 m/s2 from 1 m, bounces with restitution 1/2; time events at 0.1 and 0.2 s turn a counter on."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = x[1], -10.0

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0] = x[0]

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        if fired[0] == -1:
            x[1] *= -0.5
            data[0] += 1.0
            fired[0] = 2
            return 2
        return 0

    return problem(
        rhs, [1.0, 0.0], roots=roots, n_roots=1, update=update, discrete=slice(0, 1), time_events=np.array([0.1, 0.2])
    )


FIRST = math.sqrt(0.2)  # s, of the first bounce


@steppers
def test_events_samples_and_log(name: str) -> None:
    times = np.array([0.0, 0.05, 0.1, 0.3, FIRST, 0.6, 0.8])
    found = integrate(driver(ball(), times, STEPPERS[name](), rtol=1e-9))
    flight = 0.6 - FIRST
    assert found.status == "done"
    apart = np.diff(found.event_times, prepend=0.0) > 1e-6  # IDA may see the ball leave the floor as well
    assert found.event_roots[apart].tolist() == [-1, -1, 0]
    assert found.event_times[apart] == pytest.approx([0.1, 0.2, FIRST], abs=1e-7)
    assert found.x[:4, 0] == pytest.approx(1.0 - 5.0 * times[:4] ** 2, abs=1e-7)
    assert found.x[5, 0] == pytest.approx(0.5 * 10.0 * FIRST * flight - 5.0 * flight**2, abs=1e-6)
    assert found.discrete[:, 0].tolist()[:4] == [0.0] * 4
    assert found.discrete[-1, 0] == 1.0
    assert found.data[0] == 1.0


@steppers
def test_a_run_can_be_left_and_gone_on_with(name: str) -> None:
    """Step by step, it is the same run."""
    times = np.linspace(0.0, 0.8, 9)
    whole = integrate(driver(ball(), times, STEPPERS[name](), rtol=1e-8))
    run = driver(ball(), times, STEPPERS[name](), rtol=1e-8)
    while run.advance(1) == "more":
        pass
    np.testing.assert_array_equal(run.solution().x, whole.x)
    run.close()


@steppers
def test_late_runs_lose_no_digits(name: str) -> None:
    """1e6 s after zero: events are known to the clock's resolution, states as exactly as in a run from zero."""
    late, times = ball(), np.array([0.0, 0.3, 0.8])
    early = integrate(driver(ball(), times, STEPPERS[name](), rtol=1e-8))
    found = integrate(driver(late, 1e6 + times, STEPPERS[name](), rtol=1e-8, time_events=1e6 + late.time_events))
    assert found.t.tolist() == (1e6 + times).tolist()
    assert found.x == pytest.approx(early.x, abs=1e-7)
    assert found.event_times[-1] - 1e6 == pytest.approx(FIRST, abs=1e-6)


@steppers
def test_one_word_for_one_failure(name: str) -> None:
    oscillator = problem(lambda t, x, dx, data: dx.__setitem__(0, -x[0]), [1.0])
    with pytest.raises(SolverError, match=r"gave up at t = .* after 3 steps towards t = 1 s: max_steps is 3"):
        integrate(driver(oscillator, [0.0, *np.linspace(0.5, 1.0, 9)], STEPPERS[name](), rtol=1e-6, max_steps=3))
    for asked in ({"rtol": 0.0}, {"atol": -1.0}, {"max_steps": 0}):
        with pytest.raises(ArgumentError):
            driver(oscillator, [0.0, 1.0], STEPPERS[name](), **asked)
    with pytest.raises(StartError, match="state 0 starts at a value that is not finite"):
        driver(problem(lambda *_: 0, [math.nan]), [0.0, 1.0], STEPPERS[name]())

    def failing(t: float, x: Any, dx: Any, data: Any) -> int:
        dx[0] = 1.0
        return -1 if t > 0.5 else 0

    with pytest.raises(SolverError, match=r"right-hand side .*evaluated"):
        integrate(driver(problem(failing, [0.0]), [0.0, 1.0], STEPPERS[name](), rtol=1e-6))


@steppers
@pytest.mark.parametrize("left", [0.5, 0.3])
def test_event_functions_that_cannot_be_evaluated(name: str, left: float) -> None:
    """Beyond x = 0.5 the run ends with a word, unless an event at 0.3 has given them another branch."""

    def roots(t: float, x: Any, g: Any, data: Any) -> int:
        g[0] = x[0] - 0.3 if left < 0.5 and data[0] == 0.0 else 1.0
        return -1 if x[0] > 0.5 and data[0] == 0.0 else 0

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        if fired[0] == 1:
            data[0], fired[0] = 1.0, 2
        return 0

    rising = problem(
        lambda t, x, dx, data: dx.__setitem__(0, 1.0), [0.0], roots=roots, n_roots=1, update=update, discrete=slice(0, 1)
    )
    run = driver(rising, [0.0, 1.0], STEPPERS[name](), rtol=1e-6)
    if left < 0.5:
        assert integrate(run).x[-1] == pytest.approx(1.0, abs=1e-6)
        return
    with pytest.raises(SolverError, match=r"evaluated"):
        integrate(run)


def test_what_a_method_in_python_raises_comes_out() -> None:
    class Wrong(Heun):
        def advance(self, t: float, x: Floats, stop: float) -> tuple[float, Floats]:
            raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        integrate(driver(ball(), [0.0, 1.0], Wrong(), rtol=1e-6))


@steppers
@pytest.mark.parametrize("other", ["rk5", "ida", "Python"])
@pytest.mark.parametrize("steps", [1, 7, 60])
def test_a_run_is_handed_over_with_its_samples_and_events(name: str, other: str, steps: int) -> None:
    """From wherever it is: nothing is lost, told twice or known otherwise; the first driver may go on, too."""
    times = np.linspace(0.0, 0.8, 33)
    whole = integrate(driver(ball(), times, STEPPERS[name](), rtol=1e-9))
    first = driver(ball(), times, STEPPERS[name](), rtol=1e-9)
    first.advance(steps)
    here = replace(first.problem, x0=first.x.copy(), data=first.data.copy())
    second = integrate(Driver(here, STEPPERS[other](), first))
    while first.advance() == "more":
        pass
    for found in (second, first.solution()):
        assert found.t.tolist() == times.tolist()
        assert found.x == pytest.approx(whole.x, abs=2e-6)
        apart = np.diff(found.event_times, prepend=0.0) > 1e-6
        assert found.event_roots[apart].tolist() == [-1, -1, 0]
    first.close()


@pytest.mark.parametrize("begin", [0.0, 50.0])
def test_a_finished_run_goes_on_to_later_times(begin: float) -> None:
    """Through the time events on the way, in steps as long as they then may be; it takes no more samples."""
    own = problem(lambda t, x, dx, data: dx.__setitem__(0, 1.0), [0.0], discrete=slice(2, 3))
    run = driver(own, begin + np.array([0.0, 0.5, 1.0]), RungeKutta())
    events = begin + np.array([0.5, 1.0, 1.5, 2.0, 2.5])
    for end, given, longest in ((1.0, None, 0.0), (2.0, events, 0.01), (3.0, np.empty(0), math.inf), (4.0, events, math.inf)):
        before = run.record.steps
        if given is not None:
            run.go_on(begin + end, given, longest)
        while run.advance() == "more":
            pass
        assert (run.t, run.x[0]) == (begin + end, pytest.approx(end, abs=1e-13))
        assert (run.record.steps - before >= 100) == (longest == 0.01)
    assert run.event_times.tolist() == [begin + 1.5, begin + 2.0]
    assert run.solution().x.shape == (0, 1)
    assert run.out[:, 0] == pytest.approx([0.0, 0.5, 1.0], abs=1e-14)


@pytest.mark.parametrize("name", ["rk5", "rk8", "ida"])
def test_memory_of_a_run_that_is_over_does_not_wait_for_the_garbage_collector(name: str) -> None:
    gc.collect()
    gc.disable()
    try:
        run = driver(ball(), np.linspace(0.0, 0.8, 9), STEPPERS[name](), rtol=1e-6)
        while run.advance() == "more":
            pass
        run.close()
        gone = weakref.ref(run)
        del run
        assert gone() is None
    finally:
        gc.enable()


def test_a_process_that_was_suspended_is_soon_as_fast_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    stepper, calls, asked = RungeKutta(), [0], itertools.count()
    carry_on = stepper.carry_on

    def counted(driver: Driver) -> int:
        calls[0] += 1
        return carry_on(driver)

    def clock() -> float:
        return 3600.0 if next(asked) else 0.0  # an hour passes in the first call, and no time after it

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = math.cos(t)

    monkeypatch.setattr("gearlib.solvers.drive.driver.perf_counter", clock)
    monkeypatch.setattr(stepper, "carry_on", counted)
    steps = integrate(driver(problem(rhs, [0.0]), [0.0, 5e3], stepper)).stats["steps"]
    assert steps > 3000
    assert calls[0] < steps / 1000 + 15


@pytest.mark.parametrize(("steps", "pieces"), [(10, 1), (50, 2), (300, 3), (600, 0)])
def test_ends_of_steps_are_kept_up_to_a_length(steps: int, pieces: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """In pieces of 21, 85 and 341 rows of three numbers; a longer trace is dropped."""
    monkeypatch.setattr("gearlib.solvers.drive.trace.FIRST", 64)
    monkeypatch.setattr("gearlib.solvers.drive.trace.MOST", 1024)

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = -x[0], 1.0

    own = problem(rhs, [1.0, 0.0], traced=np.array([0]), longest_step=1.0 / steps)
    found = integrate(driver(own, [0.0, 1.0], RungeKutta())).trace
    assert (found is None) == (pieces == 0)
    if found is not None:
        assert len(found.pieces) == pieces
        assert (found.times[0], found.times[-1]) == (0.0, 1.0)
        assert len(found.times) >= steps
        assert (np.diff(found.times) > 0).all()
        assert found.states[:, 0] == pytest.approx(np.exp(-found.times), rel=1e-6)
        assert found.rates == pytest.approx(-found.states, rel=1e-12)


@pytest.mark.parametrize(("order", "stages"), [(5, 6), (8, 12)])
def test_steps_and_rejections_are_all_evaluations(order: int, stages: int) -> None:
    """One right-hand side at the start, one for the first step, and the stages of each attempt; a trace holds the steps that stand."""

    def kinked(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = 1.0 if x[0] < 0.3 else -50.0 * (x[0] - 0.32)

    found = integrate(driver(problem(kinked, [0.0], traced=np.array([0])), [0.0, 1.0], RungeKutta(order)))
    stats = found.stats
    assert stats["rejected"] > 0
    assert stats["rhs"] == 2 + stages * (stats["steps"] + stats["rejected"])
    assert found.trace is not None
    assert len(found.trace.times) == 1 + stats["steps"]
    assert (stats["method"], stats["order"], stats["events"]) == (f"rk{order}", order, 0)
