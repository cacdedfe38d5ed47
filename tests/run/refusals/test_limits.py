"""A variable with a least value: starts below it, runs that a reinit takes there, and steady states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import SolverError, StartError

METHODS = ["rk5", "rk8", "ida", "auto"]


class Overrun(gl.Component):
    """Two bodies and a freewheel between them; a torque drives the one that may overrun."""

    pressed = gl.Parameter("1", "normal force over the largest one", default=1.0)
    tau = gl.Parameter("N.m", "on the second body", default=1.0)

    def assemble(self) -> list[Any]:
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.clutch, self.torque = gp.OneWayClutch(fn_max=10.0, f_normalized=self.pressed), gp.Torque(tau=self.tau)
        return [
            gl.connect(self.a.flange_b, self.clutch.flange_a),
            gl.connect(self.clutch.flange_b, self.b.flange_a),
            gl.connect(self.torque.flange, self.b.flange_b),
        ]


class Kicked(gl.Component):
    """A freewheel to a wall, and a blow to the shaft."""

    blow = gl.Parameter("rad/s", "speed after the blow")

    def assemble(self) -> list[Any]:
        self.wall, self.clutch = gp.Fixed(), gp.OneWayClutch(fn_max=10.0, f_normalized=0.0)
        self.shaft = Struck(blow=self.blow)
        return [gl.connect(self.wall.flange, self.clutch.flange_a), gl.connect(self.clutch.flange_b, self.shaft.flange)]


class Struck(gl.Component):
    flange = gp.Flange()
    blow = gl.Parameter("rad/s", "speed after the blow")
    J = gl.Parameter("kg.m2", "inertia", default=1.0)
    w = gl.Variable("rad/s", "speed", start=1.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.flange.phi), self.w),
            gl.Eq(self.J * gl.der(self.w), self.flange.tau),
            gl.When(gl.time >= 0.5, gl.reinit(self.w, self.blow)),
        ]


BELOW = r"clutch\.w_rel is -5 rad/s \(relative speed; flange_a cannot overtake flange_b\), but it cannot be below 0 at t = 0 s; choose"


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("pressed", [0.0, 1.0])
def test_start_in_the_forbidden_sense_is_refused(method: str, pressed: float) -> None:
    system = gl.compile(Overrun())
    for start in ({"a.w": 5.0, "b.w": 0.0}, {"a.w": 1.0, "b.w": -4.0}, {"clutch.w_rel": -5.0}):
        with pytest.raises(StartError, match=BELOW):
            system.simulate(1.0, samples=5, method=method, start=start, parameters={"pressed": pressed})
    for start in ({"a.w": 5.0, "b.w": 5.0}, {"a.w": 2.0, "b.w": 3.0}, {"a.w": 0.1, "b.w": 0.1 + 1e-17}):
        system.simulate(1.0, samples=5, method=method, start=start, parameters={"pressed": pressed})


@pytest.mark.parametrize("method", METHODS)
def test_a_start_is_checked_without_a_sample_there(method: str) -> None:
    """Whatever the samples and the tolerance are."""
    system = gl.compile(Overrun(), outputs=["clutch.w_rel"])
    for options in ({"times": [0.5, 1.0]}, {"times": [1.0], "rtol": 0.1}, {"samples": 3, "rtol": 0.1}):
        for start in ({"a.w": 5.0, "b.w": 0.0}, {"a.w": 1e-6, "b.w": 0.0}):
            with pytest.raises(StartError, match=r"clutch\.w_rel is -\S+ rad/s .* at t = 0 s; choose start values"):
                system.simulate(1.0, method=method, start=start, **options)
        system.simulate(1.0, method=method, start={"a.w": 5.0, "b.w": 5.5}, **options)


def test_an_operating_point_is_checked() -> None:
    system = gl.compile(Overrun(), outputs=["clutch.w_rel"])
    for analysis in (system.linearize, lambda **options: gl.stability(system, **options)):
        analysis(at={"a.w": 1.0, "b.w": 3.0})
        with pytest.raises(StartError, match=r"clutch\.w_rel is -2 rad/s .* at t = 0 s; choose start values"):
            analysis(at={"a.w": 3.0, "b.w": 1.0})


@pytest.mark.parametrize("method", METHODS)
def test_reinit_in_the_forbidden_sense_is_refused(method: str) -> None:
    system = gl.compile(Kicked(blow=2.0))
    assert system.simulate(1.0, samples=5, method=method)["clutch.w_rel"] == pytest.approx([1.0, 1.0, 2.0, 2.0, 2.0])
    with pytest.raises(SolverError, match=r"clutch\.w_rel is -2 rad/s .* at t = 0\.5 s; only a reinit, .* take it there"):
        system.simulate(1.0, samples=5, method=method, parameters={"blow": -2.0})


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("size", [1e3, 1e5])
def test_what_rounding_leaves_of_a_fast_freewheel_is_no_fault_in_steps(method: str, size: float) -> None:
    """It is relative to the speeds before; locked, the shafts pass through standstill. By hand as below."""
    given = {"parameters": {"tau": -3.0 * size, "pressed": 0.1 * size}, "start": {"a.w": size, "b.w": 2.0 * size}}
    run, met = gl.compile(Overrun(), outputs=["a.w", "clutch.w_rel"]).stepper(method=method, rtol=1e-11, **given), 1 / 2.25
    for t in np.linspace(0.1, 2.0, 20).tolist():
        run.advance(t)
        assert run["a.w"] == pytest.approx(size * (1.0 + 0.5 * min(t, met) - max(0.0, t - met)), abs=1e-8 * size)
    assert run["clutch.w_rel"] == pytest.approx(0.0, abs=1e-12 * size)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
def test_locked_and_unlocked_again_and_gone_on_is_right(method: str, rtol: float) -> None:
    """Overruns, is caught up with, and carries the torque then: what rounding leaves of a locked clutch's speed is no fault."""
    system = gl.compile(Overrun(tau=-3.0, pressed=0.1))
    first = system.simulate(2.0, samples=21, method=method, rtol=rtol, start={"a.w": 1.0, "b.w": 2.0})
    # sliding torque 0.5: a' = 0.5, b' = (-3 - 0.5) / 2 until they meet at 1 / 2.25 s, then -1 for both
    met = 1 / 2.25
    assert first["a.w"][-1] == pytest.approx(1.0 + 0.5 * met - (2.0 - met), abs=10 * rtol)
    second = system.simulate(3.0, samples=21, method=method, rtol=rtol, start=first, parameters={"tau": -6.0, "pressed": 0.1})
    assert second["b.w"][-1] == pytest.approx(first["b.w"][-1] - 2.0, abs=20 * rtol)


