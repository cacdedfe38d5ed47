"""Equations that may jump: where one changes at once, its derivative does not exist, and no state's rate can be computed from it."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy

from gearlib.equations.kernel import array_function, differentiated
from gearlib.equations.template import Relation, Template, column_symbol, relation_symbol
from gearlib.flatten.model import EquationGroup, FlatModel, Floats
from gearlib.language.expressions import real_symbol, time

SAMPLES = 16  # points of each switching surface at which both sides are compared
DECADES = 3.0  # they are drawn between 1e-3 and 1e3
BESIDE, AROUND = 1e-9, 1e-3  # relative distances at which the other relations hold, and over which the pieces vary
SMALL = 1e-9  # relative to the values around: a smaller difference is rounding
MOST_STEPS = 30  # of Newton's iteration towards a switching surface


def may_jump(model: FlatModel, e: int, times: int, parameters: Floats) -> bool:
    """Whether an equation or one of its derivatives below the order ``times`` changes at once where a relation or mode switches.

    Both sides of each relation's switching surface are compared at random points. What cannot be examined is taken to jump.
    """
    g, i = model.places[e]
    group = model.groups[g]
    modes = {real_symbol(name) for name in group.template.discretes if name != "initial()"}
    levels = [differentiated(group.template, level) for level in range(times)]
    return any(level.residual.free_symbols & modes for level in levels) or any(
        _differs(group, i, relation, level, parameters)
        for level in levels
        for j, relation in enumerate(group.template.relations)
        if relation_symbol(j) in level.residual.free_symbols
    )


def _differs(group: EquationGroup, i: int, relation: Relation, level: Template, parameters: Floats) -> bool:
    """Whether the two sides of a relation's switching surface differ in the residual of an equation or of its derivative."""
    template = group.template
    at = _samples(group, i, level, parameters)
    moving = sorted((relation.g.free_symbols & at.keys()) - {real_symbol(p) for p in template.parameters}, key=str)
    slopes = {s: sympy.diff(relation.g, s) for s in moving}
    across = next((s for s in moving if s not in slopes[s].free_symbols and slopes[s] != 0), moving[0] if moving else None)
    if across is None:
        return False  # parameters do not change during a run
    symbols = tuple(at)
    step = array_function(symbols, relation.g / slopes[across])
    holds = array_function(symbols, *(r.g if not r.negated else -r.g for r in template.relations), sympy.S.Zero)
    value = array_function((*symbols, *map(relation_symbol, range(len(template.relations)))), level.residual)
    with np.errstate(all="ignore"):
        for _ in range(MOST_STEPS):
            at[across] = at[across] - step(*at.values())
        surface, size = at[across], np.maximum(np.abs(at[across]), 1.0)
        values = []
        for side in (-1, 1):
            beside = holds(*(at | {across: surface + side * BESIDE * size}).values())[:-1]
            flags = [np.where(np.asarray(b) > 0, 1.0, 0.0) for b in beside]
            values += [value(*(at | {across: surface + x * size}).values(), *flags) for x in (0.0, side * AROUND)]
        left, right = values[0], values[2]
        close = np.abs(right - left) <= SMALL * np.max(np.abs(np.broadcast_arrays(*values)), axis=0)
    known = np.isfinite(left - right) & np.isfinite(surface)
    return not known.any() or bool((known & ~close).any())


def _samples(group: EquationGroup, i: int, level: Template, parameters: Floats) -> dict[Any, Any]:
    """Random values of time and of the variables of an equation, zero for those that are identically zero, and its parameters."""
    template, rng = group.template, np.random.default_rng(0)
    signs = dict(zip(template.locals, group.signs[i].tolist(), strict=True))
    found: dict[Any, Any] = {time: None}
    found.update({column_symbol(c): signs[c[0]] for c in (*template.columns, *template.relation_columns, *level.columns)})
    for symbol in found:
        sizes = 10.0 ** rng.uniform(-DECADES, DECADES, SAMPLES)
        found[symbol] = sizes if symbol == time else np.sign(rng.uniform(-1, 1, SAMPLES)) * sizes * abs(found[symbol])
    numbers = parameters[group.parameters[i]].tolist()
    return (
        found
        | {real_symbol(name): x for name, x in zip(template.parameters, numbers, strict=True)}
        | {real_symbol(name): 0.0 for name in template.discretes}
    )
