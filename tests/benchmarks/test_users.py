"""Users' scenes to their ends: errors against references by hand, and ``auto`` against each method by processor time in turn."""

from __future__ import annotations

import time
from functools import cache

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from tests.benchmarks.users import USERS

pytestmark = pytest.mark.benchmark
METHODS = ("rk5", "rk8", "ida", "exact", "auto")
OVERHEAD = 0.5e-3  # s, of the choice itself


@cache
def compiled(name: str) -> gl.System:
    return gl.compile(USERS[name].component(), outputs=list(USERS[name].outputs))


def run(name: str, method: str, rtol: float) -> gl.Result:
    scene = USERS[name]
    return compiled(name).simulate(
        scene.times[-1], times=scene.times, inputs=scene.inputs, start=scene.start, method=method, rtol=rtol
    )


@pytest.mark.parametrize("name", USERS)
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_errors_follow_the_tolerance(name: str, rtol: float) -> None:
    found = run(name, "auto", rtol)
    assert USERS[name].error(np.column_stack([found[output] for output in USERS[name].outputs])) < 20 * rtol


@pytest.mark.parametrize("name", USERS)
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_auto_near_the_best_method(name: str, rtol: float) -> None:
    spent: dict[str, list[float]] = {}
    for _ in range(5):
        for method in METHODS:
            if min(spent.get(method, [0.0])) > 10 * min(spent.get("rk5", [np.inf])):
                continue  # hopeless
            start = time.process_time()
            try:
                run(name, method, rtol)
            except ArgumentError:
                continue  # not linear
            spent.setdefault(method, []).append(time.process_time() - start)
    best = {method: min(times) for method, times in spent.items()}
    assert best.pop("auto") < 1.3 * min(best.values()) + OVERHEAD
