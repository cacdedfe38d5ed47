"""Events: relations, discrete variables, When and reinit, time events; both integrators, against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError

METHODS = ["rk5", "rk8", "ida"]


class Ball(gl.Component):
    """Falls on a floor at h = 0 and bounces with restitution e."""

    e = gl.Parameter("1", "restitution", default=0.8, min=0, max=1)
    h = gl.Variable("m", "height", start=1.0)
    v = gl.Variable("m/s", "speed", start=0.0)
    bounces = gl.Discrete("how often it touched the floor")

    def equations(self):
        return [
            gl.Eq(gl.der(self.h), self.v),
            gl.Eq(gl.der(self.v), -9.81),
            gl.When(self.h < 0, gl.reinit(self.v, -self.e * self.v), gl.Eq(self.bounces, gl.pre(self.bounces) + 1)),
        ]


def ball_height(t: float, e: float, g: float = 9.81) -> tuple[float, int]:
    """Height and number of bounces in closed form."""
    start, speed, count = math.sqrt(2 / g), math.sqrt(2 * g), 0
    if t < start:
        return 1 - g * t * t / 2, 0
    while True:
        count += 1
        speed *= e
        if t < start + 2 * speed / g:
            s = t - start
            return speed * s - g * s * s / 2, count
        start += 2 * speed / g


@pytest.mark.parametrize("method", METHODS)
def test_bouncing_ball(method):
    system = gl.compile(Ball(), outputs=["h", "bounces"])
    result = system.simulate(t_end=2.5, samples=41, method=method, rtol=1e-9, parameters={"e": 0.7})
    expected = [ball_height(t, 0.7) for t in result.time]
    assert result["h"] == pytest.approx([h for h, _ in expected], abs=1e-7)
    assert result["bounces"].tolist() == [n for _, n in expected]
    assert len(result.events) == 2 * result["bounces"][-1], "down through the floor, and up again"


class Stops(gl.Component):
    """x' = 1 until x reaches 1, then x' = 0; y counts the time since the start of the pulse."""

    x = gl.Variable("1", "position")
    y = gl.Variable("1", "integral of a pulse")
    high = gl.Variable("1", "pulse")

    def equations(self):
        return [
            gl.Eq(gl.der(self.x), gl.Piecewise((1, self.x < 1), (0, True))),
            gl.Eq(self.high, gl.Piecewise((0, gl.time < 0.3), (2, gl.time < 0.7), (0, True))),
            gl.Eq(gl.der(self.y), self.high),
        ]


@pytest.mark.parametrize("method", [*METHODS, "auto"])
def test_time_and_state_events(method):
    result = gl.simulate(Stops(), t_end=2.0, times=np.array([0, 0.3, 0.5, 0.7, 1.0, 2.0]), method=method, rtol=1e-9)
    assert result["y"] == pytest.approx([0, 0, 0.4, 0.8, 0.8, 0.8], abs=1e-9)
    assert result["x"][-1] == pytest.approx(1.0, abs=1e-8)
    assert result["high"].tolist() == [0, 2, 2, 0, 0, 0], "a sample on an event has the right-hand limit"


class Oscillator(gl.Component):
    """Mass with a gap: no force within +-g, stiffness c beyond (closed form in pieces)."""

    c = gl.Parameter("N/(m.kg)", "stiffness by mass", default=400.0)
    x = gl.Variable("m", "position", start=0.0)
    v = gl.Variable("m/s", "speed", start=1.0)

    def equations(self):
        force = gl.Piecewise((self.c * (self.x - 0.1), self.x > 0.1), (self.c * (self.x + 0.1), self.x < -0.1), (0, True))
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), -force)]


@pytest.mark.parametrize("method", METHODS)
def test_gap_oscillator_period(method):
    """The period is that of flight over the gap plus half a vibration on either side."""
    period = 4 * 0.1 / 1.0 + 2 * math.pi / 20
    result = gl.simulate(Oscillator(), t_end=20 * period, samples=21, method=method, rtol=1e-9)
    assert result["x"] == pytest.approx(np.zeros(21), abs=2e-6)
    assert result["v"] == pytest.approx(np.ones(21), abs=2e-6)


def test_two_clutches_on_one_rigid_shaft_share_a_torque_that_nothing_determines():
    """Both stuck: singular but consistent. The speed is right, and the sum of the torques."""

    class Pair(gl.Component):
        def assemble(self):
            self.torque, self.body, self.ground = gp.Torque(tau=10.0), gp.Inertia(J=2.0), gp.Fixed()
            self.brake = [gp.Brake(fn_max=100, f_normalized=1.0) for _ in range(2)]
            return [
                gl.connect(self.torque.flange, self.body.flange_a),
                gl.connect(self.body.flange_b, self.brake[0].flange_a),
                gl.connect(self.brake[0].flange_b, self.brake[1].flange_a),
            ]

    result = gl.simulate(Pair(), t_end=1.0, samples=5, method="rk", outputs=["body.w", "brake[0].tau", "brake[1].tau"])
    assert result["body.w"] == pytest.approx(np.zeros(5), abs=1e-12)
    assert result["brake[0].tau"] + result["brake[1].tau"] == pytest.approx(10 * np.ones(5)), "into the brakes"


def test_discrete_variable_without_an_equation_is_named():
    class Broken(gl.Component):
        mode = gl.Discrete("nothing sets it")
        x = gl.Variable("1", "x")

        def equations(self):
            return [gl.Eq(gl.der(self.x), self.mode)]

    with pytest.raises(gl.GearlibError, match="'mode' has 0 equations"):
        gl.compile(Broken())


def test_chattering_is_reported_with_the_component():
    class Chatter(gl.Component):
        x = gl.Variable("1", "x", start=0.5)

        def equations(self):
            return [gl.Eq(gl.der(self.x), gl.Piecewise((1, self.x < 0), (-1, True)))]

    with pytest.raises(gl.GearlibError, match=r"events chatter at t = 0.5 s .* of Chatter"):
        gl.simulate(Chatter(), t_end=1.0, method="rk")


class Saw(gl.Component):
    """x grows with the rate 1 and falls back to 0 at 1."""

    x = gl.Variable("1", "tooth", start=0.0)
    teeth = gl.Discrete("teeth that are complete")

    def equations(self):
        fall = gl.When(self.x > 1, gl.reinit(self.x, 0.0), gl.Eq(self.teeth, gl.pre(self.teeth) + 1))
        return [gl.Eq(gl.der(self.x), 1.0), fall]


@pytest.mark.parametrize("method", METHODS)
def test_a_state_falls_back_each_time(method):
    """Its new value takes it back across the threshold that it has just crossed."""
    result = gl.simulate(Saw(), t_end=5.5, samples=23, method=method, rtol=1e-9)
    clear = np.abs(result.time - np.round(result.time)) > 1e-9
    assert result["x"][clear] == pytest.approx(np.mod(result.time, 1.0)[clear], abs=1e-9)
    assert result["teeth"][clear].tolist() == np.floor(result.time)[clear].tolist()
    assert [t for t, _ in result.events] == pytest.approx([1, 2, 3, 4, 5], abs=1e-9)


class Relays(gl.Component):
    """Two oscillators in phase cross zero at the same instants; each flips a relay, and a third counts where both are on."""

    x = gl.Variable("1", "x", start=1.0)
    v = gl.Variable("1", "x'", start=0.0)
    y = gl.Variable("1", "y", start=2.0)
    u = gl.Variable("1", "y'", start=0.0)
    on = gl.Discrete("x is negative")
    off = gl.Discrete("y is negative")
    both = gl.Discrete("how often both became negative")

    def equations(self):
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), -self.x),
            gl.Eq(gl.der(self.y), self.u),
            gl.Eq(gl.der(self.u), -self.y),
            gl.Eq(self.on, self.x < 0),
            gl.Eq(self.off, self.y < 0),
            gl.When(gl.And(gl.holds(self.on), gl.holds(self.off)), gl.Eq(self.both, gl.pre(self.both) + 1)),
        ]


@pytest.mark.parametrize("method", METHODS)
def test_events_at_one_instant_are_handled_together(method):
    result = gl.simulate(Relays(), t_end=20.0, samples=201, method=method, rtol=1e-9, outputs=["x", "y", "on", "off", "both"])
    assert result["both"][-1] == 3, "at pi/2, 5 pi/2 and 9 pi/2"
    assert (result["on"] == (np.cos(result.time) < 0)).all()
    assert (result["on"] == result["off"]).all()


class Latch(gl.Component):
    """What is known at the start, what was before, and a relation that makes no event."""

    x = gl.Variable("1", "x", start=0.0)
    first = gl.Discrete("whether the run has just begun")
    seen = gl.Discrete("the largest whole number that x has passed")
    above = gl.Variable("1", "1 where x > 0.5, without an event")

    def equations(self):
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.Eq(self.first, gl.Or(gl.initial(), gl.holds(gl.pre(self.first)))),
            gl.Eq(self.seen, gl.Piecewise((gl.pre(self.seen) + 1, self.x > gl.pre(self.seen) + 1), (gl.pre(self.seen), True))),
            gl.Eq(self.above, gl.no_event(gl.Piecewise((1, self.x > 0.5), (0, True)))),
        ]


@pytest.mark.parametrize("method", METHODS)
def test_initial_pre_and_no_event(method):
    times = np.array([0.0, 0.25, 0.75, 1.25, 1.75, 2.25, 3.5])
    outputs = ["x", "first", "seen", "above"]
    result = gl.simulate(Latch(), t_end=3.5, times=times, method=method, rtol=1e-9, outputs=outputs)
    assert (result["first"] == 1).all()
    assert result["seen"].tolist() == [0, 0, 0, 1, 1, 2, 3]
    assert result["above"].tolist() == [0, 0, 1, 1, 1, 1, 1]
    assert len(result.events) == 3, "none where x passes 0.5"


@pytest.mark.parametrize("method", METHODS)
def test_time_events_are_met_exactly(method):
    result = gl.simulate(Stops(), t_end=2.0, samples=3, method=method, outputs=["y"])
    assert [t for t, _ in result.events] == [0.3, 0.7], "to the last bit"
    assert all(name.startswith("Stops: high = ") for _, name in result.events)


@pytest.mark.parametrize("method", ["rk", "ida"])
def test_what_has_no_relations_pays_nothing_for_events(method):
    system = gl.compile(Flight(), outputs=["h"])
    assert "roots" not in system.source
    assert "update" not in system.source
    assert "modes" not in system.source
    result = system.simulate(t_end=1.0, samples=3, method=method)
    assert result.stats["events"] == 0
    assert result.events == []


class Flight(gl.Component):
    """A ball that never lands."""

    h = gl.Variable("m", "height", start=1.0)
    v = gl.Variable("m/s", "speed", start=0.0)

    def equations(self):
        return [gl.Eq(gl.der(self.h), self.v), gl.Eq(gl.der(self.v), -9.81)]


class Gated(gl.Component):
    """x grows while its input is positive."""

    x = gl.Variable("1", "x", start=0.0)
    gate = gl.Input("1", "opens")

    def equations(self):
        return [gl.Eq(gl.der(self.x), gl.Piecewise((1.0, self.gate > 0), (0.0, True)))]


@pytest.mark.parametrize("method", ["ida", "rk5", "rk8"])
@pytest.mark.parametrize("closed", [0.0, -1.0])
def test_the_jump_of_an_input_that_is_a_function_is_located(method, closed):
    result = gl.compile(Gated()).simulate(
        3.0, times=[0.0, 1.0, 3.0], method=method, inputs={"gate": lambda t: closed if t < 2.0 else 1.0}
    )
    assert [t for t, _ in result.events] == pytest.approx([2.0], abs=1e-10)
    assert result["x"] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


class Prepared(gl.Component):
    """What is done at the start, and again where x passes 1."""

    x = gl.Variable("1", "x", start=0.0)
    done = gl.Discrete("how often it was done")
    always = gl.Discrete("a condition that holds from the start on never becomes true")

    def equations(self):
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.When(gl.Or(gl.initial(), self.x > 1), gl.Eq(self.done, gl.pre(self.done) + 1)),
            gl.When(self.x < 5, gl.Eq(self.always, 1)),
        ]


@pytest.mark.parametrize("method", METHODS)
def test_what_is_done_at_the_start(method):
    result = gl.simulate(Prepared(), t_end=2.0, times=[0.0, 0.5, 1.5, 2.0], method=method)
    assert result["done"].tolist() == [1, 1, 2, 2]
    assert result["always"].tolist() == [0, 0, 0, 0]


class Undecided(gl.Component):
    """From 0.5 on, a discrete variable denies itself."""

    x = gl.Variable("1", "x", start=0.0)
    sure = gl.Discrete("whether it is sure")

    def equations(self):
        return [gl.Eq(gl.der(self.x), 1.0), gl.Eq(self.sure, gl.And(self.x > 0.5, gl.Not(gl.holds(gl.pre(self.sure)))))]


@pytest.mark.parametrize("method", METHODS)
def test_an_event_iteration_that_does_not_settle_names_the_variable(method):
    class Model(gl.Component):
        def assemble(self):
            self.part = Undecided()
            return []

    with pytest.raises(gl.GearlibError, match=r"at t ?= ?0\.5.* does not settle, it keeps changing part\.sure"):
        gl.simulate(Model(), t_end=1.0, method=method)


def test_chattering_in_a_part_is_reported_with_its_path_and_time():
    class Chatter(gl.Component):
        x = gl.Variable("1", "x", start=0.5)

        def equations(self):
            return [gl.Eq(gl.der(self.x), gl.Piecewise((1, self.x < 0), (-1, True)))]

    class Model(gl.Component):
        def assemble(self):
            self.calm, self.loose = Flight(), Chatter()
            return []

    for method in ("rk", "ida"):
        with pytest.raises(gl.GearlibError, match=r"events chatter at t ?= ?0\.5.* of loose"):
            gl.simulate(Model(), t_end=1.0, method=method)


class Peak(gl.Component):
    """A sine that is above ``top`` for 2 acos(top) once in each period."""

    top = gl.Parameter("1", "what it must exceed", default=0.9999)
    x = gl.Variable("1", "sine", start=0.0)
    v = gl.Variable("1", "cosine", start=1.0)
    above = gl.Discrete("how often it got above")
    below = gl.Discrete("how often it got below -top")

    def equations(self):
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), -self.x),
            gl.When(self.x > self.top, gl.Eq(self.above, gl.pre(self.above) + 1)),
            gl.When(self.x < -self.top, gl.Eq(self.below, gl.pre(self.below) + 1)),
        ]


@pytest.fixture(scope="module")
def peak():
    return gl.compile(Peak())


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("top", "coarsest"), [(0.9999, 1e-5), (0.99999, 1e-6), (0.999999, 1e-7), (1 - 1e-8, 1e-10)])
@pytest.mark.parametrize("finer", [1.0, 1e-2, 1e-5])
def test_short_events_are_found_at_every_tolerance_that_lets_the_solution_get_there(peak, method, top, coarsest, finer):
    rtol = max(coarsest * finer, 1e-13)
    result = peak.simulate(30.0, samples=2, method=method, rtol=rtol, parameters={"top": top})
    assert (result["above"][-1], result["below"][-1]) == (5.0, 5.0)
    begins = [t for t, name in result.events if name.endswith("when_0")][::2]
    expected = [math.asin(top) + 2 * math.pi * k for k in range(5)]
    assert begins == pytest.approx(expected, abs=0.3 * math.acos(top))


@pytest.mark.parametrize("form", ["ode", "dae"])
@pytest.mark.parametrize("backend", ["native", "sksundae"])
def test_short_events_are_found_through_both_backends_of_ida(peak, backend, form):
    result = peak.simulate(30.0, samples=2, method="ida", rtol=1e-8, backend=backend, form=form)
    assert result.stats["backend"].startswith("native" if backend == "native" else "scikit-sundae")
    assert (result["above"][-1], result["below"][-1]) == (5.0, 5.0)


class Glance(gl.Component):
    """A function that crosses and returns within one step, before another function crosses for good."""

    x = gl.Variable("1", "time", start=0.0)
    first = gl.Discrete("how often x (1 - x) exceeded 0.2499999")
    second = gl.Discrete("how often x exceeded 0.6")

    def equations(self):
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.When(self.x * (1 - self.x) > 0.2499999, gl.Eq(self.first, gl.pre(self.first) + 1)),
            gl.When(self.x > 0.6, gl.Eq(self.second, gl.pre(self.second) + 1)),
        ]


@pytest.mark.parametrize("method", METHODS)
def test_a_short_event_is_not_hidden_by_another_one_in_the_same_step(method):
    result = gl.simulate(Glance(), 1.0, samples=2, method=method, max_step=1.0)
    assert [round(t, 3) for t, _ in result.events] == [0.5, 0.5, 0.6]


class Burst(gl.Component):
    """A fast oscillation that is seen by the condition only, of which no step knows."""

    x = gl.Variable("1", "time", start=0.0)
    n = gl.Discrete("how often")

    def equations(self):
        fast = gl.sin(2 * gl.pi * (50 * self.x - 0.3))
        return [gl.Eq(gl.der(self.x), 1.0), gl.When(fast > 0, gl.Eq(self.n, gl.pre(self.n) + 1))]


@pytest.mark.parametrize("method", METHODS)
def test_what_lasts_longer_than_the_longest_step_is_found(method):
    system = gl.compile(Burst())
    assert system.simulate(1.0, method=method, max_step=0.005)["n"][-1] == 50.0
    assert system.simulate(0.4, method=method)["n"][-1] == 20.0, "a hundredth of the run by default"


class AtTheEnd(gl.Component):
    """Everything that can happen at one second."""

    x = gl.Variable("1", "time", start=0.0)
    y = gl.Variable("1", "twice as much", start=0.0)
    timed = gl.Discrete("events of time")
    stated = gl.Discrete("events of x")

    def equations(self):
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.Eq(gl.der(self.y), 2.0),
            gl.When(gl.time >= 1.0, gl.Eq(self.timed, gl.pre(self.timed) + 1)),
            gl.When(self.x > 1.0, gl.Eq(self.stated, gl.pre(self.stated) + 1), gl.reinit(self.y, -5.0)),
        ]


@pytest.mark.parametrize("method", [*METHODS, "auto"])
@pytest.mark.parametrize("samples", [2, 7])
def test_an_event_at_the_end_is_handled(method, samples):
    result = gl.simulate(AtTheEnd(), 1.0, samples=samples, method=method)
    assert (result["timed"][-1], result["stated"][-1]) == (1.0, 1.0)
    assert result["y"][-1] == -5.0, "a sample on an event has the right-hand limit"
    assert result["timed"][-2] == result["stated"][-2] == 0.0
    assert {name for _, name in result.events} >= {"AtTheEnd: when_1"}
    assert result.events[-1][0] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("k", range(1, 12))
def test_the_end_is_where_it_is_up_to_rounding(method, k):
    """0.1 k added up and multiplied are different numbers; an event in time is at the end whichever is which."""

    class At(gl.Component):
        at = gl.Parameter("s", "when", default=1.0)
        x = gl.Variable("1", "", start=0.0)
        n = gl.Discrete("count")

        def equations(self):
            return [gl.Eq(gl.der(self.x), 1.0), gl.When(gl.time >= self.at, gl.Eq(self.n, gl.pre(self.n) + 1))]

    system, end, other = gl.compile(At()), k * 0.1, sum([0.1] * k)
    assert system.simulate(end, samples=2, method=method, parameters={"at": other})["n"][-1] == 1.0
    assert system.simulate(other, samples=2, method=method, parameters={"at": end})["n"][-1] == 1.0


class AtTheStart(gl.Component):
    """What stands exactly at its limit at the start."""

    x = gl.Variable("1", "time", start=0.0)
    leaves = gl.Discrete("becomes true right after the start")
    holds = gl.Discrete("is true from the start on")
    timed = gl.Discrete("is true from the start on, by the right-hand limit")

    def equations(self):
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.When(self.x > 0.0, gl.Eq(self.leaves, gl.pre(self.leaves) + 1)),
            gl.When(self.x >= 0.0, gl.Eq(self.holds, gl.pre(self.holds) + 1)),
            gl.When(gl.time >= 0.0, gl.Eq(self.timed, gl.pre(self.timed) + 1)),
        ]


@pytest.mark.parametrize("method", METHODS)
def test_an_event_at_the_start(method):
    result = gl.simulate(AtTheStart(), 1.0, samples=3, method=method)
    assert result["leaves"].tolist() == [1.0, 1.0, 1.0]
    assert result["holds"].tolist() == result["timed"].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("method", ["auto", "exact", "rk", "ida"])
def test_a_discrete_variable_without_any_state(method):
    class Counter(gl.Component):
        y = gl.Variable("1", "ramp")
        n = gl.Discrete("count")

        def equations(self):
            return [gl.Eq(self.y, 2 * gl.time), gl.When(self.y > 1.0, gl.Eq(self.n, gl.pre(self.n) + 1))]

    system = gl.compile(Counter())
    if method == "exact":
        with pytest.raises(ArgumentError, match="make events"):
            system.simulate(1.0, method=method)
    else:
        result = system.simulate(1.0, times=[0, 0.25, 0.5, 0.75, 1.0], method=method, atol=1e-9)
        assert result["n"].tolist() == [0, 0, 1, 1, 1]
        assert result["y"].tolist() == [0, 0.5, 1, 1.5, 2]


@pytest.mark.parametrize("method", ["rk", "ida"])
@pytest.mark.parametrize("swapped", [False, True])
def test_two_whens_may_set_one_state(method: str, swapped: bool) -> None:
    """One that does not act leaves what another one sets; where both act, the one that is written first sets it."""

    class Struck(gl.Component):
        x = gl.Variable("1", "", start=0.0)

        def equations(self) -> list[Any]:
            hit = gl.When(self.x > 0.3, gl.reinit(self.x, -0.8))
            kick = gl.When(gl.time >= 0.5, gl.reinit(self.x, self.x + 1))
            return [gl.Eq(gl.der(self.x), 1.0), *((kick, hit) if swapped else (hit, kick))]

    # -0.8 at 0.3, -0.6 + 1 at 0.5, which is above 0.3 again
    found = gl.simulate(Struck(), 1.0, times=[0.0, 0.2, 0.4, 0.6], method=method)["x"]
    assert found == pytest.approx([0.0, 0.2, -0.7, -0.7], abs=1e-9)


class Twice(gl.Component):
    """Two oscillators, and conditions on them that act on a state and are counted, too: two event functions of the same zeros each."""

    rate = gl.Parameter("1/s", "makes speeds numbers", default=1.0)
    p, q, r, s, t = (gl.Parameter("1", default=0.0) for _ in range(5))
    p2, q2, r2, s2, t2 = (gl.Parameter("1", default=0.0) for _ in range(5))
    w = gl.Parameter("1", default=1.0)
    a, c = gl.Variable("1", start=1.0), gl.Variable("1", start=0.7)
    b, d = gl.Variable("1", start=0.0), gl.Variable("1", start=0.1)
    y = gl.Variable("1", start=0.0)
    n, m = gl.Discrete("times that it came above"), gl.Discrete("times that the other one did")

    def equations(self) -> list[Any]:
        one = self.p * self.a + self.q * self.b + self.r * self.c + self.s * self.d * self.a - self.t
        other = self.p2 * self.a + self.q2 * self.b + self.r2 * self.c + self.s2 * self.d * self.a - self.t2
        acts = gl.Piecewise((1, other > 0), (0, True)) + gl.Piecewise((self.c, gl.And(one > 0, other > 0)), (0, True))
        return [
            gl.Eq(gl.der(self.a), self.rate * self.b), gl.Eq(gl.der(self.b), -self.rate * self.a),
            gl.Eq(gl.der(self.c), self.rate * self.w * self.d),
            gl.Eq(gl.der(self.d), self.rate * (-self.w * self.c - 0.3 * self.a * self.c)),
            gl.Eq(gl.der(self.y), self.rate * acts),
            gl.When(one > 0, gl.Eq(self.n, gl.pre(self.n) + 1)), gl.When(other > 0, gl.Eq(self.m, gl.pre(self.m) + 1)),
        ]  # fmt: skip


def test_what_is_zero_together_changes_its_side_once() -> None:
    """Rounding lets one of two equal event functions cross first; the other follows within the noise of the first one."""
    numbers = [
        (0.19, 0.0, -0.41, -2.44, 1.22, 1.8, 0.0, -0.33, 0.0, 0.85, 4.85),
        (0.3, -1.04, 0.75, 0.0, 0.84, 0.0, 0.0, 0.13, -0.32, 0.18, 3.0),
        (-1.4, -1.2, 0.0, -0.62, 1.29, 1.45, -1.6, 0.94, 0.0, 1.6, 2.39),
        (0.0, 0.22, -0.06, -2.32, 1.04, 0.43, -2.13, 0.91, 0.61, 1.63, 2.93),
    ]
    names = ["p", "q", "r", "s", "t", "p2", "q2", "r2", "s2", "t2", "w"]
    system = gl.compile(Twice(), outputs=["n", "m", "y"])
    for row in numbers:
        given: dict[str, Any] = {"samples": 2, "parameters": dict(zip(names, row, strict=True))}
        right = system.simulate(40.0, method="rk8", rtol=1e-9, **given)
        for rtol in (1e-5, 1e-8):
            run = system.simulate(40.0, method="ida", rtol=rtol, **given)
            assert (run["n"][-1], run["m"][-1]) == (right["n"][-1], right["m"][-1])


class TwoWaves(gl.Component):
    """x grows while sin(5 t) > cos(3 t), from pi/16 to pi/4, 5 pi/16 to 9 pi/16, 13 pi/16 to 5 pi/4, ...; ``n`` counts."""

    x, n = gl.Variable("s", start=0.0), gl.Discrete("how often it began")

    def equations(self) -> list[Any]:
        over = gl.sin(5 * gl.time) > gl.cos(3 * gl.time)
        return [
            gl.Eq(gl.der(self.x), gl.Piecewise((1, over), (0, True))),
            gl.When(over, gl.Eq(self.n, gl.pre(self.n) + 1)),
        ]


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida", "taylor", "auto"])
def test_times_that_no_formula_gives_are_looked_for(method: str) -> None:
    run = gl.simulate(TwoWaves(), 3.0, samples=4, method=method)
    assert run["n"].tolist() == [0.0, 2.0, 2.0, 3.0]
    assert run["x"][-1] == pytest.approx(3 * np.pi / 16 + 4 * np.pi / 16 + 3.0 - 13 * np.pi / 16, abs=1e-9)
    assert np.unique(np.round([t for t, _ in run.events], 6)) == pytest.approx(
        np.array([1, 4, 5, 9, 13]) * np.pi / 16, abs=1e-6
    )


class LargestOfFive(gl.Component):
    """A choice among what is compared: sympy turns comparisons of it into choices of comparisons, within other conditions."""

    x, p = gl.Variable("1", start=-1.0), gl.Parameter("1", default=0.5)
    w, y, z = gl.Variable("1", start=1.0), gl.Variable("1"), gl.Variable("s", start=0.0)
    one = gl.Parameter("s", default=1.0)

    def equations(self) -> list[Any]:
        x, w, t = self.x, self.w, gl.time / self.one
        largest = gl.Max(gl.Max(t, t**4 / 40), gl.Max(gl.Piecewise((w, x > 0), (self.p, True)), gl.Max(w, x)))
        moved = [gl.Eq(self.one * gl.der(x), 1), gl.Eq(self.one * gl.der(w), 1 - t)]
        return [*moved, gl.Eq(self.y, largest), gl.Eq(gl.der(self.z), self.y)]


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida", "taylor", "auto"])
def test_comparisons_of_choices_within_conditions(method: str) -> None:
    """They ended in a TypeError of sympy's printer, or had no Taylor series."""
    run = gl.simulate(LargestOfFive(), 5.0, samples=13, method=method, outputs=["y", "z"], rtol=1e-9)
    t = np.linspace(0.0, 5.0, 1_200_001)
    right = np.max([t, t**4 / 40, t - 1, 1 + t - t**2 / 2, np.where(t > 1, 1 + t - t**2 / 2, 0.5)], axis=0)
    assert run["y"] == pytest.approx(right[::100_000], abs=1e-7)
    assert run["z"][-1] == pytest.approx(np.trapezoid(right, t), abs=1e-6)


