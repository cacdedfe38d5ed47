"""Equations that are differentiated must not jump: where one does, the motion that it prescribes would take an infinite torque."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.codegen.kernels import differentiated
from gearlib.codegen.program import Batch, Newton, Program
from gearlib.errors import ModelError
from gearlib.flatten.templates import Template
from gearlib.solve.quasipolynomials import TIME, OutsideClassError
from gearlib.solve.switches import switch_times
from gearlib.structure.analysis import Structure

Floats = NDArray[np.float64]
MOST = 50  # switches that are looked at
APART = 1e-9  # of a time, by which both sides of a switch are told
SMALL = 1e-9  # of the sizes on both sides: a difference below this is rounding
KINDS = ("a jump", "a kink")
_differentiated: WeakKeyDictionary[Program, tuple[list[tuple[int, Template]], bytes]] = (
    WeakKeyDictionary()
)  # and what was looked at


def refuse_jumps(structure: Structure, program: Program, parameters: Floats, t0: float, t1: float) -> None:
    """Raise an error where a program differentiates an equation at a time at which it jumps.

    Looked at are equations whose relations compare nothing but time, and jumps that depend on nothing else.

    Raises
    ------
    ModelError
        Names the variable, the time, and by how much it jumps.
    """
    if program not in _differentiated:
        _differentiated[program] = _uses(structure, program), b""
    uses, seen = _differentiated[program]
    slots = [structure.model.groups[structure.rows[e][0]].parameters[structure.rows[e][1]] for e, _ in uses]
    key = parameters[np.concatenate([np.empty(0, np.int64), *slots])].tobytes() + np.array([t0, t1]).tobytes()
    if key != seen:
        for e, template in uses:
            _check(structure, e, template, parameters, t0, t1)
        _differentiated[program] = uses, key


def _uses(structure: Structure, program: Program) -> list[tuple[int, Template]]:
    """The equations of a program that are differentiated and hold relations, and how they stand in it."""
    batches: list[Batch] = []
    for step in program.steps:
        batches += (step,) if isinstance(step, Batch) else step.residuals if isinstance(step, Newton) else ()
    return [(e, b.kernel.template) for b in batches for e in np.unique(b.equations).tolist() if e in structure.switching]


def _check(structure: Structure, e: int, used: Template, parameters: Floats, t0: float, t1: float) -> None:
    """Of one equation: what stands under its derivatives, level by level."""
    g, i = structure.rows[e]
    group = structure.model.groups[g]
    table: dict[Any, Any] = {
        sympy.Symbol(name, real=True): sympy.Float(parameters[p], 17)
        for name, p in zip(group.template.parameters, group.parameters[i].tolist(), strict=True)
    }
    relations = [(r, r.g.xreplace(table)) for r in group.template.relations]
    timed = [(r, x, sympy.Symbol(f"relation_{j}", real=True)) for j, (r, x) in enumerate(relations) if x.free_symbols == {TIME}]
    level = 0
    while differentiated(group.template, level) is not used:
        residual = differentiated(group.template, level).residual.xreplace(table)
        for t in _times([x for _, x, _ in timed], t0, t1):
            before, after = (residual.xreplace({s: _flag(r, x, t, side) for r, x, s in timed}) for side in (-1, 1))
            if _jump(before, after, t):
                raise _refused(structure, g, i, t, level)
        level += 1


def _times(expressions: list[Any], t0: float, t1: float) -> list[float]:
    try:
        return sorted({t for x in expressions for t in switch_times(x > 0, t0, t1).tolist()})[:MOST]
    except OutsideClassError:
        return []


def _flag(relation: Any, difference: Any, t: float, side: int) -> Any:
    value = float(difference.subs(TIME, t + side * APART * max(abs(t), 1.0)))
    return sympy.Integer(value < 0 if relation.negated else value > 0)


def _jump(before: Any, after: Any, t: float) -> bool:
    """Whether two expressions of time differ at one; false where that depends on variables."""
    if (after - before).free_symbols - {TIME}:
        return False
    zero = {s: sympy.S.Zero for s in (after.free_symbols | before.free_symbols) - {TIME}}
    sides = [x.xreplace(zero) for x in (before, after)]
    values = [float(x.subs(TIME, t)) for x in sides]
    slopes = [abs(float(sympy.diff(x, TIME).subs(TIME, t))) for x in sides]  # the time of a switch is known to rounding only
    return abs(values[1] - values[0]) > SMALL * max(*map(abs, values), *(s * max(abs(t), 1.0) for s in slopes))


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
