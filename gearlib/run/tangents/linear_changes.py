"""Derivatives of a scene's linear form in some directions: of its matrices, its driving terms, and their switching times.

x' = A x + B u(t, p) gives S' = A S + A_p x + B_p u + B du/dp, with du/dp as further inputs: a derivative of a sum of polynomials, sines
and exponentials of time is another one, so that the tangents have an exact solution, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from weakref import ref

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.equations.kernel import derivative_of, rest_of
from gearlib.language.expressions import SquareWave
from gearlib.program.derivatives import At, entries
from gearlib.program.interpret import Prepared
from gearlib.program.second_derivatives import Direction, entry_changes
from gearlib.run.linear_form import LinearPlan, linear_plan, mixed_form, of_time, parameter_slots, parameter_values
from gearlib.run.scene import Scene
from gearlib.run.tangents.directions import TangentDirections
from gearlib.solvers.problem import LinearChanges, LinearForm, MovedSwitch

Floats = NDArray[np.float64]
ONE = sympy.Integer(1)


def changed_form(scene: Scene, numbers: Prepared, signals: Sequence[Any], directions: TangentDirections) -> LinearForm | str:
    """The linear form of a scene with its derivatives, or the reason why there is none; arguments as for `linear_form`."""
    found = mixed_form(scene, numbers, signals)
    if isinstance(found, str):
        return found
    form, mix = found
    plan = linear_plan(scene)
    key = len(directions), directions.entries, directions.weights.tobytes()
    known = plan.changed  # other threads may replace it meanwhile
    if known and known[0]() is form and known[1] == key:
        changed: LinearForm = known[2]
        return changed
    drives = _drives(scene, numbers, form, mix, plan, directions)
    if isinstance(drives, str):
        return drives
    changed = _form(scene, numbers, form, mix, plan, directions, drives)
    plan.changed = ref(form), key, changed
    return changed


@dataclass(frozen=True, eq=False)
class _Drives:
    """Derivatives of driving terms: rows among them, directions and weights; and the switches of the inputs."""

    constant: list[tuple[int, int, float]]
    moving: list[tuple[int, int, Any]]
    switches: tuple[MovedSwitch, ...]


def _drives(
    scene: Scene, numbers: Prepared, form: LinearForm, mix: Floats, plan: LinearPlan, directions: TangentDirections
) -> _Drives | str:
    seeds, m = directions.seeds, len(scene.program.inputs)
    constant: list[tuple[int, int, float]] = []
    moving: list[tuple[int, int, Any]] = []
    switches: list[MovedSwitch] = []
    varied = {p for p, _, _ in seeds}
    for row, (batch, i) in enumerate(plan.seeds):
        slots = parameter_slots(scene, batch, i)
        if varied.isdisjoint(slots.values()):
            continue
        kernel, sign = rest_of(batch.kernel), int(batch.signs[i])
        value = parameter_values(scene, batch, i, numbers.parameters)
        names = kernel.template.parameters
        for q in kernel.parameters:
            here = [(k, weight) for p, k, weight in seeds if p == slots[names[q]]]
            slope = derivative_of(kernel, f"p{q}") if here else None
            if slope is None or slope.is_zero:
                continue
            expression = of_time(slope, value)
            if expression.has(sympy.DiracDelta, sympy.Derivative, sympy.Subs):
                return f"a jump of {kernel.expression} depends on {names[q]}"
            for k, weight in here:
                if expression.is_number:
                    constant.append((row, k, sign * weight * float(expression)))
                else:
                    moving.append((row, k, sign * weight * expression))
        column = int(np.abs(mix[m + row]).argmax()) if mix.size else 0
        if not kernel.relations or not mix[m + row, column] or form.inputs[column].is_number:
            continue
        by_name = {sympy.Symbol(name, real=True): number for name, number in value.items()}
        found = []
        for r in kernel.relations:
            g = kernel.template.relations[r].g
            changes = [sympy.S.Zero] * len(directions)
            for p, k, weight in seeds:
                for name in (name for name, slot in slots.items() if slot == p):
                    if g.has(sympy.Symbol(name, real=True)) and g.has(SquareWave):
                        return f"the times at which {g} changes its sign depend on {name}"
                    changes[k] += weight * sympy.diff(g, sympy.Symbol(name, real=True)).xreplace(by_name)
            found.append(MovedSwitch(column, g.xreplace(by_name), tuple(changes)))
        if any(any(switch.changes) for switch in found):
            switches += found
    return _Drives(constant, moving, tuple(switches))


def _form(
    scene: Scene, numbers: Prepared, form: LinearForm, mix: Floats, plan: LinearPlan, directions: TangentDirections, drives: _Drives
) -> LinearForm:  # fmt: skip
    program, table, count = scene.program, plan.derivatives, len(directions)
    n, m, width = len(program.states), len(program.inputs), mix.shape[1]
    at = At(numbers, np.zeros(1), np.zeros((program.n_slots, 1)), np.zeros((scene.n_discrete, 1)))
    parameters = np.zeros((len(numbers.parameters), count))
    for p, k, weight in directions.seeds:
        parameters[p, k] += weight
    changes = entry_changes(table, at, Direction(np.zeros((program.n_slots, count)), parameters))  # no entry depends on a slot
    inner = table.seeds < n
    extra = [*(e for *_, e in drives.moving), *([ONE] if drives.constant else [])]
    B = np.zeros((count, n, width + len(extra)))
    rows, seeds = table.rows[~inner], table.seeds[~inner] - n
    for k in range(count):
        np.add.at(B[k], (rows[:, None], np.arange(width)), changes[~inner, k, None] * mix[seeds])
    if extra:
        values = entries(table, at)[:, 0][~inner]
        for j, (row, k, _) in enumerate(drives.moving):
            here = seeds == m + row
            np.add.at(B[k, :, width + j], rows[here], values[here])
        for row, k, share in drives.constant:
            here = seeds == m + row
            np.add.at(B[k, :, -1], rows[here], share * values[here])
    A = tuple(_matrix(form.A, table.rows[inner], table.seeds[inner], changes[inner, k]) for k in range(count))
    own = np.concatenate([form.B, np.zeros((n, len(extra)))], axis=1)
    return LinearForm(
        form.A, own, (*form.inputs, *extra), known=form.known, changes=LinearChanges(A, B, drives.switches)
    )  # fmt: skip


def _matrix(like: Any, rows: NDArray[np.int64], columns: NDArray[np.int64], values: Floats) -> Any:
    """A matrix of the kind and shape of another."""
    if isinstance(like, np.ndarray):
        full = np.zeros(like.shape)
        full[rows, columns] = values
        return full
    from scipy.sparse import csr_array

    kept = values != 0.0
    return csr_array((values[kept], (rows[kept], columns[kept])), shape=like.shape)
