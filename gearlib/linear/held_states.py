"""Elimination of held states from linear models: states fixed by a locked element, such as the slip of a locked clutch.

A locked friction element imposes ``der(v) = 0``, and its torque takes whatever value maintains that. The slip v is a state whether it
slides or sticks, and would add a pole at 0 to the linear model that is not a motion: while it sticks, nothing can move it. Where
``v = c x`` with ``c A = 0`` and ``c B = 0``, the subspace ``c x = 0`` is invariant, and the model restricted to it is that of the train
with the element replaced by a rigid connection. The same holds for combinations of positions whose rate is a held speed.

A held speed differs from one that merely stays constant (a coasting rotor has a true pole at 0) by a reaction: an unknown that occurs
in the equation in another discrete state, but not in this one, and that responds when the equation is perturbed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.program.build import build
from gearlib.program.derivatives import At, derivatives, newton_matrix, slopes
from gearlib.program.interpret import Prepared, evaluate, prepare
from gearlib.program.program import Newton
from gearlib.reduce.reduction import Structure, integrals
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
REACTION = 1e-13  # relative to the largest response in a block: smaller ones are rounding
# Relative to the largest coefficient of an equation: smaller ones are artificial compliances (`gearparts.rotational.friction.YIELD` is
# 1e-25), which determine reactions that would be undetermined otherwise.
YIELDS = 1e-20
CONSTANT = 1e-9  # relative to its terms: a smaller rate is zero
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
    speeds = _held_speeds(prepared, t, slots, discrete)
    if not speeds:
        return None
    n = A.shape[0]
    A = A.tocsr() if hasattr(A, "tocsr") else np.asarray(A)
    rates = A if B is None or not B.shape[1] else _beside(A, B)
    held = _functionals(structure, prepared, t, slots, discrete, speeds)
    held = held[[_vanishes(row, rates) for row in held]]
    if not len(held):
        return None
    pivots, reduced = _echelon(held)
    keep, basis = _basis(n, pivots, reduced, A)
    more = _held_positions(structure, prepared.program.states, A, rates, basis)
    if len(more):
        pivots, reduced = _echelon(np.vstack([reduced, more]))
        keep, basis = _basis(n, pivots, reduced, A)
    return Remaining(keep, basis)


def _beside(A: Any, B: Any) -> Any:
    if hasattr(A, "tocsr"):
        import scipy.sparse as sparse

        return sparse.hstack([A, B]).tocsr()
    return np.hstack([A, np.asarray(B)])


def _held_speeds(prepared: Prepared, t: float, slots: Floats, discrete: Floats) -> list[Node]:
    """Nodes v for which an equation imposes ``der(v) = 0`` in this discrete state, maintained by a reaction."""
    blocks = [s for s in prepared.program.steps if isinstance(s, Newton)]
    if not blocks:
        return []
    nodes = {slot: node for node, slot in prepared.program.slots.items() if node[1] > 0}
    found: list[Node] = []
    for step in blocks:
        changing = [b for b in step.residuals if b.relations.shape[1]]
        if changing:
            found += _held_in(step, changing, nodes, prepared, t, slots, discrete)
    return list(dict.fromkeys(found))


def _held_in(
    step: Newton, changing: list[Any], nodes: dict[int, Node], prepared: Prepared, t: float, slots: Floats, discrete: Floats
) -> list[Node]:
    at = At(prepared, np.array([t]), slots[:, None], discrete[:, None])
    place = {int(slot): i for i, slot in enumerate(step.unknowns)}
    found = []
    answers: Floats | None = None
    for batch in changing:
        terms: dict[int, dict[int, float]] = {}
        for rows, columns, values in slopes(batch, at):
            for r, c, value in zip(rows.tolist(), columns.tolist(), np.abs(values).tolist(), strict=True):
                terms.setdefault(r, {})[c] = value
        for r, sizes in terms.items():
            only = [c for c, size in sizes.items() if size > YIELDS * max(sizes.values())]
            (slot,) = only if len(only) == 1 else (-1,)
            if slot not in place or slot not in nodes:
                continue
            others = [place[c] for c in batch.arguments[r].tolist() if c in place and c != slot]
            answers = _answers(newton_matrix(step, at)[0]) if answers is None else answers
            answer = answers[:, batch.targets[r]]
            if others and (answer[others] > REACTION * answer.max()).any():
                v, k = nodes[slot]
                found.append((v, k - 1))
    return found


def _answers(matrix: Floats) -> Floats:
    """Response of each unknown of a block to a perturbation of each equation; elements in parallel share it."""
    try:
        answers: Floats = np.abs(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        answers = np.abs(np.linalg.pinv(matrix))
    return answers


def _functionals(
    structure: Structure, prepared: Prepared, t: float, slots: Floats, discrete: Floats, speeds: list[Node]
) -> Floats:
    """Rows c with ``v = c x``; a speed that needs states outside the program is omitted."""
    states = prepared.program.states
    place = {node: i for i, node in enumerate(states)}
    rows = [np.eye(len(states))[place[v]] for v in speeds if v in place]
    others = [v for v in speeds if v not in place]
    if others:
        program = build(structure, others, None, dynamic=False)
        if set(program.states) <= set(states):
            program = build(structure, others, states, dynamic=False)
            ready = prepare(program, structure, prepared.parameters)
            n = len(states)
            inputs = slots[n : n + len(program.inputs), None]
            values = evaluate(ready, np.array([t]), slots[:n, None], inputs, discrete[:, None])[:, 0]
            d = derivatives(ready, t, values, discrete, range(n), wanted=program.output_slots)
            rows += list(d.toarray() if hasattr(d, "toarray") else d)
    return np.array(rows).reshape(-1, len(states))


def _vanishes(row: Floats, rates: Any) -> bool:
    """Whether a combination of rates is identically zero: a state's own rate by its equation; others may vanish at one point only."""
    if (row != 0).sum() == 1:
        return True
    largest = abs(rates).max(axis=0)
    largest = np.asarray(largest.toarray() if hasattr(largest, "toarray") else largest).ravel()
    return bool((np.abs(rates.T @ row) <= CONSTANT * largest * np.abs(row).sum()).all())


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
    before, inside, extra = (m.toarray() if hasattr(m, "toarray") else np.asarray(m) for m in (before, inside, extra))
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
