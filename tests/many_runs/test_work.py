"""Names of what is done in the runs of a sweep: each stands for one thing."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.many_runs.samples import as_samples
from gearlib.many_runs.work import check_names


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
