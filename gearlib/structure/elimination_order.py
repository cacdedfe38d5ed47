"""Elimination order of a sparse LU factorisation whose pivots are chosen when the numbers are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.structure.sparse_elimination import independent

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
ANY = 1e-9  # smallest pivot: the numbers are random, and only what fills in matters


@dataclass(frozen=True, eq=False)
class EliminationOrder:
    """A sparsity pattern by columns, the order of its rows and columns in an elimination, and how many entries the factors have.

    Attributes
    ----------
    n : int
        Rows and columns.
    places : integer array
        Row and column of each entry as ``row * n + column``, sorted by columns.
    columns : integer array
        Columns in the order of elimination.
    rows : integer array
        The pivot row of each of these columns for generic numbers; an earlier one fills in less.
    fill : int
        Entries of the larger one of both factors, for generic numbers.
    """

    n: int
    places: Integers
    columns: Integers
    rows: Integers
    fill: int

    @property
    def starts(self) -> Integers:
        """Where the entries of each column begin, and where the last ones end."""
        return np.searchsorted(self.places % self.n, np.arange(self.n + 1))

    def entries(self, targets: Integers) -> Integers:
        """Number of the entry at each of some places."""
        keys = self.places % self.n * self.n + self.places // self.n
        return np.searchsorted(keys, targets % self.n * self.n + targets // self.n)

    def matrix(self, values: Floats) -> Any:
        """Sparse matrix with these entries."""
        import scipy.sparse as sparse

        return sparse.csc_matrix((values, self.places // self.n, self.starts), shape=(self.n, self.n))


def elimination_order(n: int, targets: Integers) -> EliminationOrder:
    """Order of rows and columns by Markowitz' rule, found with random numbers.

    Parameters
    ----------
    n : int
        Rows and columns.
    targets : integer array
        ``row * n + column`` of the entries, in any order and possibly repeated. The pattern must have a perfect matching.

    Examples
    --------
    An arrow: the column and the row of the hub come last, so that nothing fills in.

    >>> import numpy as np
    >>> n, i = 50, np.arange(50)
    >>> found = elimination_order(n, np.concatenate([i * n + i, i, i * n]))
    >>> sorted(found.columns[-2:].tolist())[0], found.fill < 3 * n
    (0, True)
    """
    import scipy.sparse as sparse
    from scipy.sparse.linalg import splu

    rows, columns = np.divmod(np.unique(targets), n)
    by_column = np.lexsort((rows, columns))
    rows, columns = rows[by_column], columns[by_column]
    numbers = np.random.default_rng(n).uniform(0.5, 1.5, len(rows))
    matrix = sparse.csr_matrix((numbers, (rows, columns)), shape=(n, n))
    pivot_rows, pivot_columns = independent(matrix, safe=ANY, exchange=ANY)
    assert len(pivot_rows) == n, "a pattern with a perfect matching has full rank with random numbers"
    factors = splu(matrix[pivot_rows][:, pivot_columns].tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0)
    return EliminationOrder(n, rows * n + columns, pivot_columns, pivot_rows, max(factors.L.nnz, factors.U.nnz))
