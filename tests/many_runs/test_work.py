"""Names of what is done in the runs of a sweep: each stands for one thing; and rows that are no others'."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.many_runs.samples import as_samples
from gearlib.many_runs.work import ManyRows, Row, blank, check_names, put


@pytest.mark.parametrize(
    ("given", "results", "axes", "said"),
    [
        ({"a": [1.0, 2.0], "b": 3.0}, ["c"], ["time"], ""),
        ({"a": [1.0, 2.0], "b": 3.0}, ["c", "b"], [], "b is given to the runs and is a result, too"),
        ({"time": [1.0, 2.0]}, ["c"], ["time"], "time is given to the runs and is an axis of the results, too"),
        ({"a": [1.0, 2.0]}, ["mode"], ["time", "mode"], "mode is a result and is an axis of the results, too"),
        ({"a": [1.0, 2.0]}, ["run"], [], "run is a result and is an axis of the results, too"),
        ({"run": 1.0}, ["c"], [], "run is given to the runs and is an axis of the results, too"),
        (gl.grid(a=[1.0, 2.0]), ["run"], [], ""),  # whose axis is called a
        (gl.grid(run=[1.0, 2.0]), ["c"], [], "run is given to the runs and is an axis of the results, too"),
    ],
)
def test_a_name_stands_for_one_thing(given: Any, results: list[str], axes: list[str], said: str) -> None:
    samples = as_samples(given)
    if not said:
        check_names(samples, results, axes)
        return
    with pytest.raises(ArgumentError) as refused:
        check_names(samples, results, axes)
    assert str(refused.value) == f"{said}; give the result another name: reduce={{'name': function}}"


def test_a_number_does_not_stand_for_several() -> None:
    """Nor do the real parts of complex numbers for these."""
    values = blank({"a": np.ones(2), "b": 3.0}, 4)
    with pytest.raises(
        ArgumentError, match=r"^a has the shape \(1,\) in this run and \(2,\) in the first one; all must be alike$"
    ):
        put(values, {}, 1, Row({"a": np.zeros(1), "b": 1.0}))
    with pytest.raises(ArgumentError, match=r"^a has the shape \(1,\) in this run"):
        put(values, {}, np.array([0, 2]), ManyRows({"a": np.zeros((2, 1)), "b": np.zeros(2)}, {}))
    with pytest.raises(ArgumentError, match=r"^b is complex in this run and was real in the first one; all must be alike$"):
        put(values, {}, np.array([0, 2]), ManyRows({"a": np.zeros((2, 2)), "b": np.array([1j, 2.0])}, {}))
    assert all(np.isnan(column).all() for column in values.values())
