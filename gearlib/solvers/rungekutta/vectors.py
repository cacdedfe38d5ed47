"""Operations on vectors of states, by address; inlined into the integration loops."""

from __future__ import annotations

from gearlib.compiler.small_language import blocks, floats_at, native, where

__all__ = ["add_slope", "move"]

TINY = 1e-250  # below it arithmetic may be slow (subnormal numbers): a part of the train not yet reached is at rest


@native
def add_slope(start: int, h: float, slope: int, out: int, size: int) -> None:
    """``out = start + h slope``, vectors by address."""
    x, k, y = floats_at(start), floats_at(slope), floats_at(out)
    for i in blocks(size):
        y[i] = x[i] + h * k[i]


@native
def move(source: int, target: int, size: int) -> None:
    """Copy a vector, flushing magnitudes up to `TINY` to zero."""
    x, y = floats_at(source), floats_at(target)
    for i in blocks(size):
        y[i] = where(abs(x[i]) <= TINY, 0.0, x[i])  # NaN is preserved
