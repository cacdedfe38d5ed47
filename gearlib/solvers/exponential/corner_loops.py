"""Compiled loops of `corners`, in the small language; arrays are passed by address."""

from __future__ import annotations

import ctypes

from gearlib.compiler.small_language import floats_at, int32, ints_at, native, record

ROUNDING = 1e-18  # terms of a Taylor series below this fraction of the sum are dropped


@record
class Corners(ctypes.Structure):
    """Intervals with their exponentials, or the matrix G of order n + 2 inputs with the work arrays of its series."""

    n: int
    inputs: int
    count: int
    matrices: int  # first n rows of exp(G h) - I for each interval length
    which: int
    G: int
    rate: float
    reach: float
    lengths: int
    drive: int
    x: int
    out: int
    z: int
    term: int
    following: int


@native
def by_matrices(address: int) -> int32:
    """Write x at the end of each interval into ``out``, using the exponential of its length."""
    s = Corners(address)
    n, m = s.n, 2 * s.inputs
    which, x, change = ints_at(s.which), floats_at(s.x), floats_at(s.z)
    for i in range(s.count):
        rows, drive, out = (
            floats_at(s.matrices + 8 * which[i] * n * (n + m)),
            floats_at(s.drive + 8 * i * m),
            floats_at(s.out + 8 * i * n),
        )
        for r in range(n):
            row, added = r * (n + m), 0.0
            for j in range(m):
                added += rows[row + n + j] * drive[j]
            for j in range(n):
                added += rows[row + j] * x[j]
            change[r] = added
        for r in range(n):
            x[r] = x[r] + change[r]
            out[r] = x[r]
    return 0


@native
def by_series(address: int) -> int32:
    """The same by Taylor series on (x, u, v), with substeps short enough for ``rate`` times a substep to stay below ``reach``."""
    s = Corners(address)
    n, m = s.n, s.inputs
    order = n + 2 * m
    G, lengths, x = floats_at(s.G), floats_at(s.lengths), floats_at(s.x)
    z, term, following = floats_at(s.z), floats_at(s.term), floats_at(s.following)
    for i in range(s.count):
        drive, out, parts = floats_at(s.drive + 16 * i * m), floats_at(s.out + 8 * i * n), 1
        while s.rate * lengths[i] > s.reach * parts:
            parts += 1
        h = lengths[i] / parts
        for r in range(n):
            z[r] = x[r]
        for r in range(2 * m):
            z[n + r] = drive[r]
        for _ in range(parts):
            for r in range(order):
                term[r] = z[r]
                following[r] = 0.0
            k, left, grows = 1, 1.0, True
            # the bound on the terms holds in scaled coordinates: where states hardly act back, a later term may be larger than it says
            while (left > ROUNDING or grows) and k < 40:
                for r in range(n):
                    added = 0.0
                    for j in range(order):
                        added += G[r * order + j] * term[j]
                    following[r] = added * h / k
                for r in range(m):
                    following[n + r] = term[n + m + r] * h / k
                grows = False
                for r in range(order):
                    term[r] = following[r]
                    z[r] = z[r] + following[r]
                    grows = grows or abs(following[r]) > ROUNDING * abs(z[r])
                left *= s.rate * h / k
                k += 1
        for r in range(n):
            x[r] = z[r]
            out[r] = z[r]
    return 0
