"""Forward-mode differentiation of a program with respect to states, inputs and added terms."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import derivative_of
from gearlib.errors import SolverError
from gearlib.program.factored import Factored
from gearlib.program.interpret import Prepared, assemble, batch_values
from gearlib.program.program import Batch, Linear, Newton, Program

Floats = NDArray[np.float64]
Added = tuple[int, int, float]  # slot, which of the added seeds, weight
Integers = NDArray[np.int64]
Parts = list[tuple[Integers, Integers, Floats]]
SINGULAR = 1e13  # condition number beyond which equations depend on each other
MOST_DENSE = 4_000_000  # entries of a full matrix of slots by seeds


def sensitivity(
    prepared: Prepared, t: float, slots: Floats, relations: Floats, seeds: Sequence[int], added: Sequence[Added] = ()
) -> Any:
    """Derivatives of all slots.

    Parameters
    ----------
    t : float
    slots : array, shape (slots,)
        Values at which to differentiate.
    relations : array, shape (relations,)
    seeds : sequence of int
        Slots of states and inputs to differentiate with respect to.
    added : sequence of (slot, seed, weight)
        Slots of unknowns, each thought to have a multiple of a new seed added to what it is computed from.

    Returns
    -------
    array or scipy.sparse.csr_matrix, shape (slots, seeds + added seeds)
        Sparse where a full one would be large.

    Raises
    ------
    SolverError
        Equations that determine unknowns together are singular there.
    """
    program = prepared.program
    n_seeds = len(seeds) + max((seed + 1 for _, seed, _ in added), default=0)
    dense = program.n_slots * n_seeds <= MOST_DENSE
    now, here, flags = np.array([t]), slots[:, None], relations[:, None]
    places, columns_added, weights = (np.array(x) for x in zip(*added, strict=True)) if added else (np.empty(0, int),) * 3
    store = _Dense(program.n_slots, seeds, n_seeds) if dense else _Sparse(program.n_slots, seeds, n_seeds)
    solutions = iter(prepared.solutions)
    for step in program.steps:
        if isinstance(step, Batch):
            store.assign(step.targets, entries(step, now, here, prepared.parameters, flags))
        elif isinstance(step, Linear):
            store.combine(step.unknowns, next(solutions), step.known)
        else:
            n = len(step.unknowns)
            matrix = _matrix(step, prepared, now, here, flags)
            inside = {int(u) for u in step.unknowns}
            parts = [
                (b.targets[r], c, v) for b in step.residuals for r, c, v in entries(b, now, here, prepared.parameters, flags)
            ]
            rows, columns, values = (np.concatenate(x) for x in zip(*parts, strict=True))
            outside = np.array([c not in inside for c in columns.tolist()], bool)
            known = np.unique(columns[outside])
            gradient = np.zeros((n, len(known)))
            np.add.at(gradient, (rows[outside], np.searchsorted(known, columns[outside])), values[outside])
            try:
                solved = -solve_shared(matrix, gradient)
            except np.linalg.LinAlgError:
                raise SolverError(
                    f"there is no linear model at this point: {n} {'equation that is' if n == 1 else 'equations that are'} solved by "
                    "iteration cannot be solved for small changes there; give inertia to what nothing moves, or another point (at=...)"
                ) from None
            store.combine(step.unknowns, solved, known)
        if added:
            now_made = np.isin(places, step.targets if isinstance(step, Batch) else step.unknowns)
            if now_made.any():
                store.add(places[now_made], len(seeds) + columns_added[now_made], weights[now_made])
    return store.result()


def undetermined(prepared: Prepared, t: float, slots: Floats, relations: Floats) -> Floats:
    """Directions of all slots along the null spaces of singular iterated blocks, shape (slots, directions)."""
    now, here, flags = np.array([t]), slots[:, None], relations[:, None]
    added: list[Added] = []
    count = 0
    for step in (s for s in prepared.program.steps if isinstance(s, Newton)):
        for direction in _null_space(_matrix(step, prepared, now, here, flags)).T:
            added += [(int(u), count, float(x)) for u, x in zip(step.unknowns, direction, strict=True)]
            count += 1
    if not count:
        return np.zeros((len(slots), 0))
    found = sensitivity(prepared, t, slots, relations, (), added)
    return np.asarray(found.toarray() if hasattr(found, "toarray") else found, float)


def _matrix(step: Newton, prepared: Prepared, now: Floats, here: Floats, flags: Floats) -> Floats:
    n = len(step.unknowns)
    return assemble(step.jacobian, now, here, prepared.parameters, flags, n * n)[:, 0].reshape(n, n)


def _null_space(matrix: Floats) -> Floats:
    """Null space of a square matrix after row and column scaling."""
    row = np.abs(matrix).max(axis=1)
    scaled = matrix / np.where(row > 0.0, row, 1.0)[:, None]
    column = np.abs(scaled).max(axis=0)
    column[column == 0.0] = 1.0
    scaled = scaled / column
    with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError):
        if np.abs(np.linalg.inv(scaled)).sum(axis=1).max() * np.abs(scaled).sum(axis=1).max() < SINGULAR:
            return np.zeros((len(matrix), 0))
    _, sizes, right = np.linalg.svd(scaled)
    return np.asarray(right[sizes * SINGULAR <= max(sizes.max(initial=0.0), 1e-300)].T / column[:, None], float)


def solve_shared(matrix: Floats, right: Floats) -> Floats:
    """Solve linear equations, minimum norm where singular: stuck elements in parallel share their torque in any way.

    Raises
    ------
    LinAlgError
        There is no solution.
    """
    row = 1 / np.maximum(np.abs(matrix).max(axis=1), 1e-300)
    column = 1 / np.maximum((np.abs(matrix) * row[:, None]).max(axis=0), 1e-300)
    scaled, right = matrix * row[:, None] * column, right * row[:, None]
    try:
        inverse = np.linalg.inv(scaled)
        if np.abs(inverse).sum(axis=1).max(initial=0.0) * np.abs(scaled).sum(axis=1).max(initial=0.0) < SINGULAR:
            return np.asarray(column[:, None] * (inverse @ right), float)
    except np.linalg.LinAlgError:
        pass
    found = np.linalg.lstsq(scaled, right, rcond=1 / SINGULAR)[0]
    if np.abs(scaled @ found - right).max(initial=0.0) > 1e-9 * np.abs(right).max(initial=0.0):
        raise np.linalg.LinAlgError
    return np.asarray(column[:, None] * found, float)


def entries(
    batch: Batch, t: Floats, slots: Floats, parameters: Floats, relations: Floats
) -> list[tuple[Integers, Integers, Floats]]:
    """For each argument: rows of the batch, the argument's slots, derivatives; zeros left out."""
    found = []
    for a, c in enumerate(batch.kernel.columns):
        kernel = derivative_of(batch.kernel, c)
        if kernel.is_zero:
            continue
        part = Batch(
            kernel, batch.equations, batch.targets, batch.signs,
            batch.arguments[:, [batch.kernel.columns.index(i) for i in kernel.columns]],
            batch.argument_signs[:, [batch.kernel.columns.index(i) for i in kernel.columns]],
            batch.parameters[:, [batch.kernel.parameters.index(i) for i in kernel.parameters]],
            batch.relations[:, [batch.kernel.relations.index(i) for i in kernel.relations]],
        )  # fmt: skip
        value = batch_values(part, t, slots, parameters, relations)
        value = np.broadcast_to(value, (len(batch), 1))[:, 0] * batch.argument_signs[:, a]
        nonzero = np.flatnonzero(batch.argument_signs[:, a])
        found.append((nonzero, batch.arguments[nonzero, a], value[nonzero]))
    return found


