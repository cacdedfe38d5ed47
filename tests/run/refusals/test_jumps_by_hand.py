"""Events and samples of made-up motions: which of them make a differentiated equation jump, and what is said of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ModelError
from gearlib.run.refusals.jumps import SampledMotion, refuse_jumps, refuse_switches, refuse_switches_between

T = gl.time
Motion = Callable[[Any], Any]  # of times


class Shift(gl.Component):
    """Two bodies with a ratio of 1 and then of 2, or with a slack of x - 1 that is taken up where x > 1."""

    kinked = gl.Structural(False)
    J = gl.Parameter("kg.m2", default=1.5)
    x, w = gl.Variable("1", start=0.0), gl.Variable("1/s", start=10.0)
    y, v = gl.Variable("1"), gl.Variable("1/s")
    force = gl.Variable("1/s2")
    second = gl.Discrete()

    def equations(self) -> list[Any]:
        follows = (
            [gl.Eq(self.y, gl.Max(self.x, 2 * self.x - 1)), gl.Eq(self.v, gl.der(self.y))]
            if self.kinked
            else [gl.Eq(self.v, (1 + self.second) * self.w), gl.Eq(self.y, 0.0)]
        )
        return [
            *follows,
            gl.Eq(gl.der(self.x), self.w),
            gl.Eq(gl.der(self.v), self.force),
            gl.Eq(gl.der(self.w), -self.force),
            gl.When(T > 0.5, gl.Eq(self.second, 1)),
        ]


@cache
def scene(kinked: bool) -> Any:
    return gl.compile(Shift(kinked=kinked)).translation.scene


def sampled(times: Any, second: Motion, kinked: bool = False, **motions: Motion) -> SampledMotion:
    """Made-up histories: the discrete variable, or else the relation, and variables by name; those without are zero."""
    here = scene(kinked)
    discrete = np.zeros((len(times), here.n_discrete))
    discrete[:, slice(None, here.model.n_relations) if kinked else here.model.n_relations] = np.reshape(
        second(times), (-1, 1) if kinked else -1
    )
    by_number = {here.named(name)[0]: history for name, history in motions.items()}

    def history(node: Any) -> Any:
        return np.asarray(by_number[node](times) if node in by_number else 0.0 * times, float)

    return SampledMotion(here.structure, here.model.parameters.defaults, times, discrete, history)


def later(t: float) -> Motion:
    """0 before a time, and 1 from then on."""
    return lambda times: (times >= t) * 1.0


def said(events: Any, asked: list[Any] | None = None, begin: float = 0.0, end: float = 1.0, **given: Any) -> str:
    """What is said of a run with some events."""
    here = scene(given.get("kinked", False))

    def at(times: Any) -> SampledMotion:
        if asked is not None:
            asked.append(times)
        return sampled(times, **given)

    try:
        refuse_switches(here.structure, here.program, here.model.parameters.defaults, begin, np.array(events), end, at)
    except ModelError as refused:
        return str(refused)
    return ""


JUMPS = "Shift: the equation 'Shift: v = w*(second + 1)' has a jump at t = 0.5 s, but must be differentiated there"


@pytest.mark.parametrize(
    ("second", "w", "refused"),
    [
        (later(0.5), lambda t: 10.0 + 0 * t, True),
        (later(0.5), lambda t: 10.0 + 1e3 * t, True),
        (later(0.5), lambda t: -10.0 - t, True),
        (lambda t: 1.0 - later(0.5)(t), lambda t: 10.0 + 0 * t, True),
        (later(0.8), lambda t: 10.0 + 0 * t, False),  # the event is another one's
        (later(0.5), lambda t: 10.0 - 4.0 * later(0.5)(t), False),  # the speeds are set there
        (later(0.5), lambda t: t - 0.5, False),  # no speed, so that nothing jumps
        (later(0.5), lambda t: 0 * t, False),
        (later(0.5), lambda t: 10.0 + 0.9e-8 * later(0.5)(t), True),  # rounding, of the largest value
        (later(0.5), lambda t: 10.0 + 1.1e-8 * later(0.5)(t), False),
    ],
)
def test_a_ratio_that_changes_at_an_event(second: Motion, w: Motion, refused: bool) -> None:
    found = said([0.5], second=second, w=w)
    assert found.startswith(JUMPS) if refused else not found
    if refused:
        assert found.endswith("make what it drives elastic, or set the speeds after it by gl.reinit")


@pytest.mark.parametrize(("large", "refused"), [("x", False), ("w", True)])
@pytest.mark.parametrize("at", [0.25, 0.75])
def test_rounding_of_a_state_is_judged_by_its_own_size(large: str, refused: bool, at: float) -> None:
    """A speed that changes by 1e-4 is set there beside an angle of 1e6, and not where it has been as large."""
    translation = gl.compile(Shift()).translation
    whole = translation.with_states(translation.structure.states)
    assert whole.state_names == ("x", "w")
    change = {"x": lambda t: 1e6 + t, "w": lambda t: 10.0 + 1e-4 * later(at)(t)}
    if large == "w":
        change = {"x": lambda t: 1.0 + 0 * t, "w": lambda t: 10.0 + 1e-4 * later(at)(t) + 1e6 * (t < 0.1)}
    given = whole.structure, whole.program, whole.model.parameters.defaults, 0.0, np.array([0.25, 0.75]), 1.0
    found = ""
    try:
        refuse_switches(*given, lambda times: sampled(times, later(at), **change))
    except ModelError as problem:
        found = str(problem)
    assert (f"has a jump at t = {at} s" in found) == bool(found) == refused


@pytest.mark.parametrize(("times", "refused"), [(2.9, True), (3.1, False)])
def test_a_state_that_changes_much_more_than_before_was_set(times: float, refused: bool) -> None:
    """By more than thrice: in the hundredth of the time to the event before."""
    for begin, end in ((0.0, 1.0), (-4.5, 0.6)):
        gap = 0.01 * (0.5 - begin)

        def w(t: Any, gap: float = gap) -> Any:
            return 10.0 + np.where(t < 0.5 - 0.5 * gap, (t - 0.5 + gap) / gap, times)

        assert bool(said([0.5], begin=begin, end=end, second=later(0.5), w=w)) == refused


def test_where_the_sides_of_events_are_read() -> None:
    """At a hundredth and two of the time to the event before, and a hundredth of that to the next one."""
    asked: list[Any] = []
    said([0.2, 0.7], asked, begin=-0.2, end=0.8, second=later(2.0))
    (times,) = asked
    expected = [-0.2, 0.192, 0.196, 0.2, 0.205, 0.69, 0.695, 0.7, 0.701, 0.8]
    assert times == pytest.approx(expected, rel=1e-12)


def test_the_first_event_that_jumps_is_named() -> None:
    """Not one where states were set, or where nothing changes."""
    w = {"w": lambda t: 10.0 - later(0.25)(t)}
    assert "at t = 0.75 s" in said([0.25, 0.5, 0.75], second=lambda t: later(0.25)(t) - later(0.75)(t), **w)
    assert "at t = 0.5 s" in said([0.25, 0.5, 0.75], second=lambda t: later(0.5)(t) - later(0.75)(t), **w)
    assert said([0.25], second=later(0.25), **w) == ""


def test_a_kink_below_a_second_derivative() -> None:
    """Where the speed is not zero; the angle itself does not jump."""
    slope = {speed: lambda t: 1.0 + 0 * t for speed in ("w", "der(x)")}
    found = said([0.5], kinked=True, second=later(0.5), x=lambda t: 0.5 + t, **slope)
    assert "has a kink at t = 0.5 s" in found
    assert said([0.5], kinked=True, second=later(0.5), x=lambda t: 1.0 + 0 * t) == ""


def between(second: Any, w: Any, times: Any = (0.0, 0.25, 0.5, 1.0)) -> str:
    here = scene(False)
    motion = sampled(np.array(times), lambda t: np.array(second, float), w=lambda t: np.array(w, float))
    try:
        refuse_switches_between(motion, here.program)
    except ModelError as refused:
        return str(refused)
    return ""


@pytest.mark.parametrize(
    ("second", "w", "when"),
    [
        ([0, 0, 1, 1], [1, 1, 1, 1], "between t = 0.25 s and t = 0.5 s"),
        ([0, 0, 0, 1], [1, 1, 1, -2], None),  # the jump is small on the way from one side to the other
        ([0, 0, 0, 1], [0, 0, 0, 1], None),
        ([0, 1, 0, 1], [1, -1, -1, -1], "between t = 0.25 s and t = 0.5 s"),
        ([0, 1, 1, 0], [-3, -1, -1, -1], "between t = 0 s and t = 0.25 s"),
        ([1, 1, 1, 1], [1, 2, 3, 4], None),
        ([0, 0, 0, 1], [1, 1, 1, 1.1e-9], "between t = 0.5 s and t = 1 s"),
        ([0, 0, 0, 1], [1, 1, 1, 0.9e-9], None),  # as small as rounding, beside the other side
        ([0, 0, 0, 1], [-1.1e-9, -1.1e-9, -1.1e-9, -1], "between t = 0.5 s and t = 1 s"),
        ([0, 0, 0, 1], [-0.9e-9, -0.9e-9, -0.9e-9, -1], None),
    ],
)
def test_between_two_samples(second: Any, w: Any, when: str | None) -> None:
    """The first pair of samples at which the equation jumps alike on both sides is named."""
    found = between(second, w)
    assert (f"has a jump {when}, but must" in found) if when else not found


def test_a_single_sample_has_nothing_between() -> None:
    assert between([1], [1], [0.0]) == between([], [], []) == ""


class Follows(gl.Component):
    """What is followed exactly, and must be differentiated twice."""

    ref = gl.Structural(None)
    a, b = gl.Parameter("any", default=2.0), gl.Parameter("any", default=3.0)
    y = gl.Variable("any")
    force = gl.Variable("any")

    def equations(self) -> list[Any]:
        return [gl.Eq(self.y, self.ref(self)), gl.Eq(gl.der(gl.der(self.y)), self.force)]


def step(level: Any = 0.0, at: float = 0.5) -> Any:
    return gl.Piecewise((0, at > T), (level, True))


@pytest.mark.parametrize(
    ("ref", "said"),
    [
        (lambda s: s.a * T + step(1.0), "has a jump at t = 0.5 s"),
        (lambda s: s.a * T + step(1e-12), None),  # rounding
        (lambda s: s.a * 1e6 * T + step(1e-4), None),  # of values of 1e6
        (lambda s: s.a * 1e6 * T + step(1e-2), "has a jump at t = 0.5 s"),
        (lambda s: gl.Piecewise((s.a * (T - 0.5), T < 0.5), (s.b * (T - 0.5), True)), "has a kink at t = 0.5 s"),
        (lambda s: gl.Piecewise((s.a * (T - 0.5), T < 0.5), (2.0 * (T - 0.5), True)), None),
        (lambda s: gl.Piecewise((s.a * (T - 0.5) ** 2, T < 0.5), (s.b * (T - 0.5) ** 2, True)), None),
        # only values on the own side count, where each piece is small
        (lambda s: gl.Piecewise((gl.exp(60 * (T - 0.5)), T < 0.5), (1.5, True)), "has a jump at t = 0.5 s"),
        (lambda s: gl.Piecewise((1.5, T < 0.5), (gl.exp(60 * (0.5 - T)), True)), "has a jump at t = 0.5 s"),
        (lambda s: gl.Piecewise((gl.exp(-600 * T), T < 0.5), (0.5, True)), "has a jump at t = 0.5 s"),
        (lambda s: gl.Piecewise((0.5, T < 0.5), (gl.exp(600 * (T - 1)), True)), "has a jump at t = 0.5 s"),
        (lambda s: step(1.0, 1.5), None),  # after the end
        (lambda s: step(1.0, -0.5), None),  # before the start
        (lambda s: step(0.0, 0.25) + step(1.0, 0.75), "has a jump at t = 0.75 s"),
        (lambda s: step(2.0, 0.25) + step(1.0, 0.75), "has a jump at t = 0.25 s"),
        (lambda s: gl.Piecewise((0, T >= 0.25), (1.0, True)), "has a jump at t = 0.25 s"),
        (lambda s: gl.Piecewise((s.a - 2.0, T < 0.25), (s.b, T < 0.5), (s.b, True)), "has a jump at t = 0.25 s"),
        (lambda s: gl.Piecewise((s.b, T < 0.25), (s.b, T < 0.5), (s.a - 2.0, True)), "has a jump at t = 0.5 s"),
    ],
)  # fmt: skip
def test_what_is_followed_is_examined_in_time(ref: Any, said: str | None) -> None:
    """Values and slopes on both sides of each time at which something switches."""
    translation = gl.compile(Follows(ref=ref), outputs=["force"]).translation
    here, table = translation.scene, translation.model.parameters.defaults
    program = here.computing(here.named("force")[0])
    for _ in range(2):  # what was refused is refused again
        if said is None:
            refuse_jumps(here.structure, program, table, 0.0, 1.0)
            continue
        with pytest.raises(ModelError, match=said + ", but must be differentiated"):
            refuse_jumps(here.structure, program, table, 0.0, 1.0)


def test_parameters_and_the_interval_decide_anew() -> None:
    translation = gl.compile(Follows(ref=lambda s: gl.Piecewise((s.a, s.b > T), (5.0, True))), outputs=["force"]).translation
    here = translation.scene
    program = here.computing(here.named("force")[0])

    def refused(end: float, **values: float) -> bool:
        try:
            refuse_jumps(here.structure, program, translation.parameter_values(values), 0.0, end)
        except ModelError:
            return True
        return False

    assert [refused(4.0), refused(2.0), refused(4.0)] == [True, False, True]
    assert [refused(4.0, a=5.0), refused(4.0), refused(4.0, b=4.5), refused(4.0, b=3.5)] == [False, True, False, True]
