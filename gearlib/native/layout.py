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
# Signature of a model's native function: ``int32 f(double t, void *x, void *out, void *data, void *index)``.
MODEL = Prototype("int32", ("float", "int", "int", "int", "int"))
SEARCH = 6.0  # cost of one operation of pivoted elimination in short loops, relative to an addition
EACH = 3  # numbers stored per divisor


@dataclass(frozen=True)
class Shared:
    """Common head of ``data``: parameters, discrete state (relations, discrete variables), inputs."""

    n_parameters: int
    n_modes: int
    n_inputs: int

    @property
    def relations(self) -> int:
        return self.n_parameters

    @property
    def inputs(self) -> int:
        return self.n_parameters + self.n_modes

    @property
    def size(self) -> int:
        return self.inputs + self.n_inputs


@dataclass(frozen=True)
class Layout:
    """One function's section of ``data``: solution matrices of its linear blocks, slots, scratch."""

    shared: Shared
    solutions: tuple[int, ...]
    slots: int
    scratch: int
    guards: int  # per divisor: its sign (0.5 if stale since an event), the largest magnitudes of it and of its numerator
    size: int  # end of the section
    needed: tuple[Integers, ...]  # per linear block: the unknowns that anything uses

    @property
    def relations(self) -> int:
        return self.shared.relations

    @property
    def inputs(self) -> int:
        return self.shared.inputs


def lay_out(program: Program, shared: Shared, base: int, also: Integers | None = None) -> Layout:
    """Lay out the section of one program from offset ``base``; slots that ``also`` are used must be computed, too."""
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
            scratch = max(scratch, n * n + 2 * n + 1)  # right-hand side, matrix, column order
    end = at + program.n_slots
    memory = len(program.iterated)  # a reference determinant each
    guards = end + scratch + memory
    return Layout(shared, tuple(solutions), at, end, guards, guards + EACH * program.n_guards, tuple(needed))


def fill(data: Floats, layout: Layout, coefficients: Sequence[Batch], prepared: Prepared, guess: Floats | None = None) -> None:
    """Write a program's numbers into its section of ``data``; coefficients of unit-stride runs follow its end."""
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
    """Approximate cost of one evaluation of a program, in additions; two iterations are assumed for nonlinear blocks."""
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
