"""Averages of equations over one period of the mesh phases.

The phase of a mesh grows without bound, and its transmission error, stiffness and friction are periodic in it. The speeds and torques
of a steady motion are averages over that period. An equation rarely contains the phase itself: a table depends on the phase within its
period, friction on the sliding speed of a pair, which follows from it. Variables that follow from the phases and the speeds alone are
evaluated along the period, in dependency order; a deflection is not among them, since it adapts so that its force stays what the
torques require.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import Kernel, partial_kernel, relation_kernel, residual_kernel
from gearlib.equations.template import Template, memoised
from gearlib.errors import ModelError
from gearlib.flatten.followers import (
    Follower,
    column_place,
    columns_of,
    determined,
    followers_of,
    others_of,
    products,
    rates_of,
    slopes_of,
    with_rates,
)
from gearlib.flatten.model import EquationGroup, FlatModel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
PARTS = 4096  # midpoints per period: the slope of a cubic spline is averaged to 1e-11 of its size, a jump to 1/4096 of its size
MIXED = 4099  # points where phases of different rates meet: a prime number, so that each phase takes as many values
GENERATOR = 2533  # MIXED over the golden ratio: steps of rates without a common period
COMMON = 64  # largest ratio of rates with a common period; beyond it, only harmonics of higher orders would tell
REPEATS = 1e-9  # relative to the change over one point: a smaller remainder after a full period is rounding


@dataclass(frozen=True, eq=False)
class Turn:
    """Values of phase-dependent variables over one mesh period, shape (variables, points); ``place`` is a variable's row, or -1."""

    place: Integers
    values: Floats

    def moves(self, group: EquationGroup, name: str) -> bool:
        return bool((self.place[group.variables[:, group.template.locals.index(name)]] >= 0).any())

    def argument(self, group: EquationGroup, name: str, order: int, a: Floats, b: Floats) -> Floats:
        """Values of a column, shape (equations, points), or (equations, 1) if it does not depend on the phases."""
        plain = argument(group, name, order, a, b)[:, None]
        if order or not self.moves(group, name):
            return plain
        j = group.template.locals.index(name)
        place = self.place[group.variables[:, j]]
        moved = self.values[np.maximum(place, 0)] * group.signs[:, [j]]
        return np.where(place[:, None] >= 0, moved, plain)


def argument(group: EquationGroup, name: str, order: int, a: Floats, b: Floats) -> Floats:
    """Values of a group's column in the motion at t = 0."""
    j = group.template.locals.index(name)
    source = a if order == 0 else b
    values: Floats = source[group.variables[:, j]] * group.signs[:, j] if order < 2 else np.zeros(len(group))
    return values


def apply(
    model: FlatModel, kernel: Kernel, g: int, group: EquationGroup, parameters: Floats, a: Floats, b: Floats, discrete: Floats
) -> Floats:
    """Values of a group's kernel at t = 0, with the discrete state unchanged."""
    return group.values(
        kernel, 0.0, lambda name, order: argument(group, name, order, a, b), parameters,
        lambda c: _discrete_value(model, kernel.template, g, group, c, discrete),
    )  # fmt: skip


def generic(a: Floats) -> Floats:
    """Generic nearby constants, at which nothing vanishes by coincidence."""
    return a + np.random.default_rng(1).uniform(0.5, 1.5, len(a))


def mean(
    model: FlatModel, kernel: Kernel, g: int, group: EquationGroup, parameters: Floats, a: Floats, b: Floats, discrete: Floats,
    over: Turn | None,
) -> Floats:  # fmt: skip
    """Mean of a kernel over a period; a linear equation holds for the means."""
    if over is None or group.template.linear or not _depends(kernel, group, over):
        return apply(model, kernel, g, group, parameters, a, b, discrete)
    return np.asarray(_through(model, kernel, g, group, parameters, a, b, discrete, over).mean(axis=1), float)


@dataclass(frozen=True, eq=False)
class Periodic:
    """Which equations of a group repeat every turn of a column, and which ``grow`` by the same amount, as ``x + sin(x)`` does."""

    turns: NDArray[np.bool_]
    grow: NDArray[np.bool_]


