"""Memory layout of native code: offsets in its two blocks, ``data`` (floats) and ``index`` (integers)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.small_language import Prototype
from gearlib.equations.template import memoised
from gearlib.native.sparse_solve import factors_size
from gearlib.program.interpret import Prepared, constant_values
from gearlib.program.program import Batch, Linear, Newton, Program
from gearlib.structure.elimination_order import EliminationOrder

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
# Signature of a model's native function: ``int32 f(double t, void *x, void *out, void *data, void *index)``.
MODEL = Prototype("int32", ("float", "int", "int", "int", "int"))
MOST_KEPT = 400  # unknowns up to which the inverse of a dense block is cached between events, if only these change its matrix
FACTORISED = 5.0  # cost of a sparse factorisation, relative to one substitution
# Overhead of one solution with a cached matrix, in additions (measured): comparing the discrete state, and setting up short loops
CHECKED = 150.0
SERVES = 50.0  # evaluations between two events over which the cost of making a cached matrix is spread
INDIRECT = 3.0  # cost of one operation of a sparse elimination or substitution, relative to one of a product
SEARCH = 6.0  # cost of one operation of pivoted elimination in short loops, relative to an addition
EACH = 3  # numbers stored per divisor


@dataclass(frozen=True)
class Shared:
    """Common head of ``data``: parameters, discrete state (relations, discrete variables), inputs."""

    n_parameters: int
    n_discrete: int
    n_inputs: int

    @property
    def relations(self) -> int:
        return self.n_parameters

    @property
    def inputs(self) -> int:
        return self.n_parameters + self.n_discrete

    @property
    def size(self) -> int:
        return self.inputs + self.n_inputs


@dataclass(frozen=True)
class KeptMatrix:
    """Storage of a cached solution matrix, or of sparse LU factors, of a linear block whose matrix changes at events only.

    From ``place`` on: a flag (0: not computed, 1: valid, 2: the equations are linearly dependent), the discrete state that it was
    computed for, and the entries: a row per unknown that is used, a column per equation with a right-hand side. With ``factors``, LU
    factors are stored instead, where substitution costs less than a product with the matrix.
    """

    place: int
    discrete: Integers  # entries of the discrete state that the block's matrix depends on
    needed: Integers  # unknowns that are used
    rests: tuple[Batch, ...]  # the equations with a right-hand side (`Newton.rests`); targets: rows
    known: Integers  # their rows
    factors: EliminationOrder | None

    @property
    def size(self) -> int:
        stored = len(self.needed) * len(self.known) if self.factors is None else factors_size(self.factors)
        return 1 + len(self.discrete) + stored

    @property
    def by_rows(self) -> bool:
        """Whether the matrix is computed row by row (it has fewer rows than columns), or else column by column."""
        return len(self.needed) < len(self.known)

    @property
    def operations(self) -> float:
        """Cost of one solution, in additions."""
        if self.factors is not None:
            return CHECKED + substitution(self.factors)
        return CHECKED + 2.0 * len(self.needed) * len(self.known)


def substitution(order: EliminationOrder) -> float:
    """Cost of a solution with sparse factors, in additions."""
    return INDIRECT * (4.0 * order.fill + 2.0 * order.n)


@dataclass(frozen=True, eq=False)
class Layout:
    """One function's section of ``data``: solution matrices of its linear blocks, slots, scratch."""

    shared: Shared
    solutions: tuple[int, ...]
    slots: int
    scratch: int
    memory: int  # a reference determinant for each block that is watched
    guards: int  # `EACH` numbers per divisor: its sign (halved by every event), largest magnitude of the numerator, and of the divisor
    size: int  # end of the section
    needed: tuple[Integers, ...]  # per linear block: the unknowns that are used
    kept: tuple[KeptMatrix | None, ...]  # per Newton block

    @property
    def relations(self) -> int:
        return self.shared.relations

    @property
    def inputs(self) -> int:
        return self.shared.inputs


