"""Corners at an operating point: where a comparison is just about to change, a derivative is that of one side."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.equations.kernel import array_function, differentiated
from gearlib.equations.template import Column, Template, column_symbol, memoised, relation_symbol, with_events, without_events
from gearlib.errors import GearlibWarning, warn
from gearlib.language.expressions import real_symbol, time
from gearlib.program.build import build
from gearlib.program.program import Program
from gearlib.reduce.coefficients import some
from gearlib.reduce.reduction import Structure
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
EQUAL = 1e-12  # of the terms compared: closer together they are equal but for rounding
SMALL = 1e-9  # of the slopes: a smaller difference is rounding
BESIDE = 1e-12  # relative distance from the point at which its sides are tried
APART = 1e-6  # of the derivatives, which differ by that much at least where a corner matters


class Corner(NamedTuple):
    """A comparison of equal values, with which the slopes of an equation change."""

    text: str  # the component, and what is compared
    place: int  # in the discrete state; -1 of a comparison without events
    sides: tuple[float, float]  # whether it holds in a direction, and in the opposite one


@dataclass(frozen=True)
class Sides:
    """What a linear model has on two sides of its point.

    Attributes
    ----------
    slopes : callable
        Matrices of derivatives with another discrete state, and beside the point: by which part of their size, or of 1, the slots differ.
    settled : callable
        The discrete state beside the point.
    jumps : callable
        Names of what jumps, from the discrete states of both sides and a way between them.
    """

    slopes: Callable[[Floats, Floats], list[Any]]
    settled: Callable[[Floats], Floats]
    jumps: Callable[[tuple[Floats, Floats], Floats], list[str]]


def warn_of_corners(
    structure: Structure, program: Program, parameters: Floats, t: float, discrete: Floats, slots: Callable[[Program], Floats],
    beside: Sides,
) -> None:  # fmt: skip
    """Warn of equations that jump at an operating point, or whose slopes differ on two sides of it, where that matters.

    Parameters
    ----------
    structure, program, parameters : Structure, Program, array
    t, discrete : float, array
        Time and discrete state at the point.
    slots : callable
        The values of a program's slots there.
    """
    comparing = _comparing(program, structure)
    if not comparing and not len(discrete):
        return
    nodes = {n for (g, k), rows in comparing.items() for n in _nodes(structure, g, k, rows)}
    # What only events compare has no slot in the program, but the states that it needs are among the program's
    known = program if nodes <= program.slots.keys() else build(structure, sorted(nodes), program.states, dynamic=False)
    values, random = slots(known), np.random.default_rng(0).uniform(0.5, 1.0, structure.model.n_variables)
    found = [
        corner
        for (g, k), rows in comparing.items()
        for corner in _corners(structure, g, k, rows, t, values, random, known.slots, parameters, discrete)
    ]
    way = np.zeros(program.n_slots)
    for (v, k), slot in program.slots.items():
        way[slot] = random[v] ** (1 + k)
    left, right = (beside.settled(side * BESIDE * way) for side in (1, -1))
    for corner in found:
        if corner.place >= 0:
            left[corner.place], right[corner.place] = corner.sides
    said = [corner.text for corner in found]
    first, model = structure.model.n_relations, structure.model
    said += [model.discretes[d] for d in np.flatnonzero((left != right)[first : first + len(model.discretes)]).tolist()]
    slopes = (beside.slopes(left, BESIDE * way), beside.slopes(right, -BESIDE * way)) if said else ([], [])
    if any(_differ(one, other) for one, other in zip(*slopes, strict=True)):
        what = f"corner in the equations of {some(list(dict.fromkeys(said)), ', ')}"
    elif jumping := beside.jumps((left, right), BESIDE * way):
        what = f"jump of {some(jumping, ', ')}"
    else:
        return
    warn(
        f"at this operating point there is a {what}: the linear model is that of one side, and holds for no vibration that reaches the "
        "other. Take a point beside it (at=...), or simulate",
        GearlibWarning,
    )


def _differ(one: Any, other: Any) -> bool:
    return bool(min(one.shape) and abs(one - other).max() > APART * max(abs(one).max(), abs(other).max()))


@memoised
def _comparing(program: Program, structure: Structure) -> dict[tuple[int, int], Integers]:
    """Equations of a program that compare variables: the rows by group and order of the derivative."""
    model = structure.model
    groups = {g for g, group in enumerate(model.groups) if _lifted(group.template).relations_on_variables}
    found: dict[tuple[int, int], list[int]] = defaultdict(list)
    if groups:
        given = {*program.states, *program.inputs, *structure.is_state}
        for e, k in sorted({structure.equation(n) for n in program.slots.keys() - given if structure.computes(n)}):
            g, i = model.places[e]
            if g in groups:
                found[g, k].append(i)
    return {place: np.array(rows) for place, rows in found.items()}


@memoised
def _lifted(template: Template) -> Template:
    """The template with relations in place of all comparisons."""
    silent = without_events(template)
    return with_events(template, silent) if silent else template


def _nodes(structure: Structure, g: int, k: int, rows: Integers) -> set[Node]:
    """What the equations and their comparisons contain, as far as it is computed."""
    group = structure.model.groups[g]
    lifted, own = _lifted(group.template), group.template.locals
    found = set()
    for name, order in {*differentiated(lifted, k).columns, *lifted.relation_columns}:
        j = own.index(name)
        nonzero = rows[group.signs[rows, j] != 0]
        found |= {(v, order) for v in group.variables[nonzero, j].tolist()}
    return {n for n in found if structure.computes(n)}


@memoised
def _functions(template: Template, k: int) -> tuple[tuple[Any, ...], Any, Any]:
    """Symbols; the compared expressions, the sizes of their terms and their slopes; the residual's slopes."""
    level = differentiated(template, k)
    columns = [column_symbol(c) for c in _columns(template, k)]
    symbols = (time, *columns, *map(real_symbol, (*template.parameters, *template.discretes)))
    compared = [r.g for r in template.relations]
    sizes = [sympy.Add(*map(sympy.Abs, sympy.Add.make_args(g))) for g in compared]
    slopes = [sympy.diff(g, s) for g in compared for s in columns]
    relations = map(relation_symbol, range(len(compared)))
    residual = [*(sympy.diff(level.residual, s) for s in columns), sympy.S.Zero]
    return symbols, array_function(symbols, *compared, *sizes, *slopes), array_function((*symbols, *relations), *residual)


