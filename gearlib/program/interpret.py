"""NumPy backend: interpret a Program, vectorised over time.

Used for outputs computed after a run, start values and linearisation, and for what is computed once per run: the factorised matrices of
linear blocks.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SingularError, SolverError
from gearlib.program.factored import Factored
from gearlib.program.newton import Correction, newton
from gearlib.program.program import ROUNDING, Batch, Linear, Newton, Program
from gearlib.program.scalars import constants
from gearlib.recent import recent
from gearlib.reduce.reduction import Structure
from gearlib.structure.sparse_elimination import factorise

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
MOST_INVERSES = 4  # matrices of linear blocks whose inverses a structure keeps
# Relative to the largest coefficient of an equation: smaller ones are artificial compliances (`gearparts.rotational.friction.YIELD` is
# 1e-27), which determine reactions that would be undetermined otherwise.
COMPLIANCE = 1e-20
SINGULAR = 1e-13  # reciprocal condition number below which a matrix counts as singular
MOST_DENSE = 400  # unknowns up to which a block's matrix is treated as dense
ENTRIES = 1_000_000  # matrix entries of a block at many times that are solved in one batch


@dataclass(frozen=True, eq=False)
class Prepared:
    """A program with its parameter values and the solution matrix of each linear block; and the same of the program of its relations."""

    program: Program
    structure: Structure
    parameters: Floats
    solutions: tuple[Floats | Factored, ...]  # in the order of the linear blocks: (unknowns, known)
    # replaces `evaluate`, if there is one
    compiled: Callable[[Floats, Floats, Floats, Floats, Floats | None, bool], Floats] | None = None
    relations: Prepared | None = None

    @property
    def listed(self) -> list[float]:
        """Entries of all solution matrices, concatenated."""
        listed: list[float] = []
        for s in self.solutions:
            listed += s.ravel().tolist() if isinstance(s, np.ndarray) else itertools.chain.from_iterable(s.tolist())
        return listed


def batch_values(batch: Batch, t: Floats | float, slots: Floats, parameters: Floats, relations: Floats) -> Floats:
    """The kernel's values, shape (instances, times)."""
    arguments = [slots[places] if signs is None else slots[places] * signs for places, signs in batch.columns]
    constants = [parameters[places] for places in batch.parameter_columns]
    discrete = [relations[batch.relations[:, r]] for r in range(batch.relations.shape[1])]
    with np.errstate(all="ignore"):
        value = np.asarray(batch.kernel.function(t, *arguments, *constants, *discrete), float)
    return value if batch.sign_column is None else value * batch.sign_column


def constant_values(batch: Batch, parameters: Floats) -> Floats:
    """Values of a kernel that depends on parameters only, shape (instances,); with parameters of many runs (instances, runs)."""
    with np.errstate(all="ignore"):
        value = batch.kernel.function(0.0, *parameters[batch.parameters.T])
    shape = (len(batch), *parameters.shape[1:])
    value = np.asarray(value, float)
    if value.shape != shape:
        value = np.broadcast_to(value, shape)
    return value * (batch.signs if parameters.ndim == 1 else batch.signs[:, None])


def prepare(program: Program, structure: Structure, parameters: Floats, relations: Program | None = None) -> Prepared:
    """Factorise the constant blocks of a program, and of that of its relations, and check that no pivot vanishes.

    Raises
    ------
    SingularError
        Names the components whose values make the block singular.
    """
    return Prepared(
        program, structure, parameters, _solutions(program, structure, parameters),
        relations=None if relations is None else prepare(relations, structure, parameters),
    )  # fmt: skip


def _divided(program: Program, structure: Structure, parameters: Floats, row: int) -> SingularError:
    for batch in program.pivots:
        if row < len(batch):
            break
        row -= len(batch)
    names = ", ".join(f"{structure.model.parameters.names[p]} = {parameters[p]:g}" for p in batch.parameters[row])
    owner = owner_of(structure, int(batch.equations[row]))
    return SingularError(f"{owner}: {batch.kernel.template.label} cannot be solved with {names}; division by zero")


