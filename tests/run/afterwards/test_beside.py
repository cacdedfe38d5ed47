"""States that a run did not integrate, computed from the ends of its steps: right, whatever was asked for, and without another run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.run import state_switching
from gearlib.run.afterwards import beside
from gearlib.solvers.drive import trace
from gearlib.solvers.drive.trace import Trace

METHODS = ("auto", "rk5", "rk8", "ida", "taylor")


class Integrals(gl.Component):
    """x = 1 / (1 + t); y is its integral, z the integral of x y, which is y**2 / 2; ``slow`` follows y, and depends on itself."""

    x = gl.Variable("1", "fed by nothing", start=1.0)
    y = gl.Variable("1", "integral of x")
    z = gl.Variable("1", "integral of an integral")
    slow = gl.Variable("1", "depends on itself")
    fast = gl.Variable("1", "with a drive of its own")
    omega = gl.Parameter("rad/s", "of that drive", default=3.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), -(self.x**2)),
            gl.Eq(gl.der(self.y), self.x),
            gl.Eq(gl.der(self.z), self.x * self.y),
            gl.Eq(gl.der(self.slow), self.y - self.slow),
            gl.Eq(gl.der(self.fast), gl.cos(self.omega * gl.time) * self.x**2),
        ]


class Rattling(gl.Component):
    """A driven pair with backlash and a fan; all angles but that in the mesh are integrals."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=2 + 6 * gl.sin(40 * gl.time))
        self.first, self.second = gp.Inertia(J=0.01), gp.Inertia(J=0.05)
        self.mesh = gp.ElastoBacklash(c=2e3, d=0.5, b=4e-3)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-2.0, w_nominal=30.0)
        c = gl.connect
        return [
            c(self.torque.flange, self.first.flange_a),
            c(self.first.flange_b, self.mesh.flange_a),
            c(self.mesh.flange_b, self.second.flange_a),
            c(self.second.flange_b, self.fan.flange),
        ]


