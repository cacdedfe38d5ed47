"""Which variables follow from those that swing about their means, by equations alone, and what products of them an equation holds.

The mean of a product is not the product of the means. So a steady motion, which is one of means, has to know what swings with the phase
of a mesh or with time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import Kernel, partial_kernel
from gearlib.equations.template import Column, Template, memoised
from gearlib.flatten.model import EquationGroup, FlatModel, alphabetical
from gearlib.flatten.time_means import ripples
from gearlib.language.expressions import time

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Marked = tuple[NDArray[np.bool_], NDArray[np.bool_]]  # of all variables: values, and rates
Follower = tuple[int, int, int]  # group of equations, column that it determines, row


def products_in_time(model: FlatModel, parameters: Floats) -> list[str]:
    """Variables, by path, that follow from sinusoids of time, and whose square, product or comparison with such an equation holds."""
    swing = {g: ripples(group, parameters) for g, group in enumerate(model.groups) if group.template.timed}
    if not any(rows.any() for rows in swing.values()):
        return []
    open_ = np.zeros(model.n_variables, bool)
    open_[[determined(model, f) for f in followers_of(model, parameters, open_, swing).order]] = True
    found: dict[str, None] = {}
    count = np.bincount(np.concatenate([group.variables.ravel() for group in model.groups]), minlength=len(open_))
    alone = (count == 1) & ~model.flow & ~model.potential & (model.sign != 0)  # such as a loss that nothing depends on
    for group, i, v, _ in products(model, (open_, open_), (open_, open_)):
        if not alone[group.variables[i]].any():
            found[model.name(v)] = None
    return sorted(found, key=alphabetical)


def products(model: FlatModel, factors: Marked, beside: Marked) -> Iterator[tuple[EquationGroup, int, int, int]]:
    """Products, squares and conditions of variables: the group and row of the equation, one variable, and whether its rate stands there.

    One is of ``factors``, another of those ``beside``, each marked as values and as rates.
    """
    for group in model.groups:
        for name, order, others in nonlinear_terms(group.template):
            own = group.variables[:, place_of(group.template, name)]
            marked = [beside[min(rate, 1)][group.variables[:, place_of(group.template, other)]] for other, rate in others]
            among = np.array(marked, bool).reshape(-1, len(group)).any(axis=0)
            for i in np.flatnonzero(factors[min(order, 1)][own] & among).tolist():
                yield group, i, int(own[i]), order


@memoised
def nonlinear_terms(template: Template) -> tuple[tuple[str, int, frozenset[Column]], ...]:
    """What an equation holds that is not linear: a variable, its order, and the columns that its coefficient or condition depends on."""
    if template.linear:
        return ()
    pairs = [(*column, columns_of(partial_kernel(template, c))) for c, column in enumerate(template.columns)]
    pairs += [(*column, frozenset({column})) for column in template.relation_columns]
    return tuple(pairs)


@dataclass(frozen=True, eq=False)
class Followers:
    """Equations that determine a variable each, in ``order``; and of all variables, which ``turn``."""

    order: list[Follower]
    turn: NDArray[np.bool_]


def followers_of(
    model: FlatModel, parameters: Floats, moved: NDArray[np.bool_], swing: Mapping[int, NDArray[np.bool_]] | None = None
) -> Followers:
    """Equations that determine a variable from those that ``moved`` and from each other, or that ``swing`` by themselves.

    Where all else of an equation is known to follow or to be constant, it determines what is left. Speeds that follow from torques are
    never known so; then an equation is taken as it is written, for its only variable with the coefficient 1 or -1. Angles turn at
    constant speeds, unless a speed that swings with time is prescribed; so does what is linear in what ``moved``.
    """
    n = model.n_variables
    differentiated, rates = with_rates(model)
    deflections, turns = differentiated & ~rates, moved.copy()
    never = model.flow if swing is not None else model.flow | model.potential
    found: list[Follower] = []
    taken: set[tuple[int, int]] = set()  # an equation determines one variable
    reached, constant = moved.copy(), model.sign == 0
    while True:
        steady = turns | constant | model.potential
        sure: dict[int, Follower] = {}
        likely: dict[int, Follower] = {}
        still = np.zeros(n, bool)
        for g, group in enumerate(model.groups):
            template = group.template
            places = [(place_of(template, name), order) for name, order in (*template.columns, *template.relation_columns)]
            for c in _candidates(template):
                j, own = column_place(template, c), template.columns[c][1]
                v = group.variables[:, j]
                changes = group.variables[:, [k for k, order in places if order and (k != j or not own)]]
                others = group.variables[:, [k for k, order in places if not order and (k != j or own)]]
                varying = (reached & ~turns)[changes].any(axis=1) | (swing or {}).get(g, False)
                open_ = ~(reached | constant | never)[v]
                follows = open_ & (reached[others].any(axis=1) | varying) & (steady | reached)[changes].all(axis=1)
                alone = (reached | constant)[others].all(axis=1) & (slopes_of(group, c, parameters) != 0)
                at = {int(v[i]): (g, c, int(i)) for i in np.flatnonzero(follows) if (g, int(i)) not in taken}
                sure |= {x: f for x, f in at.items() if alone[f[2]] and (not own or swing is not None)}
                still[v[open_ & alone & ~follows & steady[changes].all(axis=1) & (not own and not template.timed)]] = True
                if c == _given(template):
                    free = ~((differentiated if changes.size else deflections) & ~(reached | constant))[others].any(axis=1)
                    free &= ~differentiated[v] & ~model.potential[v]
                    likely |= {x: f for x, f in at.items() if free[f[2]]}
        if not sure and (still > constant).any():
            constant |= still
        elif fresh := sure or likely:
            found += fresh.values()
            taken |= {(g, i) for g, _, i in fresh.values()}
            reached[list(fresh)] = True
            linear = {x: f for x, f in fresh.items() if model.groups[f[0]].template.linear and swing is None}
            turns[[x for x, f in linear.items() if (turns | constant)[others_of(model, f)].all()]] = True
        else:
            return Followers(found, turns)


def with_rates(model: FlatModel) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which variables have a rate in an equation, and which stand in one beside a rate."""
    differentiated, beside = np.zeros((2, model.n_variables), bool)
    for group in model.groups:
        if any(order for _, order in group.template.columns):
            for name, order in group.template.columns:
                (differentiated if order else beside)[group.variables[:, place_of(group.template, name)]] = True
    return differentiated, beside