def _solutions(program: Program, structure: Structure, parameters: Floats) -> tuple[Floats | Factored, ...]:
    """Solution matrices of the linear blocks, that of the last numbers where the entries of a block are as they were.

    Lists, since a few numbers are compared faster so than in arrays.
    """
    function = constants(program)
    if function is not None:
        try:
            everything = function(parameters.tolist())
        except (ZeroDivisionError, ValueError, OverflowError):  # the array backend gives nan or inf instead
            function = None
        else:
            pivots, *matrices = (everything[here] for here in program.constant_parts)
    if function is None:
        groups = ([constant_values(b, parameters) for b in group] for group in program.constant_groups)
        pivots, *matrices = (np.concatenate([np.empty(0), *group]).tolist() for group in groups)
    if 0.0 in pivots or not all(map(math.isfinite, pivots)):
        wrong = next(k for k, pivot in enumerate(pivots) if pivot == 0.0 or not math.isfinite(pivot))
        raise _divided(program, structure, parameters, wrong)
    found = []
    for k, (block, entries) in enumerate(zip(program.linear_blocks, matrices, strict=True)):
        known = program.solved.get(k)
        if known is None or known[0] != entries:
            known = entries, _solution(block, structure, np.array(entries, float))
            if function is not None:  # few enough to be kept
                program.solved[k] = known
        found.append(known[1])
    return tuple(found)


def regular(program: Program, parameters: Floats) -> NDArray[np.bool_]:
    """In which runs no pivot vanishes; ``parameters`` has the shape (parameters, runs)."""
    found = np.ones(parameters.shape[1], bool)
    for batch in program.pivots:
        values = constant_values(batch, parameters)
        found &= ((values != 0.0) & np.isfinite(values)).all(axis=0)
    return found


def solutions_of_runs(program: Program, parameters: Floats) -> tuple[list[Floats], NDArray[np.bool_]]:
    """Solution matrices of the linear blocks in many runs, (runs, unknowns, known) each, and in which runs all could be solved."""
    runs = parameters.shape[1]
    found, solved = [], np.ones(runs, bool)
    for block in program.steps:
        if isinstance(block, Linear):
            n = len(block.unknowns)
            entries = np.concatenate([constant_values(b, parameters) for b in block.matrix])
            if (entries == entries[:, :1]).all():  # what varies is not in this block
                entries = entries[:, :1]
            matrices = np.zeros((n * n, entries.shape[1]))
            for place, row in zip(block.places.tolist(), entries, strict=True):
                matrices[place] += row
            inverses, good = _inverses(matrices.T.reshape(-1, n, n))
            found.append(np.broadcast_to(-inverses[:, :, block.known_rows], (runs, n, len(block.known_rows))))
            solved &= good
    return found, solved


def owner_of(structure: Structure, equation: int) -> str:
    """Path of the component that an equation comes from."""
    if equation < 0:
        instance = structure.model.instances[-1 - equation]
        return instance.path or instance.kind
    return structure.model.owner(*structure.model.places[equation])


def labelled(structure: Structure, batch: Batch, row: int) -> str:
    """Text of an equation, with the path of the component that it comes from."""
    who, label = owner_of(structure, int(batch.equations[row])), batch.kernel.template.label
    return label if label.startswith(f"{who}: ") else f"{who}: {label}"  # the root component is named by its class


