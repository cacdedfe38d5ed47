"""What a driver allows: steps in all and in one call, time for a call, memory; and what it makes of a stepper's answers."""

from __future__ import annotations

import ctypes
import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import ArgumentError, SolverError, StartError
from gearlib.solvers.drive import drive_loop
from gearlib.solvers.drive import driver as driver_module
from gearlib.solvers.drive.drive_record import DriveRecord
from gearlib.solvers.drive.driver import Driver, integrate
from gearlib.solvers.ida.ida import ida
from gearlib.solvers.problem import Problem
from gearlib.solvers.rungekutta.rungekutta import RungeKutta
from tests.run.python_problem import driver, problem
from tests.solvers.test_driver import STEPPERS


def decay(**more: Any) -> Problem:
    return problem(lambda t, x, dx, data: dx.__setitem__(0, -x[0]), [1.0], **more)


@pytest.mark.parametrize("name", STEPPERS)
def test_as_many_steps_as_a_run_takes_are_enough(name: str) -> None:
    """One fewer is not; steps after the run went on are counted anew."""
    end = 0.0305
    times = np.linspace(0.0, end, 6)
    whole = driver(decay(), times, STEPPERS[name](), rtol=1e-6)
    assert integrate(whole).status == "done"
    steps = whole.record.steps
    assert steps > 2
    run = driver(decay(), times, STEPPERS[name](), rtol=1e-6, max_steps=steps)
    while run.advance() == "more":
        pass
    assert run.status == "done"
    run.go_on(end + 1e-4, np.empty(0), math.inf)
    while run.advance() == "more":
        pass
    assert run.t == end + 1e-4
    run.close()
    with pytest.raises(SolverError, match=rf" after {steps - 1} steps towards t = 0\.0305 s: max_steps is {steps - 1}$"):
        integrate(driver(decay(), times, STEPPERS[name](), rtol=1e-6, max_steps=steps - 1))


class Scripted(RungeKutta):
    """Answers as told, after so much time."""

    def __init__(self) -> None:
        super().__init__()
        self.budgets: list[int] = []
        self.now, self.takes, self.code = 0.0, iter(()), drive_loop.MORE
        self.looks, self.is_spent, self.recovered, self.left = 0, False, False, False

    def carry_on(self, driver: Driver) -> int:
        self.budgets.append(driver.record.budget)
        self.now += next(self.takes, 0.0)
        return self.code

    def spent(self) -> bool:
        self.looks += 1
        return self.is_spent

    def recovers(self, code: int) -> bool:
        return self.recovered and code == -7

    def leaves(self, code: int) -> bool:
        return self.left and code == -7

    def failure(self, code: int) -> SolverError:
        return SolverError(f"code {code}")


def scripted(monkeypatch: pytest.MonkeyPatch, *takes: float, **more: Any) -> tuple[Scripted, Driver]:
    stepper = Scripted()
    stepper.takes = iter(takes)
    monkeypatch.setattr("gearlib.solvers.drive.driver.perf_counter", lambda: stepper.now)
    return stepper, driver(decay(), [0.0, 1.0], stepper, **more)


