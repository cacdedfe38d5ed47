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


def ends_by_hand(t: Any, k: int) -> list[int]:
    """Of a step and up to two others on either side, none beyond an event: half a step apart at least, and within twenty of it."""
    h = t[k + 1] - t[k]
    first = max((i + 1 for i in range(k) if t[i] == t[i + 1]), default=0)
    last = min((i for i in range(k + 1, len(t) - 1) if t[i] == t[i + 1]), default=len(t) - 1)

    def following(end: int | None, way: int) -> int | None:
        others = [] if end is None else range(end - 1, first - 1, -1) if way < 0 else range(end + 1, last + 1)
        return next((i for i in others if abs(t[i] - t[end]) >= 0.5 * h), None)

    before, after = following(k, -1), following(k + 1, 1)
    others = before, after, following(before, -1), following(after, 1)
    return [k, k + 1, *(i for i in others if i is not None and abs(t[i] - t[k]) <= 20.0 * h)]


def newton_by_hand(nodes: list[float], values: list[float], slopes: list[float], at: float) -> tuple[float, float]:
    """Value of the polynomial, and less the estimated error; nodes that occur twice are followed by each other."""

    def divided(i: int, j: int) -> float:
        if i == j:
            return values[i]
        return slopes[i] if nodes[i] == nodes[j] else (divided(i + 1, j) - divided(i, j - 1)) / (nodes[j] - nodes[i])

    factors = [divided(0, i) for i in range(len(nodes))]
    terms, middle = (
        [c * np.prod([x - node for node in nodes[:i]]) for i, c in enumerate(factors)]
        for x in (at, 0.5 * (nodes[0] + nodes[2]))
    )
    last, before = np.abs(middle[-2:]).sum(), np.abs(middle[1:][-4:-2]).sum()
    share = last / before if last < before else 1.0
    return sum(terms), sum(terms) - (share if len(nodes) > 7 else share**0.5) * sum(terms[-2:])


@pytest.mark.parametrize("seed", range(6))
def test_values_and_error_estimates_are_those_of_newtons_polynomial(seed: int) -> None:
    """Steps of like or unlike lengths and events among them; with samples near the quarters where at most one other end is near."""
    rng = np.random.default_rng(seed)
    h = rng.uniform(0.5, 1.5, 12) if seed < 2 else 10.0 ** rng.uniform(-1.2, 1.2, 12)
    h[[4, 7] if seed % 2 else []] = 0.0
    t = np.cumsum([2.0, *h])
    rows = np.column_stack([t, *(f(w * t) for f in (np.sin, lambda a: 1.0 * np.cos(a)) for w in (0.1, 0.13)), 0 * t])
    sample_times = np.sort(rng.uniform(t[0], t[-1], 30)) if seed > 2 else NOTHING
    samples = np.column_stack([np.exp(-0.1 * sample_times), sample_times])
    found = Trace([rows], np.array([0, 1]), 0.0)
    for k in np.flatnonzero(np.diff(t)):
        step = t[k + 1] - t[k]
        inner = [int(np.argmin(abs(sample_times - t[k] - q * step))) for q in (0.5, 0.25, 0.75)] if len(sample_times) else []
        inner = [
            i for i, q in zip(inner, (0.5, 0.25, 0.75), strict=False) if abs(sample_times[i] - t[k] - q * step) < 0.1 * step
        ]
        ends = ends_by_hand(t, k)
        inner = inner if len(ends) < 4 else []
        nodes = [*np.repeat(t[ends], 2), *sample_times[inner]]
        at = t[k] + step * np.array([0.0, 0.21, 0.5, 0.93])
        fine, coarse = found.at(at, np.full(4, k), sample_times, samples)
        for j in range(2):
            values, slopes = ([*np.repeat(rows[ends, 1 + j + d], 2), *samples[inner, j]] for d in (0, 2))
            expected = np.array([newton_by_hand(nodes, values, slopes, x) for x in at])
            assert np.stack([fine[:, j], coarse[:, j]], axis=1) == pytest.approx(expected, rel=1e-7, abs=1e-9)
