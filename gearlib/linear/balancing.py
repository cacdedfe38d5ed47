"""Balanced state matrices: scales of the states at which rounding is as small as the dynamics allow.

LAPACK's balancing (B. N. Parlett, C. Reinsch, "Balancing a matrix for calculation of eigenvalues and eigenvectors", Numerische
Mathematik 13 (1969) 293-304, doi 10.1007/BF02165404) makes rows and columns equal in size. As it is usually called, it first sets aside
the states that are coupled with the others one way only, and leaves them unscaled; here it scales all. A coupling that acts one way only
changes no eigenvalue, however large it is, but the rounding of a large one hides slow eigenvalues. What is left of it between groups of
states is made as small as the couplings within them, by the scale of what it acts upon.
"""

from __future__ import annotations

from graphlib import TopologicalSorter
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def balance(A: Floats) -> tuple[Floats, Floats]:
    """A balanced matrix and the scales of its states, which are ``x / scale``.

    Examples
    --------
    >>> balanced, scale = balance(np.array([[-1.0, 0.0], [1e9, 0.5]]))
    >>> bool(abs(balanced).max() <= 2.0)
    True
    """
    from scipy.linalg import matrix_balance

    # SciPy reads an order of the states from the scales, too, for which they may be too large
    with np.errstate(invalid="ignore"):
        balanced, (scale, _) = matrix_balance(A, permute=False, separate=True)
    further = _one_way(balanced)
    return balanced / further[:, None] * further, scale * further


def _one_way(matrix: Floats) -> Floats:
    """Scales under which no coupling between strongly connected components exceeds the largest one within them; powers of two."""
    from scipy.sparse.csgraph import connected_components

    scale = np.ones(len(matrix))
    size = np.abs(matrix)
    count, component = connected_components(size > 0, connection="strong")
    inner = component[:, None] == component
    largest = float(np.where(inner, size, 0.0).max(initial=0.0))
    if count < 2 or not largest or float(size.max()) <= largest:
        return scale
    driven, driving = np.nonzero((size > 0) & ~inner)
    before: dict[int, set[Any]] = {k: set() for k in range(count)}
    for i, j in set(zip(component[driven].tolist(), component[driving].tolist(), strict=True)):
        before[i].add(j)
    for k in TopologicalSorter(before).static_order():
        rows = component == k
        incoming = float(np.where(inner[rows], 0.0, size[rows] * scale).max(initial=0.0))
        if incoming > largest:
            scale[rows] = 2.0 ** np.ceil(np.log2(incoming / largest))
    return scale
