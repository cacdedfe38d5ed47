"""Which runs keep their driver from one advance to the next."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import gearlib as gl
from gearlib.run.methods.method_table import METHODS
from gearlib.run.stepping.live_run import can_live
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
