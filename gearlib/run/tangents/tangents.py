"""Tangents of a run: their start values, the native code that propagates them with the states, and their histories.

With states x' = f(t, x, p), the tangent S = dx/dp of a parameter obeys S' = df/dx S + df/dp, S(t_start) = dx_start/dp. The right-hand
side of states and tangents together is one native function; to the integrators the tangents are further states, under error control.

References
----------
T. Maly, L. R. Petzold, "Numerical methods and software for sensitivity analysis of differential-algebraic systems", Applied Numerical
Mathematics 20 (1996), doi:10.1016/0168-9274(95)00117-0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gearlib.native.jacobian import inverted_blocks
from gearlib.native.scene_functions import NativeScene
from gearlib.program.derivative_plan import DerivativePlan, derivative_plan, discrete_entry
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import Prepared, block_solve
from gearlib.program.program import Batch, Program
from gearlib.run.scene import Scene
from gearlib.run.tangents.directions import Entry, TangentDirections

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
LATEST = 2.2e-14  # relative to time: a sample no further than this before an event holds the right-hand limit


@dataclass(frozen=True, eq=False)
class Tangents:
    """Directions of differentiation, with the tangents of a scene's states at the start.

    Attributes
    ----------
    directions : TangentDirections
    start : array, shape (states, directions)
    """

    directions: TangentDirections
    start: Floats
    noted: list[tuple[float, Floats]] = field(default_factory=list)  # tangents of discrete variables, with their times

    def note(self, t: float, discretes: Floats) -> None:
        """Record tangents of discrete variables from a time on; records of later times, from a segment that is repeated, are dropped."""
        while self.noted and self.noted[-1][0] >= t:
            self.noted.pop()
        self.noted.append((t, discretes))

    def discretes(self, discrete: Sequence[int], times: Floats | None = None) -> Floats:
        """Tangents of the `carried` discrete variables: the last ones, or at some times; shape ([times,] number, directions)."""
        zero = np.zeros((len(discrete), len(self.directions)))
        found = np.array([zero, *(values for _, values in self.noted)])
        if times is None:
            return np.asarray(found[-1], float)
        since = np.array([t for t, _ in self.noted])
        return np.asarray(found[np.searchsorted(since, times + LATEST * np.abs(times), side="right")], float)

    def spread(self, values: Floats) -> Floats:
        """A per-state quantity repeated for each tangent, divided by the size of the direction."""
        return np.asarray((values[:, None] / self.directions.sizes).ravel(), float)


@dataclass(frozen=True, eq=False)
class TangentHistory:
    """Tangents at the samples of a run.

    Attributes
    ----------
    directions : TangentDirections
    states : array, shape (samples, states, directions)
    discrete : tuple of int
        Entries of the discrete state that are `carried`.
    discretes : array, shape (samples, carried entries, directions)
        Their tangents.
    """

    directions: TangentDirections
    states: Floats
    discrete: tuple[int, ...]
    discretes: Floats

    def of_slots(self, prepared: Prepared, wanted: Integers, t: Floats, slots: Floats, discrete: Floats) -> Floats:
        """Tangents of slots of a program, shape (samples, wanted, directions).

        Parameters
        ----------
        prepared : Prepared
        wanted : array of int
            Slots.
        t : array, shape (samples,)
        slots, discrete : arrays, shape (number, samples)
            Values at the samples.
        """
        directions = self.directions
        plan = tangent_plan(prepared.program, (len(directions), directions.entries), wanted, self.discrete)
        known = np.repeat(directions.weights[:, None], len(t), axis=1)
        weights = np.concatenate([self.states.reshape(len(t), -1).T, known, self.discretes.reshape(len(t), -1).T])
        return dense(plan, entries(plan, At(prepared, t, slots, discrete), weights))


@dataclass(frozen=True, eq=False)
class TangentCode:
    """Native functions of a scene with a right-hand side extended by tangents.

    Attributes
    ----------
    plan : DerivativePlan
    native : NativeScene
    discrete : tuple of int
        Entries that `carried` returns.
    """

    plan: DerivativePlan
    native: NativeScene
    discrete: tuple[int, ...]

    def weigh(self, data: Floats, directions: TangentDirections, discretes: Floats) -> None:
        """Write the weights of each direction, at parameters and `carried` discrete variables, into a data block."""
        if self.native.vectors is not None:
            written = self.native.vectors.weights(directions.entries, directions.weights.tolist())
            data[self.native.tangent_numbers :][: len(written)] = written
            return
        weights = np.append(directions.weights, discretes)
        first = len(self.plan.order) - len(weights)
        data[self.native.tangent_numbers :][: len(weights)] = weights[self.plan.order[first:] - first]

    def fill(self, data: Floats, directions: TangentDirections, prepared: Prepared, discretes: Floats) -> None:
        """Write the numbers of the tangents into a data block."""
        self.weigh(data, directions, discretes)
        numbers = [np.empty(0)]
        for step, equations in inverted_blocks(self.plan):
            right = np.zeros((len(step.step.unknowns), len(equations)))
            right[equations, np.arange(len(equations))] = 1.0
            numbers.append(block_solve(prepared, step.block, right)[step.rows].ravel())
        written = np.concatenate(numbers)
        vectors = self.native.vectors
        at = self.native.tangent_numbers + (vectors.size if vectors else len(directions.weights) + discretes.size)
        data[at : at + len(written)] = written


def tangent_code(scene: Scene, directions: TangentDirections, jacobian: bool = False) -> TangentCode:
    """The native functions of a scene with tangents, cached in the scene."""
    changed = len(directions), directions.entries
    key = *changed, jacobian
    found: TangentCode | None = scene.tangent_codes.get(key)
    if found is None:
        discrete = carried(scene)
        plan = tangent_plan(scene.program, changed, scene.program.output_slots, discrete)
        found = scene.tangent_codes[key] = TangentCode(
            plan, scene.compiled(jacobian, plan, None if discrete else directions.entries), discrete
        )
    return found


def carried(scene: Scene) -> tuple[int, ...]:
    """Entries of the discrete state that depend on parameters once set at an event: continuous values, not modes of friction."""
    if scene.relations is None:
        return ()
    n, d = scene.model.n_relations, len(scene.model.discretes)
    moving = {
        int(target)
        for batch in scene.relations.discretes
        if batch.active or batch.kernel.on_time or any(_moves(batch, q) for q in range(batch.parameters.shape[1]))
        for target in batch.targets
    }
    while True:  # and what follows from these
        followers = {
            int(target)
            for batch in scene.relations.discretes
            for r in range(batch.relations.shape[1])
            if not batch.discrete_derivative(r).kernel.is_zero
            for target, source in zip(batch.targets.tolist(), batch.relations[:, r].tolist(), strict=True)
            if source in moving or (source >= n + d and source - d in moving)
        }
        if followers <= moving:
            return tuple(sorted({*moving, *(m + d for m in moving)}))
        moving |= followers


def _moves(batch: Batch, parameter: int) -> bool:
    return not batch.parameter_derivative(parameter).kernel.is_zero


def tangent_plan(
    program: Program, key: tuple[int, tuple[Entry, ...]], wanted: Integers, discrete: Sequence[int] = ()
) -> DerivativePlan:
    """Derivatives of some slots in directions, which enter at states, the parameter table and the discrete state.

    ``key`` holds the number of directions and the entries of the parameter table that they change.
    """
    count, changed = key
    entering = [(i, k) for i in range(len(program.states)) for k in range(count)]
    entering += [(program.n_slots + p, k) for p, k in changed]
    entering += [(discrete_entry(m), k) for m in discrete for k in range(count)]
    return derivative_plan(program, entering, wanted, count)
