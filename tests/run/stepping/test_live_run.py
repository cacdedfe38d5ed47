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


@pytest.mark.parametrize("away", [-40, -3, -1, 0, 1, 3, 40])
@pytest.mark.parametrize("after", [1, 199, 200, 201, 400])
def test_each_known_event_is_stepped_to_once(after: int, away: int) -> None:
    """In the advance that ends within rounding of it or beyond, however far ahead the times are computed."""
    h = 0.1
    event = after * h + away * math.ulp(after * h)
    live = LiveRun(run(times=(0.0, h), first=event, second=1e3), METHODS["rk5"])  # type: ignore[arg-type]
    found = {k: list(live._time_events((k - 1) * h, k * h)) for k in range(1, 450)}
    live.close()
    expected = (after + 1, event) if away == 40 else (after, min(event, after * h))
    assert [(k, t) for k, times in found.items() for t in times] == [expected]
