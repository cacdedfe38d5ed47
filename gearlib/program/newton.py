"""`newton`: Newton's method for all equations that are solved in Python; native code prints its own (`gearlib.native.source`).

Callers differ in how a correction follows from a residual (a dense, sparse or bordered matrix, least squares, many points at once) and
in what counts as settled; the iteration, its damping and its failures are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Correction = Callable[[Floats], Floats]  # residual -> error of the unknowns, to first order


@dataclass(frozen=True, eq=False)
class Root:
    """Unknowns at which Newton's method ended, and how."""

    x: Floats
    iterations: int
    settled: bool
    singular: bool = False  # a correction could not be computed there


def newton(
    equations: Callable[[Floats], tuple[Floats, Correction]], x: Floats, settled: Callable[[Floats, Floats, Floats], bool],
    most: int, shares: Sequence[float] = (),
) -> Root:  # fmt: skip
    """Iterate until the unknowns are settled.

    Parameters
    ----------
    equations : callable
        The residual at some unknowns, and the correction that follows from a residual there. `numpy.linalg.LinAlgError` from either
        ends the iteration.
    x : array
        Unknowns at the start, of any shape.
    settled : callable
        Whether an iteration was the last, from the new unknowns, the correction that was subtracted, and the residual (of the new
        unknowns if corrections are damped, else of the old ones).
    most : int
        Maximum number of iterations.
    shares : sequence of float, optional
        For damping: shares of a correction, tried in turn until the norm of the residual falls; the last one is taken in any case.

    Examples
    --------
    >>> found = newton(lambda x: (x**2 - 2.0, lambda r: r / (2.0 * x)), np.array([1.0]), lambda x, step, r: abs(step[0]) < 1e-12, 20)
    >>> found.x, found.iterations, found.settled
    (array([1.41421356]), 6, True)
    """
    ahead: tuple[Floats, Correction] | None = None
    for iteration in range(1, most + 1):
        try:
            residual, correction = equations(x) if ahead is None else ahead
            step = whole = correction(residual)
            if not np.isfinite(step).any():
                return Root(x, iteration, False)
            for share in shares:
                step = share * whole
                ahead = equations(x - step)
                if np.linalg.norm(ahead[0]) < np.linalg.norm(residual):
                    break
        except np.linalg.LinAlgError:
            return Root(x, iteration, False, True)
        x = x - step
        if settled(x, step, residual if ahead is None else ahead[0]):
            return Root(x, iteration, True)
    return Root(x, most, False)
