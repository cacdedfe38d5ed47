"""Compiled loops of the exponential's action. Importing this module imports numba; `action` does so when it is called."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@njit(cache=True)
def spread(indptr: Integers, indices: Integers, weight: Floats, logs: Floats, label: Integers) -> int:
    """Breadth-first sums of ``weight`` along the edges of a graph: logs[j] = logs[i] - weight[i, j]. Returns the components."""
    queue = np.empty(logs.size, np.int64)
    components = 0
    label[:] = -1
    for root in range(logs.size):
        if label[root] >= 0:
            continue
        label[root], logs[root], queue[0] = components, 0.0, root
        head, tail = 0, 1
        while head < tail:
            i = queue[head]
            head += 1
            for e in range(indptr[i], indptr[i + 1]):
                j = indices[e]
                if label[j] < 0:
                    label[j], logs[j], queue[tail] = components, logs[i] - weight[e], j
                    tail += 1
        components += 1
    return components


@njit(cache=True)
def _breadth_first(start: int, indptr: Integers, indices: Integers, degree: Integers, queue: Integers, mark: Integers,
                   stamp: int) -> int:  # fmt: skip
    """Nodes in the order of their distance from ``start``, neighbours of small degree first. Returns how many there are."""
    queue[0], mark[start] = start, stamp
    head, tail = 0, 1
    while head < tail:
        i = queue[head]
        head += 1
        first = tail
        for e in range(indptr[i], indptr[i + 1]):
            j = indices[e]
            if mark[j] != stamp:
                mark[j] = stamp
                at = tail
                while at > first and degree[queue[at - 1]] > degree[j]:
                    queue[at] = queue[at - 1]
                    at -= 1
                queue[at] = j
                tail += 1
    return tail


@njit(cache=True)
def narrow_order(indptr: Integers, indices: Integers) -> Integers:
    """Cuthill-McKee's order of a symmetric pattern, each part from a far end: the band of a chain is then narrowest."""
    n = indptr.size - 1
    degree = np.diff(indptr)
    order, queue = np.empty(n, np.int64), np.empty(n, np.int64)
    mark, done = np.zeros(n, np.int64), np.zeros(n, np.bool_)
    placed, stamp = 0, 0
    for root in range(n):
        if done[root]:
            continue
        start, size = root, 0
        for _ in range(3):
            stamp += 1
            size = _breadth_first(start, indptr, indices, degree, queue, mark, stamp)
            start = queue[size - 1]
        for k in range(size):
            order[placed + k] = queue[k]
            done[queue[k]] = True
        placed += size
    return order


@njit(cache=True, fastmath={"contract"})
def recur(offsets: Integers, diagonals: Floats, rows: Integers, columns: Integers, entries: Floats, beta: float, x: Floats,
           y: Floats) -> None:  # fmt: skip
    """y <- M x + beta y, M given by its full diagonals and its entries elsewhere."""
    n = x.size
    for i in range(n):
        y[i] *= beta
    for k in range(offsets.size):
        offset = offsets[k]
        low, high = max(0, -offset), min(n, n - offset)
        d, source, target = diagonals[k, low:high], x[low + offset : high + offset], y[low:high]  # slices: loops vectorise
        for i in range(d.size):
            target[i] += d[i] * source[i]
    for e in range(rows.size):
        y[rows[e]] += entries[e] * x[columns[e]]


@njit(cache=True, fastmath={"contract"})
def gather(coefficients: Floats, terms: Integers, k: int, first: int, used: int, y: Floats, sums: Floats) -> None:
    """Add term k of the series to those of the sums that have so many terms."""
    for j in range(first, used):
        if k < terms[j]:
            target, c = sums[j], coefficients[j, k]
            for i in range(y.size):
                target[i] += c * y[i]


@njit(cache=True)
def march(offsets: Integers, diagonals: Floats, rows: Integers, columns: Integers, entries: Floats, beta: float,
           coefficients: Floats, terms: Integers, repeats: int, z: Floats, out: Floats) -> None:  # fmt: skip
    """Advance ``z``; each row of ``out`` gets the next state.

    Row j of ``coefficients`` sums the series to j + 1 steps ahead, all from the same vectors. ``repeats`` is the number of
    substeps in one step (1 where there are several rows).
    """
    n, several = z.size, coefficients.shape[0]
    sums = np.zeros((several, n))
    x, y = np.empty(n), np.empty(n)
    done, part = 0, 0
    while done < out.shape[0]:
        used = min(several, out.shape[0] - done)
        sums[:] = 0.0
        x[:] = z
        gather(coefficients, terms, 0, 0, used, x, sums)
        y[:] = 0.0
        recur(offsets, diagonals, rows, columns, entries, 0.0, x, y)
        for i in range(n):
            y[i] *= 0.5  # P_1 = X, all others P_{k+1} = 2 X P_k +- P_{k-1}
        gather(coefficients, terms, 1, 0, used, y, sums)
        for k in range(2, terms[used - 1]):
            recur(offsets, diagonals, rows, columns, entries, beta, y, x)
            x, y = y, x
            gather(coefficients, terms, k, 0, used, y, sums)
        z[:] = sums[used - 1]
        part += 1
        if part == repeats:
            for j in range(used):
                out[done + j] = sums[j]
            done += used
            part = 0


@njit(cache=True)
def growth(offsets: Integers, diagonals: Floats, rows: Integers, columns: Integers, entries: Floats, beta: float, terms: int,
           probe: Floats) -> float:  # fmt: skip
    """Largest entry among the last two of every eight of the first ``terms`` polynomials applied to ``probe``."""
    x, y = probe.copy(), np.zeros(probe.size)
    recur(offsets, diagonals, rows, columns, entries, 0.0, x, y)
    y *= 0.5
    largest = 0.0
    for k in range(2, terms):
        recur(offsets, diagonals, rows, columns, entries, beta, y, x)
        x, y = y, x
        if k % 8 < 2:
            largest = max(largest, np.abs(y).max())
    return largest


@njit(cache=True)
def hermitian_bounds(
    diagonal: Floats, rows: Integers, symmetric: Floats, skew: Floats, cosines: Floats, sines: Floats
) -> Floats:
    """Gershgorin's upper bounds of the Hermitian parts of exp(-i angle) A, given by their entries off the diagonal."""
    bounds = np.empty(cosines.size)
    for k in range(cosines.size):
        c, s = cosines[k], sines[k]
        sums = c * diagonal
        for e in range(rows.size):
            sums[rows[e]] += math.sqrt((c * symmetric[e]) ** 2 + (s * skew[e]) ** 2)
        bounds[k] = sums.max()
    return bounds
