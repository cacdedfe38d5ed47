"""`Rows`: a flat model's equations one by one: their variables and derivative orders, and their coefficients at one point."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from gearlib.equations.kernel import Kernel, partial_kernel, residual_kernel
from gearlib.flatten.model import EquationGroup, FlatModel, Floats
from gearlib.structure.incidence import Node


class Rows:
    """The equations of a flat model one by one, for structural decisions: incidence, and where that does not suffice, numbers.

    Parameters
    ----------
    model : FlatModel
    parameters : array
        The complete vector.
    t : float
        Time at which coefficients are evaluated.
    known : array, shape (orders, variables), optional
        ``known[k]`` holds the k-th derivatives of all variables there; missing orders count as zero. By default the start values.
    """

    def __init__(self, model: FlatModel, parameters: Floats, t: float = 0.0, known: Floats | None = None) -> None:
        self.model, self.parameters, self.t, self.known = model, parameters, t, known
        self.first = np.cumsum([0, *(len(g) for g in model.groups)])
        self.place = [(g, i) for g, group in enumerate(model.groups) for i in range(len(group))]
        self._rows = [row for group in model.groups for row in _columns(group)]
        self._locals = [group.variables.tolist() for group in model.groups]
        self._signs = [group.signs.tolist() for group in model.groups]

    def of(self, model: FlatModel) -> Rows:
        """The rows of another model with the same variables and parameters, at the same point."""
        return Rows(model, self.parameters, self.t, self.known)

    def partial(self, g: int, column: int) -> Floats:
        """Partial derivatives of a group's equations with respect to one column of their template."""
        return self._values(partial_kernel(self.model.groups[g].template, column), self.model.groups[g])

    def rest(self, g: int) -> Floats:
        """Constant terms of a group's equations; NaN if they vary with time."""
        group = self.model.groups[g]
        if group.template.on_time:
            return np.full(len(group), np.nan)
        return self._values(residual_kernel(group.template, frozenset(range(len(group.template.columns)))), group)

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

    @cached_property
    def _point(self) -> Floats:
        return start_guess(self.model, self.parameters)[None, :] if self.known is None else self.known

    def _values(self, kernel: Kernel, group: EquationGroup) -> Floats:
        values = self._point
        where = {name: j for j, name in enumerate(group.template.locals)}
        none = np.zeros(len(group))

        def argument(name: str, order: int) -> Floats:
            j = where[name]
            return values[order, group.variables[:, j]] * group.signs[:, j] if order < len(values) else none

        return group.values(kernel, self.t, argument, self.parameters, lambda r: none)


def start_guess(model: FlatModel, parameters: Floats) -> Floats:
    """Start value of every representative variable: its start or guess value if it has one, else zero."""
    values = np.zeros(model.n_variables)
    representatives, signs, slots = model.guessed
    values[representatives] = signs * parameters[slots]
    return values


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
