"""Solution operator of a large linear block: a sparse LU factorisation, applied on demand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
CHUNK = 256  # columns solved for at once


@dataclass(frozen=True, eq=False)
class Factored:
    """The operator ``-inverse(A)[:, known]``; a dense matrix for thousands of unknowns would take gigabytes.

    Attributes
    ----------
    factors : scipy.sparse.linalg.SuperLU
        Of A.
    known : array of int
        The columns that have a right-hand side.
    """

    factors: Any
    known: Integers

    @property
    def shape(self) -> tuple[int, int]:
        return int(self.factors.shape[0]), len(self.known)

    def __matmul__(self, right: Floats) -> Floats:
        """Product with an array of shape (known, anything)."""
        full = np.zeros((self.shape[0], right.shape[1]))
        full[self.known] = -right
        return self.solve(full)

    def solve(self, right: Floats) -> Floats:
        """``inverse(A) @ right``."""
        result = np.empty_like(right)
        for first in range(0, right.shape[1], CHUNK):
            part = slice(first, first + CHUNK)
            result[:, part] = self.factors.solve(np.ascontiguousarray(right[:, part]))
        return result

    def transposed(self, right: Floats) -> Floats:
        """Product of the transpose with an array of shape (unknowns, anything)."""
        return np.asarray(-self.factors.solve(np.ascontiguousarray(right), trans="T")[self.known], float)

    def __getitem__(self, rows: Sequence[int] | Integers) -> Floats:
        """Some rows, by solves with A or its transpose, whichever takes fewer."""
        chosen = np.asarray(rows, np.int64)
        result = np.empty((len(chosen), len(self.known)))
        by_row = len(chosen) <= len(self.known)
        wanted = chosen if by_row else self.known
        for first in range(0, len(wanted), CHUNK):
            part = wanted[first : first + CHUNK]
            unit = np.zeros((self.shape[0], len(part)))
            unit[part, np.arange(len(part))] = -1.0
            solved = self.factors.solve(unit, trans="T" if by_row else "N")
            if by_row:
                result[first : first + CHUNK] = solved[self.known].T
            else:
                result[:, first : first + CHUNK] = solved[chosen]
        return result

    def tolist(self) -> list[list[float]]:
        """All entries, as nested lists."""
        rows: list[list[float]] = self[range(self.shape[0])].tolist()
        return rows
