"""The tangents of a run: their start, the native code that carries them on with the states, and what they come to.

With states x' = f(t, x, p), the tangent S = dx/dp of a parameter obeys S' = df/dx S + df/dp, S(t_start) = dx_start/dp. The right-hand side
of states and tangents together is one native function; to the integrators the tangents are states like others, under error control.

References
----------
T. Maly, L. R. Petzold, "Numerical methods and software for sensitivity analysis of differential-algebraic systems", Applied Numerical
Mathematics 20 (1996), doi:10.1016/0168-9274(95)00117-0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError
from gearlib.native.jacobian import inverted_blocks
from gearlib.native.scene_functions import NativeScene
from gearlib.program.derivative_plan import DerivativePlan, derivative_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import Prepared, block_solve
from gearlib.program.program import Program
from gearlib.run.scene import Scene
from gearlib.run.start_values import Start
from gearlib.run.tangents.directions import Entry, TangentDirections

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Tangents:
    """TangentDirections, and the tangents of a scene's states at the start.

    Attributes
    ----------
    directions : TangentDirections
    start : array, shape (states, directions)
    """

    directions: TangentDirections
    start: Floats

    def spread(self, values: Floats) -> Floats:
        """Something of each state for each tangent: divided by the size of the direction."""
        return np.asarray((values[:, None] / self.directions.sizes).ravel(), float)


@dataclass(frozen=True, eq=False)
class TangentCode:
    """Native functions of a scene whose right-hand side goes on with tangents.

    Attributes
    ----------
    plan : DerivativePlan
    native : NativeScene
    """

    plan: DerivativePlan
    native: NativeScene

    def fill(self, data: Floats, directions: TangentDirections, prepared: Prepared) -> None:
        """Put the numbers of the tangents into a data block."""
        first = len(self.plan.order) - len(directions.entries)
        numbers = [directions.weights[self.plan.order[first:] - first]]
        for step, equations in inverted_blocks(self.plan):
            right = np.zeros((len(step.step.unknowns), len(equations)))
            right[equations, np.arange(len(equations))] = 1.0
            numbers.append(block_solve(prepared, step.block, right)[step.rows].ravel())
        written = np.concatenate(numbers)
        data[self.native.tangent_numbers :][: len(written)] = written


def tangent_code(scene: Scene, directions: TangentDirections, jacobian: bool = False) -> TangentCode:
    """The native functions of a scene with tangents; kept in the scene for the next run."""
    changed = len(directions), directions.entries
    key = *changed, jacobian
    found: TangentCode | None = scene.tangent_codes.get(key)
    if found is None:
        plan = tangent_plan(scene.program, changed, scene.program.output_slots)
        found = scene.tangent_codes[key] = TangentCode(plan, scene.compiled(jacobian, plan))
    return found


def tangent_plan(program: Program, key: tuple[int, tuple[Entry, ...]], wanted: Integers) -> DerivativePlan:
    """Derivatives of some slots in directions: ``key`` says how many there are, and which entries of the parameter table they change."""
    count, changed = key
    entering = [(i, k) for i in range(len(program.states)) for k in range(count)]
    entering += [(program.n_slots + p, k) for p, k in changed]
    return derivative_plan(program, entering, wanted, count)


def slot_tangents(
    prepared: Prepared, directions: TangentDirections, wanted: Integers, t: Floats, slots: Floats, modes: Floats, states: Floats
) -> Floats:
    """Tangents of slots of a program, shape (times, wanted, directions).

    Parameters
    ----------
    prepared : Prepared
    directions : TangentDirections
    wanted : array of int
        Slots.
    t : array, shape (times,)
    slots, modes : arrays, shape (number, times)
        Values of everything there.
    states : array, shape (times, states, directions)
        Tangents of the states.
    """
    plan = tangent_plan(prepared.program, (len(directions), directions.entries), wanted)
    known = np.repeat(directions.weights[:, None], len(t), axis=1)
    weights = np.concatenate([states.reshape(len(t), -1).T, known])
    return dense(plan, entries(plan, At(prepared, t, slots, modes), weights))


def start_tangents(scene: Scene, start: Start, directions: TangentDirections) -> Floats:
    """Tangents of a scene's states at the start, shape (states, directions)."""
    model = scene.model
    guess = np.zeros((model.n_variables, len(directions)))
    table = np.zeros((len(model.parameters.names), len(directions)))
    for (p, k), weight in zip(directions.entries, directions.weights.tolist(), strict=True):
        table[p, k] = weight
    representatives, signs, slots = model.guessed
    for v, sign, p in zip(representatives.tolist(), signs.tolist(), slots.tolist(), strict=True):
        if v not in directions.given:
            guess[v] = sign * table[p]
    for v, k, sign in directions.starts:
        guess[v, k] = sign
    states = {v for v, order in scene.structure.states if order == 0}
    for v in {*model.fixed[0].tolist(), *(v for v, *_ in directions.starts)} - states:
        if (v, 0) in scene.structure.choice.solved_by and guess[v].any():
            raise ArgumentError(
                f"sensitivities: the start value of {model.name(v)}, which is no state, changes, and how the states' start values follow "
                "is not computed yet; give start values of states"
            )
    return np.array([guess[v] if order == 0 else np.zeros(len(directions)) for v, order in scene.states]).reshape(
        len(scene.states), len(directions)
    )
