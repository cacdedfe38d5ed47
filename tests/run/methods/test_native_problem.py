"""Problems of runs: known event times, names of events, the costs of native functions and what is carried on."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.run.methods.native_problem import named_events, problem_of, time_events
from gearlib.run.methods.run import Run
from gearlib.run.start_values import Start
from gearlib.solvers.inputs.moving import Callbacks


class Timed(gl.Component):
    """Two conditions on time, at once or not, beside one on the speed."""

    first = gl.Parameter("s", default=0.25)
    second = gl.Parameter("s", default=0.5)
    conditions = gl.Structural(True)

    def assemble(self) -> list[Any]:
        self.open, self.body = gp.Torque(), gp.Inertia(J=1.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=1.0)
        links = [gl.connect(self.open.flange, self.body.flange_a), gl.connect(self.fan.flange, self.body.flange_b)]
        if self.conditions:
            self.one = gp.Torque(tau=gl.Piecewise((1.0, gl.time < self.first), (2.0, True)))
            self.two = gp.Torque(tau=gl.Piecewise((1.0, gl.time < self.second), (3.0, True)))
            self.three = gp.Torque(tau=gl.Piecewise((1.0, self.body.w < 5.0), (0.0, True)))
            links.append(gl.connect(self.one.flange, self.two.flange, self.three.flange, self.body.flange_a))
        return links


@cache
def timed() -> Any:
    return gl.compile(Timed()).translation


@cache
def plain() -> Any:
    return gl.compile(Timed(conditions=False)).translation


def run(model: Any = None, times: Any = (0.0, 1.0), signals: tuple[Any, ...] = (0.0,), **values: float) -> Run:
    translation = model or timed()
    scene = translation.scene
    start = Start(np.zeros(len(scene.states)), np.zeros(scene.model.n_variables), ())
    numbers = scene.prepared(translation.parameter_values(values))
    return Run(scene, numbers, start, signals, np.asarray(times, float), 1e-6, None)


def test_times_to_step_to_exactly() -> None:
    """Switches and corners after the start, in order and once; the end where something may happen there."""
    table = gl.Table([-1.0, 0.0, 0.25, 0.6, 0.6, 1.0, 2.0], [0.0, 1.0, 2.0, 3.0, 4.0, 0.0, 0.0])
    assert time_events(run()).tolist() == [0.25, 0.5]
    assert time_events(run(signals=(table,))).tolist() == [0.25, 0.5, 0.6, 1.0]
    assert time_events(run(plain(), signals=(table,))).tolist() == [0.25, 0.6]
    assert time_events(run(plain())).tolist() == []
    assert time_events(run(plain(), signals=())).tolist() == []
    assert time_events(run(times=(0.25, 0.5))).tolist() == [0.5]
    assert time_events(run(times=(0.3, 0.4))).tolist() == []
    assert time_events(run(times=(0.0, math.nextafter(0.5, 0.0)))).tolist() == [0.25, math.nextafter(0.5, 0.0)]  # at the end


def test_events_are_named_by_what_switches() -> None:
    """Both conditions where two switch at once; what jumps besides is an input."""
    own = run()
    assert named_events(own, solution([], [])) == []
    place = {name: k for k, name in enumerate(own.scene.root_names)}
    ((speed, k),) = [(name, k) for name, k in place.items() if name.startswith("three")]
    assert named_events(own, solution([0.4], [k])) == [(0.4, speed)]
    found = named_events(own, solution([0.25, 0.4, 0.5, 0.7], [-1, k, -1, -1]))
    assert [t for t, _ in found] == [0.25, 0.4, 0.5, 0.7]
    assert [name.split(":")[0] for _, name in found] == ["one", "three", "two", "an input"]
    both = named_events(run(second=0.25), solution([0.25], [-1]))
    assert [part.split(":")[0] for part in both[0][1].split("; ")] == ["one", "two"]
    assert named_events(run(plain()), solution([0.25], [-1])) == []


def solution(times: list[float], roots: list[int]) -> Any:
    from types import SimpleNamespace

    return SimpleNamespace(event_times=np.array(times, float), event_roots=np.array(roots, np.int64))


def test_functions_and_tables_make_calls_dearer() -> None:
    table = gl.Table([0.0, 1.0], [0.0, 1.0])
    plain, looked, asked = (problem_of(run(signals=(s,)), Callbacks(), jacobian=False) for s in (0.0, table, lambda t: 0.0))
    assert plain.rhs_cost > 15.0
    assert looked.rhs_cost - plain.rhs_cost == pytest.approx(30.0)
    assert asked.rhs_cost - plain.rhs_cost == pytest.approx(1500.0)
    for kind in ("jac_cost", "roots_cost", "update_cost"):
        assert getattr(looked, kind) - getattr(plain, kind) == pytest.approx(30.0)
        assert getattr(asked, kind) - getattr(plain, kind) == pytest.approx(1500.0)
    calls = plain.rhs_cost - 15.0
    with_jacobian = problem_of(run(), Callbacks(), jacobian=True)
    entries = with_jacobian.jac_cost - 15.0 - 3.0 * calls
    assert entries == pytest.approx(1.2 * timed().scene.native_with_jacobian.pattern.size, rel=1e-9)  # type: ignore[union-attr]
    assert plain.update_cost - 15.0 == pytest.approx(3.0 * (plain.roots_cost - 15.0))


def test_a_problem_is_that_of_its_run() -> None:
    own = replace(run(), atol=np.full(len(timed().scene.states), 1e-9), max_step=0.125, may_stop=True)
    found = problem_of(own, Callbacks(), jacobian=False)
    n = len(timed().scene.states)
    assert (found.n_roots, found.roots is not None, found.update is not None, found.jac) == (1, True, True, None)
    assert found.x0.tolist() == [0.0] * n
    assert found.differential.tolist() == [True] * n
    assert (found.rtol, found.longest_step, found.longest_expanded_step, found.may_stop) == (1e-6, 0.125, 0.125, True)
    assert found.absolute_tolerance.tolist() == [1e-9] * n
    assert found.state_names == timed().scene.state_names
    assert (found.implicit, found.may_leave, found.traced) == (False, False, None)
    assert found.max_steps == 100_000_000
    shared = timed().scene.native.shared
    assert (found.discrete.start, found.discrete.stop - found.discrete.start) == (shared.relations, shared.n_discrete)
    held = found.data[found.discrete]
    assert held[: timed().scene.model.n_relations].tolist().count(1.0) == 3  # all conditions hold at the start
    dae = problem_of(replace(own, form="dae"), Callbacks(), jacobian=True)
    assert dae.implicit
    assert dae.absolute_tolerance[:n].tolist() == [1e-9] * n
    assert len(dae.x0) > n
    assert dae.absolute_tolerance[n:] == pytest.approx(1e-6 * dae.nominal[n:])


def test_a_scene_without_states_has_a_constant_one() -> None:
    class Flag(gl.Component):
        on = gl.Discrete("1")
        y = gl.Variable("1")

        def equations(self) -> list[Any]:
            return [gl.Eq(self.y, self.on), gl.When(gl.time >= 0.5, gl.Eq(self.on, 1.0))]

    translation = gl.compile(Flag()).translation
    found = problem_of(run(translation, signals=()), Callbacks(), jacobian=False)
    assert (found.x0.tolist(), found.nominal.tolist(), found.time_events.tolist()) == ([1.0], [1.0], [0.5])