def random_train(seed: int) -> gl.Component:
    """A chain of bodies with springs, freewheels and loads that grow with the speed."""
    rng = np.random.default_rng(seed)

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            n = int(rng.integers(2, 5))
            self.bodies = [gp.Inertia(J=float(rng.uniform(0.1, 2.0))) for _ in range(n)]
            self.torques = [gp.Torque(tau=float(rng.uniform(-8.0, 8.0))) for _ in range(n)]
            self.wall = gp.Fixed()
            self.drags = [gp.Damper(d=float(rng.uniform(0.2, 2.0))) for _ in range(n)]
            self.links: list[Any] = []
            joints = []
            for k in range(n):
                joints += [
                    gl.connect(self.torques[k].flange, self.bodies[k].flange_a),
                    gl.connect(self.bodies[k].flange_b, self.drags[k].flange_a),
                    gl.connect(self.drags[k].flange_b, self.wall.flange),
                ]
            links = []
            for _ in range(n - 1):
                if rng.random() < 0.7:
                    links.append(
                        gp.OneWayClutch(fn_max=float(rng.uniform(0.5, 6.0)), f_normalized=float(rng.choice([0.0, 1.0])))
                    )
                else:
                    links.append(gp.SpringDamper(c=float(rng.uniform(10.0, 100.0)), d=float(rng.uniform(0.5, 2.0))))
            self.links = links
            for k in range(n - 1):
                left, right = (k, k + 1) if rng.random() < 0.5 else (k + 1, k)
                joints += [
                    gl.connect(self.bodies[left].flange_b, links[k].flange_a),
                    gl.connect(links[k].flange_b, self.bodies[right].flange_a),
                ]
            return joints

    return Train()


@pytest.mark.parametrize("seed", [0, 2, 3, 5, 7, 8, 9, 11])  # trains with freewheels in different arrangements
def test_steady_state_of_freewheels_is_where_the_train_goes(seed: int) -> None:
    system = gl.compile(random_train(seed))
    names = [n for n in system.variables if n.startswith("bodies[") and n.endswith("].w")]
    later = system.simulate(200.0, times=[0.0, 200.0], rtol=1e-9)
    steady = system.simulate(0.1, times=[0.0], start="steady")
    for name in names:
        assert steady[name][0] == pytest.approx(later[name][-1], rel=1e-5, abs=1e-6), name


def test_an_operating_point_is_checked_at_its_own_time() -> None:
    """At 0 s, where the state is -0.5 and what is bounded is time before it."""

    class Late(gl.Component):
        rate = gl.Parameter("1/s", default=1.0)
        x = gl.Variable("s", "state", start=-0.5)
        late = gl.Variable("s", "time after the state", min=0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), -self.rate * self.x), gl.Eq(self.late, self.x + gl.time)]

    with pytest.raises(StartError, match=r"late is -0\.5 s .* at t = 0 s"):
        gl.compile(Late()).linearize()
