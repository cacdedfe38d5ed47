"""Relations and discrete variables of a program: the batches that update the discrete state at events."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.switch_times import has_known_zeros
from gearlib.program.build import Builder, Found, Place, build, slot_table
from gearlib.program.event_iteration import EventIteration, event_iteration
from gearlib.program.program import Batch, Newton, Program
from gearlib.reduce.discontinuities import jumping
from gearlib.reduce.reduction import Structure
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Uses = tuple[list[Node], Integers]


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
    of_time: NDArray[np.bool_]  # per used relation: compares nothing but time
    on_time: NDArray[np.bool_]  # and when it switches follows from a formula

    @cached_property
    def timed(self) -> Integers:
        """The relations whose switching times are known beforehand."""
        return self.used[self.on_time]

    @cached_property
    def searched(self) -> Integers:
        """The other relations, located by root search, in the order of the native root functions."""
        return self.used[~self.on_time]

    @cached_property
    def event_iteration(self) -> EventIteration:
        """How the discrete state is determined at an event."""
        return event_iteration(self.program, self.batches, self.discretes, self.reinits, self.used[self.of_time], self.searched)


def relations_of(structure: Structure, program: Program, wanted: Sequence[int] = ()) -> Relations:
    """Relations and discrete variables that a program, or an output, depends on, transitively; and those at which it has impulses."""
    model = structure.model
    builder = Builder(structure, (), program.states)
    jumps = [jump.places for jump in jumps_below(structure, program, model.parameters.defaults)]
    used = np.unique(np.concatenate([used_discrete(program), model.n_relations + np.array(wanted, np.int64), *jumps]))
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


class Jump(NamedTuple):
    """An equation, the order of its derivative that jumps, and the entries of the discrete state that make it jump."""

    equation: int
    order: int
    places: Integers


def differentiated_uses(structure: Structure, program: Program) -> Uses:
    """Equations that change at events, with the order of the derivative that a program uses; and the parameters in them."""
    if differentiated_uses not in program.memo:
        known = {*program.states, *program.inputs, *structure.is_state}
        found = {structure.equation(node) for node in program.slots.keys() - known if structure.computes(node)}
        uses = sorted((e, k) for e, k in found if k and e in structure.changing)
        places = [structure.model.places[e] for e, _ in uses]
        slots = [structure.model.groups[g].parameters[i] for g, i in places]
        program.memo[differentiated_uses] = uses, np.concatenate([np.empty(0, np.int64), *slots])
    result: Uses = program.memo[differentiated_uses]
    return result


def jumps_below(structure: Structure, program: Program, parameters: Floats) -> list[Jump]:
    """Where the equations of a program may jump below the derivatives that it contains, with some parameters."""
    if not structure.changing:
        return []
    uses, decisive = differentiated_uses(structure, program)
    key = parameters[decisive].tobytes()
    known: tuple[bytes, list[Jump]] | None = program.memo.get(jumps_below)
    if known is None or known[0] != key:
        known = program.memo[jumps_below] = key, [j for e, k in uses for j in _jumps(structure, e, k, parameters)]
    return known[1]


def _jumps(structure: Structure, e: int, used: int, parameters: Floats) -> Iterator[Jump]:
    model = structure.model
    g, i = model.places[e]
    group = model.groups[g]
    n = len(group.template.relations)
    for order in range(used):
        jumps = np.array(jumping(group, i, order, parameters), np.int64)
        relations, modes = jumps[jumps < n], jumps[jumps >= n] - n
        if len(jumps):
            places = model.first_relations[g] + i * n + relations, model.n_relations + group.discretes[i][modes]
            yield Jump(e, order, np.concatenate(places))


def update_rules(builder: Builder, program: Program, places: Sequence[Place], relations: Integers) -> Relations:
    """The batches of all places, over the slots of a program that are in the builder's table."""
    kinds: list[Found] = [defaultdict(list) for _ in range(3)]
    for kernel, g, i, kind, target, sign in places:
        kinds[kind][kernel, g, 0].append((i, target, sign))
    batches = [tuple(builder.batch(kernel, g, k, rows) for (kernel, g, k), rows in kind.items()) for kind in kinds]
    compared = {p[4]: p for p in places if p[3] == 0}
    others = {r for r, p in compared.items() if builder.nodes(*p[:3]) or len(builder.discrete(*p[:3]))}
    of_time = np.array([int(r) not in others for r in relations], bool)
    known = np.array([int(r) not in compared or has_known_zeros(compared[int(r)][0]) for r in relations[of_time]], bool)
    on_time = of_time.copy()
    on_time[of_time] = known
    return Relations(program, batches[0], batches[1], batches[2], relations, of_time, on_time)


def used_discrete(program: Program) -> Integers:
    """Relations and discrete values that a program depends on."""
    parts = [np.empty(0, np.int64)]
    for step in program.steps:
        if isinstance(step, Batch):
            parts.append(step.relations.ravel())
        elif isinstance(step, Newton):
            parts += [b.relations.ravel() for b in (*step.residuals, *step.jacobian)]
    return np.unique(np.concatenate(parts))
