"""Poles of a linear model: exact zeros with their Jordan chains, the others with error bounds.

A freely rotating train has a pole at 0, which rounding would move to either side of the imaginary axis. The zeros are therefore
deflated first, by the ranks of the matrix on successive quotient spaces (the staircase algorithm of V. N. Kublanovskaya, "On a method
of solving the complete eigenvalue problem for a degenerate matrix", USSR Comput. Math. Math. Phys. 6 (1966), doi
10.1016/0041-5553(66)90001-8); each of the others is compared with a bound of its own rounding error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError
from gearlib.linear.balancing import balance

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Verdict = Literal["stable", "marginal", "drifting", "unstable"]
RANK = 1e-13  # singular values below this fraction of the largest count as zero
MEANING: dict[Verdict, str] = {
    "stable": "asymptotically stable: every motion dies away",
    "marginal": "marginally stable: nothing grows, but not everything dies away",
    "drifting": "drifting: no pole lies in the right half-plane, but a repeated pole on the imaginary axis makes motions grow with time",
    "unstable": "unstable: a motion grows exponentially",
}


@dataclass(frozen=True, eq=False)
class Poles:
    """Eigenvalues of a matrix, sorted by magnitude.

    Attributes
    ----------
    values : complex array
        Rad/s; poles at 0 are exactly 0, and so are the real parts of poles on the imaginary axis.
    tolerances : array
        Bound on the rounding error of each.
    chains : tuple of int
        Ranks of the staircase at 0: ``(2, 1)`` means two independent stationary motions, one of which can also drift.
    chained : tuple of float
        Nonzero frequencies (rad/s) of repeated, defective poles on the imaginary axis.
    """

    values: Complexes
    tolerances: Floats
    chains: tuple[int, ...]
    chained: tuple[float, ...] = ()

    @cached_property
    def at_zero(self) -> int:
        """Number of poles at 0."""
        return sum(self.chains)

    @cached_property
    def right(self) -> int:
        """Number of poles in the right half-plane."""
        return int((self.values.real > 0).sum())

    @cached_property
    def on_axis(self) -> Floats:
        """Imaginary parts of the poles on the imaginary axis: distinct, nonnegative."""
        found: list[float] = []
        for value, tolerance in zip(self.values, self.tolerances, strict=True):
            w = float(value.imag)
            if value.real == 0 and w >= 0 and not any(abs(w - other) <= max(tolerance, 1e-9 * w) for other in found):
                found.append(w)
        return np.array(sorted(found))

    @property
    def verdict(self) -> Verdict:
        """Stability by the eigenvalues: "stable", "marginal", "drifting" or "unstable"."""
        if self.right:
            return "unstable"
        if len(self.chains) > 1 or self.chained:
            return "drifting"
        return "marginal" if (self.values.real == 0).any() else "stable"

    @property
    def damping(self) -> Floats:
        """Damping ratios: 1 for real poles in the left half-plane, 0 on the imaginary axis, NaN at 0."""
        size = np.abs(self.values)
        ratio: Floats = np.divide(0.0 - self.values.real, size, out=np.full(len(size), np.nan), where=size > 0)
        return ratio


def poles(A: Any) -> Poles:
    """Eigenvalues of a square matrix, with exact zeros.

    Parameters
    ----------
    A : array, shape (states, states)

    Returns
    -------
    Poles

    Raises
    ------
    ArgumentError
        A matrix that is not square or not finite.

    Examples
    --------
    >>> found = poles([[0.0, 1.0], [0.0, 0.0]])
    >>> found.chains, found.verdict
    ((1, 1), 'drifting')
    """
    from scipy.linalg import eig

    matrix = np.array(A.toarray() if hasattr(A, "toarray") else A, float)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ArgumentError(f"a matrix of shape {matrix.shape} has no eigenvalues; expected a square one")
    if not (np.abs(matrix) < 1e150).all():
        raise ArgumentError("the matrix holds numbers that are not finite, or whose squares are not")
    if not matrix.size:
        return Poles(np.empty(0, complex), np.empty(0), ())
    balanced = balance(matrix)[0]
    _, others, chains = deflate(balanced)
    if not others.shape[1]:
        return Poles(np.zeros(len(matrix), complex), np.zeros(len(matrix)), chains)
    rest = others.T @ balanced @ others if chains else balanced
    values, left, right = eig(rest, left=True, right=True)
    overlap = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    error = 40 * np.finfo(float).eps * float(np.linalg.norm(rest)) / np.maximum(overlap, 1e-12)
    values = np.where(np.abs(values.real) <= error, 1j * values.imag, values)
    chained = _chained(balanced, values, error)
    values = np.concatenate([np.zeros(sum(chains)), values])
    error = np.concatenate([np.zeros(sum(chains)), error])
    order = np.lexsort((values.imag, np.abs(values.imag), np.round(np.abs(values), 12)))
    return Poles(values[order], error[order], chains, chained)


def deflate(matrix: Floats) -> tuple[Floats, Floats, tuple[int, ...]]:
    """Orthonormal bases of the generalised null space and its complement, and the ranks of the staircase.

    In these bases the matrix is block triangular: the remainder does not depend on the motions at 0.
    """
    n = len(matrix)
    zero, others, rest = np.empty((n, 0)), np.eye(n), matrix
    chains: list[int] = []
    limit = RANK * max(10, n) / 10 * _norm(matrix)
    while len(rest):
        rows, null = rows_and_null(rest, limit)
        if not null.shape[1]:
            break
        chains.append(null.shape[1])
        zero, others = np.hstack([zero, others @ null]), others @ rows
        rest = others.T @ matrix @ others
    return zero, others, tuple(chains)


def _norm(matrix: Floats) -> float:
    """Lower estimate of the largest singular value, at least the norm of the largest row.

    Power iteration starts from that row, since the matrix of a freely rotating train maps equal speeds to zero.
    """
    x = matrix[int(np.argmax(np.linalg.norm(matrix, axis=1)))] if len(matrix) else np.ones(0)
    size = 0.0
    for _ in range(20):
        mapped = matrix @ (x / max(float(np.linalg.norm(x)), 1e-300))
        size = float(np.linalg.norm(mapped))
        x = matrix.T @ (mapped / max(size, 1e-300))  # of the size of the matrix, whose fourth power may not be finite
    return float(np.sqrt(size * np.linalg.norm(x)))


def rows_and_null(matrix: Floats, limit: float) -> tuple[Floats, Floats]:
    """Orthonormal bases of the row space and null space of a matrix, with singular values up to ``limit`` counted as zero.

    An inverse, or a QR decomposition with column pivoting, bounds the singular values on both sides of the limit for a tenth of the
    cost of computing them; they are computed only where the bounds leave the rank undecided.
    """
    from scipy.linalg import qr, solve_triangular, svd

    n = len(matrix)
    try:
        smallest = 1 / max(float(np.linalg.norm(np.linalg.inv(matrix))), 1e-300)
    except np.linalg.LinAlgError:
        smallest = 0.0
    if smallest > limit:
        return np.eye(n), np.empty((n, 0))
    triangle, order = qr(matrix, pivoting=True, mode="r")
    sizes = np.abs(np.diag(triangle))
    rank = int((sizes > limit).sum())
    if np.linalg.norm(triangle[rank:]) <= limit:
        inverse = solve_triangular(triangle[:rank, :rank], np.eye(rank))
        if rank == 0 or 1 / np.linalg.norm(inverse) > limit:
            full = np.vstack([-inverse @ triangle[:rank, rank:], np.eye(n - rank)])
            basis = np.empty((n, n))
            basis[order] = qr(full)[0]
            return basis[:, n - rank :], basis[:, : n - rank]
    _, sizes, rows = svd(matrix)
    null = int((sizes <= limit).sum())
    return rows[: n - null].T, rows[n - null :].T


def _chained(matrix: Floats, values: Complexes, error: Floats) -> tuple[float, ...]:
    """Frequencies of repeated poles on the imaginary axis with too few eigenvectors."""
    found = []
    axis = (values.real == 0) & (values.imag > 0)
    done = np.zeros(len(values), bool)
    for i in np.flatnonzero(axis):
        w = values[i].imag
        near = axis & (np.abs(values.imag - w) <= np.maximum(np.maximum(error, error[i]), 1e-9 * w))
        if done[i] or near.sum() < 2:
            continue
        done |= near
        sizes = np.linalg.svd(matrix - 1j * np.mean(values[near].imag) * np.eye(len(matrix)), compute_uv=False)
        if (sizes <= 1e-7 * sizes[0]).sum() < near.sum():
            found.append(float(w))
    return tuple(found)
