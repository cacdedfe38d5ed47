"""Translational symmetries of a program: directions in state space along which its results are invariant.

A train looks the same however far it has turned, so that in steady rotation nothing but its angles may grow. A displacement ``dx`` is
such a symmetry if the linear parts of all equations map it to zero, and if it changes no argument that an equation is nonlinear in. The
displacement is propagated forward through the program as `gearlib.program.derivatives` propagates derivatives, with constant
coefficients only. So the result holds for all states: a spring inside its gap does not count as free.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import Kernel, is_zero_without, terms_of_parameters
from gearlib.program.interpret import Prepared, constant_values
from gearlib.program.program import Batch, Linear, Newton
from gearlib.program.relations import Relations

Floats = NDArray[np.float64]
LOOKS = 24  # random times and arguments at which a nonlinear kernel is sampled, besides one for each slope
DECADES = (-6.0, 4.0)  # range of magnitudes of these arguments
INDEPENDENT = 1e-9  # smallest singular value at which directions count as independent
CANCELLED = 1e-13  # of the terms of a sum: a change that small is their rounding


def symmetries(prepared: Prepared, targets: Sequence[int], events: tuple[Relations, Prepared] | None, scale: Floats) -> Floats:
    """Orthonormal basis of the state directions that leave all targets and event functions invariant.

    Parameters
    ----------
    prepared : Prepared
    targets : sequence of int
        Slots that must be invariant.
    events : pair, optional
        The program of the event functions, with the same parameters.
    scale : array
        Nominal values of the states, which scale the directions.

    Returns
    -------
    array, shape (states, how many)
    """
    n = len(scale)
    parts = [_Carried(prepared, scale).run(targets)]
    if events is not None:
        relations, numbers = events
        carried = _Carried(numbers, scale)
        changes = [carried.run(()), *(carried.change(batch) for batch in (*relations.batches, *relations.discretes))]
        parts.append(np.vstack([*changes, carried.constraints()]))
    wide = np.zeros((sum(map(len, parts)), n + sum(part.shape[1] - n for part in parts)))
    row, column = 0, n  # the iteration unknowns of each program have columns of their own
    for part in parts:
        here, own = slice(row, row + len(part)), slice(column, column + part.shape[1] - n)
        wide[here, :n], wide[here, own] = part[:, :n], part[:, n:]
        row, column = here.stop, own.stop
    kept = _null_space(wide)[:n]
    left, sizes, _ = np.linalg.svd(kept, full_matrices=False)
    found = left[:, sizes > INDEPENDENT]
    return np.where(np.abs(found) > INDEPENDENT, found, 0.0)


class _Carried:
    """Directional derivatives propagated through a program, one column per state and iteration unknown.

    With each change goes the sum of the magnitudes that it was added up from: what cancels in exact arithmetic (the twist between two
    gears of the same ratio) must be zero, since rows are scaled later.
    """

    def __init__(self, prepared: Prepared, scale: Floats) -> None:
        program = prepared.program
        self._prepared = prepared
        self._unknowns = [int(u) for s in program.steps if isinstance(s, Newton) for u in s.unknowns]
        n = len(scale)
        self.width = n + len(self._unknowns)
        self.slots = np.zeros((program.n_slots, self.width))
        self.slots[np.arange(n), np.arange(n)] = scale
        self.slots[self._unknowns, n + np.arange(len(self._unknowns))] = 1.0
        self._terms = np.abs(self.slots)
        self._rows: list[Floats] = []

    def run(self, targets: Sequence[int]) -> Floats:
        """Propagate through the program; returns what must vanish: changes of targets and of nonlinear arguments."""
        solutions = iter(self._prepared.solutions)
        for step in self._prepared.program.steps:
            if isinstance(step, Batch):
                self.slots[step.targets], self._terms[step.targets] = self._sums(step)
            elif isinstance(step, Linear):
                solution = next(solutions)
                change = solution @ self.slots[step.known]
                terms = np.abs(solution) @ self._terms[step.known] if isinstance(solution, np.ndarray) else np.abs(change)
                self.slots[step.unknowns], self._terms[step.unknowns] = _without_rounding(change, terms), terms
            else:
                rest, terms = np.zeros((2, len(step.unknowns), self.width))
                for batch in step.residuals:
                    change, size = self._sums(batch)
                    np.add.at(rest, batch.targets, change)
                    np.add.at(terms, batch.targets, size)
                self._rows.append(_without_rounding(rest, terms))
        return np.vstack([self.slots[list(targets)], self.constraints()])

    def constraints(self) -> Floats:
        """Changes of nonlinear arguments since the last call."""
        found, self._rows = self._rows, []
        return np.vstack([np.zeros((0, self.width)), *found])

    def change(self, batch: Batch) -> Floats:
        """Change of a batch's values through its constant coefficients; all other arguments go to the constraints."""
        return self._sums(batch)[0]

    def _sums(self, batch: Batch) -> tuple[Floats, Floats]:
        """Change of a batch's values, and the magnitude of the terms in it."""
        result, terms = np.zeros((2, len(batch), self.width))
        varying: dict[int, Batch] = {}
        for a in batch.active:
            slope = batch.derivative(a)
            constant, changing = (slope.part(part, slope.signs) for part in terms_of_parameters(slope.kernel))
            if not constant.kernel.is_zero:
                factor = constant_values(constant, self._prepared.parameters)[:, None]
                result += factor * self.slots[batch.arguments[:, a]]
                terms += np.abs(factor) * self._terms[batch.arguments[:, a]]
            if not changing.kernel.is_zero:
                varying[a] = changing
        if varying:
            moves = self.slots[batch.arguments[:, [*varying]]] * batch.argument_signs[:, [*varying], None]
            directions = self._directions(batch, [*varying.values()])
            sizes = np.abs(directions) @ self._terms[batch.arguments[:, [*varying]]]
            moves = _without_rounding(directions @ moves, sizes)
            self._rows.append(moves.reshape(-1, self.width))
        return _without_rounding(result, terms), terms

    def _directions(self, batch: Batch, slopes: Sequence[Batch]) -> Floats:
        """Per row, the directions of the arguments that its slopes belong to: one for a function of a difference."""
        random = np.random.default_rng(len(slopes))
        looks = LOOKS + len(slopes)  # fewer than the slopes could not tell all directions
        shape = (looks, len(batch.kernel.columns))
        points = np.where(random.random(shape) < 0.5, -1, 1) * 10.0 ** random.uniform(*DECADES, shape)
        flags = (random.random((looks, len(batch.kernel.relations))) < 0.5).astype(float)
        times = 10.0 ** random.uniform(*DECADES, looks)  # any: what vanishes at the start may not do so later
        values = [
            np.broadcast_to(self._slope(batch.kernel, slope, times, points, flags), (len(batch), looks)) for slope in slopes
        ]
        table = np.stack(values, axis=2)  # (rows, looks, arguments)
        absent = np.stack([self._absent(slope) for slope in slopes], axis=1)
        table[np.broadcast_to(absent[:, None], table.shape)] = 0.0
        hidden = ~(np.isfinite(table) & (table != 0)).any(axis=1) & ~absent  # outside a narrow interval that no look meets
        size = np.abs(table).max(axis=2, keepdims=True)
        with np.errstate(all="ignore"):
            table = np.nan_to_num(table / size)  # at most 1, or zero over zero, or at a pole
        table = np.concatenate([table, hidden[:, None] * np.eye(len(slopes))], axis=1)
        _, sizes, right = np.linalg.svd(table, full_matrices=False)
        return np.asarray(right * (sizes > INDEPENDENT * sizes[:, :1].clip(1e-300))[:, :, None], float)

    def _absent(self, slope: Batch) -> NDArray[np.bool_]:
        """The rows whose parameters are zero where that makes the partial derivative zero everywhere."""
        zero, names = self._prepared.parameters[slope.parameters] == 0, slope.kernel.parameters
        sets = [tuple(p for p, none in zip(names, row, strict=True) if none) for row in zero.tolist()]
        return np.array([bool(zeros) and is_zero_without(slope.kernel, zeros) for zeros in sets], bool)

    def _slope(self, kernel: Kernel, slope: Batch, times: Floats, points: Floats, flags: Floats) -> Floats:
        """A partial derivative of a kernel, with the parameters of each row, at some times and points."""
        arguments = [points[:, kernel.columns.index(c)] for c in slope.kernel.columns]
        constants = [self._prepared.parameters[slope.parameters[:, [p]]] for p in range(slope.parameters.shape[1])]
        relations = [flags[:, kernel.relations.index(r)] for r in slope.kernel.relations]
        with np.errstate(all="ignore"):
            return np.asarray(slope.kernel.function(times, *arguments, *constants, *relations), float)


def _without_rounding(change: Floats, terms: Floats) -> Floats:
    return np.where(np.abs(change) <= CANCELLED * terms, 0.0, change)


def _null_space(matrix: Floats) -> Floats:
    """Null space of a matrix, scaled by rows and columns so that weak couplings count as much as strong ones."""
    matrix = matrix[np.isfinite(matrix).all(axis=1) & matrix.any(axis=1)]
    column = np.ones(matrix.shape[1])
    if not len(matrix):
        return np.eye(matrix.shape[1])
    for _ in range(4):
        matrix = matrix / np.abs(matrix).max(axis=1, keepdims=True)
        factors = np.sqrt(np.abs(matrix).max(axis=0))
        factors[factors == 0] = 1.0
        matrix, column = matrix / factors, column / factors
    _, sizes, right = np.linalg.svd(matrix, full_matrices=len(matrix) < matrix.shape[1])
    rank = int((sizes > INDEPENDENT * max(float(sizes[0]), 1e-300)).sum())
    kept: Floats = column[:, None] * right[rank:].T
    return np.asarray(kept / np.abs(kept).max(axis=0, initial=1e-300), float)