@memoised
def _candidates(template: Template) -> tuple[int, ...]:
    """The columns that an equation may determine: those whose coefficients depend on nothing but parameters; a rate only if it is alone."""
    in_conditions = {name for name, _ in template.relation_columns}
    in_rates = {name for name, order in template.columns if order}
    found = []
    for c, (name, order) in enumerate(template.columns):
        kernel, alone = partial_kernel(template, c), not order or len(in_rates) == 1
        depends = kernel.columns or kernel.relations or time in template.slopes[c].free_symbols
        if alone and not depends and name not in in_conditions and (order or name not in in_rates):
            found.append(c)
    return tuple(found)


@memoised
def _given(template: Template) -> int | None:
    """The column that an equation is written for: the only value with the coefficient 1 or -1."""
    slopes = enumerate(zip(template.slopes, template.columns, strict=True))
    alone = [c for c, (slope, (_, order)) in slopes if not order and slope.is_number and abs(float(slope)) == 1.0]
    return alone[0] if len(alone) == 1 and alone[0] in _candidates(template) else None


def slopes_of(group: EquationGroup, c: int, parameters: Floats) -> Floats:
    """The coefficients of a column that `_candidates` names, one for each equation."""
    zero = np.zeros(len(group))
    return group.values(partial_kernel(group.template, c), 0.0, lambda *_: zero, parameters, lambda _: zero)


def determined(model: FlatModel, follower: Follower) -> int:
    """The variable that a (group, column, row) determines."""
    g, c, i = follower
    return int(model.groups[g].variables[i, column_place(model.groups[g].template, c)])


def others_of(model: FlatModel, follower: Follower) -> Integers:
    """The variables of an equation except the determined one."""
    g, c, i = follower
    return np.delete(model.groups[g].variables[i], column_place(model.groups[g].template, c))


def rates_of(group: EquationGroup) -> Integers:
    """The variables whose rates stand in a group's equations, shape (equations, rates)."""
    template = group.template
    columns = (*template.columns, *template.relation_columns)
    return group.variables[:, [place_of(template, name) for name, order in columns if order]]


def column_place(template: Template, c: int) -> int:
    """Place of a column, or of one that only conditions hold (numbered behind the columns), among the locals."""
    return place_of(template, (*template.columns, *template.relation_columns)[c][0])


def place_of(template: Template, name: str) -> int:
    return template.locals.index(name)


def columns_of(kernel: Kernel) -> frozenset[Column]:
    """The columns that a kernel depends on, including through its conditions."""
    template = kernel.template
    columns = [*template.columns, *template.relation_columns]
    compared = template.relation_columns if any(c < len(template.relations) for c in kernel.relations) else ()
    return frozenset([*(columns[c] for c in kernel.columns), *compared])
