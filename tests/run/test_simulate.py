"""What a run is asked for: requests that are checked, what goes on from an earlier run, inputs that nobody gave, and what is told."""

from __future__ import annotations

import math
import pickle
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, InputWarning
from gearlib.run.simulate import checked_request, earlier_run, kept_values, warn_of_zero_inputs
from gearlib.stored_result import StoredResult
from tests.run.test_translation import Ends


class Bodies(gl.Component):
    """Two bodies under torques from outside; the second one is braked by what its speed is above 5."""

    J = gl.Parameter("kg.m2", default=2.0)

    def assemble(self) -> list[Any]:
        self.one, self.two, self.bound = gp.Torque(), gp.Torque(), gp.Torque(tau=1.0)
        self.a, self.b = gp.Inertia(J=self.J), gp.Inertia(J=1.0)
        self.brake = gp.Torque(tau=gl.Piecewise((0.0, self.b.w < 5.0), (-1.0, True)))
        return [
            gl.connect(self.one.flange, self.bound.flange, self.a.flange_a),
            gl.connect(self.two.flange, self.brake.flange, self.b.flange_a),
        ]


@cache
def system() -> gl.System:
    return gl.compile(Bodies())


@cache
def translation() -> Any:
    return system().translation


@cache
def earlier() -> Any:
    return system().simulate(1.0, samples=5, parameters={"J": 4.0}, inputs={"one.tau": 3.0, "two.tau": lambda t: 2.0})


def asked(**given: Any) -> Any:
    found, request = checked_request(translation(), 2.0, **given)
    assert found is translation()
    return request


def test_a_request_with_what_is_not_given() -> None:
    request = asked()
    assert (request.t_start, request.times[0], request.times[-1], len(request.times)) == (0.0, 0.0, 2.0, 501)
    assert (request.method, request.rtol, request.atol, request.max_step) == ("auto", 1e-6, None, None)
    assert (request.start, request.progress, request.form, request.backend) == (None, False, "ode", "native")
    assert (request.directions, request.given, request.on_interrupt, request.pieces) == (None, (), "raise", None)
    assert request.signals == (0.0, 0.0)
    assert request.zero_inputs == ("one.tau", "two.tau")
    assert request.parameters.tolist() == translation().model.parameters.defaults.tolist()


def test_a_request_with_everything() -> None:
    law = lambda t: t  # noqa: E731
    request = asked(
        t_start=0.5, samples=4, method="ida", rtol=1e-4, atol=[1e-5, 1e-4], parameters={"J": 3.0}, start={"a.w": 1.0},
        inputs={"two.tau": law}, max_step=0.25, form="dae", on_interrupt="stop",
    )  # fmt: skip
    assert request.times.tolist() == [0.5, 1.0, 1.5, 2.0]
    assert (request.t_start, request.method, request.rtol, request.atol, request.max_step) == (
        0.5,
        "ida",
        1e-4,
        [1e-5, 1e-4],
        0.25,
    )
    assert (request.start, request.form, request.on_interrupt, request.given) == ({"a.w": 1.0}, "dae", "stop", ("J",))
    assert request.parameters[translation().model.parameters.index["J"]] == 3.0
    assert request.signals[0] == 0.0
    assert request.signals[1].function is law
    assert request.zero_inputs == ("one.tau",)
    assert asked(inputs={"one.tau": 1.0, "two.tau": 2.0}).zero_inputs == ()
    assert asked(inputs={}).zero_inputs == ("one.tau", "two.tau")
    varied = asked(sensitivities=["J", "a.J"])
    assert varied.directions.names == ("J", "a.J")


def test_what_was_given_may_be_changed_afterwards() -> None:
    start, atol, times = {"a.w": 1.0}, np.array([1e-5, 1e-4]), np.array([0.0, 1.0])
    request = asked(start=start, atol=atol, times=times)
    start["a.w"], atol[0], times[1] = 7.0, 7.0, 1.5
    assert (request.start, request.atol.tolist(), request.times.tolist()) == ({"a.w": 1.0}, [1e-5, 1e-4], [0.0, 1.0])
    assert asked(times=times).times.tolist() == [0.0, 1.5]
    with pytest.raises(ValueError, match="read-only"):
        request.times[0] = 3.0


