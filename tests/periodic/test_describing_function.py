"""Describing functions of backlash: what holds for any of them, at their edges, and what is refused."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.periodic.describing_function import mean_deflection

SPRING = {"c": 50.0, "b": 0.4}


@pytest.mark.parametrize("preload", [-300.0, -12.0, -1e-6, 1e-6, 5.0, 400.0])
@pytest.mark.parametrize("amplitude", [1e-3, 0.15, 0.2, 0.9, 40.0])
def test_the_mean_force_at_the_mean_deflection_is_the_preload(preload: float, amplitude: float) -> None:
    mean = mean_deflection(amplitude, preload, **SPRING)
    force, stiffness = gl.backlash_describing_function(amplitude, mean, **SPRING)
    assert force == pytest.approx(preload, rel=1e-9, abs=1e-12 * 50 * amplitude)
    assert mean_deflection(amplitude, -preload, **SPRING) == pytest.approx(-mean, rel=1e-12)
    assert gl.equivalent_stiffness(amplitude, preload, **SPRING) == pytest.approx(stiffness)
    if amplitude < abs(preload) / 50.0:  # contact is permanent
        assert stiffness == pytest.approx(50.0, rel=1e-12)
        assert abs(mean) == pytest.approx(abs(preload) / 50.0 + 0.2, rel=1e-12)


@pytest.mark.parametrize(
    ("c", "b", "preload"), [(1e8, 1e-4, 1000.0), (1e8, 1e-4, -1000.0), (1e-3, 10.0, 5.0), (1e-8, 0.0, 1e8)]
)
def test_in_contact_the_mean_deflection_is_that_of_the_preload_at_any_stiffness(c: float, b: float, preload: float) -> None:
    rest = abs(preload) / c + b / 2
    for amplitude in (1e-3 * abs(preload) / c, 0.9 * abs(preload) / c):
        assert mean_deflection(amplitude, preload, c=c, b=b) == pytest.approx(np.sign(preload) * rest, rel=1e-12)


@pytest.mark.parametrize("preload", [-300.0, -1e-6, 5.0])
@pytest.mark.parametrize("amplitude", [1e-3, 0.15, 40.0])
def test_the_mean_deflection_is_looked_for_where_contact_is_permanent_at_both_ends(
    preload: float, amplitude: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The force there is that of the amplitude beyond the preload, in both directions."""
    ends: list[tuple[float, float]] = []

    def between(excess: Any, low: float, high: float, **asked: Any) -> float:
        ends.append((excess(low) + preload, excess(high) + preload))
        return 0.1

    monkeypatch.setattr("scipy.optimize.brentq", between)
    assert mean_deflection(amplitude, preload, **SPRING) == 0.1
    most = abs(preload) + 50.0 * amplitude
    assert ends == [pytest.approx((-most, most), rel=1e-9)]


@pytest.mark.parametrize("unit", [1e-9, 1e-5, 1e6])
@pytest.mark.parametrize("amplitude", [0.3, 0.9, 4.0])
def test_the_mean_deflection_is_as_exact_in_any_unit_of_length(amplitude: float, unit: float) -> None:
    mean = mean_deflection(amplitude, 12.0, **SPRING)
    assert mean_deflection(amplitude * unit, 12.0, c=50.0 / unit, b=0.4 * unit) == pytest.approx(mean * unit, rel=1e-12)


def test_without_preload_it_vibrates_about_the_middle_of_the_gap() -> None:
    assert mean_deflection(0.9, 0.0, **SPRING) == 0.0
    gap = gl.equivalent_stiffness([[0.1, 0.2], [0.3, 1e4]], **SPRING)
    assert gap.shape == (2, 2)
    assert gap[0].tolist() == [0.0, 0.0]
    assert 0.0 < gap[1, 0] < gap[1, 1]
    assert gap[1, 1] == pytest.approx(50.0, rel=1e-4)


def test_without_a_gap_it_is_a_linear_spring() -> None:
    assert gl.equivalent_stiffness([0.1, 3.0], 7.0, c=50.0, b=0.0) == pytest.approx(50.0, rel=1e-12)
    assert mean_deflection(3.0, 7.0, c=50.0, b=0.0) == pytest.approx(0.14, rel=1e-12)


def test_far_beyond_and_far_inside_the_edges_it_is_linear_also_for_tiny_amplitudes() -> None:
    for amplitude in (5e-324, 1e-300, 1e-12, 0.1):
        for mean, slope, force in ((2.0, 30.0, 30.0 * 1.5 + 4.0 * 0.5), (-2.0, 30.0, -47.0), (0.2, 4.0, 0.8)):
            found = gl.backlash_describing_function(amplitude, mean, c=30.0, b=1.0, c_gap=4.0)
            assert found == (pytest.approx(force, rel=1e-12), pytest.approx(slope, rel=1e-12))
    shapes = gl.backlash_describing_function([[0.1], [0.2]], [1.0, 2.0, 3.0])
    assert [part.shape for part in shapes] == [(2, 3), (2, 3)]