def test_calls_take_a_tenth_of_a_second_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a longer one the next has half of the steps that fit; after a short one twice as many, up to a thousand."""
    takes = [0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0624, 0.0999, 10.0, 1e4, 0.0249, 0.0251, 0.02, 0.02]
    stepper, run = scripted(monkeypatch, *takes)
    for _ in takes:
        assert run.advance() == "more"
    assert stepper.budgets == [1000, 200, 400, 800, 1000, 1000, 1000, 1000, 1000, 5, 1, 2, 2, 4]


def test_a_call_has_no_more_steps_than_asked_for_or_left(monkeypatch: pytest.MonkeyPatch) -> None:
    stepper, run = scripted(monkeypatch, max_steps=50)
    for asked, steps, expected in ((7, 0, 7), (0, 0, 1), (1000, 0, 50), (1000, 20, 30), (5, 20, 5), (1000, 49, 1)):
        run.record.steps = steps
        run.advance(asked)
        assert stepper.budgets[-1] == expected
    run.record.steps = 50
    with pytest.raises(SolverError, match=r"^gave up at t = 0 s after 50 steps towards t = 1 s: max_steps is 50$"):
        run.advance()
    assert len(stepper.budgets) == 6


def test_a_stepper_is_asked_whether_it_is_spent_after_so_many_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """In as many calls as these take."""
    stepper, run = scripted(monkeypatch, *[0.05] * 9)
    run._most_steps, stepper.looks_every = 40, 100  # type: ignore[misc]
    seen = []
    for _ in range(7):
        run.advance()
        seen.append(stepper.looks)
    assert seen == [0, 0, 1, 1, 1, 2, 2]
    assert stepper.budgets == [40] * 7
    stepper.is_spent = True
    assert [run.advance(), run.advance()] == ["more", "left"]
    stepper, run = scripted(monkeypatch)
    stepper.code, stepper.is_spent = drive_loop.DONE, True
    assert run.advance() == "done"
    assert stepper.looks == 0


def test_what_becomes_of_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    """What its functions raised comes first, then a remedy, then that the run may leave; else it is an error."""
    for raised, recovered, left, may_leave in itertools.product([False, True], repeat=4):
        expected = "raised" if raised else "more" if recovered else "left" if left and may_leave else "failed"
        stepper, run = scripted(monkeypatch, may_leave=may_leave)
        stepper.code, stepper.recovered, stepper.left = -7, recovered, left
        stepper.raised = KeyError("mine") if raised else None
        if expected == "raised":
            with pytest.raises(KeyError, match="mine"):
                run.advance()
        elif expected == "failed":
            with pytest.raises(SolverError, match=r"^code -7$"):
                run.advance()
        else:
            assert run.advance() == expected


def test_times_that_are_reached_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[float] = []
    for begin in (0.0, 50.0):
        run = driver(decay(tell=told.append), begin + np.array([0.0, 1.0]), RungeKutta(), rtol=1e-3)
        while run.advance(2) == "more":
            assert told[-1] == run.t
        assert told[-1] == begin + 1.0
    assert len(told) > 4


@pytest.mark.parametrize(("n_roots", "capacity"), [(0, 256), (4, 260)])
def test_the_log_grows_before_a_step_that_may_fill_it(n_roots: int, capacity: int) -> None:
    """It has room for a time event, all event functions and one more; what it held, it holds."""
    run = driver(decay(roots=lambda *_: 0, n_roots=n_roots), [0.0, 1.0], Scripted(), time_events=np.array([0.5]))
    run._lasting["log_t"][:] = np.arange(capacity)
    for events, expected in ((0, capacity), (254, capacity), (255, 2 * capacity + n_roots), (255, 2 * capacity + n_roots)):
        run.record.events = events
        run.advance()
        assert run.record.capacity == expected
        for name, kind in (("log_t", ctypes.c_double), ("log_root", ctypes.c_int64)):
            assert run._lasting[name].size == expected
            assert getattr(run.record, name) == ctypes.addressof((kind * 1).from_buffer(run._lasting[name]))
        assert run.event_times.tolist() == list(range(events))


def test_events_are_logged_beyond_the_room_of_the_first_log() -> None:
    """Each in order, in as many calls as steps and enlargements take."""
    events = np.linspace(0.0, 1.0, 601)[1:]
    run = driver(decay(), [0.0, 2.0], RungeKutta(), rtol=1e-3, time_events=events)
    for _ in range(20):
        if run.advance() != "more":
            break
    assert run.status == "done"
    assert run.event_times == pytest.approx(events, abs=1e-12)
    assert set(run.event_roots.tolist()) == {-1}


def test_a_full_trace_does_not_enlarge_the_log_nor_the_other_way_round() -> None:
    run = driver(decay(traced=np.array([0])), [0.0, 1.0], Scripted(), time_events=np.array([0.5]))
    full = run.record.trace_capacity
    for rows, events, pieces, capacity in (
        (full - drive_loop.MARGIN, 0, 1, 256),
        (full - drive_loop.MARGIN + 1, 0, 2, 256),
        (0, 254, 2, 256),
        (0, 255, 2, 512),
    ):
        run.record.trace_rows, run.record.events = rows, events
        run.advance()
        assert run._traced is not None
        assert (len(run._traced), run.record.capacity) == (pieces, capacity)


@pytest.mark.parametrize("may_stop", [False, True])
def test_an_interrupt_ends_the_run_where_it_may(may_stop: bool) -> None:
    class Interrupted(RungeKutta):
        def carry_on(self, driver: Driver) -> int:
            raise KeyboardInterrupt

    run = driver(decay(may_stop=may_stop), [0.0, 1.0], Interrupted())
    if may_stop:
        assert run.advance() == "interrupted"
        assert run.solution().status == "interrupted"
    else:
        with pytest.raises(KeyboardInterrupt):
            run.advance()


@pytest.mark.parametrize("begin", [0.0, 1000.0])
def test_chattering_is_told_with_the_functions_that_did(begin: float) -> None:
    """Those of the last billionth of the run: time events, and what crossed before, are not named; nobody twice."""
    own = replace(decay(roots=lambda *_: 0, n_roots=5), root_names=("a > 0", "b > 0", "b > 0", "c > 0"))
    run = driver(own, begin + np.array([0.0, 2.0]), RungeKutta())
    assert run.record.window == pytest.approx(2e-9)
    record, since = run.record, begin - run.record.origin
    log = [(0.5, 0), (1.0 - 2.1e-9, 3), (1.0 - 1.9e-9, 4), (1.0, -1), (1.0, 2), (1.0, 1)]
    for k, (t, root) in enumerate(log):
        run._lasting["log_t"][k] = since + t
        run._lasting["log_root"].view(np.int64)[k] = root
    record.events, record.t, record.steps = len(log), since + 1.0, 17
    said = f"events chatter at t = {begin + 1.0:.9g} s after 17 steps: more than {drive_loop.BURST} of them within 2e-09 s, "
    assert str(run._failure(drive_loop.CHATTER)) == said + "of b > 0; root 4"


def test_failures_of_the_loop_have_their_words() -> None:
    own = replace(decay(), unsettled=lambda t, x, data: "brake.mode")
    run = driver(own, [0.0, 3.0], RungeKutta(), max_steps=9)
    run.record.t, run.record.steps = 0.25, 9
    where = "at t = 0.25 s after 9 steps"
    assert str(run._failure(drive_loop.UPDATE_FAILED)).startswith(
        f"an event could not be handled {where}: the iteration does not settle"
    )
    assert str(run._failure(drive_loop.UNSETTLED)).startswith(
        f"the event iteration does not settle {where}: what it changes carries event functions to and fro: "
    )
    assert str(run._failure(drive_loop.STEP_LIMIT)) == f"gave up {where} towards t = 3 s: max_steps is 9"
    assert "the right-hand side cannot be evaluated" in str(run._failure(drive_loop.RHS_FAILED))


@pytest.mark.parametrize(("n", "size"), [(1, 4), (4, 4), (5, 8), (8, 8), (9, 12)])
def test_states_are_padded_to_whole_blocks(n: int, size: int) -> None:
    asked: list[tuple[int, int]] = []

    class Sized(RungeKutta):
        def memory(self, size: int, n_roots: int) -> dict[str, int]:
            asked.append((size, n_roots))
            return super().memory(size, n_roots)

    run = driver(problem(lambda *_: 0, np.zeros(n), roots=lambda *_: 0, n_roots=3), [0.0, 1.0], Sized())
    assert asked == [(size, 3)]
    assert run.record.x_new - run.record.x == 8 * size  # type: ignore[attr-defined]
    driver(problem(lambda *_: 0, np.zeros(n), n_roots=3), [0.0, 1.0], Sized())  # without functions there are no roots
    assert asked[-1] == (size, 0)


def test_rates_of_an_implicit_problem_have_room_behind_the_states() -> None:
    own = replace(problem(lambda *_: 0, np.zeros(5)), implicit=True)
    for given, size in ((own, 16), (replace(own, implicit=False), 8)):
        run = driver(given, [0.0, 1.0], ida(native=False))
        assert run.record.fired - run.record.x == 8 * size


@pytest.mark.parametrize("n_times", [0, 3])
@pytest.mark.parametrize(("n_roots", "n_timed", "capacity"), [(0, 0, 2), (0, 2, 256), (4, 0, 260), (4, 2, 260)])
def test_arrays_lie_one_behind_the_other(n_roots: int, n_timed: int, capacity: int, n_times: int) -> None:
    """Behind the record, which holds their offsets; those that a later method takes over come last."""
    own = {"x": 8, "k": 12}
    words, relative, places = driver_module.layout(DriveRecord, own, 5, n_roots, 10, 6, 3, n_timed, n_times, (4, 7))
    lengths = {**own, "fired": n_roots, "data": 10, "index": 6, "stops": 3}
    if n_times:
        lengths |= {"times": 3, "out": 15, "discrete": 9, "log_t": capacity, "log_root": capacity}
    at = 4 * math.ceil(ctypes.sizeof(DriveRecord) / 32)
    assert places["zero"] == slice(at, at + 8 + 12 + n_roots)
    record, pointers = (DriveRecord.from_buffer_copy(array.tobytes()) for array in (words, relative))
    for name, length in lengths.items():
        assert places[name] == slice(at, at + length)
        if name not in ("k",):
            assert (getattr(record, name), getattr(pointers, name)) == (8 * at, 1)
        at += length
    assert places["end"] == slice(at, at)
    assert set(places) == {*lengths, "zero", "end"}
    assert (pointers.address, record.address) == (1, 0)
    assert int(relative.sum()) == len(lengths)
    found = [
        getattr(record, name)
        for name in ("n", "n_roots", "n_stops", "n_timed", "n_discrete", "first_discrete", "n_times", "capacity")
    ]
    assert found == [5, n_roots, 3, n_timed, 3, 4, n_times, capacity]
    assert (
        DriveRecord.from_buffer_copy(
            driver_module.layout(DriveRecord, own, 5, 0, 10, 6, 3, 0, 0, (7, 4))[0].tobytes()
        ).n_discrete
        == 0
    )


@pytest.mark.parametrize(
    ("events", "stops", "timed"),
    [
        ([], [3.0], 0), ([1.0], [3.0], 0), ([1.0, 1.5, 0.5], [1.5, 3.0], 1), ([2.0, 1.5, 2.0, 4.0], [1.5, 2.0, 3.0], 2),
        ([3.0, 2.0], [2.0, 3.0], 2), ([3.0], [3.0], 1), ([3.5, -1.0], [3.0], 0),
    ],
)  # fmt: skip
def test_stops_are_time_events_after_the_start_and_the_end(events: list[float], stops: list[float], timed: int) -> None:
    found, count = driver_module.stops_in(np.array(events), 1.0, 3.0)
    assert (found.tolist(), count) == (stops, timed)


REFUSED: dict[str, tuple[Callable[[Problem], Problem], str]] = {
    "falling": (lambda p: replace(p, times=np.array([1.0, 0.5])), "times must be finite and not decrease"),
    "falling later": (lambda p: replace(p, times=np.array([0.0, 2.0, 1.0])), "times must be finite and not decrease"),
    "none": (lambda p: replace(p, times=np.empty(0)), "there must be one at least"),
    "in a table": (lambda p: replace(p, times=np.zeros((1, 1))), "times must be finite"),
    "from minus infinity": (lambda p: replace(p, times=np.array([-math.inf, 1.0])), "times must be finite"),
    "to infinity": (lambda p: replace(p, times=np.array([0.0, math.inf])), "times must be finite"),
    "rtol 0": (lambda p: replace(p, rtol=0.0), "rtol must lie between 0 and 1, not 0"),
    "rtol 1": (lambda p: replace(p, rtol=1.0), "rtol must lie between 0 and 1, not 1"),
    "no nominal": (lambda p: replace(p, nominal=np.array([1.0, 0.0])), "absolute tolerances must be positive and finite"),
    "atol of one": (lambda p: replace(p, atol=[1e-3] * 3), "atol is one number or 2 of them"),
    "atol 0": (lambda p: replace(p, atol=0.0), "absolute tolerances must be positive and finite"),
    "atol partly 0": (lambda p: replace(p, atol=[1.0, 0.0]), "absolute tolerances must be positive and finite"),
    "atol infinite": (lambda p: replace(p, atol=[1.0, math.inf]), "absolute tolerances must be positive and finite"),
    "max_steps": (lambda p: replace(p, max_steps=0), "max_steps must be at least 1, not 0"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_numbers_that_make_no_sense_are_refused_whatever_was_checked_before(case: str) -> None:
    """Times that cannot change, with the same nominal values and tolerance, are checked once."""
    change, said = REFUSED[case]
    times = np.array([0.0, 0.5, 0.5, 1.0])
    times.flags.writeable = False
    own = replace(problem(lambda *_: 0, [0.0, 0.0]), times=times, rtol=1e-3)
    for _ in range(2):
        Driver(own, RungeKutta())
        with pytest.raises(ArgumentError, match=said):
            Driver(change(own), RungeKutta())
    for fine in (
        {"atol": 1e-9},
        {"atol": [1e-9]},
        {"atol": [1e-9, 1.0]},
        {"rtol": 0.99},
        {"max_steps": 1},
        {"times": np.array([2.0])},
    ):
        Driver(replace(own, **fine), RungeKutta())
    with pytest.raises(StartError, match="state 1 starts at a value that is not finite"):
        Driver(replace(own, x0=np.array([0.0, math.inf])), RungeKutta())


def test_a_changed_time_is_noticed_where_it_can_change() -> None:
    own = replace(problem(lambda *_: 0, [0.0]), times=np.array([0.0, 1.0]))
    Driver(own, RungeKutta())
    own.times[1] = -1.0
    with pytest.raises(ArgumentError, match="not decrease"):
        Driver(own, RungeKutta())


def test_pieces_of_a_trace_have_room_for_two_steps_at_least(monkeypatch: pytest.MonkeyPatch) -> None:
    for first, rows in ((60, 20), (48, 2 * drive_loop.MARGIN), (1, 2 * drive_loop.MARGIN)):
        monkeypatch.setattr("gearlib.solvers.drive.trace.FIRST", first)
        run = driver(decay(traced=np.array([0])), [0.0, 1.0], RungeKutta(), rtol=1e-3)
        assert run.record.trace_capacity == rows
        while run.advance(1) == "more":
            pass
        trace = run.solution().trace
        assert trace is not None
        assert trace.states[:, 0] == pytest.approx(np.exp(-trace.times), rel=1e-2)


@pytest.mark.parametrize("steps", [3, 40])
def test_a_trace_goes_on_with_the_next_method(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a further piece; a trace that was dropped, or never kept, does not begin again."""
    monkeypatch.setattr("gearlib.solvers.drive.trace.FIRST", 64)

    def handed_over(first: Driver) -> Any:
        while first.record.steps < steps:
            first.advance(1)
        here = replace(first.problem, x0=first.x.copy(), traced=np.array([0]))
        return integrate(Driver(here, RungeKutta(8), first)).trace

    own = decay(traced=np.array([0]), longest_step=0.02)
    first = driver(own, [0.0, 1.0], RungeKutta())
    found = handed_over(first)
    before = first.solution().trace
    assert before is not None
    assert found.times[: len(before.times)].tolist() == before.times.tolist()
    assert found.states[: len(before.states)].tolist() == before.states.tolist()
    assert len(before.pieces) == (1 if steps == 3 else 2)
    assert len(found.pieces) > len(before.pieces)
    assert (found.times[0], found.times[-1]) == (0.0, 1.0)
    assert found.states[:, 0] == pytest.approx(np.exp(-found.times), rel=1e-6)
    assert handed_over(driver(replace(own, traced=None), [0.0, 1.0], RungeKutta())) is None
    monkeypatch.setattr("gearlib.solvers.drive.trace.MOST", 10)
    assert handed_over(driver(own, [0.0, 1.0], RungeKutta())) is None
