"""Balanced state matrices: scales and an order of the states in which rounding is as small as the dynamics allow.

LAPACK's balancing (B. N. Parlett, C. Reinsch, "Balancing a matrix for calculation of eigenvalues and eigenvectors", Numerische
Mathematik 13 (1969) 293-304, doi 10.1007/BF02165404) makes rows and columns equal in size. It leaves a coupling alone that acts one way
only, from a state to one that does not act back. Such a coupling changes no eigenvalue, however large it is, but the rounding of a
large one hides slow eigenvalues. It can be made as small as the couplings that do act back, by the scale of what it acts upon.
"""

from __future__ import annotations

from graphlib import TopologicalSorter
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def balance(A: Floats) -> tuple[Floats, Floats, Integers]:
    """A balanced matrix, the scales of its states, and their order.

    With ``balanced, scale, order = balance(A)``, the states of the balanced matrix are ``x[order] / scale``.

    Examples
    --------
    >>> balanced, scale, order = balance(np.array([[-1.0, 0.0], [1e9, 0.5]]))
    >>> bool(abs(balanced).max() <= 2.0)
    True
    """
    from scipy.linalg import matrix_balance

    balanced, (scale, order) = matrix_balance(A, separate=True)
    further = _one_way(balanced)
    return balanced / further[:, None] * further, scale * further, np.asarray(order, np.int64)


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
