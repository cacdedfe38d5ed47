"""`Program`: an evaluation order as integer arrays (slots, arguments, targets).

Every quantity has a slot: states first, then inputs, then unknowns. A `Batch` applies one kernel to many instances; a `Linear` block
solves equations whose matrix is constant during a run (factorised beforehand); a `Newton` block solves the others.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import Kernel, derivative_of, rest_of, without_columns
from gearlib.structure.elimination_order import EliminationOrder, elimination_order
from gearlib.structure.incidence import Node

Integers = NDArray[np.int64]
Floats = NDArray[np.float64]


LOST = 1e6  # ratio of the change of a linear block's solution to the solution beyond which too few digits are left: solve again from there
LARGE = 24  # unknowns from which a block is eliminated by its sparsity pattern
SPARSE = 0.25  # of the entries: a block with more is eliminated as a dense one
ROUNDING = 1e-12  # change of an unknown that may be pure rounding: unknowns near zero have no relative accuracy


@dataclass(frozen=True)
class Batch:
    """One kernel for many instances: ``slot[targets] = signs * kernel(slot[arguments] * argument_signs, ...)``."""

    kernel: Kernel
    equations: Integers  # where they come from; -1 - instance for equations of discrete variables
    targets: Integers  # (n,)
    signs: Integers  # (n,)
    arguments: Integers  # (n, columns)
    argument_signs: Integers
    parameters: Integers  # (n, parameters) into the parameter table
    relations: Integers  # (n, relations) into the relation values

    def __len__(self) -> int:
        return len(self.targets)

    @cached_property
    def columns(self) -> tuple[tuple[Integers, Integers | None], ...]:
        """Slots of each argument, and their signs as a column (None where all are plus)."""
        pairs = zip(self.arguments.T, self.argument_signs.T, strict=True)
        return tuple((np.ascontiguousarray(a), None if (s == 1).all() else s[:, None].copy()) for a, s in pairs)

    @cached_property
    def parameter_columns(self) -> tuple[Integers, ...]:
        """Places of each parameter in the parameter table, as columns."""
        return tuple(np.ascontiguousarray(places)[:, None] for places in self.parameters.T)

    @cached_property
    def sign_column(self) -> Integers | None:
        """The signs as a column (None where all are plus)."""
        return None if (self.signs == 1).all() else self.signs[:, None].copy()

    def derivative(self, argument: int) -> Batch:
        """Partial derivatives with respect to the slots of one argument; its sign is among the factors."""
        slope = derivative_of(self.kernel, f"x{self.kernel.columns[argument]}")
        return self.part(slope, self.signs * self.argument_signs[:, argument])

    def parameter_derivative(self, parameter: int) -> Batch:
        """Partial derivatives with respect to the parameter-table entries of one parameter."""
        return self.part(derivative_of(self.kernel, f"p{self.kernel.parameters[parameter]}"), self.signs)

    def discrete_derivative(self, relation: int) -> Batch:
        """Partial derivatives with respect to the discrete-state entries of one relation or discrete variable."""
        return self.part(derivative_of(self.kernel, f"r{self.kernel.relations[relation]}"), self.signs)

    def time_derivative(self) -> Batch:
        """Partial derivatives with respect to time."""
        return self.part(derivative_of(self.kernel, "t"), self.signs)

    @cached_property
    def active(self) -> tuple[int, ...]:
        """The arguments that the value depends on; relations, constant between events, do not count."""
        return tuple(a for a, c in enumerate(self.kernel.columns) if not derivative_of(self.kernel, f"x{c}").is_zero)

    @property
    def rest(self) -> Batch:
        """The values with all arguments set to zero."""
        return self.part(rest_of(self.kernel), self.signs)

    def part(self, kernel: Kernel, signs: Integers) -> Batch:
        """The same instances with another kernel over all or some of this one's columns."""
        x = [self.kernel.columns.index(c) for c in kernel.columns]
        p = [self.kernel.parameters.index(c) for c in kernel.parameters]
        r = [self.kernel.relations.index(c) for c in kernel.relations]
        return Batch(
            kernel, self.equations, self.targets, signs, _picked(self.arguments, x), _picked(self.argument_signs, x),
            _picked(self.parameters, p), _picked(self.relations, r),
        )  # fmt: skip

    @cached_property
    def of_parameters(self) -> bool:
        """Whether the values are constant during a run."""
        return not (self.kernel.columns or self.kernel.relations or self.kernel.on_time)

    @cached_property
    def numbers(self) -> Floats | None:
        """The values, if they are plain numbers."""
        value = self.kernel.number
        return None if value is None else np.asarray(value * self.signs, float)

    def take(self, rows: Integers) -> Batch:
        """Some of the rows, in the given order."""
        return Batch(
            self.kernel, self.equations[rows], self.targets[rows], self.signs[rows], self.arguments[rows],
            self.argument_signs[rows], self.parameters[rows], self.relations[rows],
        )  # fmt: skip


