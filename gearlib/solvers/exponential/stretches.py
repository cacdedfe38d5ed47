"""Partition of the output times into uniform grids between breakpoints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.switch_times import rounding

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Stretch:
    """Uniform grid: ``count`` steps of ``h`` (s) from local time ``start`` of a piece; results go to rows ``row``, ... unless it is -1."""

    piece: int
    start: float
    h: float
    count: int
    row: int


def stretches(times: Floats, t0: float, breakpoints: Floats) -> list[Stretch]:
    """Partition the way from ``t0`` through all ``times`` into stretches; rows at ``t0`` itself belong to none.

    >>> for stretch in stretches(np.array([0.0, 1.0, 2.0, 3.0]), 0.0, np.array([2.5])):
    ...     print(stretch)
    Stretch(piece=0, start=0.0, h=1.0, count=2, row=1)
    Stretch(piece=0, start=2.0, h=0.5, count=1, row=-1)
    Stretch(piece=1, start=0.0, h=0.5, count=1, row=3)
    """
    same = rounding(t0, float(times[-1]))
    found: list[Stretch] = []
    begin, row = t0, int(np.searchsorted(times, t0 + same, side="right"))
    for piece in range(len(breakpoints) + 1):
        if row == len(times):
            break
        inner = piece < len(breakpoints)
        last = int(np.searchsorted(times, breakpoints[piece] + same, side="right")) if inner else len(times)
        points = times[row:last]
        if len(points):
            found.extend(_equal_steps(points, begin, same, piece, row))
        if inner:
            before = float(points[-1]) if len(points) else begin
            end = float(breakpoints[piece])
            if end - before > same and last < len(times):
                found.append(Stretch(piece, before - begin, end - before, 1, -1))
            begin = end
        row = last
    return found


def _equal_steps(points: Floats, begin: float, same: float, piece: int, row: int) -> Iterator[Stretch]:
    """Stretches from ``begin`` through ``points``: steps count as equal if they differ by rounding only."""
    steps = np.diff(points, prepend=begin)
    cuts = [0, *(np.flatnonzero(np.abs(np.diff(steps)) > same) + 1).tolist(), len(points)]
    for first, last in pairwise(cuts):
        start = float(points[first - 1]) if first else begin
        count = last - first
        h = (float(points[last - 1]) - start) / count
        drift = np.abs(points[first:last] - start - h * np.arange(1, count + 1)).max() if count > 2 else 0.0
        if drift <= 2.0 * same:
            yield Stretch(piece, start - begin, h, count, row + first)
        else:
            for i in range(first, last):
                yield Stretch(piece, float(points[i] - steps[i]) - begin, float(steps[i]), 1, row + i)