@pytest.fixture
def integrations(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of states of the runs that are integrated."""
    found: list[int] = []
    original = state_switching.integrate

    def counted(run: Any, method: Any) -> Any:
        found.append(len(run.scene.states))
        return original(run, method)

    monkeypatch.setattr(state_switching, "integrate", counted)
    return found


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("samples", [2, 401])
def test_integrals_in_closed_form_without_another_run(method: str, samples: int, integrations: list[int]) -> None:
    result = gl.compile(Integrals(), outputs=["x"]).simulate(5.0, samples=samples, method=method, rtol=1e-8)
    before = dict(result.stats)
    y = np.log1p(result.time)
    assert result["z"] == pytest.approx(0.5 * y**2, rel=1e-7, abs=1e-8)  # and y, which it needs, on the way
    assert result["y"] == pytest.approx(y, rel=1e-7, abs=1e-8)
    assert integrations == [1]
    assert result.stats == before


@pytest.fixture
def traces(monkeypatch: pytest.MonkeyPatch) -> list[Trace]:
    """Traces of the runs that are integrated."""
    found: list[Trace] = []
    original = state_switching.integrate

    def kept(run: Any, method: Any) -> Any:
        solution = original(run, method)
        if solution.trace is not None:
            found.append(solution.trace)
        return solution

    monkeypatch.setattr(state_switching, "integrate", kept)
    return found


@pytest.mark.parametrize("method", METHODS)
def test_states_and_slopes_of_the_trace_in_closed_form(method: str, traces: list[Trace]) -> None:
    gl.compile(Integrals(), outputs=["x"]).simulate(5.0, samples=2, method=method, rtol=1e-9)
    (trace,) = traces
    x = 1 / (1 + trace.times)
    assert trace.states[:, 0] == pytest.approx(x, abs=1e-8)
    assert trace.rates[:, 0] == pytest.approx(-(x**2), abs=1e-6)
    assert np.diff(trace.times).max() < 2.0  # long steps have rows within


@pytest.mark.parametrize("method", METHODS)
def test_slopes_before_an_event_belong_to_its_time(method: str, traces: list[Trace]) -> None:
    """Forces of a soft contact do not jump: the slopes after the event are those before it."""
    gl.compile(Rattling(), outputs=["mesh.tau"]).simulate(0.6, samples=2, method=method, rtol=1e-6)
    (trace,) = traces
    before = np.flatnonzero(np.diff(trace.times) == 0.0)
    assert len(before) > 10
    assert trace.states[before] == pytest.approx(trace.states[before + 1], rel=1e-12)
    size = np.abs(trace.rates).max()
    assert trace.rates[before] == pytest.approx(trace.rates[before + 1], abs=1e-3 * size)


@pytest.mark.parametrize("omega", [3.0, 3000.0])
def test_a_drive_that_the_run_did_not_see(omega: float) -> None:
    """The steps are long beside its period: finer ones are taken, or the run is repeated."""
    given: dict[str, Any] = {"samples": 11, "parameters": {"omega": omega}, "rtol": 1e-8}
    found = gl.compile(Integrals(), outputs=["x"]).simulate(2.0, **given)["fast"]
    assert found == pytest.approx(gl.compile(Integrals(), outputs=["fast"]).simulate(2.0, **given)["fast"], abs=1e-7)


def test_what_depends_on_itself_is_integrated_with_the_rest(integrations: list[int]) -> None:
    result = gl.compile(Integrals(), outputs=["x"]).simulate(2.0, samples=5, rtol=1e-9)
    right = gl.compile(Integrals(), outputs=["slow"]).simulate(2.0, samples=5, rtol=1e-12)["slow"]
    assert result["slow"] == pytest.approx(right, rel=1e-8)
    assert integrations[1:] == [3, 3]  # x, y and slow


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
def test_values_do_not_depend_on_what_was_asked_for(method: str, rtol: float) -> None:
    names = ["first.phi", "second.phi", "mesh.phi_rel", "fan.tau"]
    some = gl.compile(Rattling(), outputs=["mesh.tau"]).simulate(0.6, method=method, rtol=rtol)
    every = gl.compile(Rattling(), outputs=["mesh.tau", *names]).simulate(0.6, method=method, rtol=rtol)
    assert len(some.events) > 10
    for name in names:
        size = np.abs(every[name]).max()
        assert some[name] == pytest.approx(every[name], abs=30 * rtol * size), name


def test_events_are_counted_once_and_nothing_is_integrated_again(integrations: list[int]) -> None:
    result = gl.compile(Rattling(), outputs=["mesh.tau"]).simulate(0.6)
    events, rhs = len(result.events), result.stats["rhs"]
    for name in ("first.phi", "second.phi", "torque.flange.phi"):
        assert np.isfinite(result[name]).all()
    assert len(integrations) == 1
    assert (len(result.events), result.stats["rhs"]) == (events, rhs)


def test_one_by_one_and_together_are_the_same() -> None:
    names = ["first.phi", "second.phi"]
    one = gl.compile(Rattling(), outputs=["mesh.tau"]).simulate(0.3)
    both = gl.compile(Rattling(), outputs=["mesh.tau"]).simulate(0.3)
    table = both.to_dataframe(names)
    for name in names:
        assert one[name] == pytest.approx(table[name].to_numpy(), rel=1e-9, abs=1e-12)


def test_a_run_too_long_to_keep_is_repeated(monkeypatch: pytest.MonkeyPatch, integrations: list[int]) -> None:
    system = gl.compile(Rattling(), outputs=["mesh.tau"])
    kept = system.simulate(0.3)["first.phi"]
    monkeypatch.setattr(trace, "MOST", 500)
    assert system.simulate(0.3)["first.phi"] == pytest.approx(kept, abs=1e-5 * np.abs(kept).max())
    assert len(integrations) == 3


def test_a_doubtful_answer_is_not_given(monkeypatch: pytest.MonkeyPatch, integrations: list[int]) -> None:
    monkeypatch.setattr(beside, "AGREE", 1e-12)
    result = gl.compile(Rattling(), outputs=["mesh.tau"]).simulate(0.3)
    assert np.isfinite(result["first.phi"]).all()
    assert len(integrations) == 2


def test_a_continued_run(integrations: list[int]) -> None:
    system = gl.compile(Integrals(), outputs=["x"])
    half = system.simulate(1.0, samples=3, rtol=1e-8)
    rest = system.simulate(3.0, samples=3, rtol=1e-8, start=half)
    assert rest["z"] == pytest.approx(0.5 * np.log1p(rest.time) ** 2, rel=1e-7)
    assert integrations == [1, 1]


def test_inputs_and_energies() -> None:
    """Work put in, as an integral that nothing needs, with a table for the torque."""

    class Work(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.body, self.fan = (
                gp.Torque(), gp.Inertia(J=0.1), gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=10.0),
            )  # fmt: skip
            return [gl.connect(self.torque.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.fan.flange)]

        work = gl.Variable("J", "put in")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.work), self.torque.tau * self.body.w)]

    table = gl.Table(np.linspace(0.0, 2.0, 9), [0.0, 2.0, 1.0, 3.0, 0.0, -1.0, 2.0, 0.5, 0.0])
    given: dict[str, Any] = {"inputs": {"torque.tau": table}, "samples": 21, "rtol": 1e-8}
    few = gl.compile(Work(), outputs=["body.w"]).simulate(2.0, **given)
    all_ = gl.compile(Work(), outputs=["work"]).simulate(2.0, **given)
    assert few["work"] == pytest.approx(all_["work"], rel=1e-7, abs=1e-8)


class Wrapped(gl.Component):
    """x is set back to 0 where it reaches 1; at the same events z is set to 5, and n, the rate of c, rises by one."""

    x, z, c = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0), gl.Variable("1", start=0.0)
    n = gl.Discrete(start=1.0)

    def equations(self) -> list[Any]:
        rise = gl.Eq(self.n, gl.pre(self.n) + 1)
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.Eq(gl.der(self.z), 2.0),
            gl.Eq(gl.der(self.c), self.n),
            gl.When(self.x >= 1.0, gl.reinit(self.x, 0.0), gl.reinit(self.z, 5.0), rise),
        ]


@pytest.mark.parametrize("method", METHODS)
def test_what_events_set_beside_the_states_of_a_run(method: str) -> None:
    """Also where the run had the same events."""
    times = np.array([0.0, 0.5, 1.5, 2.25, 2.75])
    result = gl.compile(Wrapped(), outputs=["x"]).simulate(2.75, times=times, method=method)
    assert result["x"] == pytest.approx(times % 1.0, abs=1e-9)
    assert result["z"] == pytest.approx([0.0, 1.0, 6.0, 5.5, 6.5], abs=1e-9)
    assert result["c"] == pytest.approx([0.0, 0.5, 2.0, 3.75, 5.25], abs=1e-9)
