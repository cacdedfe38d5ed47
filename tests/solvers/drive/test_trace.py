"""The motion between the ends of steps, from values and slopes there: exact for polynomials, and never across an event."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from gearlib.solvers.drive.trace import Trace, width

NOTHING = np.empty(0)


def trace(times: Any, *motions: Polynomial, origin: float = 0.0, pieces: int = 1) -> Trace:
    """Of steps with these ends; columns 3, 4, ... of a run with one discrete variable."""
    t = np.asarray(times, float)
    rows = np.column_stack([t, *(p(t) for p in motions), *(p.deriv()(t) for p in motions), np.arange(len(t), dtype=float)])
    assert rows.shape[1] == width(len(motions), 1)
    return Trace(np.array_split(rows, pieces), 3 + np.arange(len(motions)), origin)


def along(found: Trace, times: Any, sample_times: Any = NOTHING, samples: Any = None) -> Any:
    times = np.asarray(times, float)
    steps = np.clip(np.searchsorted(found.times, times, side="right") - 1, 0, len(found.times) - 2)
    given = np.empty((0, len(found.columns))) if samples is None else np.asarray(samples, float)
    return found.at(times, steps, np.asarray(sample_times, float), given)


def test_rows_are_times_states_rates_and_discrete_state() -> None:
    p, q = Polynomial([1.0, 2.0]), Polynomial([0.0, 0.0, 1.0])
    found = trace([0.0, 1.0, 3.0], p, q, origin=10.0, pieces=2)
    assert found.times.tolist() == [10.0, 11.0, 13.0]
    assert found.states.tolist() == [[1.0, 0.0], [3.0, 1.0], [7.0, 9.0]]
    assert found.rates.tolist() == [[2.0, 0.0], [2.0, 2.0], [2.0, 6.0]]
    assert found.discrete.tolist() == [[0.0], [1.0], [2.0]]


@pytest.mark.parametrize("steps", [1, 2, 3, 5, 9])
def test_polynomials_through_the_ends_of_up_to_five_steps_are_exact(steps: int) -> None:
    """The step itself and two on either side, as far as there are: values and slopes at n ends are a degree of 2 n - 1."""
    rng = np.random.default_rng(steps)
    ends = np.cumsum(rng.uniform(0.8, 1.2, steps + 1))
    for k in range(steps):
        degree = 2 * (2 + min(k, 2) + min(steps - 1 - k, 2)) - 1
        middle = Polynomial([-(ends[k] + ends[k + 1]) / 5, 0.4])
        low, high = (Polynomial(rng.normal(size=d + 1))(middle) for d in (degree - 2, degree))
        t = np.linspace(ends[k], ends[k + 1], 11)[:-1]
        fine, coarse = along(trace(ends, low, high), t)
        assert fine == pytest.approx(np.column_stack([low(t), high(t)]), abs=1e-7)
        assert coarse[:, 0] == pytest.approx(low(t), abs=1e-7)  # without its last two terms it is the same
        assert np.abs(coarse[:, 1] - high(t)).max() > 1e-6


def test_what_is_left_out_is_estimated() -> None:
    """A sine over few steps: the error is no larger than the difference to the coarser polynomial says."""
    ends = np.linspace(0.0, 6.0, 7)
    rows = np.column_stack([ends, np.sin(2 * ends), 2 * np.cos(2 * ends), 0 * ends])
    t = np.linspace(0.0, 6.0, 301)
    fine, coarse = along(Trace([rows], np.array([0]), 0.0), t)
    error, estimate = np.abs(fine[:, 0] - np.sin(2 * t)).max(), np.abs(fine - coarse).max()
    assert 1e-9 < error < 3 * estimate
    assert estimate < 0.1


def test_nothing_is_taken_from_beyond_an_event() -> None:
    """Two ends of one time: another motion begins there."""
    before, after = Polynomial([0.0, 1.0, 0.0, 2.0]), Polynomial([5.0, -1.0, 3.0, 1.0])
    first, last = np.array([0.0, 0.4, 1.0]), np.array([1.0, 1.5, 2.2])
    rows = [np.column_stack([t, p(t), p.deriv()(t), 0 * t]) for t, p in ((first, before), (last, after))]
    t = np.array([0.1, 0.5, 0.99, 1.01, 1.4, 2.1])
    fine, _ = along(Trace([np.concatenate(rows)], np.array([0]), 0.0), t)
    assert fine[:, 0] == pytest.approx(np.where(t < 1.0, before(t), after(t)), abs=1e-10)


def test_ends_that_are_close_or_far_are_passed_over() -> None:
    """Steps of very unlike lengths: neither a tiny neighbour nor a distant one spoils the polynomial."""
    p = Polynomial(np.random.default_rng(1).normal(size=4))
    for ends in ([0.0, 1e-9, 1.0, 1.0 + 1e-12, 2.0], [0.0, 1e6, 1e6 + 1e-3, 1e6 + 2e-3], [0.0, 1e-12, 2e-12, 5.0]):
        found = trace(ends, p)
        for a, b in zip(ends[:-1], ends[1:], strict=True):
            t = np.array([a + 0.3 * (b - a)])
            assert along(found, t)[0][:, 0] == pytest.approx(p(t), rel=1e-9)


def test_samples_help_where_there_are_few_ends() -> None:
    """One step, with its middle and quarters as samples: degree 6; those outside the step, or away from the quarters, do not."""
    p = Polynomial(np.random.default_rng(2).normal(size=7))
    found, t = trace([0.0, 1.0], p), np.linspace(0.0, 1.0, 11)
    inner = np.array([-0.5, 0.25, 0.5, 0.75, 1.5])
    assert along(found, t, inner, p(inner)[:, None])[0][:, 0] == pytest.approx(p(t), abs=1e-12)
    wrong = np.array([-0.01, 0.0, 0.37, 1.0, 1.2])
    without, beside = along(found, t), along(found, t, wrong, np.full((5, 1), 99.0))
    assert beside[0].tolist() == without[0].tolist()