def _solution(block: Linear, structure: Structure, entries: Floats) -> Floats | Factored:
    """Solution matrix: the columns of -inverse(A) that have a right-hand side."""
    n = len(block.unknowns)
    places = block.places
    if not np.isfinite(entries).all():
        raise _singular(block, structure)
    if n <= MOST_DENSE:
        inverse = _inverse(structure, n, places, entries)
        if inverse is None:
            raise _singular(block, structure)
        solved: Floats = -inverse[:, block.known_rows]
        return solved
    import scipy.sparse as sparse
    from scipy.sparse.linalg import splu

    try:
        factors = splu(sparse.csc_matrix((entries, np.divmod(places, n)), shape=(n, n)))
    except RuntimeError:
        raise _singular(block, structure) from None
    diagonal = np.abs(factors.U.diagonal())
    if not diagonal.min() > SINGULAR * diagonal.max() * 1e-3:
        raise _singular(block, structure)
    return Factored(factors, block.known_rows)


def block_solve(prepared: Prepared, block: int, right: Floats) -> Floats:
    """``inverse(A) @ right`` for a linear block, by its number; the stored solution has only the columns of known slots."""
    step = prepared.program.linear_blocks[block]
    solution = prepared.solutions[block]
    if isinstance(solution, Factored):
        return solution.solve(right)
    entries = np.concatenate([constant_values(b, prepared.parameters) for b in step.matrix])
    inverse = _inverse(prepared.structure, len(step.unknowns), step.places, entries)
    assert inverse is not None, "the block was prepared with these parameters"
    return np.asarray(inverse @ right, float)


def _inverse(structure: Structure, n: int, places: Integers, entries: Floats) -> Floats | None:
    """Inverse of a matrix, None if it is singular; cached, since the programs of a structure share blocks."""
    key = places.tobytes(), entries.tobytes()
    known: dict[Any, Floats | None] = structure.inverses
    return recent(known, key, lambda: _inverted(n, places, entries), MOST_INVERSES)


def _inverted(n: int, places: Integers, entries: Floats) -> Floats | None:
    inverses, good = _inverses(np.asarray(np.bincount(places, entries, n * n), float).reshape(1, n, n))
    return inverses[0] if good[0] else None


