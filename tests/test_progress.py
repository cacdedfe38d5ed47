"""What is told of long calls: the fraction done, at most each twentieth of a second, on a terminal or to a function."""

from __future__ import annotations

import io
import sys

import pytest

from gearlib import progress
from gearlib.errors import ArgumentError, GearlibError
from gearlib.progress import RunProgress, Ticker, check_progress, notice, reporting


class Clock:
    """Says the time that it is set to."""

    def __init__(self) -> None:
        self.now = 100.0

    def perf_counter(self) -> float:
        return self.now


class Terminal(io.StringIO):
    """Text that is shown."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(progress, "time", found)
    return found


def on_terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Standard error from here on; pytest sets its own before each test."""
    found = Terminal()
    monkeypatch.setattr(sys, "stderr", found)
    return found


def test_reports_are_a_twentieth_of_a_second_apart(clock: Clock) -> None:
    ticker = Ticker()
    due = []
    for now in (100.0, 100.049, 100.051, 100.06, 100.1, 100.102, 105.0, 105.04, 105.051):
        clock.now = now
        due.append(ticker.due())
    assert due == [False, False, True, False, False, True, True, False, True]


@pytest.mark.parametrize(("first", "last"), [(2.0, 6.0), (6.0, 2.0)])
def test_a_run_tells_the_part_of_its_interval_and_the_time_since_it_began(clock: Clock, first: float, last: float) -> None:
    told: list[tuple[float, float]] = []
    run = RunProgress(lambda f, t: told.append((f, t)), first, last)
    run(first)  # not due yet
    clock.now = 101.0
    run(first + 0.25 * (last - first))
    run(last)
    clock.now = 103.0
    run(first - (last - first))
    run.end(last + 0.5 * (last - first))
    assert told == [(0.25, 1.0), (0.0, 3.0), (1.0, 3.0)]


def test_a_run_of_no_length_is_done() -> None:
    told: list[float] = []
    RunProgress(lambda f, _: told.append(f), 3.0, 3.0).end(3.0)
    assert told == [1.0]


def test_who_asks_for_nothing_is_told_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    with reporting(False, "a run") as tell:
        assert tell is None
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with reporting(True, "a run") as tell:  # no terminal
        assert tell is None
    monkeypatch.setattr(sys, "stderr", None)  # no console
    with reporting(True, "a run") as tell:
        assert tell is None
    notice("compiling")
    assert terminal.getvalue() == ""


def test_a_line_on_a_terminal_without_tqdm(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with reporting(True, "a run") as tell:
        assert tell is not None
        clock.now = 100.26
        tell(0.256, 0.0)
        clock.now = 102.0
        tell(1.0, 0.0)
    assert terminal.getvalue() == "\ra run:  26 %, 0.3 s\ra run: 100 %, 2.0 s\n"


def test_a_bar_of_tqdm_goes_forward_only(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("tqdm")
    terminal = on_terminal(monkeypatch)
    with reporting(True, "a run") as tell:
        assert tell is not None
        for fraction in (0.5, 0.25, 1.0):
            tell(fraction, 0.0)
    said = terminal.getvalue()
    assert "a run:   0%|" in said
    assert "a run: 100%|" in said
    assert "25%" not in said


def test_a_notice_overwrites_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    monkeypatch.setenv("COLUMNS", "40")
    notice("compiling the solvers")
    assert terminal.getvalue() == "\r" + "compiling the solvers".ljust(39) + "\n"


def test_a_function_that_fails_is_named_and_errors_of_gearlib_pass() -> None:
    def told_to(problem: Exception) -> None:
        def fail(fraction: float, now: float) -> None:
            raise problem

        with reporting(fail, "a run") as tell:
            assert tell is not None
            tell(0.5, 0.0)

    with pytest.raises(
        ArgumentError, match=r"progress, a function, raised KeyError: 'a'; expected a function of the fraction done"
    ):
        told_to(KeyError("a"))
    with pytest.raises(GearlibError, match="enough"):
        told_to(GearlibError("enough"))


def test_what_progress_may_be() -> None:
    for right in (True, False, print):
        assert check_progress(right) is right
    for wrong in (None, 1, "yes"):
        with pytest.raises(
            ArgumentError, match=r"progress is .*; expected True, False, or a function of the fraction done and"
        ):
            check_progress(wrong)
