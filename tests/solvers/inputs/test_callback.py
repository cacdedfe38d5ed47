"""Python functions as inputs: asked once for each time."""

from __future__ import annotations

import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError


class Driven(gl.Component):
    """Two torques on a body with a fan."""

    def assemble(self) -> list[Any]:
        self.one, self.other, self.body = gp.Torque(), gp.Torque(), gp.Inertia(J=0.5)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=5.0)
        flanges = [self.one.flange, self.other.flange, self.body.flange_a, self.fan.flange]
        return [gl.connect(*flanges)]


@pytest.mark.parametrize(("method", "share"), [("rk5", 5 / 6), ("rk8", 14 / 15), ("ida", 1.0)])
def test_asked_once_for_each_time(method: str, share: float) -> None:
    """The last two stages of an explicit step belong to one time."""
    asked: list[float] = []

    def torque(t: float) -> float:
        asked.append(t)
        return float(np.sin(3.0 * t))

    given: dict[str, Any] = {"samples": 101, "method": method, "rtol": 1e-7}
    found = gl.compile(Driven(), outputs=["body.w"]).simulate(4.0, inputs={"one.tau": torque, "other.tau": 0.5}, **given)
    expression = gl.compile(Driven(), outputs=["body.w"]).simulate(
        4.0, inputs={"one.tau": gl.Table(np.linspace(0.0, 4.0, 4001), np.sin(3.0 * np.linspace(0.0, 4.0, 4001)), "cubic"),
                     "other.tau": 0.5}, **given)  # fmt: skip
    assert found["body.w"] == pytest.approx(expression["body.w"], abs=1e-5)
    assert len(asked) <= share * found.stats["rhs"] + 12 + 21  # and samples that are remembered with the run


def test_two_functions_and_a_table() -> None:
    system = gl.compile(Driven(), outputs=["body.w"])
    both = system.simulate(2.0, inputs={"one.tau": lambda t: 1.0 + t, "other.tau": lambda t: -t}, samples=21, rtol=1e-9)
    mixed = system.simulate(2.0, inputs={"one.tau": lambda t: 1.0 + t, "other.tau": gl.Table([0.0, 2.0], [0.0, -2.0])},
                            samples=21, rtol=1e-9)  # fmt: skip
    alone = system.simulate(2.0, inputs={"one.tau": 1.0, "other.tau": 0.0}, samples=21, rtol=1e-9)
    assert both["body.w"] == pytest.approx(alone["body.w"], rel=1e-7)
    assert mixed["body.w"] == pytest.approx(alone["body.w"], rel=1e-7)


@pytest.mark.parametrize("method", ["rk5", "ida", "auto"])
def test_a_failure_ends_the_run(method: str) -> None:
    def torque(t: float) -> float:
        return 1.0 if t < 1.0 else 1.0 / 0.0

    with pytest.raises(ArgumentError, match=r"input one.tau, called with t = 1.* raised ZeroDivisionError"):
        gl.compile(Driven()).simulate(2.0, inputs={"one.tau": torque, "other.tau": 0.0}, method=method)


def test_an_interrupt_ends_the_run() -> None:
    def torque(t: float) -> float:
        if t > 1.0:
            raise KeyboardInterrupt
        return 1.0

    with pytest.raises(KeyboardInterrupt):
        gl.compile(Driven()).simulate(2.0, inputs={"one.tau": torque, "other.tau": 0.0})


def test_runs_in_threads_leave_the_process_as_it_was() -> None:
    """Filters of warnings, and what reports exceptions that nobody can catch, belong to all threads."""
    system = gl.compile(Driven(), outputs=["body.w"])
    hook, filters = sys.unraisablehook, list(warnings.filters)
    begun, ended = [threading.Event(), threading.Event()], threading.Event()

    def read(number: int) -> float:
        def torque(t: float) -> float:
            if t > 0.0 and not begun[number].is_set():
                begun[number].set()
                (ended if number else begun[1]).wait(30.0)  # the first run to begin is the first to end
            return 1.0

        if number:
            begun[0].wait(30.0)
        run = system.simulate(0.1, samples=3, inputs={"one.tau": torque, "other.tau": 0.0})
        if not number:
            ended.set()
        return float(run["body.phi"][-1])

    with ThreadPoolExecutor(2) as pool:
        one, other = pool.map(read, range(2))
    assert one == other > 0.0
    assert sys.unraisablehook is hook
    assert list(warnings.filters) == filters
