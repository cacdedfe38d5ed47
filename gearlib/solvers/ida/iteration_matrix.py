"""Storage of IDA's iteration matrix cj dF/dx' + dF/dx: dense, banded or sparse, whichever takes the fewest operations.

The mechanical chains of gear trains have a narrow band once their unknowns are ordered along the chain (reverse Cuthill-McKee); the
cost of a banded factorisation is proportional to the number of states. Matrices without a narrow band are left to SuperLU, which costs
more per number but touches only nonzeros. Small systems are stored dense.

References
----------
E. Cuthill, J. McKee, Reducing the bandwidth of sparse symmetric matrices, Proc. 24th ACM National Conf. (1969) 157-172,
doi:10.1145/800195.805928.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.recent import recent
from gearlib.solvers.problem import Integers, Problem

_NO_INTEGERS: Integers = np.empty(0, dtype=np.int64)
MOST_PLANS = 16  # storages kept per pattern


@dataclass(frozen=True)
class MatrixPlan:
    """Storage of the iteration matrix, with the position of each nonzero of the model's Jacobian in it."""

    kind: str  # "dense", "band" or "sparse"
    order: Integers | None = None  # state of each of IDA's unknowns; None: the model's own order
    upper: int = 0  # bandwidths
    lower: int = 0
    # Index in the matrix storage of each nonzero of the Jacobian
    position: Integers = field(default_factory=lambda: _NO_INTEGERS)
    # The same for the diagonal entries of the differential unknowns
    diagonal: Integers = field(default_factory=lambda: _NO_INTEGERS)
    rows: Integers = field(default_factory=lambda: _NO_INTEGERS)  # in IDA's order, of each nonzero of the Jacobian
    columns: Integers = field(default_factory=lambda: _NO_INTEGERS)
    # Of each nonzero: 0 in the column of a state, 1 of an algebraic unknown, 2 of x'
    part: Integers = field(default_factory=lambda: _NO_INTEGERS)
    pattern: tuple[NDArray[np.int32], NDArray[np.int32]] | None = None  # column starts and rows of a sparse matrix

    def operations(self, n: int) -> tuple[float, float]:
        """Operations of a factorisation and of a solve for n unknowns; SuperLU's depend on fill-in, which is not known here.

        >>> MatrixPlan("dense").operations(30)
        (9000.0, 900.0)
        """
        if self.kind == "band":
            return float(n * self.lower * (self.lower + self.upper)), float(n * (2 * self.lower + self.upper))
        if self.kind == "dense":
            return n**3 / 3.0, float(n**2)
        nonzeros = float(len(self.pattern[1])) if self.pattern else 0.0
        return 1e6 + 1200.0 * nonzeros, 20.0 * nonzeros

    def describe(self) -> str:
        """Description for `Solution.stats`.

        >>> MatrixPlan("band", upper=2, lower=3).describe()
        'band, 3 below and 2 above the diagonal'
        """
        if self.kind == "band":
            return f"band, {self.lower} below and {self.upper} above the diagonal"
        return "dense" if self.kind == "dense" else f"sparse (SuperLU), {len(self.pattern[1]) if self.pattern else 0} nonzeros"


def columns_of(problem: Problem) -> Integers:
    """Column of each nonzero of the Jacobian; those of x' are counted behind all of x."""
    assert problem.jac_indptr is not None
    return np.repeat(np.arange(len(problem.jac_indptr) - 1, dtype=np.int64), np.diff(problem.jac_indptr))


def plan(problem: Problem, kind: str | None = None) -> MatrixPlan:
    """The cheapest storage for a problem's iteration matrix; cached with its sparsity pattern.

    Parameters
    ----------
    problem
        Provides the sparsity pattern of its Jacobian. Without one the matrix is dense.
    kind
        ``"dense"``, ``"band"`` or ``"sparse"`` to force one.
    """
    key = problem.differential.tobytes(), kind, problem.jac is None, problem.implicit
    plans: dict[Any, MatrixPlan] = problem.matrix_plans
    return recent(plans, key, lambda: replace(_make(problem, kind), part=_parts(problem)), MOST_PLANS)


def _parts(problem: Problem) -> Integers:
    if problem.jac_indptr is None:
        return _NO_INTEGERS
    columns, n = columns_of(problem), len(problem.x0)
    return np.where(columns >= n, 2, np.where(np.asarray(problem.differential, bool)[columns % n], 0, 1)).astype(np.int64)


