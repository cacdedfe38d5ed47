"""Progress of runs, and interrupts: nothing is lost, nothing changes the numbers."""

from __future__ import annotations

import os
import signal
import threading
import time
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, GearlibWarning
from tests.many_runs.models import Drive, Rattle
from tests.many_runs.test_in_lanes import Relaxing

METHODS = ["auto", "rk5", "ida"]


@pytest.fixture(autouse=True)
def every_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports are not 50 ms apart, and calls of the compiled loop are short."""
    monkeypatch.setattr("gearlib.progress.APART", 0.0)
    monkeypatch.setattr("gearlib.solvers.drive.driver.STEPS_PER_CALL", 20)


@pytest.fixture(scope="module")
def oscillator() -> gl.System:
    return gl.compile(Relaxing())


@pytest.mark.parametrize("method", METHODS)
def test_the_fraction_grows_to_one_and_the_numbers_stay(oscillator: gl.System, method: str) -> None:
    told: list[tuple[float, float]] = []
    watched = oscillator.simulate(40.0, samples=9, method=method, progress=lambda f, t: told.append((f, t)))
    fractions, seconds = np.array(told).T
    assert len(told) > 3
    assert (np.diff(fractions) >= 0).all()
    assert (np.diff(seconds) >= 0).all()
    assert fractions[-1] == 1.0
    assert watched["x"].tobytes() == oscillator.simulate(40.0, samples=9, method=method)["x"].tobytes()


def test_switching_between_methods_is_told_on(oscillator: gl.System) -> None:
    told: list[float] = []
    run = oscillator.simulate(5.0, samples=5, parameters={"mu": 3e4}, progress=lambda f, _: told.append(f))
    assert run.stats["legs"] > 1
    assert told == sorted(told)
    assert told[-1] == 1.0


def interrupted_at(fraction: float) -> Any:
    def tell(done: float, _: float) -> None:
        if done > fraction:
            raise KeyboardInterrupt

    return tell


@pytest.mark.parametrize("method", METHODS)
def test_an_interrupt_leaves_what_was_computed(oscillator: gl.System, method: str) -> None:
    whole = oscillator.simulate(40.0, samples=41, method=method)
    with pytest.raises(KeyboardInterrupt):
        oscillator.simulate(40.0, samples=41, method=method, progress=interrupted_at(0.5))
    with pytest.warns(GearlibWarning, match=r"interrupted at t = 2\d"):
        part = oscillator.simulate(40.0, samples=41, method=method, progress=interrupted_at(0.5), on_interrupt="stop")
    assert 20 < len(part.time) < 41
    assert part["x"].tobytes() == whole["x"][: len(part.time)].tobytes()
    assert part.stats["interrupted"] >= part.time[-1]


def test_an_interrupt_before_the_first_sample_leaves_nothing(oscillator: gl.System) -> None:
    """The start, which was not asked for, is none."""
    with pytest.raises(KeyboardInterrupt, match=r"^before the first sample, at t = 2\d"):
        oscillator.simulate(40.0, times=[30.0, 40.0], t_start=0.0, progress=interrupted_at(0.5), on_interrupt="stop")
    with pytest.warns(GearlibWarning, match=r"interrupted at t = 2\d"):
        part = oscillator.simulate(40.0, times=[10.0, 40.0], t_start=0.0, progress=interrupted_at(0.5), on_interrupt="stop")
    assert part.time.tolist() == [10.0]


def test_an_interrupt_between_events() -> None:
    system = gl.compile(Rattle(), outputs=["load.w"])
    with pytest.warns(GearlibWarning, match="interrupted at"):
        part = system.simulate(20.0, samples=201, progress=interrupted_at(0.3), on_interrupt="stop")
    assert 40 < len(part.time) < 201
    assert np.isfinite(part["load.w"]).all()


def test_an_interrupted_run_is_repeated_as_far_as_it_came() -> None:
    """For a variable that it did not integrate, and for its energies."""
    system, told = gl.compile(Rattle(), outputs=["load.w"]), list[float]()

    def once(done: float, _: float) -> None:
        told.append(done)
        if done > 0.3 and max(told[:-1], default=0.0) <= 0.3:
            raise KeyboardInterrupt

    with pytest.warns(GearlibWarning, match="interrupted at"):
        part = system.simulate(20.0, samples=201, progress=once, on_interrupt="stop")
    whole = system.simulate(20.0, samples=201)
    assert part["load.phi"] == pytest.approx(whole["load.phi"][: len(part.time)], rel=1e-6)
    assert part.energy_balance().time[-1] == part.time[-1]


@pytest.mark.parametrize("method", ["rk5", "ida"])
def test_an_interrupt_within_a_function_of_an_input(method: str) -> None:
    """The function is asked again, and the run ends behind the step."""
    system = gl.compile(Drive(), outputs=["load.w"])
    calls = []

    def torque(t: float) -> float:
        calls.append(t)
        if len(calls) == 300:
            raise KeyboardInterrupt
        return 5.0 if t < 1.0 else -5.0

    options: dict[str, Any] = {"samples": 401, "method": method, "inputs": {"torque.tau": torque}}
    with pytest.warns(GearlibWarning, match="interrupted at"):
        part = system.simulate(20.0, on_interrupt="stop", **options)
    whole = system.simulate(20.0, **options)
    assert 1 < len(part.time) < 401
    assert part["load.w"].tobytes() == whole["load.w"][: len(part.time)].tobytes()
    calls.clear()
    with pytest.raises(KeyboardInterrupt):
        system.simulate(20.0, **options)


@pytest.mark.usefixtures("interruptible")
def test_a_signal_is_answered_soon(oscillator: gl.System) -> None:
    oscillator.simulate(1.0, method="rk5", samples=2)  # compiled
    sent: list[float] = []

    def send() -> None:
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    begin = time.perf_counter()
    threading.Timer(0.5, send).start()  # by then the run has begun on a machine under load, too
    with pytest.warns(GearlibWarning, match="interrupted at"):
        part = oscillator.simulate(1e7, method="rk5", samples=100_001, on_interrupt="stop")
    assert time.perf_counter() - sent[0] < 4 * (sent[0] - begin)
    assert 1 < len(part.time) < 100_001


def test_what_is_refused(oscillator: gl.System) -> None:
    with pytest.raises(ArgumentError, match="on_interrupt"):
        oscillator.simulate(1.0, on_interrupt="ignore")
    with pytest.raises(ArgumentError, match="progress is 3; expected True, False, or a function"):
        oscillator.simulate(1.0, progress=3)
    with pytest.raises(ArgumentError, match="progress, a function, raised ZeroDivisionError"):
        oscillator.simulate(40.0, method="rk5", progress=lambda f, t: 1 / 0)
