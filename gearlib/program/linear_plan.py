"""Precomputed plan for the matrices of a linear program: sparse sums of products, evaluated for any parameters.

Every slot is a sum of seeds (states, inputs, terms added to slots) times numbers. The numbers of all slots lie in one vector, those
of the seeds, which are one, first. Each step of the program appends the sums of products of its coefficients, which depend on
parameters only, with numbers before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import Kernel, derivative_of
from gearlib.program.interpret import MOST_DENSE, Prepared
from gearlib.program.program import Batch, Linear, Newton, Program

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
MOST_PRODUCTS = 2_000_000


@dataclass(frozen=True)
class _Coefficients:
    """Partial derivatives of a batch with respect to one argument."""

    kernel: Kernel
    parameters: Integers  # (parameters, rows)
    signs: Floats

    def values(self, parameters: Floats) -> Floats:
        return np.asarray(self.kernel.function(0.0, *parameters[self.parameters]) * self.signs, float)


@dataclass(frozen=True)
class _Sums:
    """Sparse sums of products: factor indices, constant weights, and the target of each term."""

    coefficients: tuple[_Coefficients, ...] | None  # None: those of a linear block's solution
    factors: Integers
    sources: Integers
    sums: Integers
    count: int


@dataclass(frozen=True, eq=False)
class LinearPlan:
    """Plan of a Jacobian in coordinate format: entry i belongs to output ``rows[i]`` and seed ``seeds[i]``."""

    n_seeds: int
    steps: tuple[_Sums, ...]
    rows: Integers
    seeds: Integers
    sources: Integers

    def entries(self, prepared: Prepared) -> Floats:
        """The derivatives for a set of parameters."""
        numbers = np.ones(self.n_seeds + sum(step.count for step in self.steps))
        solutions, first, one = iter(prepared.solutions), self.n_seeds, np.ones(1)
        with np.errstate(all="ignore"):
            for step in self.steps:
                if step.coefficients is None:
                    parts = [np.asarray(next(solutions)).ravel()]
                else:
                    parts = [c.values(prepared.parameters) for c in step.coefficients]
                products = np.concatenate([*parts, one])[step.factors] * numbers[step.sources]
                numbers[first : first + step.count] = np.bincount(step.sums, products, step.count)
                first += step.count
        return numbers[self.sources]


def linear_plan(program: Program, added: Sequence[int]) -> LinearPlan | None:
    """The plan of a linear program; seeds are its states, its inputs, and terms added to slots. None where it would be long."""
    n_given = len(program.states) + len(program.inputs)
    n_seeds = n_given + len(added)
    first, length = np.zeros((2, program.n_slots), np.int64)  # of each slot's numbers
    first[:n_given], length[:n_given] = np.arange(n_given), 1
    seed_of = np.arange(n_seeds)
    extra = {slot: n_given + k for k, slot in enumerate(added)}
    if len(extra) < len(added):
        return None
    steps: list[_Sums] = []
    for step in program.steps:
        if isinstance(step, Newton) or (isinstance(step, Linear) and len(step.unknowns) > MOST_DENSE):
            return None
        coefficients, rows, slots = _terms(step)
        if length[slots].sum() > MOST_PRODUCTS:
            return None
        which, sources = _ranges(first[slots], length[slots])
        factors, rows, seeds = which, rows[which], seed_of[sources]
        targets = step.targets if isinstance(step, Batch) else step.unknowns
        more = [(i, extra[slot]) for i, slot in enumerate(targets.tolist()) if slot in extra]
        if more:  # an added term is one times its seed
            here, added_seeds = np.array(more).T
            rows, seeds, sources = np.append(rows, here), np.append(seeds, added_seeds), np.append(sources, added_seeds)
            factors = np.append(factors, np.full(len(more), -1))
        keys, sums = np.unique(rows * n_seeds + seeds, return_inverse=True)
        length[targets] = np.bincount(keys // n_seeds, minlength=len(targets))
        first[targets] = len(seed_of) + np.cumsum(length[targets]) - length[targets]
        seed_of = np.append(seed_of, keys % n_seeds)
        steps.append(_Sums(coefficients, factors, sources, sums.ravel(), len(keys)))
    rows, sources = _ranges(first[program.output_slots], length[program.output_slots])
    return LinearPlan(n_seeds, tuple(steps), rows, seed_of[sources], sources)


def _terms(step: Batch | Linear) -> tuple[tuple[_Coefficients, ...] | None, Integers, Integers]:
    """Coefficients of a step; for each of them the row, and the slot that it multiplies."""
    if isinstance(step, Linear):
        n, known = len(step.unknowns), len(step.known)
        return None, np.repeat(np.arange(n), known), np.tile(step.known, n)
    coefficients: list[_Coefficients] = []
    rows, slots = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for a, c in enumerate(step.kernel.columns):
        kernel, here = derivative_of(step.kernel, c), np.flatnonzero(step.argument_signs[:, a])
        if not kernel.is_zero:
            used = [step.kernel.parameters.index(p) for p in kernel.parameters]
            signs = (step.argument_signs[here, a] * step.signs[here]).astype(float)
            coefficients.append(_Coefficients(kernel, np.ascontiguousarray(step.parameters[here][:, used].T), signs))
            rows.append(here)
            slots.append(step.arguments[here, a])
    return tuple(coefficients), np.concatenate(rows), np.concatenate(slots)


def _ranges(first: Integers, length: Integers) -> tuple[Integers, Integers]:
    """The numbers first[i] .. first[i] + length[i] one after the other, and to which i each belongs."""
    which = np.repeat(np.arange(len(first)), length)
    return which, np.arange(len(which)) + (first + length - np.cumsum(length))[which]