def periodic_columns(
    model: FlatModel, parameters: Floats, a: Floats, b: Floats, discrete: Floats, still: NDArray[np.bool_]
) -> dict[int, dict[int, Periodic]]:
    """Columns, by group of equations, in which these repeat every turn: phases of meshes, angles of universal joints.

    The other variables get arbitrary values, so that none of them hides a dependence on the phase. What stands ``still`` does not turn,
    nor by itself does what follows from phases or from numbers, as ``x`` in ``x = 0.5 sin(phase)``.
    """
    grow: dict[int, dict[int, NDArray[np.bool_]]] = {}
    elsewhere = generic(a)
    for g, group in enumerate(model.groups):
        if group.template.linear:
            continue
        template = group.template
        compared = [len(template.columns) + k for k, (_, order) in enumerate(template.relation_columns) if order == 0]
        columns = {
            c: _repeats(model, g, group, c, parameters, elsewhere, b, discrete)
            for c in (*nonlinear_columns(template), *compared)
        }
        if repeating := {c: grows for c, grows in columns.items() if grows is not None}:
            grow[g] = repeating
    angles = np.zeros(model.n_variables, bool)
    for g, repeating in grow.items():
        for c in repeating:
            angles[model.groups[g].variables[:, column_place(model.groups[g].template, c)]] = True
    angles &= ~still
    free, followers = angles & (model.potential | with_rates(model)[0]), np.zeros_like(angles)
    if (angles & ~free).any():
        followers[[determined(model, f) for f in followers_of(model, parameters, free).order]] = True
    found: dict[int, dict[int, Periodic]] = {}
    for g, repeating in grow.items():
        for c, grows in repeating.items():
            own = model.groups[g].variables[:, column_place(model.groups[g].template, c)]
            if angles[own].any():
                found.setdefault(g, {})[c] = Periodic((angles & ~followers)[own], grows)
    return found


def phases_of(model: FlatModel, periodic: Mapping[int, Mapping[int, Periodic]]) -> NDArray[np.bool_]:
    """Variables over whose turns equations are averaged."""
    found = np.zeros(model.n_variables, bool)
    for g, columns in periodic.items():
        for c, column in columns.items():
            found[model.groups[g].variables[column.turns, column_place(model.groups[g].template, c)]] = True
    return found


@memoised
def nonlinear_columns(template: Template) -> tuple[int, ...]:
    """Columns in which the equation is not linear, other than derivatives."""
    kernel = residual_kernel(template)
    return tuple(
        c for c, (_, order) in enumerate(template.columns)
        if order == 0 and c in kernel.columns and c in partial_kernel(template, c).columns
    )  # fmt: skip


def _repeats(
    model: FlatModel, g: int, group: EquationGroup, c: int, parameters: Floats, a: Floats, b: Floats, discrete: Floats
) -> NDArray[np.bool_] | None:
    """Which equations of a group grow in a turn of a column; None if neither the equations nor their conditions repeat in it."""
    template = group.template
    places = np.unique(group.variables[:, column_place(template, c)])

    def in_a_turn(kernel: Kernel) -> tuple[bool, NDArray[np.bool_] | None]:
        """Whether a kernel varies, and which rows grow; None if it is not the same in another turn, or does nothing but grow."""
        values = []
        for turned in (0.0, 2 * np.pi, -4.0, -4.0 + 2 * np.pi, 1.0):
            x = a.copy()
            x[places] += turned
            values.append(apply(model, kernel, g, group, parameters, x, b, discrete))
        growth, varies = values[1] - values[0], float(np.abs(values[2] - values[0]).max())
        if varies <= REPEATS * float(np.abs(values).max()):
            return False, None
        same = np.abs(values[3] - values[2] - growth).max() <= REPEATS * varies
        ripple = np.abs(values[4] - values[0] - growth / (2 * np.pi)).max()  # none: the magnitude of a force far from zero
        return True, np.asarray(np.abs(growth) > REPEATS * varies, bool) if same and ripple > REPEATS * varies else None

    varies, grows = in_a_turn(residual_kernel(template))
    if grows is not None:
        turns = model.potential[places] | (b[places] != 0.0)
        return grows if turns.all() or not grows.any() else None
    if varies:
        return None
    compared = (in_a_turn(relation_kernel(template, k))[1] for k in range(len(template.relations)))
    return np.zeros(len(group), bool) if any(grows is not None and not grows.any() for grows in compared) else None


