"""Result files by processor time, as a ratio to `scipy.io.savemat` of the same arrays, in turn in one process."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import gearlib as gl
from tests.benchmarks.scenes import Chain

pytestmark = pytest.mark.benchmark
SAMPLES, VARIABLES, RUNS = 5000, 235, 15


def least(*functions: Callable[[], object]) -> list[float]:
    """The least processor time of each, s."""
    spent: list[list[float]] = [[] for _ in functions]
    for _ in range(RUNS):
        for function, times in zip(functions, spent, strict=True):
            start = time.process_time()
            function()
            times.append(time.process_time() - start)
    return [min(times) for times in spent]


def test_dymolas_format_costs_little_more_than_its_arrays(tmp_path: Path) -> None:
    names = [
        f"{part}[{k}].{v}"
        for k in range(50)
        for part, v in zip(["body"] * 2 + ["shaft"] * 3, ("w", "a", "tau", "phi_rel", "w_rel"))
    ]
    names = [name for name in names if not name.startswith("shaft[49]")][:VARIABLES]
    result = gl.compile(Chain(N=50), outputs=names).simulate(0.05, samples=SAMPLES)
    arrays = np.array([result[name] for name in names])
    assert arrays.shape == (VARIABLES, SAMPLES)
    result.save(tmp_path / "r.mat", names=names)
    data = {"Aclass": np.zeros((4, 11)), "data_1": np.zeros((2, 2)), "data_2": np.vstack([result.time, arrays])}
    own, plain = least(
        lambda: result.save(tmp_path / "r.mat", names=names), lambda: savemat(tmp_path / "p.mat", data, format="4")
    )
    print(
        f"\n.mat of {SAMPLES} samples x {VARIABLES} variables: {1e3 * own:.1f} ms, {own / plain:.1f} times savemat's {1e3 * plain:.1f} ms"
    )
    assert own < 10 * plain
