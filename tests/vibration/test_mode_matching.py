"""Modes that are the same at two operating points, against all assignments; and sensitivities against differences."""

from __future__ import annotations

from itertools import permutations
from typing import Any

import numpy as np
import pytest

from gearlib.vibration.mode_matching import branches, same_modes
from gearlib.vibration.mode_sensitivity import mode_sensitivity


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_modes_are_compared_whatever_the_units_of_their_states(unit: float) -> None:
    """As many states as modes, at frequencies that have changed sides: two that differ only in the sign of the second state."""
    shapes, frequencies = np.array([[1.0, 1.0], [unit, -unit]]), np.array([3.0, 3.3])
    for before, now in ((shapes, 5 * shapes[:, ::-1]), (shapes[:, ::-1] * 5, shapes)):
        first, second = same_modes(before, frequencies, now, frequencies)
        assert (first.tolist(), second.tolist()) == ([0, 1], [1, 0])


@pytest.mark.parametrize("seed", range(12))
def test_the_most_similar_of_all_assignments_is_taken(seed: int) -> None:
    """Any units of the states, states that do not move, more modes on one side than on the other."""
    rng = np.random.default_rng(seed)
    n, m = (int(x) for x in rng.integers(1, 5, 2))
    states = 5
    before, now = (rng.normal(size=(states, k)) + 1j * rng.normal(size=(states, k)) for k in (n, m))
    shared = min(n, m)
    now[:, :shared] = before[:, :shared] * np.exp(1j * rng.uniform(0, 6, shared)) + 0.5 * now[:, :shared]
    before[0] = now[0] = 0.0
    f_before, f_now = rng.uniform(1, 3, n), rng.uniform(1, 3, m)
    units = np.array([1.0, 1e-6, 1.0, 1e4, 1.0])[:, None]
    first, second = same_modes(before * units, f_before, now * units, f_now)
    assert len(first) == len(second) == shared
    largest = np.maximum(np.abs(before).max(axis=1), np.abs(now).max(axis=1))[1:, None]
    a, b = before[1:] / largest, now[1:] / largest

    def similarity(pairs: Any) -> float:
        total = 0.0
        for i, j in pairs:
            mac = abs(np.vdot(a[:, i], b[:, j])) ** 2 / (np.vdot(a[:, i], a[:, i]) * np.vdot(b[:, j], b[:, j])).real
            total += np.sqrt(mac) - abs(np.log(f_before[i] / f_now[j]))
        return total

    if n <= m:
        every = [list(zip(range(n), some, strict=True)) for some in permutations(range(m), n)]
    else:
        every = [list(zip(some, range(m), strict=True)) for some in permutations(range(n), m)]
    assert similarity(zip(first, second, strict=True)) == pytest.approx(max(map(similarity, every)), abs=1e-12)


