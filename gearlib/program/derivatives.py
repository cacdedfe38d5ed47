"""Exact derivatives of a program's slots with respect to states, inputs, parameters and perturbations: plans evaluated with NumPy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.program.derivative_plan import DerivativePlan, Solved, Sums, derivative_plan
from gearlib.program.interpret import (
    COMPLIANCE,
    Prepared,
    assemble,
    batch_values,
    block_solve,
    compliances,
    constant_values,
    solve_regular,
)
from gearlib.program.program import Batch, Linear, Newton

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Added = tuple[int, int, float]  # slot, index of the added seed, weight
ROUNDING = 1e-13  # of a unit vector: a smaller entry of its null space is zero but for rounding, in any units
SINGULAR = 1e13  # condition number beyond which equations count as linearly dependent
MOST_DENSE = 4_000_000  # slots times seeds up to which a dense matrix is returned


@dataclass(frozen=True, eq=False)
class At:
    """Linearisation points: a program with its parameters, and the values of all slots at some times.

    Of a linear program the points may be runs in place of times: parameters then have the shape (parameters, runs), and solutions of
    blocks (runs, unknowns, known).

    Attributes
    ----------
    prepared : Prepared
    t : array, shape (times,)
    slots : array, shape (slots, times)
        As `gearlib.program.interpret.evaluate` returns them.
    relations : array, shape (relations, times)
    """

    prepared: Prepared
    t: Floats
    slots: Floats
    relations: Floats

    def values(self, batch: Batch) -> Floats:
        """Values of a batch, shape (rows, times)."""
        if batch.numbers is not None:
            found = batch.numbers[:, None]
        elif batch.of_parameters:
            found = constant_values(batch, self.prepared.parameters)
            found = found if found.ndim > 1 else found[:, None]
        else:
            found = batch_values(batch, self.t, self.slots, self.prepared.parameters, self.relations)
        shape = len(batch), len(self.t)
        return found if found.shape == shape else np.broadcast_to(found, shape)  # which takes longer than the comparison


def derivatives(
    prepared: Prepared, t: float, slots: Floats, relations: Floats, seeds: Sequence[int], added: Sequence[Added] = (),
    wanted: Iterable[int] | Integers | None = None,
) -> Any:  # fmt: skip
    """Derivatives of slots at one point.

    Parameters
    ----------
    prepared : Prepared
    t : float
    slots : array, shape (slots,)
        Values at which to differentiate.
    relations : array, shape (relations,)
    seeds : sequence of int
        Slots of states and inputs to differentiate with respect to; ``n_slots + p`` denotes entry p of the parameter table.
    added : sequence of (slot, seed, weight)
        Perturbations: each adds a multiple of a new seed to the value of a computed slot.
    wanted : iterable of int, optional
        Slots to differentiate, by default all.

    Returns
    -------
    array or scipy.sparse.csr_matrix, shape (wanted, seeds + added seeds)
        Sparse where a dense matrix would be large.

    Raises
    ------
    SolverError
        A block of equations is singular at this point.
    """
    n = len(seeds)
    entering = [*((slot, k) for k, slot in enumerate(seeds)), *((slot, n + seed) for slot, seed, _ in added)]
    n_seeds = n + max((seed + 1 for _, seed, _ in added), default=0)
    plan = derivative_plan(prepared.program, entering, wanted, n_seeds)
    weights = np.array([*[1.0] * n, *(weight for *_, weight in added)])
    values = entries(plan, At(prepared, np.array([t]), slots[:, None], relations[:, None]), weights)
    if prepared.program.n_slots * n_seeds <= MOST_DENSE:
        return dense(plan, values)[0]
    import scipy.sparse as sparse

    return sparse.csr_matrix((values[:, 0], (plan.rows, plan.seeds)), shape=plan.shape)


def dense(plan: DerivativePlan, values: Floats) -> Floats:
    """Derivatives at some times as dense matrices, shape (times, wanted, seeds)."""
    result = np.zeros((values.shape[1], *plan.shape))
    result[:, plan.rows, plan.seeds] = values.T
    return result


def entries(plan: DerivativePlan, at: At, weights: Floats | None = None) -> Floats:
    """The derivatives that a plan lists, shape (derivatives, times).

    Parameters
    ----------
    plan : DerivativePlan
    at : At
    weights : array, optional
        Weight with which a seed enters at each slot, shape (slots,) or (slots, times); 1 by default.

    Raises
    ------
    SolverError
        A block of equations is singular at this point.
    """
    result: Floats = all_entries(plan, at, weights)[plan.sources]
    return result


def all_entries(plan: DerivativePlan, at: At, weights: Floats | None = None) -> Floats:
    """The entries of all slots on the way, shape (entries, times)."""
    numbers = np.zeros((plan.n_entries, len(at.t)))
    numbers[1 : 1 + len(plan.order)] = 1.0 if weights is None else np.atleast_2d(weights.T).T[plan.order]
    for step in plan.steps:
        if isinstance(step, Sums):
            numbers[step.to] = sums_of_products(step, factor_values(step, at), numbers)
        else:
            block = solved_block(step, at, numbers)[step.rows].reshape(-1, len(at.t))
            if len(step.added):
                np.add.at(block, step.added, numbers[step.added_sources])
            numbers[step.first : step.first + len(block)] = block
    return numbers


def pulled_back(plan: DerivativePlan, at: At, weights: Floats) -> Floats:
    """Weighted sums of the derivatives that a plan lists: the plan transposed, one pass through its steps in reverse (reverse mode).

    Parameters
    ----------
    plan : DerivativePlan
        With one seed that enters wherever derivatives are wanted.
    at : At
    weights : array, shape (wanted, times)

    Returns
    -------
    array, shape (entering, times)
        For each place at which the seed enters, in the order in which these were given.
    """
    back = np.zeros((plan.n_entries, len(at.t)))
    np.add.at(back, plan.sources, weights[plan.rows])
    for step in reversed(plan.steps):
        if isinstance(step, Sums):
            _spread(step, at, back[step.to], back)
            continue
        block, width, times = step.step, step.width, len(at.t)
        entries_ = back[step.first : step.first + len(step.rows) * width]
        np.add.at(back, step.added_sources, entries_[step.added])
        unknowns = np.zeros((len(block.unknowns), width, times))
        unknowns[step.rows] = entries_.reshape(len(step.rows), width, times)
        right = _transposed_block(step, at, unknowns)
        _spread(step.sums, at, right.reshape(-1, times)[step.sums.to], back)
        if isinstance(block, Newton) and step.matrix is not None:
            for i, matrix in enumerate(newton_matrix(block, at)):
                if (shares := shares_by_matrix(matrix, at.slots[block.unknowns, i])) is not None:
                    due = np.zeros((len(step.matrix), times))
                    due[:, i] = shares.transposed(unknowns[:, :, i]).ravel()[step.matrix.to]
                    _spread(step.matrix, at, due, back)
    found = np.empty((len(plan.order), len(at.t)))
    found[plan.order] = back[1 : 1 + len(plan.order)]
    return found


def _spread(sums: Sums, at: At, of_sums: Floats, back: Floats) -> None:
    """Add what is due to the sources of sums."""
    if len(sums):
        lengths = np.diff(sums.starts, append=len(sums.which))
        with np.errstate(all="ignore"):
            np.add.at(back, sums.sources, factor_values(sums, at)[sums.which] * np.repeat(of_sums, lengths, axis=0))


def _transposed_block(step: Solved, at: At, unknowns: Floats) -> Floats:
    """The transpose of `solved_block`: from its unknowns to its right-hand side, shape (rows, width, times)."""
    block, (n, width, times) = step.step, unknowns.shape
    if isinstance(block, Newton):
        return -np.stack([solve_shared(m, unknowns[:, :, i], True) for i, m in enumerate(newton_matrix(block, at))], axis=2)
    flat = unknowns.reshape(n, width * times)
    if step.implicit:
        found = -block_solve(at.prepared, step.block, np.eye(n)).T @ flat
    else:
        solution = at.prepared.solutions[step.block]
        found = solution.T @ flat if isinstance(solution, np.ndarray) else solution.transposed(flat)
    return np.asarray(found.reshape(-1, width, times), float)


def factor_values(sums: Sums, at: At) -> Floats:
    """Values of the factors, all rows concatenated, followed by a one."""
    with np.errstate(all="ignore"):
        found = [
            at.values(batch) if slots is None else at.values(batch) * at.slots[slots]
            for batch, slots in zip(sums.factors, sums.multiplied, strict=True)
        ]
    return np.concatenate([*found, np.ones((1, len(at.t)))])


def sums_of_products(sums: Sums, factors: Floats, numbers: Floats) -> Floats:
    """Sums of products of factors and entries, shape (sums, times); the last factor is the one for entries added as they are."""
    if not len(sums):
        return np.empty((0, numbers.shape[1]))
    with np.errstate(all="ignore"):
        products = factors[sums.which] * numbers[sums.sources]
        return products if len(sums) == len(products) else np.asarray(np.add.reduceat(products, sums.starts, axis=0))


def solved_block(step: Solved, at: At, numbers: Floats) -> Floats:
    """Entries of all unknowns of a block, shape (unknowns, seeds, times)."""
    block, width, times = step.step, step.width, len(at.t)
    n = len(block.known) if isinstance(block, Linear) and not step.implicit else len(block.unknowns)
    right = np.zeros((n * width, times))
    right[step.sums.to] = sums_of_products(step.sums, factor_values(step.sums, at), numbers)
    if isinstance(block, Newton):
        found = newton_solved(block, at, right.reshape(n, width, times))
        return found if step.matrix is None else found + _shares_turned(step.matrix, block, at, numbers, width)
    if step.implicit:
        found = -block_solve(at.prepared, step.block, right.reshape(n, width * times))
    elif isinstance(solution := at.prepared.solutions[step.block], np.ndarray) and solution.ndim > 2:
        found = np.einsum("tuk,kwt->uwt", solution, right.reshape(n, width, times))
    else:
        found = solution @ right.reshape(n, width * times)
    return np.asarray(found.reshape(len(block.unknowns), width, times), float)


def _shares_turned(sums: Sums, block: Newton, at: At, numbers: Floats, width: int) -> Floats:
    """What changes of the matrix add to what it leaves open, shape (unknowns, seeds, times)."""
    n, times = len(block.unknowns), len(at.t)
    found = np.zeros((n, width, times))
    changes: Floats | None = None
    for i, matrix in enumerate(newton_matrix(block, at)):
        if (shares := shares_by_matrix(matrix, at.slots[block.unknowns, i])) is not None:
            if changes is None:
                changes = sums_of_products(sums, factor_values(sums, at), numbers)
            change = np.zeros(n * n * width)
            change[sums.to] = changes[:, i]
            found[:, :, i] = shares.times(change.reshape(n, n, width))
    return found


def newton_solved(step: Newton, at: At, right: Floats) -> Floats:
    n = len(step.unknowns)
    matrices = newton_matrix(step, at)
    if len(matrices) > 1:
        with suppress(np.linalg.LinAlgError):
            return np.asarray(np.moveaxis(solve_regular(matrices, -np.moveaxis(right, 2, 0)), 0, 2), float)
    try:
        return -np.stack([solve_shared(m, right[:, :, i]) for i, m in enumerate(matrices)], axis=2)
    except np.linalg.LinAlgError:
        raise SolverError(
            f"there is no linear model at this point: {n} {'equation that is' if n == 1 else 'equations that are'} solved by "
            "iteration cannot be solved for small changes there; give inertia to what nothing moves, or another point (at=...)"
        ) from None


def newton_matrix(step: Newton, at: At) -> Floats:
    """Matrix of a block's linearised equations, shape (times, unknowns, unknowns)."""
    n = len(step.unknowns)
    found = assemble(step.jacobian, at.t, at.slots, at.prepared.parameters, at.relations, n * n)
    return found.T.reshape(len(at.t), n, n)


