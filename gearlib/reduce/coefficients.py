"""Partial derivatives at the start values, for structural decisions that depend on numbers."""

from __future__ import annotations

import numpy as np

from gearlib.equations.kernel import Kernel, partial_kernel, residual_kernel
from gearlib.flatten.model import EquationGroup, FlatModel, Floats
from gearlib.reduce.rows import Coefficients


def start_guess(model: FlatModel, parameters: Floats) -> Floats:
    """Start value of every representative variable: its start or guess value if it has one, else zero."""
    values = np.zeros(model.n_variables)
    representatives, signs, slots = model.guessed
    values[representatives] = signs * parameters[slots]
    return values


def coefficients_of(model: FlatModel, parameters: Floats, t: float, known: Floats | None = None) -> Coefficients:
    """Partial derivatives of all equations at the start values, or at known values.

    ``known[k]`` holds the k-th derivatives of all variables; missing ones count as zero.
    """
    values = start_guess(model, parameters)[None, :] if known is None else known

    def apply(kernel: Kernel, group: EquationGroup) -> Floats:
        where = {name: j for j, name in enumerate(group.template.locals)}
        none = np.zeros(len(group))

        def argument(name: str, order: int) -> Floats:
            j = where[name]
            return values[order, group.variables[:, j]] * group.signs[:, j] if order < len(values) else none

        return group.values(kernel, t, argument, parameters, lambda r: none)

    def partial(g: int, column: int) -> Floats:
        group = model.groups[g]
        return apply(partial_kernel(group.template, column), group)

    def rest(g: int) -> Floats:
        group = model.groups[g]
        template = group.template
        kernel = residual_kernel(template, frozenset(range(len(template.columns))))
        if template.on_time:
            return np.full(len(group), np.nan)
        return apply(kernel, group)

    return Coefficients(partial, rest)
