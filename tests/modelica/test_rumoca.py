"""Modelica text as rumoca sees it, a Modelica compiler that shares no code with gearlib: no diagnostics, and the same motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from tests.benchmarks.equations import RigidLoop
from tests.gearparts import msl_examples, msl_hybrid_examples

rumoca = pytest.importorskip("rumoca")

MODES: dict[str, dict[str, Any]] = {"classes": {"standard_library": False}, "flat": {"flat": True}, "the standard library": {}}
LIBRARY = Path(__file__).with_name("standard_library.mo")  # written by hand: names and equations that our classes do not enter
B = gp.blocks


class Bouncing(gl.Component):
    """A ball: a condition that gives a state a new value."""

    h = gl.Variable("m", "height", start=1.0)
    v = gl.Variable("m/s", "speed", start=0.0)
    n = gl.Discrete("bounces")

    def equations(self) -> list[Any]:
        hit = gl.reinit(self.v, -0.8 * self.v), gl.Eq(self.n, gl.pre(self.n) + 1)
        return [gl.Eq(gl.der(self.h), self.v), gl.Eq(gl.der(self.v), -9.81), gl.When(self.h < 0, *hit)]


class Counting(gl.Component):
    """Conditions with precedence: ``elsewhen``."""

    x = gl.Variable("1", start=0.0)
    n = gl.Discrete("changes")
    last = gl.Discrete("which one")

    def equations(self) -> list[Any]:
        third = gl.When(self.x > 0.75, gl.Eq(self.n, gl.pre(self.n) + 100), gl.Eq(self.last, 3))
        second = gl.When(self.x > 0.55, gl.Eq(self.n, gl.pre(self.n) + 10), elsewhen=third)
        return [gl.Eq(gl.der(self.x), 1.0), gl.When(self.x > 0.25, gl.Eq(self.n, gl.pre(self.n) + 1), elsewhen=second)]


class SpeedControl(gl.Component):
    """Blocks in a loop, each joined to one that is made later, an array of them to itself; a condition as a signal."""

    def assemble(self) -> list[gl.Connection]:
        self.error, self.gains = B.Feedback(), [B.Gain(k=2.0), B.Gain(k=3.0)]
        self.pi, self.torque, self.load = B.PI(k=2.0, T=0.5), gp.Torque(), gp.Inertia(J=2.0, start={"w": 0.0, "phi": 0.0})
        self.speed, self.reference, self.lag = gp.SpeedSensor(), B.Step(start_time=0.1), B.FirstOrder(T=0.05)
        self.weak = B.Switch(u3=self.pi.y)
        self.late = B.BooleanExpression(expression=gl.Piecewise((1, gl.time > 1.25), (0, True)))
        self.half = B.RealExpression(expression=self.pi.y / 2)
        return [
            gl.connect(self.reference.y, self.error.u1), gl.connect(self.lag.y, self.error.u2), gl.connect(self.speed.w, self.lag.u),
            gl.connect(self.error.y, self.gains[0].u), gl.connect(self.gains[0].y, self.gains[1].u),
            gl.connect(self.gains[1].y, self.pi.u), gl.connect(self.half.y, self.weak.u1), gl.connect(self.late.y, self.weak.u2),
            gl.connect(self.weak.y, self.torque.tau), gl.connect(self.torque.flange, self.load.flange_a, self.speed.flange),
        ]  # fmt: skip


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
    "elsewhen": Case(Counting, 1.0, ("n", "last")),
    "speed control": Case(SpeedControl, 2.0, ("load.w", "pi.y")),
}
LONG = {"XP", "M2", "first", "elastic bearing"}
IN_LIBRARY = (
    "XP",
    "M2",
    "first",
    "rolling wheel",
    "speed control",
)  # written with parts of the standard library that the file has


def compiled(component: gl.Component, mode: str) -> Any:
    text = gl.to_modelica(component, **MODES[mode])
    if not MODES[mode]:
        assert "Modelica.Mechanics.Rotational.Components" in text
        text = f"{LIBRARY.read_text()}\n{text}"
    assert rumoca.validate_source(text) == []
    name = type(component).__name__
    return rumoca.Session().loads(text, model=name if mode == "flat" else f"{name}Package.{name}")


RUNS = [(case, mode) for case in CASES for mode in MODES if MODES[mode] or case in IN_LIBRARY]


@pytest.mark.parametrize(
    ("case", "mode"), [pytest.param(*run, marks=[pytest.mark.slow] if run[0] in LONG else []) for run in RUNS]
)
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
    for mode in ("classes", "flat"):
        with pytest.raises(
            rumoca.CompileError, match=r"(start_forward|is_held).* participates in an internal current-value dependency cycle"
        ):
            compiled(msl_hybrid_examples.SimpleGearShift(), mode)
