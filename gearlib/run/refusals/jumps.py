"""Refusal of discontinuities in differentiated equations, where a rigid constraint would need an infinite torque.

What depends on time alone is examined before a run (`refuse_jumps`), what depends on variables at its events (`refuse_switches`),
or between its samples where the run did not need it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.arguments import shown
from gearlib.equations.kernel import array_function, differentiated
from gearlib.equations.quasipolynomials import TIME, OutsideClassError
from gearlib.equations.switch_times import distinct, switch_times
from gearlib.equations.template import Template, column_symbol, memoised, relation_symbol
from gearlib.errors import ModelError
from gearlib.language.expressions import real_symbol
from gearlib.program.program import Program
from gearlib.program.relations import Jump, differentiated_uses, jumps_below
from gearlib.reduce.reduction import Structure
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Function = Callable[..., Any]  # of time and the parameters
MOST = 50  # switches that are examined
SMALL = 1e-9  # relative to the values on both sides: a smaller difference is rounding
BESIDE = 1e-2  # of the time to the adjacent events: where the sides of an event are compared
SET = 3.0  # times the change in as long a time just before: by more, an event has set a state
KINDS = ("a jump", "a kink")


def refuse_jumps(structure: Structure, program: Program, parameters: Floats, t0: float, t1: float) -> None:
    """Raise an error where a program differentiates an equation at a time at which it jumps.

    Only equations whose relations compare nothing but time are examined, and only jumps that depend on nothing else.

    Raises
    ------
    ModelError
        Names the component, the equation or variable, and the time.
    """
    uses, decisive = differentiated_uses(structure, program)
    key = parameters[decisive].tobytes() + np.array([t0, t1]).tobytes()
    if key != program.memo.get(refuse_jumps):
        for e, order in uses:
            _check(structure, e, order, parameters, t0, t1)
        program.memo[refuse_jumps] = key


@dataclass(frozen=True)
class SampledMotion:
    """A run at some times: the discrete state there, shape (times, entries), and what gives the history of a variable."""

    structure: Structure
    parameters: Floats
    time: Floats
    discrete: Floats
    history: Callable[[Node], Floats]


def refuse_switches(
    structure: Structure, program: Program, parameters: Floats, begin: float, events: Floats, end: float,
    sampled: Callable[[Floats], SampledMotion],
) -> None:  # fmt: skip
    """Raise an error where an event of a run made a differentiated equation jump, unless it set states (`gl.reinit`).

    Parameters
    ----------
    structure, program, parameters : Structure, Program, array
        What was integrated.
    begin, events, end : float, array, float
        Times, s.
    sampled : callable
        The run at other times.

    Raises
    ------
    ModelError
        As `refuse_jumps`.
    """
    if jumps := jumps_below(structure, program, parameters):
        gaps = BESIDE * np.diff([begin, *events, end])
        near = np.array([events - 2 * gaps[:-1], events - gaps[:-1], events, events + gaps[1:]])
        found = sampled(np.union1d(near, [begin, end]))
        places = np.searchsorted(found.time, near)
        states = np.array([found.history(state) for state in program.states]).reshape(-1, len(found.time))
        usual, last = np.abs(np.diff(states[:, places[:3]], axis=1)).swapaxes(0, 1)
        of_size = np.abs(states).max(axis=1, keepdims=True)
        smooth = np.flatnonzero((last <= SET * usual + SMALL * of_size).all(axis=0))
        when = [f"at t = {t:.9g} s" for t in events[smooth]]
        _refuse_between(found, jumps, places[1, smooth], places[3, smooth], when)


def refuse_switches_between(found: SampledMotion, program: Program) -> None:
    """As `refuse_switches`, for a program that is evaluated at samples, whose events the run did not need."""
    jumps = jumps_below(found.structure, program, found.parameters)
    if jumps and len(found.time) > 1:
        places = np.arange(len(found.time))
        when = [f"between t = {a:.6g} s and t = {b:.6g} s" for a, b in pairwise(found.time.tolist())]
        _refuse_between(found, jumps, places[:-1], places[1:], when)


def _refuse_between(found: SampledMotion, jumps: list[Jump], before: Integers, after: Integers, when: list[str]) -> None:
    """Refuse jumps between pairs of samples: there the equation differs with the discrete states of the two, alike on both sides."""
    for e, level, entries in jumps:
        changed = (found.discrete[np.ix_(before, entries)] != found.discrete[np.ix_(after, entries)]).any(axis=1)
        if not changed.any():
            continue
        one, other = before[changed], after[changed]
        left, right = (
            _residual(found, e, level, side, found.discrete[other]) - _residual(found, e, level, side, found.discrete[one])
            for side in (one, other)
        )
        with np.errstate(all="ignore"):
            rounding = SMALL * np.max(np.abs([left, right]))
            differ = (np.sign(left) == np.sign(right)) & (np.minimum(np.abs(left), np.abs(right)) > rounding)
        if differ.any():
            g, i = found.structure.model.places[e]
            raise _refused(found.structure, g, i, when[np.flatnonzero(changed)[np.argmax(differ)]], level)


def _residual(found: SampledMotion, e: int, level: int, samples: Integers, discrete: Floats) -> Floats:
    """An equation's derivative of an order at some samples, with a discrete state for each."""
    model = found.structure.model
    g, i = model.places[e]
    group, at = model.groups[g], differentiated(model.groups[g].template, level)
    own, n = group.template, len(group.template.relations)
    known: dict[Any, Any] = {TIME: found.time[samples]}
    for name, order in at.columns:
        j = own.locals.index(name)
        v, sign = int(group.variables[i, j]), int(group.signs[i, j])
        known[column_symbol((name, order))] = sign * found.history((v, order))[samples] if sign else np.zeros(len(samples))
    known |= zip(map(real_symbol, own.parameters), found.parameters[group.parameters[i]], strict=True)
    first = int(model.first_relations[g]) + i * n
    known |= {relation_symbol(j): discrete[:, first + j] for j in range(n)}
    known |= {
        real_symbol(name): discrete[:, model.n_relations + d] for name, d in zip(own.discretes, group.discretes[i], strict=True)
    }
    with np.errstate(all="ignore"):
        return np.broadcast_to(array_function(tuple(known), at.residual)(*known.values()), len(samples))