def _make(problem: Problem, kind: str | None) -> MatrixPlan:
    n = len(problem.x0)
    if problem.jac_indptr is None or problem.jac_indices is None:
        return MatrixPlan("dense")
    rows = np.asarray(problem.jac_indices, dtype=np.int64)
    columns = columns_of(problem) % n
    differential = _NO_INTEGERS if problem.implicit else np.flatnonzero(problem.differential).astype(np.int64)
    if kind == "dense" or (kind is None and n <= 16):
        return _dense(n, rows, columns, differential)
    order = _narrow(n, rows, columns)
    place = np.arange(n) if order is None else np.argsort(order)
    lower, upper = _widths(place[rows], place[columns])
    if kind is None:
        kind = cheapest(n, len(rows) + n, lower, upper, problem.jac is not None)
    if kind == "dense":
        return _dense(n, rows, columns, differential)
    if kind == "sparse":
        return _sparse(n, rows, columns, differential)
    rows, columns, diagonal = place[rows], place[columns], place[differential]
    stored = upper + lower  # pivoting widens the upper band
    height = stored + lower + 1
    position = columns * height + rows - columns + stored
    return MatrixPlan("band", order, upper, lower, position, diagonal * height + stored, rows, columns)


def _widths(rows: Integers, columns: Integers) -> tuple[int, int]:
    offsets = rows - columns
    return int(offsets.max(initial=0)), int(-offsets.min(initial=0))


def _narrow(n: int, rows: Integers, columns: Integers) -> Integers | None:
    """The order of minimal bandwidth: the model's own (None) unless reverse Cuthill-McKee improves on it."""
    order = reverse_cuthill_mckee(n, rows, columns)
    place = np.argsort(order)
    own, new = sum(_widths(rows, columns)), sum(_widths(place[rows], place[columns]))
    return order if new < own else None


def reverse_cuthill_mckee(n: int, rows: Integers, columns: Integers) -> Integers:
    """Order the n nodes of an undirected graph so that edges (row, column) join nodes close to each other.

    Each connected component is numbered breadth-first from a peripheral node, neighbours of small degree first. (SciPy's function of
    this name starts at any node of minimal degree, which doubles the bandwidth of a chain when that node is in its middle.)

    >>> reverse_cuthill_mckee(5, np.array([0, 3, 1, 4]), np.array([3, 1, 4, 2])).tolist()  # the path 0-3-1-4-2
    [0, 3, 1, 4, 2]
    """
    joined = np.unique(np.concatenate([rows * n + columns, columns * n + rows]))
    joined = joined[joined // n != joined % n]
    starts = np.searchsorted(joined, np.arange(n + 1) * n).tolist()
    far = (joined % n).tolist()
    degree = [starts[i + 1] - starts[i] for i in range(n)]
    neighbours = [sorted(far[starts[i] : starts[i + 1]], key=degree.__getitem__) for i in range(n)]

    seen = [False] * n
    order: list[int] = []
    for node in sorted(range(n), key=degree.__getitem__):
        if not seen[node]:
            part = _breadth_first(_far_end(node, neighbours), neighbours)[0]
            for member in part:
                seen[member] = True
            order += part
    return np.array(order[::-1], dtype=np.int64)


def _breadth_first(start: int, neighbours: list[list[int]]) -> tuple[list[int], dict[int, int]]:
    level = {start: 0}
    order = [start]
    for node in order:  # grows during iteration
        for other in neighbours[node]:
            if other not in level:
                level[other] = level[node] + 1
                order.append(other)
    return order, level


def _far_end(start: int, neighbours: list[list[int]]) -> int:
    """A pseudo-peripheral node (George & Liu 1979, doi:10.1145/355841.355845)."""
    reach = -1
    while True:
        order, level = _breadth_first(start, neighbours)
        last = level[order[-1]]
        if last <= reach:
            return start
        reach = last
        start = min((node for node in order if level[node] == last), key=lambda node: len(neighbours[node]))


def cheapest(n: int, nonzeros: int, lower: int, upper: int, analytic: bool) -> str:
    """The storage with the fewest operations per step: IDA solves once per step and factorises about every twentieth.

    SuperLU's share depends on the fill-in, which is not known here. 80 operations per nonzero lie within a factor of two of what
    chains, trees and meshes with 50 to 2000 unknowns need; its library takes 25 ms to load.
    """
    dense = n**3 / 60 + n**2
    band = n * (lower * (lower + upper) / 20 + 2 * lower + upper)
    sparse = 50_000 + 80 * nonzeros if analytic else np.inf
    return min((band, "band"), (dense, "dense"), (sparse, "sparse"))[1]


def _dense(n: int, rows: Integers, columns: Integers, differential: Integers) -> MatrixPlan:
    return MatrixPlan("dense", position=columns * n + rows, diagonal=differential * (n + 1), rows=rows, columns=columns)


def _sparse(n: int, rows: Integers, columns: Integers, differential: Integers) -> MatrixPlan:
    every = np.concatenate([columns * n + rows, differential * (n + 1)])
    kept, where = np.unique(every, return_inverse=True)
    indptr = np.searchsorted(kept, np.arange(n + 1) * n).astype(np.int32)
    position, diagonal = where[: len(rows)].astype(np.int64), where[len(rows) :].astype(np.int64)
    pattern = (indptr, (kept % n).astype(np.int32))
    return MatrixPlan("sparse", position=position, diagonal=diagonal, rows=rows, columns=columns, pattern=pattern)