def _columns(template: Template, k: int) -> list[Column]:
    """The variables of a template's derivative, and those that it compares."""
    return list(dict.fromkeys((*differentiated(template, k).columns, *template.relation_columns)))


def _corners(
    structure: Structure, g: int, k: int, rows: Integers, t: float, slots: Floats, random: Floats, places: Mapping[Node, int],
    parameters: Floats, discrete: Floats,
) -> list[Corner]:  # fmt: skip
    """The corners of some rows of a group, differentiated ``k`` times."""
    model, group = structure.model, structure.model.groups[g]
    own, template, count = group.template, _lifted(group.template), len(rows)
    symbols, compared, slopes = _functions(template, k)
    arguments: dict[Any, Floats] = {time: np.full(count, t)}
    moves = []
    for name, order in _columns(template, k):
        j = own.locals.index(name)
        v, sign = group.variables[rows, j], group.signs[rows, j]
        value = [slots[places[i, order]] if s else 0.0 for i, s in zip(v.tolist(), sign.tolist(), strict=True)]
        arguments[column_symbol((name, order))] = sign * np.array(value)
        moves.append(sign * random[v] ** (1 + order))
    arguments |= {real_symbol(name): parameters[group.parameters[rows, p]] for p, name in enumerate(own.parameters)}
    arguments |= {real_symbol(d): discrete[model.n_relations + group.discretes[rows, j]] for j, d in enumerate(own.discretes)}
    values = [arguments[s] for s in symbols]
    m, n = len(template.relations), len(own.relations)
    with np.errstate(all="ignore"):
        each = np.array([np.broadcast_to(x, count) for x in compared(*values)])
        rise = np.einsum("jcr,cr->jr", each[2 * m :].reshape(m, len(moves), count), np.array(moves))
        equal = (np.abs(each[:m]) <= EQUAL * each[m : 2 * m]) & (rise != 0)
        strict, negated = np.array([(r.strict, r.negated) for r in template.relations])[..., None].swapaxes(0, 1)
        above = np.where(negated, -each[:m], each[:m])
        holds = (above > 0) | (~strict & (above == 0))
        holds[:n] = discrete[model.first_relations[g] + rows * n + np.arange(n)[:, None]] != 0
        sides = [np.where(equal, (side * rise > 0) != negated, holds).astype(float) for side in (1, -1)]
        left, right = (np.array([np.broadcast_to(x, count) for x in slopes(*values, *side)]) for side in sides)
        differ = np.abs(right - left).max(axis=0) > SMALL * np.maximum(np.abs(left), np.abs(right)).max(axis=0)
    first = int(model.first_relations[g])
    return [
        Corner(
            f"{model.owner(g, int(rows[i]))} ({template.relations[j].g} = 0)",
            first + int(rows[i]) * n + j if j < n else -1,
            (float(sides[0][j, i]), float(sides[1][j, i])),
        )
        for i in np.flatnonzero(differ).tolist()
        for j in np.flatnonzero(equal[:, i]).tolist()
    ]
