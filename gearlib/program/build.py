"""`build`: lowers sorted blocks to a `Program`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import Kernel, differentiated, partial_kernel, relation_kernel, residual_kernel, solve_kernel
from gearlib.equations.template import Template, columns_among
from gearlib.program.program import Batch, Linear, Newton, Program
from gearlib.program.schedule import renumber, schedule
from gearlib.reduce.reduction import Structure
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import Block, reach, sort_blocks
from gearlib.structure.tearing import Tearing, tear

Integers = NDArray[np.int64]
# (kernel, group, times differentiated) -> (row of the group, target, sign) per instance
Found = dict[tuple[Kernel, int, int], list[tuple[int, int, int]]]
# kernel, group, row, kind (0 relation, 1 discrete variable, 2 state), target, sign of what is evaluated at events
Place = tuple[Kernel, int, int, int, int, int]
# template, group, row, times differentiated, columns inside a block, (column, unknown of the block, sign) of these
_Row = tuple[Template, int, int, int, frozenset[int], list[tuple[int, int, int]]]


def build(structure: Structure, targets: Iterable[Node], states: Sequence[Node] | None, dynamic: bool) -> Program:
    """The program that computes ``targets`` from states and inputs.

    Parameters
    ----------
    structure : Structure
    targets : iterable of (variable, order)
    states : sequence of nodes, optional
        The states, in the order of the first slots; by default those in use.
    dynamic : bool
        Whether the derivatives of all states are targets as well, also of those that only relations depend on.
    """
    targets = list(dict.fromkeys(targets))
    rates = [(v, k + 1) for v, k in states or ()] if dynamic else []
    unknowns, used = reach(structure, [*targets, *rates], dynamic)
    order = tuple(states) if states is not None else tuple(sorted(used))
    blocks = sort_blocks(structure, unknowns)
    outputs = [(v, k + 1) for v, k in order] if dynamic else targets
    return Builder(structure, blocks, order).program(tuple(outputs))


def slot_table(slots: Mapping[Node, int], n_variables: int) -> Integers:
    """The slot of each variable and order of derivative, -1 where there is none."""
    table = np.full((1 + max((k for _, k in slots), default=0), n_variables), -1)
    for (v, k), slot in slots.items():
        table[k, v] = slot
    return table


class Builder:
    """Collects the steps of a program, block by block."""

    def __init__(self, structure: Structure, blocks: Sequence[Block], states: tuple[Node, ...]) -> None:
        self.structure, self.model, self.blocks = structure, structure.model, blocks
        self.states = states
        self.inputs = tuple((int(v), 0) for v in self.model.inputs)
        self.slots: dict[Node, int] = {n: i for i, n in enumerate((*states, *self.inputs))}
        for block in blocks:
            for node in block:
                self.slots.setdefault(node, len(self.slots))
        self.n_slots = len(self.slots)
        self.residuals: dict[Node, int] = {}  # slots of residuals, keyed by the tearing variables that are among the states
        self.constrained: set[int] = set()  # slots that constraints on the states give
        self.table = slot_table(self.slots, self.model.n_variables)
        self.groups = (*self.model.groups, *(u.equations for u in self.model.updates))

    def program(self, outputs: tuple[Node, ...]) -> Program:
        scalar: Found = defaultdict(list)
        pivots: Found = defaultdict(list)
        others: list[Linear | Newton] = []
        for block in self.blocks:
            done = len(block) == 1 and self._assign(block, scalar, pivots)
            if not done and (emitted := self._block(block, scalar, pivots)) is not None:
                others.append(emitted)
        batches = self._batches(scalar)
        checks = self._batches(pivots)
        n_known = len(self.states) + len(self.inputs)
        steps = schedule(batches, others, self.n_slots, n_known)
        place, steps = renumber(steps, self.n_slots, n_known)
        slots = {node: int(place[slot]) for node, slot in self.slots.items()}
        n_slots = int(place.max(initial=-1)) + 1
        residuals = tuple(int(place[self.residuals[node]]) for node in self.states if node in self.residuals)
        constrained = frozenset(int(place[slot]) for slot in self.constrained)
        return Program(self.states, self.inputs, slots, n_slots, steps, outputs, checks, residuals, constrained)

    def places(self, used: Integers) -> list[Place]:
        """The kernels to evaluate at events, where some entries of the discrete state are used."""
        model, n_relations, n_variables = self.model, self.model.n_relations, len(self.model.discretes)
        found: list[Place] = []
        for relation in used[used < n_relations].tolist():
            g = int(np.searchsorted(model.first_relations, relation, side="right")) - 1
            i, j = divmod(relation - int(model.first_relations[g]), len(self.groups[g].template.relations))
            found.append((relation_kernel(self.groups[g].template, j), g, i, 0, relation, 1))
        variables = {int(m - n_relations) % n_variables for m in used if n_relations <= m < n_relations + 2 * n_variables}
        position = {node: i for i, node in enumerate(self.states)}
        for u, update in enumerate(model.updates):
            g = len(model.groups) + u
            kernel = residual_kernel(update.equations.template)
            for i, target in enumerate(update.targets.tolist()):
                if not update.reinit:
                    found += [(kernel, g, i, 1, n_relations + target, 1)] if target in variables else []
                elif (node := (int(model.representative[target]), 0)) in position:
                    found.append((kernel, g, i, 2, position[node], int(model.sign[target])))
        return found

    def nodes(self, kernel: Kernel, g: int, i: int) -> list[Node]:
        """Variables, with their derivative orders, that a kernel reads in one row."""
        group = self.groups[g]
        columns = [*kernel.template.columns, *kernel.template.relation_columns]
        where = {name: c for c, name in enumerate(group.template.locals)}
        named = [(where[columns[c][0]], columns[c][1]) for c in kernel.columns]
        return [(int(group.variables[i, c]), order) for c, order in named if group.signs[i, c]]

    def discrete(self, kernel: Kernel, g: int, i: int) -> Integers:
        """Relations and discrete values that a kernel reads in one row."""
        discrete: Integers = self._discrete(kernel, g, np.array([i]))[0]
        return discrete

    def _discrete(self, kernel: Kernel, g: int, rows: Integers) -> Integers:
        group, template = self.groups[g], kernel.template
        n = len(template.relations)
        result = np.empty((len(rows), len(kernel.relations)), np.int64)
        for a, c in enumerate(kernel.relations):
            if c < n:
                result[:, a] = self.model.first_relations[g] + rows * n + c
            else:
                result[:, a] = (
                    self.model.n_relations + group.discretes[rows, group.template.discretes.index(template.discretes[c - n])]
                )
        return result

    def template(self, e: int, k: int) -> tuple[Template, int, int]:
        """The template of an equation's k-th derivative, with its group and row."""
        g, i = self.model.places[e]
        return differentiated(self.model.groups[g].template, k), g, i

    def _positions(self, template: Template, g: int, i: int) -> list[tuple[int, Node, int]]:
        """(column, node, sign) of one equation; what is identically zero is left out."""
        variables, signs = (rows[i] for rows in self.model.groups[g].lists)
        columns = columns_among(template, self.model.groups[g].template.locals)
        return [(c, (variables[j], order), signs[j]) for c, (j, order) in enumerate(columns) if signs[j]]

    def _assign(self, block: Block, scalar: Found, pivots: Found) -> bool:
        """Emit an explicit assignment; False where the equation is not linear in the unknown."""
        (node,) = block
        e, k = self.structure.equation(node)
        template, g, i = self.template(e, k)
        ((column, sign),) = ((c, sign) for c, n, sign in self._positions(template, g, i) if n == node)
        kernel = solve_kernel(template, column)
        if kernel is None:
            return False
        if self._copies(kernel, template, g, i, node, sign):
            return True
        partial = partial_kernel(template, column)
        if partial.number is None and partial.constant:
            pivots[partial, g, k].append((i, 0, 1))
        scalar[kernel, g, k].append((i, self.slots[node], sign))
        if k < self.structure.differentiation.counts[e]:
            self.constrained.add(self.slots[node])
        return True

    def _copies(self, kernel: Kernel, template: Template, g: int, i: int, node: Node, sign: int) -> bool:
        """Give an unknown that equals another one the same slot; one bound to an input gets its own, since the input may be varied."""
        if not kernel.is_copy:
            return False
        source = [(n, s) for c, n, s in self._positions(template, g, i) if c == kernel.columns[0]]
        if len(source) != 1 or source[0][1] * sign != 1 or template.binds:
            return False
        (v, k), (w, m) = node, source[0][0]
        self.table[k, v] = self.slots[node] = self.table[m, w]
        return True

    def _block(self, block: Block, scalar: Found, pivots: Found) -> Linear | Newton | None:
        """Emit a block of several unknowns: linear with a constant matrix, or torn for Newton's method; None if its tears are states."""
        position = {node: c for c, node in enumerate(block)}
        solving = [self.structure.equation(node) for node in block]
        rows = []
        safe: list[dict[int, bool]] = []
        constant = linear = True
        for e, k in solving:
            template, g, i = self.template(e, k)
            inside = [(c, position[node], sign) for c, node, sign in self._positions(template, g, i) if node in position]
            columns = frozenset(c for c, _, _ in inside)
            fixed = {u: template.fixed[c] for c, u, _ in inside}
            constant &= all(fixed.values())
            linear &= all(columns.isdisjoint(partial_kernel(template, c).columns) for c, _, _ in inside)
            safe.append(fixed)
            rows.append((template, g, i, k, columns, inside))
        order = tear(safe) if not (constant and linear) else Tearing(tuple(range(len(rows))), tuple(range(len(rows))), 0)
        place = {column: c for c, column in enumerate(order.columns)}
        rows = [rows[r] for r in order.rows]
        if not linear and set(tears := [block[u] for u in order.tears]) <= set(self.states):
            self._torn(rows, tears, order.columns, block, scalar, pivots)
            return None
        unknowns = np.array([self.slots[block[u]] for u in order.columns], np.int64)
        equations = np.array([solving[r][0] for r in order.rows], np.int64)
        matrix: Found = defaultdict(list)
        for r, (template, g, i, k, _, inside) in enumerate(rows):
            for c, u, sign in inside:
                matrix[partial_kernel(template, c), g, k].append((i, r * len(rows) + place[u], sign))
        entries = self._batches(matrix)
        if not (constant and linear):
            residual: Found = defaultdict(list)
            for r, (template, g, i, k, _, _) in enumerate(rows):
                residual[residual_kernel(template), g, k].append((i, r, 1))
            counts = self.structure.differentiation.counts
            constrained = any(k < counts[e] for e, k in solving)
            return Newton(unknowns, self._batches(residual), entries, linear, equations, order.lead, constrained)
        known, known_rows = [], []
        for r, (template, g, i, k, columns, _) in enumerate(rows):
            kernel = residual_kernel(template, columns)
            if not kernel.is_zero:
                known.append(self.n_slots)
                known_rows.append(r)
                scalar[kernel, g, k].append((i, self.n_slots, 1))
                self.n_slots += 1
        return Linear(unknowns, entries, np.array(known, np.int64), np.array(known_rows, np.int64), equations)

    def _torn(
        self, rows: list[_Row], tears: list[Node], columns: tuple[int, ...], block: Block, scalar: Found, pivots: Found
    ) -> None:  # fmt: skip
        """Emit a block with known tearing variables: an assignment for every other unknown, a residual for every tearing variable."""
        lead = len(rows) - len(tears)
        for (template, g, i, k, _, inside), u in zip(rows[:lead], columns, strict=False):
            column, sign = next((c, sign) for c, place, sign in inside if place == u)
            kernel = solve_kernel(template, column)
            assert kernel is not None, "a row is solved for what it holds with a constant coefficient"
            partial = partial_kernel(template, column)
            if partial.number is None:
                pivots[partial, g, k].append((i, 0, 1))
            scalar[kernel, g, k].append((i, self.slots[block[u]], sign))
        for (template, g, i, k, _, _), node in zip(rows[lead:], tears, strict=True):
            scalar[residual_kernel(template), g, k].append((i, self.n_slots, 1))
            self.residuals[node] = self.n_slots
            self.n_slots += 1

    def _batches(self, found: Found) -> tuple[Batch, ...]:
        return tuple(self.batch(kernel, g, k, rows) for (kernel, g, k), rows in found.items())

    def batch(self, kernel: Kernel, g: int, k: int, found: list[tuple[int, int, int]]) -> Batch:
        """The rows (row of the group, target, sign) of one kernel as a batch."""
        group = self.groups[g]
        rows, targets, signs = (np.array(x, np.int64) for x in zip(*found, strict=True))
        where = {name: j for j, name in enumerate(group.template.locals)}
        template = kernel.template
        columns = [*template.columns, *template.relation_columns]
        arguments = np.zeros((len(rows), len(kernel.columns)), np.int64)
        argument_signs = np.empty_like(arguments)
        for a, c in enumerate(kernel.columns):
            name, order = columns[c]
            j = where[name]
            argument_signs[:, a] = group.signs[rows, j]
            used = argument_signs[:, a] != 0
            if used.any():
                arguments[used, a] = self.table[order, group.variables[rows[used], j]]
        assert (arguments >= 0).all(), "what an equation reads is computed before it, or known"
        own = {name: j for j, name in enumerate(group.template.parameters)}
        parameters = group.parameters[rows][:, [own[template.parameters[p]] for p in kernel.parameters]]
        continuous = g < len(self.model.groups)
        equations = self.model.first_equations[g] + rows if continuous else -1 - group.owners[rows]
        relations = self._discrete(kernel, g, rows)
        return Batch(kernel, equations, targets, signs, arguments, argument_signs, parameters, relations)
