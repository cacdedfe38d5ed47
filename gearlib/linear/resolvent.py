"""Laurent series of the resolvent ``(s I - A)^-1`` about s = 0, also where A has poles there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearlib.linear.balancing import balance
from gearlib.linear.poles import deflate

Floats = NDArray[np.float64]


def laurent(A: Floats) -> tuple[list[Floats], list[Floats]]:
    """Coefficients of the resolvent: those of 1 / s, 1 / s^2, ..., and those of 1, s, ..., one more of these.

    With the projector P onto the motions at 0 along all others, and the Drazin inverse D, the inverse of A on these others, they are
    ``A^(k-1) P`` and ``-D^(k+1)``.

    References
    ----------
    S. L. Campbell, C. D. Meyer, "Generalized Inverses of Linear Transformations", Pitman 1979, chapter 7.

    Examples
    --------
    Of ``1 / s`` and ``1 / (s + 2)``:

    >>> poles, regular = laurent(np.array([[0.0, 0.0], [0.0, -2.0]]))
    >>> [float(m[0, 0]) for m in poles], [float(m[1, 1]) for m in regular]
    ([1.0], [0.5, -0.25])
    """
    from scipy.linalg import solve_sylvester

    if not len(A):
        return [], [np.empty((0, 0))]
    balanced, scale = balance(A)
    zero, others, chains, _ = deflate(balanced)
    projector, inverse = np.zeros_like(balanced), np.zeros_like(balanced)
    rest = others.T @ balanced @ others
    at_zero = zero.T @ balanced @ zero
    # the staircase leaves a coupling of the motions at 0 with the others, of which this frees them
    freed = others + (zero @ solve_sylvester(at_zero, -rest, -zero.T @ balanced @ others) if chains and len(rest) else 0.0)
    if len(rest):
        inverse = freed @ np.linalg.solve(rest, others.T)
    if chains:
        projector = np.eye(len(A)) - freed @ others.T
    units = scale[:, None] / scale
    poles, regular, power = [], [-inverse * units], inverse
    for _ in chains:
        poles.append(projector * units)
        projector, power = balanced @ projector, inverse @ power
        regular.append(-power * units)
    return poles, regular
