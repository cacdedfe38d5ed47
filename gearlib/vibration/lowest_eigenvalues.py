"""Lowest eigenvalues of a large sparse matrix: block Krylov iteration, with an independent count against missed ones.

The search applies ``(A - s)^-1 (A - s)^-1 A`` with a real shift s, whose eigenvalues ``x / (x - s)^2`` are 0 for poles at 0 and decay
like 1/x beyond s; where that misses some, ``A (A^2 + w^2)^-1``, which is largest near the frequency w. It starts from several vectors
at once, so that repeated eigenvalues are found with their multiplicity. The result is accepted only if a disc contains exactly the
eigenvalues found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.linear.balancing import similarity
from gearlib.vibration.eigenvalue_count import missing_inside

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
BLOCK = 6  # vectors per block: repeated eigenvalues up to that multiplicity, as of equal planets, are found together
EXACT = 1e-10  # residual of an eigenpair relative to the eigenvalue, in scaled states
ROUNDING = 100 * np.finfo(float).eps  # the same relative to the highest frequency
NOTHING = 1e-11  # relative to the highest frequency: a smaller eigenvalue counts as 0
# Imaginary part relative to the magnitude below which an eigenvalue is real: rounding splits a double one, such as that of critical
# damping, by the square root of the unit roundoff, a triple one by its cube root.
REAL = 1e-5
FULL = 800  # states up to which the dense matrix takes no longer than a second search
WINDOWS = 25  # frequencies to search near, at most
SWEEP = (0.08, 0.17, 0.27, 0.38, 0.49, 0.6, 0.7, 0.8, 0.9, 1.0)  # frequencies to search about, as fractions of a radius
SWEEP_SIZE = 180  # dimension of each of these searches


@dataclass(frozen=True, eq=False)
class Lowest:
    """All nonzero eigenvalues with magnitudes up to a radius, sorted by magnitude, and their vectors (states, eigenvalues)."""

    values: Complexes
    vectors: Complexes


def lowest(A: Any, count: int, at_zero: int) -> Lowest | None:
    """All eigenvalues up to at least the ``count``-th with a positive imaginary part; None if completeness cannot be verified.

    Parameters
    ----------
    A : sparse matrix
    count : int
    at_zero : int
        Number of eigenvalues that are 0.

    Examples
    --------
    >>> import scipy.sparse as sparse
    >>> pairs = [sparse.coo_array([[0.0, w], [-w, 0.0]]) for w in range(1, 200)]
    >>> found = lowest(sparse.csc_matrix(sparse.block_diag(pairs)), 3, 0)
    >>> found.values[found.values.imag > 0].imag.round(9).tolist()[:3]
    [1.0, 2.0, 3.0]
    """
    import scipy.sparse as sparse

    scale = similarity(A)
    S = sparse.csc_matrix(sparse.diags(1 / scale) @ A @ sparse.diags(scale))
    size = float(abs(S).sum(axis=1).max())  # bound on the eigenvalues
    known, radius, missing = _first(S, size, count, at_zero)
    if missing != 0:
        radius = radius or _enough(S, size, count, known, at_zero)
        if S.shape[0] <= FULL or not radius:
            return None
        known = _swept(S, size, radius, known)
        missing = missing_inside(S, radius, known.values, at_zero)
    idle = 0
    for _ in range(WINDOWS):
        inside = np.flatnonzero(np.abs(known.values) < radius)
        if missing == 0 and (known.values[inside].imag > REAL * np.abs(known.values[inside])).sum() >= count:
            inside = inside[np.argsort(np.abs(known.values[inside]), kind="stable")]
            return Lowest(known.values[inside], scale[:, None] * known.vectors[:, inside])
        if not missing:  # real eigenvalues take places, or the edge of the disc cuts through an eigenvalue
            radius *= 1.5 if missing == 0 else 1.003
        else:
            window = _where_missing(S, size, radius, known, at_zero, missing)
            if window is None or idle > 1 or radius > size:
                return None
            space = _Space(S, 1j * np.sqrt(window[0] * window[1]))
            space.grow(min(4 * window[2] + 60 + 60 * idle, S.shape[0] // 2))
            before = len(known.values)
            known = joined(known, *space.pairs())
            idle = 0 if len(known.values) > before else idle + 1
        missing = missing_inside(S, radius, known.values, at_zero)
    return None


def _first(S: Any, size: float, count: int, at_zero: int) -> tuple[Lowest, float, int | None]:
    """Converged eigenpairs, the radius up to which they were counted (0: too few) and the number missing (None: unknown)."""
    space = _Space(S, size / S.shape[0])
    wanted = 2 * count + 8
    most = min(S.shape[0] // 2, 6 * wanted + 40)
    dimension, missing, radius = min(2 * wanted + 40, most), None, 0.0
    slow: Lowest | None = None
    while True:
        space.grow(dimension)
        known = Lowest(*space.pairs())
        if slow is not None:
            known = joined(known, slow.values, slow.vectors)
        radius = _radius(known.values, count)
        if radius:
            missing = missing_inside(S, radius, known.values, at_zero)
            if missing and slow is None:  # motions far slower than the others, such as a load that brakes the whole train
                slow = _slower(S, size, float(np.abs(known.values).min()))
                known = joined(known, slow.values, slow.vectors)
                missing = missing_inside(S, radius, known.values, at_zero)
            if missing == 0:
                break
            space.refresh()
        if dimension >= most:
            break
        dimension = min(int(1.3 * dimension) + 10, most)
    return known, radius, missing


def _swept(S: Any, size: float, radius: float, known: Lowest) -> Lowest:
    """Searches about frequencies spread over a disc: cheap compared with a count."""
    slowest = radius
    for part in SWEEP:
        space = _Space(S, 1j * part * radius)
        space.grow(min(SWEEP_SIZE, S.shape[0] // 2))
        known = joined(known, *space.pairs())
        slowest = min(slowest, float(np.abs(known.values).min(initial=slowest)))
    slow = _slower(S, size, slowest)
    return joined(known, slow.values, slow.vectors)


def _slower(S: Any, size: float, slowest: float) -> Lowest:
    """Eigenpairs converged in small searches about ever slower rates."""
    found = Lowest(np.empty(0, complex), np.empty((S.shape[0], 0), complex))
    for rate in (slowest / 4, slowest / 30, slowest / 1e3, slowest / 3e4):
        if rate > NOTHING * size:
            space = _Space(S, rate)
            space.grow(48)
            found = joined(found, *space.pairs())
    return found


def _radius(values: Complexes, count: int) -> float:
    """A radius in the widest gap beyond the ``count``-th oscillating mode; 0 if there is none."""
    sizes = np.sort(np.abs(values))
    ringing = np.sort(np.abs(values[values.imag > REAL * np.abs(values)]))
    if len(ringing) < count:
        return 0.0
    beyond = sizes[sizes >= ringing[count - 1]]
    gaps = beyond[1:] / beyond[:-1]
    if not len(gaps) or gaps.max() < 1 + 1e-6:
        return 0.0
    k = int(np.argmax(gaps))
    return float(np.sqrt(beyond[k] * beyond[k + 1]))


def _enough(S: Any, size: float, count: int, known: Lowest, at_zero: int) -> float:
    """A radius that contains the required number of eigenvalues, but not many more; 0 if there is none."""
    low, high, radius = 0.0, size, size / S.shape[0]
    for _ in range(40):
        missing = missing_inside(S, radius, known.values, at_zero)
        if missing is None:
            radius *= 1.01
            continue
        inside = missing + int((np.abs(known.values) < radius).sum())
        if 2 * count <= inside <= 3 * count + 8 or (low and high < 1.05 * low):
            return radius if inside >= 2 * count else high
        low, high = (radius, high) if inside < 2 * count else (low, radius)
        radius = min(4 * radius, np.sqrt(low * high)) if low else radius / 4
        if low > 0.9 * size:
            break
    return 0.0


def _where_missing(
    S: Any, size: float, radius: float, known: Lowest, at_zero: int, total: int
) -> tuple[float, float, int] | None:
    """A narrow ring (inner and outer radius, number) with missing eigenvalues; None where they are at 0."""
    low, high, below = 0.0, radius, 0
    if total < 0:
        return None
    for _ in range(40):
        if low and high < 1.15 * low:
            break
        middle = np.sqrt(low * high) if low else high / 8
        if middle < NOTHING * size:
            return None
        found = missing_inside(S, middle, known.values, at_zero)
        if found is None:
            break
        if (found > 0 and not low) or found - below > total - found:
            high, total = middle, found
        else:
            low, below = middle, found
    return low or high / 8, high, total - below


def joined(known: Lowest, values: Complexes, vectors: Complexes) -> Lowest:
    """Known and new eigenpairs; of those with one eigenvalue (to 1e-6), only those with independent vectors."""
    new: list[int] = []
    for k, value in enumerate(values):
        near = np.flatnonzero(np.abs(known.values - value) < 1e-6 * abs(value))
        rest = vectors[:, k]
        if len(near):  # beyond what is known, the new ones may be alike
            added = [j for j in new if abs(values[j] - value) < 1e-6 * abs(value)]
            basis = np.linalg.qr(np.hstack([known.vectors[:, near], vectors[:, added]]))[0]
            rest = rest - basis @ (basis.conj().T @ rest)
        if np.linalg.norm(rest) > 1e-3:
            new.append(k)
    return Lowest(np.concatenate([known.values, values[new]]), np.hstack([known.vectors, vectors[:, new]]))


class _Space:
    """Block Krylov space of the mapped matrix, with full orthogonalisation and without restarts."""

    def __init__(self, S: Any, shift: complex) -> None:
        import scipy.sparse as sparse
        from scipy.sparse.linalg import splu

        self.S, self._size, self._swings = S, float(abs(S).sum(axis=1).max()), bool(np.imag(shift))
        eye = sparse.identity(S.shape[0], format="csc")
        try:
            self._solve = splu((S - shift * eye).tocsc()).solve
        except RuntimeError:  # the shift is an eigenvalue
            self._solve = splu((S - 0.97 * shift * eye).tocsc()).solve
        self._random = np.random.default_rng(0)
        self._basis = np.empty((S.shape[0], 0))
        self._mapped = np.empty((S.shape[0], 0))
        self.refresh()

    def refresh(self) -> None:
        """Add new random vectors, to reach components missing from the first ones."""
        self._next = self._map(self._random.normal(size=(self.S.shape[0], BLOCK)))

    def _map(self, x: Floats) -> Floats:
        result: Floats = self._solve(x.astype(complex)).real if self._swings else self._solve(self._solve(self.S @ x))
        return result

    def grow(self, dimension: int) -> None:
        """Add blocks up to a dimension, or until the space is invariant."""
        while self._basis.shape[1] < dimension:
            block = self._next / np.maximum(np.linalg.norm(self._next, axis=0), 1e-300)
            for _ in range(2):
                block = block - self._basis @ (self._basis.T @ block)
            q, triangle = np.linalg.qr(block)
            fresh = np.abs(np.diag(triangle)) > 1e-13
            if not fresh.all():  # invariant with respect to this block
                q = np.linalg.qr(np.hstack([q[:, fresh], self._random.normal(size=(len(q), BLOCK - fresh.sum()))]))[0]
                q = np.linalg.qr(q - self._basis @ (self._basis.T @ q))[0]
            mapped = self._map(q)
            self._basis, self._mapped = np.hstack([self._basis, q]), np.hstack([self._mapped, mapped])
            self._next = mapped

    def pairs(self) -> tuple[Complexes, Complexes]:
        """Converged eigenpairs except those at 0."""
        images, inner = np.linalg.eig(self._basis.T @ self._mapped)
        order = np.argsort(-np.abs(images), kind="stable")
        vectors = self._mapped @ inner[:, order].astype(complex)
        vectors /= np.maximum(np.linalg.norm(vectors, axis=0), 1e-300)
        product = self.S @ vectors
        values = (vectors.conj() * product).sum(axis=0)
        residual = np.linalg.norm(product - vectors * values, axis=0)
        good = (residual <= EXACT * np.abs(values) + ROUNDING * self._size) & (np.abs(values) > NOTHING * self._size)
        return values[good], vectors[:, good]
