"""Random trains: energy balance closes, IDA and Runge-Kutta agree, the order of construction is irrelevant, nothing is NaN."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gearlib as gl
from tests.stress.trains import blueprint, compiled, random_parameters

RTOL = 1e-8
# Undamped vibration of stiff meshes lets Runge-Kutta of order 5 lose a factor of 1000 where stability limits its steps.
LOST = {"rk5": 3e3}
TIMES = np.linspace(0.0, 0.05, 11)


def run(system: gl.System, bodies: int, parameters: dict[str, float], method: str) -> tuple[Any, Any, Any]:
    result = system.simulate(TIMES[-1], times=TIMES, method=method, rtol=RTOL, parameters=parameters)
    speeds = np.column_stack([result[f"body_{i}.w"] for i in range(bodies)])
    return speeds, result["work"], result["stored"]


def check(seed: int, numbers: int, methods: Sequence[str]) -> None:
    """All methods agree; what came in is what is stored."""
    bodies, _ = blueprint(seed)
    parameters = random_parameters(seed, numbers)
    found = {m: run(compiled(seed), bodies, parameters, m) for m in methods}
    label = f"train {seed}, parameters {numbers}: {parameters}"
    scale = max(np.abs(found[methods[0]][0]).max(), 1.0)  # 1 rad/s and 1 J are the nominal values
    for method, (speeds, work, stored) in found.items():
        assert np.isfinite(speeds).all(), f"{method} returned a number that is not finite; {label}"
        energy = max(np.abs(work).max(), np.abs(stored).max(), 1.0)
        assert np.abs(work - stored + stored[0]).max() <= 100 * RTOL * energy, f"{method}'s energies do not balance; {label}"
        assert np.abs(speeds - found[methods[0]][0]).max() <= LOST.get(method, 300) * RTOL * scale, (
            f"{method} against {methods[0]}; {label}"
        )


@pytest.mark.parametrize("seed", [3, 4, 11])
def test_a_few_trains(seed: int) -> None:
    for numbers in range(20):
        check(seed, numbers, ("rk8", "ida"))
    for numbers in range(20, 30):
        check(seed, numbers, ("rk8", "rk5", "auto"))


@pytest.mark.parametrize("seed", [11])
def test_order_of_construction(seed: int) -> None:
    reordered(seed, 1, range(2))


def reordered(seed: int, order: int, numbers: Sequence[int]) -> None:
    bodies, _ = blueprint(seed)
    for number in numbers:
        parameters = random_parameters(seed, number)
        one, other = (run(compiled(seed, k), bodies, parameters, "rk8")[0] for k in (0, order))
        assert np.abs(one - other).max() <= 300 * RTOL * max(np.abs(one).max(), 1.0), f"train {seed}, parameters {number}"


@pytest.mark.stress
@settings(max_examples=4000)
@given(st.integers(0, 79), st.integers(0, 10**6))
def test_thousands_of_trains(seed: int, numbers: int) -> None:
    check(seed, numbers, ("rk8", "rk5", "auto"))


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(30))
def test_ida_agrees(seed: int) -> None:
    for numbers in range(20):
        check(seed, numbers, ("rk8", "ida"))


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(20))
def test_order_of_construction_at_length(seed: int) -> None:
    reordered(seed, 1 + seed, range(5))
