"""Rank-revealing sparse elimination: independent rows and columns of a rectangular system, and its solution.

Gaussian elimination with Markowitz pivoting finds a maximal set of independent rows and columns. What it cannot decide with pivots of
sufficient size is left to a QR decomposition with column pivoting of the small dense remainder. The square matrix of the chosen rows
and columns is then factorised by SuperLU.

References
----------
H. M. Markowitz, "The elimination form of the inverse and its application to linear programming", Management Science 3 (1957)
255-269, doi 10.1287/mnsc.3.3.255
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.structure.sparse_rows import eliminate, holders_of

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
RANK = 1e-11  # of a row scaled to 1: a smaller remainder is linearly dependent
SAFE = 1e-3  # smallest pivot of the elimination; smaller ones are left to the dense remainder
EXCHANGE = 0.1  # smallest pivot relative to the largest entry of its row
CANCELLED = 1e-14  # relative to the operands of a subtraction: a smaller result is rounding
DENSE = 400  # largest fill-in of one elimination step; beyond it the dense remainder is better
NEGLIGIBLE = 1e-30  # of a row and an unknown of known sizes: a smaller entry scales neither, such as a speed that is zero but for rounding
FLOOR = 1e-4  # relative to the largest unknown: smaller terms need not cancel to their own precision
LOOKS = 3  # random directions: an unknown that is zero in all of them is determined


@dataclass(frozen=True, eq=False)
class Factors:
    """Equations ``matrix @ x = rhs``, scaled by row and column, and the independent ones among them.

    Attributes
    ----------
    matrix : sparse matrix
    row, column : arrays
        Scale factors that bring the largest entries of rows and columns close to 1.
    rows, columns : integer arrays
        Independent rows, and columns that they determine; both of length rank.
    """

    matrix: Any
    row: Floats
    column: Floats
    rows: Integers
    columns: Integers

    @cached_property
    def _scaled(self) -> Any:
        import scipy.sparse as sparse

        return (sparse.diags(self.row) @ self.matrix @ sparse.diags(self.column)).tocsr()

    @cached_property
    def _square(self) -> Any:
        from scipy.sparse.linalg import splu

        return splu(self._scaled[self.rows][:, self.columns].tocsc())

    @property
    def rank(self) -> int:
        return len(self.rows)

    @cached_property
    def open(self) -> Integers:
        """Free columns, on which the others depend."""
        return np.setdiff1d(np.arange(self.matrix.shape[1]), self.columns)

    def solve(self, rhs: Floats) -> Floats:
        """A solution of the independent rows, with the free unknowns set to 0."""
        x = np.zeros(self.matrix.shape[1])
        if self.rank:
            x[self.columns] = self._square.solve((rhs * self.row)[self.rows]) * self.column[self.columns]
        return x

    def contradiction(self, residual: Floats, x: Floats) -> Floats:
        """Each row's residual ``matrix @ x - rhs`` relative to its terms; 0 up to rounding where the row holds."""
        size = np.abs(x / self.column).max(initial=np.finfo(float).tiny)
        terms = self.row * (abs(self.matrix) @ np.abs(x)) + FLOOR * size
        with np.errstate(over="ignore"):
            ratio: Floats = np.abs(residual) * self.row / terms
        return ratio

    def directions(self, how_many: int) -> Floats:
        """Random null-space directions in scaled unknowns, shape (unknowns, how_many)."""
        return self.continued(np.random.default_rng(len(self.open)).uniform(0.5, 1.5, (len(self.open), how_many)))

    def continued(self, free: Floats) -> Floats:
        """Null-space directions in scaled unknowns with given values of the free ones, shape (unknowns, directions)."""
        found = np.zeros((self.matrix.shape[1], free.shape[1]))
        found[self.open] = free
        if self.rank:
            found[self.columns] = -self._square.solve(np.ascontiguousarray(self._scaled[self.rows] @ found))
        return found

    @cached_property
    def undetermined(self) -> Floats:
        """Magnitude of each scaled unknown in random null-space directions: 0 up to rounding where the equations determine it."""
        size: Floats = np.abs(self.directions(LOOKS)).max(axis=1, initial=0.0)
        return size

    def combined(self, row: int) -> Floats:
        """Weights of all rows that together cancel a dependent one (whose own weight is 1)."""
        weights = np.zeros(self.matrix.shape[0])
        if self.rank:
            right = self._scaled[[row]][:, self.columns].toarray().ravel()
            weights[self.rows] = -self._square.solve(right, "T")
        weights[row] = 1.0
        return weights