def turn(
    model: FlatModel, parameters: Floats, periodic: Mapping[int, Mapping[int, Periodic]], a: Floats, b: Floats, discrete: Floats
) -> Turn | None:
    """Variation of phase-dependent variables over a common period; each value has the same mean as in the motion."""
    n = model.n_variables
    seeds = np.flatnonzero(phases_of(model, periodic))
    if not len(seeds):
        return None
    place = np.full(n, -1, np.int64)
    place[seeds] = np.arange(len(seeds))
    known = followers_of(model, parameters, place >= 0)
    followers, turns = known.order, known.turn
    steps = _steps(model, seeds, followers, b)
    points = PARTS if (steps == 1).all() else MIXED
    angle = 2 * np.pi * ((np.arange(points) + 0.5) / points - 0.5)
    begin, begun, sign = np.zeros(n), model.representative[model.started], model.sign[model.started]
    begin[begun] = sign * parameters[model.start_slots]  # two phases of one rate keep their difference
    over = Turn(place, np.where(a == 0, begin, a)[seeds][:, None] + steps[:, None] * angle)
    open_ = np.zeros(n, bool)
    open_[[determined(model, f) for f in followers]] = True
    of_rates = np.zeros(n, bool)
    of_rates[
        [determined(model, (g, c, i)) for g, c, i in followers if (open_ & ~turns)[rates_of(model.groups[g])[i]].any()]
    ] = True
    # Those of an algebraic loop or of rates are left: their means will do where they enter linearly
    while ready := [f for f in followers if not (open_[others_of(model, f)].any() or of_rates[determined(model, f)])]:
        for g, c in dict.fromkeys((g, c) for g, c, _ in ready):
            rows = np.array([i for other, _, i in ready if other == g], np.int64)
            group = model.groups[g]
            j = column_place(group.template, c)
            v = group.variables[rows, j]
            rest = _through(model, residual_kernel(group.template), g, group, parameters, a, b, discrete, over)[rows]
            scale = (group.signs[:, j] / slopes_of(group, c, parameters))[rows, None]
            change = -(rest - rest.mean(axis=1, keepdims=True)) * scale
            place[v] = len(over.values) + np.arange(len(v))
            over = Turn(place, np.concatenate([over.values, a[v][:, None] + change]))
            open_[v] = False
        followers = [f for f in followers if f not in set(ready)]
    while behind := [f for f in followers if of_rates[others_of(model, f)].any() and not of_rates[determined(model, f)]]:
        of_rates[[determined(model, f) for f in behind]] = True
    moved = open_ | (over.place >= 0)
    _refuse_unknown(model, moved, moved & ~turns, open_, of_rates)
    return over


