"""Symbolic linear equations, solved block by block along the strongly connected components of their matrix.

A block is solved by Cramer's rule without expanding its entries, so that the solution is as compact as the equations, and the
determinant is one subexpression shared by all unknowns of a block. Short results are simplified.
"""

from __future__ import annotations

from typing import Any

import networkx as nx
import sympy as sp
from sympy.polys.matrices import DomainMatrix

__all__ = ["solved_by_blocks"]

SHORT = 60
"""Operations up to which a value is simplified; sympy takes some 10 ms for 20 of them, and minutes for 1000."""


def solved_by_blocks(matrix: Any, right_side: Any) -> list[Any]:
    """y of ``matrix y = right_side``, unknown by unknown.

    Raises
    ------
    ZeroDivisionError
        The matrix is singular.

    >>> a, b, c = sp.symbols("a b c")
    >>> solved_by_blocks(sp.Matrix([[a, 0], [b, c]]), sp.Matrix([1, 1]))
    [1/a, (a - b)/(a*c)]
    """
    size = matrix.rows
    uses = nx.DiGraph()
    uses.add_nodes_from(range(size))
    uses.add_edges_from((i, j) for (i, j), entry in matrix.todok().items() if entry != 0)
    condensed = nx.condensation(uses)
    solution: list[Any] = [None] * size
    for component in reversed(list(nx.lexicographical_topological_sort(condensed))):  # prerequisites come first
        block = sorted(condensed.nodes[component]["members"])
        known = sorted({j for i in block for j in uses.successors(i)} - set(block))
        sides = [right_side[i] - sum(matrix[i, j] * solution[j] for j in known) for i in block]
        for k, value in zip(block, _solved(matrix.extract(block, block), sides), strict=True):
            solution[k] = min(sp.simplify(value), value, key=sp.count_ops) if sp.count_ops(value) <= SHORT else value
    return solution


def _solved(matrix: Any, sides: list[Any]) -> list[Any]:
    """Unknowns of one block, with entries and right-hand sides unexpanded."""
    if _is_singular(matrix):
        raise ZeroDivisionError
    stands_for = {sp.Dummy(): entry for entry in matrix if entry != 0}
    names = iter(stands_for)
    opaque = matrix.applyfunc(lambda entry: next(names) if entry != 0 else entry)
    rows, scale = opaque.adjugate().xreplace(stands_for), opaque.det(method="berkowitz").xreplace(stands_for)
    return [sum(rows[i, j] * side for j, side in enumerate(sides)) / scale for i in range(matrix.rows)]


def _is_singular(matrix: Any) -> bool:
    """Whether the determinant vanishes, possibly by cancellation; numbers count as zero up to rounding."""
    if not matrix.free_symbols:
        size = abs(sp.Matrix(matrix).evalf())
        return bool(abs(sp.Matrix(matrix).evalf().det()) <= 1e-12 * sp.prod(max(size[i, :]) for i in range(size.rows)))
    return bool(DomainMatrix.from_Matrix(matrix).to_field().det() == 0)