def _inverses(matrices: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Inverses of many matrices, (runs, n, n), and which of them are regular; of the others there is no inverse."""
    good: NDArray[np.bool_] = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    matrices = np.where(good[:, None, None], matrices, 1.0)
    rows = np.abs(matrices).max(axis=2)
    matrices = np.asarray(matrices / np.where(rows > 0.0, rows, 1.0)[:, :, None], float)
    columns = np.abs(matrices).max(axis=1)
    good &= rows.all(axis=1) & columns.all(axis=1)
    rows, columns = (np.where(good[:, None], scale, 1.0) for scale in (rows, columns))
    matrices = np.asarray(np.where(good[:, None, None], matrices / columns[:, None, :], np.eye(matrices.shape[1])), float)
    try:
        inverses = np.asarray(np.linalg.inv(matrices), float)
    except np.linalg.LinAlgError:  # of one of them: none is said to be regular, so that each run is looked at by itself
        return matrices, np.zeros(len(matrices), bool)
    one, other = (np.abs(m).sum(axis=1).max(axis=1) for m in (matrices, inverses))
    good &= np.asarray(one * other < 1 / SINGULAR)
    return np.asarray(inverses / columns[:, :, None] / rows[:, None, :], float), good


def _joined(block: Linear | Newton, structure: Structure) -> list[str]:
    """The variables that occur in connection equations of a block."""
    model, rows = structure.model, [structure.model.places[int(e)] for e in block.equations]
    return [model.name(v) for v in dict.fromkeys(v for g, i in rows for v in model.groups[g].variables[i].tolist())]


def _singular(block: Linear | Newton, structure: Structure) -> SingularError:
    owners = list(dict.fromkeys(owner_of(structure, int(e)) for e in block.equations))
    owners = [o for o in owners if o != "connection"] or _joined(block, structure)
    some = ", ".join(owners[:8]) + (f" and {len(owners) - 8} more" if len(owners) > 8 else "")
    return SingularError(
        f"the equations of {some} are singular with these parameters: they leave a torque or an acceleration undetermined "
        "(a mass that is zero, two rigid paths, or ratios that cancel)"
    )


def evaluate(
    prepared: Prepared, t: Floats, states: Floats, inputs: Floats, relations: Floats, guess: Floats | None = None,
    forgiving: bool = False,
) -> Floats:  # fmt: skip
    """Evaluate all slots of a program.

    Parameters
    ----------
    t : array, shape (times,)
    states, inputs, relations : arrays, shape (number, times)
    guess : array, shape (slots,) or (slots, times), optional
        Initial guess of Newton's iterations: for the first time (each later time starts from the solution before it), or for each time.
    forgiving : bool
        Whether equations without a solution leave their unknowns where the search ended, at the times at which they have none.

    Returns
    -------
    array, shape (slots, times)
    """
    if prepared.compiled is not None:
        return prepared.compiled(t, states, inputs, relations, guess, forgiving)
    program = prepared.program
    slots = np.zeros((program.n_slots, len(t)))
    n, m = len(program.states), len(program.inputs)
    slots[:n] = states
    slots[n : n + m] = inputs
    solutions = iter(prepared.solutions)
    for step in program.steps:
        if isinstance(step, Batch):
            slots[step.targets] = batch_values(step, t, slots, prepared.parameters, relations)
        elif isinstance(step, Linear):
            slots[step.unknowns] = next(solutions) @ slots[step.known]
        else:
            try:
                _solve_block(step, prepared, t, slots, relations, guess)
            except SolverError:
                if not forgiving:
                    raise
                for i in range(len(t)) if len(t) > 1 else ():  # at one of them there is none, at others there may be
                    one = slice(i, i + 1)
                    own = guess[:, one] if guess is not None and guess.ndim == 2 else guess
                    with suppress(SolverError):
                        _solve_block(step, prepared, t[one], slots[:, one], relations[:, one], own)
    return slots


def _solve_block(step: Newton, prepared: Prepared, t: Floats, slots: Floats, relations: Floats, guess: Floats | None) -> None:
    """Solve a block: at all times at once where each has its own guess, else sequentially, each from the solution before."""
    n, times = len(step.unknowns), len(t)
    if step.linear or (guess is not None and guess.ndim == 2):
        # linear blocks start from zero: a guess costs digits of small unknowns, and undetermined ones shall be zero
        start = np.zeros((n, times)) if step.linear or guess is None else guess[step.unknowns]
        together = max(1, ENTRIES // (n**2 if n <= MOST_DENSE or step.order is None else len(step.order.places)))
        for first in range(0, times, together):
            here = slice(first, first + together)
            _iterate(step, prepared, t[here], slots[:, here], relations[:, here], start[:, here])
        return
    last = np.zeros((n, 1)) if guess is None else guess[step.unknowns, None]
    for i in range(times):
        here = slice(i, i + 1)
        _iterate(step, prepared, t[here], slots[:, here], relations[:, here], last)
        last = slots[step.unknowns, here]


def _iterate(step: Newton, prepared: Prepared, t: Floats, slots: Floats, relations: Floats, start: Floats) -> None:
    """Newton's method, vectorised over time; if any matrix is singular, the times are solved one by one."""
    n, left, iteration = len(step.unknowns), np.arange(len(t)), 0

    def equations(z: Floats) -> tuple[Floats, Correction]:
        here, discrete, now = slots[:, left], relations[:, left], t[left]
        here[step.unknowns] = z[:, left]
        order = step.order if n > MOST_DENSE else None
        if order is not None:
            batches = [replace(b, targets=order.entries(b.targets)) for b in step.jacobian]
            entries = assemble(batches, now, here, prepared.parameters, discrete, len(order.places))

            def sparse_correction(residual: Floats) -> Floats:
                change = np.zeros_like(z)
                for i, column in enumerate(left.tolist()):
                    own = z[:, column], float(now[i])
                    change[:, column] = _sparse_step(
                        step, prepared.structure, order.matrix(entries[:, i].copy()), residual[:, i], *own
                    )
                return change

            return assemble(step.residuals, now, here, prepared.parameters, discrete, n), sparse_correction
        matrix = assemble(step.jacobian, now, here, prepared.parameters, discrete, n * n).T.reshape(len(now), n, n)

        def correction(residual: Floats) -> Floats:
            change = np.zeros_like(z)
            try:
                change[:, left] = solve_regular(matrix, residual.T[:, :, None])[:, :, 0].T
            except np.linalg.LinAlgError:
                if len(left) > 1:
                    raise
                own = z[:, left[0]], float(now[0])
                change[:, left[0]] = _singular_step(step, prepared.structure, matrix[0], residual[:, 0], *own)
            return change

        return assemble(step.residuals, now, here, prepared.parameters, discrete, n), correction

    def settled(z: Floats, change: Floats, _: Floats) -> bool:
        nonlocal left, iteration
        size, moved = np.abs(z[:, left]).max(axis=0), np.abs(change[:, left]).max(axis=0)
        done = moved <= 1e-14 * size + 1e-300
        if iteration > 8:
            done |= moved <= 1e-11 * size + ROUNDING
        iteration += 1
        left = left[:0] if step.linear else left[~done]
        return not len(left)

    found = newton(equations, start, settled, 50)
    slots[step.unknowns] = found.x
    if found.singular:
        for i in left.tolist():
            one = slice(i, i + 1)
            _iterate(step, prepared, t[one], slots[:, one], relations[:, one], start[:, one])
        return
    if len(left):
        raise SolverError(
            f"the nonlinear equations {_labels(step, prepared.structure)} were not solved at t = {t[left[0]]:g} s; they have no "
            "solution there, or need better guesses: guess={...} of their variables"
        )


def solve_regular(matrices: Floats, right: Floats) -> Floats:
    """Solve many systems of linear equations, (times, n, n) and (times, n, sides).

    Raises
    ------
    LinAlgError
        One of them is singular, or so nearly that rounding decides what it leaves open: locked elements that hold the same motion by
        ratios that are no short binary numbers. By another right-hand side, of irregular numbers, on equations in units of their own.
    """
    n = matrices.shape[1]
    rows = np.ldexp(1.0, -np.frexp(np.abs(matrices).max(axis=2, initial=0.0))[1])[:, :, None]
    columns = np.ldexp(1.0, -np.frexp(np.abs(matrices * rows).max(axis=1, initial=0.0))[1])[:, :, None]
    irregular = np.broadcast_to(np.cos(1.0 + np.arange(n) ** 2)[:, None], (len(matrices), n, 1))
    scaled = matrices * rows * np.swapaxes(columns, 1, 2)
    found = np.linalg.solve(scaled, np.concatenate([right * rows, irregular], axis=2))
    if (np.abs(found[:, :, -1]) >= 1 / SINGULAR).any():
        raise np.linalg.LinAlgError
    return np.asarray(found[:, :, :-1] * columns, float)


def _sparse_step(step: Newton, structure: Structure, matrix: Any, residual: Floats, z: Floats, t: float) -> Floats:
    """Newton step of a large block."""
    from scipy.sparse.linalg import splu

    try:
        factors = splu(matrix)
    except RuntimeError:
        return _singular_step(step, structure, matrix, residual, z, t)
    diagonal = np.abs(factors.U.diagonal())
    if not diagonal.min() > SINGULAR * diagonal.max():
        return _singular_step(step, structure, matrix, residual, z, t)
    return np.asarray(factors.solve(residual), float)


def _singular_step(step: Newton, structure: Structure, matrix: Any, residual: Floats, z: Floats, t: float) -> Floats:
    """A Newton step for a singular matrix (dense: of minimum norm); a perturbation where a residual remains (x**2 = 4 at x = 0)."""
    dense = isinstance(matrix, np.ndarray)
    finite = bool(np.isfinite(matrix if dense else matrix.data).all() and np.isfinite(residual).all())
    change: Floats = np.zeros(len(z))
    if finite:
        change = _least(matrix, residual) if dense else _least_sparse(matrix, residual)
    largest = np.abs(matrix).max(axis=1) if dense else np.abs(matrix).max(axis=1).toarray().ravel()
    units = np.where(largest > 0.0, largest, 1.0)  # of each equation
    if not finite or np.abs((residual - matrix @ change) / units).max() > 1e-9 * np.abs(residual / units).max():
        if step.linear or not finite:
            raise SolverError(
                f"the equations {_labels(step, structure)} have no solution at t = {t:g} s: they depend on each other there. Where "
                "friction meets a spring, a damper or other friction at a node without inertia, put an Inertia there"
            )
        change = np.asarray(change - 1e-3 * np.maximum(np.abs(z), 1.0), np.float64)
    return change


def _least(matrix: Floats, right: Floats) -> Floats:
    """The smallest solution of equations that depend on each other up to rounding.

    Where artificial compliances tell the unknowns that shall be small, the sum of their squares times these is made as small as can be,
    so that locked elements share what is open as the compliances would have it.
    """
    scale = np.ldexp(1.0, -np.frexp(np.abs(matrix).max(axis=1))[1])
    compliant, weights = compliances(matrix)
    stiff = np.where(compliant, 0.0, matrix) * scale[:, None]
    left, sizes, back = np.linalg.svd(stiff)
    rank = int((sizes > SINGULAR * sizes[0]).sum())
    found = back[:rank].T @ (left[:, :rank].T @ (right * scale) / sizes[:rank])
    free = back[rank:].T
    found = found - free @ np.linalg.lstsq(weights[:, None] * free, weights * found, rcond=SINGULAR)[0]
    if np.abs(right * scale - stiff @ found).max() <= 1e-12 * np.abs(right * scale).max():
        return np.asarray(found, float)
    try:
        return np.asarray(np.linalg.solve(matrix, right), float)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], float)