def _steps(model: FlatModel, seeds: Integers, followers: list[Follower], b: Floats) -> Integers:
    """How often each phase turns while the points are gone through: as their rates are to each other, where equations mix phases.

    Rates without a common period get steps of a lattice rule, by which each combination of phases comes as often as any other
    (N. M. Korobov, 1959; see I. H. Sloan, S. Joe, "Lattice methods for multiple integration", 1994).
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    moved = np.zeros(model.n_variables, bool)
    moved[seeds] = moved[[determined(model, f) for f in followers]] = True
    together = [np.concatenate([[determined(model, f)], others_of(model, f)]) for f in followers]
    for v in (group.variables for group in model.groups if not group.template.linear):
        together += [*v[moved[v].sum(axis=1) > 1]]
    pairs = [(meeting[0], v) for row in together for meeting in [row[moved[row]]] for v in meeting[1:]]
    ends = np.array(pairs, np.int64).reshape(-1, 2).T
    n = len(moved)
    part = connected_components(csr_matrix((np.ones(len(pairs)), (ends[0], ends[1])), shape=(n, n)), directed=False)[1][seeds]
    steps = np.ones(len(seeds), np.int64)
    for number in np.flatnonzero(np.bincount(part) > 1):
        places = np.flatnonzero(part == number)
        steps[places] = steps_of(b[seeds[places]])
    return steps


def steps_of(rates: Floats) -> Integers:
    """Whole numbers as the rates are to each other; beside them, times ``GENERATOR``, those of other rates without a common period.

    >>> steps_of(np.array([10.0, -10.0, 15.0, 20.0, np.pi])).tolist()
    [2, -2, 3, 4, 2533]
    """
    steps, first = np.zeros(len(rates), np.int64), 1
    while len(left := np.flatnonzero(steps == 0)):
        base, common, alike = rates[left[0]], 1, {left[0]: Fraction(1)}
        for k in left[1:] if base else ():
            ratio = Fraction(rates[k] / base).limit_denominator(COMMON)
            together = math.lcm(common, ratio.denominator)
            near = abs(rates[k] - float(ratio) * base) <= REPEATS * abs(rates[k])
            if near and 0 < abs(ratio) <= COMMON and together <= COMMON:
                alike[k], common = ratio, together
        for k, ratio in alike.items():
            steps[k] = int(ratio * common) * first
        first = first * GENERATOR % MIXED
    return steps


def _refuse_unknown(
    model: FlatModel, moved: NDArray[np.bool_], vary: NDArray[np.bool_], open_: NDArray[np.bool_], of_rates: NDArray[np.bool_]
) -> None:
    """Refuse products, squares and conditions of variables that determine each other, or of rates of those that ``vary``."""
    for group, _, v, order in products(model, (open_, vary), (moved, vary)):
        loop = "follows from equations that have to be solved together at each phase; solve them for it"
        known = "follows from rates that vary with the phase" if of_rates[v] else loop
        why = f"{model.name(v)} {'has a rate that varies with the phase' if order else known}"
        raise ModelError(f"{group.template.label}: its mean over a turn of the mesh is not known, since {why}")


def _depends(kernel: Kernel, group: EquationGroup, over: Turn) -> bool:
    """Whether phase-dependent variables affect a kernel, including through its conditions."""
    return any(over.moves(group, name) for name, order in columns_of(kernel) if not order)


def _through(
    model: FlatModel, kernel: Kernel, g: int, group: EquationGroup, parameters: Floats, a: Floats, b: Floats, discrete: Floats,
    over: Turn,
) -> Floats:  # fmt: skip
    """Values of a kernel over a period, shape (equations, points), with phase-dependent conditions evaluated at each point."""
    template, shape = kernel.template, (len(group), over.values.shape[1])
    columns = [*template.columns, *template.relation_columns]
    arguments = [over.argument(group, *columns[c], a, b) for c in kernel.columns]
    constants = [parameters[group.parameters[:, p]][:, None] for p in kernel.parameters]
    flags = []
    for c in kernel.relations:
        compared = relation_kernel(template, c) if c < len(template.relations) else None
        if compared is not None and _depends(compared, group, over):
            relation = template.relations[c]
            value = _through(model, compared, g, group, parameters, a, b, discrete, over)
            value = -value if relation.negated else value
            flags.append((value > 0 if relation.strict else value >= 0).astype(float))
        else:
            flags.append(_discrete_value(model, template, g, group, c, discrete)[:, None])
    with np.errstate(all="ignore"):
        value = kernel.function(0.0, *(np.broadcast_to(x, shape) for x in (*arguments, *constants, *flags)))
    return np.broadcast_to(np.asarray(value, float), shape)


def _discrete_value(model: FlatModel, template: Template, g: int, group: EquationGroup, c: int, discrete: Floats) -> Floats:
    """Value of a relation (or, beyond these, a discrete variable) of a group."""
    n = len(template.relations)
    if c < n:
        return np.asarray(discrete[model.first_relations[g] + np.arange(len(group)) * n + c], float)
    return np.asarray(discrete[model.n_relations + group.discretes[:, c - n]], float)