def _picked(table: Integers, columns: list[int]) -> Integers:
    """Some columns of a table; a view if they are none or the first ones, as is common."""
    n = len(columns)
    return table[:, :n] if columns == list(range(n)) else table[:, columns]


@dataclass(frozen=True)
class Guard:
    """Divisors of a batch, numbered through the whole program, with the slots of the quotients.

    ``constrained``: they belong to constraints, and other states may be needed where one is small.
    """

    divisors: Batch
    quotients: Integers
    constrained: bool


@dataclass(frozen=True)
class Linear:
    """``A z + g = 0`` with a matrix that is constant during a run; g in slots of its own (rows without one have none)."""

    unknowns: Integers  # slots
    matrix: tuple[Batch, ...]  # targets: row * n + column
    known: Integers  # slots of g
    known_rows: Integers
    equations: Integers

    @cached_property
    def places(self) -> Integers:
        """Flat index of each matrix entry: row * n + column."""
        return np.concatenate([b.targets for b in self.matrix])


@dataclass(frozen=True)
class Newton:
    """Equations solved by iteration (in one step where they are linear with a varying matrix), in tearing order."""

    unknowns: Integers  # slots
    residuals: tuple[Batch, ...]  # targets: row
    jacobian: tuple[Batch, ...]  # targets: row * n + column
    linear: bool
    equations: Integers
    lead: int  # the first unknowns, which follow from the others in sequence: a leading lower triangular part of the matrix
    constrained: bool  # whether constraints on the states are among the equations, so that other states may be needed somewhere

    @cached_property
    def switched(self) -> bool:
        """Whether the equations are linear with a matrix that only events change, as that of friction that sticks or slides."""
        return self.linear and not any(b.kernel.columns or b.kernel.on_time for b in self.jacobian)

    @cached_property
    def discrete(self) -> Integers:
        """Entries of the discrete state that the matrix depends on."""
        return np.unique(np.concatenate([np.empty(0, np.int64), *(b.relations.ravel() for b in self.jacobian)]))

    @cached_property
    def order(self) -> EliminationOrder | None:
        """Order in which the matrix is eliminated by its sparsity pattern; None where it is small or dense."""
        n = len(self.unknowns)
        if n < LARGE:
            return None
        targets = np.unique(np.concatenate([b.targets for b in self.jacobian]))
        return elimination_order(n, targets) if len(targets) <= SPARSE * n * n else None

    @cached_property
    def rests(self) -> tuple[Batch, ...]:
        """The residuals of equations that are not zero where all unknowns are; targets: row."""
        found = []
        for batch in self.residuals:
            inside = np.isin(batch.arguments, self.unknowns) | (batch.argument_signs == 0)
            for pattern in np.unique(inside, axis=0):
                without = frozenset(batch.kernel.columns[a] for a in np.flatnonzero(pattern))
                if not without_columns(batch.kernel, without).is_zero:
                    found.append(batch.take(np.flatnonzero((inside == pattern).all(axis=1))))
        return tuple(found)


Step = Batch | Linear | Newton


