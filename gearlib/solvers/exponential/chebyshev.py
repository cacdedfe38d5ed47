"""Compiled kernels for the action of the matrix exponential, in the small language; arrays are passed by address."""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.native_module import native_functions
from gearlib.compiler.small_language import floats_at, int32, ints_at, native, parallel, record

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
TILE = 400  # rows: ten vectors of that length (32 kB) fit into the first-level cache


@record
class Series(ctypes.Structure):
    """A matrix M as full diagonals and off-diagonal entries, with the work arrays of its series."""

    n: int
    offsets: int
    n_offsets: int
    diagonals: int  # one row of n each
    rows: int
    columns: int
    entries: int
    n_entries: int
    alone: int  # the rows from here on depend on no others
    margin: int  # zero padding before and behind each vector, as far as diagonals reach
    v: int  # vectors
    beta: float
    # for `march`
    coefficients: int  # rows of ``width``: row j sums the series to j + 1 steps ahead
    width: int
    terms: int
    several: int
    repeats: int  # substeps per step (1 if there are several rows)
    z: int
    sums: int
    out: int
    count: int
    # for `growth`
    length: int
    largest: float


@native
def _vector(s: Series, i: int) -> int:
    """Address of a vector's first element, after its padding."""
    return s.v + 8 * (i * (s.n + 2 * s.margin) + s.margin)


@native
def _recur(s: Series, beta: float, low: int, high: int, x: int, old: int, new: int) -> None:
    """Elements ``low`` .. ``high`` of new <- M x + beta old, vectors by address."""
    n, last, offsets = high - low, s.n_offsets, ints_at(s.offsets)
    if n <= 0:
        return
    before, y, row = floats_at(old + 8 * low), floats_at(new + 8 * low), 8 * s.n
    first = s.diagonals + 8 * low
    a, xa = floats_at(first), floats_at(x + 8 * (low + offsets[0]))
    if last >= 3:
        b, xb = floats_at(first + row), floats_at(x + 8 * (low + offsets[1]))
        c, xc = floats_at(first + 2 * row), floats_at(x + 8 * (low + offsets[2]))
        for i in parallel(n):
            y[i] = beta * before[i] + a[i] * xa[i] + b[i] * xb[i] + c[i] * xc[i]
    else:
        for i in parallel(n):
            y[i] = beta * before[i] + a[i] * xa[i]
    k = 3 if last >= 3 else 1
    while k + 1 < last:
        d, e = floats_at(first + k * row), floats_at(first + (k + 1) * row)
        xd, xe = floats_at(x + 8 * (low + offsets[k])), floats_at(x + 8 * (low + offsets[k + 1]))
        for i in parallel(n):
            y[i] = y[i] + (d[i] * xd[i] + e[i] * xe[i])
        k += 2
    if k < last:
        f, xf = floats_at(first + k * row), floats_at(x + 8 * (low + offsets[k]))
        for i in parallel(n):
            y[i] = y[i] + f[i] * xf[i]
    rows, columns, entries = ints_at(s.rows), ints_at(s.columns), floats_at(s.entries)
    vector, result = floats_at(x), floats_at(new)
    for m in range(s.n_entries):
        if low <= rows[m] < high:
            result[rows[m]] += entries[m] * vector[columns[m]]


@native
def _gather(s: Series, k: int, used: int, low: int, high: int) -> None:
    """Accumulate the terms k .. k + 7 of the series, held in vectors 2 .. 9, into the sums that have that many terms."""
    n, terms, at = high - low, ints_at(s.terms), 8 * low
    a, b, c, d = (
        floats_at(_vector(s, 2) + at), floats_at(_vector(s, 3) + at), floats_at(_vector(s, 4) + at), floats_at(_vector(s, 5) + at),
    )  # fmt: skip
    e, f, g, h = (
        floats_at(_vector(s, 6) + at), floats_at(_vector(s, 7) + at), floats_at(_vector(s, 8) + at), floats_at(_vector(s, 9) + at),
    )  # fmt: skip
    for j in range(used):
        if k < terms[j]:
            y, q = floats_at(s.sums + 8 * (j * s.n + low)), floats_at(s.coefficients + 8 * (j * s.width + k))
            q0, q1, q2, q3, q4, q5, q6, q7 = q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7]
            for i in parallel(n):
                y[i] = y[i] + (
                    (q0 * a[i] + q1 * b[i]) + (q2 * c[i] + q3 * d[i]) + ((q4 * e[i] + q5 * f[i]) + (q6 * g[i] + q7 * h[i]))
                )


