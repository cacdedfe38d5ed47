"""The event iteration as an ordered list of phases: `gearlib.run.scene` executes it with NumPy, `gearlib.native.events` prints it.

At an event the phases of a pass run in order, and passes are repeated until one changes nothing. Then states are re-initialised and the
values before the event are set to those after it; if that changes anything, all is repeated. Relations that are decided last keep their
values meanwhile: they are passed, too, once nothing else changes, and keep their values again as soon as anything does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import relation_kernel
from gearlib.equations.template import Relation
from gearlib.program.program import Batch, Program, slots_behind

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
MOST_ITERATIONS = 100  # of a pass, and of all, after which the event iteration has failed to converge
_COMPARED = {">=": np.greater_equal, ">": np.greater, "<=": np.less_equal, "<": np.less}


@dataclass(frozen=True, eq=False)
class UnknownsPhase:
    """Evaluate the slots of the program with the current discrete state.

    Attributes
    ----------
    batches : tuple of Batch, optional
        What the discrete variables that follow read, with all that it is computed from; None: everything is evaluated.
    """

    batches: tuple[Batch, ...] | None = None


@dataclass(frozen=True)
class DiscretesPhase:
    """Set discrete variables to the values of a batch."""

    batch: Batch


@dataclass(frozen=True, eq=False)
class RelationsPhase:
    """Set relations by comparing a batch's values with zero.

    Attributes
    ----------
    batch : Batch
    on_time : bool
        Whether they compare nothing but time, and take their right-hand limit.
    searched : bool
        Whether they are event functions: one whose root was located takes the side that it crossed to.
    """

    batch: Batch
    on_time: bool
    searched: bool

    @property
    def comparison(self) -> str:
        """The comparison with zero under which the relations hold."""
        relation = relation_of(self.batch)
        return f"{'<' if relation.negated else '>'}{'' if relation.strict else '='}"

    @property
    def last(self) -> bool:
        """Whether they keep their values until all else has settled (`gl.settled`)."""
        return relation_of(self.batch).last

    def hold(self, values: Floats) -> Floats:
        """1 where a relation holds, 0 where it does not."""
        return np.asarray(_COMPARED[self.comparison](values, 0.0), float)


@dataclass(frozen=True, eq=False)
class EventIteration:
    """Phases of the event iteration.

    Attributes
    ----------
    passed : tuple
        Phases of one pass.
    reinits : tuple of Batch
        New values of states (``reinit``), assigned once a pass changes nothing.
    """

    passed: tuple[UnknownsPhase | DiscretesPhase | RelationsPhase, ...]
    reinits: tuple[Batch, ...]

    @cached_property
    def has_last(self) -> bool:
        """Whether some relations are decided last."""
        return any(isinstance(p, RelationsPhase) and p.last for p in self.passed)

    @cached_property
    def event_functions(self) -> tuple[RelationsPhase, ...]:
        """The phases whose relations need a root search."""
        return tuple(p for p in self.passed if isinstance(p, RelationsPhase) and p.searched)


def event_iteration(
    program: Program,
    relations: tuple[Batch, ...],
    discretes: tuple[Batch, ...],
    reinits: tuple[Batch, ...],
    on_time: Integers,
    searched: Integers,
) -> EventIteration:
    """Event iteration for some batches over the slots of a program.

    ``on_time`` are the relations that compare nothing but time, ``searched`` those that are event functions.
    """
    passed: list[UnknownsPhase | DiscretesPhase | RelationsPhase] = []
    read = np.concatenate([np.empty(0, np.int64), *(batch.arguments.ravel() for batch in discretes)])
    if read.size:
        passed.append(UnknownsPhase(computed_alone(program, read)))
    passed += map(DiscretesPhase, discretes)  # first, so that an element that has just become stuck is tried as locked
    passed.append(UnknownsPhase())
    for batch in relations:
        kinds = np.isin(batch.targets, on_time), np.isin(batch.targets, searched)
        for kind in ((False, True), (True, True), (True, False)):
            if (rows := np.flatnonzero((kinds[0] == kind[0]) & (kinds[1] == kind[1]))).size:
                passed.append(RelationsPhase(batch.take(rows), *kind))
    return EventIteration(tuple(passed), reinits)


def computed_alone(program: Program, slots: Integers) -> tuple[Batch, ...] | None:
    """The equations that give some slots, in their order; None where some of them are solved together."""
    needed = slots_behind(program, slots)
    found = []
    for step in program.steps:
        if not isinstance(step, Batch):
            if needed[step.unknowns].any():
                return None
        elif (rows := np.flatnonzero(needed[step.targets])).size:
            found.append(step.take(rows))
    return tuple(found)


def right_hand(t: Floats) -> Floats:
    """Times slightly later, at which conditions on time take their right-hand limit."""
    return np.asarray(t + 1e-12 * np.maximum(np.abs(t), 1e-3), float)


def compares_with_before(batch: Batch) -> bool:
    """Whether a relation compares a discrete variable's value before the event."""
    template, n = batch.kernel.template, len(batch.kernel.template.relations)
    return any(template.discretes[i - n].startswith("pre(") for i in batch.kernel.relations if i >= n)


def relation_of(batch: Batch) -> Relation:
    """The relation that a kernel belongs to."""
    for j, relation in enumerate(batch.kernel.template.relations):
        if relation_kernel(batch.kernel.template, j) is batch.kernel:
            return relation
    raise AssertionError("a kernel without its relation")
