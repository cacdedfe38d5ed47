"""Refusal of discontinuities in differentiated equations, where a prescribed motion would need an infinite torque."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.equations.kernel import array_function, differentiated
from gearlib.equations.quasipolynomials import TIME, OutsideClassError
from gearlib.equations.switch_times import switch_times
from gearlib.equations.template import Template, memoised, relation_symbol
from gearlib.errors import ModelError
from gearlib.program.program import Batch, Newton, Program
from gearlib.reduce.reduction import Structure

Floats = NDArray[np.float64]
Function = Callable[..., Any]  # of time and the parameters
MOST = 50  # switches that are examined
APART = 1e-9  # relative distance from a switch at which its sides are evaluated
SMALL = 1e-9  # relative to the values on both sides: a smaller difference is rounding
KINDS = ("a jump", "a kink")


def refuse_jumps(structure: Structure, program: Program, parameters: Floats, t0: float, t1: float) -> None:
    """Raise an error where a program differentiates an equation at a time at which it jumps.

    Only equations whose relations compare nothing but time are examined, and only jumps that depend on nothing else.

    Raises
    ------
    ModelError
        Names the variable, the time and the size of the jump.
    """
    uses, seen = program.memo.get(refuse_jumps, (None, b""))
    if uses is None:
        uses = _uses(structure, program)
    slots = [structure.model.groups[structure.model.places[e][0]].parameters[structure.model.places[e][1]] for e, _ in uses]
    key = parameters[np.concatenate([np.empty(0, np.int64), *slots])].tobytes() + np.array([t0, t1]).tobytes()
    if key != seen:
        for e, template in uses:
            _check(structure, e, template, parameters, t0, t1)
        program.memo[refuse_jumps] = uses, key


def _uses(structure: Structure, program: Program) -> list[tuple[int, Template]]:
    """Differentiated equations of a program that contain relations, with the templates in use."""
    batches: list[Batch] = []
    for step in program.steps:
        batches += (step,) if isinstance(step, Batch) else step.residuals if isinstance(step, Newton) else ()
    return [(e, b.kernel.template) for b in batches for e in np.unique(b.equations).tolist() if e in structure.switching]


def _check(structure: Structure, e: int, used: Template, parameters: Floats, t0: float, t1: float) -> None:
    """Check one equation: the expressions under its derivatives, order by order."""
    g, i = structure.model.places[e]
    group = structure.model.groups[g]
    template, numbers = group.template, list(parameters[group.parameters[i]])
    symbols = tuple(sympy.Symbol(name, real=True) for name in template.parameters)
    timed = [(j, r) for j, r in enumerate(template.relations) if r.g.free_symbols <= {TIME, *symbols}]
    times = _times([r.g.xreplace(dict(zip(symbols, map(_float, numbers), strict=True))) for _, r in timed], t0, t1)
    level = 0
    while differentiated(template, level) is not used and times:
        for last, t, following in zip([t0, *times], times, [*times[1:], t1], strict=False):
            sides = [tuple((j, _holds(template, j, symbols, numbers, t, side)) for j, _ in timed) for side in (-1, 1)]
            pieces = _pieces(differentiated(template, level), symbols, *sides)
            if pieces is not None and _jump(pieces, numbers, t, (last, following)):
                raise _refused(structure, g, i, t, level)
        level += 1


def _float(number: float) -> Any:
    return sympy.Float(number, 17)


def _times(expressions: list[Any], t0: float, t1: float) -> list[float]:
    try:
        return sorted({t for x in expressions for t in switch_times(x > 0, t0, t1).tolist()})[:MOST]
    except OutsideClassError:
        return []


def _holds(template: Template, j: int, symbols: tuple[Any, ...], numbers: list[float], t: float, side: int) -> int:
    relation = template.relations[j]
    with np.errstate(all="ignore"):
        value = float(_compared(template, j, symbols)(np.float64(t + side * APART * max(abs(t), 1.0)), *numbers))
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


def _refused(structure: Structure, g: int, i: int, t: float, level: int) -> ModelError:
    model, group = structure.model, structure.model.groups[g]
    owner, template = model.owner(g, i), group.template
    what = f"the equation {template.label}"
    if "bound" in template.locals:
        what = model.name(int(group.variables[i, template.locals.index("bound")]))
    return ModelError(
        f"{owner}: {what} has {KINDS[min(level, 1)]} at t = {t:.9g} s, but must be differentiated there: what it "
        "moves has inertia, and would need an infinite torque. Round it off, or let the motion follow it through "
        "a filter (exact=False)"
    )
