"""Runs that go on with other states: where they begin, with which samples and tolerances, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SolverError
from gearlib.run.methods.method_table import METHODS, integrate
from gearlib.run.methods.run import Run
from gearlib.run.state_switching import integrate_through
from tests.run.test_constrained import Pendulum, swing


class Watched(Pendulum):
    """With a decay beside it, the number of times that it came to the left, and a push that may end."""

    y = gl.Variable("m", "vertical", nominal=4.0)
    z = gl.Variable("m", "decays", start=1.0)
    rate = gl.Parameter("1/s", default=0.5)
    way, far, rate_of_far = gl.Variable("m"), gl.Variable("m2"), gl.Variable("m2/s")  # which nothing depends on
    left = gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.way), self.u), gl.Eq(self.far, self.way**2), gl.Eq(self.rate_of_far, gl.der(self.far)),
            gl.Eq(gl.der(self.z), -self.rate * self.z),
            gl.When(self.x < 0.0, gl.Eq(self.left, gl.pre(self.left) + 1.0)),
        ]  # fmt: skip


ANGLE = 1.7  # rad, at which it is released; its states change on the way, since its height is one of them at first


@cache
def translation() -> Any:
    return gl.compile(
        Watched(start={"x": np.sin(ANGLE), "y": -np.cos(ANGLE), "u": 0.0, "v": 0.0}), outputs=["x", "y", "z", "left"]
    ).translation


def run(times: Any, **more: Any) -> Run:
    scene = translation().scene
    begin = translation().start(scene, scene.model.parameters.defaults, float(times[0]), None, ())
    numbers = scene.prepared(scene.model.parameters.defaults)
    given = {"rtol": 1e-9, "atol": None, "discrete": begin.discrete, **more}
    return Run(scene, numbers, begin, (), np.asarray(times, float), **given)


TIMES = np.linspace(0.0, 2.0, 9)


@pytest.mark.parametrize("method", ["ida", "rk5"])
def test_each_part_begins_where_the_one_before_ended(method: str) -> None:
    """With the samples that are left, the discrete state, and states of the same motion."""
    switched: dict[Any, Any] = {}
    parts = integrate_through(run(TIMES), METHODS[method], switched)
    assert len(parts) > 1
    assert parts[-1][1].t_last == 2.0
    left = np.concatenate([part.times[k > 0 :] for k, (part, _) in enumerate(parts)])
    assert np.unique(left).tolist() == TIMES.tolist()
    for (_, before), (after, solution) in zip(parts[:-1], parts[1:], strict=True):
        t = before.t_last
        assert after.times.tolist() == [t, *TIMES[t < TIMES]]
        assert switched[after.scene.states] is after.scene
        found = dict(zip(after.scene.state_names, solution.x[0], strict=True))
        angle = float(swing(ANGLE, t))
        for name, value in (("x", np.sin(angle)), ("y", -np.cos(angle)), ("z", np.exp(-0.5 * t))):
            assert found.get(name, value) == pytest.approx(value, abs=1e-6)
        assert after.discrete is not None
        place = after.scene.model.n_relations + list(after.scene.model.discretes).index("left")
        assert after.discrete[place] == (angle < 0.0)
    again = integrate_through(run(TIMES), METHODS[method], switched)
    assert [part.scene for part, _ in again[1:]] == [part.scene for part, _ in parts[1:]]


def test_tolerances_go_on_with_the_states() -> None:
    """Those of states that stay; of others the least share of a nominal value that any of the states had."""
    names = translation().scene.state_names
    given = {name: 1e-6 for name in names} | {"z": 3e-4}
    parts = integrate_through(run(TIMES, atol=np.array([given[name] for name in names])), METHODS["ida"], {})
    share = min(given[name] / nominal for name, nominal in zip(names, translation().scene.nominal, strict=True))
    later = parts[1][0]
    assert later.atol is not None
    assert set(later.scene.state_names) != set(names)
    for name, nominal, atol in zip(later.scene.state_names, later.scene.nominal, later.atol, strict=True):
        assert atol == pytest.approx(given.get(name, share * nominal)), name
    assert integrate_through(run(TIMES), METHODS["ida"], {})[1][0].atol is None


def test_tangents_do_not_go_on() -> None:
    start = {"x": np.sin(ANGLE), "y": -np.cos(ANGLE), "u": 0.0, "v": 0.0}
    system = gl.compile(Pendulum(start=start))
    with pytest.raises(
        SolverError, match=r"^there are no sensitivities after t = 0\.\d+ s: the states \(.*\) determine the motion no"
    ):
        system.simulate(2.0, samples=3, method="ida", sensitivities=["g"])


@pytest.mark.parametrize(("stuck", "fails"), [((), False), ((0,), False), ((1,), True), ((2,), True), ((0, 2), True)])
def test_a_segment_without_progress_ends_the_run_unless_it_is_the_first(
    stuck: tuple[int, ...], fails: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The states in use at the start may be singular there; those chosen for the rest must last."""
    done: list[Any] = []

    def halting(part: Run, method: Any) -> Any:
        if len(done) in stuck:
            found = replace(integrate(replace(part, times=part.times[:1]), method), status="left")
        else:
            found = integrate(part, method)
        done.append(part)
        return found

    monkeypatch.setattr("gearlib.run.state_switching.integrate", halting)
    if fails:
        with pytest.raises(SolverError, match=r"^the right-hand side cannot be evaluated beyond t = [\d.]+ s\b"):
            integrate_through(run(TIMES), METHODS["ida"], {})
        assert len(done) == stuck[-1] + 1
    else:
        last, solution = integrate_through(run(TIMES), METHODS["ida"], {})[-1]
        found = dict(zip(last.scene.state_names, solution.x_last, strict=True))
        assert found["z"] == pytest.approx(np.exp(-0.5 * 2.0), abs=1e-6)
