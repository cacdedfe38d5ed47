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
MOST_HELD = 400  # unknowns up to which a dense block whose matrix only events change is solved by its inverse
FACTORISED = 5.0  # cost of a sparse factorisation, relative to one substitution
# Cost, in additions, of comparing the discrete state, and of the short loops around one solution with a kept matrix (measured)
CHECKED = 150.0
SERVES = 50.0  # evaluations between two events: the shortest service that a kept matrix is made for
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
    """Where the solution matrix of a block is kept whose matrix only events change, or its factors, and what it depends on.

    At ``place`` stand whether there is one (1; 2 where equations depend on each other), the discrete state that it was computed for,
    and its entries: a row per unknown that anything uses, a column per equation that is not zero where all unknowns are. With
    ``factors``, the sparse ones take the place of the entries, where a solution by them costs less than a product.
    """

    place: int
    discrete: Integers  # entries of the discrete state that the block's matrix depends on
    needed: Integers  # unknowns
    rests: tuple[Batch, ...]  # equations that are not zero where all unknowns are; targets: rows
    known: Integers  # their rows
    factors: EliminationOrder | None

    @property
    def entries(self) -> int:
        """Where its entries or factors begin."""
        return self.place + 1 + len(self.discrete)

    @property
    def size(self) -> int:
        stored = len(self.needed) * len(self.known) if self.factors is None else factors_size(self.factors)
        return 1 + len(self.discrete) + stored

    @property
    def by_rows(self) -> bool:
        """Whether the rows of the matrix are fewer than its columns, and so are computed one by one."""
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
    guards: int  # per divisor: its sign (0.5 if stale since an event), the largest magnitudes of it and of its numerator
    size: int  # end of the section
    needed: tuple[Integers, ...]  # per linear block: the unknowns that anything uses
    held: tuple[KeptMatrix | None, ...]  # per Newton block

    @property
    def relations(self) -> int:
        return self.shared.relations

    @property
    def inputs(self) -> int:
        return self.shared.inputs


def lay_out(program: Program, shared: Shared, base: int, also: Integers | None = None, hold: bool = False) -> Layout:
    """Lay out the section of one program from offset ``base``; slots that ``also`` are used must be computed, too.

    ``hold``: whether matrices that only events change are kept between them; parameters must not change then.
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
            if hold and step.switched and also is None:  # derivatives by parameters are read from unknowns: dr/dJ = der(w)
                used[own] = False
    at = base
    solutions, needed, held = [], [], []
    scratch = 0
    for step in program.steps:
        if isinstance(step, Linear):
            rows = np.flatnonzero(used[step.unknowns])
            needed.append(rows)
            solutions.append(at)
            at += len(rows) * len(step.known)
        elif isinstance(step, Newton):
            n = len(step.unknowns)
            kept = None
            order = step.order
            if hold and step.switched and (n <= MOST_HELD or order is not None):
                rests = step.rests
                known = np.unique(np.concatenate([np.empty(0, np.int64), *(b.targets for b in rests)]))
                kept = KeptMatrix(at, step.discrete, np.flatnonzero(used[step.unknowns]), rests, known, None)
                making = 0.0 if order is None else min(len(kept.needed), len(known)) * substitution(order)
                if order is not None and kept.operations + making / SERVES > CHECKED + substitution(order):
                    kept = replace(kept, factors=order)
                at += kept.size
            held.append(kept)
            if order is not None:  # right-hand side, one of the kept matrix, entries, factors
                scratch = max(scratch, 2 * n + len(order.places) + factors_size(order))
            else:  # right-hand sides, matrix, column order
                scratch = max(scratch, n * n + (2 if kept is None else 2 + len(kept.known)) * n + 1)
    end = at + program.n_slots
    memory = len(program.iterated)  # a reference determinant each
    guards = end + scratch + memory
    size = guards + EACH * program.n_guards
    return Layout(shared, tuple(solutions), at, end, guards, size, tuple(needed), tuple(held))


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
    total, needed, held = 0.0, iter(layout.needed), iter(layout.held)
    for step in program.steps:
        if isinstance(step, Batch):
            total += len(step) * step.kernel.operations
        elif isinstance(step, Linear):
            total += 2.0 * len(next(needed)) * len(step.known)
        elif (kept := next(held)) is not None:
            total += kept.operations + sum(len(b) * (1 + b.kernel.operations) for b in kept.rests)
        else:
            n, order = len(step.unknowns), step.order
            inside = sum(len(b) * (1 + b.kernel.operations) for b in (*step.residuals, *step.jacobian))
            elimination = SEARCH * (2.0 * n**3 / 3.0 + 2.0 * n**2) if order is None else FACTORISED * substitution(order)
            total += (1 if step.linear else 2) * (inside + elimination)
    return total