def slopes(batch: Batch, at: At) -> Iterator[tuple[Integers, Integers, Floats]]:
    """Per argument of a batch at one point: rows, the argument's slots, partial derivatives; absent arguments are skipped."""
    for a in batch.active:
        here = np.flatnonzero(batch.argument_signs[:, a])
        yield here, batch.arguments[here, a], at.values(batch.derivative(a))[here, 0]


def undetermined(prepared: Prepared, t: float, slots: Floats, relations: Floats, wanted: Iterable[int] | None = None) -> Floats:
    """Sensitivity of slots to the null space of the blocks solved by iteration, shape (wanted, directions)."""
    at = At(prepared, np.array([t]), slots[:, None], relations[:, None])
    added: list[Added] = []
    count = 0
    for step in (s for s in prepared.program.steps if isinstance(s, Newton)):
        for direction in _null_space(newton_matrix(step, at)[0]).T:
            added += [(int(u), count, float(x)) for u, x in zip(step.unknowns, direction, strict=True)]
            count += 1
    if not count:
        return np.zeros((len(slots) if wanted is None else len(list(wanted)), 0))
    found = derivatives(prepared, t, slots, relations, (), added, wanted)
    return np.asarray(found.toarray() if hasattr(found, "toarray") else found, float)


def _null_space(matrix: Floats) -> Floats:
    """Orthonormal null space of a square matrix, after scaling its rows and columns."""
    rows, columns = equilibrating(matrix)
    scaled = matrix * rows[:, None] * columns
    if np.linalg.cond(scaled) < SINGULAR:
        return np.zeros((len(matrix), 0))
    _, sizes, right = np.linalg.svd(scaled)
    null = right[sizes * SINGULAR <= sizes.max()].T
    return np.where(np.abs(null) > ROUNDING, null, 0.0) * columns[:, None]