@native
def march(address: int) -> int32:
    """Advance ``z``; each row of ``out`` receives the next state.

    Eight terms are computed tile by tile, each term's tile lagging the one before by the bandwidth, so that the matrix is read from L1
    cache. All rows of ``coefficients`` sum the same vectors; they are zero-padded behind their ``terms``, so that eight terms can be
    added at a time.
    """
    s = Series(address)
    n, margin, alone, terms = s.n, s.margin, s.alone, ints_at(s.terms)
    z, v0, v1 = floats_at(s.z), floats_at(_vector(s, 0)), floats_at(_vector(s, 1))
    v8, v9 = floats_at(_vector(s, 8)), floats_at(_vector(s, 9))
    done = part = 0
    while done < s.count:
        used = min(s.several, s.count - done)
        for i in parallel(n):
            v0[i] = z[i]
        _recur(s, 0.0, 0, n, _vector(s, 0), _vector(s, 0), _vector(s, 1))
        for i in parallel(n):
            v1[i] = 0.5 * v1[i]  # P_1 = X, all others P_{k+1} = 2 X P_k +- P_{k-1}
        for j in range(used):
            q, y = floats_at(s.coefficients + 8 * j * s.width), floats_at(s.sums + 8 * j * n)
            q0, q1 = q[0], q[1]
            for i in parallel(n):
                y[i] = q0 * z[i] + q1 * v1[i]
        k = 2
        while k < terms[used - 1]:
            for row in range(2, 10):
                _recur(s, s.beta, alone, n, _vector(s, row - 1), _vector(s, row - 2), _vector(s, row))
            _gather(s, k, used, alone, n)
            tile = 0
            while tile < alone:
                low, high = tile, min(tile + TILE, alone)
                for row in range(2, 10):
                    _recur(s, s.beta, low, high, _vector(s, row - 1), _vector(s, row - 2), _vector(s, row))
                    if row < 9:
                        low, high = max(low - margin, 0), high if high == alone else max(high - margin, 0)
                _gather(s, k, used, low, high)
                tile += TILE
            for i in parallel(n):
                v0[i] = v8[i]
            for i in parallel(n):
                v1[i] = v9[i]
            k += 8
        result = floats_at(s.sums + 8 * (used - 1) * n)
        for i in parallel(n):
            z[i] = result[i]
        part += 1
        if part == s.repeats:
            for j in range(used):
                source, target = floats_at(s.sums + 8 * j * n), floats_at(s.out + 8 * (done + j) * n)
                for i in parallel(n):
                    target[i] = source[i]
            done += used
            part = 0
    return 0


@native
def growth(address: int) -> int32:
    """Largest entry of the last two of every eight of the first ``length`` polynomials applied to ``z``; uses three vectors."""
    s = Series(address)
    n, z, v0, v1 = s.n, floats_at(s.z), floats_at(_vector(s, 0)), floats_at(_vector(s, 1))
    for i in parallel(n):
        v0[i] = z[i]
    _recur(s, 0.0, 0, n, _vector(s, 0), _vector(s, 0), _vector(s, 1))
    for i in parallel(n):
        v1[i] = 0.5 * v1[i]
    largest = 0.0
    for k in range(2, s.length):
        _recur(s, s.beta, 0, n, _vector(s, (k - 1) % 3), _vector(s, (k - 2) % 3), _vector(s, k % 3))
        if k % 8 < 2:
            new = floats_at(_vector(s, k % 3))
            for i in range(n):
                largest = max(largest, abs(new[i]))
    s.largest = largest
    return 0


@record
class Graph(ctypes.Structure):
    """Adjacency lists of a graph, with the work arrays of a search."""

    n: int
    indptr: int
    indices: int
    weight: int
    logs: int
    label: int
    degree: int
    order: int
    queue: int
    mark: int
    components: int


@native
def spread(address: int) -> int32:
    """Breadth-first sums of ``weight`` along edges: logs[j] = logs[i] - weight[i, j]. Labels the connected components."""
    s = Graph(address)
    indptr, indices, weight = ints_at(s.indptr), ints_at(s.indices), floats_at(s.weight)
    logs, label, queue = floats_at(s.logs), ints_at(s.label), ints_at(s.queue)
    components = 0
    for i in range(s.n):
        label[i] = -1
    for root in range(s.n):
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
    s.components = components
    return 0


@native
def _breadth_first(s: Graph, start: int, stamp: int) -> int:
    """Nodes in breadth-first order from ``start``, neighbours of small degree first. Returns their number."""
    indptr, indices, degree = ints_at(s.indptr), ints_at(s.indices), ints_at(s.degree)
    queue, mark = ints_at(s.queue), ints_at(s.mark)
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


@native
def narrow_order(address: int) -> int32:
    """Cuthill-McKee order of a symmetric pattern, each component from a peripheral node: a chain then has minimal bandwidth."""
    s = Graph(address)
    order, queue, label = ints_at(s.order), ints_at(s.queue), ints_at(s.label)
    placed = stamp = 0
    for root in range(s.n):
        if label[root] != 0:
            continue
        start, size = root, 0
        for _ in range(3):
            stamp += 1
            size = _breadth_first(s, start, stamp)
            start = queue[size - 1]
        for k in range(size):
            order[placed + k] = queue[k]
            label[queue[k]] = 1
        placed += size
    return 0


@record
class Directions(ctypes.Structure):
    """A matrix as its diagonal and the symmetric and skew parts of its off-diagonal entries; directions by cosine and sine."""

    n: int
    diagonal: int
    rows: int
    symmetric: int
    skew: int
    n_entries: int
    cosines: int
    sines: int
    count: int
    sums: int
    bounds: int


@native
def hermitian_bounds(address: int) -> int32:
    """Gershgorin upper bounds of the Hermitian parts of exp(-i angle) A."""
    s = Directions(address)
    diagonal, rows, sums, bounds = floats_at(s.diagonal), ints_at(s.rows), floats_at(s.sums), floats_at(s.bounds)
    symmetric, skew, cosines, sines = floats_at(s.symmetric), floats_at(s.skew), floats_at(s.cosines), floats_at(s.sines)
    for k in range(s.count):
        cosine, sine = cosines[k], sines[k]
        for i in parallel(s.n):
            sums[i] = cosine * diagonal[i]
        for e in range(s.n_entries):
            sums[rows[e]] += math.sqrt((cosine * symmetric[e]) ** 2 + (sine * skew[e]) ** 2)
        largest = sums[0]
        for i in range(s.n):
            largest = max(largest, sums[i])
        bounds[k] = largest
    return 0


def call(name: str, record: ctypes.Structure, **arrays: NDArray[Any]) -> None:
    """Call one of the compiled functions above."""
    native_functions(__name__).call(name, record, **arrays)
