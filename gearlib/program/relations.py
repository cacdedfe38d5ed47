"""Relations and discrete variables of a program: the batches that update the discrete state at events."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.program.build import Builder, Found, Place, build
from gearlib.program.event_iteration import EventIteration, event_iteration
from gearlib.program.program import Batch, Newton, Program
from gearlib.reduce.reduction import Structure
from gearlib.structure.incidence import Node

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Relations:
    """Update rules of the discrete state, and the program that they need.

    The discrete state is numbered through the whole model: relations, then discrete values (see `gearlib.flatten.model.FlatModel`). Each
    batch holds one kernel; its targets are entries of the discrete state, or states for ``reinits``.
    """

    program: Program
    batches: tuple[Batch, ...]  # the compared expressions
    discretes: tuple[Batch, ...]
    reinits: tuple[Batch, ...]
    used: Integers  # relations, sorted
    on_time: NDArray[np.bool_]  # per used relation: compares nothing but time

    @cached_property
    def timed(self) -> Integers:
        """The relations that compare nothing but time: their switching times are known beforehand."""
        return self.used[self.on_time]

    @cached_property
    def searched(self) -> Integers:
        """The other relations, located by root search, in the order of the native root functions."""
        return self.used[~self.on_time]

    @cached_property
    def event_iteration(self) -> EventIteration:
        """How the discrete state is determined at an event."""
        return event_iteration(self.batches, self.discretes, self.reinits, self.timed)


def relations_of(structure: Structure, program: Program, wanted: Sequence[int] = ()) -> Relations:
    """Relations and discrete variables that a program, or an output, depends on, transitively."""
    model = structure.model
    builder = Builder(structure, (), program.states)
    used = np.union1d(used_discrete(program), model.n_relations + np.array(wanted, np.int64))
    while True:
        places = builder.places(used)
        nodes = sorted({n for p in places for n in builder.nodes(*p[:3])})
        helper = build(structure, nodes, program.states, dynamic=False)
        found = [builder.discrete(*p[:3]) for p in places]
        more = np.unique(np.concatenate([used, used_discrete(helper), *found]).astype(np.int64))
        if len(more) == len(used):
            break
        used = more
    builder.table = slot_table(helper.slots, model.n_variables)
    return update_rules(builder, helper, places, used[used < model.n_relations])


def update_rules(builder: Builder, program: Program, places: Sequence[Place], relations: Integers) -> Relations:
    """The batches of all places, over the slots of a program that are in the builder's table."""
    kinds: list[Found] = [defaultdict(list) for _ in range(3)]
    for kernel, g, i, kind, target, sign in places:
        kinds[kind][kernel, g, 0].append((i, target, sign))
    batches = [tuple(builder.batch(kernel, g, k, rows) for (kernel, g, k), rows in kind.items()) for kind in kinds]
    moving = {p[4] for p in places if p[3] == 0 and (builder.nodes(*p[:3]) or len(builder.discrete(*p[:3])))}
    on_time = np.array([int(r) not in moving for r in relations], bool)
    return Relations(program, batches[0], batches[1], batches[2], relations, on_time)


def used_discrete(program: Program) -> Integers:
    """Relations and discrete values that a program depends on."""
    parts = [np.empty(0, np.int64)]
    for step in program.steps:
        if isinstance(step, Batch):
            parts.append(step.relations.ravel())
        elif isinstance(step, Newton):
            parts += [b.relations.ravel() for b in (*step.residuals, *step.jacobian)]
    return np.unique(np.concatenate(parts))


def slot_table(slots: Mapping[Node, int], n_variables: int) -> Integers:
    """The slot of each variable and order of derivative, -1 where there is none."""
    table = np.full((1 + max((k for _, k in slots), default=0), n_variables), -1)
    for (v, k), slot in slots.items():
        table[k, v] = slot
    return table