def test_what_was_checked_once_is_that_of_the_same_question() -> None:
    """Each of the arguments by itself; a number that equals another kind of thing is refused again."""
    same = asked(samples=3).times
    assert asked(samples=3).times is same
    assert asked(samples=4).times is not same
    assert asked(samples=3, t_start=1.0).times.tolist() == [1.0, 1.5, 2.0]
    assert checked_request(translation(), 4.0, samples=3)[1].times.tolist() == [0.0, 2.0, 4.0]
    assert asked(samples=3).times.tolist() == [0.0, 1.0, 2.0]
    given = [0.0, 2.0]
    assert asked(times=given).times.tolist() == [0.0, 2.0]
    given[1] = 1.0
    assert asked(times=given).times.tolist() == [0.0, 1.0]
    for wrong in ({"samples": 3.0}, {"samples": 3, "rtol": 1.0}, {"samples": 3, "max_step": True}, {"samples": 3, "method": "rkk"},
                  {"samples": 3, "form": "odd"}, {"samples": 3, "backend": "other"}, {"samples": 3, "progress": 3},
                  {"samples": 3, "on_interrupt": "go"}, {"samples": 3, "t_start": False}):  # fmt: skip
        for _ in range(2):
            with pytest.raises(ArgumentError):
                asked(**wrong)


def test_parameters_and_inputs_of_an_earlier_run_stay() -> None:
    """Those that were given; beside them others, which take precedence."""
    numbers, signals = kept_values(earlier(), None)
    assert numbers == {"J": 4.0}
    assert (signals["one.tau"], signals["two.tau"](0.0), len(signals)) == (3.0, 2.0, 2)
    assert callable(signals["two.tau"])
    numbers, signals = kept_values(earlier(), {"b.J": 5.0}, {"one.tau": 7.0})
    assert (numbers, signals["one.tau"], len(signals)) == ({"J": 4.0, "b.J": 5.0}, 7.0, 2)
    assert kept_values(earlier(), {"J": 6.0})[0] == {"J": 6.0}
    with pytest.warns(InputWarning):
        one = system().simulate(1.0, samples=2, inputs={"two.tau": 2.0})
    assert kept_values(one, None) == ({}, {"two.tau": 2.0})


def test_a_request_that_goes_on() -> None:
    request = asked(start=earlier())
    assert (request.t_start, request.times[0], request.given, request.zero_inputs) == (1.0, 1.0, ("J",), ())
    assert request.signals[0] == 3.0
    assert request.parameters[translation().model.parameters.index["J"]] == 4.0
    assert asked(start=(earlier(), 0.25)).t_start == 0.25
    assert asked(start=(earlier(), 0.25), t_start=-1.0).t_start == -1.0
    with pytest.raises(ArgumentError, match=r"^sensitivities are those of a whole run"):
        asked(start=earlier(), sensitivities=["J"])
    with pytest.raises(ArgumentError, match=r"^sensitivities are those of a whole run"):
        asked(start=(earlier(), 0.5), sensitivities=["J"])


def test_the_run_that_goes_on_and_when() -> None:
    """A result alone goes on at its end."""
    run = earlier()
    assert earlier_run(translation(), run) == (run, 1.0)
    assert earlier_run(translation(), (run, 0.25)) == (run, 0.25)
    assert earlier_run(translation(), (run, 0)) == (run, 0.0)
    assert earlier_run(translation(), (run, 1)) == (run, 1.0)
    for none in (None, "steady", {"a.w": 1.0}, {}, (run,), (run, 0.5, 1.0), (0.5, run)):
        assert earlier_run(translation(), none) is None
    again = gl.compile(Bodies()).translation
    assert earlier_run(again, run) == (run, 1.0)  # the same model, compiled once more
    ends = gl.compile(Ends())
    massless = ends.translation.fitted({"a": 0.0})[0]
    assert massless is not ends.translation
    first = ends.simulate(0.5, samples=2)
    assert earlier_run(massless, first) == (first, 0.5)


def test_runs_that_do_not_go_on() -> None:
    run = earlier()
    for t in (-1e-9, 1.0 + 1e-9, 3.0):
        with pytest.raises(ArgumentError, match=rf"^start names the time {t:g} s; the run goes from 0 to 1 s$"):
            earlier_run(translation(), (run, t))
    for t in (None, "soon", math.nan):
        with pytest.raises(
            ArgumentError, match=r"^the time of start=\(result, time\) is .*; expected a finite number of seconds$"
        ):
            earlier_run(translation(), (run, t))
    other = gl.compile(gp.Inertia(J=1.0))
    for start in (run, (run, 0.5)):
        with pytest.raises(
            ArgumentError, match=r"^start is a run of another system than Inertia; a run goes on with the system that"
        ):
            earlier_run(other.translation, start)
    stored = StoredResult(run.record(["a.w"]))
    for start in (stored, (stored, 0.5)):
        with pytest.raises(
            ArgumentError, match=r"^start is a result from a file, which does not hold all of the run's state; start from"
        ):
            earlier_run(translation(), start)


