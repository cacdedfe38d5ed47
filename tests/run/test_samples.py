"""`gl.sample`: exact instants, no drift; discrete variables bound to inputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, DeclarationError


class Counter(gl.Component):
    """Counts instants, and takes samples of a variable."""

    period = gl.Parameter("s", "period", default=0.1)
    offset = gl.Parameter("s", "first instant", default=0.0)
    x = gl.Variable("1", "a clock", start=0.0)
    n = gl.Discrete("instants so far")
    held = gl.Discrete("the clock at the last instant")

    def equations(self) -> list[Any]:
        instant = gl.sample(self.period, self.offset)
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.When(instant, gl.Eq(self.n, gl.pre(self.n) + 1), gl.Eq(self.held, self.x)),
        ]


@pytest.fixture(scope="module")
def counter() -> gl.System:
    return gl.compile(Counter())


@pytest.mark.parametrize("method", ["auto", "rk8", "ida"])
def test_instants_are_exact(counter: gl.System, method: str) -> None:
    r = counter.simulate(12.05, times=[0.2, 5.0, 12.05], method=method, parameters={"offset": 0.3})
    assert [t for t, _ in r.events] == [t for t in (0.3 + 0.1 * np.arange(200)).tolist() if t <= 12.05]
    assert r["n"].tolist() == [0.0, 48.0, 118.0]
    assert r["held"][-1] == pytest.approx(12.0)


@pytest.mark.parametrize("t_start", [0.0, 0.05, 0.2, 1e6 + 0.05, 12345.6])
def test_a_start_counts_if_it_is_an_instant(counter: gl.System, t_start: float) -> None:
    r = counter.simulate(t_start + 1.0, t_start=t_start, times=[t_start, t_start + 0.98])
    begins = abs(t_start / 0.1 - round(t_start / 0.1)) < 1e-6
    assert r["n"][0] == begins
    assert r["n"][1] == begins + np.floor((t_start + 0.98) / 0.1 + 1e-6) - np.floor(t_start / 0.1 + 1e-6)


def test_runs_that_go_on_and_steps_count_each_instant_once(counter: gl.System) -> None:
    first = counter.simulate(0.5, samples=2)
    assert counter.simulate(1.0, start=first, samples=2)["n"].tolist() == [6.0, 11.0]
    run = counter.stepper()
    for k in range(1, 11):
        run.advance(0.1 * k)
        assert run["n"] == k + 1
    state = run.state()
    run.advance(1.35)
    assert run["n"] == 14
    run.restore(state)
    run.advance(1.35)
    assert (run["n"], run["held"]) == (14, pytest.approx(1.3))


def test_a_discrete_variable_is_bound_to_inputs_and_connected() -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.counters = [Counter(), Counter(period=0.25)]
            first, second = self.counters
            self.torque = gp.Torque(tau=2 * first.n - second.n + gl.Piecewise((1, gl.holds(second.n)), (0, True)))
            self.gain, self.load = gp.blocks.Gain(k=3.0), gp.Inertia(J=1.0)
            return [gl.connect(self.torque.flange, self.load.flange_a), gl.connect(second.n, self.gain.u)]

    r = gl.simulate(Driven(), 1.0, samples=201, rtol=1e-9)
    first, second = np.floor(r.time / 0.1 + 1e-9) + 1, np.floor(r.time / 0.25 + 1e-9) + 1
    tau = 2 * first - second + 1
    assert np.array_equal(r["torque.tau"], tau)
    assert np.array_equal(r["gain.y"], 3 * second)
    assert r["load.w"] == pytest.approx(np.concatenate([[0.0], np.cumsum(tau[:-1]) * 0.005]), abs=1e-9)


def test_states_get_new_values_at_instants() -> None:
    class Saw(gl.Component):
        x = gl.Variable("1", "saw tooth", start=0.25)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), 1.0), gl.When(gl.sample(0.5), gl.reinit(self.x, 0))]

    r = gl.simulate(Saw(), 1.2, times=[0.0, 0.2, 0.5, 0.6, 1.1])
    assert r["x"] == pytest.approx([0.25, 0.45, 0.0, 0.1, 0.1])  # at the start, the start value holds


def test_two_samplers_at_one_instant_see_each_other() -> None:
    class Chain(gl.Component):
        x = gl.Variable("1", "a clock", start=0.0)
        a, b, c = gl.Discrete("first"), gl.Discrete("what a is"), gl.Discrete("what a was")

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), 1.0),
                gl.When(gl.sample(0.1), gl.Eq(self.a, self.x)),
                gl.When(gl.sample(0.2), gl.Eq(self.b, self.a), gl.Eq(self.c, gl.pre(self.a))),
            ]

    r = gl.simulate(Chain(), 0.45, times=[0.45])
    assert (r["a"][0], r["b"][0], r["c"][0]) == pytest.approx((0.4, 0.4, 0.3))


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (lambda s: gl.When(gl.sample(0.0), gl.Eq(s.n, 1)), r"the period is 0\.0; expected a positive number"),
        (
            lambda s: gl.When(gl.sample(s.x), gl.Eq(s.n, 1)),
            r"gl\.sample.* depends on x; its instants are given by numbers and parameters",
        ),
        (lambda s: gl.Eq(s.n, gl.Piecewise((s.y, gl.sample(gl.time)), (0, True))), r"depends on time"),
    ],
)
def test_samples_that_are_refused(law: Any, message: str) -> None:
    class Wrong(gl.Component):
        x, y = gl.Variable("1", "state", start=0.0), gl.Variable("1", "other", start=0.0)
        n = gl.Discrete("count")

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), 1.0), gl.Eq(gl.der(self.y), 1.0), law(self)]

    with pytest.raises(DeclarationError, match=message):
        gl.compile(Wrong())


def test_a_sample_in_an_equation_of_continuous_variables_is_refused() -> None:
    class Wrong(gl.Component):
        x = gl.Variable("1", "not discrete")

        def equations(self) -> list[Any]:
            return [gl.Eq(self.x, gl.Piecewise((1, gl.sample(0.1)), (0, True)))]

    with pytest.raises(DeclarationError, match=r"holds at single instants; it belongs into gl\.When"):
        gl.compile(Wrong())


def test_a_period_that_is_not_positive_is_refused_when_the_run_begins(counter: gl.System) -> None:
    with pytest.raises(ArgumentError, match=r"a period is -0\.1 s, which is not positive"):
        counter.simulate(1.0, parameters={"period": -0.1})
    for period in (1e-9, 5e-324):
        with pytest.raises(ArgumentError, match=r"instants, more than"):
            counter.simulate(1.0, parameters={"period": period})
    assert counter.simulate(1.0, parameters={"offset": 1e308})["n"].max() == 0


def test_an_output_brings_the_discrete_variables_that_it_depends_on() -> None:
    class Held(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.sampler, self.double = gp.blocks.Sampler(sample_period=0.2, u=1 * gl.time), gp.blocks.Gain(k=2.0)
            return [gl.connect(self.sampler.y, self.double.u)]

    system = gl.compile(Held(), outputs=["double.y"])
    assert system.simulate(1.0, samples=6)["double.y"] == pytest.approx([0.0, 0.4, 0.8, 1.2, 1.6, 2.0])


@pytest.mark.parametrize("method", ["auto", "rk8", "ida"])
@pytest.mark.parametrize("t_start", [100.0, 12345.0])
def test_samples_at_the_instants_of_a_late_run_hold_what_these_set(counter: gl.System, method: str, t_start: float) -> None:
    """10003 * 0.1 is 1000.3000000000001: samples counted from the start are before an instant by the rounding of time."""
    times = t_start + np.arange(11) / 10
    r = counter.simulate(times[-1], t_start=t_start, times=times, method=method)
    assert r["n"].tolist() == list(range(1, 12))
    assert r["held"] == pytest.approx(np.arange(11) / 10, abs=1e-9)
    early = counter.simulate(t_start, t_start=t_start - 0.5, samples=2, method=method)
    later = counter.simulate(t_start + 1.0, start=early, samples=11, method=method)
    assert later["n"].tolist() == list(range(6, 17))


class Followed(gl.Component):
    """Takes samples of an input; another condition on time switches next to one of the instants."""

    period = gl.Parameter("s", "period", default=0.3)
    u = gl.Input("1", "what is sampled")
    x = gl.Variable("1", "integral of the samples", start=0.0)
    held = gl.Discrete("the input at the last instant")

    def equations(self) -> list[Any]:
        step = gl.Piecewise((1.0, gl.time >= 0.9), (0.0, True))
        return [
            gl.Eq(gl.der(self.x), self.held + 0.0 * step),
            gl.When(gl.sample(self.period), gl.Eq(self.held, self.u)),
        ]


@pytest.mark.parametrize("method", ["auto", "rk8", "ida"])
@pytest.mark.parametrize(
    ("period", "table"),
    [
        (0.3, gl.Table([0.0, 0.9], [0.0, 1.0], "previous")),  # 3 * 0.3 is 0.8999999999999999
        (0.3, gl.Table([0.0, 0.9, 0.9, 2.0], [0.0, 0.0, 1.0, 1.0])),
        (0.03, gl.Table([0.0, 0.1], [0.0, 1.0], outside="periodic")),
    ],
)
def test_an_instant_at_which_a_table_jumps_takes_what_follows(method: str, period: float, table: gl.Table) -> None:
    """Also where the jump comes after it by rounding only."""
    times = [0.0, 0.3, 0.85, 0.9, 1.0, 1.2]
    system = gl.compile(Followed(), outputs=["held", "x"])
    r = system.simulate(1.2, times=times, inputs={"u": table}, parameters={"period": period}, method=method, rtol=1e-9)
    exact = [k * period for k in range(round(1.2 / period) + 1)]
    taken = [0.0 if k * period < 0.89 else 1.0 for k in range(len(exact))]
    if table.outside == "periodic":  # 0.1 s, so that every tenth instant is at a jump, from 1 to 0
        taken = [(3 * k % 10) / 10 for k in range(len(exact))]
    held = [taken[int(t / period + 1e-9)] for t in times]
    assert r["held"] == pytest.approx(held, abs=1e-6)
    assert r["x"][-1] == pytest.approx(period * sum(taken[:-1]), abs=1e-6)
    if method != "rk8":
        return
    run = system.stepper(inputs={"u": table}, parameters={"period": period}, rtol=1e-9)
    for t, value in zip(times[1:], held[1:], strict=True):
        run.advance(t)
        assert run["held"] == pytest.approx(value, abs=1e-6)


@pytest.mark.parametrize("end", [1.0, 1.03])
@pytest.mark.parametrize("offset", [0.0, 0.02])
@pytest.mark.parametrize("period", [0.03, 0.05, 0.13, 0.2, 0.3])
def test_a_run_that_goes_on_with_other_instants_counts_those(
    counter: gl.System, period: float, offset: float, end: float
) -> None:
    """And none where it begins, unless one is there that the earlier run did not have."""
    first, given = counter.simulate(end, samples=2), {"period": period, "offset": offset}
    instants = offset + period * np.arange(100)
    last = end + 1e-9 if end == 1.0 else end - 1e-9  # of the earlier run
    expected = np.count_nonzero((instants > last) & (instants < end + 1.0 + 1e-9))
    rest = counter.simulate(end + 1.0, samples=2, start=first, parameters=given)
    assert rest["n"][-1] - first["n"][-1] == expected
    run = counter.stepper(start=first, parameters=given)
    run.advance(end + 1.0)
    assert run["n"] - first["n"][-1] == expected


@pytest.mark.parametrize(("t_start", "count"), [(0.0, 11), (0.05, 10), (3.0, 11), (7.31, 10)])
def test_a_run_that_goes_on_at_another_time_has_the_instants_there(counter: gl.System, t_start: float, count: int) -> None:
    first = counter.simulate(1.0, samples=2)
    rest = counter.simulate(t_start + 1.0, t_start=t_start, samples=2, start=first)
    assert rest["n"][-1] - first["n"][-1] == count
