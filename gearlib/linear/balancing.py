"""Balanced state matrices: scales of the states at which rounding is as small as the dynamics allow.

LAPACK's balancing (B. N. Parlett, C. Reinsch, "Balancing a matrix for calculation of eigenvalues and eigenvectors", Numerische
Mathematik 13 (1969) 293-304, doi 10.1007/BF02165404) makes rows and columns equal in size. As it is usually called, it first sets aside
the states that are coupled with the others one way only, and leaves them unscaled; here it scales all. A coupling that acts one way only
changes no eigenvalue, however large it is, but the rounding of a large one hides slow eigenvalues; the scale of what it acts upon makes
it small.
"""

from __future__ import annotations

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