def _check(structure: Structure, e: int, used: int, parameters: Floats, t0: float, t1: float) -> None:
    """Check one equation: the expressions under its derivatives, order by order."""
    g, i = structure.model.places[e]
    group = structure.model.groups[g]
    template, numbers = group.template, list(parameters[group.parameters[i]])
    symbols = tuple(sympy.Symbol(name, real=True) for name in template.parameters)
    timed = [(j, r) for j, r in enumerate(template.relations) if r.g.free_symbols <= {TIME, *symbols}]
    times = _times([r.g.xreplace(dict(zip(symbols, map(_float, numbers), strict=True))) for _, r in timed], t0, t1)
    for level in range(used if times else 0):
        for last, t, following in zip([t0, *times], times[:MOST], [*times[1:], t1], strict=False):
            middles = 0.5 * (last + t), 0.5 * (t + following)  # nothing switches between adjacent times
            sides = [tuple((j, _holds(template, j, symbols, numbers, middle)) for j, _ in timed) for middle in middles]
            pieces = _pieces(differentiated(template, level), symbols, *sides)
            if pieces is not None and _jump(pieces, numbers, t, (last, following)):
                raise _refused(structure, g, i, f"at t = {t:.9g} s", level)


def _float(number: float) -> Any:
    return sympy.Float(number, 17)


def _times(expressions: list[Any], t0: float, t1: float) -> list[float]:
    try:
        found = [switch_times(x > 0, t0, t1) for x in expressions]
    except OutsideClassError:
        return []
    times: list[float] = distinct(np.concatenate([np.empty(0), *found]), t0, t1).tolist()
    return times


def _holds(template: Template, j: int, symbols: tuple[Any, ...], numbers: list[float], t: float) -> int:
    relation = template.relations[j]
    with np.errstate(all="ignore"):
        value = float(_compared(template, j, symbols)(np.float64(t), *numbers))
    return int(value < 0 if relation.negated else value > 0)


@memoised
def _compared(template: Template, j: int, symbols: tuple[Any, ...]) -> Function:
    """The event function of a relation, as a function of time and the parameters."""
    return array_function((TIME, *symbols), template.relations[j].g)


@memoised
def _pieces(template: Template, symbols: tuple[Any, ...], *sides: tuple[tuple[int, int], ...]) -> list[Function] | None:
    """An equation on both sides of a switch, as functions of time and the parameters; None where the difference depends on variables."""
    found = [template.residual.xreplace({relation_symbol(j): sympy.Integer(x) for j, x in s}) for s in sides]
    if (found[1] - found[0]).free_symbols - {TIME, *symbols}:
        return None
    return [
        array_function((TIME, *symbols), x.xreplace({s: sympy.S.Zero for s in x.free_symbols - {TIME, *symbols}}))
        for x in found
    ]


def _jump(pieces: list[Function], numbers: list[float], t: float, ends: tuple[float, float]) -> bool:
    """Whether two functions of time differ at an instant by more than the rounding of their values on adjacent pieces."""
    values, sizes = [], [0.0]
    for function, end in zip(pieces, ends, strict=True):
        with np.errstate(all="ignore"):
            near = [abs(float(function(np.float64(t + share * (end - t)), *numbers))) for share in (0.1, 0.5, 1.0)]
            values.append(float(function(np.float64(t), *numbers)))
        sizes += [x for x in (abs(values[-1]), *near) if isfinite(x)]
    return abs(values[1] - values[0]) > SMALL * max(sizes)


def _refused(structure: Structure, g: int, i: int, when: str, level: int) -> ModelError:
    model, group = structure.model, structure.model.groups[g]
    owner, template = model.owner(g, i), group.template
    what, advice = (
        f"the equation {shown(template.label)}",
        "make what it drives elastic, or set the speeds after it by gl.reinit",
    )
    if "bound" in template.locals:
        what = model.name(int(group.variables[i, template.locals.index("bound")]))
        advice = "or let it pass through a filter (a first-order lag; exact=False of a prescribed motion)"
    return ModelError(
        f"{owner}: {what} has {KINDS[min(level, 1)]} {when}, but must be differentiated there: what it moves has inertia, and would need "
        f"an infinite torque. Round it off (a gl.Table by interpolation='akima'), {advice}"
    )
