"""Gaps closed in steady motion: contact sides where a speed is prescribed and a torque is unknown.

An open gap decouples its two sides. A motion in which they turn at different speeds is not permanent: the gap closes. With a load on
one side there is no torque balance until it has. Each such gap is tried closed on either side; a contact is valid if it is compressed,
according to the conditions in the gap's own equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import partial_kernel, relation_kernel, residual_kernel
from gearlib.errors import ArgumentError
from gearlib.flatten.model import EquationGroup, FlatModel
from gearlib.statics.mesh_turn import apply, argument, periodic_columns
from gearlib.statics.steady_motion import CONTRADICTION, UNDETERMINED, Given, Motion, motion_from

Floats = NDArray[np.float64]
STILL = 1e-9  # relative to the fastest rate: rounding
STEADY = 1e-6  # relative: how evenly a relation's value must grow to be sure to change sign
FURTHER = np.array([1.3, 17.0, 230.0, 3100.0])  # rad or m: ways of the fastest, over which what is steady stays so
APART = 1.0  # rad or m: distance larger than any gap
MOST_TRIALS = 64  # combinations of sides: all of six gaps with two each


def with_gaps_closed(model: FlatModel, parameters: Floats, given: Sequence[Given], motion: Motion) -> Motion:
    """The motion itself if it is permanent, else one with gaps closed, all by a load of either sense first, else the motion again."""
    if not drifting(model, parameters, motion) and not (motion.residual > CONTRADICTION).any():
        return motion
    n = model.n_variables
    compared = np.unique(np.array([v for g, c in comparing(model) for v in compared_by(model, g, c)], np.int64))
    gaps = compared[(motion.undetermined[compared] > UNDETERMINED) & ~model.flow[compared] & ~model.potential[compared]]
    way = np.sign(without_rounding(motion.rates)[gaps])
    side = np.where(way == 0.0, np.sign(way.sum()) or 1.0, way)
    for others, sense in islice(product(product((1.0, -1.0), repeat=max(len(gaps) - 1, 0)), (1.0, -1.0)), MOST_TRIALS):
        x = np.concatenate([motion.constants, motion.rates])
        x[gaps] = APART * sense * side * np.array([1.0, *others])[: len(gaps)]
        x[n + gaps] = 0.0
        found = motion_from(model, parameters, given, x)
        if not (found.residual > CONTRADICTION).any() and not drifting(model, parameters, found):
            return found
    return motion


def refuse_drift(model: FlatModel, parameters: Floats, motion: Motion, given: Sequence[Given]) -> None:
    """Raise an error where a condition, such as that of a gap, will change as the train turns on."""
    passing = drifting(model, parameters, motion)
    if passing:
        raise ArgumentError(
            f"no steady motion has the given {', '.join(g.name for g in given) or 'torques'}: in {', '.join(passing[:4])} a gap is "
            "open between sides that turn at different speeds, or another condition changes as the train turns on. Give fewer speeds, "
            "or close the gap (its backlash parameter = 0)"
        )


def drifting(model: FlatModel, parameters: Floats, motion: Motion) -> list[str]:
    """Components with a relation that will change eventually: its value grows evenly towards zero."""
    a, b, found = motion.constants, without_rounding(motion.rates), []
    if not b.any():
        return []
    for g, c in comparing(model):
        group = groups(model)[g]
        relation, kernel = group.template.relations[c], relation_kernel(group.template, c)
        at = (a, a + b, a + 2.0 * b)
        value, later, last = (apply(model, kernel, g, group, parameters, x, b, motion.discrete) for x in at)
        growth = later - value
        with np.errstate(invalid="ignore"):
            evenly = np.abs(last - later - growth) <= STEADY * np.abs(growth)
        away = (growth > 0.0) != (motion.discrete[values_at(model, g, c)] != relation.negated)
        wrong = np.isfinite(growth) & (growth != 0.0) & evenly & away
        found += [model.instances[i].name for i in group.owners[wrong].tolist() if i >= 0]
    return list(dict.fromkeys(found))


def refuse_change(model: FlatModel, parameters: Floats, motion: Motion, given: Sequence[Given]) -> None:
    """Raise an error where an equation holds no more at other angles, and does not repeat: a table, say, that begins flat."""
    a, b, found = motion.constants, without_rounding(motion.rates), []
    periodic = periodic_columns(model, parameters, a, b, motion.discrete, np.zeros(len(a), bool)) if b.any() else {}
    for g, group in enumerate(model.groups):
        template = group.template
        if template.linear or g in periodic or not b[group.variables].any():
            continue
        kernels = [residual_kernel(template), *(partial_kernel(template, c) for c in range(len(template.columns)))]
        here = apply(model, kernels[0], g, group, parameters, a, b, motion.discrete)
        for way in FURTHER / np.abs(b).max():
            x = a + way * b
            there, *slopes = (apply(model, kernel, g, group, parameters, x, b, motion.discrete) for kernel in kernels)
            terms = sum(np.abs(p * argument(group, *column, x, b)) for p, column in zip(slopes, template.columns, strict=True))
            found += [model.owner(g, i) for i in np.flatnonzero(np.abs(there - here) > CONTRADICTION * terms).tolist()]
    if found:
        raise ArgumentError(
            f"no steady motion has the given {', '.join(g.name for g in given) or 'torques'}: the equations of "
            f"{', '.join(list(dict.fromkeys(found))[:4])} change as the train turns on, and do not repeat every turn; give speeds with "
            "which it stands still, or make them periodic"
        )


def without_rounding(rates: Floats) -> Floats:
    """The rates with rounding set to zero."""
    moving: Floats = np.where(np.abs(rates) > STILL * np.abs(rates).max(initial=0.0), rates, 0.0)
    return moving


def groups(model: FlatModel) -> list[EquationGroup]:
    """Groups of equations, and of updates of discrete variables."""
    return [*model.groups, *(u.equations for u in model.updates)]


def comparing(model: FlatModel) -> list[tuple[int, int]]:
    """Group and column of every relation that compares variables."""
    return [
        (g, c)
        for g, group in enumerate(groups(model))
        for c in range(len(group.template.relations))
        if relation_kernel(group.template, c).columns
    ]


def compared_by(model: FlatModel, g: int, c: int) -> list[int]:
    """The variables that a relation compares."""
    group = groups(model)[g]
    columns = [*group.template.columns, *group.template.relation_columns]
    names = [columns[k][0] for k in relation_kernel(group.template, c).columns if columns[k][1] == 0]
    return [v for name in names for v in group.variables[:, group.template.locals.index(name)].tolist()]


def values_at(model: FlatModel, g: int, c: int) -> NDArray[np.int64]:
    """Indices of the values of a relation in the discrete state."""
    group = groups(model)[g]
    places: NDArray[np.int64] = model.first_relations[g] + np.arange(len(group)) * len(group.template.relations) + c
    return places
