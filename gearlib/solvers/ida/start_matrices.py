"""Matrices and scales for consistent initialisation: linearised equations of x' and the algebraic unknowns, and their conditioning.

Both backends compute start values by Newton's iteration: the differential unknowns are fixed, and x' and the algebraic ones solved for.
"""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np

from gearlib.native.source import SMALLER_CONSTRAINED
from gearlib.solvers.ida.iteration_matrix import columns_of
from gearlib.solvers.problem import Floats, Problem

# Newton steps, and the change (relative to size and scale) at which one more step is the last.
NEWTON_LIMIT, SETTLED = 30, 1e-7
# Where algebraic unknowns may jump at an event, the event functions are compared this many location tolerances later.
AHEAD = 10.0
# In an implicit problem the algebraic unknowns, among them second derivatives determined by constraints, are excluded from the error
# test: IDA would step according to their noise, which is that of x' (an error of x divided by the step). Where they cannot be excluded,
# their tolerance is multiplied by this factor.
SUPPRESSED = 1e4
# Accuracy of the algebraic unknowns: from every state up to this many unknowns, beyond that from this many random combinations of
# states.
MOST_COLUMNS, SAMPLES = 400, 16
WATCHED = 10  # steps between checks that constraints still determine the algebraic unknowns


def of_algebraic(problem: Problem, absolute: Floats) -> tuple[Floats, Floats]:
    """Scales of x' and the algebraic unknowns, and the absolute tolerances including those of the latter.

    Quantities that follow from the states are no more accurate than these: du = G dx with G = -(dF/du)^-1 dF/dx, where u are x' and the
    algebraic unknowns, at the start. Otherwise the torque on a stiff shaft would be asked for digits that the shaft's twist does not
    have.
    """
    n, differential = len(problem.x0), np.asarray(problem.differential, bool)
    scales = np.array(problem.nominal, dtype=np.float64)
    if problem.jac is None or problem.jac_indptr is None or problem.jac_indices is None:
        return scales, absolute
    if not problem.implicit and differential.all():
        return scales, absolute
    import scipy.sparse as sparse
    from scipy.sparse.linalg import splu

    rtol, t = problem.rtol, float(problem.times[0])
    values = jacobian_at(problem, t, np.concatenate([problem.x0, np.zeros(n)]), np.array(problem.data, dtype=np.float64))
    unknown, state = start_matrices(problem, values)
    own = absolute / rtol
    steps: Floats = (
        np.diag(own)[:, differential] if n <= MOST_COLUMNS else np.random.default_rng(0).choice([-1.0, 1.0], (n, SAMPLES))
    )
    if n > MOST_COLUMNS:  # root mean square, from independent random signs
        steps *= np.where(differential, own, 0.0)[:, None] / np.sqrt(SAMPLES)
    try:
        moved = splu(sparse.csc_matrix(unknown)).solve(state @ steps)
    except (RuntimeError, ValueError):  # singular or non-finite: reported by the solver for start values
        return scales, absolute
    found = np.sqrt((moved**2).sum(axis=1))
    scales = np.maximum(scales, np.where(np.isfinite(found), found, 0.0))
    return scales, np.where(differential, absolute, np.maximum(absolute, rtol * scales))


class Watch:
    """Monitors whether constraints determine x' and the algebraic unknowns: the determinant must not fall far below its first value.

    The Newton iterations of a program monitor theirs in the same way, see `gearlib.native.source`.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, self.first = problem, math.nan

    def spent(self, t: float, x: Floats, dx: Floats, data: Floats) -> bool:
        """Whether the determinant has fallen too far, at a time and state with the model's current data."""
        from scipy.sparse.linalg import splu

        values = jacobian_at(self.problem, t, np.concatenate([x, dx]), data)
        try:
            factors = splu(start_matrices(self.problem, values)[0])
        except (RuntimeError, ValueError):
            return True
        found = float(np.log(np.abs(factors.U.diagonal())).sum())
        if math.isnan(self.first):
            self.first = found
        return found < self.first - SMALLER_CONSTRAINED


def jacobian_at(problem: Problem, t: float, x: Floats, data: Floats) -> Floats:
    """Nonzeros of the Jacobian; NaN where it cannot be evaluated."""
    assert problem.jac is not None
    assert problem.jac_indices is not None
    values, index = np.zeros(len(problem.jac_indices)), np.ascontiguousarray(problem.index, dtype=np.int64)
    signature = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *(ctypes.c_void_p,) * 4)
    status = signature(problem.jac.address)(t, x.ctypes.data, values.ctypes.data, data.ctypes.data, index.ctypes.data)
    return values if status == 0 else np.full_like(values, np.nan)


def start_matrices(problem: Problem, values: Floats) -> tuple[Any, Any]:
    """Sparse dF/du (x' and algebraic unknowns) and dF/dx (differential unknowns), from the nonzeros of the Jacobian.

    Columns are those of x: x' takes the column of the unknown whose derivative it is.
    """
    import scipy.sparse as sparse

    n, differential = len(problem.x0), np.asarray(problem.differential, bool)
    assert problem.jac_indices is not None
    columns, rows = columns_of(problem), problem.jac_indices
    entries = values if problem.implicit else -values
    of_state = (columns < n) & differential[columns % n]
    unknown = sparse.coo_matrix((entries[~of_state], (rows[~of_state], columns[~of_state] % n)), shape=(n, n))
    state = sparse.coo_matrix((entries[of_state], (rows[of_state], columns[of_state])), shape=(n, n))
    if not problem.implicit:
        unknown = unknown + sparse.diags(differential.astype(float))
    return sparse.csc_matrix(unknown), sparse.csr_matrix(state)
