"""Count of the eigenvalues of a sparse matrix in a disc, by the argument principle.

The phase of det(z - A), from a sparse LU decomposition, changes along the edge of the disc by one full turn per eigenvalue inside. With
the known eigenvalues divided out it changes slowly, and the remaining turns count the missing ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Complexes = NDArray[np.complex128]
WIDEST = 0.04  # largest step along the edge of a disc, rad


def missing_inside(S: Any, radius: float, values: Complexes, at_zero: int) -> int | None:
    """Number of eigenvalues within a radius besides ``values`` (with their conjugates) and the ``at_zero`` ones at 0.

    None where an eigenvalue is so close to the edge that the phase cannot be tracked.
    """
    import scipy.sparse as sparse
    from scipy.sparse.linalg import splu

    eye = sparse.identity(S.shape[0], format="csc")

    def phase(angle: float) -> float:
        z = radius * np.exp(1j * angle)
        lu = splu((z * eye - S).tocsc())
        found = np.angle(lu.U.diagonal()).sum() + np.pi * _cycles(lu.perm_r)
        return float(found - np.angle(z - values).sum() - at_zero * angle)

    try:
        # Each eigenvalue turns the phase by little more than the step: all of them by less than half a turn
        turned = follow(phase, 0.5 / max(S.shape[0], 10))
    except RuntimeError:  # z is exactly an eigenvalue
        return None
    count = np.nan if turned is None else turned / np.pi
    return round(count) if abs(count - np.round(count)) < 0.1 else None  # half a turn is missing where it ends on an eigenvalue


def _cycles(permutation: Any) -> int:
    """Number of cycles, whose parity together with the length gives the sign."""
    import scipy.sparse as sparse
    from scipy.sparse.csgraph import connected_components

    n = len(permutation)
    graph = sparse.csr_matrix((np.ones(n), permutation, np.arange(n + 1)), shape=(n, n))
    return int(connected_components(graph, directed=True, connection="weak", return_labels=False))


def follow(phase: Callable[[float], float], step: float) -> float | None:
    """Change from 0 to pi of a phase known modulo whole turns: each sample must be close to the extrapolation of the last three.

    Beside an eigenvalue that is close to the edge, the phase bends too much to be extrapolated; a bend of 1 rad is refused.
    """
    angles, phases = [0.0], [phase(0.0)]
    while angles[-1] < np.pi:
        angle = min(angles[-1] + step, np.pi)
        x, y = np.array(angles[-3:]), np.array(phases[-3:])
        expected = sum(y[i] * np.prod((angle - np.delete(x, i)) / (x[i] - np.delete(x, i))) for i in range(len(x)))
        straight = y[-1] + (angle - x[-1]) * (y[-1] - y[-2]) / (x[-1] - x[-2]) if len(x) > 2 else expected
        off = (phase(angle) - expected + np.pi) % (2 * np.pi) - np.pi if abs(expected - straight) < 1.0 else np.inf
        if abs(off) > 0.4:
            step /= 3
            if step < 1e-9:
                return None
            continue
        angles.append(angle)
        phases.append(float(expected + off))
        step = min(step * (1.5 if abs(off) < 0.1 else 1.0 if abs(off) < 0.25 else 0.7), WIDEST)
    return phases[-1] - phases[0]
