"""Ranges of stable gains of a loop whose poles are known at each gain."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.feedback.gain_range import stable_gains
from gearlib.feedback.margins import PhaseCrossing

INFINITE = float("inf")


@pytest.mark.parametrize(
    ("edges", "stable", "ranges"),
    [
        ([], [(0.0, INFINITE)], [(0.0, INFINITE)]),
        ([], [], []),
        ([2.0], [(0.0, 2.0)], [(0.0, 2.0)]),
        ([2.0], [(2.0, INFINITE)], [(2.0, INFINITE)]),
        ([7.0, 5.0, 1.0, 2.0, 6.0, 4.0, 3.0], [(1.0, 2.0), (3.0, 4.0), (5.0, 7.0)], [(1.0, 2.0), (3.0, 4.0), (5.0, 7.0)]),
        ([1.0, 2.0, 3.0, 4.0], [(0.0, 2.0), (3.0, INFINITE)], [(0.0, 2.0), (3.0, INFINITE)]),
        ([1e-200, 1e-100, 1e100], [(1e-200, 1e100)], [(1e-200, 1e100)]),
        ([2.0, 2.0, 0.0, INFINITE], [(0.0, 2.0)], [(0.0, 2.0)]),
    ],
)
def test_ranges_are_those_in_which_no_pole_is_on_the_right(edges: Any, stable: Any, ranges: Any) -> None:
    """Between two crossings the gain that is looked at lies inside; ranges that meet are one."""
    asked: list[float] = []

    def closed(factor: float) -> np.ndarray:
        asked.append(factor)
        return np.array([[-1.0 if any(low < factor < high for low, high in stable) else 1.0]])

    loop: Any = SimpleNamespace(closed=closed)
    assert stable_gains(loop, [PhaseCrossing(1.0, edge) for edge in edges]) == tuple(ranges)
    inner = sorted({edge for edge in edges if 0 < edge < INFINITE})
    assert len(asked) == len(inner) + 1
    for low, factor, high in zip([0.0, *inner], asked, [*inner, INFINITE], strict=True):
        assert low < factor < high
