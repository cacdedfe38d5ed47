"""Collocation points of a period: integrals that are known, and where relations switch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from gearlib.periodic import periods as parts
from gearlib.periodic.periods import fourier, jumps, moments, turn
from tests.periodic.models import FRICTION, STIFF, STOP, driven, motion

OMEGA = 0.8


def crossings() -> list[tuple[float, int]]:
    """Phases at which the motion passes the stop (0) and the friction turns (1), from its series alone."""
    c = motion(OMEGA)

    def x(p: float) -> np.ndarray:
        return (fourier(np.array([p]), 3) @ c)[0]

    found = []
    for kind, value in enumerate((lambda p: x(p)[0] - STOP, lambda p: x(p)[1] + 0.3 * x(p)[0] - 0.1 * np.cos(p))):
        grid = np.linspace(0, 2 * np.pi, 721)
        signs = np.sign([value(p) for p in grid])
        found += [(brentq(value, grid[k], grid[k + 1], xtol=1e-14), kind) for k in np.flatnonzero(signs[1:] != signs[:-1])]
    return sorted(found)


def test_series_and_its_derivative() -> None:
    phase = np.array([0.3, 2.0, 5.0])
    assert fourier(phase, 2) == pytest.approx(
        np.array([[1, np.cos(p), np.sin(p), np.cos(2 * p), np.sin(2 * p)] for p in phase])
    )
    c = np.random.default_rng(1).normal(size=9)
    slope = (fourier(phase + 1e-6, 4) @ c - fourier(phase - 1e-6, 4) @ c) / 2e-6
    assert fourier(phase, 4) @ (turn(4) @ c) == pytest.approx(slope, rel=1e-8)


@pytest.mark.parametrize("samples", [64, 200])
def test_pieces_between_switches_integrate_what_is_smooth_in_them(samples: int) -> None:
    """Weights sum to one; a piece has at least as many points as the grid has in it, and constant flags."""
    found, edges = moments(driven(OMEGA), motion(OMEGA), samples), crossings()
    assert len(edges) == 4
    assert found.cuts == pytest.approx([p for p, _ in edges], abs=200.0 / samples**4)
    assert samples <= len(found.phase) <= samples + 8 * len(edges)
    assert found.weights.sum() == pytest.approx(1.0, rel=1e-13)
    ends = [*found.cuts[1:], found.cuts[0] + 2 * np.pi]
    for begin, end in zip(found.cuts, ends, strict=True):
        inside = (found.phase > begin) & (found.phase < end)
        assert found.weights[inside].sum() == pytest.approx((end - begin) / (2 * np.pi), rel=1e-12)
        assert (found.discrete[:, inside] == found.discrete[:, inside][:, :1]).all()
        for k in (1, 2, 5):
            integral = (np.sin(k * end) - np.sin(k * begin)) / k / (2 * np.pi)
            assert found.weights[inside] @ np.cos(k * found.phase[inside]) == pytest.approx(integral, abs=1e-13)
    assert [(a, b) for a, b, _ in found.pieces] == list(zip(found.cuts, ends, strict=True))


def test_flags_are_those_of_the_motion_on_either_side_of_a_cut() -> None:
    found = moments(driven(OMEGA), motion(OMEGA), 100)
    for i in range(4):
        assert (found.before[:, i] != found.after[:, i]).sum() == 1
        assert np.flatnonzero(found.before[:, i] != found.after[:, i])[0] == found.relation[i]
        assert (found.after[:, i - 1] == found.before[:, i]).all()
        assert (found.pieces[i][2] == found.after[:, i]).all()
    assert len({found.relation[i] for i, (_, kind) in enumerate(crossings()) if kind == 0}) == 1


def test_where_nothing_switches_points_are_equidistant() -> None:
    c = motion(OMEGA)
    c[1:] *= 1e-3
    c[0] = 0.2, 1.0  # always below the stop, and forwards
    found = moments(driven(OMEGA), c, 33)
    assert found.phase == pytest.approx(2 * np.pi * np.arange(33) / 33)
    assert found.weights == pytest.approx(np.full(33, 1 / 33))
    assert (len(found.cuts), len(found.relation), found.before.shape[1], found.after.shape[1]) == (0, 0, 0, 0)
    assert [(a, b) for a, b, _ in found.pieces] == [(0.0, 2 * np.pi)]
    assert jumps(driven(OMEGA), c, found, np.ones(2)) is None


def test_jumps_are_those_of_the_friction() -> None:
    """At a turn it changes by twice its size, and its condition passes zero as fast as is known; the stop has a corner only."""
    c = motion(OMEGA)
    cuts = jumps(driven(OMEGA), c, moments(driven(OMEGA), c, 200), np.array([1.0, 0.5]))
    assert cuts is not None
    assert cuts.phase == pytest.approx([p for p, _ in crossings()], abs=2e-7)
    turned = np.array([kind == 1 for _, kind in crossings()])
    assert np.abs(cuts.jump[~turned]).max() < 1e-6
    assert cuts.gradient[~turned] == pytest.approx(np.tile([1.0, 0.0], (2, 1)), abs=1e-8)
    p, jump, gradient = cuts.phase[turned], cuts.jump[turned], cuts.gradient[turned]
    x, slope = fourier(p, 3) @ c, fourier(p, 3) @ (turn(3) @ c)
    passing = slope @ [0.3, 1.0] + 0.1 * np.sin(p)
    assert cuts.slope[turned] == pytest.approx(passing, rel=1e-6)
    assert jump == pytest.approx(-2 * FRICTION * np.sign(passing)[:, None] * [0.0, 1.0], abs=1e-12)
    assert gradient == pytest.approx(np.tile([0.3, 1.0], (2, 1)), rel=1e-6)
    before = np.cos(p) + 0.2 * OMEGA - x[:, 0] - 0.1 * x[:, 1] - STIFF * np.maximum(x[:, 0] - STOP, 0.0)
    before += FRICTION * np.sign(passing)
    assert cuts.rate[turned] == pytest.approx(0.3 * x[:, 1] + before + 0.1 * OMEGA * np.sin(p), rel=1e-6)


class Known:
    """A scene whose relations compare functions of the phase with zero."""

    def __init__(self, *functions: Callable[[np.ndarray], np.ndarray], flags: Any = None) -> None:
        self.functions, self.flags = functions, flags

    def states(self, phase: np.ndarray, _: np.ndarray) -> np.ndarray:
        return phase[None]

    def roots(self, phase: np.ndarray, *_: Any) -> np.ndarray:
        return np.array([f(phase) for f in self.functions])

    def discrete(self, phase: np.ndarray, *_: Any) -> np.ndarray:
        return (self.roots(phase) > 0 if self.flags is None else self.flags(phase)).astype(float)


class Moving(Known):
    """One that moves with rates that its flag gives."""

    omega = 0.7

    def __init__(self, *functions: Any, before: float, after: float) -> None:
        super().__init__(*functions)
        self.both = np.array([before, after])

    def rates(self, phase: np.ndarray, _: np.ndarray, flags: np.ndarray) -> np.ndarray:
        return self.both[flags[0].astype(int)][None]


@pytest.mark.parametrize(("before", "after"), [(2.0, 5.0), (0.0, 5.0), (2.0, 0.0), (0.0, 0.0)])
def test_where_the_motion_stands_still_a_relation_between_states_has_no_instant(before: float, after: float) -> None:
    """The state is the phase, and switches at 0.3 and, back, half a turn later; it gets there with the rates of either side."""

    class Crossed(Moving):
        def roots(self, phase: np.ndarray, *given: Any) -> np.ndarray:
            return np.sin((given[0][0] if given else phase) - 0.3)[None]

    driven = Crossed(before=before, after=after)
    known = cuts_of(driven)
    found = jumps(driven, np.zeros((1, 1)), known, np.ones(1))  # type: ignore[arg-type]
    if before == after:
        assert found is None
        return
    assert found is not None
    kept = [k for k, rate in enumerate((before, after)) if rate]
    assert found.phase == pytest.approx(np.array([0.3, 0.3 + np.pi])[kept], abs=1e-7)
    assert found.jump[:, 0] == pytest.approx(np.array([after - before, before - after])[kept])
    assert found.gradient[:, 0] == pytest.approx(np.array([1.0, -1.0])[kept], rel=1e-8)
    assert found.slope == pytest.approx(np.array([1.0, -1.0])[kept], rel=1e-8)
    assert found.rate == pytest.approx(np.array([before, -after])[kept], rel=1e-8)


def cuts_of(known: Known, samples: int = 64) -> Any:
    return moments(known, np.zeros((1, 1)), samples)  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [1e-3, 1e3])
@pytest.mark.parametrize("smooth", [0, 1])
def test_of_relations_that_switch_together_the_smoothest_says_when(smooth: int, size: float) -> None:
    """One jumps where another passes zero, on which it depends, by much less or more than that changes."""
    functions: list[Any] = [lambda p: np.sin(p - 0.3), lambda p: np.where(np.sin(p - 0.3) > 0, size, -3 * size)]
    found = cuts_of(Known(*functions[:: -1 if smooth else 1]))
    assert found.cuts == pytest.approx([0.3, 0.3 + np.pi], abs=2e-7)
    assert found.relation.tolist() == [smooth, smooth]
    assert (found.before != found.after).all()


@pytest.mark.parametrize("late", [0.0, 1e-7, 0.01])
def test_relations_that_switch_by_themselves_have_a_cut_each(late: float) -> None:
    """Between the same two samples or at the same time, whichever comes first; a third is a consequence of the second."""
    second: Any = lambda p: 3 * np.sin(p - 0.31 - late)  # noqa: E731
    found = cuts_of(Known(second, lambda p: np.sin(p - 0.31), lambda p: np.where(second(p) > 0, 0.1, -7.0)))
    assert found.cuts == pytest.approx([0.31, 0.31 + late, 0.31 + np.pi, 0.31 + np.pi + late], abs=1e-7)
    assert (np.diff(found.cuts) >= 0).all()
    first, both = [0.0, 1.0, 0.0], [1.0, 1.0, 1.0]
    assert sorted(found.relation[:2]) == sorted(found.relation[2:]) == [0, 1]
    assert found.after[:, 1].tolist() == both
    assert found.after[:, 3].tolist() == [0.0, 0.0, 0.0]
    if late:
        assert found.relation.tolist() == [1, 0, 1, 0]
        assert found.after[:, 0].tolist() == first
    assert (found.before[:, 1:] == found.after[:, :-1]).all()
    assert found.weights.sum() == pytest.approx(1.0, rel=1e-12)


def test_a_zero_at_a_sample_is_found_once() -> None:
    found = cuts_of(Known(np.sin))
    assert np.cos(found.cuts) == pytest.approx([1.0, -1.0], abs=1e-12)
    assert len(found.cuts) == 2
    after = cuts_of(
        Known(np.sin, flags=lambda p: (np.sin(p + 1e-13) > 0)[None])
    )  # as conditions on time are: just after a sample
    assert after.cuts == pytest.approx([np.pi, 2 * np.pi], abs=1e-12)
    quarter = cuts_of(Known(lambda p: np.cos(p) * 1e-9))
    assert quarter.cuts == pytest.approx([np.pi / 2, 3 * np.pi / 2], abs=1e-7)


def test_a_steep_zero_is_that_of_the_cubic_through_four_samples() -> None:
    step = 2 * np.pi / 64
    for where in (10.05, 10.5, 10.93):
        found = cuts_of(Known(lambda p, where=where: np.tanh(30 * (p - where * step)) + 0.2 * (p > 4) - 1.5 * (p > 5)))
        x = np.arange(-1.0, 3.0)
        roots = np.roots(np.polyfit(x, np.tanh(30 * (x + 10 - where) * step), 3))
        (root,) = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real >= 0) & (roots.real <= 1)]
        assert found.cuts[0] == pytest.approx((10 + root) * step, abs=1e-12)
        assert found.cuts[1] == pytest.approx(5.0, abs=step)


@pytest.mark.parametrize("seed", range(3))
def test_between_samples_of_any_size_a_zero_is_that_of_their_cubic(seed: int) -> None:
    """However the cubic bends between its two middle samples: it is zero at the cut, which lies between these."""
    values = np.random.default_rng(seed).normal(size=64) ** 3
    step = 2 * np.pi / 64
    found = cuts_of(Known(lambda p: values[np.rint(p / step).astype(int) % 64]))
    before = np.flatnonzero((values > 0) != (np.roll(values, -1) > 0))
    shares = found.cuts / step - before
    assert ((shares >= 0) & (shares <= 1)).all()
    for k, share in zip(before, shares, strict=True):
        four = values[(k + np.arange(-1, 3)) % 64]
        cubic = np.polyfit(np.arange(-1.0, 3.0), four, 3)
        assert np.polyval(cubic, share) == pytest.approx(0.0, abs=1e-9 * np.abs(four).max())


@pytest.mark.parametrize(
    "expression", [lambda p: 1.0 + 0 * p, lambda p: 0.5 + 0.1 * np.sin(3 * p), lambda p: -0.5 - 0.1 * np.cos(p)]
)
def test_a_flag_that_changes_though_its_expression_does_not_cross_zero_changes_between_two_samples(expression: Any) -> None:
    found = cuts_of(Known(expression, flags=lambda p: ((p > 1.0) & (p < 4.0))[None]), 100)
    grid = 2 * np.pi * np.arange(100) / 100
    edges = [grid[grid < 1.0][-1], grid[grid < 4.0][-1]]
    assert found.cuts == pytest.approx([edge + np.pi / 100 for edge in edges])
    assert found.relation.tolist() == [0, 0]


@pytest.mark.parametrize(
    "four", [[0.0, 1.0, -1.0, -2.0], [5.0, 1.0, -3.0, 0.0], [0.0, -2.0, 1.0, 0.0], [-3.0, -1e-9, 1.0, 8.0]]
)
@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_a_zero_between_two_samples_is_that_of_the_cubic_through_their_neighbours(four: list[float], unit: float) -> None:
    roots = np.roots(np.polyfit(np.arange(-1.0, 3.0), four, 3))
    (root,) = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0) & (roots.real < 1)]
    assert parts.zero(unit * np.array(four)) == pytest.approx(root, abs=1e-9)


def test_a_zero_at_a_sample_is_there() -> None:
    for other in (-3.0, 0.0, 3.0):
        assert parts.zero(np.array([other, 0.0, 2.0, 5.0])) == 0.0
        assert parts.zero(np.array([other, 2.0, 0.0, 5.0])) == 1.0
    assert parts.zero(np.array([1.0, 0.0, 0.0, 1.0])) == 0.0
