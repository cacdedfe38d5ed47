"""Equations that may jump: where one changes at once, its derivative does not exist, and no state's rate can be computed from it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy

from gearlib.equations.kernel import array_function, differentiated
from gearlib.equations.template import Template, column_symbol, relation_symbol, with_events, without_events
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
    return any(jumping(model.groups[g], i, level, parameters) for level in range(times))


def jumping(group: EquationGroup, i: int, level: int, parameters: Floats) -> list[int]:
    """The relations, and behind them the discrete variables, at whose switching an equation's derivative of an order may jump."""
    template = group.template
    derivative = differentiated(template, level)
    symbols, n = derivative.residual.free_symbols, len(template.relations)
    modes = [n + d for d, name in enumerate(template.discretes) if name != "initial()" and real_symbol(name) in symbols]
    found = [j for j in range(n) if relation_symbol(j) in symbols]
    return [*filter(_Sides(group, i, derivative, parameters).differ, found), *modes] if found else modes


def with_corners(model: FlatModel, counts: Sequence[int], parameters: Floats) -> dict[Template, Template]:
    """Templates that are differentiated where they change at once without an event, and others that have relations there."""
    found: dict[Template, Template] = {}
    for first, group in zip(model.first_equations, model.groups, strict=False):
        template, times = group.template, counts[first : first + len(group)]
        silent = without_events(template) if any(times) else []
        if silent:
            lifted, own = with_events(template, silent), len(template.relations)
            beside = group.take(np.arange(len(group)), lifted)
            jumps = {j for i, most in enumerate(times) for level in range(most) for j in jumping(beside, i, level, parameters)}
            if corners := sorted(jumps & set(range(own, len(lifted.relations)))):
                found[template] = with_events(template, [silent[j - own] for j in corners])
    return found


class _Sides:
    """Both sides of the switching surfaces of an equation's relations, for the equation or its derivative."""

    def __init__(self, group: EquationGroup, i: int, level: Template, parameters: Floats) -> None:
        template = group.template
        self.relations = template.relations
        self.at = _samples(group, i, level, parameters)
        self.still = {real_symbol(p) for p in template.parameters}
        symbols = tuple(self.at)
        self.holds = array_function(symbols, *(r.g if not r.negated else -r.g for r in template.relations), sympy.S.Zero)
        self.value = array_function((*symbols, *map(relation_symbol, range(len(template.relations)))), level.residual)

    def differ(self, j: int) -> bool:
        """Whether the two sides of a relation's switching surface differ in the residual."""
        g, at = self.relations[j].g, dict(self.at)
        moving = sorted((g.free_symbols & at.keys()) - self.still, key=str)
        slopes = {s: sympy.diff(g, s) for s in moving}
        across = next((s for s in moving if s not in slopes[s].free_symbols and slopes[s] != 0), moving[0] if moving else None)
        if across is None:
            return False  # parameters do not change during a run
        step = array_function(tuple(at), g / slopes[across])
        with np.errstate(all="ignore"):
            for _ in range(MOST_STEPS):
                at[across] = at[across] - step(*at.values())
            surface, size = at[across], np.maximum(np.abs(at[across]), 1.0)
            values = []
            for side in (-1, 1):
                beside = self.holds(*(at | {across: surface + side * BESIDE * size}).values())[:-1]
                flags = [np.where(np.asarray(b) > 0, 1.0, 0.0) for b in beside]
                values += [self.value(*(at | {across: surface + x * size}).values(), *flags) for x in (0.0, side * AROUND)]
            left, right = values[0], values[2]
            close = np.abs(right - left) <= SMALL * np.max(np.abs(np.broadcast_arrays(*values)), axis=0)
        known = np.isfinite(left - right) & np.isfinite(surface)
        return not known.any() or bool((known & ~close).any())


def _samples(group: EquationGroup, i: int, level: Template, parameters: Floats) -> dict[Any, Any]:
    """Random values of time, of an equation's variables, zero for those that are identically zero, and modes; and its parameters."""
    template, rng = group.template, np.random.default_rng(0)
    signs = dict(zip(template.locals, group.signs[i].tolist(), strict=True))
    found: dict[Any, Any] = {time: None}
    found.update({column_symbol(c): signs[c[0]] for c in (*template.columns, *template.relation_columns, *level.columns)})
    found.update({real_symbol(name): int(name != "initial()") for name in template.discretes})
    for symbol in found:
        sizes = 10.0 ** rng.uniform(-DECADES, DECADES, SAMPLES)
        found[symbol] = sizes if symbol == time else np.sign(rng.uniform(-1, 1, SAMPLES)) * sizes * abs(found[symbol])
    numbers = parameters[group.parameters[i]].tolist()
    return found | {real_symbol(name): x for name, x in zip(template.parameters, numbers, strict=True)}
