"""Intervals between corners and samples, in whole units of the clock; and what the two ways to cross them cost."""

from __future__ import annotations

import numpy as np
import pytest

import gearlib as gl
from gearlib.solvers.exponential.corners import ENTRY, EXPONENTIAL, STEP, TERM, Intervals
from gearlib.solvers.exponential.dense import REACH


@pytest.mark.parametrize("t0", [0.0, -3.0, 1e3])
def test_boundaries_are_samples_and_the_corners_between_them(t0: float) -> None:
    times = t0 + np.array([0.0, 0.3, 0.3, 1.0])
    one = gl.Table(t0 + np.array([-1.0, 0.0, 0.25, 0.3, 1.0, 2.0]), np.arange(6.0))
    tables = [one, gl.Table(t0 + np.array([0.5, 0.5, 0.8]), [1.0, 2.0, 3.0])]
    cuts = Intervals.of(times, tables)
    expected = t0 + np.array([0.0, 0.25, 0.3, 0.5, 0.8, 1.0])
    assert cuts.ticks * cuts.unit == pytest.approx(expected, abs=2 * cuts.unit)
    assert cuts.rows.tolist() == [0, 2, 2, 5]
    assert cuts.lengths * cuts.unit == pytest.approx(np.diff(expected), abs=3 * cuts.unit)
    assert cuts.kinds.tolist() == sorted({*cuts.lengths.tolist()})
    assert cuts.unit < 1e-14 * max(abs(t0), 1.0)


def even(count: int) -> Intervals:
    return Intervals.of(np.array([0.0, 1.0]), [gl.Table(np.linspace(0.0, 1.0, count + 1), np.arange(count + 1.0))])


def test_costs_of_exponentials_and_of_series() -> None:
    """An exponential for each length that differs, a product for each interval; a series for each part of an interval."""
    for n, inputs in ((2, 1), (7, 3)):
        size = n + 2 * inputs
        products = STEP + ENTRY * size**2
        one, two = (even(count).costs(n, inputs, 1.0)[0] for count in (64, 128))
        assert two - one == pytest.approx(64 * products, rel=1e-9)
        assert one - 64 * products == pytest.approx(EXPONENTIAL + 20.0 * ENTRY * size**3, rel=1e-9)
        term = TERM + ENTRY * size**2
        for rate, parts in ((0.01, 1), (0.69 * 64, 1), (0.71 * 64, 2), (7.1 * REACH * 64, 8)):
            assert even(64).costs(n, inputs, rate)[1] == pytest.approx(12 * 64 * parts * term, rel=1e-9)


def test_uneven_intervals_take_an_exponential_each() -> None:
    t = np.cumsum(np.linspace(0.5, 1.5, 20))
    cuts = Intervals.of(np.array([0.0, float(t[-1])]), [gl.Table(np.append(0.0, t), np.arange(21.0))])
    assert len(cuts.kinds) == len(cuts.lengths) == 20
    assert cuts.costs(2, 1, 1.0)[0] > 20 * EXPONENTIAL