@pytest.mark.parametrize("unit", [1e-140, 1e-9, 1e100])
@pytest.mark.parametrize("mean", [0.0, 0.3, -2.0])
def test_the_unit_of_length_does_not_matter(mean: float, unit: float) -> None:
    """Nor does it for amplitudes that are negligible beside the edges."""
    for amplitude in (1e-170, 0.2, 0.9, 7.0):
        force, stiffness = gl.backlash_describing_function(amplitude, mean, c=30.0, b=1.0, c_gap=4.0)
        found = gl.backlash_describing_function(amplitude * unit, mean * unit, c=30.0, b=unit, c_gap=4.0)
        assert found == (pytest.approx(force * unit, rel=1e-9), pytest.approx(stiffness, rel=1e-9))


@pytest.mark.parametrize("mean", [0.0, 0.5, -3.0])
def test_without_a_gap_the_force_is_that_of_a_linear_spring(mean: float) -> None:
    force, stiffness = gl.backlash_describing_function([1e-300, 1.0, 1e9], mean, c=30.0, b=0.0, c_gap=4.0)
    assert stiffness == pytest.approx([30.0] * 3, rel=1e-12)
    assert force == pytest.approx([30.0 * mean] * 3, rel=1e-12, abs=1e-4)  # beside 3e10
    assert float(gl.backlash_describing_function(1e-300, 0.0, b=0.0)[0]) == 0.0


def test_the_preloaded_spring_is_force_over_deflection() -> None:
    """Its force about the mean is zero at rest, rises by c, stops in the gap, and goes on behind it; it is odd in the preload."""
    spring, other = gl.PreloadedBacklash(c=50.0, b=0.4, preload=10.0), gl.PreloadedBacklash(c=50.0, b=0.4, preload=-10.0)
    x = np.array([-1.0, -0.61, -0.6, -0.3, -0.2, 0.0, 0.3])
    force = [spring(v) for v in x]
    assert force == pytest.approx([-30.0, -10.5, -10.0, -10.0, -10.0, 0.0, 15.0])
    assert [other(-v) for v in x] == pytest.approx([-f for f in force])
    assert spring.describing_function(0.19) == pytest.approx(50.0)
    assert spring.describing_function(0.3) == pytest.approx(float(gl.equivalent_stiffness(0.3, 10.0, **SPRING)))
    assert spring.mean(0.3) == mean_deflection(0.3, 10.0, **SPRING)


def test_the_preloaded_spring_needs_no_first_cycle() -> None:
    """Its force has no memory: integration over one cycle takes each of the 100 points once, here within contact and within the gap."""

    class Counted(gl.PreloadedBacklash):
        def __call__(self, x: float) -> float:
            seen.append(x)
            return super().__call__(x)

    seen: list[float] = []
    spring = Counted(c=50.0, b=0.4, preload=10.0)
    assert control.describing_function(spring, 0.19, num_points=100, try_method=False) == pytest.approx(50.0)
    assert len(seen) == 100
    assert sorted(seen) == pytest.approx(sorted(0.19 * np.sin(2 * np.pi * np.arange(100) / 100)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: gl.backlash_describing_function([0.1, 0.0]), r"amplitude is \[0\.1, 0\.0\]; expected positive numbers"),
        (lambda: gl.backlash_describing_function(0.1, b=-0.1), r"b is -0\.1; expected a backlash that is not negative"),
        (lambda: gl.backlash_describing_function([0.1, 0.2], [1.0, 2.0, 3.0]), r"have the shapes \(2,\) and \(3,\)"),
        (lambda: mean_deflection(0.0, 1.0, c=1.0, b=1.0), r"amplitude is 0\.0; expected a positive number"),
        (lambda: mean_deflection(0.1, 1.0, c=0.0, b=1.0), r"c is 0\.0; expected a positive stiffness"),
        (lambda: mean_deflection(0.1, np.inf, c=1.0, b=1.0), r"preload is inf; expected a finite force"),
        (lambda: gl.PreloadedBacklash(-1.0, 1.0, 1.0), r"c is -1\.0; expected a positive stiffness"),
        (lambda: gl.PreloadedBacklash(1.0, -1.0, 1.0), r"b is -1\.0; expected a backlash that is not negative"),
    ],
)
def test_what_is_refused(call: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        call()


def test_by_default_stiffness_and_gap_are_1_and_nothing_is_carried() -> None:
    """Up to 1.5 about the middle, of which 0.5 is the edge: N1 = 1 - 2 (asin z + z sqrt(1 - z^2)) / pi with z = 1/3."""
    z = 1 / 3
    stiffness = 1 - 2 * (np.arcsin(z) + z * np.sqrt(1 - z**2)) / np.pi
    assert gl.backlash_describing_function(1.5) == (pytest.approx(0.0, abs=1e-15), pytest.approx(stiffness))
    assert gl.equivalent_stiffness([1.5], c=1.0, b=1.0) == pytest.approx([stiffness])
