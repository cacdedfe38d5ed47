"""Polynomials through the ends of steps, evaluated between them; written in the small language. `Trace` prepares what they pass through."""

from __future__ import annotations

import ctypes
import math

from gearlib.compiler.small_language import floats_at, int32, ints_at, native, record

__all__ = ["NODES", "Between"]

NODES = 12  # of a polynomial, at most: six ends in pairs
FEW = 7  # nodes


@record
class Between(ctypes.Structure):
    """Addresses of arrays, and their sizes."""

    times: int  # of the ends
    states: int  # (ends, columns)
    rates: int
    sample_times: int
    samples: int  # (samples, columns)
    ends: int  # (steps, n_ends); the first two are the step's own, -1: none
    inner: int  # samples within the step, (steps, n_inner); -1: none
    first: int  # of the wanted times, that lies in each step, (steps + 1,)
    wanted: int  # times
    out: int  # (wanted, columns)
    coarse: int  # the same, less the estimated errors
    nodes: int  # work space: `NODES` numbers, and ``table`` `NODES` of each column
    table: int
    n_columns: int
    n_steps: int
    n_ends: int
    n_inner: int


@native
def gathered(s: Between, k: int) -> int:
    """Nodes and values of the polynomials of a step; returns how many."""
    n, count = s.n_columns, 0
    nodes, table, times, states = floats_at(s.nodes), floats_at(s.table), floats_at(s.times), floats_at(s.states)
    ends, inner = ints_at(s.ends + 8 * k * s.n_ends), ints_at(s.inner + 8 * k * s.n_inner)
    sample_times, samples = floats_at(s.sample_times), floats_at(s.samples)
    for i in range(s.n_ends):
        e = ends[i]
        if e >= 0:
            for _ in range(2):
                nodes[count] = times[e]
                for j in range(n):
                    table[count * n + j] = states[e * n + j]
                count += 1
    for i in range(s.n_inner):
        e = inner[i]
        if e >= 0:
            nodes[count] = sample_times[e]
            for j in range(n):
                table[count * n + j] = samples[e * n + j]
            count += 1
    return count


@native
def differences(s: Between, k: int, count: int) -> None:
    """Newton's coefficients in place of the values; slopes where two nodes are the same."""
    n = s.n_columns
    nodes, table, rates, ends = floats_at(s.nodes), floats_at(s.table), floats_at(s.rates), ints_at(s.ends + 8 * k * s.n_ends)
    for order in range(1, count):
        for back in range(count - order):
            i = count - 1 - back
            gap = nodes[i] - nodes[i - order]
            for j in range(n):
                if order == 1 and gap == 0.0:
                    table[i * n + j] = rates[ends[i // 2] * n + j]
                else:
                    table[i * n + j] = (table[i * n + j] - table[(i - 1) * n + j]) / gap


@native
def left_out(s: Between, j: int, count: int) -> float:
    """Share of the last two terms that the error is estimated to be.

    Where Newton's terms fall, they do so by about the same factor from one pair to the next: what follows the last pair is about as
    much less than that as that is less than the pair before; with few nodes that is not relied on. The first term is the value
    itself, and says nothing.
    """
    nodes, table, n = floats_at(s.nodes), floats_at(s.table), s.n_columns
    middle, product, last, before = 0.5 * (nodes[0] + nodes[2]), 1.0, 0.0, 0.0
    for i in range(1, count):
        product *= abs(middle - nodes[i - 1])
        term = abs(table[i * n + j]) * product
        if i >= count - 2:
            last += term
        elif i >= count - 4:
            before += term
    share = last / before if last < before else 1.0
    return share if count > FEW else math.sqrt(share)


@native
def motion_between(address: int) -> int32:
    """The states between the ends of steps."""
    s = Between(address)
    n = s.n_columns
    nodes, table, first, wanted = floats_at(s.nodes), floats_at(s.table), ints_at(s.first), floats_at(s.wanted)
    out, coarse = floats_at(s.out), floats_at(s.coarse)
    for k in range(s.n_steps):
        count = gathered(s, k)
        differences(s, k, count)
        for j in range(n):
            share = left_out(s, j, count)
            for w in range(first[k], first[k + 1]):
                value, product, tail = table[j], 1.0, 0.0
                for i in range(1, count):
                    product *= wanted[w] - nodes[i - 1]
                    term = table[i * n + j] * product
                    value += term
                    if i >= count - 2:
                        tail += term
                out[w * n + j] = value
                coarse[w * n + j] = value - share * tail
    return 0