def equilibrating(matrix: Floats) -> tuple[Floats, Floats]:
    """Scale factors of rows and columns that bring all entries close to 1: powers of 2, so that entries are not rounded.

    Other units leave the scaled matrix as it is, up to factors of 2. Artificial compliances count as nothing.
    """
    size = np.abs(matrix)
    there = size > COMPLIANCE * size.max(axis=1, initial=0.0)[:, None]
    logs = np.log2(np.where(there, size, 1.0))
    n = len(matrix)
    joined = np.block([[np.diag(there.sum(axis=1)), there], [there.T, np.diag(there.sum(axis=0))]]) + 1e-9 * np.eye(2 * n)
    scales = np.exp2(np.round(np.linalg.solve(joined, -np.concatenate([logs.sum(axis=1), logs.sum(axis=0)]))))
    return scales[:n], scales[n:]


def solve_shared(matrix: Floats, right: Floats, transposed: bool = False) -> Floats:
    """Solve linear equations, or multiply by the transpose of what solves them.

    Locked elements in parallel leave their torques open: their compliances tell the shares, as in a run. Other unknowns that are left
    open are made as small as can be.

    Raises
    ------
    LinAlgError
        The equations are inconsistent; transposed, what is asked for is left open.
    """
    scales, regular = _regular(matrix)
    if regular is not None:
        return _times(*scales, regular, right, transposed)
    row, column, scaled, inverse, free, weights = _open(matrix)
    told = free @ np.linalg.pinv(weights * free, rcond=1 / SINGULAR)
    inverse, free = inverse - told @ (weights * inverse), free - told @ (weights * free)
    given = right * (column if transposed else row)[:, None]
    off = free.T @ given if transposed else scaled @ (inverse @ given) - given
    if np.abs(off).max(initial=0.0) > 1e-9 * np.abs(given).max(initial=0.0):
        raise np.linalg.LinAlgError
    return _times(row, column, inverse, right, transposed)


