"""The arguments of a run at their limits: what is taken, and what is refused with the numbers in the message."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from gearlib.errors import ArgumentError
from gearlib.run import request
from gearlib.run.request import absolute_tolerance, check_form, check_options, output_times


def refused(call: Any, *arguments: Any, said: str, **named: Any) -> None:
    with pytest.raises(ArgumentError, match=re.escape(said)):
        call(*arguments, **named)


@pytest.mark.parametrize(
    ("start", "end", "samples"), [(0.0, 1.0, 2), (0.0, 1.0, 11), (-3.5, 7.25, 100), (1e9, 1e9 + 1e-3, 1001)]
)
def test_even_times_are_those_of_linspace(start: float, end: float, samples: int) -> None:
    assert output_times(start, end, samples, None).tolist() == np.linspace(start, end, samples).tolist()


def test_times_that_are_given() -> None:
    """At the bounds, also a single one; a copy of what is given."""
    given = np.array([1.0, 1.5, 3.0])
    found = output_times(1.0, 3.0, None, given)
    given[0] = 7.0
    assert found.tolist() == [1.0, 1.5, 3.0]
    assert output_times(0.0, 3.0, None, [0.0]).tolist() == [0.0]
    assert len(output_times(0.0, 1.0, None, None)) == 501
    increasing = "expected an increasing sequence of finite numbers, s"
    for wrong in ([0.0, 1.0, 1.0], [1.0, 0.5], [0.0, np.inf], [np.nan], [[0.0, 1.0]], [], 1.0, "soon"):
        refused(output_times, 0.0, 2.0, None, wrong, said=increasing)
    for wrong, text in (([0.5, 2.0], "(1 .. 3), got 0.5 .. 2 s"), ([1.0, 3.5], "(1 .. 3), got 1 .. 3.5 s")):
        refused(output_times, 1.0, 3.0, None, wrong, said=text)
    refused(output_times, 0.0, 1.0, 3, [0.5], said="give samples or times, not both")


def test_length_of_a_run() -> None:
    for t_end in (1.0, 0.5, math.nan):
        refused(output_times, 1.0, t_end, None, None, said=f"t_end ({t_end:g}) must be greater than t_start (1)")
    for t_end in (1e-200, 1e200):
        assert output_times(0.0, t_end, 2, None).tolist() == [0.0, t_end]
    for t_end in (0.9e-200, 1.1e200, math.inf):
        refused(output_times, 0.0, t_end, 2, None, said="s after the start; expected 1e-200 to 1e+200 s")
    refused(output_times, -2e200, 1e200, 2, None, said="t_end is 1e+200, 3e+200 s after the start; expected 1e-200")
    refused(output_times, 0.0, 1.0, 1, None, said="samples")


def test_samples_that_memory_cannot_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight bytes each for time and states; little is allowed whatever the machine says."""
    monkeypatch.setattr(request, "physical_memory", lambda: 3e8)
    with pytest.raises(ArgumentError, match=r"time and 9 states .* take 0\.301 GB, and this machine has 0\.3;.*times=\[2\]"):
        output_times(0.0, 2.0, 3_760_000, None, 9)
    assert len(output_times(0.0, 2.0, 3_750_000, None, 9)) == 3_750_000
    monkeypatch.setattr(request, "physical_memory", lambda: 0.0)
    assert len(output_times(0.0, 2.0, 1_250_000, None, 9)) == 1_250_000
    refused(output_times, 0.0, 2.0, 1_250_001, None, 9, said="ask for fewer")


def test_samples_that_are_not_distinct() -> None:
    """At 1e6 s numbers are 1.2e-10 s apart, at -1e6 s as well."""
    end = 1e6 + 2.0**-30
    assert len(output_times(1e6, end, 9, None)) == len(output_times(-end, -1e6, 9, None)) == 9
    refused(
        output_times, 1e6, end, 10, None, said=f"samples is 10: so many times between 1000000.0 and {end!r} s are not distinct"
    )
    refused(output_times, -end, -1e6, 10, None, said="are not distinct in double precision")


def test_tolerances_and_steps_at_their_limits() -> None:
    for rtol in (1e-13, 0.1):
        check_options("rk", rtol, 1e-200)
    for rtol in (0.99e-13, 0.11, math.nan, "small", True):
        refused(check_options, "rk", rtol, None, said="expected a number from 1e-13 to 0.1")
    for step in (0.0, 0.9e-200, -1.0, math.nan, "short"):
        refused(check_options, "rk", 1e-6, step, said="expected a positive number of seconds, or None")


def test_absolute_tolerances() -> None:
    assert absolute_tolerance(None, 3) is None
    for given in (1e-3, [1e-3], [1e-3] * 3):
        found = absolute_tolerance(given, 3)
        assert found is not None
        assert found.tolist() == [1e-3] * 3
    for wrong in (0.0, -1.0, [1.0, 0.0, 1.0], [1.0, 1.0], [[1.0] * 3]):
        refused(absolute_tolerance, wrong, 3, said="expected positive numbers: one, or one for each of the 3 states")


def test_forms_and_backends() -> None:
    check_form("rk", "ode", "native")
    check_form("ida", "dae", "sksundae")
    refused(check_form, "rk", "dae", "native", said="form='dae' is a choice of method='ida', and the method is rk")
    refused(check_form, "rk", "ode", "sksundae", said="backend='sksundae' is a choice of method='ida'")
    refused(check_form, "ida", "torm", "native", said="there is no form 'torm'; did you mean 'torn'")
    refused(check_form, "ida", "ode", 2, said="there is no backend 2; Valid names: native, sksundae")
