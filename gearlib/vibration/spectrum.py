"""Eigenvalues and eigenvectors of the state matrix: all of a small one, the lowest of a large sparse one.

A train has poles at 0 for three reasons: it turns freely, a loop of meshes carries a constant preload, or nothing depends on a position
(the phase of a mesh, a position inside an open gap). They are distinguished by whether anything moves, and whether a force acts. Large
trains may have hundreds of them, so they are counted in advance, and the search avoids them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.linear.balancing import balance
from gearlib.linear.linear_model import full
from gearlib.linear.poles import Eigen, eigen
from gearlib.structure.sparse_elimination import factorise
from gearlib.vibration.lowest_eigenvalues import REAL, lowest

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
ACTING = 1e-9  # relative to the largest speed or force: smaller ones are rounding
STILL = 1e-13  # of a mode's largest amplitude, in scaled states: a smaller one is rounding
UNDAMPED = 1e-11  # of the fastest eigenvalue found of a large matrix: a smaller damping is rounding
MOST_FULL = 4000  # states up to which the dense matrix is used where the lowest eigenvalues cannot be verified


@dataclass(frozen=True)
class Spectrum:
    """Oscillating modes, free motions and decays.

    Attributes
    ----------
    values, vectors : complex arrays (modes,), (states, modes)
        Sorted by magnitude, with positive imaginary parts.
    free : array (states, free motions)
    preloads : int or None
    decays : array
        Real poles, slowest first.
    found : Eigen, optional
        All eigenvalues, as they were computed.
    """

    values: Complexes
    vectors: Complexes
    free: Complexes
    preloads: int | None
    decays: Floats
    found: Eigen | None = None


def dense_spectrum(A: Floats, speeds: Floats, count: int | None, forces: Floats | None = None) -> Spectrum:
    """All eigenvalues; ``speeds`` (variables, states) separates free motions from rest, ``forces`` preloads from positions."""
    n = len(A)
    if not n:
        return Spectrum(np.empty(0, complex), np.empty((0, 0), complex), np.empty((0, 0), complex), 0, np.empty(0))
    balanced, scale = balance(A)
    found = eigen(balanced)
    zero, others, values = found.zero, found.others, found.values
    inner, coupling = zero.T @ balanced @ zero, zero.T @ balanced @ others
    shapes = np.zeros((n, len(values)), complex)
    for k, value in enumerate(values):
        if value.imag <= 0:
            continue  # a decay, which has no shape here, or the conjugate
        w = found.vectors[:, k]
        at_zero = np.linalg.solve(inner - value * np.eye(len(inner)), -coupling @ w) if len(inner) else np.empty(0)
        shape = others @ w + zero @ at_zero
        shapes[:, k] = np.where(np.abs(shape) > STILL * np.abs(shape).max(), shape, 0.0)
    shapes *= scale[:, None]
    free = _free(zero * scale[:, None], speeds)
    # With zero rates; in a chain a motion consists of a position and a speed
    still = zero[:, : found.chains[0]] if found.chains else zero
    rates, acting = (np.asarray(rows) * scale for rows in (speeds, speeds if forces is None else forces))
    preloads = None if forces is None else _preloads(still, rates, acting)
    return replace(_ordered(values, shapes, free, preloads, count, found.tolerances), found=found)


def _preloads(still: Floats, speeds: Floats, forces: Floats) -> int:
    """Number of independent permanent directions with forces and no speeds."""

    def seen(rows: Floats) -> tuple[int, Floats]:
        """Rank of the rows on the directions, and the directions sorted so that the observable ones come first."""
        size = np.abs(rows).max(initial=0.0)
        if not size or not still.shape[1]:
            return 0, still
        _, sizes, turn = np.linalg.svd(rows @ still / size)
        return int((sizes > ACTING).sum()), still @ turn.T

    moving, still = seen(speeds)
    still = still[:, moving:]
    return seen(forces)[0]


def _free(zero: Floats, speeds: Any) -> Complexes:
    """Combinations of motions at 0 in which something turns."""
    if not zero.shape[1]:
        return np.empty((len(zero), 0), complex)
    moving = np.asarray(speeds @ zero)
    size = np.abs(moving).max(initial=0.0)
    if not size:
        return np.empty((len(zero), 0), complex)
    # Units of preload and speed differ by orders of magnitude; what counts is whether anything turns at all.
    per_column = np.abs(moving).max(axis=0)
    moving = np.where(per_column > 1e-9 * np.abs(zero).max(axis=0), moving, 0.0)
    _, sizes, rows = np.linalg.svd(moving / size, full_matrices=False)
    rank = int((sizes > 1e-9).sum())
    result: Complexes = (zero @ rows[:rank].conj().T).astype(complex)
    return result


def _ordered(
    values: Complexes, vectors: Complexes, free: Complexes, preloads: int | None, count: int | None, tolerances: Floats
) -> Spectrum:
    """Modes and decays apart; a damping within the ``tolerances`` of the eigenvalues is rounding of none."""
    size = np.maximum(np.abs(values), 1e-300)
    real = np.abs(values.imag) <= REAL * size
    decays = np.sort(values[real].real)[::-1]
    ringing = np.flatnonzero(~real & (values.imag > 0))
    ringing = ringing[np.argsort(np.abs(values[ringing]), kind="stable")][:count]
    chosen = values[ringing]
    chosen = np.where(np.abs(chosen.real) <= tolerances[ringing], 1j * chosen.imag, chosen)
    shapes = vectors[:, ringing]
    peak = np.abs(shapes).max(axis=0, initial=1e-300)
    return Spectrum(chosen, shapes / peak, free, preloads, decays)


def sparse_spectrum(A: Any, speeds: Any, count: int, chained: bool = True) -> Spectrum:
    """The lowest modes of a large matrix, and the decays that are not faster; ``chained`` if angles are states.

    Raises
    ------
    SolverError
        The lowest modes could not be verified, and the matrix is too large for a dense method.
    """
    import scipy.sparse as sparse

    A = sparse.csc_matrix(A)
    free, at_zero = _free_motions(A, speeds, chained)
    if at_zero == A.shape[0]:  # nothing is left to search for
        return Spectrum(np.empty(0, complex), np.empty((at_zero, 0), complex), free, None, np.empty(0))
    found = lowest(A, count, at_zero)
    if found is not None:
        rounding = np.full(len(found.values), UNDAMPED * np.abs(found.values).max(initial=0.0))
        return _ordered(found.values, found.vectors, free, None, count, rounding)
    if A.shape[0] > MOST_FULL:
        raise SolverError(
            f"the lowest {count} modes of {A.shape[0]} states could not be told from all others: decays without oscillation lie "
            f"between them, or there are fewer; ask for a smaller count, or for a part of the train ({MOST_FULL} states have all theirs)"
        )
    return dense_spectrum(full(A), full(speeds), count)


def _free_motions(A: Any, speeds: Any, chained: bool) -> tuple[Complexes, int]:
    """Free motions of a large matrix and its number of poles at 0; Jordan chains have length up to two if ``chained``."""
    import scipy.sparse as sparse

    n = A.shape[0]
    found = factorise(sparse.bmat([[A, -sparse.identity(n)], [None, A]]) if chained else A)  # x and A x, with A (A x) = 0
    scale, looks, most = found.column[:n], 8, found.matrix.shape[0] - found.rank
    while True:  # random motions at 0: once they are dependent, their rank is known
        zero = np.linalg.qr(found.directions(min(looks, most))[:n])[0]
        free = scale[:, None] * _free(zero, speeds @ sparse.diags(scale))
        if free.shape[1] < looks:
            return free, most
        looks *= 4


def without_preloads(A: Any, speeds: Any, free: Complexes) -> tuple[Complexes, bool]:
    """Free motions with the preloads mixed into them removed, and whether that was possible.

    A preload lies in states that no speed depends on: without them the remainder must still be a motion at 0, which changes nothing but
    positions.
    """
    alone = free * (np.asarray(abs(speeds).sum(axis=0)).ravel() > 0)[:, None]
    size = abs(A)
    largest = np.asarray(size.max(axis=1).toarray() if hasattr(size, "toarray") else size.max(axis=1, initial=0.0)).ravel()
    terms = size @ np.abs(alone) + 1e-6 * largest[:, None] * np.abs(alone).max(axis=0, initial=0.0)
    rates = np.asarray(A @ alone)
    rates = np.where(np.abs(rates) > 1e-6 * terms, rates, 0.0)
    possible = all(bool((np.abs(m @ rates) <= 1e-6 * (abs(m) @ np.abs(rates))).all()) for m in (A, speeds))
    return (alone if possible else free), possible
