"""Source of a sparse LU factorisation with threshold pivoting, inlined into code that solves large varying or nonlinear blocks.

The columns are eliminated in a fixed order (`gearlib.structure.elimination_order`); each takes, of the rows whose entry is large
enough, the one that comes first in that order. So the factors stay sparse, and each discrete state finds pivots of its own: stuck
friction is solved for a torque, sliding friction for an acceleration.

References
----------
J. R. Gilbert, T. Peierls, "Sparse partial pivoting in time proportional to arithmetic operations", SIAM Journal on Scientific and
Statistical Computing 9 (1988) 862-874, doi 10.1137/0909058
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearlib.structure.elimination_order import EliminationOrder

Integers = NDArray[np.int64]
# Storage per factor: this multiple of the fill-in of the planned order, since pivoting may deviate from it; a full triangle if it is small
ROOM = 6
COMPLETE = 10_000


def room(order: EliminationOrder) -> int:
    """Entries for which each factor has storage."""
    return max(ROOM * order.fill, min(order.n * (order.n + 1) // 2, COMPLETE))


def factors_size(order: EliminationOrder) -> int:
    """Numbers that `sparse_factorise` stores, with its work arrays."""
    return 4 + 13 * order.n + 4 * room(order)


def pattern_array(order: EliminationOrder) -> Integers:
    """Integers that `sparse_factorise` and `sparse_apply` read: sizes, column order, place of each row, columns' starts, rows."""
    ranks = np.empty(order.n, np.int64)
    ranks[order.rows] = np.arange(order.n)
    return np.concatenate([[order.n, room(order)], order.columns, ranks, order.starts, order.places // order.n])


SPARSE_SOLVE = '''
def sparse_factorise(data: floats, index: ints, s: int, a: int, m: int) -> None:
    """LU factors, stored from ``m`` on, of the matrix with the entries at ``a`` and the pattern at ``index[s]``.

    Rows are scaled by their largest entries. A column without a usable pivot leaves its unknown undetermined: it comes last among the
    pivots' columns, and its upper part from the end of their storage backwards. The logarithm of the determinant (-1e300 if it
    vanishes) and the rank (-1 if the factors exceed their storage) come first. ``mark``: the artificial compliances of the columns.
    """
    n, room, order, ranks = index[s], index[s + 1], s + 2, s + 2 + index[s]
    starts, rows = ranks + n, ranks + 2 * n + 1
    scale, place, pivot_rows, pivot_columns = m + 2, m + 2 + n, m + 2 + 2 * n, m + 2 + 3 * n
    pivots, x, mark, reached, stack, ahead = m + 2 + 4 * n, m + 2 + 5 * n, m + 2 + 6 * n, m + 2 + 7 * n, m + 2 + 8 * n, m + 2 + 9 * n
    lower_starts, turn = m + 2 + 10 * n, m + 4 + 12 * n
    upper_starts, lower = lower_starts + n + 1, turn + n
    upper = lower + 2 * room
    size = 0.0
    for i in range(n):
        data[scale + i], data[place + i], data[x + i], data[mark + i] = 0.0, -1.0, 0.0, -1.0
        data[turn + i] = index[ranks + i]
    for e in range(index[starts + n]):
        i = index[rows + e]
        data[scale + i] = max(data[scale + i], abs(data[a + e]))
    for i in range(n):
        if data[scale + i] > 0.0:
            size += log(data[scale + i])
            data[scale + i] = 1.0 / data[scale + i]
    rank, n_lower, n_upper, n_open = 0, 0, 0, 0
    data[lower_starts], data[upper_starts] = 0.0, 0.0
    for k in range(n):
        column = index[order + k]
        top = n
        for e in range(index[starts + column], index[starts + column + 1]):
            i = index[rows + e]
            head = -1
            if int(data[mark + i]) != k:
                head = 0
                data[stack] = i
            while head >= 0:
                j = int(data[stack + head])
                p = int(data[place + j])
                if int(data[mark + j]) != k:
                    data[mark + j] = k
                    data[ahead + head] = data[lower_starts + p] if p >= 0 else 0.0
                q, end, entered = int(data[ahead + head]), 0, 0
                if p >= 0:
                    end = int(data[lower_starts + p + 1])
                while q < end and entered == 0:
                    if int(data[mark + int(data[lower + 2 * q])]) != k:
                        entered = 1
                    q += 1
                data[ahead + head] = q
                if entered != 0:
                    head += 1
                    data[stack + head] = data[lower + 2 * q - 2]
                else:
                    head -= 1
                    top -= 1
                    data[reached + top] = j
        for e in range(index[starts + column], index[starts + column + 1]):
            i = index[rows + e]
            data[x + i] += data[a + e] * data[scale + i]
        for h in range(top, n):
            j = int(data[reached + h])
            data[ahead + j] = abs(data[x + j])
        for h in range(top, n):
            j = int(data[reached + h])
            p = int(data[place + j])
            if abs(data[x + j]) <= 1e-13 * data[ahead + j]:  # rounding of what it is computed from
                data[x + j] = 0.0
            y = data[x + j]
            if p >= 0 and y != 0.0:
                for q in range(int(data[lower_starts + p]), int(data[lower_starts + p + 1])):
                    i = int(data[lower + 2 * q])
                    term = data[lower + 2 * q + 1] * y
                    data[x + i] -= term
                    data[ahead + i] = max(data[ahead + i], abs(term))
        largest = 0.0
        for h in range(top, n):
            j = int(data[reached + h])
            if data[place + j] < 0.0:
                largest = max(largest, abs(data[x + j]))
        chosen = -1
        if largest > 1e-13:
            for h in range(top, n):
                j = int(data[reached + h])
                if data[place + j] < 0.0 and abs(data[x + j]) >= 1e-3 * largest:
                    if chosen < 0 or data[turn + j] < data[turn + max(chosen, 0)]:
                        chosen = j
        if max(n_lower, n_upper + n_open) + n - top > room:
            data[m], data[m + 1] = -1e300, -1.0
            return
        if chosen >= 0:
            pivot = data[x + chosen]
            size += log(abs(pivot))
            data[place + chosen], data[pivot_rows + rank], data[pivot_columns + rank] = rank, chosen, column
            data[pivots + rank] = pivot
            for h in range(top, n):
                j = int(data[reached + h])
                p = int(data[place + j])
                if data[x + j] != 0.0 and j != chosen:
                    if p >= 0:
                        data[upper + 2 * n_upper], data[upper + 2 * n_upper + 1] = p, data[x + j]
                        n_upper += 1
                    else:
                        data[lower + 2 * n_lower], data[lower + 2 * n_lower + 1] = j, data[x + j] / pivot
                        n_lower += 1
                        data[turn + j] = max(data[turn + j], data[turn + chosen])  # it has the entries of both now
            rank += 1
            data[lower_starts + rank], data[upper_starts + rank] = n_lower, n_upper
        else:
            for h in range(top, n):
                j = int(data[reached + h])
                if data[place + j] >= 0.0 and data[x + j] != 0.0:
                    n_open += 1
                    data[upper + 2 * (room - n_open)], data[upper + 2 * (room - n_open) + 1] = data[place + j], data[x + j]
            data[pivot_columns + rank + n - 1 - k] = column
            data[upper_starts + rank + n - k] = n_open
        for h in range(top, n):
            data[x + int(data[reached + h])] = 0.0
    data[m], data[m + 1] = size if rank == n else -1e300, rank
    for i in range(n):
        data[mark + i], largest = 0.0, 0.0
        for e in range(index[starts + i], index[starts + i + 1]):
            largest = max(largest, abs(data[a + e]))
            if 0.0 < abs(data[a + e]) * data[scale + index[rows + e]] <= 1e-20:
                data[mark + i] = abs(data[a + e]) * data[scale + index[rows + e]]
        data[mark + i] *= largest


def sparse_open(data: floats, index: ints, s: int, m: int, b: int) -> None:
    """The solution without right-hand side whose undetermined unknowns stand in the vector at ``b``; replaces the others there."""
    n, room, rank = index[s], index[s + 1], int(data[m + 1])
    pivot_columns, pivots, x, upper_starts = m + 2 + 3 * n, m + 2 + 4 * n, m + 2 + 5 * n, m + 3 + 11 * n
    upper = m + 4 + 13 * n + 2 * room
    for k in range(rank):
        data[x + k] = 0.0
    done = 0
    for k in range(n - 1, rank - 1, -1):
        y = data[b + int(data[pivot_columns + k])]
        for q in range(done, int(data[upper_starts + k + 1])):
            e = upper + 2 * (room - 1 - q)
            data[x + int(data[e])] -= data[e + 1] * y
        done = int(data[upper_starts + k + 1])
    for k in range(rank - 1, -1, -1):
        y = data[x + k] / data[pivots + k]
        data[b + int(data[pivot_columns + k])] = y
        for q in range(int(data[upper_starts + k]), int(data[upper_starts + k + 1])):
            data[x + int(data[upper + 2 * q])] -= data[upper + 2 * q + 1] * y


def sparse_slope(data: floats, index: ints, s: int, m: int, b: int, g: int) -> float:
    """How half the sum of squares of the unknowns at ``b``, times compliances, falls with each undetermined one, stored at ``g``.

    Returns the square of this slope.
    """
    n, room, rank = index[s], index[s + 1], int(data[m + 1])
    pivot_columns, pivots, x, mark = m + 2 + 3 * n, m + 2 + 4 * n, m + 2 + 5 * n, m + 2 + 6 * n
    upper_starts, upper = m + 3 + 11 * n, m + 4 + 13 * n + 2 * room
    for k in range(rank):
        c = int(data[pivot_columns + k])
        y = data[mark + c] * data[b + c]
        for q in range(int(data[upper_starts + k]), int(data[upper_starts + k + 1])):
            y -= data[upper + 2 * q + 1] * data[x + int(data[upper + 2 * q])]
        data[x + k] = y / data[pivots + k]
    done, square = 0, 0.0
    for k in range(n - 1, rank - 1, -1):
        c = int(data[pivot_columns + k])
        y = -data[mark + c] * data[b + c]
        for q in range(done, int(data[upper_starts + k + 1])):
            e = upper + 2 * (room - 1 - q)
            y += data[e + 1] * data[x + int(data[e])]
        done = int(data[upper_starts + k + 1])
        data[g + c] = y
        square += y * y
    return square


def sparse_apply(data: floats, index: ints, s: int, m: int, b: int, agreeing: int) -> int:
    """Solve for the right-hand side at ``b``, in place, with the factors at ``m``; returns 1 on failure.

    Linearly dependent equations are left out; if ``agreeing`` is not zero, it is a failure if they are inconsistent. Of the unknowns
    that they leave open, those with artificial compliances are made as small as can be (by conjugate gradients), the others zero.
    """
    n, room = index[s], index[s + 1]
    scale, place, pivot_rows, pivot_columns = m + 2, m + 2 + n, m + 2 + 2 * n, m + 2 + 3 * n
    pivots, x = m + 2 + 4 * n, m + 2 + 5 * n
    lower_starts = m + 2 + 10 * n
    upper_starts, lower = lower_starts + n + 1, m + 4 + 13 * n
    upper = lower + 2 * room
    rank = int(data[m + 1])
    if rank < 0:
        return 1
    for i in range(n):
        data[b + i] *= data[scale + i]
    largest = 1.0
    for k in range(rank):
        y = data[b + int(data[pivot_rows + k])]
        data[x + k] = y
        largest = max(largest, abs(y))
        if y != 0.0:
            for q in range(int(data[lower_starts + k]), int(data[lower_starts + k + 1])):
                i = int(data[lower + 2 * q])
                data[b + i] -= data[lower + 2 * q + 1] * y
    if rank < n and agreeing != 0:
        for i in range(n):
            if data[place + i] < 0.0 and not abs(data[b + i]) <= 1e-9 * largest:
                return 1
    for i in range(n):
        data[b + i] = 0.0
    for k in range(rank - 1, -1, -1):
        y = data[x + k] / data[pivots + k]
        data[b + int(data[pivot_columns + k])] = y
        if y != 0.0:
            for q in range(int(data[upper_starts + k]), int(data[upper_starts + k + 1])):
                i = int(data[upper + 2 * q])
                data[x + i] -= data[upper + 2 * q + 1] * y
    if rank < n:
        sparse_make_least(data, index, s, m, b)
    return 0


def sparse_make_least(data: floats, index: ints, s: int, m: int, b: int) -> None:
    """Replace the solution at ``b``, whose open unknowns are zero, by the one with the least weighted squares."""
    n, rank = index[s], int(data[m + 1])
    pivot_columns = m + 2 + 3 * n
    mark, p, v, g = m + 2 + 6 * n, m + 2 + 7 * n, m + 2 + 8 * n, m + 2 + 9 * n
    for i in range(n):
        data[p + i] = 0.0
    square, before = sparse_slope(data, index, s, m, b, g), 1.0
    for turn in range(10 * (n - rank) + 20):
        for k in range(rank, n):
            i = int(data[pivot_columns + k])
            data[p + i] = data[g + i] + square / before * data[p + i]
            data[v + i] = data[p + i]
        sparse_open(data, index, s, m, v)
        size, curvature = 0.0, 0.0
        for i in range(n):
            size += data[mark + i] * data[b + i] * data[b + i]
            curvature += data[mark + i] * data[v + i] * data[v + i]
        if square * square <= 1e-28 * size * curvature:
            return
        smaller = 0.0
        for i in range(n):
            y = data[b + i] + square / curvature * data[v + i]
            smaller += data[mark + i] * y * y
        if smaller >= size:  # by rounding
            return
        for i in range(n):
            data[b + i] += square / curvature * data[v + i]
        before = square
        square = sparse_slope(data, index, s, m, b, g)


def sparse_row(data: floats, index: ints, s: int, m: int, b: int) -> None:
    """A weighted sum of rows of the inverse, by a solution with the transposed factors at ``m``.

    On entry ``b`` holds the weights, on return the sum. The matrix must have full rank.
    """
    n, room = index[s], index[s + 1]
    scale, pivot_rows, pivot_columns, pivots, x = m + 2, m + 2 + 2 * n, m + 2 + 3 * n, m + 2 + 4 * n, m + 2 + 5 * n
    lower_starts = m + 2 + 10 * n
    upper_starts, lower = lower_starts + n + 1, m + 4 + 13 * n
    upper = lower + 2 * room
    for k in range(n):
        y = data[b + int(data[pivot_columns + k])]
        for q in range(int(data[upper_starts + k]), int(data[upper_starts + k + 1])):
            y -= data[upper + 2 * q + 1] * data[x + int(data[upper + 2 * q])]
        data[x + k] = y / data[pivots + k]
    for k in range(n - 1, -1, -1):
        y = data[x + k]
        for q in range(int(data[lower_starts + k]), int(data[lower_starts + k + 1])):
            y -= data[lower + 2 * q + 1] * data[b + int(data[lower + 2 * q])]
        data[b + int(data[pivot_rows + k])] = y
    for i in range(n):
        data[b + i] *= data[scale + i]


'''
