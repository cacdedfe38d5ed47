"""Which runs keep their driver from one advance to the next."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

import gearlib as gl
from gearlib.run.methods.method_table import METHODS
from gearlib.run.stepping.live_run import LiveRun, can_live
from tests.run.methods.test_native_problem import run


@pytest.mark.parametrize(("method", "steps"), [("rk5", True), ("ida", True), ("exact", False), ("taylor", True)])
def test_a_driver_persists_where_the_method_takes_steps(method: str, steps: bool) -> None:
    """Not with tables, which have corners, and not without states."""
    own: Any = METHODS[method]
    assert can_live(run(), own) == steps
    assert can_live(run(signals=(lambda t: 0.0,)), own) == steps
    assert not can_live(run(signals=(gl.Table([0.0, 1.0], [0.0, 1.0]),)), own)
    none = gl.compile(Constant()).translation
    assert not can_live(run(none, signals=()), own)
    assert not can_live(replace(run(none, signals=()), max_step=0.1), own)


class Constant(gl.Component):
    y = gl.Variable("any")

    def equations(self) -> list[Any]:
        return [gl.Eq(self.y, 2.0 * gl.time)]


AWAY = [-40, -3, -1, 0, 1, 3, 5, 8, 10, 14, 17, 20, 25, 33, 40, 1000]  # units of rounding


@pytest.mark.parametrize("away", AWAY)
@pytest.mark.parametrize("after", [1, 2, 199, 200, 201, 202, 400])
def test_each_known_event_is_stepped_to_once(after: int, away: int) -> None:
    """In the advance that ends within rounding of it or beyond, however far ahead the times are computed."""
    h = 0.1
    event = after * h + away * math.ulp(after * h)
    live = LiveRun(run(times=(0.0, h), first=event, second=1e3), METHODS["rk5"])  # type: ignore[arg-type]
    live._new = False
    found = [(k, t) for k in range(1, 450) for t in live._time_events((k - 1) * h, k * h)]
    live.close()
    assert found in ([(after, min(event, after * h))], [(after + 1, event)])
    assert away > 3 or found[0][0] == after
    assert away < 33 or found[0][0] == after + 1


class Switched(gl.Component):
    at, x = gl.Parameter("s"), gl.Variable("any", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), gl.Piecewise((1.0, gl.time < self.at), (3.0, True)))]


@pytest.mark.parametrize("method", ["rk", "ida", "auto"])
@pytest.mark.parametrize(("h", "after"), [(0.1, 1), (0.1, 2), (0.25, 1), (0.5, 3)])
def test_what_switches_next_to_the_end_of_an_advance_is_not_missed(h: float, after: int, method: str) -> None:
    system = gl.compile(Switched(at=1.0))
    for away in AWAY:
        at = after * h + away * math.ulp(after * h)
        stepper = system.stepper(parameters={"at": at}, method=method)
        for k in range(1, 6):
            stepper.advance(k * h)
        assert float(stepper["x"]) == pytest.approx(15 * h - 2 * at, rel=1e-9), away
