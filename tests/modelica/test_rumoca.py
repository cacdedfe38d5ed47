"""Modelica text as rumoca sees it, a Modelica compiler that shares no code with gearlib: no diagnostics, and the same motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from tests.benchmarks.equations import RigidLoop
from tests.gearparts import msl_examples, msl_hybrid_examples

rumoca = pytest.importorskip("rumoca")

MODES: dict[str, dict[str, Any]] = {"classes": {"standard_library": False}, "flat": {"flat": True}}


class Bouncing(gl.Component):
    """A ball: a condition that gives a state a new value."""

    h = gl.Variable("m", "height", start=1.0)
    v = gl.Variable("m/s", "speed", start=0.0)
    n = gl.Discrete("bounces")

    def equations(self) -> list[Any]:
        hit = gl.reinit(self.v, -0.8 * self.v), gl.Eq(self.n, gl.pre(self.n) + 1)
        return [gl.Eq(gl.der(self.h), self.v), gl.Eq(gl.der(self.v), -9.81), gl.When(self.h < 0, *hit)]


@dataclass(frozen=True)
class Case:
    """What is simulated, how long, and what is compared."""

    make: Callable[[], gl.Component]
    t_end: float
    names: tuple[str, ...]


CASES = {
    "XP": Case(lambda: gp.ZhouCui2022(tau_in=100.0), 0.05, ("w_in", "w_out", "q_ring")),
    "M2": Case(RigidLoop, 1.0, ("carrier.w", "load.w")),
    "first": Case(msl_examples.first, 1.0, ("inertia3.w", "spring.tau")),
    "elastic bearing": Case(msl_examples.ElasticBearing, 2.0, ("housing.w",)),
    "rolling wheel": Case(msl_examples.RollingWheel, 2.0, ("inertia.w",)),
    "heat": Case(msl_examples.EddyCurrentBrake, 1.0, ("inertia.w", "heatCapacitor.T")),
    "brakes": Case(msl_examples.CompareBrakingTorque, 1.5, ("inertia1.w", "inertia4.w")),
    "backlash, with events": Case(msl_hybrid_examples.Backlash, 0.3, ("inertia2.w", "inertia3.w")),
    "bounces, with events": Case(Bouncing, 1.0, ("h", "v", "n")),
}
LONG = {"XP", "M2", "first", "elastic bearing"}


def compiled(component: gl.Component, mode: str) -> Any:
    text = gl.to_modelica(component, **MODES[mode])
    assert rumoca.validate_source(text) == []
    name = type(component).__name__
    return rumoca.Session().loads(text, model=name if mode == "flat" else f"{name}Package.{name}")


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("case", [pytest.param(c, marks=[pytest.mark.slow] if c in LONG else []) for c in CASES])
def test_rumoca_moves_it_alike(case: str, mode: str) -> None:
    component, t_end, names = CASES[case].make(), CASES[case].t_end, CASES[case].names
    expected = gl.compile(component, outputs=names).simulate(t_end, samples=11, rtol=1e-11)
    config = rumoca.SimConfig(solver="rk-like", rtol=1e-10, atol=1e-13, max_wall_seconds=60.0)
    found = compiled(CASES[case].make(), mode).simulate((0.0, t_end), dt=t_end / 10, config=config)
    times = np.asarray(found.time)
    for name in names:
        values = np.interp(expected.time, times, np.asarray(found[name.replace(".", "_") if mode == "flat" else name]))
        np.testing.assert_allclose(values, expected[name], rtol=0, atol=1e-6 * np.abs(expected[name]).max(), err_msg=name)


LOOP = """
model Loop "a relation that compares with what follows from it"
  Real torque = 2*time;
  Integer slides(start = 0, fixed = true);
equation
  slides = if torque*(1 + 0.1*slides) > 1 then 1 else 0;
end Loop;
"""


def test_what_rumoca_refuses_of_friction_is_an_event_iteration() -> None:
    """Discrete variables that follow from each other at one instant, as in our friction: refused in the smallest model, too."""
    with pytest.raises(rumoca.CompileError, match=r"slides.* participates in an internal current-value dependency cycle"):
        rumoca.Session().loads(LOOP, model="Loop")
    result = gl.simulate(gl.read_modelica(LOOP)(), 1.0, times=[0.0, 0.4, 0.6, 1.0])
    assert list(result["slides"]) == [0, 0, 1, 1]
    for mode in MODES:
        with pytest.raises(
            rumoca.CompileError, match=r"start_forward.* participates in an internal current-value dependency cycle"
        ):
            compiled(msl_hybrid_examples.SimpleGearShift(), mode)
