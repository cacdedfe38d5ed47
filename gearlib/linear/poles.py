"""Poles of a linear model: exact zeros with their Jordan chains, the others with error bounds.

A freely rotating train has a pole at 0, which rounding would move to either side of the imaginary axis. The zeros are therefore
deflated first, by the ranks of the matrix on successive quotient spaces (the staircase algorithm of V. N. Kublanovskaya, "On a method
of solving the complete eigenvalue problem for a degenerate matrix", USSR Comput. Math. Math. Phys. 6 (1966), doi
10.1016/0041-5553(66)90001-8); each of the others is compared with a bound of its own rounding error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError, GearlibWarning, warn
from gearlib.linear.balancing import balance
from gearlib.linear.linear_model import full

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Verdict = Literal["stable", "marginal", "drifting", "unstable"]
# Singular values below this fraction of the largest count as zero; those at zero of 1100 random trains had up to a tenth of it.
RANK = 4e-15
# Resolution relative to the slowest pole above which it is reported: where poles count as 0 or as undamped, and where none do.
HIDING, BLURRING = 1e-6, 1e-3
NEARLY_DEFECTIVE = 1e-4  # cosine between the left and the right eigenvector
MOST_QUARTERS = 30
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
    resolution : float
        Rad/s: slower poles cannot be told from 0, which is due to the fastest ones.
    """

    values: Complexes
    tolerances: Floats
    chains: tuple[int, ...]
    chained: tuple[float, ...] = ()
    resolution: float = 0.0

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
    matrix = full(A)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ArgumentError(f"a matrix of shape {matrix.shape} has no eigenvalues; expected a square one")
    if not (np.abs(matrix) < 1e150).all():
        raise ArgumentError("the matrix holds numbers that are not finite, or whose squares are not")
    balanced = balance(matrix)[0] if matrix.size else matrix
    found = eigen(balanced)
    others = np.where(np.abs(found.values.real) <= found.tolerances, 1j * found.values.imag, found.values)
    values = np.concatenate([np.zeros(sum(found.chains)), others])
    error = np.concatenate([np.zeros(sum(found.chains)), found.tolerances])
    order = np.lexsort((values.imag, np.abs(values.imag), np.round(np.abs(values), 12)))
    return Poles(values[order], error[order], found.chains, _chained(balanced, others, found.tolerances), found.resolution)


@dataclass(frozen=True, eq=False)
class Eigen:
    """Eigenvalues of a balanced matrix.

    Attributes
    ----------
    zero, others : arrays
        Orthonormal bases of the generalised null space and its complement.
    chains : tuple of int
        As of `Poles`.
    values, tolerances : arrays
        The eigenvalues on the complement, in no order, as computed.
    vectors : complex array
        Eigenvectors of the matrix on the complement.
    resolution : float
    """

    zero: Floats
    others: Floats
    chains: tuple[int, ...]
    values: Complexes
    tolerances: Floats
    vectors: Complexes
    resolution: float


def eigen(balanced: Floats) -> Eigen:
    """Eigenvalues and eigenvectors of a balanced matrix, its zeros apart."""
    from scipy.linalg import eig

    zero, others, chains, resolution = deflate(balanced)
    if not others.shape[1]:
        return Eigen(zero, others, chains, np.empty(0, complex), np.empty(0), np.empty((0, 0), complex), resolution)
    rest = others.T @ balanced @ others if chains else balanced
    values, left, right = eig(rest, left=True, right=True)
    overlap = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    perturbation = 40 * np.finfo(float).eps * float(np.linalg.norm(rest))
    error = perturbation / np.maximum(overlap, 1e-12)
    for k in np.flatnonzero((overlap < NEARLY_DEFECTIVE) & (np.abs(values.real) <= error)):
        error[k] = _reach(rest, values[k], perturbation, error[k])
    return Eigen(zero, others, chains, values, error, right, resolution)


def _reach(matrix: Floats, value: complex, perturbation: float, first_order: float) -> float:
    """How far a perturbation of a matrix moves an eigenvalue that is nearly defective, where the bound of first order is no bound.

    It moves no further than to where ``matrix - z`` is regular by more than the perturbation.
    """
    reach = first_order
    for _ in range(MOST_QUARTERS):
        around = (value + reach * 1j**k for k in range(4))
        if any(np.linalg.svd(matrix - z * np.eye(len(matrix)), compute_uv=False)[-1] <= perturbation for z in around):
            break
        reach /= 4
    return reach if reach == first_order else 4 * reach


def warn_of_rounding(name: str, states: Sequence[str], A: Any, found: Poles | Eigen) -> None:
    """Warn where rounding in a system's fastest poles exceeds what the slow ones are taken for."""
    sizes = np.abs(found.values[found.values != 0])
    on_axis = bool(found.chains) or bool((np.abs(found.values.real) <= found.tolerances).any())
    known = found.resolution <= (HIDING if on_axis else BLURRING) * sizes.min(initial=np.inf)
    rows = np.empty(0) if known and not found.chains else np.linalg.norm(balance(full(A))[0], axis=1)
    if known and not (rows[rows > 0] < found.resolution).any():  # else motions as slow may have been taken for some at 0
        return
    fastest = int(np.argmax(rows))
    warn(
        f"{name}: poles are known to {found.resolution:.1g} rad/s, since the fastest one, mostly of {states[fastest]}, is "
        f"{sizes.max():.2g} rad/s; a slower motion counts as a pole at 0, and less damping as none. A damping or an inertia that is "
        "nearly 0 makes such a pole; 0 leaves it out",
        GearlibWarning,
    )


def deflate(matrix: Floats) -> tuple[Floats, Floats, tuple[int, ...], float]:
    """Orthonormal bases of the generalised null space and its complement, the ranks of the staircase, and what counts as zero.

    In these bases the matrix is block triangular: the remainder does not depend on the motions at 0.
    """
    n = len(matrix)
    zero, others, rest = np.empty((n, 0)), np.eye(n), matrix
    chains: list[int] = []
    limit = RANK * max(10, n) / 10 * largest_singular_value(matrix)
    while len(rest):
        rows, null = rows_and_null(rest, limit)
        if not null.shape[1]:
            break
        chains.append(null.shape[1])
        zero, others = np.hstack([zero, others @ null]), others @ rows
        rest = others.T @ matrix @ others
    return zero, others, tuple(chains), limit


def largest_singular_value(matrix: Floats) -> float:
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
