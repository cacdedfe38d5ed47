"""`Program`: what to compute, in which order, in arrays of integers.

Every quantity has a slot: first the states, then the given inputs, then the unknowns. A `Batch` applies one kernel to many
instances; a `Linear` block solves equations whose matrix is constant during a run (factorised beforehand); a `Newton` block solves
the others.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.codegen.kernels import (
    Kernel,
    differentiated,
    partial_kernel,
    relation_kernel,
    residual_kernel,
    solve_kernel,
)
from gearlib.flatten.templates import Template
from gearlib.structure.analysis import Structure
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import Block, reach, sort_blocks

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Batch:
    """One kernel for many instances: ``slot[targets] = signs * kernel(slot[arguments] * argument_signs, ...)``."""

    kernel: Kernel
    equations: Integers  # which wrote it; -1 - instance for equations of discrete variables
    targets: Integers  # (n,)
    signs: Integers  # (n,)
    arguments: Integers  # (n, columns)
    argument_signs: Integers
    parameters: Integers  # (n, parameters) into the parameter table
    relations: Integers  # (n, relations) into the relation values

    def __len__(self) -> int:
        return len(self.targets)

    def take(self, rows: Integers) -> Batch:
        return Batch(
            self.kernel, self.equations[rows], self.targets[rows], self.signs[rows], self.arguments[rows],
            self.argument_signs[rows], self.parameters[rows], self.relations[rows],
        )  # fmt: skip


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
        """Where each entry of the matrix stands: row * n + column."""
        return np.concatenate([b.targets for b in self.matrix])


@dataclass(frozen=True)
class Newton:
    """Equations solved by iteration (once, where they are linear with a matrix that varies)."""

    unknowns: Integers  # slots
    residuals: tuple[Batch, ...]  # targets: row
    jacobian: tuple[Batch, ...]  # targets: row * n + column
    linear: bool
    equations: Integers


Step = Batch | Linear | Newton


@dataclass(frozen=True)
class Program:
    """Steps in an order in which they can be carried out.

    Attributes
    ----------
    states, inputs : tuples of (variable, order)
        Held by the first slots.
    slots : mapping of (variable, order) to int
    n_slots : int
    steps : tuple
        Level by level: batches as large as possible.
    outputs : tuple of (variable, order)
        What the program is for; derivatives of the states, usually.
    pivots : tuple of Batch
        Coefficients that are divided by, and so must not vanish.
    """

    states: tuple[Node, ...]
    inputs: tuple[Node, ...]
    slots: dict[Node, int]
    n_slots: int
    steps: tuple[Step, ...]
    outputs: tuple[Node, ...]
    pivots: tuple[Batch, ...]

    @cached_property
    def output_slots(self) -> Integers:
        return np.array([self.slots[n] for n in self.outputs], np.int64)

    @cached_property
    def constants(self) -> Callable[[list[float]], list[float]] | None:
        """Pivots and entries of the linear blocks as one function of the parameters, where there are not very many."""
        from gearlib.codegen.scalars import constants_function

        return constants_function([*self.pivots, *(b for s in self.steps if isinstance(s, Linear) for b in s.matrix)])

    @property
    def n_unknowns(self) -> int:
        return len(self.slots) - len(self.states) - len(self.inputs)

    @cached_property
    def is_linear(self) -> bool:
        """Linear in states and unknowns, with constant coefficients (inputs and time may enter in any way)."""
        return all(
            not isinstance(s, Newton) and all(b.kernel.template.linear for b in ([s] if isinstance(s, Batch) else s.matrix))
            for s in self.steps
        )


def build(structure: Structure, targets: Iterable[Node], states: Sequence[Node] | None, dynamic: bool) -> Program:
    """The program that computes ``targets`` from states and inputs.

    Parameters
    ----------
    structure : Structure
    targets : iterable of (variable, order)
    states : sequence of nodes, optional
        Which states hold the first slots, in that order; by default those in use.
    dynamic : bool
        Whether the derivatives of all states in use are targets as well.
    """
    targets = list(dict.fromkeys(targets))
    unknowns, used = reach(structure.dependence, targets, dynamic)
    order = tuple(states) if states is not None else tuple(sorted(used))
    blocks = sort_blocks(structure.dependence, unknowns)
    outputs = [(v, k + 1) for v, k in order] if dynamic else targets
    return _Builder(structure, blocks, order).program(tuple(outputs))


class _Builder:
    """Collects steps while it goes through the blocks."""

    def __init__(self, structure: Structure, blocks: Sequence[Block], states: tuple[Node, ...]) -> None:
        self.structure, self.model, self.blocks = structure, structure.model, blocks
        self.states = states
        given = set(self.model.inputs.tolist())
        inputs = [(int(v), 0) for v in self.model.inputs]
        extra: set[Node] = set()
        if given:  # derivatives of inputs, where a constraint on one was differentiated
            counts = structure.differentiation.counts
            extra = {n for e, c in enumerate(counts) for n in structure.dependence.columns(e, c) if n[0] in given and n[1] > 0}
            extra = {(v, k) for v, top in extra for k in range(1, top + 1)}
        self.inputs = (*inputs, *sorted(extra))
        self.slots: dict[Node, int] = {n: i for i, n in enumerate((*states, *self.inputs))}
        for block in blocks:
            for node in block.unknowns:
                self.slots.setdefault(node, len(self.slots))
        self.n_slots = len(self.slots)
        self.table = np.full((1 + max((k for _, k in self.slots), default=0), self.model.n_variables), -1)
        for (v, k), slot in self.slots.items():
            self.table[k, v] = slot
        self.groups = (*self.model.groups, *(u.equations for u in self.model.discretes.updates))
        self.first_equation = np.cumsum([0, *(len(g) for g in self.model.groups)])
        self.variables = [g.variables.tolist() for g in self.model.groups]
        self.signs = [g.signs.tolist() for g in self.model.groups]

    def program(self, outputs: tuple[Node, ...]) -> Program:
        scalar: dict[tuple[Kernel, int, int], list[tuple[int, int, int]]] = defaultdict(list)
        pivots: dict[tuple[Kernel, int, int], list[tuple[int, int, int]]] = defaultdict(list)
        others: list[Linear | Newton] = []
        for block in self.blocks:
            done = len(block.unknowns) == 1 and self._assign(block, scalar, pivots)
            if not done:
                others.append(self._block(block, scalar))
        batches = [self.batch(kernel, g, k, rows) for (kernel, g, k), rows in scalar.items()]
        checks = tuple(self.batch(kernel, g, k, rows) for (kernel, g, k), rows in pivots.items())
        steps = schedule(batches, others, self.n_slots, len(self.states) + len(self.inputs))
        return Program(self.states, self.inputs, self.slots, self.n_slots, steps, outputs, checks)

    def places(self, used: Integers) -> list[tuple[Kernel, int, int, int, int, int]]:
        """(kernel, group, row, kind, target, sign) of what must be evaluated: 0 relations, 1 discrete variables, 2 states."""
        model, n_relations, n_discrete = self.model, self.model.n_relations, len(self.model.discretes)
        found: list[tuple[Kernel, int, int, int, int, int]] = []
        for relation in used[used < n_relations].tolist():
            g = int(np.searchsorted(model.first_relations, relation, side="right")) - 1
            i, j = divmod(relation - int(model.first_relations[g]), len(self.groups[g].template.relations))
            found.append((relation_kernel(self.groups[g].template, j), g, i, 0, relation, 1))
        discrete = {int(m - n_relations) % n_discrete for m in used if n_relations <= m < n_relations + 2 * n_discrete}
        position = {node: i for i, node in enumerate(self.states)}
        for u, update in enumerate(model.discretes.updates):
            g = len(model.groups) + u
            kernel = residual_kernel(update.equations.template)
            for i, target in enumerate(update.targets.tolist()):
                node = (int(model.representative[target]), 0) if update.reinit else (-1, 0)
                if update.reinit and node in position:
                    found.append((kernel, g, i, 2, position[node], int(model.sign[target])))
                elif not update.reinit and target in discrete:
                    found.append((kernel, g, i, 1, n_relations + target, 1))
        return found

    def nodes(self, kernel: Kernel, g: int, i: int) -> list[Node]:
        """Variables with their orders that a kernel of one row needs."""
        group = self.groups[g]
        columns = [*kernel.template.columns, *kernel.template.relation_columns]
        where = {name: c for c, name in enumerate(group.template.locals)}
        named = [(where[columns[c][0]], columns[c][1]) for c in kernel.columns]
        return [(int(group.variables[i, c]), order) for c, order in named if group.signs[i, c]]

    def modes(self, kernel: Kernel, g: int, i: int) -> Integers:
        """Relations and discrete values that a kernel of one row needs."""
        return self._modes(kernel, g, np.array([i]))[0]

    def _modes(self, kernel: Kernel, g: int, rows: Integers) -> Integers:
        group, template = self.groups[g], kernel.template
        n = len(template.relations)
        result = np.empty((len(rows), len(kernel.relations)), np.int64)
        for a, c in enumerate(kernel.relations):
            if c < n:
                result[:, a] = self.model.first_relations[g] + rows * n + c
            else:
                result[:, a] = self.model.n_relations + group.held[rows, group.template.held.index(template.held[c - n])]
        return result

    def _place(self, e: int) -> tuple[int, int]:
        return self.structure.rows[e]

    def _template(self, e: int, k: int) -> tuple[Template, int, int]:
        g, i = self._place(e)
        return differentiated(self.model.groups[g].template, k), g, i

    def _positions(self, template: Template, g: int, i: int) -> list[tuple[int, Node, int]]:
        """(column, node, sign) of one equation; what is always zero is left out."""
        variables, signs = self.variables[g][i], self.signs[g][i]
        base = self.model.groups[g].template.locals
        if template.locals == base:
            return [(c, (variables[j], o), signs[j]) for c, (j, o) in enumerate(template.local_columns) if signs[j]]
        where = {name: j for j, name in enumerate(base)}
        result = []
        for c, (name, order) in enumerate(template.columns):
            j = where[name]
            if signs[j]:
                result.append((c, (variables[j], order), signs[j]))
        return result

    def _assign(self, block: Block, scalar: dict, pivots: dict) -> bool:  # type: ignore[type-arg]
        node, (e, k) = block.unknowns[0], block.equations[0]
        template, g, i = self._template(e, k)
        mine = [(c, sign) for c, n, sign in self._positions(template, g, i) if n == node]
        if len(mine) != 1:
            return False
        column, sign = mine[0]
        kernel = solve_kernel(template, column)
        if kernel is None:
            return False
        partial = template.partials[column]
        if partial.number is None and partial.constant:
            pivots[partial_kernel(template, column), g, k].append((i, 0, 1))
        scalar[kernel, g, k].append((i, self.slots[node], sign))
        return True

    def _block(self, block: Block, scalar: dict) -> Linear | Newton:  # type: ignore[type-arg]
        position = {node: c for c, node in enumerate(block.unknowns)}
        n = len(block.unknowns)
        matrix: dict[tuple[Kernel, int, int], list[tuple[int, int, int]]] = defaultdict(list)
        residual: dict[tuple[Kernel, int, int], list[tuple[int, int, int]]] = defaultdict(list)
        constant = linear = True
        rows = []
        for r, (e, k) in enumerate(block.equations):
            template, g, i = self._template(e, k)
            inside = [(c, node, sign) for c, node, sign in self._positions(template, g, i) if node in position]
            columns = {c for c, _, _ in inside}
            for c, node, sign in inside:
                partial = template.partials[c]
                constant &= partial.constant
                linear &= not partial.depends_on & columns
                matrix[partial_kernel(template, c), g, k].append((i, r * n + position[node], sign))
            rows.append((template, g, i, k, frozenset(columns)))
        unknowns = np.array([self.slots[u] for u in block.unknowns], np.int64)
        equations = np.array([e for e, _ in block.equations], np.int64)
        entries = tuple(self.batch(kernel, g, k, found) for (kernel, g, k), found in matrix.items())
        if constant and linear:
            known, known_rows = [], []
            for r, (template, g, i, k, columns_) in enumerate(rows):
                kernel = residual_kernel(template, columns_)
                if not kernel.is_zero:
                    known.append(self.n_slots)
                    known_rows.append(r)
                    scalar[kernel, g, k].append((i, self.n_slots, 1))
                    self.n_slots += 1
            return Linear(unknowns, entries, np.array(known, np.int64), np.array(known_rows, np.int64), equations)
        for r, (template, g, i, k, _) in enumerate(rows):
            residual[residual_kernel(template), g, k].append((i, r, 1))
        residuals = tuple(self.batch(kernel, g, k, found) for (kernel, g, k), found in residual.items())
        return Newton(unknowns, residuals, entries, linear, equations)

    def batch(self, kernel: Kernel, g: int, k: int, found: list[tuple[int, int, int]]) -> Batch:
        """The rows (row of the group, target, sign) of one kernel as a batch."""
        group = self.groups[g]
        rows, targets, signs = (np.array(x, np.int64) for x in zip(*found, strict=True))
        where = {name: j for j, name in enumerate(group.template.locals)}
        template = kernel.template
        columns = [*template.columns, *template.relation_columns]
        arguments = np.empty((len(rows), len(kernel.columns)), np.int64)
        argument_signs = np.empty_like(arguments)
        for a, c in enumerate(kernel.columns):
            name, order = columns[c]
            j = where[name]
            argument_signs[:, a] = group.signs[rows, j]
            arguments[:, a] = np.where(argument_signs[:, a] == 0, 0, self.table[order, group.variables[rows, j]])
        own = {name: j for j, name in enumerate(group.template.parameters)}
        parameters = group.parameters[rows][:, [own[template.parameters[p]] for p in kernel.parameters]]
        continuous = g < len(self.model.groups)
        equations = self.first_equation[g] + rows if continuous else -1 - group.owners[rows]
        relations = self._modes(kernel, g, rows)
        return Batch(kernel, equations, targets, signs, arguments, argument_signs, parameters, relations)


@dataclass(frozen=True)
class Relations:
    """What changes at events: comparisons and discrete variables that a program uses, and the program that they need.

    Modes are numbered through the whole model: relations, then discrete values (see `gearlib.flatten.model.Discretes`). Each batch
    holds one kernel; its targets are modes, or states for ``reinits``.
    """

    program: Program
    batches: tuple[Batch, ...]  # what relations compare
    discretes: tuple[Batch, ...]
    reinits: tuple[Batch, ...]
    used: Integers  # relations, sorted
    on_time: NDArray[np.bool_]  # of each used one: compares nothing but time


def relations_of(structure: Structure, program: Program, wanted: Sequence[int] = ()) -> Relations:
    """Everything needed to handle the events of a program, and of discrete variables that are wanted as outputs."""
    model = structure.model
    builder = _Builder(structure, (), program.states)
    used = np.union1d(_used_modes(program), model.n_relations + np.array(wanted, np.int64))
    while True:
        places = builder.places(used)
        nodes = sorted({n for p in places for n in builder.nodes(*p[:3])})
        helper = build(structure, nodes, program.states, dynamic=False)
        held = [builder.modes(*p[:3]) for p in places]
        more = np.unique(np.concatenate([used, _used_modes(helper), *held]).astype(np.int64))
        if len(more) == len(used):
            break
        used = more
    builder.table = _slot_table(helper, model.n_variables)
    kinds: list[dict[tuple[Kernel, int, int], list[tuple[int, int, int]]]] = [defaultdict(list) for _ in range(3)]
    for kernel, g, i, kind, target, sign in places:
        kinds[kind][kernel, g, 0].append((i, target, sign))
    batches = [tuple(builder.batch(kernel, g, k, rows) for (kernel, g, k), rows in kind.items()) for kind in kinds]
    relations = used[used < model.n_relations]
    moving = {p[4] for p in places if p[3] == 0 and (builder.nodes(*p[:3]) or len(builder.modes(*p[:3])))}
    on_time = np.array([int(r) not in moving for r in relations], bool)
    return Relations(helper, batches[0], batches[1], batches[2], relations, on_time)


def _used_modes(program: Program) -> Integers:
    parts = [np.empty(0, np.int64)]
    for step in program.steps:
        if isinstance(step, Batch):
            parts.append(step.relations.ravel())
        elif isinstance(step, Newton):
            parts += [b.relations.ravel() for b in (*step.residuals, *step.jacobian)]
    return np.unique(np.concatenate(parts))


def _slot_table(program: Program, n_variables: int) -> Integers:
    table = np.full((1 + max((k for _, k in program.slots), default=0), n_variables), -1)
    for (v, k), slot in program.slots.items():
        table[k, v] = slot
    return table


def schedule(batches: Sequence[Batch], others: Sequence[Linear | Newton], n_slots: int, n_known: int) -> tuple[Step, ...]:
    """Levels: each step as early as its arguments allow; steps of one level and kernel form one batch."""
    maker = np.full(n_slots, -1)
    kinds: list[tuple[int, int]] = []  # (batch, row) or (-1 - block, 0)
    arguments: list[list[int]] = []
    for b, batch in enumerate(batches):
        maker[batch.targets] = np.arange(len(kinds), len(kinds) + len(batch))
        kinds += [(b, i) for i in range(len(batch))]
        arguments += np.where(batch.argument_signs == 0, -1, batch.arguments).tolist()
    for o, block in enumerate(others):
        maker[block.unknowns] = len(kinds)
        kinds.append((-1 - o, 0))
        if isinstance(block, Linear):
            arguments.append(block.known.tolist())
        else:
            own = set(block.unknowns.tolist())
            outside = {a for b_ in (*block.residuals, *block.jacobian) for a in b_.arguments[b_.argument_signs != 0].tolist()}
            arguments.append(sorted(outside - own))
    level = _levels(arguments, maker.tolist(), n_known)
    buckets: dict[tuple[int, int], list[int]] = defaultdict(list)
    for s, (b, i) in enumerate(kinds):
        buckets[level[s], b].append(i)
    steps: list[Step] = []
    for (_, b), rows in sorted(buckets.items()):
        if b < 0:
            steps.append(others[-1 - b])
        else:
            steps.append(batches[b] if len(rows) == len(batches[b]) else batches[b].take(np.array(rows, np.int64)))
    return tuple(steps)


def _levels(arguments: Sequence[Sequence[int]], maker: Sequence[int], n_known: int) -> list[int]:
    level = [-1] * len(arguments)
    for start in range(len(arguments)):
        stack = [start]
        while stack:
            s = stack[-1]
            if level[s] >= 0:
                stack.pop()
                continue
            before = [maker[a] for a in arguments[s] if a >= n_known]
            open_ = [m for m in before if level[m] < 0]
            if open_:
                stack += open_
            else:
                level[s] = 1 + max((level[m] for m in before), default=0)
                stack.pop()
    return level