@dataclass(frozen=True, eq=False)
class Program:
    """Steps in topological order, and the slots of inputs and outputs.

    Attributes
    ----------
    states, inputs : tuples of (variable, order)
        Nodes in the first slots.
    slots : mapping of (variable, order) to int
    n_slots : int
    steps : tuple
        Level by level, in batches as large as possible.
    outputs : tuple of (variable, order)
        What the program computes, usually the derivatives of the states.
    pivots : tuple of Batch
        Coefficients that are divided by, and so must not vanish.
    residuals : tuple of int
        Slots of residuals, appended to the outputs where algebraic unknowns are left to the integrator.
    constrained : frozenset of int
        Slots that constraints on the states give, each solved on its own.
    """

    states: tuple[Node, ...]
    inputs: tuple[Node, ...]
    slots: dict[Node, int]
    n_slots: int
    steps: tuple[Step, ...]
    outputs: tuple[Node, ...]
    pivots: tuple[Batch, ...]
    residuals: tuple[int, ...] = ()
    constrained: frozenset[int] = frozenset()
    memo: dict[Any, Any] = field(init=False, default_factory=dict)  # cache of `memoised` functions
    solved: dict[int, Any] = field(
        init=False, default_factory=dict
    )  # last entries and solution of linear blocks, made by `prepare`

    @cached_property
    def output_slots(self) -> Integers:
        return np.array([*(self.slots[n] for n in self.outputs), *self.residuals], np.int64)

    @cached_property
    def inputs_read(self) -> NDArray[np.bool_]:
        """Which of the inputs anything is computed from."""
        steps = [s.residuals if isinstance(s, Newton) else (s,) for s in self.steps if not isinstance(s, Linear)]
        read = [self.output_slots, *(batch.arguments.ravel() for step in steps for batch in step)]
        found: NDArray[np.bool_] = np.isin(len(self.states) + np.arange(len(self.inputs)), np.concatenate(read))
        return found

    @cached_property
    def undifferentiated(self) -> tuple[Integers, Integers]:
        """Variables that are not derivatives: their numbers and their slots."""
        pairs = [(v, slot) for (v, k), slot in self.slots.items() if k == 0]
        table = np.array(pairs, np.int64).reshape(len(pairs), 2)
        return table[:, 0], table[:, 1]

    @cached_property
    def linear_blocks(self) -> tuple[Linear, ...]:
        """The blocks whose matrix is constant during a run."""
        return tuple(s for s in self.steps if isinstance(s, Linear))

    @cached_property
    def constant_groups(self) -> tuple[tuple[Batch, ...], ...]:
        """Batches that depend on parameters only: pivots and the matrices of linear blocks."""
        return (self.pivots, *(s.matrix for s in self.steps if isinstance(s, Linear)))

    @cached_property
    def constant_parts(self) -> tuple[slice, ...]:
        """Range of each group in the concatenated values."""
        ends = [0, *itertools.accumulate(sum(len(b) for b in group) for group in self.constant_groups)]
        return tuple(itertools.starmap(slice, itertools.pairwise(ends)))

    @cached_property
    def on_time(self) -> bool:
        """Whether anything depends on time explicitly."""
        return any(
            b.kernel.on_time
            for s in self.steps
            for b in ([s] if isinstance(s, Batch) else s.residuals if isinstance(s, Newton) else ())
        )

    @cached_property
    def iterated(self) -> tuple[Newton, ...]:
        """Nonlinear blocks: those that take several Newton iterations."""
        return tuple(s for s in self.steps if isinstance(s, Newton) and not s.linear)

    @cached_property
    def watched(self) -> tuple[Newton, ...]:
        """Blocks whose determinant must not fall far in a run: nonlinear ones and, beside constrained ones, those of derivatives."""
        blocks = [s for s in self.steps if isinstance(s, Newton)]
        return tuple(s for s in blocks if not s.linear or (self.may_need_others and s.constrained and not s.switched))

    @property
    def may_need_others(self) -> bool:
        """Whether constraints on the states are solved in a nonlinear block, which may become singular for these states."""
        return any(step.constrained for step in self.iterated)

    @cached_property
    def guards(self) -> tuple[Guard, ...]:
        """Divisors that may change sign, of all equations solved individually."""
        found, n = [], 0
        residuals = np.array(self.residuals, np.int64)
        constrained = self.constrained if self.may_need_others else frozenset()
        for batch in (step for step in self.steps if isinstance(step, Batch)):
            if np.isin(batch.targets, residuals).any():
                continue
            for kernel in batch.kernel.divisors:
                columns = [batch.kernel.columns.index(c) for c in kernel.columns]
                parameters = [batch.kernel.parameters.index(p) for p in kernel.parameters]
                relations = [batch.kernel.relations.index(r) for r in kernel.relations]
                divisors = Batch(
                    kernel, batch.equations, np.arange(n, n + len(batch)), np.ones_like(batch.signs), batch.arguments[:, columns],
                    batch.argument_signs[:, columns], batch.parameters[:, parameters], batch.relations[:, relations],
                )  # fmt: skip
                found.append(Guard(divisors, batch.targets, not constrained.isdisjoint(batch.targets.tolist())))
                n += len(batch)
        return tuple(found)

    @property
    def n_guards(self) -> int:
        return sum(len(guard.quotients) for guard in self.guards)

    @property
    def n_unknowns(self) -> int:
        return len(self.slots) - len(self.states) - len(self.inputs)

    @cached_property
    def is_linear(self) -> bool:
        """Whether it is linear in states and unknowns with constant coefficients (inputs and time may enter in any way)."""
        return all(
            not isinstance(s, Newton) and all(b.kernel.template.linear for b in ([s] if isinstance(s, Batch) else s.matrix))
            for s in self.steps
        )


def slots_behind(program: Program, wanted: Integers, slopes: bool = False) -> NDArray[np.bool_]:
    """The slots that some slots depend on, including themselves; ``slopes``: without those whose derivative is zero everywhere."""
    found = np.zeros(program.n_slots, bool)
    found[wanted] = True

    def mark(batch: Batch, use: NDArray[np.bool_]) -> None:
        for a in batch.active if slopes else range(batch.arguments.shape[1]):
            found[batch.arguments[use & (batch.argument_signs[:, a] != 0), a]] = True

    for step in reversed(program.steps):
        if isinstance(step, Batch):
            mark(step, found[step.targets])
        elif found[step.unknowns].any():
            if isinstance(step, Linear):
                found[step.known] = True
            else:
                for batch in step.residuals:
                    mark(batch, np.ones(len(batch), bool))
    return found
