"""Stepping of large linear scenes: decoupled groups of states, and the action of sparse matrix exponentials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.recent import recent
from gearlib.solvers.exponential.action import Action, Triplets, band_order, prepare
from gearlib.solvers.exponential.forcing import MOST_KNOWN, Exosystem, Known

Floats = NDArray[np.float64]


def components(A: Triplets, n: int, known: Known) -> list[Any]:
    """Decoupled groups of states as index arrays; a single slice if all are coupled."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    def found() -> list[Any]:
        pattern = coo_array((np.ones(len(A.rows)), (A.rows, A.columns)), shape=(n, n))
        count, label = connected_components(pattern, directed=False)
        return [slice(None)] if count == 1 else [np.flatnonzero(label == k) for k in range(count)]

    return recent(known, ("parts", *_pattern(A)), found, MOST_KNOWN)


def _pattern(A: Triplets) -> tuple[bytes, bytes]:
    return A.rows.tobytes(), A.columns.tobytes()


def union(matrices: Sequence[Any]) -> Triplets:
    """Nonzeros of a matrix, and of its derivatives."""
    first, *others = matrices
    return _triplets(sum((abs(M) for M in others), abs(first)) if others else first)


class SparseStepping:
    """Stepping by the action of sparse exponentials; one prepared action per exosystem."""

    def __init__(self, matrices: Sequence[Any], B: Any, n: int, span: float, rtol: float, known: Known) -> None:
        self._A, self._B, self._n, self._span, self._rtol, self._of_pattern = matrices, B, n, span, rtol, known
        pattern = union(matrices)
        self._order = recent(known, ("order", *_pattern(pattern)), lambda: band_order(pattern, n), MOST_KNOWN)
        self._known: dict[bytes, Action] = {}

    @property
    def fastest(self) -> float:
        """Upper bound on the eigenvalue magnitudes (1/s)."""
        ellipses = [action.ellipse for action in self._known.values()]
        return max((abs(e.centre) + e.real + e.imaginary for e in ellipses), default=0.0)

    def of(self, exosystem: Exosystem) -> Action:
        if exosystem.key not in self._known:
            n, inputs, blocks = self._n, len(exosystem.S), len(self._A)
            size = n * blocks
            parts = [_triplets(self._A[0], k * n, k * n) for k in range(blocks)]
            parts += [_triplets(M, k * n, 0) for k, M in enumerate(self._A[1:], 1)]
            driven = np.asarray(self._B @ exosystem.H).reshape(size, inputs)
            parts += [_triplets(driven, 0, size), _triplets(exosystem.S, size, size)]
            rows, columns = (np.concatenate([getattr(p, name) for p in parts]) for name in ("rows", "columns"))
            G = Triplets(rows, columns, np.concatenate([p.entries for p in parts]))
            # each state beside its tangents; inputs may act on any state and are excluded from the bandwidth ordering
            beside = (self._order[:, None] + n * np.arange(blocks)).ravel()
            order = np.append(beside, np.arange(size, size + inputs))
            self._known[exosystem.key] = prepare(G, order, self._span, inputs, self._of_pattern)
        return self._known[exosystem.key]

    def advance(self, exosystem: Exosystem, h: float, count: int, x: Floats, s: Floats) -> Floats:
        found = self.of(exosystem).advance(np.concatenate([x.ravel(), s]), h, count, self._rtol)
        return np.ascontiguousarray(found[:, : x.size]).reshape(count, *x.shape)


def _triplets(M: Any, row: int = 0, column: int = 0) -> Triplets:
    """Nonzeros of a dense or sparse matrix, offset by a row and a column."""
    if isinstance(M, np.ndarray):
        rows, columns = np.nonzero(M)
        return Triplets(rows + row, columns + column, M[rows, columns])
    M = M.tocsr()
    keep = M.data != 0
    rows = np.repeat(np.arange(M.shape[0]), np.diff(M.indptr))
    return Triplets(rows[keep] + row, M.indices[keep].astype(np.int64) + column, M.data[keep].astype(float))
