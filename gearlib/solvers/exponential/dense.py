"""exp(A h) - I of a dense matrix by Taylor series and repeated doubling, stored as the deviation from the identity.

Squaring exp(A h) itself rounds every entry relative to the identity: the slow motion of a stiff system is lost. Its deviation from the
identity, E(2 h) = 2 E(h) + E(h) E(h), is rounded relative to the motion. The error then grows with the angle that the motion has turned
through, not with the number of steps or doublings, and there is no overscaling.

A matrix with its derivatives in some directions is a stack (1 + directions, n, n): products of stacks obey the product rule, and every
polynomial comes with its derivatives. That is the exponential of the block matrix [[A, 0], [dA, A]] without its zeros.

References
----------
Zhong and Williams, A precise time step integration method, Proc. IMechE C 208 (1994) 427-430,
doi:10.1243/PIME_PROC_1994_208_148_02. Paterson and Stockmeyer, SIAM J. Comput. 2 (1973) 60-66, doi:10.1137/0202007.
Najfeld and Havel, Derivatives of the matrix exponential and their computation, Adv. Appl. Math. 16 (1995) 321-375,
doi:10.1006/aama.1995.1017.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

REACH = 0.7  # bound on |A h| for which 16 Taylor terms reach rounding
# exp(X) - I = C_0 + X^4 (C_1 + X^4 (C_2 + X^4 C_3)), C_j = sum of X^i / (4 j + i)! for i = 1..4
_TAYLOR = np.array([[1.0 / math.factorial(4 * j + i) for i in range(1, 5)] for j in range(4)])
_FLUSH = 64  # number of states above which it pays to look for subnormal numbers
_LARGEST_BLOCK = 12  # doublings: blocks of at most 4096 steps are advanced at a time


def deviation(A: Floats, h: float) -> Floats:
    """exp(A h) - I.

    Parameters
    ----------
    A : ndarray
        Square matrix (1/s), or a stack of one and its derivatives.
    h : float
        Step (s).

    Returns
    -------
    ndarray
        Of the shape of A; each entry is accurate relative to itself where nothing cancels.

    Examples
    --------
    >>> deviation(np.array([[0.0, 1.0], [0.0, -1e-20]]), 2.0)
    array([[ 0.e+00,  2.e+00],
           [ 0.e+00, -2.e-20]])

    With the derivative by the rate of a decay:

    >>> deviation(np.array([[[-1.0]], [[-1.0]]]), math.log(2.0)).ravel().round(6)
    array([-0.5     , -0.346574])
    """
    size = balanced_norm(A if A.ndim == 2 else A[0]) * abs(h)
    doublings = max(0, math.ceil(math.log2(max(size, 1e-300) / REACH)))
    powers = np.empty((4, *A.shape))
    np.multiply(A, math.ldexp(h, -doublings), out=powers[0])
    powers[1] = product(powers[0], powers[0])
    powers[2] = product(powers[0], powers[1])
    powers[3] = product(powers[1], powers[1])
    _flush(powers)
    c = _TAYLOR.dot(powers.reshape(4, A.size)).reshape(powers.shape)
    X4 = powers[3]
    E: Floats = c[0] + product(X4, c[1] + product(X4, c[2] + product(X4, c[3])))
    for _ in range(doublings):
        E = double(E)
    return E


def product(X: Floats, Y: Floats) -> Floats:
    """Product of two matrices, or of two matrices with derivatives: (X Y)' = X' Y + X Y'."""
    if X.ndim == 2:
        return np.asarray(np.dot(X, Y))  # takes half the time of matmul for small matrices
    out: Floats = X[0] @ Y
    out[1:] += X[1:] @ Y[0]
    return out


def taylor(X: Floats) -> Floats:
    """exp(X) - I of a stack of matrices with a norm of at most `REACH`."""
    X2 = X @ X
    powers = np.stack([X, X2, X @ X2, X2 @ X2])
    c = np.tensordot(_TAYLOR, powers, 1)
    X4 = powers[3]
    E: Floats = c[0] + X4 @ (c[1] + X4 @ (c[2] + X4 @ c[3]))
    return E


def double(E: Floats) -> Floats:
    """exp(2 A h) - I from exp(A h) - I."""
    square = product(E, E)
    square += E
    square += E
    return _flush(square)


def _flush(M: Floats) -> Floats:
    """Flush subnormal numbers to zero: far from the diagonal of a long chain entries underflow, and such products are slow."""
    if M.shape[-1] >= _FLUSH:
        M[np.abs(M) < 1e-150] = 0.0
    return M


def balanced_norm(A: Floats) -> float:
    """Norm of A after the best diagonal scaling by powers of two; the scaling changes no rounding and need not be applied."""
    from scipy.linalg.lapack import dgebal

    size = np.abs(dgebal(A, scale=1, permute=0)[0])
    return float(min(size.sum(axis=0).max(), size.sum(axis=1).max()))


def doublings_for(count: int, n: int) -> int:
    """Number of doublings for ``count`` steps: blocks of 2**k steps cost one product, k doublings cost k."""
    product = _product_seconds(n)
    best = min(range(_LARGEST_BLOCK + 1), key=lambda k: k * product + -(-count // 2**k) * 4e-6 if 2**k <= count else math.inf)
    return best


def _product_seconds(n: int) -> float:
    return 3e-6 + 2.0 * n**3 / 4e10


def estimate(n: int, angles: list[float], count: int) -> float:
    """Estimated time (s) of ``count`` steps of as many different lengths as there are ``angles`` = |A| h."""
    products = sum(6.0 + max(0.0, math.log2(max(angle, 1e-300) / REACH)) for angle in angles)
    return products * _product_seconds(n) + count * (2e-6 + 8e-10 * n * n)


class Propagator:
    """Propagator of one step length: the deviations E(h), E(2 h), E(4 h), ..., computed lazily.

    With a stack of a matrix and its derivatives, states are stacks (1 + directions, n) of a state and its derivatives.

    Examples
    --------
    >>> Propagator(np.array([[-1.0]]), math.log(2.0)).advance(np.array([8.0]), 3)
    array([[4.],
           [2.],
           [1.]])
    """

    def __init__(self, A: Floats, h: float) -> None:
        self._chain = [deviation(A, h)]
        self._tops: dict[int, int] = {}  # longest doubling so far, keyed by the number of steps

    def advance(self, z: Floats, count: int) -> Floats:
        """The ``count`` states (count, n) that follow ``z``."""
        if (top := self._tops.get(count, -1)) < 0:
            top = self._tops[count] = doublings_for(count, z.shape[-1])
        while len(self._chain) <= top:
            self._chain.append(double(self._chain[-1]))
        out = np.empty((count + 1, *z.shape))
        out[0] = z
        filled, k = 1, 0
        while filled <= count:
            k = min(k, top)
            block = out[filled - 2**k : filled][: count + 1 - filled]
            ahead = out[filled : filled + len(block)]
            if z.ndim == 1:
                np.dot(block, self._chain[k].T, out=ahead)
            else:
                own, changes = self._chain[k][0], self._chain[k][1:]
                np.dot(block.reshape(-1, z.shape[1]), own.T, out=ahead.reshape(-1, z.shape[1]))
                ahead[:, 1:] += np.dot(block[:, 0], changes.reshape(-1, z.shape[1]).T).reshape(len(block), len(changes), -1)
            ahead += block
            filled += len(block)
            k += 1
        return out[1:]
