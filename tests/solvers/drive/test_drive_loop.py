"""The loop of all runs with a stepper whose steps, crossings and restarts are prescribed: what it asks for, keeps and refuses."""

from __future__ import annotations

import ctypes
import itertools
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pytest

from gearlib.errors import SolverError
from gearlib.solvers.drive.drive_loop import BURST, FOUND, PASSES, RETRY, ROOT, START, STEPPED, TIMED
from gearlib.solvers.drive.driver import Driver, integrate
from gearlib.solvers.drive.python_stepper import FailedError, PythonStepper
from gearlib.solvers.problem import Floats
from tests.run.python_problem import driver, problem

FAILURE = -7


class Prescribed(PythonStepper):
    """The state is the time plus what events have added; ``roots`` are times with what crosses there, ``restarts`` what these return."""

    def __init__(
        self, h: float = 0.25, roots: Mapping[float, tuple[int, ...]] | None = None, restarts: Iterable[int] = ()
    ) -> None:
        self.h, self.roots, self.restarts = h, dict(roots or {}), iter(restarts)
        self.asked: list[tuple[float, int, int]] = []
        self.rejects = self.interpolated = 0
        self.added = 0.0
        self.looked: list[tuple[float, float, float]] = []
        self.updated: list[float] = []

    def step(self, stop: float) -> int:
        t = self.record.t
        self.looked.append((t, *self.driver.data[:2]))
        if self.rejects:
            self.rejects -= 1
            return RETRY
        found = min((at for at in self.roots if at > t), default=math.inf)
        self.record.reached = min(t + self.h, stop, found)
        if self.record.reached < found:
            return STEPPED
        self.driver.fired[:] = self.roots.pop(found)
        self.record.from_zero = int(0 in self.driver.fired and len(self.driver.fired) == 3)
        return FOUND

    def interpolate(self, t: float) -> Floats:
        self.interpolated += 1
        return np.array([t + self.added])

    def accept(self) -> None:
        self.driver.x[0] = self.record.reached + self.added

    def restart(self, changed: int, why: int) -> int:
        self.asked.append((self.record.t, changed, why))
        self.added = self.driver.x[0] - self.record.t
        return next(self.restarts, 0)

    work = 0.0

    def stats(self) -> dict[str, Any]:
        return {}

    def failure(self, code: int) -> SolverError:
        return SolverError(f"code {code}")


def run_of(stepper: Prescribed, times: Any, updates: Iterable[int] = (), n_roots: int = 1, **more: Any) -> Driver:
    """A run in which an update that changes something adds 10 to the state and 1 to a count."""
    coming = iter(updates)

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        did = next(coming, 0)
        stepper.updated.append(t)
        if did > 0:
            x[0] += 10.0
            data[2] += 1.0
        return did

    own = problem(
        lambda *_: 0, [float(times[0])], roots=lambda *_: 0, n_roots=n_roots, update=update, discrete=slice(2, 3), **more
    )
    return driver(own, times, stepper)


def test_restarts_are_repeated_until_nothing_crosses() -> None:
    """With what the update before each did; after the first one because of a crossing, whatever the reason of that was."""
    stepper = Prescribed(roots={0.6: (1,)}, restarts=[1, 0, 0, 2, 1, 0])
    found = integrate(run_of(stepper, [0.0, 1.0], [0, 0, 2, 0, 1, 0], time_events=np.array([0.3])))
    at = [(0.0, 0, START), (0.0, 0, ROOT), (0.3, 2, TIMED), (0.6, 0, ROOT), (0.6, 1, ROOT), (0.6, 0, ROOT)]
    assert stepper.asked == at
    assert found.event_times.tolist() == [0.3, 0.6]
    assert found.event_roots.tolist() == [-1, 0]
    assert found.x[-1, 0] == pytest.approx(21.0)
    assert found.discrete.tolist() == [[0.0], [2.0]]


@pytest.mark.parametrize(("updates", "logged"), [((0, 0), 0), ((1, 0), 1), ((0, 1), 1), ((2, 0), 1)])
def test_leaving_zero_is_an_event_only_where_it_changes_something(updates: tuple[int, int], logged: int) -> None:
    """In the first pass of the event iteration or in a later one; a time event at the same instant is one anyway."""
    for timed in (False, True):
        stepper = Prescribed(roots={0.5: (0, 1, 0)}, restarts=[0, 1, 0])
        events = np.array([0.5]) if timed else np.empty(0)
        found = integrate(run_of(stepper, [0.0, 1.0], [0, *updates], n_roots=3, time_events=events))
        assert found.event_roots.tolist() == [-1] * timed + [1] * logged


