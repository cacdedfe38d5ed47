"""Stability of random trains against eigenvalues of matrices that are put together without gearlib."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from tests.linear.random_trains import Train, draw, matrices, sensor_name


def by_eigenvalues(A: Any) -> tuple[str, int, bool]:
    """Verdict, number of eigenvalues in the right half-plane, and whether rounding leaves both in doubt."""
    values = np.linalg.eigvals(A)
    real = values.real / np.abs(values).max()
    verdict = "unstable" if real.max() > 1e-11 else "stable" if real.max() < -1e-11 else "marginal"
    return verdict, int((real > 1e-11).sum()), bool(((np.abs(real) > 1e-13) & (np.abs(real) < 1e-9)).any())


def compare(seed: int) -> tuple[str, str] | None:
    """The verdicts without and with the loop, which are those of the eigenvalues; None if these are in doubt."""
    drawn = draw(np.random.default_rng(seed))
    A, b, c = matrices(drawn)
    closed = A - drawn.gain * np.outer(b, c)
    expected = by_eigenvalues(A), by_eigenvalues(closed)
    if expected[0][2] or expected[1][2]:
        return None
    report = gl.stability(gl.compile(Train(drawn=drawn)), ("torque.tau", sensor_name(drawn)), gain=drawn.gain)
    loop = report.loop
    assert loop is not None
    assert len(report.eigenvalues) == len(A), seed
    assert report.verdict == expected[0][0], (seed, report.eigenvalues, np.linalg.eigvals(A))
    assert loop.verdict == expected[1][0], (seed, np.linalg.eigvals(closed))
    assert loop.closed_poles.verdict == expected[1][0], seed
    assert loop.nyquist.closed_right == expected[1][1], seed
    return report.verdict, loop.verdict


def check(seeds: range) -> None:
    seen = [compare(seed) for seed in seeds]
    sure = [verdicts for verdicts in seen if verdicts is not None]
    assert len(sure) > 0.9 * len(seen)
    assert {v for v, _ in sure} == {"stable", "marginal"}  # trains are passive
    counts = [sum(v == verdict for _, v in sure) for verdict in ("stable", "marginal", "unstable")]
    assert min(counts) > 0.05 * len(sure)


def test_verdict_is_that_of_the_eigenvalues() -> None:
    check(range(40))


@pytest.mark.slow
def test_verdict_is_that_of_the_eigenvalues_on_a_thousand_trains() -> None:
    check(range(1000))
