"""Balanced state matrices: scales of the states at which rounding is as small as the dynamics allow.

LAPACK's balancing (B. N. Parlett, C. Reinsch, "Balancing a matrix for calculation of eigenvalues and eigenvectors", Numerische
Mathematik 13 (1969) 293-304, doi 10.1007/BF02165404) makes rows and columns equal in size. As it is usually called, it first sets aside
the states that are coupled with the others one way only, and leaves them unscaled; here it scales all. A coupling that acts one way only
changes no eigenvalue, however large it is, but the rounding of a large one hides slow eigenvalues; the scale of what it acts upon makes
it small.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def balance(A: Floats) -> tuple[Floats, Floats]:
    """A balanced matrix and the scales of its states, which are ``x / scale``.

    Examples
    --------
    >>> balanced, scale = balance(np.array([[-1.0, 0.0], [1e9, 0.5]]))
    >>> bool(abs(balanced).max() <= 2.0)
    True
    """
    from scipy.linalg import matrix_balance

    # SciPy reads an order of the states from the scales, too, for which they may be too large
    with np.errstate(invalid="ignore"):
        balanced, (scale, _) = matrix_balance(A, permute=False, separate=True)
    return balanced, scale


def similarity(A: Any) -> Floats:
    """State scales under which the entries ``a_ij`` and ``a_ji`` have similar magnitude, as far as possible.

    For a conservative system the scaled matrix is skew, so that rounding is not amplified.
    """
    import scipy.sparse as sparse
    from scipy.sparse.linalg import spsolve

    n = A.shape[0]
    size = abs(sparse.csr_matrix(A))
    size.setdiag(0.0)
    size.eliminate_zeros()
    both = size.multiply(size.T).tocoo()
    i, j = both.row, both.col
    log = np.zeros(n)
    if len(i):
        forward, back = (np.asarray(size[p, q]).ravel() for p, q in ((i, j), (j, i)))
        step = 0.5 * np.log(back / forward)  # of log scale, from i to j
        graph = sparse.csr_matrix((np.ones(len(i)), (i, j)), shape=(n, n))
        degree = np.asarray(graph.sum(axis=1)).ravel()
        right = np.bincount(j, step, n) - np.bincount(i, step, n)
        log = spsolve(sparse.csc_matrix(2 * (sparse.diags(degree + 1e-9) - graph)), right)
    for _ in range(30):  # entries without a partner: equilibrate rows and columns
        scaled = sparse.diags(np.exp(-log)) @ size @ sparse.diags(np.exp(log))
        rows, columns = np.asarray(scaled.sum(axis=1)).ravel(), np.asarray(scaled.sum(axis=0)).ravel()
        used = (rows > 0) & (columns > 0)
        log[used] += 0.25 * np.log(rows[used] / columns[used])
    scale: Floats = np.exp(log - log.mean())
    return scale
