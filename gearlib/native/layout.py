"""Memory layout of native code: offsets in its two blocks, ``data`` (floats) and ``index`` (integers)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.translate import Prototype
from gearlib.program.interpret import Prepared, constant_values
from gearlib.program.program import Batch, Linear, Newton, Program

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
# A model's native function: ``int32 f(double t, void *x, void *out, void *data, void *index)``.
MODEL = Prototype("int32", ("float", "int", "int", "int", "int"))
SEARCH = 6.0  # times an addition: an operation of an elimination in short loops that looks for pivots
EACH = 3  # numbers that are remembered of a divisor


@dataclass(frozen=True)
class Shared:
    """Common head of ``data``: parameters, discrete state (relations, discrete variables), inputs."""

    n_parameters: int
    n_relations: int
    n_inputs: int

    @property
    def relations(self) -> int:
        return self.n_parameters

    @property
    def inputs(self) -> int:
        return self.n_parameters + self.n_relations

    @property
    def size(self) -> int:
        return self.inputs + self.n_inputs


@dataclass(frozen=True)
class Layout:
    """One function's part of ``data``: solution matrices of its linear blocks, slots, scratch."""

    shared: Shared
    solutions: tuple[int, ...]
    slots: int
    scratch: int
    guards: int  # of each divisor: its sign (half where it is from before an event), how large it and its numerator were
    size: int  # where the part ends
    needed: tuple[Integers, ...]  # of each linear block: which of its unknowns anything uses

    @property
    def relations(self) -> int:
        return self.shared.relations

    @property
    def inputs(self) -> int:
        return self.shared.inputs


def lay_out(program: Program, shared: Shared, base: int, also: Integers | None = None) -> Layout:
    """The layout of one program, beginning at ``base``; slots that ``also`` are used must be computed, too."""
    used = np.zeros(program.n_slots, bool)
    used[program.output_slots] = True
    if also is not None:
        used[also] = True
    for step in program.steps:
        if isinstance(step, Batch):
            used[step.arguments[step.argument_signs != 0]] = True
        elif isinstance(step, Newton):
            for batch in (*step.residuals, *step.jacobian):
                used[batch.arguments[batch.argument_signs != 0]] = True
    at = base
    solutions, needed = [], []
    scratch = 0
    for step in program.steps:
        if isinstance(step, Linear):
            rows = np.flatnonzero(used[step.unknowns])
            needed.append(rows)
            solutions.append(at)
            at += len(rows) * len(step.known)
        elif isinstance(step, Newton):
            n = len(step.unknowns)
            scratch = max(scratch, n * n + 2 * n + 1)  # right-hand side, matrix, order of columns
    end = at + program.n_slots
    memory = len(program.iterated)  # a first determinant each
    guards = end + scratch + memory
    return Layout(shared, tuple(solutions), at, end, guards, guards + EACH * program.n_guards, tuple(needed))


def fill(data: Floats, layout: Layout, coefficients: Sequence[Batch], prepared: Prepared, guess: Floats | None = None) -> None:
    """Write a program's numbers into its part of ``data``; the coefficients of runs stand behind the layout's end."""
    at = layout.size
    for batch in coefficients:
        data[at : at + len(batch)] = constant_values(batch, prepared.parameters)
        at += len(batch)
    for at, matrix, rows in zip(layout.solutions, prepared.solutions, layout.needed, strict=True):
        part = matrix[rows].ravel()
        data[at : at + len(part)] = part
    if guess is not None:
        data[layout.slots : layout.slots + len(guess)] = guess


def operations(program: Program, layout: Layout) -> float:
    """Roughly how many additions one evaluation of a program costs; nonlinear blocks are taken to need two iterations."""
    total, needed = 0.0, iter(layout.needed)
    for step in program.steps:
        if isinstance(step, Batch):
            total += len(step) * step.kernel.operations
        elif isinstance(step, Linear):
            total += 2.0 * len(next(needed)) * len(step.known)
        else:
            n = len(step.unknowns)
            inside = sum(len(b) * (1 + b.kernel.operations) for b in (*step.residuals, *step.jacobian))
            total += (1 if step.linear else 2) * (inside + SEARCH * (2.0 * n**3 / 3.0 + 2.0 * n**2))
    return total
