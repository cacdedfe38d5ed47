"""Elimination of held states from linear models: states fixed by a locked element, such as the slip of a locked clutch.

A locked friction element imposes ``der(v) = 0``, and its torque takes whatever value maintains that. The slip v is a state whether it
slides or sticks, and would add a pole at 0 to the linear model that is not a motion: while it sticks, nothing can move it. Where
``v = c x`` with ``c A = 0`` and ``c B = 0``, the subspace ``c x = 0`` is invariant, and the model restricted to it is that of the train
with the element replaced by a rigid connection. The same holds for combinations of positions whose rate is a held speed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.linear.balancing import balance, similarity
from gearlib.linear.linear_model import full
from gearlib.program.held_speeds import held_speeds
from gearlib.program.interpret import Prepared
from gearlib.reduce.reduction import Structure, integrals
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
CONSTANT = 1e-9  # relative to its terms: a smaller rate is zero
ROUNDED = 1e-13  # relative to the largest entry of a balanced matrix
COMPLIANT = 1e-12  # rad/s2 per rad/s or rad: with less, the compliances of what holds a speed move it
RANK = 1e-11  # of rows scaled to 1


@dataclass(frozen=True, eq=False)
class Remaining:
    """Remaining states of a linear model: ``x = basis @ x[keep]``."""

    keep: Integers
    basis: Any  # (states, kept states), sparse where A is


def remaining(
    structure: Structure, prepared: Prepared, t: float, slots: Floats, discrete: Floats, A: Any, B: Any = None
) -> Remaining | None:
    """The states remaining after elimination of those held by the discrete state at a point; None if none is held.

    Parameters
    ----------
    structure : Structure
    prepared : Prepared
        The program that computes the rates of the states.
    t : float
    slots, discrete : arrays
        Values of the program's slots, and discrete state, at the point.
    A, B : arrays or sparse matrices
        Derivatives of the rates with respect to the states and the inputs.
    """
    held = held_speeds(structure, prepared, t, slots, discrete)
    if not len(held):
        return None
    n = A.shape[0]
    A = A.tocsr() if hasattr(A, "tocsr") else np.asarray(A)
    rates = A if B is None else _beside(A, B)
    while True:  # what remains where all of them are zero must keep them zero; without one of them, more remains
        pivots, reduced = _echelon(held)
        keep, basis = _basis(n, pivots, reduced, A)
        more = _held_positions(structure, prepared.program.states, A, rates, basis)
        if len(more):
            pivots, reduced = _echelon(np.vstack([reduced, more]))
            keep, basis = _basis(n, pivots, reduced, A)
        vanishing = _vanishing(held, A, basis)
        if vanishing.all():
            return Remaining(keep, basis)
        held = held[vanishing]
        if not len(held):
            return None


def _beside(A: Any, B: Any) -> Any:
    if hasattr(A, "tocsr"):
        import scipy.sparse as sparse

        return sparse.hstack([A, B]).tocsr()
    return np.hstack([A, np.asarray(B)])


def _vanishing(rows: Floats, A: Any, basis: Any) -> NDArray[np.bool_]:
    """Which combinations of rates are identically zero: a state's own rate by its equation; others may vanish at one point only.

    What depends on no state there depends on no input: the equation ``der(v) = 0`` has none. The compliances of the elements make it
    depend a little on what is held besides, that is, not on the remaining states. A column in which everything is rounding, as that of
    the slip of what is locked on both sides, is judged by the largest entry of the matrix, in units in which each state acts upon the
    others as they act upon it.
    """
    scale = similarity(A) if hasattr(A, "tocsr") else balance(A)[1]
    size = abs(A)
    largest = full(size.max(axis=0)).ravel() if A.shape[0] else np.empty(0)
    natural = float((size.T @ (1 / scale) * scale).max(initial=0.0)) * np.abs(rows * scale).max(axis=1)
    rates = (A.T @ rows.T).T
    yielding = np.abs(rates) <= COMPLIANT * np.abs(rows).max(axis=1)[:, None]
    least = np.maximum(CONSTANT * largest * np.abs(rows).sum(axis=1)[:, None], ROUNDED * natural[:, None] / scale)
    constant = (np.abs(rates) <= least).all(axis=1)
    constant |= yielding.all(axis=1) & (np.abs(rates @ basis) <= (least @ abs(basis))).all(axis=1)
    result: NDArray[np.bool_] = ((rows != 0).sum(axis=1) == 1) | constant
    return result


def _echelon(rows: Floats) -> tuple[list[int], Floats]:
    """Row echelon form: each independent row has 1 at its pivot, where all others have 0; single states are preferred as pivots."""
    rows = rows / np.abs(rows).max(axis=1, keepdims=True)
    rows = rows[np.argsort((np.abs(rows) > RANK).sum(axis=1), kind="stable")]
    pivots: dict[int, int] = {}
    for i in range(len(rows)):
        size = np.abs(rows[i])
        if size.max() <= RANK:
            continue  # dependent on the others
        p = pivots[i] = int(np.argmax(size))
        rows[i] /= rows[i, p]
        others = np.arange(len(rows)) != i
        rows[others] -= np.outer(rows[others, p], rows[i])
        rows[np.abs(rows) <= RANK] = 0.0
    return list(pivots.values()), rows[list(pivots)]


def _basis(n: int, pivots: list[int], rows: Floats, A: Any) -> tuple[Integers, Any]:
    """Indices of the kept states, and the matrix that maps them to all states."""
    keep = np.setdiff1d(np.arange(n), pivots)
    if hasattr(A, "tocsr"):
        import scipy.sparse as sparse

        free = sparse.csr_matrix((np.ones(len(keep)), (keep, np.arange(len(keep)))), shape=(n, len(keep)))
        place = sparse.csr_matrix((np.ones(len(pivots)), (pivots, np.arange(len(pivots)))), shape=(n, len(pivots)))
        return keep, (free - place @ sparse.csr_matrix(rows[:, keep])).tocsr()
    basis = np.eye(n)[:, keep]
    basis[pivots] = -rows[:, keep]
    return keep, basis


def _held_positions(structure: Structure, states: tuple[Node, ...], A: Any, rates: Any, basis: Any) -> Floats:
    """Combinations of positions whose rates are held speeds, as rows over the states.

    Positions are the integrals of declared speeds; frictional heat, for instance, is not one, and stays.
    """
    from scipy.linalg import svd

    known = integrals(structure.model)
    places = [i for i, (v, k) in enumerate(states) if k == 0 and (v in known or (v, 1) in states)]
    if not places:
        return np.empty((0, len(states)))
    before = rates[places]
    inside = A[places] @ basis
    extra = rates[places][:, A.shape[0] :]
    before, inside, extra = full(before), full(inside), full(extra)
    size = np.abs(before).max(axis=1, initial=0.0)
    chosen = np.flatnonzero(size > 0)
    if not len(chosen):
        return np.empty((0, len(states)))
    before, after = before[chosen] / size[chosen, None], np.hstack([inside, extra])[chosen] / size[chosen, None]
    left, sizes, _ = svd(after)
    rank = int((sizes > RANK).sum())
    null = left[:, rank:].T  # rates that vanish on the remaining states
    turn, sizes, _ = svd(null @ before, full_matrices=False)
    combined = turn[:, sizes > 1e-6].T @ null  # but did not before
    rows = np.zeros((len(combined), len(states)))
    rows[:, np.array(places)[chosen]] = combined / size[chosen]
    return rows