class _Dense:
    def __init__(self, n_slots: int, seeds: Sequence[int], n_seeds: int) -> None:
        self.d = np.zeros((n_slots, n_seeds))
        self.d[list(seeds), np.arange(len(seeds))] = 1.0

    def assign(self, targets: Integers, parts: Parts) -> None:
        block = np.zeros((len(targets), self.d.shape[1]))
        for rows, columns, values in parts:  # each row once
            block[rows] += values[:, None] * self.d[columns]
        self.d[targets] = block

    def combine(self, targets: Integers, matrix: Floats | Factored, columns: Integers) -> None:
        self.d[targets] = matrix @ self.d[columns]

    def add(self, slots: Integers, seeds: Integers, weights: Floats) -> None:
        np.add.at(self.d, (slots, seeds), weights)

    def result(self) -> Floats:
        return self.d


class _Sparse:
    """Sparse derivative rows, collected in blocks and merged at the end of each step."""

    def __init__(self, n_slots: int, seeds: Sequence[int], n_seeds: int) -> None:
        import scipy.sparse as sparse

        self.sparse = sparse
        self.shape = (n_slots, n_seeds)
        ones = np.ones(len(seeds))
        self.d = sparse.csr_matrix((ones, (list(seeds), np.arange(len(seeds)))), shape=self.shape)

    def assign(self, targets: Integers, parts: Parts) -> None:
        if parts:
            rows, columns, values = (np.concatenate(x) for x in zip(*parts, strict=True))
            picked = self.sparse.csr_matrix((values, (targets[rows], columns)), shape=(self.shape[0], self.shape[0]))
            self.d = (self.d + picked @ self.d).tocsr()

    def combine(self, targets: Integers, matrix: Floats | Factored, columns: Integers) -> None:
        known = self.d[columns]
        if isinstance(matrix, Factored):
            block = self.sparse.csr_matrix(matrix @ known.toarray())
        else:
            block = self.sparse.csr_matrix(matrix) @ known
        place = self.sparse.csr_matrix(
            (np.ones(len(targets)), (targets, np.arange(len(targets)))), shape=(self.shape[0], len(targets))
        )
        self.d = (self.d + place @ block).tocsr()

    def add(self, slots: Integers, seeds: Integers, weights: Floats) -> None:
        self.d = (self.d + self.sparse.csr_matrix((weights, (slots, seeds)), shape=self.shape)).tocsr()

    def result(self) -> Any:
        return self.d


def affine_seeds(program: Program) -> list[tuple[Batch, int]]:
    """Affine parts of a linear program: rows of batches that do not vanish with all their arguments."""
    found = []
    for step in program.steps:
        if isinstance(step, Batch):
            rest = rest_expression(step)
            if rest != 0:
                found += [(step, i) for i in range(len(step))]
    return found


def rest_expression(batch: Batch) -> Any:
    """The batch's kernel with all its arguments set to zero."""
    import sympy

    zero = {sympy.Symbol(f"x{c}", real=True): sympy.S.Zero for c in batch.kernel.columns}
    return batch.kernel.expression.xreplace(zero)
