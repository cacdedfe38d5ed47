"""Derivatives of eigenvalues with respect to parameters, by left and right eigenvectors; for repeated ones, per branch.

References
----------
I. Fox, M. Kapoor, "Rates of change of eigenvalues and eigenvectors", AIAA Journal 6 (1968), doi 10.2514/3.5008

T. Kato, "Perturbation Theory for Linear Operators", Springer, 1966, chapter II, section 2.3 (repeated eigenvalues).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.linear.balancing import balance, similarity
from gearlib.linear.linear_model import full

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
REPEATED = 1e-8  # relative distance at which eigenvalues count as equal
DEFECTIVE = 1e-5  # product of unit left and right eigenvectors below which an eigenvalue is defective
MOST_FULL = 500  # states up to which all eigenvectors are computed
NEARBY = 6  # eigenvalues computed around each one of a large matrix: the branches of a repeated one, and neighbours


def eigenvalue_changes(A: Any, changes: Sequence[Any], values: Complexes) -> Complexes:
    """Derivatives of the eigenvalues of a matrix, shape (changes, values).

    For a repeated eigenvalue (with as many independent eigenvectors) they are the derivatives of the branches into which the change
    splits it, sorted by real and imaginary parts.

    Parameters
    ----------
    A : array or sparse matrix (n, n)
    changes : sequence of arrays or sparse matrices
        Derivatives of the matrix.
    values : complex array
        Eigenvalues; those that are exactly 0 stay at 0.

    Raises
    ------
    SolverError
        A defective repeated eigenvalue, which has no derivative.

    Examples
    --------
    >>> A, dA = np.diag([2.0, 2.0, 5.0]), np.diag([0.0, 3.0, 1.0])
    >>> eigenvalue_changes(A, [dA], np.array([2.0, 2.0, 5.0])).real
    array([[0., 3., 1.]])
    """
    found = np.zeros((len(changes), len(values)), complex)
    done = values == 0.0
    if done.all():
        return found
    around = _all_vectors(A) if A.shape[0] <= MOST_FULL else None
    for k in range(len(values)):
        if done[k]:
            continue
        here, left, right = _vectors_around(A, complex(values[k])) if around is None else around
        size = max(abs(values[k]), 1e-300)
        group = np.flatnonzero(np.abs(here - values[k]) <= max(REPEATED * size, 2 * float(np.abs(here - values[k]).min())))
        same = np.flatnonzero(~done & (np.abs(values - values[k]) <= REPEATED * size))
        done[same] = True
        Y, X = left[:, group], right[:, group]
        products = Y.conj().T @ X
        if np.linalg.svd(products, compute_uv=False).min() < DEFECTIVE:
            raise SolverError(
                f"the eigenvalue {values[k]:.6g} 1/s has no derivative: it is repeated with too few independent shapes (two poles meet "
                "there, and part like the root of a change of a parameter); take parameters beside these"
            )
        for i, change in enumerate(changes):
            inner: Any = np.linalg.solve(products, Y.conj().T @ np.asarray(change @ X))
            found[i, same] = _branches(inner, len(same), complex(values[k]))
    return found


def _branches(inner: Complexes, count: int, value: complex) -> Complexes:
    """Derivatives of the requested number of branches of a repeated eigenvalue."""
    own: Any = np.linalg.eigvals(inner)
    rounded = np.round(own / max(np.abs(own).max(), 1e-300), 12)
    own = own[np.lexsort((rounded.imag, rounded.real))]
    if len(own) > count:
        if np.abs(own - own[0]).max() > 1e-6 * np.abs(own).max():
            raise SolverError(
                f"the eigenvalue {value:.6g} 1/s is repeated {len(own)} times, and a change of the parameter parts them; ask for "
                f"all of them, not for {count}"
            )
        own = own[:count]
    return np.asarray(own, complex)


def _all_vectors(A: Any) -> tuple[Complexes, Complexes, Complexes]:
    """Eigenvalues, and unit left and right eigenvectors of the balanced matrix, in the original units of the states."""
    from scipy.linalg import eig

    balanced, scale = balance(full(A))
    values, left, right = eig(balanced, left=True, right=True)
    return values, left / scale[:, None], right * scale[:, None]


def _vectors_around(A: Any, value: complex) -> tuple[Complexes, Complexes, Complexes]:
    """The same for the eigenvalues nearest to a given one of a large matrix, by subspace inverse iteration on both sides."""
    import scipy.sparse as sparse
    from scipy.sparse.linalg import splu

    n = A.shape[0]
    scale = similarity(A)
    scaled = sparse.diags(1 / scale) @ sparse.csc_matrix(A) @ sparse.diags(scale)
    factors = splu((scaled - value * (1 + 1e-7) * sparse.identity(n)).tocsc())
    start = np.random.default_rng(0).normal(size=(n, NEARBY)).astype(complex)
    left, right = start, start.copy()
    for _ in range(12):
        right = np.linalg.qr(factors.solve(right))[0]
        left = np.linalg.qr(factors.solve(left, trans="H"))[0]
    values, turn = np.linalg.eig(np.linalg.solve(left.conj().T @ right, left.conj().T @ (scaled @ right)))
    other = np.linalg.inv(turn).conj().T  # of the projected matrix
    back = np.linalg.inv(left.conj().T @ right).conj().T @ other
    right, left = right @ turn, left @ back
    right, left = right / np.linalg.norm(right, axis=0), left / np.linalg.norm(left, axis=0)
    return values, left / scale[:, None], right * scale[:, None]
