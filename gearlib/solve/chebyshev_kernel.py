"""Compiled loops of the exponential's action. Importing this module imports numba; `action` does so when it is called."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearlib.solve.native_call import inner

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
TILE = 400  # rows
_Function = TypeVar("_Function", bound=Callable[..., Any])


def _entry(function: _Function) -> _Function:
    """Decorate a function that allocates nothing: counting references would take longer than a short product."""
    decorate: Any = njit
    compiled: _Function = decorate(cache=True, nogil=True, error_model="numpy", _nrt=False)(function)
    return compiled


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


@inner(cache=True, fastmath={"contract"})
def recur(offsets: Integers, diagonals: Floats, rows: Integers, columns: Integers, entries: Floats, beta: float, margin: int,
          low: int, high: int, x: Floats, old: Floats, new: Floats) -> None:  # fmt: skip
    """Rows ``low`` .. ``high`` of new <- M x + beta old, M given by its full diagonals and its entries elsewhere.

    Vectors begin after a ``margin`` of zeros.
    """
    n, last = high - low, offsets.size
    before, y, x = old[margin + low : margin + high], new[margin + low : margin + high], x[low:]
    a, xa = diagonals[0, low:high], x[margin + offsets[0] : margin + offsets[0] + n]
    if last >= 3:  # with more arrays in one loop LLVM gives up asking whether they overlap, and does not vectorise
        b, xb = diagonals[1, low:high], x[margin + offsets[1] : margin + offsets[1] + n]
        c, xc = diagonals[2, low:high], x[margin + offsets[2] : margin + offsets[2] + n]
        for i in range(n):
            y[i] = beta * before[i] + a[i] * xa[i] + b[i] * xb[i] + c[i] * xc[i]
    else:
        for i in range(n):
            y[i] = beta * before[i] + a[i] * xa[i]
    for k in range(3 if last >= 3 else 1, last - 1, 2):
        a, b = diagonals[k, low:high], diagonals[k + 1, low:high]
        xa, xb = x[margin + offsets[k] : margin + offsets[k] + n], x[margin + offsets[k + 1] : margin + offsets[k + 1] + n]
        for i in range(n):
            y[i] += a[i] * xa[i] + b[i] * xb[i]
    if last % 2 == 0:
        a, xa = diagonals[last - 1, low:high], x[margin + offsets[last - 1] : margin + offsets[last - 1] + n]
        for i in range(n):
            y[i] += a[i] * xa[i]
    for k in range(rows.size):
        if low <= rows[k] < high:
            new[margin + rows[k]] += entries[k] * x[margin - low + columns[k]]


@inner(cache=True, fastmath={"contract"})
def gather(coefficients: Floats, terms: Integers, k: int, used: int, margin: int, low: int, high: int, v: Floats, sums: Floats
           ) -> None:  # fmt: skip
    """Add the terms k .. k + 7 of the series, whose vectors are rows of ``v``, to those of the sums that have so many."""
    n, low, high = high - low, margin + low, margin + high
    a, b, c, d = v[2, low:high], v[3, low:high], v[4, low:high], v[5, low:high]
    e, f, g, h = v[6, low:high], v[7, low:high], v[8, low:high], v[9, low:high]
    for j in range(used):
        if k < terms[j]:
            y, q = sums[j, low - margin : high - margin], coefficients[j, k : k + 8]
            q0, q1, q2, q3, q4, q5, q6, q7 = q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7]
            for i in range(n):
                y[i] += (q0 * a[i] + q1 * b[i]) + (q2 * c[i] + q3 * d[i]) + ((q4 * e[i] + q5 * f[i]) + (q6 * g[i] + q7 * h[i]))


@inner(cache=True)
def margin_of(offsets: Integers) -> int:
    """How far diagonals reach beyond either end."""
    return int(max(offsets[offsets.size - 1], -offsets[0]))


@_entry
def march(offsets: Integers, diagonals: Floats, rows: Integers, columns: Integers, entries: Floats, beta: float,
           coefficients: Floats, terms: Integers, repeats: int, alone: int, z: Floats, v: Floats, sums: Floats, out: Floats
           ) -> None:  # fmt: skip
    """Advance ``z``; each row of ``out`` gets the next state. ``v`` and ``sums`` are room to work in, ``v`` of zeros.

    The rows from ``alone`` on need no others. Eight terms are computed tile by tile, each term's tile as many rows behind the
    one before as the band is wide, so that the matrix is read from the first level of the cache.
    Row j of ``coefficients`` sums the series to j + 1 steps ahead, all from the same vectors; behind its ``terms`` are zeros, so that
    eight terms can be added at a time. ``repeats`` is the number of substeps in one step (1 where there are several rows).
    """
    n, several, margin = z.size, coefficients.shape[0], margin_of(offsets)
    done, part = 0, 0
    while done < out.shape[0]:
        used = min(several, out.shape[0] - done)
        for i in range(n):
            v[0, margin + i] = z[i]
        recur(offsets, diagonals, rows, columns, entries, 0.0, margin, 0, n, v[0], v[0], v[1])
        for i in range(n):
            v[1, margin + i] *= 0.5  # P_1 = X, all others P_{k+1} = 2 X P_k +- P_{k-1}
        for j in range(used):
            for i in range(n):
                sums[j, i] = coefficients[j, 0] * z[i] + coefficients[j, 1] * v[1, margin + i]
        for k in range(2, terms[used - 1], 8):
            for row in range(2, 10):
                recur(offsets, diagonals, rows, columns, entries, beta, margin, alone, n, v[row - 1], v[row - 2], v[row])
            gather(coefficients, terms, k, used, margin, alone, n, v, sums)
            for tile in range(0, alone, TILE):
                low, high = tile, min(tile + TILE, alone)
                for row in range(2, 10):
                    recur(
                        offsets, diagonals, rows, columns, entries, beta, margin, low, high, v[row - 1], v[row - 2], v[row]
                    )  # fmt: skip
                    if row < 9:
                        low, high = max(low - margin, 0), high if high == alone else max(high - margin, 0)
                gather(coefficients, terms, k, used, margin, low, high, v, sums)
            for i in range(n):
                v[0, margin + i], v[1, margin + i] = v[8, margin + i], v[9, margin + i]
        for i in range(n):
            z[i] = sums[used - 1, i]
        part += 1
        if part == repeats:
            for j in range(used):
                for i in range(n):
                    out[done + j, i] = sums[j, i]
            done += used
            part = 0


@_entry
def growth(offsets: Integers, diagonals: Floats, rows: Integers, columns: Integers, entries: Floats, beta: float, terms: int,
           probe: Floats, v: Floats) -> float:  # fmt: skip
    """Largest entry among the last two of every eight of the first ``terms`` polynomials applied to ``probe``."""
    n, margin = probe.size, margin_of(offsets)
    for i in range(n):
        v[0, margin + i] = probe[i]
    recur(offsets, diagonals, rows, columns, entries, 0.0, margin, 0, n, v[0], v[0], v[1])
    for i in range(n):
        v[1, margin + i] *= 0.5
    largest = 0.0
    for k in range(2, terms):
        recur(offsets, diagonals, rows, columns, entries, beta, margin, 0, n, v[(k - 1) % 3], v[(k - 2) % 3], v[k % 3])
        if k % 8 < 2:
            for i in range(n):
                largest = max(largest, abs(v[k % 3, margin + i]))
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
