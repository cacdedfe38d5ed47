"""Modes that are the same at two operating points, against all assignments; and sensitivities against differences."""

from __future__ import annotations

from itertools import permutations
from typing import Any

import numpy as np
import pytest

from gearlib.vibration.mode_matching import same_modes
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
