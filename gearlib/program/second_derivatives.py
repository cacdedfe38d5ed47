"""Second derivatives of a program: directional derivatives of the derivatives that a plan lists.

The plan of the first derivatives is evaluated in dual numbers: every factor, entry and block has a value and a directional derivative.
For a factor that is the derivative of its kernel; for the entries of a block, which solve M X + R = 0, it solves M X' + R' + M' X = 0.
So the state matrix of a linear model is differentiated with respect to a parameter without finite differences.

References
----------
A. Griewank, A. Walther, "Evaluating Derivatives", 2nd ed., SIAM, 2008, section 5.4 (second derivatives by a repeated forward mode).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.program.derivative_plan import DerivativePlan, Solved, Sums
from gearlib.program.derivatives import At, all_entries, factor_values, newton_solved, solved_block, sums_of_products
from gearlib.program.interpret import block_solve
from gearlib.program.program import Batch, Linear, Newton

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Direction:
    """Directional derivatives of everything that a program reads and computes.

    Attributes
    ----------
    slots : array, shape (slots, directions)
    parameters : array, shape (parameters, directions)
        For the whole parameter table.
    """

    slots: Floats
    parameters: Floats

    @cached_property
    def still(self) -> bool:
        """Whether no slot changes."""
        return not self.slots.any()

    def of(self, batch: Batch, at: At) -> Floats:
        """Directional derivatives of a batch's values, shape (rows, directions)."""
        found = np.zeros((len(batch), self.slots.shape[1]))
        with np.errstate(all="ignore"):
            for a in () if self.still else batch.active:
                found += at.values(batch.derivative(a)) * self.slots[batch.arguments[:, a]]
            for q in range(batch.parameters.shape[1]):
                change = self.parameters[batch.parameters[:, q]]
                if change.any():
                    found += at.values(batch.parameter_derivative(q)) * change
        return found


def entry_changes(plan: DerivativePlan, at: At, along: Direction, weights: Floats | None = None) -> Floats:
    """Directional derivatives of the derivatives that a plan lists, shape (derivatives, directions).

    Parameters
    ----------
    plan : DerivativePlan
    at : At
        At a single point.
    along : Direction
    weights : array, optional
        As for `gearlib.program.derivatives.entries`; held constant.

    Raises
    ------
    SolverError
        A block of equations is singular at this point.
    """
    numbers = all_entries(plan, at, weights)
    changes = np.zeros((plan.n_entries, along.slots.shape[1]))
    for step in plan.steps:
        if isinstance(step, Sums):
            changes[step.to] = _sums_changed(step, at, along, numbers, changes)
        else:
            block = _block_changed(step, at, along, numbers, changes)
            changes[step.first : step.first + len(block)] = block
    result: Floats = changes[plan.sources]
    return result


def _sums_changed(sums: Sums, at: At, along: Direction, numbers: Floats, changes: Floats) -> Floats:
    """The product rule."""
    moved = []
    for batch, slots in zip(sums.factors, sums.multiplied, strict=True):
        change = along.of(batch, at)
        moved.append(change if slots is None else change * at.slots[slots] + at.values(batch) * along.slots[slots])
    factors = np.concatenate([*moved, np.zeros((1, changes.shape[1]))])
    found = np.zeros((len(sums), changes.shape[1]))
    if factors.any():
        found = sums_of_products(sums, factors, numbers)
    if changes[sums.sources].any():
        found += sums_of_products(sums, factor_values(sums, at), changes)
    return found


def _block_changed(step: Solved, at: At, along: Direction, numbers: Floats, changes: Floats) -> Floats:
    """Directional derivatives of the needed entries of a block's unknowns, row by row."""
    block, width, directions = step.step, step.width, changes.shape[1]
    n = len(block.unknowns)
    given = np.zeros(((len(block.known) if isinstance(block, Linear) and not step.implicit else n) * width, directions))
    given[step.sums.to] = _sums_changed(step.sums, at, along, numbers, changes)
    right = known = given.reshape(-1, width, directions)
    if isinstance(block, Linear) and not step.implicit:
        right = np.zeros((n, width, directions))
        np.add.at(right, block.known_rows, known)
    entries = block.jacobian if isinstance(block, Newton) else block.matrix
    before = None
    for batch in entries:
        change = along.of(batch, at)
        if change.any():
            before = solved_block(step, at, numbers)[:, :, 0] if before is None else before
            row, column = np.divmod(batch.targets, n)
            np.add.at(right, row, change[:, None, :] * before[column][:, :, None])
    if isinstance(block, Newton):
        found = newton_solved(block, at, right.reshape(n, width * directions, 1))
    else:
        found = -block_solve(at.prepared, step.block, right.reshape(n, width * directions))
    chosen = found.reshape(n, width, directions)[step.rows]
    return np.asarray(chosen.reshape(-1, directions), float)
