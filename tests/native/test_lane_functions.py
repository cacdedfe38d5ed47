"""Sines and cosines of lanes, carried out by Python: to rounding, without a bias, up to where the numbers of half turns are exact."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from gearlib.native import lane_functions
from gearlib.native.lane_functions import FUNCTIONS, FURTHEST

ARGUMENTS = {"sin": ("sin", 0.0, 1.0), "cos": ("cos", 0.5, -1.0)}


def carried_out(name: str) -> tuple[Callable[[float], float], list[float]]:
    """The function, and the arguments that it leaves to the C library."""
    left: list[float] = []

    def library(x: float) -> float:
        left.append(x)
        return 7.0

    names: dict[str, object] = {"any_of": bool, name: library}
    exec("from __future__ import annotations\n" + lane_functions.source(*ARGUMENTS[name]), names)
    return names[f"{name}_of_lanes"], left  # type: ignore[return-value]


@pytest.mark.parametrize("name", ARGUMENTS)
def test_the_function_is_the_libraries(name: str) -> None:
    function, left = carried_out(name)
    exact = getattr(math, name)
    rng = np.random.default_rng(1)
    for size in (1e-9, 0.1, 1.0, 10.0, 1e3, 1e5, FURTHEST):
        for x in (rng.uniform(-size, size, 60)).tolist():
            assert function(x) == pytest.approx(exact(x), rel=1e-15, abs=4e-16)
    assert left == []
    assert FUNCTIONS[name] == lane_functions.source(*ARGUMENTS[name])


@pytest.mark.parametrize("name", ARGUMENTS)
def test_no_term_is_left_out(name: str) -> None:
    """Where the last ones count most, a quarter turn from a zero, errors are those of rounding: they cancel in the mean."""
    function, _ = carried_out(name)
    turn = 0.5 * math.pi if name == "sin" else 0.0
    near = turn + np.linspace(-0.05, 0.05, 2001)
    errors = [function(x) - getattr(math, name)(x) for x in near.tolist()]
    assert abs(np.mean(errors)) < 4e-17
    assert max(map(abs, errors)) < 3e-16


@pytest.mark.parametrize("name", ARGUMENTS)
def test_far_arguments_are_left_to_the_library(name: str) -> None:
    function, left = carried_out(name)
    far = [1.001 * FURTHEST, -1.001 * FURTHEST, math.inf, math.nan]
    assert [function(x) for x in far] == [7.0] * 4
    assert left[:3] == far[:3]
    function(FURTHEST)
    assert len(left) == 4
