"""`LinearizedProgram`: a program at an operating point, its first derivatives, and their derivatives with respect to parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.linear.linear_model import full
from gearlib.linear.one_sided_slopes import APART, SMALL, Sides, warn_of_corners
from gearlib.linear.operating_point import Point, PointChange, slots_at
from gearlib.program.derivative_plan import derivative_plan
from gearlib.program.derivatives import MOST_DENSE, Added, At, derivatives
from gearlib.program.interpret import Prepared, evaluate, prepare
from gearlib.program.program import Program
from gearlib.program.second_derivatives import Direction, entry_changes
from gearlib.run.scene import Scene, node_name

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinearizedProgram:
    """A program at an operating point.

    Attributes
    ----------
    scene : Scene
        With the states that are known at the point, in the order of the program's.
    prepared : Prepared
    point : Point
    seeds : tuple of int
        Slots of states and inputs to differentiate with respect to, states first.
    added : tuple of (slot, seed, weight)
        Perturbations added to the values of unknowns.
    wanted : tuple of int, optional
        Slots to differentiate; all by default.
    """

    scene: Scene
    prepared: Prepared
    point: Point
    seeds: tuple[int, ...]
    added: tuple[Added, ...] = ()
    wanted: tuple[int, ...] | None = None

    @cached_property
    def _at(self) -> At:
        slots, discrete = slots_at(self.scene, self.prepared.parameters, self.prepared, self.point)
        return At(self.prepared, np.array([self.point.t]), slots[:, None], discrete[:, None])

    @property
    def slots(self) -> Floats:
        """Values of the program's slots at the point."""
        return self._at.slots[:, 0]

    @property
    def discrete(self) -> Floats:
        """Relations and discrete variables at the point."""
        return self._at.relations[:, 0]

    @cached_property
    def derivatives(self) -> Any:
        """Derivatives of the slots, shape (wanted, seeds + added seeds); sparse where a dense array would be large."""
        if not self.prepared.program.n_slots:  # nothing to compute
            return np.zeros((len(self.wanted or ()), self._width))
        return derivatives(self.prepared, self.point.t, self.slots, self.discrete, self.seeds, self.added, self.wanted)

    def warn_of_corners(self, rows: Sequence[int], basis: Any = None) -> None:
        """Warn of equations with other slopes on another side of the point, where they change some rows of `derivatives`.

        ``basis`` maps the states that remain to all states.
        """
        prepared, t, n = self.prepared, self.point.t, len(self.scene.states)

        def slopes(discrete: Floats, beside: Floats) -> list[Any]:
            there = self.slots + beside * np.maximum(np.abs(self.slots), 1.0)
            found = derivatives(prepared, t, there, discrete, self.seeds, self.added, self.wanted)[rows]
            return [found[:, :n] if basis is None else found[:, :n] @ basis, found[:, n:]]

        def moved(beside: Floats) -> tuple[Floats, Floats, Floats]:
            there = (self.slots + beside * np.maximum(np.abs(self.slots), 1.0))[:, None]
            return np.array([t]), there[:n], there[n : n + len(self.point.inputs)]

        def settled(beside: Floats) -> Floats:
            return self.scene.discrete_of(prepared, *moved(beside), self.point.guess, self.discrete)[:, 0]

        def jumps(discrete: tuple[Floats, Floats], way: Floats) -> list[str]:
            """What differs on the two sides by more than the way between them makes it."""
            near, far = (
                np.subtract(*(evaluate(prepared, *moved(side), own[:, None], self.slots)[wanted, 0] for side, own in ends))
                for ends in (list(zip((k * way, -k * way), discrete, strict=True)) for k in (1.0, 100.0))
            )
            terms = np.asarray(abs(self.derivatives[rows])[:, : len(self.seeds)] @ np.abs(self.slots[[*self.seeds]])).ravel()
            jump = np.abs(100 * near - far) / 99 > 0.1 * np.abs(near) + APART * np.abs(self.slots[wanted]) + SMALL * terms
            nodes = {slot: node for node, slot in prepared.program.slots.items()}
            return [node_name(structure.model, nodes[int(slot)]) for slot in wanted[jump]]

        if prepared.program.n_slots:
            structure = self.scene.structure
            wanted = np.arange(prepared.program.n_slots)[rows] if self.wanted is None else np.array(self.wanted, np.int64)[rows]
            sides = Sides(slopes, settled, jumps)
            warn_of_corners(structure, prepared.program, prepared.parameters, t, self.discrete, self._slots_of, sides)

    def _slots_of(self, program: Program) -> Floats:
        """Values of another program's slots at the point."""
        if program is self.prepared.program:
            return self.slots
        prepared = prepare(program, self.scene.structure, self.prepared.parameters)
        return slots_at(self.scene, prepared.parameters, prepared, self.point)[0]

    @property
    def _width(self) -> int:
        return len(self.seeds) + max((k + 1 for _, k, _ in self.added), default=0)

    def changes(self, names: Sequence[str], wanted: Sequence[int]) -> list[Any]:
        """Derivatives, with respect to parameters by path, of the matrix that `derivatives` returns: one matrix each.

        The operating point depends on the parameters, too: through start values bound to them, and in a steady state.

        Raises
        ------
        ArgumentError, NameLookupError, LoopError, StartError, SolverError
            Unknown parameter, or no derivative with respect to it.
        """
        program, n = self.prepared.program, len(self.seeds)
        moved = self._moved(names)
        if not program.n_slots:
            return [np.zeros((len(wanted), self._width)) for _ in names]
        table = np.zeros((len(self.prepared.parameters), len(names)))
        for p, k, weight in moved.parameters:
            table[p, k] = weight
        # no derivative of a linear program depends on any slot
        slots = np.zeros((program.n_slots, len(names))) if program.is_linear else self._slots_moved(moved, len(names))
        pairs = [*((slot, k) for k, slot in enumerate(self.seeds)), *((slot, n + k) for slot, k, _ in self.added)]
        plan = derivative_plan(program, pairs, wanted, self._width)
        weights = np.array([*[1.0] * n, *(weight for *_, weight in self.added)])
        values = entry_changes(plan, self._at, Direction(slots, table), weights)
        return [_matrix(values[:, k], plan.rows, plan.seeds, plan.shape) for k in range(len(names))]

    def slot_changes(self, names: Sequence[str]) -> Floats:
        """Derivatives of all slots with respect to parameters by path, shape (slots, parameters)."""
        return self._slots_moved(self._moved(names), len(names))

    def _moved(self, names: Sequence[str]) -> PointChange:
        assert self.point.change is not None, "the point was found with its parameters"
        return self.point.change(names)

    def _slots_moved(self, moved: PointChange, count: int) -> Floats:
        program, found = self.prepared.program, moved.find_states()
        states = np.array([found[node] for node in program.states]).reshape(-1, count)
        entering = [(program.n_slots + p, k, weight) for p, k, weight in moved.parameters]
        slopes = derivatives(self.prepared, self.point.t, self.slots, self.discrete, range(len(states)), entering)
        return np.asarray(slopes[:, : len(states)] @ states) + full(slopes[:, len(states) :])


def _matrix(values: Floats, rows: Any, columns: Any, shape: tuple[int, int]) -> Any:
    if shape[0] * shape[1] <= MOST_DENSE:
        full = np.zeros(shape)
        full[rows, columns] = values
        return full
    import scipy.sparse as sparse

    return sparse.csr_matrix((values, (rows, columns)), shape=shape)