def told(needed: tuple[str, ...], zero: tuple[str, ...], *names: str) -> list[str]:
    model: Any = SimpleNamespace(needed_inputs=needed, name="Train")
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        warn_of_zero_inputs(model, zero, *names)
    assert [one.category for one in found] == [InputWarning] * len(found)
    return [str(one.message) for one in found]


def test_inputs_that_nobody_gave_are_told() -> None:
    """If the outputs depend on them; eight by name."""
    assert told(("a.u",), ()) == told((), ("a.u",)) == told(("b.u",), ("a.u",)) == []
    assert told(("a.u", "b.u"), ("b.u", "c.u")) == [
        "Train: no value was given for the input b.u: it is 0 in this run. Pass simulate(inputs={'b.u': ...}), 0.0 if that is intended, "
        "or bind it in the model"
    ]
    assert told(("a.u", "b.u"), ("b.u", "a.u"), "these runs", "sweep") == [
        "Train: no value was given for the inputs a.u, b.u: they are 0 in these runs. Pass sweep(inputs={'a.u': ...}), 0.0 if that is "
        "intended, or bind it in the model"
    ]
    many = tuple(f"i{k}" for k in range(10))
    (text,) = told(many, many)
    assert "the inputs i0, i1, i2, i3, i4, i5, i6, i7, and 2 more: they are 0" in text


def test_a_run_begins_before_its_first_sample() -> None:
    """a.w = (3 + 1) t / 4 with J = 4; the start is no sample unless it is asked for."""
    inputs = {"one.tau": 3.0, "two.tau": 0.0}
    late = system().simulate(2.0, times=[0.5, 2.0], parameters={"J": 4.0}, inputs=inputs, method="rk")
    assert late["a.w"] == pytest.approx([0.5, 2.0])
    assert late["a.phi"] == pytest.approx([0.125, 2.0])
    assert late.time.tolist() == [0.5, 2.0]
    first = system().simulate(2.0, times=[0.0, 2.0], parameters={"J": 4.0}, inputs=inputs, method="rk")
    assert first["a.w"] == pytest.approx([0.0, 2.0], abs=1e-12)
    assert first.stats["zero_inputs"] == ()
    assert late.energy_balance().time.tolist() == [0.0, 0.5, 2.0]


def test_progress_is_told_to_the_end() -> None:
    """The share that is done, and the seconds that it took."""
    seen: list[tuple[float, float]] = []
    system().simulate(
        2.0, samples=3, inputs={"one.tau": 1.0, "two.tau": 4.0}, method="rk", progress=lambda *at: seen.append(at)
    )
    shares = [share for share, _ in seen]
    assert shares[-1] == 1.0
    assert shares == sorted(shares)
    assert [seconds for _, seconds in seen] == sorted(seconds for _, seconds in seen)


def test_a_result_repeats_its_run_with_the_same_steps() -> None:
    """The longest step that its samples allowed is kept in its request, also in another process."""
    found = system().simulate(2.0, samples=5, inputs={"one.tau": 1.0, "two.tau": lambda t: 3.0}, method="rk", max_step=0.125)
    assert found.request.max_step == 0.125  # type: ignore[attr-defined]
    own = system().simulate(2.0, samples=5, inputs={"one.tau": 1.0, "two.tau": 3.0}, method="rk")
    again = pickle.loads(pickle.dumps(own))
    assert again.request.max_step == own.request.max_step == pytest.approx(0.02)  # type: ignore[attr-defined]
    repeated = replace(own.request, times=own.time)  # type: ignore[attr-defined]
    assert repeated.max_step == own.request.max_step  # type: ignore[attr-defined]


def test_the_label_of_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model, and the interval from the start of the run, which may be no sample."""
    labels: list[str] = []

    @contextmanager
    def noted(progress: Any, label: str) -> Iterator[None]:
        labels.append(label)
        yield None

    monkeypatch.setattr("gearlib.run.simulate.reporting", noted)
    inputs = {"one.tau": 1.0, "two.tau": 0.0}
    system().simulate(2.0, t_start=0.5, times=[1.0, 1.5, 2.0], inputs=inputs, progress=True)
    assert labels == ["Bodies, 0.5 .. 2 s"]
    system().simulate(2.0, samples=3, inputs=inputs, progress=False)
    assert len(labels) == 1
