"""Programs that leave algebraic unknowns to the integrator: residuals of the equations instead of their solution.

Two forms. In the *index-reduced* one every unknown that a scene needs is an unknown of the integrator, and every equation a residual
F(t, y, y'): nothing is solved, sorted or eliminated. In the *torn* one only the tearing variables of the nonlinear blocks are, and
everything else is computed in sequence from these and the states, so that no Newton iteration runs within an evaluation.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import difference_kernel, residual_kernel
from gearlib.program.build import Builder, Found, Place, build, slot_table
from gearlib.program.program import Batch, Program
from gearlib.program.relations import Relations, relations_of, update_rules, used_discrete
from gearlib.reduce.reduction import Structure
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import reach

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class ResidualForm:
    """Equations as an integrator of differential-algebraic equations takes them.

    Attributes
    ----------
    unknowns : tuple of nodes
        The states, then the algebraic unknowns.
    n_states : int
    program : Program
        Computes the residuals F(t, y, y'), or the derivatives of the states followed by the residuals of the algebraic unknowns. Its
        ``states`` are the unknowns, followed by the derivatives of the states if it is implicit.
    relations : Relations or None
        Update rules of the discrete state as functions of the same unknowns.
    implicit : bool
        Whether the program computes F(t, y, y').
    """

    unknowns: tuple[Node, ...]
    n_states: int
    program: Program
    relations: Relations | None
    implicit: bool

    @property
    def algebraic(self) -> tuple[Node, ...]:
        return self.unknowns[self.n_states :]


def torn_form(structure: Structure, program: Program, relations: Relations | None, wanted: Sequence[int]) -> ResidualForm:
    """The torn form of a scene's program: the tearing variables of its nonlinear blocks are unknowns of the integrator.

    Parameters
    ----------
    structure : Structure
    program : Program
        Computes the derivatives of the states.
    relations : Relations, optional
        Update rules of the discrete state, if any.
    wanted : sequence of int
        Discrete variables that are outputs.
    """
    node_of = {slot: node for node, slot in program.slots.items()}
    tears = [node_of[slot] for step in program.iterated for slot in step.unknowns[step.lead :].tolist()]
    unknowns = (*program.states, *tears)
    found = build(structure, program.outputs, unknowns, dynamic=False)
    related = None if relations is None else relations_of(structure, found, wanted)
    return ResidualForm(unknowns, len(program.states), found, related, implicit=False)


def index_reduced_form(
    structure: Structure, states: tuple[Node, ...], outputs: Sequence[Node], wanted: Sequence[int], with_discrete: bool
) -> ResidualForm:
    """The index-reduced equations: every unknown that a scene needs, and the equation matched to it.

    Parameters
    ----------
    structure : Structure
    states : tuple of nodes
        The integrated states.
    outputs : sequence of nodes
        Nodes to include among the unknowns.
    wanted : sequence of int
        Discrete variables that are outputs.
    with_discrete : bool
        Whether there is a discrete state.
    """
    builder, model = Builder(structure, (), states), structure.model
    targets: dict[Node, None] = dict.fromkeys([*states, *outputs])
    used = model.n_relations + np.array(wanted, np.int64)
    while True:
        program = _residuals(structure, builder, states, targets)
        used = np.unique(np.concatenate([used, used_discrete(program)]))
        places = builder.places(used)
        used = np.unique(np.concatenate([used, *(builder.discrete(*p[:3]) for p in places)]).astype(np.int64))
        more = {n for p in places for n in builder.nodes(*p[:3])} - program.slots.keys()
        if not more and len(builder.places(used)) == len(places):
            break
        targets.update(dict.fromkeys(sorted(more)))
    n = len(program.states) - len(states)
    relations = _relations(builder, program, places, used) if with_discrete else None
    return ResidualForm(program.states[:n], len(states), program, relations, implicit=True)


def _residuals(structure: Structure, builder: Builder, states: tuple[Node, ...], targets: dict[Node, None]) -> Program:
    """One residual per unknown, from the equation matched to it."""
    place = {state: i for i, state in enumerate(states)}
    rates = [(v, k + 1) for v, k in states]
    found, _ = reach(structure, targets, dynamic=True)
    algebraic = sorted(set(found) - set(rates))
    unknowns = (*states, *algebraic)
    n = len(unknowns)
    slots = {node: n + i for i, node in enumerate(rates)} | {node: i for i, node in enumerate(unknowns)}
    first_input = n + len(states)
    slots |= {node: first_input + i for i, node in enumerate(builder.inputs)}
    first = first_input + len(builder.inputs)
    builder.table = slot_table(slots, structure.model.n_variables)
    rows: Found = defaultdict(list)
    for i, node in enumerate((*rates, *algebraic)):
        if node not in place:
            e, k = structure.equation(node)
            template, g, row = builder.template(e, k)
            rows[residual_kernel(template), g, k].append((row, first + i, 1))
    steps = [builder.batch(kernel, g, k, instances) for (kernel, g, k), instances in rows.items()]
    both = [(i, place[node]) for i, node in enumerate(rates) if node in place]  # a state and its derivative, both integrated
    if both:
        steps.append(_same(np.array(both, np.int64), n, first))
    residuals = tuple(range(first, first + n))
    return Program((*unknowns, *rates), builder.inputs, slots, first + n, tuple(steps), (), (), residuals)


def _same(pairs: Integers, n: int, first: int) -> Batch:
    """y'_i - y_j for states whose derivative is a state."""
    count = len(pairs)
    ones, nothing = np.ones(count, np.int64), np.zeros((count, 0), np.int64)
    arguments = np.column_stack([n + pairs[:, 0], pairs[:, 1]])
    kernel = difference_kernel("derivative of a state that is a state")
    return Batch(kernel, -ones, first + pairs[:, 0], ones, arguments, np.ones_like(arguments), nothing, nothing)


def _relations(builder: Builder, program: Program, places: list[Place], used: Integers) -> Relations:
    """The expressions that relations and discrete variables compare, as functions of the unknowns."""
    known = len(program.states) + len(program.inputs)
    helper = Program(program.states, program.inputs, program.slots, known, (), (), ())
    return update_rules(builder, helper, places, used[used < builder.model.n_relations])