@pytest.mark.parametrize("value", [4.0, -0.3, 0.0])
def test_rates_of_frequency_and_damping_are_their_differences(value: float) -> None:
    """Of free motions, of damped and undamped swings."""
    eigenvalues = np.array([0.0, 3.0j, -0.4 + 2.0j, -1.0 + 0.5j])
    changes = np.array([0.0, 0.7j, 0.3 - 0.2j, -0.6 + 0.1j])
    found = mode_sensitivity("shaft.c", "N.m/rad", value, eigenvalues, changes)
    h = 1e-6
    sizes, ratios = [], []
    for x in (eigenvalues + h * changes, eigenvalues - h * changes):
        sizes.append(np.abs(x))
        ratios.append(-x[1:].real / np.abs(x[1:]))
    assert found.eigenvalues.tolist() == changes.tolist()
    assert found.frequencies == pytest.approx((sizes[0] - sizes[1]) / (2 * h) / (2 * np.pi), rel=1e-7, abs=1e-9)
    assert found.damping == pytest.approx([0.0, *(ratios[0] - ratios[1]) / (2 * h)], rel=1e-7, abs=1e-9)
    assert found.relative[0] == 0.0
    expected = value * (sizes[0] - sizes[1])[1:] / (2 * h) / np.abs(eigenvalues[1:])
    assert found.relative[1:] == pytest.approx(expected, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize(("unit", "said"), [("N.m/rad", " N.m/rad"), ("1", ""), ("", "")])
def test_sensitivities_are_listed_with_the_unit_of_the_parameter(unit: str, said: str) -> None:
    text = str(mode_sensitivity("shaft.c", unit, 400.0, np.array([20j, 1j - 1]), np.array([0.025j, 0.5])))
    first, head, one, other = text.split("\n")
    assert first == f"Change with shaft.c = 400{said}"
    per = f"per{said}" if said else ""
    assert head.split("  damping")[0].rstrip() == f"mode  frequency, Hz {per}".rstrip()
    assert head.endswith("damping ratio    frequency, % per % of the parameter")
    assert one.split() == ["0", f"{0.025 / (2 * np.pi):.6g}", "0", "0.5000"]
    assert other.split()[0] == "1"
    assert other.index("-0.176777") + len("-0.176777") == one.index("  0    0.5000") + 3


@pytest.mark.parametrize("seed", range(8))
def test_branches_are_followed_from_point_to_point_and_remembered_where_they_have_no_mode(seed: int) -> None:
    """Modes that turn slowly, listed in any order; each point follows any earlier one, and may lack some of the modes."""
    rng = np.random.default_rng(seed)
    count, points = int(rng.integers(1, 6)), 9
    base = np.linalg.qr(rng.normal(size=(7, 7)))[0][:, :count]
    hertz = np.sort(rng.uniform(1.0, 1.3, count))
    first = int(rng.integers(0, 3))  # points without any mode, to begin with
    listed = [np.empty(0, int)] * first + [rng.permutation(count)]
    for _ in range(first + 1, points):
        listed.append(rng.permutation(count)[: rng.integers(0, count + 1)])
    shapes = [(base + 0.05 * rng.normal(size=base.shape))[:, own] * np.exp(1j * rng.uniform(0, 6, len(own))) for own in listed]
    frequencies = [hertz[own] * rng.uniform(0.98, 1.02, len(own)) for own in listed]
    order = [(first, -1)] + [(k, int(rng.integers(first, k))) for k in range(first + 1, points)]
    found = branches(order, shapes, frequencies)
    assert found.shape == (points, count)
    assert (found[:first] == -1).all()
    for own, row in zip(listed[first:], found[first:], strict=True):
        there = {int(mode): k for k, mode in enumerate(own)}
        assert row.tolist() == [there.get(int(mode), -1) for mode in listed[first]]


def test_a_mode_that_comes_up_later_begins_a_branch_of_its_own() -> None:
    """Two modes, then three, then the first alone, then the third and the second; what it was like last is remembered."""
    shapes, hertz = np.eye(3) + 0.1, np.array([1.0, 2.0, 3.0])
    turned = shapes.copy()
    turned[:, 2] = shapes @ [0.0, 0.75, 1.0]  # towards the second, by less than its own part
    listed = [[1, 0], [0, 2, 1], [0], [2, 1]]
    given = [shapes[:, listed[0]], turned[:, listed[1]], shapes[:, [0]], turned[:, [2, 1]]]
    found = branches([(0, -1), (1, 0), (2, 1), (3, 2)], given, [hertz[own] for own in listed])
    assert found.tolist() == [[0, 1, -1], [2, 0, 1], [-1, 0, -1], [1, -1, 0]]
    assert branches([], [], []).shape == (0, 0)


def test_slow_modes_and_free_motions_have_sensitivities_of_their_own() -> None:
    """A mode far below 1 rad/s as any other; a free motion has neither a frequency nor a damping ratio, even where its pole moves."""
    s = 0.03 * np.array([0.0, 1j, -0.6 + 0.8j])
    changes = np.array([-0.5, 0.1 + 0.2j, -0.3 + 0.1j])
    found = mode_sensitivity("d", "N", 2.0, s, changes)
    h = 1e-7
    sizes = [np.abs(s[1:] + x * changes[1:]) for x in (h, -h)]
    ratios = [-(s[1:] + x * changes[1:]).real / size for x, size in zip((h, -h), sizes, strict=True)]
    assert found.frequencies == pytest.approx([0.0, *(sizes[0] - sizes[1]) / (2 * h) / (2 * np.pi)], rel=1e-6)
    assert found.damping == pytest.approx([0.0, *(ratios[0] - ratios[1]) / (2 * h)], rel=1e-6)
    assert found.relative == pytest.approx([0.0, *2.0 * (sizes[0] - sizes[1]) / (2 * h) / 0.03], rel=1e-6)
    assert found.eigenvalues.tolist() == changes.tolist()
