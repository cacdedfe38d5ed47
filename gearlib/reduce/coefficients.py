"""Coefficients of a flat model's equations at one point, where structure alone does not decide; lists of equations for messages."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gearlib.equations.kernel import Kernel, partial_kernel, residual_kernel
from gearlib.flatten.model import FlatModel, Floats


def partials_at(model: FlatModel, g: int, column: int, parameters: Floats, known: Floats, t: float = 0.0) -> Floats:
    """Partial derivatives of a group's equations with respect to one column of their template.

    Parameters
    ----------
    model : FlatModel
    g, column : int
    parameters : array
        The complete vector.
    known : array, shape (orders, variables)
        ``known[k]`` holds the k-th derivatives of all variables; missing orders count as zero.
    t : float
        s.
    """
    return _values(model, g, partial_kernel(model.groups[g].template, column), parameters, known, t)


def rest_at(model: FlatModel, g: int, parameters: Floats, known: Floats) -> Floats:
    """Constant terms of a group's equations; NaN if they vary with time or at events. Arguments as for `partials_at`."""
    group = model.groups[g]
    kernel = residual_kernel(group.template, frozenset(range(len(group.template.columns))))
    if group.template.on_time or kernel.relations:
        return np.full(len(group), np.nan)
    return _values(model, g, kernel, parameters, known, 0.0)


def _values(model: FlatModel, g: int, kernel: Kernel, parameters: Floats, known: Floats, t: float) -> Floats:
    group = model.groups[g]
    where = {name: j for j, name in enumerate(group.template.locals)}
    none = np.zeros(len(group))

    def argument(name: str, order: int) -> Floats:
        j = where[name]
        return known[order, group.variables[:, j]] * group.signs[:, j] if order < len(known) else none

    return group.values(kernel, t, argument, parameters, lambda r: none)


def at_start(model: FlatModel, parameters: Floats) -> Floats:
    """The start values of all representative variables as a point at which coefficients are evaluated."""
    return start_guess(model, parameters)[None, :]


def start_guess(model: FlatModel, parameters: Floats) -> Floats:
    """Start value of every representative variable: its start or guess value if it has one, else zero."""
    values = np.zeros(model.n_variables)
    representatives, signs, slots = model.guessed
    values[representatives] = signs * parameters[slots]
    return values


def some(items: list[str], separator: str = "; ") -> str:
    """The first eight items of a list, and the number of the remaining ones."""
    return separator.join([*items[:8], *([f"and {len(items) - 8} more"] if len(items) > 8 else [])])


def listed(model: FlatModel, equations: Iterable[int]) -> str:
    """Equations as "load (Inertia: der(phi) = w); ..."."""
    places = (model.places[e] for e in equations)
    return some([f"{model.owner(g, i)} ({model.groups[g].template.label})" for g, i in places])
