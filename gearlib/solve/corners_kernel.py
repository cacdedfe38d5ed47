"""Compiled loops of `corners`. Importing this module imports numba; `corners` does so when it solves."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
ROUNDING = 1e-18  # terms of Taylor's series below it, of what they are added to, are left out


@njit(cache=True, nogil=True)
def by_matrices(E: Floats, which: Integers, drive: Floats, x: Floats, out: Floats) -> None:
    """out[i] = x of the end of interval i, by the first rows of exp(G h) - I of each kind of interval."""
    n, m = E.shape[1], drive.shape[1]
    change = np.empty(n)
    for i in range(len(which)):
        k = which[i]
        for r in range(n):
            total = 0.0
            for j in range(m):
                total += E[k, r, n + j] * drive[i, j]
            for j in range(n):
                total += E[k, r, j] * x[j]
            change[r] = total
        for r in range(n):
            x[r] += change[r]
            out[i, r] = x[r]


@njit(cache=True, nogil=True)
def by_series(G: Floats, rate: float, reach: float, lengths: Floats, drive: Floats, x: Floats, out: Floats) -> None:
    """The same by Taylor's series on (x, u, v), in as many parts of an interval as keep ``rate`` times a part below ``reach``."""
    n, order, m = len(x), len(G), (len(G) - len(x)) // 2
    z, term, following = np.empty(order), np.empty(order), np.zeros(order)
    for i in range(len(lengths)):
        parts = max(1, int(np.ceil(rate * lengths[i] / reach)))
        h = lengths[i] / parts
        z[:n], z[n:] = x, drive[i]
        for _ in range(parts):
            term[:] = z
            k, left = 1, 1.0
            while left > ROUNDING and k < 40:
                for r in range(n):
                    total = 0.0
                    for j in range(order):
                        total += G[r, j] * term[j]
                    following[r] = total * h / k
                for r in range(n, n + m):
                    following[r] = term[r + m] * h / k
                for r in range(order):
                    term[r] = following[r]
                    z[r] += following[r]
                left *= rate * h / k
                k += 1
        x[:] = z[:n]
        out[i] = x