def lay_out(program: Program, shared: Shared, base: int, also: Integers | None = None, keep: bool = False) -> Layout:
    """Lay out the section of one program from offset ``base``.

    ``also``: slots that are read besides those of the outputs and of the program's own steps. ``keep``: whether matrices that change at
    events only are cached between them, so that parameters must not change during the run.
    """
    used = np.zeros(program.n_slots, bool)
    used[program.output_slots] = True
    if also is not None:
        used[also] = True
    for step in program.steps:
        if isinstance(step, Batch):
            used[step.arguments[step.argument_signs != 0]] = True
        elif isinstance(step, Newton):
            own = np.isin(np.arange(program.n_slots), step.unknowns) & ~used
            for batch in (*step.residuals, *step.jacobian):
                used[batch.arguments[batch.argument_signs != 0]] = True
            if keep and step.switched and also is None:  # derivatives by parameters are read from unknowns: dr/dJ = der(w)
                used[own] = False
    at = base
    solutions, needed, kept = [], [], []
    scratch = 0
    for step in program.steps:
        if isinstance(step, Linear):
            rows = np.flatnonzero(used[step.unknowns])
            needed.append(rows)
            solutions.append(at)
            at += len(rows) * len(step.known)
        elif isinstance(step, Newton):
            n = len(step.unknowns)
            matrix = None
            order = step.order
            if keep and step.switched and (n <= MOST_KEPT or order is not None):
                rests = step.rests
                known = np.unique(np.concatenate([np.empty(0, np.int64), *(b.targets for b in rests)]))
                matrix = KeptMatrix(at, step.discrete, np.flatnonzero(used[step.unknowns]), rests, known, None)
                making = 0.0 if order is None else min(len(matrix.needed), len(known)) * substitution(order)
                if order is not None and matrix.operations + making / SERVES > CHECKED + substitution(order):
                    matrix = replace(matrix, factors=order)
                at += matrix.size
            kept.append(matrix)
            if order is not None:  # right-hand side, entries, factors
                scratch = max(scratch, n + len(order.places) + factors_size(order))
            else:  # right-hand sides, matrix, column order, determinant, magnitudes, columns of compliances
                scratch = max(scratch, 2 * n * n + (3 if matrix is None else 3 + len(matrix.known)) * n + 1)
    end = at + program.n_slots
    memory = end + scratch
    guards = memory + len(program.watched)
    size = guards + EACH * program.n_guards
    return Layout(shared, tuple(solutions), at, end, memory, guards, size, tuple(needed), tuple(kept))


def fill(data: Floats, layout: Layout, coefficients: Sequence[Batch], prepared: Prepared) -> None:
    """Write a program's numbers into its section of ``data``; coefficients of unit-stride runs follow its end."""
    at = layout.size
    for batch in coefficients:
        data[at : at + len(batch)] = constant_values(batch, prepared.parameters)
        at += len(batch)
    for at, matrix, rows in zip(layout.solutions, prepared.solutions, layout.needed, strict=True):
        part = matrix[rows].ravel()
        data[at : at + len(part)] = part


@memoised
def operations(program: Program, layout: Layout) -> float:
    """Approximate cost of one evaluation of a program, in additions; two iterations are assumed for nonlinear blocks."""
    total, needed, kept = 0.0, iter(layout.needed), iter(layout.kept)
    for step in program.steps:
        if isinstance(step, Batch):
            total += len(step) * step.kernel.operations
        elif isinstance(step, Linear):
            total += 2.0 * len(next(needed)) * len(step.known)
        elif (matrix := next(kept)) is not None:
            total += matrix.operations + sum(len(b) * (1 + b.kernel.operations) for b in matrix.rests)
        else:
            n, order = len(step.unknowns), step.order
            inside = sum(len(b) * (1 + b.kernel.operations) for b in (*step.residuals, *step.jacobian))
            elimination = SEARCH * (2.0 * n**3 / 3.0 + 2.0 * n**2) if order is None else FACTORISED * substitution(order)
            total += (1 if step.linear else 2) * (inside + elimination)
    return total
