"""Incidence of equations and (differentiated) variables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]
Floats = NDArray[np.float64]
Node = tuple[int, int]  # a variable or equation, and how often it is differentiated
Columns = Callable[[int, int], list[Node]]  # (equation, times differentiated) -> variables with their orders


@dataclass(frozen=True)
class Incidence:
    """Sparsity pattern of the equations, with orders of derivative.

    Attributes
    ----------
    n_equations, n_variables : int
        Variables are numbered as in the flat model; those that aliases removed stand in no equation.
    columns : callable
        ``columns(e, k)`` lists what stands in the k-th derivative of equation e.
    variables : array of int
        The variables that stand in some equation, or are wanted.
    """

    n_equations: int
    n_variables: int
    columns: Columns
    variables: Integers


@dataclass(frozen=True)
class Entries:
    """Numerical partial derivatives: ``values[i]`` of equation ``rows[i]`` with respect to ``nodes[i]``."""

    rows: Integers
    variables: Integers
    orders: Integers
    values: Floats


def csr(rows: Sequence[int] | Integers, columns: Integers, n_rows: int) -> tuple[Integers, Integers]:
    """Compressed rows of a list of pairs.

    >>> csr([1, 0, 1], np.array([5, 6, 7]), 2)
    (array([0, 1, 3]), array([6, 5, 7]))
    """
    rows = np.asarray(rows, np.int64)
    order = np.argsort(rows, kind="stable")
    pointer = np.zeros(n_rows + 1, np.int64)
    np.cumsum(np.bincount(rows, minlength=n_rows), out=pointer[1:])
    return pointer, columns[order]
