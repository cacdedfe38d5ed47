"""The true error follows the tolerance: error / rtol on the scenes of the benchmarks, method by method."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.benchmarks.contestants import START, compiled
from tests.benchmarks.references import SCENES, BenchScene, smooth_reference
from tests.stress.tables import STEPPED

TOLERANCES = tuple(10.0**-k for k in range(3, 13))


def with_deflection(scene: BenchScene) -> BenchScene:
    """The fan's loop, judged by its shaft's deflection as well.

    Of the three states the deflection has the largest error, and it limits the steps: the speeds alone, whose errors are
    six to sixty times smaller than the deflection's, say little about whether the steps are as long as the tolerance allows.
    """
    hand = replace(scene.by_hand(), outputs=np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]))
    return replace(
        scene,
        outputs=(*scene.outputs, "shaft.phi_rel"),
        groups=(*scene.groups, 2),
        reference=cache(lambda: smooth_reference(hand, scene.times)),
    )


JUDGED = SCENES | {"M2": with_deflection(SCENES["M2"])}


@cache
def ratio(name: str, method: str, rtol: float) -> float:
    """Error over tolerance: the largest error of any output, over that output's largest value."""
    scene = JUDGED[name]
    result = compiled(name).simulate(scene.times[-1], times=scene.times, method=method, rtol=rtol, start=START.get(name))
    return scene.error(np.column_stack([result[output] for output in scene.outputs])) / rtol


def in_band(name: str, method: str, rtol: float) -> bool:
    # At 1e-12 IDA takes half a million steps, each of which rounds the pinion's angle, 160 rad in the end, by some 1e-14: they add up
    # to 1e-11 rad, and the flanks meet 2e-14 s early or late, which is 1e-10 of the deflection.
    above = 300.0 if (name, method) == ("M3", "ida") and rtol < 5e-12 else 100.0
    found = ratio(name, method, rtol)
    assert 0.01 < found < above, f"{name}, {method}, rtol {rtol:.0e}: error / rtol = {found:.3g}"
    return True


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("name", ["XP", "M2"])
def test_errors_of_two_scenes_follow_the_tolerance(name: str, method: str, rtol: float) -> None:
    assert in_band(name, method, rtol)


@pytest.mark.stress
@pytest.mark.parametrize(("name", "method"), list(itertools.product(SCENES, STEPPED)))
def test_errors_follow_the_tolerance(name: str, method: str) -> None:
    assert all(in_band(name, method, rtol) for rtol in TOLERANCES)


@pytest.mark.stress
@pytest.mark.parametrize("name", [n for n, scene in SCENES.items() if scene.linear])
def test_exact_is_exact_at_any_tolerance(name: str) -> None:
    """To rounding errors, or for a large chain to those of the exponential's action."""
    assert all(ratio(name, "exact", rtol) * rtol < 3e-11 for rtol in TOLERANCES)