@pytest.mark.parametrize("before", [0, 1, 3])
def test_failures_of_a_restart_end_the_run(before: int) -> None:
    """At the start or at an event, at once or after further passes."""
    for at_start in (True, False):
        passes = [1] * before + [FAILURE]
        stepper = Prescribed(roots={0.5: (1,)}, restarts=passes if at_start else [0, *passes])
        with pytest.raises(SolverError, match=rf"^code {FAILURE}$"):
            integrate(run_of(stepper, [0.0, 1.0]))
        assert len(stepper.asked) == before + (1 if at_start else 2)


@pytest.mark.parametrize("at_start", [True, False])
def test_updates_that_fail_or_never_settle_end_the_run(at_start: bool) -> None:
    first = [] if at_start else [0]
    where = "t = 0 s after 0 steps" if at_start else "t = 0.5 s after 2 steps"
    with pytest.raises(SolverError, match=rf"^an event could not be handled at {where}$"):
        integrate(run_of(Prescribed(roots={0.5: (1,)}), [0.0, 1.0], [*first, -1]))
    for passes, settles in ((PASSES - 1, True), (PASSES, False)):
        stepper = Prescribed(roots={0.5: (1,)}, restarts=[*first, *[1] * passes])
        run = run_of(stepper, [0.0, 1.0])
        if settles:
            assert integrate(run).status == "done"
        else:
            with pytest.raises(SolverError, match=rf"^the event iteration does not settle at {where}: what it changes carries"):
                integrate(run)
            assert len(stepper.asked) == passes + len(first)


def test_samples_are_of_the_step_that_they_lie_in() -> None:
    """Those on the end of a step are the states there; on an event, the states after it; several may lie in one step, or none."""
    times = [0.0, 0.0, 0.1, 0.2, 0.25, 0.6, 0.6, 0.9, 1.0]
    stepper = Prescribed(roots={0.6: (1,)})
    found = integrate(run_of(stepper, times, [0, 1]))
    assert found.x[:, 0].tolist() == pytest.approx([t + 10.0 * (t >= 0.6) for t in times])
    assert found.discrete[:, 0].tolist() == [float(t >= 0.6) for t in times]
    assert stepper.interpolated == 3  # at 0.1, 0.2 and 0.9


@pytest.mark.parametrize("kind", ["root", "time event", "neither"])
def test_samples_just_before_an_event_are_on_it(kind: str) -> None:
    """Nearer than a share of the time, or than an absolute slack: they hold the states after it."""
    at = 0.625
    times = np.array([0.0, *(at - d for d in (1e-3, 4e-7, 1e-7)), at, 1.0])
    for slack, share, on in ((2e-7, 0.0, 2), (0.0, 2e-7 / at, 2), (6e-7, 2e-7 / at, 3), (0.0, 0.0, 1)):
        stepper = Prescribed(roots={at: (1,)} if kind == "root" else {}, h=0.125)
        run = run_of(stepper, times, [0, 1], time_events=np.array([at]) if kind == "time event" else np.empty(0))
        run.record.slack, run.record.slack_share = slack, share
        found = integrate(run)
        after = [False] * (5 - on) + [True] * (1 + on) if kind != "neither" else [False] * 6
        assert found.discrete[:, 0].astype(bool).tolist() == after
        assert found.x[:, 0] == pytest.approx(times + 10.0 * np.array(after), abs=5e-7)
        assert stepper.interpolated == (4 - on if kind != "neither" else 3)


def test_a_sample_that_a_later_event_reaches_is_taken_again() -> None:
    """Two events within the slack: the sample on the first one holds the states after the second, but an earlier one stays."""
    first, later = 0.5, 0.5 + 1e-9
    stepper = Prescribed(roots={first: (1,), later: (1,)}, h=0.125)
    run = run_of(stepper, [0.0, first - 1e-6, first, 1.0], [0, 1, 1])
    run.record.slack = 1e-8
    found = integrate(run)
    assert found.discrete[:, 0].tolist() == [0.0, 0.0, 2.0, 2.0]
    assert found.x[:, 0] == pytest.approx([0.0, first - 1e-6, first + 20.0, 21.0], abs=1e-8)


def test_the_first_sample_is_taken_again_for_an_event_just_after_the_start() -> None:
    stepper = Prescribed(roots={1e-9: (1,), 0.5: (1,)})
    run = run_of(stepper, [0.0, 0.5, 1.0], [0, 1, 1])
    run.record.slack = 1e-8
    found = integrate(run)
    assert found.discrete[:, 0].tolist() == [1.0, 2.0, 2.0]
    assert found.x[:, 0] == pytest.approx([10.0, 20.5, 21.0], abs=1e-8)


