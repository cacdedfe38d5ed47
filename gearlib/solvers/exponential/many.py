"""Exponentials of many small systems at once: samples of some states of x' = A x + B u(t), each run with its own matrix and start.

The samples of a uniform grid are products of two short sequences, rows C exp(G h)^a and columns exp(G h)^(m b) z with a < m and
b < count / m: a history of a few states costs little more than the exponential. As in `dense`, exponentials are stored as their
deviation from the identity. All operations are products of stacked matrices, one by one: a run does not depend on the others.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gearlib.solvers.exponential.dense import REACH, taylor
from gearlib.solvers.exponential.forcing import Exosystem, Forcing
from gearlib.solvers.exponential.stretches import Stretch

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
AT_ONCE = 64  # runs whose matrices fit into the cache together


def histories(
    A: Floats, B: Floats, forcing: Forcing, cuts: Sequence[Stretch], starts: Floats, columns: Integers, out: Floats
) -> Floats:
    """Samples of some states of many runs.

    Parameters
    ----------
    A : array, shape (runs, states, states)
    B : array, shape (runs, states, inputs)
    forcing : Forcing
        The inputs, common to all runs.
    cuts : sequence of Stretch
        Of the sample times.
    starts : array, shape (runs, states)
    columns : array of int
        The states that are kept.
    out : array, shape (runs, samples, columns)
        Is filled from the first stretch on; rows at the start are left as they are.

    Returns
    -------
    array
        ``out``; not finite where the solution overflows.
    """
    with np.errstate(all="ignore"):
        for first in range(0, len(A), AT_ONCE):
            here = slice(first, first + AT_ONCE)
            _march(A[here], B[here], forcing, cuts, starts[here], columns, out[here])
    return out


def _march(A: Floats, B: Floats, forcing: Forcing, cuts: Sequence[Stretch], x: Floats, columns: Integers, out: Floats) -> None:
    n, known, scales = A.shape[1], dict[tuple[bytes, float], RepeatedSteps](), balanced(A)
    for k, stretch in enumerate(cuts):
        if stretch.h == 0.0:
            if stretch.row >= 0:
                out[:, stretch.row : stretch.row + stretch.count] = x[:, None, columns]
            continue
        exosystem = forcing.pieces[stretch.piece]
        key = exosystem.key, stretch.h
        if key not in known:
            known[key] = RepeatedSteps(_generator(A, B, exosystem), stretch.h, scales)
        powers, s = known[key], exosystem.state(stretch.start)
        z = np.concatenate([x, np.broadcast_to(s, (len(x), len(s)))], axis=1)
        if stretch.row >= 0:
            out[:, stretch.row : stretch.row + stretch.count] = powers.samples(z, stretch.count, columns)
        if k + 1 < len(cuts):
            x = powers.after(z, stretch.count)[:, :n]


def _generator(A: Floats, B: Floats, exosystem: Exosystem) -> Floats:
    """Matrices of the states augmented by the exosystem that generates their inputs."""
    runs, n, order = len(A), A.shape[1], len(exosystem.S)
    G = np.zeros((runs, n + order, n + order))
    G[:, :n, :n], G[:, :n, n:], G[:, n:, n:] = A, B @ exosystem.H, exosystem.S
    return G


class RepeatedSteps:
    """Deviations from the identity of exp(G h), exp(2 G h), exp(4 G h), ... of many matrices, computed as they are needed."""

    def __init__(self, G: Floats, h: float, scales: Floats) -> None:
        self._chain = [deviations(G, h, scales)]

    def _of(self, k: int) -> Floats:
        while len(self._chain) <= k:
            self._chain.append(_doubled(self._chain[-1]))
        return self._chain[k]

    def after(self, z: Floats, count: int) -> Floats:
        """The vectors after a number of steps."""
        for k in range(count.bit_length()):
            if count >> k & 1:
                z = z + (self._of(k) @ z[:, :, None])[:, :, 0]
        return z

    def samples(self, z: Floats, count: int, columns: Integers) -> Floats:
        """The next ``count`` values of some entries, shape (runs, count, columns)."""
        runs, n = z.shape
        half = rows_for(count, len(columns))
        m = 2**half
        rows = np.zeros((runs, len(columns), n))
        rows[:, np.arange(len(columns)), columns] = 1.0
        rows = rows + rows @ self._of(0)
        for k in range(half):
            rows = np.concatenate([rows, rows + rows @ self._of(k)], axis=1)
        blocks = -(-count // m)
        ahead = z[:, None]
        k = half
        while ahead.shape[1] < blocks:
            more = ahead[:, : blocks - ahead.shape[1]]
            ahead = np.concatenate([ahead, more + more @ self._of(k).transpose(0, 2, 1)], axis=1)
            k += 1
        found = ahead @ rows.transpose(0, 2, 1)
        return np.asarray(found.reshape(runs, m * blocks, len(columns))[:, :count])


def rows_for(count: int, columns: int) -> int:
    """Doublings of the rows: as many as of the columns for one state, fewer for many."""
    return max(0, min((count - 1).bit_length(), round(0.5 * math.log2(max(count / columns, 1.0)))))


def balanced(A: Floats) -> Floats:
    """Sizes of states, (runs, states), that balance each matrix: powers of two, which make different units comparable."""
    from scipy.linalg.lapack import dgebal

    good = np.where(np.isfinite(A).all(axis=(1, 2), keepdims=True), A, 0.0)
    return np.array([dgebal(matrix, scale=1, permute=0)[3] for matrix in good])


def deviations(G: Floats, h: float, scales: Floats) -> Floats:
    """exp(G h) - I of many matrices, each with as many doublings as it needs."""
    n, size = scales.shape[1], np.abs(G)
    size[:, :n] /= scales[:, :, None]
    size[:, :, :n] *= scales[:, None, :]
    driven = size[:, :n, n:].max(axis=(1, 2), initial=0.0)  # what drives the states may be scaled at will
    size[:, :n, n:] /= np.where(driven > 0.0, driven, 1.0)[:, None, None]
    norm = np.minimum(size.sum(axis=1).max(axis=1), size.sum(axis=2).max(axis=1)) * abs(h) / REACH
    doublings = np.ceil(np.log2(np.maximum(np.where(np.isfinite(norm), norm, 1.0), 1.0))).astype(int)
    out = np.empty_like(G)
    for d in np.unique(doublings).tolist():
        here = doublings == d
        E = taylor(G[here] * math.ldexp(h, -d))
        for _ in range(d):
            E = _doubled(E)
        out[here] = E
    return out


def _doubled(E: Floats) -> Floats:
    square: Floats = E @ E
    square += E
    square += E
    return square
