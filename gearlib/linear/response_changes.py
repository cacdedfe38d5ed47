"""Derivatives of a transfer function with respect to parameters or frequency."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError
from gearlib.linear.balancing import balance
from gearlib.linear.linear_model import Matrices, full, is_sparse
from gearlib.recent import recent

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def response_changes(model: Matrices, change: Matrices, s: Any) -> Complexes:
    """Derivative of C (s I - A)^-1 B + D along a change of the matrices, shape (outputs, inputs, frequencies).

    Raises
    ------
    ArgumentError
        The model has a pole at one of the frequencies.

    Examples
    --------
    >>> one = Matrices(np.array([[-2.0]]), np.eye(1), np.eye(1), np.zeros((1, 1)))     # 1 / (s + 2)
    >>> slower = Matrices(np.array([[-1.0]]), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)))
    >>> complex(response_changes(one, slower, [0.0])[0, 0, 0])
    (-0.25+0j)
    """
    points = np.atleast_1d(np.asarray(s, complex))
    B, C, dB, dC, dD = (full(m) for m in (model.B, model.C, change.B, change.C, change.D))
    n = model.A.shape[0]
    result = np.empty((len(C), B.shape[1], len(points)), complex)
    result[:] = dD[:, :, None]
    if not n:
        return result
    solve = _solver(model.A)
    for k, point in enumerate(points):
        x = solve(point, B)
        ahead = np.asarray(change.A @ x) + dB
        result[:, :, k] += dC @ x + C @ solve(point, ahead)
    return result


def frequency_direction(model: Matrices) -> Matrices:
    """Change of the matrices equivalent to that of s: minus the identity for A."""
    import scipy.sparse as sparse

    zero = [np.zeros(m.shape) for m in (model.B, model.C, model.D)]
    return Matrices(-sparse.identity(model.A.shape[0], format="csr"), *zero)


def _solver(A: Any) -> Any:
    """A function that solves ``(s I - A) x = b``."""
    import scipy.sparse as sparse
    from scipy.sparse.linalg import splu

    n = A.shape[0]

    def refuse(s: complex) -> ArgumentError:
        return ArgumentError(f"the model has a pole at {s:.6g} rad/s: the response there has no derivative")

    if is_sparse(A):
        large = sparse.csc_matrix(A)
        known: dict[complex, Any] = {}

        def solve_sparse(s: complex, b: Any) -> Complexes:
            try:
                factors = recent(known, s, lambda: splu((s * sparse.identity(n) - large).tocsc()))
                return np.asarray(factors.solve(np.asarray(b, complex)))
            except RuntimeError:
                raise refuse(s) from None

        return solve_sparse
    balanced, scale = balance(full(A))

    def solve(s: complex, b: Any) -> Complexes:
        try:
            inner = np.linalg.solve(s * np.eye(n) - balanced, np.asarray(b, complex) / scale[:, None])
        except np.linalg.LinAlgError:
            raise refuse(s) from None
        return np.asarray(inner * scale[:, None])

    return solve