@pytest.mark.parametrize("where", ["step", "interpolate", "accept", "restart"])
@pytest.mark.parametrize("code", [-1, FAILURE])
def test_failures_of_a_stepper_end_the_run(where: str, code: int) -> None:
    """In the second step, which begins at 0.5 s; what was found until then remains."""

    class Failing(Prescribed):
        def _fails(self, here: str) -> None:
            if here == where and self.record.t >= (1.0 if where == "accept" else 0.5):
                raise FailedError(code)

        def step(self, stop: float) -> int:
            self._fails("step")
            return super().step(stop)

        def interpolate(self, t: float) -> Floats:
            self._fails("interpolate")
            return super().interpolate(t)

        def accept(self) -> None:
            self._fails("accept")
            super().accept()

        def restart(self, changed: int, why: int) -> int:
            self._fails("restart")
            return super().restart(changed, why)

    run = run_of(Failing(h=0.5, roots={1.0: (1,)}), [0.0, 0.25, 0.5, 0.75, 1.5])
    with pytest.raises(SolverError, match=rf"^code {code}$"):
        integrate(run)
    assert run.solution().x[:, 0].tolist() == [0.0, 0.25, 0.5, 0.75][: 3 + (where in ("accept", "restart"))]


def test_a_model_without_events_has_no_update() -> None:
    stepper = Prescribed(h=0.5)
    own = problem(lambda *_: 0, [0.0], discrete=slice(2, 3), time_events=np.array([0.75]))
    found = integrate(driver(own, [0.0, 1.0], stepper))
    assert stepper.asked == [(0.0, 0, START), (0.75, 0, TIMED)]
    assert (found.event_times.tolist(), found.event_roots.tolist()) == ([0.75], [-1])


def test_what_crosses_together_is_logged_together() -> None:
    """After the time event of the same instant; only what has fired, and nothing of an instant before."""
    stepper = Prescribed(roots={0.3: (1, 0, -1, 1), 0.5: (0, 0, 0, 1)})
    found = integrate(run_of(stepper, [0.0, 1.0], [0, *[1] * 9], n_roots=4, time_events=np.array([0.3, 0.4])))
    assert found.event_times.tolist() == [0.3, 0.3, 0.3, 0.3, 0.4, 0.5]
    assert found.event_roots.tolist() == [-1, 0, 2, 3, -1, 3]


def test_attempts_are_counted_and_leave_nothing_behind() -> None:
    stepper = Prescribed(h=0.5)
    stepper.rejects = 3
    run = run_of(stepper, [0.0, 0.25, 1.0])
    for steps, t in ((2, 0.0), (1, 0.0), (1, 0.5)):
        assert run.advance(steps) == "more"
        assert run.t == t
    assert run.record.steps == 4
    assert run.record.sample == 2
    assert run.advance(5) == "done"
    assert run.solution().x[:, 0].tolist() == [0.0, 0.25, 1.0]
    assert run.record.steps == 5


@pytest.mark.parametrize("number", [10, 400])
def test_a_long_log_keeps_all_events(number: int) -> None:
    at = np.arange(1, number + 1) / (number + 1)
    stepper = Prescribed(h=1.0, roots={float(t): (1, -1) for t in at})
    found = integrate(run_of(stepper, [0.0, 1.0], itertools.repeat(1), n_roots=2))
    assert found.event_times.tolist() == at.repeat(2).tolist()
    assert found.event_roots.tolist() == [0, 1] * number