def _scales(matrix: Floats) -> tuple[Floats, Floats]:
    """Factors that bring the largest entries of rows, then those of columns, to 1."""
    row: Floats = 1 / np.maximum(np.abs(matrix).max(axis=1), 1e-300)
    column: Floats = 1 / np.maximum((np.abs(matrix) * row[:, None]).max(axis=0), 1e-300)
    return row, column


def _regular(matrix: Floats) -> tuple[tuple[Floats, Floats], Floats | None]:
    """The inverse of a matrix with scaled rows and columns, None if it is singular, and the scales."""
    scales = _scales(matrix)
    for by_units in (False, True):
        rows, columns = scales = equilibrating(matrix) if by_units else scales
        scaled = matrix * rows[:, None] * columns
        with suppress(np.linalg.LinAlgError):
            inverse = np.asarray(np.linalg.inv(scaled), float)
            if np.abs(inverse).sum(axis=1).max(initial=0.0) * np.abs(scaled).sum(axis=1).max(initial=0.0) < SINGULAR:
                return scales, inverse
    return scales, None


def _open(matrix: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """Scales of rows and columns of a singular matrix, the scaled one, its pseudo-inverse, its null space, weights of its unknowns."""
    row, column = _scales(matrix)
    scaled = matrix * row[:, None] * column
    left, sizes, back = np.linalg.svd(scaled)
    kept = sizes * SINGULAR > sizes.max()
    compliant, weights = compliances(matrix)
    compliant &= np.abs(scaled) * SINGULAR <= 1.0  # not one that only units make small
    weights = np.where(compliant.any(axis=0), weights * column, 0.0)[:, None]
    return row, column, scaled, back[kept].T @ (left[:, kept].T / sizes[kept, None]), back[~kept].T, weights


@dataclass(frozen=True, eq=False)
class SharesByMatrix:
    """How unknowns that linear equations leave open follow changes of the matrix, entry by entry.

    The solution z of A z = b has the least sum of w z**2: w z = A' m, of multipliers m. A change of A turns the directions n that are
    open, A n = 0, and so adds to z what ``forces`` on them, dA' m - dw z, move.

    Attributes
    ----------
    yields : array, shape (unknowns, unknowns)
        What a force moves, along the open directions.
    forces : array, shape (rows, columns)
        Force on an unknown by the change of an entry in its column.
    units : tuple of arrays
        Rows and columns of the entries that divide the compliance of each unknown, and the force by their change.
    """

    yields: Floats
    forces: Floats
    units: tuple[Integers, Integers, Floats]

    def times(self, changes: Floats) -> Floats:
        """Changes of the unknowns by those of the matrix, shape (rows, columns, seeds)."""
        rows, columns, by_unit = self.units
        force = np.einsum("rc,rcw->cw", self.forces, changes) + by_unit[:, None] * changes[rows, columns]
        return np.asarray(self.yields @ force, float)

    def transposed(self, unknowns: Floats) -> Floats:
        """The transpose of `times`, shape (rows, columns, seeds)."""
        rows, columns, by_unit = self.units
        force = self.yields @ unknowns
        found = self.forces[:, :, None] * force
        np.add.at(found, (rows, columns), by_unit[:, None] * force)
        return np.asarray(found, float)


def shares_by_matrix(matrix: Floats, unknowns: Floats) -> SharesByMatrix | None:
    """How shares that compliances tell follow changes of the matrix; None if it leaves none open."""
    if _regular(matrix)[1] is not None:
        return None
    row, column, _, inverse, free, weights = _open(matrix)
    if not weights.any():
        return None
    told = column[:, None] * free @ np.linalg.pinv(weights * free, rcond=1 / SINGULAR)
    pull = (weights[:, 0] / column) ** 2 * unknowns
    compliant, _ = compliances(matrix)
    forces = np.where(compliant, 0.0, np.outer(row * (inverse.T @ (column * pull)), np.ones(len(matrix))))
    # the weight is a compliance by the largest entry of its row, times the largest entry of its column
    size, here = np.abs(matrix), np.flatnonzero(pull)
    unit = size.argmax(axis=1)
    soft = np.where(compliant, size / np.maximum(size.max(axis=1), 1e-300)[:, None], 0.0).argmax(axis=0)
    for at in (soft[here], size.argmax(axis=0)[here]):
        forces[at, here] -= pull[here] / matrix[at, here]
    by_unit = np.zeros(len(matrix))
    by_unit[here] = pull[here] / matrix[soft[here], unit[soft[here]]]
    return SharesByMatrix(told @ told.T, forces, (soft, unit[soft], by_unit))


def _times(rows: Floats, columns: Floats, inverse: Floats, right: Floats, transposed: bool) -> Floats:
    """An inverse of scaled rows and columns, or its transpose, times right-hand sides."""
    if transposed:
        return np.asarray(rows[:, None] * (inverse.T @ (right * columns[:, None])), float)
    return np.asarray(columns[:, None] * (inverse @ (right * rows[:, None])), float)
