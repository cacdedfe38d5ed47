"""A block with a signal at each of its inputs, in a run."""

from __future__ import annotations

from typing import Any

import numpy as np

import gearlib as gl


class Driven(gl.Component):
    """``block``, whose inputs are given by name."""

    make = gl.Structural(None, "function that makes the block")

    def assemble(self) -> list[gl.Connection]:
        self.block = self.make()
        return []


def answer(
    kind: Any, t_end: float = 2.0, samples: int = 41, out: str = "y", rtol: float = 1e-9, method: str = "auto", **values: Any
) -> Any:
    """Times and output of a block."""
    result = gl.simulate(Driven(make=lambda: kind(**values)), t_end, samples=samples, rtol=rtol, method=method)
    return result.time, result[f"block.{out}"]


def close(found: Any, expected: Any, tolerance: float = 1e-7) -> bool:
    """Whether two histories differ by less than a part of the peak."""
    return bool(np.abs(found - expected).max() <= tolerance * max(np.abs(expected).max(), 1.0))
