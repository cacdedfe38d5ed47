"""Noise by name, parts of complex values, and free parameters beside free start values."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.fitting.measured import as_real, checked_noise, split


def test_parts_of_complex_values_follow_each_other() -> None:
    assert as_real([1.0 + 2j, 3.0 - 4j]).tolist() == [1.0, 3.0, 2.0, -4.0]
    assert as_real([[1j, 2.0]]).tolist() == [[0.0, 2.0], [1.0, 0.0]]
    assert as_real([1, 2]).tolist() == [1.0, 2.0]
    assert as_real([1, 2]).dtype == float


def test_noise_by_name() -> None:
    assert checked_noise(None, ["a", "b"]) == {}
    assert checked_noise(2, ["a", "b"]) == {"a": 2.0, "b": 2.0}
    assert checked_noise({"b": 3}, ["a", "b"]) == {"b": 3.0}
    with pytest.raises(NameLookupError, match="noise names 'c', which was not measured"):
        checked_noise({"c": 3}, ["a", "b"])
    for wrong in (0.0, -1e-300):
        with pytest.raises(ArgumentError, match=f"noise of a is {wrong}; expected a standard deviation above 0"):
            checked_noise({"a": wrong}, ["a"])


def test_parameters_and_start_values_are_told_apart() -> None:
    assert split({"a.c": 1.0, "start(b.w)": 2.0, "d": 3.0}) == ({"a.c": 1.0, "d": 3.0}, {"b.w": 2.0})
    assert split({}) == ({}, {})


@pytest.mark.parametrize("number", [2, 3])
def test_modes_of_a_train_that_turns_are_those_that_vibrate(chain: Any, number: int) -> None:
    """Three bodies: it turns in one way, and vibrates in two."""
    found = gl.MeasuredModes([1.0, 2.0], numbers=[1, 0]).predicted(chain(n=3), {"d": 1.0})
    assert found.values[0] == pytest.approx(gl.modes(chain(n=3), parameters={"d": 1.0}).frequencies[[2, 1]])
    with pytest.raises(ArgumentError, match=f"numbers names mode {number}; the system has 2 that vibrate"):
        gl.MeasuredModes([1.0], numbers=[number]).predicted(chain(n=3), {"d": 1.0})


def test_what_is_masked_is_missing() -> None:
    values = np.ma.masked_array([1, 99, 2], [0, 1, 0])  # a file of whole numbers with a gap
    found = gl.MeasuredHistories({"time": [0.0, 1.0, 2.0], "load.w": values}).columns["load.w"]
    assert np.isnan(found).tolist() == [False, True, False]