class MovedLimits(gl.Component):
    """x = t. Each event moves the limit that x has just reached: ``below`` never ends, and the error since a sample never stays."""

    x, error = gl.Variable("1", start=0.0), gl.Variable("1")
    below, y, over = gl.Variable("s", start=0.0), gl.Variable("1"), gl.Variable("s", start=0.0)
    limit, held, one = gl.Discrete(start=1.0), gl.Discrete(), gl.Parameter("s", default=1.0)

    def equations(self) -> list[Any]:
        x, limit = self.x, self.limit
        return [
            gl.Eq(self.one * gl.der(x), 1),
            gl.When(x >= gl.pre(limit), gl.Eq(limit, gl.pre(limit) + 1)),
            gl.Eq(self.y, gl.Piecewise((1, x < limit), (0, True))),
            gl.Eq(gl.der(self.below), self.y),
            gl.When(gl.sample(0.5 * self.one), gl.Eq(self.held, x)),
            gl.Eq(self.error, x - self.held),
            gl.Eq(gl.der(self.over), gl.Piecewise((1, self.error >= 0.5), (0, True))),
        ]


_IDA = [{"backend": b, "form": f} for b in ("native", "sksundae") for f in ("ode", "torn", "dae")]


@pytest.mark.parametrize(
    "how", [*({"method": m} for m in ("rk5", "rk8", "taylor", "auto")), *({"method": "ida"} | k for k in _IDA)], ids=str
)
def test_what_an_event_moves_away_from_its_zero_is_compared_anew(how: dict[str, Any]) -> None:
    """By IDA such comparisons stayed on the side that they had crossed to."""
    run = gl.simulate(MovedLimits(), 4.75, samples=20, **how)
    assert run["limit"].tolist() == [float(1 + t // 1) for t in run.time.tolist()]
    assert run["y"].tolist() == [1.0] * 20
    assert run["below"] == pytest.approx(run.time, abs=1e-6)
    assert run["over"] == pytest.approx(np.zeros(20), abs=1e-6)
    assert (
        len([t for t, _ in run.events if abs(t - 1.0) < 1e-6]) <= 4
    )  # the sample, and each condition once: nothing follows later
    end = gl.simulate(MovedLimits(), 3.0, samples=2, **how)  # the run ends as a limit is reached
    assert (end["limit"][-1], end["y"][-1]) == (4.0, 1.0)


class ReachedAtASample(gl.Component):
    """A variable that is no state reaches its limit as a sample is taken."""

    x, e, z = gl.Variable("1", start=0.0), gl.Variable("1"), gl.Variable("s", start=0.0)
    limit, held, one = gl.Parameter("1", default=0.5), gl.Discrete(), gl.Parameter("s", default=1.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(self.one * gl.der(self.x), 1),
            gl.Eq(self.e, self.x - self.limit),
            gl.Eq(gl.der(self.z), gl.Piecewise((1, self.e >= 0), (0, True))),
            gl.When(gl.sample(0.1 * self.one), gl.Eq(self.held, self.x)),
        ]


@pytest.mark.parametrize("how", _IDA, ids=str)
def test_a_limit_that_is_reached_at_a_sample(how: dict[str, Any]) -> None:
    """With the index-reduced equations as they are, IDA saw the event a sample later (31 of 38)."""
    system = gl.compile(ReachedAtASample())
    for limit in (np.arange(1, 39) / 10).tolist():
        run = system.simulate(4.0, samples=2, method="ida", parameters={"limit": limit}, **how)
        assert run["z"][-1] == pytest.approx(4.0 - limit, abs=1e-9)


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida", "taylor"])
def test_a_moment_of_an_event_is_asked_for_after_the_run(method: str) -> None:
    """It is that behind the event, as a sample there holds: x has been set back, and the event counted."""

    class Sawtooth(gl.Component):
        x, v, s = gl.Variable("1", start=0.05), gl.Variable("1", start=0.4), gl.Parameter("s", default=1.0)
        limit, n = gl.Parameter("1", default=0.5), gl.Discrete()

        def equations(self) -> list[Any]:
            acts = gl.reinit(self.x, self.x - 0.7), gl.Eq(self.n, gl.pre(self.n) + 1)
            swings = gl.Eq(self.s * gl.der(self.v), 1.2 - 0.3 * self.v - gl.sin(self.x))
            return [gl.Eq(self.s * gl.der(self.x), self.v), swings, gl.When(self.x > self.limit, *acts)]

    system = gl.compile(Sawtooth(), outputs=["x", "n"])
    for limit in np.random.default_rng(3).uniform(0.3, 0.6, 8).tolist():
        run = system.simulate(3.0, samples=2, method=method, parameters={"limit": limit})
        for k, (t, _) in enumerate(run.events):
            moment = run.at(t)
            assert moment["n"] == k + 1
            assert moment["x"] == pytest.approx(limit - 0.7, abs=1e-9)


RESTS = {  # what is compared with its limit, and whether the comparison holds where they are equal
    "falls, at most": (lambda s: s <= 0, 1), "falls, above": (lambda s: s > 0, 0),
    "falls, at least its negative": (lambda s: -s >= 0, 1), "rises, at least": (lambda s: 1 - s >= 1, 1),
    "rises, below": (lambda s: 1 - s < 1, 0),
}  # fmt: skip


class Resting(gl.Component):
    """A signal comes to rest just at a limit, at 0.5 s and until 0.95 s; ``x`` grows twice as fast where the condition says so."""

    condition, of_state = gl.Structural("falls, at most"), gl.Structural(False)
    x, signal, way = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    on, turns = gl.Discrete("what the condition says"), gl.Discrete("how often it began to hold")

    def equations(self) -> list[Any]:
        condition = RESTS[self.condition][0](self.signal)
        ramp = gl.Table((0.0, 0.43, 0.5, 0.95, 1.0, 1.5), (1.0, 1.0, 0.0, 0.0, 1.0, 1.0))(gl.time)
        return [
            gl.Eq(gl.der(self.way), 1.0),
            gl.Eq(self.signal, gl.no_event(gl.Max(0, 1 - 2 * self.way, 2 * self.way - 1.9)) if self.of_state else ramp),
            gl.Eq(self.on, condition),
            gl.Eq(gl.der(self.x), gl.Piecewise((2.0, gl.holds(self.on)), (1.0, True))),
            gl.When(condition, gl.Eq(self.turns, gl.pre(self.turns) + 1)),
        ]


@pytest.mark.parametrize("of_state", [False, True])
@pytest.mark.parametrize("condition", RESTS)
@pytest.mark.parametrize("method", [*METHODS, "auto"])
def test_what_comes_to_rest_just_at_a_limit_has_reached_it(method: str, condition: str, of_state: bool) -> None:
    r = gl.simulate(Resting(condition=condition, of_state=of_state), 1.5, samples=16, method=method, rtol=1e-9)
    rests = RESTS[condition][1]
    there = (r.time > 0.49) & (r.time < 0.94)
    assert r["on"].tolist() == np.where(there, rests, 1 - rests).tolist()
    assert r["x"][-1] == pytest.approx(1.5 + (0.45 if rests else 1.05), abs=1e-9)
    assert r["turns"].tolist() == np.where(r.time > 0.94, 1, np.where(there, rests, 0)).tolist()
    assert sorted({round(time, 9) for time, _ in r.events}) == [0.5, 0.95]
