"""Every user's scene, over a short stretch: it compiles, and its reference says what gearlib says."""

from __future__ import annotations

import numpy as np
import pytest

import gearlib as gl
from tests.benchmarks.users import USERS

SAMPLES = {
    "crank train": 11,
    "eight speeds": 211,
    "hybrid": 121,
    "coupled clutches": 201,
    "dual clutch": 401,
}  # events included


@pytest.mark.parametrize("name", USERS)
def test_reference_and_gearlib_agree(name: str) -> None:
    scene = USERS[name]
    times = scene.times[: SAMPLES.get(name, 21)]
    if name == "revolutions":
        times = np.linspace(0.0, 0.1, 21)  # ten of them
    system = gl.compile(scene.component(), outputs=list(scene.outputs))
    found = system.simulate(times[-1], times=times, inputs=scene.inputs, start=scene.start, rtol=1e-8)
    right = scene.reference(times)
    got = np.column_stack([found[output] for output in scene.outputs])
    assert np.all(np.abs(got - right) <= 1e-5 * np.abs(right).max(axis=0))


def test_the_reference_of_many_revolutions() -> None:
    """Collocation with its equations inlined, and SciPy on the equations that others are given."""
    scene, times = USERS["revolutions"], np.linspace(0.0, 0.1, 21)
    assert scene.by_hand is not None
    right = scene.by_hand.solved(times)
    assert np.all(np.abs(scene.reference(times) - right) <= 1e-10 * np.abs(right).max(axis=0))
