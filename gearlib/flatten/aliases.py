"""Alias elimination by signed union-find: variables that are equal, opposite, or identically zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Aliases:
    """Result of alias elimination: ``variable = sign * representative``, and the number of redundant equalities."""

    representative: Integers
    sign: Integers
    redundant: int


def unite(n: int, left: Integers, right: Integers, sign: Integers, rank: Integers) -> Aliases:
    """Partition the variables into classes under ``left = sign * right`` (``right = -1``: ``left = 0``).

    Parameters
    ----------
    n : int
        Number of variables.
    left, right, sign : arrays of int
        One equality per entry.
    rank : array of int, shape (n,)
        The variable of lowest rank represents its class (the lower number on a tie).

    Examples
    --------
    >>> a = unite(4, np.array([0, 1]), np.array([1, 2]), np.array([1, -1]), np.array([1, 1, 0, 0]))
    >>> a.representative.tolist(), a.sign.tolist()
    ([2, 2, 2, 3], [-1, -1, 1, 1])
    """
    zero = n  # an extra node that stands for zero
    parent = list(range(n + 1))
    parity = [1] * (n + 1)
    redundant = 0

    def find(x: int) -> tuple[int, int]:
        s = 1
        while parent[x] != x:
            up = parent[x]
            parent[x], parity[x] = parent[up], parity[x] * parity[up]  # halves the path; a root has the sign 1
            x, s = parent[x], s * parity[x]
        return x, s

    for a, b, s in zip(left.tolist(), right.tolist(), sign.tolist(), strict=True):
        if b < 0:
            b = zero  # whatever the sign
        (ra, sa), (rb, sb) = find(a), find(b)
        if ra == rb:
            if ra == find(zero)[0] or sa == s * sb:
                redundant += 1
            else:
                parent[ra], _ = find(zero)  # x = -x
            continue
        parent[rb], parity[rb] = ra, sa * s * sb

    roots, signs = np.array(parent), np.array(parity)
    while (roots[roots] != roots).any():
        roots, signs = roots[roots], signs * signs[roots]
    first = np.lexsort((np.arange(n), rank))  # the last write wins: the first of each class
    lead = np.arange(n + 1)
    lead[roots[first[::-1]]] = first[::-1]
    representative = lead[roots[:n]]
    sign_out = signs[:n] * signs[representative]
    sign_out[roots[:n] == roots[zero]] = 0
    return Aliases(representative, sign_out, redundant)