def factorise(matrix: Any, sizes: Floats | None = None) -> Factors:
    """Scale a sparse matrix, and find independent rows and columns.

    Scaling begins with ``sizes`` of the unknowns, NaN where they are not known.

    Examples
    --------
    >>> import numpy as np, scipy.sparse as sparse
    >>> found = factorise(sparse.csr_matrix([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 1e6]]))
    >>> found.rank, np.round(found.solve(np.array([4.0, 8.0, 3e6])), 12).tolist()
    (2, [4.0, 0.0, 3.0])
    """
    import scipy.sparse as sparse

    matrix = sparse.csr_matrix(matrix)
    row, column = _scales(matrix, sizes)
    scaled = (sparse.diags(row) @ matrix @ sparse.diags(column)).tocsr()
    rows, columns = independent(scaled)
    return Factors(matrix, row, column, rows, columns)


def _scales(matrix: Any, sizes: Floats | None = None) -> tuple[Floats, Floats]:
    """Scale factors that bring the largest entry of every row and column close to 1."""
    entries = matrix.tocoo()
    size, i, j = np.abs(entries.data), entries.row, entries.col
    row, column = np.ones(matrix.shape[0]), np.ones(matrix.shape[1])
    if sizes is not None:
        row /= _largest(size * np.nan_to_num(sizes)[j], i, row)
        column = np.where(np.isfinite(sizes), sizes, 1 / _largest(size * row[i], j, column))
        size = np.where(size * row[i] * column[j] > NEGLIGIBLE, size, 0.0)
    for _ in range(8):
        for factors, place in ((row, i), (column, j)):
            factors /= np.sqrt(_largest(size * row[i] * column[j], place, factors))
    return row, column


def _largest(size: Floats, place: Integers, factors: Floats) -> Floats:
    """The largest entry of each row or column; 1 where there is none."""
    found = np.zeros(len(factors))
    np.maximum.at(found, place, size)
    return np.where(found > 0, found, 1.0)


def independent(scaled: Any, safe: float = SAFE, exchange: float = EXCHANGE) -> tuple[Integers, Integers]:
    """Rows and columns of a maximal nonsingular square submatrix, for a matrix with entries up to about 1.

    They are in the order of elimination. Where only the pattern matters, any pivot will do: small ``safe`` and ``exchange``.
    """
    lines = _lines(scaled)
    users = holders_of(lines)
    chosen: list[tuple[int, int]] = []
    waiting = [(len(line), i) for i, line in lines.items() if line]
    heapq.heapify(waiting)
    done: set[int] = set()
    while waiting:
        length, i = heapq.heappop(waiting)
        line = lines[i]
        if i in done or length != len(line):
            continue  # outdated: it is in the queue again
        pivot = _pivot(line, users, safe, exchange)
        if pivot is None or (length - 1) * (len(users[pivot]) - 1) > DENSE:
            continue
        done.add(i)
        chosen.append((i, pivot))
        for k in line:
            users[k].discard(i)
        for other, _ in eliminate(lines, users, i, pivot, users[pivot], rounding=CANCELLED):
            heapq.heappush(waiting, (len(lines[other]), other))
    chosen += _core([i for i, line in lines.items() if line and i not in done], lines)
    rows, columns = np.array(chosen, np.int64).reshape(len(chosen), 2).T
    return rows, columns


def _lines(scaled: Any) -> dict[int, dict[int, float]]:
    """Rows as dictionaries, column -> entry."""
    starts, columns, values = scaled.indptr.tolist(), scaled.indices.tolist(), scaled.data.tolist()
    ends = zip(starts[:-1], starts[1:], strict=True)
    return {i: dict(zip(columns[start:end], values[start:end], strict=True)) for i, (start, end) in enumerate(ends)}


def _pivot(line: dict[int, float], users: Mapping[int, set[int]], safe: float, exchange: float) -> int | None:
    """Pivot column of a row: among its large entries, the column with the fewest rows."""
    largest = max(map(abs, line.values()), default=0.0)
    if largest < safe:
        return None
    least = exchange * largest
    return min((j for j, v in line.items() if abs(v) >= least), key=lambda j: len(users[j]))


def _core(rows: list[int], lines: Mapping[int, Mapping[int, float]]) -> list[tuple[int, int]]:
    """Independent rows and columns of the dense remainder."""
    from scipy.linalg import qr

    columns = sorted({j for i in rows for j in lines[i]})
    if not columns:
        return []
    place = {j: k for k, j in enumerate(columns)}
    full = np.zeros((len(rows), len(columns)))
    for i, number in enumerate(rows):
        for j, v in lines[number].items():
            full[i, place[j]] = v
    triangle, order = qr(full, mode="r", pivoting=True)
    pivots = np.abs(np.diag(triangle))
    rank = int((pivots > RANK * max(1.0, float(pivots.max(initial=0.0)))).sum())
    if not rank:
        return []
    kept = order[:rank]
    _, row_order = qr(full[:, kept].T, mode="r", pivoting=True)
    return [(rows[i], columns[j]) for i, j in zip(row_order[:rank].tolist(), kept.tolist(), strict=True)]
