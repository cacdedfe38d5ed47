"""Signals that were sampled too rarely, judged by what they are between the samples."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gearlib.errors import GearlibWarning, SolverError
from gearlib.run.afterwards.folding import warn_of_folding

TIME = np.linspace(0.0, 2.0, 41)  # 0.05 s apart: waves of more than 10 Hz are folded


def said(signal: Callable[[Any], Any], asked: list[Any] | None = None, time: Any = TIME) -> list[str]:
    """What is said of a signal at the samples; the times at which it was read in between are appended."""

    def between(times: Any) -> Any:
        if asked is not None:
            asked.append(times)
        return signal(times)

    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        warn_of_folding("load.w", "rad/s", time, signal(time), between, 71)
    assert [one.category for one in found] == [GearlibWarning] * len(found)
    return [str(one.message) for one in found]


def wave(frequency: float, amplitude: float = 1.0) -> Callable[[Any], Any]:
    return lambda t: amplitude * np.sin(2 * np.pi * frequency * t + 0.3)


def test_a_wave_that_its_samples_show() -> None:
    asked: list[Any] = []
    assert said(wave(3.0), asked) == []
    assert np.concatenate(asked) == pytest.approx(np.linspace(0.025, 1.975, 40))  # in the middle between samples


def test_a_wave_that_looks_like_a_longer_one() -> None:
    """17 Hz at 20 samples per second look like 3 Hz: between the samples it is the opposite, for half of the time."""
    (text,) = said(wave(17.0))
    difference, spread = (float(text.split(mark)[1].split()[0].rstrip("),")) for mark in ("differs by ", "deviation "))
    between = TIME[1:] - 0.025
    alias = -np.sin(2 * np.pi * 3.0 * between - 0.3)  # sin(2 pi 17 t + 0.3) at the samples
    missed = wave(17.0)(between) - alias
    assert difference == pytest.approx(np.sqrt(np.mean(missed**2)), rel=0.01)
    assert spread == pytest.approx(np.std(wave(17.0)(TIME)), rel=1e-2)
    assert text.startswith("load.w is sampled too rarely: between the samples it differs by ")
    assert " rad/s from what they show (standard deviation " in text
    assert text.endswith("appear in the spectrum as longer ones; simulate with more samples than 71")


@pytest.mark.parametrize(("share", "noticed"), [(0.17, False), (0.18, True)])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_fifth_of_the_deviation_is_seen(share: float, noticed: bool, size: float) -> None:
    """Of a wave that is zero at all samples, beside one that they show: at 0.2 (sqrt(1/2) + share); whatever the unit."""
    assert bool(said(lambda t: size * (np.sin(2 * np.pi * t) + share * np.sin(2 * np.pi * 10.0 * t)))) == noticed


def test_a_constant_with_rounding() -> None:
    """Its deviation is all rounding: what differs by less than a millionth of it is no wave."""
    assert said(lambda t: 5.0 + 4e-6 * np.sin(2 * np.pi * 10.0 * t)) == []
    assert said(lambda t: 5.0 + 6e-6 * np.sin(2 * np.pi * 10.0 * t)) != []
    assert said(lambda t: -5.0 + 4e-6 * np.sin(2 * np.pi * 10.0 * t)) == []
    assert said(lambda t: 0.0 * t) == []


def test_a_constant_between_the_samples_is_no_wave_of_theirs() -> None:
    """A ramp is what it seems; a signal that is 0 at all samples and 1 between them is not."""
    assert said(lambda t: 3.0 * t) == []
    assert said(lambda t: np.where(np.isin(t, TIME), 0.0, 1.0))[0].startswith("load.w is sampled too rarely")


def test_a_run_that_cannot_be_repeated_is_not_judged() -> None:
    def fails(times: Any) -> Any:
        raise SolverError("it ended")

    warn_of_folding("load.w", "rad/s", TIME, wave(17.0)(TIME), fails, 71)
