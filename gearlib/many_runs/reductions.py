"""`final` and `peak`: the most frequent reductions of a sweep, computed for many runs at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import one_name

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reduction:
    """Reduction of a history to a number: a function of a result, for ``reduce`` of `System.sweep`.

    Attributes
    ----------
    name : str
        Path of the variable.
    of_magnitude : bool
        Whether the number is the largest magnitude; else the last value.
    """

    name: str
    of_magnitude: bool

    def __call__(self, result: Any) -> float:
        return float(self.of(result[self.name]))

    def of(self, histories: Floats) -> Floats:
        """The number of each history; the last axis is time."""
        if not self.of_magnitude:
            return np.asarray(histories[..., -1].copy(), float)
        return np.asarray(np.maximum(histories.max(axis=-1), 0.0 - histories.min(axis=-1)), float)


def final(name: str) -> Reduction:
    """The last value of a variable, for ``reduce`` of `System.sweep`: computed for many runs at a time, without a `Result` for each.

    Parameters
    ----------
    name : str
        Path of the variable.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> system = gl.compile(gp.ZhouCui2022(tau_in=100.0), outputs=["w_out", "q_ring"])
    >>> runs = system.sweep({"I_r": [0.2, 0.3]}, 0.05, reduce={"end": gl.final("w_out"), "peak": gl.peak("q_ring")})
    >>> runs["end"].shape
    (2,)
    """
    return Reduction(one_name("name", name, "load.w"), False)


def peak(name: str) -> Reduction:
    """The largest magnitude of a variable at the samples, for ``reduce`` of `System.sweep`; see `final`.

    Parameters
    ----------
    name : str
        Path of the variable.
    """
    return Reduction(one_name("name", name, "load.w"), True)
