"""The longest step of a run, from what could be missed in it; and whether the clock is fine enough."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.run.methods.run import Run, is_function
from gearlib.run.start_values import Start

TIMES = np.linspace(0.0, 20.0, 5)


class Driven(gl.Component):
    """A body under a torque; with a fan, so that steps are taken, and perhaps an event of its speed."""

    kind = gl.Structural("sine")
    event = gl.Structural(False)

    def assemble(self) -> list[Any]:
        drives: dict[str, Any] = {
            "sine": gl.sin(50.0 * gl.time), "constant": 3.0, "chirp": gl.sin(3.0 * gl.time**2), "open": None
        }  # fmt: skip
        drive = drives[self.kind]
        self.torque, self.body = gp.Torque() if drive is None else gp.Torque(tau=drive), gp.Inertia(J=1.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=1.0)
        links = [gl.connect(self.torque.flange, self.body.flange_a), gl.connect(self.fan.flange, self.body.flange_b)]
        if self.event:
            self.more = gp.Torque(tau=gl.Piecewise((1.0, self.body.w > 2.0), (0.0, True)))
            links.append(gl.connect(self.more.flange, self.body.flange_a))
        return links


def run(kind: str = "sine", event: bool = False, times: Any = TIMES, signals: tuple[Any, ...] = (), **more: Any) -> Run:
    scene = gl.compile(Driven(kind=kind, event=event)).translation.scene
    start = Start(np.zeros(len(scene.states)), np.zeros(scene.model.n_variables), ())
    numbers = scene.prepared(scene.model.parameters.defaults)
    return Run(scene, numbers, start, signals, np.asarray(times, float), 1e-6, None, **more)


def test_a_step_that_was_given_is_taken() -> None:
    own = run(max_step=7.0)
    assert (own.longest_step, own.longest_expanded_step, own.follows_samples) == (7.0, 7.0, "")


def test_half_a_period_of_the_fastest_sine_or_a_hundredth_of_the_run() -> None:
    """A sixteenth where events are searched for."""
    assert run().longest_step == pytest.approx(0.5 * math.tau / 50.0)
    assert run(event=True).longest_step == pytest.approx(math.tau / 50.0 / 16)
    assert run(times=[0.0, 1.0]).longest_step == pytest.approx(0.01)
    assert run("constant").longest_step == math.inf
    assert run("constant", event=True).longest_step == pytest.approx(0.2)
    assert run("constant", event=True, times=[3.0]).longest_step == math.inf
    assert (run().driven, run("constant").driven) == (True, False)


def test_series_see_sines_themselves_within_a_period() -> None:
    """Over several periods, the ends of a step may agree where the series shows nothing: beside a zero of a power of a sine."""
    assert run().longest_expanded_step == pytest.approx(math.tau / 50.0)
    assert run("constant").longest_expanded_step == math.inf
    assert run(event=True).longest_expanded_step == pytest.approx(math.tau / 50.0 / 16)
    assert run("constant", event=True).longest_expanded_step == pytest.approx(0.2)


def test_two_samples_where_the_shortest_pulse_is_not_known() -> None:
    """A Python function, or an expression without a rate; of samples 1/20 apart in a run of 20 s."""
    fine = np.linspace(0.0, 20.0, 401)
    signals = (lambda t: 1.0,)
    for own, why in (
        (run("open", times=fine, signals=signals), "torque.tau: a Python function, whose shortest pulse is not known"),
        (run("chirp", times=fine), "an expression of time whose shortest pulse is not known"),
    ):
        assert own.follows_samples == why
        assert own.longest_step == pytest.approx(0.1)
        assert own.longest_expanded_step == own.longest_step
        assert replace(own, times=TIMES).longest_step == pytest.approx(0.2)  # a hundredth of the run is less
        assert replace(own, max_step=1.0).follows_samples == ""
    assert run("open", signals=(2.0,)).follows_samples == ""
    table = gl.Table([0.0, 1.0], [0.0, 1.0])
    assert run("open", signals=(table,)).longest_step == math.inf
    assert [is_function(s) for s in (signals[0], 2.0, table)] == [True, False, False]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_clock_that_is_too_coarse(sign: float) -> None:
    """At 1e10 s its resolution is 2e-6 s; with a tolerance of 1e-6 and a hundred steps over 1 s that is too much."""
    late = np.sort(sign * np.array([1e10, 1e10 + 1.0]))
    said = run(times=late).coarse_clock(0)
    assert said.startswith(f"at t = 1e+10 s the clock's resolution is {math.ulp(1e10):.2g} s, too coarse for rtol=1e-06: ")
    assert run("constant", times=late).coarse_clock(0) == ""
    assert replace(run(times=late), rtol=1e-3).coarse_clock(0) == ""
    assert replace(run(times=late), rtol=1e-3).coarse_clock(10_000) != ""  # many short steps
    assert replace(run(times=late), rtol=1e-3).coarse_clock(500) == ""
    assert run(times=[1e10, 1e10]).coarse_clock(0) == ""
    assert run(times=[99.0, 100.1]).coarse_clock(10**12) == ""  # not late
    assert run(times=[0.0, 1.0]).coarse_clock(10**12) == ""


def test_a_run_without_states_or_discrete_variables_stands_still() -> None:
    class Nothing(gl.Component):
        x = gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.x, 2.0)]

    scene = gl.compile(Nothing()).translation.scene
    own = replace(run(), scene=scene)
    assert (own.still, run().still, own.handed, run().handed) == (True, False, None, None)