def compliances(matrix: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """Which entries are artificial compliances, and the roots of what they weigh the square of each unknown with."""
    size = np.abs(matrix)
    relative = size / np.maximum(size.max(axis=1), np.finfo(float).tiny)[:, None]
    compliant = (relative > 0.0) & (relative <= COMPLIANCE)
    return compliant, np.sqrt(relative.max(axis=0, initial=0.0, where=compliant) * size.max(axis=0))


def _least_sparse(matrix: Any, right: Floats) -> Floats:
    """The same for a large block: what no compliance tells is zero."""
    import scipy.sparse as sparse

    factors, sizes = factorise(matrix), abs(matrix)
    found, entries, of_row, of_column = (
        factors.solve(right),
        sizes.tocoo(),
        *(sizes.max(axis=k).toarray().ravel() for k in (1, 0)),
    )
    relative = entries.data / of_row[entries.row]
    compliant = (relative > 0.0) & (relative <= COMPLIANCE)
    weights = np.zeros(len(found))
    np.maximum.at(weights, entries.col[compliant], np.sqrt(relative[compliant] * of_column[entries.col[compliant]]))
    free = sparse.diags(factors.column) @ factors.continued(np.eye(len(factors.open)))
    return np.asarray(found - free @ np.linalg.lstsq(weights[:, None] * free, weights * found, rcond=SINGULAR)[0], float)


def _labels(step: Newton, structure: Structure) -> str:
    """The equations of a block, each with the path of its component."""
    labels = list(dict.fromkeys(labelled(structure, b, row) for b in step.residuals for row in range(len(b))))
    return "; ".join(labels[:4]) + (f" and {len(labels) - 4} more" if len(labels) > 4 else "")


def assemble(batches: Sequence[Batch], t: Floats, slots: Floats, parameters: Floats, relations: Floats, size: int) -> Floats:
    """Scatter-add the values of batches at their targets, shape (size, times)."""
    result = np.zeros((size, slots.shape[1]))
    for batch in batches:
        np.add.at(result, batch.targets, batch_values(batch, t, slots, parameters, relations))
    return result