@pytest.mark.parametrize(
    ("number", "gap", "rest"), [(BURST, 0.0, 0.0), (BURST + 1, 0.0, 0.0), (BURST + 1, 1e-4, 0.0), (2 * BURST, 0.0, 0.1)]
)
def test_only_many_events_in_a_short_time_chatter(number: int, gap: float, rest: float) -> None:
    """So many instants, not crossings, within the window; after a rest they are counted anew."""
    at = 0.1 + np.arange(number) * (gap or 5e-14) + rest * (np.arange(number) >= number // 2)
    stepper = Prescribed(h=1.0, roots={float(t): (0, 1) for t in at})
    run = run_of(stepper, [0.0, 1.0], n_roots=2)
    if number == BURST + 1 and not gap:
        with pytest.raises(
            SolverError, match=rf"^events chatter at t = 0\.1 s after \d+ steps: more than {BURST} .* of root 1$"
        ):
            integrate(run)
    else:
        assert len(integrate(run).event_times) == number


@pytest.mark.parametrize("first", [0.0, -2.0, 1e6])
def test_inputs_are_looked_up_between_the_stops(first: float) -> None:
    """Just beyond the last one, to just before the next; without a limit before the first one, and at the end of the run."""
    stops = first + np.array([0.5, 1.5, 2.0])
    stepper = Prescribed(h=0.5)
    run = run_of(stepper, [first, first + 2.0], time_events=stops[:2], interval=0)
    run.stepper.added = first - run.record.t  # type: ignore[attr-defined]
    integrate(run)
    spacing = 1e-14 * max(abs(first), 2.0)
    assert stepper.updated == pytest.approx([first, *stops[:2]], abs=spacing)
    assert len(stepper.looked) == 4
    for t, low, high in stepper.looked:
        now = run.record.origin + t
        before, after = stops[stops <= now + spacing], stops[stops > now + spacing]
        if len(before):
            assert before[-1] <= low <= before[-1] + spacing
            assert low > before[-1] or before[-1] == 0.0
        else:
            assert low == -math.inf
        assert after[0] - spacing <= high < after[0]
    assert run.data[1] == math.inf
    assert run.data[0] == pytest.approx(stops[1], abs=spacing)


class Telling(Prescribed):
    """Tells the derivatives at the ends of steps: those of the states are their numbers times the time."""

    parts = 1

    def attach(self, driver: Driver, memory: Any) -> None:
        super().attach(driver, memory)
        self.rates, self.within, record = np.zeros(3), np.zeros((2, 3)), self.record
        record.rates, record.within, record.rates_within = (a.ctypes.data for a in (self.rates, *self.within))

        def motion(_: int, time: float) -> int:
            self.within[:] = [time, 2 * time, 3 * time], [-time, 0.0, 5.0]
            return 0

        self.moves = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_double)(motion)
        record.motion, record.parts = ctypes.cast(self.moves, ctypes.c_void_p).value or 0, self.parts

    def accept(self) -> None:
        super().accept()
        self.rates[:] = self.record.reached * np.arange(3)


@pytest.mark.parametrize("traced", [[0, 1, 2], [2, 0], [1], []])
def test_ends_of_steps_are_traced_and_those_with_an_event_twice(traced: list[int]) -> None:
    """Before and after it, with the discrete state; within a step, the derivatives there are the model's."""
    stepper = Telling(h=0.25, roots={0.6: (1,)})
    coming = iter([0, 1, 1])

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        did = next(coming)
        if did:
            x[0], x[2], data[2] = x[0] + 10.0, -1.0, data[2] + 1.0
            data[3] -= 3.0
        return did

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1], dx[2] = 100.0 * t, 200.0 * t, 300.0 * t

    own = problem(
        rhs, [0.0, 5.0, 7.0], roots=lambda *_: 0, n_roots=1, update=update, discrete=slice(2, 4), time_events=np.array([0.5]),
        traced=np.array(traced, np.int64),
    )  # fmt: skip
    trace = integrate(driver(own, [0.0, 1.0], stepper)).trace
    assert trace is not None
    times = [0.0, 0.25, 0.5, 0.5, 0.6, 0.6, 0.85, 1.0]
    number = np.array([0, 0, 0, 1, 1, 2, 2, 2])
    states = np.column_stack([times + 10.0 * number, np.full(8, 5.0), np.where(number, -1.0, 7.0)])
    rates = np.outer(times, [0.0, 1.0, 2.0])
    rates[4:6] = 0.6 * np.array([100.0, 200.0, 300.0])
    assert trace.times == pytest.approx(times, abs=1e-15)
    assert trace.states == pytest.approx(states[:, traced], abs=1e-12)
    assert trace.rates == pytest.approx(rates[:, traced], abs=1e-12)
    assert trace.discrete.tolist() == np.column_stack([number, -3.0 * number]).tolist()


@pytest.mark.parametrize("parts", [1, 2, 5])
def test_long_steps_are_traced_in_parts(parts: int) -> None:
    """With the states and derivatives within them; a step as short as rounding is not divided."""
    stepper = Telling(h=0.5, roots={0.5 + 1e-14: (1,)})
    stepper.parts = parts
    own = problem(lambda *_: 0, [0.0] * 3, roots=lambda *_: 0, n_roots=1, traced=np.array([2, 0]))
    trace = integrate(driver(own, [0.0, 1.0], stepper)).trace
    assert trace is not None
    share = np.arange(1, parts) / parts
    times = [0.0, *0.5 * share, 0.5, 0.5 + 1e-14, 0.5 + 1e-14, *(0.5 + 0.5 * share), 1.0]
    inner = np.isin(np.arange(len(times)), [*range(1, parts), *range(parts + 3, 2 * parts + 2)])
    assert trace.times == pytest.approx(times, abs=1e-13)
    assert trace.states[inner] == pytest.approx(np.outer(np.array(times)[inner], [3.0, 1.0]), abs=1e-12)
    assert trace.rates[inner] == pytest.approx(np.column_stack([np.full(inner.sum(), 5.0), -np.array(times)[inner]]), abs=1e-12)
    assert trace.states[~inner] == pytest.approx(np.column_stack([0.0 * trace.times[~inner], trace.times[~inner]]), abs=1e-12)
