"""`Rows`: row-wise view of a flat model's equations: variables and derivative orders, including differentiated equations."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.flatten.model import EquationGroup, FlatModel
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
# (group, column of its template) -> that partial derivative in each row
PartialValues = Callable[[int, int], Floats]
# group -> constant term of each row, NaN if it varies with time
RestValues = Callable[[int], Floats]


@dataclass(frozen=True)
class Coefficients:
    """Partial derivatives of a flat model, evaluated on demand."""

    partial: PartialValues
    rest: RestValues


class Rows:
    """Row-wise view of the equations of a flat model: variables and orders, including differentiated equations."""

    def __init__(self, model: FlatModel) -> None:
        self.model = model
        self.first = np.cumsum([0, *(len(g) for g in model.groups)])
        self.place = [(g, i) for g, group in enumerate(model.groups) for i in range(len(group))]
        self._rows = [row for group in model.groups for row in _columns(group)]
        self._locals = [group.variables.tolist() for group in model.groups]
        self._signs = [group.signs.tolist() for group in model.groups]

    def columns(self, e: int, k: int) -> list[Node]:
        """Variables and orders in the k-th derivative of equation e."""
        if k == 0:
            return self._rows[e]
        g, i = self.place[e]
        template = self.model.groups[g].template
        if template.linear:
            return [(v, order + k) for v, order in self._rows[e]]
        for _ in range(k):
            template = template.derivative
        variables, signs = self._locals[g][i], self._signs[g][i]
        return list(dict.fromkeys((variables[j], order) for j, order in template.local_columns if signs[j]))


def _columns(group: EquationGroup) -> list[list[Node]]:
    """Nodes in each row of a group. (No variable occurs twice, see `gearlib.flatten.specialise`.)"""
    template = group.template
    if not template.columns:
        return [[] for _ in range(len(group))]
    parts = [[(v, order) for v in group.variables[:, j].tolist()] for j, order in template.local_columns]
    rows = [list(r) for r in zip(*parts, strict=True)]
    for i in np.flatnonzero((group.signs == 0).any(axis=1)).tolist():
        rows[i] = [node for node, (j, _) in zip(rows[i], template.local_columns, strict=True) if group.signs[i, j]]
    return rows


def some(items: list[str], separator: str = "; ") -> str:
    """The first few items of a list, and the number of the remaining ones."""
    return separator.join([*items[:8], *([f"and {len(items) - 8} more"] if len(items) > 8 else [])])


def listed(model: FlatModel, rows: Rows, equations: Iterable[int]) -> str:
    """Equations as "load (Inertia: der(phi) = w); ..."."""
    places = (rows.place[e] for e in equations)
    return some([f"{model.owner(g, i)} ({model.groups[g].template.label})" for g, i in places])
