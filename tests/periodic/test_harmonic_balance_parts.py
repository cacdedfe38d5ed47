"""Who accepts a point of a branch, and the numbers that a branch is asked for with."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib import progress as reports
from gearlib.errors import ArgumentError, BoundError, SolverError
from gearlib.periodic import harmonic_balance as parts
from gearlib.periodic.first_motion import Forced


def watch(accuracy: float, errors: dict[float, float], seen: Any = None) -> parts.Acceptance:
    balance: Any = SimpleNamespace(error=lambda z, omega: (np.nan, errors[omega]))
    return parts.Acceptance(balance, accuracy, seen)


def test_a_point_is_accepted_while_its_error_is_within_the_accuracy() -> None:
    """The worst so far is remembered with its frequency; what is not a number is worse than anything."""
    found = watch(0.1, {1.0: 0.02, 2.0: 0.1, 3.0: 0.05, 4.0: 0.11, 5.0: 0.07, 6.0: np.nan})
    told = []
    for omega in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0):
        accepted = found(np.zeros(1), omega)
        told.append((accepted, found.worst, found.where))
    assert told[:5] == [(True, 0.02, 1.0), (True, 0.1, 2.0), (True, 0.1, 2.0), (False, 0.11, 4.0), (True, 0.11, 4.0)]
    assert told[5][0] is False
    assert np.isnan(told[5][1])
    assert told[5][2] == 6.0
    assert (watch(0.1, {}).worst, watch(0.1, {}).where) == (0.0, 0.0)


def test_given_harmonics_are_accepted_as_they_are_and_progress_is_told() -> None:
    told: list[float] = []
    found = watch(np.inf, {}, told.append)
    assert all(found(np.zeros(1), omega) for omega in (1.0, 3.0))
    assert told == [1.0, 3.0]
    assert (found.worst, found.where) == (0.0, 0.0)


GOOD: dict[str, Any] = {"start": 1.0, "end": 2.0, "harmonics": None, "step": 0.02, "points": 2, "accuracy": 5e-3}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, ""),
        ({"start": 2.0, "end": 1.0}, ""),
        ({"start": 1e-50, "end": 1e50}, ""),
        ({"step": 1.0, "harmonics": 1, "accuracy": 0.99}, ""),
        ({"accuracy": 0.0}, "accuracy is 0.0; expected an error over the vibration, above 0 and below 1"),
        ({"accuracy": 1.0}, "accuracy is 1.0; expected an error over the vibration, above 0 and below 1"),
        ({"start": 0.0}, "start and end are 0.0 and 2.0; expected two different positive frequencies, rad/s"),
        ({"end": 0.0}, "start and end are 1.0 and 0.0; expected two different positive frequencies, rad/s"),
        ({"end": -2.0}, "start and end are 1.0 and -2.0; expected two different positive frequencies, rad/s"),
        ({"end": 1.0}, "start and end are 1.0 and 1.0; expected two different positive frequencies, rad/s"),
        ({"start": 0.9e-50}, "start is 9e-51; expected a frequency from 1e-50 to 1e+50 rad/s"),
        ({"end": 1.1e50}, "end is 1.1e+50; expected a frequency from 1e-50 to 1e+50 rad/s"),
        ({"step": 0.0}, "step is 0.0; expected a number above 0, up to 1"),
        ({"step": 1.01}, "step is 1.01; expected a number above 0, up to 1"),
        *(({name: np.nan}, f"{name} is nan; expected a finite number") for name in ("start", "end", "step", "accuracy")),
        *(({name: "1"}, f"{name} is '1'; expected a finite number") for name in ("start", "end", "step", "accuracy")),
        ({"harmonics": 0}, "harmonics is 0; expected a whole number, 1 or more"),
        ({"points": 1}, "points is 1; expected a whole number, 2 or more"),
    ],
)
def test_numbers_of_a_branch(changes: dict[str, Any], said: str) -> None:
    if not said:
        parts.check_numbers(**GOOD | changes)
        return
    with pytest.raises(ArgumentError) as refused:
        parts.check_numbers(**GOOD | changes)
    assert str(refused.value) == said


class Swept(gl.Component):
    """An oscillator, and what is proportional to the frequency that drives it."""

    w = gl.Parameter("rad/s", default=1.0, max=2.0)
    x, v, y = gl.Variable("1"), gl.Variable("1"), gl.Variable("1/s")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), gl.cos(self.w * gl.time) - 0.1 * self.v - self.x),
            gl.Eq(self.y, self.w * self.x + self.w),
        ]


def test_outputs_know_the_frequency_of_their_point() -> None:
    found = gl.harmonic_balance(gl.compile(Swept()), 0.5, 0.6, frequency="w", harmonics=1, outputs=["x", "y"], step=0.4)
    assert len(found) > 2
    assert found.amplitude("x") == pytest.approx(1 / np.abs(1 - found.omega**2 + 0.1j * found.omega))
    assert found.amplitude("y") == pytest.approx(found.omega * found.amplitude("x"))
    assert found.mean("y") == pytest.approx(found.omega)


def test_progress_is_told_from_the_first_frequency_to_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reports, "APART", 0.0)
    told: list[float] = []
    found = gl.harmonic_balance(
        gl.compile(Swept()), 0.5, 0.6, frequency="w", outputs=["x"], step=0.4, progress=lambda part, seconds: told.append(part)
    )
    assert found.harmonics == 4
    assert found.error.max() < 1e-9
    assert told == sorted(told)
    assert 0.0 <= told[0] < 1.0
    assert told[-1] == 1.0


@pytest.mark.parametrize(("start", "end", "refused"), [(1.99, 2.0, False), (1.9, 2.1, True), (2.1, 1.9, True)])
def test_bounds_of_the_frequency_hold_at_both_ends(start: float, end: float, refused: bool) -> None:
    """In between, frequencies a little beyond them may be tried."""
    options: dict[str, Any] = {"frequency": "w", "harmonics": 1, "outputs": ["x"], "step": 1.0}
    if not refused:
        assert gl.harmonic_balance(gl.compile(Swept()), start, end, **options).omega[-1] == end
        return
    with pytest.raises(BoundError, match=r"w is 2\.1"):
        gl.harmonic_balance(gl.compile(Swept()), start, end, **options)


def test_samples_of_a_period_that_are_given_are_taken() -> None:
    found = [
        gl.harmonic_balance(
            gl.compile(Swept()),
            0.5,
            0.51,
            frequency="w",
            harmonics=2,
            samples=samples,
            outputs=["x"],
            points=2,
            guess={"x": 7.0},
        )
        for samples in (6, 40)
    ]
    assert found[0].coefficients == pytest.approx(found[1].coefficients, abs=1e-9)
    assert len(found[0]) == 2
    assert not found[0].complete or found[0].omega[-1] == 0.51


class StifferOneWay(gl.Component):
    """A spring that is stiffer on one side."""

    F = gl.Input("1")
    x, v = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        spring = gl.Piecewise((3 * self.x, self.x > 0), (self.x, True))
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), self.F - 0.2 * self.v - spring)]


@pytest.mark.parametrize(("kind", "samples"), [(Swept, 64), (StifferOneWay, 256)])
def test_a_period_has_more_samples_where_something_switches(kind: Any, samples: int, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def first(task: Any, scene: Any, omega: float, count: int, *_: Any) -> Any:
        asked.append(count)
        raise SolverError("that is enough")

    monkeypatch.setattr(Forced, "first", first)
    given: dict[str, Any] = {"inputs": {"F": lambda phase, w: np.cos(phase)}} if kind is StifferOneWay else {"frequency": "w"}
    with pytest.raises(SolverError, match="that is enough"):
        gl.harmonic_balance(gl.compile(kind()), 0.5, 0.6, outputs=["x"], **given)
    assert asked == [samples]


@pytest.mark.parametrize(
    ("output", "growth", "said"),
    [
        (lambda phase, x: np.cos(phase) + 5.0, 0.0, ""),
        (lambda phase, x: 5.0 + 0 * phase, 0.0, ""),
        (lambda phase, x: np.cos(x), 1.0, ""),
        (lambda phase, x: 3 * phase, 0.0, "y grows by 18.8496 in each period; leave it out, or take its rate"),
        (lambda phase, x: -2 * x, 1.0, "y grows by -12.5664 in each period; leave it out, or take its rate"),
        (lambda phase, x: np.cos(0.5 * phase), 0.0, "y does not repeat after 2 pi / 2.5 rad/s, but differs by up to "),
        (lambda phase, x: np.cos(x), 0.5, "y does not repeat after 2 pi / 2.5 rad/s, but differs by up to "),
        (lambda phase, x: np.cos(phase) + 1e-7 * phase, 0.0, ""),  # a millionth of the swing is rounding
        (lambda phase, x: np.cos(phase) + 1e-6 * phase, 0.0, "y "),
        (
            lambda phase, x: np.cos(phase) + (phase > 0.05),
            0.0,
            "y does not repeat after 2 pi / 2.5 rad/s, but differs by up to 1",
        ),
        (
            lambda phase, x: np.cos(phase) + (phase > 3e4),
            0.0,
            "y does not repeat after 2 pi / 2.5 rad/s, but differs by up to 1",
        ),
        (lambda phase, x: 1e6 + 1e-7 * phase, 0.0, ""),  # and a part in 1e12 of the size
        (lambda phase, x: 1e6 + 1e-6 * phase, 0.0, "y "),
        (lambda phase, x: 1e3 * (x - 1.0) + 5e-10 * phase / (2 * np.pi), 0.0, ""),  # what rounding of the states makes
        (lambda phase, x: 1e3 * (x - 1.0) + 5e-9 * phase / (2 * np.pi), 0.0, "y grows by 5e-09"),
    ],
)
def test_outputs_repeat_but_for_rounding(monkeypatch: pytest.MonkeyPatch, output: Any, growth: float, said: str) -> None:
    """By `_check_repeating`: of an output that is a function of the phase and of a state, which is 1 or grows."""
    monkeypatch.setattr(parts, "observed_values", lambda driven, phase, x, discrete: np.array([0 * phase, output(phase, x[0])]))
    driven: Any = SimpleNamespace(
        states=lambda phase, c: (1.0 + growth * phase)[None], discrete=lambda phase, x: None, omega=2.5,
    )  # fmt: skip
    given: Any = ["z", "y"], driven, np.zeros((1, 1)), np.array([growth]), [0, 1]
    if not said:
        parts.check_repeating(*given)
        return
    with pytest.raises(ArgumentError) as refused:
        parts.check_repeating(*given)
    assert str(refused.value).startswith(said)
