"""Forward-mode differentiation of a program with respect to its states, vectorised over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import derivative_of
from gearlib.program.interpret import Prepared, assemble, batch_values
from gearlib.program.program import Batch

Floats = NDArray[np.float64]


def state_derivatives(prepared: Prepared, t: Floats, slots: Floats, relations: Floats) -> Floats:
    """Derivatives of the program's outputs by its states.

    Parameters
    ----------
    t : array, shape (times,)
    slots : array, shape (slots, times)
        Values at which to differentiate, as `gearlib.program.interpret.evaluate` returns them.
    relations : array, shape (relations, times)

    Returns
    -------
    array, shape (times, outputs, states)
    """
    program = prepared.program
    n, m = len(program.states), len(t)
    d = np.zeros((program.n_slots, n, m))
    d[np.arange(n), np.arange(n)] = 1.0
    solutions = iter(prepared.solutions)
    for step in program.steps:
        if isinstance(step, Batch):
            d[step.targets] = _chained(step, prepared, t, slots, relations, d)
            continue
        size = len(step.unknowns)
        if hasattr(step, "known"):
            known = d[step.known].reshape(len(step.known), n * m)
            d[step.unknowns] = (next(solutions) @ known).reshape(size, n, m)
            continue
        matrix = assemble(step.jacobian, t, slots, prepared.parameters, relations, size * size)
        right = np.zeros((size, n, m))
        d[step.unknowns] = 0.0
        for batch in step.residuals:
            np.add.at(right, batch.targets, _chained(batch, prepared, t, slots, relations, d))
        solved = np.linalg.solve(matrix.T.reshape(m, size, size), -np.moveaxis(right, 2, 0))
        d[step.unknowns] = np.moveaxis(solved, 0, 2)
    result: Floats = np.moveaxis(d[program.output_slots], 2, 0)
    return result


def _chained(batch: Batch, prepared: Prepared, t: Floats, slots: Floats, relations: Floats, d: Floats) -> Floats:
    """The chain rule through one batch, shape (instances, states, times)."""
    result = np.zeros((len(batch), *d.shape[1:]))
    for a, column in enumerate(batch.kernel.columns):
        kernel = derivative_of(batch.kernel, column)
        if kernel.is_zero:
            continue
        kept = [batch.kernel.columns.index(i) for i in kernel.columns]
        part = Batch(
            kernel, batch.equations, batch.targets, batch.signs, batch.arguments[:, kept], batch.argument_signs[:, kept],
            batch.parameters[:, [batch.kernel.parameters.index(i) for i in kernel.parameters]],
            batch.relations[:, [batch.kernel.relations.index(i) for i in kernel.relations]],
        )  # fmt: skip
        value = np.broadcast_to(batch_values(part, t, slots, prepared.parameters, relations), (len(batch), len(t)))
        result += (value * batch.argument_signs[:, a, None])[:, None, :] * d[batch.arguments[:, a]]
    return result
